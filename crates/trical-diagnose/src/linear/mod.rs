//! The linear picture of a fit: what every candidate would do to the measurements, and what the fitted parameters leave of it.
//!
//! With `Q` an orthonormal basis of the columns of the weighted Jacobian (and of the effects already chosen), `r` the weighted
//! residual and `X` a candidate's columns, the sum of squares that the candidate would remove is `b' G^-1 b`, where `b = X'r`
//! and `G = X'X - (Q'X)'(Q'X)`. `G` also gives lambda: the length of a signature after projection, in units of the noise.
//!
//! | module | holds |
//! |---|---|
//! | [`design`] | the design: all inner products, each when it is first asked for |
//! | `columns` | residual, Jacobian and columns, and inner products over rows |
//! | [`state`] | the fit with some candidates added, and what others would do then |
//! | [`downdate`] | the same with some of those taken out again |
//! | `wave_sizes` | priors of the waves of curves, learnt from all of them |
//! | [`partition`] | a set fitted without each part of the poses, and on each part alone |

mod columns;
pub mod design;
pub mod downdate;
pub mod partition;
pub mod state;
mod wave_sizes;

pub use columns::Fitted;
pub(crate) use columns::Linear;
pub use design::Design;
pub use downdate::{Downdate, Downdated};
pub use partition::{Foreseen, Partition, Predictive};
pub use state::{Gain, RegressionState};
