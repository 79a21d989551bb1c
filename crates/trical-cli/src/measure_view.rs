//! A session that measures, in the words of the command line: the bar and the lines that a person sees while the arm measures, what was
//! done, what went wrong.

use std::path::Path;
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};
use trical_device::session::{RunStatus, SessionError};
use trical_device::{Progress, RunReport, Session};
use trical_report::table;

use crate::error::{CliError, Result};

/// The view: on standard error, and only on a terminal.
pub struct View {
    bar: ProgressBar,
    status: RunStatus,
}

impl View {
    /// Nothing shown yet.
    pub fn new() -> Self {
        let bar = ProgressBar::new(0);
        if let Ok(style) = ProgressStyle::with_template("  measuring [{bar:30}] {pos}/{len}\n  {msg}") {
            bar.set_style(style.progress_chars("=> "));
        }
        Self { bar, status: RunStatus::default() }
    }

    /// Shows what happens.
    pub fn show(&mut self, p: &Progress) {
        let now = Instant::now();
        self.status.take(p, now);
        let (done, total) = self.status.counts();
        self.bar.set_length(total as u64);
        self.bar.set_position(done as u64);
        self.bar.set_message(self.status.lines(now).join("\n  "));
    }

    /// Takes the view away.
    pub fn end(&self) {
        self.bar.finish_and_clear();
    }
}

/// Runs a session, with the words of the command line: the way on where it is broken off is up to the caller.
pub fn perform(session: &Session<'_>, then: &str, watch: &mut dyn FnMut(Progress)) -> Result<RunReport> {
    session.perform(watch).map_err(|e| match e {
        SessionError::Run(e) if e.goes_on() => CliError::Failed(format!("{e}; what was measured is safe{then}")),
        SessionError::Run(_) | SessionError::Finish(_) => CliError::Failed(e.to_string()),
        SessionError::Recording(e) => e.into(),
        SessionError::Controller(e) => e.into(),
        SessionError::Gauge(e) => e.into(),
        _ => CliError::Input(e.to_string()),
    })
}

/// What a run did, in a sentence.
pub fn done(report: &RunReport, out: &Path) -> String {
    format!(
        "{} measured ({} had been done before), {}; recorded in {}",
        table::counted(report.measured, "touch"),
        report.skipped,
        table::counted(report.corrections, "correction"),
        out.display()
    )
}
