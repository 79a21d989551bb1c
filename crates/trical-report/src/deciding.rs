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
