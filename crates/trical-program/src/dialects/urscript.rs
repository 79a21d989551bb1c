//! Universal Robots script: `p[x,y,z,rx,ry,rz]` in m and rad, and joint values in rad.
//!
//! Targets are what `movej`, `movel`, `movep`, `movec` and `servoj` go to: literals, or names of literals. `set_tcp(p[...])`
//! declares the tool from there on. `pose_trans(name, p[...])` is relative to a target that is rewritten and stays; a target
//! in a frame that the program computes is listed. Loads (`set_payload`) are not read.

use std::collections::HashSet;

use trical_model::Pose;

use crate::branch::Configuration;
use crate::frames::ToolFrame;
use crate::literal::{Meant, Shape};
use crate::scan::{Names, Scan, Setup, Visit, Way, hashed};
use crate::text::{Cursor, Span, lower, moved_to};

const MOTIONS: [&[u8]; 6] = [b"movej", b"movel", b"movep", b"movec", b"servoj", b"servoc"];

/// Reads a script.
#[must_use]
pub fn scan(bytes: &[u8]) -> Scan {
    let mut reader = Reader {
        c: Cursor::new(bytes, b'#'),
        scan: Scan::default(),
        names: Names::default(),
        moved_to: targets(bytes),
        tool: None,
        values: Vec::new(),
    };
    reader.file();
    let Reader { mut scan, names, .. } = reader;
    names.resolve(&mut scan);
    scan
}

fn is_motion(word: &[u8]) -> bool {
    MOTIONS.contains(&word)
}

/// Names that stand first in a motion: only these are targets when they are assigned.
fn targets(bytes: &[u8]) -> HashSet<u64> {
    moved_to(bytes, b'#', |word, c, found| {
        let mut more = is_motion(word) && c.eat(b'(');
        // a circle goes by way of its first
        for _ in 0..2 {
            if !more {
                break;
            }
            c.skip_space();
            let name = c.word();
            if !name.is_empty() {
                found.insert(hashed(name));
            }
            more = word == b"movec" && c.eat(b',');
        }
    })
}

struct Reader<'a> {
    c: Cursor<'a>,
    scan: Scan,
    names: Names,
    moved_to: HashSet<u64>,
    tool: Option<String>,
    /// Poses by name, for `set_tcp(name)`.
    values: Vec<(u64, [Span; 6])>,
}

impl Reader<'_> {
    fn file(&mut self) {
        while !self.c.done() {
            self.c.skip_space();
            let from = self.c.at;
            let word = self.c.word();
            if word.is_empty() {
                if self.c.peek() == b'"' {
                    self.c.skip_string()
                } else {
                    self.c.at += 1
                }
                continue;
            }
            if is_motion(word) {
                if self.c.eat(b'(') {
                    self.motion(word == b"movec" || word == b"servoc");
                }
            } else if word == b"set_tcp" {
                if self.c.eat(b'(') {
                    self.set_tcp(from);
                }
            } else {
                let at = self.c;
                if self.c.eat(b'=') && self.c.peek() != b'=' {
                    if let Some((shape, spans)) = self.literal() {
                        self.assigned(Span::new(from, from + word.len()), shape, &spans);
                    }
                } else {
                    self.c = at;
                }
            }
        }
    }

    fn assigned(&mut self, name: Span, shape: Shape, spans: &[Span; 6]) {
        let hash = hashed(name.text(self.c.bytes));
        if shape == Shape::RotationVector && self.values.len() < 10_000 && !self.moved_to.contains(&hash) {
            self.values.push((hash, *spans));
        }
        if self.moved_to.contains(&hash) {
            let first = self.scan.spots.len();
            self.scan.push(shape, spans, Configuration::Free, name);
            self.names.define(hash, first, first + 1);
        }
    }

    fn set_tcp(&mut self, at: usize) {
        self.c.skip_space();
        let spans = match self.literal() {
            Some((Shape::RotationVector, spans)) => Some(spans),
            _ => {
                let name = hashed(self.c.word());
                self.values.iter().rev().find(|(n, _)| *n == name).map(|(_, spans)| *spans)
            }
        };
        let frame = spans.ok_or("its set_tcp is computed by the program".to_owned()).and_then(|spans| {
            let v = spans.map(|s| s.value(self.c.bytes).unwrap_or(0.0));
            match Shape::RotationVector.meant(&v, &[])? {
                Meant::Pose(pose) => Ok(pose),
                Meant::Joints(_) => Ok(Pose::identity()),
            }
        });
        // the same tool has the same name wherever it is set
        let key = match &frame {
            Ok(p) => {
                let t = p.translation * 1e3;
                format!("set_tcp({:.3}, {:.3}, {:.3} mm) first at byte {at}", t.x, t.y, t.z)
            }
            Err(_) => format!("set_tcp at byte {at}"),
        };
        let known = self.scan.frames.tools.iter().find(|(_, f)| match (f, &frame) {
            (Ok(a), Ok(b)) => a.flange_from_tool == *b,
            _ => false,
        });
        let key = known.map_or(key, |(k, _)| k.clone());
        self.scan.frames.tools.insert(key.clone(), frame.map(ToolFrame::massless));
        self.tool = Some(key);
    }

    /// The first argument of a motion, or the first two.
    fn motion(&mut self, two: bool) {
        let setup = self.scan.setup(Setup { tool: self.tool.clone(), frame: None });
        for k in 0..=usize::from(two) {
            if k == 1 && !self.c.eat(b',') {
                return;
            }
            self.c.skip_space();
            let at = self.c.at;
            if let Some((shape, spans)) = self.literal() {
                let spot = self.scan.push(shape, &spans, Configuration::Free, Span::default());
                self.scan.assign(spot, setup);
                self.names.visit(Visit::To(spot));
                continue;
            }
            let word = self.c.word();
            if word.is_empty() {
                return;
            }
            if !self.c.eat(b'(') {
                self.names.used(hashed(word), setup, Way::To);
                continue;
            }
            if word == b"get_inverse_kin" {
                self.c.skip_space();
                if let Some((shape, spans)) = self.literal() {
                    let spot = self.scan.push(shape, &spans, Configuration::Free, Span::default());
                    self.scan.assign(spot, setup);
                    self.names.visit(Visit::To(spot));
                }
                self.close();
                continue;
            }
            self.c.skip_space();
            let base = self.c.word();
            let related = word == b"pose_trans" || word == b"pose_add";
            if related && self.moved_to.contains(&hashed(base)) {
                self.names.used(hashed(base), setup, Way::Computed);
            } else {
                self.names.visit(Visit::Unknown);
                let measured =
                    [&b"get_actual_tcp_pose"[..], b"get_target_tcp_pose", b"get_forward_kin"].contains(&base);
                if related && !measured {
                    let name = String::from_utf8_lossy(if base.is_empty() { b"p[...]" } else { base }).into_owned();
                    self.scan.problems.push((
                        at,
                        format!("is relative to the frame '{}', which no motion goes to", lower(name.as_bytes())),
                    ));
                }
            }
            self.close();
        }
    }

    /// To the parenthesis that closes the one that was passed.
    fn close(&mut self) {
        let mut depth = 1;
        while !self.c.done() && depth > 0 && self.c.peek() != b'\n' {
            match self.c.peek() {
                b'(' => depth += 1,
                b')' => depth -= 1,
                _ => {}
            }
            self.c.at += 1;
        }
    }

    /// `p[...]` or `[...]` of six numbers; otherwise nothing is passed.
    fn literal(&mut self) -> Option<(Shape, [Span; 6])> {
        let start = self.c;
        self.c.skip_space();
        let shape = if self.c.peek() == b'p' && self.c.bytes.get(self.c.at + 1) == Some(&b'[') {
            self.c.at += 1;
            Shape::RotationVector
        } else {
            Shape::JointsRad
        };
        let mut spans = [Span::default(); 6];
        let mut read = || {
            if self.c.peek() != b'[' {
                return None;
            }
            self.c.at += 1;
            for (k, span) in spans.iter_mut().enumerate() {
                self.c.skip_space();
                *span = self.c.number()?;
                if !self.c.eat(if k == 5 { b']' } else { b',' }) {
                    return None;
                }
            }
            Some(())
        };
        if read().is_none() {
            self.c = start;
            return None;
        }
        Some((shape, spans))
    }
}
