"""The proof suite on real recordings, and on curves of a joint's own angle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import real
from curves import curve, turn_curve
from draws import Context
from plant import DEG, MM, Arm, frames, rot_vector, simulate
from proof_cases import arm_and_session
from visible import Design


def test_an_arm_of_any_axes_is_craigs() -> None:
    """Against the product of exponentials: rotate a point about each axis, last joint first."""
    rng = np.random.default_rng(1)
    z, p = rng.normal(size=(2, 7, 3))
    z /= np.linalg.norm(z, axis=1)[:, None]
    z[3] = z[2]  # parallel
    p[5] = p[4]  # meeting
    chain = real.modified_dh(z, p, (True, *[False] * 6), np.zeros((7, 2)))
    arm = Arm(
        **chain,
        base_xyz=np.zeros(3),
        base_zyx=np.zeros(3),
        tcp=np.zeros(3),
        tool_mass=0.0,
        tool_cog=np.zeros(3),
        balls=p,
    )
    q = rng.uniform(-2, 2, (20, 7))
    points = np.tile(p[6], (20, 1))
    for j in range(6, 0, -1):
        turn = rot_vector(q[:, j, None] * z[j])
        points = np.einsum("nij,nj->ni", turn, points - p[j]) + p[j]
    points = points + q[:, :1] * z[0]
    here = frames(arm, q + arm.offset)[1][:, -1]
    r, o = real.rigid(here, points)
    np.testing.assert_allclose(here @ r.T + o, points, atol=1e-12)


@pytest.mark.skipif(real.data() is None, reason="recordings are not kept in this repository")
@pytest.mark.parametrize(("name", "left"), [("kuka_rail", 0.7e-3), ("iiwa7", 0.8e-3)])
def test_what_is_added_to_a_real_recording_is_the_effect_alone(name: str, left: float) -> None:
    pytest.importorskip("tomllib", reason="Python 3.10 has no reader of TOML")
    background = real.load(name)
    assert background.rms < left, "the plant is not aligned"
    same = real.displaced(background, background.s, [])
    drift = {"effect": "frame_drift", "site": {"frame": True}, "p": {"by": [0.3 * MM, 0.0, -0.4 * MM]}}
    twist = {"effect": "joint_harmonic", "site": {"joint": 4}, "p": {"n": 2, "sin": 1e-3, "cos": 0.0}}

    def table(text: list[list[str]], names: list[str]) -> np.ndarray:
        return np.array([[float(row[background.columns.index(c)]) for c in names] for row in text])

    where = ["x_mm", "y_mm", "z_mm"]
    before = table(background.text, where)
    np.testing.assert_allclose(table(same, where), before, atol=1e-6)
    moved = table(real.displaced(background, background.s, [drift]), where) - before
    assert np.linalg.norm(moved[0]) < 1e-6 and np.linalg.norm(moved[-1]) == pytest.approx(0.5, abs=1e-5)
    turned = real.displaced(background, background.s, [twist])
    assert 0.1 < np.linalg.norm(table(turned, where) - before, axis=1).max() < 5.0
    if "qw" in background.columns:
        quaternions = [table(t, ["qw", "qx", "qy", "qz"]) for t in (background.text, turned)]
        plain, off = (q / np.linalg.norm(q, axis=1)[:, None] for q in quaternions)
        angle = 2 * np.linalg.norm(off - plain, axis=1)
        expected = 1e-3 * np.abs(np.sin(2 * background.s.q[:, 3]))
        np.testing.assert_allclose(angle, expected, atol=1e-6)
    assert [r[0] for r in turned] == [r[0] for r in background.text]


@pytest.mark.skipif(real.data() is None, reason="recordings are not kept in this repository")
def test_what_a_real_recording_has_already_is_not_added_to_it() -> None:
    pytest.importorskip("tomllib", reason="Python 3.10 has no reader of TOML")
    plain = {"final": {"rms_mm": 0.2}, "findings": []}

    def added(said: dict) -> dict:
        return real.make_case("iiwa7", said, 7, 0)[2]["effects"][0]

    def again(family_confidence: float) -> bool:
        there = {**first, "family_confidence": family_confidence}
        then = added({**plain, "findings": [there]})
        return (then["effect"], then["site"]) == (first["effect"], first["site"])

    first = added(plain)
    assert again(0.4) and not again(0.5)


def test_an_encoders_curve_is_the_same_on_every_turn_and_another_is_not() -> None:
    arm, s = arm_and_session(21, 12, touch=False)
    rng = np.random.default_rng(21)
    further = replace(s, q=s.q + 2 * np.pi * np.eye(6)[5])
    p = curve(rng, 0.05 * DEG, 0.05 * DEG, 30)
    encoder = [{"effect": "encoder_error", "site": {"joint": 6}, "p": p}]
    angle = [simulate(arm, x, encoder).machine.angle[:, 5] for x in (s, further)]
    np.testing.assert_allclose(*angle, atol=1e-12)
    assert 0.2 * 0.05 * DEG < np.ptp(angle[0]) <= 0.0501 * DEG
    both = Context(arm, replace(s, q=np.concatenate([s.q, further.q])), s.q)
    other = turn_curve(rng, both, {"joint": 6})
    angle = [
        simulate(arm, x, [{**encoder[0], "effect": "out_turn_curve", "p": other}]).machine.angle[:, 5]
        for x in (s, further)
    ]
    assert np.abs(angle[0] - angle[1]).max() > 0.005 * DEG


def test_lambda_beside_the_rest_is_less_where_the_rest_says_the_same() -> None:
    arm, s = arm_and_session(5, 150)
    design = Design(arm, s)
    ratio = {"effect": "gear_ratio", "site": {"joint": 2}, "p": {"k": 5e-4}}

    def beside(effect: str, joint: int) -> float:
        return real.beside(design, ratio, [{"effect": effect, "site": {"joint": joint}}])

    alone = design.lam([ratio])
    assert beside("encoder_error", 2) < 0.3 * alone
    assert beside("encoder_error", 5) > 0.7 * alone
