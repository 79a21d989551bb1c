//! What a diagnosis comes to, in plain sentences and as a table: each claim at the finest level that is sure.

use trical_model::{Place, Scope};

use crate::diagnosis::{Finding, RowKind, Unexplained, Verdict, VerdictRow};
use crate::effect_id::EffectId;
use crate::effects::Family;

/// From here on a claim is said as a fact.
const LIKELY: f64 = 0.5;

/// Findings that take less of what can be explained are summed up in the summary.
const SMALL_SHARE: f64 = 0.01;

/// Claims with less of a probability are told with their strongest rival.
const RIVAL_TOLD_BELOW: f64 = 0.9;

/// A name that is less sure than this, of a place that is not sure either, has no row of its own.
const LEAST_TOLD: f64 = 0.1;

/// A claim that lowers the error at unseen poses by a smaller part of it has no row of its own.
const LEAST_STEP: f64 = 0.01;

fn percent(p: f64) -> String {
    format!("{:.0} %", 100.0 * p)
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
    if f.confidence >= LIKELY {
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

/// "joint 3", "joints 1 to 4", "joints 1, 3 and 4".
fn numbered(what: &str, mut numbers: Vec<usize>) -> Option<String> {
    numbers.sort_unstable();
    numbers.dedup();
    let (first, last) = (*numbers.first()?, *numbers.last()?);
    if first == last {
        return Some(format!("{what} {first}"));
    }
    if numbers.len() > 2 && last - first + 1 == numbers.len() {
        return Some(format!("{what}s {first} to {last}"));
    }
    let but_last: Vec<String> = numbers[..numbers.len() - 1].iter().map(ToString::to_string).collect();
    Some(format!("{what}s {} and {last}", but_last.join(", ")))
}

/// The claim without its probability, and what is less sure: "lost motion at joint 3", "perhaps backlash (40 %)".
fn claim(f: &Finding, places: &[Place]) -> (String, Option<String>) {
    let title = f.effect.effect().title;
    let when = f.session.map_or_else(String::new, |s| format!(" in session {s}"));
    let name = || Some(format!("perhaps {title} ({})", percent(f.confidence)));
    match level(f).0 {
        Level::Effect => (format!("{title}{}{when}", at(places, title)), None),
        Level::Family => {
            let family = family(f.family);
            (format!("{family}{}{when}", at(places, family)), name())
        }
        Level::Place => (format!("something{}{when}", at(places, "")), name()),
        Level::Perhaps => (format!("perhaps {title}{}{when}", at(places, title)), None),
    }
}

/// An effect at a place in words: "Backlash or friction wind-up at joint 3".
#[must_use]
pub fn named(effect: EffectId, place: Place) -> String {
    let title = effect.effect().title;
    capital(&format!("{title}{}", at(&[place], title)))
}

/// Effect, place and session of a finding in words, whatever its probability.
#[must_use]
pub fn heading(f: &Finding) -> String {
    named(f.effect, f.site) + &f.session.map_or_else(String::new, |s| format!(" in session {s}"))
}

/// A finding in a plain sentence, at the finest level that is more likely right than not.
#[must_use]
pub fn summary(f: &Finding) -> String {
    let (text, perhaps) = claim(f, &[f.site]);
    let perhaps = perhaps.map_or_else(String::new, |p| format!(", {p}"));
    format!(
        "{} ({}){perhaps}: modelled, the error at unseen poses goes from {:.3} to {:.3} mm rms.",
        capital(&text),
        percent(level(f).1),
        f.evidence.holdout_rms_before_mm,
        f.evidence.holdout_rms_after_mm
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

/// A text that begins with a capital letter.
#[must_use]
pub fn capital(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |c| c.to_uppercase().collect::<String>() + chars.as_str())
}

/// A variable in words: "q4" is "the angle of joint 4".
fn variable(name: &str) -> String {
    let joint = |prefix| name.strip_prefix(prefix).filter(|n| n.parse::<usize>().is_ok());
    match (name, joint("q"), joint("dir")) {
        ("seq", ..) => "the number of the pose".into(),
        ("time", ..) => "the time".into(),
        (_, Some(n), _) => format!("the angle of joint {n}"),
        (_, _, Some(n)) => format!("the sense of joint {n}'s last motion"),
        _ => name.to_owned(),
    }
}

/// Where a mismatch without a known cause is, in words: "where the angle of joint 2 is below -32 deg".
#[must_use]
pub fn region(region: &str) -> String {
    if let Some(all) = region.strip_prefix("all of ") {
        return match all.split_once(", with ") {
            Some((a, b)) => format!("as a function of {} and {} together", variable(a), variable(b)),
            None => format!("as a function of {}", variable(all)),
        };
    }
    let (name, rest) = region.split_once(' ').unwrap_or((region, ""));
    let rest = rest.replacen('<', "below", 1).replacen('>', "above", 1);
    format!("where {} is {rest}", variable(name))
}

/// What a row of the table sums up, before it has its place in it.
struct Step {
    /// Of findings, the first one; of curves without a name, none.
    first: Option<usize>,
    places: Vec<Place>,
    findings: Vec<usize>,
    confidence: Option<[f64; 2]>,
    /// By how much it lowers the squared error at unseen poses, mm^2.
    gain: f64,
}

/// Findings that say the same of several joints are one step, and so are all curves without a name.
fn steps(findings: &[Finding], unexplained: &[Unexplained]) -> Vec<Step> {
    let gain = |before: f64, after: f64| before * before - after * after;
    let mut steps: Vec<Step> = Vec::new();
    for (k, f) in findings.iter().enumerate() {
        let (said_at, p) = level(f);
        let gain = gain(f.evidence.holdout_rms_before_mm, f.evidence.holdout_rms_after_mm);
        let alike = |s: &&mut Step| {
            s.first.is_some_and(|first| {
                let o = &findings[first];
                matches!(said_at, Level::Effect | Level::Perhaps)
                    && (o.effect, o.session, level(o).0) == (f.effect, f.session, said_at)
            })
        };
        if let Some(s) = steps.iter_mut().find(alike) {
            s.places.push(f.site);
            s.findings.push(k + 1);
            s.confidence = s.confidence.map(|[low, high]| [low.min(p), high.max(p)]);
            s.gain += gain;
        } else {
            let confidence = Some([p, p]);
            steps.push(Step { first: Some(k), places: vec![f.site], findings: vec![k + 1], confidence, gain });
        }
    }
    let curves: Vec<&Unexplained> = unexplained.iter().filter(|u| u.modelled).collect();
    if !curves.is_empty() {
        steps.push(Step {
            first: None,
            places: curves.iter().map(|u| u.site).collect(),
            findings: Vec::new(),
            confidence: None,
            gain: curves.iter().map(|u| gain(u.holdout_rms_before_mm, u.holdout_rms_after_mm)).sum(),
        });
    }
    steps.sort_by(|a, b| b.gain.total_cmp(&a.gain));
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

fn row_of(step: &Step, findings: &[Finding], [before_mm, after_mm]: [f64; 2]) -> VerdictRow {
    let Some(f) = step.first.and_then(|k| findings.get(k)) else {
        let text = format!("No known cause: smooth curves{}", at(&step.places, ""));
        return plain_row(RowKind::Curves, text, [before_mm, after_mm]);
    };
    let said_at = level(f).0;
    let (text, less_sure) = claim(f, &step.places);
    let rival = f.rivals.iter().find(|r| r.effect != f.effect);
    let rival = rival.filter(|_| said_at == Level::Effect && f.confidence < RIVAL_TOLD_BELOW);
    VerdictRow {
        kind: RowKind::Finding,
        text: capital(&text),
        perhaps: less_sure.or_else(|| rival.map(|r| format!("or {}", r.effect.effect().title))),
        confidence: step.confidence,
        before_mm,
        after_mm,
        action: (said_at == Level::Effect).then_some(f.action),
        corrected: f.scope == Scope::Arm,
        findings: step.findings.clone(),
    }
}

/// What is too small or not sure enough for a row of its own: so many findings, or only curves.
fn rest_row(findings: Vec<usize>, errors: [f64; 2]) -> VerdictRow {
    let text = match findings.len() {
        0 => "Smaller curves of no known cause".to_owned(),
        1 => "1 smaller or less sure finding".to_owned(),
        n => format!("{n} smaller or less sure findings"),
    };
    VerdictRow { findings, ..plain_row(RowKind::Rest, text, errors) }
}

/// The table. `models` has the number of parameters and the error at unseen poses (mm rms) of the plain and of the whole model.
fn rows(findings: &[Finding], unexplained: &[Unexplained], models: [(usize, f64); 2]) -> Vec<VerdictRow> {
    let [(plain, before), (whole, after)] = models;
    let mut rows = vec![plain_row(RowKind::Plain, format!("Plain model, {plain} parameters"), [before; 2])];
    let mut here = before;
    let mut rest: Vec<Step> = Vec::new();
    let steps = steps(findings, unexplained);
    // findings that stand in for each other gain more one by one than together
    let (sum, together) = (steps.iter().map(|s| s.gain.max(0.0)).sum::<f64>(), before * before - after * after);
    let part = if sum > together { (together / sum).max(0.0) } else { 1.0 };
    for step in steps {
        let next = (here * here - part * step.gain).max(0.0).sqrt();
        let guessed = step.confidence.is_some_and(|[_, high]| high < LEAST_TOLD);
        if next > here * (1.0 - LEAST_STEP) || guessed {
            rest.push(step);
        } else {
            rows.push(row_of(&step, findings, [here, next]));
            here = next;
        }
    }
    if !rest.is_empty() {
        let mut findings: Vec<usize> = rest.into_iter().flat_map(|s| s.findings).collect();
        findings.sort_unstable();
        rows.push(rest_row(findings, [here, after.min(here)]));
    }
    let left = unexplained.iter().find(|u| !u.modelled && u.holdout_rms_before_mm <= after * (1.0 + 1e-9));
    rows.extend(left.map(|u| {
        let place = at(&[u.site], "");
        let text = format!("Still unexplained{place}: {:.3} mm that change with {}", u.rms_mm, variable(&u.variable));
        plain_row(RowKind::Unexplained, text, [after; 2])
    }));
    let last = if findings.is_empty() && unexplained.is_empty() {
        "Nothing found: the model explains the data".to_owned()
    } else {
        format!("Whole model, {whole} parameters")
    };
    rows.push(plain_row(RowKind::Whole, last, [after; 2]));
    rows
}

impl Verdict {
    /// The table with so many claims at most: the smaller ones are one row.
    #[must_use]
    pub fn shortened(&self, claims: usize) -> Vec<VerdictRow> {
        let (mut rows, mut rest, mut end) = (Vec::new(), Vec::new(), Vec::new());
        for row in &self.rows {
            match row.kind {
                RowKind::Plain => rows.push(row.clone()),
                RowKind::Finding | RowKind::Curves if rows.len() <= claims => rows.push(row.clone()),
                RowKind::Finding | RowKind::Curves | RowKind::Rest => rest.push(row),
                RowKind::Unexplained | RowKind::Whole => end.push(row.clone()),
            }
        }
        if let (Some(first), Some(last)) = (rest.first(), rest.last()) {
            let mut findings: Vec<usize> = rest.iter().flat_map(|r| r.findings.iter().copied()).collect();
            findings.sort_unstable();
            rows.push(rest_row(findings, [first.before_mm, last.after_mm]));
        }
        rows.extend(end);
        rows
    }
}

/// The verdict: likely findings of some size one by one, the others by number. `models` as for the table: number of parameters and error
/// at unseen poses (mm rms) of the plain and of the whole model.
#[must_use]
pub fn of(findings: &[Finding], unexplained: &[Unexplained], models: [(usize, f64); 2]) -> Verdict {
    let named = |f: &&Finding| f.confidence >= LIKELY;
    let share: f64 = findings.iter().filter(named).map(|f| f.share).sum();
    let told: Vec<&Finding> = findings.iter().filter(named).filter(|f| f.share >= SMALL_SHARE).collect();
    let mut sentences: Vec<String> = told.iter().map(|f| f.summary.clone()).collect();
    let rest = findings.len() - told.len();
    if rest > 0 {
        let what = if rest == 1 { "finding is" } else { "findings are" };
        sentences.push(format!("{rest} more {what} small or not sure."));
    }
    sentences.extend(
        unexplained
            .iter()
            .take(1)
            .map(|u| format!("No known cause: {} is off {} ({:.3} mm).", u.site, region(&u.region), u.rms_mm)),
    );
    if findings.is_empty() && unexplained.is_empty() {
        sentences.push("The model explains the data: nothing found.".into());
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
        rows: rows(findings, unexplained, models),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnosis::{Evidence, Rival};
    use crate::probability::Replicated;

    fn finding(effect: EffectId, joint: usize, [place, family, name]: [f64; 3], [before, after]: [f64; 2]) -> Finding {
        let described = effect.effect();
        Finding {
            effect,
            site: Place::Joint(joint),
            located: String::new(),
            family: described.family,
            scope: described.scope,
            session: None,
            confidence: name,
            place_confidence: place,
            family_confidence: family,
            share: 0.1,
            replicated: Replicated::default(),
            summary: String::new(),
            action: described.action,
            lambda: 9.0,
            coefficients: Vec::new(),
            evidence: Evidence {
                delta_bic: 20.0,
                p_value: 0.0,
                holdout_rms_before_mm: before,
                holdout_rms_after_mm: after,
                forward_rms_before_mm: before,
                forward_rms_after_mm: after,
            },
            rivals: vec![Rival { effect: EffectId::LoadFriction, site: Place::Joint(joint), delta_bic: 1.0 }],
            next_measurements: None,
        }
    }

    const SURE: [f64; 3] = [0.99; 3];

    fn told(findings: &[Finding], unexplained: &[Unexplained], models: [(usize, f64); 2]) -> Verdict {
        of(findings, unexplained, models)
    }

    #[test]
    fn alike_findings_of_several_joints_are_one_row_and_the_table_goes_from_the_plain_to_the_whole_model() {
        let findings = [
            finding(EffectId::EncoderError, 2, SURE, [0.5, 0.3]),
            finding(EffectId::LateJointReading, 1, SURE, [0.9, 0.5]),
            finding(EffectId::EncoderError, 1, [0.99, 0.99, 0.97], [0.3, 0.1]),
            finding(EffectId::GearRipple, 4, SURE, [0.1, 0.1]),
        ];
        let verdict = told(&findings, &[], [(31, 0.9), (90, 0.1)]);
        let said: Vec<(&str, String, String)> = verdict
            .rows
            .iter()
            .map(|r| (r.text.as_str(), format!("{:.2}", r.before_mm), format!("{:.2}", r.after_mm)))
            .collect();
        let row = |text, before: &str, after: &str| (text, before.to_owned(), after.to_owned());
        assert_eq!(
            said,
            [
                row("Plain model, 31 parameters", "0.90", "0.90"),
                row("Joints read before the arm had settled at joint 1", "0.90", "0.50"),
                row("Encoder error at joints 1 and 2", "0.50", "0.10"),
                row("1 smaller or less sure finding", "0.10", "0.10"),
                row("Whole model, 90 parameters", "0.10", "0.10"),
            ]
        );
        assert_eq!(verdict.rows[2].confidence, Some([0.97, 0.99]));
        assert_eq!((&verdict.rows[2].findings[..], &verdict.rows[3].findings[..]), (&[1, 3][..], &[4][..]));
        assert!(verdict.rows[2].corrected && !verdict.rows[1].corrected);
        // shortened, what is left out goes into the row of the rest
        let short = verdict.shortened(1);
        assert_eq!(short.len(), 4);
        assert_eq!(short[2].findings, [1, 3, 4]);
        assert!((short[2].before_mm - 0.5).abs() < 1e-12 && (short[2].after_mm - 0.1).abs() < 1e-12);
    }

    #[test]
    fn what_is_less_than_half_sure_is_not_said_as_a_fact() {
        let said = |confidences| {
            let verdict = told(
                &[finding(EffectId::LostMotionDirection, 3, confidences, [0.5, 0.1])],
                &[],
                [(31, 0.5), (32, 0.1)],
            );
            let row = verdict.rows[1].clone();
            (row.text, row.perhaps.unwrap_or_default(), row.action.is_some())
        };
        let rival = "or friction that grows with the load".to_owned();
        let text = |t: &str| t.to_owned();
        assert_eq!(said(SURE), (text("Backlash or friction wind-up at joint 3"), String::new(), true));
        assert_eq!(said([0.9, 0.8, 0.7]), (text("Backlash or friction wind-up at joint 3"), rival, true));
        let name = |p| format!("perhaps backlash or friction wind-up ({p} %)");
        assert_eq!(said([0.9, 0.8, 0.4]), (text("Lost motion at joint 3"), name(40), false));
        assert_eq!(said([0.9, 0.2, 0.1]), (text("Something at joint 3"), name(10), false));
        assert_eq!(
            said([0.3, 0.2, 0.1]),
            (text("Perhaps backlash or friction wind-up at joint 3"), String::new(), false)
        );
        assert_eq!(said([0.05, 0.02, 0.01]).0, "1 smaller or less sure finding");
    }

    #[test]
    fn rows_that_together_gain_less_than_one_by_one_end_at_the_whole_model() {
        let findings = [
            finding(EffectId::EncoderError, 2, SURE, [0.5, 0.1]),
            finding(EffectId::GearRipple, 1, SURE, [0.5, 0.2]),
            // with this one the error at unseen poses is larger
            finding(EffectId::JointHarmonic, 3, SURE, [0.3, 0.4]),
        ];
        let verdict = told(&findings, &[], [(31, 0.5), (90, 0.3)]);
        let after: Vec<String> = verdict.rows.iter().map(|r| format!("{:.2}", r.after_mm)).collect();
        // 0.24 and 0.21 mm^2 share the 0.16 mm^2 that both take together
        assert_eq!(after, ["0.50", "0.41", "0.30", "0.30", "0.30"]);
    }

    #[test]
    fn regions_are_said_in_words() {
        for (name, said) in [
            ("q2 < -32 deg", "where the angle of joint 2 is below -32 deg"),
            ("time from 20.0 to 30.0 s", "where the time is from 20.0 to 30.0 s"),
            ("all of q4, with q1", "as a function of the angle of joint 4 and the angle of joint 1 together"),
            ("all of seq", "as a function of the number of the pose"),
        ] {
            assert_eq!(region(name), said);
        }
    }

    #[test]
    fn what_has_no_name_stands_in_the_table_at_its_size() {
        let curve = |joint, modelled, [before, after]: [f64; 2]| Unexplained {
            site: Place::Joint(joint),
            variable: "q4".into(),
            region: "all of q4".into(),
            rms_mm: 0.02,
            holdout_rms_before_mm: before,
            holdout_rms_after_mm: after,
            curve: Vec::new(),
            curve_units: (String::new(), String::new()),
            modelled,
        };
        let unexplained = [curve(1, true, [0.5, 0.3]), curve(2, true, [0.3, 0.2]), curve(5, false, [0.2, 0.19])];
        let verdict = told(&[], &unexplained, [(31, 0.5), (60, 0.2)]);
        let said: Vec<&str> = verdict.rows.iter().map(|r| r.text.as_str()).collect();
        assert_eq!(
            said,
            [
                "Plain model, 31 parameters",
                "No known cause: smooth curves at joints 1 and 2",
                "Still unexplained at joint 5: 0.020 mm that change with the angle of joint 4",
                "Whole model, 60 parameters"
            ]
        );
    }
}
