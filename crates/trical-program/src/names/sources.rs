//! Names that are set from others, or from what only the running program knows.

use super::{MOST_NAMES, Names, Origin, Way};
use crate::scan::Scan;

impl Names {
    /// What a name is set from before a motion that meets these definitions; `None` is any.
    pub(super) fn origins_met(&self, name: u64, met: Option<&[u32]>) -> Vec<Origin> {
        let all = self.origins.get(&name).into_iter().flatten();
        let any = all.filter(|(_, is_here)| met.is_none() || !is_here).map(|(origin, _)| *origin);
        any.chain(met.into_iter().flatten().filter_map(|k| self.set_here.get(k).copied())).collect()
    }

    /// A motion to a name that this file does not define, or that has no numbers there, but is set from these.
    pub(super) fn goes_to_undefined(
        &mut self,
        name: u64,
        (setup, way): (u32, Way),
        at: u32,
        origins: Option<Vec<Origin>>,
        scan: &mut Scan,
        problem: &dyn Fn() -> String,
    ) {
        (self.is_shifted, self.meets_target) = (false, false);
        let found = match (origins, self.followed.get(&(name, setup))) {
            (Some(origins), _) => self.follow(name, &origins, setup, scan, &mut Vec::new()),
            (None, Some((found, is_shifted, meets_target))) => {
                (self.is_shifted, self.meets_target) = (*is_shifted, *meets_target);
                *found
            }
            (None, None) => {
                let found = self.origin(name, setup, scan, &mut Vec::new());
                self.followed.insert((name, setup), (found, self.is_shifted, self.meets_target));
                found
            }
        };
        self.is_shifted |= matches!(way, Way::Near(..) | Way::Computed);
        if found != Some(true) {
            scan.problem(at as usize, problem());
        } else if self.is_shifted && self.meets_target {
            scan.relative.push(at);
        }
    }

    /// Follows a name that has no data of its own to those that it is set from: whether all that it comes to is rewritten,
    /// listed, or where the arm is; nothing where it only goes in a circle. `seen` are names on the way, and whether they are
    /// settled.
    fn origin(&mut self, name: u64, setup: u32, scan: &mut Scan, seen: &mut Vec<(u64, bool)>) -> Option<bool> {
        self.is_shifted |= self.changed.contains_key(&name);
        let is_listed = self.listed.contains(&name);
        if is_listed || self.defines(name) {
            self.meets_target = true;
            self.use_numbers(name, setup, scan);
            self.computed(name, scan);
            if seen.len() > MOST_NAMES {
                return Some(is_listed);
            }
            self.sources(name, setup, scan, seen);
            return Some(true);
        }
        self.follow(name, &self.origins_met(name, None), setup, scan, seen)
    }

    /// The arm goes by another name to wherever numbers of the file put this one.
    fn use_numbers(&mut self, name: u64, setup: u32, scan: &mut Scan) {
        if !self.used_on.insert((name, setup)) {
            return;
        }
        let before = scan.visits.len();
        for group in self.all(name).collect::<Vec<_>>() {
            self.visit_group(group, setup, Way::Computed, 0, scan);
            self.by_another_name.push(group);
        }
        scan.visits.truncate(before);
    }

    /// The same, from these on.
    fn follow(
        &mut self,
        name: u64,
        from: &[Origin],
        setup: u32,
        scan: &mut Scan,
        seen: &mut Vec<(u64, bool)>,
    ) -> Option<bool> {
        self.list_computed(from, scan);
        self.is_shifted |= self.changed.contains_key(&name);
        if from.is_empty() {
            self.missed(name);
            scan.goes_elsewhere.insert((name, setup));
        }
        if from.is_empty() || seen.len() > MOST_NAMES {
            return Some(false);
        }
        let own = seen.len();
        seen.push((name, false));
        let mut known = None;
        for origin in from {
            let Origin::Name { name: other, at } = origin else {
                known = Some(true);
                continue;
            };
            self.is_shifted |= !self.copied_at.contains(at);
            let found = match seen.iter().position(|(n, _)| n == other) {
                // the numbers that the motion's own name had before come back to it
                Some(0) if self.defines(*other) => {
                    self.use_numbers(*other, setup, scan);
                    self.meets_target = true;
                    Some(true)
                }
                Some(k) => seen.get(k).and_then(|(_, settled)| settled.then_some(true)),
                None => self.origin(*other, setup, scan, seen),
            };
            if found == Some(false) {
                return found;
            }
            known = known.or(found);
        }
        if let Some(own) = seen.get_mut(own) {
            own.1 = known.is_some();
        }
        known
    }

    /// Lists, once, where a target that has numbers is set from what has none; what is set from itself is relative to it.
    pub(super) fn sources(&mut self, name: u64, setup: u32, scan: &mut Scan, seen: &mut Vec<(u64, bool)>) {
        if self.origins.contains_key(&name) && self.followed_on.insert((name, setup)) {
            self.follow_sources(name, &self.origins_met(name, None), setup, scan, seen);
        }
    }

    /// The same, of these.
    pub(super) fn follow_sources(
        &mut self,
        name: u64,
        from: &[Origin],
        setup: u32,
        scan: &mut Scan,
        seen: &mut Vec<(u64, bool)>,
    ) {
        let before = seen.len();
        seen.push((name, true));
        for origin in from {
            let Origin::Name { name: other, at } = *origin else { continue };
            let around = (self.is_shifted, self.meets_target);
            (self.is_shifted, self.meets_target) = (!self.copied_at.contains(&at), other == name);
            if other == name {
                // perhaps from another element of an array
                self.use_numbers(name, setup, scan);
            }
            let is_known = other == name || self.origin(other, setup, scan, seen) == Some(true);
            let is_relative = self.is_shifted && self.meets_target;
            (self.is_shifted, self.meets_target) = around;
            if !self.listed_at.insert(at) {
                continue;
            }
            if is_known {
                scan.relative.extend(is_relative.then_some(at));
            } else {
                let what = "a place to which the arm moves is set here from data that the files do not give as numbers";
                scan.problem(at as usize, what);
            }
        }
        seen.truncate(before);
    }

    /// Lists, once, where a name to which the arm moves is calculated.
    pub(super) fn computed(&mut self, name: u64, scan: &mut Scan) {
        if self.origins.contains_key(&name) && self.settled.insert(name) {
            self.list_computed(&self.origins_met(name, None), scan);
        }
    }

    pub(super) fn list_computed(&mut self, from: &[Origin], scan: &mut Scan) {
        for origin in from {
            let (at, what) = match origin {
                Origin::Computed(at) => {
                    (at, "a place to which the arm moves is calculated here while the program runs")
                }
                Origin::Around(at) => {
                    (at, "is called from a module beside the program that changes a target to which the arm moves")
                }
                Origin::Perhaps(at) => (
                    at,
                    "calls a routine that is in none of the files read and may change a global target to which the arm moves",
                ),
                _ => continue,
            };
            if self.listed_at.insert(*at) {
                if matches!(origin, Origin::Computed(_)) {
                    scan.calculated_places.push(*at as usize);
                }
                scan.problem(*at as usize, what);
            }
        }
    }
}
