//! Programs rewritten by a model.

use std::path::PathBuf;

use pyo3::prelude::*;
use trical_device::program::{Job, Options, ProgramError};
use trical_model::Model;

use crate::errors::{Result, bad};
use crate::machine::{CellArgument, RobotArgument, read};
use crate::model::PyModel;

#[expect(clippy::needless_pass_by_value, reason = "used with map_err")]
fn program_error(e: ProgramError) -> PyErr {
    bad(e.to_string())
}

/// Rewrites a program file; returns the command's JSON.
#[pyfunction]
#[pyo3(signature = (program, model, out, robot, cell, dialect, frames, partial, tool, frame, temp_c, time_s, payload_kg, any_configuration, own_base))]
#[expect(clippy::too_many_arguments, reason = "the keywords of trical.compensate")]
pub fn _compensate(
    py: Python<'_>,
    program: PathBuf,
    model: &Bound<'_, PyModel>,
    out: Option<PathBuf>,
    robot: RobotArgument,
    cell: CellArgument,
    dialect: Option<String>,
    frames: Vec<PathBuf>,
    partial: bool,
    tool: Option<String>,
    frame: Option<String>,
    temp_c: Option<f64>,
    time_s: Option<f64>,
    payload_kg: Option<f64>,
    any_configuration: bool,
    own_base: bool,
) -> Result<String> {
    let (robot, cell) = read(&robot, &cell)?;
    let nominal = Model::nominal(robot, cell);
    let file = model.get().file.clone();
    file.require_robot(&nominal.robot, "the model")?;
    let options = Options {
        model_name: "a model in Python".into(),
        tool,
        frame,
        temp_c,
        time_s,
        payload_kg,
        configuration_off: any_configuration,
        own_base,
        details: out.is_none(),
    };
    let job = Job { program: &program, out: out.as_deref(), dialect: dialect.as_deref(), frames: &frames, partial };
    let dialect = job.dialect().map_err(program_error)?;
    let report = py.detach(|| job.run(&nominal, &file.model, &options)).map_err(program_error)?;
    Ok(report.json(dialect).to_string())
}
