"""FANUC TP listings, as a controller runs them: lines with labels, positions of /POS, registers."""

from __future__ import annotations

import re

import numpy as np

from .arm import Tool, angles, zyx
from .language import STEPS, Motion

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
MOTION = re.compile(r"^([JLCAS])\s+(P|PR)\[((?:[^\[\]]|\[[^\]]*\])+)\](.*)$")


class Position:
    """A position of /POS or a register: joints (rad) or a transform; what it comes from."""

    def __init__(self, text: str, because: frozenset) -> None:
        one = re.split(r"\n\s*GP2", text)[0]
        number = {k: float(v) for k, v in re.findall(rf"(?<![A-Z])(X|Y|Z|W|P|R|J[1-6]|E[1-3])\s*=\s*({NUMBER})", one)}
        setup = dict(re.findall(r"(UF|UT)\s*:\s*(\w+)", one))
        self.frame, self.tool = setup.get("UF", "F"), setup.get("UT", "F")
        self.joints = "J1" in number
        self.taught = bool(number)
        self.external = any(number.get(f"E{k}", 0.0) != 0.0 for k in (1, 2, 3))
        self.because = because
        if self.joints:
            j = [number[f"J{k}"] for k in range(1, 7)]
            j[2] += j[1]  # joint 3 counts from the horizontal
            self.at = np.radians(j)
        else:
            self.at = zyx(*(number.get(k, 0.0) for k in ("X", "Y", "Z", "R", "P", "W")))

    def copy(self, because: frozenset) -> Position:
        out = Position("", self.because | because)
        out.__dict__.update({k: v for k, v in self.__dict__.items() if k != "because"})
        out.at = self.at.copy()
        return out


class Controller:
    """Tools and frames by number, from the controller's own tables (`elsewhere`)."""

    def __init__(self, text: str, elsewhere: str) -> None:
        self.lines: list[tuple[int, str]] = []
        self.positions: dict[int, Position] = {}
        self.registers: dict[int, float] = {}
        self.kept: dict[int, Position] = {}
        self.tables: dict[str, dict[str, np.ndarray]] = {"tool": {}, "frame": {}}
        self.signals: dict[str, int] = {}
        self.active = {"UF": ("0", frozenset()), "UT": ("0", frozenset())}
        self.offset: Position | None = None
        self.motions: list[Motion] = []
        for kind, number, values in re.findall(r"(tool|frame|PR|R)\[(\d+)\]\s*=\s*(.*)", elsewhere):
            v = [float(x) for x in re.findall(NUMBER, values)]
            if kind == "R":
                self.registers[int(number)] = v[0]
            elif kind == "PR":
                self.kept[int(number)] = Position("X=0", frozenset({("elsewhere", number)}))
                self.kept[int(number)].at = zyx(*v)
            else:
                self.tables[kind][number] = zyx(*v)
        self.read(text)

    def read(self, text: str) -> None:
        before, _, after = text.partition("/POS")
        first = before.count("\n") + 1
        body = before.partition("/MN")[2]
        start = before.partition("/MN")[0].count("\n") + 1
        ended = True
        for k, line in enumerate(body.split("\n")):
            m = re.match(r"\s*(?:\d*\s*:)?(.*?)\s*(;?)\s*$", line)
            if not m or not m.group(0).strip():
                continue
            if ended:
                self.lines.append((start + k, m.group(1).strip()))
            else:  # goes on with the line before
                self.lines[-1] = (self.lines[-1][0], f"{self.lines[-1][1]} {m.group(1).strip()}")
            ended = bool(m.group(2))
        for m in re.finditer(r"P\[(\d+)[^\]]*\]\{(.*?)\};", after, re.S):
            begin = first + after[: m.start()].count("\n")
            lines = frozenset(range(begin, begin + m.group(0).count("\n") + 1))
            self.positions[int(m.group(1))] = Position(m.group(2), lines)

    def number(self, text: str) -> float:
        text = text.strip()
        if m := re.fullmatch(r"R\[(\d+)[^\]]*\]", text):
            return self.registers.get(int(m.group(1)), 0.0)
        if m := re.fullmatch(rf"({NUMBER})[^\]]*", text):
            return float(m.group(1))
        if m := re.fullmatch(r"(.+?)([-+*/])(.+)", text):
            a, b = self.number(m.group(1)), self.number(m.group(3))
            return {"+": a + b, "-": a - b, "*": a * b, "/": a / b if b else 0.0}[m.group(2)]
        return 0.0

    def true(self, text: str) -> bool:
        m = re.match(r"(.+?)\s*(<>|<=|>=|=|<|>)\s*(.+)", text)
        assert m, text
        if re.match(r"(DI|RI|UI|SI|F)\[", m.group(1)):  # a signal comes when it was asked for twice
            self.signals[m.group(1)] = self.signals.get(m.group(1), 0) + 1
            return self.signals[m.group(1)] >= 2
        a, b = self.number(m.group(1)), self.number(m.group(3))
        return {"=": a == b, "<>": a != b, "<": a < b, ">": a > b, "<=": a <= b, ">=": a >= b}[m.group(2)]

    def jump(self, label: str) -> int:
        name = re.match(r"\d+", label)
        assert name
        return next(k for k, (_, s) in enumerate(self.lines) if re.match(rf"LBL\[{name.group()}\b", s))

    def behind(self, at: int, *words: str) -> int:
        """Behind the next line of this block that begins with one of the words."""
        depth = 0
        for k in range(at, len(self.lines)):
            s = self.lines[k][1]
            if depth == 0 and s.startswith(words):
                return k + 1
            depth += bool(re.match(r"IF .* THEN", s)) - s.startswith("ENDIF")
        raise AssertionError("a block that does not end")

    def run(self) -> None:
        at, steps = 0, 0
        loops: list[tuple[int, int, float]] = []
        while at < len(self.lines):
            steps += 1
            assert steps < STEPS, "the program does not end"
            line, s = self.lines[at]
            at += 1
            if m := re.match(r"FOR R\[(\d+)[^\]]*\]=(.+) TO (.+)", s):
                self.registers[int(m.group(1))] = self.number(m.group(2))
                loops.append((at, int(m.group(1)), self.number(m.group(3))))
            elif s.startswith("ENDFOR"):
                begin, r, last = loops[-1]
                self.registers[r] += 1
                if self.registers[r] <= last:
                    at = begin
                else:
                    loops.pop()
            elif m := re.match(r"IF (.+?),\s*JMP LBL\[(.+?)\]", s):
                if self.true(m.group(1)):
                    at = self.jump(m.group(2))
            elif m := re.match(r"IF \((.+)\) THEN", s):
                if not self.true(m.group(1)):
                    at = self.behind(at, "ELSE", "ENDIF")
            elif s.startswith("ELSE"):
                at = self.behind(at, "ENDIF")
            elif m := re.match(r"IF (.+?),\s*(.+)", s):
                if self.true(m.group(1)):
                    self.instruct(line, m.group(2))
            elif m := re.match(r"JMP LBL\[(.+?)\]", s):
                if steps < 300:
                    at = self.jump(m.group(1))
            elif re.match(r"(END|ABORT)\b", s):
                break
            else:
                self.instruct(line, s)

    def instruct(self, line: int, s: str) -> None:
        if m := re.match(r"(UFRAME|UTOOL)_NUM\s*=\s*(.+)", s):
            which = "UF" if m.group(1) == "UFRAME" else "UT"
            self.active[which] = (str(int(self.number(m.group(2)))), frozenset({line}))
        elif m := re.match(r"R\[(\d+)[^\]]*\]\s*=\s*(.+)", s):
            self.registers[int(m.group(1))] = self.number(m.group(2))
        elif m := re.match(r"PR\[(\d+)(?::[^\]]*)?\]\s*=\s*(.+)", s):
            self.keep(int(m.group(1)), m.group(2), line)
        elif m := re.match(r"PR\[(\d+),(\d)[^\]]*\]\s*=\s*(.+)", s):
            p = self.kept[int(m.group(1))]
            k = int(m.group(2)) - 1
            if k < 3:
                inside = re.fullmatch(r"PR\[\d+,\d\]([-+].+)", m.group(3))
                add = self.number(inside.group(1)[1:]) * (-1 if inside.group(1)[0] == "-" else 1) if inside else 0.0
                p.at[k, 3] = p.at[k, 3] + add / 1e3 if inside else self.number(m.group(3)) / 1e3
            p.because |= {line, "shifted"}
        elif m := re.match(r"OFFSET CONDITION PR\[(\d+)", s):
            self.offset = self.kept[int(m.group(1))]
        elif m := MOTION.match(s):
            self.move(line, m.group(1), m.group(2), m.group(3), m.group(4))

    def keep(self, number: int, what: str, line: int) -> None:
        if m := re.match(r"P\[(.+?)\]", what):
            self.kept[number] = self.positions[int(self.number(m.group(1)))].copy(frozenset({line}))
        elif m := re.match(r"PR\[(\d+)", what):
            self.kept[number] = self.kept[int(m.group(1))].copy(frozenset({line}))
        else:
            self.kept[number] = Position("X=0", frozenset({line, *(["here"] if what[0] in "LJ" else [])}))
            last = self.motions[-1] if self.motions else None
            if last is not None and what[0] == "L" and not last.joints:
                self.kept[number].at = last.target.copy()

    def move(self, line: int, kind: str, table: str, which: str, rest: str) -> None:
        number = int(self.number(which.partition(":")[0]))
        p = (self.positions if table == "P" else self.kept).get(number)
        assert p is not None, f"line {line}: {table}[{number}] is not known"
        because = p.because | {line}
        at = p.at
        if re.search(r"\bINC\b", rest):
            because |= {"here"}
        if re.search(r"\bOffset\b", rest):
            given = re.search(r"Offset,PR\[(\d+)", rest)
            by = self.kept[int(given.group(1))] if given else self.offset
            assert by is not None
            at, because = by.at @ at, because | {"shifted"}
        if tool := re.search(r"Tool_Offset,PR\[(\d+)", rest):
            at, because = at @ self.kept[int(tool.group(1))].at, because | {"shifted"}
        setup = {}
        for key, own, table_name in (("UF", p.frame, "frame"), ("UT", p.tool, "tool")):
            # a register has neither tool nor frame
            n, of_it = (own, frozenset()) if own != "F" and table == "P" else self.active[key]
            because |= of_it
            setup[key] = self.tables[table_name].get(n, np.eye(4))
        self.motions.append(Motion(line, because, at, p.joints, Tool(setup["UT"]), setup["UF"], None, p.external))
        if kind == "C" and (second := re.search(r"(P|PR)\[(.+?)\](.*)$", rest)):
            self.move(line, "L", *second.groups())


def run(text: str, elsewhere: str = "", **_: str) -> list[Motion]:
    """The motions of a listing; `elsewhere` has lines such as `tool[1] = 18 -12 118 0 0 0`, `R[3] = 5`."""
    controller = Controller(text, elsewhere)
    controller.run()
    return controller.motions


__all__ = ["angles", "run"]
