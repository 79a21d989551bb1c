//! RAPID's single angles of targets: `EulerZYX(\Y,p.rot)`.

use std::collections::VecDeque;

use crate::text::Cursor;

/// Where a text asks for one angle of data, and the name of these.
pub(super) fn single_angles(bytes: &[u8]) -> VecDeque<(usize, &[u8])> {
    let mut found = VecDeque::new();
    let mut c = Cursor::new(bytes, b'!');
    while let Some((at, word)) = c.next_word() {
        if word.eq_ignore_ascii_case(b"eulerzyx") && c.eat(b'(') {
            c.skip_past(b',', b";)");
            found.push_back((at, c.name_ahead()));
        }
    }
    found
}
