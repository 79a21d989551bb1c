//! `trical init`: files to start from.

use std::path::PathBuf;

use trical_ident::write_whole;

use crate::error::{CliError, Result};
use crate::say;

/// What is written: name, text, what it is.
const FILES: [(&str, &str, &str); 3] = [
    (
        "robot.toml",
        include_str!("../../assets/init/robot.toml"),
        "the arm: lengths, angles and limits, each line explained",
    ),
    ("cell.toml", include_str!("../../assets/init/cell.toml"), "where it stands, its tool, what is measured"),
    (
        "recording.csv",
        include_str!("../../assets/init/recording.csv"),
        "one touch, to show the columns: replace it by yours",
    ),
];

/// Arguments of `trical init`.
#[derive(clap::Args)]
pub struct Args {
    /// Folder into which the files are written
    #[arg(value_name = "DIR", default_value = ".")]
    folder: PathBuf,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// Runs the command. Files that are there already are not replaced.
pub fn run(args: &Args) -> Result<()> {
    let folder = &args.folder;
    std::fs::create_dir_all(folder)
        .map_err(|e| CliError::Input(format!("{}: cannot be made: {e}", folder.display())))?;
    let paths = FILES.map(|(name, ..)| folder.join(name));
    if let Some(there) = paths.iter().find(|p| p.exists()) {
        return Err(CliError::Input(format!("{}: exists already, expected a folder without it", there.display())));
    }
    for (path, (_, text, _)) in paths.iter().zip(FILES) {
        write_whole(path, text.as_bytes())?;
    }
    if args.json {
        let written: Vec<String> = paths.iter().map(|p| p.display().to_string()).collect();
        return say(serde_json::to_string_pretty(&serde_json::json!({ "written": written }))?);
    }
    for (path, (_, _, what)) in paths.iter().zip(FILES) {
        say(format!("{}: {what}", path.display()))?;
    }
    say(
        "Tracker points instead of touches: columns x_mm, y_mm, z_mm (and target) instead of ball, ix_mm, iy_mm, iz_mm.",
    )?;
    say("Then: trical diagnose recording.csv --robot robot.toml --cell cell.toml")
}
