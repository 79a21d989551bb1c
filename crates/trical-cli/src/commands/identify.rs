//! `trical identify`: parameters with uncertainties.

use std::path::PathBuf;

use clap::ValueEnum;
use trical_ident::{
    BY_BLOCK, Calibration, Choice, ErrorSummary, FORWARD, Identified, JointSource, KnownParameters, ModelFile, Options,
    ParameterSet, Rejected, calibrate, calibrate_stream, shown, write_whole,
};
use trical_report::evidence::rejected_together;
use trical_report::{certificate, identify_report, table};

use super::{orientation_rows, wrote};
use crate::error::{CliError, Result};
use crate::input::{self, Joints, RobotAndCell, Tool};
use crate::progress;
use crate::{say, say_json, say_lines, say_wrapped};

/// Which parameters to identify.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Set {
    /// The nominal arm: measuring frame (or base) and tool points only
    Nominal,
    /// Also the whole geometry of a rigid arm, with the twist of near-parallel axes
    Geometry,
    /// The paper's 31 parameters: the geometry without that twist, and the compliance of the joints that carry a torque
    Compliance,
    /// The geometry and the compliance: as rich as the robot file and the recordings allow
    Complete,
}

impl From<Set> for ParameterSet {
    fn from(s: Set) -> Self {
        match s {
            Set::Nominal => Self::Nominal,
            Set::Geometry => Self::Geometry,
            Set::Compliance => Self::Compliance,
            Set::Complete => Self::Complete,
        }
    }
}

/// Arguments of `trical identify`.
#[derive(clap::Args)]
pub struct Args {
    /// Recordings of one arm (CSV or MCAP)
    #[arg(required = true, value_name = "REC")]
    recordings: Vec<PathBuf>,
    #[command(flatten)]
    cell: RobotAndCell,
    /// Where to write the model
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Which joint angles to use
    #[arg(long, value_enum, default_value = "read")]
    joints: Joints,
    /// Which parameters to identify
    #[arg(long, value_enum, default_value = "complete")]
    model: Set,
    /// Compliance of these joints only, e.g. 2,3,4,5
    #[arg(long, value_delimiter = ',', value_name = "JOINTS", value_parser = joint)]
    compliant: Vec<usize>,
    /// What is known beforehand: a TOML file of [[parameter]] tables with name and value and sd (a prior), min, max
    #[arg(long, value_name = "FILE", conflicts_with = "stream")]
    known: Option<PathBuf>,
    /// Also score every pose by a fit without it, in K folds that cut no block of neighbouring poses
    #[arg(long, value_name = "K")]
    cross_validate: Option<usize>,
    /// Also score the last PERCENT of each recording's poses by a fit to those before: forward in time
    #[arg(long, value_name = "PERCENT")]
    hold_out_last: Option<usize>,
    /// Keep gross errors instead of rejecting them
    #[arg(long)]
    keep_outliers: bool,
    #[command(flatten)]
    tool: Tool,
    /// Read recordings in passes, in memory that does not grow with their rows; the default for a CSV above 32 MB
    #[arg(long, conflicts_with_all = ["cross_validate", "hold_out_last"])]
    stream: bool,
    /// A report to read and to print, one HTML file
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// A certificate to print and sign: one page, HTML, with accuracy and repeatability by the formulas of ISO 9283
    #[arg(long, value_name = "FILE")]
    certificate: Option<PathBuf>,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// The number of a joint.
fn joint(text: &str) -> std::result::Result<usize, String> {
    text.trim().parse().map_err(|_| "expected numbers of joints, as 2,3,4".to_owned())
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let files = input::files(&args.recordings, &args.cell, args.known.as_deref());
    let outputs = [
        ("--out", "model", args.out.as_ref()),
        ("--report", "page", args.report.as_ref()),
        ("--certificate", "page", args.certificate.as_ref()),
    ];
    input::check_outputs(outputs, files.iter().copied())?;
    let (robot, cell) = args.cell.load()?;
    let known = args.known.as_deref().map(KnownParameters::load).transpose()?.unwrap_or_default();
    let options = Options {
        choice: Choice::new(args.model.into(), &args.compliant, robot.dof())?.knowing(known),
        joints: args.joints.source(),
        keep_outliers: args.keep_outliers,
        folds: args.cross_validate,
        hold_out_last: args.hold_out_last,
        tool: args.tool.sharing(),
    };
    let all_at_once = args.cross_validate.is_some() || args.hold_out_last.is_some() || args.known.is_some();
    let found = progress::with_bar("identifying", |task| -> Result<Calibration> {
        if let Some(stream) = input::passes(&args.recordings, &robot, args.stream, !all_at_once)? {
            return Ok(calibrate_stream(&robot, &cell, &stream, &options, task)?);
        }
        let recordings = input::recordings(&args.recordings, &robot)?;
        Ok(calibrate(&robot, &cell, &recordings, &options, task)?)
    })?;
    if let Some(out) = &args.out {
        ModelFile::of_fit(&found.fitted).save(out)?;
    }
    if let Some(path) = &args.report {
        write_whole(path, identify_report::render(&found, input::made(&files))?.as_bytes())?;
    }
    if let Some(path) = &args.certificate {
        write_whole(path, certificate::of_calibration(&found, &input::made(&files))?.as_bytes())?;
    }
    if args.json {
        return say_json(&found);
    }
    print(args, &found)
}

/// Rows of a table of parameters beside nominal.
pub fn parameter_rows(fitted: &Identified) -> Vec<Vec<String>> {
    let mut rows = vec![vec!["parameter".into(), "nominal".into(), "identified".into(), "sd".into(), "unit".into()]];
    for k in &fitted.free {
        let s = shown(&fitted.model, &fitted.model.terms[*k]);
        let (factor, unit) = table::unit_told(&s.unit);
        let d = table::decimals_for(s.sd.map_or(f64::NAN, |sd| factor * sd));
        rows.push(vec![
            s.name,
            s.nominal.map_or_else(|| "-".into(), |n| table::fixed(factor * n, 3)),
            table::fixed(factor * s.value, d),
            s.sd.map_or_else(|| "-".into(), |v| format!("{:.d$}", factor * v)),
            unit.to_owned(),
        ]);
    }
    rows
}

fn print(args: &Args, found: &Calibration) -> Result<()> {
    let fitted = &found.fitted;
    let data = &fitted.data;
    let places = match found.passes {
        Some(passes) => format!("{} measurements, read in {passes} passes,", found.observations),
        None => format!("{} measurements at {} poses", found.observations, found.poses),
    };
    let none = if found.rejected == 0 { "; no row rejected" } else { "" };
    say(format!("{places} from {}{none}", data.names.join(", ")))?;
    say_lines(rejected_lines(&found.named, found.rejected, 12))?;
    for session in found.sessions.iter().filter_map(|s| s.in_words()) {
        say(format!("  {session}"))?;
    }
    for load in &found.loads {
        say_wrapped(&load.in_words(), "  ")?;
    }
    let angles = match data.joints {
        JointSource::Read => "the joint angles that the controller reported",
        JointSource::Commanded => "the commanded joint angles",
    };
    say(format!("\n{} parameters, from {angles}:", fitted.free.len()))?;
    say_lines(table::lines(&parameter_rows(fitted)))?;
    let stopped = fitted.stopped();
    if !stopped.is_empty() {
        say(format!("\nHeld at a limit of --known, beyond which the data would go: {}", stopped.join(", ")))?;
    }
    let dropped = fitted.left_out();
    if !dropped.is_empty() {
        say(format!("\nNot identified, because other parameters have the same effect: {}", dropped.join("; ")))?;
    }
    say_lines(by_place_lines(found))?;
    for caution in found.cautions() {
        say_wrapped(&format!("Caution: {}", table::ended(&caution)), "")?;
    }
    say("")?;
    say_lines(table::lines(&error_rows(found)))?;
    wrote([&args.out, &args.report, &args.certificate])
}

/// Rows of a table of errors: at the poses of the fit, and at others.
fn error_rows(found: &Calibration) -> Vec<Vec<String>> {
    let mut rows = vec![vec!["position error, mm".into(), "mean".into(), "max".into(), "rms".into()]];
    let mut add = |name: &str, e: &ErrorSummary| {
        let mm = |v: f64| format!("{v:.3}");
        rows.push(vec![name.into(), mm(e.mean_mm), mm(e.max_mm), mm(e.rms_mm)]);
    };
    add("nominal arm", &found.before);
    add("identified", &found.errors);
    // by block, what was asked for, and the worst
    let worst = found.unseen().worst().map(|(how, _)| how);
    for (how, name, e) in identify_report::unseen(found) {
        if how == BY_BLOCK || how == FORWARD && found.forward_in_time.is_some() || Some(how) == worst {
            add(&name, &e);
        }
    }
    rows.extend(orientation_rows(found.orientation, ["nominal arm", "identified"]));
    rows
}

/// What places of sockets say beside the errors: which physics earned its place, and the distance between sockets as a check.
fn by_place_lines(found: &Calibration) -> Vec<String> {
    let mut out = Vec::new();
    if let Some(kept) = found.tried.iter().find(|t| t.kept && t.added != "nothing") {
        let plain = found.tried.first().and_then(|t| t.mean_mm);
        out.push(match (plain, kept.mean_mm) {
            (Some(plain), Some(mean)) => format!(
                "\nAdded, since it lowers the mean error at places held out from {plain:.3} to {mean:.3} mm: {}",
                kept.added
            ),
            _ => format!(
                "\nAdded as usual of arms (fewer than three unknown places cannot tell whether it helps): {}",
                kept.added
            ),
        });
    }
    if !found.distances.is_empty() {
        let said =
            "Distance between balls in mm, measured by the arm as identified at the other places (in the cell file):";
        out.push(format!("\n{said}"));
    }
    out.extend(found.distances.iter().map(|d| {
        let [a, b] = d.balls;
        format!("  {}: {a} to {b} {:.2} mm ({:.2})", d.place, d.measured_mm, d.cell_mm)
    }));
    out
}

/// What was rejected, reason by reason, at most a dozen lines; `named` may be the first of `all`.
pub fn rejected_lines(named: &[Rejected], all: usize, most: usize) -> Vec<String> {
    if all == 0 {
        return Vec::new();
    }
    let mut lines = vec![format!("{} rejected:", table::counted(all, "row"))];
    let mut told = 0;
    lines.extend(rejected_together(named).into_iter().take(most).map(|(place, rows, r)| {
        told += rows;
        format!("  {}, {place}: {}", r.recording, r.reason)
    }));
    if all > told {
        lines.push(format!("  and {} more (--json and --report list them)", all - told));
    }
    lines
}

impl From<trical_ident::ChoiceError> for CliError {
    fn from(e: trical_ident::ChoiceError) -> Self {
        Self::Input(format!("--compliant: {e}"))
    }
}
