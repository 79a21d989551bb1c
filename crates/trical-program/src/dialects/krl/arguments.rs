//! What routines do to their arguments in KRL: without `:IN` a routine may change what it is given, if its text does so.

use std::collections::{HashMap, HashSet};

use super::named::{Named, declarations, skip_index};
use super::{ARM_BASE, BUILT_IN, CURRENT, ELEMENTS, HERE, Reader, THE_ARM_BASE, TYPES, before_bracket};
use crate::flow::taken_with;
use crate::names::{Names, Origin};
use crate::other_use::OtherUse;
use crate::scan::{Fork, Outside, Scan, Setup, Taken, changed_here, hashed};
use crate::scopes::{Parameter, Scopes};
use crate::text::{Cursor, Span, begins_line, is_among, is_one_of, lower, mentions};

/// Of the language: they change none of what they are given.
const CHANGE_NOTHING: &str = "CWRITE SWRITE COPEN CCLOSE PULSE ERR_RAISE INVERSE FORWARD INV_POS ABS SQRT VARSTATE \
    VARTYPE";

/// What the routines of a file have for themselves: their parameters, and which of these they only read, by their hashed names.
#[derive(Default)]
pub(super) struct Routines {
    pub(super) scopes: Scopes,
    only_read: HashMap<u64, Vec<bool>>,
}

impl Routines {
    /// Whether the file has a routine of this name.
    pub(super) fn has(&self, routine: u64) -> bool {
        self.only_read.contains_key(&routine)
    }

    /// Whether this is what a parameter of a routine is called among all names.
    pub(super) fn is_parameter(&self, key: u64) -> bool {
        self.only_read.keys().any(|routine| self.scopes.parameters(*routine).iter().any(|p| p.key == key))
    }

    /// What each routine does with what other files give to it.
    pub(super) fn taken(&self, named: &Named, names: &Names, scan: &Scan) -> HashMap<u64, Vec<Taken>> {
        let angles = named.other_uses.iter().filter(|(_, other)| matches!(other, OtherUse::OneAngle(_)));
        let angles: HashSet<u64> = angles.map(|(name, _)| *name).collect();
        let taken = |(routine, only_read): (&u64, &Vec<bool>)| {
            let begins = scan.called_with.get(routine);
            let parameters = self.scopes.parameters(*routine).iter().zip(only_read);
            let each = parameters.map(|(parameter, only_read)| {
                let is_target = named.moved_to.contains(&parameter.key);
                let copies = if is_target { names.copies_of(parameter.key) } else { HashSet::new() };
                let setups =
                    names.gone_to_with(&copies).into_iter().filter_map(|k| scan.setups.get(k as usize).cloned());
                Taken {
                    goes: setups.map(|setup| taken_with(setup, begins)).collect(),
                    may_change: !only_read,
                    one_angle: !copies.is_disjoint(&angles),
                }
            });
            (*routine, each.collect())
        };
        self.only_read.iter().map(taken).collect()
    }
}

/// Of KUKA's technology packages, the beginnings of routines that move nothing.
const NO_MOTIONS: &[u8] = b"EKI_";

/// Whether a word at `from`, of which no file has a routine, may be one that goes to what it is given: a statement.
pub(super) fn may_move(bytes: &[u8], from: usize, word: &[u8]) -> bool {
    let moves_nothing = word.get(..NO_MOTIONS.len()).is_some_and(|begin| begin.eq_ignore_ascii_case(NO_MOTIONS));
    begins_line(bytes, from) && !moves_nothing && !is_among(word, BUILT_IN) && !is_among(word, CHANGE_NOTHING)
}

/// Who gets the arguments of a call.
enum Called<'a> {
    /// A routine of this file: its parameters, and which of them it only reads.
    Here(&'a [Parameter], &'a [bool]),
    /// One of another file.
    Elsewhere(Outside),
    /// One of no file, which may move the arm.
    Unread(String),
    /// What is no routine that moves the arm.
    Other,
}

impl Called<'_> {
    /// Whether an argument stays as it is.
    fn only_reads(&self, argument: usize) -> bool {
        match self {
            Self::Here(_, only_read) => only_read.get(argument) == Some(&true),
            Self::Elsewhere(routine) => routine.takes.get(argument).is_some_and(|taken| !taken.may_change),
            Self::Unread(_) | Self::Other => false,
        }
    }
}

/// The routines of a file.
pub(super) fn routines<'a>(bytes: &'a [u8]) -> Routines {
    let Routines { mut scopes, mut only_read } = Routines::default();
    let (mut at, mut open) = (0, None);
    for line in bytes.split_inclusive(|b| *b == b'\n') {
        let mut c = Cursor::new(line, b';');
        c.skip_blank();
        let mut word = c.word();
        let is_global = word.eq_ignore_ascii_case(b"GLOBAL");
        if is_global {
            c.skip_blank();
            word = c.word();
        }
        if is_one_of(word, &[b"DEF", b"DEFFCT"]) {
            let routine = before_bracket(&mut c);
            scopes.open();
            c.eat_in_line(b'(');
            let list = c.until(b")\r\n;").split(|b| *b == b',').map(<[u8]>::trim_ascii);
            let name = |p: &'a [u8]| p.split(|b| matches!(b, b':' | b'[')).next().unwrap_or(p).trim_ascii();
            // each, until it may be changed
            let names: Vec<&[u8]> = list.clone().map(name).collect();
            names.iter().filter(|name| !name.is_empty()).for_each(|name| scopes.parameter(routine, hashed(name), at));
            let is_in =
                |p: &[u8]| p.rsplit(|b| *b == b':').next().is_some_and(|kind| is_one_of(kind.trim_ascii(), &[b"IN"]));
            only_read.insert(routine, vec![true; names.len()]);
            open = Some((routine, names.into_iter().zip(list.map(is_in)).collect::<Vec<_>>()));
        } else if is_one_of(word, &[b"END", b"ENDFCT"]) {
            scopes.close(at);
            open = None;
        } else if let Some((routine, names)) = &open {
            // the routine's own places, unless they are its arguments
            if word.eq_ignore_ascii_case(b"DECL") {
                c.skip_blank();
                word = c.word();
            }
            if !is_global && is_one_of(word, &TYPES) && !word.eq_ignore_ascii_case(b"FRAME") {
                for name in declarations(&mut c) {
                    if !scopes.parameters(*routine).iter().any(|p| p.name == name) {
                        scopes.local(*routine, name, at);
                    }
                }
            }
            // `P.X=...`; what is given on may be changed there
            let gives = line.contains(&b'(') || mentions(line, b"DO");
            let may_change = |name: &[u8]| mentions(line, name) && (gives || word.eq_ignore_ascii_case(name));
            for (only_read, (name, is_in)) in only_read.get_mut(routine).into_iter().flatten().zip(names) {
                *only_read &= *is_in || !may_change(name);
            }
        }
        at += line.len();
    }
    Routines { scopes, only_read }
}

impl Reader<'_> {
    /// Behind the name of a routine that is called: targets, bases and tools that it may change. The cursor stays.
    pub(super) fn arguments(&mut self, routine: &[u8]) {
        if is_among(routine, CHANGE_NOTHING) {
            return;
        }
        let start = self.c;
        let at = start.at - routine.len();
        let name = hashed(routine);
        let called = match self.routines.only_read.get(&name) {
            Some(only_read) => Called::Here(self.routines.scopes.parameters(name), only_read),
            None => match self.elsewhere.routine(&lower(routine)) {
                Some(outside) => Called::Elsewhere(outside),
                None if may_move(start.bytes, at, routine) => Called::Unread(lower(routine)),
                None => Called::Other,
            },
        };
        self.c.skip_blank();
        self.c.at += 1;
        let (mut argument, mut depth) = (0, 0_usize);
        let mut begins = true;
        while !self.c.done() {
            self.c.skip_blank();
            if std::mem::take(&mut begins) {
                self.gives(argument, &called, at);
            }
            let word = self.c.word();
            if !word.is_empty() {
                // of a function among the arguments: it is asked about by itself
                if depth == 0 && !called.only_reads(argument) {
                    self.may_change(word, at);
                }
                continue;
            }
            match self.c.peek() {
                b'"' => {
                    self.c.skip_string();
                    continue;
                }
                b'\n' | b'\r' | b';' => break,
                b')' if depth == 0 => break,
                b'(' | b'[' | b'{' => depth += 1,
                b')' | b']' | b'}' => depth = depth.saturating_sub(1),
                b',' if depth == 0 => (argument, begins) = (argument + 1, true),
                _ => {}
            }
            self.c.at += 1;
        }
        self.c = start;
    }

    /// A call at `at` gives what stands at the cursor; the cursor stays where no target is written out.
    fn gives(&mut self, argument: usize, called: &Called<'_>, at: usize) {
        let name = self.key(self.c.clone().word(), self.c.at);
        match called {
            Called::Here(parameters, _) => {
                if let Some(parameter) = parameters.get(argument) {
                    self.becomes(parameter.key, at);
                }
            }
            Called::Elsewhere(routine) => {
                let Some(taken) = routine.takes.get(argument) else { return };
                if taken.one_angle {
                    self.names.also_used(name, OtherUse::OneAngle(at as u32));
                }
                let Setup { tool, frame } = self.now.clone();
                let with = |setup: &Setup| Setup {
                    tool: setup.tool.clone().or(tool.clone()),
                    frame: setup.frame.clone().or(frame.clone()),
                };
                self.goes_there(taken.goes.iter().map(with).collect());
            }
            Called::Unread(routine) => {
                if self.is_whole_place() || self.named.given_away.contains(&name) {
                    let tool = Some(self.scan.frames.tool_of_unread(routine));
                    self.goes_there(vec![Setup { tool, frame: self.now.frame.clone() }]);
                }
            }
            Called::Other => {}
        }
    }

    /// Whether all numbers of a place stand in braces at the cursor.
    fn is_whole_place(&mut self) -> bool {
        let start = self.c;
        let is_whole = start.peek() == b'{' && self.aggregate().is_place();
        self.c = start;
        is_whole
    }

    /// A routine of another file goes to what stands at the cursor, with each of these; the cursor stays as in [`Self::gives`].
    fn goes_there(&mut self, setups: Vec<Setup>) {
        if setups.is_empty() {
            return;
        }
        let (start, now, spots) = (self.c, self.now.clone(), self.scan.spots.len());
        let is_literal = start.peek() == b'{';
        for (k, setup) in setups.into_iter().enumerate() {
            self.now = setup;
            if k == 0 || !is_literal {
                self.c = start;
                self.place();
            } else if self.scan.spots.len() > spots {
                let setup = self.moves();
                self.scan.assign(spots as u32, setup);
            }
        }
        self.now = now;
        if !is_literal {
            self.c = start;
        }
        self.names.fork(Fork::Anywhere);
    }

    /// A parameter of a routine gets what stands at the cursor; the cursor stays where no target is written out.
    fn becomes(&mut self, parameter: u64, call: usize) {
        if !self.named.moved_to.contains(&parameter) || matches!(self.c.peek(), b')' | b',') {
            return;
        }
        let start = self.c;
        let at = start.at as u32;
        if self.c.peek() == b'{' {
            let found = self.aggregate();
            let origin = match self.target(&found, Span::default()) {
                Some(spot) => self.names.define_at(start.at, spot as usize, spot as usize + 1),
                None => Origin::Computed(at),
            };
            return self.names.set_from(parameter, origin);
        }
        let word = self.c.word();
        skip_index(&mut self.c);
        let is_whole = !word.is_empty() && matches!(self.c.peek(), b',' | b')');
        let origin = match is_whole {
            true if is_among(word, HERE) => Origin::Here,
            true => Origin::Name { name: self.key(word, start.at), at },
            false => Origin::Computed(call as u32),
        };
        if is_whole {
            self.names.copied(start.at);
        }
        self.names.set_from(parameter, origin);
        self.c = start;
    }

    fn may_change(&mut self, word: &[u8], at: usize) {
        let name = self.key(word, at);
        if self.named.given_away.contains(&name) {
            // it is listed where the routine goes there
        } else if self.named.moved_to.contains(&name) {
            self.names.set_from(name, Origin::Computed(at as u32));
        } else if is_one_of(word, &CURRENT) {
            self.set(word.eq_ignore_ascii_case(b"$TOOL"), "(set by a routine)".to_owned());
        } else if word.eq_ignore_ascii_case(ARM_BASE) {
            self.scan.problem(at, changed_here(THE_ARM_BASE));
        } else if is_one_of(word, &ELEMENTS) || self.is_frame(word) {
            self.scan.problem(at, changed_here("a tool or base"));
        }
    }
}
