//! Is this arm still what it was: a few touches against an earlier calibration.

use trical_ident::{Aim, Comparison, ModelFile, Options, ParameterSet, calibrate, compare, history, validate};
use trical_model::{Axis, Basis, Measured, Model, Motion, Recording, Scope, Shape, Site, Task, Term, Variable};

use crate::sessions;

/// Standard deviation of each coordinate, m.
const NOISE: f64 = 1e-5;

fn truth() -> Model {
    crate::arm::truth(ParameterSet::Compliance, 5)
}

/// The arm's calibration from 90 touches, as its file has it.
fn calibrated(truth: &Model) -> ModelFile {
    calibrated_with(truth, NOISE)
}

fn calibrated_with(truth: &Model, noise: f64) -> ModelFile {
    let old = Recording { name: "old.csv".into(), ..crate::arm::touch(truth, 90, noise, 1) };
    let c =
        calibrate(&truth.robot, &truth.cell, &[old], &Options::new(ParameterSet::Compliance), &Task::silent()).unwrap();
    let text = ModelFile::of_fit(&c.fitted).to_toml().unwrap();
    ModelFile::parse(&text, "calibrated.toml").unwrap()
}

/// Ten touches of the arm after `site` moved by `value`.
fn later(truth: &Model, change: Option<(Site, f64)>, name: &str, seed: u64) -> Recording {
    let mut arm = truth.clone();
    if let Some((site, value)) = change {
        let mut term = Term::new("change", "change", site, Basis::CONSTANT);
        term.value = value;
        arm.terms.push(term);
    }
    Recording { name: name.into(), ..crate::arm::touch(&arm, 10, NOISE, seed) }
}

fn compared(truth: &Model, file: &ModelFile, change: Option<(Site, f64)>) -> Comparison {
    compare(&truth.cell, file, &later(truth, change, "new.csv", 99), None).unwrap()
}

#[test]
fn ten_touches_of_the_same_arm_say_unchanged_and_what_they_would_have_seen() {
    let truth = truth();
    let c = compared(&truth, &calibrated(&truth), None);
    assert_eq!((c.verdict, c.changes.len(), c.measurements), ("unchanged", 0, 10));
    assert_eq!(c.summary, "No change was found in these 10 measurements.");
    let joint_2 = c.visible.iter().find(|v| v.what == "joint 2").unwrap();
    assert!(joint_2.smallest.is_some_and(|s| s > 0.001 && s < 0.02) && joint_2.unit == "deg", "{joint_2:?}");
}

/// Many touches show small changes, but an old model has small errors of its own: what is called visible is what would be told.
#[test]
fn of_many_touches_what_is_called_visible_is_told_and_half_of_it_is_not() {
    let truth = truth();
    let file = calibrated(&truth);
    let many = |by: f64| {
        let mut arm = truth.clone();
        let mut term = Term::new("change", "change", Site::Joint { joint: 2 }, Basis::CONSTANT);
        term.value = by.to_radians();
        arm.terms.push(term);
        let new = Recording { name: "new.csv".into(), ..crate::arm::touch(&arm, 200, NOISE, 7) };
        compare(&truth.cell, &file, &new, None).unwrap()
    };
    let visible = many(0.0).visible.iter().find(|v| v.what == "joint 2").and_then(|v| v.smallest).unwrap();
    let told = many(1.2 * visible);
    assert_eq!((told.verdict, told.changes[0].what.as_str()), ("arm changed", "joint 2"), "{}", told.summary);
    assert_eq!(many(0.5 * visible).verdict, "unchanged");
}

#[test]
fn a_lost_joint_zero_a_new_tool_and_a_carried_plate_are_told_apart_with_their_sizes() {
    let truth = truth();
    let file = calibrated(&truth);
    let c = compared(&truth, &file, Some((Site::Joint { joint: 2 }, 0.05_f64.to_radians())));
    assert_eq!((c.verdict, c.changes[0].what.as_str(), c.changes[0].scope), ("arm changed", "joint 2", Scope::Arm));
    let by = &c.changes[0].by[0];
    assert!((by.value - 0.05).abs() < 3.0 * by.sd && by.sd < 0.01 && by.unit == "deg", "{by:?}");
    assert!(c.changes[0].probability > 0.5 && c.summary.starts_with("Joint 2 changed by 0.0"), "{}", c.summary);
    let c = compared(&truth, &file, Some((Site::Tool(Motion::Along(Axis::X)), 5e-4)));
    assert_eq!((c.verdict, c.changes[0].what.as_str()), ("setup changed", "tool"));
    let c = compared(&truth, &file, Some((Site::Base(Motion::Along(Axis::Y)), 5e-4)));
    assert_eq!((c.verdict, c.changes[0].what.as_str()), ("setup changed", "base"));
}

#[test]
fn a_warmer_arm_is_told_as_warmer_and_not_as_changed() {
    let truth = truth();
    let file = calibrated(&truth);
    let warm = |kelvin: f64, change: f64, recorded: bool| {
        let mut arm = truth.clone();
        let term = |site, value| Term { value, ..Term::new("change", "change", site, Basis::CONSTANT) };
        arm.terms.extend([term(Site::Links, 14e-6 * kelvin), term(Site::Joint { joint: 2 }, change)]);
        let mut new = Recording { name: "new.csv".into(), ..crate::arm::touch(&arm, 10, NOISE / 2.0, 99) };
        new.rows.iter_mut().for_each(|r| r.state.temp_c = r.state.temp_c.filter(|_| recorded).map(|t| t + kelvin));
        compare(&truth.cell, &file, &new, None).unwrap()
    };
    let c = warm(6.0, 0.0, true);
    assert_eq!(c.verdict, "unchanged", "{}", c.summary);
    assert!(
        c.summary.contains("It was 6.") && c.summary.contains(" K warmer than at the calibration"),
        "{}",
        c.summary
    );
    let c = warm(6.0, 0.05_f64.to_radians(), true);
    assert_eq!((c.verdict, c.changes[0].what.as_str()), ("arm changed", "joint 2"), "{}", c.summary);
    let c = warm(2.0, 0.0, false);
    assert_eq!((c.verdict, c.warmer), ("unchanged", None), "{}", c.summary);
    assert!(!c.summary.contains("warmer"));
}

#[test]
fn what_happened_in_the_course_of_the_old_session_is_no_change() {
    let truth = truth();
    let mut file = calibrated(&truth);
    let offset = Some((Site::Joint { joint: 3 }, 0.02_f64.to_radians()));
    assert_eq!(compared(&truth, &file, offset).verdict, "arm changed");
    let clock = Basis { session: Some(1), ..Basis::new(Variable::Time, Shape::Linear) };
    let drift = Term::new("drift", "thermal_zero_drift", Site::Joint { joint: 3 }, clock);
    assert_eq!(drift.scope(), Scope::Course);
    file.model.terms.push(Term { value: 1e-7, sd: Some(1e-8), ..drift });
    file.uncertainty.as_mut().unwrap().course = 1e-4;
    let c = compared(&truth, &file, offset);
    assert_eq!(c.verdict, "unchanged", "{}", c.summary);
    assert_eq!(compared(&truth, &file, Some((Site::Joint { joint: 2 }, 0.05_f64.to_radians()))).verdict, "arm changed");
}

/// What such a calibration lacks of the arm would differ from pose to pose, and look like a change.
#[test]
fn a_change_beside_a_calibration_that_left_much_is_told_with_that() {
    let truth = truth();
    let change = Some((Site::Joint { joint: 2 }, 0.06_f64.to_radians()));
    let rough = calibrated_with(&truth, 8.0 * NOISE);
    let c = compared(&truth, &rough, change);
    assert!(
        c.summary.contains("But the calibration itself left 0.0") && c.summary.contains("can look like such a change"),
        "{}",
        c.summary
    );
    // not beside one that is far larger than that
    let c = compared(&truth, &rough, Some((Site::Joint { joint: 2 }, 1.5_f64.to_radians())));
    assert!(!c.changes.is_empty() && !c.summary.contains("itself left"), "{}", c.summary);
    let c = compared(&truth, &calibrated(&truth), change);
    assert!(!c.changes.is_empty() && !c.summary.contains("itself left"), "{}", c.summary);
}

/// A tracker's calibration of an arm with three targets on its tool.
fn tracked(truth: &Model, sessions: &[Recording]) -> ModelFile {
    let c = calibrate(&truth.robot, &truth.cell, sessions, &Options::new(ParameterSet::Compliance), &Task::silent())
        .unwrap();
    ModelFile::of_fit(&c.fitted)
}

#[test]
fn measured_orientations_scatter_as_they_did_in_the_calibration() {
    let truth = sessions::truth();
    // rad: so large that it would be a change if lengths of 0.01 mm told it
    let posed = |session, count| sessions::measured(&truth, session, [0.0; 3], count, 2e-4, |_| Aim::Pose);
    let file = tracked(&truth, &[posed(1, 100)]);
    for session in 2..7 {
        let c = compare(&truth.cell, &file, &posed(session, 12), None).unwrap();
        assert_eq!(c.verdict, "unchanged", "{}", c.summary);
    }
    let mut turned = truth.clone();
    turned.terms.push(Term {
        value: 2e-3,
        ..Term::new("hidden", "hidden", Site::Tool(Motion::About(Axis::Z)), Basis::CONSTANT)
    });
    let recording = sessions::measured(&turned, 7, [0.0; 3], 12, 2e-4, |_| Aim::Pose);
    let c = compare(&truth.cell, &file, &recording, None).unwrap();
    assert_eq!((c.verdict, c.changes[0].what.as_str()), ("setup changed", "tool"), "{}", c.summary);
}

#[test]
fn a_tool_with_three_targets_changed_by_as_much_as_each_of_them_and_so_much_is_called_visible() {
    let truth = sessions::truth();
    let file = tracked(&truth, &[sessions::seen(&truth, 1, [0.0; 3])]);
    let shifted = |mm: f64| {
        let off = [2.0, -1.0, 2.0].map(|x| x / 3.0 * mm * 1e-3);
        compare(&truth.cell, &file, &sessions::seen(&truth, 2, off), None).unwrap()
    };
    let c = shifted(3.0);
    assert_eq!((c.verdict, c.changes[0].what.as_str()), ("setup changed", "tool"));
    assert!(
        c.summary.starts_with("Tool changed by 3.0") || c.summary.starts_with("Tool changed by 2.9"),
        "{}",
        c.summary
    );
    let visible = c.visible.iter().find(|v| v.what == "tool").and_then(|v| v.smallest).unwrap();
    assert!(visible < 0.3, "{visible}");
    assert_eq!(shifted(1.2 * visible).verdict, "setup changed");
    assert_eq!(shifted(0.3 * visible).verdict, "unchanged");
}

/// Targets at one pose say where a new frame is, whatever the tool is like.
#[test]
fn what_a_new_frame_takes_up_whole_is_not_called_visible() {
    let truth = sessions::truth();
    let file = tracked(&truth, &[sessions::seen(&truth, 1, [0.0; 3])]);
    let mut one = sessions::seen(&truth, 2, [0.0; 3]);
    let pose = one.rows[0];
    let mut forward = truth.clone();
    forward.frames = vec![trical_model::Pose::identity()];
    let aims: Vec<_> = (0..3).map(|target| (pose.state, Aim::Target(target))).collect();
    let scatter = trical_ident::Scatter { length: NOISE, angle: 0.0, seed: 3 };
    one.rows = trical_ident::simulate(&forward, &aims, &scatter, None).unwrap().rows;
    let c = compare(&truth.cell, &file, &one, None).unwrap();
    assert!(c.visible.iter().all(|v| v.smallest.is_none()), "{:?}", c.visible);
    assert_eq!(c.verdict, "nothing visible");
    assert_eq!(c.summary, "Nothing can be seen in these 3 measurements: they would show no change.");
}

/// What a calibration from touches never saw of the tool, and one by a tracker of the base, is not known to it.
#[test]
fn what_the_calibration_never_identified_is_identified_anew_and_not_told_as_changed() {
    let truth = sessions::truth();
    let mut elsewhere = truth.clone();
    elsewhere.cell.tool.targets.iter_mut().for_each(|t| t.x += 2e-3);
    let by_touch = calibrated(&truth);
    let c = compare(&truth.cell, &by_touch, &sessions::seen(&elsewhere, 2, [0.0; 3]), None).unwrap();
    assert_eq!((c.verdict, c.anew.as_slice()), ("unchanged", &["tool"][..]), "{}", c.summary);
    assert!(
        c.summary.contains("A change of the tool cannot be seen: the calibration did not measure it"),
        "{}",
        c.summary
    );
    assert!(c.visible.iter().any(|v| v.what == "tool" && v.smallest.is_none()), "{:?}", c.visible);
    // and the other way round
    let by_tracker = tracked(&truth, &[sessions::seen(&truth, 1, [0.0; 3])]);
    let moved = later(&truth, Some((Site::Base(Motion::Along(Axis::Y)), 5e-3)), "new.csv", 99);
    let c = compare(&truth.cell, &by_tracker, &moved, None).unwrap();
    assert_eq!((c.verdict, c.anew.as_slice()), ("unchanged", &["tool", "base"][..]), "{}", c.summary);
    assert!(c.visible.iter().all(|v| v.what != "base"), "{:?}", c.visible);
}

#[test]
fn of_several_sessions_the_tool_of_the_newest_is_the_one_that_was_left() {
    let truth = truth();
    let on = |off: f64, name: &str, count: usize, seed: u64| {
        let mut arm = truth.clone();
        arm.cell.tool.tcp.x += off;
        Recording { name: name.into(), ..crate::arm::touch(&arm, count, NOISE, seed) }
    };
    // by its date, not by its place
    let sessions = [on(1e-3, "b 2026-02-01.csv", 90, 1), on(0.0, "a 2026-01-01.csv", 90, 2)];
    let file = tracked(&truth, &sessions);
    let c = compare(&truth.cell, &file, &on(1e-3, "new.csv", 10, 3), None).unwrap();
    assert_eq!((c.verdict, c.setup_of.as_deref()), ("unchanged", Some("b 2026-02-01.csv")), "{}", c.summary);
    assert!(
        c.summary.ends_with("at the end of b 2026-02-01.csv, the newest recording that the calibration was fitted to.")
    );
    let c = compare(&truth.cell, &file, &on(0.0, "new.csv", 10, 3), None).unwrap();
    assert_eq!(c.changes[0].what, "tool");
    // without dates the last one
    let undated = [on(0.0, "a.csv", 90, 2), on(1e-3, "b.csv", 90, 1)];
    let c = compare(&truth.cell, &tracked(&truth, &undated), &on(1e-3, "new.csv", 10, 3), None).unwrap();
    assert_eq!((c.verdict, c.setup_of.as_deref()), ("unchanged", Some("b.csv")), "{}", c.summary);
}

#[test]
fn an_arm_that_differs_in_many_joints_may_be_another_one() {
    let truth = truth();
    let mut other = truth.clone();
    for joint in 1..=6 {
        let mut term = Term::new(format!("zero_{joint}"), "change", Site::Joint { joint }, Basis::CONSTANT);
        term.value = [0.5_f64, -0.4, 0.6, -0.8, 0.7, 1.0][joint - 1].to_radians();
        other.terms.push(term);
    }
    let recording = Recording { name: "other.csv".into(), ..crate::arm::touch(&other, 40, NOISE, 3) };
    let c = compare(&truth.cell, &calibrated(&truth), &recording, None).unwrap();
    assert!(c.summary.contains("may be another arm of the same kind"), "{}", c.summary);
}

#[test]
fn a_tool_that_was_turned_is_told_with_its_angle() {
    let truth = sessions::truth();
    let posed = |turn: f64, session: u64| {
        let mut arm = truth.clone();
        arm.cell.tool.rotation *= trical_model::pose::rotation_x(turn.to_radians());
        arm.frames = vec![trical_model::Pose::identity()];
        let rows = sessions::seen(&truth, session, [0.0; 3]).rows;
        let aims: Vec<_> = rows.iter().step_by(2).map(|r| (r.state, Aim::Pose)).collect();
        let scatter = trical_ident::Scatter { length: NOISE, angle: 4.0 * NOISE, seed: session };
        let made = trical_ident::simulate(&arm, &aims, &scatter, None).unwrap();
        Recording { name: format!("poses{session}.csv"), ..made }
    };
    let c = compare(&truth.cell, &tracked(&truth, &[posed(0.0, 1)]), &posed(1.0, 2), None).unwrap();
    assert!(c.summary.starts_with("Tool changed by 0.0") && c.summary.contains(" mm and 1.00"), "{}", c.summary);
    let of_tool: Vec<&str> = c.visible.iter().filter(|v| v.what == "tool").map(|v| v.unit.as_str()).collect();
    assert_eq!(of_tool, ["mm", "deg"]);
}

#[test]
fn one_wrong_touch_is_told_as_that() {
    let truth = truth();
    let mut recording = later(&truth, None, "new.csv", 99);
    if let Measured::Touch { reading, .. } = &mut recording.rows[4].measured {
        reading[1] += 3e-4;
    }
    let c = compare(&truth.cell, &calibrated(&truth), &recording, None).unwrap();
    assert_eq!((c.verdict, c.changes.len()), ("wrong touches", 1));
    assert_eq!(c.changes[0].what, "the measurement of line 6");
}

/// Whoever typed the numbers of two touches the wrong way round is told of both.
#[test]
fn two_touches_whose_balls_were_exchanged_are_told_as_wrong_and_not_as_a_change() {
    let truth = truth();
    let file = calibrated(&truth);
    let mut recording = Recording { name: "new.csv".into(), ..crate::arm::touch(&truth, 30, NOISE, 97) };
    let [one, other] = [3, 4].map(|k| recording.rows[k].measured);
    for (k, of) in [(3, other), (4, one)] {
        if let (Measured::Touch { ball, .. }, Measured::Touch { ball: right, .. }) =
            (&mut recording.rows[k].measured, of)
        {
            *ball = right;
        }
    }
    let c = compare(&truth.cell, &file, &recording, None).unwrap();
    let mut wrong: Vec<&str> = c.changes.iter().map(|c| c.what.as_str()).collect();
    wrong.sort_unstable();
    assert_eq!(c.verdict, "wrong touches");
    assert_eq!(wrong, ["the measurement of line 5", "the measurement of line 6"]);
}

#[test]
fn a_tool_that_the_cell_file_has_elsewhere_is_told_and_that_of_the_model_is_used() {
    let truth = truth();
    let (file, new) = (calibrated(&truth), later(&truth, None, "new.csv", 99));
    let with = |off: f64| {
        let mut cell = truth.cell.clone();
        cell.tool.tcp.x += off;
        validate(&truth.robot, &cell, &file, std::slice::from_ref(&new), None, None).unwrap()
    };
    let (same, other) = (with(0.0), with(3e-3));
    assert_eq!(same.other_tool_mm, None);
    assert!((other.other_tool_mm.unwrap() - 3.0).abs() < 1e-9, "{:?}", other.other_tool_mm);
    assert!((other.after.rms_mm - same.after.rms_mm).abs() < 1e-9 && same.after.rms_mm < 0.05, "{:?}", other.after);
    let told = "The cell file has the tool 3.000 mm from where the cell of the fit has it; the model's was used.";
    assert_eq!(other.left_out_in_words(str::to_owned), [told]);
}

#[test]
fn another_load_is_known_from_the_cell_file_and_is_no_change() {
    let truth = truth();
    let file = calibrated(&truth);
    let mut heavy = truth.clone();
    heavy.cell.tool.mass += 3.0;
    heavy.cell.tool.cog.z += 0.05;
    let new = later(&heavy, None, "new.csv", 99);
    let [told, untold] = [&heavy.cell, &truth.cell].map(|cell| compare(cell, &file, &new, None).unwrap());
    assert!(told.verdict == "unchanged" && untold.verdict != "unchanged", "{} {}", told.summary, untold.summary);
    // nothing of it is identified, or joint 2 would hide behind it: six times as much instead of four, which the compliance leaves open under the load
    let smallest = |c: &Comparison| c.visible.iter().find(|v| v.what == "joint 2").and_then(|v| v.smallest).unwrap();
    let [loaded, plain] = [smallest(&told), smallest(&compared(&truth, &file, None))];
    assert!(loaded < 5.0 * plain, "{loaded} {plain}");
}

#[test]
fn one_touch_among_many_is_wrong_where_it_is_far_beyond_the_others_and_not_where_a_calibration_may_lack_as_much() {
    let truth = truth();
    let file = calibrated(&truth);
    let told = |off: f64| {
        let mut recording = crate::arm::touch(&truth, 50, NOISE, 98);
        if let Measured::Touch { reading, .. } = &mut recording.rows[4].measured {
            reading[1] += off;
        }
        compare(&truth.cell, &file, &recording, None).unwrap().verdict
    };
    assert_eq!([told(-6.5 * NOISE), told(-10.0 * NOISE)], ["unchanged", "wrong touches"]);
    // however far: the others are as they were
    assert_eq!(told(2e-3), "wrong touches");
}

#[test]
fn what_the_calibration_needs_and_the_recording_does_not_have_is_told() {
    let truth = truth();
    let mut file = calibrated(&truth);
    let warm = Basis::new(Variable::Temperature { reference_c: 20.0 }, Shape::Linear);
    let term = Term::new("warm_3", "thermal_zero_drift", Site::Joint { joint: 3 }, warm);
    file.model.terms.push(Term { value: 1e-5, ..term });
    let mut recording = later(&truth, None, "new.csv", 99);
    recording.rows.iter_mut().for_each(|r| r.state.temp_c = None);
    let c = compare(&truth.cell, &file, &recording, None).unwrap();
    let said =
        "the calibration needs temperature (temp_c) (for thermal zero drift), which this recording does not have";
    assert!(c.summary.contains(said) && c.doubt.is_some(), "{}", c.summary);
}

#[test]
fn a_model_without_its_uncertainty_and_its_own_recording_are_refused() {
    let truth = truth();
    let mut file = calibrated(&truth);
    let own = Recording { name: "old.csv".into(), ..crate::arm::touch(&truth, 90, NOISE, 1) };
    let e = compare(&truth.cell, &file, &own, None).unwrap_err().to_string();
    assert_eq!(e, "old.csv: the model was fitted to these measurements; expected a later recording");
    // and so is a part of it
    let part = Recording { name: "part.csv".into(), rows: own.rows[20..32].to_vec(), ..own };
    let e = compare(&truth.cell, &file, &part, None).unwrap_err().to_string();
    assert_eq!(e, "part.csv: the model was fitted to these measurements; expected a later recording");
    file.uncertainty = None;
    let e = compare(&truth.cell, &file, &later(&truth, None, "new.csv", 2), None).unwrap_err().to_string();
    assert!(e.starts_with("the model file does not say how uncertain it is ([uncertainty])"), "{e}");
}

#[test]
fn months_of_growing_errors_say_when_the_next_calibration_is_due() {
    let truth = truth();
    let file = calibrated(&truth);
    let sessions: Vec<Recording> = (0..6_u32)
        .map(|k| {
            let change = (Site::Tool(Motion::Along(Axis::Z)), 2e-5 * f64::from(k));
            later(&truth, Some(change), &format!("2026-0{}-01.csv", k + 1), 50 + u64::from(k))
        })
        .collect();
    let h = history(&truth.cell, &file, &sessions, None, Some(0.2)).unwrap();
    assert_eq!(h.days.as_ref().unwrap()[1], 31.0);
    assert!(h.trend.is_some_and(|t| t.mm_per_step > 0.0 && t.p_value < 0.05), "{:?}", h.trend);
    assert!(
        h.due.starts_with(
            "The next calibration is not due for 151 days after the last session, as long as was observed"
        ),
        "{}",
        h.due
    );
    let h = history(&truth.cell, &file, &sessions[..4], None, Some(0.01)).unwrap();
    assert!(h.due.starts_with("The next calibration is due now: the mean error is"), "{}", h.due);
    // a tool that was mounted again is not the arm's
    let moved = later(&truth, Some((Site::Tool(Motion::Along(Axis::X)), 1e-3)), "2026-07-01.csv", 60);
    let h = history(&truth.cell, &file, &[moved], None, Some(0.1)).unwrap();
    assert!(h.due.starts_with("The arm need not be calibrated again: with the tool"), "{}", h.due);
    let [last] = &h.sessions[..] else { unreachable!() };
    assert!(last.mean_mm > 0.5 && last.arm_mm < 0.05, "{last:?}");
}

#[test]
fn dates_in_the_names_say_which_session_was_first() {
    let truth = truth();
    let file = calibrated(&truth);
    let of = |name: &str, seed| later(&truth, None, name, seed);
    let sessions = [of("u 2026-03-01.csv", 4), of("v 2026-01-31.csv", 2), of("w 2026-02-01.csv", 3)];
    let h = history(&truth.cell, &file, &sessions, None, None).unwrap();
    let names: Vec<&str> = h.sessions.iter().map(|s| s.recording.as_str()).collect();
    assert_eq!(names, ["v 2026-01-31.csv", "w 2026-02-01.csv", "u 2026-03-01.csv"]);
    assert_eq!(h.days, Some(vec![0.0, 1.0, 29.0]));
}

#[test]
fn a_history_begins_with_the_recording_that_the_model_was_learnt_on() {
    let truth = truth();
    let file = calibrated(&truth);
    let own = Recording { name: "2026-01-01 old.csv".into(), ..crate::arm::touch(&truth, 90, NOISE, 1) };
    let sessions = [own, later(&truth, None, "2026-02-01.csv", 7), later(&truth, None, "2026-02-03.csv", 8)];
    let h = history(&truth.cell, &file, &sessions, None, None).unwrap();
    assert_eq!((h.learnt.len(), h.sessions.len()), (1, 2));
    let first = &h.learnt[0];
    assert_eq!((first.recording.as_str(), first.measurements, first.day), ("2026-01-01 old.csv", 90, Some(0.0)));
    assert!(first.mean_mm > 0.005 && first.mean_mm < 0.02, "{first:?}");
    assert_eq!(h.days, Some(vec![31.0, 33.0]), "days since the calibration");
    let h = history(&truth.cell, &file, &sessions, None, Some(0.2)).unwrap();
    assert!(
        h.due.starts_with("The next calibration is not due yet") && h.due.contains("fewer than four sessions"),
        "{}",
        h.due
    );
    // a recording without a date leaves sessions to be counted
    let other = Recording { name: "old.csv".into(), ..sessions[0].clone() };
    let h = history(&truth.cell, &file, &[other, sessions[1].clone()], None, None).unwrap();
    assert_eq!((h.learnt[0].day, h.days), (None, Some(vec![0.0])));
}

#[test]
fn another_arm_is_not_told_as_unchanged() {
    let truth = truth();
    let mut other = truth.clone();
    for (k, joint) in other.robot.joints.iter_mut().enumerate() {
        joint.a += 0.05 * (k as f64 - 2.0);
        joint.d += 0.04;
    }
    let recording = Recording { name: "other.csv".into(), ..crate::arm::touch(&other, 40, NOISE, 3) };
    let e = compare(&truth.cell, &calibrated(&truth), &recording, None).unwrap_err().to_string();
    assert!(e.starts_with("other.csv: the model misses these measurements by"), "{e}");
    assert!(e.contains("expected a recording of the arm that the model is of"), "{e}");
}

#[test]
fn a_point_that_the_cell_does_not_have_is_told_with_its_file_and_line() {
    let truth = truth();
    let file = calibrated(&truth);
    let mut recording = later(&truth, None, "other.csv", 7);
    for (k, row) in recording.rows.iter_mut().enumerate() {
        let target = truth.cell.tool.targets.len() + k % 2;
        row.measured = Measured::Point { target, position: [0.1 * k as f64, 0.2, 0.3] };
    }
    let e = compare(&truth.cell, &file, &recording, None).unwrap_err().to_string();
    assert!(e.starts_with("other.csv, line") && e.contains("target"), "{e}");
}
