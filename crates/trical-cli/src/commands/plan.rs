//! `trical plan`: collision-free, informative touches.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde_json::json;
use trical_device::PlanEntry;
use trical_ident::{Choice, Dataset, JointSource, ParameterSet, write_whole};
use trical_model::{Cell, Joints, MAX_JOINTS, Measured, Model, Recording, Robot, Row, State};
use trical_plan::{Plan, PlanOptions, plan_touches};

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

/// The plan as entries for the procedure.
pub fn entries(plan: &Plan) -> Vec<PlanEntry> {
    plan.touches
        .iter()
        .zip(0..)
        .map(|(t, index)| PlanEntry { index, ball: t.ball, joints: t.joints, via: t.via.clone() })
        .collect()
}

/// The text of `plan.csv`: one row a joint position, in order; `kind` is `via` or `touch`.
pub fn to_csv(entries: &[PlanEntry], dof: usize) -> String {
    let names: Vec<String> = (1..=dof).map(|k| format!("q{k}_deg")).collect();
    let mut out = format!("order,ball,kind,{}\n", names.join(","));
    for e in entries {
        let rows = e.via.iter().map(|q| ("via", q)).chain(std::iter::once(("touch", &e.joints)));
        for (kind, q) in rows {
            let angles: Vec<String> = q[..dof].iter().map(|v| format!("{:.6}", v.to_degrees())).collect();
            let _ = writeln!(out, "{},{},{kind},{}", e.index + 1, e.ball + 1, angles.join(","));
        }
    }
    out
}

/// Reads `plan.csv`.
pub fn load(path: &Path, dof: usize) -> Result<Vec<PlanEntry>> {
    let text = trical_model::error::read_text(path)?;
    let name = path.display();
    let bad = |line: usize, problem: String| CliError::Input(format!("{name}, line {line}: {problem}"));
    let mut lines = text.lines().enumerate().map(|(k, l)| (k + 1, l.trim())).filter(|(_, l)| !l.is_empty());
    let names: Vec<String> = (1..=dof).map(|k| format!("q{k}_deg")).collect();
    let header = format!("order,ball,kind,{}", names.join(","));
    match lines.next() {
        Some((_, h)) if h == header => {}
        Some((line, h)) => return Err(bad(line, format!("found the header '{h}', expected '{header}'"))),
        None => return Err(bad(1, "is empty; expected a plan as trical plan writes it".into())),
    }
    let mut entries: Vec<PlanEntry> = Vec::new();
    let mut via: Vec<Joints> = Vec::new();
    for (line, text) in lines {
        let fields: Vec<&str> = text.split(',').map(str::trim).collect();
        if fields.len() != dof + 3 {
            return Err(bad(line, format!("found {} fields, expected {}", fields.len(), dof + 3)));
        }
        let count = |k: usize, what: &str| {
            fields[k].parse::<u64>().ok().filter(|v| *v > 0).ok_or_else(|| {
                bad(line, format!("column {what}: found '{}', expected a number counted from 1", fields[k]))
            })
        };
        let (order, ball) = (count(0, "order")?, count(1, "ball")?);
        let mut q = [0.0; MAX_JOINTS];
        for (k, (q, field)) in q.iter_mut().zip(&fields[3..]).enumerate() {
            *q = field.parse::<f64>().ok().filter(|v| v.is_finite()).map(f64::to_radians).ok_or_else(|| {
                bad(line, format!("column q{}_deg: found '{field}', expected a finite number", k + 1))
            })?;
        }
        match fields[2] {
            "via" => via.push(q),
            "touch" => entries.push(PlanEntry {
                index: order - 1,
                ball: usize::try_from(ball - 1).unwrap_or(usize::MAX),
                joints: q,
                via: std::mem::take(&mut via),
            }),
            other => return Err(bad(line, format!("column kind: found '{other}', expected via or touch"))),
        }
    }
    Ok(entries)
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    input::check_output(&args.out)?;
    let (robot, cell) = args.cell.load()?;
    let model = model_to_identify(&robot, &cell)?;
    let options = PlanOptions {
        per_ball: args.per_ball,
        pool: args.pool.max(args.per_ball),
        seed: args.seed,
        ..PlanOptions::default()
    };
    let bar = progress::bar("planning");
    let plan = plan_touches(&model, &options, &mut |f| progress::at(&bar, f, ""))?;
    bar.finish_and_clear();
    let entries = entries(&plan);
    write_whole(&args.out, to_csv(&entries, robot.dof()).as_bytes())?;
    let rejected: serde_json::Map<String, serde_json::Value> =
        plan.rejected.iter().map(|(r, n)| (r.clone(), json!(n))).collect();
    if args.json {
        let value = json!({ "touches": entries.len(), "pool": plan.pool, "rejected": rejected });
        return say(serde_json::to_string_pretty(&value)?);
    }
    say(format!("{} touches of {} balls, chosen from {}", entries.len(), cell.balls.len(), plan.pool))?;
    for (reason, n) in &plan.rejected {
        say(format!("  {n:>6} candidates dropped: {reason}"))?;
    }
    say(format!("Wrote {}", args.out.display()))
}

impl From<trical_plan::PlanError> for CliError {
    fn from(e: trical_plan::PlanError) -> Self {
        match e {
            trical_plan::PlanError::TooFew { .. } => Self::Failed(e.to_string()),
            _ => Self::Input(e.to_string()),
        }
    }
}
