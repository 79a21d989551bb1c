//! Validation: what a model learnt of an arm, on any recording of that arm.
//!
//! A recording that the model was learnt on is predicted with all that was learnt of it. To any other only what belongs to the arm goes;
//! what belongs to that session (measuring frame, place of the balls, tool points) is identified there from some of its poses and the
//! others are scored, or it is taken as the model has it.

pub(crate) mod adapted;
pub mod predicted;

use trical_model::{Cell, Forward, Measured, Model, Recording, Robot, Support, Variable};

use crate::dataset::{Dataset, JointSource, Observation, Rejected};
use crate::error::Result;
use crate::fit::ball_places::{self, place_of, training_poses};
use crate::fit::choice::{Choice, OwnSetup, ParameterSet};
use crate::fit::degenerate::{hardly_moving, little};
use crate::fit::identify::{ErrorSummary, identify};
use crate::fit::orientation::{AngleSummary, orientation};
use crate::fit::residuals::position_errors;
use crate::model_file::ModelFile;
use crate::validate::adapted::{Adapted, LeftOut, Refit, adapted, own_terms, refitted};
use crate::validate::predicted::{Predicted, predicted};

/// Errors of one part of the data.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Region {
    /// "q2 -60 to -32 deg", "distance from the middle 0 to 200 mm", "ball 2".
    pub region: String,
    /// Number of measurements.
    pub n: usize,
    /// Before.
    pub before: ErrorSummary,
    /// After.
    pub after: ErrorSummary,
}

/// Errors of one recording, and what was identified there.
#[derive(Clone, Debug, serde::Serialize)]
pub struct SessionErrors {
    /// Name of the recording.
    pub recording: String,
    /// Session (from 1) of the model that it is; `null` where the model was not learnt on it.
    pub learnt: Option<u32>,
    /// What was identified again: "frame", "targets".
    pub refitted: Vec<&'static str>,
    /// From so many poses, which are not scored.
    pub from_poses: usize,
    /// Poses that were scored.
    pub poses: usize,
    /// Number of measurements that were scored.
    pub n: usize,
    /// Before.
    pub before: ErrorSummary,
    /// After.
    pub after: ErrorSummary,
}

impl SessionErrors {
    /// "a.csv: the model was fitted to it", "b.csv: frame and targets identified from 25 of its poses, the other 75 scored".
    #[must_use]
    pub fn in_words(&self) -> String {
        let known = match (self.learnt, self.refitted.is_empty()) {
            (Some(_), true) => "the model was fitted to it".to_owned(),
            (None, true) => "in the measuring frame and with the tool of the model".to_owned(),
            (_, false) => format!(
                "{} identified from {} of its poses, the other {} scored",
                self.refitted.join(" and "),
                self.from_poses,
                self.poses
            ),
        };
        format!("{}: {known}", self.recording)
    }
}

/// Position errors of the nominal arm and of the model.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Validation {
    /// The nominal arm with only the measuring frame and targets identified on this data.
    pub before: ErrorSummary,
    /// The model.
    pub after: ErrorSummary,
    /// Errors of orientation, of the nominal arm and of the model, where full poses were measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub orientation: Option<[AngleSummary; 2]>,
    /// Number of measurements that were scored.
    pub n: usize,
    /// How many of them are at joint angles that the model was not learnt at; `null` where its file does not say.
    pub beyond: Option<usize>,
    /// How far off the model says that it may be, beside what was found; `null` where its file does not say how uncertain it is.
    pub predicted: Option<Predicted>,
    /// Errors of each recording.
    pub sessions: Vec<SessionErrors>,
    /// Errors of each region.
    pub regions: Vec<Region>,
    /// Terms of the model that say nothing of these recordings.
    pub left_out: Vec<LeftOut>,
    /// Effects of a setup that jumped in the course of the model's only session, and is taken to be here as it was at its end.
    pub carried_over: Vec<String>,
    /// How far the cell file has the tool from where that of the model has it, mm, if it does; the model's is used.
    pub other_tool_mm: Option<f64>,
    /// Mass on the flange by the cell file and by the cell of the fit, kg, where they differ (or their centres of gravity) and terms follow the load; the
    /// cell file's is used for recordings that the model was not fitted to.
    pub other_load_kg: Option<[f64; 2]>,
    /// Rows that were not used.
    pub rejected: Vec<Rejected>,
    /// Errors one by one, m: before, after.
    #[serde(skip)]
    pub errors: Vec<(f64, f64)>,
    /// What was scored.
    #[serde(skip)]
    pub data: Dataset,
    /// The model as it was scored, with what was identified again.
    #[serde(skip)]
    pub model: Model,
    /// The nominal arm as it was scored, and the same rows in its measuring frames.
    #[serde(skip)]
    pub nominal: (Model, Dataset),
}

impl Validation {
    /// Where the model had to say something of other joint angles, in a sentence.
    #[must_use]
    pub fn beyond_in_words(&self) -> Option<String> {
        self.beyond.filter(|n| *n > 0).map(|n| {
            let beyond = Support::of(&self.model.robot, &[]).beyond_in_words();
            format!("{n} of {} measurements are {beyond}.", self.n)
        })
    }

    /// One sentence for each reason for which terms say nothing here, and one for what is carried over; `title` gives the words of an effect's identifier.
    #[must_use]
    pub fn left_out_in_words(&self, title: impl Fn(&str) -> String) -> Vec<String> {
        let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
        for l in &self.left_out {
            let i = reasons.iter().position(|r| r.0 == l.reason).unwrap_or_else(|| {
                reasons.push((&l.reason, Vec::new()));
                reasons.len() - 1
            });
            if !reasons[i].1.contains(&l.effect.as_str()) {
                reasons[i].1.push(&l.effect);
            }
        }
        let named = |effects: &[&str]| effects.iter().map(|e| title(e)).collect::<Vec<_>>().join(", ");
        let carried: Vec<&str> = self.carried_over.iter().map(String::as_str).collect();
        let carried = (!carried.is_empty())
            .then(|| format!("As at the end of the session that the model was fitted to: {}.", named(&carried)));
        let left_out = |(reason, effects): (&str, Vec<&str>)| format!("Left out: {} ({reason}).", named(&effects));
        let other = self.other_tool_mm.map(|mm| {
            format!(
                "The cell file has the tool {mm:.3} mm from where the cell of the fit has it; the model's was used."
            )
        });
        let load = self.other_load_kg.map(|[here, fit]| {
            format!("The cell file has {here} kg on the flange, or at another place than the cell of the fit, which has {fit} kg; the cell file's load was used.")
        });
        reasons.into_iter().map(left_out).chain(carried).chain(other).chain(load).collect()
    }
}

/// Tools of two cell files are the same within this, m.
const SAME_TOOL: f64 = 1e-6;

/// Scores a model on recordings. With `refit`, frame and targets of each recording are identified again from every fourth of its poses, and
/// the other poses are scored; without it only where the model does not know them.
///
/// # Errors
/// Recordings of another arm, or data that the model cannot predict.
pub fn validate(
    robot: &Robot,
    cell: &Cell,
    file: &ModelFile,
    recordings: &[Recording],
    joints: Option<JointSource>,
    refit: Option<Refit>,
) -> Result<Validation> {
    let Adapted { mut model, data, places, left_out, carried_over, known, joints } =
        adapted(file, cell, recordings, joints, refit, None)?;
    let rejected = data.rejected.clone();
    let poses: Vec<Vec<usize>> =
        (0..recordings.len()).map(|r| data.filtered(|o| o.recording == r).used_poses()).collect();
    let all = training_poses(&data, !ball_places::unknown_places(cell, &data).is_empty());
    let trains = |o: &Observation| places[o.recording].refit.any() && all.contains(&o.pose);
    let train = data.filtered(trains);
    let scored = data.filtered(|o| !trains(o));
    let mut own = Vec::new();
    if !train.observations.is_empty() {
        own = own_terms(&model, &train, &places);
        model = refitted(model, &train, &places)?;
    }
    let forward = Forward::new(model, Vec::new())?;
    crate::fit::residuals::check_observations(&forward, &scored)?;
    let after = position_errors(&forward, &scored);
    // the nominal arm of these recordings alone
    let plain = Dataset::build(recordings, joints, Some(&known))?
        .filtered(|o| scored.observations.binary_search_by_key(&o.row, |s| s.row).is_ok());
    let choice = Choice::from(ParameterSet::Nominal).with_own(OwnSetup::all(recordings.len()));
    let nominal = identify(robot, cell, &plain, choice)?;
    let before = position_errors(&Forward::new(nominal.model.clone(), Vec::new())?, &plain);
    let pairs: Vec<(f64, f64)> = before.iter().copied().zip(after.iter().copied()).collect();
    let sessions = places.iter().enumerate().map(|(r, place)| {
        let (n, before, after) =
            before_and_after(scored.observations.iter().zip(&pairs).filter(|(o, _)| o.recording == r).map(|(_, p)| p));
        let from_poses = if place.refit.any() { poses[r].iter().filter(|p| all.contains(p)).count() } else { 0 };
        SessionErrors {
            recording: data.names[r].clone(),
            learnt: place.learnt,
            refitted: place.refit.names(),
            from_poses,
            poses: poses[r].len() - from_poses,
            n,
            before,
            after,
        }
    });
    let visited = file.visited();
    let beyond: Vec<bool> = scored.observations.iter().map(|o| visited.beyond(&o.state.q).is_some()).collect();
    let model = forward.into_model();
    let predicted = match &file.uncertainty {
        Some(u) => {
            let learnt: Vec<bool> = places.iter().map(|p| p.learnt.is_some()).collect();
            predicted(&model, u, (&own, &train), &scored, (&learnt, &beyond))?
        }
        None => None,
    };
    let off = (cell.tool.tcp - file.model.cell.tool.tcp).norm();
    let [here, fit] = [&cell.tool, &file.model.cell.tool];
    let follows_load = model.terms.iter().any(|t| matches!(t.basis.of, Variable::Moment { .. }));
    let other_load =
        follows_load && (here.mass, here.cog) != (fit.mass, fit.cog) && places.iter().any(|p| p.learnt.is_none());
    Ok(Validation {
        other_load_kg: other_load.then_some([here.mass, fit.mass]),
        other_tool_mm: (off > SAME_TOOL).then_some(off * 1e3),
        before: ErrorSummary::of(&before),
        after: ErrorSummary::of(&after),
        orientation: orientation([(&nominal.model, &plain), (&model, &scored)])?,
        n: pairs.len(),
        beyond: (!visited.is_empty()).then(|| beyond.iter().filter(|b| **b).count()),
        predicted,
        sessions: sessions.collect(),
        regions: regions(robot, &scored, &pairs, &beyond),
        left_out,
        carried_over,
        rejected,
        errors: pairs,
        data: scored,
        model,
        nominal: (nominal.model, plain),
    })
}

/// "q2 -32.0 to 10.5 deg", "q1 0.0 to 900.0 mm" where joint 1 slides.
fn stretch(robot: &Robot, joint: usize, ends: [f64; 2]) -> String {
    let (scale, unit) = robot.kind(joint + 1).unit();
    // no "-0.0"
    let [low, high] = ends.map(|q| (q * scale * 10.0).round() / 10.0 + 0.0);
    format!("q{} {low:.1} to {high:.1} {unit}", joint + 1)
}

/// How many errors, and what they are before and after.
fn before_and_after<'a>(pairs: impl Iterator<Item = &'a (f64, f64)>) -> (usize, ErrorSummary, ErrorSummary) {
    let (before, after): (Vec<f64>, Vec<f64>) = pairs.copied().unzip();
    (before.len(), ErrorSummary::of(&before), ErrorSummary::of(&after))
}

/// How far each place that was seen is from the middle of them all, m.
fn from_the_middle(data: &Dataset) -> Vec<Option<f64>> {
    let places: Vec<Option<nalgebra::Vector3<f64>>> = data
        .observations
        .iter()
        .map(|o| match o.measured {
            Measured::Point { position, .. } | Measured::Pose { position, .. } => Some(position.into()),
            _ => None,
        })
        .collect();
    let middle = crate::rigid::median_point(&places.iter().flatten().copied().collect::<Vec<_>>());
    places.iter().map(|p| p.map(|p| (p - middle).norm())).collect()
}

/// Errors by joint angle (of joints that move), ball, and place; and, where some are `beyond` the angles that the model was learnt at, of these and the others.
fn regions(robot: &Robot, data: &Dataset, errors: &[(f64, f64)], beyond: &[bool]) -> Vec<Region> {
    let mut out = Vec::new();
    let mut add = |region: String, pick: &dyn Fn(usize) -> bool| {
        let chosen = errors.iter().enumerate().filter(|(i, _)| pick(*i)).map(|(_, e)| e);
        let (n, before, after) = before_and_after(chosen);
        if n > 0 {
            out.push(Region { region, n, before, after });
        }
    };
    let o = &data.observations;
    if beyond.contains(&true) {
        add("joint angles that the model was fitted at".into(), &|i| !beyond[i]);
        add("other joint angles".into(), &|i| beyond[i]);
    }
    let resting = hardly_moving(robot, data);
    for joint in (0..data.dof).filter(|joint| !resting.iter().any(|(k, _)| k == joint)) {
        let q: Vec<f64> = o.iter().map(|o| o.state.q[joint]).collect();
        let mut sorted = q.clone();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        // quarters of the measurements, each wide enough to be told from the next: most may have been made at one angle
        let mut ends = vec![sorted[0]];
        for k in 1..=4 {
            let end = sorted[(k * (n - 1)) / 4];
            if end - ends[ends.len() - 1] >= little(robot, joint) {
                ends.push(end);
            } else if k == 4 && ends.len() > 1 {
                // the last of all belongs to the stretch before it
                ends.pop();
                ends.push(end);
            }
        }
        let last = ends.len() - 1;
        for (k, low_high) in ends.windows(2).enumerate().filter(|_| last > 1) {
            let (low, high) = (low_high[0], low_high[1]);
            let name = stretch(robot, joint, [low, high]);
            add(name, &|i| q[i] >= low && (q[i] < high || (k + 1 == last && q[i] <= high)));
        }
    }
    for ball in ball_places::touched(data, |_| true) {
        add(format!("ball {}", ball + 1), &|i| matches!(o[i].measured, Measured::Touch { ball: b, .. } if b == ball));
    }
    let stood = ball_places::ball_places(data);
    for place in stood.iter().filter(|_| stood.len() > 1) {
        let name = format!("place {}", ball_places::name(data, *place));
        add(name, &|i| place_of(&o[i]) == Some(*place));
    }
    let off = from_the_middle(data);
    if off.iter().any(Option::is_some) {
        for (low, high) in [(0.0, 0.2), (0.2, 0.4), (0.4, 0.6), (0.6, 0.8), (0.8, f64::INFINITY)] {
            let name = if high.is_finite() {
                format!("{:.0} to {:.0} mm from the middle", low * 1e3, high * 1e3)
            } else {
                format!("more than {:.0} mm from the middle", low * 1e3)
            };
            add(name, &|i| off[i].is_some_and(|off| (low..high).contains(&off)));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use trical_model::{JointKind, Row, State};

    #[test]
    fn regions_of_a_rail_are_in_mm_without_negative_zeros_and_a_joint_at_rest_has_none() {
        let text = include_str!("../../trical-model/tests/data/arm.toml");
        let mut robot = Robot::parse(text, "arm.toml").unwrap();
        robot.joints[0].kind = JointKind::Prismatic;
        let row = |k: u32| Row {
            state: State::at(&[0.1 * f64::from(k), -1e-7, 0.2 - 0.1 * f64::from(k)]),
            measured: Measured::Touch { ball: 0, reading: [0.0; 3] },
            seq: None,
            line: k as usize + 2,
        };
        let rows: Vec<Row> = (0..5).map(row).collect();
        let recording = Recording { name: "r".into(), joints: 6, rows, ..Recording::default() };
        let data = Dataset::build(&[recording], JointSource::Read, None).unwrap();
        let regions = regions(&robot, &data, &[(1e-3, 1e-4); 5], &[false; 5]);
        let names: Vec<&str> = regions.iter().map(|r| r.region.as_str()).collect();
        assert_eq!(
            names,
            [
                "q1 0.0 to 100.0 mm",
                "q1 100.0 to 200.0 mm",
                "q1 200.0 to 300.0 mm",
                "q1 300.0 to 400.0 mm",
                "q3 -11.5 to -5.7 deg",
                "q3 -5.7 to 0.0 deg",
                "q3 0.0 to 5.7 deg",
                "q3 5.7 to 11.5 deg",
                "ball 1"
            ]
        );
    }

    #[test]
    fn a_joint_that_mostly_rests_has_no_stretches_without_a_width() {
        let robot = Robot::parse(include_str!("../../trical-model/tests/data/arm.toml"), "arm.toml").unwrap();
        let stretches = |at: [f64; 8]| -> Vec<String> {
            let row = |(k, q): (usize, f64)| Row {
                state: State::at(&[0.2 * k as f64, q.to_radians()]),
                measured: Measured::Touch { ball: 0, reading: [0.0; 3] },
                seq: None,
                line: k + 2,
            };
            let rows = at.into_iter().enumerate().map(row).collect();
            let recording = Recording { name: "r".into(), joints: 6, rows, ..Recording::default() };
            let data = Dataset::build(&[recording], JointSource::Read, None).unwrap();
            let all = regions(&robot, &data, &[(1e-3, 1e-4); 8], &[false; 8]);
            all.into_iter().filter(|r| r.region.starts_with("q2")).map(|r| format!("{} ({})", r.region, r.n)).collect()
        };
        assert!(stretches([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 40.0]).is_empty());
        let two = stretches([0.0, 0.0, 0.0, 0.0, 10.0, 10.0, 20.0, 40.0]);
        assert_eq!(two, ["q2 0.0 to 10.0 deg (4)", "q2 10.0 to 40.0 deg (4)"]);
    }
}
