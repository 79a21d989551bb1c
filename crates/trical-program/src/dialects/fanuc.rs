//! FANUC TP listings (.ls): positions in `/POS`, with the tool and user frame that each names, visited as `/MN` says.
//!
//! Angles W, P, R: `R = Rz(R) Ry(P) Rx(W)`. Joint 3 of a joint position counts from the horizontal: the model's joint 3 is
//! J3 + J2 (`robots/README.md`). Tool 0 is the flange, user frame 0 the controller's world, which stands where axis 2 passes
//! axis 1. Of positions for several motion groups, GP1 is the arm.
//!
//! Words that depend on the controller's language (CONFIG, KONFIG) are known by what stands behind them. Motions to position
//! registers are listed, unless a register is set from positions of the listing or from where the arm is.

mod positions;
mod statements;

use std::ops::Range;

use crate::names::{Names, Origin, Way};
use crate::other_use::OtherUse;
use crate::reaching::Part;
use crate::scan::{Fork, OWN_SETUP, Scan, Setup, Visit, changed_here, hashed};
use crate::text::Cursor;
use positions::position;
use statements::{
    ACTIVE, BY_FORCE, DISPLACES, action, activated, assigned, continued, has, is_macro, is_one_angle, is_remark,
    loop_activates, moves, of_first_group, places, sets_frame, statement, unread, without_names, without_remark,
};

/// Where the mark goes: a remark at the beginning of `/MN`. \[I\] A loader counts the lines itself.
#[must_use]
pub fn header(bytes: &[u8]) -> usize {
    section(bytes, b"/MN").unwrap_or(0)
}

/// Offset of the line behind the one that begins with `name`.
fn section(bytes: &[u8], name: &[u8]) -> Option<usize> {
    let mut at = 0;
    while at < bytes.len() {
        let end = bytes[at..].iter().position(|b| *b == b'\n').map_or(bytes.len(), |k| at + k + 1);
        if bytes[at..end].trim_ascii().eq_ignore_ascii_case(name) {
            return Some(end);
        }
        at = end;
    }
    None
}

/// Reads a listing.
#[must_use]
pub fn scan(bytes: &[u8]) -> Scan {
    let mut scan = Scan::default();
    scan.frames.predefine("0", "0");
    scan.angles = ["R", "P", "W"];
    let Some(positions) = section(bytes, b"/POS") else { return scan };
    if let Some(at) = tracks_line(bytes, positions) {
        let what = "the positions of this program move along with a conveyor (LINE_TRACK), which is not supported";
        scan.problem(at, what);
        return scan;
    }
    // registers are the controller's, and have numbers there
    let mut names = Names::with_declarations();
    let main = section(bytes, b"/MN").map_or(0, |m| m.min(positions));
    let active = ACTIVE.map(|names| active(&bytes[main..positions], names));
    // nothing begins a comment in /POS
    let mut c = Cursor::at(bytes, positions, 0);
    let (mut all, mut unread) = (Vec::new(), Vec::new());
    while !c.done() {
        c.skip_space();
        if c.peek() == b'/' {
            break;
        }
        let from = c.at;
        if c.word() == b"P" && c.peek() == b'[' {
            let Some((name, problem)) = position(&mut c, from, &active, &mut scan, &mut names) else { continue };
            all.push(name);
            unread.extend(problem.map(|what| (name, from, what)));
        } else {
            c.skip_line();
        }
    }
    let now = Active::new(active);
    motions(bytes, main..positions, now, &mut scan, &mut names, &all);
    for (_, at, what) in unread.into_iter().filter(|(name, ..)| names.is_read(*name)) {
        scan.problem(at, what);
    }
    names.resolve(&mut scan, bytes, &|name| {
        if name.eq_ignore_ascii_case(b"PR") {
            "goes to a position register (PR), which the listing does not give as numbers".into()
        } else {
            "goes to a position that /POS does not have".into()
        }
    });
    scan
}

/// Where the head of a listing (its bytes before `end`) names a schedule of line tracking; number 0 is none.
fn tracks_line(bytes: &[u8], end: usize) -> Option<usize> {
    let name = b"LINE_TRACK_SCHEDULE_NUMBER";
    let at = bytes[..end].windows(name.len()).position(|w| w.eq_ignore_ascii_case(name))?;
    let mut c = Cursor::at(bytes, at + name.len(), 0);
    c.skip_blank();
    (c.eat_in_line(b':') && c.number()?.value(bytes)? != 0.0).then_some(at)
}

/// The tool or frame that the program activates for the arm by one of these names: nothing where it says none; an error where it says several, or
/// calculates it.
fn active(main: &[u8], names: [&str; 2]) -> Result<Option<String>, String> {
    let mut found: Option<String> = None;
    for line in main.split(|b| *b == b'\n') {
        let Some(number) = activated(action(&statement(line).to_ascii_uppercase()), names) else { continue };
        if number.is_empty() || found.as_ref().is_some_and(|f| *f != number) {
            return Err(format!(
                "is meant with whichever {} is active, and the program sets several or calculates it",
                names[0]
            ));
        }
        found = Some(number);
    }
    Ok(found)
}

/// What a register is called among the names.
fn register(digits: &[u8]) -> u64 {
    hashed(&[b"pr", digits].concat())
}

/// What a position or a register is called among the names.
fn named(is_register: bool, digits: &[u8]) -> u64 {
    if is_register { register(digits) } else { hashed(digits) }
}

/// Which of the `positions` the lines of `/MN` go to, one after the other, and where registers come from.
fn motions(
    bytes: &[u8],
    Range { start: main, end }: Range<usize>,
    mut now: Active,
    scan: &mut Scan,
    names: &mut Names,
    positions: &[u64],
) {
    let (mut at, mut whole) = (main, main);
    for line in bytes[main..end].split_inclusive(|b| *b == b'\n') {
        let begin = at;
        at += line.len();
        if begin < whole {
            // the end of a line that was too long
            continue;
        }
        whole = continued(bytes, begin, at, end);
        let text = statement(line);
        if is_remark(text) {
            continue;
        }
        let offset = begin + (text.as_ptr() as usize - line.as_ptr() as usize);
        let upper = without_names(without_remark(&bytes[offset..whole]).to_ascii_uppercase());
        if let Some(fork) = fork(&upper) {
            names.fork(fork);
            now.fork(fork);
            if fork == Fork::Repeats && loop_activates(&bytes[whole..end]) {
                now.or(&now.anywhere.clone());
            }
        }
        let all = places(&upper);
        for (at, is_register, digits) in all.iter().filter(|(at, ..)| is_one_angle(&upper[*at..])) {
            names.also_used(named(*is_register, digits), OtherUse::OneAngle((offset + at) as u32));
        }
        for (_, _, digits) in all.iter().filter(|(_, is_register, _)| !is_register) {
            match digits.is_empty() {
                // `P[R[1]]` may be any
                true => positions.iter().for_each(|name| names.read(*name)),
                false => names.read(hashed(digits)),
            }
        }
        let done = action(&upper);
        let is_conditional = done.len() < upper.len();
        if is_conditional {
            names.fork(Fork::Opens);
            now.fork(Fork::Opens);
        } else if has(&upper, b"JMP") {
            names.jumps();
        }
        let offset = offset + upper.len() - done.len();
        let (upper, all) = (done, places(done));
        now.statement(upper);
        if sets_frame(upper) {
            scan.problem(offset, changed_here("a tool or user frame"));
            for (at, is_register, digits) in all.iter().filter(|(.., digits)| !digits.is_empty()) {
                names.used_otherwise(named(*is_register, digits), offset + at);
            }
        } else if let Some(equals) = assigned(upper)
            && let Some((0, is_register, digits)) = all.first().copied()
        {
            let is_element = upper[..equals].contains(&b',');
            if is_register {
                set_register(&upper[equals + 1..], (digits, is_element), offset, names, &all[1..]);
            } else {
                let what = "a position is set here while the program runs; it is corrected for what /POS has";
                scan.problem(offset, what);
            }
        } else if upper.starts_with(b"PAYLOAD[") {
            scan.loads.push(offset);
        } else if DISPLACES.iter().any(|word| upper.starts_with(word)) && !has(upper, b"END") {
            let what =
                "displaces the motions that follow as a sensor says; they are corrected for where the text has them";
            scan.problem(offset, what);
        } else if upper.starts_with(BY_FORCE) {
            let what = "moves the arm as a force sensor says (FORCE CTRL), to where only the running program knows, which is not corrected";
            scan.problem(offset, what);
            names.visit(Visit::Unknown);
        } else if moves(upper) {
            motion(upper, &all, offset, &now, scan, names);
        } else if let Some((at, own)) = of_first_group(upper) {
            motion(own, &places(own), offset + at, &now, scan, names);
        }
        if is_conditional {
            names.fork(Fork::Closes);
            now.fork(Fork::Closes);
        }
    }
}

/// Which tool, or which frame, is active.
#[derive(Clone, Debug, Default, PartialEq)]
enum Number {
    /// The program has not said.
    #[default]
    Unsaid,
    Is(String),
    /// The program sets several, and which one is active depends on its way.
    Any,
}

/// Which tool and which frame are active, as far as the text above says: registers are gone to with these.
#[derive(Default)]
struct Active {
    numbers: [Number; 2],
    /// What is known of each where the program comes from anywhere.
    anywhere: [Number; 2],
    /// Of the blocks that are open: where they began, and behind the branches that are closed (and past them all).
    open: Vec<([Number; 2], Vec<[Number; 2]>)>,
}

impl Active {
    /// `found` is which tool and frame the program sets, if it is one.
    fn new(found: [Result<Option<String>, String>; 2]) -> Self {
        let anywhere = found.map(|found| match found {
            Ok(Some(only)) => Number::Is(only),
            Ok(None) => Number::Unsaid,
            Err(_) => Number::Any,
        });
        Self { anywhere, ..Self::default() }
    }

    fn fork(&mut self, fork: Fork) {
        match fork {
            Fork::Anywhere => self.numbers.clone_from(&self.anywhere),
            Fork::Opens | Fork::Repeats => self.open.push((self.numbers.clone(), vec![self.numbers.clone()])),
            Fork::Other | Fork::Else => {
                let Some((before, ends)) = self.open.last_mut() else { return };
                if fork == Fork::Else {
                    // there is no way past them
                    ends.remove(0);
                }
                ends.push(std::mem::replace(&mut self.numbers, before.clone()));
            }
            Fork::Closes => {
                for end in self.open.pop().into_iter().flat_map(|(_, ends)| ends) {
                    self.or(&end);
                }
            }
        }
    }

    /// What is active behind this way and another one.
    fn or(&mut self, other: &[Number; 2]) {
        for ((number, other), anywhere) in self.numbers.iter_mut().zip(other).zip(&self.anywhere) {
            if number != other {
                *number = if *anywhere == Number::Any { Number::Any } else { Number::Unsaid };
            }
        }
    }

    fn statement(&mut self, upper: &[u8]) {
        for (number, names) in self.numbers.iter_mut().zip(ACTIVE) {
            if let Some(new) = activated(upper, names) {
                *number = if new.is_empty() { Number::Any } else { Number::Is(new) };
            }
        }
    }

    fn setup(&self, scan: &mut Scan) -> u32 {
        let said = |number: &Number| match number {
            Number::Unsaid => None,
            Number::Is(number) => Some(number.clone()),
            Number::Any => Some(UNKNOWN.to_owned()),
        };
        let [tool, frame] = &self.numbers;
        let is_any = [tool, frame].contains(&&Number::Any);
        match (said(tool), said(frame)) {
            (None, _) | (_, None) if !is_any => OWN_SETUP,
            (tool, frame) => {
                if is_any {
                    scan.frames.refuse(UNKNOWN, DEPENDS);
                }
                scan.setup(Setup { tool, frame })
            }
        }
    }
}

/// Stands for a tool or frame of which nobody knows which it is, and why.
const UNKNOWN: &str = "an unknown one";
const DEPENDS: &str =
    "is gone to with the tool and frame that are active, and which these are depends on the way of the program";

/// From where the program comes to what follows a statement.
fn fork(upper: &[u8]) -> Option<Fork> {
    let word = upper.split(|b| !b.is_ascii_alphabetic()).next().unwrap_or_default();
    match word {
        b"LBL" => Some(Fork::Anywhere),
        b"ELSE" => Some(Fork::Else),
        b"ENDIF" => Some(Fork::Closes),
        b"IF" if has(upper, b"THEN") => Some(Fork::Opens),
        b"FOR" => Some(Fork::Repeats),
        b"ENDFOR" => Some(Fork::Closes),
        // what other programs do is not read; a macro is one, called by its name
        _ if has(upper, b"CALL") || is_macro(word) => Some(Fork::Anywhere),
        _ => None,
    }
}

/// A motion to these places; it stands at `offset`.
fn motion(upper: &[u8], all: &[(usize, bool, &[u8])], offset: usize, now: &Active, scan: &mut Scan, names: &mut Names) {
    let increment = has(upper, b"INC");
    let relative = increment || [&b"OFFSET"[..], b"TOOL_OFFSET", b"VOFFSET"].iter().any(|word| has(upper, word));
    if relative && !increment {
        scan.relative.push(offset as u32);
    }
    let other = [
        (&b"COORD"[..], "goes to a place in the frame of another motion group (COORD)"),
        (b"RTCP", "moves with the tool standing still (RTCP), which is not supported"),
    ];
    let other = other.into_iter().find(|(word, _)| has(upper, word));
    scan.problems.extend(other.map(|(_, what)| (offset, what.into())));
    if let Some(target) = unread(upper) {
        names.visit(Visit::Unknown);
        let target = String::from_utf8_lossy(target);
        scan.problem(offset, format!("goes to '{target}', which the listing does not give as numbers"));
    }
    for (place, is_register, digits) in all {
        if *is_register && upper[..*place].contains(&b',') {
            // `Offset,PR[1]`: how far from the target; `Skip,LBL[1],PR[5]=LPOS`: where the arm is
            let of = &upper[*place..];
            let is_here = assigned(of).is_some_and(|k| has(&of[k..], b"LPOS") || has(&of[k..], b"JPOS"));
            if is_here {
                names.set_from(register(digits), Origin::Here);
            } else {
                names.used_otherwise(register(digits), offset + place);
            }
            continue;
        }
        if increment || other.is_some() {
            names.visit(Visit::Unknown);
            match increment {
                true => names.used_otherwise(named(*is_register, digits), offset + place),
                false => names.no_target(named(*is_register, digits)),
            }
        } else if *is_register && digits.is_empty() {
            names.visit(Visit::Unknown);
            let what = "goes to a position register whose number only the running program knows (PR[R[...]])";
            scan.problem(offset, what);
        } else if *is_register {
            names.used(register(digits), now.setup(scan), Way::To, offset + place);
        } else if !digits.is_empty() {
            // its setup is what the position itself says
            names.gone_to(hashed(digits), relative, offset + place);
        } else {
            // `P[R[1]]`: whichever it is, it is in /POS
            names.visit(Visit::Unknown);
            if upper[*place..].starts_with(b"P[.") {
                scan.problem(offset, "goes to a position that is not taught (P[...])");
            }
        }
    }
}

/// `PR[1]=P[3]`, `PR[1]=PR[2]+PR[3]`, `PR[1,3]=PR[1,3]+50`, `PR[1]=LPOS`.
fn set_register(
    source: &[u8],
    (digits, is_element): (&[u8], bool),
    at: usize,
    names: &mut Names,
    from: &[(usize, bool, &[u8])],
) {
    let name = register(digits);
    let at = at as u32;
    // of a sum, the place is the position; registers say how far from it
    let is_position = |(_, is_register, digits): &&(usize, bool, &[u8])| !is_register && !digits.is_empty();
    // `PR[1]=PR[1]-PR[1]`: no shift
    let is_zero = source.iter().filter(|b| **b == b'-').count() == 1
        && matches!(from, [(_, true, a), (_, true, b)] if a == b && *a == digits && !source.contains(&b'+'));
    let origin = match from.iter().find(is_position).or(from.first()) {
        _ if is_zero && !is_element => Origin::Computed(at),
        // a shift against itself goes with it
        Some((_, true, other)) if *other == digits => Origin::Name { name, at },
        _ if is_element => Origin::Computed(at),
        Some((_, is_register, other)) if *is_register || !other.is_empty() => {
            if from.len() == 1 {
                names.copied(at as usize);
            }
            Origin::Name { name: named(*is_register, other), at }
        }
        _ if has(source, b"LPOS") || has(source, b"JPOS") => Origin::Here,
        _ => Origin::Computed(at),
    };
    if is_element {
        names.set_from(name, origin);
    } else {
        names.set_here(name, Part::Whole, origin);
    }
}
