//! Some rows that stand for all, where closed forms, robust fits and the first steps of a fit need no more.
//!
//! A row, or a run of poses, is chosen by a hash of its number, so that picks follow no pattern of the recording; the first rows of each sort (ball,
//! target, anchor) are always among them, so that nothing is left out that a parameter needs.

use std::collections::{BTreeMap, BTreeSet};

use trical_recording::stream::{FIRST, SAMPLE, scatter};

use crate::dataset::{Dataset, Observation};

/// Data of fewer observations than this are taken whole: a sample would save little.
const LARGE: usize = 4 * SAMPLE;

/// A sample of the observations, in their order; `None` where there are so few that all are better taken.
pub(crate) fn sample(data: &Dataset) -> Option<Dataset> {
    let n = data.observations.len();
    if n < LARGE {
        return None;
    }
    let every = n.div_ceil(SAMPLE) as u64;
    let mut seen: BTreeMap<_, usize> = BTreeMap::new();
    let mut chosen: Vec<Observation> = Vec::with_capacity(SAMPLE + SAMPLE / 8);
    for o in &data.observations {
        let before = seen.entry((o.recording, o.measured.of_which())).or_insert(0);
        *before += 1;
        if *before <= FIRST || scatter(o.row, o.recording).is_multiple_of(every) {
            chosen.push(*o);
        }
    }
    Some(Dataset { observations: chosen, ..data.shell() })
}

/// Some `most` of the poses, in their order; `None` where there are no more.
///
/// They are taken in runs of so many neighbours, so that most stand beside the one before, from which they were reached.
#[must_use]
pub fn sample_poses(data: &Dataset, most: usize, run: usize) -> Option<Dataset> {
    let mut runs: BTreeMap<(usize, usize), BTreeSet<usize>> = BTreeMap::new();
    let mut first: BTreeMap<_, BTreeSet<usize>> = BTreeMap::new();
    for o in &data.observations {
        runs.entry((o.recording, o.pose / run)).or_default().insert(o.pose);
        let first = first.entry((o.recording, o.measured.of_which())).or_default();
        if first.len() < FIRST {
            first.insert(o.pose);
        }
    }
    if runs.values().map(BTreeSet::len).sum::<usize>() <= most {
        return None;
    }
    let mut poses: BTreeSet<usize> = first.into_values().flatten().collect();
    let mut order: Vec<_> = runs.into_iter().collect();
    order.sort_by_key(|((recording, run), _)| scatter(*run, *recording));
    for (_, run) in order {
        if poses.len() >= most {
            break;
        }
        poses.extend(run);
    }
    Some(data.filtered(|o| poses.contains(&o.pose)))
}

#[cfg(test)]
mod tests {
    use trical_model::{Measured, State};

    use super::*;
    use crate::dataset::JointSource;

    /// Touches of ball 1 in their order, the last 30 of ball 2.
    fn touches(count: usize) -> Dataset {
        let observation = |row: usize| {
            let ball = usize::from(row > count - 30);
            let measured = Measured::Touch { ball, reading: [0.0; 3] };
            Observation {
                state: State::at(&[0.0; 6]),
                measured,
                frame: 0,
                pose: row - 1,
                recording: 0,
                row,
                line: row + 1,
            }
        };
        Dataset {
            places: Vec::new(),
            names: vec!["a".into()],
            fingerprints: vec![crate::dataset::repeated::Fingerprint::default()],
            observations: (1..=count).map(observation).collect(),
            rejected: Vec::new(),
            poses: count,
            frame_of_recording: vec![None],
            references: Vec::new(),
            joints: JointSource::Read,
            dof: 6,
        }
    }

    #[test]
    fn few_rows_are_taken_whole() {
        assert!(sample(&touches(LARGE - 1)).is_none());
    }

    #[test]
    fn a_sample_is_as_large_as_it_says_spread_over_all_and_has_what_is_rare() {
        let all = touches(100_000);
        let some = sample(&all).map(|s| s.observations).unwrap_or_default();
        assert!(some.len() > SAMPLE * 9 / 10 && some.len() < SAMPLE * 11 / 10, "{}", some.len());
        assert!(some.windows(2).all(|w| w[0].row < w[1].row));
        let of_ball_2 = some.iter().filter(|o| matches!(o.measured, Measured::Touch { ball: 1, .. })).count();
        assert_eq!(of_ball_2, 30);
        // as many from each tenth of the recording, to what chance does
        for tenth in 0..10 {
            let n = some.iter().filter(|o| (o.row - 1) / 10_000 == tenth).count();
            assert!((650..1000).contains(&n), "{n} from tenth {tenth}");
        }
    }

    #[test]
    fn a_sample_of_poses_is_of_whole_runs_from_everywhere_and_has_some_of_what_is_rare() {
        let all = touches(10_000);
        assert!(sample_poses(&all, 10_000, 16).is_none());
        let some = sample_poses(&all, 2000, 16).map(|s| s.observations).unwrap_or_default();
        assert!((2000..2016).contains(&some.len()), "{}", some.len());
        let of_ball_2 = some.iter().filter(|o| matches!(o.measured, Measured::Touch { ball: 1, .. })).count();
        assert_eq!(of_ball_2, 30);
        let beside = some.windows(2).filter(|w| w[1].pose == w[0].pose + 1).count();
        assert!(beside > 2000 * 14 / 16, "{beside}");
        for tenth in 0..10 {
            let n = some.iter().filter(|o| o.pose / 1000 == tenth).count();
            assert!((120..300).contains(&n), "{n} from tenth {tenth}");
        }
    }
}
