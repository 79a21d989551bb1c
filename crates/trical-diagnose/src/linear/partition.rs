//! A set of candidates fitted without each part of the poses in turn: what the poses of a part say of it when it was learnt on the
//! others.
//!
//! With `H` the normal matrix of the fitted rows (priors included), `x` the solution and `E = X_t H^-1` for the rows `X_t` that are
//! predicted, columns `o` are taken out by `x' = x - H^-1[:, o] y`, `y = H^-1[o, o]^-1 x[o]`, which changes the predicted residual by
//! `-E[:, o] y`; columns `A` are added by the Schur complement of `H`. Another set costs what its difference costs.
//!
//! A fit knows how well it knows what it predicts: the covariance of the rows of a block, in units of the noise, is
//! `S = I + X_t H^-1 X_t'`, less `E[:, o] H^-1[o, o]^-1 E[:, o]'` for what is taken out, plus the same of what is added. Log scores are those of this
//! density (Gneiting & Raftery 2007): where nothing like a block was visited, a fit that is far off is no surprise.

use rayon::prelude::*;
use trical_ident::dense::{Cholesky, Mat, View, solve_lower};

use super::columns::Linear;
use super::design::Design;

/// Keeps columns that the data absorb from doing harm: beside a length of one.
const DAMPING: f64 = 1e-10;

/// A joint fit in parts.
pub struct Partition<'a> {
    design: &'a Design,
    linear: &'a Linear,
    /// Candidates of the set, each with its columns in `fits`.
    set: Vec<(usize, std::ops::Range<usize>)>,
    /// Factor of each column that makes its length one.
    scale: Vec<f64>,
    /// Prior precisions of the scaled columns.
    precision: Vec<f64>,
    /// Rows of each part.
    rows: Vec<Vec<usize>>,
    /// All columns, scaled, in the rows of each part.
    columns: Vec<Mat>,
    /// Products of the columns, and with the residual, over each part.
    sums: Vec<Sums>,
    /// The same over all rows, and of the push also what is known beforehand.
    whole: Sums,
    /// The fit without each part.
    fits: Vec<Fit>,
}

/// Products of the columns with each other, and with the residual.
struct Sums {
    gram: Mat,
    push: Mat,
}

/// Rows of one block in a part, and Cholesky's factor of the covariance with which the whole set predicts them.
struct Block {
    part: usize,
    block: usize,
    rows: Vec<usize>,
    factor: Mat,
}

/// How well a joint fit in parts knows the blocks that it predicts.
pub struct Predictive {
    blocks: Vec<Block>,
    count: usize,
    /// The rows of each part in the measure of these covariances: `L^-1` of each block's.
    measured: Vec<Tested>,
}

/// The rows of a part as they are predicted, and how their covariance differs from that of the whole set, in whose measure they are: by
/// `- out out' + added added'`; where nothing was taken out of that set, but another fitted, from `I`.
struct Predicted<'t> {
    residual: Mat,
    out: Option<&'t Mat>,
    added: Mat,
}

/// The fit without a part when some columns are taken out of it.
struct TakenOut {
    /// `H^-1[o, o]`.
    factor: Cholesky,
    /// `H^-1[:, o]`, and `E[:, o]` of the rows that are predicted.
    inverse: Mat,
    hat: Mat,
    /// The solution, and what is left of the rows.
    x: Mat,
    residual: Mat,
    /// By what their covariance is smaller: `out out'`.
    out: Mat,
}

/// What is asked of rows that are predicted: their residuals alone, or with their covariance.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Asked {
    Residuals,
    Covariance,
}

/// A fit to the rows of the other parts.
struct Fit {
    inverse: Mat,
    x: Mat,
    tested: Tested,
}

/// The rows that it predicts.
#[derive(Clone)]
struct Tested {
    /// `X_t H^-1`.
    hat: Mat,
    /// Residual.
    residual: Mat,
}

/// A candidate beside the set.
struct Added {
    /// Prior precisions of its scaled columns.
    precision: Vec<f64>,
    parts: Vec<Seen>,
}

/// Its scaled columns in the rows of a part, and their products there: with the set, with each other, with the residual.
struct Seen {
    columns: Mat,
    with_set: Mat,
    with_itself: Mat,
    push: Mat,
}

impl<'a> Partition<'a> {
    /// Fits `set` in `count` parts; `part_of` says of each pose to which it belongs. `None` where a fit fails, or the design has no rows.
    #[must_use]
    pub fn new(design: &'a Design, set: &[usize], count: usize, part_of: &dyn Fn(usize) -> usize) -> Option<Self> {
        let mut this = Self::unfitted(design, set, count, part_of)?;
        let fits: Vec<Option<Fit>> = (0..count).into_par_iter().map(|part| this.without_part(part)).collect();
        this.fits = fits.into_iter().collect::<Option<Vec<_>>>()?;
        Some(this)
    }

    /// The sums over each part, which do not depend on the priors, without a fit: for [`Self::with_priors`].
    #[must_use]
    pub fn unfitted(design: &'a Design, set: &[usize], count: usize, part_of: &dyn Fn(usize) -> usize) -> Option<Self> {
        let linear = design.linear()?;
        let (p, m) = (linear.jacobian.ncols(), linear.rows());
        let mut at = p;
        let set: Vec<(usize, std::ops::Range<usize>)> = set
            .iter()
            .map(|c| {
                let (from, to) = design.span(*c);
                at += to - from;
                (*c, at - (to - from)..at)
            })
            .collect();
        let n = at;
        let mut entries = vec![0.0; m * n];
        for j in 0..p {
            entries[j * m..(j + 1) * m].copy_from_slice(linear.jacobian.col(j));
        }
        let mut precision = vec![0.0; n];
        for prior in &linear.priors {
            precision[prior.column] = prior.weight.powi(2);
        }
        for (c, range) in &set {
            let (from, to) = design.span(*c);
            for (a, j) in (from..to).zip(range.clone()) {
                linear.column(a, &mut entries[j * m..(j + 1) * m]);
                precision[j] = design.prior_precision(a);
            }
        }
        let mut scale = vec![0.0; n];
        for j in 0..n {
            let column = &mut entries[j * m..(j + 1) * m];
            let square: f64 = column.iter().map(|v| v * v).sum();
            scale[j] = if square > 0.0 { 1.0 / square.sqrt() } else { 1.0 };
            column.iter_mut().for_each(|v| *v *= scale[j]);
            precision[j] = precision[j] * scale[j] * scale[j] + DAMPING;
        }
        let mut rows = vec![Vec::new(); count];
        for (i, pose) in linear.pose_of_row.iter().enumerate() {
            rows[part_of(*pose) % count].push(i);
        }
        let columns = rows.iter().map(|rows| Mat::from_fn(rows.len(), n, |i, j| entries[j * m + rows[i]])).collect();
        let mut this = Self {
            design,
            linear,
            set,
            scale,
            precision,
            rows,
            columns,
            sums: Vec::new(),
            whole: Sums { gram: Mat::zeros(n, n), push: Mat::zeros(n, 1) },
            fits: Vec::new(),
        };
        let sums = |part: usize| {
            let x = &this.columns[part];
            Sums { gram: x.view().gram(), push: x.transpose() * &this.residual_of(part) }
        };
        this.sums = (0..count).into_par_iter().map(sums).collect();
        for sums in &this.sums {
            this.whole.gram += &sums.gram;
            this.whole.push += &sums.push;
        }
        for prior in &linear.priors {
            this.whole.push[(prior.column, 0)] += this.scale[prior.column] * prior.weight * prior.residual;
        }
        Some(this)
    }

    /// Some scaled columns in the rows of a part.
    fn rows_of(&self, part: usize, columns: &[usize]) -> Mat {
        Mat::from_fn(self.rows[part].len(), columns.len(), |i, j| self.columns[part][(i, columns[j])])
    }

    /// Normal matrix and right side of some columns over the other parts, with their priors' precisions.
    fn normal(&self, part: usize, columns: &[usize], precision: &[f64]) -> (Mat, Mat) {
        let n = columns.len();
        let (whole, own) = (&self.whole, &self.sums[part]);
        let mut h = Mat::from_fn(n, n, |i, j| {
            let at = (columns[i], columns[j]);
            whole.gram[at] - own.gram[at]
        });
        for (i, j) in columns.iter().enumerate() {
            h[(i, i)] += precision[*j];
        }
        let g = Mat::from_fn(n, 1, |i, _| own.push[(columns[i], 0)] - whole.push[(columns[i], 0)]);
        (h, g)
    }

    fn without_part(&self, part: usize) -> Option<Fit> {
        let all: Vec<usize> = (0..self.scale.len()).collect();
        let (h, g) = self.normal(part, &all, &self.precision);
        let factor = Cholesky::of(&h)?;
        let (inverse, x) = (factor.inverse(), factor.solve(&g));
        let tested = &self.columns[part];
        let mut residual = self.residual_of(part);
        residual.add_product(1.0, tested, &x);
        let hat = tested * &inverse;
        Some(Fit { inverse, x, tested: Tested { hat, residual } })
    }

    /// A part's rows by the fit of some columns alone, with these precisions, to the other parts.
    fn predicted_by<'t>(
        &self,
        part: usize,
        columns: &[usize],
        precision: &[f64],
        asked: Asked,
    ) -> Option<Predicted<'t>> {
        let (h, g) = self.normal(part, columns, precision);
        let factor = Cholesky::of(&h)?;
        let rows = self.rows_of(part, columns);
        let residual = self.residual_of(part) + &(&rows * &factor.solve(&g));
        Some(Predicted { residual, out: None, added: asked.over_root(&rows, factor.lower()) })
    }

    /// Residual of a part's rows without any fit.
    fn residual_of(&self, part: usize) -> Mat {
        Mat::from_fn(self.rows[part].len(), 1, |i, _| self.linear.residual[self.rows[part][i]])
    }

    fn columns_of(&self, members: &[usize]) -> Vec<usize> {
        self.set.iter().filter(|(c, _)| members.contains(c)).flat_map(|(_, range)| range.clone()).collect()
    }

    /// Residuals (in standard deviations) of all rows, each predicted by the fit without its part, of the set without the candidates `out`
    /// and with `add` in their place. Rows of a fit that fails are not predicted at all (infinite).
    #[must_use]
    pub fn instead(&self, out: &[usize], add: Option<usize>) -> Vec<f64> {
        let (o, added) = (self.columns_of(out), add.map(|c| self.added(c)));
        let tested = |part: usize| &self.fits[part].tested;
        let taken_out = self.taken_out(&o, &[add], &tested, Asked::Residuals);
        let one = |part: usize| {
            self.predicted(part, tested(part), (&o, taken_out[part].as_ref()), added.as_ref(), Asked::Residuals)
        };
        self.in_rows((0..self.rows.len()).into_par_iter().map(one).collect())
    }

    /// The same of the whole set, with the standard deviations that are known beforehand `factor` times as large; it says that of each candidate.
    #[must_use]
    pub fn with_priors(&self, factor: &dyn Fn(usize) -> f64) -> Vec<f64> {
        let mut precision = self.precision.clone();
        for (c, range) in &self.set {
            precision[range.clone()].iter_mut().for_each(|p| *p /= factor(*c).powi(2));
        }
        let all: Vec<usize> = (0..self.scale.len()).collect();
        let one = |part: usize| self.predicted_by(part, &all, &precision, Asked::Residuals);
        self.in_rows((0..self.rows.len()).into_par_iter().map(one).collect())
    }

    /// What is left of each row.
    fn in_rows(&self, predicted: Vec<Option<Predicted<'_>>>) -> Vec<f64> {
        let mut all = vec![f64::INFINITY; self.linear.rows()];
        for (rows, predicted) in self.rows.iter().zip(predicted) {
            let Some(predicted) = predicted else { continue };
            for (i, row) in rows.iter().enumerate() {
                all[*row] = predicted.residual[(i, 0)];
            }
        }
        all
    }

    /// How well it knows the blocks that it predicts: `block_of` says of each pose to which of `count` it belongs, or that it is not scored.
    /// `None` where a covariance has no root.
    #[must_use]
    pub fn predictive(&self, count: usize, block_of: &dyn Fn(usize) -> Option<usize>) -> Option<Predictive> {
        let mut blocks = Vec::new();
        for (part, rows) in self.rows.iter().enumerate() {
            let mut of: std::collections::BTreeMap<usize, Vec<usize>> = std::collections::BTreeMap::new();
            for (i, row) in rows.iter().enumerate() {
                if let Some(block) = block_of(self.linear.pose_of_row[*row]) {
                    of.entry(block).or_default().push(i);
                }
            }
            blocks.extend(of.into_iter().map(|(block, rows)| (part, block, rows)));
        }
        let one = |(part, block, rows): (usize, usize, Vec<usize>)| {
            let (hat, x) = (some_rows(&self.fits[part].tested.hat, &rows), some_rows(&self.columns[part], &rows));
            let factor = Cholesky::of(&identity_and(1.0, hat.view(), x.transpose()))?.lower().clone();
            Some(Block { part, block, rows, factor })
        };
        let blocks: Option<Vec<Block>> = blocks.into_par_iter().map(one).collect();
        let measured = self.fits.iter().map(|fit| fit.tested.clone()).collect();
        let mut this = Predictive { blocks: blocks?, count, measured };
        for b in &this.blocks {
            let Tested { hat, residual } = &mut this.measured[b.part];
            b.measure(hat);
            b.measure(residual);
        }
        Some(this)
    }

    /// Columns of a candidate, scaled, and their products over each part.
    fn added(&self, candidate: usize) -> Added {
        let (from, to) = self.design.span(candidate);
        let k = to - from;
        let mut columns = Mat::zeros(self.linear.rows(), k);
        let mut precision = Vec::with_capacity(k);
        for a in from..to {
            let column = columns.col_mut(a - from);
            self.linear.column(a, column);
            let square: f64 = column.iter().map(|v| v * v).sum();
            let scale = if square > 0.0 { 1.0 / square.sqrt() } else { 1.0 };
            column.iter_mut().for_each(|v| *v *= scale);
            precision.push(self.design.prior_precision(a) * scale * scale + DAMPING);
        }
        let sums = |part: usize| {
            let seen = Mat::from_fn(self.rows[part].len(), k, |i, j| columns[(self.rows[part][i], j)]);
            let (with_set, with_itself) = (self.columns[part].transpose() * &seen, seen.view().gram());
            let push = seen.transpose() * &self.residual_of(part);
            Seen { columns: seen, with_set, with_itself, push }
        };
        Added { precision, parts: (0..self.rows.len()).map(sums).collect() }
    }

    /// Whether less of the set is left without the columns `o` than goes.
    fn keeps_less(&self, o: &[usize]) -> bool {
        2 * o.len() > self.scale.len()
    }

    /// The fit without each part when the columns `o` are taken out of it; `tested` has the rows that it predicts. `None` where none of `adds`
    /// asks for it.
    fn taken_out<'t>(
        &self,
        o: &[usize],
        adds: &[Option<usize>],
        tested: &(dyn Fn(usize) -> &'t Tested + Sync),
        asked: Asked,
    ) -> Vec<Option<TakenOut>> {
        let is_asked = !self.keeps_less(o) || adds.iter().any(Option::is_some);
        let one = |part: usize| {
            let (fit, tested) = (&self.fits[part], tested(part));
            let pick = |m: &Mat| Mat::from_fn(m.nrows(), o.len(), |i, j| m[(i, o[j])]);
            let factor = Cholesky::of(&Mat::from_fn(o.len(), o.len(), |i, j| fit.inverse[(o[i], o[j])]))?;
            let y = factor.solve(&Mat::from_fn(o.len(), 1, |i, _| fit.x[(o[i], 0)]));
            let (inverse, hat) = (pick(&fit.inverse), pick(&tested.hat));
            let (mut x, mut residual) = (fit.x.clone(), tested.residual.clone());
            x.add_product(-1.0, &inverse, &y);
            residual.add_product(-1.0, &hat, &y);
            let out = asked.over_root(&hat, factor.lower());
            Some(TakenOut { factor, inverse, hat, x, residual, out })
        };
        (0..self.rows.len()).into_par_iter().map(|part| is_asked.then(|| one(part)).flatten()).collect()
    }

    /// The rows of a part, `tested` by the fit to the others, without the columns `o` (which were `taken_out`) and with others in their place.
    fn predicted<'t>(
        &self,
        part: usize,
        tested: &Tested,
        (o, taken_out): (&[usize], Option<&'t TakenOut>),
        add: Option<&Added>,
        asked: Asked,
    ) -> Option<Predicted<'t>> {
        if add.is_none() && self.keeps_less(o) {
            let kept: Vec<usize> = (0..self.scale.len()).filter(|j| !o.contains(j)).collect();
            return self.predicted_by(part, &kept, &self.precision, asked);
        }
        let TakenOut { factor, inverse, hat, x, residual, out } = taken_out?;
        let mut residual = residual.clone();
        let Some(added) = add else {
            let none = Mat::zeros(residual.nrows(), 0);
            return Some(Predicted { residual, out: Some(out), added: none });
        };
        // sums over the rows that are fitted
        let (n, k) = (self.scale.len(), added.precision.len());
        let (mut a, mut aa, mut ar) = (Mat::zeros(n, k), Mat::zeros(k, k), Mat::zeros(k, 1));
        for (_, seen) in added.parts.iter().enumerate().filter(|(other, _)| *other != part) {
            a += &seen.with_set;
            aa += &seen.with_itself;
            ar += &seen.push;
        }
        for (j, precision) in added.precision.iter().enumerate() {
            aa[(j, j)] += precision;
        }
        // what the set without these columns leaves of the new ones
        let through = factor.solve(&(inverse.transpose() * &a));
        let mut solved = &self.fits[part].inverse * &a;
        solved.add_product(-1.0, inverse, &through);
        aa.add_product(-1.0, a.transpose(), &solved);
        let complement = Cholesky::of(&aa)?;
        ar.add_product(1.0, a.transpose(), x);
        let mut shown = added.parts[part].columns.clone();
        shown.add_product(-1.0, &tested.hat, &a);
        shown.add_product(1.0, hat, &through);
        residual.add_product(-1.0, &shown, &complement.solve(&ar));
        Some(Predicted { residual, out: Some(out), added: asked.over_root(&shown, complement.lower()) })
    }

    /// Pose of each row.
    #[must_use]
    pub fn pose_of_row(&self) -> &[usize] {
        &self.linear.pose_of_row
    }

    /// Position errors (m) of the observations of one part, or of all, by residuals as [`Self::instead`] gives them; those that were not
    /// predicted are left out.
    #[must_use]
    pub fn position_errors(&self, residuals: &[f64], part: Option<usize>) -> Vec<f64> {
        let mut scored = vec![part.is_none(); residuals.len()];
        for row in part.map_or(&[][..], |part| &self.rows[part]) {
            scored[*row] = true;
        }
        let mut squares: Vec<(usize, f64)> = Vec::new();
        let rows = residuals.iter().zip(&self.linear.sigma_of_row).zip(scored);
        for ((r, (sigma, observation)), _) in rows.filter(|(_, scored)| *scored) {
            let square = (r * sigma).powi(2);
            match squares.last_mut() {
                Some((last, sum)) if last == observation => *sum += square,
                _ => squares.push((*observation, square)),
            }
        }
        squares.into_iter().map(|(_, s)| s.sqrt()).filter(|e| e.is_finite()).collect()
    }
}

/// A block by a fit that did not see it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Foreseen {
    /// How many rows it has.
    pub rows: f64,
    /// Square of the residual's length in standard deviations of what is predicted.
    pub square: f64,
    /// Logarithm of the determinant of the covariance of what is predicted.
    pub log_covariance: f64,
}

impl Predictive {
    /// Each block by the joint fit without the candidates `out`, once with each of `adds` in their place; one that is not scored has no rows.
    /// `None` where a fit fails.
    #[must_use]
    pub fn of_blocks(&self, fits: &Partition<'_>, out: &[usize], adds: &[Option<usize>]) -> Vec<Option<Vec<Foreseen>>> {
        let (o, tested) = (fits.columns_of(out), |part: usize| &self.measured[part]);
        let taken_out = fits.taken_out(&o, adds, &tested, Asked::Covariance);
        let one = |add: &Option<usize>| {
            let mut added = add.map(|c| fits.added(c));
            if let Some(added) = &mut added {
                self.blocks.iter().for_each(|b| b.measure(&mut added.parts[b.part].columns));
            }
            let of_part = |part: usize| {
                fits.predicted(part, tested(part), (&o, taken_out[part].as_ref()), added.as_ref(), Asked::Covariance)
            };
            let predicted: Vec<Option<Predicted<'_>>> = (0..self.measured.len()).into_par_iter().map(of_part).collect();
            let foreseen = self.blocks.par_iter().with_min_len(16).map(|b| b.foreseen(predicted[b.part].as_ref()?));
            let foreseen: Option<Vec<Foreseen>> = foreseen.collect();
            let mut all = vec![Foreseen::default(); self.count];
            for (b, foreseen) in self.blocks.iter().zip(foreseen?) {
                all[b.block] = foreseen;
            }
            Some(all)
        };
        adds.par_iter().map(one).collect()
    }
}

impl Block {
    /// Its rows in the measure of its covariance.
    fn measure(&self, rows: &mut Mat) {
        let own = under_root(some_rows(rows, &self.rows), &self.factor);
        for j in 0..own.ncols() {
            for (i, row) in self.rows.iter().enumerate() {
                rows[(*row, j)] = own[(i, j)];
            }
        }
    }

    fn foreseen(&self, predicted: &Predicted) -> Option<Foreseen> {
        let n = self.rows.len();
        let [r, added] = [&predicted.residual, &predicted.added].map(|m| some_rows(m, &self.rows));
        let (before, out) = match predicted.out {
            Some(out) => (log_square(&self.factor), some_rows(out, &self.rows)),
            None => (0.0, Mat::zeros(n, 0)),
        };
        let (square, log_covariance) = if n <= out.ncols() + added.ncols() {
            let mut covariance = identity_and(-1.0, out.view(), out.transpose());
            covariance.add_symmetric(1.0, added.view(), added.transpose());
            let root = Cholesky::of(&covariance)?;
            (under_root(r, root.lower()).square(), log_square(root.lower()))
        } else {
            let of_out = Cholesky::of(&identity_and(-1.0, out.transpose(), out.view()))?;
            let under = |m: Mat| under_root(m, of_out.lower());
            let (a, b) = (under(out.transpose() * &r), under(out.transpose() * &added));
            let of_added = identity_and(1.0, added.transpose(), added.view()) + &b.view().gram();
            let of_added = Cholesky::of(&of_added)?;
            let c = under_root(added.transpose() * &r + &(b.transpose() * &a), of_added.lower());
            let square = r.square() + a.square() - c.square();
            (square, log_square(of_out.lower()) + log_square(of_added.lower()))
        };
        Some(Foreseen { rows: n as f64, square, log_covariance: before + log_covariance })
    }
}

fn some_rows(m: &Mat, rows: &[usize]) -> Mat {
    let mut some = Mat::zeros(rows.len(), m.ncols());
    for j in 0..m.ncols() {
        let of = m.col(j);
        some.col_mut(j).iter_mut().zip(rows).for_each(|(v, row)| *v = of[*row]);
    }
    some
}

/// The lower triangle of `I + sign a b`, which is symmetric.
fn identity_and(sign: f64, a: View<'_>, b: View<'_>) -> Mat {
    let mut m = Mat::identity(a.nrows());
    m.add_symmetric(sign, a, b);
    m
}

/// `L^-1 m`.
fn under_root(mut m: Mat, root: &Mat) -> Mat {
    solve_lower(root, &mut m);
    m
}

/// `ln det (L L')`.
fn log_square(root: &Mat) -> f64 {
    2.0 * (0..root.nrows()).map(|i| libm::log(root[(i, i)])).sum::<f64>()
}

impl Asked {
    /// `m L'^-1`, if the covariance is asked for.
    fn over_root(self, m: &Mat, root: &Mat) -> Mat {
        match self {
            Self::Residuals => Mat::zeros(m.nrows(), 0),
            Self::Covariance => under_root(m.transpose().to_owned(), root).transpose().to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use trical_ident::Noise;
    use trical_model::Measured;

    use super::*;
    use crate::test_data::shifted;

    /// m
    const SHIFT: f64 = 3e-5;

    /// 60 touches that read more along x from the middle on, and the standard deviation of a reading.
    fn made() -> (Design, f64) {
        let (model, data) = shifted(60, SHIFT);
        let noise = Noise::usual(1);
        let sigma = noise.sigma(0, &Measured::Touch { ball: 0, reading: [0.0; 3] }, 0);
        (Design::new(&model, &[], &data, &noise).unwrap(), sigma)
    }

    #[test]
    fn every_row_is_in_the_part_of_its_pose_and_predicted_by_the_mean_of_the_others() {
        let (design, sigma) = made();
        let part_of = |pose: usize| pose / 7 % 4;
        let partition = Partition::new(&design, &[], 4, &part_of).unwrap();
        let mut all: Vec<usize> = partition.rows.concat();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..180));
        for (part, rows) in partition.rows.iter().enumerate() {
            assert!(rows.iter().all(|row| part_of(row / 3) == part));
        }
        let left = partition.instead(&[], None);
        for (row, left) in left.iter().enumerate() {
            let others: Vec<usize> = (0..60).filter(|pose| part_of(*pose) != part_of(row / 3)).collect();
            let later = others.iter().filter(|pose| **pose >= 30).count() as f64 / others.len() as f64;
            let own = if row / 3 >= 30 { 1.0 } else { 0.0 };
            let expected = if row % 3 == 0 { (own - later) * SHIFT / sigma } else { 0.0 };
            assert!((left - expected).abs() < 1e-6, "row {row}: {left} {expected}");
        }
    }

    #[test]
    fn a_block_is_foreseen_with_the_variance_of_its_readings_and_of_the_mean_of_the_others() {
        let (design, sigma) = made();
        // of two parts, the first ten and the last ten poses are scored
        let partition = Partition::new(&design, &[], 2, &|pose| pose / 30).unwrap();
        let block_of = |pose: usize| [(0, 0), (5, 2)].into_iter().find(|b| b.0 == pose / 10).map(|b| b.1);
        let foreseen =
            partition.predictive(3, &block_of).unwrap().of_blocks(&partition, &[], &[None]).remove(0).unwrap();
        assert_eq!(foreseen.iter().map(|f| f.rows).collect::<Vec<_>>(), [30.0, 0.0, 30.0]);
        // covariance of ten readings of an axis: 1 + 1/30 on the diagonal, 1/30 beside it
        let spread = 1.0 + 10.0 / 30.0;
        for f in [foreseen[0], foreseen[2]] {
            let square = 10.0 * (SHIFT / sigma).powi(2) / spread;
            assert!((f.square / square - 1.0).abs() < 1e-6, "{} {square}", f.square);
            assert!((f.log_covariance - 3.0 * spread.ln()).abs() < 1e-6, "{}", f.log_covariance);
        }
    }

    #[test]
    fn a_position_error_is_the_length_of_the_three_numbers_of_a_touch() {
        let (design, sigma) = made();
        let partition = Partition::new(&design, &[], 3, &|pose| pose % 3).unwrap();
        let mut residuals = [3.0, -4.0, 12.0].repeat(60);
        let all = partition.position_errors(&residuals, None);
        assert!(all.len() == 60 && all.iter().all(|e| (e / (13.0 * sigma) - 1.0).abs() < 1e-12));
        // what was not predicted is left out
        residuals[4] = f64::INFINITY;
        let counts = [None, Some(0), Some(1)].map(|part| partition.position_errors(&residuals, part).len());
        assert_eq!(counts, [59, 20, 19]);
    }
}
