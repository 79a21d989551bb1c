//! Identification: from recordings to a model with uncertainties.

use std::borrow::Cow;

use trical_model::{Cell, Forward, Measured, Model, Robot, State};

use crate::dataset::Dataset;
use crate::dataset::sample::sample;
use crate::dense::{Cholesky, Mat};
use crate::error::{IdentError, Result};
use crate::fit::ball_places;
use crate::fit::cautions::beyond_limits;
use crate::fit::choice::{Choice, optional_groups};
use crate::fit::degenerate::{
    check_balls, check_poses, check_units, check_values, different_numbers, different_poses, resting_joints,
};
use crate::fit::identifiability::{
    Dependent, Observability, covariance, independent_terms, indices, r_factor, weakest_direction,
};
use crate::fit::initial_guess::initial_guess;
use crate::fit::levenberg_marquardt::{Ended, Factored, LmParams, LmReport, Solver};
use crate::fit::noise::Noise;
use crate::fit::normal_equations::triangular;
use crate::fit::priors::PriorKnowledge;
use crate::fit::residuals::{check_count, check_observations, position_errors, weighted_residuals};
use crate::fit::weak_priors::{by_prior, no_softer, plausible, wanders, with_priors};
use crate::rigid::median;

/// Columns with a condition above this cannot be told apart by the data.
const CONDITION_LIMIT: f64 = 1e9;

/// A fitted model and what the fit knows about itself.
#[derive(Clone, Debug)]
pub struct Identified {
    /// The model with its coefficients; every free term has a standard deviation.
    pub model: Model,
    /// Indices of the free terms.
    pub free: Vec<usize>,
    /// Indices of those that a limit stopped: the data ask for more, and their standard deviation is unknown.
    pub at_limit: Vec<usize>,
    /// The data that it was fitted to.
    pub data: Dataset,
    /// Standard deviations of the measurements.
    pub noise: Noise,
    /// Covariance of the free coefficients, SI, row by row.
    pub covariance: Vec<f64>,
    /// By which factor these variances are larger than if all measurements were independent.
    pub design_effect: f64,
    /// Observability of the free terms.
    pub observability: Observability,
    /// Parameters that could not be told from others, and those.
    pub dependent: Vec<Dependent>,
    /// What was known of the free terms beforehand, in their order (nothing beyond its end), weak priors included.
    pub known: Vec<PriorKnowledge>,
    /// Indices of those terms that the measurements say so little of that they were kept near nominal.
    pub weak: Vec<usize>,
    /// How the iteration went.
    pub report: LmReport,
}

/// Mean, maximum and so on of position errors, mm.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ErrorSummary {
    /// Mean.
    pub mean_mm: f64,
    /// Largest.
    pub max_mm: f64,
    /// Standard deviation about the mean.
    pub sd_mm: f64,
    /// Median.
    pub median_mm: f64,
    /// Root of the mean square.
    pub rms_mm: f64,
}

impl ErrorSummary {
    /// Of errors in m.
    #[must_use]
    pub fn of(errors: &[f64]) -> Self {
        let n = errors.len().max(1) as f64;
        let mean = errors.iter().sum::<f64>() / n;
        let square = errors.iter().map(|e| e * e).sum::<f64>() / n;
        let spread = errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        Self {
            mean_mm: mean * 1e3,
            max_mm: errors.iter().copied().fold(0.0, f64::max) * 1e3,
            sd_mm: spread.sqrt() * 1e3,
            median_mm: median(errors) * 1e3,
            rms_mm: square.sqrt() * 1e3,
        }
    }
}

impl Identified {
    /// Errors at the data it was fitted to.
    ///
    /// # Errors
    /// None for a model that was fitted.
    pub fn errors(&self) -> Result<Vec<f64>> {
        Ok(position_errors(&Forward::new(self.model.clone(), Vec::new())?, &self.data))
    }

    /// Covariance of what the model predicts at any pose for a measurement such as `measured` (its values do not matter) in
    /// measuring frame `frame` (0-based), m^2 and rad^2, rows and columns in the axes of that measurement's residual: world for
    /// touches, the measuring frame for points, one length for distances, position and the tool's rotation vector for poses.
    /// It is what the uncertainty of the parameters does to a prediction; the noise of a new measurement comes on top.
    ///
    /// # Errors
    /// A ball, target, anchor or frame that the model does not have, or a term that needs what `state` does not know.
    pub fn prediction_covariance(&self, state: &State, measured: &Measured, frame: usize) -> Result<[[f64; 6]; 6]> {
        let forward = Forward::new(self.model.clone(), self.free.clone())?;
        forward.check(state, measured, frame)?;
        let mut ws = forward.workspace();
        let mut measured = *measured;
        if let Measured::Pose { quaternion, .. } = &mut measured {
            // derivatives at the predicted orientation itself
            *quaternion = forward.orientation_seen(state, frame, &mut ws);
        }
        let p = self.free.len();
        let mut jacobian = vec![0.0; 6 * p];
        let rows = forward.linearize(state, &measured, frame, &mut ws, &mut jacobian);
        let mut out = [[0.0; 6]; 6];
        for (i, to) in out.iter_mut().enumerate().take(rows) {
            for (j, to) in to.iter_mut().enumerate().take(rows) {
                for a in 0..p {
                    let sum: f64 = (0..p).map(|b| self.covariance[a * p + b] * jacobian[j * p + b]).sum();
                    *to += jacobian[i * p + a] * sum;
                }
            }
        }
        Ok(out)
    }

    /// Wald's statistic of some of the free coefficients (indices into `free`): how far they are from zero, squared, in the metric of
    /// their covariance. 0 where that is singular.
    #[must_use]
    pub fn wald(&self, some: &[usize]) -> f64 {
        let p = self.free.len();
        let value = |k: usize| self.model.terms[self.free[k]].value;
        let block = Mat::from_fn(some.len(), some.len(), |i, j| self.covariance[some[i] * p + some[j]]);
        let x = Mat::from_fn(some.len(), 1, |i, _| value(some[i]));
        Cholesky::of(&block).map_or(0.0, |l| {
            let y = l.solve(&x);
            (0..some.len()).map(|i| x[(i, 0)] * y[(i, 0)]).sum()
        })
    }

    /// Names of the parameters that a limit stopped.
    #[must_use]
    pub fn stopped(&self) -> Vec<&str> {
        self.at_limit.iter().map(|k| self.model.terms[*k].name.as_str()).collect()
    }

    /// Parameters that were left out since others do the same, each with those: "d_2 (moves together with d_3)".
    #[must_use]
    pub fn left_out(&self) -> Vec<String> {
        let moved = self.dependent.iter().filter(|d| !d.with.is_empty() && !d.held);
        moved.map(|d| format!("{} (moves together with {})", d.name, d.with.join(", "))).collect()
    }

    /// Names of the parameters that were held at nominal since joints hardly move.
    #[must_use]
    pub fn held(&self) -> Vec<&str> {
        self.dependent.iter().filter(|d| d.held).map(|d| d.name.as_str()).collect()
    }

    /// Names of the parameters that were kept near nominal, since the measurements say little of them.
    #[must_use]
    pub fn kept_near_nominal(&self) -> Vec<&str> {
        self.weak.iter().map(|k| self.model.terms[*k].name.as_str()).collect()
    }

    /// Pairs of parameters with a correlation beyond `limit`.
    #[must_use]
    pub fn correlated(&self, limit: f64) -> Vec<(String, String, f64)> {
        let p = self.free.len();
        let c = |i: usize, j: usize| self.covariance[i * p + j];
        let mut pairs = Vec::new();
        for i in 0..p {
            for j in 0..i {
                let r = c(i, j) / (c(i, i) * c(j, j)).sqrt();
                if r.abs() > limit {
                    let name = |k: usize| self.model.terms[self.free[k]].name.clone();
                    pairs.push((name(j), name(i), r));
                }
            }
        }
        pairs
    }
}

/// Fits `model` (all of its terms free) to the data as it is, with noise re-estimated per recording.
///
/// # Errors
/// Too few data, parameters that the data cannot tell apart, or no convergence: a fit that failed is not a model.
pub fn fit_model(model: Model, data: &Dataset, start_noise: &Noise, dependent: Vec<Dependent>) -> Result<Identified> {
    fit_model_knowing(model, data, start_noise, &[], dependent)
}

/// As [`fit_model`], with what is known of the terms in their order (nothing beyond the end of `known`).
///
/// # Errors
/// As [`fit_model`].
pub fn fit_model_knowing(
    model: Model,
    data: &Dataset,
    start_noise: &Noise,
    known: &[PriorKnowledge],
    dependent: Vec<Dependent>,
) -> Result<Identified> {
    let free = (0..model.terms.len()).collect();
    fit_some(model, free, data, start_noise, known, dependent, &LmParams::default())
}

/// As [`fit_model_knowing`] of the terms `free` alone, all others as they are, as exactly as `params` says; `known` is of the free
/// terms in their order.
///
/// # Errors
/// As [`fit_model`].
pub fn fit_some(
    model: Model,
    free: Vec<usize>,
    data: &Dataset,
    start_noise: &Noise,
    known: &[PriorKnowledge],
    dependent: Vec<Dependent>,
    params: &LmParams,
) -> Result<Identified> {
    let p = free.len();
    let mut forward = Forward::new(model, free)?;
    check_observations(&forward, data)?;
    let mut noise = start_noise.clone();
    let mut solver = Solver::new(p);
    if let Some(sample) = sample(data) {
        near(&mut solver, &mut forward, &sample, &noise, known);
    }
    let mut report = solver.minimize(&mut forward, data, &noise, known, params)?;
    let mut residuals = weighted_residuals(&forward, data, &noise);
    let mut said = noise.clone();
    for _ in 0..2 {
        let mut updated = noise.clone();
        let factor = updated.update(data, &residuals, p);
        if let Some(factor) = factor
            && known.iter().all(|k| k.prior.is_none())
        {
            // one standard deviation for all: its size moves nothing
            report.cost /= factor * factor;
            said = updated;
            break;
        }
        said = updated.clone();
        if updated.is_near(&noise, params.noise_tolerance) {
            break;
        }
        noise = updated;
        report = solver.minimize(&mut forward, data, &noise, known, params)?;
        residuals = weighted_residuals(&forward, data, &noise);
    }
    let factored = factor_of(&solver, &forward, data, &noise, known);
    let at_limit = solver.at_limit().to_vec();
    let fitted = Fitted { factored, at_limit, residuals, noise: said, report, dependent };
    Ok(Identified { known: known.to_vec(), ..finish(forward, data, fitted)? })
}

/// Brings the coefficients to where a sample of the data has them, so that all of the data is asked twice and not five times.
/// A sample that does not tell the parameters apart leaves them where they are.
fn near(solver: &mut Solver, forward: &mut Forward, sample: &Dataset, noise: &Noise, known: &[PriorKnowledge]) {
    let begin = forward.coefficients();
    let fitted = solver.minimize(forward, sample, noise, known, &LmParams::default());
    let good = fitted.is_ok_and(|report| !matches!(report.ended, Ended::Iterations | Ended::Stuck))
        && factor_of(solver, forward, sample, noise, known).spectrum.is_some_and(|(_, s)| tells_apart(&s));
    if !good {
        forward.set_coefficients(&begin);
    }
}

/// The factor of `J` where `solver` ended.
fn factor_of(solver: &Solver, forward: &Forward, data: &Dataset, noise: &Noise, known: &[PriorKnowledge]) -> Factored {
    solver.factor().unwrap_or_else(|| Factored::of(r_factor(forward, data, noise, known)))
}

/// Where a fit ended.
struct Fitted {
    /// Of `J`.
    factored: Factored,
    /// Coefficients that a limit stopped.
    at_limit: Vec<bool>,
    /// In the same units.
    residuals: Vec<([f64; 6], usize)>,
    noise: Noise,
    report: LmReport,
    dependent: Vec<Dependent>,
}

fn finish(forward: Forward, data: &Dataset, fitted: Fitted) -> Result<Identified> {
    let Fitted { factored, at_limit, residuals, noise, report, dependent } = fitted;
    let free = forward.free().to_vec();
    // what a limit holds is fixed, and tells nothing of the others
    let moved: Vec<usize> = (0..free.len()).filter(|k| !at_limit[*k]).collect();
    let p = moved.len();
    let Factored { r, spectrum } =
        if p == free.len() { factored } else { Factored::of(triangular(&factored.r, &moved)) };
    let names = || moved.iter().map(|k| forward.model().terms[free[*k]].name.clone()).collect::<Vec<_>>();
    // first, since an iteration on data of deficient rank may also fail to converge
    if !spectrum.as_ref().is_some_and(|(_, s)| tells_apart(s)) {
        return Err(rank_deficient(&forward.model().robot, data, &r, names()));
    }
    if matches!(report.ended, Ended::Iterations | Ended::Stuck) {
        let weak = weakest_direction(&r, &names(), 1.0).unwrap_or_default();
        return Err(IdentError::NotConverged(
            format!(
                "it stopped after {} iterations{}, gradient {:.1e}; are robot.toml and cell.toml those of this arm{}? These measurements determine {}{} least: measure more varied poses, or identify fewer parameters",
                report.iterations,
                if report.ended == Ended::Stuck { " where no step helped" } else { "" },
                report.gradient,
                if in_radians(data) { ", and the joint angles in deg (none is beyond 6.3)" } else { "" },
                weak.join(", "),
                if weak.len() > 1 { " together" } else { "" },
            ) + &beyond_limits(&forward.model().robot, data).map_or_else(String::new, |said| format!("; {said}")),
        ));
    }
    let rows: usize = residuals.iter().map(|(_, n)| n).sum();
    let square: f64 = residuals.iter().map(|(r, n)| r[..*n].iter().map(|v| v * v).sum::<f64>()).sum();
    // priors allow more parameters than rows: what they hold is counted, too, so that standard deviations are rather too large
    let variance = square / rows.saturating_sub(p).max(1) as f64;
    let (scale, singular) = spectrum.unwrap_or_default();
    let of_moved = covariance(&r, &scale);
    let mut model = forward.into_model();
    let mut covariance = vec![0.0; free.len() * free.len()];
    for (i, a) in moved.iter().enumerate() {
        for (j, b) in moved.iter().enumerate() {
            covariance[a * free.len() + b] = of_moved[i * p + j] * variance;
        }
        model.terms[free[*a]].sd = Some((of_moved[i * p + i] * variance).max(0.0).sqrt());
    }
    let at_limit: Vec<usize> = (0..free.len()).filter(|k| at_limit[*k]).map(|k| free[k]).collect();
    for k in &at_limit {
        model.terms[*k].sd = None;
    }
    let observability = indices(&singular, rows);
    let data = data.clone();
    let (known, weak) = (Vec::new(), Vec::new());
    Ok(Identified {
        model,
        free,
        at_limit,
        data,
        noise,
        covariance,
        design_effect: 1.0,
        observability,
        dependent,
        known,
        weak,
        report,
    })
}

/// Whether data with these singular values (columns of unit length, largest first) tells all parameters apart.
pub(crate) fn tells_apart(singular: &[f64]) -> bool {
    singular.last().zip(singular.first()).is_none_or(|(smallest, largest)| smallest * CONDITION_LIMIT > *largest)
}

/// Whether angles look like radians that were taken for degrees.
fn in_radians(data: &Dataset) -> bool {
    let most = data.observations.iter().flat_map(|o| o.state.q).fold(0.0, |m: f64, q| m.max(q.abs()));
    most.to_degrees() < 6.3
}

/// Which of the parameters `names` of the factor `r` the data cannot tell apart, and what about the data may be why.
pub(crate) fn rank_deficient(robot: &Robot, data: &Dataset, r: &Mat, names: Vec<String>) -> IdentError {
    let weak = weakest_direction(r, &names, CONDITION_LIMIT).unwrap_or(names);
    let what = match &weak[..] {
        [one] => format!("cannot tell {one}"),
        _ => format!("cannot tell {} apart", weak.join(", ")),
    };
    let resting: Vec<String> = resting_joints(robot, data).iter().map(ToString::to_string).collect();
    let poses = different_poses(robot, data);
    let why = if resting.is_empty() {
        format!("{} measurements at {poses} different poses", data.observations.len())
    } else {
        format!("joint {} never moves", resting.join(", "))
    };
    IdentError::NotEnough(format!("these measurements {what} ({why}): more varied poses are needed"))
}

/// The nominal model with the independent terms of `set` and a start from closed forms.
///
/// # Errors
/// A robot without masses where compliance is asked for, or measurements that fix no frame.
pub fn prepared(robot: &Robot, cell: &Cell, data: &Dataset, choice: &Choice) -> Result<(Model, Vec<Dependent>)> {
    check_values(robot, data)?;
    for o in &data.observations {
        let (what, found, of, count) = match o.measured {
            Measured::Touch { ball, .. } => ("ball", ball, "the cell", cell.balls.len()),
            Measured::Point { target, .. } => {
                ("target", target, "the cell's [tool] targets_mm", cell.tool.targets.len())
            }
            _ => continue,
        };
        if found >= count {
            let problem = format!("found {what} {}, but {of} has {count}", found + 1);
            return Err(IdentError::at(&data.names[o.recording], format!("line {}, column {what}", o.line), problem));
        }
    }
    check_balls(cell, data)?;
    check_poses(robot, data)?;
    check_units(robot, cell, data)?;
    let mut model = Model::nominal(robot.clone(), cell.clone());
    model.frames = vec![trical_model::Pose::identity(); data.frames()];
    let (terms, dependent) = independent_terms(judged(&model, data)?.as_ref(), data, choice)?;
    model.terms = terms;
    check_count(data, model.terms.len(), &choice.known().of(&model)?)?;
    initial_guess(&mut model, sample(data).as_ref().unwrap_or(data))?;
    Ok((model, dependent))
}

/// The model on which structure is judged: the nominal one. Where there are only lengths, which need no idea of where the base
/// stands or the tool is, these come from the data: a tool that the cell leaves on the last axis would hide parameters.
fn judged<'a>(nominal: &'a Model, data: &Dataset) -> Result<Cow<'a, Model>> {
    if data.has(|m| !matches!(m, Measured::Distance { .. })) {
        return Ok(Cow::Borrowed(nominal));
    }
    let constant = |site| trical_model::Term::new("start", "start", site, trical_model::Basis::CONSTANT);
    let mut model = nominal.clone();
    model.terms = trical_model::Motion::ALL.map(|m| constant(trical_model::Site::Base(m))).to_vec();
    model.terms.extend(trical_model::Motion::ALL[..3].iter().map(|m| constant(trical_model::Site::Tool(*m))));
    initial_guess(&mut model, data)?;
    let cell = model.rigid()?.cell;
    Ok(Cow::Owned(Model { cell, terms: Vec::new(), ..model }))
}

/// Identifies the parameters of `set`. The data should have passed [`crate::reject_gross_errors`].
///
/// Where the measurements leave parameters of the arm more uncertain than arms differ from nominal, all of the arm's are kept near nominal by
/// weak priors ([`Identified::weak`] says which needed it). What gravity does to an arm without masses and torques, and errors of a rail over its
/// length, are kept where the data show them (the Bayesian information criterion).
///
/// # Errors
/// As [`fit_model`].
pub fn identify(robot: &Robot, cell: &Cell, data: &Dataset, choice: impl Into<Choice>) -> Result<Identified> {
    let choice = choice.into();
    let plain = identify_as_said(robot, cell, data, &choice)?;
    let groups: Vec<Vec<String>> = optional_groups(&Model::nominal(robot.clone(), cell.clone()), data, &choice)?
        .into_iter()
        .map(|group| group.into_iter().map(|t| t.name).collect())
        .collect();
    let numbers = different_numbers(robot, data);
    if groups.is_empty() || numbers < OPTIONAL * plain.free.len() {
        return Ok(plain);
    }
    let Ok(all) = identify_as_said(robot, cell, data, &choice.clone().with_optional(groups.concat())) else {
        return Ok(plain);
    };
    let needed = |group: &&Vec<String>| {
        let own: Vec<usize> =
            (0..all.free.len()).filter(|k| group.contains(&all.model.terms[all.free[*k]].name)).collect();
        let price = own.len() as f64 * libm::log(numbers as f64);
        !own.is_empty() && all.wald(&own) > price
    };
    let kept: Vec<Vec<String>> = groups.iter().filter(needed).cloned().collect();
    match kept.len() {
        0 => Ok(plain),
        k if k == groups.len() => Ok(all),
        _ => Ok(identify_as_said(robot, cell, data, &choice.with_optional(kept.concat())).unwrap_or(plain)),
    }
}

/// So many numbers must be there for each parameter of the plain model before it is asked what else it needs.
const OPTIONAL: usize = 4;

/// Where a fit fails without weak priors, and with them half of the errors are larger, m, the arm is not this one.
const IMPLAUSIBLE: f64 = 1e-2;

fn identify_as_said(robot: &Robot, cell: &Cell, data: &Dataset, choice: &Choice) -> Result<Identified> {
    let (model, dependent) = prepared(robot, cell, data, choice)?;
    let known = known(&model, data, choice)?;
    let (noise, params) = manner(&model, data);
    fit_near_nominal(&model, data, data, &noise, &known, dependent, &params)
}

/// The fit of all terms of a model. Where the data do not determine them, or leave parameters of the arm more uncertain than they are without
/// any data, these are held near nominal by weak priors; the loads of `all` that was measured of the arm say how soft its joints may be.
///
/// # Errors
/// As [`fit_model`].
pub fn fit_near_nominal(
    model: &Model,
    data: &Dataset,
    all: &Dataset,
    noise: &Noise,
    known: &[PriorKnowledge],
    dependent: Vec<Dependent>,
    params: &LmParams,
) -> Result<Identified> {
    let free: Vec<usize> = (0..model.terms.len()).collect();
    let fit =
        |known: &[PriorKnowledge]| fit_some(model.clone(), free.clone(), data, noise, known, dependent.clone(), params);
    let found = fit(known);
    if !ball_places::unknown_places(&model.cell, data).is_empty() {
        return found;
    }
    let plausible = plausible(model, all);
    let again = match &found {
        Ok(found) => wanders(&found.model, &plausible),
        Err(IdentError::NotEnough(_) | IdentError::NotConverged(_)) => {
            different_numbers(&model.robot, data) >= model.terms.len()
        }
        Err(_) => false,
    };
    if !again || plausible.iter().all(Option::is_none) {
        return found;
    }
    let plausible = no_softer(model, &plausible);
    match fit(&with_priors(&plausible, known)) {
        // no arm is so far from nominal: it is another one, or its data are wrong
        Ok(kept) if found.is_err() && median(&kept.errors()?) > IMPLAUSIBLE => found,
        Ok(kept) => Ok(Identified { weak: by_prior(&kept.model, &plausible, known), ..kept }),
        Err(_) => found,
    }
}

/// The model with the terms `free` identified again on `data`, all others as they are.
///
/// # Errors
/// As a fit.
pub(crate) fn refit(model: Model, free: Vec<usize>, data: &Dataset) -> Result<Forward> {
    let (noise, params) = manner(&model, data);
    let usual = ball_places::usual(&model, data);
    let known: Vec<PriorKnowledge> = free.iter().filter_map(|k| usual.get(*k).copied()).collect();
    let mut forward = Forward::new(model, free)?;
    check_observations(&forward, data)?;
    Solver::new(forward.free().len()).minimize(&mut forward, data, &noise, &known, &params)?;
    Ok(forward)
}

/// A fit to some of the data.
pub type Fit<'a> = &'a dyn Fn(&Dataset) -> Result<Identified>;

/// Where most residuals count linearly, as those of a nominal arm do, the weights follow the residuals step by step and a fit converges linearly:
/// it takes some hundred iterations.
const ROBUST_ITERATIONS: usize = 2000;

/// How a fit begins and what it minimizes: plain least squares; where places of balls are unknown, as with printed sockets, with their
/// play as noise and a robust loss.
#[must_use]
pub fn manner(model: &Model, data: &Dataset) -> (Noise, LmParams) {
    let recordings = data.names.len();
    if ball_places::unknown_places(&model.cell, data).is_empty() {
        (Noise::usual(recordings), LmParams::default())
    } else {
        (
            Noise::of_sockets(recordings),
            LmParams { huber: ball_places::HUBER, max_iterations: ROBUST_ITERATIONS, ..LmParams::default() },
        )
    }
}

/// What is known of the model's terms beforehand: what the user says, and, where places of balls are unknown, what is usual.
pub(crate) fn known(model: &Model, data: &Dataset, choice: &Choice) -> Result<Vec<PriorKnowledge>> {
    let said = choice.known().of(model)?;
    let usual = ball_places::usual(model, data);
    Ok(if usual.is_empty() {
        said
    } else {
        said.into_iter().zip(usual).map(|(said, usual)| if said.is_nothing() { usual } else { said }).collect()
    })
}
