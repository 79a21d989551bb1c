//! Plans with a few characters changed: no panic, nothing beyond the arm's limits, and what is taken is read back the same.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../../trical-model/tests/common/mutants.rs"]
mod common;
#[path = "../../../fuzz/src/plan.rs"]
#[expect(dead_code, reason = "cells and meshes are tried by tests/corpus.rs")]
mod targets;

#[test]
fn plans() {
    let seed = "order,ball,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,a1_deg,a2_deg,a3_deg,a4_deg,a5_deg,a6_deg,via\n\
                1,2,10.5,-20,30,-40,50,-60,11,-21,31,-41,51,-61,1 2 3 4 5 6;7 8 9 10 11 12\n\
                2,3,10,20,30,40,50,60,11,21,31,41,51,61,\n";
    common::mutants(&[seed], |text| targets::plan(text.as_bytes()));
}
