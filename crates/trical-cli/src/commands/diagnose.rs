//! `trical diagnose`: locate the mismatch, name the physics left out, model it, prove it.

use std::path::PathBuf;

use trical_ident::{Diagnosis, JointSource, ModelFile, diagnose};

use crate::error::Result;
use crate::input::{self, Joints, RobotAndCell};
use crate::say;

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
    /// Where to write the extended model
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Where to write the report
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    for file in [&args.out, &args.report].into_iter().flatten() {
        input::check_output(file)?;
    }
    let (robot, cell) = args.cell.load()?;
    let recordings = input::recordings(&args.recordings, robot.dof())?;
    let bar = crate::progress::bar("diagnosing");
    let mut progress = |fraction: f64, what: &str| crate::progress::at(&bar, fraction, what);
    let mut one = |source| -> Result<(Diagnosis, JointSource)> {
        let data = input::dataset(&recordings, source, None)?;
        Ok((diagnose(&robot, &cell, &data, &mut progress)?, source))
    };
    let (diagnosis, source) = match args.joints {
        Joints::Read => one(JointSource::Read)?,
        Joints::Commanded => one(JointSource::Commanded)?,
        Joints::Auto => {
            let read = one(JointSource::Read)?;
            let all = recordings.iter().all(|r| r.rows.iter().all(|r| r.state.q_commanded.is_some()));
            if all {
                let commanded = one(JointSource::Commanded)?;
                if commanded.0.after.holdout_rms_mm < read.0.after.holdout_rms_mm { commanded } else { read }
            } else {
                read
            }
        }
    };
    bar.finish_and_clear();
    if let Some(out) = &args.out {
        ModelFile {
            model: diagnosis.model.clone(),
            joints: source,
            references: diagnosis.data.references.clone(),
            recordings: diagnosis.data.names.clone(),
        }
        .save(out)?;
    }
    if let Some(report) = &args.report {
        let html = crate::report::diagnosis(&diagnosis, source)?;
        trical_ident::write_whole(report, html.as_bytes())?;
    }
    if args.json {
        let mut value = serde_json::to_value(&diagnosis)?;
        if let Some(map) = value.as_object_mut() {
            map.insert("recordings".into(), serde_json::to_value(&diagnosis.data.names)?);
            map.insert("joints".into(), serde_json::to_value(source)?);
        }
        return say(serde_json::to_string_pretty(&value)?);
    }
    print(&diagnosis)
}

/// A site in words: "joint 3".
pub fn site_words(site: &serde_json::Value) -> String {
    let Some(map) = site.as_object() else { return String::new() };
    map.iter()
        .map(|(k, v)| match v {
            serde_json::Value::Bool(_) => k.clone(),
            serde_json::Value::String(s) => format!("{k} {s}"),
            other => format!("{k} {other}"),
        })
        .collect::<Vec<_>>()
        .join(" ")
}

fn print(d: &Diagnosis) -> Result<()> {
    say(format!(
        "{} measurements, {} rows not believed. {} parameters leave {:.4} mm (held out {:.4}).",
        d.data.observations.len(),
        d.rejected.len(),
        d.baseline.parameters,
        d.baseline.rms_mm,
        d.baseline.holdout_rms_mm
    ))?;
    if d.findings.is_empty() && d.unexplained.is_none() {
        say("The model explains the data: nothing is asked for that would earn its place.")?;
    }
    for f in &d.findings {
        let values: Vec<String> =
            f.coefficients.iter().map(|c| format!("{} = {:.3e} {}", c.name, c.value, c.unit)).collect();
        say(format!(
            "  {} at {} ({:.0} % sure, lambda {:.1}): {}; {}; held out {:.4} -> {:.4} mm{}",
            f.effect,
            site_words(&f.site),
            f.confidence * 100.0,
            f.lambda,
            f.located,
            values.join(", "),
            f.evidence.holdout_rms_before_mm,
            f.evidence.holdout_rms_after_mm,
            if f.rivals.is_empty() {
                String::new()
            } else {
                format!(
                    "; could also be {}",
                    f.rivals
                        .iter()
                        .map(|r| format!("{} at {}", r.effect, site_words(&r.site)))
                        .collect::<Vec<_>>()
                        .join(", ")
                )
            }
        ))?;
    }
    for u in d.unexplained.iter().chain(&d.more_unexplained) {
        say(format!(
            "  no name: {} is off for {} ({:.4} mm; held out {:.4} -> {:.4} mm)",
            site_words(&u.site),
            u.region,
            u.rms_mm,
            u.holdout_rms_before_mm,
            u.holdout_rms_after_mm
        ))?;
    }
    say(format!(
        "With all of it {} parameters leave {:.4} mm; held out {:.4} mm rms, {:.4} mean; last quarter of the poses {:.4} mean.",
        d.after.parameters, d.after.rms_mm, d.after.holdout_rms_mm, d.after.holdout_mean_mm, d.after.forward_mean_mm
    ))?;
    let mut blind: Vec<String> = Vec::new();
    for b in &d.blind_to {
        if !blind.contains(&b.effect) {
            blind.push(b.effect.clone());
        }
    }
    if !blind.is_empty() {
        say(format!("This data could not show, at some sites at least: {}.", blind.join(", ")))?;
    }
    Ok(())
}
