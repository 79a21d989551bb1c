//! Configurations and turns in the text: they choose the branch, and are rewritten where a joint crosses them.

use trical_model::ik::inverse_kinematics;
use trical_model::pose::angles_zyx;
use trical_model::{Forward, MAX_JOINTS, Model, State};
use trical_program::{Dialect, Frames, Options, Program, compensate};

use crate::fixtures::{IRB, KR6, LR, UR5E, device, flange, mm, nominal, numbers, pose, quadrant, quaternion, real};
use crate::{options, run};

#[test]
fn the_configuration_in_the_text_chooses_the_branch() {
    let n = nominal(IRB);
    // the same pose with the wrist flipped: joint 4 half a turn on, joint 5 negative, joint 6 half a turn back
    for q in [[10.0, 12.0, -8.0, 20.0, 40.0, -30.0], [10.0, 12.0, -8.0, -160.0, -40.0, 150.0]] {
        let p = flange(&n, &q).compose(&device());
        let text = format!(
            "CONST robtarget p:=[[{}],[{}],[{},{},{},{}],[9E9,9E9,9E9,9E9,9E9,9E9]];",
            numbers(&mm(&p)),
            quaternion(&p),
            quadrant(q[0]),
            quadrant(q[3]),
            quadrant(q[5]),
            i32::from(q[4] < 0.0)
        );
        let (_, report) = run(text.as_bytes(), Dialect::Rapid, &n, &n, &Frames::default());
        for (a, b) in report.rows[0].joints.iter().zip(q) {
            assert!((a.to_degrees() - b).abs() < 1e-3, "{:?} {q:?}", report.rows[0].joints);
        }
    }
}

#[test]
fn a_quadrant_that_the_correction_crosses_is_rewritten() {
    let n = nominal(IRB);
    let real = real(&n);
    let q = [0.0, 20.0, 5.0, 0.0, 45.0, 0.0];
    let p = flange(&n, &q).compose(&device());
    let text = format!(
        "CONST robtarget p:=[[{}],[{}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];",
        numbers(&mm(&p)),
        quaternion(&p)
    );
    let (out, report) = run(text.as_bytes(), Dialect::Rapid, &n, &real, &Frames::default());
    let j = report.rows[0].joints;
    let cf = [j[0], j[3], j[5]].map(|q| quadrant(q.to_degrees()));
    assert!(cf != [0, 0, 0], "{j:?}");
    let text = String::from_utf8(out).unwrap();
    assert!(text.contains(&format!("[{},{},{},0]", cf[0], cf[1], cf[2])), "{text} {j:?}");
}

#[test]
fn a_first_target_without_a_configuration_gets_a_caution_whether_a_motion_names_it_or_not() {
    let n = nominal(KR6);
    let p = flange(&n, &[10.0, -80.0, 95.0, 20.0, 45.0, -10.0]).compose(&device());
    let [a, b, c] = angles_zyx(&p.rotation).map(|a| format!("{:.7}", a.to_degrees()));
    let [x, y, z] = mm(&p).map(|x| format!("{x:.5}"));
    let place = format!("{{X {x},Y {y},Z {z},A {a},B {b},C {c}}}");
    for text in [format!("DECL E6POS P[2]\nP[1]={place}\nLIN P[I]\n"), format!("DECL E6POS XP1={place}\n")] {
        let (_, report) = run(text.as_bytes(), Dialect::Krl, &n, &n, &Frames::default());
        assert!(report.cautions.iter().any(|c| c.contains("in which configuration")), "{text}: {report:?}");
    }
}

#[test]
fn a_routine_above_the_program_and_a_further_branch_are_met_as_the_program_leaves_the_arm() {
    let n = nominal(UR5E);
    let q = [10.0, -78.0, 62.0, -40.0, 60.0, -30.0];
    let p = flange(&n, &q).compose(&device());
    let v = trical_model::pose::rotation_vector(&p.rotation);
    let t = &p.translation;
    let place = format!("p[{:.8},{:.8},{:.8},{:.9},{:.9},{:.9}]", t.x, t.y, t.z, v.x, v.y, v.z);
    let near = q.map(|q| format!("{:.6}", f64::to_radians(q))).join(",");
    let routine = format!("def go():\nmovel({place})\nend\n");
    let program = format!("movej([{near}])\n");
    let away = [10.0, -20.0, -62.0, 40.0, -60.0, 150.0].map(|q| format!("{:.6}", f64::to_radians(q))).join(",");
    let branches = format!("{program}if b:\nmovej([{away}])\nelse:\nmovel({place})\nend\n");
    for text in [format!("{routine}{program}go()\n"), format!("{program}{routine}go()\n"), branches] {
        let (_, report) = run(text.as_bytes(), Dialect::UrScript, &n, &real(&n), &Frames::default());
        let row =
            report.rows.iter().find(|r| text.lines().nth(r.line - 1).is_some_and(|l| l.starts_with("movel"))).unwrap();
        let apart = row.joints.iter().zip(q).map(|(a, b)| (a - f64::to_radians(b)).abs()).fold(0.0, f64::max);
        assert!(apart < 0.05, "{text}: {:?}", row.joints);
    }
}

#[test]
fn a_pose_that_the_arm_reaches_in_several_configurations_is_named() {
    let n = nominal(UR5E);
    let q = [10.0, -78.0, 62.0, -40.0, 60.0, -30.0].map(f64::to_radians);
    let arm = Forward::new(n.clone(), vec![]).unwrap();
    let mut ws = arm.workspace();
    let mut near = [0.0; MAX_JOINTS];
    near[..6].copy_from_slice(&q);
    let all =
        inverse_kinematics(&arm, &arm.world_from_tool(&State::at(&near), &mut ws), &State::at(&near), &mut ws).unwrap();
    let flipped = all.iter().map(|s| s.joints).find(|j| j[4] < -0.5 && j[2] > 0.0).unwrap();
    let joints =
        |q: &[f64]| format!("movej([{}])\n", q[..6].iter().map(|q| format!("{q:.8}")).collect::<Vec<_>>().join(","));
    let (as_it_is, otherwise) = (joints(&q), joints(&flipped));
    let p = flange(&n, &q.map(f64::to_degrees)).compose(&device());
    let (v, t) = (trical_model::pose::rotation_vector(&p.rotation), &p.translation);
    let place = format!("p[{:.8},{:.8},{:.8},{:.9},{:.9},{:.9}]", t.x, t.y, t.z, v.x, v.y, v.z);
    let linear = format!("movel({place})\n");
    let told = joints(&q).replace("movej(", &format!("servoj(get_inverse_kin({place},qnear=")).replace(")\n", "))\n");
    let mut turned = q;
    turned[5] += std::f64::consts::TAU;
    let beyond = told.replace(&place, "p[9,0,0,0,0,0]");
    // A, F: to joints in either configuration, T: in the first, a turn of joint 6 on; L: to the pose, N: in the first; U: beyond reach
    for (text, is_named, is_flipped) in [
        ("A if b:\n F end\n L", true, true),
        ("A if b:\n L end\n L", false, false),
        ("A if b:\n T end\n L", false, false),
        ("def main():\n A def go():\n F end\n L end\n", false, false),
        ("A if b:\n F else:\n F end\n L", false, true),
        ("A if b:\n F else:\n A end\n L", true, false),
        ("A while b:\n L F end\n", true, false),
        ("A while b:\n L A end\n", false, false),
        ("def main():\n def go():\n F end\n A go()\n L end\n", false, true),
        ("def main():\n def go():\n L end\n A go()\n F go()\n end\n", true, false),
        ("def main():\n def go():\n L end\n A go()\n A go()\n end\n", false, false),
        ("def main():\n def go():\n N end\n A go()\n F go()\n end\n", false, false),
        ("def main():\n while b:\n N F end\n end\n main()\n", false, false),
        ("def main():\n def go():\n U L end\n A go()\n F go()\n end\n", true, false),
        ("A go()\n F go()\n def go():\n L end\n", true, false),
        ("def main():\n def go():\n L end\n A go()\n end\n F main()\n", false, false),
        ("def go():\n L end\n def main():\n go()\n end\n A main()\n F main()\n", true, true),
        ("wp=@\n A movel(wp)\n F movel(wp)\n", true, false),
        ("wp=@\n A movel(wp)\n A movel(wp)\n", false, false),
    ] {
        let program = text
            .replace('A', &as_it_is)
            .replace('F', &otherwise)
            .replace('L', &linear)
            .replace('T', &joints(&turned))
            .replace('N', &told)
            .replace('U', &beyond)
            .replace(' ', "");
        let program =
            program.replace('@', &place).replace("def", "def ").replace("if", "if ").replace("while", "while ");
        let (_, report) = run(program.as_bytes(), Dialect::UrScript, &n, &real(&n), &Frames::default());
        let row = report.rows.iter().find(|r| !program.lines().nth(r.line - 1).unwrap().starts_with("movej")).unwrap();
        let named: Vec<_> = report.cautions.iter().filter(|c| c.contains("in several configurations")).collect();
        assert_eq!((!named.is_empty(), row.joints[4] < 0.0), (is_named, is_flipped), "{program}{:?}", report.cautions);
        assert!(named.iter().all(|c| c.contains(&format!("line {}", row.line))), "{named:?}");
    }
}

#[test]
fn a_turn_is_read_and_written_in_its_own_form() {
    let n = nominal(KR6);
    // joint 4 comes to the other side of zero
    let q = [10.0, -80.0, 95.0, 0.0, 45.0, -10.0];
    let p = flange(&n, &q).compose(&device());
    let [a, b, c] = angles_zyx(&p.rotation).map(|a| format!("{:.9}", a.to_degrees()));
    let [x, y, z] = mm(&p).map(|x| format!("{x:.7}"));
    let pairs = [("42", "34"), ("'B101010'", "'B100010'"), ("'b0101010'", "'b0100010'"), ("'H2a'", "'H22'")];
    let plain = pairs.map(|(old, new)| (format!(" {old}"), new));
    // of a sign alone between the name and the number a blank is left
    for (old, new) in plain.into_iter().chain([("+42".to_owned(), "34")]) {
        let text = format!("PTP {{X {x},Y {y},Z {z},A {a},B {b},C {c},S 2,T{old}}}\n");
        let (out, report) = run(text.as_bytes(), Dialect::Krl, &n, &real(&n), &Frames::default());
        assert!(report.rows[0].joints[3] > 0.0, "{:?}", report.rows[0].joints);
        let out = String::from_utf8(out).unwrap();
        assert!(out.contains(&format!("T {new}}}")), "{out}");
    }
}

#[test]
fn a_turn_that_no_joints_have_refuses_a_motion_from_point_to_point_and_is_told_on_a_path() {
    let n = nominal(KR6);
    let q = [10.0, -80.0, 95.0, 20.0, 45.0, -10.0];
    let p = flange(&n, &q).compose(&device());
    let [a, b, c] = angles_zyx(&p.rotation).map(|a| format!("{:.9}", a.to_degrees()));
    let [x, y, z] = mm(&p).map(|x| format!("{x:.7}"));
    let asked = |motion: &str, status: &str| {
        let text = format!("{motion} {{X {x},Y {y},Z {z},A {a},B {b},C {c},{status}}}\n");
        let (out, report) = run(text.as_bytes(), Dialect::Krl, &n, &real(&n), &Frames::default());
        (String::from_utf8(out).unwrap(), report)
    };
    let (_, report) = asked("PTP", "S 2,T 63");
    assert!(report.problems[0].what.contains("(T 63)"), "{:?}", report.problems);
    let (out, report) = asked("LIN", "S 2,T 63");
    assert!(report.problems.is_empty() && out.contains("S 2,T 63}"), "{:?} {out}", report.problems);
    assert!(report.cautions.iter().any(|c| c.contains("line 1") && c.contains("T 63")), "{:?}", report.cautions);
    // the status is all that is left to say how the arm stands
    let off =
        |q: [f64; 6]| report.rows[0].joints.iter().zip(q).map(|(a, b)| (a.to_degrees() - b).abs()).fold(0.0, f64::max);
    assert!(off(q) < 1.0, "{:?}", report.rows[0].joints.map(f64::to_degrees));
    // a turn that the arm has is taken
    let (_, report) = asked("LIN", "S 2,T 34");
    assert!(report.problems.is_empty() && report.cautions.iter().all(|c| !c.contains("T 34")), "{:?}", report.cautions);
}

/// A listing that goes to the flange's place at these joints (deg), with turn numbers.
fn listing(n: &Model, q: &[f64; 6], turns: &str) -> String {
    let p = pose(0.0, 0.0, 330.0, 0.0, 0.0, 0.0).inverse().compose(&flange(n, q));
    let [a, b, c] = angles_zyx(&p.rotation).map(|a| format!("{:.9}", a.to_degrees()));
    let [x, y, z] = mm(&p).map(|x| format!("{x:.7}"));
    format!(
        "/PROG A\n/MN\n   1:L P[1] 100mm/sec FINE ;\n/POS\nP[1]{{\n GP1:\n\tUF : 0, UT : 0, CONFIG : 'N U T, {turns}',\n\tX = {x} mm, Y = {y} mm, Z = {z} mm, W = {c} deg, P = {b} deg, R = {a} deg\n}};\n/END\n"
    )
}

#[test]
fn turns_of_a_fanuc_are_read_and_rewritten_where_a_joint_crosses_them() {
    let n = nominal(LR);
    let mut crossed = 0;
    for (q6, turn) in [(190.0, 1), (-170.0, 0), (179.99999, 0), (-179.99999, 0), (179.95, 0), (-179.95, 0)] {
        let q = [10.0, 12.0, -8.0, 20.0, -50.0, q6];
        let text = listing(&n, &q, &format!("0, 0, {turn}"));
        let (out, report) = run(text.as_bytes(), Dialect::Fanuc, &n, &real(&n), &Frames::default());
        let reached = report.rows[0].joints[5].to_degrees();
        assert!((reached - q6).abs() < 1.0, "{q6}: {reached}");
        let now = ((reached + 180.0) / 360.0).floor() as i32;
        crossed += i32::from(now != turn);
        let out = String::from_utf8(out).unwrap();
        assert!(out.contains(&format!("'N U T, 0, 0, {now}'")), "{q6}: {reached}\n{out}");
    }
    // from both places below half a turn
    assert_eq!(crossed, 2);
}

#[test]
fn a_turn_that_a_fanuc_demands_does_not_speak_for_the_other_side_of_the_arm() {
    let n = nominal(LR);
    // joints 1 and 4 half a turn further reach the same, with a joint 4 that rounds to the same turn
    let q = [-13.7, 5.1, -0.8, 180.05, -29.2, 30.0];
    let text = listing(&n, &q, "0, 1, 0");
    let (_, report) = run(text.as_bytes(), Dialect::Fanuc, &n, &real(&n), &Frames::default());
    let reached = report.rows[0].joints.map(f64::to_degrees);
    assert!((reached[0] - q[0]).abs() < 1.0 && (reached[3] - q[3]).abs() < 1.0, "{reached:?}");
}

#[test]
fn any_configuration_is_for_targets_whose_own_the_arm_does_not_have_and_these_are_told() {
    let n = nominal(LR);
    let q = [10.0, 12.0, -8.0, 20.0, -50.0, 30.0];
    let asked = |config: &str, any_configuration: bool| {
        let text = listing(&n, &q, "0, 0, 0").replace("N U T, 0, 0, 0", config);
        let options = Options { any_configuration, ..options() };
        let mut out = Vec::new();
        let program = Program::of_file(text.as_bytes(), "p", Dialect::Fanuc, &mut out);
        let report = compensate(program, &n, &real(&n), &Frames::default(), &options).unwrap();
        let is_told = report.cautions.iter().any(|c| c.contains("no joints of the arm have all of the configuration"));
        (report.rows.first().map(|row| row.joints[4] < 0.0), is_told)
    };
    for (config, takes, takes_any) in [
        ("N U T, 0, 0, 0", (Some(true), false), (Some(true), false)),
        // the wrist the other way round: joints 4 and 6 half a turn on
        ("F U T, 0, 0, 0", (Some(false), false), (Some(false), false)),
        ("F U T", (Some(false), false), (Some(false), false)),
        // the elbow below, or behind: there is no such solution
        ("N D T, 0, 0, 0", (Some(true), true), (Some(true), true)),
        // a turn that no joints have
        ("N U T, 0, 3, 0", (None, false), (Some(true), true)),
    ] {
        assert_eq!([asked(config, false), asked(config, true)], [takes, takes_any], "{config}");
    }
}
