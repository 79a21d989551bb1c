//! Planning: reachable, collision-free touches, and the informative ones among them.
//!
//! | module | holds |
//! |---|---|
//! | [`scene`] | the cell as simple solids, checked by parry |
//! | [`touches`] | candidates, choice and order of the touches |
//! | [`choice`] | the subset that tells most about the parameters |

pub mod choice;
pub mod scene;
pub mod touches;

pub use scene::Scene;
pub use touches::{Plan, PlanError, PlanOptions, Touch, free_poses, plan_touches};
