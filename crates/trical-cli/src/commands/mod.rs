//! One file a command.

use std::path::PathBuf;

use trical_ident::AngleSummary;
use trical_ident::fit::cautions::listed;

use crate::error::Result;
use crate::say;

pub mod compare;
pub mod compensate;
pub mod completions;
pub mod convert;
pub mod demo;
pub mod demo_report;
pub mod diagnose;
pub mod effects;
pub mod export;
pub mod gauge;
pub mod guided;
pub mod history;
pub mod identify;
pub mod init;
pub mod measure;
pub mod plan;
pub mod record;
pub mod repeatability;
pub mod robot;
pub mod sample;
pub mod study;
pub mod validate;
pub mod virtual_cell;

/// Says which files were written, if any.
fn wrote<const N: usize>(files: [&Option<PathBuf>; N]) -> Result<()> {
    let names: Vec<String> = files.into_iter().flatten().map(|f| f.display().to_string()).collect();
    if names.is_empty() { Ok(()) } else { say(format!("\nWrote {}", listed(&names, "and"))) }
}

/// A table of errors of orientation, where full poses were measured.
fn orientation_rows(both: Option<[AngleSummary; 2]>, names: [&str; 2]) -> Vec<Vec<String>> {
    let Some(both) = both else { return Vec::new() };
    let head = ["orientation error, deg", "mean", "max", "rms"].map(String::from).to_vec();
    let row = |(name, e): (&str, AngleSummary)| {
        std::iter::once(name.to_owned())
            .chain([e.mean_deg, e.max_deg, e.rms_deg].map(|deg| format!("{deg:.4}")))
            .collect()
    };
    std::iter::once(head).chain(names.into_iter().zip(both).map(row)).collect()
}
