//! `trical compensate`: a program rewritten so that the real arm goes where it says.

use std::path::PathBuf;

use trical_ident::{Expected, ModelFile};
use trical_model::{Model, State};
use trical_program::{Dialect, Job, Options, ProgramError, Report, Spelling, declared_frames, refuse_left_out};
use trical_report::table;

use crate::error::{CliError, Result};
use crate::input::{self, RobotAndCell, as_option};
use crate::{say, say_json, say_lines, say_wrapped};

/// Arguments of `trical compensate`.
#[derive(clap::Args)]
pub struct Args {
    /// The program: ABB RAPID, KUKA .src/.dat, FANUC .ls, Universal Robots script, or a CSV of poses or joints
    #[arg(value_name = "PROGRAM")]
    program: PathBuf,
    #[command(flatten)]
    cell: RobotAndCell,
    /// The model: calibrated.toml or improved.toml
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Where to write the rewritten program
    #[arg(long, value_name = "FILE", required_unless_present = "check")]
    out: Option<PathBuf>,
    /// Write nothing: list each target with its error before and after, as the model predicts it
    #[arg(long, conflicts_with = "out")]
    check: bool,
    /// Write even where targets could not be rewritten; those stay as they are
    #[arg(long)]
    partial: bool,
    /// The program's language, where the file's extension does not say it: rapid, krl, fanuc, urscript, csv
    #[arg(long, value_name = "NAME")]
    dialect: Option<String>,
    /// Tools and frames that the program does not declare itself: a TOML file ([tools.NAME], [frames.NAME], [world]), or
    /// another program of the controller that declares them (CalibData.mod, $config.dat)
    #[arg(long, value_name = "FILE")]
    frames: Vec<PathBuf>,
    /// Tool of targets for which the program names none [default: the cell's tool]
    #[arg(long, value_name = "NAME")]
    tool: Option<String>,
    /// Work object, base or user frame of targets for which the program names none [default: the robot's base]
    #[arg(long, value_name = "NAME")]
    frame: Option<String>,
    /// Temperature at which the program runs, degC, for a model with thermal effects
    #[arg(long, value_name = "T", allow_hyphen_values = true)]
    temp_c: Option<f64>,
    /// When the program runs, s since the recording began; without it, what happened in the course of a session (steps,
    /// drifts, warming up) is left out, and that is said
    #[arg(long, value_name = "T")]
    time_s: Option<f64>,
    /// The same for a model of a recording without times: after how many of its poses (seq)
    #[arg(long, value_name = "N", conflicts_with = "time_s")]
    seq: Option<f64>,
    /// Of which session of the model that moment is: its recording, or its number from 1 [default: the first in which something
    /// happened]
    #[arg(long, value_name = "NAME")]
    session: Option<String>,
    /// Mass on the flange beyond the tool's own, kg
    #[arg(long, value_name = "M")]
    payload_kg: Option<f64>,
    /// Take the solution nearest to the target before where the arm has none in the configuration that the text gives;
    /// for ABB always, as after ConfJ\Off, ConfL\Off
    #[arg(long)]
    any_configuration: bool,
    /// Targets are meant in the arm's own base, wherever it stands: leave out what was identified of the base
    #[arg(long)]
    own_base: bool,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

fn failed(out: Option<&PathBuf>) -> impl Fn(ProgramError) -> CliError + '_ {
    move |e| match (e, out) {
        (ProgramError::Input(text), _) => CliError::Input(text),
        (e @ ProgramError::NoDialect { .. }, _) => {
            CliError::Input(format!("{e}; {} says it", as_option("dialect", "NAME")))
        }
        (ProgramError::Left(text), _) => CliError::Failed(text),
        (e, Some(out)) => CliError::Failed(format!("{}: {e}", out.display())),
        (e, None) => CliError::Failed(e.to_string()),
    }
}

fn finite(name: &str, value: Option<f64>, from: f64, to: f64) -> Result<()> {
    match value {
        Some(v) if !(from..=to).contains(&v) => {
            Err(CliError::Input(format!("{name}: found {v}, expected between {from} and {to}")))
        }
        _ => Ok(()),
    }
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let name = args.program.display().to_string();
    if let Some(out) = &args.out {
        let read = [&args.program, &args.model].into_iter().chain(&args.frames);
        input::check_output(out, read.map(PathBuf::as_path).chain(args.cell.files()))?;
    }
    finite("--temp-c", args.temp_c, -100.0, 200.0)?;
    finite("--payload-kg", args.payload_kg, 0.0, 1e4)?;
    finite("--time-s", args.time_s, 0.0, 1e9)?;
    finite("--seq", args.seq, 0.0, 1e9)?;
    let job = Job {
        program: &args.program,
        out: args.out.as_deref(),
        dialect: args.dialect.as_deref(),
        frames: &args.frames,
        partial: args.partial,
    };
    let failed = failed(args.out.as_ref());
    let dialect = job.dialect().map_err(&failed)?;
    if let Some(out) = &args.out
        && let Some(other) = Dialect::of(out).filter(|other| *other != dialect)
    {
        return Err(CliError::Input(format!(
            "--out: found {}, as {} programs are named; {name} is {} and stays so",
            out.display(),
            other.name(),
            dialect.name()
        )));
    }
    for path in &args.frames {
        declared_frames(path).map_err(&failed)?;
    }
    let (robot, cell) = args.cell.load()?;
    let file = ModelFile::load(&args.model)?;
    file.require_robot(&robot, &args.model.display().to_string())?;
    let options = Options {
        model_name: args.model.display().to_string(),
        tool: args.tool.clone(),
        frame: args.frame.clone(),
        temp_c: args.temp_c,
        time_s: args.time_s,
        seq: args.seq,
        session: args.session.clone(),
        sessions: file.recordings().into_iter().map(Into::into).collect(),
        payload_kg: args.payload_kg,
        any_configuration: args.any_configuration,
        own_base: args.own_base,
        details: args.check,
        spelling: Spelling(as_option),
        visited: file.visited(),
    };
    let nominal = Model::nominal(robot, cell);
    let mut report = job.run(&nominal, &file.model, &options).map_err(&failed)?;
    if let Some(expected) = Expected::of(&file)? {
        let (temp_c, payload_kg) = (args.temp_c, args.payload_kg);
        report.expect(|q| expected.deviation(&State { temp_c, payload_kg, ..State::at(q) }));
    }
    tell(args, &job, &report)?;
    if args.check { refuse_left_out(&name, &report, args.partial, options.spelling).map_err(&failed) } else { Ok(()) }
}

/// Rows of a table of targets, each with its error before and after.
fn target_rows(report: &Report) -> Vec<Vec<String>> {
    let heads = ["line", "target", "moves, mm", "error before", "after", "standard deviation"];
    let told = if report.rows.iter().any(|r| r.deviation.is_some()) { 6 } else { 5 };
    let mut rows = vec![heads[..told].iter().map(ToString::to_string).collect::<Vec<_>>()];
    rows.extend(report.rows.iter().map(|r| {
        let name = if r.name.is_empty() { "(inline)" } else { &r.name };
        let file = if r.file.is_empty() { String::new() } else { format!("{}, ", r.file) };
        let mut row = vec![
            format!("{file}{}", r.line),
            name.to_owned(),
            format!("{:.3}", r.moved * 1e3),
            format!("{:.3}", r.before * 1e3),
            format!("{:.4}", r.after * 1e3),
        ];
        row.extend(r.deviation.map(|sd| format!("{:.3}", sd * 1e3)));
        row
    }));
    rows
}

fn tell(args: &Args, job: &Job<'_>, report: &Report) -> Result<()> {
    let mm = |x: f64| x * 1e3;
    if args.json {
        let dialect = job.dialect().map_err(failed(None))?;
        return say_json(&report.json(dialect));
    }
    if args.check {
        say_lines(table::lines(&target_rows(report)))?;
    }
    for caution in &report.cautions {
        say_wrapped(&format!("Caution: {caution}"), "")?;
    }
    let words = if args.check { "would be rewritten" } else { "rewritten" };
    let s = if report.rewritten == 1 { "" } else { "s" };
    say(format!("{} target{s} {words}, the farthest moved by {:.3} mm", report.rewritten, mm(report.largest_move)))?;
    say(format!(
        "Error that the model predicts, mm: mean {:.3}, max {:.3} before; mean {:.4}, max {:.4} after",
        mm(report.before[0]),
        mm(report.before[1]),
        mm(report.after[0]),
        mm(report.after[1])
    ))?;
    for (setup, n) in &report.setups {
        say(format!("  {n} with {setup}"))?;
    }
    if let Some(words) = report.relative_in_words() {
        for line in table::wrapped(&words, 106, "  ") {
            say(format!("  {line}"))?;
        }
    }
    if report.unknown_places > 0 {
        say(format!(
            "  {} to places that the running program computes: the sense of the motion after it is not known",
            if report.unknown_places == 1 {
                "1 motion goes".into()
            } else {
                format!("{} motions go", report.unknown_places)
            }
        ))?;
    }
    if !report.read_with.is_empty() {
        say(format!("  read with it: {}", report.read_with.join(", ")))?;
    }
    if !report.problems.is_empty() {
        let they_are = if report.problems.len() == 1 { "it is" } else { "they are" };
        say(format!("  {} left as {they_are}:", report.problems.len()))?;
        for problem in &report.problems {
            say(format!("    {problem}"))?;
        }
    }
    if !report.written.is_empty() {
        say(format!("Wrote {}", report.written.join(" and ")))?;
    }
    Ok(())
}
