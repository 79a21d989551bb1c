//! Universal Robots script: `p[x,y,z,rx,ry,rz]` in m and rad, and joint values in rad.
//!
//! Targets are what `movej`, `movel`, `movep`, `movec` and `servoj` go to: literals, or names of literals, by
//! themselves or in `get_inverse_kin(...)` or `get_forward_kin(...)`. Numbers may be expressions of what is assigned
//! once. `set_tcp(p[...])` declares the tool from there on. `pose_trans(name, p[...])` is relative to a target that is
//! rewritten and stays, or, where no motion goes to `name`, a target in that frame; so is `other` of `pose_trans(name,
//! other)` where it stands nowhere else. A motion to what the program calculates is listed. Where loads are set
//! (`set_payload`) is only noted.

mod places;
mod targets;

use std::collections::{HashMap, HashSet};

use trical_model::{Joints, Pose};

use crate::branch::Configuration;
use crate::expression::Constants;
use crate::flow::Flow;
use crate::frames::{AT, Frame, named};
use crate::literal::{Meant, Shape};
use crate::names::{Names, Origin};
use crate::packed::External;
use crate::scan::{Fork, Scan, Setup, Visit, hashed_as_written as hashed};
use crate::scopes::Scopes;
use crate::text::{Cursor, Span, is_among_as_written, mentions};
use targets::{constants, each_argument, next_argument, scopes, skip_name, targets, unsteady};

const MOTIONS: [&[u8]; 8] = [b"movej", b"movel", b"movep", b"movec", b"servoj", b"servoc", b"optimovej", b"optimovel"];
/// Functions that say where the arm is; with arguments, `get_forward_kin` says where it would be.
const HERE: &str = "get_actual_tcp_pose get_target_tcp_pose get_forward_kin get_actual_joint_positions \
    get_target_joint_positions get_joint_positions";
/// From a place to joints and back: the place is the same, with the tool that is set.
const KINEMATICS: [&[u8]; 2] = [b"get_inverse_kin", FORWARD];
const FORWARD: &[u8] = b"get_forward_kin";
/// Functions of the language whose values may stand in a place, beside those that begin as [`ASKS`].
const VALUES: &str = "acos asin atan atan2 ceil cos d2r dot floor interpolate_pose inv length norm point_dist pow r2d random \
    sin size sqrt str_cat struct tan wrench_trans";
const ASKS: [&[u8]; 7] = [b"get_", b"pose_", b"read_", b"is_", b"to_", b"rotvec2", b"rpy2"];
/// Functions of the language that are given places and move nothing.
const SHOW: &str = "textmsg popup socket_send_string socket_send_line socket_send_int set_pos \
    write_output_float_register write_output_integer_register write_output_boolean_register write_port_register \
    modbus_set_output_register set_standard_analog_out set_gravity set_payload_cog sleep";
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
    let scopes = scopes(bytes);
    let (mut moved_to, mut in_frames) = targets(bytes, &scopes);
    let unsteady = unsteady(bytes, &scopes, &mut in_frames);
    let (in_one, several): (Vec<_>, Vec<_>) = in_frames.into_iter().partition(|(_, uses)| uses.frame.is_some());
    let in_one: Vec<u64> = in_one.into_iter().map(|(name, _)| name).filter(|name| moved_to.insert(*name)).collect();
    let several: HashSet<u64> = several.into_iter().map(|(name, _)| name).collect();
    let pass = |flow: Flow| {
        let mut reader = Reader {
            c: Cursor::new(bytes, b'#'),
            scan: Scan::default(),
            names: Names::default().in_text(b'#'),
            constants: &constants,
            scopes: &scopes,
            moved_to: &moved_to,
            unsteady: &unsteady,
            now: Setup::default(),
            flow,
            values: HashMap::new(),
            joints: HashMap::new(),
            in_frames: HashMap::new(),
            bare: HashSet::new(),
            places: HashSet::new(),
            several: HashSet::new(),
            near: HashMap::new(),
            open: Vec::new(),
            is_unbalanced: false,
            functions: HashSet::new(),
            given: Vec::new(),
            literals: Vec::new(),
            computing: Vec::new(),
        };
        reader.file();
        (std::mem::take(&mut reader.flow), reader)
    };
    let reader = Flow::read(pass, |r| &mut r.scan, None);
    let Reader { mut scan, mut names, functions, given, literals, computing, .. } = reader;
    // what a place that is set otherwise too is relative to
    for (name, at) in literals {
        if names.set_anywhere(name).next().is_some() {
            names.set_from(name, Origin::Computed(at));
        }
    }
    for (at, name) in computing.into_iter().filter(|(_, name)| !functions.contains(&hashed(name.as_bytes()))) {
        scan.problem(at, format!("goes where '{name}' says, a function that is not in the script"));
    }
    for (_, at) in given.into_iter().filter(|(name, _)| !functions.contains(name)) {
        scan.given_away.push(at);
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

/// Whether a function of the language, whose value may stand in a place.
fn computes(word: &[u8]) -> bool {
    is_among_as_written(word, VALUES)
        || is_among_as_written(word, HERE)
        || ASKS.iter().any(|begin| word.starts_with(begin))
}

/// Whether what is assigned is a list or a structure of places.
fn holds_places(text: &[u8]) -> bool {
    let holds_pose = || text.windows(3).any(|w| !w[0].is_ascii_alphanumeric() && w[0] != b'_' && w.ends_with(b"p["));
    text.starts_with(b"[[") || (text.starts_with(b"[") || text.starts_with(b"struct(")) && holds_pose()
}

/// Whether a circle: by way of its first place.
fn has_two(motion: &[u8]) -> bool {
    motion == b"movec"
}

struct Reader<'a> {
    c: Cursor<'a>,
    scan: Scan,
    names: Names,
    constants: &'a Constants,
    scopes: &'a Scopes,
    moved_to: &'a HashSet<u64>,
    unsteady: &'a HashSet<u64>,
    now: Setup,
    flow: Flow,
    /// The numbers of poses by name, for `set_tcp(name)` and `pose_trans(name, ...)`: the latest; `None` where nobody
    /// knows which these are.
    values: HashMap<u64, Option<[f64; 6]>>,
    /// Joint values by name, for `qnear=name`; the latest.
    joints: HashMap<u64, Joints>,
    /// Frames of the script in which places are given, by the name of the place; the latest.
    in_frames: HashMap<u64, String>,
    /// Places to which a motion goes that is read before a frame is.
    bare: HashSet<u64>,
    /// Names of numbers that make a place.
    places: HashSet<u64>,
    /// Names of what holds several, each an element or a member of it.
    several: HashSet<u64>,
    /// Joints to which those are near that a name stands for: indices into `Scan::nearest`.
    near: HashMap<u64, u32>,
    /// Where the blocks begin that are open.
    open: Vec<usize>,
    /// Whether there was an `end` that closes none.
    is_unbalanced: bool,
    /// Functions of the script.
    functions: HashSet<u64>,
    /// Functions that are given places, and where.
    given: Vec<(u64, usize)>,
    /// Poses to which no motion goes by themselves, and where they are assigned.
    literals: Vec<(u64, u32)>,
    /// Functions that say how far from a target a place is, and where.
    computing: Vec<(usize, String)>,
}

impl<'a> Reader<'a> {
    fn file(&mut self) {
        while let Some((from, word)) = self.c.next_word() {
            if is_motion(word) {
                if self.c.eat(b'(') {
                    let inside = self.c;
                    for (function, mut c) in self.called_ahead() {
                        each_argument(self.scopes, function, &mut c, |c, parameter| {
                            self.names.set_from(parameter, Origin::Computed(c.at as u32));
                        });
                    }
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
        if let Some(from) = self.open.pop() {
            self.scan.problem(from, "begins a block that no 'end' closes: which tool is set behind it is not known");
        }
    }

    /// Words that begin or end routines, branches and loops, and calls.
    fn block(&mut self, from: usize, word: &[u8]) -> bool {
        let Self { flow, now, c, names, functions, .. } = self;
        // not of `x.end`
        let keyword = if c.is_member(from) { b"" } else { word };
        if matches!(keyword, b"def" | b"thread" | b"sec" | b"while" | b"if") {
            self.open.push(from);
        }
        match keyword {
            b"def" | b"thread" | b"sec" => {
                c.skip_blank();
                let name = hashed(c.word());
                functions.insert(name);
                flow.routine(name, now);
                names.routine(name);
                if word == b"thread" {
                    names.runs_at_any_time(name);
                }
                self.defaults(name);
                self.c.skip_line();
            }
            b"return" => flow.returns(now),
            b"break" | b"continue" => flow.leaves_loop(word == b"continue", now),
            b"while" => {
                flow.repeat(from, now);
                names.fork(Fork::Repeats);
            }
            b"if" => {
                flow.branches(now, true);
                names.fork(Fork::Opens);
            }
            b"elif" | b"else" => {
                let is_last = word == b"else";
                flow.branch(now, is_last);
                names.fork(if is_last { Fork::Else } else { Fork::Other });
            }
            b"end" => {
                names.end(flow.end(now));
                if self.open.pop().is_none() && !self.is_unbalanced {
                    self.is_unbalanced = true;
                    self.scan.problem(from, "closes no block: which tool is set from here on is not known");
                }
            }
            _ => {
                let name = hashed(word);
                if let Some(is_statement) = flow.perhaps_called_as(name, word, c, now) {
                    let is_given = !is_among_as_written(word, SHOW) && !computes(word) && self.is_given_place();
                    self.given.extend(is_given.then_some((name, from)));
                    self.names.called(name, is_given && is_statement);
                    if !self.scopes.parameters(name).is_empty() {
                        self.c.skip_blank();
                        self.call(name);
                        return true;
                    }
                }
                return false;
            }
        }
        true
    }

    /// Functions among the arguments that follow are called first; these, each with its parenthesis.
    fn called_ahead(&mut self) -> Vec<(u64, Cursor<'a>)> {
        let ahead = self.functions_ahead();
        for (name, word, behind) in &ahead {
            self.flow.perhaps_called_as(*name, word, behind, &mut self.now);
            self.names.called(*name, false);
        }
        ahead.into_iter().map(|(name, _, behind)| (name, behind)).collect()
    }

    /// What a call gives to a function of the script, from its parenthesis to the one that closes.
    fn call(&mut self, function: u64) {
        let mut calls = vec![(function, self.c)];
        self.c.at += 1;
        let inside = self.c;
        calls.extend(self.called_ahead());
        let (mut given, mut unread) = (Vec::new(), Vec::new());
        let mut end = inside;
        for (k, (function, mut c)) in calls.into_iter().enumerate() {
            let (at, from) = (c.at as u32, given.len());
            each_argument(self.scopes, function, &mut c, |c, parameter| given.push((*c, parameter)));
            if c.peek() != b')' {
                // an argument so long that those behind it were not come to
                let is_read = |key: u64| given[from..].iter().any(|(_, parameter)| *parameter == key);
                let left = self.scopes.parameters(function).iter().filter(|p| !is_read(p.key));
                unread.extend(left.map(|p| (p.key, at)));
            }
            if k == 0 {
                end = c;
            }
        }
        // targets are found in the order of the text
        given.sort_by_key(|(c, _)| c.at);
        for (c, parameter) in given {
            self.c = c;
            self.argument(parameter);
        }
        for (parameter, at) in unread {
            self.names.set_from(parameter, Origin::Computed(at));
        }
        // what is given by its name (`where=p[...]`) assigns nothing here
        self.c = end;
        if !self.c.eat(b')') {
            self.c = inside;
            self.close();
        }
    }

    /// What parameters of a function are where its calls give none (`def go(where=p[...])`), from its name on.
    fn defaults(&mut self, function: u64) {
        self.c.skip_blank();
        if !self.c.until(b"\n").contains(&b'=') {
            return;
        }
        let mut c = self.c;
        each_argument(self.scopes, function, &mut c, |c, parameter| {
            // those without stand here by their names
            let name = c.clone().word();
            if self.scopes.key(hashed(name), c.at) != parameter {
                self.c = *c;
                self.argument(parameter);
            }
        });
    }

    /// The place at the cursor becomes a parameter.
    fn argument(&mut self, parameter: u64) {
        let at = self.c.at as u32;
        let origin = match self.literal() {
            Literal::Numbers(shape, spans) if self.moved_to.contains(&parameter) => {
                let spot = self.scan.push(shape, &spans, Configuration::Free, Span::default(), External::None) as usize;
                self.names.define_at(at as usize, spot, spot + 1)
            }
            Literal::None => match self.origin_at(at as usize) {
                Some(Some(name)) => Origin::Name { name, at },
                Some(None) => Origin::Here,
                None => Origin::Computed(at),
            },
            _ => Origin::Computed(at),
        };
        self.names.set_from(parameter, origin);
    }

    /// What the name that ends at the cursor is called among all names.
    fn key(&self, name: &[u8]) -> u64 {
        self.scopes.key(hashed(name), self.c.at)
    }

    /// Whether a place, or what holds places, is among the arguments of a function, from behind its name on. The cursor stays.
    fn is_given_place(&mut self) -> bool {
        let start = self.c;
        let mut depth = u32::from(self.c.eat(b'('));
        let mut found = false;
        while depth > 0 && !found && !self.c.done() && self.c.peek() != b'\n' {
            match self.c.peek() {
                b'(' => depth += 1,
                b')' => depth -= 1,
                _ if self.c.begins_string() => {
                    self.c.skip_string();
                    continue;
                }
                _ => {}
            }
            let word = match self.literal() {
                Literal::None => self.c.word(),
                _ => {
                    found = true;
                    break;
                }
            };
            let name = self.key(word);
            match self.c.peek() {
                b'(' => {
                    found = word.starts_with(b"pose_") || KINEMATICS.contains(&word);
                    if !found && word != b"struct" && computes(word) {
                        self.c.at += 1;
                        self.close();
                    }
                }
                // of a pose, a number
                b'[' if !self.several.contains(&name) => {}
                _ => found = [self.moved_to, &self.places, &self.several].iter().any(|all| all.contains(&name)),
            }
            self.c.at += usize::from(word.is_empty());
        }
        self.c = start;
        found
    }

    /// `name=p[...]`, `name=[...]`, `name=other`, `name=pose_trans(other,...)`, `name[2]=...`
    fn assignment(&mut self, from: usize, word: &[u8]) {
        let start = self.c;
        let hash = self.key(word);
        let is_target = self.moved_to.contains(&hash);
        self.c.skip_blank();
        let element = self.c;
        let is_element = self.c.peek() == b'[';
        // of an element of a list, a coordinate
        while self.c.peek() == b'[' {
            self.c.skip_past(b']', b"\n");
            self.c.skip_blank();
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
            return self.element(element, hash);
        }
        if is_target && self.list_of_places(Span::new(from, from + word.len())) {
            self.several.insert(hash);
            return;
        }
        self.c.skip_blank();
        let literal = self.literal();
        if !matches!(literal, Literal::None) || self.c.until(b"\n").starts_with(b"pose_") {
            self.places.insert(hash);
        } else if holds_places(self.c.until(b"\n")) {
            self.several.insert(hash);
        }
        match literal {
            Literal::Numbers(shape, spans) => self.assigned(Span::new(from, from + word.len()), shape, &spans),
            Literal::Unread(span) if is_target => {
                self.scan.unread(span, self.c.bytes);
                self.names.listed(hash);
            }
            Literal::Unread(_) => {
                self.values.insert(hash, None);
                self.names.set_from(hash, computed);
            }
            Literal::None if is_target => self.placed(Span::new(from, from + word.len())),
            Literal::None => {
                self.values.insert(hash, None);
                self.not_placed(hash, from);
            }
        }
    }

    /// One of the numbers of a pose, or of joints, becomes what stands at the cursor; `index` is at its bracket.
    fn element(&mut self, mut index: Cursor<'_>, hash: u64) {
        index.at += 1;
        let k = index.number().filter(|_| index.peek() == b']').and_then(|s| s.value(index.bytes));
        let value = self.constants.expression(&mut self.c).map(|(_, value)| value);
        self.c.skip_blank();
        let is_known = matches!(self.c.peek(), b'\n' | b'\r' | b'#' | 0) && !self.unsteady.contains(&hash);
        let new = k.zip(value).filter(|_| is_known);
        if let Some(numbers) = self.values.get_mut(&hash) {
            *numbers = numbers.and_then(|known| with_element(known, new));
        }
        let joints = self.joints.remove(&hash).and_then(|known| with_element(known, new));
        self.joints.extend(joints.map(|q| (hash, q)));
    }

    fn assigned(&mut self, name: Span, shape: Shape, spans: &[Span; 6]) {
        let hash = self.key(name.text(self.c.bytes));
        if let Some(q) = self.joint_values(shape, spans) {
            self.joints.insert(hash, q);
        }
        self.in_frames.remove(&hash);
        self.near.remove(&hash);
        if self.moved_to.contains(&hash) {
            let first = self.scan.spots.len();
            self.scan.push(shape, spans, Configuration::Free, name, External::None);
            self.names.define(hash, first, first + 1);
        } else if shape == Shape::RotationVector {
            let numbers = self.numbers(spans).filter(|_| !self.unsteady.contains(&hash));
            self.values.insert(hash, numbers);
            self.literals.push((hash, name.at));
        }
    }

    fn numbers(&self, spans: &[Span; 6]) -> Option<[f64; 6]> {
        let v = spans.map(|s| self.scan.value(s, self.c.bytes).unwrap_or(f64::NAN));
        v.iter().all(|x| x.is_finite()).then_some(v)
    }

    /// The pose that a name stands for, or that is written out.
    fn pose(&self, literal: &Literal, name: &[u8]) -> Option<Pose> {
        let numbers = match literal {
            Literal::Numbers(Shape::RotationVector, spans) => self.numbers(spans),
            _ => self.values.get(&self.key(name)).copied().flatten(),
        };
        match Shape::RotationVector.meant(&numbers?, &[]) {
            Ok(Meant::Pose(pose)) => Some(pose),
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

    fn set_tcp(&mut self, at: usize) {
        self.c.skip_space();
        skip_name(&mut self.c);
        let (literal, name) = (self.literal(), self.c.word());
        let frame = self.pose(&literal, name).ok_or("its set_tcp is computed by the program".to_owned());
        let key = match &frame {
            Ok(p) => {
                let t = p.translation * 1e3;
                format!("set_tcp({:.3}, {:.3}, {:.3} mm) first{AT}{at}", t.x, t.y, t.z)
            }
            Err(_) => format!("set_tcp{AT}{at}"),
        };
        self.now.tool = Some(named(&mut self.scan.frames.tools, key, frame.map(Frame::massless)));
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

    /// Functions that are called from here to the parenthesis that closes the one that was passed, or to the end of the line.
    fn functions_ahead(&self) -> Vec<(u64, &'a [u8], Cursor<'a>)> {
        let mut end = self.c;
        let mut found = Vec::new();
        let mut depth = 0;
        while !end.done() && depth >= 0 && end.peek() != b'\n' {
            let word = end.word();
            match end.peek() {
                b'(' if !word.is_empty() => found.push((hashed(word), word, end)),
                _ if !word.is_empty() => continue,
                b'(' => depth += 1,
                b')' => depth -= 1,
                _ if end.begins_string() => {
                    end.skip_string();
                    continue;
                }
                b'#' => break,
                _ => {}
            }
            end.at += usize::from(word.is_empty());
        }
        found
    }

    /// A place from here on is as far from a target as functions say; they are listed where nobody has read them.
    fn computed_by(&mut self) {
        let others = self.functions_ahead().into_iter().filter(|(_, word, _)| !computes(word));
        let others: Vec<_> = others
            .map(|(_, word, behind)| (behind.at - word.len(), String::from_utf8_lossy(word).into_owned()))
            .collect();
        self.computing.extend(others);
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

/// Numbers with this one among them, by its index.
fn with_element<const N: usize>(mut numbers: [f64; N], element: Option<(f64, f64)>) -> Option<[f64; N]> {
    let (k, new) = element?;
    *numbers.get_mut(k as usize)? = new;
    Some(numbers)
}

/// Six numbers in brackets, or nearly.
enum Literal {
    Numbers(Shape, [Span; 6]),
    /// Six items, of which this has no value.
    Unread(Span),
    None,
}
