//! Small data for the tests of single modules.
#![allow(clippy::unwrap_used)]

use std::sync::LazyLock;

use trical_diagnose::{Diagnosis, Options, diagnose};
use trical_ident::calibration::{self, Calibration, calibrate};
use trical_ident::{
    Aim, Dataset, ErrorSummary, JointSource, ParameterSet, Scatter, SessionErrors, Validation, model_of_touches,
    simulate,
};
use trical_model::{Basis, Cell, Measured, Model, Recording, Robot, Row, Site, State, Task, Term};
use trical_plan::{Plan, PlanOptions, plan_touches};

use crate::plan_summary::PlanSummary;

/// A small arm with masses at a platform of three balls, with the shapes of both.
pub(crate) fn arm() -> Model {
    let robot = Robot::parse(include_str!("../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
    Model::nominal(robot, Cell::parse(include_str!("../../../cells/irb120/cell.toml"), "cell.toml").unwrap())
}

/// Measurements, each list a recording.
pub(crate) fn data(recordings: &[Vec<(State, Measured)>]) -> Dataset {
    let row = |(k, (state, measured)): (usize, &(State, Measured))| Row {
        state: *state,
        measured: *measured,
        seq: None,
        line: k + 2,
    };
    let of = |(k, list): (usize, &Vec<(State, Measured)>)| Recording {
        name: format!("r{k}.csv"),
        joints: 6,
        rows: list.iter().enumerate().map(row).collect(),
        ..Recording::default()
    };
    let all: Vec<Recording> = recordings.iter().enumerate().map(of).collect();
    Dataset::build(&all, JointSource::Read, None).unwrap()
}

/// Some pose, another one for each number.
pub(crate) fn pose(k: u8) -> State {
    let k = f64::from(k);
    State::at(&[0.9 * (1.3 * k).sin(), 0.5 * k.cos(), 0.4 * (2.1 * k).sin(), (0.7 * k).cos(), 0.8 * k.sin(), 0.3 * k])
}

/// A validation at four touches with these errors, mm, everywhere; nothing was identified anew.
pub(crate) fn validation(before: f64, after: f64) -> Validation {
    let data = data(&[(0..4).map(|k| (pose(k), Measured::Touch { ball: 0, reading: [0.0; 3] })).collect()]);
    let errors = vec![(before * 1e-3, after * 1e-3); 4];
    let [before, after] = [before, after].map(|mm| ErrorSummary::of(&[mm * 1e-3; 4]));
    let session = SessionErrors {
        recording: "r0.csv".into(),
        learnt: None,
        refitted: Vec::new(),
        from_poses: 0,
        poses: 4,
        n: 4,
        before,
        after,
    };
    Validation {
        other_load_kg: None,
        orientation: None,
        other_tool_mm: None,
        before,
        after,
        n: 4,
        beyond: None,
        predicted: None,
        sessions: vec![session],
        regions: Vec::new(),
        carried_over: Vec::new(),
        left_out: Vec::new(),
        rejected: Vec::new(),
        errors,
        nominal: (arm(), data.clone()),
        model: arm(),
        data,
    }
}

/// An arm whose joint 3 has a gap, and 90 touches of it.
fn with_gap() -> (Model, Recording) {
    let mut truth = arm();
    let gap = Term::new("gap", "hidden", Site::Joint { joint: 3 }, Basis::direction(3));
    truth.terms.push(Term { value: -5e-4, ..gap });
    // fractional parts of multiples of square roots: no two angles go together
    let angle = |k: f64, step: f64| 2.0 * ((0.5 + k * step).fract() - 0.5);
    let row = |k: u32| {
        let q = [0.4142, 0.7321, 0.2361, 0.6458, 0.3166, 0.6056].map(|step| angle(f64::from(k), step));
        let dir = std::array::from_fn(|j| if (k * (2 * j as u32 + 3) / 8).is_multiple_of(2) { 1 } else { -1 });
        (State { seq: Some(f64::from(k)), dir: Some(dir), ..State::at(&q) }, Aim::Ball(k as usize % 3))
    };
    let scatter = Scatter { length: 1e-5, angle: 0.0, seed: 3 };
    let recording = simulate(&truth, &(0..90).map(row).collect::<Vec<_>>(), &scatter, None).unwrap();
    (truth, recording)
}

/// A diagnosis of an arm whose joint 3 has a gap; it is made once.
pub(crate) fn diagnosis() -> Diagnosis {
    static MADE: LazyLock<Diagnosis> = LazyLock::new(|| {
        let (truth, recording) = with_gap();
        let data = Dataset::build(&[recording], JointSource::Read, None).unwrap();
        diagnose(&truth.robot, &truth.cell, &data, &Options::default(), &Task::silent()).unwrap()
    });
    MADE.clone()
}

/// A calibration of the same arm; it is made once.
pub(crate) fn calibration() -> Calibration {
    static MADE: LazyLock<Calibration> = LazyLock::new(|| {
        let (truth, recording) = with_gap();
        let options = calibration::Options::new(ParameterSet::Geometry);
        calibrate(&truth.robot, &truth.cell, &[recording], &options, &Task::silent()).unwrap()
    });
    MADE.clone()
}

/// The model of a plan of 12 touches of each ball from 30, the plan and its options; it is made once.
pub(crate) fn plan() -> (Model, Plan, PlanOptions) {
    static MADE: LazyLock<(Model, Plan, PlanOptions)> = LazyLock::new(|| {
        let of_arm = arm();
        let model = model_of_touches(&of_arm.robot, &of_arm.cell, ParameterSet::Geometry).unwrap();
        let parameters = Some(model.terms.clone());
        let options = PlanOptions { per_ball: 12, pool_per_ball: 30, parameters, ..PlanOptions::default() };
        let plan = plan_touches(&of_arm.robot, &of_arm.cell, &options, &Task::silent()).unwrap();
        (model, plan, options)
    });
    MADE.clone()
}

/// What is said of this plan.
pub(crate) fn plan_summary() -> PlanSummary {
    let (model, plan, options) = plan();
    PlanSummary::new(&model, plan, options).unwrap()
}

/// What stands behind a text in a page, one cell of a table after the other.
pub(crate) fn behind<'a>(page: &'a str, text: &str, cells: usize) -> Vec<&'a str> {
    let all = page.split('<').filter_map(|tag| tag.split_once('>')).map(|(_, shown)| shown.trim());
    all.filter(|shown| !shown.is_empty()).skip_while(|shown| *shown != text).skip(1).take(cells).collect()
}
