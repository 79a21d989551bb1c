//! The proof: what was chosen, as findings with their evidence, their rivals and how probable they are, and as what has no name.

use trical_ident::HeldOut;
use trical_ident::dataset::Dataset;
use trical_ident::error::Result;
use trical_ident::fit::folds::Folds;
use trical_ident::fit::identify::ErrorSummary;
use trical_model::{Place, Task, Term};

use crate::candidate::Candidate;
use crate::catalogue::Untestable;
use crate::diagnosis::{Blind, Finding, Rival, Unexplained};
use crate::effect_id::{Cause, EffectId};
use crate::findings::{
    Group, Proof, add_probe_results, blind, finding, grouped, lack_of_fit, ordered, remaining_lack_of_fit,
    unexplained_from,
};
use crate::halves::Halves;
use crate::linear::{Design, Downdate, RegressionState};
use crate::locators::sorted;
use crate::parts::Parts;
use crate::phases;
use crate::probability::{Alternative, Says, Shares, probabilities, shares};
use crate::rounds::Rounds;
use crate::selection::Search;
use crate::settings::{ALTERNATIVES, ANGLES_FOR_CURVES, DOUBTED_BELOW, SAME_ANGLE, UNNAMED_PRICE_NATS};
use crate::specification_test::{Probes, SpecificationTest, doubt_by_rest};
use crate::statistics::odds_outside_catalogue;
use crate::verdict;

/// What was chosen, as findings and as what has no name.
pub(crate) struct Found {
    pub findings: Vec<Finding>,
    /// Of each finding, its candidates and the best candidate of each rival.
    pub grounds: Vec<(Vec<Candidate>, Vec<Candidate>)>,
    pub unexplained: Vec<Unexplained>,
    /// What was chosen under names that are doubted.
    pub doubted: Vec<usize>,
}

/// What was chosen, with all that its proof asks.
pub(crate) struct Proving<'a> {
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
    pub(crate) fn new(
        rounds: &'a Rounds,
        design: &'a Design,
        probes: &'a Probes,
        start: &'a RegressionState,
    ) -> Result<Self> {
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
    pub(crate) fn held_out(&self, by_session: Option<ErrorSummary>, by_place: Option<ErrorSummary>) -> HeldOut {
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

    /// Probability of what is left at the baseline, and with everything that was chosen, were there nothing but noise.
    pub(crate) fn lack_of_fit(&self) -> [f64; 2] {
        [self.start, self.downdate.full()].map(|state| lack_of_fit(&self.search, state, &self.rounds.chosen))
    }

    /// Findings in the order of importance, each with its evidence, its rivals and how probable it is; `none` is the proof of the baseline.
    pub(crate) fn findings(&self, none: Proof, task: &Task<'_>) -> Result<Found> {
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
        let log_prior = group.members.iter().map(|m| self.rounds.log_prior_beside_others(*m)).sum();
        let own = Alternative { says: Says::Same, log_prior, scores: parts.scores(&[], &[None]).remove(0) };
        // what stands in its place, what that says, and how probable it was beforehand
        let mut instead: Vec<(Option<usize>, Says, f64)> = Vec::new();
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
            // what contains the finding predicts as well, and pays for its further coefficients as far as the data determine them
            let contains = group.members.iter().all(|m| candidates[*m].is_part_of(c));
            let price = if contains { self.design.gain(self.downdate.full(), r.candidate).occam } else { 0.0 };
            instead.push((Some(r.candidate), says(c), c.log_prior - price));
            if told.len() >= ALTERNATIVES && nameless_here || told.len() > ALTERNATIVES {
                break;
            }
        }
        if let Some((probe, _)) = first.site.part().and_then(|place| self.test.best_probe(state, place)) {
            instead.push((Some(probe.probe), Says::Place, -2.0 * UNNAMED_PRICE_NATS));
        }
        instead.push((None, Says::Nothing, 0.0));
        let adds: Vec<Option<usize>> = instead.iter().map(|(add, ..)| *add).collect();
        let alternatives = instead.into_iter().zip(parts.scores(&group.members, &adds));
        let alternatives = alternatives.map(|((_, says, log_prior), scores)| Alternative { says, log_prior, scores });
        let alternatives: Vec<Alternative> = std::iter::once(own).chain(alternatives).collect();
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
    pub(crate) fn prove(&self, set: &[usize]) -> Proof {
        let rest: Vec<usize> = self.rounds.chosen.iter().copied().filter(|c| !set.contains(c)).collect();
        let rms = |parts: &Option<Parts<'_>>| parts.as_ref().map_or(0.0, |p| p.errors(&rest, None).rms_mm);
        Proof { blocks: rms(&self.blocks), forward: rms(&self.later) }
    }

    /// Held-out error without some of what was chosen, with a probe where one is given, mm rms.
    fn rms_mm(&self, out: &[usize], probe: Option<usize>) -> f64 {
        self.blocks.as_ref().map_or(0.0, |p| p.errors(out, probe).rms_mm)
    }

    /// Adds what probes find beside curves without a name, at doubted places, and where nothing was modelled; the largest first.
    pub(crate) fn ask_probes(&self, unexplained: &mut Vec<Unexplained>, doubted: &[usize]) {
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
    pub(crate) fn blind_to(&self, findings: &[Finding]) -> Vec<Blind> {
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
    let is_rest = |c: &Candidate| {
        let mut of = members.iter().map(|m| &candidates[*m]);
        c.cause == Cause::Unexplained && of.any(|m| m.site.is_same_part(c.site) && m.over() == c.over())
    };
    chosen.iter().copied().filter(|c| is_rest(&candidates[*c])).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use trical_model::{Shape, State, Variable};

    use super::*;
    use crate::test_data::off;

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
}
