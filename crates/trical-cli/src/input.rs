//! Robots, cells and recordings from the files that the user names.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use trical_ident::{JointSource, ToolSharing};
use trical_model::{Cell, JointKind, MAX_JOINTS, Recording, Robot};
use trical_plan::geometry::mesh::resolve_meshes;
use trical_recording::{CsvStream, RecordError, open_large, output, refuse_other_units};
use trical_report::Made;

use crate::error::{CliError, Result};

/// The two files that most commands need.
#[derive(clap::Args)]
pub struct RobotAndCell {
    /// The arm: robot.toml or a URDF; name its first and last link where they are not clear, as in
    /// arm.urdf#base_link:tool0
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

/// A setting of the libraries by its name here.
pub fn as_option(setting: &str, value: &str) -> String {
    let option = format!("--{}", setting.replace('_', "-"));
    if value.is_empty() { option } else { format!("{option} {value}") }
}

/// An argument as a shell would have to be given it.
pub fn quoted(arg: std::ffi::OsString) -> String {
    let arg = arg.to_string_lossy();
    let plain = |c: char| c.is_alphanumeric() || "-_=+./:,@%#".contains(c);
    if !arg.is_empty() && arg.chars().all(plain) {
        arg.into_owned()
    } else {
        format!("'{}'", arg.replace('\'', "'\\''"))
    }
}

/// Where the arm stands at first, rad and m: by `--start-deg`, which has one number for each joint, deg or mm, or nothing, for `usual`.
pub fn start(given: &[f64], robot: &Robot, usual: [f64; MAX_JOINTS]) -> Result<[f64; MAX_JOINTS]> {
    let (found, expected) = (given.len(), robot.dof());
    if found > 0 && found != expected {
        let what = format!("--start-deg: found {found} numbers, expected {expected}, one for each joint");
        return Err(CliError::Input(what));
    }
    let mut start = usual;
    for ((q, v), joint) in start.iter_mut().zip(given).zip(&robot.joints) {
        *q = if joint.kind == JointKind::Prismatic { v * 1e-3 } else { v.to_radians() };
    }
    if found > 0 && !robot.within_limits(&start, 1e-9) {
        let what = format!("--start-deg: found {given:?}, expected joints within the limits of {}", robot.name);
        return Err(CliError::Input(what));
    }
    Ok(start)
}

/// Makes a folder for what is written.
pub fn make_folder(path: &Path) -> Result<()> {
    std::fs::create_dir_all(path).map_err(|e| CliError::Input(format!("{}: cannot be made: {e}", path.display())))
}

/// Which joint angles to use.
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
    /// All recordings were taken with one tool on the flange, mounted once; without this and --own-tool the data decide
    #[arg(long, conflicts_with = "own_tool")]
    same_tool: bool,
    /// Each recording has a tool (and targets on it) of its own
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
pub fn recordings(paths: &[PathBuf], robot: &Robot) -> Result<Vec<Recording>> {
    paths.iter().map(|p| recording(p, robot)).collect()
}

/// Reads one recording, CSV or MCAP. A damaged MCAP is refused.
pub fn recording(path: &Path, robot: &Robot) -> Result<Recording> {
    let recording = trical_recording::open(path, robot)?;
    refuse_other_units(&recording, robot)?;
    for note in &recording.notes {
        eprintln!("note: {note}");
    }
    Ok(recording)
}

/// The recordings to be read in passes, if they are: where that is `wanted`, or where they are large and it is `allowed`.
pub fn passes(paths: &[PathBuf], robot: &Robot, wanted: bool, allowed: bool) -> Result<Option<CsvStream>> {
    open_large(paths, robot, wanted, allowed).map_err(|e| match e {
        RecordError::Unreadable { .. } => CliError::Input(format!("{e}; trical convert saves what is whole in it")),
        e => e.into(),
    })
}

/// Refuses an output that cannot be written, or that would replace what is read or a recording, before any work is done.
pub fn check_output<'a>(path: &Path, inputs: impl IntoIterator<Item = &'a Path>) -> Result<()> {
    Ok(output::check_no_recording(path, inputs)?)
}

/// What commands write, by the option that names it: how such names end, and what makes another format of it.
const FORMATS: [(&str, &[&str], &str); 6] = [
    ("model", &["toml"], ""),
    ("page", &["html", "htm"], "; a browser prints it as PDF"),
    ("plan", &["csv"], ""),
    ("error map", &["csv"], ""),
    ("URDF", &["urdf", "xml"], ""),
    ("kinematics", &["yaml", "yml"], ""),
];

/// Refuses outputs whose names say another format than what is written (a name without an ending is taken), or that are one file; each is
/// given with its option and what it is to hold.
pub fn check_names<'a>(
    outputs: impl IntoIterator<Item = (&'static str, &'static str, Option<&'a PathBuf>)>,
) -> Result<()> {
    let mut before: Vec<(&str, &Path)> = Vec::new();
    for (option, what, path) in outputs {
        let Some(path) = path else { continue };
        if let (Some((_, endings, else_)), Some(found)) = (FORMATS.iter().find(|f| f.0 == what), path.extension())
            && !endings.iter().any(|e| found.eq_ignore_ascii_case(e))
        {
            return Err(CliError::Input(format!(
                "{option}: found {}, expected a name that ends in .{}{else_}",
                path.display(),
                endings[0]
            )));
        }
        before.push((option, path));
    }
    output::check_apart(&before).map_err(CliError::Input)
}

/// [`check_names`], and [`check_output`] of each.
pub fn check_outputs<'a, const N: usize>(
    outputs: [(&'static str, &'static str, Option<&PathBuf>); N],
    inputs: impl IntoIterator<Item = &'a Path> + Clone,
) -> Result<()> {
    check_names(outputs)?;
    outputs.iter().filter_map(|o| o.2).try_for_each(|path| check_output(path, inputs.clone()))
}

/// The same as [`check_output`] of a command that writes a recording.
pub fn check_recording<'a>(path: &Path, inputs: impl IntoIterator<Item = &'a Path>) -> Result<()> {
    Ok(output::check_output(path, inputs)?)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn an_arm_stands_at_first_at_degrees_and_at_millimetres_of_joints_that_slide() {
        let mut robot = Robot::parse(include_str!("../../../cells/irb120/robot.toml"), "r").unwrap();
        robot.joints[0].kind = JointKind::Prismatic;
        let usual = [0.1; MAX_JOINTS];
        assert_eq!(start(&[], &robot, usual).unwrap(), usual);
        let stands = start(&[250.0, 90.0, 0.0, 0.0, 0.0, 0.0], &robot, usual).unwrap();
        assert_eq!(stands[..3], [0.25, std::f64::consts::FRAC_PI_2, 0.0]);
        assert!(start(&[1.0; 5], &robot, usual).is_err());
    }
}
