//! What NumPy users call an array: float64 arrays as they are, everything else made one.

use numpy::ndarray::{Array2, ArrayView1, ArrayView2, Ix1, Ix2};
use numpy::{IntoPyArray, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::IntoPyDict;
use trical_model::{Joints, Robot, State};

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

fn finite<'py>(array: PyReadonlyArrayDyn<'py, f64>, name: &str) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    match array.as_array().iter().all(|x| x.is_finite()) {
        true => Ok(array),
        false => Err(bad(format!("{name} holds a value that is not finite"))),
    }
}

fn shape_of(array: &PyReadonlyArrayDyn<'_, f64>) -> String {
    let shape: Vec<String> = array.shape().iter().map(ToString::to_string).collect();
    format!("({}{})", shape.join(", "), if shape.len() == 1 { "," } else { "" })
}

/// One row, or one for each of several.
pub struct Table<'py>(PyReadonlyArrayDyn<'py, f64>);

impl<'py> Table<'py> {
    /// An array of shape (columns,) or (n, columns), all finite.
    pub fn new(value: &Bound<'py, PyAny>, name: &str, columns: usize) -> PyResult<Self> {
        let array = floats(value, name)?;
        let shape = array.shape();
        let fits = matches!(shape.len(), 1 | 2) && shape.last() == Some(&columns);
        if !fits {
            let shape = shape_of(&array);
            return Err(bad(format!("{name} has the shape {shape}, expected (n, {columns}) or ({columns},)")));
        }
        finite(array, name).map(Self)
    }

    /// Whether it is one row.
    pub fn single(&self) -> bool {
        self.0.ndim() == 1
    }

    /// All rows.
    pub fn rows(&self) -> PyResult<ArrayView2<'_, f64>> {
        let view = self.0.as_array();
        let view = if self.single() { view.insert_axis(numpy::ndarray::Axis(0)) } else { view };
        view.into_dimensionality::<Ix2>().map_err(|e| bad(e.to_string()))
    }
}

/// One number for all, or one for each.
pub struct Column<'py>(PyReadonlyArrayDyn<'py, f64>);

impl<'py> Column<'py> {
    /// A number or an array of shape (n,), all finite.
    pub fn new(value: &Bound<'py, PyAny>, name: &str, n: usize) -> PyResult<Self> {
        let array = floats(value, name)?;
        if !(array.ndim() == 0 || array.shape() == [n]) {
            let shape = shape_of(&array);
            return Err(bad(format!("{name} has the shape {shape}, expected a number or the shape ({n},)")));
        }
        finite(array, name).map(Self)
    }

    /// The number of row k.
    pub fn at(&self, k: usize) -> PyResult<f64> {
        Ok(self.view()?.at(k))
    }

    fn view(&self) -> PyResult<One<'_>> {
        let view = self.0.as_array();
        if view.ndim() == 0 {
            return Ok(One::Same(view.iter().next().copied().unwrap_or(f64::NAN)));
        }
        view.into_dimensionality::<Ix1>().map(One::Each).map_err(|e| bad(e.to_string()))
    }
}

enum One<'a> {
    Same(f64),
    Each(ArrayView1<'a, f64>),
}

impl One<'_> {
    fn at(&self, k: usize) -> f64 {
        match self {
            One::Same(x) => *x,
            One::Each(v) => v[k],
        }
    }
}

/// What is known of each of n poses, as it came from Python.
pub struct Known<'py> {
    q: Table<'py>,
    directions: Option<Table<'py>>,
    time: Option<Column<'py>>,
    seq: Option<Column<'py>>,
    temperature: Option<Column<'py>>,
    payload: Option<Column<'py>>,
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

impl<'py> Known<'py> {
    /// Joint values (n, joints) or (joints,) of an arm, and what is known beside them.
    pub fn new(q: &Bound<'py, PyAny>, joints: usize, beside: &Beside<'_, 'py>) -> PyResult<Self> {
        let q = Table::new(q, "q", joints)?;
        let n = q.rows()?.nrows();
        let column = |value: Option<&Bound<'py, PyAny>>, name: &str| {
            value.filter(|v| !v.is_none()).map(|v| Column::new(v, name, n)).transpose()
        };
        let directions = beside
            .directions
            .filter(|v| !v.is_none())
            .map(|v| {
                let table = Table::new(v, "directions", joints)?;
                let rows = table.rows()?;
                if !(table.single() || rows.nrows() == n) {
                    return Err(bad(format!("directions has {} rows, but q has {n}", rows.nrows())));
                }
                if let Some(other) = rows.iter().find(|x| ![-1.0, 0.0, 1.0].contains(*x)) {
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
        self.q.single()
    }

    /// The poses, for threads that know nothing of Python.
    pub fn states(&self) -> PyResult<States<'_>> {
        Ok(States {
            q: self.q.rows()?,
            directions: self.directions.as_ref().map(Table::rows).transpose()?,
            time: self.time.as_ref().map(Column::view).transpose()?,
            seq: self.seq.as_ref().map(Column::view).transpose()?,
            temperature: self.temperature.as_ref().map(Column::view).transpose()?,
            payload: self.payload.as_ref().map(Column::view).transpose()?,
        })
    }
}

/// Views into the arrays of [`Known`].
pub struct States<'a> {
    q: ArrayView2<'a, f64>,
    directions: Option<ArrayView2<'a, f64>>,
    time: Option<One<'a>>,
    seq: Option<One<'a>>,
    temperature: Option<One<'a>>,
    payload: Option<One<'a>>,
}

impl States<'_> {
    /// Number of poses.
    pub fn len(&self) -> usize {
        self.q.nrows()
    }

    /// Pose k.
    pub fn at(&self, k: usize) -> State {
        let q: Joints = std::array::from_fn(|j| self.q.get((k, j)).copied().unwrap_or(0.0));
        let dir = self.directions.as_ref().map(|d| {
            let row = if d.nrows() == 1 { 0 } else { k };
            // -1, 0 or 1
            std::array::from_fn(|j| d.get((row, j)).map_or(0, |sense| *sense as i8))
        });
        let number = |c: &Option<One<'_>>| c.as_ref().map(|c| c.at(k));
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
    Ok(Known::new(q, robot.dof(), &Beside::default())?.states()?.at(0).q)
}

/// An array (n, columns), or its only row.
pub fn rows_or_one<'py>(py: Python<'py>, array: Array2<f64>, single: bool) -> Bound<'py, PyAny> {
    if single { array.row(0).to_owned().into_pyarray(py).into_any() } else { array.into_pyarray(py).into_any() }
}

/// Joint values of many poses as an array (n, joints).
pub fn joints_array(all: &[Joints], dof: usize) -> Array2<f64> {
    Array2::from_shape_fn((all.len(), dof), |(i, k)| all[i][k])
}
