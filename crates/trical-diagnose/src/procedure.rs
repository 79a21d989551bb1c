//! The procedure: rejection, baseline, rounds of selection and exact refit, proof, findings.

use trical_ident::caution::cautions;
use trical_ident::dataset::Dataset;
use trical_ident::error::Result;
use trical_ident::fit::position_errors;
use trical_ident::identify::ErrorSummary;
use trical_model::{Cell, Forward, Model, Place, Robot, Site};

use crate::alternatives::Grounds;
use crate::candidate::Candidate;
use crate::catalogue::Untestable;
use crate::diagnosis::{Baseline, Blind, Diagnosis, Final, Unexplained};
use crate::effect_id::Cause;
use crate::findings::{
    beside_unknown, blind, finding, forward_in_time, grouped, held_out, lack_of_fit, left_over, noise_of, of_one_kind,
    ordered, prove, told_better, unexplained_from, unknowns,
};
use crate::linear::Company;
use crate::rounds::Work;

/// Names that are trusted no more than this by their place's probes (rivals apart) are doubted: what happens there is told without
/// a name too.
const DOUBTED: f64 = 0.9;

/// Progress: a fraction and what is being done.
pub type Progress<'a> = &'a mut dyn FnMut(f64, &str);

/// Diagnoses recordings of one arm. With `names_only` what has no name is told but not modelled.
///
/// # Errors
/// As [`trical_ident::identify::identify`].
pub fn diagnose(
    robot: &Robot,
    cell: &Cell,
    data: &Dataset,
    names_only: bool,
    progress: Progress<'_>,
) -> Result<Diagnosis> {
    progress(0.0, "hygiene");
    let mut work = Work::begin(robot, cell, data, names_only)?;
    let baseline = work.fitted.model.clone();
    work.settle(&mut |part| progress(0.1 + 0.35 * part, "searching"))?;
    if work.believe_more()? {
        work.settle(&mut |part| progress(0.45 + 0.05 * part, "searching"))?;
    }
    progress(0.5, "looking again without names");
    if !names_only && work.look_again()? {
        work.settle(&mut |part| progress(0.55 + 0.2 * part, "searching"))?;
    }

    progress(0.75, "proving");
    let Work { all: _, kept, fitted, candidates, chosen, untestable, nuisances, believed, .. } = &work;
    let (design, probes) = work.design_with_probes()?;
    let judge = work.judge(&design, &probes);
    let search = work.searcher(&design);
    let start = design.stage();
    let company = Company::new(&design, &start, chosen);
    let full = company.full().clone();
    let groups = search.among(&start, chosen, |few, start| ordered(few, start, grouped(candidates, chosen)));
    let poses = kept.used_poses();
    let cv = |set: &[usize]| held_out(&design, set, &poses);
    // first of all: fits of fewer find their sums in it
    let last = ErrorSummary::of(&cv(chosen));
    let forward = forward_in_time(&design, chosen, &poses);

    let unknown = search.among(&start, chosen, |few, start| unknowns(few, start, &full, chosen));
    let mut findings = Vec::new();
    let mut grounds = Vec::new();
    let mut unexplained = Vec::new();
    let mut doubted = Vec::new();
    let mut so_far: Vec<usize> = Vec::new();
    let none = prove(&design, &[], &poses);
    let mut before = none;
    for (k, group) in groups.iter().enumerate() {
        #[expect(clippy::cast_precision_loss, reason = "counts")]
        progress(0.75 + 0.2 * k as f64 / groups.len() as f64, "proving");
        so_far.extend(&group.members);
        let after = prove(&design, &so_far, &poses);
        let others: Vec<usize> = chosen.iter().filter(|c| !group.members.contains(c)).copied().collect();
        let stage = search.without(&company, &start, &group.members).stage;
        if let Some(effect) = candidates[group.members[0]].cause.effect() {
            let (mut f, rivals) = finding(effect, &search, &stage, group, &others, &fitted.model, [before, after]);
            let own = stage.ss - full.ss;
            let doubt = judge.doubt(&full, &stage, own, &|place| place.is_same_part(f.site));
            let trust = (1.0 - doubt) * beside_unknown(own, f.site, &unknown) * of_one_kind(group, chosen, candidates);
            f.confidence = (f.confidence * trust * 1e4).round() / 1e4;
            if trust <= DOUBTED {
                doubted.extend(f.site.part().filter(|place| !doubted.contains(place)));
            }
            findings.push(f);
            let members = group.members.iter().map(|m| candidates[*m].clone()).collect();
            grounds.push((members, rivals));
        } else {
            unexplained.push(unexplained_from(&search, &stage, group, &fitted.model, [before, after], kept));
        }
        before = after;
    }

    let elsewhere = |place: Place, curves: bool| {
        let goes = |c: &Candidate| {
            let of_these = !curves || c.cause == Cause::Unexplained;
            of_these && place.is_same_part(c.site)
        };
        chosen.iter().copied().filter(|c| !goes(&candidates[*c])).collect::<Vec<usize>>()
    };
    let rms_of = |set: Vec<usize>, probe: Option<usize>| {
        ErrorSummary::of(&cv(&set.into_iter().chain(probe).collect::<Vec<usize>>())).rms_mm
    };
    told_better(
        &judge,
        &full,
        &mut unexplained,
        &doubted,
        &|place, curves| search.with(&start, &elsewhere(place, curves)),
        &|place, curves, probe| rms_of(elsewhere(place, curves), probe),
    );
    let left =
        left_over(&judge, &full, &|place| search.with(&start, &elsewhere(place, false)).ss - full.ss, &|probe| {
            rms_of(chosen.clone(), probe)
        });
    let known = |m: &Unexplained| unexplained.iter().any(|u| u.site == m.site && u.variable == m.variable);
    let left: Vec<Unexplained> = left.into_iter().filter(|m| !known(m)).collect();
    unexplained.extend(left);
    unexplained.sort_by(|a, b| b.rms_mm.total_cmp(&a.rms_mm));

    progress(0.95, "what the data cannot show");
    let mut blind_to = blind(&search, &full, chosen);
    let found = |u: &&Untestable| findings.iter().any(|f| f.effect == u.effect);
    blind_to.extend(untestable.iter().filter(|u| !found(u)).map(|u| Blind {
        effect: u.effect,
        site: Place::All,
        lambda: 0.0,
        lacks: Some(u.lacks.to_owned()),
    }));
    let errors = fitted.errors()?;
    let before_errors = position_errors(&Forward::new(baseline.clone(), Vec::new())?, kept);
    let diagnosis = Diagnosis {
        baseline: Baseline {
            parameters: arm_parameters(&baseline),
            rms_mm: ErrorSummary::of(&before_errors).rms_mm,
            noise_mm: noise_of(fitted, &errors),
            lack_of_fit_p: lack_of_fit(&search, &start, chosen),
            holdout_rms_mm: none.blocks,
            reading_noise: nuisances.iter().zip(believed).filter(|(_, b)| **b).map(|(n, _)| n.located()).collect(),
        },
        findings,
        blind_to,
        after: Final {
            parameters: arm_parameters(&fitted.model),
            rms_mm: ErrorSummary::of(&errors).rms_mm,
            holdout_rms_mm: last.rms_mm,
            holdout_mean_mm: last.mean_mm,
            forward_mean_mm: ErrorSummary::of(&forward).mean_mm,
            lack_of_fit_p: lack_of_fit(&search, &full, chosen),
        },
        unexplained: (!unexplained.is_empty()).then(|| unexplained.remove(0)),
        more_unexplained: unexplained,
        cautions: cautions(&fitted.model, fitted.observability.rows, fitted.free.len())
            .into_iter()
            .chain(work.memory.caution())
            .collect(),
        rejected: kept.rejected.clone(),
        model: fitted.model.clone(),
        data: kept.clone(),
        before: baseline,
        grounds: Grounds {
            noise: fitted.noise.clone(),
            known: work.known.clone(),
            findings: grounds,
            sigma: work.touch_sigma(),
        },
    };
    progress(1.0, "done");
    Ok(diagnosis)
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
