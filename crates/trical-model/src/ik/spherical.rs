//! Arms whose last three axes meet in a point, in closed form (Pieper 1968; Craig, Introduction to Robotics, section 4.6):
//! up to eight branches. Any nominal twists and lengths of the first three links.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, TAU};

use nalgebra::{Complex, Matrix3, Vector3};

use super::arm::{Arm, arc_cosines, wrapped};
use super::wrist;
use crate::pose::{Pose, rotation_x};
use crate::trig;

type V3 = Vector3<f64>;

/// Angles theta of the nominal arm with its flange at `base_from_flange`; `start` chooses where two axes coincide.
pub(super) fn solve(arm: &Arm, base_from_flange: &Pose, start: &[f64; 6], out: &mut Vec<[f64; 6]>) {
    let Arm { alpha, twist, a, d, .. } = arm;
    let undo = rotation_x(-alpha[0]);
    let r = undo * base_from_flange.rotation;
    // centre of the wrist in the frame in which joint 1 turns about z
    let v = undo * base_from_flange.translation - V3::new(a[0], 0.0, d[0]) - r.column(2) * d[5];
    let (s3, c3) = twist[3];
    let wrist_in_3 = V3::new(a[3], -s3 * d[3], c3 * d[3]);
    positions(arm, &v, &wrist_in_3, start, |t1, t2, t3| {
        // (Rz(t1) Rx(a1) Rz(t2) Rx(a2) Rz(t3) Rx(a3))' r, factor by factor
        let mut m = r;
        for (t, a) in [(t1, twist[1]), (t2, twist[2]), (t3, twist[3])] {
            let (s, c) = trig::sin_cos(t);
            m = turn_back(&turn_back(&m, [0, 1], s, c), [1, 2], a.0, a.1);
        }
        wrist::solve(&m, twist[4], twist[5], start[3], |[t4, t5, t6]| {
            out.push([t1, t2, t3, t4, t5, t6].map(wrapped));
        });
    });
}

/// The product of `m` with the inverse of a rotation by an angle with this sine and cosine, which takes row `rows[0]` towards
/// row `rows[1]`.
#[inline]
fn turn_back(m: &Matrix3<f64>, rows: [usize; 2], s: f64, c: f64) -> Matrix3<f64> {
    let (mut out, [i, j]) = (*m, rows);
    for k in 0..3 {
        out[(i, k)] = c * m[(i, k)] + s * m[(j, k)];
        out[(j, k)] = c * m[(j, k)] - s * m[(i, k)];
    }
    out
}

/// The first three angles that bring the wrist's centre to `v`.
fn positions(arm: &Arm, v: &V3, wrist_in_3: &V3, start: &[f64; 6], mut found: impl FnMut(f64, f64, f64)) {
    let Arm { twist, a, d, .. } = arm;
    let ((s1, c1), (s2, c2)) = (twist[1], twist[2]);
    let r2 = v.norm_squared();
    let (no_offset, no_twist) = (arm.zero(a[1]), s1.abs() < 1e-9);
    if no_offset && no_twist {
        return;
    }
    // wrist in {2}, along axis 2 from the origin of {1}: a function of theta 3, by its sine and cosine
    let f = |(s, c): (f64, f64)| {
        let h = V3::new(
            c * wrist_in_3.x - s * wrist_in_3.y + a[2],
            s * wrist_in_3.x + c * wrist_in_3.y,
            wrist_in_3.z + d[2],
        );
        V3::new(h.x, c2 * h.y - s2 * h.z, s2 * h.y + c2 * h.z + d[1])
    };
    // what is left of |v|^2 and of v.z after the part that theta 2 cannot change
    let left = |f: &V3| (r2 - f.norm_squared() - a[1] * a[1], v.z - c1 * f.z);
    let scale = arm.size * arm.size;
    let equation = |t3: (f64, f64)| {
        let f = f(t3);
        let (square, height) = left(&f);
        if no_offset {
            square / scale
        } else if no_twist {
            height / arm.size
        } else {
            let s = s1 * s1;
            let plane = f.x * f.x + f.y * f.y;
            (square * square * s + 4.0 * a[1] * a[1] * (height * height - s * plane)) / (scale * scale)
        }
    };
    for t3 in roots(equation) {
        let f = f(trig::sin_cos(t3));
        let (square, height) = left(&f);
        let (reach, turn) = (libm::hypot(f.x, f.y), libm::atan2(f.y, f.x));
        // (cos t2 + i sin t2)(f.x + i f.y) = cosine + i sine
        let mut second = |t2: f64| {
            let (s, c) = trig::sin_cos(t2);
            let (x, y) = (c * f.x - s * f.y + a[1], c1 * (s * f.x + c * f.y) - s1 * f.z);
            let t1 = if libm::hypot(v.x, v.y) < 1e-9 * arm.size {
                start[0]
            } else {
                libm::atan2(v.y, v.x) - libm::atan2(y, x)
            };
            found(t1, t2, t3);
        };
        if no_offset || no_twist {
            if reach < 1e-9 * arm.size {
                second(start[1]);
                continue;
            }
            let x = if no_offset { height / s1 } else { square / (2.0 * a[1]) } / reach;
            // sin(t2 + turn) = x, or cos(t2 + turn) = x
            let turn = if no_offset { turn - FRAC_PI_2 } else { turn };
            arc_cosines(x).into_iter().flatten().for_each(|t| second(t - turn));
        } else {
            second(libm::atan2(height / s1, square / (2.0 * a[1])) - turn);
        }
    }
}

/// Roots of a trigonometric polynomial of degree 2 at most, rad, in rising order; near misses (a double root that rounding or
/// a small error of the arm has parted from the real axis) count as roots.
fn roots(g: impl Fn((f64, f64)) -> f64) -> Vec<f64> {
    // sines of the multiples of 45 deg; Fourier coefficients from eight samples are exact up to degree 3
    const H: f64 = FRAC_1_SQRT_2;
    const SINE: [f64; 8] = [0.0, H, 1.0, H, 0.0, -H, -1.0, -H];
    let at = |k: usize| (SINE[k % 8], SINE[(k + 2) % 8]);
    let mut c = [Complex::new(0.0, 0.0); 5];
    for k in 0..8 {
        let value = g(at(k)) / 8.0;
        for (m, c) in c.iter_mut().enumerate() {
            // e^(-i k (m - 2) 45 deg)
            let (s, cos) = at(k * (10 - m));
            *c += Complex::new(value * cos, value * s);
        }
    }
    let size = c.iter().map(|c| c.norm()).fold(0.0, f64::max);
    if size < 1e-300 {
        return Vec::new();
    }
    // sum of c_m z^m, z on the unit circle; the ends are conjugates and vanish together
    let small = |c: &Complex<f64>| c.norm() < 1e-11 * size;
    let used: &[Complex<f64>] = if !small(&c[4]) {
        &c
    } else if !small(&c[3]) {
        &c[1..4]
    } else {
        return Vec::new();
    };
    let mut found: Vec<f64> = Vec::with_capacity(4);
    for z in polynomial_roots(used) {
        let off = (z.norm() - 1.0).abs();
        if off < 0.2 {
            // a pair off the circle would be as far apart on it, were the wrist as far within reach as it is without
            for t in [z.arg() - off, z.arg() + off] {
                if !found.iter().any(|f| wrapped(f - t).abs() < 1e-7) {
                    found.push(t);
                }
            }
        }
    }
    found.sort_by(f64::total_cmp);
    found
}

/// Roots of `sum c_m z^m` by Durand's and Kerner's simultaneous iteration.
fn polynomial_roots(c: &[Complex<f64>]) -> Vec<Complex<f64>> {
    let degree = c.len() - 1;
    let lead = c[degree];
    if degree == 2 {
        let root = (c[1] * c[1] - lead * c[0] * 4.0).sqrt();
        return vec![(-c[1] + root) / (lead * 2.0), (-c[1] - root) / (lead * 2.0)];
    }
    let mut z: Vec<Complex<f64>> = (0..degree)
        .map(|k| {
            let angle = 0.4 + TAU * k as f64 / degree as f64;
            Complex::from_polar(1.1, angle)
        })
        .collect();
    for _ in 0..200 {
        let mut change: f64 = 0.0;
        for k in 0..degree {
            let x = z[k];
            let value = c.iter().rev().fold(Complex::new(0.0, 0.0), |s, c| s * x + c) / lead;
            let mut apart = Complex::new(1.0, 0.0);
            for (m, y) in z.iter().enumerate() {
                if m != k {
                    apart *= x - y;
                }
            }
            if apart.norm() < 1e-300 {
                continue;
            }
            let step = value / apart;
            z[k] -= step;
            change = change.max(step.norm());
        }
        if change < 1e-14 {
            break;
        }
    }
    z
}
