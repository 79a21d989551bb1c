#![allow(clippy::unwrap_used, clippy::panic)]

use super::*;
use crate::effect_id::EffectId;
use crate::options::Options;
use crate::rounds::Rounds;
use crate::settings::SETTLED_SHARE;
use crate::test_data::{arm, states, with_joint_2};
use trical_model::{State, Task};

const Q2: Variable = Variable::Joint { joint: 2 };
const AT_2: Site = Site::Joint { joint: 2 };

/// q2 from -0.5 to 0.5 rad in 101 even steps, the other joints anywhere.
fn swept() -> Dataset {
    states(101, |k| State::at(&[0.03 * k, -0.5 + 0.01 * k, (3.0 * k).sin(), (5.0 * k).cos(), (2.0 * k).sin(), 0.0]))
}

fn shapes(terms: &[Term]) -> Vec<Shape> {
    terms.iter().map(|t| t.basis.shape).collect()
}

#[test]
fn knots_are_quantiles_from_end_to_end() {
    let values: Vec<f64> = (0..22).map(|k| f64::from(k * k)).collect();
    assert_eq!(knots(&values, 4).unwrap(), [0.0, 49.0, 196.0, 441.0]);
    assert!(knots(&values[..19], 4).is_none(), "it hardly changed");
    assert!(knots(&[3.0; 40], 4).is_none());
}

/// Between the ends all tents together are 1, so that any constant is among the curves; beyond, they return to zero.
#[test]
fn tents_add_up_to_one_between_the_ends_and_to_zero_far_beyond() {
    let knots = [-0.5, -0.1, 0.2, 0.5];
    let all = shapes(&tents(AT_2, Q2, Some(3), &knots));
    let sum = |u: f64| all.iter().map(|s| s.at(u).0).sum::<f64>();
    for u in [-0.5, -0.3, -0.1, 0.0, 0.35, 0.5] {
        assert!((sum(u) - 1.0).abs() < 1e-12, "{u}: {}", sum(u));
    }
    assert!((sum(-0.7) - 0.5).abs() < 1e-12 && sum(-0.95) == 0.0 && sum(0.81) == 0.0);
    // the site's own constant is in the model already; that of a sense of motion is not
    assert_eq!((all.len(), tents(AT_2, Q2, None, &knots).len()), (4, 3));
    assert_eq!(shapes(&tents(AT_2, Q2, None, &knots)), all[1..]);
}

#[test]
fn growth_is_nothing_before_its_threshold_and_one_at_the_end() {
    let sorted: Vec<f64> = (0..=90).map(|k| f64::from(k) / 90.0).collect();
    let all = growths(&sorted);
    assert_eq!(all.len(), 4 * (GROWTH_QUANTILES - 1));
    for (k, four) in all.chunks(4).enumerate() {
        let at = f64::from(u8::try_from(k).unwrap() + 1) / 9.0;
        for (n, shape) in four.iter().enumerate() {
            let (end, other) = if n % 2 == 0 { (1.0, 0.0) } else { (0.0, 1.0) };
            let value = |u: f64| shape.at(u).0;
            assert!((value(end) - 1.0).abs() < 1e-12 && value(at) == 0.0 && value(other) == 0.0, "{k} {n}");
            // half way it is a half, or a quarter
            let half = value(0.5 * (at + end));
            assert!((half - if n < 2 { 0.5 } else { 0.25 }).abs() < 1e-12, "{k} {n}: {half}");
            // beyond what was visited it returns to nothing, straight
            let beyond = [1.5 * end - 0.5 * at, 2.0 * end - at].map(value);
            assert!((beyond[0] - 0.5).abs() < 1e-12 && beyond[1].abs() < 1e-12, "{k} {n}: {beyond:?}");
        }
    }
}

#[test]
fn something_local_is_asked_for_only_where_enough_values_are() {
    let sorted: Vec<f64> = (0..=320).map(|k| f64::from(k) / 320.0).collect();
    let all = locals(&sorted);
    assert_eq!(all.len(), 3 * (LOCAL_CENTRES - 1));
    for shape in &all {
        let Shape::Tent { left, centre, right } = *shape else { panic!("{shape:?}") };
        assert!(LOCAL_REACHES.iter().any(|r| (centre - left - r).abs() < 1e-12), "{shape:?}");
        assert!((right + left - 2.0 * centre).abs() < 1e-12);
    }
    // 40 values: within the narrowest reach are too few
    let few: Vec<f64> = (0..40).map(|k| f64::from(k) / 39.0).collect();
    assert!(locals(&few).iter().all(|s| matches!(s, Shape::Tent { left, right, .. } if right - left > 0.1)));
}

#[test]
fn a_step_is_between_two_values_and_the_price_is_that_of_all_that_was_asked() {
    let (model, data) = (arm(), swept());
    let all = locators(&model, &data);
    let mut steps = 0;
    for c in all.iter().filter(|c| c.site == Place::Joint(4)) {
        if let Some((Q2, at)) = c.step() {
            // the hundredths themselves were visited
            assert!(
                (100.0 * at - 0.5).rem_euclid(1.0) < 1e-6 || (100.0 * at - 0.5).rem_euclid(1.0) > 1.0 - 1e-6,
                "{at}"
            );
            steps += 1;
        }
    }
    assert_eq!(steps, STEP_THRESHOLDS - 1);
    let price = (all.len() as f64).ln() + UNNAMED_PRICE_NATS;
    assert!(all.iter().all(|c| c.log_prior == -price && c.terms.len() == c.scales.len()));
    // each curve is asked for twice: as large as what has no name may be, and as the small rest beside a name
    let curves = all.iter().filter(|c| c.site == Place::Joint(4) && c.curve() == Some(Q2));
    let scales: Vec<f64> = curves.map(|c| c.scales[0]).collect();
    assert_eq!(scales, [UNNAMED_SIZE_RAD, UNNAMED_SIZE_RAD * UNNAMED_REST]);
}

/// What is chosen for joint 2, whose error is a wave of its own angle of this size and products of 5e-5 rad with waves of joint 4.
fn beside_products(wave: f64) -> Vec<Cause> {
    let [sine, cosine] = [Shape::Sine { cycles: 1.0 }, Shape::Cosine { cycles: 1.0 }];
    let product = |own, shape| Basis { beside: Some(Beside { joint: 4, shape }), ..Basis::new(Q2, own) };
    let (truth, data) =
        with_joint_2(&[(Basis::new(Q2, sine), wave), (product(sine, sine), 5e-5), (product(cosine, cosine), -5e-5)]);
    let mut rounds = Rounds::begin(&truth.robot, &truth.cell, &data, &Options::default()).unwrap();
    rounds.settle(true, SETTLED_SHARE, &Task::silent()).unwrap();
    let chosen = rounds.chosen.iter().map(|c| &rounds.candidates[*c]);
    chosen.filter(|c| c.site == Place::Joint(2)).map(|c| c.cause).collect()
}

#[test]
fn an_eccentric_gear_does_not_hide_in_a_small_surface() {
    let gear = EffectId::JointHarmonic.into();
    assert!(beside_products(5e-4).contains(&gear), "{:?}", beside_products(5e-4));
    assert!(!beside_products(0.0).contains(&gear));
}

/// What was fitted is told as it was fitted: where, which way, how large.
#[test]
fn a_fitted_step_growth_or_curve_is_told_where_it_is() {
    let data = swept();
    let told = |shape: Shape| {
        let term = Term::new("t", UNEXPLAINED, AT_2, Basis::new(Q2, shape));
        let mut model = arm();
        model.terms.push(Term { value: 2e-3, ..term.clone() });
        let c = candidate(2, vec![term], "q2");
        describe(&c, std::iter::once(&c), &model, &data)
    };
    // fewer than half of the values are below: told from that side
    let step = told(Shape::Step { at: -0.2 });
    assert_eq!((step.variable.as_str(), step.region.as_str()), ("q2", "q2 < -11.5 deg"));
    assert_eq!(step.units, ("deg".to_owned(), "deg".to_owned()));
    let ends = |l: &Located| [l.curve[0], l.curve[40]];
    let degrees = 2e-3_f64.to_degrees();
    let near = |a: (f64, f64), b: (f64, f64)| (a.0 - b.0).abs() < 1e-9 && (a.1 - b.1).abs() < 1e-9;
    let half = 0.5_f64.to_degrees();
    assert!(near(ends(&step)[0], (-half, 0.0)) && near(ends(&step)[1], (half, degrees)), "{:?}", ends(&step));
    assert_eq!(told(Shape::Step { at: 0.2 }).region, "q2 > 11.5 deg");
    assert_eq!(told(Shape::Tent { left: 0.1, centre: 0.5, right: 0.9 }).region, "q2 > 5.7 deg, growing");
    assert_eq!(told(Shape::Tent { left: -0.9, centre: -0.5, right: -0.1 }).region, "q2 < -5.7 deg, growing");
    assert_eq!(told(Shape::Tent { left: -0.1, centre: 0.0, right: 0.1 }).region, "q2 from -5.7 to 5.7 deg");
    assert_eq!(told(Shape::Growth { from: 0.1, to: 0.5 }).region, "q2 > 5.7 deg, growing with the square");
    assert_eq!(told(Shape::Growth { from: -0.1, to: -0.5 }).region, "q2 < -5.7 deg, growing with the square");
}

#[test]
fn what_two_angles_tell_is_drawn_over_the_other_one_with_the_joint_in_its_middle() {
    let data = swept();
    let terms = together(AT_2, 2, 3);
    assert_eq!(terms.len(), 4);
    let mut model = arm();
    // -cos(q2) sin(q3) alone
    let at = terms.iter().position(|t| t.name == "cosine_2_sine_3").unwrap();
    model.terms.push(Term { value: -1e-3, ..terms[at].clone() });
    let c = candidate(2, terms, "q3, with its own angle,");
    let l = describe(&c, std::iter::once(&c), &model, &data);
    assert_eq!((l.variable.as_str(), l.region.as_str()), ("q3", "all of q3, with q2"));
    for (u, y) in &l.curve {
        // q2 is 0 in the middle
        assert!((y - (-1e-3 * u.to_radians().sin()).to_degrees()).abs() < 1e-9, "{u} {y}");
    }
    let q3 = || data.observations.iter().map(|o| o.state.q[2].to_degrees());
    let ends = [q3().fold(f64::MAX, f64::min), q3().fold(f64::MIN, f64::max)];
    assert!((l.curve[0].0 - ends[0]).abs() < 1e-9 && (l.curve[40].0 - ends[1]).abs() < 1e-9, "{ends:?}");
}

#[test]
fn what_happens_near_one_value_reaches_as_far_to_either_side_in_shares_of_the_range() {
    let values: Vec<f64> = (0..200).map(|k| 3.0 + 0.01 * f64::from(k)).collect();
    let mut reaches: Vec<f64> = Vec::new();
    for shape in locals(&values) {
        let Shape::Tent { left, centre, right } = shape else { panic!("{shape:?}") };
        assert!((centre - left - (right - centre)).abs() < 1e-12);
        reaches.push((right - centre) / 1.99);
    }
    let is_asked = |reach: &f64| LOCAL_REACHES.iter().any(|part| (reach - part).abs() < 1e-9);
    assert!(!reaches.is_empty() && reaches.iter().all(is_asked), "{reaches:?}");
}
