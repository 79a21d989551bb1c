//! Sums over weighted rows `[J r]`: normal equations and the factor of a QR decomposition, block by block, so that neither
//! grows with the data, and chunk by chunk in order, so that the number of threads changes no bit.

use trical_model::{Forward, Workspace};

use crate::dataset::Observation;
use crate::dense::{Cholesky, Mat, View, add_rows, solve_lower};
use crate::fit::noise::Noise;

/// Rows of a block: a calibration by touches fits into one.
const BLOCK: usize = 192;

/// More columns than this are looked at for those that are zero in a whole block.
const MANY: usize = 128;

/// Observations a chunk.
pub(crate) const CHUNK: usize = 1024;

/// What becomes of the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Keep {
    /// `[J r]'[J r]`.
    Products,
    /// The upper triangular factor of `[J r]`.
    Factor,
    /// `J'r` alone.
    Gradient,
}

/// Sums over rows, `p` parameters wide and the residual as column `p`.
pub(crate) struct Rows {
    p: usize,
    keep: Keep,
    /// Rows of the present block, one after the other.
    block: Vec<f64>,
    /// Lower triangle of the products, or the upper triangular factor; (p + 1) x (p + 1), column by column. Of a gradient the last row
    /// of the products alone.
    sum: Mat,
    /// Half the sum of squares, robust where asked for.
    pub cost: f64,
    jacobian: Vec<f64>,
}

/// Huber's loss of a squared norm: its value and the weight of the rows.
#[inline]
pub(crate) fn huber(square: f64, k: f64) -> (f64, f64) {
    let norm = square.sqrt();
    if norm <= k { (0.5 * square, 1.0) } else { (k * norm - 0.5 * k * k, k / norm) }
}

impl Rows {
    pub fn new(p: usize, keep: Keep) -> Self {
        let width = p + 1;
        Self {
            p,
            keep,
            block: Vec::with_capacity((BLOCK + 6) * width),
            sum: Mat::zeros(width, if keep == Keep::Gradient { 1 } else { width }),
            cost: 0.0,
            jacobian: vec![0.0; 6 * p],
        }
    }

    /// Nothing yet, of the same kind.
    pub fn empty(&self) -> Self {
        Self::new(self.p, self.keep)
    }

    pub fn clear(&mut self) {
        self.block.clear();
        self.sum.fill(0.0);
        self.cost = 0.0;
    }

    /// Adds observations of one state: their rows in units of their standard deviations, weighted by Huber's loss beyond `limit`.
    pub fn observe(&mut self, forward: &Forward, ws: &mut Workspace, seen: &[Observation], noise: &Noise, limit: f64) {
        for (nth, o) in seen.iter().enumerate() {
            let rows = forward.linearize_next(nth > 0, &o.state, (&o.measured, o.frame), ws, &mut self.jacobian);
            self.add_rows_of(o, rows, ws, noise, limit);
        }
    }

    /// Adds the rows of an observation that was linearized.
    fn add_rows_of(&mut self, o: &Observation, rows: usize, ws: &Workspace, noise: &Noise, limit: f64) {
        let p = self.p;
        let mut inverse = [0.0; 6];
        let mut square = 0.0;
        for (k, s) in inverse.iter_mut().enumerate().take(rows) {
            *s = 1.0 / noise.sigma(o.recording, &o.measured, k);
            square += (ws.residual()[k] * *s).powi(2);
        }
        let (cost, weight) = huber(square, limit);
        self.cost += cost;
        let weight = weight.sqrt();
        for (k, s) in inverse.iter().enumerate().take(rows) {
            let w = s * weight;
            self.block.extend(self.jacobian[k * p..(k + 1) * p].iter().map(|v| v * w));
            self.block.push(ws.residual()[k] * w);
        }
        if self.block.len() >= BLOCK * (p + 1) {
            self.flush();
        }
    }

    /// Adds one row, `parameter` times `factor` and the residual `r`.
    pub fn observe_parameter(&mut self, parameter: usize, factor: f64, r: f64) {
        self.block.extend((0..self.p).map(|k| if k == parameter { factor } else { 0.0 }));
        self.block.push(r);
        self.cost += 0.5 * r * r;
        if self.block.len() >= BLOCK * (self.p + 1) {
            self.flush();
        }
    }

    /// Brings the rows of the block into the sum: what is left, after the last row.
    pub fn flush(&mut self) {
        let width = self.p + 1;
        let n = self.block.len() / width;
        if n == 0 {
            return;
        }
        let rows = View::of_rows(&self.block, n, width);
        match self.keep {
            Keep::Products if width > MANY => {
                // what belongs to other sessions than these rows' is zero in all of them
                let used: Vec<usize> = (0..width).filter(|j| (0..n).any(|i| rows.at(i, *j) != 0.0)).collect();
                let few = Mat::from_fn(n, used.len(), |i, j| rows.at(i, used[j]));
                let mut products = Mat::zeros(used.len(), used.len());
                products.add_square(few.view());
                for (k, j) in used.iter().enumerate() {
                    for (l, i) in used.iter().enumerate().skip(k) {
                        self.sum[(*i, *j)] += products[(l, k)];
                    }
                }
            }
            Keep::Products => self.sum.add_square(rows),
            Keep::Gradient => {
                for row in self.block.chunks_exact(width) {
                    self.sum.col_mut(0).iter_mut().zip(row).for_each(|(sum, v)| *sum += v * row[self.p]);
                }
            }
            Keep::Factor => add_rows(&mut self.sum, &mut rows.to_owned()),
        }
        self.block.clear();
    }

    /// Adds the sums of another part of the data.
    pub fn add(&mut self, other: &Self) {
        self.cost += other.cost;
        match self.keep {
            Keep::Products | Keep::Gradient => self.sum += &other.sum,
            Keep::Factor => {
                let width = self.p + 1;
                for i in 0..width {
                    self.block.extend((0..width).map(|j| other.sum[(i, j)]));
                }
                self.flush();
            }
        }
    }

    /// Takes the gradient and the cost of others, whose products are nearly the same.
    pub fn take_gradient(&mut self, of: &Self) {
        for j in 0..=self.p {
            self.sum[(self.p, j)] = of.sum[(j, 0)];
        }
        self.cost = of.cost;
    }

    /// `J'J` at row `i` and column `j`.
    #[inline]
    pub fn h(&self, i: usize, j: usize) -> f64 {
        let (i, j) = if i >= j { (i, j) } else { (j, i) };
        self.sum[(i, j)]
    }

    /// `J'r` at `i`.
    #[inline]
    pub fn g(&self, i: usize) -> f64 {
        self.sum[(self.p, i)]
    }

    /// The factor `R` of `[J r]`, (p + 1) x (p + 1), where it was kept.
    pub fn factor(&self) -> Option<Mat> {
        (self.keep == Keep::Factor).then(|| self.sum.clone())
    }

    /// The first p rows of the factor of `[J r]` from the sums of products. Squares double what rounding does, so that only a
    /// matrix that is far from losing rank keeps its digits that way: whether it is, is for the caller to see. `None` where it
    /// is not even positive.
    pub fn factor_of_products(&self) -> Option<Mat> {
        let p = self.p;
        if self.keep != Keep::Products || p == 0 {
            return None;
        }
        let scale: Vec<f64> = (0..p).map(|j| self.h(j, j).sqrt()).collect();
        let scaled = Mat::from_fn(p, p, |i, j| if i >= j { self.h(i, j) / (scale[i] * scale[j]) } else { 0.0 });
        let factor = Cholesky::of(&scaled)?;
        let lower = factor.lower();
        // Q'r: L y = J'r
        let mut y = Mat::column((0..p).map(|i| self.g(i) / scale[i]).collect());
        solve_lower(lower, &mut y);
        let entry = |i: usize, j: usize| match j {
            _ if j == p => y[(i, 0)],
            _ if j >= i => lower[(j, i)] * scale[j],
            _ => 0.0,
        };
        let r = Mat::from_fn(p, p + 1, entry);
        (0..p).all(|i| r[(i, i)] > 0.0 && (0..=p).all(|j| r[(i, j)].is_finite())).then_some(r)
    }
}

/// The triangular factor of some columns of what has the factor `r`.
pub(crate) fn triangular(r: &Mat, columns: &[usize]) -> Mat {
    let mut chosen = Mat::from_fn(r.nrows(), columns.len(), |i, j| r[(i, columns[j])]);
    let mut factor = Mat::zeros(columns.len(), columns.len());
    add_rows(&mut factor, &mut chosen);
    factor
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Sums of both kinds over the same 700 rows of four parameters and a residual.
    fn both(rows: impl Fn(usize) -> [f64; 5]) -> (Rows, Rows) {
        let of = |keep| {
            let mut sums = Rows::new(4, keep);
            for k in 0..700 {
                sums.block.extend(rows(k));
                if sums.block.len() >= BLOCK * 5 {
                    sums.flush();
                }
            }
            sums.flush();
            sums
        };
        (of(Keep::Products), of(Keep::Factor))
    }

    #[test]
    fn products_and_orthogonal_factors_say_the_same_where_the_columns_are_far_apart() {
        let wave = |k: usize, n: f64| (n * k as f64).sin();
        let row =
            |k| [wave(k, 0.3), 1e-6 * wave(k, 0.7), 1e3 * wave(k, 1.1), wave(k, 0.3) + wave(k, 1.7), wave(k, 2.3)];
        let (products, factor) = both(row);
        let (a, b) = (products.factor_of_products().unwrap(), factor.factor().unwrap());
        assert_eq!((a.nrows(), a.ncols()), (4, 5));
        for i in 0..4 {
            for j in 0..5 {
                // rows of a factor have no sign of their own
                let b = b[(i, j)] * b[(i, i)].signum();
                let size = (0..=j.min(3)).map(|k| a[(k, j)].abs()).fold(0.0, f64::max);
                assert!((a[(i, j)] - b).abs() < 1e-13 * size, "{i} {j}: {} {b}", a[(i, j)]);
            }
        }
    }

    #[test]
    fn parts_that_are_added_say_what_all_rows_together_say() {
        let row = |k: usize| [(k as f64).sin(), 1.0, (0.1 * k as f64).cos(), (0.3 * k as f64).sin(), 0.5 - k as f64];
        for keep in [Keep::Products, Keep::Factor] {
            let of = |rows: std::ops::Range<usize>| {
                let mut sums = Rows::new(4, keep);
                rows.for_each(|k| sums.block.extend(row(k)));
                sums.flush();
                sums
            };
            let (mut parts, all) = (of(0..100), of(0..300));
            parts.add(&of(100..150));
            parts.add(&of(150..300));
            let [parts, all] = [parts, all].map(|r| r.factor().or_else(|| r.factor_of_products()).unwrap());
            for i in 0..4 {
                let sign = (parts[(i, i)] * all[(i, i)]).signum();
                assert!(
                    (0..5).all(|j| (parts[(i, j)] - sign * all[(i, j)]).abs() < 1e-9 * all[(0, 4)].abs()),
                    "{keep:?}"
                );
            }
        }
    }

    #[test]
    fn products_of_columns_that_are_the_same_have_no_factor_and_neither_has_a_column_of_zeros() {
        let (same, _) = both(|k| [k as f64, 1.0, k as f64, (k * k) as f64, 0.5]);
        assert!(same.factor_of_products().is_none_or(|r| r[(2, 2)] < 1e-6 * r[(0, 2)]));
        let (zero, _) = both(|k| [k as f64, 1.0, 0.0, (k * k) as f64, 0.5]);
        assert!(zero.factor_of_products().is_none());
        let (_, factor) = both(|k| [k as f64, 1.0, 2.0, 3.0, 0.5]);
        assert!(factor.factor_of_products().is_none());
    }

    #[test]
    fn of_many_columns_those_that_are_zero_in_a_block_add_nothing() {
        // sessions one after the other, each with a column of its own beside one that all share
        let p = MANY + 40;
        let row = |k: usize, j: usize| match j {
            0 => 1.0 + (k as f64).sin(),
            _ if j == p => 0.5 - 0.01 * k as f64,
            _ if j == 1 + k / 20 => (0.7 * k as f64).cos(),
            _ => 0.0,
        };
        let mut sums = Rows::new(p, Keep::Products);
        for k in 0..2000 {
            sums.block.extend((0..=p).map(|j| row(k, j)));
            if sums.block.len() >= BLOCK * (p + 1) {
                sums.flush();
            }
        }
        sums.flush();
        for i in 0..p {
            for j in 0..=i {
                let expected: f64 = (0..2000).map(|k| row(k, i) * row(k, j)).sum();
                assert!((sums.h(i, j) - expected).abs() < 1e-9, "{i} {j}");
            }
            let expected: f64 = (0..2000).map(|k| row(k, i) * row(k, p)).sum();
            assert!((sums.g(i) - expected).abs() < 1e-7, "{i}");
        }
    }
}
