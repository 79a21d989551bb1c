"""Universal Robots script, as a controller runs it: poses, joint lists, `get_inverse_kin`, `pose_trans`; no threads."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .arm import Tool, rodrigues, vector
from .language import Function, Leave, Machine, Motion, Parser, tokens

IGNORED = (
    "set_payload", "set_payload_mass", "set_payload_cog", "sleep", "sync", "textmsg", "popup", "set_digital_out",
    "set_standard_digital_out", "set_tool_digital_out", "set_gravity", "stopl", "stopj", "freedrive_mode",
    "set_analog_out", "end_freedrive_mode", "force_mode", "end_force_mode", "enter_critical", "exit_critical",
    "modbus_add_signal", "halt", "set_target_payload", "zero_ftsensor", "rtde_set_watchdog",
)  # fmt: skip
MOTIONS = ("movej", "movel", "movep", "movec", "servoj", "servoc", "optimovej", "optimovel")


class Pose(list):
    """Six numbers in m and rad."""

    @property
    def at(self) -> np.ndarray:
        return rodrigues(*self)


def pose(t: np.ndarray) -> Pose:
    return Pose([*t[:3, 3], *vector(t)])


class Joints(list):
    """What `get_inverse_kin` says: the joints of a pose, which the controller computes itself, near `qnear`."""

    near: Any = None


class Script(Parser):
    """Functions with `def ... end`, instructions outside too."""

    def primary(self) -> tuple:
        if self.now.text == "p" and self.words[self.at + 1].text == "[":
            self.next()
            self.next()
            return ("call", "p[]", self.list("]"), {}, self.now.line)
        return super().primary()

    def arguments(self, close: str) -> tuple[list, dict]:
        args, options = [], {}
        while not self.has(close):
            if self.now.kind == "name" and self.words[self.at + 1].text == "=":
                name = self.next().text
                self.next()
                options[name] = self.expression()
            else:
                args.append(self.expression())
            self.has(",")
            while self.now.kind == "end":
                self.next()
        return args, options

    def file(self) -> tuple[list, dict[str, Function]]:
        self.functions: dict[str, Function] = {}
        body: list = []
        while self.now.kind != "eof":
            body += self.statement()
        return body, self.functions

    def statement(self) -> list:
        word = self.now
        line = word.line
        if self.next().kind == "end":
            return []
        if word.text in ("def", "thread", "sec"):
            name = self.next().text
            parameters = [p[1] for p in self.list(")")] if self.has("(") else []
            self.need(":")
            self.functions[name] = Function(parameters, self.block("end"))
            return []
        if word.text == "if":
            branches = [self.branch()]
            while self.ended != "end":
                branches.append(self.branch(self.ended == "elif"))
            return [("if", line, branches)]
        if word.text == "while":
            condition = self.expression()
            self.need(":")
            return [("while", line, condition, self.block("end"))]
        if word.text in ("return", "break", "halt"):
            value = [] if self.now.kind == "end" else [self.expression()]
            return [("leave", line, value, word.text == "break")]
        if word.text in ("global", "local"):
            return self.statement()
        if word.text in ("run", "kill", "join"):
            self.expression()
            return []
        if word.text == "$":  # a node of PolyScope's tree
            while self.now.kind != "end":
                self.next()
            return []
        self.at -= 1
        left = self.unary()
        if self.has("="):
            return [("assign", line, left, self.expression())]
        return [("do", line, left)]

    def branch(self, has_condition: bool = True) -> tuple:
        condition = self.expression() if has_condition else ("value", True)
        self.need(":")
        return condition, self.block("elif", "else", "end")


class Controller(Machine):
    """The tool is the flange until `set_tcp`."""

    base = 0

    def __init__(self) -> None:
        super().__init__()
        self.tool = (Tool(np.eye(4)), frozenset())
        self.set("pi", math.pi, frozenset())
        self.set("True", True, frozenset())
        self.set("False", False, frozenset())

    def load(self, text: str, file: str = "") -> list:
        body, functions = Script(tokens(text, "#", False, file)).file()
        self.functions |= functions
        return body

    def combine(self, op: str, a: Any, b: Any) -> Any:
        if isinstance(a, list) and isinstance(b, (int, float)):
            return type(a)(x * b for x in a)
        if isinstance(a, list) and op == "+":
            return type(a)(x + y for x, y in zip(a, b, strict=True))
        return super().combine(op, a, b)

    def function(self, name: str, args: list, options: dict, line: Any) -> Any:
        given = [self.value(a) for a in args]
        if name == "p[]":
            return Pose(given)
        if name == "get_inverse_kin":
            joints = Joints(given[0])
            near = options.get("qnear", args[1] if len(args) > 1 else None)
            joints.near = None if near is None else np.array(self.value(near), float)
            return joints
        if name in ("get_actual_tcp_pose", "get_target_tcp_pose"):
            self.touched |= {"here"}
            last = self.motions[-1]
            return pose(np.eye(4) if last.joints else last.target)
        if name in ("get_actual_joint_positions", "get_target_joint_positions"):
            self.touched |= {"here"}
            return [0.0] * 6
        if name == "pose_trans":
            self.touched |= {"shifted"}
            return pose(given[0].at @ given[1].at)
        if name == "pose_inv":
            return pose(np.linalg.inv(given[0].at))
        if name in ("pose_add", "interpolate_pose"):
            self.touched |= {"shifted"}
            if name == "interpolate_pose":
                return Pose(a + (b - a) * given[2] for a, b in zip(given[0], given[1], strict=True))
            out = given[0].at.copy()
            out[:3, 3] += given[1][:3]
            out[:3, :3] = given[0].at[:3, :3] @ given[1].at[:3, :3]
            return pose(out)
        return super().function(name, args, options, line)

    def instruct(self, s: tuple) -> None:
        _, line, call = s
        assert call[0] == "call", f"line {line}: an instruction expected"
        _, name, args, options, _ = call
        if name == "set_tcp":
            value, because = self.fresh(args[0])
            self.tool = (Tool(value.at), because | {line})
        elif name in MOTIONS and name not in self.functions:
            for to in args[: 2 if name in ("movec", "servoc") else 1]:
                self.move(line, to)
        elif name not in IGNORED:
            self.call(name, args, options, line)

    def move(self, line: Any, to: tuple) -> None:
        target, because = self.fresh(to)
        tool, of_tool = self.tool
        joints = not isinstance(target, (Pose, Joints))
        at = np.array(target, float) if joints else Pose(target).at
        near = getattr(target, "near", None)
        self.motions.append(Motion(line, because | of_tool | {line}, at, joints, tool, np.eye(4), near))


def run(text: str, elsewhere: str = "", **_: str) -> list[Motion]:
    """The motions of a script: of the function that it defines first, where it calls nothing itself."""
    controller = Controller()
    if elsewhere:
        controller.run(controller.load(elsewhere, "elsewhere"))
    known = set(controller.functions)
    body = controller.load(text)
    own = [name for name in controller.functions if name not in known]
    try:
        controller.run(body)
        if own and not controller.motions:
            controller.call(own[0], [], {}, 0)
    except Leave:
        pass
    return controller.motions
