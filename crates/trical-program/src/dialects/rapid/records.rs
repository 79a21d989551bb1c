//! RAPID's records: `RECORD station robtarget pick; num n; ENDRECORD`. Targets of a record's data have the name of the data, whichever component.

use std::collections::HashMap;

use super::NO_TARGETS;
use super::instructions::is_instruction;
use crate::scan::hashed;
use crate::text::{Cursor, is_one_of};

/// Kinds of data that are targets.
const TARGETS: [&[u8]; 2] = [b"robtarget", b"jointtarget"];

/// A kind of data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Target,
    /// A record of this hashed name, or an alias.
    Record(u64),
    /// One of the language.
    Other,
}

impl Kind {
    pub(super) fn of(word: &[u8]) -> Self {
        if is_one_of(word, &TARGETS) {
            Self::Target
        } else if word.is_empty() || is_one_of(word, &NO_TARGETS) || is_instruction(word) {
            Self::Other
        } else {
            Self::Record(hashed(word))
        }
    }
}

/// Records inside records, at most.
const DEEPEST: usize = 8;

/// The records of a module: by their hashed names, the kinds of their components.
#[derive(Debug, Default)]
pub(super) struct Records(pub(super) HashMap<u64, HashMap<u64, Kind>>);

impl Records {
    pub(super) fn of(bytes: &[u8]) -> Self {
        let mut found: HashMap<u64, HashMap<u64, Kind>> = HashMap::new();
        let mut c = Cursor::new(bytes, b'!');
        while let Some((_, word)) = c.next_word() {
            if !word.eq_ignore_ascii_case(b"record") {
                continue;
            }
            let components = found.entry(hashed(c.name_ahead())).or_default();
            while let Some((_, kind)) = c.next_word().filter(|(_, word)| !word.eq_ignore_ascii_case(b"endrecord")) {
                components.insert(hashed(c.name_ahead()), Kind::of(kind));
            }
        }
        Self(found)
    }

    /// Whether data of this kind may hold targets: of a record of another module nobody knows.
    pub(super) fn hold_targets(&self, kind: Kind) -> bool {
        self.hold(kind, 0)
    }

    fn hold(&self, kind: Kind, depth: usize) -> bool {
        match kind {
            Kind::Target => true,
            Kind::Other => false,
            Kind::Record(name) => self
                .0
                .get(&name)
                .is_none_or(|parts| depth < DEEPEST && parts.values().any(|kind| self.hold(*kind, depth + 1))),
        }
    }

    /// Whether this is a record of the module that holds targets.
    pub(super) fn are_targets(&self, kind: Kind) -> bool {
        matches!(kind, Kind::Record(name) if self.0.contains_key(&name)) && self.hold_targets(kind)
    }
}
