//! Reports as their readers meet them: what they say, what they carry, and whether a browser without a network draws them.

use std::path::Path;
use std::process::Command;
use std::sync::LazyLock;

use crate::common::{CELL_ARGS, Place, errors, in_cell, measured_anew, words};

/// The files of a demo, its recording as CSV too: measured and diagnosed once for all tests.
static DEMO: LazyLock<Vec<(String, Vec<u8>)>> = LazyLock::new(|| {
    let place = Place::new();
    place.good(&words("demo --conceal none --seed 4 --out ."));
    place.good(&words("convert run.mcap --out run.csv"));
    let files = std::fs::read_dir(place.path("")).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap());
    files.map(|name| (name.clone(), place.bytes(&name))).collect()
});

/// A folder with that demo.
fn demo() -> Place {
    let place = Place::new();
    DEMO.iter().for_each(|(name, bytes)| place.write(name, bytes));
    place
}

/// A page with plain blanks where lines must not end, so that words are found.
fn text_of(page: &Path) -> String {
    std::fs::read_to_string(page).unwrap().replace('\u{a0}', " ").replace("<wbr>", "")
}

fn chromium() -> Option<&'static str> {
    ["chromium", "chromium-browser", "google-chrome", "chrome"]
        .into_iter()
        .find(|name| Command::new(name).arg("--version").output().is_ok_and(|o| o.status.success()))
}

/// What a browser writes about a page after its scripts ran; nothing may have been written to the console.
fn browse(chromium: &str, page: &Path, what: &str) -> String {
    let profile = tempfile::tempdir().unwrap();
    let o = Command::new(chromium)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"])
        .args(["--disable-component-update", "--disable-sync", "--host-resolver-rules=MAP * ~NOTFOUND"])
        .args(["--virtual-time-budget=4000", "--enable-logging=stderr", "--window-size=1100,3000", what])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(format!("file://{}", page.display()))
        .output()
        .unwrap();
    let err = String::from_utf8_lossy(&o.stderr);
    assert!(!err.contains("CONSOLE"), "{}: {err}", page.display());
    String::from_utf8_lossy(&o.stdout).into_owned()
}

/// The page as a browser has it.
fn seen(chromium: &str, page: &Path) -> String {
    browse(chromium, page, "--dump-dom")
}

/// No table or picture is cut off at the edge of an A4 page with its margins (688 pixels wide).
fn fits_on_paper(chromium: &str, page: &Path) {
    let html = std::fs::read_to_string(page).unwrap();
    assert!(html.contains("@media print"));
    let measure = "<script>onload = () => document.querySelectorAll('table, p, svg').forEach((e) => {\
                   const right = e.getBoundingClientRect().right;\
                   if (right > 689) console.log('cut off at the edge: ' + right + ' ' + (e.textContent || '').slice(0, 80));\
                   })</script></body>";
    let paper = page.with_extension("paper.html");
    let html = html.replace("@media print", "@media all").replace("</body>", measure);
    // a narrow page stands for paper, whatever the window's least width
    std::fs::write(&paper, html.replace("<body>", "<body style=\"width: 688px\">")).unwrap();
    seen(chromium, &paper);
}

/// The picture of the cell turns by mouse and by keyboard, is drawn in other places then, and Home gives the first one back.
fn turns(chromium: &str, page: &Path) {
    let html = std::fs::read_to_string(page).unwrap();
    let after = |what: &str| {
        let script = format!(
            "<script>onload = () => {{\
             const cell = document.querySelector('.turn'), canvas = cell.querySelector('canvas');\
             cell.setPointerCapture = () => {{}};\
             const mouse = (name, x, y) => cell.dispatchEvent(new PointerEvent(name, {{ clientX: x, clientY: y }}));\
             const key = (name) => cell.dispatchEvent(new KeyboardEvent('keydown', {{ key: name }}));\
             const drag = (x, y) => {{ mouse('pointerdown', 300, 300); mouse('pointermove', x, y); mouse('pointerup', x, y); }};\
             {what}\
             const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;\
             let sum = 0; for (let k = 0; k < data.length; k++) sum = (31 * sum + data[k]) % 1000003;\
             document.title = 'sum ' + sum + ' ' + cell.className + '.'; }}</script></body>"
        );
        let turned = page.with_extension("turned.html");
        std::fs::write(&turned, html.replace("</body>", &script)).unwrap();
        let dom = seen(chromium, &turned);
        dom.split("<title>").nth(1).unwrap().split("</title>").next().unwrap().to_owned()
    };
    let (mouse, back) = (after("drag(200, 340);"), after("drag(200, 340); key('Home');"));
    let keys = after("key('ArrowLeft'); key('ArrowUp'); key('+');");
    assert!(mouse.ends_with(" turn turned.") && keys.ends_with(" turn turned."), "{mouse} {keys}");
    assert!(mouse != keys && back.ends_with(" turn."), "{mouse} {keys} {back}");
}

/// Every plot of the page was drawn; how many.
fn drawn(page: &Path) -> Option<usize> {
    let Some(chromium) = chromium() else {
        println!("skipped: there is no Chromium to look at {} with", page.display());
        return None;
    };
    let dom = seen(chromium, page);
    let pdf = page.with_extension("pdf");
    browse(chromium, page, &format!("--print-to-pdf={}", pdf.display()));
    assert!(std::fs::read(&pdf).unwrap().starts_with(b"%PDF"), "{}", page.display());
    fits_on_paper(chromium, page);
    let html = std::fs::read_to_string(page).unwrap();
    let plots = html.matches("<div class=\"plot\">").count();
    assert_eq!(dom.matches("class=\"plot drawn\"").count(), plots, "{}", page.display());
    // the library made a canvas in each of them, and our own one for the cell
    let cells = html.matches("<div class=\"turn\">").count();
    assert_eq!(dom.matches("<canvas").count(), plots + cells, "{}", page.display());
    assert_eq!(dom.matches("class=\"turn\"").count(), cells, "as on paper until somebody turns it");
    if cells > 0 {
        turns(chromium, page);
    }
    Some(plots)
}

/// Nothing is loaded from anywhere, and the last section names command and inputs.
fn self_contained(page: &Path, inputs: &[&str]) -> String {
    let html = text_of(page);
    let without_names = html
        .replace("xmlns=\"http://www.w3.org/2000/svg\"", "")
        .replace("/*! https://github.com/leeoniya/uPlot (v1.6.32) */", "");
    for word in ["http://", "https://", " src=", "@import", "url("] {
        assert!(!without_names.contains(word), "{}: {word}", page.display());
    }
    let made = html.split("How this was made").nth(1).unwrap();
    assert!(made.contains(&format!("TriCal {}", env!("CARGO_PKG_VERSION"))), "{made}");
    for name in inputs {
        let file = page.parent().unwrap().join(name);
        let size = std::fs::metadata(&file).unwrap().len();
        assert!(made.contains(&format!("<td>{name}</td><td>{size}</td>")), "{name}: {made}");
        // by another program than ours
        match Command::new("sha256sum").arg(&file).output() {
            Ok(o) => assert!(made.contains(&String::from_utf8_lossy(&o.stdout)[..64]), "{name}"),
            Err(e) => println!("skipped: sha256sum: {e}"),
        }
    }
    html
}

#[test]
fn pages_and_models_have_names_that_say_so_and_a_file_each() {
    let place = demo();
    let refused = |command: &str, words: &[&str]| {
        let o = place.run(&in_cell(command));
        let err = errors(&o);
        assert!(o.status.code() == Some(2) && err.trim().lines().count() == 1, "{command}: {err}");
        words.iter().for_each(|w| assert!(err.contains(w), "{command}: {w}: {err}"));
    };
    refused("identify run.csv --report a.pdf", &["--report: found a.pdf", "ends in .html", "as PDF"]);
    refused("diagnose run.csv --out a.urdf", &["--out: found a.urdf", "ends in .toml"]);
    for other in ["a.html", "./a.html"] {
        let both = format!("identify run.csv --report a.html --certificate {other}");
        refused(&both, &[&format!("--certificate: found {other}, which --report names, too")]);
    }
    refused("identify run.csv --out .", &["the name of a file"]);
    refused("identify run.csv --compliant 2 --model geometry", &["--compliant: found a model without compliance"]);
    let validate = "validate run.csv --model calibrated.toml --certificate c.pdf";
    refused(validate, &["--certificate: found c.pdf", "ends in .html"]);
    assert!(!place.path("a.pdf").exists() && !place.path("a.html").exists());
    let map = errors(&place.run(&words("export --model calibrated.toml --error-map map.html")));
    assert!(map.contains("--error-map: found map.html, expected a name that ends in .csv"), "{map}");
    // numbers on axes do not follow the language of the browser
    place.good(&in_cell("identify run.csv --report a.HTML"));
    assert_eq!(text_of(&place.path("a.HTML")).matches("values: ticks").count(), 2);
}

fn verdict(html: &str) -> &str {
    html.split("<p class=\"verdict\">").nth(1).unwrap().split("</p>").next().unwrap()
}

/// Writes the recording with one number changed; in which line.
fn changed(place: &Place, column: &str, by: f64, file: &str) -> usize {
    let mut lines: Vec<String> = place.text("run.csv").lines().map(String::from).collect();
    let head = lines.iter().position(|l| l.contains(column)).unwrap();
    let column = lines[head].split(',').position(|c| c == column).unwrap();
    let mut cells: Vec<String> = lines[head + 20].split(',').map(String::from).collect();
    cells[column] = format!("{}", cells[column].parse::<f64>().unwrap() + by);
    lines[head + 20] = cells.join(",");
    place.write(file, lines.join("\n") + "\n");
    head + 21
}

#[test]
fn identification_and_validation_are_reported_to_the_person_who_signs() {
    let place = demo();
    let identify = in_cell("identify run.csv --out out.toml --report i.html --json");
    let json = place.json(&identify);
    let html = self_contained(&place.path("i.html"), &["run.csv", "robot.toml", "cell.toml"]);
    let mm = |v: &serde_json::Value| format!("{:.3}", v.as_f64().unwrap());
    let said = verdict(&html);
    for number in ["mean_nominal_mm", "max_nominal_mm", "mean_mm", "max_mm"] {
        assert!(said.contains(&mm(&json[number])), "{number}: {said}");
    }
    // how it does elsewhere is scored without being asked for, and the worst of it told; 32 parameters are many for 45 poses
    let ways = json["held_out"].as_object().unwrap().values().filter_map(|e| e["mean_mm"].as_f64());
    let worst = format!("{:.3}", ways.fold(0.0, f64::max));
    assert!(said.contains("did not see (") && said.contains(&format!(") it is {worst}")), "{worst}: {said}");
    let blocks = json["blocks"].as_u64().unwrap();
    let many = format!("32 parameters were determined from {blocks} independent poses of the arm (45 measured)");
    assert!(said.contains("Check one point before signing") && html.contains(&many), "{said}");
    // each parameter with an interval about its value that is two standard deviations to each side
    let rows: Vec<Vec<&str>> = html
        .split("<tr>")
        .map(|r| r.split("<td").skip(1).map(|c| c.split("</td>").next().unwrap().split_once('>').unwrap().1).collect())
        .collect();
    for p in json["parameters"].as_array().unwrap() {
        let name = p["name"].as_str().unwrap();
        let row = rows.iter().find(|r| r.len() == 7 && r[0] == name).unwrap_or_else(|| panic!("{name} is missing"));
        let [low, high] = [row[3], row[4]].map(|x| x.parse::<f64>().unwrap());
        let sd = p["sd"].as_f64().unwrap();
        assert!((((high - low) / sd) - 3.966).abs() < 0.3 && low < p["value"].as_f64().unwrap(), "{row:?} {sd}");
    }
    for pair in json["correlated"].as_array().unwrap() {
        let of = |k: usize| pair[k].as_str().unwrap();
        assert!(html.contains(&format!("<td>{}</td><td>{}</td>", of(0), of(1))), "{pair}");
    }
    // the same to the byte
    place.good(&identify);
    assert_eq!(html, text_of(&place.path("i.html")));

    let json = place.json(&[&identify[..], &["--cross-validate", "5"]].concat());
    let html = text_of(&place.path("i.html"));
    let folds = html.split("poses that the fit did not see, by block of poses, 5 folds").nth(1).unwrap();
    let row = folds.split("</tr>").next().unwrap();
    assert!(row.contains(&mm(&json["cross_validation"]["mean_mm"])), "{row}");
    // the map of errors has the numbers of the export
    let export = words("export --model out.toml --error-map m.csv --poses 6000 --json");
    let map = place.json(&export);
    assert_eq!(map, place.json(&export), "it may be written again: it is no recording");
    let part = html.split("Position error of the nominal arm over its whole workspace").nth(1).unwrap();
    for number in ["mean_mm", "max_mm"] {
        assert!(part.contains(&mm(&map["error_map"][number])), "{number}: {map}");
    }
    assert!(drawn(&place.path("i.html")).is_none_or(|n| n == 5));

    let validate = |recording: &str| {
        let out = ["--model", "out.toml", "--report", "v.html", "--json"];
        place.json(&[&["validate", recording][..], &CELL_ARGS, &out].concat())
    };
    let v = validate("run.csv");
    let html = self_contained(&place.path("v.html"), &["run.csv", "robot.toml", "cell.toml", "out.toml"]);
    let said = verdict(&html);
    for number in [&v["before"]["mean_mm"], &v["before"]["max_mm"], &v["after"]["mean_mm"], &v["after"]["max_mm"]] {
        assert!(said.contains(&mm(number)), "{number}: {said}");
    }
    assert!(html.contains("The model was fitted to run.csv: these errors say nothing about other poses."));
    for r in v["regions"].as_array().unwrap() {
        assert!(html.contains(&format!("<td>{}</td>", r["region"].as_str().unwrap())), "{r}");
    }
    assert!(drawn(&place.path("v.html")).is_none_or(|n| n == 11));
    // known again under another name, by what it holds; a name is no markup
    place.write("other <b>.csv", place.bytes("run.csv"));
    let v = validate("other <b>.csv");
    assert_eq!(v["sessions"][0]["learnt"], 1);
    let html = text_of(&place.path("v.html"));
    assert!(html.contains("The model was fitted to other &lt;b&gt;.csv: these errors") && !html.contains("<b>"));
    // and so is a part of it, but not the same poses measured anew
    changed(&place, "iz_mm", 1e-3, "other <b>.csv");
    assert_eq!(validate("other <b>.csv")["sessions"][0]["learnt"], 1);
    place.write("other <b>.csv", measured_anew(&place.text("run.csv")));
    assert!(validate("other <b>.csv")["sessions"][0]["learnt"].is_null());
    let html = text_of(&place.path("v.html"));
    assert!(!html.contains("these errors say nothing about other poses"));
    assert!(html.contains("&#x27;other &lt;b&gt;.csv&#x27;"));
}

#[test]
fn a_certificate_is_one_page_with_the_numbers_of_the_model() {
    let place = demo();
    let json = place.json(&in_cell("identify run.csv --out out.toml --certificate c.html --json"));
    let mm = |v: &serde_json::Value| format!("{:.3}", v.as_f64().unwrap());
    let html = text_of(&place.path("c.html"));
    // every pose was visited once: AP is the error, RP is not known
    let accuracy = html.split("Pose accuracy AP").nth(1).unwrap().split("</tr>").next().unwrap();
    for number in ["mean_nominal_mm", "max_nominal_mm", "mean_mm", "max_mm"] {
        assert!(accuracy.contains(&mm(&json[number])), "{number}: {accuracy}");
    }
    assert!(!html.contains("Pose repeatability") && html.contains("RP is not known"));
    assert!(html.contains("Measurements within 0.1 mm</td>") && html.contains(">100.0 %</td>"));
    assert!(html.contains("poses of the fit") && html.contains("Serial number"));
    match Command::new("sha256sum").arg(place.path("out.toml")).output() {
        Ok(o) => assert!(html.contains(&String::from_utf8_lossy(&o.stdout)[..64]), "the model's own hash"),
        Err(e) => println!("skipped: sha256sum: {e}"),
    }
    let said = place.good(&in_cell("validate run.csv --model out.toml --certificate v.html"));
    assert!(said.contains("The model was fitted to run.csv") && said.contains("Wrote v.html"), "{said}");
    let html = text_of(&place.path("v.html"));
    assert!(html.contains("The model was fitted to run.csv"));
    // one sheet of paper
    let Some(chromium) = chromium() else { return };
    // A4 with its margins, in pixels of a 96th of an inch
    let measure = "<script>onload = () => { const high = document.body.scrollHeight;\
                   if (high > 1017) console.log('longer than a page: ' + high); }</script></body>";
    let paper = place.path("v.paper.html");
    let html = html.replace("@media print", "@media all").replace("</body>", measure);
    std::fs::write(&paper, html.replace("<body>", "<body style=\"width: 688px\">")).unwrap();
    seen(chromium, &paper);
}

#[test]
fn what_was_rejected_is_named_in_the_report() {
    let place = demo();
    let line = changed(&place, "q1_deg", 1.5, "bad.csv");
    place.good(&in_cell("identify bad.csv --report i.html"));
    let html = text_of(&place.path("i.html"));
    assert!(html.contains("Rejected: 1 of 45 rows"), "{}", verdict(&html));
    assert!(html.contains(&format!("<td>bad.csv</td><td>line {line}</td>")));
    // kept, it is told that it was
    place.good(&in_cell("identify bad.csv --report i.html --keep-outliers"));
    let html = text_of(&place.path("i.html"));
    assert!(html.contains("Gross errors were kept") && html.contains("No row was rejected"));
}

#[test]
fn reports_of_demo_plan_and_diagnosis_are_drawn_without_a_network() {
    let place = demo();
    self_contained(&place.path("plan.html"), &[]);
    self_contained(&place.path("report.html"), &[]);
    assert!(drawn(&place.path("plan.html")).is_none_or(|n| n == 0));
    assert!(drawn(&place.path("report.html")).is_none_or(|n| n == 5));
    place.good(&in_cell("diagnose run.mcap --report d.html"));
    self_contained(&place.path("d.html"), &["run.mcap", "robot.toml", "cell.toml"]);
    let html = text_of(&place.path("d.html"));
    assert!(html.contains("in what is left. This data could not show "));
    assert!(html.contains(">31 parameters<") && html.contains("<td>c_2</td>"));
    // nothing was found: there is no before
    assert!(drawn(&place.path("d.html")).is_none_or(|n| n == 10));
}

#[test]
fn a_report_into_nowhere_is_refused_before_any_work() {
    let place = Place::new();
    for command in ["identify r.csv", "validate r.csv --model m.toml"] {
        let o = place.run(&in_cell(&format!("{command} --report no/where.html")));
        let err = errors(&o);
        assert_eq!(o.status.code(), Some(2), "{err}");
        assert!(err.contains("the folder no does not exist") && err.trim().lines().count() == 1, "{err}");
    }
}
