//! A strain-wave or cycloidal drive, or the motor's encoder: many cycles a turn. Three hundred frequencies at six joints are too
//! many candidates: a periodogram says which are worth a try (see [`crate::periodogram`]), the prior counts all.

use trical_model::{Basis, Place, Scope, Shape, Site, Variable};

use super::effect::{Asked, Effect, Family, Remedy, Size, WAVES, arcsec};
use crate::candidate::Candidate;
use crate::covariates::Covariates;
use crate::effect_id::EffectId;
use crate::settings::GEAR_CYCLES;

/// The effect.
pub const EFFECT: Effect = Effect {
    id: EffectId::GearRipple,
    title: "gear ripple",
    family: Family::Transmission,
    scope: Scope::Arm,
    site: "joint",
    form: "strain-wave or cycloidal drive, motor encoder: D = a sin(N q_j) + b cos(N q_j), N = 10 to 300",
    needs: "joints to 0.01 deg",
    typical: "5 to 30 arcsec",
    rivals: "its own aliases",
    coefficients: WAVES,
    action: "Let the calibrated model correct it; where it grows, have the gear checked for wear.",
    remedy: Remedy::WiderRange,
    follows_torque: false,
    ask,
};

/// Frequencies come later.
fn ask(_: &Covariates<'_>) -> Asked {
    Asked::default()
}

/// A ripple of `cycles` per turn, of a robot with so many `joints`.
pub fn ripple(joint: usize, cycles: f64, joints: usize) -> Candidate {
    let q = Variable::Joint { joint };
    let part = |part: &str, shape| (format!("ripple_{part}_{joint}"), Site::Joint { joint }, Basis::new(q, shape), 0);
    let wave = EFFECT.candidate(
        Place::Joint(joint),
        format!("{cycles:.0} cycles per turn of joint {joint}"),
        Size { typical: arcsec(15.0), large: arcsec(30.0) },
        vec![part("sine", Shape::Sine { cycles }), part("cosine", Shape::Cosine { cycles })],
    );
    Candidate { log_prior: log_prior(cycles, joints, &[]), ..wave }
}

/// What is expected of a ripple of `cycles` per turn at one of so many `joints`: half of it of the `likely` numbers, where there are any.
pub fn log_prior(cycles: f64, joints: usize, likely: &[f64]) -> f64 {
    let (from, to) = GEAR_CYCLES;
    let of_all = 1.0 / f64::from(to - from + 1);
    let of_number = match likely.len() {
        0 => of_all,
        n => 0.5 * of_all + if likely.contains(&cycles) { 0.5 / n as f64 } else { 0.0 },
    };
    libm::log(of_number / (EffectId::ALL.len() * joints) as f64)
}
