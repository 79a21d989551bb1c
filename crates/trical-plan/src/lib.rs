//! Which touches to measure, and how to get there: cell geometry, collision checks, generation of configurations that the arm
//! can take without meeting anything, and the choice of the most informative ones.
//!
//! ```
//! use trical_model::{Cell, Robot, Task};
//! use trical_plan::{PlanOptions, plan_touches, write_plan};
//! # let robot_toml = include_str!("../../../cells/irb120/robot.toml");
//! # let cell_toml = include_str!("../../../cells/irb120/cell.toml");
//! let robot = Robot::parse(robot_toml, "robot.toml")?;
//! let cell = Cell::parse(cell_toml, "cell.toml")?;
//! let options = PlanOptions { per_ball: 12, pool_per_ball: 40, ..PlanOptions::default() };
//! let plan = plan_touches(&robot, &cell, &options, &Task::silent())?;
//! assert_eq!(plan.entries.len(), 36);
//! assert_eq!(plan.expected.parameters.len(), 31);
//! let text = write_plan(&robot, &plan.entries); // plan.csv
//! # assert!(text.starts_with("order,ball,q1_deg"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`plan`] | [`plan::plan_touches`]: everything in one function; the choice alone |
//! | [`options`], [`parameters`] | what a user can choose; what a plan is to make visible |
//! | [`geometry`], [`solid`] | the `[geometry]` of `cell.toml`; shapes and distances between them |
//! | [`collision`] | checks of configurations and of whole motions |
//! | [`generate`] | candidates at a ball, and why others were refused |
//! | [`candidates`] | blocks of Jacobian rows to choose from, and what they tell |
//! | [`choose`], [`criterion`] | the best subsets of any Jacobian blocks, by determinant, variances, weakest direction, region |
//! | [`discriminate`], [`next`] | subsets that tell rival explanations apart; touches that do |
//! | [`predict`] | position errors that a plan leaves to be expected |
//! | [`route`] | lengths of ways in joint space |
//! | [`plan_csv`] | plans as files |
//! | [`validation`] | configurations at which a calibrated arm proves itself |
//!
//! All random choices come from the seed in the options: same input, same seed, same plan, for any number of threads.

#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod candidates;
pub mod choose;
pub mod collision;
mod connect;
pub mod criterion;
pub mod discriminate;
pub mod error;
pub mod generate;
pub mod geometry;
mod joints;
pub mod next;
pub mod options;
pub mod parameters;
pub mod plan;
pub mod plan_csv;
pub mod predict;
mod random;
pub mod route;
pub mod solid;
pub mod validation;

pub use collision::{CollisionModel, MotionGuard, MotionWorkspace};
pub use criterion::{Criterion, Goal};
pub use discriminate::{Discrimination, choose_to_discriminate};
pub use error::PlanError;
pub use generate::{Candidate, Rejected};
pub use joints::usual_start;
pub use next::{Next, Question, plan_to_discriminate};
pub use options::PlanOptions;
pub use plan::{Chosen, Expected, Plan, PlanEntry, choose_touches, nominal_forward, plan_touches};
pub use plan_csv::{PlanFileError, read_plan, write_plan};
pub use predict::{PredictedError, Sphere};
pub use random::generator;
pub use validation::{Facing, ValidationOptions, poses_in_sphere, poses_in_workspace};
