//! Which parameters a fit is to have, and the terms that stand for them.

use trical_model::{
    Axis, Basis, Cell, MAX_JOINTS, Measured, Model, Motion, Parameter, Robot, Shape, Site, State, Term, Variable, trig,
};

use crate::dataset::{Dataset, told_of_tool};
use crate::error::Result;
use crate::fit::ball_places::{self, base_is_fixed, unknown_places};
use crate::fit::optional_terms::{length_zeros, rail, sag};
use crate::fit::priors::KnownParameters;

/// Which parameters a fit is to have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ParameterSet {
    /// Measuring frame or base, and tool points, only: the nominal arm.
    Nominal,
    /// The nominal arm's, and the whole geometry of a rigid arm, the twist of near-parallel axes (Hayati's beta) included.
    Geometry,
    /// The paper's 31 parameters: the geometry without that twist, and the compliance of every joint that carries a torque.
    Compliance,
    /// The whole geometry and the compliance: what identification takes where nothing else is asked for.
    Complete,
}

/// From what is known how far joints give way under load.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Elasticity {
    /// Compliance is not asked for.
    NotAsked,
    /// From the joint torques that the arm measured.
    Torques,
    /// From gravity torques, by the masses of the links.
    Masses,
    /// The robot has no masses and the recordings no torques. Where the data show it, what gravity does to joints with horizontal axes is
    /// a sine and a cosine of their inclination.
    Inclination,
}

/// What sessions do not share with the first one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OwnSetup {
    /// Sessions (from 1) with a tool, or targets on it, of their own.
    pub tool: Vec<u32>,
    /// Sessions (from 1) in which the set of balls stood elsewhere.
    pub balls: Vec<u32>,
}

impl OwnSetup {
    /// Everything of every session but the first.
    #[must_use]
    pub fn all(sessions: usize) -> Self {
        let later: Vec<u32> = (2..=u32::try_from(sessions).unwrap_or(u32::MAX)).collect();
        Self { tool: later.clone(), balls: later }
    }
}

/// A parameter set, with the compliance of some joints only if wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    set: ParameterSet,
    compliant: Option<Vec<usize>>,
    known: KnownParameters,
    own: OwnSetup,
    /// Names of those of [`optional_groups`] that are wanted.
    optional: Vec<String>,
    waves: bool,
}

/// Joints whose compliance cannot be identified.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
pub enum ChoiceError {
    /// A joint that the arm does not have.
    #[error("joint {joint} does not exist; the arm has joints 1 to {dof}")]
    NoSuchJoint {
        /// From 1.
        joint: usize,
        /// Joints of the arm.
        dof: usize,
    },
    /// A set of parameters without compliance.
    #[error("found a model without compliance, expected compliance or complete")]
    Rigid,
}

impl Choice {
    /// `compliant` are the joints (1-based) whose compliance is to be identified; empty for all that carry gravity.
    ///
    /// # Errors
    /// A joint that an arm with `dof` joints does not have; joints for a set without compliance.
    pub fn new(set: ParameterSet, compliant: &[usize], dof: usize) -> std::result::Result<Self, ChoiceError> {
        if !compliant.is_empty() && matches!(set, ParameterSet::Nominal | ParameterSet::Geometry) {
            return Err(ChoiceError::Rigid);
        }
        match compliant.iter().find(|j| !(1..=dof).contains(j)) {
            Some(joint) => Err(ChoiceError::NoSuchJoint { joint: *joint, dof }),
            None => {
                let compliant = (!compliant.is_empty()).then(|| compliant.to_vec());
                Ok(Self { compliant, ..set.into() })
            }
        }
    }

    /// These parameters, with what is known of them beforehand.
    #[must_use]
    pub fn knowing(self, known: KnownParameters) -> Self {
        Self { known, ..self }
    }

    /// These parameters, with tools, targets and places of balls of their own for some sessions.
    #[must_use]
    pub fn with_own(self, own: OwnSetup) -> Self {
        Self { own, ..self }
    }

    /// These parameters, with two harmonics of each joint's error over its own angle, once and twice a turn: an eccentric gear or encoder.
    #[must_use]
    pub fn with_waves(self) -> Self {
        Self { waves: true, ..self }
    }

    /// What sessions do not share with the first one.
    #[must_use]
    pub fn own(&self) -> &OwnSetup {
        &self.own
    }

    /// What is known of them beforehand.
    pub(crate) fn known(&self) -> &KnownParameters {
        &self.known
    }

    /// The set.
    #[must_use]
    pub fn set(&self) -> ParameterSet {
        self.set
    }

    /// From what is known how far joints give way: measured torques, where there are any; else masses. Joints that were named for it
    /// need one of both.
    ///
    /// # Errors
    /// Joints were named, or some links have masses and others do not, and there are no torques.
    pub fn elasticity(&self, robot: &Robot, data: &Dataset) -> Result<Elasticity> {
        self.elasticity_of(robot, measured_torques(data.observations.iter().map(|o| &o.state)))
    }

    /// As [`Self::elasticity`], told of which joints torques were measured.
    ///
    /// # Errors
    /// As [`Self::elasticity`].
    pub(crate) fn elasticity_of(&self, robot: &Robot, torques: [bool; MAX_JOINTS]) -> Result<Elasticity> {
        if self.set < ParameterSet::Compliance {
            return Ok(Elasticity::NotAsked);
        }
        let all_named = || self.compliant.iter().flatten().all(|joint| torques[joint - 1]);
        if torques.contains(&true) && (robot.require_masses().is_ok() || all_named()) {
            return Ok(Elasticity::Torques);
        }
        let some = self.compliant.is_some() || robot.joints.iter().any(|j| j.mass.is_some());
        match robot.require_masses() {
            Ok(()) => Ok(Elasticity::Masses),
            Err(e) if some => Err(e.into()),
            Err(_) => Ok(Elasticity::Inclination),
        }
    }

    /// These parameters, with those of [`optional_groups`] that are named.
    #[must_use]
    pub(crate) fn with_optional(self, optional: Vec<String>) -> Self {
        Self { optional, ..self }
    }

    fn is_compliant(&self, joint: usize) -> bool {
        self.compliant.as_ref().is_none_or(|c| c.contains(&joint))
    }
}

/// Of which joints (from 0) torques were measured: of every row, and not the same in all, as where the arm has no sensor and writes zeros.
pub(crate) fn measured_torques<'a>(states: impl Iterator<Item = &'a State>) -> [bool; MAX_JOINTS] {
    let mut first = None;
    let mut differ = [false; MAX_JOINTS];
    for state in states {
        let Some(torques) = state.torques else { return [false; MAX_JOINTS] };
        let first = first.get_or_insert(torques);
        for (differs, (a, b)) in differ.iter_mut().zip(first.iter().zip(&torques)) {
            *differs |= a != b;
        }
    }
    differ
}

impl From<ParameterSet> for Choice {
    fn from(set: ParameterSet) -> Self {
        Self {
            set,
            compliant: None,
            known: KnownParameters::default(),
            own: OwnSetup::default(),
            optional: Vec::new(),
            waves: false,
        }
    }
}

fn constant(name: String, effect: &str, site: Site) -> Term {
    Term::new(name, effect, site, Basis::CONSTANT)
}

/// All candidates in the order in which they are preferred.
pub(crate) fn candidates(model: &Model, data: &Dataset, choice: &Choice) -> Result<Vec<Term>> {
    let set = choice.set;
    let n = model.robot.dof();
    let touch = data.has(|m| matches!(m, Measured::Touch { .. } | Measured::Distance { .. }));
    let based = data.has(|m| matches!(m, Measured::Distance { .. })) || base_is_fixed(&model.cell, data);
    let mut terms = Vec::new();
    let many = model.frames.len() > 1;
    for frame in 1..=model.frames.len() {
        for motion in Motion::ALL {
            let prefix = if many { format!("frame{frame}") } else { "frame".into() };
            terms.push(constant(format!("{prefix}_{}", motion.name()), "frame", Site::Frame { frame, motion }));
        }
    }
    if touch && based {
        for m in Motion::ALL {
            terms.push(constant(format!("base_{}", m.name()), "base", Site::Base(m)));
        }
    }
    let targets = model.cell.tool.targets.len();
    let (motions, seen) = told_of_tool(targets, data.observations.iter().map(|o| o.measured));
    terms.extend(motions.iter().map(|m| constant(format!("tool_{}", m.name()), "tool", Site::Tool(*m))));
    for target in seen {
        for axis in Axis::ALL {
            let name = if targets == 1 { "target".to_owned() } else { format!("target{target}") };
            terms.push(constant(format!("{name}_{}", axis.name()), "target", Site::Target { target, axis }));
        }
    }
    let places = unknown_places(&model.cell, data);
    terms.extend(places.iter().flat_map(|p| ball_places::terms(&model.cell, data, *p)));
    terms.extend(own_terms(&terms, &model.cell, data, &choice.own));
    if set >= ParameterSet::Geometry {
        let link = |parameter, link, name: &str| {
            constant(format!("{name}_{link}"), "geometry", Site::Link { link, parameter })
        };
        terms.extend((1..n).map(|k| link(Parameter::Alpha, k, "alpha")));
        terms.extend((1..n).map(|k| link(Parameter::A, k, "a")));
        // of near-parallel axes the place of the common normal is no measure: the twist about y is taken, and not the offset along the
        // first of them (Hayati and Mirmirani 1985)
        let twisted = |k: usize| {
            let near_parallel = model.robot.joints.get(k).is_some_and(|j| trig::sin(j.alpha).abs() < NEAR_PARALLEL);
            set != ParameterSet::Compliance && k < n && near_parallel
        };
        terms.extend((1..n).filter(|k| twisted(*k)).map(|k| link(Parameter::Beta, k, "beta")));
        // from the flange back: of parallel axes the last offset is kept, as in the paper
        terms.extend((2..=n).rev().filter(|k| !twisted(*k)).map(|k| link(Parameter::D, k, "d")));
        terms.extend((2..=n).rev().map(|k| link(Parameter::Theta, k, "theta")));
        terms.extend((2..=n).rev().filter(|k| twisted(*k)).map(|k| link(Parameter::D, k, "d")));
        terms.push(link(Parameter::D, 1, "d"));
        terms.push(link(Parameter::Theta, 1, "theta"));
        terms.push(link(Parameter::Alpha, 0, "alpha"));
        terms.push(link(Parameter::A, 0, "a"));
    }
    terms.extend(compliances(model, data, choice)?);
    if choice.waves {
        terms.extend((1..=n).flat_map(waves));
    }
    let wanted = |t: &Term| choice.optional.contains(&t.name);
    terms.extend(optional_groups(model, data, choice)?.into_iter().flatten().filter(wanted));
    Ok(terms)
}

/// Groups of terms of which the measurements decide whether they are needed: what gravity does to an arm without masses where compliance is
/// asked for, and errors of a rail over its length and zeros of measured lengths where everything is.
///
/// # Errors
/// As [`Choice::elasticity`].
pub(crate) fn optional_groups(model: &Model, data: &Dataset, choice: &Choice) -> Result<Vec<Vec<Term>>> {
    // sockets at unknown places: what else there is to know, errors at places held out decide
    if choice.set < ParameterSet::Compliance || !unknown_places(&model.cell, data).is_empty() {
        return Ok(Vec::new());
    }
    let sags = choice.elasticity(&model.robot, data)? == Elasticity::Inclination;
    let mut groups = if sags { vec![sag(model)] } else { Vec::new() };
    if choice.set == ParameterSet::Complete {
        groups.extend(rail(model, data));
        groups.push(length_zeros(model, data));
    }
    groups.retain(|g| !g.is_empty());
    Ok(groups)
}

/// Two waves of a joint's error over its own angle, once and twice a turn.
fn waves(joint: usize) -> impl Iterator<Item = Term> {
    let wave = move |(k, cycles)| {
        [("sine", Shape::Sine { cycles }), ("cosine", Shape::Cosine { cycles })].map(|(name, shape)| {
            let basis = Basis::new(Variable::Joint { joint }, shape);
            Term::new(format!("{name}_{k}_{joint}"), "joint_harmonic", Site::Joint { joint }, basis)
        })
    };
    [(1, 1.0), (2, 2.0)].into_iter().flat_map(wave)
}

/// What says how far joints give way under load: of joints without a torque sensor the masses, where they are known.
fn compliances(model: &Model, data: &Dataset, choice: &Choice) -> Result<Vec<Term>> {
    let elasticity = choice.elasticity(&model.robot, data)?;
    let measured = match elasticity {
        Elasticity::NotAsked | Elasticity::Inclination => return Ok(Vec::new()),
        Elasticity::Torques => measured_torques(data.observations.iter().map(|o| &o.state)),
        Elasticity::Masses => [false; MAX_JOINTS],
    };
    let masses = model.robot.require_masses().is_ok();
    let joints = (1..=model.robot.dof()).filter(|joint| choice.is_compliant(*joint) && (measured[joint - 1] || masses));
    let basis = |joint| match measured[joint - 1] {
        true => Basis::measured_torque(joint),
        false => Basis::torque(joint, Shape::Linear),
    };
    let term = |joint| Term::new(format!("c_{joint}"), "compliance", Site::Joint { joint }, basis(joint));
    Ok(joints.map(term).collect())
}

/// Axes with a smaller sine between them are nearly parallel (6 deg): an error of 3 mrad then moves their common normal by more than 3 % of
/// its length.
pub(crate) const NEAR_PARALLEL: f64 = 0.1;

/// What the tool and the place of the balls add in those sessions that have their own.
fn own_terms(shared: &[Term], cell: &Cell, data: &Dataset, own: &OwnSetup) -> Vec<Term> {
    let has = |session: u32, f: &dyn Fn(&Measured) -> bool| {
        data.observations.iter().any(|o| o.state.session == Some(session) && f(&o.measured))
    };
    let of = |name: &str, effect: &str, site: Site, session: u32| {
        Term::new(format!("{name}_s{session}"), effect, site, Basis::CONSTANT.in_session(session))
    };
    let mut out = Vec::new();
    for session in &own.tool {
        for t in shared {
            let seen = match t.site {
                Site::Tool(_) => has(*session, &|m| !matches!(m, Measured::Point { .. })),
                Site::Target { target, .. } => {
                    has(*session, &|m| matches!(m, Measured::Point { target: t, .. } if *t + 1 == target))
                }
                _ => false,
            };
            if seen {
                out.push(of(&t.name, &t.effect, t.site, *session));
            }
        }
    }
    let placed = |session: u32| shared.iter().any(|t| t.effect == "place" && t.basis.session == Some(session));
    for session in own.balls.iter().filter(|s| !placed(**s)) {
        let motions = ball_places::motions_in(cell, data, *session).into_iter();
        out.extend(motions.map(|m| of(&format!("balls_{}", m.name()), "balls", Site::Fixture(m), *session)));
    }
    out
}
