"""The proof suite's second plant, in MuJoCo, against the closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import configurations
from plant import MM, frames, simulate
from proof_cases import arm_and_session


@pytest.fixture
def bench():
    pytest.importorskip("mujoco", reason="MuJoCo is not installed: it needs Python 3.11 or newer")
    import mujoco_plant

    return mujoco_plant


def test_an_arm_without_effects_is_the_same_in_mujoco(bench) -> None:
    for seed in (13, 14):
        arm, s = arm_and_session(seed, 10)
        there, here = bench.experiment(arm, s), simulate(arm, s)
        rigid = simulate(arm.but(compliance=np.zeros(6)), s)
        assert np.abs(rigid.tcp - here.tcp).max() > 0.1 * MM, "nothing gives way: the comparison would say little"
        assert np.abs(there.tcp - here.tcp).max() < 0.5e-6
        assert np.abs(there.r - here.r).max() < 2e-6


MECHANICAL = [
    ({"effect": "lost_motion_direction", "site": {"joint": 1}}, {"gap": 4e-4, "friction_nm": 5.0}, {"gap": 4.5e-4}),
    ({"effect": "lost_motion_direction", "site": {"joint": 3}}, {"friction_nm": 1.0}, {"gap": "2 * friction / k"}),
    ({"effect": "lost_motion_gravity", "site": {"joint": 5}}, {"gap": 5e-4}, {"gap": 5e-4, "soft_nm": 1e-9}),
    (
        {"effect": "cross_axis_compliance", "site": {"joint": 4}},
        {"k": 2e-4, "back": 0.3},
        {"k": 2e-4, "back": 0.3},
    ),
    ({"effect": "joint_coupling", "site": {"joint": 5, "from": 4}}, {"k": 1e-3}, {"k": 1e-3}),
    ({"effect": "payload", "site": {"tool": True}}, {"mass": 0.5, "at": [0.02, 0.01, 0.08]}, None),
    ({"effect": "gravity_direction", "site": {"base": True}}, {"about_x": 0.03, "about_y": -0.02}, None),
]


@pytest.mark.parametrize(("what", "parts", "formula"), MECHANICAL)
def test_parts_in_mujoco_do_what_the_formula_says(bench, what: dict, parts: dict, formula: dict | None) -> None:
    """Bodies, springs, gaps and friction there against the closed form here: two ways to the same motion."""
    arm, s = arm_and_session(15, 12)
    arm = arm.but(compliance=np.append(1.0 / bench.gear(arm, 0), arm.compliance[1:]))  # nothing is rigid there
    formula = dict(formula or parts)
    if formula.get("gap") == "2 * friction / k":
        formula["gap"] = 2 * parts["friction_nm"] / bench.gear(arm, what["site"]["joint"] - 1)
    moved = bench.experiment(arm, s, [{**what, "p": parts}]).tcp - bench.experiment(arm, s).tcp
    expected = simulate(arm, s, [{**what, "p": formula}]).tcp - simulate(arm, s).tcp
    assert np.abs(moved).max() > 2e-6
    assert np.linalg.norm(moved - expected) < 0.05 * np.linalg.norm(expected) + 1e-6


def test_friction_under_load_and_soft_gears_in_mujoco(bench) -> None:
    """These have no closed form of ours: the mechanism's own claims are asserted."""
    arm, s = arm_and_session(16, 16)
    s = replace(s, dirs=configurations.approaches(np.random.default_rng(0), s.q, "comes"), load=None)
    without, tau = bench.experiment(arm, s), simulate(arm, s).machine.tau[:, 2]
    site = {"joint": 3}
    rs, os = frames(arm, s.q + arm.offset)
    lever = configurations.point_jacobian(rs, os, without.tcp)[:, :, 2]

    def turned(effect: str, p: dict) -> np.ndarray:
        """By how much joint 3 is off."""
        moved = bench.experiment(arm, s, [{"effect": effect, "site": site, "p": p}]).tcp - without.tcp
        return np.einsum("ni,ni->n", moved, lever) / np.einsum("ni,ni->n", lever, lever)

    k = bench.gear(arm, 2)
    stopped = turned("load_friction", {"friction_nm": 0.2, "per_nm": 0.2})
    assert (np.sign(stopped) == -s.dirs[:, 2]).all(), "the joint stops short"
    assert np.corrcoef(np.abs(stopped), np.abs(tau))[0, 1] > 0.7, "and more so under load"
    soft = turned("nonlinear_stiffness", {"contact_nm": 0.3 * float(np.abs(tau).max()), "soft": 1.0 / k})
    light, heavy = np.abs(tau) < 0.3 * np.abs(tau).max(), np.abs(tau) > 0.35 * np.abs(tau).max()
    np.testing.assert_allclose(soft[light], tau[light] / k, atol=1e-6)
    np.testing.assert_allclose(soft[heavy], 0.3 * np.abs(tau).max() * np.sign(tau[heavy]) / k, atol=1e-6)
