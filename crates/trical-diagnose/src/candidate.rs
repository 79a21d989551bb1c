//! One explanation of the residuals that can be tried.

use std::fmt;
use std::sync::Arc;

use trical_model::{Basis, Place, Shape, Site, Term, Variable};

use crate::covariates::{is_order, moment};
use crate::effect_id::Cause;
use crate::settings::CURVE_COEFFICIENTS;

/// What coefficients of a candidate (SI) are possible; anything where nothing is said.
#[derive(Clone, Default)]
pub struct Physical(Option<Arc<Holds>>);

type Holds = dyn Fn(&[f64]) -> bool + Send + Sync;

impl Physical {
    /// Those for which this holds.
    pub fn when(holds: impl Fn(&[f64]) -> bool + Send + Sync + 'static) -> Self {
        Self(Some(Arc::new(holds)))
    }

    /// Whether nothing is said.
    #[must_use]
    pub fn allows_anything(&self) -> bool {
        self.0.is_none()
    }

    /// Whether they are possible.
    #[must_use]
    pub fn allows(&self, coefficients: &[f64]) -> bool {
        self.0.as_ref().is_none_or(|holds| holds(coefficients))
    }
}

impl fmt::Debug for Physical {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_some() { "some" } else { "anything" })
    }
}

/// One explanation that can be tried: the terms that it would add.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// What it blames.
    pub cause: Cause,
    /// Where.
    pub site: Place,
    /// In words: what the residuals would do, but for the moment or the point (see [`Candidate::located`]).
    pub behaviour: String,
    /// Terms with coefficient 0.
    pub terms: Vec<Term>,
    /// Sign that each coefficient must have to be physics; 0 where both are possible.
    pub signs: Vec<i8>,
    /// Whether coefficients of these values are physics.
    pub physical: Physical,
    /// Typical size of a coefficient, SI, for saying beforehand what the data could show.
    pub typical: f64,
    /// Prior standard deviation of each coefficient, SI: half of the large end of what is usual. A coefficient beyond that is not
    /// forbidden, but must be paid for: this is what keeps two columns that nearly cancel from being blown up to fit noise.
    pub scales: Vec<f64>,
    /// Logarithm of the prior: uniform over families, then sites, then scan points.
    pub log_prior: f64,
}

impl Candidate {
    /// In words: what the residuals would do, with the moment of a change and the point about which a joint gives way.
    #[must_use]
    pub fn located(&self) -> String {
        let what = &self.behaviour;
        if let Some((of, at)) = self.step().filter(|(of, _)| is_order(*of)) {
            return format!("{what} {}", moment(of, at));
        }
        match self.share() {
            Some(share) => {
                format!("{what} about a point {:.0} % of the way from its origin to its foot", 100.0 * share)
            }
            None => what.clone(),
        }
    }

    /// Whether both are one cause at one place, of one session where it is of one.
    #[must_use]
    pub fn is_alike(&self, other: &Self) -> bool {
        (self.cause, self.site, self.session()) == (other.cause, other.site, other.session())
    }

    /// Whether all of its terms are among those of another.
    #[must_use]
    pub fn is_part_of(&self, other: &Self) -> bool {
        self.terms.iter().all(|t| other.terms.iter().any(|o| o.site == t.site && o.basis == t.basis))
    }

    /// Whether it is a curve with so many coefficients that it is chosen first and then held.
    #[must_use]
    pub fn is_long_curve(&self) -> bool {
        self.cause.effect().is_some() && self.terms.len() > CURVE_COEFFICIENTS
    }

    /// On what it depends, and on the sense of which joint's motion.
    #[must_use]
    pub fn over(&self) -> Option<(Variable, Option<usize>)> {
        self.terms.first().map(|t| (t.basis.of, t.basis.sense))
    }

    /// Whether it happens in the course of a session.
    #[must_use]
    pub fn is_course(&self) -> bool {
        self.terms.iter().any(|t| is_order(t.basis.of))
    }

    /// Whether it holds for the whole of one session, which may as well be told the other way round of the others.
    #[must_use]
    pub fn is_of_whole_session(&self) -> bool {
        self.session().is_some() && self.terms.iter().all(|t| t.basis.of == Variable::Nothing)
    }

    /// The same in one session only.
    #[must_use]
    pub fn in_session(mut self, session: u32) -> Self {
        for t in &mut self.terms {
            t.basis = t.basis.in_session(session);
        }
        self
    }

    /// The only session in which it happens, if it is of one.
    #[must_use]
    pub fn session(&self) -> Option<u32> {
        self.terms.first()?.basis.session
    }

    /// Variable and place of a step, if it is one (all its terms step together).
    #[must_use]
    pub fn step(&self) -> Option<(Variable, f64)> {
        match self.terms.first()?.basis {
            Basis { of, shape: Shape::Step { at }, sense: None, beside: None, .. } => Some((of, at)),
            _ => None,
        }
    }

    /// The same of another shape.
    #[must_use]
    pub fn with_shape(&self, shape: Shape) -> Self {
        let mut other = self.clone();
        other.terms.iter_mut().for_each(|t| t.basis.shape = shape);
        other
    }

    /// Variable of a free curve, if it is one.
    #[must_use]
    pub fn curve(&self) -> Option<Variable> {
        let is_tent = |t: &Term| matches!(t.basis, Basis { shape: Shape::Tent { .. }, sense: None, .. });
        (self.terms.len() > 1 && self.terms.iter().all(is_tent)).then(|| self.terms[0].basis.of)
    }

    /// Softness, kink or time constant of its shape, if it has one (all its terms share it).
    #[must_use]
    pub fn scale(&self) -> Option<f64> {
        match self.terms.first()?.basis.shape {
            Shape::SoftSign { scale } => Some(scale),
            Shape::Clip { at } => Some(at),
            Shape::WarmUp { constant } => Some(constant),
            _ => None,
        }
    }

    /// The same with another softness, kink or time constant.
    #[must_use]
    pub fn with_scale(&self, to: f64) -> Self {
        let mut other = self.clone();
        for shape in other.terms.iter_mut().map(|t| &mut t.basis.shape) {
            match shape {
                Shape::SoftSign { scale } => *scale = to,
                Shape::Clip { at } => *at = to,
                Shape::WarmUp { constant } => *constant = to,
                _ => {}
            }
        }
        other
    }

    /// Cycles a turn, if it is a wave.
    #[must_use]
    pub fn cycles(&self) -> Option<f64> {
        cycles_of(self.terms.first()?)
    }

    /// Whether a wave of the joint's own angle is so steep that the joint would turn back where it is told to go on: no error of a joint does that, and
    /// no target could be corrected for it.
    #[must_use]
    pub fn turns_back(&self, coefficients: &[f64]) -> bool {
        let slope = |(t, c): (&Term, &f64)| match (t.site, t.basis) {
            (
                Site::Joint { joint: at },
                Basis {
                    of: Variable::Joint { joint },
                    shape: Shape::Sine { cycles } | Shape::Cosine { cycles },
                    sense: None,
                    beside: None,
                    ..
                },
            ) if at == joint => cycles * c,
            _ => 0.0,
        };
        self.terms.iter().zip(coefficients).map(slope).fold(0.0, libm::hypot) >= 1.0
    }

    /// Where on its axis a joint gives way, if it is between: the share of the way from its origin to its foot.
    #[must_use]
    pub fn share(&self) -> Option<f64> {
        match self.terms.first()?.basis.of {
            Variable::PartMoment { share, .. } => Some(share),
            _ => None,
        }
    }

    /// The same about another point.
    #[must_use]
    pub fn with_share(&self, to: f64) -> Self {
        let mut other = self.clone();
        for t in &mut other.terms {
            if let Variable::PartMoment { share, .. } = &mut t.basis.of {
                *share = to;
            }
        }
        other
    }

    /// Whether it is a step or a curve rather than a wave.
    #[must_use]
    pub fn scanned(&self) -> bool {
        self.terms
            .iter()
            .all(|t| matches!(t.basis.shape, Shape::Step { .. } | Shape::Tent { .. } | Shape::Growth { .. }))
    }
}

/// Cycles a turn, if a term is a wave.
pub(crate) fn cycles_of(t: &Term) -> Option<f64> {
    t.basis.shape.cycles()
}

/// Candidates that say the same as curves in other words: the curves themselves, waves of theirs, and free curves of the same angle at the
/// same joint.
#[must_use]
pub fn said_by(curves: &[&Candidate], candidates: &[Candidate]) -> Vec<usize> {
    let said = |c: &Candidate| {
        curves.iter().any(|h| {
            let own_angle =
                |t: &Term| t.basis.of == h.terms[0].basis.of && t.basis.sense.is_none() && t.basis.beside.is_none();
            let free = c.cause == Cause::Unexplained && c.site == h.site && c.terms.iter().all(own_angle);
            free || c.is_part_of(h)
        })
    };
    (0..candidates.len()).filter(|k| said(&candidates[*k])).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::effect_id::UNEXPLAINED;

    fn of(bases: &[Basis]) -> Candidate {
        let term = |b: &Basis| Term::new("t", UNEXPLAINED, Site::Joint { joint: 2 }, *b);
        Candidate {
            cause: Cause::Unexplained,
            site: Place::Joint(2),
            behaviour: "joint 2 is off".into(),
            terms: bases.iter().map(term).collect(),
            signs: vec![0; bases.len()],
            physical: Physical::default(),
            typical: 0.0,
            scales: vec![1.0; bases.len()],
            log_prior: 0.0,
        }
    }

    const Q2: Variable = Variable::Joint { joint: 2 };

    #[test]
    fn a_wave_turns_a_joint_back_where_it_falls_faster_than_the_angle_grows() {
        let waves =
            |angle, cycles| [Shape::Sine { cycles }, Shape::Cosine { cycles }].map(|shape| Basis::new(angle, shape));
        let fast = of(&waves(Q2, 5000.0));
        // 5000 cycles of 0.2 mrad: 1 rad for each
        assert!(fast.turns_back(&[1.5e-4, 1.5e-4]) && !fast.turns_back(&[1.3e-4, 1.3e-4]));
        assert!(fast.turns_back(&[0.0, -2.1e-4]) && !of(&waves(Q2, 100.0)).turns_back(&[5e-3, 5e-3]));
        // another joint's angle, or the sense of its motion, is not its own
        assert!(!of(&waves(Variable::Joint { joint: 3 }, 5000.0)).turns_back(&[1.0, 1.0]));
        let sense = waves(Q2, 5000.0).map(|b| Basis { sense: Some(2), ..b });
        assert!(!of(&sense).turns_back(&[1.0, 1.0]) && !of(&[Basis::CONSTANT]).turns_back(&[1e9]));
    }

    #[test]
    fn what_a_candidate_may_be_asked_is_what_its_shape_has_and_can_be_put_elsewhere() {
        let step = of(&[Basis::new(Variable::Time, Shape::Step { at: 90.0 })]);
        assert_eq!(step.step(), Some((Variable::Time, 90.0)));
        assert_eq!(
            (step.with_shape(Shape::Step { at: 40.0 }).step(), step.is_course(), step.scanned()),
            (Some((Variable::Time, 40.0)), true, true)
        );
        assert_eq!(step.with_shape(Shape::Step { at: 40.0 }).located(), "joint 2 is off at 40 s");
        // a step in the course of time says when, one over an angle does not
        assert_eq!(of(&[Basis::new(Q2, Shape::Step { at: 0.4 })]).located(), "joint 2 is off");
        let soft = of(&[Basis::new(Q2, Shape::SoftSign { scale: 0.1 }), Basis::new(Q2, Shape::Clip { at: 0.1 })]);
        assert_eq!((soft.scale(), soft.with_scale(0.3).scale(), soft.scanned()), (Some(0.1), Some(0.3), false));
        assert_eq!(soft.with_scale(0.3).terms[1].basis.shape, Shape::Clip { at: 0.3 });
        assert_eq!(of(&[Basis::new(Q2, Shape::Cosine { cycles: 30.0 })]).cycles(), Some(30.0));
        let part = |share| {
            of(&[Basis::new(Variable::PartMoment { joint: 2, axis: trical_model::Axis::X, share }, Shape::Linear)])
        };
        assert_eq!((part(0.25).share(), part(0.25).with_share(0.5).share()), (Some(0.25), Some(0.5)));
        assert_eq!(part(0.25).located(), "joint 2 is off about a point 25 % of the way from its origin to its foot");
    }

    #[test]
    fn a_curve_is_several_tents_of_one_angle_and_no_sense_of_motion() {
        let tent = |centre: f64| Basis::new(Q2, Shape::Tent { left: centre - 1.0, centre, right: centre + 1.0 });
        assert_eq!(of(&[tent(0.0), tent(1.0)]).curve(), Some(Q2));
        assert_eq!(of(&[tent(0.0)]).curve(), None);
        assert_eq!(of(&[tent(0.0), Basis { sense: Some(2), ..tent(1.0) }]).curve(), None);
        // one without a name is never held, however long
        assert!(!of(&[tent(0.0); 40]).is_long_curve());
    }

    #[test]
    fn candidates_of_different_sessions_are_not_alike_and_a_part_has_nothing_else() {
        let (one, two) = (Basis::CONSTANT, Basis::new(Q2, Shape::Linear));
        assert!(of(&[one]).is_alike(&of(&[two])));
        assert!(!of(&[one]).is_alike(&of(&[one]).in_session(2)));
        assert_eq!((of(&[one]).session(), of(&[one, two]).in_session(2).session()), (None, Some(2)));
        assert!(of(&[two]).is_part_of(&of(&[one, two])) && !of(&[one, two]).is_part_of(&of(&[two])));
        assert!(!of(&[two]).in_session(2).is_part_of(&of(&[one, two])));
    }
}
