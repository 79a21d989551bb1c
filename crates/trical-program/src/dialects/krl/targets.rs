//! Which names of a KRL program are targets, and which are frames.

use std::collections::{BTreeSet, HashMap, HashSet};

use super::{CURRENT, ELEMENTS, LOOP_ENDS, LOOPS, MOTIONS, TYPES, is_system};
use crate::scan::{hashed, reached};
use crate::scopes::Scopes;
use crate::text::{Cursor, begins_line, is_one_of};

/// What names of a program stand for.
#[derive(Default)]
pub(super) struct Named {
    /// Motions go there; a FRAME that none goes to is no target.
    pub moved_to: HashSet<u64>,
    /// Tools and bases are set from these, or they stand before the place in `LIN PALLET:XP1`.
    pub frames: HashSet<u64>,
    /// Motion data of which the program changes tool or base.
    pub changed_data: HashSet<u64>,
    /// No targets, unless a motion is found that goes there.
    pub no_targets: HashSet<u64>,
}

/// What the names of a program stand for.
pub(super) fn targets(bytes: &[u8], scopes: &Scopes) -> Named {
    let Named { mut moved_to, mut frames, mut no_targets, .. } = Named::default();
    let (mut declared, mut products) = (HashSet::new(), BTreeSet::new());
    let mut given: HashMap<u64, Vec<u64>> = HashMap::new();
    let mut c = Cursor::new(bytes, b';');
    while let Some((_, word)) = c.next_word() {
        if is_system(word) {
            let start = c;
            skip_index(&mut c);
            if c.eat_in_line(b'=') {
                let named = operands(&mut c).into_iter().filter(|name| !name.is_empty() && !is_system(name));
                let is_setup = is_one_of(word, &CURRENT) || is_one_of(word, &ELEMENTS);
                let kind = if is_setup { &mut frames } else { &mut no_targets };
                kind.extend(named.map(|name| scopes.key(hashed(name), c.at)));
            } else {
                c = start;
            }
            continue;
        }
        if word.eq_ignore_ascii_case(b"FRAME") {
            declared.extend(declarations(&mut c).into_iter().map(|name| scopes.key(name, c.at)));
        }
        let parameters = scopes.parameters(hashed(word));
        if !parameters.is_empty() {
            let mut behind = c;
            let mut more = behind.eat_in_line(b'(');
            let mut parameters = parameters.iter();
            while let Some(parameter) = parameters.next().filter(|_| more) {
                behind.skip_blank();
                let name = behind.word();
                given.entry(parameter.key).or_default().push(scopes.key(hashed(name), behind.at));
                more = next_argument(&mut behind);
            }
        }
        let mut source = c;
        skip_index(&mut source);
        if source.eat_in_line(b'=') && source.peek() != b'=' {
            let to = scopes.key(hashed(word), c.at);
            if let [from] = operands(&mut source).as_slice()
                && !from.is_empty()
                && !is_system(from)
            {
                given.entry(to).or_default().push(scopes.key(hashed(from), source.at));
            }
        }
        let mut more = is_one_of(word, &MOTIONS);
        while more {
            c.skip_blank();
            let start = c.at;
            match operands(&mut c).as_slice() {
                [place] => drop(moved_to.insert(scopes.key(hashed(place), start))),
                places => drop(
                    products.insert(places.iter().map(|place| scopes.key(hashed(place), start)).collect::<Vec<_>>()),
                ),
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
        places.push(all.get(before).copied().or(last).unwrap_or(literal));
        // the others say how far from the place
        no_targets.extend(all.iter().skip(before + 1).chain(&last));
    }
    moved_to.extend(places);
    // what is given to a target is one itself
    let moved_to = reached(moved_to, |parameter| given.get(&parameter).into_iter().flatten().copied());
    // and what is given to a tool or base
    let frames = reached(frames, |parameter| given.get(&parameter).into_iter().flatten().copied());
    no_targets.extend(&frames);
    no_targets.extend(read_in_part(bytes, scopes));
    Named { moved_to, frames, no_targets, changed_data: changed_data(bytes) }
}

/// Motion data of which the program changes tool or base (`FP1.TOOL_NO=2`) and may have used them as changed above: in a loop, or in another
/// routine than the file's first.
fn changed_data(bytes: &[u8]) -> HashSet<u64> {
    let mut found = HashSet::new();
    let (mut loops, mut routines) = (0_usize, 0);
    let mut c = Cursor::new(bytes, b';');
    while let Some((from, word)) = c.next_word() {
        if begins_line(bytes, from) {
            loops += usize::from(is_one_of(word, &LOOPS));
            loops = loops.saturating_sub(usize::from(is_one_of(word, &LOOP_ENDS)));
            routines += usize::from(is_one_of(word, &[b"DEF", b"DEFFCT"]));
        }
        if c.peek() == b'.' && (loops > 0 || routines > 1) && !word.eq_ignore_ascii_case(b"FDAT_ACT") {
            c.at += 1;
            let is_setup = is_one_of(c.word(), &[b"TOOL_NO", b"BASE_NO", b"IPO_FRAME"]);
            c.skip_blank();
            found.extend((is_setup && c.assigns()).then(|| hashed(word)));
        }
    }
    found
}

/// Names of which the program reads coordinates (`UP.Z`), and nowhere all: limits, distances. Not those to which other programs may
/// go (`GLOBAL`).
fn read_in_part(bytes: &[u8], scopes: &Scopes) -> HashSet<u64> {
    let mut found = HashSet::new();
    let mut c = Cursor::new(bytes, b';');
    while let Some((from, word)) = c.next_word() {
        skip_index(&mut c);
        if c.peek() == b'.' {
            c.at += 1;
            c.word();
            c.skip_blank();
            found.extend((!c.assigns()).then(|| scopes.key(hashed(word), from)));
        }
    }
    if found.is_empty() {
        return found;
    }
    c.at = 0;
    let mut is_global = false;
    while let Some((from, word)) = c.next_word() {
        if is_one_of(word, &TYPES) {
            for name in declarations(&mut c).into_iter().filter(|_| is_global) {
                found.remove(&scopes.key(name, from));
            }
        }
        is_global = word.eq_ignore_ascii_case(b"GLOBAL");
        let mut behind = c;
        skip_index(&mut behind);
        if behind.peek() != b'.' && !behind.assigns() {
            found.remove(&scopes.key(hashed(word), from));
        }
    }
    found
}

/// Past blanks, and past `[...]`.
pub(super) fn skip_index(c: &mut Cursor<'_>) {
    c.skip_blank();
    if c.peek() == b'[' {
        c.skip_past(b']', b"\n\r");
        c.skip_blank();
    }
}

/// From within an argument to the next one of the same call and line.
fn next_argument(c: &mut Cursor<'_>) -> bool {
    let mut depth = 0_usize;
    for b in c.until(b";\n\r") {
        match b {
            b'(' | b'[' | b'{' => depth += 1,
            b')' if depth == 0 => return false,
            b')' | b']' | b'}' => depth = depth.saturating_sub(1),
            b',' if depth == 0 => {
                c.at += 1;
                return true;
            }
            _ => {}
        }
        c.at += 1;
    }
    false
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
        skip_index(c);
        if !c.eat_in_line(b':') {
            return found;
        }
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
