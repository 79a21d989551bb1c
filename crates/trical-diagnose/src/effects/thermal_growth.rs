//! All lengths grow with temperature, or with a warm-up clock where there is no thermometer.

use trical_model::{Place, Scope, Site, Variable};

use super::effect::{Asked, Effect, Family, Remedy, Size};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::ThermalGrowth,
    title: "growth with temperature",
    family: Family::Heat,
    scope: Scope::Course,
    site: "links",
    form: "a, d times (1 + alpha dT), or with 1 - exp(-t/T) where there is no thermometer; in all sessions or in one",
    needs: "temperature, time or order",
    typical: "12e-6 to 26e-6 / K",
    rivals: "frame_drift, thermal_zero_drift",
    coefficients: &[("expansion", "growth of all lengths", "")],
    action: "Let the arm warm up first, or record its temperature.",
    remedy: Remedy::Repeats,
    follows_torque: false,
    ask,
};

/// Kelvin by which an arm without a thermometer warms up: typical, and much.
const WARM: [f64; 2] = [6.0, 10.0];

fn ask(r: &Covariates<'_>) -> Asked {
    if r.clocks.is_empty() {
        return Asked::lacking("temperature (temp_c) or time (t_s)");
    }
    let of = |clock: &crate::covariates::Clock| {
        let size = if matches!(clock.basis.of, Variable::Temperature { .. }) {
            Size { typical: 18e-6, large: 26e-6 }
        } else {
            Size { typical: 18e-6 * WARM[0], large: 26e-6 * WARM[1] }
        };
        EFFECT.candidate(
            Place::Links,
            format!("all lengths grow {}", clock.how),
            size,
            vec![("expansion".into(), Site::Links, clock.basis, 1)],
        )
    };
    r.clocks.iter().map(of).collect::<Vec<_>>().into()
}
