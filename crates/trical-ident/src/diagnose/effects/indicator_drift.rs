//! An indicator drifts with time.

use trical_model::{Axis, Basis, Motion, Shape, Site, Variable};

use super::{Asked, Effect, NO_TIME, Size};
use crate::diagnose::recorded::Recorded;

pub const EFFECT: Effect = Effect {
    name: "indicator_drift",
    site: "axis",
    form: "y gets k t",
    needs: "time",
    typical: "0.02 mm/h",
    rivals: "tool_drift",
    ask,
};

fn ask(r: &Recorded<'_>) -> Asked {
    if !r.touches {
        return Asked::default();
    }
    if !r.time {
        return Asked::lacking(NO_TIME);
    }
    let of = |axis: &Axis| {
        let a = axis.name();
        EFFECT.candidate(
            serde_json::json!({ "axis": a }),
            format!("indicator {a} drifts with time"),
            Size { typical: 2e-5 / 3600.0, large: 6e-5 / 3600.0 },
            vec![(
                format!("indicator_drift_{a}"),
                Site::Tool(Motion::Along(*axis)),
                Basis::new(Variable::Time, Shape::Linear),
                0,
            )],
        )
    };
    Axis::ALL.iter().map(of).collect::<Vec<_>>().into()
}
