//! What a program uses and other files have: routines that it calls, tools and frames.

use crate::frames::ToolFrame;
use crate::scan::Setup;
use trical_model::Pose;

/// What a routine of another file does.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Outside {
    /// Tool and frame that it leaves set.
    pub setup: Setup,
    /// Whether it moves the arm.
    pub moves: bool,
    /// Whether it displaces the motions that follow.
    pub displaces: bool,
    /// Data of others that it sets, by their hashed names.
    pub sets: Vec<u64>,
}

/// Where a reader looks for what its file does not have; names are in lower case.
pub trait Elsewhere {
    /// The routine of this name.
    fn routine(&self, name: &str) -> Option<Outside>;

    /// The tool of this name, or what is wrong with it.
    fn tool(&self, name: &str) -> Option<Result<ToolFrame, String>> {
        let _ = name;
        None
    }

    /// The same of a frame.
    fn frame(&self, name: &str) -> Option<Result<Pose, String>> {
        let _ = name;
        None
    }
}

/// No other file.
pub struct Nowhere;

impl Elsewhere for Nowhere {
    fn routine(&self, _: &str) -> Option<Outside> {
        None
    }
}
