//! What can go wrong with recordings and fits.

use thiserror::Error;
use trical_model::ModelError;
use trical_recording::RecordError;

/// Errors of this crate. Each message is one sentence that can be shown to a user as it is.
#[derive(Debug, Error)]
pub enum IdentError {
    /// The recordings do not hold enough for what was asked.
    #[error("{0}")]
    NotEnough(String),
    /// The fit did not reach a minimum.
    #[error("the fit did not converge: {0}")]
    NotConverged(String),
    /// A model file does not belong to this robot, or cannot be used on these recordings.
    #[error("{0}")]
    WrongModel(String),
    /// Something is wrong with a recording, or with another file.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The robot, the cell or a term is at fault.
    #[error(transparent)]
    Model(#[from] ModelError),
}

impl IdentError {
    /// What is wrong at a place of a recording.
    pub(crate) fn at(file: &str, place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Record(RecordError::At { file: file.to_owned(), place: place.into(), problem: problem.into() })
    }

    /// What is wrong with a line of a recording.
    pub(crate) fn at_line(file: &str, line: usize, problem: impl Into<String>) -> Self {
        Self::at(file, format!("line {line}"), problem)
    }

    /// What is wrong with a file as a whole.
    pub(crate) fn of_file(file: &str, problem: impl Into<String>) -> Self {
        Self::Record(RecordError::File { file: file.to_owned(), problem: problem.into() })
    }
}

/// Results of this crate.
pub type Result<T> = std::result::Result<T, IdentError>;
