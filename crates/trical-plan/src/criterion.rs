//! What "most informative" can mean, and exchange for those meanings that are sums of variances.
//!
//! With M = J'J of the chosen touches, a sum of variances is `trace(C M^-1)`: C = I (columns of unit length) for the sum over
//! parameters (A-optimality), C = mean of K'K for the mean square position error at poses where a change of the parameters
//! moves the tool by K (integrated variance, V- or I-optimality). The weakest direction (E-optimality) is not smooth: swaps
//! are proposed by the smooth `trace(M^-4)` and taken where the smallest singular value itself grows.

use nalgebra::{DMatrix, SMatrix};

use crate::candidates::{Candidates, White, inverse};

/// What the chosen touches are to be best for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Criterion {
    /// The volume of uncertainty of all parameters together: det(J'J), observability index O1 (D-optimality).
    #[default]
    Determinant,
    /// The sum of the parameters' variances, each in units of what it does to the pool (A-optimality).
    Variances,
    /// The direction of parameters that is known worst: the smallest singular value, O3 (E-optimality).
    Weakest,
    /// The mean square position error that is left at poses that matter (V-optimality).
    Region,
}

/// A criterion with what it needs.
#[derive(Clone, Copy, Debug)]
pub enum Goal<'a> {
    /// [`Criterion::Determinant`].
    Determinant,
    /// [`Criterion::Variances`].
    Variances,
    /// [`Criterion::Weakest`].
    Weakest,
    /// [`Criterion::Region`]: how the parameters move the tool at poses that matter, rows of as many numbers as the candidates
    /// have columns, in the same order and units.
    Region(&'a [f64]),
}

/// A goal in the coordinates of [`White`].
pub(crate) enum Aim {
    Determinant,
    /// `trace(C M^-1)` with C = L L'.
    Linear(DMatrix<f64>),
    /// The smallest eigenvalue of R' M R.
    Weakest(DMatrix<f64>),
}

impl Aim {
    /// `None` where a region has rows of another length, or nothing in it moves.
    pub(crate) fn of(goal: &Goal<'_>, white: &White) -> Option<Self> {
        let p = white.p;
        match goal {
            Goal::Determinant => Some(Self::Determinant),
            // M in columns of unit length is R' M R: trace((R' M R)^-1) = trace(R^-T R^-1 M^-1)
            Goal::Variances => Some(Self::Linear(white.r.clone().try_inverse()?.transpose())),
            Goal::Weakest => Some(Self::Weakest(white.r.clone())),
            Goal::Region(rows) => {
                if rows.is_empty() || rows.len() % p != 0 || !rows.iter().all(|x| x.is_finite()) {
                    return None;
                }
                let count = rows.len() / p;
                let mut k = DMatrix::from_row_slice(count, p, rows);
                for (mut column, scale) in k.column_iter_mut().zip(&white.scale) {
                    column *= *scale;
                }
                // three rows a pose
                let each = (3.0 / count as f64).sqrt();
                let k = k * white.r.clone().try_inverse()? * each;
                let mut c = k.tr_mul(&k);
                let trace = c.trace();
                if !(trace.is_finite() && trace > 0.0) {
                    return None;
                }
                let little = 1e-12 * trace / p as f64;
                for i in 0..p {
                    c[(i, i)] += little;
                }
                Some(Self::Linear(c.cholesky()?.l()))
            }
        }
    }

    /// What is to be small, in proportion to the measurements' noise: geometric mean of the principal standard deviations
    /// (in the pool's coordinates), root of the sum of variances, inverse of the smallest singular value.
    pub(crate) fn figure(&self, white: &White, chosen: &[usize]) -> f64 {
        let m = white.information(chosen);
        let figure = match self {
            Self::Determinant => {
                let p = white.p as f64;
                m.cholesky().map(|c| libm::exp(-c.l_dirty().diagonal().iter().map(|d| libm::log(*d)).sum::<f64>() / p))
            }
            Self::Linear(l) => inverse(&m).map(|i| (l.transpose() * i * l).trace().sqrt()),
            Self::Weakest(r) => {
                let least = (r.transpose() * m * r).symmetric_eigenvalues().min();
                (least > 0.0).then(|| 1.0 / least.sqrt())
            }
        };
        figure.filter(|f| f.is_finite()).unwrap_or(f64::INFINITY)
    }
}

/// A swap must lower the figure by more than this part of it.
const GAIN: f64 = 1e-9;
/// What a set that does not determine everything is helped with.
const LITTLE: f64 = 1e-9;

type Six = SMatrix<f64, 6, 6>;

/// Blocks `U' A' B U` of two candidates from columns of `a` and `b`, with U = [i, j].
#[inline]
fn block(a: &DMatrix<f64>, b: &DMatrix<f64>, i: usize, j: usize, out: &mut Six, at: (usize, usize)) {
    let rows = a.nrows();
    let range = |k: usize| 3 * k * rows..3 * (k + 1) * rows;
    let (x, y) = (&a.as_slice()[range(i)], &b.as_slice()[range(j)]);
    for (r, x) in x.chunks_exact(rows).enumerate() {
        for (c, y) in y.chunks_exact(rows).enumerate() {
            out[(at.0 + r, at.1 + c)] = x.iter().zip(y).map(|(a, b)| a * b).sum();
        }
    }
}

/// What swaps would take off `trace(C M^-1)`.
struct Swaps<'a> {
    z: &'a DMatrix<f64>,
    /// M^-1 Z'.
    w: DMatrix<f64>,
    /// L' M^-1 Z'.
    v: DMatrix<f64>,
}

impl<'a> Swaps<'a> {
    fn new(white: &'a White, chosen: &[usize], l: &DMatrix<f64>) -> Option<Self> {
        let mut m = white.information(chosen);
        for k in 0..white.p {
            m[(k, k)] += LITTLE;
        }
        let w = inverse(&m)? * &white.z;
        let v = l.tr_mul(&w);
        Some(Self { z: &white.z, w, v })
    }

    /// By the identity of Woodbury with U = [Z_j, Z_i], S = diag(1, -1):
    /// `trace(C M^-1) - trace(C M'^-1) = trace((S + U' M^-1 U)^-1 U' M^-1 C M^-1 U)`.
    fn gain(&self, i: usize, j: usize) -> f64 {
        let (mut d, mut f) = (Six::zeros(), Six::zeros());
        for (a, x) in [j, i].into_iter().enumerate() {
            for (b, y) in [j, i].into_iter().enumerate().skip(a) {
                block(self.z, &self.w, x, y, &mut d, (3 * a, 3 * b));
                block(&self.v, &self.v, x, y, &mut f, (3 * a, 3 * b));
            }
        }
        for r in 0..3 {
            for c in 3..6 {
                d[(c, r)] = d[(r, c)];
                f[(c, r)] = f[(r, c)];
            }
        }
        for k in 0..6 {
            d[(k, k)] += if k < 3 { 1.0 } else { -1.0 };
        }
        d.lu().solve(&f).map_or(f64::NEG_INFINITY, |x| x.trace())
    }
}

/// Swaps a chosen for a free candidate of its group wherever that gains, place by place, until a whole round gains nothing.
pub(crate) fn exchange_linear(
    white: &White,
    candidates: &Candidates,
    members: &[Vec<usize>],
    l: &DMatrix<f64>,
    chosen: &mut [usize],
) {
    let aim = Aim::Linear(l.clone());
    for _ in 0..100 {
        let mut swapped = false;
        let Some(mut swaps) = Swaps::new(white, chosen, l) else { return };
        for slot in 0..chosen.len() {
            let i = chosen[slot];
            let Some(group) = members.get(candidates.group(i)) else { continue };
            let best = group
                .iter()
                .filter(|j| !chosen.contains(j))
                .map(|j| (swaps.gain(i, *j), *j))
                .reduce(|a, b| if b.0 > a.0 { b } else { a });
            let Some((gain, j)) = best else { continue };
            if gain <= 0.0 || gain.is_nan() {
                continue;
            }
            let before = aim.figure(white, chosen);
            chosen[slot] = j;
            let after = aim.figure(white, chosen);
            // of a set that determines nothing yet, any gain is taken
            if after < before * (1.0 - GAIN) || (before.is_infinite() && after.is_infinite() && gain > 1.0) {
                swapped = true;
                match Swaps::new(white, chosen, l) {
                    Some(s) => swaps = s,
                    None => return,
                }
            } else {
                chosen[slot] = i;
            }
        }
        if !swapped {
            return;
        }
    }
}

/// Swaps that are looked at exactly in each round of [`exchange_weakest`].
const LOOKED_AT: usize = 40;

/// Lets the smallest singular value grow: each round the swaps that gain most of `trace(M^-4)`, to first order, are tried, and
/// the best is taken.
pub(crate) fn exchange_weakest(
    white: &White,
    candidates: &Candidates,
    members: &[Vec<usize>],
    r: &DMatrix<f64>,
    chosen: &mut [usize],
) {
    let aim = Aim::Weakest(r.clone());
    let Some(to_unit) = r.clone().try_inverse() else { return };
    for _ in 0..100 {
        let now = aim.figure(white, chosen);
        if now.is_infinite() {
            return;
        }
        // gradient of trace(M^-4) in columns of unit length: C = M^-3 there, whose root is taken from the eigenvectors
        let unit = r.transpose() * white.information(chosen) * r;
        let eigen = unit.symmetric_eigen();
        let least = eigen.eigenvalues.min().max(1e-300);
        let mut root = eigen.eigenvectors.clone();
        for (mut column, value) in root.column_iter_mut().zip(eigen.eigenvalues.iter()) {
            column *= libm::pow(least / value.max(least), 1.5);
        }
        let l = to_unit.transpose() * root;
        let Some(swaps) = Swaps::new(white, chosen, &l) else { return };
        let mut tries: Vec<(f64, usize, usize)> = Vec::new();
        for (slot, i) in chosen.iter().enumerate() {
            let Some(group) = members.get(candidates.group(*i)) else { continue };
            tries.extend(group.iter().filter(|j| !chosen.contains(j)).map(|j| (swaps.gain(*i, *j), slot, *j)));
        }
        tries.sort_by(|a, b| b.0.total_cmp(&a.0));
        let best = tries
            .iter()
            .take(LOOKED_AT)
            .map(|(_, slot, j)| {
                let mut next = chosen.to_vec();
                next[*slot] = *j;
                (aim.figure(white, &next), *slot, *j)
            })
            .reduce(|a, b| if b.0 < a.0 { b } else { a });
        match best {
            Some((figure, slot, j)) if figure < now * (1.0 - GAIN) => chosen[slot] = j,
            _ => return,
        }
    }
}

#[cfg(test)]
mod tests;
