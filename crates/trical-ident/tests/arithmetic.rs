//! Small claims about fits, noise, observability and what is left out, each checked by hand or by its definition. Deliberate
//! errors in the code (see docs/hardening.md) went unnoticed without them.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_ident::dense::Mat;
use trical_ident::fit::gross_errors::reject_gross_errors_beyond;
use trical_ident::fit::identifiability::observability;
use trical_ident::fit::levenberg_marquardt::{LmParams, minimize};
use trical_ident::fit::residuals::{check_count, orientation_errors, position_errors, weighted_residuals};
use trical_ident::{Dataset, JointSource, ModelFile, Noise, ParameterSet, Refit, cross_validate, validate};
use trical_model::{Axis, Basis, Cell, Forward, Measured, Model, Motion, Recording, Robot, Row, Site, State, Term};

const ROBOT: &str = include_str!("../../trical-model/tests/data/arm.toml");
const CELL: &str = include_str!("../../trical-model/tests/data/cell.toml");

fn nominal() -> Model {
    Model::nominal(Robot::parse(ROBOT, "arm.toml").unwrap(), Cell::parse(CELL, "cell.toml").unwrap())
}

fn dataset(rows: Vec<Row>) -> Dataset {
    let recording = Recording { name: "made".into(), joints: 6, rows, ..Recording::default() };
    Dataset::build(&[recording], JointSource::Read, None).unwrap()
}

#[test]
fn poses_are_numbered_as_the_recording_says_or_counted() {
    let row = |seq: Option<u64>, q: f64| Row {
        state: State::at(&[q; 6]),
        measured: Measured::Touch { ball: 0, reading: [0.0; 3] },
        seq,
        line: 0,
    };
    let numbers =
        |rows: &[Row]| dataset(rows.to_vec()).observations.iter().filter_map(|o| o.state.seq).collect::<Vec<f64>>();
    assert_eq!(numbers(&[row(Some(4), 0.1), row(Some(4), 0.1), row(Some(9), 0.2)]), [4.0, 4.0, 9.0]);
    assert_eq!(numbers(&[row(None, 0.1), row(None, 0.2)]), [0.0, 1.0]);
    // rows are in the order of time, so these are not
    assert_eq!(numbers(&[row(Some(9), 0.1), row(Some(4), 0.2), row(Some(4), 0.2)]), [0.0, 1.0, 1.0]);
}

/// Touches of the nominal arm anywhere, each reading off by what `off` says.
fn touches(n: usize, off: impl FnMut(usize, &mut Pcg64Mcg) -> [f64; 3]) -> Dataset {
    dataset(touch_rows(n, off))
}

fn touch_rows(n: usize, mut off: impl FnMut(usize, &mut Pcg64Mcg) -> [f64; 3]) -> Vec<Row> {
    let mut rng = Pcg64Mcg::seed_from_u64(7);
    let model = nominal();
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    (0..n)
        .map(|k| {
            let q: [f64; 6] = std::array::from_fn(|_| rng.random_range(-1.2..1.2));
            let state = State::at(&q);
            let pose = forward.world_from_tool(&state, &mut ws);
            let i = pose.rotation.transpose() * (model.cell.balls[k % 3] - pose.translation);
            let off = off(k, &mut rng);
            let reading = std::array::from_fn(|a| i[a] + off[a]);
            Row { state, measured: Measured::Touch { ball: k % 3, reading }, seq: None, line: k + 2 }
        })
        .collect()
}

/// Noise of 10 um and standard normal distribution, nearly: a sum of twelve.
fn noise(rng: &mut Pcg64Mcg) -> [f64; 3] {
    std::array::from_fn(|_| 1e-5 * (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>())
}

fn tool_terms(model: &mut Model) {
    for (name, axis) in [("tool_x", Axis::X), ("tool_y", Axis::Y), ("tool_z", Axis::Z)] {
        model.terms.push(Term::new(name, "tool", Site::Tool(Motion::Along(axis)), Basis::CONSTANT));
    }
}

#[test]
fn as_many_numbers_as_parameters_are_enough() {
    let data = touches(2, |_, _| [0.0; 3]);
    assert_eq!(check_count(&data, 6, &[]).unwrap(), 6);
    assert!(check_count(&data, 7, &[]).is_err());
}

#[test]
fn rotations_have_no_part_in_a_position_error() {
    let mut model = nominal();
    model.frames = vec![trical_model::Pose::identity()];
    let forward = Forward::new(model, Vec::new()).unwrap();
    let state = State::at(&[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]);
    let pose = forward.world_from_tool(&state, &mut forward.workspace());
    // 3 um and 4 um off in place, and turned by a tenth of a radian more
    let turned = pose.rotation * trical_model::pose::rotation_x(0.1);
    let position = [pose.translation.x + 3e-6, pose.translation.y - 4e-6, pose.translation.z];
    let quaternion = trical_model::pose::quaternion_from_rotation(&turned);
    let row = Row { state, measured: Measured::Pose { position, quaternion }, seq: None, line: 2 };
    let data = dataset(vec![row]);
    let errors = position_errors(&forward, &data);
    assert!((errors[0] - 5e-6).abs() < 1e-12, "{errors:?}");
    let turns = orientation_errors(&forward, &data);
    assert!(turns.len() == 1 && (turns[0] - 0.1).abs() < 1e-12, "{turns:?}");
}

#[test]
fn a_robust_fit_ends_where_hubers_cost_is_least() {
    const LIMIT: f64 = 2.0;
    let data = touches(40, |k, rng| {
        let mut off = noise(rng);
        off[0] += if k % 3 == 0 { 3e-4 } else { 0.0 };
        off
    });
    let mut model = nominal();
    tool_terms(&mut model);
    let mut forward = Forward::new(model, vec![0, 1, 2]).unwrap();
    let usual = Noise::usual(1);
    let report = minimize(&mut forward, &data, &usual, &LmParams { huber: LIMIT, ..LmParams::default() }).unwrap();
    let cost = |forward: &Forward| -> f64 {
        let length = |r: &([f64; 6], usize)| r.0[..r.1].iter().map(|v| v * v).sum::<f64>().sqrt();
        let one = |s: f64| if s <= LIMIT { 0.5 * s * s } else { LIMIT * s - 0.5 * LIMIT * LIMIT };
        weighted_residuals(forward, &data, &usual).iter().map(|r| one(length(r))).sum()
    };
    let least = cost(&forward);
    assert!((report.cost - least).abs() < 1e-9 * least);
    let x = forward.coefficients();
    for k in 0..3 {
        for step in [-2e-7, 2e-7] {
            let mut aside = x.clone();
            aside[k] += step;
            forward.set_coefficients(&aside);
            assert!(cost(&forward) > least, "coefficient {k}, {step}");
        }
    }
}

#[test]
fn the_noise_counts_degrees_of_freedom_and_medians_as_a_normal_distribution_has_them() {
    let data = touches(20, |_, _| [0.0; 3]);
    let of = |noise: &Noise| noise.sigma(0, &data.observations[0].measured, 0);
    let usual = Noise::usual(1);
    let mut updated = usual.clone();
    // 60 residuals of one sigma each, 15 of them spent on parameters
    updated.update(&data, &vec![([1.0, -1.0, 1.0, 0.0, 0.0, 0.0], 3); 20], 15);
    assert!((of(&updated) / of(&usual) - (60.0_f64 / 45.0).sqrt()).abs() < 1e-12);
    // half of a normal distribution lies within 0.6745 sigma
    let mut robust = usual.clone();
    robust.update_robustly(&data, &vec![([0.6745, -0.6745, 0.6745, 0.0, 0.0, 0.0], 3); 20]);
    assert!((of(&robust) / of(&usual) - 1.0).abs() < 1e-12);
}

#[test]
fn observability_and_covariance_of_a_matrix_done_by_hand() {
    // R = [2 1; 0 3]: R'R = [4 2; 2 10], whose inverse is [10 -2; -2 4] / 36; columns of length 2 and sqrt 10 at a cosine of
    // 2 / (2 sqrt 10), so the singular values multiply to sqrt(1 - 1/10)
    let r = Mat::from_fn(2, 2, |i, j| [[2.0, 1.0], [0.0, 3.0]][i][j]);
    let (o, covariance) = observability(&r, 25);
    for (found, expected) in covariance.iter().zip([10.0, -2.0, -2.0, 4.0]) {
        assert!((found - expected / 36.0).abs() < 1e-15, "{covariance:?}");
    }
    assert!((o.o1 - 0.9_f64.powf(0.25) / 5.0).abs() < 1e-12, "{o:?}");
    let (large, small) = ((1.0 + 0.1_f64.sqrt()).sqrt(), (1.0 - 0.1_f64.sqrt()).sqrt());
    assert!((o.condition - large / small).abs() < 1e-12 && (o.o3 - small).abs() < 1e-12);
    assert!((o.o2 - small / large).abs() < 1e-12 && (o.o4 - small * small / large).abs() < 1e-12, "{o:?}");
    assert!((o.o5 - 1.0 / (1.0 / large + 1.0 / small)).abs() < 1e-12 && o.rows == 25, "{o:?}");
}

/// Up to a condition of a thousand singular values come from products, beyond from the factor itself.
#[test]
fn the_condition_is_right_for_nearly_dependent_columns_too() {
    for apart in [0.5_f64, 4e-3, 1e-3, 1e-7] {
        // two columns of length 1 at the angle `apart`: singular values sqrt(1 +- cos)
        let r = Mat::from_fn(2, 2, |i, j| [[1.0, apart.cos()], [0.0, apart.sin()]][i][j]);
        let (_, s) = trical_ident::fit::identifiability::spectrum(&r).unwrap();
        let small = 2.0_f64.sqrt() * (0.5 * apart).sin();
        assert!((s[1] / small - 1.0).abs() < 1e-8, "{apart}: {s:?}, {small}");
        assert!((s[0] - 2.0_f64.sqrt() * (0.5 * apart).cos()).abs() < 1e-12);
    }
    assert_eq!(trical_ident::fit::identifiability::spectrum(&Mat::zeros(0, 0)), Some((vec![], vec![])));
}

#[test]
fn what_cannot_be_told_apart_is_named() {
    let names = ["a", "b", "c"].map(str::to_owned);
    // the second column is the first, but for a hair, and the third by itself
    let with = |hair: f64| Mat::from_fn(3, 3, |i, j| [[1.0, 2.0, 0.0], [0.0, 2.0 * hair, 0.0], [0.0, 0.0, 5.0]][i][j]);
    let weakest = |hair| trical_ident::fit::identifiability::weakest_direction(&with(hair), &names, 1e6);
    assert_eq!(weakest(1e-8), Some(vec!["a".to_owned(), "b".to_owned()]));
    assert_eq!(weakest(1e-5), None);
    let none = Mat::from_fn(2, 2, |i, j| if i == 0 && j == 0 { 1.0 } else { 0.0 });
    assert_eq!(trical_ident::fit::identifiability::weakest_direction(&none, &names, 1e6), Some(vec!["b".to_owned()]));
}

#[test]
fn a_bumped_reference_is_noticed_and_a_scattered_one_is_not() {
    let places = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut rng = Pcg64Mcg::seed_from_u64(2);
    let mut rows = Vec::new();
    for pose in 0..12_u32 {
        let state = State::at(&[0.01 * f64::from(pose); 6]);
        let mut add = |measured| {
            rows.push(Row { state, measured, seq: Some(pose.into()), line: rows.len() + 2 });
        };
        for (reference, place) in places.iter().enumerate() {
            // one reference was bumped by 1 mm before pose 7 was seen; the instrument scatters by 5 um
            let bump = if pose == 7 && reference == 2 { 1e-3 } else { 0.0 };
            let position = place.map(|p| p + bump + 5e-6 * rng.random_range(-1.0..1.0));
            add(Measured::Reference { reference, position });
        }
        add(Measured::Point { target: 0, position: [0.5, 0.5, 0.5] });
    }
    let data = dataset(rows);
    assert_eq!(data.rejected.len(), 1, "{:?}", data.rejected);
    assert!(data.rejected[0].row == 40 && data.rejected[0].reason.contains("off its place"), "{:?}", data.rejected);
    assert_eq!(data.observations.len(), 11);
}

#[test]
fn rows_of_one_number_but_other_joints_are_two_poses() {
    let row = |q: f64, line| Row {
        state: State::at(&[q; 6]),
        measured: Measured::Point { target: 0, position: [0.0; 3] },
        seq: Some(1),
        line,
    };
    assert_eq!(dataset(vec![row(0.1, 2), row(0.1, 3)]).poses, 1);
    assert_eq!(dataset(vec![row(0.1, 2), row(0.2, 3)]).poses, 2);
}

#[test]
fn a_touch_beyond_the_limit_is_rejected_and_its_ball_is_not_blamed() {
    let data = touches(120, |k, rng| {
        let mut off = noise(rng);
        off[0] += if k == 50 { 9e-5 } else { 0.0 };
        off
    });
    let model = nominal();
    let kept = reject_gross_errors_beyond(&model.robot, &model.cell, &data, 6.0).unwrap();
    let rejected: Vec<usize> = kept.rejected.iter().map(|r| r.row).collect();
    assert_eq!(rejected, [51], "{:?}", kept.rejected);
    assert!(!kept.rejected[0].reason.contains("it fits ball"), "{}", kept.rejected[0].reason);
}

#[test]
fn a_gap_is_positive_in_a_model_file_as_it_is_told_and_older_files_mean_what_they_did() {
    let mut model = nominal();
    let gap = Term::new("half_gap_2", "lost_motion_direction", Site::Joint { joint: 2 }, Basis::direction(2));
    model.terms = vec![Term { value: -0.02_f64.to_radians(), sd: Some(1e-3_f64.to_radians()), ..gap }];
    let text = ModelFile::unmeasured(model.clone()).to_toml().unwrap();
    let term = text.split("[[term]]").nth(1).unwrap();
    assert!(term.contains("value = 0.02") && term.contains("sd = 0.001"), "{term}");
    assert_eq!(trical_ident::shown(&model, &model.terms[0]).value, 0.02);
    let back = ModelFile::parse(&text, "m.toml").unwrap().model.terms[0].value;
    assert!((back - model.terms[0].value).abs() < 1e-15);
    let older = text.replace("format_version = 3", "format_version = 2").replace("value = 0.02", "value = -0.02");
    assert_eq!(ModelFile::parse(&older, "m.toml").unwrap().model.terms[0].value, back);
}

#[test]
fn a_jump_of_a_sliding_joint_is_in_mm_in_a_model_file_and_earlier_builds_deg_is_read_as_it_was_meant() {
    let mut model = nominal();
    model.robot.joints[1].kind = trical_model::JointKind::Prismatic;
    let jump = Term::new("zero_shift_2", "joint_zero_shift", Site::Joint { joint: 2 }, Basis::CONSTANT);
    model.terms = vec![Term { value: 3e-4, ..jump }];
    let text = ModelFile::unmeasured(model).to_toml().unwrap();
    let value = |text: &str| ModelFile::parse(text, "m.toml").map(|file| file.model.terms[0].value);
    assert!((value(&text).unwrap() - 3e-4).abs() < 1e-15);
    let (before, term) = text.split_once("[[term]]").unwrap();
    assert!(term.contains("unit = \"mm\""), "{term}");
    let at = |value: &str, unit: &str| {
        let line = |l: &str| if l.starts_with("value = ") { format!("value = {value}") } else { l.to_owned() };
        let term = term.replace("unit = \"mm\"", &format!("unit = \"{unit}\""));
        format!("{before}[[term]]{}", term.lines().map(line).collect::<Vec<_>>().join("\n"))
    };
    assert!((value(&at("0.3", "mm")).unwrap() - 3e-4).abs() < 1e-15);
    assert!((value(&at("0.0171887338539247", "deg")).unwrap() - 3e-4).abs() < 1e-15);
    let error = value(&at("0.3", "mm/K")).unwrap_err().to_string();
    assert!(error.contains("unit 'mm/K', expected 'mm'"), "{error}");
}

#[test]
fn a_refit_is_scored_on_the_other_poses_and_regions_lose_nothing() {
    let recording =
        Recording { name: "made".into(), joints: 6, rows: touch_rows(40, |_, rng| noise(rng)), ..Recording::default() };
    let model = nominal();
    let file = ModelFile::unmeasured(model.clone());
    let recordings = std::slice::from_ref(&recording);
    let scored = |refit| validate(&model.robot, &model.cell, &file, recordings, None, refit).unwrap();
    let whole = scored(None);
    assert_eq!((whole.n, whole.errors.len()), (40, 40));
    for joint in 1..=6 {
        let of_joint = whole.regions.iter().filter(|r| r.region.starts_with(&format!("q{joint} ")));
        assert_eq!(of_joint.map(|r| r.n).sum::<usize>(), 40, "q{joint}");
    }
    let again = scored(Some(Refit { frame: true, targets: true }));
    let fourth: Vec<usize> = (0..40).filter(|p| p % 4 == 0).collect();
    assert_eq!(again.n, 30);
    assert!(again.data.observations.iter().all(|o| !fourth.contains(&o.pose)));
}

#[test]
fn two_folds_are_the_fewest_and_each_needs_blocks_of_its_own() {
    let data = touches(60, |_, rng| noise(rng));
    let model = nominal();
    let of = |folds: usize| cross_validate(&model.robot, &model.cell, &data, ParameterSet::Nominal, folds);
    assert_eq!(of(2).unwrap().len(), 60);
    for folds in [0, 1, 31] {
        let error = of(folds).unwrap_err().to_string();
        assert!(error.contains(&format!("{folds}-fold cross-validation needs at least 2 folds")), "{error}");
    }
}

#[test]
fn joints_that_hardly_move_are_told_where_that_held_something() {
    let model = nominal();
    let said = |still: bool, names: &[&str]| {
        let mut rows = touch_rows(20, |_, rng| noise(rng));
        rows.iter_mut().filter(|_| still).for_each(|row| row.state.q[3] = 0.1);
        trical_ident::fit::cautions::held(&model.robot, &dataset(rows), names)
    };
    assert!(said(true, &["a_3", "d_4"]).unwrap().starts_with("joint 4 hardly moves"));
    assert_eq!((said(true, &[]), said(false, &["a_3"]), said(false, &[])), (None, None, None));
}

#[test]
fn places_of_targets_balls_and_anchors_are_shown_where_they_are() {
    let mut model = nominal();
    model.cell.tool.targets = vec![nalgebra::Vector3::zeros(), nalgebra::Vector3::new(0.01, 0.02, 0.03)];
    model.cell.anchors = vec![nalgebra::Vector3::new(1.0, 2.0, 3.0)];
    let ball = 1e3 * model.cell.balls[1].y;
    let axis = Axis::Y;
    for (site, nominal_mm) in [
        (Site::Target { target: 2, axis }, 20.0),
        (Site::Ball { ball: 2, axis }, ball),
        (Site::Anchor { anchor: 1, axis }, 2000.0),
    ] {
        let term = Term { value: 1e-3, ..Term::new("place", "place", site, Basis::CONSTANT) };
        let value = trical_ident::shown(&model, &term).value;
        assert!((value - nominal_mm - 1.0).abs() < 1e-9, "{site:?}: {value}");
    }
}

#[test]
fn what_others_do_too_is_left_out_and_told_with_them() {
    let data = touches(80, |_, rng| noise(rng));
    let model = nominal();
    let fitted = trical_ident::identify(&model.robot, &model.cell, &data, ParameterSet::Geometry).unwrap();
    let told = fitted.left_out();
    for part in ["d_2 (moves together with d_3)", "theta_6 (moves together with tool_x, tool_y)"] {
        assert!(told.iter().any(|said| said == part), "{told:?}");
    }
}

#[test]
fn a_model_without_terms_is_a_model_file_and_a_text_without_either_is_none() {
    let text = ModelFile::unmeasured(nominal()).to_toml().unwrap();
    assert!(!text.contains("[[term]]"));
    assert!(ModelFile::parse(&text, "m.toml").unwrap().model.terms.is_empty());
    let error = ModelFile::parse(ROBOT, "arm.toml").unwrap_err().to_string();
    assert!(error.contains("is not a model file"), "{error}");
}
