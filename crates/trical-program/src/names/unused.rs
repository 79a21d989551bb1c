//! Targets whose numbers nothing uses: left over, or placeholders that are set before the arm goes there.

use std::collections::HashSet;

use super::{Group, Names};
use crate::scan::{Scan, Visit, hashed};
use crate::text::{Cursor, is_one_of};

impl Names {
    /// Targets whose numbers nothing in the files uses, or only before they are set anew; none where nothing in the files goes to
    /// any target.
    pub(super) fn not_in_use(&self, scan: &Scan, bytes: &[u8]) -> Vec<u32> {
        let goes = scan.visits.iter().any(|v| matches!(v, Visit::To(_) | Visit::Near { .. }));
        if self.only_data || !goes && !self.in_use.contains(&true) {
            return Vec::new();
        }
        let is_idle = |spot: &u32| self.in_use.get(*spot as usize) != Some(&true);
        let text = |spot: &u32| scan.spots.get(*spot as usize).map_or(&[][..], |s| s.name.text(bytes));
        let named = |g: &Group| -> Vec<(u64, u32)> {
            let idle = (g.first..g.first + g.count).filter(is_idle).filter(|spot| !text(spot).is_empty());
            idle.map(|spot| (g.definition.name, spot)).collect()
        };
        let mut idle: Vec<(u64, u32)> = self.groups.iter().flat_map(named).collect();
        let in_text: HashSet<u64> = idle.iter().map(|(_, spot)| hashed(text(spot))).collect();
        let read = match self.comment {
            Some(comment) if !idle.is_empty() => names_read(bytes, comment, &in_text),
            _ => HashSet::new(),
        };
        let is_read = |name: &u64, spot: &u32| self.read.contains(name) || read.contains(&hashed(text(spot)));
        idle.retain(|(name, spot)| self.gone_to.contains(name) || !is_read(name, spot));
        idle.into_iter().map(|(_, spot)| spot).collect()
    }
}

/// Kinds of targets, before a name that is declared.
const KINDS: [&[u8]; 7] = [b"robtarget", b"jointtarget", b"e6pos", b"pos", b"frame", b"e6axis", b"axis"];

/// Which of these names (hashed without regard to case) stand in a text otherwise than where they are declared, or something is assigned to
/// them.
fn names_read(bytes: &[u8], comment: u8, names: &HashSet<u64>) -> HashSet<u64> {
    let mut c = Cursor::new(bytes, comment);
    let mut read = HashSet::new();
    let mut before: &[u8] = b"";
    while let Some((_, word)) = c.next_word() {
        let name = hashed(word);
        let is_declared = is_one_of(std::mem::replace(&mut before, word), &KINDS);
        if is_declared || !names.contains(&name) {
            continue;
        }
        let mut behind = c;
        behind.skip_space();
        let close = match behind.peek() {
            b'{' => b'}',
            b'[' => b']',
            _ => 0,
        };
        if close != 0 {
            behind.skip_past(close, b"\n");
            behind.skip_space();
        }
        behind.at += usize::from(behind.peek() == b':');
        if !behind.assigns() {
            read.insert(name);
        }
    }
    read
}
