#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use nalgebra::Vector3;
use proptest::prelude::*;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

use super::*;
use crate::axis::Axis;
use crate::basis::Basis;
use crate::cell::{Cell, Tool};
use crate::forward::Model;
use crate::robot::{Joint, Robot};
use crate::term::{Motion, Parameter, Site, Term};

/// alpha deg, a mm, d mm, offset deg, lower deg, upper deg, mass
type Row = (f64, f64, f64, f64, f64, f64, f64);

const IRB_120: [Row; 6] = [
    (0.0, 0.0, 290.0, 0.0, -165.0, 165.0, 3.067),
    (-90.0, 0.0, 0.0, -90.0, -110.0, 110.0, 3.909),
    (0.0, 270.0, 0.0, 0.0, -110.0, 70.0, 2.944),
    (-90.0, 70.0, 302.0, 0.0, -160.0, 160.0, 1.328),
    (90.0, 0.0, 0.0, 0.0, -120.0, 120.0, 0.546),
    (-90.0, 0.0, 72.0, 180.0, -400.0, 400.0, 0.137),
];

const UR10: [Row; 6] = [
    (0.0, 0.0, 127.3, 0.0, -360.0, 360.0, 7.1),
    (90.0, 0.0, 0.0, 0.0, -360.0, 360.0, 12.7),
    (0.0, -612.0, 0.0, 0.0, -360.0, 360.0, 4.27),
    (0.0, -572.3, 163.941, 0.0, -360.0, 360.0, 2.0),
    (90.0, 0.0, 115.7, 0.0, -360.0, 360.0, 2.0),
    (-90.0, 0.0, 92.2, 0.0, -360.0, 360.0, 0.365),
];

/// An arm with a shoulder offset, as KUKA and FANUC build them: Pieper's quartic does not fall apart.
const OFFSET: [Row; 6] = [
    (0.0, 0.0, 400.0, 0.0, -170.0, 170.0, 1.0),
    (-90.0, 150.0, 0.0, -90.0, -120.0, 150.0, 1.0),
    (0.0, 600.0, 20.0, 0.0, -170.0, 170.0, 1.0),
    (-90.0, 120.0, 620.0, 0.0, -185.0, 185.0, 1.0),
    (90.0, 0.0, 0.0, 0.0, -119.0, 119.0, 1.0),
    (-90.0, 0.0, 115.0, 0.0, -350.0, 350.0, 1.0),
];

/// Twists of all kinds in the first links.
const SKEW: [Row; 6] = [
    (20.0, 30.0, 400.0, 10.0, -170.0, 170.0, 1.0),
    (-70.0, 150.0, 50.0, -90.0, -170.0, 170.0, 1.0),
    (15.0, 400.0, 20.0, 0.0, -170.0, 170.0, 1.0),
    (-80.0, 60.0, 420.0, 0.0, -185.0, 185.0, 1.0),
    (90.0, 0.0, 0.0, 0.0, -119.0, 119.0, 1.0),
    (-90.0, 0.0, 115.0, 0.0, -350.0, 350.0, 1.0),
];

/// A hollow wrist, whose axes stand at 60 degrees to each other, as on painting arms.
const HOLLOW: [Row; 6] = [
    (0.0, 0.0, 500.0, 0.0, -170.0, 170.0, 1.0),
    (-90.0, 200.0, 0.0, -90.0, -120.0, 150.0, 1.0),
    (0.0, 700.0, 0.0, 0.0, -170.0, 170.0, 1.0),
    (-90.0, 0.0, 800.0, 0.0, -185.0, 185.0, 1.0),
    (60.0, 0.0, 0.0, 0.0, -180.0, 180.0, 1.0),
    (-60.0, 0.0, 115.0, 0.0, -350.0, 350.0, 1.0),
];

fn robot(rows: &[Row]) -> Robot {
    let joints = rows
        .iter()
        .map(|r| Joint {
            kind: JointKind::Revolute,
            alpha: r.0.to_radians(),
            a: r.1 * 1e-3,
            beta: 0.0,
            d: r.2 * 1e-3,
            theta_offset: r.3.to_radians(),
            limits: [r.4.to_radians(), r.5.to_radians()],
            mass: Some(r.6),
            cog: Vector3::new(0.02, -0.01, 0.03),
        })
        .collect();
    Robot { joints, ..Robot::empty("test arm") }
}

fn cell() -> Cell {
    Cell {
        world_from_base: Pose {
            rotation: crate::pose::rotation_zyx(1.5, 0.02, -0.03),
            translation: Vector3::new(0.15, -0.33, -0.15),
        },
        tool: Tool {
            tcp: Vector3::new(0.018, -0.012, 0.118),
            rotation: crate::pose::rotation_zyx(0.2, 0.3, -0.4),
            targets: vec![Vector3::zeros()],
            mass: 1.7,
            cog: Vector3::new(0.005, -0.004, 0.055),
        },
        balls: vec![],
        anchors: vec![],
        geometry: None,
    }
}

fn nominal(rows: &[Row]) -> Forward {
    Forward::new(Model::nominal(robot(rows), cell()), vec![]).unwrap()
}

fn random_joints(robot: &Robot, rng: &mut StdRng, inside: f64) -> Joints {
    let mut q = [0.0; MAX_JOINTS];
    for (x, j) in q.iter_mut().zip(&robot.joints) {
        let middle = 0.5 * (j.limits[0] + j.limits[1]);
        *x = middle + (rng.random::<f64>() - 0.5) * inside * (j.limits[1] - j.limits[0]);
    }
    q
}

/// FK of every solution against the pose: the forward function is proved elsewhere, against automatic differentiation.
fn assert_reached(forward: &Forward, target: &Pose, state: &State, solutions: &[Solution]) {
    let mut ws = forward.workspace();
    for s in solutions {
        let pose = forward.world_from_tool(&State { q: s.joints, ..*state }, &mut ws);
        assert!((pose.translation - target.translation).norm() < 1e-10, "{s:?}");
        assert!((pose.rotation - target.rotation).amax() < 1e-10, "{s:?}");
        assert!(forward.model().robot.within_limits(&s.joints, 0.0), "{s:?}");
    }
}

fn recovers(rows: &[Row], count: usize, seed: u64) -> usize {
    let forward = nominal(rows);
    let mut ws = forward.workspace();
    let mut rng = StdRng::seed_from_u64(seed);
    let mut lost = 0;
    for _ in 0..count {
        let q = random_joints(&forward.model().robot, &mut rng, 1.0);
        let target = forward.world_from_tool(&State::at(&q), &mut ws);
        let state = State::at(&q);
        match inverse_kinematics(&forward, &target, &state, &mut ws) {
            Ok(solutions) => {
                assert_reached(&forward, &target, &state, &solutions);
                // near a singular arm joints are worse determined than the pose
                if farthest(6, &solutions[0].joints, &q) > 1e-5 {
                    lost += 1;
                }
            }
            Err(_) => lost += 1,
        }
    }
    lost
}

#[test]
fn finds_the_joints_that_it_started_from_on_an_irb_120() {
    assert_eq!(recovers(&IRB_120, 3000, 1), 0);
}

#[test]
fn finds_the_joints_that_it_started_from_on_a_ur10() {
    assert_eq!(recovers(&UR10, 600, 2), 0);
}

#[test]
fn finds_the_joints_that_it_started_from_with_a_shoulder_offset_and_with_skew_axes() {
    assert_eq!(recovers(&OFFSET, 2000, 3), 0);
    assert_eq!(recovers(&SKEW, 2000, 4), 0);
    assert_eq!(recovers(&HOLLOW, 2000, 10), 0);
}

/// Three slides and a wrist: no closed form is used, each pose is well within reach of the search.
fn gantry() -> Forward {
    let mut robot = robot(&[
        (0.0, 0.0, 100.0, 0.0, 0.0, 0.0, 1.0),
        (90.0, 0.0, 0.0, 90.0, 0.0, 0.0, 1.0),
        (90.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
        (90.0, 0.0, 200.0, 0.0, -170.0, 170.0, 1.0),
        (90.0, 0.0, 0.0, 0.0, -120.0, 120.0, 1.0),
        (-90.0, 0.0, 80.0, 0.0, -175.0, 175.0, 1.0),
    ]);
    for j in &mut robot.joints[..3] {
        j.kind = JointKind::Prismatic;
        j.limits = [-0.4, 0.4];
    }
    Forward::new(Model::nominal(robot, cell()), vec![]).unwrap()
}

#[test]
fn slides_are_solved_and_their_travel_is_respected() {
    let forward = gantry();
    let mut ws = forward.workspace();
    let mut rng = StdRng::seed_from_u64(11);
    for _ in 0..50 {
        let q = random_joints(&forward.model().robot, &mut rng, 0.9);
        let target = forward.world_from_tool(&State::at(&q), &mut ws);
        let state = State::at(&[0.0; 6]);
        let solutions = inverse_kinematics(&forward, &target, &state, &mut ws).unwrap();
        assert_reached(&forward, &target, &state, &solutions);
        assert!(solutions.iter().any(|s| farthest(6, &s.joints, &q) < 1e-6));
    }
    let far = forward.world_from_tool(&State::at(&[0.1, 0.1, 0.5, 0.2, 0.3, 0.4]), &mut ws);
    let e = inverse_kinematics(&forward, &far, &State::at(&[0.0; 6]), &mut ws).unwrap_err();
    assert!(matches!(e, IkError::OutOfTravel { joint: 3, value_m, .. } if (value_m - 0.5).abs() < 1e-9), "{e:?}");
    assert_eq!(e.to_string(), "joint 3 would have to be at 500.000 mm, and its limits are -400.000 to 400.000 mm");
}

/// Widens limits to one turn so that limits hide no branch.
fn unlimited(rows: &[Row; 6]) -> [Row; 6] {
    rows.map(|r| (r.0, r.1, r.2, r.3, -180.0, 180.0, r.6))
}

#[test]
fn an_irb_120_has_eight_distinct_branches_where_the_pose_is_well_within_reach() {
    let forward = nominal(&unlimited(&IRB_120));
    let mut ws = forward.workspace();
    let mut rng = StdRng::seed_from_u64(5);
    let mut counts = std::collections::BTreeMap::new();
    for _ in 0..500 {
        let q = random_joints(&forward.model().robot, &mut rng, 1.0);
        let target = forward.world_from_tool(&State::at(&q), &mut ws);
        let solutions = inverse_kinematics(&forward, &target, &State::at(&q), &mut ws).unwrap();
        for (i, a) in solutions.iter().enumerate() {
            for b in &solutions[..i] {
                assert!(!same(&forward.model().robot, &a.joints, &b.joints));
            }
        }
        *counts.entry(solutions.len()).or_insert(0) += 1;
    }
    // elbow x flip of the wrist always exist together; the shoulder turned back as well, but for a few poses on the border
    assert!(counts.get(&8).copied().unwrap_or(0) >= 495, "{counts:?}");
}

#[test]
fn a_ur10_has_eight_branches_or_fewer_in_pairs() {
    let forward = nominal(&unlimited(&UR10));
    let mut ws = forward.workspace();
    let mut rng = StdRng::seed_from_u64(6);
    let mut eight = 0;
    for _ in 0..300 {
        let q = random_joints(&forward.model().robot, &mut rng, 1.0);
        let target = forward.world_from_tool(&State::at(&q), &mut ws);
        let solutions = inverse_kinematics(&forward, &target, &State::at(&q), &mut ws).unwrap();
        assert!(solutions.len().is_multiple_of(2) && solutions.len() <= 8, "{}", solutions.len());
        eight += usize::from(solutions.len() == 8);
    }
    assert!(eight > 60, "{eight}");
}

#[test]
fn joint_6_of_the_irb_120_comes_in_all_turns_within_its_limits() {
    let forward = nominal(&IRB_120);
    let mut ws = forward.workspace();
    let q = [0.1, 0.2, -0.3, 0.4, 0.5, 30.0_f64.to_radians()];
    let target = forward.world_from_tool(&State::at(&q), &mut ws);
    let solutions = inverse_kinematics(&forward, &target, &State::at(&q), &mut ws).unwrap();
    let mut turns: Vec<f64> = solutions
        .iter()
        .filter(|s| farthest(5, &s.joints, &State::at(&q).q) < 1e-6)
        .map(|s| s.joints[5].to_degrees())
        .collect();
    turns.sort_by(f64::total_cmp);
    // 30 - 360 and 30 + 360 both lie within +-400 deg
    assert_eq!(turns.len(), 3);
    for (t, expected) in turns.iter().zip([-330.0, 30.0, 390.0]) {
        assert!((t - expected).abs() < 1e-8, "{turns:?}");
    }
}

fn calibrated(rows: &[Row], rng: &mut StdRng) -> Forward {
    let mut model = Model::nominal(robot(rows), cell());
    let mut add = |site, basis, value| {
        let name = format!("t{}", model.terms.len());
        let mut term = Term::new(name, "test", site, basis);
        term.value = value;
        model.terms.push(term);
    };
    let mut normal = || rng.random::<f64>() * 2.0 - 1.0;
    for link in 0..6 {
        add(Site::Link { link, parameter: Parameter::Alpha }, Basis::CONSTANT, normal() * 0.02);
        add(Site::Link { link, parameter: Parameter::A }, Basis::CONSTANT, normal() * 2e-3);
    }
    for joint in 1..=6 {
        add(Site::Link { link: joint, parameter: Parameter::Theta }, Basis::CONSTANT, normal() * 0.02);
        add(Site::Joint { joint }, Basis::torque(joint, Shape::Linear), normal() * 1e-3);
        add(Site::Joint { joint }, Basis::new(Variable::Joint { joint }, Shape::Sine { cycles: 2.0 }), normal() * 1e-3);
    }
    add(Site::Base(Motion::Along(Axis::X)), Basis::CONSTANT, 0.03);
    add(Site::Tool(Motion::Along(Axis::Z)), Basis::CONSTANT, -0.004);
    Forward::new(model, vec![]).unwrap()
}

#[test]
fn a_calibrated_arm_is_solved_to_rounding_on_every_branch() {
    let mut rng = StdRng::seed_from_u64(7);
    for rows in [&IRB_120, &OFFSET, &UR10] {
        for _ in 0..6 {
            let forward = calibrated(rows, &mut rng);
            let mut ws = forward.workspace();
            for _ in 0..60 {
                let q = random_joints(&forward.model().robot, &mut rng, 0.98);
                let state = State { dir: Some([1; MAX_JOINTS]), ..State::at(&q) };
                let target = forward.world_from_tool(&state, &mut ws);
                let solutions = inverse_kinematics(&forward, &target, &state, &mut ws).unwrap();
                assert_reached(&forward, &target, &state, &solutions);
                assert!(farthest(6, &solutions[0].joints, &q) < 1e-5);
            }
        }
    }
}

#[test]
fn many_starts_find_no_branch_that_the_nominal_arms_branches_do_not_lead_to() {
    let mut rng = StdRng::seed_from_u64(12);
    let (mut known, mut missed) = (0, 0);
    for k in 0..120 {
        let forward = calibrated(&unlimited(if k % 2 == 0 { &IRB_120 } else { &OFFSET }), &mut rng);
        let robot = &forward.model().robot;
        let mut ws = forward.workspace();
        let state = State::at(&random_joints(robot, &mut rng, 1.0));
        let target = forward.world_from_tool(&state, &mut ws);
        let solutions = inverse_kinematics(&forward, &target, &state, &mut ws).unwrap();
        known += solutions.len();
        let mut more: Vec<Joints> = Vec::new();
        for seed in search::starts(robot, &state.q, 200) {
            let mut at = State { q: seed, ..state };
            if newton::refine(&forward, &target, &mut at, &mut ws) == Ended::Converged
                && !solutions.iter().any(|s| same(robot, &s.joints, &at.q))
                && !more.iter().any(|m| same(robot, m, &at.q))
            {
                more.push(at.q);
            }
        }
        missed += more.len();
    }
    assert!(known > 700, "{known}");
    assert_eq!(missed, 0, "of {known}");
}

#[test]
fn a_stretched_arm_is_solved_and_a_hair_further_is_called_singular() {
    let forward = nominal(&IRB_120);
    let mut ws = forward.workspace();
    // the wrist in line with the upper arm: atan2(302, 70)
    let state = State::at(&[0.3, 0.6, -302.0_f64.atan2(70.0), 0.5, 0.6, 0.7]);
    let mut target = forward.world_from_tool(&state, &mut ws);
    let solutions = inverse_kinematics(&forward, &target, &state, &mut ws).unwrap();
    assert_reached(&forward, &target, &state, &solutions);
    let links = forward.world_from_links(&state, &mut ws);
    let out = (links[5].translation - links[2].translation).normalize();
    target.translation += out * 5e-7;
    let e = inverse_kinematics(&forward, &target, &state, &mut ws).unwrap_err();
    assert!(matches!(e, IkError::Singular { miss_m, .. } if (miss_m - 5e-7).abs() < 2e-7), "{e:?}");
    target.translation += out * 1e-3;
    let e = inverse_kinematics(&forward, &target, &state, &mut ws).unwrap_err();
    assert!(matches!(e, IkError::Unreachable { miss_m, .. } if (miss_m - 1e-3).abs() < 5e-4), "{e:?}");
}

#[test]
fn a_correction_stays_on_its_branch() {
    let mut rng = StdRng::seed_from_u64(8);
    let (nominal, real) = (nominal(&IRB_120), calibrated(&IRB_120, &mut rng));
    let (mut ws, mut real_ws) = (nominal.workspace(), real.workspace());
    let mut solved = 0;
    for _ in 0..300 {
        let q = random_joints(&nominal.model().robot, &mut rng, 0.9);
        // away from the straight wrist, where a small correction takes large turns, and from the stretched elbow, where the
        // 30 mm by which this arm stands elsewhere are out of reach
        if q[4].abs() < 0.3 || (q[2] + 1.343).abs() < 0.8 {
            continue;
        }
        let target = nominal.world_from_tool(&State::at(&q), &mut ws);
        let shoulder = nominal.world_from_links(&State::at(&q), &mut ws);
        let off_axis = shoulder[1].inverse().apply(&shoulder[5].translation);
        if off_axis.x.hypot(off_axis.y) < 0.15 {
            continue;
        }
        let fixed = nearest_solution(&real, &target, &State::at(&q), &mut real_ws).unwrap();
        let pose = real.world_from_tool(&State::at(&fixed), &mut real_ws);
        assert!((pose.translation - target.translation).norm() < 1e-10);
        assert!((pose.rotation - target.rotation).amax() < 1e-10);
        assert!(farthest(6, &fixed, &q) < 1.0, "{q:?} {fixed:?}");
        solved += 1;
    }
    assert!(solved > 80, "{solved}");
}

#[test]
fn a_pose_out_of_reach_says_so() {
    let forward = nominal(&IRB_120);
    let mut ws = forward.workspace();
    let mut target = forward.world_from_tool(&State::at(&[0.0; 6]), &mut ws);
    target.translation += Vector3::new(0.0, 3.0, 0.0);
    let e = inverse_kinematics(&forward, &target, &State::at(&[0.0; 6]), &mut ws).unwrap_err();
    assert!(matches!(e, IkError::Unreachable { miss_m, .. } if miss_m > 1.0), "{e:?}");
    assert!(e.to_string().starts_with("the pose is out of reach"), "{e}");
}

#[test]
fn a_pose_beyond_limits_names_joint_value_and_limits() {
    let mut rows = IRB_120;
    rows[0].4 = -10.0;
    rows[0].5 = 10.0;
    let forward = nominal(&rows);
    let free = nominal(&IRB_120);
    let mut ws = forward.workspace();
    let target = free.world_from_tool(&State::at(&[0.5, 0.1, 0.2, 0.3, 0.4, 0.5]), &mut ws);
    let e = inverse_kinematics(&forward, &target, &State::at(&[0.0; 6]), &mut ws).unwrap_err();
    match e {
        IkError::OutOfLimits { joint: 1, value_rad, upper_rad, .. } => {
            assert!((value_rad - 0.5).abs() < 1e-9);
            assert!((upper_rad - 10.0_f64.to_radians()).abs() < 1e-12);
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(e.to_string(), "joint 1 would have to be at 28.648 deg, and its limits are -10.000 to 10.000 deg");
}

#[test]
fn what_is_no_pose_is_refused() {
    let forward = nominal(&IRB_120);
    let mut ws = forward.workspace();
    let mut target = Pose::identity();
    target.translation.x = f64::NAN;
    assert_eq!(inverse_kinematics(&forward, &target, &State::at(&[0.0; 6]), &mut ws), Err(IkError::NotAPose));
    target = Pose { rotation: nalgebra::Matrix3::zeros(), translation: Vector3::zeros() };
    assert_eq!(inverse_kinematics(&forward, &target, &State::at(&[0.0; 6]), &mut ws), Err(IkError::NotAPose));
}

#[test]
fn a_straight_wrist_keeps_the_angle_it_has() {
    let forward = nominal(&IRB_120);
    let mut ws = forward.workspace();
    let q = [0.3, 0.2, 0.1, 0.7, 0.0, 0.4];
    let target = forward.world_from_tool(&State::at(&q), &mut ws);
    let solutions = inverse_kinematics(&forward, &target, &State::at(&q), &mut ws).unwrap();
    assert_reached(&forward, &target, &State::at(&q), &solutions);
    assert!((solutions[0].joints[3] - 0.7).abs() < 1e-6, "{:?}", solutions[0]);
}

#[test]
fn an_arm_without_a_closed_form_is_searched() {
    // 7 joints: an extra roll in the upper arm
    let mut rows = IRB_120.to_vec();
    rows.insert(2, (90.0, 0.0, 200.0, 0.0, -170.0, 170.0, 1.0));
    rows[3].0 = -90.0;
    let forward = nominal(&rows);
    let mut ws = forward.workspace();
    let mut rng = StdRng::seed_from_u64(9);
    for _ in 0..20 {
        let q = random_joints(&forward.model().robot, &mut rng, 0.9);
        let state = State::at(&[0.0; 7]);
        let target = forward.world_from_tool(&State::at(&q), &mut ws);
        let solutions = inverse_kinematics(&forward, &target, &state, &mut ws).unwrap();
        assert_reached(&forward, &target, &state, &solutions);
    }
}

proptest! {
    #[test]
    fn no_finite_pose_panics(
        t in prop::array::uniform3(-2.0..2.0_f64),
        r in prop::array::uniform3(-3.2..3.2_f64),
        ur in any::<bool>(),
    ) {
        let forward = nominal(if ur { &UR10 } else { &IRB_120 });
        let mut ws = forward.workspace();
        let target =
            Pose { rotation: crate::pose::rotation_zyx(r[0], r[1], r[2]), translation: Vector3::from(t) };
        let state = State::at(&[0.0; 6]);
        if let Ok(solutions) = inverse_kinematics(&forward, &target, &state, &mut ws) {
            assert_reached(&forward, &target, &state, &solutions);
        }
    }
}

#[test]
fn finds_what_the_general_way_finds() {
    let mut rng = StdRng::seed_from_u64(21);
    for rows in [IRB_120, OFFSET, unlimited(&IRB_120), unlimited(&OFFSET)] {
        let short = nominal(&rows);
        assert!(short.usual.is_some());
        let mut long = short.clone();
        long.usual = None;
        let robot = &short.model().robot;
        let mut ws = short.workspace();
        let mut own_way = 0;
        for _ in 0..400 {
            let state = State::at(&random_joints(robot, &mut rng, 1.0));
            let target = short.world_from_tool(&state, &mut ws);
            own_way +=
                usize::from(usual_solutions(short.usual.as_ref().unwrap(), &short, &target, &state, &mut ws).is_some());
            let a = inverse_kinematics(&short, &target, &state, &mut ws).unwrap();
            let b = inverse_kinematics(&long, &target, &state, &mut ws).unwrap();
            assert_eq!(a.len(), b.len());
            for (a, b) in a.iter().zip(&b) {
                // of two that are equally far the order is open
                let far = |s: &Solution| farthest(6, &s.joints, &state.q);
                assert!((far(a) - far(b)).abs() < 1e-6, "{a:?} {b:?}");
            }
            assert!(
                a.iter()
                    .all(|a| b.iter().any(|b| { a.joints.iter().zip(&b.joints).all(|(a, b)| (a - b).abs() < 1e-6) }))
            );
        }
        assert!(own_way > 390, "{own_way}");
    }
}

#[test]
fn other_arms_and_arms_with_terms_take_the_general_way() {
    assert!(nominal(&SKEW).usual.is_none() && nominal(&UR10).usual.is_none());
    let mut model = nominal(&IRB_120).into_model();
    model.terms.push(Term::new("a_2", "test", Site::Link { link: 2, parameter: Parameter::A }, Basis::CONSTANT));
    assert!(Forward::new(model, vec![]).unwrap().usual.is_none());
}

#[test]
fn an_arm_of_five_joints_comes_back_to_the_joints_of_a_pose_that_it_had() {
    let forward = nominal(&IRB_120[..5]);
    let (mut ws, mut rng) = (forward.workspace(), StdRng::seed_from_u64(5));
    for _ in 0..10 {
        let q = random_joints(&forward.model().robot, &mut rng, 0.6);
        let pose = forward.world_from_tool(&State::at(&q), &mut ws);
        let found = all_closest(&forward, &pose, &State::at(&q), &mut ws, |_| false).unwrap();
        let apart = |a: &Joints| a.iter().zip(&q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart(&found[0]) < 1e-6, "{found:?} {q:?}");
        let enough = all_closest(&forward, &pose, &State::at(&q), &mut ws, |_| true).unwrap();
        assert_eq!(enough.len(), 1);
    }
    let mut far = forward.world_from_tool(&State::at(&[0.0; 5]), &mut ws);
    far.translation.x += 9.0;
    assert!(all_closest(&forward, &far, &State::at(&[0.0; 5]), &mut ws, |_| true).is_err());
}
