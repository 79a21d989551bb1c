//! Which names of a KRL program are targets, and which are frames.

use std::collections::HashSet;

use super::{MOTIONS, is_system};
use crate::scan::hashed;
use crate::text::{Cursor, is_one_of};

/// Names that motions go to (a FRAME that none goes to is no target), and names of frames: what the controller's own variables are
/// set from, and what stands before the place in `LIN PALLET:XP1`.
pub(super) fn targets(bytes: &[u8]) -> (HashSet<u64>, HashSet<u64>) {
    let (mut found, mut frames) = (HashSet::new(), HashSet::new());
    let (mut declared, mut products) = (HashSet::new(), HashSet::new());
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
                frames.extend(named.map(hashed));
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
                [place] => drop(found.insert(hashed(place))),
                places => drop(products.insert(places.iter().map(|place| hashed(place)).collect::<Vec<_>>())),
            }
            more = c.at > start && c.eat_in_line(b',');
        }
    }
    // the place is the first that is no frame, or the last
    for mut places in products {
        let last = places.pop();
        let place = places.iter().find(|name| **name != hashed(b"") && !declared.contains(name)).copied();
        frames.extend(places.into_iter().take_while(|name| Some(*name) != place).filter(|name| *name != hashed(b"")));
        found.extend(place.or(last));
    }
    (found, frames)
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
