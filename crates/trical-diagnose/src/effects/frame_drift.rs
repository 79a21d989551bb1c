//! The measuring instrument's own frame moves.

use trical_model::{Basis, Motion, Place, Scope, Shape, Site};

use super::effect::{Asked, Effect, Family, NO_TIME, Remedy, Size};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::FrameDrift,
    title: "measuring instrument that moves",
    family: Family::SomethingMoved,
    scope: Scope::Course,
    site: "frame",
    form: "the measuring frame moves with t, six coordinates",
    needs: "time or order, an optical instrument",
    typical: "0.01 to 0.2 mm",
    rivals: "fixture_drift, thermal_growth",
    coefficients: &[("frame_drift", "drift", "along")],
    action: "Fasten the instrument, let it warm up, and measure reference points in between.",
    remedy: Remedy::Repeats,
    follows_torque: false,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
    let Some(order) = r.order else { return Asked::lacking(NO_TIME) };
    let drift = Basis::new(order, Shape::Linear);
    let of = |frame| {
        let part = |m: &Motion| (format!("frame_drift_{}", m.name()), Site::Frame { frame, motion: *m }, drift, 0);
        EFFECT.candidate(
            Place::Frame(None),
            "the measuring frame moves with time".into(),
            Size { typical: 1e-4 / r.span, large: 2e-4 / r.span },
            Motion::ALL.iter().map(part).collect(),
        )
    };
    r.frames().map(of).collect::<Vec<_>>().into()
}
