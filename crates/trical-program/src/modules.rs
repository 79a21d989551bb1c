//! The modules of a RAPID task beside the one that is rewritten: what their routines do, and their tools and work objects.

use std::cell::{OnceCell, RefCell};
use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};

use crate::dialects::rapid::{self, Effects, Exports};
use crate::dialects::{Dialect, MARK};
use crate::elsewhere::{Elsewhere, Goes, Motion, Outside};
use crate::folders::{name_of, not_read, paths, read_small, resolved};
use crate::frames::{Frame, Frames};
use crate::options::Spelling;
use crate::scan::hashed;
use crate::text::contains;

/// Modules that are read, at most.
const MOST: usize = 300;

/// Modules in the folder of a program; of a backup, also those of `PROGMOD` and `SYSMOD` of the same task.
pub struct Modules<'a> {
    program: PathBuf,
    /// Tools and work objects of files that the user names.
    given: &'a Frames,
    spelling: Spelling,
    read: OnceCell<(Vec<Module>, Vec<String>)>,
    used: RefCell<BTreeSet<usize>>,
    motions: OnceCell<HashMap<u64, BTreeSet<(usize, usize)>>>,
}

struct Module {
    file: String,
    /// Without its folder, in lower case as names of tools are.
    name: String,
    routines: HashMap<u64, Effects>,
    frames: Frames,
    goes: Vec<(u64, Goes)>,
    given: Vec<(u64, u64)>,
}

impl<'a> Modules<'a> {
    /// Beside a program, for which the user names files with these tools and work objects.
    #[must_use]
    pub fn beside(program: &Path, given: &'a Frames, spelling: Spelling) -> Self {
        let program = program.to_owned();
        Self { program, given, spelling, read: OnceCell::new(), used: RefCell::default(), motions: OnceCell::new() }
    }

    /// Those of which something was used.
    #[must_use]
    pub fn used(&self) -> Vec<String> {
        let used = self.used.borrow();
        used.iter().filter_map(|k| self.all().get(*k)).map(|m| m.file.clone()).collect()
    }

    /// Modules that were not read, in one sentence.
    #[must_use]
    pub fn unread(&self) -> Option<String> {
        let (_, unread) = self.read.get()?;
        let so = "their tools, work objects and routines are not known, nor to which targets of this program they move";
        not_read(unread, &format!("{MOST} modules"), so)
    }

    fn all(&self) -> &[Module] {
        &self.read.get_or_init(|| modules_of(&self.program)).0
    }

    /// Motions (module and number) by what they go to: a name, what it is set from, and what a routine gets.
    fn all_motions(&self) -> &HashMap<u64, BTreeSet<(usize, usize)>> {
        self.motions.get_or_init(|| {
            let mut from: HashMap<u64, Vec<u64>> = HashMap::new();
            self.all().iter().flat_map(|m| &m.given).for_each(|(to, name)| from.entry(*to).or_default().push(*name));
            let mut found: HashMap<u64, BTreeSet<(usize, usize)>> = HashMap::new();
            for (k, module) in self.all().iter().enumerate() {
                for (n, (name, goes)) in module.goes.iter().enumerate() {
                    let is_read = |(routine, _): &(String, _)| {
                        self.all().iter().any(|m| m.routines.contains_key(&hashed(routine.as_bytes())))
                    };
                    if goes.unread.as_ref().is_some_and(is_read) {
                        continue;
                    }
                    let mut next = vec![*name];
                    while let Some(name) = next.pop() {
                        if found.entry(name).or_default().insert((k, n)) {
                            next.extend(from.get(&name).into_iter().flatten());
                        }
                    }
                }
            }
            found
        })
    }

    /// All that the modules have under a name; what several have is used by all of them.
    fn every<T>(&self, find: impl Fn(&Module) -> Option<T>) -> Vec<T> {
        let mut found = Vec::new();
        for (k, module) in self.all().iter().enumerate() {
            if let Some(one) = find(module) {
                self.used.borrow_mut().insert(k);
                found.push(one);
            }
        }
        found
    }

    /// What routines do, if there are such; what a routine sets that is given to it, is set where it is given.
    fn together(&self, routines: impl IntoIterator<Item = u64>) -> Option<Outside> {
        let (mut out, mut lends, mut seen) = (Outside::default(), Vec::new(), HashSet::new());
        let found = routines.into_iter().filter(|key| self.gather(*key, &mut out, &mut lends, &mut seen)).count();
        let mut sets: HashSet<u64> = out.sets.iter().copied().collect();
        while let Some(k) = lends.iter().position(|(_, to)| sets.contains(to)) {
            let (name, _) = lends.swap_remove(k);
            if sets.insert(name) {
                out.sets.push(name);
            }
        }
        (found > 0).then_some(out)
    }

    /// What a routine does, and what it calls in turn.
    fn gather(&self, key: u64, out: &mut Outside, lends: &mut Vec<(u64, u64)>, seen: &mut HashSet<u64>) -> bool {
        if !seen.insert(key) {
            return true;
        }
        let all = self.every(|m| m.routines.get(&key).cloned());
        for one in &all {
            out.moves |= one.moves;
            out.displaces |= one.displaces;
            out.sets_by_name |= one.sets_by_name;
            out.sets.extend(&one.sets);
            lends.extend(&one.lends);
        }
        let mut next: Vec<&String> = all.iter().flat_map(|one| &one.calls).collect();
        next.dedup();
        // what no module has may move the arm
        for called in next {
            let known = seen.len() < MOST && self.gather(hashed(called.as_bytes()), out, lends, seen);
            out.moves |= !known;
        }
        !all.is_empty()
    }
}

impl Elsewhere for Modules<'_> {
    fn routine(&self, name: &str) -> Option<Outside> {
        self.together([hashed(name.as_bytes())])
    }

    fn around(&self, own: &HashSet<u64>) -> Option<(BTreeSet<u64>, Outside)> {
        let (mut called, mut callers) = (BTreeSet::new(), BTreeSet::new());
        loop {
            let before = callers.len();
            for module in self.all() {
                // what a module has itself, it does not call elsewhere
                let is_own = |name: &u64| own.contains(name) && !module.routines.contains_key(name);
                for (key, routine) in &module.routines {
                    let calls = || routine.calls.iter().map(|name| hashed(name.as_bytes()));
                    called.extend(calls().filter(is_own));
                    if calls().any(|name| is_own(&name) || callers.contains(&name)) {
                        callers.insert(*key);
                    }
                }
            }
            if callers.len() == before {
                return self.together(callers).map(|out| (called, out));
            }
        }
    }

    fn frame(&self, is_tool: bool, name: &str) -> Option<Result<Frame, String>> {
        let given = self.given.of(is_tool).get(name).cloned();
        given.or_else(|| the_same(self.every(|m| m.frames.of(is_tool).get(name).cloned()), name, self.spelling))
    }

    fn wanted(&self) -> Vec<u64> {
        let given = self.all().iter().flat_map(|m| &m.given).map(|(_, from)| *from);
        self.all_motions().keys().copied().chain(given).collect()
    }

    fn motions(&self, name: u64) -> Vec<Motion<'_>> {
        let found = self.all_motions().get(&name).into_iter().flatten();
        let motions = found.filter_map(|(k, n)| Some((*k, self.all().get(*k)?, *n)));
        motions
            .filter_map(|(k, module, n)| {
                let (_, goes) = module.goes.get(n)?;
                self.used.borrow_mut().insert(k);
                Some(Motion { goes, declared: &module.frames, file: &module.name })
            })
            .collect()
    }

    fn given(&self) -> Vec<(u64, u64)> {
        self.all().iter().flat_map(|m| m.given.iter().copied()).collect()
    }
}

/// What several modules say alike.
fn the_same(mut all: Vec<Result<Frame, String>>, name: &str, spelling: Spelling) -> Option<Result<Frame, String>> {
    let last = all.pop()?;
    if all.iter().any(|one| *one != last) {
        let what = format!(
            "'{name}' has different numbers in the modules beside the program; {} says which are right",
            spelling.with("frames", "MODULE")
        );
        return Some(Err(what));
    }
    Some(last)
}

/// The modules beside a program, and names of those that are not read.
fn modules_of(program: &Path) -> (Vec<Module>, Vec<String>) {
    let (mut modules, mut unread) = (Vec::new(), Vec::new());
    let Ok(whole) = resolved(program) else { return (modules, unread) };
    let Some(folder) = whole.parent() else { return (modules, unread) };
    let mut folders = vec![folder.to_owned()];
    let is_part =
        |p: &Path| p.file_name().is_some_and(|n| n.eq_ignore_ascii_case("PROGMOD") || n.eq_ignore_ascii_case("SYSMOD"));
    if let Some(task) = folder.parent().filter(|_| is_part(folder)) {
        folders.extend(paths(task, |p| is_part(p) && p != folder));
    }
    let is_module =
        |p: &PathBuf| Dialect::of(p) == Some(Dialect::Rapid) && resolved(p).is_ok_and(|p| p != whole) && p.is_file();
    let mut files: Vec<PathBuf> = folders.iter().flat_map(|folder| paths(folder, is_module)).collect();
    files.sort_unstable();
    for (number, path) in files.into_iter().enumerate() {
        let name = name_of(&path);
        let Some(bytes) = (number < MOST).then(|| read_small(&path)).flatten() else {
            unread.push(name);
            continue;
        };
        // what was written for an earlier model
        if contains(&bytes, MARK.as_bytes()) {
            continue;
        }
        let Exports { routines, frames, goes, given, .. } = rapid::for_others(&bytes, number);
        let (mut goes, mut given): (Vec<_>, Vec<_>) = (goes.into_iter().collect(), given.into_iter().collect());
        goes.sort_unstable();
        given.sort_unstable();
        let (file, name) = (path.display().to_string(), name.to_lowercase());
        modules.push(Module { file, name, routines, frames, goes, given });
    }
    (modules, unread)
}
