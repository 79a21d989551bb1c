//! ABB RAPID: robtargets and jointtargets, declared or inline, single or in arrays; tooldata and wobjdata; motions.
//!
//! Numbers may be expressions of constants (`CONST num`). A motion to a place that this file does not say (data of another
//! module, what a function returns, `p.trans.z:=...`) is listed; what is shifted against a target goes with it.

mod angles;
mod called;
mod data;
mod frames;
mod given;
mod instructions;
mod motions;
mod parts;
mod reader;
mod records;
mod routines;

pub use reader::{Effects, Exports};

use std::collections::HashSet;

use crate::elsewhere::{Elsewhere, Nowhere};
use crate::names::{Origin, Way};
use crate::reaching::Part;
use crate::scan::{Fork, Scan, Visit, changed_here, hashed};
use crate::text::{Span, begins_line, is_one_of, lower, mentions};
use motions::is_motion;
use reader::{Place, Reader, scoped};
use records::Kind;

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
/// Kinds of data of which tables look like targets and are none (`robax` is the name of a robjoint in a jointtarget). A record's kind, or
/// one of another module, may be that of targets.
const NO_TARGETS: [&[u8]; 9] =
    [b"num", b"dnum", b"byte", b"bool", b"intnum", b"errnum", b"robjoint", b"extjoint", b"robax"];
/// Words that begin declarations of data.
const DECLARES: [&[u8]; 4] = [b"const", b"pers", b"var", b"task"];

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
    reader.follow_results();
    // the program's own declaration changes nothing
    reader.scan.frames.predefine("tool0", "wobj0");
    reader.names.end_of_file();
    reader.scan.angles = ["\\Z", "\\Y", "\\X"];
    reader.used_elsewhere();
    reader.changed_around();
    reader.changed_where_lent();
    reader.follow_frames();
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
    reader.follow_results();
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
                let argument = self.calls.arguments.get(name).map(|(key, _)| *key);
                let set_at = self.names.set_at(hash).or_else(|| self.names.set_at(argument?));
                let found = match (self.changed_elsewhere.get(&hash), set_at) {
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

    fn note(&mut self, note: impl FnOnce(&mut Effects)) {
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
            self.note_angles();
            if word.is_empty() {
                self.between_words(from);
                before = b"";
                continue;
            }
            let is = |w: &str| word.eq_ignore_ascii_case(w.as_bytes());
            let is_declared = is_one_of(before, &DECLARES);
            if is("robtarget") || is("jointtarget") || is_declared && self.records.hold_targets(Kind::of(word)) {
                self.data(Kind::of(word));
            } else if is("tooldata") || is("wobjdata") {
                self.frame(is("tooldata"), is_declared);
            } else if is_one_of(word, &NO_TARGETS) {
                self.other_data(is("num") && before.eq_ignore_ascii_case(b"const"));
            } else if let Some((words, what)) = OTHERWISE.iter().find(|(words, _)| is_one_of(word, words)) {
                self.scan.problem(from, *what);
                self.note(|routine| routine.displaces = true);
                if words.len() > 2 {
                    self.names.visit(Visit::Unknown);
                }
            } else if is("return") {
                self.returns();
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
    fn load(&mut self, at: usize) {
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
        if self.c.eat(b'\\') && self.c.name_ahead().eq_ignore_ascii_case(b"off") {
            self.scan.configuration_off = true;
        } else {
            self.c = at;
        }
    }

    /// What a name is called among all names: arguments and data of a routine are its own, and so are a module's where a file has several.
    fn key(&self, name: &[u8]) -> u64 {
        let name = hashed(name);
        self.locals.get(&name).copied().unwrap_or(name)
    }

    /// What a tool or a work object is called among all of them.
    fn frame_name(&self, name: &[u8]) -> String {
        let hash = hashed(name);
        let whose = match self.locals.get(&hash) {
            None => return lower(name),
            own if own == self.of_module.get(&hash) => &self.module,
            _ => &self.within,
        };
        format!("{} of {whose}", lower(name))
    }

    /// Words that begin or end routines, branches and loops.
    fn block(&mut self, from: usize, word: &[u8]) -> bool {
        let is = |words: &[&[u8]]| is_one_of(word, words);
        if is(&[b"record"]) {
            while self.c.next_word().is_some_and(|(_, word)| !word.eq_ignore_ascii_case(b"endrecord")) {}
        } else if is(&[b"module"]) && self.has_modules {
            self.module = format!("module {}", lower(self.c.name_ahead()));
            self.of_module.clear();
            self.locals.clear();
        } else if is(&[b"proc", b"func", b"trap"]) {
            if is(&[b"func"]) {
                self.c.skip_space();
                // the kind of its value
                self.c.word();
            }
            let name = self.c.name_ahead();
            self.within = lower(name);
            let name = hashed(name);
            self.heads.insert(name, from);
            self.names.routine(name);
            if is(&[b"trap"]) {
                self.names.runs_at_any_time(name);
            }
            self.locals.clone_from(&self.of_module);
            for parameter in self.routines.get(&name).into_iter().flatten() {
                self.locals.insert(parameter.name, parameter.scoped);
                self.record_data.insert(parameter.scoped, parameter.kind);
            }
        } else if is(&[b"endproc", b"endfunc", b"endtrap"]) {
            self.names.end(Some(Fork::Anywhere));
            self.within.clear();
            self.locals.clone_from(&self.of_module);
        } else if is(&[b"error", b"undo", b"backward", b"callbyvar"]) && begins_line(self.c.bytes, from) {
            self.names.handler();
        } else if is(&[b"for"]) {
            self.names.fork(Fork::Repeats);
            let name = self.c.name_ahead();
            self.constants.forget(hashed(name));
        } else if is(&[b"while"]) {
            self.names.fork(Fork::Repeats);
        } else if is(&[b"if"]) {
            // `IF c THEN ... ENDIF`, or one instruction behind the condition
            self.names.fork(Fork::Opens);
            self.conditions += usize::from(!mentions(self.c.clone().until(b";"), b"THEN"));
        } else if is(&[b"test"]) {
            self.names.fork(Fork::Opens);
        } else if is(&[b"elseif", b"case"]) {
            self.names.fork(Fork::Other);
        } else if is(&[b"else", b"default"]) {
            self.names.fork(Fork::Else);
        } else if is(&[b"endif", b"endtest", b"endfor", b"endwhile"]) {
            self.names.fork(Fork::Closes);
        } else {
            return false;
        }
        true
    }

    /// `CONST num h:=200;`, `VAR num table{2,6}:=[[...],[...]];`, `num argument`
    fn other_data(&mut self, is_constant: bool) {
        let name = self.c.name_ahead();
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

    /// A name that is declared here is the routine's own, if one is being read; or its module's, of several in the file.
    fn own(&mut self, name: &[u8]) {
        if !self.within.is_empty() {
            if self.locals.get(&hashed(name)) == self.of_module.get(&hashed(name)) {
                self.locals.insert(hashed(name), scoped(name, self.within.as_bytes()));
            }
        } else if self.is_local && self.has_modules {
            let own = scoped(name, self.module.as_bytes());
            self.of_module.insert(hashed(name), own);
            self.locals.insert(hashed(name), own);
        }
    }

    /// `p:=[[...]]`, `p:=q`, `p:=Offs(q,...)`, `p.trans.z:=...`, `p{i}:=...`: data that the program sets.
    fn assignment(&mut self, from: usize, word: &[u8]) {
        let start = self.c;
        let (mut is_part, mut part) = (false, Part::Whole);
        loop {
            self.c.skip_space();
            match self.c.peek() {
                b'.' => {
                    self.c.at += 1;
                    is_part |= !self.c.name_ahead().is_empty();
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
            self.c.skip_space();
            let is_elsewhere = !self.functions.contains_key(&hashed(source))
                && self.c.peek() == b'('
                && self.routine_elsewhere(source).is_some();
            if is_elsewhere {
                self.names.set_here(name, part, Origin::Computed(from as u32));
                // what the function does is read as any call
                self.c = start;
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
    fn source(&mut self, from: usize, word: &[u8], ends: &[u8]) -> Option<Origin> {
        let at = from as u32;
        self.c.skip_space();
        match self.c.peek() {
            // what it returns is no target; what it does is read as any expression
            b'(' if self.functions.get(&hashed(word)) == Some(&false) => None,
            b'(' if self.joints_of_place(word) => Some(Origin::Here),
            b'(' => Some(match self.relative(word) {
                Place::Name { name, way, .. } => {
                    if matches!(way, Way::To) {
                        self.names.copied(from);
                    }
                    Origin::Name { name, at }
                }
                Place::Here => Origin::Here,
                _ => Origin::Computed(at),
            }),
            b'.' if !self.component(self.key(word)) => Some(Origin::Computed(at)),
            b if b == b'.' || ends.contains(&b) => {
                self.names.copied(from);
                Some(Origin::Name { name: self.key(word), at })
            }
            _ => None,
        }
    }
}
