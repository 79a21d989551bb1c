//! `trical compare`: is this arm still what it was?

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use trical_ident::compare::Change;
use trical_ident::{Comparison, ModelFile, compare, write_whole};
use trical_report::table;

use crate::error::{CliError, Result};
use crate::input::{self, Joints};
use crate::say;

/// Arguments of `trical compare`.
#[derive(clap::Args)]
pub struct Args {
    /// The earlier calibration: calibrated.toml
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// New recordings of the same arm, 8 to 12 touches do (CSV or MCAP)
    #[arg(required = true, value_name = "REC")]
    recordings: Vec<PathBuf>,
    /// Which joint angles to use (default: those that the model was fitted to)
    #[arg(long, value_enum)]
    joints: Option<Joints>,
    /// Where to write one row for each arm, session and parameter: a CSV that DuckDB, Polars or Grafana read
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let inputs = args.recordings.iter().map(PathBuf::as_path).chain([args.model.as_path()]);
    check_table(args.table.as_deref(), inputs)?;
    let file = ModelFile::load(&args.model)?;
    let recordings = input::recordings(&args.recordings, file.model.robot.dof())?;
    let joints = args.joints.and_then(Joints::source);
    let each =
        recordings.iter().map(|r| Ok(compare(&file.model.cell, &file, r, joints)?)).collect::<Result<Vec<_>>>()?;
    if let Some(path) = &args.table {
        write_whole(path, tidy(&file.model.robot.name, &each).as_bytes())?;
    }
    if args.json {
        return say(serde_json::to_string_pretty(&each)?);
    }
    for c in &each {
        print(c)?;
    }
    args.table.as_ref().map_or(Ok(()), |path| say(format!("\nWrote {}", path.display())))
}

/// Refuses a table in a format that is not written, or in a place that cannot be.
pub fn check_table<'a>(table: Option<&Path>, inputs: impl IntoIterator<Item = &'a Path>) -> Result<()> {
    let Some(path) = table else { return Ok(()) };
    if path.extension().is_none_or(|e| e != "csv") {
        let found = path.display();
        return Err(CliError::Input(format!("--table: found {found}, expected a name that ends in .csv")));
    }
    input::check_output(path, inputs)
}

fn print(c: &Comparison) -> Result<()> {
    say(format!("{}: {} measurements, mean error {:.3} mm by the old model", c.recording, c.measurements, c.mean_mm))?;
    for line in table::wrapped(&c.summary, 108, "  ") {
        say(line)?;
    }
    if c.more_noise > 1.3 {
        say(format!("  The measurements scatter {:.1} times as much as in the old session.", c.more_noise))?;
    }
    let seen = c.visible.iter().map(|v| match v.smallest {
        Some(size) => format!("{} {size:.3} {}", v.what, v.unit),
        None => format!("{} nothing", v.what),
    });
    let line = format!(
        "A change as large as these would be found in nine cases of ten: {}.",
        seen.collect::<Vec<_>>().join(", ")
    );
    for line in table::wrapped(&line, 108, "  ") {
        say(line)?;
    }
    Ok(())
}

/// One row for each session and parameter, with a header line.
pub fn tidy(arm: &str, each: &[Comparison]) -> String {
    let quoted = |text: &str| {
        if text.contains([',', '"', '\n']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
    };
    let mut out = String::from("arm,session,hash,temp_c,parameter,value,sd,unit,scope,verdict\n");
    for c in each {
        let temp = c.temp_c.map_or_else(String::new, |t| format!("{t:.2}"));
        for p in &c.alone {
            let of = |change: &&Change| change.by.iter().any(|b| b.name == p.name);
            let verdict = if c.changes.iter().any(|change| of(&change)) { "changed" } else { "unchanged" };
            let scope = if p.name.starts_with("joint") { "arm" } else { "setup" };
            let _ = writeln!(
                out,
                "{},{},{},{temp},{},{},{},{},{scope},{verdict}",
                quoted(arm),
                quoted(&c.recording),
                c.hash,
                p.name,
                p.value,
                p.sd,
                p.unit
            );
        }
        let _ = writeln!(
            out,
            "{},{},{},{temp},mean error,{},,mm,session,{}",
            quoted(arm),
            quoted(&c.recording),
            c.hash,
            c.mean_mm,
            c.verdict
        );
    }
    out
}
