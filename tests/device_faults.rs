//! Two hundred scripted fault runs of the whole procedure: each ends complete or with a clear stop, the arm stays within its
//! limits, what was recorded is right, and the rest can be measured once the fault is gone.

use std::collections::BTreeMap;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_device::gauge::uwave_protocol::Status;
use trical_device::procedure::{Retreat, RetreatOutcome};
use trical_device::session::Settings;
use trical_device::virtual_cell::{Scheduled, When};
use trical_device::{
    ArmPlant, CellOptions, Fault, PlanEntry, Plant, ProcedureError, ProcedureOptions, Progress, Session, VirtualCell,
    open_controller, open_gauge, run,
};
use trical_diagnose::truth::{draw_truth, hide};
use trical_ident::{Dataset, JointSource, ParameterSet, identify};
use trical_model::{Cell, Forward, Joints, Measured, Model, Pose, Recording, Robot, Row, State};
use trical_plan::{CollisionModel, MotionWorkspace, PlanOptions, plan_touches, write_plan};
use trical_recording::mcap::Header;
use trical_recording::{RecordingWriter, read_recording};

/// As many as the environment asks for with `TRICAL_FAULT_RUNS`.
fn runs() -> u64 {
    std::env::var("TRICAL_FAULT_RUNS").map_or(200, |text| text.parse().unwrap())
}

/// Watches where the arm is.
struct Watched {
    arm: ArmPlant,
    limits: Vec<[f64; 2]>,
    /// A collision model of its own, at the side of the controller, and where the arm stood before.
    collision: CollisionModel,
    stood: Joints,
    outside: Arc<AtomicBool>,
}

impl Plant for Watched {
    fn joints(&self) -> usize {
        self.arm.joints()
    }
    fn balls(&self) -> usize {
        self.arm.balls()
    }
    fn offset_to_ball(&mut self, state: &State, ball: usize) -> [f64; 3] {
        let within = state.q.iter().zip(&self.limits).all(|(q, [low, high])| (*low..=*high).contains(q));
        self.outside.fetch_or(!within, Ordering::Relaxed);
        let from = std::mem::replace(&mut self.stood, state.q);
        if from != state.q {
            // near a ball the stems may meet that one
            let free = |touched| {
                let scratch = &mut MotionWorkspace::new(&self.collision);
                self.collision.check_motion(&from, &state.q, touched, scratch).is_none()
            };
            let free = free(None) || (0..self.arm.balls()).any(|ball| free(Some(ball)));
            self.outside.fetch_or(!free, Ordering::Relaxed);
        }
        self.arm.offset_to_ball(state, ball)
    }
    fn tcp(&mut self, state: &State) -> Pose {
        self.arm.tcp(state)
    }
    fn nominal_tcp(&self, q: &Joints) -> Pose {
        self.arm.nominal_tcp(q)
    }
    fn nominal_inverse(&self, world_from_tool: &Pose, seed: &Joints) -> Option<Joints> {
        self.arm.nominal_inverse(world_from_tool, seed)
    }
    fn temperature(&mut self, t: f64) -> Option<f64> {
        self.arm.temperature(t)
    }
}

/// What all runs share.
struct Bench {
    robot: Robot,
    cell: Cell,
    truth: Model,
    plan: Vec<PlanEntry>,
    /// The same as a file.
    plan_csv: String,
    collision: CollisionModel,
}

impl Bench {
    fn new() -> Self {
        let robot = Robot::parse(include_str!("../cells/irb120/robot.toml"), "robot.toml").unwrap();
        let cell = Cell::parse(include_str!("../cells/irb120/cell.toml"), "cell.toml").unwrap();
        let touch = |ball| Row {
            state: State::at(&[0.0; 9]),
            measured: Measured::Touch { ball, reading: [0.0; 3] },
            seq: None,
            line: 0,
        };
        let recording =
            Recording { name: "plan".into(), joints: 6, rows: (0..3).map(touch).collect(), ..Recording::default() };
        let data = Dataset::build(&[recording], JointSource::Read, None).unwrap();
        let mut nominal = Model::nominal(robot.clone(), cell.clone());
        nominal.terms =
            trical_ident::fit::identifiability::independent_terms(&nominal, &data, &ParameterSet::Compliance.into())
                .unwrap()
                .0;
        let options = PlanOptions {
            per_ball: 6,
            pool_per_ball: 60,
            parameters: Some(nominal.terms.clone()),
            start: Some([0.0; 9]),
            ..PlanOptions::default()
        };
        let planned = plan_touches(&robot, &cell, &options, &trical_model::Task::silent()).unwrap();
        let plan_csv = write_plan(&robot, &planned.entries);
        let plan = planned
            .entries
            .iter()
            .map(|e| PlanEntry {
                index: e.index as u64,
                ball: e.ball,
                joints: e.joints,
                via: e.via.iter().copied().chain(std::iter::once(e.approach)).collect(),
            })
            .collect();
        let truth = draw_truth(&nominal, 5).unwrap();
        let collision = CollisionModel::new(&robot, &cell).unwrap().with_margin(2e-3);
        Self { robot, cell, truth, plan, plan_csv, collision }
    }

    fn start(&self, seed: u64, script: Vec<Scheduled>, start: Joints, outside: &Arc<AtomicBool>) -> VirtualCell {
        self.start_at_pace(0.0, seed, script, start, outside)
    }

    /// With motions that take real time.
    fn start_at_pace(
        &self,
        pace: f64,
        seed: u64,
        script: Vec<Scheduled>,
        start: Joints,
        outside: &Arc<AtomicBool>,
    ) -> VirtualCell {
        let limits = self.robot.joints.iter().map(|j| j.limits).collect();
        let arm = ArmPlant::new(&self.truth).unwrap();
        let options = CellOptions { pace, script, start, ..CellOptions::like_a_real_one(&self.truth, seed, 0) };
        // corrections may use some of the clearance that the guard keeps
        let collision = self.collision.clone().with_margin(1e-3);
        let watched = Watched { arm, limits, collision, stood: start, outside: Arc::clone(outside) };
        VirtualCell::start(Box::new(watched), options).unwrap()
    }

    /// One run, taken up where there is a recording. Time-outs are long enough for a busy machine where all is well.
    fn measure(&self, cell: &VirtualCell, path: &std::path::Path, seconds: f64) -> Result<(), String> {
        let guard = |from: &Joints, to: &Joints, touched| {
            let hit = self.collision.check_motion(from, to, touched, &mut MotionWorkspace::new(&self.collision));
            hit.map_or(Ok(()), |_| Err("the collision model refuses".to_owned()))
        };
        let nominal = Forward::new(Model::nominal(self.robot.clone(), self.cell.clone()), Vec::new()).unwrap();
        let tool = |q: &Joints| nominal.world_from_tool(&State::at(q), &mut nominal.workspace());
        let elsewhere = |at: &Joints, reading: [f64; 3], there: &Joints| {
            tool(there).inverse().apply(&tool(at).apply(&reading.into())).into()
        };
        let mut options = ProcedureOptions {
            go: true,
            retreat: Retreat::Approach,
            tcp_in_flange: Some(self.cell.tool.tcp.into()),
            guard: Some(&guard),
            elsewhere: Some(&elsewhere),
            ..ProcedureOptions::default()
        };
        options.limits.correction = 4.9e-3;
        options.limits.joints = self.robot.joints.iter().map(|j| (j.limits[0], j.limits[1])).collect();
        let (mut log, before) = RecordingWriter::resume(path, &Header::for_joints(6)).map_err(|e| e.to_string())?;
        if let Some(before) = before {
            options.skip = before.done();
            options.begin_t = log.last_t();
        }
        let milliseconds = seconds * 1e3;
        let gauge = open_gauge(&format!("{}&timeout_ms={milliseconds}", cell.gauge_url()));
        let controller =
            open_controller(&format!("{}&timeout_s={seconds}&move_timeout_s={seconds}", cell.controller_url()));
        let (mut gauge, mut controller) = (gauge.map_err(|e| e.to_string())?, controller.map_err(|e| e.to_string())?);
        let never = AtomicBool::new(false);
        let start = cell.state().q;
        let result = run(&self.plan, (gauge.as_mut(), controller.as_mut()), &mut log, &options, &never, &mut |_| ());
        let stopped = cell.state().q;
        if let Err(ProcedureError::Touch { retreat: RetreatOutcome::Done, .. }) = &result {
            let free = |q: &Joints| q.iter().zip(&stopped).all(|(a, b)| (a - b).abs() < 1e-6);
            let began = start.iter().zip(&stopped).all(|(a, b)| (a - b).abs() < 1e-6);
            assert!(
                began || self.plan.iter().any(|e| e.via.iter().any(free)),
                "it says that the arm went back: {result:?}"
            );
        }
        log.finish().map_err(|e| e.to_string())?;
        result.map(|_| ()).map_err(|e| e.to_string())
    }
}

/// A script by chance: one fault, sometimes two, of any kind, at any time, for a while or for good.
fn script(rng: &mut Pcg64Mcg) -> Vec<Scheduled> {
    let count = if rng.random_range(0..4) == 0 { 2 } else { 1 };
    (0..count)
        .map(|_| {
            let axis = rng.random_range(0..3);
            let statuses = [
                Status::InstrumentSilent,
                Status::Unregistered,
                Status::DataLost,
                Status::Disconnected,
                Status::NoData,
                Status::BadRequest,
            ];
            let fault = match rng.random_range(0..21) {
                0 => Fault::Silence,
                1 => Fault::Garbage,
                2 => Fault::Unsolicited,
                3 => Fault::DropBytes { per_mille: rng.random_range(1..50) },
                4 => Fault::DoubleBytes { per_mille: rng.random_range(1..50) },
                5 => Fault::GarbleBytes { per_mille: rng.random_range(1..30) },
                6 => Fault::Late { milliseconds: rng.random_range(1..12) },
                7 => Fault::Pieces,
                8 | 9 => Fault::Stale { axis },
                10 => Fault::Status { axis, status: statuses[rng.random_range(0..statuses.len())], times: 0 },
                11 => Fault::BatteryLow { axis },
                12 => Fault::SwappedAxes,
                13 => Fault::FlippedAxis { axis },
                14 => Fault::BallsRemoved,
                15 => Fault::SlippedPlate { by_um: std::array::from_fn(|_| rng.random_range(-300..300)) },
                16 => Fault::RefuseMoves,
                17 => {
                    if rng.random_range(0..2) == 0 {
                        Fault::StuckArm
                    } else {
                        Fault::Stall
                    }
                }
                18 => Fault::StuckStem { axis },
                19 => Fault::ClockJump { seconds: [-5_000_000_000, -3, 40, 4_000_000_000][rng.random_range(0..4)] },
                _ => Fault::DropConnection,
            };
            let (when, most) = match rng.random_range(0..4) {
                0 => (When::Readings(rng.random_range(0..600)), 200),
                1 => (When::Commands(rng.random_range(10..600)), 200),
                2 => (When::Seconds(f64::from(rng.random_range(0..500))), 100),
                _ => (When::Motions(rng.random_range(0..80)), 20),
            };
            let lasts = (rng.random_range(0..3) > 0).then(|| f64::from(rng.random_range(1..most)));
            Scheduled { when, lasts, fault }
        })
        .collect()
}

/// How far a script moves the balls, m, if it does.
fn slip(script: &[Scheduled]) -> Option<f64> {
    script.iter().find_map(|s| match s.fault {
        Fault::SlippedPlate { by_um } => Some(by_um.map(|v| (f64::from(v) * 1e-6).powi(2)).iter().sum::<f64>().sqrt()),
        _ => None,
    })
}

/// All runs, by their seeds: most of a run is waiting for time-outs.
fn eight_at_once(runs: u64, one: &(impl Fn(u64) + Sync)) {
    std::thread::scope(|scope| {
        for part in 0..8 {
            scope.spawn(move || (0..runs).filter(|seed| seed % 8 == part).for_each(one));
        }
    });
}

/// How far a recorded touch is from what the true arm does: the length of the residual, m.
fn misfit(truth: &Forward, rows: &[Row]) -> f64 {
    let mut ws = truth.workspace();
    let far = rows.iter().map(|row| {
        truth.residual(&row.state, &row.measured, 0, &mut ws);
        ws.residual().iter().take(3).map(|r| r * r).sum::<f64>().sqrt()
    });
    far.fold(0.0, f64::max)
}

#[test]
fn two_hundred_fault_runs_end_complete_or_with_a_clear_stop() {
    let bench = Bench::new();
    let truth = Forward::new(bench.truth.clone(), Vec::new()).unwrap();
    let total = bench.plan.len();
    let outside = Arc::new(AtomicBool::new(false));
    let runs = runs();
    let (complete, stops) = (AtomicUsize::new(0), std::sync::Mutex::new(BTreeMap::<String, usize>::new()));
    let one = |seed: u64| {
        let mut rng = Pcg64Mcg::seed_from_u64(1000 + seed);
        let script = script(&mut rng);
        let slip = slip(&script);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let cell = bench.start(seed, script.clone(), [0.0; 9], &outside);
        let says = |what: &str| format!("run {seed}, {script:?}: {what}");
        match bench.measure(&cell, &path, 0.12) {
            Ok(()) => {
                complete.fetch_add(1, Ordering::Relaxed);
            }
            Err(error) => {
                assert!(error.len() > 20 && !error.contains('\n'), "{}", says(&error));
                let words = error.split("; ").last().unwrap_or_default();
                let kind: String = words.split(" (").next().unwrap_or_default().chars().take(60).collect();
                *stops.lock().unwrap().entry(kind).or_insert(0) += 1;
            }
        }
        let before = read_recording(&path).unwrap();
        // the fault is mended: the arm stands where it stands, everything else is as at the start
        let stands = cell.state().q;
        drop(cell);
        let mut last = String::new();
        for attempt in 0..3_u64 {
            let cell = bench.start(seed + 500 * (attempt + 1), Vec::new(), stands, &outside);
            match bench.measure(&cell, &path, 3.0) {
                Ok(()) => {
                    last.clear();
                    break;
                }
                Err(error) => last = error,
            }
        }
        let after = read_recording(&path).unwrap();
        assert_eq!(after.recording.rows[..before.recording.rows.len()], before.recording.rows[..], "{}", says("lost"));
        if !last.is_empty() {
            // an arm that was left among the balls by a broken connection may have to be jogged out by hand
            assert!(last.contains("the collision model refuses"), "{}", says(&last));
            *stops.lock().unwrap().entry("left where only a person gets it out".to_owned()).or_insert(0) += 1;
        } else {
            let numbers: Vec<u64> = after.recording.rows.iter().map(|row| row.seq.unwrap()).collect();
            let planned: Vec<u64> = bench.plan.iter().map(|entry| entry.index).collect();
            assert_eq!(numbers, planned, "{}", says("rows"));
        }
        let allowed = 60e-6 + slip.unwrap_or(0.0);
        let far = misfit(&truth, &after.recording.rows);
        assert!(far < allowed, "{}", says(&format!("a touch is off by {:.4} mm", far * 1e3)));
        if slip.is_none() && after.recording.rows.len() == total {
            let data = Dataset::build(&[after.recording], JointSource::Read, None).unwrap();
            let fitted = identify(&bench.robot, &bench.cell, &data, ParameterSet::Compliance).unwrap();
            let fitted = Forward::new(fitted.model.clone(), Vec::new()).unwrap();
            let (mut a, mut b) = (truth.workspace(), fitted.workspace());
            for row in &bench.plan {
                let state = State::at(&row.joints);
                let off = truth.world_from_tool(&state, &mut a).translation
                    - fitted.world_from_tool(&state, &mut b).translation;
                assert!(off.norm() < 0.1e-3, "{}", says(&format!("identified {:.4} mm off", off.norm() * 1e3)));
            }
        }
    };
    eight_at_once(runs, &one);
    assert!(!outside.load(Ordering::Relaxed), "the arm was outside its limits");
    let complete = complete.load(Ordering::Relaxed);
    println!("{runs} runs: {complete} complete at once; the others ended with");
    for (kind, count) in stops.lock().unwrap().iter() {
        println!("  {count:>4}  {kind}");
    }
    assert!(
        (runs / 10..runs * 9 / 10).contains(&(complete as u64)),
        "faults that always or never matter test nothing: {complete}"
    );
}

#[test]
fn the_stems_of_drawn_arms_with_gaps_and_ripples_are_not_said_to_stick() {
    let mut bench = Bench::new();
    let drawn = bench.truth.clone();
    let mut complete = 0;
    for seed in 0..20 {
        bench.truth = draw_truth(&drawn, 70 + seed).unwrap();
        let mut wishes = vec![format!("lost_motion_direction@{}*0.4", 1 + seed % 6)];
        wishes.extend((1..=6).map(|joint| format!("gear_ripple@{joint}/{}", 60 + 30 * joint)));
        hide(&mut bench.truth, &wishes).unwrap();
        bench.truth.cell.balls.iter_mut().for_each(|ball| *ball += Vector3::new(1e-3, -0.5e-3, 0.5e-3));
        let folder = tempfile::tempdir().unwrap();
        let outside = Arc::new(AtomicBool::new(false));
        let cell = bench.start(seed, Vec::new(), [0.0; 9], &outside);
        // where a gap keeps touches from closing, or an arm is off too far, it ends otherwise
        match bench.measure(&cell, &folder.path().join("run.mcap"), 5.0) {
            Ok(()) => complete += 1,
            Err(error) => assert!(!error.contains("just before the touch"), "{seed}: {error}"),
        }
    }
    assert!(complete > 15, "{complete} of 20");
}

/// The program itself, against a cell: its exit code, and what it said. `end` ends it: a signal, and after how long.
fn program(
    folder: &std::path::Path,
    cell: &VirtualCell,
    wrong: &str,
    end: Option<(&str, u64)>,
) -> (Option<i32>, String) {
    let gauge = format!("{}&timeout_ms=1000", cell.gauge_url());
    let controller = format!("{}{wrong}&timeout_s=3&move_timeout_s=20", cell.controller_url());
    let mut command = Command::new(env!("CARGO_BIN_EXE_trical"));
    command.args("measure --robot robot.toml --cell cell.toml --plan plan.csv --out run.mcap".split(' '));
    command.args(["--go", "--gauge", &gauge, "--controller", &controller]).current_dir(folder);
    if folder.join("run.mcap").exists() {
        command.arg("--resume");
    }
    let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    if let Some((signal, milliseconds)) = end {
        std::thread::sleep(Duration::from_millis(milliseconds));
        Command::new("kill").args([signal, &child.id().to_string()]).stderr(Stdio::null()).status().unwrap();
    }
    let o = child.wait_with_output().unwrap();
    (o.status.code(), String::from_utf8_lossy(&o.stderr).into_owned())
}

/// A quarter as many as of the other kind: the program is killed, interrupted or hung up on at any moment, in the middle of motions
/// that take real time, with and without another fault, and now and then does not know the secret at first.
#[test]
fn sessions_that_are_killed_at_any_moment_are_gone_on_with() {
    let bench = Bench::new();
    let truth = Forward::new(bench.truth.clone(), Vec::new()).unwrap();
    let outside = Arc::new(AtomicBool::new(false));
    let runs = runs().div_ceil(4);
    let told = std::sync::Mutex::new(BTreeMap::<&str, usize>::new());
    let count = |kind: &'static str| *told.lock().unwrap().entry(kind).or_insert(0) += 1;
    let one = |seed: u64| {
        let mut rng = Pcg64Mcg::seed_from_u64(90_000 + seed);
        let faults = if rng.random_range(0..2) == 0 { script(&mut rng) } else { Vec::new() };
        let slip = slip(&faults);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        for (name, text) in [
            ("robot.toml", include_str!("../cells/irb120/robot.toml")),
            ("cell.toml", include_str!("../cells/irb120/cell.toml")),
            ("plan.csv", bench.plan_csv.as_str()),
        ] {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        let mut says = format!("killed run {seed}, {faults:?}");
        let cell = bench.start_at_pace(0.02, seed, faults, [0.0; 9], &outside);
        if rng.random_range(0..10) == 0 {
            let (code, error) = program(folder.path(), &cell, "x", None);
            assert!(code == Some(2) && error.contains("wrong secret") && cell.motions() == 0, "{says}: {error}");
            count("did not know the secret");
        }
        let signal = ["-KILL", "-KILL", "-INT", "-TERM", "-HUP"][rng.random_range(0..5)];
        let end = (signal, rng.random_range(20..4000));
        let (code, error) = program(folder.path(), &cell, "", Some(end));
        says += &format!(", {end:?}: {code:?} {error}");
        count(match code {
            Some(0) => "complete before",
            None => "killed",
            Some(_) => "ended in order",
        });
        // what is on disk is whole; the arm stands where the controller stopped it when its client was gone
        std::thread::sleep(Duration::from_millis(100));
        let recorded = || if path.exists() { read_recording(&path).unwrap().recording.rows } else { Vec::new() };
        let before = recorded();
        let stands = cell.state().q;
        let at = |q: &Joints| q.iter().zip(&stands).all(|(a, b)| (a - b).abs() < 1e-3);
        if !at(&[0.0; 9]) && !bench.plan.iter().any(|e| at(&e.joints) || e.via.iter().any(at)) {
            count("of these stopped between two places of the plan");
        }
        drop(cell);
        let mut last = (None, String::new());
        for attempt in 0..3_u64 {
            let cell = bench.start(seed + 500 * (attempt + 1), Vec::new(), stands, &outside);
            last = program(folder.path(), &cell, "", None);
            if last.0 == Some(0) {
                break;
            }
        }
        let after = recorded();
        assert_eq!(after[..before.len()], before[..], "{says}: lost");
        if last.0 == Some(0) {
            let numbers: Vec<u64> = after.iter().map(|row| row.seq.unwrap()).collect();
            assert_eq!(numbers, bench.plan.iter().map(|entry| entry.index).collect::<Vec<_>>(), "{says}");
        } else {
            assert!(last.1.contains("is refused") && last.1.contains("was not driven"), "{says}: {}", last.1);
            count("left where only a person gets it out");
        }
        let allowed = 60e-6 + slip.unwrap_or(0.0);
        let far = misfit(&truth, &after);
        assert!(far < allowed, "{says}: a touch is off by {:.4} mm", far * 1e3);
    };
    eight_at_once(runs, &one);
    assert!(!outside.load(Ordering::Relaxed), "the arm was outside its limits, or met something");
    println!("{runs} sessions of the program: {:?}", told.lock().unwrap());
}

#[test]
fn a_recording_is_not_gone_on_with_on_another_arm_of_the_same_type() {
    let bench = Bench::new();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    // one that tells no number is taken for the same
    for (number, says) in
        [(Some("120-1"), ""), (None, ""), (Some("120-2"), "number 120-2, expected 120-1"), (Some("120-1"), "")]
    {
        let serial_number = number.map(str::to_owned);
        let options = CellOptions { serial_number, ..CellOptions::like_a_real_one(&bench.truth, 1, 0) };
        let cell = VirtualCell::start(Box::new(ArmPlant::new(&bench.truth).unwrap()), options).unwrap();
        let cancel = AtomicBool::new(false);
        let session = Session {
            robot: &bench.robot,
            cell: &bench.cell,
            plan: &bench.plan,
            stride: None,
            gauge: &cell.gauge_url(),
            controller: &cell.controller_url(),
            out: &path,
            resume: path.exists(),
            go: true,
            settings: &Settings::default(),
            start_ns: 1_800_000_000_000_000_000,
            guard: &|_, _, _| Ok(()),
            cancel: &cancel,
            stops: None,
        };
        let before = std::fs::read(&path).unwrap_or_default();
        let one_more = &mut |p| {
            cancel.fetch_or(matches!(p, Progress::Measured { .. }), Ordering::Relaxed);
        };
        let error = session.perform(one_more).unwrap_err();
        let refused = error.to_string().contains("with another arm: the controller has serial");
        assert!(error.to_string().contains(says) && refused != says.is_empty(), "{error}");
        assert_eq!((cell.motions() == 0, std::fs::read(&path).unwrap() == before), (refused, refused));
    }
    assert_eq!(read_recording(&path).unwrap().recording.rows.len(), 3);
}

#[test]
fn a_recording_of_a_wrong_clock_is_gone_on_with_today() {
    let bench = Bench::new();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let cell = bench.start(1, Vec::new(), [0.0; 9], &Arc::new(AtomicBool::new(false)));
    let (gauge, controller) = (cell.gauge_url(), cell.controller_url());
    // a first part when the clock stood at 1970, the rest today, and the last when the clock stood still earlier
    for (start_ns, count, warns) in [(5_000_000_000, 2, false), (1_800_000_000_000_000_000, 3, true), (1, 4, true)] {
        let cancel = AtomicBool::new(false);
        let session = Session {
            robot: &bench.robot,
            cell: &bench.cell,
            plan: &bench.plan,
            stride: None,
            gauge: &gauge,
            controller: &controller,
            out: &path,
            resume: path.exists(),
            go: true,
            settings: &Settings::default(),
            start_ns,
            guard: &|_, _, _| Ok(()),
            cancel: &cancel,
            stops: None,
        };
        let mut warned = false;
        let ended = session.perform(&mut |p| match p {
            Progress::Warning(text) => warned |= text.contains("the clock was or is wrong"),
            Progress::Measured { done, .. } => cancel.store(done >= count, Ordering::Relaxed),
            _ => {}
        });
        assert_eq!(warned, warns, "{start_ns}: {}", ended.map_or_else(|e| e.to_string(), |_| "complete".into()));
        let rows = read_recording(&path).unwrap().recording.rows;
        assert_eq!(rows.len(), count);
        let times: Vec<f64> = rows.iter().map(|row| row.state.t.unwrap()).collect();
        assert!(times.windows(2).all(|t| t[0] < t[1]) && times[count - 1] < 1e5, "{times:?}");
    }
}
