//! Times of the collision checks, of generation and of a whole plan, on the shipped IRB 120 cell.

#![allow(clippy::disallowed_methods, clippy::unwrap_used, missing_docs)]

use trical_model::{Cell, Joints, MAX_JOINTS, Pose, Robot, State, inverse_kinematics};
use trical_plan::predict::tool_rows;
use trical_plan::{
    CollisionModel, Criterion, MotionWorkspace, PlanOptions, choose_touches, generate, nominal_forward, plan_touches,
    poses_in_workspace,
};

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

/// The same arm in the same cell, each capsule of a link replaced by a hull of 48 points on its surface.
fn hulls() -> (Robot, Cell) {
    let (robot, mut cell) = irb120();
    let links = cell.geometry.as_mut().unwrap().get_mut("link").unwrap().as_array_mut().unwrap();
    for link in links {
        for solid in link.get_mut("solids").unwrap().as_array_mut().unwrap() {
            let list = |key: &str| -> Option<Vec<f64>> {
                let numbers = solid.get(key)?.as_array()?;
                numbers.iter().map(|x| x.as_float()).collect()
            };
            let (Some(a), Some(b)) = (list("from_mm"), list("to_mm")) else { continue };
            let r = solid.get("radius_mm").unwrap().as_float().unwrap();
            // the upper half of 24 directions about one end, the lower about the other
            let mut text = String::from("x = { shape = \"hull\", points_mm = [");
            for end in [&a, &b] {
                for k in 0..24 {
                    let z = -1.0 + (2.0 * f64::from(k) + 1.0) / 24.0;
                    let (s, c) = (f64::from(k) * 2.399_963).sin_cos();
                    let flat = (1.0 - z * z).sqrt() * r;
                    text += &format!("[{:.3}, {:.3}, {:.3}],", end[0] + flat * c, end[1] + flat * s, end[2] + z * r);
                }
            }
            text += "] }";
            let table: toml::Table = toml::from_str(&text).unwrap();
            *solid = table["x"].clone();
        }
    }
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

/// All links as hulls of 48 points instead of capsules.
#[divan::bench]
fn configuration_of_hulls_with_forward_kinematics(bencher: divan::Bencher) {
    let (robot, cell) = hulls();
    let model = CollisionModel::new(&robot, &cell).unwrap();
    let (poses, mut scratch, mut k) = (poses(&model), MotionWorkspace::new(&model), 0);
    bencher.bench_local(|| {
        k += 1;
        model.check_joints(&poses[k % poses.len()], None, &mut scratch)
    });
}

#[divan::bench(sample_count = 5, args = [Criterion::Determinant, Criterion::Variances, Criterion::Weakest, Criterion::Region])]
fn choice_of_45_from_900(bencher: divan::Bencher, criterion: Criterion) {
    let (robot, cell) = irb120();
    let model = CollisionModel::new(&robot, &cell).unwrap();
    let options = PlanOptions { pool_per_ball: 300, criterion, ..PlanOptions::default() };
    let mut pool = Vec::new();
    for ball in 0..3 {
        pool.extend(generate::generate(&model, ball, &options, &trical_model::Task::silent()).unwrap().0);
    }
    let forward = nominal_forward(&robot, &cell, &options).unwrap();
    let region = tool_rows(&forward, &poses(&model));
    bencher.bench_local(|| choose_touches(&forward, &pool, &options, &region).unwrap().observability.o1);
}

#[divan::bench(sample_count = 5)]
fn pool_of_300_at_each_ball() -> usize {
    let (robot, cell) = irb120();
    let model = CollisionModel::new(&robot, &cell).unwrap();
    let options = PlanOptions { pool_per_ball: 300, ..PlanOptions::default() };
    (0..3).map(|ball| generate::generate(&model, ball, &options, &trical_model::Task::silent()).unwrap().0.len()).sum()
}

#[divan::bench(sample_count = 5, args = [100, 300])]
fn plan_of_15_a_ball_from_a_pool_of(pool: usize) -> usize {
    let (robot, cell) = irb120();
    let options = PlanOptions { pool_per_ball: pool, ..PlanOptions::default() };
    plan_touches(&robot, &cell, &options, &trical_model::Task::silent()).unwrap().entries.len()
}
