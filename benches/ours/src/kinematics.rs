//! Forward kinematics, Jacobians, inverse kinematics.

use trical_ident::{Choice, ParameterSet};
use trical_model::{Forward, Measured, Pose, State, inverse_kinematics, nearest_solution};

use crate::{Task, report, time};

pub fn run(task: &Task) {
    let nominal = task.nominal("cell.toml");
    let forward = Forward::new(nominal.clone(), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let states: Vec<State> = task.joints().iter().map(|q| State::at(q)).collect();
    let n = states.len();
    if task.wants("forward kinematics") {
        let t = time(9, |k| forward.world_from_tool(&states[k % n], &mut ws));
        report("forward kinematics", "TriCal, Rust", t, "");
    }
    if task.wants("Jacobian") {
        let mut jacobian = [0.0; 36];
        let t = time(9, |k| {
            forward.joint_jacobian(&states[k % n], &mut ws, &mut jacobian);
            jacobian[0]
        });
        report("Jacobian", "TriCal, Rust", t, "");
    }
    for (row, set) in [
        ("parameter Jacobian", ParameterSet::Geometry),
        ("parameter Jacobian with compliance", ParameterSet::Compliance),
    ] {
        if !task.wants(row) {
            continue;
        }
        let data = crate::identification::load(task, "rigid_touches.csv");
        let mut model = nominal.clone();
        model.terms =
            trical_ident::fit::identifiability::independent_terms(&model, &data, &Choice::from(set)).unwrap().0;
        let p = model.terms.len();
        let forward = Forward::new(model, (0..p).collect()).unwrap();
        let (mut ws, mut jacobian) = (forward.workspace(), vec![0.0; 3 * p]);
        let touch = Measured::Touch { ball: 0, reading: [0.0; 3] };
        let t = time(9, |k| {
            forward.linearize(&states[k % n], &touch, 0, &mut ws, &mut jacobian);
            jacobian[0]
        });
        report(row, "TriCal, Rust", t, &format!("3 x {p}"));
    }
    if task.wants("inverse kinematics") {
        inverse(&forward, &states);
    }
}

fn inverse(forward: &Forward, states: &[State]) {
    let mut ws = forward.workspace();
    let n = states.len();
    let targets: Vec<Pose> = states.iter().map(|s| forward.world_from_tool(s, &mut ws)).collect();
    let at_zero = State::at(&[0.0; 6]);
    let (mut worst, mut found) = (0.0_f64, 0);
    for target in &targets {
        let all = inverse_kinematics(forward, target, &at_zero, &mut ws).unwrap_or_default();
        found += all.len();
        for s in &all {
            let miss = forward.world_from_tool(&State::at(&s.joints), &mut ws).translation - target.translation;
            worst = worst.max(miss.norm());
        }
    }
    let t = time(9, |k| inverse_kinematics(forward, &targets[k % n], &at_zero, &mut ws));
    #[expect(clippy::cast_precision_loss, reason = "counts")]
    let mean = found as f64 / n as f64;
    let words = format!("{mean:.2} solutions within limits, off by at most {:.0e} m", worst);
    report("inverse kinematics", "TriCal, Rust, all solutions", t, &words);

    // from 2 deg away in every joint: what a correction or a straight line needs
    let near: Vec<State> = states.iter().map(|s| State::at(&s.q.map(|q| q + 0.035)[..6])).collect();
    let worst = (0..n)
        .filter_map(|k| {
            let q = nearest_solution(forward, &targets[k], &near[k], &mut ws).ok()?;
            Some((forward.world_from_tool(&State::at(&q), &mut ws).translation - targets[k].translation).norm())
        })
        .fold(0.0, f64::max);
    let t = time(9, |k| nearest_solution(forward, &targets[k % n], &near[k % n], &mut ws));
    report("inverse kinematics, one solution from near", "TriCal, Rust", t, &format!("off by at most {worst:.0e} m"));
}
