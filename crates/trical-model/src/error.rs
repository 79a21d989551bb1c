//! What can be wrong with a robot, a cell or a model.

use thiserror::Error;

/// Bad input to this crate. Each message is one sentence that can be shown to a user as it is.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum ModelError {
    /// A file is not what it should be; `place` is a line or a field.
    #[error("{file}, {place}: {problem}")]
    Input {
        /// File name as the user gave it.
        file: String,
        /// "line 12" or "joint 3, mass_kg".
        place: String,
        /// What was found and what was expected.
        problem: String,
    },
    /// The file cannot be read at all.
    #[error("{file}: {problem}")]
    Unreadable {
        /// File name as the user gave it.
        file: String,
        /// The operating system's words.
        problem: String,
    },
    /// Gravity torques were asked of a robot whose links have no masses.
    #[error(
        "robot '{robot}': joint {joint} has no mass_kg, and compliance needs the mass and cog_mm of every link \
         (give them in robot.toml, or leave compliance out)"
    )]
    NoMasses {
        /// Name of the robot.
        robot: String,
        /// First joint without a mass (1-based).
        joint: usize,
    },
    /// A term acts at a site that the arm or the cell does not have.
    #[error("term '{term}' acts at {site}, which this robot and cell do not have")]
    NoSuchSite {
        /// Name of the term.
        term: String,
        /// The site in words.
        site: String,
    },
    /// A term's basis needs something that the recording does not tell.
    #[error("term '{term}' needs {needs}, which the recording does not contain")]
    MissingCovariate {
        /// Name of the term.
        term: String,
        /// The missing column in words.
        needs: String,
    },
    /// A measurement names a ball, target or anchor that the cell does not have.
    #[error("{what} {number} was measured, but the cell has {have}")]
    NoSuchPoint {
        /// "ball", "target", "anchor" or "frame".
        what: &'static str,
        /// 1-based number.
        number: usize,
        /// How many there are.
        have: usize,
    },
    /// Whoever started the work wants it no more ([`crate::interrupt`]).
    #[error("stopped before the end, as was asked")]
    Stopped,
}

impl ModelError {
    /// What is wrong with a file as a whole.
    pub(crate) fn unreadable(file: &str, problem: impl Into<String>) -> Self {
        Self::Unreadable { file: file.to_owned(), problem: problem.into() }
    }
}

/// Results of this crate.
pub type Result<T> = std::result::Result<T, ModelError>;

/// Parses a TOML text into `T`; an error names the file and the line.
pub fn parse_toml<T: serde::de::DeserializeOwned>(text: &str, file: &str) -> Result<T> {
    toml::from_str(text).map_err(|e| {
        let line = e.span().map_or(1, |s| 1 + text.get(..s.start).map_or(0, |t| t.matches('\n').count()));
        ModelError::Input {
            file: file.to_owned(),
            place: format!("line {line}"),
            problem: shortened(&e.message().replace('\n', " ").replace("expected f64", "expected a number"), 300),
        }
    })
}

/// Parses the TOML text of a file of this kind ("robot" or "cell"); one of another kind, given in its place, is called that.
pub(crate) fn parse_toml_of<T: serde::de::DeserializeOwned>(kind: &str, text: &str, file: &str) -> Result<T> {
    parse_toml(text, file).map_err(|e| {
        let table: toml::Table = text.parse().unwrap_or_default();
        let has = |keys: &[&str]| keys.iter().any(|key| table.contains_key(*key));
        let kinds = [("model", &["term", "robot"][..]), ("robot", &["joint"]), ("cell", &["base", "tool", "balls"])];
        match kinds.iter().find(|(_, keys)| has(keys)) {
            Some((found, _)) if *found != kind => {
                ModelError::unreadable(file, format!("is a {found} file, expected a {kind} file ({kind}.toml)"))
            }
            None if table.is_empty() && file.to_ascii_lowercase().ends_with(".csv") => {
                ModelError::unreadable(file, format!("is a table, expected a {kind} file ({kind}.toml)"))
            }
            _ => e,
        }
    })
}

/// The largest text file that is read whole, bytes: robots, cells, models, plans. A URDF of a few hundred links is 1 MB, and
/// a TOML takes ten times its size in memory.
pub const LARGEST_TEXT: usize = 20_000_000;

/// Reads a whole text file; an error names it.
pub fn read_text(path: &std::path::Path) -> Result<String> {
    let unreadable = |_| ModelError::unreadable(&path.display().to_string(), "is not UTF-8 text");
    String::from_utf8(read_bytes(path)?).map_err(unreadable)
}

/// The bytes of a text file; an error names it.
pub(crate) fn read_bytes(path: &std::path::Path) -> Result<Vec<u8>> {
    use std::io::Read;
    let unreadable = |problem: String| ModelError::unreadable(&path.display().to_string(), problem);
    let mut bytes = Vec::new();
    std::fs::File::open(path)
        .and_then(|f| f.take(LARGEST_TEXT as u64 + 1).read_to_end(&mut bytes))
        .map_err(|e| unreadable(format!("cannot be read: {e}")))?;
    if bytes.len() > LARGEST_TEXT {
        return Err(unreadable(format!("has more than {LARGEST_TEXT} bytes, expected a text of at most that")));
    }
    Ok(bytes)
}

/// The line (1-based) of each offset; offsets must not fall.
pub struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
}

impl<'a> Lines<'a> {
    /// Counts lines of `bytes`.
    #[must_use]
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, line: 1 }
    }

    /// The line of the byte at `offset`.
    pub fn of(&mut self, offset: usize) -> usize {
        if offset < self.at {
            (self.at, self.line) = (0, 1);
        }
        let end = offset.min(self.bytes.len());
        self.line += self.bytes[self.at..end].iter().filter(|b| **b == b'\n').count();
        self.at = end;
        self.line
    }
}

/// What was found in a file, as long as a message bears it: the first `most` characters, and that there are more.
#[must_use]
pub fn shortened(found: &str, most: usize) -> String {
    match found.char_indices().nth(most) {
        Some((end, _)) => format!("{}...", &found[..end]),
        None => found.to_owned(),
    }
}
