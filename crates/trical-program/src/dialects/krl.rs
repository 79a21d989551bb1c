//! KUKA KRL: E6POS, POS, FRAME, E6AXIS and AXIS data in .dat and .src, inline targets, $TOOL and $BASE.
//!
//! A target of a .dat file is meant with the tool and base that its motion data say (`XP1` goes with `FP1`), those of a .src
//! with what `$TOOL`, `$BASE` or `BAS(#TOOL,n)` said above the motion. Angles: `R = Rz(A) Ry(B) Rx(C)`.

use std::collections::{HashMap, HashSet};

use nalgebra::Vector3;
use trical_model::Pose;
use trical_model::pose::rotation_zyx;

use crate::branch::Configuration;
use crate::frames::ToolFrame;
use crate::literal::Shape;
use crate::scan::{Names, Scan, Setup, Visit, Way, hashed};
use crate::text::{Cursor, Span, lower, moved_to};

const POSE: [&[u8]; 6] = [b"X", b"Y", b"Z", b"A", b"B", b"C"];
const AXES: [&[u8]; 6] = [b"A1", b"A2", b"A3", b"A4", b"A5", b"A6"];
const MOTIONS: [&[u8]; 6] = [b"PTP", b"LIN", b"CIRC", b"SPTP", b"SLIN", b"SCIRC"];
const RELATIVE: [&[u8]; 6] = [b"PTP_REL", b"LIN_REL", b"CIRC_REL", b"SPTP_REL", b"SLIN_REL", b"SCIRC_REL"];
const TYPES: [&[u8]; 5] = [b"E6POS", b"POS", b"FRAME", b"E6AXIS", b"AXIS"];

/// Where the mark goes: behind the `&ACCESS` lines, which must come first.
#[must_use]
pub fn header(bytes: &[u8]) -> usize {
    let mut at = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
    while bytes.get(at) == Some(&b'&') {
        match bytes[at..].iter().position(|b| *b == b'\n') {
            Some(k) => at += k + 1,
            None => return at,
        }
    }
    at
}

/// Reads a .src or .dat file.
#[must_use]
pub fn scan(bytes: &[u8]) -> Scan {
    let mut reader = Reader {
        c: Cursor::new(bytes, b';'),
        scan: Scan::default(),
        names: Names::default(),
        moved_to: targets(bytes),
        now: Setup::default(),
        motion_data: HashMap::new(),
    };
    reader.scan.frames.tools.insert("0".into(), Ok(ToolFrame::massless(Pose::identity())));
    reader.scan.frames.frames.insert("0".into(), Ok(Pose::identity()));
    reader.file();
    let mut said: Vec<(u64, u32)> = std::mem::take(&mut reader.motion_data).into_iter().collect();
    said.sort_unstable();
    for (name, setup) in said {
        reader.names.used(name, setup, Way::Said);
    }
    let Reader { mut scan, names, .. } = reader;
    names.resolve(&mut scan);
    scan
}

/// Names that motions go to: a FRAME that none goes to is no target.
fn targets(bytes: &[u8]) -> HashSet<u64> {
    moved_to(bytes, b';', |word, c, found| {
        let mut more = is_one_of(word, &MOTIONS);
        while more {
            c.skip_blank();
            let name = c.word();
            found.insert(hashed(name));
            c.skip_blank();
            more = !name.is_empty() && c.peek() == b',';
            c.at += usize::from(more);
        }
    })
}

fn is_one_of(word: &[u8], list: &[&[u8]]) -> bool {
    list.iter().any(|k| word.eq_ignore_ascii_case(k))
}

/// A `{...}`: the numbers by name.
#[derive(Clone, Copy, Default)]
struct Aggregate {
    pose: [Option<Span>; 6],
    axes: [Option<Span>; 6],
    status: Option<Span>,
    turn: Option<Span>,
    tool: Option<Span>,
    base: Option<Span>,
    /// Fields that are not plain numbers.
    others: bool,
}

struct Reader<'a> {
    c: Cursor<'a>,
    scan: Scan,
    names: Names,
    moved_to: HashSet<u64>,
    /// Tool and base at this place of the program.
    now: Setup,
    /// What FDAT data say of the targets that go with them.
    motion_data: HashMap<u64, u32>,
}

impl Reader<'_> {
    fn file(&mut self) {
        while !self.c.done() {
            self.c.skip_space();
            let from = self.c.at;
            let word = self.c.word();
            if word.is_empty() {
                match self.c.peek() {
                    b'"' => self.c.skip_string(),
                    b'{' => {
                        self.aggregate();
                    }
                    _ => self.c.at += 1,
                }
                continue;
            }
            if is_one_of(word, &MOTIONS) {
                self.motion();
            } else if is_one_of(word, &RELATIVE) {
                self.names.visit(Visit::Unknown);
                self.c.skip_line();
            } else if is_one_of(word, &TYPES) {
                self.data(word.eq_ignore_ascii_case(b"FRAME"));
            } else if word.eq_ignore_ascii_case(b"FDAT") {
                self.c.skip_blank();
                let name = self.c.word();
                if self.c.eat(b'=') {
                    self.motion_data(name);
                }
            } else if word.eq_ignore_ascii_case(b"BAS") {
                self.bas();
            } else {
                self.assignment(from, word);
            }
        }
    }

    /// `NAME=...`, `NAME[1]=...`
    fn assignment(&mut self, from: usize, word: &[u8]) {
        self.c.skip_blank();
        let mut index = None;
        let start = self.c.at;
        if self.c.peek() == b'[' {
            self.c.at += 1;
            self.c.skip_blank();
            index = self.c.number().map(|s| lower(s.text(self.c.bytes)));
            self.c.skip_blank();
            if self.c.peek() != b']' {
                self.c.at = start;
                return;
            }
            self.c.at += 1;
            self.c.skip_blank();
        }
        if self.c.peek() != b'=' {
            return;
        }
        self.c.at += 1;
        self.c.skip_blank();
        let is = |w: &str| word.eq_ignore_ascii_case(w.as_bytes());
        if is("$TOOL") || is("$BASE") {
            let name = self.current(is("$TOOL"));
            let slot = if is("$TOOL") { &mut self.now.tool } else { &mut self.now.frame };
            *slot = Some(name);
        } else if self.c.peek() == b'{' {
            let found = self.aggregate();
            if is("TOOL_DATA") {
                if let Some(n) = index {
                    let tool = self.frame(&found).map(ToolFrame::massless);
                    self.scan.frames.tools.entry(n).or_insert(tool);
                }
            } else if is("BASE_DATA") {
                if let Some(n) = index {
                    let frame = self.frame(&found);
                    self.scan.frames.frames.entry(n).or_insert(frame);
                }
            } else if found.is_target() {
                self.define(&found, Span::new(from, from + word.len()));
            }
        } else if is("FDAT_ACT") {
            let name = self.c.word();
            let known = self.motion_data.get(&target_of(name)).copied();
            if let Some(setup) = known.and_then(|s| self.scan.setups.get(s as usize)) {
                self.now = setup.clone();
            }
        }
    }

    /// What is behind `$TOOL=` or `$BASE=`.
    fn current(&mut self, is_tool: bool) -> String {
        if self.c.peek() == b'{' {
            let at = self.c.at;
            let found = self.aggregate();
            let frame = self.frame(&found);
            let name = format!("{} at byte {at}", if is_tool { "$tool" } else { "$base" });
            if is_tool {
                self.scan.frames.tools.insert(name.clone(), frame.map(ToolFrame::massless));
            } else {
                self.scan.frames.frames.insert(name.clone(), frame);
            }
            return name;
        }
        let word = self.c.word();
        if word.eq_ignore_ascii_case(b"$NULLFRAME") {
            return "0".into();
        }
        self.c.skip_blank();
        if (word.eq_ignore_ascii_case(b"TOOL_DATA") || word.eq_ignore_ascii_case(b"BASE_DATA")) && self.c.peek() == b'['
        {
            self.c.at += 1;
            self.c.skip_blank();
            if let Some(n) = self.c.number() {
                return lower(n.text(self.c.bytes));
            }
        }
        // calculated: $BASE = A : B
        let name = lower(word);
        if self.c.peek() == b':' || name.is_empty() { format!("{name}: (computed)") } else { name }
    }

    /// `BAS(#TOOL,1)`, `BAS(#BASE,2)`
    fn bas(&mut self) {
        if !(self.c.eat(b'(') && self.c.eat(b'#')) {
            return;
        }
        let what = self.c.word();
        if self.c.eat(b',') {
            self.c.skip_blank();
            let n = self.c.number().map(|n| lower(n.text(self.c.bytes)));
            if what.eq_ignore_ascii_case(b"TOOL") {
                self.now.tool = Some(n.unwrap_or_else(|| "(computed)".into()));
            } else if what.eq_ignore_ascii_case(b"BASE") {
                self.now.frame = Some(n.unwrap_or_else(|| "(computed)".into()));
            }
        }
    }

    fn motion_data(&mut self, name: &[u8]) {
        if self.c.peek() != b'{' {
            self.c.skip_blank();
        }
        if self.c.peek() != b'{' {
            return;
        }
        let found = self.aggregate();
        let text = |s: Option<Span>| s.map(|s| lower(s.text(self.c.bytes)));
        let setup = Setup { tool: text(found.tool), frame: text(found.base) };
        if setup != Setup::default() {
            let setup = self.scan.setup(setup);
            self.motion_data.insert(target_of(name), setup);
        }
    }

    /// `E6POS NAME={...}`
    fn data(&mut self, is_frame: bool) {
        self.c.skip_blank();
        let from = self.c.at;
        let name = self.c.word();
        let name_span = Span::new(from, from + name.len());
        self.c.skip_blank();
        if self.c.peek() != b'=' {
            return;
        }
        self.c.at += 1;
        self.c.skip_blank();
        if self.c.peek() != b'{' {
            return;
        }
        let found = self.aggregate();
        if is_frame && !self.moved_to.contains(&hashed(name)) {
            let frame = self.frame(&found);
            self.scan.frames.tools.insert(lower(name), frame.clone().map(ToolFrame::massless));
            self.scan.frames.frames.insert(lower(name), frame);
        } else {
            self.define(&found, name_span);
        }
    }

    fn define(&mut self, found: &Aggregate, name: Span) {
        let first = self.scan.spots.len();
        self.target(found, name);
        self.names.define(hashed(name.text(self.c.bytes)), first, self.scan.spots.len());
    }

    /// `LIN {...} C_DIS`, `LIN XP1`, `CIRC P1,P2,CA 90`, `LIN XP1:{...}`
    fn motion(&mut self) {
        loop {
            self.c.skip_blank();
            if self.c.peek() == b'{' {
                let at = self.c.at;
                let found = self.aggregate();
                if !self.relative() {
                    match self.target(&found, Span::default()) {
                        Some(spot) => {
                            let setup = self.scan.setup(self.now.clone());
                            self.scan.assign(spot, setup);
                            self.names.visit(Visit::To(spot));
                        }
                        None if found.others => self.names.visit(Visit::Unknown),
                        None => {
                            let what = "gives some of its coordinates only; the others are those of the target before";
                            self.scan.problems.push((at, what.into()));
                            self.names.visit(Visit::Unknown);
                        }
                    }
                }
            } else {
                let word = self.c.word();
                if word.is_empty() || word.eq_ignore_ascii_case(b"CA") {
                    return;
                }
                self.c.skip_blank();
                let way = if self.relative() || self.c.peek() == b'[' { Way::Computed } else { Way::To };
                let setup = self.scan.setup(self.now.clone());
                self.names.used(hashed(word), setup, way);
            }
            self.c.skip_blank();
            if self.c.peek() != b',' {
                return;
            }
            self.c.at += 1;
        }
    }

    /// Whether the geometric operator follows: the place is relative to a frame.
    fn relative(&mut self) -> bool {
        self.c.skip_blank();
        if self.c.peek() != b':' {
            return false;
        }
        while !self.c.done() && !matches!(self.c.peek(), b',' | b'\n' | b'\r' | b';') {
            if self.c.peek() == b'{' {
                self.aggregate();
            } else {
                self.c.at += 1;
            }
        }
        self.names.visit(Visit::Unknown);
        true
    }

    /// A `{...}`, from its brace on, to its end or the line's.
    fn aggregate(&mut self) -> Aggregate {
        let mut out = Aggregate::default();
        let mut depth = 0;
        while !self.c.done() && !matches!(self.c.peek(), b'\n' | b'\r' | b';') {
            self.c.skip_blank();
            match self.c.peek() {
                b'{' => depth += 1,
                b'}' => depth -= 1,
                b'"' => {
                    self.c.skip_string();
                    continue;
                }
                _ => {
                    let name = self.c.word();
                    if !name.is_empty() {
                        self.c.skip_blank();
                        let value = self.c.number().filter(|_| self.field_ends());
                        if depth == 1 && self.c.peek() != b':' {
                            out.put(name, value);
                        }
                        continue;
                    }
                }
            }
            self.c.at += 1;
            if depth <= 0 {
                break;
            }
        }
        out
    }

    fn field_ends(&self) -> bool {
        let mut c = self.c;
        c.skip_blank();
        matches!(c.peek(), b',' | b'}')
    }

    fn target(&mut self, found: &Aggregate, name: Span) -> Option<u32> {
        if let Some(spans) = all(&found.pose) {
            let small = |s: Option<Span>| {
                s.and_then(|s| s.value(self.c.bytes)).filter(|v| (0.0..256.0).contains(v)).map(|v| v as u8)
            };
            let configuration = Configuration::Kuka { s: small(found.status), t: small(found.turn) };
            // a turn in binary is longer than what would replace it
            let turn = found.turn.filter(|t| !t.text(self.c.bytes).starts_with(b"'"));
            let mut list = spans.to_vec();
            list.extend(turn);
            let free = found.status.is_none() && found.turn.is_none();
            let configuration = if free { Configuration::Free } else { configuration };
            return Some(self.scan.push(Shape::Zyx, &list, configuration, name));
        }
        let spans = all(&found.axes)?;
        Some(self.scan.push(Shape::JointsDeg, &spans, Configuration::Free, name))
    }

    fn frame(&self, found: &Aggregate) -> Result<Pose, String> {
        let Some(spans) = all(&found.pose) else {
            return Err("its frame is not given by six numbers X, Y, Z, A, B, C".into());
        };
        let v = spans.map(|s| s.value(self.c.bytes).unwrap_or(f64::NAN));
        Ok(Pose {
            rotation: rotation_zyx(v[3].to_radians(), v[4].to_radians(), v[5].to_radians()),
            translation: Vector3::new(v[0], v[1], v[2]) * 1e-3,
        })
    }
}

/// XP1 goes with FP1.
fn target_of(motion_data: &[u8]) -> u64 {
    let mut name = motion_data.to_vec();
    if let Some(first) = name.first_mut() {
        *first = b'X';
    }
    hashed(&name)
}

fn all(spans: &[Option<Span>; 6]) -> Option<[Span; 6]> {
    let [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f)] = *spans else { return None };
    Some([a, b, c, d, e, f])
}

impl Aggregate {
    fn is_target(&self) -> bool {
        all(&self.pose).is_some() || all(&self.axes).is_some()
    }

    fn put(&mut self, name: &[u8], value: Option<Span>) {
        let at = |list: &[&[u8]; 6]| list.iter().position(|n| name.eq_ignore_ascii_case(n));
        let slot = if let Some(k) = at(&POSE) {
            &mut self.pose[k]
        } else if let Some(k) = at(&AXES) {
            &mut self.axes[k]
        } else if name.eq_ignore_ascii_case(b"S") {
            &mut self.status
        } else if name.eq_ignore_ascii_case(b"T") {
            &mut self.turn
        } else if name.eq_ignore_ascii_case(b"TOOL_NO") {
            &mut self.tool
        } else if name.eq_ignore_ascii_case(b"BASE_NO") {
            &mut self.base
        } else {
            return;
        };
        self.others |= value.is_none();
        *slot = value;
    }
}
