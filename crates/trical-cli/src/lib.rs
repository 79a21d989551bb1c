//! The `trical` program: commands, progress, reports. Algorithms live in the other crates. The binary and the command that the Python
//! package installs both call [`run`].

/// Writes a line on standard error; one that nobody can read any more must not end the program while the arm moves.
macro_rules! note {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($text)*);
    }};
}
pub(crate) use note;

pub use commands::sample::FILES as SAMPLE;

mod commands;
mod error;
mod input;
mod interrupt;
mod measure_view;
mod progress;

use std::ffi::OsString;
use std::io::Write as _;
#[cfg(unix)]
use std::sync::Arc;

use clap::{CommandFactory, Parser, Subcommand};
use trical_report::table;

use crate::error::CliError;

/// Makes an industrial robot arm accurate with three indicators and three balls, and says which physics its model
/// lacks.
#[derive(Parser)]
#[command(name = "trical", version, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Identify the arm's true geometry and compliance from recordings
    Identify(commands::identify::Args),
    /// Score a model on recordings: position errors before and after, by region
    Validate(commands::validate::Args),
    /// Check with a few new touches whether an arm is still as it was calibrated
    Compare(commands::compare::Args),
    /// Compare a folder of sessions with a calibration, and say when the next one is due
    History(commands::history::Args),
    /// Find which physics the model lacks: where, what, how sure; model it, and test it on unseen poses
    Diagnose(commands::diagnose::Args),
    /// List the effects that a diagnosis can name
    Effects(commands::effects::Args),
    /// Show everything on a virtual cell: conceal a flaw, plan, measure, diagnose, validate, compensate, report
    Demo(commands::demo::Args),
    /// Write files to start from: a commented robot.toml and cell.toml, a recording with the columns
    Init(commands::init::Args),
    /// Write a robot, a cell and 90 touches by an arm with a flaw, to try the program on
    Sample(commands::init::Args),
    /// Plan collision-free, informative touches
    Plan(commands::plan::Args),
    /// Simulate whole calibrations: error against number of touches, chosen and random touches, platforms of balls
    Study(commands::study::Args),
    /// Drive robot and indicators through a plan, and record
    Measure(commands::measure::Args),
    /// Record the joints of an arm that is guided by hand into sockets, a row for every key press
    Record(commands::record::Args),
    /// Show how far repeat visits scatter: by ball, by sense of approach, over the session
    Repeatability(commands::repeatability::Args),
    /// Simulate a robot, balls and indicators that answer on a pseudo-terminal and a TCP port
    VirtualCell(commands::virtual_cell::Args),
    /// Try the gauge: list ports, watch, test, master
    Gauge(commands::gauge::Args),
    /// Try the robot controller: ping, read joints, jog
    Robot(commands::robot::Args),
    /// Rewrite a robot program so that the real arm reaches the poses in it
    Compensate(commands::compensate::Args),
    /// Write the calibrated arm for other programs: a URDF, a table of modified Denavit-Hartenberg parameters
    Export(commands::export::Args),
    /// Convert recordings from CSV to MCAP and back, an arm's URDF to robot.toml
    Convert(commands::convert::Args),
    /// Print a script with which a shell completes commands and options
    Completions(commands::completions::Args),
}

/// Bytes of a message; what a file holds is part of some.
const LONGEST_MESSAGE: usize = 900;

/// A message as a terminal bears it: not too long, one line, and nothing of a file that a terminal would obey.
fn shown(message: &str) -> String {
    let end = message.floor_char_boundary(LONGEST_MESSAGE);
    let text: String = message[..end].chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    if end < message.len() { text + "..." } else { text }
}

/// Runs the program with these arguments, the program's own name first, and returns its exit code: 0 where all went well, 2 where the
/// arguments cannot be read.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        // the help that was asked for, or what is wrong: of that nobody can be told where it cannot be written
        Err(e) => {
            let told = e.print().and_then(|()| std::io::stdout().flush());
            return if e.use_stderr() { 2 } else { code(written(told)) };
        }
    };
    // a file that reached the limit of its size is then an error of writing, and no end in the middle of a motion
    #[cfg(unix)]
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
    code(match cli.command {
        Command::Identify(args) => commands::identify::run(&args),
        Command::Validate(args) => commands::validate::run(&args),
        Command::Compare(args) => commands::compare::run(&args),
        Command::History(args) => commands::history::run(&args),
        Command::Diagnose(args) => commands::diagnose::run(&args),
        Command::Effects(args) => commands::effects::run(&args),
        Command::Demo(args) => commands::demo::run(&args),
        Command::Init(args) => commands::init::run(&args),
        Command::Sample(args) => commands::sample::run(&args),
        Command::Plan(args) => commands::plan::run(&args),
        Command::Study(args) => commands::study::run(&args),
        Command::Measure(args) => commands::measure::run(&args),
        Command::Record(args) => commands::record::run(&args),
        Command::Repeatability(args) => commands::repeatability::run(&args),
        Command::VirtualCell(args) => commands::virtual_cell::run(&args),
        Command::Gauge(args) => commands::gauge::run(&args),
        Command::Robot(args) => commands::robot::run(&args),
        Command::Compensate(args) => commands::compensate::run(&args),
        Command::Export(args) => commands::export::run(&args),
        Command::Convert(args) => commands::convert::run(&args),
        Command::Completions(args) => commands::completions::run(&args, Cli::command()),
    })
}

/// The exit code; what went wrong is said.
fn code(result: Result<(), CliError>) -> u8 {
    match result {
        Ok(()) => 0,
        Err(e) => {
            note!("trical: {}", shown(&e.to_string()));
            e.code()
        }
    }
}

/// Prints a line on standard output.
pub(crate) fn say(text: impl AsRef<str>) -> Result<(), CliError> {
    written(writeln!(std::io::stdout().lock(), "{}", text.as_ref()))
}

/// Whether standard output took what was written; a reader that went away (`| head`) ends the program quietly.
fn written(result: std::io::Result<()>) -> Result<(), CliError> {
    // of a pipe with a name, as some shells of Windows have them
    const ERROR_PIPE_NOT_CONNECTED: i32 = 233;
    let is_gone = |e: &std::io::Error| {
        e.kind() == std::io::ErrorKind::BrokenPipe
            || cfg!(windows) && e.raw_os_error() == Some(ERROR_PIPE_NOT_CONNECTED)
    };
    match result {
        Err(e) if is_gone(&e) => std::process::exit(0),
        other => other.map_err(|e| CliError::Failed(format!("standard output: {e}"))),
    }
}

/// Prints what a machine reads.
pub(crate) fn say_json(value: &impl serde::Serialize) -> Result<(), CliError> {
    say(serde_json::to_string_pretty(value)?)
}

/// A word as a shell takes it whole: for cmd.exe single quotes are none.
pub(crate) fn quoted(word: &str) -> String {
    if cfg!(windows) { format!("\"{word}\"") } else { format!("'{word}'") }
}

/// Characters in a line of prose.
pub(crate) const LINE: usize = 108;

/// Prints prose in lines that each begin with `indent`.
pub(crate) fn say_wrapped(text: &str, indent: &str) -> Result<(), CliError> {
    say_lines(table::wrapped(text, LINE, indent))
}

/// Prints one line after the other.
pub(crate) fn say_lines(lines: impl IntoIterator<Item = impl AsRef<str>>) -> Result<(), CliError> {
    lines.into_iter().try_for_each(say)
}
