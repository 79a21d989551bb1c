//! From targets to targets: the pose that the program wants, the joints that the full model needs for it, and the pose by
//! which the controller, which knows the nominal arm only, is brought to those joints.

mod arms;
mod nominal_joints;
mod rewrite;
mod unnamed;

pub use arms::Compensator;
pub(crate) use arms::{by_measured_torque, eventful};
pub use nominal_joints::{MOST_RELATIVE, Shifted, Start, Walked};
pub use rewrite::Done;
pub use unnamed::settle_unnamed;
