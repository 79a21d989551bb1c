//! What NumPy users call an array: float64 arrays as they are, everything else made one.

use numpy::ndarray::{Array2, Ix2};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::IntoPyDict;
use trical_model::{Joints, Pose, Robot, State};

use crate::errors::bad;

/// A value as an array of floats: not copied where it is one. What a masked array hides is missing: not a number.
pub fn floats<'py>(value: &Bound<'py, PyAny>, name: &str) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    let py = value.py();
    let numpy = py.import("numpy")?;
    let keywords = [("dtype", "float64")].into_py_dict(py)?;
    let wrong = |e: PyErr| bad(format!("{name}: expected numbers or an array of them ({})", e.value(py)));
    let masked = py.import("numpy.ma")?;
    if masked.call_method1("isMaskedArray", (value,))?.is_truthy()? {
        let floats = value.call_method1("astype", ("float64",)).map_err(wrong)?;
        return floats.call_method1("filled", (f64::NAN,)).map_err(wrong)?.extract().map_err(wrong);
    }
    if let Ok(array) = value.extract::<PyReadonlyArrayDyn<'py, f64>>() {
        return Ok(array);
    }
    let array = numpy.call_method("asarray", (value,), Some(&keywords)).map_err(wrong)?;
    array.extract().map_err(wrong)
}

fn check_finite(array: &PyReadonlyArrayDyn<'_, f64>, name: &str) -> PyResult<()> {
    match array.as_array().iter().all(|x| x.is_finite()) {
        true => Ok(()),
        false => Err(bad(format!("{name} holds a value that is not finite"))),
    }
}

fn shape_of(array: &PyReadonlyArrayDyn<'_, f64>) -> String {
    let shape: Vec<String> = array.shape().iter().map(ToString::to_string).collect();
    format!("({}{})", shape.join(", "), if shape.len() == 1 { "," } else { "" })
}

/// One row, or one for each of several.
pub struct Table {
    /// All rows.
    pub rows: Array2<f64>,
    /// Whether it is one row.
    pub single: bool,
}

impl Table {
    /// An array of shape (columns,) or (n, columns), all finite.
    pub fn new(value: &Bound<'_, PyAny>, name: &str, columns: usize) -> PyResult<Self> {
        let array = floats(value, name)?;
        let shape = array.shape();
        let fits = matches!(shape.len(), 1 | 2) && shape.last() == Some(&columns);
        if !fits {
            let shape = shape_of(&array);
            return Err(bad(format!("{name} has the shape {shape}, expected (n, {columns}) or ({columns},)")));
        }
        check_finite(&array, name)?;
        let (view, single) = (array.as_array(), array.ndim() == 1);
        let view = if single { view.insert_axis(numpy::ndarray::Axis(0)) } else { view };
        let rows = view.into_dimensionality::<Ix2>().map_err(|e| bad(e.to_string()))?.to_owned();
        Ok(Self { rows, single })
    }

    /// Whether it has as many rows as these, or one for all of them.
    pub fn goes_with(&self, rows: &Array2<f64>) -> bool {
        self.single || self.rows.nrows() == rows.nrows()
    }
}

/// One number for all, or one for each.
pub struct Column(Vec<f64>);

impl Column {
    /// A number or an array of shape (n,), all finite.
    pub fn new(value: &Bound<'_, PyAny>, name: &str, n: usize) -> PyResult<Self> {
        let array = floats(value, name)?;
        if !(array.ndim() == 0 || array.shape() == [n]) {
            let shape = shape_of(&array);
            return Err(bad(format!("{name} has the shape {shape}, expected a number or the shape ({n},)")));
        }
        check_finite(&array, name)?;
        Ok(Self(array.as_array().iter().copied().collect()))
    }

    /// The number of row k.
    pub fn at(&self, k: usize) -> f64 {
        self.0[if self.0.len() == 1 { 0 } else { k }]
    }
}

/// What is known of each of n poses.
pub struct States {
    q: Table,
    directions: Option<Table>,
    time: Option<Column>,
    seq: Option<Column>,
    temperature: Option<Column>,
    payload: Option<Column>,
}

/// Optional arrays that belong to joint values.
#[derive(Default)]
pub struct Beside<'a, 'py> {
    /// Senses of the last motion, (n, joints) or (joints,).
    pub directions: Option<&'a Bound<'py, PyAny>>,
    /// s
    pub time: Option<&'a Bound<'py, PyAny>>,
    pub seq: Option<&'a Bound<'py, PyAny>>,
    /// degC
    pub temperature: Option<&'a Bound<'py, PyAny>>,
    /// kg
    pub payload: Option<&'a Bound<'py, PyAny>>,
}

impl States {
    /// Joint values (n, joints) or (joints,) of an arm, and what is known beside them.
    pub fn new(q: &Bound<'_, PyAny>, joints: usize, beside: &Beside<'_, '_>) -> PyResult<Self> {
        let q = Table::new(q, "q", joints)?;
        let n = q.rows.nrows();
        let column = |value: Option<&Bound<'_, PyAny>>, name: &str| {
            value.filter(|v| !v.is_none()).map(|v| Column::new(v, name, n)).transpose()
        };
        let directions = beside
            .directions
            .filter(|v| !v.is_none())
            .map(|v| {
                let table = Table::new(v, "directions", joints)?;
                if !table.goes_with(&q.rows) {
                    return Err(bad(format!("directions has {} rows, but q has {n}", table.rows.nrows())));
                }
                if let Some(other) = table.rows.iter().find(|x| ![-1.0, 0.0, 1.0].contains(*x)) {
                    return Err(bad(format!("directions holds {other}, expected -1, 0 or 1")));
                }
                Ok(table)
            })
            .transpose()?;
        Ok(Self {
            q,
            directions,
            time: column(beside.time, "time")?,
            seq: column(beside.seq, "seq")?,
            temperature: column(beside.temperature, "temperature")?,
            payload: column(beside.payload, "payload")?,
        })
    }

    /// Whether it is one pose.
    pub fn single(&self) -> bool {
        self.q.single
    }

    /// Number of poses.
    pub fn len(&self) -> usize {
        self.q.rows.nrows()
    }

    /// Pose k.
    pub fn at(&self, k: usize) -> State {
        let q: Joints = std::array::from_fn(|j| self.q.rows.get((k, j)).copied().unwrap_or(0.0));
        let dir = self.directions.as_ref().map(|Table { rows, .. }| {
            let row = if rows.nrows() == 1 { 0 } else { k };
            // -1, 0 or 1
            std::array::from_fn(|j| rows.get((row, j)).map_or(0, |sense| *sense as i8))
        });
        let number = |c: &Option<Column>| c.as_ref().map(|c| c.at(k));
        State {
            dir,
            t: number(&self.time),
            seq: number(&self.seq),
            temp_c: number(&self.temperature),
            payload_kg: number(&self.payload),
            ..State::at(&q)
        }
    }
}

/// Joint values (joints,) of an arm, or the first of several.
pub fn one_pose(q: &Bound<'_, PyAny>, robot: &Robot) -> PyResult<Joints> {
    Ok(States::new(q, robot.dof(), &Beside::default())?.at(0).q)
}

/// Position (3,) m and rotation (3, 3).
pub type PoseArrays<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

/// A pose as Python has it.
pub fn pose_arrays<'py>(py: Python<'py>, pose: &Pose) -> PoseArrays<'py> {
    let rotation = Array2::from_shape_fn((3, 3), |(i, j)| pose.rotation[(i, j)]);
    (pose.translation.as_slice().to_vec().into_pyarray(py), rotation.into_pyarray(py))
}

/// An array (n, columns), or its only row.
pub fn rows_or_one<'py>(py: Python<'py>, array: Array2<f64>, single: bool) -> Bound<'py, PyAny> {
    if single { array.row(0).to_owned().into_pyarray(py).into_any() } else { array.into_pyarray(py).into_any() }
}

/// Joint values of many poses as an array (n, joints).
pub fn joints_array(all: &[Joints], dof: usize) -> Array2<f64> {
    Array2::from_shape_fn((all.len(), dof), |(i, k)| all[i][k])
}
