#!/usr/bin/env python3
"""Turns two public recordings of real arms into TriCal's CSV, so that everybody can repeat the real results.

    git clone https://github.com/icelinker/Robot-Calibration-LaserTracker
    git clone https://github.com/christianlandgraf/ipa-robot-accuracy
    python examples/upstream_data.py irb120 Robot-Calibration-LaserTracker --out irb120
    python examples/upstream_data.py ur10 ipa-robot-accuracy --out ur10

Each leaves a recording (tracker.csv or random.csv), a robot.toml and a cell.toml. The IRB 120 recording states no
licence: use it, do not pass it on. Needs nothing but Python.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import math
import shutil
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

ROBOTS = Path(__file__).resolve().parents[1] / "cells"
JOINTS = range(1, 7)
MOVED_DEG = 1e-6  # a joint whose target changes by less has no sense of motion


class Unusable(Exception):
    """The folder or file is not what this program expects; the message is one sentence."""


def senses(targets_deg: Sequence[Sequence[float]]) -> list[list[int]]:
    """Sense of each joint's last motion, from the order of the poses: zero at the first."""
    out = [[0] * 6]
    for before, now in itertools.pairwise(targets_deg):
        moves = [b - a for a, b in zip(before, now, strict=True)]
        out.append([0 if abs(m) < MOVED_DEG else int(math.copysign(1, m)) for m in moves])
    return out


def number(x: float, digits: int = 6) -> str:
    """Plain decimals, no trailing zeros, no minus zero."""
    text = f"{x:.{digits}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def write_csv(path: Path, head: Sequence[str], rows: Iterable[Sequence[str]]) -> int:
    """Writes a recording and returns the number of its rows."""
    n = 0
    with path.open("w", newline="", encoding="utf-8") as f:
        w = csv.writer(f, lineterminator="\n")
        w.writerow(head)
        for row in rows:
            w.writerow(row)
            n += 1
    return n


# ---- ABB IRB 120, FARO laser tracker (Kamali 2018) ---------------------------------------------------------------

IRB_FOLDERS = (
    "4-DataProcess/Input/Backup",
    "4-DataProcess/Input",
    "3-Full Measurement/Output/Backup",
    "3-Full Measurement/Output",
    "3-Full Measurement/Input",
    "2-Configuration Generation/Output",
)

IRB_CELL = """\
# The measuring frame is the tracker's own: unknown, and identified with the rest. {w} is the arm's foot.
[base]
xyz_mm = [0.0, 0.0, 0.0]
zyx_deg = [0.0, 0.0, 0.0]

[tool]                       # three reflectors; only roughly known, and identified too
tcp_mm = [0.0, 0.0, 125.0]
targets_mm = [[0.0, 0.0, 125.0], [75.0, 90.0, 215.0], [150.0, 0.0, 125.0]]
mass_kg = 0.5                # an assumption: the recording does not say
cog_mm = [40.0, 15.0, 90.0]
"""


def table(path: Path, columns: int) -> list[list[float]]:
    """Numbers of a text file as NumPy's savetxt writes it."""
    rows = []
    for i, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if not line.strip():
            continue
        try:
            row = [float(x) for x in line.split()]
        except ValueError as e:
            raise Unusable(f"{path}, line {i}: {e}") from None
        if len(row) != columns:
            raise Unusable(f"{path}, line {i}: {len(row)} numbers, expected {columns}")
        rows.append(row)
    return rows


def find_table(repository: Path, name: str, columns: int, rows: int | None = None) -> list[list[float]]:
    """The first file of that name with that many rows: the repository also holds files of broken-off series."""
    seen = []
    for folder in IRB_FOLDERS:
        path = repository / folder / name
        if path.is_file():
            found = table(path, columns)
            if found and (rows is None or len(found) == rows):
                return found
            seen.append(f"{folder}/{name} has {len(found)} rows")
    found_instead = "; ".join(seen) or f"looked in {', '.join(IRB_FOLDERS)}"
    wanted = name if rows is None else f"{name} with {rows} rows"
    raise Unusable(f"{repository}: no {wanted} ({found_instead})")


def irb120(repository: Path, out: Path) -> str:
    """Three reflectors on the tool, three fixed in the cell, joints as commanded and as read. A lost beam, which the
    repository writes as 0 0 0, is left out; so is a pose of which nothing on the tool was seen."""
    commanded = find_table(repository, "generated_joints.txt", 6)
    n = len(commanded)
    read = find_table(repository, "measured_joints.txt", 6, n)
    targets = [find_table(repository, f"measured_SMR_{k}.txt", 3, n) for k in (1, 2, 3)]
    references = [find_table(repository, f"measured_base_{k}.txt", 3, n) for k in (1, 2, 3)]
    moved = senses(commanded)
    poses = 0

    def rows() -> Iterable[list[str]]:
        nonlocal poses
        for i in range(n):
            pose = [str(i), *map(number, read[i]), *map(number, commanded[i]), *map(str, moved[i])]
            seen = [(str(k), "", t[i]) for k, t in enumerate(targets, 1) if any(t[i])]
            if not seen:
                continue
            poses += 1
            seen += [("", str(k), r[i]) for k, r in enumerate(references, 1) if any(r[i])]
            for target, reference, point in seen:
                yield [*pose, target, reference, *map(number, point)]

    head = ["seq", *(f"q{j}_deg" for j in JOINTS), *(f"qc{j}_deg" for j in JOINTS), *(f"dir{j}" for j in JOINTS)]
    m = write_csv(out / "tracker.csv", [*head, "target", "reference", "x_mm", "y_mm", "z_mm"], rows())
    shutil.copyfile(ROBOTS / "irb120" / "robot.toml", out / "robot.toml")
    (out / "cell.toml").write_text(IRB_CELL, encoding="utf-8")
    return f"{m} points of {poses} poses in {out / 'tracker.csv'}"


# ---- Universal Robots UR10, Leica tracker with a T-Mac (Landgraf et al. 2021) ------------------------------------

UR10_SERIES = Path("Series_C") / "measurements_random_poses.csv"
UR10_JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
UR10_POINT = ("measurement_x", "measurement_y", "measurement_z")
UR10_TURN = ("measurement_rx", "measurement_ry", "measurement_rz")
UR10_TEMPERATURE = "measurement_temperature"

UR10_CELL = """\
# The measuring frame is the tracker's own: unknown, and identified with the rest. {w} is the arm's foot.
[base]
xyz_mm = [0.0, 0.0, 0.0]
zyx_deg = [0.0, 0.0, 0.0]

[tool]                       # a probe with six degrees of freedom; only roughly known, and identified too
tcp_mm = [0.0, 85.0, 110.0]
mass_kg = 1.0                # an assumption: the recording does not say
cog_mm = [0.0, 0.0, 60.0]
"""


def quaternion(rx_deg: float, ry_deg: float, rz_deg: float) -> tuple[float, float, float, float]:
    """(w, x, y, z) of R = Rx(rx) Ry(ry) Rz(rz), w not negative: the repository's own reading of its three angles."""
    a, b, c = (math.radians(x) / 2 for x in (rx_deg, ry_deg, rz_deg))
    ca, sa, cb, sb, cc, sc = math.cos(a), math.sin(a), math.cos(b), math.sin(b), math.cos(c), math.sin(c)
    w = ca * cb * cc - sa * sb * sc
    x = sa * cb * cc + ca * sb * sc
    y = ca * sb * cc - sa * cb * sc
    z = ca * cb * sc + sa * sb * cc
    return (w, x, y, z) if w >= 0 else (-w, -x, -y, -z)


def ur10(repository: Path, out: Path) -> str:
    """Pose of the probe in the tracker's frame, ambient temperature; rows without a measurement are left out."""
    path = repository / UR10_SERIES
    if not path.is_file():
        raise Unusable(f"{repository}: no {UR10_SERIES}")
    with path.open(newline="", encoding="utf-8-sig") as f:
        reader = csv.DictReader(f, delimiter=";")
        names = (*UR10_JOINTS, *UR10_POINT, *UR10_TURN, UR10_TEMPERATURE)
        missing = [name for name in names if name not in (reader.fieldnames or [])]
        if missing:
            raise Unusable(f"{path}: no column {missing[0]}")
        lines = list(reader)

    def value(i: int, name: str) -> float:
        text = (lines[i][name] or "").replace(",", ".").strip()
        try:
            return float(text) if text else math.nan
        except ValueError:
            raise Unusable(f"{path}, line {i + 2}: {name} is '{text}', expected a number") from None

    joints = [[math.degrees(value(i, name)) for name in UR10_JOINTS] for i in range(len(lines))]
    moved = senses(joints)

    def rows() -> Iterable[list[str]]:
        for i in range(len(lines)):
            point = [value(i, name) for name in UR10_POINT]
            turn = [value(i, name) for name in UR10_TURN]
            if not all(map(math.isfinite, [*joints[i], *point, *turn])) or not any(point):
                continue
            temperature = value(i, UR10_TEMPERATURE)
            pose = [str(i), *map(number, joints[i]), *map(str, moved[i]), *map(number, point)]
            known = "" if math.isnan(temperature) else number(temperature, 4)
            yield [*pose, *map(number, quaternion(*turn)), known]

    head = ["seq", *(f"q{j}_deg" for j in JOINTS), *(f"dir{j}" for j in JOINTS), "x_mm", "y_mm", "z_mm"]
    n = write_csv(out / "random.csv", [*head, "qw", "qx", "qy", "qz", "temp_c"], rows())
    shutil.copyfile(ROBOTS / "ur10" / "robot.toml", out / "robot.toml")
    (out / "cell.toml").write_text(UR10_CELL, encoding="utf-8")
    return f"{n} poses in {out / 'random.csv'}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; exit code 2 where the input is not what was expected."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", choices=("irb120", "ur10"))
    parser.add_argument("repository", type=Path, help="folder of the cloned repository")
    parser.add_argument("--out", type=Path, required=True, help="folder for recording, robot.toml and cell.toml")
    a = parser.parse_args(arguments)
    try:
        if not a.repository.is_dir():
            raise Unusable(f"{a.repository}: no such folder")
        a.out.mkdir(parents=True, exist_ok=True)
        print({"irb120": irb120, "ur10": ur10}[a.recording](a.repository, a.out))
    except (Unusable, OSError, UnicodeDecodeError) as e:
        print(f"error: {e}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
