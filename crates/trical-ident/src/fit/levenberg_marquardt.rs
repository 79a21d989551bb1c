//! Levenberg-Marquardt on normal equations, with limits of the coefficients.
//!
//! Normal equations are accumulated block by block, so memory does not grow with the rows; columns are scaled to unit length
//! before the Cholesky factorization, which keeps the digits (what is reported, rank and covariance, comes from a QR
//! factorization of J itself unless J is far from losing rank, see [`crate::fit::identifiability`]).
//!
//! Limits are kept by an active set: a coefficient at a limit that the gradient would push beyond it is held there for the step,
//! one that the step would carry beyond a limit goes to it, and the others step with a view to that.

use trical_model::Forward;

use crate::dataset::Dataset;
use crate::dense::{Cholesky, Mat};
use crate::error::{IdentError, Result};
use crate::fit::identifiability::{is_well_conditioned, spectrum};
use crate::fit::noise::Noise;
use crate::fit::normal_equations::{Keep, Rows};
use crate::fit::priors::PriorKnowledge;
use crate::fit::residuals::{check_count, check_observations, evaluate};

/// Damping at the start (columns have unit length): small, since starts from closed forms are good, and Newton's steps are fast.
const LAMBDA: f64 = 1e-8;

/// A step by less than this fraction of what the data can tell is not worth another pass over it, where the cost would not
/// fall either.
const NEGLIGIBLE: f64 = 1e-3;

/// The last step is the one after which all that would follow move no coefficient by more than this in units of what the data can tell.
const UNDONE: f64 = 1e-4;

/// More parameters than this are many: their products cost more than everything else, and are kept as long as they predict what steps do.
const MANY: usize = 150;

/// Steps whose gain differs from what was foreseen by no more than this leave the products as they are.
const FORESEEN: f64 = 0.1;

/// A triangular factor of `J` with what [`spectrum`] says of it.
pub(crate) struct Factored {
    pub r: Mat,
    pub spectrum: Option<(Vec<f64>, Vec<f64>)>,
}

impl Factored {
    pub fn of(r: Mat) -> Self {
        Self { spectrum: spectrum(&r), r }
    }
}

/// When to stop.
#[derive(Clone, Copy, Debug)]
pub struct LmParams {
    /// Most iterations.
    pub max_iterations: usize,
    /// Stop when the cost would fall by less than this fraction.
    pub cost_tolerance: f64,
    /// Stop when coefficients move by less than this fraction of their standard deviations, in the mean (root mean square).
    pub step_tolerance: f64,
    /// Residuals beyond this many sigma count linearly only (Huber); infinite for plain least squares.
    pub huber: f64,
    /// A noise that changes by no more than this fraction is not worth another fit with it.
    pub noise_tolerance: f64,
}

impl LmParams {
    /// As exact as the data are: coefficients within a twentieth of their standard deviation. For fits that are one step of a search.
    pub const WITHIN_NOISE: Self = Self {
        max_iterations: 100,
        cost_tolerance: 1e-7,
        step_tolerance: 0.05,
        huber: f64::INFINITY,
        noise_tolerance: 0.01,
    };
}

impl Default for LmParams {
    fn default() -> Self {
        Self {
            max_iterations: 100,
            cost_tolerance: 1e-10,
            step_tolerance: 1e-6,
            huber: f64::INFINITY,
            noise_tolerance: 0.0,
        }
    }
}

/// Why the iteration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ended {
    /// The cost no longer falls.
    Cost,
    /// The steps are below what the data can tell.
    Step,
    /// The residual is zero to rounding.
    Zero,
    /// It was given up.
    Iterations,
    /// No step lowers the cost although the gradient says so.
    Stuck,
}

/// What the iteration did.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct LmReport {
    /// Iterations.
    pub iterations: usize,
    /// Half the weighted sum of squares at the end.
    pub cost: f64,
    /// Largest cosine between the residual and a column of the Jacobian at the end: 0 at a minimum.
    pub gradient: f64,
    /// Why it ended.
    pub ended: Ended,
}

/// How much steps are held back (columns have unit length).
struct Damping {
    lambda: f64,
    /// By how much the next rejected step raises it.
    rise: f64,
    /// Where tries cost much, each of several steps rejected in a row raises it by more (Nielsen 1999).
    faster: f64,
}

impl Damping {
    fn rejected(&mut self) {
        self.lambda = (self.lambda * self.rise).max(1e-9);
        self.rise *= self.faster;
    }

    /// A step was accepted, which lowered the cost by so much of what was predicted.
    fn accepted(&mut self, gain: f64) {
        self.rise = 10.0;
        if gain > 0.75 {
            self.lambda = (self.lambda * 0.1).max(1e-15);
        } else if gain < 0.25 {
            self.lambda *= 4.0;
        }
    }
}

/// Minimizes the weighted sum of squares over the free coefficients of `forward`, from their present values.
///
/// # Errors
/// Fewer scalars than coefficients, a residual that is not finite, or a Jacobian of deficient rank.
pub fn minimize(forward: &mut Forward, data: &Dataset, noise: &Noise, params: &LmParams) -> Result<LmReport> {
    check_observations(forward, data)?;
    Solver::new(forward.free().len()).minimize(forward, data, noise, &[], params)
}

/// Levenberg-Marquardt with its sums, which refits use again.
pub(crate) struct Solver {
    /// Sums at the present coefficients.
    at: Rows,
    /// Sums at those that are tried.
    tried: Rows,
    /// Their gradient alone.
    gradient: Rows,
    damped: Mat,
    rhs: Mat,
    scale: Vec<f64>,
    proposal: Vec<f64>,
    /// Coefficients that a step leaves at their limits.
    at_limit: Vec<bool>,
    /// Where a step must take coefficients, whatever the data ask for: those that stand there, and those that would go too far.
    target: Vec<Option<f64>>,
}

impl Solver {
    /// For `p` free coefficients.
    pub fn new(p: usize) -> Self {
        Self {
            at: Rows::new(p, Keep::Products),
            tried: Rows::new(p, Keep::Products),
            gradient: Rows::new(p, Keep::Gradient),
            damped: Mat::zeros(p, p),
            rhs: Mat::zeros(p, 1),
            scale: vec![1.0; p],
            proposal: vec![0.0; p],
            at_limit: vec![false; p],
            target: vec![None; p],
        }
    }

    /// The coefficients that stand at a limit which they would pass, in the order of the free ones.
    pub fn at_limit(&self) -> &[bool] {
        &self.at_limit
    }

    /// The factor of `J` where the fit ended, of the products where these have the digits; else the rows have to be asked again.
    pub fn factor(&self) -> Option<Factored> {
        let of_products = self.at.factor_of_products()?;
        let p = of_products.nrows();
        let factored = Factored::of(of_products.leading(p, p));
        let (_, s) = factored.spectrum.as_ref()?;
        // of many parameters the rows would be asked for seconds, and at this condition six digits are left of what is reported
        let many = p > MANY && s.last().zip(s.first()).is_some_and(|(small, large)| *large < 1e5 * small);
        (many || is_well_conditioned(s)).then_some(factored)
    }

    /// The step from `x` at damping `lambda` into `rhs` (scaled), within the limits; false where the matrix is not positive.
    fn step(&mut self, lambda: f64, x: &[f64], known: &[PriorKnowledge]) -> bool {
        for ((target, at_limit), x) in self.target.iter_mut().zip(&self.at_limit).zip(x) {
            *target = at_limit.then_some(*x);
        }
        loop {
            if !self.solve(lambda, x) {
                return false;
            }
            let mut again = false;
            for (j, k) in known.iter().enumerate() {
                let to = x[j] + self.rhs[(j, 0)] / self.scale[j];
                if self.target[j].is_none() && (to < k.limits[0] || to > k.limits[1]) {
                    self.target[j] = Some(to.clamp(k.limits[0], k.limits[1]));
                    again = true;
                }
            }
            if !again {
                return true;
            }
        }
    }

    /// Scales, solves for the step at damping `lambda` into `rhs` (scaled); false where the matrix is not positive.
    fn solve(&mut self, lambda: f64, x: &[f64]) -> bool {
        let p = self.scale.len();
        for j in 0..p {
            for i in j..p {
                self.damped[(i, j)] =
                    self.at.h(i, j) / (self.scale[i] * self.scale[j]) + if i == j { lambda } else { 0.0 };
            }
            self.rhs[(j, 0)] = -self.at.g(j) / self.scale[j];
        }
        for (k, from) in x.iter().enumerate() {
            let Some(target) = self.target[k] else { continue };
            let step = (target - from) * self.scale[k];
            for i in 0..p {
                let (row, column) = if i >= k { (i, k) } else { (k, i) };
                if i != k && self.target[i].is_none() {
                    self.rhs[(i, 0)] -= self.damped[(row, column)] * step;
                }
                self.damped[(row, column)] = if i == k { 1.0 } else { 0.0 };
            }
            self.rhs[(k, 0)] = step;
        }
        let Some(factor) = Cholesky::of(&self.damped) else { return false };
        self.rhs = factor.solve(&self.rhs);
        true
    }

    /// As [`minimize`], with what is known of the free coefficients in their order (nothing beyond the end of `known`).
    pub fn minimize(
        &mut self,
        forward: &mut Forward,
        data: &Dataset,
        noise: &Noise,
        known: &[PriorKnowledge],
        params: &LmParams,
    ) -> Result<LmReport> {
        let p = forward.free().len();
        let scalars = check_count(data, p, known)?;
        let limited = known.iter().any(|k| k.limits != PriorKnowledge::UNLIMITED);
        let mut x = forward.coefficients();
        if limited {
            for (x, k) in x.iter_mut().zip(known) {
                *x = x.clamp(k.limits[0], k.limits[1]);
            }
            forward.set_coefficients(&x);
        }
        self.at_limit.fill(false);
        evaluate(forward, data, noise, known, params.huber, &mut self.at);
        let many = p > MANY;
        let mut damping = Damping { lambda: LAMBDA, rise: 10.0, faster: if many { 10.0 } else { 1.0 } };
        let mut report = LmReport { iterations: 0, cost: self.at.cost, gradient: 0.0, ended: Ended::Iterations };
        if !self.at.cost.is_finite() {
            return Err(IdentError::NotConverged("the residuals are not finite at the start".into()));
        }
        if p == 0 {
            report.ended = Ended::Step;
            return Ok(report);
        }
        let mut jacobian_is_new = true;
        // size of the step before
        let mut last = 0.0;
        while report.iterations < params.max_iterations {
            trical_model::interrupt::checkpoint()?;
            report.iterations += 1;
            if jacobian_is_new {
                self.hold(&x, known);
                report.gradient = self.rescale(forward)?;
            }
            if self.at.cost < 1e-22 * (1.0 + scalars as f64) {
                report.ended = Ended::Zero;
                break;
            }
            if !self.step(damping.lambda, &x, known) {
                damping.rejected();
                jacobian_is_new = false;
                if damping.lambda > 1e6 {
                    report.ended = Ended::Stuck;
                    break;
                }
                continue;
            }
            let (mut predicted, size) = self.propose(damping.lambda, &x);
            if limited {
                predicted = self.stop_at_targets(&x);
                if predicted <= 0.0 && size >= params.step_tolerance {
                    damping.rejected();
                    jacobian_is_new = false;
                    continue;
                }
            }
            if jacobian_is_new && predicted <= params.cost_tolerance * self.at.cost && size < NEGLIGIBLE {
                report.ended = Ended::Cost;
                break;
            }
            // if each is as much smaller than the one before it as this one, the rest is the sum of a geometric series; it is not asked
            // where the last step leads
            if jacobian_is_new && !limited && size * size < UNDONE * (last - size) {
                x.copy_from_slice(&self.proposal);
                self.at.cost -= predicted;
                report.gradient *= size / last;
                report.ended = Ended::Step;
                break;
            }
            forward.set_coefficients(&self.proposal);
            let tried = if many { &mut self.gradient } else { &mut self.tried };
            evaluate(forward, data, noise, known, params.huber, tried);
            let new_cost = tried.cost;
            if new_cost.is_finite() && new_cost <= self.at.cost * (1.0 + 1e-14) {
                let fell = self.at.cost - new_cost;
                let gain = fell / predicted.max(1e-300);
                x.copy_from_slice(&self.proposal);
                // 2 predicted = |step|^2, each direction in units of its standard deviation
                let mean = (2.0 * predicted / p as f64).sqrt();
                let small_step = size.min(mean) < params.step_tolerance;
                let small_fall =
                    fell <= params.cost_tolerance * new_cost && predicted <= params.cost_tolerance * new_cost;
                if many && ((gain - 1.0).abs() <= FORESEEN || small_step || small_fall) {
                    self.at.take_gradient(&self.gradient);
                } else {
                    if many {
                        evaluate(forward, data, noise, known, params.huber, &mut self.tried);
                    }
                    std::mem::swap(&mut self.at, &mut self.tried);
                }
                jacobian_is_new = true;
                last = size;
                report.cost = new_cost;
                damping.accepted(gain);
                if small_step || small_fall {
                    report.ended = if small_step { Ended::Step } else { Ended::Cost };
                    self.hold(&x, known);
                    report.gradient = self.rescale(forward)?;
                    break;
                }
            } else {
                forward.set_coefficients(&x);
                jacobian_is_new = false;
                if predicted <= params.cost_tolerance * self.at.cost || size < params.step_tolerance {
                    report.ended = Ended::Cost;
                    break;
                }
                damping.rejected();
                if damping.lambda > 1e9 {
                    report.ended = Ended::Stuck;
                    break;
                }
            }
        }
        forward.set_coefficients(&x);
        report.cost = self.at.cost;
        Ok(report)
    }

    /// Where the step that was solved for leads from `x`; the decrease of the cost that is predicted, and the largest part of the step in units
    /// of what the data can tell.
    fn propose(&mut self, lambda: f64, x: &[f64]) -> (f64, f64) {
        let (mut predicted, mut size) = (0.0, 0.0_f64);
        for (i, ((to, from), scale)) in self.proposal.iter_mut().zip(x).zip(&self.scale).enumerate() {
            let step = self.rhs[(i, 0)];
            predicted += 0.5 * step * (lambda * step - self.at.g(i) / scale);
            size = size.max(step.abs());
            *to = from + step / scale;
        }
        (predicted, size)
    }

    /// Finds the coefficients at a limit beyond which the cost would fall.
    fn hold(&mut self, x: &[f64], known: &[PriorKnowledge]) {
        for (j, (x, k)) in x.iter().zip(known).enumerate() {
            let g = self.at.g(j);
            self.at_limit[j] = (*x <= k.limits[0] && g > 0.0) || (*x >= k.limits[1] && g < 0.0);
        }
    }

    /// Puts the proposal exactly where it must be; the decrease of the cost that the linear picture then predicts.
    fn stop_at_targets(&mut self, x: &[f64]) -> f64 {
        for (to, target) in self.proposal.iter_mut().zip(&self.target) {
            *to = target.unwrap_or(*to);
        }
        let step = |j: usize| self.proposal[j] - x[j];
        let p = x.len();
        (0..p)
            .map(|i| {
                let curved: f64 = (0..p).map(|j| self.at.h(i, j) * step(j)).sum();
                -step(i) * (self.at.g(i) + 0.5 * curved)
            })
            .sum()
    }

    /// Lengths of the columns where the fit stands; returns the largest cosine between one and the residual.
    fn rescale(&mut self, forward: &Forward) -> Result<f64> {
        let r = (2.0 * self.at.cost).sqrt().max(1e-300);
        let mut gradient = 0.0_f64;
        for (a, s) in self.scale.iter_mut().enumerate() {
            let d = self.at.h(a, a);
            if d <= 0.0 || !d.is_finite() {
                let name = &forward.model().terms[forward.free()[a]].name;
                return Err(IdentError::NotEnough(format!(
                    "parameter {name} has no effect on any measurement of this data set"
                )));
            }
            *s = d.sqrt();
            if !self.at_limit[a] {
                gradient = gradient.max((self.at.g(a) / (*s * r)).abs());
            }
        }
        Ok(gradient)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_that_did_as_foreseen_is_held_back_less_and_one_that_did_not_more() {
        let after = |gain: f64| {
            let mut damping = Damping { lambda: 1.0, rise: 40.0, faster: 2.0 };
            damping.accepted(gain);
            assert_eq!(damping.rise, 10.0);
            damping.lambda
        };
        assert_eq!([0.9, 0.5, 0.1].map(after), [0.1, 1.0, 4.0]);
        let mut damping = Damping { lambda: 1.0, rise: 10.0, faster: 2.0 };
        let mut rejected = || {
            damping.rejected();
            damping.lambda
        };
        assert_eq!([rejected(), rejected()], [10.0, 200.0]);
    }
}
