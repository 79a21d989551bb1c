//! A touch where the arm stands, and what such touches say of tool and base.

use nalgebra::Vector3;
use thiserror::Error;
use trical_model::pose::rotation_vector;
use trical_model::recording::Row;
use trical_model::{Cell, Forward, Joints, Measured, Model, ModelError, Pose, Robot, State};

use super::{Session, SessionError};
use crate::controller::wait_settled;
use crate::gauge::open_gauge;
use crate::procedure::{
    FlangeTouch, PlanEntry, ProcedureError, Progress, TcpError, TcpFit, base_from_balls, run, tcp_from_touches,
};
use trical_recording::mcap::RecordingWriter;

/// Balls cannot be farther from where they should be than an arm is off, m.
const TOO_FAR: f64 = 5e-3;

/// Why touches say nothing of tool or base.
#[derive(Debug, Error)]
pub enum SetUpError {
    /// The arm or the cell is at fault.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The touches do not say it.
    #[error(transparent)]
    Tcp(#[from] TcpError),
    /// The touches are not of one ball.
    #[error(
        "the touches agree to {rms_mm:.1} mm only, more than an arm can be off: was each of them at the same ball, with all stems on it?"
    )]
    OtherBall {
        /// Root mean square of the distances left, mm.
        rms_mm: f64,
    },
    /// The cell has too few balls.
    #[error("the cell has {0} balls, expected three or more for the world frame")]
    TooFewBalls(usize),
    /// The balls are not where they should be.
    #[error(
        "balls {a} and {b} are {found_mm:.2} mm apart by the touches and {expected_mm:.2} mm by the cell, more than an arm can be off: was each touch at the ball that was asked for?"
    )]
    OtherBalls {
        /// A ball, counted from 1.
        a: usize,
        /// Another one.
        b: usize,
        /// How far they are apart by the touches, mm.
        found_mm: f64,
        /// How far by the cell, mm.
        expected_mm: f64,
    },
}

impl Session<'_> {
    /// The touch where the arm stands: nulled and recorded; then the arm goes back to where it stood. The plan does not count.
    ///
    /// # Errors
    /// See [`SessionError`].
    pub fn touch_here(
        &self,
        log: &mut RecordingWriter,
        ball: usize,
        index: u64,
        watch: &mut dyn FnMut(Progress),
    ) -> Result<Row, SessionError> {
        let mut gauge = open_gauge(self.gauge).map_err(SessionError::Gauge)?;
        let mut controller = self.open_controller()?;
        let settle = controller.joint_settle();
        let at = wait_settled(controller.as_mut(), &settle, self.cancel).map_err(SessionError::Controller)?;
        let entry = PlanEntry { index, ball, joints: at, via: Vec::new() };
        let mut options = self.options();
        options.go = true;
        options.begin_t = self.goes_on_at(log, watch);
        let corrected = self.corrected()?;
        options.corrected = Some(&corrected);
        let mut found = None;
        let mut note = |p: Progress| {
            if let Progress::Measured { row, .. } = &p {
                found = Some(**row);
            }
            watch(p);
        };
        run(&[entry], (gauge.as_mut(), controller.as_mut()), log, &options, self.cancel, &mut note)
            .map_err(SessionError::Run)?;
        found.ok_or_else(|| SessionError::Run(ProcedureError::Options("no touch was recorded".to_owned())))
    }
}

/// The flange in the arm's own base, by the nominal arm.
fn base_from_flange(robot: &Robot, cell: &Cell, q: &Joints) -> Result<Pose, ModelError> {
    let cell = Cell { world_from_base: Pose::identity(), ..cell.clone() };
    let forward = Forward::new(Model::nominal(robot.clone(), cell), Vec::new())?;
    let mut ws = forward.workspace();
    Ok(forward.world_from_flange(&State::at(q), &mut ws))
}

/// The tool point by touches of one ball in four or more orientations, by the nominal arm.
///
/// # Errors
/// Too few touches, orientations that do not differ enough, or touches of different balls.
pub fn tool_point(robot: &Robot, cell: &Cell, rows: &[Row]) -> Result<TcpFit, SetUpError> {
    let mut touches = Vec::new();
    for row in rows {
        let Measured::Touch { reading, .. } = row.measured else { continue };
        let base_from_flange = base_from_flange(robot, cell, &row.state.q)?;
        touches.push(FlangeTouch { base_from_flange, reading: cell.tool.rotation * Vector3::from(reading) });
    }
    let fit = tcp_from_touches(&touches)?;
    if fit.rms > TOO_FAR {
        return Err(SetUpError::OtherBall { rms_mm: fit.rms * 1e3 });
    }
    Ok(fit)
}

/// By how much the flange is turned from one touch to another, rad, by the nominal arm.
///
/// # Errors
/// An arm or a cell that makes no sense.
pub fn turned(robot: &Robot, cell: &Cell, a: &Row, b: &Row) -> Result<f64, SetUpError> {
    let [a, b] = [a, b].map(|row| base_from_flange(robot, cell, &row.state.q));
    Ok(rotation_vector(&(a?.rotation.transpose() * b?.rotation)).norm())
}

/// The base by one touch of each of balls 1, 2 and 3.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseFit {
    /// Where the arm stands.
    pub world_from_base: Pose,
    /// Pairs of balls counted from 1, how far they are apart by the touches and by the cell, m.
    pub distances: [(usize, usize, f64, f64); 3],
}

impl BaseFit {
    /// Refuses distances that no arm is off by.
    ///
    /// # Errors
    /// [`SetUpError::OtherBalls`].
    pub fn check(&self) -> Result<(), SetUpError> {
        let worst = self.distances.iter().max_by(|x, y| (x.2 - x.3).abs().total_cmp(&(y.2 - y.3).abs()));
        match worst {
            Some((a, b, found, expected)) if (found - expected).abs() > TOO_FAR => {
                Err(SetUpError::OtherBalls { a: *a, b: *b, found_mm: found * 1e3, expected_mm: expected * 1e3 })
            }
            _ => Ok(()),
        }
    }
}

/// Where the arm stands, by one touch of each of balls 1, 2 and 3 in this order, by the nominal arm.
///
/// # Errors
/// A cell with fewer balls, or balls on a line.
pub fn base(robot: &Robot, cell: &Cell, rows: [&Row; 3]) -> Result<BaseFit, SetUpError> {
    if cell.balls.len() < 3 {
        return Err(SetUpError::TooFewBalls(cell.balls.len()));
    }
    let mut balls = [Vector3::zeros(); 3];
    for (to, row) in balls.iter_mut().zip(rows) {
        let Measured::Touch { reading, .. } = row.measured else { continue };
        let at = base_from_flange(robot, cell, &row.state.q)?;
        let centre = cell.tool.tcp + cell.tool.rotation * Vector3::from(reading);
        *to = at.apply(&centre);
    }
    let known: [Vector3<f64>; 3] = std::array::from_fn(|k| cell.balls[k]);
    let length = |p: &[Vector3<f64>; 3], a: usize, b: usize| (p[a] - p[b]).norm();
    let distances = [(0, 1), (0, 2), (1, 2)].map(|(a, b)| (a + 1, b + 1, length(&balls, a, b), length(&known, a, b)));
    let (measured, file) = (base_from_balls(&balls)?, base_from_balls(&known)?);
    Ok(BaseFit { world_from_base: file.compose(&measured.inverse()), distances })
}
