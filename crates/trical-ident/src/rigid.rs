//! Rigid transforms from pairs of points, in closed form (Arun, Huang & Blostein 1987; Umeyama 1991 for the sign).

use nalgebra::{Matrix3, Vector3};
use trical_model::Pose;

/// How far points moved, root mean square over the points: `parts` are components, each with what tells its point.
pub(crate) fn moved<P: PartialEq>(parts: impl Iterator<Item = (P, f64)>) -> f64 {
    let (mut points, mut square) = (Vec::new(), 0.0);
    for (point, value) in parts {
        square += value * value;
        if !points.contains(&point) {
            points.push(point);
        }
    }
    (square / points.len().max(1) as f64).sqrt()
}

/// The rotation nearest to `m` (in the Frobenius norm, proper).
#[must_use]
pub fn nearest_rotation(m: &Matrix3<f64>) -> Matrix3<f64> {
    let svd = m.svd(true, true);
    let (Some(u), Some(vt)) = (svd.u, svd.v_t) else { return Matrix3::identity() };
    proper(&u, &vt, svd.singular_values.imin())
}

/// `U V'`, the direction of the smallest singular value turned round where that would be a reflection.
fn proper(u: &Matrix3<f64>, vt: &Matrix3<f64>, smallest: usize) -> Matrix3<f64> {
    let mut signs = Vector3::new(1.0, 1.0, 1.0);
    signs[smallest] = (u.determinant() * vt.determinant()).signum();
    u * Matrix3::from_diagonal(&signs) * vt
}

/// `a_from_b` that minimizes the sum of squares of `a_from_b * b - a`. `None` for fewer than three points, or points on
/// a line, which leave a rotation open.
#[must_use]
pub fn rigid_from_points(pairs: &[(Vector3<f64>, Vector3<f64>)]) -> Option<Pose> {
    if pairs.len() < 3 {
        return None;
    }
    let n = pairs.len() as f64;
    let (mut ca, mut cb) = (Vector3::zeros(), Vector3::zeros());
    for (a, b) in pairs {
        ca += a / n;
        cb += b / n;
    }
    let mut h = Matrix3::zeros();
    for (a, b) in pairs {
        h += (a - ca) * (b - cb).transpose();
    }
    let svd = h.svd(true, true);
    let (Some(u), Some(vt)) = (svd.u, svd.v_t) else { return None };
    let s = svd.singular_values;
    let largest = s.max();
    // of three, the one that is neither the largest nor the smallest
    let middle = s.sum() - largest - s.min();
    if middle <= 1e-9 * largest || largest <= 0.0 {
        return None;
    }
    let rotation = proper(&u, &vt, s.imin());
    Some(Pose { rotation, translation: ca - rotation * cb })
}

/// As [`rigid_from_points`], with pairs that disagree with the rest (beyond eight median deviations) left out, thrice.
#[must_use]
pub fn robust_rigid_from_points(pairs: &[(Vector3<f64>, Vector3<f64>)]) -> Option<Pose> {
    let mut pose = rigid_from_points(pairs)?;
    for _ in 0..3 {
        let d: Vec<f64> = pairs.iter().map(|(a, b)| (pose.apply(b) - a).norm()).collect();
        let limit = 8.0 * median(&d) + 1e-9;
        if d.iter().all(|d| *d <= limit) {
            break;
        }
        let kept: Vec<_> = pairs.iter().zip(&d).filter(|(_, d)| **d <= limit).map(|(p, _)| *p).collect();
        match rigid_from_points(&kept) {
            Some(p) => pose = p,
            None => break,
        }
    }
    Some(pose)
}

/// The mean; 0 of nothing.
pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The point whose coordinates are the medians of those of `points`.
#[must_use]
pub fn median_point(points: &[Vector3<f64>]) -> Vector3<f64> {
    Vector3::from_fn(|i, _| median(&points.iter().map(|p| p[i]).collect::<Vec<_>>()))
}

/// The median; 0 of nothing.
#[must_use]
pub fn median(values: &[f64]) -> f64 {
    let mut v = values.to_vec();
    let n = v.len();
    if n == 0 {
        return 0.0;
    }
    let (below, upper, _) = v.select_nth_unstable_by(n / 2, f64::total_cmp);
    if n % 2 == 1 {
        return *upper;
    }
    0.5 * (below.iter().copied().fold(f64::NEG_INFINITY, f64::max) + *upper)
}
