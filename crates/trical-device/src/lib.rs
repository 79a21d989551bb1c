//! Gauges, robot controllers, the measuring procedure and its recording; and a virtual cell that stands in for the
//! hardware on a real pseudo-terminal and a real socket.
//!
//! Everything inside is SI (m, rad, s); mm and degrees appear on the wire and in files only, where names carry them.
//!
//! ```no_run
//! use std::sync::atomic::AtomicBool;
//! use trical_device::{PlanEntry, ProcedureOptions, open_controller, open_gauge, run};
//! use trical_recording::RecordingWriter;
//! use trical_recording::mcap::Header;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut gauge = open_gauge("uwave:///dev/ttyUSB0?x=00&y=01&z=02")?;
//! let mut controller = open_controller("rapid://192.168.125.1:5000")?;
//! let mut log = RecordingWriter::create("run.mcap".as_ref(), &Header::default())?;
//! let plan: Vec<PlanEntry> = Vec::new();
//! let options = ProcedureOptions { go: true, ..ProcedureOptions::default() };
//! let cancel = AtomicBool::new(false);
//! run(&plan, (gauge.as_mut(), controller.as_mut()), &mut log, &options, &cancel, &mut |_| ())?;
//! log.finish()?;
//! # Ok(())
//! # }
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`gauge`] | the [`Gauge`] trait, U-WAVE-R and line gauges, [`open_gauge`] |
//! | [`controller`] | the [`Controller`] trait, the RAPID dialect, Robot Web Services, [`open_controller`] |
//! | [`joint_feed`] | joints from a file that grows: a topic that is echoed, a CSV |
//! | [`procedure`] | the touches: plan entries, limits, the loop, repeat visits, tool centre point from one ball |
//! | [`session`] | a plan driven over URLs into a recording that can be taken up; touches where the arm stands |
//! | [`virtual_cell`] | the arm, balls and indicators that answer on a pseudo-terminal and a TCP port, and fail by a script |
//! | [`url`] | the small URL grammar of `--gauge` and `--controller` |

#![allow(clippy::disallowed_methods, reason = "a simulated cell, not what is calculated from measurements")]

mod connection;
pub mod controller;
pub mod gauge;
pub mod joint_feed;
pub mod procedure;
pub mod session;
pub mod url;
pub mod virtual_cell;

pub use controller::{Controller, ControllerError, open_controller};
pub use gauge::{Gauge, GaugeError, open_gauge};
pub use procedure::{
    PlanEntry, ProcedureError, ProcedureLimits, ProcedureOptions, Progress, RunReport, dry_run, run, visits,
};
pub use session::{Session, SessionError};
pub use virtual_cell::{ArmPlant, CellError, CellOptions, Fault, Plant, VirtualCell};
