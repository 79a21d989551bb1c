"""A fleet of simulated arms, calibrated on Dask's local cluster, and what arms of one kind have in common."""

from __future__ import annotations

import pickle
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import fleet_dask
import trical

FILES = {"robot": fleet_dask.IRB120 / "robot.toml", "cell": fleet_dask.IRB120 / "cell.toml"}


@pytest.mark.filterwarnings("default")  # those of Dask are not ours
def test_a_fleet_is_calibrated_by_mapping_over_recordings_and_better_as_arms_of_one_kind(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="dask[distributed] of tests/python/requirements.txt is not installed")
    with fleet_dask.cluster(2) as client:
        fleet = fleet_dask.calibrate_fleet(client, 50, tmp_path, touches=15)
    assert [arm.number for arm in fleet] == list(range(50))
    errors = [(arm.errors, arm.errors_by_kind) for arm in fleet]
    alone, by_kind = np.array([[e.mean() for e in both if e is not None] for both in errors]).T
    assert np.median(alone) < 0.1 and by_kind.mean() < 0.95 * alone.mean()
    assert fleet_dask.errors_mm(7, trical.Model.nominal(**FILES)).mean() > 0.3


def test_what_arms_have_in_common_is_found_through_the_uncertainty_of_each() -> None:
    rng = np.random.default_rng(7)
    names, nominal = ["a_2", "theta_3", "tool_x"], np.array([270.0, 0.0, 1.0])
    mean, spread = np.array([270.4, 0.2, 1.0]), np.array([0.3, 0.8, 1.0])
    arms = []
    for _ in range(200):
        # two numbers that hardly anything tells apart, in SI
        covariance = np.diag([0.4e-3, np.radians(0.4), 1e-3]) @ np.array([[1, 0.9, 0], [0.9, 1, 0], [0, 0, 1]])
        covariance = covariance @ np.diag([0.4e-3, np.radians(0.4), 1e-3])
        si = np.array([1e3, np.degrees(1.0), 1e3])
        values = rng.normal(mean, spread) + si * rng.multivariate_normal(np.zeros(3), covariance)
        rows = zip(names, values, si * np.sqrt(np.diag(covariance)), nominal, ["mm", "deg", "mm"], strict=True)
        parameters = [{"name": n, "value": v, "sd": s, "nominal": o, "unit": u} for n, v, s, o, u in rows]
        arms.append(SimpleNamespace(parameters=parameters, covariance=covariance))
    found = trical.kind(arms)  # type: ignore[arg-type]
    assert found.names == names[:2] and found.units == ["mm", "deg"] and found.arms == 200
    np.testing.assert_allclose(found.mean, mean[:2], atol=0.1)
    np.testing.assert_allclose(found.spread, spread[:2], rtol=0.25)
    # the uncertainty of each, 0.4, is no spread: values as identified are 0.5 mm apart
    assert np.std([arm.parameters[0]["value"] for arm in arms]) > 0.45
    with pytest.raises(ValueError, match="0 arms"):
        trical.kind([])


def test_an_arm_is_the_same_whoever_draws_it(tmp_path: Path) -> None:
    first = fleet_dask.record(3, tmp_path).read_text()
    assert fleet_dask.record(3, tmp_path).read_text() == first
    assert fleet_dask.draw(3).rigid.to_toml() != fleet_dask.draw(4).rigid.to_toml()


def test_a_spoilt_recording_gives_a_sentence_not_an_end(tmp_path: Path) -> None:
    path = tmp_path / "spoilt.csv"
    path.write_text("ball,q1_deg\n1,2\n")
    answer = fleet_dask.calibrate(path, **FILES)
    assert isinstance(answer, str) and "spoilt.csv" in answer


def test_a_fit_survives_pickling(tmp_path: Path) -> None:
    result = fleet_dask.calibrate(fleet_dask.record(0, tmp_path), **FILES)
    assert isinstance(result, trical.Identified)
    again = pickle.loads(pickle.dumps(result))
    q = np.zeros((1, 6))
    np.testing.assert_array_equal(again.model.forward(q)[0], result.model.forward(q)[0])
    assert again.errors == result.errors
