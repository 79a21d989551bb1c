//! `trical virtual-cell`: a robot, balls and indicators that answer on a pseudo-terminal and a TCP port.

use std::path::PathBuf;

use trical_device::VirtualCell;
use trical_ident::{JointSource, ModelFile, write_whole};
use trical_model::Model;

use crate::error::{CliError, Result};
use crate::input::{self, RobotAndCell};
use crate::plant::{ArmPlant, cell_options, draw_truth};
use crate::say;

/// Arguments of `trical virtual-cell`.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    cell: RobotAndCell,
    /// The true arm: a model file. Without it one is drawn by chance
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    /// Where to write the true arm that was drawn: a sealed file, not for those who identify
    #[arg(long, value_name = "FILE")]
    seal: Option<PathBuf>,
    /// Seed of the true arm and of all noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// TCP port of the controller; 0 for any that is free
    #[arg(long, default_value_t = 5000)]
    port: u16,
}

/// The true model as a file.
pub fn seal(truth: &Model, path: &std::path::Path) -> Result<()> {
    let file =
        ModelFile { model: truth.clone(), joints: JointSource::Read, references: Vec::new(), recordings: Vec::new() };
    let text = file.to_toml()?;
    Ok(write_whole(path, format!("# the true arm of a virtual cell\n{text}").as_bytes())?)
}

/// Runs the command: until the process is ended.
pub fn run(args: &Args) -> Result<()> {
    if let Some(path) = &args.seal {
        input::check_output(path)?;
    }
    let (robot, cell) = args.cell.load()?;
    let truth = match &args.truth {
        Some(path) => {
            let file = ModelFile::load(path)?;
            file.require_robot(&robot, &path.display().to_string())?;
            file.model
        }
        None => draw_truth(&crate::commands::plan::model_to_identify(&robot, &cell)?, args.seed)?,
    };
    if let Some(path) = &args.seal {
        seal(&truth, path)?;
    }
    let plant = ArmPlant::new(&truth)?;
    let options = cell_options(&truth, args.seed, args.port);
    let running = VirtualCell::start(Box::new(plant), options).map_err(|e| CliError::Input(e.to_string()))?;
    say(format!("--gauge '{}' --controller '{}'", running.gauge_url(), running.controller_url()))?;
    eprintln!("the virtual cell answers until it is ended with Ctrl-C");
    while running.is_running() {
        std::thread::sleep(std::time::Duration::from_millis(200));
    }
    Ok(())
}
