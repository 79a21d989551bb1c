//! What may be written: never over what is read or was measured.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use trical_model::urdf::UrdfPath;

use crate::columns;
use crate::error::{RecordError, Result};
use crate::mcap::read_recording;
use crate::open::is_mcap;
use crate::whole::{Part, behind_links, folder, is_special};

/// Whether two names lead to one file, which need not be there yet.
pub fn is_one_file(a: &Path, b: &Path) -> bool {
    let place = |path: &Path| {
        let path = behind_links(path).ok()?;
        Some((folder(&path).canonicalize().ok()?, path.file_name()?.to_owned()))
    };
    a == b || place(a).is_some_and(|a| place(b) == Some(a))
}

/// Refuses an output that cannot be written, or that would replace what is read, before any work is done.
///
/// # Errors
/// One sentence.
pub fn check_output<'a>(path: &Path, inputs: impl IntoIterator<Item = &'a Path>) -> Result<()> {
    let refused = |problem: String| Err(RecordError::File { file: path.display().to_string(), problem });
    if !folder(path).is_dir() {
        return refused(format!("the folder {} does not exist", folder(path).display()));
    }
    match path.metadata() {
        Ok(found) if found.is_dir() => return refused("is a folder; expected the name of a file".into()),
        Ok(found) if found.is_file() && found.permissions().readonly() => {
            return refused("is write-protected; expected another name, or a file that may be replaced".into());
        }
        _ => {}
    }
    for input in inputs {
        let input = UrdfPath::of(input).map_or_else(|| input.to_owned(), |urdf| urdf.path);
        // what is read from a device is not lost
        if !is_special(path) && is_one_file(path, &input) {
            return refused("is read, too, and would be replaced; expected another name for what is written".into());
        }
    }
    // it is written beside its place first, and goes away again
    if let (false, Err(e)) = (is_special(path), Part::of(path)) {
        return refused(format!("cannot write ({e})"));
    }
    Ok(())
}

/// The same of what is no recording, which would not replace one either.
///
/// # Errors
/// One sentence.
pub fn check_no_recording<'a>(path: &Path, inputs: impl IntoIterator<Item = &'a Path>) -> Result<()> {
    check_output(path, inputs)?;
    if is_recording(path) {
        let problem = "is a recording, and would be replaced; expected another name for what is written".into();
        return Err(RecordError::File { file: path.display().to_string(), problem });
    }
    Ok(())
}

/// Refuses a conversion in place of what was measured: that has the joints while the arm moved, a conversion has not, and may replace another
/// conversion only.
///
/// # Errors
/// One sentence.
pub fn check_not_measured(path: &Path) -> Result<()> {
    if path.is_file() && is_mcap(path)? && !read_recording(path).is_ok_and(|old| old.joint_states.is_empty()) {
        let problem = "holds what was measured, the joints between the measurements too, and would be replaced; expected another name";
        return Err(RecordError::File { file: path.display().to_string(), problem: problem.into() });
    }
    Ok(())
}

/// Whether a file is a recording, by how it begins.
fn is_recording(path: &Path) -> bool {
    // no pipe or device, that may wait for ever
    let Some(file) = path.is_file().then(|| File::open(path).ok()).flatten() else { return false };
    let mut head = Vec::new();
    let read = file.take(4096).read_to_end(&mut head);
    let text = String::from_utf8_lossy(&head);
    let header = text.lines().next().unwrap_or_default().trim_start_matches('\u{feff}').to_lowercase();
    let names = header.split([',', ';', '\t', ' ']).map(|n| n.trim().trim_matches('"')).filter(|n| !n.is_empty());
    read.is_ok() && (is_mcap(path).unwrap_or(false) || columns::is_recording(names))
}

/// Refuses outputs that are one file, each given with the name of what says it.
///
/// # Errors
/// One sentence.
pub fn check_apart(outputs: &[(&str, &Path)]) -> Result<(), String> {
    for (k, (option, path)) in outputs.iter().enumerate() {
        if let Some((other, _)) = outputs[..k].iter().find(|(_, other)| !is_special(path) && is_one_file(other, path)) {
            let path = path.display();
            return Err(format!("{option}: found {path}, which {other} names, too; expected a file for each"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn one_file_is_known_under_its_names() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("sub")).unwrap();
        assert!(is_one_file(&at("a"), &at("./a")) && is_one_file(&at("a"), &at("sub/../a")));
        assert!(!is_one_file(&at("a"), &at("b")) && !is_one_file(&at("a"), &at("sub/a")));
        let said = check_apart(&[("--report", &at("a")), ("--certificate", &at("sub/../a"))]).unwrap_err();
        assert!(said.contains("which --report names, too"), "{said}");
        let says = |path: &Path, input: &Path| check_output(path, [input]).unwrap_err().to_string();
        assert!(says(&at("sub"), &at("x")).contains("is a folder; expected the name of a file"));
        assert!(says(&at("none/x"), &at("y")).contains("does not exist"));
        // what the system does not let be written is told before the work, and leaves nothing behind
        assert!(says(&at(&"n".repeat(255)), &at("y")).contains("cannot write ("));
        check_output(&at("new"), [at("y").as_path()]).unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        std::fs::write(at("old"), "x").unwrap();
        let mut protected = at("old").metadata().unwrap().permissions();
        protected.set_readonly(true);
        std::fs::set_permissions(at("old"), protected).unwrap();
        assert!(says(&at("old"), &at("y")).contains("is write-protected"));
        std::fs::write(at("a.urdf"), "x").unwrap();
        assert!(says(&at("sub/../a.urdf"), &at("a.urdf#base:tool")).contains("is read, too"));
    }

    #[test]
    fn a_recording_is_known_by_how_it_begins_and_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |text: &str| {
            let path = folder.path().join("out.csv");
            std::fs::write(&path, text).unwrap();
            check_no_recording(&path, []).is_err()
        };
        let head = "ball,q1_deg,q2_deg,ix_mm,iy_mm,iz_mm\n";
        assert!(
            refused(head) && refused(&format!("\u{feff}{}", head.to_uppercase())) && refused(&head.replace(',', ";"))
        );
        assert!(!refused("name,price\n") && !refused(""));
    }
}
