"""What an effect does to the machine, how big it typically is, and at which sites it can sit.

`ACT[name](machine, session, arm, site, p)` moves the machine. `FAMILIES[name]` draws a site and a size, and gives
parameter sets that span the effect's linear family at a site, which is what the scorer needs to know what the data can
tell apart. Sizes are the "typical sizes on a small arm" of the project's list of effects; nothing here comes from the
workspace's code.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from plant import DEG, MM, rot_vector

ARCSEC = DEG / 3600.0
AXES = {"x": 0, "y": 1, "z": 2}
ACT: dict[str, Callable] = {}


def act(f):
    ACT[f.__name__] = f
    return f


def _j(site) -> int:
    return site["joint"] - 1


# ---- the catalogue -----------------------------------------------------------------------------------------------


@act
def lost_motion_direction(m, s, arm, site, p):
    j = _j(site)
    m.angle[:, j] -= 0.5 * p["gap"] * s.dirs[:, j]


@act
def load_friction(m, s, arm, site, p):
    j = _j(site)
    m.angle[:, j] -= s.dirs[:, j] * (0.5 * p["gap"] + p["per_nm"] * np.abs(m.tau[:, j]))


@act
def lost_motion_gravity(m, s, arm, site, p):
    j = _j(site)
    tau = m.tau[:, j]
    m.angle[:, j] += 0.5 * p["gap"] * tau / np.sqrt(tau**2 + p["soft_nm"] ** 2)


@act
def joint_harmonic(m, s, arm, site, p):
    """One wave a turn, or a list of them."""
    j = _j(site)
    x = np.multiply.outer(s.q[:, j], np.atleast_1d(p["n"]))
    m.angle[:, j] += np.sin(x) @ np.atleast_1d(p["sin"]) + np.cos(x) @ np.atleast_1d(p["cos"])


ACT["gear_ripple"] = ACT["encoder_error"] = joint_harmonic


@act
def gear_ratio(m, s, arm, site, p):
    j = _j(site)
    m.angle[:, j] += p["k"] * s.q[:, j]


@act
def joint_coupling(m, s, arm, site, p):
    m.angle[:, _j(site)] += p["k"] * s.q[:, site["from"] - 1]


@act
def nonlinear_stiffness(m, s, arm, site, p):
    j = _j(site)
    x = m.tau[:, j] / p["scale_nm"]
    shape = {
        "soft_start": lambda: np.clip(x / p["until"], -1, 1),
        "square": lambda: x * np.abs(x),
        "cube": lambda: x**3,
    }
    m.angle[:, j] += p["size"] * shape[p["shape"]]()


@act
def cross_axis_compliance(m, s, arm, site, p):
    j = _j(site)
    m.back[j] = p["back"]
    m.tilt[:, j, :2] += p["k"] * m.moment_at(j, p["back"] * arm.d[j])[:, :2]


@act
def axis_twist(m, s, arm, site, p):
    m.beta[_j(site)] += p["beta"]


@act
def axis_wobble(m, s, arm, site, p):
    # the tilt has a fixed plane in the frame before the joint turns; {j} turns with the joint
    j = _j(site)
    q = s.q[:, j]
    theta = q + arm.offset[j]
    size = p["sin"] * np.sin(p["n"] * q) + p["cos"] * np.cos(p["n"] * q)
    m.back[j] = p["back"]
    m.tilt[:, j, 0] += size * np.cos(p["plane"] - theta)
    m.tilt[:, j, 1] += size * np.sin(p["plane"] - theta)


@act
def gravity_direction(m, s, arm, site, p):
    v = np.array([[p["about_x"], p["about_y"], 0.0]])
    m.down = rot_vector(v)[0] @ m.down


@act
def payload(m, s, arm, site, p):
    # more mass at a place of its own; a pure error of the centre of gravity is a pair of masses
    if p["mass"] != 0.0:
        m.extra_mass, m.extra_cog = p["mass"], np.array(p["at"])
    else:
        m.extra_mass = 1e-9
        m.extra_cog = np.array(p["at"]) * arm.tool_mass / 1e-9


@act
def thermal_growth(m, s, arm, site, p):
    m.growth *= 1.0 + p["per_k"] * s.rise


@act
def thermal_zero_drift(m, s, arm, site, p):
    m.angle[:, _j(site)] += p["per_k"] * s.rise


def _after(s, p):
    return (s.progress > p["at"]).astype(float)


@act
def joint_zero_shift(m, s, arm, site, p):
    m.angle[:, _j(site)] += p["size"] * _after(s, p)


@act
def fixture_shift(m, s, arm, site, p):
    m.fixture += np.outer(_after(s, p), p["by"])


@act
def fixture_drift(m, s, arm, site, p):
    m.fixture += np.outer(s.progress, p["by"])


@act
def tool_shift(m, s, arm, site, p):
    m.tool += np.outer(_after(s, p), p["by"])


@act
def tool_drift(m, s, arm, site, p):
    m.tool += np.outer(s.progress, p["by"])


@act
def frame_drift(m, s, arm, site, p):
    m.frame += np.outer(s.progress, p["by"])


@act
def ball_position(m, s, arm, site, p):
    m.ball_shift[site["ball"] - 1] += p["by"]


@act
def indicator_gain(m, s, arm, site, p):
    i = AXES[site["axis"]]
    m.gauge[:, i, :] *= 1.0 + p["g"]


@act
def indicator_skew(m, s, arm, site, p):
    m.gauge[:, AXES[site["axis"]], AXES[p["from"]]] += p["e"]


@act
def indicator_drift(m, s, arm, site, p):
    m.gauge_drift[:, AXES[site["axis"]]] += p["per_h"] * (s.t - s.t[0]) / 3600.0


@act
def late_joint_reading(m, s, arm, site, p):
    joints = range(6) if site.get("joints") else [_j(site)]
    for j in joints:
        m.angle[:, j] += p["share"] * s.lag[:, j]


# ---- outside the catalogue ---------------------------------------------------------------------------------------


@act
def out_region_step(m, s, arm, site, p):
    """A joint is off by a constant where an angle (its own, or another's) is beyond a threshold."""
    x = s.q[:, p["of"] - 1]
    m.angle[:, _j(site)] += p["size"] * ((x > p["threshold"]) if p["above"] else (x < p["threshold"]))


@act
def out_region_ramp(m, s, arm, site, p):
    """Beyond a threshold the error grows with the square of the angle."""
    x = s.q[:, p["of"] - 1]
    beyond = np.maximum(0.0, x - p["threshold"] if p["above"] else p["threshold"] - x)
    m.angle[:, _j(site)] += p["size"] * (beyond / p["range"]) ** 2


@act
def out_cable_drag(m, s, arm, site, p):
    """A cable pulls joint j, and how hard depends on two joints at once."""
    j, k = _j(site), p["with"] - 1
    m.angle[:, j] += p["size"] * np.sin(s.q[:, j] + p["phase"]) * np.maximum(0.0, np.cos(s.q[:, k] - p["phase_with"]))


@act
def out_square_wave(m, s, arm, site, p):
    """A stepped error of the encoder: positive and negative sectors."""
    j = _j(site)
    m.angle[:, j] += p["size"] * np.sign(np.sin(p["n"] * s.q[:, j] + p["phase"]))


@act
def out_hysteresis_memory(m, s, arm, site, p):
    """The joint remembers more than its last motion: a leaky sum of past moves."""
    j = _j(site)
    step = np.diff(np.concatenate([[0.0], s.q[:, j]])) / DEG
    state, out = 0.0, np.empty(len(step))
    for i, x in enumerate(np.clip(step / 30.0, -1, 1)):
        state = p["keep"] * state + (1 - p["keep"]) * x
        out[i] = state
    m.angle[:, j] += p["size"] * out


@act
def out_backlash_change(m, s, arm, site, p):
    """Backlash that opens in the middle of the session: a tooth breaks, a screw comes loose."""
    j = _j(site)
    m.angle[:, j] -= 0.5 * p["gap"] * s.dirs[:, j] * _after(s, p)


@act
def out_creep(m, s, arm, site, p):
    """A joint settles exponentially after the start, much faster than the arm warms up."""
    m.angle[:, _j(site)] += p["size"] * np.exp(-(s.t - s.t[0]) / p["tau_s"])


@act
def out_quantised_encoder(m, s, arm, site, p):
    """Coarse encoder: the real angle is off by what lies between two steps."""
    j = _j(site)
    x = s.q[:, j] / p["step"]
    m.angle[:, j] += p["step"] * (x - np.round(x))


@act
def out_overshoot(m, s, arm, site, p):
    """The error grows with the distance of the last move (heat, ringing), either sense."""
    j = _j(site)
    step = np.abs(np.diff(np.concatenate([[0.0], s.q[:, j]])))
    m.angle[:, j] += p["size"] * step / np.maximum(step.max(), 1e-9)


@act
def out_bump(m, s, arm, site, p):
    """A damaged tooth: an error around one angle only."""
    j = _j(site)
    m.angle[:, j] += p["size"] * np.exp(-0.5 * ((s.q[:, j] - p["centre"]) / p["width"]) ** 2)


@act
def out_turn_curve(m, s, arm, site, p):
    """A smooth curve over the joint's whole stroke that is another one on the next turn: no encoder's."""
    j = _j(site)
    x = np.multiply.outer(s.q[:, j] + p["from"], 2 * np.pi * np.array(p["waves"]) / p["stroke"])
    m.angle[:, j] += np.sin(x) @ p["sin"] + np.cos(x) @ p["cos"]


# ---- drawing -----------------------------------------------------------------------------------------------------


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


FAMILIES: dict[str, Family] = {
    "lost_motion_direction": Family(
        joints(1, 2, 3, 4, 5, 6),
        lambda rng, c, s: {"gap": log_uniform(rng, 2 * ARCSEC, 120 * ARCSEC)},
        lambda c, s: [[{"gap": 120 * ARCSEC}]],
    ),
    "load_friction": Family(
        loaded(2, 3, 4, 5, 6),
        lambda rng, c, s: {
            "gap": log_uniform(rng, 2 * ARCSEC, 40 * ARCSEC),
            "per_nm": log_uniform(rng, 5 * ARCSEC, 60 * ARCSEC) / c.tau_max(s["joint"]),
        },
        lambda c, s: [
            [{"gap": 60 * ARCSEC, "per_nm": 0.0}, {"gap": 0.0, "per_nm": 60 * ARCSEC / c.tau_max(s["joint"])}]
        ],
    ),
    "lost_motion_gravity": Family(
        loaded(2, 3, 4, 5, 6),
        lambda rng, c, s: {
            "gap": log_uniform(rng, 0.01 * DEG, 0.04 * DEG),
            "soft_nm": float(rng.uniform(0.03, 0.15)) * c.tau_max(s["joint"]),
        },
        lambda c, s: [[{"gap": 0.04 * DEG, "soft_nm": x * c.tau_max(s["joint"])}] for x in (0.02, 0.05, 0.1, 0.2)],
    ),
    "joint_harmonic": Family(
        joints(1, 2, 3, 4, 5, 6),
        lambda rng, c, s: {"n": int(rng.integers(1, 7)), **wave(rng, log_uniform(rng, 0.005 * DEG, 0.03 * DEG))},
        lambda c, s: [waves(0.03 * DEG, n) for n in range(1, 7)],
    ),
    "gear_ripple": Family(
        joints(1, 2, 3, 4, 5, 6),
        lambda rng, c, s: {"n": int(rng.integers(10, 301)), **wave(rng, log_uniform(rng, 5 * ARCSEC, 30 * ARCSEC))},
        lambda c, s: [waves(30 * ARCSEC, n) for n in (30, 100, 200)],
    ),
    "gear_ratio": Family(
        joints(1, 2, 3, 4, 5, 6), lambda rng, c, s: {"k": signed(rng, 1e-4, 1e-3)}, lambda c, s: [[{"k": 1e-3}]]
    ),
    "joint_coupling": Family(
        lambda c: [{"joint": a, "from": b} for a, b in ((5, 4), (6, 5), (6, 4), (3, 2))],
        lambda rng, c, s: {"k": signed(rng, 2e-4, 2e-3)},
        lambda c, s: [[{"k": 2e-3}]],
    ),
    "nonlinear_stiffness": Family(
        loaded(2, 3, 4, 5, 6),
        lambda rng, c, s: stiffness(
            c,
            s,
            float(rng.uniform(0.15, 0.5)),
            pick(rng, ["soft_start", "square", "cube"]),
            float(rng.uniform(0.2, 0.6)),
        ),
        # a diagnosis scans shape constants, so what can be told apart is asked of several
        lambda c, s: [
            *([stiffness(c, s, 0.5, "soft_start", until)] for until in (0.15, 0.3, 0.5)),
            *([stiffness(c, s, 0.5, x, 1.0)] for x in ("square", "cube")),
        ],
    ),
    "cross_axis_compliance": Family(
        joints(1, 2, 3, 4, 5, 6),
        lambda rng, c, s: {
            "k": log_uniform(rng, 1e-5, 4e-4) / c.arm.pull,
            "back": 1.0 if _j(s) == 0 else float(rng.random()),
        },
        lambda c, s: [[{"k": 4e-4 / c.arm.pull, "back": back}] for back in ((1.0,) if _j(s) == 0 else (0.0, 1.0))],
    ),
    "axis_twist": Family(
        parallel, lambda rng, c, s: {"beta": signed(rng, 0.01 * DEG, 0.1 * DEG)}, lambda c, s: [[{"beta": 0.1 * DEG}]]
    ),
    "axis_wobble": Family(
        joints(1, 2, 3, 4, 5, 6),
        lambda rng, c, s: {
            "n": int(rng.integers(1, 3)),
            "plane": float(rng.uniform(0, np.pi)),
            "back": float(rng.random()),
            **wave(rng, log_uniform(rng, 0.003 * DEG, 0.03 * DEG)),
        },
        lambda c, s: [
            [*waves(0.03 * DEG, n, plane=0.0, back=back), *waves(0.03 * DEG, n, plane=np.pi / 2, back=back)]
            for n in (1, 2)
            for back in (0.0, 1.0)
        ],
    ),
    "gravity_direction": Family(
        here("base"),
        lambda rng, c, s: dict(zip(("about_x", "about_y"), vector(rng, 0.5 * DEG, 2 * DEG, 2), strict=False)),
        lambda c, s: [[{"about_x": 2 * DEG, "about_y": 0.0}, {"about_x": 0.0, "about_y": 2 * DEG}]],
    ),
    "payload": Family(
        here("tool"),
        lambda rng, c, s: (
            {"mass": c.arm.weight * log_uniform(rng, 0.2, 1.0), "at": list(c.arm.tool_cog + rng.normal(0, 0.02, 3))}
            if rng.random() < 0.5
            else {"mass": 0.0, "at": vector(rng, 0.01, 0.05)}
        ),
        lambda c, s: [
            [{"mass": c.arm.weight, "at": list(c.arm.tool_cog)}, *({"mass": 0.0, "at": u["by"]} for u in units(0.05))]
        ],
    ),
    "thermal_growth": Family(
        here("links"), lambda rng, c, s: {"per_k": float(rng.uniform(12e-6, 26e-6))}, lambda c, s: [[{"per_k": 26e-6}]]
    ),
    "thermal_zero_drift": Family(
        joints(1, 2, 3, 4, 5, 6),
        lambda rng, c, s: {"per_k": signed(rng, 0.005 * DEG, 0.06 * DEG) / float(c.s.rise.max())},
        lambda c, s: [[{"per_k": 0.06 * DEG / float(c.s.rise.max())}]],
    ),
    "joint_zero_shift": Family(
        joints(1, 2, 3, 4, 5, 6),
        lambda rng, c, s: {"size": signed(rng, 0.01 * DEG, 0.06 * DEG), "at": float(rng.uniform(0.25, 0.75))},
        lambda c, s: steps(lambda at: [{"size": 0.06 * DEG, "at": at}]),
    ),
    "fixture_shift": Family(
        here("fixture"),
        lambda rng, c, s: {"by": vector(rng, 0.03 * MM, 0.25 * MM), "at": float(rng.uniform(0.25, 0.75))},
        lambda c, s: steps(lambda at: units(0.25 * MM, at=at)),
        tracker=False,
    ),
    "fixture_drift": Family(
        here("fixture"),
        lambda rng, c, s: {"by": vector(rng, 0.03 * MM, 0.25 * MM)},
        lambda c, s: [units(0.25 * MM)],
        tracker=False,
    ),
    "tool_shift": Family(
        here("tool"),
        lambda rng, c, s: {"by": vector(rng, 0.03 * MM, 0.25 * MM), "at": float(rng.uniform(0.25, 0.75))},
        lambda c, s: steps(lambda at: units(0.25 * MM, at=at)),
    ),
    "tool_drift": Family(
        here("tool"),
        lambda rng, c, s: {"by": vector(rng, 0.03 * MM, 0.25 * MM)},
        lambda c, s: [units(0.25 * MM)],
    ),
    "frame_drift": Family(
        here("frame"),
        lambda rng, c, s: {"by": vector(rng, 0.01 * MM, 0.2 * MM)},
        lambda c, s: [units(0.2 * MM)],
        touches=False,
    ),
    "ball_position": Family(
        lambda c: [{"ball": k + 1} for k in range(len(c.arm.balls))],
        lambda rng, c, s: {"by": vector(rng, 0.01 * MM, 0.2 * MM, 2)},
        lambda c, s: [units(0.2 * MM)[:2]],
        tracker=False,
    ),
    "indicator_gain": Family(
        spread_only(axes),
        lambda rng, c, s: {"g": signed(rng, 0.005, 0.08)},
        lambda c, s: [[{"g": 0.08}]],
        tracker=False,
    ),
    "indicator_skew": Family(
        spread_only(axes),
        lambda rng, c, s: {
            "e": signed(rng, 0.5 * DEG, 1.5 * DEG),
            "from": [a for a in "xyz" if a != s["axis"]][rng.integers(2)],
        },
        lambda c, s: [[{"e": 1.5 * DEG, "from": a} for a in "xyz" if a != s["axis"]]],
        tracker=False,
    ),
    "indicator_drift": Family(
        axes,
        lambda rng, c, s: {"per_h": signed(rng, 0.01 * MM, 0.06 * MM)},
        lambda c, s: [[{"per_h": 0.06 * MM}]],
        tracker=False,
    ),
    "late_joint_reading": Family(
        late_sites, lambda rng, c, s: {"share": float(rng.uniform(0.6, 1.0))}, lambda c, s: [[{"share": 1.0}]]
    ),
}


def pick(rng, options):
    return options[int(rng.integers(len(options)))]


def inside(rng, x, low=0.2, high=0.8) -> float:
    """An angle that has rows on both sides of it."""
    return float(np.quantile(x, rng.uniform(low, high)))


def _region(rng, c, s, size):
    of = s["joint"] if rng.random() < 0.6 else int(rng.integers(1, 7))
    x = c.s.q[:, of - 1]
    threshold, above = inside(rng, x), bool(rng.random() < 0.5)
    beyond = float(x.max() - threshold if above else threshold - x.min())
    return {"of": of, "threshold": threshold, "above": above, "size": size, "range": beyond}


OUTSIDE: dict[str, Family] = {
    "out_region_step": Family(
        joints(1, 2, 3, 4, 5, 6), lambda rng, c, s: _region(rng, c, s, signed(rng, 0.01 * DEG, 0.06 * DEG)), None
    ),
    "out_region_ramp": Family(
        joints(1, 2, 3, 4, 5, 6), lambda rng, c, s: _region(rng, c, s, signed(rng, 0.02 * DEG, 0.12 * DEG)), None
    ),
    "out_cable_drag": Family(
        joints(1, 2, 3, 4, 5, 6),
        lambda rng, c, s: {
            "size": signed(rng, 0.01 * DEG, 0.06 * DEG),
            "with": pick(rng, [j for j in range(1, 7) if j != s["joint"]]),
            "phase": float(rng.uniform(0, 2 * np.pi)),
            "phase_with": float(rng.uniform(-1, 1)),
        },
        None,
    ),
    "out_square_wave": Family(
        joints(1, 2, 3, 4, 5, 6),
        lambda rng, c, s: {
            "size": signed(rng, 0.005 * DEG, 0.03 * DEG),
            "n": int(rng.integers(7, 10)),  # whose first wave is neither a joint harmonic nor a ripple of the catalogue
            "phase": float(rng.uniform(0, 2 * np.pi)),
        },
        None,
    ),
    "out_hysteresis_memory": Family(
        joints(1, 2, 3, 4, 5, 6),
        lambda rng, c, s: {"size": log_uniform(rng, 0.01 * DEG, 0.06 * DEG), "keep": float(rng.uniform(0.6, 0.9))},
        None,
    ),
    "out_backlash_change": Family(
        joints(1, 2, 3, 4, 5, 6),
        lambda rng, c, s: {
            "gap": log_uniform(rng, 30 * ARCSEC, 150 * ARCSEC),
            "at": float(rng.uniform(0.3, 0.7)),
        },
        None,
    ),
    "out_creep": Family(
        # without a thermometer this would be the catalogue's own warm-up
        lambda c: joints(1, 2, 3, 4, 5, 6)(c) if c.s.has_thermometer else [],
        lambda rng, c, s: {
            "size": signed(rng, 0.02 * DEG, 0.08 * DEG),
            "tau_s": float(rng.uniform(0.06, 0.15)) * float(c.s.t[-1] - c.s.t[0]),
        },
        None,
    ),
    "out_quantised_encoder": Family(
        joints(1, 2, 3, 4, 5, 6), lambda rng, c, s: {"step": log_uniform(rng, 0.01 * DEG, 0.05 * DEG)}, None
    ),
    "out_overshoot": Family(
        joints(1, 2, 3, 4, 5, 6), lambda rng, c, s: {"size": signed(rng, 0.01 * DEG, 0.06 * DEG)}, None
    ),
    "out_bump": Family(
        joints(1, 2, 3, 4, 5, 6),
        lambda rng, c, s: {
            "size": signed(rng, 0.02 * DEG, 0.06 * DEG),
            "centre": inside(rng, c.s.q[:, s["joint"] - 1]),
            "width": float(rng.uniform(4, 10)) * DEG,
        },
        None,
    ),
}


# ---- curves of one joint's own angle -----------------------------------------------------------------------------


def curve(rng, low, high, most, cycles=1.0):
    """Waves 1 to `most` of random phase whose size falls like 1/n to 1/sqrt(n), `low` to `high` from peak to peak."""
    n = np.arange(1, most + 1)
    size = np.abs(rng.normal(1.0, 0.4, most)) / n ** rng.uniform(0.5, 1.0)
    phase = rng.uniform(0, 2 * np.pi, most)
    x = np.multiply.outer(np.linspace(0, 2 * np.pi, 2000), n)
    y = np.sin(x) @ (size * np.sin(phase)) + np.cos(x) @ (size * np.cos(phase))
    size = size * log_uniform(rng, low, high) / (y.max() - y.min())
    return {"n": (n * cycles).tolist(), "sin": (size * np.sin(phase)).tolist(), "cos": (size * np.cos(phase)).tolist()}


def sidebands(rng) -> dict:
    """A gear's line, what modulates it once and twice a turn of the joint, and its second and third harmonics."""
    n = pick(rng, [50, 80, 100, 101, 120, 121, 160])
    side = [n - 2, n - 1, n + 1, n + 2, 2 * n, 3 * n]
    kept = [x for x in side if rng.random() < 0.6] or [2 * n]
    size = log_uniform(rng, 8 * ARCSEC, 30 * ARCSEC)
    sizes = [size, *(size * rng.uniform(0.15, 0.5, len(kept)))]
    waves = [wave(rng, x) for x in sizes]
    return {"n": [n, *kept], "sin": [w["sin"] for w in waves], "cos": [w["cos"] for w in waves]}


def motor_side(rng) -> dict:
    """The encoder sits on the motor: its curve comes `gear` times a turn of the joint, and is told as the gear's."""
    return curve(rng, 0.01 * DEG, 0.04 * DEG, int(rng.integers(1, 4)), pick(rng, [50, 80, 100, 101, 120]))


def turn_curve(rng, c, s) -> dict:
    q = c.s.q[:, s["joint"] - 1]
    p = curve(rng, 0.02 * DEG, 0.12 * DEG, int(rng.integers(4, 20)))
    return {
        "waves": p["n"],
        "sin": p["sin"],
        "cos": p["cos"],
        "from": -float(q.min()),
        "stroke": 1.2 * float(np.ptp(q)),
    }


def turned(ctx):
    """Joints whose poses go beyond one turn by a third of one or more."""
    return [{"joint": j + 1} for j in range(ctx.s.q.shape[1]) if np.ptp(ctx.s.q[:, j]) > 2.67 * np.pi]


# name of the drawing -> (name of the effect, family); drawings of one effect differ in what the curve is
CURVES: dict[str, tuple[str, Family]] = {
    "encoder_error": (
        "encoder_error",
        Family(
            joints(1, 2, 3, 4, 5, 6),
            lambda rng, c, s: curve(rng, 0.02 * DEG, 0.12 * DEG, int(log_uniform(rng, 5, 51))),
            None,
        ),
    ),
    "sidebands": ("gear_ripple", Family(joints(1, 2, 3, 4, 5, 6), lambda rng, c, s: sidebands(rng), None)),
    "motor_side": ("gear_ripple", Family(joints(1, 2, 3, 4, 5, 6), lambda rng, c, s: motor_side(rng), None)),
    "out_turn_curve": ("out_turn_curve", Family(turned, turn_curve, None)),
}

# an encoder's error that is there besides: each of its waves is free, and smaller the shorter it is
REST_CURVE = Family(
    joints(1, 2, 3, 4, 5, 6), None, lambda c, s: [[w for n in range(1, 21) for w in waves(0.06 * DEG / n, n)]]
)

# ---- families of effects, for what is sure when the name is not --------------------------------------------------

FAMILIES_OF_EFFECTS = {
    "transmission": "joint_harmonic gear_ripple encoder_error gear_ratio joint_coupling",
    "lost_motion": "lost_motion_direction lost_motion_gravity load_friction",
    "elasticity": "nonlinear_stiffness cross_axis_compliance",
    "geometry": "axis_twist axis_wobble rail_error",
    "load": "payload gravity_direction",
    "heat": "thermal_growth thermal_zero_drift",
    "something_moved": "joint_zero_shift fixture_shift fixture_drift tool_shift tool_drift frame_drift",
    "gauge": "indicator_gain indicator_skew indicator_drift ball_position",
    "reading": "late_joint_reading",
}
FAMILY_OF = {effect: family for family, effects in FAMILIES_OF_EFFECTS.items() for effect in effects.split()}


def variable_of(effect: dict) -> list[str]:
    """Covariates by which an effect outside the catalogue may rightly be located."""
    j, p = effect["site"]["joint"], effect["p"]
    return {
        "out_region_step": lambda: [f"q{p['of']}"],
        "out_region_ramp": lambda: [f"q{p['of']}"],
        "out_cable_drag": lambda: [f"q{j}", f"q{p['with']}"],
        "out_square_wave": lambda: [f"q{j}"],
        "out_hysteresis_memory": lambda: [f"dir{j}", f"travel{j}", f"q{j}"],
        "out_backlash_change": lambda: ["t", "time", "t_s", f"dir{j}"],
        "out_creep": lambda: ["t", "time", "t_s", "temp", "temp_c"],
        "out_quantised_encoder": lambda: [f"q{j}"],
        "out_overshoot": lambda: [f"travel{j}"],
        "out_bump": lambda: [f"q{j}"],
        "out_turn_curve": lambda: [f"q{j}"],
    }[effect["effect"]]()


def threshold_of(effect: dict) -> float | None:
    """The angle (deg) at which a region begins, where the effect has one sharp region."""
    return effect["p"]["threshold"] / DEG if effect["effect"] == "out_region_step" else None
