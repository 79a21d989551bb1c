//! Starting points for arms without a closed form: the seed itself, then points spread evenly over the joint ranges.

use crate::recording::{Joints, MAX_JOINTS};
use crate::robot::{JointKind, Robot};

/// `count` starting points. Deterministic: multiples of the powers of an algebraic number (Roberts' generalized golden
/// ratio), which fill a cube of any dimension evenly.
pub(super) fn starts(robot: &Robot, seed: &Joints, count: usize) -> Vec<Joints> {
    let n = robot.dof();
    let power = 1.0 / (n as f64 + 1.0);
    // x^(n+1) = x + 1
    let golden = (0..60).fold(1.5_f64, |x, _| libm::pow(1.0 + x, power));
    let mut list = vec![*seed];
    for k in 1..count {
        let mut q = [0.0; MAX_JOINTS];
        let mut step = 1.0;
        for (x, joint) in q.iter_mut().zip(&robot.joints) {
            step /= golden;
            let u = (0.5 + step * k as f64).fract();
            let [mut lower, mut upper] = joint.limits;
            if joint.kind == JointKind::Revolute && upper - lower > std::f64::consts::TAU {
                let middle = 0.5 * (lower + upper);
                (lower, upper) = (middle - std::f64::consts::PI, middle + std::f64::consts::PI);
            }
            *x = lower + u * (upper - lower);
        }
        list.push(q);
    }
    list
}
