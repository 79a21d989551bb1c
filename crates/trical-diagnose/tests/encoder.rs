//! An encoder's curve is learnt over the part of a turn that a joint has, and holds on another day.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_diagnose::{EffectId, Options, diagnose};
use trical_ident::{Aim, Dataset, JointSource, ModelFile, ParameterSet, Refit, Scatter, simulate, validate};
use trical_model::pose::rotation_zyx;
use trical_model::{Basis, Model, Place, Pose, Recording, Shape, Site, State, Task, Term, Variable};

/// Standard deviation of each coordinate, m, and the mean length of a vector whose three coordinates have that, mm.
const NOISE: f64 = 1e-5;
const LEAST_MM: f64 = 1.6e-2;

/// An arm whose joint 2 reads its angle with a curve of five waves, 0.1 deg from end to end.
fn truth() -> Model {
    let mut model = crate::arm::truth(ParameterSet::Compliance, 11);
    model.cell.tool.targets = vec![Vector3::new(0.018, -0.012, 0.118)];
    for (cycles, shape, size_deg) in [
        (2.0, Shape::Sine { cycles: 2.0 }, 0.02),
        (5.0, Shape::Cosine { cycles: 5.0 }, -0.015),
        (9.0, Shape::Sine { cycles: 9.0 }, 0.01),
        (13.0, Shape::Cosine { cycles: 13.0 }, 0.008),
        (17.0, Shape::Sine { cycles: 17.0 }, -0.008),
    ] {
        let basis = Basis::new(Variable::Joint { joint: 2 }, shape);
        let mut wave = Term::new(format!("hidden_{cycles}"), "hidden", Site::Joint { joint: 2 }, basis);
        wave.value = f64::to_radians(size_deg);
        model.terms.push(wave);
    }
    model
}

/// What a tracker saw of that arm on one day.
fn seen(truth: &Model, day: u64) -> Recording {
    let mut model = truth.clone();
    let d = day as f64;
    model.frames =
        vec![Pose { rotation: rotation_zyx(0.7 * d, 0.2, -0.1 * d), translation: Vector3::new(2.0 - d, 0.5 * d, 0.3) }];
    let mut rng = Pcg64Mcg::seed_from_u64(day);
    let rows: Vec<(State, Aim)> = (0..320)
        .map(|_| {
            let within = |j: &trical_model::Joint| rng.random_range(j.limits[0].max(-1.4)..j.limits[1].min(1.4));
            let q: Vec<f64> = model.robot.joints.iter().map(within).collect();
            (State::at(&q), Aim::Target(0))
        })
        .collect();
    let scatter = Scatter { length: NOISE, angle: 0.0, seed: 100 + day };
    Recording { name: format!("day{day}.csv"), ..simulate(&model, &rows, &scatter, None).unwrap() }
}

#[test]
fn a_curve_over_part_of_a_turn_holds_on_another_day() {
    let truth = truth();
    let data = Dataset::build(&[seen(&truth, 1)], JointSource::Read, None).unwrap();
    let d = diagnose(&truth.robot, &truth.cell, &data, &Options::default(), &Task::silent()).unwrap();
    let first = d.findings.first().expect("something is found");
    assert_eq!((first.effect, first.site), (EffectId::EncoderError, Place::Joint(2)), "{:?}", d.findings);
    // held out on the day, and on another one
    assert!(d.after.holdout_mean_mm < 1.4 * LEAST_MM, "{}", d.after.holdout_mean_mm);
    let other = seen(&truth, 2);
    let error = |model: &Model| {
        let file = ModelFile::of(model.clone(), &d.data);
        validate(&truth.robot, &truth.cell, &file, std::slice::from_ref(&other), None, Some(Refit::ALL))
            .unwrap()
            .after
            .mean_mm
    };
    let (with, without) = (error(&d.model), error(&d.before));
    assert!(with < 1.4 * LEAST_MM && with < 0.5 * without, "{with} mm, without the curve {without} mm");
}
