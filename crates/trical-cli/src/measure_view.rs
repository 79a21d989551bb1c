//! The bar and the lines that a person sees while the arm measures.

use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};
use trical_device::Progress;
use trical_device::session::Told;

/// The view: on standard error, and only on a terminal.
pub struct View {
    bar: ProgressBar,
    told: Told,
}

impl View {
    /// Nothing shown yet.
    pub fn new() -> Self {
        let bar = ProgressBar::new(0);
        if let Ok(style) = ProgressStyle::with_template("  measuring [{bar:30}] {pos}/{len}\n  {msg}") {
            bar.set_style(style.progress_chars("=> "));
        }
        Self { bar, told: Told::default() }
    }

    /// Shows what happens.
    pub fn show(&mut self, p: &Progress) {
        let now = Instant::now();
        self.told.take(p, now);
        let (done, total) = self.told.counts();
        self.bar.set_length(total as u64);
        self.bar.set_position(done as u64);
        self.bar.set_message(self.told.lines(now).join("\n  "));
    }

    /// Takes the view away.
    pub fn end(&self) {
        self.bar.finish_and_clear();
    }
}
