"""ABB RAPID, as a controller runs it: modules, routines, robtargets with tools and work objects."""

from __future__ import annotations

from typing import Any

import numpy as np

from .arm import Tool, angles, from_quaternion, quaternion, shift, turn
from .language import Function, Leave, Machine, Motion, Parser, tokens

PARTS = {
    "trans": 0, "rot": 1, "robconf": 2, "extax": -1, "robax": 0, "x": 0, "y": 1, "z": 2, "q1": 0, "q2": 1, "q3": 2,
    "q4": 3, "cf1": 0, "cf4": 1, "cf6": 2, "cfx": 3, "robhold": 0, "tframe": 1, "tload": 2, "uframe": 3, "oframe": 4,
    "eax_a": 0, "eax_b": 1, **{f"rax_{k}": k - 1 for k in range(1, 7)},
}  # fmt: skip
NOTHING = [9e9] * 6
AT_ZERO = [[0.0] * 3, [1.0, 0.0, 0.0, 0.0]]
DEFAULTS: dict[str, Any] = {
    "robtarget": [*AT_ZERO, [0.0] * 4, NOTHING], "jointtarget": [[0.0] * 6, NOTHING], "pose": AT_ZERO,
    "pos": [0.0] * 3, "bool": False, "string": "",
}  # fmt: skip
# instructions that move, and where their targets and their tool stand among the arguments
TO = {
    **dict.fromkeys(["movej", "movel", "moveabsj", "trigglios", "triggl", "triggj"], ([0], -1)),
    **dict.fromkeys(["movec", "triggc"], ([0, 1], -1)),
    **dict.fromkeys(["arcl", "arclstart", "arclend", "spotl", "displ"], ([0], -1)),
    **dict.fromkeys(["moveldo", "movejdo", "movelsync", "movejsync"], ([0], 3)),
    "searchl": ([2], -1),
    "searchj": ([2], -1),
}


class Rapid(Parser):
    """Modules; `parts` are the components of its records."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.parts: dict[str, int] = {}

    def index_opens(self) -> bool:
        return self.now.text == "{"

    def arguments(self, close: str) -> tuple[list, dict]:
        args, options = [], {}
        while not self.has(close):
            if self.has("\\"):
                name = self.next().text
                options[name] = self.expression() if self.has(":=") else ("value", True)
            else:
                args.append(self.expression())
            self.has(",")
        return args, options

    def module(self) -> tuple[list, dict[str, Function]]:
        data, routines = [], {}
        while self.now.kind != "eof":
            word = self.now.text
            if word in ("local", "task", "%"):
                self.next()
            elif word == "module":
                while not self.next().text == "module":
                    pass
                self.next()
                if self.has("("):
                    self.list(")")
            elif self.has("endmodule"):
                pass
            elif self.has("record"):
                self.next()
                words = []
                while not self.has("endrecord"):
                    words.append(self.next().text)
                self.parts |= {name: k for k, name in enumerate(words[1::3])}
            elif word in ("proc", "func", "trap"):
                self.next()
                if word == "func":
                    self.next()
                name = self.next().text
                parameters, lent = self.parameters() if self.has("(") else ([], frozenset())
                routines[name] = Function(parameters, self.block(f"end{word}"), lent)
            else:
                data += self.statement()
        return data, routines

    def parameters(self) -> tuple[list[str], frozenset[str]]:
        """Their names, and those by which a routine changes what it is given."""
        all: list[list[str]] = [[]]
        while not self.has(")"):
            word = self.next()
            if word.text == ",":
                all.append([])
            elif word.kind == "name":
                all[-1].append(word.text)
        all = [words for words in all if words]
        lent = (words[-1] for words in all if words[0] in ("var", "pers", "inout"))
        return [words[-1] for words in all], frozenset(lent)

    def statement(self) -> list:
        word = self.now
        line = word.line
        if word.text in ("const", "pers", "var", "local", "task"):
            return self.declaration()
        if self.has("if"):
            branches = [(self.expression(), [])]
            if not self.has("then"):
                return [("if", line, [(branches[0][0], self.statement())])]
            branches[0] = (branches[0][0], self.block("elseif", "else", "endif"))
            while self.ended != "endif":
                condition = self.expression() if self.ended == "elseif" else ("value", True)
                if self.ended == "elseif":
                    self.need("then")
                branches.append((condition, self.block("elseif", "else", "endif")))
            return [("if", line, branches)]
        if self.has("for"):
            name = self.next().text
            self.need("from")
            first = self.expression()
            self.need("to")
            last = self.expression()
            by = self.expression() if self.has("step") else ("value", 1.0)
            self.need("do")
            return [("for", line, name, first, last, by, self.block("endfor"))]
        if self.has("while"):
            condition = self.expression()
            self.need("do")
            return [("while", line, condition, self.block("endwhile"))]
        if self.has("test"):
            return [self.test(line)]
        if self.has("return"):
            value = [] if self.now.text == ";" else [self.expression()]
            self.need(";")
            return [("leave", line, value, False)]
        return self.simple(line)

    def test(self, line: Any) -> tuple:
        of, cases = self.expression(), []
        self.block("case", "default", "endtest")
        while self.ended != "endtest":
            values = []
            if self.ended == "case":
                values.append(self.expression())
                while self.has(","):
                    values.append(self.expression())
            self.need(":")
            cases.append((values, self.block("case", "default", "endtest")))
        return ("switch", line, of, cases)

    def declaration(self) -> list:
        while self.now.text in ("const", "pers", "var", "local", "task"):
            self.next()
        kind = self.next().text
        name, line = self.now.text, self.now.line
        self.next()
        value: tuple = ("value", DEFAULTS.get(kind, 0.0))
        if self.has("{"):
            sizes = self.list("}")
            value = ("list", [value] * int(sizes[0][1]))
        if self.has(":="):
            value = self.expression()
        self.need(";")
        return [("declare", line, name, value)]

    def simple(self, line: Any) -> list:
        at = self.at
        left = self.unary()
        if self.has(":="):
            value = self.expression()
            self.need(";")
            return [("assign", line, left, value)]
        self.at = at
        name = self.next().text
        if name in ("connect", "idisable", "ienable"):
            while not self.has(";"):
                self.next()
            return []
        return [("do", line, name, *self.arguments(";"))]


class Controller(Machine):
    """Runs `main`, or the instructions outside any routine."""

    def __init__(self) -> None:
        super().__init__()
        self.displaced = (np.eye(4), frozenset())
        self.parts = PARTS
        self.set("tool0", [True, AT_ZERO, [0.0, [0.0] * 3]], frozenset())
        self.set("wobj0", [False, True, "", AT_ZERO, AT_ZERO], frozenset())

    def load(self, text: str, file: str = "") -> list:
        parser = Rapid([t for t in tokens(text, "!", True, file) if t.kind != "end"])
        data, routines = parser.module()
        self.parts = {**self.parts, **parser.parts}
        self.functions |= routines
        self.run([s for s in data if s[0] == "declare"])
        return [s for s in data if s[0] != "declare"]

    def key(self, of: Any, name: str) -> Any:
        return self.parts[name]

    def part(self, of: Any, name: str) -> Any:
        return of[self.parts[name]]

    def combine(self, op: str, a: Any, b: Any) -> Any:
        if isinstance(a, list) or isinstance(b, list):
            return list(np.add(a, b) if op == "+" else np.subtract(a, b) if op == "-" else np.multiply(a, b))
        return super().combine(op, a, b)

    def unknown(self, name: str, line: Any) -> Any:
        if name in ("true", "false"):
            return name == "true"
        return super().unknown(name, line)

    def function(self, name: str, args: list, options: dict, line: Any) -> Any:
        if name == "crobt":
            self.touched |= {"here"}
            last = self.motions[-1]
            return self.robtarget(last.target if not last.joints else np.eye(4))
        if name == "cjointt":
            self.touched |= {"here"}
            return [[0.0] * 6, NOTHING]
        given = [self.value(a) for a in args]
        if name in ("offs", "reltool"):
            self.touched |= {"shifted"}
            p, by = given[0], shift(*(np.array(given[1:4]) / 1e3))
            at = from_quaternion(p[0], p[1])
            for k, axis in enumerate(("rx", "ry", "rz")):
                if name == "reltool" and axis in options:
                    by = by @ turn(k, np.radians(self.value(options[axis])))
            moved = at @ by if name == "reltool" else by @ at
            return [*self.robtarget(moved)[:2], *p[2:]]
        if name == "posemult":
            return self.robtarget(from_quaternion(*given[0]) @ from_quaternion(*given[1]))[:2]
        if name == "eulerzyx":
            return dict(zip("zyx", angles(from_quaternion([0.0] * 3, given[0])), strict=True))[next(iter(options))]
        if name == "orientzyx":
            a, b, c = np.radians(given)
            return list(quaternion(turn(2, a) @ turn(1, b) @ turn(0, c)))
        return super().function(name, args, options, line)

    @staticmethod
    def robtarget(at: np.ndarray) -> list:
        return [list(at[:3, 3] * 1e3), list(quaternion(at)), [0.0] * 4, NOTHING]

    def instruct(self, s: tuple) -> None:
        _, line, name, args, options = s
        if name in TO and name not in self.functions:
            for k in TO[name][0]:
                self.move(line, args[k], args[TO[name][1]], options)
            if name.startswith("search"):
                self.place(args[1], self.robtarget(self.motions[-1].target), frozenset({"here"}))
        elif name == "pdispset":
            frame, because = self.fresh(args[0])
            self.displaced = (from_quaternion(frame[0], frame[1]), because | {line})
        elif name == "pdispoff":
            self.displaced = (np.eye(4), frozenset())
        elif name in self.functions:
            self.call(name, args, options, line)

    def move(self, line: Any, to: tuple, tool: tuple, options: dict) -> None:
        target, because = self.fresh(to)
        (_, tframe, (mass, cog, *_)), of_tool = self.fresh(tool)
        wobj, of_object = self.fresh(options.get("wobj", ("name", "wobj0", line)))
        frame = from_quaternion(*wobj[3]) @ from_quaternion(*wobj[4])
        held = Tool(from_quaternion(*tframe), mass, np.array(cog) / 1e3)
        self.moved(line, because | of_tool | of_object, target, held, frame)

    def moved(self, line: Any, because: frozenset, target: list, tool: Tool, frame: np.ndarray) -> None:
        external = any(abs(e) < 9e8 and e != 0 for e in target[-1])
        joints = len(target) == 2
        displacement, of_it = self.displaced
        if not joints:
            frame, because = frame @ displacement, because | of_it
        at = np.radians(target[0]) if joints else from_quaternion(target[0], target[1])
        configuration = None if joints else tuple(int(c) for c in target[2])
        self.motions.append(Motion(line, because | {line}, at, joints, tool, frame, configuration, external))


def run(text: str, elsewhere: str = "", **_: str) -> list[Motion]:
    """The motions of a program; `elsewhere` are the controller's other modules."""
    controller = Controller()
    if elsewhere:
        controller.load(elsewhere, "elsewhere")
    body = controller.load(text)
    try:
        controller.run(controller.functions["main"].body if "main" in controller.functions else body)
    except Leave:
        pass
    return controller.motions
