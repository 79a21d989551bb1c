//! What sets tool and base in KRL: `$TOOL` and `$BASE`, `BAS`, motion data of inline forms; and frames that the program
//! names.

use trical_model::Pose;

use super::data::Aggregate;
use super::{Reader, target_of};
use crate::frames::{AT, Frame, Named, STANDING, TIMES, declare, named};
use crate::scan::{Setup, changed_here, hashed};
use crate::text::{Cursor, is_one_of, lower, mentions};

/// How the name ends of a tool or base of which the program sets the number and nothing else.
const ONLY_NUMBER: &str = " (its number only)";
/// The base, where nothing in the program says which.
const UNSET: &str = "$base";
/// What is wrong with a frame that is not given by numbers.
fn calculated(name: &str) -> String {
    format!("is meant with '{name}', which only the running program calculates")
}

fn is_number(index: &str) -> bool {
    !index.is_empty() && index.bytes().all(|b| b.is_ascii_digit())
}

/// What is wrong with a frame that the program sets to one and to another: it is known only while it runs.
const SEVERAL: &str = "is set to different frames at several places of the program";

/// Keeps a product of known frames under its name.
fn product(known: &mut Named, parts: &str, name: String) {
    let parts = parts.split(TIMES).map(|part| known.get(part).and_then(|one| one.as_ref().ok()).cloned());
    let whole = parts.reduce(|a, b| Some(a?.compose(&b?))).flatten();
    known.extend(whole.map(|whole| (name, Ok(whole))));
}

/// Products of frames that other files may use, at most, and products of products.
const MOST_PRODUCTS: usize = 100;
const DEEPEST: usize = 4;

impl Reader<'_> {
    /// What is behind `$TOOL=` or `$BASE=`: a frame, or frames with the geometric operator between them.
    pub(super) fn current(&mut self, is_tool: bool) -> String {
        let mut name = self.one_frame(is_tool);
        while self.c.eat_in_line(b':') {
            name = format!("{name}{TIMES}{}", self.one_frame(is_tool));
        }
        name
    }

    /// The name of the frame at the cursor, which is declared where it is given by numbers.
    pub(super) fn one_frame(&mut self, is_tool: bool) -> String {
        if self.c.peek() == b'{' {
            let at = self.c.at;
            let found = self.aggregate();
            let frame = self.frame(&found);
            // the same numbers are the same tool or base wherever they stand
            let name = format!("{}{AT}{at}", if is_tool { "$tool" } else { "$base" });
            return named(self.scan.frames.of_mut(is_tool), name, frame);
        }
        let word = self.c.word();
        if is_one_of(word, &[b"$NULLFRAME", b"$WORLD"]) {
            return "0".into();
        }
        if self.c.peek() != b'.' && word.eq_ignore_ascii_case(if is_tool { b"$TOOL" } else { b"$BASE" }) {
            return self.active(is_tool);
        }
        if is_one_of(word, &[b"STOOL", b"STOOL2", b"SBASE"]) && self.c.eat(b'(') {
            return self.of_motion_data(is_tool);
        }
        if word.eq_ignore_ascii_case(b"EK") {
            return self.on_external_axis();
        }
        let name = lower(word);
        if self.key(word, self.c.at) != hashed(word) {
            return self.of_routine(&name);
        }
        if self.c.eat_in_line(b'[') {
            let index = self.c.until(b"]\n\r");
            self.c.at += index.len();
            let index = lower(index.trim_ascii());
            let is_element = word.eq_ignore_ascii_case(if is_tool { b"TOOL_DATA" } else { b"BASE_DATA" });
            let index = self.number_set(is_tool, &index).unwrap_or(index);
            let is_closed = self.c.eat_in_line(b']');
            return match (is_closed && is_number(&index), is_element) {
                (true, true) => index,
                (true, false) => format!("{name}[{index}]"),
                (false, _) => self.calculated(format!("{name}[{index}]")),
            };
        }
        // of a function, a part of something
        let is_whole = !name.is_empty() && !matches!(self.c.peek(), b'(' | b'.');
        if is_whole { name } else { self.calculated(format!("{name}...")) }
    }

    /// Behind `$ACT_TOOL=` or `$ACT_BASE=`. The arm moves with `$TOOL` and `$BASE`, which these leave as they are: with a tool of another number,
    /// or none, nobody knows what is meant until `$TOOL` is set; one that has no number is what the program says.
    pub(super) fn only_number(&mut self, is_tool: bool) {
        let number = lower(self.c.until(b";\n\r").trim_ascii());
        let active = self.now.slot(is_tool).as_deref().map(|name| name.trim_start_matches(STANDING));
        let has_number = active.is_none_or(|name| is_number(name.trim_end_matches(ONLY_NUMBER)));
        if !has_number || active == Some(number.as_str()) || number == "-1" {
            return;
        }
        let (what, current) = if is_tool { ("tool", "$TOOL") } else { ("base", "$BASE") };
        let name = format!("{number}{ONLY_NUMBER}");
        let why = format!(
            "the program sets the number of the {what} to {number} ($ACT_{}) and not {current}, with which the arm moves",
            what.to_uppercase()
        );
        self.scan.frames.refuse(&name, &why);
        self.set(is_tool, name);
    }

    /// The number of `TOOL_DATA[$ACT_TOOL]` where the program has set it above, and nothing else of the tool since.
    fn number_set(&mut self, is_tool: bool, index: &str) -> Option<String> {
        let name = if is_tool { "$act_tool" } else { "$act_base" };
        let active = self.now.slot(is_tool).as_deref().filter(|_| index == name)?;
        active.trim_start_matches(STANDING).strip_suffix(ONLY_NUMBER).map(str::to_owned)
    }

    /// The tool or base that is set here, which a product begins with (`$BASE=$BASE:{X 100,...}`).
    fn active(&mut self, is_tool: bool) -> String {
        if let Some(known) = self.now.slot(is_tool).clone() {
            return known;
        }
        let what = if is_tool { "$tool" } else { "$base" };
        let why = format!("is meant relative to {}, which nothing in the files read sets before", what.to_uppercase());
        let name = format!("{what} (not set)");
        self.scan.frames.refuse(&name, &why);
        name
    }

    /// A tool or base that nobody knows before the program runs.
    pub(super) fn calculated(&mut self, name: String) -> String {
        self.scan.frames.refuse(&name, &calculated(&name));
        name
    }

    /// A tool or base that is an argument of its routine.
    fn of_routine(&mut self, name: &str) -> String {
        let why = format!(
            "the tool or base '{name}' is an argument of its routine, and which one the calls give is not followed"
        );
        let name = format!("{name} (an argument)");
        self.scan.frames.refuse(&name, &why);
        name
    }

    /// `BAS(#TOOL,1)`, `BAS(#BASE,2)`; `BAS(#CP_PARAMS,0.2)` sets what `FDAT_ACT` says, whatever was set since.
    pub(super) fn bas(&mut self) {
        if !(self.c.eat(b'(') && self.c.eat(b'#')) {
            return;
        }
        let what = self.c.word();
        if is_one_of(what, &[b"FRAMES", b"PTP_PARAMS", b"CP_PARAMS"]) {
            self.now = self.active.clone().unwrap_or_else(|| self.now.clone());
        } else if self.c.eat(b',') {
            let n = lower(self.c.until(b")\n\r").trim_ascii());
            let what = lower(what);
            let n = if is_number(&n) { n } else { self.calculated(format!("bas(#{what},{n})")) };
            match what.as_str() {
                "tool" => self.set(true, n),
                "base" => self.set(false, n),
                "ex_base" => {
                    let base = self.on_external_axis();
                    self.set(false, base);
                }
                _ => {}
            }
        }
    }

    /// Tool and base of an inline form whose text stands without its statements: `LIN P2 Vel=0.3 m/s CPDAT1 Tool[2]:torch Base[1]`.
    pub(super) fn inline_form(&mut self, line: &[u8]) {
        let mut c = Cursor::new(line, b';');
        while let Some((_, word)) = c.next_word() {
            let is_tool = word.eq_ignore_ascii_case(b"TOOL");
            if (is_tool || word.eq_ignore_ascii_case(b"BASE")) && c.eat(b'[') {
                let number = lower(c.until(b"]").trim_ascii());
                if is_number(&number) {
                    self.set(is_tool, number);
                }
            }
        }
    }

    /// The name of a base that an external axis moves.
    fn on_external_axis(&mut self) -> String {
        let what = "the work stands on an external axis (#EX_BASE, EK), which is not supported";
        self.scan.frames.frames.insert("#ex_base".into(), Err(what.into()));
        "#ex_base".into()
    }

    /// What the motion data say that stand in `STOOL2(FP1)` or `SBASE(FP1.BASE_NO)`, from behind the bracket on.
    fn of_motion_data(&mut self, is_tool: bool) -> String {
        self.c.skip_blank();
        let name = self.c.word();
        self.c.skip_past(b')', b";\n\r");
        let said = self.known_motion_data(name).and_then(|s| if is_tool { s.tool.clone() } else { s.frame.clone() });
        said.unwrap_or_else(|| format!("of '{}'", String::from_utf8_lossy(name)))
    }

    /// Tool and base that motion data were given.
    fn known_motion_data(&self, name: &[u8]) -> Option<&Setup> {
        self.motion_data.get(&hashed(name)).and_then(|(_, setup)| self.scan.setups.get(*setup as usize))
    }

    /// The name of a tool that stands still while the robot carries the work: of a product that is not usable, whatever
    /// the tool.
    fn fixed(&mut self, tool: Option<&str>) -> String {
        let what = "the tool stands still and the robot carries the work (#TCP), which is not supported";
        self.scan.frames.tools.insert("#tcp".into(), Err(what.into()));
        format!("{STANDING}{}", tool.unwrap_or_default())
    }

    /// `#TCP` or `#BASE`, behind `$IPO_MODE=`; what motion data say of it goes with their tool.
    pub(super) fn interpolation(&mut self) {
        let mode = if self.c.eat(b'#') { self.c.word() } else { b"" };
        let moves_tool = self.now.tool.as_ref().map(|tool| tool.trim_start_matches(STANDING).to_owned());
        if mode.eq_ignore_ascii_case(b"TCP") {
            self.now.tool = Some(self.fixed(moves_tool.as_deref()));
        } else if mode.eq_ignore_ascii_case(b"BASE") {
            self.now.tool = moves_tool.filter(|tool| !tool.is_empty());
        }
    }

    /// Sets the tool or the base; a tool that stands still goes on to do so.
    pub(super) fn set(&mut self, is_tool: bool, name: String) {
        self.used.extend(name.split(TIMES).filter(|part| is_number(part)).map(|part| (is_tool, part.to_owned())));
        let slot = self.now.slot(is_tool);
        let is_fixed = is_tool && slot.as_ref().is_some_and(|tool| tool.starts_with(STANDING));
        *slot = Some(if is_fixed { format!("{STANDING}{}", name.trim_start_matches(STANDING)) } else { name });
    }

    /// Past frames with the geometric operator behind them: the place that follows is meant in them. The base before is
    /// returned, where there are such frames.
    pub(super) fn in_frames(&mut self) -> Option<Option<String>> {
        let mut before = None;
        loop {
            let start = self.c;
            let is_frame = if self.c.peek() == b'{' {
                self.c.skip_past(b'}', b";\n\r");
                true
            } else {
                let word = self.c.word();
                self.is_frame(word)
            };
            self.c.skip_blank();
            if is_frame && self.c.peek() == b'[' {
                self.c.skip_past(b']', b"\n\r");
            }
            let is_left = is_frame && self.c.eat_in_line(b':');
            let behind = std::mem::replace(&mut self.c, start);
            if !is_left {
                return before;
            }
            let frame = self.one_frame(false);
            self.c = behind;
            let base = self.now.frame.take();
            let name = base.as_deref().unwrap_or_else(|| {
                let why = "is meant in a frame that is relative to $BASE, which the program does not set";
                self.scan.frames.frames.insert(UNSET.into(), Err(why.into()));
                UNSET
            });
            self.now.frame = Some(format!("{name}{TIMES}{frame}"));
            before = before.or(Some(base));
        }
    }

    /// Whether a name stands for a frame, to which no motion goes.
    pub(super) fn is_frame(&self, word: &[u8]) -> bool {
        !self.named.frames.is_empty() && {
            let name = self.key(word, self.c.at);
            self.named.frames.contains(&name) && !self.named.moved_to.contains(&name)
        }
    }

    /// `NAME=...`, `NAME[1]=...`, `NAME.X=...` of a frame, from behind its name at `from` on.
    pub(super) fn frame_data(&mut self, from: usize) {
        self.c.skip_blank();
        if self.c.peek() == b'[' {
            self.c.skip_past(b']', b"\n\r");
        }
        let name = lower(self.c.bytes.get(from..self.c.at).unwrap_or(&[]).trim_ascii_end());
        let whole = self.c.at;
        while matches!(self.c.peek(), b'.' | b' ') || self.c.peek().is_ascii_alphanumeric() {
            self.c.at += 1;
        }
        if !self.c.assigns() {
            return;
        }
        let is_part = self.c.bytes.get(whole..self.c.at).is_some_and(|part| !part.trim_ascii().is_empty());
        self.c.at += 1;
        self.c.skip_blank();
        let frame = if is_part { Err(calculated(&name)) } else { self.given(&name) };
        if name.split_once('[').is_some_and(|(_, index)| !is_number(index.trim_end_matches(']').trim())) {
            self.scan.problem(from, changed_here("a tool or base"));
        }
        self.declare(&name, frame);
    }

    /// The frame that is assigned to this name, at the cursor: `{...}`, also several with the geometric operator between them. Frames that the
    /// program names among them may stand below or in other files: they are multiplied when all is read ([`Self::in_products`]).
    fn given(&mut self, name: &str) -> Result<Frame, String> {
        let start = self.c;
        let mut product = Frame::massless(Pose::identity());
        while self.c.peek() == b'{' {
            let found = self.aggregate();
            product = product.compose(&self.frame(&found)?);
            if !self.c.eat_in_line(b':') {
                return Ok(product);
            }
        }
        let both = [true, false].map(|is_tool| {
            self.c = start;
            self.current(is_tool)
        });
        self.c.skip_blank();
        let is_whole = matches!(self.c.peek(), b'\n' | b'\r' | b';' | 0);
        if is_whole && both.iter().all(|product| product.contains(TIMES) && product.split(TIMES).all(|one| one != name))
        {
            self.products.insert(name.to_owned(), both);
        }
        Err(calculated(name))
    }

    /// Puts products of frames in the places of the names that they are assigned to, where that is so once in the program.
    pub(super) fn in_products(&mut self) {
        self.multiply();
        let mut setups = std::mem::take(&mut self.scan.setups);
        for setup in &mut setups {
            for is_tool in [true, false] {
                let slot = setup.slot(is_tool);
                let Some(name) = slot.clone() else { continue };
                let one = |part: &str| {
                    let data = if is_tool { "tool_data" } else { "base_data" };
                    let name = if is_number(part) { format!("{data}[{part}]") } else { part.to_owned() };
                    let product = self.products.get(&name).filter(|_| self.assigned_once(&name));
                    product.map_or_else(|| part.to_owned(), |both| both[usize::from(!is_tool)].clone())
                };
                *slot = Some(name.split(TIMES).map(one).collect::<Vec<_>>().join(TIMES));
            }
        }
        self.scan.setups = setups;
    }

    /// Declares products of which the file has all frames, for other files too (`TOOL_DATA[3]=TOOL_DATA[1]:{...}` in `$config.dat`).
    fn multiply(&mut self) {
        let mut names: Vec<String> = self.products.keys().cloned().collect();
        names.sort_unstable();
        names.truncate(MOST_PRODUCTS);
        names.retain(|name| self.assigned_once(name));
        // one may be of others that stand below
        for name in std::iter::repeat_n(&names, DEEPEST).flatten() {
            let Some(both) = self.products.get(name) else { continue };
            let number = |data: &str| name.strip_prefix(data).map(|n| n.trim_matches(['[', ']']).to_owned());
            let numbers = ["tool_data[", "base_data["].map(number);
            let key = numbers.iter().flatten().next().unwrap_or(name);
            for (k, is_tool) in [true, false].into_iter().enumerate() {
                if numbers[1 - k].is_none() {
                    product(self.scan.frames.of_mut(is_tool), &both[k], key.clone());
                }
            }
        }
    }

    /// Whether the program assigns something to this name (of an element: with its index), and not to a part of it, in one place only.
    fn assigned_once(&self, name: &str) -> bool {
        let stem = name.split('[').next().unwrap_or(name).as_bytes();
        let mut c = Cursor::new(self.c.bytes, b';');
        let mut times = 0;
        while let Some((from, word)) = c.next_word() {
            if !word.eq_ignore_ascii_case(stem) {
                continue;
            }
            c.skip_blank();
            if c.peek() == b'[' {
                c.skip_past(b']', b"\n\r");
            }
            let whole = lower(c.bytes.get(from..c.at).unwrap_or(&[]));
            if whole.bytes().filter(|b| !b.is_ascii_whitespace()).eq(name.bytes()) {
                c.skip_blank();
                times += if c.peek() == b'.' { 2 } else { usize::from(c.assigns()) };
            }
        }
        times == 1
    }

    /// Keeps a frame of the program under its name; it may be used as a tool too.
    pub(super) fn declare(&mut self, name: &str, frame: Result<Frame, String>) {
        for is_tool in [true, false] {
            declare(self.scan.frames.of_mut(is_tool), name.to_owned(), frame.clone(), SEVERAL);
        }
    }

    /// `TOOL_DATA[1]={...}`, from the brace on.
    pub(super) fn element(&mut self, is_tool: bool, number: String) {
        let name = format!("{}[{number}]", if is_tool { "tool_data" } else { "base_data" });
        let frame = self.given(&name);
        // $TOOL and $BASE keep what they were until they are set again
        let is_active = self.now.slot(is_tool).as_ref() == Some(&number);
        let frame = if is_active {
            Err("goes with a tool or base that the program changes while it is active".to_owned())
        } else {
            frame
        };
        if !self.flow.is_certain() || self.used.contains(&(is_tool, number.clone())) {
            self.products.remove(&name);
            self.scan.set_late.insert((is_tool, number.clone()));
        }
        declare(self.scan.frames.of_mut(is_tool), number, frame, SEVERAL);
    }

    /// Tool and base of motion data.
    pub(super) fn said(&mut self, found: &Aggregate<'_>) -> Setup {
        let text = |name: &[u8]| found.number(name).map(|s| lower(s.text(self.c.bytes)));
        let (tool, frame) = (text(b"TOOL_NO"), text(b"BASE_NO"));
        let fixed = matches!(found.field(b"IPO_FRAME"), Some(Err(s)) if mentions(s.text(self.c.bytes), b"TCP"));
        Setup { tool: if fixed { Some(self.fixed(tool.as_deref())) } else { tool }, frame }
    }

    /// `FDAT_ACT=FP1`: tool and base are those of the data, where these are known and as they were given.
    pub(super) fn take_motion_data(&mut self, name: &[u8], at: usize) {
        let is_whole = !matches!(self.c.peek(), b'[' | b'.' | b'(')
            && self.key(name, at) == hashed(name)
            && !self.named.changed_data.contains(&hashed(name));
        let known = self.known_motion_data(name).filter(|_| is_whole).cloned();
        self.now = known.unwrap_or_else(|| {
            let unknown = self.calculated(format!("fdat_act={}", lower(name)));
            Setup { tool: Some(unknown.clone()), frame: Some(unknown) }
        });
        let Setup { tool, frame } = self.now.clone();
        self.active = Some(self.now.clone());
        self.used
            .extend([(true, tool), (false, frame)].into_iter().filter_map(|(is_tool, name)| Some((is_tool, name?))));
    }

    /// `FDAT_ACT.TOOL_NO=2`, behind the part; of other data, that they are no longer as they were given.
    pub(super) fn part_of_motion_data(&mut self, name: &[u8], is_tool: bool) {
        if !name.eq_ignore_ascii_case(b"FDAT_ACT") {
            self.motion_data.remove(&hashed(name));
            return;
        }
        self.c.eat_in_line(b'=');
        let number = lower(self.c.until(b";\n\r").trim_ascii());
        let part = if is_tool { "tool" } else { "base" };
        let number = if is_number(&number) { number } else { self.calculated(format!("fdat_act.{part}_no={number}")) };
        self.active = None;
        self.set(is_tool, number);
    }

    pub(super) fn motion_data(&mut self, name: &[u8]) {
        self.c.skip_blank();
        if self.c.peek() != b'{' {
            return;
        }
        let found = self.aggregate();
        let setup = self.said(&found);
        if setup != Setup::default() {
            let setup = self.scan.setup(setup);
            self.motion_data.insert(hashed(name), (target_of(name), setup));
        }
    }
}
