//! The joint's output encoder is not linear: what it reads is off by a smooth curve of the joint's own angle that repeats every turn, and
//! is the same in every session. Its waves are held together by one prior that falls with their number, so that the curve costs
//! what it is worth (a Gaussian process on the circle, by its Fourier series), and returns to zero where no angle was visited. A curve of few
//! waves is asked about beside the longest that the poses allow: which one an encoder has, the evidence says. How large the
//! waves of each octave are is then learnt from the curves of all joints (`linear/wave_sizes.rs`).

use trical_model::{Basis, Place, Scope, Shape, Site, Term, Variable};

use super::effect::{Asked, Effect, Family, Part, Remedy, WAVES, deg, turning};
use crate::candidate::cycles_of;
use crate::covariates::Covariates;
use crate::effect_id::EffectId;
use crate::settings::{ENCODER_WAVES, POSES_PER_WAVE, SMOOTH_WAVES};

pub const EFFECT: Effect = Effect {
    id: EffectId::EncoderError,
    title: "encoder error",
    family: Family::Transmission,
    scope: Scope::Arm,
    site: "joint",
    form: "the output encoder is not linear: D = sum over n of (a_n sin(n q_j) + b_n cos(n q_j)), n = 1 to 12 or to 50, the standard deviation \
           of a_n and b_n falling as 1/sqrt(n), then octave by octave as the data of all joints say, with single waves beyond that are no \
           gear's; the same on every turn and in every session",
    needs: "joints, twelve poses and more for every wave",
    typical: "0.02 to 0.12 deg peak to peak",
    rivals: "joint_harmonic (its first waves), gear_ripple (a line at the gear's number), a curve over one stroke",
    coefficients: WAVES,
    action: "Let the calibrated model correct it; the maker can linearise the encoder.",
    remedy: Remedy::WiderRange,
    follows_torque: false,
    ask,
};

/// Standard deviation of the first wave's coefficients, rad: with 50 waves some 0.1 deg peak to peak.
const FIRST_WAVE: f64 = deg(0.012);

fn ask(r: &Covariates<'_>) -> Asked {
    let waves = (r.poses / POSES_PER_WAVE).min(ENCODER_WAVES.1);
    if waves < ENCODER_WAVES.0 {
        return Asked::lacking("poses: an encoder's curve needs at least 72");
    }
    let of = |joint: usize, waves: usize| {
        let at = Site::Joint { joint };
        let q = Variable::Joint { joint };
        let mut parts: Vec<Part> = Vec::with_capacity(2 * waves);
        let mut scales = Vec::with_capacity(2 * waves);
        for n in 1..=waves {
            let cycles = n as f64;
            for (name, shape) in [("sine", Shape::Sine { cycles }), ("cosine", Shape::Cosine { cycles })] {
                parts.push((wave_name(name, cycles, joint), at, Basis::new(q, shape), 0));
                scales.push(FIRST_WAVE / cycles.sqrt());
            }
        }
        let behaviour = format!("a curve of joint {joint}'s own angle that repeats every turn");
        EFFECT.candidate_of_scales(Place::Joint(joint), behaviour, deg(0.004), scales, parts)
    };
    let counts = if waves > SMOOTH_WAVES { vec![waves, SMOOTH_WAVES] } else { vec![waves] };
    turning(r).flat_map(|joint| counts.iter().map(move |n| of(joint, *n))).collect::<Vec<_>>().into()
}

fn wave_name(part: &str, cycles: f64, joint: usize) -> String {
    format!("encoder_{part}_{cycles:.0}_{joint}")
}

/// Makes a wave of a joint's own angle, beyond the curve's, one of the curve's.
pub fn further_wave(t: &mut Term) {
    let (Site::Joint { joint }, Some(cycles)) = (t.site, cycles_of(t)) else { return };
    let part = if matches!(t.basis.shape, Shape::Sine { .. }) { "sine" } else { "cosine" };
    (t.name, t.effect) = (wave_name(part, cycles, joint), EFFECT.id.name().to_owned());
}
