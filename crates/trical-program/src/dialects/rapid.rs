//! ABB RAPID: robtargets and jointtargets, declared or inline, single or in arrays; tooldata and wobjdata; motions.

use nalgebra::Vector3;
use trical_model::Pose;
use trical_model::pose::rotation_from_quaternion;

use crate::branch::Configuration;
use crate::frames::ToolFrame;
use crate::literal::Shape;
use crate::scan::{Names, Scan, Setup, Visit, Way, hashed};
use crate::text::{Cursor, Span, lower, number};

/// Beginnings of instructions that move the arm, in lower case.
const MOTIONS: [&[u8]; 8] = [b"move", b"trigg", b"search", b"arc", b"spot", b"paint", b"disp", b"cap"];
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
pub fn scan(bytes: &[u8]) -> Scan {
    let mut reader =
        Reader { c: Cursor::new(bytes, b'!'), scan: Scan::default(), names: Names::default(), name: Span::default() };
    reader.scan.frames.tools.insert("tool0".into(), Ok(ToolFrame::massless(Pose::identity())));
    reader.scan.frames.frames.insert("wobj0".into(), Ok(Pose::identity()));
    reader.file();
    let Reader { mut scan, names, .. } = reader;
    names.resolve(&mut scan);
    scan
}

struct Reader<'a> {
    c: Cursor<'a>,
    scan: Scan,
    names: Names,
    /// Name of the data that is being read.
    name: Span,
}

/// A list as far as targets care.
#[derive(Clone, Copy)]
enum Piece {
    /// Only numbers, at most six.
    Flat { count: usize, spans: [Span; 6] },
    /// Anything else; targets in it were taken.
    Other,
}

impl Reader<'_> {
    fn file(&mut self) {
        let mut before: &[u8] = b"";
        while !self.c.done() {
            self.c.skip_space();
            let from = self.c.at;
            let word = self.c.word();
            if word.is_empty() {
                match self.c.peek() {
                    b'[' => self.list(0),
                    b'"' => {
                        self.c.skip_string();
                        Some(Piece::Other)
                    }
                    _ => {
                        self.c.at += 1;
                        None
                    }
                };
                before = b"";
                continue;
            }
            let is = |w: &str| word.eq_ignore_ascii_case(w.as_bytes());
            if is("robtarget") || is("jointtarget") {
                self.data();
            } else if is("tooldata") || is("wobjdata") {
                self.frame(is("tooldata"));
            } else if is("confl") || is("confj") {
                let at = self.c;
                if self.c.eat(b'\\') && self.c.word().eq_ignore_ascii_case(b"off") {
                    self.scan.configuration_off = true;
                } else {
                    self.c = at;
                }
            } else if MOTIONS.iter().any(|m| word.len() >= m.len() && word[..m.len()].eq_ignore_ascii_case(m))
                && ![&b"proc"[..], b"func", b"trap"].iter().any(|k| before.eq_ignore_ascii_case(k))
            {
                self.motion();
            } else {
                // p := [[...]]: data that the program sets
                let at = self.c;
                if self.c.eat(b':') && self.c.eat(b'=') && self.c.eat(b'[') {
                    self.c.at -= 1;
                    self.define(Span::new(from, from + word.len()));
                } else {
                    self.c = at;
                }
            }
            before = word;
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
        if self.c.eat(b'{') {
            while !self.c.done() && !matches!(self.c.peek(), b'}' | b';' | b'\n') {
                self.c.at += 1;
            }
            self.c.eat(b'}');
        }
        if self.c.eat(b':') && self.c.eat(b'=') && self.c.eat(b'[') {
            self.c.at -= 1;
            self.define(name);
        }
    }

    fn define(&mut self, name: Span) {
        let first = self.scan.spots.len();
        self.name = name;
        self.list(0);
        self.name = Span::default();
        self.names.define(hashed(name.text(self.c.bytes)), first, self.scan.spots.len());
    }

    /// A list, from its bracket on; its targets are taken as soon as they close, so that arrays of any length cost nothing.
    /// `None` where it does not end before the statement does.
    fn list(&mut self, depth: usize) -> Option<Piece> {
        self.c.at += 1;
        if depth > DEEPEST {
            return None;
        }
        let mut spans = [Span::default(); 6];
        let mut pieces = [Piece::Other; 4];
        let (mut numbers, mut lists, mut others) = (0, 0, 0);
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
                _ => match self.c.number() {
                    Some(span) if self.ends() => {
                        if let Some(to) = spans.get_mut(numbers) {
                            *to = span;
                        }
                        numbers += 1;
                    }
                    _ => {
                        others += 1;
                        while !self.c.done() && !matches!(self.c.peek(), b',' | b']' | b'[' | b';' | b'"' | b'!') {
                            self.c.at += 1;
                        }
                    }
                },
            }
        }
        if others == 0 && lists == 0 && numbers <= 6 {
            return Some(Piece::Flat { count: numbers, spans });
        }
        if others == 0 && numbers == 0 && lists <= 4 {
            self.target(&pieces[..lists]);
        }
        Some(Piece::Other)
    }

    /// Whether a number's text is over here: `1+2` is none.
    fn ends(&self) -> bool {
        let mut c = self.c;
        c.skip_space();
        matches!(c.peek(), b',' | b']')
    }

    fn target(&mut self, pieces: &[Piece]) {
        match *pieces {
            [
                Piece::Flat { count: 3, spans: p },
                Piece::Flat { count: 4, spans: q },
                Piece::Flat { count: 4, spans: cf },
                Piece::Flat { count: 6, .. },
            ] => {
                let bytes = self.c.bytes;
                let demanded = cf.map(|s| s.value(bytes).filter(|v| v.abs() < 1000.0).map(|v| v as i16));
                let configuration = match demanded {
                    [Some(a), Some(b), Some(c), Some(d), ..] => Configuration::Abb([a, b, c, d]),
                    _ => Configuration::Free,
                };
                let spans = [p[0], p[1], p[2], q[0], q[1], q[2], q[3], cf[0], cf[1], cf[2]];
                self.scan.push(Shape::Quaternion, &spans, configuration, self.name);
            }
            [Piece::Flat { count: 6, spans: q }, Piece::Flat { count: 6, .. }] => {
                self.scan.push(Shape::JointsDeg, &q, Configuration::Free, self.name);
            }
            _ => {}
        }
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

    /// The arguments of a motion: which targets it goes to, with which tool and work object.
    fn motion(&mut self) {
        enum Place {
            Name(u64, Way),
            Spots(u32, u32),
        }
        let mut places: Vec<Place> = Vec::new();
        let (mut tool, mut frame): (Option<String>, Option<String>) = (None, None);
        // a name that something follows is no tool
        let flush = |tool: &mut Option<String>, places: &mut Vec<Place>| {
            if let Some(name) = tool.take()
                && places.len() < 3
            {
                let way = if places.is_empty() { Way::To } else { Way::Perhaps };
                places.push(Place::Name(hashed(name.as_bytes()), way));
            }
        };
        let begin = self.c.at;
        loop {
            self.c.skip_space();
            if self.c.done() || self.c.peek() == b';' || self.c.at > begin + 4000 {
                break;
            }
            match self.c.peek() {
                b',' => self.c.at += 1,
                b'\\' => {
                    self.c.at += 1;
                    let option = self.c.word();
                    if self.c.eat(b':') {
                        self.c.eat(b'=');
                        self.c.skip_space();
                        let value = self.c.word();
                        if option.eq_ignore_ascii_case(b"wobj") {
                            frame = Some(lower(value));
                        } else if option.eq_ignore_ascii_case(b"tool") {
                            tool = Some(lower(value));
                        }
                    }
                }
                b'[' => {
                    flush(&mut tool, &mut places);
                    let first = self.scan.spots.len() as u32;
                    let whole = self.list(0).is_some();
                    let end = self.scan.spots.len() as u32;
                    if end > first {
                        places.push(Place::Spots(first, end));
                    }
                    if !whole {
                        break;
                    }
                }
                b'"' => self.c.skip_string(),
                // not the call of an instruction
                b':' | b'=' | b'(' if self.c.at <= begin + 2 => return,
                _ => {
                    let word = self.c.word();
                    if word.is_empty() {
                        if self.c.number().is_none() {
                            self.c.at += 1;
                        }
                        flush(&mut tool, &mut places);
                        continue;
                    }
                    flush(&mut tool, &mut places);
                    self.c.skip_space();
                    match self.c.peek() {
                        b'(' => {
                            if let Some((name, way)) = self.relative(word) {
                                places.push(Place::Name(name, way));
                            }
                        }
                        b'{' => {
                            self.c.at += 1;
                            self.c.skip_space();
                            let index = self.c.number().and_then(|s| s.value(self.c.bytes));
                            while !self.c.done() && !matches!(self.c.peek(), b'}' | b';') {
                                self.c.at += 1;
                            }
                            self.c.eat(b'}');
                            let way = index.filter(|k| *k >= 1.0).map_or(Way::To, |k| Way::Element(k as usize - 1));
                            places.push(Place::Name(hashed(word), way));
                        }
                        _ => tool = Some(lower(word)),
                    }
                }
            }
        }
        if places.is_empty() {
            return;
        }
        let setup = self.scan.setup(Setup { tool, frame: Some(frame.unwrap_or_else(|| "wobj0".into())) });
        for place in places {
            match place {
                Place::Name(name, way) => self.names.used(name, setup, way),
                Place::Spots(first, end) => {
                    for spot in first..end {
                        self.scan.assign(spot, setup);
                        self.names.visit(Visit::To(spot));
                    }
                }
            }
        }
    }

    /// `Offs(p,1,2,3)` or `RelTool(p,1,2,3)`, from the parenthesis on: the target's name and the way there.
    fn relative(&mut self, function: &[u8]) -> Option<(u64, Way)> {
        let in_tool = function.eq_ignore_ascii_case(b"reltool");
        let offs = function.eq_ignore_ascii_case(b"offs");
        self.c.at += 1;
        self.c.skip_space();
        let name = self.c.word();
        let (mut shift, mut plain, mut depth, mut k) = ([0.0; 3], true, 1, 0);
        while depth > 0 && !self.c.done() && self.c.peek() != b';' {
            self.c.skip_space();
            if let Some(x) = self.c.number().and_then(|s| s.value(self.c.bytes)) {
                if let Some(to) = shift.get_mut(k) {
                    *to = x * 1e-3;
                }
                k += 1;
                continue;
            }
            match self.c.peek() {
                b'(' => depth += 1,
                b')' => depth -= 1,
                b',' => {}
                // turned as well, or calculated
                _ => plain = false,
            }
            self.c.at += usize::from(self.c.peek() != b';');
        }
        if !(offs || in_tool) || name.is_empty() {
            return None;
        }
        let known = plain && k == 3;
        let way = if known { Way::Near(Vector3::from(shift), in_tool) } else { Way::Computed };
        Some((hashed(name), way))
    }
}

fn pose(v: &[f64]) -> Result<Pose, &'static str> {
    let [x, y, z, a, b, c, d] = v else { return Err("a position and a quaternion") };
    if ([a, b, c, d].iter().map(|q| *q * *q).sum::<f64>().sqrt() - 1.0).abs() > 0.01 {
        return Err("a quaternion of length 1");
    }
    Ok(Pose { rotation: rotation_from_quaternion([*a, *b, *c, *d]), translation: Vector3::new(*x, *y, *z) * 1e-3 })
}

fn tool(truth: &[bool], v: &[f64], name: &str) -> Result<ToolFrame, String> {
    if v.len() < 11 || truth.len() != 1 {
        return Err(format!(
            "the tooldata '{name}' cannot be read; expected [TRUE,[[x,y,z],[q1,q2,q3,q4]],[mass,[x,y,z],...]]"
        ));
    }
    if !truth[0] {
        return Err(format!("the tool '{name}' is stationary (robhold FALSE), which is not supported"));
    }
    let flange_from_tool = pose(&v[..7]).map_err(|e| format!("the tooldata '{name}': expected {e}"))?;
    // -1 means that nobody has said
    let mass = v[7].max(0.0);
    Ok(ToolFrame { flange_from_tool, mass, cog: Vector3::new(v[8], v[9], v[10]) * 1e-3 })
}

fn work_object(truth: &[bool], v: &[f64], name: &str) -> Result<Pose, String> {
    let ([robhold, fixed, ..], 14) = (truth, v.len()) else {
        return Err(format!(
            "the wobjdata '{name}' cannot be read; expected [FALSE,TRUE,\"\",[[x,y,z],[q1,q2,q3,q4]],[[x,y,z],[q1,q2,q3,q4]]]"
        ));
    };
    if *robhold {
        return Err(format!("the work object '{name}' is held by the robot (robhold TRUE), which is not supported"));
    }
    if !fixed {
        return Err(format!(
            "the work object '{name}' is moved by a mechanical unit (ufprog FALSE), which is not supported"
        ));
    }
    let part = |v: &[f64]| pose(v).map_err(|e| format!("the wobjdata '{name}': expected {e}"));
    Ok(part(&v[..7])?.compose(&part(&v[7..])?))
}
