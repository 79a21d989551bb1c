//! The `trical` command that the package installs, and sample data.

use std::ffi::OsString;

use pyo3::prelude::*;

/// Runs the program with these arguments, its own name first; its exit code.
#[pyfunction]
pub fn _program(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| trical_cli::run(arguments))
}

/// Names and texts of the sample files.
#[pyfunction]
pub fn _sample() -> Vec<(&'static str, &'static str)> {
    trical_cli::SAMPLE.iter().map(|(name, text, _)| (*name, *text)).collect()
}
