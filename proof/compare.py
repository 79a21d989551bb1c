#!/usr/bin/env python3
"""Pairs of sessions of drawn arms: does `trical compare` see what changed, and keep quiet where nothing did?

    compare.py --seed 20261122 --count 200 --binary ../target/release/trical

Half of the pairs are the same arm twice. In the others the tool was screwed on anew, the balls' plate was carried, or
the zero of one joint was lost, by half to five times what the program says beforehand that these touches would show
nine times in ten.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import zlib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

import configurations
import make
import write
from arms import SMALL
from plant import DEG, MM


def run(binary: Path, *args: str) -> dict | list:
    done = subprocess.run([str(binary), *args], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(done.stderr.strip())
    return json.loads(done.stdout)


def drawn(seed: int, index: int):
    """An arm, its cell, a session of many touches and one of few, and the generator to go on with."""
    for attempt in range(20):
        rng = np.random.default_rng([seed, zlib.crc32(b"compare"), index, attempt])
        try:
            nominal, first = make.cell(rng, int(rng.choice([60, 100, 150])), True, SMALL)
            arm = make.built(nominal, rng, True)
            second = make.plan(nominal, rng, int(rng.integers(8, 13)), True)
            plain = {"has_thermometer": first.has_thermometer, "sigma": first.sigma, "load": None}
            return rng, nominal, arm, replace(first, load=None), replace(second, **plain)
        except configurations.Unreachable:
            continue
    raise RuntimeError(f"pair {index} cannot be drawn")


def pair(job: tuple[int, int, Path]) -> dict:
    """One pair: what was done to the arm between the sessions, and what the program says."""
    seed, index, binary = job
    rng, nominal, arm, first, second = drawn(seed, index)
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)

        def record(name: str, arm, session) -> str:
            columns, _, _ = make.measure(rng, arm, session, [], "white", False)
            (at / name).write_text(write.csv(columns))
            return str(at / name)

        (at / "robot.toml").write_text(write.robot_toml(nominal))
        (at / "cell.toml").write_text(write.cell_toml(nominal))
        old = str(at / "old.toml")
        files = ["--robot", str(at / "robot.toml"), "--cell", str(at / "cell.toml")]
        run(binary, "identify", record("old.csv", arm, first), *files, "--out", old, "--json")
        # what these poses would show does not depend on what is measured there
        visible = run(binary, "compare", old, record("same.csv", arm, second), "--json")[0]["visible"]
        sizes = {v["what"]: v["smallest"] for v in reversed(visible)}  # of a tool or base the place, told first
        what, times = "nothing", 0.0
        if index % 2:
            what = ["tool", "base", *[f"joint {j}" for j in range(1, 7)]][(index // 2) % 8]
            times = float(np.exp(rng.uniform(np.log(0.5), np.log(5))))
        size = times * (sizes.get(what) or 0.0)
        if sizes.get(what) is None and what != "nothing":
            what, size, times = "nothing", 0.0, 0.0
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        changed = arm
        if what == "tool":
            changed = arm.but(tcp=arm.tcp + size * MM * way)
        elif what == "base":
            changed = arm.but(base_xyz=arm.base_xyz + size * MM * way)
        elif what.startswith("joint"):
            offset = arm.offset.copy()
            offset[int(what[-1]) - 1] += rng.choice([-1, 1]) * size * DEG
            changed = arm.but(offset=offset)
        c = run(binary, "compare", old, record("new.csv", changed, second), "--json")[0]
    for x in c["changes"]:  # moved, or moved and turned: the base
        x["what"] = x["what"].split(" (")[0]
        x["rivals"] = [r.split(" (")[0] for r in x["rivals"]]
    names = [x["what"] for x in c["changes"]]
    first_named = c["changes"][0] if names else {"what": None, "rivals": [], "probability": 0.0}
    return {
        "index": index,
        "what": what,
        "times": times,
        "verdict": c["verdict"],
        "named": names,
        "right": first_named["what"] == what,
        "among": what in [first_named["what"], *first_named["rivals"]],
        "probability": first_named["probability"],
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=20261122)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--binary", type=Path, default=Path(__file__).parent / "../target/release/trical")
    args = parser.parse_args()
    with ThreadPoolExecutor(2) as pool:
        results = list(pool.map(pair, [(args.seed, k, args.binary) for k in range(args.count)]))
    same = [r for r in results if r["what"] == "nothing"]
    alarms = [r for r in same if r["verdict"] != "unchanged"]
    print(f"nothing changed: {len(same)} pairs, {len(alarms)} said to have changed {[r['named'] for r in alarms]}")
    for low, high in [(0.5, 1.0), (1.0, 2.0), (2.0, 5.0)]:
        some = [r for r in results if low <= r["times"] < high]
        seen = [r for r in some if r["verdict"] != "unchanged"]
        right = [r for r in seen if r["right"]]
        among = [r for r in seen if r["among"]]
        print(
            f"{low} to {high} times what is visible: {len(some)} pairs, {len(seen)} seen, {len(right)} named rightly, "
            f"{len(among)} with the truth named or among the rivals"
        )
        for r in seen:
            if not r["among"]:
                print("   ", r)
    sure = [r for r in results if r["named"] and r["what"] != "nothing"]
    if sure:
        mean, right = (np.mean([r[key] for r in sure]) for key in ("probability", "right"))
        print(f"mean probability of what is named {mean:.2f}, share that is right {right:.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
