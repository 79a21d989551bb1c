//! Names for curves that have none.

use trical_ident::error::Result;

use super::Rounds;
use crate::candidate::Candidate;
use crate::effect_id::Cause;
use crate::linear::Downdate;
use crate::selection::Search;
use crate::settings::NAMED_SHARE;

impl Rounds {
    /// Names a curve that has no name after the effect that says nearly all of it by one number, if that moves the same and depends on the same
    /// variable: a joint that another one moves seldom follows it quite in proportion.
    pub(crate) fn name_curves(&mut self) -> Result<()> {
        for (curve, name) in self.nameable()? {
            let name = self.candidates[name].clone();
            let own = &mut self.candidates[curve];
            for t in &mut own.terms {
                let fitted = self.fitted.model.terms.iter_mut().find(|m| m.does_as(t));
                for t in fitted.into_iter().chain([t]) {
                    name.cause.name().clone_into(&mut t.effect);
                }
            }
            own.behaviour = format!("{}, nearly", name.behaviour);
            (own.cause, own.site, own.log_prior) = (name.cause, name.site, name.log_prior);
        }
        Ok(())
    }

    /// Curves without a name, each with the name that says most of it.
    fn nameable(&self) -> Result<Vec<(usize, usize)>> {
        let is_curve = |c: &usize| self.candidates[*c].cause == Cause::Unexplained;
        let curves: Vec<usize> = self.chosen.iter().copied().filter(is_curve).collect();
        let is_name = |c: &usize| {
            let is_out = self.chosen.contains(c) || self.let_go.contains(c);
            !is_out && curves.iter().any(|curve| may_name(&self.candidates[*c], &self.candidates[*curve]))
        };
        let names: Vec<usize> = (0..self.candidates.len()).filter(is_name).collect();
        if names.is_empty() {
            return Ok(Vec::new());
        }
        let asked = [&self.chosen[..], &names].concat();
        let members = self.members(&asked);
        let chosen: Vec<usize> = (0..self.chosen.len()).collect();
        let design = self.design(&members, &[], self.correlation)?;
        let (search, start) = (Search::new(&design, &members, self.temper()), design.start());
        let downdate = Downdate::new(&design, &start, &chosen);
        let name = |curve: &usize| {
            let own = &members[*curve];
            let without = search.without(&downdate, &start, &[*curve]).state;
            let least = NAMED_SHARE * (without.ss - downdate.full().ss);
            let names = search.rank(&without).into_iter();
            let names = names.filter(|r| may_name(&members[r.candidate], own) && r.dss >= least);
            names.max_by(|a, b| a.evidence.total_cmp(&b.evidence)).map(|r| (asked[*curve], asked[r.candidate]))
        };
        Ok(chosen.iter().filter(|k| curves.contains(&asked[**k])).filter_map(name).collect())
    }
}

/// Whether a candidate is an effect of one number (with several it would be a curve itself) that moves the same as a curve, by the same
/// variable alone.
fn may_name(c: &Candidate, curve: &Candidate) -> bool {
    let [one] = &c.terms[..] else { return false };
    c.cause.effect().is_some()
        && curve.terms.iter().all(|t| t.site == one.site && t.basis.beside.is_none())
        && (c.over(), c.session()) == (curve.over(), curve.session())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use trical_model::{Basis, Beside, Place, Shape, Variable};

    use super::*;
    use crate::effect_id::EffectId;
    use crate::options::Options;
    use crate::test_data::{off, with_joints};

    const Q4: Variable = Variable::Joint { joint: 4 };

    /// What the best curve of joint 5 over the angle of joint 4 is called, chosen alone, and terms of its name in the model, where this is hidden.
    fn named(hidden: &[(Shape, f64)]) -> (Candidate, usize) {
        let hidden: Vec<_> = hidden.iter().map(|(shape, size)| (5, Basis::new(Q4, *shape), *size)).collect();
        let (truth, data) = with_joints(&hidden);
        let mut rounds = Rounds::begin(&truth.robot, &truth.cell, &data, &Options::default()).unwrap();
        let curve = {
            let design = rounds.design(&rounds.searched(), &[], rounds.correlation).unwrap();
            let is_curve =
                |c: &Candidate| (c.cause, c.site, c.over()) == (Cause::Unexplained, Place::Joint(5), Some((Q4, None)));
            let ranked = rounds.searcher(&design).rank(&design.start());
            ranked.iter().map(|r| r.candidate).find(|c| is_curve(&rounds.candidates[*c])).unwrap()
        };
        rounds.chosen = vec![curve];
        rounds.refit().unwrap();
        rounds.name_curves().unwrap();
        let own = rounds.candidates[curve].clone();
        let fitted = rounds.fitted.model.terms.iter().filter(|m| own.terms.iter().any(|t| t.does_as(m))).count();
        assert_eq!(fitted, own.terms.len());
        let called = rounds.fitted.model.terms.iter().filter(|t| t.effect == EffectId::JointCoupling.name()).count();
        (own, called)
    }

    #[test]
    fn a_curve_gets_the_name_that_says_nearly_all_of_it() {
        let (own, called) = named(&[(Shape::Linear, 3e-4), (Shape::Growth { from: -1.2, to: 1.4 }, 1.5e-4)]);
        assert_eq!((own.cause, own.site), (EffectId::JointCoupling.into(), Place::Coupling { joint: 5, from: 4 }));
        assert_eq!(own.behaviour, "joint 5 moves in proportion to joint 4's angle, nearly");
        assert_eq!(called, own.terms.len());
    }

    #[test]
    fn a_name_of_a_curve_has_one_number_and_moves_the_same_by_the_same_variable() {
        let name = |joint| off(EffectId::GearRatio.into(), joint, Shape::Linear);
        let curve = off(Cause::Unexplained, 2, Shape::Hinge { at: 0.3 });
        let (mut two, mut by_q4) = (name(2), name(2));
        two.terms.extend(name(2).terms);
        by_q4.terms[0].basis.of = Q4;
        assert!(may_name(&name(2), &curve));
        for other in [two, by_q4, name(3), name(2).in_session(1), curve.clone()] {
            assert!(!may_name(&other, &curve), "{other:?}");
        }
        let mut of_two_angles = curve;
        of_two_angles.terms[0].basis.beside = Some(Beside { joint: 4, shape: Shape::Sine { cycles: 1.0 } });
        assert!(!may_name(&name(2), &of_two_angles));
    }

    #[test]
    fn a_curve_that_begins_well_within_the_range_keeps_none() {
        // joint 4 was between -1.4 and 1.4 rad
        let called = |at| named(&[(Shape::Hinge { at }, 4e-4)]).0.cause;
        assert_eq!(called(-1.2), EffectId::JointCoupling.into());
        assert_eq!([-0.8, 0.1].map(called), [Cause::Unexplained; 2]);
    }
}
