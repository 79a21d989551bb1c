//! One writer for each recording: an advisory lock on the file, from the one beside it on until the writer ends, however it
//! ends.

use std::fs::{File, TryLockError};
use std::path::Path;

use crate::error::RecordError;

/// A file that is kept from other writers until this is dropped. It is unlocked then, not only closed: a program that was being started meanwhile
/// has all files of this one open for a moment, and so their locks.
pub(super) struct Locked(File);

impl std::ops::Deref for Locked {
    type Target = File;

    fn deref(&self) -> &File {
        &self.0
    }
}

impl Drop for Locked {
    fn drop(&mut self) {
        // closing it does the rest
        let _ = self.0.unlock();
    }
}

/// Says whether another program writes a recording, in a file that may not be there.
///
/// # Errors
/// [`RecordError::Busy`], or the file cannot be opened.
pub fn check_not_written(path: &Path) -> Result<(), RecordError> {
    lock_existing(path).map(|_| ())
}

/// A recording that is there.
pub(super) fn lock_existing(path: &Path) -> Result<Option<Locked>, RecordError> {
    if !path.is_file() {
        return Ok(None);
    }
    let file = File::open(path).map_err(RecordError::io(path, "open"))?;
    lock(file, path).map(Some)
}

/// Keeps other writers from a file, which is or becomes the recording of that name.
pub(super) fn lock(file: File, path: &Path) -> Result<Locked, RecordError> {
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Err(RecordError::Busy { path: path.to_owned() }),
        // a file system without locks
        Ok(()) | Err(TryLockError::Error(_)) => Ok(Locked(file)),
    }
}

/// Whether a path leads to this very file.
#[cfg(unix)]
pub(crate) fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let same = |a: std::fs::Metadata, b: std::fs::Metadata| (a.dev(), a.ino()) == (b.dev(), b.ino());
    file.metadata().and_then(|ours| path.symlink_metadata().map(|theirs| same(ours, theirs))).unwrap_or(false)
}

#[cfg(not(unix))]
pub(crate) fn is_at(_: &File, path: &Path) -> bool {
    path.is_file()
}

/// Whether a file that was opened still has a name, be it another one: what was written into one without is lost when it is closed.
#[cfg(unix)]
pub(super) fn has_a_name(file: &File) -> bool {
    file.metadata().is_ok_and(|found| std::os::unix::fs::MetadataExt::nlink(&found) > 0)
}

/// Not known here.
#[cfg(not(unix))]
pub(super) fn has_a_name(_: &File) -> bool {
    false
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn a_file_is_free_again_though_a_program_that_was_started_meanwhile_still_has_it_open() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        std::fs::write(&path, "x").unwrap();
        let ours = lock_existing(&path).unwrap().unwrap();
        // as between a program's start and its first instruction
        let inherited = ours.try_clone().unwrap();
        assert!(matches!(check_not_written(&path), Err(RecordError::Busy { .. })));
        drop(ours);
        check_not_written(&path).unwrap();
        drop(inherited);
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_got_another_name_meanwhile_is_not_the_one_of_that_name() {
        let folder = tempfile::tempdir().unwrap();
        let (path, other) = (folder.path().join("run.mcap.part"), folder.path().join("run.mcap"));
        let file = File::create(&path).unwrap();
        assert!(is_at(&file, &path));
        std::fs::rename(&path, &other).unwrap();
        assert!(!is_at(&file, &path));
        std::fs::write(&path, "of the next writer").unwrap();
        assert!(!is_at(&file, &path) && is_at(&file, &other));
    }
}
