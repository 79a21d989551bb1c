//! `trical compensate`: a program rewritten so that the real arm goes where it says.

use std::path::PathBuf;

use serde_json::json;
use trical_ident::{ModelFile, write_whole};
use trical_model::{Forward, Model};

use crate::error::{CliError, Result};
use crate::input::{self, RobotAndCell};
use crate::{rapid, say};

/// Arguments of `trical compensate`.
#[derive(clap::Args)]
pub struct Args {
    /// The program (ABB RAPID: robtargets in wobj0 with the cell's tool, and jointtargets)
    #[arg(value_name = "PROGRAM")]
    program: PathBuf,
    #[command(flatten)]
    cell: RobotAndCell,
    /// The model: calibrated.toml or improved.toml
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Where to write the rewritten program
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Write even where targets could not be rewritten; those stay as they are
    #[arg(long)]
    partial: bool,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    input::check_output(&args.out)?;
    let (robot, cell) = args.cell.load()?;
    let file = ModelFile::load(&args.model)?;
    file.require_robot(&robot, &args.model.display().to_string())?;
    let name = args.program.display().to_string();
    let text = trical_model::error::read_text(&args.program)?;
    let nominal = Forward::new(Model::nominal(robot, cell), Vec::new())?;
    let model = Forward::new(file.model, Vec::new())?;
    let done = rapid::rewrite(&text, &nominal, &model, &name)?;
    if done.poses.is_empty() && done.problems.is_empty() {
        return Err(CliError::Input(format!(
            "{name}: no targets found; expected ABB RAPID with robtarget or jointtarget data"
        )));
    }
    if !done.problems.is_empty() && !args.partial {
        return Err(CliError::Failed(format!(
            "{name}: {} targets cannot be rewritten, and nothing was written (--partial writes the others): {}",
            done.problems.len(),
            done.problems.join("; ")
        )));
    }
    let marked = rapid::with_mark(&done.text, &args.model.display().to_string());
    write_whole(&args.out, marked.as_bytes())?;
    let largest = done.moved_mm.iter().copied().fold(0.0, f64::max);
    if args.json {
        let value = json!({ "targets": done.poses.len(), "largest_move_mm": largest, "problems": done.problems });
        return say(serde_json::to_string_pretty(&value)?);
    }
    say(format!("{} targets rewritten, the farthest moved by {largest:.3} mm", done.poses.len()))?;
    for p in &done.problems {
        say(format!("  left as it is: {p}"))?;
    }
    say(format!("Wrote {}", args.out.display()))
}
