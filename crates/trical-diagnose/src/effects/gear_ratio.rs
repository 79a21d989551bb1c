//! The gear ratio is not what the controller believes.

use trical_model::{Basis, Place, Scope, Shape, Site, Variable};

use super::effect::{Asked, Effect, Family, Remedy, Size};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::GearRatio,
    title: "wrong gear ratio",
    family: Family::Transmission,
    scope: Scope::Arm,
    site: "joint",
    form: "a wrong ratio: D = k q_j",
    needs: "-",
    typical: "1e-4 to 1e-3",
    rivals: "joint_harmonic with n = 1",
    coefficients: &[("ratio", "error of the ratio", "")],
    action: "Correct the ratio in the controller, or let the calibrated model do so.",
    remedy: Remedy::WiderRange,
    follows_torque: false,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
    let of = |joint| {
        let basis = Basis::new(Variable::Joint { joint }, Shape::Linear);
        EFFECT.candidate(
            Place::Joint(joint),
            format!("in proportion to joint {joint}'s position"),
            Size { typical: 5e-4, large: 1e-3 },
            vec![(format!("ratio_{joint}"), Site::Joint { joint }, basis, 0)],
        )
    };
    r.joints().map(of).collect::<Vec<_>>().into()
}
