"""The parts of ./bench that need no peers: the task, the table. Times themselves are not tested."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

import arm
import scene
import table
from conftest import ROOT, program


@pytest.fixture(scope="module")
def task(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("task")
    arm.write_all(folder, big=0)
    scene.write_all(folder)
    return folder


def test_the_task_is_the_same_every_time(tmp_path: Path) -> None:
    v = arm.truth(np.random.default_rng(3), elastic=True)
    for name in ("a", "b"):
        arm.write_touches(tmp_path / name, np.random.default_rng(4), v, 6)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_touches_lie_on_the_balls_but_for_noise(task: Path) -> None:
    v = arm.truth(np.random.default_rng(arm.SEED), elastic=False)
    data = np.loadtxt(task / "rigid_touches.csv", delimiter=",", skiprows=1)
    q, ball = np.deg2rad(data[:, 1:7]), data[:, 0].astype(int) - 1
    off = np.linalg.norm(arm.true_positions(q, v) - arm.BALLS[ball], axis=1)
    assert len(q) == 45 and off.max() < 1e-8  # rounded to 1e-7 deg
    assert 10e-6 < 1e-3 * data[:, 7:].std() < 30e-6


def test_gravity_torques_are_the_slope_of_the_potential() -> None:
    q, v = arm.random_joints(np.random.default_rng(0), 20), np.zeros(arm.RIGID)

    def work(q: np.ndarray) -> np.ndarray:
        _, _, _, origins, rotations = arm.frames(q, v)
        sum_ = np.zeros(len(q))
        for i in range(6):
            sum_ += arm.MASS[i] * (origins[:, i] + rotations[i] @ arm.COG[i]) @ arm.GRAVITY
        return sum_ + arm.TOOL_MASS * (origins[:, 5] + rotations[5] @ arm.TOOL_COG) @ arm.GRAVITY

    slope = np.stack([(work(q + 1e-6 * e) - work(q - 1e-6 * e)) / 2e-6 for e in np.eye(6)], axis=1)
    assert np.abs(slope - arm.gravity_torques(q, v)).max() < 1e-6


def test_both_ways_through_the_chain_agree() -> None:
    rng = np.random.default_rng(1)
    v, q = arm.truth(rng, elastic=False), arm.random_joints(rng, 50)
    _, _, _, origins, rotations = arm.frames(q, v)
    assert np.abs(origins[:, 5] + rotations[5] @ arm.unpack(v)[3] - arm.positions(q, v)).max() < 1e-12


def test_trical_finds_the_true_arm_behind_the_task(task: Path, tmp_path: Path) -> None:
    common = ["--robot", task / "robot.toml", "--cell", task / "cell.toml"]
    run = [program(), "identify", task / "elastic_points.csv", *common, "--model", "compliance", "--json"]
    out = subprocess.run([*run, "--out", tmp_path / "model.toml"], check=True, capture_output=True, text=True)
    assert len(json.loads(out.stdout)["parameters"]) == arm.ELASTIC
    run = [program(), "validate", task / "elastic_heldout.csv", *common, "--model", tmp_path / "model.toml", "--json"]
    after = json.loads(subprocess.run(run, check=True, capture_output=True, text=True).stdout)["after"]
    assert after["rms_mm"] < 0.006  # 20 um of noise in 1000 points leave about 4


def result(row: str, who: str, seconds: float | None, ours: bool = False) -> dict[str, object]:
    return {"row": row, "who": who, "seconds": seconds, "ours": ours, "version": "1", "error": "does not install"}


def test_the_table_tells_ratio_order_and_who_could_not_be_measured() -> None:
    row = "forward kinematics"
    results = [
        result(row, "TriCal", 1e-7, ours=True),
        result(row, "slow", 3.5e-6),
        result(row, "fast by hand", 5e-8),
        result(row, "broken", None),
    ]
    assert "slow, 3.50 us | 35 |" in table.summary(results)
    assert "fast by hand, 50.0 ns | **0.5** |" in table.summary(results)
    assert table.behind(results) == [(row, "fast by hand", 0.5)]
    text = table.details(results)
    assert text.index("fast by hand") < text.index("**TriCal**") < text.index("slow") < text.index("broken")
    assert "does not install" in text


def test_a_ratio_is_the_median_of_the_rounds_and_says_its_range() -> None:
    row = "forward kinematics"
    results = [
        {**result(row, who, 1e-7 * seconds[k], ours=who == "TriCal"), "round": k + 1}
        for k in range(3)
        for who, seconds in {"TriCal": (1.0, 2.0, 1.0), "peer": (1.5, 4.0, 1.1), "once": (9.0,)}.items()
        if k < len(seconds)
    ]
    # the second round was slow for everybody
    assert "| forward kinematics | 100 ns | peer, 150 ns | 1.5 (1.1 to 2.0) |" in table.summary(results)
    text = table.details(results)
    assert text.count("**TriCal**") == text.count("| peer |") == 1 and "900 ns | 9.0 |" in text
    assert table.behind(results) == []


def test_the_readme_has_a_place_for_its_table() -> None:
    readme = (ROOT / "README.md").read_text()
    new = table.put_between(readme, "./bench writes this table", "| a | b |")
    assert "| a | b |" in new and "| forward kinematics |" not in new
    assert new.split("\n\n")[0] == readme.split("\n\n")[0] and new.split("\n\n")[-1] == readme.split("\n\n")[-1]


def test_a_slope_is_the_exponent() -> None:
    assert table.slope([(n, 3.0 * n**1.5) for n in (1, 10, 200)]) == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(1.234, "1.23 s"), (0.0456, "45.6 ms"), (9.9996e-4, "1.00 ms"), (2.5e-7, "250 ns"), (123.4, "123 s")],
)
def test_times_have_three_digits(seconds: float, text: str) -> None:
    assert table.quantity(seconds) == text


def test_a_target_that_is_missed_is_said_in_bold() -> None:
    one = {"target": "binary", "limit": 20, "unit": "MB", "value": 21.0}
    assert "| binary | 20 MB | 21 MB | **no** |" in table.targets([one])


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_one_thread_and_two_give_the_same_bytes(command: str, task: Path, tmp_path: Path) -> None:
    rows = (task / "elastic_points.csv").read_text().splitlines(keepends=True)
    recording = tmp_path / "points.csv"
    recording.write_text("".join(rows[: 1001 if command == "identify" else 151]))
    said = []
    for threads in ("1", "2"):
        out = tmp_path / f"{threads}.toml"
        run = [program(), command, recording, "--robot", task / "robot.toml", "--cell", task / "cell.toml"]
        env = {"RAYON_NUM_THREADS": threads, "PATH": "/usr/bin"}
        done = subprocess.run([*run, "--out", out, "--json"], check=True, capture_output=True, text=True, env=env)
        said.append((done.stdout, out.read_bytes()))
    assert said[0] == said[1]
