//! The design: the linearized fit of a model with candidates, as inner products.

use std::sync::{Arc, OnceLock};

use trical_ident::dataset::Dataset;
use trical_ident::dense::{Mat, dot, orthonormal};
use trical_ident::error::Result;
use trical_ident::fit::noise::Noise;
use trical_model::Model;

use super::columns::{Fitted, Linear};
use crate::candidate::Candidate;
use crate::correlated_noise::{CorrelatedNoise, Filter};

/// Of so many columns all rows are kept at once, and all products taken together.
const FEW: usize = 512;

/// A linearized fit with candidates.
pub struct Design {
    /// Rows (scalars).
    pub rows: usize,
    /// Fitted parameters; one that its prior holds more than the data do counts less than 1.
    pub parameters: f64,
    /// The rows; a narrowed design has none.
    pub(super) linear: Option<Arc<Linear>>,
    pub(super) width: usize,
    /// First column of each candidate, and one past the last.
    pub(super) spans: Vec<(usize, usize)>,
    /// Squared lengths of the columns before projection.
    pub(super) squares: Vec<f64>,
    /// 1 / (prior standard deviation)^2 of every coefficient.
    pub(super) precision: Vec<f64>,
    /// `Q'X` of all columns, one row for each column that was fitted.
    pub(super) projected: Mat,
    /// `X'X - (Q'X)'(Q'X)` of all columns with those of a candidate, `width x k`, from when it is first asked for.
    pub(super) grams: Vec<OnceLock<Mat>>,
    /// Of each column with itself, and of the columns of each candidate with each other (see `state`).
    pub(super) diagonal: Vec<f64>,
    pub(super) below_diagonal: Vec<f64>,
    /// Where those of each candidate begin.
    pub(super) below_at: Vec<usize>,
    /// `X'r` of all columns, and `r'r`, after projection.
    pub(super) b: Vec<f64>,
    pub(super) ss: f64,
    /// Half of `ln det (J'J)`.
    pub(super) of_parameters: f64,
}

impl Design {
    /// Linearizes `model` (all terms fitted, nothing known beforehand) with the candidates at zero.
    ///
    /// # Errors
    /// A candidate at a site that the arm does not have.
    pub fn new(model: &Model, candidates: &[Candidate], data: &Dataset, noise: &Noise) -> Result<Self> {
        Self::weighted(Fitted::all(model), candidates, &[], data, noise, CorrelatedNoise::WHITE)
    }

    /// As [`Design::new`], of any fit: with its own effects among the candidates the picture is exact. A candidate with weights (for each of its
    /// columns, one for each observation, the same for all of a pose) has them multiplied in. Correlated noise is made white: rows are then what
    /// could not be foreseen from those before.
    ///
    /// # Errors
    /// As [`Design::new`].
    pub fn weighted(
        fitted: Fitted<'_>,
        candidates: &[Candidate],
        weights: &[Vec<Vec<f64>>],
        data: &Dataset,
        noise: &Noise,
        correlation: CorrelatedNoise,
    ) -> Result<Self> {
        let linear = Linear::new(fitted, candidates, weights, data, noise)?;
        let spans = spans(candidates.iter().map(|c| c.terms.len()));
        let precision: Vec<f64> = candidates.iter().flat_map(|c| c.scales.iter().map(|s| s.powi(-2))).collect();
        Ok(Self::of(linear, spans, precision, Filter::new(correlation, data)))
    }

    /// Becomes the design of the same rows (of `data`) with noise of another correlation.
    pub fn set_noise(&mut self, correlation: CorrelatedNoise, data: &Dataset) {
        if let Some(linear) = self.linear.take_if(|l| l.filter.correlation != correlation) {
            let (spans, precision) = (std::mem::take(&mut self.spans), std::mem::take(&mut self.precision));
            *self = Self::of(Arc::unwrap_or_clone(linear), spans, precision, Filter::new(correlation, data));
        }
    }

    /// Inner products of the rows after the filter.
    fn of(mut linear: Linear, spans: Vec<(usize, usize)>, precision: Vec<f64>, filter: Filter) -> Self {
        linear.filter = filter;
        let width = precision.len();
        let (rows, p) = (linear.rows(), linear.jacobian.ncols());
        // an orthonormal basis of the parameters, and behind it the residual after projection, twice for the last digits
        let mut jacobian = linear.jacobian.clone();
        let mut residual = linear.residual.clone();
        linear.filter.apply_to_all(&mut jacobian);
        linear.filter.apply(&mut residual);
        let priors = &linear.priors;
        let all_rows = rows + priors.len();
        let of_prior = |i: usize, j: usize| if priors[i].column == j { priors[i].weight } else { 0.0 };
        let with_priors = |i: usize, j: usize| i.checked_sub(rows).map_or_else(|| jacobian[(i, j)], |k| of_prior(k, j));
        let jacobian = Mat::from_fn(all_rows, p, with_priors);
        residual.extend(priors.iter().map(|prior| prior.residual));
        let (q, r) = orthonormal(jacobian);
        let of_parameters = (0..p).map(|j| libm::log(r[(j, j)].abs().max(1e-300))).sum();
        for _ in 0..2 {
            for column in (0..p).map(|j| q.col(j)) {
                let d = dot(column, &residual);
                for (v, q) in residual.iter_mut().zip(column) {
                    *v -= d * q;
                }
            }
        }
        let ss = dot(&residual, &residual);
        let by_priors: f64 = (0..p).map(|j| dot(&q.col(j)[rows..], &q.col(j)[rows..])).sum();
        let basis = Mat::from_fn(rows, p + 1, |i, j| if j < p { q[(i, j)] } else { residual[i] });
        let columns = (width <= FEW).then(|| linear.columns());
        let products = match &columns {
            Some(x) => x.transpose() * &basis,
            None => linear.products(basis),
        };
        let projected = Mat::from_fn(p, width, |i, a| products[(a, i)]);
        let b = products.col(p).to_vec();

        let all = columns.as_ref().map(|x| x.view().gram());
        let among: Vec<Vec<f64>> = match &all {
            Some(all) => spans.iter().map(|(from, to)| lower(all, *from, *to)).collect(),
            None => linear.products_among(&spans),
        };
        let grams = spans.iter().map(|_| OnceLock::new()).collect();
        let (mut squares, mut diagonal, mut below_diagonal, mut below_at) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for ((from, to), among) in spans.iter().zip(&among) {
            below_at.push(below_diagonal.len());
            let mut products = among.iter();
            for i in *from..*to {
                for (j, product) in (*from..=i).zip(&mut products) {
                    let known: f64 = projected.col(i).iter().zip(projected.col(j)).map(|(a, b)| a * b).sum();
                    if i == j {
                        squares.push(*product);
                        diagonal.push(product - known);
                    } else {
                        below_diagonal.push(product - known);
                    }
                }
            }
        }
        let parameters = p as f64 - by_priors;
        let design = Self {
            rows,
            parameters,
            linear: Some(Arc::new(linear)),
            width,
            grams,
            spans,
            squares,
            precision,
            projected,
            diagonal,
            below_diagonal,
            below_at,
            b,
            ss,
            of_parameters,
        };
        if let Some(all) = all {
            design.keep(&(0..design.spans.len()).collect::<Vec<_>>(), all);
        }
        design
    }

    /// The rows; `None` for a narrowed design.
    pub(super) fn linear(&self) -> Option<&Linear> {
        self.linear.as_deref()
    }

    /// First and one past the last column of a candidate.
    pub(super) fn span(&self, candidate: usize) -> (usize, usize) {
        self.spans[candidate]
    }

    /// 1 / (prior standard deviation)^2 of a column's coefficient.
    pub(super) fn prior_precision(&self, column: usize) -> f64 {
        self.precision[column]
    }

    /// Inner products of all columns with those of some candidates, computed together where they are not known yet: it costs
    /// less than one by one when they are added to a state.
    pub fn prepare(&self, set: &[usize]) {
        let Some(linear) = &self.linear else { return };
        let mut new: Vec<usize> = set.iter().copied().filter(|c| self.grams[*c].get().is_none()).collect();
        new.sort_unstable();
        new.dedup();
        let columns: Vec<usize> = new.iter().flat_map(|c| self.spans[*c].0..self.spans[*c].1).collect();
        if columns.is_empty() {
            return;
        }
        self.keep(&new, linear.products_of(&columns));
    }

    /// Keeps inner products of all columns with those of some candidates, `width x k`, after projection.
    fn keep(&self, set: &[usize], mut products: Mat) {
        let columns: Vec<usize> = set.iter().flat_map(|c| self.spans[*c].0..self.spans[*c].1).collect();
        let known = Mat::from_fn(self.projected.nrows(), columns.len(), |i, j| self.projected[(i, columns[j])]);
        products.add_product(-1.0, self.projected.transpose(), &known);
        let mut at = 0;
        for c in set {
            let k = self.spans[*c].1 - self.spans[*c].0;
            self.grams[*c].get_or_init(|| products.view().columns(at, k).to_owned());
            at += k;
        }
    }

    /// Inner products of all columns with those of a candidate, `width x k`.
    pub(super) fn gram(&self, candidate: usize) -> &Mat {
        if self.grams[candidate].get().is_none() {
            self.prepare(&[candidate]);
        }
        self.grams[candidate].get_or_init(|| Mat::zeros(self.width, 0))
    }

    /// How likely the residuals of the fitted parameters alone are, nats (restricted likelihood, Patterson & Thompson 1971): comparable
    /// between correlations of the noise. `temper` is the share of the rows that is independent.
    #[must_use]
    pub fn nats(&self, temper: f64) -> f64 {
        let freedom = (self.rows as f64 * temper - self.parameters).max(1.0);
        let of_noise = self.linear.as_ref().map_or(0.0, |l| l.filter.log_determinant());
        -0.5 * (freedom * libm::log(self.ss) + temper * of_noise) - self.of_parameters
    }
}

/// Products of the columns `from..to` with each other: row by row of the lower triangle, diagonal included.
fn lower(products: &Mat, from: usize, to: usize) -> Vec<f64> {
    (from..to).flat_map(|i| (from..=i).map(move |j| products[(i, j)])).collect()
}

/// First and one past the last column of candidates with so many columns.
fn spans(counts: impl Iterator<Item = usize>) -> Vec<(usize, usize)> {
    let mut at = 0;
    counts
        .map(|k| {
            at += k;
            (at - k, at)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use trical_ident::fit::priors::PriorKnowledge;
    use trical_model::Measured;

    use super::*;
    use crate::test_data::shifted;

    /// How surely 60 touches tell the place of the device along an axis: 1 / variance.
    fn information() -> f64 {
        60.0 / Noise::usual(1).sigma(0, &Measured::Touch { ball: 0, reading: [0.0; 3] }, 0).powi(2)
    }

    #[test]
    fn a_parameter_that_its_prior_holds_counts_as_far_as_the_data_determine_it() {
        let (model, data) = shifted(60, 3e-5);
        let as_sure = information().powf(-0.5);
        let known =
            [PriorKnowledge::about_zero(as_sure), PriorKnowledge::NOTHING, PriorKnowledge::about_zero(as_sure / 3.0)];
        let of = |known: &[PriorKnowledge]| {
            let fitted = Fitted { known, ..Fitted::all(&model) };
            Design::weighted(fitted, &[], &[], &data, &Noise::usual(1), CorrelatedNoise::WHITE).unwrap()
        };
        assert!((of(&[]).parameters - 3.0).abs() < 1e-9);
        assert!((of(&known).parameters - (0.5 + 1.0 + 0.1)).abs() < 1e-9);
    }

    #[test]
    fn what_is_left_is_the_scatter_about_the_mean_and_its_likelihood_that_of_restricted_likelihood() {
        let (model, data) = shifted(60, 3e-5);
        let design = Design::new(&model, &[], &data, &Noise::usual(1)).unwrap();
        let left = information() / 4.0 * 3e-5_f64.powi(2);
        assert!((design.ss / left - 1.0).abs() < 1e-9 && design.rows == 180, "{} {left}", design.ss);
        for temper in [1.0, 0.5] {
            let nats = -0.5 * (180.0 * temper - 3.0) * left.ln() - 1.5 * information().ln();
            assert!((design.nats(temper) - nats).abs() < 1e-6, "{} {nats}", design.nats(temper));
        }
    }

    #[test]
    fn columns_of_candidates_follow_each_other() {
        assert_eq!(spans([2, 0, 3].into_iter()), [(0, 2), (2, 2), (2, 5)]);
        let products = Mat::from_fn(4, 4, |i, j| (10 * i + j) as f64);
        assert_eq!(lower(&products, 1, 4), [11.0, 21.0, 22.0, 31.0, 32.0, 33.0]);
    }
}
