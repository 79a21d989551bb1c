//! A ball is not where the ballbar says. Of three balls, each could be the wrong one: two of their three distances change the same
//! way for all, and the third is the arm's own scale.

use trical_model::{Axis, Basis, Place, Site};

use super::{Asked, Effect, Part, Size};
use crate::covariates::Recorded;

pub const EFFECT: Effect = Effect {
    name: "ball_position",
    site: "ball",
    form: "a wrong distance of the ballbar: the ball is elsewhere, three coordinates",
    needs: "touches",
    typical: "0.01 to 0.2 mm",
    rivals: "the base (mostly absorbed); the other balls, where there are three",
    ask,
};

fn ask(r: &Recorded<'_>) -> Asked {
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
