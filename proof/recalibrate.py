"""Learns how stated shares become probabilities: three logistic curves, of place, of family, of effect.

    proof/.venv/bin/python proof/recalibrate.py proof/runs/*/findings.jsonl

prints `settings::RECALIBRATION` for cases that a program answered whose curves were the identity, and how well the
curves do on cases that they were not learnt on: drawn ones in five folds of cases, real ones without any of their arm.
Where halves of the data were searched, a curve is constant + a logit(share) + b logit(found) + c ln(findings) (1 -
found): found is the share of them that say the same, findings how many names the recording has. What halves do not
find is less probable the more there are: what the models of many effects leave looks like further ones. Where a
recording is too short for halves, a curve is constant + d logit(share). Drawn findings are many and easy, real ones
few and hard; weights let the real ones count for a third.
"""

from __future__ import annotations

import argparse
import json
import sys
import zlib
from pathlib import Path

import numpy as np

from proper import calibration_error

# what is stated, whether it is right, and in which halves it was found
WHAT = [
    ("place_confidence", "place_right", "place"),
    ("family_confidence", "family_right", "family"),
    ("confidence", "right", "agree"),
]
# as the program has it
LEAST, LARGEST = 0.01, 0.99
# pull towards the identity, as so many findings would
RIDGE = 1.0
# weight of all findings on real backgrounds beside that of all drawn ones
REAL = 0.5


def features(lines: list[dict], stated: str, found: str) -> np.ndarray:
    p = np.clip([x[stated] for x in lines], LEAST, 1 - LEAST)
    logit = np.log(p / (1 - p))
    parts = np.array([(x["replicated"] or {"parts": 0})["parts"] for x in lines])
    some = np.array([x["replicated"][found] if n else 0 for x, n in zip(lines, parts, strict=True)])
    among_many = np.log([x["findings"] for x in lines]) * (1 - some / np.maximum(parts, 1))
    half = np.log((some + 0.5) / (parts - some + 0.5))
    searched = np.stack([logit, half, among_many]) * (parts > 0)
    return np.stack([np.ones(len(lines)), *searched, logit * (parts == 0)], 1)


def fold_of(line: dict) -> str:
    """Cases that are left out together."""
    return line["background"].split(".")[0] if line["kind"] == "real" else str(zlib.crc32(line["case"].encode()) % 5)


def learn(x: np.ndarray, y: np.ndarray, real: np.ndarray) -> np.ndarray:
    """Penalised maximum likelihood by Newton's method; all real findings weigh `REAL` times all drawn ones."""
    both = real.any() and not real.all()
    weight = np.where(real, REAL * (~real).sum() / real.sum(), 1.0) if both else np.ones(len(y))
    prior = np.array([0.0, 1.0, 0.0, 0.0, 1.0])
    c = prior.copy()
    for _ in range(100):
        p = 1 / (1 + np.exp(-np.clip(x @ c, -30, 30)))
        slope = x.T @ (weight * (y - p)) - RIDGE * (c - prior)
        step = np.linalg.solve(x.T @ (x * (weight * p * (1 - p))[:, None]) + RIDGE * np.eye(5), slope)
        largest = np.abs(step).max()
        c = c + step * min(1.0, 2.0 / max(largest, 1e-12))
        if largest < 1e-10:
            break
    return c


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("findings", nargs="+", type=Path)
    a = parser.parse_args()
    every = [json.loads(line) for path in a.findings for line in path.read_text().splitlines()]
    curves = []
    for stated, right, found in WHAT:
        lines = [x for x in every if x[right] is not None]
        if not lines:
            print(f"{stated}: no finding whose truth is known", file=sys.stderr)
            return 1
        fold = np.array([fold_of(x) for x in lines])
        real = np.array([x["kind"] == "real" for x in lines])
        print(f"{len(lines)} findings, {real.sum()} of them on real backgrounds")
        x, y = features(lines, stated, found), np.array([v[right] for v in lines], float)
        curves.append(learn(x, y, real))
        p = np.empty(len(y))
        for k in sorted(set(fold)):
            c = learn(x[fold != k], y[fold != k], real[fold != k])
            p[fold == k] = np.minimum(1 / (1 + np.exp(-x[fold == k] @ c)), LARGEST)
        was = np.array([v[stated] for v in lines])
        for name, some in (("drawn", ~real), ("real", real), *((k, fold == k) for k in sorted(set(fold[real])))):
            if some.any():
                e = [calibration_error(q[some], y[some], True) for q in (was, p)]
                sure = [int((1 - y[some & (q >= 0.9)]).sum()) for q in (was, p)]
                hits = [int(y[some & (q >= 0.9)].sum()) for q in (was, p)]
                print(
                    f"{stated:18} {name:9}: right {y[some].mean():.2f}, stated {was[some].mean():.2f} -> "
                    f"{p[some].mean():.2f}, calibration error {e[0]:.3f} -> {e[1]:.3f}, at 0.9 or more right "
                    f"{hits[0]} -> {hits[1]}, wrong {sure[0]} -> {sure[1]} of {some.sum()}"
                )
    text = ", ".join("[" + ", ".join(f"{v:.2f}" for v in c) + "]" for c in curves)
    print(f"pub const RECALIBRATION: [[f64; 5]; 3] = [{text}];")
    return 0


if __name__ == "__main__":
    sys.exit(main())
