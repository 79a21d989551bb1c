//! The three angles of `M = Rz(t1) Rx(a1) Rz(t2) Rx(a2) Rz(t3)`.

use crate::trig;
use nalgebra::{Matrix3, Vector3};

/// A twist that is the same at every pose: sine and cosine of it.
pub(super) type Twist = (f64, f64);

/// Both solutions `[t1, t2, t3]`; where axes 1 and 3 coincide there is one for each choice of t1, and `start` is chosen.
/// Nothing where no t2 fits, which for a true rotation and axes at right angles does not happen.
pub(super) fn solve(m: &Matrix3<f64>, a1: Twist, a2: Twist, start: f64, mut found: impl FnMut([f64; 3])) {
    let ((s1, c1), (s2, c2)) = (a1, a2);
    // z component of M z: c1 c2 - s1 s2 cos t2
    let cosine = (c1 * c2 - m[(2, 2)]) / (s1 * s2);
    if cosine.abs() > 1.02 {
        return;
    }
    // hypot of the other two components of M z says the sine better than the cosine does where it is small
    let t2 = if (s1.abs() - 1.0).abs() < 1e-9 && (s2.abs() - 1.0).abs() < 1e-9 {
        libm::atan2(libm::hypot(m[(0, 2)], m[(1, 2)]), cosine)
    } else {
        libm::acos(cosine.clamp(-1.0, 1.0))
    };
    let branches: &[f64] =
        if t2.abs() < 1e-9 || (std::f64::consts::PI - t2).abs() < 1e-9 { &[1.0] } else { &[1.0, -1.0] };
    let (sin, cos) = trig::sin_cos(t2);
    for sign in branches {
        let (t2, sin) = (t2 * sign, sin * sign);
        // columns of Rx(a1) Rz(t2) Rx(a2); M z = Rz(t1) z
        let x = Vector3::new(cos, c1 * sin, s1 * sin);
        let before = (Vector3::new(-sin, c1 * cos, s1 * cos), Vector3::new(0.0, -s1, c1));
        let (y, z) = (before.0 * c2 + before.1 * s2, before.1 * c2 - before.0 * s2);
        let t1 = if z.x * z.x + z.y * z.y < 1e-18 {
            start
        } else {
            libm::atan2(m[(1, 2)], m[(0, 2)]) - libm::atan2(z.y, z.x)
        };
        // what is left of M's first column after Rz(t1), along x and y
        let (s, c) = trig::sin_cos(t1);
        let left = Vector3::new(c * m[(0, 0)] + s * m[(1, 0)], c * m[(1, 0)] - s * m[(0, 0)], m[(2, 0)]);
        found([t1, t2, libm::atan2(y.dot(&left), x.dot(&left))]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    /// Near the straight wrist the cosine of its angle says nothing below 1e-8 rad.
    #[test]
    fn a_small_angle_of_the_wrist_keeps_its_digits() {
        let about = |axis: Vector3<f64>, angle: f64| Rotation3::from_scaled_axis(axis * angle);
        let right = std::f64::consts::FRAC_PI_2;
        for t2 in [3e-9, 1e-6, 1e-3, 0.7, -0.7] {
            let m = about(Vector3::z(), 0.4)
                * about(Vector3::x(), right)
                * about(Vector3::z(), t2)
                * about(Vector3::x(), -right)
                * about(Vector3::z(), -0.9);
            let mut nearest = f64::INFINITY;
            solve(m.matrix(), (1.0, 0.0), (-1.0, 0.0), 0.0, |t| nearest = nearest.min((t[1] - t2).abs()));
            assert!(nearest < 1e-15, "{t2}: {nearest} off");
        }
    }
}
