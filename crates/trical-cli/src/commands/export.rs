//! `trical export`: the calibrated arm for other programs.

use std::path::PathBuf;

use serde_json::json;
use trical_ident::{ModelFile, write_whole};
use trical_model::Robot;
use trical_report::{ErrorMap, Export};

use crate::error::Result;
use crate::{input, say};

/// Arguments of `trical export`.
#[derive(clap::Args)]
pub struct Args {
    /// The model: calibrated.toml or improved.toml
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Refuse the model if it is not of this arm: robot.toml or a URDF
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Where to write base, links and tool as a URDF
    #[arg(long, value_name = "FILE", required_unless_present_any = ["mdh", "error_map"])]
    urdf: Option<PathBuf>,
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
    for out in [&args.urdf, &args.mdh, &args.error_map].into_iter().flatten() {
        input::check_output(out, [Some(&args.model), args.robot.as_ref()].into_iter().flatten().map(PathBuf::as_path))?;
    }
    let file = ModelFile::load(&args.model)?;
    if let Some(robot) = &args.robot {
        file.require_robot(&Robot::load(robot)?, &args.model.display().to_string())?;
    }
    let arm = Export::of(&file.model)?;
    let mut written = Vec::new();
    if let Some(out) = &args.urdf {
        write_whole(out, arm.urdf(&args.model.display().to_string()).as_bytes())?;
        written.push(out.display().to_string());
    }
    if let Some(out) = &args.mdh {
        write_whole(out, arm.table(out)?.as_bytes())?;
        written.push(out.display().to_string());
    }
    let mut map = None;
    if let Some(out) = &args.error_map {
        let errors = ErrorMap::of(&file.model, args.poses as usize)?;
        write_whole(out, errors.csv().as_bytes())?;
        written.push(out.display().to_string());
        map = Some(errors.summary());
    }
    if args.json {
        let mut summary = arm.json(&written);
        summary["error_map"] = json!(map);
        return say(serde_json::to_string_pretty(&summary)?);
    }
    say(format!("Wrote {}", written.join(" and ")))?;
    if let Some(e) = map {
        say(format!(
            "Over {} poses within its limits the arm misses by {:.3} mm on average, {:.3} mm at most, as seen from its own base.",
            args.poses, e.mean_mm, e.max_mm
        ))?;
    }
    if args.urdf.is_none() && args.mdh.is_none() {
        return Ok(());
    }
    if !arm.same_frames() {
        say(
            "A term tilts an axis: the table has frames of its own, and is not comparable to the nominal one line by line.",
        )?;
    }
    for line in arm.sentences() {
        say(line)?;
    }
    Ok(())
}
