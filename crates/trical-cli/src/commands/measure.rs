//! `trical measure`: the automated procedure over a gauge and a controller.

use std::path::PathBuf;
use std::sync::Arc;

use serde_json::json;
use trical_device::procedure::stride;
use trical_device::session::{self, now_ns};
use trical_device::{Progress, Session, visits};
use trical_plan::MotionGuard;

use crate::commands::{guided, plan};
use crate::error::{CliError, Result};
use crate::input::{self, RobotAndCell};
use crate::measure_view::{View, done, perform};
use crate::{interrupt, say, say_json, say_lines};

/// Arguments of `trical measure`.
#[derive(clap::Args)]
#[command(
    after_help = "Nothing moves without --go: the whole run is printed instead. Ctrl-C ends a run in order: a motion under way \
    is stopped and the arm stays there; between motions it goes back the way it came. A second Ctrl-C stops the motion too, and \
    ends the program once it is stopped. So do a request to terminate and a terminal that is closed. --resume goes on in all cases. What each stop means: docs/cell.md."
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
    /// The robot controller, e.g. rapid://192.168.125.1:5000?secret=@FILE; see trical robot ping --help
    #[arg(long, value_name = "URL")]
    controller: String,
    /// Where to record: an .mcap
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Continue a recording that was interrupted
    #[arg(long)]
    resume: bool,
    /// Move the robot; without it the steps are printed and nothing moves
    #[arg(long)]
    go: bool,
    /// Be led through it step by step: mastering, tool point, world frame, plan, measurement
    #[arg(long, conflicts_with = "json")]
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
    /// A touch is accepted when its reading is shorter than this; the reading that is left is recorded
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
    #[arg(long, value_name = "LOW,HIGH", value_delimiter = ',', allow_hyphen_values = true, default_values_t = [-5.9, 5.9])]
    pub stroke_mm: Vec<f64>,
    /// Temperature, recorded with each touch where the controller has no sensor
    #[arg(long, value_name = "DEGC", allow_negative_numbers = true)]
    pub temp_c: Option<f64>,
    /// Mass added on the flange, recorded with each touch
    #[arg(long, value_name = "KG")]
    pub payload_kg: Option<f64>,
}

impl Settings {
    /// In SI.
    pub fn si(&self) -> Result<session::Settings> {
        let [low, high] = match self.stroke_mm.as_slice() {
            [low, high] if low < high => [low * 1e-3, high * 1e-3],
            other => {
                return Err(CliError::Input(format!(
                    "--stroke-mm: found {other:?}, expected two numbers, the lower first"
                )));
            }
        };
        Ok(session::Settings {
            epsilon: self.epsilon_mm * 1e-3,
            repeatability: self.repeatability_mm * 1e-3,
            visits: self.visits,
            travel_speed: self.travel_mm_s * 1e-3,
            touch_speed: self.touch_mm_s * 1e-3,
            max_correction: self.max_correction_mm * 1e-3,
            max_sum: self.max_sum_mm * 1e-3,
            max_corrections: self.max_corrections,
            stroke: [low, high],
            temp_c: self.temp_c,
            payload_kg: self.payload_kg,
        })
    }
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    input::check_recording(&args.out, args.cell.files().into_iter().chain(args.plan.as_deref()))?;
    if args.out.extension().is_none_or(|e| e != "mcap") {
        return Err(CliError::Input(format!(
            "--out: found {}, expected a name that ends in .mcap, in which each touch is on disk before the next move; trical convert makes \
             a CSV of it",
            args.out.display()
        )));
    }
    let (robot, cell) = args.cell.load()?;
    // before a person is led through half of it
    session::check_tool(&cell).map_err(|e| CliError::Input(format!("{}, {e}", args.cell.cell.display())))?;
    let settings = args.settings.si()?;
    let guard = MotionGuard::new(&robot, &cell)?;
    let interrupt = interrupt::watch()?;
    if args.guided {
        let about = guided::Guided {
            robot: &robot,
            cell,
            files: &args.cell,
            gauge: args.gauge.clone(),
            controller: &args.controller,
            out: &args.out,
            plan: args.plan.as_deref(),
            per_ball: args.per_ball,
            settings: &settings,
            interrupt: &interrupt,
            resume: args.resume,
        };
        return if args.go { about.lead() } else { about.tell_whole() };
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
        settings: &settings,
        start_ns: now_ns(),
        guard: &|from, to, touched| guard.check(from, to, touched),
        cancel: &interrupt.asked,
        stops: Some(Arc::clone(&interrupt.stops)),
    };
    let (mut view, mut warnings) = (View::new(), Vec::new());
    let report = perform(&session, ", --resume goes on", &mut |p| {
        if let Progress::Warning(w) = &p {
            warnings.push(w.clone());
        }
        view.show(&p);
    });
    view.end();
    // a battery that is low often tells why a run has failed
    if let Ok(report) = &report {
        warnings.extend(report.warnings.iter().filter(|_| !args.go).cloned());
    }
    for w in &warnings {
        crate::note!("trical: note: {w}");
    }
    let report = report?;
    let refused = report.steps.iter().find(|step| step.contains("REFUSED"));
    if args.json {
        say_json(&json!({
            "measured": report.measured, "skipped": report.skipped, "corrections": report.corrections,
            "warnings": warnings, "steps": report.steps,
        }))?;
    } else if args.go {
        say(done(&report, &args.out))?;
    } else {
        say_lines(&report.steps)?;
        say("Nothing has moved. Add --go to measure.")?;
    }
    match refused {
        Some(step) => Err(CliError::Failed(format!("this plan would be refused: {step}"))),
        None => Ok(()),
    }
}
