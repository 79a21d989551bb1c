//! The base is not level: gravity does not point along -z of the cell, and every joint gives way accordingly.

use trical_model::{Axis, Basis, Place, Scope, Site};

use super::effect::{Asked, Effect, Family, NO_MASSES, Remedy, Size, deg};
use crate::candidate::Physical;
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
    coefficients: &[("gravity", "gravity", "along")],
    action: "Level the base, or tell the controller how it stands.",
    remedy: Remedy::SignOfTorque,
    follows_torque: false,
    ask,
};

/// m/s2.
const G: f64 = 9.8;

fn ask(r: &Covariates<'_>) -> Asked {
    if !r.masses {
        return Asked::lacking(NO_MASSES);
    }
    let mut candidate = EFFECT.candidate(
        Place::Base,
        "gravity is not along the cell's -z".into(),
        Size { typical: G * deg(1.0), large: G * deg(2.0) },
        vec![
            ("gravity_x".into(), Site::Gravity(Axis::X), Basis::CONSTANT, 0),
            ("gravity_y".into(), Site::Gravity(Axis::Y), Basis::CONSTANT, 0),
        ],
    );
    candidate.physical = Physical::when(is_of_a_base);
    vec![candidate].into()
}

/// A base is a little off level, or stands on a wall of which the cell file says nothing: none leans as a roof does. What pulls the arm aside does so.
fn is_of_a_base(gravity: &[f64]) -> bool {
    let lean = gravity.iter().fold(0.0_f64, |sum, g| libm::hypot(sum, *g)) / G;
    !(deg(5.0)..0.5).contains(&lean)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_base_leans_by_a_few_degrees_or_hangs_on_a_wall() {
        let leans = |degrees: f64| is_of_a_base(&[G * deg(degrees).sin(), 0.0]);
        assert!(leans(2.0) && leans(-4.0) && leans(90.0) && !leans(11.0) && !leans(-20.0));
    }
}
