//! Which recordings are read in passes; one that is no CSV goes by way of a CSV in the folder for temporary files.

use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter};
use std::path::{Path, PathBuf};

use tempfile::TempDir;
use trical_model::{Robot, Row};

use super::CsvStream;
use crate::csv::{CsvWriter, Layout};
use crate::error::{RecordError, Result};
use crate::mcap::each_row;
use crate::open::{is_mcap, refuse_other_units};
use crate::shared::Shared;

/// CSV recordings beyond this are better read in passes, bytes: some 300 000 touches.
const LARGE_CSV: u64 = 32 << 20;

/// Recordings with the history of the joints beyond this, bytes.
const LARGE_MCAP: u64 = 512 << 20;

/// The recordings of an arm to be read in passes: where that is `wanted`, or where they are large, it is `allowed`, and they can be.
///
/// # Errors
/// As [`CsvStream::open`]; an MCAP recording that is damaged or of another arm; no room for temporary files.
pub fn open_large(recordings: &[PathBuf], robot: &Robot, wanted: bool, allowed: bool) -> Result<Option<CsvStream>> {
    let mut size = [0, 0];
    let mut of_mcap = Vec::with_capacity(recordings.len());
    for path in recordings {
        let is = is_mcap(path)?;
        size[usize::from(is)] += std::fs::metadata(path).map_or(0, |m| m.len());
        of_mcap.push((path, is));
    }
    let large = size[0] > LARGE_CSV || size[1] > LARGE_MCAP;
    if !(wanted || large && allowed) {
        return Ok(None);
    }
    match open(&of_mcap, robot) {
        Ok(stream) => Ok(Some(stream)),
        Err(e) if wanted => Err(e),
        // what cannot be read in passes (places, a pipe) is read at once, and has its errors named there
        Err(_) => Ok(None),
    }
}

fn open(recordings: &[(&PathBuf, bool)], robot: &Robot) -> Result<CsvStream> {
    refuse_copies(recordings)?;
    let any = recordings.iter().any(|(_, is_mcap)| *is_mcap);
    let folder = if any { Some(TempDir::new().map_err(RecordError::Scratch)?) } else { None };
    let mut files = Vec::with_capacity(recordings.len());
    for (k, (path, is_mcap)) in recordings.iter().enumerate() {
        let file = match &folder {
            Some(folder) if *is_mcap => {
                let csv = folder.path().join(format!("{k}.csv"));
                write_as_csv(path, &csv, robot.dof())?;
                csv
            }
            _ => (*path).clone(),
        };
        files.push((file, path.display().to_string()));
    }
    let stream = CsvStream::open_as(files, robot.dof(), folder)?;
    stream.heads()?.iter().try_for_each(|head| refuse_other_units(head, robot))?;
    Ok(stream)
}

/// Refuses files with the same bytes: rows of the sample, by which others are told to be the same, are not those of a copy.
fn refuse_copies(recordings: &[(&PathBuf, bool)]) -> Result<()> {
    let size = |path: &Path| std::fs::metadata(path).map_or(0, |m| m.len());
    for (k, (path, _)) in recordings.iter().enumerate() {
        for (other, _) in recordings.iter().take(k).filter(|(other, _)| size(other) == size(path)) {
            if same_bytes(path, other).unwrap_or(false) {
                let problem =
                    format!("holds the same measurements as {}; expected each recording once", other.display());
                return Err(RecordError::File { file: path.display().to_string(), problem });
            }
        }
    }
    Ok(())
}

fn same_bytes(a: &Path, b: &Path) -> std::io::Result<bool> {
    let open = |path: &Path| File::open(path).map(BufReader::new);
    let (mut a, mut b) = (open(a)?, open(b)?);
    loop {
        let (x, y) = (a.fill_buf()?, b.fill_buf()?);
        let n = x.len().min(y.len());
        if n == 0 || x[..n] != y[..n] {
            return Ok(x.is_empty() && y.is_empty());
        }
        a.consume(n);
        b.consume(n);
    }
}

/// Writes the measurements of an MCAP recording as CSV, row by row.
fn write_as_csv(recording: &Path, csv: &Path, joints: usize) -> Result<()> {
    let each =
        |take: &mut dyn FnMut(&Row) -> Result<()>| -> Result<Shared> { each_row(recording, &mut |row| take(&row)) };
    // first which columns there are
    let mut layout = Layout::default();
    let mut rows = 0_usize;
    let shared = each(&mut |row| {
        layout.see(row);
        rows += 1;
        Ok(())
    })?;
    let error = |problem: String| RecordError::File { file: recording.display().to_string(), problem };
    if rows == 0 {
        let problem = "has no measurements as TriCal writes them; a bag of others is not read in passes, but at once";
        return Err(error(problem.to_owned()));
    }
    if shared.joints != joints {
        return Err(error(format!("has {} joints, but the robot has {joints}", shared.joints)));
    }
    let out = File::create(csv).map_err(RecordError::Scratch)?;
    let mut out = CsvWriter::new(BufWriter::new(out), &layout, shared).map_err(RecordError::Scratch)?;
    each(&mut |row| out.write(row).map_err(RecordError::Scratch))?;
    out.finish().map_err(RecordError::Scratch)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_copy_of_a_recording_is_not_read_in_passes_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let rows: String = (0..50).map(|k| format!("{k},0,1,{k},0,0\n")).collect();
        let file = |name: &str, rows: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, format!("q1_deg,q2_deg,target,x_mm,y_mm,z_mm\n{rows}")).unwrap();
            path
        };
        let (a, copy, other) = (file("a.csv", &rows), file("b.csv", &rows), file("c.csv", &rows.replace("7,0", "6,0")));
        let mut robot = Robot::parse(include_str!("../../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
        robot.joints.truncate(2);
        let told = |files: &[&PathBuf]| {
            let files: Vec<PathBuf> = files.iter().map(|f| (*f).clone()).collect();
            open_large(&files, &robot, true, true).map(|_| ()).map_err(|e| e.to_string())
        };
        assert_eq!(told(&[&a, &other]), Ok(()));
        let error = told(&[&a, &other, &copy]).unwrap_err();
        assert!(
            error.ends_with("a.csv; expected each recording once") && error.contains("b.csv: holds the same"),
            "{error}"
        );
    }
}
