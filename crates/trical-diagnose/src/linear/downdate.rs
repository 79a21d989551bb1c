//! A set of candidates, and the fit with some of them taken out again.
//!
//! With `C` the inner products of the set's columns with all, `L L'` those among themselves with the prior's precision, and
//! `W = L^-1 C`, the set explains `W'W` of all inner products. Downdated the columns `o` it explains `Z'M^-1 Z` less, where
//! `Z` are the rows `o` of `L^-T W` and `M` the rows and columns `o` of `(L L')^-1`: taking out costs what adding one column
//! costs, not what adding all the others does.

use rayon::prelude::*;
use trical_ident::dense::{Mat, solve_lower};

use super::design::Design;
use super::state::{Part, RegressionState, cholesky, forward_substitution, lengths};

/// A set of candidates on a state.
pub struct Downdate<'a> {
    design: &'a Design,
    start: &'a RegressionState,
    set: &'a [usize],
    full: RegressionState,
    /// Which columns the set added, in order.
    columns: Vec<usize>,
    /// `L^-1`, and `Z'` with all columns in `o`, `width x m`.
    inverse: Mat,
    z: Mat,
    /// The residual's parts along the columns that were added.
    d: Vec<f64>,
    /// What the full state leaves of the inner products of candidates that are not in the set, `width x k`, by candidate.
    others: Vec<(usize, Vec<Vec<f64>>)>,
}

/// A state without some of a downdate.
pub struct Downdated {
    /// The state.
    pub state: RegressionState,
    /// So many of what it consists of are the downdate's.
    common: usize,
}

impl<'a> Downdate<'a> {
    /// Adds all of `set` to `start`.
    #[must_use]
    pub fn new(design: &'a Design, start: &'a RegressionState, set: &'a [usize]) -> Self {
        let full = design.with(start, set);
        let (added, parts) = (&full.added[start.added.len()..], &full.parts[start.parts.len()..]);
        let m = added.len();
        let l = lengths(added, parts);
        let mut inverse = Mat::identity(m);
        solve_lower(&l, &mut inverse);
        let mut w = Mat::zeros(design.width, m);
        for (k, part) in parts.iter().enumerate() {
            w.col_mut(k).copy_from_slice(&part.w);
        }
        let z = &w * &inverse;
        let (columns, d) = added.iter().map(|a| (a.column, a.d)).unzip();
        Self { design, start, set, columns, d, full, inverse, z, others: Vec::new() }
    }

    /// The set.
    #[must_use]
    pub fn set(&self) -> &[usize] {
        self.set
    }

    /// The state with all of the set.
    #[must_use]
    pub fn full(&self) -> &RegressionState {
        &self.full
    }

    /// The state without the candidates `own`. How many parameters it has depends on the order in which the others were added:
    /// `like` is a state of a narrowed design with the others, on a start that was narrowed with it.
    #[must_use]
    pub fn without(&self, own: &[usize], like: &RegressionState) -> Downdated {
        let is_own = |a: usize| own.iter().any(|c| (self.design.spans[*c].0..self.design.spans[*c].1).contains(&a));
        let out: Vec<usize> = (0..self.columns.len()).filter(|k| is_own(self.columns[*k])).collect();
        if like.added.len() + out.len() != self.columns.len() {
            // what the set has absorbed of the others is their own now
            let others: Vec<usize> = self.set.iter().copied().filter(|c| !own.contains(c)).collect();
            return Downdated { state: self.design.with(self.start, &others), common: 0 };
        }
        let k = out.len();
        let of = |i: usize| self.inverse.col(out[i]);
        let m: Vec<f64> = (0..k * k).map(|at| of(at / k).iter().zip(of(at % k)).map(|(a, b)| a * b).sum()).collect();
        let l = cholesky(&m, k);
        let along: Vec<f64> = (0..k).map(|i| of(i).iter().zip(&self.d).map(|(a, d)| a * d).sum()).collect();
        let d = forward_substitution(&l, &along);
        let mut state = self.full.clone();
        let mut ws: Vec<Vec<f64>> = Vec::with_capacity(k);
        for i in 0..k {
            let mut w = self.z.col(out[i]).to_vec();
            for (j, other) in ws.iter().enumerate() {
                let factor = l[i * k + j];
                w.iter_mut().zip(other).for_each(|(x, y)| *x -= factor * y);
            }
            w.iter_mut().for_each(|x| *x /= l[i * k + i]);
            ws.push(w);
        }
        for (w, d) in ws.into_iter().zip(d) {
            state.project_out(self.design, Part { w: w.into(), taken_out: true }, d);
        }
        state.added.retain(|a| !is_own(a.column));
        (state.ss, state.parameters) = (like.ss, like.parameters);
        Downdated { state, common: self.full.parts.len() }
    }

    /// Makes ready to add candidates to stages without some of the set: what the others of the set leave of them is worked out
    /// once for all such stages.
    pub fn prepare(&mut self, candidates: &[usize]) {
        self.design.prepare(candidates);
        let mut new: Vec<usize> =
            candidates.iter().copied().filter(|c| self.others.iter().all(|(known, _)| known != c)).collect();
        new.sort_unstable();
        new.dedup();
        let full = &self.full;
        let orthogonal: Vec<_> = new.into_par_iter().map(|c| (c, self.design.orthogonal(&full.parts, c))).collect();
        self.others.extend(orthogonal);
    }

    /// `without` with a candidate added.
    #[must_use]
    pub fn with(&self, without: &Downdated, candidate: usize) -> RegressionState {
        let mut state = without.state.clone();
        match self.others.iter().find(|(c, _)| *c == candidate) {
            Some((_, orthogonal)) if without.common > 0 => {
                self.design.add_orthogonal(&mut state, candidate, orthogonal.clone(), without.common);
            }
            _ => self.design.add(&mut state, candidate),
        }
        state
    }
}
