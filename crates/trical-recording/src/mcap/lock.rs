//! One writer for each recording: an advisory lock on the file, from the one beside it on until the writer ends, however it
//! ends. On Windows, whose locks keep readers away, the file is opened so that nobody else can open it for writing.

use std::fs::{File, OpenOptions, TryLockError};
use std::path::Path;

use crate::error::RecordError;
use crate::whole::alone;

/// A file that is kept from other writers until this is dropped. It is unlocked then, not only closed: a program that was being started meanwhile
/// has all files of this one open for a moment, and so their locks.
#[derive(Debug)]
pub(crate) struct Locked {
    file: File,
    /// On Windows: open as well, so that nobody takes the name away.
    _name: Option<File>,
}

impl std::ops::Deref for Locked {
    type Target = File;

    fn deref(&self) -> &File {
        &self.file
    }
}

impl Locked {
    /// The file has its name by now. Nobody but Windows keeps it for us.
    pub(crate) fn keep_name(&mut self, path: &Path) {
        #[cfg(windows)]
        {
            use std::os::windows::fs::OpenOptionsExt;
            // to read and to write (for ours), not to rename and remove
            const SHARED: u32 = 1 | 2;
            // where it cannot be kept, it is looked for after each measurement
            self._name = OpenOptions::new().read(true).share_mode(SHARED).open(path).ok();
        }
        #[cfg(not(windows))]
        let _ = path;
    }
}

impl Drop for Locked {
    fn drop(&mut self) {
        // closing it does the rest
        if !cfg!(windows) {
            let _ = self.file.unlock();
        }
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
    // to write, for Windows: who only reads is in nobody's way
    let file = match alone(OpenOptions::new().read(true).write(cfg!(windows))).open(path) {
        Err(e) if is_busy(&e) => return Err(RecordError::Busy { path: path.to_owned() }),
        file => file.map_err(RecordError::io(path, "open"))?,
    };
    lock(file, path).map(Some)
}

/// Keeps other writers from a file that was opened [`alone`], which is or becomes the recording of that name.
pub(crate) fn lock(file: File, path: &Path) -> Result<Locked, RecordError> {
    if !cfg!(windows) && matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
        return Err(RecordError::Busy { path: path.to_owned() });
    }
    // or a file system without locks
    Ok(Locked { file, _name: None })
}

/// Whether a file was not opened since another program writes it.
pub(crate) fn is_busy(error: &std::io::Error) -> bool {
    const ERROR_SHARING_VIOLATION: i32 = 32;
    cfg!(windows) && error.raw_os_error() == Some(ERROR_SHARING_VIOLATION)
}

/// Whether a path leads to this very file.
#[cfg(unix)]
pub(crate) fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let same = |a: std::fs::Metadata, b: std::fs::Metadata| (a.dev(), a.ino()) == (b.dev(), b.ino());
    file.metadata().and_then(|ours| path.symlink_metadata().map(|theirs| same(ours, theirs))).unwrap_or(false)
}

/// Where ours is, nobody can open it for writing, nor can we.
#[cfg(not(unix))]
pub(crate) fn is_at(_: &File, path: &Path) -> bool {
    alone(OpenOptions::new().write(true)).open(path).is_err_and(|e| is_busy(&e))
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

    // Windows gives a program that is started no files of this one
    #[cfg(unix)]
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

    #[test]
    fn a_file_that_got_another_name_meanwhile_is_not_the_one_of_that_name() {
        let folder = tempfile::tempdir().unwrap();
        let (path, other) = (folder.path().join("run.mcap.part"), folder.path().join("run.mcap"));
        let open = |path: &Path| alone(OpenOptions::new().write(true).create(true)).open(path).unwrap();
        let file = open(&path);
        assert!(is_at(&file, &path));
        std::fs::rename(&path, &other).unwrap();
        assert!(!is_at(&file, &path));
        std::fs::write(&path, "of the next writer").unwrap();
        assert!(!is_at(&file, &path) && is_at(&file, &other));
    }

    #[test]
    fn a_recording_that_is_written_can_be_read_and_not_written_by_others() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let (part, file) = crate::whole::Part::of(&path).unwrap();
        let ours = lock(file, &path).unwrap();
        std::io::Write::write_all(&mut &*ours, b"so far").unwrap();
        part.put().unwrap();
        assert!(matches!(check_not_written(&path), Err(RecordError::Busy { .. })));
        assert_eq!(std::fs::read(&path).unwrap(), b"so far");
        drop(ours);
        check_not_written(&path).unwrap();
    }
}
