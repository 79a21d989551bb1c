"""TriCal from Python, as a NumPy user calls it."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))
from measure import FOLDER, cpu_time, wants  # isort: skip

import json

import numpy as np

import trical

FILES = {"robot": str(FOLDER / "robot.toml"), "cell": str(FOLDER / "cell.toml")}


def report(row, who, seconds, accuracy=""):
    """A line of the table, marked as ours."""
    line = {
        "row": row,
        "who": who,
        "ours": True,
        "version": trical.__version__,
        "seconds": seconds,
        "accuracy": accuracy,
    }
    print(json.dumps(line), flush=True)


def main():
    """All rows."""
    q = np.loadtxt(FOLDER / "joints.txt")
    fit = lambda: trical.identify([str(FOLDER / "elastic_touches.csv")], **FILES)  # noqa: E731
    row = "identification, 45 touches from CSV, from Python"
    if wants(row):
        report(row, "TriCal, Python: read, choose, fit, gross errors", cpu_time(fit))
    model = trical.identify([str(FOLDER / "rigid_touches.csv")], model="geometry", **FILES).model
    if wants("forward kinematics"):
        who = "TriCal, Python, 1000 poses a call, 26 parameters"
        report("forward kinematics", who, cpu_time(lambda: model.forward(q)) / len(q))
    if wants("Jacobian"):
        who = "TriCal, Python, 1000 poses a call, 26 parameters"
        report("Jacobian", who, cpu_time(lambda: model.jacobian(q)) / len(q))


if __name__ == "__main__":
    main()
