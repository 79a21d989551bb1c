//! `trical history`: a folder of sessions of one arm against its calibration.

use std::path::{Path, PathBuf};

use trical_ident::{History, history};
use trical_report::table;

use super::compare::Asked;
use crate::error::{CliError, Result};
use crate::say;

/// Arguments of `trical history`.
#[derive(clap::Args)]
pub struct Args {
    /// A folder of recordings (CSV or MCAP); they are taken in the order of their names, days from dates such as 2026-11-22 in them
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// The calibration that they are compared with: calibrated.toml
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Largest mean error that the work allows, mm: with it, says when the next calibration is due
    #[arg(long, value_name = "MM")]
    need_mm: Option<f64>,
    #[command(flatten)]
    asked: Asked,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    if let Some(need) = args.need_mm.filter(|n| !(n.is_finite() && *n > 0.0)) {
        return Err(CliError::Input(format!("--need-mm: found {need}, expected a number above 0")));
    }
    let paths = recordings_in(&args.folder)?;
    let (file, recordings, joints) = args.asked.load(&args.model, &paths)?;
    let h = history(&file.model.cell, &file, &recordings, joints, args.need_mm)?;
    args.asked.tell(&file, &h.sessions, serde_json::to_string_pretty(&h), || print(&h))
}

fn print(h: &History) -> Result<()> {
    let mut rows = vec![["session", "day", "n", "degC", "mean, mm", "what changed"].map(String::from).to_vec()];
    for (k, s) in h.sessions.iter().enumerate() {
        let day = h.days.as_ref().map_or_else(|| "-".into(), |d| format!("{:.0}", d[k]));
        let temp = s.temp_c.map_or_else(|| "-".into(), |t| format!("{t:.1}"));
        let changed: Vec<&str> = s.changes.iter().map(|c| c.what.as_str()).collect();
        let changed = if changed.is_empty() { "nothing".into() } else { changed.join(", ") };
        let name =
            Path::new(&s.recording).file_name().map_or(s.recording.clone(), |n| n.to_string_lossy().into_owned());
        rows.push(vec![name, day, s.measurements.to_string(), temp, format!("{:.3}", s.mean_mm), changed]);
    }
    for line in table::lines(&rows) {
        say(line)?;
    }
    for s in h.sessions.iter().filter(|s| !s.changes.is_empty()) {
        for line in table::wrapped(&format!("{}: {}", s.recording, s.summary), 108, "  ") {
            say(line)?;
        }
    }
    say(format!("Next calibration: {}", h.due))
}

/// Recordings of a folder, by name.
fn recordings_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let problem =
        |e: std::io::Error| CliError::Input(format!("{}: {e}; expected a folder of recordings", folder.display()));
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(problem)? {
        let path = entry.map_err(problem)?.path();
        if path.extension().is_some_and(|e| e == "csv" || e == "mcap") {
            paths.push(path);
        }
    }
    paths.sort();
    if paths.is_empty() {
        return Err(CliError::Input(format!(
            "{}: no .csv or .mcap in this folder, expected recordings",
            folder.display()
        )));
    }
    Ok(paths)
}
