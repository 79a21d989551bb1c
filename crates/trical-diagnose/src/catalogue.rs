//! What can be tried on a data set: candidates of all effects with their priors, and terms about the readings' own noise.

use trical_model::{Axis, Basis, Motion, Place, Scope, Shape, Site, Term, Variable};

use crate::candidate::{Candidate, Physical};
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
/// session is asked of each of the `sessions` by itself. What else is no property of the arm (a load, the gauge, how joints were read, warmth) is
/// asked of all of them and of each: it may be so on every day or on one. Without any sessions all is asked of all the data.
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
                let of_a_day = |c: &Candidate| c.is_course() || (sessions.len() > 1 && effect.scope != Scope::Arm);
                let here = (effect.ask)(own).candidates.into_iter().filter(of_a_day);
                list.extend(here.map(|c| c.in_session(*session)));
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
            let ways = (EFFECTS.len() * sites.len() * scan) as f64;
            c.log_prior -= libm::log(ways);
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
        physical: Physical::default(),
        typical: 0.0,
        scales: vec![0.5; terms.len()],
        log_prior: 0.0,
        terms: terms.into_iter().map(|(name, site, basis)| Term::new(name, cause.name(), site, basis)).collect(),
    };
    let mut out = Vec::new();
    if recorded.nulled {
        let part = |axis: &Axis| {
            let basis = Basis::new(Variable::Reading { axis: *axis }, Shape::Linear);
            (format!("reading_noise_{}", axis.name()), Site::Tool(Motion::Along(*axis)), basis)
        };
        let parts = Axis::ALL.iter().map(part).collect();
        let site = Place::Tool;
        out.push(of(
            Cause::ReadingNoise,
            site,
            "the small readings left on the gauge are mostly noise of the gauge",
            -1,
            parts,
        ));
    }
    if recorded.commanded && !recorded.lags {
        let basis = Basis::new(Variable::Lag { joint: 1 }, Shape::Linear);
        let site = Place::Joints;
        let parts = vec![("joint_reading_noise".into(), Site::AllJoints, basis)];
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

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::test_data::{arm, states};
    use trical_model::State;

    fn joints(k: f64) -> State {
        State::at(&[0.1 * k])
    }

    #[test]
    fn every_effect_is_as_likely_as_another_and_so_are_its_places() {
        let (model, data) = (arm(), states(9, joints));
        let all = catalogue(&Covariates::new(&model, &data, 1e-5), &[]).0;
        let likely =
            |of: &dyn Fn(&Candidate) -> bool| all.iter().filter(|c| of(c)).map(|c| c.log_prior.exp()).sum::<f64>();
        let one = 1.0 / EFFECTS.len() as f64;
        for id in [EffectId::GearRatio, EffectId::AxisWobble, EffectId::JointHarmonic] {
            let together = likely(&|c| c.cause == id.into());
            let at_joint_2 = likely(&|c| c.cause == id.into() && c.site == Place::Joint(2));
            assert!(
                (together - one).abs() < 1e-12 && (at_joint_2 - one / 6.0).abs() < 1e-12,
                "{id}: {together} {at_joint_2}"
            );
        }
    }

    #[test]
    fn what_goes_with_time_is_asked_of_each_session_and_of_none_without_an_order() {
        let (model, data) = (arm(), states(40, |k| State { t: Some(20.0 * k), ..joints(k) }));
        let r = || Covariates::new(&model, &data, 1e-5);
        let count = |sessions: &[(u32, Covariates<'_>)], of: Option<u32>| {
            let all = catalogue(&r(), sessions).0;
            all.iter().filter(|c| c.is_course() && c.session() == of).count()
        };
        let alone = count(&[], None);
        assert!(alone > 0);
        let two = [(1, r()), (2, r())];
        assert_eq!([count(&two, None), count(&two, Some(1)), count(&two, Some(2))], [0, alone, alone]);
        // warmth and loads are so on every day, or on one; what belongs to the arm is on all
        let warm = states(40, |k| State { t: Some(20.0 * k), temp_c: Some(20.0 + 0.1 * k), ..joints(k) });
        let r = || Covariates::new(&model, &warm, 1e-5);
        let of_session = |id: EffectId, sessions: &[(u32, Covariates<'_>)]| -> BTreeSet<Option<u32>> {
            let all = catalogue(&r(), sessions).0;
            all.iter().filter(|c| c.cause == id.into()).map(Candidate::session).collect()
        };
        for id in [EffectId::ThermalGrowth, EffectId::Payload] {
            assert_eq!(of_session(id, &[(1, r()), (2, r())]), [None, Some(1), Some(2)].into(), "{id}");
            assert_eq!(of_session(id, &[(1, r())]), [None].into(), "{id}");
        }
        assert_eq!(of_session(EffectId::GearRatio, &[(1, r()), (2, r())]), [None].into());
        let (_, untestable) = catalogue(&Covariates::new(&model, &states(40, joints), 1e-5), &[]);
        let lacks = |id| untestable.iter().find(|u| u.effect == id).map(|u| u.lacks);
        assert!(lacks(EffectId::JointZeroShift).is_some_and(|l| l.starts_with("time (t_s)")));
        assert_eq!(lacks(EffectId::GearRatio), None);
    }

    #[test]
    fn readings_are_taken_for_noise_where_each_touch_was_nulled_and_the_device_turns_where_none_was() {
        let (model, data) = (arm(), states(9, joints));
        let mut r = Covariates::new(&model, &data, 1e-5);
        assert_eq!(reading_noise(&r).iter().map(|c| c.cause).collect::<Vec<_>>(), [Cause::ReadingNoise]);
        assert!(device_orientation(&r).is_none());
        (r.spread, r.nulled) = ([false, true, false], false);
        assert!(reading_noise(&r).is_empty());
        assert_eq!(device_orientation(&r).map(|t| t.site), Some(Site::Tool(Motion::About(Axis::Z))));
        r.spread = [false, false, true];
        assert!(device_orientation(&r).is_none(), "along the axis nothing turns");
        r.commanded = true;
        assert_eq!(reading_noise(&r).iter().map(|c| c.cause).collect::<Vec<_>>(), [Cause::JointReadingNoise]);
        r.lags = true;
        assert!(reading_noise(&r).is_empty());
    }
}
