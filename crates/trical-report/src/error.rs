//! What can go wrong while something is told.

use trical_ident::IdentError;
use trical_model::ModelError;
use trical_plan::PlanError;

/// Why there is no report, map or study.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Of arm or cell.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// Of recordings and fits.
    #[error(transparent)]
    Ident(#[from] IdentError),
    /// Of a plan.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// What was asked for makes no sense.
    #[error("{0}")]
    Input(String),
    /// A page or a picture could not be made.
    #[error("{0}")]
    Failed(String),
}

impl From<serde_json::Error> for Error {
    fn from(e: serde_json::Error) -> Self {
        Self::Failed(format!("JSON: {e}"))
    }
}

/// Results of this crate.
pub type Result<T> = std::result::Result<T, Error>;
