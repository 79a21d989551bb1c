//! Gauge, robot and measurement from the command line, against a virtual cell in a process of its own.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::common::{CELL, CELL_ARGS, Place, ROBOT, errors, in_cell, words};

/// A virtual cell; it ends with the test.
struct Cell {
    child: Child,
    gauge: String,
    controller: String,
}

impl Drop for Cell {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A folder with arm, cell and a plan of so many touches a ball.
fn planned(per_ball: usize) -> Place {
    let p = Place::new();
    p.good(&in_cell(&format!("plan --per-ball {per_ball} --out plan.csv")));
    p
}

impl Place {
    fn cell(&self, more: &[&str]) -> Cell {
        let mut child = self
            .command(&[&in_cell("virtual-cell --port 0"), more].concat())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let urls: Vec<&str> = line.split('\'').collect();
        Cell { gauge: urls[1].to_owned(), controller: urls[3].to_owned(), child }
    }

    fn joints(&self, cell: &Cell) -> serde_json::Value {
        self.json(&["robot", "joints", "--controller", &cell.controller, "--json"])["joints_deg"].clone()
    }

    fn measure(&self, cell: &Cell, more: &[&str]) -> Output {
        self.run(&measure_args(cell, more))
    }

    fn rows(&self, mcap: &str) -> Vec<String> {
        self.good(&["convert", mcap, "rows.csv"]);
        self.text("rows.csv").lines().skip(1).map(str::to_owned).collect()
    }
}

fn measure_args<'a>(cell: &'a Cell, more: &[&'a str]) -> Vec<&'a str> {
    let links = ["--plan", "plan.csv", "--gauge", &cell.gauge, "--controller", &cell.controller, "--out", "run.mcap"];
    [&["measure"][..], &CELL_ARGS, &links, more].concat()
}

/// Refused with one sentence that has the words.
fn refused(o: &Output, code: i32, words: &str) {
    let err = errors(o);
    assert_eq!(o.status.code(), Some(code), "{err}");
    assert_eq!(err.trim().lines().filter(|l| !l.starts_with("trical: note")).count(), 1, "{err}");
    assert!(err.contains(words), "'{words}' is missing in: {err}");
}

#[test]
fn a_gauge_is_listed_tested_watched_and_mastered() {
    let place = Place::new();
    let cell = place.cell(&[]);
    assert!(place.json(&words("gauge list --json"))["ports"].is_array());
    let told = place.json(&["gauge", "test", "--gauge", &cell.gauge, "--count", "5", "--json"]);
    assert_eq!((told["readings"].as_u64(), told["axes"].as_array().unwrap().len()), (Some(5), 3));
    assert!(told["says"][1].as_str().unwrap().contains("axis x"), "{told}");
    let said = place.good(&["gauge", "watch", "--gauge", &cell.gauge, "--count", "3", "--every-ms", "1", "--json"]);
    let lines: Vec<serde_json::Value> = said.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    assert_eq!((lines.len(), lines[0]["ix_mm"].as_f64()), (3, Some(6.0)), "free stems are extended");
    // what is shown on the calibrator is zero from then on
    let mastered = place.json(&["gauge", "zero", "--gauge", &cell.gauge, "--json"]);
    let url = mastered["gauge"].as_str().unwrap();
    let shown = place.json(&["gauge", "watch", "--gauge", url, "--count", "1", "--json"]);
    assert_eq!(shown["iz_mm"].as_f64(), Some(0.0));
    let again = place.json(&["gauge", "zero", "--gauge", url, "--json"]);
    assert_eq!(again["zero_mm"], mastered["zero_mm"], "mastering twice does not add up");
    // nobody pushes a stem here
    let o = place.run(&["gauge", "test", "--gauge", &cell.gauge, "--stems", "--wait-s", "0.1"]);
    assert_eq!(o.status.code(), Some(1));
    assert!(errors(&o).contains("axis x did not move"), "{}", errors(&o));
    refused(&place.run(&["gauge", "watch", "--gauge", "uwave:///dev/none"]), 2, "/dev/none: cannot be opened");
    refused(&place.run(&["gauge", "watch", "--gauge", "usb:///dev/none"]), 2, "unknown gauge \"usb\"");
}

#[test]
fn a_robot_is_pinged_read_and_jogged_with_go_only() {
    let place = Place::new();
    let cell = place.cell(&["--start-deg", "0,10,20,0,45,0"]);
    let c = cell.controller.as_str();
    assert_eq!(place.json(&["robot", "ping", "--controller", c, "--json"])["joints"], 6);
    let joints = || place.joints(&cell);
    let start = serde_json::json!([0.0, 10.0, 20.0, 0.0, 45.0, 0.0]);
    assert_eq!(joints(), start);
    let jog =
        |more: &[&str]| place.run(&[&["robot", "jog", "--controller", c, "--robot", "robot.toml"][..], more].concat());
    let dry = jog(&["--joint", "2", "--by-deg", "3"]);
    assert!(String::from_utf8_lossy(&dry.stdout).contains("Nothing has moved"));
    assert_eq!(joints(), start);
    assert!(jog(&["--joint", "2", "--by-deg", "3", "--go"]).status.success());
    assert_eq!(joints()[1], 13.0);
    assert!(jog(&["--tool-mm", "0,0,-2", "--go"]).status.success());
    assert_ne!(joints()[1], 13.0);
    refused(&jog(&["--joint", "2", "--by-deg", "30", "--go"]), 2, "the limit is 5 deg (--max-deg)");
    refused(&jog(&["--joint", "2", "--by-deg", "300", "--max-deg", "400", "--go"]), 2, "outside its limits");
    refused(
        &jog(&["--joint", "2", "--by-deg", "30", "--max-deg", "nan", "--go"]),
        2,
        "expected more than 0 and up to 720",
    );
    refused(&jog(&["--joint", "7", "--by-deg", "1", "--go"]), 2, "expected 1 to 6");
    refused(&jog(&["--tool-mm", "0,0,9", "--go"]), 2, "5 mm at most");
    refused(&place.run(&["robot", "ping", "--controller", "rapid://127.0.0.1:1"]), 2, "cannot connect");
}

#[test]
fn a_run_is_printed_whole_without_go_even_without_devices() {
    let place = planned(2);
    let devices = "--gauge uwave:///dev/none --controller rapid://127.0.0.1:1";
    let measure = format!("measure --plan plan.csv {devices} --out run.mcap --epsilon-mm 0.005");
    let o = place.run(&in_cell(&measure));
    let (out, err) = (String::from_utf8_lossy(&o.stdout), errors(&o));
    assert!(o.status.success(), "{err}");
    for touch in 1..=6 {
        assert!(out.contains(&format!("touch {touch} (ball")), "{out}");
    }
    assert!(out.contains("Nothing has moved") && !place.path("run.mcap").exists());
    assert!(err.contains("below the arm's repeatability") && err.contains("/dev/none"), "{err}");
    // a plan beyond a limit is shown with the reason, and is an error
    let mut lines: Vec<String> = place.text("plan.csv").lines().map(str::to_owned).collect();
    let mut words: Vec<String> = lines[2].split(',').map(str::to_owned).collect();
    // the upper arm lies down into the floor
    words[3] = "109.0".to_owned();
    lines[2] = words.join(",");
    place.write("plan.csv", lines.join("\n"));
    let cell = place.cell(&[]);
    let o = place.measure(&cell, &[]);
    let out = String::from_utf8_lossy(&o.stdout);
    assert_eq!(o.status.code(), Some(1), "{out}");
    assert!(out.contains("REFUSED"), "{out}");
    let err = errors(&place.measure(&cell, &["--go"]));
    assert!(err.contains("nothing has moved"), "{err}");
}

#[test]
fn repeat_visits_show_a_hidden_lost_motion() {
    let place = planned(4);
    let scatter = |more: &[&str], name: &str| {
        let cell = place.cell(&[&["--placement-mm", "0.002"][..], more].concat());
        let links = ["--plan", "plan.csv", "--gauge", &cell.gauge, "--controller", &cell.controller, "--out", name];
        let measure = [&["measure"][..], &CELL_ARGS, &links, &["--go", "--visits", "6", "--json"]].concat();
        assert_eq!(place.json(&measure)["measured"], 72);
        place.json(&["repeatability", name, "--json"])["recordings"][0].clone()
    };
    let joint = |told: &serde_json::Value, j: usize| {
        let all = told["by_joint_sense"].as_array().unwrap();
        let found = all.iter().find(|x| x["joint"] == j).unwrap();
        (found["difference_mm"].as_f64().unwrap(), found["sd_mm"].as_f64().unwrap())
    };
    let well = scatter(&[], "well.mcap");
    // at twice the usual size a gap may swallow a whole correction: then a longer one follows
    let worn = scatter(&["--hide", "lost_motion_direction@2*2"], "worn.mcap");
    assert_eq!(well["by_ball"].as_array().unwrap().len(), 3);
    assert_eq!(well["places"].as_array().unwrap().len(), 12);
    let (good, bad) = (joint(&well, 2), joint(&worn, 2));
    assert!(bad.0 > 10.0 * good.0 && bad.0 > 0.03, "{good:?} {bad:?}");
    assert!(good.0 < 6.0 * good.1, "{good:?}");
    let rp = |told: &serde_json::Value| told["by_ball"][0]["mean_rp_mm"].as_f64().unwrap();
    // a place's l for normal noise of 2 um on each axis: mean 3.2, sd 1.35, so RP is about 7 um
    assert!((0.003..0.012).contains(&rp(&well)), "{}", rp(&well));
    assert!(rp(&worn) > 2.0 * rp(&well), "{} {}", rp(&worn), rp(&well));
    // the same from the CSV, which has no files inside
    place.good(&["convert", "worn.mcap", "worn.csv"]);
    refused(&place.run(&["repeatability", "worn.csv"]), 2, "expected a robot and a cell");
    let csv = place.json(&in_cell("repeatability worn.csv --json"));
    assert_eq!(csv["recordings"][0]["by_ball"], worn["by_ball"]);
    // one visit each says nothing
    let columns = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm";
    place.write("one.csv", format!("{columns}\n0,0,0,0,0,0,1,2,3\n9,0,0,0,0,0,1,2,3\n"));
    refused(&place.run(&["repeatability", "one.csv"]), 2, "no place was visited twice");
}

#[test]
fn touches_are_measured_with_a_receiver_on_a_port_of_the_network() {
    let place = planned(3);
    let cell = place.cell(&["--gauge-port", "0"]);
    assert!(cell.gauge.starts_with("uwave://127.0.0.1:"), "{}", cell.gauge);
    let done = place.measure(&cell, &["--go"]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    assert_eq!(place.rows("run.mcap").len(), 9);
}

#[test]
fn scripted_faults_stop_the_run_and_resume_completes_it() {
    let place = planned(3);
    place.write("f.toml", "[[fault]]\nwhat = \"drop_connection\"\nafter_motions = 9\nlasts = 1\n");
    refused(&place.run(&in_cell("virtual-cell --port 0 --faults robot.toml")), 2, "robot.toml: line");
    // the connection is lost for good: the arm stands wherever it was
    let cell = place.cell(&["--faults", "f.toml"]);
    let o = place.measure(&cell, &["--go"]);
    assert_eq!(o.status.code(), Some(1));
    assert!(errors(&o).contains("; what was measured is safe, --resume goes on"), "{}", errors(&o));
    let before = place.rows("run.mcap");
    // what would be done now: the recording counts, and without --resume it stands in the way
    refused(&place.measure(&cell, &[]), 2, "exists already");
    let dry = place.json(&measure_args(&cell, &["--resume", "--json"]));
    assert_eq!(dry["skipped"], before.len());
    drop(cell);
    // another cell of the same seed, as after a restart of the controller
    let cell = place.cell(&["--radio-ms", "3"]);
    let told = place.json(&measure_args(&cell, &["--go", "--resume", "--json"]));
    assert_eq!(told["skipped"].as_u64().unwrap() + told["measured"].as_u64().unwrap(), 9);
    let after = place.rows("run.mcap");
    assert_eq!((after.len(), &after[..before.len()]), (9, &before[..]));
    refused(&place.measure(&cell, &["--go"]), 2, "exists already");
}

#[test]
fn a_measuring_process_that_is_killed_is_taken_up_from_where_the_arm_stands() {
    let place = planned(4);
    let cell = place.cell(&["--pace", "0.004"]);
    let mut runs = 0;
    loop {
        runs += 1;
        let resume: &[&str] = if place.path("run.mcap").exists() { &["--go", "--resume"] } else { &["--go"] };
        let mut child = place.command(&measure_args(&cell, resume)).stderr(Stdio::piped()).spawn().unwrap();
        let begin = Instant::now();
        // 12 touches take about 2 s: killed in the middle of anything, then let go
        let done = loop {
            if let Some(status) = child.try_wait().unwrap() {
                break Some(status);
            }
            if runs < 4 && begin.elapsed() > Duration::from_millis(350 + 137 * runs) {
                break None;
            }
            std::thread::sleep(Duration::from_millis(5));
        };
        match done {
            Some(status) => {
                let mut err = String::new();
                std::io::Read::read_to_string(&mut child.stderr.take().unwrap(), &mut err).unwrap();
                assert!(status.success(), "run {runs}: {err}");
                break;
            }
            None => child.kill().and_then(|()| child.wait()).unwrap(),
        };
    }
    assert!(runs >= 2, "it was never killed");
    assert_eq!(place.rows("run.mcap").len(), 12);
}

#[cfg(unix)]
fn signal(name: &str, child: &Child) {
    Command::new("kill").args([name, &child.id().to_string()]).status().unwrap();
}

#[cfg(unix)]
#[test]
fn ctrl_c_makes_the_arm_go_back_and_a_second_one_ends_at_once() {
    let place = planned(4);
    let cell = place.cell(&["--pace", "0.01"]);
    let started = |args: &[&str]| {
        use std::os::unix::fs::MetadataExt;
        let file = || std::fs::metadata(place.path("run.mcap")).ok().map(|m| m.ino());
        let before = file();
        let child = place.command(&measure_args(&cell, args)).stderr(Stdio::piped()).spawn().unwrap();
        // Ctrl-C is watched before the recording begins
        while file() == before {
            std::thread::sleep(Duration::from_millis(2));
        }
        child
    };
    let child = started(&["--go"]);
    signal("-INT", &child);
    let o = child.wait_with_output().unwrap();
    let err = errors(&o);
    assert_eq!(o.status.code(), Some(1), "{err}");
    assert!(err.contains("stopped by the user") && !err.contains("NOT"), "{err}");
    let child = started(&["--go", "--resume"]);
    signal("-INT", &child);
    std::thread::sleep(Duration::from_millis(5));
    signal("-INT", &child);
    let o = child.wait_with_output().unwrap();
    assert!(matches!(o.status.code(), Some(130 | 1)), "{:?} {}", o.status, errors(&o));
    // whatever came of it, the rest can be measured
    place.good(&measure_args(&cell, &["--go", "--resume"]));
    assert_eq!(place.rows("run.mcap").len(), 12);
}

#[test]
fn a_person_is_led_from_mastering_to_a_recording_that_identifies() {
    let place = planned(4);
    // a cell file that is wrong by millimetres and a degree, as a tape measure leaves it
    let cell = place.cell(&[]);
    let plan = place.text("plan.csv");
    let wrong = CELL.replace("tcp_mm = [18.0, -12.0, 118.0]", "tcp_mm = [19.0, -11.2, 117.3]");
    assert_ne!(wrong, CELL);
    place.write("cell.toml", wrong);
    let entries: Vec<Vec<&str>> = plan.lines().skip(1).map(|l| l.split(',').collect()).collect();
    let of = |ball: &str| (0..entries.len()).filter(|k| entries[*k][1] == ball).collect::<Vec<_>>();
    let (approach, touch) = (|k: usize| entries[k][8..14].join(","), |k: usize| entries[k][2..8].join(","));
    // free places in the order of the plan, each reached straight from its neighbours: the arm goes along them
    let mut free = vec!["0,0,0,0,0,0".to_owned()];
    let mut approaches = Vec::new();
    for (k, e) in entries.iter().enumerate() {
        free.extend(e[14].split(';').filter(|q| !q.trim().is_empty()).map(|q| q.trim().replace(' ', ",")));
        approaches.push(free.len());
        free.push(approach(k));
    }
    let stands = std::cell::Cell::new(0);
    let along = |to: usize, says: &mut Vec<String>| {
        while stands.get() != to {
            stands.set(if stands.get() < to { stands.get() + 1 } else { stands.get() - 1 });
            says.push(free[stands.get()].clone());
        }
    };
    let mut says = vec!["s".to_owned()];
    let go = |k: usize, says: &mut Vec<String>| {
        along(approaches[k], says);
        says.extend([touch(k), String::new(), approach(k)]);
    };
    for (k, e) in of("1").into_iter().enumerate() {
        go(e, &mut says);
        if k == 0 || k == 3 {
            // the first orientation once more, which is told; the tool point is asked for before the arm is driven away
            let last = says.pop().unwrap();
            says.extend([String::new(), last]);
        }
    }
    // balls 2 and 3 exchanged: the distances are equal, the arm would hang from the ceiling
    for ball in ["1", "3", "2"] {
        go(of(ball)[0], &mut says);
    }
    says.extend(["b", "s"].map(str::to_owned));
    for ball in ["2", "3"] {
        go(of(ball)[0], &mut says);
    }
    // straight there the arm would meet something
    says.push("0,109,0,0,0,0".to_owned());
    along(0, &mut says);
    says.extend(["nonsense", "", ""].map(str::to_owned));
    let (o, out) = guided(&place, &cell, &["--go", "--per-ball", "12"], &says);
    assert!(o.status.success(), "{out}\n{}", errors(&o));
    for words in [
        "Mastering",
        "Touched and recorded, after",
        "turned by 0.0 degrees only from orientation 1",
        "orientation 4 of 4",
        "The tool point lies at",
        "apart, the cell file says",
        "were the balls touched in another order",
        "not understood",
        "and was not driven",
        "36 touches measured",
    ] {
        assert!(out.contains(words), "'{words}' is missing in:\n{out}");
    }
    // the tool point has been found to what the arm is off before calibration
    let table: toml::Table = place.text("led.cell.toml").parse().unwrap();
    let tcp: Vec<f64> = table["tool"]["tcp_mm"].as_array().unwrap().iter().map(|v| v.as_float().unwrap()).collect();
    for (found, truth) in tcp.iter().zip([18.0, -12.0, 118.0]) {
        assert!((found - truth).abs() < 1.0, "{tcp:?}");
    }
    let told = place.json(&words("identify led.mcap --robot robot.toml --cell led.cell.toml --json"));
    assert_eq!(told["observations"], 36);
    assert!(told["rms_mm"].as_f64().unwrap() < 0.02, "{}", told["rms_mm"]);
}

/// A guided session in which a person types these lines; what it says, in one line.
fn guided(place: &Place, cell: &Cell, more: &[&str], says: &[String]) -> (Output, String) {
    let links = ["--gauge", &cell.gauge, "--controller", &cell.controller, "--out", "led.mcap", "--guided"];
    let o = place.typed(&[&["measure"][..], &CELL_ARGS, &links, more].concat(), &(says.join("\n") + "\n"));
    let said = String::from_utf8_lossy(&o.stdout).split_whitespace().collect::<Vec<_>>().join(" ");
    (o, said)
}

/// All of these are said, in this order.
fn says_in_order(said: &str, words: &[&str]) {
    let mut from = 0;
    for word in words {
        let found = said[from..].find(word);
        from +=
            found.unwrap_or_else(|| panic!("'{word}' is missing behind '{}' in:\n{said}", &said[..from])) + word.len();
    }
}

#[test]
fn a_guided_session_shows_itself_first_and_goes_on_where_it_was_left() {
    let place = planned(4);
    let cell = place.cell(&[]);
    let plan = place.text("plan.csv");
    let entry: Vec<&str> = plan.lines().nth(1).unwrap().split(',').collect();
    let mut way: Vec<String> =
        entry[14].split(';').filter(|q| !q.trim().is_empty()).map(|q| q.trim().replace(' ', ",")).collect();
    let (approach, touch) = (entry[8..14].join(","), entry[2..8].join(","));
    way.extend([approach.clone(), touch]);
    let lines = |lines: &[&str]| lines.iter().map(|line| (*line).to_owned()).collect::<Vec<_>>();

    // without --go: everything is told, nothing moves, nothing is written
    let (o, said) = guided(&place, &cell, &["--per-ball", "4"], &[]);
    assert!(o.status.success(), "{}", errors(&o));
    let steps = ["1. Mastering", "ball 1 in 4 orientations", "balls 1, 2, 3", "12 touches", "move to the touch"];
    says_in_order(&said, &[&steps[..], &["Nothing has moved"]].concat());
    assert!(!place.path("led.guided.json").exists() && !place.path("led.plan.csv").exists());

    // mastering refuses stems in the air; then one touch, and the end
    let mut first = lines(&["", "", ""]);
    first.extend(way);
    first.extend(lines(&["", "", "q"]));
    let (o, said) = guided(&place, &cell, &["--go"], &first);
    refused(&o, 1, "--guided --resume goes on with this step");
    says_in_order(
        &said,
        &["the stem along x reads", "in the air", "The calibrator reads", "orientation 1 of 4", "orientation 2 of 4"],
    );
    let (o, _) = guided(&place, &cell, &["--go"], &[]);
    refused(&o, 2, "exists already; --resume goes on with it");

    // it goes on with the second touch and the mastering, back to the first, which is kept; tool point and base are skipped
    let mut second = lines(&["b", "s", "s", "b", "s", "s", "s"]);
    second.extend([approach, String::new()]);
    second.extend(lines(&["b", "", "q"]));
    let (o, said) = guided(&place, &cell, &["--go", "--resume", "--per-ball", "4"], &second);
    refused(&o, 1, "ended by the user");
    assert!(!said.contains("1. Mastering") && !said.contains("No tool point"), "{said}");
    says_in_order(
        &said,
        &[
            "orientation 2 of 4",
            "orientation 1 of 4",
            "touched already",
            "orientation 2 of 4",
            "Ball 1.",
            // back from the balls: to the first orientation that is missing
            "orientation 2 of 4",
            "Ball 1.",
            "12 touches are planned",
            "Is everybody out",
            "4. Plan",
            "12 touches are planned",
        ],
    );

    // the measurement, with the plan that was made; the ball stood in for the calibrator, so free stems read less than 5.9 mm
    let (o, said) = guided(&place, &cell, &["--go", "--resume", "--stroke-mm=-5.9,4.5"], &lines(&[""]));
    assert!(o.status.success(), "{said}\n{}", errors(&o));
    let next = "trical identify led.mcap --robot robot.toml --cell led.cell.toml";
    says_in_order(&said, &["5. Measurement", "12 touches measured", next]);
    assert!(!said.contains("4. Plan"), "{said}");
    assert_eq!(place.rows("led.setup.mcap").len(), 1, "one touch");
}

#[test]
fn an_arm_of_another_number_of_joints_is_not_led() {
    let place = planned(1);
    let cell = place.cell(&[]);
    let (five, _) = ROBOT.rsplit_once("[[joint]]").unwrap();
    place.write("robot.toml", five);
    place.write("cell.toml", CELL.split_once("\n[geometry").unwrap().0);
    let says = ["s", "0,0,0,0,0", "q"].map(str::to_owned);
    let (o, said) = guided(&place, &cell, &["--go"], &says);
    refused(&o, 1, "ended by the user");
    says_in_order(&said, &["That did not work", "says that its arm has 6 joints, ABB IRB 120-3/0.6 has 5."]);
    assert!(!place.path("led.mcap").exists());
}

#[test]
fn a_recording_is_gone_on_with_by_its_own_plan_only() {
    let place = planned(2);
    let cell = place.cell(&[]);
    place.good(&measure_args(&cell, &["--go"]));
    place.good(&in_cell("plan --per-ball 2 --seed 7 --out other.csv"));
    let links = ["--gauge", &cell.gauge, "--controller", &cell.controller, "--out", "run.mcap", "--go", "--resume"];
    let other = [&["measure"][..], &CELL_ARGS, &links, &["--plan", "other.csv", "--visits", "2"]].concat();
    refused(&place.run(&other), 2, "run.mcap: was recorded with another plan");
    assert_eq!(place.rows("run.mcap").len(), 6);
    // more visits of the same plan are welcome
    place.good(&measure_args(&cell, &["--go", "--resume", "--visits", "2"]));
    assert_eq!(place.rows("run.mcap").len(), 12);
}

#[test]
fn two_sessions_do_not_write_one_recording() {
    let place = planned(4);
    let cell = place.cell(&["--pace", "0.01"]);
    let mut first = place.command(&measure_args(&cell, &["--go"])).spawn().unwrap();
    while !place.path("run.mcap").exists() {
        std::thread::sleep(Duration::from_millis(2));
    }
    for more in [&["--go"][..], &["--go", "--resume"]] {
        refused(&place.measure(&cell, more), 2, "run.mcap: another program is writing it");
    }
    assert!(first.wait().unwrap().success());
    assert_eq!(place.rows("run.mcap").len(), 12);
}

#[test]
fn what_a_command_reads_it_does_not_replace() {
    let place = planned(2);
    let measure = "measure --go --gauge uwave:///dev/none --controller rapid://127.0.0.1:1 --plan plan.csv";
    refused(&place.run(&in_cell("plan --per-ball 2 --out robot.toml")), 2, "expected a name that ends in .csv");
    for (command, out) in [(&*format!("{measure} --resume"), "cell.toml"), (measure, "./plan.csv")] {
        let o = place.run(&in_cell(&format!("{command} --out {out}")));
        refused(&o, 2, &format!("{out}: is read, too, and would be replaced"));
    }
    refused(&place.run(&["convert", "plan.csv", "plan.csv"]), 2, "plan.csv: is read, too");
    assert_eq!(place.text("robot.toml"), ROBOT);
}

#[test]
fn pipes_and_devices_are_no_recordings() {
    let place = Place::new();
    assert!(Command::new("mkfifo").arg(place.path("pipe.mcap")).status().unwrap().success());
    for name in ["/dev/urandom", "/dev/zero", "pipe.mcap"] {
        refused(&place.run(&["convert", name, "out.csv"]), 2, &format!("{name}: is a pipe or a device"));
    }
    let sparse = std::fs::File::create(place.path("huge.mcap")).unwrap();
    sparse.set_len(5 << 30).unwrap();
    refused(&place.run(&["convert", "huge.mcap", "out.csv"]), 2, "huge.mcap: has 5120 MiB");
}

#[test]
fn settings_that_no_measurement_has_are_refused_and_lists_may_begin_with_a_minus() {
    let place = planned(2);
    let cell = place.cell(&["--start-deg", "-1,10,20,0,45,0"]);
    for (option, value, words) in [
        ("--epsilon-mm", "1e9", "tolerance of a touch: found 1000000000 mm, expected 0.0001 to 1"),
        ("--epsilon-mm", "nan", "tolerance of a touch: found NaN mm"),
        ("--travel-mm-s", "inf", "speed between the balls: found inf mm/s"),
        ("--max-sum-mm", "-1", "longest sum of corrections"),
    ] {
        refused(&place.measure(&cell, &[&format!("{option}={value}"), "--go"]), 2, words);
    }
    assert!(!place.path("run.mcap").exists());
    let said =
        place.good(&words(&format!("robot jog --controller {} --robot robot.toml --tool-mm -1,0,0", cell.controller)));
    assert!(said.contains("Nothing has moved"), "{said}");
    place.good(&measure_args(&cell, &["--stroke-mm", "-5.8,5.9"]));
}

#[test]
fn a_standard_error_that_nobody_reads_does_not_end_a_run() {
    let place = planned(2);
    let cell = place.cell(&["--placement-mm", "0.001"]);
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    // the tolerance is warned about
    let args = measure_args(&cell, &["--go", "--epsilon-mm", "0.008", "--max-corrections", "100"]);
    let status = place.command(&args).stderr(full).status().unwrap();
    assert!(status.success(), "{status:?}");
    assert_eq!(place.rows("run.mcap").len(), 6);
}

#[cfg(unix)]
#[test]
fn ctrl_c_and_a_closed_terminal_stop_the_arm_in_the_middle_of_a_motion() {
    let place = planned(2);
    for (name, out) in [("-INT", "int.mcap"), ("-HUP", "hup.mcap"), ("-TERM", "term.mcap")] {
        // motions as slow as a real arm's
        let cell = place.cell(&["--pace", "1"]);
        let links = ["--plan", "plan.csv", "--gauge", &cell.gauge, "--controller", &cell.controller, "--out", out];
        let mut command =
            place.command(&[&["measure"][..], &CELL_ARGS, &links, &["--go", "--travel-mm-s", "20"]].concat());
        let child = command.stderr(Stdio::piped()).spawn().unwrap();
        while !place.path(out).exists() {
            std::thread::sleep(Duration::from_millis(2));
        }
        std::thread::sleep(Duration::from_millis(400));
        let begin = Instant::now();
        signal(name, &child);
        let o = child.wait_with_output().unwrap();
        assert!(begin.elapsed() < Duration::from_secs(2), "{:?}", begin.elapsed());
        refused(&o, 1, "stopped by the user in the middle of a motion; the arm stands where it was stopped");
        let stands = place.joints(&cell);
        std::thread::sleep(Duration::from_millis(300));
        assert_eq!(place.joints(&cell), stands, "it still moves");
        assert_ne!(stands, serde_json::json!([0.0, 0.0, 0.0, 0.0, 0.0, 0.0]), "it never moved");
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_stops_a_jog() {
    let place = Place::new();
    let cell = place.cell(&["--pace", "1"]);
    let jog = format!("robot jog --controller {} --joint 1 --by-deg 5 --speed-mm-s 1 --go", cell.controller);
    let child = place.command(&words(&jog)).stderr(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(800));
    let begin = Instant::now();
    signal("-INT", &child);
    let o = child.wait_with_output().unwrap();
    assert!(begin.elapsed() < Duration::from_secs(3), "{:?}", begin.elapsed());
    refused(&o, 1, "stopped by the user in the middle of a motion");
}

#[test]
fn who_does_not_know_the_secret_is_told_and_moves_nothing() {
    let place = planned(2);
    let cell = place.cell(&["--secret", "Torx25kanne"]);
    assert!(cell.controller.ends_with("&secret=Torx25kanne"), "{}", cell.controller);
    place.write("secret.txt", "Torx25kanne\n");
    let bare = cell.controller.trim_end_matches("&secret=Torx25kanne").to_owned();
    let ping = |more: &str| place.run(&["robot", "ping", "--controller", &format!("{bare}{more}")]);
    assert!(ping("&secret=@secret.txt").status.success());
    refused(&ping(""), 2, "secret expected");
    refused(&ping("&secret=Torx25kannen"), 2, "wrong secret");
    let refusal = place.run(&in_cell("virtual-cell --secret short"));
    refused(&refusal, 2, "--secret: expected 8 to 40 letters and digits, or none");
    // a recording does not have it
    place.good(&measure_args(&cell, &["--go"]));
    let recorded = place.bytes("run.mcap");
    assert!(!recorded.windows(11).any(|w| w == b"Torx25kanne"));
    assert!(recorded.windows(10).any(|w| w == b"secret=..."));
}
