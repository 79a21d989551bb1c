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

/// What a coefficient of a finding is, in words: "half_gap_3" is "half of the gap", "tool_shift_x_2" the "jump along x".
#[must_use]
pub fn coefficient(name: &str) -> String {
    let told = EFFECTS.iter().flat_map(|e| e.coefficients).filter(|(begins, ..)| name.starts_with(begins));
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
mod tests {
    use super::*;
    use crate::covariates::Covariates;
    use crate::test_data::{arm, states};
    use trical_model::{JointKind, MAX_JOINTS, Place, State};

    #[test]
    fn every_file_has_its_own_identifier_and_says_something() {
        for (effect, id) in EFFECTS.into_iter().zip(EffectId::ALL) {
            assert_eq!(effect.id, id);
            assert_eq!(EffectId::named(id.name()), Some(id));
            assert!(!effect.title.is_empty() && effect.action.ends_with('.'), "{id}");
            // whoever asks has a name of their own for it
            assert!(!effect.remedy.words().contains("--"), "{id}");
        }
    }

    #[test]
    fn coefficients_are_said_in_words() {
        for (name, words) in [
            ("half_gap_gravity_3", "half of the gap"),
            ("tool_shift_x_2", "jump along x"),
            ("frame_drift_rz", "drift about z"),
            ("ball_2_y", "place along y"),
            ("rail_turn_z", "turn of the carriage from end to end about z"),
            ("coupling_5_from_4", "coupling factor"),
            ("friction_by_load_2", "wind-up for each Nm of load"),
            ("payload_mass", "mass beyond that in cell.toml"),
            ("indicator_drift_x", "drift"),
            ("new_one_4", "new one 4"),
        ] {
            assert_eq!(coefficient(name), words);
        }
    }

    #[test]
    fn every_coefficient_begins_as_one_of_its_effects_words_and_no_words_are_left_over() {
        let mut model = arm();
        let moved = |k: f64| {
            let mut q = [0.0; MAX_JOINTS];
            q[..6].fill((0.7 * k).sin());
            let sense = if (0.7 * k).cos() > 0.0 { 1 } else { -1 };
            let q_commanded = Some(q.map(|q| q + 1e-3 * f64::from(sense)));
            State { dir: Some([sense; MAX_JOINTS]), q_commanded, t: Some(60.0 * k), ..State::at(&q) }
        };
        let data = states(900, moved);
        let mut used = std::collections::BTreeSet::<&CoefficientWords>::new();
        for kind in [JointKind::Revolute, JointKind::Prismatic] {
            model.robot.joints[0].kind = kind;
            let recorded = Covariates::new(&model, &data, 1e-5).deflected(true);
            for effect in EFFECTS {
                for term in (effect.ask)(&recorded).candidates.iter().flat_map(|c| &c.terms) {
                    let word = effect.coefficients.iter().find(|(begins, ..)| term.name.starts_with(begins));
                    assert_eq!(word.is_none(), term.basis.shape.cycles().is_some(), "{}", term.name);
                    used.extend(word);
                }
            }
        }
        // frames are of optical instruments
        for word in EFFECTS.iter().filter(|e| e.id != EffectId::FrameDrift).flat_map(|e| e.coefficients) {
            assert!(used.contains(word), "{word:?}");
        }
    }

    /// What is asked of joint 1 of an arm of six joints, without time: effect and how it is told.
    fn asked_of_joint_1(kind: JointKind) -> Vec<(EffectId, String)> {
        let mut model = arm();
        model.robot.joints[0].kind = kind;
        let senses = |k: f64| State { dir: Some([if k > 9.0 { 1 } else { -1 }; MAX_JOINTS]), ..State::at(&[0.1 * k]) };
        let data = states(900, senses);
        let recorded = Covariates::new(&model, &data, 1e-5);
        let asked = EFFECTS.into_iter().flat_map(|e| (e.ask)(&recorded).candidates.into_iter().map(|c| (e.id, c)));
        asked.filter(|(_, c)| c.site == Place::Joint(1)).map(|(id, c)| (id, c.behaviour)).collect()
    }

    #[test]
    fn a_sliding_joint_is_asked_for_nothing_that_only_a_turning_one_has() {
        let (turns, slides) = (asked_of_joint_1(JointKind::Revolute), asked_of_joint_1(JointKind::Prismatic));
        let has = |asked: &[(EffectId, String)], id| asked.iter().any(|(a, _)| *a == id);
        for id in [
            EffectId::AxisWobble,
            EffectId::EncoderError,
            EffectId::JointHarmonic,
            EffectId::LoadFriction,
            EffectId::LostMotionGravity,
            EffectId::NonlinearStiffness,
        ] {
            assert!(has(&turns, id) && !has(&slides, id), "{id}");
        }
        for id in [EffectId::GearRatio, EffectId::LostMotionDirection, EffectId::RailError] {
            assert!(has(&slides, id), "{id}");
        }
        for (id, behaviour) in &slides {
            assert!(
                !["angle", "turn of", "a turn", "torque"].iter().any(|word| behaviour.contains(word)),
                "{id}: {behaviour}"
            );
        }
    }

    #[test]
    fn on_a_rail_couplings_are_asked_with_the_rail_counted_and_without() {
        let pairs = |kind| {
            let mut model = arm();
            model.robot.joints[0].kind = kind;
            let data = states(9, |k| State::at(&[0.1 * k]));
            let asked = (EffectId::JointCoupling.effect().ask)(&Covariates::new(&model, &data, 1e-5));
            asked.candidates.into_iter().map(|c| c.site).collect::<Vec<_>>()
        };
        let of = |pairs: &[(usize, usize)]| {
            pairs.iter().map(|(joint, from)| Place::Coupling { joint: *joint, from: *from }).collect::<Vec<_>>()
        };
        assert_eq!(pairs(JointKind::Revolute), of(&[(3, 2), (5, 4), (6, 4), (6, 5)]));
        assert_eq!(pairs(JointKind::Prismatic), of(&[(3, 2), (4, 3), (5, 4), (6, 4), (6, 5)]));
    }
}
