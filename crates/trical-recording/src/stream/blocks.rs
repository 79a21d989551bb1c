//! Files in blocks of whole lines, of a fixed size: what one thread takes.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::at_one_pose;
use crate::csv::{Parser, csv_reader, ends_of_lines, is_untidy};
use crate::error::{RecordError, Result};

/// Bytes of a block.
pub(super) const BLOCK: usize = 1 << 20;

/// A file whose header has been read.
#[derive(Debug)]
pub(super) struct Source {
    path: PathBuf,
    pub(super) name: String,
    pub(super) header: csv::StringRecord,
    /// Where the rows begin.
    offset: u64,
    pub(super) bytes: u64,
}

/// Whole lines of a file.
pub(super) struct Block {
    pub(super) bytes: Vec<u8>,
    pub(super) lines_before: usize,
    /// Blocks before it.
    pub(super) number: usize,
}

/// The blocks of a file, one after the other.
pub(super) struct Blocks<'a> {
    source: &'a Source,
    /// Reads the joints where no pose may be cut.
    whole_poses: Option<&'a Parser<'a>>,
    file: File,
    carry: Vec<u8>,
    lines: usize,
    number: usize,
}

impl Source {
    pub(super) fn error(&self, problem: impl Into<String>) -> RecordError {
        RecordError::File { file: self.name.clone(), problem: problem.into() }
    }

    pub(super) fn open(path: &Path, name: String) -> Result<Self> {
        let mut this = Self { path: path.to_owned(), name, header: csv::StringRecord::new(), offset: 0, bytes: 0 };
        let file = File::open(path).map_err(|e| this.error(format!("cannot be read: {e}")))?;
        this.bytes = file.metadata().map_err(|e| this.error(format!("cannot be read: {e}")))?.len();
        let mut line = Vec::new();
        let mut reader = BufReader::new(file).take(BLOCK as u64);
        reader.read_until(b'\n', &mut line).map_err(|e| this.error(format!("cannot be read: {e}")))?;
        this.offset = line.len() as u64;
        let mut begin = line.clone();
        reader.read_to_end(&mut begin).map_err(|e| this.error(format!("cannot be read: {e}")))?;
        if let Some(note) = is_untidy(&begin) {
            return Err(this.error(format!("{note}; such a file is read at once only, not in passes")));
        }
        let text =
            std::str::from_utf8(&line).map_err(|_| this.error("is not a text file; expected a CSV recording"))?;
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        if text.trim().is_empty() {
            return Err(this.error("is empty; expected a CSV recording with a header line"));
        }
        let mut csv = csv_reader(false).from_reader(text.as_bytes());
        let mut header = csv::StringRecord::new();
        csv.read_record(&mut header).map_err(|e| this.error(format!("the header cannot be read: {e}")))?;
        this.header = header;
        Ok(this)
    }

    /// The blocks; with a parser none of them ends between two rows of one pose.
    pub(super) fn blocks<'a>(&'a self, whole_poses: Option<&'a Parser<'a>>) -> Result<Blocks<'a>> {
        let mut file = File::open(&self.path).map_err(|e| self.error(format!("cannot be read: {e}")))?;
        file.seek(SeekFrom::Start(self.offset)).map_err(|e| self.error(format!("cannot be read: {e}")))?;
        Ok(Blocks { source: self, whole_poses, file, carry: Vec::new(), lines: 1, number: 0 })
    }
}

impl Blocks<'_> {
    pub(super) fn next(&mut self) -> Result<Option<Block>> {
        let mut bytes = std::mem::take(&mut self.carry);
        let mut size = BLOCK.max(2 * bytes.len());
        loop {
            bytes.reserve(size - bytes.len());
            let read = (&self.file).take((size - bytes.len()) as u64).read_to_end(&mut bytes);
            read.map_err(|e| self.source.error(format!("cannot be read: {e}")))?;
            if bytes.is_empty() {
                return Ok(None);
            }
            if bytes.len() < size {
                break;
            }
            let Some(end) = bytes.iter().rposition(|b| *b == b'\n') else {
                return Err(self.source.error(format!(
                    "line {} is longer than {BLOCK} bytes; expected a recording, one measurement a line",
                    self.lines + 1
                )));
            };
            let lines = &bytes[..=end];
            let end = self.whole_poses.map_or(end + 1, |parser| before_last_pose(parser, lines));
            if end > 0 {
                self.carry = bytes.split_off(end);
                break;
            }
            // all of it is one pose
            size *= 2;
        }
        let lines_before = self.lines;
        self.lines += ends_of_lines(&bytes);
        self.number += 1;
        Ok(Some(Block { bytes, lines_before, number: self.number - 1 }))
    }
}

/// Where the last pose of whole lines begins.
fn before_last_pose(parser: &Parser<'_>, lines: &[u8]) -> usize {
    let (mut from, mut after) = (lines.len(), None);
    while from > 0 {
        let line = lines[..from - 1].iter().rposition(|b| *b == b'\n').map_or(0, |end| end + 1);
        let row = parser.row_of(&lines[line..from]);
        if row.zip(after).is_some_and(|(row, after)| !at_one_pose(&row, &after)) {
            return from;
        }
        (from, after) = (line, row.or(after));
    }
    0
}
