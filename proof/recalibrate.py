"""Learns how stated shares become probabilities: three logistic curves, of place, of family, of effect.

    proof/.venv/bin/python proof/recalibrate.py proof/runs/*/findings.jsonl

prints `settings::RECALIBRATION` for cases that a program answered whose curves were the identity, and how well the
curves do on cases that they were not learnt on (five folds of cases). A curve is constant + a logit(share) + b (share
of the parts that agree).
"""

from __future__ import annotations

import argparse
import json
import sys
import zlib
from pathlib import Path

import numpy as np

from proper import calibration_error

WHAT = [("place_confidence", "place_right"), ("family_confidence", "family_right"), ("confidence", "right")]
# as the program has it
LEAST, LARGEST = 1e-4, 0.99
# pull towards the identity, as so many findings would
RIDGE = 2.0


def features(lines: list[dict], stated: str) -> np.ndarray:
    p = np.clip([x[stated] for x in lines], LEAST, 1 - LEAST)
    r = [x["replicated"] or {"parts": 0, "agree": 0} for x in lines]
    agree = [x["agree"] / x["parts"] if x["parts"] else 0.5 for x in r]
    return np.stack([np.ones(len(lines)), np.log(p / (1 - p)), agree], 1)


def learn(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Penalised maximum likelihood by Newton's method."""
    prior = np.array([0.0, 1.0, 0.0])
    c = prior.copy()
    for _ in range(50):
        p = 1 / (1 + np.exp(-x @ c))
        slope = x.T @ (y - p) - RIDGE * (c - prior)
        step = np.linalg.solve(x.T @ (x * (p * (1 - p))[:, None]) + RIDGE * np.eye(3), slope)
        c = c + step
        if np.abs(step).max() < 1e-10:
            break
    return c


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("findings", nargs="+", type=Path)
    a = parser.parse_args()
    lines = [json.loads(line) for path in a.findings for line in path.read_text().splitlines()]
    lines = [x for x in lines if x["right"] is not None]
    if not lines:
        print("no finding whose truth is known", file=sys.stderr)
        return 1
    fold = np.array([zlib.crc32(x["case"].encode()) % 5 for x in lines])
    real = np.array([x["kind"] == "real" for x in lines])
    print(f"{len(lines)} findings, {real.sum()} of them on real backgrounds")
    curves = []
    for stated, right in WHAT:
        x, y = features(lines, stated), np.array([v[right] for v in lines], float)
        curves.append(learn(x, y))
        p = np.empty(len(y))
        for k in range(5):
            c = learn(x[fold != k], y[fold != k])
            p[fold == k] = np.minimum(1 / (1 + np.exp(-x[fold == k] @ c)), LARGEST)
        was = np.array([v[stated] for v in lines])
        for name, some in (("drawn", ~real), ("real", real)):
            if some.any():
                e = [calibration_error(q[some], y[some], True) for q in (was, p)]
                sure = [int((1 - y[some & (q >= 0.9)]).sum()) for q in (was, p)]
                print(
                    f"{stated:18} {name:5}: calibration error {e[0]:.3f} -> {e[1]:.3f}, "
                    f"wrong at 0.9 or more {sure[0]} -> {sure[1]} of {some.sum()}"
                )
    text = ", ".join("[" + ", ".join(f"{v:.2f}" for v in c) + "]" for c in curves)
    print(f"pub const RECALIBRATION: [[f64; 3]; 3] = [{text}];")
    return 0


if __name__ == "__main__":
    sys.exit(main())
