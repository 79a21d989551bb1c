//! Teeth rest on the flank that gravity presses: half a gap this way or that, changing where the torque changes sign. How softly it
//! changes is scanned: friction and preload, a small part of what the joint bears, do that.

use trical_model::{Basis, Place, Scope, Shape, Site};

use super::effect::{Asked, Effect, Family, NO_MASSES, Remedy, Size, deg, turning};
use crate::candidate::Candidate;
use crate::covariates::Covariates;
use crate::effect_id::EffectId;
use crate::settings::SMALL_ARM_LOAD_NM;

pub const EFFECT: Effect = Effect {
    id: EffectId::LostMotionGravity,
    title: "backlash that gravity closes",
    family: Family::LostMotion,
    scope: Scope::Arm,
    site: "joint",
    form: "teeth rest on one flank: D = (b/2) tanh(tau_j / T)",
    needs: "masses",
    typical: "0.01 to 0.04 deg",
    rivals: "nonlinear_stiffness; the zero offset where tau_j never changes sign",
    coefficients: &[("half_gap_gravity", "half of the gap", "")],
    action: "Have the gear's preload checked, or keep the joint loaded in one direction.",
    remedy: Remedy::SignOfTorque,
    follows_torque: true,
    ask,
};

/// Prior odds of a gap that closes as softly as this share of the load, against a firmer one: friction and preload would be
/// most of what the joint bears.
const SOFTEST: (f64, f64) = (1.0 / 1.5, 0.2);

/// T of a small arm, N m.
const SOFTNESS: [f64; 5] = [0.05, 0.15, 0.4, 1.0, 2.5];

fn ask(r: &Covariates<'_>) -> Asked {
    if !r.masses {
        return Asked::lacking(NO_MASSES);
    }
    let mut out = Vec::new();
    for joint in turning(r) {
        let softnesses = SOFTNESS.map(|s| s * (r.load(joint) / SMALL_ARM_LOAD_NM).max(1.0));
        let load = r.load(joint);
        let firm = softnesses[0].max(load / 8.0);
        // the softest gaps are the firmest soft joints (nonlinear_stiffness): rivals, told apart by their size alone
        let soft = [load / 6.0, load / 3.0, SOFTEST.0 * load].into_iter().filter(|s| *s > softnesses[0]);
        for scale in softnesses.into_iter().filter(|s| *s <= firm).chain(soft) {
            let basis = Basis::torque(joint, Shape::SoftSign { scale });
            let candidate = EFFECT.candidate(
                Place::Joint(joint),
                format!("follows the sign of joint {joint}'s gravity torque"),
                Size { typical: deg(0.01), large: deg(0.02) },
                vec![(format!("half_gap_gravity_{joint}"), Site::Joint { joint }, basis, 1)],
            );
            let odds = if scale >= SOFTEST.0 * load { SOFTEST.1 } else { 1.0 };
            out.push(Candidate { log_prior: libm::log(odds), ..candidate });
        }
    }
    out.into()
}
