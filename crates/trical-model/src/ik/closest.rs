//! Arms with fewer than six joints: the tool's point where it is wanted, its axes as near to that as the joints allow.

use nalgebra::{DMatrix, DVector};

use super::error::IkError;
use super::keep_better;
use super::limits::{farthest, put_within, same};
use super::newton::{lengths, miss};
use super::search::starts;
use crate::forward::{Forward, Workspace};
use crate::pose::Pose;
use crate::recording::{Joints, MAX_JOINTS, State};

const ITERATIONS: usize = 30;
/// Where the descents begin.
const STARTS: usize = 40;
/// A pose in a text is rounded by less, rad.
const ROUNDED: f64 = 2e-3;
/// Steps of joints that are shorter change nothing, rad (m).
const STILL: f64 = 1e-12;
/// Longest step of a joint, rad (m).
const STEP: f64 = 0.3;
/// Directions in which joints move the tool less than this share of the strongest count as none.
const RANK: f64 = 1e-6;

/// The joints near `state.q` with the tool's point at that of a pose, and of those the ones with its axes nearest to the pose's; what is left,
/// m and rad.
///
/// # Errors
/// The point is out of reach, or beyond the limits of a joint.
pub fn closest(
    forward: &Forward,
    world_from_tool: &Pose,
    state: &State,
    ws: &mut Workspace,
) -> Result<(Joints, f64, f64), IkError> {
    let n = forward.model().robot.dof();
    let mut at = *state;
    let mut flat = [0.0; 6 * MAX_JOINTS];
    for _ in 0..ITERATIONS {
        let e = miss(world_from_tool, &forward.joint_jacobian(&at, ws, &mut flat));
        let rows = |from: usize| DMatrix::from_fn(3, n, |row, column| flat[(from + row) * n + column]);
        let of = |from: usize| DVector::from_iterator(3, e.iter().skip(from).take(3).copied());
        // first the point, then the axes by what leaves the point alone (task priority: Siciliano & Slotine 1991)
        let (point, axes) = (rows(0), rows(3));
        let back = inverse(&point);
        let first = &back * of(0);
        let free = DMatrix::identity(n, n) - &back * &point;
        let second = inverse(&(&axes * &free)) * (of(3) - &axes * &first);
        let mut step = first + free * second;
        let longest = step.amax();
        if longest > STEP {
            step *= STEP / longest;
        }
        at.q.iter_mut().zip(step.iter()).for_each(|(q, d)| *q += d);
        if longest < STILL {
            break;
        }
    }
    let (miss_m, miss_rad) = lengths(&miss(world_from_tool, &forward.world_from_tool(&at, ws)));
    if miss_m.is_nan() || miss_m > 1e-9 {
        return Err(IkError::Unreachable { miss_m, miss_rad });
    }
    put_within(&forward.model().robot, &mut at.q)?;
    Ok((at.q, miss_m, miss_rad))
}

/// All joints at which such an arm has the tool at a pose, which may be rounded: the farthest joint from `state.q` decides their order. One that is
/// `enough` is looked for first near `state.q`, and then given alone.
///
/// # Errors
/// There are none; the one that is least off is told.
pub fn all_closest(
    forward: &Forward,
    world_from_tool: &Pose,
    state: &State,
    ws: &mut Workspace,
    enough: impl Fn(&Joints) -> bool,
) -> Result<Vec<Joints>, IkError> {
    let robot = &forward.model().robot;
    let (mut found, mut failure): (Vec<Joints>, Option<IkError>) = (Vec::new(), None);
    for seed in starts(robot, &state.q, STARTS) {
        match closest(forward, world_from_tool, &State { q: seed, ..*state }, ws) {
            Ok((q, _, turned)) if turned < ROUNDED => {
                if enough(&q) {
                    return Ok(vec![q]);
                }
                if !found.iter().any(|other| same(robot, other, &q)) {
                    found.push(q);
                }
            }
            Ok((_, miss_m, miss_rad)) => keep_better(&mut failure, IkError::Unreachable { miss_m, miss_rad }),
            Err(e) => keep_better(&mut failure, e),
        }
    }
    let far = |q: &Joints| farthest(robot.dof(), q, &state.q);
    found.sort_by(|a, b| far(a).total_cmp(&far(b)));
    match failure {
        Some(e) if found.is_empty() => Err(e),
        _ => Ok(found),
    }
}

/// The pseudo-inverse, of which the directions that hardly move anything are left out.
fn inverse(a: &DMatrix<f64>) -> DMatrix<f64> {
    let svd = a.clone().svd(true, true);
    let least = RANK * svd.singular_values.max().max(RANK);
    svd.pseudo_inverse(least).unwrap_or_else(|_| DMatrix::zeros(a.ncols(), a.nrows()))
}
