//! The three angles of `M = Rz(t1) Rx(a1) Rz(t2) Rx(a2) Rz(t3)`.

use nalgebra::Matrix3;

use crate::pose::{rotation_x, rotation_z};

/// Both solutions `[t1, t2, t3]`; where axes 1 and 3 coincide there is one for each choice of t1, and `start` is chosen.
/// Nothing where no t2 fits, which for a true rotation and axes at right angles does not happen.
pub(super) fn solve(m: &Matrix3<f64>, a1: f64, a2: f64, start: f64, mut found: impl FnMut([f64; 3])) {
    let (s1, c1) = a1.sin_cos();
    let (s2, c2) = a2.sin_cos();
    // z component of M z: c1 c2 - s1 s2 cos t2
    let cosine = (c1 * c2 - m[(2, 2)]) / (s1 * s2);
    if cosine.abs() > 1.02 {
        return;
    }
    // hypot of the other two components of M z says the sine better than the cosine does where it is small
    let t2 = if (s1.abs() - 1.0).abs() < 1e-9 && (s2.abs() - 1.0).abs() < 1e-9 {
        m[(0, 2)].hypot(m[(1, 2)]).atan2(cosine)
    } else {
        cosine.clamp(-1.0, 1.0).acos()
    };
    let branches: &[f64] =
        if t2.abs() < 1e-9 || (std::f64::consts::PI - t2).abs() < 1e-9 { &[1.0] } else { &[1.0, -1.0] };
    for sign in branches {
        let t2 = t2 * sign;
        // M z = Rz(t1) u
        let u = rotation_x(a1) * rotation_z(t2) * rotation_x(a2).column(2);
        let t1 = if u.x.hypot(u.y) < 1e-9 { start } else { m[(1, 2)].atan2(m[(0, 2)]) - u.y.atan2(u.x) };
        let rest = (rotation_z(t1) * rotation_x(a1) * rotation_z(t2) * rotation_x(a2)).transpose() * m;
        found([t1, t2, rest[(1, 0)].atan2(rest[(0, 0)])]);
    }
}
