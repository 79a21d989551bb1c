//! Files that claim, nest or repeat more than any honest file does, given to the real binary with little memory: one sentence
//! and exit code 1 or 2, in seconds.
#![cfg(unix)]

use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Write as _};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{CELL, Place, ROBOT, errors, in_cell, words};

const MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// Address space of the process, KiB: what a recording of a day needs, and far less than the files here ask for.
const ADDRESS_SPACE: u32 = 1_500_000;
/// On a busy machine and without optimization; alone, the slowest takes 3 s.
const LIMIT: Duration = Duration::from_secs(60);

impl Place {
    /// The command fails in order, with one short sentence that has `words`.
    fn fails_in_order(&self, args: &str, words: &str) {
        let begin = Instant::now();
        let o = Command::new("sh")
            .args(["-c", &format!("ulimit -v {ADDRESS_SPACE}; exec timeout 120 \"$0\" \"$@\"")])
            .arg(env!("CARGO_BIN_EXE_trical"))
            .args(args.split(' '))
            .current_dir(self.0.path())
            .output()
            .unwrap();
        let err = errors(&o);
        let start: String = err.chars().take(2000).collect();
        assert!(matches!(o.status.code(), Some(1 | 2)), "{args}: {:?}: {start}", o.status);
        assert!(!err.contains("panicked"), "{args}: {start}");
        assert_eq!(err.trim().lines().count(), 1, "{args}: {start}");
        assert!(err.len() < 1000, "{args}: {} bytes: {start}", err.len());
        assert!(!err.trim().contains(char::is_control), "{args}: {start:?}");
        assert!(err.contains(words), "{args}: '{words}' is missing in: {start}");
        assert!(begin.elapsed() < LIMIT, "{args}: {:?}", begin.elapsed());
    }

    /// As `robot.toml`, as `cell.toml`, as `--known` and as `--frames`.
    fn refuses_toml(&self, name: &str, words: &str) {
        self.fails_in_order(&format!("plan --robot {name} --cell cell.toml --out o.csv"), words);
        self.fails_in_order(&format!("plan --robot robot.toml --cell {name} --out o.csv"), words);
        self.write(
            "one.csv",
            "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,ball,ix_mm,iy_mm,iz_mm\n0,0,0,0,0,0,1,0,0,0\n",
        );
        self.fails_in_order(&format!("identify one.csv --robot robot.toml --cell cell.toml --known {name}"), words);
    }
}

/// Whether the shell can bound the address space; else the reason is printed.
fn bounded() -> bool {
    let o = Command::new("sh").args(["-c", &format!("ulimit -v {ADDRESS_SPACE} && ulimit -v")]).output();
    let can = o.is_ok_and(|o| o.status.success() && String::from_utf8_lossy(&o.stdout).trim() == "1500000");
    if !can {
        println!("skipped: sh cannot bound the address space (ulimit -v)");
    }
    can
}

fn record(opcode: u8, length: u64, content: &[u8]) -> Vec<u8> {
    [&[opcode][..], &length.to_le_bytes(), content].concat()
}

/// A chunk that says it has `unpacked` bytes, without a checksum.
fn chunk(compression: &str, unpacked: u64, packed: u64, data: &[u8]) -> Vec<u8> {
    let mut c = vec![0; 16];
    c.extend(unpacked.to_le_bytes());
    c.extend(0_u32.to_le_bytes());
    c.extend(u32::try_from(compression.len()).unwrap().to_le_bytes());
    c.extend(compression.as_bytes());
    c.extend(packed.to_le_bytes());
    c.extend(data);
    record(0x06, c.len() as u64, &c)
}

/// A block of lz4 that unpacks to `pattern`, repeated until 4 MiB are full: its literals, then one match.
fn lz4_block(pattern: &[u8]) -> Vec<u8> {
    let long = |out: &mut Vec<u8>, mut n: usize| {
        while n >= 255 {
            out.push(255);
            n -= 255;
        }
        out.push(u8::try_from(n).unwrap());
    };
    let mut block = vec![0xff];
    long(&mut block, pattern.len() - 15);
    block.extend(pattern);
    block.extend(u16::try_from(pattern.len()).unwrap().to_le_bytes());
    long(&mut block, (4 << 20) - pattern.len() - 5 - 4 - 15);
    block.extend([0x50, 0, 0, 0, 0, 0]);
    [&u32::try_from(block.len()).unwrap().to_le_bytes()[..], &block].concat()
}

fn lz4(pattern: &[u8], blocks: usize) -> Vec<u8> {
    [&[0x04, 0x22, 0x4d, 0x18, 0x60, 0x70, 0x73][..], &lz4_block(pattern).repeat(blocks), &[0; 4]].concat()
}

fn mcap(records: &[u8]) -> Vec<u8> {
    [MAGIC, records, MAGIC].concat()
}

#[test]
fn recordings_that_claim_more_than_they_are() {
    if !bounded() {
        return;
    }
    let p = Place::new();
    let frame = lz4(&[0; 40], 1);
    p.write("claim.mcap", mcap(&chunk("lz4", 1_000_000_000_000, frame.len() as u64, &frame)));
    p.write("stored.mcap", mcap(&chunk("", 1_000_000_000_000, 1_000_000_000_000, b"")));
    p.write("record.mcap", mcap(&record(0x05, 1 << 63, b"abc")));
    // 4 GB of zeros in 17 MB, four times over
    let bomb = lz4(&[0; 40], 1000);
    p.write("bomb.mcap", mcap(&chunk("lz4", 4 << 32, bomb.len() as u64, &bomb).repeat(4)));
    // a channel, and 128 MiB of messages without content, which are larger in memory than in the file
    let mut channel = [1, 0, 0, 0, 1, 0, 0, 0].to_vec();
    channel.extend(b"a\0\0\0\0\0\0\0\0");
    let message = record(0x05, 22, &[&[1, 0][..], &[0; 20]].concat());
    let messages = lz4(&message, 32);
    let all = [record(0x04, channel.len() as u64, &channel), chunk("lz4", 1 << 27, messages.len() as u64, &messages)];
    p.write("messages.mcap", mcap(&all.concat()));
    for name in ["claim", "stored", "record", "bomb", "messages"] {
        p.fails_in_order(&format!("convert {name}.mcap o.csv"), "there is no complete measurement in it");
        p.fails_in_order(
            &format!("identify {name}.mcap --robot robot.toml --cell cell.toml"),
            "no complete measurement",
        );
    }
}

#[test]
fn urdfs_that_expand_nest_or_go_on() {
    if !bounded() {
        return;
    }
    let p = Place::new();
    let mut laughs = "<?xml version=\"1.0\"?><!DOCTYPE r [<!ENTITY l0 \"ha\">".to_owned();
    for k in 1..12 {
        write!(laughs, "<!ENTITY l{k} \"{}\">", format!("&l{};", k - 1).repeat(10)).unwrap();
    }
    p.write("laughs.urdf", laughs + "]><robot name=\"&l11;\"><link name=\"a\"/></robot>");
    p.write("entity.urdf", "<robot name=\"&l11;\"><link name=\"a\"/></robot>");
    let nested = "<link name=\"a\">".repeat(100_000) + &"</link>".repeat(100_000);
    p.write("nested.urdf", format!("<robot name=\"a\">{nested}</robot>"));
    p.write("links.urdf", format!("<robot name=\"a\">{}</robot>", "<link name=\"a\"/>".repeat(100_000)));
    p.write(
        "attributes.urdf",
        format!("<robot {}/>", (0..100_000).fold(String::new(), |s, k| s + &format!("a{k}='' "))),
    );
    p.write("long.urdf", format!("<robot name=\"{}\"/>", "x".repeat(19_000_000)));
    p.write("huge.urdf", format!("<robot name=\"{}\"/>", "x".repeat(200_000_000)));
    for (name, words) in [
        ("laughs", "entities are not expanded"),
        ("entity", "unrecognized entity"),
        ("nested", "nested more than 100 deep"),
        ("links", "more than 10000 links"),
        ("attributes", ""),
        ("long", ""),
        ("huge", "has more than 20000000 bytes"),
    ] {
        p.fails_in_order(&format!("convert {name}.urdf o.toml"), words);
    }
}

#[test]
fn toml_files_that_nest_or_go_on() {
    if !bounded() {
        return;
    }
    let p = Place::new();
    p.write("a.toml", "a = ".to_owned() + &"[".repeat(1_000_000));
    p.refuses_toml("a.toml", "max recursion depth met");
    p.write("a.toml", "a = ".to_owned() + &"{a = ".repeat(1_000_000));
    p.refuses_toml("a.toml", "max recursion depth met");
    p.write("a.toml", "a.".repeat(1_000_000) + "a = 1");
    p.refuses_toml("a.toml", "recursion limit");
    p.write("a.toml", format!("{} = 1", "a".repeat(1_000_000)));
    p.refuses_toml("a.toml", "aaa...");
    p.write("a.toml", "# ".to_owned() + &"x".repeat(200_000_000));
    p.refuses_toml("a.toml", "has more than 20000000 bytes");
    let joint = &ROBOT[ROBOT.find("[[joint]]").unwrap()..ROBOT.rfind("[[joint]]").unwrap()];
    p.write("a.toml", "name = \"centipede\"\n".to_owned() + &joint.repeat(2000));
    p.fails_in_order("plan --robot a.toml --cell cell.toml --out o.csv", "10000 joints found, expected 1 to 9");
}

#[test]
fn tables_of_one_line_or_a_million_columns() {
    if !bounded() {
        return;
    }
    let p = Place::new();
    let header = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,ball,ix_mm,iy_mm,iz_mm";
    let identify = "identify a.csv --robot robot.toml --cell cell.toml";
    let measure = "measure --robot robot.toml --cell cell.toml --plan a.csv --gauge line:///dev/null \
                   --controller rapid://127.0.0.1:1 --out o.mcap";
    // a file with a hole: 500 MB of zeros that take no place
    let hole = std::fs::File::create(p.path("a.csv")).unwrap();
    hole.set_len(500_000_000).unwrap();
    p.fails_in_order(identify, "expected");
    p.fails_in_order("convert a.csv o.mcap", "line 1 is longer than 1048576 bytes");
    p.fails_in_order(measure, "has more than 20000000 bytes");
    p.write("a.csv", "9".repeat(500_000_000));
    p.fails_in_order(identify, "expected");
    p.fails_in_order("convert a.csv o.mcap", "line 1 is longer than 1048576 bytes");
    p.fails_in_order(measure, "has more than 20000000 bytes");
    p.write("a.csv", format!("{header}\n{}", "9".repeat(500_000_000)));
    p.fails_in_order(identify, "line 2 is longer than 1048576 bytes");
    p.fails_in_order("convert a.csv o.mcap", "line 2 is longer than 1048576 bytes");
    p.write("a.csv", format!("{header}\n{}", "9".repeat(1_000_000)));
    p.fails_in_order(identify, "found 1 fields, expected 10");
    p.write("a.csv", format!("{header}\n{},0,0,0,0,0,1,0,0,0", "9".repeat(1_000_000)));
    p.fails_in_order(identify, "999...', expected a finite number");
    let columns: String = (0..1_000_000).fold(header.to_owned(), |s, k| s + &format!(",c{k}"));
    p.write("a.csv", columns + "\n" + &"0,".repeat(1_000_009) + "0\n");
    p.fails_in_order("convert a.csv o.mcap", "line 1 is longer than 1048576 bytes");
    p.write("a.csv", "q1_deg,".repeat(140_000) + "q1_deg\n" + &"0,".repeat(140_000) + "0\n");
    p.fails_in_order(identify, "column q1_deg is given twice");
    p.fails_in_order(measure, "found it twice");
    p.write("a.csv", "x".repeat(1_000_000) + "\n0\n");
    p.fails_in_order(identify, "unknown column 'xxx");
    p.fails_in_order(measure, "unknown column 'xxx");
    let far = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,reference,x_mm,y_mm,z_mm\n0,0,0,0,0,0,999999999,0,0,0\n";
    p.write("a.csv", far);
    p.fails_in_order(identify, "found '999999999', expected a number counted from 1 up to 10000");
}

#[test]
fn messages_hold_nothing_that_a_terminal_obeys_and_stay_short_in_bytes() {
    if !bounded() {
        return;
    }
    let p = Place::new();
    p.write("a.csv", "q1_deg,\u{1b}[2J\u{7}\n0,0\n");
    p.fails_in_order("identify a.csv --robot robot.toml --cell cell.toml", "unknown column");
    p.fails_in_order(
        &format!("identify {}.csv --robot robot.toml --cell cell.toml", "\u{1f916}".repeat(60)),
        "cannot be read",
    );
    let url = format!("line:///dev/null?{}=1", "\u{1f916}".repeat(20_000));
    p.fails_in_order(&format!("gauge test --gauge {url}"), "unknown option");
    // a site that the arm does not have: the file, and the site as it stands there
    p.good(&["sample", "s"]);
    p.good(&words("identify s/touches.csv --robot s/robot.toml --cell s/cell.toml --out model.toml"));
    p.write("bad.toml", p.text("model.toml").replace("link = 2\n", "link = 22\n"));
    let validate = "validate s/touches.csv --robot s/robot.toml --cell s/cell.toml --model bad.toml";
    p.fails_in_order(
        validate,
        "bad.toml: term 'alpha_2' acts at site = { link = { link = 22, parameter = \"alpha\" } }",
    );
    let list = "1,".repeat(20_000) + "1";
    p.fails_in_order(&format!("virtual-cell --robot robot.toml --cell cell.toml --unsettled {list}"), "--unsettled");
}

#[test]
fn numbers_on_the_command_line() {
    if !bounded() {
        return;
    }
    let p = Place::new();
    for (option, words) in [("--per-ball", "at most 1000"), ("--pool", "at most 1000"), ("--points", "at most 1000")] {
        p.fails_in_order(
            &format!("plan --robot robot.toml --cell cell.toml {option} 1000000000000 --out o.csv"),
            words,
        );
    }
}

/// The cell, with the first of its solids from this file.
fn cell_with_mesh(file: &str) -> String {
    let at = CELL.find("solids = [").unwrap();
    let end = at + CELL[at..].find('\n').unwrap();
    format!("{}solids = [{{ shape = \"mesh\", file = \"{file}\" }}]{}", &CELL[..at], &CELL[end..])
}

/// Ends a program when it goes out of scope.
struct Ends(std::process::Child);

impl Drop for Ends {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Every kind of file that a command reads: the command, with `{}` where the file stands, and its extension.
const READERS: &[(&str, &str)] = &[
    ("plan --robot {} --cell cell.toml --out o.csv", "toml"),
    ("plan --robot {} --cell cell.toml --out o.csv", "urdf"),
    ("plan --robot robot.toml --cell {} --out o.csv", "toml"),
    ("convert {} o.toml", "urdf"),
    ("identify {} --robot robot.toml --cell cell.toml", "csv"),
    ("identify {} --robot robot.toml --cell cell.toml", "mcap"),
    ("diagnose {} --robot robot.toml --cell cell.toml", "csv"),
    ("convert {} o.mcap", "csv"),
    ("convert {} o.csv", "mcap"),
    ("identify touches.csv --robot robot.toml --cell cell.toml --known {}", "toml"),
    ("validate touches.csv --robot robot.toml --cell cell.toml --model {}", "toml"),
    ("compare {} touches.csv", "toml"),
    ("compensate {} --robot robot.toml --cell cell.toml --model model.toml --out o", "mod"),
    ("compensate {} --robot robot.toml --cell cell.toml --model model.toml --out o", "csv"),
    ("compensate a.mod --robot robot.toml --cell cell.toml --model model.toml --frames {} --out o", "toml"),
    (
        "measure --robot robot.toml --cell cell.toml --plan {} --gauge line:///dev/null --controller rapid://127.0.0.1:1 --out o.mcap",
        "csv",
    ),
    (
        "measure --robot robot.toml --cell cell.toml --plan plan.csv --gauge GAUGE --controller CONTROLLER --go --resume --out {}",
        "mcap",
    ),
    ("virtual-cell --robot robot.toml --cell cell.toml --port 0 --faults {}", "toml"),
    ("virtual-cell --robot robot.toml --cell cell.toml --port 0 --truth {}", "toml"),
    ("robot ping --controller rapid://127.0.0.1:1?secret=@{}", "txt"),
    ("plan --robot robot.toml --cell mesh-{}.toml --out o.csv", "stl"),
    ("plan --robot robot.toml --cell mesh-{}.toml --out o.csv", "obj"),
];

#[test]
fn no_reader_of_any_kind_of_file_is_held_up_by_one_without_an_end() {
    if !bounded() {
        return;
    }
    let p = Place::new();
    p.good(&["sample", "s"]);
    for name in ["robot.toml", "cell.toml", "touches.csv"] {
        std::fs::rename(p.path("s").join(name), p.path(name)).unwrap();
    }
    p.good(&in_cell("identify touches.csv --out model.toml"));
    p.good(&in_cell("plan --per-ball 2 --out plan.csv"));
    p.write("a.mod", "MODULE m\nENDMODULE\n");
    // the recording is opened when gauge and controller have answered
    let mut cell = p.command(&in_cell("virtual-cell --port 0 --json"));
    let mut cell = Ends(cell.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap());
    let mut links = String::new();
    BufReader::new(cell.0.stdout.take().unwrap()).read_line(&mut links).unwrap();
    let links: serde_json::Value = serde_json::from_str(&links).unwrap();
    let [gauge, controller] = ["gauge", "controller"].map(|key| links[key].as_str().unwrap().to_owned());
    let header = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,ball,ix_mm,iy_mm,iz_mm";
    let lines = [
        ("yes 0,0,0,0,0,0,1,0,0,0", header.to_owned()),
        // not one end of a line
        ("tr '\\0' x < /dev/zero", String::new()),
    ];
    for (command, extension) in READERS {
        for device in ["urandom", "zero"] {
            let _ = std::os::unix::fs::symlink(format!("/dev/{device}"), p.path(&format!("{device}.{extension}")));
        }
        // 5 GB of zeros that take no place
        let hole = std::fs::File::create(p.path(&format!("hole.{extension}"))).unwrap();
        hole.set_len(5_000_000_000).unwrap();
        let pipe = p.path(&format!("pipe.{extension}"));
        if !pipe.exists() {
            assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        }
        for kind in ["urandom", "zero", "hole", "pipe"] {
            let name = format!("{kind}.{extension}");
            if matches!(*extension, "stl" | "obj") {
                p.write(&format!("mesh-{name}.toml"), cell_with_mesh(&name));
            }
            let asked = command.replace("{}", &name).replace("GAUGE", &gauge).replace("CONTROLLER", &controller);
            if kind != "pipe" {
                p.fails_in_order(&asked, "");
                continue;
            }
            for (writes, first) in &lines {
                let script = format!("{{ echo '{first}'; {writes}; }} > \"$0\"");
                let writer = Command::new("sh").args(["-c", &script]).arg(&pipe).stderr(Stdio::null()).spawn().unwrap();
                let _ends = Ends(writer);
                p.fails_in_order(&asked, "");
            }
        }
    }
}

#[test]
fn controllers_that_never_end_sending_fill_nothing() {
    if !bounded() {
        return;
    }
    let p = Place::new();
    let http = "HTTP/1.1 200 OK\r\nContent-Type: application/json\r\n\r\n";
    let header = format!("HTTP/1.1 200 OK\r\nX: {}", "x".repeat(4000));
    for (scheme, first, then) in [
        ("rapid", "", "x"),
        ("rapid", "", "26 1 #"),
        ("rapid", "", "24 1 #"),
        ("rws", http, "{\"a\":1}"),
        ("rws", header.as_str(), "x"),
        ("ur", "", "x"),
        ("ur", "", "\0\u{6}Mabc"),
    ] {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let (first, then) = (first.to_owned(), then.repeat(1000));
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let (first, then) = (first.clone(), then.clone());
                std::thread::spawn(move || {
                    let mut stream = stream;
                    let _ = stream.write_all(first.as_bytes());
                    while stream.write_all(then.as_bytes()).is_ok() {}
                });
            }
        });
        let url = match scheme {
            "rapid" => format!("rapid://127.0.0.1:{port}?timeout_s=1"),
            "rws" => format!("rws://127.0.0.1:{port}?timeout_s=1&login=factory"),
            _ => format!("ur://127.0.0.1?timeout_s=1&rtde_port={port}&script_port={port}"),
        };
        p.fails_in_order(&format!("robot ping --controller {url}"), "robot controller");
    }
}

#[test]
fn an_arm_that_cannot_turn_its_device_is_given_up_soon() {
    let p = Place::new();
    let joint = |a: u32, d: u32| {
        format!("[[joint]]\nalpha_deg = 0\na_mm = {a}\nd_mm = {d}\ntheta_offset_deg = 0\nlimits_deg = [-170, 170]\n")
    };
    p.write("nine.toml", "name = \"nine parallel joints\"\n".to_owned() + &joint(0, 300) + &joint(100, 0).repeat(8));
    p.write("flat.toml", &CELL[..CELL.find("[geometry]").unwrap()]);
    let begin = Instant::now();
    p.fails_in_order(
        "plan --robot nine.toml --cell flat.toml --start-deg 30,10,10,10,10,10,10,10,10 --out o.csv",
        "ball 1: 0 collision-free configurations found in 1024 attempts, expected 15; all were out of reach",
    );
    // it took 88 s once; alone 5 s
    assert!(begin.elapsed() < Duration::from_secs(45), "{:?}", begin.elapsed());
}

#[test]
fn meshes_that_claim_four_thousand_million_triangles() {
    if !bounded() {
        return;
    }
    let p = Place::new();
    let mut stl = vec![b' '; 80];
    stl.extend(4_000_000_000_u32.to_le_bytes());
    stl.extend([0; 50]);
    p.write("a.stl", stl);
    std::fs::File::create(p.path("b.stl")).unwrap().set_len(2_000_000_000).unwrap();
    p.write("c.obj", "f ".to_owned() + &"1 ".repeat(5_000_000));
    p.write("d.stl", "solid ".repeat(1_000_000));
    for (name, words) in [
        ("a.stl", "expected 200000000084 for its 4000000000 triangles"),
        ("b.stl", "found 1907 MiB, expected at most 256"),
        ("c.obj", "found vertex '1'"),
        ("d.stl", ""),
    ] {
        p.write("mesh.toml", cell_with_mesh(name));
        p.fails_in_order("plan --robot robot.toml --cell mesh.toml --out o.csv", words);
    }
}

#[test]
fn programs_of_one_nest_of_brackets() {
    if !bounded() {
        return;
    }
    let p = Place::new();
    p.good(&words("demo --conceal none --out demo"));
    let many = 5_000_000;
    for (name, text) in [
        ("a.mod", "MODULE m\nCONST robtarget p:=".to_owned() + &"[".repeat(many)),
        ("b.mod", "MODULE m\nCONST robtarget p:=[[".to_owned() + &"1,".repeat(many)),
        ("c.mod", "MODULE m\nPROC main()\nMoveL ".to_owned() + &"Offs(".repeat(many / 5)),
        ("d.src", "DEF a()\nLIN ".to_owned() + &"{X ".repeat(many / 3)),
        ("e.ls", "/PROG A\n/POS\nP[1".to_owned() + &"{".repeat(many)),
        ("f.script", "def a():\n movej(p".to_owned() + &"[".repeat(many)),
        ("g.script", "movej(".repeat(many / 5)),
        ("h.csv", "q1_deg\n".to_owned() + &"9".repeat(many)),
        ("i.csv", "x".repeat(many / 5) + "\n1\n"),
    ] {
        p.write(name, text);
        let model = "--robot demo/robot.toml --cell demo/cell.toml --model demo/calibrated.toml";
        p.fails_in_order(&format!("compensate {name} {model} --out o"), "");
    }
}
