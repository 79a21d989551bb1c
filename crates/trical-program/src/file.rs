//! Compensation from file to file.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use trical_model::Model;

use crate::dialects::Dialect;
use crate::error::ProgramError;
use crate::frames::Frames;
use crate::options::Options;
use crate::report::{Report, summarized};
use crate::rewriting::compensate;

/// What to do with which file.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a> {
    /// The program.
    pub program: &'a Path,
    /// Where the rewritten one goes; `None` writes nothing.
    pub out: Option<&'a Path>,
    /// Name of the dialect, where the extension is not to say it.
    pub dialect: Option<&'a str>,
    /// Files with tools and frames.
    pub frames: &'a [PathBuf],
    /// Write even where targets are left as they are.
    pub partial: bool,
}

impl Job<'_> {
    /// The dialect that was named, or that the extension says.
    ///
    /// # Errors
    /// One sentence that lists those that are known.
    pub fn dialect(&self) -> Result<Dialect, ProgramError> {
        match self.dialect {
            Some(d) => Dialect::named(d).ok_or_else(|| {
                ProgramError::Input(format!("the dialect '{d}' is not known; known are {}", Dialect::known()))
            }),
            None => Dialect::of(self.program).ok_or_else(|| {
                ProgramError::Input(format!(
                    "{}: the extension does not say the program's dialect; known are {}; --dialect NAME says it",
                    self.program.display(),
                    Dialect::known()
                ))
            }),
        }
    }

    /// Rewrites the program. The output appears whole, or not at all; without one, nothing is refused for targets that are
    /// left (see [`left`]).
    ///
    /// # Errors
    /// [`ProgramError`].
    pub fn run(&self, nominal: &Model, model: &Model, options: &Options) -> Result<Report, ProgramError> {
        let dialect = self.dialect()?;
        let name = self.program.display().to_string();
        let mut frames = Frames::default();
        for path in self.frames {
            frames.or(&declared_frames(path)?);
        }
        let bytes =
            std::fs::read(self.program).map_err(|e| ProgramError::Input(format!("{name}: cannot be read: {e}")))?;
        let rewrite = |sink: &mut dyn Write| compensate(&bytes, &name, dialect, nominal, model, &frames, options, sink);
        let Some(out) = self.out else { return rewrite(&mut std::io::sink()) };
        let part = Part::beside(out);
        let mut sink = BufWriter::with_capacity(1 << 20, File::create(&part.0)?);
        let report = rewrite(&mut sink)?;
        left(&name, &report, self.partial)?;
        sink.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_all()?;
        std::fs::rename(&part.0, out)?;
        Ok(report)
    }
}

/// Refuses a result in which targets are left as they are, unless that is wanted; and one without any that was rewritten.
///
/// # Errors
/// [`ProgramError::Left`].
pub fn left(name: &str, report: &Report, partial: bool) -> Result<(), ProgramError> {
    let n = report.problems.len();
    if n == 0 || (partial && report.rewritten > 0) {
        return Ok(());
    }
    let list = summarized(&report.problems);
    Err(ProgramError::Left(if partial {
        format!("{name}: none of its {n} targets can be rewritten, and nothing was written: {list}")
    } else {
        format!(
            "{name}: {n} targets cannot be rewritten, and nothing was written (--partial writes the others): {list}"
        )
    }))
}

/// Half a file, which goes away unless it is renamed.
struct Part(PathBuf);

impl Part {
    fn beside(out: &Path) -> Self {
        let mut name = out.file_name().unwrap_or_default().to_os_string();
        name.push(format!(".part{}", std::process::id()));
        Self(out.with_file_name(name))
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
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
