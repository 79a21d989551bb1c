//! What a report is made of, kept with a result until somebody asks for the report.

use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use trical_diagnose::Diagnosis;
use trical_ident::{
    ErrorSummary, Identified, JointSource, ModelFile, ParameterSet, Rejected, Validation, identify, write_whole,
};
use trical_model::{Cell, Robot};
use trical_report::study::Study;
use trical_report::{Made, diagnosis_report, identify_report, plan_report, plan_told, validate_report};

use crate::errors::Result;
use crate::long::long;

/// An identification, as its report has it.
pub struct Fitted {
    /// The fit.
    pub fitted: Identified,
    /// Errors of the nominal arm one by one, m; `None` where the rows were read in passes.
    pub each_before: Option<Vec<f64>>,
    /// Errors of all rows before and after.
    pub errors: [ErrorSummary; 2],
    /// Errors at poses that the fit did not use, each with what they are.
    pub unseen: Vec<(String, ErrorSummary)>,
    /// Measurements used.
    pub observations: usize,
    /// Rejected rows that are named.
    pub named: Vec<Rejected>,
    /// All of them.
    pub rejected: usize,
    /// Whether gross errors were looked for.
    pub cleaned: bool,
}

/// What was worked out, of whichever kind.
pub enum Kept {
    /// By `identify`.
    Fitted(Box<Fitted>),
    /// By `validate`: what was scored, the model's file, what was identified again, rejected rows.
    Scored(Box<(Validation, ModelFile, Vec<String>, Vec<Rejected>)>),
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
            Self::Fitted(f) => {
                let fitted = &f.fitted;
                let each_before = match &f.each_before {
                    Some(errors) => errors.clone(),
                    // of the sample that is drawn
                    None => {
                        let (robot, cell) = (&fitted.model.robot, &fitted.model.cell);
                        identify(robot, cell, &fitted.data, ParameterSet::Nominal)?.errors()?
                    }
                };
                let told = identify_report::Told {
                    fitted,
                    each_before: &each_before,
                    before: &f.errors[0],
                    after: &f.errors[1],
                    unseen: f.unseen.iter().map(|(what, e)| (what.clone(), e)).collect(),
                    observations: f.observations,
                    named: &f.named,
                    rejected: f.rejected,
                    cleaned: f.cleaned,
                };
                identify_report::render(&told, made)
            }
            Self::Scored(s) => validate_report::render(&s.0, &s.1, &s.2, &s.3, made),
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
