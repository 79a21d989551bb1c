//! The search in progress: what was believed, tried and chosen so far.

use trical_ident::dataset::{Dataset, Observation};
use trical_ident::error::Result;
use trical_ident::gross::reject_gross_errors_beyond;
use trical_ident::identifiability::{Choice, ParameterSet};
use trical_ident::identify::{Identified, fit_model, fit_model_knowing, prepared};
use trical_ident::known::Known;
use trical_ident::noise::Noise;
use trical_model::interrupt::checkpoint;
use trical_model::{Cell, Measured, Model, Place, Robot, Term};

use crate::candidate::Candidate;
use crate::catalogue::{Untestable, catalogue, device_orientation, reading_noise};
use crate::correlated_noise::Memory;
use crate::covariates::{Recorded, gives_way};
use crate::effect_id::{Cause, EffectId};
use crate::linear::Design;
use crate::locators::locators;
use crate::refine::finer;
use crate::selection::{self, Search};
use crate::specification_test::{CONSIDERABLE, Judge, LEFT, Probes, probes};
use crate::{periodogram, rejection};

/// Rounds of search and exact refit until nothing changes.
const ROUNDS: usize = 5;

/// How often effects and the memory of the noise are chosen in turn.
const TURNS: usize = 4;

/// So many rows that are explained by one number are no outliers.
const ALIKE: usize = 3;

/// Robust standard deviations beyond which a row is a gross error before anything is known.
const GROSS: f64 = 30.0;

pub(crate) struct Work {
    /// What may be believed, outliers included.
    pub(crate) all: Dataset,
    /// What is believed.
    pub(crate) kept: Dataset,
    /// The fit with everything chosen: terms of the baseline, then those of the chosen candidates.
    pub(crate) fitted: Identified,
    /// Of its terms.
    pub(crate) known: Vec<Known>,
    /// How many of its terms are the baseline's.
    baseline_terms: usize,
    /// What can be tried; grows as frequencies are found.
    pub(crate) candidates: Vec<Candidate>,
    /// Indices into the candidates.
    pub(crate) chosen: Vec<usize>,
    /// How the noise remembers itself, beside what was chosen.
    pub(crate) memory: Memory,
    pub(crate) untestable: Vec<Untestable>,
    /// Terms about the readings' own noise, and which of them are in the baseline.
    pub(crate) nuisances: Vec<Candidate>,
    pub(crate) believed: Vec<bool>,
}

/// What may explain the residuals.
struct Explanation {
    chosen: Vec<usize>,
    memory: Memory,
    /// How likely the residuals are with it.
    nats: f64,
    /// Memories beside which effects were chosen.
    tried: Vec<Memory>,
}

/// What a round of the search came to.
struct Round {
    chosen: Vec<usize>,
    memory: Memory,
    fitted: Identified,
    known: Vec<Known>,
}

impl Round {
    /// How many rows it believed.
    fn believed(&self) -> usize {
        self.fitted.data.observations.len()
    }

    fn is_as(&self, other: &Self) -> bool {
        let sorted = |r: &Self| {
            let mut chosen = r.chosen.clone();
            chosen.sort_unstable();
            chosen
        };
        self.believed() == other.believed() && sorted(self) == sorted(other)
    }
}

impl Work {
    /// Hygiene, the baseline fit, and everything that this data can be asked.
    pub(crate) fn begin(robot: &Robot, cell: &Cell, data: &Dataset, names_only: bool) -> Result<Self> {
        let all = rejection::without_stale(data);
        let set = if robot.require_masses().is_ok() { ParameterSet::Compliance } else { ParameterSet::Geometry };
        let all = reject_gross_errors_beyond(robot, cell, &all, GROSS)?;
        let (start, _) = prepared(robot, cell, &all, &Choice::from(set))?;
        let fitted = fit_model(start, &all, &Noise::usual(all.names.len()), Vec::new())?;
        let sigma = touch_sigma(&fitted);
        let nuisances = reading_noise(&Recorded::new(&fitted.model, &all, sigma));
        let mut work = Self {
            kept: all.clone(),
            all,
            baseline_terms: fitted.model.terms.len(),
            known: vec![Known::NOTHING; fitted.model.terms.len()],
            candidates: Vec::new(),
            chosen: Vec::new(),
            memory: Memory::NONE,
            untestable: Vec::new(),
            believed: vec![false; nuisances.len()],
            nuisances,
            fitted,
        };
        if let Some(term) = device_orientation(&Recorded::new(&work.fitted.model, &work.all, sigma)) {
            work.fitted.model.terms.push(term);
            work.baseline_terms += 1;
            work.refit()?;
        }
        work.believe()?;
        (work.candidates, work.untestable) = catalogue(&Recorded::new(&work.fitted.model, &work.all, sigma));
        if !names_only {
            work.candidates.extend(locators(&work.fitted.model, &work.all));
        }
        work.resize();
        Ok(work)
    }

    /// Sizes that are a share of something fitted (a soft joint's, of its compliance), as it is fitted now, with a standard deviation
    /// added: a baseline without the effect has taken up some of it.
    fn resize(&mut self) {
        let mut model = self.fitted.model.clone();
        for t in model.terms.iter_mut().filter(|t| gives_way(t).is_some()) {
            t.value = t.value.abs() + t.sd.unwrap_or(0.0);
        }
        let soft = EffectId::NonlinearStiffness.effect();
        let now = (soft.ask)(&Recorded::new(&model, &self.all, touch_sigma(&self.fitted))).candidates;
        for c in self.candidates.iter_mut().filter(|c| c.cause == soft.id.into()) {
            if let Some(now) = now.iter().find(|n| n.terms[0].name == c.terms[0].name) {
                c.scales.clone_from(&now.scales);
                c.typical = now.typical;
            }
        }
    }

    /// Rounds of search and exact refit until the choice stays as it is. What was chosen is where the next round linearizes, so that
    /// two choices may each lead to the other: then the likelier one is taken.
    pub(crate) fn settle(&mut self, progress: &mut dyn FnMut(f64)) -> Result<()> {
        let mut rounds: Vec<Round> = Vec::new();
        for round in 0..ROUNDS {
            checkpoint()?;
            #[expect(clippy::cast_precision_loss, reason = "counts")]
            progress(round as f64 / ROUNDS as f64);
            self.kept = rejection::without_outliers(&self.fitted, &self.all)?;
            checkpoint()?;
            self.add(periodogram::ripples(&self.fitted, &self.kept)?);
            checkpoint()?;
            let before = (self.chosen.clone(), self.memory);
            self.choose(rounds.is_empty())?;
            let chosen: Vec<&Candidate> = self.chosen.iter().map(|c| &self.candidates[*c]).collect();
            self.add(finer(&chosen, &self.candidates, &self.kept));
            if self.refit().is_err() {
                // the exact fit does not follow the linear picture: what was there before stays
                (self.chosen, self.memory) = before;
                self.refit()?;
                break;
            }
            self.resize();
            // with the effects out of the way the readings' noise may show
            if self.believe()? {
                rounds.clear();
                continue;
            }
            let new = self.round();
            let been_there = rounds.iter().any(|r| r.is_as(&new));
            rounds.push(new);
            if been_there {
                break;
            }
        }
        self.take_likeliest(rounds)
    }

    /// Goes back to the likeliest of some rounds, of those that believed the same rows as the last one.
    fn take_likeliest(&mut self, mut rounds: Vec<Round>) -> Result<()> {
        let Some(last) = rounds.pop() else { return Ok(()) };
        rounds.retain(|r| r.believed() == last.believed() && !r.is_as(&last));
        if rounds.is_empty() {
            return Ok(());
        }
        rounds.insert(0, last);
        let mut best = (f64::NEG_INFINITY, 0);
        for (k, round) in rounds.iter().enumerate() {
            // all with the present noise, or they could not be compared
            let nats = self.nats(&round.fitted.model, &self.members(&round.chosen), round.memory)?;
            if nats > best.0 {
                best = (nats, k);
            }
        }
        self.go_back(rounds.swap_remove(best.1));
        Ok(())
    }

    /// What the search has come to.
    fn round(&self) -> Round {
        Round {
            chosen: self.chosen.clone(),
            memory: self.memory,
            fitted: self.fitted.clone(),
            known: self.known.clone(),
        }
    }

    fn go_back(&mut self, to: Round) {
        (self.chosen, self.memory, self.fitted, self.known) = (to.chosen, to.memory, to.fitted, to.known);
    }

    /// How likely the residuals are if `candidates` are all that happens, in the linear picture at a model that was fitted with effects.
    fn nats(&self, model: &Model, candidates: &[Candidate], memory: Memory) -> Result<f64> {
        let design = self.design_at(model, candidates, &[], memory)?;
        let temper = temper(&self.kept);
        let all: Vec<usize> = (0..candidates.len()).collect();
        Ok(design.nats(temper) + Search::new(&design, candidates, temper).total(&design.stage(), &all))
    }

    /// Some of the candidates.
    fn members(&self, set: &[usize]) -> Vec<Candidate> {
        set.iter().map(|c| self.candidates[*c].clone()).collect()
    }

    /// Rows that are off alike at one place are no outliers: if one number more explains several of those that were not believed, they are.
    /// Whether that was so.
    pub(crate) fn believe_more(&mut self) -> Result<bool> {
        let unbelieved = |work: &Self| work.all.observations.len() - work.kept.observations.len();
        let before = unbelieved(self);
        if before < ALIKE {
            return Ok(false);
        }
        let (round, believed) = (self.round(), std::mem::replace(&mut self.kept, self.all.clone()));
        let best = {
            let design = self.design(&self.candidates, &[], self.memory)?;
            let search = self.searcher(&design);
            let stage = search.with(&design.stage(), &self.chosen);
            let lean = |c: usize| self.candidates[c].terms.len() == 1 && !self.chosen.contains(&c);
            search.rank(&stage).into_iter().find(|r| lean(r.candidate) && r.evidence > selection::THRESHOLD)
        };
        if let Some(best) = best {
            self.chosen.push(best.candidate);
            if self.refit().is_ok() {
                self.kept = rejection::without_outliers(&self.fitted, &self.all)?;
                if unbelieved(self) + ALIKE <= before && self.refit().is_ok() {
                    return Ok(true);
                }
            }
        }
        self.kept = believed;
        self.go_back(round);
        Ok(false)
    }

    /// Frequencies faster than any gear; and names lose their privilege where a place does more than its name says, or where
    /// it took two terms to say it: two effects at one joint are a coincidence. Whether there is anything new to try.
    pub(crate) fn look_again(&mut self) -> Result<bool> {
        let before = self.candidates.len();
        let fast = periodogram::fast(&self.fitted, &self.kept)?;
        self.add(fast);
        let mut new = self.candidates.len() > before;
        let (design, probes) = self.design_with_probes()?;
        let judge = self.judge(&design, &probes);
        let search = self.searcher(&design);
        let start = design.stage();
        let stage = search.with(&start, &self.chosen);
        let mut places: Vec<Place> = Vec::new();
        for m in judge.places(&stage).into_iter().filter(|m| m.p_value < LEFT) {
            let rest: Vec<usize> =
                self.chosen.iter().copied().filter(|c| !m.site.is_same_part(self.candidates[*c].site)).collect();
            if m.dss > CONSIDERABLE * (search.with(&start, &rest).ss - stage.ss) {
                places.push(m.site);
            }
        }
        let mut named: Vec<Place> = Vec::new();
        for c in self.chosen.iter().map(|c| &self.candidates[*c]) {
            if named.contains(&c.site) {
                places.push(c.site);
            }
            named.push(c.site);
        }
        for place in places {
            let here = |c: &Candidate| c.cause == Cause::Unexplained && c.site == place && c.scanned();
            let count = self.candidates.iter().filter(|c| here(c)).count();
            #[expect(clippy::cast_precision_loss, reason = "a count")]
            let log_prior = -(count.max(1) as f64).ln();
            for c in self.candidates.iter_mut().filter(|c| here(c)) {
                c.log_prior = log_prior;
                new = true;
            }
        }
        Ok(new)
    }

    /// Chooses what explains the residuals: effects beside white noise, or fewer beside noise that remembers itself. A slow effect that is not
    /// modelled looks like such noise, and such noise like slow effects, whichever is asked first; at `first` both are.
    fn choose(&mut self, first: bool) -> Result<()> {
        let mut best = self.explanation(self.memory, &self.chosen)?;
        if first {
            let (bare, _) = self.memory_beside(&[])?;
            for start in [Memory::NONE, bare] {
                if best.tried.contains(&start) {
                    continue;
                }
                let other = self.explanation(start, &[])?;
                best.tried.extend(&other.tried);
                if other.nats > best.nats {
                    best = Explanation { tried: best.tried, ..other };
                }
            }
        }
        (self.chosen, self.memory) = (best.chosen, best.memory);
        Ok(())
    }

    /// Effects and memory of the noise, each chosen beside the other in turn from `memory` on.
    fn explanation(&self, memory: Memory, initial: &[usize]) -> Result<Explanation> {
        let mut best = Explanation { chosen: initial.to_vec(), memory, nats: f64::NEG_INFINITY, tried: Vec::new() };
        let mut next = memory;
        while !best.tried.contains(&next) && best.tried.len() < TURNS {
            checkpoint()?;
            best.tried.push(next);
            let design = self.design(&self.candidates, &[], next)?;
            checkpoint()?;
            let chosen = self.searcher(&design).choose(&design.stage(), &best.chosen);
            let (memory, nats) = self.memory_beside(&chosen)?;
            next = memory;
            if nats >= best.nats {
                (best.chosen, best.memory, best.nats) = (chosen, memory, nats);
            }
        }
        Ok(best)
    }

    /// How the noise most likely remembers itself if `set` is all that happens, and how likely both are, nats.
    fn memory_beside(&self, set: &[usize]) -> Result<(Memory, f64)> {
        let candidates = self.members(set);
        Memory::likeliest(longest_recording(&self.kept), |memory| {
            checkpoint()?;
            self.nats(&self.fitted.model, &candidates, memory)
        })
    }

    fn add(&mut self, more: Vec<Candidate>) {
        for c in more {
            let known = |o: &Candidate| {
                o.cause == c.cause && o.terms.len() == c.terms.len() && {
                    let mut pairs = o.terms.iter().zip(&c.terms);
                    pairs.all(|(a, b)| a.site == b.site && a.basis == b.basis)
                }
            };
            if !self.candidates.iter().any(known) {
                self.candidates.push(c);
            }
        }
    }

    /// The baseline at the joint optimum, chosen effects taken out: the search puts them back.
    fn bare(&self) -> Model {
        let mut bare = self.fitted.model.clone();
        bare.terms.truncate(self.baseline_terms);
        bare
    }

    /// The linear picture of the baseline with candidates.
    fn design(&self, candidates: &[Candidate], weights: &[Vec<Vec<f64>>], memory: Memory) -> Result<Design> {
        self.design_at(&self.fitted.model, candidates, weights, memory)
    }

    /// The same where another fit of baseline and effects is.
    fn design_at(
        &self,
        model: &Model,
        candidates: &[Candidate],
        weights: &[Vec<Vec<f64>>],
        memory: Memory,
    ) -> Result<Design> {
        Design::weighted(model, self.baseline_terms, candidates, weights, &self.kept, &self.fitted.noise, memory)
    }

    /// With all candidates, and probes behind them.
    pub(crate) fn design_with_probes(&self) -> Result<(Design, Probes)> {
        let probes = probes(&self.fitted.model, &self.kept);
        let mut all = self.candidates.clone();
        all.extend(probes.candidates.iter().cloned());
        let mut weights = vec![Vec::new(); self.candidates.len()];
        weights.extend(probes.weights.iter().cloned());
        Ok((self.design(&all, &weights, self.memory)?, probes))
    }

    pub(crate) fn searcher<'a>(&'a self, design: &'a Design) -> Search<'a> {
        Search::new(design, &self.candidates, temper(&self.kept))
    }

    pub(crate) fn judge<'a>(&self, design: &'a Design, probes: &'a Probes) -> Judge<'a> {
        Judge { design, probes, first: self.candidates.len(), temper: temper(&self.kept) }
    }

    pub(crate) fn touch_sigma(&self) -> f64 {
        touch_sigma(&self.fitted)
    }

    /// The exact joint fit of the baseline and what was chosen.
    fn refit(&mut self) -> Result<()> {
        let mut model = self.bare();
        let mut known = vec![Known::NOTHING; model.terms.len()];
        for c in self.chosen.iter().map(|c| &self.candidates[*c]) {
            for (t, sd) in c.terms.iter().zip(&c.scales) {
                let mut term: Term = t.clone();
                if model.terms.iter().any(|o| o.name == term.name) {
                    let copies = model.terms.iter().filter(|o| o.name.starts_with(&term.name)).count();
                    term.name = format!("{}_{}", term.name, copies + 1);
                }
                model.terms.push(term);
                known.push(Known::about_zero(*sd));
            }
        }
        self.fitted = fit_model_knowing(model, &self.kept, &self.fitted.noise, &known, Vec::new())?;
        self.known = known;
        Ok(())
    }

    /// Adds those terms about the readings' own noise that pay to the baseline, and fits again. Whether there were any.
    fn believe(&mut self) -> Result<bool> {
        let mut any = false;
        for k in 0..self.nuisances.len() {
            if self.believed[k] {
                continue;
            }
            let one = std::slice::from_ref(&self.nuisances[k]);
            let design = Design::new(&self.fitted.model, one, &self.fitted.data, &self.fitted.noise)?;
            let temper = temper(&self.fitted.data);
            let search = Search::new(&design, one, temper);
            if search.rank(&design.stage()).first().is_some_and(|r| r.evidence > selection::THRESHOLD) {
                let new = self.nuisances[k].terms.clone();
                let at = self.baseline_terms;
                self.baseline_terms += new.len();
                self.fitted.model.terms.splice(at..at, new);
                self.believed[k] = true;
                any = true;
                self.refit()?;
            }
        }
        Ok(any)
    }
}

/// Standard deviation of a touch's scalar residual, m; that of any other measurement where there are no touches.
fn touch_sigma(fitted: &Identified) -> f64 {
    let of = |o: &Observation| fitted.noise.sigma(o.recording, &o.measured, 0);
    let touch = fitted.data.observations.iter().find(|o| matches!(o.measured, Measured::Touch { .. }));
    touch.or_else(|| fitted.data.observations.first()).map_or(1e-5, of)
}

/// Poses of the recording that has most.
fn longest_recording(data: &Dataset) -> usize {
    let mut poses = vec![0; data.names.len()];
    let mut last = None;
    for o in &data.observations {
        if last != Some((o.recording, o.pose)) {
            poses[o.recording] += 1;
        }
        last = Some((o.recording, o.pose));
    }
    poses.into_iter().max().unwrap_or(0)
}

/// Fewer independent scalars than rows: several targets seen at one pose share what moves the arm, six numbers.
#[expect(clippy::cast_precision_loss, reason = "counts")]
fn temper(data: &Dataset) -> f64 {
    let rows: usize = data.observations.iter().map(|o| trical_model::residual_rows(&o.measured)).sum();
    (6.0 * data.used_poses().len() as f64 / rows as f64).min(1.0)
}
