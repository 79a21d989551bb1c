//! How far joints give way where the robot has no masses, and what a fit does with directions in which the measurements say little.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_ident::{
    Aim, Calibration, Dataset, JointSource, ModelFile, Options, ParameterSet, Scatter, calibrate, simulate,
    torque_loads, validate,
};
use trical_model::{Basis, Forward, Measured, Model, Pose, Recording, Row, Shape, Site, State, Task, Term, Variable};

/// An arm without masses, seen by a tracker: every parameter of its geometry off by chance.
fn without_masses(seed: u64) -> Model {
    let mut model = crate::arm::truth(ParameterSet::Geometry, seed);
    model.robot.joints.iter_mut().for_each(|j| j.mass = None);
    model.cell.tool.targets = vec![nalgebra::Vector3::new(0.04, -0.02, 0.12)];
    model.frames = vec![Pose::identity()];
    model
}

/// What a tracker saw of it at `poses`, to `noise` (m); joint torques are drawn, and recorded where `torques`.
fn seen(truth: &Model, poses: usize, noise: f64, seed: u64, torques: bool, stroke: [f64; 6]) -> Recording {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let rows: Vec<(State, Aim)> = (0..poses)
        .map(|_| {
            let q: Vec<f64> = stroke.iter().map(|s| rng.random_range(-*s..*s)).collect();
            let mut state = State::at(&q);
            if torques {
                state.torques = Some(std::array::from_fn(|k| if k < 6 { rng.random_range(-30.0..30.0) } else { 0.0 }));
            }
            (state, Aim::Target(0))
        })
        .collect();
    let scatter = Scatter { length: noise, angle: 0.0, seed };
    Recording { name: "r.csv".into(), ..simulate(truth, &rows, &scatter, None).unwrap() }
}

fn calibrated(truth: &Model, recording: Recording) -> Calibration {
    calibrate(&truth.robot, &truth.cell, &[recording], &Options::new(ParameterSet::Complete), &Task::silent()).unwrap()
}

fn value(c: &Calibration, name: &str) -> Option<f64> {
    c.fitted.model.terms.iter().find(|t| t.name == name).map(|t| t.value)
}

const WIDE: [f64; 6] = [1.5; 6];

#[test]
fn compliance_is_found_by_the_torques_that_were_measured_without_masses() {
    let mut truth = without_masses(3);
    for (joint, c) in [(2, 7.2e-5), (3, 9.0e-5), (5, 2.0e-4)] {
        let mut t = Term::new(format!("c_{joint}"), "compliance", Site::Joint { joint }, Basis::measured_torque(joint));
        t.value = c;
        truth.terms.push(t);
    }
    let c = calibrated(&truth, seen(&truth, 120, 1e-6, 4, true, WIDE));
    for (name, expected) in [("c_2", 7.2e-5), ("c_3", 9.0e-5), ("c_5", 2.0e-4)] {
        let found = value(&c, name).unwrap();
        assert!((found - expected).abs() < 1e-2 * expected, "{name}: {found}");
    }
    assert!(value(&c, "c_1").unwrap().abs() < 1e-6);
    assert!(!c.cautions().iter().any(|c| c.contains("no masses")), "{:?}", c.cautions());
    // a joint that stays where it is says nothing of how soft it is elsewhere
    let mut resting = WIDE;
    resting[4] = 1e-6;
    let c = calibrated(&truth, seen(&truth, 120, 1e-6, 4, true, resting));
    assert!(value(&c, "c_5").is_none() && c.fitted.held().contains(&"c_5"), "{:?}", c.fitted.held());
    assert!(value(&c, "c_2").is_some());
}

#[test]
fn a_torque_column_that_no_sensor_wrote_gives_way_to_masses_and_what_is_left_out_is_told() {
    let mut truth = without_masses(3);
    let nominal = crate::arm::truth(ParameterSet::Geometry, 3).robot;
    truth.robot.joints.iter_mut().zip(&nominal.joints).for_each(|(j, known)| j.mass = known.mass);
    for (joint, basis) in [(2, Basis::measured_torque(2)), (3, Basis::torque(3, Shape::Linear))] {
        let term = Term::new(format!("c_{joint}"), "compliance", Site::Joint { joint }, basis);
        truth.terms.push(Term { value: 9.0e-5, ..term });
    }
    let recording = seen(&truth, 120, 1e-6, 4, true, WIDE);
    let with = |change: &dyn Fn(usize, &mut State)| {
        let mut recording = recording.clone();
        recording.rows.iter_mut().enumerate().for_each(|(k, row)| change(k, &mut row.state));
        recording
    };
    let said = |c: &Calibration, part: &str| assert!(c.cautions().join("\n").contains(part), "{:?}", c.cautions());
    let only_two =
        with(&|_, s| s.torques = s.torques.map(|t| std::array::from_fn(|k| if k == 1 { t[1] } else { 0.0 })));
    let c = calibrated(&truth, only_two.clone());
    assert!(["c_2", "c_3"].iter().all(|n| (value(&c, n).unwrap() - 9.0e-5).abs() < 1e-6), "{:?}", c.fitted.model.terms);
    said(&c, "the torques of joints 1, 3, 4, 5 and 6 are the same in all measurements");
    // of all zeros, and where one row has none, the masses count
    let c = calibrated(&truth, with(&|_, s| s.torques = Some([0.0; 9])));
    assert_eq!(c.elasticity, trical_ident::Elasticity::Masses);
    let c = calibrated(&truth, with(&|k, s| s.torques = s.torques.filter(|_| k != 7)));
    assert_eq!(c.elasticity, trical_ident::Elasticity::Masses);
    said(&c, "1 of 120 measurements have no joint torques");
    // a joint that was named needs its own sensor, or masses
    truth.robot.joints.iter_mut().for_each(|j| j.mass = None);
    let choice = |joints: &[usize]| trical_ident::Choice::new(ParameterSet::Complete, joints, 6).unwrap();
    let named = |joints| {
        let options = Options { choice: choice(joints), ..Options::new(ParameterSet::Complete) };
        calibrate(&truth.robot, &truth.cell, std::slice::from_ref(&only_two), &options, &Task::silent())
    };
    assert!(named(&[2]).is_ok() && named(&[2, 3]).is_err_and(|e| e.to_string().contains("mass")));
    let c = calibrated(&truth, with(&|k, s| (s.torques, s.payload_kg) = (None, Some([0.0, 3.0][k % 2]))));
    said(&c, "payload_kg changes, but without masses");
}

#[test]
fn another_load_on_the_flange_is_taken_from_the_cell_file_of_the_recording() {
    let mut truth = crate::arm::truth(ParameterSet::Complete, 3);
    truth.frames = vec![Pose::identity()];
    let file = ModelFile::of_fit(&calibrated(&truth, seen(&truth, 120, 1e-6, 4, false, WIDE)).fitted);
    let mut heavy = truth.clone();
    heavy.cell.tool.mass += 3.0;
    heavy.cell.tool.cog += nalgebra::Vector3::new(0.02, 0.0, 0.05);
    let recording = seen(&heavy, 60, 1e-6, 5, false, WIDE);
    let scored = |cell| validate(&truth.robot, cell, &file, std::slice::from_ref(&recording), None, None).unwrap();
    let (told, untold) = (scored(&heavy.cell), scored(&truth.cell));
    assert!(told.after.max_mm < 0.01 && untold.after.mean_mm > 0.1, "{:?} {:?}", told.after, untold.after);
    let said = told.left_out_in_words(str::to_owned).join(" ");
    assert!(said.contains("the cell file's load was used") && untold.other_load_kg.is_none(), "{said}");
}

#[test]
fn without_masses_and_torques_an_arm_that_sags_is_described_by_its_inclination_and_a_rigid_one_is_not() {
    let rigid = without_masses(5);
    let c = calibrated(&rigid, seen(&rigid, 120, 1e-5, 6, false, WIDE));
    assert!(c.fitted.model.terms.iter().all(|t| !t.name.starts_with("sag")), "{:?}", c.fitted.model.terms);
    let mut truth = rigid;
    let mut sag = |joint, last, shape, size| {
        let basis = Basis::new(Variable::Inclination { first: 2, last }, shape);
        let mut t = Term::new(format!("true_{joint}_{last}_{shape:?}"), "compliance", Site::Joint { joint }, basis);
        t.value = size;
        truth.terms.push(t);
    };
    sag(2, 2, Shape::Sine { cycles: 1.0 }, 6e-4);
    sag(2, 3, Shape::Cosine { cycles: 1.0 }, 4e-4);
    sag(3, 3, Shape::Cosine { cycles: 1.0 }, 5e-4);
    let c = calibrated(&truth, seen(&truth, 120, 1e-5, 6, false, WIDE));
    for (name, expected) in [("sag_2_sin_2", 6e-4), ("sag_2_cos_3", 4e-4), ("sag_3_cos_3", 5e-4)] {
        let term = c.fitted.model.terms.iter().find(|t| t.name == name).unwrap();
        let (value, sd) = (term.value, term.sd.unwrap());
        assert!(sd < 1e-4 && (value - expected).abs() < 4.0 * sd, "{name}: {value} +- {sd}");
    }
    let said = c.cautions().join("\n");
    assert!(said.contains("joints 2 and 3 give way to gravity"), "{said}");
    // a few measurements carry no further terms
    let few = calibrated(&truth, seen(&truth, 30, 1e-5, 6, false, WIDE));
    assert!(few.fitted.model.terms.iter().all(|t| !t.name.starts_with("sag")), "{:?}", few.fitted.model.terms);
    assert!(c.held_out.by_block.unwrap().mean_mm < 0.03, "{:?}", c.held_out);
}

#[test]
fn directions_of_which_the_measurements_say_little_stay_near_nominal_and_are_named() {
    let truth = without_masses(7);
    // joint 5 over three degrees: what its axis does is below the noise
    let c = calibrated(&truth, seen(&truth, 60, 2e-4, 8, false, [1.5, 1.0, 1.0, 1.5, 0.026, 1.5]));
    let weak = c.fitted.kept_near_nominal();
    assert!(!weak.is_empty() && c.cautions().iter().any(|c| c.contains("kept near nominal")), "{:?}", c.cautions());
    for t in c.fitted.model.terms.iter().filter(|t| t.effect == "geometry") {
        assert!(t.value.abs() < 1e-2, "{} {}", t.name, t.value);
    }
    assert!(c.held_out.by_block.unwrap().mean_mm < 0.8, "{:?}", c.held_out);
    // where all joints move, none is held and none kept
    let c = calibrated(&truth, seen(&truth, 120, 1e-5, 9, false, WIDE));
    assert!(c.fitted.weak.is_empty() && c.fitted.held().is_empty());
}

#[test]
fn the_scale_and_the_bends_of_a_rail_are_found_where_it_has_them_and_not_where_it_has_none() {
    let mut rigid = without_masses(13);
    rigid.terms.clear();
    let mut rail = rigid.robot.joints[0].clone();
    rail.kind = trical_model::JointKind::Prismatic;
    (rail.alpha, rail.a, rail.d, rail.theta_offset) = (-std::f64::consts::FRAC_PI_2, 0.0, 0.0, 0.0);
    rail.limits = [0.0, 6.0];
    rigid.robot.joints[0].alpha += std::f64::consts::FRAC_PI_2;
    rigid.robot.joints.insert(0, rail);
    assert!(rigid.robot.is_on_rail());
    let names = |c: &Calibration| -> Vec<String> {
        c.fitted.model.terms.iter().filter(|t| t.name.starts_with("rail")).map(|t| t.name.clone()).collect()
    };
    let on_rail = |truth: &Model| {
        let mut rng = Pcg64Mcg::seed_from_u64(14);
        let rows: Vec<(State, Aim)> = (0..120)
            .map(|_| {
                let q: Vec<f64> = (0..7)
                    .map(|k| if k == 0 { rng.random_range(0.5..5.5) } else { rng.random_range(-1.5..1.5) })
                    .collect();
                (State::at(&q), Aim::Target(0))
            })
            .collect();
        let scatter = Scatter { length: 2e-5, angle: 0.0, seed: 15 };
        calibrated(truth, Recording { name: "r.csv".into(), ..simulate(truth, &rows, &scatter, None).unwrap() })
    };
    assert_eq!(names(&on_rail(&rigid)), Vec::<String>::new());
    let mut truth = rigid;
    let along = Basis::new(Variable::Joint { joint: 1 }, Shape::Linear);
    for (name, site, value) in
        [("scale", Site::Joint { joint: 1 }, 1e-4), ("yaw", Site::Tilt { joint: 1, axis: trical_model::Axis::X }, 1e-4)]
    {
        truth.terms.push(Term { value, ..Term::new(name, "geometry", site, along) });
    }
    let c = on_rail(&truth);
    assert_eq!(names(&c), ["rail_scale", "rail_turn_x", "rail_turn_y", "rail_turn_z"]);
    assert!((value(&c, "rail_scale").unwrap() - 1e-4).abs() < 1e-5);
    // from one end of what was used to the other
    assert!((value(&c, "rail_turn_x").unwrap() - 5e-4).abs() < 5e-5);
    assert!(c.held_out.by_block.unwrap().mean_mm < 0.06, "{:?}", c.held_out);
}

#[test]
fn weak_priors_do_not_make_a_model_of_another_arm() {
    // joints that have nothing to do with where the tool was seen
    let truth = without_masses(17);
    let mut recording = seen(&truth, 60, 1e-5, 18, false, [1.5, 1.0, 1.0, 1.5, 0.02, 1.5]);
    let turned: Vec<_> = recording.rows.iter().map(|r| r.state.q).rev().collect();
    for (row, q) in recording.rows.iter_mut().zip(turned) {
        row.state.q = q;
    }
    let options = Options { keep_outliers: true, ..Options::new(ParameterSet::Complete) };
    if let Ok(c) = calibrate(&truth.robot, &truth.cell, &[recording], &options, &Task::silent()) {
        // what converges by itself is said to be as bad as it is, beside its cautions
        assert!(c.errors.mean_mm > 50.0 && !c.cautions().is_empty(), "{:?} {:?}", c.errors, c.cautions());
    }
}

/// Poses with the torques that hold the arm, to 0.05 N m, with zeros of the sensors of some tenths; no other measurement matters.
fn weighed(arm: &Model, poses: usize, seed: u64) -> Recording {
    let forward = Forward::new(arm.clone(), Vec::new()).unwrap();
    let (mut ws, mut rng) = (forward.workspace(), Pcg64Mcg::seed_from_u64(seed));
    let row = |k: usize| {
        let q: Vec<f64> = WIDE.iter().map(|s| rng.random_range(-*s..*s)).collect();
        let mut state = State::at(&q);
        let gravity = forward.gravity_torques(&state, &mut ws).unwrap();
        state.torques = Some(std::array::from_fn(|j| {
            if j < 6 { -gravity[j] + 0.1 * (j as f64 - 2.0) + rng.random_range(-0.087..0.087) } else { 0.0 }
        }));
        Row { state, measured: Measured::Touch { ball: 0, reading: [0.0; 3] }, seq: None, line: k + 2 }
    };
    Recording { name: format!("{seed}.csv"), joints: 6, rows: (0..poses).map(row).collect(), ..Recording::default() }
}

#[test]
fn a_load_on_the_flange_is_found_by_measured_torques_without_masses() {
    let arm = crate::arm::truth(ParameterSet::Geometry, 5);
    let mut loaded = arm.clone();
    let cog = nalgebra::Vector3::new(0.02, -0.03, 0.09);
    loaded.cell.tool.cog = (arm.cell.tool.cog * arm.cell.tool.mass + cog * 2.5) / (arm.cell.tool.mass + 2.5);
    loaded.cell.tool.mass = arm.cell.tool.mass + 2.5;
    let recordings = [weighed(&arm, 120, 1), weighed(&loaded, 90, 2), weighed(&arm, 90, 3)];
    let data = Dataset::build(&recordings, JointSource::Read, None).unwrap();
    let mut bare = arm.robot.clone();
    bare.joints.iter_mut().for_each(|j| j.mass = None);
    let loads = torque_loads(&bare, &arm.cell, &data).unwrap();
    assert_eq!(loads.len(), 2);
    let (more, same) = (&loads[0], &loads[1]);
    assert!((more.mass_kg - 2.5).abs() < (3.0 * more.sd_kg).min(0.1), "{more:?}");
    let found = more.cog_mm.unwrap();
    assert!((0..3).all(|k| (found[k] - 1e3 * cog[k]).abs() < 5.0), "{found:?}");
    assert!(
        more.in_words().starts_with("By the measured torques 2.csv has 2.") && more.in_words().contains("more on the")
    );
    assert!(same.in_words().starts_with("By the measured torques 3.csv has the load of 1.csv, within"), "{same:?}");
    // without torques, and for one session, nothing is said
    let one = Dataset::build(&recordings[..1], JointSource::Read, None).unwrap();
    assert!(torque_loads(&bare, &arm.cell, &one).unwrap().is_empty());
}
