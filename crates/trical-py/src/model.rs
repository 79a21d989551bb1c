//! `trical.Model`: predictions.

use std::path::PathBuf;

use nalgebra::Vector3;
use numpy::ndarray::{Array1, Array2, Array3};
use numpy::{IntoPyArray, PyArray2};
use pyo3::prelude::*;
use trical_ident::{JointSource, ModelFile, shown};
use trical_model::ik::nearest_solution;
use trical_model::{Cell, Forward, Joints, MAX_JOINTS, Model, Pose, Rigid, State, Workspace};
use trical_report::error_map::Miss;
use trical_report::{ErrorMap, Export};

use crate::arguments::path_of;
use crate::arrays::{Beside, States, Table, floats, joints_array, rows_or_one};
use crate::errors::{Failed, Result, bad, write};
use crate::interruptible::interruptible;
use crate::machine::{CellArgument, PyCell, PyRobot, RobotArgument, kinds, limits};

/// A model ready to predict where the tool is.
#[pyclass(name = "Model", module = "trical", frozen)]
pub struct PyModel {
    pub file: ModelFile,
    forward: Forward,
}

/// Joints, places, errors.
type ErrorMapArrays<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

/// Positions and rotations.
type Poses<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>);

impl PyModel {
    pub fn new(file: ModelFile) -> Result<Self> {
        let forward = Forward::new(file.model.clone(), Vec::new())?;
        Ok(Self { file, forward })
    }

    fn dof_(&self) -> usize {
        self.file.model.robot.dof()
    }

    /// Runs `pose` for every state, without the interpreter's lock.
    fn poses<'py>(
        &self,
        py: Python<'py>,
        states: &States,
        pose: fn(&Forward, &State, &mut Workspace) -> Pose,
    ) -> Poses<'py> {
        let (p, r) = py.detach(|| {
            let n = states.len();
            let (mut p, mut r) = (Array2::zeros((n, 3)), Array3::zeros((n, 3, 3)));
            let mut ws = self.forward.workspace();
            for k in 0..n {
                let pose = pose(&self.forward, &states.at(k), &mut ws);
                for i in 0..3 {
                    p[(k, i)] = pose.translation[i];
                    for j in 0..3 {
                        r[(k, i, j)] = pose.rotation[(i, j)];
                    }
                }
            }
            (p, r)
        });
        let single = states.single();
        (rows_or_one(py, p, single), blocks_or_one(py, r, single))
    }
}

fn blocks_or_one(py: Python<'_>, blocks: Array3<f64>, single: bool) -> Bound<'_, PyAny> {
    if single {
        blocks.index_axis_move(numpy::ndarray::Axis(0), 0).into_pyarray(py).into_any()
    } else {
        blocks.into_pyarray(py).into_any()
    }
}

#[pymethods]
impl PyModel {
    /// The nominal arm of a robot in a cell (files or objects; a URDF as in "arm.urdf#base_link:tool0"). Without a cell, the
    /// world is the foot of the arm and the tool is its flange.
    #[staticmethod]
    #[pyo3(signature = (robot, cell=None))]
    fn nominal(robot: RobotArgument, cell: Option<CellArgument>) -> Result<Self> {
        let cell = cell.map_or_else(|| Ok(Cell::bare()), |c| c.read())?;
        Self::new(ModelFile::unmeasured(Model::nominal(robot.read()?, cell)))
    }

    /// Reads a model file (calibrated.toml, improved.toml).
    #[staticmethod]
    fn load(#[pyo3(from_py_with = path_of)] path: PathBuf) -> Result<Self> {
        Self::new(ModelFile::load(&path)?)
    }

    /// Writes a model file.
    fn save(&self, #[pyo3(from_py_with = path_of)] path: PathBuf) -> Result<()> {
        Ok(write(&path, self.file.to_toml()?.as_bytes())?)
    }

    /// The text of the model file.
    fn to_toml(&self) -> Result<String> {
        Ok(self.file.to_toml()?)
    }

    /// Reads the text of a model file.
    #[staticmethod]
    fn from_toml(text: &str) -> Result<Self> {
        Self::new(ModelFile::parse(text, "model")?)
    }

    /// The model with further terms, given as the [[term]] tables of a model file: an arm with hidden flaws, to simulate.
    fn with_terms(&self, text: &str) -> Result<Self> {
        Self::new(self.file.with_terms(text)?)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        let text = slf.get().to_toml().map_err(PyErr::from)?;
        Ok((slf.get_type().getattr("from_toml")?, (text,)))
    }

    fn __repr__(&self) -> String {
        let m = &self.file.model;
        format!("<trical.Model of {}: {} joints, {} terms>", m.robot.name, m.robot.dof(), m.terms.len())
    }

    /// Name of the arm.
    #[getter]
    fn robot(&self) -> String {
        self.file.model.robot.name.clone()
    }

    /// The nominal arm.
    #[getter]
    fn nominal_robot(&self) -> PyRobot {
        PyRobot(self.file.model.robot.clone())
    }

    /// The nominal cell.
    #[getter]
    fn nominal_cell(&self) -> PyCell {
        PyCell(self.file.model.cell.clone())
    }

    /// Number of joints.
    #[getter]
    fn dof(&self) -> usize {
        self.dof_()
    }

    /// Lower and upper limits of the joints, (joints, 2), rad (m for prismatic joints).
    #[getter]
    fn limits<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        limits(&self.file.model.robot).into_pyarray(py)
    }

    /// Kind of each joint: "revolute" or "prismatic".
    #[getter]
    fn kinds(&self) -> Vec<&'static str> {
        kinds(&self.file.model.robot)
    }

    /// Which joint angles the model was fitted to: "read" or "commanded".
    #[getter]
    fn joints(&self) -> &'static str {
        match self.file.joints {
            JointSource::Read => "read",
            JointSource::Commanded => "commanded",
        }
    }

    /// The nominal arm as the text of a robot.toml.
    fn robot_toml(&self) -> String {
        self.file.model.robot.to_toml()
    }

    /// The model with its constant terms built into arm and cell, and its other terms (compliance ...) left out.
    fn rigid(&self) -> Result<Self> {
        let Rigid { robot, cell, .. } = self.file.model.rigid()?;
        let mut file = self.file.clone();
        file.model = Model { frames: file.model.frames, ..Model::nominal(robot, cell) };
        Self::new(file)
    }

    /// Names of the terms that `rigid` and `to_urdf` leave out.
    fn not_rigid(&self) -> Result<Vec<String>> {
        Ok(self.file.model.rigid()?.left_out.into_iter().map(|t| t.name).collect())
    }

    /// The rigid part as the text of a URDF, from link "world" over "base_link", "link_1" ... to "flange" and "tcp".
    fn to_urdf(&self) -> Result<String> {
        Ok(Export::of(&self.file)?.urdf("a model in Python"))
    }

    /// Writes the rigid part as a URDF.
    fn save_urdf(&self, #[pyo3(from_py_with = path_of)] path: PathBuf) -> Result<()> {
        Ok(write(&path, self.to_urdf()?.as_bytes())?)
    }

    /// Terms as JSON text.
    fn _terms_json(&self) -> String {
        let m = &self.file.model;
        let list: Vec<_> = m.terms.iter().map(|t| shown(m, t)).collect();
        serde_json::to_string(&list).unwrap_or_default()
    }

    /// Where the tool is, in the world.
    ///
    /// q: (n, joints) or (joints,), rad (m for prismatic joints). Inputs of the model's terms, each for all poses or one per
    /// pose: directions (n, joints) or (joints,), -1, 0 or 1, sense of each joint's last motion; temperature (n,) degC; time
    /// (n,) s since the recording began; seq (n,) number of the pose, for models of recordings without times; payload (n,)
    /// kg on the flange beyond the cell's tool. Defaults: no sense of motion, the reference temperature, time and
    /// number 0, no payload.
    ///
    /// Returns positions (n, 3) m and rotations (n, 3, 3); (3,) and (3, 3) for q of shape (joints,).
    #[pyo3(signature = (q, *, directions=None, temperature=None, time=None, seq=None, payload=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords")]
    fn forward<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        temperature: Option<&Bound<'py, PyAny>>,
        time: Option<&Bound<'py, PyAny>>,
        seq: Option<&Bound<'py, PyAny>>,
        payload: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Poses<'py>> {
        let known = States::new(q, self.dof_(), &Beside { directions, time, seq, temperature, payload })?;
        Ok(self.poses(py, &known, Forward::world_from_tool))
    }

    /// How far the arm misses all over its workspace, as in `trical export --error-map`: n poses at random within the
    /// limits, the same ones each time. Returns their joints (n, joints) rad (m), where the nominal arm's TCP is there (n, 3) m,
    /// and from there to where this model's is (n, 3) m, in the axes of the arm's base.
    #[pyo3(signature = (n=2000))]
    fn error_map<'py>(&self, py: Python<'py>, n: i64) -> Result<ErrorMapArrays<'py>> {
        let Some(n) = usize::try_from(n).ok().filter(|n| (1..=1_000_000).contains(n)) else {
            return Err(bad(format!("n is {n}, expected 1 to 1000000 poses")).into());
        };
        let misses = interruptible(py, None, |_| ErrorMap::of(&self.file.model, n))?.misses;
        let joints: Vec<_> = misses.iter().map(|m| m.joints).collect();
        let of =
            |f: fn(&Miss) -> &Vector3<f64>| Array2::from_shape_fn((n, 3), |(i, k)| f(&misses[i])[k]).into_pyarray(py);
        Ok((joints_array(&joints, self.dof_()).into_pyarray(py), of(|m| &m.at), of(|m| &m.off)))
    }

    /// Where the flange is, in the world: arguments and shapes as for `forward`.
    #[pyo3(signature = (q, *, directions=None, temperature=None, time=None, seq=None, payload=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords")]
    fn flange<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        temperature: Option<&Bound<'py, PyAny>>,
        time: Option<&Bound<'py, PyAny>>,
        seq: Option<&Bound<'py, PyAny>>,
        payload: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Poses<'py>> {
        let known = States::new(q, self.dof_(), &Beside { directions, time, seq, temperature, payload })?;
        Ok(self.poses(py, &known, Forward::world_from_flange))
    }

    /// Jacobians (n, 6, joints), world axes: velocity of the TCP (m), then angular velocity (rad), per rad (m) of each joint,
    /// for joint values q (n, joints) in rad (m); (6, joints) for q of shape (joints,).
    fn jacobian<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let n = self.dof_();
        let states = States::new(q, n, &Beside::default())?;
        let all = py.detach(|| {
            let mut ws = self.forward.workspace();
            let mut all = Array3::zeros((states.len(), 6, n));
            let mut one = vec![0.0; 6 * n];
            for k in 0..states.len() {
                self.forward.joint_jacobian(&states.at(k), &mut ws, &mut one);
                for i in 0..6 {
                    for j in 0..n {
                        all[(k, i, j)] = one[i * n + j];
                    }
                }
            }
            all
        });
        Ok(blocks_or_one(py, all, states.single()))
    }

    /// What gravity does at each joint, (n, joints), in N m about its axis (N along a prismatic one), for joint values q
    /// (n, joints) in rad (m); (joints,) for q of shape (joints,). The tool's mass is counted and, with payload (n,) kg, that
    /// on the flange; compliance is not.
    #[pyo3(signature = (q, *, payload=None))]
    fn gravity_torques<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        payload: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let n = self.dof_();
        let states = States::new(q, n, &Beside { payload, ..Beside::default() })?;
        let all = py.detach(|| self.torques(&states))?;
        Ok(rows_or_one(py, all, states.single()))
    }

    /// Joint values at which the tool, by the whole model, has a pose in the world: those nearest to `near`.
    ///
    /// positions: (n, 3) m; rotations: (n, 3, 3); near: (n, joints) or (joints,), rad (m). Without the n: one pose. The other
    /// arguments are those of `forward`. Returns (n, joints), or (joints,) for one pose; raises UnreachableError for the first
    /// pose that the arm cannot take.
    #[pyo3(signature = (positions, rotations, near, *, directions=None, temperature=None, time=None, seq=None, payload=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords")]
    fn inverse<'py>(
        &self,
        py: Python<'py>,
        positions: &Bound<'py, PyAny>,
        rotations: &Bound<'py, PyAny>,
        near: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        temperature: Option<&Bound<'py, PyAny>>,
        time: Option<&Bound<'py, PyAny>>,
        seq: Option<&Bound<'py, PyAny>>,
        payload: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let n = self.dof_();
        let Table { rows, single } = Table::new(positions, "positions", 3)?;
        let turns = floats(rotations, "rotations")?;
        let turns = turns.as_array();
        let wanted: &[usize] = if single { &[3, 3] } else { &[rows.nrows(), 3, 3] };
        if turns.shape() != wanted {
            return Err(bad(format!("rotations has the shape {:?}, expected {wanted:?}", turns.shape())));
        }
        let turns: Vec<f64> = turns.iter().copied().collect();
        let seed = Table::new(near, "near", n)?;
        if !seed.goes_with(&rows) {
            return Err(bad(format!("near has {} rows, but positions has {}", seed.rows.nrows(), rows.nrows())));
        }
        let all_seeds =
            Array2::from_shape_fn((rows.nrows(), n), |(k, j)| seed.rows[(if seed.single { 0 } else { k }, j)])
                .into_pyarray(py)
                .into_any();
        let states = States::new(&all_seeds, n, &Beside { directions, time, seq, temperature, payload })?;
        let all = py.detach(|| -> Result<Vec<Joints>> {
            let mut ws = self.forward.workspace();
            (0..states.len())
                .map(|k| {
                    let turn = &turns[9 * k..9 * k + 9];
                    let pose = Pose {
                        rotation: nalgebra::Matrix3::from_row_slice(turn),
                        translation: Vector3::from_fn(|i, _| rows[(k, i)]),
                    };
                    nearest_solution(&self.forward, &pose, &states.at(k), &mut ws).map_err(|e| {
                        let place = if single { String::new() } else { format!("pose {k}: ") };
                        Failed::from(crate::errors::UnreachableError::new_err(format!("{place}{e}")))
                    })
                })
                .collect()
        })?;
        if single {
            return Ok(Array1::from_iter(all[0][..n].iter().copied()).into_pyarray(py).into_any());
        }
        Ok(joints_array(&all, n).into_pyarray(py).into_any())
    }
}

impl PyModel {
    fn torques(&self, states: &States) -> Result<Array2<f64>> {
        let n = self.dof_().min(MAX_JOINTS);
        let mut ws = self.forward.workspace();
        let mut all = Array2::zeros((states.len(), n));
        for k in 0..states.len() {
            let tau = self.forward.gravity_torques(&states.at(k), &mut ws)?;
            for j in 0..n {
                all[(k, j)] = tau[j];
            }
        }
        Ok(all)
    }
}
