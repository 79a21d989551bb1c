"""Families of effects: where each can sit, how big it typically is, and what spans it.

`FAMILIES[name]` draws a site and a size, and gives parameter sets that span the effect's linear family at a site, which
is what the scorer needs to know what the data can tell apart. Sizes are the "typical sizes on a small arm" of the
project's list of effects; nothing here comes from the workspace's code.
"""

from __future__ import annotations

import numpy as np

from draws import (
    EVERY_JOINT,
    Family,
    axes,
    here,
    inside,
    late_sites,
    loaded,
    log_uniform,
    parallel,
    pick,
    signed,
    spread_only,
    steps,
    stiffness,
    units,
    vector,
    wave,
    waves,
)
from effects import ARCSEC, _j
from plant import DEG, MM

# what is drawn, and what spans it, where a part is off from a moment on, or more and more
SHIFT = (
    lambda rng, c, s: {"by": vector(rng, 0.03 * MM, 0.25 * MM), "at": float(rng.uniform(0.25, 0.75))},
    lambda c, s: steps(lambda at: units(0.25 * MM, at=at)),
)
DRIFT = (
    lambda rng, c, s: {"by": vector(rng, 0.03 * MM, 0.25 * MM)},
    lambda c, s: [units(0.25 * MM)],
)

FAMILIES: dict[str, Family] = {
    "lost_motion_direction": Family(
        EVERY_JOINT,
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
        EVERY_JOINT,
        lambda rng, c, s: {"n": int(rng.integers(1, 7)), **wave(rng, log_uniform(rng, 0.005 * DEG, 0.03 * DEG))},
        lambda c, s: [waves(0.03 * DEG, n) for n in range(1, 7)],
    ),
    "gear_ripple": Family(
        EVERY_JOINT,
        lambda rng, c, s: {"n": int(rng.integers(10, 301)), **wave(rng, log_uniform(rng, 5 * ARCSEC, 30 * ARCSEC))},
        lambda c, s: [waves(30 * ARCSEC, n) for n in (30, 100, 200)],
    ),
    "gear_ratio": Family(EVERY_JOINT, lambda rng, c, s: {"k": signed(rng, 1e-4, 1e-3)}, lambda c, s: [[{"k": 1e-3}]]),
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
        EVERY_JOINT,
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
        EVERY_JOINT,
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
        EVERY_JOINT,
        lambda rng, c, s: {"per_k": signed(rng, 0.005 * DEG, 0.06 * DEG) / float(c.s.rise.max())},
        lambda c, s: [[{"per_k": 0.06 * DEG / float(c.s.rise.max())}]],
    ),
    "joint_zero_shift": Family(
        EVERY_JOINT,
        lambda rng, c, s: {"size": signed(rng, 0.01 * DEG, 0.06 * DEG), "at": float(rng.uniform(0.25, 0.75))},
        lambda c, s: steps(lambda at: [{"size": 0.06 * DEG, "at": at}]),
    ),
    "fixture_shift": Family(here("fixture"), *SHIFT, tracker=False),
    "fixture_drift": Family(here("fixture"), *DRIFT, tracker=False),
    "tool_shift": Family(here("tool"), *SHIFT),
    "tool_drift": Family(here("tool"), *DRIFT),
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


def _region(rng, c, s, size):
    of = s["joint"] if rng.random() < 0.6 else int(rng.integers(1, 7))
    x = c.s.q[:, of - 1]
    threshold, above = inside(rng, x), bool(rng.random() < 0.5)
    beyond = float(x.max() - threshold if above else threshold - x.min())
    return {"of": of, "threshold": threshold, "above": above, "size": size, "range": beyond}


OUTSIDE: dict[str, Family] = {
    "out_region_step": Family(
        EVERY_JOINT, lambda rng, c, s: _region(rng, c, s, signed(rng, 0.01 * DEG, 0.06 * DEG)), None
    ),
    "out_region_ramp": Family(
        EVERY_JOINT, lambda rng, c, s: _region(rng, c, s, signed(rng, 0.02 * DEG, 0.12 * DEG)), None
    ),
    "out_cable_drag": Family(
        EVERY_JOINT,
        lambda rng, c, s: {
            "size": signed(rng, 0.01 * DEG, 0.06 * DEG),
            "with": pick(rng, [j for j in range(1, 7) if j != s["joint"]]),
            "phase": float(rng.uniform(0, 2 * np.pi)),
            "phase_with": float(rng.uniform(-1, 1)),
        },
        None,
    ),
    "out_square_wave": Family(
        EVERY_JOINT,
        lambda rng, c, s: {
            "size": signed(rng, 0.005 * DEG, 0.03 * DEG),
            "n": int(rng.integers(7, 10)),  # whose first wave is neither a joint harmonic nor a ripple of the catalogue
            "phase": float(rng.uniform(0, 2 * np.pi)),
        },
        None,
    ),
    "out_hysteresis_memory": Family(
        EVERY_JOINT,
        lambda rng, c, s: {"size": log_uniform(rng, 0.01 * DEG, 0.06 * DEG), "keep": float(rng.uniform(0.6, 0.9))},
        None,
    ),
    "out_backlash_change": Family(
        EVERY_JOINT,
        lambda rng, c, s: {
            "gap": log_uniform(rng, 30 * ARCSEC, 150 * ARCSEC),
            "at": float(rng.uniform(0.3, 0.7)),
        },
        None,
    ),
    "out_creep": Family(
        # without a thermometer this would be the catalogue's own warm-up
        lambda c: EVERY_JOINT(c) if c.s.has_thermometer else [],
        lambda rng, c, s: {
            "size": signed(rng, 0.02 * DEG, 0.08 * DEG),
            "tau_s": float(rng.uniform(0.06, 0.15)) * float(c.s.t[-1] - c.s.t[0]),
        },
        None,
    ),
    "out_quantised_encoder": Family(
        EVERY_JOINT, lambda rng, c, s: {"step": log_uniform(rng, 0.01 * DEG, 0.05 * DEG)}, None
    ),
    "out_overshoot": Family(EVERY_JOINT, lambda rng, c, s: {"size": signed(rng, 0.01 * DEG, 0.06 * DEG)}, None),
    "out_bump": Family(
        EVERY_JOINT,
        lambda rng, c, s: {
            "size": signed(rng, 0.02 * DEG, 0.06 * DEG),
            "centre": inside(rng, c.s.q[:, s["joint"] - 1]),
            "width": float(rng.uniform(4, 10)) * DEG,
        },
        None,
    ),
}
