//! Measuring: a plan driven by gauge and controller into a recording; touches where the arm stands, and what they say.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use trical_device::procedure::stride;
use trical_device::session::{RunStatus, SessionError, Settings, base, now_ns, tool_point};
use trical_device::{PlanEntry, Progress, RunReport, Session, visits};
use trical_model::error::read_text;
use trical_model::{Cell, Joints, Measured, Recording, Robot, Row};
use trical_plan::{MotionGuard, read_plan};
use trical_recording::RecordingWriter;

use crate::arguments::keywords;
use crate::errors::{Failed, MeasuringError, Result, bad};
use crate::machine::{Machine, PyCell, read};
use crate::rows::PyRows;
use crate::supervised::{End, Tell, supervised};

/// With what to measure, and where to: keywords of `trical.measure` and `trical.touch_here`.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct DeviceKeywords {
    out: PathBuf,
    gauge: String,
    controller: String,
    go: bool,
    resume: bool,
}

impl DeviceKeywords {
    /// A session of no touches, in which the arm may move anywhere.
    fn session<'a>(&'a self, (robot, cell): &'a (Robot, Cell), settings: &'a Settings, end: &'a End) -> Session<'a> {
        Session {
            robot,
            cell,
            plan: &[],
            stride: None,
            gauge: &self.gauge,
            controller: &self.controller,
            out: &self.out,
            resume: self.resume,
            go: self.go,
            settings,
            start_ns: now_ns(),
            guard: &|_, _, _| Ok(()),
            cancel: &end.asked,
            stops: Some(Arc::clone(&end.stops)),
        }
    }
}

/// How to measure: keywords of `trical.measure` and `trical.touch_here`, SI.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct SettingsKeywords {
    epsilon: f64,
    repeatability: f64,
    visits: u32,
    travel_speed: f64,
    touch_speed: f64,
    max_correction: f64,
    max_correction_sum: f64,
    max_corrections: usize,
    stroke: [f64; 2],
    temperature: Option<f64>,
    payload: Option<f64>,
}

impl SettingsKeywords {
    fn read(self) -> PyResult<Settings> {
        for (name, value, unit) in [
            ("epsilon", self.epsilon, "m"),
            ("repeatability", self.repeatability, "m"),
            ("travel_speed", self.travel_speed, "m/s"),
            ("touch_speed", self.touch_speed, "m/s"),
            ("max_correction", self.max_correction, "m"),
            ("max_correction_sum", self.max_correction_sum, "m"),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(bad(format!("{name} is {value} {unit}, expected more than 0")));
            }
        }
        if !(1..=1000).contains(&self.visits) {
            return Err(bad(format!("visits is {}, expected 1 to 1000", self.visits)));
        }
        let [low, high] = self.stroke;
        if low.is_nan() || high.is_nan() || low >= high {
            return Err(bad(format!("stroke is {:?}, expected two numbers, the lower first", self.stroke)));
        }
        Ok(Settings {
            epsilon: self.epsilon,
            repeatability: self.repeatability,
            visits: self.visits,
            travel_speed: self.travel_speed,
            touch_speed: self.touch_speed,
            max_correction: self.max_correction,
            max_sum: self.max_correction_sum,
            max_corrections: self.max_corrections,
            stroke: self.stroke,
            temp_c: self.temperature,
            payload_kg: self.payload,
        })
    }
}

/// A plan: the text of a plan.csv, or the file.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct PlanArgument {
    text: Option<String>,
    path: Option<PathBuf>,
}

impl PlanArgument {
    fn read(self, robot: &Robot, cell: &Cell) -> Result<Vec<PlanEntry>> {
        let (text, name) = match (self.text, self.path) {
            (Some(text), _) => (text, "plan".to_owned()),
            (None, Some(path)) => (read_text(&path)?, path.display().to_string()),
            (None, None) => return Err(bad("expected a plan").into()),
        };
        let plan = read_plan(&text, &name, robot, cell.balls.len()).map_err(|e| bad(e.to_string()))?;
        Ok(plan.iter().map(|e| PlanEntry::new(e.index as u64, e.ball, e.joints, &e.via, e.approach)).collect())
    }
}

/// How a session ended, in Python's words.
fn ended(e: SessionError) -> Failed {
    match e {
        SessionError::Gauge(e) => e.into(),
        SessionError::Controller(e) => e.into(),
        SessionError::Recording(e) => e.into(),
        SessionError::Model(e) => e.into(),
        SessionError::OtherArm { .. } | SessionError::Settings(_) => bad(e.to_string()).into(),
        SessionError::Run(e) if e.goes_on() => {
            MeasuringError::new_err(format!("{e}; what was measured is safe, resume=True goes on")).into()
        }
        SessionError::Run(_) | SessionError::Finish(_) => MeasuringError::new_err(e.to_string()).into(),
    }
}

/// Hears what happens, and tells it as a fraction and words.
fn retell<'a>(status: &'a mut RunStatus, tell: Tell<'a>) -> impl FnMut(Progress) + 'a {
    move |p| {
        status.take(&p, Instant::now());
        let (done, total) = status.counts();
        let fraction = done as f64 / total.max(1) as f64;
        tell(fraction, if let Progress::Warning(w) = &p { format!("note: {w}") } else { status.touch() });
    }
}

/// Touches measured in this run, before it, corrections, warnings, steps of a run that did not move.
type Ran = (usize, usize, usize, Vec<String>, Vec<String>);

fn ran(report: RunReport) -> Ran {
    (report.measured, report.skipped, report.corrections, report.warnings, report.steps)
}

/// Drives through a plan.
#[pyfunction]
pub fn _measure(
    py: Python<'_>,
    plan: PlanArgument,
    machine: Machine,
    given: &Bound<'_, PyDict>,
    progress: Option<Py<PyAny>>,
) -> Result<Ran> {
    let devices: DeviceKeywords = keywords(given)?;
    let settings = keywords::<SettingsKeywords>(given)?.read()?;
    let report = supervised(py, progress, |end, tell| {
        let machine = read(&machine)?;
        let (robot, cell) = &machine;
        let plan = plan.read(robot, cell)?;
        let round = Some(stride(&plan));
        let plan = visits(&plan, settings.visits as usize);
        let guard = MotionGuard::new(robot, cell)?;
        let guard = |from: &Joints, to: &Joints, touched| guard.check(from, to, touched);
        let any = devices.session(&machine, &settings, end);
        let session = Session { plan: &plan, stride: round, guard: &guard, ..any };
        let mut status = RunStatus::default();
        let report = session.perform(&mut retell(&mut status, tell)).map_err(ended)?;
        if let Some(step) = report.steps.iter().find(|step| step.contains("REFUSED")) {
            return Err(MeasuringError::new_err(format!("this plan would be refused: {step}")).into());
        }
        Ok(report)
    })?;
    Ok(ran(report))
}

/// Touches a ball (from 0) where the arm stands, into a recording that is begun or gone on with.
#[pyfunction]
pub fn _touch_here(
    py: Python<'_>,
    ball: usize,
    machine: Machine,
    given: &Bound<'_, PyDict>,
    progress: Option<Py<PyAny>>,
) -> Result<PyRows> {
    let devices: DeviceKeywords = keywords(given)?;
    let settings = keywords::<SettingsKeywords>(given)?.read()?;
    let recording = supervised(py, progress, |end, tell| {
        let machine = read(&machine)?;
        let ((robot, cell), out) = (&machine, &devices.out);
        if ball >= cell.balls.len() {
            return Err(bad(format!("ball is {}, expected 1 to {}", ball + 1, cell.balls.len())).into());
        }
        // no guard: a person brought the arm where it stands
        let session = devices.session(&machine, &settings, end);
        let (mut log, before) = RecordingWriter::resume(out, &session.header())?;
        let index = before.iter().flat_map(|b| &b.recording.rows).filter_map(|r| r.seq).max().map_or(0, |s| s + 1);
        let mut status = RunStatus::default();
        let row = session.touch_here(&mut log, ball, index, &mut retell(&mut status, tell));
        let finished = log.finish();
        let row = row.map_err(ended)?;
        finished.map_err(|e| ended(SessionError::Finish(e)))?;
        let (name, prismatic) = (out.display().to_string(), Some(robot.prismatic()));
        Ok(Recording { name, joints: robot.dof(), prismatic, rows: vec![row], ..Recording::default() })
    })?;
    Ok(PyRows(Arc::new(recording)))
}

/// The touches of a recording.
fn touches(rows: &PyRows) -> Result<Vec<(usize, Row)>> {
    let one = |row: &Row| match row.measured {
        Measured::Touch { ball, .. } => Ok((ball, *row)),
        _ => Err(bad(format!("{}: found a row that is no touch, expected touches only", rows.0.name))),
    };
    Ok(rows.0.rows.iter().map(one).collect::<PyResult<_>>()?)
}

/// The cell with the tool point that touches of one ball say, how well they agree, m.
#[pyfunction]
pub fn _tool_point(recording: &Bound<'_, PyRows>, machine: Machine) -> Result<(PyCell, f64)> {
    let (robot, mut cell) = read(&machine)?;
    let touches = touches(recording.get())?;
    if let [(first, _), rest @ ..] = touches.as_slice()
        && let Some((other, _)) = rest.iter().find(|(ball, _)| ball != first)
    {
        let text = format!("found touches of balls {} and {}, expected touches of one ball", first + 1, other + 1);
        return Err(bad(text).into());
    }
    let rows: Vec<Row> = touches.iter().map(|(_, row)| *row).collect();
    let fit = tool_point(&robot, &cell, &rows)?;
    cell.tool.tcp = fit.tcp_in_flange.into();
    Ok((PyCell(cell), fit.rms))
}

/// A pair of balls from 1, how far they are apart by the touches and by the cell, m.
type Apart = (usize, usize, f64, f64);

/// The cell with the base that the last touches of balls 1, 2 and 3 say, and how far the balls are apart.
#[pyfunction]
pub fn _base(recording: &Bound<'_, PyRows>, machine: Machine) -> Result<(PyCell, Vec<Apart>)> {
    let (robot, mut cell) = read(&machine)?;
    let touches = touches(recording.get())?;
    let of = |k: usize| {
        let row = touches.iter().rev().find(|(ball, _)| *ball == k).map(|(_, row)| row);
        row.ok_or_else(|| bad(format!("ball {} was not touched, expected touches of balls 1, 2 and 3", k + 1)))
    };
    let fit = base(&robot, &cell, [of(0)?, of(1)?, of(2)?])?;
    fit.check()?;
    cell.world_from_base = fit.world_from_base;
    Ok((PyCell(cell), fit.distances.to_vec()))
}
