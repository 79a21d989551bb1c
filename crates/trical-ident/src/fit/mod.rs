//! One fit of a model to observations, from the initial guess to parameters with their covariance.
//!
//! | module | holds |
//! |---|---|
//! | [`identify`] | the fit as a whole, and its result |
//! | [`initial_guess`], [`trilateration`] | starting values in closed form |
//! | [`residuals`], `normal_equations`, [`levenberg_marquardt`] | weighted rows, their sums, and the solver that minimizes them |
//! | [`noise`] | standard deviations of what was measured |
//! | [`priors`], [`weak_priors`] | what is known of parameters beforehand: said by the user; how far from nominal an arm can plausibly be |
//! | [`choice`] | parameter sets, and their terms |
//! | [`identifiability`], [`rank`] | which terms are independent, covariance, observability; which columns are sums of others |
//! | `optional_terms`, [`ball_places`] | terms of which the measurements decide; places of sets of balls |
//! | [`gross_errors`], [`stuck_stems`], [`read_otherwise`] | measurements that no model of the arm explains |
//! | [`degenerate`], [`cautions`] | data that cannot be fitted; what about a fit should make its owner look twice |
//! | [`folds`], `design_effect` | which poses a fit must not see when it is scored; how much less correlated rows say |
//! | [`stream`] | files of any size, in bounded memory |
//! | `orientation` | errors of orientation |

pub mod ball_places;
pub mod cautions;
pub mod choice;
pub mod degenerate;
pub(crate) mod design_effect;
pub mod folds;
pub mod gross_errors;
pub mod identifiability;
pub mod identify;
pub mod initial_guess;
pub mod levenberg_marquardt;
pub mod noise;
pub(crate) mod normal_equations;
pub(crate) mod optional_terms;
pub(crate) mod orientation;
pub mod priors;
pub mod rank;
pub mod read_otherwise;
pub mod residuals;
pub mod stream;
pub mod stuck_stems;
pub mod trilateration;
pub mod weak_priors;
