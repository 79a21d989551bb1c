//! Arms of Universal Robots: what the maker measured of one (the controller's `calibration.conf`) as a nominal arm, and a calibrated one as the
//! ROS driver reads it (`robot_calibration.yaml`).

use std::fmt::Write as _;

use crate::error::{ModelError, Result};
use crate::forward::Model;
use crate::pose::{Pose, angles_zyx, rotation_x};
use crate::robot::{Joint, JointKind, Robot};

use super::correct::{arm_alone, links};
use crate::urdf::tree::Axes;
use crate::urdf::{robot_from_axes, write};

type V3 = nalgebra::Vector3<f64>;

/// Names of the joints in the driver's file.
const JOINTS: [&str; 6] = ["shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"];

/// Directions of the axes with all joints at zero, in the maker's base frame.
const AXES: [[f64; 3]; 6] =
    [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [0.0, -1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]];

/// So far may an axis point beside where it should, rad.
const BESIDE: f64 = 0.05;

/// The lists of a `calibration.conf`: what is added to the maker's (standard) Denavit-Hartenberg parameters, m and rad.
const LISTS: [&str; 4] = ["delta_theta", "delta_a", "delta_d", "delta_alpha"];

/// Whether the arm is built like one of Universal Robots, its root being the maker's base frame.
fn check(robot: &Robot, frames: &[Pose]) -> Result<()> {
    let along = |(pose, axis): (&Pose, &[f64; 3])| (pose.rotation.column(2) - V3::from(*axis)).norm() < BESIDE;
    let turns = robot.joints.iter().all(|j| j.kind == JointKind::Revolute);
    if frames.len() == 6 && turns && frames.iter().zip(&AXES).all(along) {
        return Ok(());
    }
    Err(ModelError::unreadable(
        &robot.name,
        "is not an arm of Universal Robots in the maker's base frame: expected six joints that turn about axes as those of robots/ur5e.toml",
    ))
}

/// The arm that the controller's `calibration.conf` (its `text`) describes: `nominal` with what the maker measured of this one. Axes that are
/// nearly parallel get Hayati's form, where the file has offsets of many metres.
///
/// # Errors
/// A file without the four lists of six numbers, or a nominal arm that is none of Universal Robots in the maker's own frames.
pub fn calibrated_by_maker(nominal: &Robot, text: &str, file: &str) -> Result<Robot> {
    let plain = Model::nominal(nominal.clone(), crate::Cell::bare());
    let stood = links(&plain)?;
    check(nominal, &stood)?;
    if nominal.joints.iter().any(|j| j.theta_offset != 0.0 || j.beta != 0.0)
        || nominal.root_from_zero != Pose::identity()
    {
        return Err(ModelError::unreadable(
            &nominal.name,
            "is not in the maker's frames: expected theta_offset_deg 0 throughout and no [root], as in robots/ur5e.toml",
        ));
    }
    let [theta, a, d, alpha] = lists(text, file)?;
    let mut joints = nominal.joints.clone();
    for (i, joint) in joints.iter_mut().enumerate() {
        joint.theta_offset += theta[i];
        joint.d += d[i];
        if i > 0 {
            joint.a += a[i - 1];
            joint.alpha += alpha[i - 1];
        }
    }
    let behind = Pose { rotation: rotation_x(alpha[5]), translation: V3::new(a[5], 0.0, 0.0) };
    let mut pose = Pose::identity();
    let mut axes = Vec::with_capacity(6);
    for (joint, stood) in joints.iter().zip(&stood) {
        pose = pose.compose(&write::at_zero(joint));
        let axis: V3 = pose.rotation.column(2).into();
        axes.push(of_axis(joint, &pose, axis, stood));
    }
    let flange = pose.compose(&behind).compose(&nominal.last_from_flange);
    Ok(robot_from_axes(&axes, &flange, &nominal.name))
}

/// An axis, from the point of it that is nearest to where the nominal frame stood.
fn of_axis(joint: &Joint, pose: &Pose, axis: V3, stood: &Pose) -> Axes {
    let point = pose.translation + axis * axis.dot(&(stood.translation - pose.translation));
    let (limits, mass) = (joint.limits, joint.mass);
    Axes { kind: joint.kind, point, axis, limits, mass, cog: stood.apply(&joint.cog) }
}

/// `name = [ 1, 2, ... ]` of six numbers each.
fn lists(text: &str, file: &str) -> Result<[[f64; 6]; 4]> {
    let mut found: [Option<[f64; 6]>; 4] = [None; 4];
    for (number, line) in text.lines().enumerate() {
        let Some((name, values)) = line.split_once('=') else { continue };
        let Some(which) = LISTS.iter().position(|n| *n == name.trim()) else { continue };
        let place = || format!("line {}, {}", number + 1, name.trim());
        let wrong = |problem: String| ModelError::Input { file: file.to_owned(), place: place(), problem };
        let inner = values.trim().strip_prefix('[').and_then(|v| v.strip_suffix(']'));
        let inner = inner.ok_or_else(|| wrong(format!("found '{}', expected [six numbers]", values.trim())))?;
        let numbers: Vec<Option<f64>> =
            inner.split(',').map(|v| v.trim().parse().ok().filter(|x: &f64| x.is_finite() && x.abs() < 1e4)).collect();
        let all: Option<Vec<f64>> = numbers.into_iter().collect();
        let six = all.and_then(|v| <[f64; 6]>::try_from(v).ok());
        found[which] = Some(six.ok_or_else(|| wrong("expected six numbers in m or rad, below 10000".into()))?);
    }
    let mut out = [[0.0; 6]; 4];
    for ((to, from), name) in out.iter_mut().zip(found).zip(LISTS) {
        *to = from.ok_or_else(|| {
            ModelError::unreadable(
                file,
                format!(
                    "has no {name}; expected the calibration.conf of a controller of Universal Robots, with {}",
                    LISTS.join(", ")
                ),
            )
        })?;
    }
    Ok(out)
}

/// The kinematics of a calibrated arm of Universal Robots as its ROS description and driver read them (`robot_calibration.yaml`): where each
/// joint stands in the one before, m and rad (`R = Rz(yaw) Ry(pitch) Rx(roll)`), all joints at zero. The flange is where the model's constant
/// terms have it, [`wrist_from_flange`] aside. `hash` tells files apart.
///
/// # Errors
/// An arm that is not built like those of Universal Robots, or whose root is not the maker's base frame.
pub fn ur_kinematics(model: &Model, hash: &str) -> Result<String> {
    let (nominal, flange) = frames(&model.robot)?;
    let calibrated = links(&arm_alone(model))?;
    let mut out = String::from("kinematics:\n");
    let mut before = Pose::identity();
    for (i, (stood, now)) in nominal.iter().zip(&calibrated).enumerate() {
        let makers = makers_frame(&nominal, &flange, i);
        let pose = now.compose(&stood.inverse().compose(&makers));
        let own = before.inverse().compose(&pose);
        let [yaw, pitch, roll] = angles_zyx(&own.rotation);
        let t = own.translation;
        let _ = writeln!(out, "  {}:", JOINTS[i]);
        for (key, value) in [("x", t.x), ("y", t.y), ("z", t.z), ("roll", roll), ("pitch", pitch), ("yaw", yaw)] {
            let _ = writeln!(out, "    {key}: {:.17}", value + 0.0);
        }
        before = pose;
    }
    let _ = writeln!(out, "  hash: {hash}");
    Ok(out)
}

/// Frames {1} to {6} and the flange of an arm of Universal Robots with all joints at zero.
fn frames(robot: &Robot) -> Result<(Vec<Pose>, Pose)> {
    let nominal = links(&Model::nominal(robot.clone(), crate::Cell::bare()))?;
    check(robot, &nominal)?;
    let flange = nominal[5].compose(&robot.last_from_flange);
    Ok((nominal, flange))
}

/// Where the flange is behind the last frame of the driver's file, at which that has it: elsewhere where a `calibration.conf` has `delta_a` or
/// `delta_alpha` of joint 6.
///
/// # Errors
/// As [`ur_kinematics`].
pub fn wrist_from_flange(robot: &Robot) -> Result<Pose> {
    let (nominal, flange) = frames(robot)?;
    Ok(makers_frame(&nominal, &flange, 5).inverse().compose(&flange))
}

/// Where the maker has frame `i` (from 0) of the nominal arm at zero: on its axis, x as near as can be to that of the base; at the next axis where
/// they meet (1, 4 and 5), else beside the frame before, the last beside the flange.
fn makers_frame(nominal: &[Pose], flange: &Pose, i: usize) -> Pose {
    let z: V3 = nominal[i].rotation.column(2).into();
    let point = nominal[i].translation;
    let near = |p: V3| point + z * z.dot(&(p - point));
    let origin = match i {
        0 | 3 | 4 => {
            // the point nearest to the next axis
            let (other, along) = (nominal[i + 1].translation, V3::from(nominal[i + 1].rotation.column(2)));
            let n = z.cross(&along);
            point + z * ((other - point).cross(&along).dot(&n) / n.norm_squared())
        }
        1 | 2 => near(makers_frame(nominal, flange, i - 1).translation),
        _ => near(flange.translation),
    };
    // the last turns with the flange
    let like = if i == 5 && flange.rotation.column(0).dot(&z).abs() < BESIDE {
        flange.rotation.column(0).into()
    } else {
        V3::x()
    };
    let x = (like - z * z.dot(&like)).normalize();
    Pose { rotation: nalgebra::Matrix3::from_columns(&[x, z.cross(&x), z]), translation: origin }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used)]
    use super::*;
    use crate::basis::Basis;
    use crate::pose::{rotation_y, rotation_z};
    use crate::recording::State;
    use crate::term::{Parameter, Site, Term};
    use crate::{Cell, Forward};

    const UR5E: &str = include_str!("../../../../robots/ur5e.toml");

    /// As a controller has it: offsets of many metres along axes 2 to 4, which are nearly parallel.
    const CONF: &str = "[mounting]\n delta_theta = [ -1.2e-05, -0.29, 1.12, -0.81, 3.1e-06, 2.2e-05]\n delta_a = [ 0.00005, 0.0204, 0.0012, -0.00003, 0.00009, 0.0007]\n\
                        delta_d = [ 0.00011, 442.87, -447.91, 5.03, -0.00004, 0.0003]\ndelta_alpha = [ -0.0003, 0.0015, 0.0042, 0.0002, -0.0004, 0.0011]\n\
                        joint_checksum = [ 0x1, 0x2, 0x3, 0x4, 0x5, 0x6]\n";

    fn nominal() -> Robot {
        Robot::parse(UR5E, "ur5e.toml").unwrap()
    }

    fn flange(robot: &Robot, terms: &[Term], q: &[f64]) -> Pose {
        let model = Model { terms: terms.to_vec(), ..Model::nominal(robot.clone(), Cell::bare()) };
        let forward = Forward::new(model, Vec::new()).unwrap();
        let mut ws = forward.workspace();
        forward.world_from_flange(&State::at(q), &mut ws)
    }

    fn apart(a: &Pose, b: &Pose) -> f64 {
        (a.translation - b.translation).norm().max((a.rotation - b.rotation).norm())
    }

    /// Joints at some poses.
    fn poses() -> Vec<Vec<f64>> {
        (0..20).map(|k| (0..6).map(|j| 3.0 * (1.7 * f64::from(k) + 2.3 * f64::from(j)).sin()).collect()).collect()
    }

    #[test]
    fn what_the_maker_measured_is_the_arm_of_its_own_formula() {
        let robot = calibrated_by_maker(&nominal(), CONF, "calibration.conf").unwrap();
        let [theta, a, d, alpha] = lists(CONF, "calibration.conf").unwrap();
        let (a0, d0) = ([0.0, -0.425, -0.3922, 0.0, 0.0, 0.0], [0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996]);
        let turn = std::f64::consts::FRAC_PI_2;
        let alpha0 = [turn, 0.0, 0.0, turn, -turn, 0.0];
        for q in poses() {
            // Rz(theta) Tz(d) Tx(a) Rx(alpha), six times
            let mut pose = Pose::identity();
            for i in 0..6 {
                let (c, s) = (rotation_z(q[i] + theta[i]), rotation_x(alpha0[i] + alpha[i]));
                let shift = V3::new(0.0, 0.0, d0[i] + d[i]) + c * V3::new(a0[i] + a[i], 0.0, 0.0);
                pose = pose.compose(&Pose { rotation: c * s, translation: shift });
            }
            let off = apart(&flange(&robot, &[], &q), &pose);
            // of numbers of 450 m
            assert!(off < 1e-9, "{off}");
        }
        // no number of the table is far from the arm, and a file brings it back
        assert!(robot.joints.iter().all(|j| j.d.abs() < 2.0 && j.a.abs() < 2.0), "{:?}", robot.joints);
        let again = Robot::parse(&robot.to_toml(), "again.toml").unwrap();
        assert!(poses().iter().all(|q| apart(&flange(&again, &[], q), &flange(&robot, &[], q)) < 1e-9));
    }

    #[test]
    fn the_drivers_file_moves_as_the_model_does() {
        let mut terms = Vec::new();
        for (link, parameter, value) in [
            (1, Parameter::Alpha, 1e-3),
            (2, Parameter::Beta, -2e-3),
            (2, Parameter::A, 1e-3),
            (4, Parameter::D, 2e-3),
            (5, Parameter::Theta, 4e-3),
        ] {
            let site = Site::Link { link, parameter };
            terms.push(Term { value, ..Term::new(format!("{parameter:?}"), "geometry", site, Basis::CONSTANT) });
        }
        for robot in [nominal(), calibrated_by_maker(&nominal(), CONF, "calibration.conf").unwrap()] {
            let model = Model { terms: terms.clone(), ..Model::nominal(robot.clone(), Cell::bare()) };
            let yaml = ur_kinematics(&model, "calib_1").unwrap();
            let numbers: Vec<f64> =
                yaml.lines().filter_map(|l| l.trim().split_once(": ")).filter_map(|(_, v)| v.parse().ok()).collect();
            assert_eq!(numbers.len(), 36, "{yaml}");
            let behind = wrist_from_flange(&robot).unwrap();
            for q in poses() {
                let mut pose = Pose::identity();
                for (n, q) in numbers.chunks(6).zip(&q) {
                    let rotation = rotation_z(n[5]) * rotation_y(n[4]) * rotation_x(n[3]) * rotation_z(*q);
                    pose = pose.compose(&Pose { rotation, translation: V3::new(n[0], n[1], n[2]) });
                }
                let off = apart(&flange(&robot, &terms, &q), &pose.compose(&behind));
                assert!(off < 1e-7, "{off}");
            }
        }
        // what the maker measured behind the last joint has no place in the file; of the nominal arm there is nothing
        let behind = wrist_from_flange(&calibrated_by_maker(&nominal(), CONF, "calibration.conf").unwrap()).unwrap();
        let expected = Pose { rotation: rotation_x(0.0011), translation: V3::new(0.0007, 0.0, 0.0) };
        assert!(apart(&behind, &expected) < 1e-9, "{behind:?}");
        assert!(apart(&wrist_from_flange(&nominal()).unwrap(), &Pose::identity()) < 1e-12);
        // of the nominal arm it is the maker's own
        let yaml = ur_kinematics(&Model::nominal(nominal(), Cell::bare()), "calib_0").unwrap();
        for line in [
            "  shoulder:\n    x: 0.00000000000000000\n    y: 0.00000000000000000\n    z: 0.16250",
            "  forearm:\n    x: -0.42499999999999",
        ] {
            assert!(yaml.contains(line), "{yaml}");
        }
    }

    #[test]
    fn other_files_and_other_arms_are_refused_in_a_sentence() {
        let says = |text: &str| calibrated_by_maker(&nominal(), text, "c.conf").unwrap_err().to_string();
        assert!(says("delta_a = [1, 2]\n").contains("line 1, delta_a: expected six numbers"));
        assert!(says("").contains("c.conf") && says("").contains("has no delta_theta"));
        let irb = Robot::parse(include_str!("../../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
        let refused = ur_kinematics(&Model::nominal(irb, Cell::bare()), "x").unwrap_err().to_string();
        assert!(refused.contains("is not an arm of Universal Robots"), "{refused}");
    }
}
