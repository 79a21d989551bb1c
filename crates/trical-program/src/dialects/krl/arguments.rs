//! What routines do to their arguments in KRL: without `:IN` a routine may change what it is given.

use std::collections::HashMap;

use super::{CURRENT, ELEMENTS, Reader, before_bracket};
use crate::names::Origin;
use crate::scan::{changed_here, hashed};
use crate::text::{Cursor, is_one_of};

/// Of the language: they change none of what they are given.
const CHANGE_NOTHING: [&[u8]; 13] = [
    b"CWRITE",
    b"SWRITE",
    b"COPEN",
    b"CCLOSE",
    b"PULSE",
    b"ERR_RAISE",
    b"INVERSE",
    b"FORWARD",
    b"INV_POS",
    b"ABS",
    b"SQRT",
    b"VARSTATE",
    b"VARTYPE",
];

/// Which arguments the routines of a file only read, by their hashed names.
pub(super) fn only_read(bytes: &[u8]) -> HashMap<u64, Vec<bool>> {
    let mut found = HashMap::new();
    for line in bytes.split(|b| *b == b'\n') {
        let mut c = Cursor::new(line, b';');
        c.skip_blank();
        let mut word = c.word();
        if word.eq_ignore_ascii_case(b"GLOBAL") {
            c.skip_blank();
            word = c.word();
        }
        if is_one_of(word, &[b"DEF", b"DEFFCT"]) {
            let name = before_bracket(&mut c);
            let list = c.until(b")\r;").to_ascii_uppercase();
            let is_in = |argument: &[u8]| argument.trim_ascii_end().ends_with(b":IN");
            found.insert(name, list.split(|b| *b == b',').map(is_in).collect());
        }
    }
    found
}

impl Reader<'_> {
    /// Behind the name of a routine that is called: targets, bases and tools that it may change. The cursor stays.
    pub(super) fn arguments(&mut self, routine: &[u8]) {
        if is_one_of(routine, &CHANGE_NOTHING) {
            return;
        }
        let only_read = self.only_read.get(&hashed(routine));
        let start = self.c;
        let at = start.at - routine.len();
        self.c.skip_blank();
        self.c.at += 1;
        let (mut argument, mut depth) = (0, 0_usize);
        while !self.c.done() {
            self.c.skip_blank();
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
                b',' if depth == 0 => argument += 1,
                _ => {}
            }
            self.c.at += 1;
        }
        self.c = start;
    }

    fn may_change(&mut self, word: &[u8], at: usize) {
        if self.named.moved_to.contains(&hashed(word)) {
            self.names.set_from(hashed(word), Origin::Computed(at as u32));
        } else if is_one_of(word, &CURRENT) {
            self.set(word.eq_ignore_ascii_case(b"$TOOL"), "(set by a routine)".to_owned());
        } else if is_one_of(word, &ELEMENTS) || self.is_frame(word) {
            self.scan.problem(at, changed_here("a tool or base"));
        }
    }
}
