//! Rigid transforms: a rotation matrix and a translation.

use crate::trig;
use nalgebra::{Matrix3, Vector3};

/// `a_from_b`: takes points of frame b into frame a.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Axes of b in a.
    pub rotation: Matrix3<f64>,
    /// Origin of b in a, m.
    pub translation: Vector3<f64>,
}

impl Pose {
    /// The transform that changes nothing.
    #[must_use]
    pub fn identity() -> Self {
        Self { rotation: Matrix3::identity(), translation: Vector3::zeros() }
    }

    /// `c_from_b` from `c_from_a` (self) and `a_from_b`.
    #[must_use]
    pub fn compose(&self, a_from_b: &Self) -> Self {
        Self { rotation: self.rotation * a_from_b.rotation, translation: self.apply(&a_from_b.translation) }
    }

    /// The point `p` of frame b in frame a.
    #[must_use]
    pub fn apply(&self, p: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * p + self.translation
    }

    /// `b_from_a`.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let r = self.rotation.transpose();
        Self { rotation: r, translation: -(r * self.translation) }
    }
}

/// `Rx(angle)`.
#[must_use]
pub fn rotation_x(angle: f64) -> Matrix3<f64> {
    let (s, c) = trig::sin_cos(angle);
    Matrix3::new(1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c)
}

/// `Ry(angle)`.
#[must_use]
pub fn rotation_y(angle: f64) -> Matrix3<f64> {
    let (s, c) = trig::sin_cos(angle);
    Matrix3::new(c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c)
}

/// `Rz(angle)`.
#[must_use]
pub fn rotation_z(angle: f64) -> Matrix3<f64> {
    let (s, c) = trig::sin_cos(angle);
    Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
}

/// `Rz(z) Ry(y) Rx(x)`, angles in rad.
#[must_use]
pub fn rotation_zyx(z: f64, y: f64, x: f64) -> Matrix3<f64> {
    rotation_z(z) * rotation_y(y) * rotation_x(x)
}

/// Angles z, y, x of `R = Rz(z) Ry(y) Rx(x)`, rad; at the singularity (|y| = 90 deg) x is taken as 0.
#[must_use]
pub fn angles_zyx(r: &Matrix3<f64>) -> [f64; 3] {
    let cy = libm::hypot(r[(0, 0)], r[(1, 0)]);
    let y = libm::atan2(-r[(2, 0)], cy);
    if cy > 1e-12 {
        // x from what Rz leaves, not from its own two elements: near the singularity z is open, but z and x must fit
        let z = libm::atan2(r[(1, 0)], r[(0, 0)]);
        let (s, c) = trig::sin_cos(z);
        [z, y, libm::atan2(s * r[(0, 2)] - c * r[(1, 2)], c * r[(1, 1)] - s * r[(0, 1)])]
    } else {
        [libm::atan2(-r[(0, 1)], r[(1, 1)]), y, 0.0]
    }
}

/// Rotation matrix of a quaternion w, x, y, z, which need not be of unit length.
#[must_use]
pub fn rotation_from_quaternion(q: [f64; 4]) -> Matrix3<f64> {
    let n = (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]).sqrt();
    let [w, x, y, z] = q.map(|c| c / n);
    Matrix3::new(
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )
}

/// Unit quaternion w, x, y, z (w >= 0) of a rotation matrix.
#[must_use]
pub fn quaternion_from_rotation(r: &Matrix3<f64>) -> [f64; 4] {
    let q = nalgebra::UnitQuaternion::from_matrix_eps(r, 1e-15, 100, nalgebra::UnitQuaternion::identity());
    let s = if q.w < 0.0 { -1.0 } else { 1.0 };
    [s * q.w, s * q.i, s * q.j, s * q.k]
}

/// Rotation vector of `r`: its axis times its angle in [0, pi].
#[must_use]
pub fn rotation_vector(r: &Matrix3<f64>) -> Vector3<f64> {
    let v = Vector3::new(r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)]) * 0.5;
    let (s, c) = (v.norm(), (r.trace() - 1.0) * 0.5);
    let angle = libm::atan2(s, c);
    if s > 1e-9 {
        v * (angle / s)
    } else if c > 0.0 {
        v
    } else {
        // half a turn: the axis is the largest column of (R + I) / 2
        let m = (r + Matrix3::identity()) * 0.5;
        let k = (0..3).max_by(|a, b| m[(*a, *a)].total_cmp(&m[(*b, *b)])).unwrap_or(0);
        m.column(k).normalize() * angle
    }
}

/// The skew matrix: `skew(a) * b = a x b`.
#[must_use]
pub fn skew(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}

/// Inverse of the left Jacobian of rotation vectors: `log(exp(d) exp(v)) = v + J_l^-1(v) d + O(d^2)`.
#[must_use]
pub fn left_jacobian_inverse(v: &Vector3<f64>) -> Matrix3<f64> {
    let angle = v.norm();
    let k = skew(v);
    let coefficient = if angle < 1e-4 {
        1.0 / 12.0 + angle * angle / 720.0
    } else {
        (1.0 - angle * 0.5 / libm::tan(angle * 0.5)) / (angle * angle)
    };
    Matrix3::identity() - k * 0.5 + k * k * coefficient
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quaternion_says_the_rotation_that_it_is_of_and_has_no_negative_w() {
        for k in 0..20 {
            let angle = |step: f64| 3.1 * (f64::from(k) * step).sin();
            let r = rotation_zyx(angle(1.0), angle(2.3), angle(0.7));
            let [w, x, y, z] = quaternion_from_rotation(&r);
            assert!(w >= 0.0 && (w * w + x * x + y * y + z * z - 1.0).abs() < 1e-12);
            assert!((rotation_from_quaternion([w, x, y, z]) - r).amax() < 1e-12);
        }
        // a quarter turn about z
        let [w, x, y, z] = quaternion_from_rotation(&rotation_z(std::f64::consts::FRAC_PI_2));
        let half = 0.5_f64.sqrt();
        assert!((w - half).abs() < 1e-12 && (z - half).abs() < 1e-12 && x.abs() + y.abs() < 1e-12);
    }
}
