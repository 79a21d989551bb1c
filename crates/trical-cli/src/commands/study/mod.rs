//! `trical study`: whole calibrations by the hundred, without hardware (the paper's simulation), and platforms of balls compared.

mod platform;
mod touches;

use std::path::PathBuf;

use plotters::style::RGBColor;
use trical_ident::{ParameterSet, write_whole};
use trical_model::{Cell, Forward, Model, Robot};
use trical_plan::predict::tool_rows;
use trical_plan::{
    Candidate, CollisionModel, Criterion, PlanOptions, Sphere, ValidationOptions, generate, poses_in_sphere,
    poses_in_workspace,
};

use crate::commands::plan::Best;
use crate::error::{CliError, Result};
use crate::input::RobotAndCell;
use crate::report::{Made, Section, render};
use crate::simulation::{Nature, Outcome, Poses};

/// Arguments of `trical study`.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    study: Study,
}

#[derive(clap::Subcommand)]
enum Study {
    /// The paper's simulation: error against the number of touches, chosen against random ones, with and without noise
    Touches(touches::TouchesArgs),
    /// Number, size and height of the ball platform against the error in the sphere and in the whole workspace
    Platform(platform::PlatformArgs),
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
    /// What chosen touches are best for
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

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    match &args.study {
        Study::Touches(a) => touches::run(a),
        Study::Platform(a) => platform::run(a),
    }
}

impl Common {
    fn nature(&self) -> Result<Nature> {
        let at_least_0 = [
            ("--length-mm", self.length_mm),
            ("--angle-deg", self.angle_deg),
            ("--indicator-mm", self.indicator_mm),
            ("--procedure-mm", self.procedure_mm),
            ("--ballbar-mm", self.ballbar_mm),
        ];
        for (name, value) in at_least_0 {
            if !(value.is_finite() && (0.0..=20.0).contains(&value)) {
                return Err(CliError::Input(format!("{name}: found {value}, expected 0 to 20")));
            }
        }
        let [low, high] = match self.compliance_deg_per_nm.as_slice() {
            [a, b] if *a > 0.0 && a <= b && b.is_finite() => [a.to_radians(), b.to_radians()],
            other => {
                return Err(CliError::Input(format!(
                    "--compliance-deg-per-nm: found {other:?}, expected a least and a largest one above 0"
                )));
            }
        };
        if self.trials == 0 {
            return Err(CliError::Input("--trials: found 0, expected 1 or more".into()));
        }
        Ok(Nature {
            length: self.length_mm * 1e-3,
            angle: self.angle_deg.to_radians(),
            // a uniform draw needs a range
            compliance: [low, high * (1.0 + 1e-12)],
            indicator: self.indicator_mm * 1e-3,
            procedure: self.procedure_mm * 1e-3,
            ballbar: self.ballbar_mm * 1e-3,
        })
    }

    fn set(&self, robot: &Robot) -> ParameterSet {
        match self.set {
            _ if robot.require_masses().is_err() => ParameterSet::Geometry,
            Set::Geometry => ParameterSet::Geometry,
            Set::Compliance => ParameterSet::Compliance,
            Set::Complete => ParameterSet::Complete,
        }
    }

    fn options(&self, known: &Model) -> PlanOptions {
        let mut options = PlanOptions {
            seed: self.seed,
            pool_per_ball: self.pool,
            per_ball: 1,
            parameters: Some(known.terms.clone()),
            ..PlanOptions::default()
        };
        self.criterion.apply(&mut options);
        options
    }

    fn folder(&self) -> Result<()> {
        std::fs::create_dir_all(&self.out)
            .map_err(|e| CliError::Input(format!("{}: cannot be made: {e}", self.out.display())))
    }

    fn write(&self, csv: &str, figure: &str, title: &str, verdict: &str, sections: &[Section]) -> Result<()> {
        write_whole(&self.out.join("study.csv"), csv.as_bytes())?;
        write_whole(&self.out.join("study.svg"), figure.as_bytes())?;
        let html = render(title, verdict, sections, &Made::from(&self.cell.files()))?;
        Ok(write_whole(&self.out.join("study.html"), html.as_bytes())?)
    }
}

/// Where errors are looked at: poses that the nominal arm takes without meeting anything.
fn poses(robot: &Robot, cell: &Cell, seed: u64) -> Result<Poses> {
    let model = CollisionModel::new(robot, cell)?;
    let sphere = Sphere::above(&cell.balls).ok_or_else(|| CliError::Input("the cell has no [balls]".into()))?;
    let options = ValidationOptions { seed, ..ValidationOptions::default() };
    Ok(Poses {
        sphere: poses_in_sphere(&model, &sphere.centre, sphere.radius, 100, &options)?,
        workspace: poses_in_workspace(&model, 300, &options)?,
    })
}

fn pool(robot: &Robot, cell: &Cell, options: &PlanOptions) -> Result<Vec<Candidate>> {
    let model = CollisionModel::new(robot, cell)?;
    let mut pool = Vec::new();
    for ball in 0..cell.balls.len() {
        pool.extend(generate::generate(&model, ball, options, &mut |_| {})?.0);
    }
    Ok(pool)
}

/// How the free terms move the tool where the criterion looks.
fn region(forward: &Forward, poses: &Poses, options: &PlanOptions) -> Vec<f64> {
    if options.criterion != Criterion::Region {
        return Vec::new();
    }
    tool_rows(forward, if options.whole_workspace { &poses.workspace } else { &poses.sphere })
}

/// Mean, and where the middle four fifths lie.
#[derive(Clone, Copy, Debug)]
struct Spread {
    mean: f64,
    low: f64,
    high: f64,
}

impl Spread {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut v: Vec<f64> = values.collect();
        v.sort_by(f64::total_cmp);
        #[expect(
            clippy::cast_precision_loss,
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a small count"
        )]
        let at =
            |share: f64| v.get(((v.len().max(1) - 1) as f64 * share).round() as usize).copied().unwrap_or(f64::NAN);
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let mean = v.iter().sum::<f64>() / v.len() as f64;
        Self { mean, low: at(0.1), high: at(0.9) }
    }
}

const SPHERE: fn(&Outcome) -> f64 = |o| o.sphere[0];
const WORKSPACE: fn(&Outcome) -> f64 = |o| o.workspace[0];

const CURVES: [RGBColor; 8] = [
    RGBColor(38, 102, 165),
    RGBColor(209, 102, 31),
    RGBColor(42, 157, 124),
    RGBColor(138, 95, 176),
    RGBColor(184, 144, 28),
    RGBColor(194, 71, 107),
    RGBColor(90, 120, 140),
    RGBColor(60, 60, 60),
];
