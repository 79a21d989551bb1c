//! Which columns of a matrix are sums of those before them.

/// Householder's reflections of the columns that are kept, one after the other; a column of which they leave nothing below their triangle
/// is a sum of them.
#[derive(Default)]
pub struct Triangle {
    height: usize,
    /// Columns that are kept.
    pub kept: Vec<usize>,
    reflectors: Vec<f64>,
    /// Kept columns in the triangle, to put dependence into words.
    columns: Vec<Vec<f64>>,
}

impl Triangle {
    /// Of columns of this height.
    pub fn new(height: usize) -> Self {
        Self { height, ..Self::default() }
    }

    /// Keeps column `c`, of length one, if it is no sum of those kept so far.
    ///
    /// # Errors
    /// Of a sum: how much of each kept column is in it.
    pub fn keep(&mut self, c: usize, v: &mut [f64]) -> Result<(), Vec<(usize, f64)>> {
        for (k, u) in self.reflectors.chunks_exact(self.height).enumerate() {
            let d = 2.0 * dot(&u[k..], &v[k..]);
            for (x, y) in v[k..].iter_mut().zip(&u[k..]) {
                *x -= d * y;
            }
        }
        let k = self.kept.len();
        let left = if k < self.height { dot(&v[k..], &v[k..]).sqrt() } else { 0.0 };
        if left <= 1e-6 {
            // back substitution: the column as a sum of kept columns
            let mut share = vec![0.0; k];
            for i in (0..k).rev() {
                let above: f64 = (i + 1..k).map(|j| self.columns[j][i] * share[j]).sum();
                share[i] = (v[i] - above) / self.columns[i][i];
            }
            return Err(self.kept.iter().copied().zip(share).collect());
        }
        let mut u = vec![0.0; self.height];
        u[k..].copy_from_slice(&v[k..]);
        let pivot = if v[k] > 0.0 { -left } else { left };
        u[k] -= pivot;
        let length = dot(&u[k..], &u[k..]).sqrt();
        self.reflectors.extend(u.iter().map(|x| x / length));
        let mut above = v[..k].to_vec();
        above.push(pivot);
        self.columns.push(above);
        self.kept.push(c);
        Ok(())
    }
}

/// Inner product by eight partial sums, which processors take at once.
#[must_use]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a, b) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(x, y)| x * y).sum();
    for (a, b) in a.zip(b) {
        for ((sum, x), y) in sums.iter_mut().zip(a).zip(b) {
            *sum += x * y;
        }
    }
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn a_column_that_is_a_sum_of_those_before_it_is_told_as_that_sum() {
        let mut triangle = Triangle::new(3);
        let (a, b) = ([0.6, 0.8, 0.0], [0.0, 0.6, 0.8]);
        let mut sum: Vec<f64> = a.iter().zip(b).map(|(a, b)| 0.5 * a - 0.25 * b).collect();
        assert_eq!(triangle.keep(0, &mut a.clone()), Ok(()));
        assert_eq!(triangle.keep(2, &mut b.clone()), Ok(()));
        let shares = triangle.keep(3, &mut sum).unwrap_err();
        assert!(shares[0].0 == 0 && (shares[0].1 - 0.5).abs() < 1e-12, "{shares:?}");
        assert!(shares[1].0 == 2 && (shares[1].1 + 0.25).abs() < 1e-12, "{shares:?}");
        assert_eq!((triangle.keep(4, &mut [0.0, 0.0, 1.0]), triangle.kept), (Ok(()), vec![0, 2, 4]));
    }
}
