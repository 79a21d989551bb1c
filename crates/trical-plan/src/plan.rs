//! From a cell to a list of touches that the arm can do one after the other: everything of this crate in one function.

use rayon::prelude::*;
use trical_model::{Cell, Forward, Joints, MAX_JOINTS, Measured, Model, Robot, State, Task};

use crate::candidates::{Candidates, Observability};
use crate::choose::choose_for;
use crate::collision::{CollisionModel, MotionWorkspace};
use crate::connect::connect;
use crate::criterion::{Criterion, Goal};
use crate::error::{PlanError, Result};
use crate::generate::{Candidate, Rejected, generate, more_approaches};
use crate::joints::{rounded, senses};
use crate::options::PlanOptions;
use crate::parameters::usual_parameters;
use crate::predict::{PredictedError, Sphere, covariance, predicted_error, tool_rows};
use crate::random::generator;
use crate::route::{order, travel};
use crate::validation::{ValidationOptions, poses_in_sphere, poses_in_workspace};

/// One touch of a plan, and the way to it.
///
/// From wherever the arm stood before (the previous entry's `approach`, to which it has gone back), straight lines in joint
/// space lead through `via` to `approach`, and from there to `joints`, where the device touches; then back to `approach`.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanEntry {
    /// Place in the order of measurement, from 0.
    pub index: usize,
    /// Which ball, from 0.
    pub ball: usize,
    /// Joints at the touch, rad (m for sliding joints): by the nominal model the TCP is in the ball's centre.
    pub joints: Joints,
    /// Joints at the stand-off pose.
    pub approach: Joints,
    /// Configurations to go through on the way to `approach`, where the straight way is blocked.
    pub via: Vec<Joints>,
}

impl PlanEntry {
    /// Sense of each joint's last motion before the touch, as a recording would have it.
    #[must_use]
    pub fn senses(&self) -> [i8; MAX_JOINTS] {
        senses(&self.approach, &self.joints)
    }
}

/// What the plan is expected to tell.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Expected {
    /// Names of the parameters that can be told apart.
    pub parameters: Vec<String>,
    /// Their standard deviations for the noise of the options, in SI units (m, rad, rad/Nm).
    pub sd: Vec<f64>,
    /// Names of those that cannot, since others do the same, or nothing.
    pub dependent: Vec<String>,
    /// O1 of the chosen touches (see [`Observability`]).
    pub o1: f64,
    /// Condition number of the Jacobian with columns of unit length.
    pub condition: f64,
    /// What the choice was made for.
    pub criterion: Criterion,
    /// How much smaller that is than with the median of random choices from the same pool; 1.5 means two thirds. For the
    /// determinant it is the geometric mean of the standard deviations of all principal directions of the parameters.
    pub gain_over_random: f64,
    /// What noise leaves of the position error in the sphere; `None` where the arm does not get there.
    pub in_sphere: Option<PredictedError>,
    /// What noise leaves of the position error in the whole workspace.
    pub in_workspace: Option<PredictedError>,
    /// For each joint, in how many touches it arrives moving down and in how many moving up.
    pub senses: Vec<[usize; 2]>,
    /// Time of travel between touches, approaches left out, if every joint moved at 1 rad/s, s.
    pub travel_rad: f64,
}

/// A list of touches in the order of measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The touches.
    pub entries: Vec<PlanEntry>,
    /// What was refused at each ball, and why.
    pub rejected: Vec<Rejected>,
    /// What the plan is expected to tell.
    pub expected: Expected,
}

/// Plans touches: generates candidates at every ball, chooses the most informative, and orders them.
///
/// The parameters to identify are `options.parameters` on the nominal arm. Same input, same seed: same plan, for any number of
/// threads.
///
/// # Errors
/// [`PlanError`]: bad geometry or options, too few configurations at a ball, or no way between two of them.
pub fn plan_touches(robot: &Robot, cell: &Cell, options: &PlanOptions, task: &Task<'_>) -> Result<Plan> {
    let (model, mut pool, rejected) = candidates_at_all_balls(robot, cell, options, &task.part(0.0, 0.7))?;
    let share = |done: usize| 0.75 + 0.2 * done as f64 / (2 * ROUNDS) as f64;
    let forward = nominal_forward(robot, cell, options)?;
    let regions = Regions::new(&model, &forward, options);
    // a term that looks at the sense of a motion has been chosen for by these very approaches
    let senses_matter = forward.model().terms.iter().any(|t| t.basis.sense.is_some());
    let mut last_error = PlanError::NoBalls;
    let mut planned = None;
    for round in 0..ROUNDS {
        task.step(share(2 * round), "choosing")?;
        let chosen = choose_touches(&forward, &pool, options, regions.wanted(options)?)?;
        task.step(share(2 * round + 1), "looking for a way")?;
        let touches = chosen.touches.clone();
        let touches = if senses_matter { touches } else { balance_senses(&model, touches, options) };
        match visit(&model, &touches, options) {
            Ok(entries) => {
                planned = Some((chosen, entries));
                break;
            }
            // there may be no way to one of them: do without it
            Err((error, cut_off)) => {
                pool.retain(|c| c.joints != touches[cut_off].joints);
                last_error = error;
            }
        }
    }
    let Some((chosen, entries)) = planned else { return Err(last_error) };
    let n = robot.dof();
    let mut from = options.start;
    let mut length = 0.0;
    for e in &entries {
        for q in e.via.iter().chain(std::iter::once(&e.approach)) {
            length += from.map_or(0.0, |f| travel(&f, q));
            from = Some(*q);
        }
    }
    let (sd, in_sphere, in_workspace) = expect(&forward, &chosen, &entries, &regions, options);
    let expected = Expected {
        parameters: chosen.parameters,
        sd,
        criterion: options.criterion,
        in_sphere,
        in_workspace,
        dependent: chosen.dependent,
        o1: chosen.observability.o1,
        condition: chosen.observability.condition,
        gain_over_random: chosen.gain,
        senses: (0..n)
            .map(|k| {
                let count = |s: i8| entries.iter().filter(|e| e.senses()[k] == s).count();
                [count(-1), count(1)]
            })
            .collect(),
        travel_rad: length,
    };
    task.report(1.0, "done");
    Ok(Plan { entries, rejected, expected })
}

/// How the free terms move the tool at poses where the arm is to be accurate.
struct Regions {
    sphere: Vec<f64>,
    workspace: Vec<f64>,
}

/// Poses of the sphere, and of the workspace.
const REGION_POSES: [usize; 2] = [100, 200];

impl Regions {
    /// A region that the arm cannot reach is empty.
    fn new(model: &CollisionModel, forward: &Forward, options: &PlanOptions) -> Self {
        let settings = ValidationOptions { seed: options.seed, ..ValidationOptions::default() };
        let rows = |poses: Result<Vec<Joints>>| poses.map_or_else(|_| Vec::new(), |q| tool_rows(forward, &q));
        let sphere = options.sphere.or_else(|| Sphere::above(&model.forward().model().cell.balls));
        Self {
            sphere: sphere.map_or_else(Vec::new, |s| {
                rows(poses_in_sphere(model, &s.centre, s.radius, REGION_POSES[0], &settings))
            }),
            workspace: rows(poses_in_workspace(model, REGION_POSES[1], &settings)),
        }
    }

    /// The rows that [`Criterion::Region`] is about.
    fn wanted(&self, options: &PlanOptions) -> Result<&[f64]> {
        let (rows, name) =
            if options.whole_workspace { (&self.workspace, "workspace") } else { (&self.sphere, "sphere") };
        if options.criterion == Criterion::Region && rows.is_empty() {
            let problem = format!(
                "the arm reaches no pose of the {name} for which touches are to be chosen; expected one in its reach"
            );
            return Err(PlanError::Option { option: "criterion", problem });
        }
        Ok(rows)
    }
}

/// Standard deviations of the independent parameters, and the errors to be expected in the two regions.
fn expect(
    forward: &Forward,
    chosen: &Chosen,
    entries: &[PlanEntry],
    regions: &Regions,
    options: &PlanOptions,
) -> (Vec<f64>, Option<PredictedError>, Option<PredictedError>) {
    let p = forward.free().len();
    let mut ws = forward.workspace();
    let mut rows = vec![0.0; 3 * p * entries.len()];
    for (e, block) in entries.iter().zip(rows.chunks_exact_mut((3 * p).max(1))) {
        let state = State { dir: Some(e.senses()), ..State::at(&e.joints) };
        forward.linearize(&state, &Measured::Touch { ball: e.ball, reading: [0.0; 3] }, 0, &mut ws, block);
    }
    let Some(c) = covariance(&rows, p, &chosen.columns, options.noise_m) else {
        return (vec![f64::INFINITY; chosen.columns.len()], None, None);
    };
    let sd = c.diagonal().iter().map(|x| x.max(0.0).sqrt()).collect();
    let error = |tool: &[f64]| predicted_error(tool, p, &chosen.columns, &c);
    (sd, error(&regions.sphere), error(&regions.workspace))
}

/// The collision model of a cell, configurations for touches of all its balls, and how many were refused at each.
///
/// # Errors
/// Options or a cell that allow no plan, and too few configurations at a ball.
pub(crate) fn candidates_at_all_balls(
    robot: &Robot,
    cell: &Cell,
    options: &PlanOptions,
    task: &Task<'_>,
) -> Result<(CollisionModel, Vec<Candidate>, Vec<Rejected>)> {
    options.check()?;
    if cell.balls.is_empty() {
        return Err(PlanError::NoBalls);
    }
    let model = CollisionModel::new(robot, cell)?;
    check_start(&model, options)?;
    let (mut pool, mut rejected) = (Vec::new(), Vec::new());
    let share = |ball: usize| ball as f64 / cell.balls.len() as f64;
    for ball in 0..cell.balls.len() {
        let (candidates, refused) = generate(&model, ball, options, &task.part(share(ball), share(ball + 1)))?;
        pool.extend(candidates);
        rejected.push(refused);
    }
    Ok((model, pool, rejected))
}

fn check_start(model: &CollisionModel, options: &PlanOptions) -> Result<()> {
    let Some(q) = &options.start else { return Ok(()) };
    let robot = &model.forward().model().robot;
    let problem = if !robot.within_limits(q, 0.0) {
        "it is beyond joint limits".to_owned()
    } else if let Some(hit) = model.check_joints(q, None, &mut MotionWorkspace::new(model)) {
        let (a, b) = model.names(hit);
        format!("'{a}' and '{b}' meet there")
    } else {
        return Ok(());
    };
    Err(PlanError::BadStart { problem })
}

/// The touches that were chosen, and what they tell.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen {
    /// `options.per_ball` of each ball.
    pub touches: Vec<Candidate>,
    /// Names of independent parameters.
    pub parameters: Vec<String>,
    /// Their places among the free terms.
    pub columns: Vec<usize>,
    /// Names of the others.
    pub dependent: Vec<String>,
    /// Of the independent parameters.
    pub observability: Observability,
    /// How much better the choice is than a random one ([`Expected::gain_over_random`]).
    pub gain: f64,
}

/// The nominal arm with the parameters of `options` free.
///
/// # Errors
/// Parameters at sites that the arm does not have.
pub fn nominal_forward(robot: &Robot, cell: &Cell, options: &PlanOptions) -> Result<Forward> {
    let mut model = Model::nominal(robot.clone(), cell.clone());
    model.terms = options.parameters.clone().unwrap_or_else(|| usual_parameters(robot));
    let free = (0..model.terms.len()).collect();
    Ok(Forward::new(model, free)?)
}

/// `options.per_ball` candidates of each ball that together tell most about the free terms of `forward`, by its Jacobian
/// ([`Forward::linearize`]) at the present coefficients. It may be a calibrated model: then the choice is best for what is
/// still free. For [`Criterion::Region`], `region` holds how the free terms move the tool at the poses that matter
/// ([`tool_rows`]); otherwise it may be empty.
///
/// # Errors
/// Free terms that look at what a plan does not know (time, temperature), none that can be seen, or too few candidates.
pub fn choose_touches(forward: &Forward, pool: &[Candidate], options: &PlanOptions, region: &[f64]) -> Result<Chosen> {
    let model = forward.model();
    let cell = &model.cell;
    let names: Vec<String> =
        forward.free().iter().filter_map(|k| model.terms.get(*k)).map(|t| t.name.clone()).collect();
    let p = names.len();
    let nothing = || PlanError::NothingObservable { parameters: p };
    let mut ws = forward.workspace();
    let mut jacobian = vec![0.0; 3 * p * pool.len()];
    for (candidate, block) in pool.iter().zip(jacobian.chunks_exact_mut((3 * p).max(1))) {
        let measured = Measured::Touch { ball: candidate.ball, reading: [0.0; 3] };
        let state = State { dir: Some(candidate.senses()), ..State::at(&candidate.joints) };
        forward.check(&state, &measured, 0)?;
        forward.linearize(&state, &measured, 0, &mut ws, block);
    }
    let groups = pool.iter().map(|c| c.ball).collect();
    let all = Candidates::new(p, jacobian, groups).ok_or_else(nothing)?;
    let kept = all.independent_columns();
    if kept.is_empty() {
        return Err(nothing());
    }
    let independent = all.with_columns(&kept);
    let wanted = vec![options.per_ball; cell.balls.len()];
    let region: Vec<f64> =
        region.chunks_exact(p).flat_map(|row| kept.iter().map(|k| row.get(*k).copied().unwrap_or(0.0))).collect();
    let goal = match options.criterion {
        Criterion::Determinant => Goal::Determinant,
        Criterion::Variances => Goal::Variances,
        Criterion::Weakest => Goal::Weakest,
        Criterion::Region => Goal::Region(&region),
    };
    let choice = choose_for(&independent, &wanted, &goal, options.seed, options.restarts).ok_or_else(|| {
        let count = |ball: usize| pool.iter().filter(|c| c.ball == ball).count();
        let ball = (0..cell.balls.len()).min_by_key(|b| count(*b)).unwrap_or(0);
        PlanError::TooFew {
            ball: ball + 1,
            found: count(ball),
            wanted: options.per_ball,
            attempts: count(ball),
            reason: "all together do not determine the parameters".into(),
        }
    })?;
    let name = |keep: bool| {
        (0..p).filter(|k| kept.contains(k) == keep).filter_map(|k| names.get(k).cloned()).collect::<Vec<_>>()
    };
    Ok(Chosen {
        touches: choice.indices.iter().filter_map(|i| pool.get(*i).copied()).collect(),
        parameters: name(true),
        dependent: name(false),
        columns: kept.clone(),
        observability: independent.observability(&choice.indices),
        gain: choice.random_figure / choice.figure,
    })
}

/// Different stand-off poses for the same touch that are tried, so that each joint arrives in both senses.
const VARIANTS: usize = 6;

/// Chooses among several stand-off poses of each touch so that every joint arrives about as often from either side, at each
/// ball and over all: lost motion can only be seen where both senses occur.
fn balance_senses(model: &CollisionModel, mut touches: Vec<Candidate>, options: &PlanOptions) -> Vec<Candidate> {
    let n = model.forward().model().robot.dof();
    let variants: Vec<Vec<Joints>> = touches
        .par_iter()
        .enumerate()
        .map_init(
            || MotionWorkspace::new(model),
            |scratch, (k, c)| {
                let rng = &mut generator(options.seed, 3, k as u64);
                more_approaches(model, c, options, VARIANTS, rng, scratch)
            },
        )
        .collect();
    let imbalance = |touches: &[Candidate]| {
        let mut sum = 0;
        let balls = touches.iter().map(|t| t.ball + 1).max().unwrap_or(0);
        for k in 0..n {
            let mut all = 0;
            for ball in 0..balls {
                let mut here = 0;
                for t in touches.iter().filter(|t| t.ball == ball) {
                    let s = i64::from(t.senses()[k]);
                    here += s;
                    // a joint without a sure sense tells nothing of lost motion
                    sum += 2 * i64::from(s == 0);
                }
                all += here;
                sum += here * here;
            }
            sum += all * all;
        }
        sum
    };
    for _ in 0..20 {
        let mut changed = false;
        for k in 0..touches.len() {
            let mut best = (imbalance(&touches), touches[k].approach);
            for variant in &variants[k] {
                touches[k].approach = *variant;
                let now = imbalance(&touches);
                if now < best.0 {
                    best = (now, *variant);
                    changed = true;
                }
            }
            touches[k].approach = best.1;
        }
        if !changed {
            break;
        }
    }
    touches
}

/// How often a touch that cannot be reached from the others is given up for another.
pub(crate) const ROUNDS: usize = 8;
/// Tours that are tried when a way between two neighbours cannot be found.
const TOURS: usize = 5;
/// Cost of a way that does not exist.
const BLOCKED: f64 = 1e3;

/// Orders the touches and finds the ways between them; or tells what went wrong, and the touch that is hardest to get to.
pub(crate) fn visit(
    model: &CollisionModel,
    touches: &[Candidate],
    options: &PlanOptions,
) -> std::result::Result<Vec<PlanEntry>, (PlanError, usize)> {
    let n = touches.len();
    let robot = &model.forward().model().robot;
    let start = options.start.map(|q| rounded(robot, &q));
    let mut blocked: Vec<(usize, usize)> = Vec::new();
    let mut last_error = None;
    for _ in 0..TOURS {
        // n stands for the start
        let cost = |i: usize, j: usize| {
            let penalty = if blocked.contains(&(i.min(j), i.max(j))) { BLOCKED } else { 0.0 };
            travel(&touches[i].approach, &touches[j].approach) + penalty
        };
        let from_start = |i: usize| match &start {
            Some(q) => travel(q, &touches[i].approach) + if blocked.contains(&(i, n)) { BLOCKED } else { 0.0 },
            None => 0.0,
        };
        let tour = order(n, cost, from_start);
        // legs[k] leads to tour[k]
        let legs: Vec<_> = (0..n)
            .into_par_iter()
            .map_init(
                || MotionWorkspace::new(model),
                |scratch, k| {
                    let from = match k.checked_sub(1) {
                        Some(before) => Some((tour[before], touches[tour[before]].approach)),
                        None => start.map(|q| (n, q)),
                    };
                    let Some((i, from)) = from else { return Ok(Vec::new()) };
                    let j = tour[k];
                    let pair = (i.min(j), i.max(j));
                    let rng = &mut generator(options.seed, 4, (pair.0 * (n + 1) + pair.1) as u64);
                    connect(model, &from, &touches[j].approach, rng, scratch).map_err(|hit| (pair, k, hit))
                },
            )
            .collect();
        let mut entries = Vec::with_capacity(n);
        let before = blocked.len();
        for (index, (leg, k)) in legs.into_iter().zip(&tour).enumerate() {
            match leg {
                Ok(via) => {
                    let Candidate { ball, joints, approach } = touches[*k];
                    entries.push(PlanEntry { index, ball, joints, approach, via });
                }
                Err((pair, at, hit)) => {
                    let (a, b) = model.names(hit);
                    last_error = Some(PlanError::NoWay { from: at, to: at + 1, a: a.to_owned(), b: b.to_owned() });
                    blocked.push(pair);
                }
            }
        }
        if blocked.len() == before {
            return Ok(entries);
        }
    }
    let often = |k: usize| blocked.iter().filter(|(i, j)| *i == k || *j == k).count();
    // the last of the most blocked ones: with all alike, that to which no way was found at the end
    let cut_off = (0..n).max_by_key(|k| often(*k)).unwrap_or(0);
    Err((last_error.unwrap_or(PlanError::NoBalls), cut_off))
}

#[cfg(test)]
pub(crate) mod tests;
