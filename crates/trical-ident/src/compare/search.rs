//! Which explanations are taken: the best one that chance alone would hardly give, then the next beside it.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::explanation::Explanation;
use super::result::Change;
use super::settings::{CHANGES, CLEARLY_BETTER, FALSE_ALARMS, SHARE, TAILS};
use super::size::sizes;
use super::whitened::{Whitened, extend, project_out};
use crate::dense::dot;

/// What an explanation is worth beside those that were taken.
struct Tried {
    /// Chi-squared with `rank` degrees of freedom if it is not so.
    statistic: f64,
    rank: usize,
    /// In nats.
    evidence: f64,
}

impl Tried {
    /// How often chance alone would give as much.
    fn p_value(&self) -> f64 {
        ChiSquared::new(self.rank as f64).map_or(1.0, |d| d.sf(self.statistic))
    }
}

/// What changed, the surest first.
pub(super) fn changes(whitened: &mut Whitened<'_>) -> Vec<Change> {
    let mut taken: Vec<(usize, Change)> = Vec::new();
    let but = |taken: &[(usize, Change)], own: Option<usize>| -> Vec<usize> {
        taken.iter().map(|t| t.0).filter(|k| Some(*k) != own).collect()
    };
    while taken.len() < CHANGES {
        let beside = Beside::of(whitened, &but(&taken, None));
        let Some(best) = beside.best() else { break };
        taken.push((best, beside.change(best)));
        leave_out_wrong(whitened, &but(&taken, None));
    }
    // an early choice may explain what a later one explains better: try the search without it
    for _ in 0..CHANGES {
        let before = but(&taken, None);
        for own in before.iter().copied() {
            let beside = Beside::of(whitened, &but(&taken, Some(own)));
            match beside.best() {
                None => taken.retain(|t| t.0 != own),
                Some(best) if beside.tried[best].evidence > beside.tried[own].evidence + CLEARLY_BETTER => {
                    let told = beside.change(best);
                    taken.iter_mut().filter(|t| t.0 == own).for_each(|t| *t = (best, told.clone()));
                }
                Some(_) => {}
            }
        }
        if but(&taken, None) == before {
            break;
        }
        leave_out_wrong(whitened, &but(&taken, None));
    }
    let sizes = sizes(whitened, &but(&taken, None));
    taken.into_iter().zip(sizes).map(|((_, change), by)| Change { by, ..change }).collect()
}

/// Measurements that are wrong are not counted in the scatter.
fn leave_out_wrong(whitened: &mut Whitened<'_>, taken: &[usize]) {
    let explanations = &whitened.explained.explanations;
    let wrong: Vec<usize> = taken.iter().copied().filter(|k| !explanations[*k].is_of_machine()).collect();
    whitened.leave_out(&wrong);
}

/// All explanations beside some that were taken.
struct Beside<'a> {
    explanations: &'a [Explanation],
    rows: f64,
    tried: Vec<Tried>,
}

impl<'a> Beside<'a> {
    fn of(whitened: &Whitened<'a>, taken: &[usize]) -> Self {
        let mut basis = Vec::new();
        taken.iter().for_each(|k| {
            extend(&mut basis, &whitened.columns[*k]);
        });
        let tried = tried(whitened, &basis, taken);
        Self { explanations: &whitened.explained.explanations, rows: whitened.rows as f64, tried }
    }

    /// The best that chance alone would hardly give.
    fn best(&self) -> Option<usize> {
        let limit = FALSE_ALARMS / self.explanations.len() as f64;
        let significant = |k: &usize| {
            let t = &self.tried[*k];
            let large = !self.explanations[*k].is_of_machine() || (t.statistic / self.rows).sqrt() > SHARE;
            t.rank > 0 && t.p_value() < limit && large
        };
        let all = (0..self.explanations.len()).filter(significant);
        all.max_by(|a, b| self.tried[*a].evidence.total_cmp(&self.tried[*b].evidence))
    }

    fn change(&self, own: usize) -> Change {
        let best = &self.tried[own];
        let weight = |k: usize| match &self.tried[k] {
            t if t.rank > 0 => libm::exp(t.evidence - best.evidence),
            _ => 0.0,
        };
        let all = 0..self.explanations.len();
        let total: f64 = all.clone().map(weight).sum::<f64>() + libm::exp(-best.evidence);
        let rivals = all.filter(|k| *k != own && weight(*k) > 0.1).map(|k| self.explanations[k].what.clone());
        Change {
            what: self.explanations[own].what.clone(),
            scope: self.explanations[own].scope,
            probability: weight(own) / total,
            p_value: best.p_value(),
            by: Vec::new(),
            rivals: rivals.collect(),
        }
    }
}

/// Each explanation beside `basis`; those that are `taken` have no rank.
fn tried(whitened: &Whitened<'_>, basis: &[Vec<f64>], taken: &[usize]) -> Vec<Tried> {
    let mut left = whitened.residual.clone();
    project_out(&mut left, basis);
    let one = |(k, columns): (usize, &Vec<Vec<f64>>)| {
        let mut with = basis.to_vec();
        let rank = if taken.contains(&k) { 0 } else { extend(&mut with, columns) };
        let square: f64 = with[basis.len()..].iter().map(|q| dot(q, &left).powi(2)).sum();
        let scaled = square / whitened.more_noise;
        let of_machine = whitened.explained.explanations[k].is_of_machine();
        let statistic = if of_machine { scaled } else { (TAILS + rank as f64) * libm::log1p(scaled / TAILS) };
        Tried { statistic, rank, evidence: evidence(statistic, rank) }
    };
    whitened.columns.iter().enumerate().map(one).collect()
}

/// Evidence in nats of `rank` numbers that take up `t`: their prior is as wide as what was found (George & Foster 2000), so that more
/// numbers pay for being more.
fn evidence(t: f64, rank: usize) -> f64 {
    let k = rank.max(1) as f64;
    if t > k { 0.5 * (t - k - k * libm::log(t / k)) } else { 0.0 }
}
