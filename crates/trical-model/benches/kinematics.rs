//! Forward position, and position with its Jacobian, of a 6R arm: `cargo bench -p trical-model`.
#![allow(clippy::disallowed_methods, clippy::unwrap_used, missing_docs)]

use divan::{Bencher, black_box};
use trical_model::{Basis, Cell, Forward, Measured, Model, Motion, Parameter, Robot, Shape, Site, State, Term};

const ROBOT: &str = include_str!("../tests/data/arm.toml");
const CELL: &str = include_str!("../tests/data/cell.toml");

fn main() {
    divan::main();
}

fn nominal() -> Model {
    Model::nominal(Robot::parse(ROBOT, "arm.toml").unwrap(), Cell::parse(CELL, "cell.toml").unwrap())
}

/// The paper's 31 parameters.
fn paper() -> Model {
    let mut model = nominal();
    let mut add = |site, basis| model.terms.push(Term::new("t", "t", site, basis));
    for m in Motion::ALL {
        add(Site::Base(m), Basis::CONSTANT);
    }
    for m in Motion::ALL.iter().take(3) {
        add(Site::Tool(*m), Basis::CONSTANT);
    }
    for link in 1..=5 {
        add(Site::Link { link, parameter: Parameter::Alpha }, Basis::CONSTANT);
        add(Site::Link { link, parameter: Parameter::A }, Basis::CONSTANT);
    }
    for link in 3..=5 {
        add(Site::Link { link, parameter: Parameter::D }, Basis::CONSTANT);
    }
    for link in 2..=5 {
        add(Site::Link { link, parameter: Parameter::Theta }, Basis::CONSTANT);
    }
    for joint in 2..=6 {
        add(Site::Joint { joint }, Basis::torque(joint, Shape::Linear));
    }
    for (k, t) in model.terms.iter_mut().enumerate() {
        t.value = 1e-4 * f64::from(u32::try_from(k).unwrap());
    }
    model
}

fn states() -> Vec<State> {
    (0..64)
        .map(|k| {
            let q: Vec<f64> = (0..6).map(|j| (f64::from(k) * 0.37 + f64::from(j)).sin() * 1.5).collect();
            State::at(&q)
        })
        .collect()
}

#[divan::bench]
fn forward_position_of_the_nominal_arm(bencher: Bencher) {
    let forward = Forward::new(nominal(), vec![]).unwrap();
    let mut ws = forward.workspace();
    let states = states();
    let mut k = 0;
    bencher.bench_local(move || {
        k = (k + 1) % states.len();
        forward.world_from_tool(black_box(&states[k]), &mut ws).translation
    });
}

#[divan::bench]
fn forward_position_with_31_parameters(bencher: Bencher) {
    let forward = Forward::new(paper(), vec![]).unwrap();
    let mut ws = forward.workspace();
    let states = states();
    let mut k = 0;
    bencher.bench_local(move || {
        k = (k + 1) % states.len();
        forward.world_from_tool(black_box(&states[k]), &mut ws).translation
    });
}

#[divan::bench]
fn position_with_3_x_31_jacobian_compliance_included(bencher: Bencher) {
    let model = paper();
    let p = model.terms.len();
    let forward = Forward::new(model, (0..p).collect()).unwrap();
    let mut ws = forward.workspace();
    let mut jacobian = vec![0.0; 6 * p];
    let states = states();
    let touch = Measured::Touch { ball: 0, reading: [1e-5, 0.0, 2e-5] };
    let mut k = 0;
    bencher.bench_local(move || {
        k = (k + 1) % states.len();
        forward.linearize(black_box(&states[k]), &touch, 0, &mut ws, &mut jacobian);
        jacobian[0]
    });
}
