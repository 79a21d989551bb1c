"""Forward kinematics, Jacobian and gravity torques against NumPy written from the formulas in Craig's book."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import trical

ROBOT = """
name = "test arm"
[[joint]]
alpha_deg = 0.0
a_mm = 0.0
d_mm = 290.0
theta_offset_deg = 0.0
limits_deg = [-165.0, 165.0]
mass_kg = 3.0
cog_mm = [0.0, 1.0, -50.0]
[[joint]]
alpha_deg = -90.0
a_mm = 20.0
d_mm = 5.0
theta_offset_deg = -90.0
limits_deg = [-110.0, 110.0]
mass_kg = 4.0
cog_mm = [101.0, 0.8, -2.0]
[[joint]]
alpha_deg = 3.0
a_mm = 270.0
d_mm = 0.0
theta_offset_deg = 0.0
limits_deg = [-110.0, 70.0]
mass_kg = 1.3
cog_mm = [58.0, 22.0, 1.0]
"""
CELL = """
[base]
xyz_mm = [150.0, -330.0, -150.0]
zyx_deg = [90.0, 10.0, -20.0]
[tool]
tcp_mm = [18.0, -12.0, 118.0]
mass_kg = 1.7
cog_mm = [5.0, -4.0, 55.0]
"""
MDH = [(0.0, 0.0, 290.0, 0.0), (-90.0, 20.0, 5.0, -90.0), (3.0, 270.0, 0.0, 0.0)]
BODIES = [(3.0, (0.0, 1.0, -50.0)), (4.0, (101.0, 0.8, -2.0)), (1.3, (58.0, 22.0, 1.0))]


def rotation(axis: int, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    r = np.eye(4)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    r[i, i] = r[j, j] = c
    r[i, j], r[j, i] = -s, s
    return r


def shift(x: float, y: float, z: float) -> np.ndarray:
    t = np.eye(4)
    t[:3, 3] = x, y, z
    return t


def frames(q: np.ndarray) -> list[np.ndarray]:
    z, y, x = np.deg2rad([90.0, 10.0, -20.0])
    t = shift(0.15, -0.33, -0.15) @ rotation(2, z) @ rotation(1, y) @ rotation(0, x)
    out = []
    for (alpha, a, d, offset), angle in zip(MDH, q, strict=True):
        t = t @ rotation(0, np.deg2rad(alpha)) @ shift(a / 1e3, 0, 0) @ rotation(2, angle + np.deg2rad(offset))
        t = t @ shift(0, 0, d / 1e3)
        out.append(t)
    return out


def tool(q: np.ndarray) -> np.ndarray:
    return frames(q)[-1] @ shift(0.018, -0.012, 0.118)


def potential(q: np.ndarray) -> float:
    t = frames(q)
    bodies = [(m, f @ np.append(np.array(c) / 1e3, 1.0)) for (m, c), f in zip(BODIES, t, strict=True)]
    bodies.append((1.7, t[-1] @ np.array([0.005, -0.004, 0.055, 1.0])))
    return sum(m * 9.80665 * p[2] for m, p in bodies)


@pytest.fixture
def model(tmp_path: Path) -> trical.Model:
    (tmp_path / "robot.toml").write_text(ROBOT)
    (tmp_path / "cell.toml").write_text(CELL)
    return trical.Model.nominal(tmp_path / "robot.toml", tmp_path / "cell.toml")


def test_forward_kinematics_is_the_product_of_craigs_transforms(model: trical.Model) -> None:
    q = np.random.default_rng(1).uniform(-2, 2, (50, 3))
    p, r = model.forward(q)
    for k in range(50):
        expected = tool(q[k])
        np.testing.assert_allclose(p[k], expected[:3, 3], atol=1e-13)
        np.testing.assert_allclose(r[k], expected[:3, :3], atol=1e-13)


def test_the_jacobian_is_the_derivative_of_position(model: trical.Model) -> None:
    q = np.random.default_rng(2).uniform(-2, 2, (10, 3))
    j = model.jacobian(q)
    h = 1e-6
    for k in range(10):
        for i in range(3):
            d = np.zeros(3)
            d[i] = h
            expected = (tool(q[k] + d)[:3, 3] - tool(q[k] - d)[:3, 3]) / (2 * h)
            np.testing.assert_allclose(j[k, :3, i], expected, atol=1e-8)


def test_gravity_torques_are_the_falling_potential(model: trical.Model) -> None:
    q = np.random.default_rng(3).uniform(-2, 2, (10, 3))
    tau = model.gravity_torques(q)
    h = 1e-5
    for k in range(10):
        for i in range(3):
            d = np.zeros(3)
            d[i] = h
            expected = -(potential(q[k] + d) - potential(q[k] - d)) / (2 * h)
            assert tau[k, i] == pytest.approx(expected, abs=1e-7)


def test_models_pickle(model: trical.Model) -> None:
    again = pickle.loads(pickle.dumps(model))
    q = np.array([[0.1, 0.2, 0.3]])
    np.testing.assert_allclose(again.forward(q)[0], model.forward(q)[0], atol=1e-12)


@pytest.mark.parametrize("q", [np.zeros((1, 2)), np.full((1, 3), np.nan)])
def test_bad_joint_values_are_refused(model: trical.Model, q: np.ndarray) -> None:
    with pytest.raises(trical.TricalError):
        model.forward(q)
