//! Diagnoses of arms whose truth is known.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

#[path = "../../trical-ident/tests/common/arm.rs"]
mod arm;

use arm::{build, touch, truth};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use trical_diagnose::{EffectId, Options, diagnose};
use trical_ident::ParameterSet;
use trical_model::{Basis, Forward, Measured, Model, Place, Pose, Site, Task, Term};

/// The truth with one more term, which the baseline does not have.
fn with_effect(site: Site, basis: Basis, value: f64) -> Model {
    let mut model = truth(ParameterSet::Compliance, 20);
    let mut term = Term::new("hidden", "hidden", site, basis);
    term.value = value;
    model.terms.push(term);
    model
}

fn diagnosed(model: &Model, seed: u64) -> trical_diagnose::Diagnosis {
    let data = build(touch(model, 150, 8e-6, seed));
    diagnose(&model.robot, &model.cell, &data, &Options::default(), &Task::silent()).unwrap()
}

#[test]
fn hidden_backlash_is_found_at_its_joint() {
    let half_gap = 0.01_f64.to_radians();
    let d = diagnosed(&with_effect(Site::Joint { joint: 4 }, Basis::direction(4), -half_gap), 21);
    assert_eq!(d.findings.len(), 1, "{:?}", d.findings);
    let f = &d.findings[0];
    assert_eq!((f.effect, f.site), (EffectId::LostMotionDirection, Place::Joint(4)));
    assert!((f.coefficients[0].value - 0.01).abs() < 5.0 * f.coefficients[0].sd.unwrap());
    assert!(f.evidence.holdout_rms_after_mm < 0.7 * f.evidence.holdout_rms_before_mm);
    assert!(f.evidence.forward_rms_after_mm < 0.7 * f.evidence.forward_rms_before_mm);
    assert!(d.unexplained.is_none());
}

#[test]
fn a_threshold_that_has_no_name_is_located_and_not_named() {
    let at = 0.3;
    let basis = Basis::new(trical_model::Variable::Joint { joint: 4 }, trical_model::Shape::Step { at });
    let d = diagnosed(&with_effect(Site::Joint { joint: 5 }, basis, 0.03_f64.to_radians()), 22);
    let u = d.unexplained.expect("something is left without a name");
    assert_eq!((u.site, u.variable.as_str()), (Place::Joint(5), "q4"));
    assert!(d.findings.is_empty(), "{:?}", d.findings);
    assert!(u.holdout_rms_after_mm < 0.7 * u.holdout_rms_before_mm);
}

#[test]
fn where_nothing_is_hidden_nothing_is_named() {
    let mut alarms = 0;
    for seed in 0..20 {
        let d = diagnosed(&truth(ParameterSet::Compliance, 30 + seed), 60 + seed);
        alarms += u32::from(!d.findings.is_empty() || d.unexplained.is_some());
        assert!(d.baseline.lack_of_fit_p > 1e-4);
    }
    assert!(alarms <= 1, "{alarms} false alarms in 20");
}

#[test]
fn the_noise_of_nulled_readings_is_no_gain_error() {
    // the arm stands exactly on the ball, and the reading is nothing but noise
    let model = truth(ParameterSet::Compliance, 40);
    let mut recording = touch(&model, 150, 0.0, 41);
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let mut rng = Pcg64Mcg::seed_from_u64(42);
    let normal = rand_distr::Normal::new(0.0, 8e-6).unwrap();
    for row in &mut recording.rows {
        let Measured::Touch { ball, reading } = &mut row.measured else { continue };
        let pose = forward.world_from_tool(&row.state, &mut ws);
        let on = Pose { rotation: pose.rotation, translation: model.cell.balls[*ball] };
        row.state.q = trical_model::ik::continue_from(&forward, &on, &row.state, &mut ws).unwrap();
        *reading = std::array::from_fn(|_| rand_distr::Distribution::sample(&normal, &mut rng));
    }
    let d = diagnose(&model.robot, &model.cell, &build(recording), &Options::default(), &Task::silent()).unwrap();
    assert!(d.findings.is_empty(), "{:?}", d.findings);
    assert_eq!(d.baseline.reading_noise.len(), 1);
    assert!(d.blind_to.iter().any(|b| b.effect == EffectId::IndicatorGain && b.lacks.is_some()));
}
