//! ABB RAPID: robtargets and jointtargets, declared or inline, single or in arrays; tooldata and wobjdata; motions.
//!
//! Numbers may be expressions of constants (`CONST num`). A motion to a place that this file does not say (data of another
//! module, what a function returns, `p.trans.z:=...`) is listed; what is shifted against a target goes with it.

use std::collections::HashSet;

use super::rapid_frames::{declare, tool, work_object};
use super::rapid_motions::is_motion;
use super::rapid_parts::Piece;
pub use super::rapid_reader::{Effects, Exports};
use super::rapid_reader::{Element, Place, Reader, scoped};
use crate::branch::Configuration;
use crate::elsewhere::{Elsewhere, Nowhere};
use crate::literal::Shape;
use crate::names::Origin;
use crate::reaching::Part;
use crate::scan::{Fork, Scan, Visit, changed_here, hashed};
use crate::text::{Span, begins_line, is_one_of, lower, mentions, number};

/// Instructions that move the arm otherwise than the text says, or displace what it says.
const OTHERWISE: [(&[&[u8]], &str); 4] = [
    (
        &[b"pdispon", b"pdispset"],
        "displaces the targets of the motions that follow; they are corrected for where the text has them",
    ),
    (
        &[b"eoffson", b"eoffsset"],
        "displaces the external axes for the motions that follow; targets are corrected for where the text has them",
    ),
    (&[b"corrcon"], "lets a sensor displace the motions that follow; they are corrected for where the text has them"),
    (
        &[b"egmrunpose", b"egmrunjoint", b"egmmovel", b"egmmovec"],
        "moves the arm as another computer says while the program runs (EGM), which is not corrected",
    ),
];
/// Values of external axes from here on mean that there is none (9E9).
const NO_AXIS: f64 = 1e8;
/// Kinds of data of which tables look like targets and are none (`robax` is the name of a robjoint in a jointtarget). A record's kind, or
/// one of another module, may be that of targets.
const NO_TARGETS: [&[u8]; 9] =
    [b"num", b"dnum", b"byte", b"bool", b"intnum", b"errnum", b"robjoint", b"extjoint", b"robax"];
/// Words that begin declarations of data.
const DECLARES: [&[u8]; 4] = [b"const", b"pers", b"var", b"task"];
/// Lists inside lists, at most: a record of arrays of targets has five.
const DEEPEST: usize = 12;

/// Where the mark goes: behind a module's header attributes (`%%% ... %%%`).
#[must_use]
pub fn header(bytes: &[u8]) -> usize {
    let text = bytes.trim_ascii_start();
    if !text.starts_with(b"%%%") {
        return 0;
    }
    let start = bytes.len() - text.len() + 3;
    let Some(k) = bytes[start..].windows(3).position(|w| w == b"%%%") else { return 0 };
    let end = start + k + 3;
    end + bytes[end..].iter().position(|b| *b == b'\n').map_or(0, |n| n + 1)
}

/// Reads a module.
#[must_use]
pub fn scan(bytes: &[u8], elsewhere: &dyn Elsewhere) -> Scan {
    let mut reader = Reader::of(bytes, elsewhere);
    reader.scan.frames.predefine("tool0", "wobj0");
    reader.file();
    // the program's own declaration changes nothing
    reader.scan.frames.predefine("tool0", "wobj0");
    reader.names.end_of_file();
    reader.used_elsewhere();
    reader.changed_around();
    reader.changed_where_lent();
    reader.changed_frames();
    reader.changed_parts();
    let Reader { mut scan, names, .. } = reader;
    names.resolve(&mut scan, bytes, &|name| {
        format!("goes to '{}', which this file does not give as numbers", String::from_utf8_lossy(name))
    });
    scan
}

/// What a module has for others. `number` tells it from other modules: data that it declares are none of theirs.
#[must_use]
pub fn for_others(bytes: &[u8], number: usize) -> Exports {
    let mut reader = Reader { exports: Some(Exports::default()), ..Reader::of(bytes, &Nowhere) };
    reader.file();
    let moving = reader.names.moving();
    let Exports { mut routines, goes, given, own, .. } = reader.exports.take().unwrap_or_default();
    let parameters = reader.routines.values().flatten();
    let copies: HashSet<u64> = parameters.filter(|p| !p.by_reference).map(|p| p.scoped).collect();
    for name in reader.routines.keys() {
        let routine = routines.entry(*name).or_default();
        routine.moves = moving.contains(name);
        routine.sets.retain(|set| !own.contains(set) && !copies.contains(set));
    }
    routines.retain(|name, _| reader.routines.contains_key(name));
    // motions to its own targets are nobody else's, unless it sets these from what others have
    let set: HashSet<u64> = given.iter().map(|(to, _)| *to).collect();
    let outside =
        |name| if own.contains(&name) { hashed(format!("{name} of module {number}").as_bytes()) } else { name };
    Exports {
        routines,
        frames: reader.scan.frames,
        goes: goes
            .into_iter()
            .filter(|(name, _)| !own.contains(name) || set.contains(name))
            .map(|(name, with)| (outside(name), with))
            .collect(),
        given: given.into_iter().map(|(to, from)| (outside(to), outside(from))).collect(),
        own,
    }
}

impl Reader<'_> {
    /// What a routine changes that is given to it is changed where it is given.
    fn changed_where_lent(&mut self) {
        loop {
            let names = &self.names;
            let (changed, left): (Vec<_>, Vec<_>) =
                std::mem::take(&mut self.lent).into_iter().partition(|lent| names.set_at(lent.to).is_some());
            self.lent = left;
            if changed.is_empty() {
                return;
            }
            changed.iter().for_each(|lent| self.names.set_from(lent.name, Origin::Computed(lent.at as u32)));
        }
    }

    /// Lists tools and work objects of motions that the program changes, or may change.
    fn changed_frames(&mut self) {
        let mut told = Vec::new();
        for setup in &self.scan.setups {
            for (what, name) in [("tool", &setup.tool), ("work object", &setup.frame)] {
                let Some(name) = name else { continue };
                let (hash, what) = (hashed(name.as_bytes()), format!("the {what} '{name}'"));
                let found = match (self.changed_elsewhere.get(&hash), self.names.set_at(hash)) {
                    (Some((at, how)), _) => (*at, format!("{what} {how}")),
                    (None, Some(at)) => (at, changed_here(&what)),
                    (None, None) => continue,
                };
                if !told.contains(&found) {
                    told.push(found);
                }
            }
        }
        self.scan.problems.extend(told);
    }

    /// Lists parts of targets that routines of other modules change.
    fn changed_parts(&mut self) {
        let changed = |name: &String| {
            let (at, how) = self.changed_elsewhere.get(&hashed(name.as_bytes()))?;
            Some((*at, format!("'{name}', a part of targets, {how}; they are corrected for where it is declared")))
        };
        self.scan.problems.extend(self.used_parts.iter().filter_map(changed).collect::<Vec<_>>());
    }

    pub(super) fn note(&mut self, note: impl FnOnce(&mut Effects)) {
        if let Some(exports) = &mut self.exports {
            note(exports.routines.entry(hashed(self.within.as_bytes())).or_default());
        }
    }

    fn file(&mut self) {
        let mut before: &[u8] = b"";
        while !self.c.done() {
            self.c.skip_space();
            let from = self.c.at;
            let word = self.c.word();
            if word.is_empty() {
                self.between_words(from);
                before = b"";
                continue;
            }
            let is = |w: &str| word.eq_ignore_ascii_case(w.as_bytes());
            if is("robtarget") || is("jointtarget") {
                self.data();
            } else if is("tooldata") || is("wobjdata") {
                self.frame(is("tooldata"), is_one_of(before, &DECLARES));
            } else if is_one_of(word, &NO_TARGETS) {
                self.other_data(is("num") && before.eq_ignore_ascii_case(b"const"));
            } else if let Some((words, what)) = OTHERWISE.iter().find(|(words, _)| is_one_of(word, words)) {
                self.scan.problem(from, *what);
                self.note(|routine| routine.displaces = true);
                if words.len() > 2 {
                    self.names.visit(Visit::Unknown);
                }
            } else if is("gripload") {
                self.c.skip_space();
                self.load(from);
            } else if is("moveextj") {
                self.motion_of_others();
            } else if is("confl") || is("confj") {
                self.configuration_switch();
            } else if is_motion(word)
                && !before.eq_ignore_ascii_case(b"module")
                && !self.routines.contains_key(&hashed(word))
                && self.routine_elsewhere(word).is_none()
            {
                self.motion(word);
            } else if !self.block(from, word) {
                self.assignment(from, word);
            }
            before = word;
            if !is_one_of(word, &DECLARES) {
                self.is_local = word.eq_ignore_ascii_case(b"local");
            }
        }
    }

    /// What is no word, from `from` on.
    fn between_words(&mut self, from: usize) {
        match self.c.peek() {
            b'[' => drop(self.list(0)),
            b'"' => self.c.skip_string(),
            b => {
                self.c.at += 1;
                if b == b';' {
                    (0..std::mem::take(&mut self.conditions)).for_each(|_| self.names.fork(Fork::Closes));
                }
                // a routine whose name the program puts together
                if b == b'%' && self.c.peek() != b'%' && begins_line(self.c.bytes, from) {
                    self.names.fork(Fork::Anywhere);
                    self.call_late(from);
                }
            }
        }
    }

    /// The load that the arm carries from `at` on, at the cursor.
    pub(super) fn load(&mut self, at: usize) {
        if !self.c.word().eq_ignore_ascii_case(b"load0") {
            self.scan.loads.push(at);
        }
    }

    /// `MoveExtJ`, no motion of the arm: its joint values are those of other machines.
    fn motion_of_others(&mut self) {
        self.c.skip_space();
        if self.c.peek() == b'[' {
            let first = self.scan.spots.len();
            self.list(0);
            self.names.define(hashed(b"\0"), first, self.scan.spots.len());
            self.names.no_target(hashed(b"\0"));
        } else {
            let name = self.c.word();
            self.names.no_target(hashed(name));
        }
    }

    /// Behind `ConfL` or `ConfJ`.
    fn configuration_switch(&mut self) {
        let at = self.c;
        if self.c.eat(b'\\') && self.c.word().eq_ignore_ascii_case(b"off") {
            self.scan.configuration_off = true;
        } else {
            self.c = at;
        }
    }

    /// What a name is called among all names: arguments and data of a routine are its own.
    pub(super) fn key(&self, name: &[u8]) -> u64 {
        let name = hashed(name);
        self.locals.get(&name).copied().unwrap_or(name)
    }

    /// What a tool or a work object is called among all of them.
    pub(super) fn frame_name(&self, name: &[u8]) -> String {
        let is_local = self.locals.contains_key(&hashed(name));
        if is_local { format!("{} of {}", lower(name), self.within) } else { lower(name) }
    }

    /// Words that begin or end routines, branches and loops.
    fn block(&mut self, from: usize, word: &[u8]) -> bool {
        let is = |words: &[&[u8]]| is_one_of(word, words);
        if is(&[b"proc", b"func", b"trap"]) {
            if is(&[b"func"]) {
                self.c.skip_space();
                // the kind of its value
                self.c.word();
            }
            self.c.skip_space();
            let name = self.c.word();
            self.within = lower(name);
            let name = hashed(name);
            self.heads.insert(name, from);
            self.names.routine(name);
            if is(&[b"trap"]) {
                self.names.runs_at_any_time(name);
            }
            self.locals = self.routines.get(&name).into_iter().flatten().map(|p| (p.name, p.scoped)).collect();
        } else if is(&[b"endproc", b"endfunc", b"endtrap"]) {
            self.names.end(Some(Fork::Anywhere));
            self.within.clear();
            self.locals.clear();
        } else if is(&[b"error", b"undo", b"backward", b"callbyvar"]) && begins_line(self.c.bytes, from) {
            self.names.handler();
        } else if is(&[b"for"]) {
            self.names.fork(Fork::Repeats);
            self.c.skip_space();
            let name = self.c.word();
            self.constants.forget(hashed(name));
        } else if is(&[b"while"]) {
            self.names.fork(Fork::Repeats);
        } else if is(&[b"if"]) {
            // `IF c THEN ... ENDIF`, or one instruction behind the condition
            self.names.fork(Fork::Opens);
            self.conditions += usize::from(!mentions(self.c.clone().until(b";"), b"THEN"));
        } else if is(&[b"test"]) {
            self.names.fork(Fork::Opens);
        } else if is(&[b"elseif", b"else", b"case", b"default"]) {
            self.names.fork(Fork::Other);
        } else if is(&[b"endif", b"endtest", b"endfor", b"endwhile"]) {
            self.names.fork(Fork::Closes);
        } else {
            return false;
        }
        true
    }

    /// `CONST num h:=200;`, `VAR num table{2,6}:=[[...],[...]];`, `num argument`
    fn other_data(&mut self, is_constant: bool) {
        self.c.skip_space();
        let name = self.c.word();
        self.c.skip_space();
        if self.c.peek() == b'{' {
            self.own(name);
            self.tables.insert(self.key(name));
            self.c.skip_past(b'}', b";\n");
        }
        let start = self.c;
        let mut value = None;
        if name.is_empty() || !(self.c.eat(b':') && self.c.eat(b'=')) {
            self.c = start;
        } else if self.c.eat(b'[') {
            self.skip_list();
        } else if is_constant {
            value = self.constants.expression(&mut self.c).filter(|_| self.c.eat(b';'));
        }
        match value {
            Some((_, value)) => self.constants.define(hashed(name), value),
            // of a variable or an argument, a constant of the same name elsewhere is another one
            None => self.constants.forget(hashed(name)),
        }
    }

    /// Past a list of no targets, from behind its bracket on.
    fn skip_list(&mut self) {
        let mut depth = 1;
        while depth > 0 {
            self.c.skip_space();
            match self.c.peek() {
                _ if self.c.done() => return,
                b';' => return,
                b'[' => depth += 1,
                b']' => depth -= 1,
                b'"' => {
                    self.c.skip_string();
                    continue;
                }
                _ => {}
            }
            self.c.at += 1;
        }
    }

    /// A name that is declared here is the routine's own, if one is being read.
    fn own(&mut self, name: &[u8]) {
        if !self.within.is_empty() {
            self.locals.entry(hashed(name)).or_insert_with(|| scoped(name, self.within.as_bytes()));
        }
    }

    /// `p:=[[...]]`, `p:=q`, `p:=Offs(q,...)`, `p.trans.z:=...`, `p{i}:=...`: data that the program sets.
    fn assignment(&mut self, from: usize, word: &[u8]) {
        let start = self.c;
        let (mut is_part, mut part) = (false, Part::Whole);
        loop {
            match self.c.peek() {
                b'.' => {
                    self.c.at += 1;
                    is_part |= !self.c.word().is_empty();
                }
                b'{' => part = self.element().map_or(Part::Indexed, Part::Element),
                _ => break,
            }
        }
        let label = self.c.peek() == b':' && !is_part && begins_line(self.c.bytes, from);
        if !(self.c.eat(b':') && self.c.eat(b'=')) {
            self.c = start;
            if label {
                self.names.fork(Fork::Anywhere);
            } else {
                self.call(from, word);
            }
            return;
        }
        let name = self.key(word);
        self.note(|routine| routine.set(name));
        self.c.skip_space();
        if is_part {
            if mentions(self.c.until(b";\n"), word) {
                self.names.changed(name, from);
            } else {
                self.names.set_from(name, Origin::Computed(from as u32));
            }
        } else if self.c.peek() == b'[' && self.tables.contains(&name) {
            self.c.at += 1;
            self.skip_list();
        } else if self.c.peek() == b'[' {
            self.define(Span::new(from, from + word.len()), part);
        } else {
            let start = self.c;
            let source = self.c.word();
            if source.is_empty() {
                return;
            }
            match self.source(from, source, b";{") {
                Some(origin) => {
                    self.export_source(name, origin);
                    self.names.set_here(name, part, origin);
                }
                None => self.c = start,
            }
        }
    }

    /// Where data come from that are set from what begins with this word, a name before one of `ends`; `None` is no target.
    pub(super) fn source(&mut self, from: usize, word: &[u8], ends: &[u8]) -> Option<Origin> {
        let at = from as u32;
        self.c.skip_space();
        match self.c.peek() {
            b'(' if self.joints_of_place(word) => Some(Origin::Here),
            b'(' => Some(match self.relative(word) {
                Place::Name { name, .. } => Origin::Name { name, at },
                Place::Here => Origin::Here,
                _ => Origin::Computed(at),
            }),
            b'.' => Some(Origin::Computed(at)),
            b if ends.contains(&b) => {
                self.names.copied(from);
                Some(Origin::Name { name: self.key(word), at })
            }
            _ => None,
        }
    }

    /// `robtarget name{3}:=[...]`
    fn data(&mut self) {
        self.c.skip_space();
        let from = self.c.at;
        let name = self.c.word();
        let name = Span::new(from, from + name.len());
        if name.len == 0 {
            return;
        }
        let text = name.text(self.c.bytes);
        let hash = hashed(text);
        self.own(text);
        if self.within.is_empty() {
            match &mut self.exports {
                Some(exports) => drop(exports.own.insert(hash)),
                None if self.is_local => drop(self.wanted.remove(&hash)),
                None => {}
            }
        }
        self.c.skip_space();
        if self.c.peek() == b'{' {
            self.arrays.insert(self.key(text));
            self.c.skip_past(b'}', b";\n");
        }
        let start = self.c;
        if self.c.eat(b':') && self.c.eat(b'=') {
            self.c = start;
            self.assignment(from, text);
        } else {
            self.unset.insert(self.key(text));
        }
    }

    fn define(&mut self, name: Span, part: Part) {
        let (first, problems) = (self.scan.spots.len(), self.scan.problems.len());
        self.name = name;
        self.placeholders = false;
        self.list(0);
        self.name = Span::default();
        let hash = self.key(name.text(self.c.bytes));
        let end = self.scan.spots.len();
        let holds_others = self.placeholders || self.elements.iter().any(|element| element.name.is_some());
        if self.arrays.contains(&hash) && holds_others && end > first && part == Part::Whole {
            self.define_elements(hash, first);
        } else {
            self.names.define_part(hash, part, first, end);
        }
        if self.scan.problems.len() > problems {
            self.names.listed(hash);
        } else if self.placeholders {
            self.unset.insert(hash);
        } else if end == first {
            self.names.set_from(hash, Origin::Computed(name.at));
        }
    }

    /// An array with names of targets, or with placeholders, among its elements.
    fn define_elements(&mut self, array: u64, mut first: usize) {
        for (k, element) in std::mem::take(&mut self.elements).into_iter().enumerate() {
            self.names.define_part(array, Part::Element(k), first, element.end);
            first = element.end;
            let Some(given) = element.name else { continue };
            let mut c = self.c;
            c.at = given.at as usize;
            let name = c.word();
            let origin = match name == given.text(c.bytes).trim_ascii() {
                true => Origin::Name { name: self.key(name), at: given.at },
                false => Origin::Computed(given.at),
            };
            self.names.copied(given.at as usize);
            self.set_from(array, origin);
        }
    }

    /// A list, from its bracket on; its targets are taken as soon as they close, so that arrays of any length cost nothing.
    /// `None` where it does not end before the statement does.
    pub(super) fn list(&mut self, depth: usize) -> Option<Piece> {
        self.c.at += 1;
        if depth > DEEPEST {
            return None;
        }
        if depth == 0 {
            self.elements.clear();
        }
        let mut spans = [Span::default(); 6];
        let mut pieces = [Piece::default(); 4];
        let (mut numbers, mut lists, mut others, mut unread) = (0, 0, 0, None);
        loop {
            self.c.skip_space();
            let mut name = None;
            match self.c.peek() {
                b']' => {
                    self.c.at += 1;
                    break;
                }
                b'[' => {
                    let piece = self.list(depth + 1)?;
                    name = piece.unread;
                    if let Some(to) = pieces.get_mut(lists) {
                        *to = piece;
                    }
                    lists += 1;
                }
                b',' => {
                    self.c.at += 1;
                    continue;
                }
                b'"' => {
                    self.c.skip_string();
                    others += 1;
                }
                b';' => return None,
                _ if self.c.done() => return None,
                _ if self.named_part(pieces.get_mut(lists)) => lists += 1,
                _ => {
                    let span = self.item().unwrap_or_else(|span| *name.insert(span));
                    if let Some(to) = spans.get_mut(numbers) {
                        *to = span;
                    }
                    numbers += 1;
                }
            }
            unread = unread.or(name);
            if depth == 0 {
                self.elements.push(Element { end: self.scan.spots.len(), name });
            }
        }
        if others == 0 && lists == 0 && numbers <= 6 {
            return Some(Piece { count: numbers, spans, unread, name: None });
        }
        let is_target = others == 0 && numbers == 0 && lists <= 4 && self.target(&pieces[..lists]);
        Some(Piece { unread: unread.filter(|_| !is_target), ..Piece::default() })
    }

    /// The name of a part of a target that stands in a list by itself; the part is kept in `to`.
    fn named_part(&mut self, to: Option<&mut Piece>) -> bool {
        let mut c = self.c;
        let name = c.word();
        let end = c.at;
        c.skip_space();
        let known = self.parts.get(&hashed(name)).filter(|_| matches!(c.peek(), b',' | b']'));
        let (Some(known), Some(to)) = (known, to) else { return false };
        *to = Piece { name: Some(Span::new(self.c.at, end)), ..*known };
        if !self.used_parts.contains(&lower(name)) {
            self.used_parts.push(lower(name));
        }
        self.c.at = end;
        true
    }

    /// A number of a list, plain or calculated; `Err` is where something stands that has no value.
    fn item(&mut self) -> Result<Span, Span> {
        if let Some(span) = self.constants.number(&mut self.c, b",]", &mut self.scan) {
            return Ok(span);
        }
        let start = self.c;
        let mut depth = 0;
        while !self.c.done() {
            match self.c.peek() {
                b'(' => depth += 1,
                b')' => depth -= 1,
                b',' if depth > 0 => {}
                b',' | b']' | b'[' | b';' | b'"' | b'!' => break,
                _ => {}
            }
            self.c.at += 1;
        }
        Err(Span::new(start.at, self.c.at))
    }

    /// Takes these lists as a target, where they are one: a robtarget or a jointtarget; whether they are.
    fn target(&mut self, pieces: &[Piece]) -> bool {
        let bytes = self.c.bytes;
        let (p, external) = match pieces {
            [p, q, cf, external] if [p.count, q.count, cf.count, external.count] == [3, 4, 4, 6] => (p, external),
            [q, external] if [q.count, external.count] == [6, 6] => (q, external),
            _ => return false,
        };
        if let Some(span) = pieces.iter().find_map(|p| p.unread) {
            self.scan.unread(span, bytes);
            return true;
        }
        let is_zero = |s: &Span| self.scan.value(*s, bytes) == Some(0.0);
        if let ([_, q, _, _], true) = (pieces, self.name.len > 0)
            && q.numbers().iter().all(is_zero)
        {
            // no orientation at all: the arm goes there only if it is set before
            self.scan.unused.push((p.spans[0].at as usize, self.name));
            self.placeholders = true;
            return true;
        }
        if let [_, q, cf, _] = pieces {
            let demanded = cf.spans.map(|s| self.scan.value(s, bytes).filter(|v| v.abs() < 1000.0).map(|v| v as i16));
            let configuration = match demanded {
                [Some(a), Some(b), Some(c), Some(d), ..] => Configuration::Abb([a, b, c, d]),
                _ => Configuration::Free,
            };
            let (p, q, cf) = (p.spans, q.spans, cf.spans);
            let spans = [p[0], p[1], p[2], q[0], q[1], q[2], q[3], cf[0], cf[1], cf[2]];
            self.scan.push(Shape::Quaternion, &spans, configuration, self.name);
        } else {
            self.scan.push(Shape::JointsDeg, &p.spans, Configuration::Free, self.name);
        }
        let named: Vec<_> = pieces.iter().filter_map(|p| Some((p.name?, p.numbers().to_vec()))).collect();
        if !named.is_empty() {
            self.scan.named_parts(p.name.unwrap_or(p.spans[0]).at, named);
        }
        let values = external.spans.map(|s| self.scan.value(s, bytes).filter(|v| v.abs() < NO_AXIS));
        self.scan.external_axes(&values);
        true
    }

    /// `tooldata name:=[...]`, `wobjdata name:=[...]`
    fn frame(&mut self, is_tool: bool, is_data: bool) {
        self.c.skip_space();
        let word = self.c.word();
        if word.is_empty() {
            return;
        }
        self.own(word);
        let name = self.frame_name(word);
        self.c.skip_space();
        let is_argument = matches!(self.c.peek(), b',' | b')' | b'\\' | b'|');
        if !(self.c.eat(b':') && self.c.eat(b'=') && self.c.eat(b'[')) {
            let why = if is_argument {
                "is an argument of its routine, and which one the calls give is not followed"
            } else {
                "is not given as numbers where the program declares it"
            };
            // neither a list of them nor a part of a record
            if is_argument || is_data && self.c.peek() != b'{' {
                self.not_known(is_tool, &name, why);
            }
            return;
        }
        let (mut depth, mut words, mut values) = (1, Vec::new(), Vec::new());
        while depth > 0 && !self.c.done() && self.c.peek() != b';' && values.len() < 64 {
            self.c.skip_space();
            match self.c.peek() {
                b'[' => depth += 1,
                b']' => depth -= 1,
                b'"' => {
                    self.c.skip_string();
                    continue;
                }
                b if b.is_ascii_alphabetic() => {
                    words.push(lower(self.c.word()));
                    continue;
                }
                b';' => break,
                _ => {
                    if let Some(span) = self.c.number() {
                        values.extend(number(span.text(self.c.bytes)));
                        continue;
                    }
                }
            }
            self.c.at += 1;
        }
        let truth: Vec<bool> = words.iter().map(|w| w == "true").collect();
        if is_tool {
            let tool = tool(&truth, &values, &name);
            declare(&mut self.scan.frames.tools, name, tool);
        } else {
            let frame = work_object(&truth, &values, &name);
            declare(&mut self.scan.frames.frames, name, frame);
        }
    }
}
