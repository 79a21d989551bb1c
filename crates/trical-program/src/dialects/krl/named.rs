//! What names of a KRL program stand for, and how its text names them.

use std::collections::HashSet;

use crate::other_use::OtherUse;
use crate::scan::hashed;
use crate::text::Cursor;

/// What names of a program stand for.
#[derive(Default)]
pub(super) struct Named {
    /// Motions go there; a FRAME that none goes to is no target.
    pub moved_to: HashSet<u64>,
    /// Of these, those to which only routines may go that are in none of the files read.
    pub given_away: HashSet<u64>,
    /// Tools and bases are set from these, or they stand before the place in `LIN PALLET:XP1`.
    pub frames: HashSet<u64>,
    /// Motion data of which the program changes tool or base.
    pub changed_data: HashSet<u64>,
    /// No targets, unless a motion is found that goes there.
    pub no_targets: HashSet<u64>,
    /// What the program does with data whether motions go there or not.
    pub other_uses: Vec<(u64, OtherUse)>,
}

/// Past blanks, and past `[...]`.
pub(super) fn skip_index(c: &mut Cursor<'_>) {
    c.skip_blank();
    if c.peek() == b'[' {
        c.skip_past(b']', b"\n\r");
        c.skip_blank();
    }
}

/// `A,B[4]`, behind `DECL FRAME`.
pub(super) fn declarations(c: &mut Cursor<'_>) -> Vec<u64> {
    let mut found = Vec::new();
    loop {
        c.skip_blank();
        let name = c.word();
        if c.peek() == b'[' {
            c.skip_past(b']', b"\n\r");
        }
        if name.is_empty() {
            return found;
        }
        found.push(hashed(name));
        if !c.eat_in_line(b',') {
            return found;
        }
    }
}
