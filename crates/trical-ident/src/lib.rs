//! Identification: recordings as observations, fits, what they can and cannot tell, validation.
//!
//! | module | holds |
//! |---|---|
//! | [`recording_csv`], [`csv_layout`] | recordings as CSV, read and written |
//! | [`dataset`] | observations, measuring frames, registration by references |
//! | [`degenerate`] | data that cannot be fitted, each with its own sentence |
//! | [`start`], [`trilateration`] | closed-form starting values |
//! | [`fit`], [`solver`], `normal` | Levenberg-Marquardt, and the sums over rows that it and the covariance need |
//! | [`known`] | priors and limits of parameters |
//! | [`identifiability`] | parameter sets, rank, covariance, observability |
//! | [`identify`] | the whole of it, cross-validation |
//! | [`gross`] | measurements that no model of the arm explains |
//! | [`stream`], [`passes`], `sample` | identification from files of any size, in bounded memory; which files need it; rows that stand for all |
//! | [`validate`] | a model on data that it was not fitted to |
//! | [`repeatability`] | how far repeat visits scatter |
//! | [`joint_choice`] | which joint angles to believe |
//! | [`touches`], [`simulate`] | what touches could tell; recordings of an arm that is a model |
//! | [`model_file`], [`units`] | models as files, coefficients as people read them |

pub mod caution;
pub mod csv_layout;
pub mod dataset;
pub mod degenerate;
pub mod error;
pub mod fit;
pub mod gross;
pub mod identifiability;
pub mod identify;
pub mod joint_choice;
pub mod known;
pub mod model_file;
pub mod noise;
mod normal;
pub mod passes;
pub mod recording_csv;
pub mod repeatability;
pub mod rigid;
mod sample;
pub mod simulate;
pub mod solver;
pub mod start;
pub mod stream;
pub mod touches;
pub mod trilateration;
pub mod units;
pub mod validate;

pub use caution::cautions;
pub use csv_layout::{Layout, write_csv};
pub use dataset::{Dataset, JointSource, Observation, References, Rejected};
pub use error::{IdentError, Result};
pub use gross::reject_gross_errors;
pub use identifiability::{Choice, ChoiceError, Dependent, Observability, ParameterSet};
pub use identify::{ErrorSummary, Identified, cross_validate, fit_model, forward_in_time, identify};
pub use joint_choice::clean;
pub use known::KnownParameters;
pub use model_file::{ModelFile, write_whole};
pub use noise::Noise;
pub use recording_csv::{load_csv, parse_csv};
pub use repeatability::{Repeatability, repeatability};
pub use simulate::{Aim, Scatter, simulate};
pub use stream::{CsvStream, Sample, Streamed, identify_stream};
pub use touches::{model_of_touches, usual_set};
pub use units::{Shown, shown, unit};
pub use validate::{Refit, Region, Validation, validate};
