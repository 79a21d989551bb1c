#!/usr/bin/env python3
"""Runs the plain binary on concealed cases: each alone in a directory of its own, with nothing but robot, cell,
recording.

    run.py --dir DIR

stores DIR/answers/ID.json: the exit code, the seconds it took, what it said.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

BINARY = Path(os.environ.get("TRICAL_BINARY", Path(__file__).resolve().parents[1] / "target" / "release" / "trical"))


def diagnose(binary: Path, case: Path, timeout: float) -> dict:
    """What the program says of one case; the case's id and kind are out of its sight."""
    with tempfile.TemporaryDirectory(prefix="proof-") as name:
        here = Path(name)
        inputs = sorted(f.name for f in case.iterdir())
        for f in inputs:
            shutil.copy(case / f, here / f)
        robot = next(f for f in inputs if f.startswith("robot."))
        recordings = [f for f in inputs if f.endswith(".csv")]
        command = [str(binary), "diagnose", *recordings, "--robot", robot, "--cell", "cell.toml", "--json"]
        start = time.monotonic()
        try:
            done = subprocess.run(
                [*command, "--out", "improved.toml"], cwd=here, capture_output=True, text=True, timeout=timeout
            )
        except subprocess.TimeoutExpired:
            return {"exit": None, "seconds": timeout, "error": f"no answer in {timeout:.0f} s", "answer": None}
        seconds = round(time.monotonic() - start, 2)
        try:
            answer = json.loads(done.stdout) if done.returncode == 0 else None
        except json.JSONDecodeError as e:
            return {"exit": done.returncode, "seconds": seconds, "error": f"not JSON: {e}", "answer": None}
        return {"exit": done.returncode, "seconds": seconds, "error": done.stderr.strip(), "answer": answer}


def run(binary: Path, where: Path, processes: int = 2, timeout: float = 300.0) -> int:
    """Diagnoses every case below `where`; returns how many failed."""
    binary = binary.resolve()
    cases = sorted((where / "cases").iterdir())
    answers = where / "answers"
    answers.mkdir(exist_ok=True)
    with ThreadPoolExecutor(processes) as pool:
        results = list(pool.map(lambda c: diagnose(binary, c, timeout), cases))
    for case, result in zip(cases, results, strict=True):
        (answers / f"{case.name}.json").write_text(json.dumps(result, indent=1, sort_keys=True) + "\n")
    if (where / "backgrounds").is_dir():
        import real

        real.answers_without(binary, where)
    return sum(r["answer"] is None for r in results)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--binary", type=Path, default=BINARY, help="default: $TRICAL_BINARY or the release build")
    parser.add_argument("--dir", type=Path, required=True)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--timeout", type=float, default=300.0)
    a = parser.parse_args()
    failed = run(a.binary, a.dir, a.processes, a.timeout)
    print(f"{a.dir.name}: diagnosed, {failed} without an answer")
    return 0


if __name__ == "__main__":
    sys.exit(main())
