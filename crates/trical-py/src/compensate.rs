//! Programs rewritten by a model.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use trical_ident::Expected;
use trical_model::{Model, State};
use trical_program::{Job, Options, ProgramError, Spelling};
use trical_recording::output;

use crate::arguments::keywords;
use crate::errors::{Failed, Result, bad, check};
use crate::interruptible::interruptible;
use crate::machine::{Machine, read};
use crate::model::PyModel;

/// A setting of the libraries by its name in Python.
fn as_keyword(setting: &str, _: &str) -> String {
    match setting {
        "partial" | "any_configuration" | "own_base" => format!("{setting}=True"),
        "check" => "without out, problems".into(),
        _ => setting.into(),
    }
}

impl From<ProgramError> for Failed {
    fn from(e: ProgramError) -> Self {
        match e {
            ProgramError::NoDialect { .. } => bad(format!("{e}; dialect says it")).into(),
            _ => bad(e.to_string()).into(),
        }
    }
}

fn within(name: &str, value: Option<f64>, from: f64, to: f64) -> PyResult<()> {
    match value {
        Some(v) if !(from..=to).contains(&v) => Err(bad(format!("{name} is {v}, expected {from} to {to}"))),
        _ => Ok(()),
    }
}

/// Keywords of `trical.compensate`, and the file of its model.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct CompensateKeywords {
    model: Option<PathBuf>,
    out: Option<PathBuf>,
    dialect: Option<String>,
    frames: Vec<PathBuf>,
    partial: bool,
    tool: Option<String>,
    frame: Option<String>,
    temp_c: Option<f64>,
    time_s: Option<f64>,
    seq: Option<f64>,
    session: Option<String>,
    payload_kg: Option<f64>,
    any_configuration: bool,
    own_base: bool,
}

/// Rewrites a program file; returns the command's JSON.
#[pyfunction]
pub fn _compensate(
    py: Python<'_>,
    program: PathBuf,
    model: &Bound<'_, PyModel>,
    machine: Machine,
    given: &Bound<'_, PyDict>,
) -> Result<String> {
    let given: CompensateKeywords = keywords(given)?;
    if let Some(out) = &given.out {
        let machine = [machine.0.file(), machine.1.file()];
        let read = [Some(&program), given.model.as_ref()].into_iter().chain(machine.iter().map(Option::as_ref));
        check(output::check_no_recording(out, read.flatten().chain(&given.frames).map(PathBuf::as_path)))?;
    }
    let CompensateKeywords { temp_c, payload_kg, .. } = given;
    within("temp_c", temp_c, -100.0, 200.0)?;
    within("payload_kg", payload_kg, 0.0, 1e4)?;
    within("time_s", given.time_s, 0.0, 1e9)?;
    within("seq", given.seq, 0.0, 1e9)?;
    let (robot, cell) = read(&machine)?;
    let nominal = Model::nominal(robot, cell);
    let file = model.get().file.clone();
    file.require_robot(&nominal.robot, "the model")?;
    let options = Options {
        model_name: given.model.map_or_else(|| "a model in Python".into(), |path| path.display().to_string()),
        tool: given.tool,
        frame: given.frame,
        temp_c,
        time_s: given.time_s,
        seq: given.seq,
        session: given.session,
        sessions: file.recordings().into_iter().map(Into::into).collect(),
        payload_kg,
        any_configuration: given.any_configuration,
        own_base: given.own_base,
        details: given.out.is_none(),
        spelling: Spelling(as_keyword),
        visited: file.visited(),
    };
    let job = Job {
        program: &program,
        out: given.out.as_deref(),
        dialect: given.dialect.as_deref(),
        frames: &given.frames,
        partial: given.partial,
    };
    let dialect = job.dialect()?;
    let mut report = interruptible(py, None, |_| job.run(&nominal, &file.model, &options))?;
    if let Some(expected) = Expected::of(&file)? {
        report.expect(|q| expected.deviation(&State { temp_c, payload_kg, ..State::at(q) }));
    }
    Ok(report.json(dialect).to_string())
}
