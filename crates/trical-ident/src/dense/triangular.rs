//! Cholesky's factor, and what is solved with it: block by block, so that most of the work is products.

use pulp::{Arch, NullaryFnOnce};

use super::mat::Mat;
use super::view::View;
use super::{add, dot, product};

/// Columns of a block.
const BLOCK: usize = 32;

/// Cholesky's factor: `m = L L'`.
#[derive(Clone, Debug)]
pub struct Cholesky {
    lower: Mat,
}

impl Cholesky {
    /// Of a symmetric matrix, of which the lower triangle is read; `None` where it is not positive definite.
    #[must_use]
    pub fn of(m: &Mat) -> Option<Self> {
        let n = m.nrows();
        let mut lower = Mat::from_fn(n, n, |i, j| if i >= j { m[(i, j)] } else { 0.0 });
        for from in (0..n).step_by(BLOCK) {
            let wide = BLOCK.min(n - from);
            let (before, panel) = lower.split_at_col_mut(from);
            let known = View { rows: n, columns: from, entries: before, stride: (1, n) }.rows(from, n - from);
            let own = known.rows(0, wide).transpose();
            product::add(&mut panel[from..], n, -1.0, known, own, true);
            if !Arch::new().dispatch(Panel { entries: &mut panel[..wide * n], from, n }) {
                return None;
            }
        }
        Some(Self { lower })
    }

    /// `L`, with zeros above.
    #[must_use]
    pub fn lower(&self) -> &Mat {
        &self.lower
    }

    /// `m^-1 b`.
    #[must_use]
    pub fn solve(&self, b: &Mat) -> Mat {
        let mut x = b.clone();
        solve_lower(&self.lower, &mut x);
        solve_upper(&self.lower, &mut x);
        x
    }

    /// `m^-1`.
    #[must_use]
    pub fn inverse(&self) -> Mat {
        let n = self.lower.nrows();
        let mut root = Mat::identity(n);
        // column `j` of `L^-1` is zero above `j`
        for from in (0..n).step_by(BLOCK) {
            let wide = BLOCK.min(n - from);
            let (_, columns) = root.split_at_col_mut(from);
            solve_from(&self.lower, from, &mut columns[..wide * n]);
        }
        let mut inverse = Mat::zeros(n, n);
        for from in (0..n).step_by(BLOCK) {
            let wide = BLOCK.min(n - from);
            let (_, columns) = inverse.split_at_col_mut(from);
            let below = root.view().rows(from, n - from);
            let (all, own) = (below.columns(from, n - from), below.columns(from, wide));
            product::add(&mut columns[from..], n, 1.0, all.transpose(), own, true);
        }
        inverse.mirror();
        inverse
    }
}

/// Turns the columns of a block, from which those before it were taken out, into columns of the factor; false where it is not positive.
struct Panel<'a> {
    entries: &'a mut [f64],
    from: usize,
    n: usize,
}

impl NullaryFnOnce for Panel<'_> {
    type Output = bool;

    #[inline(always)]
    fn call(self) -> bool {
        let Self { entries, from, n } = self;
        for c in 0..entries.len() / n {
            let (own, after) = entries[c * n..].split_at_mut(n);
            // a product leaves what is of no use there
            own[from..from + c].fill(0.0);
            let own = &mut own[from + c..];
            let root = own[0].sqrt();
            if root.is_nan() || root <= 0.0 || root.is_infinite() {
                return false;
            }
            own[0] = root;
            own[1..].iter_mut().for_each(|v| *v /= root);
            for (k, column) in after.chunks_exact_mut(n).enumerate() {
                let below = &own[k + 1..];
                add(&mut column[from + c + k + 1..], -below[0], below);
            }
        }
        true
    }
}

/// Turns `m` into `L^-1 m`; what is above the diagonal of `lower` is not read.
pub fn solve_lower(lower: &Mat, m: &mut Mat) {
    solve_from(lower, 0, m.split_at_col_mut(0).1);
}

/// Turns long rows, those of a matrix `m`, into the rows of `L^-1 m`.
pub fn solve_lower_rows(lower: &Mat, rows: &mut [Vec<f64>]) {
    Arch::new().dispatch(SubstituteRows { lower, rows });
}

struct SubstituteRows<'a> {
    lower: &'a Mat,
    rows: &'a mut [Vec<f64>],
}

impl NullaryFnOnce for SubstituteRows<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { lower, rows } = self;
        let length = rows.first().map_or(0, Vec::len);
        // what stays near the processor
        for from in (0..length).step_by(1024) {
            let some = from..length.min(from + 1024);
            for k in 0..rows.len() {
                let (known, own) = rows.split_at_mut(k);
                let own = &mut own[0][some.clone()];
                for (j, known) in known.iter().enumerate() {
                    add(own, -lower[(k, j)], &known[some.clone()]);
                }
                own.iter_mut().for_each(|v| *v /= lower[(k, k)]);
            }
        }
    }
}

/// The same of columns that are zero above row `from`.
fn solve_from(lower: &Mat, from: usize, columns: &mut [f64]) {
    let n = lower.nrows();
    if n == 0 || columns.is_empty() {
        return;
    }
    let k = columns.len() / n;
    let block = if k < 4 { n } else { BLOCK };
    for at in (from..n).step_by(block) {
        let end = n.min(at + block);
        Arch::new().dispatch(Substitute { lower, columns, at, end, transposed: false });
        if end < n {
            let solved: Vec<f64> = columns.chunks_exact(n).flat_map(|c| &c[at..end]).copied().collect();
            let solved = View { rows: end - at, columns: k, entries: &solved, stride: (1, end - at) };
            let below = lower.view().columns(at, end - at).rows(end, n - end);
            product::add(&mut columns[end..], n, -1.0, below, solved, false);
        }
    }
}

/// Turns `m` into `L'^-1 m`.
fn solve_upper(lower: &Mat, m: &mut Mat) {
    let (n, k) = (m.nrows(), m.ncols());
    let block = if k < 4 { n.max(1) } else { BLOCK };
    for at in (0..n).step_by(block).rev() {
        let end = n.min(at + block);
        if end < n {
            let own = lower.view().columns(at, end - at).rows(end, n - end).transpose();
            let known = own * m.view().rows(end, n - end);
            for j in 0..k {
                add(&mut m.col_mut(j)[at..end], -1.0, known.col(j));
            }
        }
        Arch::new().dispatch(Substitute { lower, columns: m.split_at_col_mut(0).1, at, end, transposed: true });
    }
}

/// Substitution in the rows `at..end` of columns.
struct Substitute<'a> {
    lower: &'a Mat,
    columns: &'a mut [f64],
    at: usize,
    end: usize,
    transposed: bool,
}

impl NullaryFnOnce for Substitute<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { lower, columns, at, end, transposed } = self;
        for column in columns.chunks_exact_mut(lower.nrows()) {
            if transposed {
                for i in (at..end).rev() {
                    let l = lower.col(i);
                    column[i] = (column[i] - dot(&l[i + 1..end], &column[i + 1..end])) / l[i];
                }
            } else {
                for i in at..end {
                    let l = lower.col(i);
                    let x = column[i] / l[i];
                    column[i] = x;
                    add(&mut column[i + 1..end], -x, &l[i + 1..end]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// A positive definite matrix.
    fn positive(n: usize) -> Mat {
        let x = Mat::from_fn(n + 3, n, |i, j| (0.3 + (i * i + 5 * j) as f64 * 0.618).fract() - 0.5);
        let mut m = x.transpose() * &x;
        (0..n).for_each(|i| m[(i, i)] += 0.1);
        m
    }

    #[test]
    fn factors_solve_and_invert_at_any_size() {
        for n in [0, 1, 5, 32, 33, 100] {
            let m = positive(n);
            let factor = Cholesky::of(&m).unwrap();
            let product = factor.lower() * factor.lower().transpose();
            let inverse = &m * &factor.inverse();
            for columns in [1, 7] {
                let b = Mat::from_fn(n, columns, |i, j| (i + 3 * j) as f64);
                let back = &m * &factor.solve(&b);
                assert!((back - &b).square() < 1e-16 * (1.0 + b.square()), "{n}");
                let (mut by_columns, mut rows) = (b.clone(), (0..n).map(|i| vec![b[(i, 0)]; 1500]).collect::<Vec<_>>());
                solve_lower(factor.lower(), &mut by_columns);
                solve_lower_rows(factor.lower(), &mut rows);
                let mut first = by_columns.col(0).iter().zip(&rows);
                assert!(first.all(|(v, row)| row.iter().all(|w| (w - v).abs() < 1e-9 * (1.0 + v.abs()))));
            }
            assert!((product - &m).square() < 1e-24 && (inverse - &Mat::identity(n)).square() < 1e-20, "{n}");
            assert!((0..n).all(|j| factor.lower().col(j)[..j].iter().all(|v| *v == 0.0)));
        }
    }

    #[test]
    fn what_is_not_positive_has_no_factor() {
        let mut m = positive(40);
        m[(39, 39)] = -1.0;
        assert!(Cholesky::of(&m).is_none());
        assert!(Cholesky::of(&Mat::zeros(2, 2)).is_none());
        assert!(Cholesky::of(&Mat::from_fn(2, 2, |_, _| f64::NAN)).is_none());
    }
}
