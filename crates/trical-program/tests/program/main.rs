//! Programs of every dialect, written here from joint values as a controller would teach them, compensated, read again as the
//! controller reads them, and driven on the arm of the full model.

#![allow(clippy::disallowed_methods, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod beside;
mod conditions;
mod configurations;
mod corpus;
mod damaged;
mod few_joints;
mod fixtures;
mod listed;
mod rail;
mod senses;
mod setups;
mod sink;
mod tables;

use fixtures::{IRB, nominal, programs, real};
use trical_model::{Model, Support};
use trical_program::{Dialect, Frames, Options, Program, ProgramError, Report, compensate};

fn options() -> Options {
    Options { temp_c: Some(32.0), details: true, model_name: "m.toml".into(), ..Options::default() }
}

fn run(text: &[u8], d: Dialect, nominal: &Model, model: &Model, frames: &Frames) -> (Vec<u8>, Report) {
    let mut out = Vec::new();
    let report = compensate(Program::of_file(text, "p", d, &mut out), nominal, model, frames, &options()).unwrap();
    (out, report)
}

fn refused(text: &[u8], d: Dialect) -> String {
    let n = nominal(IRB);
    match compensate(Program::of_file(text, "p", d, &mut Vec::new()), &n, &n, &Frames::default(), &options()) {
        Err(ProgramError::Input(e)) => e,
        other => panic!("{other:?}"),
    }
}

/// The line with the mark, taken away.
fn unmarked(text: &[u8]) -> Vec<u8> {
    let bom = if text.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
    let is_mark = |l: &&[u8]| l.windows(21).any(|w| w == b"compensated by TriCal");
    let lines: Vec<&[u8]> = text[bom..].split_inclusive(|b| *b == b'\n').collect();
    assert_eq!(lines.iter().filter(|l| is_mark(l)).count(), 1);
    [&text[..bom], &lines.into_iter().filter(|l| !is_mark(l)).collect::<Vec<_>>().concat()].concat()
}

#[test]
fn an_identity_model_changes_no_byte() {
    for (d, text, frames, nominal, targets) in programs() {
        let (out, report) = run(&text, d, &nominal, &nominal, &frames);
        assert!(report.problems.is_empty(), "{d:?}: {:?}", report.problems);
        assert_eq!(report.rewritten, targets, "{d:?}");
        assert_eq!(String::from_utf8_lossy(&unmarked(&out)), String::from_utf8_lossy(&text), "{d:?}");
        assert!(unmarked(&out) == text, "{d:?}");
        assert!(report.largest_move < 1e-9);
    }
}

#[test]
fn targets_at_joint_angles_that_the_model_was_not_learnt_at_are_named() {
    let (d, text, frames, nominal, targets) = programs().into_iter().next().unwrap();
    let asked = |visited: Support| {
        let options = Options { visited, ..options() };
        compensate(Program::of_file(&text, "p", d, &mut Vec::new()), &nominal, &nominal, &frames, &options).unwrap()
    };
    let all = asked(Support::default());
    assert!(all.beyond == 0 && all.cautions.is_empty(), "{:?}", all.cautions);
    let everywhere: Vec<trical_model::Joints> = all.rows.iter().map(|r| r.joints).collect();
    assert_eq!(asked(Support::of(&nominal.robot, &everywhere)).beyond, 0);
    // joint 3 was never where the first target has it
    let others: Vec<_> = everywhere
        .iter()
        .map(|q| {
            let mut q = *q;
            q[2] = everywhere[0][2] + 0.1;
            q
        })
        .collect();
    let some = asked(Support::of(&nominal.robot, &others));
    assert!(some.beyond > 0 && some.beyond <= targets);
    let first = format!("line {}", all.rows[0].line);
    assert!(some.cautions[0].contains(&first) && some.cautions[0].contains("joint 3"), "{:?}", some.cautions);
}

#[test]
fn the_arm_of_the_full_model_goes_where_each_program_says() {
    for (d, text, frames, nominal, targets) in programs() {
        let real = real(&nominal);
        let (out, report) = run(&text, d, &nominal, &real, &frames);
        assert!(report.problems.is_empty(), "{d:?}: {:?}", report.problems);
        assert_eq!(report.rewritten, targets);
        assert!(report.before[0] > 0.4e-3 && report.after[1] < 0.5e-6, "{d:?}: {:?} {:?}", report.before, report.after);
        // as the controller reads the two files
        let (_, was) = run(&text, d, &nominal, &nominal, &frames);
        let (_, again) = run(&unmarked(&out), d, &nominal, &nominal, &frames);
        assert!(again.problems.is_empty(), "{d:?}: {:?}", again.problems);
        for ((was, again), row) in was.rows.iter().zip(&again.rows).zip(&report.rows) {
            for (a, b) in again.joints.iter().zip(&row.joints) {
                assert!((a - b).abs() < 1e-6, "{d:?} {}: {:?} {:?}", row.name, again.joints, row.joints);
            }
            assert!((was.wanted.translation - row.wanted.translation).norm() < 1e-12);
        }
        // only numbers changed
        let rest = |t: &[u8]| -> Vec<u8> {
            t.iter().copied().filter(|b| !b.is_ascii_digit() && !matches!(b, b'.' | b'-' | b'+' | b' ')).collect()
        };
        assert_eq!(rest(&unmarked(&out)), rest(&text), "{d:?}");
        assert_ne!(unmarked(&out), text);
    }
}

#[test]
fn twice_is_refused_and_so_is_what_is_no_program() {
    for (d, text, frames, nominal, _) in programs() {
        let (out, _) = run(&text, d, &nominal, &nominal, &frames);
        assert!(refused(&out, d).contains("compensated already"), "{d:?}");
        assert!(refused(b"nothing here\n", d).contains("expected"), "{d:?}");
        assert!(refused(b"\xff\xfea\0b\0", d).contains("UTF-16"), "{d:?}");
    }
}
