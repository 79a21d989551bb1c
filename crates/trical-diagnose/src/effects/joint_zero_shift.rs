//! An encoder loses its zero, or a belt jumps: from one moment on the joint is off. The moment is scanned.

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
    action: "Have encoder, battery and belt checked, and measure again.",
    remedy: Remedy::Repeats,
    periodic: false,
    follows_torque: false,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
    let Some(order) = r.order else { return Asked::lacking(NO_TIME) };
    let mut out = Vec::new();
    for at in r.changes() {
        let step = Basis::new(order, Shape::Step { at: *at });
        for joint in r.joints() {
            out.push(EFFECT.candidate(
                Place::Joint(joint),
                format!("joint {joint}'s zero changes at once"),
                Size { typical: deg(0.02), large: deg(0.06) },
                vec![(format!("zero_shift_{joint}"), Site::Joint { joint }, step, 0)],
            ));
        }
    }
    out.into()
}
