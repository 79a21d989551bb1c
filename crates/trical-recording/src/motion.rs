//! Joint samples, and the sense of each joint's last motion.

use trical_model::recording::{Joints, MAX_JOINTS};

/// Where the joints stood at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSample {
    /// Time in s, on the clock of whoever took the sample.
    pub t: f64,
    /// Joint values in rad (m for prismatic joints).
    pub q: Joints,
}

/// Follows joint values and knows the sense of each joint's last motion.
///
/// A joint changes its sense when it has moved by more than the dead band against it; smaller wiggles (resolver noise,
/// rounding to five decimals of a degree) leave the sense as it is.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionSense {
    dead_band: f64,
    reference: Option<Joints>,
    sense: [i8; MAX_JOINTS],
}

impl MotionSense {
    /// Dead band in use where nothing else is known, rad: 0.0001 deg, ten times the last decimal of the wire.
    ///
    /// The noise of real joint readings is not known \[I\]: the procedure measures it before the arm moves, and takes a larger value
    /// where it is needed.
    pub const DEAD_BAND: f64 = 0.0001_f64.to_radians();

    /// Nothing known yet: all senses are 0. `dead_band` in rad.
    #[must_use]
    pub fn new(dead_band: f64) -> Self {
        Self { dead_band, reference: None, sense: [0; MAX_JOINTS] }
    }

    /// Takes the next joint values, in the order of time.
    pub fn push(&mut self, q: &Joints) {
        let Some(reference) = &mut self.reference else {
            self.reference = Some(*q);
            return;
        };
        for ((sense, reference), &q) in self.sense.iter_mut().zip(reference).zip(q) {
            let moved = q - *reference;
            if moved > self.dead_band {
                *sense = 1;
                *reference = q;
            } else if moved < -self.dead_band {
                *sense = -1;
                *reference = q;
            } else if (*sense > 0 && moved > 0.0) || (*sense < 0 && moved < 0.0) {
                *reference = q;
            }
        }
    }

    /// Sense of each joint's last motion: -1, 0 (not moved yet) or 1.
    #[must_use]
    pub fn sense(&self) -> [i8; MAX_JOINTS] {
        self.sense
    }
}

impl Default for MotionSense {
    fn default() -> Self {
        Self::new(Self::DEAD_BAND)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(q1: f64) -> Joints {
        let mut q = [0.0; MAX_JOINTS];
        q[0] = q1;
        q
    }

    #[test]
    fn senses_follow_the_last_motion_and_ignore_wiggles() {
        let mut motion = MotionSense::new(1e-3);
        motion.push(&at(0.0));
        assert_eq!(motion.sense()[0], 0);
        motion.push(&at(0.1));
        assert_eq!(motion.sense()[0], 1);
        motion.push(&at(0.0995));
        assert_eq!(motion.sense()[0], 1);
        motion.push(&at(0.0985));
        assert_eq!(motion.sense()[0], -1);
        motion.push(&at(0.0985));
        assert_eq!(motion.sense(), [-1, 0, 0, 0, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn slow_motion_in_steps_below_the_dead_band_still_counts() {
        let mut motion = MotionSense::new(1e-3);
        for step in 0..20 {
            motion.push(&at(-1e-4 * f64::from(step)));
        }
        assert_eq!(motion.sense()[0], -1);
    }
}
