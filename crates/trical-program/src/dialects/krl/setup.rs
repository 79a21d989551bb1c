//! What sets tool and base in KRL: `$TOOL` and `$BASE`, `BAS`, motion data of inline forms.

use super::{Aggregate, ELEMENTS, Reader, target_of};
use crate::frames::{AT, ToolFrame, named};
use crate::scan::Setup;
use crate::text::{is_one_of, lower, mentions};

impl Reader<'_> {
    /// What is behind `$TOOL=` or `$BASE=`.
    pub(super) fn current(&mut self, is_tool: bool) -> String {
        if self.c.peek() == b'{' {
            let at = self.c.at;
            let found = self.aggregate();
            let frame = self.frame(&found);
            // the same numbers are the same tool or base wherever they stand
            return if is_tool {
                named(&mut self.scan.frames.tools, format!("$tool{AT}{at}"), frame.map(ToolFrame::massless))
            } else {
                named(&mut self.scan.frames.frames, format!("$base{AT}{at}"), frame)
            };
        }
        let word = self.c.word();
        if is_one_of(word, &[b"$NULLFRAME", b"$WORLD"]) {
            return "0".into();
        }
        if is_one_of(word, &[b"STOOL", b"STOOL2", b"SBASE"]) && self.c.eat(b'(') {
            return self.of_motion_data(is_tool);
        }
        if word.eq_ignore_ascii_case(b"EK") {
            return self.on_external_axis();
        }
        self.c.skip_blank();
        if is_one_of(word, &ELEMENTS)
            && self.c.eat_in_line(b'[')
            && let Some(n) = self.c.number()
        {
            return lower(n.text(self.c.bytes));
        }
        // calculated: $BASE = A : B
        let name = lower(word);
        if self.c.peek() == b':' || name.is_empty() { format!("{name}: (computed)") } else { name }
    }

    /// `BAS(#TOOL,1)`, `BAS(#BASE,2)`
    pub(super) fn bas(&mut self) {
        if !(self.c.eat(b'(') && self.c.eat(b'#')) {
            return;
        }
        let what = self.c.word();
        if self.c.eat(b',') {
            self.c.skip_blank();
            let n = self.c.number().map_or_else(|| "(computed)".into(), |n| lower(n.text(self.c.bytes)));
            match lower(what).as_str() {
                "tool" => self.now.tool = Some(n),
                "base" => self.now.frame = Some(n),
                "ex_base" => self.now.frame = Some(self.on_external_axis()),
                _ => {}
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
        let setup = self.motion_data.get(&target_of(name)).and_then(|s| self.scan.setups.get(*s as usize));
        let said = setup.and_then(|s| if is_tool { s.tool.clone() } else { s.frame.clone() });
        said.unwrap_or_else(|| format!("of '{}'", String::from_utf8_lossy(name)))
    }

    /// The name of a tool that stands still while the robot carries the work.
    pub(super) fn fixed_tool(&mut self) -> String {
        let what = "the tool stands still and the robot carries the work (#TCP), which is not supported";
        self.scan.frames.tools.insert("#tcp".into(), Err(what.into()));
        "#tcp".into()
    }

    /// Tool and base of motion data.
    pub(super) fn said(&mut self, found: &Aggregate<'_>) -> Setup {
        let text = |name: &[u8]| found.number(name).map(|s| lower(s.text(self.c.bytes)));
        let (tool, frame) = (text(b"TOOL_NO"), text(b"BASE_NO"));
        let fixed = matches!(found.field(b"IPO_FRAME"), Some(Err(s)) if mentions(s.text(self.c.bytes), b"TCP"));
        Setup { tool: if fixed { Some(self.fixed_tool()) } else { tool }, frame }
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
            self.motion_data.insert(target_of(name), setup);
        }
    }
}
