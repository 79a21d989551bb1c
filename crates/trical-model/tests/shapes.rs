//! Slopes of basis functions against central differences, on both sides of every kink; whole turns of a joint whose error
//! goes on with them.

use trical_model::{
    Axis, Basis, Cell, Forward, Measured, Model, Motion, Payload, Pose, Robot, Shape, Site, State, Term, Variable,
    inverse_kinematics,
};

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

/// What a term needs and a recording lacks is said before the term is asked for its value.
#[test]
fn what_a_term_needs_is_named_where_it_is_missing() {
    let joint = 2;
    let bare = State::at(&[0.1; 6]);
    let everything = State {
        t: Some(1.0),
        seq: Some(1.0),
        torques: Some([1.0; trical_model::MAX_JOINTS]),
        temp_c: Some(20.0),
        dir: Some([1; trical_model::MAX_JOINTS]),
        ..bare
    };
    let touch = Measured::Touch { ball: 0, reading: [0.0; 3] };
    let point = Measured::Point { target: 0, position: [0.0; 3] };
    let needs = [
        (Basis::new(Variable::Time, Shape::Linear), Some("time")),
        (Basis::new(Variable::Seq, Shape::Linear), Some("seq")),
        (Basis::measured_torque(joint), Some("tau1_nm")),
        (Basis::new(Variable::Temperature { reference_c: 20.0 }, Shape::Linear), Some("temp_c")),
        (Basis::direction(joint), Some("dir1")),
        (Basis::new(Variable::Joint { joint }, Shape::Linear), None),
    ];
    for (basis, lacking) in needs {
        let missing = basis.missing(&bare, &touch);
        assert_eq!(missing.is_some(), lacking.is_some(), "{basis:?}: {missing:?}");
        assert!(missing.is_none_or(|said| said.contains(lacking.unwrap())), "{basis:?}: {missing:?}");
        assert_eq!(basis.missing(&everything, &touch), None);
        assert_eq!(basis.in_session(7).missing(&bare, &touch), None, "of another session");
    }
    let reading = Basis::new(Variable::Reading { axis: Axis::X }, Shape::Linear);
    assert_eq!(reading.missing(&bare, &touch), None);
    assert!(reading.missing(&bare, &point).is_some());
}

/// A measuring frame that drifts moves what was measured in it, and nothing that was measured in another.
#[test]
fn a_frame_that_drifts_leaves_other_frames_alone() {
    let robot = Robot::parse(include_str!("data/arm.toml"), "arm.toml").unwrap();
    let mut model = Model::nominal(robot, Cell::bare());
    model.cell.tool.targets = vec![nalgebra::Vector3::zeros()];
    model.frames = vec![Pose::identity(); 2];
    let still = Forward::new(model.clone(), Vec::new()).unwrap();
    let basis = Basis::new(Variable::Time, Shape::Linear);
    let site = Site::Frame { frame: 1, motion: Motion::ALL[0] };
    model.terms.push(Term { value: 1e-3, ..Term::new("drift", "frame_drift", site, basis) });
    let drifts = Forward::new(model, Vec::new()).unwrap();
    let (state, seen) =
        (State { t: Some(2.0), ..State::at(&[0.2; 6]) }, Measured::Point { target: 0, position: [0.0; 3] });
    let predicted = |forward: &Forward, frame: usize| {
        let mut ws = forward.workspace();
        forward.residual(&state, &seen, frame, &mut ws);
        nalgebra::Vector3::new(ws.residual()[0], ws.residual()[1], ws.residual()[2])
    };
    assert!(((predicted(&drifts, 0) - predicted(&still, 0)).norm() - 2e-3).abs() < 1e-12);
    assert_eq!(predicted(&drifts, 1), predicted(&still, 1));
}

/// A load that was on the flange while the balls stood at one place bends the arm there, and nowhere else.
#[test]
fn a_payload_may_belong_to_one_place_of_the_balls() {
    let robot = Robot::parse(include_str!("data/arm.toml"), "arm.toml").unwrap();
    let of = |load: Option<Basis>| {
        let mut model = Model::nominal(robot.clone(), Cell::bare());
        let soft = Term::new("soft", "elasticity", Site::Joint { joint: 2 }, Basis::torque(2, Shape::Linear));
        model.terms.push(Term { value: 1e-5, ..soft });
        let load = load.map(|basis| Term::new("load", "payload", Site::Payload(Payload::Mass), basis));
        model.terms.extend(load.map(|load| Term { value: 3.0, ..load }));
        Forward::new(model, Vec::new()).unwrap()
    };
    let tool = |forward: &Forward, place: usize| {
        let state = State { place: Some(place), ..State::at(&[0.2; 6]) };
        forward.world_from_tool(&state, &mut forward.workspace()).translation
    };
    let (bare, loaded) = (of(None), of(Some(Basis::CONSTANT)));
    let at_second = of(Some(Basis::CONSTANT.at_place(Some(2))));
    assert!((tool(&loaded, 1) - tool(&bare, 1)).norm() > 1e-5);
    assert!((tool(&at_second, 1) - tool(&loaded, 1)).norm() < 1e-12);
    assert_eq!(tool(&at_second, 0), tool(&bare, 0));
}

/// The column of a term that has a motion is what that motion does, times an amount; constants and loads have none.
#[test]
fn only_what_varies_and_is_no_load_is_a_motion_times_an_amount() {
    let robot = Robot::parse(include_str!("data/arm.toml"), "arm.toml").unwrap();
    let mut model = Model::nominal(robot, Cell::bare());
    let varies = Basis::new(Variable::Joint { joint: 3 }, Shape::Linear);
    let once = Basis::CONSTANT.in_session(1);
    let (joint, load) = (Site::Joint { joint: 2 }, Site::Payload(Payload::Mass));
    for (name, site, basis) in [
        ("varies", joint, varies),
        ("constant", joint, Basis::CONSTANT),
        ("load", load, once),
        ("mass", load, Basis::CONSTANT),
    ] {
        model.terms.push(Term::new(name, "any", site, basis));
    }
    let forward = Forward::new(model, Vec::new()).unwrap();
    let has: Vec<bool> = (0..4).map(|term| forward.motion(term).is_some()).collect();
    assert_eq!(has, [true, false, false, false]);
}

/// Where a bearing bends between origin and foot is a share of the way, and it bends in proportion.
#[test]
fn a_part_moment_is_linear_and_within_its_axis() {
    let robot = Robot::parse(include_str!("data/arm.toml"), "arm.toml").unwrap();
    let accepted = |share: f64, shape: Shape| {
        let mut model = Model::nominal(robot.clone(), Cell::bare());
        let basis = Basis::new(Variable::PartMoment { joint: 2, axis: Axis::X, share }, shape);
        model.terms.push(Term::new("bends", "cross_elasticity", Site::Across { joint: 2 }, basis));
        Forward::new(model, Vec::new()).is_ok()
    };
    for (share, shape, expected) in [
        (0.0, Shape::Linear, true),
        (1.0, Shape::Linear, true),
        (-0.1, Shape::Linear, false),
        (1.1, Shape::Linear, false),
        (0.5, Shape::Cube, false),
    ] {
        assert_eq!(accepted(share, shape), expected, "{share} {shape:?}");
    }
}
