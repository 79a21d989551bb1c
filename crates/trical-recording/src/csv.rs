//! Recordings as CSV: one row per measurement, columns known by name (`docs/formats.md`).

mod cells;
mod header;
mod layout;
mod lines;
mod tidy;

use std::io::Read as _;
use std::path::Path;

use trical_model::{MAX_JOINTS, Recording, Row};

use self::cells::Cells;
use self::header::{Reader, Slots};
use crate::columns::{Field, Unit};
use crate::error::{RecordError, Result};
use crate::shared::Places;

pub use cells::{ROOM_C, is_nothing};
pub use layout::{CsvWriter, Layout, write_csv};
pub(crate) use lines::{Lines, ends_of_lines};

/// What a header says about the rows below it.
pub(crate) struct Parser<'a> {
    reader: Reader<'a>,
    slots: Slots,
}

/// Rows without a measured value, in one sentence.
pub(crate) fn left_out(lines: &[usize]) -> Option<String> {
    const MOST: usize = 8;
    let told = lines.iter().take(MOST).map(ToString::to_string).collect::<Vec<_>>().join(", ");
    let more = if lines.len() > MOST { format!(" and {} more", lines.len() - MOST) } else { String::new() };
    match lines.len() {
        0 => None,
        1 => Some(format!("line {told} lacks a measured value and is left out")),
        _ => Some(format!("lines {told}{more} lack a measured value and are left out")),
    }
}

/// So many problems of a file are told at most.
const MOST_PROBLEMS: usize = 6;

/// One message with all problems of a file, the first one first.
fn all_in_one(problems: Vec<RecordError>) -> Option<RecordError> {
    let many = problems.len() >= MOST_PROBLEMS;
    let mut problems = problems.into_iter();
    let mut first = problems.next()?;
    if let RecordError::At { problem, .. } = &mut first {
        for other in problems {
            match other {
                RecordError::At { place, problem: next, .. } => *problem += &format!("; {place}: {next}"),
                other => *problem += &format!("; {other}"),
            }
        }
        if many {
            *problem += "; perhaps more";
        }
    }
    Some(first)
}

impl<'a> Parser<'a> {
    /// Reads a header.
    pub fn new(file: &'a str, header: &csv::StringRecord, joints: usize) -> Result<Self> {
        let reader = Reader { file, header: header.iter().map(|h| h.trim().to_owned()).collect() };
        let slots = reader.slots(joints)?;
        Ok(Self { reader, slots })
    }

    /// Whether the file has these columns.
    pub fn has(&self, field: Field) -> bool {
        self.slots.has(field)
    }

    /// Which joints slide.
    pub fn prismatic(&self) -> [bool; MAX_JOINTS] {
        let mut out = [false; MAX_JOINTS];
        for (slides, slot) in out.iter_mut().zip(self.slots.all(Field::Joints)) {
            *slides = slot.unit.usual() == Unit::Millimetre;
        }
        out
    }

    /// The row of a line; `None` where it is none.
    pub fn row_of(&self, line: &[u8]) -> Option<Row> {
        let (mut row, rows) = (None, Lines::of(csv_reader(false).from_reader(line), line));
        let mut take = |found| {
            row = Some(found);
            Ok::<_, RecordError>(())
        };
        self.each_row(rows, 0, &mut Places::default(), &mut take).ok()?;
        row
    }

    /// Hands on every row, and returns the lines of those without a measured value; lines are counted from `lines_before`.
    pub fn each_row<E: From<RecordError>>(
        &self,
        mut rows: Lines<'_>,
        lines_before: usize,
        places: &mut Places,
        take: &mut dyn FnMut(Row) -> Result<(), E>,
    ) -> Result<Vec<usize>, E> {
        let number = |line: u64| usize::try_from(line).unwrap_or(0) + lines_before;
        let mut left_out = Vec::new();
        let mut problems: Vec<RecordError> = Vec::new();
        loop {
            let line = match rows.next() {
                _ if problems.len() >= MOST_PROBLEMS => break,
                Ok(None) => break,
                Ok(Some(line)) => number(line),
                Err(e) => {
                    let line = number(e.position().map_or(0, |begin| rows.line(begin)));
                    let problem = format!("cannot be read as CSV: {e}");
                    return Err(self.reader.error(format!("line {line}"), problem).into());
                }
            };
            let text = |cell: &lines::Cell| cell.text(rows.text());
            if let [cell] = rows.cells.as_slice()
                && text(cell).is_empty()
            {
                continue;
            }
            if rows.cells.len() != self.reader.header.len() {
                let (found, expected) = (rows.cells.len(), self.reader.header.len());
                // a decimal comma divides its number in two
                let hint = if found > expected && rows.cells.iter().skip(expected).all(|f| text(f).is_empty()) {
                    "; there is nothing behind the last separator: remove it"
                } else if found > expected && rows.cells.iter().any(|f| text(f).parse::<i64>().is_ok()) {
                    "; with decimal commas, separate the columns with semicolons or tabs"
                } else {
                    ""
                };
                let problem = format!("found {found} fields, expected {expected} as in the header{hint}");
                problems.push(self.reader.error(format!("line {line}"), problem));
                continue;
            }
            match (Cells { reader: &self.reader, row: &rows, line }.row(&self.slots, places)) {
                Ok(Some(row)) if problems.is_empty() => take(row)?,
                Ok(Some(_)) => {}
                Ok(None) => left_out.push(line),
                Err(e) => problems.push(e),
            }
        }
        all_in_one(problems).map_or(Ok(left_out), |e| Err(e.into()))
    }

    /// Refuses a row that goes back in time.
    pub fn in_order(&self, row: &Row, last_t: &mut f64) -> Result<()> {
        if let Some(t) = row.state.t {
            if t < *last_t {
                return Err(self.reader.error(
                    format!("line {}, column t_s", row.line),
                    format!("found {t} after {last_t}; expected rows in the order of time"),
                ));
            }
            *last_t = t;
        }
        Ok(())
    }
}

/// A recording that is being read.
pub(crate) struct Reading<'a> {
    parser: &'a Parser<'a>,
    joints: usize,
    rows: Vec<Row>,
    places: Places,
    last_t: f64,
    left_out: Vec<usize>,
}

impl<'a> Reading<'a> {
    pub fn new(parser: &'a Parser<'a>, joints: usize) -> Self {
        let (places, last_t) = (Places::default(), f64::NEG_INFINITY);
        Self { parser, joints, rows: Vec::new(), places, last_t, left_out: Vec::new() }
    }

    /// Takes more rows; lines are counted from `lines_before`.
    pub fn take(&mut self, rows: Lines<'_>, lines_before: usize) -> Result<()> {
        let Self { parser, rows: taken, places, last_t, .. } = self;
        let left_out = parser.each_row(rows, lines_before, places, &mut |row| {
            parser.in_order(&row, last_t)?;
            taken.push(row);
            Ok::<_, RecordError>(())
        })?;
        self.left_out.extend(left_out);
        Ok(())
    }

    /// The recording, of a file of which so much is `said`.
    pub fn end(self, said: impl IntoIterator<Item = String>) -> Result<Recording> {
        let name = self.parser.reader.file.to_owned();
        if self.rows.is_empty() {
            return Err(RecordError::File { file: name, problem: no_rows(&self.left_out).to_owned() });
        }
        let said: Vec<String> = said.into_iter().chain(left_out(&self.left_out)).collect();
        let notes = if said.is_empty() { Vec::new() } else { vec![format!("{name}: {}", said.join("; "))] };
        let (prismatic, places) = (Some(self.parser.prismatic()), self.places.into_names());
        Ok(Recording { name, joints: self.joints, prismatic, places, rows: self.rows, notes })
    }
}

/// Reads a CSV recording of an arm with `joints` joints.
///
/// # Errors
/// One sentence with file, line, column, what was found and what was expected.
pub fn load_csv(path: &Path, joints: usize) -> Result<Recording> {
    let name = path.display().to_string();
    let bytes = whole_lines(path)?;
    parse_csv(&bytes, &name, joints)
}

/// No row is this long, bytes.
pub(crate) const LONGEST_LINE: usize = 1 << 20;

/// The bytes of a file; one without ends of lines is given up before it fills the memory.
fn whole_lines(path: &Path) -> Result<Vec<u8>> {
    crate::bounds::check_file(path, true)?;
    let error = |problem: String| RecordError::File { file: path.display().to_string(), problem };
    let file = std::fs::File::open(path).map_err(|e| error(format!("cannot be read: {e}")))?;
    let (mut bytes, mut begin) = (Vec::new(), 0);
    loop {
        let from = bytes.len();
        let read = (&file).take(LONGEST_LINE as u64).read_to_end(&mut bytes);
        if read.map_err(|e| error(format!("cannot be read: {e}")))? == 0 {
            return Ok(bytes);
        }
        if let Some(at) = bytes[from..].iter().rposition(|b| *b == b'\n') {
            begin = from + at + 1;
        }
        if bytes.len() - begin > LONGEST_LINE {
            let line = 1 + ends_of_lines(&bytes[..begin]);
            return Err(error(format!(
                "line {line} is longer than {LONGEST_LINE} bytes; expected a recording, one measurement a line"
            )));
        }
    }
}

/// How recordings are read: lines end with \n, a \r before it is blank (the crate counts lines ending with both one too low).
pub(crate) fn csv_reader(has_headers: bool) -> csv::ReaderBuilder {
    let mut builder = csv::ReaderBuilder::new();
    builder.flexible(true).has_headers(has_headers).terminator(csv::Terminator::Any(b'\n'));
    builder
}

/// The names of the columns, as they are known, of a file that begins with these bytes.
pub(crate) fn header_names(begin: &[u8]) -> Vec<String> {
    tidy::decoded(begin).map(|(text, _)| tidy::names(&text)).unwrap_or_default()
}

/// What would have to be done to a file that begins with these bytes before it could be read row by row; `None` for nothing.
pub(crate) fn is_untidy(begin: &[u8]) -> Option<String> {
    // whole lines, lest a letter be cut
    let begin = begin.iter().rposition(|b| *b == b'\n').map_or(begin, |at| &begin[..at]);
    let (text, encoded) = tidy::decoded(begin)?;
    let separated_by_cr = !begin.contains(&b'\n') && begin.contains(&b'\r');
    let note = match tidy::tidied(&text) {
        Ok(tidied) => tidied.note,
        Err(problem) => Some(problem),
    };
    encoded
        .map(str::to_owned)
        .or(note)
        .or_else(|| separated_by_cr.then(|| "its lines end with a carriage return".to_owned()))
}

/// Whether rows below a header are as they should be, each beginning with a number and no cell quoted: such a file is read block by block. Of
/// others this may be so, too.
pub(crate) fn are_plain(rows: &str) -> bool {
    let bytes = rows.as_bytes();
    tidy::are_numbers(rows) && !lines::holds(bytes, b'"') && !lines::holds(bytes, 0)
}

/// What a file without rows is told.
pub(crate) fn no_rows(left_out: &[usize]) -> &'static str {
    if left_out.is_empty() { "has a header but no rows" } else { "has no row with a measured value" }
}

/// Reads the bytes of a CSV recording; `file` is its name for messages. UTF-16, separators, decimal commas, upper case, units in
/// brackets or in a line of their own, an index column, remarks and blank lines are understood where their meaning is certain, and rows without a
/// measured value are left out; [`Recording::notes`] says so.
///
/// # Errors
/// As [`load_csv`].
pub fn parse_csv(bytes: &[u8], file: &str, joints: usize) -> Result<Recording> {
    let problem = |p: &str| RecordError::File { file: file.to_owned(), problem: p.to_owned() };
    let (text, encoded) =
        tidy::decoded(bytes).ok_or_else(|| problem("is not a text file; expected a CSV recording"))?;
    let text = text.as_ref();
    if text.trim().is_empty() {
        return Err(problem("is empty; expected a CSV recording with a header line"));
    }
    let tidy::Tidied { text, before, note } = tidy::tidied(text).map_err(|p| problem(&p))?;
    let mut csv = csv_reader(true).from_reader(text.as_bytes());
    let header = csv.headers().map_err(|e| problem(&format!("the header cannot be read: {e}")))?.clone();
    let parser = Parser::new(file, &header, joints)?;
    let mut reading = Reading::new(&parser, joints);
    reading.take(Lines::of(csv, text.as_bytes()), before)?;
    reading.end(encoded.map(str::to_owned).into_iter().chain(note))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn a_line_that_does_not_end_is_told_with_its_number() {
        let path = tempfile::tempdir().unwrap().keep().join("long.csv");
        std::fs::write(&path, format!("a\nb\n{}", "x".repeat(3 * LONGEST_LINE))).unwrap();
        let e = whole_lines(&path).unwrap_err().to_string();
        std::fs::remove_dir_all(path.parent().unwrap()).unwrap();
        assert!(e.contains("line 3 is longer than"), "{e}");
    }
}
