//! The report of an arm's history: errors and parameters over its sessions.

use trical_ident::compare::Change;
use trical_ident::history::Beginning;
use trical_ident::{Comparison, History, ModelFile, rejected_in_words};
use trical_model::Scope;

use crate::error::Result;
use crate::evidence::row;
use crate::figures::plots::{self, AFTER, BEFORE, Band, Series};
use crate::page::{self, Figure, Made, Section};

/// The whole report.
///
/// # Errors
/// None that a history leads to.
pub fn render(h: &History, file: &ModelFile, made: Made) -> Result<String> {
    let (at, over) = match &h.days {
        Some(days) => (days.clone(), "days since the first recording"),
        None => {
            let numbers = (1..=h.sessions.len()).map(|k| (h.learnt.len() + k) as f64).collect();
            (numbers, "session")
        }
    };
    let errors: Vec<(f64, f64)> = at.iter().zip(&h.sessions).map(|(x, s)| (*x, s.mean_mm)).collect();
    let left = fitted(&h.learnt, h.days.is_some());
    let mut sections = vec![
        Section::new("Sessions")
            .with_text(["Mean position error by the calibration as it is; what differs in every session (a \
                 tracker's frame, places of sockets) was identified. The recordings that the calibration \
                 was fitted to stand first: their error is the residual of the fit."])
            .with_tables([sessions(h)])
            .with_figures(over_sessions(over, left, errors)?),
    ];
    let names = h.sessions.first().map_or(&[][..], |s| s.each.as_slice());
    let mut figures = Vec::new();
    for p in names {
        let here = at.iter().zip(&h.sessions).filter_map(|(x, s)| {
            let own = s.each.iter().find(|o| o.name == p.name && o.unit == p.unit)?;
            Some((*x, own.value, own.sd))
        });
        let points: Vec<(f64, f64, f64)> = here.filter(|(_, value, sd)| value.is_finite() && sd.is_finite()).collect();
        let band = points.iter().map(|(x, v, sd)| (*x, *v, v - 1.96 * sd, v + 1.96 * sd));
        figures.extend(drawn(
            &format!("{}, {}", p.name, p.unit),
            over,
            points.iter().map(|(x, v, _)| (*x, *v)).collect(),
            band,
        )?);
    }
    sections.push(
        Section::new("Parameters over the sessions")
            .with_text([if figures.is_empty() {
                "There is one session after the calibration: a second one makes a curve."
            } else {
                "How far each joint's zero, the tool and the base are from the calibration, each fitted \
                 alone, with its 95 % interval (1.96 standard deviations to each side). Part of each \
                 effect can also be explained by the others: the table above says which of them changed."
            }])
            .with_figures(figures),
    );
    let told = summary_lines(h);
    if !told.is_empty() {
        sections.insert(1, Section { list: told, ..Section::new("What changed, and what was rejected") });
    }
    let title = format!("History of {}", file.model.robot.name);
    page::render(&title, &h.due, &sections, &made)
}

/// "joint 3, tool"; of a touch that is wrong, that it is; of what is less sure than one half, perhaps.
#[must_use]
pub fn what_changed(session: &Comparison) -> String {
    let changed = |c: &Change| {
        let perhaps = if c.is_likely() { "" } else { "perhaps " };
        let is_wrong = if c.scope == Scope::Reading { " is wrong" } else { "" };
        format!("{perhaps}{}{is_wrong}", c.what)
    };
    let all: Vec<String> = session.changes.iter().map(changed).collect();
    match (all.is_empty(), session.verdict) {
        (false, _) => all.join(", "),
        (_, "nothing visible") => "(would show nothing)".into(),
        (_, "does not fit") => "does not fit".into(),
        _ => "nothing".into(),
    }
}

/// A line for each session of which there is more to say than the table does: what changed, and which rows were
/// rejected; at the end, and once, what the calibration left that may look like a change.
#[must_use]
pub fn summary_lines(h: &History) -> Vec<String> {
    let line = |s: &Comparison| {
        let rejected = rejected_in_words(&s.rejected).map(|r| format!("{r}."));
        let more =
            !s.changes.is_empty() || !s.anew.is_empty() || ["nothing visible", "does not fit"].contains(&s.verdict);
        let doubt = s.doubt.as_deref().unwrap_or_default();
        let summary = s.summary.strip_suffix(doubt).unwrap_or(&s.summary).trim_end();
        let said: Vec<String> = rejected.into_iter().chain(more.then(|| summary.to_owned())).collect();
        (!said.is_empty()).then(|| format!("{}: {}", s.recording, said.join(" ")))
    };
    let mut doubts: Vec<String> = h.sessions.iter().filter_map(|s| s.doubt.clone()).collect();
    doubts.dedup();
    h.sessions.iter().filter_map(line).chain(doubts).collect()
}

/// A row for each recording, those of the fit first: recording, day, measurements, temperature in degC, mean error in mm, what changed.
#[must_use]
pub fn rows(h: &History) -> Vec<[String; 6]> {
    let day = |d: Option<f64>| d.map_or_else(|| "-".into(), |d| format!("{d:.0}"));
    let temp = |t: Option<f64>| t.map_or_else(|| "-".into(), |t| format!("{t:.1}"));
    let line = |name: &str, day: String, n: usize, t: Option<f64>, mean: f64, changed: String| {
        [name.to_owned(), day, n.to_string(), temp(t), format!("{mean:.3}"), changed]
    };
    let learnt = h.learnt.iter().map(|b| {
        let said = "(the calibration was fitted to it)".to_owned();
        line(&b.recording, day(b.day), b.measurements, b.temp_c, b.mean_mm, said)
    });
    let later = h.sessions.iter().enumerate().map(|(k, s)| {
        let on = day(h.days.as_ref().and_then(|d| d.get(k).copied()));
        line(&s.recording, on, s.measurements, s.temp_c, s.mean_mm, what_changed(s))
    });
    learnt.chain(later).collect()
}

/// The same with a header and numbers, for the report.
fn sessions(h: &History) -> Vec<Vec<String>> {
    let header = row(["session", "days since the first", "measurements", "degC", "mean error, mm", "what changed"]);
    let numbered = rows(h)
        .into_iter()
        .zip(1..)
        .map(|([name, rest @ ..], k)| std::iter::once(format!("{k}. {name}")).chain(rest).collect());
    std::iter::once(header).chain(numbered).collect()
}

/// What the fit left in the recordings that it was made to, by their days or their numbers.
fn fitted(learnt: &[Beginning], by_day: bool) -> Vec<(f64, f64)> {
    let at = |k: usize, day: Option<f64>| if by_day { day } else { Some((k + 1) as f64) };
    learnt.iter().enumerate().filter_map(|(k, b)| Some((at(k, b.day)?, b.mean_mm))).collect()
}

/// Mean errors over the sessions; nothing for a single one.
fn over_sessions(over: &str, fitted: Vec<(f64, f64)>, others: Vec<(f64, f64)>) -> Result<Vec<Figure>> {
    if fitted.len() + others.len() < 2 {
        return Ok(Vec::new());
    }
    let what = "mean position error, mm";
    let mut series = vec![
        Series { name: "recordings of the fit", color: BEFORE, points: fitted },
        Series { name: "other recordings", color: AFTER, points: others },
    ];
    series.retain(|s| !s.points.is_empty());
    Ok(vec![Figure::new("The mean position error of each session.", plots::scatter(over, what, true, true, &series)?)])
}

/// Points over the sessions with a band; nothing for a single one.
fn drawn(
    what: &str,
    over: &str,
    points: Vec<(f64, f64)>,
    band: impl Iterator<Item = (f64, f64, f64, f64)>,
) -> Result<Option<Figure>> {
    if points.len() < 2 || points.iter().all(|p| p.0 == points[0].0) {
        return Ok(None);
    }
    let series = [Series { name: "sessions", color: AFTER, points }];
    let band = Band { name: "95 %".into(), color: BEFORE, points: band.collect() };
    let name = what.split(',').next().unwrap_or(what);
    let caption = capital(&format!("{name}: how far it is from the calibration"));
    Ok(Some(Figure::new(caption, plots::curve_over_data(over, what, &series, &band)?)))
}

fn capital(text: &str) -> String {
    trical_diagnose::verdict::capital(text) + "."
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_less_sure_than_one_half_is_told_as_perhaps() {
        let change = |what: &str, scope, probability| Change {
            what: what.into(),
            scope,
            probability,
            p_value: 0.01,
            by: Vec::new(),
            rivals: Vec::new(),
        };
        let of = |changes| Comparison { verdict: "arm changed", changes, ..Comparison::default() };
        let sure = change("joint 3", Scope::Arm, 0.97);
        let touch = change("the measurement of line 7", Scope::Reading, 0.4);
        let said = what_changed(&of(vec![sure, touch]));
        assert_eq!(said, "joint 3, perhaps the measurement of line 7 is wrong");
        assert_eq!(what_changed(&of(Vec::new())), "nothing");
        // what all sessions have in common is said once
        let doubt = "But the calibration itself left 0.064 mm.";
        let doubted = |recording: &str| Comparison {
            recording: recording.into(),
            summary: format!("Joint 3 changed, 97 % sure. {doubt}"),
            doubt: Some(doubt.into()),
            ..of(vec![change("joint 3", Scope::Arm, 0.97)])
        };
        let sessions = vec![doubted("a.csv"), doubted("b.csv")];
        let h = History { learnt: Vec::new(), sessions, days: None, trend: None, due: String::new() };
        assert_eq!(
            summary_lines(&h),
            ["a.csv: Joint 3 changed, 97 % sure.", "b.csv: Joint 3 changed, 97 % sure.", doubt]
        );
    }

    #[test]
    fn recordings_of_the_fit_are_drawn_before_the_others_where_the_table_has_them() {
        let of =
            |name: &str, day| Beginning { recording: name.into(), measurements: 40, mean_mm: 0.1, temp_c: None, day };
        let learnt = [of("a.csv", Some(0.0)), of("b.csv", None)];
        assert_eq!(fitted(&learnt, false), [(1.0, 0.1), (2.0, 0.1)]);
        assert_eq!(fitted(&learnt, true), [(0.0, 0.1)]);
        let h = History { learnt: learnt.into(), sessions: Vec::new(), days: None, trend: None, due: String::new() };
        assert_eq!(sessions(&h).iter().map(|r| r[0].as_str()).collect::<Vec<_>>(), ["session", "1. a.csv", "2. b.csv"]);
    }
}
