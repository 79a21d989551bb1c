//! Tool and frame along a program: what a routine finds where it is called and leaves behind, and what a branch or a loop may have set.
//!
//! A reader goes through the text from its first line to its last, and tells of every block. It goes again with what the passes before saw until
//! nothing changes, since a routine may stand behind its calls, and a loop begins as it ends.

use std::collections::{HashMap, HashSet};

use crate::elsewhere::Elsewhere;
use crate::frames::STANDING;
use crate::scan::{Call, Fork, Scan, Setup, hashed};
use crate::text::{Cursor, begins_line, lower};

/// Each level of calls takes a pass or two; where something still changes after so many, nothing of routines is known.
const MOST_PASSES: usize = 100;

/// How the names begin of what nobody knows.
const UNKNOWN: &str = "an unknown";

/// Why.
const IN_BRANCH: &str = "set in a branch";
const IN_LOOP: &str = "set in a loop";
const BY_INTERRUPT: &str = "not the same wherever its interrupt may come";
const BY_CALLER: &str = "not the same wherever the routine is called";
const BY_JUMP: &str = "not the same wherever the program jumps from";
const UNSETTLED: &str = "routines call each other, or too deep";
const BY_ROUTINE: &str = "not the same wherever a routine returns";
const ELSEWHERE: &str = "set by a routine of another file";

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Block {
    /// By its hashed name.
    Routine(u64),
    /// By the byte where it begins.
    Loop(usize),
    /// Of a routine, where the program jumps to: by its hashed names.
    Label(u64, u64),
}

/// How a block was entered and left.
#[derive(Clone, Default, PartialEq, Eq)]
struct Passage {
    /// What is set where it begins; a routine begins at its calls.
    begins: Option<Setup>,
    /// What was taken to be set there when it was read: what it changes is told by comparison with this, since calls that are not read yet, or that
    /// differ, make `begins` another one.
    entered: Option<Setup>,
    ends: Option<Setup>,
}

enum Open {
    Routine {
        name: u64,
        outside: Setup,
        entered: Setup,
        ends: Option<Setup>,
    },
    /// `exits` is what is set where the program leaves it within, `again` where it begins anew within.
    Loop {
        at: usize,
        before: Setup,
        exits: Option<Setup>,
        again: Option<Setup>,
    },
    /// `ends` is what the branches that are closed left; `complete` says that there is no way past them all.
    Branches {
        before: Setup,
        ends: Option<Setup>,
        begun: bool,
        complete: bool,
    },
}

/// What a reader has passed, and what the passes before saw.
#[derive(Default)]
pub struct Flow {
    known: HashMap<Block, Passage>,
    seen: HashMap<Block, Passage>,
    open: Vec<Open>,
    /// Whether the program has left the block that is being read: it does not come to what follows in it.
    has_left: bool,
    /// Routines of interrupts.
    interrupts: HashSet<u64>,
    /// What is set wherever the arm moves, outside of the routines of interrupts.
    moving: Option<Setup>,
    /// By the hashed name; the first of each.
    calls: HashMap<u64, Call>,
}

impl Flow {
    /// The scan of the last pass that is needed. Routines that are not here are looked for `elsewhere`, if their language has files for them.
    pub fn read<T>(
        mut pass: impl FnMut(Self) -> (Self, T),
        scan: impl Fn(&mut T) -> &mut Scan,
        elsewhere: Option<&dyn Elsewhere>,
    ) -> T {
        let mut known = HashMap::new();
        let (mut passes, mut settled) = (0, true);
        loop {
            let (flow, mut made) = pass(Self { known, ..Self::default() });
            passes += 1;
            let Self { known: before, mut seen, calls, interrupts, moving, .. } = flow;
            for name in interrupts {
                let begins = &mut seen.entry(Block::Routine(name)).or_default().begins;
                *begins = begins.take().or(moving.clone()).map(|b| either(moving.as_ref(), &b, BY_INTERRUPT));
            }
            for (block, passage) in seen.iter_mut().filter(|(_, p)| p.ends.is_some()) {
                if let (Block::Routine(name), Some(other)) = (block, elsewhere)
                    && let Some(setup) = other.called_with(*name)
                {
                    passage.begins = Some(either(passage.begins.as_ref(), &setup, BY_CALLER));
                }
            }
            let is_here = |name: &u64| seen.get(&Block::Routine(*name)).is_some_and(|p| p.ends.is_some());
            let mut calls: Vec<(u64, Call)> = calls.into_iter().filter(|(name, _)| !is_here(name)).collect();
            // files are read in the order of the calls, whatever the order of hashes
            calls.sort_unstable_by_key(|(_, call)| call.at);
            let leaves = seen.iter().filter_map(|(block, p)| match block {
                Block::Routine(name) => Some((*name, p.leaves()?)),
                Block::Loop(_) | Block::Label(..) => None,
            });
            scan(&mut made).routines = leaves.collect();
            let begins = seen.iter().filter_map(|(block, p)| match block {
                Block::Routine(name) => Some((*name, p.begins.clone()?)),
                Block::Loop(_) | Block::Label(..) => None,
            });
            scan(&mut made).called_with = begins.collect();
            let mut called = Vec::new();
            calls.retain(|(name, call)| match elsewhere.map(|other| other.routine(&call.name)) {
                Some(Some(routine)) => {
                    let ends = in_any_file(routine.setup.clone());
                    seen.insert(Block::Routine(*name), Passage { ends: Some(ends), ..Passage::of(Setup::default()) });
                    called.push((call.at, routine));
                    false
                }
                Some(None) => call.is_statement,
                None => false,
            });
            let is_routine = |block: &Block| matches!(block, Block::Routine(_));
            let unsettled: Vec<Block> = match passes == MOST_PASSES {
                true => seen.keys().copied().filter(is_routine).collect(),
                false => Vec::new(),
            };
            // what is called and stands here, or changes something
            seen.retain(|block, p| match block {
                Block::Routine(_) => p.begins.is_some() && p.ends.is_some() && *p != Passage::of(Setup::default()),
                Block::Loop(_) => p.begins != p.ends,
                Block::Label(..) => true,
            });
            if seen == before || !settled {
                let scan = scan(&mut made);
                declare_unknown(scan);
                scan.calls = calls.into_iter().map(|(_, call)| call).collect();
                scan.called = called;
                return made;
            }
            settled = unsettled.is_empty();
            seen.extend(unsettled.into_iter().map(|block| (block, Passage::unknown())));
            known = seen;
        }
    }

    /// At the beginning of a routine.
    pub fn routine(&mut self, name: u64, now: &mut Setup) {
        let outside = now.clone();
        self.has_left = false;
        if let Some(begins) = self.known.get(&Block::Routine(name)).and_then(|p| p.begins.clone()) {
            *now = begins;
        }
        self.open.push(Open::Routine { name, outside, entered: now.clone(), ends: None });
    }

    /// Where a routine returns before its end.
    pub fn returns(&mut self, now: &Setup) {
        if self.has_left {
            return;
        }
        for open in self.open.iter_mut().rev() {
            if let Open::Routine { ends, .. } = open {
                *ends = Some(either(ends.as_ref(), now, BY_ROUTINE));
                self.has_left = true;
                return;
            }
        }
    }

    /// Where the program leaves the innermost loop, or (`anew`) goes back to where it begins.
    pub fn leaves_loop(&mut self, anew: bool, now: &Setup) {
        if self.has_left {
            return;
        }
        for open in self.open.iter_mut().rev() {
            if let Open::Loop { exits, again, .. } = open {
                *exits = Some(either(exits.as_ref(), now, IN_LOOP));
                if anew {
                    *again = Some(either(again.as_ref(), now, IN_LOOP));
                }
                self.has_left = true;
                return;
            }
        }
    }

    /// A label of the routine that is being read.
    fn label_here(&self, label: u64) -> Block {
        let routine =
            self.open.iter().rev().find_map(|o| if let Open::Routine { name, .. } = o { Some(*name) } else { None });
        Block::Label(routine.unwrap_or_default(), label)
    }

    /// Where the program jumps to a label of the same routine.
    pub fn jumps(&mut self, label: u64, now: &Setup) {
        if self.has_left {
            return;
        }
        let label = self.label_here(label);
        let passage = self.seen.entry(label).or_default();
        passage.begins = Some(either(passage.begins.as_ref(), now, BY_JUMP));
        self.has_left = true;
    }

    /// At a label.
    pub fn label(&mut self, label: u64, now: &mut Setup) {
        let has_left = std::mem::take(&mut self.has_left);
        if let Some(begins) = self.known.get(&self.label_here(label)).and_then(|p| p.begins.as_ref()) {
            *now = if has_left { begins.clone() } else { either(Some(begins), now, BY_JUMP) };
        }
    }

    /// At the end of a routine; what it left open is closed.
    pub fn end_routine(&mut self, now: &mut Setup) {
        while self.open.iter().any(|o| matches!(o, Open::Routine { .. })) {
            let is_routine = matches!(self.open.last(), Some(Open::Routine { .. }));
            self.end(now);
            if is_routine {
                return;
            }
        }
    }

    /// Behind a word, which is a call where a bracket follows: whether it is one, and if so, whether its line begins with it.
    pub fn perhaps_called(&mut self, word: &[u8], behind: &Cursor<'_>, now: &mut Setup) -> Option<bool> {
        self.perhaps_called_as(hashed(word), word, behind, now)
    }

    /// As [`Self::perhaps_called`]; the language hashes names in its own way.
    pub fn perhaps_called_as(&mut self, name: u64, word: &[u8], behind: &Cursor<'_>, now: &mut Setup) -> Option<bool> {
        let at = behind.at - word.len();
        let mut behind = *behind;
        behind.skip_blank();
        if behind.peek() != b'(' {
            return None;
        }
        self.called(name, now);
        let is_statement = begins_line(behind.bytes, at);
        let call = self.calls.entry(name).or_insert_with(|| Call { name: lower(word), at, is_statement });
        call.is_statement |= is_statement;
        if let Some(Passage { entered: Some(entered), ends: Some(ends), .. }) = self.known.get(&Block::Routine(name)) {
            if entered.tool != ends.tool {
                now.tool.clone_from(&ends.tool);
            }
            if entered.frame != ends.frame {
                now.frame.clone_from(&ends.frame);
            }
        }
        Some(is_statement)
    }

    /// Whether the program comes here whatever happens: it is in no branch and no loop.
    #[must_use]
    pub fn is_certain(&self) -> bool {
        self.open.iter().all(|o| matches!(o, Open::Routine { .. }))
    }

    /// Here begins what may call a routine at any time.
    pub fn interrupt(&mut self, routine: u64) {
        self.interrupts.insert(routine);
    }

    /// The arm moves here, with this set.
    pub fn moves(&mut self, now: &Setup) {
        let of_interrupt = |o: &Open| matches!(o, Open::Routine { name, .. } if self.interrupts.contains(name));
        if self.moving.as_ref() != Some(now) && !self.open.iter().any(of_interrupt) {
            self.moving = Some(either(self.moving.as_ref(), now, BY_INTERRUPT));
        }
    }

    fn called(&mut self, name: u64, now: &Setup) {
        let passage = self.seen.entry(Block::Routine(name)).or_default();
        passage.begins = Some(either(passage.begins.as_ref(), now, BY_CALLER));
    }

    /// At the beginning of a loop that stands at byte `at`.
    pub fn repeat(&mut self, at: usize, now: &mut Setup) {
        self.open.push(Open::Loop { at, before: now.clone(), exits: None, again: None });
        if let Some(ends) = self.known.get(&Block::Loop(at)).and_then(|p| p.ends.as_ref()) {
            *now = either(Some(ends), now, IN_LOOP);
        }
    }

    /// Before the first of some branches; `begun` where it begins here.
    pub fn branches(&mut self, now: &Setup, begun: bool) {
        self.open.push(Open::Branches { before: now.clone(), ends: None, begun, complete: false });
    }

    /// At the beginning of a further branch; `otherwise` says that it is taken where none before is.
    pub fn branch(&mut self, now: &mut Setup, otherwise: bool) {
        if let Some(Open::Branches { before, ends, begun, complete }) = self.open.last_mut() {
            let has_left = std::mem::take(&mut self.has_left);
            if std::mem::replace(begun, true) && !has_left {
                *ends = Some(either(ends.as_ref(), now, IN_BRANCH));
            }
            *complete |= otherwise;
            now.clone_from(before);
        }
    }

    /// At the end of the block that was opened last: from where the program comes behind it.
    pub fn end(&mut self, now: &mut Setup) -> Option<Fork> {
        let open = self.open.pop()?;
        let has_left = std::mem::take(&mut self.has_left);
        match open {
            Open::Routine { name, outside, entered, ends } => {
                let passage = self.seen.entry(Block::Routine(name)).or_default();
                let at_end = (!has_left || ends.is_none()).then(|| either(ends.as_ref(), now, BY_ROUTINE));
                passage.ends = at_end.or(ends);
                passage.entered = Some(entered);
                *now = outside;
                Some(Fork::Anywhere)
            }
            Open::Loop { at, before, exits, again } => {
                let mut ends = again;
                if !has_left {
                    ends = Some(either(ends.as_ref(), now, IN_LOOP));
                }
                let ends = ends.unwrap_or_else(|| before.clone());
                let passage = Passage { ends: Some(ends.clone()), ..Passage::of(before.clone()) };
                self.seen.insert(Block::Loop(at), passage);
                *now = either(exits.as_ref(), &either(Some(&before), &ends, IN_LOOP), IN_LOOP);
                Some(Fork::Closes)
            }
            Open::Branches { before, mut ends, complete, .. } => {
                if !has_left {
                    ends = Some(either(ends.as_ref(), now, IN_BRANCH));
                }
                if !complete {
                    ends = Some(either(Some(&before), ends.as_ref().unwrap_or(&before), IN_BRANCH));
                }
                // where each of them leaves, nothing comes past them
                self.has_left = ends.is_none();
                *now = ends.unwrap_or(before);
                Some(Fork::Closes)
            }
        }
    }
}

impl Passage {
    fn of(setup: Setup) -> Self {
        Self { begins: Some(setup.clone()), entered: Some(setup.clone()), ends: Some(setup) }
    }

    /// Where nobody knows what is set, before and behind.
    fn unknown() -> Self {
        let unknown = |what: &str| Some(format!("{UNKNOWN} {what} ({UNSETTLED})"));
        let setup = Setup { tool: unknown("tool"), frame: unknown("frame") };
        Self { entered: Some(Setup::default()), ..Self::of(setup) }
    }

    /// What it sets, whatever it finds; nothing of a routine that is not here.
    fn leaves(&self) -> Option<Setup> {
        let ends = self.ends.clone()?;
        let entered = self.entered.clone().unwrap_or_default();
        let set = |entered: Option<String>, ends: Option<String>| ends.filter(|e| entered.as_ref() != Some(e));
        Some(Setup { tool: set(entered.tool, ends.tool), frame: set(entered.frame, ends.frame) })
    }
}

/// What is set at calls in several files, of which some may say nothing.
#[must_use]
pub fn at_calls(a: Setup, b: Setup) -> Setup {
    let all = either(Some(&a), &b, BY_CALLER);
    let said = |a: Option<String>, b: Option<String>, all: Option<String>| {
        if a.is_some() && b.is_some() { all } else { a.or(b) }
    };
    Setup { tool: said(a.tool, b.tool, all.tool), frame: said(a.frame, b.frame, all.frame) }
}

/// What is set by its number means the same in all files.
fn in_any_file(setup: Setup) -> Setup {
    let known = |what: &str, name: String| match name.bytes().all(|b| b.is_ascii_digit()) {
        true => name,
        false => format!("{UNKNOWN} {what} ({ELSEWHERE})"),
    };
    Setup { tool: setup.tool.map(|t| known("tool", t)), frame: setup.frame.map(|f| known("frame", f)) }
}

/// With what a routine goes to what another file gives to it: `None` is what is set at that call. `begins` is what is set where its own file calls it,
/// which need not be what the other file has set.
#[must_use]
pub fn taken_with(setup: Setup, begins: Option<&Setup>) -> Setup {
    let may_be_callers =
        |is_tool| begins.is_some_and(|b| b.of(is_tool).is_some() && b.of(is_tool) == setup.of(is_tool));
    let [tool, frame] = [(true, "tool"), (false, "frame")]
        .map(|(is_tool, what)| may_be_callers(is_tool).then(|| format!("{UNKNOWN} {what} ({BY_CALLER})")));
    let set = in_any_file(setup);
    Setup { tool: tool.or(set.tool), frame: frame.or(set.frame) }
}

/// What was set where nobody knows it stands for nothing usable.
fn declare_unknown(scan: &mut Scan) {
    let Scan { setups, frames, .. } = scan;
    for is_tool in [true, false] {
        let names = setups.iter().filter_map(|s| s.of(is_tool)).filter(|n| n.starts_with(UNKNOWN));
        frames.of_mut(is_tool).extend(names.map(|n| (n.clone(), Err(format!("is meant with {n}")))));
    }
}

/// What is set by one of two ways; `why` where they differ.
fn either(a: Option<&Setup>, b: &Setup, why: &str) -> Setup {
    let Some(a) = a else { return b.clone() };
    let of = |what: &str, a: &Option<String>, b: &Option<String>| {
        let stands = [a, b].into_iter().flatten().any(|name| name.starts_with(STANDING));
        if a == b { a.clone() } else { Some(format!("{}{UNKNOWN} {what} ({why})", if stands { STANDING } else { "" })) }
    };
    Setup { tool: of("tool", &a.tool, &b.tool), frame: of("frame", &a.frame, &b.frame) }
}
