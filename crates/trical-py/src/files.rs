//! Files from and for other programs.

use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Value, json};
use trical_model::urdf::UrdfPath;
use trical_recording::{is_mcap, open_damaged, output, read_recording};
use trical_report::{Export, Outputs};

use crate::arguments::keywords;
use crate::errors::{Result, bad, check, write};
use crate::interruptible::interruptible;
use crate::machine::{PyCell, PyRobot, RobotArgument};
use crate::model::PyModel;
use crate::rows::save;

/// A recording from CSV to MCAP or back, an arm from URDF to robot.toml; returns the command's JSON.
#[pyfunction]
pub fn _convert(py: Python<'_>, input: PathBuf, output: PathBuf, joints: Option<usize>) -> Result<String> {
    check(output::check_output(&output, [input.as_path()]))?;
    let said = interruptible(py, None, |_| -> Result<Value> {
        if let Some(source) = UrdfPath::of(&input) {
            let arm = source.load()?;
            if output.extension().is_none_or(|e| e != "toml") {
                return Err(bad(format!("{}: an arm is written as .toml", output.display())).into());
            }
            write(&output, arm.to_toml(&source.path).as_bytes())?;
            return Ok(json!({ "joints": arm.robot.joint_names, "root": arm.root, "tip": arm.tip, "out": output }));
        }
        let (recording, lost) = open_damaged(&input, joints)?;
        save(&recording, &output)?;
        Ok(json!({ "rows": recording.rows.len(), "joints": recording.joints, "lost": lost, "out": output }))
    })?;
    Ok(said.to_string())
}

/// Keywords of `trical.export`.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct ExportKeywords {
    robot: Option<RobotArgument>,
    urdf: Option<PathBuf>,
    mdh: Option<PathBuf>,
    error_map: Option<PathBuf>,
    ur_kinematics: Option<PathBuf>,
    poses: usize,
}

/// Writes a model, of the file `path` where it is of one, for other programs; returns the command's JSON.
#[pyfunction]
pub fn _export(
    py: Python<'_>,
    model: &Bound<'_, PyModel>,
    path: Option<PathBuf>,
    given: &Bound<'_, PyDict>,
) -> Result<String> {
    let ExportKeywords { robot, urdf, mdh, error_map, ur_kinematics, poses } = keywords(given)?;
    let outs = [("urdf", &urdf), ("mdh", &mdh), ("error_map", &error_map), ("ur_kinematics", &ur_kinematics)];
    let outs: Vec<(&str, &Path)> = outs.iter().filter_map(|(name, out)| Some((*name, out.as_deref()?))).collect();
    output::check_apart(&outs).map_err(bad)?;
    let arm = match &robot {
        Some(RobotArgument::Path(path)) => Some(path.as_path()),
        _ => None,
    };
    for (_, out) in &outs {
        check(output::check_no_recording(out, path.as_deref().into_iter().chain(arm)))?;
    }
    if !(1..=1_000_000).contains(&poses) {
        return Err(bad(format!("poses is {poses}, expected 1 to 1000000")).into());
    }
    let file = model.get().file.clone();
    let given = arm.and_then(UrdfPath::of);
    let name = path.map_or_else(|| "a model in Python".to_owned(), |path| path.display().to_string());
    if let Some(robot) = robot {
        file.require_robot(&robot.read()?, &name)?;
    }
    let said = interruptible(py, None, |_| -> Result<Value> {
        let arm = Export::of(&file)?;
        let to = Outputs {
            urdf: urdf.as_deref(),
            ur_kinematics: ur_kinematics.as_deref(),
            mdh: mdh.as_deref(),
            error_map: error_map.as_deref(),
            poses,
        };
        let (texts, map) = arm.texts(&to, given.as_ref(), (&name, "calib_trical"))?;
        let cautions = arm.cautions(&to, given.as_ref())?;
        texts.iter().try_for_each(|(out, text)| write(out, text.as_bytes()))?;
        let written: Vec<String> = texts.iter().map(|(out, _)| out.display().to_string()).collect();
        Ok(arm.json(&written, map.as_ref(), &cautions))
    })?;
    Ok(said.to_string())
}

/// Arm and cell inside an MCAP recording, where they are.
#[pyfunction]
pub fn _inside(path: PathBuf) -> Result<(Option<PyRobot>, Option<PyCell>)> {
    if !is_mcap(&path)? {
        return Ok((None, None));
    }
    let (robot, cell) = read_recording(&path)?.arm_and_cell(&path)?;
    Ok((robot.map(PyRobot), cell.map(PyCell)))
}
