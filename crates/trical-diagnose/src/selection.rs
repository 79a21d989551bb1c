//! Which candidates the residual asks for: ranking by an extended Bayesian criterion (Chen & Chen 2008), forward selection,
//! pair and swap check, backward elimination.

use crate::candidate::Candidate;
use crate::linear::{Company, Design, Stage, Without};
use rayon::prelude::*;
use trical_model::Place;
use trical_model::interrupt::stop_wanted;

/// A candidate must better the criterion by this many nats. With the prior spread over all candidates, of 300 effect-free data sets of the
/// proof none passes it.
pub const THRESHOLD: f64 = 2.0;

/// Most effects that are looked for.
const MOST: usize = 40;

/// Candidates looked at as second members of a pair.
const PAIR_SHORTLIST: usize = 24;

/// Of a ranking, so many are sorted before anybody asks for more.
const FIRST: usize = 64;

/// Pairs are merged among at most so many.
const MERGED: usize = 12;

/// Evidence that differs by less, nats, is the same: rounding must not decide between columns that are (steps between which no row
/// is left).
const SAME: f64 = 1e-6;

/// Leaner candidates that are tried, with another one, in the place of a rich one.
const LEANER: usize = 3;

/// A member of a set, with what could be in its place.
struct Member {
    own: usize,
    /// Its evidence, the others being there.
    now: f64,
    best: Option<Ranked>,
    lean: Vec<Ranked>,
    /// The stage with the others.
    without: Without,
}

/// The search on one design.
pub struct Search<'a> {
    /// The linear picture.
    pub design: &'a Design,
    /// The candidates, as the design has them.
    pub candidates: &'a [Candidate],
    /// Fewer independent scalars than rows: several targets seen at one pose share what moves the arm.
    pub temper: f64,
    /// Candidates that turned out to be no physics.
    banned: Vec<usize>,
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

#[expect(clippy::cast_precision_loss, reason = "counts")]
impl<'a> Search<'a> {
    /// Among all candidates.
    #[must_use]
    pub fn new(design: &'a Design, candidates: &'a [Candidate], temper: f64) -> Self {
        Self { design, candidates, temper, banned: Vec::new() }
    }

    /// Independent scalars left at a stage.
    #[must_use]
    pub fn freedom(&self, stage: &Stage) -> f64 {
        (self.design.rows as f64 * self.temper - stage.parameters).max(1.0)
    }

    /// Evidence of a candidate at a stage, nats; signs that physics forbids have none.
    #[must_use]
    pub fn evidence(&self, stage: &Stage, candidate: usize) -> Option<Ranked> {
        let gain = self.design.gain(stage, candidate);
        if gain.rank < 1e-3 {
            return None;
        }
        let n = self.freedom(stage);
        let share = (gain.dss / stage.ss).min(1.0 - 1e-12);
        let evidence = -0.5 * n * (1.0 - share).ln() - gain.occam + self.candidates[candidate].log_prior;
        Some(Ranked { candidate, evidence, dss: gain.dss, rank: gain.rank })
    }

    fn plausible(&self, stage: &Stage, candidate: usize) -> bool {
        let own = &self.candidates[candidate];
        if own.signs.iter().all(|s| *s == 0) && own.terms.len() == 1 {
            return true;
        }
        let c = self.design.coefficients(stage, candidate);
        let largest = c.iter().map(|v| v.abs()).fold(0.0, f64::max);
        // a coefficient of the wrong sign counts only if it is not a small part of the whole
        own.signs.iter().zip(&c).all(|(s, v)| *s == 0 || f64::from(*s) * v >= -0.2 * largest) && (own.physical)(&c)
    }

    /// All candidates at a stage, best first; those with forbidden signs left out.
    #[must_use]
    pub fn rank(&self, stage: &Stage) -> Vec<Ranked> {
        self.best(stage).collect()
    }

    /// As [`Search::rank`], one after the other: most questions end with the first.
    fn best<'s>(&'s self, stage: &'s Stage) -> impl Iterator<Item = Ranked> + 's {
        let mut all: Vec<Ranked> = (0..self.candidates.len())
            .into_par_iter()
            .with_min_len(256)
            .filter_map(|c| self.evidence(stage, c))
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
        .filter(|(k, r)| !self.banned.contains(&r.candidate) && (*k > 200 || self.plausible(stage, r.candidate)))
        .map(|(_, r)| r)
    }

    /// The stage with a set of candidates added.
    #[must_use]
    pub fn with(&self, start: &Stage, set: &[usize]) -> Stage {
        self.design.prepare(set);
        let mut stage = start.clone();
        for c in set {
            self.design.add(&mut stage, *c);
        }
        stage
    }

    /// The stage of a company without some of its set.
    #[must_use]
    pub fn without(&self, company: &Company<'_>, start: &Stage, own: &[usize]) -> Without {
        let rest: Vec<usize> = company.set().iter().copied().filter(|c| !own.contains(c)).collect();
        self.among(start, &rest, |few, start| company.without(own, &few.with(start, &rest)))
    }

    /// Whether two candidates are one effect at one site, differing in a scan point only.
    #[must_use]
    pub fn same_place(&self, a: usize, b: usize) -> bool {
        self.candidates[a].cause == self.candidates[b].cause && self.candidates[a].site == self.candidates[b].site
    }

    /// Evidence of a whole set over the start, nats.
    #[must_use]
    pub fn total(&self, start: &Stage, set: &[usize]) -> f64 {
        self.among(start, set, |few, start| {
            let mut stage = start.clone();
            let mut sum = 0.0;
            for c in set {
                match few.evidence(&stage, *c) {
                    Some(r) => sum += r.evidence,
                    None => return f64::NEG_INFINITY,
                }
                few.design.add(&mut stage, *c);
            }
            sum
        })
    }

    /// What `ask` says of the search and the stage with the columns of `set` only: for questions in which no other candidate
    /// has a part.
    pub(crate) fn among<T>(&self, stage: &Stage, set: &[usize], ask: impl FnOnce(&Search<'_>, &Stage) -> T) -> T {
        let (design, stage) = self.design.narrowed(stage, set);
        let few = Search::new(&design, self.candidates, self.temper);
        ask(&few, &stage)
    }

    /// Chooses a set, in the order of selection.
    #[must_use]
    pub fn choose(&mut self, start: &Stage, initial: &[usize]) -> Vec<usize> {
        let mut chosen: Vec<usize> = initial.to_vec();
        for _ in 0..3 {
            let before = chosen.clone();
            self.drop_implausible(start, &mut chosen);
            self.forward(start, &mut chosen);
            if chosen.len() <= 1 {
                self.try_pairs(start, &mut chosen);
                self.forward(start, &mut chosen);
            }
            self.swap(start, &mut chosen);
            self.merge(start, &mut chosen);
            self.merge_places(start, &mut chosen);
            self.backward(start, &mut chosen);
            if chosen == before {
                break;
            }
        }
        while self.drop_implausible(start, &mut chosen) {
            self.forward(start, &mut chosen);
        }
        chosen
    }

    /// What was physics alone need not be beside what was found since: it goes, and does not come back in this search.
    fn drop_implausible(&mut self, start: &Stage, chosen: &mut Vec<usize>) -> bool {
        let mut bad = None;
        self.among(start, chosen, |few, start| {
            few.without_each(start, chosen, &mut |own, stage| {
                // one at a time: without it the others may be
                if bad.is_none() && !few.plausible(stage, own) {
                    bad = Some(own);
                }
            });
        });
        if let Some(bad) = bad {
            chosen.retain(|c| *c != bad);
            self.banned.push(bad);
        }
        bad.is_some()
    }

    fn forward(&self, start: &Stage, chosen: &mut Vec<usize>) {
        let mut stage = self.with(start, chosen);
        // asked to stop, whatever was chosen will not be used
        while chosen.len() < MOST && !stop_wanted() {
            let Some(best) = self.best(&stage).find(|r| !chosen.contains(&r.candidate)) else { break };
            if best.evidence < THRESHOLD {
                break;
            }
            self.design.add(&mut stage, best.candidate);
            chosen.push(best.candidate);
        }
    }

    /// Two effects can hide each other: the best pairs of a shortlist, against what was chosen.
    fn try_pairs(&self, start: &Stage, chosen: &mut Vec<usize>) {
        let first: Vec<usize> = {
            let mut seen: Vec<usize> = Vec::new();
            for r in self.best(start) {
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
        let mut best = (self.total(start, chosen).max(0.0) + THRESHOLD, chosen.clone());
        for a in &first {
            let Some(one) = self.evidence(start, *a) else { continue };
            let stage = self.with(start, &[*a]);
            if let Some(two) = self.best(&stage).find(|r| r.candidate != *a)
                && one.evidence + two.evidence > best.0
                && two.evidence > THRESHOLD
            {
                best = (one.evidence + two.evidence, vec![*a, two.candidate]);
            }
        }
        *chosen = best.1;
    }

    /// For every member of a set, the stage with all the others added: by halves, so that members share their company's
    /// work (n log n additions instead of n^2).
    fn without_each(&self, stage: &Stage, set: &[usize], visit: &mut dyn FnMut(usize, &Stage)) {
        match set {
            _ if stop_wanted() => {}
            [] => {}
            [one] => visit(*one, stage),
            _ => {
                let (a, b) = set.split_at(set.len() / 2);
                self.without_each(&self.with(stage, b), a, visit);
                self.without_each(&self.with(stage, a), b, visit);
            }
        }
    }

    /// Replaces chosen candidates by better ones: one by one, or a rich one by two leaner ones that together say more (a
    /// twist hides in a wobble, but is one number instead of four).
    fn swap(&self, start: &Stage, chosen: &mut Vec<usize>) {
        for _ in 0..2 {
            let set = chosen.clone();
            let mut company = Company::new(self.design, start, &set);
            let mut likes: Vec<(usize, Stage)> = Vec::new();
            self.among(start, &set, |few, start| {
                few.without_each(start, &set, &mut |own, like| likes.push((own, like.clone())));
            });
            let members: Vec<Member> = likes
                .into_par_iter()
                .filter_map(|(own, like)| self.asked(own, company.without(&[own], &like), &set))
                .collect();
            if stop_wanted() {
                return;
            }
            company.prepare(&members.iter().flat_map(|m| m.lean.iter().map(|r| r.candidate)).collect::<Vec<_>>());
            let mut wishes: Vec<(f64, usize, Vec<usize>)> =
                members.par_iter().flat_map_iter(|m| self.wishes(&company, m, &set)).collect();
            // the best wish first; wishes that were made beside each other are checked together
            wishes.sort_by(|a, b| whole(b.0).total_cmp(&whole(a.0)).then(a.1.cmp(&b.1)));
            let mut changed = false;
            for (_, own, new) in wishes.into_iter().take(6) {
                if !chosen.contains(&own) || new.iter().any(|n| chosen.contains(n)) {
                    continue;
                }
                let mut proposal: Vec<usize> = chosen.iter().filter(|c| **c != own).copied().collect();
                proposal.extend(new);
                if self.total(start, &proposal) > self.total(start, chosen) + SAME {
                    *chosen = proposal;
                    changed = true;
                }
            }
            if !changed {
                break;
            }
        }
    }

    /// What could be in the place of a member of a set, at a stage without it.
    fn asked(&self, own: usize, without: Without, set: &[usize]) -> Option<Member> {
        let now = self.evidence(&without.stage, own)?.evidence;
        let size = |k: usize| self.candidates[k].terms.len();
        let wanted = if size(own) > 1 { LEANER } else { 0 };
        let (mut best, mut lean) = (None, Vec::new());
        for r in self.best(&without.stage) {
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
    fn wishes(&self, company: &Company<'_>, member: &Member, set: &[usize]) -> Vec<(f64, usize, Vec<usize>)> {
        let Member { own, now, best, lean, without } = member;
        let mut wishes = Vec::new();
        if let Some(best) = best
            && best.candidate != *own
            && best.evidence > now + SAME
        {
            wishes.push((best.evidence - now, *own, vec![best.candidate]));
        }
        for first in lean {
            let after = company.with(without, first.candidate);
            let second = self.best(&after).find(|r| !set.contains(&r.candidate));
            if let Some(second) = second
                && second.evidence > THRESHOLD
                && first.evidence + second.evidence > now + SAME
            {
                let gain = first.evidence + second.evidence - now;
                wishes.push((gain, *own, vec![first.candidate, second.candidate]));
            }
        }
        wishes
    }

    /// Replaces two chosen candidates, or all of one effect, by one that says as much (drifting indicators are a drifting
    /// tool).
    fn merge(&self, start: &Stage, chosen: &mut Vec<usize>) {
        if chosen.len() > MERGED {
            return;
        }
        loop {
            let mut best: Option<(f64, Vec<usize>)> = None;
            for some in self.mergeable(chosen) {
                let rest: Vec<usize> = chosen.iter().copied().filter(|c| !some.contains(c)).collect();
                let stage = self.with(start, &rest);
                let now = self.total(&stage, &some);
                let one = self.best(&stage).find(|r| !chosen.contains(&r.candidate));
                if let Some(one) = one
                    && one.evidence > now + best.as_ref().map_or(0.0, |b| b.0) + SAME
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
    fn merge_places(&self, start: &Stage, chosen: &mut Vec<usize>) {
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
            let company = Company::new(self.design, start, &set);
            for site in &sites[asked..] {
                asked += 1;
                let (here, rest): (Vec<usize>, Vec<usize>) =
                    set.iter().partition(|c| self.candidates[**c].site == *site);
                if here.len() < 2 {
                    continue;
                }
                let stage = self.without(&company, start, &here).stage;
                let now = self.total(&stage, &here);
                let one = self.best(&stage).find(|r| self.candidates[r.candidate].site == *site);
                if let Some(one) = one
                    && one.evidence > now + SAME
                {
                    *chosen = rest;
                    chosen.push(one.candidate);
                    break;
                }
            }
        }
    }

    /// Drops what no longer earns its place.
    fn backward(&self, start: &Stage, chosen: &mut Vec<usize>) {
        loop {
            let mut worst: Option<(usize, f64)> = None;
            self.among(start, chosen, |few, start| {
                few.without_each(start, chosen, &mut |own, stage| {
                    let evidence = few.evidence(stage, own).map_or(f64::NEG_INFINITY, |r| r.evidence);
                    if worst.is_none_or(|(_, e)| evidence < e - SAME) {
                        worst = Some((own, evidence));
                    }
                });
            });
            match worst {
                Some((own, evidence)) if evidence < THRESHOLD => chosen.retain(|c| *c != own),
                _ => break,
            }
        }
    }
}

/// Evidence in units of [`SAME`].
fn whole(evidence: f64) -> f64 {
    (evidence / SAME).round()
}
