//! Validation: a model as it is, on data that it was not fitted to.

use trical_model::{Cell, Forward, Measured, Model, Motion, Robot, Site};

use crate::dataset::Dataset;
use crate::error::{IdentError, Result};
use crate::fit::position_errors;
use crate::identifiability::ParameterSet;
use crate::identify::{ErrorSummary, fit_model, prepared};
use crate::noise::Noise;

/// What is identified again for an instrument that was set up anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refit {
    /// The measuring frames (the base, where there is none).
    pub frame: bool,
    /// The targets (the TCP).
    pub targets: bool,
}

/// Errors of one part of the data.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Region {
    /// "q2 -60 to -32 deg", "distance from the middle 0 to 200 mm", "ball 2".
    pub region: String,
    /// Number of measurements.
    pub n: usize,
    /// Before.
    pub before: ErrorSummary,
    /// After.
    pub after: ErrorSummary,
}

/// Position errors of the nominal arm and of the model.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Validation {
    /// The nominal arm with only the measuring frame and targets identified on this data.
    pub before: ErrorSummary,
    /// The model.
    pub after: ErrorSummary,
    /// Number of measurements that were scored.
    pub n: usize,
    /// The same by region.
    pub regions: Vec<Region>,
    /// Errors one by one, m: before, after.
    #[serde(skip)]
    pub errors: Vec<(f64, f64)>,
    /// What was scored.
    #[serde(skip)]
    pub data: Dataset,
    /// The model as it was scored, with what was identified again.
    #[serde(skip)]
    pub model: Model,
}

/// Frame and tool points only, everything else of the model kept.
fn refitted(model: &Model, data: &Dataset, refit: Refit) -> Result<Model> {
    let mut start = model.clone();
    let wanted = |s: &Site| match s {
        Site::Frame { .. } | Site::Base(_) => refit.frame,
        Site::Target { .. } | Site::Tool(Motion::Along(_)) => refit.targets,
        _ => false,
    };
    if start.frames.len() < data.frames() {
        start.frames.resize(data.frames(), trical_model::Pose::identity());
    }
    if refit.frame {
        // frames in closed form from the model's own kinematics
        let mut ws_model = start.clone();
        ws_model.terms.retain(|t| !matches!(t.site, Site::Frame { .. }));
        let forward = Forward::new(ws_model, Vec::new())?;
        let mut ws = forward.workspace();
        for f in 0..data.frames() {
            let pairs: Vec<_> = data
                .observations
                .iter()
                .filter(|o| o.frame == f)
                .filter_map(|o| match o.measured {
                    Measured::Point { position, .. } | Measured::Pose { position, .. } => {
                        let identity = trical_model::Pose::identity();
                        let seen = nalgebra::Vector3::from(position);
                        // residual against a frame at the origin gives the predicted point itself
                        let in_frame = forward.frame_from_world(f).unwrap_or(identity);
                        forward.residual(&o.state, &o.measured, o.frame, &mut ws);
                        let r = ws.residual();
                        let predicted = seen + nalgebra::Vector3::new(r[0], r[1], r[2]);
                        Some((seen, in_frame.inverse().apply(&predicted)))
                    }
                    _ => None,
                })
                .collect();
            if let Some(pose) = crate::rigid::robust_rigid_from_points(&pairs) {
                start.frames[f] = pose;
                for t in &mut start.terms {
                    if matches!(t.site, Site::Frame { frame, .. } if frame == f + 1) && t.basis.is_constant() {
                        t.value = 0.0;
                    }
                }
            }
        }
    }
    let free: Vec<usize> = start
        .terms
        .iter()
        .enumerate()
        .filter(|(_, t)| t.basis.is_constant() && wanted(&t.site))
        .map(|(k, _)| k)
        .collect();
    let mut forward = Forward::new(start, free)?;
    let noise = Noise::usual(data.names.len());
    crate::fit::minimize(&mut forward, data, &noise, &crate::solver::LmParams::default())?;
    Ok(forward.into_model())
}

/// Scores `model` on `data`. With `refit`, frame and targets are identified again from every fourth pose, and the other
/// poses are scored.
///
/// # Errors
/// Data that the model cannot predict: another kind of measurement, a frame that it does not know.
pub fn validate(robot: &Robot, cell: &Cell, model: &Model, data: &Dataset, refit: Option<Refit>) -> Result<Validation> {
    if refit.is_none() && model.frames.len() < data.frames() {
        return Err(IdentError::WrongModel(format!(
            "the model knows {} measuring frames and the recordings have {}: add --refit frame (or frame,targets) for an \
             instrument that was set up anew",
            model.frames.len(),
            data.frames()
        )));
    }
    let (used, scored) = match refit {
        None => (model.clone(), data.clone()),
        Some(refit) => {
            let poses = data.used_poses();
            let fourth = |pose: usize| poses.binary_search(&pose).is_ok_and(|i| i % 4 == 0);
            let train = data.filtered(|o| fourth(o.pose));
            (refitted(model, &train, refit)?, data.filtered(|o| !fourth(o.pose)))
        }
    };
    let forward = Forward::new(used, Vec::new())?;
    crate::fit::check_observations(&forward, &scored)?;
    let after = position_errors(&forward, &scored);
    let (nominal, dependent) = prepared(robot, cell, &scored, &ParameterSet::Nominal.into())?;
    let nominal = fit_model(nominal, &scored, &Noise::usual(data.names.len()), dependent)?;
    let before = position_errors(&Forward::new(nominal.model, Vec::new())?, &scored);
    let pairs: Vec<(f64, f64)> = before.iter().copied().zip(after.iter().copied()).collect();
    let regions = regions(&scored, &pairs);
    Ok(Validation {
        before: ErrorSummary::of(&before),
        after: ErrorSummary::of(&after),
        n: pairs.len(),
        regions,
        errors: pairs,
        data: scored,
        model: forward.into_model(),
    })
}

fn regions(data: &Dataset, errors: &[(f64, f64)]) -> Vec<Region> {
    let mut out = Vec::new();
    let mut add = |region: String, pick: &dyn Fn(usize) -> bool| {
        let chosen: Vec<&(f64, f64)> = errors.iter().enumerate().filter(|(i, _)| pick(*i)).map(|(_, e)| e).collect();
        if !chosen.is_empty() {
            out.push(Region {
                region,
                n: chosen.len(),
                before: ErrorSummary::of(&chosen.iter().map(|e| e.0).collect::<Vec<_>>()),
                after: ErrorSummary::of(&chosen.iter().map(|e| e.1).collect::<Vec<_>>()),
            });
        }
    };
    let o = &data.observations;
    for joint in 0..data.dof {
        let q: Vec<f64> = o.iter().map(|o| o.state.q[joint]).collect();
        let mut sorted = q.clone();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        let quarter = |k: usize| sorted[(k * (n - 1)) / 4];
        for k in 0..4 {
            let (low, high) = (quarter(k), quarter(k + 1));
            let name = format!("q{} {:.1} to {:.1} deg", joint + 1, low.to_degrees(), high.to_degrees());
            add(name, &|i| q[i] >= low && (q[i] < high || (k == 3 && q[i] <= high)));
        }
    }
    let balls: std::collections::BTreeSet<usize> = o
        .iter()
        .filter_map(|o| match o.measured {
            Measured::Touch { ball, .. } => Some(ball),
            _ => None,
        })
        .collect();
    for ball in balls {
        add(format!("ball {}", ball + 1), &|i| matches!(o[i].measured, Measured::Touch { ball: b, .. } if b == ball));
    }
    let places: Vec<Option<nalgebra::Vector3<f64>>> = o
        .iter()
        .map(|o| match o.measured {
            Measured::Point { position, .. } | Measured::Pose { position, .. } => {
                Some(nalgebra::Vector3::from(position))
            }
            _ => None,
        })
        .collect();
    let seen: Vec<nalgebra::Vector3<f64>> = places.iter().flatten().copied().collect();
    if !seen.is_empty() {
        let middle =
            nalgebra::Vector3::from_fn(|k, _| crate::rigid::median(&seen.iter().map(|p| p[k]).collect::<Vec<_>>()));
        for (low, high) in [(0.0, 0.2), (0.2, 0.4), (0.4, 0.6), (0.6, 0.8), (0.8, f64::INFINITY)] {
            let name = if high.is_finite() {
                format!("{:.0} to {:.0} mm from the middle", low * 1e3, high * 1e3)
            } else {
                format!("more than {:.0} mm from the middle", low * 1e3)
            };
            add(name, &|i| places[i].is_some_and(|p| (low..high).contains(&(p - middle).norm())));
        }
    }
    out
}
