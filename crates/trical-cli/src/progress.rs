//! Progress on standard error, only on a terminal.

use indicatif::{ProgressBar, ProgressStyle};
use trical_model::Task;

/// Runs `work` with a bar from 0 to 1, which is gone when it ends.
pub fn with_bar<T>(title: &str, work: impl FnOnce(&Task<'_>) -> T) -> T {
    let bar = ProgressBar::new(1000);
    if let Ok(style) = ProgressStyle::with_template("  {prefix:<14} [{bar:30}] {percent:>3} % {msg}") {
        bar.set_style(style.progress_chars("=> "));
    }
    bar.set_prefix(title.to_owned());
    let done = work(&Task::new(&|fraction, what| {
        bar.set_position((fraction.clamp(0.0, 1.0) * 1000.0) as u64);
        bar.set_message(what.to_owned());
    }));
    bar.finish_and_clear();
    done
}
