//! What a user can choose about a plan.

use trical_model::{Joints, Term};

use crate::criterion::Criterion;
use crate::error::{PlanError, Result};
use crate::predict::Sphere;

/// Settings of [`crate::plan_touches`]; `..PlanOptions::default()` for the rest.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanOptions {
    /// Seed of all random choices: same seed, same plan.
    pub seed: u64,
    /// Touches at each ball.
    pub per_ball: usize,
    /// Candidates to choose from at each ball.
    pub pool_per_ball: usize,
    /// Attempts for each candidate before giving up.
    pub attempts_per_candidate: usize,
    /// Largest angle between the tool's z axis and straight down (-z of {w}), rad.
    pub max_tilt_rad: f64,
    /// Range of the tool's rotation about its own z axis, rad.
    pub spin_rad: [f64; 2],
    /// Range of distances from the stand-off pose to the touch, m.
    pub standoff_m: [f64; 2],
    /// How far joints stay inside their limits, rad (m for sliding joints), so that the procedure can correct a pose.
    pub limit_margin_rad: f64,
    /// Parameters to identify; `None` for [`crate::parameters::usual_parameters`].
    pub parameters: Option<Vec<Term>>,
    /// What the touches are to be best for.
    pub criterion: Criterion,
    /// Where the arm is to be accurate; `None` for [`Sphere::above`] the balls. What is expected there is told, and
    /// [`Criterion::Region`] makes it small.
    pub sphere: Option<Sphere>,
    /// Whether [`Criterion::Region`] looks at the whole workspace instead of the sphere.
    pub whole_workspace: bool,
    /// Standard deviation of each of a touch's three numbers, indicators and procedure together, m: for what is expected.
    pub noise_m: f64,
    /// Random starts of the search for the best set, besides a greedy one.
    pub restarts: usize,
    /// Where the arm stands before the first touch: then the way from there is checked and its via points are planned too.
    pub start: Option<Joints>,
}

impl Default for PlanOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            per_ball: 15,
            pool_per_ball: 100,
            attempts_per_candidate: 200,
            max_tilt_rad: 90.0_f64.to_radians(),
            spin_rad: [-std::f64::consts::PI, std::f64::consts::PI],
            standoff_m: [0.03, 0.05],
            limit_margin_rad: 1.0_f64.to_radians(),
            parameters: None,
            criterion: Criterion::Determinant,
            sphere: None,
            whole_workspace: false,
            noise_m: 1e-5,
            restarts: 3,
            start: None,
        }
    }
}

impl PlanOptions {
    /// Refuses what makes no sense.
    pub(crate) fn check(&self) -> Result<()> {
        let bad = |option: &'static str, problem: String| Err(PlanError::Option { option, problem });
        if self.per_ball == 0 {
            return bad("per_ball", "found 0, expected one touch or more at each ball".into());
        }
        if self.pool_per_ball < self.per_ball {
            return bad(
                "pool_per_ball",
                format!("found {}, expected at least per_ball, {}", self.pool_per_ball, self.per_ball),
            );
        }
        if self.attempts_per_candidate == 0 {
            return bad("attempts_per_candidate", "found 0, expected one or more".into());
        }
        if !(self.max_tilt_rad.is_finite() && (0.0..=std::f64::consts::PI).contains(&self.max_tilt_rad)) {
            return bad("max_tilt_rad", format!("found {}, expected 0 to pi", self.max_tilt_rad));
        }
        if !(self.spin_rad.iter().all(|s| s.is_finite()) && self.spin_rad[0] <= self.spin_rad[1]) {
            return bad("spin_rad", format!("found {:?}, expected a lower and a higher angle", self.spin_rad));
        }
        let [near, far] = self.standoff_m;
        if !(near.is_finite() && far.is_finite() && 0.002 <= near && near <= far && far <= 0.5) {
            return bad(
                "standoff_m",
                format!("found {near} to {far}, expected a shorter and a longer distance between 0.002 and 0.5 m"),
            );
        }
        if !(self.limit_margin_rad.is_finite() && self.limit_margin_rad >= 0.0) {
            return bad("limit_margin_rad", format!("found {}, expected 0 or more", self.limit_margin_rad));
        }
        if !(self.noise_m.is_finite() && self.noise_m > 0.0 && self.noise_m <= 0.01) {
            return bad("noise_m", format!("found {}, expected more than 0, at most 0.01 m", self.noise_m));
        }
        if let Some(s) = &self.sphere
            && !(s.centre.iter().all(|x| x.is_finite()) && s.radius.is_finite() && s.radius > 0.0)
        {
            return bad(
                "sphere",
                format!("found a radius of {} m, expected a finite place and a radius above 0", s.radius),
            );
        }
        Ok(())
    }
}
