#![allow(clippy::unwrap_used)]

use trical_model::{Basis, Shape, State, Variable};

use super::*;
use crate::test_data::{arm, off, touches, with_joint_2};

/// Rounds of an arm whose joint 2 is off by 1 mrad a radian, where its gear ratio is among the candidates, and what is left of it once that
/// is in the fit.
fn begun() -> (Rounds, usize) {
    let linear = Basis::new(Variable::Joint { joint: 2 }, Shape::Linear);
    let (truth, data) = with_joint_2(&[(linear, 1e-3)]);
    let rounds = Rounds::begin(&truth.robot, &truth.cell, &data, &Options::default()).unwrap();
    let ratio = at(&rounds, EffectId::GearRatio);
    (rounds, ratio)
}

/// An effect at joint 2 among the candidates.
fn at(rounds: &Rounds, effect: EffectId) -> usize {
    let is_it = |c: &Candidate| c.cause == effect.into() && c.site == Place::Joint(2);
    rounds.candidates.iter().position(is_it).unwrap()
}

/// The coefficients of what was fitted beside the baseline, with their names.
fn fitted(rounds: &Rounds) -> Vec<(&str, f64)> {
    rounds.fitted.model.terms[rounds.baseline_terms..].iter().map(|t| (t.name.as_str(), t.value)).collect()
}

#[test]
fn a_search_ends_with_the_hidden_effect_alone_at_its_size_and_without_a_row_that_is_off() {
    let (mut rounds, ratio) = begun();
    let Measured::Touch { reading, .. } = &mut rounds.all.observations[7].measured else { unreachable!() };
    reading[1] += 1e-3;
    let wrong = rounds.all.observations[7].row;
    assert!(rounds.settle(true, SETTLED_SHARE, &Task::silent()).unwrap());
    assert_eq!(rounds.chosen, [ratio]);
    assert!((fitted(&rounds)[0].1 - 1e-3).abs() < 5e-5, "{:?}", fitted(&rounds));
    assert_eq!(rounds.kept.observations.len(), 199);
    assert!(rounds.kept.observations.iter().all(|o| o.row != wrong));
    assert!((rounds.touch_sigma() / 1e-5 - 1.0).abs() < 0.1, "{}", rounds.touch_sigma());
}

#[test]
fn of_rounds_from_the_same_rows_the_likelier_is_taken_whichever_was_the_last() {
    let (mut rounds, ratio) = begun();
    let mut round = |chosen: &[usize]| {
        rounds.chosen = chosen.to_vec();
        rounds.refit().unwrap();
        rounds.round()
    };
    let [nothing, found, again, nothing_again] = [&[][..], &[ratio], &[ratio], &[]].map(&mut round);
    rounds.take_likeliest(vec![nothing, found]).unwrap();
    assert_eq!((rounds.chosen.len(), fitted(&rounds).len()), (1, 1));
    rounds.take_likeliest(vec![again, nothing_again]).unwrap();
    assert_eq!((rounds.chosen.len(), fitted(&rounds).len()), (1, 1));
    // one that kept other rows cannot be compared
    let mut other = rounds.round();
    other.fitted.data.observations.pop();
    rounds.chosen.clear();
    rounds.refit().unwrap();
    let last = rounds.round();
    rounds.take_likeliest(vec![other, last]).unwrap();
    assert!(rounds.chosen.is_empty() && fitted(&rounds).is_empty());
}

#[test]
fn rounds_are_the_same_that_chose_alike_candidates_of_the_same_rows() {
    let (mut rounds, ratio) = begun();
    let (alike, other) = (rounds.candidates[ratio].clone(), off(EffectId::GearRatio.into(), 3, Shape::Linear));
    rounds.candidates.extend([alike, other]);
    let [alike, other] = [2, 1].map(|back| rounds.candidates.len() - back);
    let of = |chosen: &[usize]| Round { chosen: chosen.to_vec(), ..rounds.round() };
    let same = |a: &[usize], b: &[usize]| of(a).is_as(&of(b), &rounds.candidates);
    assert!(same(&[ratio, other], &[other, alike]));
    assert!(!same(&[ratio], &[other]) && !same(&[ratio], &[ratio, other]) && !same(&[], &[ratio]));
    let mut fewer = of(&[ratio]);
    fewer.fitted.data.observations.pop();
    assert!(!of(&[ratio]).is_as(&fewer, &rounds.candidates));
}

#[test]
fn what_is_held_stays_as_it_was_in_a_fit_and_effects_of_one_name_are_numbered() {
    let (mut rounds, ratio) = begun();
    let first = rounds.candidates.len();
    rounds.candidates.extend([31.0, 41.0, 59.0].map(|cycles| crate::effects::ripple(2, cycles, 6)));
    (rounds.held, rounds.chosen) = (vec![ratio], (first..first + 3).collect());
    rounds.refit().unwrap();
    let names: Vec<&str> = fitted(&rounds).into_iter().map(|(name, _)| name).collect();
    let each = ["", "_2", "_3"].map(|n| ["sine", "cosine"].map(|part| format!("ripple_{part}_2{n}"))).concat();
    assert_eq!(names[1..], each);
    assert_eq!(fitted(&rounds)[0].1, 0.0);
    rounds.refit_with(true).unwrap();
    let free = fitted(&rounds)[0].1;
    assert!((free - 1e-3).abs() < 5e-5, "{free}");
    rounds.chosen.clear();
    rounds.refit().unwrap();
    assert_eq!(fitted(&rounds).into_iter().map(|(_, value)| value).collect::<Vec<_>>(), [free]);
}

#[test]
fn a_candidate_is_added_once_and_what_is_not_searched_has_no_columns() {
    let (mut rounds, ratio) = begun();
    let (known, before) = (rounds.candidates[ratio].clone(), rounds.candidates.len());
    let mut elsewhere = known.clone();
    elsewhere.terms[0].site = Site::Joint { joint: 3 };
    let nameless = Candidate { cause: Cause::Unexplained, ..known.clone() };
    rounds.add(vec![known, elsewhere.clone(), nameless, elsewhere]);
    assert_eq!(rounds.candidates.len(), before + 2);
    (rounds.held, rounds.let_go, rounds.idle) = (vec![0], vec![1], vec![2]);
    let empty: Vec<usize> = (0..).zip(rounds.searched()).filter(|(_, c)| c.terms.is_empty()).map(|(k, _)| k).collect();
    assert_eq!((empty, rounds.searched().len()), (vec![0, 1, 2], before + 2));
}

/// How probable steps and curves of a joint without a name are together, before the data say anything.
fn nameless(rounds: &Rounds, joint: usize) -> f64 {
    let here = |c: &&Candidate| c.cause == Cause::Unexplained && c.site == Place::Joint(joint) && c.scanned();
    rounds.candidates.iter().filter(here).map(|c| c.log_prior.exp()).sum()
}

#[test]
fn where_a_place_took_two_names_what_has_none_is_as_probable_and_nowhere_else() {
    let (mut rounds, ratio) = begun();
    rounds.chosen = vec![ratio];
    rounds.refit().unwrap();
    // frequencies faster than any gear are new once
    assert!(rounds.widen().unwrap() && !rounds.widen().unwrap());
    let before = [2, 3].map(|joint| nameless(&rounds, joint));
    rounds.chosen.push(at(&rounds, EffectId::LostMotionDirection));
    assert!(rounds.widen().unwrap());
    let after = [2, 3].map(|joint| nameless(&rounds, joint));
    assert!(before[0] < 0.1 && (after[0] - 1.0).abs() < 1e-9 && after[1] == before[1], "{before:?} {after:?}");
}

#[test]
fn where_a_joint_does_more_than_its_name_says_what_has_none_is_as_probable() {
    let basis = |shape| Basis::new(Variable::Joint { joint: 2 }, shape);
    let (truth, data) = with_joint_2(&[(basis(Shape::Linear), 1e-3), (basis(Shape::Step { at: 0.2 }), 1e-3)]);
    let mut rounds = Rounds::begin(&truth.robot, &truth.cell, &data, &Options::default()).unwrap();
    rounds.chosen = vec![at(&rounds, EffectId::GearRatio)];
    rounds.refit().unwrap();
    rounds.widen().unwrap();
    assert!((nameless(&rounds, 2) - 1.0).abs() < 1e-9, "{}", nameless(&rounds, 2));
}

#[test]
fn the_search_asks_no_long_curves_and_only_names_where_that_is_asked() {
    let (truth, data) = with_joint_2(&[]);
    let begin = |names_only| {
        let options = Options { names_only, ..Options::default() };
        Rounds::begin(&truth.robot, &truth.cell, &data, &options).unwrap()
    };
    let (all, names) = (begin(false), begin(true));
    assert!(nameless(&all, 2) > 0.0 && nameless(&names, 2) == 0.0);
    assert!(!all.curves.is_empty() && !all.candidates.iter().any(Candidate::is_long_curve));
}

/// An effect of the load times a compliance could be anything, were the compliance so.
#[test]
fn compliances_alone_have_a_prior_that_keeps_them_possible_and_the_device_turns_where_readings_show_it() {
    let (rounds, _) = begun();
    let terms = || rounds.fitted.model.terms.iter().zip(&rounds.known);
    assert!(terms().all(|(t, k)| t.gives_way().is_some() == k.prior.is_some()));
    assert!(terms().any(|(_, k)| k.prior.is_some()));
    let turns = |t: &Term| t.site == Site::Tool(trical_model::Motion::About(trical_model::Axis::Z));
    assert_eq!(rounds.fitted.model.terms.iter().filter(|t| turns(t)).count(), 1);
}

#[test]
fn a_parameter_counts_by_how_much_the_data_say_of_it_beyond_what_was_known() {
    let (mut rounds, _) = begun();
    let all = rounds.fitted.model.terms.iter().filter(|t| is_parameter_of_arm(t)).count();
    rounds.known.fill(PriorKnowledge::NOTHING);
    assert_eq!(rounds.effective_parameters(), all as f64);
    for (k, sd) in [(0, 0.5), (1, 1.0), (2, 7.0)] {
        rounds.known[k] = PriorKnowledge::about_zero(1.0);
        rounds.fitted.model.terms[k].sd = Some(sd);
    }
    assert_eq!(rounds.effective_parameters(), (all - 3) as f64 + 0.75);
    rounds.determined = Some(4.5);
    assert_eq!(rounds.effective_parameters(), 4.5);
}

#[test]
fn a_soft_joint_may_be_as_soft_as_its_compliance_could_be() {
    let (mut rounds, _) = begun();
    let soft = at(&rounds, EffectId::NonlinearStiffness);
    let mut sized = |sd: f64| {
        for t in rounds.fitted.model.terms.iter_mut().filter(|t| t.gives_way().is_some()) {
            (t.value, t.sd) = (-1e-4, Some(sd));
        }
        rounds.resize();
        (rounds.candidates[soft].scales[0], rounds.candidates[soft].typical)
    };
    let ((scale, typical), (scale_if_unsure, typical_if_unsure)) = (sized(0.0), sized(1e-4));
    assert!((scale_if_unsure / scale - 2.0).abs() < 1e-9 && (typical_if_unsure / typical - 2.0).abs() < 1e-9);
}

#[test]
fn frames_targets_places_of_balls_and_noise_of_readings_are_no_parameters_of_the_arm() {
    let of = |effect: &str, site| is_parameter_of_arm(&Term::new("t", effect, site, Basis::CONSTANT));
    let x = trical_model::Motion::Along(trical_model::Axis::X);
    assert!(of("tool", Site::Tool(x)) && of("geometry", Site::Base(x)));
    assert!(!of("place", Site::Fixture(x)) && !of(Cause::ReadingNoise.name(), Site::Tool(x)));
    assert!(
        !of("frame", Site::Frame { frame: 0, motion: x })
            && !of("target", Site::Target { target: 0, axis: trical_model::Axis::X })
    );
}

#[test]
fn the_noise_is_that_of_touches_where_there_are_any() {
    let (mut rounds, _) = begun();
    let sigma = rounds.touch_sigma();
    let length = Measured::Distance { anchor: 0, length: 1.0 };
    rounds.fitted.data.observations[0].measured = length;
    assert_eq!(rounds.touch_sigma(), sigma);
    rounds.fitted.data.observations.truncate(1);
    assert_ne!(rounds.touch_sigma(), sigma);
}

#[test]
fn the_longest_recording_is_counted_in_poses_and_targets_of_one_pose_in_six_numbers() {
    let at = |k: u8| (State::at(&[0.1 * f64::from(k)]), [0.0; 3]);
    let data = touches(&[vec![at(0), at(1), at(2)], vec![at(3), at(4), at(4), at(4), at(5)], vec![at(6)]]);
    assert_eq!(longest_recording(&data), 3);
    assert_eq!(temper(&data), 1.0);
    let seen = |target| Measured::Point { target, position: [0.1; 3] };
    let mut data = data.filtered(|o| o.recording == 1);
    (0..).zip(&mut data.observations).for_each(|(k, o)| o.measured = seen(k));
    assert_eq!(temper(&data), 1.0);
    // twice as many targets at each pose: 30 numbers, of which three poses have 18
    data.observations.extend(data.observations.clone());
    data.observations.sort_by_key(|o| o.pose);
    assert_eq!(temper(&data), 18.0 / 30.0);
}

#[test]
fn parameters_of_instruments_are_not_counted_as_the_arms() {
    let mut model = arm();
    let x = trical_model::Motion::Along(trical_model::Axis::X);
    let term = |site| Term::new("t", "t", site, Basis::CONSTANT);
    model.terms = vec![term(Site::Tool(x)), term(Site::Frame { frame: 0, motion: x }), term(Site::Base(x))];
    assert_eq!(arm_parameters(&model), 2);
}
