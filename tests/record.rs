//! `trical record`: an arm guided into sockets, its joints from a file that grows.

use std::io::{BufRead, Write};
use std::path::Path;
use std::process::{Output, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use crate::common::{CELL, Place, errors, in_cell, words};

impl Place {
    fn record(&self, follow: &str, out: &str, typed: &[&str]) -> Output {
        self.record_from(["--follow", follow], out, typed)
    }

    fn record_from(&self, from: [&str; 2], out: &str, typed: &[&str]) -> Output {
        let lines: String = typed.iter().map(|t| format!("{t}\n")).collect();
        let record = ["record", "--robot", "robot.toml", "--place", "front", "--out", out];
        self.typed(&[&record[..], &from].concat(), &lines)
    }
}

/// Somebody who adds samples to a file, twenty a second, until dropped. `message` writes sample `k`.
struct Writer(Arc<AtomicBool>, Option<std::thread::JoinHandle<()>>);

impl Writer {
    fn to(path: &Path, first: &str, message: impl Fn(usize) -> String + Send + 'static) -> Self {
        std::fs::write(path, first).unwrap();
        let end = Arc::new(AtomicBool::new(false));
        let (path, ends, count) = (path.to_owned(), end.clone(), AtomicUsize::new(0));
        let write = move || {
            while !ends.load(Ordering::Relaxed) {
                let text = message(count.fetch_add(1, Ordering::Relaxed));
                std::fs::OpenOptions::new().append(true).open(&path).unwrap().write_all(text.as_bytes()).unwrap();
                std::thread::sleep(Duration::from_millis(50));
            }
        };
        Self(end, Some(std::thread::spawn(write)))
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
        self.1.take().unwrap().join().unwrap();
    }
}

/// As `ros2 topic echo /joint_states` writes it: the joints in the order of their names, a gripper among them.
fn echoed(q: [f64; 6]) -> String {
    let names: Vec<String> = (1..=6).rev().map(|k| format!("- joint_{k}\n")).collect();
    let values: Vec<String> = q.iter().rev().map(|q| format!("- {q}\n")).collect();
    format!(
        "header:\n  stamp:\n    sec: 1\n    nanosec: 2\n  frame_id: ''\nname:\n- finger_left\n{}position:\n- 0.04\n{}velocity: []\neffort: []\n---\n",
        names.concat(),
        values.concat()
    )
}

#[test]
fn visits_are_taken_from_a_topic_that_is_echoed_and_added_to_what_is_there() {
    let place = Place::new();
    let writer = Writer::to(&place.path("joints.txt"), "", |_| echoed([0.1, 0.2, -0.3, 0.4, 0.5, -0.6]));
    let done = place.record("joints.txt", "visits.csv", &["", "2", "p back left", "1", "p a,b", "q"]);
    let told = errors(&done);
    assert!(done.status.success(), "{told}");
    assert!(told.contains("joints 1 to 6 are joint_1,") && told.contains("expected a name of letters"), "{told}");
    assert!(told.contains("as at the row before, which was socket 1 of front: one of the two rows is wrong"), "{told}");
    let again = place.record("joints.txt", "visits.csv", &[""]);
    assert!(errors(&again).contains("front has rows already: unless the sockets have not moved since"), "{told}");
    assert!(String::from_utf8_lossy(&again.stdout).contains("1 row added to visits.csv"));
    drop(writer);
    let text = place.text("visits.csv");
    let lines: Vec<&str> = text.lines().collect();
    let joints = [0.1_f64, 0.2, -0.3, 0.4, 0.5, -0.6].map(|q| format!("{:.6}", q.to_degrees()));
    assert_eq!(lines.len(), 5, "{text}");
    for (line, (seq, at)) in lines[1..].iter().zip([(0, "front,1"), (1, "front,2"), (2, "back left,1"), (3, "front,1")])
    {
        let cells: Vec<&str> = line.split(',').collect();
        assert_eq!(cells[0], seq.to_string());
        for (cell, q) in cells[1..7].iter().zip(&joints) {
            assert_eq!(&format!("{:.6}", cell.parse::<f64>().unwrap()), q);
        }
        assert_eq!(cells[7..].join(","), format!("{at},0,0,0"));
    }
    // one writer at a time: two would give two visits one number
    let other = std::fs::File::open(place.path("visits.csv")).unwrap();
    other.lock().unwrap();
    let busy = place.record("joints.txt", "visits.csv", &[""]);
    assert_eq!(busy.status.code(), Some(2));
    assert!(errors(&busy).contains("another program is writing it"), "{}", errors(&busy));
    drop(other);
    // a gripper's own messages are no arm, whichever comes first; what is no number is no joint
    let gripper = "name:\n- finger\nposition:\n- 0.04\n---\n";
    let writer = Writer::to(&place.path("joints.txt"), "", move |k| match k % 4 {
        3 => echoed([0.1, 0.2, -0.3, 0.4, 0.5, -0.6]),
        _ => gripper.to_owned(),
    });
    let both = place.record("joints.txt", "both.csv", &[""]);
    drop(writer);
    assert!(String::from_utf8_lossy(&both.stdout).contains("1 row added to both.csv"), "{}", errors(&both));
    let writer = Writer::to(&place.path("joints.txt"), "", move |_| gripper.to_owned());
    let alone = errors(&place.record("joints.txt", "alone.csv", &[""]));
    drop(writer);
    assert!(alone.contains("of 1 joint (finger)"), "{alone}");
    let writer = Writer::to(&place.path("joints.txt"), "", |_| echoed([f64::NAN; 6]));
    let not_numbers = errors(&place.record("joints.txt", "alone.csv", &[""]));
    drop(writer);
    assert!(not_numbers.contains("a message has no name and number for every joint"), "{not_numbers}");
    // what was taken reads as a recording
    place.good(&words("convert visits.csv visits.mcap --joints 6"));
}

#[test]
fn a_csv_may_begin_after_record_and_what_is_no_sample_is_told() {
    let place = Place::new();
    let writer = Writer::to(&place.path("late.csv"), "", |k| match k {
        0 => {
            std::thread::sleep(Duration::from_millis(1500));
            "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n".to_owned()
        }
        _ => "1,2,3,4,5,6\n".to_owned(),
    });
    let told = errors(&place.record("late.csv", "visits.csv", &["", "q"]));
    drop(writer);
    assert!(told.contains("row 0: front, socket 1, 1.000 2.000 3.000"), "{told}");
    let writer = Writer::to(&place.path("late.csv"), "", |_| "hello\n".to_owned());
    let told = errors(&place.record("late.csv", "visits.csv", &["", "q"]));
    drop(writer);
    assert!(told.contains("bytes came, but no whole sample; expected a CSV with a header"), "{told}");
    for (line, expected) in [
        ("q1_deg,q1_deg,q3_deg\n", "found column q1_deg twice"),
        ("q1_deg,q2_deg\n", "one for each joint of the robot"),
    ] {
        std::fs::write(place.path("wrong.csv"), line).unwrap();
        assert!(errors(&place.record("wrong.csv", "visits.csv", &["q"])).contains(expected), "{line}");
    }
    // a device may be read for ever
    let refused = place.record("late.csv", "/dev/full", &["", "q"]);
    let told = errors(&refused);
    assert!(refused.status.code() == Some(2) && told.contains("expected a recording in a file"), "{told}");
}

/// A gripper and a second driver of the arm on the same topic: neither is taken for joints in another place.
#[test]
fn messages_of_other_publishers_and_another_order_of_joints_change_no_row() {
    let place = Place::new();
    let gripper = "name: [finger_left, finger_right]\nposition: [0.5, 0.6]\n---\n";
    let forward = "name: [joint_1, joint_2, joint_3, joint_4, joint_5, joint_6]\nposition: [0.1, 0.2, -0.3, 0.4, 0.5, -0.6]\n---\n";
    let writer = Writer::to(&place.path("joints.txt"), "", move |k| match k % 3 {
        0 => echoed([0.1, 0.2, -0.3, 0.4, 0.5, -0.6]),
        1 => gripper.to_owned(),
        _ => forward.to_owned(),
    });
    let done = place.record("joints.txt", "visits.csv", &["", "", "q"]);
    drop(writer);
    let told = errors(&done);
    let text = place.text("visits.csv");
    let joints = [0.1_f64, 0.2, -0.3, 0.4, 0.5, -0.6].map(|q| format!("{:.6}", q.to_degrees()));
    assert_eq!(text.lines().count(), 3, "{told} {text}");
    for line in text.lines().skip(1) {
        let found: Vec<String> =
            line.split(',').skip(1).take(6).map(|c| format!("{:.6}", c.parse::<f64>().unwrap())).collect();
        assert_eq!(found, joints, "{told}");
    }
}

#[test]
fn an_arm_that_moves_a_file_that_rests_and_another_file_give_no_row() {
    let place = Place::new();
    let header = "t,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n";
    let writer = Writer::to(&place.path("moving.csv"), header, |k| format!("{k},{},2,3,4,5,6\n", k as f64 * 0.1));
    let told = errors(&place.record("moving.csv", "visits.csv", &[""]));
    assert!(told.contains("no row: joint 1 moved by") && told.contains("hold the arm still"), "{told}");
    drop(writer);
    let told = errors(&place.record("moving.csv", "visits.csv", &[""]));
    assert!(told.contains("nothing was added within 5 s"), "{told}");
    assert_eq!(place.text("visits.csv").lines().count(), 1);
    // a file with other columns is left alone; one whose last line was cut goes on behind it
    place.write("other.csv", "a,b\n1,2\n");
    let refused = place.record("moving.csv", "other.csv", &[""]);
    assert_eq!(refused.status.code(), Some(2));
    let told = errors(&refused);
    assert!(told.contains("other.csv: header: found \"a,b\", expected \"seq,q1_deg"), "{told}");
    assert_eq!(place.text("other.csv"), "a,b\n1,2\n");
    let writer = Writer::to(&place.path("still.csv"), header, |k| format!("{k},1,2,3,4,5,6\n"));
    place.write("visits.csv", place.text("visits.csv") + "7,1,2,3,4,5,6,fro");
    let done = place.record("still.csv", "visits.csv", &[""]);
    drop(writer);
    assert!(errors(&done).contains("line 2 did not end"));
    let text = place.text("visits.csv");
    assert_eq!(text.lines().last(), Some("8,1,2,3,4,5,6,front,1,0,0,0"), "{text}");
    // joints that the robot does not have, and units that are not the joint's own
    for header in ["q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,q7_deg", "q1_deg,q2_mm,q3_deg,q4_deg,q5_deg,q6_deg"] {
        place.write("feed.csv", format!("{header}\n"));
        let told = place.record("feed.csv", "visits.csv", &[""]);
        assert_eq!(told.status.code(), Some(2));
        assert!(errors(&told).contains("q2_deg (or _rad), q3_deg"), "{}", errors(&told));
    }
    let told = place.record("still.csv", "visits.mcap", &[""]);
    assert!(errors(&told).contains("expected the name of a CSV"), "{}", errors(&told));
    // every reader would take it for no place
    let told = place.run(&words("record --robot robot.toml --follow still.csv --place=NA --out visits.csv"));
    assert!(errors(&told).contains("none that stands for nothing"), "{}", errors(&told));
}

#[test]
fn rows_go_into_the_file_that_an_editor_has_put_in_the_place_of_the_recording() {
    let place = Place::new();
    let header = "t,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n";
    let _writer = Writer::to(&place.path("still.csv"), header, |k| format!("{k},1,2,3,4,5,6\n"));
    let record = "record --robot robot.toml --place front --follow still.csv --out visits.csv";
    let mut child = place.command(&words(record)).stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let (mut types, mut says) = (child.stdin.take().unwrap(), std::io::BufReader::new(child.stderr.take().unwrap()));
    let mut wait = |words: &str| {
        let mut line = String::new();
        while !line.contains(words) {
            line.clear();
            assert!(says.read_line(&mut line).unwrap() > 0, "{words}");
        }
    };
    types.write_all(b"\n2\n").unwrap();
    wait("row 1: front, socket 2");
    // the row that is wrong is taken out, as the note asks; the file is another one of that name
    let kept: Vec<String> = place.text("visits.csv").lines().take(2).map(str::to_owned).collect();
    place.write("edited.csv", kept.join("\n"));
    std::fs::rename(place.path("edited.csv"), place.path("visits.csv")).unwrap();
    types.write_all(b"3\nq\n").unwrap();
    wait("row 2: front, socket 3");
    assert!(child.wait().unwrap().success());
    let text = place.text("visits.csv");
    assert_eq!(text.lines().map(|l| l.split(',').next().unwrap()).collect::<Vec<_>>(), ["seq", "0", "2"], "{text}");
}

#[test]
fn a_plan_for_two_sockets_says_what_it_takes_as_known_and_without_a_place_what_places_are_worth() {
    let place = Place::new();
    let plan = |cell: &str, more: &[&str]| {
        place.write("cell.toml", cell);
        let o = place.run(&[&in_cell("plan --per-ball 12"), more].concat());
        (o.status.code(), String::from_utf8_lossy(&o.stdout).into_owned(), errors(&o))
    };
    let line = CELL.lines().find(|l| l.trim_start().starts_with("distances_mm")).unwrap();
    let known = CELL.replace(line, "distances_mm = { d12 = 300.0 }");
    let (code, told, wrong) = plan(&known, &["--out", "p.csv"]);
    assert_eq!(code, Some(0), "{wrong}");
    assert!(told.contains("Caution: with fewer than three balls") && told.contains("too good"), "{told}");
    // where they stand is not said: as in the guide
    let (code, told, wrong) = plan(SOCKETS, &[]);
    assert_eq!((code, wrong.as_str()), (Some(0), ""));
    assert!(told.starts_with("Expected error by number of unknown places") && told.lines().count() == 9, "{told}");
    let (code, told, _) = plan(SOCKETS, &["--json"]);
    let value: serde_json::Value = serde_json::from_str(&told).unwrap();
    assert_eq!((code, value["places"].as_array().unwrap().len()), (Some(0), 6));
    let (code, _, wrong) = plan(SOCKETS, &["--out", "q.csv"]);
    assert!(code == Some(2) && wrong.contains("'floor'") && wrong.contains("without --out"), "{wrong}");
    assert!(!place.path("q.csv").exists());
    let o = place.run(&in_cell("plan --points 5"));
    assert!(o.status.code() == Some(2) && errors(&o).contains("--out is missing"), "{}", errors(&o));
}

/// Two sockets that stand nobody knows where.
const SOCKETS: &str = "[base]\nxyz_mm = [0, 0, 0]\nzyx_deg = [0, 0, 0]\n[tool]\ntcp_mm = [15, -10, 120]\nmass_kg = 0.5\n\
                       cog_mm = [0, 0, 60]\n[balls]\ndistances_mm = { d12 = 50.0 }";

/// A controller that runs the RAPID server, whether it was asked to move, and whether it is to close the connection at the next question.
fn rapid_server() -> (String, Arc<AtomicBool>, Arc<AtomicBool>) {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let [moved, cut] = [(); 2].map(|()| Arc::new(AtomicBool::new(false)));
    let (behind, cuts) = (Arc::clone(&moved), Arc::clone(&cut));
    std::thread::spawn(move || {
        for mut stream in listener.incoming().flatten() {
            let (mut request, mut byte) = (String::new(), [0]);
            while std::io::Read::read(&mut stream, &mut byte).is_ok_and(|count| count == 1) {
                request.push(char::from(byte[0]));
                if byte[0] == b'#' {
                    if cuts.swap(false, Ordering::Relaxed) {
                        break;
                    }
                    let code = &request[..2];
                    let data = match code {
                        "24" => "TriCal 1 6 5.000",
                        "04" => "1.5 -2.0 0.0 -0.00001 45.0 180.25",
                        "21" => "12.500",
                        _ => "",
                    };
                    if ["02", "20"].contains(&code) {
                        behind.store(true, Ordering::Relaxed);
                    }
                    let _ = stream.write_all(format!("{code} 1 {data}#").as_bytes());
                    request.clear();
                }
            }
        }
    });
    (address, moved, cut)
}

#[test]
fn joints_come_from_each_controller_that_is_known_and_nothing_is_moved() {
    let place = Place::new();
    let (ur, behind_ur) = crate::ur_server::server();
    let (rws, behind_rws) = crate::rws_server::server();
    let (rapid, moved, _) = rapid_server();
    behind_ur.lock().unwrap().q = [1.5, -2.0, 0.0, -0.00001, 45.0, 180.25].map(f64::to_radians);
    let urls = [
        format!("rapid://{rapid}?settle_ms=1"),
        format!("rws://{rws}?login=factory&settle_ms=1"),
        format!("ur://127.0.0.1?rtde_port={}&script_port={}&settle_ms=1", ur.rtde_port, ur.script_port),
    ];
    for (k, url) in urls.iter().enumerate() {
        let out = format!("{k}.csv");
        let done = place.record_from(["--controller", url], &out, &["", "2", "q"]);
        let told = errors(&done);
        assert!(done.status.success(), "{url}: {told}");
        let text = place.text(&out);
        let rows: Vec<Vec<&str>> = text.lines().skip(1).map(|l| l.split(',').collect()).collect();
        assert_eq!(rows.len(), 2, "{url}: {told}");
        for (row, socket) in rows.iter().zip(["1", "2"]) {
            let joints: Vec<f64> = row[1..7].iter().map(|q| q.parse().unwrap()).collect();
            let far =
                joints.iter().zip([1.5, -2.0, 0.0, -0.00001, 45.0, 180.25]).map(|(a, b): (&f64, f64)| (a - b).abs());
            assert!(far.fold(0.0, f64::max) < 2e-5, "{url}: {text}");
            assert_eq!(row[7..], ["front", socket, "0", "0", "0"], "{url}");
        }
    }
    assert!(!moved.load(Ordering::Relaxed));
    assert!(behind_ur.lock().unwrap().programs.is_empty(), "no program was sent");
    assert!(behind_rws.lock().unwrap().seen.is_empty(), "nothing was asked of the module");
    // a controller that is not there
    let done = place.record_from(["--controller", "rapid://127.0.0.1:1?timeout_s=0.2"], "no.csv", &[""]);
    assert_eq!(done.status.code(), Some(2));
    assert!(errors(&done).contains("127.0.0.1:1"), "{done:?}");
}

#[test]
fn a_controller_that_went_away_is_opened_anew_at_the_next_key_and_no_row_is_made_up() {
    let place = Place::new();
    let (address, moved, cut) = rapid_server();
    let record = format!("record --controller rapid://{address}?settle_ms=1&timeout_s=2 --place 1 --out visits.csv");
    let (mut taken, _) = Typed::start(&place, &record);
    assert!(taken.says().contains("p NAME"));
    let first = taken.types("1");
    assert!(first.contains("row 0: 1, socket 1"), "{first}");
    cut.store(true, Ordering::Relaxed);
    let lost = taken.types("2");
    assert!(lost.contains("no row: ") && lost.contains(&address), "{lost}");
    assert!(taken.types("2").contains("row 1: 1, socket 2"));
    taken.ends();
    assert_eq!(place.text("visits.csv").lines().count(), 3);
    assert!(!moved.load(Ordering::Relaxed));
}

/// A program that is typed to, and what it says on standard error.
struct Typed(std::process::Child, std::io::BufReader<std::process::ChildStderr>);

impl Typed {
    fn start(place: &Place, command: &str) -> (Self, std::io::BufReader<std::process::ChildStdout>) {
        let mut command = place.command(&in_cell(command));
        let piped = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = piped.spawn().unwrap();
        let (out, err) = (child.stdout.take().unwrap(), child.stderr.take().unwrap());
        (Self(child, std::io::BufReader::new(err)), std::io::BufReader::new(out))
    }

    fn says(&mut self) -> String {
        let mut line = String::new();
        self.1.read_line(&mut line).unwrap();
        line
    }

    fn types(&mut self, line: &str) -> String {
        writeln!(self.0.stdin.as_mut().unwrap(), "{line}").unwrap();
        self.says()
    }

    fn ends(mut self) {
        writeln!(self.0.stdin.as_mut().unwrap(), "q").unwrap();
        assert!(self.0.wait().unwrap().success());
    }
}

#[test]
fn a_virtual_person_guides_an_arm_into_sockets_and_it_is_calibrated_from_what_was_taken_down() {
    let place = Place::new();
    place.write("cell.toml", SOCKETS);
    let (mut person, mut links) = Typed::start(&place, "virtual-cell --sockets --port 0 --noise-mm 0.05 --json");
    let mut line = String::new();
    links.read_line(&mut line).unwrap();
    let url = line.split('"').find(|word| word.starts_with("rapid://")).unwrap();
    let (mut taken, _) = Typed::start(&place, &format!("record --controller {url} --place 1 --out visits.csv"));
    // what they say at first: that the cell answers, and what to type
    let first = (person.says(), person.says(), taken.says());
    assert!(first.1.contains("p NAME") && first.2.contains("p NAME"), "{first:?}");
    for at in 1..=4 {
        if at > 1 {
            assert_eq!(person.types(&format!("p {at}")), format!("the block stands at {at}\n"));
            writeln!(taken.0.stdin.as_mut().unwrap(), "p {at}").unwrap();
        }
        for socket in ["1", "2"] {
            for _ in 0..10 {
                assert!(person.types(socket).contains(&format!("socket {socket}: the ball is in it")));
                let row = taken.types(socket);
                assert!(row.contains(&format!("{at}, socket {socket}, ")), "{row}");
            }
        }
    }
    assert!(person.types("3").contains("found socket 3, and the cell has 2"));
    taken.ends();
    person.ends();
    let found = place.json(&in_cell("identify visits.csv --out arm.toml --json"));
    assert_eq!(found["poses"], 80);
    let [nominal, identified] = ["mean_nominal_mm", "mean_mm"].map(|of| found[of].as_f64().unwrap());
    assert!(nominal > 0.3 && identified < 0.1, "{nominal} {identified}");
}
