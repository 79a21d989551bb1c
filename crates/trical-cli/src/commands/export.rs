//! `trical export`: the calibrated arm for other programs.

use std::path::PathBuf;

use trical_ident::{ModelFile, write_whole};
use trical_model::Robot;
use trical_model::urdf::UrdfPath;
use trical_report::{Export, Outputs, table};

use crate::error::Result;
use crate::{LINE, input, say, say_json, say_lines};

/// Arguments of `trical export`.
#[derive(clap::Args)]
#[command(group(clap::ArgGroup::new("files").required(true).multiple(true).args(["urdf", "mdh", "error_map", "ur_kinematics"])))]
pub struct Args {
    /// The model: calibrated.toml or improved.toml
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Refuse the model if it is not of this arm: robot.toml or a URDF. With a URDF here, --urdf writes the same file
    /// with corrected joint origins
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Where to write the arm as a URDF: the one of --robot, corrected, or else base, links and tool anew
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// Where to write the kinematics of an arm of Universal Robots for its ROS driver (robot_calibration.yaml)
    #[arg(long, value_name = "FILE")]
    ur_kinematics: Option<PathBuf>,
    /// Where to write the table of modified Denavit-Hartenberg parameters: .toml (a robot file), .json or .csv
    #[arg(long, value_name = "FILE")]
    mdh: Option<PathBuf>,
    /// Where to write how far the arm misses all over its workspace: a CSV of poses at random within the limits
    #[arg(long, value_name = "FILE")]
    error_map: Option<PathBuf>,
    /// Poses of the map
    #[arg(long, value_name = "N", default_value_t = 2000, requires = "error_map", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    poses: u32,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let outputs = [
        ("--urdf", "URDF", args.urdf.as_ref()),
        ("--mdh", "table", args.mdh.as_ref()),
        ("--error-map", "error map", args.error_map.as_ref()),
        ("--ur-kinematics", "kinematics", args.ur_kinematics.as_ref()),
    ];
    input::check_outputs(outputs, [args.model.as_path()].into_iter().chain(args.robot.as_deref()))?;
    let file = ModelFile::load(&args.model)?;
    if let Some(robot) = &args.robot {
        file.require_robot(&Robot::load(robot)?, &args.model.display().to_string())?;
    }
    let arm = Export::of(&file)?;
    let given = args.robot.as_deref().filter(|_| args.urdf.is_some()).and_then(UrdfPath::of);
    let source = args.model.file_stem().unwrap_or_default().to_string_lossy();
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let hash = format!("calib_{}", source.chars().map(plain).collect::<String>());
    let to = Outputs {
        urdf: args.urdf.as_deref(),
        ur_kinematics: args.ur_kinematics.as_deref(),
        mdh: args.mdh.as_deref(),
        error_map: args.error_map.as_deref(),
        poses: args.poses as usize,
    };
    // all of them, before the first is written
    let (outputs, map) = arm.texts(&to, given.as_ref(), (&args.model.display().to_string(), &hash))?;
    let cautions = arm.cautions(&to, given.as_ref())?;
    outputs.iter().try_for_each(|(out, text)| write_whole(out, text.as_bytes()))?;
    let written: Vec<String> = outputs.iter().map(|(out, _)| out.display().to_string()).collect();
    if args.json {
        return say_json(&arm.json(&written, map.as_ref(), &cautions));
    }
    say(format!("Wrote {}", written.join(" and ")))?;
    if let Some(e) = map {
        say(format!(
            "At {} poses within its limits the nominal arm is off by {:.3} mm on average and {:.3} mm at most, seen from its own base.",
            args.poses, e.errors.mean_mm, e.errors.max_mm
        ))?;
        if e.beyond > 0 {
            say(format!("{} of them are {}.", e.beyond, file.visited().beyond_in_words()))?;
        }
    }
    if args.urdf.is_none() && args.mdh.is_none() && args.ur_kinematics.is_none() {
        return Ok(());
    }
    if !arm.same_frames() {
        say(
            "A term tilts an axis: the table has frames of its own, and is not comparable to the nominal one line by line.",
        )?;
    }
    say_lines(arm.sentences())?;
    say_lines(cautions.iter().flat_map(|t| table::wrapped(t, LINE, "")))
}
