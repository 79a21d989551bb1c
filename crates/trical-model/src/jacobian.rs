//! Derivatives of the forward function: to every free coefficient, and to the joints.

use nalgebra::Vector3;

use crate::basis::{Basis, Variable};
use crate::chain::{Moment, shift};
use crate::forward::{Forward, Workspace, residual_rows};
use crate::pose::Pose;
use crate::prediction::NOTHING;
use crate::recording::{Measured, State};
use crate::robot::JointKind;
use crate::target::{Map, Target, Through};
use crate::term::{ChainDof, Dof};

type V3 = Vector3<f64>;

const E: [V3; 3] = [V3::new(1.0, 0.0, 0.0), V3::new(0.0, 1.0, 0.0), V3::new(0.0, 0.0, 1.0)];

impl Forward {
    /// Residual and Jacobian: `jacobian` receives d residual / d coefficient of the free terms, row by row
    /// (`jacobian[row * p + column]`, p = number of free terms). Returns the number of rows. Nothing is allocated.
    /// The measurement must have passed [`Forward::check`].
    #[inline]
    pub fn linearize(
        &self,
        state: &State,
        measured: &Measured,
        frame: usize,
        ws: &mut Workspace,
        jacobian: &mut [f64],
    ) -> usize {
        self.linearize_next(false, state, (measured, frame), ws, jacobian)
    }

    /// As [`Forward::linearize`], of what was measured, and its frame, in the `same` state as at the last call with this workspace.
    #[inline]
    pub fn linearize_next(
        &self,
        same: bool,
        state: &State,
        (measured, frame): (&Measured, usize),
        ws: &mut Workspace,
        jacobian: &mut [f64],
    ) -> usize {
        let rows = residual_rows(measured);
        self.frames(same, state, measured, frame, ws);
        let target = self.compare(measured, frame, ws);
        self.all_columns(state, measured, frame, &target, ws);
        let p = self.free.len();
        // as in `column`: constant terms at the tool do not move a target
        let tool_is_still = self.frees_tool && matches!(measured, Measured::Point { .. });
        if !self.direct.is_empty() && !tool_is_still {
            for (row, entries) in jacobian.chunks_exact_mut(p).enumerate().take(rows) {
                for (entry, (dof, weight)) in entries.iter_mut().zip(&self.direct) {
                    *entry = ws.columns[*dof][row] * weight;
                }
            }
            return rows;
        }
        for (column, term) in self.free.iter().enumerate() {
            for (row, value) in self.column(*term, measured, ws).iter().enumerate().take(rows) {
                jacobian[row * p + column] = *value;
            }
        }
        rows
    }

    /// The pose of the tool in {w} and its Jacobian to the joints: rows x, y, z (m) and the angular velocity (rad) in {w},
    /// `jacobian[row * n + joint]`. Everything that depends on the joints is followed: torques, harmonics, couplings.
    pub fn joint_jacobian(&self, state: &State, ws: &mut Workspace, jacobian: &mut [f64]) -> Pose {
        let pose = self.world_from_tool_and_frames(state, ws);
        let target = Target { point: pose.translation, map: Map::Twist };
        self.all_columns(state, &NOTHING, usize::MAX, &target, ws);
        let n = self.chain.dof();
        for (i, joint) in self.model.robot.joints.iter().enumerate() {
            let own = if joint.kind == JointKind::Prismatic { ChainDof::D } else { ChainDof::Theta };
            let dof = Dof::Chain(i, own);
            let mut sum = self.dof_column(dof, &NOTHING, usize::MAX, &target, ws);
            if !self.moments.is_empty() {
                self.add_through_moments(dof, ws, 1.0, &mut sum);
            }
            for (k, index) in &self.varying {
                let b = &self.bound[*index];
                let moment = b.moment.map(|m| &ws.moments[m]);
                let slope = Self::slope_by_joint(&b.basis, i + 1, moment, state);
                if slope != 0.0 {
                    add(&mut sum, &ws.columns[b.dof], slope * b.weight * self.model.terms[*k].value);
                }
            }
            for (row, value) in sum.iter().enumerate() {
                jacobian[row * n + i] = *value;
            }
        }
        pose
    }

    /// What a basis changes with a joint's value itself, beside what it does through moments.
    #[inline]
    fn slope_by_joint(basis: &Basis, joint: usize, moment: Option<&Moment>, state: &State) -> f64 {
        let sign = match basis.of {
            Variable::Joint { joint: own } if own == joint => 1.0,
            Variable::Inclination { first, last } if (first..=last).contains(&joint) => 1.0,
            // what was not commanded does not lag
            Variable::Lag { joint: own } if own == joint && state.q_commanded.is_some() => -1.0,
            _ => 0.0,
        };
        let beside = basis.beside.filter(|b| b.joint == joint);
        if sign == 0.0 && beside.is_none() {
            return 0.0;
        }
        let (value, slope) = basis.shape.at(Self::variable(basis, moment, state, &NOTHING));
        let by_factor = beside.map_or(0.0, |b| {
            let alone = Basis { beside: None, ..*basis };
            value * Self::factor(&alone, state) * b.shape.at(state.q[joint - 1]).1
        });
        sign * slope * Self::factor(basis, state) + by_factor
    }

    /// Columns of all degrees of freedom, and the derivatives to the gravity moments, at the present pose.
    #[inline]
    fn all_columns(&self, state: &State, measured: &Measured, frame: usize, target: &Target, ws: &mut Workspace) {
        for (k, dof) in self.dofs.iter().enumerate() {
            ws.columns[k] = self.dof_column(*dof, measured, frame, target, ws);
        }
        if self.moments.is_empty() {
            return;
        }
        ws.elastic.fill([0.0; 6]);
        for (k, index) in &self.varying {
            let b = &self.bound[*index];
            let Some(m) = b.moment else { continue };
            let slope = b.basis.shape.at(ws.moments[m].value).1;
            let factor = self.model.terms[*k].value * b.weight * Self::factor(&b.basis, state) * slope;
            let column = ws.columns[b.dof];
            add(&mut ws.elastic[m], &column, factor);
        }
        self.sum_moments(ws);
    }

    /// What each joint's motions do through the moments of other joints, summed once for all of its motions.
    #[inline]
    fn sum_moments(&self, ws: &mut Workspace) {
        let n = self.chain.dof();
        for s in 0..=n {
            ws.through[s] = Through::default();
        }
        for (m, elastic) in ws.moments.iter().zip(&ws.elastic) {
            let (at, turn, carry) = (m.joint(), m.turn(), m.carry());
            // into the slots of the neighbours, to be carried on below; the base's slot is the last
            let before = if at == 0 { n } else { at - 1 };
            for k in 0..3 {
                add(&mut ws.through[before].turn[k], elastic, turn[k]);
                if at + 1 < n {
                    add(&mut ws.through[at + 1].carry[k], elastic, carry[k]);
                }
            }
        }
        for s in (0..n).rev() {
            let next = if s == 0 { n } else { s - 1 };
            let turn = ws.through[s].turn;
            for (to, from) in ws.through[next].turn.iter_mut().zip(&turn) {
                add(to, from, 1.0);
            }
        }
        for s in 1..n {
            let carry = ws.through[s - 1].carry;
            for (to, from) in ws.through[s].carry.iter_mut().zip(&carry) {
                add(to, from, 1.0);
            }
        }
    }

    /// The motion by which a term acts, if its column is what that motion does, times a number: where it acts by one motion alone, varies from
    /// pose to pose, and is no load.
    #[must_use]
    pub fn motion(&self, term: usize) -> Option<usize> {
        self.only_action(term).filter(|b| !b.constant && !self.dofs[b.dof].is_load()).map(|b| b.dof)
    }

    /// What a motion does at the measurement that was linearized last: derivatives of its residuals.
    #[must_use]
    pub fn does<'w>(&self, motion: usize, ws: &'w Workspace) -> &'w [f64; 6] {
        &ws.columns[motion]
    }

    /// The number by which the motion of a term that has one is multiplied there.
    #[inline]
    #[must_use]
    pub fn amount(&self, term: usize, ws: &Workspace) -> f64 {
        let index = self.spans[term].0;
        self.bound[index].weight * ws.says[index]
    }

    /// The column of any term there, free or not: derivatives of the residuals to its coefficient.
    #[inline]
    #[must_use]
    pub fn column(&self, term: usize, measured: &Measured, ws: &Workspace) -> [f64; 6] {
        let mut sum = [0.0; 6];
        let (from, to) = self.spans[term];
        for index in from..to {
            let b = &self.bound[index];
            let dof = self.dofs[b.dof];
            if b.constant && matches!((dof, measured), (Dof::Tool(_), Measured::Point { .. })) {
                continue; // targets have constant places of their own
            }
            let factor = if b.constant { b.weight } else { b.weight * ws.says[index] };
            add(&mut sum, &ws.columns[b.dof], factor);
            if !self.moments.is_empty() && factor != 0.0 && (b.constant || dof.is_load()) {
                self.add_through_moments(dof, ws, factor, &mut sum);
            }
        }
        sum
    }

    /// Adds what a motion of `dof` does through the gravity moments.
    #[inline]
    fn add_through_moments(&self, dof: Dof, ws: &Workspace, factor: f64, sum: &mut [f64; 6]) {
        let flange = &ws.still.flange;
        let each = |derivative: &dyn Fn(&Moment) -> f64, sum: &mut [f64; 6]| {
            for (m, elastic) in ws.moments.iter().zip(&ws.elastic) {
                add(sum, elastic, derivative(m) * factor);
            }
        };
        match dof {
            Dof::Chain(s, d) => {
                let twist = ws.still.twist(s, d);
                let through = &ws.through[s];
                let (turn, load) = (twist.angular() * -factor, twist.load(s, &ws.loads) * factor);
                for k in 0..3 {
                    add(sum, &through.turn[k], turn[k]);
                    add(sum, &through.carry[k], load[k]);
                }
                for (m, elastic) in ws.moments.iter().zip(&ws.elastic).filter(|(m, _)| m.joint() == s) {
                    add(sum, elastic, m.by_chain(s, d, &ws.still, &ws.loads) * factor);
                }
            }
            Dof::Base(k) => {
                let turn = ws.still.base_twist(k).angular() * -factor;
                let through = &ws.through[self.chain.dof()];
                for k in 0..3 {
                    add(sum, &through.turn[k], turn[k]);
                }
            }
            Dof::Gravity(k) => each(&|m| m.arm[k], sum),
            Dof::PayloadMass => {
                let place = flange.origin + flange.axes.times(&self.model.cell.tool.cog);
                each(&|m| m.by_mass(&place, &self.gravity), sum);
            }
            Dof::PayloadMoment(k) => each(&|m| m.by_first_moment(&flange.axes.times(&E[k])), sum),
            Dof::Tool(_)
            | Dof::Target(..)
            | Dof::Fixture(_)
            | Dof::Ball(..)
            | Dof::Frame(..)
            | Dof::Anchor(..)
            | Dof::LengthZero(_) => {}
        }
    }

    /// Derivative of the residual to a degree of freedom, without what it does through the gravity moments.
    #[inline]
    fn dof_column(&self, dof: Dof, measured: &Measured, frame: usize, target: &Target, ws: &Workspace) -> [f64; 6] {
        let zero = [0.0; 6];
        let flange = &ws.moved.flange;
        match dof {
            Dof::Chain(i, d) => {
                let twist = ws.moved.twist(i, d);
                target.map.apply(&twist.at(&target.point), &twist.angular())
            }
            Dof::Base(k) => {
                let twist = ws.moved.base_twist(k);
                target.map.apply(&twist.at(&target.point), &twist.angular())
            }
            Dof::Tool(k @ 0..3) => target.map.apply(&flange.axes.times(&E[k]), &V3::zeros()),
            Dof::Tool(k) => {
                let turns = self.tool_at(ws).1;
                let axis = flange.axes.times(&[turns.x, turns.y, turns.z][k - 3]);
                let arm = match measured {
                    // the reading turns with the device about its TCP
                    Measured::Touch { .. } => {
                        target.point - (flange.origin + flange.axes.times(&self.tcp_in_flange(ws)))
                    }
                    _ => V3::zeros(),
                };
                target.map.apply(&axis.cross(&arm), &axis)
            }
            Dof::Target(t, k) => match measured {
                Measured::Point { target: seen, .. } if *seen == t => {
                    target.map.apply(&flange.axes.times(&E[k]), &V3::zeros())
                }
                _ => zero,
            },
            Dof::Fixture(k) => match measured {
                Measured::Touch { ball, .. } => {
                    let (place, turns) = self.ball_at(*ball, ws);
                    let v = if k < 3 {
                        E[k]
                    } else {
                        [turns.x, turns.y, turns.z][k - 3].cross(&(place - shift(&ws.fixture)))
                    };
                    [-v.x, -v.y, -v.z, 0.0, 0.0, 0.0]
                }
                _ => zero,
            },
            Dof::Ball(b, k) => match measured {
                Measured::Touch { ball, .. } if *ball == b => {
                    let f = &ws.fixture;
                    let v = if f[3..] == [0.0; 3] { E[k] } else { crate::pose::rotation_zyx(f[5], f[4], f[3]) * E[k] };
                    [-v.x, -v.y, -v.z, 0.0, 0.0, 0.0]
                }
                _ => zero,
            },
            Dof::Frame(f, k) => {
                if f != frame {
                    return zero;
                }
                let (pose, turns) = self.frame_at(f, ws);
                if k < 3 {
                    return target.map.in_frame(&E[k], &V3::zeros());
                }
                let axis = [turns.x, turns.y, turns.z][k - 3];
                target.map.in_frame(&axis.cross(&(pose.rotation * target.point)), &axis)
            }
            Dof::Anchor(a, k) => match (measured, &target.map) {
                (Measured::Distance { anchor, .. }, Map::Length(u)) if *anchor == a => [-u[k], 0.0, 0.0, 0.0, 0.0, 0.0],
                _ => zero,
            },
            Dof::LengthZero(a) => match measured {
                Measured::Distance { anchor, .. } if *anchor == a => [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                _ => zero,
            },
            Dof::Gravity(_) | Dof::PayloadMass | Dof::PayloadMoment(_) => zero,
        }
    }
}

#[inline]
fn add(to: &mut [f64; 6], from: &[f64; 6], factor: f64) {
    for (t, f) in to.iter_mut().zip(from) {
        *t += f * factor;
    }
}
