//! Data that cannot be fitted whatever the solver does, each with its own sentence: before a solver says something else.

use std::collections::BTreeSet;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use trical_model::pose::{angles_zyx, quaternion_from_rotation, rotation_from_quaternion, rotation_zyx};
use trical_model::{Cell, Forward, Joint, JointKind, MAX_JOINTS, Measured, Model, Robot};

use crate::dataset::{Dataset, Observation, rejected_in_words};
use crate::error::{IdentError, Result};
use crate::fit::ball_places::touched;
use crate::rigid::{median, rigid_from_points};

/// Joint values and places beyond these are no arm's: 278 turns, and a kilometre.
const FAR_RAD: f64 = 1745.4;
const FAR_M: f64 = 1000.0;

/// Poses whose joints differ by less than this (0.1 deg, or 0.1 mm) are the same pose to a calibration.
const SAME_RAD: f64 = 1.745e-3;
const SAME_M: f64 = 1e-4;

/// Checks that every number is one that an arm or an instrument can give.
///
/// # Errors
/// The first that is not, with its file and line.
pub fn check_values(robot: &Robot, data: &Dataset) -> Result<()> {
    for o in &data.observations {
        for (k, (q, joint)) in o.state.q.iter().zip(&robot.joints).enumerate() {
            let (per_si, unit) = joint.kind.unit();
            let far = if joint.kind == JointKind::Prismatic { FAR_M } else { FAR_RAD };
            let (shown, limit) = (q * per_si, (far * per_si).round());
            if !(q.is_finite() && shown.abs() <= limit) {
                let problem = format!("joint {}: found {shown} {unit}, expected between -{limit} and {limit}", k + 1);
                return Err(data.error(o, problem));
            }
        }
        let (what, numbers) = o.measured.lengths();
        if let Some(x) = numbers.iter().find(|x| !(x.is_finite() && x.abs() <= FAR_M)) {
            let problem = format!("{what}: found {} mm, expected less than a kilometre", x * 1e3);
            return Err(data.error(o, problem));
        }
        if let Measured::Pose { quaternion, .. } = &o.measured {
            let length = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
            // NaN too
            if (length - 1.0).abs() > 1e-2 || length.is_nan() {
                return Err(data.error(o, format!("quaternion: found length {length}, expected 1")));
            }
        }
    }
    Ok(())
}

/// Places that spread so many times less than the arm moved are in these units where mm are expected (with some room).
const UNITS: [(&str, std::ops::Range<f64>); 3] = [("m", 300.0..3000.0), ("inches", 23.0..28.0), ("cm", 9.0..11.0)];

/// An arm that moved less, m, is compared with no unit: its tool may be elsewhere than the cell file has it.
const MOVED: f64 = 0.1;

/// Joints that all stay below 2 pi "deg" while places spread so many times more than the arm moved are in rad (57.3, and some room).
const RADIANS: f64 = 15.0;

/// Refuses measured places in m and joints in rad: sizes that no arm has. Each recording is compared with where the nominal arm says that
/// it was.
///
/// # Errors
/// One sentence with the file and the columns.
pub fn check_units(robot: &Robot, cell: &Cell, data: &Dataset) -> Result<()> {
    let Ok(forward) = Forward::new(Model::nominal(robot.clone(), cell.clone()), Vec::new()) else { return Ok(()) };
    let mut ws = forward.workspace();
    for (k, name) in data.names.iter().enumerate() {
        let mut pairs: Vec<(Vector3<f64>, Vector3<f64>)> = Vec::new();
        let mut largest = 0.0_f64;
        for o in data.observations.iter().filter(|o| o.recording == k) {
            let place = match &o.measured {
                Measured::Touch { ball, .. } => cell.balls.get(*ball).copied(),
                Measured::Point { position, .. } | Measured::Pose { position, .. } => Some(Vector3::from(*position)),
                _ => None,
            };
            let Some(place) = place else { continue };
            pairs.push((place, forward.world_from_tool(&o.state, &mut ws).translation));
            let turns = |(q, j): (&f64, &Joint)| if j.kind == JointKind::Revolute { q.abs() } else { 0.0 };
            largest = o.state.q.iter().zip(&robot.joints).map(turns).fold(largest, f64::max);
        }
        let (measured, moved) = (spread(pairs.iter().map(|p| p.0)), spread(pairs.iter().map(|p| p.1)));
        let error = |place: &str, problem: String| Err(IdentError::at(name, place, problem));
        let is_point = |o: &&Observation| !matches!(o.measured, Measured::Touch { .. });
        let unit = UNITS.iter().find(|(_, less)| moved > MOVED && less.contains(&(moved / measured)));
        if let Some((unit, _)) = unit
            && data.observations.iter().filter(|o| o.recording == k).all(|o| is_point(&o))
        {
            return error(
                "columns x_mm, y_mm, z_mm",
                format!(
                    "the points spread over {:.3} mm, but the arm moved over {:.0} mm; expected mm, found what looks like {unit}",
                    measured * 1e3,
                    moved * 1e3
                ),
            );
        }
        if largest <= TURN_AS_DEG && measured > RADIANS * moved {
            return error(
                "columns q1_deg ...",
                format!(
                    "the joints stay below {:.2} deg, but the tool was found at places that spread over {:.0} mm; expected deg, found \
                     what looks like rad",
                    largest.to_degrees(),
                    measured * 1e3
                ),
            );
        }
        let farthest = robot.joints.iter().flat_map(|j| j.limits).fold(0.0_f64, |most, l| most.max(l.abs()));
        if largest > DEG_AS_TURNS && largest > 2.0 * farthest {
            return error(
                "columns q1_deg ... (or q1_rad)",
                format!(
                    "a joint turns to {largest:.0} rad, {:.0} turns; expected rad, found what looks like deg",
                    largest / std::f64::consts::TAU
                ),
            );
        }
        if let Some(read) = orientations_otherwise(&forward, data, k) {
            return error(
                "columns of the orientation (qw ..., roll_deg ..., or r11 ...)",
                format!(
                    "the orientations follow the arm only {read}; expected the turn of the tool in the measuring frame"
                ),
            );
        }
    }
    Ok(())
}

/// A tool that is turned as the arm says, but for as much as a nominal arm is off, and one that is not, rad.
const ALIKE: f64 = 0.1;
const UNLIKE: f64 = 0.35;

/// A quaternion w, x, y, z from the four numbers of a row.
type Read = fn([f64; 4]) -> [f64; 4];

/// How a recording has to be read for its orientations to follow the arm, if it is not as they stand: with the last number of quaternions
/// put first, as the opposite turn (of the measuring frame in the tool), with angles exchanged or in rad. What they turn from one pose to the next is compared, so that tool
/// and measuring frame do not matter; the size of a turn is the same each way, its axis is not.
fn orientations_otherwise(forward: &Forward, data: &Dataset, recording: usize) -> Option<String> {
    let mut ws = forward.workspace();
    let mut poses: Vec<(UnitQuaternion<f64>, [f64; 4])> = Vec::new();
    for o in data.observations.iter().filter(|o| o.recording == recording) {
        if let Measured::Pose { quaternion, .. } = o.measured {
            let rotation = forward.world_from_tool(&o.state, &mut ws).rotation;
            poses.push((UnitQuaternion::from_matrix(&rotation), quaternion));
        }
    }
    let off = |read: Read| -> Option<f64> {
        let unit = |q: [f64; 4]| {
            let [w, x, y, z] = read(q);
            UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
        };
        let turned = |pair: &[(UnitQuaternion<f64>, [f64; 4])]| match pair {
            [a, b] => Some(((a.0.inverse() * b.0).scaled_axis(), (unit(a.1).inverse() * unit(b.1)).scaled_axis())),
            _ => None,
        };
        let pairs: Vec<(Vector3<f64>, Vector3<f64>)> = poses.windows(2).filter_map(turned).collect();
        let tool = rigid_from_points(&pairs)?.rotation;
        let left: Vec<f64> = pairs.iter().map(|(arm, measured)| (tool * measured - arm).norm()).collect();
        Some(median(&left))
    };
    let read: [(&str, Read); 4] = [
        ("with quaternions in the order x, y, z, w", |[x, y, z, w]| [w, x, y, z]),
        (
            "as the turn of the measuring frame in the tool (quaternions of the other sign, or matrices transposed)",
            |[w, x, y, z]| [w, -x, -y, -z],
        ),
        ("with roll and yaw exchanged", |q| with_angles(q, |[yaw, pitch, roll]| [roll, pitch, yaw])),
        ("with angles in rad where deg is expected", |q| with_angles(q, |angles| angles.map(f64::to_degrees))),
    ];
    if off(|q| q)? < UNLIKE {
        return None;
    }
    let fits = read.iter().filter(|(_, read)| off(*read).is_some_and(|left| left < ALIKE));
    let fits: Vec<&str> = fits.map(|(said, _)| *said).collect();
    (!fits.is_empty()).then(|| fits.join(", or "))
}

/// A quaternion whose angles about z, y and x are changed.
fn with_angles(q: [f64; 4], change: fn([f64; 3]) -> [f64; 3]) -> [f64; 4] {
    let [a, b, c] = change(angles_zyx(&rotation_from_quaternion(q)));
    quaternion_from_rotation(&rotation_zyx(a, b, c))
}

/// Joints turn no further than this, rad; degrees taken for rad do.
const DEG_AS_TURNS: f64 = 30.0;

/// 2 pi taken for degrees, rad.
const TURN_AS_DEG: f64 = 2.0 * std::f64::consts::PI * std::f64::consts::PI / 180.0;

/// Root mean square distance from the mean.
fn spread(points: impl Iterator<Item = Vector3<f64>>) -> f64 {
    let points: Vec<Vector3<f64>> = points.collect();
    let n = points.len().max(1) as f64;
    let middle = points.iter().sum::<Vector3<f64>>() / n;
    (points.iter().map(|p| (p - middle).norm_squared()).sum::<f64>() / n).sqrt()
}

/// Number of poses that differ by more than `SAME_RAD` (or `SAME_M`) in some joint, roughly: joints are sorted into bins.
#[must_use]
pub fn different_poses(robot: &Robot, data: &Dataset) -> usize {
    data.observations.iter().map(|o| bin(robot, o)).collect::<BTreeSet<_>>().len()
}

/// How many numbers were measured if those that repeat a measurement at the same pose are not counted.
#[must_use]
pub fn different_numbers(robot: &Robot, data: &Dataset) -> usize {
    let seen = |o: &Observation| {
        let which = o.measured.of_which().map_or(0, |(_, k)| k);
        (bin(robot, o), which, trical_model::residual_rows(&o.measured))
    };
    data.observations.iter().map(seen).collect::<BTreeSet<_>>().into_iter().map(|(.., rows)| rows).sum()
}

fn bin(robot: &Robot, o: &Observation) -> [i64; MAX_JOINTS] {
    let mut key = [0_i64; MAX_JOINTS];
    for ((k, q), joint) in key.iter_mut().zip(&o.state.q).zip(&robot.joints) {
        let step = if joint.kind == JointKind::Prismatic { SAME_M } else { SAME_RAD };
        *k = (q / step).round() as i64;
    }
    key
}

/// A joint that moves by less hardly moves: over 1 deg (or 5 mm) an error of 1 mm (or 0.1 deg) shows as 0.02 mm (0.01 mm), which is
/// noise.
const HARDLY_RAD: f64 = 1.0_f64.to_radians();
const HARDLY_M: f64 = 5e-3;

/// Between which values each joint was, SI.
fn strokes(robot: &Robot, data: &Dataset) -> Vec<[f64; 2]> {
    let of = |k: usize| {
        let q = data.observations.iter().map(|o| o.state.q[k]);
        q.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], q| [low.min(q), high.max(q)])
    };
    (0..robot.dof()).map(of).collect()
}

/// Joints (1-based) that stay where they are throughout.
#[must_use]
pub fn resting_joints(robot: &Robot, data: &Dataset) -> Vec<usize> {
    let stays = |(k, [low, high]): (usize, [f64; 2])| {
        let same = if robot.joints[k].kind == JointKind::Prismatic { SAME_M } else { SAME_RAD };
        (high - low < same).then_some(k + 1)
    };
    strokes(robot, data).into_iter().enumerate().filter_map(stays).collect()
}

/// Joints (from 0) that hardly move, and where they are. None where no joint moves at all: such data stand for others.
#[must_use]
pub fn hardly_moving(robot: &Robot, data: &Dataset) -> Vec<(usize, f64)> {
    let hardly =
        |(k, [low, high]): (usize, [f64; 2])| (high - low < little(robot, k)).then_some((k, 0.5 * (low + high)));
    let resting: Vec<(usize, f64)> = strokes(robot, data).into_iter().enumerate().filter_map(hardly).collect();
    if resting.len() == robot.dof() { Vec::new() } else { resting }
}

/// A joint that moves less than this hardly moves, rad or m.
pub(crate) fn little(robot: &Robot, joint: usize) -> f64 {
    if robot.joints[joint].kind == JointKind::Prismatic { HARDLY_M } else { HARDLY_RAD }
}

/// Refuses poses that are all alike.
///
/// # Errors
/// One sentence with the number of measurements.
pub fn check_poses(robot: &Robot, data: &Dataset) -> Result<()> {
    if data.observations.is_empty() {
        return Err(IdentError::NotEnough(format!(
            "{}: no measurement is left to identify from{}",
            data.names.join(", "),
            rejected_in_words(&data.rejected).map_or_else(String::new, |r| format!(", {r}"))
        )));
    }
    if resting_joints(robot, data).len() == robot.dof() {
        return Err(IdentError::NotEnough(format!(
            "{}: all {} measurements were taken in the same pose (no joint moves by 0.1 deg or 0.1 mm){}; varied \
             poses are needed",
            data.names.join(", "),
            data.observations.len(),
            rejected_in_words(&data.rejected).map_or_else(String::new, |r| format!(", {r}"))
        )));
    }
    Ok(())
}

/// Refuses balls and anchors that leave {w} open where nothing else fixes it: fewer than three touched, two in one place, all on
/// one line.
///
/// # Errors
/// One sentence that names the balls.
pub fn check_balls(cell: &Cell, data: &Dataset) -> Result<()> {
    let touched = touched(data, |_| true);
    if touched.is_empty() {
        return Ok(());
    }
    let numbers: Vec<String> = touched.iter().map(|b| (b + 1).to_string()).collect();
    let bad = |problem: String| {
        Err(IdentError::NotEnough(format!(
            "{problem}; three balls that are not on one line are needed to fix the base"
        )))
    };
    let places: Vec<(usize, Vector3<f64>)> = touched.iter().filter_map(|b| Some((*b, *cell.balls.get(*b)?))).collect();
    // a ball has a diameter of millimetres: two centres closer than one are a mistake in the file
    const LEAST: f64 = 1e-3;
    for (i, (a, p)) in places.iter().enumerate() {
        for (b, q) in &places[..i] {
            if (p - q).norm() < LEAST {
                let apart = (p - q).norm() * 1e3;
                return bad(format!(
                    "[balls] of the cell: balls {} and {} stand in the same place ({apart:.3} mm apart; the cell file is in mm)",
                    b + 1,
                    a + 1
                ));
            }
        }
    }
    // where the base is open, the set's pose is identified at each place
    let open = cell.balls.len() < 3 || data.observations.iter().any(|o| o.state.place.is_some());
    if open {
        return Ok(());
    }
    if touched.len() < 3 {
        return bad(format!(
            "{}: only ball{} {} {} touched",
            data.names.join(", "),
            if touched.len() == 1 { "" } else { "s" },
            numbers.join(" and "),
            if touched.len() == 1 { "was" } else { "were" }
        ));
    }
    let Some(((_, first), rest)) = places.split_first() else { return Ok(()) };
    let far = rest.iter().map(|(_, p)| p - first).max_by(|a, b| a.norm().total_cmp(&b.norm()));
    let Some(along) = far.map(|v| v.normalize()) else { return Ok(()) };
    let off = rest.iter().map(|(_, p)| (p - first).cross(&along).norm()).fold(0.0, f64::max);
    if off < LEAST {
        return bad(format!(
            "[balls] of the cell: balls {} stand on one line (none is {} mm off it)",
            numbers.join(", "),
            LEAST * 1e3
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_of_a_quaternion_are_changed_in_their_order() {
        let q = quaternion_from_rotation(&rotation_zyx(0.3, -0.2, 0.1));
        let near = |a: [f64; 4], b: [f64; 3]| {
            let [x, y, z] = angles_zyx(&rotation_from_quaternion(a));
            [x, y, z].iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12)
        };
        assert!(near(with_angles(q, |[yaw, pitch, roll]| [roll, pitch, yaw]), [0.1, -0.2, 0.3]));
        assert!(near(with_angles(q, |angles| angles.map(|a| 2.0 * a)), [0.6, -0.4, 0.2]));
    }
}
