"""The whole proof: make every kind of case, print the hashes of the sealed truths, run the binary, write the table.

Run it as `proof/prove`, which brings its own virtual environment.
"""

from __future__ import annotations

import argparse
import datetime
import hashlib
import importlib.metadata
import importlib.util
import os
import platform
import shutil
import subprocess
import sys
import time
from pathlib import Path

import make
import naive
import proper
import real
import run
import score

HERE = Path(__file__).resolve().parent
# two cores: a case costs 1 s to make, 11 s in MuJoCo, and half a second to diagnose
FULL = dict(
    none=150, single=500, tracker=150, mujoco=60, pair=120, five=30, outside=150, nonwhite=120, dirty=60, arms=200
)
# beside them: recordings that cost the program ten times as much
FULL |= dict(curves=80, many=60, sessions=60, clusters=40, real=300)
COUNTS = {
    "small": dict(
        none=12,
        single=20,
        tracker=8,
        mujoco=5,
        pair=6,
        five=2,
        outside=8,
        nonwhite=6,
        dirty=5,
        arms=6,
        curves=4,
        many=2,
        clusters=2,
    ),
    # where three quarters of an hour of two cores are too much
    "large": {
        **FULL,
        **dict(tracker=90, mujoco=24, pair=80, five=20, nonwhite=90, dirty=45, arms=120),
        **dict(curves=40, many=30, sessions=30, clusters=20, real=48),
    },
    "full": FULL,
}
TOUCHES = [150, 45, 300, 150]


def origin(binary: Path) -> str:
    """Where the binary comes from: the commit of its sources, whether they were changed since, and its own hash."""
    digest = hashlib.sha256(binary.read_bytes()).hexdigest()

    def git(*words: str) -> str:
        done = subprocess.run(["git", "-C", str(binary.parent), *words], capture_output=True, text=True)
        return done.stdout.strip() if done.returncode == 0 else ""

    commit = git("rev-parse", "--short=12", "HEAD")
    changed = bool(git("status", "--porcelain", "--untracked-files=no", ":/crates", ":/Cargo.toml", ":/Cargo.lock"))
    made = git("log", "-1", "--format=%ct", "--", ":/crates", ":/Cargo.toml", ":/Cargo.lock")
    older = bool(made) and binary.stat().st_mtime < int(made)
    notes = [
        *(["sources changed since"] if changed else []),
        *(["the binary is older than the last change of its sources"] if older else []),
    ]
    where = f"commit `{commit}`" if commit else "sources unknown"
    return f"{where}{' (' + '; '.join(notes) + ')' if notes else ''}, SHA-256 `{digest}`"


def version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def unbroken_seal(where: Path, count: int) -> str:
    """The hash of a truth that was sealed before; earlier answers go."""
    digest = (where / "truth.sha256").read_text().strip()
    if hashlib.sha256((where / "sealed" / "truth.json").read_bytes()).hexdigest() != digest:
        raise SystemExit(f"{where}: the sealed truth is not what its hash says")
    cases = len(list((where / "cases").iterdir()))
    if cases != count:
        raise SystemExit(f"{where}: found {cases} cases, expected {count}")
    shutil.rmtree(where / "answers", ignore_errors=True)
    return digest


def prove(
    size: str, seed: int, out: Path, binary: Path, processes: int, again: bool = False, kinds: str | None = None
) -> Path:
    """Everything; returns the path of the table."""
    started, clock = datetime.datetime.now(datetime.timezone.utc), time.monotonic()
    counts = dict(COUNTS[size])
    if kinds:
        counts = {name: int(n) for name, n in (x.split("=") for x in kinds.split(","))}
    if "mujoco" in counts and importlib.util.find_spec("mujoco") is None:
        print("no MuJoCo here (it needs Python 3.11 or newer): that kind is left out", flush=True)
        del counts["mujoco"]
    if "real" in counts and real.data() is None:
        print("no shared recordings here: real backgrounds are left out", flush=True)
        del counts["real"]
    came_from = origin(binary)
    dirs = []
    for kind, count in counts.items():
        if again:
            digest = unbroken_seal(out / kind, count)
        else:
            digest = make.make(kind, seed, count, out / kind, TOUCHES, processes, binary)
        print(f"{kind:9} {count:4} cases, truth sealed, SHA-256 {digest}", flush=True)
        dirs.append(out / kind)
    made = time.monotonic() - clock
    for d in dirs:
        failed = run.run(binary, d, processes)
        print(f"{d.name:9} diagnosed{f', {failed} without an answer' if failed else ''}", flush=True)
    for kind in ("single", "curves", "many", "real"):
        if kind in counts:
            naive.run(out / kind, processes, 60)  # 4 s each
    text, wrong, cases = score.score(dirs)
    proper.write_lines(cases, out / "findings.jsonl")
    minutes = (time.monotonic() - clock) / 60
    head = [
        "# Proof on concealed effects",
        "",
        f"- {started:%Y-%m-%d %H:%M} UTC, seed {seed}, size {size}; again by `proof/prove --seed {seed} "
        + (f"--kinds {kinds}`" if kinds else f"--size {size}`"),
        f"- binary: {came_from}",
        f"- {', '.join(f'{kind} {count}' for kind, count in counts.items())}; touches {TOUCHES} in turn",
        f"- {minutes:.1f} minutes on {os.cpu_count()} cores ({processes} processes), "
        + ("cases drawn before" if again else f"{made / 60:.1f} of them to draw"),
        f"- Python {platform.python_version()}, NumPy {version('numpy')}, MuJoCo {version('mujoco-core')}",
        "",
        "What the words mean, and what this cannot show: [README.md](README.md).",
        "",
        "",
    ]
    (out / "failures.md").write_text(wrong)
    (out / "results.md").write_text("\n".join(head) + text)
    return out / "results.md"


def main() -> int:
    today = int(datetime.date.today().strftime("%Y%m%d"))
    parser = argparse.ArgumentParser(prog="proof/prove", description=__doc__)
    parser.add_argument(
        "--seed", type=int, default=today, help="default: today's date, so that nobody has trained on it"
    )
    parser.add_argument(
        "--size", choices=sorted(COUNTS), default="small", help="small: 4 minutes; large: an hour; full: three hours"
    )
    parser.add_argument("--out", type=Path, help="default: proof/runs/SIZE-SEED; must not hold another run")
    parser.add_argument("--binary", type=Path, default=run.BINARY, help="default: $TRICAL_BINARY or the release build")
    parser.add_argument("--kinds", help="only these, with how many: real=30,curves=20")
    parser.add_argument("--processes", type=int, default=min(2, os.cpu_count() or 1))
    parser.add_argument(
        "--again",
        action="store_true",
        help="cases are there from an earlier run, with the same seals: diagnose them anew",
    )
    a = parser.parse_args()
    if not a.binary.is_file():
        print(f"{a.binary} is missing: cargo build --release --bin trical", file=sys.stderr)
        return 2
    out = a.out or HERE / "runs" / f"{a.size}-{a.seed}"
    if not a.again and out.exists() and any(out.iterdir()):
        print(f"{out} is not empty: answers of another run would be scored", file=sys.stderr)
        return 2
    table = prove(a.size, a.seed, out, a.binary.resolve(), a.processes, a.again, a.kinds)
    if a.size != "small" and not a.kinds:
        shutil.copy(table, HERE / "results.md")
        table = HERE / "results.md"
    print(f"table: {table}; every case that is not plainly right: {out / 'failures.md'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
