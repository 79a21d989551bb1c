//! Visits of sockets, taken down one by one: a CSV that grows by a row at a time, each on the disk before the next.

use std::collections::BTreeSet;
use std::fs::OpenOptions;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use trical_model::robot::tidy;
use trical_model::{JointKind, Joints, Robot};

use crate::csv::is_nothing;
use crate::error::{RecordError, Result};
use crate::mcap::{Locked, is_at, is_busy, lock};
use crate::whole::{alone, write_whole};

/// A CSV of visits that is open for more.
#[derive(Debug)]
pub struct Visits {
    /// None where it could not be opened again.
    file: Option<Locked>,
    path: PathBuf,
    kinds: Vec<JointKind>,
    next: usize,
    places: BTreeSet<String>,
    /// What the file holds.
    text: Vec<u8>,
}

impl Visits {
    /// Opens a file, or begins it. A file that is there must have the same columns; nothing of it is changed. Besides it, a sentence where its last
    /// line is not whole: the next row then begins on a line of its own.
    ///
    /// # Errors
    /// The operating system's; a file with other columns.
    pub fn open(path: &Path, robot: &Robot) -> Result<(Self, Option<String>)> {
        Self::open_with(path, robot.joints.iter().map(|j| j.kind).collect())
    }

    fn open_with(path: &Path, kinds: Vec<JointKind>) -> Result<(Self, Option<String>)> {
        let io = |action| move |source| RecordError::Io { path: path.to_owned(), action, source };
        // a device may be read for ever
        crate::bounds::check_file(path, false)?;
        // two writers would give two visits one number
        let mut file = match alone(OpenOptions::new().read(true).append(true).create(true)).open(path) {
            Err(e) if is_busy(&e) => return Err(RecordError::Busy { path: path.to_owned() }),
            file => lock(file.map_err(io("be opened for more rows"))?, path)?,
        };
        file.keep_name(path);
        let mut text = Vec::new();
        (&*file).read_to_end(&mut text).map_err(io("be read"))?;
        let header = header(&kinds);
        let (path, places) = (path.to_owned(), BTreeSet::new());
        let mut this = Self { file: Some(file), path, kinds, next: 0, places, text: text.clone() };
        let Some(first) = text.split(|b| *b == b'\n').next().filter(|l| !l.is_empty()) else {
            this.put(&header)?;
            return Ok((this, None));
        };
        let first = String::from_utf8_lossy(first);
        if first.trim_end() != header {
            let problem = format!("header: found {:?}, expected {header:?}: this is another file", first.trim_end());
            return Err(RecordError::File { file: this.path.display().to_string(), problem });
        }
        let rows: Vec<&[u8]> = text.split(|b| *b == b'\n').skip(1).filter(|l| !l.trim_ascii().is_empty()).collect();
        let seq = |row: &&[u8]| String::from_utf8_lossy(row).split(',').next().and_then(|s| s.parse::<usize>().ok());
        this.next = rows.iter().filter_map(seq).max().map_or(rows.len(), |k| k.saturating_add(1));
        let column = 1 + this.kinds.len();
        let place =
            |row: &&[u8]| String::from_utf8_lossy(row).split(',').nth(column).map(|name| name.trim().to_owned());
        this.places = rows.iter().filter_map(place).collect();
        let cut = text.last() != Some(&b'\n');
        if cut {
            this.write(b"\n").map_err(|source| this.io("be written", source))?;
            this.text.push(b'\n');
        }
        let line = rows.len() + 1;
        let note = || format!("{}: line {line} did not end; look whether it is whole", this.path.display());
        let note = cut.then(note);
        Ok((this, note))
    }

    /// Adds a row and waits until it is on the disk. Joints are in SI, sockets are counted from 1; a row's number is returned, and a sentence where
    /// the file had to be written again.
    ///
    /// # Errors
    /// The operating system's: the row is then not there as a whole.
    pub fn push(&mut self, q: &Joints, place: &str, socket: usize) -> Result<(usize, Option<String>)> {
        let joints: Vec<String> = q
            .iter()
            .zip(&self.kinds)
            .map(|(q, kind)| match kind {
                JointKind::Revolute => format!("{}", tidy(q.to_degrees())),
                JointKind::Prismatic => format!("{}", tidy(q * 1e3)),
            })
            .collect();
        let seq = self.next;
        let note = self.look_for_file()?;
        self.put(&format!("{seq},{},{place},{socket},0,0,0", joints.join(",")))?;
        self.next = self.next.saturating_add(1);
        self.places.insert(place.to_owned());
        Ok((seq, note))
    }

    /// Whether there are visits at a place.
    #[must_use]
    pub fn has(&self, place: &str) -> bool {
        self.places.contains(place)
    }

    /// Takes the file that stands under the name now: an editor puts another one in its place. Where it was removed or emptied, what it held is
    /// written again, as the sentence that is returned says.
    ///
    /// # Errors
    /// The operating system's, or a file with other columns: what the file held is kept for the next time.
    pub fn look_for_file(&mut self) -> Result<Option<String>> {
        let held = std::fs::metadata(&self.path).map_or(0, |m| m.len());
        let same = self.path.canonicalize().is_ok_and(|path| self.file.as_ref().is_some_and(|file| is_at(file, &path)));
        if same && held == self.text.len() as u64 {
            return Ok(None);
        }
        let lost = held == 0 && !self.text.is_empty();
        if lost {
            let io = |source| RecordError::Io { path: self.path.clone(), action: "be written again", source };
            write_whole(&self.path, &self.text).map_err(io)?;
        }
        // its lock would be in the way of ours
        self.file = None;
        let (new, note) = Self::open_with(&self.path.clone(), self.kinds.clone())?;
        *self = Self { next: new.next.max(self.next), ..new };
        let again = || format!("{} was removed or emptied: what it held has been written again", self.path.display());
        Ok(lost.then(again).or(note))
    }

    fn put(&mut self, line: &str) -> Result<()> {
        self.write(format!("{line}\n").as_bytes()).map_err(|source| self.io("be written", source))?;
        self.text.extend_from_slice(line.as_bytes());
        self.text.push(b'\n');
        Ok(())
    }

    /// Writes all of it at the end, or nothing: half a row would spoil the file.
    fn write(&self, bytes: &[u8]) -> std::io::Result<()> {
        let Some(mut file) = self.file.as_deref() else { return Err(std::io::ErrorKind::NotFound.into()) };
        let before = file.seek(SeekFrom::End(0))?;
        file.write_all(bytes).and_then(|()| file.sync_data()).inspect_err(|_| {
            let _ = file.set_len(before);
        })
    }

    fn io(&self, action: &'static str, source: std::io::Error) -> RecordError {
        RecordError::Io { path: self.path.clone(), action, source }
    }
}

fn header(kinds: &[JointKind]) -> String {
    let joint = |(k, kind): (usize, &JointKind)| match kind {
        JointKind::Revolute => format!("q{}_deg", k + 1),
        JointKind::Prismatic => format!("q{}_mm", k + 1),
    };
    let joints: Vec<String> = kinds.iter().enumerate().map(joint).collect();
    format!("seq,{},place,ball,ix_mm,iy_mm,iz_mm", joints.join(","))
}

/// Whether a name can stand in a CSV as it is: letters, digits, `-`, `_`, `.`, blanks inside.
///
/// # Errors
/// One sentence.
pub fn check_place(name: &str) -> std::result::Result<(), String> {
    let plain = |c: char| c.is_alphanumeric() || "-_. ".contains(c);
    if is_nothing(name) || name.trim() != name || name.len() > 60 || !name.chars().all(plain) {
        return Err(format!(
            "found {name:?}, expected a name of letters, digits, -, _ and ., and none that stands for nothing (NA, none, -)"
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_places_are_those_that_a_cell_of_a_csv_can_hold() {
        let good = ["front", "Tisch 2", "a-b_c.d", "\u{e4}"];
        assert!(good.iter().all(|name| check_place(name).is_ok()));
        for name in ["", " front", "front ", "a,b", "a\nb", "\"a\"", "NA", "none", "-", &"x".repeat(61)] {
            let e = check_place(name).err().unwrap_or_default();
            assert!(e.starts_with(&format!("found {name:?}, expected a name of letters")), "{name:?}: {e}");
        }
    }
}
