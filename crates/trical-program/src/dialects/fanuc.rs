//! FANUC TP listings (.ls): positions in `/POS`, with the tool and user frame that each names, visited as `/MN` says.
//!
//! Angles W, P, R: `R = Rz(R) Ry(P) Rx(W)`. Joint 3 of a joint position counts from the horizontal: the model's joint 3 is
//! J3 + J2 (`robots/README.md`). Tool 0 is the flange, user frame 0 the controller's world, which stands where axis 2 passes
//! axis 1. Of positions for several motion groups, GP1 is the arm.

use trical_model::Pose;

use crate::branch::Configuration;
use crate::frames::ToolFrame;
use crate::literal::Shape;
use crate::scan::{Names, Scan, Setup, hashed};
use crate::text::{Cursor, Span, lower};

const POSE: [&[u8]; 6] = [b"X", b"Y", b"Z", b"W", b"P", b"R"];
const JOINTS: [&[u8]; 9] = [b"J1", b"J2", b"J3", b"J4", b"J5", b"J6", b"J7", b"J8", b"J9"];

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
    scan.frames.tools.insert("0".into(), Ok(ToolFrame::massless(Pose::identity())));
    scan.frames.frames.insert("0".into(), Ok(Pose::identity()));
    let Some(positions) = section(bytes, b"/POS") else { return scan };
    let mut names = Names::default();
    // nothing begins a comment in /POS
    let mut c = Cursor::new(bytes, 0);
    c.at = positions;
    while !c.done() {
        c.skip_space();
        if c.peek() == b'/' {
            break;
        }
        let from = c.at;
        if c.word() == b"P" && c.peek() == b'[' {
            position(&mut c, from, &mut scan, &mut names);
        } else {
            c.skip_line();
        }
    }
    if let Some(main) = section(bytes, b"/MN") {
        motions(&bytes[main..positions.max(main)], &mut names);
    }
    names.resolve(&mut scan);
    scan
}

/// `P[1:"name"]{ GP1: UF : 0, UT : 1, CONFIG : 'N U T, 0, 0, 0', X = ... };`
fn position(c: &mut Cursor<'_>, from: usize, scan: &mut Scan, names: &mut Names) {
    c.at += 1;
    let Some(number) = c.number() else { return };
    while !c.done() && c.peek() != b'{' {
        if c.peek() == b'"' { c.skip_string() } else { c.at += 1 }
    }
    let name = Span::new(from, c.at.min(from + 40));
    let (mut pose, mut joints) = ([None; 6], [None; 9]);
    let (mut tool, mut frame) = (None, None);
    let mut configuration = Configuration::Free;
    let (mut group, mut untaught) = (1, false);
    while !c.done() && c.peek() != b'}' {
        c.skip_space();
        let word = c.word();
        if word.is_empty() {
            c.at += usize::from(c.peek() != b'}');
            continue;
        }
        if word.len() == 3 && word.starts_with(b"GP") {
            group = word[2].wrapping_sub(b'0');
            continue;
        }
        let at = *c;
        if !(c.eat(b':') || c.eat(b'=')) {
            *c = at;
            continue;
        }
        c.skip_space();
        if group != 1 {
            continue;
        }
        if word == b"CONFIG" {
            let start = c.at;
            c.skip_string();
            configuration = config(&c.bytes[start..c.at]);
        } else if word == b"UT" || word == b"UF" {
            let text = match c.number() {
                Some(n) => lower(n.text(c.bytes)),
                None => lower(c.word()),
            };
            *(if word == b"UT" { &mut tool } else { &mut frame }) = Some(text);
        } else {
            let value = c.number();
            untaught |= value.is_none() && c.peek() == b'*';
            if let Some(k) = POSE.iter().position(|n| *n == word) {
                pose[k] = value;
            } else if let Some(k) = JOINTS.iter().position(|n| *n == word) {
                joints[k] = value;
            }
        }
    }
    let spot = if let [Some(x), Some(y), Some(z), Some(w), Some(p), Some(r)] = pose {
        scan.push(Shape::Xyz, &[x, y, z, w, p, r], configuration, name)
    } else {
        let spans: Vec<Span> = joints.iter().map_while(|s| *s).collect();
        if spans.is_empty() {
            let what = if untaught { "is not taught (***)" } else { "has no position of six numbers in GP1" };
            scan.problems.push((from, what.into()));
            return;
        }
        scan.push(Shape::JointsFanuc, &spans, Configuration::Free, name)
    };
    // F: whichever is active when the program runs
    let numbered = |n: Option<String>| n.filter(|n| n.bytes().all(|b| b.is_ascii_digit()));
    let setup = scan.setup(Setup { tool: numbered(tool), frame: numbered(frame) });
    scan.assign(spot, setup);
    let first = spot as usize;
    names.define(hashed(number.text(c.bytes)), first, first + 1);
}

/// `'N U T, 0, 0, 0'`
fn config(text: &[u8]) -> Configuration {
    let has = |b: u8| text.split(|b| !b.is_ascii_alphanumeric()).any(|w| w == [b]);
    if (has(b'N') || has(b'F')) && (has(b'U') || has(b'D')) && (has(b'T') || has(b'B')) {
        Configuration::Fanuc { flip: has(b'F'), up: has(b'U'), front: has(b'T') }
    } else {
        Configuration::Free
    }
}

/// Which positions the lines of `/MN` go to, one after the other.
fn motions(main: &[u8], names: &mut Names) {
    for line in main.split(|b| *b == b'\n') {
        let text = line.iter().position(|b| *b == b':').map_or(line, |k| &line[k + 1..]).trim_ascii_start();
        if text.starts_with(b"!") || text.starts_with(b"--") {
            continue;
        }
        let upper = text.to_ascii_uppercase();
        let relative = [&b"OFFSET"[..], b"INC"].iter().any(|w| upper.windows(w.len()).any(|t| t == *w));
        let mut at = 0;
        while let Some(k) = upper[at..].windows(2).position(|w| w == b"P[") {
            let start = at + k + 2;
            at = start;
            if start >= 3 && (upper[start - 3].is_ascii_alphanumeric() || upper[start - 3] == b'_') {
                continue;
            }
            let digits = upper[start..].iter().take_while(|b| b.is_ascii_digit()).count();
            if digits > 0 {
                // its setup is what the position itself says
                names.gone_to(hashed(&upper[start..start + digits]), relative);
            }
        }
    }
}
