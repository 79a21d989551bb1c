//! Slopes of basis functions against central differences, on both sides of every kink; whole turns of a joint whose error
//! goes on with them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use trical_model::{Basis, Cell, Forward, Model, Robot, Shape, Site, State, Term, Variable, inverse_kinematics};

#[test]
fn slopes_are_those_of_the_values() {
    let shapes = [
        Shape::One,
        Shape::Linear,
        Shape::Absolute,
        Shape::SignedSquare,
        Shape::Cube,
        Shape::SoftSign { scale: 0.4 },
        Shape::Clip { at: 0.4 },
        Shape::Sine { cycles: 3.0 },
        Shape::Cosine { cycles: 2.0 },
        Shape::Step { at: 0.1 },
        Shape::Hinge { at: 0.1 },
        Shape::WarmUp { constant: 0.7 },
        Shape::Tent { left: -0.6, centre: 0.2, right: 0.9 },
        Shape::Tent { left: f64::NEG_INFINITY, centre: 0.2, right: 0.9 },
        Shape::Tent { left: -0.6, centre: 0.2, right: f64::INFINITY },
        Shape::Growth { from: -0.3, to: 0.9 },
        Shape::Growth { from: 0.4, to: -0.9 },
    ];
    for shape in shapes {
        shape.check().unwrap();
        // no kink lies within the step of these
        for u in [-1.31, -0.45, -0.07, 0.05, 0.15, 0.31, 0.77, 1.42] {
            let difference = (shape.at(u + 1e-6).0 - shape.at(u - 1e-6).0) / 2e-6;
            let slope = shape.at(u).1;
            assert!((slope - difference).abs() < 1e-7, "{shape:?} at {u}: {slope}, {difference}");
        }
    }
    for broken in [
        Shape::SoftSign { scale: 0.0 },
        Shape::Clip { at: -0.4 },
        Shape::WarmUp { constant: -1.0 },
        Shape::Sine { cycles: f64::NAN },
        Shape::Tent { left: 0.5, centre: 0.2, right: 0.9 },
        Shape::Growth { from: 0.2, to: 0.2 },
    ] {
        assert!(broken.check().is_err(), "{broken:?}");
    }
}

/// A wrong gear ratio adds more with every turn: each turn of joint 6 is another solution, not the same one again.
#[test]
fn every_whole_turn_is_solved_for_itself() {
    let mut robot = Robot::parse(include_str!("data/arm.toml"), "arm.toml").unwrap();
    robot.joints[5].limits = [-10.0, 10.0];
    let mut model = Model::nominal(robot, Cell::bare());
    let basis = Basis::new(Variable::Joint { joint: 6 }, Shape::Linear);
    model.terms.push(Term { value: 1e-3, ..Term::new("gear", "gear_ratio", Site::Joint { joint: 6 }, basis) });
    let forward = Forward::new(model, Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let state = State::at(&[0.3, 0.2, -0.4, 0.5, 0.7, 0.6]);
    let goal = forward.world_from_tool(&state, &mut ws);
    let all = inverse_kinematics(&forward, &goal, &state, &mut ws).unwrap();
    let turns = all.iter().filter(|s| s.branch == all[0].branch).count();
    assert!(turns >= 3, "{turns} turns of joint 6 lie within its limits");
    for s in &all {
        let reached = forward.world_from_tool(&State { q: s.joints, ..state }, &mut ws);
        let off = (reached.translation - goal.translation).norm() + (reached.rotation - goal.rotation).amax();
        assert!(off < 1e-9, "joints {:?} are {off} off", s.joints);
    }
}
