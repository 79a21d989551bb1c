"""Programs after the shapes that are found in the field, one construction each, driven on controllers of our own.

Each motion of the program before says where the tool is meant to be. The rewritten program is driven on the same
controller, which thinks that its arm is the nominal one; the joints to which it goes put the tool of the real arm
somewhere. That has to be the place that was meant, to 1 um, or the motion is listed with its line.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest

from controllers import fanuc, krl, rapid, urscript
from controllers.arm import ROOT, Arm, Tool, angles, quaternion, shift, turn, vector, zyx
from controllers.language import Motion
from terms import compliance, link, term

trical = pytest.importorskip("trical")

BASE = zyx(150, -330, -150, 90, 0, 0)
FRAMES = {"device": zyx(18, -12, 118, 0, 0, 0), "gripper": zyx(-20, 5, 140, 30, 20, -10)}
FRAMES["table"] = zyx(250, -100, 50, 20, 5, -3)
CELL = """
[base]
xyz_mm = [150.0, -330.0, -150.0]
zyx_deg = [90.0, 0.0, 0.0]
[tool]
tcp_mm = [18.0, -12.0, 118.0]
mass_kg = 1.7
cog_mm = [5.0, -4.0, 55.0]
"""
POSES = np.array([[10, 12, -8, 20, 40, -30], [-25, 20, 5, -15, 35, 60], [30, 5, 12, 40, 55, 10]])
SAME = 1e-6  # m


class Language(NamedTuple):
    """Its controller, its files' ending, the robot, the joints that its poses are told from, where its world is."""

    controller: ModuleType
    ending: str
    robot: str
    zero: list[float]
    world: np.ndarray = np.eye(4)


LANGUAGES = {
    "rapid": Language(rapid, "mod", "cells/irb120/robot.toml", [0, 0, 0, 0, 0, 0]),
    "krl": Language(krl, "src", "robots/kr6_r700.toml", [0, -90, 90, 0, 0, 0]),
    "fanuc": Language(fanuc, "ls", "robots/lrmate_200id.toml", [0, 0, 0, 0, -90, 0], shift(0, 0, 0.33)),
    "urscript": Language(urscript, "script", "robots/ur5e.toml", [0, -90, 70, -60, 20, 0]),
}


def corpus() -> list[Any]:
    """Name, language, and the parts of each program: its text, and what else the controller holds."""
    out = []
    for name in LANGUAGES:
        text = (ROOT / "tests" / "programs" / f"{name}.txt").read_text()
        for case in re.split(r"^=== ", text, flags=re.M)[1:]:
            head, _, body = case.partition("\n")
            title, _, counts = head.partition(" | ")
            pieces = re.split(r"^--- (\w+)\n", body, flags=re.M)
            parts = {"text": pieces[0], **dict(zip(pieces[1::2], pieces[2::2], strict=True))}
            out.append(pytest.param(name, counts, parts, id=f"{name}, {title}"))
    return out


def written(language: str, t: np.ndarray) -> tuple[str, list[str], str]:
    """A transform as a language writes it: whole, its three coordinates, its orientation."""
    if language == "urscript":
        x = [f"{v:.9f}" for v in t[:3, 3]]
        r = ",".join(f"{v:.9f}" for v in vector(t))
        return f"{','.join(x)},{r}", x, r
    x = [f"{v * 1e3:.5f}" for v in t[:3, 3]]
    a, b, c = (f"{v:.7f}" for v in angles(t))
    if language == "krl":
        return f"X {x[0]},Y {x[1]},Z {x[2]},A {a},B {b},C {c}", x, f"A {a},B {b},C {c}"
    if language == "fanuc":
        return f"X = {x[0]} mm, Y = {x[1]} mm, Z = {x[2]} mm,\n\tW = {c} deg, P = {b} deg, R = {a} deg", x, ""
    q = ",".join(f"{v:.9f}" for v in quaternion(t))
    return f"[{','.join(x)}],[{q}]", x, q


def filled(language: str, text: str) -> str:
    """`@0` is the first pose with the device in the base, `g` with the gripper, `f` at the flange, `t` on the table."""
    own = LANGUAGES[language]
    arm = Arm.read(own.robot)

    def place(m: re.Match[str]) -> str:
        what, k, how = m.groups()
        if what in FRAMES:
            at = FRAMES[what]
            if language == "fanuc" and what == "table":
                at = np.linalg.inv(own.world) @ at
            return (
                " ".join(map(str, [*(at[:3, 3] * 1e3), *angles(at)]))
                if language == "fanuc"
                else written(language, at)[0]
            )
        q = np.radians(POSES[int(k)] + own.zero)
        tool = np.eye(4) if "f" in how else FRAMES["gripper" if "g" in how else "device"]
        frame = FRAMES["table"] if "t" in how else own.world
        at = np.linalg.inv(frame) @ arm.hand(q) @ tool
        whole, x, r = written(language, at)
        conf = f"[{','.join(str(int(np.floor(np.degrees(q[j]) / 90))) for j in (0, 3, 5))},0]"
        if what in tuple("XYZ"):
            return x["XYZ".index(what)]
        if language == "rapid" and what == "":
            return f"[{whole},{conf},[9E9,9E9,9E9,9E9,9E9,9E9]]"
        turns = str(sum(1 << j for j in range(6) if q[j] < 0))
        return {"R": r, "C": conf, "T": turns, "j": ",".join(f"{v:.9f}" for v in q), "": whole}[what]

    return re.sub(r"@(device|gripper|table|[XYZRCTj]?)(?:(\d)([gtf]*))?", place, text)


def real(language: str) -> tuple[Arm, np.ndarray, str]:
    """The arm as it is, its base in the world, and the same as terms of a model."""
    own = LANGUAGES[language]
    nominal = Arm.read(own.robot)
    rows, soft = nominal.rows.copy(), np.zeros(6)
    rows[2, 1] += 0.4e-3
    rows[3, 2] -= 0.3e-3
    rows[1, 0] += 0.6e-3
    rows[2, 3] += 2e-3
    rows[4, 3] -= 1e-3
    deg = float(np.degrees(1))
    terms = [
        term("a_2", "geometry", 0.4, "mm", link(2, "a")),
        term("d_4", "geometry", -0.3, "mm", link(4, "d")),
        term("alpha_1", "geometry", 0.6e-3 * deg, "deg", link(1, "alpha")),
        term("theta_3", "geometry", 2e-3 * deg, "deg", link(3, "theta")),
        term("theta_5", "geometry", -1e-3 * deg, "deg", link(5, "theta")),
        term("base_z", "geometry", 1.0, "mm", '{ base = { along = "z" } }'),
    ]
    if nominal.mass.all():
        soft[1:3] = 2e-5, 3e-5
        terms += [compliance(2, 2e-5 * deg), compliance(3, 3e-5 * deg)]
    return replace(nominal, rows=rows, compliance=soft), BASE @ shift(0, 0, 1e-3), "".join(terms)


def load(tool: Tool) -> Tool:
    """The cell's own tool weighs what the cell says; others what the program says."""
    if np.abs(tool.at - FRAMES["device"]).max() < 1e-5:
        return Tool(tool.at, 1.7, np.array([5.0, -4.0, 55.0]) / 1e3)
    return tool


def joints(arm: Arm, motion: Motion, world: np.ndarray, seeds: list[np.ndarray]) -> np.ndarray | None:
    """Where the controller's arm goes, from the first seed that gets there."""
    if motion.joints:
        return motion.target
    hand = world @ motion.frame @ motion.target @ np.linalg.inv(motion.tool.at)
    for seed in seeds:
        q = arm.solve(hand, seed)
        if q is not None and np.abs(q - seed).max() < 1.0:
            return q
    return None


def fits(language: str, configuration: Any, q: np.ndarray) -> bool:
    """Whether the text's quadrants (ABB) or signs (KUKA) are those of the joints."""
    if language == "rapid" and configuration is not None:
        return all(
            90 * c - 0.1 <= np.degrees(q[j]) <= 90 * (c + 1) + 0.1
            for j, c in zip((0, 3, 5), configuration, strict=False)
        )
    if language == "krl" and configuration is not None and configuration[1] is not None:
        return all(abs(q[j]) < 2e-3 or (q[j] < 0) == bool(int(configuration[1]) >> j & 1) for j in range(6))
    return True


def judged(
    language: str, before: list[Motion], after: list[Motion], listed: set, relative: dict[int, float | None]
) -> list[str]:
    """Of each motion `right`, `listed`, `relative` (to a target, as told, or to where the arm is), or what is wrong."""
    own = LANGUAGES[language]
    nominal, (arm, base, _) = Arm.read(own.robot), real(language)
    taught = [np.radians(p + own.zero) for p in POSES]
    out, last = [], taught[0]
    for was, now in zip(before, after, strict=True):
        because = {line[1] if isinstance(line, tuple) and line[0] == "dat" else line for line in was.because}
        if listed & because or was.external:
            out.append("listed" if listed & because else f"line {was.line}: an external axis, and not listed")
            continue
        if "here" in because:
            out.append("relative")
            continue
        near = last if was.configuration is None or language != "urscript" else was.configuration
        by_nearness = language == "urscript" or "shifted" in because
        seeds = sorted([*taught, near], key=lambda s: float(np.abs(s - near).max()) if by_nearness else 0)
        q = joints(nominal, was, own.world, seeds)
        new = None if q is None else joints(nominal, now, own.world, [q])
        if q is None or new is None:
            out.append(f"line {was.line}: the controller finds no joints")
            continue
        last = q
        hand = own.world @ was.frame @ was.target if not was.joints else nominal.hand(q) @ was.tool.at
        wanted, reached = BASE @ hand, base @ arm.reached(new, load(was.tool))
        off = float(np.linalg.norm(reached[:3, 3] - wanted[:3, 3]))
        turned = float(np.linalg.norm(vector(np.linalg.inv(wanted) @ reached)))
        untouched = float(np.linalg.norm((base @ arm.reached(q, load(was.tool)))[:3, 3] - wanted[:3, 3]))
        if not fits(language, now.configuration, new):
            out.append(
                f"line {was.line}: the configuration {now.configuration} is not that of {np.degrees(new).round(2)}"
            )
        elif off < SAME and turned < 5e-6:
            out.append("right")
        elif told := [relative[line] for line in because if line in relative]:
            # by what the text says, and then as far off as it was told, or by what only the running program knows
            known = [t for t in told if t is not None]
            near = not known or any(abs(t - off * 1e3) < 2e-3 for t in known)
            out.append("relative" if near else f"line {was.line}: {off * 1e3:.4f} mm off, and {known} told")
        else:
            out.append(
                f"line {was.line}: {off * 1e3:.4f} mm and {turned:.1e} rad off ({untouched * 1e3:.3f} mm before)"
            )
    return out


def compensated(language: str, parts: dict[str, str], folder: Path) -> tuple[dict[str, Any], str, str]:
    """What is said of a program, and its text and its data afterwards."""
    own = LANGUAGES[language]
    program, new = folder / f"p.{own.ending}", folder / f"new.{own.ending}"
    program.write_text(parts["text"])
    (folder / "cell.toml").write_text(CELL)
    files = {"robot": ROOT / own.robot, "cell": folder / "cell.toml"}
    options: dict[str, Any] = {}
    if "dat" in parts:
        program.with_suffix(".dat").write_text(parts["dat"])
    if "config" in parts:
        (folder / "$config.dat").write_text(parts["config"])
    if language == "krl":  # each routine is a file of its own
        for name, routine in re.findall(r"(?ms)^DEF (\w+)(.*?^END$)", parts.get("elsewhere", "")):
            (folder / f"{name}.src").write_text(f"DEF {name}{routine}\n")
    if "beside" in parts:  # a module of the same folder
        (folder / "beside.mod").write_text(parts["beside"])
    if "frames" in parts:
        options["frames"] = folder / "frames.mod"
        options["frames"].write_text(parts["frames"])
    if language == "fanuc":
        options["frames"] = folder / "frames.toml"
        text = ""
        for kind, number, values in re.findall(r"(tool|frame)\[(\d+)\] = (.*)", parts["elsewhere"]):
            x, y, z, a, b, c = values.split()
            text += f"[{kind}s.{number}]\nxyz_mm = [{x}, {y}, {z}]\nzyx_deg = [{a}, {b}, {c}]\n"
        options["frames"].write_text(text)
    model = trical.Model.nominal(**files).with_terms(real(language)[2])
    done = trical.compensate(program, model, new, **files, **options, partial=True)
    dat = new.with_suffix(".dat").read_text() if "dat" in parts else ""
    return done, new.read_text().replace("\r\n", "\n"), dat


def check(language: str, counts: str, parts: dict[str, str], folder: Path) -> None:
    own = LANGUAGES[language]
    done, text, dat = compensated(language, parts, folder)
    listed = {int(m) for p in done["problems"] for m in re.findall(r"line (\d+)", p.partition(": ")[0])}
    homes = [c for c in done.get("cautions", []) if c.startswith("goes to a home")]
    listed |= {int(m) for c in homes for m in re.findall(r"line (\d+)", c)}
    elsewhere = "".join(parts.get(k, "") for k in ("elsewhere", "hidden", "frames", "beside"))
    more = {"elsewhere": elsewhere, "config": parts.get("config", "")}
    before = own.controller.run(parts["text"], dat=parts.get("dat", ""), **more)
    after = own.controller.run(text, dat=dat, **more)
    relative = {r["line"]: r["after_mm"] for r in done["relative"]}
    found = judged(language, before, after, listed, relative)
    wrong = [f for f in found if f not in ("right", "listed", "relative")]
    assert not wrong, (wrong, done["problems"])
    has = f"{found.count('right')} right, {found.count('listed')} listed, {found.count('relative')} relative"
    assert has == counts, (done["problems"], found)


@pytest.mark.parametrize(("language", "counts", "parts"), corpus())
def test_each_motion_ends_where_it_was_meant_or_is_listed(
    language: str, counts: str, parts: dict[str, str], tmp_path: Path
) -> None:
    check(language, counts, {name: filled(language, text) for name, text in parts.items()}, tmp_path)


def calculated(text: str) -> str:
    """With coordinates as sums, a minus before a bracket."""
    number = r"(?<![\w.$])(-?)(\d+\.\d{3,})(?![\w.])"
    whole = re.compile(r"\s*([;&!#]|(CONST|PERS|VAR) (pos|orient)\b)")
    lines = [line if whole.match(line) else re.sub(number, r"\1(\2+0)", line) for line in text.split("\n")]
    return "\n".join(lines)


@pytest.mark.parametrize(("language", "counts", "parts"), [c for c in corpus() if c.values[0] != "fanuc"])
def test_numbers_may_be_calculated(language: str, counts: str, parts: dict[str, str], tmp_path: Path) -> None:
    parts = {name: filled(language, text) for name, text in parts.items()}
    check(language, counts, parts | {"text": calculated(parts["text"])}, tmp_path)


# what may have blanks around it, but for what only looks like it, and what begins lines without any
SEPARATORS = {
    "rapid": (r":=|(?<=[\w}])\.(?=[a-z])|[,=:(){}\[\]\\]", "!"),
    "krl": (r"==|<=|>=|<>|[,=:(){}\[\]]", ";&"),
    "fanuc": (r"[,=()]", "!/"),
    "urscript": (r"==|<=|>=|!=|\bp\[|[,=()\]]", "#"),
}


def spaced(language: str, text: str) -> str:
    """With a blank before and behind everything in its statements that may have one."""
    separator, comment = SEPARATORS[language]
    lines = []
    for line in text.split("\n"):
        indent = line[: len(line) - len(line.lstrip())]
        pieces = re.split(rf'("[^"]*"|[{comment}].*)', line.lstrip())
        pieces[::2] = [re.sub(separator, r" \g<0> ", piece) for piece in pieces[::2]]
        lines.append(indent + "".join(pieces).strip())
    return "\n".join(lines)


@pytest.mark.parametrize(("language", "counts", "parts"), corpus())
def test_blanks_change_nothing(language: str, counts: str, parts: dict[str, str], tmp_path: Path) -> None:
    parts = {name: filled(language, text) for name, text in parts.items()}
    said: list[list[str]] = []
    for how in ("plain", "spaced"):
        folder = tmp_path / how
        folder.mkdir()
        own = {
            n: spaced(language, t) if n in ("text", "dat", "beside") and how == "spaced" else t
            for n, t in parts.items()
        }
        try:
            done, text, dat = compensated(language, own, folder)
            found = [*done["problems"], text, dat]
        except trical.TricalError as error:
            found = [str(error)]
        said.append([each.replace(str(folder), "") for each in found])
    plain, blank = ([re.sub(r"\s", "", each) for each in of] for of in said)
    assert plain == blank, counts


def test_the_corpus_has_sixty_programs() -> None:
    assert len(corpus()) >= 60
    assert np.allclose(turn(2, 0.3) @ turn(2, -0.3), np.eye(4))
