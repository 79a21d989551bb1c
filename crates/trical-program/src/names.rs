//! Which names stand for which targets, and how motions use them.

mod resolve;
mod sources;
mod unused;

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use crate::other_use::OtherUse;
use crate::reaching::{Definition, Part};
use crate::scan::{Fork, OWN_SETUP, Scan, Visit, hashed_as_written, reached};
use crate::text::Span;

/// How a motion names its place.
#[derive(Clone, Copy, Debug)]
pub enum Way {
    /// The target itself.
    To,
    /// Element `k` (0-based) of an array of targets.
    Element(usize),
    /// Shifted against it (what [`Scan::shift`] returned).
    Near(u32),
    /// Related to it in a way that is known only when the program runs.
    Computed,
    /// An element of a list of targets that is known only when the program runs.
    Indexed,
    /// Perhaps the target itself: a name that may as well be a speed.
    Perhaps,
    /// No motion: the file says otherwise with which tool and frame it is meant.
    Said,
}

impl Way {
    /// The element that the motion goes to, where it is one of an array and known.
    fn element(self) -> Option<usize> {
        if let Self::Element(k) = self { Some(k) } else { None }
    }
}

/// What a motion goes to in one call of the routine in which it stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Meant {
    /// The target's name.
    pub name: u64,
    /// With which setup.
    pub setup: u32,
    /// Whether what the call gives is shifted against the target.
    pub is_shifted: bool,
}

/// Where data that a program sets come from.
#[derive(Clone, Copy, Debug)]
pub enum Origin {
    /// From the data of this name: a copy, or shifted against them. What is corrected there goes with it.
    Name {
        /// Their name.
        name: u64,
        /// Where the program sets them.
        at: u32,
    },
    /// From where the arm is when the program asks.
    Here,
    /// From a calculation (at this offset) that only the running program does.
    Computed(u32),
    /// From a module that calls the routine at this offset.
    Around(u32),
    /// Perhaps from a routine that is called at this offset and that nobody has read.
    Perhaps(u32),
}

/// Places in the program that set the same name and are looked at, at most; of one that is set at more, nobody knows from what.
const MOST_ORIGINS: usize = 10_000;
/// Names that are followed from one motion, at most.
const MOST_NAMES: usize = 50;

/// Which names stand for which targets, and how motions use them. Names are kept as hashes: programs have millions.
#[derive(Debug, Default)]
pub struct Names {
    defined: HashMap<u64, u32>,
    groups: Vec<Group>,
    uses: Vec<Use>,
    /// Motions to names, among these.
    motions: Vec<Motion>,
    /// Those to names that may as well be speeds, by name and setup.
    perhaps: HashMap<(u64, u32), u32>,
    /// Calls, among these: what is called, and whether it may move the arm if it is no routine of this file.
    calls: Vec<(u64, bool)>,
    /// What names are set from, and whether where that stands is known ([`Self::set_here`]).
    origins: HashMap<u64, Vec<(Origin, bool)>>,
    /// Names with others that they are set from, and whether from their data as they are.
    copies: HashSet<(u64, u64, bool, bool)>,
    /// Names that are set from others.
    set_from_others: HashSet<u64>,
    /// Names that the file sets and does not declare: they may have numbers elsewhere.
    elsewhere: HashSet<u64>,
    /// What the definitions without numbers of their own are set from.
    set_here: HashMap<u32, Origin>,
    /// Names that have such definitions.
    moved_on: HashSet<u64>,
    /// Names whose calculations were listed.
    settled: HashSet<u64>,
    /// Names whose sources were followed, by the setups of the motions that go there.
    followed_on: HashSet<(u64, u32)>,
    /// Names whose numbers are used wherever they are, by the setups of the motions that go there by other names.
    used_on: HashSet<(u64, u32)>,
    /// Names with many definitions to any of which motions go: with which setups, and to which elements.
    met_any: HashSet<(u64, u32, Option<usize>)>,
    /// What was found of names without data, by the setups of the motions that go there; behind it `is_shifted` and `meets_target`.
    followed: HashMap<(u64, u32), (Option<bool>, bool, bool)>,
    /// Names whose data are in `Scan::problems` already.
    listed: HashSet<u64>,
    /// Names of data that look like targets and are none, unless a motion goes there.
    no_targets: HashSet<u64>,
    /// Where data are used as something else than a place of the arm, and their names.
    otherwise: Vec<(u64, u32)>,
    /// Targets that are meant there, each with where.
    meant_otherwise: BTreeMap<u32, u32>,
    /// Where names are set from data as they are: what goes there is relative to nothing.
    copied_at: HashSet<u32>,
    /// Whether a name that is being followed is set from another one and shifted against it.
    is_shifted: bool,
    /// Whether data are among these that have numbers in the file, and not only places where the arm is.
    meets_target: bool,
    /// Calculations that are listed already.
    listed_at: HashSet<u32>,
    /// Where coordinates of data are changed by some amount, as in `p.trans.z:=p.trans.z+50`.
    changed: HashMap<u64, Vec<u32>>,
    /// The routine that is being read, behind those around it.
    within: Vec<u64>,
    /// Routines of this file.
    routines: HashMap<u64, Routine>,
    /// Those that may run at any time: of traps, interrupts and threads.
    any_time: HashSet<u64>,
    /// Whether a handler of errors is being read, behind which a motion above it may be tried again.
    in_handler: bool,
    /// Names that handlers set.
    set_in_handlers: HashSet<u64>,
    /// Groups to which motions go by the names of what is set from them.
    by_another_name: Vec<u32>,
    /// Targets that something uses.
    in_use: Vec<bool>,
    /// Names to which motions go.
    gone_to: HashSet<u64>,
    /// Data that look like targets and give no place: the name, and where they stand and what they are called there.
    placeholders: Vec<(u64, (usize, Span))>,
    /// Names to which motions go where nothing gives them a place.
    missed: HashSet<u64>,
    /// Names that statements use.
    read: HashSet<u64>,
    /// Names of which the program calculates a frame, and where.
    makes_frame: Vec<(u64, u32)>,
    /// What else the program does with the numbers of names.
    other_uses: BTreeMap<u64, OtherUse>,
    /// Whether the file has no motion of its own.
    only_data: bool,
    /// What begins comments, in a language in which [`Self::read`] is seen from the names in the text.
    comment: Option<u8>,
    /// Names that the file declares, where its language has data declared.
    declared: Option<HashSet<u64>>,
    /// Names that are set, in a program without routines, above all of its branches and jumps, and how many steps stand above: from there on
    /// they are no more what they were elsewhere.
    set_first: HashMap<u64, usize>,
    /// The step of the program that is being resolved.
    step: usize,
    /// Whether a branch or a jump was read.
    is_branched: bool,
    /// Whether other motions come between those to the elements of an array.
    apart: bool,
    /// Motions (name and setup) that say something else in each call of the routine in which they stand.
    meant: HashMap<(u64, u32), Vec<Meant>>,
}

#[derive(Debug, Default)]
struct Routine {
    /// Whether a motion stands in it.
    moves: bool,
    calls: HashSet<u64>,
}

/// A definition: targets that the text gives together; none where it sets the name from something else.
#[derive(Clone, Copy, Debug)]
struct Group {
    definition: Definition,
    first: u32,
    count: u32,
    /// An earlier definition of the same name.
    earlier: Option<u32>,
    /// The setup of the last use of all of it.
    used: Option<u32>,
}

/// A motion to a name, which stands at `at`.
#[derive(Clone, Copy, Debug)]
struct Motion {
    name: u64,
    setup: u32,
    way: Way,
    at: u32,
}

#[derive(Clone, Copy, Debug)]
enum Use {
    /// Index into `Names::motions`.
    Named(u32),
    Direct(Visit),
    /// Index into `Names::calls`.
    Called(u32),
    /// Index into `Names::otherwise`.
    Otherwise(u32),
}

impl Names {
    /// In a language whose comments this begins: which names its statements use is seen from the text.
    #[must_use]
    pub fn in_text(self, comment: u8) -> Self {
        Self { comment: Some(comment), ..self }
    }

    /// None yet, in a language that has data declared: what a file only sets is declared elsewhere.
    #[must_use]
    pub fn with_declarations() -> Self {
        Self { declared: Some(HashSet::new()), ..Self::default() }
    }

    /// Data of this name are declared in the file.
    pub fn declare(&mut self, name: u64) {
        self.declared.iter_mut().for_each(|all| all.extend([name]));
    }

    /// The program may jump from here to what stands below.
    pub fn jumps(&mut self) {
        self.is_branched = true;
    }

    /// Targets `first..end` have this name (several: an array).
    pub fn define(&mut self, name: u64, first: usize, end: usize) {
        self.define_part(name, Part::Whole, first, end);
    }

    /// Targets `first..end` are this part of the data of this name.
    pub fn define_part(&mut self, name: u64, part: Part, first: usize, end: usize) {
        if end <= first {
            return;
        }
        let index = self.groups.len() as u32;
        let definition = self.definition_here(name, part);
        self.groups.push(Group {
            definition,
            first: first as u32,
            count: (end - first) as u32,
            earlier: self.defined.insert(name, index),
            used: None,
        });
    }

    /// All of the file is read: what is told from here on, other files do. Of one without motions nobody knows what uses its targets.
    pub fn end_of_file(&mut self) {
        let is_motion = |u: &Use| match u {
            Use::Named(k) => !matches!(self.motions.get(*k as usize), Some(Motion { way: Way::Said, .. })),
            Use::Direct(visit) => !visit.is_no_motion(),
            Use::Called(_) | Use::Otherwise(_) => false,
        };
        self.only_data = !self.uses.iter().any(is_motion);
    }

    /// Whether targets of the file have this name.
    #[must_use]
    pub fn defines(&self, name: u64) -> bool {
        self.defined.contains_key(&name)
    }

    /// The program sets the data of this name, or a part of them, here: motions that come from here meet what this gives, and not what was
    /// there before.
    pub fn set_here(&mut self, name: u64, part: Part, origin: Origin) {
        // what is shifted against itself is still there; of an array, it may be another element
        let is_new = part != Part::Whole || !matches!(origin, Origin::Name { name: from, .. } if from == name);
        if is_new {
            if part == Part::Whole && self.within.is_empty() && !self.is_branched {
                self.set_first.entry(name).or_insert(self.uses.len());
            }
            self.set_here.insert(self.groups.len() as u32, origin);
            self.moved_on.insert(name);
            let definition = self.definition_here(name, part);
            self.groups.push(Group { definition, first: 0, count: 0, earlier: None, used: None });
        }
        self.keep_origin(name, origin, is_new);
    }

    fn definition_here(&mut self, name: u64, part: Part) -> Definition {
        if self.in_handler {
            self.set_in_handlers.insert(name);
        }
        Definition { name, part, within: self.within.last().copied(), above: self.uses.len() as u32 }
    }

    /// This routine may run at any time.
    pub fn runs_at_any_time(&mut self, routine: u64) {
        self.any_time.insert(routine);
    }

    /// Here begins a handler of errors of the routine that is being read.
    pub fn handler(&mut self) {
        self.in_handler = true;
        self.fork(Fork::Anywhere);
    }

    /// Names that are set where the text does not say when: a motion may meet any of their definitions.
    fn set_at_any_time(&self) -> HashSet<u64> {
        let called = |name| self.routines.get(&name).into_iter().flat_map(|own| own.calls.iter().copied());
        let routines = reached(self.any_time.iter().copied(), called);
        let is_there = |d: &&Definition| d.within.is_some_and(|within| routines.contains(&within));
        let there = self.groups.iter().map(|g| &g.definition).filter(is_there).map(|d| d.name);
        self.set_in_handlers.iter().copied().chain(there).collect()
    }

    /// Data of this name, here, look like a target and give no place: the arm goes there only if the name is set before.
    pub fn placeholder(&mut self, name: u64, place: (usize, Span)) {
        self.placeholders.push((name, place));
    }

    /// A motion goes to this name where nothing gives it a place.
    pub fn missed(&mut self, name: u64) {
        self.missed.insert(name);
    }

    /// A statement uses the data of this name.
    pub fn read(&mut self, name: u64) {
        self.read.insert(name);
    }

    /// Whether a statement does, as far as is told.
    #[must_use]
    pub fn is_read(&self, name: u64) -> bool {
        self.read.contains(&name)
    }

    /// The program does this with the data of this name, too, if motions go there.
    pub fn also_used(&mut self, name: u64, other: OtherUse) {
        let known = self.other_uses.entry(name).or_insert(other);
        *known = other.min(*known);
    }

    /// Tells what else the program does with the numbers of targets to which motions go, or with data that are set from these.
    fn tell_other_uses(&self, scan: &mut Scan) {
        for (spot, at) in &self.meant_otherwise {
            if self.in_use.get(*spot as usize) == Some(&true) {
                scan.also_used(*spot, OtherUse::NoPlace(*at));
            }
        }
        for (name, other) in &self.other_uses {
            let all = reached([*name], |name| self.set_from_names(name));
            let groups = all.into_iter().flat_map(|name| self.all(name)).filter_map(|k| self.groups.get(k as usize));
            for spot in groups.flat_map(|g| g.first..g.first + g.count) {
                if self.in_use.get(spot as usize) == Some(&true) {
                    scan.also_used(spot, *other);
                }
            }
        }
    }

    /// The names whose data are set from those of this one, itself among them.
    #[must_use]
    pub fn copies_of(&self, name: u64) -> HashSet<u64> {
        reached([name], |name| self.copies.iter().filter(move |(_, from, ..)| *from == name).map(|(to, ..)| *to))
    }

    /// With which setups motions go to the data of these names.
    #[must_use]
    pub fn gone_to_with(&self, names: &HashSet<u64>) -> BTreeSet<u32> {
        if names.is_empty() {
            return BTreeSet::new();
        }
        self.motions.iter().filter(|motion| names.contains(&motion.name)).map(|motion| motion.setup).collect()
    }

    /// The names from which the data of this one are set.
    fn set_from_names(&self, name: u64) -> impl Iterator<Item = u64> {
        let from = |origin| if let Origin::Name { name, .. } = origin { Some(name) } else { None };
        self.set_anywhere(name).filter_map(from)
    }

    /// The program calculates a frame from the data of this name, among others, here.
    pub fn makes_frame(&mut self, name: u64, at: usize) {
        self.makes_frame.push((name, at as u32));
    }

    /// Lists frames that are calculated from targets to which motions go.
    fn list_frames(&self, scan: &mut Scan) {
        let is_target = |name: u64| {
            let mut spots =
                self.all(name).filter_map(|k| self.groups.get(k as usize)).flat_map(|g| g.first..g.first + g.count);
            spots.any(|spot| self.in_use.get(spot as usize) == Some(&true))
        };
        let mut places: Vec<u32> =
            self.makes_frame.iter().filter(|(name, _)| is_target(*name)).map(|(_, at)| *at).collect();
        places.dedup();
        let what =
            "calculates a frame from targets to which the arm moves: they are corrected, and the frame moves with them";
        places.into_iter().for_each(|at| scan.problem(at as usize, what));
    }

    fn use_targets(&mut self, targets: std::ops::Range<u32>) {
        let end = targets.end as usize;
        if self.in_use.len() < end {
            self.in_use.resize(end, false);
        }
        self.in_use.get_mut(targets.start as usize..end).into_iter().flatten().for_each(|used| *used = true);
    }

    /// A motion to a named target; the name stands at `at`.
    pub fn used(&mut self, name: u64, setup: u32, way: Way, at: usize) {
        if !matches!(way, Way::Said) {
            self.moves();
        }
        let index = self.motions.len() as u32;
        // programs name the same speeds again and again, and where is asked of none
        let known = match way {
            Way::Perhaps => *self.perhaps.entry((name, setup)).or_insert(index),
            _ => index,
        };
        self.uses.push(Use::Named(known));
        if known == index {
            self.motions.push(Motion { name, setup, way, at: at as u32 });
        }
    }

    /// The program sets the data of this name somewhere: any motion may meet that.
    pub fn set_from(&mut self, name: u64, origin: Origin) {
        self.keep_origin(name, origin, false);
    }

    /// What the program sets at this offset it sets from data as they are, by another name only.
    pub fn copied(&mut self, at: usize) {
        self.copied_at.insert(at as u32);
    }

    /// Targets `first..end`, which stand at this offset in the place of a name, get a name of their own.
    pub fn define_at(&mut self, at: usize, first: usize, end: usize) -> Origin {
        let at = at as u32;
        let name = hashed_as_written(&[&b"\0at"[..], &at.to_le_bytes()].concat());
        self.declare(name);
        self.define(name, first, end);
        self.copied_at.insert(at);
        Origin::Name { name, at }
    }

    fn keep_origin(&mut self, name: u64, origin: Origin, is_here: bool) {
        let all = self.origins.entry(name).or_default();
        let is_new = match origin {
            Origin::Name { name: from, at } => self.copies.insert((name, from, is_here, self.copied_at.contains(&at))),
            _ => true,
        };
        match (all.len().cmp(&MOST_ORIGINS), origin) {
            (Ordering::Less, _) if is_new => all.push((origin, is_here)),
            (Ordering::Equal, Origin::Name { at, .. }) if is_new => all.push((Origin::Computed(at), is_here)),
            _ => {}
        }
    }

    /// Where the program sets or changes the data of this name, if it does.
    #[must_use]
    pub fn set_at(&self, name: u64) -> Option<usize> {
        let set = self.origins.get(&name).into_iter().flatten().find_map(|(o, _)| match o {
            Origin::Name { at, .. } | Origin::Computed(at) | Origin::Around(at) | Origin::Perhaps(at) => Some(*at),
            Origin::Here => None,
        });
        let changed = || self.changed.get(&name).and_then(|all| all.first().copied());
        set.or_else(changed).map(|at| at as usize)
    }

    /// What the program sets the data of this name from, arguments' data what the calls give among them.
    pub fn set_anywhere(&self, name: u64) -> impl Iterator<Item = Origin> {
        self.origins.get(&name).into_iter().flatten().map(|(origin, _)| *origin)
    }

    /// The same without what calls give.
    pub fn set_within(&self, name: u64) -> impl Iterator<Item = Origin> {
        let all = self.origins.get(&name).into_iter().flatten();
        all.filter(|(origin, is_here)| *is_here || !matches!(origin, Origin::Name { .. })).map(|(origin, _)| *origin)
    }

    /// Where what is set here from the data of this name is shifted against them, or these are changed before, if it is so.
    #[must_use]
    pub fn shifted_at(&self, name: u64, at: u32) -> Option<u32> {
        let changed = || self.changed.get(&name).and_then(|all| all.first().copied());
        (!self.copied_at.contains(&at)).then_some(at).or_else(changed)
    }

    /// To what the motions go, and with which setups.
    #[must_use]
    pub fn motions(&self) -> BTreeSet<(u64, u32)> {
        self.motions.iter().map(|motion| (motion.name, motion.setup)).collect()
    }

    /// Motions to this name with this setup are meant as these.
    pub fn meant(&mut self, name: u64, setup: u32, all: Vec<Meant>) {
        if all.iter().any(|meant| (meant.name, meant.setup) != (name, setup)) {
            self.meant.insert((name, setup), all);
        }
    }

    /// The program changes some coordinate of these data by an amount, here.
    pub fn changed(&mut self, name: u64, at: usize) {
        let all = self.changed.entry(name).or_default();
        if all.len() < MOST_ORIGINS {
            all.push(at as u32);
        }
    }

    /// The data of this name are listed already.
    pub fn listed(&mut self, name: u64) {
        self.listed.insert(name);
    }

    /// The data of this name are no target unless a motion goes there.
    pub fn no_target(&mut self, name: u64) {
        self.no_targets.insert(name);
    }

    /// The data of this name are used here as something else than a place of the arm: as how far it is to go, or as a frame. They are no target, and
    /// where a motion goes to what is meant here, this is listed.
    pub fn used_otherwise(&mut self, name: u64, at: usize) {
        self.no_target(name);
        self.uses.push(Use::Otherwise(self.otherwise.len() as u32));
        self.otherwise.push((name, at as u32));
    }

    /// A motion to a target that says itself with what it is meant; the name stands at `at`.
    pub fn gone_to(&mut self, name: u64, relative: bool, at: usize) {
        let group = self.defined.get(&name).copied();
        match group.and_then(|g| self.groups.get_mut(g as usize)) {
            Some(g) => {
                g.used = g.used.or(Some(OWN_SETUP));
                let first = g.first;
                self.use_targets(first..first + 1);
                self.visit(if relative { Visit::Unknown } else { Visit::To(first) });
            }
            None => self.used(name, OWN_SETUP, Way::To, at),
        }
    }

    /// A motion that needs no name.
    pub fn visit(&mut self, visit: Visit) {
        self.moves();
        self.uses.push(Use::Direct(visit));
    }

    /// From where the program comes to here.
    pub fn fork(&mut self, fork: Fork) {
        self.is_branched = true;
        self.uses.push(Use::Direct(Visit::Fork(fork)));
    }

    /// A routine begins here.
    pub fn routine(&mut self, name: u64) {
        self.within.push(name);
        self.routines.entry(name).or_default();
        self.fork(Fork::Anywhere);
        self.uses.push(Use::Direct(Visit::Routine(name as u32)));
    }

    /// A block ends here; a routine, where the program comes to what is behind it from anywhere.
    pub fn end(&mut self, fork: Option<Fork>) {
        if fork == Some(Fork::Anywhere) {
            self.within.pop();
            self.in_handler = false;
            self.uses.push(Use::Direct(Visit::Ends));
        }
        fork.into_iter().for_each(|f| self.fork(f));
    }

    /// Something is called here; `elsewhere` says that it may move the arm if it is no routine of this file.
    pub fn called(&mut self, name: u64, elsewhere: bool) {
        if let Some(own) = self.own_routine() {
            own.calls.insert(name);
        }
        self.uses.push(Use::Called(self.calls.len() as u32));
        self.calls.push((name, elsewhere));
    }

    fn own_routine(&mut self) -> Option<&mut Routine> {
        self.within.last().and_then(|name| self.routines.get_mut(name))
    }

    fn moves(&mut self) {
        if let Some(own) = self.own_routine() {
            own.moves = true;
        }
    }

    /// Which routines of this file move the arm, themselves or by what they call.
    #[must_use]
    pub fn moving(&self) -> HashSet<u64> {
        let mut callers: HashMap<u64, Vec<u64>> = HashMap::new();
        for (name, own) in &self.routines {
            own.calls.iter().for_each(|called| callers.entry(*called).or_default().push(*name));
        }
        let moving = self.routines.iter().filter(|(_, own)| own.moves).map(|(name, _)| *name);
        reached(moving, |name| callers.get(&name).into_iter().flatten().copied())
    }

    /// All definitions of a name, the newest first.
    fn all(&self, name: u64) -> impl Iterator<Item = u32> {
        std::iter::successors(self.defined.get(&name).copied(), |k| self.groups.get(*k as usize)?.earlier)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_that_motions_name_again_are_kept_once() {
        let mut names = Names::default();
        for at in 0..100 {
            names.used(7, 0, Way::Perhaps, at);
            names.used(at as u64, 0, Way::To, at);
        }
        assert_eq!((names.uses.len(), names.motions.len()), (200, 101));
        assert_eq!(size_of::<Use>(), 8);
    }

    #[test]
    fn targets_at_places_whose_bytes_are_one_letter_in_capitals_and_not_have_names_of_their_own() {
        let mut names = Names::default().in_text(b';');
        let mut own = |at: u8| match names.define_at(usize::from(at), 0, 1) {
            Origin::Name { name, .. } => name,
            _ => 0,
        };
        assert_ne!(own(b'A'), own(b'a'));
    }
}
