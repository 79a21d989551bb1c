//! One file a command.

use std::path::PathBuf;

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
fn wrote(files: &[&Option<PathBuf>]) -> Result<()> {
    let names: Vec<String> = files.iter().copied().flatten().map(|f| f.display().to_string()).collect();
    if names.is_empty() { Ok(()) } else { say(format!("\nWrote {}", names.join(" and "))) }
}
