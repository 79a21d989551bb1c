//! Which explanations are taken: the best one that chance alone would hardly give, then the next beside it.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::result::Change;
use super::settings::{CHANGES, FALSE_ALARMS, SHARE, TAILS};
use super::size::sizes;
use super::whitened::{Whitened, extend, project_out};
use crate::triangle::dot;

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
    let explanations = &whitened.explained.explanations;
    let limit = FALSE_ALARMS / explanations.len() as f64;
    let rows = whitened.rows as f64;
    let (mut taken, mut basis): (Vec<usize>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
    let mut out = Vec::new();
    while out.len() < CHANGES {
        let tried = tried(whitened, &basis, &taken);
        let significant = |k: &usize| {
            let t = &tried[*k];
            let large = !explanations[*k].is_of_machine() || (t.statistic / rows).sqrt() > SHARE;
            t.rank > 0 && t.p_value() < limit && large
        };
        let all = 0..explanations.len();
        let Some(best) =
            all.clone().filter(significant).max_by(|a, b| tried[*a].evidence.total_cmp(&tried[*b].evidence))
        else {
            break;
        };
        let weight = |k: usize| if tried[k].rank > 0 { (tried[k].evidence - tried[best].evidence).exp() } else { 0.0 };
        let nothing = (-tried[best].evidence).exp();
        let total: f64 = all.clone().map(weight).sum::<f64>() + nothing;
        let rivals = all.filter(|k| *k != best && weight(*k) > 0.1).map(|k| explanations[k].what.clone());
        out.push(Change {
            what: explanations[best].what.clone(),
            scope: explanations[best].scope,
            probability: weight(best) / total,
            p_value: tried[best].p_value(),
            by: Vec::new(),
            rivals: rivals.collect(),
        });
        taken.push(best);
        extend(&mut basis, &whitened.columns[best]);
        if !explanations[best].is_of_machine() {
            let wrong: Vec<usize> = taken.iter().copied().filter(|k| !explanations[*k].is_of_machine()).collect();
            whitened.leave_out(&wrong);
        }
    }
    for (change, by) in out.iter_mut().zip(sizes(whitened, &taken)) {
        change.by = by;
    }
    out
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
        let statistic = if of_machine { scaled } else { (TAILS + rank as f64) * (scaled / TAILS).ln_1p() };
        Tried { statistic, rank, evidence: evidence(statistic, rank) }
    };
    whitened.columns.iter().enumerate().map(one).collect()
}

/// Evidence in nats of `rank` numbers that take up `t`: their prior is as wide as what was found (George & Foster 2000), so that more
/// numbers pay for being more.
fn evidence(t: f64, rank: usize) -> f64 {
    let k = rank.max(1) as f64;
    if t > k { 0.5 * (t - k - k * (t / k).ln()) } else { 0.0 }
}
