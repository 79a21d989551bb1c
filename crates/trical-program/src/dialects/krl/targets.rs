//! Which names of a KRL program are targets, and which are frames.

use std::collections::{BTreeSet, HashSet};

use super::{CURRENT, ELEMENTS, MOTIONS, is_system};
use crate::scan::hashed;
use crate::text::{Cursor, is_one_of};

/// What names of a program stand for.
#[derive(Default)]
pub(super) struct Named {
    /// Motions go there; a FRAME that none goes to is no target.
    pub moved_to: HashSet<u64>,
    /// Tools and bases are set from these, or they stand before the place in `LIN PALLET:XP1`.
    pub frames: HashSet<u64>,
    /// No targets, unless a motion is found that goes there.
    pub no_targets: HashSet<u64>,
}

/// What the names of a program stand for.
pub(super) fn targets(bytes: &[u8]) -> Named {
    let Named { mut moved_to, mut frames, mut no_targets } = Named::default();
    let (mut declared, mut products) = (HashSet::new(), BTreeSet::new());
    let mut c = Cursor::new(bytes, b';');
    while let Some((_, word)) = c.next_word() {
        if is_system(word) {
            let start = c;
            c.skip_blank();
            if c.peek() == b'[' {
                c.at += c.until(b"]\n\r").len();
                c.at += usize::from(c.peek() == b']');
            }
            if c.eat_in_line(b'=') {
                let named = operands(&mut c).into_iter().filter(|name| !name.is_empty() && !is_system(name));
                let is_setup = is_one_of(word, &CURRENT) || is_one_of(word, &ELEMENTS);
                let kind = if is_setup { &mut frames } else { &mut no_targets };
                kind.extend(named.map(hashed));
            } else {
                c = start;
            }
            continue;
        }
        if word.eq_ignore_ascii_case(b"FRAME") {
            declared.extend(declarations(&mut c));
        }
        let mut more = is_one_of(word, &MOTIONS);
        while more {
            c.skip_blank();
            let start = c.at;
            match operands(&mut c).as_slice() {
                [place] => drop(moved_to.insert(hashed(place))),
                places => drop(products.insert(places.iter().map(|place| hashed(place)).collect::<Vec<_>>())),
            }
            more = c.at > start && c.eat_in_line(b',');
        }
    }
    // the place is the first that is no frame, or the last
    let literal = hashed(b"");
    let is_frame = |name: &u64| *name == literal || declared.contains(name) && !moved_to.contains(name);
    let mut places = Vec::new();
    for mut all in products {
        let last = all.pop();
        let before = all.iter().take_while(|name| is_frame(name)).count();
        frames.extend(all.iter().take(before).filter(|name| **name != literal));
        match all.get(before) {
            Some(place) => places.push(*place),
            None => {
                places.extend(last);
                no_targets.extend(last);
            }
        }
    }
    moved_to.extend(places);
    no_targets.extend(&frames);
    Named { moved_to, frames, no_targets }
}

/// What stands at the cursor with the geometric operator between: names; empty where a `{...}` stands.
fn operands<'a>(c: &mut Cursor<'a>) -> Vec<&'a [u8]> {
    let mut found = Vec::new();
    loop {
        if c.peek() == b'{' {
            c.skip_past(b'}', b";\n\r");
            found.push(&b""[..]);
        } else {
            found.push(c.word());
        }
        c.skip_blank();
        if c.peek() == b'[' {
            c.skip_past(b']', b"\n\r");
        }
        if !c.eat_in_line(b':') {
            return found;
        }
    }
}

/// `A,B[4]`, behind `DECL FRAME`.
fn declarations(c: &mut Cursor<'_>) -> Vec<u64> {
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
