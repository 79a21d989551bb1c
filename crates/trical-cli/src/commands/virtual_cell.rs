//! `trical virtual-cell`: a robot, balls and indicators that answer on a pseudo-terminal and a TCP port.

use std::path::PathBuf;

use trical_device::controller::rapid_protocol::{NO_SECRET, is_secret};
use trical_device::url::Secret;
use trical_device::virtual_cell::{Scheduled, Unsettled, fault_script};
use trical_device::{ArmPlant, CellOptions, VirtualCell};
use trical_diagnose::truth::{draw_truth, hide};
use trical_ident::{ModelFile, write_whole};
use trical_model::{MAX_JOINTS, Model};
use trical_report::study::places::Guided;

use super::record::Typed;
use crate::error::{CliError, Result, of_wish};
use crate::input::{self, RobotAndCell};
use crate::{quoted, say};

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
    /// TCP port of the indicators' receiver; 0 for any that is free. Without it the receiver answers on a pseudo-terminal, on
    /// Windows on any free TCP port
    #[arg(long, value_name = "PORT")]
    gauge_port: Option<u16>,
    /// What a client of the controller has to give first, or none; without it one is drawn. It stands in the URL that is printed
    #[arg(long, value_name = "WORD")]
    secret: Option<String>,
    /// An effect of docs/effects.md to hide in the arm, with its site and its size in typical ones, as in
    /// lost_motion_direction@3*2; steps and ripples as joint_zero_shift@2/600 (s), gear_ripple@4/100 (cycles)
    #[arg(long, alias = "conceal", value_name = "EFFECT[@SITE][*SIZE]")]
    hide: Vec<String>,
    /// What goes wrong, and when: TOML, see docs/cell.md
    #[arg(long, value_name = "FILE")]
    faults: Option<PathBuf>,
    /// Time scale: real seconds for each second of motion; 0 = at once, 1 = as long as a real arm takes
    #[arg(long, value_name = "SCALE", default_value_t = 0.0)]
    pace: f64,
    /// How long the receiver repeats the last value after a motion
    #[arg(long, value_name = "MS", default_value_t = 0.0)]
    radio_ms: f64,
    /// Read before the arm has settled: joints short by DEG, indicators off by MM, both decaying with the time
    /// constant S
    #[arg(long, value_name = "DEG,MM,S", value_delimiter = ',')]
    unsettled: Vec<f64>,
    /// Standard deviation of each indicator, and of a ball in its socket
    #[arg(long, value_name = "MM", default_value_t = 0.0005)]
    noise_mm: f64,
    /// Standard deviation, on each axis, of where the arm comes to rest
    #[arg(long, value_name = "MM", default_value_t = 0.004)]
    placement_mm: f64,
    /// A person guides the arm into the cell's sockets: lines typed here are those of `trical record`, which records the visits
    #[arg(long)]
    sockets: bool,
    /// Where the arm stands at first, deg, and mm of joints that slide; all zero without it
    #[arg(long, value_name = "Q1,Q2,...", value_delimiter = ',', allow_hyphen_values = true)]
    start_deg: Vec<f64>,
    /// The two addresses as JSON, in one line
    #[arg(long)]
    json: bool,
}

impl Args {
    fn script(&self) -> Result<Vec<Scheduled>> {
        let script = self.faults.as_deref().map(fault_script::load).transpose();
        Ok(script.map_err(CliError::input)?.unwrap_or_default())
    }

    fn options(&self, truth: &Model) -> Result<CellOptions> {
        for (name, value, most) in [
            ("--pace", self.pace, 100.0),
            ("--radio-ms", self.radio_ms, 60_000.0),
            ("--noise-mm", self.noise_mm, 10.0),
            ("--placement-mm", self.placement_mm, 10.0),
        ] {
            if !(0.0..=most).contains(&value) {
                return Err(CliError::Input(format!("{name}: found {value}, expected 0 to {most}")));
            }
        }
        let unsettled = match self.unsettled.as_slice() {
            [] => None,
            [deg, mm, s] if *s > 0.0 && deg.is_finite() && mm.is_finite() => {
                Some(Unsettled { joint: deg.to_radians(), indicator: mm * 1e-3, time: *s })
            }
            other => {
                return Err(CliError::Input(format!(
                    "--unsettled: found {other:?}, expected three numbers: deg, mm and a positive time in s"
                )));
            }
        };
        let start = input::start(&self.start_deg, &truth.robot, [0.0; MAX_JOINTS])?;
        let usual = CellOptions::like_a_real_one(truth, self.seed, self.port);
        let secret = match self.secret.as_deref() {
            None => usual.secret.clone(),
            Some(NO_SECRET) => None,
            Some(word) if is_secret(word) => Some(Secret::new(word)),
            Some(_) => return Err(CliError::Input("--secret: expected 8 to 40 letters and digits, or none".into())),
        };
        Ok(CellOptions {
            gauge_port: self.gauge_port,
            secret,
            pace: self.pace,
            radio_delay: self.radio_ms * 1e-3,
            unsettled,
            noise: self.noise_mm * 1e-3,
            placement: self.placement_mm * 1e-3,
            start,
            script: self.script()?,
            ..usual
        })
    }
}

/// The true model as a file.
pub fn seal(truth: &Model, path: &std::path::Path) -> Result<()> {
    let text = ModelFile::unmeasured(truth.clone()).to_toml()?;
    Ok(write_whole(path, format!("# the true arm of a virtual cell\n{text}").as_bytes())?)
}

/// Runs the command: until the process is ended.
pub fn run(args: &Args) -> Result<()> {
    if let Some(path) = &args.seal {
        let more = [&args.truth, &args.faults].into_iter().flatten().map(PathBuf::as_path);
        input::check_output(path, args.cell.files().into_iter().chain(more))?;
    }
    let (robot, cell) = args.cell.load()?;
    let mut truth = match &args.truth {
        Some(path) => {
            let file = ModelFile::load(path)?;
            file.require_robot(&robot, &path.display().to_string())?;
            file.model
        }
        None => draw_truth(&crate::commands::plan::model_to_identify(&robot, &cell)?, args.seed)?,
    };
    hide(&mut truth, &args.hide).map_err(|e| of_wish("--hide", e))?;
    if let Some(path) = &args.seal {
        seal(&truth, path)?;
    }
    let person = if args.sockets { Some(Guided::new(&truth, args.noise_mm * 1e-3, args.seed)?) } else { None };
    let plant = ArmPlant::new(&truth)?;
    let options = args.options(&truth)?;
    let running = VirtualCell::start(Box::new(plant), options).map_err(CliError::input)?;
    let (gauge, controller) = (running.gauge_url(), running.controller_url());
    say(if args.json {
        serde_json::json!({ "gauge": gauge, "controller": controller }).to_string()
    } else {
        format!("--gauge {} --controller {}", quoted(&gauge), quoted(&controller))
    })?;
    crate::note!("the virtual cell answers until it is ended with Ctrl-C");
    if let Some(person) = person {
        return guide(&running, person);
    }
    while running.is_running() {
        std::thread::sleep(std::time::Duration::from_millis(200));
    }
    Ok(())
}

/// A person guides the arm as typed, until the end of what is typed.
fn guide(cell: &VirtualCell, mut person: Guided) -> Result<()> {
    let (mut place, mut socket) = ("the first place".to_owned(), 1);
    crate::note!(
        "Enter guides the ball into the same socket, 1, 2, ... into that socket; p NAME puts the block elsewhere; q ends"
    );
    for line in std::io::stdin().lines() {
        let line = line.map_err(|e| CliError::Failed(format!("standard input cannot be read: {e}")))?;
        match Typed::of(&line, Some(person.sockets())) {
            Typed::End => break,
            Typed::Wrong(what) => crate::note!("{what}"),
            Typed::Place(name) => {
                person.next_place()?;
                place = name;
                crate::note!("the block stands at {place}");
            }
            Typed::Visit(at) => {
                socket = at.unwrap_or(socket);
                match person.visit(socket) {
                    Ok(q) => {
                        cell.guide(&q);
                        crate::note!("{place}, socket {socket}: the ball is in it");
                    }
                    Err(e) => crate::note!("{e}"),
                }
            }
        }
    }
    Ok(())
}
