//! What a calibration is worth at poses, blocks, sessions and places that its fit did not see.

use serde::Serialize;
use trical_model::{Cell, Forward, Robot, Task};

use crate::calibration::by_place::{ByPlace, score_places};
use crate::dataset::{Dataset, Observation};
use crate::error::{IdentError, Result};
use crate::fit::ball_places::{self, place_of, unknown_places};
use crate::fit::choice::Choice;
use crate::fit::folds::{FOLDS, Folds};
use crate::fit::identify::{ErrorSummary, Fit, identify};
use crate::fit::residuals::position_errors;
use crate::validate::adapted::score_session;

/// Share of each session's poses that is predicted by a fit to those before, percent.
const LAST: usize = 25;

/// How [`HeldOut::by_block`] is named.
pub const BY_BLOCK: &str = "by block of poses";
/// How [`HeldOut::forward`] is named.
pub const FORWARD: &str = "forward in time";

/// Errors at poses that the fit did not see.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct HeldOut {
    /// Each pose by a fit without it (rows at the same joints are one pose).
    pub by_pose: Option<ErrorSummary>,
    /// Each block of neighbouring poses by a fit without it.
    pub by_block: Option<ErrorSummary>,
    /// The last quarter of each session's poses by a fit to those before.
    pub forward: Option<ErrorSummary>,
    /// Each session by the arm that the others say, its own setup identified on every fourth of its poses.
    pub by_session: Option<ErrorSummary>,
    /// Each place of the balls by the arm that the others say, the place's own pose identified on half of its touches; see [`score_places`].
    pub by_place: Option<ErrorSummary>,
}

impl HeldOut {
    /// Each that there is, with what it is.
    #[must_use]
    pub fn named(&self) -> Vec<(&'static str, ErrorSummary)> {
        [
            ("by pose", self.by_pose),
            (BY_BLOCK, self.by_block),
            (FORWARD, self.forward),
            ("by session", self.by_session),
            ("by place of the balls", self.by_place),
        ]
        .into_iter()
        .filter_map(|(name, e)| e.map(|e| (name, e)))
        .collect()
    }

    /// The one with the largest mean error.
    #[must_use]
    pub fn worst(&self) -> Option<(&'static str, ErrorSummary)> {
        self.named().into_iter().max_by(|a, b| a.1.mean_mm.total_cmp(&b.1.mean_mm))
    }

    /// The largest error of all of them, mm: it need not be of the one with the largest mean.
    #[must_use]
    pub fn largest_mm(&self) -> f64 {
        self.named().into_iter().map(|(_, e)| e.max_mm).fold(0.0, f64::max)
    }
}

/// Errors (m) of the observations whose pose is in `scored`, by a fit to the others.
fn unseen(data: &Dataset, scored: &dyn Fn(usize) -> bool, fit: Fit<'_>) -> Result<Vec<f64>> {
    let (train, scored) = (data.filtered(|o| !scored(o.pose)), data.filtered(|o| scored(o.pose)));
    let fitted = fit(&train)?;
    let known = unknown_places(&fitted.model.cell, &train);
    let unknown = unknown_places(&fitted.model.cell, data);
    let told = |data: &Dataset, p| ball_places::terms(&fitted.model.cell, data, p).len();
    let poor: Vec<_> =
        unknown.into_iter().filter(|p| !known.contains(p) || told(&train, *p) < told(data, *p)).collect();
    let nowhere = |o: &Observation| place_of(o).is_some_and(|p| poor.contains(&p));
    if let Some(o) = scored.observations.iter().find(|o| nowhere(o)) {
        return Err(data.error(o, "where the balls stood cannot be told from the poses that are fitted"));
    }
    let forward = Forward::new(fitted.model, Vec::new())?;
    Ok(position_errors(&forward, &scored))
}

/// Errors (m) of every observation, fold by fold: each by a fit to the poses of the other folds. No fold cuts a block of neighbouring poses.
/// Everything is fitted on the rest, the measuring frame too.
///
/// # Errors
/// As [`identify`], and fewer blocks than folds.
pub fn cross_validate(
    robot: &Robot,
    cell: &Cell,
    data: &Dataset,
    choice: impl Into<Choice>,
    count: usize,
) -> Result<Vec<f64>> {
    let choice = choice.into();
    let folds = Folds::of(data);
    let fit = |data: &Dataset| identify(robot, cell, data, choice.clone());
    if count < 2 || folds.blocks() < 2 * count {
        return Err(IdentError::NotEnough(format!(
            "{count}-fold cross-validation needs at least 2 folds and twice as many blocks of neighbouring poses as folds; there \
             are {} blocks of {} poses",
            folds.blocks(),
            folds.poses().len()
        )));
    }
    let mut errors = Vec::with_capacity(data.observations.len());
    for split in folds.by_block(count) {
        errors.extend(unseen(data, &split, &fit)?);
    }
    Ok(errors)
}

/// Errors (m) of the last `percent` of each session's poses, by a fit to those before them: what a calibration is worth later.
///
/// # Errors
/// As [`identify`], and a share that leaves nothing on either side.
pub fn forward_in_time(
    robot: &Robot,
    cell: &Cell,
    data: &Dataset,
    choice: impl Into<Choice>,
    percent: usize,
) -> Result<Vec<f64>> {
    let choice = choice.into();
    let folds = Folds::of(data);
    let fit = |data: &Dataset| identify(robot, cell, data, choice.clone());
    let split = folds.forward(percent).ok_or_else(|| {
        IdentError::NotEnough(format!(
            "{}: the last {percent} % of {} poses leave no poses to fit or none to score",
            data.names.join(", "),
            folds.poses().len()
        ))
    })?;
    unseen(data, &split, &fit)
}

/// Errors at unseen poses, each way that the data allow; a fit that fails has none.
pub(crate) fn held_out(
    robot: &Robot,
    cell: &Cell,
    data: &Dataset,
    folds: &Folds,
    choice: &Choice,
    task: &Task<'_>,
) -> Result<(HeldOut, ByPlace)> {
    let fit = |data: &Dataset| identify(robot, cell, data, choice.clone());
    let summary = |errors: Result<Vec<f64>>| errors.ok().filter(|e| !e.is_empty()).map(|e| ErrorSummary::of(&e));
    let by_pose = || -> Result<Vec<f64>> {
        let mut errors = Vec::with_capacity(data.observations.len());
        for split in folds.by_pose(FOLDS) {
            errors.extend(unseen(data, &split, &fit)?);
        }
        Ok(errors)
    };
    let pose = summary(by_pose());
    task.step(0.65, "scoring blocks of poses")?;
    let block = summary(cross_validate(robot, cell, data, choice.clone(), FOLDS));
    task.step(0.8, "scoring later poses")?;
    let later = summary(forward_in_time(robot, cell, data, choice.clone(), LAST));
    task.step(0.9, "scoring sessions")?;
    let by_session = (data.names.len() > 1).then(|| summary(score_sessions(data, &fit))).flatten();
    task.step(0.95, "scoring places")?;
    let places = score_places(cell, data, &fit).unwrap_or_default();
    let by_place = summary(Ok(places.errors.clone()));
    Ok((HeldOut { by_pose: pose, by_block: block, forward: later, by_session, by_place }, places))
}

/// Sessions that are left out together where there are more: as many fits.
const SESSION_FOLDS: usize = 10;

/// The least share of all measurements that others are scored by: a fit to fewer says what a short session is worth alone, and nothing of a fit to
/// all.
const LEARNT_SHARE: f64 = 0.25;

/// Errors (m) of every session by a fit to others, of up to ten to all others; what is its own is identified from every fourth of its poses, the
/// rest are scored. A session beside which the others are few is not scored.
///
/// # Errors
/// As the fit.
pub fn score_sessions(data: &Dataset, fit: Fit<'_>) -> Result<Vec<f64>> {
    let sessions = data.names.len();
    let mut errors = Vec::new();
    for fold in 0..sessions.min(SESSION_FOLDS) {
        let others = data.filtered(|o| o.recording % SESSION_FOLDS != fold);
        if (others.observations.len() as f64) < LEARNT_SHARE * data.observations.len() as f64 {
            continue;
        }
        let others = fit(&others)?;
        for session in (fold..sessions).step_by(SESSION_FOLDS) {
            errors.extend(score_session(&others.model, &data.filtered(|o| o.recording == session))?);
        }
    }
    Ok(errors)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_is_that_of_the_largest_mean_and_the_largest_error_may_be_of_another() {
        let [even, wide] = [[1e-3, 1e-3], [1e-4, 1.7e-3]].map(|errors| Some(ErrorSummary::of(&errors)));
        let held_out = HeldOut { by_block: wide, forward: even, ..HeldOut::default() };
        assert_eq!(held_out.worst().map(|(how, _)| how), Some("forward in time"));
        assert!((held_out.largest_mm() - 1.7).abs() < 1e-12 && HeldOut::default().largest_mm() == 0.0);
    }
}
