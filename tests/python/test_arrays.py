"""Arrays in, arrays out: shapes, kinds and errors of `trical.Model`."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import trical
from terms import compliance, joint, lost_motion, term

ARM = Path(__file__).resolve().parents[2] / "cells" / "irb120"
FILES = {"robot": ARM / "robot.toml", "cell": ARM / "cell.toml"}
Q = np.radians([[10.0, 20, -30, 40, 50, 60], [-20, 10, 15, -60, 30, 5]])


@pytest.fixture(scope="module")
def model() -> trical.Model:
    return trical.Model.nominal(**FILES)


@pytest.mark.parametrize("of", ["forward", "flange"])
def test_one_pose_has_no_first_axis(model: trical.Model, of: str) -> None:
    positions, rotations = getattr(model, of)(Q)
    assert positions.shape == (2, 3) and rotations.shape == (2, 3, 3)
    position, rotation = getattr(model, of)(Q[1])
    np.testing.assert_array_equal(position, positions[1])
    np.testing.assert_array_equal(rotation, rotations[1])


@pytest.mark.parametrize("kind", [list, tuple, lambda q: np.asarray(q, np.float32), lambda q: np.asfortranarray(q)])
def test_whatever_numpy_takes_is_taken(model: trical.Model, kind) -> None:
    q = kind(Q.tolist())
    np.testing.assert_allclose(model.forward(q)[0], model.forward(Q)[0], atol=1e-6)
    np.testing.assert_array_equal(model.forward([0] * 6)[0], model.forward(np.zeros(6))[0])
    np.testing.assert_array_equal(model.forward(Q[:, ::-1])[0], model.forward(Q[:, ::-1].copy())[0])


def test_jacobians_are_the_derivatives_of_positions(model: trical.Model) -> None:
    j = model.jacobian(Q[0])
    assert j.shape == (6, 6) and model.jacobian(Q).shape == (2, 6, 6)
    h = 1e-6
    steps = (model.forward(Q[0] + h * np.eye(6))[0] - model.forward(Q[0] - h * np.eye(6))[0]) / (2 * h)
    np.testing.assert_allclose(j[:3], steps.T, atol=1e-8)


def test_joints_come_back_from_where_they_led(model: trical.Model) -> None:
    positions, rotations = model.forward(Q)
    np.testing.assert_allclose(model.inverse(positions, rotations, Q + 0.02), Q, atol=1e-9)
    one = model.inverse(positions[0], rotations[0], Q[0] + 0.02)
    assert one.shape == (6,)
    np.testing.assert_allclose(one, Q[0], atol=1e-9)
    with pytest.raises(trical.UnreachableError, match="pose 1: "):
        model.inverse(np.add(positions, [[0], [9]]), rotations, Q)


WARM = '{ of = { temperature = { reference_c = 20.0 } }, shape = "linear" }'
TERMS = (
    lost_motion(2, -0.05)
    + term("drift_1", "drift", 0.001, "deg/s", joint(1), '{ of = "time", shape = "linear" }')
    + term(
        "warm_3",
        "temperature",
        0.01,
        "deg/K",
        joint(3),
        '{ of = { temperature = { reference_c = 20.0 } }, shape = "linear" }',
    )
)


@pytest.mark.parametrize(
    ("known", "joint", "by_deg"),
    [
        ({"directions": [0, 1, 0, 0, 0, 0]}, 1, 0.05),
        ({"directions": [[0, -1, 0, 0, 0, 0], [1, -1, 1, 1, 1, 1]]}, 1, -0.05),
        ({"time": 60.0}, 0, 0.06),
        ({"temperature": [25.0, 25.0]}, 2, 0.05),
        ({}, 0, 0.0),
    ],
)
def test_terms_see_what_is_known_beside_the_joints(model: trical.Model, known, joint: int, by_deg: float) -> None:
    improved = model.with_terms(TERMS)
    turned = Q + np.radians(by_deg) * np.eye(6)[joint]
    np.testing.assert_allclose(improved.forward(Q, **known)[0], model.forward(turned)[0], atol=1e-12)
    np.testing.assert_allclose(improved.flange(Q, **known)[0], model.flange(turned)[0], atol=1e-12)


def test_a_payload_bends_the_arm(model: trical.Model) -> None:
    soft = model.with_terms(compliance(2, 0.002))
    free, loaded = soft.gravity_torques(Q), soft.gravity_torques(Q, payload=3.0)
    assert free.shape == (2, 6) and np.abs(loaded[:, 1] - free[:, 1]).min() > 0.1
    np.testing.assert_array_equal(soft.gravity_torques(Q[1], payload=3.0), loaded[1])
    assert not np.array_equal(soft.forward(Q, payload=[0, 3])[0][1], soft.forward(Q)[0][1])
    np.testing.assert_array_equal(soft.forward(Q, payload=[0, 3])[0][0], soft.forward(Q)[0][0])


@pytest.mark.parametrize(
    ("q", "more", "said"),
    [
        ([1, 2], {}, r"q has the shape \(2,\), expected \(n, 6\) or \(6,\)"),
        (np.zeros((2, 2, 6)), {}, r"q has the shape \(2, 2, 6\)"),
        ("here", {}, "q: expected numbers or an array of them"),
        ([[0, 1], [2]], {}, "q: expected numbers or an array of them"),
        ([np.nan] * 6, {}, "q holds a value that is not finite"),
        (Q, {"directions": np.full((2, 6), 2)}, "directions holds 2, expected -1, 0 or 1"),
        (Q, {"directions": np.ones((3, 6))}, "directions has 3 rows, but q has 2"),
        (Q, {"temperature": [20, 21, 22]}, r"temperature has the shape \(3,\), expected a number or the shape \(2,\)"),
        (Q, {"payload": "heavy"}, "payload: expected numbers"),
    ],
)
def test_a_wrong_array_is_refused_in_one_sentence(model: trical.Model, q, more, said: str) -> None:
    with pytest.raises(trical.TricalError, match=said):
        model.forward(q, **more)


def test_robots_and_cells_are_objects_too(tmp_path: Path) -> None:
    robot, cell = trical.Robot.load(FILES["robot"]), trical.Cell.load(FILES["cell"])
    assert (robot.dof, robot.limits.shape, robot.kinds[0]) == (6, (6, 2), "revolute")
    assert cell.balls.shape == (3, 3) and "3 balls" in repr(cell) and "6 joints" in repr(robot)
    again = pickle.loads(pickle.dumps((robot, cell)))
    assert [a.to_toml() for a in again] == [robot.to_toml(), cell.to_toml()]
    robot.save(tmp_path / "r.toml")
    cell.save(tmp_path / "c.toml")
    q = Q[0]
    by_object = trical.Model.nominal(robot, cell).forward(q)[0]
    np.testing.assert_allclose(by_object, trical.Model.nominal(tmp_path / "r.toml", tmp_path / "c.toml").forward(q)[0])
    with pytest.raises(trical.TricalError, match="robot, line 1"):
        trical.Robot.from_toml("nonsense")
