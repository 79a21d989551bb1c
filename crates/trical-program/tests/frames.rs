//! Files of tools and frames (`--frames`) with a few characters changed: no panic, and only rigid transforms are taken.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../../trical-model/tests/common/mutants.rs"]
mod common;
#[path = "../../../fuzz/src/program.rs"]
#[expect(dead_code, reason = "programs are tried by tests/corpus.rs")]
mod targets;

use trical_program::Frames;

#[test]
fn tools_and_frames() {
    let seed = "[world]\nxyz_mm = [0, 0, 290.0]\n[tools.grip]\nxyz_mm = [0.0, 1.5, 120]\nzyx_deg = [90, 0, -45.5]\nmass_kg = 2.5\n\
                cog_mm = [0, 0, 60]\n[frames.table]\nxyz_mm = [500, -100, 20]\nquaternion = [1, 0, 0, 0]\n";
    common::mutants(&[seed], |text| targets::frames(text.as_bytes()));
    let twice = Frames::parse("[tools.A]\nxyz_mm = [0, 0, 1]\n[tools.a]\nxyz_mm = [0, 0, 2]\n", "f.toml").unwrap_err();
    assert!(twice.to_string().contains("[tools.a]: is given twice"));
}
