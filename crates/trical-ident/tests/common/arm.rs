//! Arms whose truth is known, and touches of them.
#![allow(dead_code)]

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_ident::fit::identifiability::independent_terms;
use trical_ident::{Choice, Dataset, JointSource, ParameterSet};
use trical_model::{Cell, Forward, MAX_JOINTS, Measured, Model, Pose, Recording, Robot, Row, Site, State, Term};

const ROBOT: &str = include_str!("../../../trical-model/tests/data/arm.toml");
const CELL: &str = include_str!("../../../trical-model/tests/data/cell.toml");

pub fn nominal() -> Model {
    Model::nominal(Robot::parse(ROBOT, "arm.toml").unwrap(), Cell::parse(CELL, "cell.toml").unwrap())
}

pub fn rows(measured: impl Fn(usize) -> Measured, n: usize) -> Recording {
    let rows = (0..n)
        .map(|k| Row { state: State::at(&[0.0; MAX_JOINTS]), measured: measured(k), seq: None, line: k + 2 })
        .collect();
    Recording { name: "made".into(), joints: 6, rows, ..Recording::default() }
}

pub fn touches_of(n: usize) -> Dataset {
    let r = rows(|k| Measured::Touch { ball: k % 3, reading: [0.0; 3] }, n);
    Dataset::build(&[r], JointSource::Read, None).unwrap()
}

pub fn paper_terms(set: ParameterSet) -> Vec<Term> {
    independent_terms(&nominal(), &touches_of(3), &Choice::from(set)).unwrap().0
}

/// A true arm: every parameter of `set` off by chance.
pub fn truth(set: ParameterSet, seed: u64) -> Model {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut model = nominal();
    model.terms = paper_terms(set);
    for t in &mut model.terms {
        let size = match t.effect.as_str() {
            "compliance" => 2e-4,
            _ => 2e-3,
        };
        t.value = rng.random_range(-size..size);
        if t.effect == "compliance" {
            t.value = t.value.abs();
        }
    }
    model
}

/// Touches of the true arm: joints found so that the TCP is within a millimetre of a ball; the reading says how far.
pub fn touch(model: &Model, count: usize, noise: f64, seed: u64) -> Recording {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let normal = rand_distr::Normal::new(0.0, 1.0).unwrap();
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let (mut ws, mut rows, mut k) = (forward.workspace(), Vec::new(), 0);
    while rows.len() < count {
        k += 1;
        let ball = rows.len() % model.cell.balls.len();
        let turn = trical_model::pose::rotation_z(rng.random_range(-3.0..3.0))
            * trical_model::pose::rotation_x(3.1 + rng.random_range(-0.9..0.9))
            * trical_model::pose::rotation_z(rng.random_range(-3.0..3.0));
        let off = nalgebra::Vector3::from_fn(|_, _| rng.random_range(-5e-4..5e-4));
        let at = Pose { rotation: turn, translation: model.cell.balls[ball] + off };
        let mut state = State::at(&[0.0; MAX_JOINTS]);
        state.dir = Some(std::array::from_fn(|_| if rng.random_range(0..2) == 0 { -1 } else { 1 }));
        state.t = Some(20.0 * f64::from(k));
        state.temp_c = Some(22.0 + rng.random_range(0.0..3.0));
        let Ok(all) = trical_model::ik::inverse_kinematics(&forward, &at, &state, &mut ws) else { continue };
        state.q = all[rng.random_range(0..all.len())].joints;
        // the touch says FK + R i = ball: i from the true pose
        let pose = forward.world_from_tool(&state, &mut ws);
        let i = pose.rotation.transpose() * (model.cell.balls[ball] - pose.translation);
        let reading = std::array::from_fn(|a| i[a] + noise * rand_distr::Distribution::sample(&normal, &mut rng));
        rows.push(Row { state, measured: Measured::Touch { ball, reading }, seq: None, line: rows.len() + 2 });
    }
    Recording { name: "touches".into(), joints: 6, rows, ..Recording::default() }
}

/// Where a set of balls stood, in {w}: height, turn and tilt differ.
fn stood(place: usize) -> Pose {
    let k = [
        [0.35, -0.2, 0.1, 0.4, 0.0],
        [0.3, 0.25, 0.3, -0.9, 0.3],
        [0.1, 0.4, 0.05, 2.1, -0.2],
        [0.4, 0.0, 0.45, 1.2, 0.5],
        [0.2, -0.35, 0.2, 2.8, 0.25],
    ];
    let [x, y, z, turn, tilt] = k[place];
    Pose { rotation: trical_model::pose::rotation_zyx(turn, tilt, 0.1), translation: nalgebra::Vector3::new(x, y, z) }
}

/// Touches by the true arm, which then stands where `cell` has its base, of the balls of `cell`, forty at each of the named places.
pub fn touch_in_sockets(truth: &mut Model, cell: &Cell, places: &[usize], noise: f64, seed: u64) -> Recording {
    truth.terms.retain(|t| !matches!(t.site, Site::Base(_)));
    truth.cell.world_from_base = cell.world_from_base;
    let mut all = Recording { name: format!("sockets{seed}.csv"), joints: 6, ..Recording::default() };
    for (k, place) in places.iter().enumerate() {
        let mut here = truth.clone();
        here.cell.balls = cell.balls.iter().map(|b| stood(*place).apply(b)).collect();
        let mut rows = touch(&here, 40, noise, seed + *place as u64).rows;
        // one socket after the other, as by hand
        rows.sort_by_key(|r| matches!(r.measured, Measured::Touch { ball, .. } if ball > 0));
        for r in &mut rows {
            r.state.place = Some(k);
            r.line = all.rows.len() + 2;
            all.rows.push(*r);
        }
        all.places.push(format!("place {place}"));
    }
    all
}

pub fn build(r: Recording) -> Dataset {
    Dataset::build(&[r], JointSource::Read, None).unwrap()
}
