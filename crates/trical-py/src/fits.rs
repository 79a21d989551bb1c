//! Identification, diagnosis, validation: recordings in, a model, numbers as JSON text, and arrays out.

use std::path::PathBuf;

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::Value;
use trical_diagnose::effects::EFFECTS;
use trical_diagnose::{Diagnosis, EffectId, diagnose_recordings, verdict};
use trical_ident::fit::residuals::position_errors;
use trical_ident::{
    Calibration, Choice, KnownParameters, ModelFile, Options, Refit, ToolSharing, calibrate, calibrate_stream, history,
    repeatability, validate,
};
use trical_model::{Cell, Forward, Robot, Task};
use trical_plan::Next;
use trical_recording::{CsvStream, RecordError, open_large};
use trical_report::deciding::{self, plan_next};
use trical_report::verdict_summary;

use crate::arguments::{keywords, parameter_set, source};
use crate::designs::{Touches, touches};
use crate::errors::{RecordingError, Result, bad};
use crate::interruptible::interruptible;
use crate::machine::{CellArgument, Machine, RobotArgument, read};
use crate::model::PyModel;
use crate::outcome::{Outcome, PyOutcome};
use crate::rows::{PyRows, RecordingArgument, read_all};

/// Pairs of errors in m as an array (n, 2) in mm.
fn pairs_mm(before: &[f64], after: &[f64]) -> Array2<f64> {
    Array2::from_shape_fn((before.len(), 2), |(k, j)| 1e3 * if j == 0 { before[k] } else { after[k] })
}

fn square(values: &[f64], p: usize) -> Array2<f64> {
    Array2::from_shape_fn((p, p), |(i, j)| values.get(i * p + j).copied().unwrap_or(f64::NAN))
}

/// The recordings to be read in passes, where they are large files that can be, or this is asked for.
fn passes(recordings: &[RecordingArgument], robot: &Robot, asked: &Options, wanted: bool) -> Result<Option<CsvStream>> {
    let scored = asked.folds.is_some() || asked.hold_out_last.is_some();
    if wanted && scored {
        return Err(bad("stream goes without folds and hold_out_last: these need all rows at once").into());
    }
    let path = |r: &RecordingArgument| match r {
        RecordingArgument::Path(path) => Some(path.clone()),
        RecordingArgument::Rows(_) => None,
    };
    let Some(paths) = recordings.iter().map(path).collect::<Option<Vec<_>>>() else {
        return if wanted { Err(bad("stream reads paths of recordings only").into()) } else { Ok(None) };
    };
    open_large(&paths, robot, wanted, !scored).map_err(|e| match e {
        RecordError::Unreadable { .. } => {
            RecordingError::new_err(format!("{e}; trical.convert saves what is whole in it")).into()
        }
        e => e.into(),
    })
}

/// The model, a JSON summary, position errors before and after (n, 2) in mm, the covariance of the parameters (SI), what the
/// report is made of.
type Fit<'py> = (PyModel, String, Option<Bound<'py, PyArray2<f64>>>, Bound<'py, PyArray2<f64>>, PyOutcome);

/// Keywords of `trical.identify`.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct IdentifyKeywords {
    joints: String,
    model: String,
    compliant: Vec<usize>,
    folds: Option<usize>,
    hold_out_last: Option<usize>,
    keep_outliers: bool,
    tool: String,
    stream: bool,
    known: Option<PathBuf>,
}

/// Identifies.
#[pyfunction]
pub fn _identify<'py>(
    py: Python<'py>,
    recordings: Vec<RecordingArgument>,
    machine: Machine,
    given: &Bound<'py, PyDict>,
    progress: Option<Py<PyAny>>,
) -> Result<Fit<'py>> {
    let IdentifyKeywords { joints, model, compliant, folds, hold_out_last, keep_outliers, tool, stream, known } =
        keywords(given)?;
    let (joints, set, tool) = (source(&joints)?, parameter_set(&model)?, sharing(&tool)?);
    if stream && known.is_some() {
        return Err(
            bad("known with stream=True; expected one of them, since files are read in passes without priors").into()
        );
    }
    let found = interruptible(py, progress, |task| -> Result<Calibration> {
        let (robot, cell) = read(&machine)?;
        let choice = Choice::new(set, &compliant, robot.dof())?
            .knowing(known.as_deref().map(KnownParameters::load).transpose()?.unwrap_or_default());
        let options = Options { choice, joints, folds, hold_out_last, keep_outliers, tool };
        task.step(0.0, "reading")?;
        if known.is_none()
            && let Some(passes) = passes(&recordings, &robot, &options, stream)?
        {
            return Ok(calibrate_stream(&robot, &cell, &passes, &options, task)?);
        }
        let recordings = read_all(&recordings, &robot)?;
        Ok(calibrate(&robot, &cell, &recordings, &options, task)?)
    })?;
    let text = serde_json::to_string(&found)?;
    let file = ModelFile::of_fit(&found.fitted);
    let errors = match found.passes {
        Some(_) => None,
        None => Some(pairs_mm(&found.each_before, &found.fitted.errors()?).into_pyarray(py)),
    };
    let covariance = square(&found.fitted.covariance, found.fitted.free.len()).into_pyarray(py);
    Ok((PyModel::new(file)?, text, errors, covariance, PyOutcome(Outcome::Fitted(Box::new(found)))))
}

/// Which sessions share a tool, by its name in Python.
fn sharing(name: &str) -> Result<ToolSharing> {
    match name {
        "auto" => Ok(ToolSharing::FromData),
        "same" => Ok(ToolSharing::Same),
        "own" => Ok(ToolSharing::Own),
        other => Err(bad(format!("tool is '{other}', expected 'auto', 'same' or 'own'")).into()),
    }
}

/// Touches that would decide between the least sure finding and its rivals, and what is to be said of them.
fn next_touches(
    robot: &Robot,
    cell: &Cell,
    found: &Diagnosis,
    count: usize,
    task: &Task<'_>,
) -> Result<Option<(Next, Value)>> {
    let Some(undecided) = found.undecided()? else { return Ok(None) };
    let next = plan_next(robot, cell, &undecided, count, task)?;
    let said = deciding::json_of(&undecided, &next);
    Ok(Some((next, said)))
}

/// The extended model, the JSON of `docs/formats.md`, position errors before and after (n, 2) in mm, deciding touches with JSON, what the
/// report is made of.
type Diagnosed<'py> = (PyModel, String, Bound<'py, PyArray2<f64>>, Option<(Touches<'py>, String)>, PyOutcome);

/// Keywords of `trical.diagnose`.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct DiagnoseKeywords {
    joints: String,
    names_only: bool,
    tool: String,
    next: Option<usize>,
    known: Option<PathBuf>,
}

/// Diagnoses.
#[pyfunction]
pub fn _diagnose<'py>(
    py: Python<'py>,
    recordings: Vec<RecordingArgument>,
    machine: Machine,
    given: &Bound<'py, PyDict>,
    progress: Option<Py<PyAny>>,
) -> Result<Diagnosed<'py>> {
    let DiagnoseKeywords { joints, names_only, tool, next, known } = keywords(given)?;
    let known = known.as_deref().map(KnownParameters::load).transpose()?.unwrap_or_default();
    let options = trical_diagnose::Options { joints: source(&joints)?, names_only, tool: sharing(&tool)?, known };
    let (robot, cell) = read(&machine)?;
    if next.is_some() && !cell.balls_fix_base(|_| true) {
        return Err(bad(
            "next: expected three [balls] in the cell that are not on one line; where others stand is not known beforehand",
        )
        .into());
    }
    if next.is_some_and(|n| !(1..=1000).contains(&n)) {
        return Err(bad("next: expected 1 to 1000 touches").into());
    }
    let (file, text, errors, planned, told) = interruptible(py, progress, |task| -> Result<_> {
        let recordings = read_all(&recordings, &robot)?;
        let (found, source) = diagnose_recordings(&robot, &cell, &recordings, &options, task)?;
        let value = verdict_summary::json(&found, source)?;
        let errors =
            |model| -> Result<Vec<f64>> { Ok(position_errors(&Forward::new(model, Vec::new())?, &found.data)) };
        let pairs = pairs_mm(&errors(found.before.clone())?, &errors(found.model.clone())?);
        let planned = match next {
            Some(count) => next_touches(&robot, &cell, &found, count, task)?,
            None => None,
        };
        let file = found.model_file();
        Ok((file, value.to_string(), pairs, planned, Outcome::Diagnosed(Box::new((found, source)))))
    })?;
    let planned = planned.map(|(next, said)| (touches(py, &robot, &next.entries), said.to_string()));
    Ok((PyModel::new(file)?, text, errors.into_pyarray(py), planned, PyOutcome(told)))
}

/// Keywords of `trical.validate`.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct ValidateKeywords {
    joints: Option<String>,
    refit: Vec<String>,
}

/// Scores a model; returns a JSON summary, position errors before and after (n, 2) in mm, and what the report is made of.
#[pyfunction]
pub fn _validate<'py>(
    py: Python<'py>,
    model: &Bound<'py, PyModel>,
    recordings: Vec<RecordingArgument>,
    machine: Machine,
    given: &Bound<'py, PyDict>,
    progress: Option<Py<PyAny>>,
) -> Result<(String, Bound<'py, PyArray2<f64>>, PyOutcome)> {
    let ValidateKeywords { joints, refit } = keywords(given)?;
    let file = model.get().file.clone();
    let joints = joints.as_deref().map(source).transpose()?.flatten();
    if let Some(other) = refit.iter().find(|w| !["frame", "targets"].contains(&w.as_str())) {
        return Err(bad(format!("refit holds '{other}', expected 'frame' and perhaps 'targets'")).into());
    }
    let has = |what: &str| refit.iter().any(|w| w == what);
    let refit = (!refit.is_empty()).then(|| Refit { frame: has("frame"), targets: has("targets") });
    let (text, errors, told) = interruptible(py, progress, |task| -> Result<_> {
        let (robot, cell) = read(&machine)?;
        file.require_robot(&robot, "the model")?;
        task.step(0.0, "reading")?;
        let recordings = read_all(&recordings, &robot)?;
        task.step(0.3, "scoring")?;
        let v = validate(&robot, &cell, &file, &recordings, joints, refit)?;
        let text = serde_json::to_string(&v)?;
        let (before, after): (Vec<f64>, Vec<f64>) = v.errors.iter().copied().unzip();
        task.step(1.0, "done")?;
        Ok((text, pairs_mm(&before, &after), Outcome::Scored(Box::new((v, file)))))
    })?;
    Ok((text, errors.into_pyarray(py), PyOutcome(told)))
}

/// Sessions against a model, as JSON text.
#[pyfunction]
pub fn _history(
    py: Python<'_>,
    model: &Bound<'_, PyModel>,
    recordings: Vec<RecordingArgument>,
    joints: Option<&str>,
    need_mm: Option<f64>,
) -> Result<String> {
    let file = model.get().file.clone();
    let joints = joints.map(source).transpose()?.flatten();
    if need_mm.is_some_and(|n| !(n > 0.0 && n.is_finite())) {
        return Err(bad("need_mm: expected a number above 0").into());
    }
    let recordings = read_all(&recordings, &file.model.robot)?;
    py.detach(|| Ok(serde_json::to_string(&history(&file.model.cell, &file, &recordings, joints, need_mm)?)?))
}

/// How far repeat visits scatter, as JSON text.
#[pyfunction]
pub fn _repeatability(
    py: Python<'_>,
    recording: &Bound<'_, PyRows>,
    robot: Option<RobotArgument>,
    cell: Option<CellArgument>,
    same: Option<f64>,
) -> Result<String> {
    if let Some(found) = same.filter(|same| !(*same > 0.0 && same.is_finite())) {
        return Err(bad(format!("same is {found}, expected a positive angle in rad")).into());
    }
    let recording = recording.get().0.clone();
    py.detach(|| {
        let robot = robot.map(|r| r.read()).transpose()?;
        let cell = cell.map(|c| c.read()).transpose()?;
        Ok(serde_json::to_string(&repeatability(&recording, robot, cell, same.map(f64::to_degrees))?)?)
    })
}

/// An effect at a place in words, as the reports have it: "Gear ripple at joint 3"; an effect alone without a place.
#[pyfunction]
pub fn _named(effect: &str, site: Option<&str>) -> Result<String> {
    let title = verdict::capital(&verdict::title_of(effect));
    let (Some(id), Some(site)) = (EffectId::named(effect), site) else { return Ok(title) };
    Ok(verdict::named(id, serde_json::from_str(site)?))
}

/// The catalogue of effects as JSON text.
#[pyfunction]
pub fn _effects_json() -> String {
    serde_json::to_string(&EFFECTS).unwrap_or_default()
}
