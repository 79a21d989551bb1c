//! The one forward function and the one Jacobian routine, all terms composed exactly: a model made ready for them. What it says at a pose is in
//! `prediction.rs`, its derivatives in `jacobian.rs`.

use nalgebra::{Matrix3, Vector3};

use crate::basis::{Basis, Variable};
use crate::cell::Cell;
use crate::chain::{Axes, Chain, Frames, JointIncrement, Loads, Moment, MomentAt, moved, small_rotation};
use crate::error::{ModelError, Result};
use crate::ik::usual::Usual;
use crate::pose::Pose;
use crate::recording::{MAX_JOINTS, Measured};
use crate::robot::Robot;
use crate::target::Through;
use crate::term::{Action, Dof, Motion, Site, Term, actions};

type V3 = Vector3<f64>;

/// Standard gravity, m/s^2.
pub const GRAVITY: f64 = 9.80665;

/// A robot in its cell with everything that moves its TCP away from nominal.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// The nominal arm.
    pub robot: Robot,
    /// The nominal cell.
    pub cell: Cell,
    /// `frame_from_world` of each measuring frame, before the terms at [`crate::Site::Frame`].
    pub frames: Vec<Pose>,
    /// The terms.
    pub terms: Vec<Term>,
}

impl Model {
    /// The nominal model: no terms, no measuring frames.
    #[must_use]
    pub fn nominal(robot: Robot, cell: Cell) -> Self {
        Self { robot, cell, frames: Vec::new(), terms: Vec::new() }
    }

    /// The same with what was identified of a target at the TCP as the tool's: where an instrument saw nothing else of the tool, the point that it saw is
    /// the one that programs bring to its place.
    #[must_use]
    pub fn with_seen_tcp(mut self) -> Self {
        let is_tool = |t: &Term| matches!(t.site, Site::Tool(Motion::Along(_))) && t.basis.is_constant();
        if self.cell.tool.targets == [self.cell.tool.tcp] && !self.terms.iter().any(is_tool) {
            for term in &mut self.terms {
                if let Site::Target { axis, .. } = term.site {
                    term.site = Site::Tool(Motion::Along(axis));
                }
            }
        }
        self
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Bound {
    /// Index into `Forward::dofs`.
    pub(crate) dof: usize,
    pub(crate) basis: Basis,
    pub(crate) weight: f64,
    pub(crate) constant: bool,
    /// Index into `Forward::moments`, where the basis looks at one.
    pub(crate) moment: Option<usize>,
}

/// A model made ready for many poses. Shared between threads; each has its own [`Workspace`].
#[derive(Clone, Debug)]
pub struct Forward {
    pub(crate) model: Model,
    /// Resolved actions of all terms, one after the other.
    pub(crate) bound: Vec<Bound>,
    /// Actions of term k are `bound[spans[k].0..spans[k].1]`.
    pub(crate) spans: Vec<(usize, usize)>,
    pub(crate) dofs: Vec<Dof>,
    /// The gravity moments that basis functions look at.
    pub(crate) moments: Vec<MomentAt>,
    pub(crate) free: Vec<usize>,
    /// Motion and weight of each free term, where every one acts by one motion alone and nothing goes through gravity moments; else empty.
    pub(crate) direct: Vec<(usize, f64)>,
    /// Whether constant terms at the tool are free.
    pub(crate) frees_tool: bool,
    /// Actions whose basis is not constant.
    pub(crate) varying: Vec<(usize, usize)>,
    /// Those of them that are the payload of one session.
    pub(crate) payloads: Vec<(usize, usize)>,
    pub(crate) moves_base: bool,
    /// Where inverse kinematics have a short way: a usual arm without terms.
    pub(crate) usual: Option<Usual>,
    // with coefficients built in:
    pub(crate) chain: Chain,
    /// Sums of the constant terms at the base, the tool and each frame: x, y, z, rx, ry, rz.
    pub(crate) base: [f64; 6],
    pub(crate) tool: [f64; 6],
    pub(crate) frame_moves: Vec<[f64; 6]>,
    pub(crate) tool_rotation: Matrix3<f64>,
    pub(crate) tool_turns: Axes,
    pub(crate) targets: Vec<V3>,
    pub(crate) balls: Vec<V3>,
    pub(crate) anchors: Vec<(V3, f64)>,
    pub(crate) frames: Vec<(Pose, Axes)>,
    pub(crate) fixture: [f64; 6],
    pub(crate) gravity: V3,
    pub(crate) payload: (f64, V3),
}

/// One thread's scratch space for one model.
#[derive(Clone, Debug)]
pub struct Workspace {
    pub(crate) still: Frames,
    pub(crate) moved: Frames,
    pub(crate) loads: Loads,
    pub(crate) moments: Vec<Moment>,
    /// What the basis of each action that is not constant says.
    pub(crate) says: Vec<f64>,
    /// Derivative of the residual to each moment.
    pub(crate) elastic: Vec<[f64; 6]>,
    /// What a motion before, or behind, the joints of the moments does to the residual through them: of joint s, and of the
    /// base at the end.
    pub(crate) through: [Through; MAX_JOINTS + 1],
    pub(crate) columns: Vec<[f64; 6]>,
    pub(crate) increments: [JointIncrement; MAX_JOINTS],
    pub(crate) base: [f64; 6],
    pub(crate) tool: [f64; 6],
    pub(crate) fixture: [f64; 6],
    pub(crate) frame: [f64; 6],
    /// How far the target that is seen, or the ball that is touched, is from its constant place: on the tool in flange axes, in the set of
    /// balls in its own.
    pub(crate) point: [f64; 3],
    pub(crate) residual: [f64; 6],
}

impl Workspace {
    /// The residual of the last observation; as many entries as [`Forward::residual`] said.
    #[must_use]
    pub fn residual(&self) -> &[f64; 6] {
        &self.residual
    }
}

/// Number of scalar residuals of a measurement: 3, 1 or 6; references are not predicted by the arm's model.
#[must_use]
pub fn residual_rows(measured: &Measured) -> usize {
    match measured {
        Measured::Touch { .. } | Measured::Point { .. } => 3,
        Measured::Distance { .. } => 1,
        Measured::Pose { .. } => 6,
        Measured::Reference { .. } => 0,
    }
}

/// Where it stands in a list, at the end of which it is put where it is new.
fn place_in<T: PartialEq>(list: &mut Vec<T>, one: T) -> usize {
    list.iter().position(|o| *o == one).unwrap_or_else(|| {
        list.push(one);
        list.len() - 1
    })
}

impl Forward {
    /// Prepares a model. `free` are the indices of the terms whose columns the Jacobian has, in that order.
    ///
    /// # Errors
    /// A term at a site that the arm does not have, or gravity moments of an arm without masses.
    pub fn new(model: Model, free: Vec<usize>) -> Result<Self> {
        let mut this = Self::unbound(model, free);
        for k in 0..this.model.terms.len() {
            let start = this.bound.len();
            for action in actions(&this.model.terms[k], &this.model.robot, &this.model.cell, this.model.frames.len())? {
                this.bind(k, action)?;
            }
            this.spans.push((start, this.bound.len()));
        }
        if !this.moments.is_empty() {
            this.model.robot.require_masses()?;
        }
        if this.moments.is_empty() {
            let direct = |term: &usize| this.only_action(*term).filter(|b| b.constant).map(|b| (b.dof, b.weight));
            this.direct = this.free.iter().map(direct).collect::<Option<_>>().unwrap_or_default();
        }
        this.frees_tool = this.direct.iter().any(|(dof, _)| matches!(this.dofs[*dof], Dof::Tool(_)));
        this.rebuild();
        if this.model.terms.is_empty() {
            let Model { robot, cell, .. } = &this.model;
            let flange_from_tool = Pose { rotation: cell.tool.rotation, translation: cell.tool.tcp };
            this.usual = Usual::of(robot, &cell.world_from_base, &flange_from_tool);
        }
        Ok(this)
    }

    /// Before any term acts.
    fn unbound(model: Model, free: Vec<usize>) -> Self {
        Self {
            bound: Vec::new(),
            spans: Vec::new(),
            dofs: Vec::new(),
            moments: Vec::new(),
            free,
            direct: Vec::new(),
            frees_tool: false,
            varying: Vec::new(),
            payloads: Vec::new(),
            moves_base: false,
            usual: None,
            chain: Chain::new(
                &model.robot,
                &model.cell.world_from_base,
                &[JointIncrement::default(); MAX_JOINTS],
                &[0.0; 6],
            ),
            base: [0.0; 6],
            tool: [0.0; 6],
            frame_moves: Vec::new(),
            tool_rotation: Matrix3::identity(),
            tool_turns: Axes::of(&Pose::identity()),
            targets: Vec::new(),
            balls: Vec::new(),
            anchors: Vec::new(),
            frames: Vec::new(),
            fixture: [0.0; 6],
            gravity: V3::zeros(),
            payload: (0.0, V3::zeros()),
            model,
        }
    }

    /// Adds an action of term `k`.
    fn bind(&mut self, k: usize, action: Action) -> Result<()> {
        let Action { dof, basis, weight } = action;
        let constant = basis.is_constant();
        // the payload comes before the moments that a basis may look at
        let of_a_session = basis == Basis { session: basis.session, place: basis.place, ..Basis::CONSTANT };
        let can_vary = match dof {
            Dof::Chain(..)
            | Dof::Base(_)
            | Dof::Tool(_)
            | Dof::Fixture(_)
            | Dof::Frame(..)
            | Dof::Target(..)
            | Dof::Ball(..) => true,
            Dof::PayloadMass | Dof::PayloadMoment(_) => of_a_session,
            _ => false,
        };
        if !constant && !can_vary {
            let term = &self.model.terms[k];
            return Err(ModelError::NoSuchSite {
                term: term.name.clone(),
                site: format!("{} as a quantity that varies from pose to pose", term.site),
            });
        }
        let at = match basis.of {
            Variable::Moment { joint, axis } => Some(MomentAt { joint: joint - 1, axis, foot: false }),
            Variable::FootMoment { joint, axis } => Some(MomentAt { joint: joint - 1, axis, foot: true }),
            _ => None,
        };
        if !constant {
            self.varying.push((k, self.bound.len()));
            if dof.is_load() {
                self.payloads.push((k, self.bound.len()));
            }
            self.moves_base |= matches!(dof, Dof::Base(_));
        }
        let dof = place_in(&mut self.dofs, dof);
        let moment = at.map(|at| place_in(&mut self.moments, at));
        self.bound.push(Bound { dof, basis, weight, constant, moment });
        Ok(())
    }

    /// The action of a term that has one alone.
    pub(crate) fn only_action(&self, term: usize) -> Option<&Bound> {
        let (from, to) = *self.spans.get(term)?;
        if let [b] = &self.bound[from..to] { Some(b) } else { None }
    }

    /// The model with its present coefficients.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Gives the model back.
    #[must_use]
    pub fn into_model(self) -> Model {
        self.model
    }

    /// Indices of the free terms.
    #[must_use]
    pub fn free(&self) -> &[usize] {
        &self.free
    }

    /// Present coefficients of the free terms, SI.
    #[must_use]
    pub fn coefficients(&self) -> Vec<f64> {
        self.free.iter().map(|k| self.model.terms[*k].value).collect()
    }

    /// Sets the coefficients of the free terms, SI.
    pub fn set_coefficients(&mut self, values: &[f64]) {
        for (k, v) in self.free.iter().zip(values) {
            self.model.terms[*k].value = *v;
        }
        self.rebuild();
    }

    /// Scratch space for this model.
    #[must_use]
    pub fn workspace(&self) -> Workspace {
        Workspace {
            still: Frames::default(),
            moved: Frames::default(),
            loads: Loads::new(),
            moments: Vec::with_capacity(self.moments.len()),
            says: vec![0.0; self.bound.len()],
            elastic: vec![[0.0; 6]; self.moments.len()],
            through: [Through::default(); MAX_JOINTS + 1],
            columns: vec![[0.0; 6]; self.dofs.len()],
            increments: [JointIncrement::default(); MAX_JOINTS],
            base: [0.0; 6],
            tool: [0.0; 6],
            fixture: [0.0; 6],
            frame: [0.0; 6],
            point: [0.0; 3],
            residual: [0.0; 6],
        }
    }

    /// Builds the coefficients of constant terms in.
    fn rebuild(&mut self) {
        let cell = &self.model.cell;
        let mut chain = [JointIncrement::default(); MAX_JOINTS];
        let (mut base, mut tool, mut fixture) = ([0.0; 6], [0.0; 6], [0.0; 6]);
        let mut frames = vec![[0.0; 6]; self.model.frames.len()];
        self.targets.clone_from(&cell.tool.targets);
        self.balls.clone_from(&cell.balls);
        self.anchors = cell.anchors.iter().map(|a| (*a, 0.0)).collect();
        self.gravity = V3::new(0.0, 0.0, -GRAVITY);
        self.payload = (cell.tool.mass, cell.tool.cog * cell.tool.mass);
        for (term, span) in self.model.terms.iter().zip(&self.spans) {
            for b in self.bound[span.0..span.1].iter().filter(|b| b.constant) {
                let v = term.value * b.weight;
                match self.dofs[b.dof] {
                    Dof::Chain(i, dof) => chain[i][dof as usize] += v,
                    Dof::Base(k) => base[k] += v,
                    Dof::Tool(k) => tool[k] += v,
                    Dof::Target(t, k) => self.targets[t][k] += v,
                    Dof::Fixture(k) => fixture[k] += v,
                    Dof::Ball(t, k) => self.balls[t][k] += v,
                    Dof::Frame(f, k) => frames[f][k] += v,
                    Dof::Gravity(k) => self.gravity[k] += v,
                    Dof::PayloadMass => {
                        self.payload.0 += v;
                        self.payload.1 += cell.tool.cog * v;
                    }
                    Dof::PayloadMoment(k) => self.payload.1[k] += v,
                    Dof::Anchor(t, k) => self.anchors[t].0[k] += v,
                    Dof::LengthZero(t) => self.anchors[t].1 += v,
                }
            }
        }
        self.chain = Chain::new(&self.model.robot, &cell.world_from_base, &chain, &base);
        self.base = base;
        self.tool = tool;
        let (turns, turn) = small_rotation(&tool);
        self.tool_turns = turns;
        self.tool_rotation = turn * cell.tool.rotation;
        self.fixture = fixture;
        self.frames = self.model.frames.iter().zip(&frames).map(|(reference, by)| moved(reference, by)).collect();
        self.frame_moves = frames;
    }
}
