//! placeholder
pub mod recording;
