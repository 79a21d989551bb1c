//! The program as its users meet it: what it prints, what it leaves, how it refuses.

use std::path::Path;

use crate::common::{CELL, CELL_ARGS, Place, ROBOT, errors, in_cell, measured_anew, words};

impl Place {
    /// Refused as bad input: one sentence that has `words`, exit code 2, nothing written.
    fn refuses(&self, args: &[&str], words: &[&str]) {
        let o = self.run(args);
        let err = errors(&o);
        assert_eq!(o.status.code(), Some(2), "{args:?}: {err}");
        assert!(!err.contains("panicked"), "{err}");
        assert_eq!(err.trim().lines().count(), 1, "{err}");
        for w in words {
            assert!(err.contains(w), "'{w}' is missing in: {err}");
        }
        assert!(!self.path("out.toml").exists());
    }
}

fn identify(recording: &str) -> Vec<&str> {
    [&["identify", recording][..], &CELL_ARGS, &["--out", "out.toml"]].concat()
}

const HEADER: &str = "ball,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,ix_mm,iy_mm,iz_mm\n";

#[test]
fn the_demo_tells_its_story_and_leaves_what_it_says() {
    let place = Place::new();
    let text = place.good(&words("demo --conceal none --out demo"));
    assert!(text.lines().count() < 40, "{text}");
    for name in
        words("run.mcap calibrated.toml report.html plan.csv plan.html truth.sealed.toml sample.compensated.mod")
    {
        assert!(place.path("demo").join(name).exists(), "{name}");
    }
    // what the recording says is what identification from the command line says
    let json = place.json(&words("identify demo/run.mcap --robot demo/robot.toml --cell demo/cell.toml --json"));
    assert_eq!(json["observations"], 45);
    assert_eq!(json["parameters"].as_array().unwrap().len(), 32);
    assert!(json["rms_mm"].as_f64().unwrap() < 0.02 && json["rms_nominal_mm"].as_f64().unwrap() > 0.2);
    // to CSV and back, nothing is lost
    for [from, to] in [["demo/run.mcap", "run.csv"], ["run.csv", "again.mcap"], ["again.mcap", "again.csv"]] {
        place.good(&["convert", from, to]);
    }
    assert_eq!(place.text("run.csv"), place.text("again.csv"));
    // a cut recording is refused, and what is whole in it can be saved
    let bytes = place.bytes("demo/run.mcap");
    place.write("cut.mcap", &bytes[..bytes.len() * 9 / 10]);
    place.refuses(&identify("cut.mcap"), &["cut.mcap", "trical convert"]);
    let o = place.run(&["convert", "cut.mcap", "saved.csv"]);
    assert!(o.status.success() && errors(&o).contains("cut.mcap"), "{}", errors(&o));
    let saved = place.text("saved.csv").lines().count() - 1;
    assert!((35..45).contains(&saved), "{saved}");
    // compensating twice is refused
    let again = "compensate demo/sample.compensated.mod --model demo/calibrated.toml --out out.toml";
    place.refuses(&in_cell(again), &["compensated already"]);
}

#[test]
fn the_demo_finds_what_is_concealed_in_its_arm_and_the_seal_says_the_same() {
    let place = Place::new();
    let claim = |told: &str| told.split(':').next().unwrap().to_owned();
    // as the seed draws it, and as the user wants it
    for args in [["--seed", "2"], ["--conceal", "gear_ripple@2/80*2"]] {
        let story = place.json(&[&words("demo --out demo --json")[..], &args].concat());
        let [sealed, said] = ["concealed", "said"].map(|k| claim(story[k].as_str().unwrap()));
        assert_eq!(sealed, said, "{story}");
        // modelled, it is smaller at poses that were never measured, and a program is driven better
        let mean = |of: &str, model: &str| story[of][model]["mean_mm"].as_f64().unwrap();
        assert!(mean("sphere", "after") < 0.6 * mean("sphere", "plain"), "{story}");
        assert!(mean("sphere", "plain") < 0.5 * mean("sphere", "before"), "{story}");
        assert!(mean("program", "after") < 0.02 && mean("program", "before") > 0.3, "{story}");
        assert_eq!(story["verdict"]["rows"][1]["text"], sealed.as_str());
    }
    // growth is corrected for the temperature at which the program runs
    let story = place.json(&words("demo --out demo --json --conceal thermal_growth"));
    assert!(story["program"]["after"]["mean_mm"].as_f64().unwrap() < 0.02, "{story}");
    // the way out of one of its touches is curved: the stems follow it, though they begin slowly
    place.good(&words("demo --out demo --seed 5 --conceal none"));
    place.good(&words("demo --out demo --seed 5"));
    let text = place.good(&words("demo --out demo --seed 2"));
    assert!(text.lines().count() < 40 && text.contains("The seal is broken"), "{text}");
    assert!(place.path("demo/improved.toml").exists());
    place.refuses(&["demo", "--conceal", "rust"], &["--conceal rust", "no such effect", "gear_ratio"]);
}

#[test]
fn measuring_a_virtual_cell_from_another_process() {
    let place = Place::new();
    place.good(&in_cell("plan --per-ball 3 --out plan.csv"));
    let mut cell = place
        .command(&in_cell("virtual-cell --port 0"))
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let mut line = String::new();
    std::io::BufRead::read_line(&mut std::io::BufReader::new(cell.stdout.take().unwrap()), &mut line).unwrap();
    let urls: Vec<&str> = line.split('\'').collect();
    let measure = format!("measure --plan plan.csv --gauge {} --controller {} --out run.mcap", urls[1], urls[3]);
    assert!(place.good(&in_cell(&measure)).contains("Nothing has moved") && !place.path("run.mcap").exists());
    assert_eq!(place.json(&in_cell(&format!("{measure} --go --json")))["measured"], 9);
    // going on with a finished run measures nothing twice
    let json = place.json(&in_cell(&format!("{measure} --go --resume --json")));
    assert_eq!((&json["measured"], &json["skipped"]), (&serde_json::json!(0), &serde_json::json!(9)));
    cell.kill().unwrap();
    cell.wait().unwrap();
}

#[test]
fn an_mcap_recording_is_read_in_passes_as_its_csv_is() {
    let p = Place::new();
    touches(&p);
    let of = |recording: &str| p.good(&[identify(recording).as_slice(), &["--stream", "--json"]].concat());
    assert_eq!(of("demo/run.mcap"), of("run.csv").replace("run.csv", "demo/run.mcap"));
    let bytes = p.bytes("demo/run.mcap");
    p.write("cut.mcap", &bytes[..bytes.len() / 2]);
    std::fs::remove_file(p.path("out.toml")).unwrap();
    p.refuses(&[identify("cut.mcap").as_slice(), &["--stream"]].concat(), &["cut.mcap: is cut", "trical convert"]);
}

#[test]
fn bad_recordings_are_refused_with_file_line_and_column() {
    let place = Place::new();
    let row = "1,10,20,30,40,50,60,0.001,0.002,0.003\n";
    let cases: [(&str, &str, &[&str]); 9] = [
        ("ragged", &format!("{HEADER}{row}1,10,20\n"), &["line 3", "3 fields", "expected 10"]),
        ("nan", &format!("{HEADER}{row}1,10,nan,30,40,50,60,0,0,0\n"), &["line 3", "q2_deg", "nan"]),
        ("text", &format!("{HEADER}1,10,twenty,30,40,50,60,0,0,0\n"), &["line 2", "q2_deg", "twenty"]),
        ("unknown", &format!("speed,{HEADER}5,{row}"), &["header", "speed"]),
        ("unit", &HEADER.replace("q3_deg", "q3_grad"), &["q3_grad"]),
        ("missing", &HEADER.replace("q3_deg,", ""), &["q3_deg"]),
        ("ball", &format!("{HEADER}7,10,20,30,40,50,60,0,0,0\n"), &["line 2", "ball 7"]),
        ("few", &format!("{HEADER}{row}{row}{row}{row}"), &["few.csv"]),
        ("empty", "", &["empty"]),
    ];
    for (name, text, words) in cases {
        let file = format!("{name}.csv");
        place.write(&file, text);
        let mut all = vec![file.as_str()];
        all.extend(words);
        place.refuses(&identify(&file), &all);
    }
    place.write("bytes.csv", [0xff, 0xfd, 0, 1]);
    place.refuses(&identify("bytes.csv"), &["bytes.csv", "not a text file"]);
    // a surrogate without its other half
    place.write("wide.csv", [0xff, 0xfe, b't', 0, 0, 0xd8]);
    place.refuses(&identify("wide.csv"), &["wide.csv", "not a text file"]);
    let wide: Vec<u8> = "speed\n1\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    place.write("wide.csv", [&[0xff, 0xfe][..], &wide].concat());
    place.refuses(&identify("wide.csv"), &["wide.csv", "header", "'speed'"]);
    place.write("bad.mcap", b"\x89MCAP0\r\n\x00\x01nonsense");
    place.refuses(&identify("bad.mcap"), &["bad.mcap"]);
    place.refuses(&identify("nowhere.csv"), &["nowhere.csv", "cannot be read"]);
}

#[test]
fn bad_robots_and_cells_are_refused_with_file_and_field() {
    let place = Place::new();
    place.write("r.csv", format!("{HEADER}1,10,20,30,40,50,60,0.001,0.002,0.003\n"));
    let changed = |file: &str, text: &str, from: &str, to: &str, words: &[&str]| {
        place.write(file, text.replacen(from, to, 1));
        place.refuses(&identify("r.csv"), words);
        place.write(file, text);
    };
    let robot = |from: &str, to: &str, words: &[&str]| changed("robot.toml", ROBOT, from, to, words);
    robot("mass_kg = 3.067", "masse_kg = 3.067", &["robot.toml", "line", "masse_kg"]);
    robot("d_mm = 290.0", "", &["robot.toml", "line", "d_mm"]);
    robot("d_mm = 290.0", "d_mm = nan", &["robot.toml", "joint 1", "d_mm"]);
    robot("d_mm = 290.0", "d_m = 0.29", &["robot.toml", "d_m"]);
    robot("mass_kg = 3.067\n", "", &["joint 1", "mass_kg", "compliance"]);
    robot("name =", "format_version = 99\nname =", &["robot.toml", "newer"]);
    robot("limits_deg = [-165.0, 165.0]", "limits_deg = [165.0, -165.0]", &["joint 1", "limits_deg"]);
    robot("d_mm = 290.0", "d_mm = \"290\"", &["robot.toml", "line", "expected a number"]);
    place.write("robot.toml", CELL);
    place.refuses(&identify("r.csv"), &["robot.toml: is a cell file, expected a robot file"]);
    place.write("robot.toml", ROBOT);
    let table = ["identify", "r.csv", "--robot", "r.csv", "--cell", "cell.toml"];
    place.refuses(&table, &["r.csv: is a table, expected a robot file (robot.toml)"]);
    let cell = |from: &str, to: &str, words: &[&str]| changed("cell.toml", CELL, from, to, words);
    cell("d23 = 300.0", "d23 = 700.0", &["cell.toml", "triangle"]);
    cell("tcp_mm", "tcp_m", &["cell.toml", "line", "tcp_m"]);
    cell("mass_kg = 1.7", "mass_kg = -1.7", &["cell.toml", "mass_kg", "-1.7"]);
}

#[test]
fn a_plan_says_what_to_expect_and_where_it_is_blind() {
    let place = Place::new();
    let plan = |more: &str| place.json(&in_cell(&format!("plan --out plan.csv --json {more}")));
    // neither plan nor recording stands for the other, and no recording is lost
    let poses = "seq;Q1_rad;q2_rad;q3_rad;q4_rad;q5_rad;q6_rad;x_m;y_m;z_m;qw;qx;qy;qz\r\n";
    for header in [poses, HEADER] {
        place.write("r.csv", header);
        place.refuses(&in_cell("plan --out r.csv"), &["r.csv: is a recording, and would be replaced"]);
        assert_eq!(place.text("r.csv"), header);
    }
    let d = plan("--report plan.html");
    assert_eq!((&d["touches"], &d["pool"]), (&serde_json::json!(45), &serde_json::json!(300)));
    place.refuses(&identify("plan.csv"), &["plan.csv, header: is that of a plan"]);
    assert_eq!(place.text("plan.csv").lines().count(), 46);
    assert_eq!(d["parameters"].as_array().unwrap().len(), 31);
    for p in d["parameters"].as_array().unwrap() {
        assert!(p["sd"].as_f64().unwrap() > 0.0, "{p}");
    }
    // every attempt is a candidate or has a reason
    for ball in d["by_ball"].as_array().unwrap() {
        let refused: u64 = ball["rejected"].as_object().unwrap().values().map(|n| n.as_u64().unwrap()).sum();
        assert_eq!(ball["attempts"].as_u64().unwrap() - refused, 100);
    }
    // three low balls in front are blind to what needs a gravity torque of another sign
    let blind = |d: &serde_json::Value, effect: &str, joint: u64| {
        let list = d["blind_to"].as_array().unwrap();
        list.iter().any(|b| b["effect"] == effect && b["site"]["joint"] == joint)
    };
    assert!(blind(&d, "lost_motion_gravity", 2) && blind(&d, "lost_motion_gravity", 3));
    assert!(!blind(&d, "lost_motion_direction", 2) && !blind(&d, "joint_harmonic", 1));
    // nine touches are a plan, though not one to identify with
    let few = plan("--per-ball 3 --report plan.html");
    assert_eq!((&few["touches"], &few["determined"]), (&serde_json::json!(9), &serde_json::json!(false)));
    plan("--report plan.html");
    // made for the workspace it is better there
    let mean = |d: &serde_json::Value, place: &str| d["expected"][place]["rms_mm"].as_f64().unwrap();
    let w = plan("--criterion workspace --sphere-mm 150,90,100,150");
    assert!(mean(&w, "workspace") < mean(&d, "workspace"));
    // twice the noise, twice the error
    let twice = plan("--noise-mm 0.02");
    assert!((mean(&twice, "sphere") / mean(&d, "sphere") - 2.0).abs() < 1e-9);
    let html = loads_nothing(&place, "plan.html");
    assert_eq!(html.matches("<svg").count(), 3);
    assert_eq!(html.matches("<title>touch ").count(), 3 * 45);
}

#[test]
fn a_recording_of_any_arm_is_converted_without_saying_how_many_joints_it_has() {
    let place = Place::new();
    let q: Vec<String> = (1..=7).map(|k| format!("q{k}_deg")).collect();
    place.write("seven.csv", format!("{},x_mm,y_mm,z_mm\n1,2,3,4,5,6,7,8,9,10\n", q.join(",")));
    for (from, to) in [("seven.csv", "seven.mcap"), ("seven.mcap", "again.csv")] {
        place.good(&["convert", from, to]);
    }
    let again = place.text("again.csv");
    assert!(again.lines().nth(1).unwrap().contains("1,2,3,4,5,6,7,8,9,10"), "{again}");
    place.refuses(&["convert", "seven.csv", "b.mcap", "--robot", "robot.toml"], &["--robot", "seven.csv needs none"]);
    place.write("gap.csv", "q1_deg,q3_deg,x_mm,y_mm,z_mm\n1,2,3,4,5\n");
    place.refuses(&["convert", "gap.csv", "b.mcap"], &["gap.csv", "q2_deg is missing"]);
}

#[test]
fn a_cell_without_balls_cannot_be_touched_by_plan_nor_virtual_cell() {
    let place = Place::new();
    place.write("cell.toml", &CELL[..CELL.find("[balls]").unwrap()]);
    for command in ["plan --out none.csv", "virtual-cell --port 0"] {
        place.refuses(&in_cell(command), &["has no ", "[balls]"]);
    }
}

#[test]
fn poses_for_a_tracker_are_planned_and_wrong_words_refused() {
    let place = Place::new();
    place.write("cell.toml", CELL.replace("tcp_mm = [18.0, -12.0, 118.0]", "tcp_mm = [40.0, 70.0, 60.0]"));
    let plan = "plan --out points.csv --points 20";
    place.good(&in_cell(&format!("{plan} --sphere-mm 150,0,200,150 --facing-mm 150,-3000,500")));
    let text = place.text("points.csv");
    assert_eq!(text.lines().count(), 21);
    for line in text.lines().skip(1) {
        let q: Vec<f64> = line.split(',').skip(1).map(|x| x.parse().unwrap()).collect();
        let [x, y, z] = tool_point(q.try_into().unwrap());
        // the cell's base
        let p = [150.0 - y, x - 330.0, z - 150.0];
        let centre = [150.0, 0.0, 200.0];
        let d = (0..3).map(|k| (p[k] - centre[k]).powi(2)).sum::<f64>().sqrt();
        assert!(d < 150.01, "{d} mm from the centre");
    }
    for (bad, words) in [
        ("--facing-mm 1,2", "--facing-mm: found 2 numbers, expected 3"),
        ("--sphere-mm 0,0,0,-1", "found a radius of -1 mm"),
        ("--report plan.html", "--report: a plan of poses (--points) has no report"),
    ] {
        place.refuses(&in_cell(&format!("{plan} {bad}")), &[words]);
    }
    for ignored in ["--per-ball 9", "--start-deg 1,2,3"] {
        let o = place.run(&in_cell(&format!("{plan} {ignored}")));
        assert!(o.status.code() == Some(2) && errors(&o).contains("cannot be used with"), "{}", errors(&o));
    }
    place.refuses(&in_cell("plan --out p.csv --per-ball 5000"), &["--per-ball: found 5000, expected at most 1000"]);
    place.refuses(&in_cell("plan --out p.xlsx"), &["--out: found p.xlsx, expected a name that ends in .csv"]);
}

#[test]
fn a_cell_that_cannot_be_planned_says_what_is_in_the_way() {
    let place = Place::new();
    let refuses = |option: &str, words: &[&str]| {
        place.refuses(&in_cell(&format!("plan --out none.csv {option}")), words);
    };
    refuses("--start-deg 0,0,0", &["--start-deg", "3 numbers", "expected 6"]);
    refuses("--start-deg 0,100,60,0,0,0", &["start", "meet there", "--start-deg"]);
    refuses("--sphere-mm 0,0,100", &["--sphere-mm", "3 numbers", "expected 4"]);
    refuses("--noise-mm 0", &["--noise-mm", "found 0"]);
    refuses("--per-ball 0", &["--per-ball", "found 0"]);
    place.write("robot.toml", ROBOT.replace("limits_deg = [-110.0, 110.0]", "limits_deg = [-110.0, -100.0]"));
    let words = ["ball 1", "0 collision-free configurations", "beyond joint limits"];
    refuses("--start-deg 0,-105,0,0,0,0", &words);
    place.write("robot.toml", ROBOT);
    place.write("cell.toml", CELL.replace("margin_mm = 5.0", "margin_mm = 5.0\ncolour = 3"));
    place.refuses(&in_cell("plan --out none.csv"), &["[geometry]", "colour"]);
}

#[test]
fn a_study_finds_described_arms_again_and_is_the_same_to_the_byte() {
    let place = Place::new();
    let run = |out: &str| {
        let said = place.good(&in_cell(&format!("study touches --out {out} --trials 6 --per-ball 8,15 --json")));
        (said, place.bytes(&format!("{out}/study.csv")), place.bytes(&format!("{out}/study.svg")))
    };
    let first = run("a");
    assert!(first == run("b"));
    let d: serde_json::Value = serde_json::from_str(&first.0).unwrap();
    assert!(d["largest_parameter_error_without_noise_si"].as_f64().unwrap() < 1e-9, "{d}");
    for f in d["random_over_chosen"]["workspace"].as_array().unwrap() {
        assert!(f["factor"].as_f64().unwrap() > 1.0, "{f}");
    }
    // what the parameters cannot describe is left, and said
    let silent = d["settings"].as_array().unwrap().iter().find(|s| s["arm"] == "any" && s["noise"] == false).unwrap();
    assert!(silent["workspace_mean_mm"].as_f64().unwrap() > 1e-4);
    assert!(place.path("a").join("study.html").exists());
    let platform = "study platform --out p --trials 3 --json --balls";
    let d = place.json(&in_cell(&format!("{platform} 3 --side-mm 300,2000 --height-mm 0 --raise-mm 0")));
    assert!(d["platforms"][0]["workspace_mean_mm"].as_f64().unwrap() > 0.0);
    assert!(d["platforms"][1]["problem"].as_str().unwrap().contains("out of reach"), "{d}");
    for (asked, words) in [
        ("platform --balls 2", ["--balls: found 2", "expected 3"]),
        ("platform --side-mm 9", ["--side-mm: found 9", "expected more than 20"]),
        ("platform --procedure-mm 21", ["--procedure-mm: found 21", "expected 0 to 20"]),
        ("touches --per-ball 0", ["--per-ball: found [0]", "expected numbers of 1 to 100"]),
    ] {
        place.refuses(&in_cell(&format!("study {asked} --out refused")), &words);
    }
    assert!(!place.path("refused").exists());
}

#[test]
fn an_occupied_port_is_refused() {
    let place = Place::new();
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    place.refuses(&in_cell(&format!("virtual-cell --port {port}")), &[&port, "in use"]);
}

#[test]
fn files_to_start_from_are_those_that_the_program_reads() {
    let place = Place::new();
    place.good(&["init", "new"]);
    // they are read; one touch is not enough, and is said to be so
    let identify = words("identify new/recording.csv --robot new/robot.toml --cell new/cell.toml");
    place.refuses(&identify, &["only ball 2 was touched"]);
    let before = place.text("new/cell.toml");
    place.refuses(&["init", "new"], &["new/robot.toml", "exists already"]);
    assert_eq!(before, place.text("new/cell.toml"));
}

#[test]
fn the_sample_s_flaw_is_found() {
    let place = Place::new();
    place.good(&["sample", "new"]);
    let said = place.good(&words("diagnose new/touches.csv --robot new/robot.toml --cell new/cell.toml"));
    assert!(said.contains("Backlash or friction wind-up at joint 2 (9"), "{said}");
}

/// The demo's touches as a CSV.
fn touches(place: &Place) -> String {
    place.good(&words("demo --conceal none --out demo"));
    place.good(&words("convert demo/run.mcap run.csv"));
    place.text("run.csv")
}

#[test]
fn wrong_input_is_noticed() {
    let place = Place::new();
    let text = touches(&place);
    // a conversion replaces another one, and nothing that was measured
    (0..2).for_each(|_| drop(place.good(&words("convert run.csv again.mcap"))));
    place.refuses(&words("convert run.csv demo/run.mcap"), &["demo/run.mcap: holds what was measured"]);
    // the same recording twice, whatever it is called
    place.write("again.csv", &text);
    place.refuses(&in_cell("identify run.csv again.csv"), &["again.csv", "same measurements", "run.csv"]);
    // so is one that is joined with itself, and another in which it is; they are compared and validated alike
    place.write("later.csv", text.lines().take(20).map(|l| format!("{l}\n")).collect::<String>());
    let all = "later.csv: 19 of its 19 measurements are in run.csv too";
    place.refuses(&in_cell("identify run.csv later.csv"), &[all]);
    let without_time = |line: &str| line.split(',').skip(2).collect::<Vec<_>>().join(",") + "\n";
    let rows: String = text.lines().skip(1).map(without_time).collect();
    let header = without_time(text.lines().next().unwrap());
    assert!(header.starts_with("q1_deg"), "{header}");
    place.write("twice.csv", format!("{header}{rows}{rows}"));
    for command in ["identify", "diagnose"] {
        let args = format!("{command} twice.csv");
        place.refuses(&in_cell(&args), &["twice.csv: rows 46 to 90 hold the same measurements as rows 1 to 45"]);
    }
    place.good(&in_cell("identify run.csv --out m.toml"));
    let other = measured_anew(&text);
    place.write("b.csv", &other);
    place.write("c.csv", &other);
    place.refuses(&words("compare m.toml b.csv c.csv"), &["c.csv", "same measurements as b.csv"]);
    std::fs::create_dir(place.path("days")).unwrap();
    for name in ["b.csv", "c.csv"] {
        std::fs::copy(place.path(name), place.path("days").join(name)).unwrap();
    }
    place.refuses(&words("history days --model m.toml"), &["c.csv", "same measurements as"]);
    // in the order in which people count, whatever the case of the ending; hidden files are left alone
    std::fs::create_dir(place.path("runs")).unwrap();
    place.write("runs/.run_0.csv", "x");
    let anew = measured_anew(&text);
    let (first, rows) = anew.split_once('\n').unwrap();
    let rows: Vec<&str> = rows.lines().collect();
    for (name, part) in ["run_1.csv", "run_2.CSV", "run_10.csv"].iter().zip(rows.chunks(15)) {
        place.write(&format!("runs/{name}"), format!("{first}\n{}\n", part.join("\n")));
    }
    let told = place.good(&words("history runs --model m.toml"));
    assert!(told.contains("not every name has a date such as 2026-11-22"), "{told}");
    let at = |name: &str| told.find(name).unwrap_or_else(|| panic!("{name} in {told}"));
    assert!(at("run_1.csv") < at("run_2.CSV") && at("run_2.CSV") < at("run_10.csv"), "{told}");
    let told = place.good(&words("history runs --model m.toml --report h.html --table h.csv"));
    assert!(told.ends_with("\n\nWrote h.html and h.csv\n"), "{told}");
    place.refuses(&words("history runs --model m.toml --table runs/h.csv"), &["--table: runs/h.csv", "for a session"]);
    // a full disk is nobody's wrong input
    #[cfg(target_os = "linux")]
    for output in ["--out", "--report", "--certificate"] {
        let done = place.run(&in_cell(&format!("identify run.csv {output} /dev/full")));
        assert_eq!(done.status.code(), Some(1), "{output}: {done:?}");
    }
    #[cfg(target_os = "linux")]
    for asked in [&["--help"][..], &["--version"], &["identify", "--help"], &["effects"]] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let done = place.command(asked).stdout(full).output().unwrap();
        assert_eq!(done.status.code(), Some(1), "{asked:?}: {done:?}");
        assert!(errors(&done).starts_with("trical: standard output: "), "{asked:?}: {done:?}");
    }
    // files that are no recordings
    place.write("sheet.xlsx", "PK\u{3}\u{4}xl/workbook.xml");
    place.refuses(&identify("sheet.xlsx"), &["sheet.xlsx: is a spreadsheet", "save the sheet as CSV"]);
    place.refuses(&identify("m.toml"), &["m.toml: is a TOML file", "expected a recording"]);
    place.write("short.csv", text.replacen("q1_deg", "q1", 1));
    place.refuses(
        &identify("short.csv"),
        &["no unit in the name of column 'q1' (q1_deg?)", "line of units below the header"],
    );
    // measurements are written one by one, in a format for that
    let measure = "measure --guided --out z.csv --gauge line:///dev/null --controller rapid://127.0.0.1:1";
    place.refuses(&in_cell(measure), &["--out: found z.csv", "ends in .mcap", "trical convert"]);
    assert!(!place.path("z.csv").exists() && !place.path("z.plan.csv").exists());
    // another arm
    place.write("ur10.toml", include_str!("../cells/ur10/robot.toml"));
    let o = place.run(&words("identify run.csv --robot ur10.toml --cell cell.toml"));
    let err = errors(&o);
    assert!(o.status.code() == Some(1) && err.contains("are robot.toml and cell.toml those of this arm?"), "{err}");
    assert!(err.contains(" together least: measure more varied poses") && !err.contains(" with beta"), "{err}");
    // a controller is asked for by its URL
    place.refuses(&words("robot ping --controller 192.168.1.10"), &["rapid://192.168.125.1:5000 (a controller)"]);
    // joints in rad: sizes that no arm has
    let columns: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let joint = |name: &str| (name.starts_with('q') && name.ends_with("_deg")) || name.starts_with("qc");
    let in_rad = |(k, cell): (usize, &str)| match cell.parse::<f64>() {
        Ok(v) if joint(columns[k]) => v.to_radians().to_string(),
        _ => cell.to_owned(),
    };
    let rows = text.lines().enumerate().map(|(k, line)| match k {
        0 => line.to_owned(),
        _ => line.split(',').enumerate().map(in_rad).collect::<Vec<_>>().join(","),
    });
    place.write("rad.csv", rows.collect::<Vec<_>>().join("\n") + "\n");
    place.refuses(&identify("rad.csv"), &["rad.csv, columns q1_deg", "looks like rad"]);
    // a spreadsheet's way of writing is read, with one note
    place.write("sheet.csv", format!("\u{feff}{}", text.replace(',', ";").replace('.', ",")));
    let o = place.run(&in_cell("identify sheet.csv --json"));
    let err = errors(&o);
    assert!(o.status.success() && err.lines().filter(|l| l.contains("note: sheet.csv")).count() == 1, "{err}");
    let sheet = String::from_utf8_lossy(&o.stdout).replace("sheet.csv", "run.csv");
    assert_eq!(sheet, place.good(&in_cell("identify run.csv --json")));
    // all columns that are not known in one message
    place.write("unknown.csv", text.replacen("t_s,", "colour,t_s,size,", 1));
    place.refuses(&identify("unknown.csv"), &["header", "unknown columns 'colour', 'size'"]);
}

#[test]
fn tracker_points_in_metres_are_noticed() {
    let place = Place::new();
    let mut text = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm\n".to_owned();
    for k in 0..30 {
        let q = f64::from(k);
        let (x, y, z) = (0.4 * (0.2 * q).cos(), 0.4 * (0.2 * q).sin(), 0.3 + 0.01 * q);
        text += &format!("{},{},{},10,{},5,{x},{y},{z}\n", 11.5 * q - 170.0, q, 20.0 - q, 2.0 * q);
    }
    place.write("m.csv", &text);
    place.refuses(&identify("m.csv"), &["m.csv, columns x_mm, y_mm, z_mm", "looks like m"]);
}

#[test]
fn help_is_there_for_every_command() {
    let place = Place::new();
    let text = place.good(&["--help"]);
    for command in words("demo plan measure virtual-cell identify validate diagnose compensate convert export") {
        assert!(text.contains(command));
        place.good(&[command, "--help"]);
    }
    assert_eq!(place.run(&["frobnicate"]).status.code(), Some(2));
}

#[test]
fn diagnosis_is_the_same_to_the_byte_and_its_model_validates() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/blind");
    if !data.is_dir() {
        println!("skipped: {} is missing", data.display());
        return;
    }
    let place = Place::new();
    for name in ["B03.probe.csv", "B03.tracker.csv", "robot.toml", "cell.toml"] {
        std::fs::copy(data.join(name), place.path(name)).unwrap();
    }
    let of =
        |command: &str, more: &str| place.good(&in_cell(&format!("{command} B03.probe.csv B03.tracker.csv {more}")));
    let once = || (of("diagnose", "--json --out improved.toml --report report.html"), place.text("improved.toml"));
    assert!(once() == once());
    let v = |model: &str| {
        let said = of("validate", &format!("--model {model} --json"));
        serde_json::from_str::<serde_json::Value>(&said).unwrap()["after"]["rms_mm"].as_f64().unwrap()
    };
    of("identify", "--out calibrated.toml");
    assert!(v("improved.toml") < 0.5 * v("calibrated.toml"));
    assert!(loads_nothing(&place, "report.html").contains("<svg"));
}

/// The text of a page: the names of the SVG language and of the library are the only addresses in it.
fn loads_nothing(place: &Place, page: &str) -> String {
    let html = place.text(page).replace("xmlns=\"http://www.w3.org/2000/svg\"", "");
    let html = html.replace("/*! https://github.com/leeoniya/uPlot", "");
    assert!(!html.contains("http://") && !html.contains("https://"));
    html
}

/// One row of a recording: ball, six joints in deg, three readings in mm.
fn touch_row(ball: usize, q: [f64; 6]) -> String {
    let q = q.map(|x| x.to_string()).join(",");
    format!("{ball},{q},0.001,0.002,0.003\n")
}

#[test]
fn data_that_cannot_be_fitted_says_why() {
    let place = Place::new();
    let alike: String = (0..60).map(|k| touch_row(1 + k % 3, [10.0, 20.0, 30.0, 40.0, 50.0, 60.0])).collect();
    let varied = |k: usize| {
        let s = |a: f64| ((k as f64 + 1.0) * a).sin() * 40.0;
        [s(1.3), s(2.1), s(0.7), s(3.7), s(1.9), s(2.9)]
    };
    let one_ball: String = (0..60).map(|k| touch_row(2, varied(k))).collect();
    let few: String = (0..5).map(|k| touch_row(1 + k % 3, varied(k))).collect();
    let far = touch_row(1, [1e9, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let cases: [(&str, &str, &[&str]); 4] = [
        ("alike.csv", &alike, &["alike.csv", "60 measurements", "same pose"]),
        ("ball.csv", &one_ball, &["ball.csv", "only ball 2 was touched"]),
        ("few.csv", &few, &["5 measurements give 15 numbers"]),
        ("far.csv", &far, &["far.csv", "line 2, column q1_deg", "1000000000"]),
    ];
    for (file, rows, words) in cases {
        place.write(file, format!("{HEADER}{rows}"));
        place.refuses(&identify(file), words);
    }
    let distances = "distances_mm = { d12 = 300.0, d13 = 300.0, d23 = 300.0 }";
    place.write("cell.toml", CELL.replace(distances, "positions_mm = [[0, 0, 0], [100, 0, 0], [200, 0, 0]]"));
    let line: String = (0..60).map(|k| touch_row(1 + k % 3, varied(k))).collect();
    place.write("line.csv", format!("{HEADER}{line}"));
    place.refuses(&identify("line.csv"), &["balls 1, 2, 3", "one line"]);
}

/// The IRB 120 as industrial URDFs are written, with a branch, so that the flange has to be named.
const URDF: &str = r#"<robot name="irb120">
<link name="base_link"/><link name="l1"/><link name="l2"/><link name="l3"/><link name="l4"/><link name="l5"/><link name="l6"/>
<link name="tool0"/><link name="camera"/>
<joint name="j1" type="revolute"><parent link="base_link"/><child link="l1"/><origin xyz="0 0 0.29"/><axis xyz="0 0 1"/>
<limit lower="-2.87" upper="2.87"/></joint>
<joint name="j2" type="revolute"><parent link="l1"/><child link="l2"/><axis xyz="0 1 0"/><limit lower="-1.9" upper="1.9"/></joint>
<joint name="j3" type="revolute"><parent link="l2"/><child link="l3"/><origin xyz="0 0 0.27"/><axis xyz="0 1 0"/>
<limit lower="-1.9" upper="1.2"/></joint>
<joint name="j4" type="revolute"><parent link="l3"/><child link="l4"/><origin xyz="0 0 0.07"/><axis xyz="1 0 0"/>
<limit lower="-2.7" upper="2.7"/></joint>
<joint name="j5" type="revolute"><parent link="l4"/><child link="l5"/><origin xyz="0.302 0 0"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2"/></joint>
<joint name="j6" type="revolute"><parent link="l5"/><child link="l6"/><axis xyz="1 0 0"/><limit lower="-6.9" upper="6.9"/></joint>
<joint name="f" type="fixed"><parent link="l6"/><child link="tool0"/><origin xyz="0.072 0 0" rpy="0 1.5707963267948966 0"/></joint>
<joint name="c" type="fixed"><parent link="l4"/><child link="camera"/></joint>
</robot>
"#;

#[test]
fn an_arm_from_a_urdf_is_calibrated_and_handed_on() {
    let place = Place::new();
    place.write("arm.urdf", URDF);
    place.refuses(&["convert", "arm.urdf", "--out", "out.toml"], &["several ends", "camera", "arm.urdf#base_link:"]);
    place.refuses(&["convert", "arm.urdf#base_link:tool1", "out.toml"], &["link 'tool1'", "no such link"]);
    place.write("broken.urdf", URDF.replace("<limit lower=\"-2\" upper=\"2\"/>", ""));
    place
        .refuses(&["convert", "broken.urdf#:tool0", "out.toml"], &["broken.urdf, line 11", "j5", "<limit> is missing"]);
    place.good(&words("convert arm.urdf#base_link:tool0 --out arm.toml"));
    // touches of the shipped arm, which is the same one
    let q = |k: usize| {
        let s = |a: f64, b: f64| ((k as f64 + 1.0) * a).sin() * b;
        [s(1.3, 60.0), s(2.1, 50.0), s(0.7, 40.0), s(3.7, 90.0), s(1.9, 80.0), s(2.9, 150.0)]
    };
    let rows: String = (0..60)
        .map(|k| {
            let q = q(k);
            format!("{},{}\n", q.map(|x| x.to_string()).join(","), tool_point(q).map(|x| x.to_string()).join(","))
        })
        .collect();
    place.write("points.csv", format!("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm\n{rows}"));
    for robot in ["arm.urdf#base_link:tool0", "arm.toml", "robot.toml"] {
        let identify = "identify points.csv --cell cell.toml --model nominal --json --out m.toml --robot";
        let json = place.json(&words(&format!("{identify} {robot}")));
        assert!(json["max_mm"].as_f64().unwrap() < 1e-6, "{robot}: {}", json["max_mm"]);
    }
    let json = place.json(&words("export --model m.toml --robot robot.toml --urdf c.urdf --mdh c.csv --json"));
    assert_eq!((json["left_out"].as_array().unwrap().len(), &json["left_out_max_mm"]), (0, &serde_json::json!(0.0)));
    let csv = place.text("c.csv");
    assert!(csv.starts_with("joint,kind,alpha_deg,a_mm,beta_deg,d_mm,theta_offset_deg,"), "{csv}");
    assert!(csv.contains("3,revolute,0.0,270.0,0.0,0.0,0.0,-110.0,70.0,,"), "{csv}");
    // the exported arm is one again
    place.good(&words("convert c.urdf#base_link:flange again.toml"));
    place.refuses(&["export", "--model", "m.toml", "--robot", "arm.toml", "--mdh", "out.txt"], &["out.txt", ".csv"]);
    place.refuses(&["export", "--model", "arm.toml", "--mdh", "out.toml"], &["arm.toml"]);
    // nothing is written where not everything can be
    place.refuses(&words("export --model m.toml --urdf first.urdf --mdh second"), &["second", ".csv"]);
    assert!(!place.path("first.urdf").exists());
    assert_eq!(place.run(&["export", "--model", "m.toml"]).status.code(), Some(2));
}

/// A point 100 mm off the IRB 120's flange, from its published lengths, mm.
fn tool_point(q_deg: [f64; 6]) -> [f64; 3] {
    type M = [[f64; 3]; 3];
    let mul =
        |a: M, b: M| -> M { std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum())) };
    let turn = |axis: usize, deg: f64| -> M {
        let (s, c) = deg.to_radians().sin_cos();
        match axis {
            0 => [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]],
            1 => [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]],
            _ => [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]],
        }
    };
    let mut r: M = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut p = [0.0; 3];
    let steps = [
        ([0.0, 0.0, 290.0], 2),
        ([0.0, 0.0, 0.0], 1),
        ([0.0, 0.0, 270.0], 1),
        ([0.0, 0.0, 70.0], 0),
        ([302.0, 0.0, 0.0], 1),
        ([0.0, 0.0, 0.0], 0),
    ];
    let ahead = |p: [f64; 3], r: M, v: [f64; 3]| -> [f64; 3] {
        std::array::from_fn(|i| p[i] + (0..3).map(|k| r[i][k] * v[k]).sum::<f64>())
    };
    for ((v, axis), q) in steps.iter().zip(q_deg) {
        p = ahead(p, r, *v);
        r = mul(r, turn(*axis, q));
    }
    ahead(p, r, [72.0 + 60.0, 70.0, -40.0])
}
