//! An indicator drifts with time.

use trical_model::{Axis, Basis, Motion, Place, Shape, Site};

use super::{Asked, Effect, NO_TIME, Size};
use crate::covariates::{Recorded, seconds_per};

pub const EFFECT: Effect = Effect {
    name: "indicator_drift",
    site: "axis",
    form: "y gets k t",
    needs: "time or order",
    typical: "0.02 mm/h",
    rivals: "tool_drift",
    ask,
};

fn ask(r: &Recorded<'_>) -> Asked {
    if !r.touches {
        return Asked::default();
    }
    let Some(order) = r.order else { return Asked::lacking(NO_TIME) };
    let seconds = seconds_per(order);
    let of = |axis: &Axis| {
        let a = axis.name();
        EFFECT.candidate(
            Place::Axis(*axis),
            format!("indicator {a} drifts with time"),
            Size { typical: 2e-5 / 3600.0 * seconds, large: 6e-5 / 3600.0 * seconds },
            vec![(
                format!("indicator_drift_{a}"),
                Site::Tool(Motion::Along(*axis)),
                Basis::new(order, Shape::Linear),
                0,
            )],
        )
    };
    Axis::ALL.iter().map(of).collect::<Vec<_>>().into()
}
