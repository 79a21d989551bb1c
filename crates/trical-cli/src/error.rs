//! Errors as the command line shows them: one sentence, and an exit code.

use trical_ident::IdentError;
use trical_model::ModelError;

/// What ends a command.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// Wrong use or bad input: exit code 2.
    #[error("{0}")]
    Input(String),
    /// The work failed: exit code 1.
    #[error("{0}")]
    Failed(String),
}

impl CliError {
    /// The process's exit code.
    pub fn code(&self) -> u8 {
        match self {
            Self::Input(_) => 2,
            Self::Failed(_) => 1,
        }
    }
}

impl From<ModelError> for CliError {
    fn from(e: ModelError) -> Self {
        Self::Input(e.to_string())
    }
}

impl From<IdentError> for CliError {
    fn from(e: IdentError) -> Self {
        match e {
            IdentError::NotConverged(_) => Self::Failed(e.to_string()),
            _ => Self::Input(e.to_string()),
        }
    }
}

impl From<serde_json::Error> for CliError {
    fn from(e: serde_json::Error) -> Self {
        Self::Failed(format!("JSON: {e}"))
    }
}

/// Results of commands.
pub type Result<T> = std::result::Result<T, CliError>;
