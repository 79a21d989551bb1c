//! The effects, one file each: what the mechanism does, which terms it would add to the model, where, how large it usually is,
//! and what it is easily taken for. A new effect is a new file, and a line in [`crate::effect_id`].
//!
//! D is what an effect adds to the angle of joint j; d_j is the sense of its last motion; tau_j the gravity torque about its
//! axis, M_perp the moment across it; dT the temperature rise, t the time. All are linear in their coefficients; shapes are
//! scanned. Each term's derivative is analytic: that of its basis times that of its site (see `trical_model::term`).

mod effect;

pub use effect::{CoefficientWords, Effect, Family, Remedy};
pub use encoder_error::further_wave;
pub use gear_ripple::{log_prior as ripple_log_prior, ripple};
pub use trical_model::Scope;

use crate::effect_id::{EffectId, for_each_effect};

macro_rules! declare_effects {
    ($($name:ident $id:ident,)+) => {
        $(pub(crate) mod $name;)+

        /// All of them.
        pub const EFFECTS: [&Effect; EffectId::ALL.len()] = [$(&$name::EFFECT),+];
    };
}
for_each_effect!(declare_effects);

impl EffectId {
    /// What is known of it.
    #[must_use]
    pub fn effect(self) -> &'static Effect {
        EFFECTS[self as usize]
    }
}

/// Coefficients of curves of `locators` that got the name of an effect.
const OF_CURVES: [CoefficientWords; 3] = [
    ("growth", "error where it is largest", ""),
    ("step", "error beyond the step", ""),
    ("local", "error where it is largest", ""),
];

/// What a coefficient of a finding is, in words: "half_gap_3" is "half of the gap", "tool_shift_x_2" the "jump along x".
#[must_use]
pub fn coefficient(name: &str) -> String {
    let told =
        EFFECTS.iter().flat_map(|e| e.coefficients).chain(&OF_CURVES).filter(|(begins, ..)| name.starts_with(begins));
    let Some((_, words, to_axis)) = told.max_by_key(|(begins, ..)| begins.len()) else {
        return name.replace('_', " ");
    };
    let bare = name.trim_end_matches(|c: char| c == '_' || c.is_ascii_digit());
    let axis = bare.rsplit('_').next().unwrap_or_default();
    match (axis.len(), axis.strip_prefix('r').unwrap_or(axis)) {
        (1, axis @ ("x" | "y" | "z")) if !to_axis.is_empty() => format!("{words} {to_axis} {axis}"),
        (2, axis @ ("x" | "y" | "z")) => format!("{words} about {axis}"),
        _ => (*words).to_owned(),
    }
}

#[cfg(test)]
mod tests;
