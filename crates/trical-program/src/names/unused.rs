//! Targets whose numbers nothing uses: left over, or placeholders that are set before the arm goes there.

use std::collections::{HashMap, HashSet};

use super::{Group, Names};
use crate::scan::{Scan, Visit, hashed};
use crate::text::{Cursor, Span, is_one_of};

/// A target by its index into `Scan::spots`, of which a placeholder has none, and where it stands.
type Target = (Option<u32>, (usize, Span));

/// Targets to which no motion goes.
#[derive(Default)]
pub(super) struct Idle {
    /// Nothing in the files uses their numbers, or only before they are set anew.
    pub unused: Vec<Target>,
    /// Other statements use them: zones, frames, distances, conditions.
    pub read: Vec<Target>,
    /// Functions that nobody has read are given them, which is listed where it stands.
    pub given: Vec<Target>,
}

impl Names {
    /// Targets to which no motion goes. Where nothing in the files goes to any target, nobody knows it of those that no statement uses.
    pub(super) fn idle(&self, scan: &Scan, bytes: &[u8]) -> Idle {
        let goes = scan.visits.iter().any(|v| matches!(v, Visit::To(_) | Visit::Near(_)));
        let is_known = !self.only_data && (goes || self.in_use.contains(&true));
        if !is_known && self.comment.is_none() {
            return Idle::default();
        }
        let is_idle = |spot: &u32| self.in_use.get(*spot as usize) != Some(&true);
        let place = |spot: u32| scan.spots.get(spot as usize).map(|s| (scan.at(s), scan.written(s).name));
        let named = |g: &Group| -> Vec<(u64, Target)> {
            let idle = (g.first..g.first + g.count).filter(is_idle);
            let places = idle.filter_map(|spot| Some((Some(spot), place(spot)?)));
            places.filter(|(_, (_, name))| name.len > 0).map(|target| (g.definition.name, target)).collect()
        };
        let placeholders = self.placeholders.iter().filter(|(name, _)| !self.missed.contains(name));
        let mut idle: Vec<(u64, Target)> = placeholders.map(|(name, place)| (*name, (None, *place))).collect();
        idle.extend(self.groups.iter().flat_map(named));
        let text = |(_, (_, name)): &Target| hashed(name.text(bytes));
        let in_text: HashSet<u64> = idle.iter().map(|(_, target)| text(target)).collect();
        let read = match self.comment {
            Some(comment) if !idle.is_empty() => {
                let [calculated, given] = [&scan.calculated_places, &scan.given_away].map(|all| lines_of(bytes, all));
                names_read(bytes, comment, &in_text, &calculated, &given)
            }
            _ => HashMap::new(),
        };
        let mut found = Idle::default();
        for (name, target) in idle {
            let read = read.get(&text(&target));
            match read.filter(|read| **read == Read::Given || !self.gone_to.contains(&name)) {
                Some(Read::Given) => found.given.push(target),
                Some(Read::PassedOn) => {}
                Some(Read::Only) => found.read.push(target),
                None if self.read.contains(&name) && !self.gone_to.contains(&name) => {}
                // where no motion is known, placeholders are told all the same: nothing else says that they stay
                None => found.unused.extend((is_known || target.0.is_none()).then_some(target)),
            }
        }
        found
    }
}

/// How the text uses a name.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Read {
    /// In what moves nothing.
    Only,
    /// Other data are set from it, or a place that is listed is calculated from it: the arm may go there by another name.
    PassedOn,
    /// A function that nobody has read is given it.
    Given,
}

/// Where the lines begin in which these stand.
fn lines_of(bytes: &[u8], all: &[usize]) -> HashSet<usize> {
    all.iter().map(|at| line_of(bytes, *at)).collect()
}

/// Where the line of an offset begins, or a long way before it in a line without an end.
fn line_of(bytes: &[u8], at: usize) -> usize {
    let near = at.saturating_sub(FARTHEST);
    let above = bytes.get(near..at).unwrap_or(&[]);
    above.iter().rposition(|b| matches!(b, b'\n' | b'\r')).map_or(near, |k| near + k + 1)
}

/// Bytes that are looked at for the beginning of a line.
const FARTHEST: usize = 4000;

/// Kinds of targets, before a name that is declared.
const KINDS: [&[u8]; 7] = [b"robtarget", b"jointtarget", b"e6pos", b"pos", b"frame", b"e6axis", b"axis"];

/// Which of these names (hashed without regard to case) stand in a text otherwise than where they are declared, or something is assigned to
/// them; in the lines that are `calculated` they are passed on, and in others they are `given` away.
fn names_read(
    bytes: &[u8],
    comment: u8,
    names: &HashSet<u64>,
    calculated: &HashSet<usize>,
    given: &HashSet<usize>,
) -> HashMap<u64, Read> {
    let mut c = Cursor::new(bytes, comment);
    let mut read = HashMap::new();
    let mut before: &[u8] = b"";
    while let Some((from, word)) = c.next_word() {
        let name = hashed(word);
        let word_before = std::mem::replace(&mut before, word);
        if is_one_of(word_before, &KINDS) || !names.contains(&name) {
            continue;
        }
        let mut behind = c;
        behind.skip_blank();
        let close = match behind.peek() {
            b'{' => b'}',
            b'[' => b']',
            _ => 0,
        };
        if close != 0 {
            behind.skip_past(close, b"\n");
            behind.skip_blank();
        }
        let is_last = matches!(behind.peek(), b';' | b'\n' | b'\r' | 0) || behind.peek() == comment;
        let is_copied = || {
            is_one_of(word_before, &[b"return"])
                || bytes.get(..from).is_some_and(|b| b.trim_ascii_end().ends_with(b"="))
        };
        let stands_in = |lines: &HashSet<usize>| !lines.is_empty() && lines.contains(&line_of(bytes, from));
        if stands_in(given) {
            read.insert(name, Read::Given);
            continue;
        }
        if is_last && is_copied() || stands_in(calculated) {
            read.entry(name).and_modify(|r| *r = (*r).max(Read::PassedOn)).or_insert(Read::PassedOn);
            continue;
        }
        behind.skip_space();
        behind.at += usize::from(behind.peek() == b':');
        if !behind.assigns() {
            read.entry(name).or_insert(Read::Only);
        }
    }
    read
}
