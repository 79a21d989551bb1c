//! Figures as SVG, and one that a script turns.
//!
//! | module | holds |
//! |---|---|
//! | [`plots`] | curves, histograms, spectra |
//! | [`picture`], [`outline`] | the cell with arm, poses and marks |
//! | [`arm_map`] | where on the arm findings are |
//! | [`turning_scene`] | the cell as data for the script that turns it |

pub mod arm_map;
pub mod outline;
pub mod picture;
pub mod plots;
pub mod turning_scene;
