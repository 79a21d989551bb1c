//! Which definitions of a name a motion may meet: the last one above it, and where branches, loops, routines and labels come
//! between, each that may be the last when the program runs.

use std::collections::{HashMap, HashSet};

use crate::scan::Fork;

/// Definitions of one name that are told apart, at most; of more, a motion may meet any of the file.
const MOST: usize = 50;

/// Definitions in a routine and in what it calls, and routines that it calls, at most.
const MOST_CALLED: usize = 100;

/// What of a name's data a definition gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// All of them.
    Whole,
    /// Element `k` (0-based) of an array.
    Element(usize),
    /// An element that is known only when the program runs.
    Indexed,
}

/// Where a name's data are defined.
#[derive(Clone, Copy, Debug)]
pub struct Definition {
    /// The hashed name.
    pub name: u64,
    /// What of it.
    pub part: Part,
    /// The routine in which it stands.
    pub within: Option<u64>,
    /// How many steps of the program (motions, calls, forks) stand above it.
    pub above: u32,
}

/// Definitions by their indices; `None` is any that the file has.
type Met = Option<Vec<u32>>;

/// The definitions of a program, passed from its first step to its last.
#[derive(Debug, Default)]
pub struct Definitions {
    reaching: Reaching,
    /// Those of names that have several, and their indices, in the order of the text.
    several: Vec<(u32, Definition)>,
    /// The same by the name.
    named: HashMap<u64, Vec<u32>>,
    /// Of names of which elements are defined: the same by the element; under `None` what is no single element.
    elements: HashMap<(u64, Option<usize>), Vec<u32>>,
    /// How many of them are passed.
    passed: usize,
    /// The step that ends a loop, by the one that begins it.
    loops: HashMap<usize, usize>,
    /// What each routine calls.
    calls: HashMap<u64, HashSet<u64>>,
    /// Those in each routine, by their places in `several`.
    within: HashMap<u64, Vec<usize>>,
    /// Those in a routine and in what it calls; `None` where there are many.
    called: HashMap<u64, Option<Vec<usize>>>,
}

impl Definitions {
    /// Of names that have several definitions, in the order of the text; forks are told with the step at which they are.
    #[must_use]
    pub fn new(
        several: Vec<(u32, Definition)>,
        forks: impl Iterator<Item = (usize, Fork)>,
        calls: HashMap<u64, HashSet<u64>>,
    ) -> Self {
        let (mut loops, mut open) = (HashMap::new(), Vec::new());
        for (step, fork) in forks {
            match fork {
                Fork::Opens | Fork::Repeats => open.push((step, fork == Fork::Repeats)),
                Fork::Closes => {
                    loops.extend(open.pop().filter(|(_, is_loop)| *is_loop).map(|(begin, _)| (begin, step)))
                }
                Fork::Other | Fork::Else | Fork::Anywhere => {}
            }
        }
        let element = |d: &Definition| if let Part::Element(k) = d.part { Some(k) } else { None };
        let arrays: HashSet<u64> = several.iter().filter(|(_, d)| element(d).is_some()).map(|(_, d)| d.name).collect();
        let (mut named, mut within): (HashMap<_, Vec<_>>, HashMap<_, Vec<_>>) = Default::default();
        let mut elements: HashMap<_, Vec<_>> = HashMap::new();
        for (k, (index, definition)) in several.iter().enumerate() {
            named.entry(definition.name).or_default().push(*index);
            within.entry(definition.within.unwrap_or_default()).or_default().push(k);
            if arrays.contains(&definition.name) {
                elements.entry((definition.name, element(definition))).or_default().push(*index);
            }
        }
        Self { several, named, elements, loops, calls, within, ..Self::default() }
    }

    /// The definitions that a motion to a name, or to an element of it, meets here; `None` is any.
    #[must_use]
    pub fn met(&self, name: u64, element: Option<usize>) -> Option<Vec<u32>> {
        let of = |element| self.elements.get(&(name, element));
        let any = || {
            of(element)
                .filter(|_| element.is_some())
                .map(|own| [own.as_slice(), of(None).map_or(&[], |all| all)].concat())
        };
        self.reaching.met(name).or_else(any)
    }

    /// To a step of the program.
    pub fn pass(&mut self, step: usize) {
        while let Some((index, definition)) = self.several.get(self.passed).filter(|(_, d)| d.above as usize <= step) {
            self.passed += 1;
            let Definition { name, part, .. } = *definition;
            let mut met = vec![*index];
            if part != Part::Whole {
                let Some(before) = self.reaching.met(name).or_else(|| self.all_of(name)) else { continue };
                met.extend(before.into_iter().filter(|k| part == Part::Indexed || self.part(*k) != Some(part)));
            }
            self.reaching.define(name, met);
        }
    }

    /// All definitions of a name, unless there are many.
    fn all_of(&self, name: u64) -> Option<Vec<u32>> {
        self.named.get(&name).filter(|all| all.len() <= MOST).cloned()
    }

    fn part(&self, definition: u32) -> Option<Part> {
        let at = self.several.binary_search_by_key(&definition, |(index, _)| *index).ok()?;
        self.several.get(at).map(|(_, d)| d.part)
    }

    /// From where the program comes to this step.
    pub fn fork(&mut self, step: usize, fork: Fork) {
        if let Some(end) = self.loops.get(&step) {
            let ahead = self.several.iter().skip(self.passed).take_while(|(_, d)| d.above as usize <= *end);
            ahead.for_each(|(index, d)| self.reaching.add(d.name, *index));
        }
        self.reaching.fork(fork);
    }

    /// A routine is called here.
    pub fn call(&mut self, routine: u64) {
        if self.several.is_empty() {
            return;
        }
        if !self.called.contains_key(&routine) {
            let found = self.within_called(routine);
            self.called.insert(routine, found);
        }
        match self.called.get(&routine) {
            Some(Some(found)) => {
                for (index, definition) in found.iter().filter_map(|k| self.several.get(*k)) {
                    self.reaching.add(definition.name, *index);
                }
            }
            _ => self.reaching.any(),
        }
    }

    fn within_called(&self, routine: u64) -> Option<Vec<usize>> {
        let (mut found, mut seen, mut next) = (Vec::new(), HashSet::new(), vec![routine]);
        while let Some(name) = next.pop() {
            if !seen.insert(name) {
                continue;
            }
            found.extend(self.within.get(&name).into_iter().flatten());
            next.extend(self.calls.get(&name).into_iter().flatten());
            if found.len().max(seen.len()) > MOST_CALLED {
                return None;
            }
        }
        Some(found)
    }
}

/// What reaches a place in the text. Told of definitions, and of from where the program comes, from the text's beginning to its end.
#[derive(Debug, Default)]
pub struct Reaching {
    /// By the hashed name; any definition of those that are not in it.
    now: HashMap<u64, Met>,
    /// Of the blocks that are open: names that are defined in them.
    open: Vec<HashMap<u64, Ways>>,
}

/// Of a name that is defined in a block.
#[derive(Debug)]
struct Ways {
    /// What reaches the block.
    before: Met,
    /// What comes past the block, or from the branches that are closed.
    past: Met,
}

impl Reaching {
    /// The definitions that a motion meets here; `None` is any.
    #[must_use]
    pub fn met(&self, name: u64) -> Met {
        self.now.get(&name).cloned().flatten()
    }

    /// Here a name's data are defined, after which a motion may meet these definitions.
    pub fn define(&mut self, name: u64, met: Vec<u32>) {
        self.set(name, Some(met));
    }

    /// A definition that stands elsewhere may reach this place.
    pub fn add(&mut self, name: u64, definition: u32) {
        let met = either(self.met(name), Some(vec![definition]));
        self.set(name, met);
    }

    /// Any definition may reach this place.
    pub fn any(&mut self) {
        self.now = HashMap::new();
    }

    /// From where the program comes to here. Before a loop, what is defined in it is to be added.
    pub fn fork(&mut self, fork: Fork) {
        match fork {
            Fork::Opens | Fork::Repeats => self.open.push(HashMap::new()),
            Fork::Other | Fork::Else => {
                for (name, ways) in self.open.last_mut().into_iter().flatten() {
                    let end = self.now.insert(*name, ways.before.clone()).flatten();
                    ways.past = either(ways.past.take(), end);
                }
            }
            Fork::Closes => {
                for (name, ways) in self.open.pop().into_iter().flatten() {
                    let end = self.now.insert(name, ways.before).flatten();
                    self.set(name, either(ways.past, end));
                }
            }
            Fork::Anywhere => self.any(),
        }
    }

    fn set(&mut self, name: u64, met: Met) {
        let before = self.met(name);
        if let Some(block) = self.open.last_mut() {
            block.entry(name).or_insert_with(|| Ways { before: before.clone(), past: before });
        }
        self.now.insert(name, met.filter(|all| all.len() <= MOST));
    }
}

fn either(a: Met, b: Met) -> Met {
    let (mut all, b) = (a?, b?);
    for k in b {
        if !all.contains(&k) {
            all.push(k);
        }
    }
    Some(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a motion to name 7 meets after `steps`: a definition, or where the program comes from.
    fn met(steps: &[Result<u32, Fork>]) -> Met {
        let mut reaching = Reaching::default();
        for step in steps {
            match *step {
                Ok(definition) => reaching.define(7, vec![definition]),
                Err(fork) => reaching.fork(fork),
            }
        }
        reaching.met(7)
    }

    #[test]
    fn the_last_definition_is_met_and_of_branches_each() {
        use Fork::{Anywhere, Closes, Opens, Other};
        assert_eq!(met(&[]), None);
        assert_eq!(met(&[Ok(1), Ok(2)]), Some(vec![2]));
        assert_eq!(met(&[Ok(1), Err(Opens), Ok(2), Err(Closes)]), Some(vec![1, 2]));
        assert_eq!(met(&[Ok(1), Err(Opens), Ok(2), Err(Other)]), Some(vec![1]));
        assert_eq!(met(&[Ok(1), Err(Opens), Ok(2), Err(Other), Ok(3), Err(Closes)]), Some(vec![1, 2, 3]));
        assert_eq!(met(&[Ok(1), Err(Opens), Err(Opens), Ok(2), Err(Closes), Err(Other)]), Some(vec![1]));
        assert_eq!(met(&[Err(Opens), Ok(2), Err(Closes)]), None);
        assert_eq!(met(&[Ok(1), Err(Anywhere)]), None);
        assert_eq!(met(&[Ok(1), Err(Opens), Err(Anywhere), Ok(2), Err(Closes)]), None);
    }

    #[test]
    fn an_element_replaces_its_own_definitions_only() {
        let part_at = |above: u32, part| (above, Definition { name: 7, part, within: None, above });
        let several = [Part::Element(0), Part::Element(1), Part::Element(1), Part::Whole, Part::Indexed];
        let mut definitions = Definitions::new(
            (0..).zip(several).map(|(above, part)| part_at(above, part)).collect(),
            std::iter::empty(),
            HashMap::new(),
        );
        assert_eq!(definitions.met(7, None), None);
        assert_eq!(definitions.met(7, Some(1)), Some(vec![1, 2, 3, 4]));
        let expected: [&[u32]; 5] = [&[0, 1, 2, 3, 4], &[0, 1, 3, 4], &[0, 2, 3, 4], &[3], &[3, 4]];
        for (step, expected) in expected.iter().enumerate() {
            definitions.pass(step);
            let mut met = definitions.met(7, None).unwrap_or_default();
            met.sort_unstable();
            met.dedup();
            assert_eq!(met, *expected, "step {step}");
        }
    }

    #[test]
    fn a_loop_meets_what_its_end_leaves_and_a_call_what_is_set_there() {
        let at = |index, name, within, above| (index, Definition { name, part: Part::Whole, within, above });
        // 0 FOR, 1 a motion, 2 ENDFOR, 3 a call of routine 20, which calls 21
        let several = vec![at(0, 7, None, 0), at(1, 7, None, 2), at(2, 8, None, 3), at(3, 8, Some(21), 4)];
        let forks = [(0, Fork::Repeats), (2, Fork::Closes)];
        let calls = HashMap::from([(20, HashSet::from([21]))]);
        let mut definitions = Definitions::new(several, forks.into_iter(), calls);
        definitions.pass(0);
        definitions.fork(0, Fork::Repeats);
        assert_eq!(definitions.met(7, None), Some(vec![0, 1]));
        definitions.pass(2);
        assert_eq!(definitions.met(7, None), Some(vec![1]));
        definitions.fork(2, Fork::Closes);
        assert_eq!(definitions.met(7, None), Some(vec![0, 1]));
        definitions.pass(3);
        assert_eq!(definitions.met(8, None), Some(vec![2]));
        definitions.call(20);
        assert_eq!(definitions.met(8, None), Some(vec![2, 3]));
        definitions.fork(4, Fork::Anywhere);
        assert_eq!(definitions.met(8, None), None);
    }
}
