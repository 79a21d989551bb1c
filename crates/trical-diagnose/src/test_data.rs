//! Small data for the tests of single modules.
#![allow(clippy::unwrap_used)]

use trical_ident::{Dataset, JointSource};
use trical_model::{Cell, Measured, Model, Recording, Robot, Row, State};

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
