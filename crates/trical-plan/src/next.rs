//! Touches that decide between explanations of what was measured so far.

use trical_model::{Cell, Forward, Measured, Robot, State, Task};

use crate::candidates::Candidates;
use crate::discriminate::{choose_to_discriminate, lambda_of};
use crate::error::{PlanError, Result};
use crate::generate::{Candidate, Rejected};
use crate::options::PlanOptions;
use crate::plan::{PlanEntry, ROUNDS, candidates_at_all_balls, visit};
use crate::random::generator;
use rand::seq::SliceRandom;

/// Random choices that the planned one is compared with.
const RANDOM: u64 = 21;

/// Explanations of what was measured, each fitted to it.
pub struct Question<'a> {
    /// The explanations; those parameters of the first that all share are free.
    pub rivals: &'a [Forward],
    /// J'J of the free parameters over what was measured, in units of the noise, row by row.
    pub information: &'a [f64],
    /// Standard deviation of each of a touch's three numbers, m.
    pub sigma: f64,
    /// Time, temperature and load of the measurements to come.
    pub state: &'a State,
}

/// Touches that decide.
#[derive(Clone, Debug, PartialEq)]
pub struct Next {
    /// In the order of measurement.
    pub entries: Vec<PlanEntry>,
    /// By how many standard deviations any two explanations will be apart, at least.
    pub lambda: f64,
    /// The median of random choices from the same candidates.
    pub random_lambda: f64,
    /// For each pair of explanations.
    pub pairs: Vec<(usize, usize, f64)>,
    /// What was refused at each ball, and why.
    pub rejected: Vec<Rejected>,
}

/// Plans `count` touches, of whichever balls, that best set the explanations apart.
///
/// # Errors
/// As [`crate::plan_touches`].
pub fn plan_to_discriminate(
    robot: &Robot,
    cell: &Cell,
    options: &PlanOptions,
    question: &Question<'_>,
    count: usize,
    task: &Task<'_>,
) -> Result<Next> {
    let options = PlanOptions { per_ball: 1, ..options.clone() };
    let (model, mut pool, rejected) = candidates_at_all_balls(robot, cell, &options, &task.part(0.0, 0.8))?;
    let mut last_error = PlanError::NoBalls;
    for _ in 0..ROUNDS {
        let few = |pool: &[Candidate]| PlanError::TooFewPoses {
            found: pool.len(),
            wanted: count,
            attempts: rejected.iter().map(|r| r.attempts).sum(),
        };
        let (jacobians, rivals) = predicted(question, &pool)?;
        let chosen =
            choose_to_discriminate(&jacobians, question.information, &rivals, count).ok_or_else(|| few(&pool))?;
        let touches: Vec<Candidate> = chosen.indices.iter().filter_map(|i| pool.get(*i).copied()).collect();
        match visit(&model, &touches, &options) {
            Ok(entries) => {
                let mut all: Vec<usize> = (0..pool.len()).collect();
                let mut random: Vec<f64> = (0..RANDOM)
                    .filter_map(|k| {
                        all.shuffle(&mut generator(options.seed, 7, k));
                        lambda_of(&jacobians, question.information, &rivals, &all[..count])
                    })
                    .collect();
                random.sort_by(f64::total_cmp);
                task.report(1.0, "done");
                let random_lambda = random.get(random.len() / 2).copied().unwrap_or(f64::NAN);
                return Ok(Next { entries, lambda: chosen.lambda, random_lambda, pairs: chosen.pairs, rejected });
            }
            // there may be no way to one of them: do without it
            Err((error, cut_off)) => {
                pool.retain(|c| c.joints != touches[cut_off].joints);
                last_error = error;
            }
        }
    }
    Err(last_error)
}

/// What the shared parameters do at the candidates, and what each explanation predicts there, in units of the noise.
fn predicted(question: &Question<'_>, pool: &[Candidate]) -> Result<(Candidates, Vec<Vec<f64>>)> {
    let Some(first) = question.rivals.first() else { return Err(PlanError::NothingObservable { parameters: 0 }) };
    let state = |c: &Candidate| State { q: c.joints, dir: Some(c.senses()), ..*question.state };
    let touch = |c: &Candidate| Measured::Touch { ball: c.ball, reading: [0.0; 3] };
    let p = first.free().len();
    let mut ws = first.workspace();
    let mut jacobian = vec![0.0; 3 * p * pool.len()];
    for (c, block) in pool.iter().zip(jacobian.chunks_exact_mut((3 * p).max(1))) {
        question.rivals.iter().try_for_each(|f| f.check(&state(c), &touch(c), 0))?;
        first.linearize(&state(c), &touch(c), 0, &mut ws, block);
    }
    jacobian.iter_mut().for_each(|x| *x /= question.sigma);
    let rivals = question
        .rivals
        .iter()
        .map(|f| {
            let mut ws = f.workspace();
            pool.iter()
                .flat_map(|c| {
                    f.residual(&state(c), &touch(c), 0, &mut ws);
                    let r = ws.residual();
                    [r[0], r[1], r[2]].map(|x| x / question.sigma)
                })
                .collect()
        })
        .collect();
    let candidates = Candidates::new(p, jacobian, pool.iter().map(|c| c.ball).collect())
        .ok_or(PlanError::NothingObservable { parameters: p })?;
    Ok((candidates, rivals))
}
