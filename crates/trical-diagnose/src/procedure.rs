//! The procedure: rejection, baseline, rounds of selection and exact refit, proof, findings.

use std::collections::BTreeSet;

use trical_ident::HeldOut;
use trical_ident::dataset::Dataset;
use trical_ident::dataset::readings::Scatter;
use trical_ident::date::newest;
use trical_ident::error::{IdentError, Result};
use trical_ident::fit::cautions::{EVEN_MASSES, cautions, listed, shared_errors, too_many, without_masses};
use trical_ident::fit::folds::Folds;
use trical_ident::fit::identifiability::Choice;
use trical_ident::fit::identify::ErrorSummary;
use trical_ident::fit::residuals::position_errors;
use trical_ident::model_file::Uncertainty;
use trical_model::{Cell, Forward, Model, Place, Robot, Task, Term};

use crate::candidate::Candidate;
use crate::catalogue::Untestable;
use crate::diagnosis::{Baseline, Blind, Diagnosis, Final, Finding, Grounds, Rival, Unexplained};
use crate::effect_id::{Cause, EffectId};
use crate::findings::{
    Group, Proof, add_probe_results, blind, finding, grouped, lack_of_fit, noise_of, ordered, remaining_lack_of_fit,
    unexplained_from,
};
use crate::halves::Halves;
use crate::linear::{Design, Downdate, RegressionState};
use crate::locators::sorted;
use crate::options::Options;
use crate::parts::Parts;
use crate::phases;
use crate::probability::{Alternative, Says, Shares, probabilities, shares};
use crate::rounds::{BASELINE, Rounds, is_parameter_of_arm};
use crate::selection::Search;
use crate::settings::{
    ALTERNATIVES, ANGLES_FOR_CURVES, BEYOND_READINGS, DOUBTED_BELOW, ROUGHLY_SETTLED, SAME_ANGLE, SETTLED_SHARE,
    UNNAMED_PRICE_NATS,
};
use crate::specification_test::{Probes, SpecificationTest, doubt_by_rest};
use crate::statistics::odds_outside_catalogue;
use crate::verdict;

/// Diagnoses recordings of one arm, one session each.
///
/// # Errors
/// As [`trical_ident::fit::identify::identify`].
pub fn diagnose(robot: &Robot, cell: &Cell, data: &Dataset, options: &Options, task: &Task<'_>) -> Result<Diagnosis> {
    task.step(0.0, "checking rows")?;
    let mut rounds = Rounds::begin(robot, cell, data, options)?;
    let baseline = rounds.fitted.model.clone();
    select(&mut rounds, options.names_only, task)?;

    task.step(0.75, "proving")?;
    let unsearched = rounds.fit_whole(&baseline)?;
    rounds.shrink_curves()?;
    let effective = rounds.effective_parameters();
    rounds.fitted = rounds.fitted.with_shared_errors()?;
    let Rounds { kept, fitted, chosen, .. } = &rounds;
    let (design, probes) = rounds.design_with_probes(&rounds.fast_waves()?)?;
    let start = design.start();
    let proving = Proving::new(&rounds, &design, &probes, &start)?;
    // of all poses, where a sample was searched
    let all = Folds::of(&fitted.data);
    let of_sessions = rounds.by_session();
    let [plain_by_session, by_session] = *of_sessions.as_ref().unwrap_or(&[None; 2]);
    let of_places = rounds.by_place();
    let [plain_by_place, by_place] = *of_places.as_ref().unwrap_or(&[None; 2]);
    let held_out = proving.held_out(by_session, by_place);
    let usual = held_out.by_block.unwrap_or(ErrorSummary::of(&fitted.errors()?));
    let none = proving.prove(&[]);
    let Found { findings, grounds, mut unexplained, doubted } = proving.findings(none, task)?;
    proving.ask_probes(&mut unexplained, &doubted);

    task.step(0.95, "what the data cannot show")?;
    let errors = fitted.errors()?;
    let before_errors = position_errors(&Forward::new(baseline.clone(), Vec::new())?, &fitted.data);
    let lack_of_fit_p = |state: &RegressionState| lack_of_fit(&proving.search, state, chosen);
    let failed = |what: &str, e: &IdentError| {
        format!("the error at a {what} that the fit did not see could not be computed: {e}")
    };
    let cautions =
        cautions_of(&rounds, robot, &baseline, effective, &all, unsearched.as_ref().map(ToString::to_string))?
            .into_iter()
            .chain(another_zero(&grounds, &kept.names))
            .chain(no_better_elsewhere("in a session", plain_by_session, by_session))
            .chain(no_better_elsewhere("at a place of the balls", plain_by_place, by_place))
            .chain(of_sessions.err().map(|e| failed("session", &e)))
            .chain(of_places.err().map(|e| failed("place", &e)))
            .collect();
    let diagnosis = Diagnosis {
        verdict: verdict::of(
            &findings,
            &unexplained,
            [(arm_parameters(&baseline), none.blocks), (arm_parameters(&fitted.model), usual.rms_mm)],
            verdict::Given { robot, several: kept.names.len() > 1 },
        ),
        baseline: Baseline {
            parameters: arm_parameters(&baseline),
            rms_mm: ErrorSummary::of(&before_errors).rms_mm,
            noise_mm: noise_of(fitted, &errors),
            lack_of_fit_p: lack_of_fit_p(&start),
            holdout_rms_mm: none.blocks,
            by_session: plain_by_session,
            by_place: plain_by_place,
            reading_noise: rounds.reading_noise().map(Candidate::located).collect(),
        },
        blind_to: proving.blind_to(&findings),
        findings,
        after: Final {
            parameters: arm_parameters(&fitted.model),
            effective_parameters: effective,
            poses: all.poses().len(),
            blocks: all.blocks(),
            rms_mm: ErrorSummary::of(&errors).rms_mm,
            holdout_rms_mm: usual.rms_mm,
            holdout_mean_mm: usual.mean_mm,
            forward_mean_mm: held_out.forward.map_or(0.0, |e| e.mean_mm),
            held_out,
            lack_of_fit_p: lack_of_fit_p(proving.downdate.full()),
        },
        unexplained: (!unexplained.is_empty()).then(|| unexplained.remove(0)),
        more_unexplained: unexplained,
        cautions,
        rejected: fitted.data.rejected.clone(),
        model: fitted.model.clone(),
        uncertainty: Uncertainty::of(fitted).map(|u| {
            let plain = u.noise * ErrorSummary::of(&before_errors).rms_mm / ErrorSummary::of(&errors).rms_mm;
            u.of_effects(plain)
        }),
        data: fitted.data.clone(),
        before: baseline,
        grounds: Grounds {
            noise: fitted.noise.clone(),
            known: rounds.known.clone(),
            findings: grounds,
            sigma: rounds.touch_sigma(),
        },
    };
    task.step(1.0, "done")?;
    Ok(diagnosis)
}

/// What of the fit and its data should make one look twice; `unsearched` is what was not searched, in words.
fn cautions_of(
    rounds: &Rounds,
    robot: &Robot,
    baseline: &Model,
    effective: f64,
    folds: &Folds,
    unsearched: Option<String>,
) -> Result<Vec<String>> {
    let Rounds { kept, fitted, .. } = rounds;
    let elasticity = Choice::from(BASELINE).elasticity(robot, kept)?;
    let even = baseline.robot != *robot;
    let masses = if even { Some(EVEN_MASSES.into()) } else { without_masses(elasticity, baseline) };
    Ok(cautions(&fitted.model, fitted.observability.rows, fitted.free.len())
        .into_iter()
        .chain(masses)
        .chain(rounds.read_otherwise.clone())
        .chain(rounds.hardly_determined.iter().cloned())
        .chain(unsearched)
        .chain(too_many(effective, arm_parameters(&fitted.model), folds))
        .chain(shared_errors(fitted.design_effect))
        .chain(rounds.correlation.caution())
        .chain(rounds.readings.map(|r| read_several_times(r, rounds.touch_sigma())))
        .collect())
}

/// What to say where a joint has another zero in some sessions than in the others: which of them the model has, by the dates in their names.
fn another_zero(grounds: &[(Vec<Candidate>, Vec<Candidate>)], names: &[String]) -> Option<String> {
    let of_session = |(members, _): &(Vec<Candidate>, Vec<Candidate>)| {
        members
            .iter()
            .find(|c| c.is_of_whole_session())
            .and_then(|c| Some((c.site.joint()?, c.terms[0].basis.session? as usize - 1)))
    };
    let (joint, first) = grounds.iter().find_map(of_session)?;
    let all = grounds.iter().filter_map(of_session).filter(|(of, _)| *of == joint).map(|(_, session)| session);
    let all: BTreeSet<usize> = all.collect();
    match newest(names.iter().map(String::as_str)) {
        Some(newest) if all.contains(&newest) => {
            return Some(format!(
                "joint {joint} has another zero in {}, the newest session, than before: the model has the arm as it is now, and programs are \
                 corrected for that",
                names[newest]
            ));
        }
        Some(_) => return None,
        None => {}
    }
    let dates =
        "by dates in the names of the recordings (as in cell-2026-11-22.csv): the model then has the arm as it is now";
    if let [one, other] = names {
        return Some(format!(
            "joint {joint} has another zero in {one} than in {other}, and two sessions cannot show which of them differs: the model has the middle of \
             both, and may be off by half of that. Say which is the newest {dates}"
        ));
    }
    let odd = listed(&all.iter().map(|k| names[*k].clone()).collect::<Vec<_>>(), "and");
    let others = if names.len() == all.len() + 1 { "other" } else { "others" };
    let now = &names[first];
    Some(format!(
        "joint {joint} has another zero in {odd} than in the {others}; the model has that of the {others}. Where {now} is the newest, say so {dates}"
    ))
}

/// What readings of one pose that were taken one after the other say beside what is left (m, standard deviation of their means).
fn read_several_times(of_pose: Scatter, left: f64) -> String {
    let Scatter { sd, readings, freedom } = of_pose;
    let times = (10.0 * readings).round() / 10.0;
    let counted = format!("poses were read {times} times in a row: the mean of each counts as one measurement");
    let of_means = sd / readings.sqrt();
    // at most as often as not by chance, or too little to matter
    let chance = 1.0 + 4.0 / (freedom as f64).sqrt();
    if left < of_means * chance.max(BEYOND_READINGS) {
        return counted;
    }
    format!(
        "{counted}. Readings of one pose differ by {:.3} mm, and what is left of their means is {:.3} mm (standard deviations): that is not the \
         gauge. It is how the arm repeats, or something that no known effect is",
        sd * 1e3,
        left * 1e3
    )
}

/// What to say where an arm as other sessions, or places, say it is not better with what was found.
fn no_better_elsewhere(at: &str, plain: Option<ErrorSummary>, whole: Option<ErrorSummary>) -> Option<String> {
    let (plain, whole) = (plain?.mean_mm, whole?.mean_mm);
    (whole > plain).then(|| {
        format!(
            "{at} that it was not fitted to, the whole model is off by {whole:.3} mm (mean), the plain one by {plain:.3} mm: \
             use the plain one there, or diagnose a session that visits the same angles with these"
        )
    })
}

/// Selection; then with rows restored that what was found, or one number more, explains; then with more to choose from where names do not say
/// all, until nothing changes; then only what pays at poses that the fit did not see.
fn select(rounds: &mut Rounds, names_only: bool, task: &Task<'_>) -> Result<()> {
    task.step(0.05, "curves of the joints")?;
    rounds.hold_curves()?;
    let mut is_exact = rounds.settle(true, ROUGHLY_SETTLED, &task.part(0.1, 0.35))?;
    if rounds.let_go_of_curves()? {
        is_exact = rounds.settle(true, ROUGHLY_SETTLED, &task.part(0.3, 0.35))?;
    }
    // with the large effects out of the way
    if rounds.hold_curves()? {
        is_exact = rounds.settle(true, ROUGHLY_SETTLED, &task.part(0.35, 0.45))?;
    }
    if rounds.take_back_rows()? | rounds.restore_rows()? {
        is_exact = rounds.settle(false, ROUGHLY_SETTLED, &task.part(0.45, 0.5))?;
    }
    task.step(0.5, "looking again without names")?;
    if (!names_only && rounds.widen()?) || !is_exact {
        rounds.settle(false, SETTLED_SHARE, &task.part(0.55, 0.7))?;
    }
    task.step(0.7, "what pays at unseen poses")?;
    rounds.release_curves()?;
    rounds.keep_what_pays()?;
    rounds.trade_curves()?;
    rounds.name_waves();
    Ok(())
}

/// What was chosen, as findings and as what has no name.
struct Found {
    findings: Vec<Finding>,
    /// Of each finding, its candidates and the best candidate of each rival.
    grounds: Vec<(Vec<Candidate>, Vec<Candidate>)>,
    unexplained: Vec<Unexplained>,
    /// What was chosen under names that are doubted.
    doubted: Vec<usize>,
}

/// What was chosen, with all that its proof asks.
struct Proving<'a> {
    rounds: &'a Rounds,
    design: &'a Design,
    search: Search<'a>,
    test: SpecificationTest<'a>,
    /// The baseline.
    start: &'a RegressionState,
    /// Everything that was chosen, and what it is without some of it.
    downdate: Downdate<'a>,
    /// Poses and blocks of the rows that were kept.
    folds: Folds,
    /// The joint fit in parts by blocks, and the last quarter by what was before; `None` where the data do not allow it.
    blocks: Option<Parts<'a>>,
    later: Option<Parts<'a>>,
    /// What halves of the data say by themselves.
    halves: Halves,
}

impl<'a> Proving<'a> {
    fn new(rounds: &'a Rounds, design: &'a Design, probes: &'a Probes, start: &'a RegressionState) -> Result<Self> {
        let folds = Folds::of(&rounds.kept);
        Ok(Self {
            rounds,
            design,
            search: rounds.searcher(design),
            test: rounds.specification_test(design, probes),
            start,
            downdate: Downdate::new(design, start, &rounds.chosen),
            blocks: Parts::by_block(design, &rounds.chosen, &folds, rounds.temper()),
            later: Parts::forward(design, &rounds.chosen, &folds, rounds.temper()),
            folds,
            halves: rounds.halves()?,
        })
    }

    /// Errors at what the fit did not see, those at sessions and places as given.
    fn held_out(&self, by_session: Option<ErrorSummary>, by_place: Option<ErrorSummary>) -> HeldOut {
        let whole = |parts: &Option<Parts<'_>>| parts.as_ref().map(|p| p.errors(&[], None));
        HeldOut {
            by_pose: whole(&Parts::by_pose(self.design, &self.rounds.chosen, &self.folds, self.rounds.temper())),
            by_block: whole(&self.blocks),
            // the last places of balls are not known before them
            forward: whole(&self.later).filter(|_| by_place.is_none()),
            by_place,
            by_session,
        }
    }

    /// Findings in the order of importance, each with its evidence, its rivals and how probable it is; `none` is the proof of the baseline.
    fn findings(&self, none: Proof, task: &Task<'_>) -> Result<Found> {
        let Self { search, start, downdate, .. } = self;
        let Rounds { kept, fitted, candidates, chosen, .. } = self.rounds;
        let full = downdate.full();
        let groups = search.among(start, chosen, |few, start| ordered(few, start, grouped(candidates, chosen)));
        let mut found =
            Found { findings: Vec::new(), grounds: Vec::new(), unexplained: Vec::new(), doubted: Vec::new() };
        let mut so_far: Vec<usize> = Vec::new();
        let (mut before, mut left) = (none, start.ss);
        let explained = (start.ss - full.ss).max(1e-300);
        let named = groups.iter().filter(|g| candidates[g.members[0]].cause.effect().is_some()).count();
        for (k, group) in groups.iter().enumerate() {
            task.step(0.75 + 0.2 * k as f64 / groups.len() as f64, "proving")?;
            so_far.extend(&group.members);
            let after = self.prove(&so_far);
            let share = search.among(start, &so_far, |few, start| left - few.with(start, &so_far).ss) / explained;
            left -= share * explained;
            let others: Vec<usize> = chosen.iter().filter(|c| !group.members.contains(c)).copied().collect();
            let state = search.without(downdate, start, &group.members).state;
            if let Some(effect) = candidates[group.members[0]].cause.effect() {
                let (mut f, rivals) = finding(effect, search, &state, group, &others, &fitted.model, [before, after]);
                let members: Vec<&Candidate> = group.members.iter().map(|m| &candidates[*m]).collect();
                f.replicated = self.halves.found(&members, &fitted.model.terms);
                let shares = self.shares(group, effect, &others, &state);
                let mut probability = probabilities(&shares, &f.replicated, named);
                if let Some((joint, angles)) = few_angles(&candidates[group.members[0]], kept) {
                    // at few angles each of these says what the others say, in halves too
                    probability.effect = probability.effect.min(probability.family / CURVES_OF_ANGLE.len() as f64);
                    for other in CURVES_OF_ANGLE.into_iter().filter(|id| *id != effect) {
                        if f.rivals.iter().all(|r| (r.effect, r.site) != (other, f.site)) {
                            f.rivals.push(Rival { effect: other, site: f.site, delta_bic: 0.0 });
                        }
                    }
                    f.located += &format!(
                        "; joint {joint} was at {angles} angles only, which cannot tell one curve of its angle from another"
                    );
                }
                let round = |p: f64| (p * 1e4).round() / 1e4;
                f.place_confidence = round(probability.place);
                f.family_confidence = round(probability.family);
                f.confidence = round(probability.effect);
                f.share = round(share.max(0.0));
                let first = &candidates[group.members[0]];
                f.session = first.session().filter(|_| kept.names.len() > 1);
                f.between_two = kept.names.len() == 2 && first.is_of_whole_session();
                f.summary = verdict::summary(&f);
                if f.confidence <= DOUBTED_BELOW {
                    found.doubted.extend(&group.members);
                }
                let members = members.into_iter().cloned().collect();
                found.findings.push(f);
                found.grounds.push((members, rivals));
            } else {
                found.unexplained.push(unexplained_from(search, &state, group, &fitted.model, [before, after], kept));
            }
            before = after;
        }
        let mut both: Vec<_> = found.findings.into_iter().zip(found.grounds).collect();
        both.sort_by(|(a, _), (b, _)| (b.share * b.confidence).total_cmp(&(a.share * a.confidence)));
        (found.findings, found.grounds) = both.into_iter().unzip();
        Ok(found)
    }

    /// Shares of the evidence for what a group says, at its place; `state` has everything else.
    fn shares(&self, group: &Group, effect: EffectId, others: &[usize], state: &RegressionState) -> Shares {
        let Some(parts) = &self.blocks else { return Shares::default() };
        let candidates = &self.rounds.candidates;
        let first = &candidates[group.members[0]];
        let says = |c: &Candidate| {
            if first.is_of_whole_session() && c.is_of_whole_session() && (c.cause, c.site) == (first.cause, first.site)
            {
                return Says::Same; // that the sessions differ
            }
            let family = c.cause.effect().map(|id| id.effect().family);
            match (c.site.is_same_part(first.site), family == Some(effect.effect().family)) {
                (true, true) => Says::Family,
                (true, false) => Says::Place,
                _ => Says::Elsewhere,
            }
        };
        let mut alternatives = vec![Alternative {
            says: Says::Same,
            log_prior: group.members.iter().map(|m| self.rounds.log_prior_beside_others(*m)).sum(),
            scores: parts.scores(&[], None),
        }];
        let instead = |c: Option<usize>| parts.scores(&group.members, c);
        let mut told: Vec<usize> = Vec::new();
        for r in self.search.rank(state) {
            let c = &candidates[r.candidate];
            let known =
                others.contains(&r.candidate) || c.is_alike(first) || told.iter().any(|t| candidates[*t].is_alike(c));
            let nameless_here = c.cause == Cause::Unexplained && c.site.is_same_part(first.site);
            if known || (told.len() >= ALTERNATIVES && !nameless_here) {
                continue;
            }
            told.push(r.candidate);
            let scores = instead(Some(r.candidate));
            // what contains the finding predicts as well, and pays for its further coefficients as far as the data determine them
            let contains = group.members.iter().all(|m| candidates[*m].is_part_of(c));
            let price = if contains { self.design.gain(self.downdate.full(), r.candidate).occam } else { 0.0 };
            alternatives.push(Alternative { says: says(c), log_prior: c.log_prior - price, scores });
            if told.len() >= ALTERNATIVES && nameless_here || told.len() > ALTERNATIVES {
                break;
            }
        }
        if let Some((probe, _)) = first.site.part().and_then(|place| self.test.best_probe(state, place)) {
            let scores = instead(Some(probe.probe));
            alternatives.push(Alternative { says: Says::Place, log_prior: -2.0 * UNNAMED_PRICE_NATS, scores });
        }
        alternatives.push(Alternative { says: Says::Nothing, log_prior: 0.0, scores: instead(None) });
        let mut shares = shares(&alternatives);
        // a rest at this place that the name leaves, be it that the model has a curve without a name for it over the same variable, speaks for
        // something that is not in the catalogue
        let own = state.ss - self.downdate.full().ss;
        let is_here = |place: Place| place.is_same_part(first.site);
        let nameless = rest_over_the_same(candidates, &self.rounds.chosen, &group.members);
        let unnamed = (!nameless.is_empty()).then(|| {
            [&[][..], &group.members]
                .map(|own| self.search.without(&self.downdate, self.start, &[own, &nameless].concat()).state)
        });
        let [full, without] = unnamed.as_ref().map_or([self.downdate.full(), state], |[full, without]| [full, without]);
        // such a curve that would do much of what the name does doubts it as well
        let [left, alone] = [full.ss - self.downdate.full().ss, without.ss - state.ss];
        let doubt = self.test.doubt(full, without, own, &is_here).max(doubt_by_rest(left, alone, own));
        shares.effect *= (1.0 - doubt) * (1.0 - self.doubt_of_phases(group));
        shares.family *= 1.0 - doubt;
        shares
    }

    /// Probability that what is told as a curve of a joint's own angle is no encoder's, by the phases of its waves: that it is in the gear or the
    /// encoder stays as sure as it is.
    fn doubt_of_phases(&self, group: &Group) -> f64 {
        let Rounds { candidates, kept, fitted, .. } = self.rounds;
        let first = &candidates[group.members[0]];
        let Some(joint) = first.site.joint().filter(|_| first.is_long_curve()) else { return 0.0 };
        let own = || group.members.iter().flat_map(|m| &candidates[*m].terms);
        let waves: Vec<&Term> = fitted.model.terms.iter().filter(|m| own().any(|t| t.does_as(m))).collect();
        let angles: Vec<f64> = kept.observations.iter().map(|o| o.state.q[joint - 1]).collect();
        let p = phases::p_value(&waves, &sorted(&angles));
        let odds = odds_outside_catalogue(p) - odds_outside_catalogue(1.0);
        odds / (1.0 + odds)
    }

    /// What was chosen at a place, and `goes`.
    fn chosen_at(&self, place: Place, goes: &dyn Fn(usize) -> bool) -> Vec<usize> {
        let Rounds { candidates, chosen, .. } = self.rounds;
        chosen.iter().copied().filter(|c| place.is_same_part(candidates[*c].site) && goes(*c)).collect()
    }

    /// How well the baseline with some of what was chosen predicts what it was not fitted to.
    fn prove(&self, set: &[usize]) -> Proof {
        let rest: Vec<usize> = self.rounds.chosen.iter().copied().filter(|c| !set.contains(c)).collect();
        let rms = |parts: &Option<Parts<'_>>| parts.as_ref().map_or(0.0, |p| p.errors(&rest, None).rms_mm);
        Proof { blocks: rms(&self.blocks), forward: rms(&self.later) }
    }

    /// Held-out error without some of what was chosen, with a probe where one is given, mm rms.
    fn rms_mm(&self, out: &[usize], probe: Option<usize>) -> f64 {
        self.blocks.as_ref().map_or(0.0, |p| p.errors(out, probe).rms_mm)
    }

    /// Adds what probes find beside curves without a name, at doubted places, and where nothing was modelled; the largest first.
    fn ask_probes(&self, unexplained: &mut Vec<Unexplained>, doubted: &[usize]) {
        let full = self.downdate.full();
        let candidates = &self.rounds.candidates;
        let places: Vec<Place> = doubted.iter().filter_map(|c| candidates[*c].site.part()).collect();
        let out = |place, curves: bool| {
            self.chosen_at(place, &|c| {
                if curves { candidates[c].cause == Cause::Unexplained } else { doubted.contains(&c) }
            })
        };
        let without = |out: &[usize]| self.search.without(&self.downdate, self.start, out).state;
        add_probe_results(
            &self.test,
            full,
            unexplained,
            &places,
            &|place, curves| without(&out(place, curves)),
            &|place, curves, probe| self.rms_mm(&out(place, curves), probe),
        );
        let explained = |place| without(&self.chosen_at(place, &|_| true)).ss - full.ss;
        let rms_mm = |probe| self.rms_mm(&[], probe);
        let left = remaining_lack_of_fit(&self.test, full, &explained, &rms_mm);
        let known = |m: &Unexplained| unexplained.iter().any(|u| u.site == m.site && u.variable == m.variable);
        let left: Vec<Unexplained> = left.into_iter().filter(|m| !known(m)).collect();
        unexplained.extend(left);
        unexplained.sort_by(|a, b| b.rms_mm.total_cmp(&a.rms_mm));
    }

    /// Effects that this data could not show, or could not be asked about.
    fn blind_to(&self, findings: &[Finding]) -> Vec<Blind> {
        let found = |u: &&Untestable| findings.iter().any(|f| f.effect == u.effect);
        let untestable = self.rounds.untestable.iter().filter(|u| !found(u)).map(|u| Blind {
            effect: u.effect,
            site: Place::All,
            lambda: 0.0,
            lacks: Some(u.lacks.to_owned()),
        });
        let mut all = blind(&self.search, self.downdate.full(), &self.rounds.chosen);
        all.extend(untestable);
        all
    }
}

/// Effects that are curves of a joint's own angle.
const CURVES_OF_ANGLE: [EffectId; 3] = [EffectId::GearRipple, EffectId::JointHarmonic, EffectId::EncoderError];

/// The joint of which something is a curve of its own angle, and how many different angles it was at, where they are too few to tell which.
fn few_angles(c: &Candidate, data: &Dataset) -> Option<(usize, usize)> {
    let joint = c.site.joint().filter(|_| c.cause.effect().is_some_and(|id| CURVES_OF_ANGLE.contains(&id)))?;
    let angles = sorted(&data.observations.iter().map(|o| o.state.q[joint - 1]).collect::<Vec<f64>>());
    let different = 1 + angles.windows(2).filter(|w| w[1] - w[0] > SAME_ANGLE).count();
    (different < ANGLES_FOR_CURVES).then_some((joint, different))
}

/// What was chosen without a name at the place of a finding and over a variable of its own.
fn rest_over_the_same(candidates: &[Candidate], chosen: &[usize], members: &[usize]) -> Vec<usize> {
    let over = |c: &Candidate| c.terms.first().map(|t| (t.basis.of, t.basis.sense));
    let is_rest = |c: &Candidate| {
        let mut of = members.iter().map(|m| &candidates[*m]);
        c.cause == Cause::Unexplained && of.any(|m| m.site.is_same_part(c.site) && over(m) == over(c))
    };
    chosen.iter().copied().filter(|c| is_rest(&candidates[*c])).collect()
}

/// Parameters of the arm, without those of the readings' own noise.
fn arm_parameters(model: &Model) -> usize {
    model.terms.iter().filter(|t| is_parameter_of_arm(t)).count()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use trical_model::{Basis, Shape, Site, State, Variable};

    use super::*;
    use crate::settings::SEARCHED_POSES;
    use crate::test_data::{arm, off, touched, with_joint_2};

    #[test]
    fn poses_and_blocks_are_those_of_the_whole_data_where_a_sample_was_searched() {
        let (truth, many) = (arm(), SEARCHED_POSES + 400);
        let data = touched(&truth, u32::try_from(many).unwrap());
        let options = Options { names_only: true, ..Options::default() };
        let said = diagnose(&truth.robot, &truth.cell, &data, &options, &Task::silent()).unwrap();
        assert!(said.cautions.iter().any(|c| c.starts_with("effects were searched among")), "{:?}", said.cautions);
        assert_eq!((said.after.poses, said.after.blocks), (many, Folds::of(&data).blocks()));
    }

    #[test]
    fn an_encoders_curve_and_scattered_lines_beyond_it_are_one_finding() {
        let wave = |(cycles, size)| (Basis::new(Variable::Joint { joint: 2 }, Shape::Sine { cycles }), size);
        let curve = [3.0, 5.0, 7.0, 11.0].map(|cycles| (cycles, 2e-4));
        let hidden = [&curve[..], &[61.0, 88.0, 131.0].map(|cycles| (cycles, 3e-4))].concat().into_iter().map(wave);
        let (truth, data) = with_joint_2(&hidden.collect::<Vec<_>>());
        let said = diagnose(&truth.robot, &truth.cell, &data, &Options::default(), &Task::silent()).unwrap();
        let found: Vec<(EffectId, &str)> = said
            .findings
            .iter()
            .filter(|f| f.site == Place::Joint(2))
            .map(|f| (f.effect, f.located.as_str()))
            .collect();
        let expected = "a curve of joint 2's own angle that repeats every turn, and single waves of 61, 88 and 131 cycles per turn";
        assert_eq!(found, [(EffectId::EncoderError, expected)]);
    }

    #[test]
    fn curves_of_a_joints_own_angle_need_a_dozen_different_angles() {
        let wave = Shape::Sine { cycles: 3.0 };
        let at = |step_deg: f64, angles: u32| {
            // angles nearer than a fifth of a degree are one
            let angle =
                |k: f64| (step_deg * (k % f64::from(angles)) + 0.05 * (k / f64::from(angles)).floor()).to_radians();
            crate::test_data::states(2 * angles as usize, |k| State::at(&[0.0, angle(k)]))
        };
        let ripple = off(EffectId::GearRipple.into(), 2, wave);
        assert_eq!(few_angles(&ripple, &at(3.0, 11)), Some((2, 11)));
        assert_eq!(few_angles(&ripple, &at(3.0, 12)), None);
        assert_eq!(few_angles(&ripple, &at(0.1, 12)), Some((2, 1)));
        // joint 1 stood, and what is no curve of an angle needs none
        assert_eq!(few_angles(&off(EffectId::JointHarmonic.into(), 1, wave), &at(3.0, 12)), Some((1, 1)));
        assert_eq!(few_angles(&off(EffectId::GearRatio.into(), 2, Shape::Linear), &at(3.0, 2)), None);
        assert_eq!(few_angles(&off(Cause::Unexplained, 2, wave), &at(3.0, 2)), None);
    }

    #[test]
    fn an_error_so_steep_that_no_model_can_have_it_is_told_with_its_period() {
        let steep = Basis::new(Variable::Joint { joint: 2 }, Shape::Sine { cycles: 9000.0 });
        let (truth, data) = with_joint_2(&[(steep, 2e-4)]);
        let said = diagnose(&truth.robot, &truth.cell, &data, &Options::default(), &Task::silent()).unwrap();
        let found = said.unexplained.unwrap();
        assert_eq!((found.site, found.variable.as_str(), found.modelled), (Place::Joint(2), "q2", false));
        assert_eq!(found.region, "all of q2, every 0.0400 deg");
    }

    #[test]
    fn a_sure_curve_is_not_told_again_without_a_name_beside_a_doubted_effect_of_the_same_joint() {
        let wave = |cycles| (Basis::new(Variable::Joint { joint: 2 }, Shape::Sine { cycles }), 4e-4);
        let hidden = [&[2.0, 3.0, 4.0, 7.0].map(wave)[..], &[(Basis::direction(2), -1.3e-5)]].concat();
        let (truth, data) = with_joint_2(&hidden);
        let said = diagnose(&truth.robot, &truth.cell, &data, &Options::default(), &Task::silent()).unwrap();
        let sure = |f: &Finding| (f.effect, f.confidence > DOUBTED_BELOW);
        let expected = [(EffectId::EncoderError, true), (EffectId::LostMotionDirection, false)];
        assert_eq!(said.findings.iter().map(sure).collect::<Vec<_>>(), expected);
        let again = |u: &&Unexplained| u.site == Place::Joint(2) && u.variable == "q2";
        assert!(!said.unexplained.iter().chain(&said.more_unexplained).any(|u| again(&u)), "{:?}", said.unexplained);
    }

    #[test]
    fn a_curve_without_a_name_doubts_names_of_its_joint_over_the_same_variable() {
        let curve = |joint: usize| off(Cause::Unexplained, joint, Shape::Hinge { at: 0.3 });
        let by_direction = |mut c: Candidate| {
            c.terms[0].basis.sense = Some(2);
            c
        };
        let by_time = |mut c: Candidate| {
            c.terms[0].basis.of = Variable::Time;
            c
        };
        let name = off(EffectId::EncoderError.into(), 2, Shape::Sine { cycles: 3.0 });
        let candidates = [name, curve(2), curve(2), curve(3), by_direction(curve(2)), by_time(curve(2))];
        assert_eq!(rest_over_the_same(&candidates, &[0, 1, 3, 4, 5], &[0]), [1]);
    }

    #[test]
    fn a_model_that_is_no_better_in_another_session_is_told_with_both_errors() {
        let of = |mm: f64| Some(ErrorSummary::of(&[mm * 1e-3; 4]));
        let told = |plain, whole| no_better_elsewhere("in a session", plain, whole);
        assert_eq!([told(of(0.5), of(0.4)), told(of(0.5), of(0.5)), told(None, None)], [None, None, None]);
        let said = told(of(0.4), of(0.5)).unwrap_or_default();
        assert!(
            said.starts_with("in a session that it was not fitted to")
                && said.contains("off by 0.500 mm (mean), the plain one by 0.400 mm"),
            "{said}"
        );
    }

    #[test]
    fn another_zero_is_the_models_where_the_newest_session_has_it_and_half_of_it_where_nobody_knows_which_of_two() {
        let of_session = |session| {
            let mut c = off(EffectId::JointZeroShift.into(), 3, Shape::Linear);
            c.terms[0].basis = Basis::CONSTANT.in_session(session);
            (vec![c], Vec::new())
        };
        let told = |sessions: &[u32], names: &[&str]| {
            let grounds: Vec<_> = sessions.iter().map(|s| of_session(*s)).collect();
            another_zero(&grounds, &names.iter().map(ToString::to_string).collect::<Vec<_>>())
        };
        let dated = ["a-2026-03-01.csv", "b-2026-03-05.csv", "c-2026-03-03.csv"];
        assert!(
            told(&[2], &dated).unwrap().starts_with("joint 3 has another zero in b-2026-03-05.csv, the newest session")
        );
        // as it was before, which is not how it is now
        assert_eq!((told(&[3], &dated), told(&[], &["a", "b"])), (None, None));
        assert!(told(&[1], &["a", "b"]).unwrap().contains("in a than in b, and two sessions cannot show which"));
        let of_four = told(&[2, 4], &["a", "b", "c", "d"]).unwrap();
        assert!(of_four.starts_with(
            "joint 3 has another zero in b and d than in the others; the model has that of the others. Where b is"
        ));
        assert!(told(&[2], &["a", "b", "c"]).unwrap().contains("in b than in the others;"));
    }

    #[test]
    fn what_is_left_of_means_of_readings_is_the_gauges_unless_it_is_much_larger_than_they_differ() {
        let told = |left, freedom| read_several_times(Scatter { sd: 2e-5, readings: 4.0, freedom }, left);
        // the means of four differ by 0.01 mm
        assert_eq!(told(1.4e-5, 400), "poses were read 4 times in a row: the mean of each counts as one measurement");
        let said = told(1.6e-5, 400);
        assert!(said.contains("differ by 0.020 mm, and what is left of their means is 0.016 mm"), "{said}");
        // so few may differ by so little by chance
        assert!(!told(2.9e-5, 4).contains("differ") && told(3.1e-5, 4).contains("differ"));
    }

    #[test]
    fn parameters_of_instruments_are_not_counted_as_the_arms() {
        let mut model = arm();
        let x = trical_model::Motion::Along(trical_model::Axis::X);
        let term = |site| Term::new("t", "t", site, Basis::CONSTANT);
        model.terms = vec![term(Site::Tool(x)), term(Site::Frame { frame: 0, motion: x }), term(Site::Base(x))];
        assert_eq!(arm_parameters(&model), 2);
    }

    #[test]
    fn a_finding_lowers_the_error_at_poses_that_were_not_seen_and_what_could_not_be_asked_is_told() {
        let (truth, data) = with_joint_2(&[(Basis::direction(2), -4e-4)]);
        let said = diagnose(&truth.robot, &truth.cell, &data, &Options::default(), &Task::silent()).unwrap();
        let evidence = &said.findings[0].evidence;
        let [before, after] = [evidence.holdout_rms_before_mm, evidence.holdout_rms_after_mm];
        assert!(before == said.baseline.holdout_rms_mm && after < 0.5 * before, "{evidence:?}");
        assert!(said.after.held_out.forward.is_some() && said.findings.len() == 1);
        // no thermometer, and a gap could have been seen
        let lacks = |id| said.blind_to.iter().any(|b| b.effect == id && b.lacks.is_some());
        assert!(lacks(EffectId::ThermalGrowth) && !lacks(EffectId::LostMotionDirection));
    }
}
