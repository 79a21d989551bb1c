#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::time::Instant;

use super::*;

pub(crate) fn irb120() -> (Robot, Cell) {
    let robot = Robot::parse(include_str!("../../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
    let cell = Cell::parse(include_str!("../../../../cells/irb120/cell.toml"), "cell.toml").unwrap();
    (robot, cell)
}

#[test]
fn look() {
    let (robot, cell) = irb120();
    let t = Instant::now();
    let model = CollisionModel::new(&robot, &cell).unwrap();
    eprintln!("model {:?} pairs {}", t.elapsed(), model.pair_count());
    let options = PlanOptions::default();
    for ball in 0..3 {
        let t = Instant::now();
        let (pool, rejected) = generate(&model, ball, &options, &mut |_| {}).unwrap();
        eprintln!("{} {:?} {rejected:#?}", pool.len(), t.elapsed());
    }
    let t = Instant::now();
    let plan = plan_touches(&robot, &cell, &options, &mut |_| {}).unwrap();
    eprintln!(
        "{:?} {:#?} vias {}",
        t.elapsed(),
        plan.expected,
        plan.entries.iter().filter(|e| !e.via.is_empty()).count()
    );
}
