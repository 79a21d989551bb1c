//! Rows of a recording for those who know nothing of MCAP.

use std::path::Path;

use trical_model::recording::Row;

use super::{RecordError, each_row};

/// As [`each_row`]; `take` says false where it wants no more, and what is returned then means nothing.
///
/// # Errors
/// As [`each_row`].
pub fn hand_over(path: &Path, take: &mut dyn FnMut(&Row) -> bool) -> Result<usize, RecordError> {
    let no_more = || RecordError::Unreadable { path: path.to_owned(), problem: "is not read to its end".to_owned() };
    each_row(path, &mut |row| if take(&row) { Ok(()) } else { Err(no_more()) })
}
