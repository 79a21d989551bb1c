//! Robots, cells and recordings from the files that the user names.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use trical_device::read_recording;
use trical_device::record::{RecordError, hand_over};
use trical_ident::passes::{self, Other, Passes, PassesError};
use trical_ident::{JointSource, ToolSharing, load_csv};
use trical_model::{Cell, Recording, Robot};
use trical_plan::geometry::mesh::resolve_meshes;
use trical_report::Made;

use crate::error::{CliError, Result};

/// The two files that most commands need.
#[derive(clap::Args)]
pub struct RobotAndCell {
    /// The arm: robot.toml, or a URDF with its two links where they are not clear, as in arm.urdf#base_link:tool0
    #[arg(long, value_name = "FILE")]
    pub robot: PathBuf,
    /// Where it stands and what it carries: cell.toml
    #[arg(long, value_name = "FILE")]
    pub cell: PathBuf,
}

impl RobotAndCell {
    /// The two files.
    pub fn files(&self) -> [&Path; 2] {
        [&self.robot, &self.cell]
    }

    /// Reads both.
    pub fn load(&self) -> Result<(Robot, Cell)> {
        let mut cell = Cell::load(&self.cell)?;
        let folder = self.cell.parent().unwrap_or(Path::new("."));
        resolve_meshes(&mut cell, folder).map_err(|e| CliError::Input(format!("{}: {e}", self.cell.display())))?;
        Ok((Robot::load(&self.robot)?, cell))
    }
}

/// All that was read, in the order in which a report names it.
pub fn files<'a>(recordings: &'a [PathBuf], cell: &'a RobotAndCell, more: Option<&'a Path>) -> Vec<&'a Path> {
    recordings.iter().map(PathBuf::as_path).chain(cell.files()).chain(more).collect()
}

/// What a report says of how it was made: this command, these files.
pub fn made(inputs: &[&Path]) -> Made {
    let command = std::iter::once("trical".to_owned()).chain(std::env::args_os().skip(1).map(quoted));
    Made::by(command.collect::<Vec<_>>().join(" "), inputs)
}

/// An argument as a shell would have to be given it.
fn quoted(arg: std::ffi::OsString) -> String {
    let arg = arg.to_string_lossy();
    let plain = |c: char| c.is_alphanumeric() || "-_=+./:,@%#".contains(c);
    if !arg.is_empty() && arg.chars().all(plain) {
        arg.into_owned()
    } else {
        format!("'{}'", arg.replace('\'', "'\\''"))
    }
}

/// Which joint angles to believe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Joints {
    /// Those that the controller reported (q1_deg ...)
    Read,
    /// Those that were commanded (qc1_deg ...)
    Commanded,
    /// Whichever the model explains better
    Auto,
}

impl Joints {
    /// `None` for those that the data is to choose.
    pub fn source(self) -> Option<JointSource> {
        match self {
            Self::Read => Some(JointSource::Read),
            Self::Commanded => Some(JointSource::Commanded),
            Self::Auto => None,
        }
    }
}

/// Which sessions share a tool; left to the data without either.
#[derive(clap::Args)]
pub struct Tool {
    /// All recordings were taken with one tool on the flange, mounted once
    #[arg(long, conflicts_with = "own_tool")]
    same_tool: bool,
    /// Each recording has a tool of its own
    #[arg(long)]
    own_tool: bool,
}

impl Tool {
    /// What was asked for.
    pub fn sharing(&self) -> ToolSharing {
        match (self.same_tool, self.own_tool) {
            (true, _) => ToolSharing::Same,
            (_, true) => ToolSharing::Own,
            _ => ToolSharing::FromData,
        }
    }
}

/// Reads recordings of one arm, CSV or MCAP.
pub fn recordings(paths: &[PathBuf], joints: usize) -> Result<Vec<Recording>> {
    paths.iter().map(|p| recording(p, joints)).collect()
}

/// Whether a file begins as MCAP files do.
pub fn is_mcap(path: &Path) -> Result<bool> {
    use std::io::Read;
    let mut magic = [0; 8];
    let read = std::fs::File::open(path)
        .and_then(|mut f| f.read(&mut magic))
        .map_err(|e| CliError::Input(format!("{}: cannot be read: {e}", path.display())))?;
    Ok(magic[..read].starts_with(b"\x89MCAP"))
}

/// Reads one recording, CSV or MCAP. A damaged MCAP is refused: who works with a part of the data should know it.
pub fn recording(path: &Path, joints: usize) -> Result<Recording> {
    let named_mcap = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mcap"));
    if !named_mcap && !is_mcap(path)? {
        return Ok(load_csv(path, joints)?);
    }
    let (recording, lost) = recovered(path)?;
    if let Some(lost) = lost {
        return Err(CliError::Input(format!(
            "{lost}; trical convert saves its {} complete measurements",
            recording.rows.len()
        )));
    }
    if recording.joints != joints {
        return Err(CliError::Input(format!(
            "{}: has {} joints, but the robot has {joints}",
            path.display(),
            recording.joints
        )));
    }
    Ok(recording)
}

/// The recordings to be read in passes, if they are: where that is `wanted`, or where they are large and it is `allowed`.
pub fn passes(paths: &[PathBuf], joints: usize, wanted: bool, allowed: bool) -> Result<Option<Passes>> {
    let other = Other {
        is: &|path| {
            let named = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mcap"));
            Ok(named || is_mcap(path).map_err(|e| e.to_string())?)
        },
        each_row: &|path, take| {
            hand_over(path, take).map_err(|e| match e {
                RecordError::Unreadable { .. } => format!("{e}; trical convert saves what is whole in it"),
                _ => e.to_string(),
            })
        },
    };
    passes::passes(paths, joints, wanted, allowed, &other).map_err(|e| match e {
        PassesError::Ident(e) => e.into(),
        PassesError::Other(text) => CliError::Input(text),
        PassesError::Scratch(_) => CliError::Failed(e.to_string()),
    })
}

/// What an MCAP recording holds, and one sentence on what was lost where it is damaged.
pub fn recovered(path: &Path) -> Result<(Recording, Option<String>)> {
    let read = read_recording(path).map_err(|e| CliError::Input(e.to_string()))?;
    if read.recording.rows.is_empty() {
        let why = read.lost.unwrap_or_else(|| format!("{}: has no measurements", path.display()));
        return Err(CliError::Input(format!("{why}; there is no complete measurement in it")));
    }
    Ok((read.recording, read.lost))
}

/// Refuses an output that lies in a folder that does not exist, before any work is done.
pub fn check_output(path: &Path) -> Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if folder.is_dir() {
        Ok(())
    } else {
        Err(CliError::Input(format!("{}: the folder {} does not exist", path.display(), folder.display())))
    }
}
