//! One file a command.

use std::path::PathBuf;

use trical_ident::caution::listed;

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
