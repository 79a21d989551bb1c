"""Diagnosis from Python."""

from __future__ import annotations

import json
import pickle
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

import make
import trical
from conftest import program


def test_a_recording_says_the_same_here_and_on_the_command_line(shared: Path, tmp_path: Path) -> None:
    d = shared / "blind"
    files = {"robot": d / "robot.toml", "cell": d / "cell.toml"}
    recording = d / "B08.probe.csv"
    found = trical.diagnose(recording, **files)
    command = [program(), "diagnose", str(recording), "--robot", str(files["robot"]), "--cell", str(files["cell"])]
    done = subprocess.run([*command, "--json"], capture_output=True, text=True, check=True)
    said = json.loads(done.stdout)
    assert found.answer["findings"] == said["findings"] and len(found.findings) == len(said["findings"]) > 0
    for ours, theirs in zip(found.findings, said["findings"], strict=True):
        assert {k: ours[k] for k in ("effect", "site", "confidence", "lambda", "share", "summary")} == {
            k: theirs[k] for k in ("effect", "site", "confidence", "lambda", "share", "summary")
        }
        # nothing of the JSON is lost on the way
        assert set(theirs) == set(ours.keys()) | {k for k, v in theirs.items() if v is None}
        assert [c.value for c in ours.coefficients] == [c["value"] for c in theirs["coefficients"]]
        assert ours.evidence.p_value == theirs["evidence"]["p_value"]
        assert set(theirs["evidence"]) == set(ours.evidence.keys())
    assert [(b.effect, b.site, b.lambda_) for b in found.blind_to] == [
        (b["effect"], b["site"], b["lambda"]) for b in said["blind_to"]
    ]
    assert str(found).splitlines() == said["verdict"]["lines"]
    found.model.save(tmp_path / "improved.toml")
    after = trical.validate(trical.Model.load(tmp_path / "improved.toml"), recording, **files)
    assert after["after"]["mean_mm"] < after["before"]["mean_mm"]


def test_the_real_arm_says_what_it_lacks_and_is_predicted_to_hundredths(shared: Path, tmp_path: Path) -> None:
    """An IRB 120 without a clock or a thermometer: joints were read before they arrived, and the arm warmed up."""
    d = shared / "irb120"
    files = {"robot": d / "robot.toml", "cell": d / "cell.toml"}
    found = trical.diagnose(d / "tracker.csv", **files)
    assert found.answer["final"]["holdout_mean_mm"] < 0.030 and found.answer["final"]["forward_mean_mm"] < 0.06
    first = found.findings[0]
    assert first["effect"] == "late_joint_reading" and first["coefficients"][0]["value"] == pytest.approx(1.0, abs=0.02)
    (growth,) = [f for f in found.findings if f["effect"] == "thermal_growth"]
    # a cold arm warms by 5 to 15 K: aluminium, 23e-6 / K
    assert growth["confidence"] > 0.8 and 1e-4 < growth["coefficients"][0]["value"] < 4e-4
    found.model.save(tmp_path / "improved.toml")
    after = trical.validate(trical.Model.load(tmp_path / "improved.toml"), d / "tracker.csv", **files)
    assert after["after"]["median_mm"] < 0.03
    # programs command joints: there is no reading that lags behind them
    q = np.radians([[10.0, -20.0, 15.0, 30.0, 40.0, 50.0], [0.0, 30.0, -20.0, -60.0, 70.0, 10.0]])
    positions, rotations = found.model.forward(q, seq=900.0)
    np.testing.assert_allclose(found.model.inverse(positions, rotations, q + 0.01, seq=900.0), q, atol=1e-9)


def test_the_real_arm_by_names_alone(shared: Path) -> None:
    """What has no name is told, not modelled."""
    d = shared / "irb120"
    files = {"robot": d / "robot.toml", "cell": d / "cell.toml"}
    named = trical.diagnose(d / "tracker.csv", **files, names_only=True)
    assert named.answer["final"]["holdout_mean_mm"] < 0.038 and named.answer["final"]["forward_mean_mm"] < 0.04
    assert 'effect = "unexplained"' not in named.model.to_toml() and named.unexplained
    # gravity's torque about joint 2 changes its sign near -32 deg, below which the error grows
    if not any(f["effect"] == "lost_motion_gravity" and f["site"] == {"joint": 2} for f in named.findings):
        pytest.xfail("by names alone, other effects of joint 2 take the place of lost_motion_gravity")


def test_what_one_session_is_worth_for_the_others_is_said_of_the_plain_and_of_the_whole_model(tmp_path: Path) -> None:
    _, files, truth = make._job(("sessions", 3, 0, [60]))
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    sessions = sorted(tmp_path.glob("case.s*.csv"))
    assert len(sessions) == truth["sessions"] == 4
    known = {"robot": tmp_path / "robot.toml", "cell": tmp_path / "cell.toml"}
    answer = trical.diagnose(sessions, **known).answer
    plain, whole = answer["baseline"]["by_session"], answer["final"]["held_out"]["by_session"]
    # each session has its own tool and balls: without the first, those of the second are everybody's
    assert plain["rms_mm"] == pytest.approx(
        trical.identify(sessions, **known).held_out["by_session"]["rms_mm"], rel=0.02
    )
    assert whole["rms_mm"] < 0.7 * plain["rms_mm"]
    assert not any("one session is worth" in c for c in answer["cautions"])
    assert trical.diagnose(sessions[0], **known).answer["baseline"]["by_session"] is None


def test_the_catalogue_is_that_of_the_program() -> None:
    names = [e["name"] for e in trical.effects()]
    assert len(names) == len(set(names)) and "axis_twist" in names
    done = subprocess.run([program(), "effects", "--json"], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == trical.effects()


@pytest.mark.parametrize("kind", [trical.TricalError, trical.NotConvergedError])
def test_errors_travel_between_processes(kind: type[Exception]) -> None:
    again = pickle.loads(pickle.dumps(kind("line 3: found nothing")))
    assert type(again) is kind and str(again) == "line 3: found nothing"


def test_an_arm_in_sockets_is_diagnosed_from_what_identify_finds_and_proved_at_places_held_out(shared: Path) -> None:
    d = shared / "mukca"
    files = {"robot": f"{d / 'panda.urdf'}#panda_link0:ball_link", "cell": d / "panda.cell.toml"}
    answer = trical.diagnose(d / "panda_6.csv", **files).answer
    plain, whole = answer["baseline"]["by_place"], answer["final"]["held_out"]["by_place"]
    identified = trical.identify(d / "panda_6.csv", **files).held_out["by_place"]
    assert plain["mean_mm"] == pytest.approx(identified["mean_mm"], rel=0.03)
    assert whole["mean_mm"] <= plain["mean_mm"] and whole["mean_mm"] < 0.22
    assert any("assumed to have the same mass" in c for c in answer["cautions"])


def test_what_is_known_beforehand_is_known_in_python_too(tmp_path: Path) -> None:
    files = trical.sample()
    known = tmp_path / "known.toml"
    known.write_text('[[parameter]]\nname = "a_2"\nvalue = 269.745\nsd = 0.0001\n')
    found = trical.diagnose(files.recording, robot=files.robot, cell=files.cell, known=known)
    (a_2,) = re.findall(r'name = "a_2"\n.*\n.*\nsd = (\S+)\n', found.model.to_toml())
    assert float(a_2) < 2e-4
    known.write_text('[[parameter]]\nname = "a_9"\nvalue = 1\nsd = 1\n')
    with pytest.raises(ValueError, match="parameter a_9 is not among those"):
        trical.diagnose(files.recording, robot=files.robot, cell=files.cell, known=known)
