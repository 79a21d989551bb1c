//! Identification from CSV recordings of any size, in memory that does not grow with their rows.
//!
//! 1. *Sample*: one pass reads and checks every row and keeps some of them ([`CsvStream::sample`]). The sample is identified as
//!    any other data: gross errors, start, fit.
//! 2. *Passes*: from the sample's solution, every row adds to sums over `[J r]`; their step is Gauss-Newton's, and the passes
//!    end when a step is below what the data can tell. The first step is as long as the sample is uncertain, and the error of a
//!    step is of second order, so that two passes do.
//!
//! Poses with fixed references are registered by the places that these have in the sample.
//!
//! Gross errors are judged row by row as in memory, in the first of the passes, by the robust fit of the richest model, which here
//! has seen the sample. The sums are products where the sample is far from losing rank, else orthogonal factors, which keep the
//! digits that products would square away. Sums of blocks are joined in order: the number of threads changes no bit.

use trical_model::{Cell, Forward, Joints, Measured, Model, Robot, Workspace};
use trical_recording::CsvStream;
use trical_recording::stream::BlockRows;

use crate::dataset::references::{References, Seen, move_by};
use crate::dataset::{Dataset, Observation, Rejected};
use crate::dense::Mat;
use crate::error::{IdentError, Result};
use crate::fit::choice::{Choice, ParameterSet};
use crate::fit::gross_errors::{GROSS, gross_error, right_ball, robust_fit_of_the_richest};
use crate::fit::identifiability::{WELL_CONDITIONED, covariance, indices, is_well_conditioned};
use crate::fit::identify::{ErrorSummary, Identified, identify, rank_deficient, tells_apart};
use crate::fit::levenberg_marquardt::{Ended, Factored, LmReport};
use crate::fit::noise::{Noise, Squares};
use crate::fit::normal_equations::{Keep, Rows};
use crate::fit::residuals::{length, weighted};

/// Rejected rows that are named; the rest is counted.
const NAMED: usize = 1000;

/// Passes over the files before it is given up.
const PASSES: usize = 10;

/// Steps below this fraction of every parameter's standard deviation end the passes.
const SMALL: f64 = 1e-2;

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
    /// Position errors of the nominal arm, its frame and tool identified on the sample.
    pub before: ErrorSummary,
    /// Passes over the files after the first.
    pub passes: usize,
}

/// Rows of a block that are not used, one bit each; shorter where the last ones are.
#[derive(Clone, Debug, Default)]
struct Marks(Vec<u64>);

impl Marks {
    fn set(&mut self, row: usize) {
        if self.0.len() <= row / 64 {
            self.0.resize(row / 64 + 1, 0);
        }
        if let Some(word) = self.0.get_mut(row / 64) {
            *word |= 1 << (row % 64);
        }
    }

    fn has(&self, row: usize) -> bool {
        self.0.get(row / 64).is_some_and(|word| word >> (row % 64) & 1 == 1)
    }
}

/// What the first pass finds out about all rows; the others need not ask again.
#[derive(Default)]
struct Verdict {
    rows: usize,
    rejected: usize,
    named: Vec<Rejected>,
    before: ErrorSums,
    /// Of every block of every file.
    marks: Vec<Vec<Marks>>,
}

impl Verdict {
    /// Adds that of a block of file `index`, which comes behind all others so far.
    fn join(&mut self, index: usize, mut block: BlockVerdict) {
        for r in &mut block.named {
            r.row += self.rows;
        }
        self.rows += block.rows;
        self.rejected += block.rejected;
        self.named.extend(block.named);
        self.named.truncate(NAMED);
        self.before.join(&block.before);
        self.marks.resize_with(self.marks.len().max(index + 1), Vec::new);
        if let Some(marks) = self.marks.get_mut(index) {
            marks.push(block.marks);
        }
    }
}

/// What the first pass finds out about the rows of one block, which are counted from 1.
#[derive(Default)]
struct BlockVerdict {
    rows: usize,
    rejected: usize,
    named: Vec<Rejected>,
    before: ErrorSums,
    marks: Marks,
}

impl BlockVerdict {
    /// An observation is not used, for this reason.
    fn reject(&mut self, o: &Observation, name: &str, reason: impl FnOnce() -> String) {
        self.rejected += 1;
        self.marks.set(o.row - 1);
        if self.named.len() < NAMED {
            self.named.push(Rejected { recording: name.to_owned(), line: o.line, row: o.row, reason: reason() });
        }
    }
}

/// Sums of one pass, or of one block of it.
struct Sums {
    rows: Rows,
    squares: Squares,
    count: usize,
    after: ErrorSums,
    /// Of a block in the first pass.
    verdict: Option<BlockVerdict>,
}

impl Sums {
    fn new(p: usize, recordings: usize, keep: Keep) -> Self {
        Self {
            rows: Rows::new(p, keep),
            squares: Squares::new(recordings),
            count: 0,
            after: ErrorSums::default(),
            verdict: None,
        }
    }

    fn join(&mut self, other: &Self) {
        self.rows.add(&other.rows);
        self.squares.join(&other.squares);
        self.count += other.count;
        self.after.join(&other.after);
    }
}

/// What rows are judged by in the first pass.
struct Judges<'a> {
    nominal: &'a Forward,
    /// The robust fit and its noise, unless gross errors are to be kept.
    robust: Option<&'a (Forward, Noise)>,
}

/// What all blocks of a pass share.
struct Pass<'a> {
    fit: &'a Forward,
    noise: &'a Noise,
    data: &'a Dataset,
    keep: Keep,
    judges: Judges<'a>,
    /// What the first pass has found; `None` in that one.
    known: Option<&'a Verdict>,
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
    let before_of_sample = crate::fit::residuals::position_errors(&before, data);
    let p = start.free.len();
    let mut fit = Forward::new(start.model.clone(), start.free.clone())?;
    let mut noise = start.noise.clone();
    let mut last_cost = f64::INFINITY;
    let mut verdict: Option<Verdict> = None;
    // sums of products are cheaper, and keep the digits where the sample is far from losing rank
    let mut keep = if start.observability.condition < WELL_CONDITIONED { Keep::Products } else { Keep::Factor };
    for pass in 1..=PASSES {
        let shared = Pass {
            fit: &fit,
            noise: &noise,
            data,
            keep,
            judges: Judges { nominal: &before, robust: robust.as_ref() },
            known: verdict.as_ref(),
        };
        let (sums, found) = shared.over(stream)?;
        let known = verdict.get_or_insert(found);
        let Some((Factored { r, spectrum }, whole)) = factored(&sums.rows, p, keep) else {
            if keep == Keep::Factor {
                return Err(not_converged("no rows"));
            }
            // the sample was not typical: the whole file is nearer to losing rank. Once more, by orthogonal factors
            keep = Keep::Factor;
            continue;
        };
        let Some((scale, singular)) = spectrum.filter(|(_, s)| tells_apart(s)) else {
            let names: Vec<String> = start.free.iter().map(|k| fit.model().terms[*k].name.clone()).collect();
            return Err(rank_deficient(robot, data, &r, names));
        };
        let estimate = Estimate::of(r, whole, scale, singular, &sums.squares);
        let mut updated = noise.clone();
        let one_group = updated.update_from(&sums.squares, p).is_some();
        if estimate.step_in_sd() < SMALL && (one_group || pass > 2) {
            let identified = estimate.identified(start, fit.into_model(), updated, pass);
            let after =
                crate::fit::residuals::position_errors(&Forward::new(identified.model.clone(), Vec::new())?, data);
            return Ok(Streamed {
                identified,
                observations: sums.count,
                rejected: known.rejected,
                named: std::mem::take(&mut known.named),
                errors: sums.after.summary(&after),
                before: known.before.summary(&before_of_sample),
                passes: pass,
            });
        }
        // the rows under one noise only are comparable from pass to pass
        if one_group && estimate.cost > last_cost * (1.0 + 1e-9) {
            return Err(not_converged("a step that the whole file asks for makes it worse"));
        }
        last_cost = estimate.cost;
        if !one_group && pass <= 2 {
            noise = updated;
        }
        let x: Vec<f64> = fit.coefficients().iter().zip(&estimate.step).map(|(x, d)| x + d).collect();
        fit.set_coefficients(&x);
    }
    Err(not_converged(&format!("{PASSES} passes over the file")))
}

/// The triangular factors of J and of `[J r]`; `None` without rows, and where sums of products have lost too many digits.
fn factored(rows: &Rows, p: usize, keep: Keep) -> Option<(Factored, Mat)> {
    let whole = rows.factor().or_else(|| rows.factor_of_products())?;
    let factored = Factored::of(whole.leading(p, p));
    let digits = keep == Keep::Factor || factored.spectrum.as_ref().is_some_and(|(_, s)| is_well_conditioned(s));
    digits.then_some((factored, whole))
}

/// What the sums of a pass say of the parameters.
struct Estimate {
    /// Triangular factors of J, and of `[J r]`.
    r: Mat,
    whole: Mat,
    /// Lengths of the columns of J, and its singular values with columns of unit length.
    scale: Vec<f64>,
    singular: Vec<f64>,
    /// Scalars that were measured.
    scalars: f64,
    cost: f64,
    /// Of the residuals, in units of the noise.
    variance: f64,
    /// Of unit variance, row by row.
    covariance: Vec<f64>,
    /// Standard deviations of the parameters.
    sd: Vec<f64>,
    /// Gauss-Newton's.
    step: Vec<f64>,
}

impl Estimate {
    fn of(r: Mat, whole: Mat, scale: Vec<f64>, singular: Vec<f64>, squares: &Squares) -> Self {
        let p = r.ncols();
        // R dx = -Q'r
        let mut step: Vec<f64> = (0..p).map(|i| -whole[(i, p)]).collect();
        for i in (0..p).rev() {
            let sum: f64 = (i + 1..p).map(|j| r[(i, j)] * step[j]).sum();
            step[i] = (step[i] - sum) / r[(i, i)];
        }
        let covariance = covariance(&r, &scale);
        let cost = 0.5 * squares.total();
        let scalars = squares.count();
        let freedom = (scalars - p as f64).max(1.0);
        let variance = 2.0 * cost / freedom;
        let sd = (0..p).map(|k| (covariance[k * p + k] * variance).max(0.0).sqrt()).collect();
        Self { r, whole, scale, singular, scalars, cost, variance, covariance, sd, step }
    }

    /// The largest part of the step.
    fn step_in_sd(&self) -> f64 {
        self.step.iter().zip(&self.sd).map(|(d, sd)| d.abs() / sd.max(1e-300)).fold(0.0, f64::max)
    }

    /// Largest cosine between the residuals and a column of J.
    fn gradient(&self) -> f64 {
        let p = self.r.ncols();
        let length = (2.0 * self.cost).sqrt().max(1e-300);
        let along = |j: usize| (0..=j).map(|i| self.r[(i, j)] * self.whole[(i, p)]).sum::<f64>();
        (0..p).map(|j| (along(j) / (self.scale[j] * length)).abs()).fold(0.0, f64::max)
    }

    /// What was identified from the sample, with all rows' `model`, noise and accuracy.
    fn identified(self, start: Identified, mut model: Model, noise: Noise, passes: usize) -> Identified {
        for (index, sd) in start.free.iter().zip(&self.sd) {
            model.terms[*index].sd = Some(*sd);
        }
        let report = LmReport { iterations: passes, cost: self.cost, gradient: self.gradient(), ended: Ended::Step };
        let observability = indices(&self.singular, self.scalars as usize);
        let covariance = self.covariance.iter().map(|c| c * self.variance).collect();
        Identified { model, at_limit: Vec::new(), noise, covariance, observability, report, ..start }
    }
}

fn not_converged(what: &str) -> IdentError {
    IdentError::NotConverged(format!("{what}; are robot.toml and cell.toml those of this arm?"))
}

impl Pass<'_> {
    /// Sums over all rows, and what the first pass finds out about them.
    fn over(&self, stream: &CsvStream) -> Result<(Sums, Verdict)> {
        let mut sums = Sums::new(self.fit.free().len(), self.data.names.len(), self.keep);
        let mut found = Verdict::default();
        stream.pass(|index, rows| self.add_up(index, rows), &mut |index, mut part: Sums| {
            if let Some(block) = part.verdict.take() {
                found.join(index, block);
            }
            sums.join(&part);
            Ok(())
        })?;
        sums.rows.flush();
        Ok((sums, found))
    }

    /// One block's share.
    fn add_up(&self, index: usize, rows: &BlockRows<'_>) -> Result<Sums> {
        let data = self.data;
        let frame = data.frame_of_recording[index];
        let references = frame.map(|frame| &data.references[frame]).filter(|r| r.can_register());
        let mut block = PartOfPass::new(self, index, rows.number());
        let (mut number, mut pose) = (0, AtPose::default());
        rows.each_row::<IdentError>(&mut |row| {
            number += 1;
            let o = Observation {
                state: data.joints.state(&row, &data.names[index])?.numbered(row.seq),
                measured: row.measured,
                frame: frame.unwrap_or(0),
                pose: 0,
                recording: index,
                row: number,
                line: row.line,
            };
            if let Some(references) = references
                && pose.q != Some(o.state.q)
            {
                block.take_pose(references, std::mem::take(&mut pose))?;
                pose.q = Some(o.state.q);
            }
            match (o.measured, references) {
                (Measured::Reference { reference, position }, Some(_)) => pose.seen.push((reference, position.into())),
                (_, Some(_)) => pose.observations.push(o),
                // there are too few of them
                (Measured::Reference { .. }, None) => {}
                (_, None) => block.take(&o)?,
            }
            Ok(())
        })?;
        if let Some(references) = references {
            block.take_pose(references, pose)?;
        }
        let PartOfPass { mut sums, mut found, .. } = block;
        sums.rows.flush();
        found.rows = number;
        sums.verdict = self.known.is_none().then_some(found);
        Ok(sums)
    }
}

/// Rows at the same joints.
#[derive(Default)]
struct AtPose {
    q: Option<Joints>,
    seen: Vec<Seen>,
    observations: Vec<Observation>,
}

/// What a pass knows of a block so far.
struct PartOfPass<'a> {
    pass: &'a Pass<'a>,
    /// Rows that are not used, once that is known.
    marks: Option<&'a Marks>,
    found: BlockVerdict,
    sums: Sums,
    ws: Workspace,
    judges: (Workspace, Option<Workspace>),
}

impl<'a> PartOfPass<'a> {
    /// Block `number` of file `index`.
    fn new(pass: &'a Pass<'a>, index: usize, number: usize) -> Self {
        Self {
            pass,
            marks: pass.known.and_then(|v| v.marks.get(index)?.get(number)),
            found: BlockVerdict::default(),
            sums: Sums::new(pass.fit.free().len(), pass.data.names.len(), pass.keep),
            ws: pass.fit.workspace(),
            judges: (pass.judges.nominal.workspace(), pass.judges.robust.map(|r| r.0.workspace())),
        }
    }

    /// Adds what was measured at a pose, moved as its references say.
    fn take_pose(&mut self, references: &References, mut at: AtPose) -> Result<()> {
        match references.register(&at.seen) {
            Ok(pose) => {
                for o in &mut at.observations {
                    move_by(&pose, &mut o.measured);
                    self.take(o)?;
                }
            }
            Err(reason) if self.pass.known.is_none() => {
                let names = &self.pass.data.names;
                at.observations.iter().for_each(|o| self.found.reject(o, &names[o.recording], || reason.clone()));
            }
            Err(_) => {}
        }
        Ok(())
    }

    /// Adds an observation, unless it is not used.
    fn take(&mut self, o: &Observation) -> Result<()> {
        let Pass { fit, noise, data, judges, known, .. } = self.pass;
        if self.marks.is_some_and(|m| m.has(o.row - 1)) {
            return Ok(());
        }
        if known.is_none() {
            fit.check(&o.state, &o.measured, o.frame).map_err(|e| data.error(o, e.to_string()))?;
            if !judges.accept(o, &data.names[o.recording], &mut self.judges, &mut self.found) {
                return Ok(());
            }
        }
        let Self { sums, ws, .. } = self;
        sums.rows.observe(fit, ws, std::slice::from_ref(o), noise, f64::INFINITY);
        let rows = trical_model::residual_rows(&o.measured);
        sums.after.add(length(&ws.residual()[..rows.min(3)]));
        let in_sigma = |k: usize| ws.residual()[k] / noise.sigma(o.recording, &o.measured, k);
        let weighted: [f64; 6] = std::array::from_fn(|k| if k < rows { in_sigma(k) } else { 0.0 });
        sums.squares.add(o.recording, &o.measured, &weighted[..rows]);
        sums.count += 1;
        Ok(())
    }
}

impl Judges<'_> {
    /// Whether a row is used, and what is to be kept of it in `found`.
    fn accept(
        &self,
        o: &Observation,
        name: &str,
        (ws_nominal, ws_robust): &mut (Workspace, Option<Workspace>),
        found: &mut BlockVerdict,
    ) -> bool {
        if let (Some((robust, noise)), Some(ws)) = (self.robust, ws_robust) {
            let (in_sigma, rows) = weighted(robust, o, noise, ws);
            let off = length(&in_sigma[..rows]);
            if off > GROSS || off.is_nan() {
                found.reject(o, name, || {
                    let r = ws.residual()[..rows].to_vec();
                    gross_error(&r, &in_sigma[..rows], right_ball(robust, noise, o, ws))
                });
                return false;
            }
        }
        let rows = self.nominal.residual(&o.state, &o.measured, o.frame, ws_nominal);
        found.before.add(length(&ws_nominal.residual()[..rows.min(3)]));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_that_are_marked_are_those_and_no_others() {
        let rows = [0, 1, 63, 64, 127, 200];
        let mut marks = Marks::default();
        rows.iter().for_each(|row| marks.set(*row));
        assert_eq!((0..400).filter(|row| marks.has(*row)).collect::<Vec<_>>(), rows);
        assert_eq!(marks.0.len(), 4, "one bit for each row");
    }
}
