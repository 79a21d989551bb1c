//! Diagnosis: does the model explain the data to within the noise; if not, where does it fail, which physics does that, how
//! sure is that, and what happens to the error on data that the fit did not see once it is modelled.
//!
//! | module | holds |
//! |---|---|
//! | [`catalogue`] | what can be tried |
//! | [`locators`] | what finds a mismatch without a name |
//! | [`design`] | the linear picture: signatures after projection, evidence, held-out errors |
//! | [`search`] | which candidates the residual asks for |
//! | [`hygiene`] | rows that must not be believed |

pub mod catalogue;
pub mod design;
pub mod hygiene;
pub mod locators;
pub mod search;

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};
use trical_model::{Cell, Forward, Model, Robot, Term};

use crate::dataset::{Dataset, Rejected};
use crate::error::Result;
use crate::fit::{Prior, position_errors};
use crate::identifiability::{Choice, ParameterSet};
use crate::identify::{ErrorSummary, Identified, fit_model, fit_model_with_priors, prepared};
use crate::noise::Noise;
use crate::units::unit;

use catalogue::{Candidate, Untestable, catalogue, reading_noise};
use design::{Design, Stage};
use locators::locators;
use search::{Ranked, Search};

/// Signatures below this many standard deviations cannot be seen.
const VISIBLE: f64 = 3.0;

/// Candidates within this many nats of a finding are rivals.
const RIVAL: f64 = 5.0;

/// No claim is surer than this.
const SUREST: f64 = 0.99;

/// Rounds of search and exact refit.
const ROUNDS: usize = 5;

/// A coefficient in its unit.
#[derive(Clone, Debug, Serialize)]
pub struct Coefficient {
    /// Name.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Unit.
    pub unit: String,
    /// Standard deviation.
    pub sd: Option<f64>,
}

/// What speaks for a finding.
#[derive(Clone, Debug, Serialize)]
pub struct Evidence {
    /// BIC without it minus BIC with it.
    pub delta_bic: f64,
    /// F-test of its coefficients.
    pub p_value: f64,
    /// Held-out error with the more important findings, without this one.
    pub holdout_rms_before_mm: f64,
    /// And with it.
    pub holdout_rms_after_mm: f64,
}

/// Another explanation that the data cannot exclude.
#[derive(Clone, Debug, Serialize)]
pub struct Rival {
    /// Effect.
    pub effect: String,
    /// Where.
    pub site: serde_json::Value,
    /// By how much its BIC is worse.
    pub delta_bic: f64,
}

/// An effect that the data asks for.
#[derive(Clone, Debug, Serialize)]
pub struct Finding {
    /// Name in the catalogue.
    pub effect: String,
    /// Where.
    pub site: serde_json::Value,
    /// In words.
    pub located: String,
    /// Probability that effect and site are right.
    pub confidence: f64,
    /// Length of its signature after projection, in units of the noise.
    pub lambda: f64,
    /// Coefficients.
    pub coefficients: Vec<Coefficient>,
    /// What speaks for it.
    pub evidence: Evidence,
    /// What else could look the same.
    pub rivals: Vec<Rival>,
    /// What to measure next to be surer.
    pub next_measurements: Option<String>,
}

/// An effect that this data set could not show at a typical size.
#[derive(Clone, Debug, Serialize)]
pub struct Blind {
    /// Effect.
    pub effect: String,
    /// Where.
    pub site: serde_json::Value,
    /// lambda of a typical size; 0 where the recordings lack what the effect depends on.
    pub lambda: f64,
    /// Why, where it cannot be tested at all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lacks: Option<String>,
}

/// A mismatch for which the catalogue has no name.
#[derive(Clone, Debug, Serialize)]
pub struct Unexplained {
    /// Where.
    pub site: serde_json::Value,
    /// On what it depends.
    pub variable: String,
    /// For which values.
    pub region: String,
    /// Size of the fitted curve at the tool, mm.
    pub rms_mm: f64,
    /// Held-out error without it.
    pub holdout_rms_before_mm: f64,
    /// And with it.
    pub holdout_rms_after_mm: f64,
    /// The free-form curve: pairs of variable and value.
    pub curve: Vec<(f64, f64)>,
    /// Units of the curve's two columns.
    pub curve_units: (String, String),
}

/// The fit before anything was added.
#[derive(Clone, Debug, Serialize)]
pub struct Baseline {
    /// Arm parameters (base and tool included; measuring frames and targets of optical recordings are not counted).
    pub parameters: usize,
    /// Root of the mean square position error.
    pub rms_mm: f64,
    /// Noise that remains when everything that was found is modelled.
    pub noise_mm: f64,
    /// Probability of a residual structure as strong as the strongest found, were there none.
    pub lack_of_fit_p: f64,
    /// Held-out error.
    pub holdout_rms_mm: f64,
    /// What the readings' own noise made the fit do, in words.
    pub reading_noise: Vec<String>,
}

/// The fit with everything that was found.
#[derive(Clone, Debug, Serialize)]
pub struct Final {
    /// Arm parameters.
    pub parameters: usize,
    /// Root of the mean square position error.
    pub rms_mm: f64,
    /// Held-out error, 4-fold by pose.
    pub holdout_rms_mm: f64,
    /// Mean held-out error.
    pub holdout_mean_mm: f64,
    /// Mean error of the last quarter of the poses, fitted on the first three.
    pub forward_mean_mm: f64,
    /// As in [`Baseline`], for what is left.
    pub lack_of_fit_p: f64,
}

/// The answer.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    /// Before.
    pub baseline: Baseline,
    /// What was found, most important first.
    pub findings: Vec<Finding>,
    /// What this data could not show.
    pub blind_to: Vec<Blind>,
    /// Where a mismatch remains without a name.
    pub unexplained: Option<Unexplained>,
    /// Further ones.
    pub more_unexplained: Vec<Unexplained>,
    /// After.
    #[serde(rename = "final")]
    pub after: Final,
    /// Rows that were not believed.
    pub rejected: Vec<Rejected>,
    /// The extended model.
    #[serde(skip)]
    pub model: Model,
    /// The data that was believed.
    #[serde(skip)]
    pub data: Dataset,
    /// The baseline fit.
    #[serde(skip)]
    pub before: Model,
}

/// Progress: a fraction and what is being done.
pub type Progress<'a> = &'a mut dyn FnMut(f64, &str);

/// One group of chosen candidates: same effect, same site.
struct Group {
    members: Vec<usize>,
}

/// Diagnoses recordings of one arm.
///
/// # Errors
/// As [`crate::identify::identify`].
pub fn diagnose(robot: &Robot, cell: &Cell, data: &Dataset, progress: Progress<'_>) -> Result<Diagnosis> {
    progress(0.0, "hygiene");
    let all = hygiene::without_stale(data);
    let set = if robot.require_masses().is_ok() { ParameterSet::Compliance } else { ParameterSet::Geometry };
    let choice = Choice::from(set);
    let all = crate::identify::reject_gross_errors_beyond(robot, cell, &all, 30.0)?;
    let (start, _) = prepared(robot, cell, &all, &choice)?;
    let usual = Noise::usual(all.names.len());
    let mut fitted = fit_model(start, &all, &usual, Vec::new())?;
    let sigma = touch_sigma(&fitted);
    let nuisances = reading_noise(&fitted.model, &all, sigma);
    let mut believed = vec![false; nuisances.len()];
    fitted = believe(fitted, &nuisances, &mut believed)?;
    let baseline_terms = fitted.model.terms.len();
    let baseline = fitted.clone();
    let (mut candidates, untestable) = catalogue(&fitted.model, &all, sigma);
    let ripples: Vec<bool> = candidates.iter().map(|c| c.effect == "gear_ripple").collect();
    candidates.extend(locators(&fitted.model, &all));
    let is_ripple = |k: usize| ripples.get(k).copied().unwrap_or(false);

    let mut chosen: Vec<usize> = Vec::new();
    let mut shortlist: Vec<usize> = Vec::new();
    let mut kept = all.clone();
    let mut baseline_terms = baseline_terms;
    let mut last: Option<(Vec<usize>, usize)> = None;
    for round in 0..ROUNDS {
        #[expect(clippy::cast_precision_loss, reason = "counts")]
        progress(0.1 + 0.6 * round as f64 / ROUNDS as f64, "searching");
        kept = hygiene::without_outliers(&fitted, &all)?;
        // the baseline at the joint optimum, chosen effects taken out again: the search puts them back
        let mut bare = fitted.model.clone();
        bare.terms.truncate(baseline_terms);
        shortlist = ripple_shortlist(&bare, &candidates, &is_ripple, &chosen, &kept, &fitted.noise)?;
        let (indices, design) = sub_design(&bare, &candidates, &is_ripple, &shortlist, &kept, &fitted.noise)?;
        let local: Vec<Candidate> = indices.iter().map(|k| candidates[*k].clone()).collect();
        let search = searcher(&design, &local, &kept);
        let initial: Vec<usize> = chosen.iter().filter_map(|c| indices.iter().position(|k| k == c)).collect();
        let found = search.choose(&design.stage(), &initial);
        chosen = found.iter().map(|k| indices[*k]).collect();
        let mut sorted = chosen.clone();
        sorted.sort_unstable();
        let state = (sorted, kept.observations.len());
        fitted = refit(&bare, &chosen, &candidates, &kept, &fitted.noise)?;
        // with the effects out of the way the readings' noise may show
        let (terms, added) = (fitted.model.terms.len(), fitted.model.terms.len() - bare.terms.len());
        fitted = believe(fitted, &nuisances, &mut believed)?;
        if fitted.model.terms.len() > terms {
            let new = fitted.model.terms.split_off(terms);
            let count = new.len();
            let at = terms - added;
            fitted.model.terms.splice(at..at, new);
            baseline_terms += count;
            continue;
        }
        if last.as_ref() == Some(&state) {
            break;
        }
        last = Some(state);
    }

    progress(0.75, "proving");
    let mut bare = fitted.model.clone();
    bare.terms.truncate(baseline_terms);
    let (indices, design) = sub_design(&bare, &candidates, &is_ripple, &shortlist, &kept, &fitted.noise)?;
    let local: Vec<Candidate> = indices.iter().map(|k| candidates[*k].clone()).collect();
    let search = searcher(&design, &local, &kept);
    let start = design.stage();
    let set: Vec<usize> = chosen.iter().filter_map(|c| indices.iter().position(|k| k == c)).collect();
    let groups = ordered(&search, &start, grouped(&local, &set));
    let poses = kept.used_poses();
    let cv = |set: &[usize]| held_out(&design, set, &poses);

    let mut findings = Vec::new();
    let mut unexplained = Vec::new();
    let mut so_far: Vec<usize> = Vec::new();
    let none = cv(&[]);
    let mut before_rms = ErrorSummary::of(&none).rms_mm;
    for (k, group) in groups.iter().enumerate() {
        #[expect(clippy::cast_precision_loss, reason = "counts")]
        progress(0.75 + 0.2 * k as f64 / groups.len() as f64, "proving");
        so_far.extend(&group.members);
        let after_rms = ErrorSummary::of(&cv(&so_far)).rms_mm;
        let others: Vec<usize> = set.iter().filter(|c| !group.members.contains(c)).copied().collect();
        let stage = search.with(&start, &others);
        if local[group.members[0]].effect == locators::UNEXPLAINED {
            unexplained.push(unexplained_from(&search, &stage, group, &fitted.model, (before_rms, after_rms), &kept));
        } else {
            findings.push(finding(&search, &stage, group, &others, &fitted.model, (before_rms, after_rms)));
        }
        before_rms = after_rms;
    }
    if !unexplained.is_empty() {
        for f in &mut findings {
            f.confidence = (f.confidence * 0.95 * 1e4).round() / 1e4;
        }
    }

    progress(0.95, "what the data cannot show");
    let stage = search.with(&start, &set);
    let mut blind_to = blind(&search, &stage, &set);
    blind_to.extend(untestable.iter().map(|u: &Untestable| Blind {
        effect: u.effect.to_owned(),
        site: serde_json::json!({ "all": true }),
        lambda: 0.0,
        lacks: Some(u.lacks.to_owned()),
    }));
    let errors = fitted.errors()?;
    let last = ErrorSummary::of(&cv(&set));
    let before_errors = position_errors(&Forward::new(baseline.model.clone(), Vec::new())?, &kept);
    let arm = |m: &Model| {
        m.terms
            .iter()
            .filter(|t| {
                !matches!(t.site, trical_model::Site::Frame { .. } | trical_model::Site::Target { .. })
                    && !t.effect.ends_with("reading_noise")
            })
            .count()
    };
    let three_quarters = poses[(poses.len() * 3) / 4];
    let forward = design.held_out(&set, &|p| p < three_quarters, &|p| p >= three_quarters);
    let noise_mm = noise_of(&fitted, &errors);
    let diagnosis = Diagnosis {
        baseline: Baseline {
            parameters: arm(&baseline.model),
            rms_mm: ErrorSummary::of(&before_errors).rms_mm,
            noise_mm,
            lack_of_fit_p: lack_of_fit(&search, &start, &set),
            holdout_rms_mm: ErrorSummary::of(&none).rms_mm,
            reading_noise: nuisances
                .iter()
                .zip(&believed)
                .filter(|(_, b)| **b)
                .map(|(n, _)| n.located.clone())
                .collect(),
        },
        findings,
        blind_to,
        after: Final {
            parameters: arm(&fitted.model),
            rms_mm: ErrorSummary::of(&errors).rms_mm,
            holdout_rms_mm: last.rms_mm,
            holdout_mean_mm: last.mean_mm,
            forward_mean_mm: ErrorSummary::of(&forward).mean_mm,
            lack_of_fit_p: lack_of_fit(&search, &stage, &set),
        },
        unexplained: (!unexplained.is_empty()).then(|| unexplained.remove(0)),
        more_unexplained: unexplained,
        rejected: kept.rejected.clone(),
        model: fitted.model,
        data: kept,
        before: baseline.model,
    };
    progress(1.0, "done");
    Ok(diagnosis)
}

/// Adds those terms about the readings' own noise that pay, and fits again.
fn believe(mut fitted: Identified, nuisances: &[Candidate], believed: &mut [bool]) -> Result<Identified> {
    for (n, done) in nuisances.iter().zip(believed) {
        if *done {
            continue;
        }
        let design = Design::new(&fitted.model, std::slice::from_ref(n), &fitted.data, &fitted.noise)?;
        let one = searcher(&design, std::slice::from_ref(n), &fitted.data);
        if one.rank(&design.stage()).first().is_some_and(|r| r.evidence > search::THRESHOLD) {
            let mut model = fitted.model.clone();
            model.terms.extend(n.terms.iter().cloned());
            fitted = fit_model(model, &fitted.data, &fitted.noise, Vec::new())?;
            *done = true;
        }
    }
    Ok(fitted)
}

/// Standard deviation of a touch's scalar residual, m; that of any other measurement where there are no touches.
fn touch_sigma(fitted: &Identified) -> f64 {
    let of = |o: &crate::dataset::Observation| fitted.noise.sigma(o.recording, &o.measured, 0);
    let touch = fitted.data.observations.iter().find(|o| matches!(o.measured, trical_model::Measured::Touch { .. }));
    touch.or_else(|| fitted.data.observations.first()).map_or(1e-5, of)
}

#[expect(clippy::cast_precision_loss, reason = "counts")]
fn searcher<'a>(design: &'a Design, local: &'a [Candidate], data: &Dataset) -> Search<'a> {
    let poses = data.used_poses().len() as f64;
    let temper = (6.0 * poses / design.rows as f64).min(1.0);
    Search { design, candidates: local, allowed: vec![true; local.len()], temper }
}

/// The candidates without ripples, but for a shortlist, and their design.
fn sub_design(
    bare: &Model,
    candidates: &[Candidate],
    is_ripple: &dyn Fn(usize) -> bool,
    shortlist: &[usize],
    data: &Dataset,
    noise: &Noise,
) -> Result<(Vec<usize>, Design)> {
    let indices: Vec<usize> = (0..candidates.len()).filter(|k| !is_ripple(*k) || shortlist.contains(k)).collect();
    let local: Vec<Candidate> = indices.iter().map(|k| candidates[*k].clone()).collect();
    let design = Design::new(bare, &local, data, noise)?;
    Ok((indices, design))
}

/// The periodogram: of each joint's ripples the three strongest, given what is chosen already.
fn ripple_shortlist(
    bare: &Model,
    candidates: &[Candidate],
    is_ripple: &dyn Fn(usize) -> bool,
    chosen: &[usize],
    data: &Dataset,
    noise: &Noise,
) -> Result<Vec<usize>> {
    let mut list: Vec<usize> = chosen.iter().copied().filter(|c| is_ripple(*c)).collect();
    for joint in 1..=bare.robot.dof() {
        let site = serde_json::json!({ "joint": joint });
        let mut indices: Vec<usize> = chosen.to_vec();
        let first = indices.len();
        indices.extend(
            (0..candidates.len()).filter(|k| is_ripple(*k) && candidates[*k].site == site && !chosen.contains(k)),
        );
        let local: Vec<Candidate> = indices.iter().map(|k| candidates[*k].clone()).collect();
        let design = Design::new(bare, &local, data, noise)?;
        let search = searcher(&design, &local, data);
        let stage = search.with(&design.stage(), &(0..first).collect::<Vec<_>>());
        list.extend(search.rank(&stage).iter().filter(|r| r.candidate >= first).take(3).map(|r| indices[r.candidate]));
    }
    list.sort_unstable();
    list.dedup();
    Ok(list)
}

/// The exact joint fit of the baseline and what was chosen.
fn refit(
    bare: &Model,
    chosen: &[usize],
    candidates: &[Candidate],
    data: &Dataset,
    noise: &Noise,
) -> Result<Identified> {
    let mut model = bare.clone();
    for c in chosen {
        for t in &candidates[*c].terms {
            let mut term: Term = t.clone();
            if model.terms.iter().any(|o| o.name == term.name) {
                let copies = model.terms.iter().filter(|o| o.name.starts_with(&term.name)).count();
                term.name = format!("{}_{}", term.name, copies + 1);
            }
            model.terms.push(term);
        }
    }
    let mut priors: Vec<Option<Prior>> = vec![None; bare.terms.len()];
    let scales = chosen.iter().flat_map(|c| &candidates[*c].scales);
    priors.extend(scales.map(|sd| Some(Prior { value: 0.0, sd: *sd })));
    fit_model_with_priors(model, data, noise, &priors, Vec::new())
}

fn grouped(local: &[Candidate], set: &[usize]) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for c in set {
        let same = |g: &&mut Group| {
            let o = &local[g.members[0]];
            o.effect == local[*c].effect && o.site == local[*c].site
        };
        match groups.iter_mut().find(same) {
            Some(g) => g.members.push(*c),
            None => groups.push(Group { members: vec![*c] }),
        }
    }
    groups
}

/// Greedily by what each removes.
fn ordered(search: &Search<'_>, start: &Stage, mut groups: Vec<Group>) -> Vec<Group> {
    let mut out = Vec::new();
    let mut stage = start.clone();
    while !groups.is_empty() {
        let ss = |g: &Group| search.with(&stage, &g.members).ss;
        let best = (0..groups.len()).min_by(|a, b| ss(&groups[*a]).total_cmp(&ss(&groups[*b]))).unwrap_or(0);
        let g = groups.remove(best);
        stage = search.with(&stage, &g.members);
        out.push(g);
    }
    out
}

/// Position errors of all poses, each scored by a fit without its fold: pose k is in fold k mod 4.
fn held_out(design: &Design, set: &[usize], poses: &[usize]) -> Vec<f64> {
    let fold = |p: usize| poses.binary_search(&p).map_or(0, |i| i % 4);
    (0..4).flat_map(|f| design.held_out(set, &|p| fold(p) != f, &|p| fold(p) == f)).collect()
}

fn coefficients(model: &Model, local: &Candidate) -> Vec<Coefficient> {
    local
        .terms
        .iter()
        .filter_map(|t| {
            let fitted = model.terms.iter().find(|m| m.site == t.site && m.basis == t.basis && m.effect == t.effect)?;
            let u = unit(fitted);
            // a gap is what it measures: positive, though it adds to the angle against the sense of motion
            let sign = if fitted.basis.sense.is_some() { -1.0 } else { 1.0 };
            Some(Coefficient {
                name: fitted.name.clone(),
                value: sign * fitted.value * u.per_si,
                unit: u.name,
                sd: fitted.sd.map(|s| s * u.per_si),
            })
        })
        .collect()
}

fn f_test(search: &Search<'_>, stage: &Stage, dss: f64, rank: f64) -> f64 {
    let k = rank.max(1.0);
    let n = search.freedom(stage) - k;
    let f = (dss / k) / ((stage.ss - dss).max(1e-300) / n);
    FisherSnedecor::new(k, n.max(1.0)).map_or(1.0, |d| d.sf(f * search.temper))
}

fn finding(
    search: &Search<'_>,
    stage: &Stage,
    group: &Group,
    others: &[usize],
    model: &Model,
    held_out: (f64, f64),
) -> Finding {
    let first = group.members[0];
    let local = search.candidates;
    let with = search.with(stage, &group.members);
    let dss = stage.ss - with.ss;
    let rank = with.parameters - stage.parameters;
    let delta_bic = {
        let n = search.freedom(stage);
        n * (stage.ss / with.ss).ln() - rank * n.ln()
    };
    let ranked: Vec<Ranked> = search.rank(stage).into_iter().filter(|r| !others.contains(&r.candidate)).collect();
    let own = search.total(stage, &group.members);
    let mut rivals: Vec<Rival> = Vec::new();
    let mut rival_weight = 0.0;
    let mut own_weight = 1.0;
    for r in &ranked {
        // tempered: the noise is never quite what the model of it says
        let weight = (0.7 * (r.evidence - own)).exp();
        if search.same_place(r.candidate, first) {
            if !group.members.contains(&r.candidate) {
                own_weight += weight;
            }
            continue;
        }
        rival_weight += weight;
        let c = &local[r.candidate];
        if r.evidence > own - RIVAL
            && c.effect != locators::UNEXPLAINED
            && !rivals.iter().any(|v| v.effect == c.effect && v.site == c.site)
            && rivals.len() < 8
        {
            rivals.push(Rival {
                effect: c.effect.to_owned(),
                site: c.site.clone(),
                delta_bic: (2.0 * (own - r.evidence)).max(0.0),
            });
        }
    }
    let nothing = (0.7 * -own).exp();
    let confidence = (own_weight / (own_weight + rival_weight + nothing)).min(SUREST);
    let next_measurements = (!rivals.is_empty()).then(|| {
        format!(
            "poses that tell {} from {}: vary what they do not share",
            local[first].effect,
            rivals.iter().map(|r| r.effect.as_str()).collect::<Vec<_>>().join(", ")
        )
    });
    let variance = with.ss / search.freedom(&with);
    Finding {
        effect: local[first].effect.to_owned(),
        site: local[first].site.clone(),
        located: group.members.iter().map(|m| local[*m].located.as_str()).collect::<Vec<_>>().join("; "),
        confidence: (confidence * 1e4).round() / 1e4,
        lambda: (dss * search.temper / variance).max(0.0).sqrt(),
        coefficients: group.members.iter().flat_map(|m| coefficients(model, &local[*m])).collect(),
        evidence: Evidence {
            delta_bic,
            p_value: f_test(search, stage, dss, rank),
            holdout_rms_before_mm: held_out.0,
            holdout_rms_after_mm: held_out.1,
        },
        rivals,
        next_measurements,
    }
}

fn unexplained_from(
    search: &Search<'_>,
    stage: &Stage,
    group: &Group,
    model: &Model,
    held_out: (f64, f64),
    data: &Dataset,
) -> Unexplained {
    let first = &search.candidates[group.members[0]];
    let with = search.with(stage, &group.members);
    #[expect(clippy::cast_precision_loss, reason = "a count")]
    let rms_mm = {
        // removed sum of squares, as a position error of the observations
        let share = ((stage.ss - with.ss) / stage.ss).clamp(0.0, 1.0);
        let errors = Forward::new(model.clone(), Vec::new()).map(|f| position_errors(&f, data)).unwrap_or_default();
        let n = errors.len().max(1) as f64;
        let square = errors.iter().map(|e| e * e).sum::<f64>() / n;
        (square * share / (1.0 - share).max(1e-6)).sqrt() * 1e3
    };
    let located = locators::describe(first, group.members.iter().map(|m| &search.candidates[*m]), model, data);
    Unexplained {
        site: first.site.clone(),
        variable: located.variable,
        region: located.region,
        rms_mm,
        holdout_rms_before_mm: held_out.0,
        holdout_rms_after_mm: held_out.1,
        curve: located.curve,
        curve_units: located.units,
    }
}

/// Effects and sites whose typical size would leave no trace.
fn blind(search: &Search<'_>, stage: &Stage, set: &[usize]) -> Vec<Blind> {
    let variance = (stage.ss / search.freedom(stage)).max(1e-300);
    let mut seen: Vec<(usize, f64)> = Vec::new();
    for (k, c) in search.candidates.iter().enumerate() {
        if c.effect == locators::UNEXPLAINED || set.iter().any(|s| search.same_place(*s, k)) {
            continue;
        }
        let lambda = search.design.lambda_of_size(stage, k, c.typical) * search.temper.sqrt() / variance.sqrt();
        match seen.iter_mut().find(|(s, _)| search.same_place(*s, k)) {
            Some(entry) => entry.1 = entry.1.max(lambda),
            None => seen.push((k, lambda)),
        }
    }
    seen.into_iter()
        .filter(|(_, lambda)| *lambda < VISIBLE)
        .map(|(k, lambda)| Blind {
            effect: search.candidates[k].effect.to_owned(),
            site: search.candidates[k].site.clone(),
            lambda,
            lacks: None,
        })
        .collect()
}

/// Smallest p-value among all candidates, times how many independent questions were asked (Bonferroni).
fn lack_of_fit(search: &Search<'_>, stage: &Stage, set: &[usize]) -> f64 {
    let ranked = search.rank(stage);
    #[expect(clippy::cast_precision_loss, reason = "a count")]
    let questions = ranked.len() as f64;
    ranked
        .iter()
        .filter(|r| !(stage.ss < search.design.stage().ss && set.contains(&r.candidate)))
        .take(100)
        .map(|r| f_test(search, stage, r.dss, r.rank) * questions)
        .fold(1.0, f64::min)
}

/// Noise of a position error: root mean square of the residuals, with the parameters paid for.
#[expect(clippy::cast_precision_loss, reason = "counts")]
fn noise_of(fitted: &Identified, errors: &[f64]) -> f64 {
    let rows = fitted.observability.rows as f64;
    let p = fitted.free.len() as f64;
    ErrorSummary::of(errors).rms_mm * (rows / (rows - p).max(1.0)).sqrt()
}
