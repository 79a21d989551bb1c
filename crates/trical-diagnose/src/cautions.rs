//! What of a diagnosis, its fit and its data should make one look twice.

use std::collections::BTreeSet;

use trical_ident::dataset::readings::Scatter;
use trical_ident::date::newest;
use trical_ident::error::Result;
use trical_ident::fit::cautions::{EVEN_MASSES, cautions, listed, shared_errors, too_many, without_masses};
use trical_ident::fit::choice::Choice;
use trical_ident::fit::folds::Folds;
use trical_ident::fit::identify::ErrorSummary;
use trical_model::{Model, Robot};

use crate::candidate::Candidate;
use crate::rounds::{BASELINE, Rounds, arm_parameters};
use crate::settings::BEYOND_READINGS;

/// What the fit and its data say by themselves; `effective` is how many parameters the data determine, `folds` are all data's, and
/// `unsearched` is what was not searched, in words.
pub(crate) fn of(
    rounds: &Rounds,
    robot: &Robot,
    baseline: &Model,
    effective: f64,
    folds: &Folds,
    unsearched: Option<String>,
) -> Result<Vec<String>> {
    let Rounds { kept, fitted, .. } = rounds;
    let elasticity = Choice::from(BASELINE).elasticity(robot, kept)?;
    let even = baseline.robot != *robot;
    let masses = if even { Some(EVEN_MASSES.into()) } else { without_masses(elasticity, baseline) };
    Ok(cautions(&fitted.model, fitted.observability.rows, fitted.free.len())
        .into_iter()
        .chain(masses)
        .chain(rounds.read_otherwise.clone())
        .chain(rounds.hardly_determined.iter().cloned())
        .chain(unsearched)
        .chain(too_many(effective, arm_parameters(&fitted.model), folds))
        .chain(shared_errors(fitted.design_effect))
        .chain(rounds.correlation.caution())
        .chain(rounds.readings.map(|r| read_several_times(r, rounds.touch_sigma())))
        .collect())
}

/// What to say where a joint has another zero in some sessions than in the others: which of them the model has, by the dates in their names.
pub(crate) fn another_zero(grounds: &[(Vec<Candidate>, Vec<Candidate>)], names: &[String]) -> Option<String> {
    let of_session = |(members, _): &(Vec<Candidate>, Vec<Candidate>)| {
        members
            .iter()
            .find(|c| c.is_of_whole_session())
            .and_then(|c| Some((c.site.joint()?, c.terms[0].basis.session? as usize - 1)))
    };
    let (joint, first) = grounds.iter().find_map(of_session)?;
    let all = grounds.iter().filter_map(of_session).filter(|(of, _)| *of == joint).map(|(_, session)| session);
    let all: BTreeSet<usize> = all.collect();
    match newest(names.iter().map(String::as_str)) {
        Some(newest) if all.contains(&newest) => {
            return Some(format!(
                "joint {joint} has another zero in {}, the newest session, than before: the model has the arm as it is now, and programs are \
                 corrected for that",
                names[newest]
            ));
        }
        Some(_) => return None,
        None => {}
    }
    let dates =
        "by dates in the names of the recordings (as in cell-2026-11-22.csv): the model then has the arm as it is now";
    if let [one, other] = names {
        return Some(format!(
            "joint {joint} has another zero in {one} than in {other}, and two sessions cannot show which of them differs: the model has the middle of \
             both, and may be off by half of that. Say which is the newest {dates}"
        ));
    }
    let odd = listed(&all.iter().map(|k| names[*k].clone()).collect::<Vec<_>>(), "and");
    let others = if names.len() == all.len() + 1 { "other" } else { "others" };
    let now = &names[first];
    Some(format!(
        "joint {joint} has another zero in {odd} than in the {others}; the model has that of the {others}. Where {now} is the newest, say so {dates}"
    ))
}

/// What readings of one pose that were taken one after the other say beside what is left (m, standard deviation of their means).
fn read_several_times(of_pose: Scatter, left: f64) -> String {
    let Scatter { sd, readings, freedom } = of_pose;
    let times = (10.0 * readings).round() / 10.0;
    let counted = format!("poses were read {times} times in a row: the mean of each counts as one measurement");
    let of_means = sd / readings.sqrt();
    // at most as often as not by chance, or too little to matter
    let chance = 1.0 + 4.0 / (freedom as f64).sqrt();
    if left < of_means * chance.max(BEYOND_READINGS) {
        return counted;
    }
    format!(
        "{counted}. Readings of one pose differ by {:.3} mm, and what is left of their means is {:.3} mm (standard deviations): that is not the \
         gauge. It is how the arm repeats, or something that no known effect is",
        sd * 1e3,
        left * 1e3
    )
}

/// What to say where the whole model is no better than the plain one `at` something that neither was fitted to, or where that could not be told.
pub(crate) fn elsewhere(at: &str, of: &Result<[Option<ErrorSummary>; 2]>) -> Option<String> {
    let [plain, whole] = match of {
        Ok([plain, whole]) => [plain.as_ref()?.mean_mm, whole.as_ref()?.mean_mm],
        Err(e) => return Some(format!("the error {at} that the fit did not see could not be computed: {e}")),
    };
    (whole > plain).then(|| {
        format!(
            "{at} that it was not fitted to, the whole model is off by {whole:.3} mm (mean), the plain one by {plain:.3} mm: \
             use the plain one there, or diagnose a session that visits the same angles with these"
        )
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use trical_ident::error::IdentError;
    use trical_model::{Basis, Shape};

    use super::*;
    use crate::effect_id::EffectId;
    use crate::test_data::off;

    #[test]
    fn a_model_that_is_no_better_in_another_session_is_told_with_both_errors() {
        let of = |mm: f64| Some(ErrorSummary::of(&[mm * 1e-3; 4]));
        let told = |plain, whole| elsewhere("in a session", &Ok([plain, whole]));
        assert_eq!([told(of(0.5), of(0.4)), told(of(0.5), of(0.5)), told(None, None)], [None, None, None]);
        let said = told(of(0.4), of(0.5)).unwrap_or_default();
        assert!(
            said.starts_with("in a session that it was not fitted to")
                && said.contains("off by 0.500 mm (mean), the plain one by 0.400 mm"),
            "{said}"
        );
        let unknown = elsewhere("in a session", &Err(IdentError::NotEnough("two rows".into()))).unwrap_or_default();
        assert!(unknown.starts_with("the error in a session") && unknown.ends_with("computed: two rows"), "{unknown}");
    }

    #[test]
    fn another_zero_is_the_models_where_the_newest_session_has_it_and_half_of_it_where_nobody_knows_which_of_two() {
        let of_session = |session| {
            let mut c = off(EffectId::JointZeroShift.into(), 3, Shape::Linear);
            c.terms[0].basis = Basis::CONSTANT.in_session(session);
            (vec![c], Vec::new())
        };
        let told = |sessions: &[u32], names: &[&str]| {
            let grounds: Vec<_> = sessions.iter().map(|s| of_session(*s)).collect();
            another_zero(&grounds, &names.iter().map(ToString::to_string).collect::<Vec<_>>())
        };
        let dated = ["a-2026-03-01.csv", "b-2026-03-05.csv", "c-2026-03-03.csv"];
        assert!(
            told(&[2], &dated).unwrap().starts_with("joint 3 has another zero in b-2026-03-05.csv, the newest session")
        );
        // as it was before, which is not how it is now
        assert_eq!((told(&[3], &dated), told(&[], &["a", "b"])), (None, None));
        assert!(told(&[1], &["a", "b"]).unwrap().contains("in a than in b, and two sessions cannot show which"));
        let of_four = told(&[2, 4], &["a", "b", "c", "d"]).unwrap();
        assert!(of_four.starts_with(
            "joint 3 has another zero in b and d than in the others; the model has that of the others. Where b is"
        ));
        assert!(told(&[2], &["a", "b", "c"]).unwrap().contains("in b than in the others;"));
        assert!(
            told(&[1, 2], &["a", "b", "c"])
                .unwrap()
                .contains("in a and b than in the other; the model has that of the other.")
        );
    }

    #[test]
    fn what_is_left_of_means_of_readings_is_the_gauges_unless_it_is_much_larger_than_they_differ() {
        let told = |left, freedom| read_several_times(Scatter { sd: 2e-5, readings: 4.0, freedom }, left);
        // the means of four differ by 0.01 mm
        assert_eq!(told(1.4e-5, 400), "poses were read 4 times in a row: the mean of each counts as one measurement");
        let said = told(1.6e-5, 400);
        assert!(said.contains("differ by 0.020 mm, and what is left of their means is 0.016 mm"), "{said}");
        // so few may differ by so little by chance
        assert!(!told(2.9e-5, 4).contains("differ") && told(3.1e-5, 4).contains("differ"));
    }
}
