//! A cell to measure in without hardware.

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use trical_device::virtual_cell::{Unsettled, fault_script};
use trical_device::{ArmPlant, CellOptions, VirtualCell};
use trical_diagnose::truth::{draw_truth, hide};
use trical_ident::{ModelFile, model_of_touches, usual_set};
use trical_model::MAX_JOINTS;

use crate::arguments::keywords;
use crate::arrays::{PoseArrays, one_pose, pose_arrays};
use crate::errors::{Result, bad};
use crate::machine::{Machine, read};
use crate::model::PyModel;

/// A robot, balls and indicators that answer on a pseudo-terminal and a TCP port of this computer, until `stop`.
///
/// `trical.virtual_cell` starts one. In a `with` block it is stopped at the end. Everything that reaches it goes through the real
/// drivers: `measure`, `Gauge` and `Controller` take its URLs.
#[pyclass(name = "VirtualCell", module = "trical", frozen)]
pub struct PyVirtualCell {
    running: Mutex<Option<VirtualCell>>,
    truth: ModelFile,
    gauge: String,
    controller: String,
}

impl PyVirtualCell {
    fn lock(&self) -> MutexGuard<'_, Option<VirtualCell>> {
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn ask<T: Send>(&self, py: Python<'_>, f: impl FnOnce(&VirtualCell) -> T + Send) -> PyResult<T> {
        py.detach(|| self.lock().as_ref().map(f)).ok_or_else(|| bad("this virtual cell was stopped"))
    }
}

#[pymethods]
impl PyVirtualCell {
    /// URL of its gauge, for `measure` and `Gauge`.
    #[getter]
    fn gauge(&self) -> &str {
        &self.gauge
    }

    /// URL of its controller, for `measure` and `Controller`.
    #[getter]
    fn controller(&self) -> &str {
        &self.controller
    }

    /// The true arm: what identification should find and must not know.
    #[getter]
    fn truth(&self) -> Result<PyModel> {
        PyModel::new(self.truth.clone())
    }

    /// Whether it answers.
    #[getter]
    fn running(&self, py: Python<'_>) -> bool {
        py.detach(|| self.lock().as_ref().is_some_and(VirtualCell::is_running))
    }

    /// Number of motions so far.
    #[getter]
    fn motions(&self, py: Python<'_>) -> PyResult<u64> {
        self.ask(py, VirtualCell::motions)
    }

    /// Joints at which the arm stands, as its controller reports them: (joints,), rad (m).
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let n = self.truth.model.robot.dof();
        let q = self.ask(py, |cell| cell.state().q)?;
        Ok(q[..n].to_vec().into_pyarray(py))
    }

    /// True pose of the tool in the world: position (3,) m and rotation (3, 3), as a perfect tracker would measure it.
    #[getter]
    fn tool<'py>(&self, py: Python<'py>) -> PyResult<PoseArrays<'py>> {
        Ok(pose_arrays(py, &self.ask(py, VirtualCell::true_tcp)?))
    }

    /// Stops it; its addresses answer no more. Calling it again does nothing.
    fn stop(&self, py: Python<'_>) {
        py.detach(|| drop(self.lock().take()));
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __exit__(
        &self,
        py: Python<'_>,
        _kind: Option<&Bound<'_, PyAny>>,
        _value: Option<&Bound<'_, PyAny>>,
        _trace: Option<&Bound<'_, PyAny>>,
    ) {
        self.stop(py);
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let name = &self.truth.model.robot.name;
        if self.running(py) {
            format!("<trical.VirtualCell of {name}: gauge {}, controller {}>", self.gauge, self.controller)
        } else {
            format!("<trical.VirtualCell of {name}: stopped>")
        }
    }
}

/// Keywords of `trical.virtual_cell`.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct CellKeywords<'py> {
    truth: Option<Bound<'py, PyModel>>,
    seed: u64,
    hide: Vec<String>,
    port: u16,
    gauge_port: Option<u16>,
    faults: Option<PathBuf>,
    pace: f64,
    radio_delay: f64,
    unsettled: Option<[f64; 3]>,
    noise: f64,
    placement: f64,
    start: Option<Bound<'py, PyAny>>,
}

/// Starts a virtual cell.
#[pyfunction]
pub fn _virtual_cell(py: Python<'_>, machine: Machine, given: &Bound<'_, PyDict>) -> Result<PyVirtualCell> {
    let given: CellKeywords<'_> = keywords(given)?;
    for (name, value, most, unit) in [
        ("pace", given.pace, 100.0, ""),
        ("radio_delay", given.radio_delay, 60.0, " s"),
        ("noise", given.noise, 0.01, " m"),
        ("placement", given.placement, 0.01, " m"),
    ] {
        if !(0.0..=most).contains(&value) {
            return Err(bad(format!("{name} is {value}, expected 0 to {most}{unit}")).into());
        }
    }
    let unsettled = match given.unsettled {
        None => None,
        Some([joint, indicator, time]) if time > 0.0 => Some(Unsettled { joint, indicator, time }),
        Some([.., time]) => {
            return Err(bad(format!("unsettled has a time constant of {time} s, expected more than 0")).into());
        }
    };
    let (robot, cell) = read(&machine)?;
    let start = match &given.start {
        None => [0.0; MAX_JOINTS],
        Some(q) => one_pose(q, &robot)?,
    };
    let truth = given.truth.map(|t| t.get().file.clone());
    let CellKeywords { seed, hide: hidden, port, gauge_port, faults, pace, radio_delay, noise, placement, .. } = given;
    py.detach(|| {
        let mut truth = match truth {
            Some(file) => {
                file.require_robot(&robot, "truth")?;
                file.model
            }
            None => draw_truth(&model_of_touches(&robot, &cell, usual_set(&robot))?, seed)?,
        };
        hide(&mut truth, &hidden)?;
        let options = CellOptions {
            gauge_port,
            pace,
            radio_delay,
            unsettled,
            noise,
            placement,
            start,
            script: faults.as_deref().map(fault_script::load).transpose()?.unwrap_or_default(),
            ..CellOptions::like_a_real_one(&truth, seed, port)
        };
        let running = VirtualCell::start(Box::new(ArmPlant::new(&truth)?), options)?;
        let (gauge, controller) = (running.gauge_url(), running.controller_url());
        let truth = ModelFile::unmeasured(truth);
        Ok(PyVirtualCell { running: Mutex::new(Some(running)), truth, gauge, controller })
    })
}
