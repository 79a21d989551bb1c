//! Valid files with a few characters changed: no panic, and whatever is taken is finite and is read back as it was written.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "common/mutants.rs"]
mod common;

use common::mutants;
use trical_model::{Cell, Pose, Robot, urdf};

const ROBOT: &str = include_str!("../../../cells/irb120/robot.toml");
const SLIDES: &str = "name = \"a\"\n[root]\nxyz_mm = [1.0, 2, -3]\nzyx_deg = [10, 0, 180]\n[[joint]]\nkind = \"prismatic\"\nalpha_deg = 90\n\
                      a_mm = 1e2\nd_mm = 0.5\ntheta_offset_deg = -90.0\nlimits_mm = [0, 500]\nmass_kg = 3\ncog_mm = [1, 2, 3]\n";
const CELL: &str = "[base]\nxyz_mm = [150.0, -330.0, -150.0]\nzyx_deg = [90.0, 0.0, 0.0]\n[tool]\ntcp_mm = [18.0, -12.0, 118.0]\n\
                    mass_kg = 1.7\ncog_mm = [5.0, -4.0, 55.0]\n[balls]\ndistances_mm = { d12 = 300.0, d13 = 300.0, d23 = 300.0 }\n\
                    [anchors]\npositions_mm = [[1, 2, 3]]\n[geometry]\nmargin_mm = 5.0\n";
const POINTS: &str = "[base]\nxyz_mm = [1, 2, 3]\nzyx_deg = [90, 80, 70]\n[tool]\ntcp_mm = [1, 2, 3]\nzyx_deg = [1, 2, 3]\n\
                      targets_mm = [[1, 2, 3], [4, 5, 6]]\n[balls]\npositions_mm = [[1, 2, 3], [4, 5, 6]]\n";
const URDF: &str = "<robot name=\"r\"><link name=\"a\"><inertial><origin xyz=\"0 0 .1\"/><mass value=\"2\"/></inertial></link>\
                    <joint name=\"1\" type=\"revolute\"><origin xyz=\"0 0 .3\" rpy=\"0 1.5708 0\"/><parent link=\"a\"/>\
                    <child link=\"b\"/><axis xyz=\"0 1 0\"/><limit lower=\"-3\" upper=\"3.1\"/></joint><link name=\"b\"/>\
                    <joint name=\"2\" type=\"prismatic\"><parent link=\"b\"/><child link=\"c\"/><limit lower=\"0\" upper=\"1\"/>\
                    </joint><link name=\"c\"/></robot>";

fn is_pose(p: &Pose) -> bool {
    let r = p.rotation * p.rotation.transpose();
    (r - nalgebra::Matrix3::identity()).amax() < 1e-9 && p.translation.iter().all(|x| x.is_finite())
}

/// All of an arm is finite.
fn check_robot(r: &Robot, text: &str) {
    assert!((1..=9).contains(&r.dof()), "{text}");
    assert!(is_pose(&r.root_from_zero) && is_pose(&r.last_from_flange), "{text}");
    for j in &r.joints {
        let numbers = [j.alpha, j.a, j.beta, j.d, j.theta_offset, j.limits[0], j.limits[1], j.mass.unwrap_or(0.0)];
        assert!(numbers.iter().chain(j.cog.iter()).all(|x| x.is_finite() && x.abs() < 1e6), "{text}");
        assert!(j.limits[0] < j.limits[1] && j.mass.is_none_or(|m| m >= 0.0), "{text}");
    }
}

#[test]
fn robots() {
    mutants(&[ROBOT, SLIDES], |text| {
        let Ok(r) = Robot::parse(text, "r.toml") else { return false };
        check_robot(&r, text);
        let written = r.to_toml();
        let again = Robot::parse(&written, "w.toml").unwrap_or_else(|e| panic!("{e}\n{written}"));
        check_robot(&again, text);
        assert_eq!((&again.name, again.dof()), (&r.name, r.dof()), "{text}");
        for (a, b) in again.joints.iter().zip(&r.joints) {
            let close = |a: f64, b: f64| (a - b).abs() <= 4.0 * f64::EPSILON * b.abs();
            assert!(close(a.alpha, b.alpha) && close(a.a, b.a) && close(a.beta, b.beta) && close(a.d, b.d), "{text}");
            assert!(close(a.theta_offset, b.theta_offset) && a.kind == b.kind && a.mass == b.mass, "{text}");
            assert!(close(a.limits[0], b.limits[0]) && close(a.limits[1], b.limits[1]), "{text}");
            assert!(a.mass.is_none() || (a.cog - b.cog).amax() <= 1e-14 * b.cog.amax(), "{text}");
        }
        true
    });
}

#[test]
fn cells() {
    mutants(&[CELL, POINTS], |text| {
        let Ok(c) = Cell::parse(text, "c.toml") else { return false };
        let points = || c.balls.iter().chain(&c.anchors).chain(&c.tool.targets);
        assert!(points().all(|p| p.iter().all(|x| x.is_finite() && x.abs() < 1e4)), "{text}");
        assert!(is_pose(&c.world_from_base) && c.tool.mass.is_finite() && c.tool.mass >= 0.0, "{text}");
        assert!(c.tool.tcp.iter().chain(c.tool.cog.iter()).all(|x| x.is_finite()), "{text}");
        let written = c.to_toml();
        let again = Cell::parse(&written, "w.toml").unwrap_or_else(|e| panic!("{e}\n{written}"));
        assert_eq!((again.balls.len(), again.tool.targets.len()), (c.balls.len(), c.tool.targets.len()));
        for (a, b) in again.balls.iter().zip(&c.balls).chain(again.tool.targets.iter().zip(&c.tool.targets)) {
            assert!((a - b).amax() <= 1e-14 * b.amax(), "{text}");
        }
        assert!((again.world_from_base.rotation - c.world_from_base.rotation).amax() < 1e-13, "{text}");
        true
    });
}

#[test]
fn urdfs() {
    mutants(&[URDF], |text| {
        let Ok(arm) = urdf::parse(text, "r.urdf", None, None) else { return false };
        check_robot(&arm.robot, text);
        let written = arm.robot.to_toml();
        let again = Robot::parse(&written, "w.toml").unwrap_or_else(|e| panic!("{e}\n{written}\n{text}"));
        check_robot(&again, text);
        true
    });
}
