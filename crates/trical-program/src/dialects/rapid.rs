//! ABB RAPID: robtargets and jointtargets, declared or inline, single or in arrays; tooldata and wobjdata; motions.
//!
//! Numbers may be expressions of constants (`CONST num`). A motion to a place that this file does not say (data of another
//! module, what a function returns, `p.trans.z:=...`) is listed; what is shifted against a target goes with it.

use std::collections::HashMap;

use trical_model::Pose;

use super::rapid_frames::{tool, work_object};
use super::rapid_motions::MOTIONS;
pub use super::rapid_reader::Effects;
use super::rapid_reader::{Piece, Place, Reader, key};
use crate::branch::Configuration;
use crate::elsewhere::{Elsewhere, Nowhere};
use crate::frames::{Frames, ToolFrame};
use crate::literal::Shape;
use crate::names::Origin;
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
    reader.scan.frames.tools.insert("tool0".into(), Ok(ToolFrame::massless(Pose::identity())));
    reader.scan.frames.frames.insert("wobj0".into(), Ok(Pose::identity()));
    reader.file();
    let Reader { mut scan, names, .. } = reader;
    let mut told = Vec::new();
    for setup in &scan.setups {
        for (what, name) in [("tool", &setup.tool), ("work object", &setup.frame)] {
            if let Some((at, name)) = name.as_deref().and_then(|n| Some((names.set_at(hashed(n.as_bytes()))?, n)))
                && !told.contains(&at)
            {
                told.push(at);
                scan.problems.push((at, changed_here(&format!("the {what} '{name}'"))));
            }
        }
    }
    names.resolve(&mut scan, bytes, &|name| {
        format!("goes to '{}', which this file does not give as numbers", String::from_utf8_lossy(name))
    });
    scan
}

/// What a module has for others: its routines, and its tools and work objects.
#[must_use]
pub fn for_others(bytes: &[u8]) -> (HashMap<u64, Effects>, Frames) {
    let mut reader = Reader { effects: Some(HashMap::new()), ..Reader::of(bytes, &Nowhere) };
    reader.file();
    let moving = reader.names.moving();
    let mut effects = reader.effects.take().unwrap_or_default();
    let own = effects.remove(&0).unwrap_or_default().own;
    for name in reader.routines.keys() {
        let routine = effects.entry(*name).or_default();
        routine.moves = moving.contains(name);
        routine.sets.retain(|set| !own.contains(set));
    }
    effects.retain(|name, _| reader.routines.contains_key(name));
    (effects, reader.scan.frames)
}

impl Reader<'_> {
    pub(super) fn note(&mut self, note: impl FnOnce(&mut Effects)) {
        if let Some(effects) = &mut self.effects {
            note(effects.entry(self.within).or_default());
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
                self.frame(is("tooldata"));
            } else if is("num") && before.eq_ignore_ascii_case(b"const") {
                self.constant();
            } else if is("num") {
                // a variable or an argument: a constant of the same name elsewhere is another one
                self.c.skip_space();
                let name = self.c.word();
                self.constants.forget(hashed(name));
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
            } else if MOTIONS.iter().any(|m| word.len() >= m.len() && word[..m.len()].eq_ignore_ascii_case(m))
                && !is_one_of(before, &[b"proc", b"func", b"trap", b"module"])
            {
                self.motion(word);
            } else if !self.block(from, word) {
                self.assignment(from, word);
            }
            before = word;
        }
    }

    /// What is no word, from `from` on.
    fn between_words(&mut self, from: usize) {
        match self.c.peek() {
            b'[' => drop(self.list(0)),
            b'"' => self.c.skip_string(),
            b => {
                self.c.at += 1;
                // a routine whose name the program puts together
                if b == b'%' && self.c.peek() != b'%' && begins_line(self.c.bytes, from) {
                    self.names.fork(Fork::Anywhere);
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

    /// What a name is called among all names: arguments of a routine are its own.
    pub(super) fn key(&self, name: &[u8]) -> u64 {
        key(&self.parameters, name)
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
            let name = hashed(self.c.word());
            self.names.routine(name);
            self.within = name;
            self.parameters = self.routines.get(&name).cloned().unwrap_or_default();
        } else if is(&[b"endproc", b"endfunc", b"endtrap"]) {
            self.names.end(Some(Fork::Anywhere));
            self.parameters.clear();
        } else if is(&[b"error", b"undo", b"backward", b"callbyvar"]) && begins_line(self.c.bytes, from) {
            self.names.fork(Fork::Anywhere);
        } else if is(&[b"for", b"while"]) {
            self.names.fork(Fork::Repeats);
        } else if is(&[b"if"]) {
            // `IF c THEN ... ENDIF`, or one instruction behind the condition
            if mentions(self.c.clone().until(b";"), b"THEN") {
                self.names.fork(Fork::Opens);
            }
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

    /// `CONST num h:=200;`
    fn constant(&mut self) {
        self.c.skip_space();
        let name = self.c.word();
        if name.is_empty() || !(self.c.eat(b':') && self.c.eat(b'=')) {
            return;
        }
        let value = self.constants.expression(&mut self.c).filter(|_| self.c.eat(b';'));
        match value {
            Some((_, value)) => self.constants.define(hashed(name), value),
            None => self.constants.forget(hashed(name)),
        }
    }

    /// `p:=[[...]]`, `p:=q`, `p:=Offs(q,...)`, `p.trans.z:=...`, `p{i}:=...`: data that the program sets.
    fn assignment(&mut self, from: usize, word: &[u8]) {
        let start = self.c;
        let mut is_part = false;
        loop {
            match self.c.peek() {
                b'.' => {
                    self.c.at += 1;
                    is_part |= !self.c.word().is_empty();
                }
                b'{' => self.c.skip_past(b'}', b";\n"),
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
        } else if self.c.peek() == b'[' {
            self.define(Span::new(from, from + word.len()));
        } else {
            let start = self.c;
            let source = self.c.word();
            if source.is_empty() {
                return;
            }
            match self.source(from, source, b";{") {
                Some(origin) => self.names.set_from(name, origin),
                None => self.c = start,
            }
        }
    }

    /// Where data come from that are set from what begins with this word, a name before one of `ends`; `None` is no target.
    pub(super) fn source(&mut self, from: usize, word: &[u8], ends: &[u8]) -> Option<Origin> {
        let at = from as u32;
        self.c.skip_space();
        match self.c.peek() {
            b'(' => Some(match self.relative(word) {
                Place::Name { name, .. } => Origin::Name { name, at },
                Place::Here => Origin::Here,
                _ => Origin::Computed(at),
            }),
            b'.' => Some(Origin::Computed(at)),
            b if ends.contains(&b) => Some(Origin::Name { name: self.key(word), at }),
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
        if let Some(effects) = &mut self.effects {
            effects.entry(0).or_default().own.insert(hashed(name.text(self.c.bytes)));
        }
        self.c.skip_space();
        if self.c.peek() == b'{' {
            self.c.skip_past(b'}', b";\n");
        }
        let start = self.c;
        if self.c.eat(b':') && self.c.eat(b'=') {
            self.c = start;
            self.assignment(from, name.text(self.c.bytes));
        }
    }

    pub(super) fn define(&mut self, name: Span) {
        let (first, problems) = (self.scan.spots.len(), self.scan.problems.len());
        self.name = name;
        self.list(0);
        self.name = Span::default();
        let hash = self.key(name.text(self.c.bytes));
        self.names.define(hash, first, self.scan.spots.len());
        if self.scan.problems.len() > problems {
            self.names.listed(hash);
        } else if self.scan.spots.len() == first {
            self.names.set_from(hash, Origin::Computed(name.at));
        }
    }

    /// A list, from its bracket on; its targets are taken as soon as they close, so that arrays of any length cost nothing.
    /// `None` where it does not end before the statement does.
    pub(super) fn list(&mut self, depth: usize) -> Option<Piece> {
        self.c.at += 1;
        if depth > DEEPEST {
            return None;
        }
        let mut spans = [Span::default(); 6];
        let mut pieces = [Piece::default(); 4];
        let (mut numbers, mut lists, mut others, mut unread) = (0, 0, 0, None);
        loop {
            self.c.skip_space();
            match self.c.peek() {
                b']' => {
                    self.c.at += 1;
                    break;
                }
                b'[' => {
                    let piece = self.list(depth + 1)?;
                    if let Some(to) = pieces.get_mut(lists) {
                        *to = piece;
                    }
                    lists += 1;
                }
                b',' => self.c.at += 1,
                b'"' => {
                    self.c.skip_string();
                    others += 1;
                }
                b';' => return None,
                _ if self.c.done() => return None,
                _ => {
                    let span = self.item().unwrap_or_else(|span| *unread.insert(span));
                    if let Some(to) = spans.get_mut(numbers) {
                        *to = span;
                    }
                    numbers += 1;
                }
            }
        }
        if others == 0 && lists == 0 && numbers <= 6 {
            return Some(Piece { count: numbers, spans, unread });
        }
        if others == 0 && numbers == 0 && lists <= 4 {
            self.target(&pieces[..lists]);
        }
        Some(Piece::default())
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

    /// Takes these lists as a target, where they are one: a robtarget or a jointtarget.
    fn target(&mut self, pieces: &[Piece]) {
        let bytes = self.c.bytes;
        let (p, external) = match pieces {
            [p, q, cf, external] if [p.count, q.count, cf.count, external.count] == [3, 4, 4, 6] => (p, external),
            [q, external] if [q.count, external.count] == [6, 6] => (q, external),
            _ => return,
        };
        if let Some(span) = pieces.iter().find_map(|p| p.unread) {
            return self.scan.unread(span, bytes);
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
        let values = external.spans.map(|s| self.scan.value(s, bytes).filter(|v| v.abs() < NO_AXIS));
        self.scan.external_axes(&values);
    }

    /// `tooldata name:=[...]`, `wobjdata name:=[...]`
    fn frame(&mut self, is_tool: bool) {
        self.c.skip_space();
        let name = lower(self.c.word());
        if name.is_empty() || !(self.c.eat(b':') && self.c.eat(b'=') && self.c.eat(b'[')) {
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
            self.scan.frames.tools.entry(name).or_insert(tool);
        } else {
            let frame = work_object(&truth, &values, &name);
            self.scan.frames.frames.entry(name).or_insert(frame);
        }
    }
}
