//! The whole identification of the paper's 31 parameters, and its parts: `cargo bench -p trical-ident`.
#![allow(clippy::unwrap_used, missing_docs)]

use divan::Bencher;
use rand::{RngExt, SeedableRng};
use rand_distr::Distribution;
use rand_pcg::Pcg64Mcg;
use trical_ident::fit::identifiability::{independent_terms, r_factor};
use trical_ident::fit::identify::prepared;
use trical_ident::{
    Choice, CsvStream, Dataset, JointSource, Noise, ParameterSet, fit_model, identify, identify_stream,
    reject_gross_errors,
};
use trical_model::{Cell, Forward, MAX_JOINTS, Measured, Model, Pose, Recording, Robot, Row, State};

const ROBOT: &str = include_str!("../../../cells/irb120/robot.toml");
const CELL: &str = include_str!("../../../cells/irb120/cell.toml");

fn main() {
    divan::main();
}

fn nominal() -> Model {
    Model::nominal(Robot::parse(ROBOT, "robot.toml").unwrap(), Cell::parse(CELL, "cell.toml").unwrap())
}

/// Touches of an arm whose 31 parameters are off by chance: within half a millimetre of the ball, 10 um of noise.
fn touches(count: usize) -> Dataset {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut model = nominal();
    let row = |ball| Row {
        state: State::at(&[0.0; MAX_JOINTS]),
        measured: Measured::Touch { ball, reading: [0.0; 3] },
        seq: None,
        line: 2,
    };
    let build = |rows| {
        let recording = Recording { name: "touches".into(), joints: 6, rows, ..Recording::default() };
        Dataset::build(&[recording], JointSource::Read, None).unwrap()
    };
    let shape = build((0..3).map(row).collect());
    model.terms = independent_terms(&model, &shape, &Choice::from(ParameterSet::Compliance)).unwrap().0;
    for t in &mut model.terms {
        let size = if t.effect == "compliance" { 2e-5 } else { 2e-3 };
        t.value = rng.random_range(-size..size);
    }
    let normal = rand_distr::Normal::new(0.0, 1e-5).unwrap();
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let (mut ws, mut rows) = (forward.workspace(), Vec::new());
    while rows.len() < count {
        let ball = rows.len() % 3;
        let turn = trical_model::pose::rotation_z(rng.random_range(-3.0..3.0))
            * trical_model::pose::rotation_x(3.1 + rng.random_range(-0.9..0.9))
            * trical_model::pose::rotation_z(rng.random_range(-3.0..3.0));
        let off = nalgebra::Vector3::from_fn(|_, _| rng.random_range(-5e-4..5e-4));
        let at = Pose { rotation: turn, translation: model.cell.balls[ball] + off };
        let mut state = State::at(&[0.0; MAX_JOINTS]);
        let Ok(all) = trical_model::ik::inverse_kinematics(&forward, &at, &state, &mut ws) else { continue };
        state.q = all[rng.random_range(0..all.len())].joints;
        let pose = forward.world_from_tool(&state, &mut ws);
        let i = pose.rotation.transpose() * (model.cell.balls[ball] - pose.translation);
        let reading = std::array::from_fn(|a| i[a] + normal.sample(&mut rng));
        rows.push(Row { state, measured: Measured::Touch { ball, reading }, seq: None, line: rows.len() + 2 });
    }
    build(rows)
}

/// From observations to 31 parameters with their covariance: choice of the parameters, start, fit, observability.
#[divan::bench(args = [45, 1000])]
fn whole_fit_of_31_parameters(bencher: Bencher, touched: usize) {
    let (data, model) = (touches(touched), nominal());
    bencher.bench_local(|| identify(&model.robot, &model.cell, &data, ParameterSet::Compliance).unwrap().covariance[0]);
}

#[divan::bench(args = [45, 1000])]
fn gross_errors(bencher: Bencher, touched: usize) {
    let (data, model) = (touches(touched), nominal());
    bencher.bench_local(|| reject_gross_errors(&model.robot, &model.cell, &data).unwrap().observations.len());
}

/// A CSV of tracker points, read in passes: ten times as long for a million.
#[divan::bench(sample_count = 5)]
fn stream_of_100_000_points(bencher: Bencher) {
    use std::io::Write;
    let mut model = nominal();
    model.cell.tool.targets = vec![model.cell.tool.tcp];
    model.frames = vec![Pose::identity()];
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let (mut ws, mut rng) = (forward.workspace(), Pcg64Mcg::seed_from_u64(2));
    let normal = rand_distr::Normal::new(0.0, 2e-5).unwrap();
    let mut file = std::io::BufWriter::new(tempfile::NamedTempFile::new().unwrap());
    writeln!(file, "t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,target,x_mm,y_mm,z_mm").unwrap();
    for k in 0..100_000 {
        let q: Vec<f64> = model.robot.joints.iter().map(|j| rng.random_range(j.limits[0]..j.limits[1])).collect();
        let p = forward.world_from_tool(&State::at(&q), &mut ws).translation.map(|v| v + normal.sample(&mut rng));
        let q: Vec<String> = q.iter().map(|q| format!("{:.4}", q.to_degrees())).collect();
        writeln!(file, "{k},{},1,{:.4},{:.4},{:.4}", q.join(","), p.x * 1e3, p.y * 1e3, p.z * 1e3).unwrap();
    }
    let file = file.into_inner().unwrap();
    bencher.bench_local(|| {
        let stream = CsvStream::open(&[file.path().to_owned()], 6).unwrap();
        let data = Dataset::build(&stream.sample().unwrap().recordings, JointSource::Read, None).unwrap();
        let data = reject_gross_errors(&model.robot, &model.cell, &data).unwrap();
        let set = ParameterSet::Compliance;
        identify_stream(&model.robot, &model.cell, &stream, &data, set, false).unwrap().observations
    });
}

#[divan::bench]
fn part_choice_of_parameters(bencher: Bencher) {
    let (data, model) = (touches(45), nominal());
    let choice = Choice::from(ParameterSet::Compliance);
    bencher.bench_local(|| independent_terms(&model, &data, &choice).unwrap().0.len());
}

#[divan::bench]
fn part_choice_and_start(bencher: Bencher) {
    let (data, model) = (touches(45), nominal());
    let choice = Choice::from(ParameterSet::Compliance);
    bencher.bench_local(|| prepared(&model.robot, &model.cell, &data, &choice).unwrap().0.terms.len());
}

#[divan::bench]
fn part_fit_and_covariance(bencher: Bencher) {
    let (data, model) = (touches(45), nominal());
    let choice = Choice::from(ParameterSet::Compliance);
    let start = prepared(&model.robot, &model.cell, &data, &choice).unwrap().0;
    bencher.bench_local(|| fit_model(start.clone(), &data, &Noise::usual(1), Vec::new()).unwrap().covariance[0]);
}

#[divan::bench]
fn part_r_factor(bencher: Bencher) {
    let (data, model) = (touches(45), nominal());
    let found = identify(&model.robot, &model.cell, &data, ParameterSet::Compliance).unwrap();
    let forward = Forward::new(found.model, found.free).unwrap();
    bencher.bench_local(|| r_factor(&forward, &data, &found.noise, &[])[(0, 0)]);
}
