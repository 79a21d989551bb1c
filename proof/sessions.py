"""Cases of several recordings: one arm over its sessions, and clusters of repeated poses with fresh poses to try on.

A session has its own measuring frame, tool and targets (or its own place of the balls). Effects of scope `arm` act in
all of them, those of a day in one.
"""

from __future__ import annotations

import zlib
from dataclasses import replace

import numpy as np

import configurations
import make
import write
from arms import OTHERS, SMALL
from curves import CURVES
from draws import pick
from families import FAMILIES
from plant import DEG, MM, Arm, Session, simulate, tracker_points, zyx
from visible import Design, Invisible

ENCODER = {"encoder_error": CURVES["encoder_error"][1]}
SCOPES = {
    "setup": "payload ball_position indicator_gain indicator_skew",
    "course": "thermal_growth thermal_zero_drift joint_zero_shift fixture_shift fixture_drift tool_shift tool_drift "
    "frame_drift indicator_drift",
    "reading": "late_joint_reading",
}
SCOPE_OF = {effect: scope for scope, effects in SCOPES.items() for effect in effects.split()}
ARM = {k: f for k, f in {**FAMILIES, **ENCODER}.items() if k not in SCOPE_OF and k != "gravity_direction"}
NO_DAYS = ("late_joint_reading", "ball_position", "indicator_gain", "indicator_skew", "indicator_drift")
DAY = {k: FAMILIES[k] for k in SCOPE_OF if k not in NO_DAYS}


# ---- sessions --------------------------------------------------------------------------------------------------------


def make_sessions(seed: int, index: int, touches: list[int]) -> tuple[str, dict[str, str], dict]:
    """Id, files, truth of an arm with two to four sessions, a third of them touches of balls."""
    for attempt in range(20):
        rng = np.random.default_rng([seed, zlib.crc32(b"sessions"), index, attempt])
        try:
            return _sessions(rng, make.name_of("sessions", seed, index), index % 3 != 2, touches[index % len(touches)])
        except (Invisible, configurations.Unreachable):
            continue
    raise Invisible(f"sessions {index}")


def day_of(nominal: Arm, arm: Arm, rng: np.random.Generator, touch: bool) -> Arm:
    """The arm with a tool screwed on anew, before a set of balls that stands elsewhere."""
    new = arm.but(tcp=nominal.tcp + rng.normal(0, 1.0 * MM, 3))
    return new.but(base_xyz=nominal.base_xyz + rng.normal(0, 3 * MM, 3)) if touch else new


def _sessions(rng: np.random.Generator, case_id: str, touch: bool, n: int) -> tuple[str, dict[str, str], dict]:
    nominal, first = make.cell(rng, n, touch, pick(rng, [SMALL, OTHERS["universal"]]))
    arm = make.built(nominal, rng, touch)
    days = int(rng.integers(2, 5))
    plans = [first] + [make.plan(nominal, rng, n, touch) for _ in range(days - 1)]
    # one thermometer and one controller for all days
    plans = [replace(s, has_thermometer=first.has_thermometer, sigma=first.sigma, load=None) for s in plans]
    arms = [day_of(nominal, arm, rng, touch) for _ in plans]
    designs = [Design(a, s) for a, s in zip(arms, plans, strict=True)]
    effects: list[dict] = []
    for _ in range(int(rng.integers(1, 4))):
        e, _, _ = make.draw_effect(rng, arms[0], plans[0], designs[0], ARM, 8.0, effects)
        effects.append({**e, "scope": "arm", "session": None})
    for _ in range(int(rng.integers(1, 3))):
        k = int(rng.integers(days))
        e, _, _ = make.draw_effect(rng, arms[k], plans[k], designs[k], DAY, 8.0, effects)
        effects.append({**e, "scope": SCOPE_OF[e["effect"]], "session": k + 1})
    robot, files = write.robot_toml(nominal.but(name=f"arm {case_id}")), {}
    for k, (a, s) in enumerate(zip(arms, plans, strict=True)):
        present = [e for e in effects if e["session"] in (None, k + 1)]
        columns, _, _ = make.measure(rng, a, s, present, "white", False)
        files[f"case.s{k + 1}.csv"] = write.csv(columns)
    for e in effects:
        on = [d for k, d in enumerate(designs) if e["session"] in (None, k + 1)]
        e["lambda"] = round(float(np.sqrt(sum(d.lam([e]) ** 2 for d in on))), 3)
        e["alike"] = []
    truth = {**plain("sessions", arm, first, n * days), "sessions": days, "effects": effects}
    return case_id, {"robot.toml": robot, "cell.toml": write.cell_toml(nominal), **files}, truth


def plain(kind: str, arm: Arm, s: Session, n: int) -> dict:
    """What every truth says."""
    return {
        "kind": kind,
        "measurements": n,
        "tool_mass": arm.tool_mass,
        "touch": s.touch,
        "sigma_mm": s.sigma / MM,
        "noise": "white",
        "rows": {},
        "session": dict(s.style),
        "unseen": [],
    }


# ---- clusters --------------------------------------------------------------------------------------------------------


def cubes(nominal: Arm, rng: np.random.Generator, centres: np.ndarray, each: int) -> np.ndarray:
    """`each` poses about every centre (K, 6), within 40 mm and 5 degrees of it."""
    q = np.repeat(centres, each, 0)
    rs, os, p = configurations.flange(nominal, q)
    jac = configurations.point_jacobian(rs, os, p)
    there = q + rng.uniform(-5, 5, q.shape) * DEG
    _, _, now = configurations.flange(nominal, there)
    step = rng.uniform(-40, 40, p.shape) * MM * nominal.size - (now - p)
    return there + np.einsum("nij,nj->ni", np.linalg.pinv(jac, rcond=0.05), step).clip(-0.2, 0.2)


def make_clusters(seed: int, index: int, touches: list[int]) -> tuple[str, dict[str, str], dict]:
    """Cubes of poses, three readings each without `seq`, and under `fresh/` what is kept back: other poses of the same
    cubes, and poses anywhere. What the arm does not repeat is the same for the readings of a pose."""
    case_id = make.name_of("clusters", seed, index)
    rng = np.random.default_rng([seed, zlib.crc32(b"clusters"), index])
    nominal, s = make.cell(rng, 300, False, SMALL)
    arm = make.built(nominal, rng, False)
    centres = s.q[: int(rng.integers(6, 12))]
    where = zyx(rng.uniform(-np.pi, np.pi, 3) * [1.0, 0.1, 0.1]), rng.uniform(-2.0, 2.0, 3)
    repeats = s.sigma * rng.uniform(1.5, 4.0)
    effects, files = [], {}
    # what hangs on time or on the way between poses is no part of this question
    still = {k: f for k, f in ARM.items() if k[:4] not in ("lost", "load")}
    design = Design(arm, s)
    for _ in range(index % 3):
        try:
            effects.append(make.draw_effect(rng, arm, s, design, still, 6.0, effects)[0])
        except Invisible:
            break
    for e in effects:
        e |= {"lambda": round(design.lam([e]), 3), "alike": []}
    sets = {
        "recording.csv": (cubes(nominal, rng, centres, 12), 3),
        "fresh/inside.csv": (cubes(nominal, rng, centres, 25), 1),
        "fresh/anywhere.csv": (s.q, 1),
    }
    for name, (q, readings) in sets.items():
        q = np.repeat(make.rounded(q[rng.permutation(len(q))]), readings, 0)
        n = len(q)
        nothing = np.zeros((n, 6))
        here = replace(s, q=q, t=12.0 * np.arange(n), temp=np.full(n, 20.0), dirs=nothing.astype(int), lag=nothing)
        here = replace(here, rest=nothing, ball=np.zeros(n, int), load=None, has_commanded=False, has_thermometer=False)
        scatter = np.repeat(rng.normal(0, repeats, (n // readings, 3)), readings, 0) + rng.normal(0, s.sigma, (n, 3))
        points = (tracker_points(simulate(arm, here, effects), where) + scatter) / MM
        columns = make.table(rng, here, here.ball, points)
        files[name] = write.csv({k: v for k, v in columns.items() if k[0] in "qxyz"})
    truth = plain("clusters", arm, s, 3 * 12 * len(centres))
    truth |= {"effects": effects, "repeats_mm": repeats / MM, "poses": 12 * len(centres)}
    files |= {"robot.toml": write.robot_toml(nominal), "cell.toml": write.cell_toml(nominal)}
    return case_id, files, truth


def many(rng: np.random.Generator, arm: Arm, s: Session, visible: float) -> tuple[list[dict], Session]:
    """Six to twelve effects at once."""
    effects: list[dict] = []
    design = Design(arm, s)
    for _ in range(int(rng.integers(6, 13))):
        e, s, design = make.draw_effect(rng, arm, s, design, {**FAMILIES, **ENCODER}, visible, effects)
        effects.append(e)
    return effects, s
