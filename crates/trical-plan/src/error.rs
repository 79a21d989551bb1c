//! What can go wrong with a plan.

use thiserror::Error;
use trical_model::{IkError, ModelError};

/// Why there is no plan. Each message is one sentence that can be shown to a user as it is.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum PlanError {
    /// The `[geometry]` section of the cell is not what it should be.
    #[error("{place}: {problem}")]
    Geometry {
        /// Section and field: `[[geometry.link]] 2, solid 1`.
        place: String,
        /// What was found and what is expected.
        problem: String,
    },
    /// The model itself cannot be built.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// An option makes no sense.
    #[error("option {option}: {problem}")]
    Option {
        /// Its name.
        option: &'static str,
        /// What was found and what is expected.
        problem: String,
    },
    /// The cell has nothing to touch.
    #[error("the cell has no balls ([balls] in cell.toml), so there is nothing to touch")]
    NoBalls,
    /// Too few configurations could be found at a ball.
    #[error(
        "ball {ball}: {found} collision-free configurations found in {attempts} attempts, expected {wanted}; {reason}"
    )]
    TooFew {
        /// 1-based.
        ball: usize,
        /// How many there are.
        found: usize,
        /// How many there should be.
        wanted: usize,
        /// How many were tried.
        attempts: usize,
        /// What was refused and why, counted.
        reason: String,
    },
    /// Too few configurations could be found at all balls together.
    #[error("{found} collision-free configurations found in {attempts} attempts, expected {wanted}")]
    TooFewPoses {
        /// How many there are.
        found: usize,
        /// How many there should be.
        wanted: usize,
        /// How many were tried.
        attempts: usize,
    },
    /// The chosen parameters cannot be seen at all.
    #[error("none of the {parameters} parameters to identify moves the tool at any of the configurations")]
    NothingObservable {
        /// How many were given.
        parameters: usize,
    },
    /// No collision-free way between two configurations was found.
    #[error("no collision-free way was found from touch {from} to touch {to}: {a} meets {b} on the straight one")]
    NoWay {
        /// 1-based; 0 is the start.
        from: usize,
        /// 1-based.
        to: usize,
        /// A body.
        a: String,
        /// The other one.
        b: String,
    },
    /// The start is in collision or beyond limits.
    #[error("the start configuration is not usable: {problem}")]
    BadStart {
        /// Why.
        problem: String,
    },
    /// A pose that must be reached cannot be.
    #[error(transparent)]
    Kinematics(#[from] IkError),
}

/// Results of this crate.
pub type Result<T> = std::result::Result<T, PlanError>;
