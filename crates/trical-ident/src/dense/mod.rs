//! Dense matrices whose results are the same bits on every processor.
//!
//! Every sum has one order, whatever the width of the vectors that take part in it, and no product is fused with a sum (FMA): processors differ in
//! both. The loops are compiled for several widths; each step is the same for any.
//!
//! ```
//! use trical_ident::dense::{Cholesky, Mat};
//!
//! let normal = Mat::from_fn(2, 2, |i, j| if i == j { 2.0 } else { 1.0 });
//! let x = Cholesky::of(&normal).unwrap().solve(&Mat::from_fn(2, 1, |_, _| 3.0));
//! assert!((x[(0, 0)] - 1.0).abs() < 1e-14 && ((&normal * &x)[(1, 0)] - 3.0).abs() < 1e-14);
//! ```
//!
//! `mat` and `view` hold matrices and their products, `product` the loop of a product, `triangular` Cholesky's factor and what is solved with it, `factor` the
//! triangular factor of rows (Householder), `singular` singular values.

mod factor;
mod mat;
mod product;
mod singular;
mod triangular;
mod view;

pub use factor::{add_rows, orthonormal};
pub use mat::Mat;
pub use singular::{singular_values, singular_values_of_products, weakest};
pub use triangular::{Cholesky, solve_lower, solve_lower_rows};
pub use view::View;

/// Inner product by eight partial sums, which processors take at once.
#[inline(always)]
#[must_use]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a, b) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(x, y)| x * y).sum();
    for (a, b) in a.zip(b) {
        for ((sum, x), y) in sums.iter_mut().zip(a).zip(b) {
            *sum += x * y;
        }
    }
    sums.iter().sum::<f64>() + rest
}

/// `to += factor * from`.
#[inline(always)]
fn add(to: &mut [f64], factor: f64, from: &[f64]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to += factor * from;
    }
}
