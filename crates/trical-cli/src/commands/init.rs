//! `trical init`: files to start from.

use std::path::{Path, PathBuf};

use trical_ident::write_whole;

use crate::error::{CliError, Result};
use crate::input::make_folder;
use crate::{say, say_json, say_lines};

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

/// Arguments of `trical init` and of `trical sample`.
#[derive(clap::Args)]
pub struct Args {
    /// Folder into which the files are written
    #[arg(value_name = "DIR", default_value = ".")]
    pub folder: PathBuf,
    /// A machine-readable summary on standard output
    #[arg(long)]
    pub json: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    written(&args.folder, &FILES, args.json)?;
    if args.json {
        return Ok(());
    }
    say_lines([
        "Tracker points instead of touches: columns x_mm, y_mm, z_mm (and target) instead of ball, ix_mm, iy_mm, iz_mm.",
        "Then: trical diagnose recording.csv --robot robot.toml --cell cell.toml",
    ])
}

/// Writes files (name, text, what it is) into a folder and tells of them. Those that are there already are not replaced.
pub fn written(folder: &Path, files: &[(&str, &str, &str)], json: bool) -> Result<()> {
    make_folder(folder)?;
    let paths: Vec<PathBuf> = files.iter().map(|(name, ..)| folder.join(name)).collect();
    if let Some(there) = paths.iter().find(|p| p.exists()) {
        return Err(CliError::Input(format!("{}: exists already, expected a folder without it", there.display())));
    }
    for (path, (_, text, _)) in paths.iter().zip(files) {
        write_whole(path, text.as_bytes())?;
    }
    if json {
        let written: Vec<String> = paths.iter().map(|p| p.display().to_string()).collect();
        return say_json(&serde_json::json!({ "written": written }));
    }
    for (path, (_, _, what)) in paths.iter().zip(files) {
        say(format!("{}: {what}", path.display()))?;
    }
    Ok(())
}
