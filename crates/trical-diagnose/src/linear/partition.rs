//! A set of candidates fitted without each part of the poses in turn: what the poses of a part say of it when it was learnt on the
//! others.
//!
//! With `H` the normal matrix of the fitted rows (priors included), `x` the solution and `E = X_t H^-1` for the rows `X_t` that are
//! predicted, columns `o` are taken out by `x' = x - H^-1[:, o] y`, `y = H^-1[o, o]^-1 x[o]`, which changes the predicted residual by
//! `-E[:, o] y`; columns `A` are added by the Schur complement of `H`. Another set costs what its difference costs.

use faer::linalg::matmul::matmul;
use faer::linalg::solvers::{DenseSolveCore, Solve};
use faer::{Accum, Mat, MatRef, Par, Side};
use rayon::prelude::*;

use super::columns::Linear;
use super::design::Design;

/// Keeps columns that the data absorb from doing harm: beside a length of one.
const DAMPING: f64 = 1e-10;

/// A joint fit in parts.
pub struct Partition<'a> {
    design: &'a Design,
    linear: &'a Linear,
    /// Candidates of the set, each with its columns in `fits`.
    set: Vec<(usize, std::ops::Range<usize>)>,
    /// Factor of each column that makes its length one.
    scale: Vec<f64>,
    /// Prior precisions of the scaled columns.
    precision: Vec<f64>,
    /// Rows of each part.
    rows: Vec<Vec<usize>>,
    /// All columns, scaled, in the rows of each part.
    columns: Vec<Mat<f64>>,
    /// Products of the columns, and with the residual, over each part.
    grams: Vec<Mat<f64>>,
    pushes: Vec<Vec<f64>>,
    /// The fit without each part.
    fits: Vec<Fit>,
}

/// A fit to the rows of the other parts.
struct Fit {
    inverse: Mat<f64>,
    x: Mat<f64>,
    /// `X_t H^-1`.
    hat: Mat<f64>,
    /// Residual of the predicted rows.
    left: Mat<f64>,
}

/// A candidate beside the set.
struct Added {
    /// Prior precisions of its scaled columns.
    precision: Vec<f64>,
    parts: Vec<Seen>,
}

/// Its scaled columns in the rows of a part, and their products there: with the set, with each other, with the residual.
struct Seen {
    columns: Mat<f64>,
    with_set: Mat<f64>,
    with_itself: Mat<f64>,
    push: Mat<f64>,
}

impl<'a> Partition<'a> {
    /// Fits `set` in `count` parts; `part_of` says of each pose to which it belongs. `None` where a fit fails, or the design has no rows.
    #[must_use]
    pub fn new(design: &'a Design, set: &[usize], count: usize, part_of: &dyn Fn(usize) -> usize) -> Option<Self> {
        let linear = design.linear()?;
        let (p, m) = (linear.jacobian.ncols(), linear.rows());
        let mut at = p;
        let set: Vec<(usize, std::ops::Range<usize>)> = set
            .iter()
            .map(|c| {
                let (from, to) = design.span(*c);
                at += to - from;
                (*c, at - (to - from)..at)
            })
            .collect();
        let n = at;
        let mut entries = vec![0.0; m * n];
        for j in 0..p {
            entries[j * m..(j + 1) * m].copy_from_slice(linear.jacobian.col_as_slice(j));
        }
        let mut precision = vec![0.0; n];
        for (c, range) in &set {
            let (from, to) = design.span(*c);
            for (a, j) in (from..to).zip(range.clone()) {
                linear.column(a, &mut entries[j * m..(j + 1) * m]);
                precision[j] = design.prior_precision(a);
            }
        }
        let mut scale = vec![0.0; n];
        for j in 0..n {
            let column = &mut entries[j * m..(j + 1) * m];
            let square: f64 = column.iter().map(|v| v * v).sum();
            scale[j] = if square > 0.0 { 1.0 / square.sqrt() } else { 1.0 };
            column.iter_mut().for_each(|v| *v *= scale[j]);
            precision[j] = precision[j] * scale[j] * scale[j] + DAMPING;
        }
        let mut rows = vec![Vec::new(); count];
        for (i, pose) in linear.pose_of_row.iter().enumerate() {
            rows[part_of(*pose) % count].push(i);
        }
        let columns = rows.iter().map(|rows| Mat::from_fn(rows.len(), n, |i, j| entries[j * m + rows[i]])).collect();
        let mut this = Self {
            design,
            linear,
            set,
            scale,
            precision,
            rows,
            columns,
            grams: Vec::new(),
            pushes: Vec::new(),
            fits: Vec::new(),
        };
        let sums = |part: usize| {
            let x = &this.columns[part];
            let r = this.residual_of(part);
            let mut gram = Mat::<f64>::zeros(n, n);
            matmul(gram.as_mut(), Accum::Replace, x.transpose(), x, 1.0, Par::Seq);
            let push = x.transpose() * &r;
            (gram, (0..n).map(|j| push[(j, 0)]).collect())
        };
        (this.grams, this.pushes) = (0..count).into_par_iter().map(sums).unzip();
        let fits: Vec<Option<Fit>> = (0..count).into_par_iter().map(|part| this.without_part(part)).collect();
        this.fits = fits.into_iter().collect::<Option<Vec<_>>>()?;
        Some(this)
    }

    /// Some scaled columns in the rows of a part.
    fn rows_of(&self, part: usize, columns: &[usize]) -> Mat<f64> {
        Mat::from_fn(self.rows[part].len(), columns.len(), |i, j| self.columns[part][(i, columns[j])])
    }

    /// Normal matrix and right side of some columns over some parts, with the priors.
    fn normal(&self, parts: impl Iterator<Item = usize>, columns: &[usize]) -> (Mat<f64>, Mat<f64>) {
        let n = columns.len();
        let (mut h, mut g) = (Mat::<f64>::zeros(n, n), Mat::<f64>::zeros(n, 1));
        for k in parts {
            h += Mat::from_fn(n, n, |i, j| self.grams[k][(columns[i], columns[j])]);
            for (i, j) in columns.iter().enumerate() {
                g[(i, 0)] -= self.pushes[k][*j];
            }
        }
        for (i, j) in columns.iter().enumerate() {
            h[(i, i)] += self.precision[*j];
        }
        (h, g)
    }

    fn without_part(&self, part: usize) -> Option<Fit> {
        let all: Vec<usize> = (0..self.scale.len()).collect();
        let (h, g) = self.normal((0..self.rows.len()).filter(|k| *k != part), &all);
        let factor = h.llt(Side::Lower).ok()?;
        let (inverse, x) = (factor.inverse(), factor.solve(&g));
        let tested = &self.columns[part];
        let mut left = self.residual_of(part);
        matmul(left.as_mut(), Accum::Add, tested, x.as_ref(), 1.0, Par::Seq);
        let mut hat = Mat::<f64>::zeros(tested.nrows(), inverse.ncols());
        matmul(hat.as_mut(), Accum::Replace, tested, inverse.as_ref(), 1.0, Par::Seq);
        Some(Fit { inverse, x, hat, left })
    }

    /// Residual of a part's rows by the fit of some columns alone to the other parts.
    fn predicted_by(&self, part: usize, columns: &[usize]) -> Option<Mat<f64>> {
        let (h, g) = self.normal((0..self.rows.len()).filter(|k| *k != part), columns);
        let x = h.llt(Side::Lower).ok()?.solve(&g);
        Some(self.residual_of(part) + self.rows_of(part, columns) * x)
    }

    /// Residual of a part's rows without any fit.
    fn residual_of(&self, part: usize) -> Mat<f64> {
        Mat::from_fn(self.rows[part].len(), 1, |i, _| self.linear.residual[self.rows[part][i]])
    }

    fn columns_of(&self, members: &[usize]) -> Vec<usize> {
        self.set.iter().filter(|(c, _)| members.contains(c)).flat_map(|(_, range)| range.clone()).collect()
    }

    /// Residuals (in standard deviations) of all rows, each predicted by the fit without its part, of the set without the candidates `out`
    /// and with `add` in their place. Rows of a fit that fails are not predicted at all (infinite).
    #[must_use]
    pub fn instead(&self, out: &[usize], add: Option<usize>) -> Vec<f64> {
        let o = self.columns_of(out);
        let added = add.map(|c| self.added(c));
        let mut all = vec![f64::INFINITY; self.linear.rows()];
        for (part, fit) in self.fits.iter().enumerate() {
            let Some(left) = self.predicted(part, fit, &o, added.as_ref()) else { continue };
            for (i, row) in self.rows[part].iter().enumerate() {
                all[*row] = left[(i, 0)];
            }
        }
        all
    }

    /// Columns of a candidate, scaled, and their products over each part.
    fn added(&self, candidate: usize) -> Added {
        let (from, to) = self.design.span(candidate);
        let k = to - from;
        let mut columns = Mat::<f64>::zeros(self.linear.rows(), k);
        let mut precision = Vec::with_capacity(k);
        for a in from..to {
            let column = columns.col_as_slice_mut(a - from);
            self.linear.column(a, column);
            let square: f64 = column.iter().map(|v| v * v).sum();
            let scale = if square > 0.0 { 1.0 / square.sqrt() } else { 1.0 };
            column.iter_mut().for_each(|v| *v *= scale);
            precision.push(self.design.prior_precision(a) * scale * scale + DAMPING);
        }
        let sums = |part: usize| {
            let seen = Mat::from_fn(self.rows[part].len(), k, |i, j| columns[(self.rows[part][i], j)]);
            let (with_set, with_itself) = (self.columns[part].transpose() * &seen, seen.transpose() * &seen);
            let push = seen.transpose() * self.residual_of(part);
            Seen { columns: seen, with_set, with_itself, push }
        };
        Added { precision, parts: (0..self.rows.len()).map(sums).collect() }
    }

    fn predicted(&self, part: usize, fit: &Fit, o: &[usize], add: Option<&Added>) -> Option<Mat<f64>> {
        let pick = |m: MatRef<'_, f64>| Mat::from_fn(m.nrows(), o.len(), |i, j| m[(i, o[j])]);
        if o.is_empty() && add.is_none() {
            return Some(fit.left.clone());
        }
        if add.is_none() && 2 * o.len() > self.scale.len() {
            // what is left is less than what goes
            let kept: Vec<usize> = (0..self.scale.len()).filter(|j| !o.contains(j)).collect();
            return self.predicted_by(part, &kept);
        }
        let of_out = Mat::from_fn(o.len(), o.len(), |i, j| fit.inverse[(o[i], o[j])]);
        let factor = of_out.llt(Side::Lower).ok()?;
        let x_out = Mat::from_fn(o.len(), 1, |i, _| fit.x[(o[i], 0)]);
        let y = factor.solve(&x_out);
        let hat_out = pick(fit.hat.as_ref());
        let mut left = &fit.left - &hat_out * &y;
        let Some(added) = add else { return Some(left) };
        // sums over the rows that are fitted
        let (n, k) = (self.scale.len(), added.precision.len());
        let (mut a, mut aa, mut ar) = (Mat::<f64>::zeros(n, k), Mat::<f64>::zeros(k, k), Mat::<f64>::zeros(k, 1));
        for (_, seen) in added.parts.iter().enumerate().filter(|(other, _)| *other != part) {
            a += &seen.with_set;
            aa += &seen.with_itself;
            ar += &seen.push;
        }
        for (j, precision) in added.precision.iter().enumerate() {
            aa[(j, j)] += precision;
        }
        // what the set without its members `o` leaves of the new columns
        let inverse_out = pick(fit.inverse.as_ref());
        let through = factor.solve(&(inverse_out.transpose() * &a));
        let solved = &fit.inverse * &a - &inverse_out * &through;
        let x = &fit.x - &inverse_out * &y;
        let complement = &aa - a.transpose() * &solved;
        let push = &ar + a.transpose() * &x;
        let value = complement.llt(Side::Lower).ok()?.solve(&push);
        let shown = &added.parts[part].columns - (&fit.hat * &a - &hat_out * &through);
        left -= &shown * &value;
        Some(left)
    }

    /// Pose of each row.
    #[must_use]
    pub fn pose_of_row(&self) -> &[usize] {
        &self.linear.pose_of_row
    }

    /// Position errors (m) of the observations of one part, or of all, by residuals as [`Self::instead`] gives them; those that were not
    /// predicted are left out.
    #[must_use]
    pub fn position_errors(&self, residuals: &[f64], part: Option<usize>) -> Vec<f64> {
        let mut scored = vec![part.is_none(); residuals.len()];
        for row in part.map_or(&[][..], |part| &self.rows[part]) {
            scored[*row] = true;
        }
        let mut squares: Vec<(usize, f64)> = Vec::new();
        let rows = residuals.iter().zip(&self.linear.sigma_of_row).zip(scored);
        for ((r, (sigma, observation)), _) in rows.filter(|(_, scored)| *scored) {
            let square = (r * sigma).powi(2);
            match squares.last_mut() {
                Some((last, sum)) if last == observation => *sum += square,
                _ => squares.push((*observation, square)),
            }
        }
        squares.into_iter().map(|(_, s)| s.sqrt()).filter(|e| e.is_finite()).collect()
    }
}
