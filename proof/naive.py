#!/usr/bin/env python3
"""What one writes in an afternoon: forward selection by BIC over simple columns, to compare the diagnosis with.

    naive.py --dir DIR

reads what the diagnosis reads, fits the paper's parameters, and takes columns of effects at their usual sizes, and
waves of 10 to 300 cycles a turn, as long as BIC falls. Its confidence is the share of exp(-BIC/2) among what could
have been taken instead. Leaves DIR/naive/ID.json.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import configurations
import real
from plant import frames
from visible import Design, context, everything

MOST = 12


def columns_of(design: Design) -> list[tuple[str, dict, np.ndarray]]:
    """Effect, site, projected columns (3N, k), of unit length."""
    arm, s = design.arm, design.s
    out = []
    for name, site, variants in everything(context(arm, s), s.touch):
        out += [(name, site, c) for c in design.columns(name, site, variants)]
    rs, origins = frames(arm, s.q + arm.offset)
    turns = configurations.point_jacobian(rs, origins, design.without.tcp)
    for j in range(s.q.shape[1]):
        if arm.slides and arm.slides[j]:
            continue
        x = np.multiply.outer(s.q[:, j], np.arange(10, 301))
        sine, cosine = (
            design.project((turns[:, :, j, None] * f(x)[:, None]).reshape(3 * len(x), -1)) for f in (np.sin, np.cos)
        )
        out += [("gear_ripple", {"joint": j + 1}, np.stack(pair, 1)) for pair in zip(sine.T, cosine.T, strict=True)]
    kept = []
    for name, site, c in out:
        size = np.linalg.norm(c, axis=0)
        if size.max() > 1e-12:
            kept.append((name, site, c[:, size > 1e-6 * size.max()] / size[size > 1e-6 * size.max()]))
    return kept


def selected(design: Design, rest: np.ndarray) -> list[dict]:
    """Findings in the order of being taken."""
    y, n = design.project(rest.ravel()), rest.size
    candidates, out = columns_of(design), []
    for _ in range(MOST):
        ss, gain = float(y @ y), []
        for _, _, c in candidates:
            u, d, _ = np.linalg.svd(c, full_matrices=False) if c.shape[1] > 2 else (*np.linalg.qr(c), None)
            d = d if d.ndim == 1 else np.abs(np.diag(d))
            u = u[:, d > 1e-3]
            found = u.T @ y
            left = max(ss - float(found @ found), 1e-30)
            gain.append(0.5 * n * np.log(ss / left) - 0.5 * u.shape[1] * np.log(n) if u.shape[1] else -np.inf)
        gain = np.array(gain)
        k = int(np.argmax(gain))
        if gain[k] <= np.log(len(candidates)):
            break
        name, site, c = candidates[k]
        weight = np.exp(gain - gain[k])
        mine = np.array([a == name and b == site for a, b, _ in candidates])
        u, d, _ = np.linalg.svd(c, full_matrices=False)
        u = u[:, d > 1e-3]
        lam = float(np.linalg.norm(u.T @ y) / np.sqrt(ss / n))
        confidence = float(weight[mine].sum() / (weight.sum() + np.exp(-gain[k])))
        if not any(f["effect"] == name and f["site"] == site for f in out):
            out.append({"effect": name, "site": site, "confidence": confidence, "lambda": lam, "coefficients": []})
        y = y - u @ (u.T @ y)
        candidates = [(a, b, c - u @ (u.T @ c)) for a, b, c in candidates]
    return out


def findings(folder: Path) -> list[dict]:
    """What this says of one case."""
    arm, s, measured, _ = real.parsed(folder, *real.rows_of(folder / "recording.csv"), prefer=("q",))
    if s.rise.max() < 0.3:  # nobody measured it: as arms warm up
        s = replace(s, temp=20.0 + 5.0 * (1.0 - np.exp(-3.0 * s.progress)))
    arm, s, _, rest = real.aligned(arm, s, measured)
    return selected(Design(real.giving_way(arm, s), s), rest)


def _job(folder: Path) -> list[dict]:
    return findings(folder)


def run(where: Path, processes: int = 2, most: int | None = None) -> None:
    """Every case below `where`, or as many, and its backgrounds."""
    folders = sorted((where / "cases").iterdir())[:most]
    if (where / "backgrounds").is_dir():
        folders += sorted((where / "backgrounds").iterdir())
    folders = [p for p in folders if (p / "recording.csv").is_file()]
    out = where / "naive"
    out.mkdir(exist_ok=True)
    if processes > 1 and len(folders) > 1:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        with multiprocessing.get_context("spawn").Pool(processes) as pool:
            told = pool.map(_job, folders, chunksize=1)
    else:
        told = [findings(p) for p in folders]
    for folder, found in zip(folders, told, strict=True):
        (out / f"{folder.name}.json").write_text(json.dumps(found) + "\n")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dir", type=Path, required=True)
    parser.add_argument("--processes", type=int, default=2)
    a = parser.parse_args()
    run(a.dir, a.processes)
    return 0


if __name__ == "__main__":
    sys.exit(main())
