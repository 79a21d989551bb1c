//! Near-parallel axes are twisted against each other about y: Hayati's beta, which the four parameters of Denavit and Hartenberg lack
//! (Hayati and Mirmirani 1985).

use trical_model::{Basis, Parameter, Place, Scope, Site, trig};

use super::effect::{Asked, Effect, Family, Remedy, Size, deg};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::AxisTwist,
    title: "twist between near-parallel axes",
    family: Family::Geometry,
    scope: Scope::Arm,
    site: "joint",
    form: "near-parallel axes: Hayati's beta",
    needs: "-",
    typical: "0.01 to 0.1 deg",
    rivals: "axis_wobble of the joint before",
    coefficients: &[("beta", "second twist", "")],
    action: "Let the calibrated model correct it.",
    remedy: Remedy::WiderRange,
    follows_torque: false,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
    let near_parallel = |link: &usize| trig::sin(r.model.robot.joints[*link].alpha).abs() < 0.1;
    let of = |link| {
        EFFECT.candidate(
            Place::Joint(link + 1),
            format!("axis {} is twisted against axis {link} about y", link + 1),
            Size { typical: deg(0.03), large: deg(0.1) },
            vec![(format!("beta_{link}"), Site::Link { link, parameter: Parameter::Beta }, Basis::CONSTANT, 0)],
        )
    };
    (1..r.dof()).filter(near_parallel).map(of).collect::<Vec<_>>().into()
}
