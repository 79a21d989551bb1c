//! The effects, one file each: what the mechanism does, which terms it would add to the model, where, how large it usually is,
//! and what it is easily taken for. A new effect is a new file, and a line in [`EFFECTS`].
//!
//! D is what an effect adds to the angle of joint j; d_j is the sense of its last motion; tau_j the gravity torque about its
//! axis, M_perp the moment across it; dT the temperature rise, t the time. All are linear in their coefficients; shapes are
//! scanned. Each term's derivative is analytic: that of its basis times that of its site (see `trical_model::term`).

mod axis_twist;
mod axis_wobble;
mod ball_position;
mod cross_axis_compliance;
mod fixture_drift;
mod fixture_shift;
mod frame_drift;
mod gear_ratio;
pub mod gear_ripple;
mod gravity_direction;
mod indicator_drift;
mod indicator_gain;
mod indicator_skew;
mod joint_coupling;
mod joint_harmonic;
mod joint_zero_shift;
mod late_joint_reading;
mod load_friction;
mod lost_motion_direction;
mod lost_motion_gravity;
pub(crate) mod nonlinear_stiffness;
mod payload;
mod thermal_growth;
mod thermal_zero_drift;
mod tool_drift;
mod tool_shift;

use serde::Serialize;
use trical_model::{Axis, Basis, JointKind, Motion, Place, Site, Term};

use crate::catalogue::{Candidate, anything};
use crate::covariates::Recorded;

/// All of them.
pub const EFFECTS: [&Effect; 26] = [
    &lost_motion_direction::EFFECT,
    &lost_motion_gravity::EFFECT,
    &load_friction::EFFECT,
    &joint_harmonic::EFFECT,
    &gear_ripple::EFFECT,
    &gear_ratio::EFFECT,
    &joint_coupling::EFFECT,
    &nonlinear_stiffness::EFFECT,
    &cross_axis_compliance::EFFECT,
    &axis_twist::EFFECT,
    &axis_wobble::EFFECT,
    &gravity_direction::EFFECT,
    &payload::EFFECT,
    &thermal_growth::EFFECT,
    &thermal_zero_drift::EFFECT,
    &joint_zero_shift::EFFECT,
    &fixture_shift::EFFECT,
    &fixture_drift::EFFECT,
    &tool_shift::EFFECT,
    &tool_drift::EFFECT,
    &frame_drift::EFFECT,
    &ball_position::EFFECT,
    &indicator_gain::EFFECT,
    &indicator_skew::EFFECT,
    &indicator_drift::EFFECT,
    &late_joint_reading::EFFECT,
];

/// An effect of the catalogue.
#[derive(Debug, Serialize)]
pub struct Effect {
    /// Its name: fixed, since model files and reports have it.
    pub name: &'static str,
    /// The kind of place at which it acts.
    pub site: &'static str,
    /// Mechanism, and the equation.
    pub form: &'static str,
    /// What a recording must have beyond joints and measurements.
    pub needs: &'static str,
    /// Size on a small arm.
    pub typical: &'static str,
    /// What it is easily taken for.
    pub rivals: &'static str,
    /// What this data can be asked about it.
    #[serde(skip)]
    pub(crate) ask: fn(&Recorded<'_>) -> Asked,
}

/// Which candidates of an effect can be tried, and what the recordings lack for the others.
#[derive(Default)]
pub(crate) struct Asked {
    pub(crate) candidates: Vec<Candidate>,
    pub(crate) lacks: Option<&'static str>,
}

impl Asked {
    fn lacking(what: &'static str) -> Self {
        Self { candidates: Vec::new(), lacks: Some(what) }
    }
}

impl From<Vec<Candidate>> for Asked {
    fn from(candidates: Vec<Candidate>) -> Self {
        Self { candidates, lacks: None }
    }
}

/// Name, site and basis of a term, and the sign that its coefficient must have to be physics (0: either).
type Part = (String, Site, Basis, i8);

/// Sizes of a coefficient, SI: the typical, and the largest that is usual.
struct Size {
    typical: f64,
    large: f64,
}

impl Effect {
    /// A candidate whose coefficients are all of one size.
    fn candidate(&self, site: Place, located: String, size: Size, parts: Vec<Part>) -> Candidate {
        let scales = vec![0.5 * size.large; parts.len()];
        self.candidate_of_scales(site, located, size.typical, scales, parts)
    }

    /// A candidate with a prior standard deviation for each coefficient.
    fn candidate_of_scales(
        &self,
        site: Place,
        located: String,
        typical: f64,
        scales: Vec<f64>,
        parts: Vec<Part>,
    ) -> Candidate {
        let signs = parts.iter().map(|p| p.3).collect();
        let terms = parts.into_iter().map(|(name, site, basis, _)| Term::new(name, self.name, site, basis)).collect();
        Candidate {
            effect: self.name,
            site,
            located,
            terms,
            signs,
            physical: anything,
            typical,
            scales,
            log_prior: 0.0,
        }
    }
}

const fn deg(angle: f64) -> f64 {
    angle * (std::f64::consts::PI / 180.0)
}

const fn arcsec(angle: f64) -> f64 {
    deg(angle / 3600.0)
}

/// Where on its axis a joint gives way or wobbles. A kinematic model need not know, and puts the joint's origin anywhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pivot {
    /// The origin of the joint's frame.
    Origin,
    /// Where its axis begins, before the offset d: at joint 1, where the arm stands.
    Foot,
}

impl Pivot {
    const BOTH: [Self; 2] = [Self::Origin, Self::Foot];

    /// Those that differ at `joint`.
    fn of(r: &Recorded<'_>, joint: usize) -> &'static [Self] {
        let j = &r.model.robot.joints[joint - 1];
        if j.kind == JointKind::Revolute && j.d.abs() > SAME_PLACE { &Self::BOTH } else { &Self::BOTH[..1] }
    }

    /// "" or " about its foot".
    fn words(self) -> &'static str {
        match self {
            Self::Origin => "",
            Self::Foot => " about its foot",
        }
    }

    /// "" or "foot_".
    fn name(self) -> &'static str {
        match self {
            Self::Origin => "",
            Self::Foot => "foot_",
        }
    }
}

/// Offsets below this (m) part no origin from its foot.
const SAME_PLACE: f64 = 1e-3;

/// The same basis along x, y and z of a place.
fn along(site: impl Fn(Motion) -> Site, name: &str, basis: Basis) -> Vec<Part> {
    Axis::ALL.iter().map(|a| (format!("{name}_{}", a.name()), site(Motion::Along(*a)), basis, 0)).collect()
}

/// What lacks where nothing is known of time.
const NO_TIME: &str = "time (t_s)";
/// What lacks where nothing is known of masses.
const NO_MASSES: &str = "masses of the links (robot.toml)";
/// What lacks where nothing is known of approaches.
const NO_SENSE: &str = "the sense of each joint's last motion (dir1 ...)";
