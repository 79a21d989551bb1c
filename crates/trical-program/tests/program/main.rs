//! Programs of every dialect, written here from joint values as a controller would teach them, compensated, read again as the
//! controller reads them, and driven on the arm of the full model.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod beside;
mod corpus;
mod few_joints;
mod fixtures;
mod rail;
mod sink;

use fixtures::{
    IRB, KR6, LR, UR5E, device, flange, gripper, joints, mm, nominal, numbers, pose, programs, quadrant, quaternion,
    rapid, real,
};
use proptest::prelude::*;
use trical_model::pose::angles_zyx;
use trical_model::{
    Axis, Basis, Forward, MAX_JOINTS, Model, Motion, Shape, Site, State, Support, Term, Tool, Variable,
};
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

/// The joints to which the controller is sent are driven on an arm that is put together here: senses from the path, tool and
/// frame by hand.
#[test]
fn frames_senses_and_heat_are_those_of_the_program() {
    let nominal = nominal(IRB);
    let real = real(&nominal);
    let (_, report) = run(&rapid(&nominal), Dialect::Rapid, &nominal, &real, &Frames::default());
    let all = joints([0.0; 6]);
    // in the order of the file: p0, P1, path{1}, path{2}, jHome, inline
    let taught = [0, 1, 2, 4, 9, 3];
    // driven: home, p0, over P1, P1, path{1}, path{2}, inline
    let world_from_base = nominal.cell.world_from_base;
    for (row, k) in report.rows.iter().zip(taught) {
        if k == 9 {
            continue;
        }
        let wanted = world_from_base.compose(&flange(&nominal, &all[k])).compose(&if k.is_multiple_of(2) {
            device()
        } else {
            gripper()
        });
        assert!((row.wanted.translation - wanted.translation).norm() < 2e-8, "{k}");
        let mut arm = real.clone();
        if !k.is_multiple_of(2) {
            arm.cell.tool =
                Tool { tcp: gripper().translation, rotation: gripper().rotation, mass: 0.5, ..arm.cell.tool };
            arm.terms.retain(|t| !matches!(t.site, Site::Tool(_)));
        }
        let arm = Forward::new(arm, vec![]).unwrap();
        let mut ws = arm.workspace();
        // behind the loop over path{i} nobody knows from where
        let senses: &[i8] = if k == 3 { &[0] } else { &[-1, 1] };
        let best = senses
            .iter()
            .flat_map(|a| senses.iter().map(|b| (*a, *b)))
            .map(|(two, three)| {
                let mut dir = [0; MAX_JOINTS];
                (dir[1], dir[2]) = (two, three);
                let state = State { dir: Some(dir), temp_c: Some(32.0), ..State::at(&row.joints) };
                ((arm.world_from_tool(&state, &mut ws).translation - wanted.translation).norm(), two, three)
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap();
        assert!(best.0 < 3e-7, "{k}: {best:?}");
        // joints 2 and 3 from home (20, 10) to p0 (12, -8); p0 to path is by P1 (20, 5)
        let senses = match k {
            0 => (-1, -1),
            2 => (-1, 1),
            4 => (1, -1),
            _ => continue,
        };
        assert_eq!((best.1, best.2), senses, "{k}");
    }
}

#[test]
fn senses_matter_and_unknown_ones_are_zero() {
    let nominal = nominal(IRB);
    let real = real(&nominal);
    let text = b"q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n10,20,10,5,60,-7\n10,30,10,5,60,-7\n10,20,10,5,60,-7\n";
    let (out, _) = run(text, Dialect::Csv, &nominal, &real, &Frames::default());
    let lines: Vec<String> = String::from_utf8(unmarked(&out)).unwrap().lines().map(str::to_owned).collect();
    // the first is approached from nowhere, the third downwards: half the gap apart
    let q2 = |line: &str| line.split(',').nth(1).unwrap().parse::<f64>().unwrap();
    assert!((q2(&lines[3]) - q2(&lines[1]) - 0.4e-3_f64.to_degrees()).abs() < 2e-4, "{lines:?}");
}

/// A program in which joint 2 goes to what stands behind each `@`, and whether it comes there from below (+), from above (-), or from nobody knows
/// where (=); `motion` writes the k-th of them.
fn senses(d: Dialect, text: &str, motion: &dyn Fn(usize, &str) -> String) -> (String, String) {
    let nominal = nominal(IRB);
    let gap = Term { value: 0.4e-3, ..Term::new("gap_2", "test", Site::Joint { joint: 2 }, Basis::direction(2)) };
    let real = Model { terms: vec![gap], ..nominal.clone() };
    let mut pieces = text.split('@');
    let (mut program, mut told, mut going) = (pieces.next().unwrap().to_owned(), String::new(), Vec::new());
    for (k, piece) in pieces.enumerate() {
        let (q2, rest) = piece.split_at(2);
        program += &motion(k + 1, q2);
        told.push_str(&rest[..1]);
        going.push(q2.parse::<f64>().unwrap().to_radians());
        program += &rest[1..];
    }
    let positions: String = going
        .iter()
        .zip(1..)
        .map(|(q2, k)| format!("P[{k}]{{\n GP1:\n\tUF : 0, UT : 0,\n\tJ1= 10 deg,\tJ2= {:.1} deg,\tJ3= {:.1} deg,\tJ4= 5 deg,\tJ5= 60 deg,\tJ6= -7 deg\n}};\n", q2.to_degrees(), 10.0 - q2.to_degrees()))
        .collect();
    let (_, report) = run(program.replace("POSITIONS", &positions).as_bytes(), d, &nominal, &real, &Frames::default());
    assert_eq!((report.rows.len(), &report.problems[..]), (going.len(), &[][..]), "{program}");
    let found = report.rows.iter().zip(&going).map(|(row, q2)| match q2 - row.joints[1] {
        off if off.abs() < 1e-6 => '=',
        off if off > 0.0 => '+',
        _ => '-',
    });
    (found.collect(), told)
}

#[test]
fn where_the_program_may_come_from_elsewhere_no_sense_is_taken_from_the_text_above() {
    let rapid = "MODULE m\nPROC main()\n@20=\n@30+\nIF a THEN\n@20-\nELSEIF b THEN\n@25-\nELSE\n@25-\nENDIF\n@27=\n@20-\nIF b THEN\nSetDO x,1;\nENDIF\n@30+\n\
        TEST k\nCASE 1:\n@20-\nDEFAULT:\n@25-\nENDTEST\n@27=\n@20-\nIF c SetDO x,1;\nWaitTime 1;\n@30+\npeo;\n@20=\n@30+\npick;\n@20=\n@30+\nopen;\n@20-\nagain:\n@30=\nfetch 3;\n@20=\n@30+\n\
        WHILE a DO\n@20=\n@30+\nENDWHILE\n@20-\nFOR i FROM 1 TO 3 DO\n@25+\nENDFOR\n@20=\nopen;\n@25+\nIF a pick;\n@20=\nERROR\n@25=\n\
        ENDPROC\nPROC fetch(num k)\npick;\nENDPROC\nPROC pick()\n@20=\n@30+\nENDPROC\nPROC open()\nSetDO x,0;\nENDPROC\nENDMODULE\n";
    let krl = "DEF main()\n@20=\n@30+\nIF a THEN\n@20-\nELSE\n@25-\nENDIF\n@27=\n@20-\nIF b THEN\n$OUT[1]=TRUE\nENDIF\n@30+\n\
        SWITCH k\nCASE 1\n@20-\nDEFAULT\n@25-\nENDSWITCH\n@27=\n@20-\npick()\n@30=\n@20-\nopen()\n@30+\nagain:\n@20=\n@30+\nother()\n@20=\n@30+\n\
        LOOP\n@20=\n@30+\nENDLOOP\n@20-\nFOR i=1 TO 3\n@25+\nENDFOR\n@20=\n\
        END\nDEF pick()\n@20=\n@30+\nEND\nDEF open()\n$OUT[1]=TRUE\nEND\n";
    let ur = "def main():\ndef pick():\n@20=\n@30+\nend\ndef open():\nset_digital_out(1,True)\nend\ndef fetch():\npick()\nend\n@20=\n@30+\nif a:\n@20-\nelif b:\n@25-\n\
        else:\n@25-\nend\n@27=\n@20-\nif b:\nopen()\nend\n@30+\nwhile a:\n@20=\n@30+\nend\n@20-\nfetch()\n@30=\n@20-\nopen()\n@30+\nend\n";
    let fanuc = "/PROG A\n/MN\n1:@20=\n2:@30+\n3:IF (DI[1]=ON) THEN ;\n4:@20-\n5:ELSE ;\n6:@25-\n7:ENDIF ;\n8:@27=\n9:@20-\n10:IF DI[1]=ON,JMP LBL[1] ;\n11:@30+\n\
        12:CALL PICK ;\n13:@20=\n14:@30+\n15:LBL[1:again] ;\n16:@20=\n17:IF DI[1]=ON,CALL PICK ;\n18:@30=\n19:DO[1]=ON ;\n20:@20-\n\
        21:GRIP OPEN ;\n22:@30=\n23:FOR R[1]=1 TO 3 ;\n24:@20=\n25:@30+\n26:ENDFOR ;\n27:@20=\n/POS\nPOSITIONS/END\n";
    let third = |q2: &str| 10.0 - q2.parse::<f64>().unwrap();
    let radians = |q2: &str| [10.0, q2.parse::<f64>().unwrap(), third(q2), 5.0, 60.0, -7.0].map(f64::to_radians);
    let abb =
        |_, q2: &str| format!("MoveAbsJ [[10,{q2},{},5,60,-7],[9E9,9E9,9E9,9E9,9E9,9E9]],v1,fine,tool0;", third(q2));
    let kuka = |_, q2: &str| format!("PTP {{A1 10,A2 {q2},A3 {},A4 5,A5 60,A6 -7}}", third(q2));
    let teach: &dyn Fn(usize, &str) -> String = &|k, _| format!("J P[{k}] 100% FINE ;");
    for (d, text, motion) in [
        (Dialect::Rapid, rapid, &abb as &dyn Fn(usize, &str) -> String),
        (Dialect::Krl, krl, &kuka),
        (Dialect::UrScript, ur, &|_, q2| format!("movej({:?})", radians(q2))),
        (Dialect::Fanuc, fanuc, teach),
    ] {
        let (found, told) = senses(d, text, motion);
        assert_eq!(found, told, "{d:?}");
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

const TARGET: &str = "[[350,50,320],[0,0.6,0.8,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]";

fn problems(body: &str) -> Vec<String> {
    let n = nominal(IRB);
    let mut out = Vec::new();
    let options = Options { any_configuration: true, ..options() };
    let text = body.replace("TARGET", TARGET);
    let report = compensate(
        Program::of_file(text.as_bytes(), "p", Dialect::Rapid, &mut out),
        &n,
        &n,
        &Frames::default(),
        &options,
    )
    .unwrap();
    report.problems.iter().map(ToString::to_string).collect()
}

#[test]
fn what_cannot_be_right_is_listed_with_line_and_name() {
    let one = |body: &str, words: &[&str]| {
        let found = problems(body);
        assert_eq!(found.len(), 1, "{body}: {found:?}");
        for w in words {
            assert!(found[0].contains(w), "'{w}' is missing in {found:?}");
        }
    };
    let declare = "\nCONST robtarget p:=TARGET;\n";
    one(&format!("{declare}MoveL p,v1,fine,tOther;"), &["line 2 (p)", "'tother'", "(frames gives"]);
    one(&format!("{declare}MoveL p,v1,fine,tool0\\WObj:=w;"), &["'w'", "(frames gives"]);
    one(
        &format!(
            "{declare}MoveL p,v1,fine,tool0;PERS tooldata t:=[TRUE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];MoveL p,v1,fine,t;"
        ),
        &["tool 'tool0' in 'wobj0'", "tool 't'"],
    );
    one(
        &format!(
            "{declare}PERS tooldata t:=[FALSE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];MoveL p,v1,fine,t;"
        ),
        &["robhold"],
    );
    one(
        &format!(
            "{declare}PERS wobjdata w:=[TRUE,TRUE,\"\",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];MoveL p,v1,fine,tool0\\WObj:=w;"
        ),
        &["robhold"],
    );
    one("CONST robtarget p:=[[3500,50,320],[0,0.6,0.8,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];", &["out of reach"]);
    one("CONST robtarget p:=[[350,50,320],[0,0.6,0.9,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];", &["quaternion"]);
    one("CONST jointtarget p:=[[0,0,0,0,150,0],[9E9,9E9,9E9,9E9,9E9,9E9]];", &["limits"]);
}

#[test]
fn a_singular_target_is_listed_and_a_wrong_configuration_too() {
    let n = nominal(IRB);
    let real = real(&n);
    let text = b"CONST jointtarget j:=[[0,0,0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];";
    let (out, report) = run(text, Dialect::Rapid, &n, &real, &Frames::default());
    assert!(report.problems[0].what.contains("singular"), "{:?}", report.problems);
    assert_eq!(unmarked(&out), text);
    let text = format!("CONST robtarget p:={};", TARGET.replace("[0,0,0,0],[9", "[1,0,0,0],[9"));
    let (_, report) = run(text.as_bytes(), Dialect::Rapid, &n, &real, &Frames::default());
    assert!(report.problems[0].what.contains("[1,0,0,0]"), "{:?}", report.problems);
}

#[test]
fn what_is_too_far_off_for_a_correction_is_told_so_and_not_called_singular() {
    let n = nominal(IRB);
    let with = |motion: Motion, value: f64| {
        let mut model = n.clone();
        model.terms.push(Term { value, ..Term::new("off", "tool", Site::Tool(motion), Basis::CONSTANT) });
        let program = b"q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n10,20,-10,30,60,50\n";
        run(program, Dialect::Csv, &n, &model, &Frames::default()).1
    };
    for (motion, value, words) in [
        (Motion::About(Axis::Z), -90_f64.to_radians(), "0.0 mm and 90.0 deg off"),
        (Motion::Along(Axis::X), 0.06, "60.0 mm and 0.0 deg off"),
    ] {
        let problem = &with(motion, value).problems[0].what;
        assert!(
            problem.contains(words) && problem.contains("own_base leaves") && problem.contains("(tool, frames)"),
            "{problem}"
        );
    }
    // much, but a correction: joints turn by more than 3 deg for it
    let report = with(Motion::Along(Axis::X), 0.03);
    assert!(report.problems.is_empty() && (report.largest_move - 0.03).abs() < 1e-3, "{:?}", report.problems);
}

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
fn tools_behind_calls_that_are_too_deep_are_unknown_and_not_forgotten() {
    let n = nominal(KR6);
    let p = flange(&n, &[10.0, -80.0, 95.0, 20.0, 45.0, -10.0]);
    let [a, b, c] = angles_zyx(&p.rotation).map(|a| format!("{:.7}", a.to_degrees()));
    let [x, y, z] = mm(&p).map(|x| format!("{x:.5}"));
    let said = |levels: usize| {
        let routine = |k: usize| format!("DEF A{k}( )\nA{}( )\nEND\n", k + 1);
        let all: String = (1..levels).map(routine).collect();
        let text = format!(
            "DEF M( )\n$TOOL=$NULLFRAME\nA1( )\nEND\n{all}DEF A{levels}( )\nLIN {{X {x},Y {y},Z {z},A {a},B {b},C {c}}}\nEND\n"
        );
        let (_, report) = run(text.as_bytes(), Dialect::Krl, &n, &real(&n), &Frames::default());
        (report.rewritten, report.problems.iter().map(ToString::to_string).collect::<String>())
    };
    assert_eq!([10, 60].map(said), [(1, String::new()), (1, String::new())]);
    let (rewritten, listed) = said(150);
    assert!(rewritten == 0 && listed.contains("routines call each other, or too deep"), "{rewritten} {listed}");
}

#[test]
fn a_turn_is_read_and_written_in_its_own_form() {
    let n = nominal(KR6);
    // joint 4 comes to the other side of zero
    let q = [10.0, -80.0, 95.0, 0.0, 45.0, -10.0];
    let p = flange(&n, &q).compose(&device());
    let [a, b, c] = angles_zyx(&p.rotation).map(|a| format!("{:.9}", a.to_degrees()));
    let [x, y, z] = mm(&p).map(|x| format!("{x:.7}"));
    for (old, new) in [("42", "34"), ("'B101010'", "'B100010'"), ("'b0101010'", "'b0100010'"), ("'H2a'", "'H22'")] {
        let text = format!("PTP {{X {x},Y {y},Z {z},A {a},B {b},C {c},S 2,T {old}}}\n");
        let (out, report) = run(text.as_bytes(), Dialect::Krl, &n, &real(&n), &Frames::default());
        assert!(report.rows[0].joints[3] > 0.0, "{:?}", report.rows[0].joints);
        let out = String::from_utf8(out).unwrap();
        assert!(out.contains(&format!("T {new}}}")), "{out}");
    }
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
fn targets_that_no_motion_names_need_a_tool_where_there_are_several() {
    let tools = "PERS tooldata t:=[TRUE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\nCONST robtarget a:=TARGET;\nCONST robtarget b:=TARGET;\nCONST robtarget c:=TARGET;\nMoveL a,v1,fine,t;\n";
    assert!(problems(tools).is_empty());
    let several = format!("{tools}MoveL b,v1,fine,tool0;\n");
    // c is used by nothing
    assert!(problems(&several).is_empty());
    let found = problems(&format!("{several}pNext:=c;\n"));
    assert!(
        found.len() == 1 && found[0].contains("line 4 (c)") && found[0].contains("tool and frame say which"),
        "{found:?}"
    );
}

#[test]
fn points_of_the_work_object_that_they_define_stay_as_they_are_and_those_of_a_calculated_place_do_not() {
    let n = nominal(IRB);
    let target = "[[350,50,320],[0,0.6,0.8,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]";
    let text = format!(
        "PERS wobjdata w:=[FALSE,TRUE,\"\",[[5,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\nCONST robtarget a:={target};\nCONST robtarget b:={target};\n\
         CONST robtarget c:={target};\nw.uframe:=DefFrame(a,a,a);\nMoveL c,v1,fine,tool0\\WObj:=w;\nMoveL Above(b),v1,fine,tool0\\WObj:=w;\n"
    );
    let (_, report) = run(text.as_bytes(), Dialect::Rapid, &n, &real(&n), &Frames::default());
    assert_eq!(report.rows.iter().map(|r| r.line).collect::<Vec<_>>(), [3, 4], "{report:?}");
    assert_eq!(report.problems.iter().map(|p| p.line).collect::<Vec<_>>(), [5, 7], "{report:?}");
}

#[test]
fn a_target_by_another_name_is_relative_to_nothing() {
    let rapid = "CONST robtarget a:=[[350,50,320],[0,0.6,0.8,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n\
        PROC main()\nb:=a;\nMoveL b,v1,fine,tool0;\nGo a;\nENDPROC\nPROC Go(robtarget p)\nMoveL p,v1,fine,tool0;\nENDPROC\n";
    let script = "a=p[-0.4,-0.3,0.4,1,2,0.5]\nb=a\nmovel(b)\ndef go(c):\nmovel(c)\nend\ngo(a)\n";
    for (text, shift, lines, d, n) in [
        (
            rapid,
            "PROC Near()\nh:=CRobT();\nh2:=Offs(h,0,0,5);\nMoveL h2,v1,fine,tool0;\nc:=Offs(a,0,0,5);\nd:=c;\nMoveL d,v1,fine,tool0;\nGo2 a;\n\
             e:=a;\ne.trans.z:=e.trans.z+5;\nMoveL e,v1,fine,tool0;\nENDPROC\nPROC Go2(robtarget p)\nMoveL Offs(p,0,0,5),v1,fine,tool0;\n",
            &[16, 20, 23][..],
            Dialect::Rapid,
            nominal(IRB),
        ),
        (script, "e=pose_trans(a,p[0,0,0.01,0,0,0])\nf=e\nmovel(f)\n", &[10][..], Dialect::UrScript, nominal(UR5E)),
    ] {
        let asked = |text: &str| {
            let (_, report) = run(text.as_bytes(), d, &n, &real(&n), &Frames::default());
            assert!(report.problems.is_empty() && report.rewritten == 1, "{d:?}: {report:?}");
            report.relative.iter().map(|r| r.line).collect::<Vec<_>>()
        };
        assert_eq!((asked(text), asked(&format!("{text}{shift}"))), (vec![], lines.to_vec()), "{d:?}");
    }
}

#[test]
fn where_nothing_sets_a_tool_it_is_said_which_one_is_taken() {
    let (ur, irb) = (nominal(UR5E), nominal(IRB));
    let [script, with_tool] =
        ["", "set_tcp(p[0,0,0.1,0,0,0])\n"].map(|tool| format!("{tool}movel(p[-0.4,-0.3,0.4,1,2,0.5])\n"));
    let data = "CONST robtarget a:=[[350,50,320],[0,0.6,0.8,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n";
    for (text, d, n, is_told) in [
        (script.as_str(), Dialect::UrScript, &ur, true),
        (&with_tool, Dialect::UrScript, &ur, false),
        (data, Dialect::Rapid, &irb, true),
        (&format!("{data}MoveL a,v1,fine,tool0;\n"), Dialect::Rapid, &irb, false),
    ] {
        let (_, report) = run(text.as_bytes(), d, n, n, &Frames::default());
        let told = report
            .cautions
            .iter()
            .find(|c| c.contains("sets a tool or a base for 1 of 1 targets (the first in line 1)"));
        assert_eq!((told.is_some(), report.rewritten), (is_told, 1), "{text}: {report:?}");
    }
}

#[test]
fn data_that_other_statements_read_and_no_motion_goes_to_stay_as_they_are() {
    let text = "PERS tooldata t:=[TRUE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\nCONST robtarget a:=TARGET;\nCONST robtarget b:=TARGET;\n\
        CONST jointtarget jAway:=[[5,9E9,9E9,9E9,9E9,9E9],[9E9,9E9,9E9,9E9,9E9,9E9]];\nCONST jointtarget jNear:=[[2,2,2,2,2,2],[9E9,9E9,9E9,9E9,9E9,9E9]];\n\
        PROC main()\nWZLimJointDef\\Outside,sp,jAway,jAway;\nWZHomeJointDef\\Inside,sp,jNear,jNear;\nIF Distance(a.trans,b.trans)>5 Stop;\n";
    let text = text.replace("TARGET", "[[350,50,320],[0,0.6,0.8,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]");
    let n = nominal(IRB);
    let asked = |end: &str| run(format!("{text}{end}").as_bytes(), Dialect::Rapid, &n, &real(&n), &Frames::default());
    // as well where the file has no motion at all
    for (end, rewritten, left) in
        [("MoveL a,v1,fine,t;\n", 1, "3 targets stay as they are"), ("ENDPROC\n", 0, "4 targets stay as they are")]
    {
        let (out, report) = asked(end);
        assert!(report.problems.is_empty() && report.rewritten == rewritten, "{report:?}");
        let note = report.cautions.iter().find(|c| c.contains(left)).unwrap();
        assert!(note.contains("no motion in the files read goes to them") && note.contains("line 5 (jNear)"), "{note}");
        assert!(String::from_utf8_lossy(&out).contains(text.lines().nth(4).unwrap()));
    }
    let (_, report) = asked("w.oframe:=DefFrame(a,b,b);\nd:=DefDFrame(b,b,b,b,b,b);\nMoveL a,v1,fine,t;\n");
    let found: Vec<String> = report.problems.iter().map(ToString::to_string).collect();
    assert!(found.len() == 1 && found[0].contains("line 10: calculates a frame from targets"), "{found:?}");
}

#[test]
fn the_tool_of_an_instruction_that_nobody_has_read_can_be_said() {
    let n = nominal(IRB);
    let text = "PERS tooldata t:=[TRUE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\nCONST robtarget a:=TARGET;\n\
        CONST robtarget b:=TARGET;\nMoveL a,v1,fine,tool0;\nGlueL a,v1;\nGlueL b,v1\\WObj:=wobj0;\n";
    let text = text.replace("TARGET", "[[350,50,320],[0,0.6,0.8,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]");
    let with = |tool: Option<&str>| {
        let options = Options { tool: tool.map(Into::into), any_configuration: true, ..Options::default() };
        let run = compensate(
            Program::of_file(text.as_bytes(), "p", Dialect::Rapid, &mut Vec::new()),
            &n,
            &n,
            &Frames::default(),
            &options,
        );
        let report = run.unwrap();
        (report.problems.iter().map(ToString::to_string).collect::<Vec<_>>(), report.setups)
    };
    let (problems, _) = with(None);
    assert!(problems.len() == 2 && problems[1].contains("line 3 (b)"), "{problems:?}");
    let (problems, setups) = with(Some("t"));
    // another motion uses another tool
    assert!(problems.len() == 1 && problems[0].contains("line 2 (a): is used with"), "{problems:?}");
    assert_eq!(setups, [("tool 't' in 'wobj0'".to_owned(), 1)]);
}

#[test]
fn a_model_that_needs_a_temperature_asks_for_it() {
    let n = nominal(IRB);
    let options = Options::default();
    let e = compensate(
        Program::of_file(b"q1_deg\n1\n", "p", Dialect::Csv, &mut Vec::new()),
        &n,
        &real(&n),
        &Frames::default(),
        &options,
    );
    assert!(e.unwrap_err().to_string().contains("temp_c says"));
}

#[test]
fn a_program_runs_long_after_the_recording_unless_it_is_said_when() {
    let n = nominal(IRB);
    let moved = |shape: Shape, value: f64, seq: Option<f64>| {
        let mut model = n.clone();
        let basis = Basis::new(Variable::Seq, shape);
        model.terms.push(Term { value, ..Term::new("expansion", "thermal_growth", Site::Links, basis) });
        let options = Options { seq, ..Options::default() };
        let program = b"q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,0,0,0,30,0\n";
        let frames = Frames::default();
        compensate(Program::of_file(program, "p", Dialect::Csv, &mut Vec::new()), &n, &model, &frames, &options)
            .map(|report| report.largest_move)
            .map_err(|e| e.to_string())
    };
    let warm_up = Shape::WarmUp { constant: 100.0 };
    let [cold, half, warm] = [0.0, 69.3, 1e6].map(|seq| moved(warm_up, 2e-4, Some(seq)).unwrap());
    assert!(cold < 1e-9 && warm > 5e-5 && (half / warm - 0.5).abs() < 0.01, "{cold} {half} {warm}");
    assert!((moved(warm_up, 2e-4, None).unwrap() - warm).abs() < 1e-9);
    assert!(moved(Shape::Linear, 2e-7, None).unwrap_err().contains("seq says"));
    assert!(moved(Shape::Linear, 2e-7, Some(1000.0)).is_ok());
}

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

#[test]
fn loads_that_nobody_has_read_are_named_where_the_arm_sags() {
    let n = nominal(IRB);
    let of = |d: Dialect, text: &str, options: &Options| {
        let report = compensate(
            Program::of_file(text.as_bytes(), "p", d, &mut Vec::new()),
            &n,
            &real(&n),
            &Frames::default(),
            options,
        )
        .unwrap();
        report.cautions.into_iter().filter(|c| c.contains("carries") || c.contains("weighs")).collect::<Vec<_>>()
    };
    let rapid = |tool: &str, mass: f64, load: &str| {
        format!(
            "PERS tooldata tGrip:=[TRUE,[[0,0,80],[1,0,0,0]],[{mass},[0,0,40],[1,0,0,0],0,0,0]];\nMoveAbsJ \
             [[10,12,-8,20,40,-30],[9E9,9E9,9E9,9E9,9E9,9E9]]{load},v1,fine,{tool};\n"
        )
    };
    let lines = "GripLoad load0;\nGripLoad piece;\n";
    let said = of(Dialect::Rapid, &(lines.to_owned() + &rapid("tGrip", 1.0, "\\TLoad:=piece")), &options());
    assert!(said.len() == 1 && said[0].contains("(line 2, line 4)"), "{said:?}");
    let said = of(Dialect::Rapid, &rapid("tGrip", 0.001, "\\TLoad:=load0"), &options());
    assert!(said.len() == 1 && said[0].contains("what tool 'tgrip' weighs"), "{said:?}");
    for (tool, mass) in [("tGrip", 1.0), ("tool0", 0.001)] {
        assert_eq!(of(Dialect::Rapid, &rapid(tool, mass, ""), &options()), [""; 0]);
    }
    let stated = Options { payload_kg: Some(2.0), ..options() };
    assert_eq!(of(Dialect::Rapid, &(lines.to_owned() + &rapid("tGrip", 0.001, "")), &stated), [""; 0]);
    let ur = "def p():\n  set_payload(1.5)\n  set_tcp(p[0,0,0.1,0,0,0])\n  movej([0.1,0.2,-0.1,0.3,0.6,-0.4])\nend\n";
    let said = of(Dialect::UrScript, ur, &options());
    assert!(
        said.len() == 2
            && said[0].contains("(line 2)")
            && said[1].contains("what tool 'set_tcp(0.000, 0.000, 100.000 mm)' weighs")
            && said[1].contains("(payload_kg says it)"),
        "{said:?}"
    );
    let krl = "$TOOL={X 0,Y 0,Z 80,A 0,B 0,C 0}\n$LOAD.M=3\nPTP {A1 10,A2 12,A3 -8,A4 20,A5 40,A6 -30}\n";
    let said = of(Dialect::Krl, krl, &options());
    assert!(said.len() == 2 && said[0].contains("(line 2)") && said[1].contains("'$tool'"), "{said:?}");
    // an arm that does not sag
    let stiff = nominal(KR6);
    let report = compensate(
        Program::of_file(krl.replace("A2 12,A3 -8", "A2 -70,A3 85").as_bytes(), "p", Dialect::Krl, &mut Vec::new()),
        &stiff,
        &real(&stiff),
        &Frames::default(),
        &options(),
    )
    .unwrap();
    assert_eq!(report.cautions, [""; 0]);
    assert_eq!(report.setups[0].0, "tool '$tool in line 1' in the robot's base");
}

#[test]
fn a_table_in_other_units_and_with_angles_is_the_same_table() {
    let nominal = nominal(IRB);
    let real = real(&nominal);
    // 0.6 i + 0.8 j is half a turn about an axis in the plane: Rz(2 atan2(0.8, 0.6)) Rx(180 deg)
    let yaw = 2.0 * 0.8_f64.atan2(0.6);
    let text = b"x_mm,y_mm,z_mm,qw,qx,qy,qz\n350,50,320,0,0.6,0.8,0\n".to_vec();
    let others = [
        format!("yaw_deg,note,x_m,y_m,z_m,roll_deg,pitch_deg\n{:.10},a,0.35,0.05,0.32,180,0\n", yaw.to_degrees()),
        format!("X_M,Y_MM,z_mm,roll_rad,pitch_rad,yaw_rad\n0.35,50,320,{:.12},0,{yaw:.12}\n", std::f64::consts::PI),
    ];
    let (_, plain) = run(&text, Dialect::Csv, &nominal, &real, &Frames::default());
    for other in others {
        let (out, report) = run(other.as_bytes(), Dialect::Csv, &nominal, &real, &Frames::default());
        let (_, again) = run(&unmarked(&out), Dialect::Csv, &nominal, &nominal, &Frames::default());
        let apart = |a: &Report, b: &Report| {
            a.rows[0].joints.iter().zip(&b.rows[0].joints).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        assert!(report.after[1] < 1e-6 && apart(&report, &plain) < 1e-6, "{other}: {:?}", report.after);
        // as the controller reads it again
        assert!(apart(&again, &report) < 1e-6, "{}", String::from_utf8_lossy(&out));
    }
    let q = [10.0, 20.0, 10.0, 5.0, 60.0, -7.0];
    let row = |scale: f64| q.map(|x: f64| format!("{:.12}", x * scale)).join(",");
    let head = |unit: &str| (1..=6).map(|k| format!("q{k}_{unit}")).collect::<Vec<_>>().join(",");
    let [deg, rad] = [("deg", 1.0), ("rad", 1_f64.to_radians())].map(|(unit, scale)| {
        let text = format!("{}\n{}\n", head(unit), row(scale));
        let (_, report) = run(text.as_bytes(), Dialect::Csv, &nominal, &real, &Frames::default());
        (report.rows[0].joints, report.after[1])
    });
    assert!(deg.0.iter().zip(&rad.0).all(|(a, b)| (a - b).abs() < 1e-9) && rad.1 < 1e-6, "{deg:?} {rad:?}");
    let angles = refused(b"x,y,z,rx,ry,rz\n1,2,3,4,5,6\n", Dialect::Csv);
    assert!(
        angles.contains("found x,y,z,rx,ry,rz, expected x_mm,y_mm,z_mm") && angles.contains("roll_deg"),
        "{angles}"
    );
    let twice = refused(b"x_mm,y_mm,z_mm,qw,qx,qy,qz,roll_deg,pitch_deg,yaw_deg\n", Dialect::Csv);
    assert!(twice.contains("twice"), "{twice}");
    // in quotation marks, and with the names of the flange and of the robot's base that its user says nothing of
    let quoted = b"\"name, and place\",\"x_mm\", \"y_mm\",z_mm,qw,qx,qy,qz,tool,frame\n\"a, b\",\"350\",\"50\",320,0,0.6,0.8,0,TOOL0,wobj0\n";
    let (out, report) = run(quoted, Dialect::Csv, &nominal, &real, &Frames::default());
    assert_eq!(report.setups, [("tool 'tool0' in 'wobj0'".to_owned(), 1)], "{:?}", report.problems);
    assert!(String::from_utf8_lossy(&out).contains("\n\"a, b\",\"35"), "{}", String::from_utf8_lossy(&out));
    let own = Frames::parse("[tools.tool0]\nxyz_mm = [0, 0, 7]\n", "f.toml").unwrap();
    let (_, moved) = run(quoted, Dialect::Csv, &nominal, &real, &own);
    assert!((moved.rows[0].joints[1] - report.rows[0].joints[1]).abs() > 1e-3);
    // metres where the columns say millimetres, and the other way round; in a frame a place may be as near
    let small = "x_mm,y_mm,z_mm,qw,qx,qy,qz,frame\n0.35,0.05,0.32,0,0.6,0.8,0,\n";
    let metres = refused(small.as_bytes(), Dialect::Csv);
    assert!(
        metres.contains("larger than 0.350 mm") && metres.contains("are in m, the columns are x_m,y_m,z_m"),
        "{metres}"
    );
    let millimetres = refused(b"x_m,y_m,z_m,qw,qx,qy,qz\n350,50,320,0,0.6,0.8,0\n", Dialect::Csv);
    assert!(
        millimetres.contains("larger than 350000.000 mm") && millimetres.contains("x_mm,y_mm,z_mm"),
        "{millimetres}"
    );
    let table = Frames::parse("[frames.table]\nxyz_mm = [350, 50, 320]\n", "f.toml").unwrap();
    let on_table = small.replace("0,\n", "0,table\n");
    assert_eq!(run(on_table.as_bytes(), Dialect::Csv, &nominal, &real, &table).1.rewritten, 1);
    let by_tabs = refused(b"x_mm\ty_mm\tz_mm\n1\t2\t3\n", Dialect::Csv);
    assert!(by_tabs.contains("separated by tabs; expected commas"), "{by_tabs}");
    for (header, words) in
        [("x_mm,y_mm,z_mm,qw,qx,qy,qz,x_m,y_m,z_m\n", "x_mm and x_m"), ("q1_deg,q2_deg,q1_deg\n", "q1_deg and q1_deg")]
    {
        let same = refused(header.as_bytes(), Dialect::Csv);
        assert!(same.contains(words), "{same}");
    }
}
