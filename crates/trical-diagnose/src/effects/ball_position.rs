//! A ball is not where the ballbar says. Of three balls, each could be the wrong one: two of their three distances change the same
//! way for all, and the third is the arm's own scale.

use trical_model::{Axis, Basis, Place, Scope, Site};

use super::effect::{Asked, Effect, Family, Part, Remedy, Size};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::BallPosition,
    title: "wrong distance between balls",
    family: Family::Gauge,
    scope: Scope::Setup,
    site: "ball",
    form: "a wrong measured distance: the ball is elsewhere, three coordinates",
    needs: "touches",
    typical: "0.01 to 0.2 mm",
    rivals: "the base (mostly absorbed); the other balls, where there are three",
    coefficients: &[("ball", "place", "along")],
    action: "Measure the distances of the balls again.",
    remedy: Remedy::SecondInstrument,
    follows_torque: false,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
    if !r.touches {
        return Asked::default();
    }
    let of = |ball| {
        let part = |a: &Axis| -> Part {
            (format!("ball_{ball}_{}", a.name()), Site::Ball { ball, axis: *a }, Basis::CONSTANT, 0)
        };
        EFFECT.candidate(
            Place::Ball(ball),
            format!("ball {ball} is not where the ballbar says"),
            Size { typical: 5e-5, large: 2e-4 },
            Axis::ALL.iter().map(part).collect(),
        )
    };
    (1..=r.model.cell.balls.len()).map(of).collect::<Vec<_>>().into()
}
