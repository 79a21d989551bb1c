//! What motions go to: the definitions of names that each may meet, and the order of the visits.

use std::collections::HashSet;

use super::{Group, MOST_NAMES, Meant, Motion, Names, Origin, Use, Way};
use crate::reaching::{Definitions, Part};
use crate::scan::{Fork, Scan, Visit, reached};
use crate::text::Cursor;

impl Names {
    /// Loops with one motion, and these motions, by their places among the uses: to such a target, or to such an array, the arm comes
    /// from above the loop, or from the element before.
    fn alone_in_loops(&self, moving: &HashSet<u64>) -> HashSet<usize> {
        /// Where a block begins if it is a loop, how many motions it has, and the last of them.
        type Open = (Option<usize>, u32, usize);
        let mut open: Vec<Open> = Vec::new();
        let mut alone = HashSet::new();
        for (index, u) in self.uses.iter().enumerate() {
            let motions = match u {
                Use::Direct(Visit::Fork(fork @ (Fork::Opens | Fork::Repeats))) => {
                    open.push(((*fork == Fork::Repeats).then_some(index), 0, 0));
                    continue;
                }
                Use::Direct(Visit::Fork(Fork::Closes)) => {
                    let Some((begin, motions, last)) = open.pop() else { continue };
                    if let (Some(begin), 1) = (begin, motions) {
                        alone.extend([begin, last]);
                    }
                    // one that is repeated is no longer one
                    if begin.is_some() { 2 * motions } else { motions }
                }
                Use::Direct(Visit::Fork(Fork::Anywhere)) => 2,
                Use::Direct(visit) if visit.is_no_motion() => 0,
                Use::Direct(_) => 1,
                Use::Called(k) => {
                    let Some((name, elsewhere)) = self.calls.get(*k as usize) else { continue };
                    let moves = if self.routines.contains_key(name) { moving.contains(name) } else { *elsewhere };
                    2 * u32::from(moves)
                }
                Use::Otherwise(_) => 0,
                Use::Named(k) => match self.motions.get(*k as usize) {
                    Some(Motion { way: Way::Said, .. }) | None => 0,
                    Some(Motion { name, way: Way::Perhaps, .. }) => u32::from(self.defined.contains_key(name)),
                    Some(_) => 1,
                },
            };
            if let (Some((_, count, last)), true) = (open.last_mut(), motions > 0) {
                (*count, *last) = (count.saturating_add(motions), index);
            }
        }
        alone
    }

    /// Resolves uses: setups and the order of visits go into `scan`, and motions to places that are not rewritten into its
    /// problems. `elsewhere` says what is wrong with a name of which the file says nothing.
    pub fn resolve(mut self, scan: &mut Scan, bytes: &[u8], elsewhere: &dyn Fn(&[u8]) -> String) {
        if let Some(declared) = &self.declared {
            let set = self.groups.iter().map(|g| g.definition.name);
            self.elsewhere = set.filter(|name| !declared.contains(name)).collect();
        }
        self.set_from_others = self.copies.iter().filter(|(to, from, ..)| to != from).map(|(to, ..)| *to).collect();
        let moving = self.moving();
        let alone = self.alone_in_loops(&moving);
        let (mut definitions, set_at_any_time) = (self.definitions(), self.set_at_any_time());
        let mut open: Vec<bool> = Vec::new();
        for (index, u) in std::mem::take(&mut self.uses).into_iter().enumerate() {
            self.step = index;
            definitions.pass(index);
            self.apart = open.contains(&true) && !alone.contains(&index);
            match u {
                Use::Direct(v) => {
                    let is_loop = matches!(v, Visit::Fork(Fork::Repeats)) && !alone.contains(&index);
                    match v {
                        Visit::Fork(Fork::Opens | Fork::Repeats) => open.push(is_loop),
                        Visit::Fork(Fork::Closes) => drop(open.pop()),
                        _ => {}
                    }
                    if let Visit::Fork(fork) = v {
                        definitions.fork(index, fork);
                    }
                    let once = matches!(v, Visit::Fork(Fork::Repeats)) && !is_loop;
                    scan.visits.push(if once { Visit::Fork(Fork::Opens) } else { v });
                }
                Use::Called(k) => {
                    let Some((name, elsewhere)) = self.calls.get(k as usize).copied() else { continue };
                    definitions.call(name);
                    let is_here = self.routines.contains_key(&name);
                    let moves = if is_here { moving.contains(&name) } else { elsewhere };
                    scan.visits.extend(moves.then_some(Visit::Fork(Fork::Anywhere)));
                    scan.visits.extend((moves && is_here).then_some(Visit::Call(name as u32)));
                }
                Use::Otherwise(k) => {
                    let Some((name, at)) = self.otherwise.get(k as usize).copied() else { continue };
                    self.means_otherwise(name, definitions.met(name, None), at);
                }
                Use::Named(k) => {
                    let Some(Motion { name, setup, way, at }) = self.motions.get(k as usize).copied() else { continue };
                    let problem = || elsewhere(Cursor::at(bytes, at as usize, 0).word());
                    let itself = || vec![Meant { name, setup, is_shifted: false }];
                    let all = self.meant.get(&(name, setup)).cloned().unwrap_or_else(itself);
                    let count = all.len();
                    for (k, Meant { name, setup, is_shifted }) in all.into_iter().enumerate() {
                        scan.visits.extend(one_of(k, count));
                        let way = if is_shifted { Way::Computed } else { way };
                        let is_any = matches!(way, Way::Said) || set_at_any_time.contains(&name);
                        let met = if is_any { None } else { definitions.met(name, way.element()) };
                        self.goes_to(name, met, (setup, way), at, scan, &problem);
                    }
                    scan.visits.extend(one_of(count, count));
                }
            }
        }
        self.approached_from_anywhere(scan);
        self.tell_other_uses(scan);
        let gone = self.unused(scan, bytes);
        self.list_frames(scan);
        scan.remove(&gone);
    }

    /// What stands at `at` is no place of the arm: of these definitions of a name (`None` is any), and of what they are set from.
    fn means_otherwise(&mut self, name: u64, met: Option<Vec<u32>>, at: u32) {
        let mut seen = HashSet::from([name]);
        let mut next = vec![(name, met)];
        while let Some((name, met)) = next.pop() {
            for origin in self.origins_met(name, met.as_deref()) {
                let Origin::Name { name: other, .. } = origin else { continue };
                next.extend((seen.len() <= MOST_NAMES && seen.insert(other)).then_some((other, None)));
            }
            for group in met.unwrap_or_else(|| self.all(name).collect()) {
                let Some(g) = self.groups.get(group as usize) else { continue };
                for spot in g.first..g.first + g.count {
                    self.meant_otherwise.entry(spot).or_insert(at);
                }
            }
        }
    }

    /// A motion to a name, of which it may meet these definitions; `None` is any.
    fn goes_to(
        &mut self,
        name: u64,
        met: Option<Vec<u32>>,
        (setup, way): (u32, Way),
        at: u32,
        scan: &mut Scan,
        problem: &dyn Fn() -> String,
    ) {
        let is_motion = !matches!(way, Way::Perhaps | Way::Said);
        // what other elements of an array are set from says nothing of this one
        let met = met.map(|met| met.into_iter().filter(|group| self.may_be(*group, way)).collect::<Vec<_>>());
        let origins = met.as_ref().map(|met| self.origins_met(name, Some(met)));
        let has_numbers = match &met {
            Some(met) => met.iter().any(|k| !self.set_here.contains_key(k)),
            None => self.defines(name),
        };
        if !is_motion {
            if has_numbers {
                self.visit_any(name, met, setup, way, at, scan);
            }
            return;
        }
        self.gone_to.insert(name);
        let is_set_above = self.set_first.get(&name).is_some_and(|above| *above <= self.step);
        if met.is_none() && self.elsewhere.contains(&name) && !is_set_above {
            scan.problem(at as usize, problem());
        }
        if !has_numbers && (origins.is_none() || !self.defines(name)) {
            scan.visits.push(Visit::Unknown);
            return self.goes_to_undefined(name, (setup, way), at, origins, scan, problem);
        }
        let is_given = self.visit_any(name, met, setup, way, at, scan);
        let is_nowhere = !is_given && origins.as_ref().map_or(!self.origins.contains_key(&name), Vec::is_empty);
        if is_nowhere {
            self.missed(name);
            scan.problem(at as usize, problem());
        }
        match origins {
            Some(origins) => {
                self.list_computed(&origins, scan);
                self.follow_sources(name, &origins, setup, scan, &mut Vec::new());
            }
            None => {
                self.computed(name, scan);
                self.sources(name, setup, scan, &mut Vec::new());
            }
        }
        scan.relative.extend(self.changed.get_mut(&name).into_iter().flat_map(std::mem::take));
        let is_near_another = matches!(way, Way::Near(..)) && self.set_from_others.contains(&name);
        scan.relative.extend((matches!(way, Way::Computed) || is_near_another).then_some(at));
    }

    /// Targets to which no motion goes, which are told.
    fn unused(&self, scan: &mut Scan, bytes: &[u8]) -> HashSet<u32> {
        let groups = |name: &u64| self.all(*name).filter_map(|k| self.groups.get(k as usize));
        // what such data are set from is none either
        let no_targets = reached(self.no_targets.iter().copied(), |name| self.set_from_names(name));
        let unused = no_targets.iter().filter(|name| groups(name).all(|g| g.used.is_none()));
        let mut gone: HashSet<u32> = unused.flat_map(groups).flat_map(|g| g.first..g.first + g.count).collect();
        let idle = self.idle(scan, bytes);
        gone.extend(idle.given.into_iter().filter_map(|(spot, _)| spot));
        for (all, to) in [(idle.unused, &mut scan.unused), (idle.read, &mut scan.only_read)] {
            to.extend(all.into_iter().filter(|(spot, _)| spot.is_none_or(|spot| gone.insert(spot))).map(|(_, at)| at));
        }
        gone
    }

    /// The definitions of names that have several, and what reaches which.
    fn definitions(&self) -> Definitions {
        let is_one_of_several = |(k, g): &(u32, &Group)| {
            let name = &g.definition.name;
            let is_earlier = || self.defined.get(name).is_some_and(|newest| newest != k);
            g.earlier.is_some() || self.moved_on.contains(name) || is_earlier() || self.elsewhere.contains(name)
        };
        let several = (0..).zip(&self.groups).filter(is_one_of_several).map(|(k, g)| (k, g.definition)).collect();
        let forks = self.uses.iter().enumerate().filter_map(|(index, u)| match u {
            Use::Direct(Visit::Fork(fork)) => Some((index, *fork)),
            _ => None,
        });
        let calls = self.routines.iter().map(|(name, own)| (*name, own.calls.clone())).collect();
        Definitions::new(several, forks, calls)
    }

    /// Visits, after all others, of targets to which motions go by other names only.
    fn approached_from_anywhere(&self, scan: &mut Scan) {
        if self.by_another_name.is_empty() {
            return;
        }
        let mut visited: HashSet<u32> =
            scan.visits.iter().filter_map(|v| if let Visit::To(spot) = v { Some(*spot) } else { None }).collect();
        for g in self.by_another_name.iter().filter_map(|k| self.groups.get(*k as usize)) {
            for spot in (g.first..g.first + g.count).filter(|spot| visited.insert(*spot)) {
                scan.visits.extend([Visit::Fork(Fork::Anywhere), Visit::To(spot)]);
            }
        }
    }

    /// Whether a definition may give what a motion goes to: it is not of another element of an array.
    fn may_be(&self, group: u32, way: Way) -> bool {
        let part = self.groups.get(group as usize).map(|g| g.definition.part);
        match (way.element(), part) {
            (Some(element), Some(Part::Element(k))) => element == k,
            _ => true,
        }
    }

    /// A motion to the definitions of a name that it may meet, `met` or any; whether there is one of what it goes to.
    fn visit_any(&mut self, name: u64, met: Option<Vec<u32>>, setup: u32, way: Way, at: u32, scan: &mut Scan) -> bool {
        // of many, that each may be the one is said once
        let are_many = match &met {
            Some(met) => met.len() > MOST_NAMES,
            None => self.all(name).nth(MOST_NAMES).is_some(),
        };
        let element = way.element();
        if are_many && !self.met_any.insert((name, setup, element)) {
            scan.relative.extend(matches!(way, Way::Near(..)).then_some(at));
            scan.visits.push(Visit::Unknown);
            return true;
        }
        let mut groups = met.unwrap_or_else(|| self.all(name).collect());
        groups.retain(|group| self.may_be(*group, way));
        scan.visits.extend(groups.is_empty().then_some(Visit::Unknown));
        for (k, group) in groups.iter().enumerate() {
            scan.visits.extend(one_of(k, groups.len()));
            self.visit_group(*group, setup, way, at, scan);
        }
        scan.visits.extend(one_of(groups.len(), groups.len()));
        !groups.is_empty()
    }

    pub(super) fn visit_group(&mut self, group: u32, setup: u32, way: Way, at: u32, scan: &mut Scan) {
        let Some(g) = self.groups.get_mut(group as usize) else { return };
        if g.count == 0 {
            scan.visits.extend((!matches!(way, Way::Said)).then_some(Visit::Unknown));
            return;
        }
        let all = g.first..g.first + g.count;
        let fresh = g.used.is_none();
        let one = match way {
            Way::Element(k) if g.definition.part == Part::Whole => {
                u32::try_from(k).ok().and_then(|k| g.first.checked_add(k)).filter(|s| all.contains(s))
            }
            _ => (g.count == 1).then_some(g.first),
        };
        match one {
            Some(spot) => scan.assign(spot, setup),
            None if g.used == Some(setup) => {}
            None => all.clone().for_each(|spot| scan.assign(spot, setup)),
        }
        g.used = Some(setup);
        if !matches!(way, Way::Said) {
            self.use_targets(one.map_or(all.clone(), |spot| spot..spot + 1));
        }
        match (way, one) {
            (Way::Said, _) => {}
            (Way::Near(shift), Some(spot)) => scan.visit_near(spot, shift, at),
            (Way::Near(..), None) => {
                scan.relative.push(at);
                scan.visits.push(Visit::Unknown);
            }
            (Way::To | Way::Perhaps | Way::Element(_), Some(spot)) => scan.visits.push(Visit::To(spot)),
            // an array that a loop runs through is visited once, in its order
            (Way::To | Way::Perhaps | Way::Element(_), None) if fresh => {
                for spot in all {
                    scan.visits.extend(self.apart.then_some(Visit::Fork(Fork::Anywhere)));
                    scan.visits.push(Visit::To(spot));
                }
            }
            _ => scan.visits.push(Visit::Unknown),
        }
    }
}

/// What stands before way `k` of several of which the program takes one, and behind the last of them.
fn one_of(k: usize, count: usize) -> Option<Visit> {
    let fork = match k {
        0 => Fork::Opens,
        _ if k == count => Fork::Closes,
        _ if k + 1 == count => Fork::Else,
        _ => Fork::Other,
    };
    (count > 1).then_some(Visit::Fork(fork))
}
