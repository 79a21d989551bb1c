"""How the size of an effect is drawn, and at which sites it can sit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from plant import MM


def log_uniform(rng, low, high) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def signed(rng, low, high) -> float:
    return log_uniform(rng, low, high) * (1 if rng.random() < 0.5 else -1)


def vector(rng, low, high, dims=3) -> list[float]:
    v = rng.normal(size=3)
    v[dims:] = 0.0
    return list(log_uniform(rng, low, high) * v / np.linalg.norm(v))


@dataclass
class Context:
    """What a draw may know: the session at its planned poses, and gravity's torques there."""

    arm: object
    s: object
    tau: np.ndarray

    def tau_max(self, j) -> float:
        return float(np.abs(self.tau[:, j - 1]).max())


@dataclass
class Family:
    """`sites(ctx)`; `draw(rng, ctx, site)` -> p; `span(ctx, site)` -> variants, each a list of p that span it linearly
    at the large end of the typical sizes."""

    sites: Callable
    draw: Callable
    span: Callable
    touches: bool = True
    tracker: bool = True


# Tilts turn about a point of the axis, `back` of the offset d before the origin of the joint's frame: the bearing is
# somewhere on it. At joint 1 base and table give way, at the foot.


def joints(*js):
    """Joints that turn."""
    return lambda ctx: [{"joint": j} for j in js if not (ctx.arm.slides and ctx.arm.slides[j - 1])]


EVERY_JOINT = joints(1, 2, 3, 4, 5, 6)


def loaded(*js):
    """Joints that gravity turns at all: a load on the axis of joint 6 leaves nothing for an effect of torque."""
    return lambda ctx: [{"joint": j} for j in js if ctx.tau_max(j) > 0.01]


def parallel(ctx):
    """Joints whose axis is parallel to the one before."""
    return [{"joint": j + 1} for j in range(1, 6) if abs(np.sin(ctx.arm.alpha[j])) < 0.1]


def here(name):
    return lambda ctx: [{name: True}]


def axes(ctx):
    return [{"axis": a} for a in "xyz"]


def wave(rng, size):
    phase = rng.uniform(0, 2 * np.pi)
    return {"sin": size * float(np.sin(phase)), "cos": size * float(np.cos(phase))}


def waves(size, n, **more):
    return [{"n": n, "sin": size, "cos": 0.0, **more}, {"n": n, "sin": 0.0, "cos": size, **more}]


def steps(make):
    return [make(at) for at in (0.3, 0.5, 0.7)]


def units(size, key="by", **more):
    return [{key: [size * float(i == k) for i in range(3)], **more} for k in range(3)]


def spread_only(sites):
    """Indicator effects need readings with a spread; the procedure leaves one only where it does not null them."""
    return lambda ctx: sites(ctx) if ctx.s.spread > 0.1 * MM else []


def late_sites(ctx):
    if not ctx.s.has_commanded:
        return []
    return [{"joints": True}] * 3 + [{"joint": j} for j in range(1, 7)]


def stiffness(ctx, site, share, shape, until):
    j = site["joint"]
    tau = ctx.tau_max(j)
    return {"shape": shape, "until": until, "scale_nm": tau, "size": share * float(ctx.arm.compliance[j - 1]) * tau}


def pick(rng, options):
    return options[int(rng.integers(len(options)))]


def inside(rng, x, low=0.2, high=0.8) -> float:
    """An angle that has rows on both sides of it."""
    return float(np.quantile(x, rng.uniform(low, high)))
