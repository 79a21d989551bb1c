//! The diagnosis in progress: rounds of selection and exact refit, with what was kept, tried and chosen so far.

mod elsewhere;
mod impossible;
mod named;
mod pays;
mod readings;
mod rows;
mod waves;
mod whole;

use std::collections::BTreeSet;

use trical_ident::calibration::by_place::choose;
use trical_ident::calibration::{own_setup, refuse_no_arm};
use trical_ident::dataset::readings::{Scatter, averaged};
use trical_ident::dataset::sample::sample_poses;
use trical_ident::dataset::{Dataset, Observation};
use trical_ident::error::Result;
use trical_ident::fit::cautions::{held, near_nominal};
use trical_ident::fit::choice::{Choice, ParameterSet};
use trical_ident::fit::gross_errors::reject_gross_errors_beyond;
use trical_ident::fit::identify::{ErrorSummary, Identified, fit_some, identify, manner};
use trical_ident::fit::levenberg_marquardt::LmParams;
use trical_ident::fit::priors::PriorKnowledge;
use trical_ident::fit::read_otherwise::read_otherwise;
use trical_ident::fit::stuck_stems::refuse_stuck_stems;
use trical_ident::fit::weak_priors::SOFTEST;
use trical_model::interrupt::checkpoint;
use trical_model::{Cell, Measured, Model, Place, Robot, Site, Task, Term};

use crate::candidate::Candidate;
use crate::catalogue::{Untestable, catalogue, device_orientation, reading_noise};
use crate::correlated_noise::CorrelatedNoise;
use crate::covariates::Covariates;
use crate::effect_id::{Cause, EffectId};
use crate::halves::Halves;
use crate::linear::{Design, Fitted};
use crate::locators::locators;
use crate::options::Options;
use crate::refine::finer;
use crate::selection::Search;
use crate::settings::{
    CONSIDERABLE_SHARE, GROSS_ERROR_SIGMAS, LACK_OF_FIT_P, MOST_ROUNDS, NOISE_ALTERNATIONS, RUN_POSES, SEARCHED_POSES,
    SETTLED_AMONG_FEW, SETTLED_SHARE,
};
use crate::specification_test::{Probes, SpecificationTest, probes};
use crate::{periodogram, rejection};

/// What the baseline has: the twist of near-parallel axes and errors of a rail are effects here.
pub(crate) const BASELINE: ParameterSet = ParameterSet::Compliance;

pub(crate) struct Rounds {
    /// All rows that are searched, outliers included.
    pub(crate) all: Dataset,
    /// Those that were rejected before anything was known of the arm.
    gross: Dataset,
    /// The whole data, where a sample is searched.
    whole: Option<Dataset>,
    /// How far readings of one pose differ, where it has several: their mean is searched.
    pub(crate) readings: Option<Scatter>,
    /// Without outliers.
    pub(crate) kept: Dataset,
    /// The fit with everything chosen: terms of the baseline, then those of the chosen candidates.
    pub(crate) fitted: Identified,
    /// What was known of its terms beforehand.
    pub(crate) known: Vec<PriorKnowledge>,
    /// How far the plain model is off, standard deviation of a measured length, m.
    plain: f64,
    /// How many of its terms are the baseline's.
    baseline_terms: usize,
    /// How exactly, and how robustly, it is fitted.
    params: LmParams,
    /// What can be tried; grows as frequencies are found.
    pub(crate) candidates: Vec<Candidate>,
    /// Indices into the candidates.
    pub(crate) chosen: Vec<usize>,
    /// Curves with many coefficients that were chosen first: in the fit, but not asked about while leaner candidates are searched.
    held: Vec<usize>,
    /// Such curves that were not chosen so far.
    curves: Vec<Candidate>,
    /// Such curves that were held and did not pay, and what has sizes that are no physics: they are asked about no more.
    let_go: Vec<usize>,
    /// Candidates that are not searched in this round: far from being of use when all were.
    idle: Vec<usize>,
    /// Those of the last round among all.
    last_idle: Vec<usize>,
    /// How many parameters of the arm the data determine, where curves were shrunk: standard deviations are those of the fit before.
    determined: Option<f64>,
    /// How the noise is correlated, beside what was chosen.
    pub(crate) correlation: CorrelatedNoise,
    pub(crate) untestable: Vec<Untestable>,
    /// What to look at where readings are not what their columns say.
    pub(crate) read_otherwise: Option<String>,
    /// What the data hardly determine, in a sentence each.
    pub(crate) hardly_determined: Vec<String>,
    /// Whether each reading spreads beyond the noise, so far as the fit tells.
    spread: [bool; 3],
    /// Terms about the readings' own noise, and which of them are in the baseline.
    nuisances: Vec<Candidate>,
    fitted_nuisances: Vec<bool>,
}

/// What may explain the residuals.
struct Explanation {
    chosen: Vec<usize>,
    correlation: CorrelatedNoise,
    /// How likely the residuals are with it.
    nats: f64,
    /// Correlations of the noise beside which effects were chosen.
    tried: Vec<CorrelatedNoise>,
}

/// What a round of the search came to.
struct Round {
    chosen: Vec<usize>,
    correlation: CorrelatedNoise,
    fitted: Identified,
    known: Vec<PriorKnowledge>,
}

impl Round {
    /// How many rows it kept.
    fn rows_kept(&self) -> usize {
        self.fitted.data.observations.len()
    }

    /// Whether another one chose the same: effects and places, from the same rows; `candidates` are those of both.
    fn is_as(&self, other: &Self, candidates: &[Candidate]) -> bool {
        let alike = |a: usize| other.chosen.iter().any(|b| a == *b || candidates[a].is_alike(&candidates[*b]));
        self.rows_kept() == other.rows_kept()
            && self.chosen.len() == other.chosen.len()
            && self.chosen.iter().all(|a| alike(*a))
    }
}

impl Rounds {
    /// Rejects gross errors, fits the baseline, and lists the candidates that this data can be asked about.
    pub(crate) fn begin(robot: &Robot, cell: &Cell, data: &Dataset, options: &Options) -> Result<Self> {
        refuse_stuck_stems(robot, cell, data)?;
        let fresh = rejection::without_stale(data);
        let good = reject_gross_errors_beyond(robot, cell, &fresh, GROSS_ERROR_SIGMAS)?;
        let rows: BTreeSet<usize> = good.observations.iter().map(|o| o.row).collect();
        let gross = fresh.filtered(|o| !rows.contains(&o.row));
        let (mut all, readings) = averaged(&good);
        let whole = sample_poses(&all, SEARCHED_POSES, RUN_POSES).map(|some| std::mem::replace(&mut all, some));
        let choice = Choice::from(BASELINE).knowing(options.known.clone());
        let own = own_setup(robot, cell, &all, &choice, options.tool)?;
        let choice = choice.with_own(own);
        let (robot, choice, _) = choose(robot, cell, &all, &choice)?;
        let fitted = identify(&robot, cell, &all, choice)?;
        refuse_no_arm(BASELINE, ErrorSummary::of(&fitted.errors()?))?;
        let mut known = fitted.known.clone();
        known.resize(fitted.model.terms.len(), PriorKnowledge::NOTHING);
        // an effect of the load times a compliance could be anything, were the compliance so
        let is_lax = |k: &PriorKnowledge| k.prior.is_none_or(|p| p.value == 0.0 && p.sd > SOFTEST);
        for (t, k) in fitted.model.terms.iter().zip(&mut known) {
            if t.gives_way().is_some() && is_lax(k) {
                k.prior = PriorKnowledge::about_zero(SOFTEST).prior;
            }
        }
        let nominal = [held(&robot, &fitted.data, &fitted.held()), near_nominal(&fitted.kept_near_nominal())];
        let params = LmParams { huber: manner(&fitted.model, &all).1.huber, ..LmParams::WITHIN_NOISE };
        let sigma = touch_sigma(&fitted);
        let read_otherwise = read_otherwise(&fitted);
        // readings that are not what their columns say leave so much that they look nulled beside it
        let deflected = read_otherwise.is_some();
        let recorded = Covariates::new(&fitted.model, &all, sigma).deflected(deflected);
        let (spread, nuisances) = (recorded.spread, reading_noise(&recorded));
        let mut rounds = Self {
            kept: all.clone(),
            all,
            gross,
            whole,
            readings,
            plain: sigma,
            baseline_terms: fitted.model.terms.len(),
            known,
            params,
            candidates: Vec::new(),
            chosen: Vec::new(),
            held: Vec::new(),
            curves: Vec::new(),
            let_go: Vec::new(),
            idle: Vec::new(),
            last_idle: Vec::new(),
            determined: None,
            correlation: CorrelatedNoise::WHITE,
            untestable: Vec::new(),
            read_otherwise: None,
            hardly_determined: nominal.into_iter().flatten().collect(),
            spread,
            fitted_nuisances: vec![false; nuisances.len()],
            nuisances,
            fitted,
        };
        let turned =
            device_orientation(&Covariates::new(&rounds.fitted.model, &rounds.all, sigma).deflected(deflected));
        // where poses were measured, too, the tool's direction is known
        let is_known = |t: &Term| rounds.fitted.model.terms.iter().any(|m| m.site == t.site && m.basis == t.basis);
        if let Some(term) = turned.filter(|t| !is_known(t)) {
            rounds.add_to_baseline(vec![term])?;
        }
        rounds.fit_reading_noise()?;
        let of_sessions = Covariates::of_sessions(&rounds.fitted.model, &rounds.all, sigma);
        (rounds.candidates, rounds.untestable) =
            catalogue(&Covariates::new(&rounds.fitted.model, &rounds.all, sigma).deflected(deflected), &of_sessions);
        rounds.read_otherwise = read_otherwise;
        (rounds.curves, rounds.candidates) = rounds.candidates.into_iter().partition(Candidate::is_long_curve);
        if !options.names_only {
            rounds.candidates.extend(locators(&rounds.fitted.model, &rounds.all));
        }
        rounds.resize();
        Ok(rounds)
    }

    /// Sizes that are a share of something fitted (a soft joint's, of its compliance), as it is fitted now, with a standard deviation
    /// added: a baseline without the effect has taken up some of it.
    fn resize(&mut self) {
        let mut model = self.fitted.model.clone();
        for t in model.terms.iter_mut().filter(|t| t.gives_way().is_some()) {
            t.value = t.value.abs() + t.sd.unwrap_or(0.0);
        }
        let soft = EffectId::NonlinearStiffness.effect();
        let now = (soft.ask)(&Covariates::new(&model, &self.all, touch_sigma(&self.fitted))).candidates;
        for c in self.candidates.iter_mut().filter(|c| c.cause == soft.id.into()) {
            if let Some(now) = now.iter().find(|n| n.terms[0].name == c.terms[0].name) {
                c.scales.clone_from(&now.scales);
                c.typical = now.typical;
            }
        }
    }

    /// Rounds of search and exact refit until the choice stays as it is. What was chosen is where the next round linearizes, so that
    /// two choices may each lead to the other: then the likelier one is taken. Between a first and a last round among all candidates
    /// only those are searched that were of use, or nearly, in the round among all before (as a working set's). `anew`: effects are also
    /// chosen from nothing on, or else what was chosen so far is the first of the rounds. A round that takes a smaller share than `least` off what
    /// is left is the last; returns whether it took less than [`SETTLED_SHARE`].
    pub(crate) fn settle(&mut self, anew: bool, least: f64, task: &Task<'_>) -> Result<bool> {
        let mut is_exact = true;
        let mut rounds: Vec<Round> = if anew { Vec::new() } else { vec![self.round()] };
        for round in 0..MOST_ROUNDS {
            checkpoint()?;
            task.step(round as f64 / MOST_ROUNDS as f64, "searching")?;
            self.kept = rejection::without_outliers(&self.fitted, &self.all)?;
            checkpoint()?;
            self.add(periodogram::ripples(&self.fitted, &self.kept)?);
            checkpoint()?;
            let before = (self.chosen.clone(), self.correlation);
            let among_all = self.idle.is_empty();
            let idle = self.choose(rounds.is_empty(), among_all)?;
            if among_all {
                self.last_idle.clone_from(&idle);
            }
            let chosen: Vec<&Candidate> = self.chosen.iter().map(|c| &self.candidates[*c]).collect();
            self.add(finer(&chosen, &self.candidates, &self.kept));
            if self.refit().is_err() {
                // the exact fit does not follow the linear picture: what was there before stays
                (self.chosen, self.correlation) = (before.0, before.1);
                self.refit()?;
                break;
            }
            self.let_go_of_impossible()?;
            self.resize();
            // with the effects out of the way the readings' noise may show
            if self.ask_readings()? | self.fit_reading_noise()? {
                rounds.clear();
                self.idle.clear();
                continue;
            }
            let new = self.round();
            let been_there = rounds.iter().any(|r| r.is_as(&new, &self.candidates));
            let best = rounds.iter().map(|r| touch_sigma(&r.fitted)).fold(f64::INFINITY, f64::min);
            let gained_less = |share: f64| been_there || self.touch_sigma() > best * (1.0 - share);
            is_exact = gained_less(SETTLED_SHARE);
            rounds.push(new);
            match (gained_less(if among_all { least } else { SETTLED_AMONG_FEW }), among_all) {
                (true, true) => break,
                (true, false) => self.idle.clear(),
                (false, true) => self.idle = idle,
                (false, false) => {}
            }
        }
        self.idle.clear();
        self.take_likeliest(rounds)?;
        Ok(is_exact)
    }

    /// Goes back to the likeliest of some rounds, of those that kept the same rows as the last one.
    fn take_likeliest(&mut self, mut rounds: Vec<Round>) -> Result<()> {
        let Some(last) = rounds.pop() else { return Ok(()) };
        rounds.retain(|r| r.rows_kept() == last.rows_kept() && !r.is_as(&last, &self.candidates));
        if rounds.is_empty() {
            return Ok(());
        }
        rounds.insert(0, last);
        let mut best = (f64::NEG_INFINITY, 0);
        for (k, round) in rounds.iter().enumerate() {
            // all with the present noise, or they could not be compared
            let nats = self.nats(&round.fitted.model, &self.members(&round.chosen), round.correlation)?;
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
            correlation: self.correlation,
            fitted: self.fitted.clone(),
            known: self.known.clone(),
        }
    }

    fn go_back(&mut self, to: Round) {
        (self.chosen, self.correlation, self.fitted, self.known) = (to.chosen, to.correlation, to.fitted, to.known);
    }

    /// How likely the residuals are if `candidates` are all that happens, in the linear picture at a model that was fitted with effects.
    fn nats(&self, model: &Model, candidates: &[Candidate], correlation: CorrelatedNoise) -> Result<f64> {
        Ok(self.nats_of(&self.design_at(model, candidates, &[], correlation)?, candidates))
    }

    /// The same of their design.
    fn nats_of(&self, design: &Design, candidates: &[Candidate]) -> f64 {
        let temper = temper(&self.kept);
        let all: Vec<usize> = (0..candidates.len()).collect();
        design.nats(temper) + Search::new(design, candidates, temper).total(&design.start(), &all)
    }

    /// Some of the candidates.
    fn members(&self, set: &[usize]) -> Vec<Candidate> {
        set.iter().map(|c| self.candidates[*c].clone()).collect()
    }

    /// Frequencies faster than any gear; and names lose their privilege where a place does more than its name says, or where
    /// it took two terms to say it: two effects at one joint are a coincidence. Whether there is anything new to try.
    pub(crate) fn widen(&mut self) -> Result<bool> {
        let before = self.candidates.len();
        let fast = self.fast_waves()?;
        self.add(fast.clone());
        let mut new = self.candidates.len() > before;
        let (design, probes) = self.design_with_probes(&fast)?;
        let test = self.specification_test(&design, &probes);
        let search = self.searcher(&design);
        let start = design.start();
        let state = search.with(&start, &self.chosen);
        let mut places: Vec<Place> = Vec::new();
        for m in test.places(&state).into_iter().filter(|m| m.p_value < LACK_OF_FIT_P) {
            let rest: Vec<usize> =
                self.chosen.iter().copied().filter(|c| !m.site.is_same_part(self.candidates[*c].site)).collect();
            let without = search.among(&start, &rest, |few, start| few.with(start, &rest).ss);
            if m.dss > CONSIDERABLE_SHARE * (without - state.ss) {
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
            let log_prior = -libm::log(count.max(1) as f64);
            for c in self.candidates.iter_mut().filter(|c| here(c)) {
                c.log_prior = log_prior;
                new = true;
            }
        }
        Ok(new)
    }

    /// Chooses what explains the residuals: effects beside white noise, or fewer beside correlated noise. A slow effect that is not
    /// modelled looks like such noise, and such noise like slow effects, whichever is asked first; at `first` both are, from nothing on, and
    /// `among_all` candidates white noise is asked once more.
    /// Returns candidates that are far from being of use beside what was chosen.
    fn choose(&mut self, first: bool, among_all: bool) -> Result<Vec<usize>> {
        let mut design = self.design(&self.searched(), &[], self.correlation)?;
        let mut best = self.explanation(&mut design, self.correlation, &self.chosen)?;
        let starts = match (first, among_all) {
            (true, _) => vec![(CorrelatedNoise::WHITE, Vec::new()), (self.noise_beside(&[])?.0, Vec::new())],
            // beside what was found since, less may look like such noise
            (false, true) => vec![(CorrelatedNoise::WHITE, best.chosen.clone())],
            (false, false) => Vec::new(),
        };
        for (start, initial) in starts {
            if best.tried.contains(&start) {
                continue;
            }
            let other = self.explanation(&mut design, start, &initial)?;
            best.tried.extend(&other.tried);
            if other.nats > best.nats {
                best = Explanation { tried: best.tried, ..other };
            }
        }
        design.set_noise(best.correlation, &self.kept);
        let idle = self.searcher(&design).idle(&design.start(), &best.chosen);
        (self.chosen, self.correlation) = (best.chosen, best.correlation);
        Ok(idle)
    }

    /// Effects and correlation of the noise, each chosen beside the other in turn from `correlation` on; `design` has all candidates.
    fn explanation(&self, design: &mut Design, correlation: CorrelatedNoise, initial: &[usize]) -> Result<Explanation> {
        let mut best =
            Explanation { chosen: initial.to_vec(), correlation, nats: f64::NEG_INFINITY, tried: Vec::new() };
        let mut next = correlation;
        while !best.tried.contains(&next) && best.tried.len() < NOISE_ALTERNATIONS {
            checkpoint()?;
            best.tried.push(next);
            design.set_noise(next, &self.kept);
            let chosen = self.searcher(design).choose(&design.start(), &best.chosen);
            let (correlation, nats) = self.noise_beside(&chosen)?;
            next = correlation;
            if nats >= best.nats {
                (best.chosen, best.correlation, best.nats) = (chosen, correlation, nats);
            }
        }
        Ok(best)
    }

    /// How the noise is most likely correlated if `set` is all that happens, and how likely both are, nats.
    fn noise_beside(&self, set: &[usize]) -> Result<(CorrelatedNoise, f64)> {
        let candidates = self.members(set);
        let mut design = self.design(&candidates, &[], CorrelatedNoise::WHITE)?;
        CorrelatedNoise::likeliest(longest_recording(&self.kept), |correlation| {
            checkpoint()?;
            design.set_noise(correlation, &self.kept);
            Ok(self.nats_of(&design, &candidates))
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
    fn design(
        &self,
        candidates: &[Candidate],
        weights: &[Vec<Vec<f64>>],
        correlation: CorrelatedNoise,
    ) -> Result<Design> {
        self.design_at(&self.fitted.model, candidates, weights, correlation)
    }

    /// A fit of baseline and effects, for linearization.
    fn baseline_of<'a>(&'a self, model: &'a Model) -> Fitted<'a> {
        let n = self.baseline_terms;
        Fitted { model, known: &self.known[..n], parameters: n, effects: n }
    }

    /// The same where another fit of baseline and effects is.
    fn design_at(
        &self,
        model: &Model,
        candidates: &[Candidate],
        weights: &[Vec<Vec<f64>>],
        correlation: CorrelatedNoise,
    ) -> Result<Design> {
        let held: usize = self.held.iter().map(|c| self.candidates[*c].terms.len()).sum();
        let fitted = Fitted { effects: self.baseline_terms + held, ..self.baseline_of(model) };
        Design::weighted(fitted, candidates, weights, &self.kept, &self.fitted.noise, correlation)
    }

    /// Errors that repeat faster than any gear turns, the strongest of each joint.
    pub(crate) fn fast_waves(&self) -> Result<Vec<Candidate>> {
        periodogram::fast(&self.fitted, &self.kept)
    }

    /// With all candidates, and probes behind them, those of `fast` waves too.
    pub(crate) fn design_with_probes(&self, fast: &[Candidate]) -> Result<(Design, Probes)> {
        let mut probes = probes(&self.fitted.model, &self.kept);
        periodogram::ask_for(fast, &self.fitted, &mut probes);
        let mut all = self.searched();
        all.extend(probes.candidates.iter().cloned());
        let mut weights = vec![Vec::new(); self.candidates.len()];
        weights.extend(probes.weights.iter().cloned());
        Ok((self.design(&all, &weights, self.correlation)?, probes))
    }

    pub(crate) fn searcher<'a>(&'a self, design: &'a Design) -> Search<'a> {
        Search::new(design, &self.candidates, temper(&self.kept)).without_candidates(&self.said_by_curves())
    }

    pub(crate) fn specification_test<'a>(&self, design: &'a Design, probes: &'a Probes) -> SpecificationTest<'a> {
        SpecificationTest { design, probes, first: self.candidates.len(), temper: temper(&self.kept) }
    }

    /// Terms about the readings' own noise that were fitted.
    pub(crate) fn reading_noise(&self) -> impl Iterator<Item = &Candidate> {
        self.nuisances.iter().zip(&self.fitted_nuisances).filter(|(_, fitted)| **fitted).map(|(n, _)| n)
    }

    pub(crate) fn touch_sigma(&self) -> f64 {
        touch_sigma(&self.fitted)
    }

    /// The exact joint fit of the baseline and what was chosen, held curves as they are.
    fn refit(&mut self) -> Result<()> {
        self.refit_with(false)
    }

    /// The same; with `curves` of held curves too.
    fn refit_with(&mut self, curves: bool) -> Result<()> {
        let mut model = self.bare();
        let mut known = self.known[..self.baseline_terms].to_vec();
        for c in self.held.iter().chain(&self.chosen).map(|c| &self.candidates[*c]) {
            for (t, sd) in c.terms.iter().zip(&c.scales) {
                let mut term: Term = t.clone();
                if let Some(fitted) = self.fitted.model.terms[self.baseline_terms..].iter().find(|m| m.does_as(t)) {
                    (term.value, term.sd) = (fitted.value, fitted.sd);
                }
                if !c.is_long_curve() && model.terms.iter().any(|o| o.name == term.name) {
                    let copies = model.terms.iter().filter(|o| o.name.starts_with(&term.name)).count();
                    term.name = format!("{}_{}", term.name, copies + 1);
                }
                model.terms.push(term);
                known.push(PriorKnowledge::about_zero(*sd));
            }
        }
        let held: usize = self.held.iter().map(|c| self.candidates[*c].terms.len()).sum();
        let fixed = self.baseline_terms..self.baseline_terms + if curves { 0 } else { held };
        let free: Vec<usize> = (0..model.terms.len()).filter(|k| !fixed.contains(k)).collect();
        let of_free: Vec<PriorKnowledge> = free.iter().map(|k| known[*k]).collect();
        let noise = &self.fitted.noise;
        self.fitted = fit_some(model, free, &self.kept, noise, &of_free, Vec::new(), &self.params)?;
        self.known = known;
        Ok(())
    }

    /// The candidates that are searched: held curves without their columns.
    fn searched(&self) -> Vec<Candidate> {
        let mut all = self.candidates.clone();
        for c in self.held.iter().chain(&self.let_go).chain(&self.idle) {
            all[*c] = Candidate { terms: Vec::new(), signs: Vec::new(), scales: Vec::new(), ..all[*c].clone() };
        }
        all
    }

    /// What halves of the data say, each searched by itself among what was chosen and what was of use or nearly.
    pub(crate) fn halves(&self) -> Result<Halves> {
        let asked = |c: &usize| self.chosen.contains(c) || !(self.last_idle.contains(c) || self.let_go.contains(c));
        let some: Vec<usize> = (0..self.candidates.len()).filter(asked).collect();
        Halves::search(
            self.baseline_of(&self.fitted.model),
            &self.members(&some),
            &self.kept,
            &self.fitted.noise,
            self.temper(),
        )
    }

    /// Share of the rows that is independent.
    pub(crate) fn temper(&self) -> f64 {
        temper(&self.kept)
    }

    /// How many of the parameters of the arm the data determine: one for each without a prior, for each with one the share of
    /// its prior's variance that the data removed.
    pub(crate) fn effective_parameters(&self) -> f64 {
        if let Some(determined) = self.determined {
            return determined;
        }
        let terms = self.fitted.model.terms.iter().zip(&self.known).filter(|(t, _)| is_parameter_of_arm(t));
        terms
            .map(|(t, k)| match (k.prior, t.sd) {
                (Some(prior), Some(sd)) => 1.0 - (sd / prior.sd).powi(2).min(1.0),
                _ => 1.0,
            })
            .sum()
    }

    /// Puts terms behind those of the baseline, and fits again.
    fn add_to_baseline(&mut self, terms: Vec<Term>) -> Result<()> {
        let at = self.baseline_terms;
        self.baseline_terms += terms.len();
        self.known.splice(at..at, vec![PriorKnowledge::NOTHING; terms.len()]);
        self.fitted.model.terms.splice(at..at, terms);
        self.refit()
    }
}

/// Whether a term is a parameter of the arm, its base or its tool: not of a measuring frame, a target, or where balls stood, and not of the
/// readings' own noise.
pub(crate) fn is_parameter_of_arm(t: &Term) -> bool {
    let of_readings = [Cause::ReadingNoise.name(), Cause::JointReadingNoise.name()].contains(&t.effect.as_str());
    !matches!(t.site, Site::Frame { .. } | Site::Target { .. }) && t.effect != "place" && !of_readings
}

/// Parameters of the arm, without those of the readings' own noise.
pub(crate) fn arm_parameters(model: &Model) -> usize {
    model.terms.iter().filter(|t| is_parameter_of_arm(t)).count()
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
fn temper(data: &Dataset) -> f64 {
    (6.0 * data.used_poses().len() as f64 / data.scalars() as f64).min(1.0)
}

#[cfg(test)]
mod tests;
