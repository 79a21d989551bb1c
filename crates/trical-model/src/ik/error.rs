//! Why an arm cannot take a pose.

use thiserror::Error;

/// Why the arm cannot take a pose.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum IkError {
    /// The arm reaches the pose only with a joint beyond its limits; the branch that is least beyond is told.
    #[error(
        "joint {joint} would have to be at {:.3} deg, and its limits are {:.3} to {:.3} deg",
        value_rad.to_degrees(), lower_rad.to_degrees(), upper_rad.to_degrees()
    )]
    OutOfLimits {
        /// 1-based.
        joint: usize,
        /// Where it would be.
        value_rad: f64,
        /// Its lower limit.
        lower_rad: f64,
        /// Its upper limit.
        upper_rad: f64,
    },
    /// As [`IkError::OutOfLimits`] for a joint that slides.
    #[error(
        "joint {joint} would have to be at {:.3} mm, and its limits are {:.3} to {:.3} mm",
        value_m * 1e3, lower_m * 1e3, upper_m * 1e3
    )]
    OutOfTravel {
        /// 1-based.
        joint: usize,
        /// Where it would be.
        value_m: f64,
        /// Its lower limit.
        lower_m: f64,
        /// Its upper limit.
        upper_m: f64,
    },
    /// The arm loses a direction near the pose and cannot be brought onto it.
    #[error(
        "the arm is singular near the pose and stays {:.6} mm and {:.6} deg off it",
        miss_m * 1e3, miss_rad.to_degrees()
    )]
    Singular {
        /// Distance left, m.
        miss_m: f64,
        /// Angle left, rad.
        miss_rad: f64,
    },
    /// The arm is too short, or too close, whatever its joints do.
    #[error("the pose is out of reach: the nearest that was found is {:.3} mm and {:.3} deg off it", miss_m * 1e3, miss_rad.to_degrees())]
    Unreachable {
        /// Distance left, m.
        miss_m: f64,
        /// Angle left, rad.
        miss_rad: f64,
    },
    /// The iteration ended without an answer.
    #[error(
        "no solution after {iterations} iterations: {:.6} mm and {:.6} deg are left",
        miss_m * 1e3, miss_rad.to_degrees()
    )]
    NotConverged {
        /// How many.
        iterations: usize,
        /// Distance left, m.
        miss_m: f64,
        /// Angle left, rad.
        miss_rad: f64,
    },
    /// The pose is not one: a number is not finite, or the rotation is none.
    #[error("the pose to reach is not a rigid transform of finite numbers")]
    NotAPose,
}
