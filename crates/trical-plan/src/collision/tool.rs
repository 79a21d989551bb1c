//! What the pose of the tool alone says, whatever the joints are.

use trical_model::{Joint, JointKind, Joints, MAX_JOINTS, Pose, State};

use super::pairs::slide;
use super::{CollisionModel, Contact, MotionWorkspace};

/// How much nearer than the margin bodies have to be, and how much farther than the links are long the tool, m: planned joints are rounded, and
/// distances are found to within some 50 um.
const SURE: f64 = 1e-4;

impl CollisionModel {
    /// Whether the tool is farther away at this pose than the links are long.
    pub(crate) fn is_too_far(&self, world_from_tool: &Pose, scratch: &mut MotionWorkspace) -> bool {
        let robot = &self.forward.model().robot;
        let [first, between @ .., last] = robot.joints.as_slice() else { return false };
        self.place_last(world_from_tool, scratch);
        let [_, one, .., flange] = scratch.links.as_slice() else { return false };
        let end = flange.compose(&robot.last_from_flange.inverse());
        let turns = |joint: &Joint| joint.kind == JointKind::Revolute;
        // the last joint turns about a line that the tool's pose gives: from there on the arm is as it is
        let (behind, length) =
            if turns(last) { (last.d, last.a.abs()) } else { (0.0, libm::hypot(last.a, slide(last))) };
        let before_last = end.translation - end.rotation.column(2) * behind;
        let travel = if turns(first) { 0.0 } else { first.limits[0].abs().max(first.limits[1].abs()) };
        let links: f64 = between.iter().map(|joint| libm::hypot(joint.a, slide(joint))).sum();
        (before_last - one.translation).norm() > travel + links + length + SURE
    }

    /// Two bodies, one of the last link or the device and one that stands still, that meet with the tool at this pose while ball `touched` is touched.
    pub(crate) fn check_tool(
        &self,
        world_from_tool: &Pose,
        touched: Option<usize>,
        scratch: &mut MotionWorkspace,
    ) -> Option<Contact> {
        self.place_last(world_from_tool, scratch);
        let is_known = |frame: usize| frame == 0 || frame > self.joints;
        let known =
            self.pairs.iter().filter(|p| self.parts[p.a].frame == self.joints && is_known(self.parts[p.b].frame));
        let mut open = known.filter(|p| !p.allowed(touched));
        open.find(|p| self.closer_than(p, &scratch.links, self.margin - SURE)).map(|p| self.contact(p))
    }

    /// The last link where the tool's pose has it; of the others only the base, and the origin of the first, are where they are.
    fn place_last(&self, world_from_tool: &Pose, scratch: &mut MotionWorkspace) {
        let MotionWorkspace { ws, links, .. } = scratch;
        let zero: Joints = [0.0; MAX_JOINTS];
        self.place(&zero, ws, links);
        let tool_at_zero = self.forward.world_from_tool(&State::at(&zero), ws);
        if let Some(last) = links.last_mut() {
            *last = world_from_tool.compose(&tool_at_zero.inverse().compose(last));
        }
    }
}
