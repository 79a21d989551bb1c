//! What calls give to the routines of the same RAPID file, and what its functions return.

use std::collections::HashMap;

use crate::names::Origin;

/// Calls inside the arguments of calls, and data set from data, that are followed, at most.
pub(super) const DEEPEST: usize = 8;
/// Calls of a routine that are told apart, at most.
pub(super) const MOST_CALLS: usize = 1000;
/// Steps from calls to what they give, at most; what is not followed is listed.
const MOST_STEPS: usize = 100_000;

/// What each call of a routine gives, by the routine's hashed name.
pub(super) type Each = HashMap<u64, Vec<Vec<(u64, Given)>>>;

/// What a call gives for an argument.
#[derive(Clone, Debug)]
pub(super) enum Given {
    Place(Origin),
    Frame(String),
    /// A tool or a work object that is no name: an element of a list, a part of a record.
    Unclear,
}

/// What calls give to the routines of a file, and what functions return.
#[derive(Debug, Default)]
pub(super) struct Calls {
    /// Of the call that is being read: what it gives, by what the arguments are called outside the routine.
    pub given: Vec<(u64, Given)>,
    pub all: Each,
    /// What functions return, by their hashed names.
    pub returned: HashMap<u64, Vec<Origin>>,
    /// Names for what a call of a function returns, the function, and which of its calls it is.
    pub results: Vec<(u64, u64, usize)>,
    /// Tools and work objects that are arguments: what the calls give for them, and the routine.
    pub arguments: HashMap<String, (u64, u64)>,
    /// Calls in which the one is that is being read.
    pub depth: usize,
    /// Steps that were followed.
    steps: usize,
}

impl Calls {
    pub fn of(&self, routine: u64, call: usize) -> Vec<(u64, Given)> {
        self.all.get(&routine).and_then(|all| all.get(call)).cloned().unwrap_or_default()
    }

    /// Whether one more step is followed.
    pub fn goes_on(&mut self, depth: usize) -> bool {
        self.steps += 1;
        depth <= DEEPEST && self.steps <= MOST_STEPS
    }
}

/// What a call gives for this argument.
pub(super) fn place_of(given: &[(u64, Given)], argument: u64) -> Option<Origin> {
    given.iter().find_map(|(key, given)| match given {
        Given::Place(origin) if *key == argument => Some(*origin),
        _ => None,
    })
}
