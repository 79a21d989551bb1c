//! Identification on arms whose truth is known, and on the real recordings where they are present.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout, missing_docs)]

use std::path::{Path, PathBuf};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_ident::identifiability::independent_terms;
use trical_ident::{
    Choice, Dataset, ErrorSummary, JointSource, ModelFile, ParameterSet, cross_validate, diagnose, identify, load_csv,
    reject_gross_errors, write_csv,
};
use trical_model::{Basis, Cell, Forward, MAX_JOINTS, Measured, Model, Pose, Recording, Robot, Row, Site, State, Term};

const ROBOT: &str = include_str!("../../trical-model/tests/data/arm.toml");
const CELL: &str = include_str!("../../trical-model/tests/data/cell.toml");

fn nominal() -> Model {
    Model::nominal(Robot::parse(ROBOT, "arm.toml").unwrap(), Cell::parse(CELL, "cell.toml").unwrap())
}

fn rows(measured: impl Fn(usize) -> Measured, n: usize) -> Recording {
    let rows = (0..n)
        .map(|k| Row { state: State::at(&[0.0; MAX_JOINTS]), measured: measured(k), seq: None, line: k + 2 })
        .collect();
    Recording { name: "made".into(), joints: 6, rows, ..Recording::default() }
}

fn touches_of(n: usize) -> Dataset {
    let r = rows(|k| Measured::Touch { ball: k % 3, reading: [0.0; 3] }, n);
    Dataset::build(&[r], JointSource::Read, None).unwrap()
}

fn paper_terms(set: ParameterSet) -> Vec<Term> {
    independent_terms(&nominal(), &touches_of(3), &Choice::from(set)).unwrap().0
}

/// A true arm: every parameter of `set` off by chance.
fn truth(set: ParameterSet, seed: u64) -> Model {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut model = nominal();
    model.terms = paper_terms(set);
    for t in &mut model.terms {
        let size = match t.effect.as_str() {
            "compliance" => 2e-4,
            _ => 2e-3,
        };
        t.value = rng.random_range(-size..size);
        if t.effect == "compliance" {
            t.value = t.value.abs();
        }
    }
    model
}

/// Touches of the true arm: joints found so that the TCP is within a millimetre of a ball; the reading says how far.
fn touch(model: &Model, count: usize, noise: f64, seed: u64) -> Recording {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let normal = rand_distr::Normal::new(0.0, 1.0).unwrap();
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let (mut ws, mut rows, mut k) = (forward.workspace(), Vec::new(), 0);
    while rows.len() < count {
        k += 1;
        let ball = rows.len() % 3;
        let turn = trical_model::pose::rotation_z(rng.random_range(-3.0..3.0))
            * trical_model::pose::rotation_x(3.1 + rng.random_range(-0.9..0.9))
            * trical_model::pose::rotation_z(rng.random_range(-3.0..3.0));
        let off = nalgebra::Vector3::from_fn(|_, _| rng.random_range(-5e-4..5e-4));
        let at = Pose { rotation: turn, translation: model.cell.balls[ball] + off };
        let mut state = State::at(&[0.0; MAX_JOINTS]);
        state.dir = Some(std::array::from_fn(|_| if rng.random_range(0..2) == 0 { -1 } else { 1 }));
        state.t = Some(20.0 * f64::from(k));
        state.temp_c = Some(22.0 + rng.random_range(0.0..3.0));
        let Ok(all) = trical_model::ik::inverse_kinematics(&forward, &at, &state, &mut ws) else { continue };
        state.q = all[rng.random_range(0..all.len())].joints;
        // the touch says FK + R i = ball: i from the true pose
        let pose = forward.world_from_tool(&state, &mut ws);
        let i = pose.rotation.transpose() * (model.cell.balls[ball] - pose.translation);
        let reading = std::array::from_fn(|a| i[a] + noise * rand_distr::Distribution::sample(&normal, &mut rng));
        rows.push(Row { state, measured: Measured::Touch { ball, reading }, seq: None, line: rows.len() + 2 });
    }
    Recording { name: "touches".into(), joints: 6, rows, ..Recording::default() }
}

fn build(r: Recording) -> Dataset {
    Dataset::build(&[r], JointSource::Read, None).unwrap()
}

fn shared(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name);
    if !path.is_dir() {
        println!("skipped: {} is missing", path.display());
        return None;
    }
    Some(path)
}

#[test]
fn a_six_joint_arm_has_the_papers_31_parameters_and_one_more_geometric_one() {
    let names = |set| paper_terms(set).into_iter().map(|t| t.name).collect::<Vec<_>>();
    assert_eq!(names(ParameterSet::Geometry).len(), 26);
    let mut paper = names(ParameterSet::Compliance);
    let mut expected: Vec<String> = ["x", "y", "z", "rx", "ry", "rz"].iter().map(|m| format!("base_{m}")).collect();
    expected.extend(["tool_x", "tool_y", "tool_z"].map(String::from));
    for k in 1..=5 {
        expected.extend([format!("alpha_{k}"), format!("a_{k}")]);
    }
    expected.extend(["d_3", "d_4", "d_5", "theta_2", "theta_3", "theta_4", "theta_5"].map(String::from));
    expected.extend((2..=6).map(|k| format!("c_{k}")));
    paper.sort();
    expected.sort();
    assert_eq!(paper, expected);
    let complete = names(ParameterSet::Complete);
    assert_eq!(complete.len(), 32);
    assert!(complete.contains(&"beta_2".to_owned()));
}

#[test]
fn without_noise_the_31_parameters_come_back() {
    let truth = truth(ParameterSet::Compliance, 5);
    let data = build(touch(&truth, 45, 0.0, 6));
    let found = identify(&truth.robot, &truth.cell, &data, ParameterSet::Compliance).unwrap();
    assert_eq!(found.free.len(), 31);
    for t in &truth.terms {
        let f = found.model.terms.iter().find(|f| f.name == t.name).unwrap();
        assert!((f.value - t.value).abs() < 1e-9, "{}: {} instead of {}", t.name, f.value, t.value);
    }
}

#[test]
fn standard_deviations_say_how_far_parameters_are_off() {
    let truth = truth(ParameterSet::Compliance, 7);
    let (mut inside, mut all) = (0, 0);
    for seed in 0..40 {
        let data = build(touch(&truth, 60, 1e-5, 100 + seed));
        let found = identify(&truth.robot, &truth.cell, &data, ParameterSet::Compliance).unwrap();
        for t in &truth.terms {
            let f = found.model.terms.iter().find(|f| f.name == t.name).unwrap();
            all += 1;
            inside += u32::from((f.value - t.value).abs() < 1.96 * f.sd.unwrap());
        }
    }
    let share = f64::from(inside) / f64::from(all);
    assert!((0.92..0.975).contains(&share), "95 % intervals cover {share}");
}

#[test]
fn gross_errors_are_rejected_and_named() {
    let truth = truth(ParameterSet::Compliance, 8);
    let mut recording = touch(&truth, 60, 1e-5, 9);
    for k in [7, 33] {
        if let Measured::Touch { reading, .. } = &mut recording.rows[k].measured {
            reading[1] += 0.5e-3;
        }
    }
    let clean = reject_gross_errors(&truth.robot, &truth.cell, &build(recording)).unwrap();
    let lines: Vec<usize> = clean.rejected.iter().map(|r| r.line).collect();
    assert_eq!(lines, [9, 35]);
    assert!(clean.rejected.iter().all(|r| !r.reason.contains("wrong ball")));
}

#[test]
fn a_touch_of_another_ball_than_noted_is_called_so() {
    let truth = truth(ParameterSet::Compliance, 8);
    let mut recording = touch(&truth, 60, 1e-5, 9);
    let Measured::Touch { ball, .. } = &mut recording.rows[20].measured else { panic!("no touch") };
    let right = *ball;
    *ball = (right + 1) % 3;
    let clean = reject_gross_errors(&truth.robot, &truth.cell, &build(recording)).unwrap();
    let said: Vec<(usize, bool)> = clean
        .rejected
        .iter()
        .map(|r| (r.line, r.reason.contains(&format!("it fits ball {}: the wrong ball is noted", right + 1))))
        .collect();
    assert_eq!(said, [(22, true)]);
}

#[test]
fn a_model_file_predicts_what_the_model_did() {
    let truth = truth(ParameterSet::Complete, 10);
    let data = build(touch(&truth, 60, 1e-5, 11));
    let found = identify(&truth.robot, &truth.cell, &data, ParameterSet::Complete).unwrap();
    let file = ModelFile {
        model: found.model.clone(),
        joints: JointSource::Read,
        references: Vec::new(),
        recordings: vec!["touches".into()],
    };
    let again = ModelFile::parse(&file.to_toml().unwrap(), "m.toml").unwrap();
    let errors = |m: &Model| trical_ident::fit::position_errors(&Forward::new(m.clone(), Vec::new()).unwrap(), &data);
    for (a, b) in errors(&found.model).iter().zip(errors(&again.model)) {
        assert!((a - b).abs() < 1e-12);
    }
    let mut other = nominal().robot;
    other.joints[2].a += 1e-3;
    let refused = again.require_robot(&other, "m.toml").unwrap_err().to_string();
    assert!(refused.contains("joint 3"), "{refused}");
}

#[test]
fn recordings_survive_the_way_to_csv_and_back() {
    let recording = touch(&truth(ParameterSet::Compliance, 12), 20, 1e-5, 13);
    let mut text = Vec::new();
    write_csv(&recording, &mut text).unwrap();
    let again = trical_ident::parse_csv(&text, "r.csv", 6).unwrap();
    for (a, b) in recording.rows.iter().zip(&again.rows) {
        for k in 0..6 {
            assert!((a.state.q[k] - b.state.q[k]).abs() < 1e-13);
        }
        assert_eq!(a.state.dir.unwrap()[..6], b.state.dir.unwrap()[..6]);
        assert_eq!((a.state.t, a.state.temp_c), (b.state.t, b.state.temp_c));
        match (a.measured, b.measured) {
            (Measured::Touch { ball: x, reading: r }, Measured::Touch { ball: y, reading: s }) => {
                assert_eq!(x, y);
                assert!(r.iter().zip(&s).all(|(r, s)| (r - s).abs() < 1e-14));
            }
            _ => panic!("a touch became something else"),
        }
    }
}

/// The truth with one more term, which the baseline does not have.
fn with_effect(site: Site, basis: Basis, value: f64) -> Model {
    let mut model = truth(ParameterSet::Compliance, 20);
    let mut term = Term::new("hidden", "hidden", site, basis);
    term.value = value;
    model.terms.push(term);
    model
}

fn diagnosed(model: &Model, seed: u64) -> trical_ident::Diagnosis {
    let data = build(touch(model, 150, 8e-6, seed));
    diagnose(&model.robot, &model.cell, &data, false, &mut |_, _| ()).unwrap()
}

#[test]
fn hidden_backlash_is_found_at_its_joint() {
    let half_gap = 0.01_f64.to_radians();
    let d = diagnosed(&with_effect(Site::Joint { joint: 4 }, Basis::direction(4), -half_gap), 21);
    assert_eq!(d.findings.len(), 1, "{:?}", d.findings);
    let f = &d.findings[0];
    assert_eq!((f.effect.as_str(), &f.site), ("lost_motion_direction", &serde_json::json!({ "joint": 4 })));
    assert!((f.coefficients[0].value - 0.01).abs() < 5.0 * f.coefficients[0].sd.unwrap());
    assert!(f.evidence.holdout_rms_after_mm < 0.7 * f.evidence.holdout_rms_before_mm);
    assert!(f.evidence.forward_rms_after_mm < 0.7 * f.evidence.forward_rms_before_mm);
    assert!(d.unexplained.is_none());
}

#[test]
fn a_threshold_that_has_no_name_is_located_and_not_named() {
    let at = 0.3;
    let basis = Basis::new(trical_model::Variable::Joint { joint: 4 }, trical_model::Shape::Step { at });
    let d = diagnosed(&with_effect(Site::Joint { joint: 5 }, basis, 0.03_f64.to_radians()), 22);
    let u = d.unexplained.expect("something is left without a name");
    assert_eq!((u.site, u.variable.as_str()), (serde_json::json!({ "joint": 5 }), "q4"));
    assert!(d.findings.is_empty(), "{:?}", d.findings);
    assert!(u.holdout_rms_after_mm < 0.7 * u.holdout_rms_before_mm);
}

#[test]
fn where_nothing_is_hidden_nothing_is_named() {
    let mut alarms = 0;
    for seed in 0..20 {
        let d = diagnosed(&truth(ParameterSet::Compliance, 30 + seed), 60 + seed);
        alarms += u32::from(!d.findings.is_empty() || d.unexplained.is_some());
        assert!(d.baseline.lack_of_fit_p > 1e-4);
    }
    assert!(alarms <= 1, "{alarms} false alarms in 20");
}

#[test]
fn the_noise_of_nulled_readings_is_no_gain_error() {
    // the arm stands exactly on the ball, and the reading is nothing but noise
    let model = truth(ParameterSet::Compliance, 40);
    let mut recording = touch(&model, 150, 0.0, 41);
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let mut rng = Pcg64Mcg::seed_from_u64(42);
    let normal = rand_distr::Normal::new(0.0, 8e-6).unwrap();
    for row in &mut recording.rows {
        let Measured::Touch { ball, reading } = &mut row.measured else { continue };
        let pose = forward.world_from_tool(&row.state, &mut ws);
        let on = Pose { rotation: pose.rotation, translation: model.cell.balls[*ball] };
        row.state.q = trical_model::ik::continue_from(&forward, &on, &row.state, &mut ws).unwrap();
        *reading = std::array::from_fn(|_| rand_distr::Distribution::sample(&normal, &mut rng));
    }
    let d = diagnose(&model.robot, &model.cell, &build(recording), false, &mut |_, _| ()).unwrap();
    assert!(d.findings.is_empty(), "{:?}", d.findings);
    assert_eq!(d.baseline.reading_noise.len(), 1);
    assert!(d.blind_to.iter().any(|b| b.effect == "indicator_gain" && b.lacks.is_some()));
}

#[test]
fn the_real_irb_120_reads_as_in_the_literature() {
    let Some(dir) = shared("irb120") else { return };
    let robot = Robot::load(&dir.join("robot.toml")).unwrap();
    let cell = Cell::load(&dir.join("cell.toml")).unwrap();
    let recording = load_csv(&dir.join("tracker.csv"), robot.dof()).unwrap();
    let data = Dataset::build(&[recording], JointSource::Commanded, None).unwrap();
    let data = reject_gross_errors(&robot, &cell, &data).unwrap();
    assert_eq!(data.used_poses().len(), 765);
    let held_out = |set: ParameterSet| ErrorSummary::of(&cross_validate(&robot, &cell, &data, set, 4).unwrap());
    let nominal = held_out(ParameterSet::Nominal).mean_mm;
    assert!((nominal / 0.708 - 1.0).abs() < 0.03, "{nominal}");
    let geometry = held_out(ParameterSet::Geometry).mean_mm;
    assert!((geometry / 0.227 - 1.0).abs() < 0.03, "{geometry}");
    let compliance = held_out(ParameterSet::Compliance);
    assert!(compliance.mean_mm < 0.129 && compliance.rms_mm < 0.147 && compliance.max_mm < 0.70, "{compliance:?}");
    assert!(held_out(ParameterSet::Complete).mean_mm < 0.092);
}
