//! Joints were read before the arm had settled: read angles lag behind commanded ones in the sense of motion. All joints together, or
//! one.

use trical_model::{Basis, Place, Scope, Shape, Site, Variable};

use super::effect::{Asked, Effect, Family, Part, Remedy, Size};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::LateJointReading,
    title: "joints read before the arm had settled",
    family: Family::Reading,
    scope: Scope::Reading,
    site: "all joints, or one",
    form: "D = lambda (q_commanded - q_read)",
    needs: "commanded and read joints, sense of motion",
    typical: "0.005 to 0.1 deg",
    rivals: "lost_motion_direction",
    coefficients: &[("lag", "share of the way from the read to the commanded angle", "")],
    action: "Wait longer, or use `--joints commanded`.",
    remedy: Remedy::Repeats,
    follows_torque: false,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
    if !r.commanded {
        return Asked::lacking("commanded beside read joints (qc1_deg ...)");
    }
    if !r.lags {
        return Asked::lacking("read joints that lag behind commanded ones: these had settled");
    }
    let lag = |joint| Basis::new(Variable::Lag { joint }, Shape::Linear);
    let candidate = |site, what: &str, part: Part| {
        let located = format!("{what} read before the arm had settled: the error follows commanded minus read");
        EFFECT.candidate(site, located, Size { typical: 0.7, large: 1.0 }, vec![part])
    };
    let all = Place::Joints;
    let mut out = vec![candidate(all, "joints were", ("lag".into(), Site::AllJoints, lag(1), 1))];
    out.extend(r.joints().map(|joint| {
        let part = (format!("lag_{joint}"), Site::Joint { joint }, lag(joint), 1);
        candidate(Place::Joint(joint), &format!("joint {joint} was"), part)
    }));
    out.into()
}
