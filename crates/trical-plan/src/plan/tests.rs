#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use trical_model::Pose;

use super::*;
use crate::plan_csv::{read_plan, write_plan};

pub(crate) fn irb120() -> (Robot, Cell) {
    let robot = Robot::parse(include_str!("../../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
    let cell = Cell::parse(include_str!("../../../../cells/irb120/cell.toml"), "cell.toml").unwrap();
    (robot, cell)
}

/// The layout of the blind recordings, without any `[geometry]`.
fn bare_cell() -> Cell {
    Cell::parse(
        "[base]\nxyz_mm = [150.0, -330.0, -150.0]\nzyx_deg = [90.0, 0.0, 0.0]\n\
         [tool]\ntcp_mm = [18.0, -12.0, 118.0]\nmass_kg = 1.7\ncog_mm = [5.0, -4.0, 55.0]\n\
         [balls]\ndistances_mm = { d12 = 300.0, d13 = 300.0, d23 = 300.0 }\n",
        "cell.toml",
    )
    .unwrap()
}

fn quiet(robot: &Robot, cell: &Cell, options: &PlanOptions) -> Plan {
    plan_touches(robot, cell, options, &Task::silent()).unwrap()
}

/// Candidates at all three balls.
fn pool_of(model: &CollisionModel, options: &PlanOptions) -> Vec<Candidate> {
    (0..3).flat_map(|ball| generate(model, ball, options, &Task::silent()).unwrap().0).collect()
}

/// Follows a plan as the arm would, looking everywhere, by `clearance` (not by the proof that the plan was made with).
fn drive(robot: &Robot, cell: &Cell, plan: &Plan, options: &PlanOptions) {
    let model = CollisionModel::new(robot, cell).unwrap();
    let mut ws = model.forward().workspace();
    let mut links = vec![Pose::identity(); robot.dof() + 1];
    let mut follow = |from: &Joints, to: &Joints, ball: Option<usize>| {
        for k in 0..=200 {
            let mut q = *from;
            for (x, y) in q.iter_mut().zip(to) {
                *x += f64::from(k) / 200.0 * (y - *x);
            }
            assert!(robot.within_limits(&q, 1e-12));
            model.forward().world_from_links_into(&State::at(&q), &mut ws, &mut links);
            let (clearance, hit) = model.clearance(&links, ball).unwrap();
            assert!(clearance >= 0.5 * model.margin(), "{clearance} {:?}", model.names(hit));
        }
    };
    let mut at = options.start;
    for e in &plan.entries {
        for q in e.via.iter().chain([&e.approach]) {
            if let Some(from) = &at {
                follow(from, q, None);
            }
            at = Some(*q);
        }
        follow(&e.approach, &e.joints, Some(e.ball));
    }
    let mut ws = model.forward().workspace();
    for e in &plan.entries {
        let tool = model.forward().world_from_tool(&State::at(&e.joints), &mut ws);
        // six decimals of a degree
        assert!((tool.translation - cell.balls[e.ball]).norm() < 1e-7);
        let back = model.forward().world_from_tool(&State::at(&e.approach), &mut ws).translation - tool.translation;
        let [near, far] = options.standoff_m;
        assert!(back.norm() > near - 1e-6 && back.norm() < far + 1e-6);
        let down = -tool.rotation[(2, 2)];
        assert!(down > options.max_tilt_rad.cos() - 1e-6);
    }
}

#[test]
fn the_shipped_cell_gets_45_touches_that_can_be_driven() {
    let (robot, cell) = irb120();
    let options = PlanOptions { start: Some([0.0; MAX_JOINTS]), ..PlanOptions::default() };
    let plan = quiet(&robot, &cell, &options);
    assert_eq!(plan.entries.len(), 45);
    for ball in 0..3 {
        assert_eq!(plan.entries.iter().filter(|e| e.ball == ball).count(), 15);
    }
    assert!(plan.entries.iter().enumerate().all(|(k, e)| e.index == k));
    drive(&robot, &cell, &plan, &options);
}

#[test]
fn the_papers_31_parameters_are_those_that_can_be_told_apart() {
    let (robot, cell) = irb120();
    let plan = quiet(&robot, &cell, &PlanOptions::default());
    assert_eq!(plan.expected.parameters.len(), 31);
    // d_2 moves the arm as d_3 does; axis 1 carries no torque
    assert_eq!(plan.expected.dependent, vec!["d_2".to_owned(), "c_1".to_owned()]);
    assert!(plan.expected.condition < 1000.0, "{}", plan.expected.condition);
    assert!(plan.expected.gain_over_random > 1.1, "{}", plan.expected.gain_over_random);
}

#[test]
fn every_joint_arrives_in_both_senses() {
    let (robot, cell) = irb120();
    let plan = quiet(&robot, &cell, &PlanOptions::default());
    for (k, [down, up]) in plan.expected.senses.iter().enumerate() {
        assert!(*down.min(up) >= 14 && down + up >= 42, "joint {}: {down} down, {up} up", k + 1);
    }
}

#[test]
fn a_cell_without_geometry_can_be_planned() {
    let (robot, _) = irb120();
    let (cell, options) = (bare_cell(), PlanOptions::default());
    drive(&robot, &cell, &quiet(&robot, &cell, &options), &options);
}

#[test]
fn an_arm_with_parallel_axes_and_compliance_of_every_joint_can_be_planned() {
    let robot = Robot::parse(include_str!("../../../../cells/ur10/robot.toml"), "robot.toml").unwrap();
    let cell = Cell::parse(include_str!("../../../../cells/ur10/cell.toml"), "cell.toml").unwrap();
    let options = PlanOptions { per_ball: 12, pool_per_ball: 40, ..PlanOptions::default() };
    let plan = quiet(&robot, &cell, &options);
    drive(&robot, &cell, &plan, &options);
    assert!(plan.expected.parameters.len() >= 30, "{:?}", plan.expected);
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads() {
    let (robot, cell) = irb120();
    let options = PlanOptions { per_ball: 8, pool_per_ball: 30, ..PlanOptions::default() };
    let bytes = |threads: usize, seed: u64| {
        let options = PlanOptions { seed, ..options.clone() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| write_plan(&robot, &quiet(&robot, &cell, &options).entries))
    };
    let one = bytes(1, 7);
    assert_eq!(one, bytes(3, 7));
    assert_ne!(one, bytes(1, 8));
}

#[test]
fn a_plan_survives_its_file() {
    let (robot, cell) = irb120();
    let options = PlanOptions { per_ball: 10, pool_per_ball: 30, ..PlanOptions::default() };
    let plan = quiet(&robot, &cell, &options);
    let text = write_plan(&robot, &plan.entries);
    assert_eq!(read_plan(&text, "plan.csv", &robot, 3).unwrap(), plan.entries);
}

#[test]
fn the_chosen_touches_beat_random_ones_in_o1() {
    let (robot, cell) = irb120();
    let options = PlanOptions::default();
    let model = CollisionModel::new(&robot, &cell).unwrap();
    let pool = pool_of(&model, &options);
    let forward = nominal_forward(&robot, &cell, &options).unwrap();
    let chosen = choose_touches(&forward, &pool, &options, &[]).unwrap();
    for seed in 0..40 {
        // the first 15 of each ball of another pool are a random set
        let other = PlanOptions { seed: 100 + seed, pool_per_ball: 15, ..PlanOptions::default() };
        let random = pool_of(&model, &other);
        let o1 = choose_touches(&forward, &random, &other, &[]).unwrap().observability.o1;
        assert!(o1 < chosen.observability.o1, "{o1} {}", chosen.observability.o1);
    }
}

/// The best of 20 searches with 20 random starts each is beyond a plan's own quick search by less than 2 percent in O1.
#[test]
fn the_quick_choice_is_as_good_as_twenty_long_ones() {
    let (robot, cell) = irb120();
    let options = PlanOptions { per_ball: 6, pool_per_ball: 60, ..PlanOptions::default() };
    let model = CollisionModel::new(&robot, &cell).unwrap();
    let pool = pool_of(&model, &options);
    let forward = nominal_forward(&robot, &cell, &options).unwrap();
    let o1 = |options: &PlanOptions| choose_touches(&forward, &pool, options, &[]).unwrap().observability.o1;
    let quick = o1(&options);
    let long = (100..120).map(|seed| o1(&PlanOptions { seed, restarts: 20, ..options.clone() })).fold(0.0, f64::max);
    assert!(quick >= 0.98 * long, "{quick} {long}");
}

/// What is expected is what a least-squares fit of noisy touches does: parameters and tool scatter as predicted.
#[test]
fn predicted_errors_are_what_noisy_touches_leave() {
    use nalgebra::{DMatrix, DVector};
    use rand::{RngExt, SeedableRng};
    let (robot, cell) = irb120();
    let options = PlanOptions { noise_m: 2e-5, ..PlanOptions::default() };
    let plan = quiet(&robot, &cell, &options);
    let e = &plan.expected;
    assert_eq!(e.sd.len(), e.parameters.len());
    let forward = nominal_forward(&robot, &cell, &options).unwrap();
    let p = forward.free().len();
    let kept: Vec<usize> = (0..p).filter(|k| e.parameters.contains(&forward.model().terms[*k].name)).collect();
    let mut ws = forward.workspace();
    let mut rows = Vec::new();
    for t in &plan.entries {
        let mut block = vec![0.0; 3 * p];
        let touch = Measured::Touch { ball: t.ball, reading: [0.0; 3] };
        forward.linearize(&State::at(&t.joints), &touch, 0, &mut ws, &mut block);
        rows.extend(block);
    }
    let j = DMatrix::from_row_slice(rows.len() / p, p, &rows).select_columns(&kept);
    let sphere = Sphere::above(&cell.balls).unwrap();
    let model = CollisionModel::new(&robot, &cell).unwrap();
    let poses = poses_in_sphere(&model, &sphere.centre, sphere.radius, 100, &ValidationOptions::default()).unwrap();
    let tool = DMatrix::from_row_slice(300, p, &tool_rows(&forward, &poses)).select_columns(&kept);
    let solve = j.clone().svd(true, true);
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(5);
    let (mut squares, mut mean) = (vec![0.0; kept.len()], 0.0);
    for _ in 0..400 {
        // uniform noise of the same standard deviation: nothing here asks for a normal one
        let noise = DVector::from_fn(j.nrows(), |_, _| 2e-5 * 12.0_f64.sqrt() * (rng.random::<f64>() - 0.5));
        let x = solve.solve(&noise, 0.0).unwrap();
        squares.iter_mut().zip(x.iter()).for_each(|(s, x)| *s += x * x / 400.0);
        let moved = &tool * x;
        mean += (0..100).map(|i| moved.rows(3 * i, 3).norm()).sum::<f64>() / 100.0 / 400.0;
    }
    for (s, (sd, name)) in squares.iter().zip(e.sd.iter().zip(&e.parameters)) {
        // 400 repetitions know a standard deviation to 3.5 percent
        assert!((s.sqrt() / sd - 1.0).abs() < 0.18, "{name}: {} {sd}", s.sqrt());
    }
    let predicted = e.in_sphere.unwrap().mean_m;
    assert!((mean / predicted - 1.0).abs() < 0.15, "{mean} {predicted}");
    assert!(e.in_workspace.unwrap().mean_m > predicted);
}

#[test]
fn a_choice_for_a_region_serves_it_better_than_one_for_the_parameters() {
    let (robot, cell) = irb120();
    let with = |criterion, whole_workspace| {
        let options =
            PlanOptions { criterion, whole_workspace, per_ball: 12, pool_per_ball: 60, ..PlanOptions::default() };
        quiet(&robot, &cell, &options).expected
    };
    let [d, sphere, workspace] =
        [with(Criterion::Determinant, false), with(Criterion::Region, false), with(Criterion::Region, true)];
    let rms = |e: &Expected| [e.in_sphere.unwrap().rms_m, e.in_workspace.unwrap().rms_m];
    assert!(rms(&sphere)[0] < rms(&d)[0] && rms(&sphere)[0] <= rms(&workspace)[0], "{sphere:?} {d:?}");
    assert!(rms(&workspace)[1] < rms(&d)[1] && rms(&workspace)[1] <= rms(&sphere)[1], "{workspace:?} {d:?}");
    assert!(d.o1 > sphere.o1 && sphere.gain_over_random > 1.0);
}

#[test]
fn a_region_out_of_reach_is_refused_where_it_matters() {
    let (robot, cell) = irb120();
    let far = Sphere { centre: nalgebra::Vector3::new(9.0, 0.0, 0.0), radius: 0.2 };
    let options = PlanOptions { sphere: Some(far), per_ball: 8, pool_per_ball: 20, ..PlanOptions::default() };
    assert_eq!(quiet(&robot, &cell, &options).expected.in_sphere, None);
    let options = PlanOptions { criterion: Criterion::Region, ..options };
    let e = plan_touches(&robot, &cell, &options, &Task::silent()).unwrap_err();
    assert!(e.to_string().starts_with("option criterion: the arm reaches no pose of the sphere"));
}

#[test]
fn a_ball_out_of_reach_says_which_and_why() {
    let (robot, mut cell) = irb120();
    cell.balls[1].x = 3.0;
    let options = PlanOptions { attempts_per_candidate: 3, ..PlanOptions::default() };
    let e = plan_touches(&robot, &cell, &options, &Task::silent()).unwrap_err();
    assert_eq!(
        e.to_string(),
        "ball 2: 0 collision-free configurations found in 128 attempts, expected 15; all were out of reach: the ball is too far away, \
         or the joints do not turn the device every way"
    );
}

#[test]
fn bad_options_are_named() {
    let (robot, mut cell) = irb120();
    let with = |options: PlanOptions| {
        let (robot, cell) = irb120();
        plan_touches(&robot, &cell, &options, &Task::silent()).unwrap_err().to_string()
    };
    assert_eq!(
        with(PlanOptions { pool_per_ball: 3, ..PlanOptions::default() }),
        "option pool_per_ball: found 3, expected at least per_ball, 15"
    );
    assert!(with(PlanOptions { max_tilt_rad: f64::NAN, ..PlanOptions::default() }).starts_with("option max_tilt_rad"));
    let mut q = [0.0; MAX_JOINTS];
    q[0] = 3.1;
    assert_eq!(
        with(PlanOptions { start: Some(q), ..PlanOptions::default() }),
        "the start configuration is not usable: it is beyond joint limits"
    );
    cell.balls.clear();
    assert_eq!(plan_touches(&robot, &cell, &PlanOptions::default(), &Task::silent()).unwrap_err(), PlanError::NoBalls);
}

#[test]
fn lost_motion_can_be_a_parameter() {
    use trical_model::{Basis, Site, Term};
    let (robot, cell) = irb120();
    let mut terms = usual_parameters(&robot);
    for joint in 1..=6 {
        terms.push(Term::new(format!("gap_{joint}"), "lost_motion", Site::Joint { joint }, Basis::direction(joint)));
    }
    let options = PlanOptions { parameters: Some(terms), ..PlanOptions::default() };
    let plan = quiet(&robot, &cell, &options);
    assert_eq!(plan.expected.parameters.len(), 37, "{:?}", plan.expected.dependent);
    assert!(plan.expected.condition < 1000.0);
}

#[test]
fn what_a_plan_cannot_know_is_no_parameter() {
    use trical_model::{Basis, Shape, Site, Term, Variable};
    let (robot, cell) = irb120();
    let site = Site::Joint { joint: 2 };
    let term = Term::new("drift", "drift", site, Basis::new(Variable::Time, Shape::Linear));
    let options = PlanOptions { parameters: Some(vec![term]), ..PlanOptions::default() };
    let e = plan_touches(&robot, &cell, &options, &Task::silent()).unwrap_err();
    assert_eq!(e.to_string(), "term 'drift' needs time (t_s), which the recording does not contain");
    let options = PlanOptions { parameters: Some(vec![]), ..PlanOptions::default() };
    let e = plan_touches(&robot, &cell, &options, &Task::silent()).unwrap_err();
    assert_eq!(e, PlanError::NothingObservable { parameters: 0 });
}

#[test]
fn progress_rises_to_one() {
    let (robot, cell) = irb120();
    let options = PlanOptions { per_ball: 8, pool_per_ball: 20, ..PlanOptions::default() };
    let heard = std::cell::RefCell::new(vec![]);
    plan_touches(&robot, &cell, &options, &Task::new(&|x, _| heard.borrow_mut().push(x))).unwrap();
    let heard = heard.into_inner();
    assert!(heard.windows(2).all(|w| w[0] <= w[1]));
    assert_eq!((heard[0], *heard.last().unwrap()), (0.0, 1.0));
}
