"""A fleet of a hundred simulated arms, calibrated on Dask's local cluster."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import fleet_dask
import trical

FILES = {"robot": fleet_dask.IRB120 / "robot.toml", "cell": fleet_dask.IRB120 / "cell.toml"}


@pytest.mark.filterwarnings("default")  # those of Dask are not ours
def test_a_hundred_arms_are_calibrated_by_mapping_over_recordings(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="dask[distributed] of tests/python/requirements.txt is not installed")
    with fleet_dask.cluster(2) as client:
        fleet = fleet_dask.calibrate_fleet(client, 100, tmp_path)
    assert [n for n, _, _ in fleet] == list(range(100))
    errors = [e for _, r, e in fleet if not isinstance(r, str) and e is not None]
    assert len(errors) == 100
    means = np.array([e.mean() for e in errors])
    assert np.median(means) < 0.03 and means.max() < 0.1
    assert fleet_dask.errors_mm(7, trical.Model.nominal(**FILES)).mean() > 0.3


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
