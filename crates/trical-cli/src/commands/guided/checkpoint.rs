//! What a guided session keeps beside its recording, so that it can go on after a break.

use std::path::{Path, PathBuf};

use serde_json::json;
use trical_ident::write_whole;

use crate::error::{CliError, Result};

/// The next step, and the mastering.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Checkpoint {
    /// Steps that are done.
    pub step: usize,
    /// What the gauge shows on the calibrator, m; `None` where its readings are taken as they come.
    pub zero: Option<[f64; 3]>,
    /// Touches for tool point and world frame count that were made after this time of their recording, s: with this mastering.
    pub since: f64,
}

/// A file beside a recording: run.mcap has run.cell.toml.
pub fn beside(out: &Path, what: &str) -> PathBuf {
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    out.with_file_name(format!("{stem}.{what}"))
}

impl Checkpoint {
    fn file(out: &Path) -> PathBuf {
        beside(out, "guided.json")
    }

    /// Reads it; a session that has none begins.
    pub fn load(out: &Path) -> Result<Self> {
        let path = Self::file(out);
        if !path.exists() {
            return Ok(Self::default());
        }
        let text = trical_model::error::read_text(&path)?;
        let wrong = |what: String| CliError::Input(format!("{}: {what}", path.display()));
        let value: serde_json::Value = serde_json::from_str(&text).map_err(|e| wrong(e.to_string()))?;
        let step = value["steps_done"].as_u64().and_then(|n| usize::try_from(n).ok());
        let step =
            step.ok_or_else(|| wrong(format!("steps_done: found {}, expected a number", value["steps_done"])))?;
        let zero = match &value["zero_mm"] {
            serde_json::Value::Null => None,
            found => {
                let numbers: Vec<f64> =
                    found.as_array().into_iter().flatten().filter_map(serde_json::Value::as_f64).collect();
                let zero: [f64; 3] = numbers
                    .try_into()
                    .map_err(|_| wrong(format!("zero_mm: found {found}, expected three numbers in mm")))?;
                Some(zero.map(|v| v * 1e-3))
            }
        };
        Ok(Self { step, zero, since: value["touches_after_s"].as_f64().unwrap_or(0.0) })
    }

    /// Writes it.
    pub fn save(&self, out: &Path) -> Result<()> {
        let zero = self.zero.map(|zero| zero.map(|v| v * 1e3));
        let value = json!({ "steps_done": self.step, "zero_mm": zero, "touches_after_s": self.since });
        let text = serde_json::to_string_pretty(&value)?;
        Ok(write_whole(&Self::file(out), format!("{text}\n").as_bytes())?)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn what_is_kept_comes_back_and_a_damaged_file_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("run.mcap");
        assert_eq!(Checkpoint::load(&out).unwrap(), Checkpoint::default());
        let checkpoint = Checkpoint { step: 6, zero: Some([0.5e-3, -0.25e-3, 0.0]), since: 12.5 };
        checkpoint.save(&out).unwrap();
        assert_eq!(Checkpoint::load(&out).unwrap(), checkpoint);
        std::fs::write(Checkpoint::file(&out), r#"{"steps_done": 2, "zero_mm": [1, 2]}"#).unwrap();
        let said = Checkpoint::load(&out).unwrap_err().to_string();
        assert!(said.contains("run.guided.json: zero_mm: found [1,2], expected three numbers"), "{said}");
    }
}
