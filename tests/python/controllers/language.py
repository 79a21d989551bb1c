"""What the languages have in common: tokens, expressions, variables, control flow.

Every variable remembers the lines that its value comes from, so that a motion can say on which lines of the program its
target depends; words among these lines say how: `shifted` (relative to another target), `here` (from where the arm is).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .arm import Tool

TOKEN = re.compile(
    r'(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-z_$][\w$]*)|(?P<string>"[^"]*")'
    r"|(?P<op>:=|==|<>|<=|>=|!=|[-+*/%<>=(){}\[\],.:;\\#^'@?])|(?P<end>\n)|(?P<space>[ \t\r]+)"
)
PASSES = 3  # a loop that waits for something is left after so many
STEPS = 20_000


@dataclass
class Token:
    """A word of the program and its line."""

    kind: str
    text: str
    line: Any


@dataclass
class Motion:
    """Where a motion sends the tool: a transform in the frame, or joints (rad). `because`: lines and words."""

    line: Any
    because: frozenset
    target: np.ndarray
    joints: bool
    tool: Tool
    frame: np.ndarray
    configuration: Any = None
    external: bool = False


@dataclass
class Variable:
    """A value and the lines it comes from."""

    value: Any
    because: frozenset = frozenset()


@dataclass
class Function:
    """A routine of the program."""

    parameters: list[str]
    body: list
    by_reference: frozenset[str] = frozenset()


class Leave(Exception):
    """Leaves a routine (with a value) or, with `loop`, a loop."""

    def __init__(self, value: Any = None, loop: bool = False) -> None:
        super().__init__()
        self.value, self.loop = value, loop


def tokens(text: str, comment: str, fold: bool, file: str = "") -> list[Token]:
    """The words of a text; `fold`: upper and lower case are the same. Lines of other files have the file's name."""
    out = []
    for number, line in enumerate(text.split("\n"), 1):
        where = (file, number) if file else number
        at = 0
        line += "\n"
        while at < len(line):
            if line.startswith(comment, at):
                at = len(line) - 1
            m = TOKEN.match(line, at)
            assert m, f"line {number}: {line[at:]!r}"
            at = m.end()
            if m.lastgroup != "space":
                word = m.group()
                out.append(Token(m.lastgroup or "", word.lower() if fold and m.lastgroup == "name" else word, where))
    return [*out, Token("end", "\n", None), Token("eof", "", None)]


OPERATORS: dict[str, tuple[int, Callable[[Any, Any], Any]]] = {
    "or": (1, lambda a, b: bool(a or b)),
    "and": (2, lambda a, b: bool(a and b)),
    **{o: (3, lambda a, b: a == b) for o in ("=", "==")},
    **{o: (3, lambda a, b: a != b) for o in ("<>", "!=")},
    "<": (3, lambda a, b: a < b),
    ">": (3, lambda a, b: a > b),
    "<=": (3, lambda a, b: a <= b),
    ">=": (3, lambda a, b: a >= b),
    "+": (4, lambda a, b: a + b),
    "-": (4, lambda a, b: a - b),
    "*": (5, lambda a, b: a * b),
    "/": (5, lambda a, b: a / b),
    "div": (5, lambda a, b: a // b),
    "mod": (5, lambda a, b: a % b),
    "%": (5, lambda a, b: a % b),
}
MATH = {
    "sqrt": math.sqrt, "abs": abs, "round": round, "floor": math.floor, "trunc": math.trunc, "d2r": math.radians,
    "r2d": math.degrees, "integer_to_string": str, "to_str": str, "valtostr": str,
}  # fmt: skip


class Parser:
    """Recursive descent over tokens; expressions become tuples whose first entry says what they are."""

    operators = OPERATORS

    def __init__(self, words: list[Token]) -> None:
        self.words, self.at = words, 0

    @property
    def now(self) -> Token:
        return self.words[self.at]

    def next(self) -> Token:
        self.at += 1
        return self.words[self.at - 1]

    def has(self, *texts: str) -> bool:
        if self.now.text in texts and self.now.kind != "string":
            self.at += 1
            return True
        return False

    def need(self, text: str) -> None:
        assert self.has(text), f"line {self.now.line}: {text!r} expected, {self.now.text!r} found"

    def list(self, close: str) -> list:
        out: list = []
        while not self.has(close):
            out.append(self.expression())
            self.has(",")
        return out

    def expression(self, least: int = 1) -> tuple:
        left = self.unary()
        while (op := self.now.text) in self.operators and self.operators[op][0] >= least:
            self.next()
            left = ("op", op, left, self.expression(self.operators[op][0] + 1))
        return left

    def unary(self) -> tuple:
        if self.has("-"):
            return ("minus", self.unary())
        if self.has("+"):
            return self.unary()
        if self.has("not"):
            return ("not", self.expression(3))
        return self.behind(self.primary())

    def primary(self) -> tuple:
        word = self.next()
        if word.kind == "number":
            return ("value", float(word.text))
        if word.kind == "string":
            return ("value", word.text[1:-1])
        if word.text == "(":
            inside = self.expression()
            self.need(")")
            return inside
        if word.text == "[":
            return ("list", self.list("]"))
        assert word.kind == "name", f"line {word.line}: a value expected, {word.text!r} found"
        if word.text in ("true", "false"):
            return ("value", word.text == "true")
        return ("name", word.text, word.line)

    def behind(self, left: tuple) -> tuple:
        """What stands behind a value: calls, indices, components."""
        while True:
            if self.now.text == "(" and left[0] == "name":
                self.next()
                left = ("call", left[1], *self.arguments(")"), left[2])
            elif self.index_opens():
                self.next()
                left = ("index", left, self.list("]" if self.words[self.at - 1].text == "[" else "}"))
            elif self.now.text == "." and self.words[self.at + 1].kind == "name":
                self.next()
                left = ("part", left, self.next().text)
            else:
                return left

    def block(self, *ends: str) -> list:
        """Statements up to one of these words; `ended` is which."""
        out: list = []
        while self.now.text not in ends:
            assert self.now.kind != "eof", f"{ends} is missing"
            out += self.statement()
        self.ended = self.next().text
        return out

    def statement(self) -> list:
        """One statement of the language: none, several, or what it is made of."""
        raise NotImplementedError

    def index_opens(self) -> bool:
        return self.now.text == "["

    def arguments(self, close: str) -> tuple[list, dict]:
        args: list = []
        while not self.has(close):
            args.append(self.expression())
            self.has(",")
        return args, {}


@dataclass
class Machine:
    """Runs a program; a language adds its functions (`function`) and its instructions (`instruct`)."""

    scopes: list[dict[str, Variable]] = field(default_factory=lambda: [{}])
    functions: dict[str, Function] = field(default_factory=dict)
    motions: list[Motion] = field(default_factory=list)
    touched: set = field(default_factory=set)
    steps: int = 0

    def variable(self, name: str) -> Variable | None:
        return self.scopes[-1].get(name) or self.scopes[0].get(name)

    def set(self, name: str, value: Any, because: frozenset, local: bool = False) -> None:
        scope = self.scopes[-1] if local or name in self.scopes[-1] else self.scopes[0]
        scope[name] = Variable(deepcopy(value), because)

    def fresh(self, expression: tuple) -> tuple[Any, frozenset]:
        """A value, and what it comes from alone."""
        kept, self.touched = self.touched, set()
        value = self.value(expression)
        because, self.touched = frozenset(self.touched), kept
        return value, because

    def value(self, e: tuple) -> Any:
        kind = e[0]
        if kind == "value":
            return e[1]
        if kind == "name":
            found = self.variable(e[1])
            if found is None:
                return self.unknown(e[1], e[2])
            self.touched |= found.because
            return found.value
        if kind == "list":
            return [self.value(x) for x in e[1]]
        if kind == "record":
            return {name: self.value(x) for name, x in e[1].items()}
        if kind == "minus":
            return -self.value(e[1])
        if kind == "not":
            return not self.value(e[1])
        if kind == "op":
            return self.combine(e[1], self.value(e[2]), self.value(e[3]))
        if kind == "index":
            out = self.value(e[1])
            for i in e[2]:
                out = self.element(out, self.value(i))
            return out
        if kind == "part":
            return self.part(self.value(e[1]), e[2])
        if kind == "call":
            return self.call(e[1], e[2], e[3], e[4])
        raise AssertionError(e)

    base = 1  # of indices

    def element(self, of: Any, at: float) -> Any:
        return of[int(at) - self.base]

    def part(self, of: Any, name: str) -> Any:
        return of[name]

    def combine(self, op: str, a: Any, b: Any) -> Any:
        return OPERATORS[op][1](a, b)

    def unknown(self, name: str, line: Any) -> Any:
        raise AssertionError(f"line {line}: {name!r} is not declared here nor elsewhere")

    def function(self, name: str, args: list, options: dict, line: Any) -> Any:
        raise AssertionError(f"line {line}: the function {name!r} is not declared here nor elsewhere")

    def call(self, name: str, args: list, options: dict, line: Any) -> Any:
        if name in self.functions:
            routine = self.functions[name]
            given = [self.fresh(a) for a in args]
            scope = {p: Variable(deepcopy(v), b) for p, (v, b) in zip(routine.parameters, given, strict=False)}
            self.scopes.append(scope)
            try:
                self.run(routine.body)
            except Leave as leave:
                return leave.value
            finally:
                self.scopes.pop()
                for p, a in zip(routine.parameters, args, strict=False):
                    if p in routine.by_reference and a[0] in ("name", "index", "part"):
                        self.place(a, scope[p].value, scope[p].because | {line})
            return None
        if name in MATH:
            return MATH[name](*[self.value(a) for a in args])
        return self.function(name, args, options, line)

    def place(self, e: tuple, value: Any, because: frozenset) -> None:
        """Assigns; a part of a variable keeps what the rest comes from."""
        if e[0] == "name":
            self.set(e[1], value, because)
            return
        path: list = []
        while e[0] != "name":
            path.append(e)
            e = e[1]
        found = self.variable(e[1])
        assert found is not None, e
        self.touched = set()
        of = found.value
        for step in reversed(path[1:]):
            of = self.part(of, step[2]) if step[0] == "part" else self.element(of, self.value(step[2][0]))
        last = path[0]
        key = self.key(of, last[2]) if last[0] == "part" else int(self.value(last[2][0])) - self.base
        of[key] = deepcopy(value)
        found.because |= because

    def key(self, of: Any, name: str) -> Any:
        return name

    def run(self, body: list) -> None:
        for s in body:
            self.steps += 1
            assert self.steps < STEPS, "the program does not end"
            self.step(s)

    def step(self, s: tuple) -> None:
        kind, line = s[0], s[1]
        self.touched = set()
        if kind == "assign":
            value, because = self.fresh(s[3])
            self.place(s[2], value, because | {line})
        elif kind == "declare":
            value, because = self.fresh(s[3])
            self.set(s[2], value, because | {line}, local=len(self.scopes) > 1)
        elif kind == "if":
            for condition, body in s[2]:
                if self.value(condition):
                    self.run(body)
                    break
        elif kind == "while":
            self.loop(s[2], s[3])
        elif kind == "for":
            self.count(s)
        elif kind == "switch":
            of = self.value(s[2])
            for cases, body in s[3]:
                if not cases or any(self.value(c) == of for c in cases):
                    self.run(body)
                    break
        elif kind == "leave":
            raise Leave(*(self.value(x) for x in s[2]), loop=s[3])
        else:
            self.instruct(s)

    def loop(self, condition: tuple, body: list) -> None:
        for _ in range(PASSES):
            if not self.value(condition):
                return
            try:
                self.run(body)
            except Leave as leave:
                if leave.loop:
                    return
                raise

    def count(self, s: tuple) -> None:
        _, line, name, first, last, by, body = s
        at, end, by = self.value(first), self.value(last), self.value(by)
        while (at <= end) if by > 0 else (at >= end):
            self.set(name, at, frozenset({line}), local=len(self.scopes) > 1)
            self.run(body)
            at += by

    def instruct(self, s: tuple) -> None:
        raise AssertionError(s)
