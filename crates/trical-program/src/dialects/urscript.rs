//! Universal Robots script: `p[x,y,z,rx,ry,rz]` in m and rad, and joint values in rad.
//!
//! Targets are what `movej`, `movel`, `movep`, `movec` and `servoj` go to: literals, or names of literals, by themselves or in
//! `get_inverse_kin(...)`. Numbers may be expressions of what is assigned once. `set_tcp(p[...])` declares the tool from there on.
//! `pose_trans(name, p[...])` is relative to a target that is rewritten and stays, or, where no motion goes to `name`, a target in
//! that frame. A motion to what the program calculates is listed. Where loads are set (`set_payload`) is only noted.

use std::collections::{HashMap, HashSet};

use trical_model::{Joints, Pose};

use crate::branch::Configuration;
use crate::expression::Constants;
use crate::flow::Flow;
use crate::frames::{AT, ToolFrame, named};
use crate::literal::{Meant, Shape};
use crate::names::{Names, Origin, Way};
use crate::scan::{Fork, Scan, Setup, Visit, hashed};
use crate::text::{Cursor, Span, lower, mentions};

const MOTIONS: [&[u8]; 8] = [b"movej", b"movel", b"movep", b"movec", b"servoj", b"servoc", b"optimovej", b"optimovel"];
/// Functions that say where the arm is.
const HERE: [&[u8]; 6] = [
    b"get_actual_tcp_pose",
    b"get_target_tcp_pose",
    b"get_forward_kin",
    b"get_actual_joint_positions",
    b"get_target_joint_positions",
    b"get_joint_positions",
];
/// Functions behind which motions end elsewhere than they say.
const DISPLACES: [&[u8]; 4] = [b"track_conveyor_linear", b"track_conveyor_circular", b"path_offset_set", b"force_mode"];
/// Functions that move the arm to where the script does not say, or let a person or a force do so.
const ELSEWHERE: [&[u8]; 5] = [b"speedl", b"speedj", b"freedrive_mode", b"teach_mode", b"end_force_mode"];
/// Functions that say what the arm carries.
const LOADS: [&[u8]; 3] = [b"set_payload", b"set_payload_mass", b"set_target_payload"];
/// Functions inside functions, at most.
const DEEPEST: usize = 8;

/// Reads a script.
#[must_use]
pub fn scan(bytes: &[u8]) -> Scan {
    let (constants, moved_to, unsteady) = (constants(bytes), targets(bytes), unsteady(bytes));
    let pass = |flow: Flow| {
        let mut reader = Reader {
            c: Cursor::new(bytes, b'#'),
            scan: Scan::default(),
            names: Names::default(),
            constants: &constants,
            moved_to: &moved_to,
            unsteady: &unsteady,
            now: Setup::default(),
            flow,
            values: HashMap::new(),
            joints: HashMap::new(),
        };
        reader.file();
        (std::mem::take(&mut reader.flow), reader)
    };
    let reader = Flow::read(pass, |r| &mut r.scan, None);
    let Reader { mut scan, names, .. } = reader;
    names.resolve(&mut scan, bytes, &|name| {
        format!("goes to '{}', which the script does not give as numbers", String::from_utf8_lossy(name))
    });
    scan
}

fn is_motion(word: &[u8]) -> bool {
    MOTIONS.contains(&word)
}

/// Whether a circle: by way of its first place.
fn has_two(motion: &[u8]) -> bool {
    motion == b"movec" || motion == b"servoc"
}

/// What is assigned once, a number, and is no argument of a function.
fn constants(bytes: &[u8]) -> Constants {
    let mut found = Constants::default();
    let mut assigned: HashSet<u64> = HashSet::new();
    let mut c = Cursor::new(bytes, b'#');
    while let Some((_, word)) = c.next_word() {
        c.skip_blank();
        if word == b"def" || word == b"thread" {
            c.word();
            while !c.done() && !matches!(c.peek(), b')' | b'\n') {
                let name = c.word();
                if name.is_empty() {
                    c.at += 1;
                } else {
                    found.forget(hashed(name));
                }
            }
        } else if c.peek() == b'(' && is_motion(word) {
            // its options (`a=1.2`) are no assignments
            c.at += c.until(b"\n").len();
        } else if c.assigns() {
            c.at += 1;
            let value = found.expression(&mut c).map(|(_, value)| value);
            c.skip_blank();
            let whole = value.filter(|_| c.done() || matches!(c.peek(), b'\n' | b'\r' | b'#'));
            match (assigned.insert(hashed(word)), whole) {
                (true, Some(value)) => found.define(hashed(word), value),
                _ => found.forget(hashed(word)),
            }
        }
    }
    found
}

/// Names that stand first in a motion, also inside a function: only these are targets when they are assigned.
fn targets(bytes: &[u8]) -> HashSet<u64> {
    let (mut all, mut copies) = (HashSet::new(), Vec::new());
    let mut c = Cursor::new(bytes, b'#');
    while let Some((_, word)) = c.next_word() {
        let start = c;
        if c.eat_in_line(b'=') {
            let source = c.word();
            c.skip_blank();
            if !source.is_empty() && matches!(c.peek(), b'\n' | b'\r' | b'#' | 0) {
                copies.push((hashed(word), hashed(source)));
            }
        }
        c = start;
        let mut more = is_motion(word) && c.eat(b'(');
        // a circle goes by way of its first
        for _ in 0..2 {
            if !more {
                break;
            }
            c.skip_space();
            let mut name = c.word();
            if name == b"get_inverse_kin" && c.eat(b'(') {
                c.skip_space();
                name = c.word();
            }
            if !name.is_empty() {
                all.insert(hashed(name));
            }
            more = has_two(word) && c.eat(b',');
        }
    }
    // what is copied to a target is one itself; the last copy comes first
    for (copy, source) in copies.into_iter().rev() {
        if all.contains(&copy) {
            all.insert(source);
        }
    }
    all
}

/// Names that are assigned several times, not all of them along one function outside of its branches and loops, or used elsewhere: of
/// these the text above does not say the value.
fn unsteady(bytes: &[u8]) -> HashSet<u64> {
    /// In which function a name stands first, how often it is assigned, and whether in a block or seen in another function.
    type Seen = (usize, u32, bool);
    let mut names: HashMap<u64, Seen> = HashMap::new();
    // the functions and blocks that are open: the number of a function
    let mut open: Vec<Option<usize>> = Vec::new();
    let mut functions = 0;
    let mut c = Cursor::new(bytes, b'#');
    while let Some((_, word)) = c.next_word() {
        match word {
            b"def" | b"thread" => {
                functions += 1;
                open.push(Some(functions));
            }
            b"while" | b"if" | b"for" => open.push(None),
            b"end" => drop(open.pop()),
            _ => {
                c.skip_blank();
                let assigned = c.assigns();
                let function = open.iter().rev().find_map(|f| *f).unwrap_or(0);
                let (first, count, elsewhere) = names.entry(hashed(word)).or_insert((function, 0, false));
                *count = count.saturating_add(u32::from(assigned));
                *elsewhere |= *first != function || assigned && open.last() == Some(&None);
            }
        }
    }
    names.into_iter().filter(|(_, (_, count, elsewhere))| *count > 1 && *elsewhere).map(|(name, _)| name).collect()
}

struct Reader<'a> {
    c: Cursor<'a>,
    scan: Scan,
    names: Names,
    constants: &'a Constants,
    moved_to: &'a HashSet<u64>,
    unsteady: &'a HashSet<u64>,
    now: Setup,
    flow: Flow,
    /// Poses by name, for `set_tcp(name)` and `pose_trans(name, ...)`: the latest; `None` where nobody knows which that is.
    values: HashMap<u64, Option<Pose>>,
    /// Joint values by name, for `qnear=name`; the latest.
    joints: HashMap<u64, Joints>,
}

impl Reader<'_> {
    fn file(&mut self) {
        while let Some((from, word)) = self.c.next_word() {
            if is_motion(word) {
                if self.c.eat(b'(') {
                    let inside = self.c;
                    self.motion(has_two(word));
                    // what else stands there (`a=1.2`) assigns nothing
                    self.c = inside;
                    self.close();
                }
            } else if word == b"set_tcp" {
                if self.c.eat(b'(') {
                    self.set_tcp(from);
                }
            } else if LOADS.contains(&word) {
                self.scan.loads.push(from);
            } else if DISPLACES.contains(&word) {
                let what = "displaces the motions that follow; they are corrected for where the text has them";
                self.scan.problem(from, what);
            } else if ELSEWHERE.contains(&word) {
                self.names.visit(Visit::Unknown);
            } else if word.starts_with(b"mc_add_") && self.c.eat(b'(') {
                let what = "moves with the tool that mc_initialize names, which is not read";
                self.scan.problem(from, what);
                self.close();
            } else if !self.block(from, word) {
                self.assignment(from, word);
            }
        }
    }

    /// Words that begin or end routines, branches and loops, and calls.
    fn block(&mut self, from: usize, word: &[u8]) -> bool {
        let Self { flow, now, c, names, .. } = self;
        match word {
            b"def" | b"thread" => {
                c.skip_blank();
                let name = hashed(c.word());
                flow.routine(name, now);
                names.routine(name);
                c.skip_line();
            }
            b"return" => flow.returns(now),
            b"while" => {
                flow.repeat(from, now);
                names.fork(Fork::Repeats);
            }
            b"if" => {
                flow.branches(now, true);
                names.fork(Fork::Opens);
            }
            b"elif" | b"else" => {
                flow.branch(now, word == b"else");
                names.fork(Fork::Other);
            }
            b"end" => names.end(flow.end(now)),
            _ => {
                if flow.perhaps_called(word, c, now).is_some() {
                    names.called(hashed(word), false);
                }
                return false;
            }
        }
        true
    }

    /// `name=p[...]`, `name=[...]`, `name=other`, `name=pose_trans(other,...)`, `name[2]=...`
    fn assignment(&mut self, from: usize, word: &[u8]) {
        let start = self.c;
        let hash = hashed(word);
        let is_target = self.moved_to.contains(&hash);
        self.c.skip_blank();
        let is_element = self.c.peek() == b'[';
        if is_element {
            self.c.at += self.c.until(b"]\n").len();
            self.c.at += usize::from(self.c.peek() == b']');
        }
        if !self.c.eat(b'=') || self.c.peek() == b'=' {
            self.c = start;
            return;
        }
        let computed = Origin::Computed(from as u32);
        if is_element {
            if mentions(self.c.until(b"\n"), word) {
                self.names.changed(hash, from);
            } else if is_target {
                self.names.set_from(hash, computed);
            }
            return;
        }
        match self.literal() {
            Literal::Numbers(shape, spans) => self.assigned(Span::new(from, from + word.len()), shape, &spans),
            Literal::Unread(span) if is_target => {
                self.scan.unread(span, self.c.bytes);
                self.names.listed(hash);
            }
            Literal::Unread(_) => drop(self.values.insert(hash, None)),
            Literal::None if is_target => {
                let origin = self
                    .origin(0)
                    .map_or(computed, |o| o.map_or(Origin::Here, |name| Origin::Name { name, at: from as u32 }));
                self.names.set_from(hash, origin);
            }
            Literal::None => drop(self.values.insert(hash, None)),
        }
    }

    /// What the expression at the cursor is relative to: a name, or (`Some(None)`) where the arm is; `None` is something else.
    fn origin(&mut self, depth: usize) -> Option<Option<u64>> {
        self.c.skip_space();
        let word = self.c.word();
        if word.is_empty() || depth > DEEPEST {
            return None;
        }
        self.c.skip_blank();
        if self.c.peek() != b'(' {
            return matches!(self.c.peek(), b'\n' | b'\r' | b'#' | b',' | b')' | 0).then_some(Some(hashed(word)));
        }
        if HERE.contains(&word) {
            return Some(None);
        }
        if ![&b"pose_trans"[..], b"pose_add", b"get_inverse_kin"].contains(&word) {
            return None;
        }
        self.c.at += 1;
        self.origin(depth + 1)
    }

    fn assigned(&mut self, name: Span, shape: Shape, spans: &[Span; 6]) {
        let hash = hashed(name.text(self.c.bytes));
        if let Some(q) = self.joint_values(shape, spans) {
            self.joints.insert(hash, q);
        }
        if self.moved_to.contains(&hash) {
            let first = self.scan.spots.len();
            self.scan.push(shape, spans, Configuration::Free, name);
            self.names.define(hash, first, first + 1);
        } else if shape == Shape::RotationVector {
            let pose = self.pose(spans).filter(|_| !self.unsteady.contains(&hash));
            self.values.insert(hash, pose);
        }
    }

    fn pose(&self, spans: &[Span; 6]) -> Option<Pose> {
        let v = spans.map(|s| self.scan.value(s, self.c.bytes).unwrap_or(f64::NAN));
        match Shape::RotationVector.meant(&v, &[]) {
            Ok(Meant::Pose(pose)) if v.iter().all(|x| x.is_finite()) => Some(pose),
            _ => None,
        }
    }

    fn joint_values(&self, shape: Shape, spans: &[Span; 6]) -> Option<Joints> {
        let mut q = Joints::default();
        for (to, span) in q.iter_mut().zip(spans) {
            *to = self.scan.value(*span, self.c.bytes).filter(|_| shape == Shape::JointsRad)?;
        }
        Some(q)
    }

    /// `get_inverse_kin(place, qnear=joints)`, from its parenthesis on: of the configurations of the arm the one near these joints.
    fn nearest(&mut self) {
        let start = self.c;
        let mut depth = 0;
        // behind the comma that follows the place
        while !self.c.done() && !matches!(self.c.peek(), b'\n') {
            match self.c.peek() {
                b'(' | b'[' => depth += 1,
                b')' | b']' if depth == 0 => break,
                b')' | b']' => depth -= 1,
                b',' if depth == 0 => {
                    self.c.at += 1;
                    self.c.skip_space();
                    let at = self.c;
                    if self.c.word() != b"qnear" || !self.c.eat(b'=') {
                        self.c = at;
                    }
                    let q = match self.literal() {
                        Literal::Numbers(shape, spans) => self.joint_values(shape, &spans),
                        _ => {
                            self.c.skip_space();
                            let name = hashed(self.c.word());
                            self.joints.get(&name).copied()
                        }
                    };
                    if let Some(q) = q {
                        self.names.visit(Visit::Like(self.scan.nearest.len() as u32));
                        self.scan.nearest.push(q);
                    }
                    break;
                }
                _ => {}
            }
            self.c.at += 1;
        }
        self.c = start;
    }

    fn set_tcp(&mut self, at: usize) {
        self.c.skip_space();
        let pose = match self.literal() {
            Literal::Numbers(Shape::RotationVector, spans) => self.pose(&spans),
            _ => {
                let name = hashed(self.c.word());
                self.values.get(&name).copied().flatten()
            }
        };
        let frame = pose.ok_or("its set_tcp is computed by the program".to_owned());
        let key = match &frame {
            Ok(p) => {
                let t = p.translation * 1e3;
                format!("set_tcp({:.3}, {:.3}, {:.3} mm) first{AT}{at}", t.x, t.y, t.z)
            }
            Err(_) => format!("set_tcp{AT}{at}"),
        };
        self.now.tool = Some(named(&mut self.scan.frames.tools, key, frame.map(ToolFrame::massless)));
    }

    /// The first argument of a motion, or the first two.
    fn motion(&mut self, two: bool) {
        if self.place(None, 0) && two && self.c.eat(b',') {
            self.place(None, 0);
        }
    }

    /// A place to which a motion goes, in a frame of the script or in the base. `false` where none stands.
    fn place(&mut self, frame: Option<&str>, depth: usize) -> bool {
        self.c.skip_space();
        let at = self.c.at;
        let setup = Setup { tool: self.now.tool.clone(), frame: frame.map(str::to_owned) };
        let setup = self.scan.setup(setup);
        match self.literal() {
            Literal::Numbers(shape, spans) => {
                let spot = self.scan.push(shape, &spans, Configuration::Free, Span::default());
                self.scan.assign(spot, setup);
                self.names.visit(Visit::To(spot));
                return true;
            }
            Literal::Unread(span) => {
                self.scan.unread(span, self.c.bytes);
                self.names.visit(Visit::Unknown);
                return true;
            }
            Literal::None => {}
        }
        let word = self.c.word();
        if word.is_empty() {
            return false;
        }
        if !self.c.eat(b'(') {
            // a name, an element of a list
            let way = if self.c.peek() == b'[' { Way::Indexed } else { Way::To };
            self.names.used(hashed(word), setup, way, at);
            return true;
        }
        let inside = self.c;
        if word == b"get_inverse_kin" && mentions(self.c.until(b"\n"), b"tcp") {
            self.names.visit(Visit::Unknown);
            self.scan.problem(at, "names a tool of its own (tcp=), which is not read");
            self.names.no_target(hashed(self.c.word()));
        } else if word == b"get_inverse_kin" && depth < DEEPEST {
            self.nearest();
            self.place(frame, depth + 1);
        } else if word == b"pose_trans" || word == b"pose_add" {
            self.related(at, setup, word == b"pose_trans" && frame.is_none(), depth);
        } else {
            self.names.visit(Visit::Unknown);
            if !HERE.contains(&word) {
                self.scan.goes_to_calculated(at);
            }
        }
        self.c = inside;
        self.close();
        true
    }

    /// `pose_trans(base, pose)` or `pose_add(base, pose)`, from behind its parenthesis on.
    fn related(&mut self, at: usize, setup: u32, may_be_frame: bool, depth: usize) {
        self.c.skip_space();
        let start = self.c;
        let (literal, base) = (self.literal(), self.c.word());
        let frame = match literal {
            Literal::Numbers(Shape::RotationVector, spans) => self.pose(&spans),
            _ => self.values.get(&hashed(base)).copied().flatten(),
        };
        let is_target = self.moved_to.contains(&hashed(base));
        if let (false, true, Some(pose)) = (is_target, may_be_frame && depth < DEEPEST, frame)
            && self.c.eat(b',')
        {
            let own = if base.is_empty() { "p[...]".to_owned() } else { lower(base) };
            // set anew, it is another frame
            let is_it = |f: &Result<Pose, String>| *f == Ok(pose);
            let known = !base.is_empty() && self.scan.frames.frames.get(&own).is_none_or(is_it);
            let name = if known { own } else { format!("{own}{AT}{at}") };
            self.scan.frames.frames.insert(name.clone(), Ok(pose));
            self.place(Some(&name), depth + 1);
            return;
        }
        self.c = start;
        match self.origin(0) {
            Some(None) => self.names.visit(Visit::Unknown),
            Some(Some(name)) => self.names.used(name, setup, Way::Computed, start.at),
            None => {
                self.names.visit(Visit::Unknown);
                self.scan.goes_to_calculated(at);
            }
        }
    }

    /// To the parenthesis that closes the one that was passed.
    fn close(&mut self) {
        let mut depth = 1;
        while !self.c.done() && depth > 0 && self.c.peek() != b'\n' {
            match self.c.peek() {
                b'(' => depth += 1,
                b')' => depth -= 1,
                _ => {}
            }
            self.c.at += 1;
        }
    }

    /// `p[...]` or `[...]` of six numbers; where none stands, nothing is passed.
    fn literal(&mut self) -> Literal {
        let start = self.c;
        self.c.skip_space();
        let is_pose = self.c.peek() == b'p' && self.c.bytes.get(self.c.at + 1) == Some(&b'[');
        self.c.at += usize::from(is_pose);
        let shape = if is_pose { Shape::RotationVector } else { Shape::JointsRad };
        if self.c.peek() != b'[' {
            self.c = start;
            return Literal::None;
        }
        self.c.at += 1;
        let mut spans = [Span::default(); 6];
        let mut unread = None;
        for (k, to) in spans.iter_mut().enumerate() {
            self.c.skip_space();
            let end = if k == 5 { b']' } else { b',' };
            let at = self.c;
            if let Some(span) = self.constants.number(&mut self.c, &[end], &mut self.scan) {
                *to = span;
                self.c.eat(end);
                continue;
            }
            let mut depth = 0;
            for b in self.c.until(b"\n") {
                match b {
                    b',' | b']' if depth == 0 => break,
                    b'(' | b'[' => depth += 1,
                    b')' | b']' => depth -= 1,
                    _ => {}
                }
                self.c.at += 1;
            }
            unread = unread.or(Some(Span::new(at.at, self.c.at)));
            if !self.c.eat(end) {
                self.c = start;
                return Literal::None;
            }
        }
        unread.map_or(Literal::Numbers(shape, spans), Literal::Unread)
    }
}

/// Six numbers in brackets, or nearly.
enum Literal {
    Numbers(Shape, [Span; 6]),
    /// Six items, of which this has no value.
    Unread(Span),
    None,
}
