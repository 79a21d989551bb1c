//! An indicator is not square to the others, and sees some of what they read.

use trical_model::{Axis, Basis, Motion, Place, Scope, Shape, Site, Variable};

use super::effect::{Asked, Effect, Family, Part, Remedy, Size, deg};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::IndicatorSkew,
    title: "indicators that are not square",
    family: Family::Gauge,
    scope: Scope::Setup,
    site: "axis",
    form: "e y_b of the other two is added to y_a",
    needs: "readings with a spread",
    typical: "0.5 to 1.5 deg",
    rivals: "invisible if every reading is nulled",
    coefficients: &[("skew", "share of another indicator in the reading", "")],
    action: "Have the device aligned, or its indicators calibrated together.",
    remedy: Remedy::DeflectedReadings,
    follows_torque: false,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
    if !r.touches {
        return Asked::default();
    }
    let of = |axis: &Axis| {
        let part = |other: &Axis| -> Part {
            let basis = Basis::new(Variable::Reading { axis: *other }, Shape::Linear);
            (format!("skew_{}_by_{}", axis.name(), other.name()), Site::Tool(Motion::Along(*axis)), basis, 0)
        };
        EFFECT.candidate(
            Place::Axis(*axis),
            format!("indicator {} responds when the others move", axis.name()),
            Size { typical: deg(1.0), large: deg(1.5) },
            Axis::ALL.iter().filter(|a| *a != axis).map(part).collect(),
        )
    };
    Axis::ALL.iter().map(of).collect::<Vec<_>>().into()
}
