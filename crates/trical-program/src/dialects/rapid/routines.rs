//! RAPID's routines that get targets: `PROC Pick(robtarget p,\robtarget via)`, and which arguments their calls give.

use std::collections::HashSet;

use super::frames::take_over;
use super::given::Given;
use super::instructions::is_instruction;
use super::motions::looks_like_motion;
use super::reader::{FARTHEST, Lent, Parameter, Place, Reader, scoped};
use crate::elsewhere::{Goes, Outside};
use crate::frames::Frames;
use crate::names::{Origin, Way};
use crate::scan::{Call, Fork, Setup, hashed};
use crate::text::{begins_line, is_letter, is_one_of, lower};

/// Functions that calculate a frame from targets.
const MAKE_FRAMES: [&[u8]; 3] = [b"defframe", b"defdframe", b"defaccframe"];

/// Those that change a tool.
const CALIBRATES: [&[u8]; 2] = [b"mtooltcpcalib", b"mtoolrotcalib"];

/// Those that set what they are given to what comes from elsewhere, and one that sets what has the name in its first argument.
const SETS: [&[u8]; 6] = [SETS_NAMED, b"strtoval", b"unpackrawbytes", b"readanybin", b"rmqgetmsgdata", b"getdataval"];

const SETS_NAMED: &[u8] = b"setdataval";

/// What is wrong where the name in the first argument of [`SETS_NAMED`] is calculated.
const BY_NAME: &str = "sets data whose name only the running program knows, and may change targets, tools and work objects; motions are corrected for where \
    these are declared";

/// Whether an argument is a text that is written out.
fn is_text(argument: &[u8]) -> bool {
    matches!(argument.trim_ascii(), [b'"', inside @ .., b'"'] if !inside.contains(&b'"'))
}

/// Those that change the first of what they are given by some amount.
const SHIFTS: [&[u8]; 3] = [b"add", b"incr", b"decr"];

/// Whether a statement begins with the word at `at`: it is the first of its line, and the line above is none that goes on.
#[must_use]
pub(super) fn begins_statement(bytes: &[u8], at: usize) -> bool {
    let near = at.saturating_sub(FARTHEST);
    let above = bytes[near..at].split(|b| *b == b'\n').rev().skip(1);
    let code = above.map(|line| line.split(|b| *b == b'!').next().unwrap_or(line).trim_ascii()).find(|l| !l.is_empty());
    begins_line(bytes, at) && !code.and_then(<[u8]>::last).is_some_and(|b| b",\\([+-*/=".contains(b))
}

impl Reader<'_> {
    /// Perhaps a call: what it gives to a routine of this file that gets targets.
    pub(super) fn call(&mut self, from: usize, word: &[u8]) {
        let routine = hashed(word);
        let Some(parameters) = self.routines.get(&routine).cloned() else {
            return self.call_elsewhere(from, word, routine);
        };
        self.note(|routine| routine.call(word));
        self.names.called(routine, false);
        let around = std::mem::take(&mut self.calls.given);
        if !parameters.is_empty() {
            if self.functions.contains_key(&routine) && !self.c.eat(b'(') {
                return;
            }
            self.each_argument(word, &mut |reader, key| match parameters.iter().find(|p| p.scoped == key) {
                Some(parameter) if parameter.is_target => reader.argument(*parameter),
                Some(parameter) => {
                    if parameter.by_reference {
                        reader.lend(key);
                    }
                    reader.gives_frame(key);
                }
                None => {}
            });
        }
        let given = std::mem::replace(&mut self.calls.given, around);
        self.called(routine, given);
    }

    /// What a call gives: each argument is at the cursor when it is taken, with what it is called outside the routine.
    pub(super) fn each_argument(&mut self, routine: &[u8], take: &mut dyn FnMut(&mut Self, u64)) {
        let is_function = self.functions.contains_key(&hashed(routine));
        let mut places = 0_usize..;
        while !self.c.done() && self.c.peek() != b';' {
            self.c.skip_space();
            let key = if self.c.eat(b'\\') {
                let name = self.c.name_ahead();
                self.gives().then(|| scoped(name, routine))
            } else {
                places.next().map(|k| scoped(k.to_string().as_bytes(), routine))
            };
            // an argument may be put in brackets
            let mut depth = 0;
            while self.c.eat(b'(') {
                depth += 1;
            }
            if let Some(key) = key {
                take(self, key);
            }
            // to the next one
            while !self.c.done() {
                match self.c.peek() {
                    // behind a function other things follow
                    b')' if is_function && depth == 0 => return,
                    b'(' | b'[' | b'{' => depth += 1,
                    b')' | b']' | b'}' => depth -= 1,
                    b'"' => {
                        self.c.skip_string();
                        continue;
                    }
                    b'!' => {
                        self.c.skip_line();
                        continue;
                    }
                    b';' => break,
                    b',' | b'\\' if depth <= 0 => break,
                    _ => {}
                }
                self.c.at += 1;
            }
            if self.c.peek() == b',' {
                self.c.at += 1;
            }
        }
    }

    /// A name that a call gives to a routine which may change it; `to` is what it is called there.
    fn lend(&mut self, to: u64) {
        let word = self.c.clone().word();
        if word.is_empty() {
            return;
        }
        let name = self.key(word);
        self.lent.push(Lent { name, to, at: self.c.at });
        self.note(|routine| routine.lend(name, to));
    }

    /// Whether arguments of a call may stand here, and not what follows a condition or a function.
    fn arguments_follow(&self) -> bool {
        let mut c = self.c;
        c.skip_space();
        if c.peek() == b'(' {
            let text = c.until(b";");
            let mut depth = 0;
            let end = text.iter().position(|b| {
                depth += i32::from(*b == b'(') - i32::from(*b == b')');
                depth == 0
            });
            let behind = end.and_then(|end| text.get(end + 1..)).unwrap_or(&[]).trim_ascii_start();
            return matches!(behind.first(), None | Some(b',' | b'\\'));
        }
        let word = c.word();
        c.skip_space();
        match c.peek() {
            b'\\' | b'[' => true,
            b'(' => is_one_of(word, &[b"offs", b"reltool"]),
            b',' | b';' | b'{' | b')' => !word.is_empty(),
            _ => c.number().is_some() && (c.eat(b',') || c.eat(b';')),
        }
    }

    /// Behind the name of a function at `at`: the targets from which it calculates a frame, if it does.
    pub(super) fn makes_frame(&mut self, function: &[u8], at: usize) {
        if is_one_of(function, &MAKE_FRAMES) {
            let words = self.c.until(b";").split(|b| !is_letter(*b) && !b.is_ascii_digit());
            for name in words.filter(|word| !word.is_empty()) {
                self.names.makes_frame(self.key(name), at);
            }
        }
    }

    /// Perhaps a call of a routine that this file does not have.
    fn call_elsewhere(&mut self, from: usize, word: &[u8], routine: u64) {
        self.makes_frame(word, from);
        if is_one_of(word, &CALIBRATES) {
            return self.each_argument(word, &mut |reader, _| reader.calibrated());
        }
        self.sets_given(from, word);
        let is_statement = begins_statement(self.c.bytes, from);
        let arguments = self.arguments_follow();
        let mut behind = self.c;
        behind.skip_space();
        let is_function = behind.peek() == b'(' && self.routine_elsewhere(word).is_some();
        let is_behind_condition = || looks_like_motion(word) && arguments && self.c.clone().peek() != b'(';
        if is_instruction(word) || !(is_statement || is_function || is_behind_condition()) {
            return;
        }
        self.note(|routine| routine.call(word));
        let first = !self.outside.contains_key(&routine);
        let found = self.routine_elsewhere(word).cloned();
        self.names.called(routine, found.as_ref().is_none_or(|f| f.moves));
        match &found {
            Some(found) => {
                let name = String::from_utf8_lossy(word);
                if found.displaces {
                    let what = format!(
                        "calls '{name}', which displaces the motions that follow; they are corrected for where the text has them"
                    );
                    self.scan.problem(from, what);
                }
                if found.sets_by_name {
                    self.scan.problem(from, format!("calls '{name}', which {BY_NAME}"));
                }
                let how = "is changed by a routine of another module, which is called here";
                for name in &found.sets {
                    self.names.set_from(*name, Origin::Computed(from as u32));
                    if self.parts.contains_key(name) {
                        self.changed_elsewhere.entry(*name).or_insert((from, how));
                    }
                }
            }
            None if first => self.scan.calls.push(Call { name: lower(word), at: from, is_statement: true }),
            None => {}
        }
        if !arguments {
            return;
        }
        self.gives_elsewhere(word, found.is_some());
    }

    /// What an instruction or a function of the language at `at` changes of the data that are given to it.
    pub(super) fn sets_given(&mut self, at: usize, word: &[u8]) {
        let (is_shift, is_named) = (is_one_of(word, &SHIFTS), word.eq_ignore_ascii_case(SETS_NAMED));
        if !is_shift && !is_one_of(word, &SETS) {
            return;
        }
        let first = self.c.until(b",\\;");
        if is_named && !is_text(first) {
            let value = self.c.until(b";").rsplit(|b| *b == b',').next().unwrap_or_default().trim_ascii();
            if is_text(value) || is_one_of(value, &[b"TRUE", b"FALSE"]) || lower(value).parse::<f64>().is_ok() {
                return;
            }
            self.note(|routine| routine.sets_by_name = true);
            return self.scan.problem(at, BY_NAME);
        }
        let given = self.c.until(b";)").split(|b| b",\\(".contains(b)).map(|argument| {
            let argument = argument.trim_ascii_start();
            let argument = if is_named { argument.strip_prefix(b"\"").unwrap_or(&[]) } else { argument };
            let end = argument.iter().position(|b| !is_letter(*b) && !b.is_ascii_digit());
            argument.get(..end.unwrap_or(argument.len())).unwrap_or(&[])
        });
        for name in given.filter(|name| !name.is_empty()).take(if is_shift || is_named { 1 } else { usize::MAX }) {
            let name = self.key(name);
            self.note(|routine| routine.set(name));
            if is_shift {
                self.names.changed(name, at);
            } else {
                self.names.set_from(name, Origin::Computed(at as u32));
            }
        }
    }

    /// A tool at the cursor is changed.
    fn calibrated(&mut self) {
        let (word, at) = (self.c.clone().word(), self.c.at as u32);
        if self.exports.is_some() || self.declares(true, &self.frame_name(word), None) {
            let name = self.key(word);
            self.note(|routine| routine.set(name));
            self.names.set_from(name, Origin::Computed(at));
        }
    }

    /// Data that modules change which call routines of this one.
    pub(super) fn changed_around(&mut self) {
        let own = self.heads.keys().copied().collect();
        let Some((called, around)) = self.elsewhere.around(&own) else { return };
        let at = called.iter().filter_map(|name| self.heads.get(name)).min().copied().unwrap_or(0);
        if around.displaces {
            let what = "is called from a module beside the program that displaces the motions; they are corrected for where the text has them";
            self.scan.problem(at, what);
        }
        if around.sets_by_name {
            self.scan.problem(at, format!("is called from a module beside the program that {BY_NAME}"));
        }
        let how = "is changed by a module beside the program, which calls the routine that begins here";
        for name in around.sets {
            self.names.set_from(name, Origin::Around(at as u32));
            self.changed_elsewhere.insert(name, (at, how));
        }
    }

    /// What a routine of another module does.
    pub(super) fn routine_elsewhere(&mut self, word: &[u8]) -> Option<&Outside> {
        let Self { elsewhere, outside, .. } = self;
        outside.entry(hashed(word)).or_insert_with(|| elsewhere.routine(&lower(word))).as_ref()
    }

    /// A call of a routine whose name the program puts together (`%name%p1,tool;`), from behind the first sign on.
    pub(super) fn call_late(&mut self, from: usize) {
        self.c.skip_to(b"%;\n");
        if self.c.eat(b'%') {
            let name = self.c.bytes.get(from..self.c.at).unwrap_or(&[]);
            self.gives_elsewhere(name, false);
        }
    }

    /// What a call gives to a routine that this file does not have.
    fn gives_elsewhere(&mut self, word: &[u8], is_known: bool) {
        let (mut given, mut names) = (Vec::new(), Vec::new());
        let at = self.c.at;
        self.each_argument(word, &mut |reader, key| {
            reader.c.skip_space();
            let from = reader.c.at;
            if is_known || reader.exports.is_some() {
                reader.lend(key);
            }
            if let Some(place) = reader.place() {
                let text = reader.c.bytes.get(from..reader.c.at).unwrap_or(&[]);
                if reader.exports.is_some() || place.name().is_some_and(|name| !reader.is_target(name)) {
                    names.push(reader.frame_name(text.trim_ascii()));
                }
                given.push((key, place));
            }
        });
        // what goes to a target with a tool changes none
        if !is_known && !given.iter().any(|(_, place)| place.name().is_none_or(|name| self.is_target(name))) {
            for name in &names {
                if self.declares(true, name, None) || self.declares(false, name, None) {
                    let how = "is given here to a routine that is in none of the files read and may change it";
                    self.changed_elsewhere.entry(hashed(name.as_bytes())).or_insert((at, how));
                }
            }
        }
        self.give(word, is_known, given, names);
    }

    /// What a call gives to a routine of another module: places, and names of what may be tools and work objects.
    fn give(&mut self, routine: &[u8], is_known: bool, given: Vec<(u64, Place)>, names: Vec<String>) {
        if let Some(exports) = &mut self.exports {
            // whose module is not known here
            for (key, name) in given.iter().filter_map(|(key, place)| Some((*key, place.name()?))) {
                let unread = Some((lower(routine), names.clone()));
                exports.given.insert((key, name));
                exports.goes.insert((name, Goes { setup: Setup::default(), unread }));
            }
            return;
        }
        for (key, place) in given {
            let setups = if !is_known && place.name().is_none_or(|name| self.is_target(name)) {
                let setup = self.setup_among(&lower(routine), &names, None);
                vec![self.scan.setup(setup)]
            } else if self.wanted.contains(&key) {
                self.setups_elsewhere(key)
            } else {
                continue;
            };
            for setup in setups {
                self.goes(&place, setup);
                self.names.fork(Fork::Anywhere);
            }
        }
    }

    fn is_target(&self, name: u64) -> bool {
        self.names.defines(name) || self.unset.contains(&name)
    }

    /// The setup of a target that is given to a routine of no module: what is declared as a tool and a work object among
    /// the names that it gets beside.
    fn setup_among(&mut self, routine: &str, names: &[String], theirs: Option<&Frames>) -> Setup {
        let [tool, mut frame] =
            [true, false].map(|is_tool| names.iter().find(|name| self.declares(is_tool, name, theirs)).cloned());
        if tool.is_some() {
            frame = frame.or_else(|| Some("wobj0".into()));
        }
        let tool = tool.unwrap_or_else(|| self.scan.frames.tool_of_unread(routine));
        Setup { tool: Some(tool), frame }
    }

    /// Whether a name is a tool, or a work object, of this module, of `theirs`, or of any other module.
    fn declares(&mut self, is_tool: bool, name: &str, theirs: Option<&Frames>) -> bool {
        let has = |frames: &Frames| frames.of(is_tool).contains_key(name);
        let elsewhere = self.elsewhere;
        let ask = || elsewhere.frame(is_tool, name).is_some();
        has(&self.scan.frames)
            || theirs.is_some_and(has)
            || *self.asked.entry((is_tool, name.to_owned())).or_insert_with(ask)
    }

    /// With what other modules go to the target or argument of this name.
    fn setups_elsewhere(&mut self, name: u64) -> Vec<u32> {
        let elsewhere = self.elsewhere;
        let mut all = Vec::new();
        for motion in elsewhere.motions(name) {
            let mut setup = match &motion.goes.unread {
                None => motion.goes.setup.clone(),
                Some((routine, _)) if self.routines.contains_key(&hashed(routine.as_bytes())) => continue,
                Some((routine, names)) => self.setup_among(routine, names, Some(motion.declared)),
            };
            for is_tool in [true, false] {
                take_over(is_tool, &mut setup, &mut self.scan.frames, motion.declared, motion.file);
            }
            all.push(self.scan.setup(setup));
        }
        all
    }

    /// Motions of other modules to targets of this one, and targets that they give to its routines.
    pub(super) fn used_elsewhere(&mut self) {
        let mut wanted: Vec<u64> = self.wanted.iter().copied().collect();
        wanted.sort_unstable();
        for name in wanted {
            let set = self.names.set_at(name).filter(|_| self.unset.contains(&name));
            let Some(at) = set.or_else(|| self.names.defines(name).then_some(0)) else {
                self.names.missed(name);
                continue;
            };
            for setup in self.setups_elsewhere(name) {
                self.names.fork(Fork::Anywhere);
                self.names.used(name, setup, Way::To, at);
            }
        }
        let own: HashSet<u64> = self.routines.values().flatten().map(|p| p.scoped).collect();
        for (to, from) in self.elsewhere.given() {
            if own.contains(&to) && self.wanted.contains(&from) && self.names.defines(from) {
                self.names.set_from(to, Origin::Name { name: from, at: 0 });
            }
        }
    }

    /// The place at the cursor, where a name, a target that is written out or one that is shifted stands there.
    pub(super) fn place(&mut self) -> Option<Place> {
        self.c.skip_space();
        let at = self.c.at;
        if self.c.peek() == b'[' {
            let (first, problems) = (self.scan.spots.len() as u32, self.scan.problems.len());
            self.list(0);
            let end = self.scan.spots.len() as u32;
            let is_listed = self.scan.problems.len() > problems;
            return if end > first { Some(Place::Spots(first, end)) } else { is_listed.then_some(Place::Here) };
        }
        let word = self.c.word();
        let name = self.key(word);
        self.c.skip_space();
        match self.c.peek() {
            _ if word.is_empty() => None,
            b'(' => Some(self.relative(word)),
            b'{' => Some(Place::Name { name, way: self.way_to_element(name), at }),
            b'.' if !self.component(name) => None,
            _ => Some(Place::Name { name, way: Way::To, at }),
        }
    }

    /// A name is set from something; other modules are told of it.
    pub(super) fn set_from(&mut self, name: u64, origin: Origin) {
        self.export_source(name, origin);
        self.names.set_from(name, origin);
    }

    pub(super) fn export_source(&mut self, name: u64, origin: Origin) {
        if let (Some(exports), Origin::Name { name: from, .. }) = (&mut self.exports, origin) {
            exports.given.insert((name, from));
        }
    }

    /// What a call gives as this argument.
    fn argument(&mut self, parameter: Parameter) {
        self.c.skip_space();
        let at = self.c.at as u32;
        let is_name = self.c.peek() != b'[';
        let origin = self.origin(b";{,\\)");
        self.set_from(parameter.scoped, origin);
        self.calls.given.push((parameter.scoped, Given::Place(origin)));
        if let (true, Origin::Name { name, .. }) = (parameter.by_reference && is_name, origin) {
            self.set_from(name, Origin::Name { name: parameter.scoped, at });
        }
    }

    /// Where the target at the cursor comes from, a name of one before one of `ends`.
    pub(super) fn origin(&mut self, ends: &[u8]) -> Origin {
        let from = self.c.at;
        if self.c.peek() == b'[' {
            let (first, problems) = (self.scan.spots.len(), self.scan.problems.len());
            self.list(0);
            let own = self.names.define_at(from, first, self.scan.spots.len());
            let is_target = self.scan.problems.len() == problems && self.scan.spots.len() > first;
            return if is_target { own } else { Origin::Computed(from as u32) };
        }
        let word = self.c.word();
        self.source(from, word, ends).filter(|_| !word.is_empty()).unwrap_or(Origin::Computed(from as u32))
    }
}
