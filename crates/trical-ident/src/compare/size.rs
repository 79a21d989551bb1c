//! By how much something changed, and how large a change has to be to be found.

use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};
use trical_model::{Model, Scope};

use super::explanation::{Explained, Explanation};
use super::result::{Change, Changed, Visible, point_and_axis};
use super::settings::{FALSE_ALARMS, FOUND, LARGEST_DEG, LARGEST_MM, SHARE};
use super::whitened::{Whitened, extend};
use crate::dense::{Cholesky, Mat, dot, singular_values};
use crate::units::unit;

/// Most that is called visible, in mm or deg.
fn largest(unit: &str) -> f64 {
    if unit == "mm" { LARGEST_MM } else { LARGEST_DEG }
}

/// By how much each of the explanations `chosen` changed, fitted together.
pub(super) fn sizes(whitened: &Whitened<'_>, chosen: &[usize]) -> Vec<Vec<Changed>> {
    let columns: Vec<&Vec<f64>> = chosen.iter().flat_map(|k| &whitened.columns[*k]).collect();
    let p = columns.len();
    let lengths: Vec<f64> = columns.iter().map(|c| dot(c, c).sqrt().max(1e-100)).collect();
    // a hair of damping where two explanations are one
    let normal = Mat::from_fn(p, p, |i, j| {
        dot(columns[i], columns[j]) / (lengths[i] * lengths[j]) + if i == j { 1e-9 } else { 0.0 }
    });
    let right = Mat::from_fn(p, 1 + p, |i, j| match j {
        0 => -dot(columns[i], &whitened.residual) / lengths[i],
        _ => f64::from(u8::from(i + 1 == j)),
    });
    let Some(solved) = Cholesky::of(&normal).map(|l| l.solve(&right)) else {
        return vec![Vec::new(); chosen.len()];
    };
    let model = &whitened.explained.model;
    let mut next = 0;
    let of = |k: &usize| {
        let first = next;
        next += whitened.columns[*k].len();
        let terms = whitened.explained.explanations[*k].terms.clone();
        let number = |(at, t): (usize, usize)| {
            let t = &model.terms[t];
            let u = unit(&model.robot, t);
            let sd = (solved[(at, at + 1)] * whitened.more_noise).max(0.0).sqrt() / lengths[at] * u.per_si.abs();
            Changed { name: t.name.clone(), value: solved[(at, 0)] / lengths[at] * u.per_si, sd, unit: u.name }
        };
        (first..).zip(terms).map(number).collect()
    };
    chosen.iter().map(of).collect()
}

/// Each explanation's own numbers, fitted beside the changes that were found, where the measurements determine them.
pub(super) fn each(whitened: &Whitened<'_>, changes: &[Change]) -> Vec<Changed> {
    let explanations = &whitened.explained.explanations;
    let found = |k: &usize| changes.iter().any(|c| c.what == explanations[*k].what);
    let taken: Vec<usize> = (0..explanations.len()).filter(found).collect();
    // the base with its direction has the numbers of the base, too
    let asked = |k: &usize| explanations[*k].is_of_machine() && (found(k) || explanations[*k].what != "base");
    let own = |k: usize| {
        let beside: Vec<usize> = taken.iter().copied().filter(|t| *t != k).chain([k]).collect();
        sizes(whitened, &beside).pop().unwrap_or_default()
    };
    let all = (0..explanations.len()).filter(asked).flat_map(own);
    // what the session's own frame takes up has no size
    all.filter(|c| c.sd < largest(&c.unit)).collect()
}

/// The model with the changes of tool and base that were found.
pub(super) fn set_up_anew(explained: &Explained, changes: &[Change]) -> Model {
    let mut model = explained.model.clone();
    for change in changes.iter().filter(|c| c.scope == Scope::Setup) {
        let own = explained.explanations.iter().find(|e| e.what == change.what).map(|e| e.terms.clone());
        for (k, by) in own.into_iter().flatten().zip(&change.by) {
            model.terms[k].value = by.value / unit(&model.robot, &model.terms[k]).per_si;
        }
    }
    model
}

/// The smallest change of each explanation that would be found.
pub(super) fn visible(whitened: &Whitened<'_>) -> Vec<Visible> {
    let explanations = &whitened.explained.explanations;
    let model = &whitened.explained.model;
    let limit = FALSE_ALARMS / explanations.len() as f64;
    let share = SHARE * (whitened.rows as f64).sqrt();
    let of_machine = explanations.iter().zip(&whitened.columns).filter(|(e, _)| e.is_of_machine());
    let sizes = |(e, columns): (&Explanation, &Vec<Vec<f64>>)| {
        let rank = extend(&mut Vec::new(), columns);
        let needed = visible_length(limit, rank.max(1), share) * whitened.more_noise.sqrt();
        // a joint that slides has a length, one that turns an angle
        ["mm", "deg"].map(|of| {
            let mut per_si = None;
            let mut axes: Vec<(&str, Vec<f64>)> = Vec::new();
            for (t, c) in model.terms[e.terms.clone()].iter().zip(columns) {
                let u = unit(&model.robot, t);
                if u.name != of {
                    continue;
                }
                per_si = Some(u.per_si.abs());
                // all targets together along one axis: the tool is rigid
                let axis = point_and_axis(&t.name).1;
                match axes.iter_mut().find(|a| a.0 == axis) {
                    Some((_, sum)) => sum.iter_mut().zip(c).for_each(|(s, c)| *s += c),
                    None => axes.push((axis, c.clone())),
                }
            }
            let smallest = needed / shortest(&axes) * per_si?;
            Some(Visible {
                what: e.what.clone(),
                smallest: (smallest < largest(of)).then_some(smallest),
                unit: of.into(),
            })
        })
    };
    of_machine.flat_map(sizes).flatten().collect()
}

/// Length of the combination of columns with unit coefficients that is shortest: their smallest singular value.
fn shortest(columns: &[(&str, Vec<f64>)]) -> f64 {
    let rows = columns.first().map_or(0, |c| c.1.len());
    let all = Mat::from_fn(rows, columns.len(), |i, j| columns[j].1[i]);
    singular_values(&all).last().copied().unwrap_or(f64::INFINITY)
}

/// Length (in standard deviations) of a change that passes `limit`, and is at least `share`, with the chance [`FOUND`].
fn visible_length(limit: f64, rank: usize, share: f64) -> f64 {
    let threshold = ChiSquared::new(rank as f64).map_or(f64::INFINITY, |d| d.inverse_cdf(1.0 - limit)).sqrt();
    // the length of a vector whose mean is that long in one direction is about normal above it
    let above = Normal::standard().inverse_cdf(FOUND);
    threshold.max(share) + above
}
