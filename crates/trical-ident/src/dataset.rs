//! Recordings as observations: which joint angles are used, which rows belong to one pose, which measuring frame a
//! row was seen in.

pub mod readings;
pub mod references;
pub mod repeated;
pub mod sample;
pub mod torque_load;

use std::collections::BTreeMap;

use nalgebra::Vector3;
use trical_model::{Joints, Measured, Motion, Recording, Row, State, residual_rows};

use crate::dataset::references::{References, Seen, move_by};
use crate::dataset::repeated::{Fingerprint, refuse_repeated};
use crate::error::{IdentError, Result};
use crate::rigid::mean;

/// Which joint angles the model uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JointSource {
    /// Those that the controller reported (`q`).
    #[default]
    Read,
    /// Those that were commanded (`qc`).
    Commanded,
}

impl JointSource {
    /// What a row says of the arm, with the joint angles that are used.
    pub(crate) fn state(self, row: &Row, recording: &str) -> Result<State> {
        if self == Self::Read {
            return Ok(row.state);
        }
        let q = row.state.q_commanded.ok_or_else(|| {
            let problem = "has no commanded joints (qc1_deg ...), which were asked for";
            IdentError::at_line(recording, row.line, problem)
        })?;
        Ok(State { q, ..row.state })
    }
}

/// One measurement that the model can predict.
#[derive(Clone, Copy, Debug)]
pub struct Observation {
    /// What is known about the arm.
    pub state: State,
    /// What was measured; points and poses after registration by the references.
    pub measured: Measured,
    /// Measuring frame (0-based); 0 for measurements that need none.
    pub frame: usize,
    /// Pose that it belongs to (0-based, over all recordings).
    pub pose: usize,
    /// Recording that it came from (0-based).
    pub recording: usize,
    /// Row over all recordings, counted from 1, references included.
    pub row: usize,
    /// Line in its file.
    pub line: usize,
}

impl Observation {
    /// Whether both were measured at one pose, and all that is known of the arm there is the same.
    #[must_use]
    pub fn is_in_state_of(&self, other: &Self) -> bool {
        (self.recording, self.pose) == (other.recording, other.pose) && self.state == other.state
    }
}

/// A row that is not used, and why.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Rejected {
    /// File.
    pub recording: String,
    /// Line in it.
    pub line: usize,
    /// Row over all recordings, counted from 1.
    pub row: usize,
    /// In words.
    pub reason: String,
}

/// "15 rows rejected, 9 of them such as line 8: only 2 of 3 references were seen at this pose"; `None` where there are
/// none.
#[must_use]
pub fn rejected_in_words(rejected: &[Rejected]) -> Option<String> {
    let mut alike: BTreeMap<String, (usize, &Rejected)> = BTreeMap::new();
    for r in rejected {
        // but for their numbers
        let words = r.reason.chars().filter(|c| !c.is_ascii_digit()).collect();
        alike.entry(words).or_insert((0, r)).0 += 1;
    }
    let (count, commonest) = alike.into_values().max_by_key(|(count, _)| *count)?;
    Some(match (rejected.len(), count) {
        (1, _) => format!("1 row rejected, line {}: {}", commonest.line, commonest.reason),
        (n, same) if same == n => format!("{n} rows rejected, such as line {}: {}", commonest.line, commonest.reason),
        (n, same) => format!("{n} rows rejected, {same} of them such as line {}: {}", commonest.line, commonest.reason),
    })
}

/// Observations of one arm, from one or several recordings.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// Names of the recordings.
    pub names: Vec<String>,
    /// What tells each recording from others, whatever its name.
    pub fingerprints: Vec<Fingerprint>,
    /// Names of the places where the set of balls stood, of each recording; empty for one that does not say.
    pub places: Vec<Vec<String>>,
    /// The observations, in the order of the recordings.
    pub observations: Vec<Observation>,
    /// Rows left out.
    pub rejected: Vec<Rejected>,
    /// Number of poses.
    pub poses: usize,
    /// Measuring frame of each recording that has one.
    pub frame_of_recording: Vec<Option<usize>>,
    /// References of each measuring frame; empty where it has none.
    pub references: Vec<References>,
    /// Which joint angles are used.
    pub joints: JointSource,
    /// Number of the arm's joints.
    pub dof: usize,
}

impl Dataset {
    /// Gathers recordings of one arm. Each recording with points or poses gets a measuring frame of its own. `known` are
    /// references of an earlier session, frame by frame: then this data is registered to them.
    ///
    /// # Errors
    /// Recordings of arms with different numbers of joints, no commanded joints where they are asked for, or nothing to use.
    pub fn build(recordings: &[Recording], joints: JointSource, known: Option<&[References]>) -> Result<Self> {
        let Some(first) = recordings.first() else {
            return Err(IdentError::NotEnough("no recording was given".into()));
        };
        let fingerprints = refuse_repeated(recordings)?;
        let mut this = Self {
            names: recordings.iter().map(|r| r.name.clone()).collect(),
            fingerprints,
            places: recordings.iter().map(|r| r.places.clone()).collect(),
            observations: Vec::new(),
            rejected: Vec::new(),
            poses: 0,
            frame_of_recording: Vec::new(),
            references: Vec::new(),
            joints,
            dof: first.joints,
        };
        let mut row = 0;
        for (index, recording) in recordings.iter().enumerate() {
            if recording.joints != this.dof {
                let problem = format!(
                    "has {} joints, but {} has {}; recordings of one arm are expected",
                    recording.joints, first.name, first.joints
                );
                return Err(IdentError::at(&recording.name, "header", problem));
            }
            let framed = recording.rows.iter().any(|r| {
                matches!(r.measured, Measured::Point { .. } | Measured::Pose { .. } | Measured::Reference { .. })
            });
            this.frame_of_recording.push(framed.then_some(this.references.len()));
            let first_observation = this.observations.len();
            let references = this.take(index, recording, row)?;
            row += recording.rows.len();
            if framed {
                let known = known.and_then(|k| k.get(this.references.len()));
                let found = this.register(first_observation, &references, known);
                this.references.push(found);
            }
        }
        if this.observations.is_empty() {
            let why =
                rejected_in_words(&this.rejected).unwrap_or_else(|| "its rows are of fixed references only".into());
            return Err(IdentError::NotEnough(format!(
                "{}: no measurement is left to use ({why})",
                this.names.join(", ")
            )));
        }
        Ok(this)
    }

    /// Adds the observations of one recording, whose rows come behind `before` others. Its references are returned, each with its pose.
    fn take(&mut self, index: usize, recording: &Recording, before: usize) -> Result<Vec<(usize, Seen)>> {
        let mut references = Vec::new();
        let mut last: Option<Joints> = None;
        // rows are in the order of time: numbers that fall are not
        let numbered = recording.rows.iter().all(|r| r.seq.is_some()) && recording.rows.is_sorted_by_key(|r| r.seq);
        let first_pose = self.poses;
        for (k, r) in recording.rows.iter().enumerate() {
            let state = self.joints.state(r, &recording.name)?;
            // rows at the same joints are one pose, whether or not `seq` says so
            if last != Some(r.state.q) {
                self.poses += 1;
                last = Some(r.state.q);
            }
            let pose = self.poses - 1;
            if let Measured::Reference { reference, position } = r.measured {
                references.push((pose, (reference, Vector3::from(position))));
                continue;
            }
            let mut state = state.numbered(if numbered { r.seq } else { Some((pose - first_pose) as u64) });
            state.session = u32::try_from(index + 1).ok();
            self.observations.push(Observation {
                state,
                measured: r.measured,
                frame: self.frame_of_recording[index].unwrap_or(0),
                pose,
                recording: index,
                row: before + k + 1,
                line: r.line,
            });
        }
        Ok(references)
    }

    /// Brings every pose of one recording into the frame in which its references stand still.
    fn register(&mut self, first_observation: usize, seen: &[(usize, Seen)], known: Option<&References>) -> References {
        let known = known.filter(|k| k.can_register());
        if seen.iter().all(|(_, (reference, _))| *reference < 2) {
            return known.cloned().unwrap_or_default();
        }
        let by_pose: Vec<(usize, Vec<Seen>)> = seen
            .chunk_by(|a, b| a.0 == b.0)
            .map(|here| (here[0].0, here.iter().map(|(_, seen)| *seen).collect()))
            .collect();
        let references = References::of(&by_pose.iter().map(|(_, here)| &here[..]).collect::<Vec<_>>(), known);
        let registered: BTreeMap<usize, _> =
            by_pose.iter().map(|(pose, here)| (*pose, references.register(here))).collect();
        for mut o in self.observations.split_off(first_observation) {
            match registered.get(&o.pose).cloned().unwrap_or_else(|| references.register(&[])) {
                Ok(pose) => {
                    move_by(&pose, &mut o.measured);
                    self.observations.push(o);
                }
                Err(reason) => self.reject(&o, reason),
            }
        }
        references
    }

    /// What is wrong with an observation, with its file and line.
    pub(crate) fn error(&self, o: &Observation, problem: impl Into<String>) -> IdentError {
        IdentError::at_line(&self.names[o.recording], o.line, problem)
    }

    /// Whether some measurement is such a one.
    pub(crate) fn has(&self, such: impl Fn(&Measured) -> bool) -> bool {
        self.observations.iter().any(|o| such(&o.measured))
    }

    /// Mean temperature, degC, where it was recorded.
    pub(crate) fn mean_temp_c(&self) -> Option<f64> {
        let all: Vec<f64> = self.observations.iter().filter_map(|o| o.state.temp_c).collect();
        (!all.is_empty()).then(|| mean(&all))
    }

    /// Number of scalars measured.
    #[must_use]
    pub fn scalars(&self) -> usize {
        self.observations.iter().map(|o| residual_rows(&o.measured)).sum()
    }

    /// Rejects an observation, which [`Dataset::without_rejected`] then leaves out.
    pub fn reject(&mut self, o: &Observation, reason: String) {
        let recording = self.names[o.recording].clone();
        self.rejected.push(Rejected { recording, line: o.line, row: o.row, reason });
    }

    /// Without the observations that were rejected, which are in the order of their rows.
    #[must_use]
    pub fn without_rejected(mut self) -> Self {
        self.rejected.sort_by_key(|r| r.row);
        let is_rejected = |row| self.rejected.binary_search_by_key(&row, |r| r.row).is_ok();
        self.observations.retain(|o| !is_rejected(o.row));
        self
    }

    /// This data with only those observations for which `keep` holds.
    #[must_use]
    pub fn filtered(&self, keep: impl Fn(&Observation) -> bool) -> Self {
        let observations = self.observations.iter().filter(|o| keep(o)).copied().collect();
        Self { observations, rejected: self.rejected.clone(), ..self.shell() }
    }

    /// This data without its observations.
    pub(crate) fn shell(&self) -> Self {
        Self {
            names: self.names.clone(),
            fingerprints: self.fingerprints.clone(),
            places: self.places.clone(),
            observations: Vec::new(),
            rejected: Vec::new(),
            poses: self.poses,
            frame_of_recording: self.frame_of_recording.clone(),
            references: self.references.clone(),
            joints: self.joints,
            dof: self.dof,
        }
    }

    /// This data with the sessions of a model: session `sessions[k]` for recording k, `None` for one that the model does not know.
    #[must_use]
    pub fn in_sessions(mut self, sessions: &[Option<u32>]) -> Self {
        for o in &mut self.observations {
            o.state.session = sessions.get(o.recording).copied().flatten();
        }
        self
    }

    /// Renumbers the measuring frames: recording k was seen in frame `frames[k]` of a model that has `count`.
    pub(crate) fn in_frames(&mut self, frames: &[Option<usize>], count: usize) {
        let mut references = vec![References::default(); count];
        for (own, frame) in self.frame_of_recording.iter_mut().zip(frames) {
            if let (Some(own), Some(frame)) = (own.as_mut(), frame) {
                if references.len() <= *frame {
                    references.resize(*frame + 1, References::default());
                }
                references[*frame] = std::mem::take(&mut self.references[*own]);
                *own = *frame;
            }
        }
        self.references = references;
        for o in &mut self.observations {
            o.frame = self.frame_of_recording[o.recording].unwrap_or(0);
        }
    }

    /// Number of measuring frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.references.len()
    }

    /// Poses that have at least one observation, in order.
    #[must_use]
    pub fn used_poses(&self) -> Vec<usize> {
        let mut poses: Vec<usize> = self.observations.iter().map(|o| o.pose).collect();
        poses.dedup();
        poses
    }
}

/// What measurements tell of the tool: its motions (of the TCP; with poses of its direction, too; none with points alone), and its targets, from 1.
pub(crate) fn told_of_tool(
    targets: usize,
    measured: impl Iterator<Item = Measured> + Clone,
) -> (&'static [Motion], Vec<usize>) {
    let any = |such: &dyn Fn(&Measured) -> bool| measured.clone().any(|m| such(&m));
    let motions = if any(&|m| matches!(m, Measured::Pose { .. })) {
        6
    } else if any(&|m| matches!(m, Measured::Touch { .. } | Measured::Distance { .. })) {
        3
    } else {
        0
    };
    let seen = |target: &usize| any(&|m| matches!(m, Measured::Point { target: t, .. } if *t + 1 == *target));
    (&Motion::ALL[..motions], (1..=targets).filter(seen).collect())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn the_commonest_reason_is_told_whatever_its_numbers() {
        let of = |line: usize, reason: &str| Rejected {
            recording: "a.csv".into(),
            line,
            row: line - 1,
            reason: reason.into(),
        };
        let off = |line: usize, mm: f64| of(line, &format!("a reference is {mm:.3} mm off its place"));
        assert_eq!(rejected_in_words(&[]), None);
        let one = [off(3, 0.1)];
        assert_eq!(rejected_in_words(&one).unwrap(), "1 row rejected, line 3: a reference is 0.100 mm off its place");
        let some = [of(2, "gross"), off(3, 0.1), off(7, 0.25)];
        let said = "3 rows rejected, 2 of them such as line 3: a reference is 0.100 mm off its place";
        assert_eq!(rejected_in_words(&some).unwrap(), said);
        assert!(rejected_in_words(&some[1..]).unwrap().starts_with("2 rows rejected, such as line 3: a reference"));
    }

    #[test]
    fn rows_of_references_alone_are_told_as_that() {
        let measured = Measured::Reference { reference: 0, position: [0.0; 3] };
        let row = |k: usize| Row { state: State::at(&[0.1 * k as f64; 6]), measured, seq: None, line: k + 2 };
        let recording =
            Recording { name: "r.csv".into(), joints: 6, rows: (0..3).map(row).collect(), ..Recording::default() };
        let e = Dataset::build(&[recording], JointSource::Read, None).unwrap_err().to_string();
        assert_eq!(e, "r.csv: no measurement is left to use (its rows are of fixed references only)");
    }
}
