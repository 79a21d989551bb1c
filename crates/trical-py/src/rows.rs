//! The rows of a recording: from files, from arrays, as arrays.

use std::ffi::CString;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use numpy::ndarray::{Array1, Array2};
use numpy::{Element, IntoPyArray, PyReadonlyArray1, PyUntypedArrayMethods};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};
use trical_model::{MAX_JOINTS, Measured, Recording, Robot, Row, State};
use trical_recording::csv::is_nothing;
use trical_recording::mcap::{Header, write_recording};
use trical_recording::{Expected, Places, ROOM_C, open, open_damaged, output, parse, refuse_other_units, to_csv};

use crate::arguments::path_of;
use crate::arrays::floats;
use crate::errors::{RecordingError, Result, bad, check, write};

/// Joints turn no further (rad or m), and no instrument looks further (m), than in files.
const FAR_JOINT: f64 = 1750.0;
const FAR: f64 = 1e3;

/// The rows of a recording; `trical.Recording` shows them.
#[pyclass(name = "Rows", module = "trical._native", frozen)]
pub struct PyRows(pub Arc<Recording>);

/// A column of a table: numbers, of which one that is not a number is missing, or texts.
#[derive(FromPyObject)]
enum InTable<'py> {
    Numbers(PyReadonlyArray1<'py, f64>),
    Texts(Vec<String>),
}

impl InTable<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Numbers(numbers) => numbers.len(),
            Self::Texts(texts) => texts.len(),
        }
    }
}

/// The text of a CSV with these columns.
fn csv_of(columns: &[(String, InTable<'_>)]) -> csv::Result<Vec<u8>> {
    let mut text = csv::Writer::from_writer(Vec::new());
    text.write_record(columns.iter().map(|(name, _)| name))?;
    let mut number = String::new();
    for k in 0..columns.first().map_or(0, |(_, column)| column.len()) {
        for (_, column) in columns {
            match column {
                InTable::Texts(texts) => text.write_field(&texts[k])?,
                InTable::Numbers(numbers) => {
                    let x = numbers.as_array()[k];
                    number.clear();
                    if !x.is_nan() {
                        let _ = write!(number, "{x:?}");
                    }
                    text.write_field(&number)?;
                }
            }
        }
        text.write_record(None::<&[u8]>)?;
    }
    text.into_inner().map_err(|e| e.into_error().into())
}

fn wrong(text: String) -> PyErr {
    RecordingError::new_err(text)
}

/// Reads a recording, CSV or MCAP. A damaged MCAP is refused unless a part of it will do.
pub fn load<'a>(path: &Path, expected: impl Into<Expected<'a>>, part: bool) -> Result<Recording> {
    warned(if part { open_damaged(path, expected)?.0 } else { open(path, expected)? })
}

/// Says how a file was read, as a warning of Python: rows that were left out, decimal commas.
fn warned(recording: Recording) -> Result<Recording> {
    let warn = |note: &String| {
        let text = CString::new(note.replace('\0', " ")).unwrap_or_default();
        Python::attach(|py| PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 2))
    };
    recording.notes.iter().try_for_each(warn)?;
    Ok(recording)
}

/// Writes a .csv or an .mcap.
pub fn save(recording: &Recording, path: &Path) -> Result<()> {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        Some("csv") => Ok(write(path, &to_csv(recording)?)?),
        Some("mcap") => {
            check(output::check_output(path, []).and_then(|()| output::check_not_measured(path)))?;
            Ok(write_recording(path, recording, &Header::for_joints(recording.joints))?)
        }
        _ => Err(bad(format!("{}: the name must end in .csv or .mcap", path.display())).into()),
    }
}

/// A recording, or the file that it is in.
#[derive(FromPyObject)]
pub enum RecordingArgument {
    /// An object.
    Rows(Py<PyRows>),
    /// A path.
    Path(PathBuf),
}

/// Reads what is in files.
pub fn read_all(list: &[RecordingArgument], robot: &Robot) -> Result<Vec<Recording>> {
    let one = |r: &RecordingArgument| {
        let recording = match r {
            RecordingArgument::Rows(rows) => Recording::clone(&rows.get().0),
            RecordingArgument::Path(path) => load(path, robot, false)?,
        };
        refuse_other_units(&recording, robot)?;
        Ok(recording)
    };
    list.iter().map(one).collect()
}

/// A column that came from Python, row by row; without values where it was not given.
struct Column {
    name: &'static str,
    width: usize,
    data: Vec<f64>,
}

impl Column {
    /// A column of `n` rows with `width` numbers each; one row (one number) stands for all.
    fn of(columns: &Bound<'_, PyDict>, name: &'static str, n: usize, width: usize) -> PyResult<Self> {
        let Some(value) = columns.get_item(name)?.filter(|v| !v.is_none()) else {
            return Ok(Self { name, width, data: Vec::new() });
        };
        let array = floats(&value, name)?;
        let view = array.as_array();
        let shape = view.shape();
        let whole: &[usize] = if width == 1 { &[n] } else { &[n, width] };
        // of an arm with one joint
        let data: Vec<f64> = if shape == whole || shape == [n, width] {
            view.iter().copied().collect()
        } else if (width == 1 && shape.is_empty()) || (width > 1 && shape == [width]) {
            let row: Vec<f64> = view.iter().copied().collect();
            row.iter().copied().cycle().take(width * n).collect()
        } else {
            return Err(wrong(format!("{name} has the shape {shape:?}, expected {whole:?}")));
        };
        Ok(Self { name, width, data })
    }

    /// The numbers of a row; `None` where nothing was measured or known.
    fn row(&self, k: usize) -> Option<&[f64]> {
        let row = self.data.get(self.width * k..self.width * (k + 1))?;
        row.iter().any(|x| !x.is_nan()).then_some(row)
    }

    /// [`Column::row`], whose numbers are between -`limit` and `limit`.
    fn within(&self, k: usize, limit: f64) -> PyResult<Option<&[f64]>> {
        let Some(row) = self.row(k) else { return Ok(None) };
        match row.iter().find(|x| x.is_nan() || x.abs() > limit) {
            None => Ok(Some(row)),
            Some(x) => Err(self.wrong(k, *x, &format!("a number between -{limit} and {limit}{}", self.meaning()))),
        }
    }

    /// What is missed where a clock is taken for the time of a recording.
    fn meaning(&self) -> &'static str {
        if self.name == "time" { ": seconds since the recording began; subtract the first time" } else { "" }
    }

    fn number(&self, k: usize) -> Option<f64> {
        self.row(k).map(|row| row[0])
    }

    /// A whole number from 0, below `limit`.
    fn whole(&self, k: usize, limit: f64, expected: &str) -> PyResult<Option<u64>> {
        match self.number(k) {
            None => Ok(None),
            Some(x) if x.fract() == 0.0 && (0.0..limit).contains(&x) => {
                let x = x as u64;
                Ok(Some(x))
            }
            Some(x) => Err(self.wrong(k, x, expected)),
        }
    }

    /// A number counted from 1 as one counted from 0, or `None` for 0 and nan.
    fn index(&self, k: usize) -> PyResult<Option<usize>> {
        let counted = self.whole(k, 1e6, "a number counted from 1")?;
        Ok(counted.and_then(|n| usize::try_from(n).ok()?.checked_sub(1)))
    }

    fn wrong(&self, k: usize, found: f64, expected: &str) -> PyErr {
        wrong(format!("{}, row {k}: found {found}, expected {expected}", self.name))
    }
}

/// All columns of a recording.
struct Columns {
    q: Column,
    commanded: Column,
    directions: Column,
    torques: Column,
    place: Option<Vec<String>>,
    prismatic: Option<[bool; MAX_JOINTS]>,
    time: Column,
    temperature: Column,
    payload: Column,
    pose: Column,
    ball: Column,
    target: Column,
    reference: Column,
    anchor: Column,
    distance: Column,
    line: Column,
    indicators: Column,
    position: Column,
    orientation: Column,
}

impl Columns {
    fn of(columns: &Bound<'_, PyDict>, n: usize, joints: usize) -> PyResult<Self> {
        let column = |name, width| Column::of(columns, name, n, width);
        let place: Option<Vec<String>> = columns.get_item("place")?.map(|names| names.extract()).transpose()?;
        if let Some(found) = place.as_ref().map(Vec::len).filter(|found| *found != n) {
            return Err(wrong(format!("place has {found} names, expected {n}")));
        }
        let mut prismatic = None;
        if let Some(slides) = columns.get_item("prismatic")? {
            let slides: Vec<bool> = slides.extract()?;
            if slides.len() != joints {
                return Err(wrong(format!(
                    "prismatic has {} values, expected one for each of {joints} joints",
                    slides.len()
                )));
            }
            let to = prismatic.insert([false; MAX_JOINTS]);
            to.iter_mut().zip(slides).for_each(|(to, from)| *to = from);
        }
        Ok(Self {
            q: column("q", joints)?,
            commanded: column("commanded", joints)?,
            directions: column("directions", joints)?,
            torques: column("torques", joints)?,
            place,
            prismatic,
            time: column("time", 1)?,
            temperature: column("temperature", 1)?,
            payload: column("payload", 1)?,
            pose: column("pose", 1)?,
            ball: column("ball", 1)?,
            target: column("target", 1)?,
            reference: column("reference", 1)?,
            anchor: column("anchor", 1)?,
            distance: column("distance", 1)?,
            line: column("line", 1)?,
            indicators: column("indicators", 3)?,
            position: column("position", 3)?,
            orientation: column("orientation", 4)?,
        })
    }

    /// What is known of the arm at row `k`; rows come in the order of time, `last` is the latest so far.
    fn state(&self, k: usize, places: &mut Places, last: &mut f64) -> PyResult<State> {
        // a row without joints is one whose first joint is nan
        let Some(q) = self.q.within(k, FAR_JOINT)? else {
            return Err(self.q.wrong(k, f64::NAN, &format!("a number between -{FAR_JOINT} and {FAR_JOINT}")));
        };
        let mut state = State::at(q);
        state.q_commanded = self.commanded.within(k, FAR_JOINT)?.map(|c| State::at(c).q);
        if let Some(d) = self.directions.row(k) {
            let mut dir = [0; MAX_JOINTS];
            for (to, from) in dir.iter_mut().zip(d) {
                *to = match *from {
                    1.0 => 1,
                    0.0 => 0,
                    -1.0 => -1,
                    x => return Err(self.directions.wrong(k, x, "-1, 0 or 1")),
                };
            }
            state.dir = Some(dir);
        }
        state.torques = self.torques.within(k, 1e9)?.map(|t| State::at(t).q);
        if let Some(name) = self.place.as_ref().map(|names| names[k].trim()).filter(|name| !is_nothing(name)) {
            state.place = Some(places.index_of(name).map_err(|e| wrong(format!("place, row {k}: {e}")))?);
        }
        let number = |column: &Column| Ok::<_, PyErr>(column.within(k, 1e9)?.map(|x| x[0]));
        state.t = number(&self.time)?;
        state.temp_c = number(&self.temperature)?;
        if let Some(found) = state.temp_c.filter(|t| !ROOM_C.contains(t)) {
            return Err(self.temperature.wrong(k, found, &format!("{} to {} degC", ROOM_C.start(), ROOM_C.end())));
        }
        state.payload_kg = number(&self.payload)?;
        if let Some(t) = state.t {
            if t < *last {
                let text = format!("time, row {k}: found {t} after {last}, expected rows in the order of time");
                return Err(wrong(text));
            }
            *last = t;
        }
        Ok(state)
    }

    /// What was measured at row `k`.
    fn measured(&self, k: usize) -> PyResult<Measured> {
        let touch = self.ball.index(k)?;
        let kinds = [touch.is_some(), self.distance.row(k).is_some(), self.position.row(k).is_some()];
        if kinds.iter().filter(|k| **k).count() != 1 {
            return Err(wrong(format!(
                "row {k}: {}; expected ball and indicators (a touch), position (a point or pose) or distance",
                if kinds.contains(&true) { "found several measurements" } else { "found no measurement" }
            )));
        }
        if let Some(ball) = touch {
            let reading = self
                .indicators
                .within(k, FAR)?
                .map(array)
                .ok_or_else(|| wrong(format!("row {k}: touches ball {}, but has no indicators", ball + 1)))?;
            return Ok(Measured::Touch { ball, reading });
        }
        if let Some(length) = self.distance.within(k, FAR)?.map(|x| x[0]) {
            if length <= 0.0 {
                return Err(self.distance.wrong(k, length, "a positive length"));
            }
            return Ok(Measured::Distance { anchor: self.anchor.index(k)?.unwrap_or(0), length });
        }
        let position = self.position.within(k, FAR)?.map(array).unwrap_or_default();
        let (target, reference) = (self.target.index(k)?, self.reference.index(k)?);
        match (self.orientation.row(k), target, reference) {
            (_, Some(_), Some(_)) => {
                Err(wrong(format!("row {k}: names a target and a reference, expected one of them")))
            }
            (Some(_), Some(target), None) if target > 0 => Err(wrong(format!(
                "target, row {k}: found target {} with an orientation; full poses are of the tool: leave out the orientation or the target",
                target + 1
            ))),
            (Some(o), _, None) => {
                let norm = o.iter().map(|x| x * x).sum::<f64>().sqrt();
                if norm.is_nan() || (norm - 1.0).abs() > 1e-2 {
                    let text = format!("orientation, row {k}: the quaternion has length {norm:.4}, expected 1");
                    return Err(wrong(text));
                }
                Ok(Measured::Pose { position, quaternion: array(o) })
            }
            // a fixed point has no orientation, whatever the instrument says beside it
            (_, None, Some(reference)) => Ok(Measured::Reference { reference, position }),
            (None, target, None) => Ok(Measured::Point { target: target.unwrap_or(0), position }),
        }
    }
}

fn array<const N: usize>(v: &[f64]) -> [f64; N] {
    std::array::from_fn(|i| v[i])
}

#[pymethods]
impl PyRows {
    /// Reads a CSV or an MCAP.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf, joints: Option<usize>, part: bool) -> Result<Self> {
        py.detach(|| load(&path, joints, part)).map(|r| Self(Arc::new(r)))
    }

    /// Reads columns by name, as a CSV has them.
    #[staticmethod]
    fn table(py: Python<'_>, name: &str, columns: Vec<(String, InTable<'_>)>) -> Result<Self> {
        if let Some(two) = columns.windows(2).find(|two| two[0].1.len() != two[1].1.len()) {
            let [(a, first), (b, second)] = [&two[0], &two[1]];
            return Err(wrong(format!("{name}: column {a} has {} rows, {b} has {}", first.len(), second.len())).into());
        }
        let text = csv_of(&columns).map_err(|e| bad(format!("{name}: {e}")))?;
        py.detach(|| Ok(Self(Arc::new(warned(parse(name, text.as_slice())?)?))))
    }

    /// From arrays by name.
    #[staticmethod]
    fn build(name: String, columns: &Bound<'_, PyDict>) -> PyResult<Self> {
        let q = columns.get_item("q")?.ok_or_else(|| wrong("q is missing".into()))?;
        let q = floats(&q, "q")?;
        let q = q.as_array();
        let (n, joints) = match q.shape() {
            [n, j] if *n > 0 && (1..=MAX_JOINTS).contains(j) => (*n, *j),
            other => {
                return Err(wrong(format!(
                    "q has the shape {other:?}, expected (n, joints) with 1 to {MAX_JOINTS} joints"
                )));
            }
        };
        let columns = Columns::of(columns, n, joints)?;
        let mut places = Places::default();
        let mut last = f64::NEG_INFINITY;
        let mut row = |k: usize| {
            let state = columns.state(k, &mut places, &mut last)?;
            let (measured, seq) = (columns.measured(k)?, columns.pose.whole(k, 1e15, "a whole number from 0")?);
            Ok(Row { state, measured, seq, line: columns.line.index(k)?.map_or(k + 2, |l| l + 1) })
        };
        let rows = (0..n).map(&mut row).collect::<PyResult<_>>()?;
        let (prismatic, places) = (columns.prismatic, places.into_names());
        Ok(Self(Arc::new(Recording { name, joints, prismatic, places, rows, notes: Vec::new() })))
    }

    /// Where it came from.
    #[getter]
    fn name(&self) -> String {
        self.0.name.clone()
    }

    /// Number of the arm's joints.
    #[getter]
    fn joints(&self) -> usize {
        self.0.joints
    }

    fn __len__(&self) -> usize {
        self.0.rows.len()
    }

    /// Some of the rows, in the order of the recording.
    fn take(&self, rows: Vec<usize>) -> PyResult<Self> {
        let n = self.0.rows.len();
        let one = |k: &usize| self.0.rows.get(*k).copied().ok_or_else(|| bad(format!("there is no row {k} of {n}")));
        let rows = rows.iter().map(one).collect::<PyResult<Vec<_>>>()?;
        let shared = &self.0;
        Ok(Self(Arc::new(Recording {
            name: shared.name.clone(),
            places: shared.places.clone(),
            notes: shared.notes.clone(),
            rows,
            ..*shared.as_ref()
        })))
    }

    /// A column as an array, or None where no row has it.
    fn column<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        let (rows, n) = (&self.0.rows, self.0.joints);
        let whole = |f: &dyn Fn(&Row) -> Option<usize>| {
            let any = rows.iter().any(|r| f(r).is_some());
            any.then(|| column(py, rows, &|r| f(r).map_or(0_i64, |k| i64::try_from(k + 1).unwrap_or(0))))
        };
        let number = |f: &dyn Fn(&Row) -> Option<f64>| {
            rows.iter().any(|r| f(r).is_some()).then(|| column(py, rows, &|r| f(r).unwrap_or(f64::NAN)))
        };
        Ok(match name {
            "q" => wide(py, rows, n, |r| Some(r.state.q)),
            "commanded" => wide(py, rows, n, |r| r.state.q_commanded),
            "torques" => wide(py, rows, n, |r| r.state.torques),
            "place" if self.0.places.is_empty() => None,
            "place" => {
                let name = |r: &Row| r.state.place.and_then(|k| self.0.places.get(k)).cloned().unwrap_or_default();
                Some(PyList::new(py, rows.iter().map(name))?.into_any())
            }
            "prismatic" => match self.0.prismatic {
                Some(slides) => Some(PyList::new(py, slides.iter().take(n))?.into_any()),
                None => None,
            },
            "directions" if rows.iter().all(|r| r.state.dir.is_some()) => {
                let all = Array2::from_shape_fn((rows.len(), n), |(k, j)| rows[k].state.dir.map_or(0, |d| d[j]));
                Some(all.into_pyarray(py).into_any())
            }
            // nan can say that a row has none
            "directions" => wide(py, rows, n, |r| r.state.dir.map(|d| d.map(f64::from))),
            "time" => number(&|r| r.state.t),
            "temperature" => number(&|r| r.state.temp_c),
            "payload" => number(&|r| r.state.payload_kg),
            "pose" => number(&|r| r.seq.map(|s| s as f64)),
            "line" => Some(column(py, rows, &|r| i64::try_from(r.line).unwrap_or(0))),
            "kind" => Some(column(py, rows, &|r| match r.measured {
                Measured::Touch { .. } => 0_i8,
                Measured::Point { .. } => 1,
                Measured::Reference { .. } => 2,
                Measured::Distance { .. } => 3,
                Measured::Pose { .. } => 4,
            })),
            "ball" | "target" | "reference" | "anchor" => {
                whole(&|r| r.measured.of_which().filter(|of| of.0 == name).map(|of| of.1))
            }
            "distance" => number(&|r| match r.measured {
                Measured::Distance { length, .. } => Some(length),
                _ => None,
            }),
            "indicators" => wide(py, rows, 3, |r| match r.measured {
                Measured::Touch { reading, .. } => Some(reading),
                _ => None,
            }),
            "position" => wide(py, rows, 3, |r| match r.measured {
                Measured::Point { position, .. }
                | Measured::Reference { position, .. }
                | Measured::Pose { position, .. } => Some(position),
                _ => None,
            }),
            "orientation" => wide(py, rows, 4, |r| match r.measured {
                Measured::Pose { quaternion, .. } => Some(quaternion),
                _ => None,
            }),
            other => return Err(bad(format!("a recording has no column {other}"))),
        })
    }

    /// The bytes of the CSV.
    fn to_csv<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &to_csv(&self.0)?))
    }

    /// Writes a .csv or an .mcap.
    fn save(&self, #[pyo3(from_py_with = path_of)] path: PathBuf) -> Result<()> {
        save(&self.0, &path)
    }
}

fn column<'py, T: Element>(py: Python<'py>, rows: &[Row], f: &dyn Fn(&Row) -> T) -> Bound<'py, PyAny> {
    Array1::from_iter(rows.iter().map(f)).into_pyarray(py).into_any()
}

/// An array (n, width) of the first numbers, nan where a row has nothing; `None` where none has.
fn wide<'py, const N: usize>(
    py: Python<'py>,
    rows: &[Row],
    width: usize,
    f: impl Fn(&Row) -> Option<[f64; N]>,
) -> Option<Bound<'py, PyAny>> {
    if !rows.iter().any(|r| f(r).is_some()) {
        return None;
    }
    let mut all = Vec::with_capacity(rows.len() * width);
    rows.iter().for_each(|r| all.extend_from_slice(&f(r).unwrap_or([f64::NAN; N])[..width]));
    Some(Array2::from_shape_vec((rows.len(), width), all).ok()?.into_pyarray(py).into_any())
}
