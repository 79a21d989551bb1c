//! Newton's method on the full model, damped where the arm is nearly singular.

use nalgebra::{Matrix6, SMatrix, Vector6};

use super::error::IkError;
use crate::forward::{Forward, Workspace};
use crate::pose::{Pose, rotation_vector};
use crate::recording::{MAX_JOINTS, State};

const ACCURATE_M: f64 = 1e-10;
const ACCURATE_RAD: f64 = 1e-10;
const ITERATIONS: usize = 60;
/// Longest step of a joint, rad (m).
const STEP: f64 = 0.5;

/// How an iteration ended. Misses in m and rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Ended {
    Converged,
    Singular(f64, f64),
    Unreachable(f64, f64),
    NotConverged(usize, f64, f64),
}

impl Ended {
    pub fn error(self) -> IkError {
        match self {
            Self::Singular(miss_m, miss_rad) => IkError::Singular { miss_m, miss_rad },
            Self::Unreachable(miss_m, miss_rad) => IkError::Unreachable { miss_m, miss_rad },
            Self::NotConverged(iterations, miss_m, miss_rad) => IkError::NotConverged { iterations, miss_m, miss_rad },
            Self::Converged => IkError::NotConverged { iterations: 0, miss_m: 0.0, miss_rad: 0.0 },
        }
    }
}

type Rows = SMatrix<f64, 6, MAX_JOINTS>;

/// What is left between where the tool is and where it is wanted: m, then rad, in {w}.
pub(super) fn miss(target: &Pose, pose: &Pose) -> Vector6<f64> {
    let p = target.translation - pose.translation;
    let r = rotation_vector(&(target.rotation * pose.rotation.transpose()));
    Vector6::new(p.x, p.y, p.z, r.x, r.y, r.z)
}

/// Whether a pose is as near to where it is wanted as solutions are.
#[inline]
pub(super) fn is_there(pose: &Pose, target: &Pose) -> bool {
    // matrices of rotations by a small angle to each other differ by sqrt 2 times the angle
    (target.translation - pose.translation).norm_squared() < ACCURATE_M * ACCURATE_M
        && (target.rotation - pose.rotation).norm_squared() < ACCURATE_RAD * ACCURATE_RAD
}

/// Of a miss: m, rad.
#[inline]
pub(super) fn lengths(e: &Vector6<f64>) -> (f64, f64) {
    (e.fixed_rows::<3>(0).norm(), e.fixed_rows::<3>(3).norm())
}

/// Why no step made the miss `e` smaller.
fn stuck(e: &Vector6<f64>, gradient: f64, size: f64, singular: bool, iterations: usize) -> Ended {
    let (far, turn) = lengths(e);
    // a miss that no joint can reduce: the arm's reach ends here
    if gradient < 1e-3 * e.norm() * size.sqrt() && e.norm() > 1e-6 {
        Ended::Unreachable(far, turn)
    } else if singular || e.norm() < 1e-6 {
        Ended::Singular(far, turn)
    } else if iterations >= ITERATIONS {
        Ended::NotConverged(iterations, far, turn)
    } else {
        Ended::Unreachable(far, turn)
    }
}

/// Changes `state.q` until the tool is at `target`: `dq = J' (J J' + damping)^-1 e`, the damping growing when a step fails
/// and falling to zero when steps succeed, so that the end is Newton's quadratic one.
pub(super) fn refine(forward: &Forward, target: &Pose, state: &mut State, ws: &mut Workspace) -> Ended {
    // the seed of a closed form is often the solution itself: then the Jacobian is not needed
    let pose = forward.world_from_tool(state, ws);
    if is_there(&pose, target) {
        return Ended::Converged;
    }
    let n = forward.model().robot.dof();
    let mut flat = [0.0; 6 * MAX_JOINTS];
    let mut pose = forward.joint_jacobian(state, ws, &mut flat);
    let mut e = miss(target, &pose);
    // fewer than six joints leave J J' without an inverse
    let least = if n < 6 { 1e-14 } else { 0.0 };
    let mut damping: f64 = least;
    let mut iterations = 0;
    loop {
        let (far, turn) = lengths(&e);
        if far < ACCURATE_M && turn < ACCURATE_RAD {
            return Ended::Converged;
        }
        let mut j = Rows::zeros();
        for row in 0..6 {
            for column in 0..n {
                j[(row, column)] = flat[row * n + column];
            }
        }
        let jjt: Matrix6<f64> = j * j.transpose();
        let size = jjt.trace().max(1e-12);
        let mut improved = false;
        let mut singular = false;
        while iterations < ITERATIONS {
            iterations += 1;
            let step = (jjt + Matrix6::identity() * (damping * size)).cholesky().map(|c| {
                let d = c.l_dirty().diagonal();
                singular = d.min() < 1e-7 * d.max();
                j.transpose() * c.solve(&e)
            });
            if let Some(mut step) = step {
                let longest = step.amax();
                if longest > STEP {
                    step *= STEP / longest;
                }
                let mut trial = *state;
                for k in 0..n {
                    trial.q[k] += step[k];
                }
                pose = forward.joint_jacobian(&trial, ws, &mut flat);
                let left = miss(target, &pose);
                if left.norm() < e.norm() {
                    // a limited step is no reason to trust an undamped one less
                    e = left;
                    *state = trial;
                    damping = if damping < 1e-9 { least } else { damping * 0.1 };
                    improved = true;
                    break;
                }
                if step.amax() < 1e-14 {
                    break;
                }
            } else {
                singular = true;
            }
            damping = (damping * 10.0).max(1e-8);
            if damping > 1e3 {
                break;
            }
        }
        if !improved {
            let gradient = (j.transpose() * e).norm();
            return stuck(&e, gradient, size, singular, iterations);
        }
        if !e.iter().all(|x| x.is_finite()) {
            return Ended::NotConverged(iterations, f64::NAN, f64::NAN);
        }
    }
}
