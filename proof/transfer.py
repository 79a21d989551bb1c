#!/usr/bin/env python3
"""How far does a model carry? Halves of real recordings: learnt on one, tried on the other.

    transfer.py --binary ../target/release/trical

The halves are those of each joint's angles, and of the session's course. Measuring frame and targets are identified
anew from every fourth pose of the half that is tried, the other poses are scored: mean position errors of plain
calibration (`identify`) and of the model of a diagnosis.
"""

from __future__ import annotations

import argparse
import csv
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

import real
from compare import run

RECORDINGS = ["irb120/tracker.csv", "kuka_rail/rail.csv", "iiwa7/20161118_run_1.csv"]


def halves(recording: Path) -> dict[str, list[list[list[str]]]]:
    """The rows of both halves by what divides them, each with the header."""
    header, *rows = csv.reader(recording.open())
    pose_of = [row[header.index("seq")] for row in rows] if "seq" in header else [str(k) for k in range(len(rows))]
    course = list(dict.fromkeys(pose_of))
    first = [rows[pose_of.index(pose)] for pose in course]
    joints = [c for c in header if c.startswith("q") and c[1:2].isdigit()]
    measures = {"course": np.arange(len(course), dtype=float)}
    measures |= {c.split("_")[0]: np.array([float(row[header.index(c)]) for row in first]) for c in joints}
    out = {}
    for name, values in measures.items():
        lower = {course[k] for k in np.argsort(values, kind="stable")[: len(course) // 2]}
        parts = [
            [row for row, pose in zip(rows, pose_of, strict=True) if (pose in lower) == low] for low in (True, False)
        ]
        out[name] = [[header, *part] for part in parts]
    return out


def tried(job: tuple[Path, str, str, list, list, Path]) -> tuple[str, str, str, float, float]:
    """Mean errors (mm) of plain calibration and of a diagnosis of one half, on the other."""
    recording, split, direction, learnt, other, binary = job
    folder = recording.parent
    robot = next(p for p in (folder / "robot.toml", folder / "robot.urdf") if p.is_file())
    arm = ["--robot", str(robot), "--cell", str(folder / "cell.toml"), "--json"]
    with tempfile.TemporaryDirectory() as name:
        at = Path(name)
        for file, rows in (("learnt.csv", learnt), ("other.csv", other)):
            with (at / file).open("w", newline="") as out:
                csv.writer(out).writerows(rows)
        errors = []
        for command in ("identify", "diagnose"):
            run(binary, command, str(at / "learnt.csv"), *arm, "--out", str(at / "model.toml"))
            refit = ["--model", str(at / "model.toml"), "--refit", "frame,targets"]
            errors.append(run(binary, "validate", str(at / "other.csv"), *arm, *refit)["after"]["mean_mm"])
    return folder.name, split, direction, errors[0], errors[1]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--binary", type=Path, required=True)
    parser.add_argument("--processes", type=int, default=2)
    args = parser.parse_args()
    shared = real.data()
    if shared is None:
        print("transfer.py: the recordings (../shared/data) are not here", file=sys.stderr)
        return 1
    jobs = []
    for recording in (shared / name for name in RECORDINGS):
        for split, (a, b) in halves(recording).items():
            jobs += [(recording, split, "up", a, b, args.binary), (recording, split, "down", b, a, args.binary)]
    with ThreadPoolExecutor(args.processes) as pool:
        results = list(pool.map(tried, jobs))
    print("| arm | halves by | direction | plain calibration, mm | after the diagnosis, mm | ratio |")
    print("|---|---|---|---:|---:|---:|")
    for arm, split, direction, plain, whole in results:
        print(f"| {arm} | {split} | {direction} | {plain:.3f} | {whole:.3f} | {whole / plain:.2f} |")
    for arm in dict.fromkeys(r[0] for r in results):
        ratios = np.array([whole / plain for name, *_, plain, whole in results if name == arm])
        better, mean = int(np.sum(ratios < 1.0)), np.exp(np.mean(np.log(ratios)))
        between = f"{min(ratios):.2f} to {max(ratios):.2f}"
        print(f"{arm}: better in {better} of {len(ratios)}, {mean:.2f} times plain calibration ({between})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
