//! The effects, one file each: what the mechanism does, which terms it would add to the model, where, how large it usually is,
//! and what it is easily taken for. A new effect is a new file, and a line in [`crate::effect_id`].
//!
//! D is what an effect adds to the angle of joint j; d_j is the sense of its last motion; tau_j the gravity torque about its
//! axis, M_perp the moment across it; dT the temperature rise, t the time. All are linear in their coefficients; shapes are
//! scanned. Each term's derivative is analytic: that of its basis times that of its site (see `trical_model::term`).

mod effect;

pub use effect::{Effect, Family, Remedy};
pub use gear_ripple::ripple;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_has_its_own_identifier_and_says_something() {
        for (effect, id) in EFFECTS.into_iter().zip(EffectId::ALL) {
            assert_eq!(effect.id, id);
            assert_eq!(EffectId::named(id.name()), Some(id));
            assert!(!effect.title.is_empty() && effect.action.ends_with('.'), "{id}");
        }
    }
}
