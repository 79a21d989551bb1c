//! RAPID's parts of targets that have names of their own: `CONST confdata conf:=[0,0,0,0];` for `[[x,y,z],[q1,q2,q3,q4],conf,extj]`.

use std::collections::HashMap;

use crate::scan::hashed;
use crate::text::{Cursor, Span, is_one_of};

/// A list as far as targets care.
#[derive(Clone, Copy, Default)]
pub(super) struct Piece {
    /// How many numbers it is, at most six; none where it is anything else, of which targets were taken.
    pub(super) count: usize,
    pub(super) spans: [Span; 6],
    /// What has no value in it and is no part of a target in it.
    pub(super) unread: Option<Span>,
    /// The name that stands in its place, where it is data of the module.
    pub(super) name: Option<Span>,
}

impl Piece {
    /// Its numbers.
    pub(super) fn numbers(&self) -> &[Span] {
        self.spans.get(..self.count).unwrap_or(&[])
    }
}

/// Bytes before an item that are looked at.
const FARTHEST: usize = 300;
/// Kinds of data that are parts of targets.
const KINDS: [&[u8]; 5] = [b"pos", b"orient", b"confdata", b"extjoint", b"robjoint"];

/// The data that a module declares as numbers, by their hashed names, and that nothing in it changes.
pub(super) fn parts(bytes: &[u8]) -> HashMap<u64, Piece> {
    let mut found: HashMap<u64, Option<Piece>> = HashMap::new();
    let mut c = Cursor::new(bytes, b'!');
    while let Some((_, kind)) = c.next_word() {
        if !is_one_of(kind, &KINDS) {
            continue;
        }
        let mut behind = c;
        let name = hashed(behind.name_ahead());
        let new = declared(&mut behind);
        // of several routines each may have its own: they have to be the same
        let same = |old: &Option<Piece>| match (old, &new) {
            (Some(old), Some(new)) => {
                let texts = |piece: &Piece| piece.numbers().iter().map(|n| n.text(bytes)).collect::<Vec<_>>();
                texts(old) == texts(new)
            }
            _ => false,
        };
        let is_same = found.get(&name).is_none_or(same);
        found.insert(name, new.filter(|_| is_same));
    }
    if found.values().all(Option::is_none) {
        return HashMap::new();
    }
    let mut c = Cursor::new(bytes, b'!');
    let mut before: &[u8] = b"";
    while let Some((at, word)) = c.next_word() {
        if !is_one_of(before, &KINDS)
            && let Some(part) = found.get_mut(&hashed(word))
            && !in_brackets(bytes, at)
        {
            *part = None;
        }
        before = word;
    }
    found.into_iter().filter_map(|(name, part)| Some((name, part?))).collect()
}

/// `:=[1,2,3];`
fn declared(c: &mut Cursor<'_>) -> Option<Piece> {
    if !(c.eat(b':') && c.eat(b'=') && c.eat(b'[')) {
        return None;
    }
    let mut piece = Piece::default();
    loop {
        c.skip_space();
        *piece.spans.get_mut(piece.count)? = c.number()?;
        piece.count += 1;
        if !c.eat(b',') {
            return (c.eat(b']') && c.eat(b';')).then_some(piece);
        }
    }
}

/// Whether what stands at `at` is an item of a list: else it may be set there, or given to a routine that changes it.
fn in_brackets(bytes: &[u8], at: usize) -> bool {
    let mut depth = 0;
    for b in bytes.get(..at).unwrap_or(&[]).iter().rev().take(FARTHEST) {
        match b {
            b';' => return false,
            b']' => depth += 1,
            b'[' if depth == 0 => return true,
            b'[' => depth -= 1,
            _ => {}
        }
    }
    false
}
