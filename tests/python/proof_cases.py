"""What the tests of the proof suite share."""

from __future__ import annotations

import numpy as np

import make
from arms import nominal_arm
from plant import Arm, Session, true_arm


def arm_and_session(seed: int, n: int = 40, touch: bool = True) -> tuple[Arm, Session]:
    rng = np.random.default_rng(seed)
    nominal = nominal_arm(rng)
    arm = true_arm(nominal, rng)
    return arm, make.plan(nominal, rng, n, touch)


GAP2 = {"effect": "lost_motion_direction", "site": {"joint": 2}}
FRICTION2 = {"effect": "load_friction", "site": {"joint": 2}}
RIPPLE4 = {"effect": "gear_ripple", "site": {"joint": 4}}
WOBBLE5 = {"effect": "axis_wobble", "site": {"joint": 5}}
TWIST = {"effect": "axis_twist", "site": {"joint": 3}}


def found(effect: dict, confidence: float = 0.95, rivals: tuple[dict, ...] = ()) -> dict:
    return {**effect, "confidence": confidence, "lambda": 9.0, "rivals": list(rivals)}
