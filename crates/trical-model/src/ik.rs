//! Inverse kinematics on the full model: every way the arm can take a pose, to rounding.
//!
//! Two steps. The nominal arm gives the branches: in closed form where the last three axes meet in a point (`spherical.rs`) or
//! where axes 2, 3 and 4 are parallel (`parallel.rs`), by many starts otherwise. The commonest arm without terms has a shorter
//! way (`usual.rs`). Newton's method on the model with all of its
//! terms then takes each branch to the pose itself, so a calibrated arm has as many solutions as its nominal one.
//!
//! ```
//! use trical_model::ik::inverse_kinematics;
//! use trical_model::{Cell, Forward, Model, Robot, State};
//! # let robot = Robot::parse(include_str!("../tests/data/arm.toml"), "arm.toml")?;
//! # let cell = Cell::parse(include_str!("../tests/data/cell.toml"), "cell.toml")?;
//! let forward = Forward::new(Model::nominal(robot, cell), vec![])?;
//! let mut ws = forward.workspace();
//! let state = State::at(&[0.3, 0.5, -0.2, 0.4, 0.8, -1.0]);
//! let world_from_tool = forward.world_from_tool(&state, &mut ws);
//! let solutions = inverse_kinematics(&forward, &world_from_tool, &state, &mut ws)?;
//! assert!((solutions[0].joints[1] - 0.5).abs() < 1e-9); // nearest to `state` first
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod arm;
mod closest;
mod error;
mod limits;
mod newton;
mod parallel;
mod search;
mod spherical;
pub(crate) mod usual;
mod wrist;

use crate::basis::{Shape, Variable};
use crate::forward::{Forward, Workspace};
use crate::pose::Pose;
use crate::recording::{Joints, MAX_JOINTS, State};
use crate::robot::JointKind;
use arm::Arm;
pub use closest::{all_closest, closest};
pub use error::IkError;
use limits::{MOST, all_wraps, excess, farthest, principal, put_within, same};
use newton::Ended;
use usual::Usual;

/// One way to take a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// Joint values within limits, rad (m for prismatic joints).
    pub joints: Joints,
    /// Number of the branch (elbow up or down and so on), from 0. Solutions that differ by whole turns share it.
    pub branch: usize,
}

/// Every way to bring the tool to `world_from_tool` (TCP and axes of the tool in {w}) within joint limits: all branches, and
/// all whole turns of joints that can turn further than once; nearest to `state.q` first.
///
/// `state` gives the covariates (temperature, sense of motion, payload ...) that the model's terms may look at; its `q`
/// chooses among the infinitely many solutions where two axes coincide. Arms with more than six joints get a sample of
/// their solutions. Solutions are accurate to 1e-10 m and 1e-10 rad on the full model.
///
/// # Errors
/// [`IkError`], where there is no solution; of several reasons the one closest to success: limits before a singular arm
/// before reach.
pub fn inverse_kinematics(
    forward: &Forward,
    world_from_tool: &Pose,
    state: &State,
    ws: &mut Workspace,
) -> Result<Vec<Solution>, IkError> {
    check_pose(world_from_tool)?;
    if let Some(usual) = &forward.usual
        && let Some(solutions) = usual_solutions(usual, forward, world_from_tool, state, ws)
    {
        return Ok(solutions);
    }
    let Found { roots, mut failure } = branches(forward, world_from_tool, state, ws);
    if let (true, Some(IkError::NotConverged { miss_m, miss_rad, .. })) = (roots.is_empty(), failure) {
        failure = Some(IkError::Unreachable { miss_m, miss_rad });
    }
    let robot = &forward.model().robot;
    let turning = changes_with_turns(forward);
    let mut order: Vec<(f64, Solution)> = Vec::with_capacity(roots.len());
    for (branch, root) in roots.iter().enumerate() {
        let mut wraps = Vec::new();
        if let Err(e) = all_wraps(robot, root, |joints| wraps.push(joints)) {
            keep_better(&mut failure, e);
        }
        for mut joints in wraps {
            if turning {
                let mut at = State { q: joints, ..*state };
                if newton::refine(forward, world_from_tool, &mut at, ws) != Ended::Converged {
                    continue;
                }
                joints = at.q;
                if let Err(e) = put_within(robot, &mut joints) {
                    keep_better(&mut failure, e);
                    continue;
                }
            }
            order.push((farthest(robot.dof(), &joints, &state.q), Solution { joints, branch }));
        }
    }
    if order.is_empty() {
        return Err(failure.unwrap_or(IkError::Unreachable { miss_m: f64::NAN, miss_rad: f64::NAN }));
    }
    Ok(in_order(order))
}

/// The first [`MOST`] by what stands beside them.
fn in_order(mut solutions: Vec<(f64, Solution)>) -> Vec<Solution> {
    solutions.sort_by(|a, b| a.0.total_cmp(&b.0));
    solutions.truncate(MOST);
    solutions.into_iter().map(|(_, solution)| solution).collect()
}

/// The solution of each branch, whole turns aside.
fn branches(forward: &Forward, world_from_tool: &Pose, state: &State, ws: &mut Workspace) -> Found {
    let robot = &forward.model().robot;
    let seeds = seeds(forward, world_from_tool, state, ws);
    let mut found = Found { roots: Vec::with_capacity(8), failure: None };
    let exact = forward.model().terms.is_empty();
    for seed in &seeds.list {
        let new = found.attempt(forward, world_from_tool, seed, state, ws);
        if new || exact || !seeds.closed {
            continue;
        }
        // a branch that led nowhere, or to another's solution: near a fold its own may lie a little aside
        for joint in 0..robot.dof() {
            for aside in [0.15, -0.15, 0.4, -0.4] {
                let mut seed = *seed;
                seed[joint] += aside;
                found.attempt(forward, world_from_tool, &seed, state, ws);
            }
        }
    }
    if seeds.closed && !exact {
        // the branch of `state.q`, in case the nominal arm folds where the calibrated one does not
        found.attempt(forward, world_from_tool, &state.q, state, ws);
        if found.roots.is_empty() {
            for seed in search::starts(robot, &state.q, 24) {
                found.attempt(forward, world_from_tool, &seed, state, ws);
            }
        }
    } else if seeds.list.is_empty() {
        // nothing to be had: one descent says by how much
        found.attempt(forward, world_from_tool, &state.q, state, ws);
    }
    found
}

/// The solution on the same branch as `state.q`, by Newton's method from there: what a small correction of a pose needs.
/// Where that jumps or fails, the solution nearest to `state.q` of all.
///
/// # Errors
/// As [`inverse_kinematics`].
pub fn nearest_solution(
    forward: &Forward,
    world_from_tool: &Pose,
    state: &State,
    ws: &mut Workspace,
) -> Result<Joints, IkError> {
    continue_from(forward, world_from_tool, state, ws).or_else(|_| {
        let all = inverse_kinematics(forward, world_from_tool, state, ws)?;
        all.first().map(|s| s.joints).ok_or(IkError::NotAPose)
    })
}

/// The solution that Newton's method finds from `state.q`, or why there is none: never another branch.
///
/// # Errors
/// As [`inverse_kinematics`]; also [`IkError::NotConverged`] where the nearest solution is more than 1 rad (or 1 m) away
/// in some joint.
pub fn continue_from(
    forward: &Forward,
    world_from_tool: &Pose,
    state: &State,
    ws: &mut Workspace,
) -> Result<Joints, IkError> {
    check_pose(world_from_tool)?;
    let robot = &forward.model().robot;
    let mut at = *state;
    match newton::refine(forward, world_from_tool, &mut at, ws) {
        Ended::Converged if farthest(robot.dof(), &at.q, &state.q) < 1.0 => {
            put_within(robot, &mut at.q)?;
            Ok(at.q)
        }
        Ended::Converged => Err(IkError::NotConverged { iterations: 0, miss_m: 0.0, miss_rad: 0.0 }),
        ended => Err(ended.error()),
    }
}

struct Found {
    roots: Vec<Joints>,
    failure: Option<IkError>,
}

impl Found {
    /// Whether `seed` leads to a solution that was not known.
    fn attempt(&mut self, forward: &Forward, target: &Pose, seed: &Joints, state: &State, ws: &mut Workspace) -> bool {
        let robot = &forward.model().robot;
        let mut at = State { q: *seed, ..*state };
        match newton::refine(forward, target, &mut at, ws) {
            Ended::Converged => {
                let q = principal(robot, &at.q);
                let new = !self.roots.iter().any(|r| same(robot, r, &q));
                if new {
                    self.roots.push(q);
                }
                new
            }
            ended => {
                keep_better(&mut self.failure, ended.error());
                false
            }
        }
    }
}

fn check_pose(pose: &Pose) -> Result<(), IkError> {
    let r = &pose.rotation;
    let finite = r.iter().chain(pose.translation.iter()).all(|x| x.is_finite());
    if finite && (r.transpose() * r - nalgebra::Matrix3::identity()).amax() < 1e-6 && r.determinant() > 0.0 {
        Ok(())
    } else {
        Err(IkError::NotAPose)
    }
}

struct Seeds {
    list: Vec<Joints>,
    /// From a closed form: then they are all there are.
    closed: bool,
}

/// Starting points for Newton's method: one for each branch of the nominal arm.
fn seeds(forward: &Forward, world_from_tool: &Pose, state: &State, ws: &mut Workspace) -> Seeds {
    let robot = &forward.model().robot;
    if robot.dof() == 6 && robot.joints.iter().all(|j| j.kind == JointKind::Revolute) {
        // where base and tool really are, so that only what is inside the arm separates seed and solution
        let from_tool = forward.world_from_tool_and_frames(state, ws);
        let world_from_base = Pose { rotation: ws.moved.base_axes.matrix(), translation: ws.moved.base_origin };
        let flange_from_tool = ws.moved.flange.pose().inverse().compose(&from_tool);
        let base_from_flange = world_from_base.inverse().compose(&world_from_tool.compose(&flange_from_tool.inverse()));
        let base_from_flange =
            robot.root_from_zero.inverse().compose(&base_from_flange.compose(&robot.last_from_flange.inverse()));
        let arm = Arm::of(robot);
        let start = arm.theta(&state.q);
        let mut thetas = Vec::with_capacity(8);
        if arm.has_spherical_wrist() {
            spherical::solve(&arm, &base_from_flange, &start, &mut thetas);
        } else if arm.has_parallel_axes() {
            parallel::solve(&arm, &base_from_flange, &start, &mut thetas);
        }
        if arm.has_spherical_wrist() || arm.has_parallel_axes() {
            return Seeds { list: thetas.iter().map(|t| arm.joints(t)).collect(), closed: true };
        }
    }
    Seeds { list: search::starts(robot, &state.q, 160), closed: false }
}

/// Keeps the failure that is closest to success.
fn keep_better(kept: &mut Option<IkError>, new: IkError) {
    let rank = |e: &IkError| match e {
        IkError::OutOfLimits { .. } | IkError::OutOfTravel { .. } => (0, excess(e)),
        IkError::Singular { miss_m, miss_rad } => (1, miss_m + miss_rad),
        IkError::NotConverged { miss_m, miss_rad, .. } => (2, miss_m + miss_rad),
        IkError::Unreachable { miss_m, miss_rad } => (3, miss_m + miss_rad),
        IkError::NotAPose => (4, 0.0),
    };
    if kept.as_ref().is_none_or(|k| {
        let (a, b) = (rank(&new), rank(k));
        a.0 < b.0 || (a.0 == b.0 && a.1 < b.1)
    }) {
        *kept = Some(new);
    }
}

/// Whether a whole turn of a joint changes what the model predicts.
fn changes_with_turns(forward: &Forward) -> bool {
    forward.varying.iter().any(|(_, index)| {
        let basis = &forward.bound[*index].basis;
        match basis.of {
            Variable::Lag { .. } => true,
            Variable::Joint { .. } | Variable::Inclination { .. } => {
                !matches!(basis.shape, Shape::Sine { cycles } | Shape::Cosine { cycles } if cycles.fract() == 0.0)
            }
            _ => false,
        }
    })
}

/// All solutions of a usual arm within limits, nearest to `state.q` first; `None` where the general way has to look.
fn usual_solutions(
    usual: &Usual,
    forward: &Forward,
    world_from_tool: &Pose,
    state: &State,
    ws: &mut Workspace,
) -> Option<Vec<Solution>> {
    let robot = &forward.model().robot;
    let mut seeds = [([0.0; MAX_JOINTS], 0); 8];
    let mut count = 0;
    usual.branches(robot, world_from_tool, |q, branch| {
        if let Some(seed) = seeds.get_mut(count) {
            *seed = (q, branch);
            count += 1;
        }
    })?;
    let mut solutions: Vec<(f64, Solution)> = Vec::with_capacity(8);
    let mut at = *state;
    // half turns of the wrist's joints lead from one of its two ways to the other: where one takes the pose, so does the other
    let mut checked = None;
    for (q, branch) in &seeds[..count] {
        let beside = |joints: Joints| (farthest(6, &joints, &state.q), Solution { joints, branch: *branch });
        let within = all_wraps(robot, q, |joints| solutions.push(beside(joints))).is_ok();
        if within && checked != Some(branch / 2) {
            at.q = *q;
            if !newton::is_there(&forward.world_from_tool(&at, ws), world_from_tool) {
                return None;
            }
            checked = Some(branch / 2);
        }
    }
    (!solutions.is_empty()).then(|| in_order(solutions))
}

#[cfg(test)]
mod tests;
