#![allow(clippy::unwrap_used)]

use trical_ident::{Choice, ParameterSet, identify};
use trical_model::{Basis, Shape, Term, Variable};

use super::*;
use crate::test_data::{off, with_joint_2};

const CYCLES: [(usize, f64); 5] = [(2, 9.0), (2, 14.0), (2, 14.3), (3, 23.0), (2, 40.0)];

/// Of an arm whose joint 2 is off by waves of 9, 14 and 40 cycles: what `ask` says of the [`CYCLES`], of which two are not there.
fn asked<T>(ask: impl Fn(Search<'_>, &RegressionState) -> T) -> T {
    asked_with(&[], ask)
}

/// The same with `more` candidates behind them.
fn asked_with<T>(more: &[Candidate], ask: impl Fn(Search<'_>, &RegressionState) -> T) -> T {
    let wave = |cycles| Basis::new(Variable::Joint { joint: 2 }, Shape::Sine { cycles });
    let (truth, data) = with_joint_2(&[(wave(9.0), 3e-4), (wave(14.0), 5e-4), (wave(40.0), -2e-4)]);
    let fitted = identify(&truth.robot, &truth.cell, &data, Choice::from(ParameterSet::Compliance)).unwrap();
    let ripple = |(joint, cycles)| off(EffectId::GearRipple.into(), joint, Shape::Sine { cycles });
    let all = [&CYCLES.map(ripple)[..], more].concat();
    let design = Design::new(&fitted.model, &all, &data, &fitted.noise).unwrap();
    ask(Search::new(&design, &all, 1.0), &design.start())
}

fn sorted(mut set: Vec<usize>) -> Vec<usize> {
    set.sort_unstable();
    set
}

#[test]
fn a_choice_ends_at_what_is_there_from_wherever_it_begins() {
    for initial in [&[][..], &[2], &[2, 3], &[3, 0, 2]] {
        let chosen = asked(|mut search, start| search.choose(start, initial));
        assert_eq!(sorted(chosen), [0, 1, 4], "{initial:?}");
    }
}

#[test]
fn what_is_far_from_being_of_use_is_idle_and_what_is_missing_is_not() {
    let improbable =
        Candidate { log_prior: -100.0, ..off(EffectId::GearRipple.into(), 2, Shape::Sine { cycles: 77.0 }) };
    let idle = asked_with(&[improbable], |search, start| search.idle(start, &[0, 4]));
    assert!(idle.contains(&CYCLES.len()) && ![0, 1, 4].iter().any(|c| idle.contains(c)), "{idle:?}");
}

#[test]
fn one_is_replaced_by_a_better_one_only_where_that_is_asked_for() {
    let swapped = |asked_of: bool| {
        asked(|search, start| {
            let mut chosen = vec![0, 2, 4];
            assert!(search.swap(start, &mut chosen, &|c| asked_of || c != 2), "nothing is left to replace");
            sorted(chosen)
        })
    };
    assert_eq!((swapped(true), swapped(false)), (vec![0, 1, 4], vec![0, 2, 4]));
}

#[test]
fn a_curve_without_a_name_goes_for_three_waves_that_together_say_what_it_says() {
    let mut nameless = off(Cause::Unexplained, 2, Shape::Sine { cycles: 9.0 });
    for cycles in [14.0, 40.0, 11.0, 17.0, 20.0, 23.0, 26.0] {
        let one = off(Cause::Unexplained, 2, Shape::Sine { cycles });
        nameless.terms.extend(one.terms);
        nameless.signs.extend(one.signs);
        nameless.scales.extend(one.scales);
    }
    let swapped = |most: &[usize]| {
        asked_with(std::slice::from_ref(&nameless), |search, start| {
            let out: Vec<usize> = (0..CYCLES.len()).filter(|c| !most.contains(c)).collect();
            let mut chosen = vec![CYCLES.len()];
            search.without_candidates(&out).swap(start, &mut chosen, &|_| true);
            sorted(chosen)
        })
    };
    assert_eq!(swapped(&[0, 1, 4]), [0, 1, 4]);
    assert_eq!(swapped(&[0, 1]), [CYCLES.len()], "two of them do not");
}

/// Of each wave that is there (9, 14 and 40 cycles) a curve with many more, and waves that are hardly another number.
#[test]
fn each_of_several_curves_is_replaced_though_there_are_many_ways_to_replace_the_first() {
    let wave = |cycles| off(Cause::Unexplained, 2, Shape::Sine { cycles });
    let curve = |cycles: f64, more: u32| {
        let mut curve = wave(cycles);
        for k in 1..more {
            let one = wave(cycles + 60.0 + 7.0 * f64::from(k));
            curve.terms.extend(one.terms);
            curve.signs.extend(one.signs);
            curve.scales.extend(one.scales);
        }
        curve
    };
    let near = [9.0, 14.0, 40.0].iter().flat_map(|n| [0.02, -0.02, 0.03, -0.03].map(|d| wave(n + d)));
    let more: Vec<Candidate> = [curve(9.0, 12), curve(14.0, 8), curve(40.0, 4)].into_iter().chain(near).collect();
    let curves = [CYCLES.len(), CYCLES.len() + 1, CYCLES.len() + 2];
    let left = asked_with(&more, |search, start| {
        let mut chosen = curves.to_vec();
        search.swap_once(start, &mut chosen, &|_| true);
        curves.iter().filter(|c| chosen.contains(c)).count()
    });
    assert_eq!(left, 0, "curves are left");
}

#[test]
fn what_is_of_no_use_beside_the_others_is_dropped_and_the_rest_has_its_size() {
    let earned = asked(|search, start| search.each_beside_others(start, &[4, 3, 1, 0]));
    let sizes: Vec<(usize, f64)> = earned.iter().map(|(c, coefficients)| (*c, coefficients[0])).collect();
    for ((c, size), (there, true_size)) in sizes.iter().zip([(4, -2e-4), (1, 5e-4), (0, 3e-4)]) {
        assert!(*c == there && (size - true_size).abs() < 1e-5, "{sizes:?}");
    }
    assert_eq!(sizes.len(), 3);
    let first = asked(|search, start| search.first(start, &[3], 2));
    assert_eq!(sorted(first), [0, 1], "of three that are there, the two largest");
}

#[test]
fn a_wave_that_would_turn_the_joint_back_is_not_chosen_however_well_it_fits() {
    let chosen = |cycles: f64| {
        let bases = [Shape::Sine { cycles }, Shape::Cosine { cycles }]
            .map(|shape| Basis::new(Variable::Joint { joint: 2 }, shape));
        let (truth, data) = with_joint_2(&[(bases[0], 4e-3), (bases[1], 3e-3)]);
        let fitted = identify(&truth.robot, &truth.cell, &data, Choice::from(ParameterSet::Compliance)).unwrap();
        let mut wave = off(EffectId::GearRipple.into(), 2, bases[0].shape);
        let cosine = Term { basis: bases[1], ..wave.terms[0].clone() };
        wave.terms.push(cosine);
        (wave.signs, wave.scales) = (vec![0; 2], vec![5e-3; 2]);
        let all = [wave];
        let design = Design::new(&fitted.model, &all, &data, &fitted.noise).unwrap();
        Search::new(&design, &all, 1.0).choose(&design.start(), &[])
    };
    // slopes of 0.5 and 1.5
    assert_eq!((chosen(100.0), chosen(300.0)), (vec![0], vec![]));
}

#[test]
fn a_part_of_the_wrong_sign_is_small_or_not_beside_its_own_usual_size() {
    let chosen = |wrong: f64| {
        let wave = |cycles| Basis::new(Variable::Joint { joint: 2 }, Shape::Sine { cycles });
        let (truth, data) = with_joint_2(&[(wave(9.0), 1e-3), (wave(14.0), wrong)]);
        let fitted = identify(&truth.robot, &truth.cell, &data, Choice::from(ParameterSet::Compliance)).unwrap();
        let mut both = off(EffectId::LoadFriction.into(), 2, Shape::Sine { cycles: 9.0 });
        both.terms.push(Term { basis: wave(14.0), ..both.terms[0].clone() });
        // as in two units: the second part is usually ten times as small
        (both.signs, both.scales) = (vec![1; 2], vec![1e-3, 1e-4]);
        let all = [both];
        let design = Design::new(&fitted.model, &all, &data, &fitted.noise).unwrap();
        Search::new(&design, &all, 1.0).choose(&design.start(), &[])
    };
    assert_eq!([-1e-5, -1e-4, 1e-4].map(chosen), [vec![0], vec![], vec![0]]);
}

#[test]
fn evidence_adds_up_and_the_best_comes_first() {
    asked(|search, start| {
        let ranked: Vec<usize> = search.rank(start).iter().map(|r| r.candidate).collect();
        assert_eq!(ranked[..1], [1]);
        let [nine, both] = [&[0][..], &[0, 1]].map(|set| search.total(start, set));
        let beside = search.evidence(&search.with(start, &[0]), 1).unwrap().evidence;
        assert!((nine + beside - both).abs() < 1e-6 && beside > 100.0, "{nine} {beside} {both}");
    });
}
