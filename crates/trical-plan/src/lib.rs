//! Planning.
pub mod collision;
pub mod error;
pub mod geometry;
pub mod solid;

pub use error::{PlanError, Result};
