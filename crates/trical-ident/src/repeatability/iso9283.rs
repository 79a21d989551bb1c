//! Pose accuracy, pose repeatability and distance accuracy with the formulas of ISO 9283 (1998, 7.2.1, 7.2.2, 7.3.2). The standard also
//! prescribes poses, cycles, loads and speeds; whether a recording keeps to them, these formulas cannot tell.

use nalgebra::Vector3;
use serde::Serialize;
use trical_model::{Forward, Joints, Measured, Model};

use crate::dataset::{Dataset, Observation};
use crate::error::Result;
use crate::repeatability::{barycentre, scatter};

/// Limits (mm) of which the share of measurements within is told.
pub const LIMITS_MM: [f64; 4] = [0.1, 0.2, 0.5, 1.0];

/// Joints that were commanded (or read, where no command is known) alike to this (rad) are visits of one pose.
const SAME_POSE: f64 = 0.05_f64.to_radians();

/// With fewer visits RP is not told: of two the distances from their mean are equal, and S is 0.
const LEAST_VISITS: usize = 3;

/// Distances between poses below this (m) are not scored.
const LEAST_DISTANCE: f64 = 0.01;

/// A pose of one point of the tool: where it was commanded to be, and where it was at each visit, m, in the frame of the measurement.
#[derive(Clone, Debug)]
pub struct Visited {
    /// Place that the model's joints stand for, at each visit.
    pub commanded: Vec<Vector3<f64>>,
    /// Place that was measured.
    pub attained: Vec<Vector3<f64>>,
    /// Whether each visit has a command of its own; else the commanded place is that of the joints as read, which scatter as the arm does.
    pub own_commands: bool,
    /// Poses of one series are of one point of the tool, and measured in one frame: their distances are known.
    pub series: usize,
}

/// Mean and largest of something over the poses that have it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OverPoses {
    /// How many poses, or pairs of poses.
    pub n: usize,
    /// Mean.
    pub mean_mm: f64,
    /// Largest.
    pub max_mm: f64,
}

impl OverPoses {
    fn of(values_mm: &[f64]) -> Option<Self> {
        let mean_mm = values_mm.iter().sum::<f64>() / values_mm.len() as f64;
        let max_mm = values_mm.iter().copied().fold(0.0, f64::max);
        (!values_mm.is_empty()).then_some(Self { n: values_mm.len(), mean_mm, max_mm })
    }
}

/// What an arm does, by ISO 9283's formulas.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Performance {
    /// Poses (each point of the tool counted by itself).
    pub poses: usize,
    /// Fewest and most visits of a pose.
    pub visits: [usize; 2],
    /// AP of each pose: distance from the commanded place to the barycentre of the attained ones.
    pub accuracy: Option<OverPoses>,
    /// RP of each pose that was visited three times or more: l + 3 S.
    pub repeatability: Option<OverPoses>,
    /// AD of neighbouring poses: mean distance attained minus distance commanded, without its sign.
    pub distance_accuracy: Option<OverPoses>,
}

/// AP of a pose, m: |barycentre of the attained places - commanded place|.
#[must_use]
pub fn accuracy(pose: &Visited) -> f64 {
    (barycentre(&pose.attained) - barycentre(&pose.commanded)).norm()
}

/// RP of a pose, m: mean distance from the barycentre and three standard deviations of it; `None` for one or two visits. Where visits were
/// commanded to slightly different places, each is taken relative to its command.
#[must_use]
pub fn repeatability(pose: &Visited) -> Option<f64> {
    let relative = |(a, c): (&Vector3<f64>, &Vector3<f64>)| if pose.own_commands { a - c } else { *a };
    let at: Vec<Vector3<f64>> = pose.attained.iter().zip(&pose.commanded).map(relative).collect();
    scatter(&at).filter(|_| at.len() >= LEAST_VISITS).map(|s| s.rp_mm * 1e-3)
}

/// AD of two poses, m: mean distance between their visits (the first with the first, ...) minus the commanded one.
#[must_use]
pub fn distance_accuracy(from: &Visited, to: &Visited) -> f64 {
    let mean = |a: &[Vector3<f64>], b: &[Vector3<f64>]| {
        let n = a.len().min(b.len()).max(1) as f64;
        a.iter().zip(b).map(|(a, b)| (a - b).norm()).sum::<f64>() / n
    };
    mean(&from.attained, &to.attained) - mean(&from.commanded, &to.commanded)
}

/// All three, of poses in the order of measurement. Distances are those from each pose to the next.
#[must_use]
pub fn performance(poses: &[Visited]) -> Performance {
    let mm = |values: Vec<f64>| OverPoses::of(&values.into_iter().map(|v| v.abs() * 1e3).collect::<Vec<_>>());
    let visits = |p: &Visited| p.attained.len();
    let apart = |w: &&[Visited]| {
        w[0].series == w[1].series && (barycentre(&w[0].attained) - barycentre(&w[1].attained)).norm() > LEAST_DISTANCE
    };
    Performance {
        poses: poses.len(),
        visits: [poses.iter().map(visits).min().unwrap_or(0), poses.iter().map(visits).max().unwrap_or(0)],
        accuracy: mm(poses.iter().map(accuracy).collect()),
        repeatability: mm(poses.iter().filter_map(repeatability).collect()),
        distance_accuracy: mm(poses.windows(2).filter(apart).map(|w| distance_accuracy(&w[0], &w[1])).collect()),
    }
}

/// Which point an observation measured, where it was, and in which frame; `None` for lengths, which have no place.
fn measured(o: &Observation, model: &Model) -> Option<((u8, usize), Vector3<f64>)> {
    match &o.measured {
        Measured::Touch { ball, .. } => Some(((0, *ball), *model.cell.balls.get(*ball)?)),
        Measured::Point { target, position } => Some(((1, *target), Vector3::from(*position))),
        Measured::Pose { position, .. } => Some(((2, 0), Vector3::from(*position))),
        _ => None,
    }
}

/// Visits of poses, as `model` places them, in the order of measurement: the same point of the tool (or ball), in the same recording, at the
/// same commanded joints. The places of touches are those of the balls.
///
/// # Errors
/// A model that cannot be evaluated.
pub fn visited(model: &Model, data: &Dataset) -> Result<Vec<Visited>> {
    let forward = Forward::new(model.clone(), Vec::new())?;
    let mut ws = forward.workspace();
    let mut poses: Vec<((u8, usize), Joints, Visited)> = Vec::new();
    let mut series = Vec::new();
    for o in &data.observations {
        let Some((point, attained)) = measured(o, model) else { continue };
        forward.residual(&o.state, &o.measured, o.frame, &mut ws);
        let [x, y, z, ..] = *ws.residual();
        let commanded = attained + Vector3::new(x, y, z);
        let joints = o.state.q_commanded.unwrap_or(o.state.q);
        // one point of the tool touches all balls; where balls stand is known among those of one place
        let touches = matches!(o.measured, Measured::Touch { .. });
        let own = (o.recording, o.state.place, if touches { (0, 0) } else { point });
        let of = series.iter().position(|s| *s == own).unwrap_or_else(|| {
            series.push(own);
            series.len() - 1
        });
        let same = |p: &&mut ((u8, usize), Joints, Visited)| {
            p.0 == point && p.2.series == of && p.1.iter().zip(&joints).all(|(a, b)| (a - b).abs() < SAME_POSE)
        };
        if let Some(pose) = poses.iter_mut().find(same) {
            pose.2.commanded.push(commanded);
            pose.2.attained.push(attained);
        } else {
            // a touch is corrected by hand or by the gauge: where the arm then is, is its command
            let own_commands = touches || o.state.q_commanded.is_some();
            let visited = Visited { commanded: vec![commanded], attained: vec![attained], own_commands, series: of };
            poses.push((point, joints, visited));
        }
    }
    poses.sort_by_key(|p| p.2.series);
    Ok(poses.into_iter().map(|p| p.2).collect())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used)]

    use super::*;

    /// Five poses on a line, 0.1 m apart, each visited 30 times: the attained places lie off the command by `off`, and around that by
    /// 0.01, 0.02 and 0.03 mm, ten each, in opposite pairs, so that the barycentre is not moved.
    fn five_poses_of_thirty_visits(off: [Vector3<f64>; 5]) -> Vec<Visited> {
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        (0..5)
            .map(|k| {
                let command = Vector3::new(0.1 * k as f64, 0.2, 0.3);
                let attained = (0..30)
                    .map(|j| {
                        let l = 1e-5 * f64::from(1 + j / 10);
                        let sign = if j % 2 == 0 { 1.0 } else { -1.0 };
                        command + off[k] + sign * l * axes[(j as usize / 2) % 3]
                    })
                    .collect();
                Visited { commanded: vec![command; 30], attained, own_commands: true, series: 0 }
            })
            .collect()
    }

    #[test]
    fn a_worked_example_of_five_poses_and_thirty_visits() {
        let mm = |x: f64, y: f64, z: f64| Vector3::new(x, y, z) * 1e-3;
        // AP: 0.3, 0.5 (3-4-5), 0, 0.7 (2-3-6), 0.1: mean 0.32
        let off = [mm(0.3, 0.0, 0.0), mm(0.0, 0.3, 0.4), mm(0.0, 0.0, 0.0), mm(0.2, 0.3, 0.6), mm(0.1, 0.0, 0.0)];
        let told = performance(&five_poses_of_thirty_visits(off));
        assert_eq!((told.poses, told.visits), (5, [30, 30]));
        let ap = told.accuracy.expect("poses");
        assert_eq!(ap.n, 5);
        assert!((ap.mean_mm - 0.32).abs() < 1e-9 && (ap.max_mm - 0.7).abs() < 1e-9, "{ap:?}");
        // l = 0.02 mm on average; S^2 = 20 x 0.01^2 / 29; RP = 0.02 + 3 S = 0.0449136 mm
        let rp = told.repeatability.expect("visits");
        let by_hand = 0.02 + 3.0 * (20.0 * 1e-4_f64 / 29.0).sqrt();
        assert!((by_hand - 0.044_913_6).abs() < 1e-7);
        assert!((rp.mean_mm - by_hand).abs() < 1e-6 && (rp.max_mm - by_hand).abs() < 1e-6, "{rp:?}");
        // all visits of one number lie off by the same: AD = |d + off(k+1) - off(k)| - |d|, d = 100 mm along x
        let ad = told.distance_accuracy.expect("pairs");
        let expected: Vec<f64> =
            off.windows(2).map(|w| (((mm(100.0, 0.0, 0.0) + w[1] - w[0]).norm() - 0.1) * 1e3).abs()).collect();
        assert!((expected[0] - 0.298_746).abs() < 1e-6, "0.3 mm nearer, and aside by 0.5 mm: {}", expected[0]);
        assert_eq!(ad.n, 4);
        assert!((ad.mean_mm - expected.iter().sum::<f64>() / 4.0).abs() < 1e-6, "{ad:?} {expected:?}");
    }

    #[test]
    fn a_single_visit_has_an_accuracy_and_no_repeatability() {
        let one = Visited {
            commanded: vec![Vector3::zeros()],
            attained: vec![Vector3::new(0.0, 3e-4, 4e-4)],
            own_commands: true,
            series: 0,
        };
        let told = performance(std::slice::from_ref(&one));
        assert!((told.accuracy.expect("a pose").max_mm - 0.5).abs() < 1e-12);
        assert!(told.repeatability.is_none() && told.distance_accuracy.is_none());
        // two are as far from their mean as each other
        let twice = |n: usize, own_commands: bool| {
            let command = |k: usize| Vector3::new(1e-4 * k as f64, 0.0, 0.0);
            let commanded: Vec<_> = (0..n).map(command).collect();
            repeatability(&Visited { attained: commanded.clone(), commanded, own_commands, series: 0 })
        };
        assert_eq!((twice(2, false), twice(3, true)), (None, Some(0.0)));
        // joints as they were read scatter with the arm: 0.1, 0 and 0.1 mm from the mean
        let by_hand = 2e-4 / 3.0 + 3.0 * (((1e-4_f64 / 3.0).powi(2) * 2.0 + (2e-4_f64 / 3.0).powi(2)) / 2.0).sqrt();
        assert!((twice(3, false).expect("three") - by_hand).abs() < 1e-12);
    }

    #[test]
    fn distances_are_those_between_places_that_are_apart_and_were_measured_in_one_frame() {
        let at = |x: f64, series: usize| Visited {
            // 20 mm off in turn: how far apart a bad arm was commanded says nothing of the distance
            commanded: vec![Vector3::new(x + 0.02 * series as f64, if x > 0.1 { 0.02 } else { 0.0 }, 0.0)],
            attained: vec![Vector3::new(x, 0.0, 0.0)],
            own_commands: true,
            series,
        };
        let pairs = |poses: &[Visited]| performance(poses).distance_accuracy.map(|ad| ad.n);
        assert_eq!(
            pairs(&[at(0.0, 0), at(0.3, 0), at(0.3, 0), at(0.0, 0)]),
            Some(2),
            "the same ball twice is no distance"
        );
        assert_eq!(pairs(&[at(0.0, 0), at(0.3, 1)]), None, "of two recordings");
    }
}
