//! What is read beforehand: which names of a script are constants, targets, places in a frame.

use std::collections::{HashMap, HashSet};

use super::{KINEMATICS, has_two, is_motion};
use crate::expression::Constants;
use crate::scan::{hashed_as_written as hashed, reached};
use crate::scopes::Scopes;
use crate::text::Cursor;

/// Arguments of a call, at most.
const MOST_ARGUMENTS: usize = 100;

/// Joints of an arm of Universal Robots.
const JOINTS: usize = 6;

/// Words with which functions begin, and other blocks.
const FUNCTIONS: [&[u8]; 3] = [b"def", b"thread", b"sec"];
const BLOCKS: [&[u8]; 3] = [b"while", b"if", b"for"];

/// The parameters of the functions.
pub(super) fn scopes(bytes: &[u8]) -> Scopes {
    let mut found = Scopes::default();
    let mut c = Cursor::new(bytes, b'#');
    while let Some((from, word)) = c.next_word() {
        if c.is_member(from) {
            continue;
        }
        if FUNCTIONS.contains(&word) {
            found.open();
            c.skip_blank();
            let function = hashed(c.word());
            let line = c.at + c.until(b"\n").len();
            let mut head = c;
            head.bytes = bytes.get(..line).unwrap_or(bytes);
            let mut more = head.eat(b'(');
            while more {
                head.skip_blank();
                let name = head.word();
                if !name.is_empty() {
                    found.parameter(function, hashed(name), c.at);
                }
                more = next_argument(&mut head);
            }
            c.skip_line();
        } else if BLOCKS.contains(&word) {
            found.open();
        } else if word == b"end" {
            found.close(from);
        }
    }
    found
}

/// What is assigned once, a number, and is no argument of a function.
pub(super) fn constants(bytes: &[u8]) -> Constants {
    let mut found = Constants::as_written();
    let mut assigned: HashSet<u64> = HashSet::new();
    let mut c = Cursor::new(bytes, b'#');
    while let Some((_, word)) = c.next_word() {
        c.skip_blank();
        if FUNCTIONS.contains(&word) {
            c.word();
            while !c.done() && !matches!(c.peek(), b')' | b'\n') {
                let name = c.word();
                if name.is_empty() {
                    c.at += 1;
                } else {
                    found.forget(hashed(name));
                }
            }
        } else if c.peek() == b'(' && is_motion(word) {
            // its options (`a=1.2`) are no assignments
            c.at += c.until(b"\n").len();
        } else if c.assigns() {
            c.at += 1;
            let value = found.expression(&mut c).map(|(_, value)| value);
            c.skip_blank();
            let whole = value.filter(|_| c.done() || matches!(c.peek(), b'\n' | b'\r' | b'#'));
            match (assigned.insert(hashed(word)), whole) {
                (true, Some(value)) => found.define(hashed(word), value),
                _ => found.forget(hashed(word)),
            }
        }
    }
    found
}

/// From within an argument to the next one of the same call.
pub(super) fn next_argument(c: &mut Cursor<'_>) -> bool {
    let mut depth = 0;
    let end = c.at + c.until(b"").len();
    while c.at < end {
        match c.peek() {
            _ if c.begins_string() => {
                c.skip_string();
                continue;
            }
            b'(' | b'[' => depth += 1,
            b')' | b']' if depth == 0 => return false,
            b')' | b']' => depth -= 1,
            b',' if depth == 0 => {
                c.at += 1;
                c.skip_space();
                return true;
            }
            _ => {}
        }
        c.at += 1;
    }
    false
}

/// The arguments of a call, from its parenthesis on, that become parameters of a function of the script: each is at the cursor when it is
/// taken, with what the parameter is called. The cursor ends at the parenthesis that closes.
pub(super) fn each_argument<'a>(
    scopes: &Scopes,
    function: u64,
    c: &mut Cursor<'a>,
    mut take: impl FnMut(&mut Cursor<'a>, u64),
) {
    let parameters = scopes.parameters(function);
    let mut places = 0..if parameters.is_empty() { 0 } else { MOST_ARGUMENTS };
    let mut more = !parameters.is_empty();
    c.at += usize::from(more);
    while more {
        c.skip_space();
        if c.peek() == b')' {
            break;
        }
        let start = *c;
        let name = c.word();
        let is_named = !name.is_empty() && c.eat_in_line(b'=') && c.peek() != b'=';
        let parameter = if is_named {
            let name = hashed(name);
            parameters.iter().find(|p| p.name == name)
        } else {
            *c = start;
            places.next().and_then(|k| parameters.get(k))
        };
        if let Some(parameter) = parameter {
            let argument = *c;
            take(c, parameter.key);
            *c = argument;
        }
        more = places.start < MOST_ARGUMENTS && next_argument(c);
    }
}

/// Past `name=` before an argument.
pub(super) fn skip_name(c: &mut Cursor<'_>) {
    let start = *c;
    if c.word().is_empty() || !c.eat_in_line(b'=') {
        *c = start;
    }
}

/// The name of a place: `wp`, `pose=wp`, `get_inverse_kin(wp)`; and whether it stands in a function.
fn place_name(c: &mut Cursor<'_>, scopes: &Scopes) -> Option<(u64, bool)> {
    let mut inside = false;
    loop {
        let name = c.name_ahead();
        let is_argument = c.eat_in_line(b'=');
        let is_function = !is_argument && c.eat_in_line(b'(');
        if name.is_empty() || is_function && !KINEMATICS.contains(&name) || name == b"p" && c.peek() == b'[' {
            return None;
        }
        if !is_argument && !is_function {
            return Some((scopes.key(hashed(name), c.at), inside));
        }
        inside |= is_function;
    }
}

/// The names that stand by themselves in a list (`[wp1,wp2]`); six are the joints of one place.
fn names_in_list(mut c: Cursor<'_>, scopes: &Scopes) -> Vec<u64> {
    let (mut found, mut count) = (Vec::new(), 0);
    let mut more = c.eat(b'[');
    while more {
        count += 1;
        let word = c.name_ahead();
        let name = scopes.key(hashed(word), c.at);
        c.skip_space();
        found.extend((!word.is_empty() && matches!(c.peek(), b',' | b']')).then_some(name));
        more = next_argument(&mut c);
    }
    if found.len() == count && count == JOINTS { Vec::new() } else { found }
}

/// How a name is used in `pose_trans(frame,name)`.
pub(super) struct InFrame {
    /// The frame, by its hashed text, where it is the same everywhere, and the name stands nowhere else.
    pub(super) frame: Option<u64>,
    times: u32,
}

/// Names that stand first in a motion, also inside a function: only these are targets when they are assigned. And names
/// that stand in a frame.
pub(super) fn targets(bytes: &[u8], scopes: &Scopes) -> (HashSet<u64>, HashMap<u64, InFrame>) {
    let (mut all, mut copies) = (HashSet::new(), HashMap::<u64, Vec<u64>>::new());
    let mut in_frames: HashMap<u64, InFrame> = HashMap::new();
    let mut c = Cursor::new(bytes, b'#');
    while let Some((_, word)) = c.next_word() {
        let start = c;
        if c.eat_in_line(b'=') {
            for source in names_in_list(c, scopes) {
                copies.entry(scopes.key(hashed(word), start.at)).or_default().push(source);
            }
            if let Some((source, inside)) = place_name(&mut c, scopes) {
                c.skip_blank();
                let is_end = matches!(c.peek(), b'\n' | b'\r' | b'#' | 0) || inside && matches!(c.peek(), b',' | b')');
                if is_end {
                    copies.entry(scopes.key(hashed(word), start.at)).or_default().push(source);
                }
            }
        } else if word == b"pose_trans" && c.eat(b'(') {
            let from = c.at;
            let is_second = next_argument(&mut c);
            let frame = hashed(bytes.get(from..c.at).unwrap_or(&[]).trim_ascii());
            if let (true, Some((name, _))) = (is_second, place_name(&mut c, scopes)) {
                let uses = in_frames.entry(name).or_insert(InFrame { frame: Some(frame), times: 0 });
                uses.frame = uses.frame.filter(|other| *other == frame);
                uses.times += 1;
            }
        } else if is_motion(word) && c.eat(b'(') {
            let mut second = c;
            all.extend(place_name(&mut c, scopes).map(|(name, _)| name));
            // a circle goes by way of its first
            if has_two(word) && next_argument(&mut second) {
                all.extend(place_name(&mut second, scopes).map(|(name, _)| name));
            }
        } else if c.peek() == b'(' {
            each_argument(scopes, hashed(word), &mut c, |c, parameter| {
                if let Some((source, _)) = place_name(&mut c.clone(), scopes) {
                    copies.entry(parameter).or_default().push(source);
                }
            });
        }
        c = start;
    }
    // what is copied or given to a target is one itself
    (reached(all, |copy| copies.get(&copy).into_iter().flatten().copied()), in_frames)
}

/// Names that are assigned several times, not all of them along one function outside of its branches and loops, or used
/// elsewhere: of these the text above does not say the value. Of names in frames it is seen whether they stand
/// elsewhere too.
pub(super) fn unsteady(bytes: &[u8], scopes: &Scopes, in_frames: &mut HashMap<u64, InFrame>) -> HashSet<u64> {
    /// In which function a name stands first, how often it is assigned, whether in a block or seen in another function,
    /// and how often it is read.
    type Seen = (usize, u32, bool, u32);
    let mut names: HashMap<u64, Seen> = HashMap::new();
    // the functions and blocks that are open: the number of a function
    let mut open: Vec<Option<usize>> = Vec::new();
    let mut functions = 0;
    let mut c = Cursor::new(bytes, b'#');
    while let Some((from, word)) = c.next_word() {
        match if c.is_member(from) { b"" } else { word } {
            _ if FUNCTIONS.contains(&word) => {
                functions += 1;
                open.push(Some(functions));
                c.skip_line();
            }
            _ if BLOCKS.contains(&word) => open.push(None),
            b"end" => drop(open.pop()),
            _ => {
                c.skip_blank();
                let mut behind = c;
                while behind.peek() == b'[' {
                    behind.skip_past(b']', b"\n");
                    behind.skip_blank();
                }
                let assigned = behind.assigns();
                let function = open.iter().rev().find_map(|f| *f).unwrap_or(0);
                let name = scopes.key(hashed(word), c.at);
                let (first, count, elsewhere, read) = names.entry(name).or_insert((function, 0, false, 0));
                *count = count.saturating_add(u32::from(assigned));
                *read = read.saturating_add(u32::from(!assigned));
                *elsewhere |= *first != function || assigned && open.last() == Some(&None);
            }
        }
    }
    for (name, uses) in in_frames {
        let read = names.get(name).map_or(0, |(.., read)| *read);
        uses.frame = uses.frame.filter(|_| uses.times == read);
    }
    names.into_iter().filter(|(_, (_, count, elsewhere, _))| *count > 1 && *elsewhere).map(|(name, _)| name).collect()
}
