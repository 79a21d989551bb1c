//! Why a program cannot be compensated.

use thiserror::Error;

/// Why a program cannot be compensated.
#[derive(Debug, Error)]
pub enum ProgramError {
    /// Wrong input, in one sentence.
    #[error("{0}")]
    Input(String),
    /// Nothing says the language of a program.
    #[error("{file}: the extension does not say the program's dialect; known are {known}")]
    NoDialect {
        /// The program.
        file: String,
        /// Those that there are.
        known: String,
    },
    /// Targets that cannot be rewritten, in one sentence; nothing was written.
    #[error("{0}")]
    Left(String),
    /// The output cannot be written.
    #[error("cannot be written: {0}")]
    Write(#[from] std::io::Error),
}
