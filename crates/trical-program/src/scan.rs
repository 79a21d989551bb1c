//! What a program holds: targets, tools and frames, and the order in which the arm visits them.

use std::collections::hash_map::DefaultHasher;
use std::collections::{HashMap, HashSet};
use std::hash::{Hash, Hasher};

use nalgebra::Vector3;
use trical_model::Joints;

use crate::branch::Configuration;
use crate::frames::Frames;
use crate::literal::{Meant, Shape};
use crate::other_use::OtherUse;
use crate::packed::{External, Packed, Written};
use crate::text::{Span, lower};

/// A target in the text. Programs have millions of them: the rest of it is asked of the [`Scan`].
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    /// Where it begins in `Scan::written`.
    first: u32,
    /// Index into `Scan::configurations`.
    configuration: u32,
    /// Index into `Scan::setups`, or [`OWN_SETUP`].
    setup: u32,
    /// What its numbers say.
    pub shape: Shape,
}

impl Spot {
    /// Index into `Scan::setups`; `None` where nothing in the file says it.
    #[must_use]
    pub fn setup(&self) -> Option<u32> {
        (self.setup != OWN_SETUP).then_some(self.setup)
    }
}

/// The tool and the frame that targets are meant with; `None` is what the file's user says, or the cell's tool and the
/// controller's world.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Setup {
    /// Lower-case name of the tool.
    pub tool: Option<String>,
    /// Lower-case name of the work object, base or user frame.
    pub frame: Option<String>,
}

impl Setup {
    /// The tool, or the frame.
    #[must_use]
    pub fn of(&self, is_tool: bool) -> Option<&String> {
        if is_tool { self.tool.as_ref() } else { self.frame.as_ref() }
    }

    /// As [`Self::of`], to set it.
    pub fn slot(&mut self, is_tool: bool) -> &mut Option<String> {
        if is_tool { &mut self.tool } else { &mut self.frame }
    }

    /// Whether its tool stands for one of which nobody knows which it is.
    #[must_use]
    pub fn is_unsaid(&self) -> bool {
        self.tool.as_deref().is_some_and(Self::says_no_tool)
    }

    /// Whether this name of a tool stands for one of which nobody knows which it is.
    #[must_use]
    pub fn says_no_tool(name: &str) -> bool {
        name.starts_with('(')
    }

    /// For messages.
    #[must_use]
    pub fn in_words(&self) -> String {
        let tool = match self.tool.as_deref() {
            Some(name) if Self::says_no_tool(name) => name.trim_matches(['(', ')']).to_owned(),
            Some(name) => format!("tool '{name}'"),
            None => "the cell's tool".to_owned(),
        };
        let frame = self.frame.as_deref().map_or("the robot's base".to_owned(), |f| format!("'{f}'"));
        format!("{tool} in {frame}")
    }
}

/// Stands for the setup that a target says itself.
pub const OWN_SETUP: u32 = u32::MAX;

/// One motion of the program.
#[derive(Clone, Copy, Debug)]
pub enum Visit {
    /// To a target (index into `Scan::spots`).
    To(u32),
    /// To a place that is shifted against a target (index into `Scan::near`): the target itself stays, but the next one is approached from there.
    Near(u32),
    /// No motion: the next target is reached in the configuration nearest to these joints (index into `Scan::nearest`).
    Like(u32),
    /// No motion: whether the motions that follow go along a path, on which the controller asks for no configuration.
    OnPath(bool),
    /// To a place that only the running program knows.
    Unknown,
    /// No motion: the program need not come from the text above.
    Fork(Fork),
    /// No motion: here begins a routine of the file, with half of its hashed name.
    Routine(u32),
    /// No motion: the routine ends that began last.
    Ends,
    /// A call of a routine of the file that moves the arm, as [`Self::Routine`].
    Call(u32),
}

impl Visit {
    /// Whether it says how the program goes, and moves nothing by itself.
    #[must_use]
    pub fn is_no_motion(&self) -> bool {
        matches!(self, Self::Fork(_) | Self::Like(_) | Self::OnPath(_) | Self::Routine(_) | Self::Ends)
    }
}

/// A motion to a place that is shifted against a target.
#[derive(Clone, Copy, Debug)]
pub struct Near {
    /// Index into `Scan::spots`.
    pub spot: u32,
    /// How far.
    pub shift: Shift,
    /// Where the motion stands in the file.
    pub at: u32,
}

/// How far a place is from a target.
#[derive(Clone, Copy, Debug)]
pub struct Shift {
    /// In m.
    pub by: Vector3<f64>,
    /// Along the tool's axes; else along the frame's.
    pub in_tool: bool,
}

/// From where the program comes to a place in the text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fork {
    /// The first of some branches begins.
    Opens,
    /// From where the first of them began: another branch.
    Other,
    /// As [`Self::Other`], the branch that is taken where no other is.
    Else,
    /// A loop begins: from above, or from its end.
    Repeats,
    /// From the end of any of them (or of the loop), or past them all.
    Closes,
    /// From anywhere: a label, a routine, behind a call of one that moves the arm.
    Anywhere,
}

/// A call of a routine.
#[derive(Clone, Debug)]
pub struct Call {
    /// In lower case.
    pub name: String,
    /// Where it stands in the file.
    pub at: usize,
    /// Whether its line begins with it; else it may be a function of the language.
    pub is_statement: bool,
}

/// What a routine of another file does.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Outside {
    /// Tool and frame that it leaves set.
    pub setup: Setup,
    /// Whether it moves the arm.
    pub moves: bool,
    /// Whether it displaces the motions that follow.
    pub displaces: bool,
    /// Whether it sets data whose name only the running program knows.
    pub sets_by_name: bool,
    /// Data of others that it sets, by their hashed names.
    pub sets: Vec<u64>,
    /// What it does with each of its arguments, where its language says so.
    pub takes: Vec<Taken>,
}

/// What a routine does with a target that it is given.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Taken {
    /// With which tools and frames it goes there; `None` is what is set at the call.
    pub goes: Vec<Setup>,
    /// Whether it may change it.
    pub may_change: bool,
    /// Whether it reads or sets single angles of it.
    pub one_angle: bool,
}

/// Names that stand in a target in the place of numbers, each with its numbers where the program declares it.
pub type Parts = Vec<(Span, Vec<Span>)>;

/// What a dialect's reader found.
#[derive(Debug, Default)]
pub struct Scan {
    /// Targets in the order of the file.
    pub spots: Vec<Spot>,
    written: Packed,
    configurations: Vec<Configuration>,
    configuration_indices: HashMap<Configuration, u32>,
    /// The other setup of targets that are used with several, by `Spot::first`.
    ambiguous: HashMap<u32, u32>,
    /// What else the program does with the numbers of targets, by `Spot::first`.
    other_uses: HashMap<u32, OtherUse>,
    /// What the language calls the turns about z, y and x.
    pub angles: [&'static str; 3],
    /// Values of numbers that are written as expressions, by their offset.
    expressions: HashMap<u32, f64>,
    /// Of targets in which names stand in the place of numbers, where they begin in the file and these names, by `Spot::first`.
    named_parts: HashMap<u32, (u32, Parts)>,
    /// Tools and frames that targets are used with.
    pub setups: Vec<Setup>,
    setup_indices: HashMap<Setup, u32>,
    /// What each routine, by its hashed name, leaves set.
    pub routines: HashMap<u64, Setup>,
    /// What each routine, by its hashed name, does with what others give to it.
    pub takes: HashMap<u64, Vec<Taken>>,
    /// What is set where each routine, by its hashed name, is called.
    pub called_with: HashMap<u64, Setup>,
    /// Motions to names of which the file says nothing: the hashed name, and the setup.
    pub goes_elsewhere: HashSet<(u64, u32)>,
    /// Calls of routines that are in no file that was read.
    pub calls: Vec<Call>,
    /// What called routines of other files do, and where they are called.
    pub called: Vec<(usize, Outside)>,
    /// In the order of the program, as far as the file tells; targets that no motion names are not in it.
    pub visits: Vec<Visit>,
    /// Motions to places that are shifted against targets.
    pub near: Vec<Near>,
    /// How far places of motions to names are from these.
    shifts: Vec<Shift>,
    /// Joints that the program gives to choose a configuration by, rad.
    pub nearest: Vec<Joints>,
    /// Motions, and changes of a target's coordinates, that are relative to a target by what only the running program knows.
    pub relative: Vec<u32>,
    /// Of joint values in columns: which joints are given in mm; empty where the program's language says no unit.
    pub in_mm: Vec<bool>,
    /// `L` or `R`, the first that a position has: to which side the elbow of a SCARA points.
    pub hand: Option<u8>,
    /// Of numbers in columns: how many of the shape's units (mm, deg) one of the column's is; empty where they are the same.
    pub scales: Vec<f64>,
    /// Where the program says what the arm carries beside its tools (`GripLoad`, `set_payload`), which is not read.
    pub loads: Vec<usize>,
    /// Tools and frames that the program declares.
    pub frames: Frames,
    /// Tools (`true`) and frames of the controller that the program sets where it may have used them before: these may be as the controller has
    /// them, or as the program says.
    pub set_late: HashSet<(bool, String)>,
    /// Motions whose target cannot be rewritten, and places where one stands: offset and reason.
    pub problems: Vec<(usize, String)>,
    /// Where places are calculated to which the arm moves, which is among the problems.
    pub calculated_places: Vec<usize>,
    /// Where places are given to functions that nobody has read, which is among the problems.
    pub given_away: Vec<usize>,
    /// Motions to a home that belongs to all programs: offset and name.
    pub homes: Vec<(usize, String)>,
    /// Targets that stay as they are because nothing uses their numbers: offset and name.
    pub unused: Vec<(usize, Span)>,
    /// Data that look like targets and stay as they are, because no motion goes there and other statements use their numbers: as `unused`.
    pub only_read: Vec<(usize, Span)>,
    /// Whether the program switches the controller's check of configurations off.
    pub configuration_off: bool,
}

impl Scan {
    /// The first visit that says how the arm stands: joint values, or a configuration, rather one that the controller asks for.
    pub fn first_seed(&self) -> Option<usize> {
        let (mut on_path, mut unasked) = (false, None);
        for (k, v) in self.visits.iter().enumerate() {
            match v {
                Visit::OnPath(is) => on_path = *is,
                Visit::Like(_) => return Some(k),
                Visit::To(spot) => match self.spots.get(*spot as usize) {
                    Some(s) if s.shape.is_joints() => return Some(k),
                    Some(s) if self.configuration(s) != Configuration::Free && !on_path => return Some(k),
                    Some(s) if self.configuration(s) != Configuration::Free => unasked = unasked.or(Some(k)),
                    _ => {}
                },
                _ => {}
            }
        }
        unasked
    }

    /// What a target has in the text.
    #[must_use]
    pub fn written(&self, spot: &Spot) -> Written {
        self.written.get(spot.first)
    }

    /// The configuration that the text of a target demands.
    #[must_use]
    pub fn configuration(&self, spot: &Spot) -> Configuration {
        self.configurations.get(spot.configuration as usize).copied().unwrap_or(Configuration::Free)
    }

    /// Where a target begins in the file.
    #[must_use]
    pub fn at(&self, spot: &Spot) -> usize {
        let named = self.named_parts.get(&spot.first).map(|(at, _)| *at);
        named.or_else(|| self.written(spot).numbers.first().map(|s| s.at)).unwrap_or(0) as usize
    }

    /// Adds a target; numbers of its configuration stand behind the others.
    pub fn push(
        &mut self,
        shape: Shape,
        numbers: &[Span],
        configuration: Configuration,
        name: Span,
        external: External,
    ) -> u32 {
        let first = self.written.push(numbers, name, external);
        let configuration = index_of(configuration, &mut self.configurations, &mut self.configuration_indices);
        self.spots.push(Spot { first, configuration, setup: OWN_SETUP, shape });
        (self.spots.len() - 1) as u32
    }

    /// The newest target has the data of these names (the spans) for some of its numbers; it begins at `at`.
    pub fn named_parts(&mut self, at: u32, parts: Parts) {
        self.named_parts.extend(self.spots.last().map(|spot| (spot.first, (at, parts))));
    }

    /// Names in a target, each with its numbers where the program declares it.
    pub fn parts_of(&self, spot: &Spot) -> impl Iterator<Item = &(Span, Vec<Span>)> {
        self.named_parts.get(&spot.first).into_iter().flat_map(|(_, parts)| parts)
    }

    /// Keeps the value of a number that is written as an expression.
    pub fn calculated(&mut self, span: Span, value: f64) {
        self.expressions.insert(span.at, value);
    }

    /// The number at a place of the file, calculated where it is an expression.
    #[must_use]
    pub fn value(&self, span: Span, bytes: &[u8]) -> Option<f64> {
        match self.expressions.get(&span.at) {
            Some(value) if !self.expressions.is_empty() => Some(*value),
            _ => span.value(bytes),
        }
    }

    /// How many of its shape's units one unit of number `k` of a target is.
    #[must_use]
    pub fn scale(&self, k: usize) -> f64 {
        self.scales.get(k).copied().unwrap_or(1.0)
    }

    /// Takes targets away that turned out to be none (`gone` by index), and their visits.
    pub fn remove(&mut self, gone: &HashSet<u32>) {
        if gone.is_empty() {
            return;
        }
        let mut left = 0..;
        let moved: Vec<Option<u32>> =
            (0..self.spots.len() as u32).map(|k| if gone.contains(&k) { None } else { left.next() }).collect();
        let mut kept = moved.iter();
        self.spots.retain(|_| kept.next().is_some_and(Option::is_some));
        for visit in &mut self.visits {
            let spot = match visit {
                Visit::To(spot) => Some(spot),
                Visit::Near(k) => self.near.get_mut(*k as usize).map(|near| &mut near.spot),
                _ => None,
            };
            let Some(spot) = spot else { continue };
            match moved.get(*spot as usize) {
                Some(Some(to)) => *spot = *to,
                _ => *visit = Visit::Unknown,
            }
        }
    }

    /// The index of how far a place is from a target.
    pub fn shift(&mut self, by: Vector3<f64>, in_tool: bool) -> u32 {
        self.shifts.push(Shift { by, in_tool });
        (self.shifts.len() - 1) as u32
    }

    /// A motion at `at` to a place that is shifted against a target.
    pub fn visit_near(&mut self, spot: u32, shift: u32, at: u32) {
        let Some(shift) = self.shifts.get(shift as usize).copied() else { return };
        self.visits.push(Visit::Near(self.near.len() as u32));
        self.near.push(Near { spot, shift, at });
    }

    /// Gives a target its setup; a second one is remembered as a contradiction.
    pub fn assign(&mut self, spot: u32, setup: u32) {
        if setup == OWN_SETUP {
            return;
        }
        let Self { spots, setups, ambiguous, .. } = self;
        if let Some(s) = spots.get_mut(spot as usize) {
            let tool = |setup: u32| setups.get(setup as usize).map(|s| &s.tool);
            match s.setup() {
                None => s.setup = setup,
                // joint values are in no frame
                Some(known) if s.shape.is_joints() && tool(known) == tool(setup) => {}
                Some(known) if known != setup => drop(ambiguous.insert(s.first, setup)),
                Some(_) => {}
            }
        }
    }

    /// A target has this setup, whatever it had.
    pub fn mean(&mut self, spot: usize, setup: u32) {
        self.spots.get_mut(spot).into_iter().for_each(|s| s.setup = setup);
    }

    /// Another setup that a target is used with, where there is one.
    #[must_use]
    pub fn ambiguous(&self, spot: &Spot) -> Option<u32> {
        self.ambiguous.get(&spot.first).copied()
    }

    /// The program does this, too, with the numbers of a target.
    pub fn also_used(&mut self, spot: u32, other: OtherUse) {
        let Some(spot) = self.spots.get(spot as usize) else { return };
        let known = self.other_uses.entry(spot.first).or_insert(other);
        *known = other.min(*known);
    }

    /// Why a target stays as it is because of what else the program does with its numbers, if it has to.
    #[must_use]
    pub fn forbidden(&self, spot: &Spot, meant: &Meant) -> Option<String> {
        self.other_uses.get(&spot.first)?.forbids(meant, self.angles)
    }

    /// A target has these setups in the place of this one.
    pub fn reassign(&mut self, spot: u32, instead_of: u32, setups: impl Iterator<Item = u32>) {
        match self.spots.get_mut(spot as usize) {
            Some(s) if s.setup() == Some(instead_of) => s.setup = OWN_SETUP,
            _ => return,
        }
        setups.for_each(|setup| self.assign(spot, setup));
    }

    /// Lists a motion or a target at `at` that cannot be rewritten as it should be.
    pub fn problem(&mut self, at: usize, what: impl Into<String>) {
        self.problems.push((at, what.into()));
    }

    /// Lists a target with a number (in the text here) whose value nobody knows.
    pub fn unread(&mut self, number: Span, bytes: &[u8]) {
        let text = String::from_utf8_lossy(number.text(bytes));
        let what = format!("holds '{}', whose value only the running program knows", text.trim());
        self.problem(number.at as usize, what);
    }

    /// Lists a motion at `at` to what the program calculates.
    pub fn goes_to_calculated(&mut self, at: usize) {
        self.calculated_places.push(at);
        self.problem(at, "goes to a place that only the running program calculates");
    }

    /// Bytes in which the targets and the order of the visits are kept.
    #[cfg(test)]
    pub(crate) fn bytes_kept(&self) -> usize {
        size_of_val(&self.spots[..]) + size_of_val(&self.visits[..]) + self.written.bytes()
    }

    /// The index of a setup.
    pub fn setup(&mut self, setup: Setup) -> u32 {
        index_of(setup, &mut self.setups, &mut self.setup_indices)
    }
}

/// Where one stands among all; a new one comes last.
fn index_of<T: Clone + Eq + Hash>(one: T, all: &mut Vec<T>, indices: &mut HashMap<T, u32>) -> u32 {
    if let Some(known) = indices.get(&one) {
        return *known;
    }
    let index = all.len() as u32;
    all.push(one.clone());
    indices.insert(one, index);
    index
}

/// What is wrong with a tool or frame that the program changes.
#[must_use]
pub fn changed_here(what: &str) -> String {
    format!("{what} is changed here while the program runs; its targets are corrected for where it is declared")
}

/// All names to which steps lead from these, themselves among them.
#[must_use]
pub fn reached<I: IntoIterator<Item = u64>>(
    from: impl IntoIterator<Item = u64>,
    step: impl Fn(u64) -> I,
) -> HashSet<u64> {
    let (mut found, mut next) = (HashSet::new(), from.into_iter().collect::<Vec<_>>());
    while let Some(name) = next.pop() {
        if found.insert(name) {
            next.extend(step(name));
        }
    }
    found
}

/// As [`hashed`], in a language that tells `WP` from `wp`.
#[must_use]
pub fn hashed_as_written(name: &[u8]) -> u64 {
    let mut h = DefaultHasher::new();
    h.write(name);
    h.finish()
}

/// 64 bits that stand for a name, whatever is in capitals.
#[must_use]
pub fn hashed(name: &[u8]) -> u64 {
    if !name.is_ascii() {
        return hashed_as_written(lower(name).as_bytes());
    }
    let mut h = DefaultHasher::new();
    for b in name {
        h.write_u8(b.to_ascii_lowercase());
    }
    h.finish()
}
