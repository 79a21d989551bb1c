//! The whole procedure against a virtual cell, through the real drivers.

use std::cell::{Cell, RefCell};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::common::{BALLS, Bench, Gantry, bench, nominal, options, plan, rotation};
use nalgebra::Vector3;
use trical_device::controller::{JointSettle, StopCount};
use trical_device::procedure::{Retreat, Violation, stride, visits};
use trical_device::virtual_cell::Unsettled;
use trical_device::{
    CellOptions, Controller, ControllerError, Fault, PlanEntry, ProcedureError, ProcedureOptions, Progress,
    VirtualCell, open_controller, open_gauge, run,
};
use trical_model::recording::{Joints, Measured, Row};
use trical_recording::motion::JointSample;

/// How far a touch by a gantry with this backlash along x is from its ball, m.
fn off(row: &Row, backlash: f64) -> [f64; 3] {
    let Measured::Touch { ball, reading } = row.measured else { panic!("no touch") };
    let (tool, sense) = (nominal(&row.state.q), f64::from(row.state.dir.unwrap()[1]));
    let error = Vector3::from(Gantry::default().error) + backlash * sense * Vector3::x();
    (tool.apply(&Vector3::from(reading)) + error - Vector3::from(BALLS[ball])).abs().into()
}

#[test]
fn forty_five_touches_close_on_the_balls() {
    let mut bench = bench();
    let report = bench.run(&plan(45), &options()).unwrap();
    assert_eq!((report.measured, report.skipped, report.warnings.len()), (45, 0, 0));
    assert!(bench.rows.iter().all(|row| off(row, 0.0).iter().all(|d| *d < 1e-6)), "indicators resolve 0.001 mm");
    assert!(bench.rows.iter().all(|row| row.state.temp_c.is_some() && row.state.t.is_some()));
    assert!(bench.rows.windows(2).all(|pair| pair[0].state.t < pair[1].state.t));
}

#[test]
fn the_recorded_sense_of_motion_is_the_arms_own() {
    let plant = Gantry { backlash: 50e-6, ..Gantry::default() };
    let mut bench = Bench::new(plant, CellOptions::default());
    bench.run(&plan(9), &options()).unwrap();
    assert!(bench.rows.iter().all(|row| off(row, 50e-6).iter().all(|d| *d < 1e-6)));
}

#[test]
fn the_same_seed_gives_the_same_rows() {
    let once = || {
        let cell = CellOptions { noise: 1e-6, placement: 3e-6, seed: 7, ..CellOptions::default() };
        let mut bench = Bench::new(Gantry { drift: 1e-9, ..Gantry::default() }, cell);
        bench.run(&plan(6), &ProcedureOptions { epsilon: 20e-6, ..options() }).unwrap();
        bench.rows
    };
    assert_eq!(once(), once());
}

#[test]
fn nothing_moves_without_go() {
    let mut bench = bench();
    let motions = bench.cell.motions();
    let report = bench.run(&plan(2), &ProcedureOptions { go: false, ..options() }).unwrap();
    assert_eq!(bench.cell.motions(), motions);
    assert_eq!(report.measured, 0);
    assert_eq!(report.steps.len(), 2 * 5);
    assert!(
        report.steps[0].starts_with("touch 1 (ball 1): move to via point 1 of 2 at 100 mm/s: "),
        "{}",
        report.steps[0]
    );
}

#[test]
fn a_plan_beyond_the_limits_is_refused_before_anything_moves() {
    let mut bench = bench();
    let mut options = options();
    options.limits.joints = vec![(-10.0, 10.0), (-10.0, 10.0), (-10.0, 0.0)];
    let error = bench.run(&plan(2), &options).unwrap_err();
    assert!(matches!(error, ProcedureError::Plan { index: 0, .. }));
    assert!(matches!(error.violation(), Some(Violation::JointLimit { joint: 3, .. })));
    assert!(error.to_string().contains("nothing has moved"));
    assert_eq!(bench.cell.motions(), 0);

    let refuse = |_: &_, to: &[f64; 9], _| {
        if to[2] < 0.0 { Err("link 4 would touch the floor".to_owned()) } else { Ok(()) }
    };
    let error = bench.run(&plan(2), &ProcedureOptions { guard: Some(&refuse), ..self::options() }).unwrap_err();
    assert!(error.to_string().contains("link 4 would touch the floor"), "{error}");
    assert_eq!(bench.cell.motions(), 0);
}

#[test]
fn touches_that_are_done_are_skipped() {
    let mut bench = bench();
    let report = bench.run(&plan(4), &ProcedureOptions { skip: [0, 2].into(), begin_t: 100.0, ..options() }).unwrap();
    assert_eq!((report.measured, report.skipped), (2, 2));
    assert_eq!(bench.rows.iter().map(|row| row.seq.unwrap()).collect::<Vec<_>>(), [1, 3]);
    assert!(bench.rows[0].state.t.unwrap() > 100.0);
}

#[test]
fn a_stop_ends_at_a_free_place() {
    for stop_at in 1..12 {
        let mut bench = bench();
        let cancel = AtomicBool::new(false);
        let mut readings = 0;
        let result = run(
            &plan(3),
            (bench.gauge.as_mut(), bench.controller.as_mut()),
            &mut bench.rows,
            &options(),
            &cancel,
            &mut |event| {
                readings += usize::from(matches!(event, Progress::Reading { .. } | Progress::Begin { .. }));
                cancel.store(readings >= stop_at, Ordering::Relaxed);
            },
        );
        match result {
            Ok(report) => assert_eq!(report.measured, 3),
            Err(error) => {
                assert!(error.is_cancelled(), "{error}");
                let state = bench.cell.state();
                let free =
                    plan(3).iter().any(|entry| entry.via[0].iter().zip(&state.q).all(|(a, b)| (a - b).abs() < 1e-6));
                assert!(free, "stopped at {stop_at}: {error}");
            }
        }
    }
}

#[test]
fn entries_may_begin_where_the_last_one_was_held_short() {
    let mut bench = bench();
    bench.run(&plan(2), &ProcedureOptions { retreat: Retreat::Approach, ..options() }).unwrap();
    let stands = bench.cell.state().q;
    assert!(plan(2)[1].via[1].iter().zip(&stands).all(|(a, b)| (a - b).abs() < 1e-6));
}

#[test]
fn a_second_client_finds_the_cell_as_the_first_left_it() {
    let mut bench = bench();
    bench.run(&plan(1), &options()).unwrap();
    drop((bench.gauge, bench.controller));
    bench.gauge = open_gauge(&bench.cell.gauge_url()).unwrap();
    bench.controller = open_controller(&bench.cell.controller_url()).unwrap();
    let q = bench.controller.joints().unwrap();
    assert!(q.iter().zip(&bench.cell.state().q).all(|(a, b)| (a - b).abs() < 1e-9));
}

#[test]
fn the_same_plan_may_touch_again_with_a_payload_and_a_temperature_by_hand() {
    let mut bench = bench();
    let options = ProcedureOptions { payload_kg: Some(1.5), temp_c: Some(30.0), ..options() };
    bench.run(&plan(1), &options).unwrap();
    assert_eq!(bench.rows[0].state.payload_kg, Some(1.5));
    assert!(bench.rows[0].state.temp_c.unwrap() < 25.0, "the controller's own sensor goes before");
}

#[test]
fn without_points_on_the_way_the_arm_goes_back_to_where_it_came_from() {
    let mut bench = bench();
    let entry = PlanEntry { via: vec![], ..plan(1).remove(0) };
    let start = bench.cell.state().q;
    bench.run(&[entry], &options()).unwrap();
    assert!(start.iter().zip(&bench.cell.state().q).all(|(a, b)| (a - b).abs() < 1e-6));
}

#[test]
fn at_a_touch_the_true_tcp_is_the_reading_away_from_the_ball() {
    let Bench { cell, mut gauge, mut controller, mut rows, .. } = bench();
    let cancel = AtomicBool::new(false);
    let mut truth = Vec::new();
    let mut last = [0.0; 3];
    let mut watch = |event| match event {
        // the last reading is the one that is recorded
        Progress::Reading { .. } => last = cell.true_tcp().translation.into(),
        Progress::Measured { .. } => truth.push(last),
        _ => {}
    };
    run(&plan(3), (gauge.as_mut(), controller.as_mut()), &mut rows, &options(), &cancel, &mut watch).unwrap();
    for (tcp, ball) in truth.iter().zip(&BALLS) {
        assert!(tcp.iter().zip(ball).all(|(a, b)| (a - b).abs() < 6e-6));
    }
}

#[test]
fn readings_before_settling_are_late_in_the_sense_of_motion_and_a_slow_radio_repeats_old_values() {
    let short = 0.01_f64.to_radians();
    let standing = |time: f64| {
        let unsettled = Some(Unsettled { joint: short, indicator: 20e-6, time });
        let mut bench = Bench::new(Gantry::default(), CellOptions { unsettled, ..CellOptions::default() });
        let start = bench.cell.state().q;
        let target = plan(2)[1].via[0];
        bench.controller.move_joints(&target).unwrap();
        let q = bench.controller.joints().unwrap();
        (0..6).map(|k| (target[k] - q[k]) * (target[k] - start[k]).signum()).collect::<Vec<f64>>()
    };
    // so slow that the test cannot be: nearly all is still missing
    assert!(standing(1e6).iter().all(|behind| (0.9 * short..1.1 * short).contains(behind)), "{:?}", standing(1e6));
    assert!(standing(1e-6).iter().all(|behind| behind.abs() < 1e-6), "{:?}", standing(1e-6));

    let shown = |radio_delay: f64| {
        let mut bench = Bench::new(Gantry::default(), CellOptions { radio_delay, ..CellOptions::default() });
        bench.controller.move_joints(&plan(1)[0].joints).unwrap();
        bench.gauge.read().unwrap()
    };
    assert_eq!(shown(300.0), [6e-3; 3], "the receiver keeps the last value");
    assert!(shown(0.0).iter().all(|value| value.abs() < 2e-3));
}

#[test]
fn a_slow_radio_is_waited_for() {
    let mut bench = Bench::new(Gantry::default(), CellOptions { radio_delay: 4e-3, ..CellOptions::default() });
    assert!(bench.cell.gauge_url().contains("settle_ms=6"), "{}", bench.cell.gauge_url());
    bench.run(&plan(4), &options()).unwrap();
    assert!(bench.rows.iter().all(|row| off(row, 0.0).iter().all(|d| *d < 2e-6)));
}

#[test]
fn repeat_visits_come_from_both_sides_without_corrections() {
    let mut bench = bench();
    let plan = plan(3);
    let rounds = visits(&plan, 4);
    let options = ProcedureOptions { retreat: Retreat::Approach, stride: Some(stride(&plan)), ..options() };
    let report = bench.run(&rounds, &options).unwrap();
    assert_eq!(report.measured, 12);
    let of = |place: u64| bench.rows.iter().filter(move |row| row.seq.unwrap() % 3 == place).collect::<Vec<_>>();
    for place in 0..3 {
        let senses: Vec<[i8; 9]> = of(place).iter().map(|row| row.state.dir.unwrap()).collect();
        // the gantry's linear joints bring the device to the ball
        let linear = |visit: usize| senses[visit][..3].to_vec();
        let turned: Vec<i8> = linear(2).iter().map(|sense| -sense).collect();
        assert_eq!(linear(1), turned, "place {place}: every other visit comes from beyond");
        assert_eq!(linear(1), linear(3), "place {place}");
    }
}

#[test]
fn an_arm_that_was_jogged_between_touches_is_noticed_and_left_alone() {
    let Bench { cell, mut gauge, mut controller, mut rows, .. } = bench();
    let cancel = AtomicBool::new(false);
    let mut motions = 0;
    let mut watch = |event| {
        if matches!(event, Progress::Begin { index: 1, .. }) {
            motions = cell.motions();
            cell.inject(Fault::Jogged { joint: 3, by_mdeg: 14_000 });
        }
    };
    let error =
        run(&plan(3), (gauge.as_mut(), controller.as_mut()), &mut rows, &options(), &cancel, &mut watch).unwrap_err();
    assert!(matches!(error.violation(), Some(Violation::Elsewhere { joint: 4, .. })), "{error}");
    assert!(error.to_string().contains("something else has moved the arm; the arm is left where it stands"), "{error}");
    assert_eq!((cell.motions(), rows.len()), (motions, 1));
}

#[test]
fn a_way_back_that_the_guard_refuses_is_not_driven() {
    let Bench { cell, mut gauge, mut controller, mut rows, .. } = bench();
    let cancel = AtomicBool::new(false);
    let closed = AtomicBool::new(false);
    let guard = |_: &Joints, _: &Joints, _: Option<usize>| {
        if closed.load(Ordering::Relaxed) { Err("the gate is closed".to_owned()) } else { Ok(()) }
    };
    let mut motions = 0;
    let mut watch = |event| {
        if matches!(event, Progress::Reading { index: 1, .. }) {
            motions = cell.motions();
            closed.store(true, Ordering::Relaxed);
            cancel.store(true, Ordering::Relaxed);
        }
    };
    let options = ProcedureOptions { guard: Some(&guard), ..options() };
    let error =
        run(&plan(3), (gauge.as_mut(), controller.as_mut()), &mut rows, &options, &cancel, &mut watch).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("could NOT go back") && text.contains("the gate is closed) and was not driven"), "{text}");
    assert_eq!(cell.motions(), motions, "{text}");
}

#[test]
fn every_motion_is_asked_of_the_guard_from_where_the_arm_is() {
    let mut bench = bench();
    let asked = std::sync::Mutex::new(Vec::new());
    let guard = |from: &Joints, to: &Joints, touched: Option<usize>| {
        asked.lock().unwrap().push((*from, *to, touched));
        Ok(())
    };
    let plan = plan(3);
    let rounds = visits(&plan, 2);
    let options =
        ProcedureOptions { retreat: Retreat::Approach, stride: Some(stride(&plan)), guard: Some(&guard), ..options() };
    let report = bench.run(&rounds, &options).unwrap();
    let asked = asked.into_inner().unwrap();
    let motions = bench.cell.motions() as usize - report.corrections;
    // each plan's way is asked for before anything moves, and each motion when it is made; some are asked for twice
    assert!(asked.len() >= motions + rounds.len(), "{} of {motions}", asked.len());
    // the way out of a touch too, from where the corrections have led
    let out = |row: &Row| asked.iter().any(|(from, _, touched)| *from == row.state.q && touched.is_some());
    assert!(bench.rows.iter().all(out));
}

#[test]
fn an_arm_that_stands_at_a_touch_leaves_it_on_a_way_that_the_guard_allows() {
    let start = plan(1)[0].joints;
    let cell =
        VirtualCell::start(Box::new(Gantry::default()), CellOptions { start, ..CellOptions::default() }).unwrap();
    let mut bench = Bench { cell, ..bench() };
    bench.gauge = open_gauge(&bench.cell.gauge_url()).unwrap();
    bench.controller = open_controller(&bench.cell.controller_url()).unwrap();
    let refuse = |from: &Joints, to: &Joints, _: Option<usize>| {
        let leaves = (from[0] - start[0]).abs() < 1e-6 && *to == plan(1)[0].via[1];
        if leaves { Err("stem y would come within 2 mm of post 1".to_owned()) } else { Ok(()) }
    };
    let error = bench.run(&plan(2), &ProcedureOptions { guard: Some(&refuse), ..options() }).unwrap_err();
    assert!(matches!(error, ProcedureError::Leave { .. }), "{error}");
    assert!(error.to_string().contains("post 1) and was not driven; jog the arm by hand"), "{error}");
    assert_eq!(bench.cell.motions(), 0);
}

#[test]
fn a_stem_that_does_not_follow_is_no_measurement() {
    // in free air it reads as if it touched
    let mut stuck = bench();
    let error = stuck.fails(Fault::StuckStem { axis: 0 });
    assert!(matches!(error.violation(), Some(Violation::NotFree { axis: 'x', .. })), "{error}");
    assert!(stuck.rows.is_empty());
    // it sticks while it touches, which looks like the end of the corrections
    let Bench { cell, mut gauge, mut controller, mut rows, .. } = bench();
    let cancel = AtomicBool::new(false);
    let mut watch = |event| {
        if matches!(event, Progress::Reading { index: 1, corrections: 0, .. }) {
            cell.inject(Fault::StuckStem { axis: 1 });
        }
    };
    let error =
        run(&plan(3), (gauge.as_mut(), controller.as_mut()), &mut rows, &options(), &cancel, &mut watch).unwrap_err();
    assert!(matches!(error.violation(), Some(Violation::NoResponse { axis: 'y', .. })), "{error}");
    assert_eq!(rows.len(), 1);
    // with no point in free air before the touch, it has to follow a step aside
    let mut stuck = bench();
    let entry = PlanEntry { via: vec![], ..plan(1).remove(0) };
    stuck.cell.inject(Fault::StuckStem { axis: 2 });
    let error = stuck.run(&[entry], &options()).unwrap_err();
    assert!(matches!(error.violation(), Some(Violation::Stale { axis: 'z', .. })), "{error}");
    assert!(stuck.rows.is_empty());
}

#[test]
fn stems_that_stick_about_zero_are_noticed_before_a_touch_is_far_off() {
    // what the gantry's joints are worth is known exactly; with less than 0.13 mm to each side no touch is off by more than that
    for (within_um, noticed) in [(600, 10), (300, 10), (200, 10), (120, 0)] {
        let mut stopped = 0;
        for seed in 0..10 {
            let error = std::array::from_fn(|k| (0.7 + 0.1 * f64::from(seed) + k as f64).sin() * 0.5e-3);
            let mut bench = Bench::new(Gantry { error, ..Gantry::default() }, CellOptions::default());
            (0..3).for_each(|axis| bench.cell.inject(Fault::StickingStem { axis, within_um }));
            let options = ProcedureOptions { epsilon: 20e-6, repeatability: 10e-6, ..options() };
            let ended = bench.run(&plan(15), &options);
            let error = Vector3::from(error);
            let far = bench.rows.iter().map(|row| {
                let Measured::Touch { ball, reading } = row.measured else { panic!("no touch") };
                let off = nominal(&row.state.q).apply(&Vector3::from(reading)) + error - Vector3::from(BALLS[ball]);
                (rotation(&row.state.q).transpose() * off).amax()
            });
            let far = far.fold(0.0, f64::max);
            assert!(far < 0.14e-3, "{within_um} {seed}: off by {far}");
            stopped += usize::from(ended.is_err_and(|e| matches!(e.violation(), Some(Violation::WrongChange { .. }))));
        }
        assert!(stopped >= noticed, "{within_um}: {stopped}");
    }
}

#[test]
fn a_clock_that_jumps_leaves_the_rows_in_order() {
    // ten hours, too: no motion takes an hour while this computer counts seconds
    for seconds in [36_000, 4_000_000_000, -5_000_000_000, i64::MAX] {
        let Bench { cell, mut gauge, mut controller, mut rows, .. } = bench();
        let cancel = AtomicBool::new(false);
        let mut watch = |event| {
            if matches!(event, Progress::Begin { index: 1, .. }) {
                cell.inject(Fault::ClockJump { seconds });
            }
        };
        let report = run(&plan(4), (gauge.as_mut(), controller.as_mut()), &mut rows, &options(), &cancel, &mut watch);
        let report = report.unwrap();
        assert!(report.warnings.iter().any(|w| w.contains("the controller's clock has jumped")), "{report:?}");
        let times: Vec<f64> = rows.iter().map(|row| row.state.t.unwrap()).collect();
        assert!(times.windows(2).all(|t| t[0] <= t[1]) && times[3] < 1e4, "{times:?}");
    }
}

#[test]
fn corrections_are_asked_of_the_guard_before_they_are_made() {
    let refuses = |far: bool| {
        let mut bench = bench();
        let corrected = |at: &Joints, by: [f64; 3]| {
            let mut to = *at;
            to[4] += if far { 1.0 } else { by[0].abs() };
            Ok(to)
        };
        let guard = |from: &Joints, to: &Joints, _: Option<usize>| {
            let correction = from[4] != to[4] && from[3] == to[3] && from[0] == to[0];
            if correction { Err("the housing would meet the post".to_owned()) } else { Ok(()) }
        };
        let options = ProcedureOptions { guard: Some(&guard), corrected: Some(&corrected), ..options() };
        let report = bench.run(&plan(1), &options).unwrap_err();
        assert!(bench.rows.is_empty());
        report.to_string()
    };
    assert!(refuses(false).contains("the housing would meet the post) and was not driven"), "{}", refuses(false));
    assert!(refuses(true).contains("turns joint 5 by 57.296 deg"), "{}", refuses(true));
}

#[test]
fn a_correction_of_which_nobody_knows_where_it_leads_is_not_made() {
    let mut bench = bench();
    let corrected = |_: &Joints, _: [f64; 3]| Err("joint 5 would have to be at 121.0 deg".to_owned());
    let options = ProcedureOptions { corrected: Some(&corrected), ..options() };
    let error = bench.run(&plan(1), &options).unwrap_err().to_string();
    assert!(
        error.contains("the correction: joint 5 would have to be at 121.0 deg") && bench.rows.is_empty(),
        "{error}"
    );
}

#[test]
fn after_the_first_request_to_stop_no_motion_begins_but_those_that_lead_back() {
    let corrected = |at: &Joints, _: [f64; 3]| Ok(*at);
    let (mut led_back, mut n) = (0, 0);
    loop {
        n += 1;
        let Bench { mut gauge, mut controller, mut rows, cell: _cell, .. } = bench();
        let stops = StopCount::default();
        controller.stop_when(Arc::clone(&stops));
        let moves: RefCell<Vec<[Joints; 2]>> = RefCell::default();
        let begun = Cell::new(false);
        let guard = |from: &Joints, to: &Joints, _: Option<usize>| {
            // the whole plan is asked for beforehand
            if !begun.get() {
                return Ok(());
            }
            moves.borrow_mut().push([*from, *to]);
            // what has looked whether it is to stop has done so
            if moves.borrow().len() == n {
                stops.ask();
            }
            Ok(())
        };
        let asks = ProcedureOptions {
            guard: Some(&guard),
            corrected: Some(&corrected),
            stops: Some(Arc::clone(&stops)),
            ..options()
        };
        let never = AtomicBool::new(false);
        let ended =
            run(&plan(2), (gauge.as_mut(), controller.as_mut()), &mut rows, &asks, &never, &mut |_| begun.set(true));
        let moves = moves.take();
        if moves.len() < n {
            break;
        }
        assert!(ended.unwrap_err().is_cancelled());
        let (before, after) = moves.split_at(n);
        let near = |a: &Joints, b: &Joints| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
        let stood = before[n - 1][0];
        assert!(after.first().is_none_or(|[from, _]| near(from, &stood)), "motion {n} began");
        let been = |q: &Joints| before[..n - 1].iter().flatten().chain([&stood]).any(|b| near(q, b));
        assert!(after.iter().all(|[_, to]| been(to)), "{n}: somewhere new");
        led_back += usize::from(!after.is_empty());
    }
    assert!(n > 10 && led_back > 8, "{n} {led_back}");
}

#[test]
fn a_temperature_that_no_cell_has_is_not_recorded() {
    let mut bench = Bench::new(Gantry { hotter: 5000.0, ..Gantry::default() }, CellOptions::default());
    let report = bench.run(&plan(2), &ProcedureOptions { temp_c: Some(21.0), ..options() }).unwrap();
    assert!(bench.rows.iter().all(|row| row.state.temp_c == Some(21.0)));
    assert_eq!(report.warnings.len(), 1, "{:?}", report.warnings);
    assert!(report.warnings[0].contains("degC, which is not recorded"), "{:?}", report.warnings);
}

#[test]
fn a_zero_that_has_moved_since_an_earlier_run_is_seen_at_the_first_touch() {
    let mut bench = bench();
    let before = |free| ProcedureOptions { free: Some([free; 3]), ..options() };
    let error = bench.run(&plan(1), &before(5.7e-3)).unwrap_err();
    assert!(matches!(error.violation(), Some(Violation::ZeroMoved { axis: 'x', .. })), "{error}");
    assert!(bench.rows.is_empty());
    bench.run(&plan(1), &before(6e-3)).unwrap();
}

/// An arm whose joints are never read twice the same, and that sends them while it stands, too.
struct Noisy(Box<dyn Controller>, u32);

impl Noisy {
    fn shaken(&mut self, mut q: Joints) -> Joints {
        for (k, q) in q.iter_mut().take(6).enumerate() {
            self.1 = self.1.wrapping_mul(1_664_525).wrapping_add(1_013_904_223 + k as u32);
            *q += 1e-5 * (f64::from(self.1 >> 8) / f64::from(1 << 24) - 0.5);
        }
        q
    }
}

impl Controller for Noisy {
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
        let q = self.0.joints()?;
        Ok(self.shaken(q))
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
    fn joint_settle(&self) -> JointSettle {
        JointSettle { interval: std::time::Duration::ZERO, ..self.0.joint_settle() }
    }
    fn take_history(&mut self) -> Vec<JointSample> {
        let history = self.0.take_history();
        let standing = history.first().map(|first| JointSample { t: first.t - 5.0, q: first.q });
        standing.into_iter().chain(history).map(|s| JointSample { t: s.t, q: self.shaken(s.q) }).collect()
    }
}

#[test]
fn the_noise_of_an_arm_that_stands_is_neither_a_motion_nor_a_jump_of_its_clock() {
    let directions = |noisy: bool| {
        let mut bench = bench();
        if noisy {
            bench.controller = Box::new(Noisy(bench.controller, 1));
        }
        let report = bench.run(&plan(9), &ProcedureOptions { epsilon: 30e-6, ..options() }).unwrap();
        assert_eq!(report.warnings, Vec::<String>::new());
        bench.rows.iter().map(|row| row.state.dir.unwrap()).collect::<Vec<_>>()
    };
    assert_eq!(directions(true), directions(false));
}

#[test]
fn a_receiver_behind_a_device_server_is_measured_with_as_one_on_a_serial_port() {
    let touched = |gauge_port| {
        let mut bench = Bench::new(Gantry::default(), CellOptions { gauge_port, ..CellOptions::default() });
        let is_tcp = bench.cell.gauge_place().starts_with("127.0.0.1:");
        bench.run(&plan(6), &options()).unwrap();
        (is_tcp, bench.rows.iter().map(|row| format!("{:?}", row.measured)).collect::<Vec<_>>())
    };
    let [(_, serial), (is_tcp, network)] = [None, Some(0)].map(touched);
    assert!(is_tcp && !network.is_empty());
    assert_eq!(serial, network);
}

#[test]
fn a_receiver_behind_a_device_server_hears_who_comes_next_and_a_taken_port_is_told() {
    let options = CellOptions { gauge_port: Some(0), ..CellOptions::default() };
    let mut bench = Bench::new(Gantry::default(), options.clone());
    let before = bench.gauge.read().unwrap();
    bench.gauge = open_gauge(&bench.cell.gauge_url()).unwrap();
    assert_eq!(bench.gauge.read().unwrap(), before);

    let place = bench.cell.gauge_place().to_owned();
    let port = place.rsplit_once(':').unwrap().1.parse().ok();
    let taken = VirtualCell::start(Box::new(Gantry::default()), CellOptions { gauge_port: port, ..options });
    let expected =
        format!("virtual receiver: port {place} is in use by another program; choose another port, or 0 for any");
    assert_eq!(taken.err().map(|e| e.to_string()), Some(expected));

    drop(bench);
    let said = open_gauge(&format!("uwave://{place}")).err().map(|e| e.to_string()).unwrap_or_default();
    assert!(said.starts_with(&format!("gauge port {place}: cannot be opened (Connection refused")), "{said}");
}
