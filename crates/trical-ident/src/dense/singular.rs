//! Singular values.

use nalgebra::DMatrix;

use super::mat::Mat;

/// Singular values, largest first; zeros where an entry is not finite.
#[must_use]
pub fn singular_values(m: &Mat) -> Vec<f64> {
    of(m).map_or_else(|| vec![0.0; m.nrows().min(m.ncols())], |m| sorted(m.singular_values().iter().copied()))
}

/// Square roots of the eigenvalues of `m'm`, largest first: half the work of [`singular_values`], which has all digits where columns are nearly
/// dependent.
#[must_use]
pub fn singular_values_of_products(m: &Mat) -> Vec<f64> {
    let eigenvalues = of(&(m.transpose() * m)).map(|m| m.symmetric_eigenvalues());
    eigenvalues.map_or_else(|| vec![0.0; m.ncols()], |all| sorted(all.iter().map(|e| e.max(0.0).sqrt())))
}

/// Singular values, largest first, and the right singular vector of the smallest; `None` where there is none, or an entry is not finite.
#[must_use]
pub fn weakest(m: &Mat) -> Option<(Vec<f64>, Vec<f64>)> {
    let svd = of(m)?.svd(false, true);
    let smallest = svd.singular_values.imin();
    let vector = svd.v_t?.row(smallest).iter().copied().collect();
    Some((sorted(svd.singular_values.iter().copied()), vector))
}

/// As nalgebra has it, whose iterations end if there is something and all of it is finite.
fn of(m: &Mat) -> Option<DMatrix<f64>> {
    let is_fit = m.nrows() > 0 && m.ncols() > 0 && (0..m.ncols()).all(|j| m.col(j).iter().all(|v| v.is_finite()));
    is_fit.then(|| DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)]))
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut all: Vec<f64> = values.collect();
    all.sort_by(|a, b| b.total_cmp(a));
    all
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn values_and_the_weakest_direction_are_those_that_the_matrix_was_made_of() {
        // two directions of lengths 5 and 0.1, turned by 0.3
        let (s, c) = 0.3_f64.sin_cos();
        let m = Mat::from_fn(3, 2, |i, j| [[5.0 * c, 5.0 * s], [-0.1 * s, 0.1 * c], [0.0, 0.0]][i][j]);
        for s in [singular_values(&m), singular_values_of_products(&m), weakest(&m).unwrap().0] {
            assert!(s.len() == 2 && (s[0] - 5.0).abs() < 1e-12 && (s[1] - 0.1).abs() < 1e-12, "{s:?}");
        }
        let v = weakest(&m).unwrap().1;
        assert!((v[0] * s + v[1] * -c).abs() > 1.0 - 1e-12, "{v:?}");
    }

    #[test]
    fn what_is_empty_or_not_finite_ends() {
        let nothing = Mat::zeros(0, 0);
        assert!(singular_values(&nothing).is_empty() && singular_values_of_products(&nothing).is_empty());
        assert!(weakest(&nothing).is_none());
        let infinite = Mat::from_fn(2, 2, |_, _| f64::INFINITY);
        assert_eq!((singular_values(&infinite), singular_values_of_products(&infinite)), (vec![0.0; 2], vec![0.0; 2]));
        assert!(weakest(&infinite).is_none());
    }
}
