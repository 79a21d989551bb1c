//! Recordings in MCAP: joints while the arm moves, every reading, every accepted measurement, and the files that they
//! belong to.
//!
//! Each accepted measurement ends its chunk and is on disk before the writer returns, so a crash loses nothing that was
//! accepted; the reader takes what is whole out of a file that was cut anywhere.

mod bag;
pub mod cdr;
mod lock;
mod read;
mod records;
pub mod schema;
mod write;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use trical_model::recording::{Recording, Row};
use trical_model::{Cell, MAX_JOINTS, Robot};

use crate::error::RecordError;
use crate::motion::JointSample;

pub use bag::joint_order;
pub use lock::check_not_written;
pub(crate) use lock::{Locked, is_at, is_busy, lock};
pub use read::{each_row, read_any, read_bytes, read_recording};
pub use write::{RecordingWriter, check_same, write_recording};

/// A file inside a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// Name, e.g. `robot.toml`.
    pub name: String,
    /// Media type, e.g. `application/toml`.
    pub media_type: String,
    /// The bytes.
    pub data: Vec<u8>,
}

impl Attachment {
    /// A TOML file.
    #[must_use]
    pub fn toml(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self { name: name.into(), media_type: "application/toml".to_owned(), data: text.into().into_bytes() }
    }
}

/// What a recording says before its first measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// Names of the arm's joints, joint 1 first.
    pub joint_names: Vec<String>,
    /// Which of them slide, joint 1 first.
    pub prismatic: [bool; MAX_JOINTS],
    /// When the recording began, in ns since 1970; times in the recording count from it.
    pub start_ns: u64,
    /// The robot and cell files.
    pub attachments: Vec<Attachment>,
    /// Settings; the program's version is added.
    pub settings: BTreeMap<String, String>,
    /// The plan's hash, where there is a plan: a recording goes on with its own plan only.
    pub plan_sha256: Option<String>,
    /// The robot as URDF, for viewers.
    pub robot_description: Option<String>,
}

impl Header {
    /// A header for an arm with so many joints, named `joint_1` and so on.
    #[must_use]
    pub fn for_joints(joints: usize) -> Self {
        Self {
            joint_names: (1..=joints).map(|joint| format!("joint_{joint}")).collect(),
            prismatic: [false; MAX_JOINTS],
            start_ns: 0,
            attachments: Vec::new(),
            settings: BTreeMap::new(),
            plan_sha256: None,
            robot_description: None,
        }
    }
}

impl Default for Header {
    fn default() -> Self {
        Self::for_joints(6)
    }
}

/// Where the procedure leaves what happens.
pub trait RunLog {
    /// Where the joints were.
    ///
    /// # Errors
    /// The record could not be written.
    fn joint_state(&mut self, sample: &JointSample) -> Result<(), RecordError>;

    /// A reading of the gauge, m; `settled` once it was accepted as standing still.
    ///
    /// # Errors
    /// The record could not be written.
    fn indicators(&mut self, t: f64, reading: &[f64; 3], settled: bool) -> Result<(), RecordError>;

    /// A temperature in degC.
    ///
    /// # Errors
    /// The record could not be written.
    fn temperature(&mut self, t: f64, temp_c: f64) -> Result<(), RecordError>;

    /// An accepted measurement; it is safe when this returns.
    ///
    /// # Errors
    /// The record could not be written.
    fn measurement(&mut self, row: &Row) -> Result<(), RecordError>;
}

/// Keeps the accepted measurements only.
impl RunLog for Vec<Row> {
    fn joint_state(&mut self, _: &JointSample) -> Result<(), RecordError> {
        Ok(())
    }

    fn indicators(&mut self, _: f64, _: &[f64; 3], _: bool) -> Result<(), RecordError> {
        Ok(())
    }

    fn temperature(&mut self, _: f64, _: f64) -> Result<(), RecordError> {
        Ok(())
    }

    fn measurement(&mut self, row: &Row) -> Result<(), RecordError> {
        self.push(*row);
        Ok(())
    }
}

/// A reading of the gauge in a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IndicatorSample {
    /// Time in s since the recording began.
    pub t: f64,
    /// The three indicators, m.
    pub reading: [f64; 3],
    /// Whether it was accepted as standing still.
    pub settled: bool,
}

/// What a recording holds.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadRecording {
    /// The measurements.
    pub recording: Recording,
    /// Files inside the recording.
    pub attachments: Vec<Attachment>,
    /// Metadata records by name.
    pub metadata: BTreeMap<String, BTreeMap<String, String>>,
    /// Joints while the arm moved, in the order of time; times in s since the recording began.
    pub joint_states: Vec<JointSample>,
    /// Readings of the gauge.
    pub indicators: Vec<IndicatorSample>,
    /// When the recording began, in ns since 1970.
    pub start_ns: u64,
    /// Where the file does not end as it should: one sentence on what was lost.
    pub lost: Option<String>,
}

impl ReadRecording {
    /// Numbers (`seq`) of the measurements that are there.
    #[must_use]
    pub fn done(&self) -> BTreeSet<u64> {
        self.recording.rows.iter().filter_map(|row| row.seq).collect()
    }

    /// The text of an attachment.
    #[must_use]
    pub fn attachment(&self, name: &str) -> Option<&str> {
        let found = self.attachments.iter().find(|attachment| attachment.name == name)?;
        std::str::from_utf8(&found.data).ok()
    }

    /// Arm and cell that were attached; `file` is the recording's name, for messages.
    ///
    /// # Errors
    /// An attachment that cannot be read.
    pub fn arm_and_cell(&self, file: &Path) -> trical_model::Result<(Option<Robot>, Option<Cell>)> {
        let name = |what: &str| format!("{} ({what} inside)", file.display());
        let robot = self.attachment("robot.toml").map(|text| Robot::parse(text, &name("robot.toml"))).transpose()?;
        let cell = self.attachment("cell.toml").map(|text| Cell::parse(text, &name("cell.toml"))).transpose()?;
        Ok((robot, cell))
    }
}
