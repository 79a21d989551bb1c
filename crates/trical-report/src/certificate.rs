//! One page to print and sign: what an arm did before and after calibration, by the formulas of ISO 9283.

use minijinja::context;
use sha2::{Digest, Sha256};
use trical_ident::repeatability::iso9283::{LIMITS_MM, OverPoses, Performance, performance, visited};
use trical_ident::{Calibration, Dataset, JointSource, ModelFile, Observation, Validation};
use trical_model::Model;

use crate::error::{Error, Result};
use crate::evidence::{in_socket, row, where_measured};
use crate::figures::plots::span;
use crate::page::{self, Made};
use crate::table;
use crate::validate_report::cautions;

/// Where a fit was made its errors are smaller than elsewhere.
const AT_THE_FIT: &str = " at the poses of the fit";

/// To be filled in by hand.
const BY_HAND: &str = "________________________";

/// A model at some data: what a column of the certificate is made of.
struct Column<'a> {
    model: &'a Model,
    data: &'a Dataset,
    /// Position errors, m, in the order of the data.
    errors: &'a [f64],
}

/// Of a validation: errors of a model file on recordings, of those that it was not fitted to where there are any.
///
/// # Errors
/// A model that cannot be evaluated.
pub fn of_validation(v: &Validation, made: &Made) -> Result<String> {
    let others = v.sessions.iter().any(|s| s.learnt.is_none());
    let counts = |recording: usize| !others || v.sessions.get(recording).is_none_or(|s| s.learnt.is_none());
    let some = v.errors.iter().zip(&v.data.observations).filter(|(_, o)| counts(o.recording)).map(|(e, _)| *e);
    let (before, after): (Vec<f64>, Vec<f64>) = some.unzip();
    let [nominal, data] = [&v.nominal.1, &v.data].map(|data| data.filtered(|o| counts(o.recording)));
    let names = v.sessions.iter().enumerate().filter(|(k, _)| counts(*k)).map(|(_, s)| s.recording.as_str());
    let names: Vec<&str> = names.collect();
    render(
        &Column { model: &v.nominal.0, data: &nominal, errors: &before },
        &Column { model: &v.model, data: &data, errors: &after },
        (&names, v.rejected.iter().filter(|r| names.contains(&r.recording.as_str())).count()),
        None,
        (if others { "" } else { AT_THE_FIT }.into(), notes_of(v)),
        made,
    )
}

/// What the reader has to know of a validation: what the model was fitted to, what was identified anew, what it extrapolates.
fn notes_of(v: &Validation) -> Vec<String> {
    let mut notes = cautions(v);
    let learnt: Vec<&str> = v.sessions.iter().filter(|s| s.learnt.is_some()).map(|s| s.recording.as_str()).collect();
    if learnt.is_empty() {
        notes.push("The model was not fitted to these recordings.".into());
    } else if learnt.len() < v.sessions.len() {
        notes.push(format!("The numbers above are without {}, which the model was fitted to.", learnt.join(", ")));
    }
    notes.extend(v.sessions.iter().filter(|s| !s.refitted.is_empty()).map(|s| format!("{}.", s.in_words())));
    notes.extend(v.beyond_in_words());
    notes
}

/// Of a calibration: errors at the poses of the fit, and what is known of others.
///
/// # Errors
/// A model that cannot be evaluated.
pub fn of_calibration(c: &Calibration, made: &Made) -> Result<String> {
    let after = c.fitted.errors()?;
    let mut at = AT_THE_FIT.to_owned();
    let mut notes: Vec<String> = c.cautions().iter().map(|c| format!("Caution: {}", table::ended(c))).collect();
    let unseen = c.unseen();
    notes.push(match unseen.worst() {
        Some((how, e)) => {
            at += &format!(", and of {:.3} mm at poses that the fit did not see", e.mean_mm);
            format!(
                "The numbers above are at the poses of the fit. At poses that the fit did not see ({how}) the error is {:.3} mm on average; \
                 the largest at any such pose, however poses were left out, is {:.3} mm. `trical validate` certifies the model on another recording.",
                e.mean_mm,
                unseen.largest_mm()
            )
        }
        None => "These are the poses of the fit: the numbers say nothing about other poses.".to_owned(),
    });
    if c.passes.is_some() {
        notes.push(format!("These numbers are from a sample of {1} of {0} measurements.", c.observations, after.len()));
    }
    render(
        &Column { model: &c.nominal, data: &c.fitted.data, errors: &c.each_before },
        &Column { model: &c.fitted.model, data: &c.fitted.data, errors: &after },
        (&c.fitted.data.names.iter().map(String::as_str).collect::<Vec<_>>(), c.rejected),
        Some(&ModelFile::of_fit(&c.fitted)),
        (at, notes),
        made,
    )
}

fn instrument(data: &Dataset) -> String {
    let named =
        |o: &Observation| if in_socket(o) { "a ball in sockets, guided by hand" } else { o.measured.instrument() };
    let mut kinds: Vec<&str> = data.observations.iter().map(named).collect();
    kinds.sort_unstable();
    kinds.dedup();
    kinds.join(", ")
}

/// Which joint angles the numbers are about.
fn how_joints(data: &Dataset) -> &'static str {
    match data.joints {
        JointSource::Read => "as read by the controller",
        JointSource::Commanded => "as commanded",
    }
}

fn temperature(data: &Dataset) -> String {
    let (low, high) = span(data.observations.iter().filter_map(|o| o.state.temp_c));
    if low.is_finite() { format!("{low:.1} to {high:.1} degC") } else { BY_HAND.to_owned() }
}

fn numbers(before: &Column<'_>, after: &Column<'_>) -> Result<(Vec<Vec<String>>, Performance)> {
    let columns = [before, after];
    let told: Vec<Performance> =
        columns.iter().map(|c| Ok(performance(&visited(c.model, c.data)?))).collect::<Result<_>>()?;
    let mut rows = vec![row(["", "before: nominal arm", "after: calibrated"])];
    let mut add = |name: &str, of: &dyn Fn(usize) -> Option<String>| {
        if let (Some(b), Some(a)) = (of(0), of(1)) {
            rows.push(vec![name.to_owned(), b, a]);
        }
    };
    let pair = |o: Option<OverPoses>| o.map(|o| format!("{:.3} / {:.3}", o.mean_mm, o.max_mm));
    add("Pose accuracy AP, mean / largest", &|k| pair(told[k].accuracy));
    let often = told[1].repeatability.map_or(0, |rp| rp.n);
    add(&format!("Pose repeatability RP of {often} pose{}, mean / largest", if often == 1 { "" } else { "s" }), &|k| {
        pair(told[k].repeatability)
    });
    let pairs = told[1].distance_accuracy.map_or(0, |ad| ad.n);
    add(&format!("Distance accuracy AD of {pairs} pair{}, mean / largest", if pairs == 1 { "" } else { "s" }), &|k| {
        pair(told[k].distance_accuracy)
    });
    for limit in LIMITS_MM {
        add(&format!("Measurements within {limit} mm"), &|k| {
            let errors = columns[k].errors;
            let within = errors.iter().filter(|e| **e * 1e3 <= limit).count();
            let share = 100.0 * within as f64 / errors.len().max(1) as f64;
            // all is said of all only
            let share = if within < errors.len() { share.min(99.9) } else { share };
            Some(format!("{share:.1} %"))
        });
    }
    add("Worst measurement", &|k| {
        let c = columns[k];
        let (worst, error) = c.errors.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
        Some(format!("{:.3} ({})", error * 1e3, where_measured(c.data, worst)))
    });
    let last = told.into_iter().next_back().ok_or_else(|| Error::Failed("nothing was scored".into()))?;
    Ok((rows, last))
}

fn render(
    before: &Column<'_>,
    after: &Column<'_>,
    (recordings, rejected): (&[&str], usize),
    file: Option<&ModelFile>,
    (at, mut notes): (String, Vec<String>),
    made: &Made,
) -> Result<String> {
    let [was, is] = [before, after].map(|c| trical_ident::ErrorSummary::of(c.errors).mean_mm);
    let (numbers, told) = numbers(before, after)?;
    let [fewest, most] = told.visits;
    let visits = match (fewest, most) {
        (1, 1) => "once".to_owned(),
        (few, most) if few == most => format!("{few} times"),
        (few, most) => format!("{few} to {most} times"),
    };
    notes.push(format!(
        "AP, RP and AD by the formulas of ISO 9283: AP is the distance between the commanded position (here where the model puts the tool at the joint angles {}) \
         and the mean of the attained positions, RP the mean distance from that mean plus three standard deviations, AD the difference between attained and commanded \
         distances of poses that follow each other, without its sign. The standard asks for five poses of 30 visits; here {} {} visited {visits} each{}.",
        how_joints(after.data),
        told.poses,
        if told.poses == after.data.used_poses().len() { "poses were" } else { "places (each point of the tool at each pose is one) were" },
        if told.repeatability.is_none() { ", so that RP is not known and AP contains it" } else { "" }
    ));
    notes.push(
        "The nominal arm has its base (or the measuring frame) and its tool identified on the same measurements. All numbers include \
         the error of the instrument."
            .into(),
    );
    let robot = &after.model.robot;
    let fields: Vec<(&str, String)> = vec![
        ("Arm", robot.name.clone()),
        ("Serial number", BY_HAND.into()),
        ("Measured with", instrument(after.data)),
        ("Number of the instrument", BY_HAND.into()),
        ("Date of measurement", BY_HAND.into()),
        ("Temperature", temperature(after.data)),
        ("Joint angles", how_joints(after.data).into()),
        ("Recordings", recordings.join(", ")),
        (
            "Measurements",
            format!("{} at {} poses; {rejected} rejected", after.errors.len(), after.data.used_poses().len()),
        ),
    ];
    let mut inputs = Vec::new();
    // of a model that was read, the file's own hash is among the inputs
    if let Some(file) = file {
        let hash: String = Sha256::digest(file.to_toml()?.as_bytes()).iter().map(|b| format!("{b:02x}")).collect();
        inputs.push(("The model".to_owned(), hash));
    }
    inputs.extend(made.hashes().map(|(name, hash)| (name.to_owned(), hash.to_owned())));
    let model = if is < was {
        "The calibrated model of this arm has"
    } else {
        "Do not use this model here: it is no better than the nominal arm. It has"
    };
    let summary = format!("{model} a mean position error of {is:.3} mm{at}; the nominal arm has {was:.3} mm.");
    let values = context! {
        title => format!("Calibration certificate: {}", robot.name),
        summary, fields, numbers, notes, inputs,
        version => env!("CARGO_PKG_VERSION"),
        command => made.command(),
    };
    page::from_template("certificate", include_str!("../assets/certificate.html"), values)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::test_data::{arm, calibration, data, pose, validation};
    use trical_ident::{ErrorSummary, HeldOut};
    use trical_model::{Measured, State};

    #[test]
    fn shares_within_a_limit_and_the_worst_measurement_are_those_of_each_column() {
        let (model, touch) = (arm(), Measured::Touch { ball: 0, reading: [0.0; 3] });
        let warm = |k: u8| (State { temp_c: Some(20.0 + f64::from(k)), ..pose(k) }, touch);
        let data = data(&[(0..4).map(warm).collect()]);
        let column = |errors| Column { model: &model, data: &data, errors };
        let (before, after) = ([2e-3, 0.4e-3, 0.15e-3, 1e-3], [0.05e-3, 0.15e-3, 0.3e-3, 0.1e-3]);
        let (rows, _) = numbers(&column(&before), &column(&after)).unwrap();
        let of =
            |name: &str| rows.iter().find(|r| r[0].starts_with(name)).map(|r| [r[1].clone(), r[2].clone()]).unwrap();
        assert_eq!(of("Measurements within 0.1 mm"), ["0.0 %", "50.0 %"]);
        assert_eq!(of("Measurements within 0.2 mm"), ["25.0 %", "75.0 %"]);
        assert_eq!(of("Measurements within 1 mm"), ["75.0 %", "100.0 %"]);
        assert_eq!(of("Worst measurement"), ["2.000 (line 2, ball 1)", "0.300 (line 4, ball 1)"]);
        assert_eq!(temperature(&data), "20.0 to 23.0 degC");
        assert_eq!(instrument(&data), "indicators touching precision balls");
        let mut sockets = data.clone();
        sockets.observations.iter_mut().for_each(|o| o.state.place = Some(0));
        assert_eq!(instrument(&sockets), "a ball in sockets, guided by hand");
    }

    #[test]
    fn all_is_said_of_all_only_however_many_they_are() {
        let (model, touch) = (arm(), Measured::Touch { ball: 0, reading: [0.0; 3] });
        let data = data(&[(0..3000_u16).map(|k| (pose((k % 4) as u8), touch)).collect()]);
        let column = |errors| Column { model: &model, data: &data, errors };
        let (all, mut but_one) = (vec![0.05e-3; 3000], vec![0.05e-3; 3000]);
        but_one[7] = 0.3e-3;
        let (rows, _) = numbers(&column(&all), &column(&but_one)).unwrap();
        let within = |limit: &str| rows.iter().find(|r| r[0] == format!("Measurements within {limit} mm")).unwrap();
        assert_eq!(within("0.2")[1..], ["100.0 %", "99.9 %"]);
        assert_eq!(within("0.5")[1..], ["100.0 %", "100.0 %"]);
    }

    #[test]
    fn points_of_a_pose_are_not_counted_as_poses() {
        let mut model = arm();
        model.cell.tool.targets = [0.0, 0.05, 0.1].map(|x| nalgebra::Vector3::new(x, 0.0, 0.1)).to_vec();
        let points =
            |k: u8| [0, 1, 2].map(|target| (pose(k), Measured::Point { target, position: [0.1, 0.2, f64::from(k)] }));
        let data = data(&[(0..4).flat_map(points).collect()]);
        let column = || Column { model: &model, data: &data, errors: &[1e-3; 12] };
        let page =
            render(&column(), &column(), (&[], 0), None, Default::default(), &Made::by("x".into(), &[])).unwrap();
        assert!(page.contains("12 at 4 poses"), "{page}");
        assert!(
            page.contains("here 12 places (each point of the tool at each pose is one) were visited once each"),
            "{page}"
        );
        let touches = data_of_touches();
        let column = || Column { model: &model, data: &touches, errors: &[1e-3; 4] };
        let page =
            render(&column(), &column(), (&[], 0), None, Default::default(), &Made::by("x".into(), &[])).unwrap();
        assert!(page.contains("here 4 poses were visited once each"), "{page}");
    }

    fn data_of_touches() -> Dataset {
        data(&[(0..4).map(|k| (pose(k), Measured::Touch { ball: 0, reading: [0.0; 3] })).collect()])
    }

    #[test]
    fn of_a_validation_it_is_told_what_was_identified_anew_and_what_the_model_extrapolates() {
        let mut v = validation(1.0, 0.5);
        assert_eq!(notes_of(&v), ["The model was not fitted to these recordings."]);
        v.beyond = Some(2);
        (v.sessions[0].refitted, v.sessions[0].from_poses) = (vec!["frame", "targets"], 50);
        let notes = notes_of(&v);
        assert_eq!(notes[1], "r0.csv: frame and targets identified from 50 of its poses, the other 4 scored.");
        assert!(notes.len() == 3 && notes[2].starts_with("2 of 4 measurements are "), "{notes:?}");
        // what is worse than nothing is not to be used
        assert!(notes_of(&validation(1.0, 1.5))[0].contains("do not use it here"));
    }

    #[test]
    fn the_first_sentence_says_where_a_model_is_no_better_and_where_it_was_fitted() {
        let first = |v: &Validation| {
            let page = of_validation(v, &Made::by("x".into(), &[])).unwrap().replace('\u{a0}', " ");
            page.split("</h1>")
                .nth(1)
                .unwrap()
                .split("</p>")
                .next()
                .unwrap()
                .trim()
                .trim_start_matches("<p>")
                .to_owned()
        };
        let mut v = validation(1.0, 1.5);
        let no_better = "Do not use this model here: it is no better than the nominal arm. It has a mean position error of 1.500 mm; the nominal";
        assert!(first(&v).starts_with(no_better), "{}", first(&v));
        v = validation(1.0, 0.5);
        v.sessions[0].learnt = Some(1);
        let fitted = "a mean position error of 0.500 mm at the poses of the fit; the nominal arm has 1.000 mm.";
        assert!(first(&v).ends_with(fitted), "{}", first(&v));
    }

    #[test]
    fn beside_other_recordings_those_of_the_fit_are_not_certified() {
        let mut v = validation(1.0, 0.5);
        let touch = Measured::Touch { ball: 0, reading: [0.0; 3] };
        let two = data(&[(0..4).map(|k| (pose(k), touch)).collect(), (4..8).map(|k| (pose(k), touch)).collect()]);
        v.errors.extend([(2e-3, 1e-3); 4]);
        (v.data, v.nominal.1) = (two.clone(), two);
        let other = trical_ident::SessionErrors { recording: "r1.csv".into(), ..v.sessions[0].clone() };
        v.sessions.push(other);
        v.sessions[0].learnt = Some(1);
        let page = of_validation(&v, &Made::by("x".into(), &[])).unwrap().replace('\u{a0}', " ");
        assert!(page.contains("a mean position error of 1.000 mm; the nominal arm has 2.000 mm"), "{page}");
        assert!(
            page.contains("without r0.csv, which the model was fitted to") && page.contains("4 at 4 poses"),
            "{page}"
        );
    }

    #[test]
    fn the_last_poses_that_were_asked_for_stand_in_the_place_of_the_usual_ones() {
        let mut c = calibration();
        let error = |mm: f64| ErrorSummary::of(&[mm * 1e-3; 4]);
        let says = |c: &Calibration, text: &str| {
            let page = of_calibration(c, &Made::by("x".into(), &[])).unwrap();
            page.replace('\u{a0}', " ").contains(text)
        };
        c.held_out = HeldOut { forward: Some(error(0.5)), by_pose: Some(error(0.3)), ..HeldOut::default() };
        assert!(says(&c, "did not see (forward in time) the error is 0.500 mm on average"));
        c.forward_in_time = Some((20, error(0.4)));
        assert!(says(
            &c,
            "did not see (forward in time) the error is 0.400 mm on average; the largest at any such pose, however poses were left out, is 0.400 mm"
        ));
    }

    #[test]
    fn what_nobody_measured_is_left_to_be_filled_in() {
        let length = Measured::Distance { anchor: 0, length: 1.0 };
        let data = data(&[vec![(pose(0), length), (pose(1), length)]]);
        assert_eq!((temperature(&data).as_str(), instrument(&data).as_str()), (BY_HAND, "lengths from fixed anchors"));
    }
}
