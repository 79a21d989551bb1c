//! `trical diagnose`: locate the mismatch, name the physics left out, model it, prove it.

use std::path::PathBuf;

use serde_json::json;
use trical_diagnose::{Diagnosis, Finding, Options, Rival, Undecided, diagnose_recordings, verdict};
use trical_ident::{JointSource, ModelFile, write_whole};
use trical_plan::{Next, write_plan};
use trical_report::deciding::plan_next;
use trical_report::{diagnosis_report, table};

use crate::error::{CliError, Result};
use crate::input::{self, Joints, RobotAndCell, Tool};
use crate::{progress, say};

/// So many findings are told in full on the terminal.
const IN_FULL: usize = 8;

/// A finding that takes less of what can be explained is small.
const SMALL_SHARE: f64 = 0.01;

/// So many mismatches without a name are told.
const NAMELESS: usize = 3;

/// Touches that set explanations apart by less than this many standard deviations decide nothing.
const TELLING: f64 = 1.0;

/// Arguments of `trical diagnose`.
#[derive(clap::Args)]
pub struct Args {
    /// Recordings of one arm (CSV or MCAP)
    #[arg(required = true, value_name = "REC")]
    recordings: Vec<PathBuf>,
    #[command(flatten)]
    cell: RobotAndCell,
    /// Which joint angles to believe
    #[arg(long, value_enum, default_value = "read")]
    joints: Joints,
    /// Model what has a name alone: what has none is told, but not corrected
    #[arg(long)]
    names_only: bool,
    #[command(flatten)]
    tool: Tool,
    /// Where to write the extended model
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Where to write the report
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Plan this many touches that decide between the least sure finding and its rivals
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1000))]
    next: Option<u16>,
    /// Where to write the touches of --next
    #[arg(long, value_name = "FILE", default_value = "next.csv")]
    next_out: PathBuf,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    for file in [&args.out, &args.report].into_iter().flatten().chain(args.next.map(|_| &args.next_out)) {
        input::check_output(file, args.recordings.iter().map(PathBuf::as_path).chain(args.cell.files()))?;
    }
    let (robot, cell) = args.cell.load()?;
    if args.next.is_some() && cell.balls.is_empty() {
        return Err(CliError::Input("--next: found no [balls] in the cell, expected balls that can be touched".into()));
    }
    let recordings = input::recordings(&args.recordings, robot.dof())?;
    let (diagnosis, source) = progress::with_bar("diagnosing", |task| {
        let options = Options { joints: args.joints.source(), names_only: args.names_only, tool: args.tool.sharing() };
        diagnose_recordings(&robot, &cell, &recordings, &options, task)
    })?;
    // rivals are fitted anew only for those who ask
    let undecided = args.next.map(|_| diagnosis.undecided()).transpose()?.flatten();
    let next = match (args.next, undecided) {
        (Some(n), Some(undecided)) => {
            let count = usize::from(n);
            let planned = progress::with_bar("deciding", |task| plan_next(&robot, &cell, &undecided, count, task))?;
            Some((undecided, planned))
        }
        _ => None,
    };
    if let Some(out) = &args.out {
        ModelFile::of(diagnosis.model.clone(), &diagnosis.data).save(out)?;
    }
    if let Some(report) = &args.report {
        let made = input::made(&input::files(&args.recordings, &args.cell, None));
        write_whole(report, diagnosis_report::render(&diagnosis, source, made)?.as_bytes())?;
    }
    if let Some((_, next)) = next.as_ref().filter(|(_, next)| next.lambda >= TELLING) {
        write_whole(&args.next_out, write_plan(&robot, &next.entries).as_bytes())?;
    }
    if args.json {
        let mut value = serde_json::to_value(&diagnosis)?;
        if let Some(map) = value.as_object_mut() {
            map.insert("recordings".into(), serde_json::to_value(&diagnosis.data.names)?);
            map.insert("joints".into(), serde_json::to_value(source)?);
            if args.next.is_some() {
                map.insert(
                    "next".into(),
                    next.as_ref().map_or(serde_json::Value::Null, |(u, n)| next_json(args, u, n)),
                );
            }
        }
        return say(serde_json::to_string_pretty(&value)?);
    }
    for line in lines(&diagnosis) {
        say(line)?;
    }
    if args.joints == Joints::Auto {
        say(format!("The {} joints were believed: held out, they leave less.", source_words(source)))?;
    }
    if args.next.is_some() {
        for line in next_lines(args, next.as_ref()) {
            say(line)?;
        }
    }
    Ok(())
}

fn source_words(source: JointSource) -> &'static str {
    match source {
        JointSource::Read => "read",
        JointSource::Commanded => "commanded",
    }
}

fn next_json(args: &Args, undecided: &Undecided<'_>, next: &Next) -> serde_json::Value {
    json!({
        "effect": undecided.finding.effect,
        "site": undecided.finding.site,
        "explanations": undecided.names,
        "touches": next.entries.len(),
        "lambda": next.lambda,
        "random_lambda": next.random_lambda,
        "file": (next.lambda >= TELLING).then(|| args.next_out.display().to_string()),
    })
}

fn next_lines(args: &Args, next: Option<&(Undecided<'_>, Next)>) -> Vec<String> {
    let Some((undecided, next)) = next else {
        return vec!["Nothing is undecided: no further touches were planned.".into()];
    };
    if next.lambda < TELLING {
        let text = format!(
            "No {} touches that this arm can make here decide between {}: the best differ by {:.1} standard deviations. Nothing \
             was written; another load on the flange, or balls elsewhere, may help.",
            next.entries.len(),
            undecided.names.join(" and "),
            next.lambda
        );
        return table::wrapped(&text, 108, "");
    }
    let text = format!(
        "{} touches in {} would decide between {}: they set any two of them at least {:.1} standard deviations apart (as many \
         random touches: {:.1}){}. Measure them in the same cell, and diagnose both recordings together.",
        next.entries.len(),
        args.next_out.display(),
        undecided.names.join(" and "),
        next.lambda,
        next.random_lambda,
        if next.lambda < 3.0 { little(next) } else { String::new() }
    );
    table::wrapped(&text, 108, "")
}

/// Touches that hardly decide: how many would, each telling as much as these.
fn little(next: &Next) -> String {
    #[expect(clippy::cast_precision_loss, reason = "a count")]
    let enough = (next.entries.len() as f64 * (3.0 / next.lambda).powi(2)).ceil();
    format!("; for three, about {enough} would be needed")
}

/// Findings whose coefficients are told one by one; a curve has more.
const FEW_COEFFICIENTS: usize = 6;

/// One finding: what it is at the finest level that is sure, where, how large.
fn finding_lines(f: &Finding) -> Vec<String> {
    let head = format!("{} ({} at {}, lambda {:.1})", f.summary, f.effect, f.site, f.lambda);
    let mut out = table::wrapped(&head, 104, "    ");
    if let Some(first) = out.first_mut() {
        *first = format!("  {}", first.trim_start());
    }
    let values: Vec<String> = f.coefficients.iter().map(|c| table::number(&c.name, c.value, &c.unit)).collect();
    let size =
        if values.len() > FEW_COEFFICIENTS { format!("{} coefficients", values.len()) } else { values.join(", ") };
    out.extend(table::wrapped(&format!("{}; {size}", f.located), 104, "    "));
    if !f.rivals.is_empty() {
        let rivals: Vec<String> = f.rivals.iter().map(Rival::in_words).collect();
        out.extend(table::wrapped(&format!("could also be {}", rivals.join(", ")), 104, "    "));
    }
    out
}

/// What is small or not sure, by family in one line.
fn rest_line(rest: &[Finding]) -> Vec<String> {
    let mut families: Vec<(&str, Vec<String>)> = Vec::new();
    for f in rest {
        let name = verdict::family(f.family);
        let told = format!("{} at {} ({:.0} %)", f.effect, f.site, f.confidence * 100.0);
        match families.iter_mut().find(|g| g.0 == name) {
            Some(g) => g.1.push(told),
            None => families.push((name, vec![told])),
        }
    }
    families
        .iter()
        .flat_map(|(name, told)| table::wrapped(&format!("{name}: {}", told.join(", ")), 104, "    "))
        .collect()
}

fn lines(d: &Diagnosis) -> Vec<String> {
    let mut out = vec![format!(
        "{} measurements at {} poses, {} rows rejected. {} parameters leave {:.4} mm rms (at unseen poses {:.4}).",
        d.data.observations.len(),
        d.after.poses,
        d.rejected.len(),
        d.baseline.parameters,
        d.baseline.rms_mm,
        d.baseline.holdout_rms_mm
    )];
    out.extend(super::identify::rejected_lines(&d.rejected, d.rejected.len(), 3));
    if d.findings.is_empty() && d.unexplained.is_none() {
        out.push("The model explains the data: nothing found.".into());
    }
    // findings are in order of importance
    let told = d.findings.iter().take(IN_FULL).take_while(|f| f.share >= SMALL_SHARE || f.confidence >= 0.5).count();
    out.extend(d.findings[..told].iter().flat_map(finding_lines));
    if d.findings.len() > told {
        out.push(format!("  and {} smaller or less sure (all about them: --report, --json):", d.findings.len() - told));
        out.extend(rest_line(&d.findings[told..]));
    }
    let nameless: Vec<_> = d.unexplained.iter().chain(&d.more_unexplained).collect();
    for u in nameless.iter().take(NAMELESS) {
        out.push(format!(
            "  without a name: {} is off for {} ({:.4} mm; at unseen poses {:.4} -> {:.4} mm)",
            u.site, u.region, u.rms_mm, u.holdout_rms_before_mm, u.holdout_rms_after_mm
        ));
    }
    if nameless.len() > NAMELESS {
        out.push(format!("  and {} smaller ones without a name", nameless.len() - NAMELESS));
    }
    if !(d.findings.is_empty() && d.unexplained.is_none()) {
        let worst = d.after.held_out.worst().filter(|(how, _)| *how != "by block of poses");
        let worst = worst.map_or_else(String::new, |(how, e)| format!("; the worst, {how}, {:.4} mean", e.mean_mm));
        let text = format!(
            "With all of it {} parameters ({:.0} effective) leave {:.4} mm rms; at blocks of poses that the fit did not see {:.4} rms, \
             {:.4} mean{worst}.",
            d.after.parameters,
            d.after.effective_parameters,
            d.after.rms_mm,
            d.after.holdout_rms_mm,
            d.after.holdout_mean_mm,
        );
        out.extend(table::wrapped(&text, 108, ""));
    }
    out.extend(d.cautions.iter().flat_map(|c| table::wrapped(&format!("Caution: {c}"), 108, "")));
    let mut blind: Vec<&'static str> = Vec::new();
    for b in &d.blind_to {
        if !blind.contains(&b.effect.name()) {
            blind.push(b.effect.name());
        }
    }
    if !blind.is_empty() {
        let text = format!("This data could not show, at some sites at least: {}.", blind.join(", "));
        out.extend(table::wrapped(&text, 108, ""));
    }
    out
}
