//! What a report is made of, kept with a result until somebody asks for the report.

use std::path::{Path, PathBuf};

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use trical_diagnose::Diagnosis;
use trical_ident::{Calibration, JointSource, ModelFile, Validation};
use trical_model::{Cell, Robot};
use trical_recording::output;
use trical_report::study::Study;
use trical_report::{Made, certificate, diagnosis_report, identify_report, plan_report, plan_summary, validate_report};

use crate::errors::{Result, bad, check, write};
use crate::interruptible::interruptible;

/// What was worked out, of whichever kind.
pub enum Outcome {
    /// By `identify`.
    Fitted(Box<Calibration>),
    /// By `validate`: what was scored, the model's file.
    Scored(Box<(Validation, ModelFile)>),
    /// By `diagnose`.
    Diagnosed(Box<(Diagnosis, JointSource)>),
    /// By `plan`.
    Planned(Box<(Robot, Cell, plan_summary::PlanSummary)>),
    /// By a study.
    Studied(Box<Study>),
}

impl Outcome {
    fn html(&self, made: Made) -> trical_report::Result<String> {
        match self {
            Self::Fitted(f) => identify_report::render(f, made),
            Self::Scored(s) => validate_report::render(&s.0, &s.1, made),
            Self::Diagnosed(d) => diagnosis_report::render(&d.0, d.1, made),
            Self::Planned(p) => plan_report::render(&p.0, &p.1, &p.2, &made),
            Self::Studied(s) => s.html(&made),
        }
    }
}

/// Refuses a page whose name says another format, or that cannot be written there.
fn page(path: &Path, inputs: &[PathBuf]) -> Result<()> {
    match path.extension() {
        Some(found) if !["html", "htm"].iter().any(|e| found.eq_ignore_ascii_case(e)) => Err(bad(format!(
            "path is {}, expected a name that ends in .html; a browser prints it as PDF",
            path.display()
        ))
        .into()),
        _ => Ok(check(output::check_no_recording(path, inputs.iter().map(PathBuf::as_path)))?),
    }
}

/// What a report is made of.
#[pyclass(name = "Outcome", module = "trical._native", frozen)]
pub struct PyOutcome(pub Outcome);

/// What is drawn of a finding: label of x, label of the errors, x, errors without and with it.
type Drawn<'py> =
    (String, &'static str, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

#[pymethods]
impl PyOutcome {
    /// A finding (from 0) of a diagnosis against the variable that reveals it, one value for each observation.
    fn finding<'py>(&self, py: Python<'py>, number: usize) -> Result<Drawn<'py>> {
        let Outcome::Diagnosed(d) = &self.0 else { return Err(bad("expected a diagnosis").into()) };
        let Some(f) = d.0.findings.get(number) else {
            return Err(bad(format!("found no finding {}, there are {}", number + 1, d.0.findings.len())).into());
        };
        let drawn = diagnosis_report::against(f, &d.0)?;
        let array = |v: Vec<f64>| v.into_pyarray(py);
        Ok((drawn.label, drawn.error, array(drawn.x), array(drawn.without), array(drawn.with)))
    }

    /// Joints at each observation that was fitted, (n, joints), rad (m for a joint that slides).
    fn joint_values<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyArray2<f64>>> {
        let (data, dof) = match &self.0 {
            Outcome::Fitted(f) => (&f.fitted.data, f.fitted.model.robot.dof()),
            Outcome::Diagnosed(d) => (&d.0.data, d.0.model.robot.dof()),
            _ => return Err(bad("expected an identification or a diagnosis").into()),
        };
        let o = &data.observations;
        Ok(Array2::from_shape_fn((o.len(), dof), |(k, j)| o[k].state.q[j]).into_pyarray(py))
    }

    /// Which of these joints slide, (joints,).
    fn slides(&self) -> Result<Vec<bool>> {
        let robot = match &self.0 {
            Outcome::Fitted(f) => &f.fitted.model.robot,
            Outcome::Diagnosed(d) => &d.0.model.robot,
            _ => return Err(bad("expected an identification or a diagnosis").into()),
        };
        Ok((1..=robot.dof()).map(|joint| robot.slides(joint)).collect())
    }

    /// Writes the certificate of a calibration or a validation: one page, made by `call` from `inputs`.
    fn certify(&self, py: Python<'_>, path: PathBuf, call: String, inputs: Vec<PathBuf>) -> Result<()> {
        page(&path, &inputs)?;
        interruptible(py, None, |_| -> Result<()> {
            let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
            let made = Made::by(call, &inputs);
            let html = match &self.0 {
                Outcome::Fitted(f) => certificate::of_calibration(f, &made)?,
                Outcome::Scored(s) => certificate::of_validation(&s.0, &made)?,
                _ => return Err(bad("a certificate is of an identification or a validation").into()),
            };
            Ok(write(&path, html.as_bytes())?)
        })?;
        Ok(())
    }

    /// Writes the report: one HTML file, whole or not at all, that says it was made by `call` from `inputs`.
    fn write(&self, py: Python<'_>, path: PathBuf, call: String, inputs: Vec<PathBuf>) -> Result<()> {
        page(&path, &inputs)?;
        interruptible(py, None, |_| -> Result<()> {
            let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
            let html = self.0.html(Made::by(call, &inputs))?;
            Ok(write(&path, html.as_bytes())?)
        })?;
        Ok(())
    }
}
