//! An arm over the months: every session against one calibration, the trend of the errors, and when to calibrate again.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};
use trical_model::{Cell, Forward, Recording, Scope};

use crate::compare::{Comparison, compare};
use crate::dataset::JointSource;
use crate::dataset::repeated::refuse_repeated;
use crate::date::{by_date, day_in};
use crate::error::{IdentError, Result};
use crate::fit::residuals::position_errors;
use crate::model_file::ModelFile;
use crate::rigid::mean;
use crate::validate::adapted::adapted;

/// Errors over sessions as a straight line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Trend {
    /// Growth of the mean error, mm a day, or a session where the names of the recordings have no dates.
    pub mm_per_step: f64,
    /// Standard deviation of it.
    pub sd: f64,
    /// How often chance alone would show as much growth, or more.
    pub p_value: f64,
}

/// A recording that the model was learnt on: where the history begins.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Beginning {
    /// The recording.
    pub recording: String,
    /// Measurements in it.
    pub measurements: usize,
    /// Mean position error of the model there, mm: what the fit left.
    pub mean_mm: f64,
    /// Mean temperature, degC, where it was recorded.
    pub temp_c: Option<f64>,
    /// Its day, as in [`History::days`].
    pub day: Option<f64>,
}

/// What a folder of sessions tells.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct History {
    /// Recordings that the model was learnt on; they are not compared with it, nor part of the trend.
    pub learnt: Vec<Beginning>,
    /// Each other session, in the order of the dates in the names of all; in that in which they were given where some
    /// have none.
    pub sessions: Vec<Comparison>,
    /// Days of the sessions since the first recording, by dates such as 2026-11-22 in their names; `null` where some have none.
    pub days: Option<Vec<f64>>,
    /// How errors grow; `null` for fewer than four sessions.
    pub trend: Option<Trend>,
    /// When the next calibration is due, in a sentence.
    pub due: String,
}

/// Every recording against the model of `file`; of those that it was learnt on only the error is told. `need_mm` is the mean error that
/// the work bears.
///
/// # Errors
/// As [`compare`], and no recording beside those that the model was learnt on.
pub fn history(
    cell: &Cell,
    file: &ModelFile,
    recordings: &[Recording],
    joints: Option<JointSource>,
    need_mm: Option<f64>,
) -> Result<History> {
    let prints = refuse_repeated(recordings)?;
    let order = by_date(recordings.iter().map(|r| r.name.as_str())).unwrap_or_else(|| (0..recordings.len()).collect());
    let (later, own): (Vec<usize>, Vec<usize>) =
        order.into_iter().partition(|k| file.session_of(&prints[*k]).is_none());
    let sessions =
        later.into_iter().map(|k| compare(cell, file, &recordings[k], joints)).collect::<Result<Vec<_>>>()?;
    let mut learnt =
        own.into_iter().map(|k| beginning(cell, file, &recordings[k], joints)).collect::<Result<Vec<_>>>()?;
    if sessions.is_empty() {
        return Err(IdentError::NotEnough("no session beside those that the model was fitted to".into()));
    }
    let days: Option<Vec<f64>> = sessions.iter().map(|s| day_in(&s.recording)).collect();
    let of_learnt = learnt.iter().filter_map(|b| b.day);
    let first = of_learnt.chain(days.iter().flatten().copied()).fold(f64::INFINITY, f64::min);
    let days = days.map(|d| d.iter().map(|x| x - first).collect::<Vec<_>>());
    learnt.iter_mut().for_each(|b| b.day = b.day.filter(|_| days.is_some()).map(|day| day - first));
    let steps = days.clone().unwrap_or_else(|| (0..sessions.len()).map(|k| k as f64).collect());
    let errors: Vec<f64> = sessions.iter().map(|s| s.mean_mm).collect();
    let trend = trend(&steps, &errors);
    let due = due(&sessions, &steps, trend, need_mm, if days.is_some() { "days" } else { "sessions" });
    Ok(History { learnt, sessions, days, trend, due })
}

/// A recording that the model was learnt on, its day as its name has it.
fn beginning(cell: &Cell, file: &ModelFile, recording: &Recording, joints: Option<JointSource>) -> Result<Beginning> {
    let adapted = adapted(file, cell, std::slice::from_ref(recording), joints, None, None)?;
    let errors = position_errors(&Forward::new(adapted.identified()?, Vec::new())?, &adapted.data);
    Ok(Beginning {
        recording: recording.name.clone(),
        measurements: errors.len(),
        mean_mm: mean(&errors) * 1e3,
        temp_c: adapted.data.mean_temp_c(),
        day: day_in(&recording.name),
    })
}

/// Least squares line, with how surely it rises; `None` for fewer than four points or all at one time.
fn trend(x: &[f64], y: &[f64]) -> Option<Trend> {
    let n = x.len() as f64;
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let sxx: f64 = x.iter().map(|x| (x - mx).powi(2)).sum();
    if x.len() < 4 || sxx <= 0.0 {
        return None;
    }
    let slope = x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum::<f64>() / sxx;
    let left: f64 = x.iter().zip(y).map(|(x, y)| (y - my - slope * (x - mx)).powi(2)).sum();
    let sd = (left / (n - 2.0) / sxx).sqrt();
    let p_value = StudentsT::new(0.0, 1.0, n - 2.0).map_or(1.0, |d| d.sf(slope / sd.max(1e-300)));
    Some(Trend { mm_per_step: slope, sd, p_value })
}

fn due(sessions: &[Comparison], steps: &[f64], trend: Option<Trend>, need: Option<f64>, unit: &str) -> String {
    let Some(last) = sessions.last() else { return String::new() };
    // where the last session cannot tell, one before it may
    let telling = sessions.iter().rposition(|s| !["nothing visible", "perhaps arm changed"].contains(&s.verdict));
    let telling = telling.map_or(last, |k| &sessions[k]);
    let which = if telling == last { "the last session" } else { "the last session that tells" };
    let differs = ["arm changed", "does not fit"].contains(&telling.verdict);
    if differs && telling.doubt.is_none() {
        return format!("The next calibration is due now: in {which} ({}) the arm has changed.", telling.recording);
    }
    let of_setup = last.changes.iter().any(|c| c.scope == Scope::Setup && c.is_likely());
    if let Some(need) = need.filter(|need| of_setup && !differs && last.mean_mm > *need && last.arm_mm <= *need) {
        return format!(
            "The arm need not be calibrated again: with the tool or base of the last session ({}) identified again, the mean error is {:.3} mm \
             of the {need} mm that the work allows.",
            last.recording, last.arm_mm
        );
    }
    // too large an error is one, whatever caused it
    if let Some(need) = need.filter(|need| last.mean_mm > *need) {
        return format!(
            "The next calibration is due now: the mean error is {:.3} mm, more than the {need} mm that the work allows.",
            last.mean_mm
        );
    }
    if differs {
        return format!(
            "The arm seems to have changed in {which} ({}), but an effect that the model lacks can look the same (see above): \
             diagnose this recording first.",
            telling.recording
        );
    }
    if last.verdict == "perhaps arm changed" {
        return format!(
            "Whether the next calibration is due is not known: the arm perhaps changed in the last session ({}). More measurements would tell.",
            last.recording
        );
    }
    if last.verdict == "nothing visible" {
        return format!(
            "When the next calibration is due is not known: the poses of the last session ({}) would show no change.",
            last.recording
        );
    }
    let Some(need) = need else {
        return "When the next calibration is due is not known: give the mean error that the work allows.".into();
    };
    if trend.is_none() {
        return format!(
            "The next calibration is not due yet: the mean error is {:.3} mm of the {need} mm that the work allows. Whether it grows cannot be told from fewer than four \
             sessions.",
            last.mean_mm
        );
    }
    match trend.filter(|t| t.p_value < 0.05) {
        None => format!(
            "The next calibration is not due yet: the mean error is {:.3} mm of the {need} mm that the work allows, and does not grow.",
            last.mean_mm
        ),
        Some(t) => {
            let here = steps.last().copied().unwrap_or(0.0);
            let left = (need - last.mean_mm) / t.mm_per_step;
            let soonest = (need - last.mean_mm) / (t.mm_per_step + 2.0 * t.sd);
            // a trend that was seen for so long says nothing of much later
            let seen = here - steps.first().copied().unwrap_or(0.0);
            if soonest > seen {
                return format!(
                    "The next calibration is not due for {seen:.0} {unit} after the last session, as long as was observed: the mean error is {:.3} mm of the \
                     {need} mm that the work allows, and grows by {:.4} mm in that time.",
                    last.mean_mm,
                    t.mm_per_step * seen
                );
            }
            let began = if unit == "days" { format!(" (day {here:.0} since the first)") } else { String::new() };
            format!(
                "The next calibration is due {left:.0} {unit} after the last session{began}, {soonest:.0} {unit} at the earliest: the mean error is {:.3} mm of the {need} mm that the work allows, and grows by {:.4} mm in each of them.",
                last.mean_mm, t.mm_per_step
            )
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn a_line_through_growing_errors_is_found_and_one_through_noise_is_not() {
        let x: Vec<f64> = (0..8).map(f64::from).collect();
        let noise = [0.01, -0.02, 0.015, 0.0, -0.01, 0.02, -0.015, 0.005];
        let grown: Vec<f64> = x.iter().zip(noise).map(|(x, e)| 0.1 + 0.03 * x + e).collect();
        let t = trend(&x, &grown).unwrap();
        assert!((t.mm_per_step - 0.03).abs() < 0.005 && t.p_value < 1e-4, "{t:?}");
        assert!(trend(&x, &noise).unwrap().p_value > 0.05);
        assert_eq!(trend(&x[..3], &grown[..3]), None);
    }

    #[test]
    fn the_next_calibration_is_due_when_the_trend_reaches_what_the_work_allows() {
        let last = |mean_mm: f64, verdict: &'static str| {
            vec![Comparison { recording: "last.csv".into(), verdict, mean_mm, ..Comparison::default() }]
        };
        let grows = |p_value: f64| Some(Trend { mm_per_step: 0.002, sd: 0.0005, p_value });
        let says = |sessions: &[Comparison], trend, need| due(sessions, &[0.0, 60.0], trend, need, "days");
        // 0.1 mm are left, at 0.002 mm a day, or 0.003 at the most
        let found = says(&last(0.2, "unchanged"), grows(0.001), Some(0.3));
        assert!(
            found.starts_with(
                "The next calibration is due 50 days after the last session (day 60 since the first), 33 days at"
            ),
            "{found}"
        );
        // 0.2 mm are left: 100 days, and no trend was seen for so long
        let later = says(&last(0.2, "unchanged"), grows(0.001), Some(0.4));
        assert!(later.contains("not due for 60 days") && later.contains("grows by 0.1200 mm in that time"), "{later}");
        let unchanged = last(0.2, "unchanged");
        assert!(says(&unchanged, grows(0.5), Some(0.3)).contains("and does not grow"));
        assert!(says(&unchanged, None, Some(0.3)).contains("fewer than four sessions"));
        assert!(says(&unchanged, grows(0.001), Some(0.1)).contains("is due now: the mean error is 0.200 mm"));
        assert!(says(&unchanged, grows(0.001), None).contains("is not known"));
        assert!(says(&last(0.2, "arm changed"), None, None).contains("(last.csv) the arm has changed"));
        let mut doubted = last(0.2, "arm changed");
        doubted[0].doubt = Some("But the calibration itself left much.".into());
        assert!(
            says(&doubted, None, None).starts_with("The arm seems to have changed in the last session (last.csv), but")
        );
        assert!(
            says(&doubted, None, Some(0.1)).starts_with("The next calibration is due now: the mean error is 0.200 mm")
        );
        let perhaps = last(0.2, "perhaps arm changed");
        assert!(says(&perhaps, None, Some(0.3)).contains("the arm perhaps changed in the last session (last.csv)"));
        assert!(says(&perhaps, None, Some(0.1)).contains("is due now: the mean error"));
        let blind = last(0.2, "nothing visible");
        assert!(says(&blind, None, Some(0.3)).contains("(last.csv) would show no change"));
        assert!(says(&blind, None, Some(0.1)).contains("is due now"));
        // what the last sessions cannot tell, one before them told
        let since = [last(0.2, "arm changed"), last(0.2, "perhaps arm changed"), blind].concat();
        let since: Vec<Comparison> =
            since.into_iter().zip(1..).map(|(s, k)| Comparison { recording: format!("{k}.csv"), ..s }).collect();
        assert!(says(&since, None, Some(0.3)).contains("is due now: in the last session that tells (1.csv)"));
        assert!(says(&since[1..], None, Some(0.3)).contains("(3.csv) would show no change"));
        assert_eq!(says(&[], None, None), "");
    }
}
