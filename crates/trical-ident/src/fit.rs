//! Levenberg-Marquardt on normal equations, solved by faer.
//!
//! Normal equations are accumulated block by block, so memory does not grow with the rows; columns are scaled to unit length
//! before the Cholesky factorization, which keeps the digits (what is reported, rank and covariance, comes from a QR
//! factorization of J itself, see [`crate::identifiability`]).

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltRegularization, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::cholesky::llt::solve::{solve_in_place, solve_in_place_scratch};
use faer::{Mat, Par};
use rayon::prelude::*;
use trical_model::Forward;

use crate::dataset::{Dataset, Observation};
use crate::error::{IdentError, Result};
use crate::noise::Noise;
use crate::normal::{CHUNK, Keep, Rows};

/// Damping at the start (columns have unit length): small, since starts from closed forms are good, and Newton's steps are fast.
const LAMBDA: f64 = 1e-8;

/// A step by less than this fraction of what the data can tell is not worth another pass over it, where the cost would not
/// fall either.
const NEGLIGIBLE: f64 = 1e-3;

/// When to stop.
#[derive(Clone, Copy, Debug)]
pub struct LmParams {
    /// Most iterations.
    pub max_iterations: usize,
    /// Stop when the cost would fall by less than this fraction.
    pub cost_tolerance: f64,
    /// Stop when no coefficient moves by more than this fraction of its standard deviation.
    pub step_tolerance: f64,
    /// Residuals beyond this many sigma count linearly only (Huber); infinite for plain least squares.
    pub huber: f64,
}

impl Default for LmParams {
    fn default() -> Self {
        Self { max_iterations: 100, cost_tolerance: 1e-10, step_tolerance: 1e-6, huber: f64::INFINITY }
    }
}

/// What is known of a coefficient before it is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// Expected value, SI.
    pub value: f64,
    /// Standard deviation about it, SI.
    pub sd: f64,
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

/// Checks that every observation can be predicted.
///
/// # Errors
/// The first that cannot, with its file and line.
pub fn check_observations(forward: &Forward, data: &Dataset) -> Result<()> {
    for o in &data.observations {
        forward.check(&o.state, &o.measured, o.frame).map_err(|e| IdentError::Recording {
            file: data.names[o.recording].clone(),
            place: format!("line {}", o.line),
            problem: e.to_string(),
        })?;
    }
    Ok(())
}

/// Number of scalars measured.
///
/// # Errors
/// Fewer than the `p` parameters that are to be identified, with what `priors` add.
pub fn check_count(data: &Dataset, p: usize, priors: &[Option<Prior>]) -> Result<usize> {
    let scalars: usize = data.observations.iter().map(|o| trical_model::residual_rows(&o.measured)).sum();
    if scalars + priors.iter().flatten().count() < p {
        return Err(IdentError::NotEnough(format!(
            "{} measurements give {scalars} numbers, but {p} parameters are to be identified: more measurements, or a \
             smaller --model, are needed",
            data.observations.len()
        )));
    }
    Ok(scalars)
}

/// Levenberg-Marquardt with its working memory, so that refits allocate nothing anew.
pub(crate) struct Solver {
    /// Sums at the present coefficients.
    at: Rows,
    /// Sums at those that are tried.
    tried: Rows,
    damped: Mat<f64>,
    rhs: Mat<f64>,
    scale: Vec<f64>,
    proposal: Vec<f64>,
    memory: MemBuffer,
}

impl Solver {
    /// For `p` free coefficients.
    pub fn new(p: usize) -> Self {
        let scratch = cholesky_in_place_scratch::<f64>(p, Par::Seq, faer::Spec::default())
            .or(solve_in_place_scratch::<f64>(p, 1, Par::Seq));
        Self {
            at: Rows::new(p, Keep::Products),
            tried: Rows::new(p, Keep::Products),
            damped: Mat::zeros(p, p),
            rhs: Mat::zeros(p, 1),
            scale: vec![1.0; p],
            proposal: vec![0.0; p],
            memory: MemBuffer::new(scratch),
        }
    }

    /// The factor of `[J r]` where the fit ended, if all rows are still there.
    pub fn factor(&self) -> Option<Mat<f64>> {
        self.at.factor()
    }

    /// Scales, solves for the step at damping `lambda` into `rhs` (scaled); false where the matrix is not positive.
    fn step(&mut self, lambda: f64) -> bool {
        let p = self.scale.len();
        for j in 0..p {
            for i in j..p {
                self.damped[(i, j)] =
                    self.at.h(i, j) / (self.scale[i] * self.scale[j]) + if i == j { lambda } else { 0.0 };
            }
            self.rhs[(j, 0)] = -self.at.g(j) / self.scale[j];
        }
        let stack = MemStack::new(&mut self.memory);
        let factored = cholesky_in_place(
            self.damped.as_mut(),
            LltRegularization::default(),
            Par::Seq,
            stack,
            faer::Spec::default(),
        );
        if factored.is_err() {
            return false;
        }
        let stack = MemStack::new(&mut self.memory);
        solve_in_place(self.damped.as_ref(), self.rhs.as_mut(), Par::Seq, stack);
        true
    }

    /// As [`minimize_with_priors`].
    pub fn minimize(
        &mut self,
        forward: &mut Forward,
        data: &Dataset,
        noise: &Noise,
        priors: &[Option<Prior>],
        params: &LmParams,
    ) -> Result<LmReport> {
        let p = forward.free().len();
        let scalars = check_count(data, p, priors)?;
        let mut x = forward.coefficients();
        evaluate(forward, data, noise, priors, params.huber, &mut self.at);
        let mut lambda = LAMBDA;
        let mut report = LmReport { iterations: 0, cost: self.at.cost, gradient: 0.0, ended: Ended::Iterations };
        if !self.at.cost.is_finite() {
            return Err(IdentError::NotConverged("the residuals are not finite at the start".into()));
        }
        if p == 0 {
            report.ended = Ended::Step;
            return Ok(report);
        }
        let mut fresh = true;
        while report.iterations < params.max_iterations {
            trical_model::interrupt::checkpoint()?;
            report.iterations += 1;
            if fresh {
                report.gradient = self.rescale(forward)?;
            }
            if self.at.cost < 1e-22 * (1.0 + f64::from(u32::try_from(scalars).unwrap_or(u32::MAX))) {
                report.ended = Ended::Zero;
                break;
            }
            if !self.step(lambda) {
                lambda = (lambda * 10.0).max(1e-9);
                fresh = false;
                if lambda > 1e6 {
                    report.ended = Ended::Stuck;
                    break;
                }
                continue;
            }
            // predicted decrease of the cost, and the step in units of what the data can tell
            let (mut predicted, mut size) = (0.0, 0.0_f64);
            for (i, ((to, from), scale)) in self.proposal.iter_mut().zip(&x).zip(&self.scale).enumerate() {
                let step = self.rhs[(i, 0)];
                predicted += 0.5 * step * (lambda * step - self.at.g(i) / scale);
                size = size.max(step.abs());
                *to = from + step / scale;
            }
            if fresh && predicted <= params.cost_tolerance * self.at.cost && size < NEGLIGIBLE {
                report.ended = Ended::Cost;
                break;
            }
            forward.set_coefficients(&self.proposal);
            evaluate(forward, data, noise, priors, params.huber, &mut self.tried);
            let new_cost = self.tried.cost;
            if new_cost.is_finite() && new_cost <= self.at.cost * (1.0 + 1e-14) {
                let fell = self.at.cost - new_cost;
                let gain = fell / predicted.max(1e-300);
                x.copy_from_slice(&self.proposal);
                let small_step = size < params.step_tolerance;
                let small_fall =
                    fell <= params.cost_tolerance * new_cost && predicted <= params.cost_tolerance * new_cost;
                std::mem::swap(&mut self.at, &mut self.tried);
                fresh = true;
                report.cost = new_cost;
                if gain > 0.75 {
                    lambda = (lambda * 0.1).max(1e-15);
                } else if gain < 0.25 {
                    lambda *= 4.0;
                }
                if small_step || small_fall {
                    report.ended = if small_step { Ended::Step } else { Ended::Cost };
                    report.gradient = self.rescale(forward)?;
                    break;
                }
            } else {
                forward.set_coefficients(&x);
                fresh = false;
                if predicted <= params.cost_tolerance * self.at.cost || size < params.step_tolerance {
                    report.ended = Ended::Cost;
                    break;
                }
                lambda = (lambda * 10.0).max(1e-9);
                if lambda > 1e9 {
                    report.ended = Ended::Stuck;
                    break;
                }
            }
        }
        forward.set_coefficients(&x);
        report.cost = self.at.cost;
        Ok(report)
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
            gradient = gradient.max((self.at.g(a) / (*s * r)).abs());
        }
        Ok(gradient)
    }
}

/// All rows at the present coefficients, priors as measurements of the coefficients themselves.
fn evaluate(forward: &Forward, data: &Dataset, noise: &Noise, priors: &[Option<Prior>], limit: f64, total: &mut Rows) {
    total.clear();
    sum_rows(forward, &data.observations, noise, limit, total);
    add_priors(forward, priors, total);
    total.finish();
}

/// Adds all observations: one after the other where they are few, else chunks in parallel that are added up in order.
fn sum_rows(forward: &Forward, observations: &[Observation], noise: &Noise, limit: f64, total: &mut Rows) {
    let run = |chunk: &[Observation], rows: &mut Rows| {
        let mut ws = forward.workspace();
        for o in chunk {
            rows.observe(forward, &mut ws, o, noise, limit);
        }
    };
    if observations.len() <= CHUNK {
        run(observations, total);
        return;
    }
    // so many chunks at a time keep all threads busy, and memory stays bounded
    for batch in observations.chunks(CHUNK * 64) {
        let parts: Vec<Rows> = batch
            .par_chunks(CHUNK)
            .map(|chunk| {
                let mut rows = total.empty();
                run(chunk, &mut rows);
                rows.finish();
                rows
            })
            .collect();
        for part in &parts {
            total.add(part);
        }
    }
}

fn add_priors(forward: &Forward, priors: &[Option<Prior>], total: &mut Rows) {
    for (k, (prior, term)) in priors.iter().zip(forward.free()).enumerate() {
        if let Some(prior) = prior {
            let value = forward.model().terms[*term].value;
            total.observe_parameter(k, 1.0 / prior.sd, (value - prior.value) / prior.sd);
        }
    }
}

/// The factor `R` of the weighted `[J r]`, the residual as the last column, accumulated block by block.
pub(crate) fn factor(forward: &Forward, data: &Dataset, noise: &Noise, priors: &[Option<Prior>]) -> Mat<f64> {
    let mut total = Rows::new(forward.free().len(), Keep::Factor);
    sum_rows(forward, &data.observations, noise, f64::INFINITY, &mut total);
    add_priors(forward, priors, &mut total);
    total.finish();
    total.factor().unwrap_or_else(|| Mat::zeros(0, 0))
}

/// Minimizes the weighted sum of squares over the free coefficients of `forward`, from their present values.
///
/// # Errors
/// Fewer scalars than coefficients, a residual that is not finite, or a Jacobian of deficient rank.
pub fn minimize(forward: &mut Forward, data: &Dataset, noise: &Noise, params: &LmParams) -> Result<LmReport> {
    minimize_with_priors(forward, data, noise, &[], params)
}

/// As [`minimize`], with priors of the free coefficients in their order (none beyond the end of `priors`).
///
/// # Errors
/// As [`minimize`].
pub fn minimize_with_priors(
    forward: &mut Forward,
    data: &Dataset,
    noise: &Noise,
    priors: &[Option<Prior>],
    params: &LmParams,
) -> Result<LmReport> {
    check_observations(forward, data)?;
    Solver::new(forward.free().len()).minimize(forward, data, noise, priors, params)
}

/// Weighted residual of every observation (units of sigma) and its number of scalars.
#[must_use]
pub fn weighted_residuals(forward: &Forward, data: &Dataset, noise: &Noise) -> Vec<([f64; 6], usize)> {
    let mut ws = forward.workspace();
    data.observations
        .iter()
        .map(|o| {
            let rows = forward.residual(&o.state, &o.measured, o.frame, &mut ws);
            let mut r = [0.0; 6];
            for (k, v) in r.iter_mut().enumerate().take(rows) {
                *v = ws.residual()[k] / noise.sigma(o.recording, &o.measured, k);
            }
            (r, rows)
        })
        .collect()
}

/// Position error of every observation, m: distance between predicted and measured point (difference of lengths for
/// distance measurements).
#[must_use]
pub fn position_errors(forward: &Forward, data: &Dataset) -> Vec<f64> {
    let mut ws = forward.workspace();
    data.observations
        .iter()
        .map(|o| {
            let rows = forward.residual(&o.state, &o.measured, o.frame, &mut ws).min(3);
            ws.residual()[..rows].iter().map(|r| r * r).sum::<f64>().sqrt()
        })
        .collect()
}
