//! RAPID's motions: which targets they go to, with which tool and work object.

use nalgebra::Vector3;

use super::reader::{Place, Reader};
use super::records::Kind;
use crate::elsewhere::Goes;
use crate::names::{Origin, Way};
use crate::reaching::Part;
use crate::scan::{Setup, Visit};
use crate::text::{Span, is_one_of, lower};

/// Beginnings of instructions that move the arm, in lower case.
const MOTIONS: [&[u8]; 8] = [b"move", b"trigg", b"search", b"arc", b"spot", b"paint", b"disp", b"cap"];

/// Whether a word may be an instruction that moves the arm.
pub(super) fn looks_like_motion(word: &[u8]) -> bool {
    MOTIONS.iter().any(|m| word.len() >= m.len() && word[..m.len()].eq_ignore_ascii_case(m))
}

/// Whether a word is an instruction of the controller that moves the arm.
pub(super) fn is_motion(word: &[u8]) -> bool {
    looks_like_motion(word) && (targets_of(word).is_some() || is_one_of(word, &[b"searchl", b"searchj", b"searchc"]))
}

/// Functions that say where the arm is.
const HERE: [&[u8]; 2] = [b"crobt", b"cjointt"];

/// Instructions of the controller that move the arm: how their names begin, which ways they go, and how their names end.
const OWN: [(&str, &[&str], &[&str]); 11] = [
    ("move", &["l", "j", "c"], &["", "do", "ao", "go", "sync"]),
    ("move", &["absj"], &[""]),
    ("trigg", &["l", "j", "c", "absj"], &[""]),
    ("trigg", &["l", "j"], &["ios"]),
    ("arcmove", &["l", "j", "c", "absj"], &[""]),
    ("arc", &["l", "c"], &["", "start", "end"]),
    ("arc", &["l", "c"], &["1", "2", "1start", "2start", "1end", "2end"]),
    ("spot", &["l", "j", "ml", "mj"], &[""]),
    ("paint", &["l", "c"], &[""]),
    ("disp", &["l", "c"], &[""]),
    ("cap", &["l", "c"], &[""]),
];

/// How many of an instruction's first arguments are targets; `None` for those that are not the controller's own, or no motions.
fn targets_of(instruction: &[u8]) -> Option<usize> {
    let word = lower(instruction);
    let way = OWN.iter().find_map(|(begin, ways, ends)| {
        let rest = word.strip_prefix(begin)?;
        ways.iter().find(|way| rest.strip_prefix(**way).is_some_and(|end| ends.contains(&end)))
    })?;
    Some(if *way == "c" { 2 } else { 1 })
}

/// What the arguments of a motion say, as far as they are read.
struct Arguments {
    /// How many of the first ones are targets; `None` of a search.
    targets: Option<usize>,
    /// `SearchL` and its like: a signal and a variable stand before the target.
    search: bool,
    places: Vec<Place>,
    /// The name that comes last; those before it are places, or speeds and zones, as far as the instruction goes.
    tool: Option<Span>,
    frame: Option<String>,
}

impl Arguments {
    fn awaits_target(&self) -> bool {
        self.targets.is_some_and(|n| self.places.len() < n)
    }

    /// How the arm goes to the next name.
    fn way(&self) -> Way {
        let k = self.places.len();
        match self.targets {
            Some(n) if k < n => Way::To,
            Some(_) => Way::Perhaps,
            None if k == 2 => Way::To,
            None => Way::Perhaps,
        }
    }
}

impl<'a> Reader<'a> {
    /// The arguments of a motion: which targets it goes to, with which tool and work object.
    pub(super) fn motion(&mut self, instruction: &[u8]) {
        let Some(arguments) = self.arguments(instruction).filter(|a| !a.places.is_empty()) else { return };
        let tool = arguments.tool.map(|t| self.frame_name(t.text(self.c.bytes)));
        tool.iter().for_each(|tool| self.part_of_record(true, tool));
        let frame = arguments.frame.unwrap_or_else(|| "wobj0".into());
        let with = Setup { tool, frame: Some(frame) };
        // a signal, and what the search is to find, stand before where it goes
        let (found, places) = match arguments.places.get(..2) {
            Some([_, found]) if arguments.search => (Some(found), &arguments.places[2..]),
            _ => (None, &arguments.places[..]),
        };
        let setup = self.setup_of(with, places);
        for place in places {
            self.goes(place, setup);
        }
        if let Some(Place::Name { name, way, .. }) = found {
            let part = match way {
                Way::Element(k) => Part::Element(*k),
                _ if self.arrays.contains(name) => Part::Indexed,
                _ => Part::Whole,
            };
            self.names.set_here(*name, part, Origin::Here);
        }
    }

    /// The setup with which the arm goes to these places; other modules are told of it.
    fn setup_of(&mut self, with: Setup, places: &[Place]) -> u32 {
        if let Some(exports) = &mut self.exports {
            let names = places.iter().filter_map(Place::name);
            exports.goes.extend(names.map(|name| (name, Goes { setup: with.clone(), unread: None })));
        }
        self.scan.setup(with)
    }

    /// `CalcJointT(p,tool\WObj:=frame)`, from the parenthesis on: the place of which it says the joints, and with what. What is not
    /// understood is not passed.
    fn joints_of(&mut self) -> Option<(Place, u32)> {
        let start = self.c;
        let found = self.place_and_setup();
        if found.is_none() {
            self.c = start;
        }
        found
    }

    fn place_and_setup(&mut self) -> Option<(Place, u32)> {
        self.c.at += 1;
        while self.c.eat(b'\\') {
            self.c.name_ahead();
            self.c.eat(b',');
        }
        let place = self.place()?;
        self.c.eat(b',').then_some(())?;
        self.c.skip_space();
        let tool = self.whole_name();
        let (tool, mut frame) = (self.frame_name(tool), "wobj0".to_owned());
        self.part_of_record(true, &tool);
        while self.c.eat(b'\\') {
            let is_frame = self.c.name_ahead().eq_ignore_ascii_case(b"wobj");
            self.gives().then_some(())?;
            self.c.skip_space();
            let value = self.whole_name();
            if is_frame {
                frame = self.frame_name(value);
                self.part_of_record(false, &frame);
            }
        }
        self.c.eat(b')').then_some(())?;
        let with = Setup { tool: Some(tool).filter(|tool| !tool.is_empty()), frame: Some(frame) };
        with.tool.as_ref()?;
        let setup = self.setup_of(with, std::slice::from_ref(&place));
        Some((place, setup))
    }

    /// Whether joints are set here from a place, by `CalcJointT(...)` from the parenthesis on: they follow what is written there.
    pub(super) fn joints_of_place(&mut self, function: &[u8]) -> bool {
        let found = function.eq_ignore_ascii_case(b"calcjointt").then(|| self.joints_of()).flatten();
        match found {
            Some((Place::Name { name, at, .. }, setup)) => self.names.used(name, setup, Way::Indexed, at),
            Some((place, setup)) => self.goes(&place, setup),
            None => return false,
        }
        true
    }

    /// A motion to a place.
    pub(super) fn goes(&mut self, place: &Place, setup: u32) {
        match *place {
            Place::Name { name, way, at } => self.names.used(name, setup, way, at),
            Place::Spots(first, end) => {
                for spot in first..end {
                    self.scan.assign(spot, setup);
                    self.names.visit(Visit::To(spot));
                }
            }
            Place::Here => self.names.visit(Visit::Unknown),
            Place::Computed(at) => {
                self.names.visit(Visit::Unknown);
                self.scan.goes_to_calculated(at);
            }
        }
    }

    /// `None` where the word is not the call of an instruction.
    fn arguments(&mut self, instruction: &[u8]) -> Option<Arguments> {
        let word = lower(instruction);
        let mut arguments = Arguments {
            targets: targets_of(instruction),
            search: word.starts_with("search"),
            places: Vec::new(),
            tool: None,
            frame: None,
        };
        // of MoveLDO p,v,z,tool,signal,1 and MoveCSync p,q,v,z,tool,"routine" the third behind the targets is the tool
        let more = word.starts_with("move") && ["do", "ao", "go", "sync"].iter().any(|end| word.ends_with(end));
        let mut left = arguments.targets.filter(|_| more).map_or(usize::MAX, |targets| targets + 3);
        let begin = self.c.at;
        loop {
            self.c.skip_space();
            if self.c.done() || self.c.at > begin + 4000 {
                return Some(arguments);
            }
            match self.c.peek() {
                b';' => return Some(arguments),
                b',' => {
                    self.c.at += 1;
                    left -= 1;
                    if left == 0 {
                        return Some(arguments);
                    }
                }
                b'\\' => self.option(&mut arguments),
                b'[' => {
                    if !self.literal(&mut arguments) {
                        return Some(arguments);
                    }
                }
                b'"' => self.c.skip_string(),
                b'*' if arguments.awaits_target() => {
                    let what = "goes to a target without a name (*), whose numbers the text does not have";
                    self.scan.problem(self.c.at, what);
                    arguments.places.push(Place::Here);
                    self.c.at += 1;
                }
                b':' | b'=' | b'(' if self.c.at <= begin + 2 => return None,
                _ => self.next_argument(&mut arguments),
            }
        }
    }

    /// The name that came last is not the tool, for another argument follows.
    fn not_the_tool(&mut self, arguments: &mut Arguments) {
        let most = if arguments.search { 4 } else { 3 };
        if let Some(span) = arguments.tool.take()
            && arguments.places.len() < most
        {
            let name = self.key(span.text(self.c.bytes));
            arguments.places.push(Place::Name { name, way: arguments.way(), at: span.at as usize });
        }
    }

    /// `\WObj:=name`, `\Tool:=name`, and those that say nothing of the place.
    fn option(&mut self, arguments: &mut Arguments) {
        self.c.at += 1;
        let option = self.c.name_ahead();
        if !self.gives() {
            return;
        }
        self.c.skip_space();
        let from = self.c.at;
        if option.eq_ignore_ascii_case(b"tload") {
            return self.load(from);
        }
        let value = self.whole_name();
        if option.eq_ignore_ascii_case(b"wobj") {
            let name = self.frame_name(value);
            self.part_of_record(false, &name);
            arguments.frame = Some(name);
            self.c.skip_space();
            if self.c.peek() == b'{' {
                self.element_of_frames(false, value);
            }
        } else if option.eq_ignore_ascii_case(b"tool") {
            self.not_the_tool(arguments);
            arguments.tool = Some(Span::new(from, self.c.at));
        }
    }

    /// A name with the parts behind it, `cell.tool`.
    fn whole_name(&mut self) -> &'a [u8] {
        let (from, mut end) = (self.c.at, self.c.at);
        while !self.c.name_ahead().is_empty() {
            end = self.c.at;
            if !self.c.eat(b'.') {
                break;
            }
        }
        self.c.at = end;
        self.c.bytes.get(from..end).unwrap_or(&[])
    }

    /// Of a tool or a work object that is a part of a record nobody knows the numbers.
    fn part_of_record(&mut self, is_tool: bool, name: &str) {
        if name.contains('.') {
            self.not_known(is_tool, name, "is a part of a record, which is not read");
        }
    }

    /// `\Name:=value`, `\Name?value`: behind the name, whether a value follows.
    pub(super) fn gives(&mut self) -> bool {
        self.c.eat(b'?') || self.c.eat(b':') && self.c.eat(b'=')
    }

    /// An element of a list of tools or work objects.
    fn element_of_frames(&mut self, is_tool: bool, name: &[u8]) {
        self.c.skip_past(b'}', b";");
        self.not_known(is_tool, &self.frame_name(name), "is a list, and which of it a motion uses is not followed");
    }

    /// A tool or a work object of which nobody knows the numbers, and why, unless they are known from elsewhere.
    pub(super) fn not_known(&mut self, is_tool: bool, name: &str, why: &str) {
        let what = if is_tool { "tool" } else { "work object" };
        let why = format!("the {what} '{name}' {why}");
        self.scan.frames.of_mut(is_tool).entry(name.to_owned()).or_insert(Err(why));
    }

    /// A target that is written out; whether its list is whole.
    fn literal(&mut self, arguments: &mut Arguments) -> bool {
        self.not_the_tool(arguments);
        let at = self.c.at;
        let (first, problems) = (self.scan.spots.len() as u32, self.scan.problems.len());
        let list = self.list(0);
        let end = self.scan.spots.len() as u32;
        if end > first {
            arguments.places.push(Place::Spots(first, end));
        } else if self.scan.problems.len() > problems {
            arguments.places.push(Place::Here);
        } else if arguments.awaits_target() {
            arguments.places.push(match list.as_ref().and_then(|list| list.unread) {
                Some(item) => {
                    self.scan.unread(item, self.c.bytes);
                    Place::Here
                }
                None => Place::Computed(at),
            });
        }
        list.is_some()
    }

    /// A name, an element of an array, what a function returns, or a number.
    fn next_argument(&mut self, arguments: &mut Arguments) {
        let from = self.c.at;
        // of a target its record is followed
        let is_behind = arguments.targets.is_some() && !arguments.awaits_target();
        let word = if is_behind { self.whole_name() } else { self.c.word() };
        if word.is_empty() && self.c.number().is_none() {
            self.c.at += 1;
        }
        self.not_the_tool(arguments);
        if word.is_empty() {
            return;
        }
        self.c.skip_space();
        let name = Span::new(from, from + word.len());
        match self.c.peek() {
            b'(' if arguments.awaits_target()
                && word.eq_ignore_ascii_case(b"calcjointt")
                && let Some((place, setup)) = self.joints_of() =>
            {
                self.goes(&place, setup);
                // which is where the motion goes
                arguments.places.push(Place::Spots(0, 0));
            }
            b'(' => match self.relative(word) {
                // perhaps the tool, of which nobody knows which
                Place::Computed(_) if !arguments.awaits_target() => {
                    let why = "is what a function returns, which only the running program knows";
                    self.not_known(true, &lower(word), why);
                    arguments.tool = Some(name);
                }
                place => arguments.places.push(place),
            },
            b'{' => {
                if arguments.targets.is_some() && !arguments.awaits_target() {
                    self.element_of_frames(true, word);
                    arguments.tool = Some(name);
                } else {
                    let name = self.key(word);
                    let way = self.way_to_element(name);
                    arguments.places.push(Place::Name { name, way, at: from });
                }
            }
            _ => arguments.tool = Some(name),
        }
    }

    /// How the arm goes to an element of these data, from the index on; each element of a record's has several targets.
    pub(super) fn way_to_element(&mut self, name: u64) -> Way {
        let element = self.element();
        let is_record = matches!(self.record_data.get(&name), Some(Kind::Record(_)));
        element.filter(|_| !is_record).map_or(Way::To, Way::Element)
    }

    /// The index of an array's element, from 0, where it is a number of which the text says which.
    pub(super) fn element(&mut self) -> Option<usize> {
        self.c.at += 1;
        self.c.skip_space();
        let index = self.constants.expression(&mut self.c).map(|(_, k)| k);
        let whole = index.filter(|_| self.c.eat(b'}'));
        if whole.is_none() {
            self.c.skip_past(b'}', b";");
        }
        whole.filter(|k| *k >= 1.0).map(|k| k as usize - 1)
    }

    /// `Offs(p,1,2,3)`, `RelTool(Offs(p,1,2,3),4,5,6)`, `CRobT()`, from the parenthesis on: the target's name and the way there.
    pub(super) fn relative(&mut self, function: &[u8]) -> Place {
        let begin = self.c.at;
        if let Some(name) = self.returned_by(function) {
            let at = self.c.bytes[..begin].trim_ascii_end().len() - function.len();
            return Place::Name { name, way: Way::To, at };
        }
        self.makes_frame(function, begin);
        self.sets_given(begin, function);
        let in_tool = function.eq_ignore_ascii_case(b"reltool");
        let offs = function.eq_ignore_ascii_case(b"offs");
        self.c.at += 1;
        self.c.skip_space();
        let mut at = self.c.at;
        let mut name = self.c.word();
        let (mut shift, mut plain, mut depth, mut k) = ([0.0; 3], true, 1, 0);
        while is_one_of(name, &[b"offs", b"reltool"]) && self.c.eat(b'(') {
            (plain, depth) = (false, depth + 1);
            self.c.skip_space();
            at = self.c.at;
            name = self.c.word();
        }
        self.c.skip_space();
        let of_here = self.c.peek() == b'(' && is_one_of(name, &HERE);
        let returned = if self.c.peek() == b'(' && !of_here { self.returned_by(name) } else { None };
        let of_function = self.c.peek() == b'(' && !of_here;
        while depth > 0 && !self.c.done() && self.c.peek() != b';' {
            self.c.skip_space();
            if depth == 1
                && let Some((_, x)) = self.constants.expression(&mut self.c)
            {
                if let Some(to) = shift.get_mut(k) {
                    *to = x * 1e-3;
                }
                k += 1;
                continue;
            }
            match self.c.peek() {
                b'(' => depth += 1,
                b')' => depth -= 1,
                b',' => {}
                // turned as well, or calculated
                _ => plain = false,
            }
            self.c.at += usize::from(self.c.peek() != b';');
        }
        if is_one_of(function, &HERE) || of_here && (offs || in_tool) {
            return Place::Here;
        }
        if !(offs || in_tool) || name.is_empty() || of_function {
            return Place::Computed(begin);
        }
        let known = plain && k == 3;
        let way = if known { Way::Near(self.scan.shift(Vector3::from(shift), in_tool)) } else { Way::Computed };
        Place::Name { name: returned.unwrap_or_else(|| self.key(name)), way, at }
    }
}
