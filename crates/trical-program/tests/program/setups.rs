//! Which tool and frame a target is meant with, and which targets stay as they are because nothing goes to them.

use trical_model::pose::angles_zyx;
use trical_program::{Dialect, Frames, Options, Program, compensate};

use crate::fixtures::{IRB, KR6, UR5E, flange, mm, nominal, real};
use crate::listed::problems;
use crate::run;

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
fn data_without_an_orientation_are_unused_only_where_nothing_uses_them() {
    let declared = |name| format!("PERS robtarget {name}:=[[0,0,0],[0,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n");
    let text = ["to", "copied", "given", "read", "set", "left"].map(declared).concat()
        + "PROC main()\nVAR robtarget q;\nMoveL to,v1,fine,tool0;\nq:=copied;\nMoveL q,v1,fine,tool0;\nGo given;\n\
           IF Distance(read.trans,q.trans)>5 Stop;\nset:=CRobT();\nMoveL set,v1,fine,tool0;\nENDPROC\n\
           PROC Go(robtarget g)\nMoveL g,v1,fine,tool0;\nENDPROC\n";
    let n = nominal(IRB);
    let (_, report) = run(text.as_bytes(), Dialect::Rapid, &n, &n, &Frames::default());
    assert_eq!(report.problems.len(), 3, "{:?}", report.problems);
    let told = |words: &str| report.cautions.iter().find(|c| c.contains(words)).unwrap();
    assert!(told("uses their numbers").ends_with(": line 5 (set), line 6 (left)"), "{:?}", report.cautions);
    assert!(told("other statements use it").ends_with(": line 4 (read)"), "{:?}", report.cautions);
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
fn what_a_routine_gets_for_its_tool_or_base_is_no_target_left_as_it_is() {
    let n = nominal(KR6);
    let text = "DEF A()\nDECL E6POS XP1={X 430,Y 0,Z 430,A 0,B 90,C 0}\nDECL POS T1={X 18,Y -12,Z 118,A 0,B 0,C 0}\n\
        DECL E6POS UNUSED={X 18,Y -12,Z 118,A 0,B 0,C 0}\nPICK(T1,XP1)\nN=SHOW(UNUSED)\nEND\n\
        DEF PICK(T:IN,P:IN)\nDECL FRAME T\nDECL E6POS P\n$TOOL=T\nLIN P\nEND\n";
    let (_, report) = run(text.as_bytes(), Dialect::Krl, &n, &real(&n), &Frames::default());
    let stay: Vec<&String> = report.cautions.iter().filter(|c| c.contains("stay")).collect();
    assert!(stay.len() == 1 && stay[0].contains("(UNUSED)") && !stay[0].contains("T1"), "{stay:?}");
    // with which tool XP1 is meant, nobody follows through the call
    assert!(report.problems.len() == 1 && report.problems[0].line == 2, "{:?}", report.problems);
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
