//! Shapes chosen from a coarse scan, at places between their neighbours in it.

use std::mem::discriminant;

use trical_ident::dataset::Dataset;
use trical_model::{Model, Shape, Term, Variable};

use crate::candidate::Candidate;
use crate::covariates::value;
use crate::effect_id::Cause;
use crate::locators::sorted;
use crate::settings::{
    CURVE_KNOTS, LOCAL_CENTRES, LOCAL_CENTRES_BETWEEN, LOCAL_REACHES, SAME_POINT_SHARE, SAME_SCALE_RATIO,
    STEPS_ALONG_CURVE, STEPS_BETWEEN_NEIGHBOURS,
};

/// Finer candidates around those that were `chosen` of `all`.
pub(crate) fn finer(chosen: &[&Candidate], all: &[Candidate], data: &Dataset) -> Vec<Candidate> {
    chosen.iter().flat_map(|c| finer_steps(c, all, data).into_iter().chain(finer_scales(c, all))).collect()
}

/// A step at every place where the data can tell it from its neighbours; for a free curve, which may stand for a step that the
/// coarse scan missed, steps all along its variable (a fine curve has too many waves for that).
fn finer_steps(c: &Candidate, all: &[Candidate], data: &Dataset) -> Vec<Candidate> {
    let (variable, at) = match (c.step(), c.curve()) {
        (Some((variable, at)), _) => (variable, Some(at)),
        (None, Some(variable)) if c.terms.len() < CURVE_KNOTS => (variable, None),
        _ => return Vec::new(),
    };
    let is_step = |o: &&Candidate| o.is_alike(c) && o.step().is_some_and(|(of, _)| of == variable);
    let Some(step) = all.iter().find(is_step) else { return Vec::new() };
    let scan: Vec<f64> = all.iter().filter(is_step).filter_map(|o| Some(o.step()?.1)).collect();
    let [below, above] = at.map_or([f64::NEG_INFINITY, f64::INFINITY], |at| neighbours(at, &scan));
    let here = data.observations.iter().filter(|o| c.session().is_none() || o.state.session == c.session());
    let values = sorted(&here.map(|o| value(variable, &o.state)).collect::<Vec<f64>>());
    let between: Vec<f64> =
        values.windows(2).map(|w| 0.5 * (w[0] + w[1])).filter(|v| *v > below && *v < above).collect();
    let every = between.len().div_ceil(if at.is_some() { STEPS_BETWEEN_NEIGHBOURS } else { STEPS_ALONG_CURVE }).max(1);
    between.iter().step_by(every).map(|at| step.with_shape(Shape::Step { at: *at })).collect()
}

/// What a curve with many waves of a joint's own angle may stand for, finer than the scan has it: something near the angle at which the fitted
/// curve is farthest off, and a step where it is steepest.
pub(crate) fn parts_of_curve(curve: &Candidate, model: &Model, all: &[Candidate], data: &Dataset) -> Vec<Candidate> {
    let Some(variable) = curve.site.joint().map(|joint| Variable::Joint { joint }) else { return Vec::new() };
    let angles: Vec<f64> = data.observations.iter().map(|o| value(variable, &o.state)).collect();
    let values = sorted(&angles);
    let (Some(low), Some(high)) = (values.first(), values.last()) else { return Vec::new() };
    let waves: Vec<&Term> = model.terms.iter().filter(|m| curve.terms.iter().any(|t| t.does_as(m))).collect();
    let off: Vec<f64> =
        values.iter().map(|q| waves.iter().map(|t| t.value * t.basis.shape.at(*q).0).sum::<f64>()).collect();
    let levels = sorted(&off);
    let usual = levels[levels.len() / 2];
    let largest = |sizes: &mut dyn Iterator<Item = f64>| sizes.enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
    let farthest = largest(&mut off.iter().map(|v| (v - usual).abs())).map_or(*low, |(k, _)| values[k]);
    let steepest = largest(&mut off.windows(2).map(|w| (w[1] - w[0]).abs())).map_or(0, |(k, _)| k);
    let half = STEPS_BETWEEN_NEIGHBOURS / 2;
    let between = values.windows(2).skip(steepest.saturating_sub(half)).take(2 * half);
    let steps = between.map(|w| Shape::Step { at: 0.5 * (w[0] + w[1]) });
    let spacing = (high - low) / (LOCAL_CENTRES * LOCAL_CENTRES_BETWEEN) as f64;
    let local = |k: i32, reach: f64| {
        let centre = farthest + f64::from(k) * spacing;
        Shape::Tent { left: centre - reach, centre, right: centre + reach }
    };
    let around = LOCAL_CENTRES_BETWEEN as i32;
    let reaches = LOCAL_REACHES.map(|part| part * (high - low));
    let reaches = reaches.into_iter().flat_map(|reach| [reach, reach / std::f64::consts::SQRT_2]);
    let locals = reaches.flat_map(|reach| (-around..=around).map(move |k| local(k, reach)));
    let scanned = |shape: &Shape| {
        let is_like = |t: &Term| t.basis.of == variable && discriminant(&t.basis.shape) == discriminant(shape);
        all.iter().find(|o| {
            o.cause == Cause::Unexplained && o.site == curve.site && matches!(&o.terms[..], [t] if is_like(t))
        })
    };
    steps.chain(locals).filter_map(|shape| Some(scanned(&shape)?.with_shape(shape))).collect()
}

/// A softness, a kink or a time constant, or a point of an axis, halfway to its neighbours on either side, unless they are near.
fn finer_scales(c: &Candidate, all: &[Candidate]) -> Vec<Candidate> {
    let alike = || all.iter().filter(|o| o.is_alike(c));
    if let Some(scale) = c.scale() {
        let scan: Vec<f64> = alike().filter(|o| same_curve(c, o)).filter_map(|o| Some(libm::log(o.scale()?))).collect();
        let finer: Vec<f64> = halfway(libm::log(scale), &scan, libm::log(SAME_SCALE_RATIO)).map(libm::exp).collect();
        return of_rivals(c, all, &[&finer[..], &[scale]].concat())
            .into_iter()
            .chain(finer.iter().map(|s| c.with_scale(*s)))
            .collect();
    }
    let Some(share) = c.share() else { return Vec::new() };
    let scan: Vec<f64> = alike().filter_map(Candidate::share).chain([0.0, 1.0]).collect();
    halfway(share, &scan, SAME_POINT_SHARE).map(|share| c.with_share(share)).collect()
}

/// Whether two candidates at one site differ by their scale alone, whatever they are called.
fn same_curve(a: &Candidate, b: &Candidate) -> bool {
    let kind = |c: &Candidate| {
        let of = |t: &Term| (t.site, t.basis.of, t.basis.sense, discriminant(&t.basis.shape));
        c.terms.iter().map(of).collect::<Vec<_>>()
    };
    a.scale().is_some() && a.site == b.site && kind(a) == kind(b)
}

/// Other effects with the curve of `c`, at those of the `scales` that are within their own: what is refined for one must be refined for
/// the other, or it would win by that alone.
fn of_rivals(c: &Candidate, all: &[Candidate], scales: &[f64]) -> Vec<Candidate> {
    let mut rivals: Vec<Vec<&Candidate>> = Vec::new();
    for o in all.iter().filter(|o| o.cause != c.cause && same_curve(c, o)) {
        match rivals.iter_mut().find(|r| r[0].cause == o.cause) {
            Some(rival) => rival.push(o),
            None => rivals.push(vec![o]),
        }
    }
    let apart = |o: &Candidate, s: f64| libm::log(o.scale().unwrap_or(f64::INFINITY) / s).abs();
    let mut out = Vec::new();
    for rival in rivals {
        let own = || rival.iter().filter_map(|o| o.scale());
        let (least, most) = (own().fold(f64::INFINITY, f64::min), own().fold(0.0, f64::max));
        for s in scales.iter().copied().filter(|s| (least..=most).contains(s)) {
            // the nearest knows best how likely such a scale is
            let nearest = rival.iter().min_by(|a, b| apart(a, s).total_cmp(&apart(b, s)));
            out.extend(nearest.map(|o| o.with_scale(s)));
        }
    }
    out
}

/// Points of a scan next below and next above; infinite where there is none.
fn neighbours(at: f64, scan: &[f64]) -> [f64; 2] {
    let below = scan.iter().copied().filter(|s| *s < at).fold(f64::NEG_INFINITY, f64::max);
    let above = scan.iter().copied().filter(|s| *s > at).fold(f64::INFINITY, f64::min);
    [below, above]
}

/// Halfway from a point of a scan to its neighbours, but for those that are nearer than `near`.
fn halfway(at: f64, scan: &[f64], near: f64) -> impl Iterator<Item = f64> {
    let apart = move |neighbour: &f64| neighbour.is_finite() && (neighbour - at).abs() > 2.0 * near;
    neighbours(at, scan).into_iter().filter(apart).map(move |neighbour| 0.5 * (at + neighbour))
}

#[cfg(test)]
mod tests {
    use super::halfway;

    #[test]
    fn a_scan_is_halved_on_both_sides_until_its_points_are_near() {
        let finer = |at, scan: &[f64]| halfway(at, scan, 0.05).collect::<Vec<f64>>();
        assert_eq!(finer(0.5, &[0.0, 0.25, 0.5, 0.75, 1.0]), [0.375, 0.625]);
        assert_eq!(finer(0.25, &[0.25, 0.5]), [0.375], "no neighbour, nothing between");
        assert_eq!(finer(0.5, &[0.42, 0.5, 0.58]), [0.0; 0], "near enough");
    }
}
