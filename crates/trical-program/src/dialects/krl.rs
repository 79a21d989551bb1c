//! KUKA KRL: E6POS, POS, FRAME, E6AXIS and AXIS data in .dat and .src, inline targets, $TOOL and $BASE.
//!
//! A target of a .dat file is meant with the tool and base that its motion data say (`XP1` goes with `FP1`), those of a .src
//! with what `$TOOL`, `$BASE` or `BAS(#TOOL,n)` said above the motion. Angles: `R = Rz(A) Ry(B) Rx(C)`.
//!
//! What a motion goes to is a target; what the program gives to `$TOOL`, `$BASE`, `$WORKSPACE` and other system variables is none.

mod arguments;
mod data;
mod named;
mod outside;
mod setup;
mod targets;

pub use outside::{displaces, global_frames, sets, values};

use std::collections::{HashMap, HashSet};

use trical_model::Joints;

use crate::elsewhere::Elsewhere;
use crate::expression::Constants;
use crate::flow::Flow;
use crate::names::{Names, Origin, Way};
use crate::reaching::Part;
use crate::scan::{Fork, Scan, Setup, Visit, changed_here, hashed};
use crate::text::{Cursor, Span, begins_line, is_among, is_one_of, lower, mentions};
use arguments::Routines;
use data::Aggregate;
use named::Named;

/// The places of a cell's home, which belong to all programs.
const HOMES: [&[u8]; 8] = [b"HOME", b"XHOME", b"XHOME1", b"XHOME2", b"XHOME3", b"XHOME4", b"XHOME5", b"$H_POS"];
/// The numbers of a pose.
pub const POSE: [&[u8]; 6] = [b"X", b"Y", b"Z", b"A", b"B", b"C"];
const AXES: [&[u8]; 6] = [b"A1", b"A2", b"A3", b"A4", b"A5", b"A6"];
/// Tool and base as parts of motion data.
const MOTION_DATA: [&[u8]; 2] = [b".TOOL_NO", b".BASE_NO"];
/// The tool and the base that are active.
const CURRENT: [&[u8]; 2] = [b"$TOOL", b"$BASE"];
/// Where the arm stands.
const ARM_BASE: &[u8] = b"$ROBROOT";
const THE_ARM_BASE: &str = "the place of the robot's base ($ROBROOT)";
/// The numbers of the tool and the base that are active, as the controller shows them.
const NUMBERS: [&[u8]; 2] = [b"$ACT_TOOL", b"$ACT_BASE"];
/// Tools and bases that the controller keeps by number.
const ELEMENTS: [&[u8]; 2] = [b"TOOL_DATA", b"BASE_DATA"];
const MOTIONS: [&[u8]; 7] = [b"PTP", b"LIN", b"CIRC", b"SPTP", b"SLIN", b"SCIRC", b"SPL"];
/// Those of which the joints' ends matter: the controller takes status and turn of their targets.
const FREE_MOTIONS: [&[u8]; 2] = [b"PTP", b"SPTP"];
const RELATIVE: [&[u8]; 7] = [b"PTP_REL", b"LIN_REL", b"CIRC_REL", b"SPTP_REL", b"SLIN_REL", b"SCIRC_REL", b"SPL_REL"];
/// Variables that say where the arm is, or where it was on its path.
const HERE: &str = "$POS_ACT $AXIS_ACT $POS_ACT_MES $AXIS_ACT_MES $AXIS_ACT_MEAS $POS_RET $AXIS_RET $POS_INT \
    $AXIS_INT $POS_BACK $AXIS_BACK $POS_FOR $AXIS_FOR";
/// Statements of the language that look like calls.
const BUILT_IN: &str = "COPEN CCLOSE CREAD CWRITE CIOCTL SREAD SWRITE MBX_REC ERR_RAISE PULSE SET_CD_PARAMS RSI_ON \
    RSI_MOVECORR ST_MOVESENS";
/// What moves the arm as a sensor says.
const MOVES_BY_SENSOR: &str =
    "moves the arm as a sensor or another computer says while the program runs (RSI), which is not corrected";
/// Statements by which a sensor displaces the motions that follow, or moves the arm.
const BY_SENSOR: [(&[u8], &str); 3] = [
    (b"RSI_ON", "lets a sensor displace the motions that follow (RSI); they are corrected for where the text has them"),
    (b"RSI_MOVECORR", MOVES_BY_SENSOR),
    (b"ST_MOVESENS", MOVES_BY_SENSOR),
];
/// Words that begin loops, and that end them.
const LOOPS: [&[u8]; 4] = [b"LOOP", b"WHILE", b"FOR", b"REPEAT"];
const LOOP_ENDS: [&[u8]; 4] = [b"ENDLOOP", b"ENDWHILE", b"ENDFOR", b"UNTIL"];
/// Words that begin lines in which what looks like a call is none, or is made when something happens.
const NO_STATEMENTS: [&[u8]; 10] =
    [b"DEF", b"DEFFCT", b"GLOBAL", b"EXT", b"EXTFCT", b"EXTP", b"EXTFCTP", b"INTERRUPT", b"TRIGGER", b"DEFDAT"];
const TYPES: [&[u8]; 5] = [b"E6POS", b"POS", b"FRAME", b"E6AXIS", b"AXIS"];

/// Elements of the second and third dimension of an array that are told apart, at most.
const MOST_ELEMENTS: usize = 1000;

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

/// Reads a .src or .dat file, or both.
#[must_use]
pub fn scan(bytes: &[u8], elsewhere: &dyn Elsewhere) -> Scan {
    let routines = arguments::routines(bytes);
    let named = targets::targets(bytes, &routines, elsewhere);
    let pass = |flow: Flow| {
        let mut reader = Reader {
            c: Cursor::new(bytes, b';'),
            scan: Scan::default(),
            names: Names::with_declarations().in_text(b';'),
            named: &named,
            routines: &routines,
            elsewhere,
            constants: Constants::with_integers(),
            now: Setup::default(),
            active: None,
            spline: None,
            on_path: false,
            flow,
            conditions: Vec::new(),
            used: HashSet::new(),
            motion_data: HashMap::new(),
            products: HashMap::new(),
        };
        reader.scan.frames.predefine("0", "0");
        reader.file();
        (std::mem::take(&mut reader.flow), reader)
    };
    let mut reader = Flow::read(pass, |r| &mut r.scan, Some(elsewhere));
    reader.scan.calls.retain(|call| !is_among(call.name.as_bytes(), BUILT_IN));
    outside::note(bytes, &mut reader);
    let mut said: Vec<(u64, u32)> = std::mem::take(&mut reader.motion_data).into_values().collect();
    said.sort_unstable();
    for (name, setup) in said {
        reader.names.used(name, setup, Way::Said, 0);
    }
    reader.names.end_of_file();
    reader.used_elsewhere(bytes);
    reader.in_products();
    let Reader { mut scan, mut names, .. } = reader;
    scan.takes = routines.taken(&named, &names, &scan);
    named.no_targets.iter().for_each(|name| names.no_target(*name));
    named.other_uses.iter().for_each(|(name, other)| names.also_used(*name, *other));
    scan.angles = ["A", "B", "C"];
    names.resolve(&mut scan, bytes, &|name| {
        let name = String::from_utf8_lossy(name);
        format!("goes to '{name}', which the program's own files do not give as numbers ($config.dat and other programs stay as they are)")
    });
    scan
}

/// The GLOBAL routines of a file, by their hashed names.
#[must_use]
pub fn globals(bytes: &[u8]) -> Vec<u64> {
    routines(bytes).filter(|(_, is_global)| *is_global).map(|(name, _)| name).collect()
}

/// The routines of a file that others may call: its first, and the GLOBAL ones.
#[must_use]
pub fn callable(bytes: &[u8]) -> Vec<u64> {
    routines(bytes).enumerate().filter(|(k, (_, is_global))| *k == 0 || *is_global).map(|(_, (name, _))| name).collect()
}

/// The routines of a file, and which are GLOBAL.
fn routines(bytes: &[u8]) -> impl Iterator<Item = (u64, bool)> {
    bytes.split(|b| *b == b'\n').filter_map(|line| {
        let mut c = Cursor::new(line, b';');
        c.skip_blank();
        let mut word = c.word();
        let is_global = word.eq_ignore_ascii_case(b"GLOBAL");
        if is_global {
            c.skip_blank();
            word = c.word();
        }
        is_one_of(word, &[b"DEF", b"DEFFCT"]).then(|| (before_bracket(&mut c), is_global))
    })
}

/// Whether one of these routines may be called in a file, or it may go to one of these points (hashed).
#[must_use]
pub fn uses(bytes: &[u8], routines: &[u64], points: &HashSet<u64>) -> bool {
    let mut c = Cursor::new(bytes, b';');
    while let Some((_, word)) = c.next_word() {
        c.skip_blank();
        let name = hashed(word);
        if points.contains(&name) || c.peek() == b'(' && routines.contains(&name) {
            return true;
        }
    }
    false
}

/// Whether a name is the controller's own: its data are tools, bases, loads, work spaces, never targets.
fn is_system(word: &[u8]) -> bool {
    word.starts_with(b"$") || is_one_of(word, &ELEMENTS) || word.eq_ignore_ascii_case(b"LOAD_DATA")
}

struct Reader<'a> {
    c: Cursor<'a>,
    scan: Scan,
    names: Names,
    named: &'a Named,
    routines: &'a Routines,
    elsewhere: &'a dyn Elsewhere,
    constants: Constants,
    /// Tool and base at this place of the program.
    now: Setup,
    /// What `FDAT_ACT` says of them since the last branch, which `BAS(#CP_PARAMS,...)` sets again.
    active: Option<Setup>,
    /// Before the spline that the program is in.
    spline: Option<Setup>,
    /// Whether the last motion went along a path.
    on_path: bool,
    flow: Flow,
    /// Tools (`true`) and bases that were set by their numbers so far.
    used: HashSet<(bool, String)>,
    /// Of the loops that are open, what stands behind WHILE.
    conditions: Vec<Option<Cursor<'a>>>,
    /// What FDAT data say, by their names: the target that goes with them, and tool and base.
    motion_data: HashMap<u64, (u64, u32)>,
    /// Products of frames that the program assigns to names, as a tool and as a base.
    products: HashMap<String, [String; 2]>,
}

impl<'a> Reader<'a> {
    fn file(&mut self) {
        let mut before: &[u8] = b"";
        while !self.c.done() {
            self.c.skip_space();
            let from = self.c.at;
            let word = self.c.word();
            if word.is_empty() {
                match self.c.peek() {
                    b'"' => self.c.skip_string(),
                    b'{' => drop(self.aggregate()),
                    _ => self.c.at += 1,
                }
                before = b"";
                continue;
            }
            if begins_line(self.c.bytes, from) {
                self.functions_ahead(word);
            }
            if is_one_of(word, &[b"REAL", b"INT"]) {
                self.number(before.eq_ignore_ascii_case(b"CONST"), word.eq_ignore_ascii_case(b"INT"));
            } else if is_one_of(word, &MOTIONS) {
                let before = self.now.clone();
                let on_path = !is_one_of(word, &FREE_MOTIONS);
                if on_path != self.on_path {
                    self.on_path = on_path;
                    self.names.visit(Visit::OnPath(on_path));
                }
                self.with();
                self.motion();
                if self.now != before {
                    self.now = before;
                    self.c.skip_line();
                }
            } else if is_one_of(word, &[b"SPLINE", b"PTP_SPLINE"]) {
                self.spline = Some(self.now.clone());
                self.with();
                self.c.skip_line();
            } else if is_one_of(word, &[b"ENDSPLINE"]) {
                self.now = self.spline.take().unwrap_or_else(|| self.now.clone());
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
            } else if let Some((_, what)) = BY_SENSOR.iter().find(|(name, _)| word.eq_ignore_ascii_case(name)) {
                self.scan.problem(from, *what);
                self.names.visit(Visit::Unknown);
            } else if is_one_of(word, &[b"EXT", b"EXTFCT"]) {
                // what the declared routine is called with
                self.c.skip_line();
            } else if before.eq_ignore_ascii_case(b"WAIT") || !self.block(from, word) {
                self.assignment(from, word);
            } else {
                self.active = None;
            }
            before = word;
        }
    }

    /// What functions set that are called in the line that begins with this word: the line does its own after they return. A condition behind
    /// WHILE is asked again where its loop ends.
    fn functions_ahead(&mut self, word: &[u8]) {
        let is = |words: &[&[u8]]| is_one_of(word, words);
        if is(&LOOPS) {
            self.conditions.push(is(&[b"WHILE"]).then_some(self.c));
        }
        let condition = if is(&LOOP_ENDS) { self.conditions.pop().flatten() } else { None };
        if !is(&NO_STATEMENTS) {
            self.functions_in(self.c);
        }
        condition.into_iter().for_each(|condition| self.functions_in(condition));
    }

    /// The same, of those from a cursor to the end of its line.
    fn functions_in(&mut self, mut c: Cursor<'a>) {
        let line = c.until(b";\n\r");
        let end = c.at + line.len();
        // most lines call nothing
        if !line.contains(&b'(') {
            return;
        }
        while c.at < end {
            match c.peek() {
                b'"' => c.skip_string(),
                _ => {
                    let word = c.word();
                    if word.is_empty() {
                        c.at += 1;
                    } else if let Some(false) = self.flow.perhaps_called(word, &c, &mut self.now) {
                        self.names.called(hashed(word), false);
                    }
                }
            }
        }
    }

    /// What `WITH $TOOL=..., $BASE=...` or an inline form at the end of this line sets, for the motion before it; the cursor stays.
    fn with(&mut self) {
        let start = self.c;
        let line = self.c.until(b";\n\r");
        let end = start.at + line.len();
        if mentions(line, b"WITH") {
            while self.c.at < end {
                self.c.at += self.c.until(b"$;\n\r").len();
                let from = self.c.at;
                let word = self.c.word();
                if is_one_of(word, &[b"$TOOL", b"$BASE", b"$IPO_MODE"]) {
                    self.assignment(from, word);
                } else {
                    self.c.at += usize::from(word.is_empty());
                }
            }
        } else if mentions(line, b"VEL") {
            self.inline_form(line);
        }
        self.c = start;
    }

    /// Words that begin or end routines, branches and loops, and calls.
    fn block(&mut self, from: usize, word: &[u8]) -> bool {
        let Self { flow, now, active, c, names, .. } = self;
        let is = |words: &[&[u8]]| is_one_of(word, words);
        if is(&[b"DEF", b"DEFFCT"]) {
            let name = before_bracket(c);
            flow.routine(name, now);
            names.routine(name);
            // arguments are others than constants of their names
            self.routines.scopes.parameters(name).iter().for_each(|p| self.constants.forget(p.name));
        } else if is(&[b"END", b"ENDFCT"]) {
            flow.end_routine(now);
            names.end(Some(Fork::Anywhere));
        } else if is(&[b"RETURN"]) {
            flow.returns(now);
        } else if is(&[b"EXIT"]) {
            flow.leaves_loop(false, now);
        } else if is(&[b"GOTO"]) {
            c.skip_blank();
            flow.jumps(hashed(c.word()), now);
        } else if is(&[b"INTERRUPT"]) {
            let routine = before_bracket(c);
            flow.interrupt(routine);
            names.runs_at_any_time(routine);
        } else if is(&LOOPS) {
            flow.repeat(from, now);
            names.fork(Fork::Repeats);
        } else if is(&[b"IF", b"SWITCH"]) {
            flow.branches(now, is(&[b"IF"]));
            names.fork(Fork::Opens);
        } else if is(&[b"ELSE", b"CASE", b"DEFAULT"]) {
            let is_last = !is(&[b"CASE"]);
            flow.branch(now, is_last);
            names.fork(if is_last { Fork::Else } else { Fork::Other });
        } else if is(&[b"ENDIF", b"ENDSWITCH"]) || is(&LOOP_ENDS) {
            names.end(flow.end(now));
        } else if c.peek() == b':' && begins_line(c.bytes, from) {
            // a label
            flow.label(hashed(word), now);
            names.fork(Fork::Anywhere);
        } else {
            if let Some(is_statement) = flow.perhaps_called(word, c, now) {
                names.called(hashed(word), is_statement && !is_among(word, BUILT_IN));
                *active = None;
                self.arguments(word);
            }
            return false;
        }
        true
    }

    /// `CONST REAL H=200`, and `REAL H,K`: a variable is another one than a constant of its name elsewhere.
    fn number(&mut self, is_constant: bool, is_integer: bool) {
        loop {
            self.c.skip_blank();
            let name = self.c.word();
            if name.is_empty() {
                return;
            }
            let is_given = is_constant && self.c.eat_in_line(b'=');
            match self.constants.expression(&mut self.c).filter(|_| is_given) {
                Some((_, value)) if is_integer => self.constants.define_integer(hashed(name), value),
                Some((_, value)) => self.constants.define(hashed(name), value),
                None => self.constants.forget(hashed(name)),
            }
            if !self.c.eat_in_line(b',') {
                return;
            }
        }
    }

    /// What a name at `at` is called among all names.
    fn key(&self, name: &[u8], at: usize) -> u64 {
        self.routines.scopes.key(hashed(name), at)
    }

    /// `NAME.Z=...`, from the point on: a part of a target that is set by itself.
    fn part(&mut self, from: usize, word: &[u8]) {
        let part = self.c.at;
        while matches!(self.c.peek(), b'.' | b' ' | b'_') || self.c.peek().is_ascii_alphanumeric() {
            self.c.at += 1;
        }
        if !self.c.assigns() {
            return;
        }
        let part = self.c.bytes.get(part..self.c.at).unwrap_or(&[]).trim_ascii();
        if let Some(which) = MOTION_DATA.iter().position(|name| part.eq_ignore_ascii_case(name)) {
            self.part_of_motion_data(word, which == 0);
        } else if word.eq_ignore_ascii_case(b"$LOAD") {
            self.scan.loads.push(from);
        } else if word.eq_ignore_ascii_case(ARM_BASE) {
            self.scan.problem(from, changed_here(THE_ARM_BASE));
        } else if is_one_of(word, &CURRENT) {
            let name = self.calculated(format!("{} (set in part)", lower(word)));
            self.set(word.eq_ignore_ascii_case(b"$TOOL"), name);
        } else if mentions(self.c.until(b";\n\r"), word) {
            self.names.changed(self.key(word, from), from);
        } else if !is_system(word) {
            self.names.set_from(self.key(word, from), Origin::Computed(from as u32));
        }
    }

    /// `NAME=...`, `NAME[1]=...`
    fn assignment(&mut self, from: usize, word: &[u8]) {
        if self.is_frame(word) {
            return self.frame_data(from);
        }
        if self.c.peek() == b'.' {
            return self.part(from, word);
        }
        self.c.skip_blank();
        if is_one_of(word, &ELEMENTS) && self.changes_element() {
            self.scan.problem(from, changed_here("a tool or base"));
        }
        let index = self.index();
        if self.c.peek() == b'.' {
            return self.part(from, word);
        }
        let is = |w: &str| word.eq_ignore_ascii_case(w.as_bytes());
        if !self.c.eat_in_line(b'=') {
            return;
        }
        // of motion data, that they are no longer as they were given
        self.motion_data.remove(&hashed(word));
        if is_one_of(word, &CURRENT) {
            let name = self.current(is("$TOOL"));
            self.set(is("$TOOL"), name);
        } else if is_one_of(word, &NUMBERS) && self.c.peek() != b'=' {
            self.only_number(is("$ACT_TOOL"));
        } else if word.eq_ignore_ascii_case(ARM_BASE) {
            self.scan.problem(from, changed_here(THE_ARM_BASE));
        } else if is("$LOAD") {
            self.scan.loads.push(from);
        } else if is("$IPO_MODE") {
            self.interpolation();
        } else if self.c.peek() == b'{' || is_one_of(word, &ELEMENTS) && self.c.until(b";\n\r").contains(&b':') {
            self.assigned(from, word, index);
        } else if self.named.moved_to.contains(&self.key(word, from)) {
            let source = self.c.word();
            self.c.skip_blank();
            let origin = if is_among(source, HERE) {
                Origin::Here
            } else if source.is_empty() || matches!(self.c.peek(), b'(' | b'.') {
                Origin::Computed(from as u32)
            } else {
                if matches!(self.c.until(b"\n\r;").trim_ascii(), b"" | [b'[', .., b']']) {
                    self.names.copied(from);
                }
                Origin::Name { name: self.key(source, from), at: from as u32 }
            };
            self.names.set_here(self.key(word, from), index, origin);
        } else if is("FDAT_ACT") {
            let at = self.c.at;
            let name = self.c.word();
            self.take_motion_data(name, at);
        }
    }

    /// What of an array is meant by the brackets that follow, if there are any; elements are counted from 1, those of several dimensions
    /// one after the other as if each dimension had [`MOST_ELEMENTS`].
    fn index(&mut self) -> Part {
        if !self.c.eat_in_line(b'[') {
            return Part::Whole;
        }
        let number = self.c.number().and_then(|n| n.value(self.c.bytes)).filter(|n| *n >= 1.0);
        let mut element = number.map(|n| n as usize - 1);
        while self.c.eat_in_line(b',') {
            self.c.skip_blank();
            let number = self.c.number().and_then(|n| n.value(self.c.bytes)).map(|n| n as usize);
            let number = number.filter(|n| (1..=MOST_ELEMENTS).contains(n));
            element = number.and_then(|n| element?.checked_mul(MOST_ELEMENTS)?.checked_add(n - 1));
        }
        let behind = self.c.until(b"]\n\r");
        self.c.at += behind.len();
        self.c.eat_in_line(b']');
        element.filter(|_| behind.trim_ascii().is_empty()).map_or(Part::Indexed, Part::Element)
    }

    /// `{...}` that is assigned to this word, or to an element of it.
    fn assigned(&mut self, from: usize, word: &[u8], index: Part) {
        if let (true, Part::Element(k)) = (is_one_of(word, &ELEMENTS), index) {
            return self.element(word.eq_ignore_ascii_case(b"TOOL_DATA"), (k + 1).to_string());
        }
        let found = self.aggregate();
        if word.eq_ignore_ascii_case(b"FDAT_ACT") {
            self.now = self.said(&found);
            self.active = Some(self.now.clone());
        } else if !is_system(word)
            && (self.named.moved_to.is_empty() || self.named.moved_to.contains(&self.key(word, from)))
        {
            if self.c.eat_in_line(b':') {
                self.names.set_from(self.key(word, from), Origin::Computed(from as u32));
            } else {
                self.define(&found, Span::new(from, from + word.len()), index);
            }
        }
    }

    /// Whether `[1].X=...`, `[N]={...}` or `[1]=NAME` follows, and not numbers, or a product of frames, for an element that is known.
    fn changes_element(&self) -> bool {
        let text = self.c.until(b";\n\r");
        let close = text.iter().position(|b| *b == b']').unwrap_or(0);
        let (index, behind) = text.split_at(close);
        let Some(equals) = behind.iter().position(|b| *b == b'=') else { return false };
        let (part, value) = (behind[..equals].trim_ascii_end(), behind[equals + 1..].trim_ascii_start());
        let is_comparison = value.starts_with(b"=") || part.iter().any(|b| b"<>".contains(b));
        let is_calculated = index.iter().any(|b| b.is_ascii_alphabetic() || b"+-*/".contains(b));
        let is_product = value.contains(&b':');
        let is_known = part == b"]" && (value.starts_with(b"{") || is_product) && !is_calculated;
        !is_comparison && !is_known
    }

    /// `LIN {...} C_DIS`, `LIN XP1`, `CIRC P1,P2,CA 90`, `LIN XP1:{...}`, `LIN PALLET:XP1`
    fn motion(&mut self) {
        loop {
            self.c.skip_blank();
            let base = self.in_frames();
            let is_place = self.place();
            if let Some(base) = base {
                self.now.frame = base;
            }
            if !is_place || !self.c.eat_in_line(b',') {
                return;
            }
        }
    }

    /// Where a motion goes; whether another place may follow.
    fn place(&mut self) -> bool {
        let at = self.c.at;
        if self.c.peek() == b'{' {
            let found = self.aggregate();
            let visit = self.goes_to(at, &found);
            self.names.visit(visit);
            return true;
        }
        if self.c.peek() == b'(' {
            // frames in brackets are not multiplied
            self.names.visit(Visit::Unknown);
            self.scan.goes_to_calculated(at);
            self.c.skip_line();
            return false;
        }
        let word = self.c.word();
        if word.is_empty() || word.eq_ignore_ascii_case(b"CA") {
            return false;
        }
        self.c.skip_blank();
        let part = self.index();
        let way = match (self.relative(), part) {
            (true, _) => Way::Computed,
            (false, Part::Element(k)) => Way::Element(k),
            (false, Part::Indexed) => Way::Indexed,
            (false, Part::Whole) => Way::To,
        };
        if self.c.peek() == b'(' {
            self.names.visit(Visit::Unknown);
            self.scan.goes_to_calculated(at);
            self.c.skip_line();
            return false;
        }
        if is_among(word, HERE) {
            self.names.visit(Visit::Unknown);
        } else if part == Part::Whole && is_one_of(word, &HOMES) && self.is_of_all_programs(word) {
            self.goes_home(word, at);
        } else {
            let setup = self.moves();
            self.names.used(self.key(word, at), setup, way, at);
        }
        true
    }

    /// Whether the program has no data of this name itself.
    fn is_of_all_programs(&self, word: &[u8]) -> bool {
        let name = self.key(word, self.c.at);
        name == hashed(word) && !self.names.defines(name) && self.names.set_at(name).is_none()
    }

    /// A motion to the cell's home, which stays as it is; the arm's posture behind it is known where the controller's files give it.
    fn goes_home(&mut self, word: &[u8], at: usize) {
        self.names.visit(Visit::Unknown);
        if let Some(axes) = self.elsewhere.values(word, &AXES) {
            let mut q = Joints::default();
            q.iter_mut().zip(axes).for_each(|(to, deg)| *to = deg.to_radians());
            self.names.visit(Visit::Like(self.scan.nearest.len() as u32));
            self.scan.nearest.push(q);
        }
        self.scan.homes.push((at, lower(word)));
    }

    /// The setup of a motion here.
    fn moves(&mut self) -> u32 {
        self.flow.moves(&self.now);
        self.scan.setup(self.now.clone())
    }

    /// The motion to a target that is written out at `at`.
    fn goes_to(&mut self, at: usize, found: &Aggregate<'_>) -> Visit {
        match (self.target(found, Span::default()), found.unread()) {
            (Some(spot), _) => {
                let setup = self.moves();
                self.scan.assign(spot, setup);
                return Visit::To(spot);
            }
            (None, Some(span)) => self.scan.unread(span, self.c.bytes),
            (None, None) => {
                let what = "gives some of its coordinates only; the others are those of the target before";
                self.scan.problem(at, what);
            }
        }
        Visit::Unknown
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
}

/// The name before the next bracket of the line (`REAL F(X:IN)`, `DECL 3 WHEN $IN[1] DO STOP()`); the cursor is behind the name.
fn before_bracket(c: &mut Cursor<'_>) -> u64 {
    let line = c.until(b"(;\n\r").trim_ascii_end();
    let name = line.iter().rev().take_while(|b| b.is_ascii_alphanumeric() || b"_$".contains(b)).count();
    c.at += line.len();
    hashed(&line[line.len() - name..])
}

/// XP1 goes with FP1.
fn target_of(motion_data: &[u8]) -> u64 {
    let mut name = motion_data.to_vec();
    if let Some(first) = name.first_mut() {
        *first = b'X';
    }
    hashed(&name)
}
