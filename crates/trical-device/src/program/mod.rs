//! Robot programs rewritten so that the real arm goes where they say.
//!
//! A program is bytes. A reader for each dialect finds the targets in them, the tools and frames that they are meant with,
//! and the order in which the arm visits them ([`scan`]); [`compensation`] turns each target into the one that brings the
//! real arm to the same place; only the bytes of changed numbers are replaced, block by block, straight into the output.
//!
//! ```
//! use trical_device::program::{Dialect, Frames, Options, compensate};
//! use trical_model::{Cell, Model, Robot};
//! # let robot = Robot::parse(include_str!("../../../../cells/irb120/robot.toml"), "robot.toml")?;
//! # let cell = Cell::parse(include_str!("../../../../cells/irb120/cell.toml"), "cell.toml")?;
//! let nominal = Model::nominal(robot, cell);
//! let model = nominal.clone(); // of a model file, else
//! let program = b"x_mm,y_mm,z_mm,qw,qx,qy,qz\r\n350,50,320,0,0.6,0.8,0\r\n";
//! let mut out = Vec::new();
//! let frames = Frames::default();
//! let done = compensate(program, "p.csv", Dialect::Csv, &nominal, &model, &frames, &Options::default(), &mut out)?;
//! assert_eq!(done.rewritten, 1);
//! assert!(out.ends_with(program)); // behind the mark; a model that is the nominal arm changes nothing
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`rapid`], [`krl`], [`fanuc`], [`urscript`], [`poses_csv`] | one reader a dialect |
//! | [`scan`] | what they find |
//! | [`literal`] | numbers as poses and joint values, both ways |
//! | [`text`] | bytes, numbers, lines |
//! | [`frames`] | tools and work objects, `--frames` files |
//! | [`branch`] | configurations |
//! | [`compensation`] | targets to targets |
//! | [`file`] | the same from file to file |

pub mod branch;
pub mod compensation;
pub mod fanuc;
pub mod file;
pub mod frames;
pub mod krl;
pub mod literal;
pub mod poses_csv;
pub mod rapid;
mod report;
pub mod scan;
pub mod text;
pub mod urscript;

use std::io::Write;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use thiserror::Error;
use trical_model::interrupt::checkpoint;
use trical_model::pose::rotation_z;
use trical_model::{Model, Pose, Robot};

pub use file::{Job, left};
pub use frames::{Frames, ToolFrame};
pub use report::{Problem, Report, TargetRow, summarized};

use compensation::{Compensator, Done, Start};
use report::Tally;
use scan::{Scan, Spot};

/// What the comment says that keeps a program from being compensated twice.
pub const MARK: &str = "compensated by TriCal";

/// Targets that one thread takes at a time.
const BLOCK: usize = 2048;

/// Why a program cannot be compensated.
#[derive(Debug, Error)]
pub enum ProgramError {
    /// Wrong input, in one sentence.
    #[error("{0}")]
    Input(String),
    /// Targets that cannot be rewritten, in one sentence; nothing was written.
    #[error("{0}")]
    Left(String),
    /// The output cannot be written.
    #[error("cannot be written: {0}")]
    Write(#[from] std::io::Error),
}

/// Languages of programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dialect {
    /// ABB RAPID: .mod, .modx, .sys, .prg, .pgf.
    Rapid,
    /// KUKA KRL: .src, .dat, .sub.
    Krl,
    /// FANUC TP listing: .ls.
    Fanuc,
    /// Universal Robots script: .script, .urscript.
    UrScript,
    /// A table of poses or joint values: .csv.
    Csv,
}

impl Dialect {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Rapid, Self::Krl, Self::Fanuc, Self::UrScript, Self::Csv];

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        ["rapid", "krl", "fanuc", "urscript", "csv"][self as usize]
    }

    /// What it is, for people.
    #[must_use]
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Rapid => "rapid (ABB: .mod .modx .sys .sysx .prg)",
            Self::Krl => "krl (KUKA: .src .dat .sub)",
            Self::Fanuc => "fanuc (.ls)",
            Self::UrScript => "urscript (.script .urscript)",
            Self::Csv => "csv (.csv)",
        }
    }

    /// All of them in words.
    #[must_use]
    pub fn known() -> String {
        Self::ALL.map(Self::in_words).join(", ")
    }

    /// By name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|d| d.name() == name)
    }

    /// By the file's extension.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "mod" | "modx" | "sys" | "sysx" | "prg" => Some(Self::Rapid),
            "src" | "dat" | "sub" => Some(Self::Krl),
            "ls" => Some(Self::Fanuc),
            "script" | "urscript" => Some(Self::UrScript),
            "csv" => Some(Self::Csv),
            _ => None,
        }
    }

    /// Targets, frames and order of a program.
    ///
    /// # Errors
    /// In words, where the file is none of this dialect.
    pub fn scan(self, bytes: &[u8]) -> Result<Scan, String> {
        match self {
            Self::Rapid => Ok(rapid::scan(bytes)),
            Self::Krl => Ok(krl::scan(bytes)),
            Self::Fanuc => Ok(fanuc::scan(bytes)),
            Self::UrScript => Ok(urscript::scan(bytes)),
            Self::Csv => poses_csv::scan(bytes),
        }
    }

    fn expected(self) -> &'static str {
        match self {
            Self::Rapid => "ABB RAPID with robtarget or jointtarget data",
            Self::Krl => "KUKA KRL with E6POS, POS, FRAME, E6AXIS or AXIS data",
            Self::Fanuc => "a FANUC .ls listing with positions in /POS",
            Self::UrScript => "Universal Robots script with p[...] or joints in movej, movel, movep or movec",
            Self::Csv => "rows of x_mm,y_mm,z_mm,qw,qx,qy,qz or q1_deg,...",
        }
    }

    /// Where the mark is put, and the line that has it.
    fn mark(self, bytes: &[u8], model: &str) -> (usize, String) {
        let end = if bytes.windows(2).take(100_000).any(|w| w == b"\r\n") { "\r\n" } else { "\n" };
        let version = env!("CARGO_PKG_VERSION");
        // one line of plain text, whatever the model's file is called
        let model: String = model.chars().map(|c| if c.is_ascii_graphic() || c == ' ' { c } else { '?' }).collect();
        let bom = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        match self {
            Self::Rapid => (rapid::header(bytes).max(bom), format!("! {MARK} {version} with {model}{end}")),
            Self::Krl => (krl::header(bytes).max(bom), format!("; {MARK} {version} with {model}{end}")),
            // a remark of a TP program holds 32 characters
            Self::Fanuc => (fanuc::header(bytes), format!("   :  !{MARK} {version} ;{end}")),
            Self::UrScript | Self::Csv => (bom, format!("# {MARK} {version} with {model}{end}")),
        }
    }
}

/// What a program does not say.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Name of the model file, for the mark.
    pub model_name: String,
    /// Tool of targets for which the program names none; without it, the cell's.
    pub tool: Option<String>,
    /// Frame of targets for which the program names none; without it, the robot's base.
    pub frame: Option<String>,
    /// Temperature at which the program runs, degC.
    pub temp_c: Option<f64>,
    /// Time at which it runs, s since the recording began; not given, it is long after, but for models that drift without an end.
    pub time_s: Option<f64>,
    /// The same in poses, for models of recordings without times.
    pub seq: Option<f64>,
    /// Mass on the flange beyond the tool, kg.
    pub payload_kg: Option<f64>,
    /// Take the solution nearest to the target before, whatever configuration the text demands.
    pub configuration_off: bool,
    /// Targets are meant in the arm's own base, wherever it stands: what was identified of the base is left out.
    pub own_base: bool,
    /// Keep a row for each target in the report.
    pub details: bool,
}

/// Reads tools and frames from a `--frames` file: TOML, or another program that declares them (`CalibData.mod`,
/// `$config.dat`).
///
/// # Errors
/// One sentence.
pub fn load_frames(path: &Path) -> Result<Frames, ProgramError> {
    let Some(dialect) = Dialect::of(path).filter(|d| *d != Dialect::Csv) else { return Frames::load(path) };
    let file = path.display();
    let bytes = std::fs::read(path).map_err(|e| ProgramError::Input(format!("{file}: cannot be read: {e}")))?;
    let scan = dialect.scan(&bytes).map_err(|e| ProgramError::Input(format!("{file}: {e}")))?;
    Ok(scan.frames)
}

/// [`load_frames`] of a file that is to declare something: one that declares nothing is the wrong one.
///
/// # Errors
/// One sentence.
pub fn declared_frames(path: &Path) -> Result<Frames, ProgramError> {
    /// What a reader knows without being told.
    const OWN: [&str; 3] = ["0", "tool0", "wobj0"];
    let found = load_frames(path)?;
    let mut names = found.tools.keys().chain(found.frames.keys());
    if found.world.is_some() || names.any(|n| !OWN.contains(&n.as_str())) {
        return Ok(found);
    }
    Err(ProgramError::Input(format!(
        "{}: found no tool and no frame, expected [tools.NAME], [frames.NAME] or [world], or a program that declares some",
        path.display()
    )))
}

/// The controller's world in the arm's foot, where the dialect's controllers do not put it there: FANUC's lies where axis 2
/// passes axis 1.
fn usual_world(dialect: Dialect, robot: &Robot) -> Option<Pose> {
    let first = robot.joints.first().filter(|_| dialect == Dialect::Fanuc)?;
    let lifted = nalgebra::Vector3::new(0.0, 0.0, first.d);
    let axis = Pose { rotation: rotation_z(0.0), translation: lifted };
    let translation = robot.root_from_zero.compose(&axis).translation;
    Some(Pose { rotation: rotation_z(0.0), translation })
}

/// Rewrites the targets of a program into `sink`. `nominal` is the arm as the controller believes it, `model` as it is.
/// Targets that cannot be rewritten are listed in the report and stay as they are.
///
/// The program stands in memory once, with some 200 bytes for each target; what is written is not kept. All processors are
/// used, and their number changes no byte.
///
/// # Errors
/// [`ProgramError`]; what was written to `sink` by then is worthless.
#[expect(clippy::too_many_arguments, reason = "a program has a name and a language, a model two sides")]
pub fn compensate(
    bytes: &[u8],
    file: &str,
    dialect: Dialect,
    nominal: &Model,
    model: &Model,
    frames: &Frames,
    options: &Options,
    sink: &mut dyn Write,
) -> Result<Report, ProgramError> {
    let input = |e: String| ProgramError::Input(format!("{file}: {e}"));
    if u32::try_from(bytes.len()).is_err() {
        return Err(input("is larger than 4 GB; divide the program".into()));
    }
    if bytes.contains(&0) {
        return Err(input(
            "holds zero bytes: a binary program, or text in UTF-16; expected plain text (ASCII, UTF-8, Latin-1)".into(),
        ));
    }
    if contains(bytes, MARK.as_bytes()) {
        return Err(input(format!(
            "is compensated already (it has the mark '{MARK} ...'); compensate the original instead"
        )));
    }
    let mut scan = dialect.scan(bytes).map_err(input)?;
    if scan.spots.is_empty() && scan.problems.is_empty() {
        return Err(input(format!("no targets found; expected {}", dialect.expected())));
    }
    let mut known = std::mem::take(&mut scan.frames);
    known.or(frames);
    known.world = known.world.or_else(|| usual_world(dialect, &nominal.robot));
    for name in [&options.tool, &options.frame].into_iter().flatten() {
        if !known.tools.contains_key(&name.to_lowercase()) && !known.frames.contains_key(&name.to_lowercase()) {
            let all = known.tools.keys().chain(known.frames.keys()).cloned().collect::<Vec<_>>().join(", ");
            return Err(input(format!(
                "'{name}' is neither a tool nor a frame of the program or of --frames; known are {all}"
            )));
        }
    }
    report::lonely(&mut scan, &mut known, options);
    let all = Compensator::new(&scan, bytes, nominal, model, &known, options)?;
    let mut out = Splice { bytes, at: 0, sink };
    let (at, line) = dialect.mark(bytes, &options.model_name);
    let mut mark = Some(at);
    let mut tally = Tally::new(&scan, bytes, options);
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(16);
    let size = BLOCK * threads;
    // one thread goes through the program ahead of the others, which rewrite what is known; what they cannot write, nobody wants
    let failed = &AtomicBool::new(false);
    std::thread::scope(|scope| -> Result<(), ProgramError> {
        let (give, starts) = channel();
        let all = &all;
        scope.spawn(move || {
            // whoever no longer listens has failed, and says so
            all.starts(size, &mut |block| drop(give.send(block)), &|| failed.load(Ordering::Relaxed));
        });
        let mut write = || -> Result<(), ProgramError> {
            for spots in scan.spots.chunks(size) {
                let Some(starts) = next(&starts)? else { break };
                for (spot, done) in spots.iter().zip(in_parallel(all, spots, &starts)) {
                    if mark.is_some_and(|m| m <= scan.at(spot)) {
                        out.insert(mark.take().unwrap_or(0), &line)?;
                    }
                    if let Ok(done) = &done {
                        let mut edits: Vec<_> = done.edits.iter().collect();
                        edits.sort_by_key(|(span, _)| span.at);
                        for (span, text) in edits {
                            out.replace(span.at as usize, span.len as usize, text)?;
                        }
                    }
                    tally.take(spot, done);
                }
            }
            Ok(())
        };
        let result = write();
        failed.store(result.is_err(), Ordering::Relaxed);
        result
    })?;
    if let Some(at) = mark {
        out.insert(at, &line)?;
    }
    out.finish()?;
    Ok(tally.report())
}

/// What the thread ahead has solved, or nothing where it has ended. Whoever is waited for can be stopped meanwhile.
fn next<T>(starts: &Receiver<T>) -> Result<Option<T>, ProgramError> {
    loop {
        checkpoint().map_err(|e| ProgramError::Input(e.to_string()))?;
        match starts.recv_timeout(Duration::from_millis(50)) {
            Ok(block) => return Ok(Some(block)),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Ok(None),
        }
    }
}

fn in_parallel(all: &Compensator<'_>, spots: &[Spot], starts: &[Result<Start, String>]) -> Vec<Result<Done, String>> {
    let work = |spots: &[Spot], starts: &[Result<Start, String>]| -> Vec<Result<Done, String>> {
        let mut ws = all.workspaces();
        let one = |(spot, start): (&Spot, &Result<Start, String>)| match start {
            Ok(start) => all.rewrite(spot, start, &mut ws),
            Err(e) => Err(e.clone()),
        };
        spots.iter().zip(starts).map(one).collect()
    };
    if spots.len() <= BLOCK {
        return work(spots, starts);
    }
    std::thread::scope(|scope| {
        let blocks: Vec<_> = spots
            .chunks(BLOCK)
            .zip(starts.chunks(BLOCK))
            .map(|(spots, starts)| (scope.spawn(move || work(spots, starts)), spots.len()))
            .collect();
        let died = |n: usize| (0..n).map(|_| Err("the calculation failed".to_owned())).collect();
        blocks.into_iter().flat_map(|(b, n)| b.join().unwrap_or_else(|_| died(n))).collect()
    })
}

fn contains(bytes: &[u8], word: &[u8]) -> bool {
    let first = word.first().copied().unwrap_or(0);
    let mut at = 0;
    while let Some(k) = bytes[at..].iter().position(|b| *b == first) {
        if bytes[at + k..].starts_with(word) {
            return true;
        }
        at += k + 1;
    }
    false
}

/// Copies a file with pieces replaced.
struct Splice<'a> {
    bytes: &'a [u8],
    at: usize,
    sink: &'a mut dyn Write,
}

impl Splice<'_> {
    fn insert(&mut self, at: usize, text: &str) -> Result<(), ProgramError> {
        self.replace(at, 0, text)
    }

    fn replace(&mut self, at: usize, len: usize, text: &str) -> Result<(), ProgramError> {
        // targets stand one after the other, never inside each other
        let between = self.bytes.get(self.at..at).ok_or_else(|| {
            ProgramError::Input(format!("two targets overlap at byte {at}; this is an error of the program's reader"))
        })?;
        self.sink.write_all(between)?;
        self.sink.write_all(text.as_bytes())?;
        self.at = at + len;
        Ok(())
    }

    fn finish(&mut self) -> Result<(), ProgramError> {
        self.sink.write_all(self.bytes.get(self.at..).unwrap_or(&[]))?;
        Ok(())
    }
}
