//! The platform of the balls (or the base) slips at one moment, which is scanned.

use trical_model::{Basis, Place, Scope, Shape, Site};

use super::effect::{Asked, Effect, Family, NO_TIME, Remedy, Size, along};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::FixtureShift,
    title: "balls that slipped",
    family: Family::SomethingMoved,
    scope: Scope::Course,
    site: "fixture",
    form: "the balls step at ts, three coordinates",
    needs: "time or order",
    typical: "0.03 to 0.25 mm",
    rivals: "joint_zero_shift",
    coefficients: &[("fixture_shift", "jump", "along")],
    action: "Fasten the platform of the balls and the base, and measure again.",
    remedy: Remedy::Repeats,
    follows_torque: false,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
    let Some(order) = r.order else { return Asked::lacking(NO_TIME) };
    if !r.touches {
        return Asked::default();
    }
    let of = |at: &f64| {
        EFFECT.candidate(
            Place::Fixture,
            "the place of the balls changes at once".into(),
            Size { typical: 1e-4, large: 2.5e-4 },
            along(Site::Fixture, "fixture_shift", Basis::new(order, Shape::Step { at: *at })),
        )
    };
    r.changes().iter().map(of).collect::<Vec<_>>().into()
}
