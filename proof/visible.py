"""What a recording can show: lambda by re-simulation, and which explanations its data cannot tell apart.

lambda = || P s || / sigma. s is the difference of two simulations, with and without the effect; P projects out the
numerical Jacobian of the paper's 31 parameters of this simulator.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np

from draws import Context
from families import FAMILIES
from plant import Arm, Machine, Session, readings, simulate


def tips(arm: Arm, s: Session, offset: np.ndarray, start: Machine) -> np.ndarray:
    """World position (N, 3) of the point that the reading says is at the ball (or the tracker's target)."""
    poses = simulate(arm, s, start=start)
    return poses.tcp + np.einsum("nij,nj->ni", poses.r, offset)


def parameters(arm: Arm) -> list[tuple[str, Arm, Arm, float]]:
    """The paper's 31, or what corresponds to them on another arm: name, arm minus a step, arm plus a step, step."""
    out = []

    def two(name, fieldname, index, step):
        pair = []
        for sign in (-1, 1):
            v = getattr(arm, fieldname).copy()
            v[index] += sign * step
            pair.append(arm.but(**{fieldname: v}))
        out.append((name, *pair, step))

    for i in range(3):
        two(f"base_{'xyz'[i]}", "base_xyz", i, 1e-4)
        two(f"base_r{'zyx'[i]}", "base_zyx", i, 1e-4)
        two(f"tool_{'xyz'[i]}", "tcp", i, 1e-4)
    joints = len(arm.alpha)
    for i in range(1, joints):
        two(f"alpha_{i}", "alpha", i, 1e-4)
        two(f"a_{i}", "a", i, 1e-4)
        two(f"c_{i + 1}", "compliance", i, 1e-5 / arm.pull)
    for i in range(2, joints):
        if abs(np.sin(arm.alpha[i])) > 0.1:  # along parallel axes one offset is enough
            two(f"d_{i}", "d", i - 1, 1e-4)
    for i in range(2, joints):
        two(f"theta_{i}", "offset", i - 1, 1e-4)
    return out


def jacobian(arm: Arm, s: Session) -> np.ndarray:
    """(3N, 31), central differences of the residual in the world."""
    offset = s.reading if s.touch else np.zeros((len(s.q), 3))
    start = simulate(arm, s).machine
    columns = [
        (tips(b, s, offset, start) - tips(a, s, offset, start)).ravel() / (2 * h)
        for name, a, b, h in parameters(arm)
        if s.touch or not name.startswith("base")
    ]
    if s.point is not None:  # each point of the tool has coordinates of its own
        ids = np.unique(s.point, axis=0, return_inverse=True)[1].ravel()
        r = simulate(arm, s, start=start).r
        for k in range(1, ids.max() + 1):
            columns += [np.where((ids == k)[:, None], r[..., i], 0.0).ravel() for i in range(3)]
    if not s.touch:  # in place of the base the tracker's frame, which gravity does not follow
        p = tips(arm, s, offset, start)
        for e in np.eye(3):
            columns += [np.tile(e, len(p)), np.cross(e, p).ravel()]
    return np.stack(columns, 1)


class Invisible(Exception):
    """No effect was drawn that this session could show."""


class Design:
    """One recording's projection. `signature` and `seen` take lists of effects."""

    def __init__(self, arm: Arm, s: Session):
        self.arm, self.s = arm, s
        jac = jacobian(arm, s)
        size = np.linalg.norm(jac, axis=0)
        q, r = np.linalg.qr(jac[:, size > 0] / size[size > 0])
        keep = np.abs(np.diag(r)) > 1e-9
        self.q = q[:, keep]
        self.without = simulate(arm, s)

    def signature(self, effects, free_of=()) -> np.ndarray:
        """(3N): how the effects move the residual, against the machine with only `free_of`."""
        without = self.without if not free_of else simulate(self.arm, self.s, free_of)
        with_ = simulate(self.arm, self.s, [*free_of, *effects], start=self.without.machine)
        if self.s.touch:
            d = self.read(with_) - self.read(without)
            return np.einsum("nij,nj->ni", self.without.r, d).ravel()
        return (with_.tcp - without.tcp + with_.machine.frame - without.machine.frame).ravel()

    def read(self, poses) -> np.ndarray:
        """Readings as the procedure leaves them: what the machine does, about where the arm was driven to."""
        base = readings(poses)
        if self.s.reading is None:
            return base
        # the planned residual readings are what a gauge's own error acts upon
        gauge = poses.machine.gauge - np.eye(3)
        here = readings(self.without)
        return base + np.einsum("nij,nj->ni", gauge, self.s.reading - here)

    def project(self, v: np.ndarray) -> np.ndarray:
        return v - self.q @ (self.q.T @ v)

    def lam(self, effects, free_of=()) -> float:
        return float(np.linalg.norm(self.project(self.signature(effects, free_of))) / self.s.sigma)

    def columns(self, effect: str, site: dict, variants) -> list[np.ndarray]:
        """Projected columns over sigma of each variant of a family at a site."""
        return [
            np.stack(
                [self.project(self.signature([{"effect": effect, "site": site, "p": p}])) / self.s.sigma for p in v], 1
            )
            for v in variants
        ]


def context(arm: Arm, s: Session) -> Context:
    return Context(arm, s, simulate(arm, s).machine.tau)


def everything(ctx: Context, touch: bool):
    """(effect, site, variants) of the whole catalogue for this kind of recording."""
    for name, family in FAMILIES.items():
        if family.touches if touch else family.tracker:
            for site in family.sites(ctx) if family.span else []:
                yield name, site, family.span(ctx, site)


def survey(
    design: Design, truths: list[dict], signatures: list[np.ndarray] | None = None
) -> tuple[list[dict], list[list[dict]]]:
    """What cannot be seen at all, and for each true effect what the data cannot tell from it.

    Cannot be seen: lambda below 2 for every variant at the large end of its typical sizes (lambda of one-column
    variants; of several columns, the largest direction of a unit combination). Cannot be told apart: what remains of
    the truth's signature after the other explanation did its best is below 3. `signatures`: where the truth moved
    another plant than this.
    """
    ctx = context(design.arm, design.s)
    # a recording says by how much commanded and reported joints differ, not why
    late = copy(design)
    late.s = replace(design.s, lag=design.s.lag + design.s.rest)
    signatures = signatures or [design.signature([e]) for e in truths]
    projected = [design.project(v) / design.s.sigma for v in signatures]
    unseen, alike = [], [[] for _ in truths]
    for name, site, variants in everything(ctx, design.s.touch):
        extra = []
        for e in truths:  # any diagnosis scans times and frequencies, so the truth's own are among the explanations
            at = e["p"].get("at")
            if isinstance(at, float) and name in ("joint_zero_shift", "fixture_shift", "tool_shift"):
                extra += [[{**p, "at": at} for p in variants[0]]]
            if name == e["effect"] == "gear_ripple":
                extra += [[{**p, "n": n} for n in np.atleast_1d(e["p"]["n"]) for p in variants[0]]]
        columns = (late if name == "late_joint_reading" else design).columns(name, site, [*variants, *extra])
        size = max(float(np.linalg.svd(c, compute_uv=False)[0]) for c in columns)
        # how far a late reading can matter is in the recording itself: there is nothing hidden to declare
        if size < 2.0 and name != "late_joint_reading":
            unseen.append({"effect": name, "site": site, "lambda": round(size, 3)})
        for k, e in enumerate(truths):
            if name == e["effect"] and site == e["site"]:
                continue
            for c in columns:
                if np.linalg.norm(c) < 1e-9:
                    continue
                fit = c @ np.linalg.lstsq(c, projected[k], rcond=1e-9)[0]
                if np.linalg.norm(projected[k]) >= 3.0 > np.linalg.norm(projected[k] - fit):
                    alike[k].append({"effect": name, "site": site})
                    break
    return unseen, alike
