//! Fault scripts of the virtual cell: TOML, one `[[fault]]` each.

use std::path::Path;

use serde::Deserialize;
use thiserror::Error;
use trical_model::error::read_text;

use super::{Fault, Scheduled, When};
use crate::gauge::AXES;
use crate::gauge::uwave_protocol::Status;

/// What is wrong with a script, as one sentence.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{0}")]
pub struct ScriptError(String);

type Result<T> = std::result::Result<T, ScriptError>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    fault: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    what: String,
    after_motions: Option<u64>,
    after_readings: Option<u64>,
    after_commands: Option<u64>,
    after_s: Option<f64>,
    lasts: Option<f64>,
    axis: Option<char>,
    status: Option<u8>,
    per_mille: Option<u16>,
    ms: Option<u32>,
    by_mm: Option<[f64; 3]>,
    within_mm: Option<f64>,
    joint: Option<usize>,
    by_deg: Option<f64>,
    by_s: Option<i64>,
}

const KNOWN: &str = "silent, garbage, unsolicited, drop_bytes, double_bytes, garble_bytes (per_mille), late (ms), pieces, \
    stale (axis), stuck_stem (axis), sticking_stem (axis, within_mm), status (axis, status), battery_low (axis), swapped_axes, flipped_axis (axis), balls_removed, \
    slipped_plate (by_mm), jogged (joint, by_deg), clock_jump (by_s), refuse, stuck, stall, drop_connection";

/// Reads a script.
///
/// # Errors
/// A file that cannot be read, or what [`parse`] says.
pub fn load(path: &Path) -> Result<Vec<Scheduled>> {
    let name = path.display().to_string();
    let text = read_text(path).map_err(|e| ScriptError(e.to_string()))?;
    parse(&text, &name)
}

/// Reads the text of a script; `name` is for messages.
///
/// # Errors
/// No TOML, a fault that is not known or lacks something, or one with two times.
pub fn parse(text: &str, name: &str) -> Result<Vec<Scheduled>> {
    let file: File = toml::from_str(text).map_err(|e| ScriptError(format!("{name}: {}", one_line(&e, text))))?;
    file.fault
        .iter()
        .enumerate()
        .map(|(k, e)| {
            scheduled(e).map_err(|problem| ScriptError(format!("{name}: fault {} ({:?}): {problem}", k + 1, e.what)))
        })
        .collect()
}

fn one_line(e: &toml::de::Error, text: &str) -> String {
    let at = e.span().map_or(0, |s| s.start);
    let line = text.get(..at).map_or(1, |before| before.matches('\n').count() + 1);
    format!("line {line}: {}", e.message().replace('\n', " "))
}

fn scheduled(e: &Entry) -> std::result::Result<Scheduled, String> {
    let axis = || {
        let found = e.axis.ok_or("expected axis = \"x\", \"y\" or \"z\"")?;
        AXES.iter().position(|a| *a == found).ok_or_else(|| format!("axis is {found:?}, expected x, y or z"))
    };
    let per_mille = || e.per_mille.filter(|p| *p <= 1000).ok_or("expected per_mille, 0 to 1000");
    let fault = match e.what.as_str() {
        "silent" => Fault::Silence,
        "garbage" => Fault::Garbage,
        "unsolicited" => Fault::Unsolicited,
        "drop_bytes" => Fault::DropBytes { per_mille: per_mille()? },
        "double_bytes" => Fault::DoubleBytes { per_mille: per_mille()? },
        "garble_bytes" => Fault::GarbleBytes { per_mille: per_mille()? },
        "late" => Fault::Late { milliseconds: e.ms.ok_or("expected ms")? },
        "pieces" => Fault::Pieces,
        "stale" => Fault::Stale { axis: axis()? },
        "stuck_stem" => Fault::StuckStem { axis: axis()? },
        "sticking_stem" => {
            let within = e.within_mm.filter(|v| (0.0..=1000.0).contains(v)).ok_or("expected within_mm, 0 to 1000")?;
            Fault::StickingStem { axis: axis()?, within_um: (within * 1e3).round() as u32 }
        }
        "jogged" => {
            let joint = e.joint.filter(|j| *j >= 1).ok_or("expected joint, counted from 1")? - 1;
            let by_deg = e.by_deg.filter(|v| v.abs() <= 360.0).ok_or("expected by_deg, 360 at most")?;
            let by_mdeg = (by_deg * 1e3).round() as i32;
            Fault::Jogged { joint, by_mdeg }
        }
        "clock_jump" => Fault::ClockJump { seconds: e.by_s.ok_or("expected by_s")? },
        "battery_low" => Fault::BatteryLow { axis: axis()? },
        "status" => Fault::Status {
            axis: axis()?,
            status: Status::from_code(e.status.ok_or("expected status, a number as the receiver says it")?),
            times: 0,
        },
        "swapped_axes" => Fault::SwappedAxes,
        "flipped_axis" => Fault::FlippedAxis { axis: axis()? },
        "balls_removed" => Fault::BallsRemoved,
        "slipped_plate" => {
            let by = e.by_mm.ok_or("expected by_mm = [x, y, z]")?;
            if !by.iter().all(|v| v.abs() <= 1000.0) {
                return Err("by_mm is over 1000 mm".to_owned());
            }
            let by_um = by.map(|v| (v * 1e3).round() as i32);
            Fault::SlippedPlate { by_um }
        }
        "refuse" => Fault::RefuseMoves,
        "stuck" => Fault::StuckArm,
        "stall" => Fault::Stall,
        "drop_connection" => Fault::DropConnection,
        _ => return Err(format!("unknown; known are {KNOWN}")),
    };
    let whens = [
        e.after_motions.map(When::Motions),
        e.after_readings.map(When::Readings),
        e.after_commands.map(When::Commands),
        e.after_s.map(When::Seconds),
    ];
    let mut given = whens.into_iter().flatten();
    let when = given.next().unwrap_or(When::Seconds(0.0));
    if given.next().is_some() {
        return Err("more than one of after_motions, after_readings, after_commands, after_s".to_owned());
    }
    Ok(Scheduled { when, lasts: e.lasts, fault })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_script_is_read_and_what_is_wrong_is_named() {
        let text = "[[fault]]\nwhat = \"stale\"\naxis = \"y\"\nafter_motions = 12\nlasts = 3\n\n[[fault]]\nwhat = \"slipped_plate\"\nby_mm = [0.1, 0, -0.05]\nafter_s = 60.0\n";
        let script = parse(text, "f.toml").unwrap();
        assert_eq!(
            script,
            [
                Scheduled { when: When::Motions(12), lasts: Some(3.0), fault: Fault::Stale { axis: 1 } },
                Scheduled {
                    when: When::Seconds(60.0),
                    lasts: None,
                    fault: Fault::SlippedPlate { by_um: [100, 0, -50] }
                },
            ]
        );
        let says = |text: &str| parse(text, "f.toml").unwrap_err().to_string();
        assert!(says("[[fault]]\nwhat = \"stale\"").contains("fault 1 (\"stale\"): expected axis"));
        assert!(says("[[fault]]\nwhat = \"sticking_stem\"\naxis = \"x\"").contains("expected within_mm"));
        assert!(says("[[fault]]\nwhat = \"fire\"").contains("known are silent"));
        assert!(says("[[fault]]\nwhat = \"silent\"\nwen = 1").contains("line 3"));
        assert!(says("[[fault]]\nwhat = \"silent\"\nafter_s = 1\nafter_motions = 2").contains("more than one"));
    }
}
