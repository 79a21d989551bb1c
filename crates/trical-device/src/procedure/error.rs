//! Why a run ended before its plan did.

use std::fmt;

use thiserror::Error;

use crate::controller::ControllerError;
use crate::gauge::GaugeError;
use trical_recording::RecordError;

/// Why a run ended before its plan did.
#[derive(Debug, Error)]
pub enum ProcedureError {
    /// A setting makes no sense; nothing has moved.
    #[error("{0}")]
    Options(String),
    /// The plan has an entry that may not be driven to; nothing has moved.
    #[error("touch {} of the plan (ball {}): {violation}; nothing has moved", index + 1, ball + 1)]
    Plan {
        /// Number of the entry, counted from 0; people are told it from 1, as the plan's `order` is.
        index: u64,
        /// Which ball, counted from 0.
        ball: usize,
        /// What is wrong.
        violation: Box<Violation>,
    },
    /// The robot or the gauge failed before the first touch; nothing has moved.
    #[error("{violation}; nothing has moved")]
    Start {
        /// What is wrong.
        violation: Box<Violation>,
    },
    /// The arm stood at a touch and could not leave it.
    #[error("{violation}; the arm stands at a touch: jog it away from the ball by hand")]
    Leave {
        /// What is wrong.
        violation: Box<Violation>,
    },
    /// A touch failed.
    #[error("touch {} (ball {}): {violation}; {retreat}", index + 1, ball + 1)]
    Touch {
        /// Number of the entry, counted from 0; people are told it from 1, as the plan's `order` is.
        index: u64,
        /// Which ball, counted from 0.
        ball: usize,
        /// What went wrong.
        violation: Box<Violation>,
        /// Where the arm is now.
        retreat: RetreatOutcome,
    },
}

impl ProcedureError {
    /// What went wrong, where it was more than a setting.
    #[must_use]
    pub fn violation(&self) -> Option<&Violation> {
        match self {
            Self::Options(_) => None,
            Self::Plan { violation, .. }
            | Self::Start { violation }
            | Self::Leave { violation }
            | Self::Touch { violation, .. } => Some(violation),
        }
    }

    /// Whether the user asked for the end.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        matches!(self.violation(), Some(Violation::Cancelled | Violation::Stopped))
    }

    /// Whether what was measured is on the disk under the name of the recording, so that a run can go on: unless another program destroyed or
    /// moved it.
    #[must_use]
    pub fn goes_on(&self) -> bool {
        let gone = |error: &RecordError| {
            matches!(error, RecordError::Removed { saved: Err(_), .. } | RecordError::Moved { .. })
        };
        !self.is_cancelled() && !matches!(self.violation(), Some(Violation::Record(error)) if gone(error))
    }
}

/// What ended a touch.
#[derive(Debug, Error)]
pub enum Violation {
    /// The gauge failed.
    #[error(transparent)]
    Gauge(GaugeError),
    /// The controller failed.
    #[error(transparent)]
    Controller(ControllerError),
    /// The recording failed.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The user asked to stop.
    #[error("stopped by the user")]
    Cancelled,
    /// The user asked to stop, and the motion under way was stopped.
    #[error("stopped by the user in the middle of a motion")]
    Stopped,
    /// One correction is too long.
    #[error("the correction would be {length_mm:.3} mm, the limit is {limit_mm:.3} mm")]
    Correction {
        /// Its length in mm.
        length_mm: f64,
        /// The limit in mm.
        limit_mm: f64,
    },
    /// All corrections together are too long.
    #[error("the corrections would add up to {length_mm:.3} mm, the limit is {limit_mm:.3} mm")]
    TotalCorrection {
        /// Their sum in mm.
        length_mm: f64,
        /// The limit in mm.
        limit_mm: f64,
    },
    /// It does not converge.
    #[error(
        "after {iterations} corrections the reading is still {left_mm:.4} mm, expected less than {epsilon_mm:.4} mm"
    )]
    Iterations {
        /// Corrections made.
        iterations: usize,
        /// Length of the last reading in mm.
        left_mm: f64,
        /// What would have been accepted in mm.
        epsilon_mm: f64,
    },
    /// It moves away.
    #[error(
        "a correction made the reading grow from {before_mm:.3} mm to {after_mm:.3} mm: check the channels and signs of the gauge's axes (x=, y=, z=, flip=), and whether a joint has that much backlash"
    )]
    Diverging {
        /// Length of the reading before in mm.
        before_mm: f64,
        /// Length of the reading after in mm.
        after_mm: f64,
    },
    /// A stem does not touch, or is at the end of its stroke.
    #[error(
        "indicator {axis} reads {reading_mm:.3} mm, outside {low_mm:.3} to {high_mm:.3} mm where it touches the ball"
    )]
    NoContact {
        /// Which axis.
        axis: char,
        /// What it reads in mm.
        reading_mm: f64,
        /// Lower end in mm.
        low_mm: f64,
        /// Upper end in mm.
        high_mm: f64,
    },
    /// A channel shows the same after a motion along it.
    #[error(
        "indicator {axis} still reads {reading_mm:.4} mm after a motion of {moved_mm:.3} mm along it: its transmitter may be dead, or the stem stuck"
    )]
    Stale {
        /// Which axis.
        axis: char,
        /// What it reads in mm.
        reading_mm: f64,
        /// How far it should have changed in mm.
        moved_mm: f64,
    },
    /// A channel changes otherwise than its ball comes nearer.
    #[error(
        "indicator {axis} reads {before_mm:.4} mm just before the touch and {reading_mm:.4} mm at it; expected {expected_mm:.4} mm there within \
         {allowed_mm:.3} mm: does the stem stick, or was its zero set anew? if not, check the channels and signs of the gauge's axes (x=, y=, z=, \
         flip=), and that the device is mounted along the axes of the flange"
    )]
    WrongChange {
        /// Which axis.
        axis: char,
        /// What it reads before the touch, mm.
        before_mm: f64,
        /// What it reads at the touch, mm.
        reading_mm: f64,
        /// What it had to read before, mm.
        expected_mm: f64,
        /// The difference that is allowed, mm.
        allowed_mm: f64,
    },
    /// A channel does not follow the first part of the way out of a touch.
    #[error(
        "indicator {axis} reads {before_mm:.4} mm at the touch and {after_mm:.4} mm on the way out of it; expected a change of {least_mm:.3} mm at least: the stem is stuck, or its transmitter repeats an old value; the touch is not recorded"
    )]
    NoResponse {
        /// Which axis.
        axis: char,
        /// What it reads at the touch, mm.
        before_mm: f64,
        /// What it reads after the motion, mm.
        after_mm: f64,
        /// How much it should have changed at least, mm.
        least_mm: f64,
    },
    /// A channel reads at the approach point as if its stem touched something.
    #[error(
        "indicator {axis} reads {reading_mm:.4} mm at the approach point, where its stem is free; expected a reading outside {low_mm:.3} to {high_mm:.3} mm: the stem is stuck, its transmitter repeats an old value, or the indicator has another stroke or unit"
    )]
    NotFree {
        /// Which axis.
        axis: char,
        /// What it reads in mm.
        reading_mm: f64,
        /// Lower end of what a touch reads, in mm.
        low_mm: f64,
        /// Upper end in mm.
        high_mm: f64,
    },
    /// A free stem comes to rest at another reading than before.
    #[error(
        "indicator {axis} reads {reading_mm:.4} mm with its stem free, and read {first_mm:.4} mm there at the first touch; expected a \
         difference of {limit_mm:.3} mm at most: its zero was set anew, or it has slipped in its clamp; the touch before, if it is \
         recorded, may be wrong by as much; master the device before going on"
    )]
    ZeroMoved {
        /// Which axis.
        axis: char,
        /// What it read free at the first touch of the run, mm.
        first_mm: f64,
        /// What it reads free now, mm.
        reading_mm: f64,
        /// The difference that is allowed, mm.
        limit_mm: f64,
    },
    /// The controller reports joint values at which the arm cannot stand.
    #[error(
        "the controller reports joint {joint} at {value_deg:.3} deg, outside its limits {low_deg:.3} to {high_deg:.3} deg: jog the arm back \
         within them, or look whether robot file and controller mean the same joints, units and turns"
    )]
    StandsOutside {
        /// Which joint, counted from 1.
        joint: usize,
        /// What it reports, deg.
        value_deg: f64,
        /// Lower limit in deg.
        low_deg: f64,
        /// Upper limit in deg.
        high_deg: f64,
    },
    /// A joint is or would be outside its limits.
    #[error("joint {joint} at {value_deg:.3} deg is outside its limits {low_deg:.3} to {high_deg:.3} deg")]
    JointLimit {
        /// Which joint, counted from 1.
        joint: usize,
        /// Its value in deg.
        value_deg: f64,
        /// Lower limit in deg.
        low_deg: f64,
        /// Upper limit in deg.
        high_deg: f64,
    },
    /// The controller reports a joint value that is no number.
    #[error("the controller reports joint {joint} at {value}, expected an angle")]
    NoNumber {
        /// Which joint, counted from 1.
        joint: usize,
        /// What it reports.
        value: f64,
    },
    /// The arm is not where it was sent.
    #[error("joint {joint} was sent to {sent_deg:.4} deg and reports {found_deg:.4} deg")]
    NotArrived {
        /// Which joint, counted from 1.
        joint: usize,
        /// Where it was sent in deg.
        sent_deg: f64,
        /// What it reports in deg.
        found_deg: f64,
    },
    /// A correction moved a joint too far: near a singular pose.
    #[error(
        "a correction of {length_mm:.3} mm turns joint {joint} by {turn_deg:.3} deg, the limit is {limit_deg:.3} deg: the pose is near a singular one"
    )]
    JointChange {
        /// Which joint, counted from 1.
        joint: usize,
        /// Length of the correction in mm.
        length_mm: f64,
        /// How far the joint turns in deg.
        turn_deg: f64,
        /// The limit in deg.
        limit_deg: f64,
    },
    /// A correction moved nothing.
    #[error("the arm did not move by a correction of {length_mm:.3} mm")]
    NotMoved {
        /// Length of the correction in mm.
        length_mm: f64,
    },
    /// The collision model refuses a motion of the plan.
    #[error("the motion is refused: {0}")]
    Guard(String),
    /// The collision model refuses the way from where the arm is, and it was not driven.
    #[error(
        "the way from where the arm stands is refused ({0}) and was not driven; jog the arm by hand to a place from where the way is free"
    )]
    NoWay(String),
    /// Somebody else has moved the arm.
    #[error(
        "joint {joint} was left at {left_deg:.3} deg and is at {found_deg:.3} deg: something else has moved the arm"
    )]
    Elsewhere {
        /// Which joint, counted from 1.
        joint: usize,
        /// Where the arm stood after its last motion, deg.
        left_deg: f64,
        /// Where it is now, deg.
        found_deg: f64,
    },
}

impl From<GaugeError> for Violation {
    fn from(error: GaugeError) -> Self {
        match error {
            GaugeError::Cancelled => Self::Cancelled,
            other => Self::Gauge(other),
        }
    }
}

impl From<ControllerError> for Violation {
    fn from(error: ControllerError) -> Self {
        match error {
            ControllerError::Cancelled | ControllerError::NotBegun => Self::Cancelled,
            ControllerError::Stopped => Self::Stopped,
            other => Self::Controller(other),
        }
    }
}

/// Where the arm is after a touch that failed.
#[derive(Debug)]
pub enum RetreatOutcome {
    /// It went back the way it came.
    Done,
    /// It had not left the place where it was.
    NotNeeded,
    /// Something else has moved it, and may do so again.
    LeftAlone,
    /// It was stopped on its way, and stands there.
    Stopped,
    /// The touch was recorded, and the failure came on the way back.
    Interrupted,
    /// It could not go back.
    Failed(Box<Violation>),
}

impl fmt::Display for RetreatOutcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Done => write!(f, "the arm went back the way it came"),
            Self::NotNeeded => write!(f, "the arm had not left its place"),
            Self::LeftAlone => write!(f, "the arm is left where it stands: jog it to a free place by hand"),
            Self::Stopped => write!(f, "the arm stands where it was stopped"),
            Self::Interrupted => {
                write!(
                    f,
                    "the touch is recorded, but the arm is not back from it: look where it is, and whether it still moves"
                )
            }
            Self::Failed(why) => write!(
                f,
                "the arm could NOT go back ({why}): look where it stands, and jog it away from the ball by hand"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_goes_on_unless_the_user_ended_it_or_the_recording_is_lost() {
        let goes_on = |violation| ProcedureError::Leave { violation: Box::new(violation) }.goes_on();
        let removed = |saved| Violation::Record(RecordError::Removed { path: "run.mcap".into(), saved });
        assert!(goes_on(Violation::NotMoved { length_mm: 1.0 }) && ProcedureError::Options(String::new()).goes_on());
        assert!(!goes_on(Violation::Cancelled) && !goes_on(Violation::Stopped));
        assert!(
            goes_on(removed(Ok("saved.mcap".into()))) && !goes_on(removed(Err(std::io::ErrorKind::StorageFull.into())))
        );
        assert!(!goes_on(Violation::Record(RecordError::Moved { path: "run.mcap".into() })));
    }
}
