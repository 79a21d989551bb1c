//! The platform of the balls (or the base) creeps.

use trical_model::{Basis, Place, Shape, Site};

use super::{Asked, Effect, NO_TIME, Size, along};
use crate::covariates::Recorded;

pub const EFFECT: Effect = Effect {
    name: "fixture_drift",
    site: "fixture",
    form: "the balls creep with t, three coordinates",
    needs: "time or order",
    typical: "0.03 to 0.25 mm",
    rivals: "thermal_zero_drift",
    ask,
};

fn ask(r: &Recorded<'_>) -> Asked {
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
