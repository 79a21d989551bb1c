#![allow(clippy::unwrap_used)]

use super::*;
use crate::test_data::{arm, data, pose};
use trical_model::{Basis, Site, State};

const TOUCH: Measured = Measured::Touch { ball: 1, reading: [0.0; 3] };

#[test]
fn a_measurement_is_named_by_its_line_and_by_its_recording_where_there_are_several() {
    let point = Measured::Point { target: 2, position: [0.1; 3] };
    let length = Measured::Distance { anchor: 3, length: 1.0 };
    let one = data(&[vec![(pose(0), TOUCH), (pose(1), length)]]);
    assert_eq!([0, 1, 2].map(|k| where_measured(&one, k)), ["line 2, ball 2", "line 3, anchor 4", ""]);
    let mut two = data(&[vec![(pose(0), TOUCH)], vec![(pose(1), point)]]);
    assert_eq!([0, 1].map(|k| where_measured(&two, k)), ["r0.csv, line 2, ball 2", "r1.csv, line 2, target 3"]);
    // a file without lines has rows
    two.observations[1].line = 0;
    assert_eq!(where_measured(&two, 1), "r1.csv, row 2, target 3");
}

/// Student's t: the tables of any textbook.
#[test]
fn intervals_of_95_percent_are_wider_where_few_numbers_are_to_spare() {
    for (spare, expected) in [(1, 12.706), (4, 2.776), (10, 2.228), (100, 1.984)] {
        assert!((half_width(Some(spare)) - expected).abs() < 5e-4, "{spare}: {}", half_width(Some(spare)));
    }
    assert_eq!([half_width(None), half_width(Some(0))], [1.959_964; 2]);
}

#[test]
fn an_interval_is_told_with_the_digits_that_it_leaves_and_whether_nominal_is_in_it() {
    let mut model = arm();
    let site = Site::Link { link: 3, parameter: trical_model::Parameter::A };
    let mut term = Term::new("a_3", "geometry", site, Basis::CONSTANT);
    (term.value, term.sd) = (1.23e-4, Some(1e-4));
    model.terms.push(term);
    let tell = |sds: f64| parameters(&model, model.terms.iter(), sds, |name| format!("about {name}")).pop().unwrap();
    // nominal 70 mm, identified 70.123 with 0.1
    assert_eq!(tell(2.0), ["a_3", "70.000", "70.12", "69.92", "70.32", "mm", "about a_3; nominal lies within"]);
    assert_eq!(tell(1.0)[3..], ["70.02", "70.22", "mm", "about a_3"]);
}

#[test]
fn the_pose_that_is_drawn_is_one_of_the_measured_ones_nearest_to_their_middle() {
    let poses = [[0.0; MAX_JOINTS], State::at(&[0.4, 1.0]).q, State::at(&[1.0, 2.0]).q, State::at(&[0.0, 2.0]).q];
    // the middle is 0.35, 1.25
    assert_eq!(typical(&poses), poses[1]);
    assert_eq!(typical(&[]), [0.0; MAX_JOINTS]);
}

#[test]
fn the_range_of_each_joint_is_told_with_its_share_of_what_it_may() {
    let model = arm();
    let low = model.robot.joints[1].limits[0];
    let high = model.robot.joints[1].limits[1];
    let quarter = low + 0.25 * (high - low);
    let rows = coverage(&model.robot, &[State::at(&[0.0, quarter]).q, State::at(&[0.0, low]).q]);
    assert_eq!(rows.len(), 7);
    let deg = |x: f64| format!("{:.0} deg", x.to_degrees());
    assert_eq!(rows[2][1..3], [deg(low), deg(quarter)]);
    assert_eq!((rows[2][0].as_str(), rows[2][4].as_str(), rows[1][4].as_str()), ("2", "25 %", "0 %"));
}

#[test]
fn small_errors_are_blue_and_large_ones_red() {
    assert_eq!([shade(0.0), shade(1.0), shade(7.0)], ["rgb(38,102,165)", "rgb(200,70,50)", "rgb(200,70,50)"]);
    assert_eq!(shade(0.5), "rgb(119,86,108)");
}

#[test]
fn a_recording_is_beyond_the_usual_noise_by_its_own_residuals() {
    let model = arm();
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    // touches as the model would read them, each indicator off by so much
    let mut touched = |from: u8, off: f64| {
        let one = |k: u8| {
            let state = pose(k);
            let tool = forward.world_from_tool(&state, &mut ws);
            let i = tool.rotation.transpose() * (model.cell.balls[0] - tool.translation);
            (state, Measured::Touch { ball: 0, reading: std::array::from_fn(|a| i[a] + off) })
        };
        (from..from + 9).map(one).collect::<Vec<_>>()
    };
    let both = data(&[touched(0, 2e-5), touched(20, 8e-5)]);
    let all = residuals(&model, &both).unwrap();
    assert!(all.iter().take(9).all(|r| (r.norm() - 0.02 * 3.0_f64.sqrt()).abs() < 1e-9), "mm: {:?}", all[0]);
    // the usual noise is 0.01 mm: twice that is not unusual, eight times is
    let told = beyond_noise(&model, &both).unwrap();
    assert_eq!(told.len(), 1);
    // of what it was measured with alone
    let said = "The residuals of r1.csv are 8 times the usual noise (0.01 mm along each axis for indicators touching precision balls):";
    assert!(told[0].starts_with(said), "{}", told[0]);
}

#[test]
fn a_ball_in_a_printed_socket_may_be_off_by_its_play() {
    let laid = |off: f64| {
        let mut model = arm();
        let forward = Forward::new(model.clone(), Vec::new()).unwrap();
        let state = State { place: Some(1), ..pose(0) };
        model.cell.balls[1] = forward.world_from_tool(&state, &mut forward.workspace()).translation.add_scalar(off);
        beyond_noise(&model, &data(&[vec![(state, TOUCH)]])).unwrap()
    };
    assert!(laid(8e-5).is_empty(), "{:?}", laid(8e-5));
    assert!(laid(8e-4)[0].starts_with("The residuals of r0.csv are 8 times the usual noise"), "{:?}", laid(8e-4));
}

#[test]
fn a_tail_is_long_beyond_three_times_the_rms_but_not_of_lengths() {
    let errors = |last: f64| ErrorSummary::of(&[vec![1e-5; 40], vec![last]].concat());
    let touches = data(&[vec![(pose(0), TOUCH)]]);
    let lengths = data(&[vec![(pose(0), Measured::Distance { anchor: 0, length: 1.0 })]]);
    assert!(long_tail(&errors(6e-5), &touches).unwrap().contains("4.4 times the rms"));
    assert!(long_tail(&errors(3e-5), &touches).is_none() && long_tail(&errors(6e-5), &lengths).is_none());
}

#[test]
fn rejected_rows_are_listed_and_what_is_not_listed_is_counted() {
    let one = Rejected { recording: "r.csv".into(), line: 7, row: 6, reason: "far off".into() };
    assert_eq!(rejected(&[], 0).text, ["No row was rejected."]);
    let some = rejected(std::slice::from_ref(&one), 4);
    assert_eq!(
        (some.tables[0][1].clone(), some.text),
        (row(["r.csv", "line 7", "far off"]), vec!["3 more are not listed.".to_owned()])
    );
    assert!(rejected(std::slice::from_ref(&one), 1).text.is_empty());
    // what follows each other for one reason is one line
    let at = |line, reason: &str| Rejected { line, reason: reason.into(), ..one.clone() };
    let rows = [at(7, "far off"), at(8, "far off"), at(9, "lost"), at(11, "lost"), at(12, "lost")];
    let told: Vec<(String, usize)> = rejected_together(&rows).into_iter().map(|(place, n, _)| (place, n)).collect();
    let expected = [("lines 7 to 8", 2), ("line 9", 1), ("lines 11 to 12", 2)];
    assert_eq!(told, expected.map(|(place, n)| (place.to_owned(), n)));
    let many: Vec<Rejected> = (0..11).map(|k| at(2 * k, "lost")).collect();
    assert!(!rejected(&rows, 5).folded && rejected(&many, 11).folded);
}

#[test]
fn a_legend_says_what_the_parameters_are_that_are_there() {
    let term = |name| Term::new(name, "geometry", Site::Joint { joint: 2 }, Basis::CONSTANT);
    assert_eq!(
        legend([term("c_2"), term("theta_2")].iter()).unwrap(),
        "Names: theta_k: zero of joint k; c_k: compliance of joint k."
    );
    assert!(legend([term("other")].iter()).is_none());
}
