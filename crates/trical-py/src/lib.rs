//! Python bindings: the same library for NumPy users. No logic that Rust lacks.

mod compensate;

use std::path::{Path, PathBuf};

use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray2, PyArray3, PyReadonlyArray2};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use trical_ident::diagnose::effects::EFFECTS;
use trical_ident::{
    Dataset, ErrorSummary, IdentError, Identified, JointSource, ModelFile, ParameterSet, cross_validate, diagnose,
    identify, load_csv, reject_gross_errors, shown, validate,
};
use trical_model::{Cell, Forward, JointKind, Model, ModelError, Pose, Rigid, Robot, State, urdf};

pyo3::create_exception!(trical, TricalError, PyValueError, "Bad input; the message is one sentence.");
pyo3::create_exception!(trical, NotConvergedError, PyRuntimeError, "A fit did not reach a minimum.");

#[expect(clippy::needless_pass_by_value, reason = "used with map_err")]
fn model_error(e: ModelError) -> PyErr {
    TricalError::new_err(e.to_string())
}

#[expect(clippy::needless_pass_by_value, reason = "used with map_err")]
fn ident_error(e: IdentError) -> PyErr {
    match e {
        IdentError::NotConverged(_) => NotConvergedError::new_err(e.to_string()),
        _ => TricalError::new_err(e.to_string()),
    }
}

/// Positions and rotations of poses 0 to n - 1.
fn arrays(n: usize, mut pose: impl FnMut(usize) -> Pose) -> (Array2<f64>, Array3<f64>) {
    let (mut p, mut r) = (Array2::zeros((n, 3)), Array3::zeros((n, 3, 3)));
    for k in 0..n {
        let pose = pose(k);
        for i in 0..3 {
            p[(k, i)] = pose.translation[i];
            for j in 0..3 {
                r[(k, i, j)] = pose.rotation[(i, j)];
            }
        }
    }
    (p, r)
}

/// A model ready to predict where the tool is.
#[pyclass(name = "Model", module = "trical", frozen)]
struct PyModel {
    file: ModelFile,
    forward: Forward,
}

impl PyModel {
    fn new(file: ModelFile) -> PyResult<Self> {
        let forward = Forward::new(file.model.clone(), Vec::new()).map_err(model_error)?;
        Ok(Self { file, forward })
    }

    fn states(&self, q: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<State>> {
        let q = q.as_array();
        let n = self.file.model.robot.dof();
        if q.ncols() != n {
            return Err(TricalError::new_err(format!(
                "q has {} columns, expected one for each of {n} joints",
                q.ncols()
            )));
        }
        if q.iter().any(|x| !x.is_finite()) {
            return Err(TricalError::new_err("q holds a value that is not finite"));
        }
        Ok(q.rows().into_iter().map(|r| State::at(&r.to_vec())).collect())
    }
}

#[pymethods]
impl PyModel {
    /// The nominal arm of a robot.toml (or of a URDF: "arm.urdf#base_link:tool0") in the cell of a cell.toml; without a
    /// cell, the arm's foot is {w} and its flange is the tool.
    #[staticmethod]
    #[pyo3(signature = (robot, cell=None))]
    fn nominal(robot: PathBuf, cell: Option<PathBuf>) -> PyResult<Self> {
        let robot = Robot::load(&robot).map_err(model_error)?;
        let cell = cell.map_or_else(|| Ok(Cell::bare()), |c| Cell::load(&c)).map_err(model_error)?;
        Self::new(ModelFile {
            model: Model::nominal(robot, cell),
            joints: JointSource::Read,
            references: Vec::new(),
            recordings: Vec::new(),
        })
    }

    /// Reads a model file (calibrated.toml, improved.toml).
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        Self::new(ModelFile::load(&path).map_err(ident_error)?)
    }

    /// Writes a model file.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        self.file.save(&path).map_err(ident_error)
    }

    /// The text of the model file.
    fn to_toml(&self) -> PyResult<String> {
        self.file.to_toml().map_err(ident_error)
    }

    #[staticmethod]
    fn from_toml(text: &str) -> PyResult<Self> {
        Self::new(ModelFile::parse(text, "model").map_err(ident_error)?)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        let class = slf.get_type();
        Ok((class.getattr("from_toml")?, (slf.get().to_toml()?,)))
    }

    fn __repr__(&self) -> String {
        let m = &self.file.model;
        format!("<trical.Model of {}: {} joints, {} terms>", m.robot.name, m.robot.dof(), m.terms.len())
    }

    #[getter]
    fn robot(&self) -> String {
        self.file.model.robot.name.clone()
    }

    #[getter]
    fn dof(&self) -> usize {
        self.file.model.robot.dof()
    }

    /// Lower and upper limits of the joints (joints, 2), rad (m for prismatic joints).
    #[getter]
    fn limits<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let joints = &self.file.model.robot.joints;
        Array2::from_shape_fn((joints.len(), 2), |(i, k)| joints[i].limits[k]).into_pyarray(py)
    }

    /// "revolute" or "prismatic" for each joint.
    #[getter]
    fn kinds(&self) -> Vec<&'static str> {
        let word = |k| if k == JointKind::Prismatic { "prismatic" } else { "revolute" };
        self.file.model.robot.joints.iter().map(|j| word(j.kind)).collect()
    }

    /// The nominal arm as the text of a robot.toml.
    fn robot_toml(&self) -> String {
        self.file.model.robot.to_toml()
    }

    /// The model with its constant terms built into arm and cell, and its other terms (compliance ...) left out.
    fn rigid(&self) -> PyResult<Self> {
        let Rigid { robot, cell, .. } = self.file.model.rigid().map_err(model_error)?;
        let mut file = self.file.clone();
        file.model = Model { frames: file.model.frames, ..Model::nominal(robot, cell) };
        Self::new(file)
    }

    /// Names of the terms that `rigid` and `to_urdf` leave out.
    fn not_rigid(&self) -> PyResult<Vec<String>> {
        let rigid = self.file.model.rigid().map_err(model_error)?;
        Ok(rigid.left_out.into_iter().map(|t| t.name).collect())
    }

    /// The rigid part as the text of a URDF, from link "world" over "base_link", "link_1" ... to "flange" and "tcp".
    fn to_urdf(&self) -> PyResult<String> {
        let rigid = self.file.model.rigid().map_err(model_error)?;
        let left_out: Vec<String> = rigid.left_out.iter().map(|t| t.name.clone()).collect();
        let remark = if left_out.is_empty() { vec![] } else { vec![format!("Left out: {}", left_out.join(", "))] };
        Ok(urdf::write(&rigid.robot, &rigid.cell, &remark))
    }

    /// Terms as JSON text.
    fn _terms_json(&self) -> String {
        let m = &self.file.model;
        let list: Vec<_> = m.terms.iter().map(|t| shown(m, t)).collect();
        serde_json::to_string(&list).unwrap_or_default()
    }

    /// Positions (n, 3) in m and rotations (n, 3, 3) of the tool in {w} for joint values (n, joints) in rad (m for prismatic joints).
    #[expect(clippy::type_complexity, reason = "a pair of arrays")]
    fn forward<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>)> {
        let states = self.states(&q)?;
        let (p, r) = py.detach(|| {
            let mut ws = self.forward.workspace();
            arrays(states.len(), |k| self.forward.world_from_tool(&states[k], &mut ws))
        });
        Ok((p.into_pyarray(py), r.into_pyarray(py)))
    }

    /// Positions (n, 3) in m and rotations (n, 3, 3) of the flange in {w} for joint values (n, joints) in rad (m).
    #[expect(clippy::type_complexity, reason = "a pair of arrays")]
    fn flange<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>)> {
        let states = self.states(&q)?;
        let (p, r) = py.detach(|| {
            let mut ws = self.forward.workspace();
            arrays(states.len(), |k| self.forward.world_from_flange(&states[k], &mut ws))
        });
        Ok((p.into_pyarray(py), r.into_pyarray(py)))
    }

    /// Jacobians (n, 6, joints): velocity (m) of the TCP, then angular velocity (rad), in the axes of {w}, per rad (m) of each
    /// joint, for joint values (n, joints) in rad (m).
    fn jacobian<'py>(&self, py: Python<'py>, q: PyReadonlyArray2<'py, f64>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let states = self.states(&q)?;
        let n = self.dof();
        let all = py.detach(|| {
            let mut ws = self.forward.workspace();
            let mut all = Array3::zeros((states.len(), 6, n));
            let mut one = vec![0.0; 6 * n];
            for (k, state) in states.iter().enumerate() {
                self.forward.joint_jacobian(state, &mut ws, &mut one);
                for i in 0..6 {
                    for j in 0..n {
                        all[(k, i, j)] = one[i * n + j];
                    }
                }
            }
            all
        });
        Ok(all.into_pyarray(py))
    }

    /// What gravity does at each joint (n, joints), in N m about its axis (N along it for a prismatic joint), for joint
    /// values (n, joints) in rad (m): the tool's mass is counted, compliance is not.
    fn gravity_torques<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let states = self.states(&q)?;
        let n = self.dof();
        let mut ws = self.forward.workspace();
        let mut all = Array2::zeros((states.len(), n));
        for (k, state) in states.iter().enumerate() {
            let tau = self.forward.gravity_torques(state, &mut ws).map_err(model_error)?;
            for j in 0..n {
                all[(k, j)] = tau[j];
            }
        }
        Ok(all.into_pyarray(py))
    }
}

fn source(joints: &str) -> PyResult<JointSource> {
    match joints {
        "read" => Ok(JointSource::Read),
        "commanded" => Ok(JointSource::Commanded),
        other => Err(TricalError::new_err(format!("joints is '{other}', expected 'read' or 'commanded'"))),
    }
}

fn parameter_set(name: &str) -> PyResult<ParameterSet> {
    match name {
        "nominal" => Ok(ParameterSet::Nominal),
        "geometry" => Ok(ParameterSet::Geometry),
        "compliance" => Ok(ParameterSet::Compliance),
        "complete" => Ok(ParameterSet::Complete),
        other => Err(TricalError::new_err(format!(
            "model is '{other}', expected 'nominal', 'geometry', 'compliance' or 'complete'"
        ))),
    }
}

fn inputs(
    recordings: &[PathBuf],
    robot: &Path,
    cell: &Path,
    joints: JointSource,
    references: Option<&[trical_ident::References]>,
) -> Result<(Robot, Cell, Dataset), IdentError> {
    let robot = Robot::load(robot)?;
    let cell = Cell::load(cell)?;
    let recordings = recordings.iter().map(|r| load_csv(r, robot.dof())).collect::<Result<Vec<_>, _>>()?;
    let data = Dataset::build(&recordings, joints, references)?;
    Ok((robot, cell, data))
}

fn summary(fitted: &Identified, held_out: Option<&ErrorSummary>) -> Result<String, IdentError> {
    let errors = ErrorSummary::of(&fitted.errors()?);
    let parameters: Vec<_> = fitted.free.iter().map(|k| shown(&fitted.model, &fitted.model.terms[*k])).collect();
    let value = serde_json::json!({
        "recordings": fitted.data.names,
        "observations": fitted.data.observations.len(),
        "rejected": fitted.data.rejected,
        "parameters": parameters,
        "not_identifiable": fitted.dependent.iter().map(|d| (&d.name, &d.with)).collect::<Vec<_>>(),
        "observability": fitted.observability,
        "errors": errors,
        "cross_validation": held_out,
    });
    Ok(value.to_string())
}

/// Identifies; returns the model and a JSON summary.
#[pyfunction]
#[pyo3(signature = (recordings, robot, cell, joints, model, folds))]
fn _identify(
    py: Python<'_>,
    recordings: Vec<PathBuf>,
    robot: PathBuf,
    cell: PathBuf,
    joints: &str,
    model: &str,
    folds: Option<usize>,
) -> PyResult<(PyModel, String)> {
    let (joints, set) = (source(joints)?, parameter_set(model)?);
    let (file, text) = py
        .detach(|| -> Result<_, IdentError> {
            let (robot, cell, data) = inputs(&recordings, &robot, &cell, joints, None)?;
            let data = reject_gross_errors(&robot, &cell, &data)?;
            let fitted = identify(&robot, &cell, &data, set)?;
            let held_out = folds
                .map(|k| cross_validate(&robot, &cell, &data, set, k).map(|e| ErrorSummary::of(&e)))
                .transpose()?;
            let text = summary(&fitted, held_out.as_ref())?;
            let file = ModelFile {
                model: fitted.model,
                joints: data.joints,
                references: data.references.clone(),
                recordings: data.names.clone(),
            };
            Ok((file, text))
        })
        .map_err(ident_error)?;
    Ok((PyModel::new(file)?, text))
}

/// Diagnoses; returns the extended model and the contract's JSON.
#[pyfunction]
fn _diagnose(
    py: Python<'_>,
    recordings: Vec<PathBuf>,
    robot: PathBuf,
    cell: PathBuf,
    joints: &str,
) -> PyResult<(PyModel, String)> {
    let joints = source(joints)?;
    let (file, text) = py
        .detach(|| -> Result<_, IdentError> {
            let (robot, cell, data) = inputs(&recordings, &robot, &cell, joints, None)?;
            let found = diagnose(&robot, &cell, &data, &mut |_, _| {})?;
            let text = serde_json::to_string(&found).unwrap_or_default();
            let file = ModelFile {
                model: found.model,
                joints,
                references: found.data.references,
                recordings: found.data.names,
            };
            Ok((file, text))
        })
        .map_err(ident_error)?;
    Ok((PyModel::new(file)?, text))
}

/// The catalogue of effects as JSON text.
#[pyfunction]
fn _effects_json() -> String {
    serde_json::to_string(&EFFECTS).unwrap_or_default()
}

/// Scores a model; returns a JSON summary.
#[pyfunction]
fn _validate(
    py: Python<'_>,
    model: &Bound<'_, PyModel>,
    recordings: Vec<PathBuf>,
    robot: PathBuf,
    cell: PathBuf,
) -> PyResult<String> {
    let file = model.get().file.clone();
    py.detach(|| -> Result<_, IdentError> {
        let (robot, cell, data) = inputs(&recordings, &robot, &cell, file.joints, Some(&file.references))?;
        file.require_robot(&robot, "the model")?;
        let v = validate(&robot, &cell, &file.model, &data, None)?;
        Ok(serde_json::to_string(&v).unwrap_or_default())
    })
    .map_err(ident_error)
}

/// The native half of the package `trical`.
#[pymodule]
fn _native(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add("TricalError", m.py().get_type::<TricalError>())?;
    m.add("NotConvergedError", m.py().get_type::<NotConvergedError>())?;
    m.add_class::<PyModel>()?;
    m.add_function(wrap_pyfunction!(_identify, m)?)?;
    m.add_function(wrap_pyfunction!(_diagnose, m)?)?;
    m.add_function(wrap_pyfunction!(_effects_json, m)?)?;
    m.add_function(wrap_pyfunction!(compensate::_compensate, m)?)?;
    m.add_function(wrap_pyfunction!(_validate, m)?)
}
