//! How far off predictions may be: what the uncertainty of a model's parameters does to them, and how measurements scatter about it.
//!
//! With a covariance `C` of the known parameters, whose derivatives at a measurement are `j`, and others that were identified for this session
//! alone from rows `S` (and `J` of the known ones) of standard deviation `s`, with derivatives `k`, a prediction has the variance
//! `h C h' + s^2 k (S'S)^-1 k'`, `h = j - k (S'S)^-1 S'J`: what belongs to the session makes up for part of what is wrong with the arm.
//! Where a curve was never visited `C` is its prior, so that predictions are as uncertain there as the curve is. What happened in the course of
//! the sessions that were learnt (warming up, a step) may happen in another one, unforeseen: its spread is added. At joint angles that the model
//! was not fitted at, the effects that were found may be others, and what was held at nominal since joints hardly moved may be off: predictions are
//! at least as uncertain there as these are large.

use trical_model::{Forward, Measured, Model, Scope, Site, State, Support};

use crate::dataset::{Dataset, Observation};
use crate::dense::{Cholesky, Mat};
use crate::error::{IdentError, Result};
use crate::fit::residuals::check_observations;
use crate::model_file::{ModelFile, Uncertainty};

/// Standard deviations to each side within which 95 of 100 normal numbers lie.
const HOLDS_95: f64 = 1.959_964;

/// Of more measurements than this, so many are looked at, evenly.
const MEASUREMENTS: usize = 3000;

/// How uncertain a model said that it is, and how far that was true.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Predicted {
    /// Standard deviation of a coordinate of the measured position, root mean square over the measurements, mm: that of the parameters, the
    /// scatter of measurements, and what may happen in the course of a session, together.
    pub sd_mm: f64,
    /// Standard deviation by the uncertainty of the parameters alone, mm.
    pub parameters_sd_mm: f64,
    /// Share of the coordinates that were found within 1.96 of their own standard deviations: 0.95 where the standard deviations are true.
    pub covered: f64,
    /// `covered` at joint angles that the model was learnt at; `null` where there are none.
    pub covered_visited: Option<f64>,
    /// `covered` at joint angles that the model was not learnt at; `null` where there are none.
    pub covered_beyond: Option<f64>,
}

impl Predicted {
    /// In a sentence.
    #[must_use]
    pub fn in_words(&self) -> String {
        let percent = |share: f64| format!("{:.0} %", 100.0 * share);
        let beyond =
            self.covered_beyond.map(|b| format!(" ({} at joint angles that it was not fitted at)", percent(b)));
        format!(
            "The model expects a standard deviation of {:.3} mm in each coordinate, {:.3} mm of it from its parameters; {} of the \
             coordinates lie within its 95 % intervals{}.",
            self.sd_mm,
            self.parameters_sd_mm,
            percent(self.covered),
            beyond.unwrap_or_default()
        )
    }
}

/// Standard deviations of one coordinate, m, and how far off the prediction was.
struct Coordinate {
    parameters: f64,
    all: f64,
    error: f64,
    observation: usize,
}

/// What a model says of its own errors beside what they are. `own` are indices of terms that were identified from `train`; `learnt` says of
/// each recording whether the model was learnt on it, `beyond` of each observation of `data` whether it is at joint angles that the model was
/// not learnt at. `None` where there is nothing to say.
///
/// # Errors
/// Data that the model cannot predict.
pub(crate) fn predicted(
    model: &Model,
    uncertainty: &Uncertainty,
    (own, train): (&[usize], &Dataset),
    data: &Dataset,
    (learnt, beyond): (&[bool], &[bool]),
) -> Result<Option<Predicted>> {
    let all = coordinates(model, uncertainty, (own, train), data, (learnt, beyond))?;
    let root_mean = |of: &dyn Fn(&Coordinate) -> f64| {
        let square: f64 = all.iter().map(|c| of(c).powi(2)).sum();
        let n = all.len().max(1) as f64;
        (square / n).sqrt() * 1e3
    };
    let covered = |pick: &dyn Fn(&Coordinate) -> bool| {
        let some: Vec<&Coordinate> = all.iter().filter(|c| pick(c)).collect();
        let held = some.iter().filter(|c| c.error.abs() <= HOLDS_95 * c.all).count();
        (!some.is_empty()).then(|| held as f64 / some.len() as f64)
    };
    let is_beyond = |c: &Coordinate| beyond.get(c.observation).copied().unwrap_or(false);
    Ok(covered(&|_| true).map(|share| Predicted {
        sd_mm: root_mean(&|c| c.all),
        parameters_sd_mm: root_mean(&|c| c.parameters),
        covered: share,
        covered_visited: covered(&|c| !is_beyond(c)),
        covered_beyond: covered(&is_beyond),
    }))
}

/// How uncertain a model is of where the tool is.
pub struct Expected {
    forward: Forward,
    /// Of the terms that are free in `forward`.
    covariance: Mat,
    /// Where it is at least so uncertain: beyond these joint angles.
    visited: Support,
    effects: f64,
}

impl Expected {
    /// Of the terms of arm and tool of a model file; `None` where the file does not say how uncertain they are together.
    ///
    /// # Errors
    /// A model that its own arm cannot have.
    pub fn of(file: &ModelFile) -> Result<Option<Self>> {
        let Some(uncertainty) = &file.uncertainty else { return Ok(None) };
        let model = &file.model.clone().with_seen_tcp();
        let of_session = |k: &usize| matches!(model.terms[*k].site, Site::Frame { .. } | Site::Target { .. });
        let known = known(model, uncertainty, &|k| !of_session(&k) && model.terms[k].scope() != Scope::Course);
        let forward = Forward::new(model.clone(), known.iter().map(|k| k.0).collect())?;
        let covariance = covariance(model, uncertainty, &known);
        Ok(Some(Self { covariance, forward, visited: file.visited(), effects: uncertainty.effects }))
    }

    /// Standard deviation of a coordinate of the tool's position in the arm's base by the parameters, m: root mean square of the three. Beyond the
    /// joint angles that the model was fitted at it is no less than what may be otherwise there.
    #[must_use]
    pub fn deviation(&self, state: &State) -> f64 {
        let (p, mut ws) = (self.forward.free().len(), self.forward.workspace());
        let mut block = vec![0.0; 6 * p];
        let anywhere = Measured::Pose { position: [0.0; 3], quaternion: [1.0, 0.0, 0.0, 0.0] };
        self.forward.linearize(state, &anywhere, 0, &mut ws, &mut block);
        let h = Mat::from_fn(3, p, |i, j| block[i * p + j]);
        let through = &h * &self.covariance;
        let square: f64 = (0..3).flat_map(|i| (0..p).map(move |j| (i, j))).map(|at| through[at] * h[at]).sum();
        let effects = if self.visited.beyond(&state.q).is_some() { self.effects } else { 0.0 };
        (square / 3.0).max(effects * effects).sqrt()
    }
}

/// Terms of a model of which a file says how uncertain they are, and where it does; those that `pick` takes.
fn known(model: &Model, uncertainty: &Uncertainty, pick: &dyn Fn(usize) -> bool) -> Vec<(usize, usize)> {
    let place = |k: usize| uncertainty.names.iter().position(|n| *n == model.terms[k].name);
    let asked = (0..model.terms.len()).filter(|k| pick(*k) && model.terms[*k].sd.is_some());
    asked.filter_map(|k| Some((k, place(k)?))).collect()
}

/// Covariance of such terms.
pub(crate) fn covariance(model: &Model, uncertainty: &Uncertainty, known: &[(usize, usize)]) -> Mat {
    let (m, count) = (known.len(), uncertainty.names.len());
    let sd = |k: usize| model.terms[known[k].0].sd.unwrap_or(0.0);
    Mat::from_fn(m, m, |i, j| uncertainty.correlation[known[i].1 * count + known[j].1] * sd(i) * sd(j))
}

/// Derivatives of rows to the known and to the own parameters, and the residual.
struct Rows {
    known: Mat,
    own: Mat,
    residual: Vec<f64>,
    observation: Vec<usize>,
}

impl Rows {
    /// Rows of position of every `every`-th observation, and with `rotations` those of orientation, which are as uncertain as the position a
    /// quarter of a metre away.
    fn of(forward: &Forward, known: usize, data: &Dataset, every: usize, rotations: bool) -> Result<Self> {
        check_observations(forward, data)?;
        let p = forward.free().len();
        let (mut ws, mut block) = (forward.workspace(), vec![0.0; 6 * p]);
        let some: Vec<(usize, &Observation)> = data.observations.iter().enumerate().step_by(every).collect();
        let (mut entries, mut residual, mut observation) = (Vec::new(), Vec::new(), Vec::new());
        for (at, o) in some {
            trical_model::interrupt::checkpoint()?;
            let rows = forward.linearize(&o.state, &o.measured, o.frame, &mut ws, &mut block);
            let framed = matches!(o.measured, Measured::Pose { .. });
            for k in 0..if rotations || !framed { rows } else { rows.min(3) } {
                let weight = if k < 3 { 1.0 } else { 0.25 };
                entries.extend(block[k * p..(k + 1) * p].iter().map(|v| v * weight));
                residual.push(ws.residual()[k] * weight);
                observation.push(at);
            }
        }
        let m = residual.len();
        Ok(Self {
            known: Mat::from_fn(m, known, |i, j| entries[i * p + j]),
            own: Mat::from_fn(m, p - known, |i, j| entries[i * p + known + j]),
            residual,
            observation,
        })
    }
}

fn coordinates(
    model: &Model,
    uncertainty: &Uncertainty,
    (own, train): (&[usize], &Dataset),
    data: &Dataset,
    (learnt, beyond): (&[bool], &[bool]),
) -> Result<Vec<Coordinate>> {
    let known = known(model, uncertainty, &|k| !own.contains(&k));
    let m = known.len();
    let forward = Forward::new(model.clone(), known.iter().map(|k| k.0).chain(own.iter().copied()).collect())?;
    let every = data.observations.len().div_ceil(MEASUREMENTS).max(1);
    let asked = Rows::of(&forward, m, data, every, false)?;
    let covariance = covariance(model, uncertainty, &known);
    let (mut h, mut of_own) = (asked.known, vec![0.0; asked.residual.len()]);
    if !own.is_empty() {
        let every = train.observations.len().div_ceil(MEASUREMENTS).max(1);
        let fitted = Rows::of(&forward, m, train, every, true)?;
        let normal = fitted.own.transpose() * &fitted.own;
        let damped = Mat::from_fn(own.len(), own.len(), |i, j| {
            normal[(i, j)] * if i == j { 1.0 + 1e-9 } else { 1.0 } + if i == j { 1e-12 } else { 0.0 }
        });
        let factor = Cholesky::of(&damped).ok_or_else(|| {
            IdentError::NotEnough("the poses that the measuring frame is identified from do not determine it".into())
        })?;
        let taken_up = factor.solve(&(fitted.own.transpose() * &fitted.known));
        h -= &(&asked.own * &taken_up);
        let through = &asked.own * &factor.inverse();
        for (i, v) in of_own.iter_mut().enumerate() {
            *v = (0..own.len()).map(|j| through[(i, j)] * asked.own[(i, j)]).sum();
        }
    }
    let through = &h * &covariance;
    let noise = uncertainty.noise;
    let each = asked.residual.iter().zip(of_own).zip(asked.observation).enumerate();
    Ok(each
        .map(|(i, ((error, of_own), observation))| {
            let of_known: f64 = (0..m).map(|j| through[(i, j)] * h[(i, j)]).sum();
            let parameters = of_known.max(0.0) + noise * noise * of_own;
            let known = learnt.get(data.observations[observation].recording).copied().unwrap_or(false);
            let course = if known { 0.0 } else { uncertainty.course };
            let effects = if beyond.get(observation) == Some(&true) { uncertainty.effects } else { 0.0 };
            // a curve that was never visited is as uncertain by its own prior
            let unsure = parameters.max(effects * effects);
            let all = (unsure + noise * noise + course * course).sqrt();
            Coordinate { parameters: parameters.sqrt(), all, error: *error, observation }
        })
        .collect())
}
