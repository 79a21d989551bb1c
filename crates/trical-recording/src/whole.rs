//! Files that are written whole or not at all.

use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read, Result as IoResult, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A file that is written beside the one that it replaces; it goes away unless it is put there.
pub struct Part {
    part: PathBuf,
    out: PathBuf,
}

impl Part {
    /// A file beside `out`, where that is to be a file; in the folder of temporary files where it is a device or a pipe. What a program of this
    /// number left there is taken away, so that nothing is written into a file that is there, nor through a link.
    ///
    /// # Errors
    /// The operating system's.
    pub fn of(out: &Path) -> IoResult<(Self, File)> {
        let out = behind_links(out)?;
        let mut name = out.file_name().unwrap_or_default().to_os_string();
        name.push(format!(".part{}", std::process::id()));
        let part = if is_special(&out) { std::env::temp_dir().join(name) } else { out.with_file_name(name) };
        if part.symlink_metadata().is_ok() {
            std::fs::remove_file(&part)?;
        }
        let file = alone(OpenOptions::new().read(true).write(true).create_new(true)).open(&part)?;
        Ok((Self { part, out }, file))
    }

    /// Puts the file, which is whole, where it belongs.
    ///
    /// # Errors
    /// The operating system's.
    pub fn put(self) -> IoResult<()> {
        put(&self.part, &self.out)
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        // there is none when it was put
        let _ = std::fs::remove_file(&self.part);
    }
}

/// How a file is opened that nobody else is to write. Windows refuses other writers from the moment it is opened; its locks would keep readers away,
/// too. Elsewhere an advisory lock follows.
pub(crate) fn alone(options: &mut OpenOptions) -> &mut OpenOptions {
    #[cfg(windows)]
    {
        use std::os::windows::fs::OpenOptionsExt;
        // to read, to rename and to remove
        const SHARED: u32 = 1 | 4;
        options.share_mode(SHARED);
    }
    options
}

/// Whether a path leads to a device, a pipe or a socket.
pub(crate) fn is_special(path: &Path) -> bool {
    path.metadata().is_ok_and(|found| !found.is_file() && !found.is_dir())
}

/// The file that a path leads to through links, whether it is there or not.
pub(crate) fn behind_links(path: &Path) -> IoResult<PathBuf> {
    // standard output is a link, to nothing that has a path
    if !path.is_symlink() || is_special(path) {
        return Ok(path.to_owned());
    }
    match path.canonicalize() {
        Err(e) if e.kind() == ErrorKind::NotFound => behind_links(&folder(path).join(path.read_link()?)),
        found => found,
    }
}

/// Puts a whole file where `out` is: with the permissions of the file that it replaces; into a device or a pipe, which stays one.
pub(crate) fn put(part: &Path, out: &Path) -> IoResult<()> {
    if is_special(out) {
        std::io::copy(&mut File::open(part)?, &mut OpenOptions::new().write(true).open(out)?)?;
        return std::fs::remove_file(part);
    }
    // of Windows' permissions a new file gets those of its folder
    #[cfg(unix)]
    if let Ok(old) = out.metadata() {
        std::fs::set_permissions(part, old.permissions())?;
    }
    rename(part, out)
}

/// Gives a file the name of another. On Windows one that somebody reads (a scanner for viruses, too) may not be replaced: that passes.
fn rename(part: &Path, out: &Path) -> IoResult<()> {
    const WAIT: Duration = Duration::from_millis(10);
    let mut attempts = if cfg!(windows) { 200 } else { 1 };
    loop {
        attempts -= 1;
        match std::fs::rename(part, out) {
            Err(e) if attempts > 0 && e.kind() == ErrorKind::PermissionDenied && !out.is_dir() => {
                std::thread::sleep(WAIT);
            }
            done => return done,
        }
    }
}

/// Writes a file whole or not at all.
///
/// # Errors
/// The operating system's.
pub fn write_whole(path: &Path, bytes: &[u8]) -> IoResult<()> {
    let (part, mut file) = Part::of(path)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    part.put()
}

/// Reads a file from some place on, and leaves the place alone at which it is written next.
pub(crate) struct ReadFrom<'a> {
    file: &'a File,
    at: u64,
}

impl<'a> ReadFrom<'a> {
    pub(crate) fn new(file: &'a File, at: u64) -> Self {
        Self { file, at }
    }
}

impl Read for ReadFrom<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> IoResult<usize> {
        let count = read_at(self.file, bytes, self.at)?;
        self.at += count as u64;
        Ok(count)
    }
}

#[cfg(unix)]
fn read_at(file: &File, bytes: &mut [u8], at: u64) -> IoResult<usize> {
    std::os::unix::fs::FileExt::read_at(file, bytes, at)
}

/// Windows moves the place of writing along: it is set again, whether the bytes could be read or not.
#[cfg(not(unix))]
fn read_at(mut file: &File, bytes: &mut [u8], at: u64) -> IoResult<usize> {
    use std::io::{Seek, SeekFrom};
    let end = file.stream_position()?;
    let count = file.seek(SeekFrom::Start(at)).and_then(|_| file.read(bytes));
    file.seek(SeekFrom::Start(end))?;
    count
}

/// Waits until names of files in a folder are on the disk. Windows opens no folders; NTFS keeps names in its journal.
pub(crate) fn sync_folder(folder: &Path) -> IoResult<()> {
    if cfg!(windows) { Ok(()) } else { File::open(folder)?.sync_all() }
}

/// The folder that a file is in.
pub(crate) fn folder(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn a_file_is_replaced_while_others_read_it_or_else_stays_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        write_whole(&path, b"old").unwrap();
        write_whole(&path, b"new").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        let reader = File::open(&path).unwrap();
        // which file systems of Windows replace a file that is open differs
        let replaced = write_whole(&path, b"newer").is_ok();
        assert!(replaced || cfg!(windows));
        drop(reader);
        assert_eq!(std::fs::read(&path).unwrap(), if replaced { &b"newer"[..] } else { b"new" });
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left beside");
    }

    #[cfg(unix)]
    #[test]
    fn links_devices_and_permissions_stay_what_they_are() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("file"), "old").unwrap();
        std::fs::set_permissions(at("file"), PermissionsExt::from_mode(0o600)).unwrap();
        symlink("file", at("link")).unwrap();
        symlink("not there yet", at("dangling")).unwrap();
        symlink("/dev/null", at("null")).unwrap();
        for name in ["link", "dangling", "null"] {
            write_whole(&at(name), b"new").unwrap();
            assert!(at(name).is_symlink(), "{name}");
        }
        assert_eq!(std::fs::read(at("file")).unwrap(), b"new");
        assert_eq!(at("file").metadata().unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(std::fs::read(at("not there yet")).unwrap(), b"new");
        assert!(is_special(&at("null")));
        // a pipe gets what is written
        nix::unistd::mkfifo(&at("pipe"), nix::sys::stat::Mode::S_IRWXU).unwrap();
        let pipe = at("pipe");
        let reader = std::thread::spawn(move || std::fs::read(pipe).unwrap());
        write_whole(&at("pipe"), b"new").unwrap();
        assert_eq!(reader.join().unwrap(), b"new");
        assert!(is_special(&at("pipe")));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 6, "nothing is left beside");
    }
}
