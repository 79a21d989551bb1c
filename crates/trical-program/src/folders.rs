//! The files beside a program: which there are, and the bytes of those that are small.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use crate::text::listed;

/// Larger files are not looked through, bytes.
const LARGEST: u64 = 16 << 20;

/// A path from the root on, without links. Windows writes such a one as `\\?\C:\folder\file`, which no person and few other programs do.
pub(crate) fn resolved(path: &Path) -> std::io::Result<PathBuf> {
    let found = path.canonicalize()?;
    Ok(if cfg!(windows) { found.to_str().and_then(usual).map_or(found, PathBuf::from) } else { found })
}

/// A whole path of Windows as a person writes it.
fn usual(path: &str) -> Option<String> {
    let rest = path.strip_prefix(r"\\?\")?;
    match rest.strip_prefix(r"UNC\") {
        Some(share) => Some(format!(r"\\{share}")),
        None if rest.as_bytes().get(1..3) == Some(br":\") => Some(rest.to_owned()),
        None => None,
    }
}

/// What is in a folder and wanted, in the order of the names.
pub(crate) fn paths(folder: &Path, is_wanted: impl Fn(&PathBuf) -> bool) -> Vec<PathBuf> {
    let all = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path());
    let mut paths: Vec<PathBuf> = all.filter(is_wanted).collect();
    paths.sort_unstable();
    paths
}

/// What is called so in a folder, without regard to case; of two the one that is spelled so.
pub(crate) fn entry(folder: &Path, name: &str) -> Option<PathBuf> {
    let exact = folder.join(name);
    // elsewhere a file is there under each spelling, and has one of its own
    if cfg!(target_os = "linux") && exact.exists() {
        return Some(exact);
    }
    let called = |is: &dyn Fn(&OsStr) -> bool| {
        std::fs::read_dir(folder).ok()?.flatten().find(|e| is(&e.file_name())).map(|e| e.path())
    };
    called(&|found| found == name)
        .or_else(|| called(&|found| found.to_string_lossy().eq_ignore_ascii_case(name)))
        .or_else(|| exact.exists().then_some(exact))
}

/// The bytes of a file that is not too large to be looked through.
pub(crate) fn read_small(path: &Path) -> Option<Vec<u8>> {
    path.metadata().is_ok_and(|m| m.len() <= LARGEST).then(|| std::fs::read(path).ok()).flatten()
}

/// The name of a file without its folder.
pub(crate) fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Files beside a program that were not read, beyond the `first` ("500 files") or for another reason, and what follows from that; in one sentence.
pub(crate) fn not_read(files: &[String], first: &str, so: &str) -> Option<String> {
    (!files.is_empty()).then(|| {
        format!(
            "not read beside the program (larger than {} MiB, beyond the first {first}, or not readable): {}; {so}",
            LARGEST >> 20,
            listed(files.iter().cloned())
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_paths_of_windows_are_told_as_a_person_writes_them() {
        assert_eq!(usual(r"\\?\C:\cell 1\a.src").as_deref(), Some(r"C:\cell 1\a.src"));
        assert_eq!(usual(r"\\?\UNC\server\share\a.src").as_deref(), Some(r"\\server\share\a.src"));
        assert!([r"\\?\Volume{1}\a.src", r"C:\a.src", "/a"].iter().all(|path| usual(path).is_none()));
    }
}
