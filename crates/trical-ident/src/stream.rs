//! Identification from CSV recordings of any size, in memory that does not grow with their rows.
//!
//! 1. *Sample*: one pass reads and checks every row and keeps some [`SAMPLE`] of them, chosen by a hash of their lines, and the
//!    first of each sort (ball, target, anchor). The sample is identified as any other data: gross errors, start, fit.
//! 2. *Passes*: from the sample's solution, every row adds to the triangular factor of `[J r]`; its step is Gauss-Newton's, and
//!    the passes end when a step is below what the data can tell. The first step is as long as the sample is uncertain, and
//!    the error of a step is of second order, so that two passes do.
//!
//! Gross errors are judged row by row as in memory, by the robust fit of the richest model, which here has seen the sample.
//! QR keeps the digits that normal equations would square away. Files are cut into blocks of fixed size whose factors are
//! joined in order: the number of threads changes no bit.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use trical_model::{Cell, Forward, Measured, Recording, Robot, Row};

use crate::dataset::{Dataset, JointSource, Observation, Rejected};
use crate::error::{IdentError, Result};
use crate::gross::{GROSS, gross_error, right_ball, robust_fit_of_the_richest};
use crate::identifiability::{Choice, ParameterSet, covariance, indices, spectrum};
use crate::identify::{CONDITION_LIMIT, ErrorSummary, Identified, identify, rank_deficient, tells_apart};
use crate::noise::{Noise, Squares};
use crate::normal::{Keep, Rows};
use crate::recording_csv::{Parser, csv_reader};
use crate::solver::{Ended, LmReport};

/// Rows that are kept in memory, about.
pub const SAMPLE: usize = 8192;

/// CSV recordings beyond this are better read in passes, bytes: some 300 000 touches.
pub const LARGE: u64 = 32 << 20;

/// Rows of each sort that are always among them.
const FIRST: usize = 40;

/// Bytes of a block.
const BLOCK: usize = 1 << 20;

/// Blocks at a time: what bounds the memory, and what threads can share.
const BATCH: usize = 8;

/// Rejected rows that are named; the rest is counted.
const NAMED: usize = 1000;

/// Passes over the files before it is given up.
const PASSES: usize = 10;

/// Steps below this fraction of every parameter's standard deviation end the passes.
const SMALL: f64 = 1e-2;

/// CSV recordings of one arm, opened to be read several times.
#[derive(Debug)]
pub struct CsvStream {
    files: Vec<Source>,
    joints: usize,
}

#[derive(Debug)]
struct Source {
    path: PathBuf,
    name: String,
    header: csv::StringRecord,
    /// Where the rows begin.
    offset: u64,
    bytes: u64,
}

/// Whole lines of a file.
struct Block {
    bytes: Vec<u8>,
    lines_before: usize,
}

struct Blocks<'a> {
    source: &'a Source,
    file: File,
    carry: Vec<u8>,
    lines: usize,
}

impl Source {
    fn error(&self, problem: impl Into<String>) -> IdentError {
        IdentError::File { file: self.name.clone(), problem: problem.into() }
    }

    fn open(path: &Path, name: String) -> Result<Self> {
        let mut this = Self { path: path.to_owned(), name, header: csv::StringRecord::new(), offset: 0, bytes: 0 };
        let file = File::open(path).map_err(|e| this.error(format!("cannot be read: {e}")))?;
        this.bytes = file.metadata().map_err(|e| this.error(format!("cannot be read: {e}")))?.len();
        let mut line = Vec::new();
        let mut reader = BufReader::new(file).take(BLOCK as u64);
        reader.read_until(b'\n', &mut line).map_err(|e| this.error(format!("cannot be read: {e}")))?;
        this.offset = line.len() as u64;
        let text =
            std::str::from_utf8(&line).map_err(|_| this.error("is not a text file; expected a CSV recording"))?;
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        if text.trim().is_empty() {
            return Err(this.error("is empty; expected a CSV recording with a header line"));
        }
        let mut csv = csv_reader(false).from_reader(text.as_bytes());
        let mut header = csv::StringRecord::new();
        csv.read_record(&mut header).map_err(|e| this.error(format!("the header cannot be read: {e}")))?;
        this.header = header;
        Ok(this)
    }

    fn blocks(&self) -> Result<Blocks<'_>> {
        let mut file = File::open(&self.path).map_err(|e| self.error(format!("cannot be read: {e}")))?;
        file.seek(SeekFrom::Start(self.offset)).map_err(|e| self.error(format!("cannot be read: {e}")))?;
        Ok(Blocks { source: self, file, carry: Vec::new(), lines: 1 })
    }
}

impl Blocks<'_> {
    fn next(&mut self) -> Result<Option<Block>> {
        let mut bytes = std::mem::take(&mut self.carry);
        let old = bytes.len();
        bytes.resize(BLOCK, 0);
        let mut filled = old;
        while filled < BLOCK {
            match self.file.read(&mut bytes[filled..]) {
                Ok(0) => break,
                Ok(n) => filled += n,
                Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                Err(e) => return Err(self.source.error(format!("cannot be read: {e}"))),
            }
        }
        bytes.truncate(filled);
        if bytes.is_empty() {
            return Ok(None);
        }
        if filled == BLOCK {
            let Some(end) = bytes.iter().rposition(|b| *b == b'\n') else {
                return Err(self.source.error(format!(
                    "line {} is longer than {BLOCK} bytes; expected a recording, one measurement a line",
                    self.lines + 1
                )));
            };
            self.carry = bytes.split_off(end + 1);
        }
        let lines_before = self.lines;
        self.lines += bytes.iter().filter(|b| **b == b'\n').count();
        Ok(Some(Block { bytes, lines_before }))
    }
}

/// Which ball, target or anchor: rows of which the model sees different things.
fn sort_of(m: &Measured) -> (u8, usize) {
    match m {
        Measured::Touch { ball, .. } => (0, *ball),
        Measured::Point { target, .. } => (1, *target),
        Measured::Distance { anchor, .. } => (2, *anchor),
        Measured::Pose { .. } => (3, 0),
        Measured::Reference { reference, .. } => (4, *reference),
    }
}

/// A hash of a line's number (Steele, Lea & Flood 2014): picks that follow no pattern of the recording.
fn scatter(line: usize, file: usize) -> u64 {
    let mut z = (line as u64).wrapping_add((file as u64) << 48).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
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

/// Errors of many rows: what needs no list of them.
#[derive(Clone, Copy, Debug, Default)]
struct ErrorSums {
    n: f64,
    sum: f64,
    square: f64,
    max: f64,
}

impl ErrorSums {
    fn add(&mut self, e: f64) {
        self.n += 1.0;
        self.sum += e;
        self.square += e * e;
        self.max = self.max.max(e);
    }

    fn join(&mut self, other: &Self) {
        self.n += other.n;
        self.sum += other.sum;
        self.square += other.square;
        self.max = self.max.max(other.max);
    }

    /// With the median of the sample.
    fn summary(&self, sample: &[f64]) -> ErrorSummary {
        let n = self.n.max(1.0);
        let mean = self.sum / n;
        let spread = (self.square - self.sum * mean).max(0.0) / (n - 1.0).max(1.0);
        ErrorSummary {
            mean_mm: mean * 1e3,
            max_mm: self.max * 1e3,
            sd_mm: spread.sqrt() * 1e3,
            median_mm: crate::rigid::median(sample) * 1e3,
            rms_mm: (self.square / n).sqrt() * 1e3,
        }
    }
}

/// What was identified from a stream.
#[derive(Clone, Debug)]
pub struct Streamed {
    /// As from any data, except that its data is the sample; parameters, covariance and observability are those of all rows.
    pub identified: Identified,
    /// Rows that were used.
    pub observations: usize,
    /// Rows that were not.
    pub rejected: usize,
    /// The first of them, by name.
    pub named: Vec<Rejected>,
    /// Position errors at all rows; the median is that of the sample.
    pub errors: ErrorSummary,
    /// Those of the nominal arm, its frame and tool identified on the sample.
    pub before: ErrorSummary,
    /// Passes over the files after the first.
    pub passes: usize,
}

/// Sums of one pass, or of one block of it.
struct Sums {
    rows: Rows,
    squares: Squares,
    count: usize,
    rejected: usize,
    named: Vec<Rejected>,
    after: ErrorSums,
    before: ErrorSums,
}

impl Sums {
    fn new(p: usize, recordings: usize) -> Self {
        Self {
            rows: Rows::new(p, Keep::Factor),
            squares: Squares::new(recordings),
            count: 0,
            rejected: 0,
            named: Vec::new(),
            after: ErrorSums::default(),
            before: ErrorSums::default(),
        }
    }

    fn join(&mut self, mut other: Self) {
        self.rows.add(&other.rows);
        self.squares.join(&other.squares);
        for r in &mut other.named {
            r.row += self.count + self.rejected;
        }
        self.count += other.count;
        self.rejected += other.rejected;
        self.named.extend(other.named);
        self.named.truncate(NAMED);
        self.after.join(&other.after);
        self.before.join(&other.before);
    }
}

/// What judges every row of a pass.
struct Judges<'a> {
    fit: &'a Forward,
    noise: &'a Noise,
    nominal: &'a Forward,
    /// The robust fit and its noise, unless gross errors are to be kept.
    robust: Option<&'a (Forward, Noise)>,
}

/// Identifies the parameters of `choice` from all rows of `stream`; `data` is its sample as observations (gross errors already
/// rejected, unless `keep_outliers`).
///
/// # Errors
/// As [`identify`] for the sample, and a row of the whole that the model cannot predict, or passes that do not converge.
pub fn identify_stream(
    robot: &Robot,
    cell: &Cell,
    stream: &CsvStream,
    data: &Dataset,
    choice: impl Into<Choice>,
    keep_outliers: bool,
) -> Result<Streamed> {
    let start = identify(robot, cell, data, choice)?;
    let nominal = identify(robot, cell, data, ParameterSet::Nominal)?;
    let robust = if keep_outliers { None } else { Some(robust_fit_of_the_richest(robot, cell, data)?) };
    let before = Forward::new(nominal.model, Vec::new())?;
    let before_of_sample = crate::fit::position_errors(&before, data);
    let p = start.free.len();
    let mut fit = Forward::new(start.model, start.free.clone())?;
    let mut noise = start.noise;
    let mut last_cost = f64::INFINITY;
    for pass in 1..=PASSES {
        let judges = Judges { fit: &fit, noise: &noise, nominal: &before, robust: robust.as_ref() };
        let mut sums = Sums::new(p, data.names.len());
        stream.pass(|index, parser, block| add_up(&judges, data, index, parser, block), &mut |_, part| {
            sums.join(part);
            Ok(())
        })?;
        let Some(whole) = sums.rows.factor() else { return Err(not_converged("no rows")) };
        let r = whole.submatrix(0, 0, p, p).to_owned();
        let Some((scale, singular)) = spectrum(&r).filter(|(_, s)| tells_apart(s)) else {
            let names: Vec<String> = start.free.iter().map(|k| fit.model().terms[*k].name.clone()).collect();
            let weak = crate::identifiability::weakest_direction(&r, &names, CONDITION_LIMIT).unwrap_or(names);
            return Err(rank_deficient(robot, data, &weak));
        };
        // Gauss-Newton: R dx = -Q'r
        let mut step: Vec<f64> = (0..p).map(|i| -whole[(i, p)]).collect();
        for i in (0..p).rev() {
            let sum: f64 = (i + 1..p).map(|j| r[(i, j)] * step[j]).sum();
            step[i] = (step[i] - sum) / r[(i, i)];
        }
        let covariance = covariance(&r, &scale);
        let cost = 0.5 * sums.squares.total();
        let freedom = (sums.squares.count() - f64::from(u32::try_from(p).unwrap_or(u32::MAX))).max(1.0);
        let variance = 2.0 * cost / freedom;
        let sd: Vec<f64> = (0..p).map(|k| (covariance[k * p + k] * variance).max(0.0).sqrt()).collect();
        let size = step.iter().zip(&sd).map(|(d, sd)| d.abs() / sd.max(1e-300)).fold(0.0, f64::max);
        let mut updated = noise.clone();
        let one_group = updated.update_from(&sums.squares, p).is_some();
        if size < SMALL && (one_group || pass > 2) {
            let length = (2.0 * cost).sqrt().max(1e-300);
            let gradient = (0..p)
                .map(|j| ((0..=j).map(|i| r[(i, j)] * whole[(i, p)]).sum::<f64>() / (scale[j] * length)).abs())
                .fold(0.0, f64::max);
            let covariance: Vec<f64> = covariance.iter().map(|c| c * variance).collect();
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
            let scalars = sums.squares.count() as usize;
            let mut model = fit.into_model();
            for (k, index) in start.free.iter().enumerate() {
                model.terms[*index].sd = Some(sd[k]);
            }
            let after = crate::fit::position_errors(&Forward::new(model.clone(), Vec::new())?, data);
            let report = LmReport { iterations: pass, cost, gradient, ended: Ended::Step };
            return Ok(Streamed {
                observations: sums.count,
                rejected: sums.rejected,
                named: sums.named,
                errors: sums.after.summary(&after),
                before: sums.before.summary(&before_of_sample),
                passes: pass,
                identified: Identified {
                    model,
                    free: start.free,
                    at_limit: Vec::new(),
                    data: data.clone(),
                    noise: updated,
                    covariance,
                    observability: indices(&singular, scalars),
                    dependent: start.dependent,
                    report,
                },
            });
        }
        // the rows under one noise only are comparable from pass to pass
        if one_group && cost > last_cost * (1.0 + 1e-9) {
            return Err(not_converged("a step that the whole file asks for makes it worse"));
        }
        last_cost = cost;
        if !one_group && pass <= 2 {
            noise = updated;
        }
        let x: Vec<f64> = fit.coefficients().iter().zip(&step).map(|(x, d)| x + d).collect();
        fit.set_coefficients(&x);
    }
    Err(not_converged(&format!("{PASSES} passes over the file")))
}

fn not_converged(what: &str) -> IdentError {
    IdentError::NotConverged(format!("{what}; are robot.toml and cell.toml those of this arm?"))
}

/// One block's share of a pass.
fn add_up(judges: &Judges<'_>, data: &Dataset, index: usize, parser: &Parser<'_>, block: &Block) -> Result<Sums> {
    let name = &data.names[index];
    let mut sums = Sums::new(judges.fit.free().len(), data.names.len());
    let mut ws = judges.fit.workspace();
    let mut ws_nominal = judges.nominal.workspace();
    let mut ws_robust = judges.robust.map(|r| r.0.workspace());
    let length = |r: &[f64; 6], rows: usize| r[..rows.min(3)].iter().map(|v| v * v).sum::<f64>().sqrt();
    each_row(parser, block, &mut |row| {
        let place = || format!("line {}", row.line);
        let mut state = row.state;
        if data.joints == JointSource::Commanded {
            state.q = state.q_commanded.ok_or_else(|| IdentError::Recording {
                file: name.clone(),
                place: place(),
                problem: "has no commanded joints (qc1_deg ...), but --joints commanded was asked for".into(),
            })?;
        }
        let frame = data.frame_of_recording[index].unwrap_or(0);
        let number = sums.count + sums.rejected + 1;
        let o = Observation {
            state,
            measured: row.measured,
            frame,
            pose: 0,
            recording: index,
            row: number,
            line: row.line,
        };
        judges.fit.check(&o.state, &o.measured, o.frame).map_err(|e| IdentError::Recording {
            file: name.clone(),
            place: place(),
            problem: e.to_string(),
        })?;
        if let (Some((robust, noise)), Some(ws)) = (judges.robust, &mut ws_robust) {
            let rows = robust.residual(&o.state, &o.measured, o.frame, ws);
            let r = ws.residual();
            let off = (0..rows).map(|k| (r[k] / noise.sigma(index, &o.measured, k)).powi(2)).sum::<f64>().sqrt();
            if off > GROSS || off.is_nan() {
                sums.rejected += 1;
                if sums.named.len() < NAMED {
                    sums.named.push(Rejected {
                        recording: name.clone(),
                        line: row.line,
                        row: number,
                        reason: gross_error(length(r, rows), off, right_ball(robust, noise, &o, ws)),
                    });
                }
                return Ok(());
            }
        }
        let rows = judges.nominal.residual(&o.state, &o.measured, o.frame, &mut ws_nominal);
        sums.before.add(length(ws_nominal.residual(), rows));
        sums.rows.observe(judges.fit, &mut ws, &o, judges.noise, f64::INFINITY);
        sums.after.add(length(ws.residual(), rows));
        let weighted: [f64; 6] = std::array::from_fn(|k| {
            if k < rows { ws.residual()[k] / judges.noise.sigma(index, &o.measured, k) } else { 0.0 }
        });
        sums.squares.add(index, &o.measured, &weighted[..rows]);
        sums.count += 1;
        Ok(())
    })?;
    sums.rows.finish();
    Ok(sums)
}
