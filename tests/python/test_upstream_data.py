"""The two public recordings: from their own files to TriCal's, on tiny files and on the real rows."""

from __future__ import annotations

import csv
import math
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

import trical
import upstream_data

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "examples" / "upstream_data.py"
Rows = list[dict[str, str]]


def rows_of(path: Path) -> Rows:
    with path.open(newline="") as f:
        return list(csv.DictReader(f))


def savetxt(path: Path, rows: Iterable[Iterable[float]]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(path, list(rows))


# ---- IRB 120 -----------------------------------------------------------------------------------------------------


def irb_repository(where: Path, commanded: list, read: list, targets: list, references: list) -> Path:
    """Files in the folders where the repository keeps them, a broken-off series among them."""
    savetxt(where / "3-Full Measurement/Input/generated_joints.txt", commanded)
    savetxt(where / "3-Full Measurement/Output/measured_joints.txt", read[:2])
    savetxt(where / "4-DataProcess/Input/Backup/measured_joints.txt", read)
    for k, folder in enumerate(
        ("4-DataProcess/Input/Backup", "4-DataProcess/Input", "3-Full Measurement/Output/Backup")
    ):
        savetxt(where / folder / f"measured_SMR_{k + 1}.txt", targets[k])
    for k, folder in enumerate(
        ("3-Full Measurement/Output/Backup", "3-Full Measurement/Output/Backup", "4-DataProcess/Input/Backup")
    ):
        savetxt(where / folder / f"measured_base_{k + 1}.txt", references[k])
    return where


def tiny_irb(where: Path) -> Path:
    commanded = [[10.0 * i, -5.0 * i, 3.0, 0.0, 20.0 + i, -i] for i in range(4)]
    read = [[x + 0.01 for x in row] for row in commanded]
    points = [[[1000.0 * k + i, 2.5, -7.125] for i in range(4)] for k in (1, 2, 3)]
    points[2][1] = [0.0, 0.0, 0.0]  # a lost beam
    for k in range(3):
        points[k][3] = [0.0, 0.0, 0.0]  # a pose of which nothing was seen
    fixed = [[[100.0 * k, 0.0, 1.0]] * 4 for k in (1, 2, 3)]
    return irb_repository(where, commanded, read, points, fixed)


def test_a_tiny_irb120_repository(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert upstream_data.main(["irb120", str(tiny_irb(tmp_path / "clone")), "--out", str(out)]) == 0
    rows = rows_of(out / "tracker.csv")
    assert [r["seq"] for r in rows] == ["0"] * 6 + ["1"] * 5 + ["2"] * 6
    assert [(r["target"], r["reference"]) for r in rows[6:11]] == [
        ("1", ""),
        ("2", ""),
        ("", "1"),
        ("", "2"),
        ("", "3"),
    ]
    assert [rows[6][f"dir{j}"] for j in range(1, 7)] == ["1", "-1", "0", "0", "1", "-1"]
    assert (rows[6]["q1_deg"], rows[6]["qc1_deg"], rows[6]["x_mm"], rows[6]["z_mm"]) == (
        "10.01",
        "10",
        "1001",
        "-7.125",
    )
    assert {rows[0][f"dir{j}"] for j in range(1, 7)} == {"0"}
    trical.Model.nominal(out / "robot.toml", out / "cell.toml")


def test_a_series_of_another_length_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clone = tiny_irb(tmp_path / "clone")
    savetxt(clone / "4-DataProcess/Input/measured_SMR_2.txt", [[1.0, 2.0, 3.0]])
    assert upstream_data.main(["irb120", str(clone), "--out", str(tmp_path / "out")]) == 2
    assert (
        "no measured_SMR_2.txt with 4 rows (4-DataProcess/Input/measured_SMR_2.txt has 1 rows)"
        in capsys.readouterr().err
    )


def test_real_irb120_rows_come_back_as_they_are(shared: Path, tmp_path: Path) -> None:
    """The rows of the recording kept beside this project, put into the repository's layout and read again."""
    rows = rows_of(shared / "irb120" / "tracker.csv")
    n = 1 + max(int(r["seq"]) for r in rows)
    commanded, read = [[math.nan] * 6 for _ in range(n)], [[math.nan] * 6 for _ in range(n)]
    targets, references = ([[[0.0] * 3 for _ in range(n)] for _ in range(3)] for _ in range(2))
    for r in rows:
        i = int(r["seq"])
        commanded[i] = [float(r[f"qc{j}_deg"]) for j in range(1, 7)]
        read[i] = [float(r[f"q{j}_deg"]) for j in range(1, 7)]
        where = targets[int(r["target"]) - 1] if r["target"] else references[int(r["reference"]) - 1]
        where[i] = [float(r[f"{a}_mm"]) for a in "xyz"]
    clone = irb_repository(tmp_path / "clone", commanded, read, targets, references)
    out = tmp_path / "out"
    assert upstream_data.main(["irb120", str(clone), "--out", str(out)]) == 0
    again = rows_of(out / "tracker.csv")
    assert len(again) == len(rows)
    kept = {int(r["seq"]) for r in rows}
    for a, b in zip(again, rows, strict=True):
        senses = {f"dir{j}" for j in range(1, 7)} if int(b["seq"]) - 1 not in kept else set()
        assert {k: v for k, v in a.items() if k not in senses} == {k: v for k, v in b.items() if k not in senses}
    files = {"robot": out / "robot.toml", "cell": out / "cell.toml"}
    result = trical.identify(out / "tracker.csv", **files, joints="commanded", model="compliance", folds=4)
    assert result.cross_validation is not None
    # the paper's 31 parameters by pose, as in the literature; folds of blocks of neighbouring poses are a little harder
    assert result.held_out["by_pose"]["mean_mm"] == pytest.approx(0.122, abs=0.002)
    assert 0.122 < result.cross_validation["mean_mm"] < 0.13


# ---- UR10 --------------------------------------------------------------------------------------------------------

UR10_HEAD = (
    "Timestamp;Goal x;Goal y;Goal z;Goal roll;Goal pitch;Goal yaw;shoulder_pan_joint;shoulder_lift_joint;elbow_joint;"
    "wrist_1_joint;wrist_2_joint;wrist_3_joint;measurement_temperature;measurement_x;measurement_std_x;measurement_y;"
    "measurement_std_y;measurement_z;measurement_std_z;measurement_rx;measurement_std_rx;measurement_ry;"
    "measurement_std_ry;measurement_rz;measurement_std_rz"
)


def ur10_repository(where: Path, lines: list[list[float | None]]) -> Path:
    """Semicolons and decimal commas; each line is joints (rad), temperature, x y z (mm), rx ry rz (deg)."""
    text = [UR10_HEAD]
    for line in lines:
        q, rest = line[:6], line[6:]
        t, point, turn = rest[0], rest[1:4], rest[4:]
        std = [0.01] * 3
        pairs = [x for p in (zip(point, std, strict=True), zip(turn, std, strict=True)) for xy in p for x in xy]
        cells = [
            "2,02011E+13",
            *["0,5"] * 6,
            *("" if x is None else repr(x).replace(".", ",") for x in [*q, t, *pairs]),
        ]
        text.append(";".join(cells))
    path = where / "Series_C" / "measurements_random_poses.csv"
    path.parent.mkdir(parents=True)
    path.write_text("\n".join(text) + "\n")
    return where


def rotation(w: float, x: float, y: float, z: float) -> np.ndarray:
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def turn(axis: int, deg: float) -> np.ndarray:
    c, s = math.cos(math.radians(deg)), math.sin(math.radians(deg))
    r = np.eye(3)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    r[i, i], r[i, j], r[j, i], r[j, j] = c, -s, s, c
    return r


def test_three_angles_are_turns_about_moving_x_then_y_then_z() -> None:
    rng = np.random.default_rng(1)
    for a, b, c in rng.uniform(-180, 180, (20, 3)):
        q = upstream_data.quaternion(a, b, c)
        assert q[0] >= 0
        np.testing.assert_allclose(rotation(*q), turn(0, a) @ turn(1, b) @ turn(2, c), atol=1e-12)


def test_a_tiny_ur10_repository(tmp_path: Path) -> None:
    lines: list[list[float | None]] = [
        [0.0, -1.5, 1.0, 0.0, 0.5, 0.25, 21.75, 380.5, -3200.25, 200.125, -90.0, 0.0, 0.0],
        [0.1, -1.6, 1.0, 0.0, 0.5, 0.25, 21.75, None, None, None, None, None, None],
        [0.2, -1.7, 1.0, 0.0, 0.5, 0.25, None, 381.5, -3201.25, 201.125, -90.0, 0.0, 90.0],
    ]
    out = tmp_path / "out"
    assert upstream_data.main(["ur10", str(ur10_repository(tmp_path / "clone", lines)), "--out", str(out)]) == 0
    rows = rows_of(out / "random.csv")
    assert [r["seq"] for r in rows] == ["0", "2"]
    assert rows[0]["q2_deg"] == "-85.943669" and rows[0]["y_mm"] == "-3200.25"
    assert [rows[0][k] for k in ("qw", "qx", "qy", "qz")] == ["0.707107", "-0.707107", "0", "0"]
    assert [rows[1][f"dir{j}"] for j in range(1, 7)] == ["1", "-1", "0", "0", "0", "0"]
    assert (rows[0]["temp_c"], rows[1]["temp_c"]) == ("21.75", "")
    trical.Model.nominal(out / "robot.toml", out / "cell.toml")


def test_real_ur10_rows_come_back_as_they_are(shared: Path, tmp_path: Path) -> None:
    rows = rows_of(shared / "ur10" / "random.csv")
    lines: list[list[float | None]] = [[None] * 13 for _ in range(1 + max(int(r["seq"]) for r in rows))]
    for r in rows:
        m = rotation(*(float(r[k]) for k in ("qw", "qx", "qy", "qz")))
        angles = math.atan2(-m[1, 2], m[2, 2]), math.asin(m[0, 2]), math.atan2(-m[0, 1], m[0, 0])
        joints = [math.radians(float(r[f"q{j}_deg"])) for j in range(1, 7)]
        point = [float(r[f"{a}_mm"]) for a in "xyz"]
        lines[int(r["seq"])] = [*joints, float(r["temp_c"]), *point, *map(math.degrees, angles)]
    out = tmp_path / "out"
    clone = ur10_repository(tmp_path / "clone", lines)
    assert upstream_data.main(["ur10", str(clone), "--out", str(out)]) == 0
    again = rows_of(out / "random.csv")
    assert [r["seq"] for r in again] == [r["seq"] for r in rows]
    same = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz", "temp_c", *(f"q{j}_deg" for j in range(1, 7)))
    for a, b in zip(again, rows, strict=True):
        np.testing.assert_allclose([float(a[k]) for k in same], [float(b[k]) for k in same], atol=3e-6)


# ---- use ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("recording", ["irb120", "ur10"])
def test_an_empty_folder_ends_with_one_sentence(recording: str, tmp_path: Path) -> None:
    r = subprocess.run(
        [sys.executable, str(SCRIPT), recording, str(tmp_path), "--out", str(tmp_path / "out")],
        capture_output=True,
        text=True,
    )
    assert r.returncode == 2 and r.stderr.startswith("error: ") and r.stderr.count("\n") == 1
