//! An encoder loses its zero, or a belt jumps: from one moment on the joint is off. The moment is scanned.

use trical_model::{Basis, Place, Shape, Site};

use super::{Asked, Effect, NO_TIME, Size, deg};
use crate::covariates::{Recorded, moment};

pub const EFFECT: Effect = Effect {
    name: "joint_zero_shift",
    site: "joint",
    form: "encoder zero lost at ts: D = d step(t - ts)",
    needs: "time or order",
    typical: "0.01 to 0.06 deg",
    rivals: "fixture_shift, tool_shift",
    ask,
};

fn ask(r: &Recorded<'_>) -> Asked {
    let Some(order) = r.order else { return Asked::lacking(NO_TIME) };
    let mut out = Vec::new();
    for at in r.changes() {
        let step = Basis::new(order, Shape::Step { at: *at });
        for joint in r.joints() {
            out.push(EFFECT.candidate(
                Place::Joint(joint),
                format!("joint {joint}'s zero changes at once {}", moment(order, *at)),
                Size { typical: deg(0.02), large: deg(0.06) },
                vec![(format!("zero_shift_{joint}"), Site::Joint { joint }, step, 0)],
            ));
        }
    }
    out.into()
}
