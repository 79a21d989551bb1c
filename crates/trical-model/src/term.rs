//! A model is a list of terms: coefficient x basis (of what is known about the pose) acting at a site of the machine.

use serde::{Deserialize, Serialize};

use crate::cell::Cell;
use crate::error::{ModelError, Result};
use crate::recording::{Measured, State};
use crate::robot::{JointKind, Robot};

/// A direction along or about an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// x
    X,
    /// y
    Y,
    /// z
    Z,
}

impl Axis {
    /// 0, 1, 2.
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }

    /// All three.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    /// "x", "y", "z".
    #[must_use]
    pub fn name(self) -> &'static str {
        ["x", "y", "z"][self.index()]
    }
}

/// Translation along, or rotation about, an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Motion {
    /// Along the axis, m.
    Along(Axis),
    /// About the axis, rad.
    About(Axis),
}

impl Motion {
    /// x, y, z, rx, ry, rz: 0 to 5.
    #[must_use]
    pub fn index(self) -> usize {
        match self {
            Self::Along(a) => a.index(),
            Self::About(a) => 3 + a.index(),
        }
    }

    /// All six.
    pub const ALL: [Self; 6] = [
        Self::Along(Axis::X),
        Self::Along(Axis::Y),
        Self::Along(Axis::Z),
        Self::About(Axis::X),
        Self::About(Axis::Y),
        Self::About(Axis::Z),
    ];

    /// "x" to "rz".
    #[must_use]
    pub fn name(self) -> &'static str {
        ["x", "y", "z", "rx", "ry", "rz"][self.index()]
    }
}

/// Geometric parameters of the chain, named by the link they belong to in Craig's convention.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Parameter {
    /// Twist alpha_k between axis k and axis k+1 (in `robot.toml`: `alpha_deg` of joint k+1).
    Alpha,
    /// Length a_k between axis k and axis k+1 (in `robot.toml`: `a_mm` of joint k+1).
    A,
    /// Hayati's beta_k: twist of axis k+1 against axis k about y, for (nearly) parallel axes.
    Beta,
    /// Joint offset theta_k.
    Theta,
    /// Offset d_k along axis k.
    D,
}

/// Properties of what the flange carries that act by gravity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Payload {
    /// Error of the mass, at the nominal centre of gravity, kg.
    Mass,
    /// Error of the first moment (mass x centre of gravity) in the flange frame, kg m.
    Moment(Axis),
}

/// A place of the machine that can move. Joints, links, balls, targets, anchors and frames are counted from 1
/// (link k lies between joints k and k+1; link 0 is the base).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Site {
    /// A geometric parameter of a link.
    Link {
        /// Which link: 0 to n-1 for alpha, a, beta; 1 to n for theta, d.
        link: usize,
        /// Which parameter.
        parameter: Parameter,
    },
    /// Rotation about a joint's own axis (translation along it for a prismatic joint).
    Joint {
        /// 1 to n.
        joint: usize,
    },
    /// Tilt of a joint's axis about the x or y axis of the frame that carries its bearing, through the joint's origin.
    Tilt {
        /// 1 to n.
        joint: usize,
        /// X or Y.
        axis: Axis,
    },
    /// Rotation across a joint's axis, proportional to the gravity moment across it, with one coefficient: both tilts of
    /// [`Site::Tilt`] by [`Variable::Moment`], or, about the joint's foot, alpha and beta by [`Variable::FootMoment`].
    Across {
        /// 1 to n.
        joint: usize,
    },
    /// Every joint about its own axis, with one coefficient.
    AllJoints,
    /// Every length a, d of the chain in proportion, with one coefficient.
    Links,
    /// The base in {w}.
    Base(Motion),
    /// The tool on the flange, in flange axes. A constant one does not move optical targets, which have their own.
    Tool(Motion),
    /// One optical target on the tool, in flange axes.
    Target {
        /// 1-based.
        target: usize,
        /// Which coordinate.
        axis: Axis,
    },
    /// All balls together, in {w}.
    Fixture(Motion),
    /// One ball, in {w}.
    Ball {
        /// 1-based.
        ball: usize,
        /// Which coordinate.
        axis: Axis,
    },
    /// A measuring frame: {w} as the instrument of a recording sees it.
    Frame {
        /// 1-based.
        frame: usize,
        /// Which motion.
        motion: Motion,
    },
    /// Gravity in {w}, m/s^2.
    Gravity(Axis),
    /// What the flange carries.
    Payload(Payload),
    /// A fixed anchor of distance measurements, in {w}.
    Anchor {
        /// 1-based.
        anchor: usize,
        /// Which coordinate.
        axis: Axis,
    },
    /// Zero of the length that is measured from an anchor.
    LengthZero {
        /// 1-based.
        anchor: usize,
    },
}

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
    /// Commanded minus reported value of a joint, rad or m; 0 where it was not recorded what was commanded.
    Lag {
        /// 1-based.
        joint: usize,
    },
    /// Time since the recording began, s.
    Time,
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
}

impl Shape {
    /// Whether its parameters give finite values.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn check(self) -> std::result::Result<(), String> {
        let positive = |what: &str, v: f64| {
            if v.is_finite() && v > 0.0 { Ok(()) } else { Err(format!("has {what} {v}, expected a number above 0")) }
        };
        let finite = |what: &str, v: f64| {
            if v.is_finite() { Ok(()) } else { Err(format!("has {what} {v}, expected a finite number")) }
        };
        match self {
            Self::One | Self::Linear | Self::Absolute | Self::SignedSquare | Self::Cube => Ok(()),
            Self::SoftSign { scale } => positive("scale", scale),
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
                let t = (u / scale).tanh();
                (t, (1.0 - t * t) / scale)
            }
            Self::Sine { cycles } => {
                let (s, c) = (cycles * u).sin_cos();
                (s, cycles * c)
            }
            Self::Cosine { cycles } => {
                let (s, c) = (cycles * u).sin_cos();
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
                let e = (-u / constant).exp();
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
        }
    }
}

/// A scalar function of what is known about a pose: `shape(of)`, times the sense of a joint's last motion if `sense` is given.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Basis {
    /// What it looks at.
    pub of: Variable,
    /// How.
    pub shape: Shape,
    /// Joint (1-based) whose sense of motion multiplies it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sense: Option<usize>,
}

impl Basis {
    /// 1 everywhere.
    pub const CONSTANT: Self = Self { of: Variable::Nothing, shape: Shape::One, sense: None };

    /// `shape(of)`.
    #[must_use]
    pub fn new(of: Variable, shape: Shape) -> Self {
        Self { of, shape, sense: None }
    }

    /// Gravity torque about a joint's own axis.
    #[must_use]
    pub fn torque(joint: usize, shape: Shape) -> Self {
        Self::new(Variable::Moment { joint, axis: Axis::Z }, shape)
    }

    /// Sense of a joint's last motion.
    #[must_use]
    pub fn direction(joint: usize) -> Self {
        Self { sense: Some(joint), ..Self::CONSTANT }
    }

    /// Whether it is 1 everywhere.
    #[must_use]
    pub fn is_constant(&self) -> bool {
        self.shape == Shape::One && self.sense.is_none()
    }

    /// What a recording must contain for this basis to have a value, `None` if it has all.
    #[must_use]
    pub fn missing(&self, state: &State, measured: &Measured) -> Option<&'static str> {
        if self.sense.is_some() && state.dir.is_none() {
            return Some("the sense of each joint's last motion (dir1 ...)");
        }
        match self.of {
            Variable::Time if state.t.is_none() => Some("time (t_s)"),
            Variable::Temperature { .. } if state.temp_c.is_none() => Some("temperature (temp_c)"),
            Variable::Reading { .. } if !matches!(measured, Measured::Touch { .. }) => Some("indicator readings"),
            _ => None,
        }
    }
}

/// A coefficient times a basis at a site.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// Short name, unique within a model: "alpha_3", "c_2", "half_gap_3".
    pub name: String,
    /// The catalogue's name of the effect that it belongs to; "geometry", "compliance", "frame" ... for the ordinary ones.
    pub effect: String,
    /// Where it acts.
    pub site: Site,
    /// On what it depends.
    pub basis: Basis,
    /// Coefficient, SI.
    pub value: f64,
    /// Standard deviation of the coefficient, SI, where it was estimated.
    pub sd: Option<f64>,
}

impl Term {
    /// A term with coefficient 0.
    #[must_use]
    pub fn new(name: impl Into<String>, effect: impl Into<String>, site: Site, basis: Basis) -> Self {
        Self { name: name.into(), effect: effect.into(), site, basis, value: 0.0, sd: None }
    }

    /// Whether both do the same for the same reason: effect, site and basis, whatever their names and coefficients.
    #[must_use]
    pub fn does_as(&self, other: &Self) -> bool {
        self.effect == other.effect && self.site == other.site && self.basis == other.basis
    }
}

/// What a site consists of, after `Across`, `AllJoints` and `Links` are resolved. Indices are 0-based.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Dof {
    Chain(usize, ChainDof),
    Base(usize),
    Tool(usize),
    Target(usize, usize),
    Fixture(usize),
    Ball(usize, usize),
    Frame(usize, usize),
    Gravity(usize),
    PayloadMass,
    PayloadMoment(usize),
    Anchor(usize, usize),
    LengthZero(usize),
}

/// Motions within joint i's transform `Rx(alpha) Tx(a) Ry(beta) [tilt] Rz(theta) Tz(d)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum ChainDof {
    Alpha,
    A,
    Beta,
    D,
    TiltX,
    TiltY,
    Theta,
}

/// One scalar action of a term: `weight x basis` added to a degree of freedom.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Action {
    pub dof: Dof,
    pub basis: Basis,
    pub weight: f64,
}

/// Resolves a term's site into degrees of freedom.
pub(crate) fn actions(term: &Term, robot: &Robot, cell: &Cell, frames: usize) -> Result<Vec<Action>> {
    let n = robot.dof();
    let no_site = || ModelError::NoSuchSite { term: term.name.clone(), site: format!("{:?}", term.site) };
    let joint_index = |joint: usize| (1..=n).contains(&joint).then(|| joint - 1).ok_or_else(no_site);
    let index = |number: usize, have: usize| (1..=have).contains(&number).then(|| number - 1).ok_or_else(no_site);
    let own = |i: usize| match robot.joints[i].kind {
        JointKind::Revolute => Dof::Chain(i, ChainDof::Theta),
        JointKind::Prismatic => Dof::Chain(i, ChainDof::D),
    };
    match term.basis.of {
        Variable::Joint { joint }
        | Variable::Moment { joint, .. }
        | Variable::FootMoment { joint, .. }
        | Variable::Lag { joint } => {
            joint_index(joint)?;
        }
        _ => {}
    }
    if let Some(joint) = term.basis.sense {
        joint_index(joint)?;
    }
    let one = |dof| Ok(vec![Action { dof, basis: term.basis, weight: 1.0 }]);
    match term.site {
        Site::Link { link, parameter } => {
            let (i, dof) = match parameter {
                Parameter::Alpha => (link, ChainDof::Alpha),
                Parameter::A => (link, ChainDof::A),
                Parameter::Beta => (link, ChainDof::Beta),
                Parameter::Theta => (link.checked_sub(1).ok_or_else(no_site)?, ChainDof::Theta),
                Parameter::D => (link.checked_sub(1).ok_or_else(no_site)?, ChainDof::D),
            };
            if i >= n {
                return Err(no_site());
            }
            one(Dof::Chain(i, dof))
        }
        Site::Joint { joint } => one(own(joint_index(joint)?)),
        Site::Tilt { joint, axis } => {
            let i = joint_index(joint)?;
            match axis {
                Axis::X => one(Dof::Chain(i, ChainDof::TiltX)),
                Axis::Y => one(Dof::Chain(i, ChainDof::TiltY)),
                Axis::Z => Err(no_site()),
            }
        }
        Site::Across { joint } => {
            let i = joint_index(joint)?;
            let foot = matches!(term.basis.of, Variable::FootMoment { .. });
            let dofs = if foot { [ChainDof::Alpha, ChainDof::Beta] } else { [ChainDof::TiltX, ChainDof::TiltY] };
            let about = |axis, dof| {
                let of = if foot { Variable::FootMoment { joint, axis } } else { Variable::Moment { joint, axis } };
                Action { dof: Dof::Chain(i, dof), basis: Basis { of, ..term.basis }, weight: 1.0 }
            };
            Ok(vec![about(Axis::X, dofs[0]), about(Axis::Y, dofs[1])])
        }
        Site::AllJoints => Ok((0..n)
            .map(|i| {
                let of = match term.basis.of {
                    Variable::Lag { .. } => Variable::Lag { joint: i + 1 },
                    Variable::Joint { .. } => Variable::Joint { joint: i + 1 },
                    Variable::Moment { axis, .. } => Variable::Moment { joint: i + 1, axis },
                    Variable::FootMoment { axis, .. } => Variable::FootMoment { joint: i + 1, axis },
                    other => other,
                };
                Action {
                    dof: own(i),
                    basis: Basis { of, sense: term.basis.sense.map(|_| i + 1), ..term.basis },
                    weight: 1.0,
                }
            })
            .collect()),
        Site::Links => Ok(robot
            .joints
            .iter()
            .enumerate()
            .flat_map(|(i, j)| [(ChainDof::A, j.a), (ChainDof::D, j.d)].map(|(dof, length)| (i, dof, length)))
            .filter(|(_, _, length)| *length != 0.0)
            .map(|(i, dof, weight)| Action { dof: Dof::Chain(i, dof), basis: term.basis, weight })
            .collect()),
        Site::Base(m) => one(Dof::Base(m.index())),
        Site::Tool(m) => one(Dof::Tool(m.index())),
        Site::Target { target, axis } => one(Dof::Target(index(target, cell.tool.targets.len())?, axis.index())),
        Site::Fixture(m) => one(Dof::Fixture(m.index())),
        Site::Ball { ball, axis } => one(Dof::Ball(index(ball, cell.balls.len())?, axis.index())),
        Site::Frame { frame, motion } => one(Dof::Frame(index(frame, frames)?, motion.index())),
        Site::Gravity(axis) => one(Dof::Gravity(axis.index())),
        Site::Payload(Payload::Mass) => one(Dof::PayloadMass),
        Site::Payload(Payload::Moment(axis)) => one(Dof::PayloadMoment(axis.index())),
        Site::Anchor { anchor, axis } => one(Dof::Anchor(index(anchor, cell.anchors.len())?, axis.index())),
        Site::LengthZero { anchor } => one(Dof::LengthZero(index(anchor, cell.anchors.len())?)),
    }
}
