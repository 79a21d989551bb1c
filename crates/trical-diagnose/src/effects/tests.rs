//! What effects say and ask; `physics.rs` has what their terms do.
#![allow(clippy::unwrap_used, clippy::panic)]

mod physics;

use trical_ident::Dataset;
use trical_ident::dataset::Observation;
use trical_model::{Axis, JointKind, MAX_JOINTS, Measured, Model, Place, State};

use self::physics::{points, touches, without};
use super::*;
use crate::covariates::Covariates;
use crate::test_data::{arm, states};

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
        ("growth_5_by_q4", "error where it is largest"),
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
fn an_effect_is_asked_for_only_where_what_it_needs_was_recorded() {
    use EffectId as Id;
    // an arm on a rail that touches balls can be asked for all but the drift of a tracker's frame
    let (model, data) = (points().0, touches().1);
    let with_all = Covariates::new(&model, &data, 1e-5);
    let check = |(model, data): (Model, Dataset), lacking: &[(&[Id], &str)]| {
        let r = Covariates::new(&model, &data, 1e-5);
        for effect in EFFECTS {
            let (asked, before) = ((effect.ask)(&r), (effect.ask)(&with_all));
            let (id, is_asked, lacks) = (effect.id, !asked.candidates.is_empty(), asked.lacks.unwrap_or_default());
            match lacking.iter().find(|l| l.0.contains(&id)) {
                Some((_, "")) => assert!(!is_asked && lacks.is_empty(), "{id}: {lacks}"),
                Some((_, words)) => assert!(!is_asked && lacks.contains(words), "{id}: {lacks}"),
                None => assert!((is_asked || before.candidates.is_empty()) && lacks.is_empty(), "{id}: {lacks}"),
            }
        }
    };
    let but = |forget| (model.clone(), without(data.clone(), forget));
    let of = |change: fn(&mut Model)| {
        let mut model = model.clone();
        change(&mut model);
        (model, data.clone())
    };
    let first = |rows| (model.clone(), data.filtered(|o| o.row <= rows));

    let late = [Id::LateJointReading];
    check(
        but(|o| o.state.dir = None),
        &[(&[Id::LostMotionDirection, Id::LoadFriction], "(dir1 ...)"), (&late, "had settled")],
    );
    check(but(|o| o.state.q_commanded = None), &[(&late, "(qc1_deg ...)")]);
    check(but(|o| o.state.q_commanded = Some(o.state.q)), &[(&late, "(qc1_deg ...)")]);

    let by_torque = [Id::LostMotionGravity, Id::LoadFriction, Id::NonlinearStiffness, Id::CrossAxisCompliance];
    let by_load = [Id::Payload, Id::GravityDirection];
    check(of(|m| m.robot.joints[4].mass = None), &[(&by_torque, "masses"), (&by_load, "masses")]);

    let steps = [Id::JointZeroShift, Id::FixtureShift, Id::ToolShift];
    let drifts = [Id::FixtureDrift, Id::ToolDrift, Id::FrameDrift, Id::IndicatorDrift];
    let in_time = [(&steps[..], "time (t_s)"), (&drifts, "time (t_s)")];
    check(but(|o| (o.state.t, o.state.seq) = (None, None)), &in_time);
    let heat = [Id::ThermalGrowth, Id::ThermalZeroDrift];
    let without_any = but(|o| (o.state.t, o.state.seq, o.state.temp_c) = (None, None, None));
    check(without_any, &[in_time[0], in_time[1], (&heat, "temperature (temp_c) or time (t_s)")]);
    // their numbers tell earlier from later
    check(but(|o| (o.state.t, o.state.temp_c) = (None, None)), &[]);

    check(first(71), &[(&[Id::EncoderError], "72")]);
    check(first(72), &[]);

    let nulled = but(|o| o.measured = Measured::Touch { ball: 0, reading: [0.0; 3] });
    check(nulled, &[(&[Id::IndicatorGain], "readings with a spread")]);
    check(of(|m| m.robot.joints[0].limits[1] = f64::INFINITY), &[(&[Id::RailError], "limits of the rail")]);

    // nothing lacks that an owner could record: it is another arm, or another instrument
    check(of(|m| m.robot.joints[0].kind = JointKind::Revolute), &[(&[Id::RailError], "")]);
    let gauge = [Id::BallPosition, Id::IndicatorGain, Id::IndicatorSkew, Id::IndicatorDrift];
    check(points(), &[(&[Id::FixtureShift, Id::FixtureDrift], ""), (&gauge, "")]);
}

#[test]
fn a_gain_is_asked_of_the_indicators_that_were_deflected() {
    let (model, data) = touches();
    let only_y = |o: &mut Observation| {
        if let Measured::Touch { reading, .. } = &mut o.measured {
            (reading[0], reading[2]) = (0.0, 0.0);
        }
    };
    let data = without(data, only_y);
    let asked = (EffectId::IndicatorGain.effect().ask)(&Covariates::new(&model, &data, 1e-5));
    assert!(asked.candidates.iter().map(|c| c.site).eq([Place::Axis(Axis::Y)]) && asked.lacks.is_some());
}
