//! What the arm is like in sessions and at places that a fit did not see.

use std::collections::BTreeSet;

use trical_ident::calibration::by_place::score_places;
use trical_ident::calibration::score_sessions;
use trical_ident::dataset::Dataset;
use trical_ident::error::Result;
use trical_ident::fit::identify::{ErrorSummary, Fit, Identified, fit_near_nominal};
use trical_ident::fit::priors::PriorKnowledge;
use trical_model::{Basis, Forward, Model, Site, Term};

use super::Rounds;

impl Rounds {
    /// Errors of each session by the arm that the others say, by the plain model and with what was chosen; `None` for one session.
    ///
    /// # Errors
    /// Sessions that do not determine the arm without one of them.
    pub(crate) fn by_session(&self) -> Result<[Option<ErrorSummary>; 2]> {
        if self.kept.names.len() < 2 {
            return Ok([None; 2]);
        }
        self.plain_and_whole(&|fit| score_sessions(&self.kept, fit))
    }

    /// The same of each place of the balls; `None` where none is unknown.
    ///
    /// # Errors
    /// Places that do not determine the arm without one of them.
    pub(crate) fn by_place(&self) -> Result<[Option<ErrorSummary>; 2]> {
        self.plain_and_whole(&|fit| Ok(score_places(&self.fitted.model.cell, &self.kept, fit)?.errors))
    }

    /// What is said of errors by fits to some of the data, of the plain model and with what was chosen.
    fn plain_and_whole(&self, score: &dyn Fn(Fit<'_>) -> Result<Vec<f64>>) -> Result<[Option<ErrorSummary>; 2]> {
        let of = |terms: usize| -> Result<Option<ErrorSummary>> {
            let errors = score(&|data: &Dataset| self.fit_of_some(data, terms))?;
            Ok((!errors.is_empty()).then(|| ErrorSummary::of(&errors)))
        };
        Ok([of(self.baseline_terms)?, of(self.fitted.model.terms.len())?])
    }

    /// The fit of some of the sessions or places, with those of the first `terms` that act there.
    fn fit_of_some(&self, data: &Dataset, terms: usize) -> Result<Identified> {
        let mut model = self.fitted.model.clone();
        model.terms.truncate(terms);
        let forward = Forward::new(model.clone(), (0..model.terms.len()).collect())?;
        let (mut ws, p) = (forward.workspace(), model.terms.len());
        let mut jacobian = vec![0.0; 6 * p];
        let mut acts = vec![false; p];
        for o in &data.observations {
            let rows = forward.linearize(&o.state, &o.measured, o.frame, &mut ws, &mut jacobian);
            for (k, acts) in acts.iter_mut().enumerate() {
                *acts |= (0..rows).any(|row| jacobian[row * p + k] != 0.0);
            }
        }
        // without balls or anchors, measuring frames take up where the base stands
        let optical = data.observations.iter().all(|o| o.measured.is_framed());
        let kept: Vec<bool> = model
            .terms
            .iter()
            .zip(acts)
            .map(|(t, acts)| {
                acts && !(optical && matches!(t.site, Site::Base(_))) && !stands_for_shared(t, &model, data)
            })
            .collect();
        let mut at = kept.iter();
        model.terms.retain(|_| at.next().copied().unwrap_or(false));
        let known: Vec<PriorKnowledge> =
            self.known.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(k, _)| *k).collect();
        fit_near_nominal(&model, data, &self.kept, &self.fitted.noise, &known, Vec::new(), &self.params)
    }
}

/// Whether a term is the own tool (or balls) of the first of these sessions, while each of them has its own: what is shared stands for the
/// first one's then.
fn stands_for_shared(t: &Term, model: &Model, data: &Dataset) -> bool {
    let of_balls = |t: &Term| matches!(t.site, Site::Fixture(_));
    let is_own = |t: &Term, session: u32| {
        t.basis == Basis::CONSTANT.in_session(session)
            && matches!(t.site, Site::Tool(_) | Site::Target { .. } | Site::Fixture(_))
    };
    let sessions: BTreeSet<u32> = data.observations.iter().filter_map(|o| o.state.session).collect();
    let all_own =
        || sessions.iter().all(|s| model.terms.iter().any(|other| is_own(other, *s) && of_balls(other) == of_balls(t)));
    sessions.first().is_some_and(|first| is_own(t, *first) && all_own())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use trical_ident::JointSource;
    use trical_model::{Axis, Motion, Place, Recording, Shape, State, Variable};

    use super::*;
    use crate::effect_id::EffectId;
    use crate::options::Options;
    use crate::test_data::{arm, recorded, touches, with_joint_2};

    #[test]
    fn an_arm_is_better_in_sessions_that_it_was_not_fitted_to_with_what_was_found_and_one_session_says_nothing() {
        let linear = Basis::new(Variable::Joint { joint: 2 }, Shape::Linear);
        let (truth, data) = with_joint_2(&[(linear, 2e-3)]);
        let whole = recorded(&data);
        let of = |recordings: &[Recording]| {
            let data = Dataset::build(recordings, JointSource::Read, None).unwrap();
            let mut rounds = Rounds::begin(&truth.robot, &truth.cell, &data, &Options::default()).unwrap();
            let is_ratio =
                |c: &crate::candidate::Candidate| c.cause == EffectId::GearRatio.into() && c.site == Place::Joint(2);
            rounds.chosen = vec![rounds.candidates.iter().position(is_ratio).unwrap()];
            rounds.refit().unwrap();
            (rounds.by_session().unwrap(), rounds.by_place().unwrap())
        };
        assert!(matches!(of(std::slice::from_ref(&whole)), ([None, None], [None, None])));
        let (first, second) = whole.rows.split_at(100);
        let session = |name: &str, rows: &[trical_model::Row]| Recording {
            name: name.into(),
            rows: rows.to_vec(),
            ..whole.clone()
        };
        let (of_sessions, of_places) = of(&[session("a", first), session("b", second)]);
        assert!(of_places.iter().all(Option::is_none), "the balls stand where the cell says");
        let [plain, found] = of_sessions.map(Option::unwrap);
        assert!(found.mean_mm < 0.2 * plain.mean_mm && found.mean_mm < 0.03, "{} {}", found.mean_mm, plain.mean_mm);
    }

    #[test]
    fn the_first_sessions_own_tool_is_what_all_have_where_each_has_its_own() {
        let own = |motion, session| Term::new("own", "own", Site::Tool(motion), Basis::CONSTANT.in_session(session));
        let x = Motion::Along(Axis::X);
        let mut model = arm();
        model.terms = vec![own(x, 1), own(x, 2)];
        let stands = |term: usize, sessions: usize| {
            let one = |k: usize| vec![(State::at(&[0.1 * k as f64; 6]), [0.0; 3])];
            let data = touches(&(0..sessions).map(one).collect::<Vec<_>>());
            stands_for_shared(&model.terms[term], &model, &data)
        };
        assert!(stands(0, 2) && !stands(1, 2));
        // the third has the shared one
        assert!(!stands(0, 3));
    }
}
