//! Rows that were rejected and are none to reject.

use trical_ident::dataset::Dataset;
use trical_ident::error::Result;

use super::Rounds;
use crate::rejection;
use crate::settings::{EVIDENCE_NATS, ROWS_ALIKE};

impl Rounds {
    /// What looked like gross errors before anything was known of the arm may be what was found since: rows that it explains are searched with the
    /// others, and may still be outliers. Whether there were any.
    pub(crate) fn take_back_rows(&mut self) -> Result<bool> {
        let explained = rejection::explained(&self.fitted, &self.bare(), &self.gross)?;
        if explained.is_empty() || self.whole.is_some() {
            return Ok(false);
        }
        let back = |row: usize| explained.contains(&row);
        let with_them = |some: &Dataset| {
            let mut some = some.clone();
            some.observations.extend(self.gross.observations.iter().filter(|o| back(o.row)));
            some.observations.sort_by_key(|o| o.row);
            some.rejected.retain(|r| !back(r.row));
            some
        };
        let (all, kept) = (with_them(&self.all), with_them(&self.kept));
        let before = std::mem::replace(&mut self.kept, kept);
        // what they say counts before it is asked again which rows are outliers
        if self.refit().is_err() {
            self.kept = before;
            return Ok(false);
        }
        self.all = all;
        self.gross.observations.retain(|o| !back(o.row));
        Ok(true)
    }

    /// Rows that are off alike at one place are no outliers: if one number more explains several of those that were rejected, they are.
    /// Whether that was so.
    pub(crate) fn restore_rows(&mut self) -> Result<bool> {
        let rejected = |rounds: &Self| rounds.all.observations.len() - rounds.kept.observations.len();
        let before = rejected(self);
        if before < ROWS_ALIKE {
            return Ok(false);
        }
        let (round, kept) = (self.round(), std::mem::replace(&mut self.kept, self.all.clone()));
        let best = {
            let design = self.design(&self.searched(), &[], self.correlation)?;
            let search = self.searcher(&design);
            let state = search.with(&design.start(), &self.chosen);
            let lean = |c: usize| self.candidates[c].terms.len() == 1 && !self.chosen.contains(&c);
            search.rank(&state).into_iter().find(|r| lean(r.candidate) && r.evidence > EVIDENCE_NATS)
        };
        if let Some(best) = best {
            self.chosen.push(best.candidate);
            if self.refit().is_ok() {
                self.kept = rejection::without_outliers(&self.fitted, &self.all)?;
                if rejected(self) + ROWS_ALIKE <= before && self.refit().is_ok() {
                    return Ok(true);
                }
            }
        }
        self.kept = kept;
        self.go_back(round);
        Ok(false)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use trical_ident::dataset::Observation;
    use trical_model::{Basis, Measured, Place, Shape, Variable};

    use super::*;
    use crate::candidate::Candidate;
    use crate::effect_id::EffectId;
    use crate::options::Options;
    use crate::test_data::with_joint_2;

    #[test]
    fn rows_that_looked_like_gross_errors_come_back_when_what_was_found_explains_them_and_others_do_not() {
        let ratio = Basis::new(Variable::Joint { joint: 2 }, Shape::Linear);
        let (truth, mut data) = with_joint_2(&[(ratio, 2e-3)]);
        if let Measured::Touch { reading, .. } = &mut data.observations[40].measured {
            reading[0] += 5e-3;
        }
        let mut rounds = Rounds::begin(&truth.robot, &truth.cell, &data, &Options::default()).unwrap();
        assert_eq!(rounds.gross.observations.len(), 1);
        // as if the far end of the joint had been taken for errors as well
        let is_far = |o: &Observation| o.state.q[1] > 0.9;
        let far: Vec<Observation> = rounds.all.observations.iter().filter(|o| is_far(o)).copied().collect();
        let count = far.len();
        rounds.gross.observations.extend(far);
        rounds.all.observations.retain(|o| !is_far(o));
        rounds.kept = rounds.all.clone();
        let is_ratio = |c: &Candidate| c.cause == EffectId::GearRatio.into() && c.site == Place::Joint(2);
        rounds.chosen = vec![rounds.candidates.iter().position(is_ratio).unwrap()];
        rounds.refit().unwrap();
        assert!(rounds.take_back_rows().unwrap());
        assert_eq!([rounds.gross.observations.len(), rounds.all.observations.len()], [1, 199]);
        assert!(count > 5 && rounds.kept.observations.is_sorted_by_key(|o| o.row));
    }
}
