#!/usr/bin/env python3
"""Do the touches that `trical diagnose --next` plans decide? Undecided cases of a run are measured on, by the same arm.

    decide.py --dir runs/full-20261122/single --seed 20261122 --binary ../target/release/trical

For every case with one visible effect whose first finding is unsure and has rivals, eight more touches are simulated
three ways: as planned, and twice at random over the same balls. Each is a second recording, diagnosed together with the
first. Left out are effects that go on with time or temperature, since a second recording begins when somebody has time,
and sessions with commanded joints.
"""

from __future__ import annotations

import argparse
import csv
import json
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import configurations
import make
import score
import write
from plant import DEG, MM, Session
from visible import Invisible

#: Effects whose size is another at another time.
PASSING = {
    *("joint_zero_shift", "fixture_shift", "fixture_drift", "tool_shift", "tool_drift", "indicator_drift"),
    *("thermal_growth", "thermal_zero_drift"),
}
TOUCHES = 8


@dataclass
class Job:
    """One undecided case."""

    where: Path
    id: str
    seed: int
    index: int
    touches: list[int]
    binary: Path
    truth: dict
    before: dict


def drawn_again(job: Job) -> tuple[make.Drawn, Session]:
    """The concealed arm, and its first session as measured: the same draws as `make` made."""
    for attempt in range(20):
        try:
            d = make.draw("single", job.seed, job.index, job.touches, attempt)
        except Invisible:
            continue
        columns, s, _ = make.measure(d.rng, d.arm, d.s, d.effects, "white", False)
        if write.csv(columns) != (job.where / "cases" / job.id / "recording.csv").read_text():
            raise SystemExit(f"{job.id}: not what was drawn then; other versions, seed or touches?")
        return d, s
    raise Invisible(job.id)


def second_recording(d: make.Drawn, s: Session, q, ball, dirs, rng) -> dict:
    """Columns of touches at `q` (N, 6) rad, an hour after the first session, with its noise and its usual readings."""
    n, n0 = len(q), len(s.q)
    both = replace(
        s,
        q=np.concatenate([s.q, q]),
        t=np.concatenate([s.t, s.t[-1] + 3600.0 + 20.0 * np.arange(n)]),
        temp=np.concatenate([s.temp, np.full(n, s.temp[-1])]),
        dirs=np.concatenate([s.dirs, dirs]),
        ball=np.concatenate([s.ball, ball]),
        lag=np.zeros((n0 + n, 6)),
        rest=np.zeros((n0 + n, 6)),
        load=None if s.load is None else np.concatenate([s.load, np.zeros(n)]),
        reading=np.concatenate([np.zeros((n0, 3)), rng.normal(0, s.spread, (n, 3))]),
    )
    errors = np.concatenate([np.zeros((n0, 3)), rng.normal(0, s.sigma, (n, 3))])
    new = slice(n0, None)
    driven, read = make.drive_to_touch(d.arm, both, d.effects, errors, moving=new)
    alone = replace(
        driven,
        q=driven.q[new],
        t=20.0 * np.arange(n),
        temp=driven.temp[new],
        dirs=dirs,
        load=None if s.load is None else np.zeros(n),
    )
    return make.table(rng, alone, ball + 1, np.round(read[new] / MM, 3))


def planned(file: Path):
    """Joints (N, 6) rad, balls (0-based) and senses of the last motion from the plan."""
    with file.open() as lines:
        rows = list(csv.DictReader(lines))
    q = np.array([[float(r[f"q{j}_deg"]) for j in range(1, 7)] for r in rows]) * DEG
    from_ = np.array([[float(r[f"a{j}_deg"]) for j in range(1, 7)] for r in rows]) * DEG
    return q, np.array([int(r["ball"]) - 1 for r in rows]), np.sign(q - from_).astype(int)


def decide(job: Job) -> dict | None:
    """What the first finding is after more touches: as planned, and at random."""
    d, s = drawn_again(job)
    rng = np.random.default_rng([job.seed, job.index, 88])

    def diagnose(here: Path, *words: str) -> dict | None:
        command = [str(job.binary), "diagnose", *words, "--robot", "robot.toml", "--cell", "cell.toml", "--json"]
        done = subprocess.run(command, cwd=here, capture_output=True, text=True, timeout=300)
        return json.loads(done.stdout) if done.returncode == 0 else None

    with tempfile.TemporaryDirectory(prefix="decide-") as name:
        here = Path(name)
        for f in ("robot.toml", "cell.toml", "recording.csv"):
            shutil.copy(job.where / "cases" / job.id / f, here / f)
        if diagnose(here, "recording.csv", "--next", str(TOUCHES)) is None or not (here / "next.csv").exists():
            return None
        ways = {"planned": planned(here / "next.csv")}
        for k in (1, 2):
            q, ball = configurations.touches(d.nominal, rng, TOUCHES)
            order = rng.permutation(len(q))
            ways[f"random {k}"] = (q[order], ball[order], configurations.approaches(rng, q[order], "comes"))
        after = {}
        for way, (q, ball, dirs) in ways.items():
            (here / "more.csv").write_text(write.csv(second_recording(d, s, q, ball, dirs, rng)))
            answer = diagnose(here, "recording.csv", "more.csv")
            if answer is None:
                return None
            after[way] = (answer["findings"] or [None])[0]
    return {"id": job.id, "truth": job.truth, "before": job.before, "after": after}


def jobs(where: Path, seed: int, touches: list[int], binary: Path) -> list[Job]:
    """The undecided cases of a run."""
    _, cases = score.load(where)
    ids = {make.name_of("single", seed, i): i for i in range(len(cases))}
    out = []
    for c in cases:
        f, e = score.first(c), c.effects[0]
        if not f or not f["rivals"] or f["confidence"] >= score.SURE or e["lambda"] < 6:
            continue
        names = {e["effect"], f["effect"], *(rival["effect"] for rival in f["rivals"])}
        if not names & PASSING and not c.truth["session"]["commanded"]:
            out.append(Job(where, c.id, seed, ids[c.id], touches, binary, e, f))
    return out


def table(results: list[dict]) -> str:
    """By what was asked: how many are right, and how sure it is stated."""
    groups = defaultdict(list)
    for r in results:
        names = {(x["effect"], json.dumps(x["site"])) for x in [r["before"], *r["before"]["rivals"]]}
        families = sorted({n[0] for n in names})
        groups[" or ".join(families) if len(families) > 1 else f"which {families[0]}"].append(r)
    groups = dict(sorted(groups.items(), key=lambda g: -len(g[1])))
    groups["all"] = results

    def cell(found: list, truths: list) -> str:
        right = sum(bool(f) and score.same(f, t) for f, t in zip(found, truths, strict=True))
        sure = sum(
            bool(f) and f["confidence"] >= score.SURE and score.same(f, t) for f, t in zip(found, truths, strict=True)
        )
        return f"{score.share(right, len(found))} ({score.share(sure, len(found))})"

    lines = [
        "| undecided between | cases | before | 8 planned touches more | 8 random touches more |",
        "|---|---|---|---|---|",
    ]
    for name, xs in groups.items():
        truths = [r["truth"] for r in xs]
        at_random = [r["after"][f"random {k}"] for k in (1, 2) for r in xs]
        cells = [cell([r["before"] for r in xs], truths), cell([r["after"]["planned"] for r in xs], truths)]
        lines.append(f"| {name} | {len(xs)} | {' | '.join([*cells, cell(at_random, truths * 2)])} |")
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dir", type=Path, required=True)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--touches", default="150,45,300,150")
    parser.add_argument("--binary", type=Path, required=True)
    parser.add_argument("--most", type=int, help="only so many cases, in the order of their ids")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", type=Path)
    a = parser.parse_args()
    todo = jobs(a.dir, a.seed, [int(x) for x in a.touches.split(",")], a.binary.resolve())[: a.most]
    with ProcessPoolExecutor(a.processes) as pool:
        results = [r for r in pool.map(decide, todo) if r]
    head = (
        f"Effect and site of the first finding right (right and stated at {score.SURE} or more). "
        f"For {len(todo) - len(results)} of {len(todo)} undecided cases the program said that no {TOUCHES} touches "
        "would decide, and planned none.\n\n"
    )
    text = head + table(results)
    print(text)
    if a.out:
        a.out.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
