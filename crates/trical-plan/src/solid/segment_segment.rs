//! Distance between two segments, in closed form (Ericson, Real-Time Collision Detection, section 5.1.9).

use nalgebra::Vector3;

type V3 = Vector3<f64>;

/// Shortest distance between the segments a0 a1 and b0 b1, m; either may be a point. 0 where they cross.
///
/// ```
/// # use nalgebra::Vector3;
/// # use trical_plan::solid::distance_segment_segment;
/// // two edges of a unit cube that do not meet
/// let d = distance_segment_segment(
///     &Vector3::new(0.0, 0.0, 0.0), &Vector3::new(1.0, 0.0, 0.0),
///     &Vector3::new(0.0, 1.0, 1.0), &Vector3::new(0.0, 0.0, 1.0),
/// );
/// assert_eq!(d, 1.0);
/// ```
#[must_use]
#[inline]
pub fn distance_segment_segment(a0: &V3, a1: &V3, b0: &V3, b1: &V3) -> f64 {
    let (u, v, w) = (a1 - a0, b1 - b0, a0 - b0);
    let (a, e, f) = (u.norm_squared(), v.norm_squared(), v.dot(&w));
    const POINT: f64 = 1e-24;
    let (s, t);
    if a <= POINT && e <= POINT {
        return w.norm();
    }
    if a <= POINT {
        s = 0.0;
        t = (f / e).clamp(0.0, 1.0);
    } else {
        let c = u.dot(&w);
        if e <= POINT {
            t = 0.0;
            s = (-c / a).clamp(0.0, 1.0);
        } else {
            let b = u.dot(&v);
            let denominator = a * e - b * b;
            // (nearly) parallel: any s will do, the clamping of t and then s finds the nearest pair
            let s0 = if denominator > 1e-12 * a * e { ((b * f - c * e) / denominator).clamp(0.0, 1.0) } else { 0.0 };
            let t0 = (b * s0 + f) / e;
            if t0 < 0.0 {
                t = 0.0;
                s = (-c / a).clamp(0.0, 1.0);
            } else if t0 > 1.0 {
                t = 1.0;
                s = ((b - c) / a).clamp(0.0, 1.0);
            } else {
                t = t0;
                s = s0;
            }
        }
    }
    (w + u * s - v * t).norm()
}
