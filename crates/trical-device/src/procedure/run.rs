//! The loop that drives gauge and robot.

mod corrections;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use trical_model::recording::{Joints, Measured, Row, State};

use super::options::{CHANGE_OFF, CHANGE_REPEATABILITY, CONFIRM, FREE_CHANGE, JOINT_CHANGE, ROTATION_SPEED};
use super::steps::{check_finite, check_joints, check_plan, check_standing};
use super::{
    PlanEntry, ProcedureError, ProcedureOptions, Progress, Retreat, RetreatOutcome, RunReport, Violation, dry_run,
};
use crate::controller::{ARRIVAL, Controller, ControllerError, largest_difference, wait_settled};
use crate::gauge::{AXES, Gauge, settled_reading};
use trical_recording::mcap::RunLog;
use trical_recording::motion::{JointSample, MotionSense};

/// Readings of the joints of an arm that stands, by which its noise is known.
const NOISE_READINGS: usize = 20;
/// The sense of a motion is told where it is longer than so many times the spread of those readings: over a whole run noise reaches farther.
const NOISE_FACTOR: f64 = 3.0;
/// Readings that are farther apart are those of an arm that moves, rad.
const MOST_NOISE: f64 = 0.01_f64.to_radians();
/// Temperatures that a sensor beside an arm can show, degC.
const TEMPERATURES: std::ops::RangeInclusive<f64> = -100.0..=200.0;

/// Times of a controller that stand in another order than they were asked for, s: no jump yet.
const CLOCK_SLACK_S: f64 = 1.0;
/// A clock that goes on by more than an hour from one step to the next, and by more than so many times what this computer's clock does, has
/// jumped.
const LONGEST_STEP_S: f64 = 3600.0;
const LONGEST_STEP: f64 = 10.0;
/// A clock that shows the same for so long stands still, s.
const STANDING_CLOCK_S: f64 = 10.0;
/// So many jumps are told.
const TOLD_JUMPS: usize = 3;

/// Drives through a plan; every accepted touch is in the log before the arm leaves it, but for the last one: it is accepted once the stems are
/// free again and read as before.
///
/// Without [`ProcedureOptions::go`] nothing moves, and the report lists the steps. `cancel` is looked at between steps;
/// it ends the run like an error does: the arm stops, goes back the way it came, and the error says so.
///
/// # Errors
/// A plan or settings that make no sense, before anything moves; or the first violation of a limit, or failure of a
/// device.
pub fn run(
    plan: &[PlanEntry],
    (gauge, controller): (&mut dyn Gauge, &mut dyn Controller),
    log: &mut dyn RunLog,
    options: &ProcedureOptions<'_>,
    cancel: &AtomicBool,
    progress: &mut dyn FnMut(Progress),
) -> Result<RunReport, ProcedureError> {
    check_plan(plan, options)?;
    if !options.go {
        let steps = dry_run(plan, options, controller.joint_count());
        return Ok(RunReport { steps, ..RunReport::default() });
    }
    let mut runner = Runner {
        gauge,
        controller,
        log,
        options,
        cancel,
        progress,
        motion: MotionSense::default(),
        clock_offset: 0.0,
        clock_shown: (f64::NAN, Instant::now()),
        clock_jumps: 0,
        clock_stands: false,
        t: options.begin_t,
        at: [0.0; trical_model::recording::MAX_JOINTS],
        trail: Vec::new(),
        report: RunReport::default(),
        known: options.known.clone(),
        corrections: 0,
        corrected: 0.0,
        touching: None,
        retreating: false,
        free: options.free,
        coarse: false,
        no_temperature: false,
    };
    let not_begun = |violation| ProcedureError::Start { violation: Box::new(violation) };
    runner.start().map_err(not_begun)?;
    if plan.iter().any(|entry| !options.skip.contains(&entry.index)) {
        runner.leave_a_touch(plan).map_err(|violation| ProcedureError::Leave { violation: Box::new(violation) })?;
    }
    let total = plan.len();
    let last = plan.iter().rposition(|entry| !options.skip.contains(&entry.index));
    for (number, entry) in plan.iter().enumerate() {
        let done = runner.report.measured + runner.report.skipped;
        if options.skip.contains(&entry.index) {
            runner.report.skipped += 1;
            continue;
        }
        (runner.progress)(Progress::Begin { index: entry.index, ball: entry.ball, done, total });
        runner.trail = vec![runner.at];
        let led_in = runner.led_in(plan, number);
        let result = match runner.touch(led_in.as_ref().unwrap_or(entry)) {
            Ok(row) if Some(number) == last => runner.end(entry, row, total),
            Ok(row) => match runner.accept(row, total) {
                Ok(()) => runner.leave().map_err(|violation| (violation, RetreatOutcome::Interrupted)),
                Err(violation) => Err((violation, runner.retreat())),
            },
            // whoever moves the arm by hand has it
            Err(violation @ Violation::Stopped) => Err((violation, RetreatOutcome::Stopped)),
            Err(
                violation @ (Violation::Elsewhere { .. }
                | Violation::Controller(
                    ControllerError::StopNotConfirmed { .. }
                    | ControllerError::OtherProgram { .. }
                    | ControllerError::SafetyStop { .. },
                )),
            ) => Err((violation, RetreatOutcome::LeftAlone)),
            Err(violation) => Err((violation, runner.retreat())),
        };
        if let Err((violation, retreat)) = result {
            return Err(ProcedureError::Touch {
                index: entry.index,
                ball: entry.ball,
                violation: Box::new(violation),
                retreat,
            });
        }
    }
    Ok(runner.report)
}

struct Runner<'a, 'o> {
    gauge: &'a mut dyn Gauge,
    controller: &'a mut dyn Controller,
    log: &'a mut dyn RunLog,
    options: &'a ProcedureOptions<'o>,
    cancel: &'a AtomicBool,
    progress: &'a mut dyn FnMut(Progress),
    motion: MotionSense,
    /// What is added to the controller's clock to get the recording's time.
    clock_offset: f64,
    /// What that clock showed when it last changed, and when that was.
    clock_shown: (f64, Instant),
    /// How often it has jumped, and whether it stood still.
    clock_jumps: usize,
    clock_stands: bool,
    /// The last time of the recording, s.
    t: f64,
    /// Where the arm stands.
    at: Joints,
    /// Where the arm has been since the entry began, in order; the way back.
    trail: Vec<Joints>,
    report: RunReport,
    /// Joints at the touches of the first round.
    known: BTreeMap<u64, Joints>,
    /// Corrections of this touch, and the sum of their lengths, m.
    corrections: usize,
    corrected: f64,
    /// The ball that the stems may meet: from the way into its touch until the arm is back at the approach point.
    touching: Option<usize>,
    /// After a failure nothing but the arm matters.
    retreating: bool,
    /// What the free stems read at the first touch, m.
    free: Option<[f64; 3]>,
    /// Whether it was told that joints come with few decimals.
    coarse: bool,
    /// Whether it was told that the controller's temperature is none.
    no_temperature: bool,
}

impl Runner<'_, '_> {
    fn start(&mut self) -> Result<(), Violation> {
        let options = self.options;
        if options.epsilon < options.repeatability {
            self.warn(format!(
                "the tolerance of a touch, {:.4} mm, is below the arm's repeatability, {:.4} mm: touches may not converge",
                options.epsilon * 1e3,
                options.repeatability * 1e3
            ));
        }
        self.controller.ping()?;
        self.clock_offset = options.begin_t - self.controller.clock()?;
        if let Some(tcp) = options.tcp_in_flange {
            self.controller.set_tool(tcp)?;
        }
        let at = self.controller.joints()?;
        check_finite(&at)?;
        // another unit, a turn more, another order: nothing that follows would be checked from where the arm is
        check_standing(&at, options)?;
        self.at = at;
        self.look_at_noise()?;
        self.gauge.read()?;
        self.take_warnings();
        self.note_joints()
    }

    /// How much the joints of the arm differ from reading to reading while it stands: so much is no motion, and does not change the recorded sense of
    /// a joint's last one.
    fn look_at_noise(&mut self) -> Result<(), Violation> {
        let (mut low, mut high) = (self.at, self.at);
        for _ in 0..NOISE_READINGS {
            for (k, q) in self.controller.joints()?.into_iter().enumerate() {
                (low[k], high[k]) = (low[k].min(q), high[k].max(q));
            }
        }
        let noise = (NOISE_FACTOR * largest_difference(&low, &high).1).min(MOST_NOISE);
        self.motion = MotionSense::new(noise.max(MotionSense::DEAD_BAND));
        Ok(())
    }

    /// Where an earlier run was broken off in a touch, the arm still stands there: it goes back to the point before.
    fn leave_a_touch(&mut self, plan: &[PlanEntry]) -> Result<(), Violation> {
        let far = |q: &Joints| largest_difference(q, &self.at).1;
        let nearest = plan.iter().min_by(|a, b| far(&a.joints).total_cmp(&far(&b.joints)));
        let Some((entry, before)) = nearest.and_then(|entry| Some((entry, entry.via.last()?))) else { return Ok(()) };
        let to_a_free_place = plan.iter().flat_map(|entry| &entry.via).map(&far).fold(f64::INFINITY, f64::min);
        if far(&entry.joints) > JOINT_CHANGE || to_a_free_place <= far(&entry.joints) {
            return Ok(());
        }
        self.warn(format!(
            "the arm stands at touch {} (ball {}), where an earlier run was broken off: it goes back to its approach point first",
            entry.index + 1,
            entry.ball + 1
        ));
        check_joints(before, self.options)?;
        self.controller.set_speed(self.options.touch_speed, ROTATION_SPEED)?;
        self.touching = Some(entry.ball);
        self.drive(before)?;
        self.touching = None;
        Ok(())
    }

    /// The entry with a way to it from where the arm stands, where the straight one is not allowed: along the plan's own
    /// ways, forward or backward, from the nearest of its points that can be reached. `None` = as it is.
    fn led_in(&self, plan: &[PlanEntry], number: usize) -> Option<PlanEntry> {
        let options = self.options;
        let entry = plan.get(number)?;
        let first = entry.via.first()?;
        if options.retreat != Retreat::Approach || options.allow(&self.at, first, None).is_ok() {
            return None;
        }
        // free points in the order of the plan: each can be reached from its neighbours
        let ways: Vec<Joints> = plan.iter().flat_map(|entry| entry.via.iter().copied()).collect();
        let target = plan.iter().take(number).map(|entry| entry.via.len()).sum::<usize>();
        let mut near: Vec<usize> = (0..ways.len()).collect();
        let far = |at: &usize| ways.get(*at).map_or(f64::INFINITY, |q| largest_difference(q, &self.at).1);
        near.sort_by(|a, b| far(a).total_cmp(&far(b)));
        let from =
            near.into_iter().find(|at| ways.get(*at).is_some_and(|q| options.allow(&self.at, q, None).is_ok()))?;
        let mut via: Vec<Joints> = if from <= target {
            ways.get(from..target)?.to_vec()
        } else {
            ways.get(target + 1..=from)?.iter().rev().copied().collect()
        };
        via.extend(&entry.via);
        Some(PlanEntry { via, ..entry.clone() })
    }

    /// Steps (a) to (g): to the ball, read and correct; what is to be recorded.
    fn touch(&mut self, entry: &PlanEntry) -> Result<Row, Violation> {
        let options = self.options;
        self.controller.set_speed(options.travel_speed, ROTATION_SPEED)?;
        for q in &entry.via {
            self.go(q)?;
        }
        self.check_cancelled()?;
        if !entry.via.is_empty() {
            self.check_free()?;
        }
        self.controller.set_speed(options.touch_speed, ROTATION_SPEED)?;
        (self.corrections, self.corrected) = (0, 0.0);
        let mut reading = self.arrive(entry)?;
        // with no way out of the touch, channels that have not followed a correction may be stuck, or repeat an old value
        let mut follows = [!entry.via.is_empty(); 3];
        while norm(&reading) >= options.epsilon || follows.contains(&false) {
            if norm(&reading) < options.epsilon {
                // a little aside along all axes: each channel has to follow, and the loop goes back
                reading = self.aside(entry, reading)?;
                follows = [true; 3];
                continue;
            }
            if self.corrections >= options.limits.iterations {
                return Err(Violation::Iterations {
                    iterations: self.corrections,
                    left_mm: norm(&reading) * 1e3,
                    epsilon_mm: options.epsilon * 1e3,
                });
            }
            let after = self.follow(entry, reading)?;
            for k in 0..3 {
                // a step of `confirm` or more, of which a gap in a joint may have swallowed most
                follows[k] |= reading[k].abs() >= CONFIRM && responds(reading[k], after[k], reading[k]);
            }
            reading = after;
        }
        let row = self.measured(entry, reading)?;
        if !entry.via.is_empty() {
            self.check_response(entry, &reading)?;
        }
        Ok(row)
    }

    /// Leaves the last touch of the run, and accepts it. A zero that was set anew during any other touch is found before the next one; here the
    /// free stems are read once more, and a touch whose zero is not known is not recorded.
    fn end(&mut self, entry: &PlanEntry, row: Row, total: usize) -> Result<(), (Violation, RetreatOutcome)> {
        let left = match self.leave() {
            Err(violation) => Err((violation, RetreatOutcome::Interrupted)),
            Ok(()) if entry.via.is_empty() => Ok(()),
            Ok(()) => self.check_free().map_err(|violation| (violation, self.retreat())),
        };
        if !matches!(left, Err((Violation::ZeroMoved { .. } | Violation::NotFree { .. }, _))) {
            self.accept(row, total).map_err(|violation| (violation, self.retreat()))?;
        }
        left
    }

    /// At the approach point each stem has to read as one that touches nothing, and the same as at the first touch: its own stop.
    fn check_free(&mut self) -> Result<(), Violation> {
        let free = self.settled_reading()?;
        let [low, high] = self.options.limits.stroke;
        if let Some(k) = (0..3).find(|k| (low..=high).contains(&free[*k])) {
            return Err(Violation::NotFree {
                axis: AXES[k],
                reading_mm: free[k] * 1e3,
                low_mm: low * 1e3,
                high_mm: high * 1e3,
            });
        }
        let first = self.free.unwrap_or(free);
        if self.free.is_none() {
            self.free = Some(free);
            // for a run that takes this recording up
            let t = self.time()?;
            self.log.indicators(t, &free, true)?;
        }
        match (0..3).find(|k| (free[*k] - first[*k]).abs() > FREE_CHANGE) {
            None => Ok(()),
            Some(k) => Err(Violation::ZeroMoved {
                axis: AXES[k],
                first_mm: first[k] * 1e3,
                reading_mm: free[k] * 1e3,
                limit_mm: FREE_CHANGE * 1e3,
            }),
        }
    }

    /// A little way out of the touch, towards the approach point: the whole way takes every stem out of its stroke, so every
    /// channel has to follow this part of it, or a little more where the way is curved and one begins slowly. One that does not measures
    /// nothing, whatever it reads.
    fn check_response(&mut self, entry: &PlanEntry, reading: &[f64; 3]) -> Result<(), Violation> {
        let Some(approach) = entry.via.last() else { return Ok(()) };
        let (part, touch) = (self.options.beyond, self.at);
        // a gap in a joint may swallow some of it
        let least = 0.25 * part * self.options.limits.stroke[1].abs();
        let mut still = Ok(());
        for farther in [1.0, 2.0, 4.0] {
            let out = std::array::from_fn(|k| touch[k] + farther * part * (approach[k] - touch[k]));
            check_joints(&out, self.options)?;
            self.drive(&out)?;
            let after = self.settled_reading()?;
            still = match (0..3).find(|k| (after[*k] - reading[*k]).abs() < least) {
                None => return Ok(()),
                Some(k) => Err(Violation::NoResponse {
                    axis: AXES[k],
                    before_mm: reading[k] * 1e3,
                    after_mm: after[k] * 1e3,
                    least_mm: least * 1e3,
                }),
            };
        }
        still
    }

    /// From the approach point to the touch: where it was found at an earlier visit, and then every other time from beyond; and what is read there.
    fn arrive(&mut self, entry: &PlanEntry) -> Result<[f64; 3], Violation> {
        let options = self.options;
        let stride = options.stride.unwrap_or(u64::MAX).max(1);
        let (round, place) = (entry.index / stride, entry.index % stride);
        let found = if round > 0 { self.known.get(&place).copied() } else { None };
        let touch = found.unwrap_or(entry.joints);
        let from_beyond = found.is_some() && round % 2 == 1;
        let at_part = |part: f64| -> Joints { std::array::from_fn(|k| touch[k] + part * (touch[k] - self.at[k])) };
        let (before, beyond) = (at_part(-options.beyond), at_part(options.beyond));
        check_joints(&touch, options)?;
        self.check_cancelled()?;
        // from here on the arm may be on its way, so the way back begins at the point before
        self.trail.push(touch);
        self.touching = Some(entry.ball);
        if from_beyond {
            check_joints(&beyond, options)?;
            self.drive(&beyond)?;
        }
        // from beyond, joints turn round, and a gap in one would count
        if from_beyond || entry.via.is_empty() {
            self.drive(&touch)?;
            return self.read(entry);
        }
        check_joints(&before, options)?;
        self.drive(&before)?;
        let read_before = self.settled_reading()?;
        self.drive(&touch)?;
        let reading = self.read(entry)?;
        // where it was sent: some controllers round what they report
        let expected = options.elsewhere.map(|elsewhere| elsewhere(&touch, reading, &before));
        expected.map_or(Ok(()), |expected| self.check_change(&read_before, &reading, &expected))?;
        Ok(reading)
    }

    /// The way from a stop just before the touch is known, and so is what each channel has to read there. A stem that sticks about zero is free
    /// there, or does not change at all.
    fn check_change(&self, before: &[f64; 3], reading: &[f64; 3], expected: &[f64; 3]) -> Result<(), Violation> {
        let way: [f64; 3] = std::array::from_fn(|k| expected[k] - reading[k]);
        let allowed = CHANGE_OFF * norm(&way) + CHANGE_REPEATABILITY * self.options.repeatability;
        let [low, high] = self.options.limits.stroke;
        // a stem that was still free there says nothing
        let off = |k: &usize| (low..=high).contains(&before[*k]) && (before[*k] - expected[*k]).abs() > allowed;
        match (0..3).find(off) {
            None => Ok(()),
            Some(k) => Err(Violation::WrongChange {
                axis: AXES[k],
                before_mm: before[k] * 1e3,
                reading_mm: reading[k] * 1e3,
                expected_mm: expected[k] * 1e3,
                allowed_mm: allowed * 1e3,
            }),
        }
    }

    fn settled_reading(&mut self) -> Result<[f64; 3], Violation> {
        let settle = self.options.settle.clone().unwrap_or_else(|| self.gauge.settle());
        let reading = settled_reading(self.gauge, &settle, self.cancel)?;
        self.take_warnings();
        Ok(reading)
    }

    fn read(&mut self, entry: &PlanEntry) -> Result<[f64; 3], Violation> {
        self.check_cancelled()?;
        let reading = self.settled_reading()?;
        let t = self.time()?;
        self.log.indicators(t, &reading, true)?;
        (self.progress)(Progress::Reading { index: entry.index, corrections: self.corrections, reading });
        let [low, high] = self.options.limits.stroke;
        match (0..3).find(|k| !(low..=high).contains(&reading[*k])) {
            None => Ok(reading),
            Some(k) => Err(Violation::NoContact {
                axis: AXES[k],
                reading_mm: reading[k] * 1e3,
                low_mm: low * 1e3,
                high_mm: high * 1e3,
            }),
        }
    }

    /// Step (g): the joints that the controller reports, and what belongs to them.
    fn measured(&mut self, entry: &PlanEntry, reading: [f64; 3]) -> Result<Row, Violation> {
        self.at = self.settled_joints()?;
        self.note_joints()?;
        self.look_at_decimals();
        let t = self.time()?;
        let temp_c = self.temperature()?;
        if let Some(temp_c) = temp_c {
            self.log.temperature(t, temp_c)?;
        }
        let (dir, payload_kg) = (Some(self.motion.sense()), self.options.payload_kg);
        // what the controller made of the corrections is not known here: no commanded joints
        let state = State { dir, t: Some(t), temp_c, payload_kg, ..State::at(&self.at) };
        let measured = Measured::Touch { ball: entry.ball, reading };
        Ok(Row { state, measured, seq: Some(entry.index), line: 0 })
    }

    /// By the controller's sensor, where it has one that works.
    fn temperature(&mut self) -> Result<Option<f64>, Violation> {
        let found = self.controller.temperature()?;
        if let Some(found) = found.filter(|found| !self.no_temperature && !TEMPERATURES.contains(found)) {
            self.no_temperature = true;
            let controller = self.controller.name();
            self.warn(format!(
                "robot controller {controller}: reports a temperature of {found:?} degC, which is not recorded; expected {} to {}",
                TEMPERATURES.start(),
                TEMPERATURES.end()
            ));
        }
        Ok(found.filter(|found| TEMPERATURES.contains(found)).or(self.options.temp_c))
    }

    /// Warns once of a controller that rounds its joints: no calibration is better than that.
    fn look_at_decimals(&mut self) {
        let joints = self.controller.joint_count();
        let rounded = |q: &f64| {
            let hundredths = q.to_degrees() * 100.0;
            (hundredths - hundredths.round()).abs() < 1e-6
        };
        let moved = |q: &f64| *q != 0.0;
        // by chance once in a thousand for a joint with five decimals, never for three
        if !self.coarse && self.at.iter().filter(|q| moved(q)).count() >= 3 && self.at.iter().take(joints).all(rounded)
        {
            self.coarse = true;
            let controller = self.controller.name();
            self.warn(format!(
                "robot controller {controller}: reports its joints in whole steps of 0.01 deg; expected more decimals: a step is 0.17 mm \
                 at a reach of 1 m, and no calibration from these touches is better than that"
            ));
        }
    }

    /// Stores a measurement; it is safe when this returns.
    fn accept(&mut self, row: Row, total: usize) -> Result<(), Violation> {
        self.log.measurement(&row)?;
        if let Some(index) = row.seq {
            self.known.insert(index % self.options.stride.unwrap_or(u64::MAX).max(1), row.state.q);
        }
        self.report.measured += 1;
        let done = self.report.measured + self.report.skipped;
        (self.progress)(Progress::Measured { row: Box::new(row), corrections: self.corrections, done, total });
        Ok(())
    }

    /// A joint motion towards the touch, with all checks.
    fn go(&mut self, target: &Joints) -> Result<(), Violation> {
        self.check_cancelled()?;
        check_joints(target, self.options)?;
        // from here on the arm may be on its way, so the way back begins at the point before
        self.trail.push(*target);
        self.drive(target)
    }

    /// Where the controller says that the arm is, before it is moved: somebody may have moved it since.
    fn look(&mut self) -> Result<(), Violation> {
        let left = self.at;
        self.at = if self.retreating { self.settled_joints()? } else { self.controller.joints()? };
        check_finite(&self.at)?;
        let (joint, off) = largest_difference(&left, &self.at);
        if off > ARRIVAL && !self.retreating {
            return Err(Violation::Elsewhere {
                joint: joint + 1,
                left_deg: left[joint].to_degrees(),
                found_deg: self.at[joint].to_degrees(),
            });
        }
        Ok(())
    }

    /// A joint motion that the collision model allows from where the arm is, and whether it arrived.
    fn drive(&mut self, target: &Joints) -> Result<(), Violation> {
        self.look()?;
        self.options.allow(&self.at, target, self.touching).map_err(Violation::NoWay)?;
        self.controller.move_joints(target)?;
        self.at = self.settled_joints()?;
        let noted = self.note_joints();
        if !self.retreating {
            noted?;
        }
        let (joint, off) = largest_difference(target, &self.at);
        if off > ARRIVAL || off.is_nan() {
            return Err(Violation::NotArrived {
                joint: joint + 1,
                sent_deg: target.get(joint).map_or(f64::NAN, |q| q.to_degrees()),
                found_deg: self.at.get(joint).map_or(f64::NAN, |q| q.to_degrees()),
            });
        }
        Ok(())
    }

    fn settled_joints(&mut self) -> Result<Joints, Violation> {
        let settle = self.options.joint_settle.clone().unwrap_or_else(|| self.controller.joint_settle());
        // a stop by the user waits until the arm stands
        let never = AtomicBool::new(false);
        Ok(wait_settled(self.controller, &settle, &never)?)
    }

    /// After a touch: back to the approach point or all the way, as the plan is made for.
    fn leave(&mut self) -> Result<(), Violation> {
        // the first point of the trail is where the arm stood before the entry, the last is the touch
        let keep = match (self.options.retreat, self.trail.len()) {
            // there was no point on the way: back to where it came from
            (_, 0..=2) => 0,
            (Retreat::Whole, _) => 1,
            (Retreat::Approach, points) => points - 2,
        };
        self.back_to(keep)
    }

    /// After a failure: all the way back, with whatever still works.
    fn retreat(&mut self) -> RetreatOutcome {
        let keep = match self.trail.len() {
            0 | 1 => return RetreatOutcome::NotNeeded,
            // it failed on the way to the first point
            2 => 0,
            _ => 1,
        };
        self.retreating = true;
        self.options.stops.iter().for_each(|stops| stops.hear());
        match self.back_to(keep) {
            Ok(()) => RetreatOutcome::Done,
            Err(violation) => RetreatOutcome::Failed(Box::new(violation)),
        }
    }

    /// Goes back along the trail until only so many of its points are left behind the arm.
    fn back_to(&mut self, keep: usize) -> Result<(), Violation> {
        self.controller.set_speed(self.options.touch_speed, ROTATION_SPEED)?;
        while self.trail.len() > keep + 1 {
            self.trail.pop();
            let Some(target) = self.trail.last().copied() else { break };
            match self.drive(&target) {
                // the arm is not where its way led it: a point further back may be free to go to
                Err(Violation::NoWay(_)) if self.retreating && self.trail.len() > keep + 1 => continue,
                driven => driven?,
            }
            self.touching = None;
            self.controller.set_speed(self.options.travel_speed, ROTATION_SPEED)?;
        }
        Ok(())
    }

    fn check_cancelled(&self) -> Result<(), Violation> {
        if self.cancel.load(Ordering::Relaxed) { Err(Violation::Cancelled) } else { Ok(()) }
    }

    /// Time of the recording, s.
    fn time(&mut self) -> Result<f64, Violation> {
        let clock = self.controller.clock()?;
        Ok(self.on_recording(clock))
    }

    /// By the controller's clock, but without its jumps: the times of a recording never go back, and stay readable.
    fn on_recording(&mut self, clock: f64) -> f64 {
        let here = self.clock_shown.1.elapsed().as_secs_f64();
        if clock != self.clock_shown.0 {
            self.clock_shown = (clock, Instant::now());
        } else if here > STANDING_CLOCK_S && !self.clock_stands {
            self.clock_stands = true;
            self.warn(format!(
                "the controller's clock stands still at {clock:?} s; the times of the recording do, too: what changes with time cannot be seen in it"
            ));
        }
        let t = clock + self.clock_offset;
        let longest = LONGEST_STEP_S.max(LONGEST_STEP * here);
        if !(self.t - CLOCK_SLACK_S..=self.t + longest).contains(&t) {
            self.clock_offset = self.t - clock;
            self.clock_jumps += 1;
            let again =
                if self.clock_jumps == TOLD_JUMPS { "; further jumps are not told: does it show seconds?" } else { "" };
            if self.clock_jumps <= TOLD_JUMPS {
                self.warn(format!(
                    "the controller's clock has jumped by {:.3e} s; the times of the recording go on without the jump{again}",
                    t - self.t
                ));
            }
            return self.t;
        }
        self.t = self.t.max(t);
        self.t
    }

    /// Logs where the joints have been, and where they are.
    fn note_joints(&mut self) -> Result<(), Violation> {
        let (history, mut before) = (self.controller.take_history(), self.t);
        let now = self.time()?;
        for sample in history {
            self.motion.push(&sample.q);
            let t = sample.t + self.clock_offset;
            // what is older comes from an arm that stood, or from before a jump of the clock
            if (before..=now).contains(&t) {
                self.log.joint_state(&JointSample { t, q: sample.q })?;
                before = t;
            }
        }
        self.motion.push(&self.at);
        Ok(self.log.joint_state(&JointSample { t: now, q: self.at })?)
    }

    fn take_warnings(&mut self) {
        for warning in self.gauge.take_warnings() {
            self.warn(warning);
        }
    }

    fn warn(&mut self, warning: String) {
        self.report.warnings.push(warning.clone());
        (self.progress)(Progress::Warning(warning));
    }
}

/// Whether a channel shows the same: means of equal readings may differ in the last bits.
fn is_same(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-9
}

/// Whether a channel has followed a step along it; a gap in a joint may have swallowed most of it.
fn responds(before: f64, after: f64, step: f64) -> bool {
    (before - after).abs() >= 0.25 * step.abs()
}

fn norm(v: &[f64; 3]) -> f64 {
    v.iter().map(|v| v * v).sum::<f64>().sqrt()
}
