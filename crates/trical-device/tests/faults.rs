//! What goes wrong, and how the procedure ends then.

use std::sync::atomic::AtomicBool;

use crate::common::{BALLS, Bench, Gantry, bench, nominal, options, plan};
use nalgebra::Vector3;
use trical_device::controller::trial::Jog;
use trical_device::gauge::Settle;
use trical_device::gauge::uwave_protocol::Status;
use trical_device::procedure::{RetreatOutcome, Violation};
use trical_device::{
    CellError, CellOptions, Controller, ControllerError, Fault, Gauge, GaugeError, ProcedureError, ProcedureOptions,
    Progress, VirtualCell, run,
};
use trical_model::recording::{Joints, Measured, Row};
use trical_recording::RecordError;
use trical_recording::mcap::RunLog;
use trical_recording::motion::JointSample;

#[test]
fn a_transmitter_that_dies_while_free_is_noticed() {
    let mut bench = bench();
    bench.run(&plan(1), &options()).unwrap();
    let error = bench.fails(Fault::Stale { axis: 1 });
    assert!(matches!(error.violation(), Some(Violation::NoContact { axis: 'y', .. })), "{error}");
    assert!(error.to_string().contains("went back the way it came"), "{error}");
}

#[test]
fn a_transmitter_that_dies_in_a_touch_is_noticed_and_the_arm_retreats() {
    let Bench { cell, mut gauge, mut controller, mut rows, .. } = bench();
    let mut watch = |event| {
        if matches!(event, Progress::Reading { index: 1, corrections: 0, .. }) {
            cell.inject(Fault::Stale { axis: 1 });
        }
    };
    let cancel = AtomicBool::new(false);
    let error =
        run(&plan(3), (gauge.as_mut(), controller.as_mut()), &mut rows, &options(), &cancel, &mut watch).unwrap_err();
    let ProcedureError::Touch { index: 1, ball: 1, violation, retreat } = &error else { panic!("{error}") };
    assert!(matches!(violation.as_ref(), Violation::Stale { axis: 'y', .. }), "{error}");
    assert!(matches!(retreat, RetreatOutcome::Done), "{error}");
    assert_eq!(rows.len(), 1, "what was measured before stays");
    let free = plan(2)[1].via[0];
    assert!(free.iter().zip(&cell.state().q).all(|(a, b)| (a - b).abs() < 1e-6));
}

#[test]
fn mixed_up_or_reversed_axes_diverge_and_say_so() {
    let error = bench().fails(Fault::FlippedAxis { axis: 0 });
    assert!(error.to_string().contains("check the channels and signs"), "{error}");
    let error = bench().fails(Fault::SwappedAxes);
    assert!(error.to_string().contains("check the channels and signs"), "{error}");
}

#[test]
fn faults_of_the_receiver_have_their_own_errors() {
    for (fault, words) in [
        (Fault::Silence, "no answer to \"DR1000000\" in 3 attempts"),
        (Fault::Garbage, "expected a record of a U-WAVE-R"),
        (Fault::Status { axis: 2, status: Status::NoData, times: 9 }, "axis z (channel 02): the receiver has no value"),
        (Fault::Status { axis: 0, status: Status::Unregistered, times: 1 }, "status 02"),
        (Fault::Status { axis: 1, status: Status::DataLost, times: 3 }, "status 03"),
        (Fault::Status { axis: 1, status: Status::Disconnected, times: 1 }, "status 04"),
    ] {
        let mut bench = bench();
        let error = bench.fails(fault.clone());
        assert!(error.to_string().contains(words), "{fault:?}: {error}");
        assert!(matches!(error, ProcedureError::Start { .. }), "{error}");
        assert_eq!(bench.cell.motions(), 0);
        bench.cell.clear_faults();
        assert_eq!(bench.run(&plan(1), &options()).unwrap().measured, 1, "works again after {fault:?}");
    }
}

#[test]
fn passing_faults_are_survived_and_a_low_battery_is_a_warning() {
    let mut bench = bench();
    bench.cell.inject(Fault::Status { axis: 1, status: Status::DataLost, times: 2 });
    bench.cell.inject(Fault::BatteryLow { axis: 0 });
    bench.cell.inject(Fault::Unsolicited);
    let report = bench.run(&plan(3), &options()).unwrap();
    assert_eq!(report.measured, 3);
    assert_eq!(report.warnings.len(), 1, "{:?}", report.warnings);
    assert!(report.warnings[0].contains("channel 00 is low"));
    assert!(bench.events.iter().any(|event| matches!(event, Progress::Warning(_))));
}

#[test]
fn faults_of_the_arm_have_their_own_errors() {
    let mut bench = bench();
    bench.run(&plan(1), &options()).unwrap();
    let error = bench.fails(Fault::BallsRemoved);
    assert!(matches!(error.violation(), Some(Violation::NoContact { .. })), "{error}");
    bench.cell.clear_faults();
    let error = bench.fails(Fault::StuckArm);
    assert!(matches!(error.violation(), Some(Violation::NotArrived { .. })), "{error}");
    bench.cell.clear_faults();
    let error = bench.fails(Fault::RefuseMoves);
    assert!(error.to_string().contains("emergency stop"), "{error}");
    assert!(error.to_string().contains("could NOT go back"), "{error}");
    bench.cell.clear_faults();
    let error = bench.fails(Fault::DropConnection);
    assert!(error.to_string().contains("connection is lost"), "{error}");
}

#[test]
fn limits_of_corrections_hold_on_both_sides() {
    let off = || Gantry { error: [3.5e-3, 0.0, 0.0], ..Gantry::default() };
    let mut bench = Bench::new(off(), CellOptions::default());
    let mut strict = options();
    strict.limits.correction = 3e-3;
    let error = bench.run(&plan(1), &strict).unwrap_err();
    assert!(error.to_string().contains("correction would be 3.500 mm, the limit is 3.000 mm"), "{error}");
    assert!(error.to_string().contains("went back the way it came"), "{error}");

    let mut bench = Bench::new(off(), CellOptions { correction_limit: 2e-3, ..CellOptions::default() });
    let error = bench.run(&plan(1), &options()).unwrap_err();
    assert!(error.to_string().contains("correction 3.500 mm is over the limit of 2.000 mm"), "{error}");

    let mut bench = Bench::new(off(), CellOptions::default());
    let mut strict = options();
    strict.limits.total_correction = 3.4e-3;
    let error = bench.run(&plan(1), &strict).unwrap_err();
    assert!(matches!(error.violation(), Some(Violation::TotalCorrection { .. })), "{error}");
}

#[test]
fn a_tolerance_below_the_repeatability_is_warned_about_and_may_not_converge() {
    let cell = CellOptions { placement: 50e-6, ..CellOptions::default() };
    let mut bench = Bench::new(Gantry::default(), cell);
    let mut fine = ProcedureOptions { epsilon: 1e-6, repeatability: 50e-6, ..options() };
    fine.limits.growth = 1e9;
    let error = bench.run(&plan(1), &fine).unwrap_err();
    assert!(
        matches!(error.violation(), Some(Violation::Iterations { iterations: 10, .. } | Violation::Stale { .. })),
        "{error}"
    );
    assert!(
        bench.events.iter().any(|event| matches!(event, Progress::Warning(text) if text.contains("repeatability")))
    );
}

#[test]
fn the_controllers_own_joint_limits_hold() {
    let cell = CellOptions { limits: vec![(-10.0, 10.0), (-10.0, 10.0), (0.0, 10.0)], ..CellOptions::default() };
    let mut bench = Bench::new(Gantry::default(), cell);
    let error = bench.run(&plan(1), &options()).unwrap_err();
    assert!(error.to_string().contains("joint 3 out of limits"), "{error}");
}

#[test]
fn a_taken_port_is_one_clear_error() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port();
    let result = VirtualCell::start(Box::new(Gantry::default()), CellOptions { port, ..CellOptions::default() });
    let error = result.err().unwrap();
    assert!(matches!(error, CellError::PortInUse { .. }));
    assert!(error.to_string().contains("in use by another program"), "{error}");
}

/// Fails like a full disk, from the given record on.
struct FullDisk {
    /// Measurements that still fit.
    left: usize,
    full: bool,
}

impl FullDisk {
    fn check(&self) -> Result<(), RecordError> {
        let source = std::io::ErrorKind::StorageFull.into();
        let error = RecordError::Io { path: "run.mcap".into(), action: "write to the disk", source };
        if self.full { Err(error) } else { Ok(()) }
    }
}

impl RunLog for FullDisk {
    fn joint_state(&mut self, _: &JointSample) -> Result<(), RecordError> {
        self.check()
    }
    fn indicators(&mut self, _: f64, _: &[f64; 3], _: bool) -> Result<(), RecordError> {
        self.check()
    }
    fn temperature(&mut self, _: f64, _: f64) -> Result<(), RecordError> {
        self.check()
    }
    fn measurement(&mut self, _: &Row) -> Result<(), RecordError> {
        self.full |= self.left == 0;
        self.left = self.left.saturating_sub(1);
        self.check()
    }
}

#[test]
fn a_full_disk_ends_the_run_with_the_arm_back_at_a_free_place() {
    let Bench { cell, mut gauge, mut controller, .. } = bench();
    let cancel = AtomicBool::new(false);
    let mut disk = FullDisk { left: 1, full: false };
    let error =
        run(&plan(3), (gauge.as_mut(), controller.as_mut()), &mut disk, &options(), &cancel, &mut |_| ()).unwrap_err();
    assert!(error.to_string().contains("run.mcap: cannot write to the disk"), "{error}");
    assert!(error.to_string().contains("went back the way it came"), "{error}");
    assert!(plan(3)[1].via[0].iter().zip(&cell.state().q).all(|(a, b)| (a - b).abs() < 1e-6));
}

#[test]
fn a_connection_lost_on_the_way_back_says_that_the_touch_is_recorded() {
    let Bench { cell, mut gauge, mut controller, mut rows, .. } = bench();
    let cancel = AtomicBool::new(false);
    let mut watch = |event| {
        if matches!(event, Progress::Measured { .. }) {
            cell.inject(Fault::DropConnection);
        }
    };
    let error =
        run(&plan(2), (gauge.as_mut(), controller.as_mut()), &mut rows, &options(), &cancel, &mut watch).unwrap_err();
    assert!(error.to_string().contains("the touch is recorded"), "{error}");
    assert_eq!(rows.len(), 1);
}

#[test]
fn a_receiver_that_is_unplugged_is_an_error_and_not_a_hang() {
    let Bench { cell, mut gauge, mut controller, mut rows, .. } = bench();
    let mut cell = Some(cell);
    let cancel = AtomicBool::new(false);
    let mut watch = |event| {
        if matches!(event, Progress::Reading { .. }) {
            cell.take();
        }
    };
    let error =
        run(&plan(2), (gauge.as_mut(), controller.as_mut()), &mut rows, &options(), &cancel, &mut watch).unwrap_err();
    assert!(error.to_string().contains("lost") || error.to_string().contains("port failed"), "{error}");
    assert!(gauge.read().unwrap_err().to_string().contains("the port failed"));
}

#[test]
fn the_controllers_own_sum_of_corrections_holds() {
    let cell = CellOptions { correction_sum_limit: 0.9e-3, ..CellOptions::default() };
    let mut bench = Bench::new(Gantry::default(), cell);
    let error = bench.run(&plan(1), &options()).unwrap_err();
    assert!(error.to_string().contains("since the last MoveAbsJ are over 0.900 mm"), "{error}");
}

#[test]
fn a_value_that_the_receiver_was_told_to_forget_comes_again_once_it_has_changed() {
    let bench = bench();
    let url = format!("{}&timeout_ms=100&attempts=1", bench.cell.gauge_url());
    drop(bench.gauge);
    let mut keeps = trical_device::open_gauge(&url).unwrap();
    assert!(keeps.read().is_ok() && keeps.read().is_ok());
    drop(keeps);
    let mut forgets = trical_device::open_gauge(&format!("{url}&clear=1")).unwrap();
    assert!(forgets.read().is_ok());
    let error = forgets.read().unwrap_err().to_string();
    assert!(error.contains("no value of this channel yet"), "no data is not zero: {error}");
    let mut controller = bench.controller;
    controller.move_joints(&plan(1)[0].joints).unwrap();
    assert!(forgets.read().is_ok());
}

/// A gauge whose readings are altered on the way.
struct AlteredGauge<'a> {
    gauge: &'a mut dyn Gauge,
    read: usize,
    alter: fn(usize, &mut [f64; 3]),
}

impl Gauge for AlteredGauge<'_> {
    fn name(&self) -> String {
        self.gauge.name()
    }
    fn read(&mut self) -> Result<[f64; 3], GaugeError> {
        let mut reading = self.gauge.read()?;
        self.read += 1;
        (self.alter)(self.read, &mut reading);
        Ok(reading)
    }
    fn settle(&self) -> Settle {
        self.gauge.settle()
    }
}

/// A controller whose joints are altered on the way.
struct AlteredJoints<'a>(&'a mut dyn Controller, fn(&mut Joints));

impl Controller for AlteredJoints<'_> {
    fn name(&self) -> String {
        self.0.name()
    }
    fn joint_count(&self) -> usize {
        self.0.joint_count()
    }
    fn ping(&mut self) -> Result<(), ControllerError> {
        self.0.ping()
    }
    fn joints(&mut self) -> Result<Joints, ControllerError> {
        let mut q = self.0.joints()?;
        (self.1)(&mut q);
        Ok(q)
    }
    fn move_joints(&mut self, target: &Joints) -> Result<(), ControllerError> {
        self.0.move_joints(target)
    }
    fn correct(&mut self, displacement: [f64; 3]) -> Result<(), ControllerError> {
        self.0.correct(displacement)
    }
    fn set_speed(&mut self, linear: f64, angular: f64) -> Result<(), ControllerError> {
        self.0.set_speed(linear, angular)
    }
    fn set_tool(&mut self, tcp_in_flange: [f64; 3]) -> Result<(), ControllerError> {
        self.0.set_tool(tcp_in_flange)
    }
    fn clock(&mut self) -> Result<f64, ControllerError> {
        self.0.clock()
    }
}

#[test]
fn an_indicator_that_is_set_to_zero_in_the_midst_of_a_run_ends_it() {
    let Bench { cell: _cell, mut gauge, mut controller, mut rows, .. } = bench();
    // some key is pressed after the first touch: the scale of x is another from there on
    let alter = |read: usize, reading: &mut [f64; 3]| reading[0] += if read > 40 { 0.5e-3 } else { 0.0 };
    let mut gauge = AlteredGauge { gauge: gauge.as_mut(), read: 0, alter };
    let cancel = AtomicBool::new(false);
    let error =
        run(&plan(9), (&mut gauge, controller.as_mut()), &mut rows, &options(), &cancel, &mut |_| ()).unwrap_err();
    assert!(matches!(error.violation(), Some(Violation::ZeroMoved { axis: 'x', .. })), "{error}");
    assert!(error.to_string().contains("went back the way it came") && !rows.is_empty(), "{error}");
}

#[test]
fn joints_at_which_no_arm_can_stand_are_refused_before_anything_moves() {
    let Bench { cell, mut gauge, mut controller, mut rows, .. } = bench();
    let mut limited = options();
    limited.limits.joints = vec![(-3.0, 3.0); 6];
    let mut turned = AlteredJoints(controller.as_mut(), |q| q[5] += std::f64::consts::TAU);
    let cancel = AtomicBool::new(false);
    let error = run(&plan(1), (gauge.as_mut(), &mut turned), &mut rows, &limited, &cancel, &mut |_| ()).unwrap_err();
    let said = error.to_string();
    assert!(matches!(error, ProcedureError::Start { .. }) && cell.motions() == 0, "{said}");
    assert!(said.contains("reports joint 6 at") && said.contains("same joints, units and turns"), "{said}");
}

#[test]
fn a_controller_that_rounds_its_joints_is_warned_about_once() {
    let Bench { cell: _cell, mut gauge, mut controller, mut rows, .. } = bench();
    let mut rounded = AlteredJoints(controller.as_mut(), |q| {
        q.iter_mut().for_each(|q| *q = ((q.to_degrees() * 100.0).round() / 100.0).to_radians());
    });
    let cancel = AtomicBool::new(false);
    let report = run(&plan(3), (gauge.as_mut(), &mut rounded), &mut rows, &options(), &cancel, &mut |_| ()).unwrap();
    assert_eq!(report.measured, 3);
    assert!(report.warnings.len() == 1 && report.warnings[0].contains("whole steps of 0.01 deg"), "{report:?}");
}

#[test]
fn a_jog_that_does_not_arrive_is_told() {
    let mut bench = bench();
    let from = bench.controller.joints().unwrap();
    let jog = Jog::Joint(5, 0.03);
    let to = jog.target(&from, 6, 0.1, None).unwrap();
    jog.go(bench.controller.as_mut(), &to, 0.01).unwrap();
    bench.cell.inject(Fault::StuckArm);
    let error = jog.go(bench.controller.as_mut(), &from, 0.01).unwrap_err();
    assert!(matches!(error, ControllerError::NotArrived { joint: 6, .. }), "{error}");
}

#[test]
fn a_zero_that_is_set_at_any_time_of_the_last_touch_leaves_no_wrong_row() {
    let right = |row: &Row| {
        let Measured::Touch { ball, reading } = row.measured else { panic!("no touch") };
        let error = Vector3::from(Gantry::default().error);
        let off = nominal(&row.state.q).apply(&Vector3::from(reading)) + error - Vector3::from(BALLS[ball]);
        off.abs().max() < 1e-6
    };
    let (mut refused, mut measured) = (0, 0);
    for reads in 1..30 {
        let Bench { cell: _cell, mut gauge, mut controller, mut rows, .. } = bench();
        let alter = |read: usize, reading: &mut [f64; 3]| reading[0] += if read > 1000 { 0.5e-3 } else { 0.0 };
        let mut gauge = AlteredGauge { gauge: gauge.as_mut(), read: 1000 - reads, alter };
        let cancel = AtomicBool::new(false);
        let options = ProcedureOptions { free: Some([6e-3; 3]), ..options() };
        let result = run(&plan(1), (&mut gauge, controller.as_mut()), &mut rows, &options, &cancel, &mut |_| ());
        assert!(rows.iter().all(right) && rows.len() == usize::from(result.is_ok()), "after {reads} readings");
        refused += usize::from(result.is_err_and(|e| matches!(e.violation(), Some(Violation::ZeroMoved { .. }))));
        measured += rows.len();
    }
    assert!(refused > 5 && measured > 0, "{refused} refused, {measured} measured");
}
