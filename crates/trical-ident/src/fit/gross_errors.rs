//! Gross errors: measurements that no model of the arm explains, by a robust fit.

use trical_model::{Cell, Forward, Measured, Robot, Workspace};

use crate::dataset::sample::sample;
use crate::dataset::{Dataset, Observation};
use crate::error::{IdentError, Result};
use crate::fit::choice::{Choice, OwnSetup, ParameterSet};
use crate::fit::identify::{manner, prepared};
use crate::fit::levenberg_marquardt::{LmParams, Solver};
use crate::fit::noise::Noise;
use crate::fit::residuals::{check_observations, length, weighted, weighted_residuals};

/// A measurement this many robust standard deviations off (as the length of its weighted residual) is a gross error: with
/// three scalars and honest noise not one in a million is beyond six, and what a model lacks adds to that.
pub(crate) const GROSS: f64 = 10.0;

/// Gross errors are few: at most this share of the rows, or [`FEW`]. Of more it is the arm that is not as the model says, in a part of its poses.
const MOST: f64 = 0.15;

/// So many of a short recording.
const FEW: usize = 3;

/// Numbers measured for each parameter of a robust fit. It goes through as many numbers as it has parameters, and the median of the residuals
/// is the noise only where those are fewer than half.
const FOR_EACH: usize = 2;

/// The robust noise has settled where no more than this fraction of it changes: nothing to a limit of ten.
const SETTLED: f64 = 1e-4;

/// Finds gross errors: a robust fit (Huber) of the richest model that the data and the robot allow, then every measurement
/// that is far beyond the rest. Where these were many, those that are farther still.
///
/// # Errors
/// As [`crate::fit_model`].
pub fn reject_gross_errors(robot: &Robot, cell: &Cell, data: &Dataset) -> Result<Dataset> {
    reject_gross_errors_beyond(robot, cell, data, GROSS)
}

/// As [`reject_gross_errors`], with another limit (robust standard deviations).
///
/// # Errors
/// As [`crate::fit_model`].
pub fn reject_gross_errors_beyond(robot: &Robot, cell: &Cell, data: &Dataset, limit: f64) -> Result<Dataset> {
    let mut kept = data.clone();
    let mut sets = sets_of(robot);
    let most = ((MOST * data.observations.len() as f64) as usize).max(FEW);
    for _ in 0..5 {
        // of many rows, some stand for all: the limit is ten standard deviations, and a sample has these to a percent
        let some = sample(&kept);
        let (forward, noise) = richest(robot, cell, some.as_ref().unwrap_or(&kept), &mut sets)?;
        check_observations(&forward, &kept)?;
        let residuals = weighted_residuals(&forward, &kept, &noise);
        let times: Vec<f64> = residuals.iter().map(|(r, rows)| length(&r[..*rows])).collect();
        let beyond = |limit: f64| (0..times.len()).filter(|i| times[*i] > limit).collect::<Vec<usize>>();
        let (mut bad, mut further) = (beyond(limit), limit);
        while data.observations.len() - kept.observations.len() + bad.len() > most {
            further *= 2.0;
            bad = beyond(further);
        }
        if bad.is_empty() {
            break;
        }
        let mut ws = forward.workspace();
        for i in &bad {
            let o = kept.observations[*i];
            let ball = right_ball(&forward, &noise, &o, &mut ws);
            let rows = forward.residual(&o.state, &o.measured, o.frame, &mut ws);
            kept.reject(&o, gross_error(&ws.residual()[..rows], &residuals[*i].0[..rows], ball));
        }
        kept = kept.without_rejected();
    }
    Ok(kept)
}

/// Why a row is rejected that has this residual (m, rad), in standard deviations `weighted`: how far its position is off, or its orientation
/// where that is the worse. `ball` is the one (0-based) that it fits.
pub(crate) fn gross_error(residual: &[f64], weighted: &[f64], ball: Option<usize>) -> String {
    let parts = |r: &[f64]| {
        let (position, orientation) = r.split_at(r.len().min(3));
        (length(position), length(orientation))
    };
    let ((off, turned), (times_off, times_turned)) = (parts(residual), parts(weighted));
    let how_far = match times_turned > times_off {
        true => format!("has an orientation that is {:.3} deg off", turned.to_degrees()),
        false => format!("is {:.3} mm off", off * 1e3),
    };
    wrong_ball(format!("{how_far}, {:.0} times the usual error here: a gross error", length(weighted)), ball)
}

/// What is wrong with a row, and that it names the wrong ball where it fits another.
#[must_use]
pub fn wrong_ball(off: String, ball: Option<usize>) -> String {
    match ball {
        Some(ball) => format!("{off} (it fits ball {}: the wrong ball number was recorded)", ball + 1),
        None => off,
    }
}

/// Another ball (0-based) that a touch fits as well as the others do theirs.
#[must_use]
pub fn right_ball(forward: &Forward, noise: &Noise, o: &Observation, ws: &mut Workspace) -> Option<usize> {
    let Measured::Touch { ball: noted, reading } = o.measured else { return None };
    (0..forward.model().cell.balls.len()).filter(|ball| *ball != noted).find(|ball| {
        let touch = Observation { measured: Measured::Touch { ball: *ball, reading }, ..*o };
        let (r, rows) = weighted(forward, &touch, noise, ws);
        length(&r[..rows]) <= GROSS
    })
}

/// The sets of parameters that the robot allows, the richest last.
fn sets_of(robot: &Robot) -> Vec<ParameterSet> {
    let mut sets = vec![ParameterSet::Nominal, ParameterSet::Geometry];
    if robot.require_masses().is_ok() {
        sets.push(ParameterSet::Complete);
    }
    sets
}

/// A robust fit of the richest of `sets` that the data allows; those that it does not are dropped. Few data may still do for
/// a smaller model, and what the caller then asks of them is the caller's affair.
fn richest(robot: &Robot, cell: &Cell, data: &Dataset, sets: &mut Vec<ParameterSet>) -> Result<(Forward, Noise)> {
    loop {
        let set = sets.last().copied().unwrap_or(ParameterSet::Nominal);
        match robust_fit(robot, cell, data, set) {
            Err(IdentError::NotEnough(_)) if sets.len() > 1 => {
                sets.pop();
            }
            fitted => return fitted,
        }
    }
}

/// A robust fit of the richest model that the data and the robot allow, and the noise about it.
pub(crate) fn robust_fit_of_the_richest(robot: &Robot, cell: &Cell, data: &Dataset) -> Result<(Forward, Noise)> {
    richest(robot, cell, data, &mut sets_of(robot))
}

fn robust_fit(robot: &Robot, cell: &Cell, data: &Dataset, set: ParameterSet) -> Result<(Forward, Noise)> {
    // a tool that was mounted, or balls that were put down, otherwise in another session are no gross errors
    let own = OwnSetup::all(data.names.len());
    let (model, _) = prepared(robot, cell, data, &Choice::from(set).with_own(own))?;
    let known = crate::fit::ball_places::usual(&model, data);
    let scalars = data.scalars();
    let unknown = model.terms.len() - known.iter().filter(|k| k.prior.is_some()).count();
    if set != ParameterSet::Nominal && scalars < FOR_EACH * unknown {
        return Err(IdentError::NotEnough(format!("{scalars} numbers for {unknown} parameters")));
    }
    let free: Vec<usize> = (0..model.terms.len()).collect();
    let mut solver = Solver::new(free.len());
    let mut forward = Forward::new(model, free)?;
    check_observations(&forward, data)?;
    let (mut noise, _) = manner(forward.model(), data);
    noise.update_robustly(data, &weighted_residuals(&forward, data, &noise));
    for _ in 0..6 {
        let params = LmParams { huber: 3.0, max_iterations: 30, cost_tolerance: 1e-6, ..LmParams::default() };
        solver.minimize(&mut forward, data, &noise, &known, &params)?;
        let before = noise.clone();
        noise.update_robustly(data, &weighted_residuals(&forward, data, &noise));
        if noise.is_near(&before, SETTLED) {
            break;
        }
    }
    Ok((forward, noise))
}

#[cfg(test)]
mod tests {
    use super::gross_error;

    #[test]
    fn what_is_worse_is_told_the_position_or_the_orientation() {
        let weighted = [1.0, 0.0, 0.0, 0.0, 100.0, 0.0];
        let turned = gross_error(&[18e-6, 0.0, 0.0, 0.0, 0.01, 0.0], &weighted, None);
        assert_eq!(turned, "has an orientation that is 0.573 deg off, 100 times the usual error here: a gross error");
        let off = gross_error(&[3e-3, 4e-3, 0.0], &[30.0, 40.0, 0.0], Some(1));
        assert!(off.starts_with("is 5.000 mm off, 50 times") && off.contains("ball 2"), "{off}");
    }
}
