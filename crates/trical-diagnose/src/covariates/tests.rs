#![allow(clippy::unwrap_used, clippy::panic)]

use trical_model::{Joints, Site, Term};

use super::*;
use crate::test_data::{arm, states, touches};

fn swing(k: f64) -> State {
    State::at(&[0.1 * k, 0.2, -0.3, 0.4, 0.5, 0.6])
}

fn timed(k: f64) -> State {
    State { t: Some(100.0 * k), ..swing(k) }
}

/// Rows have a number by themselves; these have not even that.
fn unordered() -> Dataset {
    let mut data = states(60, swing);
    data.observations.iter_mut().for_each(|o| o.state.seq = None);
    data
}

#[test]
fn time_tells_earlier_from_later_and_numbers_where_there_is_no_time() {
    assert_eq!(order_of(&states(9, timed)), Some(Variable::Time));
    assert_eq!(order_of(&states(9, swing)), Some(Variable::Seq));
    assert_eq!(order_of(&states(9, |k| if k < 5.0 { timed(k) } else { swing(k) })), Some(Variable::Seq));
    assert_eq!(order_of(&unordered()), None);
    // times count from the beginning of the recording, numbers from the first one
    let late = states(9, |k| State { t: Some(50.0 + 100.0 * k), ..swing(k) });
    assert_eq!(span(&late, Variable::Time), 850.0);
    let mut numbered = states(9, swing);
    numbered.observations.iter_mut().zip(7_u8..).for_each(|(o, k)| o.state.seq = Some(f64::from(k)));
    assert_eq!(span(&numbered, Variable::Seq), 8.0);
}

#[test]
fn a_clock_that_stands_has_no_moment_at_which_something_may_have_changed() {
    let standing = states(60, |k| State { t: Some(1234.0), ..swing(k) });
    let model = arm();
    let r = Covariates::new(&model, &standing, 1e-5);
    assert_eq!(r.order, Some(Variable::Time));
    assert!(r.changes().is_empty(), "{:?}", r.changes());
    // one that runs has some
    assert!(!change_points(&states(60, timed), Variable::Time, 60).is_empty());
}

#[test]
fn changes_may_be_between_any_two_moments_but_for_the_first_and_the_last_two() {
    let few = change_points(&states(20, timed), Variable::Time, 60);
    let expected: Vec<f64> = (2..18).map(|k| 100.0 * f64::from(k) - 50.0).collect();
    assert_eq!(few, expected);
    let many = change_points(&states(400, timed), Variable::Time, 60);
    assert_eq!(many.len(), 60);
    assert!(many.windows(2).all(|w| w[0] < w[1]) && many.iter().all(|t| (t / 100.0).fract() == 0.5), "{many:?}");
    assert!(many[0] < 1000.0 && many[59] > 38_900.0, "{many:?}");
    assert!(change_points(&states(7, timed), Variable::Time, 60).is_empty());
}

/// A joint that was read before it arrived is behind: commanded minus read has the sense of its motion.
#[test]
fn a_lag_is_behind_the_motion_and_not_ahead_of_it() {
    let of = |lag: f64, noise: f64| {
        states(60, |k| {
            let sense: i8 = if (k * 0.7).sin() > 0.0 { 1 } else { -1 };
            let q = swing(k).q;
            let mut commanded = q;
            commanded[2] += lag * f64::from(sense) + noise * (5.0 * k).cos();
            let mut dir = [0; trical_model::MAX_JOINTS];
            dir[2] = sense;
            State { q_commanded: Some(commanded), dir: Some(dir), ..swing(k) }
        })
    };
    assert!(lag_follows_motion(&of(1e-4, 0.0)));
    assert!(lag_follows_motion(&of(1e-4, 1e-4)));
    assert!(!lag_follows_motion(&of(-1e-4, 0.0)), "ahead");
    assert!(!lag_follows_motion(&of(0.0, 1e-4)), "noise");
    assert!(!lag_follows_motion(&of(0.0, 0.0)) && !lag_follows_motion(&states(60, swing)));
}

#[test]
fn an_indicator_spreads_where_its_own_readings_do() {
    let list = (0..40).map(|k: i32| (swing(f64::from(k)), [if k % 2 == 0 { 3e-4 } else { 1e-4 }, 1e-4, 0.0])).collect();
    let (model, data) = (arm(), touches(&[list]));
    assert!((reading_spread(&data, 0) - 1e-4).abs() < 1e-15 && reading_spread(&data, 1) < 1e-15);
    // beside a noise of a tenth of that, and of more
    assert_eq!(Covariates::new(&model, &data, 0.99e-5).spread, [true, false, false]);
    assert_eq!(Covariates::new(&model, &data, 1.01e-5).spread, [false; 3]);
    // nulled, beside errors of a millimetre; readings of millimetres are not, whatever the errors are
    let nulled = |size: f64| {
        let list =
            (0..40).map(|k: i32| (swing(f64::from(k)), [if k % 2 == 0 { size } else { 0.0 }, 0.0, 0.0])).collect();
        Covariates::new(&model, &touches(&[list]), 1e-3).nulled
    };
    assert!(nulled(1e-4) && !nulled(5e-3));
}

#[test]
fn a_thermometer_is_the_clock_and_without_one_warm_up_curves_as_long_as_the_data() {
    let warm = states(21, |k| State { temp_c: Some(20.0 + 0.51 * k), ..timed(k) });
    let clocks_of = |data: &Dataset| clocks(data, order_of(data));
    let [clock] = &clocks_of(&warm)[..] else { panic!("one thermometer, one clock") };
    assert_eq!(clock.basis.of, Variable::Temperature { reference_c: 25.1 });
    assert!((clock.rise - 10.2).abs() < 1e-9);
    let constants = |data: &Dataset| -> Vec<f64> {
        let of = |c: &Clock| if let Shape::WarmUp { constant } = c.basis.shape { constant } else { f64::NAN };
        clocks_of(data).iter().map(of).collect()
    };
    // 13 000 s: the doubled ones that are not longer than the data
    assert_eq!(constants(&states(131, timed)), [400.0, 800.0, 1600.0, 3200.0, 6400.0, 12_800.0]);
    let numbered = states(33, |k| State { seq: Some(k + 5.0), ..swing(k) });
    assert_eq!(constants(&numbered), [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0]);
    assert!(clocks_of(&unordered()).is_empty());
}

#[test]
fn a_session_begins_with_the_arm_that_all_sessions_have() {
    // rows in any order: the warmest come first
    let day = |from: f64| -> Vec<(State, [f64; 3])> {
        let row = |k: f64| (State { temp_c: Some(from + 0.1 * k), ..timed(k) }, [1e-6 * from; 3]);
        (0..21).rev().map(|k| row(f64::from(k))).collect()
    };
    let model = arm();
    let sessions = Covariates::of_sessions(&model, &touches(&[day(19.0), day(23.0)]), 1e-5);
    let of = |(session, own): &(u32, Covariates<'_>)| (*session, own.clocks[0].basis.of);
    let from = |reference_c| Variable::Temperature { reference_c };
    assert_eq!(sessions.iter().map(of).collect::<Vec<_>>(), [(1, from(19.0)), (2, from(23.0))]);
}

#[test]
fn a_joints_load_is_the_root_mean_square_of_its_torque_and_an_upright_axis_has_none() {
    let model = arm();
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let at: [Joints; 2] = [swing(0.0).q, State::at(&[0.5, -0.6, 0.2, 0.1, 0.9, 0.0]).q];
    let torques = at.map(|q| forward.gravity_torques(&State::at(&q), &mut ws).unwrap());
    let data = touches(&[at.iter().map(|q| (State::at(q), [0.0; 3])).collect()]);
    let recorded = Covariates::new(&model, &data, 1e-5);
    for joint in 2..=5 {
        let [a, b] = torques.map(|t| t[joint - 1]);
        assert!((recorded.load(joint) - (0.5 * (a * a + b * b)).sqrt()).abs() < 1e-12, "joint {joint}");
    }
    assert_eq!(recorded.load(1), NO_LOAD_NM);
    assert!(recorded.unloaded(1) && !recorded.unloaded(2));
    // as strong as its largest load, and no weaker than a small arm
    assert_eq!(recorded.strength(), (recorded.load(2) / SMALL_ARM_LOAD_NM).max(1.0));
    // built for many times the load: that much stiffer
    let mut heavy = model.clone();
    heavy.robot.joints.iter_mut().for_each(|j| j.mass = j.mass.map(|m| 100.0 * m));
    let heavy = Covariates::new(&heavy, &data, 1e-5);
    assert!(heavy.strength() > 3.0 && (heavy.compliance(2) - 3e-5 / heavy.strength()).abs() < 1e-18);
    let mut soft = model.clone();
    let term = Term::new("c_3", "compliance", Site::Joint { joint: 3 }, Basis::torque(3, Shape::Linear));
    soft.terms.push(Term { value: -4e-5, ..term });
    let soft = Covariates::new(&soft, &data, 1e-5);
    assert_eq!(soft.compliance(3), 4e-5);
    assert_eq!((soft.strength(), soft.compliance(2)), (1.0, 3e-5));
}

#[test]
fn what_happens_in_the_course_of_a_session_is_asked_of_its_own_rows() {
    let rows = |session: u32, from: f64, count: u32| {
        (0..count)
            .map(|k| {
                (State { session: Some(session), t: Some(from * f64::from(k)), ..swing(f64::from(k) + from) }, [0.0; 3])
            })
            .collect()
    };
    let data = touches(&[rows(1, 10.0, 12), rows(2, 30.0, 9)]);
    let model = arm();
    let found = Covariates::of_sessions(&model, &data, 1e-5);
    let of: Vec<(u32, usize, f64)> = found.iter().map(|(s, c)| (*s, c.poses, c.span)).collect();
    assert_eq!(of, [(1, 12, 110.0), (2, 9, 240.0)]);
}

#[test]
fn moments_are_told_in_seconds_or_by_the_pose_at_which_they_begin() {
    assert_eq!(
        (moment(Variable::Time, 449.6), moment(Variable::Seq, 449.5)),
        ("at 450 s".into(), "at pose 450".into())
    );
    assert_eq!([seconds_per(Variable::Time), seconds_per(Variable::Seq)], [1.0, SECONDS_PER_TOUCH]);
}
