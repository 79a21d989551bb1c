//! The device creeps on the flange.

use trical_model::{Basis, Place, Scope, Shape, Site};

use super::effect::{Asked, Effect, Family, NO_TIME, Remedy, Size, along};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::ToolDrift,
    title: "tool that creeps",
    family: Family::SomethingMoved,
    scope: Scope::Course,
    site: "tool",
    form: "the device creeps on the flange with t, three coordinates",
    needs: "time or order",
    typical: "0.03 to 0.25 mm",
    rivals: "indicator_drift",
    coefficients: &[("tool_drift", "drift", "along")],
    action: "Fasten the device on the flange, and keep its temperature steady.",
    remedy: Remedy::Repeats,
    follows_torque: false,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
    let Some(order) = r.order else { return Asked::lacking(NO_TIME) };
    vec![EFFECT.candidate(
        Place::Tool,
        "the tool creeps on the flange with time".into(),
        Size { typical: 1e-4 / r.span, large: 2.5e-4 / r.span },
        along(Site::Tool, "tool_drift", Basis::new(order, Shape::Linear)),
    )]
    .into()
}
