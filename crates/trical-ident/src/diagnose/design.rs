//! The linear picture of a fit: what every candidate would do to the measurements, and what the fitted parameters leave of it.
//!
//! With `Q` an orthonormal basis of the columns of the weighted Jacobian (and of the effects already chosen), `r` the weighted
//! residual and `X` a candidate's columns, the sum of squares that the candidate would remove is `b' G^-1 b`, where `b = X'r`
//! and `G = X'X - (Q'X)'(Q'X)`. `G` also gives lambda: the length of a signature after projection, in units of the noise.

use std::sync::Arc;

use faer::linalg::matmul::matmul;
use faer::linalg::solvers::Solve;
use faer::{Accum, Mat, MatRef, Par, Side};
use pulp::Arch;
use rayon::prelude::*;
use trical_model::{Forward, Model, residual_rows};

use super::catalogue::Candidate;
use super::memory::{Filter, Memory};
use crate::dataset::Dataset;
use crate::error::Result;
use crate::noise::Noise;

/// Columns whose length after projection is below this fraction of their length are absorbed by the fit.
const ABSORBED: f64 = 1e-3;

/// A linearized fit with candidates.
pub struct Design {
    /// Rows (scalars).
    pub rows: usize,
    /// Fitted parameters.
    pub parameters: usize,
    /// Weighted candidate columns, row-major, `rows x columns`.
    columns: Vec<f64>,
    width: usize,
    /// First column of each candidate, and one past the last.
    spans: Vec<(usize, usize)>,
    /// Squared lengths of the columns before projection.
    squares: Vec<f64>,
    /// 1 / (prior standard deviation)^2 of every coefficient.
    precision: Vec<f64>,
    /// `X'X - (Q'X)'(Q'X)` of all columns, `width x width`.
    gram: Mat<f64>,
    /// `X'r` of all columns, and `r'r`, after projection.
    b: Vec<f64>,
    ss: f64,
    /// Pose of each row.
    pub pose_of_row: Vec<usize>,
    /// Weighted Jacobian of the fitted parameters, and residual before projection.
    jacobian: Mat<f64>,
    raw: Vec<f64>,
    /// What made the noise white.
    filter: Filter,
    /// Half of `ln det (J'J)`.
    of_parameters: f64,
    /// Standard deviation and observation of each row.
    sigma_of_row: Vec<(f64, usize)>,
}

/// A state of the search: the fit with some candidates added. All that is needed are inner products, so a stage costs as
/// much as there are columns, however many rows there were.
#[derive(Clone)]
pub struct Stage {
    /// Inner products of every column with each basis vector that was added; shared by the stages that follow.
    w: Vec<Arc<[f64]>>,
    /// Squared length of every column after projection.
    left: Vec<f64>,
    /// `X'r` of every column.
    b: Vec<f64>,
    /// Weighted sum of squares left.
    pub ss: f64,
    /// Parameters in the basis; one that the prior holds more than the data do counts less than 1.
    pub parameters: f64,
}

/// What one candidate would do.
#[derive(Clone, Copy, Debug)]
pub struct Gain {
    /// Sum of squares that it would remove, prior costs included.
    pub dss: f64,
    /// How many numbers the data would determine.
    pub rank: f64,
    /// Occam's factor, nats: `ln sqrt(det(G + L) / det L)` with the prior's precision `L`. A coefficient that could have been
    /// anything in its usual range pays for having been found at one place in it.
    pub occam: f64,
}

impl Design {
    /// Linearizes `model` (fitted, all terms free) with the candidates at zero.
    ///
    /// # Errors
    /// A candidate at a site that the arm does not have.
    pub fn new(model: &Model, candidates: &[Candidate], data: &Dataset, noise: &Noise) -> Result<Self> {
        Self::weighted(model, candidates, &[], data, noise, Memory::NONE)
    }

    /// As [`Design::new`]; a candidate with weights (for each of its columns, one for each observation) has them multiplied in. Noise that
    /// remembers itself is made white: rows are then what could not be foreseen from those before.
    ///
    /// # Errors
    /// As [`Design::new`].
    pub fn weighted(
        model: &Model,
        candidates: &[Candidate],
        weights: &[Vec<Vec<f64>>],
        data: &Dataset,
        noise: &Noise,
        memory: Memory,
    ) -> Result<Self> {
        let p = model.terms.len();
        let mut wide = model.clone();
        let mut spans = Vec::with_capacity(candidates.len());
        let mut at = 0;
        for c in candidates {
            spans.push((at, at + c.terms.len()));
            at += c.terms.len();
            wide.terms.extend(c.terms.iter().cloned());
        }
        let width = at;
        let precision: Vec<f64> = candidates.iter().flat_map(|c| c.scales.iter().map(|s| s.powi(-2))).collect();
        let total = p + width;
        let forward = Forward::new(wide, (0..total).collect())?;
        let rows: usize = data.observations.iter().map(|o| residual_rows(&o.measured)).sum();
        let mut jacobian = Mat::<f64>::zeros(rows, p);
        let mut columns = vec![0.0; rows * width];
        let mut residual = vec![0.0; rows];
        let mut pose_of_row = vec![0; rows];
        let mut sigma_of_row = Vec::with_capacity(rows);
        let mut ws = forward.workspace();
        let mut block = vec![0.0; 6 * total];
        let mut filter = Filter::new(memory);
        let mut row = 0;
        for (index, o) in data.observations.iter().enumerate() {
            if index % 64 == 0 {
                trical_model::interrupt::checkpoint()?;
            }
            let n = forward.linearize(&o.state, &o.measured, o.frame, &mut ws, &mut block);
            let mut left = *ws.residual();
            for k in 0..n {
                let sigma = noise.sigma(o.recording, &o.measured, k);
                let s = 1.0 / sigma;
                // rotations of a pose are fitted, but a position error has no part in them
                sigma_of_row.push((if k < 3 { sigma } else { 0.0 }, index));
                left[k] *= s;
                let line = &mut block[k * total..(k + 1) * total];
                for v in line.iter_mut() {
                    *v *= s;
                }
                for (weights, (from, upto)) in weights.iter().zip(&spans) {
                    for (v, weight) in line[p + *from..p + *upto].iter_mut().zip(weights) {
                        *v *= weight[index];
                    }
                }
            }
            if filter.works() {
                let tool = forward.world_from_tool(&o.state, &mut ws).rotation;
                filter.next(o, n, &tool, [&mut left[..n], &mut block[..n * total]]);
            }
            for k in 0..n {
                residual[row] = left[k];
                pose_of_row[row] = o.pose;
                let line = &block[k * total..(k + 1) * total];
                for j in 0..p {
                    jacobian[(row, j)] = line[j];
                }
                columns[row * width..(row + 1) * width].copy_from_slice(&line[p..]);
                row += 1;
            }
        }
        let qr = jacobian.qr();
        let q = qr.compute_thin_Q();
        let of_parameters: f64 = (0..p).map(|j| qr.R()[(j, j)].abs().max(1e-300).ln()).sum();
        // residual after projection, twice for the last digits
        let mut r = residual.clone();
        for _ in 0..2 {
            for j in 0..p {
                let column = q.col(j);
                let d: f64 = (0..rows).map(|i| column[i] * r[i]).sum();
                for (i, v) in r.iter_mut().enumerate() {
                    *v -= d * column[i];
                }
            }
        }
        let mut squares = vec![0.0; width];
        for i in 0..rows {
            for (s, v) in squares.iter_mut().zip(&columns[i * width..(i + 1) * width]) {
                *s += v * v;
            }
        }
        let view = MatRef::from_row_major_slice(&columns, rows, width);
        let mut w = Mat::<f64>::zeros(p, width);
        matmul(w.as_mut(), Accum::Replace, q.transpose(), view, 1.0, Par::Seq);
        let gram = left_of_products(view, w.as_ref());
        let mut b = vec![0.0; width];
        for (i, x) in r.iter().enumerate() {
            for (o, c) in b.iter_mut().zip(&columns[i * width..(i + 1) * width]) {
                *o += x * c;
            }
        }
        let ss = r.iter().map(|v| v * v).sum();
        Ok(Self {
            rows,
            parameters: p,
            columns,
            width,
            spans,
            squares,
            precision,
            gram,
            b,
            ss,
            pose_of_row,
            jacobian,
            raw: residual,
            of_parameters,
            filter,
            sigma_of_row,
        })
    }

    /// Weighted entry of a column of the candidates.
    #[must_use]
    pub fn column_at(&self, row: usize, column: usize) -> f64 {
        self.columns[row * self.width + column]
    }

    /// Weighted residual of a row, before projection.
    #[must_use]
    pub fn residual_at(&self, row: usize) -> f64 {
        self.raw[row]
    }

    /// The state with nothing added.
    #[must_use]
    pub fn stage(&self) -> Stage {
        let left = (0..self.width).map(|a| self.gram[(a, a)]).collect();
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let parameters = self.parameters as f64;
        Stage { w: Vec::new(), left, b: self.b.clone(), ss: self.ss, parameters }
    }

    /// How likely the residuals of the fitted parameters alone are, nats (restricted likelihood, Patterson & Thompson 1971): comparable
    /// between memories of the noise. `temper` is the share of the rows that is independent.
    #[must_use]
    pub fn nats(&self, temper: f64) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "counts")]
        let freedom = (self.rows as f64 * temper - self.parameters as f64).max(1.0);
        -0.5 * (freedom * self.ss.ln() + temper * self.filter.log_determinant()) - self.of_parameters
    }

    /// Whether the fit has not absorbed a column.
    fn is_left(&self, stage: &Stage, column: usize) -> bool {
        self.squares[column] > 0.0 && stage.left[column] > ABSORBED * ABSORBED * self.squares[column]
    }

    /// `G` of a candidate (k x k, row by row) and the columns that the fit does not absorb.
    fn gram(&self, stage: &Stage, candidate: usize) -> (Vec<usize>, Vec<f64>) {
        let (from, to) = self.spans[candidate];
        let kept: Vec<usize> = (from..to).filter(|a| self.is_left(stage, *a)).collect();
        let k = kept.len();
        let mut g = vec![0.0; k * k];
        for i in 0..k {
            for j in 0..=i {
                let (a, b) = (kept[i], kept[j]);
                let v = if a == b {
                    stage.left[a]
                } else {
                    self.gram[(a, b)] - stage.w.iter().map(|w| w[a] * w[b]).sum::<f64>()
                };
                g[i * k + j] = v;
                g[j * k + i] = v;
            }
        }
        (kept, g)
    }

    /// The columns that the fit does not absorb, Cholesky's factor of `G` with the prior's precision, and `y = L^-1 b`.
    fn solved(&self, stage: &Stage, candidate: usize) -> (Vec<usize>, Vec<f64>, Vec<f64>) {
        let (kept, mut g) = self.gram(stage, candidate);
        let k = kept.len();
        for (i, a) in kept.iter().enumerate() {
            g[i * k + i] += self.precision[*a];
        }
        let l = cholesky(&g, k);
        let y = forward_substitution(&l, &kept.iter().map(|a| stage.b[*a]).collect::<Vec<f64>>());
        (kept, l, y)
    }

    /// What a candidate would remove from the sum of squares.
    #[must_use]
    pub fn gain(&self, stage: &Stage, candidate: usize) -> Gain {
        let (kept, l, y) = self.solved(stage, candidate);
        let k = kept.len();
        let mut gain = Gain { dss: y.iter().map(|v| v * v).sum(), rank: 0.0, occam: 0.0 };
        for (i, a) in kept.iter().enumerate() {
            let share = self.precision[*a] / l[i * k + i].powi(2);
            gain.rank += 1.0 - share;
            gain.occam -= 0.5 * share.ln();
        }
        gain
    }

    /// What a candidate would remove without any prior, and how many of its columns are independent.
    #[must_use]
    pub fn plain_gain(&self, stage: &Stage, candidate: usize) -> (f64, usize) {
        let (kept, g) = self.gram(stage, candidate);
        let k = kept.len();
        let mut dss = 0.0;
        // Gram-Schmidt in the metric of G: rows of L, one for every column that is not a sum of those before
        let mut ys: Vec<f64> = Vec::new();
        let mut coordinates: Vec<Vec<f64>> = vec![Vec::new(); k];
        for j in 0..k {
            let left = g[j * k + j] - coordinates[j].iter().map(|v| v * v).sum::<f64>();
            if left <= 1e-6 * g[j * k + j] {
                continue;
            }
            let norm = left.sqrt();
            let along: Vec<f64> = (0..k)
                .map(|i| {
                    (g[i * k + j] - coordinates[i].iter().zip(&coordinates[j]).map(|(a, b)| a * b).sum::<f64>()) / norm
                })
                .collect();
            let y = (stage.b[kept[j]] - coordinates[j].iter().zip(&ys).map(|(c, y)| c * y).sum::<f64>()) / norm;
            dss += y * y;
            ys.push(y);
            for (c, v) in coordinates.iter_mut().zip(&along) {
                c.push(*v);
            }
        }
        (dss, ys.len())
    }

    /// Coefficients (SI, zero for absorbed columns) of a candidate, were it added now.
    #[must_use]
    pub fn coefficients(&self, stage: &Stage, candidate: usize) -> Vec<f64> {
        let (from, to) = self.spans[candidate];
        let (kept, l, y) = self.solved(stage, candidate);
        let k = kept.len();
        let mut x = vec![0.0; k];
        for i in (0..k).rev() {
            let sum: f64 = (i + 1..k).map(|j| l[j * k + i] * x[j]).sum();
            x[i] = (y[i] - sum) / l[i * k + i];
        }
        // the residual is predicted minus measured: what is added must cancel it
        let mut out = vec![0.0; to - from];
        for (a, v) in kept.iter().zip(&x) {
            out[a - from] = -v;
        }
        out
    }

    /// lambda of a candidate of coefficients `size` each (root mean square over its columns' directions).
    #[must_use]
    pub fn lambda_of_size(&self, stage: &Stage, candidate: usize, size: f64) -> f64 {
        let (from, to) = self.spans[candidate];
        let (kept, g) = self.gram(stage, candidate);
        let k = kept.len();
        let trace: f64 = (0..k).map(|i| g[i * k + i]).sum();
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let n = (to - from).max(1) as f64;
        size * (trace / n).max(0.0).sqrt()
    }

    /// Position errors (m) of observations whose pose is in `test`, by a linear fit of the parameters and the candidates of
    /// `set` to the rows whose pose is in `train`.
    #[must_use]
    pub fn held_out(&self, set: &[usize], train: &dyn Fn(usize) -> bool, test: &dyn Fn(usize) -> bool) -> Vec<f64> {
        let extra: Vec<usize> = set.iter().flat_map(|c| self.spans[*c].0..self.spans[*c].1).collect();
        let p = self.parameters + extra.len();
        let kept = |i: usize, j: usize| {
            if j < self.parameters {
                self.jacobian[(i, j)]
            } else {
                self.columns[i * self.width + extra[j - self.parameters]]
            }
        };
        // errors are those of the measurements, not of what could not be foreseen of them
        let whole = self.filter.works().then(|| {
            let mut whole = Mat::from_fn(self.rows, p + 1, |i, j| if j < p { kept(i, j) } else { self.raw[i] });
            for j in 0..=p {
                self.filter.undo(whole.col_as_slice_mut(j));
            }
            whole
        });
        let entry = |i: usize, j: usize| whole.as_ref().map_or_else(|| kept(i, j), |w| w[(i, j)]);
        let raw = |i: usize| whole.as_ref().map_or(self.raw[i], |w| w[(i, p)]);
        let rows: Vec<usize> = (0..self.rows).filter(|i| train(self.pose_of_row[*i])).collect();
        // normal equations with scaled columns and a trace of damping, so that absorbed columns do no harm
        let mut scale = vec![0.0; p];
        for i in &rows {
            for (j, s) in scale.iter_mut().enumerate() {
                *s += entry(*i, j).powi(2);
            }
        }
        for s in &mut scale {
            *s = if *s > 0.0 { 1.0 / s.sqrt() } else { 0.0 };
        }
        let a = Mat::from_fn(rows.len(), p, |i, j| entry(rows[i], j) * scale[j]);
        let mut h = Mat::<f64>::zeros(p, p);
        matmul(h.as_mut(), Accum::Replace, a.transpose(), a.as_ref(), 1.0, Par::Seq);
        for j in 0..p {
            h[(j, j)] += 1e-10;
            if j >= self.parameters {
                h[(j, j)] += self.precision[extra[j - self.parameters]] * scale[j].powi(2);
            }
        }
        let g = Mat::from_fn(p, 1, |j, _| -(0..rows.len()).map(|i| a[(i, j)] * raw(rows[i])).sum::<f64>());
        let Ok(llt) = h.llt(Side::Lower) else { return Vec::new() };
        let x = llt.solve(&g);
        let mut squares: std::collections::BTreeMap<usize, f64> = std::collections::BTreeMap::new();
        for i in (0..self.rows).filter(|i| test(self.pose_of_row[*i])) {
            let (sigma, observation) = self.sigma_of_row[i];
            let r = raw(i) + (0..p).map(|j| entry(i, j) * scale[j] * x[(j, 0)]).sum::<f64>();
            *squares.entry(observation).or_insert(0.0) += (r * sigma).powi(2);
        }
        squares.into_values().map(f64::sqrt).collect()
    }

    /// The same picture with the columns of these candidates only, the others without any; and a stage in it. A stage there
    /// costs what the set costs, and says the same of its members to the last bit. It cannot tell rows.
    #[must_use]
    pub fn narrowed(&self, stage: &Stage, set: &[usize]) -> (Self, Stage) {
        let mut spans = vec![(0, 0); self.spans.len()];
        let mut kept: Vec<usize> = Vec::new();
        for c in set {
            let (from, to) = self.spans[*c];
            spans[*c] = (kept.len(), kept.len() + to - from);
            kept.extend(from..to);
        }
        let of = |v: &[f64]| kept.iter().map(|a| v[*a]).collect::<Vec<f64>>();
        let narrow = Self {
            rows: self.rows,
            parameters: self.parameters,
            columns: Vec::new(),
            width: kept.len(),
            spans,
            squares: of(&self.squares),
            precision: of(&self.precision),
            gram: Mat::from_fn(kept.len(), kept.len(), |i, j| self.gram[(kept[i], kept[j])]),
            b: of(&self.b),
            ss: self.ss,
            pose_of_row: Vec::new(),
            jacobian: Mat::zeros(0, 0),
            raw: Vec::new(),
            filter: Filter::new(Memory::NONE),
            of_parameters: self.of_parameters,
            sigma_of_row: Vec::new(),
        };
        let stage = Stage {
            w: stage.w.iter().map(|w| of(w).into()).collect(),
            left: of(&stage.left),
            b: of(&stage.b),
            ..*stage
        };
        (narrow, stage)
    }

    /// Adds a candidate to the basis.
    pub fn add(&self, stage: &mut Stage, candidate: usize) {
        let (from, to) = self.spans[candidate];
        for a in from..to {
            if !self.is_left(stage, a) {
                continue;
            }
            let square = stage.left[a] + self.precision[a];
            let norm = square.sqrt();
            let mut w: Vec<f64> = self.gram.col_as_slice(a).to_vec();
            let d = stage.b[a] / norm;
            let Stage { w: known, b, left, .. } = &mut *stage;
            // the loops that diagnoses spend their time in, compiled for the processor's vectors; no sum is reordered
            Arch::new().dispatch(Orthogonal { w: &mut w, known, at: a, norm, d, b, left });
            stage.ss -= d * d;
            stage.parameters += 1.0 - self.precision[a] / square;
            stage.w.push(w.into());
        }
    }
}

/// Columns of one piece of [`left_of_products`].
const PIECE: usize = 256;

/// `X'X - W'W`: the lower triangle in pieces of some columns, by as many threads as there are, and its mirror image.
fn left_of_products(x: MatRef<'_, f64>, w: MatRef<'_, f64>) -> Mat<f64> {
    let width = x.ncols();
    let pieces: Vec<(usize, Mat<f64>)> = (0..width)
        .into_par_iter()
        .step_by(PIECE)
        .map(|from| {
            let (below, columns) = (width - from, PIECE.min(width - from));
            let mut piece = Mat::<f64>::zeros(below, columns);
            for (m, accumulate, factor) in [(x, Accum::Replace, 1.0), (w, Accum::Add, -1.0)] {
                let lhs = m.subcols(from, below).transpose();
                matmul(piece.as_mut(), accumulate, lhs, m.subcols(from, columns), factor, Par::Seq);
            }
            (from, piece)
        })
        .collect();
    let mut all = Mat::<f64>::zeros(width, width);
    for (from, piece) in &pieces {
        for j in 0..piece.ncols() {
            for (i, v) in piece.col_as_slice(j).iter().enumerate().skip(j) {
                all[(from + i, from + j)] = *v;
                all[(from + j, from + i)] = *v;
            }
        }
    }
    all
}

/// Makes the column `w` of inner products orthogonal to what is known, and takes its part out of `b` and `left`.
struct Orthogonal<'a> {
    w: &'a mut [f64],
    known: &'a [Arc<[f64]>],
    at: usize,
    norm: f64,
    d: f64,
    b: &'a mut [f64],
    left: &'a mut [f64],
}

impl pulp::NullaryFnOnce for Orthogonal<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { w, known, at, norm, d, b, left } = self;
        let mut four = known.chunks_exact(4);
        for old in &mut four {
            let [f0, f1, f2, f3] = [old[0][at], old[1][at], old[2][at], old[3][at]];
            for ((((x, y0), y1), y2), y3) in w.iter_mut().zip(&*old[0]).zip(&*old[1]).zip(&*old[2]).zip(&*old[3]) {
                *x = (((*x - f0 * y0) - f1 * y1) - f2 * y2) - f3 * y3;
            }
        }
        for old in four.remainder() {
            let factor = old[at];
            for (x, y) in w.iter_mut().zip(&**old) {
                *x -= factor * y;
            }
        }
        for ((x, b), left) in w.iter_mut().zip(b).zip(left) {
            *x /= norm;
            *b -= d * *x;
            *left -= *x * *x;
        }
    }
}

/// Cholesky factor (k x k, lower, row by row) of a positive definite matrix.
fn cholesky(g: &[f64], k: usize) -> Vec<f64> {
    let mut l = vec![0.0; k * k];
    for j in 0..k {
        let d = g[j * k + j] - (0..j).map(|m| l[j * k + m] * l[j * k + m]).sum::<f64>();
        // the prior's precision keeps it positive, but for rounding
        l[j * k + j] = d.max(1e-12 * g[j * k + j]).sqrt();
        for i in j + 1..k {
            let s = g[i * k + j] - (0..j).map(|m| l[i * k + m] * l[j * k + m]).sum::<f64>();
            l[i * k + j] = s / l[j * k + j];
        }
    }
    l
}

fn forward_substitution(l: &[f64], b: &[f64]) -> Vec<f64> {
    let k = b.len();
    let mut y = vec![0.0; k];
    for i in 0..k {
        let s: f64 = (0..i).map(|j| l[i * k + j] * y[j]).sum();
        y[i] = (b[i] - s) / l[i * k + i];
    }
    y
}
