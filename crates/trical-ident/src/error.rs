//! What can go wrong with recordings and fits.

use thiserror::Error;
use trical_model::ModelError;
use trical_recording::RecordError;

/// Errors of this crate. Each message is one sentence that can be shown to a user as it is.
#[derive(Debug, Error)]
pub enum IdentError {
    /// Something is wrong with a recording.
    #[error("{file}, {place}: {problem}")]
    Recording {
        /// File name as the user gave it.
        file: String,
        /// "line 12, column q3_deg" or "header".
        place: String,
        /// What was found and what was expected.
        problem: String,
    },
    /// A file cannot be read or written at all.
    #[error("{file}: {problem}")]
    File {
        /// File name as the user gave it.
        file: String,
        /// What happened.
        problem: String,
    },
    /// The recordings do not hold enough for what was asked.
    #[error("{0}")]
    NotEnough(String),
    /// The fit did not reach a minimum.
    #[error("the fit did not converge: {0}")]
    NotConverged(String),
    /// A model file does not belong to this robot, or cannot be used on these recordings.
    #[error("{0}")]
    WrongModel(String),
    /// A recording cannot be read.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The robot, the cell or a term is at fault.
    #[error(transparent)]
    Model(#[from] ModelError),
}

impl IdentError {
    /// What is wrong with a line of a recording.
    pub(crate) fn at_line(file: &str, line: usize, problem: impl Into<String>) -> Self {
        Self::Recording { file: file.to_owned(), place: format!("line {line}"), problem: problem.into() }
    }
}

/// Results of this crate.
pub type Result<T> = std::result::Result<T, IdentError>;
