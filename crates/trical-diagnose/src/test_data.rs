//! Small data for the tests of single modules.
#![allow(clippy::unwrap_used)]

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_ident::dataset::Observation;
use trical_ident::{Aim, Dataset, JointSource, ParameterSet, Scatter, simulate};
use trical_model::{
    Axis, Basis, Cell, Forward, Measured, Model, Motion, Place, Recording, Robot, Row, Shape, Site, State, Term,
    Variable,
};

use crate::candidate::{Candidate, Physical};
use crate::effect_id::Cause;

#[path = "../../trical-ident/tests/common/arm.rs"]
mod arm;

/// A small arm of six joints with masses, and a cell with three balls.
pub(crate) fn arm() -> Model {
    let robot = Robot::parse(include_str!("../../trical-model/tests/data/arm.toml"), "arm.toml").unwrap();
    Model::nominal(robot, Cell::parse(include_str!("../../trical-model/tests/data/cell.toml"), "cell.toml").unwrap())
}

/// Touches of the first ball, each list a recording.
pub(crate) fn touches(recordings: &[Vec<(State, [f64; 3])>]) -> Dataset {
    let row = |(k, (state, reading)): (usize, &(State, [f64; 3]))| Row {
        state: *state,
        measured: Measured::Touch { ball: 0, reading: *reading },
        seq: None,
        line: k + 2,
    };
    let of = |(k, list): (usize, &Vec<(State, [f64; 3])>)| Recording {
        name: format!("r{k}"),
        joints: 6,
        rows: list.iter().enumerate().map(row).collect(),
        ..Recording::default()
    };
    let all: Vec<Recording> = recordings.iter().enumerate().map(of).collect();
    Dataset::build(&all, JointSource::Read, None).unwrap()
}

/// One recording of so many touches: joints and covariates as `state` says, readings of zero.
pub(crate) fn states(count: usize, state: impl Fn(f64) -> State) -> Dataset {
    let count = u32::try_from(count).unwrap();
    touches(&[(0..count).map(|k| (state(f64::from(k)), [0.0; 3])).collect()])
}

/// So many touches of all three balls by an arm that is as `truth` says, at angles anywhere, without noise.
pub(crate) fn touched(truth: &Model, count: u32) -> Dataset {
    let forward = Forward::new(truth.clone(), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    // fractional parts of multiples of square roots: no two angles go together
    let angle = |k: u32, step: f64| 2.4 * ((0.5 + f64::from(k) * step).fract() - 0.5);
    let row = |k: u32| {
        let q = [0.4142, 0.7321, 0.2361, 0.6458, 0.3166, 0.6056].map(|step| angle(k, step));
        let (state, ball) = (State { t: Some(20.0 * f64::from(k)), ..State::at(&q) }, k as usize % 3);
        let tool = forward.world_from_tool(&state, &mut ws);
        let i = tool.rotation.transpose() * (truth.cell.balls[ball] - tool.translation);
        Row { state, measured: Measured::Touch { ball, reading: [i.x, i.y, i.z] }, seq: None, line: k as usize + 2 }
    };
    let rows = (0..count).map(row).collect();
    let recording = Recording { name: "made".into(), joints: 6, rows, ..Recording::default() };
    Dataset::build(&[recording], JointSource::Read, None).unwrap()
}

/// So many touches, which read `shift` (m) more along x from the middle on, and an arm of which only the place of the device on the
/// flange is sought. Whatever the poses, each axis of that is a mean of readings: fits are known in closed form.
pub(crate) fn shifted(count: u32, shift: f64) -> (Model, Dataset) {
    let mut model = arm();
    let mut data = touched(&model, count);
    for o in &mut data.observations[count as usize / 2..] {
        let Measured::Touch { ball, reading: [x, y, z] } = o.measured else { continue };
        o.measured = Measured::Touch { ball, reading: [x + shift, y, z] };
    }
    let tool = |axis: Axis| {
        Term::new(format!("tool_{}", axis.name()), "tool", Site::Tool(Motion::Along(axis)), Basis::CONSTANT)
    };
    model.terms = Axis::ALL.map(tool).into();
    (model, data)
}

/// An arm whose joint 2 is off by what the bases say, and 200 touches of it in order, with noise.
pub(crate) fn with_joint_2(hidden: &[(Basis, f64)]) -> (Model, Dataset) {
    with_joints(&hidden.iter().map(|(basis, value)| (2, *basis, *value)).collect::<Vec<_>>())
}

/// The same of any joints.
pub(crate) fn with_joints(hidden: &[(usize, Basis, f64)]) -> (Model, Dataset) {
    let mut truth = arm::truth(ParameterSet::Compliance, 5);
    for (k, (joint, basis, value)) in hidden.iter().enumerate() {
        let term = Term::new(format!("hidden_{k}"), "hidden", Site::Joint { joint: *joint }, *basis);
        truth.terms.push(Term { value: *value, ..term });
    }
    let mut rng = Pcg64Mcg::seed_from_u64(8);
    let rows: Vec<(State, Aim)> = (0..200_u32)
        .map(|k| {
            let within = |j: &trical_model::Joint| rng.random_range(j.limits[0].max(-1.4)..j.limits[1].min(1.4));
            let q: Vec<f64> = truth.robot.joints.iter().map(within).collect();
            // every joint came from either side, each in a rhythm of its own
            let dir = std::array::from_fn(|j| if (k * (2 * j as u32 + 3) / 8).is_multiple_of(2) { 1 } else { -1 });
            (State { seq: Some(f64::from(k)), dir: Some(dir), ..State::at(&q) }, Aim::Ball(k as usize % 3))
        })
        .collect();
    let recording = simulate(&truth, &rows, &Scatter { length: 1e-5, angle: 0.0, seed: 3 }, None).unwrap();
    let data = Dataset::build(&[recording], JointSource::Read, None).unwrap();
    (truth, data)
}

/// A recording of the measurements.
pub(crate) fn recorded(data: &Dataset) -> Recording {
    let row = |o: &Observation| Row { state: o.state, measured: o.measured, seq: None, line: o.row };
    let rows = data.observations.iter().map(row).collect();
    Recording { name: "recorded".into(), joints: 6, rows, ..Recording::default() }
}

/// A joint is off by what a shape of its own angle says, at sizes of 1 mrad.
pub(crate) fn off(cause: Cause, joint: usize, shape: Shape) -> Candidate {
    let basis = Basis::new(Variable::Joint { joint }, shape);
    Candidate {
        cause,
        site: Place::Joint(joint),
        behaviour: format!("joint {joint} is off"),
        terms: vec![Term::new("t", cause.name(), Site::Joint { joint }, basis)],
        signs: vec![0],
        physical: Physical::default(),
        typical: 1e-4,
        scales: vec![1e-3],
        log_prior: 0.0,
    }
}
