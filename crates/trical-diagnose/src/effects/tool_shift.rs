//! The device slips on the flange at one moment, which is scanned.

use trical_model::{Basis, Place, Scope, Shape, Site};

use super::effect::{Asked, Effect, Family, NO_TIME, Remedy, Size, along};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::ToolShift,
    title: "tool that slipped",
    family: Family::SomethingMoved,
    scope: Scope::Course,
    site: "tool",
    form: "the device steps on the flange at ts, three coordinates",
    needs: "time or order",
    typical: "0.03 to 0.25 mm",
    rivals: "joint_zero_shift of joint 6 (exactly)",
    coefficients: &[("tool_shift", "jump", "along")],
    action: "Fasten the device on the flange, and measure again.",
    remedy: Remedy::Repeats,
    follows_torque: false,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
    let Some(order) = r.order else { return Asked::lacking(NO_TIME) };
    let of = |at: &f64| {
        EFFECT.candidate(
            Place::Tool,
            "the tool on the flange changes at once".into(),
            Size { typical: 1e-4, large: 2.5e-4 },
            along(Site::Tool, "tool_shift", Basis::new(order, Shape::Step { at: *at })),
        )
    };
    r.changes().iter().map(of).collect::<Vec<_>>().into()
}
