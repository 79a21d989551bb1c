//! Errors at poses that a linear fit did not see. Inner products over the rows that it sees are kept: most sets that are asked
//! for have their candidates in common.

use faer::linalg::matmul::matmul;
use faer::linalg::solvers::Solve;
use faer::{Accum, Mat, MatRef, Par, Side};

use super::columns::Linear;

/// What is known of held-out fits.
#[derive(Default)]
pub(crate) struct HeldOut {
    /// Candidate columns that were asked for, and all rows of the parameters' columns and these, one column after the other.
    columns: Vec<usize>,
    entries: Vec<f64>,
    folds: Vec<Fold>,
}

/// Rows that are fitted, and rows that are predicted.
pub(super) struct Fold {
    train: Vec<bool>,
    pub(super) test: Vec<usize>,
    /// Inner products of each column with those up to itself over the rows that are fitted, and with the residual there.
    gram: Vec<Vec<f64>>,
    residual: Vec<f64>,
    /// The columns' rows that are predicted, one column after the other.
    tested: Vec<f64>,
}

impl HeldOut {
    /// Takes up columns, and gives their places behind the parameters'.
    pub(super) fn take(&mut self, linear: &Linear, columns: &[usize]) -> Vec<usize> {
        let p = linear.jacobian.ncols();
        if self.entries.is_empty() {
            self.entries.extend((0..p).flat_map(|j| linear.jacobian.col_as_slice(j)));
        }
        columns
            .iter()
            .map(|a| {
                p + self.columns.iter().position(|known| known == a).unwrap_or_else(|| {
                    self.columns.push(*a);
                    let from = self.entries.len();
                    self.entries.resize(from + linear.rows(), 0.0);
                    linear.column(*a, &mut self.entries[from..]);
                    self.columns.len() - 1
                })
            })
            .collect()
    }

    /// Rows to be fitted and to be predicted, with the products of all columns so far.
    pub(super) fn fold(&mut self, linear: &Linear, train: Vec<bool>, test: Vec<usize>) -> &Fold {
        let at = self.folds.iter().position(|f| f.train == train && f.test == test).unwrap_or_else(|| {
            let (gram, residual, tested) = (Vec::new(), Vec::new(), Vec::new());
            self.folds.push(Fold { train, test, gram, residual, tested });
            self.folds.len() - 1
        });
        let fold = &mut self.folds[at];
        let rows = linear.rows();
        let count = self.entries.len() / rows.max(1);
        let from = fold.gram.len();
        if from < count {
            let new = &self.entries[from * rows..];
            let mut seen = Mat::<f64>::zeros(rows, count - from);
            for j in 0..count - from {
                let of = new[j * rows..].iter().zip(&fold.train);
                for (v, (x, train)) in seen.col_as_slice_mut(j).iter_mut().zip(of) {
                    *v = if *train { *x } else { 0.0 };
                }
            }
            let mut products = Mat::<f64>::zeros(count, count - from);
            let all = MatRef::from_column_major_slice(&self.entries, rows, count);
            matmul(products.as_mut(), Accum::Replace, all.transpose(), seen.as_ref(), 1.0, Par::Seq);
            for j in 0..count - from {
                fold.gram.push(products.col_as_slice(j)[..=from + j].to_vec());
                fold.residual.push(seen.col_as_slice(j).iter().zip(&linear.residual).map(|(x, r)| x * r).sum());
                fold.tested.extend(fold.test.iter().map(|i| new[j * rows + i]));
            }
        }
        fold
    }
}

impl Fold {
    /// Residuals of the rows that are predicted, by a fit of the columns at some places with the prior's `precision` (0 where there
    /// is none). Nothing where the fit fails.
    pub(super) fn predicted(&self, places: &[usize], precision: &[f64], residual: &[f64]) -> Option<Vec<f64>> {
        let n = places.len();
        // scaled columns and a trace of damping, so that absorbed columns do no harm
        let scale: Vec<f64> = places
            .iter()
            .map(|at| self.gram[*at][*at])
            .map(|square| if square > 0.0 { 1.0 / square.sqrt() } else { 0.0 })
            .collect();
        let mut h = Mat::<f64>::zeros(n, n);
        for (j, a) in places.iter().enumerate() {
            for (i, b) in places.iter().enumerate().skip(j) {
                h[(i, j)] = self.gram[*a.max(b)][*a.min(b)] * scale[i] * scale[j];
            }
            h[(j, j)] += 1e-10 + precision[j] * scale[j].powi(2);
        }
        let g = Mat::from_fn(n, 1, |j, _| -self.residual[places[j]] * scale[j]);
        let x = h.llt(Side::Lower).ok()?.solve(&g);
        let mut left: Vec<f64> = self.test.iter().map(|i| residual[*i]).collect();
        let rows = left.len();
        for (j, at) in places.iter().enumerate() {
            let value = scale[j] * x[(j, 0)];
            for (r, v) in left.iter_mut().zip(&self.tested[at * rows..(at + 1) * rows]) {
                *r += v * value;
            }
        }
        Some(left)
    }
}
