//! A model is a list of terms: coefficient x basis (of what is known about the pose) acting at a site of the machine.

use serde::{Deserialize, Serialize};

use crate::axis::Axis;
use crate::basis::{Basis, Shape, Variable};
use crate::cell::Cell;
use crate::error::{ModelError, Result};
use crate::robot::{JointKind, Robot};

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
    /// [`Site::Tilt`] by [`Variable::Moment`], or, about the joint's foot, alpha and beta by [`Variable::FootMoment`], or about a
    /// point between by [`Variable::PartMoment`].
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

    /// Whether it can move the tool in {w}: not what is of targets, balls, anchors and measuring frames alone.
    #[must_use]
    pub fn moves_tool(&self) -> bool {
        !matches!(
            self.site,
            Site::Target { .. }
                | Site::Fixture(_)
                | Site::Ball { .. }
                | Site::Frame { .. }
                | Site::Anchor { .. }
                | Site::LengthZero { .. }
        )
    }

    /// The joint (from 1) of which this is the compliance about its axis, by gravity's torque or by a measured one.
    #[must_use]
    pub fn gives_way(&self) -> Option<usize> {
        let Site::Joint { joint } = self.site else { return None };
        [Basis::torque(joint, Shape::Linear), Basis::measured_torque(joint)].contains(&self.basis).then_some(joint)
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

impl Dof {
    /// Whether it is a part of the payload's mass and first moment.
    pub(crate) fn is_load(self) -> bool {
        matches!(self, Self::PayloadMass | Self::PayloadMoment(_))
    }
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

/// As it stands in a model file.
impl std::fmt::Display for Site {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match toml::Value::try_from(self) {
            Ok(value) => write!(f, "site = {value}"),
            Err(_) => f.write_str("a site"),
        }
    }
}

/// Resolves a term's site into degrees of freedom.
pub(crate) fn actions(term: &Term, robot: &Robot, cell: &Cell, frames: usize) -> Result<Vec<Action>> {
    let n = robot.dof();
    check_joints(term, n)?;
    let joint_index = |joint| index(term, joint, n);
    let one = |dof| Ok(vec![Action { dof, basis: term.basis, weight: 1.0 }]);
    match term.site {
        Site::Link { link, parameter } => one(of_link(term, link, parameter, n)?),
        Site::Joint { joint } => one(own(robot, joint_index(joint)?)),
        Site::Tilt { joint, axis } => {
            let i = joint_index(joint)?;
            match axis {
                Axis::X => one(Dof::Chain(i, ChainDof::TiltX)),
                Axis::Y => one(Dof::Chain(i, ChainDof::TiltY)),
                Axis::Z => Err(no_site(term)),
            }
        }
        Site::Across { joint } => across(term, joint_index(joint)?),
        Site::AllJoints => Ok((0..n).map(|i| of_every_joint(term, robot, i)).collect()),
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
        Site::Target { target, axis } => one(Dof::Target(index(term, target, cell.tool.targets.len())?, axis.index())),
        Site::Fixture(m) => one(Dof::Fixture(m.index())),
        Site::Ball { ball, axis } => one(Dof::Ball(index(term, ball, cell.balls.len())?, axis.index())),
        Site::Frame { frame, motion } => one(Dof::Frame(index(term, frame, frames)?, motion.index())),
        Site::Gravity(axis) => one(Dof::Gravity(axis.index())),
        Site::Payload(Payload::Mass) => one(Dof::PayloadMass),
        Site::Payload(Payload::Moment(axis)) => one(Dof::PayloadMoment(axis.index())),
        Site::Anchor { anchor, axis } => one(Dof::Anchor(index(term, anchor, cell.anchors.len())?, axis.index())),
        Site::LengthZero { anchor } => one(Dof::LengthZero(index(term, anchor, cell.anchors.len())?)),
    }
}

fn no_site(term: &Term) -> ModelError {
    ModelError::NoSuchSite { term: term.name.clone(), site: term.site.to_string() }
}

/// From a number, of which there are 1 to `have`.
fn index(term: &Term, number: usize, have: usize) -> Result<usize> {
    if (1..=have).contains(&number) { Ok(number - 1) } else { Err(no_site(term)) }
}

/// Refuses a basis that looks at joints which the arm does not have.
fn check_joints(term: &Term, n: usize) -> Result<()> {
    match term.basis.of {
        Variable::Joint { joint }
        | Variable::Moment { joint, .. }
        | Variable::FootMoment { joint, .. }
        | Variable::PartMoment { joint, .. }
        | Variable::Torque { joint }
        | Variable::Lag { joint } => {
            index(term, joint, n)?;
        }
        Variable::Inclination { first, last } if index(term, last, n)? < index(term, first, n)? => {
            return Err(no_site(term));
        }
        _ => {}
    }
    for joint in term.basis.sense.into_iter().chain(term.basis.beside.map(|b| b.joint)) {
        index(term, joint, n)?;
    }
    if matches!(term.basis.of, Variable::PartMoment { .. }) && !matches!(term.site, Site::Across { .. }) {
        return Err(no_site(term));
    }
    Ok(())
}

/// The motion of joint `i` itself.
fn own(robot: &Robot, i: usize) -> Dof {
    match robot.joints[i].kind {
        JointKind::Revolute => Dof::Chain(i, ChainDof::Theta),
        JointKind::Prismatic => Dof::Chain(i, ChainDof::D),
    }
}

fn of_link(term: &Term, link: usize, parameter: Parameter, n: usize) -> Result<Dof> {
    let (i, dof) = match parameter {
        Parameter::Alpha => (Some(link), ChainDof::Alpha),
        Parameter::A => (Some(link), ChainDof::A),
        Parameter::Beta => (Some(link), ChainDof::Beta),
        Parameter::Theta => (link.checked_sub(1), ChainDof::Theta),
        Parameter::D => (link.checked_sub(1), ChainDof::D),
    };
    i.filter(|i| *i < n).map(|i| Dof::Chain(i, dof)).ok_or_else(|| no_site(term))
}

/// Rotation across the axis of joint `i`.
fn across(term: &Term, i: usize) -> Result<Vec<Action>> {
    if let Variable::PartMoment { share, .. } = term.basis.of {
        return if term.basis.shape == Shape::Linear && (0.0..=1.0).contains(&share) {
            Ok(across_between(i, share, term.basis))
        } else {
            Err(no_site(term))
        };
    }
    let joint = i + 1;
    let foot = matches!(term.basis.of, Variable::FootMoment { .. });
    let dofs = if foot { [ChainDof::Alpha, ChainDof::Beta] } else { [ChainDof::TiltX, ChainDof::TiltY] };
    let about = |axis, dof| {
        let of = if foot { Variable::FootMoment { joint, axis } } else { Variable::Moment { joint, axis } };
        Action { dof: Dof::Chain(i, dof), basis: Basis { of, ..term.basis }, weight: 1.0 }
    };
    Ok(vec![about(Axis::X, dofs[0]), about(Axis::Y, dofs[1])])
}

/// What a term at all joints does at joint `i`.
fn of_every_joint(term: &Term, robot: &Robot, i: usize) -> Action {
    let joint = i + 1;
    let of = match term.basis.of {
        Variable::Lag { .. } => Variable::Lag { joint },
        Variable::Joint { .. } => Variable::Joint { joint },
        Variable::Moment { axis, .. } => Variable::Moment { joint, axis },
        Variable::FootMoment { axis, .. } => Variable::FootMoment { joint, axis },
        other => other,
    };
    let basis = Basis { of, sense: term.basis.sense.map(|_| joint), ..term.basis };
    Action { dof: own(robot, i), basis, weight: 1.0 }
}

/// Rotation across the axis of joint `i` about a point of it. A small rotation about a point between is in part one about the
/// origin, in part the same about the foot; and the moment there is in part that at either end.
fn across_between(i: usize, share: f64, basis: Basis) -> Vec<Action> {
    let joint = i + 1;
    let rest = 1.0 - share;
    let turned = [(Axis::X, ChainDof::TiltX, ChainDof::Alpha), (Axis::Y, ChainDof::TiltY, ChainDof::Beta)];
    let of = |axis, at_origin, at_foot| {
        let moments = [(Variable::Moment { joint, axis }, rest), (Variable::FootMoment { joint, axis }, share)];
        [(at_origin, rest), (at_foot, share)].into_iter().flat_map(move |(dof, part)| {
            moments.map(|(of, moment)| Action {
                dof: Dof::Chain(i, dof),
                basis: Basis { of, ..basis },
                weight: part * moment,
            })
        })
    };
    turned.into_iter().flat_map(|(axis, at_origin, at_foot)| of(axis, at_origin, at_foot)).collect()
}
