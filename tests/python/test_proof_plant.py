"""The proof suite's plant: is it a robot, and does it do what its effects say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import configurations
import make
from arms import OTHERS, SMALL, Kind, nominal_arm
from families import FAMILIES, OUTSIDE
from plant import DEG, GRAVITY, MM, Arm, Session, bodies, frames, gravity_moments, simulate, true_arm
from proof_cases import arm_and_session
from visible import Design, context, jacobian, parameters


def craig(alpha: float, a: float, d: float, theta: float) -> np.ndarray:
    """The transform between neighbouring links, element by element: Craig, Introduction to Robotics, eq. 3.6."""
    ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
    return np.array(
        [
            [ct, -st, 0.0, a],
            [st * ca, ct * ca, -sa, -sa * d],
            [st * sa, ct * sa, ca, ca * d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def base(arm: Arm) -> np.ndarray:
    (a, b, c), t = arm.base_zyx, np.eye(4)
    ca, sa, cb, sb, cc, sc = np.cos(a), np.sin(a), np.cos(b), np.sin(b), np.cos(c), np.sin(c)
    t[:3, :3] = [
        [ca * cb, ca * sb * sc - sa * cc, ca * sb * cc + sa * sc],
        [sa * cb, sa * sb * sc + ca * cc, sa * sb * cc - ca * sc],
        [-sb, cb * sc, cb * cc],
    ]
    t[:3, 3] = arm.base_xyz
    return t


def chain(arm: Arm, theta: np.ndarray) -> list[np.ndarray]:
    t, out = base(arm), []
    for j in range(6):
        t = t @ craig(arm.alpha[j], arm.a[j], arm.d[j], theta[j])
        out.append(t)
    return out


def potential(arm: Arm, theta: np.ndarray, load: float) -> float:
    links = chain(arm, theta)
    parts = [
        *((m, t @ np.append(c, 1.0)) for m, c, t in zip(arm.mass, arm.cog, links, strict=True)),
        (arm.tool_mass + load, links[-1] @ np.append(arm.tool_cog, 1.0)),
    ]
    return sum(m * GRAVITY * p[2] for m, p in parts)


@pytest.mark.parametrize("kind", [SMALL, *OTHERS.values()], ids=lambda kind: kind.name)
def test_forward_kinematics_is_craigs(kind: Kind) -> None:
    rng = np.random.default_rng(1)
    arm = true_arm(nominal_arm(rng, kind), rng)
    theta = rng.uniform(-3, 3, (30, 6))
    rs, os = frames(arm, theta)
    for n in range(30):
        for j, t in enumerate(chain(arm, theta[n])):
            np.testing.assert_allclose(rs[n, j], t[:3, :3], atol=1e-13)
            np.testing.assert_allclose(os[n, j], t[:3, 3], atol=1e-13)


def test_gravitys_torque_is_the_slope_of_potential_energy() -> None:
    rng = np.random.default_rng(2)
    arm = true_arm(nominal_arm(rng), rng)
    theta, load, h = rng.uniform(-3, 3, (10, 6)), rng.uniform(0, 2, 10), 1e-5
    rs, os = frames(arm, theta)
    moments = gravity_moments(*bodies(arm, rs, os, load), os, np.array([0.0, 0.0, -GRAVITY]))
    tau = np.einsum("nja,nja->nj", moments, rs[..., 2])
    for n in range(10):
        for j in range(6):
            e = h * np.eye(6)[j]
            slope = (potential(arm, theta[n] + e, load[n]) - potential(arm, theta[n] - e, load[n])) / (2 * h)
            assert tau[n, j] == pytest.approx(-slope, abs=1e-7)


def test_an_arm_without_effects_sags_by_compliance_times_torque() -> None:
    arm, s = arm_and_session(3)
    s = replace(s, load=None)
    machine = simulate(arm, s)
    angles = s.q + arm.offset + arm.compliance * machine.machine.tau
    for n in range(len(s.q)):
        tool = chain(arm, angles[n])[-1] @ np.append(arm.tcp, 1.0)
        np.testing.assert_allclose(machine.tcp[n], tool[:3], atol=1e-9)


SIZES = set("gap per_nm sin cos k size beta about_x about_y per_k by g e per_h share".split())


def half(effect: dict) -> dict:
    p = {key: (np.multiply(v, 0.5).tolist() if key in SIZES else v) for key, v in effect["p"].items()}
    if effect["effect"] == "payload":
        p = {**p, "mass": 0.5 * p["mass"]} if p["mass"] else {**p, "at": np.multiply(p["at"], 0.5).tolist()}
    return {**effect, "p": p}


@pytest.mark.parametrize("name", sorted({**FAMILIES, **OUTSIDE}))
def test_every_effect_moves_the_arm_in_proportion_to_its_size(name: str) -> None:
    family = {**FAMILIES, **OUTSIDE}[name]
    rng = np.random.default_rng(4)
    arm, s = arm_and_session(4, touch=family.touches)
    s = replace(
        s,
        dirs=configurations.approaches(rng, s.q, "comes"),
        spread=MM,
        reading=rng.normal(0, MM, (len(s.q), 3)) if s.touch else None,
        has_commanded=True,
        has_thermometer=True,
    )
    if name == "late_joint_reading":
        s = make.with_lag(s, rng, {"joints": True})
    design = Design(arm, s)
    site = family.sites(context(arm, s))[0]
    effect = {"effect": name, "site": site, "p": family.draw(rng, context(arm, s), site)}
    assert np.abs(design.signature([effect])).max() > 1e-7, "the signature is nothing"
    if name == "out_quantised_encoder":
        return  # its size is a step: half of it is another pattern
    whole, part = design.signature([effect]), design.signature([half(effect)])
    assert np.linalg.norm(part - 0.5 * whole) < 0.01 * np.linalg.norm(whole)
    assert design.lam([half(effect)]) == pytest.approx(0.5 * design.lam([effect]), rel=0.03, abs=0.02)


def test_what_the_baseline_absorbs_has_no_lambda() -> None:
    arm, s = arm_and_session(5)
    _, s, _ = make.measure(np.random.default_rng(5), arm, s, [], "white", False)
    design = Design(arm, s)
    for j in range(2, 6):  # a constant zero offset of joints 2 to 5 is one of the 31 parameters
        shift = {"effect": "joint_zero_shift", "site": {"joint": j}, "p": {"size": 0.02 * DEG, "at": -1.0}}
        assert np.linalg.norm(design.signature([shift])) > 50e-6
        assert design.lam([shift]) < 0.1


def fitted(nominal: Arm, s: Session, points: np.ndarray | None) -> np.ndarray:
    """Residuals (N, 3) m of the paper's 31 parameters fitted to a recording by Gauss-Newton; `points`: a tracker's, in
    its own frame, which is fitted in place of the base."""
    arm = nominal
    offset = np.zeros((len(s.q), 3)) if points is not None else s.reading

    def residual(arm: Arm) -> np.ndarray:
        poses = simulate(arm, s)
        if points is None:
            return poses.ball - poses.tcp - np.einsum("nij,nj->ni", poses.r, offset)
        a, b = points - points.mean(0), poses.tcp - poses.tcp.mean(0)
        u, _, vt = np.linalg.svd(a.T @ b)
        turn = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
        return a @ turn - b

    for _ in range(12):
        step = np.linalg.lstsq(jacobian(arm, s), residual(arm).ravel(), rcond=1e-10)[0]
        moves = [m for m in parameters(arm) if points is None or not m[0].startswith("base")]
        new = {}
        for field in ("base_xyz", "base_zyx", "tcp", "alpha", "a", "d", "offset", "compliance"):
            new[field] = getattr(arm, field) + sum(
                x * (getattr(above, field) - getattr(below, field)) / (2 * h)
                for x, (_, below, above, h) in zip(step, moves, strict=False)
            )
        arm = arm.but(**new)
    return residual(arm)


@pytest.mark.parametrize("kind", ["small", *OTHERS])
@pytest.mark.parametrize("touch", [True, False])
def test_effect_free_recordings_hide_nothing(touch: bool, kind: str) -> None:
    """Without noise the baseline explains them to a fraction of a micrometre: what it cannot explain would be an effect
    that nobody drew, and naming it would count as a false alarm."""
    for seed in range(6 if kind == "small" else 2):
        rng = np.random.default_rng([17, seed])
        nominal, s = make.cell(rng, 80, touch, OTHERS.get(kind, SMALL))
        arm = make.built(nominal, rng, touch)
        s = replace(s, sigma=1e-12, load=configurations.loads(rng, 80))
        if touch:
            s = replace(s, reading=rng.normal(0, MM, (80, 3)))
        columns, s, _ = make.measure(rng, arm, s, [], "white", False)
        points = None if touch else np.stack([columns[f"{a}_mm"][0] for a in "xyz"], 1) * MM
        rest = fitted(nominal, s, points)
        # balls are a micrometre off, points are rounded, and redundant parameters are so only to first order
        assert np.sqrt(np.mean(rest**2)) < (1.0e-6 if touch else 0.4e-6), seed
