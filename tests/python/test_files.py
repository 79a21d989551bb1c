"""Files from and for other programs: as the commands write them."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trical
from conftest import program
from terms import link, term

ROOT = Path(__file__).resolve().parents[2]
ARM = ROOT / "cells" / "irb120"
FILES: Any = {"robot": ARM / "robot.toml", "cell": ARM / "cell.toml"}


@pytest.fixture
def model() -> trical.Model:
    return trical.Model.nominal(**FILES).with_terms(term("a_2", "geometry", 0.7, "mm", link(2, "a")))


@pytest.fixture
def touches(model: trical.Model, tmp_path: Path) -> Path:
    q = trical.poses(8, **FILES, sphere=[0.15, 0.1, 0.1, 0.2])
    trical.simulate(model, q, target=1).save(tmp_path / "points.csv")
    return tmp_path / "points.csv"


def command(*args: object) -> dict[str, Any]:
    done = subprocess.run([program(), *map(str, args), "--json"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def test_csv_to_mcap_and_back(touches: Path, tmp_path: Path) -> None:
    said = trical.convert(touches, tmp_path / "points.mcap")
    assert said == {"rows": 8, "joints": 6, "lost": None, "out": str(tmp_path / "points.mcap")}
    trical.convert(tmp_path / "points.mcap", tmp_path / "back.csv")
    was, back = trical.Recording.load(touches), trical.Recording.load(tmp_path / "back.csv")
    assert np.allclose(back.q, was.q, rtol=0, atol=1e-14) and back.kind.tolist() == ["point"] * 8
    assert np.allclose(back.position, was.position, rtol=0, atol=1e-13), "an MCAP holds 1e-10 mm"


def test_of_a_damaged_mcap_what_is_whole(touches: Path, tmp_path: Path) -> None:
    trical.convert(touches, tmp_path / "points.mcap")
    whole = (tmp_path / "points.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) * 3 // 4])
    with pytest.raises(trical.RecordingError, match=r"part=True|no complete measurement"):
        trical.Recording.load(tmp_path / "cut.mcap")
    said = trical.convert(tmp_path / "cut.mcap", tmp_path / "cut.csv")
    assert 0 < said["rows"] <= 8 and "cut.mcap" in said["lost"]


def test_a_urdf_becomes_a_robot(model: trical.Model, tmp_path: Path) -> None:
    model.save_urdf(tmp_path / "arm.urdf")
    said = trical.convert(f"{tmp_path}/arm.urdf#base_link:flange", tmp_path / "arm.toml")
    assert len(said["joints"]) == 6 and (said["root"], said["tip"]) == ("base_link", "flange")
    assert trical.Robot.load(tmp_path / "arm.toml").dof == 6
    assert "from link base_link to link flange" in (tmp_path / "arm.toml").read_text().splitlines()[0]


def test_what_cannot_be_converted(touches: Path, tmp_path: Path) -> None:
    with pytest.raises(trical.TricalError, match=r"must end in .csv or .mcap"):
        trical.convert(touches, tmp_path / "points.bag")
    with pytest.raises(trical.TricalError, match=r"the folder .* does not exist"):
        trical.convert(touches, tmp_path / "nowhere" / "points.mcap")
    with pytest.raises(trical.RecordingError, match="cannot be read"):
        trical.convert(tmp_path / "none.csv", tmp_path / "points.mcap")


def test_nothing_is_written_over_what_is_read(model: trical.Model, touches: Path, tmp_path: Path) -> None:
    model.save(tmp_path / "m.toml")
    model.save_urdf(tmp_path / "arm.urdf")
    (tmp_path / "p.csv").write_text("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n10,20,10,5,60,-7\n")
    own = {kind: tmp_path / f"{kind}.toml" for kind in FILES}
    for kind, path in own.items():
        path.write_bytes(FILES[kind].read_bytes())
    kept = {p: p.read_bytes() for p in (touches, tmp_path / "m.toml", tmp_path / "arm.urdf", *own.values())}
    map_ = tmp_path / "map.csv"
    for call, said in (
        (lambda: trical.convert(touches, tmp_path / "." / "points.csv"), "is read, too, and would be replaced"),
        (lambda: trical.export(tmp_path / "m.toml", mdh=tmp_path / "m.toml"), "is read, too"),
        (lambda: trical.export(model, robot=tmp_path / "arm.urdf", urdf=tmp_path / "arm.urdf"), "is read, too"),
        (lambda: trical.export(model, mdh=map_, error_map=map_), "error_map: found .*, which mdh names, too"),
        (lambda: trical.export(model, error_map=touches), "is a recording, and would be replaced"),
        (lambda: trical.compensate(tmp_path / "m.toml", model, tmp_path / "m.toml", **FILES), "is read, too"),
        (lambda: trical.compensate(tmp_path / "p.csv", model, own["cell"], **own), "is read, too"),
        (lambda: trical.compensate(tmp_path / "p.csv", model, own["robot"], **own), "is read, too"),
    ):
        with pytest.raises(trical.TricalError, match=said):
            call()
    assert all(p.read_bytes() == b for p, b in kept.items()) and not map_.exists()
    assert trical.parameters(tmp_path / "m.toml") == trical.parameters(model)


def test_exports_are_those_of_the_command(model: trical.Model, tmp_path: Path) -> None:
    model.save(tmp_path / "m.toml")
    kinds = {"urdf": "arm.urdf", "mdh": "arm.json", "error_map": "map.csv"}
    ours = trical.export(tmp_path / "m.toml", **{k: tmp_path / v for k, v in kinds.items()}, poses=50)
    assert ours["error_map"]["max_mm"] > 0.5 and ours["left_out"] == [] and ours["same_frames"] is True
    bytes_of = {v: (tmp_path / v).read_bytes() for v in kinds.values()}
    flags = ["--urdf", tmp_path / "arm.urdf", "--mdh", tmp_path / "arm.json", "--error-map", tmp_path / "map.csv"]
    theirs = command("export", "--model", tmp_path / "m.toml", *flags, "--poses", 50)
    assert theirs == ours and all((tmp_path / v).read_bytes() == b for v, b in bytes_of.items())
    for name in ("arm.csv", "arm.toml"):
        trical.export(model, mdh=tmp_path / name)
        assert (tmp_path / name).stat().st_size > 300
    assert trical.export(model, robot=FILES["robot"], mdh=tmp_path / "arm.csv")["written"] == [
        str(tmp_path / "arm.csv")
    ]
    with pytest.raises(trical.WrongModelError):
        trical.export(model, robot=ROOT / "robots" / "ur5e.toml", mdh=tmp_path / "arm.csv")
    with pytest.raises(trical.TricalError, match="nothing to write"):
        trical.export(model)
    with pytest.raises(trical.TricalError, match=r"must end in .toml, .json or .csv"):
        trical.export(model, mdh=tmp_path / "arm.txt")


def test_poses_that_show_a_reflector_to_a_tracker() -> None:
    tracker = np.array([2.5, 0.0, 0.5])
    q = trical.poses(12, **FILES, facing=tracker, facing_axis=(1, 0, 0), facing_within=np.radians(25))
    at, rotation = trical.Model.nominal(**FILES).forward(q)
    to = (tracker - at) / np.linalg.norm(tracker - at, axis=1)[:, None]
    assert np.degrees(np.arccos((rotation[:, :, 0] * to).sum(axis=1))).max() < 25.001
    with pytest.raises(trical.TricalError, match="expected a direction"):
        trical.poses(1, **FILES, facing=tracker, facing_axis=(0, 0, 0))
    with pytest.raises(trical.TricalError, match="facing has 2 numbers"):
        trical.poses(1, **FILES, facing=(1, 2))
