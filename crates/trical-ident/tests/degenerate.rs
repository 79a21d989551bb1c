//! Data that cannot be fitted: each kind gets its own sentence.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_ident::{
    Dataset, Expected, IdentError, JointSource, ModelFile, Options, ParameterSet, calibrate, identify, parse_csv,
    reject_gross_errors, validate,
};
use trical_model::{Cell, Forward, Measured, Model, Pose, Recording, Robot, Row, State, Task};

const ROBOT: &str = include_str!("../../trical-model/tests/data/arm.toml");
const CELL: &str = include_str!("../../trical-model/tests/data/cell.toml");

fn robot() -> Robot {
    Robot::parse(ROBOT, "arm.toml").unwrap()
}

fn cell() -> Cell {
    Cell::parse(CELL, "cell.toml").unwrap()
}

/// What an instrument sees of the TCP at `count` poses drawn by `draw`, to a hundredth of a millimetre.
fn points(count: usize, mut draw: impl FnMut(&mut Pcg64Mcg, usize) -> Vec<f64>) -> Recording {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let forward = Forward::new(Model::nominal(robot(), cell()), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let rows = (0..count)
        .map(|k| {
            let state = State::at(&draw(&mut rng, k));
            let p = forward.world_from_tool(&state, &mut ws).translation;
            let position = std::array::from_fn(|i| p[i] + rng.random_range(-1e-5..1e-5));
            Row { state, measured: Measured::Point { target: 0, position }, seq: None, line: k + 2 }
        })
        .collect();
    Recording { name: "r.csv".into(), joints: 6, rows, ..Recording::default() }
}

fn varied(rng: &mut Pcg64Mcg, _: usize) -> Vec<f64> {
    (0..6).map(|_| rng.random_range(-1.0..1.0)).collect()
}

/// Touches at varied poses of the balls in turn, by inverse kinematics.
fn touches(cell: &Cell, balls: &[usize]) -> Recording {
    let mut rng = Pcg64Mcg::seed_from_u64(2);
    let forward = Forward::new(Model::nominal(robot(), cell.clone()), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let mut rows = Vec::new();
    while rows.len() < 60 {
        let ball = balls[rows.len() % balls.len()];
        let rotation = trical_model::pose::rotation_z(rng.random_range(-3.0..3.0))
            * trical_model::pose::rotation_x(3.1 + rng.random_range(-0.9..0.9));
        let at = Pose { rotation, translation: cell.balls[ball] };
        let Ok(all) = trical_model::inverse_kinematics(&forward, &at, &State::at(&[0.0; 6]), &mut ws) else { continue };
        let state = State::at(&all[rng.random_range(0..all.len())].joints);
        let reading = std::array::from_fn(|_| rng.random_range(-1e-5..1e-5));
        rows.push(Row { state, measured: Measured::Touch { ball, reading }, seq: None, line: rows.len() + 2 });
    }
    Recording { name: "r.csv".into(), joints: 6, rows, ..Recording::default() }
}

/// As the program does it: gross errors out, then the fit.
fn fit(cell: &Cell, recording: Recording, set: ParameterSet) -> Result<(), IdentError> {
    let data = Dataset::build(&[recording], JointSource::Read, None)?;
    let data = reject_gross_errors(&robot(), cell, &data)?;
    identify(&robot(), cell, &data, set).map(|_| ())
}

fn refused(cell: &Cell, recording: Recording, words: &[&str]) -> String {
    let e = fit(cell, recording, ParameterSet::Geometry).expect_err("refused").to_string();
    for w in words {
        assert!(e.contains(w), "'{w}' is missing in: {e}");
    }
    assert!(!e.contains('\n'), "{e}");
    e
}

#[test]
fn errors_that_no_arm_has_are_refused() {
    let mut rng = Pcg64Mcg::seed_from_u64(4);
    let mut elsewhere = points(60, varied);
    for row in &mut elsewhere.rows {
        if let Measured::Point { position, .. } = &mut row.measured {
            position.iter_mut().for_each(|x| *x += rng.random_range(-0.15..0.15));
        }
    }
    let calibrated = |recording, set| {
        let options = Options { keep_outliers: true, ..Options::new(set) };
        calibrate(&robot(), &cell(), &[recording], &options, &Task::silent()).map(|_| ())
    };
    let said = calibrated(elsewhere.clone(), ParameterSet::Geometry).unwrap_err().to_string();
    assert!(said.contains("mm off, more than any arm"), "{said}");
    calibrated(elsewhere, ParameterSet::Nominal).unwrap();
    calibrated(points(60, varied), ParameterSet::Geometry).unwrap();
}

#[test]
fn varied_poses_are_enough() {
    fit(&cell(), points(60, varied), ParameterSet::Geometry).unwrap();
    fit(&cell(), touches(&cell(), &[0, 1, 2]), ParameterSet::Geometry).unwrap();
}

#[test]
fn too_few_poses_are_counted() {
    // 6 of the frame, 3 of the target, 18 of the arm
    refused(&cell(), points(8, varied), &["8 measurements give 24 numbers", "27 parameters"]);
    // and a smaller model is not refused because of a larger one
    fit(&cell(), points(8, varied), ParameterSet::Nominal).unwrap();
    assert!(fit(&cell(), points(2, varied), ParameterSet::Nominal).is_err());
}

#[test]
fn poses_that_are_all_alike_are_called_so() {
    let still = |_: &mut Pcg64Mcg, _: usize| vec![0.1, 0.2, 0.3, 0.4, 0.5, 0.6];
    refused(&cell(), points(60, still), &["r.csv", "60 measurements", "same pose"]);
    let trembling = |rng: &mut Pcg64Mcg, _: usize| (0..6).map(|_| 0.3 + rng.random_range(-1e-4..1e-4)).collect();
    refused(&cell(), points(60, trembling), &["60 measurements", "same pose"]);
}

#[test]
fn what_a_joint_that_rests_would_tell_is_held_and_too_few_poses_name_what_they_cannot_tell() {
    let resting = |rng: &mut Pcg64Mcg, k: usize| {
        let mut q = varied(rng, k);
        q[3] = 0.2;
        q
    };
    // what only the motion of joint 4 tells is held, and said; the rest is found
    let found =
        calibrate(&robot(), &cell(), &[points(60, resting)], &Options::new(ParameterSet::Geometry), &Task::silent());
    let found = found.unwrap();
    let cautions = found.cautions().join("\n");
    assert!(cautions.contains("joint 4 hardly moves"), "{cautions}");
    // the four numbers of an axis fewer: what is before joint 4 and what is behind it are one link then
    let held = found.fitted.held();
    assert!(held.len() == 4 && held.iter().all(|name| cautions.contains(name)), "{cautions}");
    assert!(found.fitted.free.len() == 23 && found.errors.max_mm < 0.03, "{:?}", found.errors);
    // where joint 4 is elsewhere, the model knows that it may be off by what was held
    let file = ModelFile::of_fit(&found.fitted);
    let at = |q4: f64| State::at(&[0.3, 0.2, 0.1, q4, 0.5, 0.6]);
    assert_eq!((file.visited().beyond(&at(0.2).q), file.visited().beyond(&at(1.2).q)), (None, Some(4)));
    let expected = Expected::of(&file).unwrap().unwrap();
    let [near, away] = [0.2, 1.2].map(|q4| expected.deviation(&at(q4)) * 1e3);
    assert!(near < 0.05 && (0.5..5.0).contains(&away), "{near} {away}");
    let elsewhere = validate(&robot(), &cell(), &file, &[points(60, varied)], None, None).unwrap();
    assert!(elsewhere.beyond > Some(50) && elsewhere.predicted.unwrap().sd_mm > 0.5);
    let few = |_: &mut Pcg64Mcg, k: usize| {
        let mut rng = Pcg64Mcg::seed_from_u64(100 + (k % 5) as u64);
        varied(&mut rng, 0)
    };
    refused(&cell(), points(60, few), &["cannot tell", "60 measurements at 5 different poses"]);
}

#[test]
fn balls_in_one_place_or_on_one_line_or_too_few_are_named() {
    let with = |positions: &str| {
        let (head, _) = CELL.split_once("[balls]").unwrap();
        Cell::parse(&format!("{head}[balls]\npositions_mm = {positions}\n"), "cell.toml").unwrap()
    };
    let same = with("[[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [150.0, 260.0, 0.0]]");
    refused(&same, touches(&same, &[0, 1, 2]), &["balls 1 and 2", "same place"]);
    let line = with("[[10.0, 200.0, 5.0], [160.0, 200.0, 5.0], [310.0, 200.0, 5.0]]");
    refused(&line, touches(&line, &[0, 1, 2]), &["balls 1, 2, 3", "one line"]);
    // a ball that nobody touches does not matter
    let fourth = with("[[0.0, 0.0, 0.0], [300.0, 0.0, 0.0], [150.0, 260.0, 0.0], [0.0, 0.0, 0.0]]");
    fit(&fourth, touches(&fourth, &[0, 1, 2]), ParameterSet::Geometry).unwrap();
    refused(&cell(), touches(&cell(), &[0, 2]), &["only balls 1 and 3 were touched"]);
    refused(&cell(), touches(&cell(), &[1]), &["only ball 2 was touched"]);
}

#[test]
fn numbers_that_no_arm_gives_are_refused_with_their_line() {
    let broken = |change: &dyn Fn(&mut Row)| {
        let mut r = points(60, varied);
        change(&mut r.rows[7]);
        r
    };
    let position = |x: f64| {
        move |row: &mut Row| {
            if let Measured::Point { position, .. } = &mut row.measured {
                position[1] = x;
            }
        }
    };
    refused(&cell(), broken(&|row| row.state.q[2] = 1e9_f64.to_radians()), &["r.csv, line 9", "joint 3", "deg"]);
    refused(&cell(), broken(&|row| row.state.q[2] = f64::NAN), &["r.csv, line 9", "joint 3", "NaN"]);
    refused(&cell(), broken(&position(1e6)), &["r.csv, line 9", "1000000000 mm", "kilometre"]);
    refused(&cell(), broken(&position(f64::INFINITY)), &["r.csv, line 9", "inf"]);
    // a CSV says it by column
    let csv = |q3: &str, y: &str| {
        let text = format!("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm\n1,2,{q3},4,5,6,7,{y},9\n");
        parse_csv(text.as_bytes(), "r.csv", 6).map_err(|e| e.to_string())
    };
    assert!(csv("3", "8").is_ok());
    let e = csv("100000001", "8").unwrap_err();
    assert!(e.contains("line 2, column q3_deg") && e.contains("100000"), "{e}");
    let e = csv("3", "1e8").unwrap_err();
    assert!(e.contains("line 2, column y_mm") && e.contains("1000000"), "{e}");
    assert!(csv("3", "inf").unwrap_err().contains("column y_mm"));
}

#[test]
fn points_of_which_nobody_says_the_target_are_told_where_the_cell_has_several() {
    let mut several = cell();
    several.tool.targets.push(several.tool.tcp + nalgebra::Vector3::new(0.05, 0.0, 0.02));
    let said = |cell: &Cell, recording: Recording| {
        let data = Dataset::build(&[recording], JointSource::Read, None).unwrap();
        trical_ident::fit::cautions::which_target(&data, cell.tool.targets.len())
    };
    let one = points(30, varied);
    assert_eq!(said(&cell(), one.clone()), None);
    let told = said(&several, one.clone()).unwrap();
    assert!(told.contains("has 2 targets") && told.contains("column `target`"), "{told}");
    let mut both = one;
    if let Some(Measured::Point { target, .. }) = both.rows.last_mut().map(|r| &mut r.measured) {
        *target = 1;
    }
    assert_eq!(said(&several, both), None);
}

#[test]
fn points_in_metres_are_told_beside_a_recording_of_touches() {
    let mut metres = points(40, varied);
    metres.name = "points.csv".into();
    for row in &mut metres.rows {
        if let Measured::Point { position, .. } = &mut row.measured {
            position.iter_mut().for_each(|p| *p *= 1e-3);
        }
    }
    let both = [touches(&cell(), &[0, 1, 2]), metres];
    let data = Dataset::build(&both, JointSource::Read, None).unwrap();
    let e = identify(&robot(), &cell(), &data, ParameterSet::Geometry).unwrap_err().to_string();
    assert!(e.starts_with("points.csv") && e.contains("found what looks like m"), "{e}");
}

/// Of an arm that turns: how far a joint slides would say nothing of it.
#[test]
fn angles_in_degrees_under_names_of_radians_are_told() {
    let mut recording = points(40, varied);
    recording.rows.iter_mut().for_each(|r| r.state.q.iter_mut().for_each(|q| *q = q.to_degrees()));
    let data = Dataset::build(&[recording], JointSource::Read, None).unwrap();
    let e = identify(&robot(), &cell(), &data, ParameterSet::Geometry).unwrap_err().to_string();
    assert!(e.contains("a joint turns to ") && e.ends_with("expected rad, found what looks like deg"), "{e}");
}
