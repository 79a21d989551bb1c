//! A gantry with a wrist whose inverse is closed-form: enough of an arm to try the procedure on.

#![allow(dead_code, clippy::unwrap_used, clippy::needless_range_loop)]

use std::sync::atomic::AtomicBool;

use trical_device::virtual_cell::{Frame, Plant};
use trical_device::{
    CellOptions, Controller, Fault, Gauge, PlanEntry, ProcedureError, ProcedureOptions, Progress, RunReport,
    VirtualCell, open_controller, open_gauge, run,
};
use trical_model::recording::{Joints, MAX_JOINTS, Row, State};

/// Three linear joints (1 rad stands for 1 m) and roll, pitch, yaw of the wrist, about a TCP off the wrist.
pub struct Gantry {
    /// What the true arm adds to the nominal TCP, m.
    pub error: [f64; 3],
    /// Error along x per sense of joint 2's last motion, m.
    pub backlash: f64,
    /// Growth along z per second, m.
    pub drift: f64,
    /// What its sensor shows more than there is, K.
    pub hotter: f64,
}

pub const TCP: [f64; 3] = [0.018, -0.012, 0.118];
pub const BALLS: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.15, 0.26, 0.0]];

impl Default for Gantry {
    fn default() -> Self {
        Self { error: [0.8e-3, -0.5e-3, 0.3e-3], backlash: 0.0, drift: 0.0, hotter: 0.0 }
    }
}

pub fn rotation(q: &Joints) -> [[f64; 3]; 3] {
    let (sa, ca) = q[3].sin_cos();
    let (sb, cb) = q[4].sin_cos();
    let (sc, cc) = q[5].sin_cos();
    [
        [ca * cb, ca * sb * sc - sa * cc, ca * sb * cc + sa * sc],
        [sa * cb, sa * sb * sc + ca * cc, sa * sb * cc - ca * sc],
        [-sb, cb * sc, cb * cc],
    ]
}

pub fn nominal(q: &Joints) -> Frame {
    let r = rotation(q);
    (std::array::from_fn(|i| q[i] + (0..3).map(|j| r[i][j] * TCP[j]).sum::<f64>()), r)
}

pub fn inverse(position: [f64; 3], r: [[f64; 3]; 3]) -> Joints {
    let mut q = [0.0; MAX_JOINTS];
    q[4] = (-r[2][0]).asin();
    q[3] = r[1][0].atan2(r[0][0]);
    q[5] = r[2][1].atan2(r[2][2]);
    for i in 0..3 {
        q[i] = position[i] - (0..3).map(|j| r[i][j] * TCP[j]).sum::<f64>();
    }
    q
}

impl Plant for Gantry {
    fn joints(&self) -> usize {
        6
    }
    fn balls(&self) -> usize {
        BALLS.len()
    }
    fn offset_to_ball(&mut self, state: &State, ball: usize) -> [f64; 3] {
        let (p, r) = self.tcp(state);
        let d: [f64; 3] = std::array::from_fn(|i| BALLS[ball][i] - p[i]);
        std::array::from_fn(|j| (0..3).map(|i| r[i][j] * d[i]).sum())
    }
    fn tcp(&mut self, state: &State) -> Frame {
        let (mut p, r) = nominal(&state.q);
        for i in 0..3 {
            p[i] += self.error[i];
        }
        p[0] += self.backlash * f64::from(state.dir.map_or(0, |dir| dir[1]));
        p[2] += self.drift * state.t.unwrap_or(0.0);
        (p, r)
    }
    fn nominal_tcp(&self, q: &Joints) -> Frame {
        nominal(q)
    }
    fn nominal_inverse(&self, position: [f64; 3], rotation: [[f64; 3]; 3], _: &Joints) -> Option<Joints> {
        (position[2] > -0.5).then(|| inverse(position, rotation))
    }
    fn temperature(&mut self, t: f64) -> Option<f64> {
        Some(20.0 + 1e-3 * t + self.hotter)
    }
}

/// A plan of so many touches: each comes from above, is held 30 mm short of the ball, and goes straight on.
pub fn plan(count: u64) -> Vec<PlanEntry> {
    (0..count)
        .map(|index| {
            let ball = (index % 3) as usize;
            let turn = index as f64;
            let mut seed = [0.0; MAX_JOINTS];
            (seed[3], seed[4], seed[5]) = (0.3 * turn.sin(), 0.2 * (1.7 * turn).cos(), 0.25 * (2.3 * turn).sin());
            let r = rotation(&seed);
            let at = |short: f64, lift: f64| {
                let mut p = BALLS[ball];
                for i in 0..3 {
                    p[i] -= short * (r[i][0] + r[i][1] + r[i][2]) / 3.0_f64.sqrt();
                }
                p[2] += lift;
                inverse(p, r)
            };
            PlanEntry { index, ball, joints: at(0.0, 0.0), via: vec![at(0.03, 0.2), at(0.03, 0.0)] }
        })
        .collect()
}

/// Settings for the virtual cell.
pub fn options<'a>() -> ProcedureOptions<'a> {
    ProcedureOptions { go: true, epsilon: 5e-6, repeatability: 1e-6, ..ProcedureOptions::default() }
}

/// A virtual cell with its drivers and what came out of it.
pub struct Bench {
    pub cell: VirtualCell,
    pub gauge: Box<dyn Gauge>,
    pub controller: Box<dyn Controller>,
    pub rows: Vec<Row>,
    pub events: Vec<Progress>,
}

impl Bench {
    pub fn new(plant: Gantry, cell: CellOptions) -> Self {
        let start = plan(1)[0].via[0];
        let cell = VirtualCell::start(Box::new(plant), CellOptions { start, ..cell }).unwrap();
        let gauge = open_gauge(&format!("{}&timeout_ms=300", cell.gauge_url())).unwrap();
        let controller = open_controller(&cell.controller_url()).unwrap();
        Self { cell, gauge, controller, rows: Vec::new(), events: Vec::new() }
    }

    pub fn run(&mut self, plan: &[PlanEntry], options: &ProcedureOptions<'_>) -> Result<RunReport, ProcedureError> {
        let cancel = AtomicBool::new(false);
        let events = &mut self.events;
        run(plan, (self.gauge.as_mut(), self.controller.as_mut()), &mut self.rows, options, &cancel, &mut |event| {
            events.push(event);
        })
    }

    pub fn fails(&mut self, fault: Fault) -> ProcedureError {
        self.cell.inject(fault);
        self.run(&plan(3), &options()).unwrap_err()
    }
}

pub fn bench() -> Bench {
    Bench::new(Gantry::default(), CellOptions::default())
}
