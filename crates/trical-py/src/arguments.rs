//! Arguments that several functions have, from Python's strings.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use trical_ident::{JointSource, ParameterSet};

use crate::errors::bad;

/// The keywords of a public function, in a dict. One that does not fit is refused by its name.
pub fn keywords<'py, T>(given: &Bound<'py, PyDict>) -> PyResult<T>
where
    T: for<'a> FromPyObject<'a, 'py, Error = PyErr>,
{
    let py = given.py();
    given.extract().map_err(|e: PyErr| {
        let Some(cause) = e.cause(py) else { return e };
        // "failed to extract field Keywords.folds"
        let text = e.to_string();
        let name = text.rsplit('.').next().unwrap_or(&text);
        PyErr::from_type(cause.get_type(py), format!("{name}: {}", cause.value(py)))
    })
}

/// A path as Python has them: text, bytes, or an object that has one.
pub fn path_of(given: &Bound<'_, PyAny>) -> PyResult<PathBuf> {
    given.py().import("os")?.call_method1("fsdecode", (given,))?.extract()
}

/// Which joint angles to use; `None` for those that the data is to choose.
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
