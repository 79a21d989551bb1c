//! A state of the search: the fit with some candidates added, and what others would do then.

use std::cmp::Ordering;
use std::sync::{Arc, OnceLock};

use pulp::Arch;
use trical_ident::dense::{Mat, dot, solve_lower_rows};

use super::design::Design;
use crate::settings::ABSORBED_SHARE;

/// Numbers of a vector that are worked on together: what stays near the processor.
const CHUNK: usize = 1024;

/// A state of the search: the fit with some candidates added. All that is needed are inner products, so a state costs as
/// much as there are columns, however many rows there were.
#[derive(Clone)]
pub struct RegressionState {
    /// What the basis explains of inner products.
    pub(crate) parts: Vec<Part>,
    /// Columns that were added.
    pub(crate) added: Vec<Added>,
    /// Squared length of every column after projection.
    pub(crate) diagonal: Vec<f64>,
    /// Inner products of the columns of each candidate with each other after projection: for its second column that with the
    /// first, for its third those with the first and the second, and so on.
    pub(crate) below_diagonal: Vec<f64>,
    /// `X'r` of every column.
    pub(crate) b: Vec<f64>,
    /// Weighted sum of squares left.
    pub ss: f64,
    /// Parameters in the basis; one that the prior holds more than the data do counts less than 1.
    pub parameters: f64,
}

/// Inner products of every column with a basis vector: their products with each other are what the vector explains, or, where
/// candidates were taken out again, what it no longer does.
#[derive(Clone)]
pub(crate) struct Part {
    pub w: Arc<[f64]>,
    pub taken_out: bool,
}

/// A column in the basis: its length after projection and with its prior, and the residual's part along it.
#[derive(Clone, Copy)]
pub(crate) struct Added {
    pub column: usize,
    pub norm: f64,
    pub d: f64,
}

/// What one candidate would do.
#[derive(Clone, Copy, Debug, Default)]
pub struct Gain {
    /// Sum of squares that it would remove, prior costs included.
    pub dss: f64,
    /// How many numbers the data would determine.
    pub rank: f64,
    /// Occam's factor, nats: `ln sqrt(det(G + L) / det L)` with the prior's precision `L`. A coefficient that could have been
    /// anything in its usual range pays for having been found at one place in it.
    pub occam: f64,
}

impl Gain {
    /// Of one coefficient, of whose prior's variance the data leave this share.
    fn of_one(dss: f64, share: f64) -> Self {
        Self { dss, rank: 1.0 - share, occam: -0.5 * libm::log(share) }
    }
}

impl RegressionState {
    pub(crate) fn bare(diagonal: Vec<f64>, below_diagonal: Vec<f64>, b: Vec<f64>, ss: f64, parameters: f64) -> Self {
        Self { parts: Vec::new(), added: Vec::new(), diagonal, below_diagonal, b, ss, parameters }
    }

    /// With fewer columns, as `of` and `below_of` take them; what was added so far stays nameless.
    pub(crate) fn narrowed(&self, of: &dyn Fn(&[f64]) -> Vec<f64>, below_of: &dyn Fn(&[f64]) -> Vec<f64>) -> Self {
        Self {
            parts: self.parts.iter().map(|p| Part { w: of(&p.w).into(), ..*p }).collect(),
            added: Vec::new(),
            diagonal: of(&self.diagonal),
            below_diagonal: below_of(&self.below_diagonal),
            b: of(&self.b),
            ..*self
        }
    }

    /// Takes what a part explains out of all products, or puts it back.
    pub(crate) fn project_out(&mut self, design: &Design, part: Part, d: f64) {
        let sign = if part.taken_out { -1.0 } else { 1.0 };
        Arch::new().dispatch(ProjectOut {
            w: &part.w,
            d: sign * d,
            sign,
            b: &mut self.b,
            diagonal: &mut self.diagonal,
        });
        for ((from, to), at) in design.spans.iter().zip(&design.below_at) {
            if to - from > 1 {
                let w = &part.w[*from..*to];
                let mut products = self.below_diagonal[*at..].iter_mut();
                for (i, x) in w.iter().enumerate().skip(1) {
                    for (y, product) in w[..i].iter().zip(&mut products) {
                        *product -= sign * (x * y);
                    }
                }
            }
        }
        self.ss -= sign * (d * d);
        self.parts.push(part);
    }
}

impl Design {
    /// The state with nothing added.
    #[must_use]
    pub fn start(&self) -> RegressionState {
        RegressionState::bare(
            self.diagonal.clone(),
            self.below_diagonal.clone(),
            self.b.clone(),
            self.ss,
            self.parameters,
        )
    }

    /// The same rows with what a state added made part of the fit, its priors included: candidates beside it then cost no more than they would
    /// alone. What was added must not be asked about again.
    #[must_use]
    pub fn absorbing(&self, state: &RegressionState) -> Self {
        let known = self.projected.nrows();
        let projected = Mat::from_fn(known + state.parts.len(), self.width, |i, a| match i.checked_sub(known) {
            Some(k) => state.parts[k].w[a],
            None => self.projected[(i, a)],
        });
        Self {
            parameters: state.parameters,
            linear: self.linear.clone(),
            spans: self.spans.clone(),
            squares: self.squares.clone(),
            precision: self.precision.clone(),
            projected,
            grams: self.spans.iter().map(|_| OnceLock::new()).collect(),
            diagonal: state.diagonal.clone(),
            below_diagonal: state.below_diagonal.clone(),
            below_at: self.below_at.clone(),
            b: state.b.clone(),
            ss: state.ss,
            ..*self
        }
    }

    /// The same picture with the columns of these candidates only, the others without any; and a state in it. A state there
    /// costs what the set costs. It cannot tell rows.
    #[must_use]
    pub fn narrowed(&self, state: &RegressionState, set: &[usize]) -> (Self, RegressionState) {
        let mut spans = vec![(0, 0); self.spans.len()];
        let mut below_at = vec![0; self.spans.len()];
        let mut kept: Vec<usize> = Vec::new();
        let mut kept_below: Vec<usize> = Vec::new();
        for c in set {
            let (from, to) = self.spans[*c];
            let k = to - from;
            spans[*c] = (kept.len(), kept.len() + k);
            below_at[*c] = kept_below.len();
            kept.extend(from..to);
            kept_below.extend(self.below_at[*c]..self.below_at[*c] + k * k.saturating_sub(1) / 2);
        }
        let of = |v: &[f64]| kept.iter().map(|a| v[*a]).collect::<Vec<f64>>();
        let below_of = |v: &[f64]| kept_below.iter().map(|a| v[*a]).collect::<Vec<f64>>();
        let grams: Vec<OnceLock<Mat>> = self.spans.iter().map(|_| OnceLock::new()).collect();
        self.prepare(set);
        for c in set {
            let all = self.gram(*c);
            grams[*c].get_or_init(|| Mat::from_fn(kept.len(), all.ncols(), |i, j| all[(kept[i], j)]));
        }
        let narrow = Self {
            rows: self.rows,
            parameters: self.parameters,
            linear: None,
            width: kept.len(),
            spans,
            squares: of(&self.squares),
            precision: of(&self.precision),
            projected: Mat::zeros(0, 0),
            grams,
            diagonal: of(&self.diagonal),
            below_diagonal: below_of(&self.below_diagonal),
            below_at,
            b: of(&self.b),
            ss: self.ss,
            of_parameters: self.of_parameters,
        };
        (narrow, state.narrowed(&of, &below_of))
    }

    /// Whether the fit has not absorbed a column.
    fn is_unabsorbed(&self, state: &RegressionState, column: usize) -> bool {
        self.squares[column] > 0.0 && state.diagonal[column] > ABSORBED_SHARE * ABSORBED_SHARE * self.squares[column]
    }

    /// Adds a candidate to the basis.
    pub fn add(&self, state: &mut RegressionState, candidate: usize) {
        let orthogonal = self.orthogonal(&state.parts, candidate);
        self.add_orthogonal(state, candidate, orthogonal, state.parts.len());
    }

    /// A state with a set of candidates added. In a design that is much wider than the set, they are added one after the other to the picture of
    /// the set alone; with `L` the lengths and products that they have there, and `C` what `start` leaves of their inner products with
    /// all columns, the basis vectors are the columns of `C L'^-1`.
    #[must_use]
    pub fn with(&self, start: &RegressionState, set: &[usize]) -> RegressionState {
        self.prepare(set);
        let mut state = start.clone();
        let columns: usize = set.iter().map(|c| self.spans[*c].1 - self.spans[*c].0).sum();
        if self.width < 4 * columns {
            set.iter().for_each(|c| self.add(&mut state, *c));
            return state;
        }
        let (few, mut among) = self.narrowed(start, set);
        let mut w = Vec::new();
        for c in set {
            let before = among.added.len();
            few.add(&mut among, *c);
            if among.added.len() > before {
                let orthogonal = self.orthogonal(&start.parts, *c);
                w.extend(among.added[before..].iter().map(|a| orthogonal[a.column - few.spans[*c].0].clone()));
                let own = |a: &Added| Added { column: a.column - few.spans[*c].0 + self.spans[*c].0, ..*a };
                state.added.extend(among.added[before..].iter().map(own));
            }
        }
        let l = lengths(&among.added, &among.parts[start.parts.len()..]);
        solve_lower_rows(&l, &mut w);
        for (w, added) in w.into_iter().zip(&among.added) {
            state.project_out(self, Part { w: w.into(), taken_out: false }, added.d);
        }
        (state.ss, state.parameters) = (among.ss, among.parameters);
        state
    }

    /// What some parts leave of the inner products with each column of a candidate.
    pub(crate) fn orthogonal(&self, parts: &[Part], candidate: usize) -> Vec<Vec<f64>> {
        let (from, to) = self.spans[candidate];
        let gram = self.gram(candidate);
        let mut orthogonal: Vec<Vec<f64>> = (0..gram.ncols()).map(|j| gram.col(j).to_vec()).collect();
        let columns: Vec<usize> = (from..to).collect();
        Arch::new().dispatch(Orthogonal { w: &mut orthogonal, at: &columns, known: parts });
        orthogonal
    }

    /// Adds a candidate, of whose inner products the first `done` parts of a state leave `orthogonal`.
    pub(crate) fn add_orthogonal(
        &self,
        state: &mut RegressionState,
        candidate: usize,
        orthogonal: Vec<Vec<f64>>,
        done: usize,
    ) {
        let from = self.spans[candidate].0;
        for (a, mut w) in (from..).zip(orthogonal) {
            // those of the same candidate before it may have taken all of it
            if !self.is_unabsorbed(state, a) {
                continue;
            }
            let rest = Orthogonal { w: std::slice::from_mut(&mut w), at: &[a], known: &state.parts[done..] };
            Arch::new().dispatch(rest);
            let square = state.diagonal[a] + self.precision[a];
            let norm = square.sqrt();
            w.iter_mut().for_each(|v| *v /= norm);
            let d = state.b[a] / norm;
            state.project_out(self, Part { w: w.into(), taken_out: false }, d);
            state.parameters += 1.0 - self.precision[a] / square;
            state.added.push(Added { column: a, norm, d });
        }
    }

    /// `G` of a candidate (k x k, row by row) and the columns that the fit does not absorb.
    fn gram_of(&self, state: &RegressionState, candidate: usize) -> (Vec<usize>, Vec<f64>) {
        let (from, to) = self.spans[candidate];
        let kept: Vec<usize> = (from..to).filter(|a| self.is_unabsorbed(state, *a)).collect();
        let k = kept.len();
        let below_diagonal = &state.below_diagonal[self.below_at[candidate]..];
        let mut g = vec![0.0; k * k];
        for i in 0..k {
            g[i * k + i] = state.diagonal[kept[i]];
            let row = kept[i] - from;
            for j in 0..i {
                let v = below_diagonal[row * row.saturating_sub(1) / 2 + kept[j] - from];
                g[i * k + j] = v;
                g[j * k + i] = v;
            }
        }
        (kept, g)
    }

    /// The columns that the fit does not absorb, Cholesky's factor of `G` with the prior's precision, and `y = L^-1 b`.
    fn solved(&self, state: &RegressionState, candidate: usize) -> (Vec<usize>, Vec<f64>, Vec<f64>) {
        let (kept, mut g) = self.gram_of(state, candidate);
        let k = kept.len();
        for (i, a) in kept.iter().enumerate() {
            g[i * k + i] += self.precision[*a];
        }
        let l = cholesky(&g, k);
        let y = forward_substitution(&l, &kept.iter().map(|a| state.b[*a]).collect::<Vec<f64>>());
        (kept, l, y)
    }

    /// What a candidate would remove from the sum of squares.
    #[must_use]
    pub fn gain(&self, state: &RegressionState, candidate: usize) -> Gain {
        self.gain_of(state, candidate, 0.0).unwrap_or_default()
    }

    /// The same, `None` where that is less than `least_dss`.
    pub(crate) fn gain_of(&self, state: &RegressionState, candidate: usize, least_dss: f64) -> Option<Gain> {
        let (from, to) = self.spans[candidate];
        if to == from + 1 {
            let square = state.diagonal[from] + self.precision[from];
            let dss = state.b[from] * state.b[from] / square;
            let of_use = self.is_unabsorbed(state, from) && dss >= least_dss;
            return of_use.then(|| Gain::of_one(dss, self.precision[from] / square));
        }
        let (kept, l, y) = self.solved(state, candidate);
        let k = kept.len();
        let mut gain = Gain { dss: y.iter().map(|v| v * v).sum(), rank: 0.0, occam: 0.0 };
        if gain.dss < least_dss {
            return None;
        }
        for (i, a) in kept.iter().enumerate() {
            let share = self.precision[*a] / l[i * k + i].powi(2);
            gain.rank += 1.0 - share;
            gain.occam -= 0.5 * libm::log(share);
        }
        Some(gain)
    }

    /// What a candidate would remove without any prior, and how many of its columns are independent.
    #[must_use]
    pub fn plain_gain(&self, state: &RegressionState, candidate: usize) -> (f64, usize) {
        let (kept, g) = self.gram_of(state, candidate);
        let k = kept.len();
        let mut dss = 0.0;
        // Gram-Schmidt in the metric of G: rows of L, one for every column that is not a sum of those before
        let mut ys: Vec<f64> = Vec::new();
        let mut coordinates: Vec<Vec<f64>> = vec![Vec::new(); k];
        for j in 0..k {
            let left = g[j * k + j] - coordinates[j].iter().map(|v| v * v).sum::<f64>();
            if left <= 1e-6 * g[j * k + j] {
                continue;
            }
            let norm = left.sqrt();
            let along: Vec<f64> = (0..k)
                .map(|i| {
                    (g[i * k + j] - coordinates[i].iter().zip(&coordinates[j]).map(|(a, b)| a * b).sum::<f64>()) / norm
                })
                .collect();
            let y = (state.b[kept[j]] - coordinates[j].iter().zip(&ys).map(|(c, y)| c * y).sum::<f64>()) / norm;
            dss += y * y;
            ys.push(y);
            for (c, v) in coordinates.iter_mut().zip(&along) {
                c.push(*v);
            }
        }
        (dss, ys.len())
    }

    /// Coefficients (SI, zero for absorbed columns) of a candidate, were it added now.
    #[must_use]
    pub fn coefficients(&self, state: &RegressionState, candidate: usize) -> Vec<f64> {
        let (from, to) = self.spans[candidate];
        let (kept, l, y) = self.solved(state, candidate);
        let k = kept.len();
        let mut x = vec![0.0; k];
        for i in (0..k).rev() {
            let sum: f64 = (i + 1..k).map(|j| l[j * k + i] * x[j]).sum();
            x[i] = (y[i] - sum) / l[i * k + i];
        }
        // the residual is predicted minus measured: what is added must cancel it
        let mut out = vec![0.0; to - from];
        for (a, v) in kept.iter().zip(&x) {
            out[a - from] = -v;
        }
        out
    }

    /// lambda of a candidate of coefficients `size` each (root mean square over its columns' directions).
    #[must_use]
    pub fn lambda_of_size(&self, state: &RegressionState, candidate: usize, size: f64) -> f64 {
        let (from, to) = self.spans[candidate];
        let (kept, g) = self.gram_of(state, candidate);
        let k = kept.len();
        let trace: f64 = (0..k).map(|i| g[i * k + i]).sum();
        let n = (to - from).max(1) as f64;
        size * (trace / n).max(0.0).sqrt()
    }
}

/// The matrix `L` of columns that were added: their lengths, and below what each of the parts has of those after it.
pub(crate) fn lengths(added: &[Added], parts: &[Part]) -> Mat {
    Mat::from_fn(added.len(), added.len(), |j, k| match j.cmp(&k) {
        Ordering::Less => 0.0,
        Ordering::Equal => added[k].norm,
        Ordering::Greater => parts[k].w[added[j].column],
    })
}

/// Takes what is known of them out of the columns `w` of inner products: the loops that diagnoses spend their time in, compiled
/// for the processor's vectors. No sum is reordered.
struct Orthogonal<'a> {
    w: &'a mut [Vec<f64>],
    /// Which column each of them is.
    at: &'a [usize],
    known: &'a [Part],
}

impl pulp::NullaryFnOnce for Orthogonal<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { w, at, known } = self;
        let width = w.first().map_or(0, Vec::len);
        let factor = |part: &Part, a: usize| if part.taken_out { -part.w[a] } else { part.w[a] };
        for from in (0..width).step_by(CHUNK) {
            let to = width.min(from + CHUNK);
            let mut four = known.chunks_exact(4);
            for old in &mut four {
                let [y0, y1, y2, y3] = [0, 1, 2, 3].map(|k: usize| &old[k].w[from..to]);
                for (w, a) in w.iter_mut().zip(at) {
                    let [f0, f1, f2, f3] = [0, 1, 2, 3].map(|k: usize| factor(&old[k], *a));
                    for ((((x, y0), y1), y2), y3) in w[from..to].iter_mut().zip(y0).zip(y1).zip(y2).zip(y3) {
                        *x = (((*x - f0 * y0) - f1 * y1) - f2 * y2) - f3 * y3;
                    }
                }
            }
            for old in four.remainder() {
                for (w, a) in w.iter_mut().zip(at) {
                    let factor = factor(old, *a);
                    for (x, y) in w[from..to].iter_mut().zip(&old.w[from..to]) {
                        *x -= factor * y;
                    }
                }
            }
        }
    }
}

/// Takes the part of a basis vector out of `b` and `left`.
struct ProjectOut<'a> {
    w: &'a [f64],
    d: f64,
    sign: f64,
    b: &'a mut [f64],
    diagonal: &'a mut [f64],
}

impl pulp::NullaryFnOnce for ProjectOut<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { w, d, sign, b, diagonal } = self;
        for ((x, b), diagonal) in w.iter().zip(b).zip(diagonal) {
            *b -= d * x;
            *diagonal -= sign * (x * x);
        }
    }
}

/// Cholesky factor (k x k, lower, row by row) of a positive definite matrix.
pub(crate) fn cholesky(g: &[f64], k: usize) -> Vec<f64> {
    let mut l = vec![0.0; k * k];
    for j in 0..k {
        let (above, below) = l.split_at_mut((j + 1) * k);
        let row = &mut above[j * k..];
        let d = g[j * k + j] - dot(&row[..j], &row[..j]);
        // the prior's precision keeps it positive, but for rounding
        row[j] = d.max(1e-12 * g[j * k + j]).sqrt();
        for (i, other) in (j + 1..k).zip(below.chunks_exact_mut(k)) {
            other[j] = (g[i * k + j] - dot(&other[..j], &row[..j])) / row[j];
        }
    }
    l
}

pub(crate) fn forward_substitution(l: &[f64], b: &[f64]) -> Vec<f64> {
    let k = b.len();
    let mut y = vec![0.0; k];
    for i in 0..k {
        y[i] = (b[i] - dot(&l[i * k..i * k + i], &y[..i])) / l[i * k + i];
    }
    y
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use trical_ident::Noise;
    use trical_model::{Axis, Basis, Measured, Motion, Shape, Site, Term, Variable};

    use super::*;
    use crate::candidate::Candidate;
    use crate::effect_id::EffectId;
    use crate::test_data::{off, shifted};

    /// m
    const SHIFT: f64 = 3e-5;
    const SCALE: f64 = 1e-5;

    /// From the middle of 60 touches on.
    const STEP: Shape = Shape::Step { at: 590.0 };

    /// A candidate of the device's shift along x by these shapes of time, twice, where there is a step of `SHIFT`. The square of
    /// what is left of a step, in units of the noise: half up and half down.
    fn made(shapes: &[Shape]) -> (Design, f64) {
        let (model, data) = shifted(60, SHIFT);
        let mut c: Candidate = off(EffectId::ToolShift.into(), 3, Shape::One);
        c.terms[0].site = Site::Tool(Motion::Along(Axis::X));
        let of = |shape: &Shape| Term { basis: Basis::new(Variable::Time, *shape), ..c.terms[0].clone() };
        (c.terms, c.scales) = (shapes.iter().map(of).collect(), vec![SCALE; shapes.len()]);
        let noise = Noise::usual(1);
        let sigma = noise.sigma(0, &Measured::Touch { ball: 0, reading: [0.0; 3] }, 0);
        (Design::new(&model, &[c.clone(), c], &data, &noise).unwrap(), 60.0 / 4.0 / (sigma * sigma))
    }

    fn near(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-9 * b.abs()
    }

    #[test]
    fn a_step_is_found_as_far_as_its_prior_lets_it_and_pays_for_the_range_that_it_could_have_had() {
        let (design, square) = made(&[STEP]);
        let prior = 1.0 / (SCALE * SCALE);
        let mut state = design.start();
        assert!(near(design.lambda_of_size(&state, 0, 2e-5), 2e-5 * square.sqrt()));
        let gain = design.gain(&state, 0);
        let removed = (square * SHIFT).powi(2) / (square + prior);
        assert!(near(gain.dss, removed), "{} {removed}", gain.dss);
        assert!(near(gain.rank, square / (square + prior)) && near(gain.occam, 0.5 * (1.0 + square / prior).ln()));
        assert_eq!(design.gain_of(&state, 0, 1.01 * removed).map(|g| g.dss), None);
        // the device went the other way than its readings say
        assert!(near(design.coefficients(&state, 0)[0], -SHIFT * square / (square + prior)));
        let (dss, rank) = design.plain_gain(&state, 0);
        assert!(near(dss, square * SHIFT * SHIFT) && rank == 1);

        let before = state.ss;
        assert!(near(before, dss), "nothing else is in the readings: {before} {dss}");
        design.add(&mut state, 0);
        assert!(near(before - state.ss, removed) && near(state.parameters - 3.0, gain.rank));
    }

    #[test]
    fn columns_that_are_nearly_the_same_are_one_number_that_the_data_determine() {
        // a step that takes one touch to come, but for a millionth
        let slow = Shape::Tent { left: 580.0, centre: 600.0001, right: f64::INFINITY };
        let (design, square) = made(&[STEP, slow]);
        let state = design.start();
        assert_eq!(design.plain_gain(&state, 0).1, 1);
        // of two columns the mean counts
        assert!((design.lambda_of_size(&state, 0, 2e-5) / (2e-5 * square.sqrt()) - 1.0).abs() < 1e-5);
        // each of them takes half of what one with twice the variance would
        let half = -SHIFT * square / (2.0 * square + 1.0 / (SCALE * SCALE));
        assert!(design.coefficients(&state, 0).iter().all(|c| (c / half - 1.0).abs() < 1e-4));
    }

    #[test]
    fn the_root_of_a_matrix_is_lower_and_solves_from_above() {
        let root = cholesky(&[4.0, 2.0, 6.0, 2.0, 10.0, 9.0, 6.0, 9.0, 26.0], 3);
        assert_eq!(root, [2.0, 0.0, 0.0, 1.0, 3.0, 0.0, 3.0, 2.0, 13.0_f64.sqrt()]);
        assert_eq!(forward_substitution(&[2.0, 0.0, 1.0, 4.0], &[6.0, 11.0]), [3.0, 2.0]);
        // of a matrix without one, what is left is a little above nothing
        assert!(cholesky(&[1.0, 1.0, 1.0, 1.0], 2)[3] > 0.0);
    }
}
