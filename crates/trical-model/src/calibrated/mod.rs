//! A calibrated arm in the files of others: a given URDF with its origins corrected, the kinematics of Universal Robots.

mod correct;
mod ur;

pub use correct::{corrected, corrected_file};
pub use ur::{calibrated_by_maker, ur_kinematics, wrist_from_flange};
