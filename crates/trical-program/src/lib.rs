//! Robot programs rewritten so that the real arm goes where they say.
//!
//! A program is bytes. A reader for each dialect finds the targets in them, the tools and frames that they are meant with,
//! and the order in which the arm visits them ([`scan`]); [`compensation`] turns each target into the one that brings the
//! real arm to the same place; only the bytes of changed numbers are replaced, block by block, straight into the output.
//!
//! ```
//! use trical_program::{Dialect, Frames, Options, Program, compensate};
//! use trical_model::{Cell, Model, Robot};
//! # let robot = Robot::parse(include_str!("../../../cells/irb120/robot.toml"), "robot.toml")?;
//! # let cell = Cell::parse(include_str!("../../../cells/irb120/cell.toml"), "cell.toml")?;
//! let nominal = Model::nominal(robot, cell);
//! let model = nominal.clone(); // of a model file, else
//! let text = b"x_mm,y_mm,z_mm,qw,qx,qy,qz\r\n350,50,320,0,0.6,0.8,0\r\n";
//! let mut out = Vec::new();
//! let program = Program::of_file(text, "p.csv", Dialect::Csv, &mut out);
//! let done = compensate(program, &nominal, &model, &Frames::default(), &Options::default())?;
//! assert_eq!(done.rewritten, 1);
//! assert!(out.ends_with(text)); // behind the mark; a model that is the nominal arm changes nothing
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`dialects`] | the table of dialects, and a reader for each |
//! | [`scan`], [`names`], [`scopes`] | what they find; names followed to targets; names that routines have for themselves |
//! | [`packed`] | where targets stand in the text, in few bytes |
//! | [`literal`] | numbers as poses and joint values, both ways |
//! | [`text`], [`expression`] | bytes, numbers, lines; constant expressions |
//! | [`flow`] | which of them routines, branches and loops leave |
//! | [`reaching`] | which definitions of a name a motion may meet |
//! | [`other_use`] | targets whose numbers the program uses otherwise, too |
//! | [`elsewhere`], [`modules`] | what other files of the program have |
//! | [`frames`] | tools and work objects, and files that give them |
//! | [`branch`] | configurations |
//! | [`compensation`] | targets to targets |
//! | [`rewriting`] | a program in memory, with a [`report`] |
//! | [`mod@file`], `folders` | the same from file to file; the files beside a program |

#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod branch;
pub mod compensation;
pub mod dialects;
pub mod elsewhere;
pub mod error;
pub mod expression;
pub mod file;
pub mod flow;
mod folders;
pub mod frames;
pub mod literal;
pub mod modules;
pub mod names;
pub mod options;
pub mod other_use;
pub mod packed;
pub mod reaching;
pub mod report;
pub mod rewriting;
pub mod scan;
pub mod scopes;
pub mod text;

pub use dialects::{Dialect, MARK};
pub use error::ProgramError;
pub use file::{Job, declared_frames, load_frames, refuse_left_out};
pub use frames::{Frame, Frames};
pub use options::{Options, Spelling};
pub use report::{Problem, Report, TargetRow};
pub use rewriting::{Program, compensate};
