"""Plans against an independent collision checker: coal (the library of pinocchio), with kinematics of its own.

Nothing here is TriCal's: the arm is multiplied out from robot.toml, the shapes are read from cell.toml. Along every
movement of a plan no two bodies may meet, looked at so finely that nothing moves more than 0.2 mm unseen; and obstacles
that are planted in the way must be found, here and by the program.
"""

from __future__ import annotations

import itertools
import json
import math
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from conftest import program

coal = pytest.importorskip("coal")
tomllib = pytest.importorskip("tomllib")

ROOT = Path(__file__).resolve().parents[2]
ROBOT = ROOT / "cells" / "irb120" / "robot.toml"
CELL = ROOT / "cells" / "irb120" / "cell.toml"
STEP = 0.2e-3


def rx(a: float) -> np.ndarray:
    c, s = math.cos(a), math.sin(a)
    return np.array([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1.0]])


def rz(a: float) -> np.ndarray:
    c, s = math.cos(a), math.sin(a)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def shift(v: Any) -> np.ndarray:
    t = np.eye(4)
    t[:3, 3] = v
    return t


def zyx(deg: list[float]) -> np.ndarray:
    z, y, x = (math.radians(d) for d in deg)
    ry = np.array([[math.cos(y), 0, math.sin(y), 0], [0, 1, 0, 0], [-math.sin(y), 0, math.cos(y), 0], [0, 0, 0, 1.0]])
    return rz(z) @ ry @ rx(x)


class Arm:
    """Craig's modified Denavit-Hartenberg chain."""

    def __init__(self, robot: dict[str, Any], cell: dict[str, Any]) -> None:
        self.joints = robot["joint"]
        base = cell["base"]
        self.base = shift(np.array(base["xyz_mm"]) * 1e-3) @ zyx(base["zyx_deg"])

    def frames(self, q: np.ndarray) -> list[np.ndarray]:
        t = self.base
        out = [t]
        for j, angle in zip(self.joints, q, strict=True):
            alpha, offset = math.radians(j["alpha_deg"]), math.radians(j["theta_offset_deg"])
            t = t @ rx(alpha) @ shift([j["a_mm"] * 1e-3, 0, 0]) @ rz(angle + offset) @ shift([0, 0, j["d_mm"] * 1e-3])
            out.append(t)
        return out


def hull_faces(points: np.ndarray) -> list[tuple[int, int, int]]:
    """Triangles of the hull of a few points: every three that have all others on one side."""
    middle = points.mean(axis=0)
    faces = []
    for a, b, c in itertools.combinations(range(len(points)), 3):
        normal = np.cross(points[b] - points[a], points[c] - points[a])
        if np.linalg.norm(normal) < 1e-12:
            continue
        side = (points - points[a]) @ normal / np.linalg.norm(normal)
        if side.max() < 1e-9 or side.min() > -1e-9:
            faces.append((a, b, c) if (middle - points[a]) @ normal < 0 else (a, c, b))
    return faces


def solid(s: dict[str, Any]) -> tuple[Any, np.ndarray]:
    """A coal shape and its pose in the frame of its body."""

    def mm(key: str) -> np.ndarray:
        return np.array(s[key], dtype=float) * 1e-3

    kind = s["shape"]
    if kind == "sphere":
        return coal.Sphere(s["radius_mm"] * 1e-3), shift(mm("center_mm"))
    if kind == "box":
        assert "rounding_mm" not in s
        return coal.Box(*mm("size_mm")), shift(mm("center_mm")) @ zyx(s.get("zyx_deg", [0, 0, 0]))
    if kind == "hull":
        points = mm("points_mm")
        vertices, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
        for p in points:
            vertices.append(p)
        for a, b, c in hull_faces(points):
            triangles.append(coal.Triangle(a, b, c))
        return coal.Convex(vertices, triangles), np.eye(4)
    a, b, r = mm("from_mm"), mm("to_mm"), s["radius_mm"] * 1e-3
    length = float(np.linalg.norm(b - a))
    z = (b - a) / length if length > 0 else np.array([0, 0, 1.0])
    x = np.cross(z, [1, 0, 0] if abs(z[0]) < 0.9 else [0, 1, 0])
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    pose[:3, 3] = (a + b) / 2
    shape = coal.Capsule(r, length) if kind == "capsule" else coal.Cylinder(r, length)
    return shape, pose


def bound(shape: Any) -> float:
    """Radius of a sphere about the shape's own origin that holds it."""
    if isinstance(shape, coal.Sphere):
        return float(shape.radius)
    if isinstance(shape, coal.Capsule):
        return float(shape.halfLength + shape.radius)
    if isinstance(shape, coal.Cylinder):
        return math.hypot(shape.halfLength, shape.radius)
    if isinstance(shape, coal.Box):
        return float(np.linalg.norm(shape.halfSide))
    return max(float(np.linalg.norm(p)) for p in shape.points())


class Body:
    def __init__(self, name: str, frame: int | None, solids: list[tuple[Any, np.ndarray]], stem: bool = False) -> None:
        self.name, self.frame, self.solids, self.stem = name, frame, solids, stem
        self.ball: int | None = None


def bodies(cell: dict[str, Any], arm: Arm) -> list[Body]:
    g = cell["geometry"]
    flange = len(arm.joints)
    tool = shift(np.array(cell["tool"]["tcp_mm"]) * 1e-3)
    out = [Body(b.get("name", f"link {b['link']}"), b["link"], [solid(s) for s in b["solids"]]) for b in g["link"]]
    for b in g["device"]:
        at = tool if b.get("frame") == "tool" else np.eye(4)
        solids = [(shape, at @ pose) for shape, pose in map(solid, b["solids"])]
        out.append(Body(b["name"], flange, solids, b.get("touches", False)))
    for b in g["obstacle"]:
        at = arm.base if b.get("frame") == "base" else np.eye(4)
        out.append(Body(b["name"], None, [(shape, at @ pose) for shape, pose in map(solid, b["solids"])]))
    d = cell["balls"]["distances_mm"]
    x = (d["d12"] ** 2 + d["d13"] ** 2 - d["d23"] ** 2) / (2 * d["d12"])
    centres = [(0, 0, 0), (d["d12"], 0, 0), (x, math.sqrt(d["d13"] ** 2 - x * x), 0)]
    r, post, length = g["balls"]["diameter_mm"] / 2, g["balls"]["post_radius_mm"], g["balls"]["post_length_mm"]
    for k, c in enumerate(np.array(centres)):
        ball = Body(f"ball {k + 1}", None, [solid({"shape": "sphere", "center_mm": c, "radius_mm": r})])
        ball.ball = k
        out.append(ball)
        top, foot = c - [0, 0, r + post], c - [0, 0, length]
        stand = {"shape": "capsule", "from_mm": top, "to_mm": foot, "radius_mm": post}
        out.append(Body(f"post {k + 1}", None, [solid(stand)]))
    return out


class Checker:
    def __init__(self, cell_text: str) -> None:
        cell = tomllib.loads(cell_text)
        self.arm = Arm(tomllib.loads(ROBOT.read_text()), cell)
        self.all = bodies(cell, self.arm)
        ignore = [set(p) for p in cell["geometry"].get("ignore", [])]
        self.pairs: list[tuple[int, int, Body, Body]] = []
        self.parts = [(b, shape, pose) for b in self.all for shape, pose in b.solids]
        for (i, (a, *_)), (j, (b, *_)) in itertools.combinations(enumerate(self.parts), 2):
            moving = [x for x in (a.frame, b.frame) if x is not None]
            if not moving or {a.name, b.name} in ignore:
                continue
            links = [b.frame if b.frame is not None else 0 for b in (a, b)]
            neighbours = abs(links[0] - links[1]) <= 1
            device = self.is_device(a) or self.is_device(b)
            static = len(moving) == 1
            if links[0] == links[1] or (neighbours and not device and not static):
                continue
            self.pairs.append((i, j, a, b))
        # spheres around the parts, about the origins of their poses: most pairs need no more
        self.bound = np.array([bound(shape) for _, shape, _ in self.parts])
        self.first = np.array([i for i, *_ in self.pairs])
        self.second = np.array([j for _, j, *_ in self.pairs])
        # how far anything can be from an axis: the whole arm stretched out, and the device
        lengths = [math.hypot(j["a_mm"], j["d_mm"]) * 1e-3 for j in self.arm.joints]
        self.reach = [sum(lengths[k + 1 :]) + lengths[k] + 0.35 for k in range(len(lengths))]
        self.request, self.result = coal.DistanceRequest(), coal.DistanceResult()

    def is_device(self, b: Body) -> bool:
        return b.frame == len(self.arm.joints) and b.name != "flange"

    def distance(self, q: np.ndarray, touched: int | None) -> tuple[float, str]:
        """The smallest distance of any two bodies, at most 0 where they meet, and which."""
        frames = self.arm.frames(q)
        at = [(frames[b.frame] if b.frame is not None else np.eye(4)) @ pose for b, _, pose in self.parts]
        placed = [coal.Transform3s(t[:3, :3], t[:3, 3]) for t in at]
        origins = np.array([t[:3, 3] for t in at])
        apart = np.linalg.norm(origins[self.first] - origins[self.second], axis=1)
        least = apart - self.bound[self.first] - self.bound[self.second]
        best = (math.inf, "")
        for k in np.argsort(least):
            if least[k] >= best[0]:
                break
            i, j, a, b = self.pairs[k]
            if touched is not None and ((a.stem and b.ball == touched) or (b.stem and a.ball == touched)):
                continue
            self.result.clear()
            d = coal.distance(self.parts[i][1], placed[i], self.parts[j][1], placed[j], self.request, self.result)
            if d < best[0]:
                best = (d, f"{a.name} and {b.name}")
        return best

    def motion(self, a: np.ndarray, b: np.ndarray, touched: int | None) -> tuple[float, str]:
        """The smallest distance along a straight motion of the joints.

        Between two looks nothing moves more than half of the smallest distance, or 0.2 mm."""
        speed = sum(abs(d) * r for d, r in zip(b - a, self.reach, strict=True))
        best = (math.inf, "")
        s = 0.0
        while True:
            d = self.distance(a + min(s, 1.0) * (b - a), touched)
            best = min(best, d)
            if s >= 1.0 or d[0] <= 0:
                return best
            s += max(STEP, 0.5 * d[0]) / max(speed, 1e-12)


def run(*args: object, ok: bool = True) -> subprocess.CompletedProcess[str]:
    r = subprocess.run([program(), *map(str, args)], capture_output=True, text=True, timeout=300)
    assert (r.returncode == 0) == ok, r.stderr
    return r


def plan(folder: Path, seed: int, *more: object) -> list[dict[str, Any]]:
    out = folder / f"plan{seed}.csv"
    run("plan", "--robot", ROBOT, "--cell", CELL, "--seed", seed, "--out", out, *more)
    lines = out.read_text().splitlines()
    names = lines[0].split(",")
    touches = []
    for line in lines[1:]:
        row = dict(zip(names, line.split(","), strict=True))
        joints = {k: np.radians([float(row[f"{k}{j}_deg"]) for j in range(1, 7)]) for k in "qa"}
        via = [np.radians([float(x) for x in v.split()]) for v in row["via"].split(";") if v.strip()]
        touches.append({"ball": int(row["ball"]) - 1, **joints, "via": via})
    return touches


def movements(touches: list[dict[str, Any]]) -> Iterator[tuple[np.ndarray, np.ndarray, int | None]]:
    at = np.zeros(6)
    for t in touches:
        for stop in [*t["via"], t["a"]]:
            yield at, stop, None
            at = stop
        yield t["a"], t["q"], t["ball"]


@pytest.mark.parametrize("seed", [1, 2])
def test_no_planned_movement_collides(tmp_path: Path, seed: int) -> None:
    checker = Checker(CELL.read_text())
    touches = plan(tmp_path, seed, "--per-ball", 6, "--pool", 40)
    assert len(touches) == 18
    worst = min(checker.motion(*m) for m in movements(touches))
    # the plan keeps 5 mm where it looked, and half of it everywhere
    assert worst[0] > 2.4e-3, worst


def test_planted_collisions_are_found_by_both(tmp_path: Path) -> None:
    touches = plan(tmp_path, 3, "--per-ball", 6, "--pool", 40)
    text = CELL.read_text()
    command = [program(), "virtual-cell", "--robot", str(ROBOT), "--cell", str(CELL), "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
        try:
            assert server.stdout is not None
            gauge, controller = re.findall(r"'([^']+)'", server.stdout.readline())
            links = ("--gauge", gauge, "--controller", controller, "--out", tmp_path / "run.mcap")

            def measure(cell: Path, ok: bool) -> str:
                route = ("--plan", tmp_path / "plan3.csv", *links)
                return run("measure", "--robot", ROBOT, "--cell", cell, *route, ok=ok).stderr

            measure(CELL, ok=True)
            arm = Checker(text).arm
            for k, t in enumerate(touches):
                # a small ball on the device's way into the touch, where the flange passes halfway
                x, y, z = arm.frames((t["a"] + t["q"]) / 2)[6][:3, 3] * 1e3
                block = f'{{ shape = "sphere", center_mm = [{x}, {y}, {z}], radius_mm = 3.0 }}'
                planted = text + f'\n[[geometry.obstacle]]\nname = "planted"\nsolids = [{block}]\n'
                found = Checker(planted).motion(t["a"], t["q"], t["ball"])
                assert found[0] <= 0 and "planted" in found[1], found
                cell = tmp_path / f"planted{k}.toml"
                cell.write_text(planted)
                assert "planted" in measure(cell, ok=False)
        finally:
            server.kill()


def test_distances_are_those_of_an_independent_model(tmp_path: Path) -> None:
    """What the program refuses meets here, too: where it says that the start is in collision, coal says so."""
    checker = Checker(CELL.read_text())
    rng = np.random.default_rng(1)
    robot = tomllib.loads(ROBOT.read_text())
    limits = np.array([j["limits_deg"] for j in robot["joint"]])
    refused = 0
    for k in range(24):
        q = np.round(limits[:, 0] + rng.random(6) * (limits[:, 1] - limits[:, 0]), 3)
        start = ",".join(map(str, q))
        out = tmp_path / "p.csv"
        args = ["plan", "--robot", ROBOT, "--cell", CELL, "--per-ball", "2", "--pool", "2", "--out", out]
        r = subprocess.run(
            [program(), *map(str, args), f"--start-deg={start}", "--json"],
            capture_output=True,
            text=True,
            timeout=300,
        )
        d, pair = checker.distance(np.radians(q), None)
        said = "meet there" in r.stderr
        refused += said
        # 0.05 mm is the slack of the program's iteration, and coal's own
        if d < 4.9e-3:
            assert said, (k, q, d, pair, r.stderr)
        if d > 5.1e-3:
            assert not said, (k, q, d, pair, r.stderr)
            assert r.returncode == 1 or json.loads(r.stdout)["touches"] == 6
    assert 3 < refused < 22
