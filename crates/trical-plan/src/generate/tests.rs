#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use super::*;
use crate::plan::tests::irb120;

fn pool(options: &PlanOptions) -> (CollisionModel, Vec<Candidate>, Rejected) {
    let (robot, cell) = irb120();
    let model = CollisionModel::new(&robot, &cell).unwrap();
    let (pool, rejected) = generate(&model, 1, options, &Task::silent()).unwrap();
    (model, pool, rejected)
}

#[test]
fn every_attempt_is_a_candidate_or_has_a_reason() {
    let (_, pool, r) = pool(&PlanOptions::default());
    let refused =
        r.unreachable + r.out_of_limits + r.singular + r.touch_in_collision + r.no_approach + r.approach_in_collision;
    assert_eq!(pool.len(), 100);
    assert_eq!(r.attempts, pool.len() + refused);
    assert_eq!(r.contacts.values().sum::<usize>(), r.touch_in_collision + r.approach_in_collision);
}

#[test]
fn joints_stay_as_far_from_limits_and_the_device_as_upright_as_asked() {
    let options =
        PlanOptions { limit_margin_rad: 0.3, max_tilt_rad: 0.2, spin_rad: [0.5, 0.9], ..PlanOptions::default() };
    let (model, pool, _) = pool(&options);
    let forward = model.forward();
    let mut ws = forward.workspace();
    for c in &pool {
        for q in [&c.joints, &c.approach] {
            assert!(forward.model().robot.within_limits(q, -0.3));
        }
        let r = forward.world_from_tool(&State::at(&c.joints), &mut ws).rotation;
        assert!(-r[(2, 2)] > 0.2_f64.cos() - 1e-9);
        // with little tilt the device's x axis stays near where the spin puts it: Rx(180) Rz(turn) has x = (cos, -sin, 0)
        let turn = (-r[(1, 0)]).atan2(r[(0, 0)]);
        assert!((0.45..0.95).contains(&turn), "{turn}");
    }
}

#[test]
fn the_pool_is_spread_over_all_branches() {
    let (_, pool, _) = pool(&PlanOptions::default());
    // the wrist turned either way
    let flipped = pool.iter().filter(|c| c.joints[4] < 0.0).count();
    assert!((20..=80).contains(&flipped), "{flipped}");
}

/// The cell of the IRB 120 with a block that leaves little room at the balls: only devices that lie down have any.
fn block(top_mm: f64) -> CollisionModel {
    let text = format!(
        "{}\n[[geometry.obstacle]]\nname = \"block\"\nsolids = [{{ shape = \"box\", center_mm = [150.0, 150.0, {}], size_mm = [700.0, 700.0, 200.0] }}]\n",
        include_str!("../../../../cells/irb120/cell.toml"),
        top_mm - 100.0
    );
    let cell = trical_model::Cell::parse(&text, "cell.toml").unwrap();
    CollisionModel::new(&irb120().0, &cell).unwrap()
}

#[test]
fn where_the_device_meets_something_whatever_the_joints_are_no_joints_are_solved_for() {
    let options = PlanOptions { attempts_per_candidate: 20, ..PlanOptions::default() };
    let error = generate(&block(250.0), 0, &options, &Task::silent()).unwrap_err();
    let PlanError::TooFew { found: 0, attempts: 2000, reason, .. } = error else { panic!("{error}") };
    // but for the first attempts, every other has what the joints are not needed for as its reason
    let touches = reason.strip_prefix("refused were ").and_then(|rest| rest.split(' ').next());
    assert!(touches.unwrap().parse::<usize>().unwrap() > 1950, "{reason}");
}

#[test]
fn a_longer_pool_begins_with_the_shorter_one() {
    let (_, short, _) = pool(&PlanOptions { pool_per_ball: 20, per_ball: 5, ..PlanOptions::default() });
    let (_, long, _) = pool(&PlanOptions { pool_per_ball: 50, per_ball: 5, ..PlanOptions::default() });
    assert_eq!(short[..], long[..20]);
}

#[test]
fn all_reasons_are_told_the_commonest_first() {
    let mut r = Rejected { unreachable: 3, touch_in_collision: 5, ..Rejected::default() };
    r.contacts.insert("stem x and post 1".into(), 4);
    r.contacts.insert("flange and table".into(), 1);
    assert_eq!(r.in_words(), "5 collision at the touch, 3 out of reach, most contacts, 4, between stem x and post 1");
    let mut sum = r.clone();
    sum.add(&Rejected { unreachable: 30, out_of_limits: 1, ..Rejected::default() });
    assert!(sum.in_words().starts_with("33 out of reach, 5 collision at the touch, 1 beyond joint limits"));
}
