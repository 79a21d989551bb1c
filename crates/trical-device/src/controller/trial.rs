//! For a person who tries the controller's cable: is it there, where are the joints, a small motion.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use thiserror::Error;
use trical_model::recording::Joints;
use trical_model::{JointKind, Robot};

use super::{Controller, ControllerError, largest_difference, moved, wait_settled};

/// How a controller answers.
#[derive(Clone, Debug, PartialEq)]
pub struct Ping {
    /// Median of five answers, s.
    pub answers_in: f64,
    /// Its clock, s.
    pub clock: f64,
    /// degC, where it has a sensor.
    pub temp_c: Option<f64>,
}

/// Asks five times; nothing moves.
///
/// # Errors
/// No or a wrong answer.
pub fn ping(controller: &mut dyn Controller) -> Result<Ping, ControllerError> {
    let mut times = Vec::new();
    for _ in 0..5 {
        let begin = Instant::now();
        controller.ping()?;
        times.push(begin.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    let answers_in = times.get(times.len() / 2).copied().unwrap_or(f64::NAN);
    Ok(Ping { answers_in, clock: controller.clock()?, temp_c: controller.temperature()? })
}

/// Where a small motion goes.
#[derive(Clone, Debug, PartialEq)]
pub enum Jog {
    /// One joint (from 0) goes on, rad (m).
    Joint(usize, f64),
    /// All joints go there, rad (m).
    Joints(Vec<f64>),
    /// The tool goes along its own axes, m.
    Tool([f64; 3]),
}

/// Farthest that the tool is jogged along one of its axes, m.
pub const FAR_TOOL: f64 = 5e-3;
/// Farthest that a joint may be jogged, whatever is asked for, deg (mm of one that slides).
pub const FAR_JOINT: f64 = 720.0;
/// Fastest that it is jogged, m/s.
pub const FAST: f64 = 0.25;

/// Why a small motion is refused; nothing has moved.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum JogError {
    /// There is no such joint.
    #[error("found joint {found}, expected 1 to {joints}")]
    NoJoint {
        /// The joint, counted from 1.
        found: usize,
        /// How many there are.
        joints: usize,
    },
    /// Joint values that are not one for each joint.
    #[error("found {found} numbers, expected {joints}, one for each joint")]
    Count {
        /// How many came.
        found: usize,
        /// How many there are.
        joints: usize,
    },
    /// A robot with another number of joints.
    #[error("{robot}: found {found} joints, expected {joints}, as the controller says")]
    OtherArm {
        /// Its name.
        robot: String,
        /// Its joints.
        found: usize,
        /// The controller's.
        joints: usize,
    },
    /// The motion is not small.
    #[error("joint {joint} would go {by:.3} {unit}, the limit is {limit} {unit}")]
    Far {
        /// Which joint, counted from 1.
        joint: usize,
        /// How far.
        by: f64,
        /// The limit.
        limit: f64,
        /// deg or mm.
        unit: &'static str,
    },
    /// What a motion may be at most makes no sense.
    #[error("no joint is to go farther than {0}; expected more than 0 and up to 720")]
    Most(f64),
    /// The tool would go far.
    #[error("found {0:?}, expected three numbers of 5 mm at most")]
    FarTool([f64; 3]),
    /// Beyond the limits of the arm.
    #[error("joint {joint} would go to {to:.3} {unit}, outside its limits {lower:.1} to {upper:.1} {unit}")]
    Limits {
        /// Which joint, counted from 1.
        joint: usize,
        /// Where to.
        to: f64,
        /// Least.
        lower: f64,
        /// Largest.
        upper: f64,
        /// deg or mm.
        unit: &'static str,
    },
    /// A speed that makes no sense.
    #[error("found a speed of {0} mm/s, expected more than 0 and up to 250")]
    Speed(f64),
}

/// What people read and type a joint (from 0) in: the unit in SI, and its name. Where the arm is not known, each joint turns.
#[must_use]
pub fn shown_in(robot: Option<&Robot>, joint: usize) -> (f64, &'static str) {
    match robot.and_then(|robot| robot.joints.get(joint)) {
        Some(joint) if joint.kind == JointKind::Prismatic => (1e-3, "mm"),
        _ => (1_f64.to_radians(), "deg"),
    }
}

impl Jog {
    /// Where the joints go by it, `from` where they stand; the tool's motion is left to the controller.
    ///
    /// # Errors
    /// A motion that is not small (`most` rad for a joint, for a sliding one as many mm as that is deg), or beyond the limits of
    /// `robot`, where it is known.
    pub fn target(&self, from: &Joints, joints: usize, most: f64, robot: Option<&Robot>) -> Result<Joints, JogError> {
        if let Some(robot) = robot.filter(|r| r.dof() != joints) {
            return Err(JogError::OtherArm { robot: robot.name.clone(), found: robot.dof(), joints });
        }
        let mut to = *from;
        match self {
            Self::Joint(joint, by) => {
                let q = to.get_mut(*joint).filter(|_| *joint < joints);
                *q.ok_or(JogError::NoJoint { found: joint + 1, joints })? += by;
            }
            Self::Joints(all) => {
                if all.len() != joints {
                    return Err(JogError::Count { found: all.len(), joints });
                }
                to.iter_mut().zip(all).for_each(|(to, q)| *to = *q);
            }
            Self::Tool(by) => {
                if by.iter().any(|v| !(-FAR_TOOL..=FAR_TOOL).contains(v)) {
                    return Err(JogError::FarTool(by.map(|v| v * 1e3)));
                }
            }
        }
        let limit = trical_model::robot::tidy(most.to_degrees());
        if !(limit > 0.0 && limit <= FAR_JOINT) {
            return Err(JogError::Most(limit));
        }
        for (k, (a, b)) in from.iter().zip(&to).enumerate() {
            let (si, unit) = shown_in(robot, k);
            let by = (b - a) / si;
            if !(-limit..=limit).contains(&by) {
                return Err(JogError::Far { joint: k + 1, by, limit, unit });
            }
        }
        for (k, (joint, q)) in robot.iter().flat_map(|r| &r.joints).zip(&to).enumerate() {
            let [lower, upper] = joint.limits;
            if !(lower..=upper).contains(q) {
                let (si, unit) = shown_in(robot, k);
                let [to, lower, upper] = [*q, lower, upper].map(|v| v / si);
                return Err(JogError::Limits { joint: k + 1, to, lower, upper, unit });
            }
        }
        Ok(to)
    }

    /// Moves, at a speed of the tool in m/s; `to` as [`Jog::target`] gave it.
    ///
    /// # Errors
    /// The controller refuses or does not answer in time, or joints that were sent somewhere are not there.
    pub fn go(&self, controller: &mut dyn Controller, to: &Joints, speed: f64) -> Result<(), ControllerError> {
        controller.set_speed(speed, 10_f64.to_radians())?;
        match self {
            Self::Tool(by) => {
                let settle = controller.joint_settle();
                let stands = |c: &mut dyn Controller| wait_settled(c, &settle, &AtomicBool::new(false));
                let before = stands(controller)?;
                controller.correct(*by)?;
                let still = largest_difference(&before, &stands(controller)?).1 == 0.0 && by.iter().any(|v| *v != 0.0);
                let why = "answered that it did, and all joints are as before";
                if still { Err(ControllerError::refused(&controller.name(), "move the tool", why)) } else { Ok(()) }
            }
            _ => moved(controller, to),
        }
    }
}

/// A speed of the tool in m/s, if it is one for trying.
///
/// # Errors
/// Zero, negative, or faster than manual mode.
pub fn check_speed(speed: f64) -> Result<(), JogError> {
    if speed > 0.0 && speed <= FAST { Ok(()) } else { Err(JogError::Speed(speed * 1e3)) }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_jog_beyond_what_is_small_is_refused_and_nothing_else_is() {
        let text = include_str!("../../../../cells/irb120/robot.toml");
        let robot = Robot::parse(text, "robot.toml").unwrap();
        let says = |jog: Jog| {
            let to = jog.target(&Joints::default(), 6, 5_f64.to_radians(), Some(&robot));
            to.map_or_else(|e| e.to_string(), |to| format!("{:.3} {:.3}", to[0].to_degrees(), to[1].to_degrees()))
        };
        let deg = f64::to_radians;
        assert_eq!(says(Jog::Joint(1, deg(5.0))), "0.000 5.000");
        assert_eq!(says(Jog::Joint(1, deg(-5.1))), "joint 2 would go -5.100 deg, the limit is 5 deg");
        assert_eq!(says(Jog::Joint(6, deg(1.0))), "found joint 7, expected 1 to 6");
        assert_eq!(says(Jog::Joints(vec![deg(1.0), deg(2.0), 0.0, 0.0, 0.0, 0.0])), "1.000 2.000");
        let far = says(Jog::Joints(vec![0.0, 0.0, 0.0, 0.0, 0.0, deg(6.0)]));
        assert_eq!(far, "joint 6 would go 6.000 deg, the limit is 5 deg");
        assert_eq!(says(Jog::Joints(vec![0.0; 5])), "found 5 numbers, expected 6, one for each joint");
        assert_eq!(says(Jog::Tool([FAR_TOOL, -FAR_TOOL, 0.0])), "0.000 0.000");
        for by in [5.001e-3, -5.001e-3, f64::NAN] {
            let refused = says(Jog::Tool([0.0, by, 0.0]));
            assert!(refused.ends_with("expected three numbers of 5 mm at most"), "{by}: {refused}");
        }
        let other = Jog::Joint(0, 0.0).target(&Joints::default(), 7, 1.0, Some(&robot)).unwrap_err();
        assert_eq!(other.to_string(), "ABB IRB 120-3/0.6: found 6 joints, expected 7, as the controller says");
        assert!(check_speed(FAST).is_ok() && check_speed(0.0).is_err() && check_speed(FAST * 1.001).is_err());
    }

    #[test]
    fn a_sliding_joint_goes_by_mm_and_within_its_limits() {
        let text = include_str!("../../../../cells/irb120/robot.toml");
        let mut robot = Robot::parse(text, "robot.toml").unwrap();
        (robot.joints[0].kind, robot.joints[0].limits) = (JointKind::Prismatic, [0.0, 0.1]);
        let says = |by: f64, from: f64| {
            let mut at = Joints::default();
            at[0] = from;
            let to = Jog::Joint(0, by).target(&at, robot.dof(), 5_f64.to_radians(), Some(&robot));
            to.map_or_else(|e| e.to_string(), |to| format!("{:.3}", to[0]))
        };
        assert_eq!(says(5e-3, 0.0), "0.005");
        assert_eq!(says(-5e-3, 0.0), "joint 1 would go to -5.000 mm, outside its limits 0.0 to 100.0 mm");
        assert_eq!(says(6e-3, 0.0), "joint 1 would go 6.000 mm, the limit is 5 mm");
        for most in [f64::INFINITY, f64::NAN, 0.0, 20.0] {
            let refused = Jog::Joint(1, 0.1).target(&Joints::default(), 6, most, None).unwrap_err().to_string();
            assert!(refused.contains("expected more than 0 and up to 720"), "{refused}");
        }
    }
}
