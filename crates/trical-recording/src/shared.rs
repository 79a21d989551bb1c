//! What all rows of a recording share.

use std::collections::HashMap;

use trical_model::{MAX_JOINTS, Recording};

/// Places of one recording, at most.
const MOST_PLACES: usize = 10_000;

/// Names of places, each with its index.
#[derive(Clone, Debug, Default)]
pub struct Places {
    names: Vec<String>,
    index: HashMap<String, usize>,
}

impl Places {
    /// The index of a place (from 0), which is added where it is new.
    ///
    /// # Errors
    /// One sentence: too many places.
    pub fn index_of(&mut self, name: &str) -> Result<usize, String> {
        if let Some(k) = self.index.get(name) {
            return Ok(*k);
        }
        let k = self.names.len();
        if k == MOST_PLACES {
            return Err(format!("found more than {MOST_PLACES} places, expected the names of some"));
        }
        self.names.push(name.to_owned());
        self.index.insert(name.to_owned(), k);
        Ok(k)
    }

    /// The names, in the order in which they came.
    #[must_use]
    pub fn into_names(self) -> Vec<String> {
        self.names
    }
}

/// What a row needs to be written, beside itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shared {
    /// Number of the arm's joints.
    pub joints: usize,
    /// Which of them slide, joint 1 first.
    pub prismatic: [bool; MAX_JOINTS],
    /// Names of places.
    pub places: Vec<String>,
}

impl Shared {
    /// Of an arm with so many turning joints, at one place.
    #[must_use]
    pub fn for_joints(joints: usize) -> Self {
        Self { joints, ..Self::default() }
    }

    /// Of the rows of a recording.
    #[must_use]
    pub fn of(recording: &Recording) -> Self {
        Self {
            joints: recording.joints,
            prismatic: recording.prismatic.unwrap_or_default(),
            places: recording.places.clone(),
        }
    }

    /// The name of a place (from 0).
    #[must_use]
    pub fn place(&self, k: usize) -> String {
        self.places.get(k).cloned().unwrap_or_else(|| (k + 1).to_string())
    }
}
