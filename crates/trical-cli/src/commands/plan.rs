//! `trical plan`: collision-free, informative touches.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::json;
use trical_device::PlanEntry;
use trical_ident::{Choice, Dataset, JointSource, ParameterSet, write_whole};
use trical_model::{Cell, MAX_JOINTS, Measured, Model, Recording, Robot, Row, State};
use trical_plan::{Plan, PlanOptions, Rejected, plan_touches, read_plan, write_plan};

use crate::error::{CliError, Result};
use crate::input::{self, RobotAndCell};
use crate::{progress, say};

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
    /// Seed: the same seed gives the same plan
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Where to write the plan
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// The nominal model with the paper's parameters: what touches are to identify.
pub fn model_to_identify(robot: &Robot, cell: &Cell) -> Result<Model> {
    let touch = |ball| Row {
        state: State::at(&[0.0; MAX_JOINTS]),
        measured: Measured::Touch { ball, reading: [0.0; 3] },
        seq: None,
        line: 0,
    };
    let rows = (0..cell.balls.len()).map(touch).collect();
    let recording = Recording { name: "plan".into(), joints: robot.dof(), rows };
    let data = Dataset::build(&[recording], JointSource::Read, None)?;
    let set = if robot.require_masses().is_ok() { ParameterSet::Compliance } else { ParameterSet::Geometry };
    let mut model = Model::nominal(robot.clone(), cell.clone());
    model.terms = trical_ident::identifiability::independent_terms(&model, &data, &Choice::from(set))?.0;
    Ok(model)
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
    input::check_output(&args.out)?;
    let (robot, cell) = args.cell.load()?;
    let model = model_to_identify(&robot, &cell)?;
    let options = PlanOptions {
        per_ball: args.per_ball,
        pool_per_ball: args.pool.max(args.per_ball),
        seed: args.seed,
        parameters: Some(model.terms),
        start: Some([0.0; MAX_JOINTS]),
        ..PlanOptions::default()
    };
    let bar = progress::bar("planning");
    let plan = plan_touches(&robot, &cell, &options, &mut |f| progress::at(&bar, f, ""))?;
    bar.finish_and_clear();
    write_whole(&args.out, write_plan(&robot, &plan.entries).as_bytes())?;
    let pool = cell.balls.len() * options.pool_per_ball;
    let rejected = rejected(&plan);
    if args.json {
        let value = json!({ "touches": plan.entries.len(), "pool": pool, "rejected": rejected });
        return say(serde_json::to_string_pretty(&value)?);
    }
    say(format!("{} touches of {} balls, chosen from {pool}", plan.entries.len(), cell.balls.len()))?;
    for (reason, n) in &rejected {
        say(format!("  {n:>6} candidates dropped: {reason}"))?;
    }
    say(format!("Wrote {}", args.out.display()))
}

/// Why candidates were dropped, counted over all balls.
pub fn rejected(plan: &Plan) -> BTreeMap<String, usize> {
    let mut all = Rejected::default();
    plan.rejected.iter().for_each(|r| all.add(r));
    all.reasons().into_iter().map(|(reason, n)| (reason.to_owned(), n)).collect()
}

impl From<trical_plan::PlanError> for CliError {
    fn from(e: trical_plan::PlanError) -> Self {
        match e {
            trical_plan::PlanError::NoWay { .. } | trical_plan::PlanError::TooFewPoses { .. } => {
                Self::Failed(e.to_string())
            }
            _ => Self::Input(e.to_string()),
        }
    }
}
