//! Recordings written as CSV, at once or row by row.

use std::fmt::Write as _;
use std::io::Write;

use trical_model::robot::tidy;
use trical_model::{Measured, Recording, Row};

use crate::columns::{COLUMNS, Column, FIELDS, Field, Unit, Value, value};
use crate::shared::Shared;

/// Writes a recording as CSV, with the columns that it has anything for.
///
/// # Errors
/// The operating system's.
pub fn write_csv(recording: &Recording, out: &mut dyn Write) -> std::io::Result<()> {
    let mut layout = Layout::default();
    recording.rows.iter().for_each(|r| layout.see(r));
    let mut csv = CsvWriter::new(out, &layout, Shared::of(recording))?;
    recording.rows.iter().try_for_each(|r| csv.write(r))?;
    csv.finish()
}

/// Which columns a CSV needs: those that any of its rows has something for.
#[derive(Clone, Debug, Default)]
pub struct Layout {
    needed: [bool; FIELDS],
}

impl Layout {
    /// Makes room for what `row` has.
    pub fn see(&mut self, row: &Row) {
        for (needed, column) in self.needed.iter_mut().zip(&COLUMNS) {
            // a row without a target is at the first one
            let implied = column.field == Field::Target && matches!(row.measured, Measured::Point { target: 0, .. });
            *needed |= !implied && value(row, column.field, 0).is_some();
        }
        // else a row without a reference would read as one with a target
        self.needed[Field::Target as usize] |= self.needed[Field::Reference as usize];
    }
}

/// Writes rows as CSV one after the other.
pub struct CsvWriter<W: Write> {
    csv: csv::Writer<W>,
    /// The columns in their order: group, component, unit.
    cells: Vec<(&'static Column, usize, Unit)>,
    shared: Shared,
    text: String,
}

impl<W: Write> CsvWriter<W> {
    /// Writes the header line. All rows that follow must have been seen by `layout`.
    ///
    /// # Errors
    /// The operating system's.
    pub fn new(out: W, layout: &Layout, shared: Shared) -> std::io::Result<Self> {
        // a name that begins with the sign of remarks is quoted
        let mut csv = csv::WriterBuilder::new().comment(Some(b'#')).from_writer(out);
        let mut cells = Vec::new();
        for column in COLUMNS.iter().filter(|c| c.field == Field::Joints || layout.needed[c.field as usize]) {
            for k in 0..column.width(shared.joints) {
                let unit = column.unit(k, &shared.prismatic);
                csv.write_field(column.name(k, unit))?;
                cells.push((column, k, unit));
            }
        }
        csv.write_record(None::<&[u8]>)?;
        Ok(Self { csv, cells, shared, text: String::new() })
    }

    /// Writes a row.
    ///
    /// # Errors
    /// The operating system's.
    pub fn write(&mut self, row: &Row) -> std::io::Result<()> {
        for (column, k, unit) in &self.cells {
            let text = &mut self.text;
            text.clear();
            // writing to a string cannot fail
            let _ = match value(row, column.field, *k) {
                None => Ok(()),
                // what a conversion to mm or degrees adds behind the last decimals is no information
                Some(Value::Number(v)) if matches!(unit, Unit::Degree | Unit::Millimetre) => {
                    write!(text, "{}", tidy(unit.from_si(v)))
                }
                Some(Value::Number(v)) => write!(text, "{v}"),
                Some(Value::Whole(n)) => write!(text, "{n}"),
                Some(Value::Sign(s)) => write!(text, "{s}"),
                Some(Value::Count(n)) => write!(text, "{}", n + 1),
                Some(Value::Place(n)) => write!(text, "{}", self.shared.place(n)),
            };
            self.csv.write_field(&*text)?;
        }
        Ok(self.csv.write_record(None::<&[u8]>)?)
    }

    /// Hands all to the file.
    ///
    /// # Errors
    /// The operating system's.
    pub fn finish(mut self) -> std::io::Result<()> {
        self.csv.flush()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// A file on a disk that is full: nothing is told before what was kept back is handed on.
    struct Full;

    impl Write for Full {
        fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
            Err(std::io::ErrorKind::StorageFull.into())
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_full_disk_is_told_at_the_end_at_the_latest() {
        let out = CsvWriter::new(Full, &Layout::default(), Shared::default()).unwrap();
        assert_eq!(out.finish().unwrap_err().kind(), std::io::ErrorKind::StorageFull);
    }
}
