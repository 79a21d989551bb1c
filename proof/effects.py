"""What an effect does to the machine, to which family it belongs, and by what it may be located.

`ACT[name](machine, session, arm, site, p)` moves the machine; `families.py` has where effects sit and how big they are.
Nothing here comes from the workspace's code.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from plant import DEG, rot_vector

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
