//! An indicator that does not follow the arm is told, and one that follows is not.

use crate::arm::{nominal, touch, truth};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_ident::calibration::{Options, calibrate};
use trical_ident::fit::stuck_stems::refuse_stuck_stems;
use trical_ident::{Dataset, JointSource, ParameterSet};
use trical_model::ik::continue_from;
use trical_model::touch::reading_at;
use trical_model::{Forward, Measured, Model, Pose, Recording, Task};

/// Touches as they are closed in on with a stem that is stuck: the other two are nulled, this one reads 3 to 5 um wherever it is.
fn touched_with(truth: &Model, stuck: Option<usize>, count: usize, seed: u64) -> Recording {
    let mut recording = touch(truth, count, 0.0, seed);
    let forward = Forward::new(truth.clone(), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    for row in &mut recording.rows {
        let Measured::Touch { ball, reading } = &mut row.measured else { continue };
        let left: [f64; 3] = std::array::from_fn(|_| rng.random_range(-1e-5..1e-5));
        let move_by = nalgebra::Vector3::from_fn(|k, _| if Some(k) == stuck { 0.0 } else { reading[k] - left[k] });
        let at = forward.world_from_tool(&row.state, &mut ws);
        let to = Pose { rotation: at.rotation, translation: at.translation + at.rotation * move_by };
        row.state.q = continue_from(&forward, &to, &row.state, &mut ws).unwrap();
        *reading = reading_at(&forward, &row.state, *ball, &mut ws).map(|r| r + rng.random_range(-4e-6..4e-6));
        if let Some(axis) = stuck {
            reading[axis] = rng.random_range(3e-6..5e-6);
        }
    }
    recording
}

fn says(recording: Recording) -> Option<String> {
    let nominal = nominal();
    let data = Dataset::build(&[recording], JointSource::Read, None).unwrap();
    refuse_stuck_stems(&nominal.robot, &nominal.cell, &data).err().map(|e| e.to_string())
}

#[test]
fn a_stem_that_does_not_follow_is_named() {
    for seed in 1..=4 {
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let recording = touched_with(&truth(ParameterSet::Compliance, seed), Some(axis), 45, seed);
            let said = says(recording).unwrap_or_default();
            assert!(
                said.contains(&format!("touches: indicator {name} does not follow: its 45 readings")),
                "{seed}: {said}"
            );
            assert!(said.len() < 400, "{said}");
        }
    }
}

#[test]
fn stems_that_follow_are_not_doubted() {
    for seed in 1..=4 {
        let truth = truth(ParameterSet::Compliance, seed);
        assert_eq!(says(touched_with(&truth, None, 45, seed)), None);
        // not nulled at all
        assert_eq!(says(touch(&truth, 45, 1e-5, seed)), None);
        // a stem that is nulled ten times better than the others follows all the same
        let mut fine = touched_with(&truth, None, 45, seed);
        let forward = Forward::new(truth.clone(), Vec::new()).unwrap();
        let mut ws = forward.workspace();
        for row in &mut fine.rows {
            let Measured::Touch { ball, reading } = &mut row.measured else { continue };
            let at = forward.world_from_tool(&row.state, &mut ws);
            let by = at.rotation * nalgebra::Vector3::new(reading[0] * 0.9, 0.0, 0.0);
            let to = Pose { rotation: at.rotation, translation: at.translation + by };
            row.state.q = continue_from(&forward, &to, &row.state, &mut ws).unwrap();
            *reading = reading_at(&forward, &row.state, *ball, &mut ws);
        }
        assert_eq!(says(fine), None);
    }
}

#[test]
fn nothing_is_identified_of_it() {
    let nominal = nominal();
    let recording = touched_with(&truth(ParameterSet::Compliance, 1), Some(0), 45, 1);
    let options = Options::new(ParameterSet::Compliance);
    let error = calibrate(&nominal.robot, &nominal.cell, &[recording], &options, &Task::silent()).unwrap_err();
    assert!(error.to_string().contains("indicator x does not follow"), "{error}");
}
