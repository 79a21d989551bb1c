//! What the device would read at a ball.

use nalgebra::Vector3;

use crate::forward::{Forward, Workspace};
use crate::recording::{Measured, State};

/// The reading at which a touch agrees with the model: the ball's centre relative to the TCP, in the device's axes, m. Effects
/// of the indicators depend on the reading, so a few rounds are needed; one without them.
pub fn reading_at(forward: &Forward, state: &State, ball: usize, ws: &mut Workspace) -> [f64; 3] {
    let tool = forward.world_from_tool(state, ws).rotation;
    let mut reading = Vector3::zeros();
    for _ in 0..8 {
        forward.residual(state, &Measured::Touch { ball, reading: reading.into() }, 0, ws);
        let r = ws.residual();
        let left = tool.transpose() * Vector3::new(r[0], r[1], r[2]);
        reading -= left;
        if left.norm() < 1e-10 {
            break;
        }
    }
    reading.into()
}
