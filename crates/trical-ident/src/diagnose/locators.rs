//! Locators: what finds a mismatch without knowing its name. A stump (a joint is off where some variable is below a threshold)
//! and a free curve (a linear spline of some variable at a joint). They compete with the catalogue, at a price: a name is
//! preferred until it is beaten by [`PRICE`] nats.

use trical_model::{Basis, Model, Shape, Site, Term, Variable};

use super::catalogue::Candidate;
use crate::dataset::Dataset;

/// The "effect" of what has no name.
pub const UNEXPLAINED: &str = "unexplained";

/// A locator must beat every name by this many nats.
const PRICE: f64 = 5.0;

/// How far a joint may be off without a name, deg: the prior of each knot of a curve.
const LARGE_DEG: f64 = 0.02;

/// Thresholds tried for each variable.
const THRESHOLDS: usize = 30;

/// Knots of a free curve.
const KNOTS: usize = 8;

/// All locators for this data.
#[must_use]
pub fn locators(model: &Model, data: &Dataset) -> Vec<Candidate> {
    let n = model.robot.dof();
    let mut variables: Vec<(Variable, Vec<f64>)> = (1..=n)
        .map(|joint| {
            (Variable::Joint { joint }, data.observations.iter().map(|o| o.state.q[joint - 1]).collect::<Vec<f64>>())
        })
        .collect();
    if data.observations.iter().all(|o| o.state.t.is_some()) {
        variables.push((Variable::Time, data.observations.iter().filter_map(|o| o.state.t).collect()));
    }
    let mut out = Vec::new();
    for joint in 1..=n {
        for (variable, values) in &variables {
            let mut sorted = values.clone();
            sorted.sort_by(f64::total_cmp);
            sorted.dedup();
            if sorted.len() < 20 {
                continue;
            }
            let quantile = |k: usize, of: usize| sorted[(k * (sorted.len() - 1)) / of];
            let site = serde_json::json!({ "joint": joint });
            let candidate = |terms: Vec<Term>| Candidate {
                effect: UNEXPLAINED,
                site: site.clone(),
                located: format!("joint {joint} is off in a way that {} tells", name(*variable)),
                signs: vec![0; terms.len()],
                scales: vec![LARGE_DEG.to_radians(); terms.len()],
                terms,
                typical: 0.0,
                log_prior: 0.0,
            };
            if *variable != Variable::Time {
                for k in 1..THRESHOLDS {
                    let basis = Basis::new(*variable, Shape::Step { at: quantile(k, THRESHOLDS) });
                    let term = Term::new(
                        format!("step_{joint}_by_{}", name(*variable)),
                        UNEXPLAINED,
                        Site::Joint { joint },
                        basis,
                    );
                    out.push(candidate(vec![term]));
                }
            }
            // the first tent would repeat the joint's own offset
            let knots: Vec<f64> = (0..KNOTS).map(|k| quantile(k, KNOTS - 1)).collect();
            let mut terms = Vec::new();
            for k in 1..KNOTS {
                let right = if k + 1 < KNOTS { knots[k + 1] } else { f64::INFINITY };
                let basis = Basis::new(*variable, Shape::Tent { left: knots[k - 1], centre: knots[k], right });
                terms.push(Term::new(
                    format!("curve_{joint}_by_{}_{k}", name(*variable)),
                    UNEXPLAINED,
                    Site::Joint { joint },
                    basis,
                ));
            }
            out.push(candidate(terms));
        }
    }
    #[expect(clippy::cast_precision_loss, reason = "a count")]
    let price = (out.len() as f64).ln() + PRICE;
    for c in &mut out {
        c.log_prior = -price;
    }
    out
}

/// "q2", "time".
#[must_use]
pub fn name(variable: Variable) -> String {
    match variable {
        Variable::Joint { joint } => format!("q{joint}"),
        Variable::Time => "time".into(),
        other => format!("{other:?}").to_lowercase(),
    }
}

/// A mismatch without a name, as it is told.
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
    let Some(variable) = first.terms.first().map(|t| t.basis.of) else {
        return Located::default();
    };
    let factor = if matches!(variable, Variable::Joint { .. }) { 1.0_f64.to_degrees() } else { 1.0 };
    let units = if matches!(variable, Variable::Joint { .. }) { "deg" } else { "s" };
    let read = |state: &trical_model::State| match variable {
        Variable::Joint { joint } => state.q[joint - 1],
        _ => state.t.unwrap_or(0.0),
    };
    let values: Vec<f64> = data.observations.iter().map(|o| read(&o.state)).collect();
    let (low, high) =
        (values.iter().copied().fold(f64::MAX, f64::min), values.iter().copied().fold(f64::MIN, f64::max));
    let terms: Vec<&Term> = members
        .flat_map(|c| &c.terms)
        .filter_map(|t| model.terms.iter().find(|m| m.site == t.site && m.basis == t.basis && m.effect == t.effect))
        .filter(|t| t.basis.of == variable)
        .collect();
    let at = |u: f64| terms.iter().map(|t| t.value * t.basis.shape.at(u).0).sum::<f64>();
    let curve: Vec<(f64, f64)> = (0..=40)
        .map(|k| {
            let u = low + (high - low) * f64::from(k) / 40.0;
            (u * factor, at(u).to_degrees())
        })
        .collect();
    let n = name(variable);
    let region = match first.terms.as_slice() {
        [one] => match one.basis.shape {
            Shape::Step { at } => {
                let below = values.iter().filter(|v| **v < at).count();
                let sign = if 2 * below <= values.len() { "<" } else { ">" };
                format!("{n} {sign} {:.1} {units}", at * factor)
            }
            _ => format!("{n} from {:.1} to {:.1} {units}", low * factor, high * factor),
        },
        _ => {
            // where the curve is farthest from its middle value
            let mut sorted: Vec<f64> = curve.iter().map(|c| c.1).collect();
            sorted.sort_by(f64::total_cmp);
            let middle = sorted[sorted.len() / 2];
            let largest = curve.iter().map(|c| (c.1 - middle).abs()).fold(0.0, f64::max);
            let off: Vec<f64> = curve.iter().filter(|c| (c.1 - middle).abs() > 0.5 * largest).map(|c| c.0).collect();
            match (off.first(), off.last()) {
                (Some(a), Some(b)) => format!("{n} from {a:.1} to {b:.1} {units}"),
                _ => format!("all of {n}"),
            }
        }
    };
    Located { variable: n, region, curve, units: (units.to_owned(), "deg".to_owned()) }
}
