//! A large file into memory, which never holds its text.

use std::path::Path;

use trical_model::Recording;

use super::blocks::{BLOCK, Source};
use crate::bounds::check_file;
use crate::csv::{Lines, Parser, Reading, are_plain, csv_reader};

/// Reads a file of several blocks; `None` where it is smaller, or anything in it is not as it should be: then it has to be seen as a whole
/// to say what.
pub(crate) fn load(path: &Path, joints: usize) -> Option<Recording> {
    check_file(path, true).ok()?;
    let size = path.metadata().ok()?.len();
    if size <= BLOCK as u64 {
        return None;
    }
    let source = Source::open(path, path.display().to_string()).ok()?;
    let parser = Parser::new(&source.name, &source.header, joints).ok()?;
    let mut reading = Reading::new(&parser, joints);
    let mut blocks = source.blocks(None).ok()?;
    while let Some(block) = blocks.next().ok()? {
        let text = std::str::from_utf8(&block.bytes).ok().filter(|text| are_plain(text))?;
        reading
            .take(Lines::of(csv_reader(false).from_reader(text.as_bytes()), text.as_bytes()), block.lines_before)
            .ok()?;
    }
    reading.end([]).ok()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::csv::parse_csv;

    const HEAD: &str = "t_s,q1_deg,q2_deg,x_mm,y_mm,z_mm\n";

    /// A row for each line from the second on, of about 64 bytes.
    fn row(line: usize) -> String {
        let k = line as f64;
        format!("{}.5,{:.7},-{:.7},{:.9},{:.9},{}\n", line, k * 1e-3, k * 7e-4, 100.0 + k * 1e-2, -k * 3e-3, line % 7)
    }

    /// What is read of a large file with `last` as its last line, block by block and as a whole.
    fn read(last: &str) -> (Option<Recording>, Result<Recording, String>, String) {
        let rows: String = (2..60_000).map(row).collect();
        let text = format!("{HEAD}{rows}{last}");
        assert!(text.len() > 2 * BLOCK);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("large.csv");
        std::fs::write(&path, &text).unwrap();
        let name = path.display().to_string();
        let opened = crate::open(&path, Some(2)).map_err(|e| e.to_string());
        let whole = parse_csv(text.as_bytes(), &name, 2).map_err(|e| e.to_string());
        assert_eq!(opened, whole, "{last}");
        (load(&path, 2), whole, name)
    }

    #[test]
    fn a_large_file_block_by_block_is_what_it_is_as_a_whole() {
        let (blocks, whole, _) = read(&row(60_000));
        assert!(blocks.as_ref() == whole.as_ref().ok() && blocks.is_some_and(|r| r.rows.len() == 59_999));
        // a row that is left out is told with its line
        let (blocks, whole, name) = read("60001,1,2,,4,5\n");
        assert_eq!(blocks, whole.ok());
        assert_eq!(blocks.unwrap().notes, [format!("{name}: line 60000 lacks a measured value and is left out")]);
    }

    #[test]
    fn what_is_not_as_it_should_be_is_read_as_a_whole() {
        for (last, told) in [
            ("# the end\n", "remarks"),
            ("\n", ""),
            (" \n", "lines without a value"),
            ("60001,1,2,3,\"4\",5\n", ""),
            ("60001,1,2,x,4,5\n", "line 60000, column x_mm: found 'x'"),
            ("0,1,2,3,4,5\n", "line 60000, column t_s: found 0 after"),
            ("60001,1,2,3,4\n", "line 60000: found 5 fields"),
        ] {
            let (blocks, whole, _) = read(last);
            assert_eq!(blocks, None, "{last}");
            let said = whole.map_or_else(|e| e, |r| r.notes.join(" "));
            assert!(said.contains(told) && (told.is_empty() == said.is_empty()), "{said}");
        }
    }
}
