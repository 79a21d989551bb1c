//! The base is not level: gravity does not point along -z of the cell, and every joint gives way accordingly.

use trical_model::{Axis, Basis, Place, Scope, Site};

use super::effect::{Asked, Effect, Family, NO_MASSES, Remedy, Size, deg};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::GravityDirection,
    title: "base that is not level",
    family: Family::Load,
    scope: Scope::Arm,
    site: "base",
    form: "a base that is not level: D_i = c_i dtau_i/dg for all joints",
    needs: "masses",
    typical: "0.5 to 2 deg",
    rivals: "mostly absorbed by the base",
    action: "Level the base, or tell the controller how it stands.",
    remedy: Remedy::SignOfTorque,
    periodic: false,
    follows_torque: false,
    ask,
};

/// m/s2.
const G: f64 = 9.8;

fn ask(r: &Covariates<'_>) -> Asked {
    if !r.masses {
        return Asked::lacking(NO_MASSES);
    }
    vec![EFFECT.candidate(
        Place::Base,
        "gravity is not along the cell's -z".into(),
        Size { typical: G * deg(1.0), large: G * deg(2.0) },
        vec![
            ("gravity_x".into(), Site::Gravity(Axis::X), Basis::CONSTANT, 0),
            ("gravity_y".into(), Site::Gravity(Axis::Y), Basis::CONSTANT, 0),
        ],
    )]
    .into()
}
