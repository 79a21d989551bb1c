//! Damaged programs, and bytes that are none.

use proptest::prelude::*;
use trical_program::{Dialect, Frames, Program, compensate};

use crate::fixtures::{IRB, nominal, programs};
use crate::options;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]
    /// Bytes changed, taken out, doubled: a report or a sentence, never a panic, and what is kept is kept.
    #[test]
    fn damaged_programs_never_panic(which in 0usize..5, cuts in proptest::collection::vec((any::<prop::sample::Index>(), 0u8..5, any::<u8>()), 1..12)) {
        let (d, mut text, frames, nominal, _) = programs().swap_remove(which);
        for (at, kind, byte) in cuts {
            let k = at.index(text.len());
            match kind {
                0 => text[k] = byte,
                1 => { text.remove(k); }
                2 => text.insert(k, b"[]{},;:\"'!\\(=pP"[usize::from(byte) % 15]),
                3 => text.truncate(k.max(text.len() / 2)),
                _ => { let end = (k + usize::from(byte)).min(text.len()); text.drain(k..end); }
            }
            if text.is_empty() { text.push(b'x'); }
        }
        let mut out = Vec::new();
        if compensate(Program::of_file(&text, "p", d, &mut out), &nominal, &nominal, &frames, &options()).is_ok() {
            prop_assert!(out.len() >= text.len());
        }
    }

    #[test]
    fn random_bytes_never_panic(which in 0usize..5, text in "[\\[\\]{}(),;:=!#pPXYZABCEMoveL0-9. \n&\"'/\\\\]{0,400}") {
        let d = Dialect::ALL[which];
        let n = nominal(IRB);
        let _ = compensate(Program::of_file(text.as_bytes(), "p", d, &mut Vec::new()), &n, &n, &Frames::default(), &options());
    }
}
