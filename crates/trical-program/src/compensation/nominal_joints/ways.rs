//! From where the arm comes to a target: branches, loops and routines come together, and a pose without a configuration is then reached in that of each.

use std::f64::consts::TAU;

use trical_model::Joints;
use trical_recording::motion::MotionSense;

use super::{Walk, unknown_sense};
use crate::branch::Configuration;
use crate::scan::{Fork, Spot, Visit};

/// Joints that differ by less are in the same configuration, rad or m.
const SAME: f64 = 0.01;
/// Ways on which the program comes to one place that are followed, at most.
const MOST_OTHERS: usize = 4;

/// A branch or loop that is open.
pub struct Block {
    /// Where it began: the sense of the last motions, and the joints.
    before: (MotionSense, Vec<Joints>),
    /// Whether a branch moves the arm.
    moves: bool,
    /// Where the branches end that are closed.
    ends: Vec<Joints>,
    /// Whether the program goes past all of them, too.
    may_pass: bool,
    is_loop: bool,
    first: First,
}

/// The first motion of a block or routine, if how the arm comes there decides its joints: the target, and these joints.
type First = Option<Option<(u32, Joints)>>;

/// A routine: from where it is called, its first motion, and where it ends.
#[derive(Default)]
pub struct Routine {
    callers: Vec<Joints>,
    first: First,
    ends: Vec<Joints>,
}

impl Walk<'_> {
    /// The program need not come from the text above: visit `index` says from where.
    pub(super) fn branch(&mut self, index: usize, fork: Fork) {
        match fork {
            Fork::Anywhere => {
                self.sense = unknown_sense();
                self.is_known = false;
            }
            Fork::Opens | Fork::Repeats => {
                let is_loop = fork == Fork::Repeats;
                let before = (self.sense.clone(), self.here());
                self.open.push(Block {
                    before,
                    moves: false,
                    ends: Vec::new(),
                    may_pass: !is_loop,
                    is_loop,
                    first: None,
                });
                if is_loop && self.repeated.contains(&index) {
                    self.sense = unknown_sense();
                }
            }
            Fork::Other | Fork::Else => {
                let here = self.here();
                let Some(block) = self.open.last_mut() else { return };
                block.ends.extend(here);
                block.may_pass &= fork == Fork::Other;
                let (sense, joints) = &block.before;
                block.moves |= self.sense != *sense;
                self.sense.clone_from(sense);
                let joints = joints.clone();
                self.is_at(&joints);
            }
            Fork::Closes => {
                let Some(block) = self.open.pop() else { return };
                if block.is_loop {
                    self.again_from(block.first, &self.here());
                }
                let (sense, before) = block.before;
                if block.moves || self.sense != sense {
                    self.sense = unknown_sense();
                }
                self.others.extend(block.ends);
                self.others.extend(before.into_iter().filter(|_| block.may_pass));
                self.others = self.elsewhere(&self.others);
            }
        }
    }

    /// Where the arm may be, first as the text says.
    pub(super) fn here(&self) -> Vec<Joints> {
        std::iter::once(self.last).chain(self.others.iter().copied()).collect()
    }

    /// The arm is at the first of these, or at another.
    fn is_at(&mut self, all: &[Joints]) {
        if let Some((last, others)) = all.split_first() {
            self.last = *last;
            self.others = self.elsewhere(others);
        }
    }

    /// Those that differ from where the arm is, and from each other, by more than whole turns.
    pub(super) fn elsewhere(&self, all: &[Joints]) -> Vec<Joints> {
        let mut found: Vec<Joints> = Vec::new();
        for q in all {
            if found.len() < MOST_OTHERS && !self.is_as(q, &self.last) && !found.iter().any(|f| self.is_as(q, f)) {
                found.push(*q);
            }
        }
        found
    }

    /// Whether these joints are the same up to whole turns, which change no correction.
    fn is_as(&self, a: &Joints, b: &Joints) -> bool {
        let slides = |k: usize| self.all.slides.get(k).copied().unwrap_or(false);
        let apart = |k: usize, d: f64| if slides(k) { d } else { d - TAU * (d / TAU).round() };
        a.iter().zip(b).enumerate().all(|(k, (a, b))| apart(k, a - b).abs() < SAME)
    }

    /// Something stands above where the arm's way begins: of that, only which routines are open matters.
    pub(super) fn above(&mut self, visit: &Visit) {
        match visit {
            Visit::Routine(routine) => self.within.push((*routine, Vec::new())),
            Visit::Ends => drop(self.within.pop()),
            _ => {}
        }
    }

    /// A routine begins: where it was called, or anywhere.
    pub(super) fn begin(&mut self, routine: u32) {
        self.within.push((routine, self.here()));
        let callers = self.routines.entry(routine).or_default().callers.clone();
        self.is_at(&callers);
    }

    /// It ends: what stands behind it in a routine goes on from above it.
    pub(super) fn end(&mut self) {
        let Some((routine, above)) = self.within.pop() else { return };
        let here = self.here();
        self.routines.entry(routine).or_default().ends = here;
        if !self.within.is_empty() {
            self.is_at(&above);
        }
    }

    pub(super) fn call(&mut self, routine: u32) {
        let here = self.here();
        let called = self.routines.entry(routine).or_default();
        called.callers.extend(here.iter().take(MOST_OTHERS.saturating_sub(called.callers.len())));
        let (first, ends) = (called.first, called.ends.clone());
        self.again_from(first, &here);
        self.moved_first(first.flatten());
        self.is_at(&ends);
    }

    /// The program comes to a first motion from these joints, too.
    fn again_from(&mut self, first: First, from: &[Joints]) {
        if let Some(Some((index, q))) = first {
            self.come_otherwise(index, &q, from);
        }
    }

    /// From these joints, too, the arm comes to a target: where it then is, if it is elsewhere than at `q`. That is told.
    pub(super) fn come_otherwise(&mut self, index: u32, q: &Joints, from: &[Joints]) -> Vec<Joints> {
        let (all, ws) = (self.all, &mut self.ws);
        let free = Configuration::Free;
        let Some(spot) = all.scan.spots.get(index as usize) else { return Vec::new() };
        let found: Vec<Joints> = from.iter().filter_map(|last| all.start(spot, free, last, ws).ok()).collect();
        let found: Vec<Joints> = found.into_iter().filter(|other| !self.is_as(other, q)).collect();
        self.walked.otherwise.extend((!found.is_empty()).then_some(index));
        found
    }

    /// Whether how the arm comes to a target decides its joints there.
    pub(super) fn is_decided_by_way(&self, index: u32, spot: &Spot) -> bool {
        !spot.shape.is_joints() && self.all.kept(self.demanded(index)) == Configuration::Free
    }

    /// Keeps a motion that may be the first of what is open.
    pub(super) fn moved_first(&mut self, first: Option<(u32, Joints)>) {
        for block in self.open.iter_mut().rev().take_while(|block| block.first.is_none()) {
            block.first = Some(first);
        }
        if let Some((routine, _)) = self.within.last() {
            self.routines.entry(*routine).or_default().first.get_or_insert(first);
        }
    }
}
