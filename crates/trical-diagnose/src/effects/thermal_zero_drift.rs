//! A joint's zero moves with temperature, or with a warm-up clock where there is no thermometer.

use trical_model::{Place, Scope, Site};

use super::effect::{Asked, Effect, Family, Remedy, Size, deg};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::ThermalZeroDrift,
    title: "joint zero that moves with temperature",
    family: Family::Heat,
    scope: Scope::Course,
    site: "joint",
    form: "D = k dT, in all sessions or in one",
    needs: "temperature, time or order",
    typical: "0.005 to 0.06 deg",
    rivals: "fixture_drift, thermal_growth",
    coefficients: &[("thermal_zero", "drift of the zero", "")],
    action: "Let the arm warm up first, or record its temperature.",
    remedy: Remedy::Repeats,
    follows_torque: false,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
    if r.clocks.is_empty() {
        return Asked::lacking("temperature (temp_c) or time (t_s)");
    }
    let mut out = Vec::new();
    for clock in &r.clocks {
        for joint in r.joints() {
            out.push(EFFECT.candidate(
                Place::Joint(joint),
                format!("joint {joint}'s zero moves {}", clock.how),
                Size { typical: deg(0.02) / clock.rise, large: deg(0.06) / clock.rise },
                vec![(format!("thermal_zero_{joint}"), Site::Joint { joint }, clock.basis, 0)],
            ));
        }
    }
    out.into()
}
