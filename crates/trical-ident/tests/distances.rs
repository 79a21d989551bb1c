//! Lengths from anchors, and full poses of arms with slides: nothing but the arm's nominal table is known beforehand.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;
use trical_ident::fit::trilateration::{Length, trilaterate};
use trical_ident::{Dataset, ErrorSummary, JointSource, ParameterSet, identify, parse_csv};
use trical_model::pose::{quaternion_from_rotation, rotation_zyx};
use trical_model::{Cell, Forward, Measured, Model, Pose, Recording, Robot, Row, State};

const ROBOT: &str = include_str!("../../trical-model/tests/data/arm.toml");

fn robot() -> Robot {
    Robot::parse(ROBOT, "arm.toml").unwrap()
}

/// The true cell: three anchors in {w}, and an arm that stands turned in it.
fn cell(anchors: usize) -> Cell {
    let mut cell = Cell::bare();
    cell.world_from_base = Pose { rotation: rotation_zyx(0.7, 0.02, -0.03), translation: Vector3::new(0.4, -0.3, 0.1) };
    cell.tool.tcp = Vector3::new(0.04, -0.03, 0.15);
    cell.tool.mass = 1.0;
    let all = [Vector3::new(1.2, 0.1, 0.2), Vector3::new(-0.3, 1.1, 0.4), Vector3::new(0.5, -1.2, 1.0)];
    cell.anchors = all[..anchors].to_vec();
    cell
}

/// What is said of the cell beforehand: nothing but the anchors is right.
fn guess(anchors: usize) -> Cell {
    let mut cell = cell(anchors);
    cell.world_from_base = Pose::identity();
    cell.tool.tcp = Vector3::zeros();
    cell
}

fn joints(rng: &mut Pcg64Mcg, robot: &Robot) -> Vec<f64> {
    robot.joints.iter().map(|j| rng.random_range(0.6 * j.limits[0].max(-3.0)..0.6 * j.limits[1].min(3.0))).collect()
}

fn lengths(model: &Model, count: usize, noise: f64, seed: u64) -> Recording {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let normal = Normal::new(0.0, 1.0).unwrap();
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let rows = (0..count)
        .map(|k| {
            let state = State::at(&joints(&mut rng, &model.robot));
            let anchor = k % model.cell.anchors.len();
            let tool = forward.world_from_tool(&state, &mut ws).translation;
            let length = (tool - model.cell.anchors[anchor]).norm() + noise * normal.sample(&mut rng);
            Row { state, measured: Measured::Distance { anchor, length }, seq: None, line: k + 2 }
        })
        .collect();
    Recording { name: "wire.csv".into(), joints: model.robot.dof(), rows, ..Recording::default() }
}

/// A true arm: every link off by up to a millimetre and 2 mrad.
fn off_nominal(mut model: Model, seed: u64) -> Model {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    for j in &mut model.robot.joints {
        j.a += rng.random_range(-1e-3..1e-3);
        j.d += rng.random_range(-1e-3..1e-3);
        j.alpha += rng.random_range(-2e-3..2e-3);
        j.theta_offset += rng.random_range(-2e-3..2e-3);
    }
    model
}

fn seen(robot: &Robot, recording: &Recording) -> Vec<Length> {
    let forward = Forward::new(Model::nominal(robot.clone(), Cell::bare()), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let one = |r: &Row| match r.measured {
        Measured::Distance { anchor, length } => {
            Length { base_from_flange: forward.world_from_flange(&r.state, &mut ws), anchor, length }
        }
        _ => panic!("no length"),
    };
    recording.rows.iter().map(one).collect()
}

#[test]
fn anchors_and_tool_point_come_from_exact_lengths_without_a_guess() {
    for anchors in 1..=3 {
        let truth = Model::nominal(robot(), cell(anchors));
        let recording = lengths(&truth, 25 * anchors, 0.0, 1);
        let found = trilaterate(&seen(&robot(), &recording), &Vector3::new(9.0, 9.0, 9.0)).unwrap();
        assert!((found.tcp_in_flange - truth.cell.tool.tcp).amax() < 1e-9, "{}", found.tcp_in_flange);
        let base_from_world = truth.cell.world_from_base.inverse();
        for (a, found) in truth.cell.anchors.iter().zip(&found.anchor_in_base) {
            assert!((base_from_world.apply(a) - found.unwrap()).amax() < 1e-9);
        }
        assert!(found.rms < 1e-10);
    }
}

#[test]
fn with_few_lengths_the_tool_point_of_the_cell_is_believed() {
    let truth = Model::nominal(robot(), cell(1));
    let recording = lengths(&truth, 8, 0.0, 2);
    let found = trilaterate(&seen(&robot(), &recording), &truth.cell.tool.tcp).unwrap();
    let expected = truth.cell.world_from_base.inverse().apply(&truth.cell.anchors[0]);
    assert!((found.anchor_in_base[0].unwrap() - expected).amax() < 1e-9);
    assert!(trilaterate(&seen(&robot(), &recording)[..3], &truth.cell.tool.tcp).is_none());
}

#[test]
fn an_arm_is_identified_from_lengths_whatever_the_cell_says() {
    for anchors in [1, 2, 3] {
        let truth = off_nominal(Model::nominal(robot(), cell(anchors)), 3);
        let data = Dataset::build(&[lengths(&truth, 240, 1e-5, 4)], JointSource::Read, None).unwrap();
        let found = identify(&robot(), &guess(anchors), &data, ParameterSet::Complete).unwrap();
        // 27 where all of the base can be told; one anchor leaves it free to turn in three ways, two in one
        let geometry = found.model.terms.iter().filter(|t| t.effect != "compliance").count();
        assert_eq!(geometry, [24, 26, 27][anchors - 1]);
        let errors = ErrorSummary::of(&found.errors().unwrap());
        assert!((0.007..0.012).contains(&errors.rms_mm), "{anchors} anchors: {errors:?}");
        // and on lengths that it has not seen
        let other = Dataset::build(&[lengths(&truth, 200, 0.0, 5)], JointSource::Read, None).unwrap();
        let forward = Forward::new(found.model, Vec::new()).unwrap();
        let e = ErrorSummary::of(&trical_ident::fit::residuals::position_errors(&forward, &other));
        assert!(e.rms_mm < 0.01, "{anchors} anchors: {e:?}");
        let nominal = identify(&robot(), &guess(anchors), &data, ParameterSet::Nominal).unwrap();
        assert!(ErrorSummary::of(&nominal.errors().unwrap()).rms_mm > 0.3);
    }
}

#[test]
fn lengths_that_count_from_anywhere_have_their_zeros_identified() {
    let truth = off_nominal(Model::nominal(robot(), cell(3)), 3);
    let mut recording = lengths(&truth, 240, 1e-5, 4);
    let zeros = [5e-3, 0.0, -2e-3];
    for row in &mut recording.rows {
        if let Measured::Distance { anchor, length } = &mut row.measured {
            *length += zeros[*anchor];
        }
    }
    let data = Dataset::build(&[recording], JointSource::Read, None).unwrap();
    let found = identify(&robot(), &guess(3), &data, ParameterSet::Complete).unwrap();
    let errors = ErrorSummary::of(&found.errors().unwrap());
    assert!((0.007..0.012).contains(&errors.rms_mm), "{errors:?}");
    for (k, zero) in zeros.iter().enumerate() {
        let term = found.model.terms.iter().find(|t| t.name == format!("zero_{}", k + 1)).unwrap();
        assert!((term.value - zero).abs() < 1e-4, "{}: {}", term.name, term.value);
    }
}

#[test]
fn a_csv_of_lengths_says_the_same() {
    let truth = Model::nominal(robot(), cell(1));
    let recording = lengths(&truth, 60, 0.0, 6);
    let mut text = Vec::new();
    trical_ident::write_csv(&recording, &mut text).unwrap();
    let again = parse_csv(&text, "wire.csv", 6).unwrap();
    let data = Dataset::build(&[again], JointSource::Read, None).unwrap();
    let found = identify(&robot(), &guess(1), &data, ParameterSet::Nominal).unwrap();
    assert!(ErrorSummary::of(&found.errors().unwrap()).max_mm < 1e-6);
}

const SCARA: &str = "name = 'scara'
[[joint]]
alpha_deg = 0.0
a_mm = 0.0
d_mm = 300.0
theta_offset_deg = 0.0
limits_deg = [-150.0, 150.0]
mass_kg = 5.0
cog_mm = [100.0, 0.0, 0.0]
[[joint]]
alpha_deg = 0.0
a_mm = 250.0
d_mm = 50.0
theta_offset_deg = 0.0
limits_deg = [-150.0, 150.0]
mass_kg = 3.0
cog_mm = [100.0, 0.0, 0.0]
[[joint]]
kind = 'prismatic'
alpha_deg = 180.0
a_mm = 200.0
d_mm = 0.0
theta_offset_deg = 0.0
limits_mm = [0.0, 200.0]
mass_kg = 1.0
cog_mm = [0.0, 0.0, 0.0]
[[joint]]
alpha_deg = 0.0
a_mm = 0.0
d_mm = 50.0
theta_offset_deg = 0.0
limits_deg = [-170.0, 170.0]
mass_kg = 0.5
cog_mm = [10.0, 0.0, 0.0]
";

#[test]
fn a_scara_is_identified_from_full_poses_and_predicts_poses_that_it_has_not_seen() {
    let nominal = Robot::parse(SCARA, "scara.toml").unwrap();
    let mut cell = cell(0);
    cell.tool.rotation = rotation_zyx(0.3, -0.2, 0.1);
    let mut truth = off_nominal(Model::nominal(nominal.clone(), cell), 7);
    // an arm whose parallel axes are not quite parallel: that is what beta is for
    truth.robot.joints[1].beta = 1e-3;
    truth.robot.joints[2].beta = -2e-3;
    truth.robot.joints[3].beta = 1.5e-3;
    let instrument = Pose { rotation: rotation_zyx(2.0, -0.4, 0.6), translation: Vector3::new(3.0, -2.0, 1.0) };
    let record = |count: usize, seed: u64| {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let forward = Forward::new(truth.clone(), Vec::new()).unwrap();
        let mut ws = forward.workspace();
        let rows = (0..count)
            .map(|k| {
                let state = State::at(&joints(&mut rng, &nominal));
                let p = instrument.compose(&forward.world_from_tool(&state, &mut ws));
                let measured = Measured::Pose {
                    position: p.translation.into(),
                    quaternion: quaternion_from_rotation(&p.rotation),
                };
                Row { state, measured, seq: None, line: k + 2 }
            })
            .collect();
        Recording { name: "poses.csv".into(), joints: 4, rows, ..Recording::default() }
    };
    let data = Dataset::build(&[record(80, 8)], JointSource::Read, None).unwrap();
    let found = identify(&nominal, &Cell::bare(), &data, ParameterSet::Complete).unwrap();
    assert!(found.model.terms.iter().filter(|t| t.effect != "compliance").count() == 4 * 3 + 2 + 6);
    let other = Dataset::build(&[record(50, 9)], JointSource::Read, None).unwrap();
    let forward = Forward::new(found.model, Vec::new()).unwrap();
    let worst = trical_ident::fit::residuals::position_errors(&forward, &other).into_iter().fold(0.0, f64::max);
    assert!(worst < 1e-9, "{worst}");
}

#[test]
fn slides_are_read_in_millimetres() {
    let text = "q1_deg,q2_deg,q3_mm,q4_deg,x_mm,y_mm,z_mm\n90,0,120.5,-90,1,2,3\n";
    let r = parse_csv(text.as_bytes(), "r.csv", 4).unwrap();
    let q = r.rows[0].state.q;
    assert!((q[0] - std::f64::consts::FRAC_PI_2).abs() < 1e-15 && (q[2] - 0.1205).abs() < 1e-15);
    let both = text.replace("q1_deg", "q3_deg,q1_deg").replace("\n90", "\n0,90");
    assert!(parse_csv(both.as_bytes(), "r.csv", 4).unwrap_err().to_string().contains("q3_deg and q3_mm"));
    let none = text.replace("q3_mm,", "").replace("120.5,", "");
    assert!(parse_csv(none.as_bytes(), "r.csv", 4).unwrap_err().to_string().contains("q3_deg is missing"));
}
