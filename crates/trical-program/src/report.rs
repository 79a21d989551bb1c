//! What is told of a compensated program.

use std::cmp::Ordering;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;

use serde_json::{Value, json};
use trical_model::error::Lines;
use trical_model::{Joints, Pose};

use crate::branch::Configuration;
use crate::compensation::Done;
use crate::dialects::Dialect;
use crate::folders::name_of;
use crate::frames::AT;
use crate::options::{Options, Spelling};
use crate::scan::{Scan, Setup, Spot, Visit};
use crate::text::{Span, listed};

/// A target that stays as it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// The file, where a program has several; else empty.
    pub file: String,
    /// Its line (1-based).
    pub line: usize,
    /// Its name, where it has one.
    pub name: String,
    /// Why.
    pub what: String,
}

impl std::fmt::Display for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.place(), self.what)
    }
}

/// Problems in one line: the first few reasons, each with the first few targets that have it.
#[must_use]
pub fn summarized(problems: &[Problem], spelling: Spelling) -> String {
    let mut reasons: Vec<(&str, Vec<&Problem>)> = Vec::new();
    let mut left = 0;
    for p in problems {
        if let Some((_, list)) = reasons.iter_mut().find(|(what, _)| *what == p.what) {
            list.push(p);
        } else if reasons.len() < REASONS {
            reasons.push((&p.what, vec![p]));
        } else {
            left += 1;
        }
    }
    let mut out: Vec<String> = reasons
        .iter()
        .map(|(what, list)| {
            let mut places: Vec<String> = list.iter().take(PLACES).map(|p| p.place()).collect();
            if list.len() > PLACES {
                places.push(format!("{} more", list.len() - PLACES));
            }
            format!("{}: {what}", places.join(", "))
        })
        .collect();
    if left > 0 {
        out.push(format!("{left} more of other kinds ({} lists all)", spelling.of("check")));
    }
    out.join("; ")
}

/// Reasons, and targets of each, that [`summarized`] shows.
const REASONS: usize = 8;
const PLACES: usize = 5;

impl Problem {
    fn place(&self) -> String {
        let file = if self.file.is_empty() { String::new() } else { format!("{}, ", self.file) };
        let name = if self.name.is_empty() { String::new() } else { format!(" ({})", self.name) };
        format!("{file}line {}{name}", self.line)
    }
}

/// One rewritten target.
#[derive(Clone, Debug)]
pub struct TargetRow {
    /// The file, where a program has several; else empty.
    pub file: String,
    /// Its line (1-based).
    pub line: usize,
    /// Its name, where it has one.
    pub name: String,
    /// How far it moved, m.
    pub moved: f64,
    /// By the model, how far the arm is off with the program as it was, m.
    pub before: f64,
    /// By the model, how far the arm is off with the numbers as written, m.
    pub after: f64,
    /// What the program wants: the tool in {w}.
    pub wanted: Pose,
    /// Joints to which the controller goes with the numbers as written.
    pub joints: Joints,
    /// How far off a coordinate of the tool's position may still be there, m (standard deviation), if whoever has the model says so.
    pub deviation: Option<f64>,
}

/// A motion to a place that is relative to a rewritten target: it takes that target's correction along.
#[derive(Clone, Debug)]
pub struct Relative {
    /// The file, where a program has several; else empty.
    pub file: String,
    /// Its line (1-based).
    pub line: usize,
    /// By the model, how far the arm is off there with the program as it was and as it is, m; `None` where only the running program knows
    /// how far from the target the place is.
    pub off: Option<(f64, f64)>,
}

/// What was done.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Targets that were rewritten.
    pub rewritten: usize,
    /// Targets that were not.
    pub problems: Vec<Problem>,
    /// Targets that were rewritten although the model was not learnt at their joint angles: how many, and the first of them.
    pub beyond: usize,
    pub(crate) first_beyond: Vec<Problem>,
    /// Farthest that a target moved, m.
    pub largest_move: f64,
    /// Mean and largest error that the model predicts with the program as it was, m.
    pub before: [f64; 2],
    /// Mean and largest error that the model predicts with the numbers as written, m.
    pub after: [f64; 2],
    /// Mean and largest error of orientation, before and after, rad.
    pub turned: [[f64; 2]; 2],
    /// Number of targets with each tool and frame, in words.
    pub setups: Vec<(String, usize)>,
    /// Rewritten targets one by one, if asked for.
    pub rows: Vec<TargetRow>,
    /// Motions that are relative to rewritten targets, in the order of the lines.
    pub relative: Vec<Relative>,
    /// Motions to places that only the running program knows.
    pub unknown_places: usize,
    /// What whoever drives the program has to know besides.
    pub cautions: Vec<String>,
    /// Files that were read with the program without being named, for its tools, frames and targets.
    pub read_with: Vec<String>,
    /// Files that were written.
    pub written: Vec<String>,
}

impl Report {
    /// Notes for each row what the model's file says of its standard deviation (m) at joint values.
    pub fn expect(&mut self, deviation: impl Fn(&Joints) -> f64) {
        self.rows.iter_mut().for_each(|r| r.deviation = Some(deviation(&r.joints)));
    }

    /// What is to be known of motions relative to rewritten targets, in one sentence; `None` where there are none.
    #[must_use]
    pub fn relative_in_words(&self) -> Option<String> {
        let place =
            |r: &Relative| if r.file.is_empty() { r.line.to_string() } else { format!("{}:{}", r.file, r.line) };
        let places = |list: &[&Relative]| {
            let mut all: Vec<String> = list.iter().take(PLACES).map(|r| place(r)).collect();
            if list.len() > PLACES {
                all.push(format!("{} more", list.len() - PLACES));
            }
            format!("line{} {}", if list.len() == 1 { "" } else { "s" }, all.join(", "))
        };
        let (known, unknown): (Vec<&Relative>, Vec<&Relative>) = self.relative.iter().partition(|r| r.off.is_some());
        let worst =
            known.iter().max_by(|a, b| a.off.unzip().1.partial_cmp(&b.off.unzip().1).unwrap_or(Ordering::Equal));
        let mut said = Vec::new();
        if let Some((worst, (before, after))) = worst.and_then(|r| r.off.map(|o| (r, o))) {
            let (after, before) = (after * 1e3, before * 1e3);
            said.push(match known.len() {
                1 => format!("at {}, {after:.3} of {before:.3} mm remain by the model", places(&known)),
                _ => format!(
                    "at {}, at most {after:.3} of {before:.3} mm remain by the model (line {})",
                    places(&known),
                    place(worst)
                ),
            });
        }
        if !unknown.is_empty() {
            said.push(format!("at {}, how far from it only the running program knows", places(&unknown)));
        }
        (!said.is_empty())
            .then(|| format!("positions relative to a target get that target's correction: {}", said.join("; ")))
    }

    /// As JSON, in mm and deg; with the rows where there are any.
    #[must_use]
    pub fn json(&self, dialect: Dialect) -> Value {
        let mm = |x: f64| x * 1e3;
        let both = |v: &[f64; 2], turn: &[f64; 2]| {
            json!({
                "mean_mm": mm(v[0]), "max_mm": mm(v[1]),
                "mean_deg": turn[0].to_degrees(), "max_deg": turn[1].to_degrees(),
            })
        };
        let mut value = json!({
            "targets": self.rewritten,
            "largest_move_mm": mm(self.largest_move),
            "problems": self.problems.iter().map(ToString::to_string).collect::<Vec<_>>(),
            "dialect": dialect.name(),
            "before": both(&self.before, &self.turned[0]),
            "after": both(&self.after, &self.turned[1]),
            "meant_with":
                self.setups.iter().map(|(s, n)| json!({ "tool_and_frame": s, "targets": n })).collect::<Vec<_>>(),
            "relative": self.relative.iter().map(|r| {
                let mut row = json!({ "line": r.line, "before_mm": r.off.map(|o| mm(o.0)), "after_mm": r.off.map(|o| mm(o.1)) });
                if !r.file.is_empty() {
                    row["file"] = json!(r.file);
                }
                row
            }).collect::<Vec<_>>(),
            "unknown_places": self.unknown_places,
            "beyond": self.beyond,
        });
        if !self.rows.is_empty() {
            value["rows"] = self
                .rows
                .iter()
                .map(|r| {
                    let mut row = json!({
                        "line": r.line, "name": r.name, "move_mm": mm(r.moved),
                        "before_mm": mm(r.before), "after_mm": mm(r.after),
                    });
                    if let Some(deviation) = r.deviation {
                        row["sd_mm"] = json!(mm(deviation));
                    }
                    if !r.file.is_empty() {
                        row["file"] = json!(r.file);
                    }
                    row
                })
                .collect();
        }
        // the one file that was asked for is not told again
        let written = if self.written.len() > 1 { &self.written[..] } else { &[] };
        for (key, list) in [("cautions", &self.cautions[..]), ("read_with", &self.read_with), ("written", written)] {
            if !list.is_empty() {
                value[key] = json!(list);
            }
        }
        value
    }
}

/// Of KUKA's status: the point was taught on an absolutely accurate robot.
const ABSOLUTE: u16 = 16;

/// Counts while targets are rewritten.
pub(crate) struct Tally<'a> {
    scan: &'a Scan,
    bytes: &'a [u8],
    options: &'a Options,
    lines: Lines<'a>,
    /// Where each of several files begins: offset, its first line, name.
    files: Vec<(usize, usize, String)>,
    /// Lines of the offsets in names ([`AT`]).
    given: HashMap<usize, (String, usize)>,
    report: Report,
    counts: Vec<usize>,
}

impl<'a> Tally<'a> {
    pub fn new(scan: &'a Scan, bytes: &'a [u8], files: Vec<(usize, String)>, options: &'a Options) -> Self {
        let unknown_places = scan.visits.iter().filter(|v| matches!(v, Visit::Unknown)).count();
        let report = Report { unknown_places, ..Report::default() };
        let mut lines = Lines::new(bytes);
        let files = files.into_iter().map(|(at, name)| (at, lines.of(at), name)).collect();
        Self {
            scan,
            bytes,
            options,
            lines,
            files,
            given: HashMap::new(),
            report,
            counts: vec![0; scan.setups.len() + 1],
        }
    }

    /// The file (empty where there is one only) and the line of an offset.
    fn line(&mut self, at: usize) -> (String, usize) {
        let line = self.lines.of(at);
        match self.files.iter().rev().find(|(begin, ..)| *begin <= at) {
            Some((_, first, name)) => (name.clone(), line + 1 - first),
            None => (String::new(), line),
        }
    }

    /// Words, said of a place in this file, in which the line stands for the offset of what has no name of its own.
    fn with_lines(&mut self, words: &str, file: &str) -> String {
        let mut pieces = words.split(AT);
        let mut out = pieces.next().unwrap_or_default().to_owned();
        for piece in pieces {
            let digits = piece.bytes().take_while(u8::is_ascii_digit).count();
            let (at, behind) = piece.split_at(digits);
            let at = at.parse().unwrap_or(0);
            let (own, line) = self.given.get(&at).cloned().unwrap_or_else(|| {
                // far above the targets: lines are counted from the last one that was asked for
                let lines = std::mem::replace(&mut self.lines, Lines::new(self.bytes));
                let place = self.line(at);
                self.lines = lines;
                self.given.insert(at, place.clone());
                place
            });
            let of = if own == file || file.is_empty() {
                String::new()
            } else {
                format!(" of {}", name_of(Path::new(&own)))
            };
            out += &format!(" in line {line}{of}{behind}");
        }
        out
    }

    fn problem_at(&mut self, at: usize, name: Span, what: String) -> Problem {
        let name = String::from_utf8_lossy(name.text(self.bytes)).into_owned();
        let (file, line) = self.line(at);
        Problem { file, line, name, what }
    }

    fn problem(&mut self, spot: &Spot, what: &str) -> Problem {
        let mut problem = self.problem_at(self.scan.at(spot), self.scan.written(spot).name, String::new());
        problem.what = self.with_lines(what, &problem.file);
        problem
    }

    /// Where something of this name stands, in words.
    fn place(&mut self, at: usize, name: Span) -> String {
        self.problem_at(at, name, String::new()).place()
    }

    /// Loads that nobody has read, in one sentence.
    pub fn loads(&mut self) -> Option<String> {
        let scan = self.scan;
        let all = listed(scan.loads.iter().map(|at| format!("line {}", self.line(*at).1)));
        (!all.is_empty()).then(|| {
            let payload = self.options.spelling.of("payload_kg");
            format!("the program says what the arm carries ({all}), which is not read: the arm's sag is corrected for the tool alone ({payload} adds a load)")
        })
    }

    /// Routines that nobody has read, in one sentence.
    pub fn called_elsewhere(&mut self) -> Option<String> {
        let scan = self.scan;
        let all = listed(scan.calls.iter().map(|c| format!("{} (line {})", c.name, self.line(c.at).1)));
        (!all.is_empty()).then(|| {
            format!("calls routines that are in none of the files read: {all}; they are taken to leave tools, frames and targets that they are not given as they are")
        })
    }

    /// Motions to the cell's home, in one sentence.
    pub fn homes(&mut self) -> Option<String> {
        let scan = self.scan;
        let all = listed(scan.homes.iter().map(|(at, name)| format!("{name} (line {})", self.line(*at).1)));
        (!all.is_empty()).then(|| {
            format!("goes to a home that belongs to all programs of the controller: {all}; it stays as it is, and is not corrected")
        })
    }

    /// Points that were taught with the controller's own calibration, in one sentence.
    pub fn absolutely_accurate(&mut self) -> Option<String> {
        let scan = self.scan;
        let is_one =
            |s: &&Spot| matches!(scan.configuration(s), Configuration::Kuka { s: Some(s), .. } if s & ABSOLUTE != 0);
        let first = scan.spots.iter().find(is_one)?;
        let line = self.line(scan.at(first)).1;
        Some(format!(
            "{} of {} targets were taught on an absolutely accurate robot (bit 4 of S, the first in line {line}): if the controller's own calibration is \
             switched on, it corrects the arm too, and both together make it worse",
            scan.spots.iter().filter(is_one).count(),
            scan.spots.len()
        ))
    }

    /// Targets of which nothing says with which tool and frame they are meant, in one sentence.
    pub fn unsaid(&mut self) -> Option<String> {
        let scan = self.scan;
        let says =
            |s: &Spot| s.setup().and_then(|k| scan.setups.get(k as usize)).is_some_and(|s| *s != Setup::default());
        let is_unsaid = |s: &&Spot| !s.shape.is_joints() && !says(s);
        let first = scan.spots.iter().find(is_unsaid)?;
        let first = self.place(scan.at(first), Span::default());
        Some(format!(
            "nothing in the files read sets a tool or a base for {} of {} targets (the first in {first}): the cell's tool in the robot's base is taken \
             ({} and {} say others)",
            scan.spots.iter().filter(is_unsaid).count(),
            scan.spots.len(),
            self.options.spelling.of("tool"),
            self.options.spelling.of("frame")
        ))
    }

    /// A target that is taken in spite of its turn, in one sentence.
    pub fn without_turn(&mut self, spot: u32) -> Option<String> {
        let scan = self.scan;
        let spot = scan.spots.get(spot as usize)?;
        let Configuration::Kuka { s, t: Some(t) } = scan.configuration(spot) else { return None };
        let place = self.place(scan.at(spot), scan.written(spot).name);
        let status =
            if s.is_some() { "that fits its S best" } else { "nearest to the target before, or to joints at zero," };
        Some(format!(
            "{place}: no joints of the arm have its T {t}, which the controller ignores on a path: the solution {status} is used; a motion to joint \
             values before it would define it"
        ))
    }

    /// Targets whose configuration the arm does not have there, in one sentence.
    pub fn unlike(&mut self, (count, first): (usize, Option<u32>)) -> Option<String> {
        let scan = self.scan;
        let spot = scan.spots.get(first? as usize)?;
        let place = self.place(scan.at(spot), scan.written(spot).name);
        let (targets, their) = if count == 1 { ("1 target", "its") } else { (&*format!("{count} targets"), "their") };
        Some(format!(
            "no joints of the arm have all of the configuration that the text gives for {targets} (the first in {place}): the one nearest to it is used; \
             check {their} tool and frame"
        ))
    }

    /// Targets to which the program comes in several configurations, in one sentence.
    pub fn otherwise(&mut self, spots: &BTreeSet<u32>) -> Option<String> {
        let scan = self.scan;
        let places = spots.iter().filter_map(|k| scan.spots.get(*k as usize));
        let places: Vec<String> = places.map(|s| self.place(scan.at(s), scan.written(s).name)).collect();
        (!places.is_empty()).then(|| {
            format!(
                "by how the program comes there (a branch, a loop, a call, other motions before), the arm reaches {} in several configurations \
                 (shoulder, elbow, wrist), and is corrected for one of them; a motion to joint values before it would define it",
                listed(places.into_iter())
            )
        })
    }

    /// Targets that nothing uses, in one sentence.
    pub fn unused(&mut self) -> Option<String> {
        let their = |n| if n == 1 { "its" } else { "their" };
        self.stay(&self.scan.unused, |n| format!("because nothing in the files read uses {} numbers", their(n)))
    }

    /// Targets to which nothing moves while other statements use them, in one sentence.
    pub fn only_read(&mut self) -> Option<String> {
        self.stay(&self.scan.only_read, |n| {
            let there = if n == 1 { "it" } else { "them" };
            format!("because no motion in the files read goes to {there}, and other statements use {there}")
        })
    }

    /// Targets that stay as they are, in one sentence.
    fn stay(&mut self, all: &[(usize, Span)], why: impl Fn(usize) -> String) -> Option<String> {
        let mut places: Vec<String> = Vec::new();
        for (at, name) in all {
            let place = self.place(*at, *name);
            if places.last() != Some(&place) {
                places.push(place);
            }
        }
        let n = all.len();
        let (targets, stay) = if n == 1 { ("target", "stays as it is") } else { ("targets", "stay as they are") };
        (n > 0).then(|| format!("{n} {targets} {stay}, {}: {}", why(n), listed(places.into_iter())))
    }

    pub fn take(&mut self, spot: &Spot, done: Result<Done, String>) {
        let done = match done {
            Ok(done) => done,
            Err(what) => {
                let problem = self.problem(spot, &what);
                return self.report.problems.push(problem);
            }
        };
        if let Some(n) = self.counts.get_mut(spot.setup().map_or(self.scan.setups.len(), |s| s as usize)) {
            *n += 1;
        }
        if let Some(joint) = self.options.visited.beyond(&done.joints) {
            self.report.beyond += 1;
            if self.report.first_beyond.len() < PLACES {
                let problem = self.problem(spot, &format!("joint {joint}"));
                self.report.first_beyond.push(problem);
            }
        }
        if self.options.details {
            let Problem { file, line, name, .. } = self.problem(spot, "");
            self.report.rows.push(TargetRow {
                file,
                line,
                name,
                moved: done.moved,
                before: done.before.0,
                after: done.after.0,
                wanted: done.wanted,
                joints: done.joints,
                deviation: None,
            });
        }
        let r = &mut self.report;
        r.rewritten += 1;
        r.largest_move = r.largest_move.max(done.moved);
        let [before, after] = &mut r.turned;
        for (sums, x) in [
            (&mut r.before, done.before.0),
            (&mut r.after, done.after.0),
            (before, done.before.1),
            (after, done.after.1),
        ] {
            sums[0] += x;
            sums[1] = sums[1].max(x);
        }
    }

    /// A motion relative to a target that was rewritten.
    pub fn relative(&mut self, at: u32, off: Option<(f64, f64)>) {
        let (file, line) = self.line(at as usize);
        let here = |r: &&mut Relative| r.line == line && r.file == file;
        match self.report.relative.iter_mut().find(here) {
            // several on one line: the worst
            Some(known) => known.off = known.off.zip(off).map(|(a, b)| if a.1 > b.1 { a } else { b }),
            None => self.report.relative.push(Relative { file, line, off }),
        }
    }

    pub fn report(mut self) -> Report {
        if self.report.beyond > 0 {
            let first: Vec<String> = self.report.first_beyond.iter().map(ToString::to_string).collect();
            let more = if self.report.beyond > first.len() { ", and more" } else { "" };
            self.report.cautions.push(format!(
                "{} of {} targets are {}: {}{more}",
                self.report.beyond,
                self.report.rewritten,
                self.options.visited.beyond_in_words(),
                first.join(", ")
            ));
        }
        for (at, what) in &self.scan.problems {
            let problem = self.problem_at(*at, Span::default(), what.clone());
            self.report.problems.push(problem);
        }
        let unsaid = Setup::default();
        let said = |s: &Setup| {
            let or = |own: &Option<String>, asked: &Option<String>| own.clone().or_else(|| asked.clone());
            (Setup { tool: or(&s.tool, &self.options.tool), frame: or(&s.frame, &self.options.frame) }).in_words()
        };
        let used: Vec<(String, usize)> = (self.scan.setups.iter().chain(std::iter::once(&unsaid)))
            .zip(&self.counts)
            .filter(|(_, n)| **n > 0)
            .map(|(setup, n)| (said(setup), *n))
            .collect();
        for (words, n) in used {
            let words = self.with_lines(&words, "");
            match self.report.setups.iter_mut().find(|(w, _)| *w == words) {
                Some((_, m)) => *m += n,
                None => self.report.setups.push((words, n)),
            }
        }
        let mut r = self.report;
        r.relative.sort_by(|a, b| (&a.file, a.line).cmp(&(&b.file, b.line)));
        r.problems.sort_by(|a, b| (&a.file, a.line).cmp(&(&b.file, b.line)));
        let n = r.rewritten.max(1) as f64;
        let [before, after] = &mut r.turned;
        for sums in [&mut r.before, &mut r.after, before, after] {
            sums[0] /= n;
        }
        r
    }
}
