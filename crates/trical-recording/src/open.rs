//! Recordings from files: CSV or MCAP, by what is in them.

use std::io::Read;
use std::path::{Path, PathBuf};

use trical_model::{Recording, Robot};

use crate::bounds::check_file;
use crate::columns::{Field, column, find};
use crate::csv::{header_names, load_csv, parse_csv, write_csv};
use crate::error::{RecordError, Result};
use crate::expected::Expected;
use crate::mcap::read_any;
use crate::stream;

fn unreadable(path: &Path) -> impl FnOnce(std::io::Error) -> RecordError {
    let file = path.display().to_string();
    move |e| RecordError::File { file, problem: format!("cannot be read: {e}") }
}

/// A file, and the topic of a bag's measurements that may be named behind it, as in `run.mcap#/tracker/pose`.
fn file_and_topic(path: &Path) -> (PathBuf, Option<String>) {
    match path.to_str().and_then(|text| text.split_once(".mcap#")) {
        Some((stem, topic)) if !path.exists() => (PathBuf::from(format!("{stem}.mcap")), Some(topic.to_owned())),
        _ => (path.to_owned(), None),
    }
}

/// Whether a file is an MCAP recording, by its name or by how it begins.
///
/// # Errors
/// It cannot be read.
pub fn is_mcap(path: &Path) -> Result<bool> {
    let (path, _) = file_and_topic(path);
    let path = path.as_path();
    not_sqlite(path)?;
    check_file(path, false)?;
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mcap")) {
        return Ok(true);
    }
    let mut magic = [0; 8];
    let read = std::fs::File::open(path).and_then(|mut f| f.read(&mut magic)).map_err(unreadable(path))?;
    Ok(magic.get(..read).is_some_and(|begin| begin.starts_with(b"\x89MCAP")))
}

/// A bag of ROS 2 in sqlite3, or the folder of a bag, is told what to do with it.
fn not_sqlite(path: &Path) -> Result<()> {
    let is = |name: &str| path.file_name().is_some_and(|n| n == name);
    let folder = if is("metadata.yaml") { path.parent().unwrap_or(path) } else { path };
    let holds = |ending: &str| {
        let files = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path());
        files.filter(|p| p.extension().is_some_and(|e| e == ending)).min()
    };
    let (bag, sqlite) = (folder.is_dir(), path.extension().is_some_and(|e| e == "db3"));
    let problem = match (holds("mcap"), holds("db3")) {
        (Some(mcap), _) if bag => format!("is the folder of a bag; expected the recording in it: {}", mcap.display()),
        (None, Some(_)) if bag => CONVERT.to_owned(),
        _ if sqlite => CONVERT.to_owned(),
        _ => return Ok(()),
    };
    Err(RecordError::File { file: path.display().to_string(), problem })
}

/// What to do with a bag in sqlite3.
const CONVERT: &str = "is a ROS 2 bag in sqlite3; expected MCAP: ros2 bag convert -i BAG -o out.yaml, with out.yaml = \
                       {output_bags: [{uri: converted, storage_id: mcap, all_topics: true}]}";

/// Files of other kinds, by how they begin or end, and what a person does with them.
fn no_recording(path: &Path) -> Option<&'static str> {
    let mut head = [0; 4];
    let begins = path.is_file() && std::fs::File::open(path).and_then(|mut f| f.read_exact(&mut head)).is_ok();
    match head {
        [b'P', b'K', 3, 4] if begins => {
            return Some("is a spreadsheet or another ZIP file, expected a recording: save the sheet as CSV");
        }
        [0xd0, 0xcf, 0x11, 0xe0] if begins => {
            return Some("is a spreadsheet, expected a recording: save the sheet as CSV");
        }
        [0x1f, 0x8b, ..] | [0x28, 0xb5, 0x2f, 0xfd] if begins => {
            return Some("is compressed, expected a recording: unpack it first");
        }
        [b'%', b'P', b'D', b'F'] if begins => return Some("is a PDF, expected a recording (CSV or MCAP)"),
        _ => {}
    }
    let ends = |with: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(with));
    if ends("toml") {
        Some("is a TOML file, as robots, cells and models are, expected a recording (CSV or MCAP)")
    } else if ["urdf", "xacro", "xml"].into_iter().any(ends) {
        Some("is an XML file, as robots are, expected a recording (CSV or MCAP)")
    } else {
        None
    }
}

/// Number of joints by a CSV's header, the last that it has; 1 where it has none: the reader says what is missing.
fn joints_of_csv(path: &Path) -> Result<usize> {
    let mut begin = Vec::new();
    std::fs::File::open(path).and_then(|f| f.take(1 << 16).read_to_end(&mut begin)).map_err(unreadable(path))?;
    Ok(joints_of_header(&begin))
}

fn joints_of_header(begin: &[u8]) -> usize {
    let names = header_names(begin);
    let joints = names.iter().filter_map(|n| find(n)).filter(|(column, ..)| column.field == Field::Joints);
    joints.map(|(_, k, _)| k + 1).max().unwrap_or(1)
}

/// Reads the bytes of a CSV with as many joints as it has; `name` stands for the file in messages.
///
/// # Errors
/// As [`open`].
pub fn parse(name: &str, bytes: &[u8]) -> Result<Recording> {
    parse_csv(bytes, name, joints_of_header(bytes.get(..1 << 16).unwrap_or(bytes)))
}

/// Reads a recording of the `expected` arm, CSV or MCAP. A damaged MCAP is refused: who works with a part of the data should know it
/// ([`open_damaged`]).
///
/// # Errors
/// A file that cannot be read or makes no sense, [`RecordError::Damaged`], or a recording of an arm with other joints.
pub fn open<'a>(path: &Path, expected: impl Into<Expected<'a>>) -> Result<Recording> {
    let (recording, lost) = open_damaged(path, expected)?;
    match lost {
        Some(lost) => Err(RecordError::Damaged { lost, complete: recording.rows.len() }),
        None => Ok(recording),
    }
}

/// As [`open`]; of a damaged MCAP what is whole, and one sentence on what was lost.
///
/// # Errors
/// As [`open`]; a damaged MCAP without a complete measurement.
pub fn open_damaged<'a>(path: &Path, expected: impl Into<Expected<'a>>) -> Result<(Recording, Option<String>)> {
    let expected: Expected<'_> = expected.into();
    let joints = expected.joints;
    if !is_mcap(path)? {
        if let Some(problem) = no_recording(path) {
            return Err(RecordError::File { file: path.display().to_string(), problem: problem.to_owned() });
        }
        let joints = joints.map_or_else(|| joints_of_csv(path), Ok)?;
        let recording = stream::load(path, joints).map_or_else(|| load_csv(path, joints), Ok)?;
        return Ok((recording, None));
    }
    let (path, topic) = file_and_topic(path);
    let path = path.as_path();
    let read = read_any(path, expected, topic.as_deref())?;
    let error = |problem: String| RecordError::File { file: path.display().to_string(), problem };
    if read.recording.rows.is_empty() {
        let why = match read.lost {
            Some(lost) => format!("{lost}; there is no complete measurement in it"),
            None => format!("{}: has no measurements", path.display()),
        };
        return Err(RecordError::Empty(why));
    }
    let found = read.recording.joints;
    match joints.filter(|joints| *joints != found) {
        Some(joints) => Err(error(format!("has {found} joints, but the robot has {joints}"))),
        None => Ok((read.recording, read.lost)),
    }
}

/// Refuses a recording in which a joint turns that slides in the robot, or the other way round: millimetres of a joint that turns would be
/// fitted as radians.
///
/// # Errors
/// One sentence with file, column, what was found and what was expected.
pub fn refuse_other_units(recording: &Recording, robot: &Robot) -> Result<()> {
    let (Some(found), expected) = (recording.prismatic, robot.prismatic()) else { return Ok(()) };
    let Some(k) = found.iter().zip(&expected).take(robot.dof()).position(|(a, b)| a != b) else { return Ok(()) };
    let q = column(Field::Joints);
    let name = |prismatic| {
        let unit = q.unit(k, prismatic);
        let or = unit.si().map(|si| format!(" or {}", q.name(k, si))).unwrap_or_default();
        q.name(k, unit) + &or
    };
    Err(RecordError::At {
        file: recording.name.clone(),
        place: format!("joint {}", k + 1),
        problem: format!(
            "found column {}, expected {}, for this joint of the robot {}",
            name(&found),
            name(&expected),
            if expected[k] { "slides" } else { "turns" }
        ),
    })
}

/// The bytes of a CSV with all of a recording.
///
/// # Errors
/// There is no memory.
pub fn to_csv(recording: &Recording) -> Result<Vec<u8>> {
    let mut text = Vec::new();
    write_csv(recording, &mut text)
        .map_err(|e| RecordError::File { file: recording.name.clone(), problem: e.to_string() })?;
    Ok(text)
}
