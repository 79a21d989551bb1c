//! A nominal arm of six joints that turn, as closed forms take it.

use std::f64::consts::{PI, TAU};

use super::wrist;
use crate::recording::{Joints, MAX_JOINTS};
use crate::robot::Robot;
use crate::trig;

/// Nominal lengths and angles of a 6R arm, in the file's order (entry i belongs to joint i + 1).
pub(crate) struct Arm {
    pub alpha: [f64; 6],
    /// Sine and cosine of each alpha.
    pub twist: [wrist::Twist; 6],
    pub a: [f64; 6],
    pub d: [f64; 6],
    pub offset: [f64; 6],
    /// Sum of all lengths, m.
    pub size: f64,
}

impl Arm {
    pub fn of(robot: &Robot) -> Self {
        let zero = [0.0; 6];
        let mut arm = Self { alpha: zero, twist: [(0.0, 1.0); 6], a: zero, d: zero, offset: zero, size: 0.0 };
        for (i, j) in robot.joints.iter().enumerate().take(6) {
            arm.alpha[i] = j.alpha;
            arm.twist[i] = trig::sin_cos(j.alpha);
            arm.a[i] = j.a;
            arm.d[i] = j.d;
            arm.offset[i] = j.theta_offset;
            arm.size += j.a.abs() + j.d.abs();
        }
        arm.size = arm.size.max(1e-3);
        arm
    }

    pub fn zero(&self, length: f64) -> bool {
        length.abs() < 1e-9 * self.size
    }

    pub fn has_spherical_wrist(&self) -> bool {
        self.zero(self.a[4])
            && self.zero(self.d[4])
            && self.zero(self.a[5])
            && self.twist[4].0.abs() > 1e-6
            && self.twist[5].0.abs() > 1e-6
    }

    pub fn has_parallel_axes(&self) -> bool {
        [2, 3].iter().all(|i| self.twist[*i].0.abs() < 1e-9 && self.twist[*i].1 > 0.0)
            && [1, 4, 5].iter().all(|i| self.twist[*i].0.abs() > 1e-6)
            && self.zero(self.a[5])
            && !self.zero(self.a[2])
            && !self.zero(self.a[3])
    }

    pub fn theta(&self, q: &Joints) -> [f64; 6] {
        std::array::from_fn(|i| q[i] + self.offset[i])
    }

    pub fn joints(&self, theta: &[f64; 6]) -> Joints {
        let mut q = [0.0; MAX_JOINTS];
        for i in 0..6 {
            q[i] = theta[i] - self.offset[i];
        }
        q
    }
}

/// Both angles whose cosine is `x`. A little beyond 1, where the nominal arm just misses what the calibrated one may reach,
/// they are parted as far as they would be a little within, so that Newton's method does not start on a singular arm.
/// `None` further out.
pub(super) fn arc_cosines(x: f64) -> Option<[f64; 2]> {
    if x.abs() > 1.02 {
        return None;
    }
    let angle = if x.abs() <= 1.0 {
        libm::acos(x)
    } else {
        let apart = (2.0 * (x.abs() - 1.0)).sqrt();
        if x > 0.0 { apart } else { PI - apart }
    };
    Some([angle, -angle])
}

/// `x` in (-pi, pi].
pub(super) fn wrapped(x: f64) -> f64 {
    let y = x - TAU * (x / TAU).round();
    if y <= -PI { y + TAU } else { y }
}
