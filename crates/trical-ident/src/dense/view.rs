//! What is seen of a matrix.

/// A matrix or its transpose, or some columns of it.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) entries: &'a [f64],
    /// From one row to the next, and from one column to the next; one of both is 1.
    pub(super) stride: (usize, usize),
}

impl<'a> View<'a> {
    /// Rows one after the other.
    #[must_use]
    pub fn of_rows(entries: &'a [f64], rows: usize, columns: usize) -> Self {
        Self { rows, columns, entries, stride: (columns, 1) }
    }

    /// The transpose.
    #[must_use]
    pub fn transpose(self) -> Self {
        Self { rows: self.columns, columns: self.rows, stride: (self.stride.1, self.stride.0), ..self }
    }

    /// How many rows.
    #[must_use]
    pub fn nrows(self) -> usize {
        self.rows
    }

    /// Some columns.
    #[must_use]
    pub fn columns(self, from: usize, count: usize) -> Self {
        Self { columns: count, entries: self.entries.get(from * self.stride.1..).unwrap_or(&[]), ..self }
    }

    /// Some rows.
    #[must_use]
    pub fn rows(self, from: usize, count: usize) -> Self {
        self.transpose().columns(from, count).transpose()
    }

    /// An entry.
    #[must_use]
    pub fn at(self, i: usize, j: usize) -> f64 {
        self.entries[i * self.stride.0 + j * self.stride.1]
    }
}
