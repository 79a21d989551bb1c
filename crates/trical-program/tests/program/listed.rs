//! Targets that are listed instead of rewritten, and why.

use trical_model::{Axis, Basis, Motion, Site, Term};
use trical_program::{Dialect, Frames, Options, Program, compensate};

use crate::fixtures::{IRB, KR6, UR5E, nominal, real};
use crate::{options, run, unmarked};

const TARGET: &str = "[[350,50,320],[0,0.6,0.8,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]";

pub fn problems(body: &str) -> Vec<String> {
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

fn of_krl(text: &str) -> Vec<String> {
    let n = nominal(KR6);
    let (_, report) = run(text.as_bytes(), Dialect::Krl, &n, &real(&n), &Frames::default());
    report.problems.iter().map(ToString::to_string).collect()
}

#[test]
fn single_angles_of_a_target_are_listed_near_ninety_degrees_about_y_only() {
    let text = |b: &str| {
        format!(
            "DEF A()\nDECL POS B\nDECL POS P={{X 430,Y 0,Z 430,A 0,B {b},C 0}}\nLIN P\nB=P\nIF P.A>3 THEN\nENDIF\nB.B=B.B-15\nLIN B\nEND\n"
        )
    };
    let found = of_krl(&text("88"));
    assert!(
        found.len() == 1 && found[0].contains("line 3 (P): its angles A and C change together near B"),
        "{found:?}"
    );
    assert!(found[0].ends_with("one of its angles is read or set by itself in line 6"), "{found:?}");
    assert!(of_krl(&text("75")).is_empty());
}

#[test]
fn what_says_how_far_a_motion_goes_is_listed_only_if_another_goes_there() {
    let text = |end: &str| format!("DEF A()\nDECL POS P={{X 430,Y 0,Z 430,A 0,B 60,C 0}}\nLIN P\n{end}END\n");
    for (end, line) in [("LIN_REL P\n", 4), ("LIN P:P\n", 4)] {
        let found = of_krl(&text(end));
        assert!(found.len() == 1 && found[0].contains("line 2 (P): is used in two ways"), "{found:?}");
        assert!(found[0].contains(&format!("a frame in line {line}, ")), "{found:?}");
    }
    let apart = "DECL POS D={X 0,Y 0,Z 10,A 0,B 0,C 0}\nLIN_REL D\nLIN P:D\n";
    assert!(of_krl(&text(apart)).is_empty());
}

#[test]
fn what_no_file_has_and_is_given_a_place_is_listed_unless_it_reads_or_moves_nothing() {
    let place = "{X 430,Y 0,Z 430,A 0,B 60,C 0}";
    let text = |call: &str| {
        format!(
            "DEF A()\nDECL POS P={place}\nDECL POS Q={place}\nDECL POS E\nDECL FRAME F={place}\nLIN Q\n{}\nEND\n",
            call.replace("PLACE", place)
        )
    };
    for (call, line) in [("FAR(P,3)", 2), ("FAR(3,PLACE)", 7), ("E=P\nFAR(E)", 2)] {
        let found = of_krl(&text(call));
        assert!(
            found.len() == 1 && found[0].contains(&format!("line {line}")) && found[0].contains("is given to 'far'"),
            "{call}: {found:?}"
        );
    }
    for call in
        ["FAR(E)", "FAR(F)", "FAR(3)", "FAR({TOOL_NO 1})", "EKI_SETFRAME(\"a\",P)", "CWRITE(1,P)", "N=DIST(P,P)"]
    {
        assert!(of_krl(&text(call)).is_empty(), "{call}: {:?}", of_krl(&text(call)));
    }
}

#[test]
fn a_place_behind_an_argument_that_is_too_long_to_be_read_is_listed() {
    let place = "p[0.35,0.05,0.32,1.885,2.513,0]";
    let of = |count: usize| {
        let list = vec![place; count].join(", ");
        let text = format!(
            "def prog():\ndef go(path, where):\nmovel(where)\nend\nmovej([0.1,0.2,0.2,0.1,0.5,0.3])\ngo([{list}], {place})\ngo([1,2], {place})\nend\n"
        );
        let n = nominal(UR5E);
        let mut out = Vec::new();
        let program = Program::of_file(text.as_bytes(), "p", Dialect::UrScript, &mut out);
        let report = compensate(program, &n, &n, &Frames::default(), &options()).unwrap();
        (report.rewritten, report.problems.iter().map(ToString::to_string).collect::<Vec<_>>())
    };
    assert_eq!(of(3), (3, Vec::new()));
    let (rewritten, problems) = of(40);
    assert!(rewritten == 2 && problems.len() == 1 && problems[0].contains("line 6"), "{rewritten} {problems:?}");
}

#[test]
fn targets_in_structures_are_listed_as_such() {
    let found = of_krl("DEF A()\nS={PICK {X 430,Y 0,Z 430,A 0,B 60,C 0},NR 1}\nLIN S.PICK\nEND\n");
    assert!(found.iter().any(|f| f.contains("line 2: holds a target in a structure (STRUC)")), "{found:?}");
}

#[test]
fn components_of_records_are_no_calls_and_have_one_tool() {
    let declare = "RECORD speeds\nspeeddata fast;\nENDRECORD\nRECORD station\nspeeds sp;\nrobtarget pick;\nENDRECORD\n\
        PERS station st{2}:=[[[v9],TARGET],[[v9],TARGET]];\nPERS tooldata t:=[TRUE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n";
    let go = "PROC Go(station s,robtarget p)\nMoveL s.pick,v1,fine,tool0;\nMoveL p,v1,fine,tool0;\nENDPROC\n";
    let found = |body: &str| problems(&format!("{declare}PROC main()\n{body}\nENDPROC\n{go}"));
    assert!(found("MoveL st{2}.pick,v1,fine,tool0;\nGo st{1},st{2}.pick;").is_empty());
    let two = found("MoveL st{1}.pick,v1,fine,t;\nGo st{1},st{2}.pick;");
    assert!(two.len() == 2 && two.iter().all(|p| p.contains("line 8 (st): is used with")), "{two:?}");
}

#[test]
fn a_program_of_motions_to_no_target_with_numbers_is_not_told_to_have_no_motions() {
    let n = nominal(IRB);
    let of = |text: &str| {
        let mut out = Vec::new();
        let program = Program::of_file(text.as_bytes(), "p", Dialect::Rapid, &mut out);
        compensate(program, &n, &n, &Frames::default(), &options()).unwrap_err().to_string()
    };
    assert!(of("MoveL Offs(CRobT(),0,0,9),v1,fine,tool0;").contains("found motions, and none to a target"));
    assert!(of("TPWrite \"a\";").contains("no targets found"));
}
