"""Curves of one joint's own angle: encoders, gears with sidebands, and what looks like them."""

from __future__ import annotations

import numpy as np

from draws import EVERY_JOINT, Family, log_uniform, pick, wave, waves
from effects import ARCSEC
from plant import DEG


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


def same_gears(rng) -> dict[str, Family]:
    """Ripples of gears of one make: the same number at every joint."""
    n = int(rng.integers(50, 161))

    def draw(rng, c, s) -> dict:
        return {"n": n, **wave(rng, log_uniform(rng, 5 * ARCSEC, 30 * ARCSEC))}

    return {"gear_ripple": Family(EVERY_JOINT, draw, None)}


# name of the drawing -> (name of the effect, family); drawings of one effect differ in what the curve is
CURVES: dict[str, tuple[str, Family]] = {
    "encoder_error": (
        "encoder_error",
        Family(
            EVERY_JOINT,
            lambda rng, c, s: curve(rng, 0.02 * DEG, 0.12 * DEG, int(log_uniform(rng, 5, 51))),
            None,
        ),
    ),
    "sidebands": ("gear_ripple", Family(EVERY_JOINT, lambda rng, c, s: sidebands(rng), None)),
    "motor_side": ("gear_ripple", Family(EVERY_JOINT, lambda rng, c, s: motor_side(rng), None)),
    "out_turn_curve": ("out_turn_curve", Family(turned, turn_curve, None)),
}

# an encoder's error that is there besides: each of its waves is free, and smaller the shorter it is
REST_CURVE = Family(EVERY_JOINT, None, lambda c, s: [[w for n in range(1, 21) for w in waves(0.06 * DEG / n, n)]])
