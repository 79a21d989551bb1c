//! Which names of a KRL program are targets, and which are frames.

use std::collections::{BTreeMap, HashMap, HashSet};

use super::arguments::{Routines, may_move};
use super::named::{Named, declarations, skip_index};
use super::{CURRENT, ELEMENTS, LOOP_ENDS, LOOPS, MOTIONS, RELATIVE, TYPES, is_system};
use crate::elsewhere::Elsewhere;
use crate::other_use::OtherUse;
use crate::scan::{hashed, reached};
use crate::scopes::Scopes;
use crate::text::{Cursor, begins_line, is_one_of, lower};

/// What the names of a program stand for.
pub(super) fn targets(bytes: &[u8], routines: &Routines, elsewhere: &dyn Elsewhere) -> Named {
    let scopes = &routines.scopes;
    let Named { mut moved_to, mut given_away, mut frames, mut no_targets, mut other_uses, .. } = Named::default();
    let (mut places, mut has_numbers) = (HashSet::new(), HashSet::new());
    let (mut declared, mut products) = (HashSet::new(), BTreeMap::new());
    let mut given: HashMap<u64, Vec<u64>> = HashMap::new();
    let mut c = Cursor::new(bytes, b';');
    while let Some((from, word)) = c.next_word() {
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
        if is_one_of(word, &TYPES) {
            let names = declarations(&mut c.clone()).into_iter().map(|name| scopes.key(name, c.at));
            let kind = if word.eq_ignore_ascii_case(b"FRAME") { &mut declared } else { &mut places };
            kind.extend(names);
        }
        let mut behind = c;
        skip_index(&mut behind);
        match behind.peek() {
            b'(' => {
                let arguments = arguments(behind, scopes);
                let may_be_place =
                    |name| places.contains(name) || declared.contains(name) || has_numbers.contains(name);
                if routines.has(hashed(word)) {
                    for (parameter, name) in scopes.parameters(hashed(word)).iter().zip(arguments) {
                        given.entry(parameter.key).or_default().push(name);
                    }
                } else if arguments.iter().any(may_be_place) {
                    match elsewhere.routine(&lower(word)) {
                        Some(routine) => {
                            let taken = routine.takes.iter().zip(arguments).filter(|(taken, _)| !taken.goes.is_empty());
                            moved_to.extend(taken.map(|(_, name)| name));
                        }
                        None if may_move(bytes, from, word) => {
                            given_away.extend(arguments.into_iter().filter(|name| places.contains(name)));
                        }
                        None => {}
                    }
                }
            }
            b'=' if behind.assigns() => {
                behind.eat_in_line(b'=');
                let to = scopes.key(hashed(word), c.at);
                match operands(&mut behind)[..] {
                    [b""] => drop(has_numbers.insert(to)),
                    [name] if !is_system(name) => {
                        given.entry(to).or_default().push(scopes.key(hashed(name), behind.at))
                    }
                    _ => {}
                }
            }
            b'.' => {
                behind.at += 1;
                let is_angle = is_one_of(behind.word(), &[b"A", b"B", b"C"]);
                other_uses.extend(is_angle.then(|| (scopes.key(hashed(word), from), OtherUse::OneAngle(from as u32))));
            }
            _ => {}
        }
        let is_increment = is_one_of(word, &RELATIVE);
        let mut more = is_increment || is_one_of(word, &MOTIONS);
        while more {
            c.skip_blank();
            let start = c.at;
            let places: Vec<u64> = operands(&mut c).iter().map(|place| scopes.key(hashed(place), start)).collect();
            match places[..] {
                _ if is_increment => {
                    other_uses.extend(places.iter().map(|name| (*name, OtherUse::NoPlace(from as u32))))
                }
                [place] => drop(moved_to.insert(place)),
                _ => drop(products.entry(places).or_insert(from)),
            }
            more = c.at > start && c.eat_in_line(b',');
        }
    }
    // the place is the first that is no frame, or the last
    let literal = hashed(b"");
    let is_frame = |name: &u64| *name == literal || declared.contains(name) && !moved_to.contains(name);
    let mut gone_to = Vec::new();
    for (all, at) in products {
        let before = all.iter().take(all.len().saturating_sub(1)).take_while(|name| is_frame(name)).count();
        let (before, behind) = all.split_at(before);
        frames.extend(before.iter().filter(|name| **name != literal));
        // the others say how far from the place
        if let [place, shifts @ ..] = behind {
            gone_to.push(*place);
            other_uses.extend(shifts.iter().map(|name| (*name, OtherUse::NoPlace(at as u32))));
            no_targets.extend(shifts);
        }
    }
    moved_to.extend(gone_to);
    // what is given to a target is one itself
    let sources = |name: u64| given.get(&name).into_iter().flatten().copied();
    let mut moved_to = reached(moved_to, sources);
    // of what no motion here goes to, what has numbers, or perhaps gets them from another file
    let comes_from_elsewhere = |name: &u64| routines.is_parameter(*name) && sources(*name).all(|from| from == *name);
    given_away.retain(|name| {
        let all = reached([*name], sources);
        all.is_disjoint(&moved_to) && all.iter().any(|name| has_numbers.contains(name) || comes_from_elsewhere(name))
    });
    let given_away = reached(given_away, sources);
    moved_to.extend(&given_away);
    // and what is given to a tool or base
    let frames = reached(frames, sources);
    no_targets.extend(&frames);
    no_targets.extend(read_in_part(bytes, scopes));
    Named { moved_to, frames, no_targets, changed_data: changed_data(bytes), other_uses, given_away }
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

/// The names that stand as arguments in a call whose bracket follows; empty names where others stand.
fn arguments(mut c: Cursor<'_>, scopes: &Scopes) -> Vec<u64> {
    let mut found = Vec::new();
    let mut more = c.eat_in_line(b'(');
    while more {
        c.skip_blank();
        let name = c.word();
        found.push(scopes.key(hashed(name), c.at));
        more = next_argument(&mut c);
    }
    found
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
