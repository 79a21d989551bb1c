//! A table of poses or joint values: comma-separated, a header with units in its names, `#` for comments.
//!
//! Columns are called as those of recordings: `x_mm,y_mm,z_mm` with `qw,qx,qy,qz` or `roll_deg,pitch_deg,yaw_deg`, or `q1_deg,q2_deg,...` (`q1_mm` of a joint
//! that slides), each also in m or rad; `tool` and `frame` name what a row is meant with. Other columns and everything else stay as they are.

use trical_model::error::shortened;
use trical_recording::columns::{self, Field, Unit};

use crate::branch::Configuration;
use crate::literal::Shape;
use crate::packed::External;
use crate::scan::{Scan, Setup, Spot, Visit};
use crate::text::{Span, lower, number};

/// Columns of what was measured: a file that has one is a recording, and nothing in it is a target.
const MEASURED: [&str; 8] = ["ball", "ix_mm", "iy_mm", "iz_mm", "target", "reference", "d_mm", "anchor"];

/// What a header is to have.
const EXPECTED: &str = "x_mm,y_mm,z_mm,qw,qx,qy,qz or q1_deg,... (also x_m ..., roll_deg,pitch_deg,yaw_deg in place of the quaternion, roll_rad ..., q1_rad ...)";

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
                    scan.scales.clone_from(&found.scales);
                    columns = Some(found);
                }
                Some(columns) => columns.row(at, line, bytes, &mut scan),
            }
        }
        at = end + 1;
    }
    Ok(scan)
}

/// Where the fields of a line stand in it, without blanks and quotation marks around them; commas between such marks separate none.
fn fields(line: &[u8]) -> Vec<Span> {
    let (mut found, mut from, mut is_quoted) = (Vec::new(), 0, false);
    for (at, b) in line.iter().chain(b",").enumerate() {
        is_quoted ^= *b == b'"';
        if at < line.len() && (is_quoted || *b != b',') {
            continue;
        }
        let text = line.get(from..at).unwrap_or(&[]);
        let is_around = |b: &&u8| b.is_ascii_whitespace() || **b == b'"';
        let start = from + text.iter().take_while(is_around).count();
        let end = at - text.iter().rev().take_while(is_around).count();
        found.push(Span::new(start, end.max(start)));
        from = at + 1;
    }
    found
}

/// Refuses positions in the robot's base that are in metres where the columns say mm, or the other way round: no tool is within 10 mm of the middle
/// of its arm's foot, and none 100 m away.
///
/// # Errors
/// In words, with the columns that would fit.
pub fn check_units(scan: &Scan, bytes: &[u8]) -> Result<(), String> {
    const NEAREST_MM: f64 = 10.0;
    const FARTHEST_MM: f64 = 1e5;
    let is_in_frame = |s: &Spot| s.setup().and_then(|k| scan.setups.get(k as usize)).is_some_and(|s| s.frame.is_some());
    let mut farthest: (f64, Option<Span>, usize) = (0.0, None, 0);
    for spot in scan.spots.iter().filter(|s| !s.shape.is_joints()) {
        if is_in_frame(spot) {
            return Ok(());
        }
        for (k, span) in scan.written(spot).numbers.iter().take(3).enumerate() {
            let mm = scan.value(*span, bytes).map_or(0.0, |x| (x * scan.scale(k)).abs());
            if mm > farthest.0 {
                farthest = (mm, Some(*span), k);
            }
        }
    }
    let (mm, Some(span), k) = farthest else { return Ok(()) };
    let (found, expected) = match scan.scale(0) == 1.0 {
        true if mm < NEAREST_MM => ("mm", "m"),
        false if mm > FARTHEST_MM => ("m", "mm"),
        _ => return Ok(()),
    };
    let (line, axis) = (1 + bytes.iter().take(span.at as usize).filter(|b| **b == b'\n').count(), ['x', 'y', 'z'][k]);
    Err(format!(
        "line {line}, column {axis}_{found}: found {}, the largest coordinate of the table, and no arm has its tool there; if the numbers are \
         in {expected}, the columns are x_{expected},y_{expected},z_{expected}",
        shortened(&String::from_utf8_lossy(span.text(bytes)), 40)
    ))
}

struct Columns {
    shape: Shape,
    /// Column of each number of a target.
    numbers: Vec<usize>,
    /// Of joint values, which are in mm.
    in_mm: Vec<bool>,
    /// Of each number, how many mm or deg one unit of its column is.
    scales: Vec<f64>,
    tool: Option<usize>,
    frame: Option<usize>,
    width: usize,
}

impl Columns {
    fn of(header: &[u8]) -> Result<Self, String> {
        let names: Vec<String> = fields(header).iter().map(|name| lower(name.text(header))).collect();
        let find = |name: &str| names.iter().position(|n| n == name);
        let of = |field: Field| {
            let found = names.iter().enumerate().filter_map(|(at, name)| {
                let (column, k, unit) = columns::find(name)?;
                (column.field == field).then_some((k, at, unit))
            });
            let mut found: Vec<(usize, usize, Unit)> = found.collect();
            found.sort_unstable_by_key(|(k, at, _)| (*k, *at));
            if let Some([a, b]) = found.windows(2).find(|two| two[0].0 == two[1].0) {
                let (a, b) = (&names[a.1], &names[b.1]);
                return Err(format!("header: found {a} and {b}, which are the same number; expected one of them"));
            }
            // the first ones, as far as none is missing
            Ok(found.into_iter().enumerate().take_while(|(n, (k, ..))| n == k).map(|(_, one)| one).collect::<Vec<_>>())
        };
        let (position, quaternion) = (of(Field::Position)?, of(Field::Quaternion)?);
        let (angles, joints) = (of(Field::RollPitchYaw)?, of(Field::Joints)?);
        if let Some(column) = MEASURED.iter().find(|name| find(name).is_some()) {
            return Err(format!(
                "header: found {column}, as measurements have; expected a table of targets, {EXPECTED}"
            ));
        }
        let (shape, numbers) = match [position.len(), quaternion.len(), angles.len(), joints.len()] {
            [3, 4, 0, 0] => (Shape::Quaternion, [position, quaternion].concat()),
            [3, 0, 3, 0] => (Shape::Xyz, [position, angles].concat()),
            [0, 0, 0, n] if n > 0 => (Shape::JointsDeg, joints),
            [3, 4, 3, 0] => {
                return Err(
                    "header: has an orientation twice, as a quaternion and as angles; expected one of them".into()
                );
            }
            [_, _, _, 0] => {
                let found = shortened(&names.iter().take(12).cloned().collect::<Vec<_>>().join(","), 200);
                if let Some((_, by)) =
                    [(';', "semicolons"), ('\t', "tabs")].iter().find(|(c, _)| names.len() == 1 && found.contains(*c))
                {
                    return Err(format!(
                        "header: found {found}, separated by {by}; expected commas, and points as decimal marks"
                    ));
                }
                return Err(format!("header: found {found}, expected {EXPECTED}"));
            }
            _ => {
                return Err("header: has both a pose and joint values, as a recording has; expected one of them".into());
            }
        };
        let of_joints = numbers.iter().filter(|_| shape.is_joints());
        let in_mm = of_joints.map(|(.., unit)| unit.usual() == Unit::Millimetre);
        let scales = numbers.iter().map(|(.., unit)| match unit {
            Unit::Metre => 1e3,
            Unit::Radian => 1_f64.to_degrees(),
            _ => 1.0,
        });
        let (in_mm, scales) = (in_mm.collect(), scales.collect());
        let numbers = numbers.iter().map(|(_, at, _)| *at).collect();
        Ok(Self { shape, numbers, in_mm, scales, tool: find("tool"), frame: find("frame"), width: names.len() })
    }

    fn row(&self, at: usize, line: &[u8], bytes: &[u8], scan: &mut Scan) {
        let in_file = |f: Span| Span::new(at + f.at as usize, at + f.at as usize + f.len as usize);
        let fields: Vec<Span> = fields(line).into_iter().map(in_file).collect();
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
        let spot = scan.push(self.shape, &spans, Configuration::Free, Span::default(), External::None);
        let named =
            |column: Option<usize>| column.map(|k| lower(fields[k].text(bytes))).filter(|name| !name.is_empty());
        let (tool, frame) = (named(self.tool), named(self.frame));
        let setup = scan.setup(Setup { tool, frame });
        scan.assign(spot, setup);
        scan.visits.push(Visit::To(spot));
    }
}
