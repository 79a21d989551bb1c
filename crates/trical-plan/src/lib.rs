//! Planning.
pub mod choose;
pub mod collision;
mod connect;
pub mod error;
pub mod generate;
pub mod geometry;
pub mod options;
pub mod parameters;
pub mod plan;
mod random;
pub mod route;
pub mod solid;

pub use error::{PlanError, Result};
pub use plan::plan_touches;
