//! An encoder loses its zero, or a belt jumps: from one moment on the joint is off. The moment is scanned; it may lie between two sessions.

use trical_model::{Basis, Place, Scope, Shape, Site};

use super::effect::{Asked, Effect, Family, NO_TIME, Remedy, Size, deg};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::JointZeroShift,
    title: "joint zero that jumped",
    family: Family::SomethingMoved,
    scope: Scope::Course,
    site: "joint",
    form: "encoder zero lost at ts: D = d step(t - ts)",
    needs: "time or order",
    typical: "0.01 to 0.06 deg",
    rivals: "fixture_shift, tool_shift",
    coefficients: &[("zero_shift", "jump of the zero", "")],
    action: "Have encoder, battery and belt checked, and measure again.",
    remedy: Remedy::Repeats,
    follows_torque: false,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
    let of = |joint, behaviour, basis| {
        let size = Size { typical: deg(0.02), large: deg(0.06) };
        let term = (format!("zero_shift_{joint}"), Site::Joint { joint }, basis, 0);
        EFFECT.candidate(Place::Joint(joint), behaviour, size, vec![term])
    };
    let mut out = Vec::new();
    if r.one_of_several {
        let other =
            |joint| of(joint, format!("joint {joint}'s zero is not that of the other sessions"), Basis::CONSTANT);
        out.extend(r.joints().map(other));
    }
    let Some(order) = r.order else { return Asked { candidates: out, lacks: Some(NO_TIME) } };
    for at in r.changes() {
        let step = Basis::new(order, Shape::Step { at: *at });
        out.extend(r.joints().map(|joint| of(joint, format!("joint {joint}'s zero changes at once"), step)));
    }
    out.into()
}
