//! What a person sees while the arm measures: which ball, which touch of how many, reading by iteration, time left, warnings.

use std::time::{Duration, Instant};

use crate::procedure::Progress;

/// What a person is told while the arm measures.
#[derive(Debug, Default)]
pub struct RunStatus {
    begin: Option<Instant>,
    /// Touches that were done when this run began.
    before: Option<usize>,
    done: usize,
    total: usize,
    touch: String,
    lengths: Vec<f64>,
    warnings: Vec<String>,
}

impl RunStatus {
    /// Takes what happens, at a time.
    pub fn take(&mut self, p: &Progress, now: Instant) {
        match p {
            Progress::Begin { index, ball, done, total } => {
                self.begin.get_or_insert(now);
                self.before.get_or_insert(*done);
                (self.done, self.total) = (*done, *total);
                self.touch = format!("touch {} of {total} (seq {index}), ball {}", done + 1, ball + 1);
                self.lengths.clear();
            }
            Progress::Reading { reading, .. } => {
                self.lengths.push(reading.iter().map(|r| r * r).sum::<f64>().sqrt());
            }
            Progress::Measured { done, total, .. } => (self.done, self.total) = (*done, *total),
            Progress::Warning(w) => self.warnings.push(w.clone()),
        }
    }

    /// Touches that are done, of how many.
    #[must_use]
    pub fn counts(&self) -> (usize, usize) {
        (self.done, self.total)
    }

    /// Which touch, and reading of each iteration.
    #[must_use]
    pub fn touch(&self) -> String {
        let r: Vec<String> = self.lengths.iter().map(|r| format!("{:.4}", r * 1e3)).collect();
        if r.is_empty() { self.touch.clone() } else { format!("{}: reading {} mm", self.touch, r.join(" > ")) }
    }

    /// Three lines: touch and reading of each iteration; time left; the last warnings.
    #[must_use]
    pub fn lines(&self, now: Instant) -> Vec<String> {
        let mut lines = vec![self.touch()];
        let here = self.done - self.before.unwrap_or(0).min(self.done);
        if let (Some(begin), true) = (self.begin, here > 0) {
            let each = now.duration_since(begin) / u32::try_from(here).unwrap_or(u32::MAX);
            let left = each * u32::try_from(self.total.saturating_sub(self.done)).unwrap_or(u32::MAX);
            lines.push(format!("{} done, about {} left", self.done, in_words(left)));
        }
        lines.extend(self.warnings.iter().rev().take(2).rev().map(|w| format!("note: {w}")));
        lines
    }
}

/// A duration as people say it.
fn in_words(d: Duration) -> String {
    match d.as_secs() {
        s @ 0..=90 => format!("{s} s"),
        s @ 91..=5400 => format!("{} min", s.div_ceil(60)),
        s => format!("{} h {:02} min", s / 3600, s % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ball_touch_residuals_time_left_and_warnings_are_shown() {
        let mut state = RunStatus::default();
        let begin = Instant::now();
        let later = |s| begin + Duration::from_secs(s);
        state.take(&Progress::Begin { index: 20, ball: 1, done: 20, total: 45 }, begin);
        state.take(&Progress::Reading { index: 20, corrections: 0, reading: [3e-4, 0.0, 4e-4] }, begin);
        state.take(&Progress::Reading { index: 20, corrections: 1, reading: [0.0, 3e-6, 0.0] }, begin);
        assert_eq!(state.lines(begin), ["touch 21 of 45 (seq 20), ball 2: reading 0.5000 > 0.0030 mm"]);
        state.take(&Progress::Warning("low battery".into()), begin);
        state.take(&Progress::Begin { index: 21, ball: 2, done: 21, total: 45 }, later(10));
        let lines = state.lines(later(10));
        assert_eq!(lines, ["touch 22 of 45 (seq 21), ball 3", "21 done, about 4 min left", "note: low battery"]);
    }

    #[test]
    fn durations_in_words() {
        let says = |s| in_words(Duration::from_secs(s));
        assert_eq!((says(59), says(120), says(7260)), ("59 s".into(), "2 min".into(), "2 h 01 min".into()));
    }
}
