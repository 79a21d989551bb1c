//! A matrix, sums and products.

use std::ops::{Add, AddAssign, Index, IndexMut, Mul, Sub, SubAssign};

use super::product;
use super::view::View;

/// A matrix, column by column.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mat {
    rows: usize,
    columns: usize,
    entries: Vec<f64>,
}

impl Mat {
    /// Zeros.
    #[must_use]
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self { rows, columns, entries: vec![0.0; rows * columns] }
    }

    /// Ones on the diagonal.
    #[must_use]
    pub fn identity(n: usize) -> Self {
        let mut m = Self::zeros(n, n);
        (0..n).for_each(|i| m[(i, i)] = 1.0);
        m
    }

    /// Entries by row and column.
    #[must_use]
    pub fn from_fn(rows: usize, columns: usize, mut of: impl FnMut(usize, usize) -> f64) -> Self {
        let mut entries = Vec::with_capacity(rows * columns);
        for j in 0..columns {
            entries.extend((0..rows).map(|i| of(i, j)));
        }
        Self { rows, columns, entries }
    }

    /// One column.
    #[must_use]
    pub fn column(entries: Vec<f64>) -> Self {
        Self { rows: entries.len(), columns: 1, entries }
    }

    /// How many rows.
    #[must_use]
    pub fn nrows(&self) -> usize {
        self.rows
    }

    /// How many columns.
    #[must_use]
    pub fn ncols(&self) -> usize {
        self.columns
    }

    /// A column.
    #[must_use]
    pub fn col(&self, j: usize) -> &[f64] {
        &self.entries[j * self.rows..(j + 1) * self.rows]
    }

    /// A column.
    pub fn col_mut(&mut self, j: usize) -> &mut [f64] {
        &mut self.entries[j * self.rows..(j + 1) * self.rows]
    }

    /// All entries become `v`.
    pub fn fill(&mut self, v: f64) {
        self.entries.fill(v);
    }

    /// All columns from `j` on, one after the other, and those before them.
    pub(super) fn split_at_col_mut(&mut self, j: usize) -> (&mut [f64], &mut [f64]) {
        self.entries.split_at_mut(j * self.rows)
    }

    /// All of it.
    #[must_use]
    pub fn view(&self) -> View<'_> {
        View { rows: self.rows, columns: self.columns, entries: &self.entries, stride: (1, self.rows) }
    }

    /// The transpose.
    #[must_use]
    pub fn transpose(&self) -> View<'_> {
        self.view().transpose()
    }

    /// The sum of the squares of all entries.
    #[must_use]
    pub fn square(&self) -> f64 {
        super::dot(&self.entries, &self.entries)
    }

    /// Adds `factor a b`.
    pub fn add_product<'a>(&mut self, factor: f64, a: impl Into<View<'a>>, b: impl Into<View<'a>>) {
        let (a, b) = (a.into(), b.into());
        debug_assert!((a.rows, b.columns) == (self.rows, self.columns));
        product::add(&mut self.entries, self.rows, factor, a, b, false);
    }

    /// Adds `x'x` to the lower triangle; what is above is of no use then.
    pub fn add_square(&mut self, x: View<'_>) {
        self.add_symmetric(1.0, x.transpose(), x);
    }

    /// Adds `factor a b`, which is symmetric, to the lower triangle; what is above is of no use then.
    pub fn add_symmetric(&mut self, factor: f64, a: View<'_>, b: View<'_>) {
        debug_assert!((a.rows, b.columns) == (self.rows, self.columns));
        product::add(&mut self.entries, self.rows, factor, a, b, true);
    }

    /// Rows and columns from the first on.
    #[must_use]
    pub fn leading(&self, rows: usize, columns: usize) -> Self {
        self.view().rows(0, rows).columns(0, columns).to_owned()
    }

    /// What is below the diagonal, above it as well.
    pub fn mirror(&mut self) {
        for j in 0..self.columns {
            for i in j + 1..self.rows {
                self[(j, i)] = self[(i, j)];
            }
        }
    }
}

impl View<'_> {
    /// A matrix of its own.
    #[must_use]
    pub fn to_owned(self) -> Mat {
        Mat::from_fn(self.rows, self.columns, |i, j| self.at(i, j))
    }

    /// `x'x`.
    #[must_use]
    pub fn gram(self) -> Mat {
        let mut all = Mat::zeros(self.columns, self.columns);
        all.add_square(self);
        all.mirror();
        all
    }
}

impl<'a> From<&'a Mat> for View<'a> {
    fn from(m: &'a Mat) -> Self {
        m.view()
    }
}

impl Index<(usize, usize)> for Mat {
    type Output = f64;

    fn index(&self, (i, j): (usize, usize)) -> &f64 {
        &self.entries[j * self.rows + i]
    }
}

impl IndexMut<(usize, usize)> for Mat {
    fn index_mut(&mut self, (i, j): (usize, usize)) -> &mut f64 {
        &mut self.entries[j * self.rows + i]
    }
}

impl<'a, B: Into<View<'a>>> Mul<B> for View<'a> {
    type Output = Mat;

    fn mul(self, b: B) -> Mat {
        let b = b.into();
        let mut out = Mat::zeros(self.rows, b.columns);
        out.add_product(1.0, self, b);
        out
    }
}

impl<'a, B: Into<View<'a>>> Mul<B> for &'a Mat {
    type Output = Mat;

    fn mul(self, b: B) -> Mat {
        self.view() * b
    }
}

impl AddAssign<&Self> for Mat {
    fn add_assign(&mut self, other: &Self) {
        super::add(&mut self.entries, 1.0, &other.entries);
    }
}

impl SubAssign<&Self> for Mat {
    fn sub_assign(&mut self, other: &Self) {
        super::add(&mut self.entries, -1.0, &other.entries);
    }
}

impl Add<&Self> for Mat {
    type Output = Self;

    fn add(mut self, other: &Self) -> Self {
        self += other;
        self
    }
}

impl Sub<&Self> for Mat {
    type Output = Self;

    fn sub(mut self, other: &Self) -> Self {
        self -= other;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Entries that have nothing to do with each other.
    fn drawn(rows: usize, columns: usize) -> Mat {
        Mat::from_fn(rows, columns, |i, j| (1.0 + (3 * i + 7 * j) as f64 * 0.618).fract() - 0.4)
    }

    #[test]
    fn products_of_any_shape_are_sums_of_products() {
        let shapes =
            [(1, 1, 1), (8, 4, 300), (9, 5, 7), (1, 6, 20), (17, 1, 33), (3, 13, 0), (70, 30, 1025), (301, 13, 70)];
        for (m, n, k) in shapes {
            let (a, b) = (drawn(m, k), drawn(k, n));
            let (at, bt) = (a.transpose().to_owned(), b.transpose().to_owned());
            let all = [&a * &b, at.transpose() * &b, &a * bt.transpose(), at.transpose() * bt.transpose()];
            for product in all {
                for (i, j) in (0..m).flat_map(|i| (0..n).map(move |j| (i, j))) {
                    let expected: f64 = (0..k).map(|l| a[(i, l)] * b[(l, j)]).sum();
                    assert!((product[(i, j)] - expected).abs() < 1e-12, "{m} {n} {k}: {i} {j}");
                }
            }
        }
    }

    #[test]
    fn a_square_has_the_bits_of_the_product_and_adds_to_what_was_there() {
        for n in [21, 201] {
            let x = drawn(300, n);
            let (mut lower, whole) = (Mat::identity(n), x.transpose() * &x);
            lower.add_square(x.view());
            lower.mirror();
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                assert_eq!(lower[(i, j)], whole[(i, j)] + f64::from(u8::from(i == j)));
            }
        }
    }

    #[test]
    fn parts_of_a_matrix_are_seen_in_place() {
        let m = drawn(6, 5);
        let part = m.view().rows(2, 3).columns(1, 2);
        assert_eq!(part.to_owned(), Mat::from_fn(3, 2, |i, j| m[(i + 2, j + 1)]));
        assert_eq!(part.transpose().to_owned(), Mat::from_fn(2, 3, |i, j| m[(j + 2, i + 1)]));
    }
}
