//! Levenberg-Marquardt on normal equations, solved by faer.
//!
//! Normal equations are accumulated observation by observation, so memory does not grow with the rows; columns are scaled to
//! unit length before the Cholesky factorization, which keeps the digits (what is reported, rank and covariance, comes from a
//! QR factorization of J itself, see [`crate::identifiability`]).

use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use rayon::prelude::*;
use trical_model::{Forward, Workspace};

use crate::dataset::{Dataset, Observation};
use crate::error::{IdentError, Result};
use crate::noise::Noise;

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

/// Normal equations: `H = J'J` (lower triangle, row by row) and `g = J'r`, weighted.
struct Normal {
    p: usize,
    h: Vec<f64>,
    g: Vec<f64>,
    cost: f64,
}

/// Observations a chunk; sums are formed chunk by chunk in order, so that the number of threads changes no bit.
const CHUNK: usize = 1024;

impl Normal {
    fn new(p: usize) -> Self {
        Self { p, h: vec![0.0; p * p], g: vec![0.0; p], cost: 0.0 }
    }

    fn clear(&mut self) {
        self.h.fill(0.0);
        self.g.fill(0.0);
        self.cost = 0.0;
    }

    fn add_row(&mut self, row: &[f64], r: f64, weight: f64) {
        let p = self.p;
        for (a, ja) in row.iter().enumerate() {
            let w = ja * weight;
            self.g[a] += w * r;
            for (h, jb) in self.h[a * p..=a * p + a].iter_mut().zip(row) {
                *h += w * jb;
            }
        }
    }

    fn add(&mut self, other: &Self) {
        for (a, b) in self.h.iter_mut().zip(&other.h) {
            *a += b;
        }
        for (a, b) in self.g.iter_mut().zip(&other.g) {
            *a += b;
        }
        self.cost += other.cost;
    }
}

/// Huber's loss of a squared norm: its value and the weight of the rows.
#[inline]
fn huber(square: f64, k: f64) -> (f64, f64) {
    let norm = square.sqrt();
    if norm <= k { (0.5 * square, 1.0) } else { (k * norm - 0.5 * k * k, k / norm) }
}

fn accumulate(
    forward: &Forward,
    ws: &mut Workspace,
    jacobian: &mut [f64],
    chunk: &[Observation],
    noise: &Noise,
    limit: f64,
    normal: &mut Normal,
) {
    let p = normal.p;
    for o in chunk {
        let rows = forward.linearize(&o.state, &o.measured, o.frame, ws, jacobian);
        let mut scaled = [0.0; 6];
        let mut square = 0.0;
        for (k, s) in scaled.iter_mut().enumerate().take(rows) {
            let inverse = 1.0 / noise.sigma(o.recording, &o.measured, k);
            *s = ws.residual()[k] * inverse;
            square += *s * *s;
            for v in &mut jacobian[k * p..(k + 1) * p] {
                *v *= inverse;
            }
        }
        let (cost, weight) = huber(square, limit);
        normal.cost += cost;
        for (k, s) in scaled.iter().enumerate().take(rows) {
            normal.add_row(&jacobian[k * p..(k + 1) * p], *s, weight);
        }
    }
}

fn normal_equations(forward: &Forward, data: &Dataset, noise: &Noise, limit: f64, total: &mut Normal) {
    total.clear();
    let p = total.p;
    let run = |chunk: &[Observation], normal: &mut Normal| {
        let mut ws = forward.workspace();
        let mut jacobian = vec![0.0; 6 * p];
        accumulate(forward, &mut ws, &mut jacobian, chunk, noise, limit, normal);
    };
    if data.observations.len() <= CHUNK {
        run(&data.observations, total);
        return;
    }
    // as many chunks at a time as keep all threads busy; memory stays bounded
    for batch in data.observations.chunks(CHUNK * 64) {
        let parts: Vec<Normal> = batch
            .par_chunks(CHUNK)
            .map(|chunk| {
                let mut normal = Normal::new(p);
                run(chunk, &mut normal);
                normal
            })
            .collect();
        for part in &parts {
            total.add(part);
        }
    }
}

/// Half the weighted (robust) sum of squares.
fn cost(forward: &Forward, data: &Dataset, noise: &Noise, limit: f64) -> f64 {
    let run = |chunk: &[Observation]| {
        let mut ws = forward.workspace();
        chunk
            .iter()
            .map(|o| {
                let rows = forward.residual(&o.state, &o.measured, o.frame, &mut ws);
                let square: f64 =
                    (0..rows).map(|k| (ws.residual()[k] / noise.sigma(o.recording, &o.measured, k)).powi(2)).sum();
                huber(square, limit).0
            })
            .sum::<f64>()
    };
    if data.observations.len() <= CHUNK {
        return run(&data.observations);
    }
    let parts: Vec<f64> = data.observations.par_chunks(CHUNK).map(run).collect();
    parts.iter().sum()
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

/// Priors as measurements of the coefficients themselves.
fn add_priors(priors: &[Option<Prior>], x: &[f64], normal: &mut Normal) {
    for (k, (prior, value)) in priors.iter().zip(x).enumerate() {
        if let Some(prior) = prior {
            let r = (value - prior.value) / prior.sd;
            normal.h[k * normal.p + k] += prior.sd.powi(-2);
            normal.g[k] += r / prior.sd;
            normal.cost += 0.5 * r * r;
        }
    }
}

fn cost_of_priors(priors: &[Option<Prior>], x: &[f64]) -> f64 {
    priors.iter().zip(x).filter_map(|(p, v)| p.map(|p| 0.5 * ((v - p.value) / p.sd).powi(2))).sum()
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
    let p = forward.free().len();
    let scalars = check_count(data, p, priors)?;
    let mut normal = Normal::new(p);
    normal_equations(forward, data, noise, params.huber, &mut normal);
    let mut lambda = 1e-6;
    let mut x = forward.coefficients();
    add_priors(priors, &x, &mut normal);
    let mut report = LmReport { iterations: 0, cost: normal.cost, gradient: 0.0, ended: Ended::Iterations };
    if !normal.cost.is_finite() {
        return Err(IdentError::NotConverged("the residuals are not finite at the start".into()));
    }
    if p == 0 {
        report.ended = Ended::Step;
        return Ok(report);
    }
    let mut scale = vec![1.0; p];
    let mut fresh = true;
    while report.iterations < params.max_iterations {
        report.iterations += 1;
        if fresh {
            for (a, s) in scale.iter_mut().enumerate() {
                let d = normal.h[a * p + a];
                if d <= 0.0 || !d.is_finite() {
                    let name = &forward.model().terms[forward.free()[a]].name;
                    return Err(IdentError::NotEnough(format!(
                        "parameter {name} has no effect on any measurement of this data set"
                    )));
                }
                *s = d.sqrt();
            }
            let r = (2.0 * normal.cost).sqrt();
            report.gradient = (0..p).map(|a| (normal.g[a] / (scale[a] * r.max(1e-300))).abs()).fold(0.0, f64::max);
        }
        if normal.cost < 1e-22 * (1.0 + f64::from(u32::try_from(scalars).unwrap_or(u32::MAX))) {
            report.ended = Ended::Zero;
            break;
        }
        let a = Mat::from_fn(p, p, |i, j| {
            let (i, j) = if i >= j { (i, j) } else { (j, i) };
            normal.h[i * p + j] / (scale[i] * scale[j]) + if i == j { lambda } else { 0.0 }
        });
        let Ok(llt) = a.llt(Side::Lower) else {
            lambda = (lambda * 10.0).max(1e-9);
            fresh = false;
            if lambda > 1e6 {
                report.ended = Ended::Stuck;
                break;
            }
            continue;
        };
        let rhs = Mat::from_fn(p, 1, |i, _| -normal.g[i] / scale[i]);
        let step = llt.solve(&rhs);
        let proposal: Vec<f64> = (0..p).map(|i| x[i] + step[(i, 0)] / scale[i]).collect();
        // predicted decrease of the cost, and the step in units of what the data can tell
        let predicted: f64 = (0..p).map(|i| 0.5 * step[(i, 0)] * (lambda * step[(i, 0)] + rhs[(i, 0)])).sum();
        let size = (0..p).map(|i| step[(i, 0)].abs()).fold(0.0, f64::max);
        forward.set_coefficients(&proposal);
        let new_cost = cost(forward, data, noise, params.huber) + cost_of_priors(priors, &proposal);
        if new_cost.is_finite() && new_cost <= normal.cost * (1.0 + 1e-14) {
            let gain = (normal.cost - new_cost) / predicted.max(1e-300);
            let fell = normal.cost - new_cost;
            x = proposal;
            let small_step = size < params.step_tolerance;
            let small_fall = fell <= params.cost_tolerance * new_cost && predicted <= params.cost_tolerance * new_cost;
            normal_equations(forward, data, noise, params.huber, &mut normal);
            add_priors(priors, &x, &mut normal);
            fresh = true;
            report.cost = normal.cost;
            if gain > 0.75 {
                lambda = (lambda * 0.1).max(1e-15);
            } else if gain < 0.25 {
                lambda *= 4.0;
            }
            if small_step || small_fall {
                report.ended = if small_step { Ended::Step } else { Ended::Cost };
                break;
            }
        } else {
            forward.set_coefficients(&x);
            fresh = false;
            if predicted <= params.cost_tolerance * normal.cost || size < params.step_tolerance {
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
    report.cost = normal.cost;
    Ok(report)
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
