//! `trical plan`: collision-free, informative touches.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use nalgebra::Vector3;
use serde_json::json;
use trical_device::PlanEntry;
use trical_ident::{Shown, model_of_touches, shown, usual_set, write_whole};
use trical_model::{Cell, JointKind, MAX_JOINTS, Model, Robot};
use trical_plan::{
    CollisionModel, Criterion, Facing, Plan, PlanError, PlanOptions, PredictedError, Rejected, Sphere,
    ValidationOptions, plan_touches, poses_in_sphere, poses_in_workspace, read_plan, write_plan,
};

use crate::blindness::{self, Lacking, Seen};
use crate::error::{CliError, Result};
use crate::input::{self, RobotAndCell};
use crate::report::Made;
use crate::{plan_report, progress, say, table};

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
    /// As options have it.
    pub fn apply(self, options: &mut PlanOptions) {
        options.criterion = match self {
            Self::D => Criterion::Determinant,
            Self::A => Criterion::Variances,
            Self::E => Criterion::Weakest,
            Self::Sphere | Self::Workspace => Criterion::Region,
        };
        options.whole_workspace = self == Self::Workspace;
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
    /// Instead of touches, this many poses at which another instrument can prove the arm: in --sphere-mm, or without it in the
    /// whole workspace
    #[arg(long, value_name = "N")]
    points: Option<usize>,
    /// With --points: where a tracker stands in {w}; the tool's --facing-axis looks there
    #[arg(long, value_name = "X,Y,Z", value_delimiter = ',', allow_negative_numbers = true, requires = "points")]
    facing_mm: Vec<f64>,
    /// With --facing-mm: which direction of the tool, in its own axes, carries the reflector
    #[arg(
        long,
        value_name = "X,Y,Z",
        value_delimiter = ',',
        allow_negative_numbers = true,
        default_value = "0,0,1",
        requires = "facing_mm"
    )]
    facing_axis: Vec<f64>,
    /// With --facing-mm: how far that may be turned away from the tracker
    #[arg(long, value_name = "DEG", default_value_t = 30.0, requires = "facing_mm")]
    facing_within_deg: f64,
    /// Seed: the same seed gives the same plan
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// What the touches are to be best for
    #[arg(long, value_enum, ignore_case = true, default_value_t = Best::D)]
    criterion: Best,
    /// Where the arm is to be accurate: a sphere in {w}; without it, 200 mm about a point 100 mm above the balls
    #[arg(long, value_name = "X,Y,Z,RADIUS", value_delimiter = ',', allow_negative_numbers = true)]
    sphere_mm: Vec<f64>,
    /// Largest angle between the device's z axis and straight down
    #[arg(long, value_name = "DEG", default_value_t = 90.0)]
    max_tilt_deg: f64,
    /// Standard deviation of each of a touch's three numbers, for what is expected
    #[arg(long, value_name = "MM", default_value_t = 0.01)]
    noise_mm: f64,
    /// Where the arm stands before the first touch: its joints; without it, all zero
    #[arg(long, value_name = "Q1,Q2,...", value_delimiter = ',', allow_negative_numbers = true)]
    start_deg: Vec<f64>,
    /// Where to write the plan
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// A report with pictures of the cell and the poses, one HTML file
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// Refuses numbers of touches, candidates and poses for which nobody would wait.
fn check_counts(args: &Args) -> Result<()> {
    let counts = [("--per-ball", args.per_ball), ("--pool", args.pool), ("--points", args.points.unwrap_or(1))];
    for (option, n) in counts {
        if n > MOST {
            return Err(CliError::Input(format!("{option}: found {n}, expected at most {MOST}")));
        }
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
        let mut start = [0.0; MAX_JOINTS];
        if !self.start_deg.is_empty() {
            if self.start_deg.len() != robot.dof() {
                return Err(CliError::Input(format!(
                    "--start-deg: found {} numbers, expected {}, one for each joint",
                    self.start_deg.len(),
                    robot.dof()
                )));
            }
            for (q, (v, joint)) in start.iter_mut().zip(self.start_deg.iter().zip(&robot.joints)) {
                *q = if joint.kind == JointKind::Prismatic { v * 1e-3 } else { v.to_radians() };
            }
        }
        let mut options = PlanOptions {
            per_ball: self.per_ball,
            pool_per_ball: self.pool.max(self.per_ball),
            seed: self.seed,
            parameters: Some(model.terms.clone()),
            start: Some(start),
            sphere: self.sphere()?,
            noise_m: self.noise_mm * 1e-3,
            max_tilt_rad: self.max_tilt_deg.to_radians(),
            ..PlanOptions::default()
        };
        self.criterion.apply(&mut options);
        Ok(options)
    }
}

/// The nominal model with the paper's parameters: what touches are to identify.
pub fn model_to_identify(robot: &Robot, cell: &Cell) -> Result<Model> {
    Ok(model_of_touches(robot, cell, usual_set(robot))?)
}

/// The plan as entries for the procedure: the stand-off pose is the last point on the way.
pub fn entries(plan: &[trical_plan::PlanEntry]) -> Vec<PlanEntry> {
    plan.iter()
        .map(|e| PlanEntry {
            index: e.index as u64,
            ball: e.ball,
            joints: e.joints,
            via: e.via.iter().copied().chain(std::iter::once(e.approach)).collect(),
        })
        .collect()
}

/// Reads `plan.csv`.
pub fn load(path: &Path, robot: &Robot, balls: usize) -> Result<Vec<PlanEntry>> {
    let text = trical_model::error::read_text(path)?;
    let plan =
        read_plan(&text, &path.display().to_string(), robot, balls).map_err(|e| CliError::Input(e.to_string()))?;
    Ok(entries(&plan))
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    check_counts(args)?;
    input::check_output(&args.out)?;
    args.report.as_deref().map_or(Ok(()), input::check_output)?;
    let (robot, cell) = args.cell.load()?;
    if let Some(count) = args.points {
        return points(args, &robot, &cell, count);
    }
    let model = model_to_identify(&robot, &cell)?;
    let options = args.options(&robot, &model)?;
    let bar = progress::bar("planning");
    let plan = plan_touches(&robot, &cell, &options, &mut |f| progress::at(&bar, f, "")).map_err(|e| match e {
        PlanError::BadStart { .. } => CliError::Input(format!("{e}; --start-deg says where the arm stands")),
        e => e.into(),
    })?;
    progress::at(&bar, 1.0, "what it would show");
    let told = Told::new(&model, plan, options)?;
    bar.finish_and_clear();
    if let Some(path) = &args.report {
        write_whole(path, plan_report::render(&robot, &cell, &told, &Made::from(&args.cell.files()))?.as_bytes())?;
    }
    write_whole(&args.out, write_plan(&robot, &told.plan.entries).as_bytes())?;
    if args.json {
        return say(serde_json::to_string_pretty(&told.json())?);
    }
    for line in told.lines() {
        say(line)?;
    }
    say(format!("Wrote {}", args.out.display()))?;
    args.report.as_ref().map_or(Ok(()), |r| say(format!("Wrote {}", r.display())))
}

/// Poses for another instrument.
fn points(args: &Args, robot: &Robot, cell: &Cell, count: usize) -> Result<()> {
    let model = CollisionModel::new(robot, cell)?;
    let options = ValidationOptions { seed: args.seed, facing: args.facing()?, ..ValidationOptions::default() };
    let sphere = args.sphere()?;
    let poses = match &sphere {
        Some(s) => poses_in_sphere(&model, &s.centre, s.radius, count, &options)?,
        None => poses_in_workspace(&model, count, &options)?,
    };
    let unit = |kind| if kind == JointKind::Prismatic { ("mm", 1e3) } else { ("deg", 1.0_f64.to_degrees()) };
    let mut text = String::from("order");
    for (k, joint) in robot.joints.iter().enumerate() {
        text += &format!(",q{}_{}", k + 1, unit(joint.kind).0);
    }
    for (k, q) in poses.iter().enumerate() {
        text += &format!("\n{k}");
        for (joint, x) in robot.joints.iter().zip(q) {
            text += &format!(",{:.6}", x * unit(joint.kind).1);
        }
    }
    text.push('\n');
    write_whole(&args.out, text.as_bytes())?;
    let place = if sphere.is_some() { "the sphere" } else { "the whole workspace" };
    if args.json {
        return say(serde_json::to_string_pretty(&json!({ "points": poses.len(), "sphere": sphere.is_some() }))?);
    }
    say(format!(
        "{} poses in {place}, in no particular order, free of collisions where they stand; ways between them were not checked",
        poses.len()
    ))?;
    say(format!("Wrote {}", args.out.display()))
}

/// A plan and all that can be said of it.
pub struct Told {
    /// The plan.
    pub plan: Plan,
    /// What it was made with.
    pub options: PlanOptions,
    /// The parameters, each with the standard deviation to be expected.
    pub parameters: Vec<Shown>,
    /// What it would show.
    pub seen: Vec<Seen>,
    /// What no such recording can show, and why.
    pub lacking: Vec<Lacking>,
    /// Balls of the cell.
    pub balls: usize,
}

impl Told {
    /// `model` has the terms to identify.
    pub fn new(model: &Model, plan: Plan, options: PlanOptions) -> Result<Self> {
        let mut known = model.clone();
        known.terms.retain(|t| plan.expected.parameters.contains(&t.name));
        for t in &mut known.terms {
            let at = plan.expected.parameters.iter().position(|n| *n == t.name);
            t.sd = at.and_then(|k| plan.expected.sd.get(k).copied());
        }
        let parameters = known.terms.iter().map(|t| shown(&known, t)).collect();
        // with fewer numbers than parameters everything is taken up by them
        let determined = plan.expected.sd.iter().all(|s| s.is_finite());
        let (seen, lacking) = if determined {
            blindness::seen(&known, &plan.entries, options.noise_m)?
        } else {
            (Vec::new(), Vec::new())
        };
        Ok(Self { plan, options, parameters, seen, lacking, balls: model.cell.balls.len() })
    }

    /// Whether these touches determine the parameters.
    pub fn determined(&self) -> bool {
        self.plan.expected.sd.iter().all(|s| s.is_finite())
    }

    fn pool(&self) -> usize {
        let refused: usize = rejected(&self.plan).values().sum();
        self.plan.rejected.iter().map(|r| r.attempts).sum::<usize>() - refused
    }

    /// The contract's summary.
    pub fn json(&self) -> serde_json::Value {
        let e = &self.plan.expected;
        let error = |p: &Option<PredictedError>| {
            p.map(
                |p| json!({ "mean_mm": p.mean_m * 1e3, "rms_mm": p.rms_m * 1e3, "worst_rms_mm": p.worst_rms_m * 1e3 }),
            )
        };
        let parameters: Vec<serde_json::Value> = self
            .parameters
            .iter()
            .map(|s| json!({ "name": s.name, "site": s.site, "unit": s.unit, "sd": s.sd, "nominal": s.nominal }))
            .collect();
        let by_ball: Vec<serde_json::Value> = self
            .plan
            .rejected
            .iter()
            .enumerate()
            .map(|(k, r)| {
                let reasons: BTreeMap<&str, usize> = r.reasons().into_iter().collect();
                json!({ "ball": k + 1, "attempts": r.attempts, "rejected": reasons, "contacts": r.contacts })
            })
            .collect();
        json!({
            "touches": self.plan.entries.len(),
            "pool": self.pool(),
            "rejected": rejected(&self.plan),
            "by_ball": by_ball,
            "criterion": e.criterion,
            "gain_over_random": e.gain_over_random,
            "determined": self.determined(),
            "parameters": parameters,
            "not_identifiable": e.dependent,
            "observability": { "o1": e.o1, "condition": e.condition },
            "expected": {
                "noise_mm": self.options.noise_m * 1e3,
                "sphere": error(&e.in_sphere),
                "workspace": error(&e.in_workspace),
            },
            "senses": e.senses,
            "travel_rad": e.travel_rad,
            "blind_to": blindness::blind_json(&self.seen, &self.lacking),
        })
    }

    /// The summary for people.
    pub fn lines(&self) -> Vec<String> {
        let e = &self.plan.expected;
        let mut out = vec![format!(
            "{} touches of {} balls, chosen from {}{}",
            self.plan.entries.len(),
            self.balls,
            self.pool(),
            if e.gain_over_random.is_finite() {
                format!(" ({} times better than a random choice)", two_digits(e.gain_over_random))
            } else {
                String::new()
            }
        )];
        for (reason, n) in rejected(&self.plan).iter().filter(|r| *r.1 > 0) {
            out.push(format!("  {n:>6} candidates dropped: {reason}"));
        }
        if !self.determined() {
            out.push(format!(
                "These touches do not determine the {} parameters: more are needed to identify them",
                self.parameters.len()
            ));
            return out;
        }
        out.push(format!(
            "With noise of {} mm, {} parameters are expected with standard deviations of",
            self.options.noise_m * 1e3,
            self.parameters.len()
        ));
        let names: Vec<String> = self
            .parameters
            .iter()
            .map(|s| format!("{} {} {}", s.name, two_digits(s.sd.unwrap_or(f64::NAN)), s.unit))
            .collect();
        out.extend(names.chunks(5).map(|c| format!("  {}", c.join(", "))));
        out.push("Position error that this noise would leave, mm (what the model lacks comes on top):".into());
        for (name, p) in [("in the sphere", e.in_sphere), ("in the whole workspace", e.in_workspace)] {
            out.push(p.map_or_else(
                || format!("  {name}: not known, the arm reaches too few poses there"),
                |p| format!("  {name}: mean {:.3}, at the worst pose {:.3} rms", p.mean_m * 1e3, p.worst_rms_m * 1e3),
            ));
        }
        let advice = blindness::advice(&self.seen);
        if !advice.is_empty() {
            out.push("It would not show (lambda of a typical size, 3 is just visible):".into());
        }
        for (remedy, what) in advice {
            out.extend(table::wrapped(&what, 108, "  "));
            out.extend(table::wrapped(&format!("would help: {remedy}"), 108, "    "));
        }
        out
    }
}

/// A number with two significant digits.
pub fn two_digits(x: f64) -> String {
    let d = table::decimals_for(x.abs());
    format!("{x:.d$}")
}

/// Why candidates were dropped, counted over all balls.
pub fn rejected(plan: &Plan) -> BTreeMap<String, usize> {
    let mut all = Rejected::default();
    plan.rejected.iter().for_each(|r| all.add(r));
    all.reasons().into_iter().map(|(reason, n)| (reason.to_owned(), n)).collect()
}

impl From<PlanError> for CliError {
    fn from(e: PlanError) -> Self {
        match e {
            PlanError::NoWay { .. } | PlanError::TooFewPoses { .. } => Self::Failed(e.to_string()),
            _ => Self::Input(e.to_string()),
        }
    }
}
