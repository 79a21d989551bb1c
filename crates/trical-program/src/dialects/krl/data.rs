//! What stands in braces: fields by their names, targets and frames from them, and the names that they are given to.

use nalgebra::Vector3;
use trical_model::Pose;
use trical_model::pose::rotation_zyx;

use super::named::declarations;
use super::{AXES, POSE, Reader};
use crate::branch::Configuration;
use crate::frames::Frame;
use crate::literal::Shape;
use crate::names::Origin;
use crate::packed::External;
use crate::reaching::Part;
use crate::text::{Cursor, Span, is_one_of, lower};

const EXTERNAL: [&[u8]; 6] = [b"E1", b"E2", b"E3", b"E4", b"E5", b"E6"];
/// Status and turn of a pose, tool and base of motion data.
const OTHERS: [&[u8]; 4] = [b"S", b"T", b"TOOL_NO", b"BASE_NO"];

/// A `{...}`: its fields by name, each with its number, or where something stands that has no value before the program runs.
#[derive(Default)]
pub(super) struct Aggregate<'a>(Vec<(&'a [u8], Result<Span, Span>)>);

impl Aggregate<'_> {
    pub(super) fn field(&self, name: &[u8]) -> Option<Result<Span, Span>> {
        self.0.iter().rfind(|(n, _)| n.eq_ignore_ascii_case(name)).map(|(_, value)| *value)
    }

    pub(super) fn number(&self, name: &[u8]) -> Option<Span> {
        self.field(name)?.ok()
    }

    /// The numbers of these fields, where all are given.
    fn all(&self, names: &[&[u8]; 6]) -> Option<[Span; 6]> {
        let numbers: Option<Vec<Span>> = names.iter().map(|name| self.number(name)).collect();
        numbers?.try_into().ok()
    }

    /// Whether nothing of a place stands in it by itself.
    fn is_structure(&self) -> bool {
        !self.0.iter().any(|(name, _)| is_one_of(name, &POSE) || is_one_of(name, &AXES))
    }

    /// Whether it has all that a place needs, with values or without.
    pub(super) fn is_place(&self) -> bool {
        [&POSE, &AXES].iter().any(|names| names.iter().all(|name| self.field(name).is_some()))
    }

    /// The first field of a target, tool or base that has no value before the program runs.
    pub(super) fn unread(&self) -> Option<Span> {
        let is_read = |name| [&POSE[..], &AXES, &EXTERNAL, &OTHERS].iter().any(|list| is_one_of(name, list));
        self.0.iter().filter(|(name, _)| is_read(name)).find_map(|(_, value)| value.err())
    }
}

impl<'a> Reader<'a> {
    /// `E6POS NAME={...}`
    pub(super) fn data(&mut self, is_frame: bool) {
        self.c.skip_blank();
        let from = self.c.at;
        let name = self.c.word();
        let name_span = Span::new(from, from + name.len());
        for name in declarations(&mut Cursor::at(self.c.bytes, from, b';')) {
            self.names.declare(self.routines.scopes.key(name, from));
        }
        if !self.c.eat_in_line(b'=') || self.c.peek() != b'{' {
            return;
        }
        let found = self.aggregate();
        let key = self.key(name, from);
        let is_moved_to = self.named.moved_to.contains(&key);
        if !is_moved_to && (is_frame || self.named.no_targets.contains(&key)) {
            let frame = self.frame(&found);
            self.declare(&lower(name), frame);
        } else {
            self.define(&found, name_span, Part::Whole);
        }
    }

    pub(super) fn define(&mut self, found: &Aggregate<'_>, name: Span, part: Part) {
        let first = self.scan.spots.len();
        let hash = self.key(name.text(self.c.bytes), name.at as usize);
        match (self.target(found, name), found.unread()) {
            (Some(_), _) => {}
            (None, Some(span)) => {
                self.scan.unread(span, self.c.bytes);
                self.names.listed(hash);
            }
            (None, None) if found.is_structure() && self.named.moved_to.contains(&hash) => {
                let what = "holds a target in a structure (STRUC), which is not read";
                self.scan.problem(name.at as usize, what);
                self.names.listed(hash);
            }
            // some of its coordinates only
            (None, None) => self.names.set_from(hash, Origin::Computed(name.at)),
        }
        self.names.define_part(hash, part, first, self.scan.spots.len());
    }

    /// A `{...}`, from its brace on, to its end or the line's.
    pub(super) fn aggregate(&mut self) -> Aggregate<'a> {
        let mut out = Aggregate::default();
        let mut depth = 0;
        while !self.c.done() && !matches!(self.c.peek(), b'\n' | b'\r' | b';') {
            self.c.skip_blank();
            match self.c.peek() {
                b'{' => depth += 1,
                b'}' => depth -= 1,
                b'"' => {
                    self.c.skip_string();
                    continue;
                }
                _ => {
                    let name = self.c.word();
                    if !name.is_empty() {
                        self.c.skip_blank();
                        let value = self.value();
                        if depth == 1 && self.c.peek() != b':' {
                            out.0.push((name, value));
                        }
                        continue;
                    }
                }
            }
            self.c.at += 1;
            if depth <= 0 {
                break;
            }
        }
        out
    }

    /// A field's number, plain or calculated; `Err` is where something stands that has no value.
    fn value(&mut self) -> Result<Span, Span> {
        let Self { c, scan, constants, .. } = self;
        constants.number(c, b",}", scan).ok_or_else(|| Span::new(c.at, c.at + c.until(b",}{\n\r").len()))
    }

    pub(super) fn target(&mut self, found: &Aggregate<'_>, name: Span) -> Option<u32> {
        if found.unread().is_some() {
            return None;
        }
        let bytes = self.c.bytes;
        let external = External::of(&EXTERNAL.map(|axis| self.scan.value(found.number(axis)?, bytes)));
        Some(if let Some(spans) = found.all(&POSE) {
            let (status, turn) = (found.number(b"S"), found.number(b"T"));
            let small = |s: Option<Span>| {
                s.and_then(|s| self.scan.value(s, bytes)).filter(|v| (0.0..4096.0).contains(v)).map(|v| v as u16)
            };
            let configuration = match (status, turn) {
                (None, None) => Configuration::Free,
                _ => Configuration::Kuka { s: small(status), t: small(turn) },
            };
            let mut list = spans.to_vec();
            list.extend(turn);
            self.scan.push(Shape::Zyx, &list, configuration, name, external)
        } else {
            self.scan.push(Shape::JointsDeg, &found.all(&AXES)?, Configuration::Free, name, external)
        })
    }

    pub(super) fn frame(&self, found: &Aggregate<'_>) -> Result<Frame, String> {
        let Some(spans) = found.all(&POSE) else {
            return Err("its frame is not given by six numbers X, Y, Z, A, B, C".into());
        };
        let v = spans.map(|s| self.scan.value(s, self.c.bytes).unwrap_or(f64::NAN));
        Ok(Frame::massless(Pose {
            rotation: rotation_zyx(v[3].to_radians(), v[4].to_radians(), v[5].to_radians()),
            translation: Vector3::new(v[0], v[1], v[2]) * 1e-3,
        }))
    }
}
