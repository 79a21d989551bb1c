//! The measuring procedure: move so that all three stems touch, displace the TCP by the reading until it is small, store
//! the joints, go back the way it came (paper, Procedure, steps a to h).

mod error;
mod options;
mod run;
mod steps;
mod tcp;
mod visits;

use trical_model::recording::{Joints, Row};

pub use error::{ProcedureError, RetreatOutcome, Violation};
pub use options::{CorrectedJoints, MoveGuard, ProcedureLimits, ProcedureOptions, ReadingElsewhere, Retreat};
pub use run::run;
pub use steps::dry_run;
pub use tcp::{FlangeTouch, TcpError, TcpFit, base_from_balls, tcp_from_touches};
pub use visits::{stride, visits};

/// One touch of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanEntry {
    /// Number of the touch in the plan; it becomes `seq` of the measurement, and tells what is done when resuming.
    pub index: u64,
    /// Which ball, counted from 0.
    pub ball: usize,
    /// Joint values at the touch by the nominal model, rad.
    pub joints: Joints,
    /// Points on the way to the touch, rad. The last holds the device short of the ball, along its approach axis, with
    /// all stems free.
    pub via: Vec<Joints>,
}

impl PlanEntry {
    /// A touch with the points on the way to its approach, and the approach itself.
    #[must_use]
    pub fn new(index: u64, ball: usize, joints: Joints, way: &[Joints], approach: Joints) -> Self {
        let via = way.iter().copied().chain(std::iter::once(approach)).collect();
        Self { index, ball, joints, via }
    }
}

/// What the procedure tells while it runs.
#[derive(Clone, Debug, PartialEq)]
pub enum Progress {
    /// Something that the user should know.
    Warning(String),
    /// A touch begins.
    Begin {
        /// Number of the touch in the plan.
        index: u64,
        /// Which ball, counted from 0.
        ball: usize,
        /// Number of touches that are done, those of an earlier run included.
        done: usize,
        /// Number of touches in the plan.
        total: usize,
    },
    /// A settled reading.
    Reading {
        /// Number of the touch in the plan.
        index: u64,
        /// Corrections made before it.
        corrections: usize,
        /// The reading, m.
        reading: [f64; 3],
    },
    /// A measurement is accepted and safe.
    Measured {
        /// The measurement.
        row: Box<Row>,
        /// Corrections that it took.
        corrections: usize,
        /// Number of touches that are done, those of an earlier run included.
        done: usize,
        /// Number of touches in the plan.
        total: usize,
    },
}

/// What a run did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunReport {
    /// Touches measured in this run.
    pub measured: usize,
    /// Touches that an earlier run had done.
    pub skipped: usize,
    /// Corrections in all.
    pub corrections: usize,
    /// Warnings, in order.
    pub warnings: Vec<String>,
    /// Without `go`: the steps that would have been taken. Nothing has moved then.
    pub steps: Vec<String>,
}
