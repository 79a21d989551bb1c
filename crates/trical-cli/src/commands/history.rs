//! `trical history`: a folder of sessions of one arm against its calibration.

use std::path::{Path, PathBuf};

use trical_ident::{History, history, write_whole};
use trical_report::{history_report, table};

use super::compare::Asked;
use crate::error::{CliError, Result};
use crate::input;
use crate::{say, say_lines, say_wrapped};

/// Arguments of `trical history`.
#[derive(clap::Args)]
pub struct Args {
    /// A folder of recordings (CSV or MCAP); they are taken in the order of the dates such as 2026-11-22 in their
    /// names, without dates in that of the names (run_2 before run_10)
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// The calibration that they are compared with: calibrated.toml
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Largest mean error that the work allows, mm: with it, says when the next calibration is due
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    need_mm: Option<f64>,
    /// Where to write a report with a plot of each parameter over the sessions
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    #[command(flatten)]
    asked: Asked,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    if let Some(need) = args.need_mm.filter(|n| !(n.is_finite() && *n > 0.0)) {
        return Err(CliError::Input(format!("--need-mm: found {need}, expected a number above 0")));
    }
    input::check_names([("--report", "page", args.report.as_ref())])?;
    let paths = recordings_in(&args.folder)?;
    if let Some(table) = args.asked.table.as_deref().filter(|t| is_in(t, &args.folder)) {
        let what = "the next history would take it for a session; expected a place outside the folder of sessions";
        return Err(CliError::Input(format!("--table: {}: {what}", table.display())));
    }
    if let Some(report) = &args.report {
        input::check_output(report, paths.iter().map(PathBuf::as_path).chain([args.model.as_path()]))?;
    }
    let (file, recordings, joints) = args.asked.load(&args.model, &paths)?;
    let h = history(&file.model.cell, &file, &recordings, joints, args.need_mm)?;
    if let Some(report) = &args.report {
        let made = input::made(&paths.iter().map(PathBuf::as_path).chain([args.model.as_path()]).collect::<Vec<_>>());
        write_whole(report, history_report::render(&h, &file, made)?.as_bytes())?;
    }
    args.asked.tell(&file, &h.sessions, serde_json::to_string_pretty(&h), &args.report, || print(&h))
}

fn print(h: &History) -> Result<()> {
    let mut rows = vec![["session", "day", "n", "degC", "mean, mm", "what changed"].map(String::from).to_vec()];
    for mut row in history_report::rows(h) {
        if let Some(name) = Path::new(&row[0]).file_name() {
            row[0] = name.to_string_lossy().into_owned();
        }
        rows.push(row.to_vec());
    }
    say_lines(table::lines(&rows))?;
    if h.days.is_none() {
        say(
            "Days are not known: not every name has a date such as 2026-11-22. Sessions are in the order of their names.",
        )?;
    }
    for told in history_report::summary_lines(h) {
        say_wrapped(&told, "  ")?;
    }
    say_wrapped(&h.due, "")
}

/// A name in parts that compare as people count: run_2 before run_10.
fn counted(path: &Path) -> Vec<(u64, String)> {
    let name = path.to_string_lossy();
    let mut parts: Vec<(u64, String)> = vec![(0, String::new())];
    for c in name.chars() {
        let Some((number, word)) = parts.last_mut() else { break };
        match c.to_digit(10) {
            Some(digit) if word.is_empty() => *number = number.saturating_mul(10).saturating_add(digit.into()),
            Some(digit) => parts.push((digit.into(), String::new())),
            None => word.push(c),
        }
    }
    parts
}

/// Whether a file, there or to be made, is in that folder itself.
fn is_in(file: &Path, folder: &Path) -> bool {
    let parent = file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    matches!((parent.canonicalize(), folder.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// Recordings of a folder, by name; hidden files are none.
fn recordings_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let problem =
        |e: std::io::Error| CliError::Input(format!("{}: {e}; expected a folder of recordings", folder.display()));
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(problem)? {
        let path = entry.map_err(problem)?.path();
        let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
        if !hidden && path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv") || e.eq_ignore_ascii_case("mcap"))
        {
            paths.push(path);
        }
    }
    paths.sort_by_cached_key(|path| (counted(path), path.clone()));
    if paths.is_empty() {
        return Err(CliError::Input(format!(
            "{}: no .csv or .mcap in this folder, expected recordings",
            folder.display()
        )));
    }
    Ok(paths)
}
