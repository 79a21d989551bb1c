//! `trical identify`: parameters with uncertainties.

use std::path::PathBuf;

use clap::ValueEnum;
use serde_json::json;
use trical_ident::{
    Dataset, ErrorSummary, Identified, JointSource, ModelFile, ParameterSet, cross_validate, identify,
    reject_gross_errors, shown,
};
use trical_model::{Cell, Recording, Robot};

use crate::error::{CliError, Result};
use crate::input::{self, Joints, RobotAndCell};
use crate::{say, table};

/// Which parameters to identify.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Set {
    /// The nominal arm: measuring frame (or base) and tool points only
    Nominal,
    /// And the geometry (17 parameters on a 6-joint arm)
    Geometry,
    /// And the compliance of the joints that carry gravity: the paper's 31 parameters
    Compliance,
    /// And the twist of near-parallel axes, which the paper's list lacks
    Complete,
}

impl From<Set> for ParameterSet {
    fn from(s: Set) -> Self {
        match s {
            Set::Nominal => Self::Nominal,
            Set::Geometry => Self::Geometry,
            Set::Compliance => Self::Compliance,
            Set::Complete => Self::Complete,
        }
    }
}

/// Arguments of `trical identify`.
#[derive(clap::Args)]
pub struct Args {
    /// Recordings of one arm (CSV or MCAP)
    #[arg(required = true, value_name = "REC")]
    recordings: Vec<PathBuf>,
    #[command(flatten)]
    cell: RobotAndCell,
    /// Where to write the model
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Which joint angles to believe
    #[arg(long, value_enum, default_value = "read")]
    joints: Joints,
    /// Which parameters to identify
    #[arg(long, value_enum, default_value = "compliance")]
    model: Set,
    /// Compliance of these joints only, e.g. 2,3,4,5
    #[arg(long, value_delimiter = ',', value_name = "JOINTS")]
    compliant: Vec<usize>,
    /// Also score every pose by a fit without it, in K folds
    #[arg(long, value_name = "K")]
    cross_validate: Option<usize>,
    /// Keep gross errors instead of rejecting them
    #[arg(long)]
    keep_outliers: bool,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// Reads, cleans and chooses the joints.
fn prepare(args: &Args, robot: &Robot, cell: &Cell, recordings: &[Recording]) -> Result<Dataset> {
    let clean = |source| -> Result<Dataset> {
        let data = input::dataset(recordings, source, None)?;
        if args.keep_outliers { Ok(data) } else { Ok(reject_gross_errors(robot, cell, &data)?) }
    };
    match args.joints {
        Joints::Read => clean(JointSource::Read),
        Joints::Commanded => clean(JointSource::Commanded),
        Joints::Auto => {
            let commanded = recordings.iter().all(|r| r.rows.iter().all(|r| r.state.q_commanded.is_some()));
            if !commanded {
                return clean(JointSource::Read);
            }
            let score = |data: &Dataset| -> Result<f64> {
                let errors = identify(robot, cell, data, ParameterSet::from(args.model))?.errors()?;
                Ok(trical_ident::rigid::median(&errors))
            };
            let (read, commanded) = (clean(JointSource::Read)?, clean(JointSource::Commanded)?);
            Ok(if score(&commanded)? < score(&read)? { commanded } else { read })
        }
    }
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    if let Some(out) = &args.out {
        input::check_output(out)?;
    }
    let (robot, cell) = args.cell.load()?;
    let set = ParameterSet::from(args.model);
    if set >= ParameterSet::Compliance {
        robot.require_masses()?;
    }
    let options = trical_ident::Choice::new(set, &args.compliant, robot.dof())?;
    let recordings = input::recordings(&args.recordings, robot.dof())?;
    let data = prepare(args, &robot, &cell, &recordings)?;
    let fitted = identify(&robot, &cell, &data, options.clone())?;
    let nominal = identify(&robot, &cell, &data, ParameterSet::Nominal)?;
    let errors = ErrorSummary::of(&fitted.errors()?);
    let before = ErrorSummary::of(&nominal.errors()?);
    let held_out = args
        .cross_validate
        .map(|k| cross_validate(&robot, &cell, &data, options, k).map(|e| ErrorSummary::of(&e)))
        .transpose()?;
    if let Some(out) = &args.out {
        ModelFile {
            model: fitted.model.clone(),
            joints: data.joints,
            references: data.references.clone(),
            recordings: data.names.clone(),
        }
        .save(out)?;
    }
    if args.json {
        let summary = summary(&fitted, &errors, &before, args.cross_validate.zip(held_out.as_ref()))?;
        return say(serde_json::to_string_pretty(&summary)?);
    }
    print(args, &fitted, &errors, &before, held_out.as_ref())
}

fn summary(
    fitted: &Identified,
    errors: &ErrorSummary,
    before: &ErrorSummary,
    held_out: Option<(usize, &ErrorSummary)>,
) -> Result<serde_json::Value> {
    let parameters: Vec<_> = fitted.free.iter().map(|k| shown(&fitted.model, &fitted.model.terms[*k])).collect();
    let not_identifiable: Vec<Vec<String>> = fitted
        .dependent
        .iter()
        .map(|d| std::iter::once(d.name.clone()).chain(d.with.iter().cloned()).collect())
        .collect();
    let mut out = json!({
        "recordings": fitted.data.names,
        "joints": fitted.data.joints,
        "observations": fitted.data.observations.len(),
        "outliers": fitted.data.rejected.iter().map(|r| r.row).collect::<Vec<_>>(),
        "rejected": fitted.data.rejected,
        "parameters": parameters,
        "not_identifiable": not_identifiable,
        "correlated": fitted.correlated(0.9),
        "observability": fitted.observability,
        "fit": fitted.report,
        "rms_mm": errors.rms_mm,
        "max_mm": errors.max_mm,
        "mean_mm": errors.mean_mm,
        "rms_nominal_mm": before.rms_mm,
        "max_nominal_mm": before.max_mm,
        "mean_nominal_mm": before.mean_mm,
    });
    if let (Some((folds, held_out)), Some(map)) = (held_out, out.as_object_mut()) {
        let mut entry = serde_json::to_value(held_out)?;
        if let Some(e) = entry.as_object_mut() {
            e.insert("folds".into(), json!(folds));
        }
        map.insert("cross_validation".into(), entry);
    }
    Ok(out)
}

/// Rows of a table of parameters beside nominal.
pub fn parameter_rows(fitted: &Identified) -> Vec<Vec<String>> {
    let mut rows = vec![vec!["parameter".into(), "nominal".into(), "identified".into(), "sd".into(), "unit".into()]];
    for k in &fitted.free {
        let s = shown(&fitted.model, &fitted.model.terms[*k]);
        let d = table::decimals_for(s.sd.unwrap_or(f64::NAN));
        rows.push(vec![
            s.name,
            s.nominal.map_or_else(|| "-".into(), |n| format!("{n:.3}")),
            format!("{:.d$}", s.value),
            s.sd.map_or_else(|| "-".into(), |v| format!("{v:.d$}")),
            s.unit,
        ]);
    }
    rows
}

fn print(
    args: &Args,
    fitted: &Identified,
    errors: &ErrorSummary,
    before: &ErrorSummary,
    held_out: Option<&ErrorSummary>,
) -> Result<()> {
    let data = &fitted.data;
    say(format!(
        "{} measurements at {} poses from {}; {} rows rejected",
        data.observations.len(),
        data.used_poses().len(),
        data.names.join(", "),
        data.rejected.len()
    ))?;
    for line in rejected_lines(data) {
        say(line)?;
    }
    say(format!("\n{} parameters, joints as {:?}:", fitted.free.len(), data.joints).to_lowercase())?;
    for line in table::lines(&parameter_rows(fitted)) {
        say(line)?;
    }
    let dropped: Vec<String> = fitted
        .dependent
        .iter()
        .filter(|d| !d.with.is_empty())
        .map(|d| format!("{} (moves together with {})", d.name, d.with.join(", ")))
        .collect();
    if !dropped.is_empty() {
        say(format!("\nNot identified, since others do the same: {}", dropped.join("; ")))?;
    }
    let mut rows = vec![vec!["position error, mm".into(), "mean".into(), "rms".into(), "max".into()]];
    let mut add = |name: &str, e: &ErrorSummary| {
        rows.push(vec![
            name.into(),
            format!("{:.3}", e.mean_mm),
            format!("{:.3}", e.rms_mm),
            format!("{:.3}", e.max_mm),
        ]);
    };
    add("nominal arm", before);
    add("identified", errors);
    if let (Some(k), Some(e)) = (args.cross_validate, held_out) {
        add(&format!("identified, poses not used in the fit ({k} folds)"), e);
    }
    say("")?;
    for line in table::lines(&rows) {
        say(line)?;
    }
    match &args.out {
        Some(out) => say(format!("\nWrote {}", out.display())),
        None => Ok(()),
    }
}

/// What was rejected, reason by reason, at most a dozen lines.
pub fn rejected_lines(data: &Dataset) -> Vec<String> {
    let mut lines: Vec<String> =
        data.rejected.iter().take(12).map(|r| format!("  {}, line {}: {}", r.recording, r.line, r.reason)).collect();
    if data.rejected.len() > 12 {
        lines.push(format!("  and {} more (see --json)", data.rejected.len() - 12));
    }
    lines
}

impl From<trical_ident::ChoiceError> for CliError {
    fn from(e: trical_ident::ChoiceError) -> Self {
        Self::Input(e.to_string())
    }
}
