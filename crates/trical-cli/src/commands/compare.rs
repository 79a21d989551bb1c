//! `trical compare`: is this arm still what it was?

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use trical_ident::compare::Change;
use trical_ident::{Comparison, JointSource, ModelFile, compare, refuse_repeated, rejected_in_words, write_whole};
use trical_model::Recording;
use trical_report::table;

use super::wrote;
use crate::error::{CliError, Result};
use crate::input::{self, Joints};
use crate::{say, say_wrapped};

/// Arguments of `trical compare`.
#[derive(clap::Args)]
pub struct Args {
    /// The earlier calibration: calibrated.toml
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// New recordings of the same arm, 8 to 12 touches do (CSV or MCAP)
    #[arg(required = true, value_name = "REC")]
    recordings: Vec<PathBuf>,
    #[command(flatten)]
    asked: Asked,
}

/// What `compare` and `history` can be asked alike.
#[derive(clap::Args)]
pub struct Asked {
    /// Which joint angles to use (default: those that the model was fitted to)
    #[arg(long, value_enum)]
    joints: Option<Joints>,
    /// Where to write one row for each arm, session and parameter: a CSV that DuckDB, Polars or Grafana read
    #[arg(long, value_name = "FILE")]
    pub table: Option<PathBuf>,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

impl Asked {
    /// Reads the model, and the recordings of the same arm; which joint angles are used. Refuses a table in a format that is not
    /// written, or in a place that cannot be.
    pub fn load(
        &self,
        model: &Path,
        recordings: &[PathBuf],
    ) -> Result<(ModelFile, Vec<Recording>, Option<JointSource>)> {
        if let Some(path) = &self.table {
            if path.extension().is_none_or(|e| e != "csv") {
                let found = path.display();
                return Err(CliError::Input(format!(
                    "--table: found {found}, expected a name that ends in .csv, which DuckDB, Polars or pandas turn into others"
                )));
            }
            input::check_output(path, recordings.iter().map(PathBuf::as_path).chain([model]))?;
        }
        let file = ModelFile::load(model)?;
        let recordings = input::recordings(recordings, &file.model.robot)?;
        Ok((file, recordings, self.joints.and_then(Joints::source)))
    }

    /// Writes the table; then says the answer as JSON, or prints it and where the table and the report are.
    pub fn tell(
        &self,
        file: &ModelFile,
        each: &[Comparison],
        json: serde_json::Result<String>,
        report: &Option<PathBuf>,
        print: impl FnOnce() -> Result<()>,
    ) -> Result<()> {
        if let Some(path) = &self.table {
            write_whole(path, tidy(&file.model.robot.name, each).as_bytes())?;
        }
        if self.json {
            return say(json?);
        }
        print()?;
        wrote([report, &self.table])
    }
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let (file, recordings, joints) = args.asked.load(&args.model, &args.recordings)?;
    refuse_repeated(&recordings)?;
    let each =
        recordings.iter().map(|r| Ok(compare(&file.model.cell, &file, r, joints)?)).collect::<Result<Vec<_>>>()?;
    args.asked.tell(&file, &each, serde_json::to_string_pretty(&each), &None, || each.iter().try_for_each(print))
}

fn print(c: &Comparison) -> Result<()> {
    let measured = table::counted(c.measurements, "measurement");
    say(format!("{}: {measured}, mean error {:.3} mm by the old model", c.recording, c.mean_mm))?;
    if let Some(rejected) = rejected_in_words(&c.rejected) {
        say_wrapped(&format!("{rejected}."), "  ")?;
    }
    say_wrapped(&c.summary, "  ")?;
    let (mut seen, mut unseen): (Vec<String>, Vec<String>) = (Vec::new(), Vec::new());
    for (k, v) in c.visible.iter().enumerate() {
        // a tool is moved, or turned
        let turned = k > 0 && c.visible[k - 1].what == v.what;
        let moved = turned && c.visible[k - 1].smallest.is_some();
        match (v.smallest, moved, seen.last_mut()) {
            (Some(size), true, Some(last)) => {
                let _ = write!(last, " or {size:.3} {}", v.unit);
            }
            (Some(size), ..) => seen.push(format!("{} {size:.3} {}", v.what, v.unit)),
            _ if turned && !moved => {}
            _ if turned => unseen.push(format!("the direction of the {}", v.what)),
            _ => unseen.push(v.what.clone()),
        }
    }
    let mut lines = Vec::new();
    if !seen.is_empty() {
        lines.push(format!("Changes of this size would be found in nine cases of ten: {}.", seen.join(", ")));
    }
    if !unseen.is_empty() {
        lines.push(format!(
            "A change of {} would not be found, however large: each session's own fit (frame, tool, balls) absorbs it.",
            unseen.join(" or ")
        ));
    }
    say_wrapped(&lines.join(" "), "  ")
}

/// One row for each session and parameter, with a header line.
fn tidy(arm: &str, each: &[Comparison]) -> String {
    const COLUMNS: [&str; 10] =
        ["arm", "session", "hash", "temp_c", "parameter", "value", "sd", "unit", "scope", "verdict"];
    let mut rows = vec![COLUMNS.map(String::from)];
    for c in each {
        let temp = c.temp_c.map_or_else(String::new, |t| format!("{t:.2}"));
        let mut row = |parameter: &str, value: f64, sd: Option<f64>, [unit, scope, verdict]: [&str; 3]| {
            let sd = sd.map_or_else(String::new, |sd| sd.to_string());
            let of = [arm, &c.recording, &c.hash, &temp, parameter, &value.to_string(), &sd, unit, scope, verdict];
            rows.push(of.map(str::to_owned));
        };
        for p in &c.each {
            let of = |change: &&Change| change.by.iter().any(|b| b.name == p.name);
            let verdict = match c.changes.iter().find(of).map(Change::is_likely) {
                Some(true) => "changed",
                Some(false) => "perhaps changed",
                None => "unchanged",
            };
            let scope = if p.name.starts_with("joint") { "arm" } else { "setup" };
            row(&p.name, p.value, Some(p.sd), [&p.unit, scope, verdict]);
        }
        row("mean error", c.mean_mm, None, ["mm", "session", c.verdict]);
    }
    table::csv(rows)
}
