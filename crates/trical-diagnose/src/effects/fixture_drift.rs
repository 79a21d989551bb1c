//! The platform of the balls (or the base) creeps.

use trical_model::{Basis, Place, Scope, Shape, Site};

use super::effect::{Asked, Effect, Family, NO_TIME, Remedy, Size, along};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::FixtureDrift,
    title: "balls that creep",
    family: Family::SomethingMoved,
    scope: Scope::Course,
    site: "fixture",
    form: "the balls creep with t, three coordinates",
    needs: "time or order",
    typical: "0.03 to 0.25 mm",
    rivals: "thermal_zero_drift",
    coefficients: &[("fixture_drift", "drift", "along")],
    action: "Fasten the platform of the balls and the base, and keep its temperature steady.",
    remedy: Remedy::Repeats,
    follows_torque: false,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
    let Some(order) = r.order else { return Asked::lacking(NO_TIME) };
    if !r.touches {
        return Asked::default();
    }
    vec![EFFECT.candidate(
        Place::Fixture,
        "the balls creep with time".into(),
        Size { typical: 1e-4 / r.span, large: 2.5e-4 / r.span },
        along(Site::Fixture, "fixture_drift", Basis::new(order, Shape::Linear)),
    )]
    .into()
}
