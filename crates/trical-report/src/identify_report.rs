//! The report of an identification, for the person who signs it off.

use trical_diagnose::verdict::capital;
use trical_ident::{BY_BLOCK, Calibration, ErrorSummary, FORWARD};

use crate::error::Result;
use crate::evidence::{self, Errors, half_width, joints_used, row, signing};
use crate::page::{self, Made, Section, error_table};
use crate::table::{self, counted};

/// Two parameters are told to move together from here.
const CORRELATED: f64 = 0.9;

/// An error at poses not used that is larger by this is worth a word.
const LARGER: f64 = 1.5;

/// How rows of poses that the fit did not see begin.
const UNSEEN: &str = "poses that the fit did not see, ";

/// Errors at poses that the fit did not see, each as reports name it, by how poses were left out.
pub fn unseen(t: &Calibration) -> Vec<(&'static str, String, ErrorSummary)> {
    let named = |how| match (how, t.cross_validation, t.forward_in_time) {
        (BY_BLOCK, Some((folds, _)), _) => format!("{UNSEEN}{how}, {folds} folds"),
        (FORWARD, _, Some((percent, _))) => format!("last {percent} % of the poses, by a fit to those before"),
        _ => format!("{UNSEEN}{how}"),
    };
    t.unseen().named().into_iter().map(|(how, e)| (how, named(how), e)).collect()
}

/// A sentence with a beginning; a parameter keeps its name.
fn begun(text: &str) -> String {
    if text.split(' ').next().is_some_and(|word| word.contains('_')) { text.to_owned() } else { capital(text) }
}

/// What speaks against signing, in one sentence each.
fn concerns(t: &Calibration) -> Result<Vec<String>> {
    let f = &t.fitted;
    let mut out = Vec::new();
    if t.errors.mean_mm >= t.before.mean_mm {
        out.push("The model is no better than the nominal arm: do not use it.".into());
    }
    out.extend(t.cautions().into_iter().map(|c| begun(&table::ended(&c))));
    let unseen = unseen(t);
    for (_, name, e) in &unseen {
        if e.mean_mm > LARGER * t.errors.mean_mm {
            out.push(format!(
                "The error at poses that the fit did not see ({name}) is {:.1} times that of the fit: the model has too many parameters for these measurements.",
                e.mean_mm / t.errors.mean_mm
            ));
        }
    }
    if unseen.is_empty() {
        out.push(
            "Nothing was scored at poses that the fit did not see: --cross-validate 5 does, and `trical validate` on another \
             recording does better."
                .into(),
        );
    }
    out.extend(evidence::beyond_noise(&f.model, &f.data)?);
    out.extend(evidence::long_tail(&t.errors, &f.data));
    if t.rejected > 0 {
        out.push(format!(
            "Rejected: {} of {}; each is named below with its reason.",
            t.rejected,
            counted(t.rejected + t.observations, "row")
        ));
    }
    if !t.cleaned {
        out.push("Gross errors were kept (--keep-outliers).".into());
    }
    let stopped = f.stopped();
    if !stopped.is_empty() {
        out.push(format!("Held at a limit of --known, beyond which the data would go: {}.", stopped.join(", ")));
    }
    Ok(out)
}

fn verdict(t: &Calibration, concerns: usize) -> String {
    let mut out = format!(
        "{} parameters lower the mean position error at {} measurements from {:.3} mm (largest {:.3}) to {:.3} mm (largest {:.3}).",
        t.fitted.free.len(),
        t.observations,
        t.before.mean_mm,
        t.before.max_mm,
        t.errors.mean_mm,
        t.errors.max_mm
    );
    if let Some((_, how, e)) = unseen(t).into_iter().max_by(|a, b| a.2.mean_mm.total_cmp(&b.2.mean_mm)) {
        let (how, largest) = (how.trim_start_matches(UNSEEN), t.unseen().largest_mm());
        out += &format!(
            " At poses that the fit did not see ({how}) it is {:.3} mm (largest, however poses are left out, {largest:.3}).",
            e.mean_mm
        );
    }
    out + &signing(concerns)
}

fn parameters(t: &Calibration) -> Section {
    let f = &t.fitted;
    let spare = f.observability.rows.saturating_sub(f.free.len());
    let sds = half_width((spare > 0).then_some(spare));
    let pairs = f.correlated(CORRELATED);
    let stopped = f.stopped();
    let remark = |name: &str| if stopped.contains(&name) { "at its limit".to_owned() } else { String::new() };
    let mut tables = vec![evidence::parameters(&f.model, f.free.iter().map(|k| &f.model.terms[*k]), sds, remark)];
    let mut text = vec![format!(
        "The 95 % interval of each ({sds:.2} standard deviations to each side) holds if the model is complete. The \
         condition number of the scaled Jacobian is {:.0}.",
        f.observability.condition
    )];
    text.extend(evidence::legend(f.free.iter().map(|k| &f.model.terms[*k])));
    let dropped = f.left_out();
    if !dropped.is_empty() {
        text.push(format!("Not identified, because other parameters have the same effect: {}.", dropped.join("; ")));
    }
    if !pairs.is_empty() {
        text.push(
            "The data hardly separates the pairs in the second table: each alone is uncertain, but their joint effect is known \
             where it was measured."
                .into(),
        );
        let mut rows = vec![row(["parameter", "and", "correlation"])];
        rows.extend(pairs.iter().map(|(a, b, r)| vec![a.clone(), b.clone(), format!("{r:.3}")]));
        tables.push(rows);
    }
    Section::new("Parameters").with_text(text).with_tables(tables)
}

/// The whole report.
pub fn render(t: &Calibration, mut made: Made) -> Result<String> {
    let f = &t.fitted;
    let after = f.errors()?;
    let errors =
        Errors { model: &f.model, data: &f.data, was: "the nominal arm", before: &t.each_before, after: &after };
    let list = concerns(t)?;
    let verdict = verdict(t, list.len());
    let unseen = unseen(t);
    let mut rows = vec![("before: nominal arm", &t.before), ("after: identified", &t.errors)];
    rows.extend(unseen.iter().map(|(_, name, e)| (name.as_str(), e)));
    let mut sections = Vec::new();
    sections
        .push(evidence::to_be_looked_at(list, "errors at poses that the fit did not see, numbers measured for each parameter, where the base came out, limits"));
    let mut one_by_one = errors.section()?;
    if after.len() < t.observations {
        one_by_one.text.push(format!("These are from a sample of {} of {} measurements.", after.len(), t.observations));
    }
    sections.extend([
        Section::new("Position error before and after")
            .with_text(["Before is the arm as its maker describes it, with only the measuring frame or base and \
                 the tool points identified."])
            .with_tables([error_table(&rows)]),
        one_by_one,
    ]);
    sections.extend(errors.pictures()?);
    sections.extend([parameters(t), evidence::rejected(&t.named, t.rejected)]);
    made.notes.push(joints_used(f.data.joints));
    let title = page::title("Identification", &f.model.robot.name, &f.data.names);
    page::render(&title, &verdict, &sections, &made)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use trical_ident::HeldOut;

    use super::*;
    use crate::test_data::{behind, calibration};
    use trical_ident::fit::identifiability::Dependent;

    fn error(mm: f64) -> ErrorSummary {
        ErrorSummary::of(&[mm * 1e-3; 4])
    }

    /// A calibration of which all is well: from 1 to 0.1 mm, and as good at poses that it did not see.
    fn good() -> Calibration {
        let mut t = calibration();
        (t.before, t.errors) = (error(1.0), error(0.1));
        t.held_out = HeldOut { by_block: Some(error(0.12)), forward: Some(error(0.14)), ..HeldOut::default() };
        t
    }

    fn says(t: &Calibration, text: &str) -> bool {
        concerns(t).unwrap().iter().any(|c| c.contains(text))
    }

    #[test]
    fn the_verdict_has_the_largest_error_at_unseen_poses_and_how_they_were_left_out() {
        let mut good = good();
        // a block is off by more than any of the last poses, though blocks are better on average
        good.held_out.by_block = Some(ErrorSummary { max_mm: 0.5, ..error(0.12) });
        let said = verdict(&good, 2);
        let parameters = good.fitted.free.len();
        assert!(said.starts_with(&format!("{parameters} parameters lower the mean position error at 90 ")), "{said}");
        assert!(said.contains("from 1.000 mm (largest 1.000) to 0.100 mm (largest 0.100)."), "{said}");
        assert!(
            said.contains("did not see (forward in time) it is 0.140 mm (largest, however poses are left out, 0.500)."),
            "{said}"
        );
        assert!(said.ends_with(" Check 2 points before signing."), "{said}");
    }

    #[test]
    fn a_model_no_better_than_the_nominal_arm_is_not_to_be_used() {
        let mut t = good();
        assert!(!says(&t, "do not use it"));
        t.before = t.errors;
        assert!(says(&t, "The model is no better than the nominal arm: do not use it."));
    }

    #[test]
    fn an_error_at_unseen_poses_that_is_half_as_large_again_says_that_there_are_too_many_parameters() {
        let mut t = good();
        assert!(!says(&t, "too many parameters for these measurements"));
        t.held_out.by_block = Some(error(0.16));
        assert!(says(&t, "by block of poses) is 1.6 times that of the fit: the model has too many parameters"));
        assert!(!says(&t, "Nothing was scored"));
        t.held_out = HeldOut::default();
        assert!(says(&t, "Nothing was scored at poses that the fit did not see"));
    }

    #[test]
    fn folds_that_were_asked_for_stand_in_the_place_of_the_usual_ones() {
        let told = |t: &Calibration| {
            unseen(t).into_iter().map(|(_, how, e)| (how, format!("{:.2}", e.mean_mm))).collect::<Vec<_>>()
        };
        let mut t = good();
        let [block, forward] = [BY_BLOCK, FORWARD].map(|how| format!("{UNSEEN}{how}"));
        assert_eq!(told(&t), [(block.clone(), "0.12".into()), (forward.clone(), "0.14".into())]);
        t.cross_validation = Some((5, error(0.2)));
        assert_eq!(told(&t), [(format!("{block}, 5 folds"), "0.20".into()), (forward, "0.14".into())]);
        (t.cross_validation, t.forward_in_time) = (None, Some((30, error(0.3))));
        assert_eq!(
            told(&t),
            [(block, "0.12".into()), ("last 30 % of the poses, by a fit to those before".into(), "0.30".into())]
        );
    }

    #[test]
    fn rejected_rows_are_counted_among_all_and_gross_errors_that_were_kept_are_told() {
        let mut t = good();
        assert!(!says(&t, "Rejected") && !says(&t, "Gross errors were kept"));
        (t.rejected, t.cleaned) = (3, false);
        assert!(says(&t, "Rejected: 3 of 93 rows;") && says(&t, "Gross errors were kept"));
    }

    #[test]
    fn a_parameter_that_a_limit_stopped_is_marked_and_correlated_pairs_stand_in_a_table() {
        let mut t = good();
        let p = t.fitted.free.len();
        let name = |t: &Calibration, k: usize| t.fitted.model.terms[t.fitted.free[k]].name.clone();
        t.fitted.at_limit = vec![t.fitted.free[1]];
        // the first two move against each other, no others do
        t.fitted.covariance = vec![0.0; p * p];
        (0..p).for_each(|k| t.fitted.covariance[k * p + k] = 4.0);
        (t.fitted.covariance[1], t.fitted.covariance[p]) = (-3.8, -3.8);
        let section = parameters(&t);
        let marked: Vec<&str> =
            section.tables[0].iter().filter(|r| r[6].contains("at its limit")).map(|r| r[0].as_str()).collect();
        assert_eq!(marked, [name(&t, 1)]);
        assert_eq!(section.tables[1][1..], [[name(&t, 0), name(&t, 1), "-0.950".into()]]);
        assert!(says(&t, &format!("beyond which the data would go: {}.", name(&t, 1))));
    }

    #[test]
    fn the_page_has_the_nominal_arm_before_what_was_not_identified_and_whether_it_is_of_a_sample() {
        let page = |t: &Calibration| render(t, Made::by("x".into(), &[])).unwrap().replace('\u{a0}', " ");
        let mut t = good();
        t.fitted.dependent.clear();
        let plain = page(&t);
        let mean = |of: &str| behind(&plain, of, 1)[0];
        assert_eq!([mean("before: nominal arm"), mean("after: identified")], ["1.000", "0.100"]);
        assert_eq!(mean(&format!("{UNSEEN}{BY_BLOCK}")), "0.120");
        let sample = "These are from a sample of 90 of 1000 measurements.";
        assert!(!plain.contains("These are from a sample") && !plain.contains("Not identified"));
        t.observations = 1000;
        t.fitted.dependent = vec![Dependent { name: "d_2".into(), with: vec!["d_3".into()], held: false }];
        let told = "Not identified, because other parameters have the same effect: d_2 (moves together with d_3).";
        assert!(page(&t).contains(sample) && page(&t).contains(told));
    }

    #[test]
    fn a_sentence_begins_with_a_capital_and_a_parameter_keeps_its_name() {
        assert_eq!([begun("the scale is held"), begun("d_2 is held")], ["The scale is held", "d_2 is held"]);
    }
}
