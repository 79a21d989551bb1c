//! What can be wrong with a recording, and with writing one.

use std::path::{Path, PathBuf};

use thiserror::Error;

/// Why a recording could not be read or written.
#[derive(Debug, Error)]
pub enum RecordError {
    /// Something in a recording makes no sense.
    #[error("{file}, {place}: {problem}")]
    At {
        /// File name as the user gave it.
        file: String,
        /// "line 12, column q3_deg" or "header".
        place: String,
        /// What was found and what was expected.
        problem: String,
    },
    /// A file as a whole cannot be used.
    #[error("{file}: {problem}")]
    File {
        /// File name as the user gave it.
        file: String,
        /// What was found and what was expected.
        problem: String,
    },
    /// An MCAP recording is damaged, and all of it was asked for.
    #[error("{lost}")]
    Damaged {
        /// One sentence that names the file and says what was lost.
        lost: String,
        /// Measurements that are whole.
        complete: usize,
    },
    /// There is no complete measurement in an MCAP recording; the sentence names the file.
    #[error("{0}")]
    Empty(String),
    /// The folder for temporary files cannot be used.
    #[error("the folder for temporary files: {0}")]
    Scratch(std::io::Error),
    /// The operating system refuses.
    #[error("{}: cannot {action} ({source})", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// The file is something else.
    #[error("{}: not an MCAP recording (begins with {found}, expected the MCAP magic bytes)", path.display())]
    NotMcap {
        /// The file.
        path: PathBuf,
        /// Its first bytes.
        found: String,
    },
    /// The file is a recording that this program cannot read.
    #[error("{}: {problem}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What was found and what was expected.
        problem: String,
    },
    /// The file is there already.
    #[error("{}: exists already; resume it or choose another name", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// The file was removed, replaced or emptied while it was written.
    #[error("{}: was removed, replaced or emptied while it was written; {}", path.display(), match saved {
        Ok(saved) => format!("what it held has been written into {}", saved.display()),
        Err(e) => format!("what it held is lost ({e})"),
    })]
    Removed {
        /// The file.
        path: PathBuf,
        /// Where what it held is now.
        saved: std::io::Result<PathBuf>,
    },
    /// The file has another name now, or is in another folder.
    #[error(
        "{}: was moved or renamed while it was written; what was measured is in it, under its new name: go on with that",
        path.display()
    )]
    Moved {
        /// The name that it had.
        path: PathBuf,
    },
    /// Another program writes it.
    #[error("{}: another program is writing it; wait until that has ended, or choose another name", path.display())]
    Busy {
        /// The file.
        path: PathBuf,
    },
    /// A measurement that could not be read again, and was not written.
    #[error("{}: a measurement was not written, for it could not be read again: {problem}", path.display())]
    NotReadable {
        /// The file.
        path: PathBuf,
        /// What was found and what was expected.
        problem: String,
    },
    /// The MCAP library refuses.
    #[error("{}: cannot write ({source})", path.display())]
    Mcap {
        /// The file.
        path: PathBuf,
        /// What the library said.
        source: mcap::McapError,
    },
    /// A message makes no sense.
    #[error("{}: message {number} on {topic}: {problem}", path.display())]
    Message {
        /// The file.
        path: PathBuf,
        /// Its topic.
        topic: String,
        /// Its number on the topic, from 1.
        number: usize,
        /// What was found and what was expected.
        problem: String,
    },
    /// A recording to be resumed belongs to another robot, cell, plan or arm.
    #[error("{}: was recorded with another {what}; resume with the same one, or begin a new recording", path.display())]
    Different {
        /// The file.
        path: PathBuf,
        /// What differs.
        what: String,
    },
}

impl RecordError {
    pub(crate) fn io(path: &Path, action: &'static str) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, action, source }
    }

    pub(crate) fn mcap(path: &Path) -> impl FnOnce(mcap::McapError) -> Self {
        let path = path.to_owned();
        move |source| match source {
            // a full disk says so
            mcap::McapError::Io(source) => Self::Io { path, action: "write", source },
            source => Self::Mcap { path, source },
        }
    }
}

/// Results of this crate.
pub type Result<T, E = RecordError> = std::result::Result<T, E>;
