//! Identification: recordings as observations, fits, what they can and cannot tell, validation.
//!
//! | module | holds |
//! |---|---|
//! | [`dataset`] | recordings as observations: sessions, measuring frames, repeated readings, samples, loads |
//! | [`dense`], [`rigid`] | matrices, factors and what is solved with them, the same bits on every processor; rigid transforms |
//! | [`fit`] | one fit: initial guess, parameters, priors, noise, the solver, what it rejects and what it cautions |
//! | [`calibration`] | the whole way from recordings to what a fit is worth at poses that it did not see |
//! | [`mod@validate`] | a model on recordings that it was not fitted to; how far off it says that it may be |
//! | [`mod@compare`], [`mod@history`] | whether an arm is still as it was calibrated; its sessions over months |
//! | [`mod@repeatability`] | how far repeat visits scatter; accuracy and repeatability as ISO 9283 has them |
//! | [`touches`], [`mod@simulate`] | what touches could tell; recordings of an arm that is a model |
//! | [`model_file`], [`units`] | models as files, coefficients as people read them |

#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod calibration;
pub mod compare;
pub mod dataset;
pub mod date;
pub mod dense;
pub mod error;
pub mod fit;
pub mod history;
pub mod model_file;
pub mod repeatability;
pub mod rigid;
pub mod simulate;
pub mod touches;
pub mod units;
pub mod validate;

pub use calibration::joint_choice::clean;
pub use calibration::{
    BY_BLOCK, Calibration, FORWARD, HeldOut, Options, ToolSharing, calibrate, calibrate_stream, cross_validate,
    forward_in_time,
};
pub use compare::{Comparison, compare};
pub use dataset::references::References;
pub use dataset::repeated::refuse_repeated;
pub use dataset::torque_load::{TorqueLoad, torque_loads};
pub use dataset::{Dataset, JointSource, Observation, Rejected, rejected_in_words};
pub use error::{IdentError, Result};
pub use fit::cautions::cautions;
pub use fit::choice::{Choice, ChoiceError, Elasticity, OwnSetup, ParameterSet};
pub use fit::gross_errors::reject_gross_errors;
pub use fit::identifiability::{Dependent, Observability};
pub use fit::identify::{ErrorSummary, Identified, fit_model, identify};
pub use fit::noise::Noise;
pub use fit::orientation::AngleSummary;
pub use fit::priors::KnownParameters;
pub use fit::stream::{Streamed, identify_stream};
pub use history::{History, history};
pub use model_file::{ModelFile, Session, write_whole};
pub use repeatability::{Repeatability, repeatability};
pub use simulate::{Aim, Scatter, simulate};
pub use touches::{model_of_touches, usual_set};
pub use units::{Shown, shown, unit};
pub use validate::adapted::{LeftOut, Refit};
pub use validate::predicted::{Expected, Predicted};
pub use validate::{Region, SessionErrors, Validation, validate};
// a recording is where identification begins
pub use trical_recording::{CsvStream, load_csv, parse_csv, write_csv};
