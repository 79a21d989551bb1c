//! Faults that come by themselves: a script for the virtual cell.

use super::Fault;

/// When a fault begins; each counts from the start of the cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum When {
    /// After so many motions.
    Motions(u64),
    /// After so many requests to the receiver.
    Readings(u64),
    /// After so many requests to the controller.
    Commands(u64),
    /// After so many simulated s.
    Seconds(f64),
}

/// A fault with its time.
#[derive(Clone, Debug, PartialEq)]
pub struct Scheduled {
    /// When it begins.
    pub when: When,
    /// How long it lasts, counted as `when`; `None` = for good.
    pub lasts: Option<f64>,
    /// What it is.
    pub fault: Fault,
}

/// What has happened in a cell so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counters {
    pub(super) motions: u64,
    pub(super) readings: u64,
    pub(super) commands: u64,
    pub(super) clock: f64,
}

impl Scheduled {
    /// Whether it is there now.
    pub(super) fn is_active(&self, now: &Counters) -> bool {
        let (now, begin) = match self.when {
            When::Motions(n) => (now.motions as f64, n as f64),
            When::Readings(n) => (now.readings as f64, n as f64),
            When::Commands(n) => (now.commands as f64, n as f64),
            When::Seconds(s) => (now.clock, s),
        };
        now >= begin && self.lasts.is_none_or(|lasts| now < begin + lasts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_begins_and_ends_in_its_own_count() {
        let fault = Scheduled { when: When::Motions(3), lasts: Some(2.0), fault: Fault::Silence };
        let active: Vec<bool> =
            (0..7).map(|motions| fault.is_active(&Counters { motions, readings: 99, ..Counters::default() })).collect();
        assert_eq!(active, [false, false, false, true, true, false, false]);
        let for_good = Scheduled { when: When::Seconds(1.5), lasts: None, fault: Fault::Silence };
        assert!(!for_good.is_active(&Counters { clock: 1.4, ..Counters::default() }));
        assert!(for_good.is_active(&Counters { clock: 1e9, ..Counters::default() }));
    }
}
