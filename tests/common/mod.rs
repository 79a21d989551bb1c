//! A folder for a test, and the program that runs in it.
#![allow(clippy::unwrap_used, clippy::expect_used, dead_code, missing_docs)]

use std::path::PathBuf;
use std::process::{Command, Output};

pub const ROBOT: &str = include_str!("../../cells/irb120/robot.toml");
pub const CELL: &str = include_str!("../../cells/irb120/cell.toml");
pub const CELL_ARGS: [&str; 4] = ["--robot", "robot.toml", "--cell", "cell.toml"];

pub struct Place(pub tempfile::TempDir);

impl Place {
    /// With an arm and its cell.
    pub fn new() -> Self {
        let p = Self(tempfile::tempdir().unwrap());
        p.write("robot.toml", ROBOT);
        p.write("cell.toml", CELL);
        p
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), bytes).unwrap();
    }

    pub fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap()
    }

    pub fn text(&self, name: &str) -> String {
        String::from_utf8(self.bytes(name)).unwrap()
    }

    pub fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_trical"));
        command.args(args).current_dir(self.0.path());
        command
    }

    pub fn run(&self, args: &[&str]) -> Output {
        self.command(args).output().unwrap()
    }

    /// As if these lines were typed. They come from a file: a program that refuses before it reads would break a pipe.
    pub fn typed(&self, args: &[&str], lines: &str) -> Output {
        self.write("typed", lines);
        self.command(args).stdin(std::fs::File::open(self.path("typed")).unwrap()).output().unwrap()
    }

    /// It ends well; what it prints.
    pub fn good(&self, args: &[&str]) -> String {
        let o = self.run(args);
        assert!(o.status.success(), "{args:?}: {}", errors(&o));
        String::from_utf8(o.stdout).unwrap()
    }

    pub fn json(&self, args: &[&str]) -> serde_json::Value {
        serde_json::from_str(&self.good(args)).unwrap()
    }
}

/// A command as one would type it.
pub fn words(command: &str) -> Vec<&str> {
    command.split(' ').collect()
}

/// The same, for the arm and the cell of the folder.
pub fn in_cell(command: &str) -> Vec<&str> {
    [&words(command)[..], &CELL_ARGS].concat()
}

pub fn errors(o: &Output) -> String {
    String::from_utf8_lossy(&o.stderr).into_owned()
}

/// A recording in which no measurement is the same: joint 1 was read 0.1 mdeg further on.
pub fn measured_anew(text: &str) -> String {
    let mut column: Option<usize> = None;
    let mut out = String::new();
    for line in text.lines() {
        let mut cells: Vec<String> = line.split(',').map(String::from).collect();
        if let Some(column) = column {
            cells[column] = format!("{}", cells[column].parse::<f64>().unwrap() + 1e-4);
        }
        column = column.or_else(|| cells.iter().position(|c| c == "q1_deg"));
        out += &(cells.join(",") + "\n");
    }
    out
}
