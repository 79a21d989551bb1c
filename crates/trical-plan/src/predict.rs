//! What touches leave to be expected: standard deviations of the parameters, and of where the tool will be.
//!
//! This is what noise alone does. What the model lacks comes on top: a plan can only say where it would not be seen.

use nalgebra::{DMatrix, DVector, Vector3};
use rand::RngExt;
use trical_model::{Forward, Joints, Measured, State, trig};

use crate::random::generator;

/// A sphere in {w} in which the arm is to be accurate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// In {w}, m.
    pub centre: Vector3<f64>,
    /// m.
    pub radius: f64,
}

impl Sphere {
    /// The paper's kind of sphere: 0.4 m across, its centre 0.1 m above the middle of the balls.
    #[must_use]
    pub fn above(balls: &[Vector3<f64>]) -> Option<Self> {
        if balls.is_empty() {
            return None;
        }
        let middle = balls.iter().sum::<Vector3<f64>>() / balls.len() as f64;
        Some(Self { centre: middle + Vector3::new(0.0, 0.0, 0.1), radius: 0.2 })
    }
}

/// The position error that noise leaves to be expected over many poses, m.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PredictedError {
    /// Mean length over poses and over repetitions of the whole calibration.
    pub mean_m: f64,
    /// Root mean square of the same.
    pub rms_m: f64,
    /// Root mean square at the worst of the poses.
    pub worst_rms_m: f64,
    /// How many poses.
    pub poses: usize,
}

/// How the free terms of `forward` move the tool centre point in {w} at poses: three rows each, of as many numbers as there are
/// free terms.
#[must_use]
pub fn tool_rows(forward: &Forward, poses: &[Joints]) -> Vec<f64> {
    let p = forward.free().len();
    let mut rows = vec![0.0; 3 * p * poses.len()];
    let mut ws = forward.workspace();
    // a touch compares the tool with a ball in {w}, and nothing free here moves a ball
    let measured = Measured::Touch { ball: 0, reading: [0.0; 3] };
    for (q, block) in poses.iter().zip(rows.chunks_exact_mut((3 * p).max(1))) {
        forward.linearize(&State::at(q), &measured, 0, &mut ws, block);
    }
    rows
}

/// Covariance of the columns `kept` of `p` by Jacobian rows, for independent noise of standard deviation `sigma` in each row, in
/// the columns' units. `None` where the rows do not determine them.
#[must_use]
pub fn covariance(rows: &[f64], p: usize, kept: &[usize], sigma: f64) -> Option<DMatrix<f64>> {
    if p == 0 || kept.iter().any(|k| *k >= p) {
        return None;
    }
    let mut j = DMatrix::from_row_slice(rows.len() / p, p, rows).select_columns(kept);
    if j.nrows() < j.ncols() {
        return None;
    }
    let scale: Vec<f64> = j.column_iter().map(|c| if c.norm() > 0.0 { 1.0 / c.norm() } else { 1.0 }).collect();
    for (mut column, s) in j.column_iter_mut().zip(&scale) {
        column *= *s;
    }
    let r = j.qr().r();
    // columns have unit length, so a diagonal this small is rounding
    if r.diagonal().iter().any(|d| d.abs() < 1e-10) {
        return None;
    }
    let back = r.try_inverse()?;
    let mut c = &back * back.transpose() * (sigma * sigma);
    for (i, s) in scale.iter().enumerate() {
        c.row_mut(i).scale_mut(*s);
        c.column_mut(i).scale_mut(*s);
    }
    c.iter().all(|x| x.is_finite()).then_some(c)
}

/// Repetitions of the calibration from which the mean is taken.
const DRAWS: u64 = 200;

/// What a covariance of the columns `kept` means for the tool at poses with `tool_rows` of `p` columns. `None` for no poses.
#[must_use]
pub fn predicted_error(
    tool_rows: &[f64],
    p: usize,
    kept: &[usize],
    covariance: &DMatrix<f64>,
) -> Option<PredictedError> {
    let k = DMatrix::from_row_slice(tool_rows.len() / p.max(1), p, tool_rows).select_columns(kept);
    let poses = k.nrows() / 3;
    if poses == 0 {
        return None;
    }
    // scaled, or parameters of small units would make the factor fail
    let size: Vec<f64> = covariance.diagonal().iter().map(|x| x.max(1e-300).sqrt()).collect();
    let scaled = DMatrix::from_fn(kept.len(), kept.len(), |i, j| covariance[(i, j)] / (size[i] * size[j]));
    let mut l = scaled.cholesky()?.l();
    for (mut row, s) in l.row_iter_mut().zip(&size) {
        row *= *s;
    }
    let moves = k * l;
    let count = poses as f64;
    let squares: Vec<f64> = (0..poses).map(|i| moves.rows(3 * i, 3).norm_squared()).collect();
    let mut sum = 0.0;
    for draw in 0..DRAWS {
        let mut rng = generator(1, 9, draw);
        let x = DVector::from_fn(kept.len(), |_, _| {
            // Box and Muller
            let (u, v) = (1.0 - rng.random::<f64>(), rng.random::<f64>());
            (-2.0 * libm::log(u)).sqrt() * trig::cos(std::f64::consts::TAU * v)
        });
        let e = &moves * x;
        sum += (0..poses).map(|i| e.rows(3 * i, 3).norm()).sum::<f64>() / count;
    }
    let mean_m = sum / DRAWS as f64;
    Some(PredictedError {
        mean_m,
        rms_m: (squares.iter().sum::<f64>() / count).sqrt(),
        worst_rms_m: squares.iter().copied().fold(0.0, f64::max).sqrt(),
        poses,
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

    use super::*;

    #[test]
    fn of_a_mean_of_readings_everything_is_known_by_hand() {
        // four touches that each see three coordinates with 0.01 mm: 0.005 mm each, and the tool goes with them
        let eye = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        let c = covariance(&eye.repeat(4), 3, &[0, 1, 2], 1e-5).unwrap();
        for i in 0..3 {
            assert!((c[(i, i)].sqrt() - 5e-6).abs() < 1e-15);
        }
        let e = predicted_error(&eye, 3, &[0, 1, 2], &c).unwrap();
        assert!((e.rms_m - 5e-6 * 3.0_f64.sqrt()).abs() < 1e-12);
        assert!((e.worst_rms_m - e.rms_m).abs() < 1e-15);
        // mean length of a normal vector: sqrt(8 / pi) of one coordinate's; 200 draws know it to 3 percent
        let mean = 5e-6 * (8.0 / std::f64::consts::PI).sqrt();
        assert!((e.mean_m / mean - 1.0).abs() < 0.1, "{} {mean}", e.mean_m);
    }

    #[test]
    fn what_rows_do_not_determine_has_no_covariance() {
        assert!(covariance(&[1.0, 2.0], 2, &[0, 1], 1.0).is_none());
        assert!(covariance(&[1.0, 2.0, 2.0, 4.0], 2, &[0, 1], 1.0).is_none());
        assert!(covariance(&[1.0, 2.0], 2, &[2], 1.0).is_none());
        assert!(predicted_error(&[], 2, &[0, 1], &DMatrix::identity(2, 2)).is_none());
    }
}
