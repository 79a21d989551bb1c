//! What a comparison found: changes, verdict, and a summary in plain sentences.

use std::collections::BTreeSet;

use serde::Serialize;
use trical_model::Scope;

use super::settings::{BEYOND, CHANGES, FAR_TURNED_DEG, MORE_SCATTER, NO_FIT, UNUSUAL, WARMER};
use crate::dataset::Rejected;
use crate::rigid::moved;
use crate::validate::adapted::LeftOut;

/// One number of a change.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Changed {
    /// "joint 3", "tool x", "base rz".
    pub name: String,
    /// By how much it changed, in `unit`.
    pub value: f64,
    /// Standard deviation.
    pub sd: f64,
    /// "deg" or "mm".
    pub unit: String,
}

/// Something that changed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// "tool", "base", "joint 3", "the touch of line 7".
    pub what: String,
    /// [`Scope::Arm`] for a joint, [`Scope::Setup`] for tool and base, [`Scope::Reading`] for one wrong touch.
    pub scope: Scope,
    /// How probable this explanation is among all that were tried, 0 to 1.
    pub probability: f64,
    /// How often chance alone would give as much, for this explanation.
    pub p_value: f64,
    /// By how much.
    pub by: Vec<Changed>,
    /// Explanations that the touches do not exclude (more than a tenth as probable).
    pub rivals: Vec<String>,
}

impl Change {
    /// Whether it is at least as probable as all other explanations together.
    #[must_use]
    pub fn is_likely(&self) -> bool {
        self.probability >= 0.5
    }
}

/// The smallest change that these poses would show nine times in ten; of a tool or base that of its place, and then
/// that of its direction, whichever way it goes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Visible {
    /// "joint 3", "tool", "base".
    pub what: String,
    /// In `unit`; `null` where no size would be seen.
    pub smallest: Option<f64>,
    /// "deg" or "mm".
    pub unit: String,
}

/// An arm beside its earlier calibration.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Comparison {
    /// The new recording.
    pub recording: String,
    /// What tells it from others.
    pub hash: String,
    /// Measurements that were compared.
    pub measurements: usize,
    /// Rows that were not used.
    pub rejected: Vec<Rejected>,
    /// Recording whose tool and balls the calibration has here, its newest; `null` where all that it was fitted to
    /// share theirs.
    pub setup_of: Option<String>,
    /// "tool", "base": what the calibration does not know and was identified on this recording, so that no change of it
    /// can be seen.
    pub anew: Vec<&'static str>,
    /// "unchanged", "setup changed" (tool or base only), "arm changed", "wrong touches" (only those), "nothing visible"
    /// (these measurements would show no change), "does not fit" (no such change explains how far they are off); "perhaps arm changed" and the like where no change is as sure as one half.
    pub verdict: &'static str,
    /// In plain sentences.
    pub summary: String,
    /// That an error which the calibration left may look like the change, where that is so; the summary ends with it.
    #[serde(skip)]
    pub doubt: Option<String>,
    /// What changed, the surest first.
    pub changes: Vec<Change>,
    /// What would have been seen.
    pub visible: Vec<Visible>,
    /// Mean position error by the old model as it is, mm; what is new in any case identified.
    pub mean_mm: f64,
    /// The same with the changes of tool and base that were found: what identifying these anew leaves.
    pub arm_mm: f64,
    /// Standard deviation of each coordinate in the old session, mm.
    pub noise_mm: f64,
    /// By how much more the touches scatter than that, whatever changed; 1 where they do not.
    pub more_noise: f64,
    /// Mean temperature of the recording, degC, where it was recorded.
    pub temp_c: Option<f64>,
    /// By how much warmer it was than at the calibration, K, where both were recorded.
    pub warmer: Option<f64>,
    /// Every explanation's own numbers, each fitted beside the changes that were found, where the measurements determine them.
    pub each: Vec<Changed>,
}

impl Comparison {
    /// Writes the summary, and behind it the doubt where there is one; `usual_mm` is the usual noise of the instrument, `left_out` terms of the
    /// calibration that say nothing here.
    pub(super) fn tell(&mut self, usual_mm: Option<f64>, left_out: &[LeftOut]) {
        self.summary = summary(self);
        self.doubt = lacking(left_out).or_else(|| turned_far(&self.changes)).or_else(|| doubt(self, usual_mm));
        if let Some(doubt) = &self.doubt {
            self.summary += &format!(" {doubt}");
        }
    }
}

/// What changed, in two words; of what is less sure than one half, that it did so perhaps. `more_noise`: how much more the measurements scatter.
pub(super) fn verdict(changes: &[Change], visible: &[Visible], more_noise: f64) -> &'static str {
    let machine = changes.iter().any(|c| c.is_likely() && c.scope != Scope::Reading);
    if !machine && more_noise > NO_FIT {
        return "does not fit";
    }
    if changes.is_empty() && visible.iter().all(|v| v.smallest.is_none()) {
        return "nothing visible";
    }
    let sure = changes.iter().any(Change::is_likely);
    let has = |scope| changes.iter().any(|c| c.scope == scope && c.is_likely() == sure);
    match (has(Scope::Arm), has(Scope::Setup), changes.is_empty()) {
        (true, ..) if sure => "arm changed",
        (true, ..) => "perhaps arm changed",
        (_, true, _) if sure => "setup changed",
        (_, true, _) => "perhaps setup changed",
        (.., true) => "unchanged",
        _ if sure => "wrong touches",
        _ => "perhaps wrong touches",
    }
}

/// "target 2" and "x" of "target 2 x".
pub(super) fn point_and_axis(name: &str) -> (&str, &str) {
    name.rsplit_once(' ').unwrap_or((name, ""))
}

/// What the calibration knows of the arm, and the recording does not let it say.
fn lacking(left_out: &[LeftOut]) -> Option<String> {
    let needs = left_out.iter().filter_map(|l| Some((l.needs?, l.effect.replace('_', " "))));
    let all: BTreeSet<String> = needs.map(|(what, effect)| format!("{what} (for {effect})")).collect();
    (!all.is_empty()).then(|| {
        format!(
            "But the calibration needs {}, which this recording does not have. That part of the model is left out: this can look like a change of \
             the arm, or hide one.",
            all.into_iter().collect::<Vec<_>>().join(" and ")
        )
    })
}

/// A tool that was turned so far that what is said of it, and of all else, in the linear picture is not so.
fn turned_far(changes: &[Change]) -> Option<String> {
    let turned = changes.iter().filter(|c| c.what == "tool").flat_map(|c| &c.by).filter(|b| b.unit == "deg");
    let far = turned.map(|b| b.value.powi(2)).sum::<f64>().sqrt();
    (far > FAR_TURNED_DEG).then(|| {
        format!(
            "But the tool was turned by {far:.0} deg, so far that the other changes cannot be judged: identify it anew on this recording, or \
             calibrate from both."
        )
    })
}

/// What makes a change less sure than its number says: errors of the arm that the calibration lacks differ from pose to pose.
fn doubt(c: &Comparison, usual_mm: Option<f64>) -> Option<String> {
    let left = c.noise_mm;
    let much = usual_mm.is_some_and(|usual| left > UNUSUAL * usual) && c.mean_mm < BEYOND * left;
    (much && !c.changes.is_empty()).then(|| {
        format!(
            "But the calibration itself left {left:.3} mm in each coordinate, more than the instrument's noise: an error of the arm that it \
             lacks can look like such a change at other poses. Compare with a diagnosed model of the same recording, too."
        )
    })
}

/// " by 0.0512 +- 0.0021 deg" of one number, " by 1.250 mm and 0.031 deg" of several.
fn size_in_words(change: &Change) -> String {
    let of = |unit: &'static str| {
        let mut parts = change.by.iter().filter(move |b| b.unit == unit).peekable();
        parts.peek().is_some().then(|| moved(parts.map(|b| (point_and_axis(&b.name).0, b.value))))
    };
    match (&change.by[..], of("mm"), of("deg")) {
        ([one], ..) => format!(" by {:.4} +- {:.4} {}", one.value, one.sd, one.unit),
        (_, Some(mm), Some(deg)) => format!(" by {mm:.3} mm and {deg:.3} deg"),
        (_, Some(mm), None) => format!(" by {mm:.3} mm"),
        _ => String::new(),
    }
}

/// How much more the measurements scatter than they did, where it is worth a sentence.
fn scatter_in_words(c: &Comparison) -> Option<String> {
    let scatter =
        format!("The measurements scatter {:.1} times as much about the model as in the old session", c.more_noise);
    match c.more_noise {
        much if much > NO_FIT => Some(format!(
            "{scatter}, and {} explains that. Something else differs: in the arm (play, load, heat, a link) or in the measurement. Diagnose this \
             recording.",
            if c.changes.is_empty() { "no change of one joint, the tool or the base" } else { "none of these changes" }
        )),
        more if more > MORE_SCATTER => Some(format!("{scatter}.")),
        _ => None,
    }
}

/// A change in a sentence.
fn in_words(change: &Change) -> String {
    let sure = (change.probability * 100.0).floor().min(99.0);
    let or = if change.rivals.is_empty() { String::new() } else { format!(" (or {})", change.rivals.join(", ")) };
    let what = capital(&if change.is_likely() { change.what.clone() } else { format!("perhaps {}", change.what) });
    if change.scope == Scope::Reading {
        format!("{what}{or} is wrong, {sure:.0} % sure.")
    } else {
        format!("{what}{or} changed{}, {sure:.0} % sure.", size_in_words(change))
    }
}

/// All that a comparison found, in sentences.
fn summary(c: &Comparison) -> String {
    let joint_seen = c.visible.iter().any(|v| v.what.starts_with("joint") && v.smallest.is_some());
    let n = c.measurements;
    let mut words = Vec::new();
    if c.verdict == "nothing visible" {
        words.push(format!("Nothing can be seen in these {n} measurements: they would show no change."));
    } else if c.verdict == "does not fit" {
        words.push(format!("These {n} measurements do not fit the model."));
    } else if c.changes.is_empty() && joint_seen {
        words.push(format!("No change was found in these {n} measurements."));
    } else if c.changes.is_empty() {
        words.push(format!("No change was found in these {n} measurements, which would not show one of any joint."));
    }
    words.extend(c.changes.iter().map(in_words));
    words.extend(scatter_in_words(c));
    if c.changes.len() == CHANGES && c.changes.iter().filter(|c| c.scope == Scope::Arm).count() > 1 {
        words.push("So much is different that this may be another arm of the same kind.".into());
    }
    if let Some(warmer) = c.warmer.filter(|w| w.abs() >= WARMER) {
        let than = if warmer > 0.0 { "warmer" } else { "colder" };
        words.push(format!(
            "It was {:.1} K {than} than at the calibration: what growth with temperature may do is not counted as a change.",
            warmer.abs()
        ));
    }
    if !c.anew.is_empty() {
        let it = if c.anew.len() > 1 { "them" } else { "it" };
        words.push(format!(
            "A change of the {} cannot be seen: the calibration did not measure {it}, and this recording identifies {it} \
             anew.",
            c.anew.join(" and ")
        ));
    }
    if let Some(of) = &c.setup_of {
        words.push(format!(
            "Compared with the tool and the balls at the end of {of}, the newest recording that the calibration was \
             fitted to."
        ));
    }
    words.join(" ")
}

/// A text that begins with a capital letter.
#[must_use]
pub fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_less_sure_than_one_half_is_no_fact_in_verdict_and_summary() {
        let change = |scope, probability| Change {
            what: "joint 3".into(),
            scope,
            probability,
            p_value: 0.01,
            by: Vec::new(),
            rivals: vec!["joint 2".into()],
        };
        let of = |all: &[(Scope, f64)], more_noise: f64| {
            verdict(&all.iter().map(|c| change(c.0, c.1)).collect::<Vec<_>>(), &[], more_noise)
        };
        let verdict_of = |all: &[(Scope, f64)]| of(all, 1.0);
        assert_eq!(verdict_of(&[(Scope::Arm, 0.37)]), "perhaps arm changed");
        assert_eq!(verdict_of(&[(Scope::Arm, 0.5)]), "arm changed");
        assert_eq!(verdict_of(&[(Scope::Setup, 0.9), (Scope::Arm, 0.37)]), "setup changed");
        assert_eq!(verdict_of(&[(Scope::Reading, 0.4)]), "perhaps wrong touches");
        assert_eq!([2.9, 3.1].map(|more| of(&[(Scope::Reading, 0.9)], more)), ["wrong touches", "does not fit"]);
        assert_eq!([0.4, 0.9].map(|sure| of(&[(Scope::Arm, sure)], 5.0)), ["does not fit", "arm changed"]);
        let told = summary(&Comparison { changes: vec![change(Scope::Arm, 0.37)], ..Comparison::default() });
        assert_eq!(told, "Perhaps joint 3 (or joint 2) changed, 37 % sure.");
    }
}
