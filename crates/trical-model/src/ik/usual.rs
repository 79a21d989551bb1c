//! The usual arm without terms: axes 2 and 3 parallel and at right angles to axis 1, a spherical wrist of right angles. Then
//! nothing is left of Pieper's quartic but square roots: the shoulder looks forwards or backwards, the elbow is up or down,
//! the wrist is flipped or not.
//!
//! Branches beyond limits are left before they cost anything; those that stay are checked by the full forward function. Near
//! a fold, and where anything is not as expected, the general way is taken.

use nalgebra::{RowVector3, Vector3};

use super::arm::Arm;
use super::limits::may_be_within;
use crate::pose::Pose;
use crate::recording::{Joints, MAX_JOINTS};
use crate::robot::Robot;

/// Sines, and lengths as a share of the arm's size, below which branches are taken to meet.
const NEAR_FOLD: f64 = 1e-4;

/// Cosines and lengths that are zero in a usual arm may be off by this much.
const EXACT: f64 = 1e-12;

/// What is the same at every pose.
#[derive(Clone, Debug)]
pub(crate) struct Usual {
    /// Theta is `q` plus this.
    offset: [f64; 6],
    /// {w} in the frame in which joint 1 turns about z.
    one_from_world: Pose,
    /// Frame {6} in that of the tool.
    tool_from_last: Pose,
    /// Sines of the twists of joints 2, 5 and 6: 1 or -1.
    side: [f64; 3],
    /// Sine and cosine of the twist of joint 4.
    twist: (f64, f64),
    /// Along x from axis 1 to axis 2, and from axis 2 to axis 3.
    shoulder: f64,
    upper: f64,
    /// From axis 3 to the wrist's centre, and its direction in frame {3} (cosine, sine, rad).
    fore: f64,
    towards: (f64, f64, f64),
    /// Of the wrist along axis 2.
    aside: f64,
    /// From the wrist to the flange.
    hand: f64,
    size: f64,
}

impl Usual {
    /// `None` for other arms.
    pub fn of(robot: &Robot, world_from_base: &Pose, flange_from_tool: &Pose) -> Option<Self> {
        if robot.dof() != 6 || robot.joints.iter().any(|j| j.kind != crate::robot::JointKind::Revolute || j.beta != 0.0)
        {
            return None;
        }
        let arm = Arm::of(robot);
        let Arm { twist, a, d, offset, size, .. } = arm;
        let upright = [1, 4, 5].iter().all(|i| twist[*i].1.abs() < EXACT);
        let parallel = twist[2].0.abs() < EXACT && twist[2].1 > 0.0;
        if !(upright && parallel && arm.has_spherical_wrist()) || arm.zero(a[2]) {
            return None;
        }
        let (s3, c3) = twist[3];
        let (x, y) = (a[3], -s3 * d[3]);
        let fore = libm::hypot(x, y);
        if arm.zero(fore) {
            return None;
        }
        let zero_from_one =
            Pose { rotation: crate::pose::rotation_x(arm.alpha[0]), translation: Vector3::new(a[0], 0.0, 0.0) }
                .compose(&Pose { translation: Vector3::new(0.0, 0.0, d[0]), ..Pose::identity() });
        Some(Self {
            offset,
            one_from_world: world_from_base.compose(&robot.root_from_zero).compose(&zero_from_one).inverse(),
            tool_from_last: robot.last_from_flange.compose(flange_from_tool).inverse(),
            side: [twist[1].0.signum(), twist[4].0.signum(), twist[5].0.signum()],
            twist: twist[3],
            shoulder: a[1],
            upper: a[2],
            fore,
            towards: (x / fore, y / fore, libm::atan2(y, x)),
            aside: c3 * d[3] + d[2] + d[1],
            hand: d[5],
            size,
        })
    }

    /// Every solution whose joints may be within limits, with the number of its branch; `None` near a fold.
    pub(super) fn branches(
        &self,
        robot: &Robot,
        world_from_tool: &Pose,
        mut found: impl FnMut(Joints, usize),
    ) -> Option<()> {
        let pose = self.one_from_world.compose(&world_from_tool.compose(&self.tool_from_last));
        let r = &pose.rotation;
        let v = pose.translation - r.column(2) * self.hand;
        let near = NEAR_FOLD * self.size;
        let may_be = |joint: usize, theta: f64| may_be_within(&robot.joints[joint], theta - self.offset[joint]);
        // across the arm's plane the wrist is off axis 1 by what the links are aside, whatever the joints do
        let across = -self.side[0] * self.aside;
        let around = v.x * v.x + v.y * v.y;
        let out = around - across * across;
        if out < near * near {
            return None;
        }
        let (out, heading, height) = (out.sqrt(), libm::atan2(v.y, v.x), self.side[0] * v.z);
        let skewed = if across == 0.0 { 0.0 } else { libm::atan2(across, out) };
        for (k, out) in [out, -out].into_iter().enumerate() {
            let t1 = if k == 0 { heading - skewed } else { heading - std::f64::consts::PI + skewed };
            if !may_be(0, t1) {
                continue;
            }
            let along = out - self.shoulder;
            let reach2 = along * along + height * height;
            let fold = (reach2 - self.upper * self.upper - self.fore * self.fore) / (2.0 * self.upper * self.fore);
            let sine2 = 1.0 - fold * fold;
            if sine2.abs() < NEAR_FOLD * NEAR_FOLD || reach2 < near * near {
                return None;
            }
            if sine2 < 0.0 {
                continue;
            }
            let (s1, c1) = ((v.y * out - v.x * across) / around, (v.x * out + v.y * across) / around);
            // rows of Rx(-a1) Rz(-t1) r
            let row = |i: usize| -> RowVector3<f64> { r.row(i).into() };
            let shoulder =
                [row(0) * c1 + row(1) * s1, row(2) * self.side[0], (row(0) * s1 - row(1) * c1) * self.side[0]];
            let (sine, bent) = (sine2.sqrt(), libm::acos(fold));
            let aim = libm::atan2(height, along);
            let seen = libm::atan2(self.fore * sine, self.upper + self.fore * fold);
            for (j, sign) in [1.0, -1.0].into_iter().enumerate() {
                let (t2, t3) = (aim - sign * seen, sign * bent - self.towards.2);
                if !may_be(1, t2) || !may_be(2, t3) {
                    continue;
                }
                // the forearm's direction, and from it that of frame {3}: sine and cosine of t2 + t3
                let (x, y) = (self.upper + self.fore * fold, self.fore * sine * sign);
                let (c2, s2) = ((along * x + height * y) / reach2, (height * x - along * y) / reach2);
                let (ct, st, _) = self.towards;
                let (c3, s3) = (fold * ct + sign * sine * st, sign * sine * ct - fold * st);
                let (c, s) = (c2 * c3 - s2 * s3, s2 * c3 + c2 * s3);
                let across = shoulder[1] * c - shoulder[0] * s;
                let (sa, ca) = self.twist;
                let m =
                    [shoulder[0] * c + shoulder[1] * s, across * ca + shoulder[2] * sa, shoulder[2] * ca - across * sa];
                self.wrist(&m, |flip, [t4, t5, t6]| {
                    let theta = [t1, t2, t3, t4, t5, t6];
                    if (3..6).all(|i| may_be(i, theta[i])) {
                        let mut q = [0.0; MAX_JOINTS];
                        for (q, (t, offset)) in q.iter_mut().zip(theta.iter().zip(&self.offset)) {
                            *q = t - offset;
                        }
                        found(q, 4 * k + 2 * j + flip);
                    }
                })?;
            }
        }
        Some(())
    }

    /// Both ways to turn by `Rz(t4) Rx(a4) Rz(t5) Rx(a5) Rz(t6)`, a4 and a5 right angles, whose rows are `m`; `None` where the
    /// wrist is straight.
    fn wrist(&self, m: &[RowVector3<f64>; 3], mut found: impl FnMut(usize, [f64; 3])) -> Option<()> {
        let [_, first, second] = self.side;
        let sine = (m[0].z * m[0].z + m[1].z * m[1].z).sqrt();
        if sine < NEAR_FOLD {
            return None;
        }
        let t4 = libm::atan2(second * m[1].z, second * m[0].z);
        let t5 = libm::atan2(sine, -first * second * m[2].z);
        let t6 = libm::atan2(-first * m[2].y, first * m[2].x);
        let turned = |t: f64| if t > 0.0 { t - std::f64::consts::PI } else { t + std::f64::consts::PI };
        found(0, [t4, t5, t6]);
        found(1, [turned(t4), -t5, turned(t6)]);
        Some(())
    }
}
