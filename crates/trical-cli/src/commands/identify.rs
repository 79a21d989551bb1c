//! `trical identify`: parameters with uncertainties.

use std::path::PathBuf;

use clap::ValueEnum;
use serde_json::json;
use trical_ident::{
    Dataset, ErrorSummary, Identified, KnownParameters, ModelFile, ParameterSet, Rejected, Streamed, cautions, clean,
    cross_validate, forward_in_time, identify, identify_stream, shown, write_whole,
};
use trical_model::{Cell, Recording, Robot};
use trical_report::{identify_report, table};

use crate::error::{CliError, Result};
use crate::input::{self, Joints, RobotAndCell};
use crate::say;

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
    /// What is known beforehand: a TOML file of [[parameter]] tables with name and value and sd (a prior), min, max
    #[arg(long, value_name = "FILE", conflicts_with = "stream")]
    known: Option<PathBuf>,
    /// Also score every pose by a fit without it, in K folds
    #[arg(long, value_name = "K")]
    cross_validate: Option<usize>,
    /// Also score the last PERCENT of each recording's poses by a fit to those before: forward in time
    #[arg(long, value_name = "PERCENT")]
    hold_out_last: Option<usize>,
    /// Keep gross errors instead of rejecting them
    #[arg(long)]
    keep_outliers: bool,
    /// Read recordings in passes, in memory that does not grow with their rows; by itself for a CSV above 32 MB
    #[arg(long, conflicts_with_all = ["cross_validate", "hold_out_last"])]
    stream: bool,
    /// A report to read, print and sign, one HTML file
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// Cleans and chooses the joints.
fn prepare(args: &Args, robot: &Robot, cell: &Cell, recordings: &[Recording]) -> Result<Dataset> {
    let set = ParameterSet::from(args.model);
    Ok(clean(robot, cell, recordings, args.joints.source(), set, args.keep_outliers)?)
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    for file in [&args.out, &args.report].into_iter().flatten() {
        input::check_output(file)?;
    }
    let (robot, cell) = args.cell.load()?;
    let set = ParameterSet::from(args.model);
    if set >= ParameterSet::Compliance {
        robot.require_masses()?;
    }
    let known = args.known.as_deref().map(KnownParameters::load).transpose()?.unwrap_or_default();
    let options = trical_ident::Choice::new(set, &args.compliant, robot.dof())?.knowing(known);
    let all_at_once = args.cross_validate.is_some() || args.hold_out_last.is_some() || args.known.is_some();
    let found = match input::passes(&args.recordings, robot.dof(), args.stream, !all_at_once)? {
        Some(stream) => {
            let sample = stream.sample()?;
            let data = prepare(args, &robot, &cell, &sample.recordings)?;
            let streamed = identify_stream(&robot, &cell, &stream, &data, options, args.keep_outliers)?;
            Found::of_stream(streamed)
        }
        None => {
            let recordings = input::recordings(&args.recordings, robot.dof())?;
            let data = prepare(args, &robot, &cell, &recordings)?;
            let fitted = identify(&robot, &cell, &data, options.clone())?;
            let nominal = identify(&robot, &cell, &data, ParameterSet::Nominal)?;
            let later = args
                .hold_out_last
                .map(|k| forward_in_time(&robot, &cell, &data, options.clone(), k).map(|e| ErrorSummary::of(&e)))
                .transpose()?;
            let held_out = args
                .cross_validate
                .map(|k| cross_validate(&robot, &cell, &data, options, k).map(|e| ErrorSummary::of(&e)))
                .transpose()?;
            Found {
                errors: ErrorSummary::of(&fitted.errors()?),
                before: ErrorSummary::of(&nominal.errors()?),
                held_out,
                later,
                observations: data.observations.len(),
                places: format!("{} measurements at {} poses", data.observations.len(), data.used_poses().len()),
                rejected: data.rejected.len(),
                named: data.rejected,
                passes: None,
                fitted,
            }
        }
    };
    if let Some(out) = &args.out {
        let data = &found.fitted.data;
        ModelFile {
            model: found.fitted.model.clone(),
            joints: data.joints,
            references: data.references.clone(),
            recordings: data.names.clone(),
        }
        .save(out)?;
    }
    if let Some(path) = &args.report {
        write_whole(path, report(args, &robot, &cell, &found)?.as_bytes())?;
    }
    if args.json {
        return say(serde_json::to_string_pretty(&summary(&found, args)?)?);
    }
    print(args, &found)
}

/// What was identified, in memory or in passes.
struct Found {
    fitted: Identified,
    errors: ErrorSummary,
    before: ErrorSummary,
    held_out: Option<ErrorSummary>,
    /// Of the last poses, by a fit to those before.
    later: Option<ErrorSummary>,
    observations: usize,
    /// "45 measurements at 45 poses".
    places: String,
    rejected: usize,
    /// Those of the rejected rows that are named.
    named: Vec<Rejected>,
    /// Passes over the files, where they were not read at once.
    passes: Option<usize>,
}

impl Found {
    fn of_stream(s: Streamed) -> Self {
        Self {
            errors: s.errors,
            before: s.before,
            held_out: None,
            later: None,
            observations: s.observations,
            places: format!("{} measurements, read in {} passes,", s.observations, s.passes + 1),
            rejected: s.rejected,
            named: s.named,
            passes: Some(s.passes + 1),
            fitted: s.identified,
        }
    }
}

fn report(args: &Args, robot: &Robot, cell: &Cell, found: &Found) -> Result<String> {
    let fitted = &found.fitted;
    // of what is drawn: all rows, or the sample of a stream
    let each_before = identify(robot, cell, &fitted.data, ParameterSet::Nominal)?.errors()?;
    let folds = args.cross_validate.map(identify_report::of_folds);
    let last = args.hold_out_last.map(identify_report::of_last);
    let unseen = folds.zip(found.held_out.as_ref()).into_iter().chain(last.zip(found.later.as_ref())).collect();
    let told = identify_report::Told {
        fitted,
        each_before: &each_before,
        before: &found.before,
        after: &found.errors,
        unseen,
        observations: found.observations,
        named: &found.named,
        rejected: found.rejected,
        cleaned: !args.keep_outliers,
    };
    let made = input::made(&input::files(&args.recordings, &args.cell, args.known.as_deref()));
    Ok(identify_report::render(&told, made)?)
}

fn summary(found: &Found, args: &Args) -> Result<serde_json::Value> {
    let Found { fitted, errors, before, .. } = found;
    let parameters: Vec<_> = fitted.free.iter().map(|k| shown(&fitted.model, &fitted.model.terms[*k])).collect();
    let not_identifiable: Vec<Vec<String>> = fitted
        .dependent
        .iter()
        .map(|d| std::iter::once(d.name.clone()).chain(d.with.iter().cloned()).collect())
        .collect();
    let cautions = cautions(&fitted.model, fitted.observability.rows, fitted.free.len());
    let mut out = json!({
        "cautions": cautions,
        "recordings": fitted.data.names,
        "joints": fitted.data.joints,
        "observations": found.observations,
        "outliers": found.named.iter().map(|r| r.row).collect::<Vec<_>>(),
        "rejected": found.named,
        "parameters": parameters,
        "not_identifiable": not_identifiable,
        "correlated": fitted.correlated(0.9),
        "at_limit": fitted.stopped(),
        "observability": fitted.observability,
        "fit": fitted.report,
        "rms_mm": errors.rms_mm,
        "max_mm": errors.max_mm,
        "mean_mm": errors.mean_mm,
        "rms_nominal_mm": before.rms_mm,
        "max_nominal_mm": before.max_mm,
        "mean_nominal_mm": before.mean_mm,
    });
    if let (Some(passes), Some(map)) = (found.passes, out.as_object_mut()) {
        map.insert("passes".into(), json!(passes));
        map.insert("rejected_rows".into(), json!(found.rejected));
    }
    if let (Some((percent, later)), Some(map)) = (args.hold_out_last.zip(found.later.as_ref()), out.as_object_mut()) {
        let mut entry = serde_json::to_value(later)?;
        if let Some(e) = entry.as_object_mut() {
            e.insert("last_percent".into(), json!(percent));
        }
        map.insert("forward_in_time".into(), entry);
    }
    if let (Some((folds, held_out)), Some(map)) =
        (args.cross_validate.zip(found.held_out.as_ref()), out.as_object_mut())
    {
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

fn print(args: &Args, found: &Found) -> Result<()> {
    let fitted = &found.fitted;
    let data = &fitted.data;
    say(format!("{} from {}; {} rows rejected", found.places, data.names.join(", "), found.rejected))?;
    for line in rejected_lines(&found.named, found.rejected, 12) {
        say(line)?;
    }
    say(format!("\n{} parameters, joints as {:?}:", fitted.free.len(), data.joints).to_lowercase())?;
    for line in table::lines(&parameter_rows(fitted)) {
        say(line)?;
    }
    let stopped = fitted.stopped();
    if !stopped.is_empty() {
        say(format!("\nStopped by a limit of --known, which the data would pass: {}", stopped.join(", ")))?;
    }
    let dropped = fitted.left_out();
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
    add("nominal arm", &found.before);
    add("identified", &found.errors);
    if let (Some(k), Some(e)) = (args.cross_validate, &found.held_out) {
        add(&format!("identified, poses not used in the fit ({k} folds)"), e);
    }
    if let (Some(percent), Some(e)) = (args.hold_out_last, &found.later) {
        add(&format!("last {percent} % of the poses, by a fit to those before"), e);
    }
    for caution in cautions(&fitted.model, fitted.observability.rows, fitted.free.len()) {
        for line in table::wrapped(&format!("Caution: {caution}"), 108, "") {
            say(line)?;
        }
    }
    say("")?;
    for line in table::lines(&rows) {
        say(line)?;
    }
    let written: Vec<String> =
        [&args.out, &args.report].into_iter().flatten().map(|f| f.display().to_string()).collect();
    if written.is_empty() { Ok(()) } else { say(format!("\nWrote {}", written.join(" and "))) }
}

/// What was rejected, reason by reason, at most a dozen lines; `named` may be the first of `all`.
pub fn rejected_lines(named: &[Rejected], all: usize, most: usize) -> Vec<String> {
    let mut lines: Vec<String> =
        named.iter().take(most).map(|r| format!("  {}, line {}: {}", r.recording, r.line, r.reason)).collect();
    if all > most {
        lines.push(format!("  and {} more (see --json)", all - most));
    }
    lines
}

impl From<trical_ident::ChoiceError> for CliError {
    fn from(e: trical_ident::ChoiceError) -> Self {
        Self::Input(e.to_string())
    }
}
