//! Sessions: what belongs to the arm is learnt from all of them and holds in others; frame, tool and what happened on the day are each one's own.

use std::cell::RefCell;

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_ident::calibration::score_sessions;
use trical_ident::model_file::Uncertainty;
use trical_ident::{
    Aim, Calibration, Dataset, JointSource, ModelFile, Noise, Options, ParameterSet, Refit, Scatter, ToolSharing,
    calibrate, fit_model, identify, simulate, validate,
};
use trical_model::pose::rotation_zyx;
use trical_model::{
    Axis, Basis, Forward, Model, Motion, Pose, Recording, Scope, Shape, Site, State, Task, Term, Variable,
};

/// Standard deviation of each coordinate, m.
const NOISE: f64 = 1e-5;
/// The mean length of a vector whose three coordinates have that, mm: what a right model misses by.
const LEAST_MM: f64 = 1.6e-2;

/// The arm that all sessions share, with three targets on its tool: every parameter off by chance.
pub fn truth() -> Model {
    let mut model = crate::arm::truth(ParameterSet::Compliance, 11);
    let targets = [[18.0, -12.0, 118.0], [60.0, 20.0, 90.0], [-30.0, 40.0, 100.0]];
    model.cell.tool.targets = targets.map(|t| Vector3::from(t) * 1e-3).to_vec();
    model
}

/// What a tracker saw of that arm: its frame stood somewhere else in each session, the targets `off` (m) from where the cell says.
pub fn seen(truth: &Model, session: u64, off: [f64; 3]) -> Recording {
    measured(truth, session, off, 150, 0.0, |k| Aim::Target(k % 3))
}

/// So many measurements of any kind by that tracker, orientations with a standard deviation of `angle` (rad) about each axis.
pub fn measured(
    truth: &Model,
    session: u64,
    off: [f64; 3],
    count: usize,
    angle: f64,
    aim: impl Fn(usize) -> Aim,
) -> Recording {
    let mut model = truth.clone();
    for t in &mut model.cell.tool.targets {
        *t += Vector3::from(off);
    }
    let s = session as f64;
    let rotation = rotation_zyx(0.7 * s, 0.2 * s, -0.1 * s);
    model.frames = vec![Pose { rotation, translation: Vector3::new(2.0 - s, 0.5 * s, 0.3) }];
    let mut rng = Pcg64Mcg::seed_from_u64(session);
    let rows: Vec<(State, Aim)> = (0..count)
        .map(|k| {
            let q: Vec<f64> = model
                .robot
                .joints
                .iter()
                .map(|j| {
                    let [low, high] = j.limits;
                    rng.random_range(low.max(-2.0)..high.min(2.0))
                })
                .collect();
            let state = State { t: Some(20.0 * k as f64), ..State::at(&q) };
            (state, aim(k))
        })
        .collect();
    let scatter = Scatter { length: NOISE, angle, seed: 100 + session };
    Recording { name: format!("session{session}.csv"), ..simulate(&model, &rows, &scatter, None).unwrap() }
}

fn learnt(truth: &Model, recordings: &[Recording], tool: ToolSharing) -> Calibration {
    let options = Options { tool, ..Options::new(ParameterSet::Compliance) };
    calibrate(&truth.robot, &truth.cell, recordings, &options, &Task::silent()).unwrap()
}

fn file(c: &Calibration) -> ModelFile {
    ModelFile::of(c.fitted.model.clone(), &c.fitted.data)
}

/// A step of joint 3 in the course of session 1.
fn on_the_day() -> Term {
    let basis = Basis { of: Variable::Time, shape: Shape::Step { at: 1000.0 }, ..Basis::CONSTANT };
    let mut term = Term::new("step_3", "joint_zero_shift", Site::Joint { joint: 3 }, basis.in_session(1));
    term.value = 2e-3;
    term
}

#[test]
fn two_sessions_are_learnt_and_a_third_with_its_own_frame_and_tool_is_predicted_to_the_noise() {
    let truth = truth();
    let sessions = [seen(&truth, 1, [0.0; 3]), seen(&truth, 2, [2e-3, -1e-3, 3e-3])];
    let c = learnt(&truth, &sessions, ToolSharing::FromData);
    let file = ModelFile::parse(&file(&c).to_toml().unwrap(), "calibrated.toml").unwrap();
    let third = seen(&truth, 3, [-3e-3, 1e-3, 4e-3]);
    let v = validate(&truth.robot, &truth.cell, &file, &[third], None, None).unwrap();
    assert_eq!(v.sessions.len(), 1);
    let s = &v.sessions[0];
    assert_eq!((s.learnt, &s.refitted[..], s.from_poses, s.poses), (None, &["frame", "targets"][..], 38, 112));
    assert_eq!((s.n, v.n), (112, 112));
    assert!(v.before.mean_mm > 1.0, "{:?}", v.before);
    assert!(v.after.mean_mm < 1.3 * LEAST_MM, "{:?}", v.after);
    assert!(v.left_out.iter().all(|l| l.reason == "belongs to another session"), "{:?}", v.left_out);
    assert_eq!(s.in_words(), "session3.csv: frame and targets identified from 38 of its poses, the other 112 scored");
}

#[test]
fn whatever_is_measured_in_turn_is_among_the_poses_that_identify_a_session() {
    let truth = truth();
    let c = learnt(&truth, &[seen(&truth, 1, [0.0; 3])], ToolSharing::FromData);
    // every fourth measurement is of the first target
    let third = measured(&truth, 3, [-3e-3, 1e-3, 4e-3], 120, 0.0, |k| Aim::Target([0, 1, 2, 1][k % 4]));
    let v = validate(&truth.robot, &truth.cell, &file(&c), &[third], None, Some(Refit::ALL)).unwrap();
    // and every fourth of the others
    assert_eq!((v.sessions[0].from_poses, v.sessions[0].poses), (30 + 15 + 8, 67));
    assert!(v.after.mean_mm < 1.5 * LEAST_MM, "{:?}", v.after);
}

#[test]
fn a_model_file_says_where_it_was_learnt_and_validate_what_lies_beyond() {
    let truth = truth();
    // of the first session only what has joint 1 on one side
    let mut half = seen(&truth, 1, [0.0; 3]);
    half.rows.retain(|r| r.state.q[0] < 0.3);
    let c = learnt(&truth, &[half], ToolSharing::FromData);
    let mut file = ModelFile::parse(&file(&c).to_toml().unwrap(), "calibrated.toml").unwrap();
    let other = seen(&truth, 2, [0.0; 3]);
    let scored =
        |file: &ModelFile| validate(&truth.robot, &truth.cell, file, std::slice::from_ref(&other), None, None).unwrap();
    // geometry and compliance hold everywhere, a curve of joint 1's angle where it was learnt
    assert_eq!(scored(&file).beyond, Some(0));
    let basis = Basis::new(Variable::Joint { joint: 1 }, Shape::Sine { cycles: 3.0 });
    file.model.terms.push(Term::new("wave", "encoder_error", Site::Joint { joint: 1 }, basis));
    let v = scored(&file);
    let q = |o: &trical_ident::Observation| o.state.q[0];
    let surely = v.data.observations.iter().filter(|o| q(o) > 0.3 + 0.06).count();
    let perhaps = v.data.observations.iter().filter(|o| q(o) > 0.2).count();
    let beyond = v.beyond.unwrap();
    assert!((surely..=perhaps).contains(&beyond) && beyond > 20, "{surely} {beyond} {perhaps}");
    let [within, without] = [&v.regions[0], &v.regions[1]];
    assert_eq!((within.n + without.n, without.n), (v.n, beyond));
    assert!(v.beyond_in_words().unwrap().starts_with(&format!("{beyond} of {} measurements", v.n)));
}

#[test]
fn a_recording_that_the_model_was_learnt_on_is_known_again_and_nothing_is_refitted_there() {
    let truth = truth();
    let sessions = [seen(&truth, 1, [0.0; 3]), seen(&truth, 2, [2e-3, -1e-3, 3e-3])];
    let c = learnt(&truth, &sessions, ToolSharing::FromData);
    let [first, mut second] = sessions;
    // by what it holds, not by its name or its place in the list
    second.name = "renamed.csv".into();
    let v = validate(&truth.robot, &truth.cell, &file(&c), &[second, first], None, None).unwrap();
    assert_eq!(v.sessions.iter().map(|s| s.learnt).collect::<Vec<_>>(), [Some(2), Some(1)]);
    assert!(v.sessions.iter().all(|s| s.refitted.is_empty() && s.n == 150), "{:?}", v.sessions);
    assert!(v.left_out.is_empty(), "{:?}", v.left_out);
    assert!((v.after.mean_mm - c.errors.mean_mm).abs() < 1e-9, "{:?} {:?}", v.after, c.errors);
}

#[test]
fn what_happened_in_the_course_of_a_session_stays_there() {
    let truth = truth();
    let sessions = [seen(&truth, 1, [0.0; 3]), seen(&truth, 2, [0.0; 3])];
    let plain = file(&learnt(&truth, &sessions, ToolSharing::Same));
    let mut with = plain.clone();
    with.model.terms.push(on_the_day());
    assert_eq!(on_the_day().scope(), Scope::Course);
    let third = [seen(&truth, 3, [0.0; 3])];
    let score = |f: &ModelFile, r: &[Recording]| validate(&truth.robot, &truth.cell, f, r, None, None).unwrap();
    let (a, b) = (score(&plain, &third), score(&with, &third));
    assert_eq!(a.errors, b.errors, "the third session does not know of it");
    assert!(a.left_out.is_empty(), "{:?}", a.left_out);
    assert_eq!(b.left_out.len(), 1);
    assert_eq!(
        b.left_out_in_words(str::to_owned),
        ["Left out: joint_zero_shift (happened in the course of another session)."]
    );
    // it acts in its own session, and only there
    let [first, second] = &sessions;
    assert!(score(&with, std::slice::from_ref(first)).after.mean_mm > 0.2);
    let there = score(&with, std::slice::from_ref(second));
    assert!(there.after.mean_mm < 1.3 * LEAST_MM, "{:?}", there.after);
}

#[test]
fn a_tool_that_slipped_stays_so_for_another_session_and_a_joints_jump_stays_in_its_own() {
    let truth = truth();
    let slipped = [0.0, 0.3e-3, 0.0];
    let later = seen(&truth, 2, slipped);
    let mut of_one = file(&learnt(&truth, &[seen(&truth, 1, [0.0; 3])], ToolSharing::FromData));
    let before = of_one.clone();
    let step = on_the_day();
    let slip = (1..=3).map(|target| {
        let site = Site::Target { target, axis: Axis::Y };
        Term { value: slipped[1], ..Term::new(format!("slip_{target}"), "tool_shift", site, step.basis) }
    });
    of_one.model.terms.extend(slip);
    of_one.model.terms.push(step.clone());
    let frame = Some(Refit { frame: true, targets: false });
    let score =
        |f: &ModelFile| validate(&truth.robot, &truth.cell, f, std::slice::from_ref(&later), None, frame).unwrap();
    let said = score(&of_one);
    assert_eq!(said.carried_over, ["tool_shift"]);
    assert_eq!(said.left_out.iter().map(|l| l.effect.as_str()).collect::<Vec<_>>(), ["joint_zero_shift"]);
    assert_eq!(
        said.left_out_in_words(str::to_owned)[1],
        "As at the end of the session that the model was fitted to: tool_shift."
    );
    assert!(score(&before).after.mean_mm > 0.1 && said.after.mean_mm < 1.5 * LEAST_MM, "{:?}", said.after);
}

/// What holds for a recording does not depend on which others are named beside it.
#[test]
fn a_later_recording_is_predicted_alike_beside_the_one_of_the_fit() {
    let truth = truth();
    let first = seen(&truth, 1, [0.0; 3]);
    let mut of_one = file(&learnt(&truth, std::slice::from_ref(&first), ToolSharing::FromData));
    let step = on_the_day();
    for target in 1..=3 {
        let site = Site::Target { target, axis: Axis::Y };
        let slip = Term::new(format!("slip_{target}"), "tool_shift", site, step.basis);
        of_one.model.terms.push(Term { value: 0.3e-3, ..slip });
    }
    of_one.model.terms.push(step);
    let mut later = seen(&truth, 1, [0.0, 0.3e-3, 0.0]);
    later.name = "later.csv".into();
    let score = |r: &[Recording]| validate(&truth.robot, &truth.cell, &of_one, r, None, None).unwrap();
    let (alone, beside) = (score(std::slice::from_ref(&later)), score(&[first, later.clone()]));
    assert!(alone.after.mean_mm < 1.5 * LEAST_MM, "{:?}", alone.after);
    assert_eq!(beside.sessions[1].after.mean_mm, alone.after.mean_mm);
    assert_eq!(beside.carried_over, alone.carried_over);
    let reasons = |v: &trical_ident::Validation| v.left_out.iter().map(|l| l.reason.clone()).collect::<Vec<_>>();
    assert_eq!(reasons(&alone), ["happened in the course of another session"]);
    assert_eq!(reasons(&beside), ["in later.csv: happened in the course of another session"]);
}

#[test]
fn a_tool_that_no_fit_has_seen_is_identified_where_it_is_measured() {
    let truth = truth();
    let mut seen_1 = seen(&truth, 1, [0.0; 3]);
    seen_1.rows.retain(|r| matches!(r.measured, trical_model::Measured::Point { target: 0 | 1, .. }));
    let file = file(&learnt(&truth, &[seen_1], ToolSharing::FromData));
    let mut elsewhere = truth.clone();
    elsewhere.cell.tool.targets[2].x += 5e-3;
    let mut again = seen(&elsewhere, 1, [0.0; 3]);
    again.name = "again.csv".into();
    // measured anew: nothing is the same to the last bit
    again.rows.iter_mut().for_each(|row| row.state.q[0] += 1e-12);
    let v = validate(&truth.robot, &truth.cell, &file, &[again], None, None).unwrap();
    assert_eq!(v.sessions[0].refitted, ["targets"]);
    assert!(v.after.mean_mm < 2.0 * LEAST_MM, "{:?}", v.after);
}

#[test]
fn one_full_pose_fixes_a_frame_and_two_points_do_not() {
    let truth = truth();
    let posed = |count: usize, session: u64| {
        let mut arm = truth.clone();
        arm.frames =
            vec![Pose { rotation: rotation_zyx(session as f64, 0.3, 0.2), translation: Vector3::new(1.0, 0.5, 0.2) }];
        let rows = seen(&truth, session, [0.0; 3]).rows;
        let aims: Vec<(State, Aim)> = rows.iter().take(count).map(|r| (r.state, Aim::Pose)).collect();
        let scatter = Scatter { length: NOISE, angle: 4.0 * NOISE, seed: session };
        Recording { name: format!("poses{session}.csv"), ..simulate(&arm, &aims, &scatter, None).unwrap() }
    };
    let of = |model: &ModelFile, r: Recording| {
        let refit = Some(Refit { frame: true, targets: false });
        validate(&truth.robot, &truth.cell, model, &[r], None, refit)
    };
    let by_poses = file(&learnt(&truth, &[posed(60, 1)], ToolSharing::FromData));
    let v = of(&by_poses, posed(8, 2)).unwrap();
    assert_eq!((v.sessions[0].from_poses, v.sessions[0].poses), (2, 6));
    assert!(v.after.mean_mm < 5.0 * LEAST_MM, "{:?}", v.after);
    let by_points = file(&learnt(&truth, &[seen(&truth, 1, [0.0; 3])], ToolSharing::FromData));
    let e = of(&by_points, measured(&truth, 2, [0.0; 3], 4, 0.0, |_| Aim::Target(0))).unwrap_err().to_string();
    let expected = "session2.csv: 1 measured point does not fix a frame (fitted: 1 of its 4 poses, the others are \
                    scored); at least three";
    assert!(e.starts_with(expected), "{e}");
}

#[test]
fn a_model_of_one_frame_is_used_in_that_frame_unless_a_refit_is_asked_for() {
    let truth = truth();
    let c = learnt(&truth, &[seen(&truth, 1, [0.0; 3])], ToolSharing::FromData);
    let later = [seen(&truth, 2, [1e-3, 0.0, 0.0])];
    let score = |refit| validate(&truth.robot, &truth.cell, &file(&c), &later, None, refit).unwrap();
    let there = score(None);
    assert!(there.sessions[0].refitted.is_empty() && there.n == 150);
    assert!(there.after.mean_mm > 100.0, "the tracker was moved: {:?}", there.after);
    let frame = score(Some(Refit { frame: true, targets: false }));
    assert_eq!(frame.sessions[0].refitted, ["frame"]);
    assert!((0.5..1.5).contains(&frame.after.mean_mm), "the targets are off by 1 mm: {:?}", frame.after);
    let both = score(Some(Refit::ALL));
    assert!(both.after.mean_mm < 1.5 * LEAST_MM, "{:?}", both.after);
}

#[test]
fn a_frame_that_is_not_identified_anew_stays_where_it_is() {
    let truth = truth();
    let c = learnt(&truth, &[seen(&truth, 1, [0.0; 3])], ToolSharing::FromData);
    let mut other_tool = truth.clone();
    other_tool.cell.tool.targets.iter_mut().for_each(|t| t.x += 1e-3);
    let again = Recording { name: "again.csv".into(), ..seen(&other_tool, 1, [0.0; 3]) };
    let refit = Some(Refit { frame: false, targets: true });
    let v = validate(&truth.robot, &truth.cell, &file(&c), &[again], None, refit).unwrap();
    assert_eq!(v.sessions[0].refitted, ["targets"]);
    assert!(v.after.mean_mm < 1.5 * LEAST_MM, "{:?}", v.after);
    let of_frame = |m: &Model| -> Vec<f64> {
        m.terms.iter().filter(|t| matches!(t.site, Site::Frame { .. })).map(|t| t.value).collect()
    };
    assert_eq!((&v.model.frames, of_frame(&v.model)), (&c.fitted.model.frames, of_frame(&c.fitted.model)));
}

#[test]
fn the_data_say_which_session_has_a_tool_of_its_own() {
    let truth = truth();
    let off = [2e-3, -1e-3, 3e-3];
    let sessions = [seen(&truth, 1, [0.0; 3]), seen(&truth, 2, [0.0; 3]), seen(&truth, 3, off)];
    let c = learnt(&truth, &sessions, ToolSharing::FromData);
    let own: Vec<_> = c.sessions.iter().map(|s| s.own.clone()).collect();
    assert_eq!(own, [vec![], vec![], vec!["tool"]]);
    // three targets, each off by the same: the tool is off by that
    let length = off.iter().map(|x| x * x).sum::<f64>().sqrt() * 1e3;
    assert!((c.sessions[2].differs_mm[0] - length).abs() < 0.03, "{:?} is not {length}", c.sessions[2].differs_mm);
    let said = format!("{}: tool of its own, 3.7", sessions[2].name);
    assert!(c.sessions[2].in_words().unwrap().starts_with(&said) && c.sessions[1].in_words().is_none());
    assert!(c.errors.mean_mm < 1.1 * LEAST_MM, "{:?}", c.errors);
    let by_session = c.held_out.by_session.unwrap();
    assert!(by_session.mean_mm < 1.3 * LEAST_MM, "{by_session:?}");
}

#[test]
fn of_many_sessions_several_are_predicted_by_one_fit_to_all_others() {
    let truth = truth();
    let sessions: Vec<Recording> = (1..=12).map(|s| seen(&truth, s, [0.0; 3])).collect();
    let data = Dataset::build(&sessions, JointSource::Read, None).unwrap();
    let fitted = identify(&truth.robot, &truth.cell, &data, ParameterSet::Compliance).unwrap();
    let left_out = RefCell::new(Vec::new());
    let fit = |some: &Dataset| {
        let is_there = |s: usize| some.observations.iter().any(|o| o.recording == s);
        left_out.borrow_mut().push((0..12).filter(|s| !is_there(*s)).collect::<Vec<_>>());
        Ok(fitted.clone())
    };
    let errors = score_sessions(&data, &fit).unwrap();
    let expected: Vec<Vec<usize>> = (0..10).map(|s| if s < 2 { vec![s, s + 10] } else { vec![s] }).collect();
    assert_eq!(*left_out.borrow(), expected);
    // every fourth pose of each session says where its frame and its tool are
    assert!((12 * 110..12 * 115).contains(&errors.len()), "{}", errors.len());
}

#[test]
fn what_a_few_measurements_say_of_many_is_no_error_of_a_fit_to_all() {
    let truth = truth();
    let scored = |second: usize| {
        let mut sessions = [seen(&truth, 1, [0.0; 3]), seen(&truth, 2, [0.0; 3])];
        sessions[1].rows.truncate(second);
        let data = Dataset::build(&sessions, JointSource::Read, None).unwrap();
        let fitted = identify(&truth.robot, &truth.cell, &data, ParameterSet::Compliance).unwrap();
        score_sessions(&data, &|_| Ok(fitted.clone())).unwrap().len()
    };
    // three of four poses of each session that is scored
    assert_eq!([scored(40), scored(60)], [30, 112 + 45]);
}

#[test]
fn a_gross_error_is_one_in_a_session_with_a_tool_of_its_own() {
    let truth = truth();
    let mut second = seen(&truth, 2, [2e-3, -1e-3, 3e-3]);
    second.rows.truncate(40);
    if let trical_model::Measured::Point { position, .. } = &mut second.rows[7].measured {
        position[2] += 1e-3;
    }
    let c = learnt(&truth, &[seen(&truth, 1, [0.0; 3]), second], ToolSharing::FromData);
    assert_eq!(c.named.iter().map(|r| r.line).collect::<Vec<_>>(), [9], "{:?}", c.named);
    assert!(c.errors.max_mm < 0.06, "{:?}", c.errors);
}

#[test]
fn whoever_knows_better_may_say_which_sessions_share_a_tool() {
    let truth = truth();
    let sessions = [seen(&truth, 1, [0.0; 3]), seen(&truth, 2, [2e-3, -1e-3, 3e-3])];
    let same = learnt(&truth, &sessions, ToolSharing::Same);
    assert!(same.sessions.iter().all(|s| s.own.is_empty()), "{:?}", same.sessions);
    assert!(same.errors.mean_mm > 0.1, "one tool for both cannot fit: {:?}", same.errors);
    let alike = [seen(&truth, 1, [0.0; 3]), seen(&truth, 2, [0.0; 3])];
    let own = learnt(&truth, &alike, ToolSharing::Own);
    assert_eq!(own.sessions[1].own, ["tool"]);
    assert!(own.sessions[1].differs_mm[0] < 0.1, "{:?}", own.sessions);
}

#[test]
fn a_session_too_short_to_tell_where_its_tool_is_is_refused() {
    let nominal = crate::arm::truth(ParameterSet::Compliance, 11);
    let all = |rows: usize| {
        let first = Recording { name: "long.csv".into(), ..crate::arm::touch(&nominal, 90, NOISE, 1) };
        let mut second = Recording { name: "short.csv".into(), ..crate::arm::touch(&nominal, 90, NOISE, 2) };
        second.rows.truncate(rows);
        let options = Options { tool: ToolSharing::FromData, ..Options::new(ParameterSet::Compliance) };
        calibrate(&nominal.robot, &nominal.cell, &[first, second], &options, &Task::silent())
    };
    let said = all(1).unwrap_err().to_string();
    assert!(said.starts_with("short.csv") && said.contains("found 1 pose; at least 5 are needed"), "{said}");
    assert!(all(12).is_ok());
}

#[test]
fn balls_that_stood_elsewhere_in_another_session_are_found_and_refitted_in_a_third() {
    let nominal = crate::arm::truth(ParameterSet::Compliance, 11);
    let touched = |session: u64, shift: f64| {
        let mut model = nominal.clone();
        for ball in &mut model.cell.balls {
            *ball += Vector3::new(shift, 0.0, -shift);
        }
        Recording { name: format!("touches{session}"), ..crate::arm::touch(&model, 90, NOISE, session) }
    };
    let sessions = [touched(1, 0.0), touched(2, 3e-3)];
    let c = learnt(&nominal, &sessions, ToolSharing::Same);
    assert_eq!(c.sessions[1].own, ["balls"], "{:?}", c.sessions);
    assert!((c.sessions[1].differs_mm[0] - 3.0 * 2.0_f64.sqrt()).abs() < 0.05, "{:?}", c.sessions);
    let v = validate(&nominal.robot, &nominal.cell, &file(&c), &[touched(3, -2e-3)], None, Some(Refit::ALL)).unwrap();
    assert_eq!(v.sessions[0].refitted, ["frame", "targets"]);
    assert!(v.after.mean_mm < 2.0 * LEAST_MM, "{:?}", v.after);
}

#[test]
fn balls_that_lean_in_another_session_are_told_for_gravity_goes_by_those_of_the_first() {
    let nominal = crate::arm::truth(ParameterSet::Compliance, 11);
    let touched = |session: u64, lean: f64| {
        let mut model = nominal.clone();
        let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::x_axis(), lean);
        model.cell.balls.iter_mut().for_each(|ball| *ball = turn * *ball);
        Recording { name: format!("touches{session}"), ..crate::arm::touch(&model, 90, NOISE, session) }
    };
    let told = |lean: f64| {
        let sessions = [touched(1, 0.0), touched(2, lean)];
        let c = learnt(&nominal, &sessions, ToolSharing::Same);
        assert_eq!(c.rejected, 0, "{:?}", c.named);
        c.cautions().into_iter().find(|c| c.contains("tilted"))
    };
    let said = told(3_f64.to_radians()).unwrap();
    assert!(
        said.starts_with("the balls of recording 2 are tilted by 3.0 deg relative to those of the first"),
        "{said}"
    );
    assert_eq!(told(0.3_f64.to_radians()), None);
}

#[test]
fn intervals_of_predictions_hold_what_they_promise_on_another_day() {
    let truth = truth();
    // few poses, so that the parameters are as uncertain as the measurements
    let mut few = seen(&truth, 1, [0.0; 3]);
    few.rows.truncate(30);
    let c = learnt(&truth, &[few], ToolSharing::FromData);
    let text = ModelFile::of_fit(&c.fitted).to_toml().unwrap();
    let file = ModelFile::parse(&text, "calibrated.toml").unwrap();
    let other = seen(&truth, 2, [2e-3, -1e-3, 3e-3]);
    let v = validate(&truth.robot, &truth.cell, &file, &[other], None, Some(Refit::ALL)).unwrap();
    let p = v.predicted.unwrap();
    assert!(p.parameters_sd_mm > 0.7 * NOISE * 1e3, "{p:?}");
    assert!((0.90..0.99).contains(&p.covered), "{p:?}");
    // as far off as it says
    let found = v.after.rms_mm / 3.0_f64.sqrt();
    assert!((0.75..1.3).contains(&(found / p.sd_mm)), "{found} {p:?}");
}

/// What moved in the course of a session counts by how far it moved the measurements about their middle.
#[test]
fn a_model_file_keeps_how_far_the_day_moved_the_measurements() {
    let mut truth = crate::arm::nominal();
    truth.cell.tool.targets = vec![Vector3::new(18e-3, -12e-3, 118e-3)];
    let along_x = Site::Frame { frame: 1, motion: Motion::ALL[0] };
    let hour = Basis::new(Variable::Time, Shape::Linear);
    truth.frames = vec![Pose::identity()];
    truth.terms = vec![Term { value: 1e-7, ..Term::new("drift", "frame_drift", along_x, hour) }];
    let states = (0..60).map(|k| {
        let k = f64::from(k);
        (State { t: Some(20.0 * k), ..State::at(&[k.sin(), 0.3 * k.cos(), 0.2, k, 0.5, 0.0]) }, Aim::Target(0))
    });
    let scatter = Scatter { length: NOISE, angle: 0.0, seed: 5 };
    let recording = simulate(&truth, &states.collect::<Vec<_>>(), &scatter, None).unwrap();
    let data = Dataset::build(&[recording], JointSource::Read, None).unwrap();
    let fitted = fit_model(truth, &data, &Noise::usual(1), Vec::new()).unwrap();
    assert_eq!(fitted.model.terms[0].scope(), Scope::Course);
    let of_file = Uncertainty::of(&fitted).unwrap();
    // 60 steps of 2 um along one of three axes
    let drift = fitted.model.terms[0].value * 20.0;
    let expected = drift.abs() * (59.0_f64 * 119.0 / 6.0 / 3.0).sqrt();
    assert!((of_file.course / expected - 1.0).abs() < 1e-6, "{} {expected}", of_file.course);
    assert!((of_file.noise / NOISE - 1.0).abs() < 0.2, "{}", of_file.noise);
    // what effects moved is what the plain model's scatter has beyond this one's
    let plain = 5.0 * of_file.noise;
    let with_effects = of_file.of_effects(plain);
    assert!((with_effects.effects / plain - 0.96_f64.sqrt()).abs() < 1e-12);
    let file = ModelFile { uncertainty: Some(with_effects.clone()), ..ModelFile::of_fit(&fitted) };
    let read = ModelFile::parse(&file.to_toml().unwrap(), "model.toml").unwrap().uncertainty.unwrap();
    assert!((read.effects / with_effects.effects - 1.0).abs() < 1e-12);
}

#[test]
fn of_two_sessions_without_dates_that_differ_in_a_zero_the_arm_has_the_middle() {
    let mut truth = truth();
    let zero = Term::new("zero_shift_3", "joint_zero_shift", Site::Joint { joint: 3 }, Basis::CONSTANT.in_session(2));
    truth.terms.push(Term { value: 1e-3, sd: Some(1e-4), ..zero });
    let sessions = [seen(&truth, 1, [0.0; 3]), seen(&truth, 2, [0.0; 3])];
    let data = Dataset::build(&sessions, JointSource::Read, None).unwrap();
    let now = ModelFile::of(truth.clone(), &data).model;
    let moved = |model: &Model, session: Option<u32>| {
        let forward = Forward::new(model.clone(), Vec::new()).unwrap();
        let state = State { session, ..State::at(&[0.1, 0.2, -0.3, 0.4, 0.5, -0.6]) };
        forward.world_from_tool(&state, &mut forward.workspace()).translation
    };
    for session in [1, 2] {
        assert!((moved(&now, Some(session)) - moved(&truth, Some(session))).norm() < 1e-6, "session {session}");
    }
    let middle = 0.5 * (moved(&truth, Some(1)) + moved(&truth, Some(2)));
    assert!((moved(&now, None) - middle).norm() < 1e-6);
    // which of both it is nobody knows
    let arm = now.terms.iter().find(|t| t.name == "zero_shift_3").unwrap();
    assert!((arm.value - 5e-4).abs() < 1e-12 && (arm.sd.unwrap() - 5e-4_f64.hypot(1e-4)).abs() < 1e-12);
}

#[test]
fn a_joint_that_has_another_zero_in_the_newest_session_keeps_it() {
    let mut truth = truth();
    let zero = Term::new("zero_shift_3", "joint_zero_shift", Site::Joint { joint: 3 }, Basis::CONSTANT.in_session(2));
    truth.terms.push(Term { value: 1e-3, ..zero });
    let names = |names: [&str; 3]| {
        let sessions: Vec<Recording> =
            (1..).zip(names).map(|(s, name)| Recording { name: name.into(), ..seen(&truth, s, [0.0; 3]) }).collect();
        ModelFile::of(truth.clone(), &Dataset::build(&sessions, JointSource::Read, None).unwrap()).model
    };
    let undated = names(["a.csv", "b.csv", "c.csv"]);
    assert_eq!(undated.terms, truth.terms);
    assert_eq!(names(["2026-01-01.csv", "2026-02-01.csv", "2026-03-01.csv"]).terms, truth.terms);
    let now = names(["2026-01-01.csv", "2026-03-01.csv", "2026-02-01.csv"]);
    let moved = |model: &Model, session: Option<u32>| {
        let forward = Forward::new(model.clone(), Vec::new()).unwrap();
        let state = State { session, ..State::at(&[0.1, 0.2, -0.3, 0.4, 0.5, -0.6]) };
        forward.world_from_tool(&state, &mut forward.workspace()).translation
    };
    for session in [1, 2, 3] {
        let apart = moved(&now, Some(session)) - moved(&truth, Some(session));
        assert!(apart.norm() < 1e-6, "session {session}: {apart:?}");
    }
    // another day the arm is as in the newest (gravity turns with the zero of the arm, not of a day: less than 1 um)
    assert!((moved(&now, None) - moved(&truth, Some(2))).norm() < 1e-6);
}

#[test]
fn a_tool_that_is_turned_is_told_where_full_poses_were_measured() {
    let truth = truth();
    let poses = |model: &Model, session| measured(model, session, [0.0; 3], 120, 1e-5, |_| Aim::Pose);
    let found = learnt(&truth, &[poses(&truth, 1)], ToolSharing::FromData);
    let file = file(&found);
    let mut turned = truth.clone();
    let twist =
        Term { value: 0.02, ..Term::new("turned", "tool", Site::Tool(Motion::About(Axis::Z)), Basis::CONSTANT) };
    turned.terms.push(twist);
    let degrees = |model: &Model| {
        let refit = Some(Refit { frame: true, targets: false });
        let v = validate(&truth.robot, &truth.cell, &file, &[poses(model, 2)], None, refit).unwrap();
        v.orientation.unwrap()[1].mean_deg
    };
    let told = [&truth, &turned].map(degrees);
    assert!(told[0] < 0.002 && (told[1] - 0.02_f64.to_degrees()).abs() < 0.01, "{told:?}");
}
