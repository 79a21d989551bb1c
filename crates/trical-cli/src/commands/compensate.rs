//! `trical compensate`: a program rewritten so that the real arm goes where it says.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use serde_json::json;
use trical_device::program::{self, Dialect, Frames, Options, ProgramError, Report, load_frames};
use trical_ident::ModelFile;
use trical_model::Model;

use crate::error::{CliError, Result};
use crate::input::{self, RobotAndCell};
use crate::{say, table};

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
    #[arg(long)]
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
    /// When the program runs, s since the recording began, for a model that drifts
    #[arg(long, value_name = "T")]
    time_s: Option<f64>,
    /// Mass on the flange beyond the tool's own, kg
    #[arg(long, value_name = "M")]
    payload_kg: Option<f64>,
    /// Do not look at the configurations in the text (as after ConfJ\Off, ConfL\Off): take the solution nearest to the
    /// target before
    #[arg(long)]
    any_configuration: bool,
    /// Targets are meant in the arm's own base, wherever it stands: leave out what was identified of the base
    #[arg(long)]
    own_base: bool,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

fn failed(file: &str) -> impl Fn(ProgramError) -> CliError + '_ {
    move |e| match e {
        ProgramError::Input(text) => CliError::Input(text),
        ProgramError::Write(e) => CliError::Failed(format!("{file}: cannot be written: {e}")),
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
        input::check_output(out)?;
    }
    finite("--temp-c", args.temp_c, -100.0, 200.0)?;
    finite("--payload-kg", args.payload_kg, 0.0, 1e4)?;
    finite("--time-s", args.time_s, 0.0, 1e9)?;
    let dialect = match &args.dialect {
        Some(d) => Dialect::named(d)
            .ok_or_else(|| CliError::Input(format!("--dialect: '{d}' is not known; known are {}", Dialect::known())))?,
        None => Dialect::of(&args.program).ok_or_else(|| {
            CliError::Input(format!(
                "{name}: the extension does not say the program's dialect; known are {}; --dialect NAME says it",
                Dialect::known()
            ))
        })?,
    };
    let (robot, cell) = args.cell.load()?;
    let file = ModelFile::load(&args.model)?;
    file.require_robot(&robot, &args.model.display().to_string())?;
    let mut frames = Frames::default();
    for path in &args.frames {
        frames.or(&load_frames(path).map_err(failed(&name))?);
    }
    let bytes = std::fs::read(&args.program).map_err(|e| CliError::Input(format!("{name}: cannot be read: {e}")))?;
    let options = Options {
        model_name: args.model.display().to_string(),
        tool: args.tool.clone(),
        frame: args.frame.clone(),
        temp_c: args.temp_c,
        time_s: args.time_s,
        payload_kg: args.payload_kg,
        configuration_off: args.any_configuration,
        own_base: args.own_base,
        details: args.check,
    };
    let nominal = Model::nominal(robot, cell);
    let rewrite = |sink: &mut dyn Write| {
        program::compensate(&bytes, &name, dialect, &nominal, &file.model, &frames, &options, sink)
    };
    let report = match &args.out {
        Some(out) if !args.check => {
            let part = Part::beside(out);
            let sink = std::fs::File::create(&part.0);
            let mut sink = BufWriter::with_capacity(1 << 20, sink.map_err(|e| failed(&part.name())(e.into()))?);
            let report = rewrite(&mut sink).map_err(failed(&part.name()))?;
            refuse(&name, &report, args.partial)?;
            let whole = sink.into_inner().map_err(|e| e.into_error()).and_then(|f| f.sync_all());
            whole.and_then(|()| std::fs::rename(&part.0, out)).map_err(|e| failed(&part.name())(e.into()))?;
            report
        }
        _ => rewrite(&mut std::io::sink()).map_err(failed(&name))?,
    };
    tell(args, dialect, &report)?;
    if args.check { refuse(&name, &report, args.partial) } else { Ok(()) }
}

/// Half a file, which goes away unless it is renamed.
struct Part(PathBuf);

impl Part {
    fn beside(out: &Path) -> Self {
        let mut name = out.file_name().unwrap_or_default().to_os_string();
        name.push(format!(".part{}", std::process::id()));
        Self(out.with_file_name(name))
    }

    fn name(&self) -> String {
        self.0.display().to_string()
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

fn refuse(name: &str, report: &Report, partial: bool) -> Result<()> {
    let n = report.problems.len();
    let list = program::summarized(&report.problems);
    if report.rewritten == 0 {
        return Err(CliError::Failed(format!(
            "{name}: none of its {n} targets can be rewritten, nothing was written: {list}"
        )));
    }
    if n > 0 && !partial {
        return Err(CliError::Failed(format!(
            "{name}: {n} targets cannot be rewritten, and nothing was written (--partial writes the others): {list}"
        )));
    }
    Ok(())
}

fn tell(args: &Args, dialect: Dialect, report: &Report) -> Result<()> {
    let mm = |x: f64| x * 1e3;
    if args.json {
        let both = |v: &[f64; 2], turn: &[f64; 2]| json!({ "mean_mm": mm(v[0]), "max_mm": mm(v[1]), "mean_deg": turn[0].to_degrees(), "max_deg": turn[1].to_degrees() });
        let mut value = json!({
            "targets": report.rewritten,
            "largest_move_mm": mm(report.largest_move),
            "problems": report.problems.iter().map(ToString::to_string).collect::<Vec<_>>(),
            "dialect": dialect.name(),
            "before": both(&report.before, &report.turned[0]),
            "after": both(&report.after, &report.turned[1]),
            "meant_with": report.setups.iter().map(|(s, n)| json!({ "tool_and_frame": s, "targets": n })).collect::<Vec<_>>(),
            "unknown_places": report.unknown_places,
        });
        if args.check {
            value["rows"] = report
                .rows
                .iter()
                .map(|r| {
                    json!({ "line": r.line, "name": r.name, "move_mm": mm(r.moved), "before_mm": mm(r.before), "after_mm": mm(r.after) })
                })
                .collect();
        }
        return say(serde_json::to_string_pretty(&value)?);
    }
    if args.check {
        let mut rows = vec![["line", "target", "moves, mm", "error before", "after"].map(String::from).to_vec()];
        rows.extend(report.rows.iter().map(|r| {
            let name = if r.name.is_empty() { "(inline)" } else { &r.name };
            vec![
                r.line.to_string(),
                name.to_owned(),
                format!("{:.3}", mm(r.moved)),
                format!("{:.3}", mm(r.before)),
                format!("{:.4}", mm(r.after)),
            ]
        }));
        for line in table::lines(&rows) {
            say(line)?;
        }
    }
    let words = if args.check { "would be rewritten" } else { "rewritten" };
    say(format!("{} targets {words}, the farthest moved by {:.3} mm", report.rewritten, mm(report.largest_move)))?;
    say(format!(
        "Error that the model predicts, mm: mean {:.3}, max {:.3} before; mean {:.4}, max {:.4} after",
        mm(report.before[0]),
        mm(report.before[1]),
        mm(report.after[0]),
        mm(report.after[1])
    ))?;
    for (setup, n) in &report.setups {
        say(format!("  {n} meant with {setup}"))?;
    }
    if report.unknown_places > 0 {
        say(format!(
            "  {} motions go to places that the running program computes: what is approached from there has no known sense",
            report.unknown_places
        ))?;
    }
    if !args.check {
        if !report.problems.is_empty() {
            let n = report.problems.len();
            say(format!("  {n} left as they are: {}", program::summarized(&report.problems)))?;
        }
        if let Some(out) = &args.out {
            say(format!("Wrote {}", out.display()))?;
        }
    }
    Ok(())
}
