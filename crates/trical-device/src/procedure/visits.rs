//! Repeat visits: the plan forward, then backward, then forward again.

use super::PlanEntry;

/// A plan whose touches are visited so many times, for [`super::Retreat::Approach`].
///
/// Every other round goes the same ways backward: motions that the plan allows, and visits that are spread over the
/// session. Touch `i` has number `i` in the first round, and that plus a multiple of [`stride`] in the others; with
/// [`super::ProcedureOptions::stride`], those of every other round are approached from beyond.
#[must_use]
pub fn visits(plan: &[PlanEntry], rounds: usize) -> Vec<PlanEntry> {
    let stride = stride(plan);
    let mut all = Vec::with_capacity(plan.len() * rounds);
    for round in 0..rounds {
        let number = |entry: &PlanEntry| entry.index + stride * round as u64;
        let backward = round % 2 == 1;
        for at in 0..plan.len() {
            let entry = if backward { plan.get(plan.len() - 1 - at) } else { plan.get(at) };
            let Some(entry) = entry else { continue };
            let approach = entry.via.last().copied();
            let via = if round == 0 || (!backward && at > 0) {
                entry.via.clone()
            } else if at == 0 {
                // the round before has ended here
                approach.into_iter().collect()
            } else {
                // back along the way to the entry after this one
                let after = plan.get(plan.len() - at);
                let way = after.map(|after| after.via.iter().rev().skip(1).copied()).into_iter().flatten();
                way.chain(approach).collect()
            };
            all.push(PlanEntry { index: number(entry), via, ..entry.clone() });
        }
    }
    all
}

/// Numbers of one round: the largest of the plan, plus 1.
#[must_use]
pub fn stride(plan: &[PlanEntry]) -> u64 {
    plan.iter().map(|entry| entry.index + 1).max().unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use trical_model::recording::MAX_JOINTS;

    fn at(place: f64) -> [f64; MAX_JOINTS] {
        [place; MAX_JOINTS]
    }

    #[test]
    fn every_other_round_goes_the_same_ways_back() {
        let entry = |index: u64, via: &[f64], touch: f64| PlanEntry {
            index,
            ball: index as usize,
            joints: at(touch),
            via: via.iter().map(|v| at(*v)).collect(),
        };
        let plan = [entry(0, &[0.0, 1.0], 10.0), entry(1, &[1.5, 2.0], 20.0), entry(4, &[2.2, 2.5, 3.0], 30.0)];
        let all = visits(&plan, 3);
        let ways: Vec<(u64, Vec<f64>)> = all.iter().map(|e| (e.index, e.via.iter().map(|q| q[0]).collect())).collect();
        assert_eq!(
            ways,
            [
                (0, vec![0.0, 1.0]),
                (1, vec![1.5, 2.0]),
                (4, vec![2.2, 2.5, 3.0]),
                (9, vec![3.0]),
                (6, vec![2.5, 2.2, 2.0]),
                (5, vec![1.5, 1.0]),
                (10, vec![1.0]),
                (11, vec![1.5, 2.0]),
                (14, vec![2.2, 2.5, 3.0]),
            ]
        );
        assert_eq!(visits(&plan, 1), plan);
        assert!(visits(&[], 3).is_empty());
    }
}
