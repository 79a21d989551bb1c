//! Why an arm cannot be drawn or an effect not hidden.

use thiserror::Error;
use trical_ident::error::IdentError;
use trical_model::ModelError;

/// Why there is no such arm.
#[derive(Debug, Error)]
pub enum TruthError {
    /// The arm or what it is asked about is at fault.
    #[error(transparent)]
    Ident(#[from] IdentError),
    /// The base cannot be set up.
    #[error("the device reaches the three balls in no common orientation")]
    OutOfReach,
    /// What is to be hidden is not known.
    #[error("{wish}: {problem}")]
    Wish {
        /// What was asked for.
        wish: String,
        /// What was expected.
        problem: String,
    },
}

impl From<ModelError> for TruthError {
    fn from(e: ModelError) -> Self {
        Self::Ident(e.into())
    }
}

pub(super) type Result<T> = std::result::Result<T, TruthError>;
