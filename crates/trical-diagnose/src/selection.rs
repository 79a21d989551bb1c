//! Which candidates the residual asks for: ranking by an extended Bayesian criterion (Chen & Chen 2008), forward selection,
//! pair and swap check, backward elimination.

use crate::candidate::Candidate;
use crate::effect_id::{Cause, EffectId};
use crate::linear::{Design, Downdate, Downdated, RegressionState};
use crate::settings::{
    EVIDENCE_NATS, IDLE_NATS, LEANER_FOR_CURVES, LEANER_TRIED, MERGED_AMONG, MOST_EFFECTS, PAIR_SHORTLIST,
    SAME_EVIDENCE_NATS, SWAPS_WEIGHED,
};
use rayon::prelude::*;
use trical_model::Place;
use trical_model::interrupt::stop_wanted;

/// Of a ranking, so many are sorted before anybody asks for more.
const FIRST: usize = 64;

/// Candidates whose inner products are worked out together, before it is known whether they are needed.
const AHEAD: usize = 6;

/// A member of a set, with what could be in its place.
struct Member {
    own: usize,
    /// Its evidence, the others being there.
    now: f64,
    best: Option<Ranked>,
    lean: Vec<Ranked>,
    /// The state with the others.
    without: Downdated,
}

/// The search on one design.
pub struct Search<'a> {
    /// The linear picture.
    pub design: &'a Design,
    /// The candidates, as the design has them.
    pub candidates: &'a [Candidate],
    /// Fewer independent scalars than rows: several targets seen at one pose share what moves the arm.
    pub temper: f64,
    /// Whether each candidate is out of the question: it turned out to be no physics, or what was chosen says it.
    banned: Vec<bool>,
}

/// A candidate with its evidence.
#[derive(Clone, Copy, Debug)]
pub struct Ranked {
    /// Index.
    pub candidate: usize,
    /// Evidence over not adding it, nats.
    pub evidence: f64,
    /// Sum of squares that it removes.
    pub dss: f64,
    /// How many numbers the data would determine.
    pub rank: f64,
}

impl<'a> Search<'a> {
    /// Among all candidates.
    #[must_use]
    pub fn new(design: &'a Design, candidates: &'a [Candidate], temper: f64) -> Self {
        Self { design, candidates, temper, banned: vec![false; candidates.len()] }
    }

    /// The same without some candidates.
    #[must_use]
    pub fn without_candidates(mut self, out: &[usize]) -> Self {
        out.iter().for_each(|c| self.banned[*c] = true);
        self
    }

    /// `initial` with the first `count` candidates at most that forward selection takes beside it, less those of all that do not earn their
    /// place beside the others.
    #[must_use]
    pub fn first(&self, start: &RegressionState, initial: &[usize], count: usize) -> Vec<usize> {
        let mut chosen: Vec<usize> = initial.to_vec();
        self.forward(start, &mut chosen, initial.len() + count);
        self.backward(start, &mut chosen);
        chosen
    }

    /// Independent scalars left at a state.
    #[must_use]
    pub fn freedom(&self, state: &RegressionState) -> f64 {
        (self.design.rows as f64 * self.temper - state.parameters).max(1.0)
    }

    /// Evidence of a candidate at a state, nats; signs that physics forbids have none.
    #[must_use]
    pub fn evidence(&self, state: &RegressionState, candidate: usize) -> Option<Ranked> {
        self.evidence_of(state, candidate, 0.0)
    }

    /// The same of one that removes `least_dss` or more from the sum of squares.
    fn evidence_of(&self, state: &RegressionState, candidate: usize, least_dss: f64) -> Option<Ranked> {
        let gain = self.design.gain_of(state, candidate, least_dss)?;
        if gain.rank < 1e-3 {
            return None;
        }
        let n = self.freedom(state);
        let share = (gain.dss / state.ss).min(1.0 - 1e-12);
        let evidence = -0.5 * n * libm::log(1.0 - share) - gain.occam + self.candidates[candidate].log_prior;
        let scaled = self.scaled_noise(state, candidate);
        // larger noise speaks for no gain that the readings themselves do not ask for
        let evidence = evidence + if evidence > EVIDENCE_NATS { scaled } else { scaled.min(0.0) };
        Some(Ranked { candidate, evidence, dss: gain.dss, rank: gain.rank })
    }

    /// What else changes with the gain `g` of an indicator, nats: its readings have the noise of the residuals, which is `1 + g` times as large with
    /// it. Without this the best of gains would be those that make readings small.
    fn scaled_noise(&self, state: &RegressionState, candidate: usize) -> f64 {
        if !self.scales_noise(candidate) {
            return 0.0;
        }
        let gain = self.design.coefficients(state, candidate).first().copied().unwrap_or(0.0);
        let readings = self.design.rows as f64 / 3.0 * self.temper;
        readings * libm::log1p(gain.clamp(-0.5, 0.5))
    }

    fn scales_noise(&self, candidate: usize) -> bool {
        self.candidates[candidate].cause == EffectId::IndicatorGain.into()
    }

    fn plausible(&self, state: &RegressionState, candidate: usize) -> bool {
        let own = &self.candidates[candidate];
        if own.signs.iter().all(|s| *s == 0) && own.terms.len() == 1 && own.physical.allows_anything() {
            return true;
        }
        let c = self.design.coefficients(state, candidate);
        if own.turns_back(&c) {
            return false;
        }
        // each beside its usual size: an angle and an angle per load have no size in common
        let sizes: Vec<f64> = c.iter().zip(&own.scales).map(|(v, scale)| v / scale).collect();
        let largest = sizes.iter().map(|v| v.abs()).fold(0.0, f64::max);
        // a coefficient of the wrong sign counts only if it is not a small part of the whole
        own.signs.iter().zip(&sizes).all(|(s, v)| *s == 0 || f64::from(*s) * v >= -0.2 * largest)
            && own.physical.allows(&c)
    }

    /// All candidates at a state, best first; those with forbidden signs left out.
    #[must_use]
    pub fn rank(&self, state: &RegressionState) -> Vec<Ranked> {
        self.best(state, f64::NEG_INFINITY).collect()
    }

    /// As [`Search::rank`], one after the other, as far as their evidence is `least` or more (some with less may follow): most questions end with
    /// the first, and most candidates are far from it.
    fn best<'s>(&'s self, state: &'s RegressionState, least: f64) -> impl Iterator<Item = Ranked> + 's {
        // Occam's factor only takes evidence away, and what is as good as `least` in the order may be a little below
        let prior = self.candidates.iter().map(|c| c.log_prior).fold(f64::NEG_INFINITY, f64::max);
        let share = 1.0 - libm::exp(-2.0 * (least - 2.0 * SAME_EVIDENCE_NATS - prior) / self.freedom(state));
        let least_dss = share.max(0.0) * state.ss;
        let mut all: Vec<Ranked> = (0..self.candidates.len())
            .into_par_iter()
            .with_min_len(256)
            .filter(|c| !self.banned[*c])
            // noise may add to what a gain removes
            .filter_map(|c| self.evidence_of(state, c, if self.scales_noise(c) { 0.0 } else { least_dss }))
            .collect();
        let order = |a: &Ranked, b: &Ranked| {
            whole(b.evidence).total_cmp(&whole(a.evidence)).then(a.candidate.cmp(&b.candidate))
        };
        let first = FIRST.min(all.len());
        if first < all.len() {
            all.select_nth_unstable_by(first, order);
        }
        all[..first].sort_unstable_by(order);
        let mut at = 0;
        std::iter::from_fn(move || {
            if at == first {
                all[first..].sort_unstable_by(order);
            }
            at += 1;
            all.get(at - 1).map(|r| (at - 1, *r))
        })
        // plausibility costs a solve: only where it matters
        .filter(|(k, r)| *k > 200 || self.plausible(state, r.candidate))
        .map(|(_, r)| r)
    }

    /// The state with a set of candidates added.
    #[must_use]
    pub fn with(&self, start: &RegressionState, set: &[usize]) -> RegressionState {
        self.design.with(start, set)
    }

    /// The state of a downdate without some of its set.
    #[must_use]
    pub fn without(&self, downdate: &Downdate<'_>, start: &RegressionState, own: &[usize]) -> Downdated {
        let rest: Vec<usize> = downdate.set().iter().copied().filter(|c| !own.contains(c)).collect();
        self.among(start, &rest, |few, start| downdate.without(own, &few.with(start, &rest)))
    }

    /// Whether two candidates are one effect at one site, differing in a scan point only.
    #[must_use]
    pub fn same_place(&self, a: usize, b: usize) -> bool {
        self.candidates[a].is_alike(&self.candidates[b])
    }

    /// Evidence of a whole set over the start, nats.
    #[must_use]
    pub fn total(&self, start: &RegressionState, set: &[usize]) -> f64 {
        self.among(start, set, |few, start| {
            let mut state = start.clone();
            let mut sum = 0.0;
            for c in set {
                match few.evidence(&state, *c) {
                    Some(r) => sum += r.evidence,
                    None => return f64::NEG_INFINITY,
                }
                few.design.add(&mut state, *c);
            }
            sum
        })
    }

    /// What `ask` says of the search and the state with the columns of `set` only: for questions in which no other candidate
    /// has a part.
    pub(crate) fn among<T>(
        &self,
        state: &RegressionState,
        set: &[usize],
        ask: impl FnOnce(&Search<'_>, &RegressionState) -> T,
    ) -> T {
        let (design, state) = self.design.narrowed(state, set);
        let few = Search::new(&design, self.candidates, self.temper);
        ask(&few, &state)
    }

    /// Chooses a set, in the order of selection.
    #[must_use]
    pub fn choose(&mut self, start: &RegressionState, initial: &[usize]) -> Vec<usize> {
        let mut chosen: Vec<usize> = initial.to_vec();
        let mut swapped: Option<Vec<usize>> = None;
        for _ in 0..3 {
            let before = chosen.clone();
            self.drop_implausible(start, &mut chosen);
            self.forward(start, &mut chosen, MOST_EFFECTS);
            if chosen.len() <= 1 {
                self.try_pairs(start, &mut chosen);
                self.forward(start, &mut chosen, MOST_EFFECTS);
            }
            if swapped.as_ref() != Some(&chosen) {
                let is_settled = self.swap(start, &mut chosen, &|_| true);
                swapped = is_settled.then(|| chosen.clone());
            }
            self.merge(start, &mut chosen);
            self.merge_places(start, &mut chosen);
            self.backward(start, &mut chosen);
            if chosen == before {
                break;
            }
        }
        while self.drop_implausible(start, &mut chosen) {
            self.forward(start, &mut chosen, MOST_EFFECTS);
        }
        chosen
    }

    /// What was physics alone need not be beside what was found since: it goes, and does not come back in this search.
    fn drop_implausible(&mut self, start: &RegressionState, chosen: &mut Vec<usize>) -> bool {
        let mut bad = None;
        self.among(start, chosen, |few, start| {
            few.without_each(start, chosen, &mut |own, state| {
                // one at a time: without it the others may be
                if bad.is_none() && !few.plausible(state, own) {
                    bad = Some(own);
                }
            });
        });
        if let Some(bad) = bad {
            chosen.retain(|c| *c != bad);
            self.banned[bad] = true;
        }
        bad.is_some()
    }

    /// Adds the best candidate as long as it earns its place, until there are `most`.
    fn forward(&self, start: &RegressionState, chosen: &mut Vec<usize>, most: usize) {
        let mut state = self.with(start, chosen);
        // asked to stop, whatever was chosen will not be used
        while chosen.len() < most && !stop_wanted() {
            let best = self.best_of_each_place(&state, chosen);
            let Some(first) = best.first() else { break };
            // others may be next, and inner products cost less together
            self.design.prepare(&best);
            self.design.add(&mut state, *first);
            chosen.push(*first);
        }
    }

    /// The best new candidates that earn their place beside `chosen`, at most [`AHEAD`], of each place one.
    fn best_of_each_place(&self, state: &RegressionState, chosen: &[usize]) -> Vec<usize> {
        let mut best: Vec<usize> = Vec::new();
        for r in self.best(state, EVIDENCE_NATS).take_while(|r| r.evidence >= EVIDENCE_NATS).take(FIRST) {
            if !chosen.contains(&r.candidate) && !best.iter().any(|b| self.same_place(*b, r.candidate)) {
                best.push(r.candidate);
            }
            if best.len() == AHEAD {
                break;
            }
        }
        best
    }

    /// Two effects can hide each other: the best pairs of a shortlist, against what was chosen.
    fn try_pairs(&self, start: &RegressionState, chosen: &mut Vec<usize>) {
        let first: Vec<usize> = {
            let mut seen: Vec<usize> = Vec::new();
            for r in self.best(start, f64::NEG_INFINITY) {
                if !seen.iter().any(|s| self.same_place(*s, r.candidate)) {
                    seen.push(r.candidate);
                }
                if seen.len() == PAIR_SHORTLIST {
                    break;
                }
            }
            seen
        };
        self.design.prepare(&first);
        let mut best = (self.total(start, chosen).max(0.0) + EVIDENCE_NATS, chosen.clone());
        for a in &first {
            let Some(one) = self.evidence(start, *a) else { continue };
            let state = self.with(start, &[*a]);
            let least = EVIDENCE_NATS.max(best.0 - one.evidence);
            if let Some(two) = self.best(&state, least).find(|r| r.candidate != *a)
                && one.evidence + two.evidence > best.0
                && two.evidence > EVIDENCE_NATS
            {
                best = (one.evidence + two.evidence, vec![*a, two.candidate]);
            }
        }
        *chosen = best.1;
    }

    /// For every member of a set, the state with all the others added: by halves, so that members share their downdate's
    /// rounds (n log n additions instead of n^2).
    fn without_each(&self, state: &RegressionState, set: &[usize], visit: &mut dyn FnMut(usize, &RegressionState)) {
        match set {
            _ if stop_wanted() => {}
            [] => {}
            [one] => visit(*one, state),
            _ => {
                let (a, b) = set.split_at(set.len() / 2);
                self.without_each(&self.with(state, b), a, visit);
                self.without_each(&self.with(state, a), b, visit);
            }
        }
    }

    /// Those members of a set that earn their place beside all the others, with their coefficients (SI).
    pub(crate) fn each_beside_others(&self, start: &RegressionState, set: &[usize]) -> Vec<(usize, Vec<f64>)> {
        let mut all = Vec::new();
        self.among(start, set, |few, start| {
            few.without_each(start, set, &mut |own, state| {
                if few.evidence(state, own).is_some_and(|r| r.evidence >= EVIDENCE_NATS) {
                    all.push((own, few.design.coefficients(state, own)));
                }
            });
        });
        all
    }

    /// Replaces those chosen candidates that are `asked` by better ones: one by one, or a rich one by two leaner ones that together say more (a
    /// twist hides in a wobble, but is one number instead of four). Whether nothing is left to replace.
    pub(crate) fn swap(&self, start: &RegressionState, chosen: &mut Vec<usize>, asked: &dyn Fn(usize) -> bool) -> bool {
        (0..2).any(|_| !self.swap_once(start, chosen, asked))
    }

    /// One pass of that: each member is set against what could be in its place while the others stay. Whether something was replaced (also `true`
    /// where the search was asked to stop).
    fn swap_once(&self, start: &RegressionState, chosen: &mut Vec<usize>, asked: &dyn Fn(usize) -> bool) -> bool {
        let set = chosen.clone();
        let mut downdate = Downdate::new(self.design, start, &set);
        let mut likes: Vec<(usize, RegressionState)> = Vec::new();
        self.among(start, &set, |few, start| {
            few.without_each(start, &set, &mut |own, like| {
                if asked(own) {
                    likes.push((own, like.clone()));
                }
            });
        });
        let members: Vec<Member> = likes
            .into_par_iter()
            .filter_map(|(own, like)| self.asked(own, downdate.without(&[own], &like), &set))
            .collect();
        if stop_wanted() {
            return true;
        }
        downdate.prepare(&members.iter().flat_map(|m| m.lean.iter().map(|r| r.candidate)).collect::<Vec<_>>());
        let mut wishes: Vec<(f64, usize, Vec<usize>)> =
            members.par_iter().flat_map_iter(|m| self.wishes(&downdate, m, &set)).collect();
        // the best wish first; wishes that were made beside each other are checked together
        wishes.sort_by(|a, b| whole(b.0).total_cmp(&whole(a.0)).then(a.1.cmp(&b.1)));
        let (mut changed, mut weighed) = (false, 0);
        for (_, own, new) in wishes {
            // many wishes may be of one member: once it is replaced, the rest of them are void
            if !chosen.contains(&own) || new.iter().any(|n| chosen.contains(n)) {
                continue;
            }
            let mut proposal: Vec<usize> = chosen.iter().filter(|c| **c != own).copied().collect();
            proposal.extend(new);
            if self.total(start, &proposal) > self.total(start, chosen) + SAME_EVIDENCE_NATS {
                *chosen = proposal;
                changed = true;
            }
            weighed += 1;
            if weighed == SWAPS_WEIGHED {
                break;
            }
        }
        changed
    }

    /// Candidates that are far from being of use: beside a set, or in the place of one of it, others have at least [`IDLE_NATS`] more.
    #[must_use]
    pub fn idle(&self, start: &RegressionState, set: &[usize]) -> Vec<usize> {
        let downdate = Downdate::new(self.design, start, set);
        let mut used = vec![false; self.candidates.len()];
        set.iter().for_each(|c| used[*c] = true);
        let mut take = |state: &RegressionState, least: f64| {
            for r in self.best(state, least).take_while(|r| r.evidence > least) {
                used[r.candidate] = true;
            }
        };
        take(downdate.full(), EVIDENCE_NATS - IDLE_NATS);
        self.among(start, set, |few, start| {
            few.without_each(start, set, &mut |own, like| {
                let state = downdate.without(&[own], like).state;
                let now = self.evidence(&state, own).map_or(EVIDENCE_NATS, |r| r.evidence);
                take(&state, now.max(EVIDENCE_NATS) - IDLE_NATS);
            });
        });
        (0..used.len()).filter(|c| !used[*c]).collect()
    }

    /// What could be in the place of a member of a set, at a state without it.
    fn asked(&self, own: usize, without: Downdated, set: &[usize]) -> Option<Member> {
        let now = self.evidence(&without.state, own)?.evidence;
        let size = |k: usize| self.candidates[k].terms.len();
        let wanted = if size(own) > 1 { LEANER_TRIED } else { 0 };
        let least = if wanted > 0 { f64::NEG_INFINITY } else { now };
        let (mut best, mut lean) = (None, Vec::new());
        for r in self.best(&without.state, least) {
            let new = !set.contains(&r.candidate);
            if best.is_none() && (new || r.candidate == own) {
                best = Some(r);
            }
            if lean.len() < wanted && new && size(r.candidate) < size(own) {
                lean.push(r);
            }
            if best.is_some() && lean.len() == wanted {
                break;
            }
        }
        Some(Member { own, now, best, lean, without })
    }

    /// Which replacements of a member are better than it, and by how much.
    fn wishes(&self, downdate: &Downdate<'_>, member: &Member, set: &[usize]) -> Vec<(f64, usize, Vec<usize>)> {
        let Member { own, now, best, lean, without } = member;
        let mut wishes = Vec::new();
        if let Some(best) = best
            && best.candidate != *own
            && best.evidence > now + SAME_EVIDENCE_NATS
        {
            wishes.push((best.evidence - now, *own, vec![best.candidate]));
        }
        let curve = self.candidates[*own].cause == Cause::Unexplained || self.candidates[*own].is_long_curve();
        let most = if curve { LEANER_FOR_CURVES } else { 2 };
        // more than two have to be what a name says of the same place
        let here = self.candidates[*own].site;
        let is_long = self.candidates[*own].is_long_curve();
        let hidden = |c: usize| {
            let new = &self.candidates[c];
            (new.cause != Cause::Unexplained || is_long && new.terms.len() == 1) && new.site.is_same_part(here)
        };
        for first in lean {
            let mut state = downdate.with(without, first.candidate);
            let (mut new, mut evidence) = (vec![first.candidate], first.evidence);
            loop {
                let fits = |c: usize| !set.contains(&c) && !new.contains(&c) && (new.len() < 2 || hidden(c));
                // the last is of use only if it makes a wish
                let last = if new.len() + 1 == most { now - evidence } else { EVIDENCE_NATS };
                let next = self.best(&state, last.max(EVIDENCE_NATS)).find(|r| fits(r.candidate));
                let Some(next) = next.filter(|r| r.evidence > EVIDENCE_NATS) else { break };
                new.push(next.candidate);
                evidence += next.evidence;
                if evidence > now + SAME_EVIDENCE_NATS {
                    wishes.push((evidence - now, *own, new.clone()));
                }
                if new.len() == most {
                    break;
                }
                self.design.add(&mut state, next.candidate);
            }
        }
        wishes
    }

    /// Replaces two chosen candidates, or all of one effect, by one that says as much (drifting indicators are a drifting
    /// tool).
    fn merge(&self, start: &RegressionState, chosen: &mut Vec<usize>) {
        if chosen.len() > MERGED_AMONG {
            return;
        }
        loop {
            let mut best: Option<(f64, Vec<usize>)> = None;
            for some in self.mergeable(chosen) {
                let rest: Vec<usize> = chosen.iter().copied().filter(|c| !some.contains(c)).collect();
                let state = self.with(start, &rest);
                let now = self.total(&state, &some);
                let least = now + best.as_ref().map_or(0.0, |b| b.0) + SAME_EVIDENCE_NATS;
                let one = self.best(&state, least).find(|r| !chosen.contains(&r.candidate));
                if let Some(one) = one
                    && one.evidence > least
                {
                    let mut proposal = rest;
                    proposal.push(one.candidate);
                    best = Some((one.evidence - now, proposal));
                }
            }
            match best {
                Some((_, proposal)) => *chosen = proposal,
                None => break,
            }
        }
    }

    /// Pairs, and three or more of one effect.
    fn mergeable(&self, chosen: &[usize]) -> Vec<Vec<usize>> {
        let mut sets: Vec<Vec<usize>> = Vec::new();
        for (i, a) in chosen.iter().enumerate() {
            sets.extend(chosen[..i].iter().map(|b| vec![*b, *a]));
            let cause = self.candidates[*a].cause;
            let alike: Vec<usize> = chosen.iter().copied().filter(|c| self.candidates[*c].cause == cause).collect();
            if alike.len() > 2 && alike[0] == *a {
                sets.push(alike);
            }
        }
        sets
    }

    /// Replaces all that was chosen at one place by a single candidate there, if that says as much.
    fn merge_places(&self, start: &RegressionState, chosen: &mut Vec<usize>) {
        let mut sites: Vec<Place> = Vec::new();
        for c in chosen.iter() {
            let site = self.candidates[*c].site;
            if !sites.contains(&site) {
                sites.push(site);
            }
        }
        sites.retain(|site| chosen.iter().filter(|c| self.candidates[**c].site == *site).count() > 1);
        let mut asked = 0;
        while asked < sites.len() && !stop_wanted() {
            let set = chosen.clone();
            let downdate = Downdate::new(self.design, start, &set);
            for site in &sites[asked..] {
                asked += 1;
                let (here, rest): (Vec<usize>, Vec<usize>) =
                    set.iter().partition(|c| self.candidates[**c].site == *site);
                if here.len() < 2 {
                    continue;
                }
                let state = self.without(&downdate, start, &here).state;
                let now = self.total(&state, &here);
                let one = self.best(&state, now).find(|r| self.candidates[r.candidate].site == *site);
                if let Some(one) = one
                    && one.evidence > now + SAME_EVIDENCE_NATS
                {
                    *chosen = rest;
                    chosen.push(one.candidate);
                    break;
                }
            }
        }
    }

    /// Drops what no longer earns its place.
    fn backward(&self, start: &RegressionState, chosen: &mut Vec<usize>) {
        loop {
            let mut worst: Option<(usize, f64)> = None;
            self.among(start, chosen, |few, start| {
                few.without_each(start, chosen, &mut |own, state| {
                    let evidence = few.evidence(state, own).map_or(f64::NEG_INFINITY, |r| r.evidence);
                    if worst.is_none_or(|(_, e)| evidence < e - SAME_EVIDENCE_NATS) {
                        worst = Some((own, evidence));
                    }
                });
            });
            match worst {
                Some((own, evidence)) if evidence < EVIDENCE_NATS => chosen.retain(|c| *c != own),
                _ => break,
            }
        }
    }
}

/// Evidence in units of [`SAME_EVIDENCE_NATS`].
fn whole(evidence: f64) -> f64 {
    (evidence / SAME_EVIDENCE_NATS).round()
}

#[cfg(test)]
mod tests;
