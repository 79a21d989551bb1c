//! How much of a file is read.

use std::path::Path;

use crate::error::{RecordError, Result};

/// A recording that is read whole is not larger, bytes.
const LARGEST: u64 = 512 << 20;

/// Refuses what is no file: a pipe or a device can be endless. With `whole`, a file too large to be held too.
///
/// # Errors
/// One sentence that names the file.
pub(crate) fn check_file(path: &Path, whole: bool) -> Result<()> {
    let file = || path.display().to_string();
    // what is not there, or a folder, is told by who opens it
    let Ok(found) = std::fs::metadata(path) else { return Ok(()) };
    if !found.is_file() && !found.is_dir() {
        let problem = "is a pipe or a device, expected a recording in a file".to_owned();
        return Err(RecordError::File { file: file(), problem });
    }
    if whole && found.len() > LARGEST {
        let problem = format!(
            "has {} MiB, and recordings of more than {} MiB can be read in passes only",
            found.len() >> 20,
            LARGEST >> 20
        );
        return Err(RecordError::File { file: file(), problem });
    }
    Ok(())
}
