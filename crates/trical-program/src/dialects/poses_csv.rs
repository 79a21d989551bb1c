//! A table of poses or joint values: comma-separated, a header with units in its names, `#` for comments.
//!
//! `x_mm,y_mm,z_mm,qw,qx,qy,qz` or `q1_deg,q2_deg,...` (`q1_mm` of a joint that slides); `tool` and `frame` name what a row is meant with. Other columns and
//! everything else stay as they are.

use trical_model::error::shortened;

use crate::branch::Configuration;
use crate::literal::Shape;
use crate::scan::{Scan, Setup, Visit};
use crate::text::{Span, lower, number};

/// Columns of what was measured: a file that has one is a recording, and nothing in it is a target.
const MEASURED: [&str; 8] = ["ball", "ix_mm", "iy_mm", "iz_mm", "target", "reference", "d_mm", "anchor"];

const POSE: [&str; 7] = ["x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"];

/// No row is this long, bytes.
const LONGEST_LINE: usize = 1 << 20;

/// Reads a table.
///
/// # Errors
/// In words, where the header is not one.
pub fn scan(bytes: &[u8]) -> Result<Scan, String> {
    let mut scan = Scan::default();
    let mut columns: Option<Columns> = None;
    let mut at = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
    while at < bytes.len() {
        let end = bytes[at..].iter().position(|b| *b == b'\n').map_or(bytes.len(), |k| at + k);
        if end - at > LONGEST_LINE {
            let number = 1 + bytes[..at].iter().filter(|b| **b == b'\n').count();
            return Err(format!(
                "line {number} is longer than {LONGEST_LINE} bytes; expected a table, one target a line"
            ));
        }
        let line = bytes[at..end].trim_ascii_end();
        if !line.trim_ascii_start().starts_with(b"#") && !line.is_empty() {
            match &columns {
                None => {
                    let found = Columns::of(line)?;
                    scan.in_mm.clone_from(&found.in_mm);
                    columns = Some(found);
                }
                Some(columns) => columns.row(at, line, bytes, &mut scan),
            }
        }
        at = end + 1;
    }
    Ok(scan)
}

struct Columns {
    shape: Shape,
    /// Column of each number of a target.
    numbers: Vec<usize>,
    /// Of joint values, which are in mm.
    in_mm: Vec<bool>,
    tool: Option<usize>,
    frame: Option<usize>,
    width: usize,
}

impl Columns {
    fn of(header: &[u8]) -> Result<Self, String> {
        let names: Vec<String> = header.split(|b| *b == b',').map(|n| lower(n.trim_ascii())).collect();
        let find = |name: &str| names.iter().position(|n| n == name);
        let pose: Vec<usize> = POSE.iter().filter_map(|n| find(n)).collect();
        let joint = |k| {
            let turns = find(&format!("q{k}_deg")).map(|at| (at, false));
            turns.or_else(|| find(&format!("q{k}_mm")).map(|at| (at, true)))
        };
        let (joints, in_mm): (Vec<usize>, Vec<bool>) = (1..=9).map_while(joint).unzip();
        if let Some(column) = MEASURED.iter().find(|name| find(name).is_some()) {
            return Err(format!(
                "header: found {column}, as measurements have; expected a table of targets, {} or q1_deg,...",
                POSE.join(",")
            ));
        }
        let found = || shortened(&names.iter().take(12).cloned().collect::<Vec<_>>().join(","), 200);
        let (shape, numbers) = match (pose.len(), joints.len()) {
            (7, 0) => (Shape::Quaternion, pose),
            (0, n) if n > 0 => (Shape::JointsDeg, joints),
            (0, 0) | (1..7, 0) => {
                return Err(format!("header: found {}, expected {} or q1_deg,...", found(), POSE.join(",")));
            }
            _ => {
                return Err("header: has both a pose and joint values, as a recording has; expected one of them".into());
            }
        };
        Ok(Self { shape, numbers, in_mm, tool: find("tool"), frame: find("frame"), width: names.len() })
    }

    fn row(&self, at: usize, line: &[u8], bytes: &[u8], scan: &mut Scan) {
        let mut fields = Vec::with_capacity(self.width);
        let mut from = 0;
        for field in line.split(|b| *b == b',') {
            let start = from + field.len() - field.trim_ascii_start().len();
            let text = field.trim_ascii();
            fields.push(Span::new(at + start, at + start + text.len()));
            from += field.len() + 1;
        }
        if fields.len() != self.width {
            scan.problems
                .push((at, format!("found {} fields, expected {} as in the header", fields.len(), self.width)));
            return;
        }
        let spans: Vec<Span> = self.numbers.iter().map(|k| fields[*k]).collect();
        if let Some(bad) = spans.iter().find(|s| number(s.text(bytes)).is_none()) {
            let text = shortened(&String::from_utf8_lossy(bad.text(bytes)), 60);
            scan.problems.push((at, format!("found '{text}', expected a finite number")));
            return;
        }
        let spot = scan.push(self.shape, &spans, Configuration::Free, Span::default());
        let named =
            |column: Option<usize>| column.map(|k| lower(fields[k].text(bytes))).filter(|name| !name.is_empty());
        let (tool, frame) = (named(self.tool), named(self.frame));
        let setup = scan.setup(Setup { tool, frame });
        scan.assign(spot, setup);
        scan.visits.push(Visit::To(spot));
    }
}
