//! `trical plan`: collision-free, informative touches.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use nalgebra::Vector3;
use serde_json::json;
use trical_device::PlanEntry;
use trical_ident::{model_of_touches, usual_set, write_whole};

use trical_model::{Cell, Joints, Model, Robot};
use trical_plan::{
    CollisionModel, Criterion, Facing, PlanError, PlanOptions, Sphere, ValidationOptions, plan_touches,
    poses_in_sphere, poses_in_workspace, read_plan, usual_start, write_plan,
};
use trical_report::plan_report;
use trical_report::plan_summary::PlanSummary;
use trical_report::study::places::{self, Worth};
use trical_report::table;

use crate::error::{CliError, Result};
use crate::input::{self, RobotAndCell};
use crate::{LINE, progress, say, say_json, say_lines, say_wrapped};

/// Touches a ball, candidates a ball, poses: no more than this many.
const MOST: usize = 1000;

/// What touches are to be best for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Best {
    /// All parameters together: det(J'J), observability index O1
    D,
    /// The sum of the parameters' variances
    A,
    /// The worst known direction of parameters: smallest singular value, O3
    E,
    /// The position error in --sphere-mm
    Sphere,
    /// The position error in the whole workspace
    Workspace,
}

impl Best {
    /// As options have it: the criterion, and whether the whole workspace counts.
    pub fn goal(self) -> (Criterion, bool) {
        let criterion = match self {
            Self::D => Criterion::Determinant,
            Self::A => Criterion::Variances,
            Self::E => Criterion::Weakest,
            Self::Sphere | Self::Workspace => Criterion::Region,
        };
        (criterion, self == Self::Workspace)
    }
}

/// Arguments of `trical plan`.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    cell: RobotAndCell,
    /// Touches a ball
    #[arg(long, value_name = "N", default_value_t = 15)]
    per_ball: usize,
    /// Candidates a ball, from which the informative ones are chosen
    #[arg(long, value_name = "N", default_value_t = 100)]
    pool: usize,
    /// Instead of touches, this many poses at which another instrument can check the arm: in --sphere-mm, else in the
    /// whole workspace
    #[arg(long, value_name = "N", conflicts_with_all = ["per_ball", "pool", "criterion", "start_deg", "max_tilt_deg", "noise_mm"])]
    points: Option<usize>,
    /// With --points: where a tracker stands in the world frame {w}; the tool's --facing-axis points at it
    #[arg(long, value_name = "X,Y,Z", value_delimiter = ',', allow_hyphen_values = true, requires = "points")]
    facing_mm: Vec<f64>,
    /// With --facing-mm: which direction of the tool, in its own axes, carries the reflector
    #[arg(
        long,
        value_name = "X,Y,Z",
        value_delimiter = ',',
        allow_hyphen_values = true,
        default_value = "0,0,1",
        requires = "facing_mm"
    )]
    facing_axis: Vec<f64>,
    /// With --facing-mm: largest angle between that axis and the direction to the tracker
    #[arg(long, value_name = "DEG", default_value_t = 30.0, requires = "facing_mm")]
    facing_within_deg: f64,
    /// Seed: the same seed gives the same plan
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// What the touches are optimized for
    #[arg(long, value_enum, ignore_case = true, default_value_t = Best::D)]
    criterion: Best,
    /// Where the arm is to be accurate: a sphere in the world frame {w}; without it, 200 mm about a point 100 mm above the balls
    #[arg(long, value_name = "X,Y,Z,RADIUS", value_delimiter = ',', allow_hyphen_values = true)]
    sphere_mm: Vec<f64>,
    /// Largest angle between the device's z axis and straight down
    #[arg(long, value_name = "DEG", default_value_t = 90.0, allow_negative_numbers = true)]
    max_tilt_deg: f64,
    /// Standard deviation of each of a touch's three readings, for the expected errors
    #[arg(long, value_name = "MM", default_value_t = 0.01, allow_negative_numbers = true)]
    noise_mm: f64,
    /// Where the arm stands before the first touch: its joints; without it zero, or the middle between limits that leave zero out
    #[arg(long, value_name = "Q1,Q2,...", value_delimiter = ',', allow_hyphen_values = true)]
    start_deg: Vec<f64>,
    /// Where to write the plan. Without it, for one or two sockets at places that nobody knows, only the expected error by number of places is told
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// A report with pictures of the cell and the poses, one HTML file
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// Refuses numbers of touches, candidates and poses for which nobody would wait, and numbers that mean nothing.
fn check_counts(args: &Args) -> Result<()> {
    let counts = [("--per-ball", args.per_ball), ("--pool", args.pool), ("--points", args.points.unwrap_or(1))];
    for (option, n) in counts {
        if n > MOST {
            return Err(CliError::Input(format!("{option}: found {n}, expected at most {MOST}")));
        }
        if n == 0 && option != "--pool" {
            return Err(CliError::Input(format!("{option}: found 0, expected 1 or more")));
        }
    }
    if !(0.0..=180.0).contains(&args.max_tilt_deg) {
        return Err(CliError::Input(format!("--max-tilt-deg: found {}, expected 0 to 180", args.max_tilt_deg)));
    }
    if !(args.noise_mm > 0.0 && args.noise_mm <= 10.0) {
        return Err(CliError::Input(format!("--noise-mm: found {}, expected more than 0, at most 10", args.noise_mm)));
    }
    Ok(())
}

impl Args {
    fn sphere(&self) -> Result<Option<Sphere>> {
        match self.sphere_mm.as_slice() {
            [x, y, z, r] if *r > 0.0 => Ok(Some(Sphere { centre: Vector3::new(*x, *y, *z) * 1e-3, radius: r * 1e-3 })),
            [] => Ok(None),
            [_, _, _, r] => {
                Err(CliError::Input(format!("--sphere-mm: found a radius of {r} mm, expected more than 0")))
            }
            other => {
                let n = other.len();
                Err(CliError::Input(format!("--sphere-mm: found {n} numbers, expected 4: x, y, z and radius")))
            }
        }
    }

    fn facing(&self) -> Result<Facing> {
        let three = |v: &[f64], what: &str| match v {
            [x, y, z] => Ok(Vector3::new(*x, *y, *z)),
            other => Err(CliError::Input(format!("{what}: found {} numbers, expected 3: x, y and z", other.len()))),
        };
        if self.facing_mm.is_empty() {
            return Ok(Facing::Any);
        }
        let axis_in_tool = three(&self.facing_axis, "--facing-axis")?;
        if axis_in_tool.norm() < 1e-9 {
            return Err(CliError::Input("--facing-axis: found 0,0,0, expected a direction".into()));
        }
        Ok(Facing::Towards {
            point: three(&self.facing_mm, "--facing-mm")? * 1e-3,
            axis_in_tool,
            within_rad: self.facing_within_deg.to_radians(),
        })
    }

    fn options(&self, robot: &Robot, model: &Model) -> Result<PlanOptions> {
        let start = input::start(&self.start_deg, robot, usual_start(robot))?;
        let (criterion, whole_workspace) = self.criterion.goal();
        Ok(PlanOptions {
            criterion,
            whole_workspace,
            per_ball: self.per_ball,
            pool_per_ball: self.pool.max(self.per_ball),
            seed: self.seed,
            parameters: Some(model.terms.clone()),
            start: Some(start),
            sphere: self.sphere()?,
            noise_m: self.noise_mm * 1e-3,
            max_tilt_rad: self.max_tilt_deg.to_radians(),
            ..PlanOptions::default()
        })
    }
}

/// The nominal model with the paper's parameters: what touches are to identify.
pub fn model_to_identify(robot: &Robot, cell: &Cell) -> Result<Model> {
    Ok(model_of_touches(robot, cell, usual_set(robot))?)
}

/// The plan as entries for the procedure: the stand-off pose is the last point on the way.
pub fn entries(plan: &[trical_plan::PlanEntry]) -> Vec<PlanEntry> {
    plan.iter().map(|e| PlanEntry::new(e.index as u64, e.ball, e.joints, &e.via, e.approach)).collect()
}

/// Reads `plan.csv`.
pub fn load(path: &Path, robot: &Robot, balls: usize) -> Result<Vec<PlanEntry>> {
    let text = trical_model::error::read_text(path)?;
    let plan = read_plan(&text, &path.display().to_string(), robot, balls).map_err(CliError::input)?;
    Ok(entries(&plan))
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    check_counts(args)?;
    let outputs = [("--out", "plan", args.out.as_ref()), ("--report", "page", args.report.as_ref())];
    input::check_outputs(outputs, args.cell.files())?;
    let (robot, cell) = args.cell.load()?;
    let few = (1..3).contains(&cell.balls.len());
    let worth = || {
        progress::with_bar("what places are worth", |task| -> Result<Vec<Worth>> {
            Ok(places::worth(&robot, &cell, args.per_ball, args.noise_mm * 1e-3, args.seed, task)?)
        })
    };
    let Some(out) = &args.out else {
        if !few || args.points.is_some() || args.report.is_some() {
            return Err(CliError::Input("--out is missing: where to write the plan".into()));
        }
        let worth = worth()?;
        return if args.json { say_json(&json!({ "places": worth })) } else { say_lines(worth_lines(args, &worth)) };
    };
    if let Some(count) = args.points {
        if args.report.is_some() {
            return Err(CliError::Input("--report: a plan of poses (--points) has no report; found both".into()));
        }
        return points(args, out, &robot, &cell, count);
    }
    if cell.balls.is_empty() {
        let what =
            format!("{}: has no [balls] to touch; --points N plans poses for a tracker", args.cell.cell.display());
        return Err(CliError::Input(what));
    }
    let model = model_to_identify(&robot, &cell)?;
    let options = args.options(&robot, &model)?;
    let summary = progress::with_bar("planning", |task| -> Result<PlanSummary> {
        let plan = plan_touches(&robot, &cell, &options, task).map_err(|e| match e {
            PlanError::BadStart { .. } => CliError::Input(format!("{e}; --start-deg says where the arm stands")),
            e if few => {
                CliError::Input(format!("{e}; without --out, only the expected error by number of places is told"))
            }
            e => e.into(),
        })?;
        task.step(1.0, "what it would show")?;
        Ok(PlanSummary::new(&model, plan, options)?)
    })?;
    if let Some(path) = &args.report {
        write_whole(path, plan_report::render(&robot, &cell, &summary, &input::made(&args.cell.files()))?.as_bytes())?;
    }
    write_whole(out, write_plan(&robot, &summary.plan.entries).as_bytes())?;
    let worth = if few { worth()? } else { Vec::new() };
    if args.json {
        let mut value = summary.json();
        if few {
            value["places"] = serde_json::to_value(&worth)?;
        }
        return say_json(&value);
    }
    say_lines(summary.lines())?;
    if few {
        let said = "Caution: with fewer than three balls identify takes where they stand as unknown at every place, and this plan as known: what is \
                    expected above is too good, and holds in the end for three or more places, each with a plan of its own.";
        say_wrapped(said, "")?;
        say_lines(worth_lines(args, &worth))?;
    }
    let files: Vec<String> =
        [Some(out), args.report.as_ref()].into_iter().flatten().map(|f| f.display().to_string()).collect();
    say(format!("Wrote {}", files.join(" and ")))
}

/// What places of sockets are worth, as a table.
fn worth_lines(args: &Args, worth: &[Worth]) -> Vec<String> {
    let before = worth.first().map_or(0.0, |w| w.before_mm);
    let said = format!(
        "Expected error by number of unknown places, on simulated arms that are {before:.2} mm off on average, with {} touches of each ball or socket \
         at each place and noise of {} mm (--noise-mm; a printed socket has 0.1):",
        args.per_ball, args.noise_mm
    );
    let mut rows = vec![["places", "touches", "mean error left, mm"].map(String::from).to_vec()];
    rows.extend(worth.iter().map(|w| vec![w.places.to_string(), w.touches.to_string(), format!("{:.3}", w.mean_mm)]));
    table::wrapped(&said, LINE, "").into_iter().chain(table::lines(&rows)).collect()
}

/// Poses for another instrument.
fn points(args: &Args, out: &Path, robot: &Robot, cell: &Cell, count: usize) -> Result<()> {
    let model = CollisionModel::new(robot, cell)?;
    let options = ValidationOptions { seed: args.seed, facing: args.facing()? };
    let sphere = args.sphere()?;
    let poses = match &sphere {
        Some(s) => poses_in_sphere(&model, &s.centre, s.radius, count, &options)?,
        None => poses_in_workspace(&model, count, &options)?,
    };
    let units = || robot.joints.iter().map(|joint| joint.kind.unit());
    let names = units().enumerate().map(|(k, (_, unit))| format!("q{}_{unit}", k + 1));
    let head = std::iter::once("order".to_owned()).chain(names).collect::<Vec<_>>();
    let row = |(k, q): (usize, &Joints)| {
        let values = q.iter().zip(units()).map(|(q, (factor, _))| format!("{:.6}", q * factor));
        std::iter::once(k.to_string()).chain(values).collect()
    };
    let text = table::csv(std::iter::once(head).chain(poses.iter().enumerate().map(row)));
    write_whole(out, text.as_bytes())?;
    let place = if sphere.is_some() { "the sphere" } else { "the whole workspace" };
    if args.json {
        return say_json(&json!({ "points": poses.len(), "sphere": sphere.is_some() }));
    }
    say(format!(
        "{} poses in {place}, in no particular order, free of collisions where they stand; ways between them were not checked",
        poses.len()
    ))?;
    say(format!("Wrote {}", out.display()))
}
