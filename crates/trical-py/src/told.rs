//! What a report is made of, kept with a result until somebody asks for the report.

use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use trical_diagnose::Diagnosis;
use trical_ident::{Calibration, JointSource, ModelFile, Validation, write_whole};
use trical_model::{Cell, Robot};
use trical_report::study::Study;
use trical_report::{Made, certificate, diagnosis_report, identify_report, plan_report, plan_told, validate_report};

use crate::errors::{Result, bad};
use crate::long::long;

/// What was worked out, of whichever kind.
pub enum Kept {
    /// By `identify`.
    Fitted(Box<Calibration>),
    /// By `validate`: what was scored, the model's file.
    Scored(Box<(Validation, ModelFile)>),
    /// By `diagnose`.
    Diagnosed(Box<(Diagnosis, JointSource)>),
    /// By `plan`.
    Planned(Box<(Robot, Cell, plan_told::Told)>),
    /// By a study.
    Studied(Box<Study>),
}

impl Kept {
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

/// What a report is made of.
#[pyclass(name = "Told", module = "trical._native", frozen)]
pub struct PyTold(pub Kept);

#[pymethods]
impl PyTold {
    /// Writes the certificate of a calibration or a validation: one page, made by `call` from `inputs`.
    fn certify(&self, py: Python<'_>, path: PathBuf, call: String, inputs: Vec<PathBuf>) -> Result<()> {
        long(py, None, |_| -> Result<()> {
            let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
            let made = Made::by(call, &inputs);
            let html = match &self.0 {
                Kept::Fitted(f) => certificate::of_calibration(f, &made)?,
                Kept::Scored(s) => certificate::of_validation(&s.0, &made)?,
                _ => return Err(bad("a certificate is of an identification or a validation").into()),
            };
            Ok(write_whole(&path, html.as_bytes())?)
        })?;
        Ok(())
    }

    /// Writes the report: one HTML file, whole or not at all, that says it was made by `call` from `inputs`.
    fn write(&self, py: Python<'_>, path: PathBuf, call: String, inputs: Vec<PathBuf>) -> Result<()> {
        long(py, None, |_| -> Result<()> {
            let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
            let html = self.0.html(Made::by(call, &inputs))?;
            Ok(write_whole(&path, html.as_bytes())?)
        })?;
        Ok(())
    }
}
