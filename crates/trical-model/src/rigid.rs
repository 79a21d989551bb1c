//! The rigid part of a model as an arm and a cell of its own: what can be handed to programs that know lengths and angles only.

use nalgebra::Vector3;

use crate::cell::Cell;
use crate::chain::{moved, shift, small_rotation};
use crate::error::Result;
use crate::forward::{Forward, Model};
use crate::recording::State;
use crate::robot::{JointKind, Robot};
use crate::term::{ChainDof, Dof, Site, Term, actions};
use crate::urdf::{Axes, robot_from_axes};

/// Arm and cell with the constant terms of a model built in, and the terms that this leaves out.
#[derive(Clone, Debug)]
pub struct Rigid {
    /// The calibrated arm. Its limits and masses are the nominal ones.
    pub robot: Robot,
    /// The calibrated cell: base, tool, targets, balls, anchors.
    pub cell: Cell,
    /// Terms that depend on the pose, on time or on temperature, or that turn gravity, or belong to an instrument: not in
    /// `robot` and `cell`.
    pub left_out: Vec<Term>,
    /// Whether the frames are those of the nominal arm's table, so that the two can be compared line by line. Not so where a
    /// term tilts an axis in a way that its own line of the table cannot hold.
    pub same_frames: bool,
}

impl Model {
    /// The rigid part of this model. Its flange and TCP poses are those of the model with all coefficients of varying terms
    /// set to zero, to rounding.
    ///
    /// # Errors
    /// A term at a site that the arm or the cell does not have.
    pub fn rigid(&self) -> Result<Rigid> {
        let (mut robot, mut cell) = (self.robot.clone(), self.cell.clone());
        let (mut base, mut tool, mut fixture) = ([0.0; 6], [0.0; 6], [0.0; 6]);
        let mut payload = (0.0, Vector3::zeros());
        let mut left_out = Vec::new();
        let mut same_frames = true;
        for term in &self.terms {
            if !term.basis.is_constant() {
                // where balls stood in one session is no property of an arm
                if !matches!(term.site, Site::Fixture(_) | Site::Ball { .. }) || !term.basis.is_local() {
                    left_out.push(term.clone());
                }
                continue;
            }
            let mut kept = true;
            for action in actions(term, &self.robot, &self.cell, self.frames.len())? {
                let v = term.value * action.weight;
                match action.dof {
                    Dof::Chain(i, dof) => {
                        let j = &mut robot.joints[i];
                        match dof {
                            ChainDof::Alpha => j.alpha += v,
                            ChainDof::A => j.a += v,
                            ChainDof::Beta => j.beta += v,
                            ChainDof::D => j.d += v,
                            ChainDof::Theta => j.theta_offset += v,
                            ChainDof::TiltX | ChainDof::TiltY => same_frames &= v == 0.0,
                        }
                    }
                    Dof::Base(k) => base[k] += v,
                    Dof::Tool(k) => tool[k] += v,
                    Dof::Target(t, k) => cell.tool.targets[t][k] += v,
                    Dof::Fixture(k) => fixture[k] += v,
                    Dof::Ball(b, k) => cell.balls[b][k] += v,
                    Dof::Anchor(a, k) => cell.anchors[a][k] += v,
                    Dof::PayloadMass => payload.0 += v,
                    Dof::PayloadMoment(k) => payload.1[k] += v,
                    Dof::Frame(..) | Dof::Gravity(_) | Dof::LengthZero(_) => kept = false,
                }
            }
            if !kept && !matches!(term.site, Site::Frame { .. }) {
                left_out.push(term.clone());
            }
        }
        let turn = |v: &[f64; 6]| small_rotation(v).1;
        cell.world_from_base = moved(&cell.world_from_base, &base).0;
        cell.tool.rotation = turn(&tool) * cell.tool.rotation;
        cell.tool.tcp += shift(&tool);
        for ball in &mut cell.balls {
            *ball = turn(&fixture) * *ball + shift(&fixture);
        }
        if payload.0 != 0.0 || payload.1 != Vector3::zeros() {
            let mass = cell.tool.mass + payload.0;
            let moment = cell.tool.cog * mass + payload.1;
            cell.tool.mass = mass;
            cell.tool.cog = if mass == 0.0 { cell.tool.cog } else { moment / mass };
        }
        if !same_frames {
            robot = self.without_tilts()?;
        }
        Ok(Rigid { robot, cell, left_out, same_frames })
    }

    /// The arm from its axes as they stand at zero, tilted ones too.
    fn without_tilts(&self) -> Result<Robot> {
        let mut still = Self { cell: Cell::bare(), frames: Vec::new(), ..self.clone() };
        let beside_arm = |site: &Site| {
            matches!(site, Site::Base(_) | Site::Tool(_) | Site::Target { .. } | Site::Payload(_))
                || matches!(site, Site::Fixture(_) | Site::Ball { .. } | Site::Frame { .. })
                || matches!(site, Site::Anchor { .. } | Site::LengthZero { .. })
        };
        still.terms.retain(|t| t.basis.is_constant() && !beside_arm(&t.site));
        let forward = Forward::new(still, Vec::new())?;
        let mut ws = forward.workspace();
        let n = self.robot.dof();
        let zero = State::at(&[0.0; crate::recording::MAX_JOINTS]);
        let mut jacobian = vec![0.0; 6 * n];
        let flange = forward.joint_jacobian(&zero, &mut ws, &mut jacobian);
        let links = forward.world_from_joints(&zero, &mut ws);
        let axes = self
            .robot
            .joints
            .iter()
            .zip(&links)
            .enumerate()
            .map(|(i, (joint, link))| {
                let part = |row: usize| Vector3::from_fn(|k, _| jacobian[(row + k) * n + i]);
                let (v, w) = (part(0), part(3));
                let (point, axis) = match joint.kind {
                    JointKind::Revolute => (flange.translation + w.cross(&v), w),
                    JointKind::Prismatic => (link.translation, v),
                };
                let cog = link.apply(&joint.cog);
                Axes { kind: joint.kind, point, axis, limits: joint.limits, mass: joint.mass, cog }
            })
            .collect::<Vec<_>>();
        Ok(robot_from_axes(&axes, &flange, &self.robot.name))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::axis::Axis;
    use crate::basis::Basis;
    use crate::cell::Cell;
    use crate::term::Payload;

    #[test]
    fn what_the_load_weighs_beside_its_place_moves_its_centre_of_gravity() {
        let robot = Robot::parse(include_str!("../tests/data/arm.toml"), "arm.toml").unwrap();
        let mut model = Model::nominal(robot, Cell::bare());
        (model.cell.tool.mass, model.cell.tool.cog) = (2.0, Vector3::new(0.0, 0.0, 0.1));
        for (what, value) in [(Payload::Mass, 0.5), (Payload::Moment(Axis::X), 0.2)] {
            let term = Term::new("load", "payload", Site::Payload(what), Basis::CONSTANT);
            model.terms.push(Term { value, ..term });
        }
        let tool = model.rigid().unwrap().cell.tool;
        assert!(
            (tool.mass - 2.5).abs() < 1e-15 && (tool.cog - Vector3::new(0.08, 0.0, 0.1)).norm() < 1e-15,
            "{tool:?}"
        );
        // of nothing that weighs anything there is no centre to move
        (model.cell.tool.mass, model.terms[0].value) = (0.0, 0.0);
        assert_eq!(model.rigid().unwrap().cell.tool.cog, model.cell.tool.cog);
    }
}
