//! Touches that would decide between the least sure finding of a diagnosis and its rivals.

use serde_json::{Value, json};
use trical_diagnose::Undecided;
use trical_model::{Cell, Robot, Task};
use trical_plan::{Next, PlanOptions, Question, plan_to_discriminate};

use crate::error::Result;

/// Candidates at each ball from which they are chosen.
const POOL: usize = 150;

/// Plans `count` of them.
///
/// # Errors
/// Where the arm can touch no ball of this cell, or there is no way to one.
pub fn plan_next(robot: &Robot, cell: &Cell, undecided: &Undecided<'_>, count: usize, task: &Task<'_>) -> Result<Next> {
    let rivals = undecided.forwards()?;
    let question = Question {
        rivals: &rivals,
        information: &undecided.information,
        sigma: undecided.sigma,
        state: &undecided.state,
    };
    let options = PlanOptions { pool_per_ball: POOL, noise_m: undecided.sigma, ..PlanOptions::default() };
    Ok(plan_to_discriminate(robot, cell, &options, &question, count, task)?)
}

/// What they would decide, as JSON.
#[must_use]
pub fn json_of(undecided: &Undecided<'_>, next: &Next) -> Value {
    json!({
        "effect": undecided.finding.effect,
        "site": undecided.finding.site,
        "explanations": undecided.names,
        "lambda": next.lambda,
        "random_lambda": next.random_lambda,
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use trical_diagnose::Finding;
    use trical_model::{Axis, Basis, Forward, Measured, Model, Motion, Place, Shape, Site, State, Term, Variable};

    use super::*;
    use crate::test_data::{arm, diagnosis};

    const SIGMA: f64 = 2e-5;

    /// The finding, a gap at joint 3.
    fn finding() -> Finding {
        diagnosis().findings.into_iter().find(|f| f.site == Place::Joint(3)).unwrap()
    }

    /// Whether joint 3 has a gap or its zero creeps, an hour after the beginning. All else is known but the height of the base:
    /// that as well as `height` touches tell it.
    fn undecided(finding: &Finding, height: f64) -> Undecided<'_> {
        let of = |basis, value| {
            let mut model = arm();
            model.terms = vec![
                Term::new("height", "base", Site::Base(Motion::Along(Axis::Z)), Basis::CONSTANT),
                Term { value, ..Term::new("own", "own", Site::Joint { joint: 3 }, basis) },
            ];
            model
        };
        Undecided {
            finding,
            names: vec!["a gap at joint 3".into(), "a zero that creeps at joint 3".into()],
            models: vec![of(Basis::direction(3), -3e-4), of(Basis::new(Variable::Time, Shape::Linear), 1e-7)],
            shared: vec![0],
            information: vec![height / (SIGMA * SIGMA)],
            sigma: SIGMA,
            state: State { t: Some(3600.0), ..State::at(&[]) },
        }
    }

    fn planned(undecided: &Undecided<'_>, count: usize) -> Result<Next> {
        let Model { robot, cell, .. } = arm();
        plan_next(&robot, &cell, undecided, count, &Task::silent())
    }

    /// How far apart two explanations are over all touches, in units of the noise: the height takes up a part of the mean by which
    /// they differ in z.
    fn apart(undecided: &Undecided<'_>, next: &Next, height: f64) -> f64 {
        let mut sums = [0.0; 2];
        for e in &next.entries {
            let state = State { q: e.joints, dir: Some(e.senses()), t: Some(3600.0), ..State::at(&[]) };
            let tip = |model: &Model| {
                let forward = Forward::new(model.clone(), Vec::new()).unwrap();
                let mut ws = forward.workspace();
                forward.residual(&state, &Measured::Touch { ball: e.ball, reading: [0.0; 3] }, 0, &mut ws);
                nalgebra::Vector3::from_column_slice(&ws.residual()[..3])
            };
            let d = (tip(&undecided.models[0]) - tip(&undecided.models[1])) / SIGMA;
            sums[0] += d.norm_squared();
            sums[1] += d.z;
        }
        (sums[0] - sums[1].powi(2) / (next.entries.len() as f64 + height)).sqrt()
    }

    #[test]
    fn touches_set_the_explanations_as_far_apart_as_what_each_predicts_for_them() {
        let finding = finding();
        for height in [0.0, 5.0, 1e9] {
            let undecided = undecided(&finding, height);
            let next = planned(&undecided, 7).unwrap();
            let apart = apart(&undecided, &next, height);
            assert_eq!((next.entries.len(), next.pairs.len()), (7, 1));
            assert!((next.lambda / apart - 1.0).abs() < 1e-3, "{} {apart}", next.lambda);
            // chosen from many
            assert!(next.lambda > 1.2 * next.random_lambda && next.random_lambda > 0.0, "{}", next.random_lambda);
        }
    }

    #[test]
    fn explanations_that_say_the_same_are_not_set_apart() {
        let finding = finding();
        let mut undecided = undecided(&finding, 5.0);
        undecided.models[1] = undecided.models[0].clone();
        let next = planned(&undecided, 4).unwrap();
        assert_eq!((next.entries.len(), next.lambda, next.random_lambda), (4, 0.0, 0.0));
    }

    #[test]
    fn whoever_asks_for_too_much_is_told_how_much_there_is() {
        let finding = finding();
        let told = |undecided: &Undecided<'_>, count| planned(undecided, count).unwrap_err().to_string();
        let all = undecided(&finding, 5.0);
        let too_many = told(&all, 451);
        assert!(too_many.starts_with("450 collision-free") && too_many.contains("expected 451"), "{too_many}");
        // of the two explanations only the second needs the time
        assert!(told(&Undecided { state: State::at(&[]), ..undecided(&finding, 5.0) }, 4).contains("t_s"));
        // rough measurements cannot be planned for
        assert!(told(&Undecided { sigma: 0.02, ..all }, 4).contains("noise_m"));
        let Model { robot, cell, .. } = arm();
        let bare = Cell { balls: Vec::new(), ..cell };
        let no_balls = plan_next(&robot, &bare, &undecided(&finding, 5.0), 4, &Task::silent()).unwrap_err();
        assert!(no_balls.to_string().contains("no balls"), "{no_balls}");
    }

    #[test]
    fn json_has_the_finding_all_explanations_and_how_far_they_are_apart() {
        let finding = finding();
        let (entries, pairs, rejected) = (Vec::new(), Vec::new(), Vec::new());
        let next = Next { entries, lambda: 7.5, random_lambda: 2.25, pairs, rejected };
        let expected = json!({
            "effect": "lost_motion_direction",
            "site": {"joint": 3},
            "explanations": ["a gap at joint 3", "a zero that creeps at joint 3"],
            "lambda": 7.5,
            "random_lambda": 2.25,
        });
        assert_eq!(json_of(&undecided(&finding, 5.0), &next), expected);
        // where no random choice could be compared
        let alone = json_of(&undecided(&finding, 5.0), &Next { random_lambda: f64::NAN, ..next });
        assert_eq!((&alone["random_lambda"], &alone["lambda"]), (&Value::Null, &json!(7.5)));
    }
}
