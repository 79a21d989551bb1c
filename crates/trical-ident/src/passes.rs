//! Recordings larger than memory: read in passes, one that is no CSV by way of a CSV in the folder for temporary files.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::TempDir;
use thiserror::Error;
use trical_model::Row;

use crate::csv_layout::Layout;
use crate::error::IdentError;
use crate::stream::{CsvStream, LARGE};

/// Recordings with the history of the joints beyond this, bytes.
const LARGE_OTHER: u64 = 512 << 20;

/// Recordings that are read in passes.
pub struct Passes {
    /// All of them.
    pub stream: CsvStream,
    /// What was no CSV, as CSV, while it is needed.
    _folder: Option<TempDir>,
}

/// Takes a row; false where no more is wanted.
pub type Take<'a> = &'a mut dyn FnMut(&Row) -> bool;

/// Recordings of another format than CSV (MCAP), which this crate does not read itself. Errors are one sentence.
pub struct Other<'a> {
    /// Whether a file is one.
    pub is: &'a dyn Fn(&Path) -> Result<bool, String>,
    /// Hands over the measurements one after the other; gives the number of joints.
    pub each_row: &'a dyn Fn(&Path, Take<'_>) -> Result<usize, String>,
}

/// Why recordings cannot be read in passes.
#[derive(Debug, Error)]
pub enum PassesError {
    /// The recordings are at fault.
    #[error(transparent)]
    Ident(#[from] IdentError),
    /// One that is no CSV is.
    #[error("{0}")]
    Other(String),
    /// The folder for temporary files is.
    #[error("the folder for temporary files: {0}")]
    Scratch(#[from] std::io::Error),
}

/// The recordings to be read in passes: where that is `wanted`, or where they are large, allowed, and of a kind that can be.
///
/// # Errors
/// See [`PassesError`].
pub fn passes(
    recordings: &[PathBuf],
    joints: usize,
    wanted: bool,
    allowed: bool,
    other: &Other<'_>,
) -> Result<Option<Passes>, PassesError> {
    let mut size = [0, 0];
    let mut others = Vec::with_capacity(recordings.len());
    for path in recordings {
        let is = (other.is)(path).map_err(PassesError::Other)?;
        size[usize::from(is)] += std::fs::metadata(path).map_or(0, |m| m.len());
        others.push(is);
    }
    let large = size[0] > LARGE || size[1] > LARGE_OTHER;
    if !(wanted || large && allowed) {
        return Ok(None);
    }
    match open(recordings, &others, joints, other) {
        Ok(passes) => Ok(Some(passes)),
        Err(e) if wanted => Err(e),
        // what cannot be read in passes (fixed references, a pipe) is read at once, and has its errors named there
        Err(_) => Ok(None),
    }
}

fn open(recordings: &[PathBuf], others: &[bool], joints: usize, other: &Other<'_>) -> Result<Passes, PassesError> {
    let folder = if others.contains(&true) { Some(TempDir::new()?) } else { None };
    let mut files = Vec::with_capacity(recordings.len());
    for (k, path) in recordings.iter().enumerate() {
        let name = path.display().to_string();
        let file = match &folder {
            Some(folder) if others[k] => {
                let csv = folder.path().join(format!("{k}.csv"));
                let has = write_as_csv(path, &csv, other)?;
                if has != joints {
                    let problem = format!("has {has} joints, but the robot has {joints}");
                    return Err(IdentError::File { file: name, problem }.into());
                }
                csv
            }
            _ => path.clone(),
        };
        files.push((file, name));
    }
    Ok(Passes { stream: CsvStream::open_as(files, joints)?, _folder: folder })
}

/// Writes the measurements of a recording as CSV, row by row; the number of its joints.
fn write_as_csv(recording: &Path, csv: &Path, other: &Other<'_>) -> Result<usize, PassesError> {
    // first which columns there are
    let mut layout = Layout::new();
    let mut rows = 0_usize;
    let joints = (other.each_row)(recording, &mut |row| {
        layout.see(row);
        rows += 1;
        true
    })
    .map_err(PassesError::Other)?;
    if rows == 0 {
        let problem = "has no measurements".to_owned();
        return Err(IdentError::File { file: recording.display().to_string(), problem }.into());
    }
    let mut out = BufWriter::new(File::create(csv)?);
    layout.write_header(joints, &mut out)?;
    let mut failed = Ok(());
    let read = (other.each_row)(recording, &mut |row| {
        failed = layout.write_row(joints, row, &mut out);
        failed.is_ok()
    });
    failed?;
    read.map_err(PassesError::Other)?;
    out.flush()?;
    Ok(joints)
}
