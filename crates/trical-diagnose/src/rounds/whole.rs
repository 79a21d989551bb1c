//! Recordings of many poses: effects are searched among a sample, and what was found is fitted to all.

use std::collections::BTreeSet;

use trical_ident::error::Result;
use trical_ident::fit::identify::ErrorSummary;
use trical_ident::fit::residuals::position_errors;
use trical_model::{Forward, Model};

use super::Rounds;
use crate::rejection;

/// What was found among a sample of the poses says this of the others.
pub(crate) struct Unsearched {
    /// How many were searched, of how many.
    pub poses: [usize; 2],
    /// Errors at the others by the plain model, and with what was found.
    pub plain: ErrorSummary,
    pub found: ErrorSummary,
}

impl std::fmt::Display for Unsearched {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { poses: [searched, of], plain, found } = self;
        write!(
            f,
            "effects were searched among {searched} of the {of} poses, and the model was then fitted to all; at the others, the fit to those \
             {searched} is off by {:.3} mm (mean), the plain model by {:.3} mm",
            found.mean_mm, plain.mean_mm
        )
    }
}

impl Rounds {
    /// Fits what was chosen among a sample to the whole data, and says what the sample alone says of the poses that are not in it. `None` where
    /// all were searched.
    pub(crate) fn fit_whole(&mut self, baseline: &Model) -> Result<Option<Unsearched>> {
        let Some(whole) = self.whole.take() else { return Ok(None) };
        let kept = rejection::without_outliers(&self.fitted, &whole)?;
        let searched: BTreeSet<usize> = self.kept.used_poses().into_iter().collect();
        let others = kept.filtered(|o| !searched.contains(&o.pose));
        let errors = |model: &Model| -> Result<ErrorSummary> {
            Ok(ErrorSummary::of(&position_errors(&Forward::new(model.clone(), Vec::new())?, &others)))
        };
        let unsearched = Unsearched {
            poses: [searched.len(), kept.used_poses().len()],
            plain: errors(baseline)?,
            found: errors(&self.fitted.model)?,
        };
        let some = std::mem::replace(&mut self.kept, kept);
        let fitted = self.refit();
        self.kept = some;
        fitted.map(|()| Some(unsearched))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use trical_model::{Basis, Shape, Site, Term, Variable};

    use super::*;
    use crate::candidate::Candidate;
    use crate::effect_id::EffectId;
    use crate::options::Options;
    use crate::settings::{RUN_POSES, SEARCHED_POSES};
    use crate::test_data::{arm, touched};

    #[test]
    fn of_many_poses_a_sample_is_searched_and_all_are_fitted() {
        let wave = Basis::new(Variable::Joint { joint: 2 }, Shape::Sine { cycles: 3.0 });
        let mut truth = arm();
        truth.terms.push(Term { value: 1e-3, ..Term::new("hidden", "hidden", Site::Joint { joint: 2 }, wave) });
        let many = SEARCHED_POSES + 900;
        let data = touched(&truth, u32::try_from(many).unwrap());
        let mut rounds = Rounds::begin(&truth.robot, &truth.cell, &data, &Options::default()).unwrap();
        let searched = rounds.kept.used_poses().len();
        assert!((SEARCHED_POSES..SEARCHED_POSES + RUN_POSES).contains(&searched));
        let plain = rounds.fitted.model.clone();
        let is_wave = |c: &Candidate| c.cause == EffectId::JointHarmonic.into() && c.terms[0].basis == wave;
        rounds.chosen = vec![rounds.candidates.iter().position(is_wave).unwrap()];
        rounds.refit().unwrap();
        let others = rounds.fit_whole(&plain).unwrap().unwrap();
        assert_eq!(others.poses, [searched, many]);
        assert!(others.plain.mean_mm > 0.05 && others.found.mean_mm < 1e-3, "{others}");
        // what follows is proved on the sample
        assert_eq!([&rounds.fitted.data, &rounds.kept].map(|d| d.used_poses().len()), [many, searched]);
        assert!(rounds.fit_whole(&plain).unwrap().is_none());
    }
}
