//! Times of the collision checks, of generation and of a whole plan, on the shipped IRB 120 cell.

#![allow(clippy::unwrap_used, missing_docs)]

use trical_model::{Cell, Joints, MAX_JOINTS, Pose, Robot, State, inverse_kinematics};
use trical_plan::options::PlanOptions;
use trical_plan::plan::plan_touches;
use trical_plan::{CollisionModel, MotionWorkspace, generate, poses_in_workspace};

fn main() {
    divan::main();
}

fn irb120() -> (Robot, Cell) {
    let robot = Robot::parse(include_str!("../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
    let cell = Cell::parse(include_str!("../../../cells/irb120/cell.toml"), "cell.toml").unwrap();
    (robot, cell)
}

/// The same arm with the capsules that are derived for a cell without `[geometry]`.
fn derived() -> (Robot, Cell) {
    let (robot, mut cell) = irb120();
    cell.geometry = None;
    (robot, cell)
}

fn poses(model: &CollisionModel) -> Vec<Joints> {
    poses_in_workspace(model, 200, &trical_plan::ValidationOptions::default()).unwrap()
}

#[divan::bench(args = ["shipped", "derived"])]
fn configuration_with_forward_kinematics(bencher: divan::Bencher, cell: &str) {
    let (robot, cell) = if cell == "shipped" { irb120() } else { derived() };
    let model = CollisionModel::new(&robot, &cell).unwrap();
    let (poses, mut scratch, mut k) = (poses(&model), MotionWorkspace::new(&model), 0);
    bencher.bench_local(|| {
        k += 1;
        model.check_joints(&poses[k % poses.len()], None, &mut scratch)
    });
}

#[divan::bench]
fn motion_across_the_workspace(bencher: divan::Bencher) {
    let (robot, cell) = irb120();
    let model = CollisionModel::new(&robot, &cell).unwrap();
    let (poses, mut scratch, mut k) = (poses(&model), MotionWorkspace::new(&model), 0);
    bencher.bench_local(|| {
        k += 1;
        model.check_motion(&poses[k % poses.len()], &poses[(k + 1) % poses.len()], None, &mut scratch)
    });
}

#[divan::bench]
fn inverse_kinematics_of_all_branches(bencher: divan::Bencher) {
    let (robot, cell) = irb120();
    let model = CollisionModel::new(&robot, &cell).unwrap();
    let forward = model.forward();
    let mut ws = forward.workspace();
    let targets: Vec<Pose> = poses(&model).iter().map(|q| forward.world_from_tool(&State::at(q), &mut ws)).collect();
    let state = State::at(&[0.0; MAX_JOINTS]);
    let mut k = 0;
    bencher.bench_local(|| {
        k += 1;
        inverse_kinematics(forward, &targets[k % targets.len()], &state, &mut ws)
    });
}

#[divan::bench(sample_count = 5)]
fn pool_of_300_at_each_ball() -> usize {
    let (robot, cell) = irb120();
    let model = CollisionModel::new(&robot, &cell).unwrap();
    let options = PlanOptions { pool_per_ball: 300, ..PlanOptions::default() };
    (0..3).map(|ball| generate::generate(&model, ball, &options, &mut |_| {}).unwrap().0.len()).sum()
}

#[divan::bench(sample_count = 5, args = [100, 300])]
fn plan_of_15_a_ball_from_a_pool_of(pool: usize) -> usize {
    let (robot, cell) = irb120();
    let options = PlanOptions { pool_per_ball: pool, ..PlanOptions::default() };
    plan_touches(&robot, &cell, &options, &mut |_| {}).unwrap().entries.len()
}
