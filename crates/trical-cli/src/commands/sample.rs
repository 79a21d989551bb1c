//! `trical sample`: a robot, a cell and a recording to try the program on.

use crate::commands::init::{Args, written};
use crate::error::Result;
use crate::say;

/// What is written: name, text, what it is. Drawn by the virtual cell, `trical demo --seed 7 --conceal lost_motion_direction@2*1.5`.
pub const FILES: [(&str, &str, &str); 3] = [
    ("robot.toml", include_str!("../../assets/irb120/robot.toml"), "an ABB IRB 120, as its maker describes it"),
    (
        "cell.toml",
        include_str!("../../assets/irb120/cell.toml"),
        "where it stands, its tool with three indicators, three balls",
    ),
    (
        "touches.csv",
        include_str!("../../assets/sample.csv"),
        "90 touches by an arm that differs, and has one flaw more",
    ),
];

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    written(&args.folder, &FILES, args.json)?;
    if args.json { Ok(()) } else { say("Then: trical diagnose touches.csv --robot robot.toml --cell cell.toml") }
}
