//! Settings and limits of the procedure. Lengths in m, angles in rad, times in s.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use trical_model::recording::Joints;

use crate::controller::{JointSettle, StopCount};
use crate::gauge::Settle;

/// Says whether the arm may move from the first joint values to the second, in joint interpolation; one sentence why not.
/// On the way into and out of a touch the stems may meet its ball (counted from 0), elsewhere none.
pub type MoveGuard<'a> = &'a (dyn Fn(&Joints, &Joints, Option<usize>) -> Result<(), String> + 'a);

/// Where the nominal arm's joints would be after a displacement of the tool (m, in its axes); in one sentence, why it cannot go there.
pub type CorrectedJoints<'a> = &'a (dyn Fn(&Joints, [f64; 3]) -> Result<Joints, String> + 'a);

/// What a reading at the first joint values is at the second, where the ball stands still, by the nominal arm, m.
pub type ReadingElsewhere<'a> = &'a (dyn Fn(&Joints, [f64; 3], &Joints) -> [f64; 3] + 'a);

/// Limits of the procedure; whatever is beyond ends the run and makes the arm retreat.
#[derive(Clone, Debug, PartialEq)]
pub struct ProcedureLimits {
    /// Length of each correction.
    pub correction: f64,
    /// Sum of the lengths of a touch's corrections.
    pub total_correction: f64,
    /// Number of corrections of a touch.
    pub iterations: usize,
    /// Readings between which all stems touch, lower and upper; at the ends of the stroke they do not.
    pub stroke: [f64; 2],
    /// Joint limits, joint 1 first; joints without an entry have none here.
    pub joints: Vec<(f64, f64)>,
    /// A reading that is longer than the one before the correction by this factor diverges.
    pub growth: f64,
}

/// How far a joint may move by one correction.
pub(super) const JOINT_CHANGE: f64 = 5.0_f64.to_radians();
/// A channel that shows the very same value after a correction of more than this along it is stale.
pub(super) const STALE: f64 = 20e-6;
/// How far the TCP goes aside along each axis, and back, where a channel showed the same after a smaller correction:
/// it has to follow before the touch is accepted. Long enough for a gap in a joint of 0.01 deg at 0.5 m.
pub(super) const CONFIRM: f64 = 0.2e-3;
/// How far a reading may change otherwise than by the way from the stop before a touch, as a part of that way: axes of arm and device that are 3 deg
/// off make 0.05 of it, ripples of a gear (30 arcsec, 300 times a turn) 0.04, scale 0.01. Joints go on in the sense in which they came,
/// so that no gap in them counts.
pub(super) const CHANGE_OFF: f64 = 0.1;
/// And in the arm's repeatability: it has stood twice.
pub(super) const CHANGE_REPEATABILITY: f64 = 3.0;
/// How far the reading of a free stem may be from that at the first touch: a stem comes to rest at its own stop.
pub(super) const FREE_CHANGE: f64 = 0.2e-3;
/// Largest speed of the TCP that is asked for, m/s: that of manual mode.
pub(super) const FASTEST: f64 = 0.25;
/// Speed of rotation, rad/s.
pub(super) const ROTATION_SPEED: f64 = 20.0_f64.to_radians();

impl Default for ProcedureLimits {
    fn default() -> Self {
        Self {
            correction: 4e-3,
            total_correction: 8e-3,
            iterations: 10,
            stroke: [-5.9e-3, 5.9e-3],
            joints: Vec::new(),
            growth: 1.2,
        }
    }
}

/// How far the arm goes back after a touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Retreat {
    /// All the way to the first point of the entry: right for plans whose entries begin at one free place, and for
    /// taking up a run in the middle.
    Whole,
    /// To the point where the device is held short of the ball: right for plans whose next entry begins there. After an
    /// error or when stopped, the arm goes all the way all the same.
    Approach,
}

/// Settings of the procedure.
#[derive(Clone)]
pub struct ProcedureOptions<'a> {
    /// Nothing moves without this; the steps are listed instead.
    pub go: bool,
    /// A touch is accepted when the reading is shorter than this.
    pub epsilon: f64,
    /// Repeatability of the arm; an `epsilon` below it is warned about.
    pub repeatability: f64,
    /// When a reading stands still; `None` = what the gauge says of itself.
    pub settle: Option<Settle>,
    /// When the joints stand still; `None` = what the controller says of itself.
    pub joint_settle: Option<JointSettle>,
    /// Speed of the TCP between touches, m/s.
    pub travel_speed: f64,
    /// Speed of the TCP from the approach point to the touch and back, and of corrections, m/s.
    pub touch_speed: f64,
    /// Limits.
    pub limits: ProcedureLimits,
    /// How far the arm goes back after a touch.
    pub retreat: Retreat,
    /// TCP in the flange's frame, told to the controller before anything moves.
    pub tcp_in_flange: Option<[f64; 3]>,
    /// Touches that are done already.
    pub skip: BTreeSet<u64>,
    /// Touch `n` visits the place of touch `n` modulo this again, see [`super::visits`]; every other time from beyond.
    pub stride: Option<u64>,
    /// Joints at which places were found by an earlier run, by number.
    pub known: BTreeMap<u64, Joints>,
    /// How far before the touch the stems are read, or beyond it a visit from beyond comes from, as a part of the way from the approach point: 1 mm
    /// of 30, which the stems give and the clearance allows.
    pub beyond: f64,
    /// Temperature in degC, recorded with each measurement where the controller has no sensor.
    pub temp_c: Option<f64>,
    /// Mass added on the flange, kg, recorded with each measurement.
    pub payload_kg: Option<f64>,
    /// Time of the recording when this run begins, s.
    pub begin_t: f64,
    /// What the free stems read at the first touch of an earlier run, m: the gauge's zero has to be the same.
    pub free: Option<[f64; 3]>,
    /// Asked before every joint motion (the collision model), from where the controller says that the arm is.
    pub guard: Option<MoveGuard<'a>>,
    /// With this the guard is asked for corrections too, and turns of joints are known before they are made.
    pub corrected: Option<CorrectedJoints<'a>>,
    /// With this the readings before and at a touch are compared.
    pub elsewhere: Option<ReadingElsewhere<'a>>,
    /// Told when the arm is led back although the user has asked for the end.
    pub stops: Option<StopCount>,
}

impl Default for ProcedureOptions<'_> {
    fn default() -> Self {
        Self {
            go: false,
            epsilon: 20e-6,
            repeatability: 10e-6,
            settle: None,
            joint_settle: None,
            travel_speed: 0.1,
            touch_speed: 0.01,
            limits: ProcedureLimits::default(),
            retreat: Retreat::Whole,
            tcp_in_flange: None,
            skip: BTreeSet::new(),
            stride: None,
            known: BTreeMap::new(),
            beyond: 1.0 / 30.0,
            temp_c: None,
            payload_kg: None,
            begin_t: 0.0,
            free: None,
            guard: None,
            corrected: None,
            elsewhere: None,
            stops: None,
        }
    }
}

impl fmt::Debug for ProcedureOptions<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ProcedureOptions")
            .field("go", &self.go)
            .field("epsilon", &self.epsilon)
            .field("limits", &self.limits)
            .field("retreat", &self.retreat)
            .field("skip", &self.skip)
            .field("guard", &self.guard.is_some())
            .finish_non_exhaustive()
    }
}
