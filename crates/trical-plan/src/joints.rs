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

/// Where an arm is taken to stand if nobody says it, SI: joints at zero; those whose limits leave zero out in the middle between these.
#[must_use]
pub fn usual_start(robot: &Robot) -> Joints {
    let mut q = [0.0; MAX_JOINTS];
    for (q, joint) in q.iter_mut().zip(&robot.joints) {
        let [low, high] = joint.limits;
        if !(low..=high).contains(&0.0) {
            *q = 0.5 * (low + high);
        }
    }
    q
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn an_arm_whose_limits_leave_zero_out_stands_in_the_middle_between_them() {
        let text = include_str!("../../trical-model/tests/data/arm.toml");
        let mut robot = Robot::parse(text, "arm.toml").unwrap();
        assert_eq!(usual_start(&robot), [0.0; MAX_JOINTS]);
        robot.joints[3].limits = [-3.0, -0.1];
        let q = usual_start(&robot);
        assert!((q[3] + 1.55).abs() < 1e-12 && q[2] == 0.0 && robot.within_limits(&q, 0.0));
    }
}
