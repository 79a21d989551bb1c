//! The state of a virtual cell: where the arm stands, what the indicators show, what time it is.

use std::time::Instant;

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;
use trical_model::Pose;
use trical_model::recording::{Joints, MAX_JOINTS, State};

use super::script::Counters;
use super::{CellOptions, Fault, Plant};
use crate::controller::largest_difference;
use trical_recording::motion::{JointSample, MotionSense};

/// No joint turns by more in a correction, rad: 10 deg; near a singular pose it would.
const LARGEST_TURN: f64 = 10.0_f64.to_radians();

/// Never more joint samples in one motion.
const MOST_SAMPLES: usize = 200;

pub(super) struct World {
    plant: Box<dyn Plant>,
    pub(super) options: CellOptions,
    pub(super) faults: Vec<Fault>,
    q: Joints,
    /// Where the last motion began.
    came_from: Joints,
    commanded: Joints,
    motion: MotionSense,
    clock: f64,
    random: Pcg64Mcg,
    /// Of what happens to bytes: faults do not change the noise.
    chance: Pcg64Mcg,
    indicators: [f64; 3],
    /// What the receiver knew before the last motion.
    before: [f64; 3],
    /// When the last motion ended, in real time.
    stopped: Instant,
    /// Values that the receiver was told to forget.
    pub(super) cleared: [bool; 3],
    pub(super) readings: u64,
    pub(super) commands: u64,
    linear_speed: f64,
    angular_speed: f64,
    pub(super) stream_interval: f64,
    pub(super) motions: u64,
    /// Whether a person has jogged the arm already.
    jogged: bool,
    /// Sum of the corrections since the last joint motion, m.
    corrected: f64,
}

impl World {
    pub(super) fn new(plant: Box<dyn Plant>, options: CellOptions) -> Self {
        let random = Pcg64Mcg::seed_from_u64(options.seed);
        let chance = Pcg64Mcg::seed_from_u64(options.seed ^ 0x5EED);
        let q = on_grid(&options.start);
        let mut world = Self {
            plant,
            faults: Vec::new(),
            q,
            came_from: q,
            commanded: q,
            motion: MotionSense::default(),
            clock: 0.0,
            random,
            chance,
            indicators: [0.0; 3],
            before: [0.0; 3],
            stopped: Instant::now(),
            cleared: [false; 3],
            readings: 0,
            commands: 0,
            linear_speed: 0.1,
            angular_speed: 0.5,
            stream_interval: 0.0,
            motions: 0,
            jogged: false,
            corrected: 0.0,
            options,
        };
        world.motion.push(&q);
        world.settle();
        world.before = world.indicators;
        world
    }

    fn counters(&self) -> Counters {
        Counters { motions: self.motions, readings: self.readings, commands: self.commands, clock: self.clock }
    }

    /// All faults that are there now, injected or by the script.
    pub(super) fn active(&self) -> impl Iterator<Item = &Fault> {
        let now = self.counters();
        let scheduled = self.options.script.iter().filter(move |s| s.is_active(&now)).map(|s| &s.fault);
        self.faults.iter().chain(scheduled)
    }

    /// What is left of `Unsettled` since the last motion, 1 to 0.
    fn unsettled_share(&self) -> f64 {
        let Some(unsettled) = self.options.unsettled else { return 0.0 };
        let scale = if self.options.pace > 0.0 { self.options.pace } else { 1.0 };
        (-self.stopped.elapsed().as_secs_f64() / (unsettled.time * scale).max(1e-9)).exp()
    }

    /// The last motion ends now.
    pub(super) fn stand(&mut self) {
        self.stopped = Instant::now();
    }

    /// What the line makes of bytes.
    pub(super) fn mangle(&mut self, bytes: Vec<u8>) -> Vec<u8> {
        let (mut drop, mut double, mut garble) = (0, 0, 0);
        for fault in self.active() {
            match fault {
                Fault::DropBytes { per_mille } => drop = *per_mille,
                Fault::DoubleBytes { per_mille } => double = *per_mille,
                Fault::GarbleBytes { per_mille } => garble = *per_mille,
                _ => {}
            }
        }
        if drop + double + garble == 0 {
            return bytes;
        }
        let mut out = Vec::with_capacity(bytes.len());
        for byte in bytes {
            let draw = |random: &mut Pcg64Mcg, per_mille: u16| random.random_range(0..1000) < per_mille;
            if draw(&mut self.chance, drop) {
                continue;
            }
            let bit: u8 = self.chance.random_range(0..8);
            let byte = if draw(&mut self.chance, garble) { byte ^ (1 << bit) } else { byte };
            out.push(byte);
            if draw(&mut self.chance, double) {
                out.push(byte);
            }
        }
        out
    }

    pub(super) fn joint_count(&self) -> usize {
        self.plant.joints()
    }

    pub(super) fn slides(&self) -> [bool; MAX_JOINTS] {
        self.plant.slides()
    }

    pub(super) fn joints(&self) -> Joints {
        let short = self.options.unsettled.map_or(0.0, |u| u.joint) * self.unsettled_share();
        let sense = self.motion.sense();
        on_grid(&std::array::from_fn(|joint| self.q[joint] - short * f64::from(sense[joint])))
    }

    pub(super) fn clock(&self) -> f64 {
        self.clock
    }

    /// What the controller says that its clock shows.
    pub(super) fn clock_shown(&self) -> f64 {
        let jumps =
            self.active().map(|fault| if let Fault::ClockJump { seconds } = fault { *seconds as f64 } else { 0.0 });
        self.clock + jumps.sum::<f64>()
    }

    /// Between two requests a person may jog the arm.
    pub(super) fn jog(&mut self) {
        let found = self.active().find_map(|fault| match fault {
            Fault::Jogged { joint, by_mdeg } => Some((*joint, f64::from(*by_mdeg) * 1e-3)),
            _ => None,
        });
        let Some((joint, by_deg)) = found.filter(|_| !self.jogged) else { return };
        self.jogged = true;
        let mut q = self.q;
        if let Some(q) = q.get_mut(joint) {
            *q += by_deg.to_radians();
        }
        self.guide(&q);
    }

    /// A person has guided the arm by hand.
    pub(super) fn guide(&mut self, q: &Joints) {
        self.came_from = self.q;
        self.q = on_grid(q);
        self.motion.push(&self.q);
        self.settle();
        self.stand();
    }

    pub(super) fn temperature(&mut self) -> Option<f64> {
        self.plant.temperature(self.clock)
    }

    pub(super) fn set_speed(&mut self, linear: f64, angular: f64) -> Result<(), String> {
        if !(linear > 0.0 && angular > 0.0) {
            return Err("speed must be positive".to_owned());
        }
        // as the module does: a wish for more is no error
        self.linear_speed = linear.min(0.25);
        self.angular_speed = angular.min(1.0);
        Ok(())
    }

    /// What the controller tells the plant and the plant may depend on.
    pub(super) fn state(&mut self) -> State {
        State {
            q_commanded: Some(self.commanded),
            dir: Some(self.motion.sense()),
            t: Some(self.clock),
            temp_c: self.plant.temperature(self.clock),
            payload_kg: self.options.payload_kg,
            ..State::at(&self.q)
        }
    }

    pub(super) fn true_tcp(&mut self) -> Pose {
        let state = self.state();
        self.plant.tcp(&state)
    }

    /// The last motion was stopped when so much of it was made, 0 to 1.
    pub(super) fn stop_at(&mut self, part: f64) {
        let (from, to) = (self.came_from, self.q);
        self.q = on_grid(&std::array::from_fn(|joint| from[joint] + part * (to[joint] - from[joint])));
        self.settle();
        self.stand();
    }

    /// MoveAbsJ of the virtual controller; gives samples on the way.
    pub(super) fn move_joints(&mut self, target: &Joints) -> Result<Vec<JointSample>, String> {
        if self.has(&Fault::RefuseMoves) {
            return Err("emergency stop".to_owned());
        }
        self.check_limits(target)?;
        self.corrected = 0.0;
        Ok(self.go(target))
    }

    /// The correction of the virtual controller, by its nominal kinematics.
    pub(super) fn correct(&mut self, displacement: [f64; 3]) -> Result<Vec<JointSample>, String> {
        if self.has(&Fault::RefuseMoves) {
            return Err("emergency stop".to_owned());
        }
        let displacement = Vector3::from(displacement);
        let (length, options) = (displacement.norm(), &self.options);
        if length > options.correction_limit {
            let (length, limit) = (length * 1e3, options.correction_limit * 1e3);
            return Err(format!("correction {length:.3} mm is over the limit of {limit:.3} mm"));
        }
        if self.corrected + length > options.correction_sum_limit {
            let limit = options.correction_sum_limit * 1e3;
            return Err(format!("corrections since the last MoveAbsJ are over {limit:.3} mm"));
        }
        let mut tool = self.plant.nominal_tcp(&self.q);
        tool.translation += tool.rotation * displacement;
        let Some(target) = self.plant.nominal_inverse(&tool, &self.q) else {
            return Err("position cannot be reached".to_owned());
        };
        self.check_limits(&target)?;
        let (joint, turn) = largest_difference(&self.q, &target);
        if turn > LARGEST_TURN {
            return Err(format!("joint {} would turn by {:.3} deg by a correction", joint + 1, turn.to_degrees()));
        }
        self.corrected += length;
        Ok(self.go(&target))
    }

    /// What an indicator shows, m.
    pub(super) fn indicator(&self, axis: usize) -> f64 {
        // how near the ball is where the stem sticks, m
        let sticks = self.active().find_map(|fault| match fault {
            Fault::StuckStem { axis: of } if *of == axis => Some(f64::INFINITY),
            Fault::StickingStem { axis: of, within_um } if *of == axis => Some(f64::from(*within_um) * 1e-6),
            _ => None,
        });
        let source = if self.has(&Fault::SwappedAxes) { [1, 0, 2][axis] } else { axis };
        let late = self.stopped.elapsed().as_secs_f64() < self.options.radio_delay;
        let value = if late {
            self.before[source]
        } else {
            let off = self.options.unsettled.map_or(0.0, |u| u.indicator) * self.unsettled_share();
            let value = self.indicators[source] + off;
            let resolution = self.options.resolution;
            if off > 0.0 && resolution > 0.0 { (value / resolution).round() * resolution } else { value }
        };
        if sticks.is_some_and(|near| value.abs() < near) {
            return [3e-6, 4e-6, 5e-6][(self.motions % 3) as usize];
        }
        if self.has(&Fault::FlippedAxis { axis }) { -value } else { value }
    }

    pub(super) fn has(&self, fault: &Fault) -> bool {
        self.active().any(|active| active == fault)
    }

    fn check_limits(&self, target: &Joints) -> Result<(), String> {
        for (joint, (q, (low, high))) in target.iter().zip(&self.options.limits).enumerate() {
            if !(*low..=*high).contains(q) {
                return Err(format!("joint {} out of limits at {:.3} deg", joint + 1, q.to_degrees()));
            }
        }
        Ok(())
    }

    fn go(&mut self, target: &Joints) -> Vec<JointSample> {
        self.motions += 1;
        let target = if self.has(&Fault::StuckArm) { self.q } else { on_grid(target) };
        let start = self.q;
        let duration = self.duration(&start, &target);
        let mut samples = Vec::new();
        if self.stream_interval > 0.0 {
            let count = ((duration / self.stream_interval).floor() as usize).min(MOST_SAMPLES);
            for index in 1..=count {
                let part = index as f64 / (count + 1) as f64;
                let q = std::array::from_fn(|joint| start[joint] + part * (target[joint] - start[joint]));
                samples.push(JointSample { t: self.clock + part * duration, q });
            }
        }
        self.clock += duration + self.options.dwell;
        self.before = self.indicators;
        self.commanded = target;
        self.came_from = start;
        self.q = target;
        self.motion.push(&target);
        self.settle();
        self.stand();
        samples
    }

    fn duration(&self, start: &Joints, target: &Joints) -> f64 {
        let [from, to] = [start, target].map(|q| self.plant.nominal_tcp(q).translation);
        let length = (from - to).norm();
        let angle = start.iter().zip(target).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        (length / self.linear_speed).max(angle / self.angular_speed)
    }

    /// The indicators take their values at the pose that was reached.
    fn settle(&mut self) {
        let state = self.state();
        let [low, high] = self.options.stroke;
        let mut touched: Option<Vector3<f64>> = None;
        let slipped = self.active().find_map(|fault| match fault {
            Fault::SlippedPlate { by_um } => Some(Vector3::from(by_um.map(|um| f64::from(um) * 1e-6))),
            _ => None,
        });
        let slipped = slipped.map_or_else(Vector3::zeros, |by| self.plant.tcp(&state).rotation.transpose() * by);
        let removed = self.has(&Fault::BallsRemoved);
        for ball in 0..self.plant.balls() {
            // asked at each place where the arm comes to rest: who watches the arm hears of all of them
            let offset = Vector3::from(self.plant.offset_to_ball(&state, ball)) + slipped;
            let within = !removed && offset.iter().all(|d| (low..=high).contains(d));
            if within && touched.is_none_or(|best| offset.norm() < best.norm()) {
                touched = Some(offset);
            }
        }
        // drawn whether touched or not, so that the same motions give the same noise
        let noise = self.draw(self.options.noise);
        let placement = self.draw(self.options.placement);
        let resolution = self.options.resolution;
        let shown: [f64; 3] = match touched {
            None => [high; 3],
            Some(offset) => std::array::from_fn(|axis| {
                let value = offset[axis] + noise[axis] + placement[axis];
                if resolution > 0.0 { (value / resolution).round() * resolution } else { value }
            }),
        };
        for (axis, value) in shown.into_iter().enumerate() {
            if !self.has(&Fault::Stale { axis }) {
                self.cleared[axis] &= self.indicators[axis] == value;
                self.indicators[axis] = value;
            }
        }
    }

    fn draw(&mut self, sd: f64) -> [f64; 3] {
        match Normal::new(0.0, sd) {
            Ok(normal) if sd > 0.0 => std::array::from_fn(|_| normal.sample(&mut self.random)),
            _ => [0.0; 3],
        }
    }
}

/// Joint values on the grid of the wire, five decimals of a degree: the arm is where the controller says it is.
fn on_grid(q: &Joints) -> Joints {
    q.map(|q| ((q.to_degrees() * 1e5).round() / 1e5).to_radians())
}
