//! Compensation from file to file.

use std::cell::{Cell, OnceCell, RefCell};
use std::collections::HashMap;
use std::fs::File;
use std::io::{BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use trical_model::pose::rotation_zyx;
use trical_model::{Model, Pose};
use trical_recording::whole::Part as Whole;

use crate::dialects::{Dialect, LARGEST, MARK, TOO_LARGE, krl};
use crate::elsewhere::{Elsewhere, Nowhere, Outside};
use crate::error::ProgramError;
use crate::flow::at_calls;
use crate::folders::{entry, name_of, not_read, paths, read_small, resolved};
use crate::frames::{AT, Frame, Frames, TIMES};
use crate::modules::Modules;
use crate::options::{Options, Spelling};
use crate::report::{Report, summarized};
use crate::rewriting::{Part, Program, compensate};
use crate::scan::{Setup, hashed};
use crate::text::contains;

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
        if self.program.is_dir() {
            let folder = self.program.display();
            return Err(ProgramError::Input(format!("{folder}: is a folder; expected a program")));
        }
        match self.dialect {
            Some(d) => Dialect::named(d).ok_or_else(|| {
                ProgramError::Input(format!("the dialect '{d}' is not known; known are {}", Dialect::known()))
            }),
            None => Dialect::of(self.program).ok_or_else(|| ProgramError::NoDialect {
                file: self.program.display().to_string(),
                known: Dialect::known(),
            }),
        }
    }

    /// Rewrites the program. The output appears whole, or not at all; without one, nothing is refused for targets that are
    /// left (see [`refuse_left_out`]).
    ///
    /// A KRL program is its .src and the .dat beside it: both are read and written, whichever is named, and `$config.dat` of the
    /// same folder or controller gives tools and bases. The other modules of a RAPID program are read for its tools, work objects and calls.
    ///
    /// # Errors
    /// [`ProgramError`].
    pub fn run(&self, nominal: &Model, model: &Model, options: &Options) -> Result<Report, ProgramError> {
        let dialect = self.dialect()?;
        let mut frames = Frames::default();
        for path in self.frames {
            frames.or(&declared_frames(path)?);
        }
        let mut read_with = Vec::new();
        let files = if dialect == Dialect::Krl { together(self.program) } else { vec![self.program.to_owned()] };
        if let Some(config) = of_controller(self.program, "$config.dat").filter(|_| dialect == Dialect::Krl) {
            frames.or(&load_frames(&config)?);
            read_with.push(config.display().to_string());
        }
        let beside = Beside::of(self.program);
        if dialect == Dialect::Krl {
            frames.world = frames.world.or_else(|| beside.world());
        }
        read_with.extend(files.iter().filter(|f| *f != self.program).map(|f| f.display().to_string()));
        let modules = Modules::beside(self.program, &frames, options.spelling);
        let names: Vec<String> = files.iter().map(|f| f.display().to_string()).collect();
        let (bytes, ends) = read_all(&files, &names)?;
        let outs = self.outputs(&files)?;
        let mut halves = Vec::new();
        let mut writers = Vec::new();
        for out in &outs {
            let (part, file) = Whole::of(out)?;
            halves.push(part);
            writers.push(BufWriter::with_capacity(1 << 20, file));
        }
        let mut nowhere: Vec<_> = files.iter().skip(outs.len()).map(|_| std::io::sink()).collect();
        let sinks =
            writers.iter_mut().map(|w| w as &mut dyn Write).chain(nowhere.iter_mut().map(|s| s as &mut dyn Write));
        let parts =
            sinks.zip(names.iter().zip(&ends)).map(|(sink, (name, end))| Part { name, end: *end, sink }).collect();
        let elsewhere: &dyn Elsewhere = match dialect {
            Dialect::Krl => &beside,
            Dialect::Rapid => &modules,
            _ => &Nowhere,
        };
        let program = Program { bytes: &bytes, parts, dialect, elsewhere };
        let mut report = compensate(program, nominal, model, &frames, options)?;
        report.cautions.extend(beside.unread());
        let read = beside.read.into_inner();
        read_with.extend(read.into_iter().filter(|file| !read_with.contains(file)).collect::<Vec<_>>());
        if dialect == Dialect::Rapid {
            read_with.extend(modules.used());
            report.cautions.extend(modules.unread());
        }
        report.read_with = read_with;
        if self.out.is_none() {
            return Ok(report);
        }
        refuse_left_out(&self.program.display().to_string(), &report, self.partial, options.spelling)?;
        for mut writer in writers {
            writer.flush()?;
            writer.get_ref().sync_all()?;
        }
        for (part, out) in halves.into_iter().zip(&outs) {
            part.put()?;
            report.written.push(out.display().to_string());
        }
        Ok(report)
    }

    /// Where the rewritten files go; nowhere where nothing is written.
    fn outputs(&self, files: &[PathBuf]) -> Result<Vec<PathBuf>, ProgramError> {
        let Some(out) = self.out else { return Ok(Vec::new()) };
        let outs: Vec<PathBuf> =
            files.iter().map(|f| if f == self.program { out.to_owned() } else { beside(out, f) }).collect();
        match outs.iter().find(|o| files.len() > 1 && files.contains(o)) {
            Some(same) => Err(ProgramError::Input(format!(
                "{}: is a file of the program itself; choose another folder or name for the output",
                same.display()
            ))),
            None => Ok(outs),
        }
    }
}

/// The bytes of files one behind the other, and where each ends.
fn read_all(files: &[PathBuf], names: &[String]) -> Result<(Vec<u8>, Vec<usize>), ProgramError> {
    let (mut bytes, mut ends) = (Vec::new(), Vec::new());
    for (path, name) in files.iter().zip(names) {
        read_program(path, name, &mut bytes)?;
        ends.push(bytes.len());
    }
    Ok((bytes, ends))
}

/// The files of a KRL program, declarations first.
fn together(program: &Path) -> Vec<PathBuf> {
    let other = |extension: &str| {
        let name = program.with_extension(extension);
        let folder = program.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let found = entry(folder, &name.file_name()?.to_string_lossy())?;
        Some(program.with_file_name(found.file_name()?)).filter(|p| p.is_file())
    };
    let extension = program.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let own = program.to_owned();
    match extension.as_str() {
        "src" => other("dat").into_iter().chain([own]).collect(),
        "dat" => [own].into_iter().chain(other("src")).collect(),
        _ => vec![own],
    }
}

/// Folders in which files of a KRL controller are looked for: the program's, and `Program`, `System` and `Mada` of the controller's files.
fn places(program: &Path) -> impl Iterator<Item = PathBuf> {
    let folders: Vec<PathBuf> =
        program.parent().into_iter().flat_map(|folder| folder.ancestors().take(5)).map(Path::to_owned).collect();
    folders.into_iter().flat_map(|folder| {
        let own = ["Program", "System", "Mada"].map(|name| entry(&folder, name));
        std::iter::once(folder).chain(own.into_iter().flatten())
    })
}

/// A file of a KRL controller, by its name without regard to case.
fn of_controller(program: &Path, name: &str) -> Option<PathBuf> {
    let whole = resolved(program).ok()?;
    places(&whole).find_map(|place| entry(&place, name).filter(|p| p.is_file() && *p != whole))
}

/// The sources of a KRL controller beside a program, the nearest first.
fn sources(program: &Path) -> impl Iterator<Item = PathBuf> {
    let own = program.to_owned();
    let is_source = move |p: &PathBuf| {
        let extension = p.extension().unwrap_or_default();
        let is_one = extension.eq_ignore_ascii_case("src") || extension.eq_ignore_ascii_case("sub");
        is_one && *p != own && p.is_file()
    };
    places(program).flat_map(move |place| paths(&place, &is_source))
}

/// Takes over a tool or a frame that a caller sets and its file declares, under a name that says whose it is; what its file does not
/// declare means the same in all files.
fn take_with(is_tool: bool, setup: &mut Setup, theirs: &Frames, known: &mut Frames, file: &str) {
    let (name, theirs, known) = (setup.slot(is_tool), theirs.of(is_tool), known.of_mut(is_tool));
    let is_theirs = |own: &&String| *own != "0" && (theirs.contains_key(*own) || own.contains(TIMES));
    let Some(own) = name.as_ref().filter(is_theirs) else { return };
    let whose = match own.split_once(AT) {
        Some((own, at)) => format!("{own} of {file}, byte {at}"),
        None => format!("{own} of {file}"),
    };
    let value = theirs.get(own).cloned();
    known.insert(
        whose.clone(),
        value.unwrap_or_else(|| Err(format!("is meant with '{own}', which {file} sets and does not give as numbers"))),
    );
    *name = Some(whose);
}

/// Files that are looked through for GLOBAL routines, at most.
const MOST_FILES: usize = 500;

/// The GLOBAL routines of the controller's files, by their hashed names: the nearest of each; and files that are not read.
fn globals(program: &Path) -> (HashMap<u64, PathBuf>, Vec<String>) {
    let (mut found, mut unread) = (HashMap::new(), Vec::new());
    let Ok(whole) = resolved(program) else { return (found, unread) };
    for (number, path) in sources(&whole).enumerate() {
        match (number < MOST_FILES).then(|| read_small(&path)).flatten() {
            Some(bytes) => krl::globals(&bytes).into_iter().for_each(|name| {
                found.entry(name).or_insert_with(|| path.clone());
            }),
            None => unread.push(name_of(&path)),
        }
    }
    (found, unread)
}

/// The routines of a KRL controller that a program calls: `NAME.src`, with the .dat beside it.
struct Beside<'a> {
    program: &'a Path,
    /// What each does; `None` as long as it is being read (it calls itself) and where it is in no file.
    known: RefCell<HashMap<String, Option<Outside>>>,
    /// Files.
    read: RefCell<Vec<String>>,
    /// Files of GLOBAL routines.
    global: OnceCell<(HashMap<u64, PathBuf>, Vec<String>)>,
    /// Frames that files beside declare as GLOBAL, with these files.
    frames: OnceCell<Vec<(Frames, String)>>,
    /// How files beside use this program.
    callers: OnceCell<Callers>,
    /// Whether these are being read.
    reads_callers: Cell<bool>,
}

/// How files beside use a program.
#[derive(Default)]
struct Callers {
    /// What is set where they call its routines.
    called_with: HashMap<u64, Setup>,
    /// What is set where they go to its GLOBAL points.
    goes: HashMap<u64, Vec<Setup>>,
    /// The first that gives other coordinates to a GLOBAL point.
    set_by: HashMap<u64, String>,
    /// The tools and frames that they give for these.
    frames: Frames,
}

impl<'a> Beside<'a> {
    fn of(program: &'a Path) -> Self {
        Self {
            program,
            known: RefCell::default(),
            read: RefCell::default(),
            global: OnceCell::new(),
            frames: OnceCell::new(),
            callers: OnceCell::new(),
            reads_callers: Cell::new(false),
        }
    }

    /// What is set at the calls of this program's routines in the files beside, and at their motions to its points.
    fn callers(&self) -> &Callers {
        self.callers.get_or_init(|| {
            self.reads_callers.set(true);
            let found = self.read_callers();
            self.reads_callers.set(false);
            found
        })
    }

    fn read_callers(&self) -> Callers {
        let mut found = Callers::default();
        let Ok(whole) = resolved(self.program) else { return found };
        let own = together(&whole);
        let text: Vec<u8> = own.iter().filter_map(|file| read_small(file)).flatten().collect();
        let (routines, points) = (krl::callable(&text), krl::global_frames(&text));
        if routines.is_empty() && points.is_empty() {
            return found;
        }
        for path in sources(&whole).filter(|path| !own.contains(path)).take(MOST_FILES) {
            let Some(bytes) =
                read_small(&path).filter(|b| krl::uses(b, &routines, &points) && !contains(b, MARK.as_bytes()))
            else {
                continue;
            };
            let sets = krl::sets(&bytes);
            // with the declarations beside it
            let files = together(&path);
            let data = files.iter().filter(|file| **file != path).filter_map(|file| read_small(file)).flatten();
            let Ok(scan) = Dialect::Krl.scan_with(&data.chain(bytes).collect::<Vec<u8>>(), self) else { continue };
            let file = name_of(&path).to_lowercase();
            let mut meant = |setup: &Setup| {
                let mut setup = setup.clone();
                for is_tool in [true, false] {
                    take_with(is_tool, &mut setup, &scan.frames, &mut found.frames, &file);
                }
                setup
            };
            let mut is_used = false;
            for name in sets.into_iter().filter(|name| points.contains(name)) {
                found.set_by.entry(name).or_insert_with(|| file.clone());
                is_used = true;
            }
            for (name, setup) in scan.called_with.iter().filter(|(name, _)| routines.contains(name)) {
                let before = found.called_with.remove(name).unwrap_or_default();
                found.called_with.insert(*name, at_calls(before, meant(setup)));
                is_used = true;
            }
            let mut goes: Vec<_> = scan.goes_elsewhere.iter().filter(|(name, _)| points.contains(name)).collect();
            goes.sort_unstable();
            for (name, setup) in goes {
                let Some(setup) = scan.setups.get(*setup as usize) else { continue };
                found.goes.entry(*name).or_default().push(meant(setup));
                is_used = true;
            }
            if is_used {
                self.note_read(path.display().to_string());
            }
        }
        found
    }

    fn note_read(&self, file: String) {
        let mut read = self.read.borrow_mut();
        if !read.contains(&file) {
            read.push(file);
        }
    }

    /// The controller's world in the arm's foot, where `$machine.dat` says that it is elsewhere.
    fn world(&self) -> Option<Pose> {
        let [x, y, z, a, b, c] = self.values(b"$ROBROOT", &krl::POSE)?;
        let rotation = rotation_zyx(a.to_radians(), b.to_radians(), c.to_radians());
        let foot = Pose { rotation, translation: Vector3::new(x, y, z) * 1e-3 };
        (foot != Pose::identity()).then(|| foot.inverse())
    }

    /// Frames of other programs, of the files in which any is GLOBAL.
    fn global_frames(&self) -> &[(Frames, String)] {
        self.frames.get_or_init(|| {
            let Ok(whole) = resolved(self.program) else { return Vec::new() };
            let own = together(&whole);
            let is_data =
                |p: &PathBuf| p.extension().is_some_and(|e| e.eq_ignore_ascii_case("dat")) && !own.contains(p);
            let mut found = Vec::new();
            for path in places(&whole).flat_map(|place| paths(&place, is_data)).take(MOST_FILES) {
                let Some(bytes) = read_small(&path) else { continue };
                let global = krl::global_frames(&bytes);
                let Some(mut frames) = (!global.is_empty()).then(|| load_frames(&path).ok()).flatten() else {
                    continue;
                };
                let is_global = |name: &String| global.contains(&hashed(name.as_bytes()));
                frames.tools.retain(|name, _| is_global(name));
                frames.frames.retain(|name, _| is_global(name));
                found.push((frames, path.display().to_string()));
            }
            found
        })
    }

    /// What the nearest file has that declares this for all.
    fn global_frame(&self, is_tool: bool, name: &str) -> Option<Result<Frame, String>> {
        let find = |(frames, file): &'_ (Frames, String)| Some((frames.of(is_tool).get(name)?.clone(), file.clone()));
        let (found, file) = self.global_frames().iter().find_map(find)?;
        self.note_read(file);
        Some(found)
    }

    /// Files in which a routine was looked for and that were not read, in one sentence.
    fn unread(&self) -> Option<String> {
        let (_, unread) = self.global.get()?;
        not_read(unread, &format!("{MOST_FILES} files"), "their GLOBAL routines are not known")
    }

    /// The file that has this routine as a GLOBAL one, whatever the file's own name is.
    fn global(&self, name: &str) -> Option<PathBuf> {
        self.global.get_or_init(|| globals(self.program)).0.get(&hashed(name.as_bytes())).cloned()
    }

    /// What the routine of this name does; what its file sets counts as set by it.
    fn does(&self, name: &str) -> Option<Outside> {
        if let Some(known) = self.known.borrow().get(name) {
            return known.clone();
        }
        self.known.borrow_mut().insert(name.to_owned(), None);
        let source = of_controller(self.program, &format!("{name}.src")).or_else(|| self.global(name))?;
        let mut bytes = Vec::new();
        for path in together(&source) {
            read_program(&path, &path.display().to_string(), &mut bytes).ok()?;
            self.read.borrow_mut().push(path.display().to_string());
        }
        let scan = Dialect::Krl.scan_with(&bytes, self).ok()?;
        let found = scan.routines.get(&hashed(name.as_bytes())).map(|setup| {
            let mut all = Outside { setup: setup.clone(), sets: krl::sets(&bytes), ..Outside::default() };
            all.takes = scan.takes.get(&hashed(name.as_bytes())).cloned().unwrap_or_default();
            all.sets.extend(scan.called.iter().flat_map(|(_, other)| &other.sets));
            all.displaces = scan.called.iter().any(|(_, other)| other.displaces) || krl::displaces(&bytes);
            all
        });
        self.known.borrow_mut().insert(name.to_owned(), found.clone());
        found
    }
}

impl Elsewhere for Beside<'_> {
    fn routine(&self, name: &str) -> Option<Outside> {
        self.does(name)
    }

    fn called_with(&self, routine: u64) -> Option<Setup> {
        (!self.reads_callers.get()).then(|| self.callers().called_with.get(&routine).cloned()).flatten()
    }

    fn goes_to(&self, name: u64) -> Vec<Setup> {
        if self.reads_callers.get() { Vec::new() } else { self.callers().goes.get(&name).cloned().unwrap_or_default() }
    }

    fn set_by(&self, name: u64) -> Option<String> {
        (!self.reads_callers.get()).then(|| self.callers().set_by.get(&name).cloned()).flatten()
    }

    fn frame(&self, is_tool: bool, name: &str) -> Option<Result<Frame, String>> {
        let by_caller = self.callers.get().and_then(|c| c.frames.of(is_tool).get(name).cloned());
        by_caller.or_else(|| self.global_frame(is_tool, name))
    }

    fn values(&self, name: &[u8], fields: &[&[u8]; 6]) -> Option<[f64; 6]> {
        let files = ["$config.dat", "$machine.dat"].into_iter().filter_map(|file| of_controller(self.program, file));
        files.filter_map(|path| Some((read_small(&path)?, path))).find_map(|(bytes, path)| {
            let found = krl::values(&bytes, name, fields)?;
            self.note_read(path.display().to_string());
            Some(found)
        })
    }
}

/// The name of an output beside another, with the extension of its own input.
fn beside(out: &Path, input: &Path) -> PathBuf {
    out.with_extension(input.extension().unwrap_or_default())
}

/// Refuses a result in which targets are left as they are, unless that is wanted (`partial`); and one without any that was rewritten.
///
/// # Errors
/// [`ProgramError::Left`].
pub fn refuse_left_out(name: &str, report: &Report, partial: bool, spelling: Spelling) -> Result<(), ProgramError> {
    let n = report.problems.len();
    if n == 0 || (partial && report.rewritten > 0) {
        return Ok(());
    }
    let list = summarized(&report.problems, spelling);
    let s = if n == 1 { "" } else { "s" };
    Err(ProgramError::Left(if partial {
        format!("{name}: none of its {n} target{s} can be rewritten, and nothing was written: {list}")
    } else {
        format!(
            "{name}: {n} target{s} cannot be rewritten, and nothing was written ({} writes the others): {list}",
            spelling.of("partial")
        )
    }))
}

/// Reads a file of a program behind the others that it has.
fn read_program(path: &Path, name: &str, bytes: &mut Vec<u8>) -> Result<(), ProgramError> {
    let unreadable = |problem: String| ProgramError::Input(format!("{name}: {problem}"));
    let most = LARGEST.saturating_sub(bytes.len()) as u64;
    let mut read = || -> std::io::Result<bool> {
        let file = File::open(path)?;
        // what has no length, as a device, may have no end either
        let fits = file.metadata()?.len() <= most;
        Ok(fits && file.take(most + 1).read_to_end(bytes)? as u64 <= most)
    };
    match read() {
        Ok(true) => Ok(()),
        Ok(false) => Err(unreadable(TOO_LARGE.into())),
        Err(e) => Err(unreadable(format!("cannot be read: {e}"))),
    }
}

/// Reads tools and frames from a file that gives them: TOML, or another program that declares them (`CalibData.mod`,
/// `$config.dat`).
///
/// # Errors
/// One sentence.
pub fn load_frames(path: &Path) -> Result<Frames, ProgramError> {
    let Some(dialect) = Dialect::of(path).filter(|d| *d != Dialect::Csv) else { return Frames::load(path) };
    let file = path.display().to_string();
    let mut bytes = Vec::new();
    read_program(path, &file, &mut bytes)?;
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
