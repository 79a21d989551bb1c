//! `trical study`: whole calibrations by the hundred, without hardware (the paper's simulation), and platforms of balls compared.

use std::path::PathBuf;

use trical_ident::{ParameterSet, write_whole};
use trical_model::{Cell, Robot, Task};
use trical_report::study::{self, Platforms, Study as Done, WrongSetting};
use trical_report::table;

use crate::commands::plan::Best;
use crate::error::{CliError, Result};
use crate::input::{RobotAndCell, as_option, made, make_folder};
use crate::{LINE, progress, say, say_json, say_lines};

/// Arguments of `trical study`.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    study: Study,
}

#[derive(clap::Subcommand)]
enum Study {
    /// The paper's simulation: error against the number of touches, chosen against random ones, with and without noise
    Touches(TouchesArgs),
    /// Number, size and height of the ball platform against the error in the sphere and in the whole workspace
    Platform(PlatformArgs),
}

#[derive(clap::Args)]
struct Common {
    #[command(flatten)]
    cell: RobotAndCell,
    /// Folder for study.csv, study.svg and study.html
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// True arms drawn for each setting
    #[arg(long, value_name = "N", default_value_t = 40)]
    trials: u64,
    /// Seed of all chance: the same seed gives the same bytes
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Candidates a ball
    #[arg(long, value_name = "N", default_value_t = 100)]
    pool: usize,
    /// What chosen touches are optimized for
    #[arg(long, value_enum, ignore_case = true, default_value_t = Best::D)]
    criterion: Best,
    /// Parameters to identify: with 'complete', also the twists of near-parallel axes
    #[arg(long, value_enum, default_value_t = Set::Compliance)]
    set: Set,
    /// Standard deviation of every length of a true arm
    #[arg(long, value_name = "MM", default_value_t = 1.0)]
    length_mm: f64,
    /// Standard deviation of every angle of a true arm
    #[arg(long, value_name = "DEG", default_value_t = 1.0)]
    angle_deg: f64,
    /// Least and largest compliance of its joints
    #[arg(long, value_name = "LEAST,MOST", value_delimiter = ',', default_values_t = [1e-3, 1e-1])]
    compliance_deg_per_nm: Vec<f64>,
    /// Noise of an indicator
    #[arg(long, value_name = "MM", default_value_t = 0.001)]
    indicator_mm: f64,
    /// Noise of the procedure, along each axis
    #[arg(long, value_name = "MM", default_value_t = 0.010)]
    procedure_mm: f64,
    /// Noise of each coordinate of a ball's known place
    #[arg(long, value_name = "MM", default_value_t = 0.001)]
    ballbar_mm: f64,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Set {
    Geometry,
    Compliance,
    Complete,
}

#[derive(clap::Args)]
struct TouchesArgs {
    #[command(flatten)]
    common: Common,
    /// Touches a ball, several settings
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', default_values_t = [5, 8, 11, 15, 20, 30])]
    per_ball: Vec<usize>,
}

#[derive(clap::Args)]
struct PlatformArgs {
    #[command(flatten)]
    common: Common,
    /// Touches of all balls together
    #[arg(long, value_name = "N", default_value_t = 45)]
    touches: usize,
    /// Numbers of balls (3 or more: {w} is theirs), evenly on a circle
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', default_values_t = [3, 6])]
    balls: Vec<usize>,
    /// Sizes of the platform: the side of the triangle that three balls on that circle make
    #[arg(long, value_name = "MM,MM,...", value_delimiter = ',', default_values_t = [100.0, 200.0, 300.0, 400.0])]
    side_mm: Vec<f64>,
    /// Heights above the balls of cell.toml
    #[arg(long, value_name = "MM,MM,...", value_delimiter = ',', allow_hyphen_values = true, default_values_t = [0.0, 150.0])]
    height_mm: Vec<f64>,
    /// How much higher every second ball is (a second plate)
    #[arg(long, value_name = "MM,MM,...", value_delimiter = ',', default_values_t = [0.0, 250.0])]
    raise_mm: Vec<f64>,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    match &args.study {
        Study::Touches(a) => {
            let asked = a.common.asked();
            asked.check().and_then(|()| asked.check_touches(&a.per_ball)).map_err(input)?;
            a.common.perform("study", |robot, cell, task| study::touches(robot, cell, &asked, &a.per_ball, task))
        }
        Study::Platform(a) => {
            let asked = a.common.asked();
            let platforms = Platforms {
                touches: a.touches,
                balls: a.balls.clone(),
                side_mm: a.side_mm.clone(),
                height_mm: a.height_mm.clone(),
                raise_mm: a.raise_mm.clone(),
            };
            asked.check().and_then(|()| platforms.check()).map_err(input)?;
            a.common.perform("platforms", |robot, cell, task| study::platforms(robot, cell, &asked, &platforms, task))
        }
    }
}

impl Common {
    fn asked(&self) -> study::Common {
        let (criterion, whole_workspace) = self.criterion.goal();
        study::Common {
            trials: self.trials,
            seed: self.seed,
            pool: self.pool,
            criterion,
            whole_workspace,
            set: match self.set {
                Set::Geometry => ParameterSet::Geometry,
                Set::Compliance => ParameterSet::Compliance,
                Set::Complete => ParameterSet::Complete,
            },
            length_mm: self.length_mm,
            angle_deg: self.angle_deg,
            compliance_deg_per_nm: self.compliance_deg_per_nm.clone(),
            indicator_mm: self.indicator_mm,
            procedure_mm: self.procedure_mm,
            ballbar_mm: self.ballbar_mm,
        }
    }

    fn perform(
        &self,
        what: &str,
        work: impl FnOnce(&Robot, &Cell, &Task<'_>) -> trical_report::Result<Done>,
    ) -> Result<()> {
        let (robot, cell) = self.cell.load()?;
        make_folder(&self.out)?;
        let done = progress::with_bar(what, |task| work(&robot, &cell, task))?;
        write_whole(&self.out.join("study.csv"), done.csv.as_bytes())?;
        write_whole(&self.out.join("study.svg"), done.svg.as_bytes())?;
        write_whole(&self.out.join("study.html"), done.html(&made(&self.cell.files()))?.as_bytes())?;
        if self.json {
            return say_json(&done.json);
        }
        say_lines(table::lines(&done.table))?;
        say_lines(std::iter::once(&done.verdict).chain(&done.notes).flat_map(|t| table::wrapped(t, LINE, "")))?;
        say(format!("Wrote study.csv, study.svg and study.html to {}", self.out.display()))
    }
}

fn input(e: WrongSetting) -> CliError {
    CliError::Input(format!("{}: {}", as_option(e.name, ""), e.problem))
}
