//! What can be tried on a data set: candidates of all effects with their priors, and terms about the readings' own noise.

use trical_model::{Axis, Basis, Motion, Place, Shape, Site, Term, Variable};

use crate::candidate::{Candidate, anything};
use crate::covariates::Covariates;
use crate::effect_id::{Cause, EffectId};
use crate::effects::EFFECTS;

/// A family of the catalogue that this data cannot test, and what is missing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Untestable {
    /// Which.
    pub effect: EffectId,
    /// What the recordings lack.
    pub lacks: &'static str,
}

/// What lacks where poses are known in their order alone: steps, steady creep and warming up at an even pace are asked for, no more.
const ORDER_ONLY: &str = "time (t_s): only the order of the poses could be asked";

/// All candidates that this data can be asked about, with priors, and the effects that it cannot test. The prior is uniform over
/// effects, then over sites, then over scan points; of these, effects may hold some for less likely. What happens in the course of a
/// session is asked of each of the `sessions` by itself; without any, of all the data at once.
#[must_use]
pub fn catalogue(recorded: &Covariates<'_>, sessions: &[(u32, Covariates<'_>)]) -> (Vec<Candidate>, Vec<Untestable>) {
    let mut all = Vec::new();
    let mut untestable = Vec::new();
    for effect in EFFECTS {
        let asked = (effect.ask)(recorded);
        let by_order = asked.candidates.iter().any(|c| c.terms.iter().any(|t| t.basis.of == Variable::Seq));
        let lacks = asked.lacks.or(by_order.then_some(ORDER_ONLY));
        untestable.extend(lacks.map(|lacks| Untestable { effect: effect.id, lacks }));
        let mut list = asked.candidates;
        if !sessions.is_empty() {
            list.retain(|c| !c.is_course());
            for (session, own) in sessions {
                let course = (effect.ask)(own).candidates.into_iter().filter(Candidate::is_course);
                list.extend(course.map(|c| c.in_session(*session)));
            }
        }
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
/// reads is mostly its own noise, and taking a share of it is better than taking all; where commanded and read joints
/// differ by noise, a share of that helps likewise. They are fitted with the baseline if they pay, and never named as effects.
#[must_use]
pub fn reading_noise(recorded: &Covariates<'_>) -> Vec<Candidate> {
    let of = |cause: Cause, site, behaviour: &str, sign: i8, terms: Vec<(String, Site, Basis)>| Candidate {
        cause,
        site,
        behaviour: behaviour.into(),
        signs: vec![sign; terms.len()],
        physical: anything,
        typical: 0.0,
        scales: vec![0.5; terms.len()],
        log_prior: 0.0,
        terms: terms.into_iter().map(|(name, site, basis)| Term::new(name, cause.name(), site, basis)).collect(),
    };
    let mut out = Vec::new();
    if recorded.touches && recorded.spread == [false; 3] {
        let part = |axis: &Axis| {
            let basis = Basis::new(Variable::Reading { axis: *axis }, Shape::Linear);
            (format!("disbelief_{}", axis.name()), Site::Tool(Motion::Along(*axis)), basis)
        };
        let parts = Axis::ALL.iter().map(part).collect();
        let site = Place::Tool;
        out.push(of(Cause::ReadingNoise, site, "nulled readings are mostly noise", -1, parts));
    }
    if recorded.commanded && !recorded.lags {
        let basis = Basis::new(Variable::Lag { joint: 1 }, Shape::Linear);
        let site = Place::Joints;
        let parts = vec![("belief_in_commanded".into(), Site::AllJoints, basis)];
        out.push(of(Cause::JointReadingNoise, site, "read joints are noisier than commanded ones", 1, parts));
    }
    out
}

/// How the device is turned about the last axis: touches that were nulled do not see it, deflected ones do, and a zero of the
/// last joint that is off turns the device. Belongs to the geometry; `None` where all touches were nulled.
#[must_use]
pub fn device_orientation(recorded: &Covariates<'_>) -> Option<Term> {
    let term = || Term::new("device_z", "geometry", Site::Tool(Motion::About(Axis::Z)), Basis::CONSTANT);
    (recorded.spread[0] || recorded.spread[1]).then(term)
}
