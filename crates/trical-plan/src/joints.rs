//! Joint positions as plans hold them.

use trical_model::robot::tidy;
use trical_model::{JointKind, Joints, MAX_JOINTS, Robot};

/// Joint values as the plan's file gives them: to a millionth of a degree (10 nm at the tool) or of a millimetre.
pub(crate) fn rounded(robot: &Robot, q: &Joints) -> Joints {
    let mut out = *q;
    for (x, joint) in out.iter_mut().zip(&robot.joints) {
        *x = match joint.kind {
            JointKind::Revolute => ((x.to_degrees() * 1e6).round() / 1e6).to_radians(),
            JointKind::Prismatic => tidy((*x * 1e9).round() / 1e6) * 1e-3,
        };
    }
    out
}

/// A joint that moves less than this on its last way has no sure sense, rad.
const SURE: f64 = 1e-3;

/// Sense of each joint's last motion.
pub(crate) fn senses(approach: &Joints, touch: &Joints) -> [i8; MAX_JOINTS] {
    let mut out = [0; MAX_JOINTS];
    for (s, (a, t)) in out.iter_mut().zip(approach.iter().zip(touch)) {
        *s = if t - a > SURE {
            1
        } else if t - a < -SURE {
            -1
        } else {
            0
        };
    }
    out
}
