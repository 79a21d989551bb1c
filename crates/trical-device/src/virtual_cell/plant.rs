//! What the virtual cell asks of the arm behind it.

use trical_model::Pose;
use trical_model::recording::{Joints, MAX_JOINTS, State};

/// The physical arm and the balls behind a virtual cell.
///
/// The controller knows the nominal arm only; what the arm really does, it does in [`Plant::offset_to_ball`].
pub trait Plant: Send {
    /// Number of joints.
    fn joints(&self) -> usize;

    /// Which of them slide; where this is not said, none.
    fn slides(&self) -> [bool; MAX_JOINTS] {
        [false; MAX_JOINTS]
    }

    /// Number of balls.
    fn balls(&self) -> usize;

    /// Centre of a ball (0-based) relative to the true TCP, in the device's true axes, m.
    ///
    /// The state has the joint values that the controller reports, the sense of each joint's last motion, the time in s
    /// since the cell began, the temperature and the payload.
    fn offset_to_ball(&mut self, state: &State, ball: usize) -> [f64; 3];

    /// True tool in the world frame.
    fn tcp(&mut self, state: &State) -> Pose;

    /// Tool in the world frame where the controller believes it to be.
    fn nominal_tcp(&self, q: &Joints) -> Pose;

    /// Joint values near `seed` with which the controller believes to be at this pose; `None` where it cannot get there.
    fn nominal_inverse(&self, world_from_tool: &Pose, seed: &Joints) -> Option<Joints>;

    /// Temperature in degC at a time in s since the cell began, where the cell has a sensor.
    fn temperature(&mut self, _t: f64) -> Option<f64> {
        None
    }
}
