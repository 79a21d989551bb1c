//! RAPID's routines that get targets: `PROC Pick(robtarget p,\robtarget via)`, and which arguments their calls give.

use std::collections::HashMap;

use crate::scan::hashed;
use crate::text::Cursor;

/// An argument that is a target.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parameter {
    /// Its hashed name.
    pub name: u64,
    /// What it is called outside its routine: the same name in another routine is another one.
    pub scoped: u64,
    /// Which argument it is, not counting those that are named where they are given (`\via:=`); `None` is one of these.
    pub place: Option<usize>,
    /// Whether the routine may change what it gets.
    pub by_reference: bool,
}

/// Bytes before the bracket of a routine's head that are looked at.
const FARTHEST: usize = 300;

/// The routines of a module by their hashed names, and which targets they get.
#[must_use]
pub(super) fn routines(bytes: &[u8]) -> HashMap<u64, Vec<Parameter>> {
    let mut found = HashMap::new();
    let mut at = 0;
    while let Some(k) = bytes[at..].iter().position(|b| *b == b'(') {
        at += k + 1;
        // the head of a routine is short, however long the line is
        let near = at.saturating_sub(FARTHEST);
        let line = bytes[near..at].iter().rposition(|b| *b == b'\n').map_or(near, |k| near + k + 1);
        let mut words = bytes[line..at - 1].split(|b| b.is_ascii_whitespace()).filter(|w| !w.is_empty());
        let is_routine = words.any(|w| [&b"proc"[..], b"func"].iter().any(|kind| w.eq_ignore_ascii_case(kind)));
        if let (true, Some(name)) = (is_routine, words.next_back()) {
            let routine = hashed(name);
            found.insert(routine, parameters(bytes, at, routine));
        }
    }
    found
}

/// What a name is called among all names: arguments of a routine are its own.
#[must_use]
pub(super) fn key(parameters: &[Parameter], name: &[u8]) -> u64 {
    let name = hashed(name);
    parameters.iter().find(|p| p.name == name).map_or(name, |p| p.scoped)
}

/// Those that are targets, from behind the bracket on.
fn parameters(bytes: &[u8], at: usize, routine: u64) -> Vec<Parameter> {
    let mut c = Cursor::new(bytes, b'!');
    c.at = at;
    let mut found = Vec::new();
    let mut places = 0..;
    loop {
        let place = if c.eat(b'\\') { None } else { places.next() };
        c.skip_space();
        let mut kind = c.word();
        let is = |kind: &[u8], names: &[&[u8]]| names.iter().any(|n| kind.eq_ignore_ascii_case(n));
        let by_reference = is(kind, &[b"inout", b"var", b"pers", b"ref"]);
        if by_reference {
            c.skip_space();
            kind = c.word();
        }
        c.skip_space();
        let name = hashed(c.word());
        if is(kind, &[b"robtarget", b"jointtarget"]) {
            let scoped = hashed(&[routine.to_le_bytes(), name.to_le_bytes()].concat());
            found.push(Parameter { name, scoped, place, by_reference });
        }
        while !c.done() && !matches!(c.peek(), b',' | b'|' | b'\\' | b')' | b'\n') {
            c.at += 1;
        }
        // what may be given instead of the one before counts as it does
        if !matches!(c.peek(), b',' | b'|' | b'\\' | b'\n') {
            return found;
        }
        c.at += usize::from(c.peek() != b'\\');
    }
}
