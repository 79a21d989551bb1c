//! What routines of other files do to a KRL program: they set its global data, or displace its motions.

use std::collections::HashSet;

use super::{ELEMENTS, Reader, TYPES, is_system};
use crate::names::{Origin, Way};
use crate::scan::{Fork, changed_here, hashed};
use crate::text::{Cursor, is_one_of, mentions};

/// The places that a line declares, and whether for all files: `DECL GLOBAL E6POS P={...}`.
fn declared(line: &[u8]) -> (Vec<u64>, bool) {
    let mut c = Cursor::new(line, b';');
    let (mut names, mut is_global, mut is_place) = (Vec::new(), false, false);
    while let Some((_, word)) = c.next_word() {
        is_global |= word.eq_ignore_ascii_case(b"GLOBAL");
        if is_place {
            names.push(hashed(word));
        }
        is_place |= is_one_of(word, &TYPES);
        c.skip_blank();
        if c.peek() == b'=' {
            break;
        }
    }
    (names, is_global)
}

/// Six numbers that a file gives for a name, by the names of the numbers: `XHOME={A1 0,A2 -90,...}`.
#[must_use]
pub fn values(bytes: &[u8], name: &[u8], fields: &[&[u8]; 6]) -> Option<[f64; 6]> {
    let mut c = Cursor::new(bytes, b';');
    while let Some((_, word)) = c.next_word() {
        if !word.eq_ignore_ascii_case(name) || !c.eat_in_line(b'=') || c.peek() != b'{' {
            continue;
        }
        let mut inside = Cursor::new(c.until(b"}\n\r"), b';');
        let mut found = [None; 6];
        while let Some((_, field)) = inside.next_word() {
            inside.skip_blank();
            let number = inside.number().and_then(|n| n.value(inside.bytes));
            for (to, _) in found.iter_mut().zip(fields).filter(|(_, name)| field.eq_ignore_ascii_case(name)) {
                *to = number;
            }
        }
        let [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f)] = found else { return None };
        return Some([a, b, c, d, e, f]);
    }
    None
}

/// The frames that a file declares for all, by their hashed names.
#[must_use]
pub fn global_frames(bytes: &[u8]) -> HashSet<u64> {
    lines(bytes).map(declared).filter(|(_, is_global)| *is_global).flat_map(|(names, _)| names).collect()
}

fn lines(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    bytes.split(|b| *b == b'\n')
}

/// The data of others that a file sets, by their hashed names.
#[must_use]
pub fn sets(bytes: &[u8]) -> Vec<u64> {
    let own: HashSet<u64> = lines(bytes).flat_map(|line| declared(line).0).collect();
    let set = lines(bytes).filter_map(|line| {
        let mut c = Cursor::new(line, b';');
        c.skip_blank();
        let name = c.word();
        c.at += c.until(b"=(").iter().take_while(|b| b.is_ascii_alphanumeric() || b"_.[] ,".contains(b)).count();
        let is_own = is_system(name) && !is_one_of(name, &ELEMENTS);
        (!name.is_empty() && !is_own && c.assigns()).then(|| hashed(name))
    });
    let mut set: Vec<u64> = set.filter(|name| !own.contains(name)).collect();
    set.sort_unstable();
    set.dedup();
    set
}

/// Whether a file lets a sensor displace the motions that follow.
#[must_use]
pub fn displaces(bytes: &[u8]) -> bool {
    lines(bytes).any(|line| {
        let code = line.split(|b| *b == b';').next().unwrap_or_default();
        mentions(code, b"RSI_ON")
    })
}

impl Reader<'_> {
    /// Motions of other files to the points that this one has for all, and points to which other files give other coordinates.
    pub(super) fn used_elsewhere(&mut self, bytes: &[u8]) {
        let mut points: Vec<u64> = global_frames(bytes).into_iter().filter(|name| self.names.defines(*name)).collect();
        points.sort_unstable();
        for name in points {
            for setup in self.elsewhere.goes_to(name) {
                let setup = self.scan.setup(setup);
                self.names.fork(Fork::Anywhere);
                self.names.used(name, setup, Way::To, 0);
            }
            // what a routine sets that this program calls is listed where it is called
            let Some(file) = self.elsewhere.set_by(name).filter(|_| self.names.set_at(name).is_none()) else {
                continue;
            };
            let mut points = self.scan.spots.iter().map(|s| self.scan.written(s).name);
            if let Some(point) = points.find(|point| hashed(point.text(bytes)) == name) {
                let what = format!(
                    "'{}' gets other coordinates in {file} while the program runs; motions there are corrected for where it is declared",
                    String::from_utf8_lossy(point.text(bytes))
                );
                self.scan.problem(point.at as usize, what);
            }
        }
    }
}

/// Notes what the routines do that this file calls and does not have. Of those that nobody has, any may set global data.
pub(super) fn note(bytes: &[u8], reader: &mut Reader<'_>) {
    let mut globals: Vec<u64> =
        lines(bytes).map(declared).filter(|(_, global)| *global).flat_map(|(names, _)| names).collect();
    globals.sort_unstable();
    for (at, routine) in &reader.scan.called {
        if routine.displaces {
            let what = "calls a routine that lets a sensor displace the motions that follow (RSI); they are corrected for where the text has them";
            reader.scan.problems.push((*at, what.into()));
        }
        if ELEMENTS.iter().any(|name| routine.sets.contains(&hashed(name))) {
            reader.scan.problems.push((*at, changed_here("a tool or base")));
        }
        for name in routine.sets.iter().filter(|name| globals.binary_search(name).is_ok()) {
            reader.names.set_from(*name, Origin::Computed(*at as u32));
            if reader.named.frames.contains(name) {
                reader.scan.problems.push((*at, changed_here("a tool or base")));
            }
        }
    }
    for call in &reader.scan.calls {
        globals.iter().for_each(|name| reader.names.set_from(*name, Origin::Perhaps(call.at as u32)));
    }
}
