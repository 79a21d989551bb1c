//! A measuring session: a plan, gauge and controller by their URLs, a recording that can be taken up.

mod run_status;
mod settings;
mod touch_here;

use std::cell::RefCell;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{SystemTime, UNIX_EPOCH};

use nalgebra::Vector3;
use sha2::{Digest, Sha256};
use thiserror::Error;
use trical_model::ik::continue_from;
use trical_model::pose::angles_zyx;
use trical_model::robot::tidy;
use trical_model::{Cell, Forward, Joints, Model, ModelError, Robot, State, urdf};

pub use run_status::RunStatus;
pub use settings::Settings;
pub use touch_here::{BaseFit, SetUpError, base, tool_point, turned};

use crate::controller::{Controller, ControllerError, StopCount, open_controller};
use crate::gauge::{GaugeError, open_gauge};
use crate::procedure::{MoveGuard, PlanEntry, ProcedureError, ProcedureOptions, Progress, RunReport, dry_run, run};
use crate::url::without_secrets;
use trical_recording::mcap::{Attachment, Header, RecordingWriter, check_not_written, check_same};
use trical_recording::{ReadRecording, RecordError};

/// What a measuring run needs.
pub struct Session<'a> {
    /// The arm.
    pub robot: &'a Robot,
    /// The cell.
    pub cell: &'a Cell,
    /// The plan, with all visits.
    pub plan: &'a [PlanEntry],
    /// Numbers of one round of visits.
    pub stride: Option<u64>,
    /// Gauge URL.
    pub gauge: &'a str,
    /// Controller URL.
    pub controller: &'a str,
    /// Recording.
    pub out: &'a Path,
    /// Whether to go on with a recording.
    pub resume: bool,
    /// Whether to move.
    pub go: bool,
    /// How to measure.
    pub settings: &'a Settings,
    /// When the recording begins, ns since 1970.
    pub start_ns: u64,
    /// Asked before each motion (the collision model).
    pub guard: MoveGuard<'a>,
    /// Set by who wants it to end in order.
    pub cancel: &'a AtomicBool,
    /// How often the user has asked for the end: a motion under way stops when it grows. `None` = it ends first.
    pub stops: Option<StopCount>,
}

/// Why a session ended early.
#[derive(Debug, Error)]
pub enum SessionError {
    /// A setting that no measurement has; nothing has moved.
    #[error("{0}")]
    Settings(String),
    /// Robot or cell make no sense; nothing has moved.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The gauge cannot be used; nothing has moved.
    #[error(transparent)]
    Gauge(GaugeError),
    /// The controller cannot be used; nothing has moved.
    #[error(transparent)]
    Controller(ControllerError),
    /// The controller's arm is another one; nothing has moved.
    #[error("{controller} says that its arm has {found} joints, {robot} has {expected}")]
    OtherArm {
        /// The controller.
        controller: String,
        /// Joints that it says.
        found: usize,
        /// The robot's name.
        robot: String,
        /// Joints that it has.
        expected: usize,
    },
    /// The recording cannot be begun or taken up; nothing has moved.
    #[error(transparent)]
    Recording(RecordError),
    /// The run ended; what was measured is in the recording.
    #[error(transparent)]
    Run(ProcedureError),
    /// Everything was measured, but the recording could not be finished.
    #[error(transparent)]
    Finish(RecordError),
}

/// A recording that is gone on with after a longer break tells of a wrong clock rather, s: a year.
const LONGEST_BREAK_S: f64 = 366.0 * 86_400.0;

/// Setting of a recording: serial number of the controller.
const SERIAL_NUMBER: &str = "serial_number";

/// Nanoseconds since 1970.
#[must_use]
pub fn now_ns() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(0)
}

/// Tells one plan from another: SHA-256 of what its first round of visits says, to the decimals of a plan file; `None` where
/// there is no plan. `stride` = numbers of one round.
fn plan_sha256(plan: &[PlanEntry], stride: Option<u64>) -> Option<String> {
    let mut hash = Sha256::new();
    for entry in plan.iter().filter(|entry| stride.is_none_or(|stride| entry.index < stride)) {
        hash.update(format!("{} {}", entry.index, entry.ball));
        for q in entry.via.iter().chain([&entry.joints]).flatten() {
            // no -0
            hash.update(format!(" {}", (q.to_degrees() * 1e6).round() + 0.0));
        }
        hash.update("\n");
    }
    (!plan.is_empty()).then(|| hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}

/// A controller by its URL, which moves this arm.
///
/// # Errors
/// It cannot be used, or has another arm.
pub fn open_controller_of(url: &str, robot: &Robot, cell: &Cell) -> Result<Box<dyn Controller>, SessionError> {
    let mut controller = open_controller(url).map_err(SessionError::Controller)?;
    if controller.joint_count() != robot.dof() {
        return Err(SessionError::OtherArm {
            controller: controller.name(),
            found: controller.joint_count(),
            robot: robot.name.clone(),
            expected: robot.dof(),
        });
    }
    tell_arm(controller.as_mut(), robot, cell)?;
    Ok(controller)
}

/// Says to a controller which arm it moves.
///
/// # Errors
/// An arm or a cell that makes no sense.
pub fn tell_arm(controller: &mut dyn Controller, robot: &Robot, cell: &Cell) -> Result<(), ModelError> {
    controller.set_arm(&Forward::new(Model::nominal(robot.clone(), cell.clone()), Vec::new())?);
    Ok(())
}

/// Refuses a device that is turned on the flange: controllers displace the tool in the flange's axes, by what is read in the device's.
///
/// # Errors
/// One sentence: what was found, what is expected.
pub fn check_tool(cell: &Cell) -> Result<(), String> {
    let zyx = angles_zyx(&cell.tool.rotation).map(|angle| tidy(angle.to_degrees()));
    if zyx.iter().all(|angle| angle.abs() < 1e-6) {
        return Ok(());
    }
    Err(format!(
        "[tool] zyx_deg: found {zyx:?}, expected 0 or nothing: a touch is corrected in the axes of the flange, to which those of the indicators \
         have to be parallel"
    ))
}

impl Session<'_> {
    /// What the recording says of the session.
    #[must_use]
    pub fn header(&self) -> Header {
        let mut header = Header::for_joints(self.robot.dof());
        header.prismatic = self.robot.prismatic();
        header.start_ns = self.start_ns;
        header.attachments = vec![
            Attachment::toml("robot.toml", self.robot.to_toml()),
            Attachment::toml("cell.toml", self.cell.to_toml()),
        ];
        header.robot_description = Some(urdf::write(self.robot, self.cell, &[]));
        header.settings.insert("gauge".to_owned(), without_secrets(self.gauge));
        header.settings.insert("controller".to_owned(), without_secrets(self.controller));
        header.settings.extend(self.settings.named());
        header.plan_sha256 = plan_sha256(self.plan, self.stride);
        header
    }

    /// Runs the procedure over real links; every accepted measurement is on disk before the arm moves on. Without `go` nothing
    /// moves, no device is needed, and the report has the steps.
    ///
    /// # Errors
    /// See [`SessionError`].
    pub fn perform(&self, watch: &mut dyn FnMut(Progress)) -> Result<RunReport, SessionError> {
        self.settings.check().map_err(SessionError::Settings)?;
        check_tool(self.cell).map_err(|e| SessionError::Settings(format!("the cell's {e}")))?;
        let mut options = self.options();
        options.stride = self.stride;
        options.guard = Some(self.guard);
        let corrected = self.corrected()?;
        options.corrected = Some(&corrected);
        let elsewhere = self.elsewhere()?;
        options.elsewhere = Some(&elsewhere);
        if !self.go {
            return self.rehearse(&mut options);
        }
        check_not_written(self.out).map_err(SessionError::Recording)?;
        let mut gauge = open_gauge(self.gauge).map_err(SessionError::Gauge)?;
        let mut controller = self.open_controller()?;
        let serial_number = controller.serial_number().map_err(SessionError::Controller)?;
        let mut log = self.open(&mut options, serial_number, watch).map_err(SessionError::Recording)?;
        let result = run(self.plan, (gauge.as_mut(), controller.as_mut()), &mut log, &options, self.cancel, watch);
        let finished = log.finish();
        let report = result.map_err(SessionError::Run)?;
        finished.map_err(SessionError::Finish)?;
        Ok(report)
    }

    /// Where a correction leads, by the nominal arm.
    fn corrected(&self) -> Result<impl Fn(&Joints, [f64; 3]) -> Result<Joints, String>, ModelError> {
        let nominal = Forward::new(Model::nominal(self.robot.clone(), self.cell.clone()), Vec::new())?;
        let ws = RefCell::new(nominal.workspace());
        Ok(move |at: &Joints, by: [f64; 3]| {
            let (state, ws) = (State::at(at), &mut *ws.borrow_mut());
            let mut tool = nominal.world_from_tool(&state, ws);
            // the controller's tool has the axes of the flange
            tool.translation += nominal.world_from_flange(&state, ws).rotation * Vector3::from(by);
            continue_from(&nominal, &tool, &state, ws).map_err(|e| e.to_string())
        })
    }

    /// What a reading is elsewhere, by the nominal arm.
    fn elsewhere(&self) -> Result<impl Fn(&Joints, [f64; 3], &Joints) -> [f64; 3], ModelError> {
        let nominal = Forward::new(Model::nominal(self.robot.clone(), self.cell.clone()), Vec::new())?;
        let ws = RefCell::new(nominal.workspace());
        Ok(move |at: &Joints, reading: [f64; 3], there: &Joints| {
            let ws = &mut *ws.borrow_mut();
            let ball = nominal.world_from_tool(&State::at(at), ws).apply(&Vector3::from(reading));
            nominal.world_from_tool(&State::at(there), ws).inverse().apply(&ball).into()
        })
    }

    /// How to measure, with who may stop it.
    fn options<'a>(&self) -> ProcedureOptions<'a> {
        ProcedureOptions { go: self.go, stops: self.stops.clone(), ..self.settings.options(self.robot, self.cell) }
    }

    /// The controller, which moves this arm.
    ///
    /// # Errors
    /// It cannot be used, or has another arm.
    pub fn open_controller(&self) -> Result<Box<dyn Controller>, SessionError> {
        let mut controller = open_controller_of(self.controller, self.robot, self.cell)?;
        if let Some(stops) = &self.stops {
            controller.stop_when(Arc::clone(stops));
        }
        Ok(controller)
    }

    /// A new recording, or the one to go on with; what it has is not measured again.
    fn open(
        &self,
        options: &mut ProcedureOptions<'_>,
        serial_number: Option<String>,
        watch: &mut dyn FnMut(Progress),
    ) -> Result<RecordingWriter, RecordError> {
        let mut header = self.header();
        header.settings.extend(serial_number.map(|number| (SERIAL_NUMBER.to_owned(), number)));
        if !self.resume {
            return RecordingWriter::create(self.out, &header);
        }
        if self.out.exists() {
            self.check_same_arm(&check_same(self.out, &header)?, &header)?;
        }
        let (log, before) = RecordingWriter::resume(self.out, &header)?;
        let Some(before) = before else {
            watch(Progress::Warning(self.nothing_to_go_on_with()));
            return Ok(log);
        };
        if let Some(lost) = &before.lost {
            watch(Progress::Warning(lost.clone()));
        }
        options.skip = before.done();
        // an indicator that was set to zero since, or has slipped, is seen by its free stem
        let [low, high] = self.settings.stroke;
        let is_free = |reading: &[f64; 3]| reading.iter().all(|v| !(low..=high).contains(v));
        options.free = before.indicators.iter().map(|sample| sample.reading).find(is_free);
        for row in &before.recording.rows {
            if let (Some(seq), Some(stride)) = (row.seq, self.stride) {
                options.known.entry(seq % stride).or_insert(row.state.q);
            }
        }
        if let Some(other) = self.other_mastering(&before) {
            watch(Progress::Warning(other));
        }
        options.begin_t = self.goes_on_at(&log, watch);
        Ok(log)
    }

    /// Another arm of the same type has the same robot file, and other errors.
    fn check_same_arm(&self, before: &ReadRecording, header: &Header) -> Result<(), RecordError> {
        let expected = before.metadata.values().find_map(|settings| settings.get(SERIAL_NUMBER));
        match header.settings.get(SERIAL_NUMBER).zip(expected) {
            Some((found, expected)) if found != expected => Err(RecordError::Different {
                path: self.out.to_owned(),
                what: format!("arm: the controller has serial number {found}, expected {expected}"),
            }),
            _ => Ok(()),
        }
    }

    /// A name that was mistyped begins a recording of its own.
    fn nothing_to_go_on_with(&self) -> String {
        format!(
            "{}: is not there, so there is nothing to go on with; this is the first run of a new recording",
            self.out.display()
        )
    }

    /// Where the gauge was mastered otherwise when the recording was last written: the free stems show it only where it is much.
    fn other_mastering(&self, before: &ReadRecording) -> Option<String> {
        let runs = before.metadata.keys().filter(|name| name.starts_with("trical.resumed.")).count();
        let last = if runs == 0 { "trical".to_owned() } else { format!("trical.resumed.{runs}") };
        let gauge = before.metadata.get(&last)?.get("gauge")?;
        let zero = |url: &str| url.split(['?', '&']).find(|part| part.starts_with("zero_mm=")).map(str::to_owned);
        let [found, expected] = [self.gauge, gauge].map(|url| zero(url).unwrap_or_else(|| "no zero_mm".to_owned()));
        (found != expected).then(|| {
            format!(
                "the gauge has {found}, and had {expected} when {} was last written: expected the same, unless an indicator has \
                 slipped or was set to zero since; otherwise the touches from here on are about another tool point",
                self.out.display()
            )
        })
    }

    /// Time at which a recording goes on, s: warm-up and creep go on while nobody measures.
    fn goes_on_at(&self, log: &RecordingWriter, watch: &mut dyn FnMut(Progress)) -> f64 {
        if log.start_ns() == 0 {
            return log.last_t();
        }
        let since = (self.start_ns as f64 - log.start_ns() as f64) * 1e-9;
        if (0.0..LONGEST_BREAK_S).contains(&since) {
            return log.last_t().max(since);
        }
        watch(Progress::Warning(format!(
            "by this computer's clock the recording began {:.0} days {}: the clock was or is wrong, and the times of the \
             recording go on where it ended",
            since.abs() / 86_400.0,
            if since < 0.0 { "in the future" } else { "ago" }
        )));
        log.last_t()
    }

    /// The steps of a run, without any device.
    fn rehearse(&self, options: &mut ProcedureOptions<'_>) -> Result<RunReport, SessionError> {
        let mut report = RunReport::default();
        if self.out.exists() {
            if !self.resume {
                return Err(SessionError::Recording(RecordError::Exists { path: self.out.to_owned() }));
            }
            let before = check_same(self.out, &self.header()).map_err(SessionError::Recording)?;
            report.warnings.extend(before.lost.clone());
            options.skip = before.done();
            report.skipped = self.plan.iter().filter(|entry| options.skip.contains(&entry.index)).count();
            report.warnings.extend(self.other_mastering(&before));
        } else if self.resume {
            report.warnings.push(self.nothing_to_go_on_with());
        }
        // a URL that nobody could use is an error now; a device that is not there yet is not
        match open_gauge(self.gauge) {
            Err(e @ GaugeError::Url(_)) => return Err(SessionError::Gauge(e)),
            Err(e) => report.warnings.push(e.to_string()),
            Ok(_) => {}
        }
        match self.open_controller() {
            Err(SessionError::Controller(e)) if !matches!(e, ControllerError::Url(_)) => {
                report.warnings.push(e.to_string());
            }
            other => drop(other?),
        }
        report.warnings.extend(self.settings.too_tight());
        report.steps = dry_run(self.plan, options, self.robot.dof());
        Ok(report)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_device_that_is_turned_on_the_flange_is_refused() {
        let cell = |tool: &str| {
            let text =
                format!("[base]\nxyz_mm = [0, 0, 0]\nzyx_deg = [90, 0, 0]\n[tool]\ntcp_mm = [0, 0, 100]\n{tool}");
            Cell::parse(&text, "cell.toml").unwrap()
        };
        assert!(
            ["", "zyx_deg = [0, 0, 0]", "zyx_deg = [360, 0, 0]"].iter().all(|tool| check_tool(&cell(tool)).is_ok())
        );
        let error = check_tool(&cell("zyx_deg = [0, 0, 30]")).unwrap_err();
        assert!(error.starts_with("[tool] zyx_deg: found [0.0, 0.0, 30.0], expected 0 or nothing"), "{error}");
    }

    #[test]
    fn a_recording_that_is_not_there_and_another_mastering_are_told_when_a_recording_is_taken_up() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("run.mcap");
        let robot = Robot::parse(include_str!("../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
        let (cell, settings, cancel) = (Cell::bare(), Settings::default(), AtomicBool::new(false));
        let told = |gauge: &str| {
            let session = Session {
                robot: &robot,
                cell: &cell,
                plan: &[],
                stride: None,
                gauge,
                controller: "rapid://arm",
                out: &out,
                resume: true,
                go: true,
                settings: &settings,
                start_ns: now_ns(),
                guard: &|_, _, _| Ok(()),
                cancel: &cancel,
                stops: None,
            };
            let mut told = Vec::new();
            let log = session.open(&mut session.options(), None, &mut |p| {
                if let Progress::Warning(w) = p {
                    told.push(w);
                }
            });
            log.unwrap().finish().unwrap();
            told.join("; ")
        };
        let first = told("uwave:///dev/a?x=03&zero_mm=0,0,0.1");
        assert!(first.contains("run.mcap: is not there") && !first.contains("zero_mm"), "{first}");
        // another port, and other options
        assert_eq!(told("uwave:///dev/b?zero_mm=0,0,0.1&timeout_ms=9"), "");
        let other = told("uwave:///dev/b?zero_mm=0,0,0.2");
        assert!(other.starts_with("the gauge has zero_mm=0,0,0.2, and had zero_mm=0,0,0.1 when"), "{other}");
        // once
        assert_eq!(told("uwave:///dev/b?zero_mm=0,0,0.2"), "");
        assert!(told("uwave:///dev/b").starts_with("the gauge has no zero_mm, and had zero_mm=0,0,0.2"));
    }
}
