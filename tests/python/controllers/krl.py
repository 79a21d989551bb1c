"""KUKA KRL, as a controller runs it: frames, axis values, inline forms, `$TOOL` and `$BASE`."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from .arm import Tool, angles, zyx
from .language import Function, Leave, Machine, Motion, Parser, tokens

MOTIONS = {"ptp": 1, "lin": 1, "circ": 2, "sptp": 1, "slin": 1, "scirc": 2, "spl": 1, "ptp_rel": 1, "lin_rel": 1}
ZERO = dict.fromkeys("xyzabc", 0.0)
IGNORED = (
    "&", "wait", "trigger", "interrupt", "bas_ini", "ini", "continue", "halt", "spline", "endspline", "ext", "extfct",
    "enddat", "signal", "struc", "enum", "import", "time_block",
)  # fmt: skip
# what looks like a call and only sets speeds
SPEEDS = ("#initmov", "#vel_ptp", "#acc_ptp", "#vel_cp", "#acc_cp")


class Krl(Parser):
    """Source and data files."""

    operators: ClassVar = {**Parser.operators, ":": (6, Parser.operators["+"][1])}

    def primary(self) -> tuple:
        if self.has("{"):
            out = {}
            while not self.has("}"):
                name = self.next().text
                if self.has(":"):  # a type before the parts
                    name = self.next().text
                if self.has("["):
                    self.need("]")
                out[name] = self.expression(4)
                self.has(",")
            return ("record", out)
        if self.has("#"):
            return ("value", "#" + self.next().text)
        return super().primary()

    def line(self) -> None:
        while self.now.kind not in ("end", "eof"):
            self.next()
        self.next()

    def module(self) -> tuple[list, dict[str, Function], str]:
        data: list = []
        routines: dict[str, Function] = {}
        first = ""
        while self.now.kind != "eof":
            if self.has("global"):
                pass
            elif self.now.text in ("def", "deffct"):
                function = self.next().text == "deffct"
                if function:
                    self.next()
                name = self.next().text
                first = first or name
                parameters = []
                self.need("(")
                while not self.has(")"):
                    word = self.next()
                    if word.kind == "name" and word.text not in ("in", "out"):
                        parameters.append(word.text)
                block = self.block("endfct" if function else "end")
                # what is declared of a parameter is its type
                own = [s for s in block if not (s[0] == "declare" and s[2] in parameters)]
                routines[name] = Function(parameters, own)
            elif self.has("defdat"):
                self.line()
            else:
                data += self.statement()
        return data, routines, first

    def statement(self) -> list:
        word = self.now
        line = word.line
        if word.kind == "end":
            self.next()
            return []
        if word.text in IGNORED:
            self.line()
            return []
        if self.has("if"):
            condition = self.expression()
            self.need("then")
            branches = [(condition, self.block("else", "endif"))]
            if self.ended == "else":
                branches.append((("value", True), self.block("endif")))
            return [("if", line, branches)]
        if self.has("for"):
            name = self.next().text
            self.need("=")
            first = self.expression()
            self.need("to")
            last = self.expression()
            by = self.expression() if self.has("step") else ("value", 1.0)
            return [("for", line, name, first, last, by, self.block("endfor"))]
        if self.has("loop"):
            return [("while", line, ("value", True), self.block("endloop"))]
        if self.has("while"):
            condition = self.expression()
            return [("while", line, condition, self.block("endwhile"))]
        if self.has("repeat"):
            body = self.block("until")
            return [*body, ("while", line, ("not", self.expression()), body)]
        if self.has("switch"):
            return [self.switch(line)]
        if self.has("exit", "return"):
            value = [] if self.now.kind == "end" else [self.expression()]
            return [("leave", line, value, word.text == "exit")]
        if word.text in MOTIONS:
            return [self.motion(line)]
        if self.has("decl", "global"):
            return self.declaration(line)
        if self.words[self.at + 1].kind == "name":
            return self.declaration(line)
        left = self.unary()
        if self.has("="):
            return [("assign", line, left, self.expression())]
        assert left[0] == "call", f"line {line}: not understood"
        return [("do", line, left)]

    def switch(self, line: Any) -> tuple:
        of, cases = self.expression(), []
        self.block("case", "default", "endswitch")
        while self.ended != "endswitch":
            values = []
            if self.ended == "case":
                values.append(self.expression(4))
                while self.has(","):
                    values.append(self.expression(4))
            cases.append((values, self.block("case", "default", "endswitch")))
        return ("switch", line, of, cases)

    def motion(self, line: Any) -> tuple:
        kind = self.next().text
        to = [self.expression()]
        while self.has(","):
            to.append(self.expression())
        data = ""  # `WITH $TOOL=STOOL2(FP1), $BASE=SBASE(FP1.BASE_NO)`
        while self.now.kind != "end":
            if self.next().text == "stool2":
                self.need("(")
                data = self.next().text
        return ("move", line, kind, to[: MOTIONS[kind]], data)

    def declaration(self, line: Any) -> list:
        while self.has("decl", "global", "const"):
            pass
        kind = self.next().text
        if self.has("const"):
            pass
        out = []
        while self.now.kind == "name":
            name = self.next().text
            value: tuple = ("value", dict(ZERO) if kind in ("pos", "e6pos", "frame") else 0.0)
            if self.has("["):
                size = self.next()
                self.has("]")
                value = ("list", [value] * int(float(size.text))) if size.text != "]" else ("value", "")
            if self.has("="):
                value = self.expression()
            out.append(("declare", line, name, value))
            self.has(",")
        self.line()
        return out


def frame(of: dict) -> np.ndarray:
    return zyx(*(of.get(k, 0.0) for k in "xyzabc"))


def record(t: np.ndarray) -> dict:
    return dict(zip("xyzabc", [*(t[:3, 3] * 1e3), *angles(t)], strict=True))


class Controller(Machine):
    """`$TOOL`, `$BASE` and the motion data are variables like others; `BAS` copies them."""

    def __init__(self) -> None:
        super().__init__()
        for name in ("$tool", "$base", "$nullframe"):
            self.set(name, dict(ZERO), frozenset())
        for name in ("tool_data", "base_data"):
            self.set(name, [dict(ZERO) for _ in range(32)], frozenset())
        for name in ("$timer", "$out", "$in", "$ipo_mode", "load_data", "$workspace", "$flag", "$vel", "$acc", "$apo"):
            self.set(name, [0.0] * 64, frozenset())

    def load(self, text: str, file: str = "") -> tuple[list, str]:
        text = "\n".join("" if t.lstrip().startswith("&") else t for t in text.split("\n"))
        data, routines, first = Krl(tokens(text, ";", True, file)).module()
        self.functions |= routines
        if routines:
            self.run([s for s in data if s[0] == "declare"])
            data = [s for s in data if s[0] != "declare"]
        return data, first

    def unknown(self, name: str, line: Any) -> Any:
        if name == "$pos_act":
            self.touched |= {"here"}
            return record(self.motions[-1].target)
        if name in ("$axis_act", "$pos_for", "$pos_int"):
            self.touched |= {"here"}
            return dict.fromkeys(["a1", "a2", "a3", "a4", "a5", "a6"], 0.0)
        return super().unknown(name, line)

    def combine(self, op: str, a: Any, b: Any) -> Any:
        if op == ":":
            self.touched |= {"shifted"}
            return {**a, **record(frame(a) @ frame(b))}
        return super().combine(op, a, b)

    def place(self, e: tuple, value: Any, because: frozenset) -> None:
        if e[0] == "name" and e[1].startswith("$") and self.variable(e[1]) is None:
            self.set(e[1], value, because)
            return
        if e[0] == "part" and self.variable(e[1][1] if e[1][0] == "name" else "") is None and e[1][0] == "name":
            self.set(e[1][1], {}, because)
        if e == ("name", "$tool", e[-1]) or e == ("name", "$base", e[-1]):
            value = value.get("frame", value)
        super().place(e, value, because)

    def instruct(self, s: tuple) -> None:
        if s[0] == "move":
            before = {name: self.variable(name) for name in ("$tool", "$base")} if s[4] else {}
            if s[4]:
                self.frames(s[1], s[4])
            for to in s[3]:
                self.move(s[1], s[2], to)
            for name, was in before.items():
                if was is not None:
                    self.set(name, was.value, was.because)
            return
        _, line, (_, name, args, *_) = s
        if name == "bas":
            self.bas(line, [("value", a[1]) if a[0] == "value" else a for a in args])
        elif name in self.functions:
            self.call(name, args, {}, line)

    def bas(self, line: Any, args: list) -> None:
        what = args[0][1]
        if what in ("#tool", "#base"):
            self.choose(line, what[1:], *self.fresh(args[1]))
        elif what in ("#frames", "#ptp_params", "#cp_params"):
            self.frames(line, "fdat_act")

    def frames(self, line: Any, motion_data: str) -> None:
        data, because = self.fresh(("name", motion_data, line))
        for which in ("tool", "base"):
            self.choose(line, which, data[f"{which}_no"], because)

    def choose(self, line: Any, which: str, number: Any, because: frozenset) -> None:
        table = self.variable(f"{which}_data")
        assert table is not None
        chosen = table.value[int(number) - 1] if number > 0 else ZERO
        self.set(f"${which}", chosen, because | table.because | {line})

    def move(self, line: Any, kind: str, to: tuple) -> None:
        target, because = self.fresh(to)
        if isinstance(target, str) or not target:
            return
        tool, base = self.variable("$tool"), self.variable("$base")
        assert tool is not None and base is not None
        because |= tool.because | base.because | {line}
        last = self.motions[-1] if self.motions else None
        joints = any(k.startswith("a") and k[1:].isdigit() for k in target)
        if kind.endswith("_rel"):
            because |= {"here"}
        if joints:
            start = np.degrees(last.target) if last is not None and last.joints else np.zeros(6)
            at = np.radians([target.get(f"a{k + 1}", start[k]) for k in range(6)])
        else:
            start = record(last.target) if last is not None and not last.joints else ZERO
            at = frame({**start, **target})
        external = any(k.startswith("e") and k[1:].isdigit() and v != 0 for k, v in target.items())
        turns = None if joints else (target.get("s"), target.get("t"))
        self.motions.append(
            Motion(line, because, at, joints, Tool(frame(tool.value)), frame(base.value), turns, external)
        )


def run(text: str, elsewhere: str = "", dat: str = "", config: str = "", **_: str) -> list[Motion]:
    """The motions of a `.src` with its `.dat`, the controller's `$config.dat`, and other modules."""
    controller = Controller()
    for name, more in (("config", config), ("elsewhere", elsewhere), ("dat", dat)):
        controller.run(controller.load(more, name)[0])
    body, first = controller.load(text)
    try:
        controller.run(controller.functions[first].body if first else body)
    except Leave:
        pass
    return controller.motions
