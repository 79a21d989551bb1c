//! `trical measure`: the automated procedure over a gauge and a controller.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use serde_json::json;
use trical_device::procedure::Retreat;
use trical_device::record::Attachment;
use trical_device::{
    Header, PlanEntry, ProcedureOptions, Progress, RecordingWriter, RunReport, open_controller, open_gauge,
};
use trical_model::{Cell, Robot};
use trical_plan::{CollisionModel, MotionWorkspace};

use crate::commands::plan;
use crate::error::{CliError, Result};
use crate::input::{self, RobotAndCell};
use crate::{progress, say};

/// Arguments of `trical measure`.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    cell: RobotAndCell,
    /// The plan, as trical plan writes it
    #[arg(long, value_name = "FILE")]
    plan: PathBuf,
    /// The gauge, e.g. uwave:///dev/ttyUSB0?x=00&y=01&z=02
    #[arg(long, value_name = "URL")]
    gauge: String,
    /// The robot controller, e.g. rapid://192.168.125.1:5000
    #[arg(long, value_name = "URL")]
    controller: String,
    /// Where to record
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Go on with a recording that was broken off
    #[arg(long)]
    resume: bool,
    /// Move the robot; without it the steps are printed and nothing moves
    #[arg(long)]
    go: bool,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// What every motion keeps from everything, m.
const CLEARANCE: f64 = 2e-3;

/// What a measuring run needs.
pub struct Session<'a> {
    /// The arm.
    pub robot: &'a Robot,
    /// The cell.
    pub cell: &'a Cell,
    /// The plan.
    pub plan: &'a [PlanEntry],
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
}

/// Runs the procedure over real links; every accepted measurement is on disk before the arm moves on.
pub fn perform(s: &Session<'_>, watch: &mut dyn FnMut(Progress)) -> Result<RunReport> {
    let failed = |e: &dyn std::fmt::Display| CliError::Failed(e.to_string());
    let wrong = |e: &dyn std::fmt::Display| CliError::Input(e.to_string());
    let mut gauge = open_gauge(s.gauge).map_err(|e| wrong(&e))?;
    let mut controller = open_controller(s.controller).map_err(|e| wrong(&e))?;
    let mut header = Header::for_joints(s.robot.dof());
    header.attachments =
        vec![Attachment::toml("robot.toml", s.robot.to_toml()), Attachment::toml("cell.toml", s.cell.to_toml())];
    header.settings.insert("gauge".into(), s.gauge.into());
    header.settings.insert("controller".into(), s.controller.into());

    // planned with the cell's own clearance; the arm has been corrected away from where it was planned
    let model = CollisionModel::new(s.robot, s.cell)?.with_margin(CLEARANCE);
    let guard = |from: &trical_model::Joints, to: &trical_model::Joints| {
        // a stem may meet a ball only on the way into the touch of that ball
        let touched = s.plan.iter().find(|e| e.joints == *to).map(|e| e.ball);
        model.check_motion(from, to, touched, &mut MotionWorkspace::new(&model)).map_or(Ok(()), |hit| {
            let (a, b) = model.names(hit);
            Err(format!("'{a}' would come within {:.0} mm of '{b}'", CLEARANCE * 1e3))
        })
    };
    let mut options = ProcedureOptions {
        go: s.go,
        retreat: Retreat::Approach,
        guard: Some(&guard),
        tcp_in_flange: Some(s.cell.tool.tcp.into()),
        ..ProcedureOptions::default()
    };
    // as far as the indicators reach; the controller has a limit of its own
    options.limits.correction = 4.9e-3;
    options.limits.joints = s.robot.joints.iter().map(|j| (j.limits[0], j.limits[1])).collect();
    if !s.go {
        let mut nothing: Vec<trical_model::Row> = Vec::new();
        let (gauge, controller) = (gauge.as_mut(), controller.as_mut());
        return trical_device::run(s.plan, gauge, controller, &mut nothing, &options, &AtomicBool::new(false), watch)
            .map_err(|e| failed(&e));
    }
    let mut log = if s.resume {
        let (log, before) = RecordingWriter::resume(s.out, &header).map_err(|e| wrong(&e))?;
        if let Some(before) = before {
            options.skip = before.done();
            options.begin_t = log.last_t();
        }
        log
    } else {
        RecordingWriter::create(s.out, &header).map_err(|e| wrong(&e))?
    };
    let cancel = AtomicBool::new(false);
    let result = trical_device::run(s.plan, gauge.as_mut(), controller.as_mut(), &mut log, &options, &cancel, watch);
    let finished = log.finish();
    let report = result.map_err(|e| failed(&e))?;
    finished.map_err(|e| failed(&e))?;
    Ok(report)
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    input::check_output(&args.out)?;
    let (robot, cell) = args.cell.load()?;
    let entries = plan::load(&args.plan, &robot, cell.balls.len())?;
    let bar = progress::bar("measuring");
    let session = Session {
        robot: &robot,
        cell: &cell,
        plan: &entries,
        gauge: &args.gauge,
        controller: &args.controller,
        out: &args.out,
        resume: args.resume,
        go: args.go,
    };
    let report = perform(&session, &mut |p| watch(&bar, &p))?;
    bar.finish_and_clear();
    for w in &report.warnings {
        eprintln!("trical: note: {w}");
    }
    if args.json {
        let value = json!({
            "measured": report.measured, "skipped": report.skipped, "corrections": report.corrections,
            "warnings": report.warnings, "steps": report.steps,
        });
        return say(serde_json::to_string_pretty(&value)?);
    }
    if !args.go {
        for step in &report.steps {
            say(step)?;
        }
        return say("Nothing has moved. Add --go to measure.");
    }
    say(format!(
        "{} touches measured ({} had been done before), {} corrections; recorded in {}",
        report.measured,
        report.skipped,
        report.corrections,
        args.out.display()
    ))
}

/// Shows the progress of a run on a bar.
#[expect(clippy::cast_precision_loss, reason = "counts")]
pub fn watch(bar: &indicatif::ProgressBar, p: &Progress) {
    match p {
        Progress::Begin { ball, done, total, .. } => {
            progress::at(
                bar,
                *done as f64 / *total as f64,
                &format!("touch {} of {total}, ball {}", done + 1, ball + 1),
            );
        }
        Progress::Warning(w) => bar.println(format!("note: {w}")),
        _ => {}
    }
}
