//! The shipped arms: each reads, reaches as far as its maker says, and stands where it should at a documented pose.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use trical_model::pose::rotation_zyx;
use trical_model::{Cell, Forward, Model, Robot, State};

fn forward(file: &str) -> Forward {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(file);
    let robot = Robot::load(&path).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(robot.dof(), 6);
    Forward::new(Model::nominal(robot, Cell::bare()), Vec::new()).unwrap()
}

/// The flange at joints in deg: position in mm and axes.
fn flange(file: &str, q_deg: [f64; 6]) -> (Vector3<f64>, Matrix3<f64>) {
    let forward = forward(file);
    let pose = forward.world_from_flange(&State::at(&q_deg.map(f64::to_radians)), &mut forward.workspace());
    (pose.translation * 1e3, pose.rotation)
}

fn stands(file: &str, q_deg: [f64; 6], xyz_mm: [f64; 3], zyx_deg: [f64; 3]) {
    let (p, r) = flange(file, q_deg);
    let [z, y, x] = zyx_deg.map(f64::to_radians);
    assert!((p - Vector3::from(xyz_mm)).amax() < 1e-9, "{file}: {p}");
    assert!((r - rotation_zyx(z, y, x)).amax() < 1e-12, "{file}: {r}");
}

/// How far the wrist's centre gets from axis 1, mm: over all joints 2 and 3 within limits.
fn reach(file: &str) -> f64 {
    let forward = forward(file);
    let limits: Vec<[f64; 2]> = forward.model().robot.joints.iter().map(|j| j.limits).collect();
    let mut ws = forward.workspace();
    let at = |l: &[f64; 2], k: usize| l[0] + (l[1] - l[0]) * f64::from(u32::try_from(k).unwrap()) / 800.0;
    let mut most: f64 = 0.0;
    for i in 0..=800 {
        for k in 0..=800 {
            let q = [0.0, at(&limits[1], i), at(&limits[2], k), 0.0, 0.0, 0.0];
            let wrist = forward.world_from_joints(&State::at(&q), &mut ws)[4].translation;
            most = most.max(wrist.x.hypot(wrist.y));
        }
    }
    most * 1e3
}

/// Within what a grid of half a degree misses.
fn reaches(file: &str, mm: f64) {
    let r = reach(file);
    assert!((mm - 0.1..mm + 0.05).contains(&r), "{file}: {r}");
}

#[test]
fn irb_120() {
    let file = "cells/irb120/robot.toml";
    // ABB: 580 mm
    reaches(file, 270.0 + f64::hypot(302.0, 70.0));
    stands(file, [0.0; 6], [374.0, 0.0, 630.0], [0.0, 90.0, 0.0]);
}

#[test]
fn universal_robots() {
    // the pose that the controller shows with all joints at zero: the arm lies along -x, the tool looks along -y
    stands("robots/ur5e.toml", [0.0; 6], [-817.2, -232.9, 62.8], [0.0, 0.0, 90.0]);
    stands("cells/ur10/robot.toml", [0.0; 6], [-1184.3, -256.141, 11.6], [0.0, 0.0, 90.0]);
    // the working radii of the data sheets: 850 mm to the flange of the stretched arm, 1300 mm with the wrist stretched too
    let (p, _) = flange("robots/ur5e.toml", [0.0; 6]);
    assert!((p.x.hypot(p.y) - 850.0).abs() < 0.5);
    let (p, _) = flange("cells/ur10/robot.toml", [0.0, 0.0, 0.0, -90.0, 0.0, 0.0]);
    assert!((p.x.abs() - 1300.0).abs() < 0.5, "{p}");
    let arm = forward("robots/ur5e.toml");
    let tau = arm.gravity_torques(&State::at(&[0.0; 6]), &mut arm.workspace()).unwrap();
    // levers of the stretched arm, by hand
    let by_hand: f64 = 9.80665 * (8.058 * 0.2125 + 2.846 * (0.425 + 0.2422) + (1.37 + 1.3 + 0.365) * 0.8172);
    assert!((tau[1].abs() - by_hand).abs() < 1e-9 && tau[0].abs() < 1e-12, "{tau:?}");
}

#[test]
fn meca_500() {
    let file = "robots/meca500.toml";
    // Mecademic: 260 mm
    reaches(file, 135.0 + f64::hypot(120.0, 38.0));
    assert!((reach(file) - 260.0).abs() < 1.0);
    stands(file, [0.0; 6], [190.0, 0.0, 308.0], [0.0, 90.0, 0.0]);
}

#[test]
fn kuka_kr_6_r700() {
    let file = "robots/kr6_r700.toml";
    // KUKA: 706.7 mm
    reaches(file, 706.7);
    // all joints at zero: stretched forwards; and the usual home, the upper arm upright
    stands(file, [0.0; 6], [785.0, 0.0, 435.0], [0.0, 90.0, 0.0]);
    stands(file, [0.0, -90.0, 90.0, 0.0, 0.0, 0.0], [470.0, 0.0, 750.0], [0.0, 90.0, 0.0]);
    // axis 1 turns clockwise seen from above
    stands(file, [90.0, -90.0, 90.0, 0.0, 0.0, 0.0], [0.0, -470.0, 750.0], [-90.0, 90.0, 0.0]);
}

#[test]
fn fanuc_lr_mate_200id() {
    let file = "robots/lrmate_200id.toml";
    // FANUC: 717 mm
    reaches(file, 50.0 + 330.0 + f64::hypot(335.0, 35.0));
    assert!((reach(file) - 717.0).abs() < 0.5);
    // x 465, and 365 above the world frame of the controller, which is 330 above the mounting face
    stands(file, [0.0; 6], [465.0, 0.0, 330.0 + 365.0], [180.0, -90.0, 0.0]);
}

#[test]
fn a_link_without_mass_needs_no_centre_and_one_with_mass_does() {
    let arm = include_str!("data/arm.toml");
    let first = |mass: &str| arm.replacen("mass_kg = 3.0\ncog_mm = [0.0, 0.0, -50.0]", mass, 1);
    let robot = Robot::parse(&first("mass_kg = 0.0"), "arm.toml").unwrap();
    assert_eq!((robot.joints[0].mass, robot.joints[0].cog), (Some(0.0), Vector3::zeros()));
    let error = Robot::parse(&first("mass_kg = 0.1"), "arm.toml").unwrap_err().to_string();
    assert!(error.contains("cog_mm"), "{error}");
}

#[test]
fn files_are_urdfs_by_their_ends_with_links_behind_a_hash() {
    use trical_model::urdf::UrdfPath;
    let of = |path: &str| UrdfPath::of(Path::new(path)).map(|u| (u.path.to_string_lossy().into_owned(), u.root, u.tip));
    let some = |s: &str| Some(s.to_owned());
    assert_eq!(of("arm.urdf"), Some(("arm.urdf".into(), None, None)));
    assert_eq!(of("ARM.URDF"), Some(("ARM.URDF".into(), None, None)));
    assert_eq!(of("arm.xml"), Some(("arm.xml".into(), None, None)));
    assert_eq!(of("arm.urdf#base:tool0"), Some(("arm.urdf".into(), some("base"), some("tool0"))));
    assert_eq!(of("arm.urdf#:tool0"), Some(("arm.urdf".into(), None, some("tool0"))));
    assert_eq!(of("arm.xml#tool0"), Some(("arm.xml".into(), None, some("tool0"))));
    assert_eq!(of("robot.toml"), None);
    assert_eq!(of("robot.toml#tool0"), None);
}

/// One joint outside is enough, on either side; a tolerance widens both, and a negative one narrows them.
#[test]
fn every_joint_has_to_be_within_both_of_its_limits() {
    let mut robot = Robot::parse(include_str!("data/arm.toml"), "arm.toml").unwrap();
    for joint in &mut robot.joints {
        joint.limits = [-1.0, 2.0];
    }
    for (k, (value, tolerance, within)) in [
        (-1.0, 0.0, true),
        (2.0, 0.0, true),
        (-1.1, 0.0, false),
        (2.1, 0.0, false),
        (-1.1, 0.2, true),
        (2.1, 0.2, true),
        (-0.9, -0.2, false),
        (1.9, -0.2, false),
    ]
    .into_iter()
    .enumerate()
    {
        let mut q = [0.5; 6];
        q[k % 6] = value;
        assert_eq!(robot.within_limits(&q, tolerance), within, "{value}, {tolerance}");
    }
}
