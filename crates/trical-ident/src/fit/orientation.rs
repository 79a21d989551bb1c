//! Errors of orientation, where full poses were measured.

use serde::Serialize;
use trical_model::{Forward, Model};

use crate::dataset::Dataset;
use crate::error::Result;
use crate::fit::identify::ErrorSummary;
use crate::fit::residuals::orientation_errors;

/// Mean, root of the mean square and maximum of angles, deg.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AngleSummary {
    /// Mean.
    pub mean_deg: f64,
    /// Root of the mean square.
    pub rms_deg: f64,
    /// Largest.
    pub max_deg: f64,
}

impl AngleSummary {
    /// Of angles in rad.
    fn of(angles: &[f64]) -> Self {
        // the same sums as of lengths
        let e = ErrorSummary::of(angles);
        let deg = |mm: f64| (mm * 1e-3).to_degrees();
        Self { mean_deg: deg(e.mean_mm), rms_deg: deg(e.rms_mm), max_deg: deg(e.max_mm) }
    }
}

/// Errors of orientation before and after, each by its model on its data; `None` where no full pose was measured.
pub(crate) fn orientation(both: [(&Model, &Dataset); 2]) -> Result<Option<[AngleSummary; 2]>> {
    let of =
        |(model, data): (&Model, &Dataset)| Ok(orientation_errors(&Forward::new(model.clone(), Vec::new())?, data));
    let [before, after]: [Result<Vec<f64>>; 2] = both.map(of);
    let (before, after) = (before?, after?);
    Ok((!after.is_empty()).then(|| [AngleSummary::of(&before), AngleSummary::of(&after)]))
}
