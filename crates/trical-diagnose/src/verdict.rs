//! What a diagnosis comes to, in plain sentences and as a table: each claim at the finest level that is sure.

use trical_model::{Place, Robot};

use crate::diagnosis::{Finding, RowKind, Unexplained, Verdict, VerdictRow};
use crate::effect_id::{EffectId, UNEXPLAINED};
use crate::effects::Family;
pub use crate::effects::coefficient;
use crate::words::{numbered, percents, period, variables};
pub use crate::words::{region, small, variable};
pub use trical_ident::compare::capital;

/// From here on a claim is said as a fact.
const LIKELY: f64 = 0.5;

/// Findings that take less of what can be explained are summed up in the summary; what is less of the squared error that is left is not told.
const SMALL_SHARE: f64 = 0.01;

/// Claims with less of a probability are told with their strongest rival.
const RIVAL_TOLD_BELOW: f64 = 0.9;

/// A name that is less sure than this, of a place that is not sure either, has no row of its own.
const LEAST_TOLD: f64 = 0.1;

/// A claim that lowers the error at unseen poses by a smaller part of it has no row of its own.
const LEAST_STEP: f64 = 0.01;

/// How it begins what a claim is if it is not what it says.
pub const IF_NOT: &str = "if not, ";

/// From here on a name is sure.
const SURE: f64 = 0.9;

/// Likely claims without a row of their own are still named, but so many of them at most.
pub const MOST_NAMED_IN_REST: usize = 3;

/// What is true of any data in which nothing was found: with few of them, or with much left, the model need not explain them.
const NOTHING: &str = "Nothing found: no known effect shows in what is left";

/// What to do about curves without a name: where the robot has no masses, ...
const GIVE_MASSES: &str =
    "Give the masses of the links in the robot file: without them few effects of gravity can be named.";
/// ... where a joint's error goes with its own angle, of one session and of several, ...
const OWN_ANGLE: [&str; 2] = [
    "Have the joint's gear and encoder checked; only what a second session shows again belongs to the arm.",
    "Have the joint's gear and encoder checked.",
];
/// ... with other angles, ...
const OTHER_ANGLES: [&str; 2] = [
    "Look for a cable or hose that pulls; only what a second session shows again belongs to the arm.",
    "Look for a cable or hose that pulls.",
];
/// ... with how it came there, ...
const LAST_MOVES: &str = "Wait longer before joints are read, and visit some poses from both sides: an error that then remains is backlash or \
    friction; one that disappears came from reading too early.";
/// ... with something else, of one session, ...
const OTHER: &str = "Measure a second session: only what it shows again belongs to the arm.";
/// ... or with time.
const IN_THE_COURSE: &str = "Find what changed while you measured (a screw, a temperature), and measure again.";

/// When it happened, where two sessions differ.
const BETWEEN_TWO: &str = " between the two sessions";

/// What was diagnosed.
#[derive(Clone, Copy)]
pub struct Given<'a> {
    /// The arm.
    pub robot: &'a Robot,
    /// There are several sessions.
    pub several: bool,
}

/// At which level a finding is said.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Level {
    Effect,
    Family,
    Place,
    Perhaps,
}

fn level(f: &Finding) -> (Level, f64) {
    if f.is_likely() {
        (Level::Effect, f.confidence)
    } else if f.family_confidence >= LIKELY {
        (Level::Family, f.family_confidence)
    } else if f.place_confidence >= LIKELY {
        (Level::Place, f.place_confidence)
    } else {
        (Level::Perhaps, f.confidence)
    }
}

/// " at joints 1 to 3", " at the tool"; nothing where the claim itself says where.
fn at(places: &[Place], claim: &str) -> String {
    let mut joints: Vec<usize> = Vec::new();
    let mut links: Vec<usize> = Vec::new();
    let mut others: Vec<String> = Vec::new();
    for place in places {
        match *place {
            Place::Joint(j) => joints.push(j),
            Place::Link(k) => links.push(k),
            Place::Coupling { joint, from } => others.push(format!("joint {joint}, from joint {from}")),
            Place::Axis(axis) => others.push(format!("axis {}", axis.name())),
            Place::Target(t) => others.push(format!("target {t}")),
            Place::Base if !claim.contains("base") => others.push("the base".into()),
            Place::Tool if !claim.contains("tool") && !claim.contains("flange") => others.push("the tool".into()),
            Place::Fixture if !claim.contains("balls") => others.push("the balls' fixture".into()),
            Place::Frame(_) if !claim.contains("instrument") => others.push("the measuring instrument".into()),
            Place::Links if !claim.contains("growth") => others.push("all links".into()),
            Place::Joints if !claim.contains("joints") => others.push("all joints".into()),
            Place::Ball(_) | Place::Anchor(_) => others.push(place.to_string()),
            _ => {}
        }
    }
    let mut all = Vec::new();
    all.extend(numbered("joint", joints));
    all.extend(numbered("link", links));
    all.extend(others);
    if all.is_empty() { String::new() } else { format!(" at {}", all.join(", ")) }
}

/// The claim without its probability: "lost motion at joint 3".
fn claim(f: &Finding, places: &[Place], sessions: &[u32]) -> String {
    let title = f.effect.effect().title;
    let comma = if sessions.len() > 1 { "," } else { "" };
    let when = numbered("session", sessions.iter().map(|s| *s as usize).collect()).filter(|_| !f.between_two);
    let between = if f.between_two { BETWEEN_TWO } else { "" };
    let when = when.map_or_else(|| between.to_owned(), |s| format!("{comma} in {s}"));
    let (perhaps, what) = match level(f).0 {
        Level::Effect => ("", title),
        Level::Family => ("", family(f.family)),
        Level::Place => return format!("something{}{when}", at(places, "")),
        Level::Perhaps => ("perhaps ", title),
    };
    format!("{perhaps}{what}{}{when}", at(places, what))
}

/// What is less sure of findings that are told by their family or their place: "perhaps backlash (40 %)".
fn less_sure(findings: &[&Finding]) -> Option<String> {
    let mut names: Vec<(&str, [f64; 2])> = Vec::new();
    let told = |f: &&&Finding| f.confidence >= LEAST_TOLD && matches!(level(f).0, Level::Family | Level::Place);
    for f in findings.iter().filter(told) {
        let (title, p) = (f.effect.effect().title, f.confidence);
        match names.iter_mut().find(|(name, _)| *name == title) {
            Some((_, of)) => *of = [of[0].min(p), of[1].max(p)],
            None => names.push((title, [p, p])),
        }
    }
    let names: Vec<String> = names.into_iter().map(|(name, of)| format!("{name} ({})", percents(of))).collect();
    (!names.is_empty()).then(|| format!("perhaps {}", names.join(" or ")))
}

/// An effect at a place in words: "Backlash or friction wind-up at joint 3".
#[must_use]
pub fn named(effect: EffectId, place: Place) -> String {
    let title = effect.effect().title;
    capital(&format!("{title}{}", at(&[place], title)))
}

/// The title of an effect by its identifier: "backlash or friction wind-up"; what has none is said as it is.
#[must_use]
pub fn title_of(identifier: &str) -> String {
    match EffectId::named(identifier) {
        Some(effect) => effect.effect().title.to_owned(),
        None if identifier == UNEXPLAINED => "curves of no known cause".to_owned(),
        None => identifier.to_owned(),
    }
}

/// Effect, place and session of a finding: "Backlash at joint 3", "Perhaps backlash at joint 3".
#[must_use]
pub fn heading(f: &Finding) -> String {
    let when = match f.session {
        _ if f.between_two => BETWEEN_TWO.to_owned(),
        Some(session) => format!(" in session {session}"),
        None => String::new(),
    };
    let name = named(f.effect, f.site) + &when;
    if f.is_likely() { name } else { format!("Perhaps {}", small(&name)) }
}

/// A finding in a plain sentence, at the finest level that is more likely right than not.
#[must_use]
pub fn summary(f: &Finding) -> String {
    let text = claim(f, &[f.site], f.session.as_slice());
    let perhaps = less_sure(&[f]).map_or_else(String::new, |p| format!(", {p}"));
    let [before, after] = [f.evidence.holdout_rms_before_mm, f.evidence.holdout_rms_after_mm];
    // two digits of the smaller one
    let decimals = (1.0 - libm::log10(before.min(after).max(1e-9)).floor()).clamp(3.0, 5.0) as usize;
    let gain = if after > before {
        // what pays is judged by how well each block can be predicted, the rms by the worst of them
        "with it in the model most blocks of poses that the fit did not see are predicted better, but over all of them the error"
    } else {
        "with it in the model the error at poses that the fit did not see"
    };
    format!(
        "{} ({}){perhaps}: {gain} goes from {before:.decimals$} to {after:.decimals$} mm rms.",
        capital(&text),
        percents([level(f).1; 2])
    )
}

/// A family in words.
#[must_use]
pub fn family(family: Family) -> &'static str {
    match family {
        Family::Transmission => "gear or encoder error",
        Family::LostMotion => "lost motion",
        Family::Elasticity => "elasticity",
        Family::Geometry => "geometry",
        Family::Load => "load",
        Family::Heat => "heat",
        Family::SomethingMoved => "something that moved",
        Family::Gauge => "the gauge",
        Family::Reading => "the reading of the joints",
    }
}

/// On what a mismatch without a known cause depends, in words.
fn depends_on(u: &Unexplained, robot: &Robot) -> String {
    match u.region.strip_prefix("all of ") {
        Some(of) => variables(&of.split(", with ").collect::<Vec<_>>(), robot),
        None => variable(&u.variable, robot),
    }
}

/// Whether a mismatch goes with time, so that it belongs to the session and not to the arm.
fn in_the_course(u: &Unexplained) -> bool {
    matches!(u.variable.as_str(), "seq" | "time")
}

/// Whether a variable is where a joint is: "q4".
fn is_joint(variable: &str) -> bool {
    variable.strip_prefix('q').is_some_and(|n| n.parse::<usize>().is_ok())
}

/// What the owner of the arm can do about the largest of some curves without a name.
fn what_to_do(u: &Unexplained, given: Given<'_>) -> Option<&'static str> {
    let several = usize::from(given.several);
    if in_the_course(u) {
        Some(IN_THE_COURSE)
    } else if ["dir", "travel"].iter().any(|moves| u.variable.starts_with(moves)) {
        Some(LAST_MOVES)
    } else if !is_joint(&u.variable) {
        (!given.several).then_some(OTHER)
    } else if given.robot.require_masses().is_err() {
        Some(GIVE_MASSES)
    } else if matches!(u.site, Place::Joint(joint) if u.variable == format!("q{joint}") && !u.region.contains(", with "))
    {
        Some(OWN_ANGLE[several])
    } else {
        Some(OTHER_ANGLES[several])
    }
}

/// What a row of the table sums up, before it has its place in it.
struct Step {
    /// Of findings, the first one; of curves without a name, none.
    first: Option<usize>,
    places: Vec<Place>,
    /// In which sessions, of findings that are not of all.
    sessions: Vec<u32>,
    findings: Vec<usize>,
    /// The curves without a name, as indices, the one that takes most first.
    curves: Vec<usize>,
    confidence: Option<[f64; 2]>,
    /// By how much it lowers the squared error at unseen poses, mm^2.
    gain: f64,
}

fn gain(before: f64, after: f64) -> f64 {
    before * before - after * after
}

/// Findings that say the same of several joints are one step, or of one place in several sessions, and so are all of which no more is sure than
/// their place, and all curves without a name: those that go with what the arm does, and those that go with time.
fn steps(findings: &[Finding], unexplained: &[Unexplained]) -> Vec<Step> {
    let mut steps: Vec<Step> = Vec::new();
    for (k, f) in findings.iter().enumerate() {
        let (said_at, p) = level(f);
        let gain = gain(f.evidence.holdout_rms_before_mm, f.evidence.holdout_rms_after_mm);
        let alike = |s: &&mut Step| {
            s.first.is_some_and(|first| {
                let o = &findings[first];
                let again = f.session.is_some() && !s.sessions.is_empty() && s.places.iter().all(|p| *p == f.site);
                let same = if said_at == Level::Place { o.site == f.site } else { o.effect == f.effect };
                same && level(o).0 == said_at && (s.sessions == f.session.as_slice() || again)
            })
        };
        if let Some(s) = steps.iter_mut().find(alike) {
            s.places.push(f.site);
            s.sessions.extend(f.session.filter(|_| s.sessions != f.session.as_slice()));
            s.findings.push(k + 1);
            s.confidence = s.confidence.map(|[low, high]| [low.min(p), high.max(p)]);
            s.gain += gain;
        } else {
            steps.push(Step {
                first: Some(k),
                places: vec![f.site],
                sessions: f.session.into_iter().collect(),
                findings: vec![k + 1],
                curves: Vec::new(),
                confidence: Some([p, p]),
                gain,
            });
        }
    }
    let of = |u: &Unexplained| gain(u.holdout_rms_before_mm, u.holdout_rms_after_mm);
    for course in [false, true] {
        let alike = |(_, u): &(usize, &Unexplained)| u.modelled && in_the_course(u) == course;
        let mut curves: Vec<(usize, &Unexplained)> = unexplained.iter().enumerate().filter(alike).collect();
        curves.sort_by(|(_, a), (_, b)| of(b).total_cmp(&of(a)));
        if !curves.is_empty() {
            steps.push(Step {
                first: None,
                places: curves.iter().map(|(_, u)| u.site).collect(),
                sessions: Vec::new(),
                findings: Vec::new(),
                curves: curves.iter().map(|(k, _)| *k).collect(),
                confidence: None,
                gain: curves.iter().map(|(_, u)| of(u)).sum(),
            });
        }
    }
    // what is sure comes before what is as large and is not
    let weight = |s: &Step| s.gain * s.confidence.map_or(1.0, |[low, high]| 0.5 * (low + high));
    steps.sort_by(|a, b| weight(b).total_cmp(&weight(a)));
    steps
}

/// A row that claims nothing about an effect.
fn plain_row(kind: RowKind, text: String, [before_mm, after_mm]: [f64; 2]) -> VerdictRow {
    let corrected = kind != RowKind::Unexplained;
    VerdictRow {
        kind,
        text,
        perhaps: None,
        confidence: None,
        before_mm,
        after_mm,
        action: None,
        corrected,
        findings: Vec::new(),
    }
}

/// The row of curves without a name.
fn curves_row(step: &Step, unexplained: &[Unexplained], given: Given<'_>, errors: [f64; 2]) -> VerdictRow {
    let where_ = at(&step.places, "");
    let Some(largest) = step.curves.first().and_then(|k| unexplained.get(*k)) else {
        return plain_row(RowKind::Curves, format!("No known cause: smooth curves{where_}"), errors);
    };
    let text = if in_the_course(largest) {
        format!("No known cause: change in the course of a session{where_}")
    } else if let [_] = step.curves.as_slice() {
        format!("No known cause: smooth curve{where_} over {}", depends_on(largest, given.robot))
    } else {
        let most = at(&[largest.site], "");
        format!("No known cause: smooth curves{where_}, the largest{most} over {}", depends_on(largest, given.robot))
    };
    VerdictRow {
        action: what_to_do(largest, given),
        corrected: !in_the_course(largest),
        ..plain_row(RowKind::Curves, text, errors)
    }
}

fn row_of(findings: &[Finding], first: usize, step: &Step, [before_mm, after_mm]: [f64; 2]) -> VerdictRow {
    let f = &findings[first];
    let said_at = level(f).0;
    let all: Vec<&Finding> = step.findings.iter().map(|k| &findings[k - 1]).collect();
    let told = if f.confidence < RIVAL_TOLD_BELOW { &f.rivals[..] } else { &[] };
    let elsewhere: Vec<String> = told
        .iter()
        .filter(|r| r.effect == f.effect && step.places.len() == 1)
        .map(|r| at(&[r.site], "").trim_start().to_owned())
        .collect();
    let instead = || (!elsewhere.is_empty()).then(|| format!("{IF_NOT}{}", elsewhere.join(" or ")));
    let rival = told.iter().find(|r| r.effect != f.effect && said_at == Level::Effect);
    VerdictRow {
        kind: RowKind::Finding,
        text: capital(&claim(f, &step.places, &step.sessions)),
        perhaps: less_sure(&all)
            .or_else(instead)
            .or_else(|| rival.map(|r| format!("{IF_NOT}{}", r.effect.effect().title))),
        confidence: step.confidence,
        before_mm,
        after_mm,
        action: (said_at == Level::Effect).then_some(f.action),
        corrected: f.corrected,
        findings: step.findings.clone(),
    }
}

/// What is too small or not sure enough for a row of its own: the surest by name, the others by their number.
fn rest_row(rows: &[&VerdictRow], most_named: usize, errors: [f64; 2]) -> VerdictRow {
    let mut findings: Vec<usize> = rows.iter().flat_map(|r| r.findings.iter().copied()).collect();
    findings.sort_unstable();
    let sure = |r: &&&VerdictRow| r.kind == RowKind::Finding && r.confidence.is_some_and(|[low, _]| low >= LIKELY);
    let mut named: Vec<&&VerdictRow> = rows.iter().filter(sure).collect();
    // what says what to do before what says no more than where
    named.sort_by_key(|r| r.action.is_none());
    named.truncate(most_named);
    // what the model does not correct is for its owner to mend
    let to_mend =
        |r: &VerdictRow| r.action.filter(|_| !r.corrected).map(|a| format!("; {}", small(a.trim_end_matches('.'))));
    let in_words = |r: &VerdictRow| {
        let sure: String = r.probability().into_iter().chain(to_mend(r)).collect();
        if sure.is_empty() { small(&r.text) } else { format!("{} ({sure})", small(&r.text)) }
    };
    let mut said: Vec<String> = named.iter().map(|r| in_words(r)).collect();
    if rows.iter().any(|r| r.kind == RowKind::Curves) {
        said.push("curves of no known cause".into());
    }
    let others = findings.len() - named.iter().map(|r| r.findings.len()).sum::<usize>();
    let finding = if others == 1 { "finding" } else { "findings" };
    let text = match (said.join(", "), others) {
        (named, 0) => format!("Also: {named}"),
        (named, n) if named.is_empty() => format!("{n} smaller or less sure {finding}"),
        (named, n) => format!("Also: {named}; {n} more {finding}"),
    };
    let corrected = rows.iter().any(|r| r.corrected);
    VerdictRow { findings, corrected, ..plain_row(RowKind::Rest, text, errors) }
}

/// The table. `models` has the number of parameters and the error at unseen poses (mm rms) of the plain and of the whole model.
fn rows(
    findings: &[Finding],
    unexplained: &[Unexplained],
    models: [(usize, f64); 2],
    given: Given<'_>,
) -> Vec<VerdictRow> {
    let [(plain, before), (whole, after)] = models;
    let mut rows = vec![plain_row(RowKind::Plain, format!("Plain model, {plain} parameters"), [before; 2])];
    let steps = steps(findings, unexplained);
    // findings that stand in for each other gain more one by one than together
    let (sum, together) = (steps.iter().map(|s| s.gain.max(0.0)).sum::<f64>(), before * before - after * after);
    let part = if sum > together { (together / sum).max(0.0) } else { 1.0 };
    let after_step = |here: f64, step: &Step| (here * here - part * step.gain).max(0.0).sqrt();
    let mut here = before;
    let (mut own, rest): (Vec<Step>, Vec<Step>) = steps.into_iter().partition(|step| {
        let next = after_step(here, step);
        let guessed = step.confidence.is_some_and(|[_, high]| high < LEAST_TOLD);
        let told = next <= here * (1.0 - LEAST_STEP) && !guessed;
        here = if told { next } else { here };
        told
    });
    // causes come before curves without one
    own.sort_by_key(|step| step.first.is_none());
    let row = |step: &Step, errors| match step.first {
        Some(first) => row_of(findings, first, step, errors),
        None => curves_row(step, unexplained, given, errors),
    };
    here = before;
    for step in &own {
        let next = after_step(here, step);
        rows.push(row(step, [here, next]));
        here = next;
    }
    if !rest.is_empty() {
        let rest: Vec<VerdictRow> = rest.iter().map(|step| row(step, [here; 2])).collect();
        rows.push(rest_row(&rest.iter().collect::<Vec<_>>(), MOST_NAMED_IN_REST, [here, after.min(here)]));
    }
    let of_some_size = |u: &&Unexplained| (u.rms_mm / after.max(1e-9)).powi(2) >= SMALL_SHARE;
    let left = unexplained
        .iter()
        .filter(of_some_size)
        .find(|u| !u.modelled && u.holdout_rms_before_mm <= after * (1.0 + 1e-9));
    rows.extend(left.map(|u| {
        let place = at(&[u.site], "");
        let text = format!(
            "Of what is left, {:.3} mm rms{place} goes with {}{}",
            u.rms_mm,
            variable(&u.variable, given.robot),
            period(&u.region).1
        );
        plain_row(RowKind::Unexplained, text, [after; 2])
    }));
    let last = if findings.is_empty() && unexplained.is_empty() {
        NOTHING.to_owned()
    } else {
        format!("Whole model, {whole} parameters")
    };
    rows.push(plain_row(RowKind::Whole, last, [after; 2]));
    rows
}

impl Finding {
    /// Whether its name is likelier right than not.
    #[must_use]
    pub fn is_likely(&self) -> bool {
        self.confidence >= LIKELY
    }

    /// Whether it takes little of the error, and neither its name nor its family is sure.
    #[must_use]
    pub fn is_small_and_unsure(&self) -> bool {
        self.share < SMALL_SHARE && self.confidence.max(self.family_confidence) < SURE
    }

    /// Whether its name is told however little it takes off the error.
    #[must_use]
    pub fn is_sure(&self) -> bool {
        self.confidence >= SURE
    }
}

impl VerdictRow {
    /// How probable the row is: "99 %", "75 to 99 %"; `None` where it claims nothing.
    #[must_use]
    pub fn probability(&self) -> Option<String> {
        self.confidence.map(percents)
    }
}

impl Verdict {
    /// The table with so many claims at most: the others are one row, which names so many of them (at most [`MOST_NAMED_IN_REST`]).
    #[must_use]
    pub fn shortened(&self, claims: usize, named: usize) -> Vec<VerdictRow> {
        let (mut rows, mut rest, mut end) = (Vec::new(), Vec::new(), Vec::new());
        for row in &self.rows {
            match row.kind {
                RowKind::Plain => rows.push(row.clone()),
                RowKind::Finding | RowKind::Curves if rows.len() <= claims => rows.push(row.clone()),
                RowKind::Finding | RowKind::Curves | RowKind::Rest => rest.push(row),
                RowKind::Unexplained | RowKind::Whole => end.push(row.clone()),
            }
        }
        match rest.as_slice() {
            [] => {}
            [only] => rows.push((*only).clone()),
            [first, .., last] => rows.push(rest_row(&rest, named, [first.before_mm, last.after_mm])),
        }
        rows.extend(end);
        rows
    }
}

/// The verdict: likely findings of some size one by one, the others by number. `models` as for the table: number of parameters and error
/// at unseen poses (mm rms) of the plain and of the whole model.
#[must_use]
pub fn of(findings: &[Finding], unexplained: &[Unexplained], models: [(usize, f64); 2], given: Given<'_>) -> Verdict {
    let named = |f: &&Finding| f.is_likely();
    let share: f64 = findings.iter().filter(named).map(|f| f.share).sum();
    let told: Vec<&Finding> = findings.iter().filter(named).filter(|f| f.share >= SMALL_SHARE).collect();
    let mut sentences: Vec<String> = told.iter().map(|f| f.summary.clone()).collect();
    let rest = findings.len() - told.len();
    if rest > 0 {
        let what = if rest == 1 { "finding is" } else { "findings are" };
        sentences.push(format!("{rest} more {what} small or not sure."));
    }
    let rows = rows(findings, unexplained, models, given);
    // as the table has it, or where no curve took it up
    let curves = rows.iter().find(|r| r.kind == RowKind::Curves).map(|r| format!("{}.", r.text));
    sentences.extend(curves.or_else(|| {
        let u = unexplained.first()?;
        Some(format!("No known cause: {} is off, {} ({:.3} mm).", u.site, region(&u.region, given.robot), u.rms_mm))
    }));
    if findings.is_empty() && unexplained.is_empty() {
        sentences.push(format!("{NOTHING}."));
    }
    let mut actions: Vec<String> = Vec::new();
    for f in told {
        if !actions.iter().any(|a| a == f.action) {
            actions.push(f.action.to_owned());
        }
    }
    let explained = !findings.is_empty() || !unexplained.is_empty();
    Verdict {
        summary: sentences.join(" "),
        named_share: (share * 1e4).round() / 1e4,
        unnamed_share: if explained { ((1.0 - share).max(0.0) * 1e4).round() / 1e4 } else { 0.0 },
        actions,
        rows,
    }
}

#[cfg(test)]
mod tests;
