//! CSV recordings of any size, read in passes, in memory that does not grow with their rows; a sample of their rows. Files are
//! cut into blocks of fixed size, whose results are joined in order: the number of threads changes no bit.

mod blocks;
mod large;
mod load;
mod sample;

use std::collections::BTreeMap;
use std::path::PathBuf;

use rayon::prelude::*;
use tempfile::TempDir;
use trical_model::{Recording, Row};

use crate::columns::Field;
use crate::csv::{Lines, Parser, csv_reader, no_rows};
use crate::error::{RecordError, Result};
use crate::shared::Places;
use blocks::{Block, Source};

pub use large::open_large;
pub(crate) use load::load;
pub use sample::{FIRST, SAMPLE, scatter};

/// Blocks at a time: what bounds the memory, and what threads can share.
const BATCH: usize = 8;

/// CSV recordings of one arm, opened to be read several times.
#[derive(Debug)]
pub struct CsvStream {
    files: Vec<Source>,
    joints: usize,
    /// What was no CSV, as CSV, while it is needed.
    _folder: Option<TempDir>,
}

/// A block of rows of one file.
pub struct BlockRows<'a> {
    parser: &'a Parser<'a>,
    block: &'a Block,
}

impl BlockRows<'_> {
    /// Which block of its file it is, from 0.
    #[must_use]
    pub fn number(&self) -> usize {
        self.block.number
    }

    /// Hands on every row, and returns the lines of those without a measured value.
    ///
    /// # Errors
    /// A row that is no measurement, with file, line and column; what `take` returns.
    pub fn each_row<E: From<RecordError>>(&self, take: &mut dyn FnMut(Row) -> Result<(), E>) -> Result<Vec<usize>, E> {
        let bytes = self.block.bytes.as_slice();
        let rows = Lines::of(csv_reader(false).from_reader(bytes), bytes);
        // files with places are not opened
        self.parser.each_row(rows, self.block.lines_before, &mut Places::default(), take)
    }
}

/// Rows that one block offers to the sample: those that are kept together, and whether they were picked.
struct Offered {
    rows: Vec<(Vec<Row>, bool)>,
    left_out: Vec<usize>,
    count: usize,
    first_t: Option<Row>,
    last_t: f64,
}

/// Rows of the whole that stand for it, file by file.
#[derive(Clone, Debug)]
pub struct Sample {
    /// As recordings.
    pub recordings: Vec<Recording>,
    /// Rows of the whole.
    pub rows: usize,
}

impl CsvStream {
    /// Opens recordings of an arm with `joints` joints and reads their headers.
    ///
    /// # Errors
    /// A file that cannot be read, or a header that is not a recording's. Places, since all of them must be known first.
    pub fn open(paths: &[PathBuf], joints: usize) -> Result<Self> {
        Self::open_as(paths.iter().map(|p| (p.clone(), p.display().to_string())), joints, None)
    }

    /// As [`Self::open`]; each file comes with the name that messages give it: a CSV in `folder` may stand for another recording.
    fn open_as(
        files: impl IntoIterator<Item = (PathBuf, String)>,
        joints: usize,
        folder: Option<TempDir>,
    ) -> Result<Self> {
        let files = files.into_iter().map(|(path, name)| Source::open(&path, name)).collect::<Result<Vec<_>>>()?;
        for f in &files {
            let parser = Parser::new(&f.name, &f.header, joints)?;
            if parser.has(Field::Place) {
                return Err(f.error(
                    "has a column place; recordings with places cannot be identified pass by pass, expected one without \
                     them or small enough for the memory",
                ));
            }
        }
        Ok(Self { files, joints, _folder: folder })
    }

    /// What the headers say of the recordings, without rows.
    fn heads(&self) -> Result<Vec<Recording>> {
        let head = |f: &Source| {
            let prismatic = Some(Parser::new(&f.name, &f.header, self.joints)?.prismatic());
            Ok(Recording { name: f.name.clone(), joints: self.joints, prismatic, ..Recording::default() })
        };
        self.files.iter().map(head).collect()
    }

    /// Bytes of all files.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.files.iter().map(|f| f.bytes).sum()
    }

    /// Hands every block of every file to `work`, many at a time, and its results to `merge` in order; both get the file's
    /// number (from 0) first.
    ///
    /// # Errors
    /// A file that cannot be read; what `work` and `merge` return.
    pub fn pass<T: Send, E: From<RecordError> + Send>(
        &self,
        work: impl Fn(usize, &BlockRows<'_>) -> Result<T, E> + Sync,
        merge: &mut dyn FnMut(usize, T) -> Result<(), E>,
    ) -> Result<(), E> {
        for (index, source) in self.files.iter().enumerate() {
            let parser = Parser::new(&source.name, &source.header, self.joints)?;
            let mut blocks = source.blocks(parser.has(Field::Reference).then_some(&parser))?;
            loop {
                let mut batch = Vec::with_capacity(BATCH);
                while batch.len() < BATCH
                    && let Some(block) = blocks.next()?
                {
                    batch.push(block);
                }
                if batch.is_empty() {
                    break;
                }
                let one = |block| work(index, &BlockRows { parser: &parser, block });
                let parts: Vec<Result<T, E>> = batch.par_iter().map(one).collect();
                for part in parts {
                    merge(index, part?)?;
                }
            }
        }
        Ok(())
    }

    /// The first pass: reads and checks every row, and keeps some.
    ///
    /// # Errors
    /// The first row that is not a measurement, with file, line and column, as for a recording in memory.
    pub fn sample(&self) -> Result<Sample> {
        let mut start = Vec::new();
        for source in &self.files {
            start.push(
                source
                    .blocks(None)?
                    .next()?
                    .map_or((0, 0), |b| (b.bytes.len() as u64, b.bytes.iter().filter(|c| **c == b'\n').count() as u64)),
            );
        }
        let lines: u64 =
            self.files.iter().zip(&start).map(|(f, (bytes, lines))| f.bytes * lines.max(&1) / bytes.max(&1)).sum();
        let every = lines.div_ceil(SAMPLE as u64).max(1);
        let mut recordings = self.heads()?;
        let mut rows = 0;
        let mut rows_of_file = vec![0; self.files.len()];
        let mut left_out = vec![Vec::new(); self.files.len()];
        let mut seen: BTreeMap<_, usize> = BTreeMap::new();
        let mut last_t = vec![f64::NEG_INFINITY; self.files.len()];
        self.pass(
            |index, rows| {
                let mut offered = Offered {
                    rows: Vec::new(),
                    left_out: Vec::new(),
                    count: 0,
                    first_t: None,
                    last_t: f64::NEG_INFINITY,
                };
                let mut seen: BTreeMap<_, usize> = BTreeMap::new();
                let mut offer = |together: &[Row]| {
                    let picked = together.first().is_some_and(|row| scatter(row.line, index).is_multiple_of(every));
                    if are_first(together, |row| row.measured.of_which(), &mut seen) || picked {
                        offered.rows.push((together.to_vec(), picked));
                    }
                };
                let whole_poses = rows.parser.has(Field::Reference);
                let mut pose: Vec<Row> = Vec::new();
                let left_out = rows.each_row(&mut |row| {
                    rows.parser.in_order(&row, &mut offered.last_t)?;
                    if offered.first_t.is_none() && row.state.t.is_some() {
                        offered.first_t = Some(row);
                    }
                    offered.count += 1;
                    if !whole_poses {
                        offer(std::slice::from_ref(&row));
                        return Ok::<_, RecordError>(());
                    }
                    if pose.last().is_some_and(|last| !at_one_pose(last, &row)) {
                        offer(&pose);
                        pose.clear();
                    }
                    pose.push(row);
                    Ok(())
                })?;
                offer(&pose);
                Ok(Offered { left_out, ..offered })
            },
            &mut |index, offered: Offered| {
                let source = &self.files[index];
                if let Some(row) = &offered.first_t {
                    Parser::new(&source.name, &source.header, self.joints)?.in_order(row, &mut last_t[index])?;
                    last_t[index] = offered.last_t;
                }
                left_out[index].extend(offered.left_out);
                rows += offered.count;
                rows_of_file[index] += offered.count;
                let rows = &mut recordings[index].rows;
                for (together, picked) in offered.rows {
                    let are_first = are_first(&together, |row| (index, row.measured.of_which()), &mut seen);
                    // another visit to the same joints would be taken for the same pose
                    let again = together.len() > 1 && rows.last().is_some_and(|last| at_one_pose(last, &together[0]));
                    if (picked || are_first) && !again {
                        rows.extend(together);
                    }
                }
                Ok(())
            },
        )?;
        if let Some(k) = rows_of_file.iter().position(|n| *n == 0) {
            return Err(self.files[k].error(no_rows(&left_out[k])));
        }
        for (recording, lines) in recordings.iter_mut().zip(&left_out) {
            recording.notes.extend(crate::csv::left_out(lines).map(|said| format!("{}: {said}", recording.name)));
        }
        Ok(Sample { recordings, rows })
    }
}

/// Whether some of the rows are among the first of their sort, `seen` so often before.
fn are_first<T: Ord>(rows: &[Row], sort: impl Fn(&Row) -> T, seen: &mut BTreeMap<T, usize>) -> bool {
    rows.iter().fold(false, |any, row| {
        let before = seen.entry(sort(row)).or_insert(0);
        *before += 1;
        any || *before <= FIRST
    })
}

/// Whether two rows, one after the other, are of one pose, be it by the joints that were reported or by those that were commanded.
fn at_one_pose(a: &Row, b: &Row) -> bool {
    a.state.q == b.state.q || a.state.q_commanded.is_some() && a.state.q_commanded == b.state.q_commanded
}
