//! Arms whose axes 2, 3 and 4 are parallel (Universal Robots and their kind), in closed form: up to eight branches.

use std::f64::consts::FRAC_PI_2;

use nalgebra::Vector3;

use super::arm::{Arm, arc_cosines, wrapped};
use super::wrist;
use crate::pose::{Pose, rotation_x, rotation_z};
use crate::trig;

/// Angles theta of the nominal arm with its flange at `base_from_flange`; `start` chooses where the wrist is singular.
pub(super) fn solve(arm: &Arm, base_from_flange: &Pose, start: &[f64; 6], out: &mut Vec<[f64; 6]>) {
    let Arm { alpha, twist, a, d, .. } = arm;
    // in the frame in which joint 1 turns about z
    let undo = rotation_x(-alpha[0]);
    let r = undo * base_from_flange.rotation;
    let p = undo * base_from_flange.translation - Vector3::new(a[0], 0.0, d[0]);
    // the origin of frame {5} keeps its distance along the parallel axes from axis 1's origin
    let o5 = p - r.column(2) * d[5];
    let ((s1, c1), (s4, c4)) = (twist[1], twist[4]);
    let along = d[1] + d[2] + d[3] + c4 * d[4];
    // (s1 sin t1, -s1 cos t1, c1) . o5 = along
    let radius = libm::hypot(o5.x, o5.y);
    if radius < 1e-12 {
        return;
    }
    let sine = (along - c1 * o5.z) / (s1 * radius);
    // sin(t1 - towards) = sine
    let towards = libm::atan2(o5.y, o5.x) + FRAC_PI_2;
    for t1 in arc_cosines(sine).into_iter().flatten().map(|t| t + towards) {
        let shoulder = (rotation_z(t1) * rotation_x(alpha[1])).transpose();
        let m = shoulder * r;
        wrist::solve(&m, twist[4], twist[5], start[1] + start[2] + start[3], |[sum, t5, t6]| {
            let five = Vector3::new(a[4], -s4 * d[4], c4 * d[4]);
            let o4 = shoulder * o5 - rotation_z(sum) * five - Vector3::new(a[1], 0.0, 0.0);
            let reach2 = o4.x * o4.x + o4.y * o4.y;
            let cosine = (reach2 - a[2] * a[2] - a[3] * a[3]) / (2.0 * a[2] * a[3]);
            for t3 in arc_cosines(cosine).into_iter().flatten() {
                let (s3, c3) = trig::sin_cos(t3);
                let t2 = libm::atan2(o4.y, o4.x) - libm::atan2(a[3] * s3, a[2] + a[3] * c3);
                out.push([t1, t2, t3, sum - t2 - t3, t5, t6].map(wrapped));
            }
        });
    }
}
