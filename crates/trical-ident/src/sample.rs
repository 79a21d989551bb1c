//! Some rows that stand for all, where closed forms, robust fits and the first steps of a fit need no more.
//!
//! A row is chosen by a hash of its number, so that picks follow no pattern of the recording; the first rows of each sort (ball,
//! target, anchor) are always among them, so that nothing is left out that a parameter needs.

use std::collections::BTreeMap;

use trical_model::Measured;

use crate::dataset::{Dataset, Observation};

/// Rows of a sample, about.
pub const SAMPLE: usize = 8192;

/// Rows of each sort that are always among them.
pub(crate) const FIRST: usize = 40;

/// Data of fewer observations than this are taken whole: a sample would save little.
const LARGE: usize = 4 * SAMPLE;

/// Which ball, target or anchor: rows of which the model sees different things.
pub(crate) fn sort_of(m: &Measured) -> (u8, usize) {
    match m {
        Measured::Touch { ball, .. } => (0, *ball),
        Measured::Point { target, .. } => (1, *target),
        Measured::Distance { anchor, .. } => (2, *anchor),
        Measured::Pose { .. } => (3, 0),
        Measured::Reference { reference, .. } => (4, *reference),
    }
}

/// A hash of a line's number (Steele, Lea & Flood 2014): picks that follow no pattern of the recording.
pub(crate) fn scatter(line: usize, file: usize) -> u64 {
    let mut z = (line as u64).wrapping_add((file as u64) << 48).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A sample of the observations, in their order; `None` where there are so few that all are better taken.
pub(crate) fn sample(data: &Dataset) -> Option<Dataset> {
    let n = data.observations.len();
    if n < LARGE {
        return None;
    }
    let every = n.div_ceil(SAMPLE) as u64;
    let mut seen: BTreeMap<(usize, (u8, usize)), usize> = BTreeMap::new();
    let mut chosen: Vec<Observation> = Vec::with_capacity(SAMPLE + SAMPLE / 8);
    for o in &data.observations {
        let before = seen.entry((o.recording, sort_of(&o.measured))).or_insert(0);
        *before += 1;
        if *before <= FIRST || scatter(o.row, o.recording).is_multiple_of(every) {
            chosen.push(*o);
        }
    }
    Some(Dataset { observations: chosen, ..data.shell() })
}
