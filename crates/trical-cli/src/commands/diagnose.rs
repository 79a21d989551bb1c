//! `trical diagnose`: locate the mismatch, name the physics left out, model it, prove it.

use std::path::PathBuf;

use trical_diagnose::{Diagnosis, Options, Undecided, diagnose_recordings};
use trical_ident::{JointSource, KnownParameters, write_whole};
use trical_plan::{Next, write_plan};
use trical_report::deciding::{self, plan_next};
use trical_report::{diagnosis_report, table, verdict_summary};

use crate::error::{CliError, Result};
use crate::input::{self, Joints, RobotAndCell, Tool};
use crate::{LINE, progress, say, say_json, say_lines};

/// Touches that set explanations apart by less than this many standard deviations decide nothing.
const TELLING: f64 = 1.0;

/// Arguments of `trical diagnose`.
#[derive(clap::Args)]
pub struct Args {
    /// Recordings of one arm (CSV or MCAP)
    #[arg(required = true, value_name = "REC")]
    recordings: Vec<PathBuf>,
    #[command(flatten)]
    cell: RobotAndCell,
    /// Which joint angles to use
    #[arg(long, value_enum, default_value = "read")]
    joints: Joints,
    /// Model named effects only: curves of no known cause are reported, but not corrected
    #[arg(long)]
    names_only: bool,
    /// What is known beforehand: a TOML file of [[parameter]] tables, as for `trical identify`
    #[arg(long, value_name = "FILE")]
    known: Option<PathBuf>,
    #[command(flatten)]
    tool: Tool,
    /// Where to write the extended model
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Where to write the report
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Plan this many touches that decide between the least sure finding and its rivals
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1000))]
    next: Option<u16>,
    /// Where to write the touches of --next
    #[arg(long, value_name = "FILE", default_value = "next.csv", requires = "next")]
    next_out: PathBuf,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let files = input::files(&args.recordings, &args.cell, args.known.as_deref());
    let outputs = [
        ("--out", "model", args.out.as_ref()),
        ("--report", "page", args.report.as_ref()),
        ("--next-out", "plan", args.next.map(|_| &args.next_out)),
    ];
    input::check_outputs(outputs, files.iter().copied())?;
    let (robot, cell) = args.cell.load()?;
    if args.next.is_some() && !cell.balls_fix_base(|_| true) {
        return Err(CliError::Input(
            "--next: expected three [balls] in the cell that are not on one line; where others stand is not known beforehand".into(),
        ));
    }
    let recordings = input::recordings(&args.recordings, &robot)?;
    let known = args.known.as_deref().map(KnownParameters::load).transpose()?.unwrap_or_default();
    let (joints, tool) = (args.joints.source(), args.tool.sharing());
    let options = Options { joints, names_only: args.names_only, tool, known };
    let (diagnosis, source) =
        progress::with_bar("diagnosing", |task| diagnose_recordings(&robot, &cell, &recordings, &options, task))?;
    // rivals are fitted anew only for those who ask
    let undecided = args.next.map(|_| diagnosis.undecided()).transpose()?.flatten();
    let next = match (args.next, undecided) {
        (Some(n), Some(undecided)) => {
            let count = usize::from(n);
            let planned = progress::with_bar("deciding", |task| plan_next(&robot, &cell, &undecided, count, task))?;
            Some((undecided, planned))
        }
        _ => None,
    };
    if let Some(out) = &args.out {
        diagnosis.model_file().save(out)?;
    }
    if let Some(report) = &args.report {
        write_whole(report, diagnosis_report::render(&diagnosis, source, input::made(&files))?.as_bytes())?;
    }
    if let Some((_, next)) = next.as_ref().filter(|(_, next)| next.lambda >= TELLING) {
        write_whole(&args.next_out, write_plan(&robot, &next.entries).as_bytes())?;
    }
    if args.json {
        let mut value = verdict_summary::json(&diagnosis, source)?;
        if args.next.is_some() {
            value["next"] = next.as_ref().map_or(serde_json::Value::Null, |(u, n)| next_json(args, u, n));
        }
        return say_json(&value);
    }
    say_lines(lines(args, &diagnosis))?;
    if args.joints == Joints::Auto {
        say(format!(
            "The {} joint angles were used: they leave a smaller error at held-out poses.",
            source_words(source)
        ))?;
    }
    if args.next.is_some() {
        say_lines(next_lines(args, next.as_ref()))?;
    }
    super::wrote([&args.out, &args.report])
}

fn source_words(source: JointSource) -> &'static str {
    match source {
        JointSource::Read => "read",
        JointSource::Commanded => "commanded",
    }
}

fn next_json(args: &Args, undecided: &Undecided<'_>, next: &Next) -> serde_json::Value {
    let mut value = deciding::json_of(undecided, next);
    value["touches"] = next.entries.len().into();
    value["file"] = (next.lambda >= TELLING).then(|| args.next_out.display().to_string()).into();
    value
}

fn next_lines(args: &Args, next: Option<&(Undecided<'_>, Next)>) -> Vec<String> {
    let Some((undecided, next)) = next else {
        return vec!["No finding is undecided: no further touches were planned.".into()];
    };
    if next.lambda < TELLING {
        let text = format!(
            "No {} touches that this arm can make here decide whether it is {}: the best differ by {:.1} standard deviations. Nothing \
             was written; another load on the flange, or balls elsewhere, may help.",
            next.entries.len(),
            undecided.names.join(", or "),
            next.lambda
        );
        return table::wrapped(&text, LINE, "");
    }
    let text = format!(
        "{} touches in {} would decide whether it is {}: the predictions of any two differ by at least {:.1} standard deviations (as many \
         random touches: {:.1}){}. Measure them in the same cell, and diagnose both recordings together.",
        next.entries.len(),
        args.next_out.display(),
        undecided.names.join(", or "),
        next.lambda,
        next.random_lambda,
        if next.lambda < 3.0 { little(next) } else { String::new() }
    );
    table::wrapped(&text, LINE, "")
}

/// Touches that hardly decide: how many would, each telling as much as these.
fn little(next: &Next) -> String {
    let enough = (next.entries.len() as f64 * (3.0 / next.lambda).powi(2)).ceil();
    format!("; for three, about {enough} would be needed")
}

/// The verdict; where more stands; what makes it less sure.
fn lines(args: &Args, d: &Diagnosis) -> Vec<String> {
    let caution = |c: &String| table::wrapped(&format!("Caution: {c}"), LINE, "");
    let note = |n: &String| table::wrapped(&format!("Note: {n}"), LINE, "");
    let mut out: Vec<String> = verdict_summary::no_arm(d).iter().flat_map(caution).collect();
    out.extend(verdict_summary::lines(d));
    let mut more = Vec::new();
    if args.report.is_none() {
        more.push("--report FILE shows each finding and what this data could not show");
    }
    if args.out.is_none() && !(d.findings.is_empty() && d.unexplained.is_none()) {
        more.push("--out FILE writes the model, which `compensate` uses");
    }
    if !more.is_empty() {
        out.push(format!("More: {}.", more.join("; ")));
    }
    out.extend(super::identify::rejected_lines(&d.rejected, d.rejected.len(), 3));
    out.extend(verdict_summary::cautions(d).iter().flat_map(caution));
    out.extend(verdict_summary::notes(d).iter().flat_map(note));
    let listed = if args.report.is_none() { "; --report lists them" } else { "" };
    out.extend(verdict_summary::not_shown(d).map(|said| format!("{said}{listed}.")));
    out
}
