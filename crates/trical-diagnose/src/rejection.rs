//! Rows to reject: repeated readings, and measurements far from what any model of the arm says.

use std::collections::{BTreeMap, BTreeSet};

use trical_ident::dataset::{Dataset, Observation};
use trical_ident::dense::{Cholesky, Mat};
use trical_ident::error::Result;
use trical_ident::fit::gross_errors::{right_ball, wrong_ball};
use trical_ident::fit::identify::Identified;
use trical_ident::fit::noise::Noise;
use trical_ident::fit::residuals::{length, position_errors, weighted_residuals};
use trical_model::{Forward, Measured, Model};

use crate::settings::{OUTLIER_SHARE, OUTLIER_SIGMAS, OUTLIERS, REPEATS_BY_CHANCE};

/// Leaves out readings that repeat the one before to the last digit although the arm moved: the gauge kept its old value.
#[must_use]
pub fn without_stale(data: &Dataset) -> Dataset {
    let mut out = data.clone();
    let rare = expected_repeats(data) < REPEATS_BY_CHANCE;
    for pair in data.observations.windows(2) {
        let (a, b) = (&pair[0], &pair[1]);
        if a.recording != b.recording || a.state.q == b.state.q {
            continue;
        }
        let same = match (&a.measured, &b.measured) {
            (Measured::Touch { reading: x, .. }, Measured::Touch { reading: y, .. }) => {
                // small readings repeat by chance: a gauge of 0.001 mm has few values near zero
                x == y && rare
            }
            (Measured::Point { position: x, target: s }, Measured::Point { position: y, target: t }) => {
                x == y && s == t
            }
            (Measured::Pose { position: x, .. }, Measured::Pose { position: y, .. }) => x == y,
            (Measured::Distance { length: x, .. }, Measured::Distance { length: y, .. }) => x == y,
            _ => false,
        };
        if same {
            let why = "repeats the reading before it to the last digit although the arm moved: a stale value";
            out.reject(b, why.into());
        }
    }
    out.without_rejected()
}

/// How many touches would repeat all three readings of the one before by chance: for each indicator the probability that two
/// readings agree, as often as any two of this data set do.
fn expected_repeats(data: &Dataset) -> f64 {
    let readings: Vec<[f64; 3]> = data
        .observations
        .iter()
        .filter_map(|o| match o.measured {
            Measured::Touch { reading, .. } => Some(reading),
            _ => None,
        })
        .collect();
    let n = readings.len() as f64;
    let agree = |axis: usize| {
        let mut counts: BTreeMap<u64, f64> = BTreeMap::new();
        for r in &readings {
            *counts.entry(r[axis].to_bits()).or_default() += 1.0;
        }
        counts.values().map(|c| c * (c - 1.0)).sum::<f64>() / (n * (n - 1.0)).max(1.0)
    };
    n * agree(0) * agree(1) * agree(2)
}

/// Rows that a fit has less than half as far off as the model `without` what it found, or within the scatter of what it was fitted to.
///
/// # Errors
/// None for a model that was fitted.
pub fn explained(fitted: &Identified, without: &Model, data: &Dataset) -> Result<BTreeSet<usize>> {
    let lengths = |model: &Model| -> Result<Vec<f64>> {
        let forward = Forward::new(model.clone(), Vec::new())?;
        Ok(weighted_residuals(&forward, data, &fitted.noise).iter().map(|(r, n)| length(&r[..*n])).collect())
    };
    let both = lengths(&fitted.model)?.into_iter().zip(lengths(without)?);
    let rows = data.observations.iter().zip(both);
    Ok(rows.filter(|(_, (now, before))| *now < OUTLIER_SIGMAS.max(0.5 * before)).map(|(o, _)| o.row).collect())
}

/// How far off a row is that the fit did not have, in standard deviations of the noise and of what the fit says of it together: what nothing
/// else was measured near is not foretold well, and is no outlier for that.
fn unforeseen(fitted: &Identified, o: &Observation, residual: &[f64], noise: &Noise) -> f64 {
    let Ok(covariance) = fitted.prediction_covariance(&o.state, &o.measured, o.frame) else { return length(residual) };
    let n = residual.len();
    let sigma = |i: usize| noise.sigma(o.recording, &o.measured, i);
    let of = |i: usize, j: usize| f64::from(u8::from(i == j)) + covariance[i][j] / (sigma(i) * sigma(j));
    let r = Mat::from_fn(n, 1, |i, _| residual[i]);
    let solved = Cholesky::of(&Mat::from_fn(n, n, of)).map(|l| l.solve(&r));
    solved.map_or(length(residual), |x| (0..n).map(|i| r[(i, 0)] * x[(i, 0)]).sum::<f64>().max(0.0).sqrt())
}

/// Leaves out what is far off the fitted model: at most a small share, the farthest first.
///
/// # Errors
/// None for a model that was fitted.
pub fn without_outliers(fitted: &Identified, all: &Dataset) -> Result<Dataset> {
    let forward = Forward::new(fitted.model.clone(), Vec::new())?;
    let mut noise = fitted.noise.clone();
    noise.update_robustly(all, &weighted_residuals(&forward, all, &noise));
    let residuals = weighted_residuals(&forward, all, &noise);
    let fitted_rows: BTreeSet<usize> = fitted.data.observations.iter().map(|o| o.row).collect();
    let is_far = |(k, (r, n)): (usize, &([f64; 6], usize))| {
        let (o, r) = (&all.observations[k], &r[..*n]);
        let far = length(r);
        let foreseen = || fitted_rows.contains(&o.row) || unforeseen(fitted, o, r, &noise) > OUTLIER_SIGMAS;
        (far > OUTLIER_SIGMAS && foreseen()).then_some((k, far))
    };
    let mut far: Vec<(usize, f64)> = residuals.iter().enumerate().filter_map(is_far).collect();
    far.sort_by(|a, b| b.1.total_cmp(&a.1));
    // of each session a small share: what was measured on another day need not go with the others yet
    let mut left: Vec<usize> = vec![0; all.names.len()];
    all.observations.iter().for_each(|o| left[o.recording] += 1);
    left.iter_mut().for_each(|rows| {
        let share = (*rows as f64 * OUTLIER_SHARE).ceil() as usize;
        *rows = share.max(OUTLIERS.min(*rows / OUTLIERS));
    });
    far.retain(|(k, _)| {
        let left = &mut left[all.observations[*k].recording];
        let goes = *left > 0;
        *left = left.saturating_sub(1);
        goes
    });
    let errors = position_errors(&forward, all);
    let mut ws = forward.workspace();
    let mut out = all.clone();
    for (k, length) in &far {
        let o = &all.observations[*k];
        let off = format!(
            "is {:.3} mm{} off, {length:.0} times the scatter of the others: an outlier",
            errors[*k] * 1e3,
            turned(&residuals[*k].0, o, &noise)
        );
        out.reject(o, wrong_ball(off, right_ball(&forward, &noise, o, &mut ws)));
    }
    Ok(out.without_rejected())
}

/// By how much a pose's orientation is off, in words: " and 0.120 deg".
fn turned(weighted: &[f64; 6], o: &Observation, noise: &Noise) -> String {
    let Measured::Pose { .. } = o.measured else { return String::new() };
    let squares = (3..6).map(|row| (weighted[row] * noise.sigma(o.recording, &o.measured, row)).powi(2));
    format!(" and {:.3} deg", squares.sum::<f64>().sqrt().to_degrees())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::test_data::{touches, with_joint_2};
    use trical_ident::fit::identify::fit_model_knowing;
    use trical_ident::fit::priors::PriorKnowledge;
    use trical_ident::{Choice, ParameterSet, identify};
    use trical_model::{Basis, Shape, Site, State, Term, Variable};

    fn of(readings: &[[f64; 3]]) -> Dataset {
        let at = |(k, r): (usize, &[f64; 3])| (State::at(&[0.01 * f64::from(u8::try_from(k).unwrap_or(0)), 0.2]), *r);
        touches(&[readings.iter().enumerate().map(at).collect()])
    }

    #[test]
    fn a_row_where_the_fit_knows_little_is_no_outlier() {
        let far = Basis::new(Variable::Joint { joint: 2 }, Shape::Growth { from: 0.5, to: 1.4 });
        let (truth, data) = with_joint_2(&[(far, 2e-3)]);
        let near = data.filtered(|o| o.state.q[1] < 0.6);
        let plain = identify(&truth.robot, &truth.cell, &near, Choice::from(ParameterSet::Compliance)).unwrap();
        let mut model = plain.model.clone();
        model.terms.push(Term::new("growth", "unexplained", Site::Joint { joint: 2 }, far));
        let mut known = vec![PriorKnowledge::NOTHING; plain.model.terms.len()];
        known.push(PriorKnowledge::about_zero(1e-2));
        let fitted = fit_model_knowing(model, &near, &plain.noise, &known, Vec::new()).unwrap();
        let kept = |fitted: &Identified| without_outliers(fitted, &data).unwrap().observations.len();
        assert!(near.observations.len() < 190 && kept(&plain) < 199, "{} {}", near.observations.len(), kept(&plain));
        assert_eq!(kept(&fitted), 200);
    }

    /// Of four readings two agree in x: one pair of six. All three at once agree by the product, at each of the four touches.
    #[test]
    fn repeats_by_chance_are_counted_from_the_readings_themselves() {
        let x_twice = of(&[[1e-4, 1e-4, 0.0], [1e-4, 2e-4, 0.0], [2e-4, 2e-4, 0.0], [3e-4, 3e-4, 0.0]]);
        assert!((expected_repeats(&x_twice) - 4.0 / 6.0 * 1.0 / 6.0).abs() < 1e-12);
        let all_differ = of(&[[1e-4; 3], [2e-4; 3], [3e-4; 3]]);
        assert_eq!(expected_repeats(&all_differ), 0.0);
    }

    #[test]
    fn of_each_session_few_rows_are_outliers_however_many_there_are_of_another() {
        let (truth, data) = with_joint_2(&[]);
        let fitted = identify(&truth.robot, &truth.cell, &data, ParameterSet::Compliance).unwrap();
        // twelve rows more, of another day, of which five are far off
        let mut two = data.clone();
        two.names.push("b".into());
        for (k, mut o) in data.observations.iter().take(12).cloned().enumerate() {
            if let Measured::Touch { reading, .. } = &mut o.measured {
                reading[0] += if k < 5 { 1e-3 } else { 0.0 };
            }
            (o.recording, o.row) = (1, 200 + k);
            two.observations.push(o);
        }
        let kept = without_outliers(&Identified { noise: Noise::usual(2), ..fitted }, &two).unwrap();
        assert_eq!(kept.rejected.len(), 3, "a quarter: {:?}", kept.rejected);
    }

    #[test]
    fn a_reading_is_stale_where_it_repeats_although_the_arm_moved() {
        let spread = |k: u8| [1e-6 * f64::from(k), 3e-6 * f64::from(k), 7e-6 * f64::from(k)];
        let mut readings: Vec<[f64; 3]> = (0..40).map(spread).collect();
        readings[17] = readings[16];
        let kept = without_stale(&of(&readings));
        assert_eq!(kept.rejected.iter().map(|r| r.line).collect::<Vec<_>>(), [19], "line 2 has the first reading");
        assert!(
            kept.observations.iter().map(|o| o.line).eq((2..42).filter(|l| *l != 19)),
            "the first of the two stays"
        );
        // a gauge of few values repeats by chance
        let coarse: Vec<[f64; 3]> = (0..40).map(|k: u8| [1e-6 * f64::from(k / 2), 0.0, 0.0]).collect();
        assert!(without_stale(&of(&coarse)).rejected.is_empty());
    }
}
