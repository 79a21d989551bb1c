//! The report of a validation: a model on recordings, for the person who signs it off.

use trical_diagnose::verdict;
use trical_ident::{ErrorSummary, ModelFile, Validation};

use crate::error::Result;
use crate::evidence::{self, Errors, half_width, row, signing};
use crate::page::{self, Made, Section, error_table};
use crate::table::counted;

/// A region with a mean error larger than that of all by this is worth a word.
const WORSE: f64 = 2.0;

/// Intervals of 95 % that hold fewer are worth a word.
const LEAST_COVERED: f64 = 0.9;

/// A model that is worse than the nominal arm by this much is one whose surroundings have changed.
const FAR: f64 = 3.0;

/// What makes the errors worth little, in one sentence each.
pub fn cautions(v: &Validation) -> Vec<String> {
    let mut out = Vec::new();
    if v.after.mean_mm >= v.before.mean_mm {
        let anew = if v.sessions.iter().any(|s| s.refitted.is_empty()) {
            " Where instrument or tool were mounted anew, first identify them on these recordings (--refit frame,targets)."
        } else {
            ""
        };
        out.push(format!("The model is no better than the nominal arm on these recordings: do not use it here.{anew}"));
    }
    let learnt = |s: &&trical_ident::SessionErrors| s.learnt.is_some();
    let same: Vec<&str> = v.sessions.iter().filter(learnt).map(|s| s.recording.as_str()).collect();
    if !same.is_empty() {
        let these = if same.len() < v.sessions.len() { "its errors there" } else { "these errors" };
        out.push(format!("The model was fitted to {}: {these} say nothing about other poses.", same.join(", ")));
    }
    out
}

/// Of 95 % intervals that hold more of so many coordinates, the standard deviations are too large.
const MOST_COVERED: f64 = 0.99;
const FEW: usize = 300;

/// Intervals that are wider than they need be, which does no harm.
fn too_wide(v: &Validation) -> Option<String> {
    let covered = v.predicted.as_ref()?.covered;
    (covered > MOST_COVERED && 3 * v.n >= FEW)
        .then(|| "These intervals are too wide here: the model is better than it expects.".into())
}

/// Intervals that are too narrow to be relied on.
fn too_narrow(v: &Validation) -> Option<String> {
    let covered = v.predicted.as_ref()?.covered;
    (covered < LEAST_COVERED).then(|| {
        format!(
            "Of the coordinates {:.0} % lie within the model's 95 % intervals: these are too narrow here.",
            100.0 * covered
        )
    })
}

fn concerns(v: &Validation) -> Result<Vec<String>> {
    let rejected = v.rejected.len();
    let mut out = cautions(v);
    let worst = v.regions.iter().filter(|r| r.n > 4).max_by(|a, b| a.after.mean_mm.total_cmp(&b.after.mean_mm));
    if let Some(r) = worst.filter(|r| r.after.mean_mm > WORSE * v.after.mean_mm) {
        out.push(format!(
            "Errors differ from region to region: {:.3} mm on average for {}.",
            r.after.mean_mm, r.region
        ));
    }
    let lost = v.regions.iter().filter(|r| r.after.mean_mm >= r.before.mean_mm).count();
    if lost > 0 && v.after.mean_mm < v.before.mean_mm {
        out.push(format!("In {lost} of {} regions the model is no better than the nominal arm.", v.regions.len()));
    }
    out.extend(too_narrow(v));
    out.extend(evidence::beyond_noise(&v.model, &v.data)?);
    out.extend(evidence::long_tail(&v.after, &v.data));
    if rejected > 0 {
        out.push(format!("Rejected: {}; each is named below with its reason.", counted(rejected, "row")));
    }
    Ok(out)
}

/// What says nothing here, in words: an effect, or where the balls stood.
fn left_out(effect: &str) -> String {
    if effect == "place" { "places of the balls".to_owned() } else { verdict::title_of(effect) }
}

/// The whole report.
pub fn render(v: &Validation, file: &ModelFile, mut made: Made) -> Result<String> {
    let (before, after): (Vec<f64>, Vec<f64>) = v.errors.iter().copied().unzip();
    let errors = Errors { model: &v.model, data: &v.data, was: "the nominal arm", before: &before, after: &after };
    let list = concerns(v)?;
    let mut verdict = format!(
        "The position error at {} measurements is {:.3} mm on average and {:.3} mm at most; with the nominal arm it is {:.3} and {:.3} mm.",
        v.n, v.after.mean_mm, v.after.max_mm, v.before.mean_mm, v.before.max_mm
    );
    if v.sessions.iter().any(|s| s.learnt.is_some()) {
        let others = v.sessions.iter().filter(|s| s.learnt.is_none());
        let each: Vec<String> = others.map(|s| format!("{:.3} mm in {}", s.after.mean_mm, s.recording)).collect();
        if each.is_empty() {
            verdict += " These poses were used for the fit.";
        } else {
            verdict += &format!(" Where the model was not fitted it is {} on average.", each.join(", "));
        }
    }
    if v.after.mean_mm < v.before.mean_mm {
        verdict += &signing(list.len());
    } else {
        verdict += " Do not sign: the model is no better than the nominal arm here.";
        if v.after.mean_mm > FAR * v.before.mean_mm && v.sessions.iter().any(|s| s.refitted.is_empty()) {
            verdict = format!(
                "Instrument, tool or balls seem to stand elsewhere than in the model: identify them here first (--refit frame,targets). {verdict}"
            );
        }
    }
    let anew = v.sessions.iter().any(|s| !s.refitted.is_empty());
    let mut text = vec![format!(
        "Before is the arm as its maker describes it, with only the measuring frame or base and the tool points identified on \
         these recordings. After is the model as it is in its file{}.",
        if anew { ", but for what was identified anew here" } else { "" }
    )];
    text.extend(v.sessions.iter().map(|s| format!("{}.", s.in_words())));
    let predicted = v.predicted.as_ref().map(trical_ident::Predicted::in_words);
    let wide = too_wide(v);
    text.extend(v.left_out_in_words(left_out).into_iter().chain(v.beyond_in_words()).chain(predicted).chain(wide));
    let parts = |what: &str, of: &mut dyn Iterator<Item = (&str, usize, &ErrorSummary, &ErrorSummary)>| {
        let mut rows = vec![row([
            what,
            "measurements",
            "before: mean, mm",
            "max",
            "after: mean, mm",
            "max",
            "sd",
            "median",
            "rms",
        ])];
        rows.extend(of.map(|(name, n, b, a)| {
            let values = [b.mean_mm, b.max_mm, a.mean_mm, a.max_mm, a.sd_mm, a.median_mm, a.rms_mm];
            [name.to_owned(), n.to_string()].into_iter().chain(values.map(|x| format!("{x:.3}"))).collect()
        }));
        rows
    };
    let regions = parts("region", &mut v.regions.iter().map(|r| (r.region.as_str(), r.n, &r.before, &r.after)));
    let recordings = (v.sessions.len() > 1)
        .then(|| parts("recording", &mut v.sessions.iter().map(|s| (s.recording.as_str(), s.n, &s.before, &s.after))));
    let mut sections = Vec::new();
    sections.push(evidence::to_be_looked_at(list, "the model's own intervals, errors region by region"));
    let table = error_table(&[("before: nominal arm", &v.before), ("after: the model", &v.after)]);
    let terms = v.model.terms.iter().filter(|t| t.sd.is_some());
    sections.extend([
        Section::new("Position error before and after")
            .with_text(text)
            .with_tables(std::iter::once(table).chain(recordings)),
        errors.section()?,
        errors.by_joint()?,
        Section::new("By region")
            .with_text(["Each joint's positions (q1 is joint 1) in four parts with equally many measurements."])
            .with_tables([regions]),
    ]);
    sections.extend(errors.pictures()?);
    sections.extend([
        Section::new("Parameters of the model")
            .with_text(["The 95 % interval of each (1.96 standard deviations to each side) holds if the model is \
                 complete; it comes from the model's file, not from these recordings."])
            .with_tables([evidence::parameters(&v.model, terms, half_width(None), |_| String::new())])
            .folded(true),
        evidence::rejected(&v.rejected, v.rejected.len()),
    ]);
    if !file.sessions.is_empty() {
        made.notes.push(format!("The model was fitted to {}.", file.recordings().join(", ")));
    }
    let title = page::title("Validation", &v.model.robot.name, &v.data.names);
    page::render(&title, &verdict, &sections, &made)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::test_data::{behind, validation};
    use trical_ident::validate::Region;
    use trical_ident::{LeftOut, Predicted, Rejected};

    fn page(v: &Validation) -> String {
        let file = ModelFile::unmeasured(v.model.clone());
        render(v, &file, Made::by("x".into(), &[])).unwrap().replace('\u{a0}', " ")
    }

    #[test]
    fn a_model_that_is_no_better_than_the_nominal_arm_is_not_to_be_signed() {
        let (better, worse) = (page(&validation(1.0, 0.5)), page(&validation(1.0, 1.0)));
        assert!(better.contains("before signing.</p>") && !better.contains("Do not sign"));
        assert!(worse.contains("mm. Do not sign: the model is no better than the nominal arm here.</p>"));
        let elsewhere = "stand elsewhere than in the model: identify them here first";
        assert!(!worse.contains(elsewhere) && page(&validation(1.0, 9.0)).contains(elsewhere));
    }

    #[test]
    fn errors_in_the_recordings_of_the_fit_are_told_apart_from_those_in_others() {
        let mut v = validation(1.0, 0.5);
        let mut other = v.sessions[0].clone();
        (other.recording, other.after.mean_mm) = ("r1.csv".into(), 0.8);
        v.sessions.push(other);
        assert!(!page(&v).contains("Where the model was not fitted"));
        v.sessions[0].learnt = Some(1);
        assert_eq!(cautions(&v), ["The model was fitted to r0.csv: its errors there say nothing about other poses."]);
        assert!(page(&v).contains("Where the model was not fitted it is 0.800 mm in r1.csv on average."));
    }

    #[test]
    fn intervals_that_hold_all_of_many_coordinates_are_too_wide() {
        let mut v = validation(1.0, 0.5);
        let told = |v: &Validation| page(v).contains("These intervals are too wide here");
        let holds = |covered| {
            Some(Predicted { sd_mm: 1.0, parameters_sd_mm: 0.5, covered, covered_visited: None, covered_beyond: None })
        };
        // twelve coordinates of four touches may all lie within
        v.predicted = holds(1.0);
        assert!(!told(&v));
        v.n = 100;
        assert!(told(&v));
        v.predicted = holds(0.96);
        assert!(!told(&v));
    }

    #[test]
    fn what_was_identified_anew_is_not_as_in_the_file() {
        let mut v = validation(1.0, 0.5);
        assert!(page(&v).contains("After is the model as it is in its file.</p>"));
        v.sessions[0].refitted = vec!["frame"];
        let place =
            LeftOut { term: "place_x_1".into(), effect: "place".into(), reason: "other balls".into(), needs: None };
        v.left_out.push(place);
        let page = page(&v);
        assert!(page.contains("as it is in its file, but for what was identified anew here.</p>"));
        assert!(page.contains("Left out: places of the balls (other balls)."));
    }

    fn region(name: &str, n: usize, [before, after]: [f64; 2]) -> Region {
        let [before, after] = [before, after].map(|mm| ErrorSummary::of(&[0.5e-3 * mm, 1.5e-3 * mm]));
        Region { region: name.into(), n, before, after }
    }

    #[test]
    fn a_region_that_is_much_worse_than_the_mean_or_no_better_than_nominal_is_named() {
        let mut v = validation(1.0, 0.2);
        v.regions = vec![region("q1 low", 40, [1.0, 0.1]), region("q1 high", 40, [1.0, 0.3])];
        assert!(!concerns(&v).unwrap().iter().any(|c| c.contains("region")));
        v.regions[0].after.mean_mm = 0.5;
        // so few say nothing of a region
        v.regions.push(region("q2 low", 4, [1.0, 0.9]));
        v.regions.push(region("q2 high", 9, [0.3, 0.35]));
        let told: Vec<String> = concerns(&v).unwrap().into_iter().filter(|c| c.contains("region")).collect();
        assert_eq!(
            told,
            [
                "Errors differ from region to region: 0.500 mm on average for q1 low.",
                "In 1 of 4 regions the model is no better than the nominal arm."
            ]
        );
        assert_eq!(behind(&page(&v), "q2 low", 5), ["4", "1.000", "1.500", "0.900", "1.350"]);
    }

    #[test]
    fn intervals_that_hold_too_few_and_rejected_rows_are_to_be_looked_at() {
        let mut v = validation(1.0, 0.5);
        let told = |v: &Validation, text: &str| concerns(v).unwrap().iter().any(|c| c.starts_with(text));
        let [narrow, rejected] = ["Of the coordinates 85 % lie within", "Rejected: 1 row;"];
        let holds = |covered| {
            Some(Predicted { sd_mm: 1.0, parameters_sd_mm: 0.5, covered, covered_visited: None, covered_beyond: None })
        };
        v.predicted = holds(0.95);
        assert!(!told(&v, "Of the coordinates") && !told(&v, "Rejected"));
        v.predicted = holds(0.85);
        v.rejected.push(Rejected { recording: "r0.csv".into(), line: 7, row: 6, reason: "gross error".into() });
        assert!(told(&v, narrow) && told(&v, rejected));
        assert_eq!(behind(&page(&v), "r0.csv", 2), ["line 7", "gross error"]);
    }

    #[test]
    fn the_table_of_errors_has_the_nominal_arm_before_and_that_of_parameters_those_that_were_identified() {
        let mut v = validation(1.0, 0.5);
        let term = |name: &str, sd| {
            let site = trical_model::Site::Joint { joint: 1 };
            trical_model::Term { sd, ..trical_model::Term::new(name, "geometry", site, trical_model::Basis::CONSTANT) }
        };
        v.model.terms = vec![term("fitted", Some(1e-4)), term("fixed", None)];
        let page = page(&v);
        let mean = ["before: nominal arm", "after: the model"].map(|of| behind(&page, of, 1)[0]);
        assert_eq!(mean, ["1.000", "0.500"]);
        assert_eq!((behind(&page, "fitted", 6).len(), behind(&page, "fixed", 1).len()), (6, 0));
    }
}
