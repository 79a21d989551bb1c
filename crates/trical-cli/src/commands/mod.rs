//! One file a command.

pub mod identify;
pub mod validate;
