//! The platform of the balls (or the base) slips at one moment, which is scanned.

use trical_model::{Basis, Place, Shape, Site};

use super::{Asked, Effect, NO_TIME, Size, along};
use crate::covariates::{Recorded, moment};

pub const EFFECT: Effect = Effect {
    name: "fixture_shift",
    site: "fixture",
    form: "the balls step at ts, three coordinates",
    needs: "time or order",
    typical: "0.03 to 0.25 mm",
    rivals: "joint_zero_shift",
    ask,
};

fn ask(r: &Recorded<'_>) -> Asked {
    let Some(order) = r.order else { return Asked::lacking(NO_TIME) };
    if !r.touches {
        return Asked::default();
    }
    let of = |at: &f64| {
        EFFECT.candidate(
            Place::Fixture,
            format!("the place of the balls changes at once {}", moment(order, *at)),
            Size { typical: 1e-4, large: 2.5e-4 },
            along(Site::Fixture, "fixture_shift", Basis::new(order, Shape::Step { at: *at })),
        )
    };
    r.changes().iter().map(of).collect::<Vec<_>>().into()
}
