//! What a program uses and other files have: routines that it calls, tools and frames.

use std::collections::{BTreeSet, HashSet};

use crate::frames::{Frame, Frames};
pub use crate::scan::Outside;
use crate::scan::Setup;

/// With what a motion goes to a target.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Goes {
    /// Its tool and frame.
    pub setup: Setup,
    /// Where it is none, but the call of a routine that the file does not have: that routine, and the other names that
    /// it gets.
    pub unread: Option<(String, Vec<String>)>,
}

/// A motion of another file.
#[derive(Clone, Copy, Debug)]
pub struct Motion<'a> {
    /// With what.
    pub goes: &'a Goes,
    /// Tools and frames that its file declares.
    pub declared: &'a Frames,
    /// Its file, for messages.
    pub file: &'a str,
}

/// Where a reader looks for what its file does not have; names are in lower case.
pub trait Elsewhere {
    /// The routine of this name.
    fn routine(&self, name: &str) -> Option<Outside>;

    /// The tool or the frame of this name, or what is wrong with it.
    fn frame(&self, _is_tool: bool, _name: &str) -> Option<Result<Frame, String>> {
        None
    }

    /// Tool and frame that are set where other files call this routine (hashed), as far as they say.
    fn called_with(&self, _routine: u64) -> Option<Setup> {
        None
    }

    /// Tool and frame of the motions of other files to data of this name (hashed) that a file has for all.
    fn goes_to(&self, _name: u64) -> Vec<Setup> {
        Vec::new()
    }

    /// The file that gives other coordinates to data of this name (hashed) that a file has for all.
    fn set_by(&self, _name: u64) -> Option<String> {
        None
    }

    /// Six numbers of data of this name (`XHOME`, `$ROBROOT`) that belong to all programs, by the names of the numbers.
    fn values(&self, _name: &[u8], _fields: &[&[u8]; 6]) -> Option<[f64; 6]> {
        None
    }

    /// Names (hashed) of targets, and of arguments of routines, to which other files have motions, or that they give to
    /// routines.
    fn wanted(&self) -> Vec<u64> {
        Vec::new()
    }

    /// Motions of other files to a target or an argument.
    fn motions(&self, _name: u64) -> Vec<Motion<'_>> {
        Vec::new()
    }

    /// Which of a file's own routines other files call, and what these do around that.
    fn around(&self, _own: &HashSet<u64>) -> Option<(BTreeSet<u64>, Outside)> {
        None
    }

    /// Arguments of routines and data, and the names that other files set them from.
    fn given(&self) -> Vec<(u64, u64)> {
        Vec::new()
    }
}

/// No other file.
pub struct Nowhere;

impl Default for &dyn Elsewhere {
    fn default() -> Self {
        &Nowhere
    }
}

impl Elsewhere for Nowhere {
    fn routine(&self, _: &str) -> Option<Outside> {
        None
    }
}
