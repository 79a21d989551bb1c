//! `trical convert`: CSV and MCAP, either way; an arm's URDF to robot.toml.

use std::path::{Path, PathBuf};

use serde_json::json;
use trical_ident::write_whole;
use trical_model::Robot;
use trical_model::calibrated::calibrated_by_maker;
use trical_model::error::read_text;
use trical_model::urdf::UrdfPath;
use trical_recording::mcap::{Header, write_recording};
use trical_recording::output::check_not_measured;
use trical_recording::{open_damaged, to_csv};
use trical_report::table;

use crate::error::{CliError, Result};
use crate::{input, say, say_json};

/// Arguments of `trical convert`.
#[derive(clap::Args)]
pub struct Args {
    /// A recording (CSV, MCAP, or a ROS 2 bag, as in run.mcap#/tracker/pose), an arm (URDF, as in arm.urdf#base_link:tool0), or what Universal Robots
    /// measured of one (calibration.conf of its controller)
    #[arg(value_name = "FILE")]
    input: PathBuf,
    /// Where to write it: .csv or .mcap, .toml for an arm
    #[arg(value_name = "OUT", required_unless_present = "out")]
    output: Option<PathBuf>,
    /// The same as OUT
    #[arg(long, value_name = "OUT", conflicts_with = "output")]
    out: Option<PathBuf>,
    /// Number of the arm's joints, for a bag whose joint states are of more
    #[arg(long)]
    joints: Option<usize>,
    /// The nominal arm that a calibration.conf adds to: robot.toml in the maker's frames
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let Some(output) = args.output.as_ref().or(args.out.as_ref()) else {
        return Err(CliError::Input("expected the name of a file to write".into()));
    };
    input::check_recording(output, [args.input.as_path()])?;
    if args.input.extension().is_some_and(|e| e == "conf") {
        return by_maker(args, output);
    }
    if args.robot.is_some() {
        let what = format!("--robot: is for a calibration.conf; {} needs none", args.input.display());
        return Err(CliError::Input(what));
    }
    if let Some(source) = UrdfPath::of(&args.input) {
        return arm(&source, output, args.json);
    }
    let (recording, lost) = open_damaged(&args.input, args.joints)?;
    for note in &recording.notes {
        crate::note!("trical: note: {note}");
    }
    if let Some(lost) = &lost {
        crate::note!("trical: note: {lost}");
    }
    let ending = output.extension().map(|e| e.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        Some("csv") => {
            write_whole(output, &to_csv(&recording)?)?;
        }
        Some("mcap") => {
            check_not_measured(output)?;
            write_recording(output, &recording, &Header::for_joints(recording.joints)).map_err(CliError::failed)?
        }
        _ => {
            return Err(CliError::Input(format!("{}: the name must end in .csv or .mcap", output.display())));
        }
    }
    if args.json {
        return say_json(
            &json!({ "rows": recording.rows.len(), "joints": recording.joints, "lost": lost, "out": output }),
        );
    }
    let rows = recording.rows.len();
    say(format!("{} written to {}", table::counted(rows, "row"), output.display()))
}

/// Writes the arm that Universal Robots measured as robot.toml.
fn by_maker(args: &Args, output: &Path) -> Result<()> {
    let conf = args.input.display();
    let Some(nominal) = &args.robot else {
        let problem = "says what is added to the nominal arm; expected --robot with that arm, as robots/ur5e.toml";
        return Err(CliError::Input(format!("{conf}: {problem}")));
    };
    if output.extension().is_none_or(|e| e != "toml") {
        return Err(CliError::Input(format!("{}: an arm is written as .toml", output.display())));
    }
    let nominal = Robot::load(nominal)?;
    let robot = calibrated_by_maker(&nominal, &read_text(&args.input)?, &conf.to_string())?;
    write_whole(output, format!("# {} as its maker measured it: {conf}\n{}", robot.name, robot.to_toml()).as_bytes())?;
    if args.json {
        return say_json(&json!({ "joints": robot.dof(), "out": output }));
    }
    say(format!("{} as its maker measured it, written to {}", robot.name, output.display()))
}

/// Writes a URDF's arm as robot.toml.
fn arm(source: &UrdfPath, output: &Path, as_json: bool) -> Result<()> {
    let arm = source.load()?;
    if output.extension().is_none_or(|e| e != "toml") {
        return Err(CliError::Input(format!("{}: an arm is written as .toml", output.display())));
    }
    write_whole(output, arm.to_toml(&source.path).as_bytes())?;
    if as_json {
        return say_json(&json!({ "joints": arm.robot.joint_names, "root": arm.root, "tip": arm.tip, "out": output }));
    }
    say(format!(
        "{} joints, from link {} to link {}, written to {}",
        arm.robot.dof(),
        arm.root,
        arm.tip,
        output.display()
    ))
}
