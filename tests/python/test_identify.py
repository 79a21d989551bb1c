"""Identification from Python, on recordings that are not kept here."""

from __future__ import annotations

from pathlib import Path

import pytest

import trical


def test_the_real_arm_is_predicted_to_a_tenth_of_a_millimetre(shared: Path, tmp_path: Path) -> None:
    d = shared / "irb120"
    files = {"robot": d / "robot.toml", "cell": d / "cell.toml"}
    result = trical.identify(d / "tracker.csv", **files, joints="commanded", folds=4)
    assert result.cross_validation is not None
    assert result.cross_validation["mean_mm"] < 0.129
    result.model.save(tmp_path / "model.toml")
    again = trical.Model.load(tmp_path / "model.toml")
    v = trical.validate(again, d / "tracker.csv", **files)
    # 13 poses more than in the fit: those with fewer references are registered by none
    assert v["after"]["median_mm"] == pytest.approx(result.errors["median_mm"], rel=0.05)
    assert trical.parameters(again)[0]["name"] == "frame_x"


def test_a_wrong_word_is_refused_by_name(shared: Path) -> None:
    d = shared / "blind"
    with pytest.raises(trical.TricalError, match="model is 'everything'"):
        trical.identify(d / "B02.probe.csv", robot=d / "robot.toml", cell=d / "cell.toml", model="everything")


def test_the_two_sessions_of_the_ur10_are_one_arm(shared: Path) -> None:
    """The frame of each session's tracker takes up what joint 1 does: of that no number is given."""
    d = shared / "ur10"
    old = trical.identify(d / "random.csv", robot=d / "robot.toml", cell=d / "cell.toml").model
    told = trical.compare(old, d / "configurations.csv")
    assert told["verdict"] == "unchanged"
    visible = {v["what"]: v["smallest"] for v in told["visible"]}
    assert visible["joint 1"] is None and 0.01 < visible["joint 2"] < 0.2
    each = {a["name"]: a for a in told["each"]}
    # what is called visible is what would be told: joint 2's 0.024 deg lie below it, sure as they are
    assert "joint 1" not in each and abs(each["joint 2"]["value"]) < visible["joint 2"]
    assert all(a["sd"] < (20 if a["unit"] == "mm" else 2) for a in each.values())
