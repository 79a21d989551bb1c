//! Rows of the weighted problem and their sums: what a fit minimizes, and what is checked before.

use rayon::prelude::*;
use trical_model::{Forward, Workspace};

use crate::dataset::{Dataset, Observation, rejected_in_words};
use crate::dense::Mat;
use crate::error::{IdentError, Result};
use crate::fit::noise::Noise;
use crate::fit::normal_equations::{CHUNK, Keep, Rows};
use crate::fit::priors::PriorKnowledge;

/// Checks that every observation can be predicted.
///
/// # Errors
/// The first that cannot, with its file and line.
pub fn check_observations(forward: &Forward, data: &Dataset) -> Result<()> {
    for o in &data.observations {
        forward.check(&o.state, &o.measured, o.frame).map_err(|e| data.error(o, e.to_string()))?;
    }
    Ok(())
}

/// Number of scalars measured.
///
/// # Errors
/// Fewer than the `p` parameters that are to be identified, with what priors add.
pub fn check_count(data: &Dataset, p: usize, known: &[PriorKnowledge]) -> Result<usize> {
    let scalars = data.scalars();
    if scalars + known.iter().filter(|k| k.prior.is_some()).count() < p {
        return Err(IdentError::NotEnough(format!(
            "{} measurements give {scalars} numbers{}, but {p} parameters are to be identified: more measurements, or a \
             smaller set of them, are needed",
            data.observations.len(),
            rejected_in_words(&data.rejected).map_or_else(String::new, |r| format!(" ({r})")),
        )));
    }
    Ok(scalars)
}

/// All rows at the present coefficients, priors as measurements of the coefficients themselves.
pub(crate) fn evaluate(
    forward: &Forward,
    data: &Dataset,
    noise: &Noise,
    known: &[PriorKnowledge],
    limit: f64,
    total: &mut Rows,
) {
    total.clear();
    sum_rows(forward, &data.observations, noise, limit, total);
    add_priors(forward, known, total);
    total.flush();
}

/// Adds all observations: one after the other where they are few, else chunks in parallel that are added up in order.
fn sum_rows(forward: &Forward, observations: &[Observation], noise: &Noise, limit: f64, total: &mut Rows) {
    let run = |chunk: &[Observation], rows: &mut Rows| {
        let mut ws = forward.workspace();
        for seen in chunk.chunk_by(Observation::is_in_state_of) {
            rows.observe(forward, &mut ws, seen, noise, limit);
        }
    };
    if observations.len() <= CHUNK {
        run(observations, total);
        return;
    }
    // so many chunks at a time keep all threads busy, and memory stays bounded
    for batch in observations.chunks(CHUNK * 64) {
        let parts: Vec<Rows> = batch
            .par_chunks(CHUNK)
            .map(|chunk| {
                let mut rows = total.empty();
                run(chunk, &mut rows);
                rows.flush();
                rows
            })
            .collect();
        for part in &parts {
            total.add(part);
        }
    }
}

fn add_priors(forward: &Forward, known: &[PriorKnowledge], total: &mut Rows) {
    for (k, (known, term)) in known.iter().zip(forward.free()).enumerate() {
        if let Some(prior) = known.prior {
            let value = forward.model().terms[*term].value;
            total.observe_parameter(k, 1.0 / prior.sd, (value - prior.value) / prior.sd);
        }
    }
}

/// The factor `R` of the weighted `[J r]`, the residual as the last column, accumulated block by block.
pub(crate) fn factor(forward: &Forward, data: &Dataset, noise: &Noise, known: &[PriorKnowledge]) -> Mat {
    let mut total = Rows::new(forward.free().len(), Keep::Factor);
    sum_rows(forward, &data.observations, noise, f64::INFINITY, &mut total);
    add_priors(forward, known, &mut total);
    total.flush();
    total.factor().unwrap_or_else(|| Mat::zeros(0, 0))
}

/// Weighted residual of every observation (units of sigma) and its number of scalars.
#[must_use]
pub fn weighted_residuals(forward: &Forward, data: &Dataset, noise: &Noise) -> Vec<([f64; 6], usize)> {
    let mut ws = forward.workspace();
    data.observations.iter().map(|o| weighted(forward, o, noise, &mut ws)).collect()
}

/// As [`weighted_residuals`], of one observation; the workspace has the residual in SI.
pub(crate) fn weighted(forward: &Forward, o: &Observation, noise: &Noise, ws: &mut Workspace) -> ([f64; 6], usize) {
    let rows = forward.residual(&o.state, &o.measured, o.frame, ws);
    let r = ws.residual();
    let in_sigma = |k| if k < rows { r[k] / noise.sigma(o.recording, &o.measured, k) } else { 0.0 };
    (std::array::from_fn(in_sigma), rows)
}

/// Euclidean length.
#[must_use]
pub fn length(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Orientation error of every observation of a full pose, rad: the angle between predicted and measured orientation.
#[must_use]
pub fn orientation_errors(forward: &Forward, data: &Dataset) -> Vec<f64> {
    let mut ws = forward.workspace();
    let poses = data.observations.iter().filter(|o| trical_model::residual_rows(&o.measured) == 6);
    poses
        .map(|o| {
            forward.residual(&o.state, &o.measured, o.frame, &mut ws);
            length(&ws.residual()[3..])
        })
        .collect()
}

/// Position error of every observation, m: distance between predicted and measured point (difference of lengths for
/// distance measurements).
#[must_use]
pub fn position_errors(forward: &Forward, data: &Dataset) -> Vec<f64> {
    let mut ws = forward.workspace();
    data.observations
        .iter()
        .map(|o| {
            let rows = forward.residual(&o.state, &o.measured, o.frame, &mut ws).min(3);
            length(&ws.residual()[..rows])
        })
        .collect()
}
