//! `trical compensate` as its users meet it: files in, files out, refusals.

use std::process::Output;

use crate::common::{CELL_ARGS, Place, errors, words};

const PROGRAM: &str = include_str!("../crates/trical-cli/assets/sample.mod");

/// A cell, the sample program, and the true model of a hidden arm (`truth.toml`).
fn place() -> Place {
    let p = Place::new();
    p.write("sample.mod", PROGRAM);
    p.good(&words("demo --conceal none --out demo"));
    p
}

impl Place {
    fn compensate(&self, program: &str, more: &[&str]) -> Output {
        let model = ["--model", "demo/calibrated.toml"];
        self.run(&[&["compensate", program][..], &CELL_ARGS, &model, more].concat())
    }

    fn rewritten(&self, program: &str, more: &[&str]) -> serde_json::Value {
        let o = self.compensate(program, &[more, &["--json"]].concat());
        assert!(o.status.success(), "{}", errors(&o));
        serde_json::from_slice(&o.stdout).unwrap()
    }

    /// One sentence that has `words`, the exit code, and nothing written.
    fn refuses_program(&self, code: i32, program: &str, more: &[&str], words: &[&str]) {
        let o = self.compensate(program, &[more, &["--out", "new"]].concat());
        let err = errors(&o);
        assert_eq!(o.status.code(), Some(code), "{err}");
        assert_eq!(err.trim().lines().count(), 1, "{err}");
        for w in words {
            assert!(err.contains(w), "'{w}' is missing in: {err}");
        }
        let left: Vec<_> = std::fs::read_dir(self.0.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert!(!left.iter().any(|n| n.to_string_lossy().starts_with("new")), "{left:?}");
    }
}

#[test]
fn programs_are_rewritten_checked_and_refused() {
    let p = place();
    let done = p.rewritten("sample.mod", &["--out", "out.mod"]);
    assert_eq!(done["targets"], 7);
    assert_eq!(done["problems"], serde_json::json!([]));
    assert!(done["before"]["mean_mm"].as_f64().unwrap() > 0.1 && done["after"]["max_mm"].as_f64().unwrap() < 1e-3);
    // the same bytes as the library wrote for the demo, whatever the mark calls the model
    let lines =
        |b: Vec<u8>| b.split_inclusive(|b| *b == b'\n').skip(1).map(<[u8]>::to_vec).collect::<Vec<_>>().concat();
    assert_eq!(lines(p.bytes("out.mod")), lines(p.bytes("demo/sample.compensated.mod")));
    assert!(p.bytes("out.mod").starts_with(b"! compensated by TriCal"));

    // Latin-1, mixed line ends, no line end at the end
    let mut text = PROGRAM.replace("MODULE Sample\n", "MODULE Sample\r\n  ! Gr??e\n").into_bytes();
    text.iter_mut().filter(|b| **b == b'?').for_each(|b| *b = 0xfc);
    text.truncate(text.len() - 1);
    p.write("latin.mod", &text);
    p.rewritten("latin.mod", &["--out", "latin.new.mod"]);
    // a name that says another language
    let o = p.compensate("sample.mod", &["--out", "out.src"]);
    let err = errors(&o);
    assert!(o.status.code() == Some(2) && err.contains("--out: found out.src, as krl programs are named"), "{err}");
    assert!(err.contains("sample.mod is rapid and stays so") && !p.path("out.src").exists(), "{err}");
    assert!(p.bytes("latin.new.mod").windows(7).any(|w| w == b"Gr\xfc\xfce\n "));

    // a look without a file; another dialect than the extension says
    let check = p.rewritten("sample.mod", &["--check"]);
    assert_eq!(check["rows"].as_array().unwrap().len(), 7);
    for both in [["--check", "--out", "o.mod"].as_slice(), &["--out", "o.mod", "--seq", "1", "--time-s", "2"]] {
        let o = p.compensate("sample.mod", both);
        assert!(o.status.code() == Some(2) && errors(&o).contains("cannot be used with"), "{}", errors(&o));
    }
    p.write("poses.txt", b"x_mm,y_mm,z_mm,qw,qx,qy,qz\n350,50,320,0,0.6,0.8,0\n");
    p.refuses_program(2, "poses.txt", &[], &["poses.txt", "extension", "--dialect", "krl", "urscript"]);
    assert_eq!(p.rewritten("poses.txt", &["--dialect", "csv", "--out", "poses.new"])["targets"], 1);
    p.refuses_program(2, "poses.txt", &["--dialect", "vb"], &["'vb'", "rapid"]);

    // frames from files
    p.write("moved.mod", PROGRAM.replace("fine,tDevice;", "fine,tDevice\\WObj:=wTable;"));
    p.refuses_program(1, "moved.mod", &[], &["'wtable'", "not declared", "--frames", "line 4 (pCorner1)"]);
    p.write("frames.toml", b"[frames.wTable]\nxyz_mm = [10, 5, -20]\nzyx_deg = [3, 0, 0]\n");
    assert_eq!(p.rewritten("moved.mod", &["--frames", "frames.toml", "--out", "moved.new.mod"])["targets"], 7);
    let same = "PERS wobjdata wTable:=[FALSE,TRUE,\"\",[[10,5,-20],[0.99965732,0,0,0.02617695]],[[0,0,0],[1,0,0,0]]];";
    p.write("CalibData.mod", same);
    let with = |f: &str| p.rewritten("moved.mod", &["--frames", f, "--check"])["largest_move_mm"].as_f64().unwrap();
    assert!((with("frames.toml") - with("CalibData.mod")).abs() < 1e-4);
    p.write("bad.toml", b"[frames.wTable]\nxyz_mm = [10, 5, -20]\nzyx_rad = [3, 0, 0]\n");
    p.refuses_program(2, "moved.mod", &["--frames", "bad.toml"], &["bad.toml", "line 3", "zyx_rad"]);
    p.refuses_program(2, "sample.mod", &["--tool", "tNone"], &["'tNone'", "tdevice"]);

    // a target out of reach: nothing, or the others
    p.write("far.mod", PROGRAM.replacen("[[300,", "[[3000,", 1));
    p.refuses_program(1, "far.mod", &[], &["line 4 (pCorner1)", "out of reach", "--partial"]);
    let part = p.rewritten("far.mod", &["--partial", "--out", "far.new.mod"]);
    assert_eq!((&part["targets"], part["problems"].as_array().unwrap().len()), (&serde_json::json!(6), 1));
    p.write("all.mod", b"CONST robtarget p:=[[3000,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];");
    p.refuses_program(1, "all.mod", &["--partial"], &["none of its 1 target can"]);
    p.refuses_program(2, "out.mod", &[], &["out.mod", "compensated already"]);
    p.write("wide.mod", PROGRAM.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>());
    p.refuses_program(2, "wide.mod", &[], &["wide.mod", "UTF-16"]);
    p.refuses_program(2, "sample.mod", &["--temp-c", "nan"], &["--temp-c"]);

    // what a motion goes to and this file does not say is listed, and nothing is written without being told to
    let home = "    MoveJ pElsewhere,v1000,z50,tDevice;\n    MoveL pCorner1";
    p.write("home.mod", PROGRAM.replacen("    MoveL pCorner1", home, 1));
    p.refuses_program(1, "home.mod", &[], &["line ", "'pElsewhere'", "--partial"]);
    let part = p.rewritten("home.mod", &["--partial", "--out", "home.new.mod"]);
    assert_eq!((&part["targets"], part["problems"].as_array().unwrap().len()), (&serde_json::json!(7), 1));
    let o = p.compensate("home.mod", &["--check", "--partial"]);
    assert!(String::from_utf8_lossy(&o.stdout).contains("1 left as it is:\n    line "), "{o:?}");
    assert_eq!(p.compensate("home.mod", &["--check"]).status.code(), Some(1));

    // another cell than that of the fit is told
    let cell = p.text("demo/cell.toml");
    assert!(cell.contains("xyz_mm = [150.0"), "{cell}");
    assert!(p.rewritten("sample.mod", &["--check"])["cautions"].is_null());
    p.write("cell.toml", cell.replacen("xyz_mm = [150.0", "xyz_mm = [153.0", 1));
    let cautions = p.rewritten("sample.mod", &["--check"])["cautions"].to_string();
    assert!(cautions.contains("(its base differs by 3.000 mm)"), "{cautions}");
    assert!(p.rewritten("sample.mod", &["--check", "--own-base"])["cautions"].is_null());
}

/// A .src and its .dat are one program, and the controller's `$config.dat` declares its tools and bases.
#[test]
fn the_files_of_a_krl_program_belong_together() {
    let p = place();
    std::fs::create_dir_all(p.path("R1/Program")).unwrap();
    std::fs::create_dir_all(p.path("R1/System")).unwrap();
    for (name, text) in [
        (
            "System/$config.dat",
            "BASE_DATA[3]={X 10.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\nTOOL_DATA[1]={X 18,Y -12,Z 118,A 0,B 0,C 0}\n",
        ),
        (
            "Program/p.src",
            "&ACCESS RVP\r\nDEF p()\r\nFDAT_ACT=FP1\r\nPTP XP1\r\nLIN {X 350,Y 30,Z 320,A 106.26,B 0,C 180}\r\nEND\r\n",
        ),
        (
            "Program/p.dat",
            "&ACCESS RVP\r\nDEFDAT p\r\nDECL E6POS XP1={X 340,Y 50,Z 320,A 106.26,B 0,C 180,E1 0.0}\r\nDECL FDAT FP1={TOOL_NO 1,BASE_NO 3,IPO_FRAME #BASE}\r\nENDDAT\r\n",
        ),
    ] {
        p.write(&format!("R1/{name}"), text);
    }
    let done = p.rewritten("R1/Program/p.src", &["--out", "q.src", "--any-configuration"]);
    assert_eq!(done["targets"], 2, "{done}");
    assert_eq!(done["written"], serde_json::json!(["q.dat", "q.src"]));
    assert!(done["read_with"].to_string().contains("$config.dat") && done["read_with"].to_string().contains("p.dat"));
    for (name, lines, changed) in [("dat", 5, "DECL E6POS"), ("src", 6, "LIN {")] {
        let (old, new) = (p.text(&format!("R1/Program/p.{name}")), p.text(&format!("q.{name}")));
        assert_eq!(new.matches("compensated by TriCal").count(), 1, "{new}");
        let rest: Vec<&str> = new.lines().filter(|l| !l.contains("TriCal")).collect();
        assert_eq!(rest.len(), lines);
        for (was, is) in old.lines().zip(rest) {
            assert_eq!(was != is, was.starts_with(changed), "{was} {is}");
        }
    }
    let both = p.rewritten("R1/Program/p.dat", &["--check"]);
    assert_eq!(both["rows"][1]["line"], 5);
    assert!(both["rows"][1]["file"].as_str().unwrap().ends_with("p.src"));
    let same = p.compensate("R1/Program/p.src", &["--out", "R1/Program/p.txt"]);
    assert_eq!(same.status.code(), Some(2), "{same:?}");
    assert!(errors(&same).contains("another folder or name"));
}

/// What a routine of another file sets holds behind its call; one that is in no file is told of.
#[test]
fn routines_of_other_files_are_read_or_told() {
    let p = place();
    std::fs::create_dir_all(p.path("R1/Program/cell")).unwrap();
    let target = "LIN {X 350,Y 30,Z 320,A 106.26,B 0,C 180}";
    let program = format!("DEF go()\nTAKE()\n{target}\nCWRITE(1)\nhold()\nx=abs(2)\nagain()\nEND\n");
    p.write("R1/Program/go.src", &program);
    p.write("R1/Program/cell/go.src", &program);
    p.write("R1/Program/Take.SRC", b"DEF take()\nFDAT_ACT=FP1\ntools()\nEND\n");
    p.write("R1/Program/Take.DAT", b"DEFDAT take\nDECL FDAT FP1={TOOL_NO 2,BASE_NO 0}\nENDDAT\n");
    p.write("R1/Program/tools.src", b"DEF tools()\nBAS(#TOOL,1)\nEND\n");
    p.write("R1/Program/again.src", b"DEF again()\ntake()\nagain()\nEND\n");
    p.write("config.dat", b"TOOL_DATA[1]={X 18,Y -12,Z 118,A 0,B 0,C 0}\nTOOL_DATA[2]={X 0,Y 0,Z 9,A 0,B 0,C 0}\n");
    for place in ["R1/Program/go.src", "R1/Program/cell/go.src"] {
        let done = p.rewritten(place, &["--check", "--frames", "config.dat"]);
        let read: Vec<_> = done["read_with"].as_array().unwrap().iter().map(|f| f.as_str().unwrap()).collect();
        let read: Vec<_> = read.iter().map(|f| f.rsplit('/').next().unwrap()).collect();
        assert_eq!(read, ["Take.DAT", "Take.SRC", "tools.src", "again.src"], "{done}");
        assert_eq!(done["meant_with"], serde_json::json!([{ "tool_and_frame": "tool '1' in '0'", "targets": 1 }]));
        let caution = done["cautions"][0].as_str().unwrap();
        assert!(caution.contains(": hold (line 5); they are taken to leave"), "{caution}");
    }
}
