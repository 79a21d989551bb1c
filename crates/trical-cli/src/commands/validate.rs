//! `trical validate`: a model on recordings.

use std::path::PathBuf;

use trical_ident::{ErrorSummary, ModelFile, Predicted, Refit, validate, write_whole};

use trical_report::{certificate, table, validate_report};

use super::{orientation_rows, wrote};
use crate::error::{CliError, Result};
use crate::input::{self, Joints, RobotAndCell};
use crate::{say, say_json, say_lines, say_wrapped};

/// Arguments of `trical validate`.
#[derive(clap::Args)]
pub struct Args {
    /// Recordings of one arm (CSV or MCAP)
    #[arg(required = true, value_name = "REC")]
    recordings: Vec<PathBuf>,
    #[command(flatten)]
    cell: RobotAndCell,
    /// The model: calibrated.toml or improved.toml
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Which joint angles to use (default: those that the model was fitted to)
    #[arg(long, value_enum)]
    joints: Option<Joints>,
    /// Identify again what changes when the instrument is set up anew: frame, or frame,targets; from every fourth
    /// pose, the others are scored
    #[arg(long, value_delimiter = ',', value_name = "WHAT")]
    refit: Vec<String>,
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

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let files = input::files(&args.recordings, &args.cell, Some(&args.model));
    let outputs = [("--report", "page", args.report.as_ref()), ("--certificate", "page", args.certificate.as_ref())];
    input::check_outputs(outputs, files.iter().copied())?;
    let (robot, cell) = args.cell.load()?;
    let file = ModelFile::load(&args.model)?;
    file.require_robot(&robot, &args.model.display().to_string())?;
    let refit = refit(&args.refit)?;
    let joints = args.joints.and_then(Joints::source);
    let recordings = input::recordings(&args.recordings, &robot)?;
    let v = validate(&robot, &cell, &file, &recordings, joints, refit)?;
    if let Some(path) = &args.report {
        write_whole(path, validate_report::render(&v, &file, input::made(&files))?.as_bytes())?;
    }
    if let Some(path) = &args.certificate {
        write_whole(path, certificate::of_validation(&v, &input::made(&files))?.as_bytes())?;
    }
    if args.json {
        return say_json(&v);
    }
    let rejected = match v.rejected.len() {
        0 => "no row rejected".to_owned(),
        n => format!("{} rejected", table::counted(n, "row")),
    };
    say(format!("{} measurements scored, {rejected}", v.n))?;
    for session in &v.sessions {
        say(format!("  {}", session.in_words()))?;
    }
    let predicted = v.predicted.as_ref().map(Predicted::in_words);
    for line in
        v.left_out_in_words(trical_diagnose::verdict::title_of).into_iter().chain(v.beyond_in_words()).chain(predicted)
    {
        say_wrapped(&line, "  ")?;
    }
    let mut rows = vec![["position error, mm", "n", "mean", "max", "sd", "median", "rms"].map(String::from).to_vec()];
    let mut add = |name: String, n: usize, e: &ErrorSummary| {
        let mut row = vec![name, n.to_string()];
        row.extend([e.mean_mm, e.max_mm, e.sd_mm, e.median_mm, e.rms_mm].map(|x| format!("{x:.3}")));
        rows.push(row);
    };
    add("before: nominal arm".into(), v.n, &v.before);
    add("after: the model".into(), v.n, &v.after);
    for s in v.sessions.iter().filter(|_| v.sessions.len() > 1) {
        add(format!("  after, {}", s.recording), s.n, &s.after);
    }
    for r in &v.regions {
        add(format!("  after, {}", r.region), r.n, &r.after);
    }
    say_lines(table::lines(&rows))?;
    say_lines(table::lines(&orientation_rows(v.orientation, ["before: nominal arm", "after: the model"])))?;
    for caution in validate_report::cautions(&v) {
        say_wrapped(&format!("Caution: {caution}"), "")?;
    }
    wrote([&args.report, &args.certificate])
}

fn refit(what: &[String]) -> Result<Option<Refit>> {
    let mut refit = Refit { frame: false, targets: false };
    for w in what {
        match w.as_str() {
            "frame" => refit.frame = true,
            "targets" => refit.targets = true,
            other => {
                return Err(CliError::Input(format!("--refit: found '{other}', expected frame or frame,targets")));
            }
        }
    }
    Ok((refit.frame || refit.targets).then_some(refit))
}
