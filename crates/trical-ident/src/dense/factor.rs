//! The triangular factor of rows, which may come block by block (Householder), and an orthonormal basis of columns.

use pulp::{Arch, NullaryFnOnce};

use super::mat::Mat;
use super::{add, dot};

/// Brings `rows` into the factor `r` of those before them (square, upper triangular, zeros at first). What is left in `rows` is of no use.
pub fn add_rows(r: &mut Mat, rows: &mut Mat) {
    Arch::new().dispatch(Reflect { r, rows });
}

/// An orthonormal basis of the columns of `a`, which has no fewer rows than columns, and the triangular factor in it; a column of zeros has one of
/// zeros.
#[must_use]
pub fn orthonormal(mut a: Mat) -> (Mat, Mat) {
    let n = a.ncols();
    let mut r = Mat::zeros(n, n);
    let sizes = Arch::new().dispatch(Reflect { r: &mut r, rows: &mut a });
    let q = Arch::new().dispatch(Unfold { directions: &a, sizes: &sizes });
    (q, r)
}

/// Reflections that make `[r; rows]` upper triangular: `I - size w w'`, where `w` is 1 in the row of `r`, and its other entries take the place of
/// the column in `rows`. Their sizes.
struct Reflect<'a> {
    r: &'a mut Mat,
    rows: &'a mut Mat,
}

impl NullaryFnOnce for Reflect<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn call(self) -> Vec<f64> {
        let Self { r, rows } = self;
        let mut sizes = vec![0.0; r.ncols()];
        let length = rows.nrows();
        if length == 0 {
            return sizes;
        }
        for (j, size) in sizes.iter_mut().enumerate() {
            let (before, after) = rows.split_at_col_mut(j + 1);
            let own = &mut before[j * length..];
            let square = dot(own, own);
            if square <= 0.0 {
                continue;
            }
            let diagonal = r[(j, j)];
            let new = -(diagonal * diagonal + square).sqrt().copysign(diagonal);
            *size = (new - diagonal) / new;
            r[(j, j)] = new;
            let first = diagonal - new;
            own.iter_mut().for_each(|v| *v /= first);
            for (column, k) in after.chunks_exact_mut(length).zip(j + 1..) {
                let by = *size * (r[(j, k)] + dot(own, column));
                r[(j, k)] -= by;
                add(column, -by, own);
            }
        }
        sizes
    }
}

/// The reflections, the last one first, of ones in the rows of `r`.
struct Unfold<'a> {
    directions: &'a Mat,
    sizes: &'a [f64],
}

impl NullaryFnOnce for Unfold<'_> {
    type Output = Mat;

    #[inline(always)]
    fn call(self) -> Mat {
        let Self { directions, sizes } = self;
        let n = sizes.len();
        let mut q = Mat::zeros(directions.nrows(), n);
        for (j, size) in sizes.iter().enumerate().rev() {
            let own = directions.col(j);
            // of the columns behind it the rows of `r` are zero in row j
            for k in j + 1..n {
                let by = size * dot(own, q.col(k));
                add(q.col_mut(k), -by, own);
            }
            add(q.col_mut(j), -size, own);
        }
        q
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(rows: usize, columns: usize) -> Mat {
        Mat::from_fn(rows, columns, |i, j| (0.7 + (i * i + 5 * j) as f64 * 0.618).fract() - 0.5)
    }

    #[test]
    fn a_factor_of_rows_that_come_in_blocks_has_the_products_of_all() {
        let mut r = Mat::zeros(9, 9);
        let blocks = [drawn(20, 9), drawn(3, 9), drawn(0, 9), drawn(40, 9)];
        let mut products = Mat::zeros(9, 9);
        for mut block in blocks {
            products.add_square(block.view());
            add_rows(&mut r, &mut block);
        }
        products.mirror();
        assert!((r.transpose() * &r - &products).square() < 1e-24);
        assert!((0..9).all(|j| (j + 1..9).all(|i| r[(i, j)] == 0.0)));
    }

    #[test]
    fn a_basis_is_orthonormal_and_has_the_columns() {
        let mut a = drawn(50, 8);
        // all but the same
        (0..50).for_each(|i| a[(i, 5)] = a[(i, 4)] + 1e-9 * a[(i, 5)]);
        a.col_mut(7).fill(0.0);
        let (q, r) = orthonormal(a.clone());
        assert!((&q * &r - &a).square() < 1e-26);
        let mut ones = Mat::identity(8);
        ones[(7, 7)] = 0.0;
        assert!((q.transpose() * &q - &ones).square() < 1e-26);
    }
}
