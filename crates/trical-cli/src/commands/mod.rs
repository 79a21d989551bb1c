//! One file a command.

pub mod diagnose;
pub mod identify;
pub mod validate;
