//! What a coefficient is multiplied with: a shape of a variable, its sign a joint's sense of motion, beside a function of another
//! joint's angle.

use serde::{Deserialize, Serialize};

use crate::axis::Axis;
use crate::recording::{Measured, State};
use crate::trig;
use trig::sin_cos;

/// What a basis looks at.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Variable {
    /// Nothing.
    Nothing,
    /// A joint's value, rad or m.
    Joint {
        /// 1-based.
        joint: usize,
    },
    /// Gravity moment at a joint's origin of all that the joint carries, N m. Z is the torque about (for a prismatic
    /// joint: the force along) the joint's axis; X and Y are the axes of the frame that carries the bearing.
    Moment {
        /// 1-based.
        joint: usize,
        /// Which component.
        axis: Axis,
    },
    /// The same at the joint's foot, where its axis begins, before the offset d along it; Z too is the bearing's axis.
    FootMoment {
        /// 1-based.
        joint: usize,
        /// Which component.
        axis: Axis,
    },
    /// The same at a point of the axis between its origin and its foot; for [`crate::Site::Across`] only.
    PartMoment {
        /// 1-based.
        joint: usize,
        /// Which component.
        axis: Axis,
        /// Share of the way from the origin to the foot, 0 to 1.
        share: f64,
    },
    /// Measured torque of a joint, N m (N for a prismatic one), as its sensor gives it.
    Torque {
        /// 1-based.
        joint: usize,
    },
    /// Sum of the angles of consecutive joints whose axes are parallel, rad: how far the last of them is inclined.
    Inclination {
        /// 1-based.
        first: usize,
        /// 1-based, not before the first.
        last: usize,
    },
    /// Commanded minus reported value of a joint, rad or m; 0 where it was not recorded what was commanded.
    Lag {
        /// 1-based.
        joint: usize,
    },
    /// Time since the recording began, s.
    Time,
    /// Number of the pose in the order of time.
    Seq,
    /// Temperature above a reference, K.
    Temperature {
        /// The reference, degC.
        reference_c: f64,
    },
    /// One of the three indicators, m.
    Reading {
        /// Axis of the device.
        axis: Axis,
    },
}

/// How a basis looks at its variable u.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// 1
    One,
    /// u
    Linear,
    /// |u|
    Absolute,
    /// u |u|
    SignedSquare,
    /// u^3
    Cube,
    /// tanh(u / scale): a sign with a soft middle.
    SoftSign {
        /// In units of u.
        scale: f64,
    },
    /// In proportion until `at` either way, 1 beyond: min(1, max(-1, u / at)).
    Clip {
        /// In units of u.
        at: f64,
    },
    /// sin(cycles u)
    Sine {
        /// Cycles per turn.
        cycles: f64,
    },
    /// cos(cycles u)
    Cosine {
        /// Cycles per turn.
        cycles: f64,
    },
    /// 0 below `at`, 1 from there on.
    Step {
        /// In units of u.
        at: f64,
    },
    /// max(0, u - at)
    Hinge {
        /// In units of u.
        at: f64,
    },
    /// 1 - exp(-u / constant)
    WarmUp {
        /// In units of u.
        constant: f64,
    },
    /// A tent: 0 up to `left`, 1 at `centre`, 0 from `right` on, straight between (a linear B-spline). An end that is
    /// not finite stays at 1 on that side.
    Tent {
        /// In units of u.
        left: f64,
        /// In units of u.
        centre: f64,
        /// In units of u.
        right: f64,
    },
    /// Growth with the square: 0 up to `from`, ((u - from) / (to - from))^2 from there to 1 at `to`, which may be below `from`; beyond `to` back
    /// to 0 at the same distance again.
    Growth {
        /// In units of u.
        from: f64,
        /// In units of u.
        to: f64,
    },
}

impl Shape {
    /// Cycles a turn, if it is a wave.
    #[must_use]
    pub const fn cycles(self) -> Option<f64> {
        match self {
            Self::Sine { cycles } | Self::Cosine { cycles } => Some(cycles),
            _ => None,
        }
    }

    /// Whether its parameters give finite values.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn check(self) -> Result<(), String> {
        let positive = |what: &str, v: f64| {
            if v.is_finite() && v > 0.0 { Ok(()) } else { Err(format!("has {what} {v}, expected a number above 0")) }
        };
        let finite = |what: &str, v: f64| {
            if v.is_finite() { Ok(()) } else { Err(format!("has {what} {v}, expected a finite number")) }
        };
        match self {
            Self::One | Self::Linear | Self::Absolute | Self::SignedSquare | Self::Cube => Ok(()),
            Self::SoftSign { scale } => positive("scale", scale),
            Self::Clip { at } => positive("at", at),
            Self::Sine { cycles } | Self::Cosine { cycles } => finite("cycles", cycles),
            Self::Step { at } | Self::Hinge { at } => finite("at", at),
            Self::WarmUp { constant } => positive("constant", constant),
            Self::Tent { left, centre, right } => {
                finite("centre", centre)?;
                if left < centre && centre < right {
                    Ok(())
                } else {
                    Err(format!("has left {left}, centre {centre}, right {right}, expected them in rising order"))
                }
            }
            Self::Growth { from, to } => {
                finite("from", from)?;
                finite("to", to)?;
                if from == to { Err(format!("has from and to at {from}, expected two numbers")) } else { Ok(()) }
            }
        }
    }

    /// Value and derivative at `u`.
    #[must_use]
    pub fn at(self, u: f64) -> (f64, f64) {
        match self {
            Self::One => (1.0, 0.0),
            Self::Linear => (u, 1.0),
            Self::Absolute => (u.abs(), if u < 0.0 { -1.0 } else { 1.0 }),
            Self::SignedSquare => (u * u.abs(), 2.0 * u.abs()),
            Self::Cube => (u * u * u, 3.0 * u * u),
            Self::SoftSign { scale } => {
                let t = libm::tanh(u / scale);
                (t, (1.0 - t * t) / scale)
            }
            Self::Clip { at } => ((u / at).clamp(-1.0, 1.0), if u.abs() < at { 1.0 / at } else { 0.0 }),
            Self::Sine { cycles } => {
                let (s, c) = sin_cos(cycles * u);
                (s, cycles * c)
            }
            Self::Cosine { cycles } => {
                let (s, c) = sin_cos(cycles * u);
                (c, -cycles * s)
            }
            Self::Step { at } => (f64::from(u8::from(u >= at)), 0.0),
            Self::Hinge { at } => {
                if u > at {
                    (u - at, 1.0)
                } else {
                    (0.0, 0.0)
                }
            }
            Self::WarmUp { constant } => {
                let e = libm::exp(-u / constant);
                (1.0 - e, e / constant)
            }
            Self::Tent { left, centre, right } => {
                if u <= centre {
                    if !left.is_finite() {
                        (1.0, 0.0)
                    } else if u <= left {
                        (0.0, 0.0)
                    } else {
                        ((u - left) / (centre - left), 1.0 / (centre - left))
                    }
                } else if !right.is_finite() {
                    (1.0, 0.0)
                } else if u >= right {
                    (0.0, 0.0)
                } else {
                    ((right - u) / (right - centre), -1.0 / (right - centre))
                }
            }
            Self::Growth { from, to } => {
                let part = ((u - from) / (to - from)).max(0.0);
                if part <= 1.0 {
                    (part * part, 2.0 * part / (to - from))
                } else if part < 2.0 {
                    (2.0 - part, -1.0 / (to - from))
                } else {
                    (0.0, 0.0)
                }
            }
        }
    }
}

/// Values of shapes one after the other: the sine and the cosine of an angle, which mostly follow each other, are found together.
#[derive(Default)]
pub(crate) struct Wave {
    angle: f64,
    sine: f64,
    cosine: f64,
}

impl Wave {
    /// As [`Shape::at`], without the derivative.
    pub fn value(&mut self, shape: Shape, u: f64) -> f64 {
        let (Shape::Sine { cycles } | Shape::Cosine { cycles }) = shape else { return shape.at(u).0 };
        let angle = cycles * u;
        if angle != self.angle || self.cosine == 0.0 {
            let (sine, cosine) = sin_cos(angle);
            *self = Self { angle, sine, cosine };
        }
        if matches!(shape, Shape::Sine { .. }) { self.sine } else { self.cosine }
    }
}

/// A scalar function of what is known about a pose: `shape(of)`, times the sense of a joint's last motion if `sense` is given, times
/// a function of a joint's value if `beside` is, and 0 outside of one session, or one place of the balls there, if `session` and `place` are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Basis {
    /// What it looks at.
    pub of: Variable,
    /// How.
    pub shape: Shape,
    /// Joint (1-based) whose sense of motion multiplies it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sense: Option<usize>,
    /// What else multiplies it: a function of a joint's value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beside: Option<Beside>,
    /// The only session (1-based, see [`State::session`]) in which it is not 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub session: Option<u32>,
    /// The only place of the set of balls (1-based, in the order of the session's recording, see [`State::place`]) at which it is not 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<usize>,
}

/// A function of a joint's value (rad or m), as a factor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Beside {
    /// 1-based.
    pub joint: usize,
    /// Which function.
    pub shape: Shape,
}

impl Basis {
    /// 1 everywhere.
    pub const CONSTANT: Self =
        Self { of: Variable::Nothing, shape: Shape::One, sense: None, beside: None, session: None, place: None };

    /// `shape(of)`.
    #[must_use]
    pub fn new(of: Variable, shape: Shape) -> Self {
        Self { of, shape, ..Self::CONSTANT }
    }

    /// Gravity torque about a joint's own axis.
    #[must_use]
    pub fn torque(joint: usize, shape: Shape) -> Self {
        Self::new(Variable::Moment { joint, axis: Axis::Z }, shape)
    }

    /// Measured torque of a joint.
    #[must_use]
    pub fn measured_torque(joint: usize) -> Self {
        Self::new(Variable::Torque { joint }, Shape::Linear)
    }

    /// Sense of a joint's last motion.
    #[must_use]
    pub fn direction(joint: usize) -> Self {
        Self { sense: Some(joint), ..Self::CONSTANT }
    }

    /// Whether it is 1 everywhere.
    #[must_use]
    pub fn is_constant(&self) -> bool {
        self.shape == Shape::One && self.sense.is_none() && self.beside.is_none() && !self.is_local()
    }

    /// Whether it holds in one session, or at one place of the balls, only.
    #[must_use]
    pub fn is_local(&self) -> bool {
        self.session.is_some() || self.place.is_some()
    }

    /// Whether its shapes' parameters give finite values.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn check(&self) -> Result<(), String> {
        self.shape.check()?;
        self.beside.map_or(Ok(()), |b| b.shape.check())
    }

    /// This basis in one session only.
    #[must_use]
    pub fn in_session(self, session: u32) -> Self {
        Self { session: Some(session), ..self }
    }

    /// The same where the set of balls stood at one place (1-based) only.
    #[must_use]
    pub fn at_place(self, place: Option<usize>) -> Self {
        Self { place, ..self }
    }

    /// Whether it is 0 in `state`'s session, or at its place of the balls, whatever the pose.
    #[must_use]
    pub fn is_elsewhere(&self, state: &State) -> bool {
        (self.session.is_some() && self.session != state.session)
            || self.place.is_some_and(|own| state.place != own.checked_sub(1))
    }

    /// What a recording must contain for this basis to have a value, `None` if it has all.
    #[must_use]
    pub fn missing(&self, state: &State, measured: &Measured) -> Option<&'static str> {
        if self.is_elsewhere(state) {
            return None;
        }
        if self.sense.is_some() && state.dir.is_none() {
            return Some("the sense of each joint's last motion (dir1 ...)");
        }
        match self.of {
            Variable::Time if state.t.is_none() => Some("time (t_s)"),
            Variable::Seq if state.seq.is_none() => Some("the number of the pose (seq)"),
            Variable::Torque { .. } if state.torques.is_none() => Some("measured joint torques (tau1_nm ...)"),
            Variable::Temperature { .. } if state.temp_c.is_none() => Some("temperature (temp_c)"),
            Variable::Reading { .. } if !matches!(measured, Measured::Touch { .. }) => Some("indicator readings"),
            _ => None,
        }
    }
}
