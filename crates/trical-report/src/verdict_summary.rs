//! The verdict of a diagnosis in a few lines for a terminal, and as rows for a page.

use std::collections::BTreeSet;

use trical_diagnose::verdict::{IF_NOT, MOST_NAMED_IN_REST};
use trical_diagnose::{Diagnosis, EffectId, Finding, RowKind, VerdictRow};
use trical_ident::JointSource;
use trical_ident::compare::capital;
use trical_ident::fit::cautions;
use trical_ident::fit::identify::ErrorSummary;

use trical_ident::model_file::moved;
use trical_model::{Measured, Model, Scope, Site, Term};

use crate::error::Result;
use crate::evidence::six;
use crate::table;

/// So many lines has a verdict at most in a terminal, the first one included.
const LINES: usize = 10;

/// So wide is a line at most.
const WIDE: usize = 120;

/// Errors in another session that are so many times larger are told in the verdict.
const MUCH_WORSE: f64 = 1.3;

/// What an action says that asks nothing of the owner but to use the model.
const BY_THE_MODEL: &str = "Let the calibrated model correct it";

/// What to do about a row: "Modelled.", "Do: have the indicator calibrated."
#[must_use]
pub fn advice(row: &VerdictRow) -> String {
    let mut said = Vec::new();
    if row.corrected && matches!(row.kind, RowKind::Finding | RowKind::Curves) {
        said.push("Modelled.".to_owned());
    }
    said.extend(to_do(row));
    said.join(" ")
}

/// What to do about what has no name that is likelier right than not.
const NOT_SURE: &str = "Do: measure more there before you change anything.";

/// "Do: have the indicator calibrated." Of what the model corrects, what else may be done: "Or have the rail levelled."
#[must_use]
pub fn to_do(row: &VerdictRow) -> Option<String> {
    let Some(action) = row.action else { return (row.kind == RowKind::Finding).then(|| NOT_SURE.to_owned()) };
    let Some(else_) = action.strip_prefix(BY_THE_MODEL) else {
        let mut chars = action.chars();
        let first = chars.next().map(|c| c.to_ascii_lowercase()).into_iter();
        return Some(format!("Do: {}", first.chain(chars).collect::<String>()));
    };
    let also = else_.trim_start_matches([':', ';', ',', '.', ' ']);
    (!also.is_empty()).then(|| capital(also))
}

/// "0.509 -> 0.171", or one number where nothing changes.
#[must_use]
pub fn errors(row: &VerdictRow, decimals: usize) -> String {
    let [before, after] = [row.before_mm, row.after_mm].map(|mm| format!("{mm:.decimals$}"));
    if row.kind == RowKind::Unexplained {
        String::new()
    } else if claims_something(row) && changes(row, decimals) {
        format!("{before} -> {after}")
    } else {
        after
    }
}

fn claims_something(row: &VerdictRow) -> bool {
    matches!(row.kind, RowKind::Finding | RowKind::Curves | RowKind::Rest)
}

/// Whether a row is told: the error of one that models something has to change in what is shown of it. Findings of the rest are told whatever
/// they take off the error: they are in the model.
fn shows(row: &VerdictRow, decimals: usize) -> bool {
    let rest = row.kind == RowKind::Rest && !row.findings.is_empty();
    !claims_something(row) || rest || changes(row, decimals)
}

/// Whether a change of the error shows in so many decimals.
#[must_use]
pub fn changes(row: &VerdictRow, decimals: usize) -> bool {
    let [before, after] = [row.before_mm, row.after_mm].map(|mm| format!("{mm:.decimals$}"));
    before != after
}

/// A row as it is told: of findings that are told although they change nothing, that they do.
fn as_told(mut row: VerdictRow, decimals: usize) -> VerdictRow {
    if row.kind == RowKind::Rest && !changes(&row, decimals) {
        row.text += "; the error stays as it is";
    }
    row
}

/// What the plain model has besides the arm's own parameters, which are counted: "and 15 of measuring frame and targets".
fn set_up(plain: &Model) -> Option<String> {
    let of = |is: &dyn Fn(&Term) -> bool| plain.terms.iter().filter(|t| is(t)).count();
    let kinds = [
        ("measuring frame", of(&|t| matches!(t.site, Site::Frame { .. }))),
        ("targets", of(&|t| matches!(t.site, Site::Target { .. }))),
        ("places of the balls", of(&|t| t.effect == "place")),
    ];
    let there: Vec<String> = kinds.iter().filter(|(_, n)| *n > 0).map(|(name, _)| (*name).to_owned()).collect();
    let count: usize = kinds.iter().map(|(_, n)| n).sum();
    (count > 0).then(|| format!("and {count} of {}", cautions::listed(&there, "and")))
}

/// The rows of a verdict that are told, with so many decimals.
#[must_use]
pub fn rows_with_decimals(d: &Diagnosis, mut rows: Vec<VerdictRow>) -> (Vec<VerdictRow>, usize) {
    let decimals = decimals(d);
    rows.retain(|r| shows(r, decimals));
    let mut rows: Vec<VerdictRow> = rows.into_iter().map(|r| as_told(r, decimals)).collect();
    let plain = rows.first_mut().filter(|r| r.kind == RowKind::Plain);
    if let (Some(row), Some(more)) = (plain, set_up(&d.before)) {
        row.text += &format!(" ({more})");
    }
    (rows, decimals)
}

/// Decimals that make the smallest error of a diagnosis readable; one more where a row of its verdict would show no change otherwise. They are
/// the same in a terminal and on a page.
#[must_use]
pub fn decimals(d: &Diagnosis) -> usize {
    let few = table::decimals_for(d.after.holdout_rms_mm).clamp(2, 5);
    let all_show = d.verdict.rows.iter().filter(|r| r.kind != RowKind::Rest).all(|r| shows(r, few));
    if all_show { few } else { few + 1 }
}

/// The claim and what else it may be: "Lost motion at joint 3, perhaps backlash (40 %)", "Backlash at joint 3 (if not, friction)"; `sure` is
/// said of the claim.
#[must_use]
pub fn claim(row: &VerdictRow, sure: Option<String>) -> String {
    let (instead, perhaps): (Vec<&String>, Vec<_>) = row.perhaps.iter().partition(|p| p.starts_with(IF_NOT));
    let within: Vec<String> = sure.into_iter().chain(instead.into_iter().cloned()).collect();
    let within = if within.is_empty() { String::new() } else { format!(" ({})", within.join("; ")) };
    format!("{}{within}{}", row.text, perhaps.into_iter().map(|p| format!(", {p}")).collect::<String>())
}

/// The claim with its probability.
#[must_use]
pub fn sentence(row: &VerdictRow) -> String {
    claim(row, row.probability())
}

fn row_lines(row: &VerdictRow, decimals: usize, advised: bool) -> Vec<String> {
    let wide = 2 * (decimals + 2) + 4;
    let advice = if advised { advice(row) } else { String::new() };
    let text = format!("{}. {advice}", sentence(row));
    let indent = " ".repeat(wide + 4);
    let mut lines = table::wrapped(text.trim_end(), WIDE, &indent);
    if let Some(first) = lines.first_mut() {
        *first = format!("  {:<wide$}  {}", errors(row, decimals), first.trim_start());
    }
    lines
}

/// What no arm does, as for `identify`: input that does not go together, which stands before everything else.
#[must_use]
pub fn no_arm(d: &Diagnosis) -> Vec<String> {
    let poses = d.data.observations.iter().any(|o| matches!(o.measured, Measured::Pose { .. }));
    let turned = if poses { six(&d.before, &d.data).ok() } else { None };
    let deg = turned.map(|all| {
        let each: Vec<f64> = all.iter().map(|r| r.fixed_rows::<3>(3).norm()).collect();
        // of the summary only the mean is asked for, whatever the unit
        ErrorSummary::of(&each).mean_mm * 1e-3_f64.to_degrees()
    });
    cautions::no_arm(d.baseline.holdout_rms_mm, deg).iter().map(|c| table::ended(c)).collect()
}

/// What to do where causes were found, and none of them is sure.
#[must_use]
pub fn none_sure(d: &Diagnosis) -> Option<&'static str> {
    let unsure = !d.findings.is_empty() && !d.findings.iter().any(Finding::is_sure);
    unsure.then_some("no cause is sure: measure more poses, and use the model only where it was measured")
}

/// How many effects would not have been found, had the arm them.
#[must_use]
pub fn not_shown(d: &Diagnosis) -> Option<String> {
    let blind: BTreeSet<EffectId> = d.blind_to.iter().map(|b| b.effect).collect();
    (!blind.is_empty()).then(|| {
        format!(
            "This data could not show {} of the {} known effects at some joints or other sites, even if the arm had them",
            blind.len(),
            EffectId::ALL.len()
        )
    })
}

/// What the fit took for noise, in one note each.
#[must_use]
pub fn notes(d: &Diagnosis) -> Vec<String> {
    let told = |r: &String| {
        format!("{r}. The fit allows for that, and the errors here are without it. It is not a fault of the arm.")
    };
    d.baseline.reading_noise.iter().map(told).collect()
}

/// What else should make the owner look twice, in one sentence each.
#[must_use]
pub fn cautions(d: &Diagnosis) -> Vec<String> {
    let named = d.findings.iter().any(Finding::is_likely);
    let much = (!named).then(|| cautions::much_left(&d.model.robot, d.after.holdout_rms_mm)).flatten();
    let which = cautions::which_target(&d.data, d.model.cell.tool.targets.len());
    let all = much
        .into_iter()
        .chain(none_sure(d).map(str::to_owned))
        .chain(which)
        .chain(d.cautions.iter().cloned())
        .chain(cautions::beyond_limits(&d.model.robot, &d.data))
        .chain(cautions::odd_units(&d.model.robot));
    all.map(|c| table::ended(&c)).collect()
}

/// What the whole model is worth in a session, or at a place of the balls, that it was not fitted to, where that is much worse; beside the plain
/// model there.
#[must_use]
pub fn elsewhere(d: &Diagnosis) -> Option<String> {
    let (whole, plain) = (&d.after.held_out, &d.baseline);
    let all = [
        ("in a session", whole.by_session, plain.by_session),
        ("at a place of the balls", whole.by_place, plain.by_place),
    ];
    let decimals = decimals(d);
    let told = |(at, whole, plain): (&str, Option<ErrorSummary>, Option<ErrorSummary>)| {
        let whole = whole.filter(|e| e.rms_mm > MUCH_WORSE * d.after.holdout_rms_mm)?;
        let plain = plain.map_or_else(String::new, |p| format!(" (plain model: {:.decimals$})", p.rms_mm));
        Some(format!("{at} that it was not fitted to: {:.decimals$} mm{plain}", whole.rms_mm))
    };
    all.into_iter().find_map(told).or_else(|| {
        // of one session alone: what happened to the arm and its tool in its course is in the errors, and not in those of a program
        let of_arm = |t: &Term| t.scope() == Scope::Course && t.moves_tool();
        let course = moved(&d.model, &d.data, &of_arm).ok()?.from_beginning / d.uncertainty.as_ref()?.noise;
        let there = d.after.holdout_rms_mm * course.hypot(1.0);
        let worse =
            if there > d.baseline.holdout_rms_mm { ", worse than the plain model (use that one there)" } else { "" };
        (there > MUCH_WORSE * d.after.holdout_rms_mm).then(|| {
            format!("in another session: about {there:.decimals$} mm{worse}, since what happened in this one is not corrected there")
        })
    })
}

/// Touches show the error at their balls alone, which says little of the workspace; what is said of where the errors are.
#[must_use]
pub fn same_balls(d: &Diagnosis) -> &'static str {
    let touches = |m: &Measured| matches!(m, Measured::Touch { .. });
    let all = d.data.observations.iter().all(|o| touches(&o.measured) && o.state.place.is_none());
    if all { ", at the same balls" } else { "" }
}

/// The verdict in ten lines at most: measurements, then the table with what to do. What does not fit is summed up.
#[must_use]
pub fn lines(d: &Diagnosis) -> Vec<String> {
    let rejected = match d.rejected.len() {
        0 => String::new(),
        n => format!(", {n} more rejected"),
    };
    let head = format!(
        "{} measurements at {} poses{rejected}. Error at poses that the fit did not see{}, mm rms:",
        d.data.observations.len(),
        d.after.poses,
        same_balls(d)
    );
    let elsewhere = elsewhere(d);
    let table = |claims: usize, named: usize| -> Vec<String> {
        let (mut rows, decimals) = rows_with_decimals(d, d.verdict.shortened(claims, named));
        if let (Some(whole), Some(said)) = (rows.last_mut(), &elsewhere) {
            whole.text += &format!("; {said}");
        }
        let each = rows.iter().enumerate().flat_map(|(k, row)| row_lines(row, decimals, k <= claims));
        std::iter::once(head.clone()).chain(each).collect()
    };
    // as many as fit are told by name, and of these as many as can be with their advice; one claim is always told
    let claims = 1..=d.verdict.rows.len();
    let mut all: Vec<_> = claims.flat_map(|n| (0..=MOST_NAMED_IN_REST).map(move |named| (n, named))).collect();
    all.sort_by_key(|&(claims, named)| std::cmp::Reverse((claims + named, claims)));
    all.into_iter().map(|(n, named)| table(n, named)).find(|t| t.len() <= LINES).unwrap_or_else(|| table(1, 0))
}

/// What `--json` prints and Python reads: the diagnosis, its recordings, which joints were believed, the verdict's lines.
///
/// # Errors
/// If it cannot be written as JSON.
pub fn json(d: &Diagnosis, source: JointSource) -> Result<serde_json::Value> {
    let mut value = serde_json::to_value(d)?;
    value["recordings"] = serde_json::to_value(&d.data.names)?;
    value["cautions"] = serde_json::to_value([no_arm(d), cautions(d)].concat())?;
    value["joints"] = serde_json::to_value(source)?;
    value["verdict"]["lines"] = serde_json::to_value(lines(d))?;
    Ok(value)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use trical_model::{Axis, Basis, Motion};

    use super::*;

    fn row(kind: RowKind) -> VerdictRow {
        VerdictRow {
            kind,
            text: "Lost motion at joint 3".into(),
            perhaps: None,
            confidence: Some([0.75, 0.99]),
            before_mm: 0.5091,
            after_mm: 0.1714,
            action: Some("Have the gear of the joint looked at"),
            corrected: true,
            findings: vec![1],
        }
    }

    #[test]
    fn a_row_says_what_it_takes_away_how_sure_it_is_and_what_to_do() {
        let found = row(RowKind::Finding);
        assert_eq!(errors(&found, 3), "0.509 -> 0.171");
        assert_eq!(sentence(&found), "Lost motion at joint 3 (75 to 99 %)");
        assert_eq!(advice(&found), "Modelled. Do: have the gear of the joint looked at");
        let one = VerdictRow {
            confidence: Some([0.991, 0.994]),
            perhaps: Some("perhaps backlash (40 %)".into()),
            ..found.clone()
        };
        assert_eq!(sentence(&one), "Lost motion at joint 3 (99 %), perhaps backlash (40 %)");
        // a rival stands where the probability is not taken for both
        let rival = VerdictRow { perhaps: Some("if not, friction".into()), ..one };
        assert_eq!(sentence(&rival), "Lost motion at joint 3 (99 %; if not, friction)");
        assert_eq!(claim(&rival, None), "Lost motion at joint 3 (if not, friction)");
        // what asks nothing but to use the model is no advice, what else may be done is
        let asks = |action| VerdictRow { action: Some(action), corrected: true, ..found.clone() };
        assert_eq!(advice(&asks("Let the calibrated model correct it.")), "Modelled.");
        let silent = VerdictRow { corrected: false, ..asks("Let the calibrated model correct it") };
        assert_eq!(advice(&silent), "");
        let nameless = VerdictRow { action: None, ..found.clone() };
        assert_eq!(advice(&nameless), format!("Modelled. {NOT_SURE}"));
        assert_eq!(advice(&VerdictRow { kind: RowKind::Rest, ..nameless }), "");
        let worn = asks("Let the calibrated model correct it; where it grows, have the gear checked.");
        assert_eq!(advice(&worn), "Modelled. Where it grows, have the gear checked.");
    }

    #[test]
    fn the_plain_and_the_whole_model_have_one_error_and_what_has_no_name_none() {
        assert_eq!([RowKind::Plain, RowKind::Whole].map(|k| errors(&row(k), 2)), ["0.17", "0.17"]);
        assert_eq!(errors(&row(RowKind::Unexplained), 2), "");
        assert_eq!(advice(&row(RowKind::Whole)), "Do: have the gear of the joint looked at");
    }

    #[test]
    fn what_changes_nothing_that_is_shown_is_left_out() {
        for (kind, findings) in [(RowKind::Finding, vec![1]), (RowKind::Curves, vec![]), (RowKind::Rest, vec![])] {
            let row = |after_mm| VerdictRow { after_mm, findings: findings.clone(), ..row(kind) };
            assert!(shows(&row(0.5), 3) && !shows(&row(0.5088), 3) && shows(&row(0.5088), 4));
        }
        // findings of the rest are in the model, sure or not; that they change nothing is said
        let still = VerdictRow { after_mm: 0.5091, ..row(RowKind::Rest) };
        assert!(shows(&still, 3) && as_told(still, 3).text.ends_with("; the error stays as it is"));
        assert_eq!(as_told(row(RowKind::Rest), 3).text, row(RowKind::Rest).text);
        assert!(shows(&VerdictRow { after_mm: 0.5091, ..row(RowKind::Whole) }, 3));
    }

    #[test]
    fn what_only_places_the_instrument_is_counted_beside_the_arm() {
        let mut plain = crate::test_data::arm();
        assert_eq!(set_up(&plain), None);
        for (effect, site) in [
            ("setup", Site::Frame { frame: 1, motion: Motion::ALL[0] }),
            ("setup", Site::Target { target: 1, axis: Axis::X }),
            ("place", Site::Fixture(Motion::ALL[0])),
            ("geometry", Site::Base(Motion::ALL[0])),
        ] {
            plain.terms.push(Term::new("t", effect, site, Basis::CONSTANT));
        }
        assert_eq!(set_up(&plain).as_deref(), Some("and 3 of measuring frame, targets and places of the balls"));
    }

    #[test]
    fn what_a_model_is_worth_elsewhere_is_told_where_that_is_much_worse() {
        let mut d = crate::test_data::diagnosis();
        let of = |mm: f64| Some(ErrorSummary::of(&[mm * 1e-3; 4]));
        (d.after.holdout_rms_mm, d.baseline.holdout_rms_mm) = (0.1, 0.4);
        let n = decimals(&d);
        assert_eq!(elsewhere(&d), None);
        d.after.held_out.by_session = of(0.9 * MUCH_WORSE * 0.1);
        assert_eq!(elsewhere(&d), None);
        (d.after.held_out.by_session, d.baseline.by_session) = (of(0.25), of(0.35));
        let said = format!("in a session that it was not fitted to: {:.n$} mm (plain model: {:.n$})", 0.25, 0.35);
        assert_eq!(elsewhere(&d), Some(said.clone()));
        assert!(lines(&d).concat().contains(&said));
        (d.after.held_out.by_session, d.after.held_out.by_place) = (of(0.1), of(0.25));
        assert!(elsewhere(&d).unwrap().starts_with("at a place of the balls that it was not fitted to: 0.25"));
    }

    #[test]
    fn lines_of_a_row_begin_with_its_errors_and_go_on_below_its_text() {
        let long = VerdictRow { text: "word ".repeat(40).trim().into(), ..row(RowKind::Finding) };
        let lines = row_lines(&long, 3, true);
        assert!(lines.len() > 2 && lines.iter().all(|l| l.chars().count() <= WIDE), "{lines:?}");
        assert!(
            lines[0].starts_with("  0.509 -> 0.171  word") && lines[1].starts_with("                  word"),
            "{lines:?}"
        );
        assert!(!row_lines(&long, 3, false).concat().contains("Do:"));
    }

    #[test]
    fn of_many_claims_as_many_as_fit_in_ten_lines_are_told_by_name_and_the_first_ones_with_their_advice() {
        let mut d = crate::test_data::diagnosis();
        let step = |k: usize| VerdictRow {
            text: format!("Claim {k}, {}", "which takes most of a line in a terminal, ".repeat(2)),
            before_mm: 1.0 - 0.1 * k as f64,
            after_mm: 0.9 - 0.1 * k as f64,
            findings: vec![k + 1],
            ..row(RowKind::Finding)
        };
        let end = |kind, text: &str| VerdictRow { text: text.into(), action: None, ..row(kind) };
        let named = |d: &Diagnosis| {
            let all = lines(d);
            assert!(all.len() <= LINES, "{all:#?}");
            let text = all.concat();
            let advised = text.matches("Do:").count();
            ((0..8).take_while(|k| text.to_lowercase().contains(&format!("claim {k},"))).count(), advised)
        };
        let mut table = |n: usize| {
            d.verdict.rows = std::iter::once(end(RowKind::Plain, "Plain model"))
                .chain((0..n).map(step))
                .chain([end(RowKind::Whole, "Whole model")])
                .collect();
            named(&d)
        };
        assert_eq!(table(2), (2, 2));
        // each with its advice takes two lines: three of them leave room for one that is only named
        assert_eq!(table(6), (4, 2));
    }
}
