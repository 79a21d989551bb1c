//! `trical demo`: the whole story on a virtual cell.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use nalgebra::Vector3;
use trical_device::session::Settings;
use trical_device::{ArmPlant, CellOptions, Session, VirtualCell, open_controller};
use trical_diagnose::truth::draw_truth;
use trical_ident::{
    Dataset, ErrorSummary, Identified, JointSource, ModelFile, ParameterSet, identify, reject_gross_errors, write_whole,
};
use trical_model::{Cell, Forward, Joints, MAX_JOINTS, Model, Robot, State, Task};
use trical_plan::{
    CollisionModel, MotionGuard, PlanOptions, ValidationOptions, plan_touches, poses_in_sphere, poses_in_workspace,
    write_plan,
};
use trical_program::{Dialect, Frames, Options, Report};
use trical_recording::read_recording;
use trical_report::page::{Figure, Section, error_table, render};
use trical_report::plan_told::{self, Told};
use trical_report::plots::{self, AFTER, BEFORE, Series};
use trical_report::{Made, plan_report, table};

use crate::commands::identify::parameter_rows;
use crate::commands::measure::perform;
use crate::commands::{plan, virtual_cell};
use crate::error::{CliError, Result};
use crate::measure_view::View;
use crate::{input, progress, say};

const ROBOT: &str = include_str!("../../assets/irb120/robot.toml");
const CELL: &str = include_str!("../../assets/irb120/cell.toml");
const PROGRAM: &str = include_str!("../../assets/sample.mod");

/// Radius of the sphere in which the paper validates, m.
const SPHERE: f64 = 0.2;

/// Arguments of `trical demo`.
#[derive(clap::Args)]
pub struct Args {
    /// Folder for everything that is made
    #[arg(long, value_name = "DIR", default_value = "demo-out")]
    out: PathBuf,
    /// Seed of the hidden arm and of all noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// Errors of the TCP at some poses: nominal arm and calibrated arm, against the true one.
struct Scored {
    poses: Vec<Joints>,
    places: Vec<Vector3<f64>>,
    before: Vec<f64>,
    after: Vec<f64>,
}

fn score(truth: &Forward, before: &Forward, after: &Forward, poses: Vec<Joints>) -> Scored {
    let place = |f: &Forward| -> Vec<Vector3<f64>> {
        let mut ws = f.workspace();
        poses.iter().map(|q| f.world_from_tool(&State::at(q), &mut ws).translation).collect()
    };
    let places = place(truth);
    let off = |f: &Forward| place(f).iter().zip(&places).map(|(a, b)| (a - b).norm()).collect();
    Scored { before: off(before), after: off(after), places, poses }
}

/// The sample program rewritten for `model`, as the controller of the nominal arm reads it.
fn rewritten(text: &[u8], nominal: &Model, model: &Model) -> Result<(Vec<u8>, Report)> {
    let options = Options { model_name: "calibrated.toml".into(), details: true, ..Options::default() };
    let mut out = Vec::new();
    let report = trical_program::compensate(
        text,
        "sample.mod",
        Dialect::Rapid,
        nominal,
        model,
        &Frames::default(),
        &options,
        &mut out,
    )
    .map_err(|e| CliError::Failed(e.to_string()))?;
    Ok((out, report))
}

/// Where the sample program's targets end up on the virtual arm, driven through the controller's socket: errors in m.
fn drive(cell: &VirtualCell, poses: &[(trical_model::Pose, Joints)]) -> Result<Vec<f64>> {
    let failed = |e: &dyn std::fmt::Display| CliError::Failed(e.to_string());
    let mut controller = open_controller(&cell.controller_url()).map_err(|e| failed(&e))?;
    let mut errors = Vec::new();
    for (wanted, joints) in poses {
        controller.move_joints(joints).map_err(|e| failed(&e))?;
        let (at, _) = cell.true_tcp();
        errors.push((Vector3::from(at) - wanted.translation).norm());
    }
    Ok(errors)
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let begin = Instant::now();
    let out = &args.out;
    std::fs::create_dir_all(out).map_err(|e| CliError::Input(format!("{}: cannot be made: {e}", out.display())))?;
    let mut told = Vec::new();
    let mut tell = |line: String| -> Result<()> {
        if !args.json {
            say(&line)?;
        }
        told.push(line);
        Ok(())
    };
    let file = |name: &str| out.join(name);
    let (robot, cell) = (Robot::parse(ROBOT, "robot.toml")?, Cell::parse(CELL, "cell.toml")?);
    write_whole(&file("robot.toml"), ROBOT.as_bytes())?;
    write_whole(&file("cell.toml"), CELL.as_bytes())?;
    write_whole(&file("sample.mod"), PROGRAM.as_bytes())?;
    let nominal = plan::model_to_identify(&robot, &cell)?;

    // 1. the virtual cell
    let truth = draw_truth(&nominal, args.seed)?;
    virtual_cell::seal(&truth, &file("truth.sealed.toml"))?;
    let running =
        VirtualCell::start(Box::new(ArmPlant::new(&truth)?), CellOptions::like_a_real_one(&truth, args.seed, 0))
            .map_err(|e| CliError::Failed(e.to_string()))?;
    tell(format!("1. A virtual cell runs: an {} whose true geometry is hidden, three balls, three", robot.name))?;
    tell(format!("   indicators on {} and a controller on {}.", running.terminal().display(), running.address()))?;

    // 2. the plan
    let options = PlanOptions {
        seed: args.seed,
        parameters: Some(nominal.terms.clone()),
        start: Some([0.0; MAX_JOINTS]),
        ..PlanOptions::default()
    };
    let planned = progress::with_bar("planning", |task| plan_touches(&robot, &cell, &options, task))?;
    let entries = plan::entries(&planned.entries);
    write_whole(&file("plan.csv"), write_plan(&robot, &planned.entries).as_bytes())?;
    let dropped: usize = plan_told::rejected(&planned).values().sum();
    tell(format!(
        "2. {} touches are planned, 15 a ball: the most informative of {} that are reachable and",
        entries.len(),
        cell.balls.len() * options.pool_per_ball
    ))?;
    tell(format!("   collide with nothing ({dropped} others were dropped; plan.html shows them)."))?;

    let told = Told::new(&nominal, planned, options)?;
    let made = |names: &[&str]| {
        let paths: Vec<PathBuf> = names.iter().map(|n| file(n)).collect();
        input::made(&paths.iter().map(PathBuf::as_path).collect::<Vec<_>>())
    };
    write_whole(
        &file("plan.html"),
        plan_report::render(&robot, &cell, &told, &made(&["robot.toml", "cell.toml"]))?.as_bytes(),
    )?;

    // 3. the measurement
    let recording = file("run.mcap");
    if recording.exists() {
        std::fs::remove_file(&recording)
            .map_err(|e| CliError::Input(format!("{}: cannot be replaced: {e}", recording.display())))?;
    }
    let mut view = View::new();
    let guard = MotionGuard::new(&robot, &cell)?;
    let session = Session {
        robot: &robot,
        cell: &cell,
        plan: &entries,
        stride: None,
        gauge: &running.gauge_url(),
        controller: &running.controller_url(),
        out: &recording,
        resume: false,
        go: true,
        settings: &Settings::default(),
        // the demo of a seed is the same to the byte
        start_ns: 0,
        guard: &|from, to, touched| guard.check(from, to, touched),
        cancel: &AtomicBool::new(false),
        stops: None,
    };
    let measured = perform(&session, &mut |p| view.show(&p))?;
    view.end();
    tell(format!(
        "3. The arm touched each ball until all three indicators read less than 0.02 mm: {} touches,",
        measured.measured
    ))?;
    tell(format!("   {} corrections, each touch on disk before the next move (run.mcap).", measured.corrections))?;

    // 4. identification, from the file
    let read = read_recording(&recording).map_err(|e| CliError::Failed(e.to_string()))?;
    let data = Dataset::build(&[read.recording], JointSource::Read, None)?;
    let data = reject_gross_errors(&robot, &cell, &data)?;
    let clock = Instant::now();
    let fitted = identify(&robot, &cell, &data, ParameterSet::Compliance)?;
    let milliseconds = clock.elapsed().as_secs_f64() * 1e3;
    let before = identify(&robot, &cell, &data, ParameterSet::Nominal)?;
    ModelFile::of(fitted.model.clone(), &data).save(&file("calibrated.toml"))?;
    let residual = ErrorSummary::of(&fitted.errors()?);
    tell(format!(
        "4. {} parameters are identified in {milliseconds:.1} ms; {:.3} mm rms are left. A few beside nominal:",
        fitted.free.len(),
        residual.rms_mm
    ))?;
    let rows = parameter_rows(&fitted);
    let some: Vec<Vec<String>> = rows
        .iter()
        .filter(|r| {
            ["parameter", "base_z", "tool_x", "alpha_2", "a_3", "d_4", "theta_3", "c_2", "c_3"].contains(&r[0].as_str())
        })
        .cloned()
        .collect();
    for line in table::lines(&some) {
        tell(format!("   {line}"))?;
    }

    // 5. validation against the unsealed truth
    let sealed = file("truth.sealed.toml");
    let validation =
        progress::with_bar("validating", |task| validate(&sealed, &before, &fitted, &cell, args.seed, task))?;
    tell("5. The truth is unsealed. Position error, mm, at poses that were never measured:".into())?;
    let summary = |e: &[f64]| ErrorSummary::of(e);
    let (sphere, whole) = (&validation.0, &validation.1);
    let errors = [
        ("400 mm sphere, before", summary(&sphere.before)),
        ("400 mm sphere, after", summary(&sphere.after)),
        ("whole workspace, before", summary(&whole.before)),
        ("whole workspace, after", summary(&whole.after)),
    ];
    let error_rows = error_table(&errors.iter().map(|(n, e)| (*n, e)).collect::<Vec<_>>());
    for line in table::lines(&error_rows) {
        tell(format!("   {line}"))?;
    }

    // 6. a program
    let controller = Model::nominal(robot.clone(), cell.clone());
    let (_, plain) = rewritten(PROGRAM.as_bytes(), &controller, &controller)?;
    let (better, done) = rewritten(PROGRAM.as_bytes(), &controller, &fitted.model)?;
    if let Some(problem) = done.problems.first() {
        return Err(CliError::Failed(format!("sample.mod: {problem}")));
    }
    write_whole(&file("sample.compensated.mod"), &better)?;
    // what the controller reads from the two files (the second without its mark), driven on the virtual arm
    let unmarked = better.iter().position(|b| *b == b'\n').map_or(0, |k| k + 1);
    let (_, again) = rewritten(&better[unmarked..], &controller, &controller)?;
    let poses =
        |r: &Report| -> Vec<(trical_model::Pose, Joints)> { r.rows.iter().map(|r| (r.wanted, r.joints)).collect() };
    let plain = poses(&plain);
    let rewritten: Vec<(trical_model::Pose, Joints)> =
        plain.iter().zip(poses(&again)).map(|((wanted, _), (_, q))| (*wanted, q)).collect();
    let (missed, hit) = (drive(&running, &plain)?, drive(&running, &rewritten)?);
    let (missed, hit) = (summary(&missed), summary(&hit));
    tell(format!(
        "6. A RAPID program is rewritten and driven: its {} targets are missed by {:.3} mm (mean) before and",
        plain.len(),
        missed.mean_mm
    ))?;
    tell(format!("   {:.3} mm after (sample.compensated.mod).", hit.mean_mm))?;

    // 7. the report
    let html = report(
        &fitted,
        &rows,
        &error_rows,
        &validation,
        (&missed, &hit),
        &told,
        &made(&["robot.toml", "cell.toml", "run.mcap"]),
    )?;
    write_whole(&file("report.html"), html.as_bytes())?;
    tell(format!("7. Everything is in {}: open report.html. ({:.0} s)", out.display(), begin.elapsed().as_secs_f64()))?;
    if args.json {
        let value = serde_json::json!({
            "touches": measured.measured,
            "parameters": fitted.free.len(),
            "rms_mm": residual.rms_mm,
            "sphere": { "before": errors[0].1, "after": errors[1].1 },
            "workspace": { "before": errors[2].1, "after": errors[3].1 },
            "program": { "before": missed, "after": hit },
            "out": out.display().to_string(),
        });
        return say(serde_json::to_string_pretty(&value)?);
    }
    Ok(())
}

fn validate(
    sealed: &Path,
    before: &Identified,
    fitted: &Identified,
    cell: &Cell,
    seed: u64,
    task: &Task<'_>,
) -> Result<(Scored, Scored)> {
    let truth = ModelFile::load(sealed)?.model;
    let centre = cell.balls.iter().sum::<Vector3<f64>>() / 3.0 + Vector3::new(0.0, 0.0, 0.1);
    let model = CollisionModel::new(&truth.robot, cell)?;
    let options = ValidationOptions { seed, ..ValidationOptions::default() };
    let sphere = poses_in_sphere(&model, &centre, SPHERE, 100, &options)?;
    task.step(0.5, "")?;
    let whole = poses_in_workspace(&model, 500, &options)?;
    let truth = Forward::new(truth, Vec::new())?;
    let before = Forward::new(before.model.clone(), Vec::new())?;
    let after = Forward::new(fitted.model.clone(), Vec::new())?;
    Ok((score(&truth, &before, &after, sphere), score(&truth, &before, &after, whole)))
}

fn report(
    fitted: &Identified,
    parameters: &[Vec<String>],
    errors: &[Vec<String>],
    validation: &(Scored, Scored),
    program: (&ErrorSummary, &ErrorSummary),
    told: &Told,
    made: &Made,
) -> Result<String> {
    let (sphere, whole) = validation;
    let mm = |x: &[f64], e: &[f64]| -> Vec<(f64, f64)> { x.iter().zip(e).map(|(x, e)| (*x, e * 1e3)).collect() };
    let pair = |x: &[f64], s: &Scored| {
        [
            Series { name: "before", color: BEFORE, points: mm(x, &s.before) },
            Series { name: "after", color: AFTER, points: mm(x, &s.after) },
        ]
    };
    let q2: Vec<f64> = whole.poses.iter().map(|q| q[1].to_degrees()).collect();
    let middle =
        sphere.places.iter().sum::<Vector3<f64>>() / f64::from(u32::try_from(sphere.places.len().max(1)).unwrap_or(1));
    let distance: Vec<f64> = whole.places.iter().map(|p| (p - middle).norm() * 1e3).collect();
    let after_only = |x: &[f64]| [Series { name: "after", color: AFTER, points: mm(x, &whole.after) }];
    let lowest = fitted.data.observations.iter().map(|o| o.state.q[1].to_degrees()).fold(f64::INFINITY, f64::min);
    let residuals: Vec<(f64, f64)> = fitted
        .errors()?
        .iter()
        .enumerate()
        .map(|(k, e)| (f64::from(u32::try_from(k + 1).unwrap_or(0)), e * 1e3))
        .collect();
    let verdict = format!(
        "{} touches of three balls took the mean position error in the whole workspace from {:.2} mm to {:.3} mm.",
        fitted.data.observations.len(),
        ErrorSummary::of(&whole.before).mean_mm,
        ErrorSummary::of(&whole.after).mean_mm
    );
    let mut dropped = vec![["candidates dropped because of", "number"].map(String::from).to_vec()];
    dropped.extend(plan_told::rejected(&told.plan).iter().map(|(r, n)| vec![r.clone(), n.to_string()]));
    let sections = [
        Section {
            heading: "Position error before and after".into(),
            text: vec![
                "At 100 poses in a sphere of 400 mm and at 500 in the whole workspace, none of them measured. \
                 Before is the nominal arm with only base and tool identified."
                    .into(),
            ],
            list: Vec::new(),
            tables: vec![errors.to_vec()],
            figures: vec![
                Figure {
                    caption: "Error against joint 2, whole workspace.".into(),
                    svg: plots::scatter("angle of joint 2, deg", "position error, mm", true, false, &pair(&q2, whole))?,
                },
                Figure {
                    caption: "Error against the distance from the sphere's centre, whole workspace.".into(),
                    svg: plots::scatter(
                        "distance from the centre, mm",
                        "position error, mm",
                        true,
                        false,
                        &pair(&distance, whole),
                    )?,
                },
                Figure {
                    caption: format!(
                        "After calibration only, against joint 2. The touches reached down to {lowest:.0} deg: below, \
                         the model extrapolates."
                    ),
                    svg: plots::scatter("angle of joint 2, deg", "position error, mm", true, false, &after_only(&q2))?,
                },
                Figure {
                    caption: "After calibration only, against the distance from the centre.".into(),
                    svg: plots::scatter(
                        "distance from the centre, mm",
                        "position error, mm",
                        true,
                        false,
                        &after_only(&distance),
                    )?,
                },
            ],
        },
        Section {
            heading: "A program, rewritten".into(),
            text: vec![
                "The targets of sample.mod, driven on the virtual arm as they were written, and as compensated.".into(),
            ],
            tables: vec![error_table(&[("as written", program.0), ("compensated", program.1)])],
            ..Section::default()
        },
        Section {
            heading: "The touches".into(),
            text: vec![format!(
                "What the {} parameters leave of each touch, in the order of measurement.",
                fitted.free.len()
            )],
            list: Vec::new(),
            tables: vec![dropped],
            figures: plan_report::pictures(&fitted.model.robot, &fitted.model.cell, told)?.into_iter().take(1).chain([Figure {
                caption: "Residual of each touch.".into(),
                svg: plots::scatter(
                    "touch",
                    "residual, mm",
                    true,
                    false,
                    &[Series { name: "touch", color: AFTER, points: residuals }],
                )?,
            }]).collect(),
        },
        Section {
            heading: "Parameters".into(),
            text: vec![
                "Nominal, identified, and standard deviation. alpha_k and a_k lie between axes k and k+1; rotations of the \
                 base are what is added to cell.toml."
                    .into(),
            ],
            tables: vec![parameters.to_vec()],
            ..Section::default()
        },
    ];
    Ok(render("TriCal: calibration of a virtual cell", &verdict, &sections, made)?)
}
