//! Universal Robots script: `p[x,y,z,rx,ry,rz]` in m and rad, and joint values in rad.
//!
//! Targets are what `movej`, `movel`, `movep`, `movec` and `servoj` go to: literals, or names of literals, by themselves or in
//! `get_inverse_kin(...)` or `get_forward_kin(...)`. Numbers may be expressions of what is assigned once. `set_tcp(p[...])` declares
//! the tool from there on. `pose_trans(name, p[...])` is relative to a target that is rewritten and stays, or, where no motion goes to
//! `name`, a target in that frame; so is `other` of `pose_trans(name, other)` where it stands nowhere else. A motion to what the program calculates is listed. Where loads are set (`set_payload`) is only noted.

use std::collections::{HashMap, HashSet};

use trical_model::{Joints, Pose};

use crate::branch::Configuration;
use crate::expression::Constants;
use crate::flow::Flow;
use crate::frames::{AT, ToolFrame, named};
use crate::literal::{Meant, Shape};
use crate::names::{Names, Origin, Way};
use crate::scan::{Fork, Scan, Setup, Visit, hashed_as_written as hashed};
use crate::text::{Cursor, Span, lower, mentions};

const MOTIONS: [&[u8]; 8] = [b"movej", b"movel", b"movep", b"movec", b"servoj", b"servoc", b"optimovej", b"optimovel"];
/// Functions that say where the arm is; with arguments, `get_forward_kin` says where it would be.
const HERE: [&[u8]; 6] = [
    b"get_actual_tcp_pose",
    b"get_target_tcp_pose",
    b"get_forward_kin",
    b"get_actual_joint_positions",
    b"get_target_joint_positions",
    b"get_joint_positions",
];
/// From a place to joints and back: the place is the same, with the tool that is set.
const KINEMATICS: [&[u8]; 2] = [b"get_inverse_kin", FORWARD];
const FORWARD: &[u8] = b"get_forward_kin";
/// Functions of the language that are given places and move nothing.
const SHOW: [&[u8]; 5] = [b"textmsg", b"popup", b"socket_send_string", b"socket_send_line", b"set_pos"];
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
    let constants = constants(bytes);
    let (mut moved_to, mut in_frames) = targets(bytes);
    let unsteady = unsteady(bytes, &mut in_frames);
    let (in_one, several): (Vec<_>, Vec<_>) = in_frames.into_iter().partition(|(_, uses)| uses.frame.is_some());
    let in_one: Vec<u64> = in_one.into_iter().map(|(name, _)| name).filter(|name| moved_to.insert(*name)).collect();
    let several: HashSet<u64> = several.into_iter().map(|(name, _)| name).collect();
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
            in_frames: HashMap::new(),
            bare: HashSet::new(),
            places: HashSet::new(),
            near: HashMap::new(),
            functions: HashSet::new(),
            given: Vec::new(),
        };
        reader.file();
        (std::mem::take(&mut reader.flow), reader)
    };
    let reader = Flow::read(pass, |r| &mut r.scan, None);
    let Reader { mut scan, mut names, functions, given, .. } = reader;
    for (_, at) in given.into_iter().filter(|(name, _)| !functions.contains(name)) {
        scan.problem(at, "gives a place to a function that is not in the script: where the arm goes is not corrected");
    }
    in_one.into_iter().for_each(|name| names.no_target(name));
    names.resolve(&mut scan, bytes, &|name| {
        let why = match several.contains(&hashed(name)) {
            true => "which is used in several frames, or not for this only: it could be corrected for one use",
            false => "which the script does not give as numbers",
        };
        format!("goes to '{}', {why}", String::from_utf8_lossy(name))
    });
    scan
}

fn is_motion(word: &[u8]) -> bool {
    MOTIONS.contains(&word)
}

/// Whether a circle: by way of its first place.
fn has_two(motion: &[u8]) -> bool {
    motion == b"movec"
}

/// What is assigned once, a number, and is no argument of a function.
fn constants(bytes: &[u8]) -> Constants {
    let mut found = Constants::as_written();
    let mut assigned: HashSet<u64> = HashSet::new();
    let mut c = Cursor::new(bytes, b'#');
    while let Some((_, word)) = c.next_word() {
        c.skip_blank();
        if [&b"def"[..], b"thread", b"sec"].contains(&word) {
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

/// From within an argument to the next one of the same call.
fn next_argument(c: &mut Cursor<'_>) -> bool {
    let mut depth = 0;
    for b in c.until(b"") {
        match b {
            b'(' | b'[' => depth += 1,
            b')' | b']' if depth == 0 => return false,
            b')' | b']' => depth -= 1,
            b',' if depth == 0 => {
                c.at += 1;
                c.skip_space();
                return true;
            }
            _ => {}
        }
        c.at += 1;
    }
    false
}

/// Past `name=` before an argument.
fn skip_name(c: &mut Cursor<'_>) {
    let start = *c;
    if c.word().is_empty() || !c.eat_in_line(b'=') {
        *c = start;
    }
}

/// The name of a place: `wp`, `pose=wp`, `get_inverse_kin(wp)`; and whether it stands in a function.
fn place_name(c: &mut Cursor<'_>) -> Option<(u64, bool)> {
    let mut inside = false;
    loop {
        c.skip_space();
        let name = c.word();
        let is_argument = c.eat_in_line(b'=');
        let is_function = !is_argument && c.eat_in_line(b'(');
        if name.is_empty() || is_function && !KINEMATICS.contains(&name) || name == b"p" && c.peek() == b'[' {
            return None;
        }
        if !is_argument && !is_function {
            return Some((hashed(name), inside));
        }
        inside |= is_function;
    }
}

/// How a name is used in `pose_trans(frame,name)`.
struct InFrame {
    /// The frame, by its hashed text, where it is the same everywhere, and the name stands nowhere else.
    frame: Option<u64>,
    times: u32,
}

/// Names that stand first in a motion, also inside a function: only these are targets when they are assigned. And names that stand in a frame.
fn targets(bytes: &[u8]) -> (HashSet<u64>, HashMap<u64, InFrame>) {
    let (mut all, mut copies) = (HashSet::new(), Vec::new());
    let mut in_frames: HashMap<u64, InFrame> = HashMap::new();
    let mut c = Cursor::new(bytes, b'#');
    while let Some((_, word)) = c.next_word() {
        let start = c;
        if c.eat_in_line(b'=') {
            if let Some((source, inside)) = place_name(&mut c) {
                c.skip_blank();
                let is_end = matches!(c.peek(), b'\n' | b'\r' | b'#' | 0) || inside && matches!(c.peek(), b',' | b')');
                copies.extend(is_end.then_some((hashed(word), source)));
            }
        } else if word == b"pose_trans" && c.eat(b'(') {
            let from = c.at;
            let is_second = next_argument(&mut c);
            let frame = hashed(bytes.get(from..c.at).unwrap_or(&[]).trim_ascii());
            if let (true, Some((name, _))) = (is_second, place_name(&mut c)) {
                let uses = in_frames.entry(name).or_insert(InFrame { frame: Some(frame), times: 0 });
                uses.frame = uses.frame.filter(|other| *other == frame);
                uses.times += 1;
            }
        } else if is_motion(word) && c.eat(b'(') {
            let mut second = c;
            all.extend(place_name(&mut c).map(|(name, _)| name));
            // a circle goes by way of its first
            if has_two(word) && next_argument(&mut second) {
                all.extend(place_name(&mut second).map(|(name, _)| name));
            }
        }
        c = start;
    }
    // what is copied to a target is one itself; the last copy comes first
    for (copy, source) in copies.into_iter().rev() {
        if all.contains(&copy) {
            all.insert(source);
        }
    }
    (all, in_frames)
}

/// Names that are assigned several times, not all of them along one function outside of its branches and loops, or used elsewhere: of
/// these the text above does not say the value. Of names in frames it is seen whether they stand elsewhere too.
fn unsteady(bytes: &[u8], in_frames: &mut HashMap<u64, InFrame>) -> HashSet<u64> {
    /// In which function a name stands first, how often it is assigned, whether in a block or seen in another function, and how often
    /// it is read.
    type Seen = (usize, u32, bool, u32);
    let mut names: HashMap<u64, Seen> = HashMap::new();
    // the functions and blocks that are open: the number of a function
    let mut open: Vec<Option<usize>> = Vec::new();
    let mut functions = 0;
    let mut c = Cursor::new(bytes, b'#');
    while let Some((_, word)) = c.next_word() {
        match word {
            b"def" | b"thread" | b"sec" => {
                functions += 1;
                open.push(Some(functions));
            }
            b"while" | b"if" | b"for" => open.push(None),
            b"end" => drop(open.pop()),
            _ => {
                c.skip_blank();
                let assigned = c.assigns();
                let function = open.iter().rev().find_map(|f| *f).unwrap_or(0);
                let (first, count, elsewhere, read) = names.entry(hashed(word)).or_insert((function, 0, false, 0));
                *count = count.saturating_add(u32::from(assigned));
                *read = read.saturating_add(u32::from(!assigned));
                *elsewhere |= *first != function || assigned && open.last() == Some(&None);
            }
        }
    }
    for (name, uses) in in_frames {
        let read = names.get(name).map_or(0, |(.., read)| *read);
        uses.frame = uses.frame.filter(|_| uses.times == read);
    }
    names.into_iter().filter(|(_, (_, count, elsewhere, _))| *count > 1 && *elsewhere).map(|(name, _)| name).collect()
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
    /// Frames of the script in which places are given, by the name of the place; the latest.
    in_frames: HashMap<u64, String>,
    /// Places to which a motion goes that is read before a frame is.
    bare: HashSet<u64>,
    /// Names of numbers that make a place.
    places: HashSet<u64>,
    /// Joints to which those are near that a name stands for: indices into `Scan::nearest`.
    near: HashMap<u64, u32>,
    /// Functions of the script.
    functions: HashSet<u64>,
    /// Functions that are given places, and where.
    given: Vec<(u64, usize)>,
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
        let Self { flow, now, c, names, functions, .. } = self;
        match word {
            b"def" | b"thread" | b"sec" => {
                c.skip_blank();
                let name = hashed(c.word());
                functions.insert(name);
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
                let name = hashed(word);
                if let Some(is_statement) = flow.perhaps_called_as(name, word, c, now) {
                    let is_given = is_statement && !SHOW.contains(&word) && self.is_given_place();
                    self.given.extend(is_given.then_some((name, from)));
                    self.names.called(name, is_given);
                }
                return false;
            }
        }
        true
    }

    /// Whether a place is among the arguments of a function, from behind its name on. The cursor stays.
    fn is_given_place(&mut self) -> bool {
        let start = self.c;
        let mut more = self.c.eat(b'(');
        let mut found = false;
        while more && !found {
            let argument = self.c;
            skip_name(&mut self.c);
            let is_literal = matches!(self.literal(), Literal::Numbers(..) | Literal::Unread(_));
            let word = self.c.word();
            let name = hashed(word);
            found = is_literal
                || self.moved_to.contains(&name)
                || self.places.contains(&name)
                || word.starts_with(b"pose_") && self.c.peek() == b'('
                || KINEMATICS.contains(&word);
            self.c = argument;
            more = next_argument(&mut self.c);
        }
        self.c = start;
        found
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
        let literal = self.literal();
        if !matches!(literal, Literal::None) {
            self.places.insert(hash);
        }
        match literal {
            Literal::Numbers(shape, spans) => self.assigned(Span::new(from, from + word.len()), shape, &spans),
            Literal::Unread(span) if is_target => {
                self.scan.unread(span, self.c.bytes);
                self.names.listed(hash);
            }
            Literal::Unread(_) => drop(self.values.insert(hash, None)),
            Literal::None if is_target => self.placed(Span::new(from, from + word.len())),
            Literal::None => drop(self.values.insert(hash, None)),
        }
    }

    /// A place that is set to `get_inverse_kin(p[...])`, `pose_trans(plane,p[...])`, `pose_trans(plane,other)` or to what it is relative
    /// to, from behind the equals sign on.
    fn placed(&mut self, name: Span) {
        let hash = hashed(name.text(self.c.bytes));
        let start = self.c;
        let (mut frame, mut near) = (None, None);
        for _ in 0..DEEPEST {
            self.c.skip_space();
            let at = self.c;
            let word = self.c.word();
            let is_function = self.c.eat(b'(');
            if is_function && self.is_kinematics(word) && !self.own_tool(word) && (frame.is_none() || word != FORWARD) {
                near = near.or(self.nearest());
            } else if is_function
                && word == b"pose_trans"
                && frame.is_none()
                && let Some(first) = self.frame(at.at)
            {
                frame = Some(first);
            } else {
                self.c = at;
                break;
            }
        }
        let literal = match self.literal() {
            Literal::Numbers(shape, spans) if frame.is_none() || !shape.is_joints() => Some((shape, spans)),
            _ => None,
        };
        let mut origin = Origin::Computed(name.at);
        if literal.is_none() {
            if frame.is_none() {
                self.c = start;
            }
            match self.origin(0) {
                Some(Some(other)) => match (self.own_frame(other), &frame) {
                    (Some(_), Some(_)) => {}
                    (own, _) => {
                        frame = frame.or(own);
                        origin = Origin::Name { name: other, at: name.at };
                    }
                },
                Some(None) => origin = Origin::Here,
                None => {}
            }
        }
        // a motion that is read before this does not know the frame
        if frame.is_some() && (self.unsteady.contains(&hash) || self.bare.contains(&hash)) {
            frame = None;
            self.names.set_from(hash, Origin::Computed(name.at));
        } else if let Some((shape, spans)) = literal {
            let first = self.scan.spots.len();
            self.scan.push(shape, &spans, Configuration::Free, name);
            self.names.define(hash, first, first + 1);
        } else {
            self.names.set_from(hash, origin);
        }
        self.in_frames.remove(&hash);
        self.in_frames.extend(frame.map(|frame| (hash, frame)));
        self.near.remove(&hash);
        self.near.extend(near.map(|near| (hash, near)));
    }

    /// The frame of the script in which the place of this name is given, above a motion that goes there.
    fn own_frame(&mut self, name: u64) -> Option<String> {
        let own = self.in_frames.get(&name).cloned();
        if own.is_none() {
            self.bare.insert(name);
        }
        own
    }

    /// Whether a function, from behind its parenthesis on, tells joints from a place or a place from joints.
    fn is_kinematics(&self, word: &[u8]) -> bool {
        let mut c = self.c;
        KINEMATICS.contains(&word) && !c.eat(b')')
    }

    /// Whether the arguments of `get_inverse_kin` or `get_forward_kin` name a tool, from behind the parenthesis on.
    fn own_tool(&self, word: &[u8]) -> bool {
        let mut c = self.c;
        c.skip_space();
        for _ in 0..if word == FORWARD { 1 } else { 4 } {
            let mut argument = c;
            if argument.word() == b"tcp" && argument.eat(b'=') {
                return true;
            }
            if !next_argument(&mut c) {
                return false;
            }
        }
        true
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
        self.c.at += 1;
        if self.is_kinematics(word) {
            if self.own_tool(word) {
                self.names.no_target(hashed(self.c.word()));
                return None;
            }
            return self.origin(depth + 1);
        }
        match word {
            b"pose_trans" | b"pose_add" => self.origin(depth + 1),
            _ => HERE.contains(&word).then_some(None),
        }
    }

    fn assigned(&mut self, name: Span, shape: Shape, spans: &[Span; 6]) {
        let hash = hashed(name.text(self.c.bytes));
        if let Some(q) = self.joint_values(shape, spans) {
            self.joints.insert(hash, q);
        }
        self.in_frames.remove(&hash);
        self.near.remove(&hash);
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

    /// `get_inverse_kin(place, qnear=joints)`, from its parenthesis on: of the configurations of the arm the one near these joints, an
    /// index into `Scan::nearest`. The cursor stays.
    fn nearest(&mut self) -> Option<u32> {
        let start = self.c;
        let mut found = None;
        if next_argument(&mut self.c) {
            skip_name(&mut self.c);
            found = match self.literal() {
                Literal::Numbers(shape, spans) => self.joint_values(shape, &spans),
                _ => {
                    self.c.skip_space();
                    self.joints.get(&hashed(self.c.word())).copied()
                }
            };
        }
        self.c = start;
        found.map(|q| {
            self.scan.nearest.push(q);
            self.scan.nearest.len() as u32 - 1
        })
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
        self.goes_to();
        if two && next_argument(&mut self.c) {
            self.goes_to();
        }
    }

    fn goes_to(&mut self) {
        let at = self.c.at;
        if !self.place(None, 0) {
            self.names.visit(Visit::Unknown);
            self.scan.goes_to_calculated(at);
        }
    }

    /// A place to which a motion goes, in a frame of the script or in the base. `false` where none stands.
    fn place(&mut self, frame: Option<&str>, depth: usize) -> bool {
        self.c.skip_space();
        let at = self.c.at;
        match self.literal() {
            Literal::Numbers(shape, spans) => {
                let setup = self.setup(frame);
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
        if word.is_empty() || depth > DEEPEST {
            return false;
        }
        if self.c.eat(b'=') {
            // an argument by its name
            return self.place(frame, depth + 1);
        }
        if !self.c.eat(b'(') {
            // a name, an element of a list
            let name = hashed(word);
            let own = self.own_frame(name);
            if frame.is_some() && own.is_some() {
                self.names.visit(Visit::Unknown);
                self.scan.goes_to_calculated(at);
                return true;
            }
            let way = if self.c.peek() == b'[' { Way::Indexed } else { Way::To };
            if let Some(near) = self.near.get(&name) {
                self.names.visit(Visit::Like(*near));
            }
            let setup = self.setup(frame.or(own.as_deref()));
            self.names.used(name, setup, way, at);
            return true;
        }
        let inside = self.c;
        let is_kinematics = self.is_kinematics(word);
        if is_kinematics && self.own_tool(word) {
            self.names.visit(Visit::Unknown);
            self.scan.problem(at, "names a tool of its own (tcp=), which is not read");
            self.names.no_target(hashed(self.c.word()));
        } else if is_kinematics && (frame.is_none() || word != FORWARD) {
            if let Some(near) = self.nearest() {
                self.names.visit(Visit::Like(near));
            }
            if !self.place(frame, depth + 1) {
                return false;
            }
        } else if word == b"pose_trans" || word == b"pose_add" {
            self.related(at, frame, word == b"pose_trans", depth);
        } else {
            self.names.visit(Visit::Unknown);
            if is_kinematics || !HERE.contains(&word) {
                self.scan.goes_to_calculated(at);
            }
        }
        self.c = inside;
        self.close();
        true
    }

    /// The setup of a motion in a frame of the script, or in the base.
    fn setup(&mut self, frame: Option<&str>) -> u32 {
        self.scan.setup(Setup { tool: self.now.tool.clone(), frame: frame.map(str::to_owned) })
    }

    /// The name of the frame that stands first in `pose_trans(frame, ...)` at `at`, from behind the parenthesis to behind the comma;
    /// where none stands, nothing is passed.
    fn frame(&mut self, at: usize) -> Option<String> {
        self.c.skip_space();
        let start = self.c;
        let (literal, base) = (self.literal(), self.c.word());
        let frame = match literal {
            Literal::Numbers(Shape::RotationVector, spans) => self.pose(&spans),
            _ => self.values.get(&hashed(base)).copied().flatten(),
        };
        let is_target = self.moved_to.contains(&hashed(base));
        if let (false, Some(pose)) = (is_target, frame)
            && self.c.eat(b',')
        {
            let own = if base.is_empty() { "p[...]".to_owned() } else { lower(base) };
            // set anew, it is another frame
            let is_it = |f: &Result<Pose, String>| *f == Ok(pose);
            let known = !base.is_empty() && self.scan.frames.frames.get(&own).is_none_or(is_it);
            let name = if known { own } else { format!("{own}{AT}{at}") };
            self.scan.frames.frames.insert(name.clone(), Ok(pose));
            return Some(name);
        }
        self.c = start;
        None
    }

    /// `pose_trans(base, pose)` or `pose_add(base, pose)`, from behind its parenthesis on.
    fn related(&mut self, at: usize, frame: Option<&str>, is_product: bool, depth: usize) {
        if is_product
            && frame.is_none()
            && let Some(name) = self.frame(at)
        {
            if !self.place(Some(&name), depth + 1) {
                self.names.visit(Visit::Unknown);
                self.scan.goes_to_calculated(at);
            }
            return;
        }
        self.c.skip_space();
        let start = self.c.at;
        match self.origin(0) {
            Some(None) => self.names.visit(Visit::Unknown),
            Some(Some(name)) => match (self.own_frame(name), frame) {
                (Some(_), Some(_)) => {
                    self.names.visit(Visit::Unknown);
                    self.scan.goes_to_calculated(at);
                }
                (own, _) => {
                    let setup = self.setup(frame.or(own.as_deref()));
                    self.names.used(name, setup, Way::Computed, start);
                }
            },
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
