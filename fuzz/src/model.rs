//! Robots, cells and URDF.

use trical_model::{Cell, Pose, Robot, urdf as reader};

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

/// `robot.toml`: what is taken is finite, and read back as it was written.
pub fn robot(data: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(data) else { return false };
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
}

/// `cell.toml`: what is taken is finite, and read back as it was written.
pub fn cell(data: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(data) else { return false };
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
}

/// URDF: an arm that can be written as `robot.toml`.
pub fn urdf(data: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(data) else { return false };
    let Ok(arm) = reader::parse(text, "r.urdf", None, None) else { return false };
    check_robot(&arm.robot, text);
    let written = arm.robot.to_toml();
    let again = Robot::parse(&written, "w.toml").unwrap_or_else(|e| panic!("{e}\n{written}\n{text}"));
    check_robot(&again, text);
    true
}
