//! What tells recordings from each other, and measurements that were given twice: they would count twice, and no error at unseen poses would be one.

use std::collections::{HashMap, HashSet};

use sha2::{Digest, Sha256};
use trical_model::{Recording, Row};

use crate::error::{IdentError, Result};

/// So many measurements in a row that are the same to the last bit come from one file, not from one arm.
const CHANCE: usize = 5;

/// So many measurements of a recording tell a part of it.
const MARKS: usize = 4096;

/// What tells a recording from others, whatever its name or format.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Fingerprint {
    /// A hash of its joints and measurements, 16 hexadecimal digits.
    pub whole: String,
    /// A hash of each measurement, each once and in order; the smallest ones of a recording with more than `MARKS`.
    pub marks: Vec<u32>,
}

impl Fingerprint {
    fn new(recording: &Recording, mut marks: Vec<u32>) -> Self {
        let mut hash = Sha256::new();
        for row in &recording.rows {
            for value in row.state.q[..recording.joints].iter().chain(row.measured.lengths().1) {
                hash.update(value.to_le_bytes());
            }
        }
        marks.sort_unstable();
        marks.dedup();
        marks.truncate(MARKS);
        Self { whole: hash.finalize()[..8].iter().map(|byte| format!("{byte:02x}")).collect(), marks }
    }

    /// Of a recording.
    #[must_use]
    pub fn of(recording: &Recording) -> Self {
        Self::new(recording, marks(recording))
    }

    /// Whether it is that recording, or half of its measurements are of it.
    #[must_use]
    pub fn is_of(&self, other: &Self) -> bool {
        // of a long recording only measurements below the last that is kept can be looked for
        let last = if other.marks.len() < MARKS { None } else { other.marks.last() };
        let sought = || self.marks.iter().filter(|m| last.is_none_or(|last| *m <= last));
        let found = sought().filter(|m| other.marks.binary_search(m).is_ok()).count();
        (!self.whole.is_empty() && self.whole == other.whole) || (found >= CHANCE && 2 * found >= sought().count())
    }
}

/// What tells a measurement from others: joints and what was measured.
fn mark(row: &Row, joints: usize) -> u32 {
    let mut hash = Sha256::new();
    let (_, lengths) = row.measured.lengths();
    row.state.q[..joints].iter().chain(lengths).for_each(|x| hash.update(x.to_le_bytes()));
    let (what, number) = row.measured.of_which().unwrap_or_default();
    hash.update(row.measured.instrument());
    hash.update(what);
    hash.update(number.to_le_bytes());
    hash.finalize()[..4].iter().fold(0, |mark, byte| mark << 8 | u32::from(*byte))
}

fn marks(recording: &Recording) -> Vec<u32> {
    recording.rows.iter().map(|row| mark(row, recording.joints)).collect()
}

fn wrong(recording: &Recording, problem: String) -> IdentError {
    IdentError::of_file(&recording.name, problem)
}

/// Refuses recordings that hold the same measurements: whole ones, whatever their names and formats; at least half of one in another; the
/// rows of one that are repeated further down in it, as where it was joined with itself. Returns the fingerprint of each.
///
/// # Errors
/// One sentence that names both.
pub fn refuse_repeated(recordings: &[Recording]) -> Result<Vec<Fingerprint>> {
    let marks: Vec<Vec<u32>> = recordings.iter().map(marks).collect();
    let prints: Vec<Fingerprint> = recordings.iter().zip(&marks).map(|(r, m)| Fingerprint::new(r, m.clone())).collect();
    for (k, print) in prints.iter().enumerate() {
        if let Some(same) = prints[..k].iter().position(|p| p.whole == print.whole) {
            let problem =
                format!("holds the same measurements as {}; expected each recording once", recordings[same].name);
            return Err(wrong(&recordings[k], problem));
        }
    }
    let sets: Vec<HashSet<u32>> = marks.iter().map(|own| own.iter().copied().collect()).collect();
    for (k, (recording, own)) in recordings.iter().zip(&marks).enumerate() {
        if let Some((again, first, length)) = within(own) {
            let rows = |from: usize| format!("{} to {}", from + 1, from + length);
            let problem = format!(
                "rows {} hold the same measurements as rows {}; expected each measurement once",
                rows(again),
                rows(first)
            );
            return Err(wrong(recording, problem));
        }
        for (other, theirs) in recordings.iter().zip(&sets).take(k) {
            let shared = sets[k].intersection(theirs).count();
            let fewer = theirs.len().min(own.len());
            if shared >= CHANCE && 2 * shared >= fewer {
                let (all, other) = (own.len(), &other.name);
                let problem =
                    format!("{shared} of its {all} measurements are in {other} too; expected each measurement once");
                return Err(wrong(recording, problem));
            }
        }
    }
    Ok(prints)
}

/// The first stretch of rows that are, one after the other, the same as a stretch above: where it begins, where that begins, how long.
fn within(marks: &[u32]) -> Option<(usize, usize, usize)> {
    let mut last: HashMap<u32, usize> = HashMap::new();
    // from where on rows repeat those so many above, and how many are above
    let mut run: Option<(usize, usize)> = None;
    for k in 0..=marks.len() {
        let above = marks.get(k).and_then(|m| last.insert(*m, k)).map(|before| k - before);
        match run {
            Some((_, distance)) if above == Some(distance) => {}
            _ => {
                if let Some((begin, distance)) =
                    run.filter(|(begin, distance)| k - begin >= CHANCE && k - begin <= *distance)
                {
                    return Some((begin, begin - distance, k - begin));
                }
                run = above.map(|distance| (k, distance));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use trical_model::{Measured, State};

    /// Rows of a recording, each by its number.
    fn recording(name: &str, rows: impl IntoIterator<Item = u32>) -> Recording {
        let row = |k: u32| Row {
            state: State::at(&[f64::from(k) * 0.1, 0.2]),
            measured: Measured::Touch { ball: 0, reading: [0.0; 3] },
            seq: None,
            line: 0,
        };
        Recording { name: name.into(), joints: 2, rows: rows.into_iter().map(row).collect(), ..Recording::default() }
    }

    fn told(recordings: &[Recording]) -> String {
        refuse_repeated(recordings).map_or_else(|e| e.to_string(), |_| String::new())
    }

    #[test]
    fn a_recording_given_twice_is_refused_also_in_parts_and_joined_with_itself() {
        let (a, copy, part) = (recording("a", 0..30), recording("copy", 0..30), recording("part", 10..25));
        assert_eq!(told(&[a.clone(), copy]), "copy: holds the same measurements as a; expected each recording once");
        assert_eq!(
            told(&[a.clone(), part]),
            "part: 15 of its 15 measurements are in a too; expected each measurement once"
        );
        let both = recording("both", (0..30).chain(100..190));
        assert_eq!(told(&[a, both]), "both: 30 of its 120 measurements are in a too; expected each measurement once");
        let twice = recording("a", (0..30).chain(0..30));
        let expected = "a: rows 31 to 60 hold the same measurements as rows 1 to 30; expected each measurement once";
        assert_eq!(told(&[twice]), expected);
    }

    #[test]
    fn a_part_of_a_recording_is_known_again_and_one_with_some_of_its_poses_is_another() {
        let print = |rows: std::ops::Range<u32>| Fingerprint::of(&recording("", rows));
        let (short, long) = (print(0..30), print(0..20_000));
        assert_eq!((short.marks.len(), long.marks.len()), (30, MARKS));
        for part in [print(0..30), print(10..18), print(15..45)] {
            assert!(part.is_of(&short));
        }
        assert!(!print(20..45).is_of(&short) && !print(0..4).is_of(&short) && !print(40..90).is_of(&short));
        // of a long one a fifth of its measurements is kept
        assert!(
            print(300..400).is_of(&long) && !print(20_000..20_400).is_of(&long) && !print(19_900..21_000).is_of(&long)
        );
        // files of before there were marks
        let whole = |of: &Fingerprint| Fingerprint { marks: Vec::new(), ..of.clone() };
        assert!(short.is_of(&whole(&short)) && !long.is_of(&whole(&short)));
        assert!(!Fingerprint::default().is_of(&Fingerprint::default()));
    }

    #[test]
    fn poses_that_are_visited_again_and_sessions_with_few_poses_in_common_are_none() {
        assert_eq!(told(&[recording("a", (0..30).chain([3, 3, 4, 7, 6]))]), "");
        assert_eq!(told(&[recording("a", 0..30), recording("b", 26..60)]), "");
        // without any noise, five poses again and again
        assert_eq!(told(&[recording("a", (0..50).map(|k| k % 5))]), "");
    }
}
