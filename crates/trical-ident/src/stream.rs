//! Identification from CSV recordings of any size, in memory that does not grow with their rows.
//!
//! 1. *Sample*: one pass reads and checks every row and keeps some [`SAMPLE`] of them, chosen by a hash of their lines, and the
//!    first of each sort (ball, target, anchor). The sample is identified as any other data: gross errors, start, fit.
//! 2. *Passes*: from the sample's solution, every row adds to sums over `[J r]`; their step is Gauss-Newton's, and the passes
//!    end when a step is below what the data can tell. The first step is as long as the sample is uncertain, and the error of a
//!    step is of second order, so that two passes do.
//!
//! Gross errors are judged row by row as in memory, in the first of the passes, by the robust fit of the richest model, which here
//! has seen the sample. The sums are products where the sample is far from losing rank, else orthogonal factors, which keep the
//! digits that products would square away. Files are cut into blocks of fixed size whose factors are
//! joined in order: the number of threads changes no bit.

mod blocks;
mod passes;

use std::collections::BTreeMap;
use std::path::PathBuf;

use rayon::prelude::*;
use trical_model::{Recording, Row};

use blocks::{Block, Source};
pub use passes::{Streamed, identify_stream};

use crate::error::Result;
use crate::recording_csv::{Parser, csv_reader};
pub use crate::sample::SAMPLE;
use crate::sample::{FIRST, scatter, sort_of};

/// CSV recordings beyond this are better read in passes, bytes: some 300 000 touches.
pub const LARGE: u64 = 32 << 20;

/// Blocks at a time: what bounds the memory, and what threads can share.
const BATCH: usize = 8;

/// CSV recordings of one arm, opened to be read several times.
#[derive(Debug)]
pub struct CsvStream {
    files: Vec<Source>,
    joints: usize,
}

/// Rows that one block offers to the sample.
struct Offered {
    rows: Vec<(Row, bool)>,
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
    /// A file that cannot be read, or a header that is not a recording's. Fixed references, since a pose is registered by them
    /// with a view to all others.
    pub fn open(paths: &[PathBuf], joints: usize) -> Result<Self> {
        Self::open_as(paths.iter().map(|p| (p.clone(), p.display().to_string())), joints)
    }

    /// As [`Self::open`]; each file comes with the name that messages give it: a CSV may stand for another recording.
    ///
    /// # Errors
    /// As there.
    pub fn open_as(files: impl IntoIterator<Item = (PathBuf, String)>, joints: usize) -> Result<Self> {
        let files = files.into_iter().map(|(path, name)| Source::open(&path, name)).collect::<Result<Vec<_>>>()?;
        for f in &files {
            if Parser::new(&f.name, &f.header, joints)?.has_references() {
                return Err(f.error(
                    "has a column reference; recordings with fixed references cannot be identified pass by pass, expected \
                     one without them or small enough for the memory",
                ));
            }
        }
        Ok(Self { files, joints })
    }

    /// Bytes of all files.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.files.iter().map(|f| f.bytes).sum()
    }

    /// Hands every block of every file to `work`, many at a time, and its results to `merge` in order.
    fn pass<T: Send>(
        &self,
        work: impl Fn(usize, &Parser<'_>, &Block) -> Result<T> + Sync,
        merge: &mut dyn FnMut(usize, T) -> Result<()>,
    ) -> Result<()> {
        for (index, source) in self.files.iter().enumerate() {
            let parser = Parser::new(&source.name, &source.header, self.joints)?;
            let mut blocks = source.blocks()?;
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
                let parts: Vec<Result<T>> = batch.par_iter().map(|block| work(index, &parser, block)).collect();
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
                    .blocks()?
                    .next()?
                    .map_or((0, 0), |b| (b.bytes.len() as u64, b.bytes.iter().filter(|c| **c == b'\n').count() as u64)),
            );
        }
        let lines: u64 =
            self.files.iter().zip(&start).map(|(f, (bytes, lines))| f.bytes * lines.max(&1) / bytes.max(&1)).sum();
        let every = lines.div_ceil(SAMPLE as u64).max(1);
        let mut recordings: Vec<Recording> = self
            .files
            .iter()
            .map(|f| Recording { name: f.name.clone(), joints: self.joints, rows: Vec::new() })
            .collect();
        let mut rows = 0;
        let mut rows_of_file = vec![0; self.files.len()];
        let mut seen: BTreeMap<(usize, (u8, usize)), usize> = BTreeMap::new();
        let mut last_t = vec![f64::NEG_INFINITY; self.files.len()];
        self.pass(
            |index, parser, block| {
                let mut offered = Offered { rows: Vec::new(), count: 0, first_t: None, last_t: f64::NEG_INFINITY };
                let mut seen: BTreeMap<(u8, usize), usize> = BTreeMap::new();
                each_row(parser, block, &mut |row| {
                    parser.in_order(&row, &mut offered.last_t)?;
                    if offered.first_t.is_none() && row.state.t.is_some() {
                        offered.first_t = Some(row);
                    }
                    offered.count += 1;
                    let picked = scatter(row.line, index).is_multiple_of(every);
                    let before = seen.entry(sort_of(&row.measured)).or_insert(0);
                    *before += 1;
                    if picked || *before <= FIRST {
                        offered.rows.push((row, picked));
                    }
                    Ok(())
                })?;
                Ok(offered)
            },
            &mut |index, offered: Offered| {
                let source = &self.files[index];
                if let Some(row) = &offered.first_t {
                    Parser::new(&source.name, &source.header, self.joints)?.in_order(row, &mut last_t[index])?;
                    last_t[index] = offered.last_t;
                }
                rows += offered.count;
                rows_of_file[index] += offered.count;
                for (row, picked) in offered.rows {
                    let before = seen.entry((index, sort_of(&row.measured))).or_insert(0);
                    *before += 1;
                    if picked || *before <= FIRST {
                        recordings[index].rows.push(row);
                    }
                }
                Ok(())
            },
        )?;
        if let Some(k) = rows_of_file.iter().position(|n| *n == 0) {
            return Err(self.files[k].error("has a header but no rows"));
        }
        Ok(Sample { recordings, rows })
    }
}

fn each_row(parser: &Parser<'_>, block: &Block, take: &mut dyn FnMut(Row) -> Result<()>) -> Result<()> {
    let mut csv = csv_reader(false).from_reader(block.bytes.as_slice());
    parser.each_row(&mut csv, block.lines_before, take)
}
