//! `trical measure`: the automated procedure over a gauge and a controller.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::{SystemTime, UNIX_EPOCH};

use serde_json::json;
use trical_device::procedure::{Retreat, stride};
use trical_device::record::Attachment;
use trical_device::{
    ControllerError, GaugeError, Header, PlanEntry, ProcedureOptions, Progress, RecordingWriter, RunReport, dry_run,
    open_controller, open_gauge, visits,
};
use trical_model::{Cell, Robot, urdf};
use trical_plan::{CollisionModel, MotionWorkspace};

use crate::commands::{guided, plan};
use crate::error::{CliError, Result};
use crate::input::{self, RobotAndCell};
use crate::measure_view::View;
use crate::{interrupt, say};

/// Arguments of `trical measure`.
#[derive(clap::Args)]
#[command(
    after_help = "Nothing moves without --go: the whole run is printed instead. Ctrl-C ends a run in order: the motion under way \
    ends, the arm goes back the way it came. A second Ctrl-C ends the program at once; the controller still ends the motion \
    under way. --resume goes on in both cases. What each stop means: docs/cell.md."
)]
pub struct Args {
    #[command(flatten)]
    cell: RobotAndCell,
    /// The plan, as trical plan writes it; with --guided it is made on the way
    #[arg(long, value_name = "FILE", required_unless_present = "guided")]
    plan: Option<PathBuf>,
    /// The gauge, e.g. uwave:///dev/ttyUSB0?x=00&y=01&z=02; see trical gauge test --help
    #[arg(long, value_name = "URL")]
    gauge: String,
    /// The robot controller, e.g. rapid://192.168.125.1:5000; see trical robot ping --help
    #[arg(long, value_name = "URL")]
    controller: String,
    /// Where to record
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Go on with a recording that was broken off, however it was
    #[arg(long)]
    resume: bool,
    /// Move the robot; without it the steps are printed and nothing moves
    #[arg(long)]
    go: bool,
    /// Be led through it in plain words: mastering, tool point, world frame, plan, measurement
    #[arg(long, requires = "go", conflicts_with_all = ["json", "resume"])]
    guided: bool,
    /// Touches a ball of the plan that --guided makes
    #[arg(long, value_name = "N", default_value_t = 15, requires = "guided")]
    per_ball: usize,
    #[command(flatten)]
    settings: Settings,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// How to measure.
#[derive(clap::Args, Clone, Debug)]
pub struct Settings {
    /// A touch is accepted when its reading is shorter than this; what is left is recorded
    #[arg(long, value_name = "MM", default_value_t = 0.02)]
    pub epsilon_mm: f64,
    /// Repeatability of the arm: an --epsilon-mm below it is warned about
    #[arg(long, value_name = "MM", default_value_t = 0.01)]
    pub repeatability_mm: f64,
    /// Visit every touch so many times, every other round backward and from beyond; see trical repeatability
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub visits: u32,
    /// Speed of the tool between the balls
    #[arg(long, value_name = "MM_S", default_value_t = 100.0)]
    pub travel_mm_s: f64,
    /// Speed of the tool at a ball
    #[arg(long, value_name = "MM_S", default_value_t = 10.0)]
    pub touch_mm_s: f64,
    /// Longest single correction
    #[arg(long, value_name = "MM", default_value_t = 4.9)]
    pub max_correction_mm: f64,
    /// Longest sum of a touch's corrections
    #[arg(long, value_name = "MM", default_value_t = 8.0)]
    pub max_sum_mm: f64,
    /// Most corrections of a touch
    #[arg(long, value_name = "N", default_value_t = 10)]
    pub max_corrections: usize,
    /// Readings between which a stem touches its ball
    #[arg(long, value_name = "LOW,HIGH", value_delimiter = ',', allow_negative_numbers = true, default_values_t = [-5.9, 5.9])]
    pub stroke_mm: Vec<f64>,
    /// Temperature, recorded with each touch where the controller has no sensor
    #[arg(long, value_name = "DEGC", allow_negative_numbers = true)]
    pub temp_c: Option<f64>,
    /// Mass added on the flange, recorded with each touch
    #[arg(long, value_name = "KG")]
    pub payload_kg: Option<f64>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            epsilon_mm: 0.02,
            repeatability_mm: 0.01,
            visits: 1,
            travel_mm_s: 100.0,
            touch_mm_s: 10.0,
            max_correction_mm: 4.9,
            max_sum_mm: 8.0,
            max_corrections: 10,
            stroke_mm: vec![-5.9, 5.9],
            temp_c: None,
            payload_kg: None,
        }
    }
}

impl Settings {
    /// As the procedure takes them, for an arm and a cell.
    pub fn options<'a>(&self, robot: &Robot, cell: &Cell) -> Result<ProcedureOptions<'a>> {
        let mut options = ProcedureOptions {
            epsilon: self.epsilon_mm * 1e-3,
            repeatability: self.repeatability_mm * 1e-3,
            travel_speed: self.travel_mm_s * 1e-3,
            touch_speed: self.touch_mm_s * 1e-3,
            retreat: Retreat::Approach,
            tcp_in_flange: Some(cell.tool.tcp.into()),
            temp_c: self.temp_c,
            payload_kg: self.payload_kg,
            ..ProcedureOptions::default()
        };
        // as far as the indicators reach; the controller has limits of its own
        options.limits.correction = self.max_correction_mm * 1e-3;
        options.limits.total_correction = self.max_sum_mm * 1e-3;
        options.limits.iterations = self.max_corrections;
        options.limits.joints = robot.joints.iter().map(|j| (j.limits[0], j.limits[1])).collect();
        match self.stroke_mm.as_slice() {
            [low, high] if low < high => options.limits.stroke = [low * 1e-3, high * 1e-3],
            other => {
                return Err(CliError::Input(format!(
                    "--stroke-mm: found {other:?}, expected two numbers, the lower first"
                )));
            }
        }
        Ok(options)
    }
}

/// What every motion keeps from everything, m.
const CLEARANCE: f64 = 2e-3;

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
    /// Set by Ctrl-C.
    pub cancel: &'a AtomicBool,
}

/// Nanoseconds since 1970.
pub fn now_ns() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(0)
}

/// What a recording says of its session.
pub fn header(s: &Session<'_>) -> Header {
    let mut header = Header::for_joints(s.robot.dof());
    header.start_ns = s.start_ns;
    header.attachments =
        vec![Attachment::toml("robot.toml", s.robot.to_toml()), Attachment::toml("cell.toml", s.cell.to_toml())];
    header.robot_description = Some(urdf::write(s.robot, s.cell, &[]));
    let set = s.settings;
    for (name, value) in [
        ("gauge", s.gauge.to_owned()),
        ("controller", s.controller.to_owned()),
        ("epsilon_mm", set.epsilon_mm.to_string()),
        ("repeatability_mm", set.repeatability_mm.to_string()),
        ("visits", set.visits.to_string()),
        ("travel_mm_s", set.travel_mm_s.to_string()),
        ("touch_mm_s", set.touch_mm_s.to_string()),
        ("max_correction_mm", set.max_correction_mm.to_string()),
        ("max_sum_mm", set.max_sum_mm.to_string()),
    ] {
        header.settings.insert(name.to_owned(), value);
    }
    header
}

/// What the collision model says of a motion; a stem may meet a ball only on the way into the touch of that ball.
fn guard(
    s: &Session<'_>,
    model: &CollisionModel,
    from: &trical_model::Joints,
    to: &trical_model::Joints,
) -> std::result::Result<(), String> {
    let touched = s.plan.iter().find(|e| e.joints == *to).map(|e| e.ball);
    model.check_motion(from, to, touched, &mut MotionWorkspace::new(model)).map_or(Ok(()), |hit| {
        let (a, b) = model.names(hit);
        Err(format!("'{a}' would come within {:.0} mm of '{b}'", CLEARANCE * 1e3))
    })
}

/// Runs the procedure over real links; every accepted measurement is on disk before the arm moves on.
pub fn perform(s: &Session<'_>, watch: &mut dyn FnMut(Progress)) -> Result<RunReport> {
    let failed = |e: &dyn std::fmt::Display| CliError::Failed(e.to_string());
    let wrong = |e: &dyn std::fmt::Display| CliError::Input(e.to_string());
    // planned with the cell's own clearance; the arm has been corrected away from where it was planned
    let model = CollisionModel::new(s.robot, s.cell)?.with_margin(CLEARANCE);
    let guard = |from: &trical_model::Joints, to: &trical_model::Joints| guard(s, &model, from, to);
    let mut options = s.settings.options(s.robot, s.cell)?;
    options.go = s.go;
    options.stride = s.stride;
    options.guard = Some(&guard);
    if !s.go {
        return rehearse(s, &options);
    }
    let mut gauge = open_gauge(s.gauge).map_err(|e| wrong(&e))?;
    let mut controller = open_controller(s.controller).map_err(|e| wrong(&e))?;
    if controller.joint_count() != s.robot.dof() {
        return Err(CliError::Input(format!(
            "{} says that its arm has {} joints, {} has {}",
            controller.name(),
            controller.joint_count(),
            s.robot.name,
            s.robot.dof()
        )));
    }
    let header = header(s);
    let mut log = if s.resume {
        let (log, before) = RecordingWriter::resume(s.out, &header).map_err(|e| wrong(&e))?;
        if let Some(before) = before {
            if let Some(lost) = &before.lost {
                watch(Progress::Warning(lost.clone()));
            }
            options.skip = before.done();
            for row in &before.recording.rows {
                if let (Some(seq), Some(stride)) = (row.seq, s.stride) {
                    options.known.entry(seq % stride).or_insert(row.state.q);
                }
            }
            // warm-up and creep go on while nobody measures
            #[expect(clippy::cast_precision_loss, reason = "s since the recording began")]
            let since = s.start_ns.saturating_sub(before.start_ns) as f64 * 1e-9;
            options.begin_t = log.last_t().max(if before.start_ns == 0 { 0.0 } else { since });
        }
        log
    } else {
        RecordingWriter::create(s.out, &header).map_err(|e| wrong(&e))?
    };
    let result = trical_device::run(s.plan, gauge.as_mut(), controller.as_mut(), &mut log, &options, s.cancel, watch);
    let finished = log.finish();
    let report = result.map_err(|e| {
        let safe = if e.is_cancelled() { "" } else { "; what was measured is safe, --resume goes on" };
        CliError::Failed(format!("{e}{safe}"))
    })?;
    finished.map_err(|e| failed(&e))?;
    Ok(report)
}

/// The steps of a run, without any device.
fn rehearse(s: &Session<'_>, options: &ProcedureOptions<'_>) -> Result<RunReport> {
    let mut report = RunReport::default();
    // a URL that nobody could use is an error now; a device that is not there yet is not
    match open_gauge(s.gauge) {
        Err(e @ GaugeError::Url(_)) => return Err(CliError::Input(e.to_string())),
        Err(e) => report.warnings.push(e.to_string()),
        Ok(_) => {}
    }
    match open_controller(s.controller) {
        Err(e @ ControllerError::Url(_)) => return Err(CliError::Input(e.to_string())),
        Err(e) => report.warnings.push(e.to_string()),
        Ok(_) => {}
    }
    if s.settings.epsilon_mm < s.settings.repeatability_mm {
        report.warnings.push(format!(
            "the tolerance of a touch, {} mm, is below the arm's repeatability, {} mm: touches may not converge",
            s.settings.epsilon_mm, s.settings.repeatability_mm
        ));
    }
    report.steps = dry_run(s.plan, options, s.robot.dof());
    Ok(report)
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    input::check_output(&args.out)?;
    let (robot, cell) = args.cell.load()?;
    let cancel = interrupt::flag()?;
    if args.guided {
        let about = guided::Guided {
            robot: &robot,
            cell,
            gauge: args.gauge.clone(),
            controller: &args.controller,
            out: &args.out,
            plan: args.plan.as_deref(),
            per_ball: args.per_ball,
            settings: &args.settings,
            cancel: &cancel,
        };
        return about.lead();
    }
    let Some(path) = &args.plan else {
        return Err(CliError::Input("--plan: expected a file, as trical plan writes it".into()));
    };
    let entries = plan::load(path, &robot, cell.balls.len())?;
    let stride = Some(stride(&entries));
    let entries = visits(&entries, args.settings.visits as usize);
    let session = Session {
        robot: &robot,
        cell: &cell,
        plan: &entries,
        stride,
        gauge: &args.gauge,
        controller: &args.controller,
        out: &args.out,
        resume: args.resume,
        go: args.go,
        settings: &args.settings,
        start_ns: now_ns(),
        cancel: &cancel,
    };
    let mut view = View::new();
    let report = perform(&session, &mut |p| view.show(&p));
    view.end();
    let report = report?;
    for w in &report.warnings {
        eprintln!("trical: note: {w}");
    }
    let refused = report.steps.iter().find(|step| step.contains("REFUSED"));
    if args.json {
        let value = json!({
            "measured": report.measured, "skipped": report.skipped, "corrections": report.corrections,
            "warnings": report.warnings, "steps": report.steps,
        });
        say(serde_json::to_string_pretty(&value)?)?;
    } else if args.go {
        say(done(&report, &args.out))?;
    } else {
        for step in &report.steps {
            say(step)?;
        }
        say("Nothing has moved. Add --go to measure.")?;
    }
    match refused {
        Some(step) => Err(CliError::Failed(format!("this plan would be refused: {step}"))),
        None => Ok(()),
    }
}

/// What a run did, in a sentence.
pub fn done(report: &RunReport, out: &Path) -> String {
    format!(
        "{} touches measured ({} had been done before), {} corrections; recorded in {}",
        report.measured,
        report.skipped,
        report.corrections,
        out.display()
    )
}
