//! Locators: what finds a mismatch without knowing its name. A stump (a joint is off where some variable is below a threshold),
//! growth (it is off more and more beyond one, in proportion or with the square) and a free curve (a linear spline of some
//! variable at a joint). They compete with the catalogue, at a price: a name is preferred until it is beaten by [`UNNAMED_PRICE_NATS`] nats.

use trical_ident::dataset::Dataset;
use trical_model::{Basis, Beside, Model, Place, Shape, Site, Term, Variable};

use crate::candidate::{Candidate, Physical};
use crate::covariates::{is_order, name, order_of, value};
use crate::effect_id::{Cause, UNEXPLAINED};
use crate::settings::{
    CURVE_KNOTS, FINE_CURVE_KNOTS, GROWTH_QUANTILES, LOCAL_CENTRES, LOCAL_REACHES, LOCAL_VALUES, STEP_THRESHOLDS,
    UNNAMED_PRICE_NATS, UNNAMED_REST, UNNAMED_SIZE_RAD, VALUES_PER_KNOT,
};

/// Different values in their order.
pub(crate) fn sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    sorted
}

/// `count` quantiles of what a variable was, from its least to its largest value; `None` where it hardly changed.
#[must_use]
pub fn knots(values: &[f64], count: usize) -> Option<Vec<f64>> {
    let sorted = sorted(values);
    let last = sorted.len().checked_sub(1)?;
    (sorted.len() >= 20).then(|| (0..count).map(|k| sorted[(k * last) / (count - 1)]).collect())
}

/// A free curve at a site: a linear spline of a variable, times the sense of a joint's motion if that is given. Downdated it the
/// first tent is left out, which would repeat the site's own constant.
#[must_use]
pub fn tents(site: Site, variable: Variable, sense: Option<usize>, knots: &[f64]) -> Vec<Term> {
    let first = usize::from(sense.is_none());
    (first..knots.len())
        .map(|k| {
            // beyond the ends, where nothing was visited, the curve returns to zero, which is its prior
            let reach = |a: usize, b: usize| (knots[a] - knots[b]).max(f64::MIN_POSITIVE);
            let last = knots.len() - 1;
            let left = if k == 0 { knots[0] - reach(1, 0) } else { knots[k - 1] };
            let right = if k < last { knots[k + 1] } else { knots[last] + reach(last, last - 1) };
            let shape = Shape::Tent { left, centre: knots[k], right };
            let basis = Basis { sense, ..Basis::new(variable, shape) };
            let of = sense.map_or_else(|| name(variable), |j| format!("dir{j}_{}", name(variable)));
            let place = match site {
                Site::Joint { joint } => format!("{joint}"),
                _ => "place".into(),
            };
            Term::new(format!("curve_{place}_by_{of}_{k}"), UNEXPLAINED, site, basis)
        })
        .collect()
}

/// Growth from a threshold to the least or the largest value, in proportion and with the square: zero before the threshold, one
/// at the end.
fn growths(sorted: &[f64]) -> Vec<Shape> {
    let (Some(low), Some(high)) = (sorted.first().copied(), sorted.last().copied()) else { return Vec::new() };
    // beyond what was visited it returns to zero as it came
    let up = |at| Shape::Tent { left: at, centre: high, right: 2.0 * high - at };
    let down = |at| Shape::Tent { left: 2.0 * low - at, centre: low, right: at };
    (1..GROWTH_QUANTILES)
        .map(|k| sorted[(k * (sorted.len() - 1)) / GROWTH_QUANTILES])
        .filter(|at| *at > low && *at < high)
        .flat_map(|at| [up(at), down(at), Shape::Growth { from: at, to: high }, Shape::Growth { from: at, to: low }])
        .collect()
}

/// Something that happens near one value only, as at a damaged tooth.
fn locals(sorted: &[f64]) -> Vec<Shape> {
    let (Some(low), Some(high)) = (sorted.first().copied(), sorted.last().copied()) else { return Vec::new() };
    let within = |left: f64, right: f64| sorted.iter().filter(|v| **v > left && **v < right).count();
    let centres = (1..LOCAL_CENTRES).map(|k| sorted[(k * (sorted.len() - 1)) / LOCAL_CENTRES]);
    centres
        .flat_map(|centre| {
            LOCAL_REACHES.map(|part| (centre - part * (high - low), centre, centre + part * (high - low)))
        })
        .filter(|(left, _, right)| within(*left, *right) >= LOCAL_VALUES)
        .map(|(left, centre, right)| Shape::Tent { left, centre, right })
        .collect()
}

/// What two joints' angles tell together: products of a wave of the first with a wave of the second. A cable that pulls a joint does so by the
/// angles of two. The waves of one joint by themselves are effects (an eccentric gear), which must not hide in what has no name.
fn together(site: Site, joint: usize, other: usize) -> Vec<Term> {
    let waves = [("sine", Shape::Sine { cycles: 1.0 }), ("cosine", Shape::Cosine { cycles: 1.0 })];
    let mut terms = Vec::new();
    for (name, shape) in waves {
        for (beside, other_shape) in waves {
            let beside_shape = Beside { joint: other, shape: other_shape };
            let basis = Basis { beside: Some(beside_shape), ..Basis::new(Variable::Joint { joint }, shape) };
            terms.push(Term::new(format!("{name}_{joint}_{beside}_{other}"), UNEXPLAINED, site, basis));
        }
    }
    terms
}

/// Something at a joint that `what` tells.
fn candidate(joint: usize, terms: Vec<Term>, what: &str) -> Candidate {
    Candidate {
        cause: Cause::Unexplained,
        site: Place::Joint(joint),
        behaviour: format!("joint {joint} is off in a way that {what} tells"),
        signs: vec![0; terms.len()],
        physical: Physical::default(),
        scales: vec![UNNAMED_SIZE_RAD; terms.len()],
        terms,
        typical: 0.0,
        log_prior: 0.0,
    }
}

/// All locators for this data.
#[must_use]
pub fn locators(model: &Model, data: &Dataset) -> Vec<Candidate> {
    let n = model.robot.dof();
    let mut variables: Vec<(Variable, Option<u32>)> = (1..=n).map(|joint| (Variable::Joint { joint }, None)).collect();
    if let Some(order) = order_of(data) {
        let mut sessions: Vec<Option<u32>> = data.observations.iter().map(|o| o.state.session).collect();
        sessions.sort_unstable();
        sessions.dedup();
        variables.extend(sessions.into_iter().map(|session| (order, session)));
    }
    let has_direction = data.observations.iter().all(|o| o.state.dir.is_some());
    let mut out = Vec::new();
    for joint in 1..=n {
        let at = Site::Joint { joint };
        for (variable, session) in &variables {
            let candidate = |mut terms: Vec<Term>, what: &str| {
                terms.iter_mut().for_each(|t| t.basis.session = *session);
                candidate(joint, terms, what)
            };
            let here = data.observations.iter().filter(|o| session.is_none() || o.state.session == *session);
            let values: Vec<f64> = here.map(|o| value(*variable, &o.state)).collect();
            let Some(curve) = knots(&values, CURVE_KNOTS) else { continue };
            let of = name(*variable);
            let sorted = sorted(&values);
            if !is_order(*variable) {
                for k in 1..STEP_THRESHOLDS {
                    // nobody was between two values: the step is as likely there as anywhere else between them
                    let above = ((k * (sorted.len() - 1)) / STEP_THRESHOLDS).max(1);
                    let between = 0.5 * (sorted[above - 1] + sorted[above]);
                    let basis = Basis::new(*variable, Shape::Step { at: between });
                    out.push(candidate(vec![Term::new(format!("step_{joint}_by_{of}"), UNEXPLAINED, at, basis)], &of));
                }
                for shape in growths(&sorted) {
                    let basis = Basis::new(*variable, shape);
                    out.push(candidate(
                        vec![Term::new(format!("growth_{joint}_by_{of}"), UNEXPLAINED, at, basis)],
                        &of,
                    ));
                }
            }
            out.push(candidate(tents(at, *variable, None, &curve), &of));
            if *variable == (Variable::Joint { joint }) {
                for shape in locals(&sorted) {
                    let term = Term::new(format!("local_{joint}"), UNEXPLAINED, at, Basis::new(*variable, shape));
                    out.push(candidate(vec![term], &of));
                }
                let distinct = sorted.len();
                let enough = |k: &usize| *k == FINE_CURVE_KNOTS[0] || distinct >= k * VALUES_PER_KNOT;
                let fine = FINE_CURVE_KNOTS.into_iter().filter(enough).filter_map(|k| knots(&values, k));
                out.extend(fine.map(|fine| candidate(tents(at, *variable, None, &fine), &of)));
            }
            if has_direction && (is_order(*variable) || *variable == (Variable::Joint { joint })) {
                let what = format!("its sense of motion, differently with {of},");
                out.push(candidate(tents(at, *variable, Some(joint), &curve), &what));
            }
        }
    }
    for joint in 1..=n {
        let at = Site::Joint { joint };
        for other in (1..=n).filter(|k| *k != joint) {
            let terms = together(at, joint, other);
            out.push(candidate(joint, terms, &format!("q{other}, with its own angle,")));
        }
    }
    // a curve may also be the small rest beside a name: a large one would do what the name does, at no further price
    let small = |c: &Candidate| Candidate { scales: c.scales.iter().map(|s| s * UNNAMED_REST).collect(), ..c.clone() };
    let rests: Vec<Candidate> = out.iter().filter(|c| c.terms.len() > 1).map(small).collect();
    out.extend(rests);
    let price = libm::log(out.len() as f64) + UNNAMED_PRICE_NATS;
    for c in &mut out {
        c.log_prior = -price;
    }
    out
}

/// A mismatch without a name, as it is reported.
#[derive(Clone, Debug, Default)]
pub struct Located {
    /// On what it depends.
    pub variable: String,
    /// For which values.
    pub region: String,
    /// The fitted curve.
    pub curve: Vec<(f64, f64)>,
    /// Units of the curve's columns.
    pub units: (String, String),
}

/// Variable, region, and the fitted curve with its units.
#[must_use]
pub fn describe<'a>(
    first: &Candidate,
    members: impl Iterator<Item = &'a Candidate>,
    model: &Model,
    data: &Dataset,
) -> Located {
    let Some(basis) = first.terms.first().map(|t| t.basis) else {
        return Located::default();
    };
    if let (Variable::Joint { joint }, Some(beside)) = (basis.of, first.terms.iter().find_map(|t| t.basis.beside)) {
        return of_two(joint, beside.joint, first, model, data);
    }
    let variable = basis.of;
    let (factor, units) = match variable {
        Variable::Joint { joint } => model.robot.kind(joint).unit(),
        Variable::Seq => (1.0, "pose"),
        _ => (1.0, "s"),
    };
    let (off, off_units) = model.robot.kind(joint_of(first.site)).unit();
    // "-32.0 deg"; a number of a pose needs no unit
    let counted = variable == Variable::Seq;
    let bare =
        |v: f64| if counted { format!("{:.0}", v.ceil()) } else { format!("{:.1}", (v * 10.0).round() / 10.0 + 0.0) };
    let shown = |v: f64| if counted { bare(v) } else { format!("{} {units}", bare(v)) };
    let here = data.observations.iter().filter(|o| !basis.is_elsewhere(&o.state));
    let values: Vec<f64> = here.map(|o| value(variable, &o.state)).collect();
    let (low, high) =
        (values.iter().copied().fold(f64::MAX, f64::min), values.iter().copied().fold(f64::MIN, f64::max));
    let terms: Vec<&Term> = members
        .flat_map(|c| &c.terms)
        .filter_map(|t| model.terms.iter().find(|m| m.does_as(t)))
        .filter(|t| t.basis.of == variable && t.basis.sense == basis.sense)
        .collect();
    let at = |u: f64| terms.iter().map(|t| t.value * t.basis.shape.at(u).0).sum::<f64>();
    let curve: Vec<(f64, f64)> = (0..=40)
        .map(|k| {
            let u = low + (high - low) * f64::from(k) / 40.0;
            (u * factor, at(u) * off)
        })
        .collect();
    let n = name(variable);
    let region = match first.terms.as_slice() {
        // what others add to one that goes on to the end of the range may be anywhere
        [one] if terms.len() <= 1 || !goes_on(one.basis.shape, [low, high]) => match one.basis.shape {
            Shape::Step { at } => {
                let below = values.iter().filter(|v| **v < at).count();
                let sign = if 2 * below <= values.len() { "<" } else { ">" };
                format!("{n} {sign} {}", shown(at * factor))
            }
            Shape::Tent { left, right, .. } if right > high => {
                format!("{n} > {}, growing", shown(left * factor))
            }
            Shape::Tent { left, right, .. } if left < low => {
                format!("{n} < {}, growing", shown(right * factor))
            }
            Shape::Tent { left, right, .. } => {
                format!("{n} from {} to {}", bare(left * factor), shown(right * factor))
            }
            Shape::Growth { from, to } => {
                let side = if to > from { ">" } else { "<" };
                format!("{n} {side} {}, growing with the square", shown(from * factor))
            }
            _ => format!("{n} from {} to {}", bare(low * factor), shown(high * factor)),
        },
        _ => {
            // where the curve is farthest from its middle value
            let mut sorted: Vec<f64> = curve.iter().map(|c| c.1).collect();
            sorted.sort_by(f64::total_cmp);
            let middle = sorted[sorted.len() / 2];
            let largest = curve.iter().map(|c| (c.1 - middle).abs()).fold(0.0, f64::max);
            let off: Vec<f64> = curve.iter().filter(|c| (c.1 - middle).abs() > 0.5 * largest).map(|c| c.0).collect();
            match (off.first(), off.last()) {
                (Some(a), Some(b)) => format!("{n} from {} to {}", bare(*a), shown(*b)),
                _ => format!("all of {n}"),
            }
        }
    };
    let variable = basis.sense.map_or(n, |joint| format!("dir{joint}"));
    Located { variable, region, curve, units: (units.to_owned(), off_units.to_owned()) }
}

/// Whether a shape is there from a value on to the end of a range.
fn goes_on(shape: Shape, [low, high]: [f64; 2]) -> bool {
    match shape {
        Shape::Step { .. } | Shape::Growth { .. } => true,
        Shape::Tent { left, right, .. } => right > high || left < low,
        _ => false,
    }
}

/// The joint of a place, from 1; 0 for another place.
fn joint_of(place: Place) -> usize {
    if let Place::Joint(joint) = place { joint } else { 0 }
}

/// What two angles tell together: the curve over the other one, with the joint itself in the middle of where it was.
fn of_two(joint: usize, other: usize, c: &Candidate, model: &Model, data: &Dataset) -> Located {
    let angles = |joint: usize| sorted(&data.observations.iter().map(|o| o.state.q[joint - 1]).collect::<Vec<f64>>());
    let (own, others) = (angles(joint), angles(other));
    let (Some(middle), Some(low), Some(high)) = (own.get(own.len() / 2), others.first(), others.last()) else {
        return Located::default();
    };
    let fitted: Vec<&Term> = c.terms.iter().filter_map(|t| model.terms.iter().find(|m| m.does_as(t))).collect();
    let at = |u: f64| {
        let term = |t: &&Term| t.value * t.basis.shape.at(*middle).0 * t.basis.beside.map_or(1.0, |b| b.shape.at(u).0);
        fitted.iter().map(term).sum::<f64>()
    };
    let (factor, unit) = model.robot.kind(other).unit();
    let (off, off_unit) = model.robot.kind(joint).unit();
    let curve = (0..=40).map(|k| low + (high - low) * f64::from(k) / 40.0).map(|u| (u * factor, at(u) * off));
    Located {
        variable: name(Variable::Joint { joint: other }),
        region: format!("all of q{other}, with q{joint}"),
        curve: curve.collect(),
        units: (unit.to_owned(), off_unit.to_owned()),
    }
}

#[cfg(test)]
mod tests;
