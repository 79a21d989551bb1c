//! Gauges and controllers by their URLs: for a person with a cable in hand.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use trical_device::controller::trial::{Jog, JogError, check_speed, ping};
use trical_device::controller::wait_settled;
use trical_device::gauge::trial::{Mastering, Trial, master, stem_answers, trial};
use trical_device::gauge::{list_ports, settled_reading};
use trical_device::session::tell_arm;
use trical_device::{Controller, Gauge, open_controller, open_gauge};
use trical_model::{Cell, Joints};

use crate::arguments::keywords;
use crate::errors::{Result, bad};
use crate::machine::RobotArgument;
use crate::supervised::supervised;

/// A device that is open, or closed again.
struct Link<D: ?Sized>(Mutex<Option<Box<D>>>);

impl<D: ?Sized> Link<D> {
    fn new(device: Box<D>) -> Self {
        Self(Mutex::new(Some(device)))
    }

    fn lock(&self) -> MutexGuard<'_, Option<Box<D>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Does something with the device; it waits for what another thread does with it.
    fn with<T>(&self, what: &str, f: impl FnOnce(&mut D) -> Result<T>) -> Result<T> {
        match self.lock().as_deref_mut() {
            Some(device) => f(device),
            None => Err(bad(format!("this {what} is closed")).into()),
        }
    }
}

/// Serial ports: path, device, URL to try where it is a gauge.
#[pyfunction]
pub fn _ports(py: Python<'_>) -> Result<Vec<(String, String, Option<String>)>> {
    let ports = py.detach(list_ports)?;
    Ok(ports.into_iter().map(|p| (p.path, p.device, p.url)).collect())
}

/// Masters a gauge: what it shows on the calibrator (3,) m, its URL from now on, warnings.
#[pyfunction]
pub fn _master(py: Python<'_>, url: String) -> Result<(Bound<'_, PyArray1<f64>>, String, Vec<String>)> {
    let Mastering { zero, url, warnings } = supervised(py, None, |end, _| Ok(master(&url, &end.asked)?))?;
    Ok((zero.to_vec().into_pyarray(py), url, warnings))
}

/// What the device says, readings (n, 3) m, s each, of each axis mean, sd, spread, step.
type Tried<'py> = (Vec<String>, Bound<'py, PyArray2<f64>>, f64, Vec<(f64, f64, f64, Option<f64>)>);

/// A gauge; `trical.Gauge` shows it.
#[pyclass(name = "GaugeLink", module = "trical._native", frozen)]
pub struct PyGaugeLink {
    name: String,
    link: Link<dyn Gauge>,
}

#[pymethods]
impl PyGaugeLink {
    /// Opens a gauge.
    #[staticmethod]
    fn open(py: Python<'_>, url: &str) -> Result<Self> {
        let gauge = py.detach(|| open_gauge(url))?;
        Ok(Self { name: gauge.name(), link: Link::new(gauge) })
    }

    /// What it is and where.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// Whether it was closed.
    #[getter]
    fn closed(&self, py: Python<'_>) -> bool {
        py.detach(|| self.link.lock().is_none())
    }

    /// Gives the port back.
    fn close(&self, py: Python<'_>) {
        py.detach(|| drop(self.link.lock().take()));
    }

    /// One reading, (3,) m; `settled`: once it stands still.
    fn read<'py>(&self, py: Python<'py>, settled: bool) -> Result<Bound<'py, PyArray1<f64>>> {
        let reading = supervised(py, None, |end, _| {
            self.link.with("gauge", |gauge| {
                if settled {
                    let settle = gauge.settle();
                    return Ok(settled_reading(gauge, &settle, &end.asked)?);
                }
                Ok(gauge.read()?)
            })
        })?;
        Ok(reading.to_vec().into_pyarray(py))
    }

    /// What the device says of itself.
    fn says(&self, py: Python<'_>) -> Result<Vec<String>> {
        Ok(supervised(py, None, |_, _| self.link.with("gauge", |gauge| Ok(gauge.describe()?)))?)
    }

    /// Warnings since the last call.
    fn warnings(&self, py: Python<'_>) -> Result<Vec<String>> {
        py.detach(|| self.link.with("gauge", |gauge| Ok(gauge.take_warnings())))
    }

    /// Reads so many times.
    fn trial<'py>(&self, py: Python<'py>, count: usize) -> Result<Tried<'py>> {
        let Trial { says, readings, seconds_each, axes } =
            supervised(py, None, |end, _| self.link.with("gauge", |gauge| Ok(trial(gauge, count, &end.asked)?)))?;
        let readings = Array2::from_shape_fn((readings.len(), 3), |(i, k)| readings[i][k]).into_pyarray(py);
        let axes = axes.iter().map(|a| (a.mean, a.sd, a.spread, a.step)).collect();
        Ok((says, readings, seconds_each, axes))
    }

    /// Waits until a stem (0 to 2) is pushed; by how much, m.
    fn stem(&self, py: Python<'_>, axis: usize, wait: f64) -> Result<f64> {
        let wait = Duration::try_from_secs_f64(wait)
            .map_err(|_| bad(format!("timeout is {wait}, expected a time in s of 0 or more")))?;
        let work = |cancel: &AtomicBool| self.link.with("gauge", |gauge| Ok(stem_answers(gauge, axis, wait, cancel)?));
        Ok(supervised(py, None, |end, _| work(&end.asked))?)
    }
}

/// A robot controller; `trical.Controller` shows it.
#[pyclass(name = "ControllerLink", module = "trical._native", frozen)]
pub struct PyControllerLink {
    name: String,
    joints: usize,
    link: Link<dyn Controller>,
}

/// Joints before and after, (joints,) rad (m).
type Jogged<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

fn array<'py>(py: Python<'py>, q: &Joints, n: usize) -> Bound<'py, PyArray1<f64>> {
    q[..n.min(q.len())].to_vec().into_pyarray(py)
}

/// A refusal by the names of the keywords.
fn refused(e: &JogError) -> PyErr {
    bad(match e {
        JogError::NoJoint { .. } => format!("joint: {e}"),
        JogError::Count { .. } => format!("to: {e}"),
        JogError::FarTool(_) => format!("tool: {e}"),
        JogError::Speed(_) => format!("speed: {e}"),
        JogError::Far { .. } => format!("{e} (max_angle)"),
        _ => e.to_string(),
    })
}

/// Keywords of `trical.Controller.jog`.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct JogKeywords {
    /// Number of the joint, from 1, and by how much it goes on.
    joint: Option<(usize, f64)>,
    to: Option<Vec<f64>>,
    tool: Option<[f64; 3]>,
    max_angle: f64,
    speed: f64,
    robot: Option<RobotArgument>,
    go: bool,
}

#[pymethods]
impl PyControllerLink {
    /// Opens a controller.
    #[staticmethod]
    fn open(py: Python<'_>, url: String) -> Result<Self> {
        let controller = supervised(py, None, |_, _| Ok(open_controller(&url)?))?;
        Ok(Self { name: controller.name(), joints: controller.joint_count(), link: Link::new(controller) })
    }

    /// What it is and where.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// Number of the arm's joints.
    #[getter]
    fn dof(&self) -> usize {
        self.joints
    }

    /// Whether it was closed.
    #[getter]
    fn closed(&self, py: Python<'_>) -> bool {
        py.detach(|| self.link.lock().is_none())
    }

    /// Ends the connection.
    fn close(&self, py: Python<'_>) {
        py.detach(|| drop(self.link.lock().take()));
    }

    /// Median time of an answer in s, clock in s, temperature in degC.
    fn ping(&self, py: Python<'_>) -> Result<(f64, f64, Option<f64>)> {
        let answer = supervised(py, None, |_, _| self.link.with("controller", |c| Ok(ping(c)?)))?;
        Ok((answer.answers_in, answer.clock, answer.temp_c))
    }

    /// Joints once they stand still, (joints,) rad (m).
    fn joints<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyArray1<f64>>> {
        let q = supervised(py, None, |end, _| {
            self.link.with("controller", |c| {
                let settle = c.joint_settle();
                Ok(wait_settled(c, &settle, &end.asked)?)
            })
        })?;
        Ok(array(py, &q, self.joints))
    }

    /// Moves a little, or with `go` false says where to: joints before and after, (joints,) rad (m).
    fn jog<'py>(&self, py: Python<'py>, given: &Bound<'py, PyDict>) -> Result<Jogged<'py>> {
        let JogKeywords { joint, to, tool, max_angle, speed, robot, go } = keywords(given)?;
        let jog = match (joint, to, tool) {
            (Some((0, _)), None, None) => {
                return Err(bad("joint: found 0, expected 1 or more").into());
            }
            (Some((joint, by)), None, None) => Jog::Joint(joint - 1, by),
            (None, Some(to), None) => Jog::Joints(to),
            (None, None, Some(by)) => Jog::Tool(by),
            _ => return Err(bad("expected one of joint (with by), to and tool").into()),
        };
        check_speed(speed).map_err(|e| refused(&e))?;
        let robot = robot.map(|r| r.read()).transpose()?;
        let (before, after) = supervised(py, None, |end, _| {
            self.link.with("controller", |c| {
                c.stop_when(Arc::clone(&end.stops));
                if let Some(robot) = &robot {
                    tell_arm(c, robot, &Cell::bare())?;
                }
                let settle = c.joint_settle();
                let from = wait_settled(c, &settle, &end.asked)?;
                let target = jog.target(&from, self.joints, max_angle, robot.as_ref()).map_err(|e| refused(&e))?;
                if !go {
                    return Ok((from, target));
                }
                jog.go(c, &target, speed)?;
                // a motion that was not stopped ends before the call does
                Ok((from, wait_settled(c, &settle, &AtomicBool::new(false))?))
            })
        })?;
        Ok((array(py, &before, self.joints), array(py, &after, self.joints)))
    }
}
