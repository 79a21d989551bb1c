//! What the exact fit finds at sizes that cannot be.

use trical_ident::error::Result;
use trical_ident::model_file::moved;
use trical_model::{Scope, Term};

use super::Rounds;
use crate::settings::MOST_INFLATION;

impl Rounds {
    /// Lets go of what the exact fit has at sizes that are no physics, although the linear picture had not, and of what moves too much in the course
    /// of the sessions: it is asked about no more.
    pub(super) fn let_go_of_impossible(&mut self) -> Result<()> {
        let fitted = &self.fitted.model.terms[self.baseline_terms..];
        let value = |t: &Term| fitted.iter().find(|m| m.does_as(t)).map_or(0.0, |m| m.value);
        let is_physics = |c: &usize| {
            let own = &self.candidates[*c];
            own.physical.allows(&own.terms.iter().map(value).collect::<Vec<_>>())
        };
        let mut go: Vec<usize> = self.chosen.iter().copied().filter(|c| !is_physics(c)).collect();
        if go.is_empty() {
            go.extend(self.moves_too_much()?);
        }
        if go.is_empty() {
            return Ok(());
        }
        self.chosen.retain(|c| !go.contains(c));
        self.let_go.extend(go);
        self.refit()?;
        self.let_go_of_impossible()
    }

    /// What moves most in the course of the sessions, where all of that moves measurements by much more than the plain model errs: without it the arm's own
    /// parameters say nearly all of it, and with it they undo it, so that in another session they would be wrong by as much.
    fn moves_too_much(&self) -> Result<Option<usize>> {
        let of_course = |c: &usize| {
            let own = &self.candidates[*c];
            own.terms.iter().any(|t| t.scope() == Scope::Course) && !own.is_of_whole_session()
        };
        let course: Vec<usize> = self.chosen.iter().copied().filter(of_course).collect();
        let by = |set: &[usize]| -> Result<f64> {
            let terms = || set.iter().flat_map(|c| &self.candidates[*c].terms);
            Ok(moved(&self.fitted.model, &self.fitted.data, &|t| terms().any(|own| own.does_as(t)))?.about_middle)
        };
        if course.is_empty() || by(&course)? <= MOST_INFLATION.sqrt() * self.plain {
            return Ok(None);
        }
        let each = course.iter().map(|c| Ok((by(&[*c])?, *c))).collect::<Result<Vec<_>>>()?;
        Ok(each.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, c)| c))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use trical_model::{Basis, Place, Shape, Variable};

    use super::*;
    use crate::effect_id::EffectId;
    use crate::options::Options;
    use crate::test_data::with_joint_2;

    #[test]
    fn a_jump_that_moves_much_more_than_the_plain_model_errs_is_let_go_and_asked_no_more() {
        let jump = Basis::new(Variable::Seq, Shape::Step { at: 100.0 });
        let (truth, data) = with_joint_2(&[(jump, 1e-3)]);
        let mut rounds = Rounds::begin(&truth.robot, &truth.cell, &data, &Options::default()).unwrap();
        let is_jump =
            |c: &crate::candidate::Candidate| c.cause == EffectId::JointZeroShift.into() && c.site == Place::Joint(2);
        let jump = rounds.candidates.iter().position(is_jump).unwrap();
        rounds.chosen = vec![jump];
        rounds.refit().unwrap();
        rounds.let_go_of_impossible().unwrap();
        assert_eq!(rounds.chosen, [jump]);
        // a plain model that errs by a third of what it moves says most of it, too
        rounds.plain =
            moved(&rounds.fitted.model, &rounds.fitted.data, &|t| t.effect == "joint_zero_shift").unwrap().about_middle
                / 3.0;
        rounds.let_go_of_impossible().unwrap();
        assert!(rounds.chosen.is_empty());
        assert!(rounds.searched()[jump].terms.is_empty());
    }
}
