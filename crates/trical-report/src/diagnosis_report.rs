//! The report of a diagnosis: verdict, where on the arm, each finding against the variable that reveals it, what could not be
//! seen.

mod against;
mod coefficients;

use trical_diagnose::effect_id::UNEXPLAINED;
use trical_diagnose::{Diagnosis, Finding, Rival, RowKind, Unexplained, VerdictRow, verdict};
use trical_ident::fit::cautions::listed;
use trical_ident::{ErrorSummary, JointSource};
use trical_model::{Model, Place, Robot, Term};

use crate::error::Result;
use crate::evidence::{Errors, half_width, joints_used, legend, parameters, rejected, residuals, row};
use crate::figures::arm_map;
use crate::figures::plots::{self, AFTER, BEFORE, Series};
use crate::finding_figures;
use crate::page::{self, Figure, Made, Section, error_table};
use crate::table;
use crate::verdict_summary;

use self::coefficients::coefficients;

pub use self::against::{Against, against};

/// Most findings that are told one by one, with figures; the others are in one table.
const SHOWN: usize = 12;

/// Findings whose coefficients are written out; a curve has more.
const FEW: usize = 8;

/// Findings and curves without a name whose pictures are open; those of the others are folded.
const OPEN: usize = 4;

/// What the picture of a finding shows, told once on a page.
const COMPARED: &str = "Each faint point is one measurement: its error along the direction in which this effect acts, with this effect, and \
    without it, everything else fitted anew. Strong points are means over parts of the axis, with their 95 % intervals.";

/// Rivals of a finding that are told: the others are worse.
const RIVALS: usize = 3;

fn rivals(f: &Finding) -> String {
    let named = |r: &Rival| verdict::named(r.effect, r.site).to_lowercase();
    first_of(f.rivals.iter().map(named), &verdict::named(f.effect, f.site).to_lowercase())
}

/// What else a finding could be; touches that decide are planned only where the balls tell where the base is, and asked for only where the
/// finding is not sure: then the verdict tells no rival either.
fn could_also_be(rivals: &str, sure: bool, balls_fix_base: bool) -> Option<String> {
    let next = if balls_fix_base { " `trical diagnose --next 8` plans touches that decide." } else { "" };
    (!rivals.is_empty()).then(|| {
        if sure {
            format!("Much less likely: {rivals}.")
        } else {
            format!("In this data it could also be: {rivals}.{next}")
        }
    })
}

/// The first of some names, each once; other forms of the effect itself have its `own` name, and tell nothing.
fn first_of(names: impl Iterator<Item = String>, own: &str) -> String {
    let mut others: Vec<String> = Vec::new();
    for name in names.filter(|name| name != own) {
        if !others.contains(&name) {
            others.push(name);
        }
    }
    let more = others.len().saturating_sub(RIVALS);
    others.truncate(RIVALS);
    others.extend((more > 0).then(|| format!("{more} more")));
    // names have commas of their own
    others.join("; ")
}

/// What the whole model does to the error (mm rms) at poses that the fit did not see, `of` which kind; `modelled` says what it has.
fn whole(modelled: &str, of: &str, [before, after]: [f64; 2], decimals: usize) -> String {
    let [before, after] = [before, after].map(|mm| format!("{mm:.decimals$}"));
    if before == after {
        return format!(
            "{after} mm rms is left at poses that the fit did not see{of}: nothing was found that lowers it."
        );
    }
    // ", at the same balls," in the middle of a sentence
    let comma = if of.is_empty() { "" } else { "," };
    format!(
        "With {modelled} in the model, the error at poses that the fit did not see{of}{comma} falls from {before} to {after} mm rms."
    )
}

/// "these, 12 smaller findings and curves of no known cause": the claims that are told, and what the model has besides.
fn modelled(told: &[&VerdictRow], findings: usize, curves: bool) -> String {
    let more = findings.saturating_sub(told.iter().map(|r| r.findings.len()).sum());
    let mut said = vec![if told.len() == 1 { "this" } else { "these" }.to_owned()];
    said.extend(match more {
        0 => None,
        1 => Some("1 smaller finding".to_owned()),
        n => Some(format!("{n} smaller findings")),
    });
    if curves && !told.iter().any(|r| r.kind == RowKind::Curves) {
        said.push("curves of no known cause".into());
    }
    listed(&said, "and")
}

/// What a search or a curve without a name does to the error (mm rms) at poses that the fit did not see.
fn alone(how: &str, [before, after]: [f64; 2], decimals: usize) -> String {
    if after < before {
        return format!(
            "{how} lowers the error at poses that the fit did not see from {before:.decimals$} to {after:.decimals$} mm rms."
        );
    }
    format!(
        "{how} explains it here, but not at poses that the fit did not see: there the error is {after:.decimals$} mm rms with it, \
         {before:.decimals$} without."
    )
}

/// Where a finding is and how large.
fn located(f: &Finding, d: &Diagnosis) -> String {
    let values = coefficients(&f.coefficients, &d.model.terms);
    let told = if values.len() > FEW { format!("{} coefficients", f.coefficients.len()) } else { values.join("; ") };
    format!("{}. {}.", verdict::capital(&f.located), verdict::capital(&told))
}

/// A finding against the variable that reveals it, its size and its rivals; it has a number, from 1.
pub fn finding_section(number_of: usize, f: &Finding, d: &Diagnosis) -> Result<Section> {
    let mut text = vec![
        located(f, d),
        if f.is_likely() {
            format!("What to do: {}", f.action)
        } else {
            format!("Measure more before anything is done. If it is this: {}", verdict::small(f.action))
        },
    ];
    let rivals = rivals(f);
    text.extend(could_also_be(&rivals, f.is_sure(), d.model.cell.balls_fix_base(|_| true)));
    let evidence = &f.evidence;
    if evidence.holdout_rms_after_mm > evidence.holdout_rms_before_mm {
        text.push(f.summary.clone());
    }
    let section = Section::new(format!("{number_of}. {} ({:.0} %)", verdict::heading(f), f.confidence * 100.0))
        .with_text(text)
        .folded(number_of > OPEN);
    let Against { label, x, error, without: before, with: after } = against(f, d)?;
    let points = |y: &[f64]| x.iter().copied().zip(y.iter().copied()).collect();
    let series = [
        Series { name: "without it", color: BEFORE, points: points(&before) },
        Series { name: "with it", color: AFTER, points: points(&after) },
    ];
    let mut figures = finding_figures::figures(f, d)?;
    let explained =
        if number_of == 1 { COMPARED } else { "Errors with this effect and without it, drawn as of finding 1." };
    figures.push(Figure::new(explained, plots::compared(&label, error, &series)?));
    Ok(section.with_figures(figures))
}

/// The verdict as a table: error before and after each claim, the claim, how sure it is, what to do.
fn verdict_table(d: &Diagnosis) -> Vec<Vec<String>> {
    let (told, decimals) = verdict_summary::rows_with_decimals(d, d.verdict.rows.clone());
    let mut rows = vec![row(["claim", "probability", "error before, mm", "after, mm", "what to do"])];
    rows.extend(told.iter().map(|r| {
        let begins = !matches!(r.kind, RowKind::Plain | RowKind::Whole | RowKind::Unexplained);
        let number = |x: f64, shown: bool| if shown { format!("{x:.decimals$}") } else { String::new() };
        vec![
            verdict_summary::claim(r, None),
            r.probability().unwrap_or_default(),
            number(r.before_mm, begins && verdict_summary::changes(r, decimals)),
            number(r.after_mm, r.kind != RowKind::Unexplained),
            verdict_summary::advice(r),
        ]
    }));
    rows
}

/// What a report begins with: the verdict as a table, cautions, notes.
pub fn verdict_section(d: &Diagnosis) -> Section {
    let mut section = Section::new("Verdict")
        .with_text(verdict_summary::no_arm(d).iter().map(|c| format!("Caution: {c}")).chain([format!(
            "Errors are at poses that the fit did not see{}, root mean square. The error before \
                 each row is the error after the row above it.",
            verdict_summary::same_balls(d)
        )]))
        .with_tables([verdict_table(d)]);
    section.after.extend(verdict_summary::elsewhere(d).map(|e| format!("The whole model errs more {e}.")));
    // the headline says that no cause is sure
    let said = verdict_summary::none_sure(d).map(table::ended);
    let cautions = verdict_summary::cautions(d).into_iter().filter(|c| said.as_ref() != Some(c));
    section.after.extend(cautions.map(|c| format!("Caution: {c}")));
    section.after.extend(verdict_summary::notes(d).iter().map(|n| format!("Note: {n}")));
    section
}

/// Steps (name, error before and after) in the order in which they were taken: each begins where the one before it ends.
fn chained(start: f64, mut steps: Vec<(String, f64, f64)>) -> Vec<(String, f64)> {
    let (mut here, mut out) = (start, Vec::new());
    while let Some(next) =
        (0..steps.len()).min_by(|a, b| (steps[*a].1 - here).abs().total_cmp(&(steps[*b].1 - here).abs()))
    {
        let (name, _, after) = steps.remove(next);
        here = after;
        out.push((name, after));
    }
    out
}

/// A finding with its number, from 1.
type Numbered<'a> = (usize, &'a Finding);

/// Findings in a row each, with the evidence.
fn findings_table(d: &Diagnosis, findings: &[Numbered<'_>]) -> Vec<Vec<String>> {
    let mut rows = vec![row(["finding", "probability", "lambda", "error before, mm", "after, mm", "could also be"])];
    let decimals = verdict_summary::decimals(d);
    for (k, f) in findings {
        let [before, after] = [f.evidence.holdout_rms_before_mm, f.evidence.holdout_rms_after_mm];
        let [before, after] = [before, after].map(|mm| format!("{mm:.decimals$}"));
        let after = if after == before { "unchanged".to_owned() } else { after };
        rows.push(vec![
            format!("{k}. {}", verdict::heading(f)),
            format!("{:.0} %", f.confidence * 100.0),
            format!("{:.1}", f.lambda),
            before,
            after,
            rivals(f),
        ]);
    }
    if findings.iter().all(|(_, f)| f.rivals.is_empty()) {
        rows.iter_mut().for_each(|r| r.truncate(r.len() - 1));
    }
    rows
}

/// Findings that are told one by one, at most [`SHOWN`], and the others. One is told at any rate.
fn told_and_more(d: &Diagnosis) -> (Vec<Numbered<'_>>, Vec<Numbered<'_>>) {
    let all = (1..).zip(&d.findings);
    let (mut told, mut more): (Vec<_>, Vec<_>) = all.partition(|(k, f)| !f.is_small_and_unsure() || is_only(d, *k));
    more.extend(told.drain(told.len().min(SHOWN)..));
    more.sort_unstable_by_key(|(k, _)| *k);
    (told, more)
}

/// Whether this is the first of findings that are all small and unsure.
fn is_only(d: &Diagnosis, number: usize) -> bool {
    number == 1 && d.findings.iter().all(Finding::is_small_and_unsure)
}

/// Findings that are not told one by one, where each is and how large.
fn more_findings(d: &Diagnosis) -> Option<Section> {
    let (_, more) = told_and_more(d);
    if more.is_empty() {
        return None;
    }
    let mut section =
        Section::new(table::counted(more.len(), "more finding")).with_tables([findings_table(d, &more)]).folded(true);
    section.after = more.iter().map(|(k, f)| format!("{k}. {}", located(f, d))).collect();
    Some(section)
}

/// Findings with the evidence, the main ones in a row each, and where they are on the arm.
fn all_findings(d: &Diagnosis) -> Result<Section> {
    let decimals = verdict_summary::decimals(d);
    let (told, more) = told_and_more(d);
    let heading = if more.is_empty() { "All findings" } else { "The main findings" };
    let mut section = Section::new(heading).with_tables([findings_table(d, &told)]);
    section.text.push(
        "Lambda is the size of the effect in this data, in standard deviations of the noise: 3 is just visible. The errors \
         are at poses that the fit did not see, just before this finding was added to the model and just after; the verdict sorts \
         and groups the findings, so that its errors differ."
            .into(),
    );
    section.figures.push(Figure::new(
        "The arm from the side at one of the measured poses. Places where something was found are red: the more of the error it explains, the redder. \
         Numbers in circles are joints.",
        arm_map::draw(d, &told.iter().map(|(k, f)| (*k, verdict::heading(f))).collect::<Vec<_>>())?,
    ));
    // findings and nameless curves, in the order in which they were added
    let named = d
        .findings
        .iter()
        .enumerate()
        .map(|(k, f)| ((k + 1).to_string(), &f.evidence))
        .map(|(n, e)| (n, e.holdout_rms_before_mm, e.holdout_rms_after_mm));
    let nameless = d.unexplained.iter().chain(&d.more_unexplained).filter(|u| !u.curve.is_empty());
    let steps: Vec<(String, f64, f64)> =
        named.chain(nameless.map(|u| ("curve".to_owned(), u.holdout_rms_before_mm, u.holdout_rms_after_mm))).collect();
    let mut stairs = vec![("plain".to_owned(), d.baseline.holdout_rms_mm)];
    let curves = steps.iter().any(|(name, ..)| name == "curve");
    stairs.extend(chained(d.baseline.holdout_rms_mm, steps));
    // steps that change nothing in what is shown would be most of them
    stairs.dedup_by_key(|(_, mm)| format!("{mm:.decimals$}"));
    section.figures.push(Figure::new(
        format!(
            "Error at poses that the fit did not see: of the plain model (red), and as the findings are modelled one after the other, by \
             their numbers{}. Those that change nothing are left out.",
            if curves { " (curve: of no known cause)" } else { "" }
        ),
        plots::staircase("mm rms at poses that the fit did not see", &stairs, decimals),
    ));
    Ok(section)
}

/// "Joint 3 is off", "The links are off".
fn is_off(site: Place) -> String {
    match site {
        Place::Links | Place::Joints => format!("The {site} have errors"),
        Place::Base | Place::Tool | Place::Fixture => format!("The {site} has an error"),
        _ => format!("{} has an error", verdict::capital(&site.to_string())),
    }
}

/// Over what a curve is drawn, with its unit: what its region is said of, where that is one variable. A curve that changes sign with a
/// sense of motion has that as its variable.
fn along(u: &Unexplained, robot: &Robot) -> String {
    let (of, rest) = u.region.split_once(' ').unwrap_or((&u.region, ""));
    let what = match rest.split_once("in proportion to ") {
        Some((_, of)) if u.region.starts_with("all moves") => format!("moves of {}: {of}", u.site),
        _ => verdict::variable(if of == "all" { &u.variable } else { of }, robot).trim_start_matches("the ").to_owned(),
    };
    // a number of a pose needs no unit
    if u.curve_units.0 == "pose" { what } else { format!("{what}, {}", u.curve_units.0) }
}

/// With which sense of motion a curve changes its sign.
fn by_sense(u: &Unexplained, robot: &Robot) -> String {
    let beside = u.variable.starts_with("dir") && !u.region.starts_with("all moves");
    if beside { format!(", changing sign with {}", verdict::variable(&u.variable, robot)) } else { String::new() }
}

/// The curves without a name that take most of the error, each with its picture.
fn nameless(d: &Diagnosis) -> Result<Vec<Section>> {
    let decimals = verdict_summary::decimals(d);
    let taken = |u: &Unexplained| u.holdout_rms_after_mm.powi(2) - u.holdout_rms_before_mm.powi(2);
    let mut all: Vec<&Unexplained> = d.unexplained.iter().chain(&d.more_unexplained).collect();
    all.sort_by(|a, b| taken(a).total_cmp(&taken(b)));
    all.into_iter()
        .take(4)
        .enumerate()
        .map(|(k, u)| {
            let figures = if u.curve.is_empty() {
                Vec::new()
            } else {
                let beside = if u.region.contains(", with ") {
                    format!(", {} in the middle of its range", u.site)
                } else {
                    String::new()
                };
                let x_label = along(u, &d.model.robot);
                vec![match finding_figures::of_no_cause(u, &x_label, d)? {
                    Some(figure) => figure,
                    None => Figure::new(
                        format!("The curve that was fitted{beside}."),
                        plots::scatter(
                            &x_label,
                            &format!("correction, {}", u.curve_units.1),
                            false,
                            true,
                            &[Series { name: "curve", color: AFTER, points: u.curve.clone() }],
                        )?,
                    ),
                }]
            };
            let how = if u.curve.is_empty() { "A term of this form" } else { "A free curve" };
            let lowers = alone(how, [u.holdout_rms_before_mm, u.holdout_rms_after_mm], decimals);
            Ok(Section::new(format!("No known cause: {}", u.site))
                .with_text([format!(
                    "{} {}{}. No known effect explains it. {lowers}",
                    is_off(u.site),
                    verdict::region(&u.region, &d.model.robot),
                    by_sense(u, &d.model.robot)
                )])
                .with_figures(figures)
                .folded(d.findings.len() + k >= OPEN))
        })
        .collect()
}

/// Whether there is nothing to tell but the plain model.
fn nothing(d: &Diagnosis) -> bool {
    d.findings.is_empty() && d.unexplained.is_none()
}

/// The first two claims, what to do first, and how far the error falls; or that nothing was found.
fn summary(d: &Diagnosis) -> String {
    let decimals = verdict_summary::decimals(d);
    let errors = [d.baseline.holdout_rms_mm, d.after.holdout_rms_mm];
    if nothing(d) {
        let not_shown = verdict_summary::not_shown(d).map_or_else(String::new, |said| format!(" {said}."));
        return format!(
            "Nothing found. The plain model ({} parameters) predicts new poses to {:.decimals$} mm rms; no known effect shows in what \
             is left.{not_shown}",
            d.baseline.parameters, errors[0]
        );
    }
    let claims = d.verdict.shortened(2, 0);
    let told: Vec<&VerdictRow> =
        claims.iter().filter(|r| matches!(r.kind, RowKind::Finding | RowKind::Curves)).collect();
    // where no cause is sure, that is what to do something about first
    let none_sure = verdict_summary::none_sure(d);
    let first = told.iter().position(|r| none_sure.is_none() && verdict_summary::to_do(r).is_some());
    let mut said = Vec::new();
    for (k, row) in told.iter().enumerate() {
        said.push(format!("{}.", verdict_summary::sentence(row)));
        said.extend(verdict_summary::to_do(row).filter(|_| first == Some(k)));
    }
    said.extend(none_sure.map(|c| format!("{}.", verdict::capital(c))));
    let curves = d.unexplained.iter().chain(&d.more_unexplained).any(|u| u.modelled);
    said.push(whole(&modelled(&told, d.findings.len(), curves), verdict_summary::same_balls(d), errors, decimals));
    said.extend(verdict_summary::elsewhere(d).map(|e| format!("But it errs more {e}.")));
    said.join(" ")
}

/// Parameters of the arm and of what it was measured with, and those of each finding; curves have too many, with a name or without.
fn parameter_sections(d: &Diagnosis) -> [Section; 2] {
    let of_finding = |t: &Term| d.findings.iter().position(|f| f.coefficients.iter().any(|c| c.name == t.name));
    let known = || d.model.terms.iter().filter(|t| t.sd.is_some());
    let nameless = |t: &Term| t.effect == UNEXPLAINED;
    let own = || known().filter(|t| of_finding(t).is_none() && !nameless(t));
    let mut rows = vec![row(["finding", "parameter", "identified", "95 % from", "to", "unit", "remark"])];
    for (k, f) in d.findings.iter().enumerate().filter(|(_, f)| f.coefficients.len() <= FEW) {
        let heading = format!("{}. {}", k + 1, verdict::heading(f));
        // the heading, and nominal, the second, are none of it
        let of_it = known().filter(|t| of_finding(t) == Some(k));
        let each = parameters(&d.model, of_it, half_width(None), |_| String::new());
        rows.extend(each.into_iter().skip(1).map(|cells| {
            std::iter::once(heading.clone())
                .chain(cells.into_iter().enumerate().filter(|c| c.0 != 1).map(|c| c.1))
                .collect()
        }));
    }
    let curves = known().count() - own().count() - (rows.len() - 1);
    let left_out =
        (curves > 0).then(|| format!("{} of curves are in the model file only.", table::counted(curves, "parameter")));
    let interval = "The 95 % interval of each (1.96 standard deviations to each side) holds if the model is complete.";
    [
        Section::new("Parameters")
            .with_text(std::iter::once(interval.to_owned()).chain(legend(own())))
            .with_tables([parameters(&d.model, own(), half_width(None), |_| String::new())])
            .folded(true),
        Section::new("Parameters of the findings")
            .with_text(std::iter::once("By their names in the model file. Nominal is zero.".to_owned()).chain(left_out))
            .with_tables((rows.len() > 1).then_some(rows))
            .folded(true),
    ]
}

/// Why `trical identify` tells other numbers.
const OTHER_NUMBERS: &str = "`trical identify` may give other numbers for the same recordings: its model also has the twist of near-parallel axes and \
    the scale of a rail, which are findings here, and each command rejects the rows that do not fit its own model.";

/// Effects that would not be visible in this data.
fn blind_to(d: &Diagnosis) -> Section {
    let mut blind = vec![row(["effect", "site", "lambda of a typical size", "what is missing"])];
    blind.extend(d.blind_to.iter().map(|b| {
        vec![
            b.effect.effect().title.to_owned(),
            b.site.to_string(),
            // what was not asked has no size
            if b.lacks.is_some() { "-".into() } else { format!("{:.2}", b.lambda) },
            b.lacks.clone().unwrap_or_default(),
        ]
    }));
    Section::new("What this data could not show")
        .with_text([
            "At these sites an effect of typical size would not be visible in this data (lambda \
                 below 3): it may be there although it was not found.",
            "On one arm a scale error of the measuring frame (all lengths together) cannot be told \
                 from the arm's own size.",
        ])
        .with_tables([blind])
        .folded(true)
}

/// The whole report.
pub fn render(d: &Diagnosis, source: JointSource, mut made: Made) -> Result<String> {
    // of lengths and positions alike, m
    let lengths =
        |m: &Model| -> Result<Vec<f64>> { Ok(residuals(m, &d.data)?.iter().map(|r| r.norm() * 1e-3).collect()) };
    let (before, after) = (lengths(&d.before)?, lengths(&d.model)?);
    let was = format!("{} parameters", d.baseline.parameters);
    // where nothing was found, before is after
    let earlier = if nothing(d) { &[][..] } else { &before[..] };
    let errors = Errors { model: &d.model, data: &d.data, was: &was, before: earlier, after: &after };
    let (heading, table) = if nothing(d) {
        ("Position error", error_table(&[(&was, &ErrorSummary::of(&before))]))
    } else {
        let first = format!("before: {was}");
        let rows = [
            (first.as_str(), &ErrorSummary::of(&before)),
            ("after: everything found is modelled", &ErrorSummary::of(&after)),
        ];
        ("Position error before and after", error_table(&rows))
    };
    let mut sections = vec![
        verdict_section(d),
        Section::new(heading)
            .with_text(["At the poses of the fit; the error at poses that it did not see is in the verdict."])
            .with_tables([table]),
    ];
    if !d.findings.is_empty() {
        sections.push(all_findings(d)?);
    }
    for (k, f) in told_and_more(d).0 {
        sections.push(finding_section(k, f, d)?);
    }
    sections.extend(more_findings(d));
    sections.extend(nameless(d)?);
    sections.push(errors.section()?.folded(true));
    sections.push(errors.by_joint()?.folded(true));
    sections.extend(errors.pictures()?);
    let [own, of_findings] = parameter_sections(d);
    sections.push(own);
    sections.extend(Some(of_findings).filter(|s| !s.tables.is_empty() || s.text.len() > 1));
    sections.push(blind_to(d));
    if !d.rejected.is_empty() {
        sections.push(rejected(&d.rejected, d.rejected.len()));
    }
    made.notes.extend([joints_used(source), OTHER_NUMBERS.to_owned()]);
    let title = page::title("Diagnosis", &d.model.robot.name, &d.data.names);
    page::render(&title, &summary(d), &sections, &made)
}

#[cfg(test)]
mod tests;
