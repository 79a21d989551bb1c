//! RAPID's single angles of targets: `EulerZYX(\Y,p.rot)`.

use std::collections::VecDeque;

use super::reader::Reader;
use crate::other_use::OtherUse;
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

impl Reader<'_> {
    /// Notes the single angles that stand before the cursor.
    pub(super) fn note_angles(&mut self) {
        while let Some((at, name)) = self.single_angles.pop_front_if(|(at, _)| *at < self.c.at) {
            self.names.also_used(self.key(name), OtherUse::OneAngle(at as u32));
        }
    }
}
