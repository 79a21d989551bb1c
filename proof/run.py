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


def said(command: list[str], here: Path, timeout: float) -> dict:
    """What a command prints as JSON, and how it ended."""
    start = time.monotonic()
    try:
        done = subprocess.run(command, cwd=here, capture_output=True, text=True, timeout=timeout)
    except subprocess.TimeoutExpired:
        return {"exit": None, "seconds": timeout, "error": f"no answer in {timeout:.0f} s", "answer": None}
    seconds = round(time.monotonic() - start, 2)
    try:
        answer = json.loads(done.stdout) if done.returncode == 0 else None
    except json.JSONDecodeError as e:
        return {"exit": done.returncode, "seconds": seconds, "error": f"not JSON: {e}", "answer": None}
    return {"exit": done.returncode, "seconds": seconds, "error": done.stderr.strip(), "answer": answer}


def diagnose(binary: Path, case: Path, timeout: float, fresh: Path | None = None) -> dict:
    """What the program says of one case; the case's id and kind are out of its sight.

    Then, how its model does on recordings that it did not have: those in `fresh`, and, of several sessions, the last
    beside a plain calibration, both learnt on the others (`tried`: name -> mean, mm, or what went wrong).
    """
    with tempfile.TemporaryDirectory(prefix="proof-") as name:
        here = Path(name)
        inputs = sorted(f.name for f in case.iterdir())
        for f in inputs:
            shutil.copy(case / f, here / f)
        robot = next(f for f in inputs if f.startswith("robot."))
        recordings = [f for f in inputs if f.endswith(".csv")]
        arm = ["--robot", robot, "--cell", "cell.toml", "--json"]

        def learn(what: str, model: str, recordings: list[str]) -> dict:
            return said([str(binary), what, *recordings, *arm, "--out", model], here, timeout)

        def tried(model: str, recording: str, *refit: str) -> float | str:
            result = said([str(binary), "validate", recording, *arm, "--model", model, *refit], here, timeout)
            return result["answer"]["after"]["mean_mm"] if result["answer"] else result["error"][:200]

        result = learn("diagnose", "improved.toml", recordings)
        result["tried"] = {}
        for path in sorted(fresh.iterdir()) if fresh and result["answer"] else []:
            shutil.copy(path, here / path.name)
            result["tried"][path.stem] = tried("improved.toml", path.name)
        if len(recordings) > 1:
            for what in ("diagnose", "identify"):
                learnt = learn(what, f"{what}.toml", recordings[:-1])
                result["tried"][what] = (
                    tried(f"{what}.toml", recordings[-1], "--refit", "frame,targets")
                    if learnt["answer"]
                    else learnt["error"][:200]
                )
        return result


def run(binary: Path, where: Path, processes: int = 2, timeout: float = 300.0) -> int:
    """Diagnoses every case below `where`; returns how many failed."""
    binary = binary.resolve()
    cases = sorted((where / "cases").iterdir())
    kept_back = lambda c: fresh if (fresh := where / "fresh" / c.name).is_dir() else None  # noqa: E731
    answers = where / "answers"
    answers.mkdir(exist_ok=True)

    def answered(case: Path) -> bool:
        result = diagnose(binary, case, timeout, kept_back(case))
        (answers / f"{case.name}.json").write_text(json.dumps(result, indent=1, sort_keys=True) + "\n")
        return result["answer"] is not None

    with ThreadPoolExecutor(processes) as pool:
        failed = len(cases) - sum(pool.map(answered, cases))
    if (where / "backgrounds").is_dir():
        import real

        real.answers_without(binary, where)
    return failed


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
