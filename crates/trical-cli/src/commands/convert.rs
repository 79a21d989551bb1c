//! `trical convert`: CSV and MCAP, either way; an arm's URDF to robot.toml.

use std::path::{Path, PathBuf};

use serde_json::json;
use trical_ident::write_whole;
use trical_model::urdf::UrdfPath;
use trical_recording::mcap::{Header, write_recording};
use trical_recording::{is_mcap, open_damaged, to_csv};

use crate::error::{CliError, Result};
use crate::{input, say};

/// Arguments of `trical convert`.
#[derive(clap::Args)]
pub struct Args {
    /// A recording (CSV or MCAP), or an arm (URDF, as in arm.urdf#base_link:tool0)
    #[arg(value_name = "FILE")]
    input: PathBuf,
    /// Where to write it: .csv or .mcap, .toml for an arm
    #[arg(value_name = "OUT", required_unless_present = "out")]
    output: Option<PathBuf>,
    /// The same as OUT
    #[arg(long, value_name = "OUT", conflicts_with = "output")]
    out: Option<PathBuf>,
    /// Number of the arm's joints, for a CSV
    #[arg(long, default_value_t = 6)]
    joints: usize,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let Some(output) = args.output.as_ref().or(args.out.as_ref()) else {
        return Err(CliError::Input("expected the name of a file to write".into()));
    };
    input::check_output(output, [args.input.as_path()])?;
    if let Some(source) = UrdfPath::of(&args.input) {
        return arm(&source, output, args.json);
    }
    let joints = if is_mcap(&args.input)? { None } else { Some(args.joints) };
    let (recording, lost) = open_damaged(&args.input, joints)?;
    if let Some(lost) = &lost {
        crate::note!("trical: note: {lost}");
    }
    match output.extension().and_then(|e| e.to_str()) {
        Some("csv") => {
            write_whole(output, &to_csv(&recording)?)?;
        }
        Some("mcap") => write_recording(output, &recording, &Header::for_joints(recording.joints))
            .map_err(|e| CliError::Failed(e.to_string()))?,
        _ => {
            return Err(CliError::Input(format!("{}: the name must end in .csv or .mcap", output.display())));
        }
    }
    if args.json {
        let value = json!({ "rows": recording.rows.len(), "joints": recording.joints, "lost": lost, "out": output });
        return say(serde_json::to_string_pretty(&value)?);
    }
    say(format!("{} rows written to {}", recording.rows.len(), output.display()))
}

/// Writes a URDF's arm as robot.toml.
fn arm(source: &UrdfPath, output: &Path, as_json: bool) -> Result<()> {
    let arm = source.load()?;
    if output.extension().is_none_or(|e| e != "toml") {
        return Err(CliError::Input(format!("{}: an arm is written as .toml", output.display())));
    }
    write_whole(output, arm.to_toml(&source.path).as_bytes())?;
    if as_json {
        let value = json!({ "joints": arm.joints, "root": arm.root, "tip": arm.tip, "out": output });
        return say(serde_json::to_string_pretty(&value)?);
    }
    say(format!(
        "{} joints, from link {} to link {}, written to {}",
        arm.robot.dof(),
        arm.root,
        arm.tip,
        output.display()
    ))
}
