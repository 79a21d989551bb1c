//! The linearized fit itself: residual, derivatives to the fitted parameters, and the columns of the candidates.
//!
//! Most columns are one direction of their site at a measurement times a number that their basis says: they are stored as that
//! number, one for each measurement instead of one for each row, and inner products are taken of the numbers.

use std::ops::Range;

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::{Accum, Mat, MatRef, Par};
use pulp::Arch;
use rayon::prelude::*;
use trical_ident::dataset::Dataset;
use trical_ident::error::Result;
use trical_ident::known::Known;
use trical_ident::noise::Noise;
use trical_model::{Basis, Forward, Measured, Model, Site, Term, residual_rows};

use crate::candidate::Candidate;
use crate::correlated_noise::{CorrelatedNoise, Filter, in_device_axes};

/// Columns of one piece of a product.
const PIECE: usize = 512;

/// Columns on the other side of a product that are taken at once.
const BATCH: usize = 64;

/// Largest part of a column's length beside its site's direction that is rounding.
const ROUNDING: f64 = 1e-13;

/// Most rows of a measurement.
const MOST_ROWS: usize = 6;

/// A fit that is linearized.
#[derive(Clone, Copy)]
pub struct Fitted<'a> {
    /// Where.
    pub model: &'a Model,
    /// What was known of its terms beforehand, in their order; nothing beyond its end.
    pub known: &'a [Known],
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
        let of = |(column, (t, k)): (usize, (&Term, &Known))| {
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
    pub jacobian: Mat<f64>,
    /// What is known of these beforehand.
    pub(super) priors: Vec<PriorRow>,
    /// First row of each observation, and one past the last.
    first_row: Vec<usize>,
    /// How many candidate columns.
    width: usize,
    /// Where each column is stored: columns of one family stand together.
    place: Vec<usize>,
    /// What its basis says of each column, `observations x width`, row-major, by place.
    says: Vec<f64>,
    /// Places of each family.
    families: Vec<(usize, usize)>,
    /// Family of each place.
    family: Vec<usize>,
    /// Unit direction of each family at each observation, `rows x families`.
    directions: Mat<f64>,
    /// Columns that are not along their family's direction, all rows, and by place which of them it is. What `says` has for them is
    /// zero.
    whole: Mat<f64>,
    whole_of: Vec<Option<usize>>,
}

impl Linear {
    /// Linearizes a fit with the terms of the candidates at zero. A candidate with weights has them multiplied in, for each of its columns
    /// one for each observation.
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
        let Families { by_family, place, families } = Families::of(&terms);
        let factors = factors(candidates, weights, &place);
        let mut wide = model.clone();
        wide.terms.extend(by_family.iter().map(|(_, column)| terms[*column].clone()));
        let free = (0..p).chain(effects..own + width).collect();
        let forward = Forward::new(wide, free)?;
        let first = p + values.len();
        let total = first + width;

        let count = data.observations.len();
        let rows: usize = data.observations.iter().map(|o| residual_rows(&o.measured)).sum();
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
            says: vec![0.0; count * width],
            family: by_family.iter().map(|(family, _)| *family).collect(),
            directions: Mat::zeros(rows, families.len()),
            families,
            whole: Mat::zeros(rows, 0),
            whole_of: vec![None; width],
        };
        let mut ws = forward.workspace();
        let mut block = vec![0.0; MOST_ROWS * total];
        let mut along = Along::new(width);
        let mut row = 0;
        for (index, o) in data.observations.iter().enumerate() {
            if index % 64 == 0 {
                trical_model::interrupt::checkpoint()?;
            }
            let n = forward.linearize(&o.state, &o.measured, o.frame, &mut ws, &mut block);
            let mut residual = *ws.residual();
            if matches!(o.measured, Measured::Touch { .. }) {
                let tool = forward.world_from_tool(&o.state, &mut ws).rotation;
                in_device_axes(&tool, &mut residual[..3]);
                in_device_axes(&tool, &mut block[..3 * total]);
            }
            for k in 0..n {
                let sigma = noise.sigma(o.recording, &o.measured, k);
                let s = 1.0 / sigma;
                // rotations of a pose are fitted, but a position error has no part in them
                all.sigma_of_row.push((if k < 3 { sigma } else { 0.0 }, index));
                all.pose_of_row[row + k] = o.pose;
                let line = &mut block[k * total..(k + 1) * total];
                for v in line.iter_mut() {
                    *v *= s;
                }
                for (j, v) in line[..p].iter().enumerate() {
                    all.jacobian[(row + k, j)] = *v;
                }
                let taken: f64 = line[p..first].iter().zip(&values).map(|(column, value)| column * value).sum();
                all.residual[row + k] = residual[k] * s - taken;
            }
            let lines: Vec<&[f64]> = (0..n).map(|k| &block[k * total + first..(k + 1) * total]).collect();
            all.take(&lines, index, row, &factors, &mut along);
            row += n;
            all.first_row.push(row);
        }
        all.keep_whole(along);
        Ok(all)
    }

    /// Keeps the columns that are not along their family's direction.
    fn keep_whole(&mut self, along: Along) {
        let whole: Vec<(usize, Vec<f64>)> =
            along.whole.into_iter().enumerate().filter_map(|(at, whole)| Some((at, whole?))).collect();
        self.whole = Mat::zeros(self.rows(), whole.len());
        for (k, (at, column)) in whole.into_iter().enumerate() {
            self.whole.col_as_slice_mut(k).copy_from_slice(&column);
            self.whole_of[at] = Some(k);
        }
    }

    /// Takes an observation's part of all columns.
    fn take(&mut self, lines: &[&[f64]], index: usize, row: usize, factors: &[(usize, &[f64])], along: &mut Along) {
        let Self { directions, families, says, width, .. } = self;
        let says = &mut says[index * *width..(index + 1) * *width];
        Arch::new().dispatch(Squares { lines, squares: &mut along.squares });
        for (family, (from, to)) in families.iter().enumerate() {
            let squares = &along.squares[*from..*to];
            let longest = (0..squares.len()).fold(0, |best, k| if squares[k] > squares[best] { k } else { best });
            let length = squares[longest].sqrt();
            let mut direction = [0.0; MOST_ROWS];
            if length > 0.0 {
                for (k, line) in lines.iter().enumerate() {
                    direction[k] = line[from + longest] / length;
                    directions[(row + k, family)] = direction[k];
                }
            }
            Arch::new().dispatch(Onto {
                lines,
                from: *from,
                direction,
                says: &mut says[*from..*to],
                beside: &mut along.beside[*from..*to],
            });
        }
        let beside = along.squares.iter().zip(&along.beside);
        let crooked: Vec<usize> =
            beside.enumerate().filter(|(_, (s, b))| **b > ROUNDING * ROUNDING * **s).map(|(at, _)| at).collect();
        for at in crooked {
            if along.whole[at].is_none() {
                along.whole[at] = Some(self.whole_until(at, index));
            }
        }
        for (at, whole) in along.whole.iter_mut().enumerate() {
            if let Some(whole) = whole {
                self.says[index * self.width + at] = 0.0;
                for (k, line) in lines.iter().enumerate() {
                    whole[row + k] = line[at];
                }
            }
        }
        for (at, weights) in factors {
            self.says[index * self.width + at] *= weights[index];
            if let Some(whole) = &mut along.whole[*at] {
                whole[row..row + lines.len()].iter_mut().for_each(|v| *v *= weights[index]);
            }
        }
    }

    /// The rows before observation `until` of a column that turns out not to be along its family's direction there.
    fn whole_until(&mut self, at: usize, until: usize) -> Vec<f64> {
        let mut whole = vec![0.0; self.residual.len()];
        for i in 0..until {
            let says = std::mem::take(&mut self.says[i * self.width + at]);
            for (row, v) in whole.iter_mut().enumerate().take(self.first_row[i + 1]).skip(self.first_row[i]) {
                *v = says * self.directions[(row, self.family[at])];
            }
        }
        whole
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
                let observation = self.sigma_of_row[row].1;
                self.says[observation * self.width + at] * self.directions[(row, self.family[at])]
            }
        }
    }

    /// A column, all rows.
    pub fn column(&self, column: usize, out: &mut [f64]) {
        let at = self.place[column];
        if let Some(whole) = self.whole_of[at] {
            out.copy_from_slice(self.whole.col_as_slice(whole));
            return;
        }
        let direction = self.directions.col_as_slice(self.family[at]);
        for (i, rows) in self.first_row.windows(2).enumerate() {
            let says = self.says[i * self.width + at];
            for (v, d) in out[rows[0]..rows[1]].iter_mut().zip(&direction[rows[0]..rows[1]]) {
                *v = says * d;
            }
        }
    }

    /// All columns after the filter, `rows x width`.
    pub fn columns(&self) -> Mat<f64> {
        self.filtered(0..self.width)
    }

    /// Some columns after the filter.
    fn filtered(&self, columns: impl ExactSizeIterator<Item = usize>) -> Mat<f64> {
        let mut all = Mat::zeros(self.rows(), columns.len());
        for (k, column) in columns.enumerate() {
            self.column(column, all.col_as_slice_mut(k));
        }
        self.filter.apply_to_all(&mut all);
        all
    }

    /// `(WX)'Y` of all columns `X`, `width x k`, for `rows x k` numbers.
    pub fn products(&self, mut with: Mat<f64>) -> Mat<f64> {
        if self.filter.works() {
            (0..with.ncols()).for_each(|j| self.filter.apply_transposed(with.col_as_slice_mut(j)));
        }
        self.products_with(&with, |family, column, out| {
            let of = (self.directions.col_as_slice(family), with.col_as_slice(column));
            self.in_each_observation(of, out);
        })
    }

    /// `(WX)'WY` of all columns `X`, `width x k`, for some of them.
    pub fn products_of(&self, columns: &[usize]) -> Mat<f64> {
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
                let of = [sources[k / families], k % families].map(|family| self.directions.col_as_slice(family));
                let mut out = vec![0.0; self.first_row.len() - 1];
                self.in_each_observation((of[0], of[1]), &mut out);
                out
            })
            .collect();
        let says: Vec<Option<(usize, Vec<f64>)>> = columns
            .iter()
            .map(|a| {
                let at = self.place[*a];
                let source = sources.binary_search(&self.family[at]).ok().filter(|_| self.whole_of[at].is_none())?;
                Some((source, (0..self.first_row.len() - 1).map(|o| self.says[o * self.width + at]).collect()))
            })
            .collect();
        self.products_with(&rows, |family, column, out| match &says[column] {
            Some((source, says)) => {
                for ((v, s), c) in out.iter_mut().zip(says).zip(&common[source * families + family]) {
                    *v = s * c;
                }
            }
            None => {
                let of = (self.directions.col_as_slice(family), rows.col_as_slice(column));
                self.in_each_observation(of, out);
            }
        })
    }

    /// Inner products of two columns of rows in each observation.
    fn in_each_observation(&self, (a, b): (&[f64], &[f64]), out: &mut [f64]) {
        for (sum, rows) in out.iter_mut().zip(self.first_row.windows(2)) {
            *sum = a[rows[0]..rows[1]].iter().zip(&b[rows[0]..rows[1]]).map(|(a, b)| a * b).sum();
        }
    }

    /// As [`Linear::products`]; `along` gives the inner products of a column of `with` with a family's direction in each observation.
    fn products_with(&self, with: &Mat<f64>, along: impl Fn(usize, usize, &mut [f64]) + Sync) -> Mat<f64> {
        let k = with.ncols();
        let mut all = Mat::<f64>::zeros(self.width, k);
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
            let products: Vec<Mat<f64>> = pieces
                .par_iter()
                .map(|(family, places)| {
                    self.piece(places.clone(), some.clone(), &|column, out| along(*family, column, out))
                })
                .collect();
            for (j, column) in some.enumerate() {
                for (v, at) in all.col_as_slice_mut(column).iter_mut().zip(&self.place) {
                    let (piece, k) = by_place[*at];
                    *v = products[piece][(k, j)];
                }
            }
        }
        let mut whole = Mat::<f64>::zeros(self.whole.ncols(), k);
        matmul(whole.as_mut(), Accum::Replace, self.whole.transpose(), with.as_ref(), 1.0, Par::Seq);
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
    fn piece(&self, places: Range<usize>, some: Range<usize>, along: &dyn Fn(usize, &mut [f64])) -> Mat<f64> {
        let observations = self.first_row.len() - 1;
        let mut numbers = Mat::<f64>::zeros(observations, some.len());
        for (j, column) in some.enumerate() {
            along(column, numbers.col_as_slice_mut(j));
        }
        let mut out = Mat::<f64>::zeros(places.len(), numbers.ncols());
        let says = MatRef::from_row_major_slice(&self.says, observations, self.width);
        let says = says.subcols(places.start, places.len());
        matmul(out.as_mut(), Accum::Replace, says.transpose(), numbers.as_ref(), 1.0, Par::Seq);
        out
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
        let observations = self.first_row.len() - 1;
        let columns = if any_whole {
            self.filtered(all.clone())
        } else {
            Mat::from_fn(observations, all.len(), |o, k| self.says[o * self.width + self.place[all.start + k]])
        };
        let between = |i: usize, j: usize| -> f64 {
            let products = columns.col_as_slice(i).iter().zip(columns.col_as_slice(j)).map(|(a, b)| a * b);
            let [a, b] = [i, j].map(|k| self.family[self.place[all.start + k]]);
            if any_whole || a == b {
                return products.sum();
            }
            let [u, v] = [a, b].map(|family| self.directions.col_as_slice(family));
            let common = |o: usize| (self.first_row[o]..self.first_row[o + 1]).map(|r| u[r] * v[r]).sum::<f64>();
            products.enumerate().map(|(o, product)| product * common(o)).sum()
        };
        let of = |(from, to): &(usize, usize)| {
            let own = from - all.start..to - all.start;
            own.clone().flat_map(|i| (own.start..=i).map(move |j| (i, j))).map(|(i, j)| between(i, j)).collect()
        };
        spans.iter().map(of).collect()
    }
}

/// `X'X`.
pub(super) fn gram(x: &Mat<f64>) -> Mat<f64> {
    let mut all = Mat::<f64>::zeros(x.ncols(), x.ncols());
    let (lower, whole) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
    triangular::matmul(all.as_mut(), lower, Accum::Replace, x.transpose(), whole, x, whole, 1.0, Par::Seq);
    for j in 0..all.ncols() {
        for i in j + 1..all.ncols() {
            all[(j, i)] = all[(i, j)];
        }
    }
    all
}

/// Columns whose terms are at one site and of one kind stand together.
struct Families {
    /// Family and column, by family.
    by_family: Vec<(usize, usize)>,
    /// Where each column stands among these.
    place: Vec<usize>,
    /// First and one past the last place of each family.
    families: Vec<(usize, usize)>,
}

impl Families {
    fn of(terms: &[&Term]) -> Self {
        let width = terms.len();
        let mut kinds: Vec<(Site, bool)> = Vec::new();
        let mut by_family: Vec<(usize, usize)> = Vec::with_capacity(width);
        for (column, t) in terms.iter().enumerate() {
            // what is constant acts through torques too, what is not does not
            let kind = (t.site, t.basis == Basis::CONSTANT);
            let family = kinds.iter().position(|k| *k == kind).unwrap_or_else(|| {
                kinds.push(kind);
                kinds.len() - 1
            });
            by_family.push((family, column));
        }
        by_family.sort_unstable();
        let mut place = vec![0; width];
        let mut families = vec![(0, 0); kinds.len()];
        for (at, (family, column)) in by_family.iter().enumerate() {
            place[*column] = at;
            if families[*family].1 == 0 {
                families[*family].0 = at;
            }
            families[*family].1 = at + 1;
        }
        Self { by_family, place, families }
    }
}

/// Weights by which columns are multiplied, and the places of those columns.
fn factors<'a>(candidates: &[Candidate], weights: &'a [Vec<Vec<f64>>], place: &[usize]) -> Vec<(usize, &'a [f64])> {
    let mut factors: Vec<(usize, &[f64])> = Vec::new();
    let mut column = 0;
    for (k, c) in candidates.iter().enumerate() {
        for (j, weights) in weights.get(k).into_iter().flatten().enumerate() {
            factors.push((place[column + j], weights));
        }
        column += c.terms.len();
    }
    factors
}

/// What the parts of all columns at one observation are beside their families' directions.
struct Along {
    squares: Vec<f64>,
    beside: Vec<f64>,
    /// Columns that are not along it, all rows so far.
    whole: Vec<Option<Vec<f64>>>,
}

impl Along {
    fn new(width: usize) -> Self {
        Self { squares: vec![0.0; width], beside: vec![0.0; width], whole: vec![None; width] }
    }
}

/// Squared lengths of some rows' columns.
struct Squares<'a> {
    lines: &'a [&'a [f64]],
    squares: &'a mut [f64],
}

impl pulp::NullaryFnOnce for Squares<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.squares.fill(0.0);
        for line in self.lines {
            for (s, v) in self.squares.iter_mut().zip(*line) {
                *s += v * v;
            }
        }
    }
}

/// The parts of a family's columns along its direction, and the squared length of what is beside it.
struct Onto<'a> {
    lines: &'a [&'a [f64]],
    from: usize,
    direction: [f64; MOST_ROWS],
    says: &'a mut [f64],
    beside: &'a mut [f64],
}

impl pulp::NullaryFnOnce for Onto<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { lines, from, direction, says, beside } = self;
        let n = says.len();
        says.fill(0.0);
        for (line, d) in lines.iter().zip(direction) {
            for (s, v) in says.iter_mut().zip(&line[from..from + n]) {
                *s += v * d;
            }
        }
        beside.fill(0.0);
        for (line, d) in lines.iter().zip(direction) {
            for ((b, s), v) in beside.iter_mut().zip(&*says).zip(&line[from..from + n]) {
                let left = v - s * d;
                *b += left * left;
            }
        }
    }
}
