//! An indicator reads too much or too little. Where every touch was nulled its gain cannot be asked for: the noise of a reading
//! stands in the residual and in the regressor.

use trical_model::{Axis, Basis, Motion, Place, Scope, Shape, Site, Variable};

use super::effect::{Asked, Effect, Family, Remedy, Size};
use crate::candidate::{Candidate, Physical};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::IndicatorGain,
    title: "indicator that reads too much or too little",
    family: Family::Gauge,
    scope: Scope::Setup,
    site: "axis",
    form: "the reading is (1 + g) y",
    needs: "readings with a spread",
    typical: "0.5 to 8 %",
    rivals: "invisible if every reading is nulled",
    coefficients: &[("gain", "error of the gain", "")],
    action: "Have the indicator calibrated.",
    remedy: Remedy::DeflectedReadings,
    follows_torque: false,
    ask,
};

/// An indicator that is farther off is broken. And where the arm as it was planned touches its balls, readings and corrections that are all smaller
/// by one share fit as well, and better the smaller they are, since their noise is smaller, too: far from one a gain is that.
const MOST: f64 = 0.15;

fn ask(r: &Covariates<'_>) -> Asked {
    if !r.touches {
        return Asked::default();
    }
    let of = |axis: &Axis| {
        let a = axis.name();
        let candidate = EFFECT.candidate(
            Place::Axis(*axis),
            format!("in proportion to indicator {a}'s own reading"),
            Size { typical: 0.02, large: 0.08 },
            vec![(
                format!("gain_{a}"),
                Site::Tool(Motion::Along(*axis)),
                Basis::new(Variable::Reading { axis: *axis }, Shape::Linear),
                0,
            )],
        );
        Candidate { physical: Physical::when(|gain| gain.iter().all(|g| g.abs() < MOST)), ..candidate }
    };
    let spread = |axis: &&Axis| r.spread[axis.index()];
    Asked {
        candidates: Axis::ALL.iter().filter(spread).map(of).collect(),
        lacks: (r.spread != [true; 3]).then_some("readings with a spread: each touch was nulled to within the noise"),
    }
}
