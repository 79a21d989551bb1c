//! FANUC TP listings (.ls): positions in `/POS`, with the tool and user frame that each names, visited as `/MN` says.
//!
//! Angles W, P, R: `R = Rz(R) Ry(P) Rx(W)`. Joint 3 of a joint position counts from the horizontal: the model's joint 3 is
//! J3 + J2 (`robots/README.md`). Tool 0 is the flange, user frame 0 the controller's world, which stands where axis 2 passes
//! axis 1. Of positions for several motion groups, GP1 is the arm.
//!
//! Words that depend on the controller's language (CONFIG, KONFIG) are known by what stands behind them. Motions to position
//! registers are listed, unless a register is set from positions of the listing or from where the arm is.

use std::ops::Range;

use crate::branch::Configuration;
use crate::literal::Shape;
use crate::names::{Names, Origin, Way};
use crate::packed::External;
use crate::reaching::Part;
use crate::scan::{Fork, OWN_SETUP, Scan, Setup, Visit, changed_here, hashed};
use crate::text::{Cursor, Span, is_among_as_written, lower};

const POSE: [&[u8]; 6] = [b"X", b"Y", b"Z", b"W", b"P", b"R"];
const JOINTS: [&[u8]; 9] = [b"J1", b"J2", b"J3", b"J4", b"J5", b"J6", b"J7", b"J8", b"J9"];

/// What is wrong with positions for two arms.
const ANOTHER_ARM: &str =
    "has a pose of another arm too (GP2 or higher), which stays as it is; only the first such position is named";

/// What activates a tool, and a user frame.
const ACTIVE: [[&str; 2]; 2] = [["UTOOL_NUM", "$MNUTOOLNUM"], ["UFRAME_NUM", "$MNUFRAMENUM"]];

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
    let now = Active { only: active.map(|found| found.ok().flatten()), ..Active::default() };
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

/// The number of the tool or frame that a statement activates for the arm by one of these names; empty where it calculates it.
fn activated(upper: &[u8], names: [&str; 2]) -> Option<String> {
    let rest = names.iter().find_map(|name| upper.strip_prefix(name.as_bytes()))?.trim_ascii_start();
    let close = rest.iter().position(|b| *b == b']').filter(|_| rest.starts_with(b"["));
    let (groups, rest) = rest.split_at(close.map_or(0, |k| k + 1));
    if !groups.is_empty() && !groups.contains(&b'1') {
        return None;
    }
    let rest = rest.trim_ascii_start().strip_prefix(b"=")?.trim_ascii_start();
    let digits = rest.iter().take_while(|b| b.is_ascii_digit()).count();
    Some(lower(&rest[..digits]))
}

/// A line of /MN without its number; generators leave the number out, or the colon too.
fn statement(line: &[u8]) -> &[u8] {
    let text = line.trim_ascii_start();
    let behind = text.iter().position(|b| !b.is_ascii_digit() && !b.is_ascii_whitespace()).unwrap_or(0);
    text[behind..].strip_prefix(b":").unwrap_or(text).trim_ascii_start()
}

/// Whether what stands here is a remark, or a statement that was made one.
fn is_remark(text: &[u8]) -> bool {
    [&b"!"[..], b"//", b"--"].iter().any(|sign| text.starts_with(sign))
}

/// A statement without the remark that a person or a generator wrote behind its end.
fn without_remark(text: &[u8]) -> &[u8] {
    let is_end = |k: &usize| text[*k] == b';' && is_remark(text[k + 1..].trim_ascii_start());
    (0..text.len()).find(is_end).map_or(text, |end| &text[..=end])
}

/// What a position says of the arm, which is motion group 1.
#[derive(Default)]
struct Fields<'a> {
    /// Coordinates and joints by name; nothing where a value is no number.
    numbers: Vec<(&'a [u8], Option<Span>)>,
    configuration: Option<Configuration>,
    /// Turn numbers of the configuration.
    turns: Option<[(Span, i16); 3]>,
    tool: Option<String>,
    frame: Option<String>,
    /// Whether a value is `***`.
    untaught: bool,
    /// Whether another motion group is at a pose: a second arm.
    another_arm: bool,
    /// `L` or `R`: to which side the elbow of a SCARA points.
    hand: Option<u8>,
    problem: Option<String>,
}

impl<'a> Fields<'a> {
    /// `{ GP1: UF : 0, UT : 1, CONFIG : 'N U T, 0, 0, 0', X = ... }`, to its closing brace.
    fn read(c: &mut Cursor<'a>) -> Self {
        let (mut found, mut group) = (Self::default(), 1);
        while !c.done() && c.peek() != b'}' {
            let word = c.name_ahead();
            if word.is_empty() {
                c.at += usize::from(c.peek() != b'}');
            } else if word.len() == 3 && word.starts_with(b"GP") {
                group = word[2].wrapping_sub(b'0');
            } else {
                let at = *c;
                if !(c.eat(b':') || c.eat(b'=')) {
                    *c = at;
                    continue;
                }
                c.skip_space();
                if group == 1 {
                    found.value(word, c);
                } else {
                    found.another_arm |= word == b"X";
                }
            }
        }
        found
    }

    /// What stands behind the sign of a field.
    fn value(&mut self, word: &'a [u8], c: &mut Cursor<'a>) {
        if c.peek() == b'\'' {
            let start = c.at;
            c.skip_string();
            self.turns = turns(c, start);
            self.hand = hand(&c.bytes[start..c.at]);
            match config(&c.bytes[start..c.at], self.turns.map(|all| all.map(|(_, turn)| turn))) {
                Some(found) => self.configuration = Some(found),
                None => {
                    let text = String::from_utf8_lossy(&c.bytes[start..c.at.min(start + 40)]).into_owned();
                    self.problem = Some(format!("has the configuration {text}, which is not understood"));
                }
            }
        } else if word == b"UT" || word == b"UF" {
            let text = match c.number() {
                Some(n) => lower(n.text(c.bytes)),
                None => lower(c.word()),
            };
            *(if word == b"UT" { &mut self.tool } else { &mut self.frame }) = Some(text);
        } else {
            let value = c.number();
            self.untaught |= value.is_none() && c.peek() == b'*';
            if matches!(word, [b'R', b'X' | b'Y' | b'Z' | b'W' | b'P' | b'R']) {
                self.problem = Some("is given relative to another motion group (RX ...)".into());
            }
            self.numbers.push((word, value));
        }
    }

    fn number(&self, name: &[u8]) -> Option<Span> {
        self.numbers.iter().rfind(|(n, _)| *n == name)?.1
    }

    /// To which side an elbow points has to be the same in the whole listing.
    fn check_hand(&mut self, scan: &mut Scan) {
        let Some(letter) = self.hand else { return };
        let first = *scan.hand.get_or_insert(letter);
        if first != letter {
            let [first, letter] = [first, letter].map(char::from);
            self.problem.get_or_insert(format!(
                "has the configuration '{letter}' where the first position that says one has '{first}': to which side the elbow points is followed \
                 only where it stays the same"
            ));
        }
    }

    /// The number of the tool or frame that was said; F is whichever is `active` when the program runs.
    fn numbered(&mut self, is_tool: bool, active: &Result<Option<String>, String>) -> Option<String> {
        let said = if is_tool { self.tool.take() } else { self.frame.take() }?;
        if said.bytes().all(|b| b.is_ascii_digit()) {
            return Some(said);
        }
        active.clone().unwrap_or_else(|e| {
            self.problem.get_or_insert(e);
            None
        })
    }
}

/// `P[1:"name"]{ ... };`: its name, and what is wrong with it where it has no numbers.
fn position(
    c: &mut Cursor<'_>,
    from: usize,
    active: &[Result<Option<String>, String>; 2],
    scan: &mut Scan,
    names: &mut Names,
) -> Option<(u64, Option<String>)> {
    c.at += 1;
    let number = c.number()?;
    while !c.done() && c.peek() != b'{' {
        if c.peek() == b'"' { c.skip_string() } else { c.at += 1 }
    }
    let name = Span::new(from, c.at.min(from + 40));
    let hash = hashed(number.text(c.bytes));
    let mut found = Fields::read(c);
    found.check_hand(scan);
    // told once
    if found.another_arm && !scan.problems.iter().any(|(_, what)| what == ANOTHER_ARM) {
        scan.problem(from, ANOTHER_ARM);
    }
    let setup = Setup { tool: found.numbered(true, &active[0]), frame: found.numbered(false, &active[1]) };
    let pose: Option<Vec<Span>> = POSE.iter().map(|n| found.number(n)).collect();
    let joints: Vec<Span> = JOINTS.iter().map_while(|n| found.number(n)).collect();
    if found.problem.is_none() && pose.is_none() && joints.is_empty() {
        let what = if found.untaught { "is not taught (***)" } else { "has no position of six numbers in GP1" };
        found.problem = Some(what.into());
    }
    if found.problem.is_some() {
        names.listed(hash);
        return Some((hash, found.problem));
    }
    let external = External::of(&[b"E1", b"E2", b"E3"].map(|axis| found.number(axis)?.value(c.bytes)));
    let spot = match pose {
        Some(mut numbers) => {
            numbers.extend(found.turns.iter().flatten().map(|(span, _)| *span));
            scan.push(Shape::Xyz, &numbers, found.configuration.unwrap_or(Configuration::Free), name, external)
        }
        None => scan.push(Shape::JointsFanuc, &joints, Configuration::Free, name, external),
    };
    let setup = scan.setup(setup);
    scan.assign(spot, setup);
    names.declare(hash);
    names.define(hash, spot as usize, spot as usize + 1);
    Some((hash, None))
}

/// The turn numbers in `'N U T, 0, 0, 0'`, which stands from `at` to the cursor.
fn turns(c: &Cursor<'_>, at: usize) -> Option<[(Span, i16); 3]> {
    let mut inside = Cursor::at(c.bytes.get(..c.at)?, at, 0);
    let mut next = || {
        inside.skip_to(b",");
        let number = inside.eat_in_line(b',').then(|| inside.number())??;
        Some((number, number.value(c.bytes)? as i16))
    };
    Some([next()?, next()?, next()?])
}

/// `'N U T, 0, 0, 0'`, with these turn numbers; `None` where letters stand there that mean something else.
fn config(text: &[u8], turns: Option<[i16; 3]>) -> Option<Configuration> {
    let words = || text.split(|b| !b.is_ascii_alphanumeric()).filter(|w| w.iter().any(u8::is_ascii_alphabetic));
    let has = |b: u8| words().any(|w| w == [b]);
    if words().next().is_none() || hand(text).is_some() {
        return Some(Configuration::Free);
    }
    let whole = (has(b'N') || has(b'F')) && (has(b'U') || has(b'D')) && (has(b'T') || has(b'B'));
    whole.then(|| Configuration::Fanuc { flip: has(b'F'), up: has(b'U'), front: has(b'T'), turns })
}

/// The letter of `'L, 0, 0, 0'` or `'R, 0, 0, 0'`, which stands alone.
fn hand(text: &[u8]) -> Option<u8> {
    let mut letters = text.iter().copied().filter(u8::is_ascii_alphabetic);
    let first = letters.next().filter(|b| matches!(b, b'L' | b'R'))?;
    letters.next().is_none().then_some(first)
}

/// Whether a line has this word, with nothing of a name before it.
fn has(line: &[u8], word: &[u8]) -> bool {
    line.windows(word.len()).enumerate().any(|(k, w)| {
        let before =
            k.checked_sub(1).and_then(|k| line.get(k)).is_some_and(|b| b.is_ascii_alphanumeric() || *b == b'_');
        let behind = line.get(k + word.len()).is_some_and(|b| b.is_ascii_alphanumeric() || *b == b'_');
        w == word && !before && !behind
    })
}

/// First words of statements that do not move the arm, or are read for how they do.
const STATEMENTS: &str = " J L C S A P PR R F M DO DI RO RI GO GI AO AI SO SI UO UI WO WI SR AR VR TIMER IF ELSE ENDIF SELECT FOR ENDFOR \
    WAIT JMP LBL CALL RUN OVERRIDE PAUSE ABORT END MESSAGE UALM UFRAME UTOOL PAYLOAD SKIP OFFSET TOOL COL MONITOR RSR LOCK UNLOCK JOINT \
    LINEAR ERROR RESUME STRLEN SUBSTR FINDSTR VISION ARC WEAVE TRACK TC DIAG TORQ PULSE BREAK SOFTFLOAT STOP LINE SENSOR POINT PERCH \
    DEFAULT EG INDEPENDENT SIMULTANEOUS ";

/// Beginnings of statements behind which motions end elsewhere than they say, until one of the same kind says END.
const DISPLACES: [&[u8]; 2] = [b"TRACK ", b"TOUCH OFFSET "];

/// Beginning of a statement that moves the arm against a part by force, from where it stands.
const BY_FORCE: &[u8] = b"FORCE CTRL";

/// Whether a statement that begins with this word (in capitals) is one of the user's.
fn is_macro(word: &[u8]) -> bool {
    !word.is_empty() && !is_among_as_written(word, STATEMENTS)
}

/// A statement with blanks in the place of what is only said: comments in brackets (`R[15:Trolley INC]`), the first motion group
/// (`PR[GP1:1,3]`), and the names of programs that it calls.
fn without_names(mut upper: Vec<u8>) -> Vec<u8> {
    let mut comment = None;
    let mut depth = 0_usize;
    for k in 0..upper.len() {
        match upper[k] {
            b'[' if comment.is_none() => {
                depth += 1;
                if upper[k + 1..].starts_with(b"GP1:") {
                    upper[k + 1..k + 5].fill(b' ');
                }
            }
            b']' => {
                depth = depth.saturating_sub(1);
                comment = comment.filter(|of| *of <= depth);
            }
            b':' if depth > 0 => comment = comment.or(Some(depth)),
            _ => {}
        }
        if comment.is_some() && !upper[k].is_ascii_whitespace() {
            upper[k] = b' ';
        }
    }
    let mut at = 0;
    while let Some(call) = upper[at..].windows(5).position(|w| w == b"CALL ") {
        at += call + 5;
        let name = upper[at..].iter().take_while(|b| b.is_ascii_alphanumeric() || **b == b'_').count();
        upper[at..at + name].fill(b' ');
    }
    upper
}

/// The places that a line names, `P[3]` and `PR[3]`: offset, whether it is a register, and its digits.
fn places(upper: &[u8]) -> Vec<(usize, bool, &[u8])> {
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(k) = upper[at..].iter().position(|b| *b == b'[') {
        let open = at + k;
        at = open + 1;
        let name = upper[..open].iter().rev().take_while(|b| b.is_ascii_alphanumeric() || **b == b'_').count();
        let name = &upper[open - name..open];
        if name == b"P" || name == b"PR" {
            at += upper[at..].iter().take_while(|b| **b == b' ').count();
            let digits = upper[at..].iter().take_while(|b| b.is_ascii_digit()).count();
            found.push((open - name.len(), name == b"PR", &upper[at..at + digits]));
        }
    }
    found
}

/// Where `=` stands behind the bracket that the line begins with, `PR[R[1],3]=`; a motion's `DO[1]=ON` stands farther.
fn assigned(upper: &[u8]) -> Option<usize> {
    let mut depth = 0_usize;
    let close = upper.iter().position(|b| {
        depth = match b {
            b'[' => depth + 1,
            b']' => depth.saturating_sub(1),
            _ => return false,
        };
        depth == 0
    })?;
    let behind = &upper[close + 1..];
    let blanks = behind.iter().take_while(|b| b.is_ascii_whitespace()).count();
    (behind.get(blanks) == Some(&b'=')).then_some(close + 1 + blanks)
}

/// What a register is called among the names.
fn register(digits: &[u8]) -> u64 {
    hashed(&[b"pr", digits].concat())
}

/// Where the statement ends whose first line is `from..at`: lines that begin with `:` belong to the one above, as long as that has
/// no end.
fn continued(bytes: &[u8], mut from: usize, mut at: usize, end: usize) -> usize {
    for line in bytes[at..end].split_inclusive(|b| *b == b'\n') {
        let has_end = without_remark(&bytes[from..at]).trim_ascii_end().ends_with(b";");
        if has_end || !line.trim_ascii_start().starts_with(b":") {
            break;
        }
        (from, at) = (at, at + line.len());
    }
    at
}

/// Tools and user frames of the controller, by their names in a program and as system variables (`$GROUP[1].$UFRAME` too).
const FRAMES: [&[u8]; 4] = [b"UTOOL", b"UFRAME", b"MNUTOOL", b"MNUFRAME"];

/// The bytes that stand in no bracket, and where.
fn outside_brackets(upper: &[u8]) -> impl Iterator<Item = (usize, u8)> {
    let mut depth = 0_usize;
    upper.iter().copied().enumerate().filter(move |(_, b)| {
        let before = depth;
        match b {
            b'[' | b'(' => depth += 1,
            b']' | b')' => depth = depth.saturating_sub(1),
            _ => {}
        }
        before == 0 && depth == 0
    })
}

/// Whether a statement sets a tool or a user frame: one of their names stands before `=`, and in no bracket.
fn sets_frame(upper: &[u8]) -> bool {
    let outside: Vec<u8> = outside_brackets(upper).map(|(_, b)| b).collect();
    let equals = outside.iter().position(|b| *b == b'=');
    equals.is_some_and(|equals| FRAMES.iter().any(|name| has(&outside[..equals], name)))
}

/// What a statement does: of `IF ...,UFRAME[1]=PR[2]`, what is behind the condition.
fn action(upper: &[u8]) -> &[u8] {
    if !upper.starts_with(b"IF") || upper.get(2).is_some_and(u8::is_ascii_alphanumeric) {
        return upper;
    }
    let behind = outside_brackets(upper).find(|(_, b)| *b == b',').map_or(upper.len(), |(comma, _)| comma + 1);
    upper[behind..].trim_ascii_start()
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
        }
        let all = places(&upper);
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
        } else if has(&upper, b"JMP") {
            names.jumps();
        }
        let offset = offset + upper.len() - done.len();
        let (upper, all) = (done, places(done));
        now.statement(upper, is_conditional);
        if sets_frame(upper) {
            scan.problem(offset, changed_here("a tool or user frame"));
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
        }
    }
}

/// Which tool and which frame are active, as far as the text above says: registers are gone to with these.
#[derive(Default)]
struct Active {
    numbers: [Option<String>; 2],
    /// Those that the program sets wherever it sets one.
    only: [Option<String>; 2],
    /// How many blocks are open.
    depth: usize,
}

impl Active {
    fn fork(&mut self, fork: Fork) {
        match fork {
            Fork::Opens | Fork::Repeats => self.depth += 1,
            Fork::Closes => self.depth = self.depth.saturating_sub(1),
            Fork::Anywhere => self.numbers.clone_from(&self.only),
            Fork::Other | Fork::Else => {}
        }
    }

    /// Behind a branch nobody knows what it has set.
    fn statement(&mut self, upper: &[u8], is_conditional: bool) {
        for (number, names) in self.numbers.iter_mut().zip(ACTIVE) {
            if let Some(new) = activated(upper, names) {
                *number = Some(new).filter(|new| !new.is_empty() && !is_conditional && self.depth == 0);
            }
        }
    }

    fn setup(&self, scan: &mut Scan) -> u32 {
        match &self.numbers {
            [tool @ Some(_), frame @ Some(_)] => scan.setup(Setup { tool: tool.clone(), frame: frame.clone() }),
            _ => OWN_SETUP,
        }
    }
}

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

/// Whether a statement moves the arm.
fn moves(upper: &[u8]) -> bool {
    let is_letter = matches!(upper.first(), Some(b'J' | b'L' | b'C' | b'S' | b'A'))
        && !upper.get(1).is_some_and(u8::is_ascii_alphanumeric);
    // `A[1]=AN` of a German listing sets an output
    let is_indexed = upper.get(1..).is_some_and(|rest| rest.trim_ascii_start().starts_with(b"["));
    is_letter && !is_indexed || matches!(upper.get(..2), Some(b"P[" | b"PR"))
}

/// What moves motion group 1 in a statement that moves several (`GP1 J P[1] 100% FINE`, in lines of its own), and its offset.
fn of_first_group(upper: &[u8]) -> Option<(usize, &[u8])> {
    let mut found = None;
    let mut at = 0;
    for line in upper.split_inclusive(|b| *b == b'\n') {
        let text = statement(line);
        match (found, text.strip_prefix(b"GP1")) {
            (Some(from), _) if text.starts_with(b"GP") => return Some((from, &upper[from..at])),
            (None, Some(motion)) => found = Some(at + line.len() - motion.trim_ascii_start().len()),
            _ => {}
        }
        at += line.len();
    }
    found.map(|from| (from, &upper[from..]))
}

/// Where a motion goes that goes to no position and no register, `PAL_1[A_1]`.
fn unread(upper: &[u8]) -> Option<&[u8]> {
    let target = upper.get(1..)?.trim_ascii_start();
    let target = target.strip_prefix(b"@").unwrap_or(target);
    let is_read = upper.starts_with(b"P") || target.starts_with(b"P[") || target.starts_with(b"PR[");
    let end = target.iter().position(|b| b.is_ascii_whitespace() || *b == b';').unwrap_or(target.len());
    (!is_read && end > 0).then_some(&target[..end])
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
                names.no_target(register(digits));
            }
            continue;
        }
        if increment || other.is_some() {
            names.visit(Visit::Unknown);
            names.no_target(if *is_register { register(digits) } else { hashed(digits) });
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
    let origin = match from.iter().find(is_position).or(from.first()) {
        // a shift against itself goes with it
        Some((_, true, other)) if *other == digits => Origin::Name { name, at },
        _ if is_element => Origin::Computed(at),
        Some((_, is_register, other)) if *is_register || !other.is_empty() => {
            if from.len() == 1 {
                names.copied(at as usize);
            }
            Origin::Name { name: if *is_register { register(other) } else { hashed(other) }, at }
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
