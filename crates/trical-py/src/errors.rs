//! Errors as Python knows them: one exception for each thing that a program may want to catch.

use pyo3::create_exception;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use trical_device::record::RecordError;
use trical_ident::{ChoiceError, IdentError};
use trical_model::{IkError, ModelError};
use trical_plan::PlanError;

create_exception!(trical, TricalError, PyValueError, "Bad input; the message is one sentence.");
create_exception!(trical, RecordingError, TricalError, "A recording cannot be read, or holds what makes no sense.");
create_exception!(trical, NotEnoughDataError, TricalError, "The recordings do not hold enough for what was asked.");
create_exception!(trical, WrongModelError, TricalError, "A model file is none, or does not fit robot or recordings.");
create_exception!(
    trical,
    PlanningError,
    TricalError,
    "There is no such plan: what was asked cannot be had in this cell."
);
create_exception!(trical, UnreachableError, TricalError, "The arm cannot take a pose.");
create_exception!(trical, NotConvergedError, PyRuntimeError, "A fit did not reach a minimum.");

/// Any error of the libraries on its way to Python.
pub struct Failed(PyErr);

impl From<Failed> for PyErr {
    fn from(e: Failed) -> Self {
        e.0
    }
}

impl From<PyErr> for Failed {
    fn from(e: PyErr) -> Self {
        Self(e)
    }
}

impl From<ModelError> for Failed {
    fn from(e: ModelError) -> Self {
        Self(TricalError::new_err(e.to_string()))
    }
}

impl From<ChoiceError> for Failed {
    fn from(e: ChoiceError) -> Self {
        Self(TricalError::new_err(e.to_string()))
    }
}

impl From<IdentError> for Failed {
    fn from(e: IdentError) -> Self {
        let text = e.to_string();
        Self(match e {
            IdentError::Recording { .. } | IdentError::File { .. } => RecordingError::new_err(text),
            IdentError::NotEnough(_) => NotEnoughDataError::new_err(text),
            IdentError::NotConverged(_) => NotConvergedError::new_err(text),
            IdentError::WrongModel(_) => WrongModelError::new_err(text),
            IdentError::Model(_) => TricalError::new_err(text),
        })
    }
}

impl From<RecordError> for Failed {
    fn from(e: RecordError) -> Self {
        Self(RecordingError::new_err(e.to_string()))
    }
}

impl From<PlanError> for Failed {
    fn from(e: PlanError) -> Self {
        Self(PlanningError::new_err(e.to_string()))
    }
}

impl From<IkError> for Failed {
    fn from(e: IkError) -> Self {
        Self(UnreachableError::new_err(e.to_string()))
    }
}

impl From<trical_report::Error> for Failed {
    fn from(e: trical_report::Error) -> Self {
        use trical_report::Error;
        match e {
            Error::Model(e) => e.into(),
            Error::Ident(e) => e.into(),
            Error::Plan(e) => e.into(),
            Error::Input(text) => Self(TricalError::new_err(text)),
            Error::Failed(text) => Self(PyRuntimeError::new_err(text)),
        }
    }
}

impl From<serde_json::Error> for Failed {
    fn from(e: serde_json::Error) -> Self {
        Self(PyRuntimeError::new_err(e.to_string()))
    }
}

/// Bad input, in one sentence.
pub fn bad(text: impl Into<String>) -> PyErr {
    TricalError::new_err(text.into())
}

/// Results on their way to Python.
pub type Result<T> = std::result::Result<T, Failed>;

/// Adds the exceptions to the module.
pub fn add(m: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = m.py();
    m.add("TricalError", py.get_type::<TricalError>())?;
    m.add("RecordingError", py.get_type::<RecordingError>())?;
    m.add("NotEnoughDataError", py.get_type::<NotEnoughDataError>())?;
    m.add("WrongModelError", py.get_type::<WrongModelError>())?;
    m.add("PlanningError", py.get_type::<PlanningError>())?;
    m.add("UnreachableError", py.get_type::<UnreachableError>())?;
    m.add("NotConvergedError", py.get_type::<NotConvergedError>())
}
