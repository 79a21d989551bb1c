//! Places in functions: `get_inverse_kin`, `get_forward_kin`, `pose_trans`, `pose_add`, in motions and where they are
//! assigned.

use super::targets::{next_argument, skip_name};
use super::{DEEPEST, FORWARD, HERE, KINEMATICS, Literal, Reader};
use crate::branch::Configuration;
use crate::frames::{AT, Frame};
use crate::names::{Origin, Way};
use crate::packed::External;
use crate::reaching::Part;
use crate::scan::{Setup, Visit};
use crate::text::{Span, is_among_as_written, lower, mentions};

impl Reader<'_> {
    /// `[p[...],p[...]]`, `[[...],[...]]` or `[wp1,wp2]`, which becomes the list of this name; what is none is not passed.
    pub(super) fn list_of_places(&mut self, name: Span) -> bool {
        let start = self.c;
        let mut places = Vec::new();
        if self.c.eat(b'[') {
            loop {
                let place = match self.literal() {
                    Literal::Numbers(shape, spans) => Ok((shape, spans)),
                    Literal::None => match self.target_name() {
                        Some(named) => Err(named),
                        None => break,
                    },
                    Literal::Unread(_) => break,
                };
                places.push(place);
                if !self.c.eat(b',') {
                    break;
                }
            }
        }
        let is_list = !places.is_empty() && self.c.eat(b']');
        if !is_list {
            self.c = start;
            return false;
        }
        let hash = self.key(name.text(self.c.bytes));
        let first = self.scan.spots.len();
        let holds_names = places.iter().any(Result::is_err);
        for (k, place) in places.into_iter().enumerate() {
            match place {
                Ok((shape, spans)) => {
                    let spot = self.scan.push(shape, &spans, Configuration::Free, name, External::None) as usize;
                    if holds_names {
                        self.names.define_part(hash, Part::Element(k), spot, spot + 1);
                    }
                }
                Err((other, at)) => {
                    self.names.copied(at);
                    self.names.set_from(hash, Origin::Name { name: other, at: at as u32 });
                }
            }
        }
        if !holds_names {
            self.names.define(hash, first, self.scan.spots.len());
        }
        self.in_frames.remove(&hash);
        self.near.remove(&hash);
        self.values.insert(hash, None);
        true
    }

    /// The name of a target that stands in a list by itself, and where; where none does, nothing is passed.
    fn target_name(&mut self) -> Option<(u64, usize)> {
        self.c.skip_space();
        let start = self.c;
        let word = self.c.word();
        let name = self.key(word);
        let is_known = !word.is_empty() && self.moved_to.contains(&name) && !self.in_frames.contains_key(&name);
        self.c.skip_space();
        if is_known && matches!(self.c.peek(), b',' | b']') {
            return Some((name, start.at));
        }
        self.c = start;
        None
    }

    /// A place that is set to `get_inverse_kin(p[...])`, `pose_trans(plane,p[...])`, `pose_trans(plane,other)` or to
    /// what it is relative to, from behind the equals sign on.
    pub(super) fn placed(&mut self, name: Span) {
        let hash = self.key(name.text(self.c.bytes));
        let start = self.c;
        let (mut frame, mut near) = (None, None);
        for _ in 0..DEEPEST {
            self.c.skip_space();
            let at = self.c;
            let word = self.c.word();
            let is_function = self.c.eat(b'(');
            if is_function && self.is_kinematics(word) && !self.own_tool(word) && (frame.is_none() || word != FORWARD) {
                near = near.or(self.nearest());
            } else if is_function
                && word == b"pose_trans"
                && frame.is_none()
                && let Some(first) = self.frame(at.at)
            {
                frame = Some(first);
            } else {
                self.c = at;
                break;
            }
        }
        let literal = match self.literal() {
            Literal::Numbers(shape, spans) if frame.is_none() || !shape.is_joints() => Some((shape, spans)),
            _ => None,
        };
        let mut origin = Origin::Computed(name.at);
        if literal.is_none() {
            if frame.is_none() {
                self.c = start;
            }
            match self.origin_at(name.at as usize) {
                Some(Some(other)) => match (self.own_frame(other), &frame) {
                    (Some(_), Some(_)) => {}
                    (own, _) => {
                        self.c = start;
                        self.computed_by();
                        frame = frame.or(own);
                        origin = Origin::Name { name: other, at: name.at };
                    }
                },
                Some(None) => origin = Origin::Here,
                None => {}
            }
        }
        // a motion that is read before this does not know the frame
        if frame.is_some() && (self.unsteady.contains(&hash) || self.bare.contains(&hash)) {
            frame = None;
            self.names.set_from(hash, Origin::Computed(name.at));
        } else if let Some((shape, spans)) = literal {
            let first = self.scan.spots.len();
            self.scan.push(shape, &spans, Configuration::Free, name, External::None);
            self.names.define(hash, first, first + 1);
        } else {
            self.names.set_here(hash, Part::Whole, origin);
        }
        self.in_frames.remove(&hash);
        self.in_frames.extend(frame.map(|frame| (hash, frame)));
        self.near.remove(&hash);
        self.near.extend(near.map(|near| (hash, near)));
    }

    /// The frame of the script in which the place of this name is given, above a motion that goes there.
    fn own_frame(&mut self, name: u64) -> Option<String> {
        let own = self.in_frames.get(&name).cloned();
        if own.is_none() {
            self.bare.insert(name);
        }
        own
    }

    /// Whether a function, from behind its parenthesis on, tells joints from a place or a place from joints.
    fn is_kinematics(&self, word: &[u8]) -> bool {
        let mut c = self.c;
        KINEMATICS.contains(&word) && !c.eat(b')')
    }

    /// Whether the arguments of `get_inverse_kin` or `get_forward_kin` name a tool, from behind the parenthesis on.
    fn own_tool(&self, word: &[u8]) -> bool {
        let mut c = self.c;
        c.skip_space();
        for _ in 0..if word == FORWARD { 1 } else { 4 } {
            let mut argument = c;
            if argument.word() == b"tcp" && argument.eat(b'=') {
                return true;
            }
            if !next_argument(&mut c) {
                return false;
            }
        }
        true
    }

    /// A name to which no motion goes by itself is set to what stands at the cursor, which stays: perhaps to where the arm is, to which places
    /// are relative.
    pub(super) fn not_placed(&mut self, name: u64, from: usize) {
        let start = self.c;
        let origin = match self.origin_at(from) {
            Some(Some(other)) => Origin::Name { name: other, at: from as u32 },
            Some(None) => Origin::Here,
            None => Origin::Computed(from as u32),
        };
        self.c = start;
        self.names.set_from(name, origin);
    }

    /// As [`Self::origin`], of what is set at this offset.
    pub(super) fn origin_at(&mut self, at: usize) -> Option<Option<u64>> {
        let start = self.c.at;
        let found = self.origin(0);
        let text = self.c.bytes.get(start..self.c.at).unwrap_or(&[]);
        if ![&b"pose_trans"[..], b"pose_add"].iter().any(|shift| mentions(text, shift)) {
            self.names.copied(at);
        }
        found
    }

    /// What the expression at the cursor is relative to: a name, or (`Some(None)`) where the arm is; `None` is
    /// something else.
    pub(super) fn origin(&mut self, depth: usize) -> Option<Option<u64>> {
        let word = self.c.name_ahead();
        if word.is_empty() || depth > DEEPEST {
            return None;
        }
        self.c.skip_blank();
        if self.c.peek() != b'(' {
            return matches!(self.c.peek(), b'\n' | b'\r' | b'#' | b',' | b')' | 0).then_some(Some(self.key(word)));
        }
        self.c.at += 1;
        if self.is_kinematics(word) {
            if self.own_tool(word) {
                let name = self.c.word();
                self.names.no_target(self.key(name));
                return None;
            }
            return self.origin(depth + 1);
        }
        match word {
            b"pose_trans" | b"pose_add" => self.origin(depth + 1),
            _ => is_among_as_written(word, HERE).then_some(None),
        }
    }

    /// `get_inverse_kin(place, qnear=joints)`, from its parenthesis on: of the configurations of the arm the one near
    /// these joints, an index into `Scan::nearest`. The cursor stays.
    pub(super) fn nearest(&mut self) -> Option<u32> {
        let start = self.c;
        let mut found = None;
        if next_argument(&mut self.c) {
            skip_name(&mut self.c);
            found = match self.literal() {
                Literal::Numbers(shape, spans) => self.joint_values(shape, &spans),
                _ => {
                    let name = self.c.name_ahead();
                    self.joints.get(&self.key(name)).copied()
                }
            };
        }
        self.c = start;
        found.map(|q| {
            self.scan.nearest.push(q);
            self.scan.nearest.len() as u32 - 1
        })
    }

    /// A place to which a motion goes, in a frame of the script or in the base. `false` where none stands.
    pub(super) fn place(&mut self, frame: Option<&str>, depth: usize) -> bool {
        self.c.skip_space();
        let at = self.c.at;
        match self.literal() {
            Literal::Numbers(shape, spans) => {
                let setup = self.setup(frame);
                let spot = self.scan.push(shape, &spans, Configuration::Free, Span::default(), External::None);
                self.scan.assign(spot, setup);
                self.names.visit(Visit::To(spot));
                return true;
            }
            Literal::Unread(span) => {
                self.scan.unread(span, self.c.bytes);
                self.names.visit(Visit::Unknown);
                return true;
            }
            Literal::None => {}
        }
        let word = self.c.word();
        if word.is_empty() || depth > DEEPEST {
            return false;
        }
        if self.c.eat(b'=') {
            // an argument by its name
            return self.place(frame, depth + 1);
        }
        if !self.c.eat(b'(') {
            // a name, an element of a list
            let name = self.key(word);
            let own = self.own_frame(name);
            if frame.is_some() && own.is_some() {
                self.names.visit(Visit::Unknown);
                self.scan.goes_to_calculated(at);
                return true;
            }
            let way = self.index().map_or(Way::To, Way::Element);
            if let Some(near) = self.near.get(&name) {
                self.names.visit(Visit::Like(*near));
            }
            let setup = self.setup(frame.or(own.as_deref()));
            self.names.used(name, setup, way, at);
            return true;
        }
        let inside = self.c;
        let is_kinematics = self.is_kinematics(word);
        if is_kinematics && self.own_tool(word) {
            self.names.visit(Visit::Unknown);
            self.scan.problem(at, "names a tool of its own (tcp=), which is not read");
            let name = self.c.word();
            self.names.no_target(self.key(name));
        } else if is_kinematics && (frame.is_none() || word != FORWARD) {
            if let Some(near) = self.nearest() {
                self.names.visit(Visit::Like(near));
            }
            if !self.place(frame, depth + 1) {
                return false;
            }
        } else if word == b"pose_trans" || word == b"pose_add" {
            self.related(at, frame, word == b"pose_trans", depth);
        } else {
            self.names.visit(Visit::Unknown);
            if is_kinematics || !is_among_as_written(word, HERE) {
                self.scan.goes_to_calculated(at);
            }
        }
        self.c = inside;
        self.close();
        true
    }

    /// The index of a list's element, where it is a number.
    fn index(&self) -> Option<usize> {
        let mut c = self.c;
        let number = c.eat_in_line(b'[').then(|| c.number()).flatten()?;
        number.value(c.bytes).filter(|k| *k >= 0.0 && c.peek() == b']').map(|k| k as usize)
    }

    /// The setup of a motion in a frame of the script, or in the base.
    fn setup(&mut self, frame: Option<&str>) -> u32 {
        self.scan.setup(Setup { tool: self.now.tool.clone(), frame: frame.map(str::to_owned) })
    }

    /// The name of the frame that stands first in `pose_trans(frame, ...)` at `at`, from behind the parenthesis to
    /// behind the comma; where none stands, nothing is passed.
    fn frame(&mut self, at: usize) -> Option<String> {
        self.c.skip_space();
        let start = self.c;
        let (literal, base) = (self.literal(), self.c.word());
        let frame = self.pose(&literal, base);
        let is_target = self.moved_to.contains(&self.key(base));
        if let (false, Some(pose)) = (is_target, frame)
            && self.c.eat(b',')
        {
            let frame = Ok(Frame::massless(pose));
            let own = if base.is_empty() { "p[...]".to_owned() } else { lower(base) };
            // set anew, it is another frame
            let known = !base.is_empty() && self.scan.frames.frames.get(&own).is_none_or(|f| *f == frame);
            let name = if known { own } else { format!("{own}{AT}{at}") };
            self.scan.frames.frames.insert(name.clone(), frame);
            return Some(name);
        }
        self.c = start;
        None
    }

    /// `pose_trans(base, pose)` or `pose_add(base, pose)`, from behind its parenthesis on.
    fn related(&mut self, at: usize, frame: Option<&str>, is_product: bool, depth: usize) {
        if is_product
            && frame.is_none()
            && let Some(name) = self.frame(at)
        {
            if !self.place(Some(&name), depth + 1) {
                self.names.visit(Visit::Unknown);
                self.scan.goes_to_calculated(at);
            }
            return;
        }
        self.c.skip_space();
        let (start, inside) = (self.c.at, self.c);
        match self.origin(0) {
            Some(None) => self.names.visit(Visit::Unknown),
            Some(Some(name)) if !self.is_known_frame(name) => match (self.own_frame(name), frame) {
                (Some(_), Some(_)) => {
                    self.names.visit(Visit::Unknown);
                    self.scan.goes_to_calculated(at);
                }
                (own, _) => {
                    self.c = inside;
                    self.computed_by();
                    let setup = self.setup(frame.or(own.as_deref()));
                    self.names.used(name, setup, Way::Computed, start);
                }
            },
            _ => {
                self.names.visit(Visit::Unknown);
                self.scan.goes_to_calculated(at);
            }
        }
    }

    /// Whether a name stands for a frame of the script, and for no target.
    fn is_known_frame(&self, name: u64) -> bool {
        self.values.get(&name).is_some_and(Option::is_some) && !self.moved_to.contains(&name)
    }
}
