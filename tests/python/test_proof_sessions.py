"""The proof suite's sessions, clusters of poses, naive selection and touches that decide."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import configurations
import decide
import make
import naive
import run
import write
from plant import DEG, MM, readings, simulate
from proof_cases import GAP2


def test_a_session_has_its_own_effects_and_the_arm_has_the_rest(tmp_path: Path) -> None:
    case_id, files, truth = make._job(("sessions", 3, 0, [60]))
    recordings = [f for f in files if f.endswith(".csv")]
    assert recordings == [f"case.s{k + 1}.csv" for k in range(truth["sessions"])] and 2 <= len(recordings) <= 4
    assert len(set(files.values())) == len(files)
    scopes = {(e["scope"] == "arm", e["session"] is None) for e in truth["effects"]}
    assert scopes == {(True, True), (False, False)}
    where = tmp_path / "cases" / case_id
    where.mkdir(parents=True)
    for name, text in files.items():
        (where / name).write_text(text)
    spy = tmp_path / "spy"
    spy.write_text('#!/bin/sh\necho \'{"findings": [], "after": {"mean_mm": 0.5}, "args": "\'"$*"\'"}\'\n')
    spy.chmod(0o755)
    assert run.run(spy, tmp_path, 1) == 0
    answer = json.loads((tmp_path / "answers" / f"{case_id}.json").read_text())
    assert all(f in answer["answer"]["args"] for f in recordings)
    assert answer["tried"] == {"diagnose": 0.5, "identify": 0.5}


def test_readings_of_a_pose_share_what_the_arm_does_not_repeat_and_fresh_poses_are_kept_back() -> None:
    _, files, truth = make._job(("clusters", 4, 0, []))
    assert {f for f in files if f.endswith(".csv")} == {"recording.csv", "fresh/inside.csv", "fresh/anywhere.csv"}
    head, *rows = [line.split(",") for line in files["recording.csv"].splitlines()]
    assert "seq" not in head and "t_s" not in head and len(rows) == 3 * truth["poses"]
    table = np.array(rows, float).reshape(truth["poses"], 3, -1)
    assert (table[:, :, :6] == table[:, :1, :6]).all()
    scatter = table[:, :, 6:].std(1, ddof=1).mean()
    assert 0.6 * truth["sigma_mm"] < scatter < 1.2 * truth["sigma_mm"] < truth["repeats_mm"]
    inside = {line.rsplit(",", 3)[0] for line in files["fresh/inside.csv"].splitlines()[1:]}
    assert not inside & {",".join(r[:6]) for r in rows}


def test_a_naive_selection_finds_what_is_plain(tmp_path: Path) -> None:
    pytest.importorskip("tomllib", reason="Python 3.10 has no reader of TOML")
    d = make.draw("none", 24, 0, [60], 0)
    columns, _, _ = make.measure(d.rng, d.arm, d.s, [{**GAP2, "p": {"gap": 0.1 * DEG}}], "white", False)
    (tmp_path / "robot.toml").write_text(write.robot_toml(d.nominal))
    (tmp_path / "cell.toml").write_text(write.cell_toml(d.nominal))
    (tmp_path / "recording.csv").write_text(write.csv(columns))
    first, *_ = naive.findings(tmp_path)
    assert (first["effect"], first["site"]) == (GAP2["effect"], GAP2["site"]) and first["confidence"] > 0.5


def test_a_second_recording_is_of_the_same_machine() -> None:
    """Without noise a fit to the first session explains the second, effect included; without the effect it does not."""
    d = make.draw("none", 23, 0, [60], 0)
    effect = {"effect": "gear_ratio", "site": {"joint": 2}, "p": {"k": 1e-3}}
    s = replace(d.s, sigma=1e-12, lag=np.zeros_like(d.s.q), rest=np.zeros_like(d.s.q), load=None)
    _, s, _ = make.measure(d.rng, d.arm, s, [effect], "white", False)
    rng = np.random.default_rng(3)
    q, ball = configurations.touches(d.nominal, rng, 6)
    drawn = replace(d, s=s, effects=[effect])
    columns = decide.second_recording(drawn, s, q, ball, configurations.approaches(rng, q, "comes"), rng)
    where = np.stack([columns[f"q{j}_deg"][0] for j in range(1, 7)], 1) * DEG
    read = np.stack([columns[f"i{a}_mm"][0] for a in "xyz"], 1) * MM
    assert np.abs(where - q).max() < 3 * DEG and np.abs(read).max() < 5 * s.spread + 1e-6
    later = replace(s, q=where, ball=ball, temp=np.full(6, s.temp[-1]), t=s.t[:6], dirs=s.dirs[:6], reading=read)
    miss = [np.abs(readings(simulate(d.arm, later, effects)) - read).max() for effects in ([effect], [])]
    assert miss[0] < 1e-6 and miss[1] > 50e-6


def test_decisions_are_counted_by_what_was_undecided() -> None:
    def finding(effect: str, confidence: float, rivals: list[str]) -> dict:
        site = {"joint": 2}
        return {
            "effect": effect,
            "site": site,
            "confidence": confidence,
            "rivals": [{"effect": r, "site": site} for r in rivals],
        }

    after = {
        "planned": finding("gear_ratio", 0.95, []),
        "random 1": finding("gear_ratio", 0.7, ["joint_harmonic"]),
        "random 2": finding("joint_harmonic", 0.99, []),
    }
    truth = {"effect": "gear_ratio", "site": {"joint": 2}}
    before = finding("joint_harmonic", 0.6, ["gear_ratio"])
    text = decide.table([{"id": "a", "truth": truth, "before": before, "after": after}])
    row = "| gear_ratio or joint_harmonic | 1 | 0.0 % (0.0 %) | 100.0 % (100.0 %) | 50.0 % (0.0 %) |"
    assert row in text
