//! What an effect is: its words, and the candidates that it asks for.

use serde::Serialize;
use trical_model::{Axis, Basis, JointKind, Motion, Place, Scope, Site, Term};

use crate::candidate::{Candidate, Physical};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

/// An effect of the catalogue.
#[derive(Debug, Serialize)]
pub struct Effect {
    /// Which one.
    #[serde(rename = "name")]
    pub id: EffectId,
    /// What people call it: a few words, without an article.
    pub title: &'static str,
    /// What is sure where the name is not.
    pub family: Family,
    /// Whose it is: what of it goes to other sessions.
    pub scope: Scope,
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
    /// What its coefficients are, by the beginning of their names; `WAVES` where they are waves.
    #[serde(skip)]
    pub coefficients: &'static [CoefficientWords],
    /// What the owner of the arm can do: one sentence.
    pub action: &'static str,
    /// What would make it visible, where touches do not show it.
    #[serde(skip)]
    pub remedy: Remedy,
    /// Whether it goes with the joint's gravity torque alone: where there is none, there is nothing to see.
    #[serde(skip)]
    pub follows_torque: bool,
    /// What this data can be asked about it.
    #[serde(skip)]
    pub(crate) ask: fn(&Covariates<'_>) -> Asked,
}

/// How a name of a coefficient begins; what it is, in words; and what an axis at the end of the name is to it: "along", "about", or nothing
/// where it is not told.
pub type CoefficientWords = (&'static str, &'static str, &'static str);

/// Sines and cosines are told by their amplitude.
pub(crate) const WAVES: &[CoefficientWords] = &[];

/// Effects of one mechanism.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Family {
    /// Gears and encoders.
    Transmission,
    /// Gaps and friction.
    LostMotion,
    /// What gives way under load.
    Elasticity,
    /// How the axes stand to each other.
    Geometry,
    /// What the arm carries, and which way is down.
    Load,
    /// Temperature.
    Heat,
    /// Something slipped, jumped or creeps.
    SomethingMoved,
    /// The measuring device.
    Gauge,
    /// How the joints were read.
    Reading,
}

/// What would make an effect visible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Remedy {
    /// Poses in which gravity pulls the other way.
    SignOfTorque,
    /// Another load.
    KnownPayload,
    /// Approaches in both senses.
    BothSenses,
    /// More of the joint's range.
    WiderRange,
    /// Another instrument.
    SecondInstrument,
    /// Readings that are not nulled.
    DeflectedReadings,
    /// The same touches again, later.
    Repeats,
}

impl Remedy {
    /// In words, as advice for touches.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::SignOfTorque => {
                "a second plate, high and close to the base, so that the arm folds back over its shoulder, and a device that may \
                 tilt further from straight down: gravity torques must change sign"
            }
            Self::KnownPayload => "some touches with another, known payload",
            Self::BothSenses => "more touches that are approached in both senses of the joint's motion",
            Self::WiderRange => "touches that use more of the joint's range: balls further apart, or on a second plate",
            Self::SecondInstrument => {
                "an instrument besides the balls: the place of the base takes up a wrong ballbar distance"
            }
            Self::DeflectedReadings => "touches that end with readings of some tenths of a millimetre, not nulled",
            Self::Repeats => "some of the first touches repeated at the end",
        }
    }
}

/// Which candidates of an effect can be tried, and what the recordings lack for the others.
#[derive(Default)]
pub(crate) struct Asked {
    pub(crate) candidates: Vec<Candidate>,
    pub(crate) lacks: Option<&'static str>,
}

impl Asked {
    pub(crate) fn lacking(what: &'static str) -> Self {
        Self { candidates: Vec::new(), lacks: Some(what) }
    }
}

impl From<Vec<Candidate>> for Asked {
    fn from(candidates: Vec<Candidate>) -> Self {
        Self { candidates, lacks: None }
    }
}

/// Name, site and basis of a term, and the sign that its coefficient must have to be physics (0: either).
pub(crate) type Part = (String, Site, Basis, i8);

/// Sizes of a coefficient, SI: the typical, and the largest that is usual.
pub(crate) struct Size {
    pub(crate) typical: f64,
    pub(crate) large: f64,
}

impl Effect {
    /// A candidate whose coefficients are all of one size.
    pub(crate) fn candidate(&self, site: Place, behaviour: String, size: Size, parts: Vec<Part>) -> Candidate {
        let scales = vec![0.5 * size.large; parts.len()];
        self.candidate_of_scales(site, behaviour, size.typical, scales, parts)
    }

    /// A candidate with a prior standard deviation for each coefficient.
    pub(crate) fn candidate_of_scales(
        &self,
        site: Place,
        behaviour: String,
        typical: f64,
        scales: Vec<f64>,
        parts: Vec<Part>,
    ) -> Candidate {
        let signs = parts.iter().map(|p| p.3).collect();
        let terms =
            parts.into_iter().map(|(name, site, basis, _)| Term::new(name, self.id.name(), site, basis)).collect();
        Candidate {
            cause: self.id.into(),
            site,
            behaviour,
            terms,
            signs,
            physical: Physical::default(),
            typical,
            scales,
            log_prior: 0.0,
        }
    }
}

/// Joints that turn, from 1: what a shaft, a round gear or a moment about the axis does is not asked of one that slides.
pub(crate) fn turning<'a>(r: &'a Covariates<'_>) -> impl Iterator<Item = usize> + 'a {
    r.joints().filter(|joint| r.model.robot.joints[joint - 1].kind == JointKind::Revolute)
}

pub(crate) const fn deg(angle: f64) -> f64 {
    angle * (std::f64::consts::PI / 180.0)
}

pub(crate) const fn arcsec(angle: f64) -> f64 {
    deg(angle / 3600.0)
}

/// Where on its axis a joint gives way or wobbles. A kinematic model need not know, and puts the joint's origin anywhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pivot {
    /// The origin of the joint's frame.
    Origin,
    /// Where its axis begins, before the offset d: at joint 1, where the arm stands.
    Foot,
}

impl Pivot {
    const BOTH: [Self; 2] = [Self::Origin, Self::Foot];

    /// Those that differ at `joint`.
    pub(crate) fn of(r: &Covariates<'_>, joint: usize) -> &'static [Self] {
        let j = &r.model.robot.joints[joint - 1];
        if j.kind == JointKind::Revolute && j.d.abs() > SAME_PLACE { &Self::BOTH } else { &Self::BOTH[..1] }
    }

    /// "" or " about its foot".
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Origin => "",
            Self::Foot => " about its foot",
        }
    }

    /// "" or "foot_".
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Origin => "",
            Self::Foot => "foot_",
        }
    }
}

/// Offsets below this (m) part no origin from its foot.
const SAME_PLACE: f64 = 1e-3;

/// The same basis along x, y and z of a place.
pub(crate) fn along(site: impl Fn(Motion) -> Site, name: &str, basis: Basis) -> Vec<Part> {
    Axis::ALL.iter().map(|a| (format!("{name}_{}", a.name()), site(Motion::Along(*a)), basis, 0)).collect()
}

/// What lacks where nothing is known of time.
pub(crate) const NO_TIME: &str = "time (t_s)";
/// What lacks where nothing is known of masses.
pub(crate) const NO_MASSES: &str = "masses of the links (robot.toml)";
/// What lacks where nothing is known of approaches.
pub(crate) const NO_SENSE: &str = "the sense of each joint's last motion (dir1 ...)";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_data::{arm, states};
    use trical_model::{Shape, State, Variable};

    #[test]
    fn a_candidate_expects_half_of_the_largest_usual_size_and_keeps_the_order_of_its_parts() {
        let effect = EffectId::GearRatio.effect();
        let basis = Basis::new(Variable::Joint { joint: 2 }, Shape::Linear);
        let part = |name: &str, sign| (name.to_owned(), Site::Joint { joint: 2 }, basis, sign);
        let size = Size { typical: 1e-4, large: 6e-4 };
        let c = effect.candidate(Place::Joint(2), "off".into(), size, vec![part("a", 1), part("b", 0)]);
        assert_eq!((c.typical, c.scales, c.signs), (1e-4, vec![3e-4; 2], vec![1, 0]));
        assert!(
            c.terms.iter().map(|t| t.name.as_str()).eq(["a", "b"])
                && c.terms.iter().all(|t| t.effect == effect.id.name())
        );
        assert_eq!([deg(180.0), arcsec(3600.0)], [std::f64::consts::PI, deg(1.0)]);
    }

    #[test]
    fn a_joint_has_a_foot_where_an_offset_parts_it_from_its_origin() {
        let (model, data) = (arm(), states(9, |k| State::at(&[0.1 * k])));
        let r = Covariates::new(&model, &data, 1e-5);
        let feet: Vec<usize> = r.joints().filter(|j| Pivot::of(&r, *j).contains(&Pivot::Foot)).collect();
        assert_eq!(feet, [1, 4, 6], "joints with an offset d");
        assert!(r.joints().all(|j| Pivot::of(&r, j)[0] == Pivot::Origin));
        assert_eq!(
            [Pivot::Origin, Pivot::Foot].map(|p| (p.words(), p.name())),
            [("", ""), (" about its foot", "foot_")]
        );
    }
}
