//! A program read, rewritten block by block and copied, in memory.

use std::collections::{BTreeSet, HashMap, HashSet, VecDeque};
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

use trical_model::interrupt::checkpoint;
use trical_model::pose::rotation_vector;
use trical_model::{Cell, Model, Pose, Robot, Scope, Term, Variable};

use crate::branch::Configuration;
use crate::compensation::{
    Compensator, Done, MOST_RELATIVE, Shifted, Start, Walked, by_measured_torque, eventful, settle_unnamed,
};
use crate::dialects::{Dialect, MARK, poses_csv};
use crate::elsewhere::{Elsewhere, Nowhere};
use crate::error::ProgramError;
use crate::frames::{AT, Frames, find};
use crate::options::{Options, Spelling};
use crate::report::{Report, Tally};
use crate::scan::{Scan, Spot, Visit};
use crate::text::contains;

/// Targets that one thread takes at a time.
const BLOCK: usize = 2048;

/// Blocks for all threads that are solved ahead of those that are rewritten, at most.
const LEAD: usize = 4;

/// A program, perhaps of several files that stand one behind the other in `bytes`: names and frames of each hold in all.
pub struct Program<'a> {
    /// The text of all.
    pub bytes: &'a [u8],
    /// Its files.
    pub parts: Vec<Part<'a>>,
    /// Its language.
    pub dialect: Dialect,
    /// What other files have that are not rewritten with it.
    pub elsewhere: &'a dyn Elsewhere,
}

/// One file of a program.
pub struct Part<'a> {
    /// For messages.
    pub name: &'a str,
    /// Where it ends among the bytes of all; it begins where the one before ends.
    pub end: usize,
    /// Where its rewritten text goes.
    pub sink: &'a mut dyn Write,
}

impl<'a> Program<'a> {
    /// A program of one file, whose rewritten text goes to `sink`.
    pub fn of_file(bytes: &'a [u8], name: &'a str, dialect: Dialect, sink: &'a mut dyn Write) -> Self {
        let parts = vec![Part { name, end: bytes.len(), sink }];
        Self { bytes, parts, dialect, elsewhere: &Nowhere }
    }
}

/// Rewrites the targets of a program. `nominal` is the arm as the controller believes it, `model` as it is.
/// Targets that cannot be rewritten are listed in the report and stay as they are.
///
/// The program stands in memory once, with some 60 bytes for each target (150 where each has a name, and 90 more where the program comes to the
/// first ones last); what is written is not kept. All processors are
/// used, and their number changes no byte.
///
/// # Errors
/// [`ProgramError`]; what was written by then is worthless.
pub fn compensate(
    program: Program<'_>,
    nominal: &Model,
    model: &Model,
    frames: &Frames,
    options: &Options,
) -> Result<Report, ProgramError> {
    let Program { bytes, parts, dialect, elsewhere } = program;
    let file = parts.iter().map(|p| p.name).collect::<Vec<_>>().join(" and ");
    let input = |e: String| ProgramError::Input(format!("{file}: {e}"));
    check_text(bytes).map_err(input)?;
    let mut scan = dialect.scan_with(bytes, elsewhere).map_err(input)?;
    if scan.spots.is_empty() && scan.problems.is_empty() && scan.only_read.is_empty() {
        let moves = scan.visits.iter().any(|v| matches!(v, Visit::Unknown));
        let found =
            if moves { "found motions, and none to a target that is given as numbers" } else { "no targets found" };
        return Err(input(format!("{found}; expected {}", dialect.expected())));
    }
    let mut known = std::mem::take(&mut scan.frames);
    refuse_set_late(&mut known, &scan, frames);
    known.or(frames);
    if dialect == Dialect::Csv {
        // a table declares nothing: these mean what they do in programs, where its user says nothing else
        known.or(&Frames::predefined("tool0", "wobj0"));
        if options.frame.is_none() && known.world.is_none() {
            poses_csv::check_units(&scan, bytes).map_err(input)?;
        }
    }
    find_elsewhere(&mut known, &scan, elsewhere);
    known.world = known.world.or_else(|| dialect.usual_world(&nominal.robot));
    check_names(&known, options).map_err(input)?;
    settle_unnamed(&mut scan, &mut known, options);
    let all = Compensator::new(&scan, bytes, nominal, model, &known, options)?;
    let mut writer = Writer::new(bytes, parts, dialect, &scan, options);
    let walked = rewrite_all(&all, &scan, &mut writer)?;
    let mut tally = writer.finish(&all, &walked.shifted)?;
    scan.relative.iter().take(MOST_RELATIVE).for_each(|at| tally.relative(*at, None));
    let called_elsewhere = tally.called_elsewhere();
    // a table says so in its columns, or means the cell's
    let is_unsaid = dialect != Dialect::Csv && options.tool.is_none() && options.frame.is_none();
    let unsaid = if is_unsaid { tally.unsaid() } else { None };
    let without_turn = walked.without_turn.and_then(|spot| tally.without_turn(spot));
    let otherwise = tally.otherwise(&walked.otherwise);
    let unlike = tally.unlike(walked.unlike);
    let others = [
        unsaid,
        without_turn,
        unlike,
        otherwise,
        tally.homes(),
        tally.absolutely_accurate(),
        tally.unused(),
        tally.only_read(),
    ];
    let sags = options.payload_kg.is_none() && model.terms.iter().any(by_gravity);
    let loads = if sags { tally.loads() } else { None };
    let mut report = tally.report();
    report.cautions.extend(others.into_iter().flatten());
    report.cautions.extend(called_elsewhere);
    report.cautions.extend(loads);
    report.cautions.extend(if sags { weightless(&scan, &known, nominal, options.spelling) } else { None });
    report.cautions.extend(configuration_unsaid(&scan));
    report.cautions.extend(other_cell(nominal, model, options));
    report.cautions.extend(without_torques(model));
    report.cautions.extend(as_it_began(model, options));
    report.cautions.extend(first_of_several(model, options));
    report.cautions.extend(few_joints(&nominal.robot));
    Ok(report)
}

/// Refuses what is no text, or compensated already.
fn check_text(bytes: &[u8]) -> Result<(), String> {
    if bytes.contains(&0) {
        return Err(
            "holds zero bytes: a binary program, or text in UTF-16; expected plain text (ASCII, UTF-8, Latin-1)".into(),
        );
    }
    if contains(bytes, MARK.as_bytes()) {
        return Err(format!("is compensated already (it has the mark '{MARK} ...'); compensate the original instead"));
    }
    Ok(())
}

/// Refuses tools and bases that the program sets late, and to other numbers than the controller's files have.
fn refuse_set_late(known: &mut Frames, scan: &Scan, frames: &Frames) {
    for (is_tool, name) in &scan.set_late {
        let [now, before] = [&*known, frames].map(|all| all.of(*is_tool).get(name));
        if before.is_some() && before != now {
            let what = if *is_tool { "tool" } else { "base" };
            let why = format!("the program gives {what} {name} other numbers on its way than the controller's files");
            known.of_mut(*is_tool).insert(name.clone(), Err(why));
        }
    }
}

/// Tools and frames of the program's setups that only other files declare, and products of frames.
fn find_elsewhere(known: &mut Frames, scan: &Scan, elsewhere: &dyn Elsewhere) {
    for setup in &scan.setups {
        for is_tool in [true, false] {
            find(known.of_mut(is_tool), setup.of(is_tool), &|name| elsewhere.frame(is_tool, name));
        }
    }
}

/// Refuses a tool or frame of the options that nobody declares.
fn check_names(known: &Frames, options: &Options) -> Result<(), String> {
    for name in [&options.tool, &options.frame].into_iter().flatten() {
        if !known.tools.contains_key(&name.to_lowercase()) && !known.frames.contains_key(&name.to_lowercase()) {
            let all = known.tools.keys().chain(known.frames.keys()).cloned().collect::<Vec<_>>().join(", ");
            let all = if all.is_empty() { "neither declares any".into() } else { format!("known are {all}") };
            let frames = options.spelling.of("frames");
            return Err(format!("'{name}' is neither a tool nor a frame of the program or of {frames}; {all}"));
        }
    }
    Ok(())
}

/// Rewrites all targets into `writer`: one thread goes through the program ahead of the others, which rewrite what is known. What they cannot
/// write, nobody wants.
fn rewrite_all(all: &Compensator<'_>, scan: &Scan, writer: &mut Writer<'_, '_>) -> Result<Walked, ProgramError> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(16);
    let size = BLOCK * threads;
    let failed = &AtomicBool::new(false);
    std::thread::scope(|scope| {
        let (give, starts) = sync_channel(LEAD);
        let ahead = scope.spawn(move || {
            // whoever no longer listens has failed, and says so
            all.starts(size, &mut |block| drop(give.send(block)), &|| failed.load(Ordering::Relaxed))
        });
        let mut write = || -> Result<(), ProgramError> {
            for spots in scan.spots.chunks(size) {
                let Some(starts) = next(&starts)? else { break };
                for (spot, done) in spots.iter().zip(in_parallel(all, spots, &starts)) {
                    writer.take(spot, done)?;
                }
            }
            Ok(())
        };
        let result = write();
        failed.store(result.is_err(), Ordering::Relaxed);
        result?;
        Ok(ahead.join().unwrap_or_default())
    })
}

/// Writes the targets in the order of the file, each with its correction, and counts them.
struct Writer<'a, 'b> {
    scan: &'a Scan,
    out: Splice<'a, 'b>,
    /// The lines that say that a file is compensated, and where they go.
    marks: VecDeque<(usize, String)>,
    tally: Tally<'a>,
    /// Index of the target that comes next.
    index: u32,
    /// Targets beside which the program goes to shifted places.
    shifted: HashSet<u32>,
    /// What the program wants at each target of `shifted`, and where the new numbers send the nominal arm.
    moved: HashMap<u32, (Pose, Pose)>,
}

impl<'a, 'b> Writer<'a, 'b> {
    fn new(bytes: &'a [u8], parts: Vec<Part<'b>>, dialect: Dialect, scan: &'a Scan, options: &'a Options) -> Self {
        let begins: Vec<usize> = std::iter::once(0).chain(parts.iter().map(|p| p.end)).take(parts.len()).collect();
        let mark = |(begin, part): (&usize, &Part<'_>)| {
            let (at, line) = dialect.mark(bytes.get(*begin..part.end).unwrap_or(&[]), &options.model_name);
            (begin + at, line)
        };
        let marks = begins.iter().zip(parts.iter()).map(mark).collect();
        let files = if parts.len() > 1 {
            begins.into_iter().zip(parts.iter().map(|p| p.name.to_owned())).collect()
        } else {
            Vec::new()
        };
        Self {
            scan,
            out: Splice { bytes, at: 0, parts, part: 0 },
            marks,
            tally: Tally::new(scan, bytes, files, options),
            index: 0,
            shifted: scan.near.iter().map(|near| near.spot).collect(),
            moved: HashMap::new(),
        }
    }

    fn take(&mut self, spot: &Spot, done: Result<Done, String>) -> Result<(), ProgramError> {
        while let Some((at, line)) = self.marks.pop_front_if(|(at, _)| *at <= self.scan.at(spot)) {
            self.out.insert(at, &line)?;
        }
        if let Ok(done) = &done {
            if self.shifted.contains(&self.index) {
                self.moved.insert(self.index, (done.wanted, done.commanded));
            }
            let mut edits: Vec<_> = done.edits.iter().collect();
            edits.sort_by_key(|(span, _)| span.at);
            for (span, text) in edits {
                self.out.replace(span.at as usize, span.len as usize, text)?;
            }
        }
        self.index += 1;
        self.tally.take(spot, done);
        Ok(())
    }

    /// Writes what is left, and adds the motions to shifted places to what was counted.
    fn finish(mut self, all: &Compensator<'_>, shifted: &[Shifted]) -> Result<Tally<'a>, ProgramError> {
        for (at, line) in self.marks {
            self.out.insert(at, &line)?;
        }
        self.out.finish()?;
        let mut ws = all.workspaces();
        for one in shifted {
            let Some((wanted, commanded)) = self.moved.get(&one.spot) else { continue };
            self.tally.relative(one.at, all.remaining_errors(one, wanted, commanded, &mut ws));
        }
        Ok(self.tally)
    }
}

/// A program whose first pose can be reached in several ways, and nothing says in which.
fn configuration_unsaid(scan: &Scan) -> Option<String> {
    let first = scan.visits.iter().find_map(|v| match v {
        Visit::To(spot) => scan.spots.get(*spot as usize),
        _ => None,
    });
    // those that no motion names are solved in the order of the file
    let unsaid = first
        .or(scan.spots.first())
        .is_some_and(|s| !s.shape.is_joints() && scan.configuration(s) == Configuration::Free);
    (unsaid && scan.nearest.is_empty()).then(|| {
        let taken = if scan.first_seed().is_some() { "where the program ends" } else { "joints at zero" };
        format!(
            "the program does not say in which configuration (shoulder, elbow, wrist) the arm comes to its first target: the one nearest to {taken} is used; \
             a motion to joint values before it would define it"
        )
    })
}

/// Whether a term depends on what the arm carries.
fn by_gravity(term: &Term) -> bool {
    matches!(term.basis.of, Variable::Moment { .. } | Variable::FootMoment { .. } | Variable::PartMoment { .. })
}

/// Tools of which nobody says what they weigh, in one sentence.
fn weightless(scan: &Scan, known: &Frames, nominal: &Model, spelling: Spelling) -> Option<String> {
    let is_weightless = |name: &&String| {
        let tool = known.tools.get(name.as_str()).and_then(|t| t.as_ref().ok());
        tool.is_some_and(|t| t.mass < LIGHTEST && !t.is_of(&nominal.cell) && t.parent_from_frame != Pose::identity())
    };
    let names: BTreeSet<&String> = scan.setups.iter().filter_map(|s| s.tool.as_ref()).filter(is_weightless).collect();
    // what the program gives without a name, a file of frames cannot name either: "set_tcp(0, 0, 100 mm) first at byte 7"
    let is_nameless = names.iter().all(|n| n.contains(AT));
    let says = if is_nameless { String::new() } else { format!("mass_kg in a {} file, or ", spelling.of("frames")) };
    let told = |n: &String| {
        let name = n.split(AT).next().unwrap_or(n);
        format!("'{}'", name.strip_suffix(" first").unwrap_or(name))
    };
    let tools = match names.len() {
        0 => return None,
        1 => "tool",
        _ => "each of the tools",
    };
    let names = names.into_iter().map(told).collect::<Vec<_>>().join(", ");
    Some(format!(
        "the arm sags under load, and nothing says what {tools} {names} weighs: it is taken as 0 kg ({says}{} says it)",
        spelling.of("payload_kg")
    ))
}

/// Lighter tools are placeholders (RAPID has 0.001 kg for what nobody weighed), kg.
const LIGHTEST: f64 = 0.01;

/// What was learnt over measured torques and cannot be used where none are measured.
fn without_torques(model: &Model) -> Option<String> {
    let left_out: Vec<&str> = model.terms.iter().filter(|t| by_measured_torque(t)).map(|t| t.name.as_str()).collect();
    (!left_out.is_empty()).then(|| {
        format!(
            "the model knows how far joints deflect under measured torques ({}), which a program does not have: how far they deflect is not corrected",
            left_out.join(", ")
        )
    })
}

/// An arm that cannot take every pose.
fn few_joints(robot: &Robot) -> Option<String> {
    (robot.dof() < 6).then(|| {
        format!(
            "with {} joints the arm cannot take every orientation: the tool's point is corrected, its axes as far as the joints allow",
            robot.dof()
        )
    })
}

/// What happened in the course of a session and is left out, since nobody said when the program runs.
fn as_it_began(model: &Model, options: &Options) -> Option<String> {
    let of_course = |t: &&Term| t.scope() == Scope::Course && t.basis.session.is_some() && t.moves_tool();
    let mut effects: Vec<&str> = model.terms.iter().filter(of_course).map(|t| t.effect.as_str()).collect();
    effects.dedup();
    let timed = model.terms.iter().filter(of_course).any(|t| t.basis.of == Variable::Time);
    let last = options.spelling.with(if timed { "time_s" } else { "seq" }, "1e9");
    (!effects.is_empty() && options.time_s.or(options.seq).is_none()).then(|| {
        format!(
            "what happened in the course of a recording ({}) is left out: the program is corrected for the arm as it was when that began. \
             If the arm has stayed as it was at the end (a lost zero, a tool that slipped, a machine that is warm), {last} corrects for that",
            effects.join(", ")
        )
    })
}

/// Several sessions in which something happened, of which nobody said in which the program runs.
fn first_of_several(model: &Model, options: &Options) -> Option<String> {
    let is_unsaid = options.time_s.or(options.seq).is_some() && options.session.is_none();
    let all: Vec<u32> = eventful(model).into_iter().filter(|_| is_unsaid).collect();
    let [first, _, ..] = all[..] else { return None };
    let name =
        |k: u32| options.sessions.get(k as usize - 1).map_or_else(|| k.to_string(), |name| format!("{k} ({name})"));
    Some(format!(
        "something happened in the course of sessions {}: the arm is taken as it was in session {first} ({} says another)",
        all.iter().map(|k| name(*k)).collect::<Vec<_>>().join(", "),
        options.spelling.with("session", "NAME")
    ))
}

/// A cell that is not the one of the fit, in one sentence.
fn other_cell(nominal: &Model, model: &Model, options: &Options) -> Option<String> {
    let (given, fitted) = (&nominal.cell, &model.cell);
    let tool = |cell: &Cell| Pose { rotation: cell.tool.rotation, translation: cell.tool.tcp };
    let bases = (!options.own_base).then_some(("base", given.world_from_base, fitted.world_from_base));
    let tools = ("tool", tool(given), tool(fitted));
    let apart: Vec<String> = bases
        .into_iter()
        .chain([tools])
        .filter_map(|(what, a, b)| {
            let mm = (a.translation - b.translation).norm() * 1e3;
            let deg = rotation_vector(&(a.rotation.transpose() * b.rotation)).norm().to_degrees();
            let by = [(mm > 1e-3).then(|| format!("{mm:.3} mm")), (deg > 1e-4).then(|| format!("{deg:.4} deg"))];
            let by: Vec<String> = by.into_iter().flatten().collect();
            (!by.is_empty()).then(|| format!("its {what} differs by {}", by.join(" and ")))
        })
        .collect();
    (!apart.is_empty()).then(|| {
        format!(
            "the cell is not the one that the model was fitted with ({}): the difference is corrected as if it were an error of the arm",
            apart.join(", ")
        )
    })
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

/// Copies files with pieces replaced.
struct Splice<'a, 'b> {
    bytes: &'a [u8],
    at: usize,
    parts: Vec<Part<'b>>,
    part: usize,
}

impl Splice<'_, '_> {
    fn insert(&mut self, at: usize, text: &str) -> Result<(), ProgramError> {
        self.replace(at, 0, text)
    }

    fn replace(&mut self, at: usize, len: usize, text: &str) -> Result<(), ProgramError> {
        // targets stand one after the other, never inside each other
        if at < self.at {
            return Err(ProgramError::Input(format!(
                "two targets overlap at byte {at}; this is an error of the program's reader"
            )));
        }
        self.copy(at)?;
        if let Some(part) = self.parts.get_mut(self.part) {
            part.sink.write_all(text.as_bytes())?;
        }
        self.at = at + len;
        Ok(())
    }

    /// Copies what stands before `to`; where a file ends there, the next one goes on.
    fn copy(&mut self, to: usize) -> Result<(), ProgramError> {
        while let Some(part) = self.parts.get_mut(self.part) {
            part.sink.write_all(self.bytes.get(self.at..to.min(part.end)).unwrap_or(&[]))?;
            self.at = self.at.max(to.min(part.end));
            if to < part.end || self.part + 1 == self.parts.len() {
                break;
            }
            self.part += 1;
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<(), ProgramError> {
        self.copy(self.bytes.len())
    }
}
