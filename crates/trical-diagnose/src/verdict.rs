//! What a diagnosis comes to, in plain sentences: each at the finest level that is sure.

use crate::diagnosis::{Finding, Unexplained, Verdict};
use crate::effects::Family;

/// From here on a claim is said as a fact.
const LIKELY: f64 = 0.5;

/// Findings that take less of what can be explained are summed up.
const SMALL_SHARE: f64 = 0.01;

/// A finding in a plain sentence, at the finest level that is more likely right than not.
#[must_use]
pub fn summary(f: &Finding) -> String {
    let percent = |p: f64| format!("{:.0} %", 100.0 * p);
    let place = f.site.to_string();
    let error = format!(
        "modelled, the error at unseen poses goes from {:.3} to {:.3} mm rms",
        f.evidence.holdout_rms_before_mm, f.evidence.holdout_rms_after_mm
    );
    let when = f.session.map_or_else(String::new, |s| format!(" in session {s}"));
    if f.confidence >= LIKELY {
        format!("{} at {place}{when} ({}): {error}.", capital(f.effect.effect().title), percent(f.confidence))
    } else if f.family_confidence >= LIKELY {
        format!(
            "{} at {place}{when} ({}), perhaps {} ({}): {error}.",
            capital(family(f.family)),
            percent(f.family_confidence),
            f.effect.effect().title,
            percent(f.confidence)
        )
    } else if f.place_confidence >= LIKELY {
        format!(
            "Something at {place}{when} ({}), perhaps {} ({}): {error}.",
            percent(f.place_confidence),
            f.effect.effect().title,
            percent(f.confidence)
        )
    } else {
        format!("Perhaps {} at {place}{when} ({}): {error}.", f.effect.effect().title, percent(f.confidence))
    }
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

fn capital(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |c| c.to_uppercase().collect::<String>() + chars.as_str())
}

/// The verdict: likely findings of some size one by one, the others by number.
#[must_use]
pub fn of(findings: &[Finding], unexplained: &[Unexplained]) -> Verdict {
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
            .map(|u| format!("Without a name: {} is off for {} ({:.3} mm).", u.site, u.region, u.rms_mm)),
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
    }
}
