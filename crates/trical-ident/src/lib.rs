//! Identification: recordings as observations, fits, what they can and cannot tell, validation.
//!
//! | module | holds |
//! |---|---|
//! | [`dataset`], [`references`] | observations, measuring frames; poses registered by fixed references |
//! | [`dense`] | matrices, factors and what is solved with them, the same bits on every processor |
//! | [`degenerate`] | data that cannot be fitted, each with its own sentence |
//! | [`initial_guess`], [`trilateration`] | closed-form starting values |
//! | [`fit`], [`solver`], `normal` | Levenberg-Marquardt, and the sums over rows that it and the covariance need |
//! | [`known`] | priors and limits of parameters |
//! | [`torque_load`] | loads on the flange, by measured joint torques |
//! | [`identifiability`], [`triangle`] | parameter sets, rank, covariance, observability; which columns are sums of others |
//! | [`identify`], [`calibration`], `held_out` | a fit; the whole way from recordings to what a fit is worth |
//! | [`folds`] | which poses a fit must not see when it is scored |
//! | [`follow`] | indicators that read the same whatever the arm does |
//! | [`repeated`] | measurements that were given twice |
//! | [`gross`] | measurements that no model of the arm explains |
//! | [`stream`], `sample` | identification from files of any size, in bounded memory; rows that stand for all |
//! | [`validate`], `adapted`, [`predicted`] | a model on data that it was not fitted to; how far off it says that it may be |
//! | [`compare`], [`history`] | whether an arm is still as it was calibrated; its sessions over months |
//! | [`repeatability`], [`iso9283`] | how far repeat visits scatter; accuracy and repeatability as the standard has them |
//! | [`joint_choice`] | which joint angles to use |
//! | [`touches`], [`simulate`] | what touches could tell; recordings of an arm that is a model |
//! | [`model_file`], [`units`] | models as files, coefficients as people read them |

#![cfg_attr(test, allow(clippy::disallowed_methods))]

mod adapted;
pub mod ball_places;
pub mod by_place;
pub mod calibration;
pub mod caution;
pub mod compare;
pub mod dataset;
pub mod date;
pub mod degenerate;
pub mod dense;
mod design_effect;
pub mod error;
pub mod fit;
pub mod folds;
pub mod follow;
pub mod gross;
mod held_out;
pub mod history;
pub mod identifiability;
pub mod identify;
pub mod initial_guess;
pub mod iso9283;
pub mod joint_choice;
pub mod known;
pub mod model_file;
pub mod noise;
mod normal;
mod optional;
mod orientation;
pub mod predicted;
pub mod read_otherwise;
pub mod readings;
pub mod references;
pub mod repeatability;
pub mod repeated;
pub mod rigid;
pub mod sample;
pub mod simulate;
pub mod solver;
pub mod stream;
pub mod torque_load;
pub mod touches;
pub mod triangle;
pub mod trilateration;
pub mod units;
pub mod validate;
pub mod weak;

pub use adapted::{LeftOut, Refit};
pub use calibration::{
    Calibration, HeldOut, Options, ToolSharing, calibrate, calibrate_stream, cross_validate, forward_in_time,
};
pub use caution::cautions;
pub use compare::{Comparison, compare};
pub use dataset::{Dataset, JointSource, Observation, Rejected, rejected_in_words};
pub use error::{IdentError, Result};
pub use gross::reject_gross_errors;
pub use history::{History, history};
pub use identifiability::{Choice, ChoiceError, Dependent, Elasticity, Observability, OwnSetup, ParameterSet};
pub use identify::{ErrorSummary, Identified, fit_model, identify};
pub use joint_choice::clean;
pub use known::KnownParameters;
pub use model_file::{ModelFile, Session, write_whole};
pub use noise::Noise;
pub use orientation::AngleSummary;
pub use predicted::{Expected, Predicted};
pub use references::References;
pub use repeatability::{Repeatability, repeatability};
pub use repeated::refuse_repeated;
pub use simulate::{Aim, Scatter, simulate};
pub use stream::{Streamed, identify_stream};
pub use torque_load::{TorqueLoad, torque_loads};
pub use touches::{model_of_touches, usual_set};
pub use units::{Shown, shown, unit};
pub use validate::{Region, SessionErrors, Validation, validate};
// a recording is where identification begins
pub use trical_recording::{CsvStream, load_csv, parse_csv, write_csv};
