//! Distance from a segment to a box, in closed form.

use nalgebra::Vector3;

type V3 = Vector3<f64>;

/// Shortest distance from the segment s0 s1, given in the box's own frame, to the box with half edges `half`, m; 0 where they
/// meet.
///
/// The squared distance of the point `s0 + t d` is the sum over axes of `max(|s0_i + t d_i| - half_i, 0)^2`: convex in t and
/// quadratic between the at most six t at which a coordinate passes a face. Its slope is piecewise linear and rising, so the
/// minimum lies where the slope changes sign.
#[must_use]
#[inline]
pub fn distance_segment_box(s0: &V3, s1: &V3, half: &V3) -> f64 {
    let d = s1 - s0;
    let slope = |t: f64| {
        let mut sum = 0.0;
        for i in 0..3 {
            let x = s0[i] + t * d[i];
            sum += d[i] * (x - x.clamp(-half[i], half[i]));
        }
        sum
    };
    let distance = |t: f64| {
        let mut sum = 0.0;
        for i in 0..3 {
            let x = s0[i] + t * d[i];
            let over = (x.abs() - half[i]).max(0.0);
            sum += over * over;
        }
        sum.sqrt()
    };
    let (mut low, mut high) = (0.0, 1.0);
    let (mut at_low, mut at_high) = (slope(low), slope(high));
    if at_low >= 0.0 {
        return distance(low);
    }
    if at_high <= 0.0 {
        return distance(high);
    }
    // each face narrows the interval in which the slope changes sign
    for i in 0..3 {
        if d[i].abs() < 1e-15 {
            continue;
        }
        for face in [-half[i], half[i]] {
            let t = (face - s0[i]) / d[i];
            if t > low && t < high {
                let s = slope(t);
                if s < 0.0 {
                    (low, at_low) = (t, s);
                } else if s > 0.0 {
                    (high, at_high) = (t, s);
                } else {
                    return distance(t);
                }
            }
        }
    }
    // no face between low and high: the slope is a straight line
    distance(low - at_low * (high - low) / (at_high - at_low))
}
