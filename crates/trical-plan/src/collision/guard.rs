//! What a measuring run asks before each motion.

use trical_model::{Cell, Joints, Robot};

use super::{CollisionModel, MotionWorkspace};
use crate::error::Result;

/// What every motion keeps from everything, m: plans keep the cell's own clearance, and the arm has been corrected away from
/// where it was planned.
const CLEARANCE: f64 = 2e-3;

/// Says whether a motion is free of collisions.
#[derive(Clone, Debug)]
pub struct MotionGuard(CollisionModel);

impl MotionGuard {
    /// For an arm in its cell.
    ///
    /// # Errors
    /// What is wrong with the `[geometry]` of the cell.
    pub fn new(robot: &Robot, cell: &Cell) -> Result<Self> {
        Ok(Self(CollisionModel::new(robot, cell)?.with_margin(CLEARANCE)))
    }

    /// The straight way in joint space; a stem may meet a ball only on the way into the touch of that ball (counted from 0).
    ///
    /// # Errors
    /// One sentence that names the two bodies that come too close.
    pub fn check(&self, from: &Joints, to: &Joints, touched: Option<usize>) -> std::result::Result<(), String> {
        let hit = self.0.check_motion(from, to, touched, &mut MotionWorkspace::new(&self.0));
        hit.map_or(Ok(()), |hit| {
            let (a, b) = self.0.names(hit);
            Err(format!("'{a}' would come within {:.0} mm of '{b}'", CLEARANCE * 1e3))
        })
    }
}
