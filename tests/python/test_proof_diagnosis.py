"""A small proof from end to end: what the program says of arms whose flaws are known."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import make
import run
import score
import write
from conftest import program
from plant import DEG, MM


def test_strong_effects_are_named_and_nothing_is_named_where_nothing_is(tmp_path: Path) -> None:
    """Twelve arms with one effect each (lambda above 15) and six with none; at least 9 of the 12 right in effect and
    site, 11 with explanations that the data cannot tell apart, and one false alarm at most."""
    for kind, count in (("strong", 12), ("none", 6)):
        make.make(kind, 20261121, count, tmp_path / kind, [150], 2)
        assert run.run(program(), tmp_path / kind) == 0, "a case without an answer"
    _, failures, cases = score.score([tmp_path / "strong", tmp_path / "none"])
    strong = [c for c in cases if c.effects]
    assert len(strong) == 12 and min(c.effects[0]["lambda"] for c in strong) > 14
    firsts = [(score.first(c), c.effects[0]) for c in strong if score.first(c)]
    assert sum(score.same(*pair) for pair in firsts) >= 9, failures
    assert sum(score.alike(*pair) for pair in firsts) >= 11, failures
    assert sum(bool(c.findings) for c in cases if not c.effects) <= 1, failures


def diagnosed(
    folder: Path, seed: int, n: int, effects: list[dict], noise: str = "white", without: tuple[str, ...] = ()
) -> dict:
    """What the program says of `n` touches of an arm with these effects, recorded `without` some columns."""
    d = make.draw("none", seed, 0, [n], 0)
    columns, _, _ = make.measure(d.rng, d.arm, d.s, effects, noise, False)
    (folder / "robot.toml").write_text(write.robot_toml(d.nominal))
    (folder / "cell.toml").write_text(write.cell_toml(d.nominal))
    kept = {name: column for name, column in columns.items() if name not in without}
    (folder / "recording.csv").write_text(write.csv(kept))
    said = run.diagnose(program(), folder, 120)
    assert said["answer"], said["error"]
    return said["answer"]


@pytest.mark.parametrize(
    ("seed", "effect", "size", "joint", "variable"),
    [
        (1, "out_overshoot", {"size": 0.03 * DEG}, 3, "travel3"),
        # on the way that this one goes, curves over time follow it too, and are chosen
        (3, "out_hysteresis_memory", {"size": 0.06 * DEG, "keep": 0.8}, 1, "dir1"),
    ],
)
def test_a_joint_that_remembers_its_moves_is_told_without_a_name(
    tmp_path: Path, seed: int, effect: str, size: dict, joint: int, variable: str
) -> None:
    """No model file can hold it; curves over time and angle that it looks like are not what is told first."""
    answer = diagnosed(tmp_path, seed, 150, [{"effect": effect, "site": {"joint": joint}, "p": size}])
    assert answer["unexplained"]["site"] == {"joint": joint} and answer["unexplained"]["variable"] == variable
    assert not any(f["confidence"] >= 0.9 for f in answer["findings"])


def test_a_gap_that_gravity_closes_softly_is_no_soft_joint(tmp_path: Path) -> None:
    """The two are one curve; the gap is larger than a joint of this stiffness can be soft."""
    gap = {"effect": "lost_motion_gravity", "site": {"joint": 5}, "p": {"gap": 0.06 * DEG, "soft_nm": 0.5}}
    first = diagnosed(tmp_path, 2, 150, [gap])["findings"][0]
    assert (first["effect"], first["site"]) == ("lost_motion_gravity", {"joint": 5})


def test_a_joint_may_be_soft_up_to_a_kink(tmp_path: Path) -> None:
    """As data sheets of strain-wave gears have it; smooth shapes do not follow, and nothing was named here."""
    soft = {"shape": "soft_start", "scale_nm": 30.634, "until": 0.7, "size": 0.06 * DEG}
    effect = {"effect": "nonlinear_stiffness", "site": {"joint": 2}, "p": soft}
    first = diagnosed(tmp_path, 4, 150, [effect])["findings"][0]
    assert (first["effect"], first["site"]) == ("nonlinear_stiffness", {"joint": 2})


@pytest.mark.parametrize(
    ("seed", "n", "centre", "size", "width"),
    [
        # seven rows of it were outliers to a spline, and the rest of it a step
        (3, 300, 0.3, 0.0006, 0.09),
        (6, 300, 0.3, 0.0006, 0.09),
        # so few rows that all of them were
        (4, 150, -1.37, 0.0012, 0.06),
        (5, 150, 0.9, 0.0008, 0.08),
    ],
)
def test_what_happens_near_one_angle_is_told_there(
    tmp_path: Path, seed: int, n: int, centre: float, size: float, width: float
) -> None:
    """A damaged tooth: no step, no wave, and no outliers either."""
    bump = {"effect": "out_bump", "site": {"joint": 4}, "p": {"centre": centre, "size": size, "width": width}}
    answer = diagnosed(tmp_path, seed, n, [bump])
    told = answer["unexplained"]
    assert told["site"] == {"joint": 4} and told["variable"] == "q4"
    left, right = (float(x) for x in re.findall(r"-?[0-9.]+(?= |$)", told["region"].removeprefix("q4 from ")))
    assert left < centre / DEG < right and right - left < 45.0, told["region"]
    assert not answer["findings"] and not answer["rejected"]


@pytest.mark.parametrize("noise", ["ar1", "wander"])
def test_noise_that_remembers_itself_is_no_effect(tmp_path: Path, noise: str) -> None:
    answer = diagnosed(tmp_path, 2, 300, [], noise)
    assert not answer["findings"] and not answer["unexplained"]
    assert any("noise is correlated" in c for c in answer["cautions"])


def test_a_slow_effect_is_no_noise(tmp_path: Path) -> None:
    drift = {"effect": "tool_drift", "site": {"tool": True}, "p": {"by": [0.03 * MM, 0.02 * MM, -0.03 * MM]}}
    answer = diagnosed(tmp_path, 2, 300, [drift])
    assert [(f["effect"], f["site"]) for f in answer["findings"]] == [("tool_drift", {"tool": True})]
    assert not any("noise is correlated" in c for c in answer["cautions"])


@pytest.mark.parametrize(
    ("effect", "words"),
    [
        ({"effect": "joint_zero_shift", "site": {"joint": 3}, "p": {"at": 0.6, "size": 0.05 * DEG}}, "at pose "),
        ({"effect": "tool_drift", "site": {"tool": True}, "p": {"by": [0.1 * MM, 0.08 * MM, 0.0]}}, "creeps"),
    ],
)
def test_without_a_clock_the_order_of_the_poses_tells_when(tmp_path: Path, effect: dict, words: str) -> None:
    answer = diagnosed(tmp_path, 2, 150, [effect], without=("t_s", "temp_c"))
    first = answer["findings"][0]
    assert (first["effect"], first["site"]) == (effect["effect"], effect["site"]) and words in first["located"]
    # what was asked by the order alone, and not found, is among what the data could not show
    lacks = {b["effect"]: b.get("lacks") for b in answer["blind_to"] if b.get("lacks")}
    assert "only the order" in lacks["thermal_growth"] and effect["effect"] not in lacks
