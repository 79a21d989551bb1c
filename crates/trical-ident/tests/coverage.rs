//! Intervals that say 95 % cover 95 %: of parameters, and of predictions where nothing was measured.

use rand::{RngExt, SeedableRng};
use rand_distr::Distribution;
use rand_pcg::Pcg64Mcg;
use trical_ident::fit::identifiability::independent_terms;
use trical_ident::model_file::Uncertainty;
use trical_ident::{Choice, Dataset, Expected, Identified, JointSource, ModelFile, ParameterSet, identify};
use trical_model::{Cell, Forward, MAX_JOINTS, Measured, Model, Pose, Recording, Robot, Row, State};

const ROBOT: &str = include_str!("../../trical-model/tests/data/arm.toml");
const CELL: &str = include_str!("../../trical-model/tests/data/cell.toml");
const NOISE: f64 = 1e-5;

fn build(rows: Vec<Row>) -> Dataset {
    let recording = Recording { name: "made".into(), joints: 6, rows, ..Recording::default() };
    Dataset::build(&[recording], JointSource::Read, None).unwrap()
}

fn random_joints(model: &Model, rng: &mut Pcg64Mcg) -> State {
    let q: Vec<f64> = model.robot.joints.iter().map(|j| rng.random_range(j.limits[0]..j.limits[1])).collect();
    State::at(&q)
}

/// 45 touches of an arm with other parameters in each run.
fn one_run(seed: u64) -> (Model, Dataset) {
    touched(seed, 45, 0.0)
}

/// Touches of an arm with other parameters in each run, whose encoders are off by a curve of their own (rad, each of three harmonics).
fn touched(seed: u64, count: usize, curves: f64) -> (Model, Dataset) {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut model = Model::nominal(Robot::parse(ROBOT, "arm.toml").unwrap(), Cell::parse(CELL, "cell.toml").unwrap());
    let touch =
        |ball| Row { state: State::at(&[]), measured: Measured::Touch { ball, reading: [0.0; 3] }, seq: None, line: 2 };
    let shape = build((0..3).map(touch).collect());
    model.terms = independent_terms(&model, &shape, &Choice::from(ParameterSet::Compliance)).unwrap().0;
    for t in &mut model.terms {
        let size = if t.effect == "compliance" { 2e-5 } else { 1e-3 };
        t.value = rng.random_range(-size..size);
    }
    let normal = rand_distr::Normal::new(0.0, NOISE).unwrap();
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let (mut ws, mut rows) = (forward.workspace(), Vec::new());
    let curve: [[f64; 6]; 6] =
        std::array::from_fn(|_| std::array::from_fn(|_| curves * normal.sample(&mut rng) / NOISE));
    let off = |joint: usize, q: f64| -> f64 {
        curve[joint].chunks(2).zip([1.0, 2.0, 3.0]).map(|(c, k)| c[0] * (k * q).cos() + c[1] * (k * q).sin()).sum()
    };
    while rows.len() < count {
        let ball = rows.len() % 3;
        let turn = trical_model::pose::rotation_z(rng.random_range(-3.0..3.0))
            * trical_model::pose::rotation_x(3.1 + rng.random_range(-0.9..0.9))
            * trical_model::pose::rotation_z(rng.random_range(-3.0..3.0));
        let at = Pose { rotation: turn, translation: model.cell.balls[ball] };
        let mut state = State::at(&[0.0; MAX_JOINTS]);
        let Ok(all) = trical_model::ik::inverse_kinematics(&forward, &at, &state, &mut ws) else { continue };
        state.q = all[rng.random_range(0..all.len())].joints;
        let mut true_state = state;
        true_state.q.iter_mut().take(6).enumerate().for_each(|(joint, q)| *q += off(joint, *q));
        let pose = forward.world_from_tool(&true_state, &mut ws);
        let i = pose.rotation.transpose() * (model.cell.balls[ball] - pose.translation);
        let reading = std::array::from_fn(|a| i[a] + normal.sample(&mut rng));
        rows.push(Row { state, measured: Measured::Touch { ball, reading }, seq: None, line: rows.len() + 2 });
    }
    (model, build(rows))
}

/// Shares of 95 % intervals that hold the truth, of parameters and of the tool's place at poses anywhere; and how far off the tool was there, root
/// mean square in units of the standard deviation that the model's file says.
fn covered(runs: u64) -> (f64, f64, f64) {
    let t = 1.987; // Student's with 104 degrees of freedom, 97.5 %
    let (mut inside, mut all, mut inside_predicted, mut all_predicted) = (0, 0, 0, 0);
    let mut square = 0.0;
    for seed in 0..runs {
        let (truth, data) = one_run(1000 + seed);
        let found = identify(&truth.robot, &truth.cell, &data, ParameterSet::Compliance).unwrap();
        let found = found.with_shared_errors().unwrap();
        for a in &truth.terms {
            let b = found.model.terms.iter().find(|b| b.name == a.name).unwrap();
            inside += u32::from((a.value - b.value).abs() < t * b.sd.unwrap());
            all += 1;
        }
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let (true_arm, our_arm) =
            (Forward::new(truth.clone(), Vec::new()).unwrap(), Forward::new(found.model.clone(), Vec::new()).unwrap());
        let (mut true_ws, mut our_ws) = (true_arm.workspace(), our_arm.workspace());
        let file = ModelFile { uncertainty: Uncertainty::of(&found), ..ModelFile::of(found.model.clone(), &data) };
        let expected = Expected::of(&file).unwrap().unwrap();
        for _ in 0..10 {
            let state = random_joints(&truth, &mut rng);
            let touch = Measured::Touch { ball: 0, reading: [0.0; 3] };
            let covariance = found.prediction_covariance(&state, &touch, 0).unwrap();
            let off = our_arm.world_from_tool(&state, &mut our_ws).translation
                - true_arm.world_from_tool(&state, &mut true_ws).translation;
            square += (off.norm() / expected.deviation(&state)).powi(2) / 3.0;
            for k in 0..3 {
                inside_predicted += u32::from(off[k].abs() < t * covariance[k][k].sqrt());
                all_predicted += 1;
            }
        }
    }
    let off = (3.0 * square / f64::from(all_predicted)).sqrt();
    let shares = (f64::from(inside) / f64::from(all), f64::from(inside_predicted) / f64::from(all_predicted), off);
    println!("{runs} runs: {:.4} of parameters, {:.4} of predictions, off by {off:.3} sd", shares.0, shares.1);
    shares
}

#[test]
fn intervals_of_95_percent_cover_the_truth_in_93_to_97_percent_of_runs() {
    let (parameters, predictions, off) = covered(150);
    assert!((0.93..0.97).contains(&parameters), "{parameters}");
    assert!((0.93..0.97).contains(&predictions), "{predictions}");
    assert!((0.95..1.05).contains(&off), "{off}");
}

/// Share of the parameters that lie within 95 % intervals, plain and with what neighbouring measurements share, and the mean design effect.
fn covered_beside_curves(curves: f64) -> (f64, f64, f64) {
    let (mut plain, mut shared, mut all, mut effect) = (0, 0, 0, 0.0);
    for seed in 0..30 {
        let (truth, data) = touched(seed, 150, curves);
        let found = identify(&truth.robot, &truth.cell, &data, ParameterSet::Compliance).unwrap();
        let wider = found.clone().with_shared_errors().unwrap();
        let inside = |fit: &Identified| {
            let within = |a: &&trical_model::Term| {
                let b = fit.model.terms.iter().find(|b| b.name == a.name).unwrap();
                (a.value - b.value).abs() < 1.96 * b.sd.unwrap()
            };
            truth.terms.iter().filter(within).count()
        };
        plain += inside(&found);
        shared += inside(&wider);
        all += truth.terms.len();
        effect += wider.design_effect / 30.0;
    }
    let share = |n: usize| n as f64 / all as f64;
    println!("curves of {curves}: {:.3} plain, {:.3} wider, design effect {effect:.2}", share(plain), share(shared));
    (share(plain), share(shared), effect)
}

#[test]
fn intervals_cover_the_truth_where_the_model_lacks_curves_of_the_joints() {
    let (plain, shared, effect) = covered_beside_curves(1e-4);
    assert!(plain < 0.8 && effect > 2.0, "{plain} {effect}");
    assert!((0.9..0.98).contains(&shared), "{shared}");
    let (_, shared, effect) = covered_beside_curves(0.0);
    assert!((0.93..0.97).contains(&shared) && effect < 1.1, "{shared} {effect}");
}

#[test]
fn the_last_poses_are_scored_by_a_fit_that_has_not_seen_them() {
    let (truth, mut data) = one_run(7);
    // a ball that is bumped by 1 mm before the last fifth shows in full, since nothing is fitted to it
    let score = |data: &Dataset| {
        let e = trical_ident::forward_in_time(&truth.robot, &truth.cell, data, ParameterSet::Compliance, 20).unwrap();
        assert_eq!(e.len(), 9);
        e.iter().sum::<f64>() / 9.0
    };
    assert!(score(&data) < 1e-4);
    for o in data.observations.iter_mut().skip(36) {
        if let Measured::Touch { reading, .. } = &mut o.measured {
            reading[0] += 1e-3;
        }
    }
    assert!((score(&data) / 1e-3 - 1.0).abs() < 0.1);
    let all = trical_ident::forward_in_time(&truth.robot, &truth.cell, &data, ParameterSet::Compliance, 100);
    assert!(all.unwrap_err().to_string().contains("the last 100 % of 45 poses leave no poses to fit"));
}

/// The full number, for reports: `cargo test --release -p trical-ident --test all coverage:: -- --ignored --nocapture`.
#[test]
#[ignore = "the small version above runs in every test; this is the number that is reported"]
fn intervals_of_95_percent_in_1000_runs() {
    let (parameters, predictions, _) = covered(1000);
    assert!((0.93..0.97).contains(&parameters), "{parameters}");
    assert!((0.93..0.97).contains(&predictions), "{predictions}");
}

#[test]
fn the_covariance_of_a_pose_has_the_position_of_a_touch_and_stays_symmetric() {
    let (truth, data) = one_run(1);
    let mut found = identify(&truth.robot, &truth.cell, &data, ParameterSet::Compliance).unwrap();
    found.model.frames = vec![Pose::identity()];
    let state = random_joints(&truth, &mut Pcg64Mcg::seed_from_u64(2));
    let pose = Measured::Pose { position: [0.0; 3], quaternion: [1.0, 0.0, 0.0, 0.0] };
    let by_pose = found.prediction_covariance(&state, &pose, 0).unwrap();
    let by_touch = found.prediction_covariance(&state, &Measured::Touch { ball: 0, reading: [0.0; 3] }, 0).unwrap();
    for i in 0..6 {
        assert!(by_pose[i][i] > 0.0);
        for j in 0..6 {
            let size = (by_pose[i][i] * by_pose[j][j]).sqrt();
            assert!((by_pose[i][j] - by_pose[j][i]).abs() < 1e-9 * size);
            if i < 3 && j < 3 {
                assert!((by_pose[i][j] - by_touch[i][j]).abs() < 1e-9 * size);
            }
        }
    }
}
