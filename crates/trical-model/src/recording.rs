//! What is known about a pose and what was measured there: plain data, no files.
//!
//! Everything is SI (m, rad, s, kg) except temperature, which stays in degrees Celsius. Files are read by
//! `trical-recording`.

/// The largest number of joints of an arm.
pub const MAX_JOINTS: usize = 9;

/// Joint values, joint 1 first, in rad (m for prismatic joints); entries beyond the arm's joints are zero.
pub type Joints = [f64; MAX_JOINTS];

/// What is known about the arm when a measurement was taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// Joint values that the model uses: those that the controller reported, unless told otherwise.
    pub q: Joints,
    /// Joint values that were commanded, where recorded.
    pub q_commanded: Option<Joints>,
    /// Sense of each joint's last motion before the reading: -1, 0 (unknown or none) or 1, where recorded.
    pub dir: Option<[i8; MAX_JOINTS]>,
    /// Time since the recording began, in s.
    pub t: Option<f64>,
    /// Number of the pose in the order of time, counted from where the recording says: what tells earlier from later without a clock.
    pub seq: Option<f64>,
    /// Temperature in degC.
    pub temp_c: Option<f64>,
    /// Mass added on the flange beyond the cell's tool, in kg.
    pub payload_kg: Option<f64>,
    /// Measured joint torques, joint 1 first, in N m (N for prismatic joints), where the arm has sensors; entries beyond the
    /// arm's joints are zero.
    pub torques: Option<Joints>,
    /// Where the set of balls stood: index into the recording's [`Recording::places`].
    pub place: Option<usize>,
    /// Session of the model that it belongs to, from 1: what was identified for that session alone holds here. `None` for a session that
    /// the model does not know.
    pub session: Option<u32>,
}

impl State {
    /// A pose of which nothing but the joint values is known.
    #[must_use]
    pub fn at(q: &[f64]) -> Self {
        let mut joints = [0.0; MAX_JOINTS];
        for (to, from) in joints.iter_mut().zip(q) {
            *to = *from;
        }
        Self {
            q: joints,
            q_commanded: None,
            dir: None,
            t: None,
            seq: None,
            temp_c: None,
            payload_kg: None,
            torques: None,
            place: None,
            session: None,
        }
    }

    /// The same at the pose of this number.
    #[must_use]
    pub fn numbered(self, seq: Option<u64>) -> Self {
        Self { seq: seq.map(|number| number as f64), ..self }
    }
}

/// What was measured at a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Measured {
    /// The device touches a ball: `reading` is the ball's centre relative to the TCP, in the device's axes, m.
    Touch {
        /// Which ball, counted from 0.
        ball: usize,
        /// The three indicators, m.
        reading: [f64; 3],
    },
    /// A target on the tool, seen by an instrument in its own measuring frame.
    Point {
        /// Which target of the tool, counted from 0.
        target: usize,
        /// Position in the measuring frame, m.
        position: [f64; 3],
    },
    /// A fixed point of the cell, measured again to tie the measuring frame down.
    Reference {
        /// Which reference, counted from 0.
        reference: usize,
        /// Position in the measuring frame, m.
        position: [f64; 3],
    },
    /// Length from a fixed anchor to the TCP.
    Distance {
        /// Which anchor, counted from 0.
        anchor: usize,
        /// Length, m.
        length: f64,
    },
    /// Full pose of the tool in the measuring frame.
    Pose {
        /// Position in the measuring frame, m.
        position: [f64; 3],
        /// Unit quaternion w, x, y, z: measuring frame from tool.
        quaternion: [f64; 4],
    },
}

impl Measured {
    /// What it is read with: a few words.
    #[must_use]
    pub const fn instrument(&self) -> &'static str {
        match self {
            Self::Touch { .. } => "indicators touching precision balls",
            Self::Point { .. } | Self::Reference { .. } => "points of a tracker",
            Self::Distance { .. } => "lengths from fixed anchors",
            Self::Pose { .. } => "poses of a tracker",
        }
    }

    /// The lengths that were read, m, and what they are called: three indicators, a position (of a pose, too), one length.
    #[must_use]
    pub const fn lengths(&self) -> (&'static str, &[f64]) {
        match self {
            Self::Touch { reading, .. } => ("indicators", reading),
            Self::Point { position, .. } | Self::Reference { position, .. } | Self::Pose { position, .. } => {
                ("measured point", position)
            }
            Self::Distance { length, .. } => ("measured length", std::slice::from_ref(length)),
        }
    }

    /// Of which ball, target, reference or anchor it is, from 0, and which of these words it is; `None` for a pose, of which there is one.
    #[must_use]
    pub const fn of_which(&self) -> Option<(&'static str, usize)> {
        match self {
            Self::Touch { ball, .. } => Some(("ball", *ball)),
            Self::Point { target, .. } => Some(("target", *target)),
            Self::Reference { reference, .. } => Some(("reference", *reference)),
            Self::Distance { anchor, .. } => Some(("anchor", *anchor)),
            Self::Pose { .. } => None,
        }
    }

    /// One of the same kind, of the same ball, target, reference or anchor, whatever was read.
    #[must_use]
    pub const fn blank(self) -> Self {
        let position = [0.0; 3];
        match self {
            Self::Touch { ball, .. } => Self::Touch { ball, reading: [0.0; 3] },
            Self::Point { target, .. } => Self::Point { target, position },
            Self::Reference { reference, .. } => Self::Reference { reference, position },
            Self::Distance { anchor, .. } => Self::Distance { anchor, length: 1.0 },
            Self::Pose { .. } => Self::Pose { position, quaternion: [1.0, 0.0, 0.0, 0.0] },
        }
    }

    /// Whether it was seen in a measuring frame.
    #[must_use]
    pub fn is_framed(&self) -> bool {
        matches!(self, Self::Point { .. } | Self::Pose { .. } | Self::Reference { .. })
    }
}

/// One row of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// What is known about the arm.
    pub state: State,
    /// What was measured.
    pub measured: Measured,
    /// Number of the pose in the original order, where given; rows of one pose share it.
    pub seq: Option<u64>,
    /// Line of the file (1-based, the header is line 1), for messages; 0 where there is no file.
    pub line: usize,
}

/// A recording of one session with one arm, in the order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// Where it came from, for messages.
    pub name: String,
    /// Number of the arm's joints.
    pub joints: usize,
    /// Which joints slide, joint 1 first: files have them in mm. `None` where nothing says it, as of arrays in SI.
    pub prismatic: Option<[bool; MAX_JOINTS]>,
    /// Names of the places where the set of balls stood, in the order of their first rows; empty where no row says so.
    pub places: Vec<String>,
    /// The rows.
    pub rows: Vec<Row>,
    /// What was understood of a file that is not quite as it should be, one sentence each.
    pub notes: Vec<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blank_is_of_the_same_kind_and_of_the_same_thing_with_as_many_lengths() {
        let position = [1.0, 2.0, 3.0];
        let all = [
            (Measured::Touch { ball: 2, reading: position }, Some(("ball", 2)), 3),
            (Measured::Point { target: 3, position }, Some(("target", 3)), 3),
            (Measured::Reference { reference: 4, position }, Some(("reference", 4)), 3),
            (Measured::Distance { anchor: 5, length: 7.0 }, Some(("anchor", 5)), 1),
            (Measured::Pose { position, quaternion: [0.0, 1.0, 0.0, 0.0] }, None, 3),
        ];
        for (measured, which, lengths) in all {
            let blank = measured.blank();
            assert!(blank != measured && std::mem::discriminant(&blank) == std::mem::discriminant(&measured));
            assert_eq!([measured.of_which(), blank.of_which()], [which; 2]);
            assert_eq!(
                (blank.lengths().1.len(), measured.lengths().1[0]),
                (lengths, if lengths == 1 { 7.0 } else { 1.0 })
            );
            assert_eq!((blank.instrument(), blank.lengths().0), (measured.instrument(), measured.lengths().0));
        }
    }
}
