//! What can be tried on a data set: candidates of all effects with their priors, and terms about the readings' own noise.

use trical_model::{Axis, Basis, Motion, Place, Shape, Site, Term, Variable};

use crate::covariates::{Recorded, is_order, moment};
use crate::effects::EFFECTS;

/// One explanation that can be tried: the terms that it would add.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Name in the catalogue.
    pub effect: &'static str,
    /// Where.
    pub site: Place,
    /// In words: what the residuals would do.
    pub located: String,
    /// Terms with coefficient 0.
    pub terms: Vec<Term>,
    /// Sign that each coefficient must have to be physics; 0 where both are possible.
    pub signs: Vec<i8>,
    /// Whether coefficients of these values (or proportional ones) are physics.
    pub physical: fn(&[f64]) -> bool,
    /// Typical size of a coefficient, SI, for saying beforehand what the data could show.
    pub typical: f64,
    /// Prior standard deviation of each coefficient, SI: half of the large end of what is usual. A coefficient beyond that is not
    /// forbidden, but must be paid for: this is what keeps two columns that nearly cancel from being blown up to fit noise.
    pub scales: Vec<f64>,
    /// Logarithm of the prior: uniform over families, then sites, then scan points.
    pub log_prior: f64,
}

impl Candidate {
    /// Variable and place of a step, if it is one (all its terms step together).
    #[must_use]
    pub fn step(&self) -> Option<(Variable, f64)> {
        match self.terms.first()?.basis {
            Basis { of, shape: Shape::Step { at }, sense: None, beside: None } => Some((of, at)),
            _ => None,
        }
    }

    /// The same with its step elsewhere.
    #[must_use]
    pub fn with_step(&self, at: f64) -> Self {
        let mut other = self.clone();
        for t in &mut other.terms {
            t.basis.shape = Shape::Step { at };
        }
        let of = self.terms[0].basis.of;
        if is_order(of)
            && let Some((what, _)) = self.located.rsplit_once(" at ")
        {
            other.located = format!("{what} {}", moment(of, at));
        }
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
        match self.terms.first()?.basis.shape {
            Shape::Sine { cycles } | Shape::Cosine { cycles } => Some(cycles),
            _ => None,
        }
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
        let what = self.located.split(BETWEEN).next().unwrap_or_default();
        other.located = format!("{what}{BETWEEN}{:.0} % of the way from its origin to its foot", 100.0 * to);
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

const BETWEEN: &str = " about a point ";

/// No relation between coefficients is asked for.
#[must_use]
pub fn anything(_: &[f64]) -> bool {
    true
}

/// A family of the catalogue that this data cannot test, and what is missing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Untestable {
    /// Name in the catalogue.
    pub effect: &'static str,
    /// What the recordings lack.
    pub lacks: &'static str,
}

/// What lacks where poses are known in their order alone: steps, steady creep and warming up at an even pace are asked for, no more.
const ORDER_ONLY: &str = "time (t_s): only the order of the poses could be asked";

/// All candidates that this data can be asked about, with priors, and the effects that it cannot test. The prior is uniform over
/// effects, then over sites, then over scan points; of these, effects may hold some for less likely.
#[must_use]
pub fn catalogue(recorded: &Recorded<'_>) -> (Vec<Candidate>, Vec<Untestable>) {
    let mut all = Vec::new();
    let mut untestable = Vec::new();
    for effect in EFFECTS {
        let asked = (effect.ask)(recorded);
        let by_order = asked.candidates.iter().any(|c| c.terms.iter().any(|t| t.basis.of == Variable::Seq));
        let lacks = asked.lacks.or(by_order.then_some(ORDER_ONLY));
        untestable.extend(lacks.map(|lacks| Untestable { effect: effect.name, lacks }));
        let mut list = asked.candidates;
        let mut sites: Vec<(Place, usize)> = Vec::new();
        for c in &list {
            match sites.iter_mut().find(|s| s.0 == c.site) {
                Some((_, scan)) => *scan += 1,
                None => sites.push((c.site, 1)),
            }
        }
        for c in &mut list {
            let scan = sites.iter().find(|s| s.0 == c.site).map_or(1, |s| s.1);
            #[expect(clippy::cast_precision_loss, reason = "counts")]
            let ways = (EFFECTS.len() * sites.len() * scan) as f64;
            c.log_prior -= ways.ln();
        }
        all.append(&mut list);
    }
    (all, untestable)
}

/// Terms that are about the noise of the readings, not about the arm. Where every touch was nulled, what an indicator still
/// reads is mostly its own noise, and believing a share of it is better than believing all; where commanded and read joints
/// differ by noise, a share of that helps likewise. They are fitted with the baseline if they pay, and never named as effects.
#[must_use]
pub fn reading_noise(recorded: &Recorded<'_>) -> Vec<Candidate> {
    let of = |effect, site, located: &str, sign: i8, terms: Vec<(String, Site, Basis)>| Candidate {
        effect,
        site,
        located: located.into(),
        signs: vec![sign; terms.len()],
        physical: anything,
        typical: 0.0,
        scales: vec![0.5; terms.len()],
        log_prior: 0.0,
        terms: terms.into_iter().map(|(name, site, basis)| Term::new(name, effect, site, basis)).collect(),
    };
    let mut out = Vec::new();
    if recorded.touches && recorded.spread == [false; 3] {
        let part = |axis: &Axis| {
            let basis = Basis::new(Variable::Reading { axis: *axis }, Shape::Linear);
            (format!("disbelief_{}", axis.name()), Site::Tool(Motion::Along(*axis)), basis)
        };
        let parts = Axis::ALL.iter().map(part).collect();
        let site = Place::Tool;
        out.push(of("reading_noise", site, "nulled readings are mostly noise", -1, parts));
    }
    if recorded.commanded && !recorded.lags {
        let basis = Basis::new(Variable::Lag { joint: 1 }, Shape::Linear);
        let site = Place::Joints;
        let parts = vec![("belief_in_commanded".into(), Site::AllJoints, basis)];
        out.push(of("joint_reading_noise", site, "read joints are noisier than commanded ones", 1, parts));
    }
    out
}

/// How the device is turned about the last axis: touches that were nulled do not see it, deflected ones do, and a zero of the
/// last joint that is off turns the device. Belongs to the geometry; `None` where all touches were nulled.
#[must_use]
pub fn device_orientation(recorded: &Recorded<'_>) -> Option<Term> {
    let term = || Term::new("device_z", "geometry", Site::Tool(Motion::About(Axis::Z)), Basis::CONSTANT);
    (recorded.spread[0] || recorded.spread[1]).then(term)
}
