//! Identification, diagnosis, validation: recordings in, a model, numbers as JSON text, and arrays out.

use std::path::PathBuf;

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray2};
use pyo3::prelude::*;
use serde_json::{Value, json};
use trical_ident::diagnose::effects::EFFECTS;
use trical_ident::fit::position_errors;
use trical_ident::{
    Choice, CsvStream, Dataset, Diagnosis, ErrorSummary, Identified, JointSource, KnownParameters, ModelFile,
    ParameterSet, Refit, cautions, clean, cross_validate, diagnose_recordings, forward_in_time, identify,
    identify_stream, repeatability, shown, validate,
};
use trical_model::{Cell, Forward, Robot, Task};
use trical_plan::Next;
use trical_recording::{RecordError, open_large};
use trical_report::deciding::plan_next;
use trical_report::identify_report::{of_folds, of_last};

use crate::designs::{Touches, touches};
use crate::errors::{RecordingError, Result, bad};
use crate::long::long;
use crate::machine::{CellArgument, RobotArgument, read};
use crate::model::PyModel;
use crate::rows::{PyRows, RecordingArgument, read_all};
use crate::told::{Fitted, Kept, PyTold};

/// Which joint angles to believe; `None` for those that the data is to choose.
pub fn source(joints: &str) -> PyResult<Option<JointSource>> {
    match joints {
        "read" => Ok(Some(JointSource::Read)),
        "commanded" => Ok(Some(JointSource::Commanded)),
        "auto" => Ok(None),
        other => Err(bad(format!("joints is '{other}', expected 'read', 'commanded' or 'auto'"))),
    }
}

/// The parameters to identify.
pub fn parameter_set(model: &str) -> PyResult<ParameterSet> {
    match model {
        "nominal" => Ok(ParameterSet::Nominal),
        "geometry" => Ok(ParameterSet::Geometry),
        "compliance" => Ok(ParameterSet::Compliance),
        "complete" => Ok(ParameterSet::Complete),
        other => Err(bad(format!("model is '{other}', expected 'nominal', 'geometry', 'compliance' or 'complete'"))),
    }
}

/// What identification is asked for.
struct Asked {
    joints: Option<JointSource>,
    set: ParameterSet,
    choice: Choice,
    folds: Option<usize>,
    hold_out_last: Option<usize>,
    keep_outliers: bool,
}

/// What it gives.
struct Found {
    file: ModelFile,
    summary: Value,
    errors_mm: Option<Array2<f64>>,
    covariance: Array2<f64>,
    fitted: Fitted,
}

fn model_file(fitted: &Identified) -> ModelFile {
    ModelFile {
        model: fitted.model.clone(),
        joints: fitted.data.joints,
        references: fitted.data.references.clone(),
        recordings: fitted.data.names.clone(),
    }
}

/// Pairs of errors in m as an array (n, 2) in mm.
fn pairs_mm(before: &[f64], after: &[f64]) -> Array2<f64> {
    Array2::from_shape_fn((before.len(), 2), |(k, j)| 1e3 * if j == 0 { before[k] } else { after[k] })
}

fn square(values: &[f64], p: usize) -> Array2<f64> {
    Array2::from_shape_fn((p, p), |(i, j)| values.get(i * p + j).copied().unwrap_or(f64::NAN))
}

fn of_fit(fitted: &Identified) -> Value {
    json!({
        "cautions": cautions(&fitted.model, fitted.observability.rows, fitted.free.len()),
        "recordings": fitted.data.names,
        "joints": fitted.data.joints,
        "parameters": fitted.free.iter().map(|k| shown(&fitted.model, &fitted.model.terms[*k])).collect::<Vec<_>>(),
        "not_identifiable": fitted.dependent.iter().map(|d| (&d.name, &d.with)).collect::<Vec<_>>(),
        "correlated": fitted.correlated(0.9),
        "observability": fitted.observability,
        "fit": fitted.report,
        "cross_validation": null,
        "forward_in_time": null,
    })
}

fn in_memory(robot: &Robot, cell: &Cell, data: &Dataset, asked: &Asked, task: &Task<'_>) -> Result<Found> {
    task.step(0.2, "fitting")?;
    let fitted = identify(robot, cell, data, asked.choice.clone())?;
    let nominal = identify(robot, cell, data, ParameterSet::Nominal)?;
    let (before, after) = (nominal.errors()?, fitted.errors()?);
    let mut summary = of_fit(&fitted);
    summary["observations"] = json!(data.observations.len());
    summary["rejected"] = json!(data.rejected);
    summary["before"] = json!(ErrorSummary::of(&before));
    summary["errors"] = json!(ErrorSummary::of(&after));
    let mut unseen = Vec::new();
    if let Some(percent) = asked.hold_out_last {
        task.step(0.4, "forward in time")?;
        let errors = ErrorSummary::of(&forward_in_time(robot, cell, data, asked.choice.clone(), percent)?);
        summary["forward_in_time"] = json!(errors);
        unseen.push((of_last(percent), errors));
    }
    if let Some(folds) = asked.folds {
        task.step(0.5, "cross-validating")?;
        let errors = ErrorSummary::of(&cross_validate(robot, cell, data, asked.choice.clone(), folds)?);
        summary["cross_validation"] = json!(errors);
        // the verdict of a report names the first
        unseen.insert(0, (of_folds(folds), errors));
    }
    Ok(Found {
        file: model_file(&fitted),
        summary,
        errors_mm: Some(pairs_mm(&before, &after)),
        covariance: square(&fitted.covariance, fitted.free.len()),
        fitted: Fitted {
            fitted,
            errors: [&before, &after].map(|e| ErrorSummary::of(e)),
            each_before: Some(before),
            unseen,
            observations: data.observations.len(),
            named: data.rejected.clone(),
            rejected: data.rejected.len(),
            cleaned: !asked.keep_outliers,
        },
    })
}

fn in_passes(robot: &Robot, cell: &Cell, stream: &CsvStream, asked: &Asked, task: &Task<'_>) -> Result<Found> {
    let sample = stream.sample()?;
    let data = clean(robot, cell, &sample.recordings, asked.joints, asked.set, asked.keep_outliers)?;
    task.step(0.2, "fitting in passes")?;
    let s = identify_stream(robot, cell, stream, &data, asked.choice.clone(), asked.keep_outliers)?;
    let mut summary = of_fit(&s.identified);
    summary["observations"] = json!(s.observations);
    summary["rejected"] = json!(s.named);
    summary["before"] = json!(s.before);
    summary["errors"] = json!(s.errors);
    Ok(Found {
        file: model_file(&s.identified),
        summary,
        errors_mm: None,
        covariance: square(&s.identified.covariance, s.identified.free.len()),
        fitted: Fitted {
            fitted: s.identified,
            each_before: None,
            errors: [s.before, s.errors],
            unseen: Vec::new(),
            observations: s.observations,
            named: s.named,
            rejected: s.rejected,
            cleaned: !asked.keep_outliers,
        },
    })
}

/// The recordings to be read in passes, where they are large files that can be, or this is asked for.
fn stream(recordings: &[RecordingArgument], joints: usize, asked: &Asked, wanted: bool) -> Result<Option<CsvStream>> {
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
    open_large(&paths, joints, wanted, !scored).map_err(|e| match e {
        RecordError::Unreadable { .. } => {
            RecordingError::new_err(format!("{e}; trical.convert saves what is whole in it")).into()
        }
        e => e.into(),
    })
}

/// The model, a JSON summary, position errors before and after (n, 2) in mm, the covariance of the parameters (SI), what the
/// report is made of.
type Fit<'py> = (PyModel, String, Option<Bound<'py, PyArray2<f64>>>, Bound<'py, PyArray2<f64>>, PyTold);

/// Identifies.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "keywords of the public function")]
pub fn _identify<'py>(
    py: Python<'py>,
    recordings: Vec<RecordingArgument>,
    robot: RobotArgument,
    cell: CellArgument,
    joints: &str,
    model: &str,
    compliant: Vec<usize>,
    folds: Option<usize>,
    hold_out_last: Option<usize>,
    keep_outliers: bool,
    in_stream: bool,
    known: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
) -> Result<Fit<'py>> {
    let (joints, set) = (source(joints)?, parameter_set(model)?);
    if in_stream && known.is_some() {
        return Err(
            bad("known with stream=True; expected one of them, since files are read in passes without priors").into()
        );
    }
    let found = long(py, progress, |task| -> Result<Found> {
        let (robot, cell) = read(&robot, &cell)?;
        if set >= ParameterSet::Compliance {
            robot.require_masses()?;
        }
        let choice = Choice::new(set, &compliant, robot.dof())
            .map_err(|e| bad(e.to_string().replace("--compliant", "compliant")))?
            .knowing(known.as_deref().map(KnownParameters::load).transpose()?.unwrap_or_default());
        let asked = Asked { joints, set, choice, folds, hold_out_last, keep_outliers };
        task.step(0.0, "reading")?;
        if known.is_none()
            && let Some(stream) = stream(&recordings, robot.dof(), &asked, in_stream)?
        {
            return in_passes(&robot, &cell, &stream, &asked, task);
        }
        let recordings = read_all(&recordings, robot.dof())?;
        task.step(0.05, "looking for gross errors")?;
        let data = clean(&robot, &cell, &recordings, joints, set, keep_outliers)?;
        let found = in_memory(&robot, &cell, &data, &asked, task)?;
        task.step(1.0, "done")?;
        Ok(found)
    })?;
    let errors = found.errors_mm.map(|e| e.into_pyarray(py));
    let told = PyTold(Kept::Fitted(Box::new(found.fitted)));
    Ok((PyModel::new(found.file)?, found.summary.to_string(), errors, found.covariance.into_pyarray(py), told))
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
    let said = json!({
        "effect": undecided.finding.effect,
        "site": undecided.finding.site,
        "explanations": undecided.names,
        "lambda": next.lambda,
        "random_lambda": next.random_lambda,
    });
    Ok(Some((next, said)))
}

/// The extended model, the JSON of `docs/formats.md`, position errors before and after (n, 2) in mm, deciding touches with JSON, what the
/// report is made of.
type Diagnosed<'py> = (PyModel, String, Bound<'py, PyArray2<f64>>, Option<(Touches<'py>, String)>, PyTold);

/// Diagnoses.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the keywords of trical.diagnose")]
pub fn _diagnose<'py>(
    py: Python<'py>,
    recordings: Vec<RecordingArgument>,
    robot: RobotArgument,
    cell: CellArgument,
    joints: &str,
    names_only: bool,
    next: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> Result<Diagnosed<'py>> {
    let joints = source(joints)?;
    let (robot, cell) = read(&robot, &cell)?;
    if next.is_some() && cell.balls.is_empty() {
        return Err(bad("next: found no [balls] in the cell, expected balls that can be touched").into());
    }
    if next.is_some_and(|n| !(1..=1000).contains(&n)) {
        return Err(bad("next: expected 1 to 1000 touches").into());
    }
    let (file, text, errors, planned, told) = long(py, progress, |task| -> Result<_> {
        let recordings = read_all(&recordings, robot.dof())?;
        let (found, source) =
            diagnose_recordings(&robot, &cell, &recordings, joints, names_only, &mut |f, what| task.report(f, what))?;
        let mut value = serde_json::to_value(&found)?;
        value["recordings"] = json!(found.data.names);
        value["joints"] = json!(source);
        let errors =
            |model| -> Result<Vec<f64>> { Ok(position_errors(&Forward::new(model, Vec::new())?, &found.data)) };
        let pairs = pairs_mm(&errors(found.before.clone())?, &errors(found.model.clone())?);
        let planned = match next {
            Some(count) => next_touches(&robot, &cell, &found, count, task)?,
            None => None,
        };
        let file = ModelFile {
            model: found.model.clone(),
            joints: source,
            references: found.data.references.clone(),
            recordings: found.data.names.clone(),
        };
        Ok((file, value.to_string(), pairs, planned, Kept::Diagnosed(Box::new((found, source)))))
    })?;
    let planned = planned.map(|(next, said)| (touches(py, &robot, &next.entries), said.to_string()));
    Ok((PyModel::new(file)?, text, errors.into_pyarray(py), planned, PyTold(told)))
}

/// Scores a model; returns a JSON summary, position errors before and after (n, 2) in mm, and what the report is made of.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "keywords of the public function")]
pub fn _validate<'py>(
    py: Python<'py>,
    model: &Bound<'py, PyModel>,
    recordings: Vec<RecordingArgument>,
    robot: RobotArgument,
    cell: CellArgument,
    joints: Option<&str>,
    refit: Vec<String>,
    progress: Option<Py<PyAny>>,
) -> Result<(String, Bound<'py, PyArray2<f64>>, PyTold)> {
    let file = model.get().file.clone();
    let joints = joints.map(source).transpose()?.flatten().unwrap_or(file.joints);
    if let Some(other) = refit.iter().find(|w| !["frame", "targets"].contains(&w.as_str())) {
        return Err(bad(format!("refit holds '{other}', expected 'frame' and perhaps 'targets'")).into());
    }
    let has = |what: &str| refit.iter().any(|w| w == what);
    let again = refit.clone();
    let refit = (!refit.is_empty()).then(|| Refit { frame: has("frame"), targets: has("targets") });
    let (text, errors, told) = long(py, progress, |task| -> Result<_> {
        let (robot, cell) = read(&robot, &cell)?;
        file.require_robot(&robot, "the model")?;
        task.step(0.0, "reading")?;
        let recordings = read_all(&recordings, robot.dof())?;
        let known = refit.is_none().then_some(file.references.as_slice());
        let data = Dataset::build(&recordings, joints, known)?;
        task.step(0.3, "scoring")?;
        let v = validate(&robot, &cell, &file.model, &data, refit)?;
        let mut value = serde_json::to_value(&v)?;
        value["rejected"] = json!(data.rejected);
        let (before, after): (Vec<f64>, Vec<f64>) = v.errors.iter().copied().unzip();
        task.step(1.0, "done")?;
        let told = Kept::Scored(Box::new((v, file, again, data.rejected)));
        Ok((value.to_string(), pairs_mm(&before, &after), told))
    })
    .map_err(|e| in_python_words(py, e))?;
    Ok((text, errors.into_pyarray(py), PyTold(told)))
}

/// Options of the command line by their names in Python.
fn in_python_words(py: Python<'_>, e: PyErr) -> PyErr {
    let text = e.value(py).to_string();
    if text.contains("--refit frame") {
        let said = text.replace("--refit frame (or frame,targets)", "refit=\"frame\" (or \"frame,targets\")");
        return PyErr::from_type(e.get_type(py), said);
    }
    e
}

/// How far repeat visits scatter, as JSON text.
#[pyfunction]
pub fn _repeatability(
    py: Python<'_>,
    recording: &Bound<'_, PyRows>,
    robot: Option<RobotArgument>,
    cell: Option<CellArgument>,
    same: f64,
) -> Result<String> {
    if !(same > 0.0 && same.is_finite()) {
        return Err(bad(format!("same is {same}, expected a positive angle in rad")).into());
    }
    let recording = recording.get().0.clone();
    py.detach(|| {
        let robot = robot.map(|r| r.read()).transpose()?;
        let cell = cell.map(|c| c.read()).transpose()?;
        Ok(serde_json::to_string(&repeatability(&recording, robot, cell, same)?)?)
    })
}

/// The catalogue of effects as JSON text.
#[pyfunction]
pub fn _effects_json() -> String {
    serde_json::to_string(&EFFECTS).unwrap_or_default()
}
