//! Controllers that do not say the truth about the joints.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::common::{Bench, bench, options, plan};
use trical_device::{Controller, ControllerError};
use trical_model::recording::Joints;

/// A controller that moves its arm, but tells something else once `lies` says so.
struct Untrue {
    own: Box<dyn Controller>,
    lies: fn(&Joints) -> Joints,
    /// What it tells since the last correction or, with `at_moves`, the last motion.
    told: Option<Joints>,
    at_moves: bool,
    /// Motions and corrections so far.
    moved: Arc<AtomicUsize>,
}

impl Controller for Untrue {
    fn name(&self) -> String {
        self.own.name()
    }
    fn joint_count(&self) -> usize {
        self.own.joint_count()
    }
    fn ping(&mut self) -> Result<(), ControllerError> {
        self.own.ping()
    }
    fn joints(&mut self) -> Result<Joints, ControllerError> {
        self.told.map_or_else(|| self.own.joints(), Ok)
    }
    fn move_joints(&mut self, target: &Joints) -> Result<(), ControllerError> {
        self.moved.fetch_add(1, Ordering::Relaxed);
        self.told = self.at_moves.then(|| (self.lies)(target));
        self.own.move_joints(target)
    }
    fn correct(&mut self, displacement: [f64; 3]) -> Result<(), ControllerError> {
        self.moved.fetch_add(1, Ordering::Relaxed);
        self.told = Some((self.lies)(&self.own.joints()?));
        self.own.correct(displacement)
    }
    fn set_speed(&mut self, linear: f64, angular: f64) -> Result<(), ControllerError> {
        self.own.set_speed(linear, angular)
    }
    fn set_tool(&mut self, tcp_in_flange: [f64; 3]) -> Result<(), ControllerError> {
        self.own.set_tool(tcp_in_flange)
    }
    fn clock(&mut self) -> Result<f64, ControllerError> {
        self.own.clock()
    }
}

/// What ends a run, and how often the arm has moved by then.
fn ends(lies: fn(&Joints) -> Joints, told: Option<Joints>, at_moves: bool) -> (String, usize) {
    let Bench { cell, gauge, controller, rows, events } = bench();
    let moved = Arc::new(AtomicUsize::new(0));
    let controller = Box::new(Untrue { own: controller, lies, told, at_moves, moved: Arc::clone(&moved) });
    let mut bench = Bench { cell, gauge, controller, rows, events };
    let error = bench.run(&plan(3), &options()).unwrap_err().to_string();
    assert!(bench.rows.is_empty(), "{error}");
    (error, moved.load(Ordering::Relaxed))
}

fn error(lies: fn(&Joints) -> Joints, at_moves: bool) -> String {
    ends(lies, None, at_moves).0
}

#[test]
fn joints_that_stay_where_they_were_after_a_correction_are_noticed() {
    let error = error(|q| *q, false);
    assert!(error.contains("the arm did not move by a correction"), "{error}");
}

#[test]
fn joints_that_are_no_numbers_are_not_recorded() {
    let nan = |_: &Joints| [f64::NAN; 9];
    for at_moves in [true, false] {
        let error = error(nan, at_moves);
        assert!(error.contains("\"joint 1 at NaN\"") && error.contains("expected an angle"), "{error}");
    }
}

#[test]
fn nothing_moves_from_a_place_that_is_no_number() {
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut told = [0.0; 9];
        told[2] = value;
        let (error, moved) = ends(|q| *q, Some(told), false);
        assert!(error.contains(&format!("joint 3 at {value}, expected an angle; nothing has moved")), "{error}");
        assert_eq!(moved, 0, "{error}");
    }
}
