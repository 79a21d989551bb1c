//! What a program uses and other files have: routines that it calls, tools and frames.

use crate::frames::ToolFrame;
pub use crate::scan::Outside;
use trical_model::Pose;

/// Where a reader looks for what its file does not have; names are in lower case.
pub trait Elsewhere {
    /// The routine of this name.
    fn routine(&self, name: &str) -> Option<Outside>;

    /// The tool of this name, or what is wrong with it.
    fn tool(&self, name: &str) -> Option<Result<ToolFrame, String>> {
        let _ = name;
        None
    }

    /// The frame of this name, as [`Self::tool`].
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
