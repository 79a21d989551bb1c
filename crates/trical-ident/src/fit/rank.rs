//! Which columns of a matrix are sums of those before them.

use pulp::{Arch, NullaryFnOnce};

use crate::dense::dot;

/// Orthonormal directions of the columns that are kept, one after the other (modified Gram-Schmidt, with a second pass where the first leaves little:
/// Daniel, Gragg, Kaufman & Stewart 1976); a column of which they leave nothing is a sum of them.
#[derive(Default)]
pub struct Triangle {
    /// Columns that are kept.
    pub kept: Vec<usize>,
    directions: Vec<Direction>,
    /// What each kept column has of the directions up to its own, to put dependence into words.
    columns: Vec<Vec<f64>>,
}

/// A direction where it is not zero: columns of one session have nothing in the rows of others.
struct Direction {
    from: usize,
    along: Vec<f64>,
}

impl Direction {
    fn of(v: &[f64], length: f64) -> Self {
        let from = v.iter().position(|x| *x != 0.0).unwrap_or(0);
        let to = v.iter().rposition(|x| *x != 0.0).map_or(from, |last| last + 1);
        Self { from, along: v[from..to].iter().map(|x| x / length).collect() }
    }

    /// Takes its part out of a vector; how much that was.
    #[inline(always)]
    fn out_of(&self, v: &mut [f64]) -> f64 {
        let v = &mut v[self.from..self.from + self.along.len()];
        let part = dot(&self.along, v);
        for (x, u) in v.iter_mut().zip(&self.along) {
            *x -= part * u;
        }
        part
    }
}

/// Takes the parts of directions out of a vector, one after the other; how much each was.
struct Out<'a> {
    of: &'a mut [f64],
    directions: &'a [Direction],
}

impl NullaryFnOnce for Out<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn call(self) -> Vec<f64> {
        let mut parts = Vec::with_capacity(self.directions.len() + 1);
        for direction in self.directions {
            parts.push(direction.out_of(self.of));
        }
        parts
    }
}

impl Triangle {
    /// Keeps column `c`, of length one, if it is no sum of those kept so far.
    ///
    /// # Errors
    /// Of a sum: how much of each kept column is in it.
    pub fn keep(&mut self, c: usize, v: &mut [f64]) -> Result<(), Vec<(usize, f64)>> {
        let out = |of: &mut [f64]| Arch::new().dispatch(Out { of, directions: &self.directions });
        let mut parts = out(v);
        let mut left = dot(v, v).sqrt();
        if left < LITTLE {
            parts.iter_mut().zip(out(v)).for_each(|(part, more)| *part += more);
            left = dot(v, v).sqrt();
        }
        if left <= 1e-6 {
            // back substitution: the column as a sum of kept columns
            let k = self.kept.len();
            let mut share = vec![0.0; k];
            for i in (0..k).rev() {
                let above: f64 = (i + 1..k).map(|j| self.columns[j][i] * share[j]).sum();
                share[i] = (parts[i] - above) / self.columns[i][i];
            }
            return Err(self.kept.iter().copied().zip(share).collect());
        }
        self.directions.push(Direction::of(v, left));
        parts.push(left);
        self.columns.push(parts);
        self.kept.push(c);
        Ok(())
    }
}

/// Of a column of length one: where less is left, rounding shows in what is left.
const LITTLE: f64 = 0.1;

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn a_column_that_is_a_sum_of_those_before_it_is_told_as_that_sum() {
        let mut triangle = Triangle::default();
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
