//! The procedure: rejection, baseline, rounds of selection and exact refit, proof, findings.

use trical_ident::caution::cautions;
use trical_ident::dataset::Dataset;
use trical_ident::error::Result;
use trical_ident::fit::position_errors;
use trical_ident::identify::ErrorSummary;
use trical_model::{Cell, Forward, Model, Place, Robot, Site, Task};

use crate::candidate::Candidate;
use crate::catalogue::Untestable;
use crate::diagnosis::{Baseline, Blind, Diagnosis, Final, Finding, Grounds, Unexplained};
use crate::effect_id::Cause;
use crate::findings::{
    Proof, add_probe_results, blind, finding, forward_in_time, grouped, held_out, lack_of_fit, noise_of, ordered,
    prove, remaining_lack_of_fit, trust_beside_unknown, trust_of_repeated, unexplained_from, unknowns,
};
use crate::linear::{Design, Downdate, RegressionState};
use crate::rounds::Rounds;
use crate::selection::Search;
use crate::settings::DOUBTED_BELOW;
use crate::specification_test::{Probes, SpecificationTest};

/// Diagnoses recordings of one arm. With `names_only` what has no name is told but not modelled.
///
/// # Errors
/// As [`trical_ident::identify::identify`].
pub fn diagnose(robot: &Robot, cell: &Cell, data: &Dataset, names_only: bool, task: &Task<'_>) -> Result<Diagnosis> {
    task.step(0.0, "checking rows")?;
    let mut rounds = Rounds::begin(robot, cell, data, names_only)?;
    let baseline = rounds.fitted.model.clone();
    select(&mut rounds, names_only, task)?;

    task.step(0.75, "proving")?;
    let Rounds { kept, fitted, chosen, .. } = &rounds;
    let (design, probes) = rounds.design_with_probes()?;
    let start = design.start();
    let proving = Proving::new(&rounds, &design, &probes, &start);
    // first of all: fits of fewer find their sums in it
    let last = ErrorSummary::of(&held_out(&design, chosen, &proving.poses));
    let forward = forward_in_time(&design, chosen, &proving.poses);
    let none = prove(&design, &[], &proving.poses);
    let Found { findings, grounds, mut unexplained, doubted } = proving.findings(none, task)?;
    proving.ask_probes(&mut unexplained, &doubted);

    task.step(0.95, "what the data cannot show")?;
    let errors = fitted.errors()?;
    let before_errors = position_errors(&Forward::new(baseline.clone(), Vec::new())?, kept);
    let lack_of_fit_p = |state: &RegressionState| lack_of_fit(&proving.search, state, chosen);
    let diagnosis = Diagnosis {
        baseline: Baseline {
            parameters: arm_parameters(&baseline),
            rms_mm: ErrorSummary::of(&before_errors).rms_mm,
            noise_mm: noise_of(fitted, &errors),
            lack_of_fit_p: lack_of_fit_p(&start),
            holdout_rms_mm: none.blocks,
            reading_noise: rounds.reading_noise().map(Candidate::located).collect(),
        },
        blind_to: proving.blind_to(&findings),
        findings,
        after: Final {
            parameters: arm_parameters(&fitted.model),
            rms_mm: ErrorSummary::of(&errors).rms_mm,
            holdout_rms_mm: last.rms_mm,
            holdout_mean_mm: last.mean_mm,
            forward_mean_mm: ErrorSummary::of(&forward).mean_mm,
            lack_of_fit_p: lack_of_fit_p(proving.downdate.full()),
        },
        unexplained: (!unexplained.is_empty()).then(|| unexplained.remove(0)),
        more_unexplained: unexplained,
        cautions: cautions(&fitted.model, fitted.observability.rows, fitted.free.len())
            .into_iter()
            .chain(rounds.correlation.caution())
            .collect(),
        rejected: kept.rejected.clone(),
        model: fitted.model.clone(),
        data: kept.clone(),
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

/// Selection until nothing changes; then with rows restored that one number explains, then with more to choose from where names do
/// not say all.
fn select(rounds: &mut Rounds, names_only: bool, task: &Task<'_>) -> Result<()> {
    rounds.settle(&task.part(0.1, 0.45))?;
    if rounds.restore_rows()? {
        rounds.settle(&task.part(0.45, 0.5))?;
    }
    task.step(0.5, "looking again without names")?;
    if !names_only && rounds.widen()? {
        rounds.settle(&task.part(0.55, 0.75))?;
    }
    Ok(())
}

/// What was chosen, as findings and as what has no name.
struct Found {
    findings: Vec<Finding>,
    /// Of each finding, its candidates and the best candidate of each rival.
    grounds: Vec<(Vec<Candidate>, Vec<Candidate>)>,
    unexplained: Vec<Unexplained>,
    /// Places whose names are doubted.
    doubted: Vec<Place>,
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
    /// Poses of the rows that were kept.
    poses: Vec<usize>,
}

impl<'a> Proving<'a> {
    fn new(rounds: &'a Rounds, design: &'a Design, probes: &'a Probes, start: &'a RegressionState) -> Self {
        Self {
            rounds,
            design,
            search: rounds.searcher(design),
            test: rounds.specification_test(design, probes),
            start,
            downdate: Downdate::new(design, start, &rounds.chosen),
            poses: rounds.kept.used_poses(),
        }
    }

    /// Findings in the order of what they remove, each with its evidence, its rivals and how far it is trusted; `none` is the proof
    /// of the baseline.
    fn findings(&self, none: Proof, task: &Task<'_>) -> Result<Found> {
        let Self { search, start, downdate, .. } = self;
        let Rounds { kept, fitted, candidates, chosen, .. } = self.rounds;
        let full = downdate.full();
        let groups = search.among(start, chosen, |few, start| ordered(few, start, grouped(candidates, chosen)));
        let unknown = search.among(start, chosen, |few, start| unknowns(few, start, full, chosen));
        let mut found =
            Found { findings: Vec::new(), grounds: Vec::new(), unexplained: Vec::new(), doubted: Vec::new() };
        let mut so_far: Vec<usize> = Vec::new();
        let mut before = none;
        for (k, group) in groups.iter().enumerate() {
            #[expect(clippy::cast_precision_loss, reason = "counts")]
            task.step(0.75 + 0.2 * k as f64 / groups.len() as f64, "proving")?;
            so_far.extend(&group.members);
            let after = prove(self.design, &so_far, &self.poses);
            let others: Vec<usize> = chosen.iter().filter(|c| !group.members.contains(c)).copied().collect();
            let state = search.without(downdate, start, &group.members).state;
            if let Some(effect) = candidates[group.members[0]].cause.effect() {
                let (mut f, rivals) = finding(effect, search, &state, group, &others, &fitted.model, [before, after]);
                let own = state.ss - full.ss;
                let doubt = self.test.doubt(full, &state, own, &|place| place.is_same_part(f.site));
                let trust = (1.0 - doubt)
                    * trust_beside_unknown(own, f.site, &unknown)
                    * trust_of_repeated(group, chosen, candidates);
                f.confidence = (f.confidence * trust * 1e4).round() / 1e4;
                if trust <= DOUBTED_BELOW {
                    found.doubted.extend(f.site.part().filter(|place| !found.doubted.contains(place)));
                }
                found.findings.push(f);
                let members = group.members.iter().map(|m| candidates[*m].clone()).collect();
                found.grounds.push((members, rivals));
            } else {
                found.unexplained.push(unexplained_from(search, &state, group, &fitted.model, [before, after], kept));
            }
            before = after;
        }
        Ok(found)
    }

    /// What was chosen but for what is at a place: only its curves without a name, or all of it.
    fn chosen_elsewhere(&self, place: Place, curves: bool) -> Vec<usize> {
        let Rounds { candidates, chosen, .. } = self.rounds;
        let goes = |c: &Candidate| (!curves || c.cause == Cause::Unexplained) && place.is_same_part(c.site);
        chosen.iter().copied().filter(|c| !goes(&candidates[*c])).collect()
    }

    /// Held-out error of a set, with a probe where one is given, mm rms.
    fn rms_mm(&self, mut set: Vec<usize>, probe: Option<usize>) -> f64 {
        set.extend(probe);
        ErrorSummary::of(&held_out(self.design, &set, &self.poses)).rms_mm
    }

    /// Adds what probes find beside curves without a name, at doubted places, and where nothing was modelled; the largest first.
    fn ask_probes(&self, unexplained: &mut Vec<Unexplained>, doubted: &[Place]) {
        let full = self.downdate.full();
        let without = |place, curves| self.search.with(self.start, &self.chosen_elsewhere(place, curves));
        add_probe_results(&self.test, full, unexplained, doubted, &without, &|place, curves, probe| {
            self.rms_mm(self.chosen_elsewhere(place, curves), probe)
        });
        let explained = |place| without(place, false).ss - full.ss;
        let rms_mm = |probe| self.rms_mm(self.rounds.chosen.clone(), probe);
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

/// What terms about the readings' own noise have for the name of their effect.
const READING_NOISE: [&str; 2] = [Cause::ReadingNoise.name(), Cause::JointReadingNoise.name()];

/// Parameters of the arm, without those of measuring frames, targets and the readings' own noise.
fn arm_parameters(model: &Model) -> usize {
    let of_arm = |t: &&trical_model::Term| {
        !matches!(t.site, Site::Frame { .. } | Site::Target { .. }) && !READING_NOISE.contains(&t.effect.as_str())
    };
    model.terms.iter().filter(of_arm).count()
}
