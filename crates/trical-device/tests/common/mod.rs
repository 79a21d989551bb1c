//! A gantry with a wrist whose inverse is closed-form: enough of an arm to try the procedure on.

#![allow(dead_code, clippy::unwrap_used, clippy::needless_range_loop)]

use std::sync::atomic::AtomicBool;

use nalgebra::{Matrix3, Vector3};
use trical_device::virtual_cell::Plant;
use trical_device::{
    CellOptions, Controller, Fault, Gauge, PlanEntry, ProcedureError, ProcedureOptions, Progress, RunReport,
    VirtualCell, open_controller, open_gauge, run,
};
use trical_model::Pose;
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

pub fn rotation(q: &Joints) -> Matrix3<f64> {
    let (sa, ca) = q[3].sin_cos();
    let (sb, cb) = q[4].sin_cos();
    let (sc, cc) = q[5].sin_cos();
    Matrix3::new(
        ca * cb,
        ca * sb * sc - sa * cc,
        ca * sb * cc + sa * sc,
        sa * cb,
        sa * sb * sc + ca * cc,
        sa * sb * cc - ca * sc,
        -sb,
        cb * sc,
        cb * cc,
    )
}

pub fn nominal(q: &Joints) -> Pose {
    let rotation = rotation(q);
    Pose { rotation, translation: Vector3::new(q[0], q[1], q[2]) + rotation * Vector3::from(TCP) }
}

pub fn inverse(pose: &Pose) -> Joints {
    let (r, mut q) = (&pose.rotation, [0.0; MAX_JOINTS]);
    q[4] = (-r[(2, 0)]).asin();
    q[3] = r[(1, 0)].atan2(r[(0, 0)]);
    q[5] = r[(2, 1)].atan2(r[(2, 2)]);
    q[..3].copy_from_slice((pose.translation - r * Vector3::from(TCP)).as_slice());
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
        let tool = self.tcp(state);
        (tool.rotation.transpose() * (Vector3::from(BALLS[ball]) - tool.translation)).into()
    }
    fn tcp(&mut self, state: &State) -> Pose {
        let mut tool = nominal(&state.q);
        tool.translation += Vector3::from(self.error);
        tool.translation.x += self.backlash * f64::from(state.dir.map_or(0, |dir| dir[1]));
        tool.translation.z += self.drift * state.t.unwrap_or(0.0);
        tool
    }
    fn nominal_tcp(&self, q: &Joints) -> Pose {
        nominal(q)
    }
    fn nominal_inverse(&self, world_from_tool: &Pose, _: &Joints) -> Option<Joints> {
        (world_from_tool.translation.z > -0.5).then(|| inverse(world_from_tool))
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
            let rotation = rotation(&seed);
            let at = |short: f64, lift: f64| {
                let back = rotation * Vector3::from_element(short / 3.0_f64.sqrt());
                inverse(&Pose { rotation, translation: Vector3::from(BALLS[ball]) - back + lift * Vector3::z() })
            };
            PlanEntry { index, ball, joints: at(0.0, 0.0), via: vec![at(0.03, 0.2), at(0.03, 0.0)] }
        })
        .collect()
}

/// Settings for the virtual cell.
pub fn options<'a>() -> ProcedureOptions<'a> {
    ProcedureOptions {
        go: true,
        epsilon: 5e-6,
        repeatability: 1e-6,
        elsewhere: Some(&|at, reading, there| {
            nominal(there).inverse().apply(&nominal(at).apply(&Vector3::from(reading))).into()
        }),
        ..ProcedureOptions::default()
    }
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
