//! What RAPID's readers share: where they are in the text, and what they have found.

use std::collections::{HashMap, HashSet, VecDeque};

use super::angles::single_angles;
use super::given::Calls;
use super::parts::{Piece, parts};
use super::records::{Kind, Records};
use crate::elsewhere::{Elsewhere, Goes, Outside};
use crate::expression::Constants;
use crate::frames::Frames;
use crate::names::{Names, Way};
use crate::scan::{Scan, hashed};
use crate::text::{Cursor, Span, is_one_of, lower};

/// A module, as far as it is read.
#[derive(Default)]
pub(super) struct Reader<'a> {
    pub(super) c: Cursor<'a>,
    pub(super) scan: Scan,
    pub(super) names: Names,
    pub(super) constants: Constants,
    /// Name of the data that is being read.
    pub(super) name: Span,
    /// Whether some of these data are placeholders, without any orientation.
    pub(super) placeholders: bool,
    /// Elements of the list that is being read.
    pub(super) elements: Vec<Element>,
    /// Conditions of an `IF` without `THEN` behind which the instruction stands that is being read.
    pub(super) conditions: usize,
    /// Routines of this file, and which targets, tools and work objects they get.
    pub(super) routines: HashMap<u64, Vec<Parameter>>,
    /// Those that are functions, and whether what they return is a target.
    pub(super) functions: HashMap<u64, bool>,
    /// Targets, tools and work objects of the routine that is being read, and of its module alone, and what they are called outside it.
    pub(super) locals: HashMap<u64, u64>,
    /// Whether several modules stand in the file.
    pub(super) has_modules: bool,
    /// The module that is being read, where there are several.
    pub(super) module: String,
    /// What it has for itself (`LOCAL`), as in `locals`.
    pub(super) of_module: HashMap<u64, u64>,
    /// Targets that are declared without numbers.
    pub(super) unset: HashSet<u64>,
    /// Arrays of targets.
    pub(super) arrays: HashSet<u64>,
    /// Arrays of what is no target.
    pub(super) tables: HashSet<u64>,
    /// Positions, orientations, configurations and external axes of the module that nothing changes.
    pub(super) parts: HashMap<u64, Piece>,
    /// Those that stand in targets.
    pub(super) used_parts: Vec<String>,
    /// What calls give to routines of this file, and what its functions return.
    pub(super) calls: Calls,
    /// Records of the module, and the kinds of targets and of data of records.
    pub(super) records: Records,
    pub(super) record_data: HashMap<u64, Kind>,
    /// Single angles of data that stand below the cursor: where, and the name of the data.
    pub(super) single_angles: VecDeque<(usize, &'a [u8])>,
    pub(super) elsewhere: &'a dyn Elsewhere,
    /// What is given to routines that may change it.
    pub(super) lent: Vec<Lent>,
    /// Data that are changed elsewhere, or may be: where that begins, and how.
    pub(super) changed_elsewhere: HashMap<u64, (usize, &'static str)>,
    /// Where the routines of this file begin.
    pub(super) heads: HashMap<u64, usize>,
    /// Routines of other modules that were asked for.
    pub(super) outside: HashMap<u64, Option<Outside>>,
    /// The routine that is being read, in lower case; empty outside any.
    pub(super) within: String,
    /// Whether the declaration that is being read begins with LOCAL.
    pub(super) is_local: bool,
    /// Targets and arguments to which motions of other modules go.
    pub(super) wanted: HashSet<u64>,
    /// Names of which other modules were asked whether they are tools, or work objects.
    pub(super) asked: HashMap<(bool, String), bool>,
    /// What the module has for others, where they want to know it.
    pub(super) exports: Option<Exports>,
}

/// An element of a list.
pub(super) struct Element {
    /// How many targets of the file stand up to its end.
    pub(super) end: usize,
    /// What has no value in it and is no part of a target.
    pub(super) name: Option<Span>,
}

/// Where a motion goes.
pub(super) enum Place {
    Name {
        name: u64,
        way: Way,
        at: usize,
    },
    Spots(u32, u32),
    /// To where the arm is, or beside it; or to what is listed already.
    Here,
    /// To what only the running program knows; it stands here.
    Computed(usize),
}

impl Place {
    /// The name of a target.
    pub(super) fn name(&self) -> Option<u64> {
        if let Self::Name { name, .. } = self { Some(*name) } else { None }
    }
}

impl<'a> Reader<'a> {
    /// At the beginning of a module.
    pub(super) fn of(bytes: &'a [u8], elsewhere: &'a dyn Elsewhere) -> Self {
        let records = Records::of(bytes);
        let (routines, functions) = routines(bytes, &records);
        Self {
            c: Cursor::new(bytes, b'!'),
            names: Names::with_declarations().in_text(b'!'),
            constants: Constants::with_degrees(),
            routines,
            functions,
            has_modules: has_modules(bytes),
            parts: parts(bytes),
            records,
            single_angles: single_angles(bytes),
            elsewhere,
            wanted: elsewhere.wanted().into_iter().collect(),
            ..Self::default()
        }
    }
}

/// What a routine does to those that call it.
#[derive(Clone, Debug, Default)]
pub struct Effects {
    /// Whether it moves the arm.
    pub moves: bool,
    /// Whether it displaces the motions that follow.
    pub displaces: bool,
    /// Whether it sets data whose name only the running program knows.
    pub sets_by_name: bool,
    /// Data that it sets, by their hashed names.
    pub sets: Vec<u64>,
    /// What it calls, in lower case.
    pub calls: Vec<String>,
    /// Names that it gives to routines, and what they are called there.
    pub lends: Vec<(u64, u64)>,
}

/// A name that is given to a routine which may change what it stands for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lent {
    pub name: u64,
    /// What it is called in the routine (see [`scoped`]).
    pub to: u64,
    pub at: usize,
}

/// What a module has for others.
#[derive(Debug, Default)]
pub struct Exports {
    /// What its routines do.
    pub routines: HashMap<u64, Effects>,
    /// Tools and work objects that it declares.
    pub frames: Frames,
    /// Motions: to which names, and with what.
    pub goes: HashSet<(u64, Goes)>,
    /// Names that are set from others (the second ones), or get them as arguments.
    pub given: HashSet<(u64, u64)>,
    /// Data that it declares.
    pub(super) own: HashSet<u64>,
}

/// Data that a routine sets or lends and routines that it calls, at most.
const MOST: usize = 1000;

impl Effects {
    /// Sets these data.
    pub(super) fn set(&mut self, name: u64) {
        if self.sets.len() < MOST && !self.sets.contains(&name) {
            self.sets.push(name);
        }
    }

    /// Gives this name to a routine.
    pub(super) fn lend(&mut self, name: u64, to: u64) {
        if self.lends.len() < MOST && !self.lends.contains(&(name, to)) {
            self.lends.push((name, to));
        }
    }

    /// Calls this routine.
    pub(super) fn call(&mut self, word: &[u8]) {
        let name = lower(word);
        if self.calls.len() < MOST && !self.calls.contains(&name) {
            self.calls.push(name);
        }
    }
}

/// An argument that is a target, a tool or a work object.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parameter {
    /// Its hashed name.
    pub name: u64,
    /// What it is called outside its routine (see [`scoped`]).
    pub scoped: u64,
    pub is_target: bool,
    pub kind: Kind,
    /// Whether the routine may change what it gets.
    pub by_reference: bool,
}

/// Whether several modules stand in a text.
fn has_modules(bytes: &[u8]) -> bool {
    let mut c = Cursor::new(bytes, b'!');
    let words = std::iter::from_fn(|| c.next_word());
    words.filter(|(_, word)| word.eq_ignore_ascii_case(b"endmodule")).nth(1).is_some()
}

/// Bytes before a routine's bracket or a statement that are looked at.
pub(super) const FARTHEST: usize = 300;

/// The routines of a module by their hashed names and which targets, tools and work objects they get; those that are functions, and
/// whether what they return is a target.
#[must_use]
fn routines(bytes: &[u8], records: &Records) -> (HashMap<u64, Vec<Parameter>>, HashMap<u64, bool>) {
    let (mut found, mut functions) = (HashMap::new(), HashMap::new());
    let mut at = 0;
    while let Some(k) = bytes[at..].iter().position(|b| *b == b'(') {
        at += k + 1;
        // the head of a routine is short, however long the line is
        let near = at.saturating_sub(FARTHEST);
        let line = bytes[near..at].iter().rposition(|b| *b == b'\n').map_or(near, |k| near + k + 1);
        let mut words = bytes[line..at - 1].split(|b| b.is_ascii_whitespace()).filter(|w| !w.is_empty());
        let kind = words.find(|w| is_one_of(w, &[b"proc", b"func"]));
        if let (Some(kind), Some(name)) = (kind, words.next_back()) {
            if kind.eq_ignore_ascii_case(b"func") {
                let is_target = words.next().is_some_and(|value| records.hold_targets(Kind::of(value)));
                functions.insert(hashed(name), is_target);
            }
            found.insert(hashed(name), parameters(bytes, at, name, records));
        }
    }
    (found, functions)
}

/// What a name of a routine is called outside it: the same name in another routine is another one. Arguments that are
/// not named where they are given go by their place, so that a call needs to know the routine's name only.
#[must_use]
pub(super) fn scoped(name: &[u8], routine: &[u8]) -> u64 {
    hashed(&[name, b" of ", routine].concat())
}

/// The parameters of a routine that are targets, tools and work objects, from behind its bracket on.
fn parameters(bytes: &[u8], at: usize, routine: &[u8], records: &Records) -> Vec<Parameter> {
    let mut c = Cursor::at(bytes, at, b'!');
    let mut found = Vec::new();
    let (mut places, mut place, mut is_other) = (0.., None, false);
    loop {
        // what may be given instead of the one before counts as it does
        let named = c.eat(b'\\');
        if !is_other {
            place = if named { None } else { places.next() };
        }
        let mut word = c.name_ahead();
        let by_reference = is_one_of(word, &[b"inout", b"var", b"pers", b"ref"]);
        if by_reference {
            word = c.name_ahead();
        }
        let name = c.name_ahead();
        c.skip_space();
        if c.peek() == b'{' {
            // of an array: `{*,*}`
            c.at += c.until(b"}\n").len();
        }
        let kind = Kind::of(word);
        let is_target = records.hold_targets(kind);
        if is_target || is_one_of(word, &[b"tooldata", b"wobjdata"]) {
            let outside =
                place.map_or_else(|| scoped(name, routine), |k: usize| scoped(k.to_string().as_bytes(), routine));
            found.push(Parameter { name: hashed(name), scoped: outside, is_target, kind, by_reference });
        }
        c.skip_to(b",|\\)\n");
        is_other = c.peek() == b'|';
        if !matches!(c.peek(), b',' | b'|' | b'\\' | b'\n') {
            return found;
        }
        c.at += usize::from(c.peek() != b'\\');
    }
}
