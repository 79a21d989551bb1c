//! Whole calibrations by simulation.

use pyo3::prelude::*;
use trical_report::study::{Common, Platforms, Study, platforms, touches};

use crate::arguments::parameter_set;
use crate::designs::criterion;
use crate::errors::Result;
use crate::long::long;
use crate::machine::{CellArgument, RobotArgument, read};
use crate::told::{Kept, PyTold};

/// What all studies share, as keywords of the public functions.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct CommonArgument {
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

impl CommonArgument {
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

/// What its report is made of; table, CSV, SVG, verdict, notes, JSON text.
type Told = (PyTold, Vec<Vec<String>>, String, String, String, Vec<String>, String);

fn told(study: Study) -> Told {
    let Study { table, csv, svg, verdict, notes, json, .. } = &study;
    let (table, csv, svg) = (table.clone(), csv.clone(), svg.clone());
    let (verdict, notes, json) = (verdict.clone(), notes.clone(), json.to_string());
    (PyTold(Kept::Studied(Box::new(study))), table, csv, svg, verdict, notes, json)
}

/// Error against the number of touches.
#[pyfunction]
pub fn _study_touches(
    py: Python<'_>,
    robot: RobotArgument,
    cell: CellArgument,
    common: CommonArgument,
    per_ball: Vec<usize>,
    progress: Option<Py<PyAny>>,
) -> Result<Told> {
    let common = common.read()?;
    let (robot, cell) = read(&robot, &cell)?;
    Ok(told(long(py, progress, |task| touches(&robot, &cell, &common, &per_ball, task))?))
}

/// Platforms of balls compared.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "keywords of the public function")]
pub fn _study_platforms(
    py: Python<'_>,
    robot: RobotArgument,
    cell: CellArgument,
    common: CommonArgument,
    touches: usize,
    balls: Vec<usize>,
    side_mm: Vec<f64>,
    height_mm: Vec<f64>,
    raise_mm: Vec<f64>,
    progress: Option<Py<PyAny>>,
) -> Result<Told> {
    let common = common.read()?;
    let (robot, cell) = read(&robot, &cell)?;
    let asked = Platforms { touches, balls, side_mm, height_mm, raise_mm };
    Ok(told(long(py, progress, |task| platforms(&robot, &cell, &common, &asked, task))?))
}
