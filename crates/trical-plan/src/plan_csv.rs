//! `plan.csv`: a plan as a table, to be read by people, spreadsheets and `trical measure`.
//!
//! A header line, then one line for each touch in the order of measurement, columns known by name and in any order:
//!
//! | column | meaning |
//! |---|---|
//! | `order` | 1, 2, 3 ... |
//! | `ball` | which ball, from 1 |
//! | `q1_deg` ... `qn_deg` | joints at the touch (`q3_mm` for a joint that slides) |
//! | `a1_deg` ... `an_deg` | joints at the stand-off pose, from which the touch is approached and to which the arm goes back |
//! | `via` | configurations to go through on the way from the touch before: joints separated by blanks, configurations by `;`; empty where the way is straight |
//!
//! Values have six decimals, and plans are made of such values: what is read is exactly what was written.

use thiserror::Error;
use trical_model::error::shortened;
use trical_model::{JointKind, Joints, MAX_JOINTS, Robot};

use crate::plan::PlanEntry;

/// What is wrong with a plan's file.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{file}, line {line}, column {column}: found {found}, expected {expected}")]
pub struct PlanFileError {
    /// The file's name.
    pub file: String,
    /// 1-based; the header is line 1.
    pub line: usize,
    /// The column's name.
    pub column: String,
    /// What is there.
    pub found: String,
    /// What should be.
    pub expected: String,
}

fn joint_names(robot: &Robot, letter: char) -> impl Iterator<Item = String> + '_ {
    (0..robot.dof()).map(move |k| format!("{letter}{}_{}", k + 1, robot.kind(k + 1).unit().1))
}

/// The names of the columns, in the order in which they are written.
fn columns(robot: &Robot) -> Vec<String> {
    let joints = joint_names(robot, 'q').chain(joint_names(robot, 'a'));
    ["order", "ball"].map(String::from).into_iter().chain(joints).chain(["via".to_owned()]).collect()
}

/// The text of a `plan.csv`.
#[must_use]
pub fn write_plan(robot: &Robot, entries: &[PlanEntry]) -> String {
    let number = |q: &Joints, k: usize| {
        let text = format!("{:.6}", q[k] * robot.kind(k + 1).unit().0);
        // -0.000000 is 0
        if text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.') {
            text.trim_start_matches('-').to_owned()
        } else {
            text
        }
    };
    let numbers = |q: &Joints| (0..robot.dof()).map(|k| number(q, k)).collect::<Vec<_>>();
    let mut out = csv::Writer::from_writer(Vec::new());
    // writing to memory cannot fail
    let _ = out.write_record(columns(robot));
    for e in entries {
        let via: Vec<String> = e.via.iter().map(|q| numbers(q).join(" ")).collect();
        let count = [e.index, e.ball].map(|k| (k + 1).to_string());
        let _ = out.write_record(
            count.into_iter().chain(numbers(&e.joints)).chain(numbers(&e.approach)).chain([via.join(";")]),
        );
    }
    String::from_utf8(out.into_inner().unwrap_or_default()).unwrap_or_default()
}

/// For which arm a plan is read, and the name of its file for messages.
struct Reader<'a> {
    file: &'a str,
    robot: &'a Robot,
    balls: usize,
    columns: Vec<String>,
}

impl Reader<'_> {
    fn error(&self, line: usize, column: &str, found: String, expected: &str) -> PlanFileError {
        PlanFileError {
            file: self.file.to_owned(),
            line,
            column: shortened(column, 60),
            found: shortened(&found, 100),
            expected: expected.to_owned(),
        }
    }

    /// Where each of the columns stands.
    fn places(&self, header: &csv::StringRecord) -> Result<Vec<usize>, PlanFileError> {
        for (k, name) in header.iter().enumerate() {
            if !self.columns.iter().any(|n| n == name) {
                let expected = format!("one of the columns {}", self.columns.join(", "));
                return Err(self.error(1, name, format!("the unknown column '{name}'"), &expected));
            }
            if header.iter().take(k).any(|n| n == name) {
                return Err(self.error(1, name, "it twice".into(), "each column once"));
            }
        }
        let place = |name: &String| {
            let missing = || self.error(1, name, "no such column".into(), "it in the header line");
            header.iter().position(|n| n == name).ok_or_else(missing)
        };
        self.columns.iter().map(place).collect()
    }
}

/// A line of a plan.
struct Line<'a> {
    reader: &'a Reader<'a>,
    number: usize,
    /// In the order of the reader's columns.
    cells: Vec<&'a str>,
}

impl Line<'_> {
    fn wrong(&self, column: usize, text: &str, expected: &str) -> PlanFileError {
        let found = if text.is_empty() { "nothing".to_owned() } else { format!("'{text}'") };
        self.reader.error(self.number, &self.reader.columns[column], found, expected)
    }

    /// What `text` in a column says of joint `k`.
    fn joint(&self, column: usize, text: &str, k: usize) -> Result<f64, PlanFileError> {
        let limits = self.reader.robot.joints[k].limits;
        let kind = self.reader.robot.kind(k + 1);
        let (per_si, unit) = kind.unit();
        let [low, high] = limits.map(|l| l * per_si);
        let si = |x: f64| if kind == JointKind::Prismatic { x * 1e-3 } else { x.to_radians() };
        // the limits themselves may have been rounded on their way here
        match text.parse::<f64>() {
            Ok(x) if x >= low - 1e-6 && x <= high + 1e-6 => Ok(si(x).clamp(limits[0], limits[1])),
            _ => {
                let expected = format!("a number of {low:.3} to {high:.3} {unit}, the joint's limits");
                Err(self.wrong(column, text, &expected))
            }
        }
    }

    /// Joints in a column each, from this one on.
    fn joints(&self, first: usize) -> Result<Joints, PlanFileError> {
        let mut q = [0.0; MAX_JOINTS];
        for (k, q) in q.iter_mut().enumerate().take(self.reader.robot.dof()) {
            *q = self.joint(first + k, self.cells[first + k], k)?;
        }
        Ok(q)
    }

    /// Configurations in one column.
    fn configurations(&self, column: usize) -> Result<Vec<Joints>, PlanFileError> {
        let n = self.reader.robot.dof();
        let mut all = Vec::new();
        for group in self.cells[column].split(';').filter(|g| !g.trim().is_empty()) {
            let values: Vec<&str> = group.split_whitespace().collect();
            if values.len() != n {
                let found = format!("{} numbers in '{}'", values.len(), group.trim());
                let name = &self.reader.columns[column];
                return Err(self.reader.error(self.number, name, found, &format!("{n}, one for each joint")));
            }
            let mut q = [0.0; MAX_JOINTS];
            for (k, text) in values.iter().enumerate() {
                q[k] = self.joint(column, text, k)?;
            }
            all.push(q);
        }
        Ok(all)
    }

    /// The touch, before which there are `index` others.
    fn entry(&self, index: usize) -> Result<PlanEntry, PlanFileError> {
        let (n, balls) = (self.reader.robot.dof(), self.reader.balls);
        if self.cells[0].parse::<usize>() != Ok(index + 1) {
            return Err(self.wrong(0, self.cells[0], &format!("{}", index + 1)));
        }
        let ball = match self.cells[1].parse::<usize>() {
            Ok(b) if (1..=balls).contains(&b) => b - 1,
            _ => return Err(self.wrong(1, self.cells[1], &format!("a ball, 1 to {balls}"))),
        };
        let (joints, approach) = (self.joints(2)?, self.joints(2 + n)?);
        Ok(PlanEntry { index, ball, joints, approach, via: self.configurations(2 + 2 * n)? })
    }
}

/// Reads the text of a `plan.csv` for an arm with `balls` balls; `file` is its name for messages. Joints are checked against
/// the arm's limits: what is read may be driven.
///
/// # Errors
/// The first thing that is wrong: line, column, what was found and what is expected.
pub fn read_plan(text: &str, file: &str, robot: &Robot, balls: usize) -> Result<Vec<PlanEntry>, PlanFileError> {
    let reader = Reader { file, robot, balls, columns: columns(robot) };
    let mut csv = csv::ReaderBuilder::new()
        .flexible(true)
        .trim(csv::Trim::All)
        // with lines that end with \r\n the crate would count one too few
        .terminator(csv::Terminator::Any(b'\n'))
        .from_reader(text.trim_start_matches('\u{feff}').as_bytes());
    let unreadable = |e: csv::Error| reader.error(1, "order", e.to_string(), "a table");
    let header = csv.headers().map_err(unreadable)?.clone();
    let places = reader.places(&header)?;
    let mut entries: Vec<PlanEntry> = Vec::new();
    for record in csv.records() {
        let cells = record.map_err(unreadable)?;
        let number = cells.position().map_or(0, |p| usize::try_from(p.line()).unwrap_or(usize::MAX));
        if cells.len() == 1 && cells[0].is_empty() {
            continue;
        }
        if cells.len() != header.len() {
            let found = format!("{} columns", cells.len());
            let last = header.get(cells.len().min(header.len()).saturating_sub(1)).unwrap_or("order");
            return Err(reader.error(number, last, found, &format!("{} as in the header line", header.len())));
        }
        let cells = places.iter().map(|p| cells.get(*p).unwrap_or("")).collect();
        entries.push(Line { reader: &reader, number, cells }.entry(entries.len())?);
    }
    if entries.is_empty() {
        return Err(reader.error(2, "order", "no line".into(), "one touch or more"));
    }
    Ok(entries)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

    use proptest::prelude::*;

    use super::*;
    use crate::joints::rounded;

    fn robot() -> Robot {
        Robot::parse(include_str!("../../../cells/irb120/robot.toml"), "robot.toml").unwrap()
    }

    fn message(text: &str) -> String {
        read_plan(text, "plan.csv", &robot(), 3).unwrap_err().to_string()
    }

    const HEADER: &str =
        "order,ball,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,a1_deg,a2_deg,a3_deg,a4_deg,a5_deg,a6_deg,via";

    #[test]
    fn errors_name_line_column_found_and_expected() {
        let good = "1,2,1,2,3,4,5,6,1,2,3,4,5,6,";
        assert_eq!(read_plan(&format!("{HEADER}\n{good}\n"), "plan.csv", &robot(), 3).unwrap().len(), 1);
        assert_eq!(
            message(&format!("{HEADER}\n1,4,1,2,3,4,5,6,1,2,3,4,5,6,\n")),
            "plan.csv, line 2, column ball: found '4', expected a ball, 1 to 3"
        );
        assert_eq!(
            message(&format!("{HEADER}\n{good}\n2,1,1,2,x,4,5,6,1,2,3,4,5,6,\n")),
            "plan.csv, line 3, column q3_deg: found 'x', expected a number of -110.000 to 70.000 deg, the joint's limits"
        );
        assert_eq!(
            message(&format!("{HEADER}\n1,1,1,2,71,4,5,6,1,2,3,4,5,6,\n")),
            "plan.csv, line 2, column q3_deg: found '71', expected a number of -110.000 to 70.000 deg, the joint's limits"
        );
        assert_eq!(
            message(&format!("{HEADER}\n1,1,1,2,3,4,5,6,1,2,3,4,5,6\n")),
            "plan.csv, line 2, column a6_deg: found 14 columns, expected 15 as in the header line"
        );
        assert_eq!(
            message(&format!("{HEADER}\n1,1,1,2,3,4,5,6,1,2,3,4,5,6,1 2 3\n")),
            "plan.csv, line 2, column via: found 3 numbers in '1 2 3', expected 6, one for each joint"
        );
        assert_eq!(
            message(&format!("{HEADER}\n{good}\n{good}\n")),
            "plan.csv, line 3, column order: found '1', expected 2"
        );
        assert_eq!(message(HEADER), "plan.csv, line 2, column order: found no line, expected one touch or more");
        assert!(message("order,ball\n").starts_with("plan.csv, line 1, column q1_deg: found no such column"));
        assert!(message(&format!("{HEADER},colour\n")).contains("found the unknown column 'colour', expected one of"));
        assert!(message("").starts_with("plan.csv, line 1, column "));
    }

    /// As spreadsheets save it: a mark at the start, lines that end with \\r\\n, quotes, blank lines.
    #[test]
    fn a_plan_that_a_spreadsheet_saved_is_the_plan_and_its_lines_are_counted() {
        let saved = |q3: &str| {
            format!("\u{feff}{HEADER}\n\"1\", 2 ,1,2,{q3},4,5,6,1,2,3,4,5,6,\"1 2 3 4 5 6; 6 5 4 3 2 1\"\n\n   \n2,1,1,2,3,4,5,6,1,2,{q3},4,5,6,\n").replace('\n', "\r\n")
        };
        let read = read_plan(&saved("3"), "plan.csv", &robot(), 3).unwrap();
        assert_eq!((read.len(), read[0].ball, read[0].via.len(), read[0].via[1][0]), (2, 1, 2, 6.0_f64.to_radians()));
        let late = saved("3").replace("1,2,3,4,5,6,\r\n", "1,2,x,4,5,6,\r\n");
        assert!(message(&late).starts_with("plan.csv, line 5, column a3_deg: found 'x'"), "{}", message(&late));
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_back_bit_by_bit(
            u in prop::collection::vec(prop::array::uniform6(0.0..=1.0_f64), 3..6), ball in 0..3_usize,
        ) {
            let robot = robot();
            let q = |u: &[f64; 6]| {
                let mut q = [0.0; MAX_JOINTS];
                for (k, j) in robot.joints.iter().enumerate() {
                    q[k] = j.limits[0] + u[k] * (j.limits[1] - j.limits[0]);
                }
                let mut q = rounded(&robot, &q);
                for (k, j) in robot.joints.iter().enumerate() {
                    q[k] = q[k].clamp(j.limits[0], j.limits[1]);
                }
                q
            };
            let entry = PlanEntry {
                index: 0, ball, joints: q(&u[0]), approach: q(&u[1]), via: u[2..].iter().map(q).collect(),
            };
            let text = write_plan(&robot, std::slice::from_ref(&entry));
            let read = read_plan(&text, "plan.csv", &robot, 3).unwrap();
            prop_assert_eq!(&read, &vec![entry]);
            prop_assert_eq!(write_plan(&robot, &read), text);
        }

        #[test]
        fn no_text_panics(text in "[a-z0-9_,;. \\n-]{0,200}", tail in "[0-9,;. -]{0,80}") {
            let _ = read_plan(&text, "plan.csv", &robot(), 3);
            let _ = read_plan(&format!("{HEADER}\n{tail}"), "plan.csv", &robot(), 3);
        }
    }
}
