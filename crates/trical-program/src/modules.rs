//! The modules of a RAPID task beside the one that is rewritten: what their routines do, and their tools and work objects.

use std::cell::{OnceCell, RefCell};
use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};

use trical_model::Pose;

use crate::dialects::rapid::{self, Effects};
use crate::dialects::{Dialect, MARK};
use crate::elsewhere::{Elsewhere, Outside};
use crate::frames::{Frames, ToolFrame};
use crate::scan::hashed;
use crate::text::contains;

/// Modules that are read, at most, and bytes of each.
const MOST: usize = 300;
const LARGEST: u64 = 16 << 20;

/// Modules in the folder of a program; of a backup, also those of `PROGMOD` and `SYSMOD` of the same task.
pub struct Modules {
    program: PathBuf,
    read: OnceCell<Vec<Module>>,
    used: RefCell<BTreeSet<usize>>,
}

struct Module {
    file: String,
    effects: HashMap<u64, Effects>,
    frames: Frames,
}

impl Modules {
    /// Beside a program.
    #[must_use]
    pub fn beside(program: &Path) -> Self {
        Self { program: program.to_owned(), read: OnceCell::new(), used: RefCell::default() }
    }

    /// Those of which something was used.
    #[must_use]
    pub fn used(&self) -> Vec<String> {
        let used = self.used.borrow();
        used.iter().filter_map(|k| self.all().get(*k)).map(|m| m.file.clone()).collect()
    }

    fn all(&self) -> &[Module] {
        self.read.get_or_init(|| modules_of(&self.program))
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

    /// What a routine does, and what it calls in turn.
    fn gather(&self, name: &str, out: &mut Outside, seen: &mut HashSet<u64>) -> bool {
        let key = hashed(name.as_bytes());
        if !seen.insert(key) {
            return true;
        }
        let all = self.every(|m| m.effects.get(&key).cloned());
        for one in &all {
            out.moves |= one.moves;
            out.displaces |= one.displaces;
            out.sets.extend(&one.sets);
        }
        let mut next: Vec<&String> = all.iter().flat_map(|one| &one.calls).collect();
        next.dedup();
        // what no module has may move the arm
        for called in next {
            let known = seen.len() < MOST && self.gather(called, out, seen);
            out.moves |= !known;
        }
        !all.is_empty()
    }
}

impl Elsewhere for Modules {
    fn routine(&self, name: &str) -> Option<Outside> {
        let mut out = Outside::default();
        self.gather(name, &mut out, &mut HashSet::new()).then_some(out)
    }

    fn tool(&self, name: &str) -> Option<Result<ToolFrame, String>> {
        the_same(self.every(|m| m.frames.tools.get(name).cloned()), name)
    }

    fn frame(&self, name: &str) -> Option<Result<Pose, String>> {
        the_same(self.every(|m| m.frames.frames.get(name).cloned()), name)
    }
}

/// What several modules say alike.
fn the_same<T: PartialEq>(mut all: Vec<Result<T, String>>, name: &str) -> Option<Result<T, String>> {
    let last = all.pop()?;
    if all.iter().any(|one| *one != last) {
        let what = format!(
            "'{name}' has different numbers in the modules beside the program; --frames MODULE says which are right"
        );
        return Some(Err(what));
    }
    Some(last)
}

fn modules_of(program: &Path) -> Vec<Module> {
    let Ok(whole) = program.canonicalize() else { return Vec::new() };
    let Some(folder) = whole.parent() else { return Vec::new() };
    let mut folders = vec![folder.to_owned()];
    let is_part =
        |p: &Path| p.file_name().is_some_and(|n| n.eq_ignore_ascii_case("PROGMOD") || n.eq_ignore_ascii_case("SYSMOD"));
    if let Some(task) = folder.parent().filter(|_| is_part(folder)) {
        let beside = std::fs::read_dir(task).into_iter().flatten().flatten().map(|e| e.path());
        folders.extend(beside.filter(|p| is_part(p) && p != folder));
    }
    let mut paths: Vec<PathBuf> = folders
        .iter()
        .flat_map(|folder| std::fs::read_dir(folder).into_iter().flatten().flatten())
        .map(|e| e.path())
        .filter(|p| Dialect::of(p) == Some(Dialect::Rapid) && p.canonicalize().is_ok_and(|p| p != whole))
        .filter(|p| p.metadata().is_ok_and(|m| m.is_file() && m.len() <= LARGEST))
        .collect();
    paths.sort_unstable();
    let read = paths.into_iter().take(MOST).filter_map(|path| {
        let bytes = std::fs::read(&path).ok().filter(|bytes| !contains(bytes, MARK.as_bytes()))?;
        let (effects, frames) = rapid::for_others(&bytes);
        Some(Module { file: path.display().to_string(), effects, frames })
    });
    read.collect()
}
