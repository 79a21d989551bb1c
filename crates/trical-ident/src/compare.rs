//! Is this arm still what it was? A few touches against an earlier calibration: unchanged, or what changed, by how much and how surely.
//!
//! The residuals `r` of the new touches by the old model scatter by the old session's noise and by what the old parameters may be off:
//! `cov r = s^2 I + J C J'`. What is new in any case (a measuring frame, places of sockets) is projected out. Each explanation (tool, base,
//! the zero of one joint, one wrong touch) has columns `H`; the length of the projection of the whitened residual on them, squared, is
//! chi-squared with as many degrees of freedom as columns, if nothing changed. The best explanation is taken if its p-value, times the
//! number of explanations, is below [`FALSE_ALARMS`]; then the next one is sought beside it.
//!
//! | module | holds |
//! |---|---|
//! | `explanation` | what may have changed, as terms of the model |
//! | `whitened` | residuals and columns with unit covariance |
//! | `search` | which explanations are taken, and how probable each is |
//! | `settings` | thresholds |
//! | `size` | by how much something changed, and how large a change has to be to be found |
//! | `result` | the result, its verdict and its summary in words |

mod explanation;
mod result;
mod search;
mod settings;
mod size;
mod whitened;

use trical_model::{Cell, Forward, Recording, Scope, Site, Term, Variable};

use crate::dataset::readings::averaged;
use crate::dataset::{Dataset, JointSource};
use crate::date;
use crate::error::{IdentError, Result};
use crate::fit::noise::Noise;
use crate::fit::residuals::position_errors;
use crate::model_file::ModelFile;
use crate::rigid::mean;
use crate::validate::adapted::{Refit, adapted};

pub use result::{Change, Changed, Comparison, Visible, capital};
pub use settings::FALSE_ALARMS;

use explanation::Explained;
use settings::{ANOTHER_ARM, MEASUREMENTS, OTHER_DAY};
use whitened::Whitened;

/// Compares a new recording with the model of `file`, which has to know how uncertain it is ([`ModelFile::of_fit`]).
///
/// # Errors
/// A model that does not know its uncertainty, or was learnt on this very recording; data that the model cannot predict, or that are of
/// another arm.
pub fn compare(
    cell: &Cell,
    file: &ModelFile,
    recording: &Recording,
    joints: Option<JointSource>,
) -> Result<Comparison> {
    let uncertainty = file.uncertainty.as_ref().ok_or_else(|| {
        IdentError::WrongModel(
            "the model file does not say how uncertain it is ([uncertainty]); expected one that this version identified from at most 1000 \
             parameters"
                .into(),
        )
    })?;
    let framed = recording.rows.iter().any(|r| r.measured.is_framed());
    let refit = framed.then_some(Refit { frame: true, targets: false });
    let newest = newest(file);
    let adapted = adapted(file, cell, std::slice::from_ref(recording), joints, refit, Some(newest))?;
    if adapted.is_known() {
        return Err(IdentError::WrongModel(format!(
            "{}: the model was fitted to these measurements; expected a later recording",
            recording.name
        )));
    }
    let model = adapted.identified()?;
    let errors = position_errors(&Forward::new(model.clone(), Vec::new())?, &adapted.data);
    let data = thinned(&averaged(&adapted.data).0);
    let grows = |t: &Term| t.site == Site::Links && matches!(t.basis.of, Variable::Temperature { .. });
    let then = file.sessions.get(newest as usize - 1).and_then(|s| s.temp_c);
    let warmer = adapted.data.mean_temp_c().zip(then).map(|(now, then)| now - then);
    let heat = if model.terms.iter().any(grows) { 0.0 } else { warmer.map_or(OTHER_DAY, f64::abs) };
    let explained = Explained::of(model, &data, file, uncertainty, heat);
    let is_new = |such: fn(&Site) -> bool| explained.new.iter().any(|k| such(&explained.model.terms[*k].site));
    let tool = is_new(|s| matches!(s, Site::Tool(_) | Site::Target { .. }));
    // of sockets the place is new by their nature
    let placed = recording.places.is_empty() && cell.balls_fix_base(|_| true);
    let base = placed && is_new(|s| matches!(s, Site::Fixture(_)));
    let mut whitened = Whitened::of(&explained, &data, uncertainty)?;
    let changes = search::changes(&mut whitened);
    let visible = size::visible(&whitened);
    let set_up = Forward::new(size::set_up_anew(&explained, &changes), Vec::new())?;
    let of_arm = position_errors(&set_up, &adapted.data);
    let mut out = Comparison {
        recording: recording.name.clone(),
        hash: adapted.data.fingerprints[0].whole.clone(),
        measurements: adapted.data.observations.len(),
        rejected: adapted.data.rejected.clone(),
        setup_of: setup_of(file, newest),
        anew: [("tool", tool), ("base", base)].into_iter().filter(|a| a.1).map(|a| a.0).collect(),
        verdict: result::verdict(&changes, &visible, whitened.more_noise.sqrt()),
        summary: String::new(),
        doubt: None,
        each: size::each(&whitened, &changes),
        changes,
        visible,
        mean_mm: mean(&errors) * 1e3,
        noise_mm: uncertainty.noise * 1e3,
        more_noise: whitened.more_noise.sqrt(),
        temp_c: adapted.data.mean_temp_c(),
        warmer,
        arm_mm: mean(&of_arm) * 1e3,
    };
    out.tell(usual_mm(&adapted.data), &adapted.left_out);
    let left = out.more_noise * uncertainty.noise;
    if left > ANOTHER_ARM.0 && out.more_noise > ANOTHER_ARM.1 {
        return Err(IdentError::WrongModel(format!(
            "{}: the model misses these measurements by {:.0} mm on average, and no change of one joint, the tool or the base explains more \
             than a part of it; expected a recording of the arm that the model is of, '{}'",
            recording.name, out.mean_mm, file.model.robot.name
        )));
    }
    Ok(out)
}

/// The newest session (from 1) that a model was fitted to: by the dates in the names of its recordings, or the last
/// one.
fn newest(file: &ModelFile) -> u32 {
    let by_date = date::newest(file.sessions.iter().map(|s| s.recording.as_str()));
    u32::try_from(by_date.map_or(file.sessions.len(), |k| k + 1)).unwrap_or(u32::MAX).max(1)
}

/// The recording of session `newest`, where sessions of the model have tools and balls of their own.
fn setup_of(file: &ModelFile, newest: u32) -> Option<String> {
    let own_setup = |t: &Term| t.basis.session.is_some() && t.basis.place.is_none() && t.scope() == Scope::Setup;
    let session = file.sessions.get(newest as usize - 1)?;
    file.model.terms.iter().any(own_setup).then(|| session.recording.clone())
}

/// Some of many measurements, evenly.
fn thinned(data: &Dataset) -> Dataset {
    let every = data.observations.len().div_ceil(MEASUREMENTS).max(1);
    let mut some = data.filtered(|_| true);
    some.observations = data.observations.iter().step_by(every).copied().collect();
    some
}

/// Standard deviation of each coordinate, mm, that the instrument usually has; `None` for balls in sockets, whose play depends on the print.
fn usual_mm(data: &Dataset) -> Option<f64> {
    let usual = Noise::usual(data.names.len());
    let each =
        data.observations.iter().map(|o| (o.state.place.is_none()).then(|| usual.sigma(o.recording, &o.measured, 0)));
    each.collect::<Option<Vec<f64>>>().map(|all| all.into_iter().fold(0.0, f64::max) * 1e3)
}
