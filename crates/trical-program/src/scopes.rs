//! Names that a routine has for itself: a parameter is another name than data of the same name outside.

use std::collections::HashMap;

use crate::scan::hashed_as_written;

/// A part of the text in which a name is a routine's own.
#[derive(Debug)]
struct Scope {
    from: usize,
    to: usize,
    key: u64,
    /// Around it: the same name of an outer routine, by its place among the name's scopes.
    outer: Option<usize>,
}

/// A parameter of a routine.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Its hashed name.
    pub name: u64,
    /// What it is called among all names.
    pub key: u64,
}

/// Which names are whose, by their places in the text. Told from the text's beginning to its end.
#[derive(Debug, Default)]
pub struct Scopes {
    /// By the hashed name, in the order of the text.
    own: HashMap<u64, Vec<Scope>>,
    parameters: HashMap<u64, Vec<Parameter>>,
    /// Names that are own to the blocks that are open.
    open: Vec<Vec<u64>>,
}

impl Scopes {
    /// A routine or another block begins.
    pub fn open(&mut self) {
        self.open.push(Vec::new());
    }

    /// From here (`at`) to the end of the block that is open, this name is its own; in the order of a routine's parameters.
    pub fn parameter(&mut self, routine: u64, name: u64, at: usize) {
        let key = self.local(routine, name, at);
        self.parameters.entry(routine).or_default().push(Parameter { name, key });
    }

    /// As [`Self::parameter`], of a name that the routine declares.
    pub fn local(&mut self, routine: u64, name: u64, at: usize) -> u64 {
        let key = hashed_as_written(&[name.to_le_bytes(), routine.to_le_bytes()].concat());
        let all = self.own.entry(name).or_default();
        let is_open = |k: &usize| all.get(*k).is_some_and(|s| s.to == usize::MAX);
        let outer =
            std::iter::successors(all.len().checked_sub(1), |k| all.get(*k).and_then(|s| s.outer)).find(is_open);
        all.push(Scope { from: at, to: usize::MAX, key, outer });
        if let Some(open) = self.open.last_mut() {
            open.push(name);
        }
        key
    }

    /// The block that was opened last ends here.
    pub fn close(&mut self, at: usize) {
        for name in self.open.pop().unwrap_or_default() {
            let open = self.own.get_mut(&name).and_then(|all| all.iter_mut().rev().find(|s| s.to == usize::MAX));
            if let Some(scope) = open {
                scope.to = at;
            }
        }
    }

    /// What a name at `at` is called among all names.
    #[must_use]
    pub fn key(&self, name: u64, at: usize) -> u64 {
        let Some(all) = self.own.get(&name) else { return name };
        let last = all.partition_point(|s| s.from <= at).checked_sub(1);
        let mut around = std::iter::successors(last, |k| all.get(*k).and_then(|s| s.outer));
        around.find_map(|k| all.get(k).filter(|s| at < s.to)).map_or(name, |s| s.key)
    }

    /// The parameters of a routine, in their order.
    #[must_use]
    pub fn parameters(&self, routine: u64) -> &[Parameter] {
        self.parameters.get(&routine).map_or(&[], Vec::as_slice)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_the_innermost_routines_that_has_it() {
        let (name, mut scopes) = (7, Scopes::default());
        scopes.open();
        scopes.parameter(1, name, 10);
        scopes.open(); // a loop
        scopes.open();
        scopes.parameter(2, name, 20);
        scopes.close(30);
        scopes.close(35);
        scopes.close(40);
        scopes.open();
        scopes.parameter(3, name, 50);
        let [one, two, three] = [1, 2, 3].map(|routine| scopes.parameters(routine)[0].key);
        let asked = [5, 15, 25, 32, 37, 45, 55].map(|at| scopes.key(name, at));
        assert_eq!(asked, [name, one, two, one, one, name, three]);
        assert_eq!(scopes.key(8, 15), 8);
        assert!(scopes.parameters(4).is_empty());
    }
}
