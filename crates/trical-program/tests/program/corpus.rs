//! Small programs after the shapes that are found in the field, one construction each: which lines are rewritten, and which
//! are listed and why.
//!
//! `@k` stands for the coordinates of a pose that the arm reaches, as the dialect writes them; `@Xk`, `@Yk`, `@Zk` for one, `@Rk`
//! for its orientation.

mod fanuc;
mod krl;
mod rapid;
mod same;
mod urscript;

use trical_model::Model;
use trical_model::pose::{angles_zyx, rotation_vector};
use trical_program::{Dialect, Frames, Options, Program, compensate};

use crate::fixtures::{IRB, KR6, LR, UR5E, device, flange, joints, mm, nominal, pose, quadrant, quaternion, real};
use fanuc::FANUC;
use krl::KRL;
use rapid::RAPID;
use same::SAME;
use urscript::URSCRIPT;

struct Case {
    name: &'static str,
    text: &'static str,
    /// Lines of targets that are rewritten.
    rewritten: &'static [usize],
    /// Lines that are listed, with words of the reason.
    listed: &'static [(usize, &'static str)],
}

const fn case(
    name: &'static str,
    text: &'static str,
    rewritten: &'static [usize],
    listed: &'static [(usize, &'static str)],
) -> Case {
    Case { name, text, rewritten, listed }
}

const CSV: &[Case] = &[case(
    "rows",
    "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n10,20,10,5,60,-7\n10,20,10,5,x,-7\n",
    &[2],
    &[(3, "'x'")],
)];

/// The text with the coordinates of poses in it.
fn filled(text: &str, d: Dialect, model: &Model) -> String {
    let zero = match d {
        Dialect::Krl => [0.0, -90.0, 90.0, 0.0, 0.0, 0.0],
        Dialect::Fanuc => [0.0, 0.0, 0.0, 0.0, -90.0, 0.0],
        Dialect::UrScript => [0.0, -90.0, 70.0, -60.0, 20.0, 0.0],
        _ => [0.0; 6],
    };
    let mut out = text.to_owned();
    for (k, q) in joints(zero).iter().enumerate() {
        let mut p = flange(model, q);
        if d != Dialect::Rapid {
            p = p.compose(&device());
        }
        if d == Dialect::Fanuc {
            p = pose(0.0, 0.0, 330.0, 0.0, 0.0, 0.0).inverse().compose(&p);
        }
        let [x, y, z] = mm(&p).map(|x| format!("{x:.5}"));
        let [a, b, c] = angles_zyx(&p.rotation).map(|a| format!("{:.7}", a.to_degrees()));
        let v = rotation_vector(&p.rotation);
        let metres = [p.translation.x, p.translation.y, p.translation.z].map(|x| format!("{x:.8}"));
        let [x, y, z] = if d == Dialect::UrScript { metres } else { [x, y, z] };
        let below: u32 = q.iter().enumerate().map(|(i, q)| u32::from(*q < 0.0) << i).sum();
        let (all, turn) = match d {
            Dialect::Krl => (format!("X {x},Y {y},Z {z},A {a},B {b},C {c}"), format!("A {a},B {b},C {c}")),
            Dialect::Fanuc => {
                (format!("X = {x} mm, Y = {y} mm, Z = {z} mm, W = {c} deg, P = {b} deg, R = {a} deg"), String::new())
            }
            Dialect::UrScript => {
                let v = format!("{:.9},{:.9},{:.9}", v.x, v.y, v.z);
                (format!("{x},{y},{z},{v}"), v)
            }
            _ => {
                let cf = [0, 3, 5].map(|j| f64::from(quadrant(q[j])));
                out = out.replace(&format!("@C{k}"), &format!("[{},{},{},0]", cf[0], cf[1], cf[2]));
                let all = format!(
                    "[[{x},{y},{z}],[{}],[{},{},{},0],[9E9,9E9,9E9,9E9,9E9,9E9]]",
                    quaternion(&p),
                    cf[0],
                    cf[1],
                    cf[2]
                );
                (all, quaternion(&p))
            }
        };
        for (what, value) in [("X", x), ("Y", y), ("Z", z), ("R", turn), ("T", below.to_string()), ("", all)] {
            out = out.replace(&format!("@{what}{k}"), &value);
        }
    }
    out
}

#[test]
fn what_is_said_in_two_ways_is_rewritten_alike() {
    for (d, name, text, plain) in SAME {
        let nominal = nominal(if *d == Dialect::Krl { KR6 } else { UR5E });
        let options = Options { temp_c: Some(32.0), details: true, ..Options::default() };
        let run = |text: &str| {
            let text = filled(text, *d, &nominal);
            let (model, frames, out) = (real(&nominal), Frames::default(), &mut Vec::new());
            compensate(Program::of_file(text.as_bytes(), "p", *d, out), &nominal, &model, &frames, &options).unwrap()
        };
        let (one, other) = (run(text), run(plain));
        assert!(
            one.problems.is_empty() && other.problems.is_empty(),
            "{name}: {:?} {:?}",
            one.problems,
            other.problems
        );
        assert_eq!(one.rows.len(), other.rows.len(), "{name}");
        for (a, b) in one.rows.iter().zip(&other.rows) {
            let apart =
                (a.wanted.translation - b.wanted.translation).norm() + (a.wanted.rotation - b.wanted.rotation).norm();
            let turned = a.joints.iter().zip(&b.joints).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            // where a place is reached by another name, nobody knows in which sense: the gap of a joint
            assert!(apart < 1e-9 && turned < 1e-3, "{name}, line {}: {apart} {turned}", a.line);
        }
    }
}

#[test]
fn each_construction_is_rewritten_or_listed() {
    let mut wrong = Vec::new();
    for (d, robot, cases) in [
        (Dialect::Rapid, IRB, RAPID),
        (Dialect::Krl, KR6, KRL),
        (Dialect::Fanuc, LR, FANUC),
        (Dialect::UrScript, UR5E, URSCRIPT),
        (Dialect::Csv, IRB, CSV),
    ] {
        let nominal = nominal(robot);
        let real = real(&nominal);
        for case in cases {
            let text = filled(case.text, d, &nominal);
            let options = Options { temp_c: Some(32.0), details: true, ..Options::default() };
            let run = |text: &[u8], model: &Model, out: &mut Vec<u8>| {
                compensate(Program::of_file(text, "p", d, out), &nominal, model, &Frames::default(), &options).unwrap()
            };
            let mut out = Vec::new();
            let report = run(text.as_bytes(), &real, &mut out);
            let mut lines: Vec<usize> = report.rows.iter().map(|r| r.line).collect();
            lines.sort_unstable();
            let listed: Vec<String> = report.problems.iter().map(ToString::to_string).collect();
            let as_listed = report.problems.len() == case.listed.len()
                && report
                    .problems
                    .iter()
                    .zip(case.listed)
                    .all(|(p, (line, words))| p.line == *line && p.what.contains(words));
            if lines != case.rewritten || !as_listed || report.after[1] > 1e-6 {
                wrong.push(format!(
                    "{d:?}, {}: rewritten {lines:?}, listed {listed:#?}, after {:?}",
                    case.name, report.after
                ));
            }
            // what came out is a program of the same targets
            let targets = |text: &[u8]| d.scan(text).unwrap().spots.len();
            if targets(&out) != targets(text.as_bytes()) {
                wrong.push(format!("{d:?}, {}: other targets in\n{}", case.name, String::from_utf8_lossy(&out)));
            }
            // the nominal arm's own program: nothing moves, and no expression is replaced
            let mut same = Vec::new();
            run(text.as_bytes(), &nominal, &mut same);
            let same = String::from_utf8(same).unwrap();
            let kept = same.lines().filter(|l| !l.contains("compensated by TriCal")).eq(text.lines());
            if !kept {
                wrong.push(format!("{d:?}, {}: the nominal arm changes\n{same}", case.name));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
