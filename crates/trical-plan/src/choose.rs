//! Which of many candidates to measure: the set whose Jacobian has the largest determinant (D-optimality, which is the
//! observability index O1 for a fixed number of measurements), by exchange (Fedorov 1972; Mitchell's DETMAX 1974).

use nalgebra::{DMatrix, Matrix3};
use rand::seq::SliceRandom;
use rayon::prelude::*;

use crate::candidates::{Candidates, White, inverse};
use crate::criterion::{Aim, Goal, exchange_linear, exchange_weakest};
use crate::random::generator;

/// The chosen set.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// Indices of the chosen candidates, rising.
    pub indices: Vec<usize>,
    /// Logarithm of det(J'J) of the chosen set over that of the whole pool scaled to the same number of measurements:
    /// 0 where it tells as much per measurement as the pool does on average.
    pub log_det: f64,
    /// What the goal makes small, in proportion to the noise of a measurement: the geometric mean of the principal standard
    /// deviations in the pool's coordinates, the root of the sum of variances, or the inverse of the smallest singular value.
    pub figure: f64,
    /// Figure of the median random set.
    pub random_figure: f64,
}

/// For each group g, `wanted[g]` of its candidates, so that det(J'J) of all of them together is as large as exchanges can make
/// it: [`choose_for`] the determinant.
#[must_use]
pub fn choose(candidates: &Candidates, wanted: &[usize], seed: u64, restarts: usize) -> Option<Choice> {
    choose_for(candidates, wanted, &Goal::Determinant, seed, restarts)
}

/// For each group g, `wanted[g]` of its candidates, so that all of them together are as good for `goal` as exchanges can make
/// them. From a greedy start and `restarts` random ones, the best end wins; same seed, same choice.
///
/// `None` where a group has too few candidates, all of them together do not determine the columns, or the goal does not fit.
#[must_use]
pub fn choose_for(
    candidates: &Candidates,
    wanted: &[usize],
    goal: &Goal<'_>,
    seed: u64,
    restarts: usize,
) -> Option<Choice> {
    let members: Vec<Vec<usize>> =
        (0..wanted.len()).map(|g| (0..candidates.len()).filter(|i| candidates.group(*i) == g).collect()).collect();
    if members.iter().zip(wanted).any(|(m, w)| m.len() < *w) || 3 * candidates.len() < candidates.columns() {
        return None;
    }
    let white = White::of(candidates);
    if !white.z.iter().all(|x| x.is_finite()) {
        return None;
    }
    let aim = Aim::of(goal, &white)?;
    let ends: Vec<(f64, Vec<usize>)> = (0..=restarts)
        .into_par_iter()
        .map(|k| {
            let mut chosen =
                if k == 0 { greedy(&white, &members, wanted) } else { random_set(&members, wanted, seed, k as u64) };
            match &aim {
                Aim::Determinant => exchange(&white, candidates, &members, &mut chosen),
                Aim::Linear(l) => exchange_linear(&white, candidates, &members, l, &mut chosen),
                Aim::Weakest(r) => {
                    // a sum of variances is a smooth way near
                    if let Some(l) = r.clone().try_inverse() {
                        exchange_linear(&white, candidates, &members, &l.transpose(), &mut chosen);
                    }
                    exchange_weakest(&white, candidates, &members, r, &mut chosen);
                }
            }
            chosen.sort_unstable();
            (aim.figure(&white, &chosen), chosen)
        })
        .collect();
    let (figure, indices) = ends.into_iter().reduce(|a, b| if b.0 < a.0 { b } else { a })?;
    let mut random: Vec<f64> =
        (0..25).map(|k| aim.figure(&white, &random_set(&members, wanted, seed, 1000 + k))).collect();
    random.sort_by(f64::total_cmp);
    Some(Choice {
        log_det: white.log_det(&indices),
        figure,
        random_figure: random.get(12).copied().unwrap_or(f64::NAN),
        indices,
    })
}

fn random_set(members: &[Vec<usize>], wanted: &[usize], seed: u64, k: u64) -> Vec<usize> {
    let mut rng = generator(seed, 2, k);
    let mut chosen = Vec::new();
    for (group, w) in members.iter().zip(wanted) {
        let mut group = group.clone();
        group.shuffle(&mut rng);
        chosen.extend_from_slice(&group[..*w]);
    }
    chosen
}

/// Adds the candidate that gains most, group by group in turn, starting from a little of everything.
fn greedy(white: &White, members: &[Vec<usize>], wanted: &[usize]) -> Vec<usize> {
    let mut chosen: Vec<usize> = Vec::new();
    let Some(mut state) = State::of(white, DMatrix::identity(white.p, white.p) * 1e-3) else { return chosen };
    for round in 0..wanted.iter().copied().max().unwrap_or(0) {
        for (group, _) in members.iter().zip(wanted).filter(|(_, w)| round < **w) {
            let best = group
                .iter()
                .filter(|i| !chosen.contains(i))
                .map(|i| (with(&state.own[*i]).determinant(), *i))
                .reduce(|a, b| if b.0 > a.0 { b } else { a });
            if let Some((_, i)) = best {
                chosen.push(i);
                if !state.change(white, i, 1.0) {
                    return chosen;
                }
            }
        }
    }
    chosen
}

/// The inverse of M, and `D_jj = Z_j M^-1 Z_j'` of every candidate: what adding it does to the determinant.
struct State {
    inverse: DMatrix<f64>,
    own: Vec<Matrix3<f64>>,
}

impl State {
    fn of(white: &White, m: DMatrix<f64>) -> Option<Self> {
        let inverse = inverse(&m)?;
        let w = &inverse * &white.z;
        let own = (0..white.z.ncols() / 3)
            .map(|j| white.z.fixed_columns::<3>(3 * j).tr_mul(&w.fixed_columns::<3>(3 * j)))
            .collect();
        Some(Self { inverse, own })
    }

    /// `Z_i M^-1 Z_j'` of one i and all j, side by side: 3 x 3 N.
    fn row(&self, white: &White, i: usize) -> DMatrix<f64> {
        (&self.inverse * white.z.columns(3 * i, 3)).tr_mul(&white.z)
    }

    /// Adds (`sign` 1) or removes (-1) candidate i: `M^-1 -= s M^-1 Z_i' (I + s D_ii)^-1 Z_i M^-1`. Whether that was possible.
    fn change(&mut self, white: &White, i: usize, sign: f64) -> bool {
        let Some(middle) = (Matrix3::identity() + self.own[i] * sign).try_inverse() else { return false };
        let row = self.row(white, i);
        for (j, d) in self.own.iter_mut().enumerate() {
            let dij = row.fixed_columns::<3>(3 * j);
            *d -= dij.tr_mul(&(middle * dij)) * sign;
        }
        let w = &self.inverse * white.z.columns(3 * i, 3);
        let left = &w * middle;
        self.inverse.gemm(-sign, &left, &w.transpose(), 1.0);
        true
    }
}

/// I + D.
fn with(d: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::identity() + d
}

/// A swap must multiply the determinant by more than this, or rounding could make the search run in circles.
const GAIN: f64 = 1.0 + 1e-9;

/// Swaps chosen candidates, one after the other, each for the free candidate of its group that gains most, until no swap gains.
///
/// Removing i and adding j multiplies det M by `det(I + D_jj) det(I - D_ii + D_ij (I + D_jj)^-1 D_ji)`,
/// `D_ij = Z_i M^-1 Z_j'`. Which candidate may leave first is a matter of their order; the end is one that no single swap improves.
fn exchange(white: &White, candidates: &Candidates, members: &[Vec<usize>], chosen: &mut [usize]) {
    for _ in 0..200 {
        let mut swapped = false;
        let mut m = white.information(chosen);
        // a set that does not determine everything has no inverse: a little of everything lets it climb out
        m += DMatrix::identity(white.p, white.p) * 1e-9;
        // anew in every round, so that rounding does not add up
        let Some(mut state) = State::of(white, m) else { return };
        for slot in 0..chosen.len() {
            let i = chosen[slot];
            let row = state.row(white, i);
            let without = Matrix3::identity() - state.own[i];
            let mut best = (GAIN, None);
            for &j in &members[candidates.group(i)] {
                let plus = with(&state.own[j]);
                let gain = plus.determinant();
                // removing can only lose: no i can make up for too small a gain
                if gain <= best.0 || chosen.contains(&j) {
                    continue;
                }
                let Some(back) = plus.try_inverse() else { continue };
                let dij = row.fixed_columns::<3>(3 * j);
                let ratio = gain * (without + dij * back * dij.transpose()).determinant();
                if ratio > best.0 {
                    best = (ratio, Some(j));
                }
            }
            if let (_, Some(j)) = best {
                // in this order M has an inverse between the two
                if !(state.change(white, j, 1.0) && state.change(white, i, -1.0)) {
                    return;
                }
                chosen[slot] = j;
                swapped = true;
            }
        }
        if !swapped {
            return;
        }
    }
}

#[cfg(test)]
mod tests;
