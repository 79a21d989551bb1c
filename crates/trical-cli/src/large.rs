//! Recordings larger than memory: read in passes, an MCAP recording by way of a CSV in the folder for temporary files.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::TempDir;
use trical_device::record::{RecordError, each_row};
use trical_ident::stream::LARGE;
use trical_ident::{CsvStream, Layout};

use crate::error::{CliError, Result};
use crate::input;

/// MCAP recordings beyond this, which hold the history of the joints too.
const LARGE_MCAP: u64 = 512 << 20;

/// Recordings that are read in passes.
pub struct Passes {
    pub stream: CsvStream,
    /// What MCAP recordings hold, as CSV, while it is needed.
    _folder: Option<TempDir>,
}

/// The recordings to be read in passes: where that is `wanted`, or where they are large, allowed, and of a kind that can be.
pub fn passes(recordings: &[PathBuf], joints: usize, wanted: bool, allowed: bool) -> Result<Option<Passes>> {
    let mut size = [0, 0];
    let mut mcap = Vec::with_capacity(recordings.len());
    for path in recordings {
        let is = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mcap")) || input::is_mcap(path)?;
        size[usize::from(is)] += std::fs::metadata(path).map_or(0, |m| m.len());
        mcap.push(is);
    }
    let large = size[0] > LARGE || size[1] > LARGE_MCAP;
    if !(wanted || large && allowed) {
        return Ok(None);
    }
    match open(recordings, &mcap, joints) {
        Ok(passes) => Ok(Some(passes)),
        Err(e) if wanted => Err(e),
        // what cannot be read in passes (fixed references, a pipe) is read at once, and has its errors named there
        Err(_) => Ok(None),
    }
}

fn open(recordings: &[PathBuf], mcap: &[bool], joints: usize) -> Result<Passes> {
    let failed = |e: std::io::Error| CliError::Failed(format!("the folder for temporary files: {e}"));
    let folder = if mcap.contains(&true) { Some(TempDir::new().map_err(failed)?) } else { None };
    let mut files = Vec::with_capacity(recordings.len());
    for (k, path) in recordings.iter().enumerate() {
        let file = match &folder {
            Some(folder) if mcap[k] => {
                let csv = folder.path().join(format!("{k}.csv"));
                let has = write_as_csv(path, &csv)?;
                if has != joints {
                    return Err(CliError::Input(format!(
                        "{}: has {has} joints, but the robot has {joints}",
                        path.display()
                    )));
                }
                csv
            }
            _ => path.clone(),
        };
        files.push((file, path.display().to_string()));
    }
    Ok(Passes { stream: CsvStream::open_as(files, joints)?, _folder: folder })
}

/// Writes the measurements of an MCAP recording as CSV, row by row; the number of its joints.
fn write_as_csv(recording: &Path, csv: &Path) -> Result<usize> {
    let refused = |e: RecordError| match e {
        RecordError::Unreadable { .. } => CliError::Input(format!("{e}; trical convert saves what is whole in it")),
        _ => CliError::Input(e.to_string()),
    };
    // first which columns there are
    let mut layout = Layout::new();
    let mut rows = 0_usize;
    let see = &mut |row| {
        layout.see(&row);
        rows += 1;
        Ok(())
    };
    let joints = each_row(recording, see).map_err(refused)?;
    if rows == 0 {
        return Err(CliError::Input(format!("{}: has no measurements", recording.display())));
    }
    let failed = |e: std::io::Error| CliError::Failed(format!("{}: cannot be written: {e}", csv.display()));
    let mut out = BufWriter::new(File::create(csv).map_err(failed)?);
    layout.write_header(joints, &mut out).map_err(failed)?;
    each_row(recording, &mut |row| {
        let io = |source| RecordError::Io { path: csv.to_owned(), action: "write", source };
        layout.write_row(joints, &row, &mut out).map_err(io)
    })
    .map_err(refused)?;
    out.flush().map_err(failed)?;
    Ok(joints)
}
