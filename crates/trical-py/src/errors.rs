//! Errors as Python knows them: one exception for each thing that a program may want to catch.

use std::fmt;
use std::path::Path;

use pyo3::create_exception;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use trical_device::gauge::trial::StemError;
use trical_device::session::SetUpError;
use trical_device::virtual_cell::fault_script::ScriptError;
use trical_device::{CellError, ControllerError, GaugeError};
use trical_diagnose::truth::TruthError;
use trical_ident::{ChoiceError, IdentError};
use trical_model::{IkError, ModelError};
use trical_plan::PlanError;
use trical_recording::whole::write_whole;
use trical_recording::{RecordError, output};
use trical_report::effect_names;

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
create_exception!(
    trical,
    DeviceError,
    PyRuntimeError,
    "A gauge or a controller cannot be used: no port, no answer, or another one than expected."
);
create_exception!(
    trical,
    MeasuringError,
    PyRuntimeError,
    "A measurement ended before its plan; what was measured is in the recording, and the message says where the arm is."
);
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

/// Errors that are one exception, whatever they say.
macro_rules! raised {
    ($($error:ty => $exception:ident),* $(,)?) => {
        $(impl From<$error> for Failed {
            fn from(e: $error) -> Self {
                Self($exception::new_err(e.to_string()))
            }
        })*
    };
}

raised! {
    ModelError => TricalError,
    ScriptError => TricalError,
    SetUpError => TricalError,
    CellError => DeviceError,
    PlanError => PlanningError,
    IkError => UnreachableError,
    serde_json::Error => PyRuntimeError,
}

impl From<ChoiceError> for Failed {
    fn from(e: ChoiceError) -> Self {
        Self(TricalError::new_err(format!("compliant: {e}")))
    }
}

impl From<IdentError> for Failed {
    fn from(e: IdentError) -> Self {
        let text = e.to_string();
        Self(match e {
            IdentError::Record(e) => return e.into(),
            IdentError::NotEnough(_) => NotEnoughDataError::new_err(text),
            IdentError::NotConverged(_) => NotConvergedError::new_err(text),
            IdentError::WrongModel(_) => WrongModelError::new_err(text),
            IdentError::Model(_) => TricalError::new_err(text),
        })
    }
}

impl fmt::Display for Failed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Python::attach(|py| write!(f, "{}", self.0.value(py)))
    }
}

impl From<RecordError> for Failed {
    fn from(e: RecordError) -> Self {
        match e {
            RecordError::Scratch(_) => Self(PyRuntimeError::new_err(e.to_string())),
            RecordError::Damaged { lost, complete } => {
                Self(RecordingError::new_err(format!("{lost}; part=True takes its {complete} complete measurements")))
            }
            _ => Self(RecordingError::new_err(e.to_string())),
        }
    }
}

impl From<GaugeError> for Failed {
    fn from(e: GaugeError) -> Self {
        let text = e.to_string();
        Self(if matches!(e, GaugeError::Url(_)) { TricalError::new_err(text) } else { DeviceError::new_err(text) })
    }
}

impl From<ControllerError> for Failed {
    fn from(e: ControllerError) -> Self {
        let text = e.to_string();
        Self(if matches!(e, ControllerError::Url(_)) { TricalError::new_err(text) } else { DeviceError::new_err(text) })
    }
}

impl From<StemError> for Failed {
    fn from(e: StemError) -> Self {
        match e {
            StemError::Gauge(e) => e.into(),
            e => Self(DeviceError::new_err(e.to_string())),
        }
    }
}

impl From<TruthError> for Failed {
    fn from(e: TruthError) -> Self {
        match e {
            TruthError::Ident(e) => e.into(),
            TruthError::Wish { ref wish, .. } => {
                Self(TricalError::new_err(format!("hide: {e}{}", effect_names::meant(wish))))
            }
            TruthError::OutOfReach => Self(TricalError::new_err(e.to_string())),
        }
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

/// Bad input, in one sentence.
pub fn bad(text: impl Into<String>) -> PyErr {
    TricalError::new_err(text.into())
}

/// What is wrong with the name of a file to be written, which is no recording that cannot be read.
pub fn check(fits: trical_recording::Result<()>) -> PyResult<()> {
    fits.map_err(|e| bad(e.to_string()))
}

/// Writes a file whole or not at all.
pub fn write(path: &Path, bytes: &[u8]) -> PyResult<()> {
    check(output::check_output(path, []))?;
    write_whole(path, bytes).map_err(|e| bad(format!("{}: cannot be written: {e}", path.display())))
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
    m.add("DeviceError", py.get_type::<DeviceError>())?;
    m.add("MeasuringError", py.get_type::<MeasuringError>())?;
    m.add("NotConvergedError", py.get_type::<NotConvergedError>())
}
