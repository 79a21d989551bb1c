//! What routines do to their arguments in KRL: without `:IN` a routine may change what it is given, if its text does so.

use std::collections::HashMap;

use super::targets::{declarations, skip_index};
use super::{ARM_BASE, CURRENT, ELEMENTS, HERE, Reader, THE_ARM_BASE, TYPES, before_bracket};
use crate::names::Origin;
use crate::scan::{changed_here, hashed};
use crate::scopes::Scopes;
use crate::text::{Cursor, Span, is_among, is_one_of, mentions};

/// Of the language: they change none of what they are given.
const CHANGE_NOTHING: &str = "CWRITE SWRITE COPEN CCLOSE PULSE ERR_RAISE INVERSE FORWARD INV_POS ABS SQRT VARSTATE \
    VARTYPE";

/// What the routines of a file have for themselves: their parameters, and which of these they only read, by their hashed names.
#[derive(Default)]
pub(super) struct Routines {
    pub(super) scopes: Scopes,
    only_read: HashMap<u64, Vec<bool>>,
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
        let only_read = self.routines.only_read.get(&hashed(routine));
        let parameters = self.routines.scopes.parameters(hashed(routine));
        let start = self.c;
        let at = start.at - routine.len();
        self.c.skip_blank();
        self.c.at += 1;
        let (mut argument, mut depth) = (0, 0_usize);
        let mut begins = true;
        while !self.c.done() {
            self.c.skip_blank();
            if let Some(parameter) = parameters.get(argument).filter(|_| std::mem::take(&mut begins)) {
                self.becomes(parameter.key, at);
            }
            let word = self.c.word();
            if !word.is_empty() {
                // of a function among the arguments: it is asked about by itself
                if depth == 0 && !only_read.is_some_and(|list| list.get(argument).copied().unwrap_or(false)) {
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
        if self.named.moved_to.contains(&name) {
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
