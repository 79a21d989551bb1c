//! What RAPID's readers share: where they are in the text, and what they have found.

use std::collections::{HashMap, HashSet};

use crate::elsewhere::{Elsewhere, Outside};
use crate::expression::Constants;
use crate::names::{Names, Way};
use crate::scan::{Scan, hashed};
use crate::text::{Cursor, Span, is_one_of, lower};

/// A module, as far as it is read.
pub(super) struct Reader<'a> {
    pub(super) c: Cursor<'a>,
    pub(super) scan: Scan,
    pub(super) names: Names,
    pub(super) constants: Constants,
    /// Name of the data that is being read.
    pub(super) name: Span,
    /// Routines of this file, and which targets they get.
    pub(super) routines: HashMap<u64, Vec<Parameter>>,
    /// Of the routine that is being read.
    pub(super) parameters: Vec<Parameter>,
    pub(super) elsewhere: &'a dyn Elsewhere,
    /// Routines of other modules that were asked for.
    pub(super) outside: HashMap<u64, Option<Outside>>,
    /// The routine that is being read.
    pub(super) within: u64,
    /// What each routine does, where others want to know it.
    pub(super) effects: Option<HashMap<u64, Effects>>,
}

/// A list as far as targets care.
#[derive(Clone, Copy, Default)]
pub(super) struct Piece {
    /// How many numbers it is, at most six; none where it is anything else, of which targets were taken.
    pub(super) count: usize,
    pub(super) spans: [Span; 6],
    /// One of them that has no value.
    pub(super) unread: Option<Span>,
}

/// Where a motion goes.
pub(super) enum Place {
    Name {
        name: u64,
        way: Way,
        at: usize,
    },
    Spots(u32, u32),
    /// To where the arm is, or beside it; or to what is listed already.
    Here,
    /// To what only the running program knows; it stands here.
    Computed(usize),
}

impl<'a> Reader<'a> {
    /// At the beginning of a module.
    pub(super) fn of(bytes: &'a [u8], elsewhere: &'a dyn Elsewhere) -> Self {
        Self {
            c: Cursor::new(bytes, b'!'),
            scan: Scan::default(),
            names: Names::default(),
            constants: Constants::with_degrees(),
            name: Span::default(),
            routines: routines(bytes),
            parameters: Vec::new(),
            elsewhere,
            outside: HashMap::new(),
            within: 0,
            effects: None,
        }
    }
}

/// What a routine does to those that call it.
#[derive(Clone, Debug, Default)]
pub struct Effects {
    /// Whether it moves the arm.
    pub moves: bool,
    /// Whether it displaces the motions that follow.
    pub displaces: bool,
    /// Data that it sets, by their hashed names.
    pub sets: Vec<u64>,
    /// What it calls, in lower case.
    pub calls: Vec<String>,
    /// Of a module: data that it declares.
    pub(super) own: HashSet<u64>,
}

/// Data that a routine sets and routines that it calls, at most.
const MOST: usize = 1000;

impl Effects {
    /// Sets these data.
    pub(super) fn set(&mut self, name: u64) {
        if self.sets.len() < MOST && !self.sets.contains(&name) {
            self.sets.push(name);
        }
    }

    /// Calls this routine.
    pub(super) fn call(&mut self, word: &[u8]) {
        let name = lower(word);
        if self.calls.len() < MOST && !self.calls.contains(&name) {
            self.calls.push(name);
        }
    }
}

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

/// Bytes before a routine's bracket or a statement that are looked at.
pub(super) const FARTHEST: usize = 300;

/// The routines of a module by their hashed names, and which targets they get.
#[must_use]
fn routines(bytes: &[u8]) -> HashMap<u64, Vec<Parameter>> {
    let mut found = HashMap::new();
    let mut at = 0;
    while let Some(k) = bytes[at..].iter().position(|b| *b == b'(') {
        at += k + 1;
        // the head of a routine is short, however long the line is
        let near = at.saturating_sub(FARTHEST);
        let line = bytes[near..at].iter().rposition(|b| *b == b'\n').map_or(near, |k| near + k + 1);
        let mut words = bytes[line..at - 1].split(|b| b.is_ascii_whitespace()).filter(|w| !w.is_empty());
        let is_routine = words.any(|w| is_one_of(w, &[b"proc", b"func"]));
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

/// The parameters of a routine that are targets, from behind its bracket on.
fn parameters(bytes: &[u8], at: usize, routine: u64) -> Vec<Parameter> {
    let mut c = Cursor::new(bytes, b'!');
    c.at = at;
    let mut found = Vec::new();
    let mut places = 0..;
    loop {
        let place = if c.eat(b'\\') { None } else { places.next() };
        c.skip_space();
        let mut kind = c.word();
        let by_reference = is_one_of(kind, &[b"inout", b"var", b"pers", b"ref"]);
        if by_reference {
            c.skip_space();
            kind = c.word();
        }
        c.skip_space();
        let name = hashed(c.word());
        c.skip_space();
        if c.peek() == b'{' {
            // of an array: `{*,*}`
            c.at += c.until(b"}\n").len();
        }
        if is_one_of(kind, &[b"robtarget", b"jointtarget"]) {
            let scoped = hashed(&[routine.to_le_bytes(), name.to_le_bytes()].concat());
            found.push(Parameter { name, scoped, place, by_reference });
        }
        c.skip_to(b",|\\)\n");
        // what may be given instead of the one before counts as it does
        if !matches!(c.peek(), b',' | b'|' | b'\\' | b'\n') {
            return found;
        }
        c.at += usize::from(c.peek() != b'\\');
    }
}
