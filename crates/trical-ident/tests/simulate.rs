//! Simulated recordings agree with the model that they came from, and scatter as they were told to.

use trical_ident::fit::residuals::position_errors;
use trical_ident::{Aim, Dataset, JointSource, Scatter, simulate};
use trical_model::{Cell, Forward, MAX_JOINTS, Measured, Model, Pose, Robot, State};

fn model() -> Model {
    let robot = Robot::parse(include_str!("../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
    let cell = include_str!("../../../cells/irb120/cell.toml");
    Model::nominal(robot, Cell::parse(cell, "cell.toml").unwrap())
}

/// Poses about the balls' middle, by the model's own inverse kinematics.
fn poses(model: &Model, n: u32) -> Vec<State> {
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let down = nalgebra::Matrix3::new(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0);
    (0..n)
        .filter_map(|k| {
            let turn = trical_model::pose::rotation_zyx(0.5 * f64::from(k), 0.1 * f64::from(k % 5), 0.0);
            let at = Pose { rotation: turn * down, translation: nalgebra::Vector3::new(0.15, 0.08, 0.0) };
            trical_model::nearest_solution(&forward, &at, &State::at(&[0.0; MAX_JOINTS]), &mut ws).ok()
        })
        .map(|q| State::at(&q))
        .collect()
}

fn errors(model: &Model, rows: &[(State, Aim)], scatter: &Scatter, stop: Option<f64>) -> Vec<f64> {
    let recording = simulate(model, rows, scatter, stop).unwrap();
    let data = Dataset::build(&[recording], JointSource::Read, None).unwrap();
    let framed = Model { frames: vec![Pose::identity(); data.frames()], ..model.clone() };
    position_errors(&Forward::new(framed, Vec::new()).unwrap(), &data)
}

#[test]
fn without_noise_every_kind_of_measurement_agrees_with_the_model() {
    let mut model = model();
    model.cell.anchors = vec![nalgebra::Vector3::new(0.7, 0.2, 0.1)];
    let states = poses(&model, 20);
    assert!(states.len() > 10, "{}", states.len());
    let none = Scatter { length: 0.0, angle: 0.0, seed: 1 };
    for aim in [Aim::Ball(1), Aim::Target(0), Aim::Pose, Aim::Anchor(0)] {
        let rows: Vec<_> = states.iter().map(|s| (*s, aim)).collect();
        let worst = errors(&model, &rows, &none, None).into_iter().fold(0.0, f64::max);
        assert!(worst < 1e-9, "{aim:?}: {worst}");
    }
}

#[test]
fn noise_is_as_large_as_it_was_told_and_comes_back_by_its_seed() {
    let model = model();
    let states = poses(&model, 400);
    let rows: Vec<_> = states.iter().map(|s| (*s, Aim::Target(0))).collect();
    let noisy = |seed| Scatter { length: 1e-4, angle: 0.0, seed };
    let e = errors(&model, &rows, &noisy(1), None);
    let rms = (e.iter().map(|e| e * e).sum::<f64>() / e.len() as f64).sqrt();
    // three axes; 2 to 3 % standard error for several hundred poses
    assert!((rms / (1e-4 * 3.0_f64.sqrt()) - 1.0).abs() < 0.1, "{rms}");
    assert_eq!(e, errors(&model, &rows, &noisy(1), None));
    assert_ne!(e, errors(&model, &rows, &noisy(2), None));
}

#[test]
fn an_arm_that_is_moved_onto_a_ball_stops_within_what_was_told() {
    let model = model();
    let rows: Vec<_> = poses(&model, 30).iter().map(|s| (*s, Aim::Ball(0))).collect();
    let none = Scatter { length: 0.0, angle: 0.0, seed: 1 };
    let recording = simulate(&model, &rows, &none, Some(2e-5)).unwrap();
    let mut largest = 0.0_f64;
    for row in &recording.rows {
        let Measured::Touch { ball: 0, reading } = row.measured else { panic!("a touch of ball 1") };
        largest = reading.iter().fold(largest, |m, x| m.max(x.abs()));
    }
    assert!(largest > 1e-5 && largest < 2e-5 * 3.0_f64.sqrt(), "{largest}");
}

#[test]
fn what_the_cell_does_not_have_is_named() {
    let e = simulate(
        &model(),
        &[(State::at(&[0.0; 6]), Aim::Ball(6))],
        &Scatter { length: 0.0, angle: 0.0, seed: 1 },
        None,
    );
    assert!(e.unwrap_err().to_string().contains("row 0: ball 7 was measured, but the cell has 3"));
}
