//! `trical convert`: CSV and MCAP, either way.

use std::path::PathBuf;

use trical_device::Header;
use trical_device::record::write_recording;
use trical_ident::{load_csv, write_csv, write_whole};

use crate::error::{CliError, Result};
use crate::{input, say};

/// Arguments of `trical convert`.
#[derive(clap::Args)]
pub struct Args {
    /// A recording: CSV or MCAP
    #[arg(value_name = "REC")]
    input: PathBuf,
    /// Where to write it: .csv or .mcap
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// Number of the arm's joints, for a CSV
    #[arg(long, default_value_t = 6)]
    joints: usize,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    input::check_output(&args.output)?;
    let recording = if input::is_mcap(&args.input)? {
        let (recording, lost) = input::recovered(&args.input)?;
        if let Some(lost) = lost {
            eprintln!("trical: note: {lost}");
        }
        recording
    } else {
        load_csv(&args.input, args.joints)?
    };
    match args.output.extension().and_then(|e| e.to_str()) {
        Some("csv") => {
            let mut text = Vec::new();
            write_csv(&recording, &mut text).map_err(|e| CliError::Failed(e.to_string()))?;
            write_whole(&args.output, &text)?;
        }
        Some("mcap") => write_recording(&args.output, &recording, &Header::for_joints(recording.joints))
            .map_err(|e| CliError::Failed(e.to_string()))?,
        _ => {
            return Err(CliError::Input(format!("{}: the name must end in .csv or .mcap", args.output.display())));
        }
    }
    say(format!("{} rows written to {}", recording.rows.len(), args.output.display()))
}
