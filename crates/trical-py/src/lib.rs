//! Python bindings: the same library for NumPy users. No logic that Rust lacks.
//!
//! `python/trical` wraps these in dataclasses, plots and docstrings; what begins with an underscore is for it alone.
//!
//! | module | holds |
//! |---|---|
//! | `arrays` | what NumPy users call an array |
//! | `errors`, `interruptible`, `supervised` | exceptions; the interpreter's lock, progress and Ctrl-C: of work, and of waiting for machines |
//! | `machine`, `model`, `rows` | the classes: Robot, Cell, Model, Rows (of a recording) |
//! | `fits`, `designs`, `studies`, `compensate` | the long calls |
//! | `devices`, `virtual_cell`, `measure` | gauges and controllers, a cell without hardware, the measuring procedure |
//! | `files` | from and for other programs |
//! | `program` | the `trical` command, and sample data |
//! | `outcome` | what reports are made of |

mod arguments;
mod arrays;
mod compensate;
mod designs;
mod devices;
mod errors;
mod files;
mod fits;
mod interruptible;
mod machine;
mod measure;
mod model;
mod outcome;
mod program;
mod rows;
mod studies;
mod supervised;
mod virtual_cell;

use pyo3::prelude::*;

/// The native half of the package `trical`.
#[pymodule]
fn _native(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    errors::add(m)?;
    m.add_class::<machine::PyRobot>()?;
    m.add_class::<machine::PyCell>()?;
    m.add_class::<model::PyModel>()?;
    m.add_class::<rows::PyRows>()?;
    m.add_class::<outcome::PyOutcome>()?;
    m.add_class::<devices::PyGaugeLink>()?;
    m.add_class::<devices::PyControllerLink>()?;
    m.add_class::<virtual_cell::PyVirtualCell>()?;
    m.add_function(wrap_pyfunction!(program::_program, m)?)?;
    m.add_function(wrap_pyfunction!(program::_sample, m)?)?;
    m.add_function(wrap_pyfunction!(devices::_ports, m)?)?;
    m.add_function(wrap_pyfunction!(devices::_master, m)?)?;
    m.add_function(wrap_pyfunction!(virtual_cell::_virtual_cell, m)?)?;
    m.add_function(wrap_pyfunction!(measure::_measure, m)?)?;
    m.add_function(wrap_pyfunction!(measure::_touch_here, m)?)?;
    m.add_function(wrap_pyfunction!(measure::_tool_point, m)?)?;
    m.add_function(wrap_pyfunction!(measure::_base, m)?)?;
    m.add_function(wrap_pyfunction!(files::_inside, m)?)?;
    m.add_function(wrap_pyfunction!(files::_convert, m)?)?;
    m.add_function(wrap_pyfunction!(files::_export, m)?)?;
    m.add_function(wrap_pyfunction!(fits::_identify, m)?)?;
    m.add_function(wrap_pyfunction!(fits::_diagnose, m)?)?;
    m.add_function(wrap_pyfunction!(fits::_validate, m)?)?;
    m.add_function(wrap_pyfunction!(fits::_history, m)?)?;
    m.add_function(wrap_pyfunction!(fits::_repeatability, m)?)?;
    m.add_function(wrap_pyfunction!(fits::_effects_json, m)?)?;
    m.add_function(wrap_pyfunction!(fits::_named, m)?)?;
    m.add_function(wrap_pyfunction!(compensate::_compensate, m)?)?;
    m.add_function(wrap_pyfunction!(designs::_plan, m)?)?;
    m.add_function(wrap_pyfunction!(designs::_poses, m)?)?;
    m.add_function(wrap_pyfunction!(designs::_simulate, m)?)?;
    m.add_function(wrap_pyfunction!(designs::_observability, m)?)?;
    m.add_function(wrap_pyfunction!(studies::_study_touches, m)?)?;
    m.add_function(wrap_pyfunction!(studies::_study_platforms, m)?)
}
