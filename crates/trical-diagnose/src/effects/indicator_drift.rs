//! An indicator drifts with time.

use trical_model::{Axis, Basis, Motion, Place, Scope, Shape, Site};

use super::effect::{Asked, Effect, Family, NO_TIME, Remedy, Size};
use crate::covariates::{Covariates, seconds_per};
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::IndicatorDrift,
    title: "indicator that drifts",
    family: Family::Gauge,
    scope: Scope::Course,
    site: "axis",
    form: "k t is added to y",
    needs: "time or order",
    typical: "0.02 mm/h",
    rivals: "tool_drift",
    coefficients: &[("indicator_drift", "drift", "")],
    action: "Let the gauge warm up, and measure its zero in between.",
    remedy: Remedy::Repeats,
    follows_torque: false,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
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
