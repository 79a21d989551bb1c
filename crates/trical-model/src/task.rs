//! Long work, as whoever waits for it sees it: how far it is, and whether it is still wanted.
//!
//! ```
//! use std::cell::RefCell;
//! use trical_model::Task;
//!
//! let heard = RefCell::new(Vec::new());
//! let report = |fraction: f64, what: &str| heard.borrow_mut().push((fraction, what.to_owned()));
//! let done = Task::run(&report, || false, |task| {
//!     let half = task.part(0.0, 0.5);
//!     half.step(0.5, "reading")?;
//!     task.step(0.75, "fitting")
//! });
//! assert!(done.is_ok());
//! assert_eq!(heard.into_inner(), [(0.25, "reading".to_owned()), (0.75, "fitting".to_owned())]);
//! ```

use crate::error::Result;
use crate::interrupt::{checkpoint, stoppable};

/// Hears how far the work is, from 0 to 1, and what is being done.
pub type Report<'a> = &'a dyn Fn(f64, &str);

/// A piece of long work, or a part of one. It reports, and it ends early when it was cancelled. Loops deep inside that cannot say how
/// far they are look for that alone ([`checkpoint`]).
#[derive(Clone, Copy)]
pub struct Task<'a> {
    report: Report<'a>,
    from: f64,
    to: f64,
}

impl<'a> Task<'a> {
    /// The whole of a piece of work that reports.
    #[must_use]
    pub fn new(report: Report<'a>) -> Self {
        Self { report, from: 0.0, to: 1.0 }
    }

    /// Work of which nobody wants to hear.
    #[must_use]
    pub fn silent() -> Task<'static> {
        Task::new(&|_, _| ())
    }

    /// Runs `work` on this thread; it ends soon after `cancelled` says true, which is not asked again then.
    pub fn run<T>(
        report: Report<'_>,
        cancelled: impl FnMut() -> bool + 'static,
        work: impl FnOnce(&Task<'_>) -> T,
    ) -> T {
        stoppable(cancelled, || work(&Task::new(report)))
    }

    /// The part of the work from one fraction to another: its own fractions run from 0 to 1.
    #[must_use]
    pub fn part(&self, from: f64, to: f64) -> Self {
        Self { from: self.of_whole(from), to: self.of_whole(to), ..*self }
    }

    fn of_whole(&self, fraction: f64) -> f64 {
        self.from + fraction * (self.to - self.from)
    }

    /// Says that this fraction (0 to 1) is done, and what comes now.
    pub fn report(&self, fraction: f64, what: &str) {
        (self.report)(self.of_whole(fraction), what);
    }

    /// As [`Self::report`], and ends the work when it was cancelled.
    ///
    /// # Errors
    /// [`crate::ModelError::Stopped`].
    pub fn step(&self, fraction: f64, what: &str) -> Result<()> {
        self.report(fraction, what);
        checkpoint()
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;
    use crate::error::ModelError;

    #[test]
    fn a_part_of_a_part_reports_fractions_of_the_whole() {
        let heard = RefCell::new(Vec::new());
        let report = |fraction: f64, _: &str| heard.borrow_mut().push(fraction);
        let part = Task::new(&report).part(0.2, 0.6).part(0.5, 1.0);
        for fraction in [0.0, 0.5, 1.0] {
            part.report(fraction, "");
        }
        let off = heard.into_inner().iter().zip([0.4, 0.5, 0.6]).map(|(a, b): (&f64, f64)| (a - b).abs()).sum::<f64>();
        assert!(off < 1e-15);
    }

    #[test]
    fn cancelled_work_ends_at_its_next_step() {
        let mut asked = 0;
        let cancelled = move || {
            asked += 1;
            asked > 2
        };
        let steps = |task: &Task<'_>| (0..10).map(|_| task.step(0.0, "")).take_while(Result::is_ok).count();
        assert_eq!(Task::run(&|_, _| (), cancelled, steps), 2);
        assert_eq!(Task::run(&|_, _| (), || true, |task| task.part(0.0, 0.5).step(0.0, "")), Err(ModelError::Stopped));
        assert_eq!(Task::silent().step(0.0, ""), Ok(()));
    }
}
