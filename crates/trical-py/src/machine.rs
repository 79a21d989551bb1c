//! Robots and cells as Python has them.

use std::path::{Path, PathBuf};

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use trical_model::urdf::UrdfPath;
use trical_model::{Cell, JointKind, Robot};
use trical_plan::geometry::mesh::resolve_meshes;
use trical_report::table::counted;

use crate::arguments::path_of;
use crate::arrays::{PoseArrays, pose_arrays};
use crate::errors::{Result, bad, write};

/// A nominal arm: modified Denavit-Hartenberg parameters, limits, masses.
#[pyclass(name = "Robot", module = "trical", frozen)]
pub struct PyRobot(pub Robot);

#[pymethods]
impl PyRobot {
    /// Reads a robot.toml, or a URDF as in "arm.urdf#base_link:tool0".
    #[staticmethod]
    fn load(#[pyo3(from_py_with = path_of)] path: PathBuf) -> Result<Self> {
        Ok(Self(Robot::load(&path)?))
    }

    /// Reads the text of a robot.toml.
    #[staticmethod]
    fn from_toml(text: &str) -> Result<Self> {
        Ok(Self(Robot::parse(text, "robot")?))
    }

    /// The text of a robot.toml.
    fn to_toml(&self) -> String {
        self.0.to_toml()
    }

    /// Writes a robot.toml.
    fn save(&self, #[pyo3(from_py_with = path_of)] path: PathBuf) -> Result<()> {
        Ok(write(&path, self.0.to_toml().as_bytes())?)
    }

    /// Its name.
    #[getter]
    fn name(&self) -> String {
        self.0.name.clone()
    }

    /// Number of joints.
    #[getter]
    fn dof(&self) -> usize {
        self.0.dof()
    }

    /// Lower and upper limits of the joints, (joints, 2), rad (m for prismatic joints).
    #[getter]
    fn limits<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        limits(&self.0).into_pyarray(py)
    }

    /// Kind of each joint: "revolute" or "prismatic".
    #[getter]
    fn kinds(&self) -> Vec<&'static str> {
        kinds(&self.0)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((slf.get_type().getattr("from_toml")?, (slf.get().to_toml(),)))
    }

    fn __repr__(&self) -> String {
        format!("<trical.Robot {}: {} joints>", self.0.name, self.0.dof())
    }
}

/// Limits (joints, 2).
pub fn limits(robot: &Robot) -> Array2<f64> {
    Array2::from_shape_fn((robot.dof(), 2), |(i, k)| robot.joints[i].limits[k])
}

/// Kinds in words.
pub fn kinds(robot: &Robot) -> Vec<&'static str> {
    let word = |k| if k == JointKind::Prismatic { "prismatic" } else { "revolute" };
    robot.joints.iter().map(|j| word(j.kind)).collect()
}

/// Where an arm stands, what it carries, and what it can touch.
#[pyclass(name = "Cell", module = "trical", frozen)]
pub struct PyCell(pub Cell);

fn load_cell(path: &Path) -> Result<Cell> {
    let mut cell = Cell::load(path)?;
    let folder = path.parent().unwrap_or(Path::new("."));
    resolve_meshes(&mut cell, folder).map_err(|e| bad(format!("{}: {e}", path.display())))?;
    Ok(cell)
}

#[pymethods]
impl PyCell {
    /// Reads a cell.toml.
    #[staticmethod]
    fn load(#[pyo3(from_py_with = path_of)] path: PathBuf) -> Result<Self> {
        load_cell(&path).map(Self)
    }

    /// Reads the text of a cell.toml.
    #[staticmethod]
    fn from_toml(text: &str) -> Result<Self> {
        let mut cell = Cell::parse(text, "cell")?;
        resolve_meshes(&mut cell, Path::new("."))?;
        Ok(Self(cell))
    }

    /// The text of a cell.toml.
    fn to_toml(&self) -> String {
        self.0.to_toml()
    }

    /// Writes a cell.toml.
    fn save(&self, #[pyo3(from_py_with = path_of)] path: PathBuf) -> Result<()> {
        Ok(write(&path, self.0.to_toml().as_bytes())?)
    }

    /// Centres of the balls in the world, (balls, 3), m.
    #[getter]
    fn balls<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let balls = &self.0.balls;
        Array2::from_shape_fn((balls.len(), 3), |(i, k)| balls[i][k]).into_pyarray(py)
    }

    /// Tool point (TCP) in the flange's frame, (3,), m.
    #[getter]
    fn tcp<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.0.tool.tcp.as_slice().to_vec().into_pyarray(py)
    }

    /// Where the arm stands in the world: position (3,) m and rotation (3, 3).
    #[getter]
    fn base<'py>(&self, py: Python<'py>) -> PoseArrays<'py> {
        pose_arrays(py, &self.0.world_from_base)
    }

    /// Targets on the tool in the flange's frame, (targets, 3), m.
    #[getter]
    fn targets<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let targets = &self.0.tool.targets;
        Array2::from_shape_fn((targets.len(), 3), |(i, k)| targets[i][k]).into_pyarray(py)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((slf.get_type().getattr("from_toml")?, (slf.get().to_toml(),)))
    }

    fn __repr__(&self) -> String {
        let cell = &self.0;
        format!(
            "<trical.Cell with {}, {}, {}>",
            counted(cell.balls.len(), "ball"),
            counted(cell.tool.targets.len(), "target"),
            counted(cell.anchors.len(), "anchor")
        )
    }
}

/// A robot, or the file that it is in.
#[derive(FromPyObject)]
pub enum RobotArgument {
    /// An object.
    Object(Py<PyRobot>),
    /// A path.
    Path(PathBuf),
}

impl RobotArgument {
    /// The robot.
    pub fn read(&self) -> Result<Robot> {
        match self {
            Self::Object(robot) => Ok(robot.get().0.clone()),
            Self::Path(path) => Ok(Robot::load(path)?),
        }
    }

    /// Its file, without the links that are named behind a `#`.
    pub fn file(&self) -> Option<PathBuf> {
        let Self::Path(path) = self else { return None };
        Some(UrdfPath::of(path).map_or_else(|| path.clone(), |urdf| urdf.path))
    }
}

/// A cell, or the file that it is in.
#[derive(FromPyObject)]
pub enum CellArgument {
    /// An object.
    Object(Py<PyCell>),
    /// A path.
    Path(PathBuf),
}

impl CellArgument {
    /// The cell.
    pub fn read(&self) -> Result<Cell> {
        match self {
            Self::Object(cell) => Ok(cell.get().0.clone()),
            Self::Path(path) => load_cell(path),
        }
    }

    /// Its file.
    pub fn file(&self) -> Option<PathBuf> {
        if let Self::Path(path) = self { Some(path.clone()) } else { None }
    }
}

/// An arm and its cell, each an object or a file.
pub type Machine = (RobotArgument, CellArgument);

/// Both.
pub fn read((robot, cell): &Machine) -> Result<(Robot, Cell)> {
    Ok((robot.read()?, cell.read()?))
}
