#!/usr/bin/env python3
"""Draws concealed cases from a seed: arm, effect, site, size, noise, poses. Same seed, same bytes.

    make.py --seed 1 --count 20 --kind single --out DIR

leaves DIR/cases/ID/{robot.toml,cell.toml,recording.csv}, which is all that a diagnosis sees, and
DIR/sealed/truth.json, whose SHA-256 goes to standard output and to DIR/truth.sha256 before anything is diagnosed.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse
import multiprocessing
import sys
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import arms
import configurations
import real
import run
import write
from curves import CURVES, same_gears
from draws import log_uniform, pick, units
from effects import threshold_of, variable_of
from families import FAMILIES, OUTSIDE
from plant import (
    DEG,
    GRAVITY,
    MM,
    Arm,
    Session,
    bodies,
    frames,
    gravity_moments,
    readings,
    simulate,
    tracker_points,
    true_arm,
    zyx,
)
from visible import Design, Invisible, context, survey

KINDS = ("none", "single", "strong", "pair", "five", "outside", "nonwhite", "dirty", "tracker", "mujoco", "arms")
KINDS += ("curves", "gears", "real", "many", "sessions", "clusters")
VISIBLE, STRONG = 6.0, 15.0


# ---- the session: where the arm is sent, when, and how it is read ------------------------------------------------


def cell(rng: np.random.Generator, n: int, touch: bool, kind: arms.Kind) -> tuple[Arm, Session]:
    """A nominal arm in its cell, which has a second plate of balls now and then, and the session planned for it."""
    while True:
        nominal = arms.nominal_arm(rng, kind)
        if touch and rng.random() < 0.2:
            nominal = configurations.second_plate(nominal, rng)
        try:
            return nominal, plan(nominal, rng, n, touch)
        except configurations.Unreachable:
            continue


def built(nominal: Arm, rng: np.random.Generator, touch: bool) -> Arm:
    """The true arm."""
    arm = true_arm(nominal, rng)
    if not touch:
        # a tracker's own frame does not say where the first axis leans: an unlevel base is an effect, and drawn as one
        arm = arm.but(base_zyx=nominal.base_zyx, alpha=np.append(nominal.alpha[0], arm.alpha[1:]))
    return arm


def plan(nominal: Arm, rng: np.random.Generator, n: int, touch: bool) -> Session:
    order = str(rng.choice(["random", "balls", "path"], p=[0.5, 0.25, 0.25] if touch else [0.6, 0.0, 0.4]))
    sides = str(rng.choice(["comes", "both", "one"], p=[0.75, 0.15, 0.1]))
    several = 2 if sides == "both" else 1
    if touch:
        q, ball = configurations.touches(nominal, rng, -(-n // several))
    else:
        q, ball = configurations.tracker(nominal, rng, -(-n // several)), np.zeros(-(-n // several), int)
    sequence = np.repeat(configurations.ordered(rng, q, ball, order), several)[:n]
    q, ball = q[sequence], ball[sequence]
    t = configurations.clock(rng, n, 20.0 if touch else 12.0)
    dirs = configurations.approaches(rng, q, sides)
    spread = log_uniform(rng, 0.3, 1.5) * MM if touch and rng.random() < 0.25 else rng.uniform(0.006, 0.012) * MM
    commanded = bool(rng.random() < 0.4) or not touch
    nothing = np.zeros((n, 6))
    return Session(
        touch=touch,
        q=q,
        t=t,
        temp=configurations.warm_up(rng, t),
        dirs=dirs,
        ball=ball,
        sigma=(rng.uniform(0.005, 0.015) if touch else rng.uniform(0.005, 0.02)) * MM,
        spread=spread,
        lag=nothing,
        rest=servo_rest(rng, nominal, q, dirs) if commanded else nothing,
        has_commanded=commanded,
        has_thermometer=bool(rng.random() < 0.8),
        load=configurations.loads(rng, n) if rng.random() < 0.2 else None,
        reading=rng.normal(0, 1.0, (n, 3)) * spread if touch else None,
        style={"order": order, "sides": sides},
    )


def servo_rest(rng: np.random.Generator, nominal: Arm, q: np.ndarray, dirs: np.ndarray) -> np.ndarray:
    """Commanded minus reported joints (N, 6) rad of an arm at rest, rightly reported: resolution, and in half of the
    sessions a controller without integral action, which gives way to gravity and stops at the edge of its dead
    zone."""
    rest = rng.normal(0, 3e-4, q.shape).clip(-8e-4, 8e-4)
    if rng.random() < 0.5:
        rs, os = frames(nominal, q + nominal.offset)
        weights = bodies(nominal, rs, os, np.zeros(len(q)))
        pull = gravity_moments(*weights, os, np.array([0.0, 0.0, -GRAVITY]))
        tau = np.einsum("nja,nja->nj", pull, rs[..., 2])
        give = rng.uniform(0.0, 0.01, 6) * tau / np.maximum(np.abs(tau).max(0), 1e-9)
        rest = rest - give + rng.uniform(0.0, 0.006, 6) * dirs
    return np.round(rest, 4) * DEG


def with_lag(s: Session, rng: np.random.Generator, site: dict) -> Session:
    """Joints read before the arm had settled: the reported angle lags in the sense of motion, by an amount of its
    own."""
    size = np.exp(rng.uniform(np.log(0.005), np.log(0.1), 6)) * DEG
    if "joint" in site:
        size[[j for j in range(6) if j != site["joint"] - 1]] = 0.0
    lag = np.round(s.dirs * size * rng.uniform(0.2, 1.4, s.q.shape) / DEG, 4) * DEG
    # such a controller does arrive in the end
    return replace(s, lag=lag, rest=np.round(rng.normal(0, 3e-4, s.q.shape).clip(-8e-4, 8e-4), 4) * DEG)


# ---- effects -----------------------------------------------------------------------------------------------------


def draw_effect(rng, arm: Arm, s: Session, design: Design, families, visible: float, others=()):
    """One effect that is not in `others`: family, then site, then size; all redrawn until lambda reaches `visible`."""
    for _ in range(200):
        name = pick(rng, sorted(families))
        family = families[name]
        if not (family.touches if s.touch else family.tracker):
            continue
        for _ in range(12):
            ctx = context_of(arm, s)
            sites = family.sites(ctx)
            if not sites:
                break
            site = pick(rng, sites)
            late = name == "late_joint_reading"  # one story of what commanded and reported joints mean
            if any(o["effect"] == name and (late or o["site"] == site) for o in others):
                continue
            session = with_lag(s, rng, site) if late else s
            effect = {"effect": name, "site": site, "p": family.draw(rng, context_of(arm, session), site)}
            here = design if session is s else Design(arm, session)
            if visible == 0.0 or here.lam([effect]) >= visible:
                return effect, session, here
    raise Invisible


_contexts: dict[int, object] = {}


def context_of(arm: Arm, s: Session):
    key = id(s)
    if key not in _contexts:
        _contexts.clear()
        _contexts[key] = (s, context(arm, s))
    return _contexts[key][1]


# ---- noise and dirt ----------------------------------------------------------------------------------------------


def noise(rng, s: Session, kind: str) -> np.ndarray:
    """(N, 3) m; every kind has the stated rms."""
    n = len(s.q)
    white = rng.normal(0, 1.0, (n, 3))
    if kind == "white":
        x = white
    elif kind == "ar1":
        rho, x = rng.uniform(0.4, 0.8), white.copy()
        for i in range(1, n):
            x[i] = rho * x[i - 1] + np.sqrt(1 - rho**2) * white[i]
    elif kind == "wander":
        # waves of no one length, beside white noise: no process of first order
        share, waves = rng.uniform(0.3, 0.7), np.zeros((n, 3))
        for period in np.exp(rng.uniform(np.log(5), np.log(60), 24)):
            phase = rng.uniform(0, 2 * np.pi, 3)
            waves += np.sin(2 * np.pi * np.arange(n)[:, None] / period + phase) / np.sqrt(12)
        x = np.sqrt(share) * waves + np.sqrt(1 - share) * white
    elif kind == "student":
        x = rng.standard_t(4, (n, 3)) / np.sqrt(2.0)
    elif kind == "uneven":
        w = 0.5 + np.abs(np.sin(s.q[:, 4])) + 0.5 * (s.progress > 0.5)
        x = white * (w / np.sqrt(np.mean(w**2)))[:, None]
    else:
        raise ValueError(kind)
    return x * s.sigma


def dirt(rng, s: Session) -> tuple[np.ndarray, dict[str, list[int]]]:
    """Gross errors (N, 3) m on what the reading should have been, and which rows are what (0-based)."""
    n = len(s.q)
    gone, stale = (max(1, round(float(x) * n)) for x in rng.uniform(0.01, 0.04, 2))
    rows = [int(r) for r in rng.choice(np.arange(1, n), gone + stale + 1, replace=False)]
    kinds = {"outlier": sorted(rows[:gone]), "stale_reading": sorted(rows[gone:-1]), "wrong_ball": rows[-1:]}
    gross = np.zeros((n, 3))
    for r in kinds["outlier"] + kinds["stale_reading"]:
        v = rng.normal(size=3)
        gross[r] = v / np.linalg.norm(v) * log_uniform(rng, 0.12, 1.0) * MM
    return gross, kinds


# ---- measuring ---------------------------------------------------------------------------------------------------


def rounded(q: np.ndarray) -> np.ndarray:
    return np.round(q / DEG, 4) * DEG


def drive_to_touch(
    arm: Arm, s: Session, effects, errors: np.ndarray, machine=simulate, moving=slice(None)
) -> tuple[Session, np.ndarray]:
    """Drives the true machine until the readings are what the procedure leaves, and returns what is then read (N, 3)
    m. Rows that are not `moving` stay where they are."""
    q = s.q.copy()
    # experiments are dear: they only have to find what remains after a plain drive
    drives = [(simulate, effects)] * 4 if machine is simulate else [(simulate, [])] * 3 + [(machine, effects)]
    for plant, present in drives:
        poses = plant(arm, replace(s, q=q), present)
        missing = readings(poses) + errors - s.reading
        step = np.einsum("nij,nj->ni", poses.r, missing)
        rs, os, p = configurations.flange(arm, q)
        jac = configurations.point_jacobian(rs, os, p)
        q[moving] += np.einsum("nij,nj->ni", np.linalg.pinv(jac), step)[moving]
    now = replace(s, q=rounded(q))
    read = readings(machine(arm, now, effects)) + errors
    return replace(now, reading=read), read


def table(rng, s: Session, ids: np.ndarray, measured: np.ndarray) -> dict[str, tuple[np.ndarray, int]]:
    """Columns of a recording: values, and digits after the point. `ids` (N) are balls from 1, `measured` (N, 3) mm."""
    columns: dict[str, tuple[np.ndarray, int]] = {"t_s": (s.t, 2)}
    if s.touch:
        columns["ball"] = (ids, 0)
    for j in range(6):
        columns[f"q{j + 1}_deg"] = (s.q[:, j] / DEG, 4)
    if s.has_commanded:
        for j in range(6):
            columns[f"qc{j + 1}_deg"] = ((s.q + s.lag + s.rest)[:, j] / DEG, 4)
    for j in range(6):
        columns[f"dir{j + 1}"] = (s.dirs[:, j], 0)
    for i, a in enumerate("xyz"):
        columns[f"i{a}_mm" if s.touch else f"{a}_mm"] = (measured[:, i], 3 if s.touch else 4)
    if s.has_thermometer:
        columns["temp_c"] = (s.temp + rng.normal(0, 0.02, len(s.t)), 3)
    if s.load is not None:
        columns["payload_kg"] = (s.load, 3)
    return columns


def measure(rng, arm, s, effects, noise_kind, dirty, machine=simulate):
    """CSV columns of the recording, the session as measured, and which rows are dirt."""
    errors = noise(rng, s, noise_kind)
    rows: dict[str, list[int]] = {}
    ids = s.ball + 1
    if s.touch:
        if dirty:
            gross, rows = dirt(rng, s)
            errors = errors + gross
        s, read = drive_to_touch(arm, s, effects, errors, machine)
        read = np.round(read / MM, 3)
        for r in rows.get("stale_reading", []):
            read[r] = read[r - 1]
        for r in rows.get("wrong_ball", []):
            ids = ids.copy()
            ids[r] = 1 + ids[r] % len(arm.balls)
    else:
        s = replace(s, q=rounded(s.q))
        where = zyx(rng.uniform(-np.pi, np.pi, 3) * [1.0, 0.1, 0.1]), rng.uniform(-2.0, 2.0, 3)
        points = (tracker_points(machine(arm, s, effects), where) + errors) / MM
    columns = table(rng, s, ids, read if s.touch else points)
    return columns, s, rows


# ---- cases -------------------------------------------------------------------------------------------------------


def how_many(kind: str, rng) -> tuple[int, float]:
    """Effects to draw, and the lambda that each must reach."""
    if kind in ("none", "pair", "five"):
        return {"none": 0, "pair": 2, "five": 5}[kind], VISIBLE
    if kind == "gears":
        return int(rng.integers(2, 7)), VISIBLE
    if kind == "single":
        return 1, VISIBLE if rng.random() < 0.75 else 0.0
    if kind in ("nonwhite", "tracker", "arms"):
        return int(rng.random() < (0.5 if kind == "nonwhite" else 0.8)), VISIBLE
    return 1, STRONG if kind == "strong" else VISIBLE


def make_case(kind: str, seed: int, index: int, touches: list[int]) -> tuple[str, dict[str, str], dict]:
    """Id, files, truth."""
    for attempt in range(20):
        try:
            return _case(kind, seed, index, touches, attempt)
        except Invisible:  # a session that shows next to nothing
            continue
    raise Invisible(f"{kind} {index}: 20 sessions in vain")


@dataclass
class Drawn:
    """A case before it is measured."""

    rng: np.random.Generator
    nominal: Arm
    arm: Arm
    s: Session
    effects: list[dict]
    machine: Callable
    model: str  # which kind of arm


def draw(kind: str, seed: int, index: int, touches: list[int], attempt: int) -> Drawn:
    """Arm, session and effects."""
    rng = np.random.default_rng([seed, zlib.crc32(kind.encode()), index, attempt])
    # of the other arms every kind is seen by touches three times in four
    touch = index // len(arms.OTHERS) % 4 != 3 if kind == "arms" else kind not in ("tracker", "curves")
    model = list(arms.OTHERS)[index % len(arms.OTHERS)] if kind == "arms" else "small"
    points = [300, 450, 600] if kind == "curves" else [100, 200, 300]
    n = int(touches[index % len(touches)]) if touch else pick(rng, points)
    if kind == "many":
        n = max(n, 300)
    if kind == "curves":  # joints of more than a turn, half of the time
        model = "universal" if index % 2 else "small"
    nominal, s = cell(rng, n, touch, arms.OTHERS.get(model, arms.SMALL))
    if kind == "curves":
        s = further_turns(rng, nominal, s)
    arm = built(nominal, rng, touch)
    count, visible = how_many(kind, rng)
    effects: list[dict] = []
    machine = simulate
    if kind == "mujoco":
        import mujoco_plant

        machine = mujoco_plant.experiment
        if rng.random() < 0.8:
            effects = [mujoco_plant.draw(rng, arm, s, VISIBLE)]
    elif kind == "many":
        import sessions

        effects, s = sessions.many(rng, arm, s, VISIBLE)
    elif kind == "curves":
        what, family = CURVES[pick(rng, list(CURVES))]
        e, s, _ = draw_effect(rng, arm, s, Design(arm, s), {what: family}, VISIBLE)
        effects = [e]
    else:
        design = Design(arm, s)
        families = OUTSIDE if kind == "outside" else same_gears(rng) if kind == "gears" else FAMILIES
        for _ in range(count):
            e, s, design = draw_effect(rng, arm, s, design, families, visible, effects)
            effects.append(e)
    return Drawn(rng, nominal, arm, s, effects, machine, model)


def further_turns(rng: np.random.Generator, nominal: Arm, s: Session) -> Session:
    """The same poses, joints on another turn where their limits let them."""
    turns = 2 * np.pi * rng.integers(-1, 2, s.q.shape)
    there = s.q + turns
    low, high = nominal.limits[:, 0] + 2 * DEG, nominal.limits[:, 1] - 2 * DEG
    q = np.where((there > low) & (there < high), there, s.q)
    return replace(s, q=q, dirs=configurations.approaches(rng, q, "comes"))


def name_of(kind: str, seed: int, index: int) -> str:
    """A case's id."""
    return f"{zlib.crc32(f'{seed}/{kind}/{index}'.encode()):08x}"


def _case(kind: str, seed: int, index: int, touches: list[int], attempt: int) -> tuple[str, dict[str, str], dict]:
    d = draw(kind, seed, index, touches, attempt)
    noise_kind = pick(d.rng, ["ar1", "wander", "student", "uneven"]) if kind == "nonwhite" else "white"
    columns, measured, rows = measure(d.rng, d.arm, d.s, d.effects, noise_kind, kind == "dirty", d.machine)
    case_id = name_of(kind, seed, index)
    files = {
        "robot.toml": write.robot_toml(d.nominal.but(name=f"arm {case_id}")),
        "cell.toml": write.cell_toml(d.nominal),
        "recording.csv": write.csv(columns),
    }
    truth = describe(kind, d.arm, measured, d.effects, noise_kind, rows, d.machine)
    truth["session"]["arm"] = d.model
    return case_id, files, truth


def directions(effect: dict) -> list[dict]:
    """An effect along each axis by itself, which it says with other numbers (a drifting tool: drifting indicators)."""
    by = effect["p"].get("by")
    if by is None:
        return [effect]
    axes = units(float(np.linalg.norm(by)))[: len(by)]
    return [{**effect, "p": {**effect["p"], **axis}} for axis in axes]


def describe(kind, arm, s, effects, noise_kind, rows, machine) -> dict:
    """Everything that the scorer needs to know and the diagnosis must not."""
    design = Design(arm, s)
    out, unseen = [], []
    if machine is simulate:
        named = [e for e in effects if not e["effect"].startswith("out_")]
        unseen, alike = survey(design, named)
        for e in effects:
            others = [o for o in effects if o is not e]
            item = {**e, "lambda": round(design.lam([e]), 3)}
            mine = design.project(design.signature([e]))
            if others:
                columns = [design.project(design.signature([v])) for o in others for v in directions(o)]
                u, size, _ = np.linalg.svd(np.stack(columns, 1), full_matrices=False)
                basis = u[:, size > 1e-9 * size[0]]
                item["lambda_apart"] = round(float(np.linalg.norm(mine - basis @ (basis.T @ mine)) / s.sigma), 3)
            if e in named:
                item["alike"] = alike[named.index(e)]
            else:
                item["variables"], item["threshold_deg"] = variable_of(e), threshold_of(e)
            out.append(item)
    elif effects:
        moved = (machine(arm, s).tcp - machine(arm, s, effects).tcp).ravel()
        unseen, alike = survey(design, effects, [moved])
        lam = float(np.linalg.norm(design.project(moved)) / s.sigma)
        out = [{**e, "lambda": round(lam, 3), "alike": a} for e, a in zip(effects, alike, strict=True)]
    return {
        "kind": kind,
        "measurements": len(s.q),
        "tool_mass": arm.tool_mass,
        "touch": s.touch,
        "sigma_mm": s.sigma / MM,
        "spread_mm": s.spread / MM,
        "session": {
            **s.style,
            "balls": len(arm.balls) if s.touch else 0,
            "commanded": s.has_commanded,
            "thermometer": s.has_thermometer,
            "payload_schedule": s.load is not None,
        },
        "noise": noise_kind,
        "rows": rows,
        "effects": out,
        "unseen": unseen,
    }


def _job(args):
    import sessions

    kind, *rest = args
    maker = {"real": real.make_case, "sessions": sessions.make_sessions, "clusters": sessions.make_clusters}.get(kind)
    return maker(*rest) if maker else make_case(*args)


def on_real_backgrounds(binary: Path | None, names: list[str], seed: int, count: int, out: Path) -> list[tuple]:
    """Cases to make, each with what the program says of its background as it is."""
    if binary is None:
        raise SystemExit(
            "real backgrounds need the program: their scatter, and what is there besides, is what it reports"
        )
    answers = {}
    for name in dict.fromkeys(names[:count]):
        said = real.answer_without(binary, real.write_background(name, out))
        if said["answer"] is None:
            print(f"{name}: left out: {said['error'][:200]}", file=sys.stderr)
            continue
        answers[name] = said["answer"]
    names = [n for n in names if n in answers]
    return [("real", names[i % len(names)], answers[names[i % len(names)]], seed, i) for i in range(count)]


def make(
    kind: str,
    seed: int,
    count: int,
    out: Path,
    touches: list[int],
    processes: int = 2,
    binary: Path | None = None,
    backgrounds: list[str] = real.USUAL,
) -> str:
    """Writes `count` cases and returns the hash of the sealed truth."""
    jobs = [(kind, seed, i, touches) for i in range(count)]
    if kind == "real":
        jobs = on_real_backgrounds(binary, backgrounds, seed, count, out)
    if processes > 1 and count > 1:
        with multiprocessing.get_context("spawn").Pool(processes) as pool:
            made = pool.map(_job, jobs, chunksize=1)
    else:
        made = [_job(j) for j in jobs]
    truths = {}
    for case_id, files, truth in made:
        where = out / "cases" / case_id
        where.mkdir(parents=True, exist_ok=True)
        for name, text in files.items():
            # what is kept back lies where the diagnosis does not look
            path = out / "fresh" / case_id / name[6:] if name.startswith("fresh/") else where / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        truths[case_id] = truth
    salt = np.random.default_rng([seed, count, 7]).bytes(16).hex()
    digest = write.seal({"seed": seed, "kind": kind, "salt": salt, "cases": truths}, out / "sealed" / "truth.json")
    (out / "truth.sha256").write_text(digest + "\n")
    return digest


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--kind", choices=KINDS, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--touches", default="150", help="touches per case, a list to cycle through: 45,150,240")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument(
        "--binary", type=Path, default=run.BINARY, help="for kind real: reports each background's scatter"
    )
    parser.add_argument(
        "--backgrounds", default=",".join(real.USUAL), help=f"for kind real, in turn: {', '.join(real.BACKGROUNDS)}"
    )
    a = parser.parse_args()
    touches, names = [int(x) for x in a.touches.split(",")], a.backgrounds.split(",")
    digest = make(a.kind, a.seed, a.count, a.out, touches, a.processes, a.binary, names)
    print(f"{a.count} cases of kind {a.kind}, seed {a.seed}; truth sealed, SHA-256 {digest}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
