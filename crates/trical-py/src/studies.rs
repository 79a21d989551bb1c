//! Whole calibrations by simulation.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use trical_report::study::{Common, Platforms, Study, platforms, touches};

use crate::arguments::{keywords, parameter_set};
use crate::designs::criterion;
use crate::errors::Result;
use crate::interruptible::interruptible;
use crate::machine::{Machine, read};
use crate::outcome::{Outcome, PyOutcome};

/// Keywords that all studies share.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct CommonKeywords {
    trials: u64,
    seed: u64,
    pool: usize,
    criterion: String,
    model: String,
    length_mm: f64,
    angle_deg: f64,
    compliance_deg_per_nm: Vec<f64>,
    indicator_mm: f64,
    procedure_mm: f64,
    ballbar_mm: f64,
}

impl CommonKeywords {
    fn read(self) -> PyResult<Common> {
        let (criterion, whole_workspace) = criterion(&self.criterion)?;
        Ok(Common {
            trials: self.trials,
            seed: self.seed,
            pool: self.pool,
            criterion,
            whole_workspace,
            set: parameter_set(&self.model)?,
            length_mm: self.length_mm,
            angle_deg: self.angle_deg,
            compliance_deg_per_nm: self.compliance_deg_per_nm,
            indicator_mm: self.indicator_mm,
            procedure_mm: self.procedure_mm,
            ballbar_mm: self.ballbar_mm,
        })
    }
}

/// Keywords of `trical.study_platforms` beside them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct PlatformKeywords {
    touches: usize,
    balls: Vec<usize>,
    side_mm: Vec<f64>,
    height_mm: Vec<f64>,
    raise_mm: Vec<f64>,
}

/// What its report is made of; table, CSV, SVG, verdict, notes, JSON text.
type Answer = (PyOutcome, Vec<Vec<String>>, String, String, String, Vec<String>, String);

fn for_python(study: Study) -> Answer {
    let Study { table, csv, svg, verdict, notes, json, .. } = &study;
    let (table, csv, svg) = (table.clone(), csv.clone(), svg.clone());
    let (verdict, notes, json) = (verdict.clone(), notes.clone(), json.to_string());
    (PyOutcome(Outcome::Studied(Box::new(study))), table, csv, svg, verdict, notes, json)
}

/// Error against the number of touches.
#[pyfunction]
pub fn _study_touches(
    py: Python<'_>,
    machine: Machine,
    per_ball: Vec<usize>,
    given: &Bound<'_, PyDict>,
    progress: Option<Py<PyAny>>,
) -> Result<Answer> {
    let common = keywords::<CommonKeywords>(given)?.read()?;
    let (robot, cell) = read(&machine)?;
    Ok(for_python(interruptible(py, progress, |task| touches(&robot, &cell, &common, &per_ball, task))?))
}

/// Platforms of balls compared.
#[pyfunction]
pub fn _study_platforms(
    py: Python<'_>,
    machine: Machine,
    given: &Bound<'_, PyDict>,
    progress: Option<Py<PyAny>>,
) -> Result<Answer> {
    let common = keywords::<CommonKeywords>(given)?.read()?;
    let PlatformKeywords { touches, balls, side_mm, height_mm, raise_mm } = keywords(given)?;
    let (robot, cell) = read(&machine)?;
    let asked = Platforms { touches, balls, side_mm, height_mm, raise_mm };
    Ok(for_python(interruptible(py, progress, |task| platforms(&robot, &cell, &common, &asked, task))?))
}
