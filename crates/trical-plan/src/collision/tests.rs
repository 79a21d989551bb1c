#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use proptest::prelude::*;
use trical_model::{Cell, JointKind, MAX_JOINTS, Robot};

use super::*;

fn irb120() -> CollisionModel {
    let robot = Robot::parse(include_str!("../../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
    let cell = Cell::parse(include_str!("../../../../cells/irb120/cell.toml"), "cell.toml").unwrap();
    CollisionModel::new(&robot, &cell).unwrap()
}

fn named(model: &CollisionModel, contact: Option<Contact>) -> Option<(String, String)> {
    contact.map(|c| {
        let (a, b) = model.names(c);
        (a.to_owned(), b.to_owned())
    })
}

fn joints(q: [f64; 6]) -> Joints {
    let mut out = [0.0; MAX_JOINTS];
    for (o, q) in out.iter_mut().zip(q) {
        *o = q.to_radians();
    }
    out
}

#[test]
fn the_arm_at_rest_is_free() {
    let model = irb120();
    let mut ws = MotionWorkspace::new(&model);
    let hit = model.check_joints(&joints([0.0; 6]), None, &mut ws);
    assert_eq!(named(&model, hit), None);
    assert!(
        model.always_in_contact().is_empty(),
        "{:?}",
        model.always_in_contact().iter().map(|c| model.names(*c)).collect::<Vec<_>>()
    );
}

#[test]
fn an_arm_bent_into_the_table_meets_it() {
    let model = irb120();
    let mut ws = MotionWorkspace::new(&model);
    let hit = model.check_joints(&joints([60.0, 90.0, 30.0, 0.0, 0.0, 0.0]), None, &mut ws);
    let (a, b) = named(&model, hit).unwrap();
    assert!(a == "table" || b == "table", "{a} {b}");
}

#[test]
fn an_arm_on_a_rail_is_free_on_its_floor_all_along_the_rail_and_meets_what_stands_beside_it() {
    let joint = |kind: &str, alpha: f64, a: f64, d: f64, offset: f64, limits: &str| {
        format!(
            "[[joint]]\n{kind}alpha_deg = {alpha:?}\na_mm = {a:?}\nd_mm = {d:?}\ntheta_offset_deg = {offset:?}\n{limits}\n"
        )
    };
    let turns = "limits_deg = [-160.0, 160.0]";
    let robot = [
        "name = 'rail'\n[root]\nxyz_mm = [0.0, 0.0, 0.0]\nzyx_deg = [90.0, 0.0, 90.0]\n".to_owned(),
        joint("kind = 'prismatic'\n", 0.0, 0.0, 0.0, 0.0, "limits_mm = [0.0, 5000.0]"),
        joint("", -90.0, 0.0, 350.0, 90.0, turns),
        joint("", 90.0, 0.0, 0.0, 90.0, turns),
        joint("", 0.0, 300.0, 0.0, 0.0, turns),
        joint("", -90.0, 0.0, 300.0, 0.0, turns),
    ]
    .concat();
    let cell = |obstacles: &str| {
        format!(
            "[base]\nxyz_mm = [0.0, 0.0, 0.0]\nzyx_deg = [0.0, 0.0, 0.0]\n[tool]\ntcp_mm = [0.0, 0.0, 50.0]\n{obstacles}"
        )
    };
    let model = |obstacles: &str| {
        let cell = Cell::parse(&cell(obstacles), "cell.toml").unwrap();
        CollisionModel::new(&Robot::parse(&robot, "robot.toml").unwrap(), &cell).unwrap()
    };
    let free = model("");
    let mut ws = MotionWorkspace::new(&free);
    let mut q = joints([0.0, 20.0, -20.0, -30.0, 10.0, 0.0]);
    for at in [0.0, 0.05, 1.5, 5.0] {
        q[0] = at;
        assert_eq!(named(&free, free.check_joints(&q, None, &mut ws)), None, "the rail at {at} m");
    }
    // a post beside the rail that the carriage comes to at its end
    let post = "[[geometry.obstacle]]\nname = 'post'\nsolids = [{ shape = 'box', center_mm = [5050.0, 0.0, 100.0], size_mm = [50.0, 50.0, 200.0] }]\n";
    let blocked = model(post);
    let hit = named(&blocked, blocked.check_joints(&q, None, &mut MotionWorkspace::new(&blocked))).unwrap();
    assert_eq!(hit, ("link 1".to_owned(), "post".to_owned()));
}

/// A gantry of one sliding joint: distances and instants are known by hand.
fn slider(extra: &str) -> CollisionModel {
    let robot = Robot::parse(
        "name = 'slider'\n[[joint]]\nkind = 'prismatic'\nalpha_deg = 0.0\na_mm = 0.0\nd_mm = 0.0\ntheta_offset_deg = 0.0\nlimits_mm = [-1000.0, 1000.0]\n",
        "robot.toml",
    )
    .unwrap();
    let cell = Cell::parse(
        &format!(
            "[base]\nxyz_mm = [0.0, 0.0, 0.0]\nzyx_deg = [0.0, 0.0, 0.0]\n[tool]\ntcp_mm = [0.0, 0.0, 0.0]\n\
             [geometry]\nmargin_mm = 1.0\ndevice = []\nlink = [{{ link = 1, solids = [{{ shape = 'sphere', center_mm = [0, 0, 0], radius_mm = 10 }}] }}]\n{extra}"
        ),
        "cell.toml",
    )
    .unwrap();
    CollisionModel::new(&robot, &cell).unwrap()
}

#[test]
fn a_thin_wall_in_the_way_is_never_jumped_over() {
    // 0.2 mm thick, 1 m of way: sampling would need luck
    let model = slider(
        "obstacle = [{ name = 'foil', solids = [{ shape = 'box', center_mm = [0, 0, 433.3], size_mm = [100, 100, 0.2] }] }]",
    );
    let mut ws = MotionWorkspace::new(&model);
    let at = |mm: f64| {
        let mut q = [0.0; MAX_JOINTS];
        q[0] = mm * 1e-3;
        q
    };
    assert!(model.check_motion(&at(-500.0), &at(900.0), None, &mut ws).is_some());
    // 433.3 - 0.1 - 10 = 423.2 mm is contact; with the margin 422.2
    assert!(model.check_motion(&at(-500.0), &at(422.1), None, &mut ws).is_none());
    assert!(model.check_motion(&at(-500.0), &at(422.3), None, &mut ws).is_some());
    let links = [Pose::identity(), Pose { translation: V3::new(0.0, 0.0, 0.4), ..Pose::identity() }];
    let (clearance, _) = model.clearance(&links, None).unwrap();
    assert!((clearance - 0.0232).abs() < 1e-12, "{clearance}");
}

#[test]
fn passing_beside_an_obstacle_costs_few_configurations() {
    let model = slider(
        "obstacle = [{ name = 'post', solids = [{ shape = 'capsule', from_mm = [30, 0, 0], to_mm = [30, 0, 500], radius_mm = 5 }] }]",
    );
    let mut ws = MotionWorkspace::new(&model);
    let (mut from, mut to) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
    from[0] = -0.5;
    to[0] = 0.9;
    assert!(model.check_motion(&from, &to, None, &mut ws).is_none());
    assert!(ws.configurations < 400, "{}", ws.configurations);
}

#[test]
fn a_stem_may_meet_the_ball_that_it_touches_and_no_other() {
    let model = irb120();
    let stems = model.stems().count();
    assert_eq!(stems, 3);
    let forward = model.forward();
    let mut ws = forward.workspace();
    let ball = forward.model().cell.balls[0];
    let target = Pose {
        rotation: trical_model::pose::rotation_x(std::f64::consts::PI) * trical_model::pose::rotation_z(0.7),
        translation: ball,
    };
    let q = trical_model::inverse_kinematics(forward, &target, &State::at(&[0.0; 6]), &mut ws).unwrap()[0].joints;
    let mut scratch = MotionWorkspace::new(&model);
    assert_eq!(named(&model, model.check_joints(&q, Some(0), &mut scratch)), None);
    let hit = named(&model, model.check_joints(&q, Some(1), &mut scratch)).unwrap();
    assert!(hit.0.starts_with("stem") && hit.1 == "ball 1", "{hit:?}");
}

#[test]
fn what_the_tools_pose_says_holds_at_all_joints_that_bring_it_there() {
    let robots = [
        ("irb120", include_str!("../../../../cells/irb120/robot.toml")),
        ("ur5e", include_str!("../../../../robots/ur5e.toml")),
        ("kr6_r700", include_str!("../../../../robots/kr6_r700.toml")),
    ];
    for (name, text) in robots {
        let cell = Cell::parse(include_str!("../../../../cells/irb120/cell.toml"), "cell.toml").unwrap();
        let mut robot = Robot::parse(text, name).unwrap();
        // one joint more, and one that slides
        let mut elbow = robot.joints[2].clone();
        (elbow.a, elbow.d) = (0.05, -0.1);
        robot.joints.insert(3, elbow);
        (robot.joints[0].kind, robot.joints[0].limits) = (JointKind::Prismatic, [-0.4, 0.2]);
        for robot in [Robot::parse(text, name).unwrap(), robot] {
            let mut cell = cell.clone();
            cell.geometry = None;
            let model = CollisionModel::new(&robot, &cell).unwrap();
            let (mut ws, mut met, mut met_by_pose) = (MotionWorkspace::new(&model), 0, 0);
            for k in 0..2000_u32 {
                let mut q = [0.0; MAX_JOINTS];
                for (i, (x, joint)) in q.iter_mut().zip(&robot.joints).enumerate() {
                    let u = (0.5 + [0.7548, 0.5698, 0.8191, 0.671, 0.5497, 0.4503, 0.8567][i] * f64::from(k)).fract();
                    *x = joint.limits[0] + u * (joint.limits[1] - joint.limits[0]);
                }
                let mut pose = model.forward().world_from_tool(&State::at(&q), ws.forward());
                assert!(!model.is_too_far(&pose, &mut ws), "{name}: {q:?}");
                let by_pose = model.check_tool(&pose, None, &mut ws);
                let met_there = model.check_joints(&q, None, &mut ws).is_some();
                assert!(by_pose.is_none() || met_there, "{name}: {q:?}");
                met_by_pose += u32::from(by_pose.is_some());
                met += u32::from(met_there);
                pose.translation.x += 5.0;
                assert!(model.is_too_far(&pose, &mut ws));
            }
            assert!(0 < met_by_pose && met_by_pose < met && met < 2000, "{name}: {met_by_pose} of {met}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// The bound that the proof rests on, against the motion itself: no pair comes closer faster than `speed` says.
    #[test]
    fn no_pair_approaches_faster_than_its_bound(
        u in prop::array::uniform6(0.0..1.0_f64), du in prop::array::uniform6(-1.0..1.0_f64), at in 0.0..1.0_f64,
    ) {
        let model = irb120();
        let robot = &model.forward().model().robot;
        let (mut a, mut b) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
        for (k, j) in robot.joints.iter().enumerate() {
            a[k] = j.limits[0] + u[k] * (j.limits[1] - j.limits[0]);
            b[k] = a[k] + 0.2 * du[k];
        }
        let mut q = a;
        for k in 0..6 {
            q[k] += at * (b[k] - a[k]);
        }
        let mut ws = model.forward().workspace();
        let (mut first, mut then) = (vec![Pose::identity(); 7], vec![Pose::identity(); 7]);
        model.place(&a, &mut ws, &mut first);
        model.place(&q, &mut ws, &mut then);
        for pair in &model.pairs {
            let speed: f64 = (0..6).map(|k| pair.speed[k] * (b[k] - a[k]).abs()).sum();
            let (d0, d1) = (model.pair_distance(pair, &first), model.pair_distance(pair, &then));
            prop_assert!((d1 - d0).abs() <= speed * at + 1.1 * crate::solid::GJK_SLACK, "{d0} {d1} {speed}");
            prop_assert!(model.least_distance(pair, &then) <= d1 + 1.1 * crate::solid::GJK_SLACK);
        }
    }

    /// A motion that was cleared is free wherever one looks; one that was refused has a contact at the margin somewhere.
    #[test]
    fn what_is_cleared_is_free_everywhere(u in prop::array::uniform6(0.0..1.0_f64), w in prop::array::uniform6(0.0..1.0_f64)) {
        let model = irb120();
        let robot = &model.forward().model().robot;
        let (mut a, mut b) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
        for (k, j) in robot.joints.iter().enumerate() {
            a[k] = (j.limits[0] + u[k] * (j.limits[1] - j.limits[0])) * 0.6;
            b[k] = (j.limits[0] + w[k] * (j.limits[1] - j.limits[0])) * 0.6;
        }
        let mut scratch = MotionWorkspace::new(&model);
        let hit = model.check_motion(&a, &b, None, &mut scratch);
        let mut ws = model.forward().workspace();
        let mut links = vec![Pose::identity(); 7];
        let mut least = f64::INFINITY;
        for k in 0..=2000 {
            let mut q = a;
            for i in 0..6 {
                q[i] += f64::from(k) / 2000.0 * (b[i] - a[i]);
            }
            model.place(&q, &mut ws, &mut links);
            least = least.min(model.clearance(&links, None).unwrap().0);
        }
        match hit {
            None => prop_assert!(least >= 0.5 * model.margin(), "{least}"),
            Some(_) => prop_assert!(least < model.margin() + 2e-3, "{least}"),
        }
    }
}
