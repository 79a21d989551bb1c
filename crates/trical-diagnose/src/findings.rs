//! From what was chosen to what is said: findings with their evidence and rivals, what has no name, what could not be seen.

use trical_ident::dataset::Dataset;
use trical_ident::fit::cautions::listed;
use trical_ident::fit::identify::{ErrorSummary, Identified};
use trical_ident::fit::residuals::position_errors;
use trical_ident::units::unit;
use trical_model::{Forward, Model, Place, Robot, Scope, Term, Variable};

use crate::candidate::{Candidate, cycles_of};
use crate::diagnosis::{Blind, Coefficient, Evidence, Finding, Rival, Unexplained};
use crate::effect_id::{Cause, EffectId};
use crate::linear::RegressionState;
use crate::locators;
use crate::probability::Replicated;
use crate::selection::Search;
use crate::settings::{
    CONSIDERABLE_SHARE, MOST_RIVALS, PROBE_BETTER_NATS, REMAINDER_P, RIVAL_LEFT_SHARE, RIVAL_NATS, VISIBLE_LAMBDA,
};
use crate::specification_test::{LackOfFit, SpecificationTest};
use crate::statistics::{bic_nats, f_test_of_effect};

/// One group of chosen candidates: same effect, same site; waves by their cycles, steps in the order in which they happened.
pub(crate) struct Group {
    pub(crate) members: Vec<usize>,
}

pub(crate) fn grouped(local: &[Candidate], set: &[usize]) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for c in set {
        let same = |g: &&mut Group| {
            let o = &local[g.members[0]];
            o.is_alike(&local[*c])
        };
        match groups.iter_mut().find(same) {
            Some(g) => g.members.push(*c),
            None => groups.push(Group { members: vec![*c] }),
        }
    }
    let order = |c: &usize| local[*c].cycles().or(local[*c].step().map(|s| s.1)).unwrap_or(0.0);
    groups.iter_mut().for_each(|g| g.members.sort_by(|a, b| order(a).total_cmp(&order(b))));
    groups
}

/// Greedily by what each removes.
pub(crate) fn ordered(search: &Search<'_>, start: &RegressionState, mut groups: Vec<Group>) -> Vec<Group> {
    let mut out = Vec::new();
    let mut state = start.clone();
    while !groups.is_empty() {
        let ss = |g: &Group| search.with(&state, &g.members).ss;
        let best = (0..groups.len()).min_by(|a, b| ss(&groups[*a]).total_cmp(&ss(&groups[*b]))).unwrap_or(0);
        let g = groups.remove(best);
        state = search.with(&state, &g.members);
        out.push(g);
    }
    out
}

/// Root mean square position errors, mm, at poses that the fit did not see.
#[derive(Clone, Copy)]
pub(crate) struct Proof {
    /// By blocks: each pose by a fit without its fold.
    pub(crate) blocks: f64,
    /// The last quarter of the poses, by a fit to those before.
    pub(crate) forward: f64,
}

pub(crate) fn coefficients(model: &Model, local: &Candidate) -> Vec<Coefficient> {
    let fitted = local.terms.iter().filter_map(|t| model.terms.iter().find(|m| m.does_as(t)));
    fitted.map(|t| coefficient(&model.robot, t)).collect()
}

/// A term's coefficient in its unit.
pub(crate) fn coefficient(robot: &Robot, term: &Term) -> Coefficient {
    let u = unit(robot, term);
    Coefficient {
        name: term.name.clone(),
        value: term.value * u.per_si,
        unit: u.name,
        sd: term.sd.map(|s| s * u.per_si.abs()),
        cycles: cycles_of(term),
    }
}

/// A finding of an effect, and the best candidate of each of its rivals; probabilities and words come later.
pub(crate) fn finding(
    effect: EffectId,
    search: &Search<'_>,
    state: &RegressionState,
    group: &Group,
    others: &[usize],
    model: &Model,
    [before, after]: [Proof; 2],
) -> (Finding, Vec<Candidate>) {
    let first = group.members[0];
    let local = search.candidates;
    let with = search.with(state, &group.members);
    let dss = state.ss - with.ss;
    let rank = with.parameters - state.parameters;
    let delta_bic = {
        let n = search.freedom(state);
        n * libm::log(state.ss / with.ss) - rank * libm::log(n)
    };
    let own = search.total(state, &group.members);
    let mut rivals: Vec<Rival> = Vec::new();
    let mut best: Vec<Candidate> = Vec::new();
    for r in search.rank(state) {
        let c = &local[r.candidate];
        let known = others.contains(&r.candidate) || search.same_place(r.candidate, first);
        if r.evidence < own - RIVAL_NATS || rivals.len() == MOST_RIVALS {
            break;
        }
        // what says much beside the finding, too, says something else
        let beside = search.evidence(&with, r.candidate).map_or(0.0, |b| b.evidence);
        if !known
            && beside < RIVAL_LEFT_SHARE * r.evidence
            && let Some(effect) = c.cause.effect()
            && !rivals.iter().any(|v| v.effect == effect && v.site == c.site)
        {
            best.push(c.clone());
            rivals.push(Rival { effect, site: c.site, delta_bic: (2.0 * (own - r.evidence)).max(0.0) });
        }
    }
    let next_measurements = (!rivals.is_empty()).then(|| {
        format!(
            "touches that tell {} from {}: trical diagnose --next 8 plans them",
            effect,
            rivals.iter().map(|r| r.effect.name()).collect::<Vec<_>>().join(", ")
        )
    });
    let variance = with.ss / search.freedom(&with);
    let described = effect.effect();
    let scope = if local[first].is_course() { Scope::Course } else { described.scope };
    let warms = local[first].terms.iter().any(|t| matches!(t.basis.of, Variable::Temperature { .. }));
    let finding = Finding {
        effect,
        site: local[first].site,
        located: located(group, local),
        family: described.family,
        scope,
        session: None,
        between_two: false,
        confidence: 0.0,
        place_confidence: 0.0,
        family_confidence: 0.0,
        share: 0.0,
        replicated: Replicated::default(),
        summary: String::new(),
        action: if warms { WITH_TEMPERATURE } else { described.action },
        corrected: scope == Scope::Arm || warms,
        lambda: (dss * search.temper / variance).max(0.0).sqrt(),
        coefficients: group.members.iter().flat_map(|m| coefficients(model, &local[*m])).collect(),
        evidence: Evidence {
            delta_bic,
            p_value: f_test_of_effect(state.ss, dss, rank, search.freedom(state), search.temper),
            holdout_rms_before_mm: before.blocks,
            holdout_rms_after_mm: after.blocks,
            forward_rms_before_mm: before.forward,
            forward_rms_after_mm: after.forward,
        },
        rivals,
        next_measurements,
    };
    (finding, best)
}

/// What to do about what goes with a temperature that was recorded.
const WITH_TEMPERATURE: &str =
    "Give the temperature when a program is compensated, or let the arm warm up before it is used.";

/// What the members of a group do, in words. Waves of a joint are told together: ripples with the number of their gear, an encoder's behind its
/// curve.
fn located(group: &Group, local: &[Candidate]) -> String {
    let (curves, others): (Vec<&Candidate>, Vec<&Candidate>) =
        group.members.iter().map(|m| &local[*m]).partition(|c| c.is_long_curve());
    let is_line = |c: &&&Candidate| {
        [EffectId::GearRipple, EffectId::EncoderError].iter().any(|id| c.cause == (*id).into()) && c.cycles().is_some()
    };
    let (lines, others): (Vec<&Candidate>, Vec<&Candidate>) = others.iter().partition(is_line);
    let numbers =
        listed(&lines.iter().filter_map(|c| c.cycles()).map(|n| format!("{n:.0}")).collect::<Vec<_>>(), "and");
    let told = match (lines.first(), curves.first()) {
        (Some(_), Some(curve)) => {
            let waves = if lines.len() == 1 { "a single wave" } else { "single waves" };
            vec![format!("{}, and {waves} of {numbers} cycles per turn", curve.located())]
        }
        (Some(one), None) if lines.len() == 1 => vec![one.located()],
        (Some(first), None) => vec![format!("{numbers} cycles per turn of {}", first.site)],
        (None, _) => curves.iter().map(|c| c.located()).collect(),
    };
    told.into_iter().chain(others.iter().map(|c| c.located())).collect::<Vec<_>>().join("; ")
}

pub(crate) fn unexplained_from(
    search: &Search<'_>,
    state: &RegressionState,
    group: &Group,
    model: &Model,
    [before, after]: [Proof; 2],
    data: &Dataset,
) -> Unexplained {
    let first = &search.candidates[group.members[0]];
    let with = search.with(state, &group.members);
    let rms_mm = {
        // removed sum of squares, as a position error of the observations
        let share = ((state.ss - with.ss) / state.ss).clamp(0.0, 1.0);
        let errors = Forward::new(model.clone(), Vec::new()).map(|f| position_errors(&f, data)).unwrap_or_default();
        let n = errors.len().max(1) as f64;
        let square = errors.iter().map(|e| e * e).sum::<f64>() / n;
        (square * share / (1.0 - share).max(1e-6)).sqrt() * 1e3
    };
    let located = locators::describe(first, group.members.iter().map(|m| &search.candidates[*m]), model, data);
    Unexplained {
        site: first.site,
        variable: located.variable,
        region: located.region,
        rms_mm,
        holdout_rms_before_mm: before.blocks,
        holdout_rms_after_mm: after.blocks,
        curve: located.curve,
        curve_units: located.units,
        modelled: true,
    }
}

/// A mismatch that a probe tells at a state: where and on what it depends; held-out errors without and with it.
fn unexplained_by_probe(
    test: &SpecificationTest<'_>,
    state: &RegressionState,
    m: LackOfFit,
    [before, after]: [f64; 2],
) -> Unexplained {
    let curve = test.line(state, &m);
    let units = if curve.is_empty() { "" } else { "deg" };
    Unexplained {
        region: m.region,
        rms_mm: before * (m.dss / state.ss).clamp(0.0, 1.0).sqrt(),
        holdout_rms_before_mm: before,
        holdout_rms_after_mm: after,
        site: m.site,
        variable: m.variable,
        curve,
        curve_units: (units.to_owned(), units.to_owned()),
        modelled: false,
    }
}

/// Curves without a name are what the model can hold; a probe may tell better on what the mismatch depends (a joint that depends on
/// its last moves looks like a curve of time). Beside a place's curves, what its probe tells instead; and what a probe tells of
/// places whose names are `doubted`. `without` and `held_out_rms_mm` leave out what was chosen at a place: its curves, or what has such a name.
pub(crate) fn add_probe_results(
    test: &SpecificationTest<'_>,
    full: &RegressionState,
    unexplained: &mut Vec<Unexplained>,
    doubted: &[Place],
    without: &dyn Fn(Place, bool) -> RegressionState,
    held_out_rms_mm: &dyn Fn(Place, bool, Option<usize>) -> f64,
) {
    let mut sites: Vec<Place> = Vec::new();
    for site in unexplained.iter().map(|u| u.site).chain(doubted.iter().copied()) {
        if !sites.contains(&site) {
            sites.push(site);
        }
    }
    for site in sites {
        let here = |u: &Unexplained| u.site == site;
        let curves = unexplained.iter().any(here);
        let state = without(site, curves);
        let own = bic_nats(test.freedom(&state), state.ss, full.ss, full.parameters - state.parameters);
        let Some((m, said)) = test.best_probe(&state, site) else { continue };
        let known = unexplained.iter().any(|u| here(u) && u.variable == m.variable && u.region == m.region);
        let better = if curves { said > own + PROBE_BETTER_NATS } else { m.dss > 0.5 * (state.ss - full.ss) };
        if better && !known {
            let errors = [None, Some(m.probe)].map(|probe| held_out_rms_mm(site, curves, probe));
            unexplained.push(unexplained_by_probe(test, &state, m, errors));
        }
    }
}

/// What probes say is left at places where no curve was good enough to be modelled, beside what is `explained` there.
pub(crate) fn remaining_lack_of_fit(
    test: &SpecificationTest<'_>,
    state: &RegressionState,
    explained: &dyn Fn(Place) -> f64,
    held_out_rms_mm: &dyn Fn(Option<usize>) -> f64,
) -> Vec<Unexplained> {
    let considerable = |m: &LackOfFit| m.p_value < REMAINDER_P && m.dss > CONSIDERABLE_SHARE * explained(m.site);
    let mut places: Vec<LackOfFit> = test.places(state).into_iter().filter(considerable).collect();
    places.sort_by(|a, b| b.dss.total_cmp(&a.dss));
    if places.is_empty() {
        return Vec::new();
    }
    let before = held_out_rms_mm(None);
    places
        .into_iter()
        .map(|m| {
            let after = held_out_rms_mm(Some(m.probe));
            unexplained_by_probe(test, state, m, [before, after])
        })
        .collect()
}

/// Effects and sites whose typical size would leave no trace.
pub(crate) fn blind(search: &Search<'_>, state: &RegressionState, set: &[usize]) -> Vec<Blind> {
    let variance = (state.ss / search.freedom(state)).max(1e-300);
    let mut seen: Vec<(usize, f64)> = Vec::new();
    for (k, c) in search.candidates.iter().enumerate() {
        if c.cause == Cause::Unexplained || set.iter().any(|s| search.same_place(*s, k)) {
            continue;
        }
        let lambda = search.design.lambda_of_size(state, k, c.typical) * search.temper.sqrt() / variance.sqrt();
        match seen.iter_mut().find(|(s, _)| search.same_place(*s, k)) {
            Some(entry) => entry.1 = entry.1.max(lambda),
            None => seen.push((k, lambda)),
        }
    }
    seen.into_iter()
        .filter(|(_, lambda)| *lambda < VISIBLE_LAMBDA)
        .filter_map(|(k, lambda)| {
            let Candidate { cause, site, .. } = &search.candidates[k];
            Some(Blind { effect: cause.effect()?, site: *site, lambda, lacks: None })
        })
        .collect()
}

/// Smallest p-value among all candidates, times how many independent questions were asked (Bonferroni).
pub(crate) fn lack_of_fit(search: &Search<'_>, state: &RegressionState, set: &[usize]) -> f64 {
    let ranked = search.rank(state);
    let questions = ranked.len() as f64;
    ranked
        .iter()
        .filter(|r| !(state.ss < search.design.start().ss && set.contains(&r.candidate)))
        .take(100)
        .map(|r| f_test_of_effect(state.ss, r.dss, r.rank, search.freedom(state), search.temper) * questions)
        .fold(1.0, f64::min)
}

/// Noise of a position error: root mean square of the residuals, with the parameters paid for.
pub(crate) fn noise_of(fitted: &Identified, errors: &[f64]) -> f64 {
    let rows = fitted.observability.rows as f64;
    let p = fitted.free.len() as f64;
    ErrorSummary::of(errors).rms_mm * (rows / (rows - p).max(1.0)).sqrt()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use trical_ident::{Choice, ParameterSet, identify};
    use trical_model::{Basis, Shape, Variable};

    use super::*;
    use crate::correlated_noise::CorrelatedNoise;
    use crate::linear::{Design, Fitted};
    use crate::specification_test::probes;
    use crate::test_data::{off as of, with_joint_2, with_joints};

    fn ripple(joint: usize, cycles: f64) -> Candidate {
        of(EffectId::GearRipple.into(), joint, Shape::Sine { cycles })
    }

    #[test]
    fn what_one_effect_does_at_one_place_is_one_group_and_ripples_are_told_by_their_numbers_in_order() {
        let all = [ripple(2, 102.0), ripple(3, 100.0), ripple(2, 100.0), of(Cause::Unexplained, 2, Shape::Linear)];
        let groups = grouped(&all, &[3, 0, 1, 2]);
        let members: Vec<&[usize]> = groups.iter().map(|g| &g.members[..]).collect();
        assert_eq!(members, [&[3][..], &[2, 0], &[1]]);
        assert_eq!(located(&groups[1], &all), "100 and 102 cycles per turn of joint 2");
        assert_eq!(located(&groups[2], &all), "joint 3 is off", "one wave is told as itself");
    }

    #[test]
    fn jumps_are_told_in_the_order_in_which_they_happened() {
        let jump = |at: f64| {
            let mut c = of(EffectId::JointZeroShift.into(), 2, Shape::Step { at });
            c.terms[0].basis.of = Variable::Seq;
            Candidate { behaviour: "joint 2 jumps".into(), ..c }
        };
        let all = [808.0, 135.0, 323.0].map(jump);
        let told = located(&grouped(&all, &[0, 1, 2])[0], &all);
        assert_eq!(told, "joint 2 jumps at pose 135; joint 2 jumps at pose 323; joint 2 jumps at pose 808");
    }

    #[test]
    fn a_coefficient_has_the_unit_of_its_site_and_a_gap_is_positive() {
        let mut term = ripple(2, 100.0).terms.remove(0);
        (term.value, term.sd) = (1e-3, Some(1e-4));
        let robot = crate::test_data::arm().robot;
        let told = coefficient(&robot, &term);
        assert_eq!((told.unit.as_str(), told.sd), ("deg", Some(1e-4_f64.to_degrees())));
        assert!((told.value - 1e-3_f64.to_degrees()).abs() < 1e-12);
        term.basis = Basis::direction(2);
        assert!((coefficient(&robot, &term).value + 1e-3_f64.to_degrees()).abs() < 1e-12);
    }

    /// Of an arm whose joint 2 is off by a large and a small wave of its angle: what `ask` says of waves of joints 2 and 3.
    fn asked<T>(ask: impl Fn(&Search<'_>, &RegressionState, &Identified) -> T) -> T {
        let wave = |cycles| Basis::new(Variable::Joint { joint: 2 }, Shape::Sine { cycles });
        let (truth, data) = with_joint_2(&[(wave(9.0), 1e-4), (wave(14.0), 5e-4)]);
        let fitted = identify(&truth.robot, &truth.cell, &data, Choice::from(ParameterSet::Compliance)).unwrap();
        let mut all = vec![ripple(2, 9.0), ripple(2, 14.0), ripple(3, 23.0), ripple(6, 40.0)];
        // far too small to be seen
        all[3].typical = 1e-9;
        let design = Design::new(&fitted.model, &all, &data, &fitted.noise).unwrap();
        ask(&Search::new(&design, &all, 1.0), &design.start(), &fitted)
    }

    #[test]
    fn groups_are_told_in_the_order_of_what_each_removes_beside_those_before() {
        let order = asked(|search, start, _| {
            let groups = [0, 2, 1].map(|c| Group { members: vec![c] }).into();
            ordered(search, start, groups).into_iter().map(|g| g.members[0]).collect::<Vec<_>>()
        });
        assert_eq!(order, [1, 0, 2]);
    }

    #[test]
    fn a_finding_is_as_large_as_its_trace_in_the_data_and_names_what_comes_near() {
        let proof = |blocks| Proof { blocks, forward: 2.0 * blocks };
        let (f, rivals) = asked(|search, start, fitted| {
            let others = [1];
            let state = search.with(start, &others);
            let group = Group { members: vec![0] };
            finding(EffectId::GearRipple, search, &state, &group, &others, &fitted.model, [proof(0.3), proof(0.2)])
        });
        // 600 scalars, each moved by 1e-4 rad times some 0.4 m, noise of 1e-5 m: three of them a touch, in one direction
        assert!((20.0..80.0).contains(&f.lambda), "{}", f.lambda);
        assert!(f.evidence.delta_bic > 100.0 && f.evidence.p_value < 1e-20, "{:?}", f.evidence);
        assert_eq!([f.evidence.holdout_rms_before_mm, f.evidence.forward_rms_after_mm], [0.3, 0.4]);
        assert!(f.rivals.is_empty() && rivals.is_empty() && f.next_measurements.is_none(), "{:?}", f.rivals);
        assert!(f.corrected, "what belongs to the arm");
        assert_eq!((f.scope, f.family, f.site), (Scope::Arm, crate::effects::Family::Transmission, Place::Joint(2)));
    }

    #[test]
    fn a_rival_says_the_same_and_what_is_wrong_elsewhere_is_none() {
        let wave = |cycles| Basis::new(Variable::Joint { joint: 2 }, Shape::Sine { cycles });
        let other = Basis::new(Variable::Joint { joint: 3 }, Shape::Sine { cycles: 14.0 });
        let (truth, data) = with_joints(&[(2, wave(9.0), 1e-4), (3, other, 1e-4)]);
        let fitted = identify(&truth.robot, &truth.cell, &data, Choice::from(ParameterSet::Compliance)).unwrap();
        let alias = of(EffectId::EncoderError.into(), 2, Shape::Sine { cycles: 9.0 });
        let all = [ripple(2, 9.0), ripple(3, 14.0), alias];
        let design = Design::new(&fitted.model, &all, &data, &fitted.noise).unwrap();
        let search = Search::new(&design, &all, 1.0);
        let start = design.start();
        let [own, elsewhere] = [0, 1].map(|c| search.evidence(&start, c).unwrap().evidence);
        assert!(elsewhere > own - RIVAL_NATS, "{own} {elsewhere}");
        let group = Group { members: vec![0] };
        let proofs = [Proof { blocks: 0.3, forward: 0.3 }; 2];
        let (f, _) = finding(EffectId::GearRipple, &search, &start, &group, &[], &fitted.model, proofs);
        let told: Vec<_> = f.rivals.iter().map(|r| (r.effect, r.site)).collect();
        assert_eq!(told, [(EffectId::EncoderError, Place::Joint(2))]);
    }

    #[test]
    fn what_has_no_name_is_as_large_as_what_the_model_without_it_leaves_at_poses() {
        let (told, left) = asked(|search, start, fitted| {
            let state = search.with(start, &[0]);
            let data = with_joint_2(&[]).1;
            let proof = |blocks| Proof { blocks, forward: blocks };
            let group = Group { members: vec![1] };
            // what is left at other data, of another arm: its size in mm is theirs
            let told = unexplained_from(search, &state, &group, &fitted.model, [proof(0.3), proof(0.2)], &data);
            let errors = position_errors(&Forward::new(fitted.model.clone(), Vec::new()).unwrap(), &data);
            let share = 1.0 - search.with(&state, &[1]).ss / state.ss;
            let square: f64 = errors.iter().map(|e| e * e * 1e6).sum();
            (told, (square / 200.0 * share / (1.0 - share)).sqrt())
        });
        assert!((told.rms_mm / left - 1.0).abs() < 1e-9 && left > 0.1, "{} {left}", told.rms_mm);
        assert_eq!((told.variable.as_str(), told.site), ("q2", Place::Joint(2)));
        assert_eq!([told.holdout_rms_before_mm, told.holdout_rms_after_mm], [0.3, 0.2]);
    }

    #[test]
    fn what_leaves_no_trace_at_its_typical_size_is_declared_and_what_was_found_is_not() {
        let blind_at = asked(|search, start, _| {
            blind(search, start, &[0, 1]).into_iter().map(|b| (b.effect, b.site, b.lambda < 0.01)).collect::<Vec<_>>()
        });
        assert_eq!(blind_at, [(EffectId::GearRipple, Place::Joint(6), true)]);
    }

    #[test]
    fn a_fit_lacks_what_a_candidate_removes_and_nothing_when_it_is_there() {
        let [bare, with] = asked(|search, start, _| {
            let all = [0, 1];
            [lack_of_fit(search, start, &[]), lack_of_fit(search, &search.with(start, &all), &all)]
        });
        assert!(bare < 1e-50 && with > 1e-3, "{bare} {with}");
    }

    /// What probes say of joints that are off by waves of their own angles.
    fn probed<T>(sizes: [f64; 2], ask: impl Fn(&SpecificationTest<'_>, &Search<'_>, &RegressionState) -> T) -> T {
        let wave = |joint| Basis::new(Variable::Joint { joint }, Shape::Sine { cycles: 2.0 });
        let (truth, data) = with_joints(&[(2, wave(2), sizes[0]), (4, wave(4), sizes[1])]);
        let fitted = identify(&truth.robot, &truth.cell, &data, Choice::from(ParameterSet::Compliance)).unwrap();
        let probes = probes(&fitted.model, &data);
        let (candidates, white) = (&probes.candidates, CorrelatedNoise::WHITE);
        let all = Fitted::all(&fitted.model);
        let design = Design::weighted(all, candidates, &probes.weights, &data, &fitted.noise, white).unwrap();
        let test = SpecificationTest { design: &design, probes: &probes, first: 0, temper: 1.0 };
        ask(&test, &Search::new(&design, candidates, 1.0), &design.start())
    }

    #[test]
    fn what_is_left_is_told_the_largest_first_and_not_where_much_more_was_explained() {
        let told = |sizes, at_2: f64| {
            probed(sizes, |test, _, start| {
                let explained = |place| if place == Place::Joint(2) { at_2 * start.ss } else { 0.0 };
                let held_out = |probe: Option<usize>| if probe.is_some() { 0.2 } else { 0.3 };
                remaining_lack_of_fit(test, start, &explained, &held_out)
            })
        };
        let own = |all: &[Unexplained], joint| all.iter().find(|u| u.site == Place::Joint(joint)).unwrap().rms_mm;
        let small = told([1e-3, 1e-4], 0.0);
        assert_eq!((small[0].site, small[0].variable.as_str()), (Place::Joint(2), "q2"));
        assert_eq!([small[0].holdout_rms_before_mm, small[0].holdout_rms_after_mm], [0.3, 0.2]);
        assert!(small.windows(2).all(|w| w[0].rms_mm >= w[1].rms_mm));
        // twice as large at the joint: twice as large at the tool, but for what noise adds to the smaller
        let growth = own(&told([1e-3, 2e-4], 0.0), 4) / own(&small, 4);
        assert!((1.6..2.2).contains(&growth), "{growth}");
        assert!(told([1e-3, 1e-4], 100.0).iter().all(|u| u.site != Place::Joint(2)));
    }

    #[test]
    fn a_probe_is_told_at_a_doubted_place_where_it_says_most_of_what_was_explained_and_beside_a_curve_where_it_says_more()
     {
        let joints = [2, 4].map(Place::Joint);
        let told = |explained: &[Place], doubted: &[Place], known: Option<Place>| {
            probed([1e-3, 2e-4], |test, search, start| {
                let best = |place| test.best_probe(start, place).unwrap().0;
                let full = search.with(start, &explained.iter().map(|p| best(*p).probe).collect::<Vec<_>>());
                let curve = |place| {
                    let test_of = best(place);
                    Unexplained { variable: "seq".into(), ..unexplained_by_probe(test, start, test_of, [0.3, 0.2]) }
                };
                let mut all: Vec<Unexplained> = known.into_iter().map(curve).collect();
                let held_out = |_, _, probe: Option<usize>| if probe.is_some() { 0.2 } else { 0.3 };
                add_probe_results(test, &full, &mut all, doubted, &|_, _| start.clone(), &held_out);
                all.into_iter().map(|u| (u.site, u.variable)).collect::<Vec<_>>()
            })
        };
        let [q2, q4] = [(joints[0], "q2".to_owned()), (joints[1], "q4".to_owned())];
        // joint 4 explains little of what both do
        assert_eq!(told(&joints, &joints, None), std::slice::from_ref(&q2));
        assert_eq!(told(&joints[1..], &joints[1..], None), [q4]);
        let curve = (joints[0], "seq".to_owned());
        assert_eq!(told(&[], &[], Some(joints[0])), [curve.clone(), q2]);
        assert_eq!(told(&joints, &[], Some(joints[0])), [curve]);
    }

    #[test]
    fn the_noise_of_a_position_pays_for_the_parameters() {
        let (rms, told, rows, p) = asked(|_, _, fitted| {
            let errors = fitted.errors().unwrap();
            let rms = ErrorSummary::of(&errors).rms_mm;
            (rms, noise_of(fitted, &errors), fitted.observability.rows, fitted.free.len())
        });
        assert_eq!(rows, 600);
        let paid = (600.0 / (600.0 - f64::from(u8::try_from(p).unwrap()))).sqrt();
        assert!((told - rms * paid).abs() < 1e-12 && paid > 1.02, "{told} {rms} {paid}");
    }
}
