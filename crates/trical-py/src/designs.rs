//! Before anything is measured: plans, simulated recordings, and what measurements could tell.

use std::sync::Arc;

use nalgebra::Vector3;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Value, json};
use trical_ident::fit::identifiability::{independent_terms, observability, r_factor};
use trical_ident::{Aim, Choice, Dataset, JointSource, Noise, Scatter, model_of_touches, shown, simulate, usual_set};
use trical_model::{Forward, Joints, MAX_JOINTS, Measured, Model, Pose, Robot, State};
use trical_plan::{
    CollisionModel, Criterion, Facing, PlanEntry, PlanOptions, Sphere, ValidationOptions, plan_touches,
    poses_in_sphere, poses_in_workspace, usual_start, write_plan,
};
use trical_report::plan_summary::PlanSummary;

use crate::arguments::{keywords, parameter_set, source};
use crate::arrays::{Beside, Column, States, joints_array, one_pose};
use crate::errors::{Result, bad};
use crate::interruptible::interruptible;
use crate::machine::{Machine, read};
use crate::model::PyModel;
use crate::outcome::{Outcome, PyOutcome};
use crate::rows::{PyRows, RecordingArgument, read_all};

/// What chosen touches are best for, and whether in the whole workspace.
pub fn criterion(name: &str) -> PyResult<(Criterion, bool)> {
    match name {
        "d" => Ok((Criterion::Determinant, false)),
        "a" => Ok((Criterion::Variances, false)),
        "e" => Ok((Criterion::Weakest, false)),
        "sphere" => Ok((Criterion::Region, false)),
        "workspace" => Ok((Criterion::Region, true)),
        other => Err(bad(format!("criterion is '{other}', expected 'd', 'a', 'e', 'sphere' or 'workspace'"))),
    }
}

fn sphere(given: Option<[f64; 4]>) -> PyResult<Option<Sphere>> {
    match given {
        None => Ok(None),
        Some([x, y, z, r]) if r > 0.0 => Ok(Some(Sphere { centre: Vector3::new(x, y, z), radius: r })),
        Some([.., r]) => Err(bad(format!("sphere has a radius of {r} m, expected more than 0"))),
    }
}

/// Touches as arrays: balls (from 1), joints, stand-off joints, ways, senses; the text of plan.csv.
pub type Touches<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Vec<Bound<'py, PyArray2<f64>>>,
    Bound<'py, PyArray2<i8>>,
    String,
);

/// As Python has them.
pub fn touches<'py>(py: Python<'py>, robot: &Robot, entries: &[PlanEntry]) -> Touches<'py> {
    let n = robot.dof();
    let of = |f: fn(&PlanEntry) -> Joints| -> Vec<Joints> { entries.iter().map(f).collect() };
    let balls: Vec<i64> = entries.iter().map(|e| i64::try_from(e.ball + 1).unwrap_or(0)).collect();
    let senses: Vec<[i8; MAX_JOINTS]> = entries.iter().map(PlanEntry::senses).collect();
    (
        balls.into_pyarray(py),
        joints_array(&of(|e| e.joints), n).into_pyarray(py),
        joints_array(&of(|e| e.approach), n).into_pyarray(py),
        entries.iter().map(|e| joints_array(&e.via, n).into_pyarray(py)).collect(),
        Array2::from_shape_fn((entries.len(), n), |(k, j)| senses[k][j]).into_pyarray(py),
        write_plan(robot, entries),
    )
}

/// Keywords of `trical.plan`.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct PlanKeywords<'py> {
    per_ball: usize,
    pool: usize,
    criterion: String,
    sphere: Option<[f64; 4]>,
    max_tilt: f64,
    noise: f64,
    start: Option<Bound<'py, PyAny>>,
    seed: u64,
}

/// Plans touches; also a JSON summary, and what the report is made of.
#[pyfunction]
pub fn _plan<'py>(
    py: Python<'py>,
    machine: Machine,
    given: &Bound<'py, PyDict>,
    progress: Option<Py<PyAny>>,
) -> Result<(Touches<'py>, String, PyOutcome)> {
    let given: PlanKeywords<'_> = keywords(given)?;
    let (criterion, whole_workspace) = criterion(&given.criterion)?;
    let sphere = sphere(given.sphere)?;
    let (robot, cell) = read(&machine)?;
    let start: Joints = match &given.start {
        None => usual_start(&robot),
        Some(q) => one_pose(q, &robot)?,
    };
    let model = model_of_touches(&robot, &cell, usual_set(&robot))?;
    let options = PlanOptions {
        per_ball: given.per_ball,
        pool_per_ball: given.pool.max(given.per_ball),
        seed: given.seed,
        criterion,
        whole_workspace,
        sphere,
        max_tilt_rad: given.max_tilt,
        noise_m: given.noise,
        parameters: Some(model.terms.clone()),
        start: Some(start),
        ..PlanOptions::default()
    };
    let summary = interruptible(py, progress, |task| -> Result<PlanSummary> {
        let plan = plan_touches(&robot, &cell, &options, task)?;
        task.step(1.0, "what it would show")?;
        Ok(PlanSummary::new(&model, plan, options)?)
    })?;
    let arrays = touches(py, &robot, &summary.plan.entries);
    let said = summary.json().to_string();
    Ok((arrays, said, PyOutcome(Outcome::Planned(Box::new((robot, cell, summary))))))
}

/// Keywords of `trical.poses`.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct PosesKeywords {
    sphere: Option<[f64; 4]>,
    facing: Option<[f64; 3]>,
    facing_axis: [f64; 3],
    facing_within: f64,
    seed: u64,
}

/// Poses free of collisions, in a sphere or in the whole workspace: joints (n, joints).
#[pyfunction]
pub fn _poses<'py>(
    py: Python<'py>,
    n: usize,
    machine: Machine,
    given: &Bound<'py, PyDict>,
) -> Result<Bound<'py, PyArray2<f64>>> {
    let PosesKeywords { sphere: in_sphere, facing, facing_axis, facing_within, seed } = keywords(given)?;
    let sphere = sphere(in_sphere)?;
    let axis_in_tool = Vector3::from(facing_axis);
    if facing.is_some() && axis_in_tool.norm() < 1e-9 {
        return Err(bad(format!("facing_axis is {facing_axis:?}, expected a direction")).into());
    }
    let facing = facing.map_or(Facing::Any, |point| Facing::Towards {
        point: Vector3::from(point),
        axis_in_tool,
        within_rad: facing_within,
    });
    let (robot, cell) = read(&machine)?;
    let poses = interruptible(py, None, |_| -> Result<Vec<Joints>> {
        let model = CollisionModel::new(&robot, &cell)?;
        let options = ValidationOptions { seed, facing };
        Ok(match &sphere {
            Some(s) => poses_in_sphere(&model, &s.centre, s.radius, n, &options)?,
            None => poses_in_workspace(&model, n, &options)?,
        })
    })?;
    Ok(joints_array(&poses, robot.dof()).into_pyarray(py))
}

/// A number counted from 1 for each of n rows.
fn counted(value: &Bound<'_, PyAny>, name: &str, n: usize) -> PyResult<Vec<usize>> {
    let column = Column::new(value, name, n)?;
    (0..n)
        .map(|k| {
            let x = column.at(k);
            if x.fract() != 0.0 || !(1.0..1e6).contains(&x) {
                return Err(bad(format!("{name}, row {k}: found {x}, expected a number counted from 1")));
            }
            let x = x as usize;
            Ok(x - 1)
        })
        .collect()
}

/// Keywords of `trical.simulate`, but for what is measured.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct SimulateKeywords<'py> {
    noise: f64,
    angle_noise: f64,
    seed: u64,
    stop_within: Option<f64>,
    directions: Option<Bound<'py, PyAny>>,
    temperature: Option<Bound<'py, PyAny>>,
    time: Option<Bound<'py, PyAny>>,
    payload: Option<Bound<'py, PyAny>>,
}

/// Simulates a recording.
#[pyfunction]
pub fn _simulate(
    py: Python<'_>,
    model: &Bound<'_, PyModel>,
    q: &Bound<'_, PyAny>,
    kind: &str,
    number: Option<&Bound<'_, PyAny>>,
    given: &Bound<'_, PyDict>,
) -> Result<PyRows> {
    let SimulateKeywords { noise, angle_noise, seed, stop_within, directions, temperature, time, payload } =
        keywords(given)?;
    let model = model.get().file.model.clone();
    let beside = Beside {
        directions: directions.as_ref(),
        time: time.as_ref(),
        seq: None,
        temperature: temperature.as_ref(),
        payload: payload.as_ref(),
    };
    let states = States::new(q, model.robot.dof(), &beside)?;
    let n = states.len();
    let numbers = number.map(|b| counted(b, kind, n)).transpose()?.unwrap_or_else(|| vec![0; n]);
    for (name, x) in [("noise", noise), ("angle_noise", angle_noise), ("stop_within", stop_within.unwrap_or(0.0))] {
        if !(x.is_finite() && x >= 0.0) {
            return Err(bad(format!("{name} is {x}, expected 0 or more")).into());
        }
    }
    let aim = |k: usize| match kind {
        "ball" => Aim::Ball(numbers[k]),
        "anchor" => Aim::Anchor(numbers[k]),
        "pose" => Aim::Pose,
        _ => Aim::Target(numbers[k]),
    };
    let scatter = Scatter { length: noise, angle: angle_noise, seed };
    let rows: Vec<_> = (0..n).map(|k| (State { seq: Some(k as f64), ..states.at(k) }, aim(k))).collect();
    let recording = interruptible(py, None, |_| simulate(&model, &rows, &scatter, stop_within))?;
    Ok(PyRows(Arc::new(recording)))
}

/// What measurements at these places tell about a set of parameters, as JSON text.
#[pyfunction]
pub fn _observability(
    py: Python<'_>,
    recordings: Vec<RecordingArgument>,
    machine: Machine,
    joints: &str,
    set: &str,
    noise: Option<f64>,
) -> Result<String> {
    let (joints, set) = (source(joints)?.unwrap_or(JointSource::Read), parameter_set(set)?);
    let value = interruptible(py, None, |_| -> Result<Value> {
        let (robot, cell) = read(&machine)?;
        let data = Dataset::build(&read_all(&recordings, &robot)?, joints, None)?;
        let mut model = Model::nominal(robot, cell);
        model.frames = vec![Pose::identity(); data.frames()];
        let (terms, dependent) = independent_terms(&model, &data, &Choice::from(set))?;
        model.terms = terms;
        let free = (0..model.terms.len()).collect();
        let forward = Forward::new(model.clone(), free)?;
        trical_ident::fit::residuals::check_observations(&forward, &data)?;
        let weights = Noise::usual(data.names.len());
        let (indices, covariance) = observability(&r_factor(&forward, &data, &weights, &[]), data.scalars());
        let p = model.terms.len();
        let touch = Measured::Touch { ball: 0, reading: [0.0; 3] };
        let factor = noise.map_or(1.0, |n| n / weights.sigma(0, &touch, 0));
        for (k, term) in model.terms.iter_mut().enumerate() {
            term.sd = Some(covariance[k * p + k].max(0.0).sqrt() * factor);
        }
        let parameters: Vec<_> = model.terms.iter().map(|t| shown(&model, t)).collect();
        let mut value = serde_json::to_value(&indices)?;
        value["parameters"] = json!(parameters);
        value["not_identifiable"] = json!(dependent.iter().map(|d| (&d.name, &d.with)).collect::<Vec<_>>());
        Ok(value)
    })?;
    Ok(value.to_string())
}
