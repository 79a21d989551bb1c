//! Robots and cells as data, terms, the forward model and its Jacobians, inverse kinematics on the full model.
//!
//! A model is a list of [`Term`]s: coefficient x basis (of what is known about the pose) acting at a site of the machine.
//! One forward function composes all terms exactly; one routine gives its derivatives. Everybody else uses that pair.
//!
//! Inside, everything is SI (m, rad, kg, s, N m); files carry mm and degrees, and say so in every name.
//!
//! | module | holds |
//! |---|---|
//! | [`robot`], [`cell`] | the nominal arm and cell, read from TOML |
//! | [`urdf`] | arms from URDF |
//! | [`calibrated`] | a calibrated arm in the files of others |
//! | [`recording`] | what is known about a pose and what was measured there |
//! | [`term`], [`scope`] | sites, bases, terms; to which sessions a term applies |
//! | [`place`] | the places of sites, as people and files name them |
//! | [`forward`] | prediction and Jacobians |
//! | [`touch`] | what the device reads at a ball |
//! | [`rigid`] | the rigid part of a calibrated model, for others |
//! | [`ik`] | inverse kinematics on the full model |
//! | [`task`], [`interrupt`] | long work: how far it is, and whether it is still wanted |
//! | [`pose`] | rigid transforms |

#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod axis;
pub mod basis;
pub mod calibrated;
pub mod cell;
mod chain;
pub mod error;
pub mod forward;
pub mod ik;
pub mod interrupt;
mod jacobian;
mod on_rail;
pub mod place;
pub mod pose;
mod prediction;
pub mod recording;
pub mod rigid;
pub mod robot;
pub mod scope;
mod support;
mod target;
pub mod task;
pub mod term;
pub mod touch;
pub mod trig;
pub mod urdf;

pub use axis::Axis;
pub use basis::{Basis, Beside, Shape, Variable};
pub use cell::{Cell, Tool};
pub use error::{ModelError, Result};
pub use forward::{Forward, GRAVITY, Model, Workspace, residual_rows};
pub use ik::{IkError, Solution, inverse_kinematics, nearest_solution};
pub use place::Place;
pub use pose::Pose;
pub use recording::{Joints, MAX_JOINTS, Measured, Recording, Row, State};
pub use rigid::Rigid;
pub use robot::{Joint, JointKind, Robot};
pub use scope::Scope;
pub use support::Support;
pub use task::Task;
pub use term::{Motion, Parameter, Payload, Site, Term};
