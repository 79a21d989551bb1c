//! What a model says at a pose: frames, tool, links, and how far a measurement is from it.
//!
//! A pose is predicted in two passes over the chain. The first uses the constant terms only: its frames give the gravity
//! moments. The second adds what the other bases say at this pose. Derivatives follow both passes: a change of geometry
//! moves the tool directly, and through the gravity torques on which compliance acts.

use nalgebra::{Matrix3, Vector3};

use crate::axis::Axis;
use crate::basis::{Basis, Variable, Wave};
use crate::chain::{
    Axes, Increments, JointFrames, JointIncrement, Moment, MomentAt, Place, moved, shift, small_rotation,
};
use crate::error::{ModelError, Result};
use crate::forward::{Forward, Workspace, residual_rows};
use crate::pose::{Pose, left_jacobian_inverse, quaternion_from_rotation, rotation_from_quaternion, rotation_vector};
use crate::recording::{Joints, MAX_JOINTS, Measured, State};
use crate::target::{Map, Target};
use crate::term::Dof;

type V3 = Vector3<f64>;

/// What stands for a measurement where there is none.
pub(crate) const NOTHING: Measured = Measured::Point { target: 0, position: [0.0; 3] };

impl Forward {
    /// `frame_from_world` of measuring frame `frame` (0-based) with the constant terms.
    #[must_use]
    pub fn frame_from_world(&self, frame: usize) -> Option<Pose> {
        self.frames.get(frame).map(|f| f.0)
    }

    /// The orientation of the tool as measuring frame `frame` (0-based) sees it, or the world without one: unit quaternion w, x, y, z.
    #[must_use]
    pub fn orientation_seen(&self, state: &State, frame: usize, ws: &mut Workspace) -> [f64; 4] {
        let tool = self.world_from_tool(state, ws).rotation;
        quaternion_from_rotation(&self.frame_from_world(frame).map_or(tool, |f| f.rotation * tool))
    }

    /// What a variable says at this pose.
    #[inline]
    pub(crate) fn variable(basis: &Basis, moment: Option<&Moment>, state: &State, measured: &Measured) -> f64 {
        match basis.of {
            // a part of either moment in every action: see `term::across_between`
            Variable::Nothing | Variable::PartMoment { .. } => 0.0,
            Variable::Joint { joint } => state.q[joint - 1],
            Variable::Moment { .. } | Variable::FootMoment { .. } => moment.map_or(0.0, |m| m.value),
            Variable::Torque { joint } => state.torques.map_or(0.0, |t| t[joint - 1]),
            Variable::Inclination { first, last } => state.q[first - 1..last].iter().sum(),
            Variable::Lag { joint } => state.q_commanded.map_or(0.0, |c| c[joint - 1] - state.q[joint - 1]),
            Variable::Time => state.t.unwrap_or(0.0),
            Variable::Seq => state.seq.unwrap_or(0.0),
            Variable::Temperature { reference_c } => state.temp_c.map_or(0.0, |t| t - reference_c),
            Variable::Reading { axis } => match measured {
                Measured::Touch { reading, .. } => reading[axis.index()],
                _ => 0.0,
            },
        }
    }

    /// What multiplies a basis's shape.
    #[inline]
    pub(crate) fn factor(basis: &Basis, state: &State) -> f64 {
        if basis.is_elsewhere(state) {
            return 0.0;
        }
        let sense = match basis.sense {
            None => 1.0,
            Some(joint) => state.dir.map_or(0.0, |d| f64::from(d[joint - 1])),
        };
        basis.beside.map_or(sense, |b| sense * b.shape.at(state.q[b.joint - 1]).0)
    }

    pub(crate) fn payload_at(&self, state: &State) -> (f64, V3) {
        let extra = state.payload_kg.unwrap_or(0.0);
        let mut payload = (self.payload.0 + extra, self.payload.1 + self.model.cell.tool.cog * extra);
        for (k, index) in &self.payloads {
            let b = &self.bound[*index];
            let v = self.model.terms[*k].value * b.weight * Self::factor(&b.basis, state);
            match self.dofs[b.dof] {
                Dof::PayloadMass => {
                    payload.0 += v;
                    payload.1 += self.model.cell.tool.cog * v;
                }
                Dof::PayloadMoment(axis) => payload.1[axis] += v,
                _ => {}
            }
        }
        payload
    }

    /// Both passes over the chain: `ws.moved` then holds the true frames.
    #[inline]
    pub(crate) fn frames_at(&self, state: &State, measured: &Measured, frame: usize, ws: &mut Workspace) {
        self.frames(false, state, measured, frame, ws);
    }

    /// The same; in the `same` state as before, what bases and moments are there is known.
    #[inline]
    pub(crate) fn frames(&self, same: bool, state: &State, measured: &Measured, frame: usize, ws: &mut Workspace) {
        ws.point = [0.0; 3];
        if self.varying.is_empty() {
            self.chain.run(&state.q, None, &mut ws.moved);
            ws.tool = self.tool;
            ws.fixture = self.fixture;
            ws.frame = self.frame_moves.get(frame).copied().unwrap_or_default();
            return;
        }
        if !same && !self.moments.is_empty() {
            ws.moments.clear();
            self.chain.run(&state.q, None, &mut ws.still);
            self.chain.loads(&ws.still, self.payload_at(state), &mut ws.loads);
            for at in &self.moments {
                ws.moments.push(self.chain.moment(&ws.still, &ws.loads, *at, &self.gravity));
            }
        }
        ws.increments = [JointIncrement::default(); MAX_JOINTS];
        ws.base = self.base;
        ws.tool = self.tool;
        ws.fixture = self.fixture;
        ws.frame = self.frame_moves.get(frame).copied().unwrap_or_default();
        let mut wave = Wave::default();
        for (k, index) in &self.varying {
            let b = &self.bound[*index];
            if !same || matches!(b.basis.of, Variable::Reading { .. }) {
                let u = Self::variable(&b.basis, b.moment.map(|m| &ws.moments[m]), state, measured);
                ws.says[*index] = Self::factor(&b.basis, state) * wave.value(b.basis.shape, u);
            }
            let v = self.model.terms[*k].value * b.weight * ws.says[*index];
            match self.dofs[b.dof] {
                Dof::Chain(i, dof) => ws.increments[i][dof as usize] += v,
                Dof::Base(m) => ws.base[m] += v,
                Dof::Tool(m) => ws.tool[m] += v,
                Dof::Fixture(m) => ws.fixture[m] += v,
                Dof::Frame(f, m) if f == frame => ws.frame[m] += v,
                Dof::Target(t, m) if matches!(measured, Measured::Point { target, .. } if *target == t) => {
                    ws.point[m] += v;
                }
                Dof::Ball(t, m) if matches!(measured, Measured::Touch { ball, .. } if *ball == t) => ws.point[m] += v,
                _ => {}
            }
        }
        let still = (!self.moments.is_empty()).then_some(&ws.still);
        let increments = Increments { by_joint: &ws.increments, still };
        if self.moves_base {
            self.chain.run_with_base(&ws.base, &state.q, Some(&increments), &mut ws.moved);
        } else {
            self.chain.run(&state.q, Some(&increments), &mut ws.moved);
        }
    }

    /// As [`Forward::frames_at`] where nothing is measured.
    #[inline]
    fn frames_unmeasured(&self, state: &State, ws: &mut Workspace) {
        self.frames_at(state, &NOTHING, usize::MAX, ws);
    }

    /// Orientation of the tool in the flange frame at this pose, with the axes of its three rotations.
    #[inline]
    pub(crate) fn tool_at(&self, ws: &Workspace) -> (Matrix3<f64>, Axes) {
        if ws.tool[3..] == self.tool[3..] {
            (self.tool_rotation, self.tool_turns)
        } else {
            let (turns, turn) = small_rotation(&ws.tool);
            (turn * self.model.cell.tool.rotation, turns)
        }
    }

    /// The TCP in the flange frame at this pose.
    #[inline]
    pub(crate) fn tcp_in_flange(&self, ws: &Workspace) -> V3 {
        self.model.cell.tool.tcp + shift(&ws.tool)
    }

    /// How far the tool has moved on the flange at this pose, beyond its constant place.
    #[inline]
    fn slip(&self, ws: &Workspace) -> V3 {
        V3::new(ws.tool[0] - self.tool[0], ws.tool[1] - self.tool[1], ws.tool[2] - self.tool[2])
    }

    #[inline]
    pub(crate) fn frame_at(&self, frame: usize, ws: &Workspace) -> (Pose, Axes) {
        let (Some((pose, turns)), Some(still)) = (self.frames.get(frame), self.frame_moves.get(frame)) else {
            return (Pose::identity(), Axes::of(&Pose::identity()));
        };
        if ws.frame == *still {
            return (*pose, *turns);
        }
        moved(&self.model.frames[frame], &ws.frame)
    }

    pub(crate) fn ball_at(&self, ball: usize, ws: &Workspace) -> (V3, Axes) {
        let f = &ws.fixture;
        if *f == [0.0; 6] {
            return (self.balls[ball] + V3::from(ws.point), Axes::of(&Pose::identity()));
        }
        let (turns, turn) = small_rotation(f);
        (turn * (self.balls[ball] + V3::from(ws.point)) + shift(f), turns)
    }

    /// The pose of the tool's TCP in {w}: what the arm really does at `state`, by this model.
    pub fn world_from_tool(&self, state: &State, ws: &mut Workspace) -> Pose {
        let flange = self.flange(state, ws);
        self.tool_on(&flange, ws)
    }

    /// As [`Forward::world_from_tool`], and leaves the frames of all joints in `ws.moved`.
    pub(crate) fn world_from_tool_and_frames(&self, state: &State, ws: &mut Workspace) -> Pose {
        self.frames_unmeasured(state, ws);
        self.tool_on(&ws.moved.flange, ws)
    }

    /// Orientation of the tool in {w} at the measurement that was linearized last.
    #[must_use]
    pub fn tool_axes(&self, ws: &Workspace) -> Matrix3<f64> {
        ws.moved.flange.axes.matrix() * self.tool_at(ws).0
    }

    #[inline]
    fn tool_on(&self, flange: &Place, ws: &Workspace) -> Pose {
        let (rotation, _) = self.tool_at(ws);
        let tcp = self.tcp_in_flange(ws);
        Pose { rotation: flange.axes.matrix() * rotation, translation: flange.origin + flange.axes.times(&tcp) }
    }

    /// The pose of the flange in {w}.
    pub fn world_from_flange(&self, state: &State, ws: &mut Workspace) -> Pose {
        self.flange(state, ws).pose()
    }

    /// The flange in {w}, and the tool's motions in `ws`: without its other frames where nothing varies from pose to pose.
    #[inline]
    fn flange(&self, state: &State, ws: &mut Workspace) -> Place {
        if self.varying.is_empty() {
            ws.tool = self.tool;
            return self.chain.flange(&state.q);
        }
        self.frames_unmeasured(state, ws);
        ws.moved.flange
    }

    /// Poses of the base, of every joint's frame but the last, and of the flange in {w}, base first: for pictures and
    /// collision checks. (The flange is the last joint's frame, unless the robot says otherwise.)
    pub fn world_from_links(&self, state: &State, ws: &mut Workspace) -> Vec<Pose> {
        let mut links = vec![Pose::identity(); self.chain.dof() + 1];
        self.world_from_links_into(state, ws, &mut links);
        links
    }

    /// Frames {1} to {n} of the joints in {w}.
    pub fn world_from_joints(&self, state: &State, ws: &mut Workspace) -> Vec<Pose> {
        self.frames_unmeasured(state, ws);
        ws.moved.joints[..self.chain.dof()].iter().map(JointFrames::pose).collect()
    }

    /// As [`Forward::world_from_links`], into a slice of n + 1 poses.
    pub fn world_from_links_into(&self, state: &State, ws: &mut Workspace, links: &mut [Pose]) {
        self.frames_unmeasured(state, ws);
        let base = Pose { rotation: ws.moved.base_axes.matrix(), translation: ws.moved.base_origin };
        let joints = ws.moved.joints[..self.chain.dof() - 1].iter().map(JointFrames::pose);
        let flange = std::iter::once(ws.moved.flange.pose());
        for (to, from) in links.iter_mut().zip(std::iter::once(base).chain(joints).chain(flange)) {
            *to = from;
        }
    }

    /// Gravity torque about each joint's axis (force along it for prismatic joints) at `state`, N m, with the constant terms
    /// built in: what gravity does, positive about +z.
    ///
    /// # Errors
    /// The robot has no masses.
    pub fn gravity_torques(&self, state: &State, ws: &mut Workspace) -> Result<Joints> {
        self.model.robot.require_masses()?;
        self.chain.run(&state.q, None, &mut ws.still);
        self.chain.loads(&ws.still, self.payload_at(state), &mut ws.loads);
        let mut tau = [0.0; MAX_JOINTS];
        for (i, t) in tau.iter_mut().enumerate().take(self.chain.dof()) {
            let at = MomentAt { joint: i, axis: Axis::Z, foot: false };
            *t = self.chain.moment(&ws.still, &ws.loads, at, &self.gravity).value;
        }
        Ok(tau)
    }

    /// Checks that a measurement can be predicted by this model: its ball, target, anchor and frame exist, and every
    /// covariate that a term needs is there.
    ///
    /// # Errors
    /// What is missing.
    pub fn check(&self, state: &State, measured: &Measured, frame: usize) -> Result<()> {
        let exists = |what, number: usize, have: usize| {
            if number < have { Ok(()) } else { Err(ModelError::NoSuchPoint { what, number: number + 1, have }) }
        };
        match measured {
            Measured::Touch { ball, .. } => exists("ball", *ball, self.balls.len())?,
            Measured::Point { target, .. } => {
                exists("target", *target, self.targets.len())?;
                exists("frame", frame, self.frames.len())?;
            }
            Measured::Distance { anchor, .. } => exists("anchor", *anchor, self.anchors.len())?,
            Measured::Pose { .. } => exists("frame", frame, self.frames.len())?,
            Measured::Reference { .. } => {}
        }
        for (k, index) in &self.varying {
            if let Some(needs) = self.bound[*index].basis.missing(state, measured)
                && !matches!(self.bound[*index].basis.of, Variable::Reading { .. })
            {
                return Err(ModelError::MissingCovariate {
                    term: self.model.terms[*k].name.clone(),
                    needs: needs.to_owned(),
                });
            }
        }
        Ok(())
    }

    /// Predicted minus measured, in SI, into the workspace; returns the number of scalars: touch 3 (world axes), point 3
    /// (measuring frame), distance 1, pose 6 (measuring frame, then rotation vector in the tool's axes, rad).
    /// The measurement must have passed [`Forward::check`].
    #[inline]
    pub fn residual(&self, state: &State, measured: &Measured, frame: usize, ws: &mut Workspace) -> usize {
        self.frames_at(state, measured, frame, ws);
        self.compare(measured, frame, ws);
        residual_rows(measured)
    }

    pub(crate) fn compare(&self, measured: &Measured, frame: usize, ws: &mut Workspace) -> Target {
        let flange = ws.moved.flange;
        let nothing = Target { point: V3::zeros(), map: Map::World };
        match measured {
            Measured::Touch { ball, reading } => {
                let (rotation, _) = self.tool_at(ws);
                let in_flange = self.tcp_in_flange(ws) + rotation * V3::from(*reading);
                let point = flange.origin + flange.axes.times(&in_flange);
                let r = point - self.ball_at(*ball, ws).0;
                ws.residual = [r.x, r.y, r.z, 0.0, 0.0, 0.0];
                Target { point, map: Map::World }
            }
            Measured::Point { target, position } => {
                let point =
                    flange.origin + flange.axes.times(&(self.targets[*target] + V3::from(ws.point) + self.slip(ws)));
                let (pose, _) = self.frame_at(frame, ws);
                let r = pose.apply(&point) - V3::from(*position);
                ws.residual = [r.x, r.y, r.z, 0.0, 0.0, 0.0];
                Target { point, map: Map::Frame(pose.rotation) }
            }
            Measured::Distance { anchor, length } => {
                let point = flange.origin + flange.axes.times(&self.tcp_in_flange(ws));
                let (from, zero) = self.anchors[*anchor];
                let d = (point - from).norm();
                ws.residual = [d + zero - length, 0.0, 0.0, 0.0, 0.0, 0.0];
                Target { point, map: Map::Length((point - from) / d.max(1e-12)) }
            }
            Measured::Pose { position, quaternion } => {
                let (tool, _) = self.tool_at(ws);
                let point = flange.origin + flange.axes.times(&self.tcp_in_flange(ws));
                let (pose, _) = self.frame_at(frame, ws);
                let r = pose.apply(&point) - V3::from(*position);
                let measured_from_frame = rotation_from_quaternion(*quaternion).transpose();
                let v = rotation_vector(&(measured_from_frame * pose.rotation * flange.axes.matrix() * tool));
                ws.residual = [r.x, r.y, r.z, v.x, v.y, v.z];
                let rotation = left_jacobian_inverse(&v) * measured_from_frame * pose.rotation;
                Target { point, map: Map::Pose { frame: pose.rotation, rotation } }
            }
            Measured::Reference { .. } => nothing,
        }
    }
}
