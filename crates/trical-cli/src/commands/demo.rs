//! `trical demo`: the whole story on a virtual cell, from an arm that conceals something to a program that goes where it says.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use nalgebra::Vector3;
use trical_device::session::Settings;
use trical_device::{ArmPlant, CellOptions, PlanEntry, Session, VirtualCell, open_controller};
use trical_diagnose::truth::{draw_truth, hidden_in, hide};
use trical_diagnose::{Coefficient, Diagnosis, EffectId, RowKind, VerdictRow, diagnose_recordings, verdict};
use trical_ident::{
    Dataset, ErrorSummary, JointSource, ModelFile, ParameterSet, identify, reject_gross_errors, write_whole,
};
use trical_model::{Cell, Forward, Joints, MAX_JOINTS, Model, Place, Recording, Robot, State, Task};
use trical_plan::{
    CollisionModel, MotionGuard, PlanOptions, ValidationOptions, plan_touches, poses_in_sphere, poses_in_workspace,
    write_plan,
};
use trical_program::{Dialect, Frames, Options, Program, Report, compensate};
use trical_recording::read_recording;
use trical_report::plan_summary::PlanSummary;
use trical_report::{plan_report, table, verdict_summary};

use crate::commands::demo_report::{Models, Scored, Seal, error_rows};
use crate::commands::{demo_report, plan, virtual_cell};
use crate::error::{CliError, Result, of_wish};
use crate::measure_view::{View, perform};
use crate::{input, progress, say, say_json};

const ROBOT: &str = include_str!("../../assets/irb120/robot.toml");
const CELL: &str = include_str!("../../assets/irb120/cell.toml");
const PROGRAM: &str = include_str!("../../assets/sample.mod");

/// Radius of the sphere in which the paper validates, m.
const SPHERE: f64 = 0.2;

/// Touches of each ball: as in the paper, and twice as many where something is concealed.
const PER_BALL: [usize; 2] = [15, 30];

/// A touch is accepted when its reading is shorter, m: nulled as in the paper; coarser where something is concealed, since an arm
/// with backlash cannot be nulled. What the indicators still read is recorded either way.
const ACCEPTED: [f64; 2] = [20e-6, 200e-6];

/// What is concealed by default, drawn by the seed: flaws of the arm, of a size that one would notice.
const DRAWN: [&str; 10] = [
    "lost_motion_direction@1",
    "lost_motion_direction@2",
    "lost_motion_direction@3",
    "gear_ratio@1*3",
    "gear_ratio@3*3",
    "axis_wobble@1*3",
    "joint_coupling",
    "cross_axis_compliance@1*3",
    "gear_ripple@2/80*2",
    "gear_ripple@3/100*2",
];

/// Coefficients of an effect that are told; a curve has more.
const COEFFICIENTS: usize = 2;

/// Arguments of `trical demo`.
#[derive(clap::Args)]
pub struct Args {
    /// Folder for everything that is made
    #[arg(long, value_name = "DIR", default_value = "demo-out")]
    out: PathBuf,
    /// Seed of the hidden arm, of what is concealed in it and of all noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// What to conceal in the arm: an effect of docs/effects.md with its site and its size in typical ones, as in
    /// lost_motion_direction@3*2, or none. By default the seed draws one
    #[arg(long, alias = "hide", value_name = "EFFECT[@SITE][*SIZE]")]
    conceal: Option<String>,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

impl Args {
    /// What is concealed, as [`hide`] reads it.
    fn wish(&self) -> Option<String> {
        match self.conceal.as_deref() {
            Some("none") => None,
            Some(wish) => Some(wish.to_owned()),
            None => {
                // neighbouring seeds draw different effects
                let drawn = self.seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 33;
                let count = u64::try_from(DRAWN.len()).unwrap_or(1);
                usize::try_from(drawn % count).ok().and_then(|k| DRAWN.get(k)).map(|wish| (*wish).to_owned())
            }
        }
    }
}

/// The story as it is told, and where its files are.
pub struct Story<'a> {
    args: &'a Args,
    robot: Robot,
    cell: Cell,
    begin: Instant,
}

impl Story<'_> {
    fn tell(&self, line: impl AsRef<str>) -> Result<()> {
        if self.args.json { Ok(()) } else { say(line.as_ref()) }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.args.out.join(name)
    }

    fn made(&self, names: &[&str]) -> trical_report::Made {
        let paths: Vec<PathBuf> = names.iter().map(|n| self.file(n)).collect();
        input::made(&paths.iter().map(PathBuf::as_path).collect::<Vec<_>>())
    }
}

fn score(
    name: &'static str,
    truth: &Forward,
    models: [&Forward; 3],
    poses: Vec<Joints>,
    temp_c: Option<f64>,
) -> Scored {
    // each pose is reached from the one before it
    let states: Vec<State> = (0..poses.len())
        .map(|k| {
            let from = if k > 0 { poses[k - 1] } else { [0.0; MAX_JOINTS] };
            let mut dir = [0_i8; MAX_JOINTS];
            for (d, (to, from)) in dir.iter_mut().zip(poses[k].iter().zip(&from)) {
                *d = if to > from { 1 } else { -1 };
            }
            State { dir: Some(dir), temp_c, ..State::at(&poses[k]) }
        })
        .collect();
    let place = |f: &Forward| -> Vec<Vector3<f64>> {
        let mut ws = f.workspace();
        states.iter().map(|s| f.world_from_tool(s, &mut ws).translation).collect()
    };
    let places = place(truth);
    let errors = models.map(|f| place(f).iter().zip(&places).map(|(a, b)| (a - b).norm()).collect());
    Scored { name, poses, places, errors }
}

/// The sample program rewritten for `model` at a temperature, as the controller of the nominal arm reads it.
fn rewritten(text: &[u8], nominal: &Model, model: &Model, temp_c: Option<f64>) -> Result<(Vec<u8>, Report)> {
    let options = Options { model_name: "improved.toml".into(), details: true, temp_c, ..Options::default() };
    let mut out = Vec::new();
    let program = Program::of_file(text, "sample.mod", Dialect::Rapid, &mut out);
    let report = compensate(program, nominal, model, &Frames::default(), &options);
    Ok((out, report.map_err(CliError::failed)?))
}

/// What the controller's sensor says now, degC.
fn temperature(cell: &VirtualCell) -> Result<Option<f64>> {
    let mut controller = open_controller(&cell.controller_url()).map_err(CliError::failed)?;
    controller.temperature().map_err(CliError::failed)
}

/// Where the sample program's targets end up on the virtual arm, driven through the controller's socket: errors in m.
fn drive(cell: &VirtualCell, poses: &[(trical_model::Pose, Joints)]) -> Result<Vec<f64>> {
    let mut controller = open_controller(&cell.controller_url()).map_err(CliError::failed)?;
    let mut errors = Vec::new();
    for (wanted, joints) in poses {
        controller.move_joints(joints).map_err(CliError::failed)?;
        errors.push((cell.true_tcp().translation - wanted.translation).norm());
    }
    Ok(errors)
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let out = &args.out;
    input::make_folder(out)?;
    let (robot, cell) = (Robot::parse(ROBOT, "robot.toml")?, Cell::parse(CELL, "cell.toml")?);
    let story = Story { args, robot, cell, begin: Instant::now() };
    // of an earlier demo: should this one fail, they would be taken for its own
    for name in ["run.mcap", "report.html", "sample.compensated.mod"] {
        remove(&story.file(name))?;
    }
    for (name, text) in [("robot.toml", ROBOT), ("cell.toml", CELL), ("sample.mod", PROGRAM)] {
        write_whole(&story.file(name), text.as_bytes())?;
    }
    let nominal = plan::model_to_identify(&story.robot, &story.cell)?;
    let (running, concealed) = true_arm(&story, &nominal)?;
    let (entries, summary) = planned(&story, &nominal, concealed)?;
    let recording = measured(&story, &running, &entries, ACCEPTED[usize::from(concealed)])?;
    let touches = recording.rows.len();
    let models = diagnosed(&story, recording)?;
    let seal = seal_broken(&story, &models)?;
    let temp_c = temperature(&running)?;
    let scores = validated(&story, &models, temp_c)?;
    let driven = program(&story, &running, &models.best, temp_c)?;
    let made = story.made(&["robot.toml", "cell.toml", "run.mcap", "truth.sealed.toml"]);
    let html = demo_report::render(&models, &seal, &scores, &driven, &summary, &made)?;
    write_whole(&story.file("report.html"), html.as_bytes())?;
    let seconds = story.begin.elapsed().as_secs_f64();
    story.tell(format!("8. Everything is in {}: open report.html. ({seconds:.0} s)", out.display()))?;
    if args.json {
        let of = |s: &Scored| {
            let [before, plain, after] = s.errors.each_ref().map(|e| ErrorSummary::of(e));
            serde_json::json!({ "before": before, "plain": plain, "after": after })
        };
        let residual = ErrorSummary::of(&models.plain.errors()?);
        return say_json(&serde_json::json!({
            "touches": touches,
            "parameters": models.plain.free.len(),
            "rms_mm": residual.rms_mm,
            "concealed": seal.sealed,
            "said": seal.said,
            "verdict": models.diagnosis.verdict,
            "sphere": of(&scores[0]),
            "workspace": of(&scores[1]),
            "program": { "before": driven[0], "after": driven[1] },
            "out": out.display().to_string(),
        }));
    }
    Ok(())
}

fn remove(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
            Err(CliError::Input(format!("{}: cannot be replaced: {e}", path.display())))
        }
        _ => Ok(()),
    }
}

/// 1. A virtual cell with a true arm, drawn and sealed; whether something is concealed in it.
fn true_arm(story: &Story<'_>, nominal: &Model) -> Result<(VirtualCell, bool)> {
    let seed = story.args.seed;
    let mut truth = draw_truth(nominal, seed)?;
    let wish = story.args.wish();
    if let Some(wish) = &wish {
        hide(&mut truth, std::slice::from_ref(wish)).map_err(|e| of_wish("--conceal", e))?;
    }
    virtual_cell::seal(&truth, &story.file("truth.sealed.toml"))?;
    let running = VirtualCell::start(Box::new(ArmPlant::new(&truth)?), CellOptions::like_a_real_one(&truth, seed, 0))
        .map_err(CliError::failed)?;
    story.tell(format!(
        "1. A virtual cell runs: an {}, three balls, three indicators on {} and a controller on",
        story.robot.name,
        running.receiver()
    ))?;
    let concealed = match (&story.args.conceal, &wish) {
        (_, None) => "nothing else is concealed in it",
        (Some(_), _) => "one more flaw is concealed in it",
        (None, _) => "one more flaw, drawn by chance, is concealed in it",
    };
    story.tell(format!("   {}. Nobody knows the true geometry of the arm; {concealed}.", running.address()))?;
    Ok((running, wish.is_some()))
}

/// 2. The plan.
fn planned(story: &Story<'_>, nominal: &Model, concealed: bool) -> Result<(Vec<PlanEntry>, PlanSummary)> {
    let per_ball = PER_BALL[usize::from(concealed)];
    let options = PlanOptions {
        seed: story.args.seed,
        per_ball,
        parameters: Some(nominal.terms.clone()),
        start: Some([0.0; MAX_JOINTS]),
        ..PlanOptions::default()
    };
    let (robot, cell) = (&story.robot, &story.cell);
    let planned = progress::with_bar("planning", |task| plan_touches(robot, cell, &options, task))?;
    let entries = plan::entries(&planned.entries);
    write_whole(&story.file("plan.csv"), write_plan(robot, &planned.entries).as_bytes())?;
    story.tell(format!(
        "2. {} touches are planned, {per_ball} a ball: the most informative of {} that are reachable and",
        entries.len(),
        cell.balls.len() * options.pool_per_ball
    ))?;
    story.tell("   collide with nothing (plan.html).")?;
    let summary = PlanSummary::new(nominal, planned, options)?;
    let html = plan_report::render(robot, cell, &summary, &story.made(&["robot.toml", "cell.toml"]))?;
    write_whole(&story.file("plan.html"), html.as_bytes())?;
    Ok((entries, summary))
}

/// 3. The measurement, through the drivers that a real cell would use, read back from the file.
fn measured(story: &Story<'_>, running: &VirtualCell, entries: &[PlanEntry], accepted: f64) -> Result<Recording> {
    let path = story.file("run.mcap");
    let mut view = View::new();
    let guard = MotionGuard::new(&story.robot, &story.cell)?;
    let session = Session {
        robot: &story.robot,
        cell: &story.cell,
        plan: entries,
        stride: None,
        gauge: &running.gauge_url(),
        controller: &running.controller_url(),
        out: &path,
        resume: false,
        go: true,
        settings: &Settings { epsilon: accepted, ..Settings::default() },
        // the demo of a seed is the same to the byte
        start_ns: 0,
        guard: &|from, to, touched| guard.check(from, to, touched),
        cancel: &AtomicBool::new(false),
        stops: None,
    };
    let measured = perform(&session, "", &mut |p| view.show(&p))?;
    view.end();
    story.tell(format!(
        "3. The arm touched each ball until all three indicators read less than {} mm: {} touches,",
        accepted * 1e3,
        measured.measured
    ))?;
    story.tell(format!(
        "   {} corrections, each touch on disk before the next move (run.mcap).",
        measured.corrections
    ))?;
    Ok(read_recording(&path).map_err(CliError::failed)?.recording)
}

/// 4. Plain calibration and diagnosis.
fn diagnosed(story: &Story<'_>, recording: Recording) -> Result<Models> {
    let (robot, cell) = (&story.robot, &story.cell);
    let recordings = [recording];
    let data = Dataset::build(&recordings, JointSource::Read, None)?;
    let data = reject_gross_errors(robot, cell, &data)?;
    let clock = Instant::now();
    let plain = identify(robot, cell, &data, ParameterSet::Compliance)?;
    let milliseconds = clock.elapsed().as_secs_f64() * 1e3;
    let nominal = identify(robot, cell, &data, ParameterSet::Nominal)?.model;
    ModelFile::of_fit(&plain).save(&story.file("calibrated.toml"))?;
    let left = ErrorSummary::of(&plain.errors()?).rms_mm;
    story.tell(format!(
        "4. The plain model, {} parameters identified in {milliseconds:.1} ms, leaves {left:.3} mm rms (calibrated.toml).",
        plain.free.len()
    ))?;
    let clock = Instant::now();
    let options = trical_diagnose::Options::default();
    let (diagnosis, _) =
        progress::with_bar("diagnosing", |task| diagnose_recordings(robot, cell, &recordings, &options, task))?;
    story.tell(format!("   The diagnosis says, after {:.1} s (improved.toml):", clock.elapsed().as_secs_f64()))?;
    for line in verdict_summary::lines(&diagnosis) {
        story.tell(format!("   {line}"))?;
    }
    let mut models = Models { nominal, best: plain.model.clone(), plain, diagnosis };
    let improved = if models.found() { models.diagnosis.model_file() } else { ModelFile::of_fit(&models.plain) };
    improved.save(&story.file("improved.toml"))?;
    models.best = improved.model;
    Ok(models)
}

/// An effect, where, and how large.
fn in_words(effect: EffectId, place: Place, coefficients: &[Coefficient]) -> String {
    // one needs no name of its own
    let name = |c: &Coefficient| if coefficients.len() == 1 { "size".to_owned() } else { c.name.clone() };
    let values = coefficients.iter().take(COEFFICIENTS).map(|c| table::estimate(&name(c), c.value, c.sd, &c.unit));
    let more = if coefficients.len() > COEFFICIENTS { ", ..." } else { "" };
    format!("{}: {}{more}", verdict::named(effect, place), values.collect::<Vec<_>>().join(", "))
}

/// The first two claims of a verdict: with sizes where an effect at one place is likelier right than not.
fn found_in(d: &Diagnosis) -> Vec<String> {
    let claims = d.verdict.rows.iter().filter(|r| matches!(r.kind, RowKind::Finding | RowKind::Curves));
    let said = |row: &VerdictRow| match row.findings[..] {
        [k] if d.findings[k - 1].is_likely() => {
            let f = &d.findings[k - 1];
            in_words(f.effect, f.site, &f.coefficients)
        }
        _ => verdict_summary::sentence(row),
    };
    claims.take(2).map(said).collect()
}

/// 5. The sealed file is read, for the first time.
fn seal_broken(story: &Story<'_>, models: &Models) -> Result<Seal> {
    let truth = ModelFile::load(&story.file("truth.sealed.toml"))?.model;
    let join = |all: Vec<String>| if all.is_empty() { "nothing".to_owned() } else { all.join("; ") };
    let sealed = join(hidden_in(&truth).iter().map(|(e, p, c)| in_words(*e, *p, c)).collect());
    let said = join(found_in(&models.diagnosis));
    story.tell("5. The seal is broken (truth.sealed.toml):")?;
    story.tell(format!("     concealed  {sealed}"))?;
    story.tell(format!("     found      {said}"))?;
    Ok(Seal { sealed, said })
}

/// 6. The models against the true arm, where it was never measured.
fn validated(story: &Story<'_>, models: &Models, temp_c: Option<f64>) -> Result<[Scored; 2]> {
    let scores = progress::with_bar("validating", |task| validate(story, models, temp_c, task))?;
    story.tell("6. Position error, mm, at poses that were never measured, against the true arm:")?;
    for line in table::lines(&error_rows(models, &scores)) {
        story.tell(format!("   {line}"))?;
    }
    Ok(scores)
}

fn validate(story: &Story<'_>, models: &Models, temp_c: Option<f64>, task: &Task<'_>) -> Result<[Scored; 2]> {
    let truth = ModelFile::load(&story.file("truth.sealed.toml"))?.model;
    let cell = &story.cell;
    let centre = cell.balls.iter().sum::<Vector3<f64>>() / 3.0 + Vector3::new(0.0, 0.0, 0.1);
    let collisions = CollisionModel::new(&truth.robot, cell)?;
    let options = ValidationOptions { seed: story.args.seed, ..ValidationOptions::default() };
    let sphere = poses_in_sphere(&collisions, &centre, SPHERE, 100, &options)?;
    task.step(0.5, "")?;
    let whole = poses_in_workspace(&collisions, 500, &options)?;
    let forward = |m: &Model| Forward::new(m.clone(), Vec::new());
    let truth = forward(&truth)?;
    let each = [forward(&models.nominal)?, forward(&models.plain.model)?, forward(&models.best)?];
    let [a, b, c] = &each;
    let of = |name, poses| score(name, &truth, [a, b, c], poses, temp_c);
    Ok([of("sphere, diameter 400 mm", sphere), of("workspace", whole)])
}

/// 7. A program as it was written and rewritten, driven on the virtual arm: how far its targets are missed.
fn program(story: &Story<'_>, running: &VirtualCell, model: &Model, temp_c: Option<f64>) -> Result<[ErrorSummary; 2]> {
    let controller = Model::nominal(story.robot.clone(), story.cell.clone());
    let (_, plain) = rewritten(PROGRAM.as_bytes(), &controller, &controller, temp_c)?;
    let (better, done) = rewritten(PROGRAM.as_bytes(), &controller, model, temp_c)?;
    if let Some(problem) = done.problems.first() {
        return Err(CliError::Failed(format!("sample.mod: {problem}")));
    }
    write_whole(&story.file("sample.compensated.mod"), &better)?;
    // what the controller reads from the two files (the second without its mark), driven on the virtual arm
    let unmarked = better.iter().position(|b| *b == b'\n').map_or(0, |k| k + 1);
    let (_, again) = rewritten(&better[unmarked..], &controller, &controller, temp_c)?;
    let missed = |by: &Report| -> Result<ErrorSummary> {
        let poses: Vec<_> = plain.rows.iter().zip(&by.rows).map(|(plain, by)| (plain.wanted, by.joints)).collect();
        Ok(ErrorSummary::of(&drive(running, &poses)?))
    };
    let driven = [missed(&plain)?, missed(&again)?];
    story.tell(format!(
        "7. A RAPID program is rewritten and driven: its {} targets are missed by {:.3} mm (mean) before and",
        plain.rows.len(),
        driven[0].mean_mm
    ))?;
    story.tell(format!("   {:.3} mm after (sample.compensated.mod).", driven[1].mean_mm))?;
    Ok(driven)
}
