//! How much less a recording says of the parameters than as many independent measurements would.
//!
//! What a model lacks moves neighbouring measurements alike: all targets at one pose, all poses at one angle of a joint, all of one hour.
//! Standard deviations by the scatter of single measurements are too small then. How far the parameters move when such a group is left out tells
//! by how much (the jackknife of groups, Tukey 1958). In a metric in which the covariance of the parameters is the unit matrix, with `Z` a group's
//! rows of the weighted Jacobian, `r` its residuals and `G = Z'Z`, they move by `W Z'r`, `W = (I - G)^-1`, and
//!
//! ```text
//! f = sum |W Z'r|^2 / sum tr W (G - G^2) W
//! ```
//!
//! is 1 on average where measurements are independent, and else the factor by which the variances are too small: the design effect (Kish 1965)
//! of such groups. Errors that several kinds of groups share add up (Cameron, Gelbach & Miller 2011).

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_model::Forward;

use crate::dense::{Cholesky, Mat, dot, solve_lower};
use crate::error::Result;
use crate::fit::degenerate::resting_joints;
use crate::fit::folds::Folds;
use crate::fit::identify::Identified;
use crate::fit::residuals::weighted_residuals;

/// Intervals of the time of a recording.
const INTERVALS: usize = 16;

/// A kind of groups counts where its factor is larger than by chance: beyond so many of its standard deviations.
const BEYOND_CHANCE: f64 = 2.0;

/// What a group alone tells cannot be checked without it: this much of it is taken to be left out, so that such directions have finite weight.
const LEFT_OUT: f64 = 0.98;

/// Random vectors by which a trace is estimated (Hutchinson 1990).
const PROBES: usize = 16;

/// The measurements of a fit in the metric of its covariance.
struct Whitened {
    /// `parameters x rows`.
    z: Mat,
    residual: Vec<f64>,
    /// Observation of each row.
    observation: Vec<usize>,
}

/// The design effect of one kind of groups, and its standard deviation where measurements are independent.
#[derive(Clone, Copy)]
struct Effect {
    factor: f64,
    sd: f64,
}

impl Identified {
    /// The same with standard deviations that allow for errors that neighbouring measurements share; what was known beforehand stays as
    /// sure as it was. [`Identified::design_effect`] says how much larger variances are.
    ///
    /// # Errors
    /// None for a model that was fitted.
    pub fn with_shared_errors(mut self) -> Result<Self> {
        let factor = design_effect(&self)?;
        if factor <= 1.0 {
            return Ok(self);
        }
        let p = self.free.len();
        let sd = |k: usize| self.known.get(k).and_then(|known| known.prior).map(|prior| prior.sd);
        let held: Vec<(usize, f64)> = (0..p).filter_map(|k| Some((k, sd(k)?))).collect();
        let c = Mat::from_fn(p, p, |i, j| self.covariance[i * p + j]);
        // C^-1 = M + P of measurements and priors becomes M / f + P, whose inverse is f (C^-1 + (f - 1) P)^-1
        let mut across = Mat::from_fn(held.len(), p, |a, j| c[(held[a].0, j)] / held[a].1);
        let among = Mat::from_fn(held.len(), held.len(), |a, b| {
            across[(a, held[b].0)] / held[b].1 + if a == b { 1.0 / (factor - 1.0) } else { 0.0 }
        });
        let Some(root) = Cholesky::of(&among) else { return Ok(self) };
        solve_lower(root.lower(), &mut across);
        let wider = c - &across.view().gram();
        for (i, free) in self.free.iter().enumerate() {
            (0..p).for_each(|j| self.covariance[i * p + j] = factor * wider[(i, j)]);
            if let Some(sd) = &mut self.model.terms[*free].sd {
                *sd = (factor * wider[(i, i)]).max(0.0).sqrt();
            }
        }
        Ok(Self { design_effect: factor, ..self })
    }
}

/// By which factor the variances of a fit are too small; 1 where its covariance has no root.
fn design_effect(fitted: &Identified) -> Result<f64> {
    let Some(rows) = Whitened::of(fitted)? else { return Ok(1.0) };
    let (data, robot) = (&fitted.data, &fitted.model.robot);
    let (folds, resting) = (Folds::of(data), resting_joints(robot, data));
    let (pose, count) = (|o: usize| data.observations[o].pose, data.observations.len());
    let at_once = [rows.effect(&pose), rows.effect(&|o| folds.block_of(pose(o)))];
    let base = at_once.iter().filter(|e| e.is_beyond(1.0)).fold(1.0, |base: f64, e| base.max(e.factor));
    let moving = (0..robot.joints.len()).filter(|joint| !resting.contains(&(joint + 1)));
    let by_angle = moving.map(|joint| {
        let folds = folds.by_angle(data, joint);
        rows.effect(&|o| folds.block_of(pose(o)))
    });
    let in_time = std::iter::once_with(|| rows.effect(&|o| o * INTERVALS / count));
    let more = by_angle.chain(in_time).filter(|e| e.is_beyond(base)).map(|e| e.factor - base);
    Ok(base + more.sum::<f64>())
}

impl Effect {
    fn is_beyond(self, base: f64) -> bool {
        self.factor > base * (1.0 + BEYOND_CHANCE * self.sd)
    }
}

impl Whitened {
    fn of(fitted: &Identified) -> Result<Option<Self>> {
        let all = fitted.free.len();
        let c = |i: usize, j: usize| fitted.covariance[i * all + j];
        let moved: Vec<usize> = (0..all).filter(|k| c(*k, *k) > 0.0).collect();
        let (p, sd): (usize, Vec<f64>) = (moved.len(), moved.iter().map(|k| c(*k, *k).sqrt()).collect());
        let correlation = Mat::from_fn(p, p, |i, j| c(moved[i], moved[j]) / (sd[i] * sd[j]));
        let Some(root) = Cholesky::of(&correlation) else { return Ok(None) };
        let forward = Forward::new(fitted.model.clone(), moved.iter().map(|k| fitted.free[*k]).collect())?;
        let (data, noise) = (&fitted.data, &fitted.noise);
        let residuals = weighted_residuals(&forward, data, noise);
        let count: usize = residuals.iter().map(|r| r.1).sum();
        let square: f64 = residuals.iter().flat_map(|(r, n)| &r[..*n]).map(|v| v * v).sum();
        if square <= 0.0 {
            return Ok(None);
        }
        let sigma = (square / count.saturating_sub(p).max(1) as f64).sqrt();
        let (mut ws, mut block) = (forward.workspace(), vec![0.0; 6 * p]);
        let mut rows = Mat::zeros(p, count);
        let (mut residual, mut observation) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for (at, (o, (r, n))) in data.observations.iter().zip(&residuals).enumerate() {
            forward.linearize(&o.state, &o.measured, o.frame, &mut ws, &mut block);
            for (k, r) in r[..*n].iter().enumerate() {
                let weight = 1.0 / (sigma * noise.sigma(o.recording, &o.measured, k));
                let row = rows.col_mut(residual.len());
                for ((to, from), sd) in row.iter_mut().zip(&block[k * p..]).zip(&sd) {
                    *to = from * sd * weight;
                }
                residual.push(r / sigma);
                observation.push(at);
            }
        }
        Ok(Some(Self { z: root.lower().transpose() * &rows, residual, observation }))
    }

    /// Of the groups of observations that `of` tells.
    fn effect(&self, of: &dyn Fn(usize) -> usize) -> Effect {
        let p = self.z.nrows();
        let mut rows: Vec<(usize, usize)> = self.observation.iter().map(|o| of(*o)).zip(0..).collect();
        rows.sort_unstable();
        let (mut moved, mut expected, mut spread, mut rng) = (0.0, 0.0, 0.0, Pcg64Mcg::seed_from_u64(1));
        for group in rows.chunk_by(|a, b| a.0 == b.0) {
            let n = group.len();
            let mut z = Mat::zeros(p, n);
            for (k, (_, row)) in group.iter().enumerate() {
                z.col_mut(k).copy_from_slice(self.z.col(*row));
            }
            let r = Mat::from_fn(n, 1, |k, _| self.residual[group[k].1]);
            // Z'Z and ZZ' have the same eigenvalues: whichever is smaller
            let small = n < p;
            let (g, push) = if small { (z.view().gram(), r) } else { (z.transpose().gram(), &z * &r) };
            let kept = Mat::from_fn(g.nrows(), g.nrows(), |i, j| f64::from(u8::from(i == j)) - LEFT_OUT * g[(i, j)]);
            let Some(root) = Cholesky::of(&kept) else { continue };
            let push = root.solve(&push);
            moved += if small { dot(push.col(0), (&g * &push).col(0)) } else { push.square() };
            let probe = Mat::from_fn(g.nrows(), PROBES, |_, _| if rng.random() { 1.0 } else { -1.0 });
            let through = &g * &probe;
            let seen = root.solve(&root.solve(&(through.clone() - &(&g * &through))));
            expected += (0..PROBES).map(|k| dot(probe.col(k), seen.col(k))).sum::<f64>() / PROBES as f64;
            spread += seen.square() / PROBES as f64;
        }
        if expected > 0.0 {
            Effect { factor: moved / expected, sd: (2.0 * spread).sqrt() / expected }
        } else {
            Effect { factor: 1.0, sd: 0.0 }
        }
    }
}
