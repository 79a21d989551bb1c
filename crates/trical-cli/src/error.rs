//! Errors as the command line shows them: one sentence, and an exit code.

use std::io::ErrorKind;

use trical_device::controller::ControllerError;
use trical_device::gauge::GaugeError;
use trical_diagnose::truth::TruthError;
use trical_ident::IdentError;
use trical_model::ModelError;
use trical_plan::PlanError;
use trical_recording::RecordError;
use trical_report::effect_names;

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
    /// What another crate says of input.
    pub fn input(e: impl std::fmt::Display) -> Self {
        Self::Input(e.to_string())
    }

    /// What another crate says of work that failed.
    pub fn failed(e: impl std::fmt::Display) -> Self {
        Self::Failed(e.to_string())
    }

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
            IdentError::Record(e) => e.into(),
            _ => Self::Input(e.to_string()),
        }
    }
}

impl From<RecordError> for CliError {
    fn from(e: RecordError) -> Self {
        match e {
            RecordError::Damaged { lost, complete } => {
                Self::Input(format!("{lost}; trical convert saves its {complete} complete measurements"))
            }
            RecordError::Scratch(_) | RecordError::Mcap { .. } => Self::Failed(e.to_string()),
            RecordError::Io { ref source, .. } if !is_of_the_name(source.kind()) => Self::Failed(e.to_string()),
            _ => Self::Input(e.to_string()),
        }
    }
}

impl From<ControllerError> for CliError {
    fn from(e: ControllerError) -> Self {
        match e {
            ControllerError::Lost { .. } | ControllerError::Silent { .. } => Self::Failed(e.to_string()),
            _ => Self::Input(e.to_string()),
        }
    }
}

impl From<GaugeError> for CliError {
    fn from(e: GaugeError) -> Self {
        match e {
            GaugeError::Io { .. } | GaugeError::Silent { .. } => Self::Failed(e.to_string()),
            _ => Self::Input(e.to_string()),
        }
    }
}

/// Whether another name of a file would help: a full disk or a lost drive is nobody's wrong input.
fn is_of_the_name(kind: ErrorKind) -> bool {
    use ErrorKind::{
        AlreadyExists, InvalidFilename, InvalidInput, IsADirectory, NotADirectory, NotFound, PermissionDenied,
        ReadOnlyFilesystem,
    };
    matches!(
        kind,
        AlreadyExists
            | InvalidFilename
            | InvalidInput
            | IsADirectory
            | NotADirectory
            | NotFound
            | PermissionDenied
            | ReadOnlyFilesystem
    )
}

/// What is wrong with an effect that `option` was to hide, and which one may be meant.
pub fn of_wish(option: &str, e: TruthError) -> CliError {
    match &e {
        TruthError::Wish { wish, .. } => CliError::Input(format!("{option} {e}{}", effect_names::meant(wish))),
        _ => e.into(),
    }
}

impl From<TruthError> for CliError {
    fn from(e: TruthError) -> Self {
        match e {
            TruthError::Ident(e) => e.into(),
            e => Self::Input(e.to_string()),
        }
    }
}

impl From<PlanError> for CliError {
    fn from(e: PlanError) -> Self {
        match e {
            PlanError::NoWay { .. } | PlanError::TooFewPoses { .. } => Self::Failed(e.to_string()),
            _ => Self::Input(e.to_string()),
        }
    }
}

impl From<trical_report::Error> for CliError {
    fn from(e: trical_report::Error) -> Self {
        use trical_report::Error;
        match e {
            Error::Model(e) => e.into(),
            Error::Ident(e) => e.into(),
            Error::Plan(e) => e.into(),
            Error::Input(text) => Self::Input(text),
            Error::Failed(text) => Self::Failed(text),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_failed_work_and_a_name_that_is_not_there_wrong_input() {
        for (kind, code) in [(ErrorKind::StorageFull, 1), (ErrorKind::BrokenPipe, 1), (ErrorKind::NotFound, 2)] {
            let e = RecordError::Io { path: "run.csv".into(), action: "write", source: kind.into() };
            assert_eq!(CliError::from(e).code(), code, "{kind}");
        }
    }
}
