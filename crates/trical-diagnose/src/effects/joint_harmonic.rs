//! An eccentric gear or encoder: the joint runs ahead and behind a few times a turn.

use trical_model::{Basis, Place, Scope, Shape, Site, Variable};

use super::effect::{Asked, Effect, Family, Remedy, Size, WAVES, deg, turning};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::JointHarmonic,
    title: "eccentric gear or encoder",
    family: Family::Transmission,
    scope: Scope::Arm,
    site: "joint",
    form: "eccentric gear or encoder: D = a sin(n q_j) + b cos(n q_j), n = 1 to 6",
    needs: "-",
    typical: "0.005 to 0.03 deg",
    rivals: "gear_ratio on short strokes",
    coefficients: WAVES,
    action: "Let the calibrated model correct it, or have the encoder and the gear centred.",
    remedy: Remedy::WiderRange,
    follows_torque: false,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
    let mut out = Vec::new();
    for joint in turning(r) {
        let at = Site::Joint { joint };
        let q = Variable::Joint { joint };
        for k in 1..=6_u8 {
            let cycles = f64::from(k);
            out.push(EFFECT.candidate(
                Place::Joint(joint),
                format!("{k} cycle{} per turn of joint {joint}", if k == 1 { "" } else { "s" }),
                Size { typical: deg(0.015), large: deg(0.03) },
                vec![
                    (format!("sine_{k}_{joint}"), at, Basis::new(q, Shape::Sine { cycles }), 0),
                    (format!("cosine_{k}_{joint}"), at, Basis::new(q, Shape::Cosine { cycles }), 0),
                ],
            ));
        }
    }
    out.into()
}
