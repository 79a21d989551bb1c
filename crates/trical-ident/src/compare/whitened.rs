//! Residuals and columns with unit covariance, what is new projected out.

use std::collections::BTreeMap;

use trical_model::Forward;

use super::explanation::{Daily, Explained, Explanation};
use super::settings::NEW_SHARE;
use crate::dataset::Dataset;
use crate::dense::{Cholesky, Mat, dot, solve_lower};
use crate::error::{IdentError, Result};
use crate::fit::residuals::check_observations;
use crate::model_file::Uncertainty;
use crate::validate::predicted::covariance;

/// Residuals and columns that are independent, with standard deviation 1.
pub(super) struct Whitened<'a> {
    pub explained: &'a Explained,
    pub residual: Vec<f64>,
    /// Columns of each explanation, in their order.
    pub columns: Vec<Vec<Vec<f64>>>,
    /// Scalars that were measured.
    pub rows: usize,
    /// Pose of each.
    poses: Vec<usize>,
    /// By how much the variance of what no explanation takes up is larger than it was, at least 1.
    pub more_noise: f64,
    /// Orthonormal directions of all that may have changed of the machine, and how many directions are new in any case.
    machine: Vec<Vec<f64>>,
    new: usize,
}

/// Takes out of `v` what lies along the orthonormal `basis`, twice for the digits.
pub(super) fn project_out(v: &mut [f64], basis: &[Vec<f64>]) {
    for _ in 0..2 {
        for q in basis {
            let d = dot(v, q);
            v.iter_mut().zip(q).for_each(|(x, y)| *x -= d * y);
        }
    }
}

/// Adds directions of `columns` that the orthonormal `basis` does not have; how many.
pub(super) fn extend(basis: &mut Vec<Vec<f64>>, columns: &[Vec<f64>]) -> usize {
    let before = basis.len();
    for c in columns {
        let whole = dot(c, c).sqrt();
        let mut v = c.clone();
        project_out(&mut v, basis);
        let left = dot(&v, &v).sqrt();
        if left > NEW_SHARE * whole && whole > 0.0 {
            v.iter_mut().for_each(|x| *x /= left);
            basis.push(v);
        }
    }
    basis.len() - before
}

impl<'a> Whitened<'a> {
    pub fn of(explained: &'a Explained, data: &Dataset, old: &Uncertainty) -> Result<Self> {
        let Explained { model, explanations, calibrated, new, of_the_day, beyond } = explained;
        let asked = explanations.iter().flat_map(|e| e.terms.clone());
        let all: Vec<usize> = calibrated
            .iter()
            .map(|o| o.0)
            .chain(new.iter().copied())
            .chain(asked)
            .chain(of_the_day.iter().map(|d| d.0))
            .collect();
        let forward = Forward::new(model.clone(), all)?;
        let Linearized { jacobian, residual, spans } = Linearized::of(&forward, data, old)?;
        let (rows, m) = (residual.len(), calibrated.len());
        let of_calibrated = jacobian.view().columns(0, m);
        let mut sigma = &(of_calibrated * &covariance(model, old, calibrated)) * of_calibrated.transpose();
        let effects = (old.effects / old.noise).powi(2);
        for ((from, n), beyond) in spans.iter().zip(beyond) {
            (*from..from + n).for_each(|i| sigma[(i, i)] += if *beyond { 1.0 + effects } else { 1.0 });
        }
        let first = forward.free().len() - of_the_day.len();
        let square = |c: usize| dot(jacobian.col(c), jacobian.col(c)) / rows as f64;
        let of_course = of_the_day.iter().filter(|d| matches!(d.1, Daily::Course)).count();
        for (c, (_, daily)) in (first..).zip(of_the_day) {
            let sd = match daily {
                Daily::Sd(sd) => *sd,
                Daily::Course => old.course / old.noise / (square(c) * of_course as f64).sqrt(),
            };
            if sd.is_finite() {
                let column = jacobian.view().columns(c, 1);
                sigma.add_product(sd * sd, column, column.transpose());
            }
        }
        // rounded correlations may be a hair from positive
        let factor = Cholesky::of(&sigma).ok_or_else(|| {
            IdentError::WrongModel("[uncertainty] of the model file: its correlations are of no real fit".into())
        })?;
        let white = |v: Vec<f64>| {
            let mut column = Mat::column(v);
            solve_lower(factor.lower(), &mut column);
            column.col(0).to_vec()
        };
        let column = |c: usize| white((0..rows).map(|i| jacobian[(i, c)]).collect());
        let mut nuisance = Vec::new();
        let taken: Vec<Vec<f64>> = (0..new.len()).map(|k| column(m + k)).collect();
        let count = extend(&mut nuisance, &taken);
        let freed = |mut v: Vec<f64>| {
            let whole = dot(&v, &v);
            project_out(&mut v, &nuisance);
            // digits that are left of what is taken up are nothing
            if dot(&v, &v) < 1e-12 * whole {
                v.fill(0.0);
            }
            v
        };
        let unit = |row: usize| (0..rows).map(|i| f64::from(u8::from(i == row))).collect();
        let mut next = m + new.len();
        let columns_of = |e: &Explanation| -> Vec<Vec<f64>> {
            if let Some(measurement) = e.measurement {
                let (from, n) = spans[measurement];
                return (from..from + n).map(|row| freed(white(unit(row)))).collect();
            }
            let own = next..next + e.terms.len();
            next = own.end;
            own.map(|c| freed(column(c))).collect()
        };
        let columns: Vec<Vec<Vec<f64>>> = explanations.iter().map(columns_of).collect();
        let residual = freed(white(residual));
        let mut machine = Vec::new();
        for (_, columns) in explanations.iter().zip(&columns).filter(|(e, _)| e.is_of_machine()) {
            extend(&mut machine, columns);
        }
        let poses =
            data.observations.iter().zip(&spans).flat_map(|(o, (_, n))| std::iter::repeat_n(o.pose, *n)).collect();
        let mut this = Self { explained, residual, columns, rows, poses, more_noise: 1.0, machine, new: count };
        this.leave_out(&[]);
        Ok(this)
    }

    /// Does not count what measurements that are wrong scatter: these explanations of them were taken.
    pub fn leave_out(&mut self, wrong: &[usize]) {
        let mut basis = self.machine.clone();
        for k in wrong {
            extend(&mut basis, &self.columns[*k]);
        }
        let mut left = self.residual.clone();
        project_out(&mut left, &basis);
        self.more_noise = more_noise(&left, self.new + basis.len()) * shared(&left, &basis, &self.poses);
    }
}

/// By how much the variance of what is `left` beside so many directions that were `taken` up is larger than 1; 1 where it is smaller, or too
/// few degrees of freedom are left.
fn more_noise(left: &[f64], taken: usize) -> f64 {
    let rows = left.len();
    let freedom = rows.saturating_sub(taken);
    if freedom < 6 {
        return 1.0;
    }
    // by the median, which one wrong measurement does not move: that of chi-squared with one degree of freedom is 0.4549
    let mut squares: Vec<f64> = left.iter().map(|x| x * x).collect();
    squares.sort_by(f64::total_cmp);
    let share = rows as f64 / freedom as f64;
    (squares[squares.len() / 2] / 0.4549 * share).max(1.0)
}

/// By how much larger than by independent measurements the variance along the orthonormal `basis` is, since all that is seen at one pose
/// shares what the model lacks there; at least 1. The sums over poses of the parts of what is `left` beside the basis, and what they would be.
fn shared(left: &[f64], basis: &[Vec<f64>], poses: &[usize]) -> f64 {
    let mut by_pose: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    poses.iter().enumerate().for_each(|(row, pose)| by_pose.entry(*pose).or_default().push(row));
    let freedom = left.len().saturating_sub(basis.len()).max(1) as f64;
    let variance = dot(left, left) / freedom;
    let (mut found, mut expected) = (0.0, 0.0);
    for rows in by_pose.values() {
        let along = |a: &[f64], b: &[f64]| rows.iter().map(|row| a[*row] * b[*row]).sum::<f64>();
        for d in basis {
            found += along(d, left).powi(2);
            expected += variance * (along(d, d) - basis.iter().map(|b| along(d, b).powi(2)).sum::<f64>());
        }
    }
    if expected > 0.0 { (found / expected).max(1.0) } else { 1.0 }
}

/// Derivatives to the free terms of a model, and residuals, in standard deviations of the noise.
struct Linearized {
    jacobian: Mat,
    residual: Vec<f64>,
    /// First row of each observation, and how many it has.
    spans: Vec<(usize, usize)>,
}

impl Linearized {
    fn of(forward: &Forward, data: &Dataset, old: &Uncertainty) -> Result<Self> {
        check_observations(forward, data)?;
        // of a model that no poses were measured for: as uncertain as the position a quarter of a metre away
        let rotation_noise = old.rotation_noise.unwrap_or(4.0 * old.noise);
        let (rows, p) = (data.scalars(), forward.free().len());
        let (mut jacobian, mut residual, mut spans) = (Mat::zeros(rows, p), vec![0.0; rows], Vec::new());
        let (mut ws, mut buffer, mut at) = (forward.workspace(), vec![0.0; 6 * p], 0);
        for o in &data.observations {
            let n = forward.linearize(&o.state, &o.measured, o.frame, &mut ws, &mut buffer);
            for k in 0..n {
                let sigma = if k < 3 { old.noise } else { rotation_noise };
                residual[at + k] = ws.residual()[k] / sigma;
                (0..p).for_each(|c| jacobian[(at + k, c)] = buffer[k * p + c] / sigma);
            }
            spans.push((at, n));
            at += n;
        }
        Ok(Self { jacobian, residual, spans })
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use super::{extend, project_out, shared};

    #[test]
    fn what_all_rows_of_a_pose_share_counts_once() {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(3);
        let (poses, rows) = (60, 6);
        let of_pose: Vec<usize> = (0..poses * rows).map(|row| row / rows).collect();
        let mut numbers = |count: usize| -> Vec<f64> { (0..count).map(|_| rng.random_range(-1.0..1.0)).collect() };
        let mut basis = Vec::new();
        // each direction has one sign at each pose, as the motion of a joint has
        let directions: Vec<Vec<f64>> =
            (0..5).map(|_| numbers(poses)).map(|d| of_pose.iter().map(|p| d[*p]).collect()).collect();
        extend(&mut basis, &directions);
        let of = |mut residual: Vec<f64>| {
            project_out(&mut residual, &basis);
            shared(&residual, &basis, &of_pose)
        };
        let apart = of(numbers(poses * rows));
        let of_poses = numbers(poses);
        let together = of(of_pose.iter().map(|p| of_poses[*p]).collect());
        assert!(apart < 1.3 && (4.5..7.5).contains(&together), "{apart} {together}");
    }

    #[test]
    fn what_is_all_but_said_by_others_is_no_other_direction() {
        let mut basis = Vec::new();
        assert_eq!(extend(&mut basis, &[vec![3.0, 0.0]]), 1);
        assert_eq!(extend(&mut basis, &[vec![1.0, 0.005]]), 0);
        assert_eq!(extend(&mut basis, &[vec![1.0, 0.05]]), 1);
    }
}
