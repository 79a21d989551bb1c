//! Data: targets in lists of any depth, and the names that they are given to; tools and work objects.

use super::frames::{tool, work_object};
use super::parts::Piece;
use super::reader::{Element, Reader};
use super::records::Kind;
use crate::branch::Configuration;
use crate::frames::declare;
use crate::literal::Shape;
use crate::names::Origin;
use crate::other_use::OtherUse;
use crate::packed::External;
use crate::reaching::Part;
use crate::scan::hashed;
use crate::text::{Span, is_letter, lower};

/// Values of external axes from here on mean that there is none (9E9).
const NO_AXIS: f64 = 1e8;
/// Lists inside lists, at most: a record of arrays of targets has five.
const DEEPEST: usize = 12;

impl Reader<'_> {
    /// `robtarget name{3}:=[...]`, or data of a record
    pub(super) fn data(&mut self, kind: Kind) {
        self.c.skip_space();
        let from = self.c.at;
        let name = self.c.word();
        let name = Span::new(from, from + name.len());
        if name.len == 0 {
            return;
        }
        let text = name.text(self.c.bytes);
        self.own(text);
        let hash = self.key(text);
        self.names.declare(hash);
        if self.within.is_empty() {
            match &mut self.exports {
                Some(exports) => drop(exports.own.insert(hash)),
                None if self.is_local => drop(self.wanted.remove(&hash)),
                None => {}
            }
        }
        self.c.skip_space();
        self.record_data.insert(hash, kind);
        if self.c.peek() == b'{' {
            if kind == Kind::Target {
                self.arrays.insert(hash);
            }
            self.c.skip_past(b'}', b";\n");
        }
        let start = self.c;
        if self.c.eat(b':') && self.c.eat(b'=') {
            self.c = start;
            self.assignment(from, text);
        } else if kind == Kind::Target || self.records.are_targets(kind) {
            self.unset.insert(hash);
        }
    }

    pub(super) fn define(&mut self, name: Span, part: Part) {
        let (first, problems) = (self.scan.spots.len(), self.scan.problems.len());
        self.name = name;
        self.placeholders = false;
        self.list(0);
        self.name = Span::default();
        let hash = self.key(name.text(self.c.bytes));
        let end = self.scan.spots.len();
        let bytes = self.c.bytes;
        let is_name = |given: Span| given.text(bytes).trim_ascii().iter().all(|b| is_letter(*b));
        let holds_names = self.elements.iter().any(|element| element.name.is_some_and(is_name));
        let holds_others = self.placeholders || self.elements.iter().any(|element| element.name.is_some());
        let holds_others = holds_names || holds_others && end > first;
        let is_array = self.arrays.contains(&hash) && part == Part::Whole;
        if is_array && holds_others {
            self.define_elements(hash, first);
        } else {
            self.names.define_part(hash, part, first, end);
        }
        if self.scan.problems.len() > problems {
            self.names.listed(hash);
        } else if self.placeholders {
            self.unset.insert(hash);
        } else if end == first && !(is_array && holds_names) {
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
            let name = self.key(self.name.text(bytes));
            self.names.placeholder(name, (p.spans[0].at as usize, self.name));
            self.placeholders = true;
            return true;
        }
        let values = external.spans.map(|s| self.scan.value(s, bytes).filter(|v| v.abs() < NO_AXIS));
        let external = External::of(&values);
        if let [_, q, cf, _] = pieces {
            let demanded = cf.spans.map(|s| self.scan.value(s, bytes).filter(|v| v.abs() < 1000.0).map(|v| v as i16));
            let configuration = match demanded {
                [Some(a), Some(b), Some(c), Some(d), ..] => Configuration::Abb([a, b, c, d]),
                _ => Configuration::Free,
            };
            let (p, q, cf) = (p.spans, q.spans, cf.spans);
            let spans = [p[0], p[1], p[2], q[0], q[1], q[2], q[3], cf[0], cf[1], cf[2]];
            self.scan.push(Shape::Quaternion, &spans, configuration, self.name, external);
        } else {
            self.scan.push(Shape::JointsDeg, &p.spans, Configuration::Free, self.name, external);
        }
        let named: Vec<_> = pieces.iter().filter_map(|p| Some((p.name?, p.numbers().to_vec()))).collect();
        if !named.is_empty() {
            self.scan.named_parts(p.name.unwrap_or(p.spans[0]).at, named);
        }
        true
    }

    /// `tooldata name:=[...]`, `wobjdata name:=[...]`
    pub(super) fn frame(&mut self, is_tool: bool, is_data: bool) {
        let word = self.c.name_ahead();
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
            if is_argument {
                self.takes_frame(&name, word);
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
                b';' => break,
                _ => {
                    if let Some((_, value)) = self.constants.expression(&mut self.c) {
                        values.push(value);
                        continue;
                    }
                    // TRUE and FALSE, or a name without a value, which is one word too many
                    let word = self.c.word();
                    if !word.is_empty() {
                        words.push(lower(word));
                        continue;
                    }
                }
            }
            self.c.at += 1;
        }
        let truth: Vec<bool> = words.iter().map(|w| w == "true").collect();
        let read = if is_tool { tool } else { work_object };
        let frame = read(&truth, &values, &name);
        let twice = format!("'{name}' is declared more than once, with different numbers");
        declare(self.scan.frames.of_mut(is_tool), name, frame, &twice);
    }
}

impl Reader<'_> {
    /// Past the components behind the name of a record's data, if the last may be a target.
    pub(super) fn component(&mut self, name: u64) -> bool {
        let start = self.c;
        let mut kind = self.record_data.get(&name).copied();
        while self.c.eat(b'.') {
            let part = hashed(self.c.name_ahead());
            kind = match kind {
                Some(Kind::Record(name)) => match self.records.0.get(&name) {
                    Some(parts) => parts.get(&part).copied(),
                    None => Some(Kind::Target),
                },
                _ => None,
            };
        }
        let is_target = kind.is_some_and(|kind| self.records.hold_targets(kind));
        if !is_target {
            self.c = start;
        }
        is_target
    }

    /// Notes the single angles that stand before the cursor.
    pub(super) fn note_angles(&mut self) {
        while let Some((at, name)) = self.single_angles.pop_front_if(|(at, _)| *at < self.c.at) {
            self.names.also_used(self.key(name), OtherUse::OneAngle(at as u32));
        }
    }
}
