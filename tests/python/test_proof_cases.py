"""The proof suite's recordings and its sealed truths."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import make
import run
import score
import write
from proof_cases import arm_and_session

COLUMNS = {
    *(f"{name}{j}{unit}" for j in range(1, 7) for name, unit in (("q", "_deg"), ("qc", "_deg"), ("dir", ""))),
    *("t_s", "temp_c", "payload_kg", "ball", "ix_mm", "iy_mm", "iz_mm", "x_mm", "y_mm", "z_mm"),
}


@pytest.mark.parametrize("kind", ["single", "tracker", "dirty", "arms"])
def test_recordings_keep_the_contract(kind: str) -> None:
    for index in range(4):
        _, files, truth = make.make_case(kind, 6, index, [45])
        head, *rows = [line.split(",") for line in files["recording.csv"].splitlines()]
        assert set(head) <= COLUMNS and len(set(head)) == len(head)
        table = {name: np.array([float(r[i]) for r in rows]) for i, name in enumerate(head)}
        assert len(rows) == truth["measurements"] and {f"q{j}_deg" for j in range(1, 7)} <= set(head)
        assert (np.diff(table["t_s"]) > 0).all()
        assert set(np.concatenate([table[f"dir{j}"] for j in range(1, 7)])) <= {-1.0, 0.0, 1.0}
        assert ("qc1_deg" in head) == truth["session"]["commanded"]
        assert ("temp_c" in head) == truth["session"]["thermometer"]
        assert ("payload_kg" in head) == truth["session"]["payload_schedule"]
        if kind == "tracker":
            assert {"x_mm", "y_mm", "z_mm"} <= set(head) and "ball" not in head
        else:
            assert set(table["ball"]) <= set(range(1, truth["session"]["balls"] + 1))
            assert {"ix_mm", "iy_mm", "iz_mm"} <= set(head)
            assert np.abs([table[f"i{a}_mm"] for a in "xyz"]).max() < 8.0


def test_arm_and_cell_files_keep_the_contract() -> None:
    tomllib = pytest.importorskip("tomllib", reason="Python 3.10 has no reader of TOML")
    arm, _ = arm_and_session(7)
    robot, cell = tomllib.loads(write.robot_toml(arm)), tomllib.loads(write.cell_toml(arm))
    assert set(robot) == {"name", "joint"} and len(robot["joint"]) == 6
    keys = {"alpha_deg", "a_mm", "d_mm", "theta_offset_deg", "limits_deg", "mass_kg", "cog_mm"}
    assert all(set(j) == keys for j in robot["joint"])
    assert set(cell) == {"base", "tool", "balls"}
    assert set(cell["balls"]["distances_mm"]) == {"d12", "d13", "d23"}
    assert set(cell["tool"]) == {"tcp_mm", "mass_kg", "cog_mm"} and set(cell["base"]) == {"xyz_mm", "zyx_deg"}


def test_nothing_that_the_diagnosis_sees_tells_the_kind() -> None:
    case_id, files, _ = make.make_case("none", 8, 0, [45])
    assert not any(word in text for text in files.values() for word in make.KINDS)
    assert case_id not in files["recording.csv"]


def contents(where: Path) -> dict[str, bytes]:
    return {str(p.relative_to(where)): p.read_bytes() for p in sorted(where.rglob("*")) if p.is_file()}


def test_the_same_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    digests = [make.make("single", seed, 2, tmp_path / name, [45], 1) for seed, name in ((9, "a"), (9, "b"), (10, "c"))]
    assert digests[0] == digests[1] != digests[2]
    assert contents(tmp_path / "a") == contents(tmp_path / "b")
    assert not set(contents(tmp_path / "a").values()) & set(contents(tmp_path / "c").values())


def test_a_changed_truth_is_refused(tmp_path: Path) -> None:
    make.make("none", 11, 1, tmp_path, [45], 1)
    score.load(tmp_path)
    path = tmp_path / "sealed" / "truth.json"
    path.write_bytes(path.read_bytes().replace(b'"white"', b'"black"'))
    with pytest.raises(SystemExit, match="is not the truth whose hash was printed"):
        score.load(tmp_path)


def test_the_program_is_given_nothing_but_arm_cell_and_recording(tmp_path: Path) -> None:
    make.make("none", 12, 1, tmp_path, [45], 1)
    spy = tmp_path / "spy"
    spy.write_text('#!/bin/sh\nprintf \'{"findings": [], "seen": "%s", "args": "%s"}\' "$(ls)" "$*" | tr "\\n" " "\n')
    spy.chmod(0o755)
    assert run.run(spy, tmp_path, 1) == 0
    (answer,) = (json.loads(p.read_text())["answer"] for p in (tmp_path / "answers").iterdir())
    assert answer["seen"].split() == ["cell.toml", "recording.csv", "robot.toml"]
    assert "none" not in answer["args"] and str(tmp_path) not in answer["args"]
