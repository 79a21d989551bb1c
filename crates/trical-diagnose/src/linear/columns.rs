//! The linearized fit itself: residual, derivatives to the fitted parameters, and the columns of the candidates.
//!
//! Most columns are what one motion of the arm, its tool or its surroundings does at a measurement, times a number that the term's basis
//! says: they are stored as that number, one for all that was measured at a pose instead of one for each row, and inner products are taken of the
//! numbers.

use std::ops::Range;

use rayon::prelude::*;
use trical_ident::dataset::{Dataset, Observation};
use trical_ident::dense::{Mat, View};
use trical_ident::error::Result;
use trical_ident::fit::noise::Noise;
use trical_ident::fit::priors::PriorKnowledge;
use trical_model::{Forward, Measured, Model, Term};

use crate::candidate::Candidate;
use crate::correlated_noise::{CorrelatedNoise, Filter, in_device_axes};

/// Columns of one piece of a product.
const PIECE: usize = 512;

/// Columns on the other side of a product that are taken at once.
const BATCH: usize = 64;

/// Most rows of a measurement.
const MOST_ROWS: usize = 6;

/// A fit that is linearized.
#[derive(Clone, Copy)]
pub struct Fitted<'a> {
    /// Where.
    pub model: &'a Model,
    /// What was known of its terms beforehand, in their order; nothing beyond its end.
    pub known: &'a [PriorKnowledge],
    /// Terms before this one are fitted; those from here up to `effects` stay as they are.
    pub parameters: usize,
    /// Terms from here on are effects: the model is linearized with them, and they are taken out of the residual again by their own columns.
    pub effects: usize,
}

impl<'a> Fitted<'a> {
    /// A model whose terms are all fitted, with nothing known beforehand.
    #[must_use]
    pub fn all(model: &'a Model) -> Self {
        Self { model, known: &[], parameters: model.terms.len(), effects: model.terms.len() }
    }

    /// Priors of what is fitted.
    fn priors(&self) -> Vec<PriorRow> {
        let of = |(column, (t, k)): (usize, (&Term, &PriorKnowledge))| {
            let prior = k.prior?;
            Some(PriorRow { column, weight: 1.0 / prior.sd, residual: (t.value - prior.value) / prior.sd })
        };
        self.model.terms[..self.parameters].iter().zip(self.known).enumerate().filter_map(of).collect()
    }
}

/// What is known of a fitted parameter beforehand, as a row beside those of the measurements.
#[derive(Clone, Copy)]
pub(super) struct PriorRow {
    /// Which parameter.
    pub(super) column: usize,
    /// One standard deviation's part.
    pub(super) weight: f64,
    /// How far it is from what was expected, standard deviations.
    pub(super) residual: f64,
}

/// A fit, linearized: all weighted by the noise.
#[derive(Clone)]
pub(crate) struct Linear {
    /// Residual of each row, predicted minus measured.
    pub residual: Vec<f64>,
    /// What makes the noise white. Inner products are taken of what it leaves; residual, Jacobian and columns are those of the measurements,
    /// touches in the device's axes, whose noise it is.
    pub filter: Filter,
    /// Pose of each row.
    pub pose_of_row: Vec<usize>,
    /// Standard deviation (0 for rotations, which have no part in position errors) and observation of each row.
    pub sigma_of_row: Vec<(f64, usize)>,
    /// Derivatives to the fitted parameters, `rows x parameters`.
    pub jacobian: Mat,
    /// What is known of these beforehand.
    pub(super) priors: Vec<PriorRow>,
    /// First row of each state in which the arm was measured, and one past the last.
    first_row: Vec<usize>,
    /// How many candidate columns.
    width: usize,
    /// Where each column is stored: columns of one family, which have one motion, stand together.
    place: Vec<usize>,
    /// What its basis says of each column, `states x width`, row-major, by place.
    basis_values: Vec<f64>,
    /// Places of each family.
    families: Vec<(usize, usize)>,
    /// Family of each place.
    family: Vec<usize>,
    /// Unit direction of what the motion of each family does in each state, `rows x families`.
    directions: Mat,
    /// Columns that are not one motion scaled by a number in each row, all rows, and by place which of them it is. What `basis_values` and `directions` have for them is
    /// zero.
    whole: Mat,
    whole_of: Vec<Option<usize>>,
}

impl Linear {
    /// Linearizes a fit with the terms of the candidates at zero. A candidate with weights has them multiplied in, for each of its columns
    /// one for each observation, the same for all of a pose.
    pub fn new(
        fitted: Fitted<'_>,
        candidates: &[Candidate],
        weights: &[Vec<Vec<f64>>],
        data: &Dataset,
        noise: &Noise,
    ) -> Result<Self> {
        let Fitted { model, parameters: p, effects, .. } = fitted;
        let own = model.terms.len();
        let values: Vec<f64> = model.terms[effects..].iter().map(|t| t.value).collect();
        let terms: Vec<_> = candidates.iter().flat_map(|c| &c.terms).collect();
        let width = terms.len();
        let mut wide = model.clone();
        wide.terms.extend(terms.into_iter().cloned());
        let forward = Forward::new(wide, (0..p).chain(effects..own).collect())?;
        let motions: Vec<Option<usize>> = (own..own + width).map(|term| forward.motion(term)).collect();
        let Families { family, place, families } = Families::of(&motions);
        let whole: Vec<usize> = (0..width).filter(|column| motions[*column].is_none()).collect();
        let mut whole_of = vec![None; width];
        whole.iter().enumerate().for_each(|(k, column)| whole_of[place[*column]] = Some(k));
        let mut of_family = vec![None; families.len()];
        motions.iter().zip(&place).for_each(|(motion, at)| of_family[family[*at]] = *motion);
        let weights = by_column(candidates, weights);
        let total = p + values.len();

        let states = data.observations.chunk_by(say_the_same).count();
        let rows = data.scalars();
        let mut all = Self {
            residual: vec![0.0; rows],
            filter: Filter::new(CorrelatedNoise::WHITE, data),
            pose_of_row: vec![0; rows],
            sigma_of_row: Vec::with_capacity(rows),
            jacobian: Mat::zeros(rows, p),
            priors: fitted.priors(),
            first_row: vec![0],
            width,
            place,
            basis_values: vec![0.0; states * width],
            family,
            directions: Mat::zeros(rows, families.len()),
            families,
            whole: Mat::zeros(rows, whole.len()),
            whole_of,
        };
        let mut ws = forward.workspace();
        let mut block = vec![0.0; MOST_ROWS * total];
        let mut lengths = vec![0.0; all.families.len()];
        let mut row = 0;
        let mut index = 0;
        for (state, seen) in data.observations.chunk_by(say_the_same).enumerate() {
            if state % 64 == 0 {
                trical_model::interrupt::checkpoint()?;
            }
            let first = row;
            for (nth, o) in seen.iter().enumerate() {
                let n = forward.linearize_next(nth > 0, &o.state, (&o.measured, o.frame), &mut ws, &mut block);
                let tool = matches!(o.measured, Measured::Touch { .. }).then(|| forward.tool_axes(&ws));
                let sigmas: Vec<f64> = (0..n).map(|k| noise.sigma(o.recording, &o.measured, k)).collect();
                let weighted = |mut column: [f64; MOST_ROWS]| {
                    tool.iter().for_each(|tool| in_device_axes(tool, &mut column[..3]));
                    column.iter_mut().zip(&sigmas).for_each(|(v, sigma)| *v /= sigma);
                    column
                };
                for (k, residual) in weighted(*ws.residual()).into_iter().enumerate().take(n) {
                    // rotations of a pose are fitted, but a position error has no part in them
                    all.sigma_of_row.push((if k < 3 { sigmas[k] } else { 0.0 }, index + nth));
                    all.pose_of_row[row + k] = o.pose;
                    all.residual[row + k] = residual;
                }
                for j in 0..total {
                    let column = weighted(std::array::from_fn(|k| if k < n { block[k * total + j] } else { 0.0 }));
                    for (k, v) in column.iter().enumerate().take(n) {
                        match j.checked_sub(p) {
                            None => all.jacobian[(row + k, j)] = *v,
                            Some(effect) => all.residual[row + k] -= v * values[effect],
                        }
                    }
                }
                for (family, motion) in of_family.iter().enumerate() {
                    let Some(motion) = motion else { continue };
                    let does = weighted(*forward.does(*motion, &ws));
                    all.directions.col_mut(family)[row..row + n].copy_from_slice(&does[..n]);
                }
                for (k, column) in whole.iter().enumerate() {
                    let rows = weighted(forward.column(own + column, &o.measured, &ws));
                    all.whole.col_mut(k)[row..row + n].copy_from_slice(&rows[..n]);
                }
                row += n;
            }
            for (family, length) in lengths.iter_mut().enumerate() {
                let does = &mut all.directions.col_mut(family)[first..row];
                *length = does.iter().map(|v| v * v).sum::<f64>().sqrt();
                if *length > 0.0 {
                    does.iter_mut().for_each(|v| *v /= *length);
                }
            }
            let basis_values = &mut all.basis_values[state * width..(state + 1) * width];
            for (column, at) in all.place.iter().enumerate() {
                if all.whole_of[*at].is_none() {
                    basis_values[*at] = forward.amount(own + column, &ws) * lengths[all.family[*at]];
                }
            }
            for (column, weights) in &weights {
                basis_values[all.place[*column]] *= weights[index];
                if let Some(k) = all.whole_of[all.place[*column]] {
                    all.whole.col_mut(k)[first..row].iter_mut().for_each(|v| *v *= weights[index]);
                }
            }
            index += seen.len();
            all.first_row.push(row);
        }
        Ok(all)
    }

    /// Rows (scalars).
    pub fn rows(&self) -> usize {
        self.residual.len()
    }

    /// Entry of a column in a row.
    pub fn column_at(&self, row: usize, column: usize) -> f64 {
        let at = self.place[column];
        match self.whole_of[at] {
            Some(whole) => self.whole[(row, whole)],
            None => {
                let state = self.first_row.partition_point(|first| *first <= row) - 1;
                self.basis_values[state * self.width + at] * self.directions[(row, self.family[at])]
            }
        }
    }

    /// A column, all rows.
    pub fn column(&self, column: usize, out: &mut [f64]) {
        let at = self.place[column];
        if let Some(whole) = self.whole_of[at] {
            out.copy_from_slice(self.whole.col(whole));
            return;
        }
        let direction = self.directions.col(self.family[at]);
        for (i, rows) in self.first_row.windows(2).enumerate() {
            let basis_value = self.basis_values[i * self.width + at];
            for (v, d) in out[rows[0]..rows[1]].iter_mut().zip(&direction[rows[0]..rows[1]]) {
                *v = basis_value * d;
            }
        }
    }

    /// All columns after the filter, `rows x width`.
    pub fn columns(&self) -> Mat {
        self.filtered(0..self.width)
    }

    /// Some columns after the filter.
    fn filtered(&self, columns: impl ExactSizeIterator<Item = usize>) -> Mat {
        let mut all = Mat::zeros(self.rows(), columns.len());
        for (k, column) in columns.enumerate() {
            self.column(column, all.col_mut(k));
        }
        self.filter.apply_to_all(&mut all);
        all
    }

    /// `(WX)'Y` of all columns `X`, `width x k`, for `rows x k` numbers.
    pub fn products(&self, mut with: Mat) -> Mat {
        if self.filter.works() {
            (0..with.ncols()).for_each(|j| self.filter.apply_transposed(with.col_mut(j)));
        }
        self.products_with(&with, |family, column, out| {
            let of = (self.directions.col(family), with.col(column));
            self.in_each_state(of, out);
        })
    }

    /// `(WX)'WY` of all columns `X`, `width x k`, for some of them.
    pub fn products_of(&self, columns: &[usize]) -> Mat {
        let rows = self.filtered(columns.iter().copied());
        if self.filter.works() {
            return self.products(rows);
        }
        // two columns along directions: what their bases say, times what the directions have in common
        let mut sources: Vec<usize> = columns.iter().map(|a| self.family[self.place[*a]]).collect();
        sources.sort_unstable();
        sources.dedup();
        let families = self.families.len();
        let common: Vec<Vec<f64>> = (0..sources.len() * families)
            .into_par_iter()
            .map(|k| {
                let of = [sources[k / families], k % families].map(|family| self.directions.col(family));
                let mut out = vec![0.0; self.states()];
                self.in_each_state((of[0], of[1]), &mut out);
                out
            })
            .collect();
        let basis_values: Vec<Option<(usize, Vec<f64>)>> = columns
            .iter()
            .map(|a| {
                let at = self.place[*a];
                let source = sources.binary_search(&self.family[at]).ok().filter(|_| self.whole_of[at].is_none())?;
                Some((source, (0..self.states()).map(|state| self.basis_values[state * self.width + at]).collect()))
            })
            .collect();
        self.products_with(&rows, |family, column, out| match &basis_values[column] {
            Some((source, basis_values)) => {
                for ((v, s), c) in out.iter_mut().zip(basis_values).zip(&common[source * families + family]) {
                    *v = s * c;
                }
            }
            None => {
                let of = (self.directions.col(family), rows.col(column));
                self.in_each_state(of, out);
            }
        })
    }

    /// In how many states the arm was measured.
    fn states(&self) -> usize {
        self.first_row.len() - 1
    }

    /// Inner products of two columns of rows in each state.
    fn in_each_state(&self, (a, b): (&[f64], &[f64]), out: &mut [f64]) {
        for (sum, rows) in out.iter_mut().zip(self.first_row.windows(2)) {
            *sum = a[rows[0]..rows[1]].iter().zip(&b[rows[0]..rows[1]]).map(|(a, b)| a * b).sum();
        }
    }

    /// As [`Linear::products`]; `along` gives the inner products of a column of `with` with a family's direction in each state.
    fn products_with(&self, with: &Mat, along: impl Fn(usize, usize, &mut [f64]) + Sync) -> Mat {
        let k = with.ncols();
        let mut all = Mat::zeros(self.width, k);
        let pieces: Vec<(usize, Range<usize>)> = (0..self.families.len())
            .flat_map(|f| {
                let (first, end) = self.families[f];
                (first..end).step_by(PIECE).map(move |from| (f, from..end.min(from + PIECE)))
            })
            .collect();
        let mut by_place: Vec<(usize, usize)> = vec![(0, 0); self.width];
        for (piece, (_, places)) in pieces.iter().enumerate() {
            for (k, at) in places.clone().enumerate() {
                by_place[at] = (piece, k);
            }
        }
        for first in (0..k).step_by(BATCH) {
            let some = first..k.min(first + BATCH);
            let products: Vec<Mat> = pieces
                .par_iter()
                .map(|(family, places)| {
                    self.piece(places.clone(), some.clone(), &|column, out| along(*family, column, out))
                })
                .collect();
            for (j, column) in some.enumerate() {
                for (v, at) in all.col_mut(column).iter_mut().zip(&self.place) {
                    let (piece, k) = by_place[*at];
                    *v = products[piece][(k, j)];
                }
            }
        }
        let whole = self.whole.transpose() * with;
        for (column, at) in self.place.iter().enumerate() {
            if let Some(row) = self.whole_of[*at] {
                for j in 0..k {
                    all[(column, j)] = whole[(row, j)];
                }
            }
        }
        all
    }

    /// Products of some places of a family with some columns.
    fn piece(&self, places: Range<usize>, some: Range<usize>, along: &dyn Fn(usize, &mut [f64])) -> Mat {
        let mut numbers = Mat::zeros(self.states(), some.len());
        for (j, column) in some.enumerate() {
            along(column, numbers.col_mut(j));
        }
        let basis_values =
            View::of_rows(&self.basis_values, self.states(), self.width).columns(places.start, places.len());
        basis_values.transpose() * &numbers
    }

    /// Inner products of the columns of each span with each other after the filter: row by row of the lower triangle, diagonal included.
    pub fn products_among(&self, spans: &[(usize, usize)]) -> Vec<Vec<f64>> {
        // several spans together, so that the filter has enough to do at once
        let chunks: Vec<&[(usize, usize)]> = spans.chunks(if self.filter.works() { BATCH } else { 1 }).collect();
        chunks.into_par_iter().flat_map_iter(|spans| self.products_among_some(spans)).collect()
    }

    fn products_among_some(&self, spans: &[(usize, usize)]) -> Vec<Vec<f64>> {
        let (Some(first), Some(last)) = (spans.first(), spans.last()) else { return Vec::new() };
        let all = first.0..last.1;
        let any_whole = self.filter.works() || all.clone().any(|a| self.whole_of[self.place[a]].is_some());
        let columns = if any_whole {
            self.filtered(all.clone())
        } else {
            let value = |state, k| self.basis_values[state * self.width + self.place[all.start + k]];
            Mat::from_fn(self.states(), all.len(), value)
        };
        let between = |i: usize, j: usize| -> f64 {
            let products = columns.col(i).iter().zip(columns.col(j)).map(|(a, b)| a * b);
            let [a, b] = [i, j].map(|k| self.family[self.place[all.start + k]]);
            if any_whole || a == b {
                return products.sum();
            }
            let [u, v] = [a, b].map(|family| self.directions.col(family));
            let common =
                |state: usize| (self.first_row[state]..self.first_row[state + 1]).map(|r| u[r] * v[r]).sum::<f64>();
            products.enumerate().map(|(state, product)| product * common(state)).sum()
        };
        let of = |(from, to): &(usize, usize)| {
            let own = from - all.start..to - all.start;
            own.clone().flat_map(|i| (own.start..=i).map(move |j| (i, j))).map(|(i, j)| between(i, j)).collect()
        };
        spans.iter().map(of).collect()
    }
}

/// Whether a basis says the same of both: it asks for the arm's state, and of what was measured only for the readings of a touch.
fn say_the_same(a: &Observation, b: &Observation) -> bool {
    let is_touch = |o: &Observation| matches!(o.measured, Measured::Touch { .. });
    a.is_in_state_of(b) && !is_touch(a) && !is_touch(b)
}

/// Columns of one motion stand together.
struct Families {
    /// Family of each place.
    family: Vec<usize>,
    /// Where each column stands.
    place: Vec<usize>,
    /// First and one past the last place of each family.
    families: Vec<(usize, usize)>,
}

impl Families {
    /// Of columns with these motions; those that are not one motion scaled by a number stand together too.
    fn of(motions: &[Option<usize>]) -> Self {
        let mut columns: Vec<usize> = (0..motions.len()).collect();
        columns.sort_by_key(|column| motions[*column]);
        let mut all = Self { family: Vec::new(), place: vec![0; motions.len()], families: Vec::new() };
        for (at, column) in columns.iter().enumerate() {
            all.place[*column] = at;
            if at == 0 || motions[columns[at - 1]] != motions[*column] {
                all.families.push((at, at));
            }
            all.family.push(all.families.len() - 1);
            all.families[all.family[at]].1 = at + 1;
        }
        all
    }
}

/// Weights by which columns are multiplied, with those columns.
fn by_column<'a>(candidates: &[Candidate], weights: &'a [Vec<Vec<f64>>]) -> Vec<(usize, &'a [f64])> {
    let mut all: Vec<(usize, &[f64])> = Vec::new();
    let mut column = 0;
    for (k, c) in candidates.iter().enumerate() {
        for (j, weights) in weights.get(k).into_iter().flatten().enumerate() {
            all.push((column + j, weights));
        }
        column += c.terms.len();
    }
    all
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use nalgebra::Vector3;

    use super::*;
    use crate::catalogue::catalogue;
    use crate::covariates::Covariates;
    use crate::test_data::with_joint_2;

    /// Nine touches by an arm that gives way, and all that can be asked of them.
    fn made() -> (Model, Dataset, Vec<Candidate>) {
        let (model, data) = with_joint_2(&[]);
        let data = data.filtered(|o| o.row <= 9);
        let candidates = catalogue(&Covariates::new(&model, &data, 1e-5).deflected(true), &[]).0;
        (model, data, candidates)
    }

    /// How a residual of a touch, in the device's axes and in units of the noise, changes with the coefficient of a term.
    fn differences(model: &Model, data: &Dataset, term: &Term, size: f64) -> Vec<f64> {
        let noise = Noise::usual(1);
        let ways = [size, -size].map(|value| {
            let mut model = model.clone();
            model.terms.push(Term { value, ..term.clone() });
            Forward::new(model, Vec::new()).unwrap()
        });
        let plain = Forward::new(model.clone(), Vec::new()).unwrap();
        let mut ws = plain.workspace();
        let mut all = Vec::new();
        for o in &data.observations {
            let [up, down] = ways.each_ref().map(|forward| {
                let mut ws = forward.workspace();
                forward.residual(&o.state, &o.measured, o.frame, &mut ws);
                Vector3::from_column_slice(&ws.residual()[..3])
            });
            let tool = plain.world_from_tool(&o.state, &mut ws).rotation;
            let d = tool.transpose() * (up - down) / (2.0 * size);
            all.extend((0..3).map(|k| d[k] / noise.sigma(0, &o.measured, k)));
        }
        all
    }

    #[test]
    fn a_column_is_the_change_of_the_residual_with_its_coefficient() {
        let (model, data, candidates) = made();
        let linear = Linear::new(Fitted::all(&model), &candidates, &[], &data, &Noise::usual(1)).unwrap();
        let terms = candidates.iter().flat_map(|c| c.terms.iter().zip(&c.scales));
        let mut columns = 0;
        for (column, (term, scale)) in terms.enumerate() {
            let mut own = vec![0.0; linear.rows()];
            linear.column(column, &mut own);
            let expected = differences(&model, &data, term, 1e-3 * scale);
            let largest = expected.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
            for (row, (a, b)) in own.iter().zip(&expected).enumerate() {
                assert!((a - b).abs() <= 1e-5 * largest + 1e-9 / scale, "{}, row {row}: {a} {b}", term.name);
                assert_eq!(*a, linear.column_at(row, column));
            }
            columns += 1;
        }
        assert!(columns > 200, "{columns}");
    }

    #[test]
    fn touches_that_follow_each_other_in_one_state_keep_their_own_readings() {
        let (model, mut data, candidates) = made();
        let twice = data.observations.iter().flat_map(|o| {
            let Measured::Touch { ball, reading } = o.measured else { return [*o; 2] };
            let again = reading.map(|r| 0.2e-3 - r);
            [*o, Observation { measured: Measured::Touch { ball, reading: again }, ..*o }]
        });
        data.observations = twice.collect();
        let linear = Linear::new(Fitted::all(&model), &candidates, &[], &data, &Noise::usual(1)).unwrap();
        let terms = candidates.iter().flat_map(|c| c.terms.iter().zip(&c.scales)).enumerate();
        let of_readings = terms.filter(|(_, (t, _))| matches!(t.basis.of, trical_model::Variable::Reading { .. }));
        let mut columns = 0;
        for (column, (term, scale)) in of_readings {
            let mut own = vec![0.0; linear.rows()];
            linear.column(column, &mut own);
            let expected = differences(&model, &data, term, 1e-3 * scale);
            let largest = expected.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
            assert!(own.iter().zip(&expected).all(|(a, b)| (a - b).abs() <= 1e-5 * largest), "{}", term.name);
            columns += 1;
        }
        assert!(columns > 2, "{columns}");
    }

    #[test]
    fn rows_stand_in_the_order_of_the_touches_with_their_poses_and_the_parameters_beside_them() {
        let (model, data, _) = made();
        let linear = Linear::new(Fitted::all(&model), &[], &[], &data, &Noise::usual(1)).unwrap();
        assert_eq!((linear.rows(), linear.jacobian.ncols()), (27, model.terms.len()));
        assert!(linear.pose_of_row.iter().copied().eq((0..27).map(|row| row / 3)));
        assert!(linear.sigma_of_row.iter().map(|s| s.1).eq((0..27).map(|row| row / 3)));
        for (j, t) in model.terms.iter().enumerate() {
            // the same term once more
            let expected = differences(&model, &data, &Term { name: "again".into(), ..t.clone() }, 1e-6);
            for (row, v) in expected.iter().enumerate() {
                assert!((linear.jacobian[(row, j)] - v).abs() <= 1e-4 * v.abs() + 1e-1, "{}, row {row}: {v}", t.name);
            }
        }
    }

    #[test]
    fn weights_of_a_candidate_are_factors_of_its_touches() {
        let (model, data, candidates) = made();
        let of = |weights: &[Vec<Vec<f64>>]| {
            let linear = Linear::new(Fitted::all(&model), &candidates[..2], weights, &data, &Noise::usual(1)).unwrap();
            (0..linear.rows()).map(|row| [0, 1].map(|column| linear.column_at(row, column))).collect::<Vec<_>>()
        };
        let half = (0..9).map(|k| if k < 4 { 0.5 } else { 0.0 }).collect();
        for (row, (plain, weighed)) in of(&[]).iter().zip(of(&[Vec::new(), vec![half]])).enumerate() {
            let factor = if row < 12 { 0.5 } else { 0.0 };
            assert_eq!(weighed, [plain[0], factor * plain[1]], "row {row}");
        }
    }

    #[test]
    fn what_is_known_beforehand_is_a_row_in_standard_deviations() {
        let (mut model, _, _) = made();
        model.terms.truncate(3);
        model.terms[1].value = 7.0;
        let known = [PriorKnowledge::NOTHING, PriorKnowledge::about_zero(2.0)];
        let priors = Fitted { known: &known, ..Fitted::all(&model) }.priors();
        assert!(priors.iter().map(|p| (p.column, p.weight, p.residual)).eq([(1, 0.5, 3.5)]));
    }
}
