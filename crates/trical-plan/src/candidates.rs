//! Candidates for a measurement, and what sets of them tell.
//!
//! Nothing here knows of robots: a candidate is a block of three rows of a Jacobian.

use nalgebra::DMatrix;

/// Blocks of three rows, one for each candidate, and to which group (ball) each belongs.
#[derive(Clone, Debug)]
pub struct Candidates {
    /// Number of columns.
    columns: usize,
    /// 3 x columns numbers for each candidate, row by row, one candidate after the other.
    pub(crate) jacobian: Vec<f64>,
    /// Group of each candidate.
    pub(crate) groups: Vec<usize>,
}

/// Observability of a set of parameters by a set of measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observability {
    /// O1 (Borm & Menq): (product of singular values)^(1/p) / sqrt(rows), of the Jacobian with columns of unit length.
    pub o1: f64,
    /// Largest over smallest singular value of the same.
    pub condition: f64,
}

/// Columns that add less than this part of their length to the columns before them are taken to depend on them.
const DEPENDENT: f64 = 1e-6;

impl Candidates {
    /// `jacobian`: 3 rows of `columns` numbers for each candidate; `groups`: one entry for each candidate. `None` where the
    /// sizes do not fit, a number is not finite or there is no column.
    #[must_use]
    pub fn new(columns: usize, jacobian: Vec<f64>, groups: Vec<usize>) -> Option<Self> {
        (columns > 0 && jacobian.len() == 3 * columns * groups.len() && jacobian.iter().all(|x| x.is_finite()))
            .then_some(Self { columns, jacobian, groups })
    }

    /// Number of candidates.
    #[must_use]
    pub fn len(&self) -> usize {
        self.groups.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    /// Group of a candidate.
    #[must_use]
    pub fn group(&self, candidate: usize) -> usize {
        self.groups.get(candidate).copied().unwrap_or(usize::MAX)
    }

    /// Number of columns.
    #[must_use]
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Three rows of a candidate, row by row; empty for one that is not there.
    #[must_use]
    pub fn rows(&self, candidate: usize) -> &[f64] {
        let p = self.columns;
        self.jacobian.get(candidate * 3 * p..(candidate + 1) * 3 * p).unwrap_or(&[])
    }

    pub(crate) fn matrix(&self) -> DMatrix<f64> {
        DMatrix::from_row_slice(3 * self.len(), self.columns, &self.jacobian)
    }

    /// Columns that do not depend on columns before them, over all candidates, and of the others how much of each does not
    /// (0 for a column of zeros).
    #[must_use]
    pub fn independent_columns(&self) -> Vec<usize> {
        let j = self.matrix();
        let mut basis: Vec<nalgebra::DVector<f64>> = Vec::new();
        let mut kept = Vec::new();
        for c in 0..self.columns {
            let mut v = j.column(c).clone_owned();
            let length = v.norm();
            if length < 1e-300 {
                continue;
            }
            v /= length;
            // twice is enough (Parlett)
            for _ in 0..2 {
                for b in &basis {
                    let along = b.dot(&v);
                    v.axpy(-along, b, 1.0);
                }
            }
            let left = v.norm();
            if left > DEPENDENT {
                basis.push(v / left);
                kept.push(c);
            }
        }
        kept
    }

    /// These candidates with some of their columns only.
    #[must_use]
    pub fn with_columns(&self, columns: &[usize]) -> Self {
        let jacobian = self
            .jacobian
            .chunks_exact(self.columns)
            .flat_map(|row| columns.iter().map(|c| row.get(*c).copied().unwrap_or(0.0)))
            .collect();
        Self { columns: columns.len(), jacobian, groups: self.groups.clone() }
    }

    /// Observability of all columns by the candidates `indices`.
    #[must_use]
    pub fn observability(&self, indices: &[usize]) -> Observability {
        let p = self.columns;
        let mut rows = Vec::with_capacity(indices.len() * 3 * p);
        for i in indices {
            rows.extend_from_slice(self.rows(*i));
        }
        let m = rows.len() / p;
        if m < p {
            return Observability { o1: 0.0, condition: f64::INFINITY };
        }
        let mut j = DMatrix::from_row_slice(m, p, &rows);
        for mut column in j.column_iter_mut() {
            let length = column.norm();
            if length > 0.0 {
                column /= length;
            }
        }
        let s = j.singular_values();
        let (pf, mf) = (p as f64, m as f64);
        let o1 = libm::exp(s.iter().map(|x| libm::log(x.max(1e-300))).sum::<f64>() / pf) / mf.sqrt();
        Observability { o1, condition: s.max() / s.min() }
    }
}

/// The candidates in coordinates in which the whole pool's J'J is the identity: well conditioned, and log determinants are
/// relative to the pool's.
pub(crate) struct White {
    /// Rows of Q times sqrt(number of candidates) as columns, so that each candidate's three lie together: p x 3 N.
    pub(crate) z: DMatrix<f64>,
    pub(crate) p: usize,
    /// Rows in columns of unit root mean square over the candidates are rows of Z times this, upper triangular.
    pub(crate) r: DMatrix<f64>,
    /// And those in the caller's units are these divided by this, column by column.
    pub(crate) scale: Vec<f64>,
}

impl White {
    pub(crate) fn of(candidates: &Candidates) -> Self {
        let mut j = candidates.matrix();
        let root = (candidates.len() as f64).sqrt();
        let mut scale = Vec::with_capacity(candidates.columns);
        for mut column in j.column_iter_mut() {
            let length = column.norm();
            let factor = if length > 0.0 { root / length } else { 1.0 };
            column *= factor;
            scale.push(factor);
        }
        let p = candidates.columns;
        let qr = j.qr();
        Self { z: (qr.q() * root).transpose(), p, r: qr.r() / root, scale }
    }

    pub(crate) fn information(&self, chosen: &[usize]) -> DMatrix<f64> {
        let mut m = DMatrix::zeros(self.p, self.p);
        for i in chosen {
            let block = self.z.columns(3 * i, 3);
            m.gemm(1.0, &block, &block.transpose(), 1.0);
        }
        m
    }

    /// log det of the information per candidate.
    pub(crate) fn log_det(&self, chosen: &[usize]) -> f64 {
        let (n, p) = (chosen.len().max(1) as f64, self.p as f64);
        match self.information(chosen).cholesky() {
            Some(c) => 2.0 * c.l_dirty().diagonal().iter().map(|d| libm::log(*d)).sum::<f64>() - p * libm::log(n),
            None => f64::NEG_INFINITY,
        }
    }
}

/// The inverse of a matrix that is positive definite.
pub(crate) fn inverse(m: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    m.clone().cholesky().map(|c| c.inverse())
}
