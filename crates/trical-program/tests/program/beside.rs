//! Programs whose routines, tools and data stand in other files of the controller.

use std::path::{Path, PathBuf};

use trical_program::{Job, Options, Report};

use crate::fixtures::{IRB, KR6, nominal, real};

const TARGET: &str = "[[350,50,320],[0,0.6,0.8,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]";

/// Writes files into a folder of its own, and checks the first of them.
fn checked(folder: &str, robot: &str, files: &[(&str, &str)]) -> Report {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(folder);
    let _ = std::fs::remove_dir_all(&folder);
    for (name, text) in files {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text.replace("TARGET", TARGET)).unwrap();
    }
    let program = folder.join(files[0].0);
    let job = Job { program: &program, out: None, dialect: None, frames: &[], partial: false };
    let nominal = nominal(robot);
    let options = Options {
        temp_c: Some(32.0),
        details: true,
        any_configuration: true,
        model_name: "m.toml".into(),
        ..Options::default()
    };
    job.run(&nominal, &real(&nominal), &options).unwrap()
}

fn names(files: &[String]) -> Vec<String> {
    files.iter().map(|f| Path::new(f).file_name().unwrap().to_string_lossy().into_owned()).collect()
}

#[test]
fn of_a_routine_with_more_calls_than_are_told_apart_no_call_is_forgotten() {
    let text = |calls: usize| {
        format!(
            "PERS tooldata t:=[TRUE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\nCONST robtarget p:=TARGET;\n\
             CONST robtarget q:=TARGET;\nPROC main()\nGo p,t;\n{}ENDPROC\n\
             PROC Go(robtarget to,PERS tooldata held)\nMoveL to,v1,fine,held;\nENDPROC\n",
            "Go q,tool0;\n".repeat(calls)
        )
    };
    let few = checked("few_calls", IRB, &[("m.mod", &text(900))]);
    assert_eq!((few.rewritten, few.problems.len()), (2, 0), "{few:?}");
    let (rewritten, _, problems) = told(&checked("many_calls", IRB, &[("m.mod", &text(1500))]));
    assert!(rewritten.is_empty() && problems.iter().all(|p| p.contains("'held of go' is an argument")), "{problems:?}");
    assert_eq!(problems.len(), 2);
}

#[test]
fn a_program_that_is_too_large_is_refused_before_it_is_read() {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("large.csv");
    // nothing of it is on the disk
    std::fs::File::create(&path).unwrap().set_len(1 << 40).unwrap();
    let job = Job { program: &path, out: None, dialect: None, frames: &[], partial: false };
    let n = nominal(IRB);
    let refused = job.run(&n, &n, &Options::default()).unwrap_err().to_string();
    std::fs::remove_file(&path).unwrap();
    assert!(
        refused.ends_with("large.csv: the program has more than 1 GiB, expected at most that; divide it"),
        "{refused}"
    );
}

#[test]
fn a_folder_is_no_program() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("folder.mod");
    std::fs::create_dir_all(&folder).unwrap();
    let nominal = nominal(IRB);
    for dialect in [None, Some("rapid")] {
        let job = Job { program: &folder, out: None, dialect, frames: &[], partial: false };
        let told = job.run(&nominal, &nominal, &Options::default()).unwrap_err().to_string();
        assert!(told.ends_with("folder.mod: is a folder; expected a program"), "{told}");
    }
}

#[test]
fn the_data_of_a_program_are_found_however_their_file_is_written() {
    let data = "DEFDAT P\nDECL E6AXIS XP1={A1 5,A2 -80,A3 95.5,A4 3,A5 40,A6 -7}\nENDDAT\n";
    let report = checked("case", KR6, &[("p.src", "DEF P( )\nPTP XP1\nEND\n"), ("P.DAT", data)]);
    assert_eq!((report.rewritten, names(&report.read_with)), (1, vec!["P.DAT".to_owned()]), "{report:?}");
}

#[test]
fn global_points_have_the_tool_and_base_with_which_files_beside_go_there() {
    let point = |name: &str| format!("DECL GLOBAL E6POS {name}={{X 130,Y 120,Z 280,A -100,B 80,C 90}}\n");
    let points = format!("DEFDAT POINTS PUBLIC\n{}{}{}ENDDAT\n", point("XG1"), point("XG2"), point("XG3"));
    let main = "DEF A( )\nDECL E6POS XNOW\nBAS(#TOOL,2)\nBAS(#BASE,1)\nXNOW=XG2\nPTP XG1\nLIN XNOW\nEND\n";
    let config = "TOOL_DATA[2]={X 0,Y 0,Z 10,A 0,B 0,C 0}\nBASE_DATA[1]={X 0,Y 5,Z 0,A 0,B 0,C 0}\n";
    let report = checked("global_points", KR6, &[("points.dat", &points), ("a.src", main), ("$config.dat", config)]);
    assert_eq!(names(&report.read_with), ["$config.dat", "a.src"], "{report:?}");
    // to the last point nothing in the file goes that is read; the tool and base of the others are taken
    assert_eq!((report.problems.len(), &report.setups), (0, &vec![("tool '2' in '1'".to_owned(), 3)]), "{report:?}");
    let sets = "DEF C( )\nXG2.X=SEEN()\nIF XG1.X==3 THEN\nENDIF\nEND\n";
    let files = [("points.dat", points.as_str()), ("a.src", main), ("c.src", sets), ("$config.dat", config)];
    let problems = told(&checked("global_points_set", KR6, &files)).2;
    assert!(
        problems.len() == 1 && problems[0].contains("line 3: 'XG2' gets other coordinates in c.src"),
        "{problems:?}"
    );
    let other = "DEF B( )\nBAS(#TOOL,0)\nBAS(#BASE,1)\nPTP XG1\nEND\n";
    let files = [("points.dat", points.as_str()), ("a.src", main), ("b.src", other), ("$config.dat", config)];
    let report = checked("global_points_twice", KR6, &files);
    assert!(report.problems[0].to_string().contains("line 2 (XG1): is used with"), "{report:?}");
}

#[test]
fn tools_of_frames_files_are_known_among_the_arguments_of_instructions_that_nobody_has_read() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("glue");
    std::fs::create_dir_all(&folder).unwrap();
    let text = "MODULE M\nCONST robtarget p:=TARGET;\nPROC main()\nMoveJ [[300,0,400],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1,fine,tool0;\n\
        GlueL p,v100,tGun\\WObj:=wPart;\nENDPROC\nENDMODULE\n";
    let (program, frames) = (folder.join("m.mod"), folder.join("frames.toml"));
    std::fs::write(&program, text.replace("TARGET", TARGET)).unwrap();
    std::fs::write(&frames, "[tools.tGun]\nxyz_mm=[0,0,80]\n[frames.wPart]\nxyz_mm=[5,0,0]\n").unwrap();
    let job = Job { program: &program, out: None, dialect: None, frames: &[frames], partial: false };
    let nominal = nominal(IRB);
    let options = Options { temp_c: Some(32.0), any_configuration: true, ..Options::default() };
    let report = job.run(&nominal, &real(&nominal), &options).unwrap();
    assert!(report.problems.is_empty(), "{report:?}");
    assert!(report.setups.contains(&("tool 'tgun' in 'wpart'".to_owned(), 1)), "{report:?}");
}

#[test]
fn modules_of_the_same_task_say_what_their_routines_do_and_have_its_tools() {
    let main = "MODULE Main\nPERS robtarget p:=TARGET;\nPERS robtarget q:=TARGET;\nPROC main()\nMoveL p,v1,fine,tGrip\\WObj:=wTable;\nBlow;\nFind 3;\n\
        Shift;\nMoveL q,v1,fine,tGrip\\WObj:=wTable;\nMoveL p,v1,fine,tTwo\\WObj:=wTable;\nNobodyHas 1;\nENDPROC\nENDMODULE\n";
    let data = "MODULE Data\nPERS tooldata tGrip:=[TRUE,[[0,0,80],[1,0,0,0]],[1,[0,0,40],[1,0,0,0],0,0,0]];\n\
        PERS tooldata tTwo:=[TRUE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\nENDMODULE\n";
    let system = "MODULE System(SYSMODULE)\nPERS wobjdata wTable:=[FALSE,TRUE,\"\",[[5,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n\
        PERS tooldata tTwo:=[TRUE,[[0,0,8],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\nPROC Blow()\nSetDO x,1;\nENDPROC\nENDMODULE\n";
    let more = "MODULE More\nLOCAL PERS robtarget p:=TARGET;\nPROC Find(num n)\np:=CRobT();\nDeeper;\nENDPROC\nPROC Deeper()\nq.trans.z:=n;\nENDPROC\n\
        PROC Shift()\nPDispSet frame;\nENDPROC\nPROC Never()\np.trans.x:=1;\nENDPROC\nENDMODULE\n";
    let earlier = "! compensated by TriCal 0.1\nMODULE Old\nPROC NobodyHas(num n)\nENDPROC\nENDMODULE\n";
    let report = checked(
        "modules",
        IRB,
        &[
            ("TASK1/PROGMOD/Main.mod", main),
            ("TASK1/PROGMOD/Data.mod", data),
            ("TASK1/PROGMOD/More.mod", more),
            ("TASK1/PROGMOD/Main.new.mod", earlier),
            ("TASK1/SYSMOD/System.sys", system),
            ("TASK2/PROGMOD/Other.mod", "MODULE Other\nPROC NobodyHas(num n)\nENDPROC\nENDMODULE\n"),
        ],
    );
    let problems: Vec<String> = report.problems.iter().map(ToString::to_string).collect();
    assert_eq!(problems.len(), 3, "{problems:?}");
    // p is used with two tools, of which one has two meanings; q is set by a routine that a routine calls
    assert!(problems[0].contains("line 2") && problems[0].contains("used with"), "{problems:?}");
    assert!(problems[1].contains("line 7") && problems[1].contains("calculated here"), "{problems:?}");
    assert!(problems[2].contains("line 8: calls 'Shift', which displaces"), "{problems:?}");
    assert_eq!(report.rows.iter().map(|r| r.line).collect::<Vec<_>>(), [3]);
    assert!(report.cautions.iter().any(|c| c.contains("nobodyhas (line 11)") && !c.contains("blow")), "{report:?}");
    assert_eq!(names(&report.read_with), ["Data.mod", "More.mod", "System.sys"]);
}

#[test]
fn a_tool_with_two_meanings_beside_the_program_is_refused() {
    let declares = |z: u32| {
        format!(
            "MODULE M{z}\nPERS tooldata tGrip:=[TRUE,[[0,0,{z}],[1,0,0,0]],[1,[0,0,40],[1,0,0,0],0,0,0]];\nENDMODULE\n"
        )
    };
    let main = "MODULE Main\nPROC main()\nMoveL TARGET,v1,fine,tGrip;\nENDPROC\nENDMODULE\n";
    let report = checked("two", IRB, &[("a.mod", main), ("b.mod", &declares(80)), ("c.mod", &declares(81))]);
    assert!(report.problems[0].what.contains("different numbers in the modules beside the program"), "{report:?}");
    let report = checked("one", IRB, &[("a.mod", main), ("b.mod", &declares(80)), ("c.mod", &declares(80))]);
    assert_eq!((report.rewritten, report.problems.len()), (1, 0), "{report:?}");
}

#[test]
fn a_module_that_is_too_large_to_be_read_is_named() {
    let main = "MODULE Main\nPROC main()\nMoveL TARGET,v1,fine,tGrip;\nENDPROC\nENDMODULE\n";
    let tool = "PERS tooldata tGrip:=[TRUE,[[0,0,80],[1,0,0,0]],[1,[0,0,40],[1,0,0,0],0,0,0]];\n";
    let large = format!("MODULE Large\n{tool}{}ENDMODULE\n", "!\n".repeat(9 << 20));
    let report = checked("large", IRB, &[("main.mod", main), ("Large.mod", &large)]);
    assert!(report.problems[0].what.contains("tool 'tgrip' is not declared"), "{report:?}");
    let said = report.cautions.iter().find(|c| c.starts_with("not read beside the program")).unwrap();
    assert!(said.contains("16 MiB") && said.contains(": Large.mod; their tools"), "{said}");
    let small = format!("MODULE Small\n{tool}ENDMODULE\n");
    let report = checked("small", IRB, &[("main.mod", main), ("Small.mod", &small)]);
    assert!(report.rewritten == 1 && !report.cautions.iter().any(|c| c.starts_with("not read")), "{report:?}");
}

/// A module of targets and tools, with what else stands in it.
fn targets(more: &str) -> String {
    format!(
        "MODULE Targets\nPERS tooldata tDev:=[TRUE,[[0,0,80],[1,0,0,0]],[1,[0,0,40],[1,0,0,0],0,0,0]];\n\
        PERS tooldata tGrip:=[TRUE,[[0,0,90],[1,0,0,0]],[1,[0,0,40],[1,0,0,0],0,0,0]];\nCONST robtarget p:=TARGET;\n\
        CONST robtarget q:=TARGET;\nLOCAL CONST robtarget r:=TARGET;\n{more}ENDMODULE\n"
    )
}

/// Lines of targets that are rewritten, their setups, and problems.
fn told(report: &Report) -> (Vec<usize>, Vec<String>, Vec<String>) {
    let setups = report.setups.iter().map(|(words, _)| words.clone()).collect();
    (report.rows.iter().map(|r| r.line).collect(), setups, report.problems.iter().map(ToString::to_string).collect())
}

#[test]
fn motions_of_other_modules_say_with_what_targets_are_meant() {
    let main = "MODULE Main\nLOCAL CONST robtarget q:=TARGET;\nPROC main()\nMoveL p,v1,fine,tGrip;\nMoveL q,v1,fine,tDev;\nMoveL r,v1,fine,tDev;\n\
        ENDPROC\nENDMODULE\n";
    // r is LOCAL there, q here
    let report = checked("moved_elsewhere", IRB, &[("Targets.mod", &targets("")), ("Main.mod", main)]);
    let (rewritten, setups, problems) = told(&report);
    assert_eq!((rewritten, problems.len()), (vec![4, 5, 6], 0), "{report:?}");
    assert!(setups.iter().all(|s| s.contains("tgrip")), "{setups:?}");
    assert_eq!(names(&report.read_with), ["Main.mod"]);
    // another tool here and there
    let own = "PROC own()\nMoveL p,v1,fine,tDev;\nENDPROC\n";
    let report = checked("moved_otherwise", IRB, &[("Targets.mod", &targets(own)), ("Main.mod", main)]);
    assert!(report.problems[0].to_string().contains("line 4 (p): is used with"), "{report:?}");
}

#[test]
fn routines_of_other_modules_say_with_what_the_targets_that_they_get_are_meant() {
    let own = "PROC own()\nMoveL p,v1,fine,tDev;\nPick 5,q;\nMoveSafe Offs(r,0,0,5),100;\nPick 3,pNowhere;\nPick 3,Seen(2);\nENDPROC\n";
    let library = "MODULE Library\nLOCAL PERS tooldata tDev:=[TRUE,[[0,0,70],[1,0,0,0]],[1,[0,0,40],[1,0,0,0],0,0,0]];\n\
        VAR robtarget p;\nPROC Pick(num n,robtarget to)\np:=Offs(to,0,0,n);\nMoveL p,v1,fine,tGrip;\nENDPROC\nPROC MoveSafe(robtarget to,num n)\n\
        Deeper\\at:=to;\nENDPROC\nENDMODULE\n";
    let more = "MODULE More\nPROC Deeper(\\robtarget at)\nMoveL at,v1,fine,tGrip;\nENDPROC\nENDMODULE\n";
    let report = checked(
        "given_elsewhere",
        IRB,
        &[("Targets.mod", &targets(own)), ("Library.mod", library), ("More.mod", more)],
    );
    let (rewritten, setups, problems) = told(&report);
    assert_eq!((rewritten, problems.len()), (vec![4, 5, 6], 2), "{report:?}");
    assert!(setups.len() == 2 && setups[0].contains("tdev") && setups[1].contains("tgrip"), "{setups:?}");
    assert!(problems[0].contains("line 11") && problems[0].contains("'pNowhere'"), "{problems:?}");
    assert!(problems[1].contains("line 12") && problems[1].contains("calculates"), "{problems:?}");
    // the tool of the same name there is another one
    let library = library.replace("fine,tGrip", "fine,tDev");
    let report =
        checked("other_tool", IRB, &[("Targets.mod", &targets(own)), ("Library.mod", &library), ("More.mod", more)]);
    assert!(report.setups.iter().any(|(words, _)| words.contains("'tdev of library.mod'")), "{report:?}");
}

#[test]
fn a_routine_of_another_module_is_no_instruction_of_the_same_name() {
    let own = "PROC own()\nMoveL p,v1,fine,tDev;\nMoveL1 q;\nMoveJGo r,5;\nENDPROC\n";
    let library = "MODULE Library\nPROC MoveL1(robtarget to)\nMoveL to,v1,fine,tGrip;\nENDPROC\nPROC MoveJGo(robtarget to,num n)\n\
        MoveJ to,v1,fine,tGrip;\nENDPROC\nENDMODULE\n";
    let report = checked("named_alike", IRB, &[("Targets.mod", &targets(own)), ("Library.mod", library)]);
    assert_eq!((report.rewritten, report.problems.len()), (3, 0), "{report:?}");
    let setups: Vec<(bool, usize)> = report.setups.iter().map(|(words, n)| (words.contains("tgrip"), *n)).collect();
    assert_eq!(setups, [(false, 1), (true, 2)], "{report:?}");
}

#[test]
fn other_modules_give_targets_to_routines_of_this_one_and_to_those_of_none() {
    let own = "PROC Go(robtarget to)\nMoveL to,v1,fine,tGrip;\nENDPROC\nPROC own()\nMoveL r,v1,fine,tDev;\nENDPROC\n";
    let main = |with: &str| format!("MODULE Main\nPROC main()\nGo p;\nGlueL q,v1,bead{with};\nENDPROC\nENDMODULE\n");
    let report = checked("given_here", IRB, &[("Targets.mod", &targets(own)), ("Main.mod", &main(",tDev"))]);
    let (rewritten, setups, problems) = told(&report);
    assert_eq!((rewritten, problems.len()), (vec![4, 5, 6], 0), "{report:?}");
    assert!(setups.iter().any(|s| s.contains("tgrip")), "{setups:?}");
    let (rewritten, _, problems) =
        told(&checked("given_nowhere", IRB, &[("Targets.mod", &targets(own)), ("Main.mod", &main(""))]));
    assert_eq!(rewritten, [4, 6], "{problems:?}");
    assert!(problems.len() == 1 && problems[0].contains("line 5") && problems[0].contains("'gluel'"), "{problems:?}");
}

#[test]
fn what_other_modules_change_before_they_call_a_routine_of_this_one_is_listed() {
    let program = "MODULE Paths\nPERS tooldata tDev:=[TRUE,[[0,0,80],[1,0,0,0]],[1,[0,0,40],[1,0,0,0],0,0,0]];\n\
        PERS wobjdata wPart:=[FALSE,TRUE,\"\",[[5,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\nPERS robtarget p:=TARGET;\n\
        PROC path10()\nMoveL p,v1,fine,tDev\\WObj:=wPart;\nENDPROC\nENDMODULE\n";
    let cell = "MODULE Cell\nPROC Frame(INOUT wobjdata w)\nw.oframe.trans.x:=cam;\nENDPROC\nPROC Other()\np.trans.x:=cam;\nENDPROC\n\
        PROC path11()\nENDPROC\nENDMODULE\n";
    let of = |folder: &str, before: &str| {
        let main =
            format!("MODULE Main\nPROC main()\n{before}\nTurn;\nENDPROC\nPROC Turn()\npath10;\nENDPROC\nENDMODULE\n");
        let files = [("Paths.mod", program), ("Main.mod", &main), ("Cell.mod", cell)];
        told(&checked(folder, IRB, &files)).2
    };
    assert_eq!(of("around", "SetDO x,1;"), [""; 0]);
    for (folder, before, words) in [
        (
            "around_target",
            "p.trans.x:=cam;",
            "line 5: is called from a module beside the program that changes a target",
        ),
        ("around_routine", "Other;", "line 5: is called from a module beside the program that changes a target"),
        ("around_frame", "wPart.oframe.trans.x:=cam;", "line 5: the work object 'wpart' is changed by a module"),
        ("around_lent", "Frame wPart;", "line 5: the work object 'wpart' is changed by a module"),
        (
            "around_by_name",
            "SetDataVal name,v;",
            "line 5: is called from a module beside the program that sets data whose",
        ),
        ("around_displaced", "PDispSet shift;", "line 5: is called from a module beside the program that displaces"),
    ] {
        let problems = of(folder, before);
        assert!(problems.len() == 1 && problems[0].contains(words), "{before}: {problems:?}");
    }
    // another program of the same folder has a routine of that name itself
    let main = "MODULE Main\nPROC main()\np.trans.x:=cam;\npath10;\nENDPROC\nPROC path10()\nENDPROC\nENDMODULE\n";
    assert_eq!(told(&checked("around_itself", IRB, &[("Paths.mod", program), ("Main.mod", main)])).2, [""; 0]);
}

#[test]
fn a_work_object_that_a_routine_of_another_module_changes_is_listed() {
    let program = "MODULE Main\nPERS tooldata tDev:=[TRUE,[[0,0,80],[1,0,0,0]],[1,[0,0,40],[1,0,0,0],0,0,0]];\n\
        PERS wobjdata wPart:=[FALSE,TRUE,\"\",[[5,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\nPERS robtarget p:=TARGET;\n\
        PROC main()\nMeasure 1,wPart;\nMoveL p,v1,fine,tDev\\WObj:=wPart;\nENDPROC\nENDMODULE\n";
    let one = "MODULE One\nPROC Measure(num n,INOUT wobjdata w)\nDeeper w;\nENDPROC\nENDMODULE\n";
    let other = "MODULE Other\nPROC Deeper(INOUT wobjdata w)\nw.oframe.trans.x:=cam;\nENDPROC\nENDMODULE\n";
    let problems = told(&checked("lent", IRB, &[("Main.mod", program), ("One.mod", one), ("Other.mod", other)])).2;
    assert!(problems.len() == 1 && problems[0].contains("line 6: the work object 'wpart' is changed"), "{problems:?}");
    // what it is called, only the running program knows
    let by_name = other.replace("w.oframe.trans.x:=cam;", "SetDataVal name,v;");
    let problems =
        told(&checked("by_name", IRB, &[("Main.mod", program), ("One.mod", one), ("Other.mod", &by_name)])).2;
    assert!(problems.len() == 1 && problems[0].contains("line 6: calls 'Measure', which sets data"), "{problems:?}");
    // a copy is changed
    let copy = other.replace("INOUT ", "");
    let problems = told(&checked("lent_copy", IRB, &[("Main.mod", program), ("One.mod", one), ("Other.mod", &copy)])).2;
    assert!(problems.is_empty(), "{problems:?}");
}

#[test]
fn global_routines_are_found_in_files_of_other_names() {
    let program = "DEF main()\nTOOL_DATA[2]={X 0,Y 0,Z 80,A 0,B 0,C 0}\nGRIP(1)\nPTP {A1 10,A2 -70,A3 85,A4 5,A5 60,A6 -7}\n\
        HIDDEN()\nEND\n";
    let tools =
        "&ACCESS RVP\nDEF tools()\nEND\nGLOBAL DEF grip(n:IN)\nBAS(#TOOL,2)\nEND\nDEF hidden()\nBAS(#TOOL,1)\nEND\n";
    let report = checked("global", KR6, &[("R1/Program/main.src", program), ("R1/System/tools.src", tools)]);
    assert_eq!((report.rewritten, report.problems.len()), (1, 0), "{report:?}");
    assert!(report.setups[0].0.contains("tool '2'"), "{report:?}");
    assert_eq!(names(&report.read_with), ["tools.src"]);
    assert!(report.cautions.iter().any(|c| c.contains("hidden (line 5)") && !c.contains("grip")), "{report:?}");
}

#[test]
fn a_global_target_that_a_routine_of_another_file_may_set_is_listed() {
    let pose = "{X 430,Y 0,Z 430,A 0,B 90,C 0}";
    let program = format!(
        "DEF main()\nGLOBAL DECL E6POS gSeen\nDECL E6POS own\n$TOOL={{X 0,Y 0,Z 80,A 0,B 0,C 0}}\n$BASE=$NULLFRAME\ngSeen={pose}\nown={pose}\n\
        LOOK()\nLIN own\nLIN gSeen\nEND\n"
    );
    let known = "DEF look()\nDECL E6POS own\nown=$POS_ACT\nDEEPER()\nEND\nDEF other()\nEND\n";
    let deeper = "DEF deeper()\ngSeen.Z = 300\nEND\n";
    let quiet = "DEF deeper()\n;gSeen.Z = 300\nIF gSeen.Z == 300 THEN\n$OUT[1]=TRUE\nENDIF\nEND\n";
    let of = |folder: &str, files: &[(&str, &str)]| {
        let all: Vec<(&str, &str)> =
            std::iter::once(("main.src", program.as_str())).chain(files.iter().copied()).collect();
        let report = checked(folder, KR6, &all);
        (report.rewritten, report.problems.iter().map(ToString::to_string).collect::<Vec<_>>())
    };
    let (rewritten, problems) = of("sets", &[("look.src", known), ("deeper.src", deeper)]);
    assert_eq!((rewritten, problems.len()), (2, 1), "{problems:?}");
    assert!(problems[0].contains("line 8: a place to which the arm moves is calculated here"), "{problems:?}");
    let (rewritten, problems) = of("sets_nothing", &[("look.src", known), ("deeper.src", quiet)]);
    assert_eq!((rewritten, problems.len()), (2, 0), "{problems:?}");
    let (rewritten, problems) = of("sets_perhaps", &[]);
    assert_eq!((rewritten, problems.len()), (2, 1), "{problems:?}");
    assert!(problems[0].contains("line 8: calls a routine that is in none of the files read"), "{problems:?}");
    let sensor = "DEF look()\nRET = RSI_ON(#RELATIVE)\nEND\n";
    let (_, problems) = of("sensor", &[("look.src", sensor)]);
    assert!(problems.len() == 1 && problems[0].contains("line 8") && problems[0].contains("RSI"), "{problems:?}");
}

#[test]
fn tools_of_the_controller_that_are_products_are_multiplied() {
    let pose = "{X 350,Y 0,Z 600,A 0,B 90,C 0}";
    let text = |tool: &str| format!("DEF P()\nBAS(#TOOL,{tool})\nBAS(#BASE,0)\nLIN {pose}\nEND\n");
    let config = "DEFDAT $CONFIG\nTOOL_DATA[4]=TOOL_DATA[3]:{X 0,Y 0,Z 1,A 0,B 0,C 0}\nTOOL_DATA[3]=TOOL_DATA[1]:{X 5,Y 0,Z 0,A 0,B 0,C 0}\n\
        TOOL_DATA[1]={X 0,Y 0,Z 50,A 90,B 0,C 0}\nTOOL_DATA[2]={X 0,Y 5,Z 51,A 90,B 0,C 0}\nTOOL_DATA[5]=TOOL_DATA[9]:TOOL_DATA[1]\nENDDAT\n";
    let wanted = |tool: &str| {
        let report = checked(&format!("products_{tool}"), KR6, &[("p.src", &text(tool)), ("$config.dat", config)]);
        (report.rows.iter().map(|r| r.joints).collect::<Vec<_>>(), report.problems)
    };
    let (product, problems) = wanted("4");
    assert!(problems.is_empty(), "{problems:?}");
    let (plain, _) = wanted("2");
    let apart = product[0].iter().zip(&plain[0]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(product.len() == 1 && apart < 1e-9, "{product:?} {plain:?}");
    // of one of its factors nobody knows the numbers
    assert!(wanted("5").1[0].what.contains("tool_data[5]"), "{:?}", wanted("5").1);
}

#[test]
fn files_that_are_too_large_to_be_looked_through_are_named() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("large_beside");
    std::fs::create_dir_all(&folder).unwrap();
    let large = std::fs::File::create(folder.join("huge.src")).unwrap();
    large.set_len((16 << 20) + 1).unwrap();
    let program = folder.join("p.src");
    std::fs::write(&program, "DEF P()\nLIN {X 350,Y 0,Z 600,A 0,B 90,C 0}\nNOBODY()\nEND\n").unwrap();
    let job = Job { program: &program, out: None, dialect: None, frames: &[], partial: false };
    let nominal = nominal(KR6);
    let options = Options { temp_c: Some(32.0), ..Options::default() };
    let report = job.run(&nominal, &real(&nominal), &options).unwrap();
    assert!(report.cautions.iter().any(|c| c.contains("huge.src") && c.contains("16 MiB")), "{:?}", report.cautions);
}

/// A KRL pose that the arm reaches.
const PLACE: &str = "{X 450,Y 20,Z 430,A 10,B 80,C 5}";

#[test]
fn a_krl_routine_has_the_tool_and_base_that_its_callers_beside_set() {
    let part = format!("DEF p()\nLIN {PLACE}\nEND\n");
    let tools = "DEFDAT $CONFIG PUBLIC\nTOOL_DATA[2]={X 0,Y 0,Z 80,A 0,B 0,C 0}\nBASE_DATA[1]={X 5,Y 0,Z 0,A 0,B 0,C 0}\nENDDAT\n";
    let main = |tool: &str| format!("DEF main()\n{tool}\nBAS(#BASE,1)\np()\nEND\n");
    let with = |folder: &str, callers: &[(&str, &str)]| {
        let mut files = vec![("p.src", part.as_str()), ("$config.dat", tools)];
        files.extend(callers);
        checked(folder, KR6, &files)
    };
    let by_number = with("called_by_number", &[("main.src", &main("BAS(#TOOL,2)"))]);
    assert_eq!(by_number.setups, [("tool '2' in '1'".to_owned(), 1)], "{by_number:?}");
    assert!(
        names(&by_number.read_with).contains(&"main.src".into())
            && !by_number.cautions.iter().any(|c| c.contains("sets a tool or a base")),
        "{by_number:?}"
    );
    let by_frame = with("called_with_a_frame", &[("main.src", &main("$TOOL={X 0,Y 0,Z 80,A 0,B 0,C 0}"))]);
    assert!(by_frame.setups[0].0.contains("$tool of main.src") && by_frame.problems.is_empty(), "{by_frame:?}");
    assert!((by_number.rows[0].moved - by_frame.rows[0].moved).abs() < 1e-12);
    let data = "DEFDAT main\nDECL FRAME TIP={X 0,Y 0,Z 80,A 0,B 0,C 0}\nENDDAT\n";
    let report = with("called_with_a_name", &[("main.src", &main("$TOOL=TIP")), ("main.dat", data)]);
    assert!(report.setups[0].0.contains("tip of main.src") && report.problems.is_empty(), "{report:?}");
    // one that sets nothing, and an earlier output, do not count
    let silent = [
        ("cell.src", "DEF cell()\np()\nEND\n"),
        ("old.src", "; compensated by TriCal 0.1\nDEF old()\nBAS(#TOOL,3)\np()\nEND\n"),
    ];
    let (first, twice) = (main("BAS(#TOOL,2)"), main("BAS(#TOOL,0)"));
    let report = with("called_silently", &[("main.src", &first), silent[0], silent[1]]);
    assert_eq!(report.setups, by_number.setups, "{report:?}");
    let report = with("called_differently", &[("main.src", &first), ("other.src", &twice)]);
    assert!(report.problems[0].what.contains("not the same wherever the routine is called"), "{report:?}");
    let alone = with("called_by_nobody", &[]);
    assert!(alone.rewritten == 1 && alone.cautions[0].contains("sets a tool or a base"), "{alone:?}");
}

#[test]
fn frames_that_krl_programs_beside_declare_for_all_are_found() {
    let main = format!("DEF main()\n$TOOL=DefTool\n$BASE=DefBase\nLIN {PLACE}\nEND\n");
    let data = "DEFDAT prog_T PUBLIC\nDECL GLOBAL FRAME DefTool={FRAME: X 0,Y 0,Z 80,A 0,B 0,C 0}\nDECL FRAME DefBase={X 0,Y 0,Z 9,A 0,B 0,C 0}\nENDDAT\n";
    let report = checked("global_frames", KR6, &[("main.src", &main), ("prog_T.dat", data)]);
    assert_eq!(report.problems.len(), 1, "{report:?}");
    assert!(report.problems[0].what.contains("'defbase' is not declared"), "{report:?}");
    let report =
        checked("global_frame", KR6, &[("main.src", &main.replace("DefBase", "$WORLD")), ("prog_T.dat", data)]);
    assert_eq!((report.rewritten, names(&report.read_with)), (1, vec!["prog_T.dat".to_owned()]), "{report:?}");
}

#[test]
fn the_foot_of_a_kuka_stands_where_its_machine_data_say() {
    let main = format!("DEF p()\n$TOOL=$NULLFRAME\n$BASE=$WORLD\nLIN {PLACE}\nEND\n");
    let root =
        |z: &str| format!("DEFDAT $MACHINE PUBLIC\nFRAME $ROBROOT={{X 0.0,Y 0.0,Z {z},A 0.0,B 0.0,C 0.0}}\nENDDAT\n");
    let run = |folder: &str, z: &str| {
        checked(
            folder,
            KR6,
            &[("R1/Program/p.src", &main), ("R1/Mada/$machine.dat", &root(z)), ("R1/System/$config.dat", "")],
        )
    };
    let (low, high) = (run("foot", "0.0"), run("pedestal", "100.0"));
    let apart = low.rows[0].wanted.translation - high.rows[0].wanted.translation;
    assert!((apart.z - 0.1).abs() < 1e-9 && apart.xy().norm() < 1e-9, "{apart}");
    assert!(names(&high.read_with).contains(&"$machine.dat".into()), "{high:?}");
}

#[test]
fn behind_the_home_of_all_krl_programs_the_posture_is_the_one_that_the_controller_has() {
    let main = format!("DEF p()\n$TOOL=$NULLFRAME\n$BASE=$WORLD\nPTP XHOME\nLIN {PLACE}\nEND\n");
    let home = |a4: i32, a5: i32| {
        format!(
            "DEFDAT $CONFIG PUBLIC\nDECL E6AXIS XHOME={{A1 0,A2 -90,A3 90,A4 {a4},A5 {a5},A6 {},E1 0}}\nENDDAT\n",
            -a4
        )
    };
    let run = |folder: &str, a4, a5| checked(folder, KR6, &[("p.src", &main), ("$config.dat", &home(a4, a5))]);
    let (up, over) = (run("home", 0, -40), run("home_turned", 180, 40));
    assert!(up.problems.is_empty() && up.cautions.iter().any(|c| c.contains("xhome (line 4)")), "{up:?}");
    assert!(up.rows[0].joints[4] < 0.0 && over.rows[0].joints[4] > 0.0, "{:?} {:?}", up.rows, over.rows);
    assert!(!up.cautions.iter().any(|c| c.contains("does not say in which configuration")), "{up:?}");
}

#[test]
fn points_of_an_absolutely_accurate_robot_are_told_once() {
    let point = |k: u32, s: u32| format!("DECL E6POS XP{k}={{X 450,Y 20,Z 430,A 10,B 80,C 5,S {s}}}\n");
    let text = format!(
        "{}{}{}DEF p()\n$TOOL=$NULLFRAME\nPTP XP1\nLIN XP2\nLIN XP3\nEND\n",
        point(1, 2),
        point(2, 18),
        point(3, 18)
    );
    let report = checked("accurate", KR6, &[("p.src", &text)]);
    let told: Vec<&String> = report.cautions.iter().filter(|c| c.contains("absolutely accurate")).collect();
    assert!(told.len() == 1 && told[0].starts_with("2 of 3 targets") && told[0].contains("line 2"), "{report:?}");
}

#[test]
fn parts_of_targets_that_a_module_beside_changes_are_listed() {
    let main = "MODULE Main\nPERS confdata conf:=[0,0,0,0];\nPROC main()\nTurn;\nMoveL [[350,50,320],[0,0.6,0.8,0],conf,[9E9,9E9,9E9,9E9,9E9,9E9]],v1,fine,tool0;\nENDPROC\nENDMODULE\n";
    let other = "MODULE Other\nPROC Turn()\nconf.cf6:=1;\nENDPROC\nENDMODULE\n";
    let report = checked("part_changed", IRB, &[("Main.mod", main), ("Other.mod", other)]);
    assert!(
        report.problems.len() == 1 && report.problems[0].what.contains("'conf', a part of targets, is changed"),
        "{report:?}"
    );
    let report =
        checked("part", IRB, &[("Main.mod", main), ("Other.mod", "MODULE Other\nPROC Turn()\nENDPROC\nENDMODULE\n")]);
    assert_eq!((report.rewritten, report.problems.len()), (1, 0), "{report:?}");
}

#[test]
fn data_without_an_orientation_are_not_unused_where_a_motion_of_another_module_goes_there() {
    let none = "[[0,0,0],[0,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]";
    let data = format!(
        "MODULE Data\nPERS robtarget p:=TARGET;\nPERS robtarget q:={none};\nPERS robtarget r:={none};\nENDMODULE\n"
    );
    let main = "MODULE Main\nPROC main()\nMoveL p,v1,fine,tool0;\nMoveL q,v1,fine,tool0;\nENDPROC\nENDMODULE\n";
    let report = checked("without_orientation", IRB, &[("Data.mod", &data), ("Main.mod", main)]);
    assert!(report.cautions[0].ends_with("uses its numbers: line 4 (r)"), "{:?}", report.cautions);
}

#[test]
fn targets_that_nothing_uses_are_told_in_one_sentence() {
    let main = "MODULE Main\nCONST robtarget p:=TARGET;\nCONST robtarget q:=TARGET;\nPERS robtarget w{2}:=[TARGET,TARGET];\nPROC main()\nMoveL p,v1,fine,tool0;\nENDPROC\nENDMODULE\n";
    let report = checked("unused", IRB, &[("Main.mod", main)]);
    assert_eq!((report.rewritten, report.problems.len()), (1, 0), "{report:?}");
    assert_eq!(
        report.cautions[0],
        "3 targets stay as they are, because nothing in the files read uses their numbers: line 3 (q), line 4 (w)"
    );
    // a module beside goes there
    let other = "MODULE Other\nPROC Go()\nMoveL q,v1,fine,tool0;\nMoveL w{1},v1,fine,tool0;\nENDPROC\nENDMODULE\n";
    let report = checked("used_beside", IRB, &[("Main.mod", main), ("Other.mod", other)]);
    assert_eq!(
        (report.rewritten, report.cautions.iter().filter(|c| c.contains("uses their")).count()),
        (4, 0),
        "{report:?}"
    );
}

#[test]
fn functions_beside_go_to_targets_of_the_program_and_routines_that_others_call_have_no_known_tool() {
    let tool = |name: &str| format!("PERS tooldata {name}:=[TRUE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n");
    let main = tool("t")
        + "CONST robtarget p:=TARGET;\nCONST robtarget q:=TARGET;\nPROC main()\nGo q,t;\nENDPROC\n\
        PROC Go(robtarget to,PERS tooldata held)\nMoveL to,v1,fine,held;\nENDPROC\n";
    let above = "PROC Over()\nMoveL Above(p),v1,fine,t;\nENDPROC\n\
        FUNC robtarget Above(robtarget at)\nRETURN Offs(at,0,0,5);\nENDFUNC\n";
    let report = checked("functions_beside", IRB, &[("m.mod", &main), ("more.mod", above)]);
    assert_eq!(
        (report.problems.len(), &report.setups),
        (0, &vec![("tool 't' in 'wobj0'".to_owned(), 2)]),
        "{report:?}"
    );
    // with which tool the other module calls it is not followed
    let calls = "PROC Over()\nGo q,tOther;\nMoveL p,v1,fine,t;\nENDPROC\n";
    let report = checked("routine_called_beside", IRB, &[("m.mod", &main), ("more.mod", calls)]);
    let problems = told(&report).2;
    assert!(problems.len() == 1 && problems[0].contains("'held of go' is an argument"), "{problems:?}");
}

#[test]
fn a_routine_of_another_file_goes_to_its_argument_with_the_tool_of_the_call_unless_its_own_file_calls_it_too() {
    let main = "DEF A( )\nDECL E6POS P\nBAS(#TOOL,1)\nBAS(#BASE,0)\nP={X 430,Y 0,Z 430,A 0,B 60,C 0}\nGO(P)\nEND\n";
    let routine = "DEF GO(Q:IN)\nDECL E6POS Q\nLIN Q\nEND\n";
    let config = "TOOL_DATA[1]={X 0,Y 0,Z 10,A 0,B 0,C 0}\nTOOL_DATA[2]={X 0,Y 0,Z 20,A 0,B 0,C 0}\n";
    let report = checked("given_beside", KR6, &[("a.src", main), ("go.src", routine), ("$config.dat", config)]);
    assert_eq!(report.setups, [("tool '1' in '0'".to_owned(), 1)], "{report:?}");
    assert_eq!(names(&report.read_with), ["$config.dat", "go.src"]);
    let own =
        format!("{routine}DEF OWN( )\nDECL E6POS R\nBAS(#TOOL,2)\nR={{X 430,Y 0,Z 430,A 0,B 60,C 0}}\nGO(R)\nEND\n");
    let problems = told(&checked("given_both", KR6, &[("a.src", main), ("go.src", &own), ("$config.dat", config)])).2;
    assert!(problems.len() == 1 && problems[0].contains("not the same wherever the routine is called"), "{problems:?}");
    let turns = routine.replace("LIN Q", "Q.B=Q.B-15\nLIN Q");
    let near = main.replace("B 60", "B 88");
    let problems =
        told(&checked("given_angle", KR6, &[("a.src", &near), ("go.src", &turns), ("$config.dat", config)])).2;
    assert!(
        problems.len() == 1 && problems[0].ends_with("one of its angles is read or set by itself in line 6"),
        "{problems:?}"
    );
}
