"""Runs everybody on the same tasks in one run and writes docs/benchmarks.md."""

import argparse
import datetime
import json
import os
import platform
import shutil
import statistics
import subprocess
import sys
import time
from pathlib import Path

import table

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
WORK = HERE / ".work"
RELEASE = ROOT / "target" / "release"
#: Environments of their own, since the peers disagree about NumPy; scripts that run in each.
PEERS = {
    "main": ["numpy_peer", "pinocchio_peer"],
    "pybotics": ["pybotics_peer"],
    "figaroh": ["figaroh_peer"],
    "robotkinecal": ["robotkinecal_peer"],
}
#: How often programs are run in turn, so that what else the machine does falls on all alike.
ROUNDS = 3
#: Environments whose calls take seconds: once.
ONCE = ("pybotics", "figaroh", "robotkinecal")


def say(text):
    """A line of progress."""
    print(f"== {text}", file=sys.stderr, flush=True)


def run(command, **options):
    """A command that must succeed."""
    return subprocess.run([str(c) for c in command], check=True, text=True, **options)


def python(name):
    """The interpreter of an environment."""
    return HERE / f".venv-{name}" / "bin" / "python"


def environment(name):
    """Makes an environment with pinned packages, unless it is there; the reason why not, if not."""
    wanted, stamp = HERE / f"requirements-{name}.txt", HERE / f".venv-{name}" / "requirements.txt"
    if stamp.exists() and stamp.read_bytes() == wanted.read_bytes():
        return None
    say(f"environment for {name}")
    try:
        run([sys.executable, "-m", "venv", "--clear", HERE / f".venv-{name}"])
        pip = [python(name), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r", wanted]
        run(pip, capture_output=True)
        shutil.copy(wanted, stamp)
    except subprocess.CalledProcessError as e:
        return f"does not install: {last_line(e.stderr)}"
    return None


def last_line(text):
    """The last line that says something, without what would break a table."""
    lines = [line.strip() for line in (text or "").splitlines() if line.strip()]
    return (lines[-1] if lines else "no message")[:200].replace("|", "/")


def spent(command, env=None, repeat=1):
    """CPU time, wall time and peak of memory (MB) of a process: medians over `repeat`."""
    runs = []
    for _ in range(repeat):
        # a process between, so that the peak is of this child alone
        code = (
            "import json, resource, subprocess, sys, time; begun = time.perf_counter();"
            "subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL); wall = time.perf_counter() - begun;"
            "u = resource.getrusage(resource.RUSAGE_CHILDREN);"
            "print(json.dumps([u.ru_utime + u.ru_stime, wall, u.ru_maxrss / 1024]))"
        )
        out = run([sys.executable, "-c", code, *command], env={**os.environ, **(env or {})}, stdout=subprocess.PIPE)
        runs.append(json.loads(out.stdout))
    return tuple(statistics.median(r[k] for r in runs) for k in range(3))


class Results:
    """Lines as they come, kept on disk as well."""

    def __init__(self, path):
        """An empty file."""
        self.lines, self.file = [], open(path, "w")

    def add(self, line):
        """One result."""
        self.lines.append(line)
        print(json.dumps(line), file=self.file, flush=True)

    def of(self, who, command, reason=None, rows=(), round=1):
        """All lines that a program prints; if it fails, a line that says why."""
        if reason is None:
            say(f"{who}, round {round}")
            env = {**os.environ, "RAYON_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
            found = subprocess.run([str(c) for c in [*command, WORK, *rows]], env=env, text=True, capture_output=True)
            for line in found.stdout.splitlines():
                if line.startswith("{"):
                    self.add({"round": round, **json.loads(line)})
            if found.returncode:
                reason = f"stopped: {last_line(found.stderr)}"
        if reason:
            self.add({"row": rows[0] if rows else "not measured", "who": who, "seconds": None, "error": reason})


def tasks(big, arms):
    """Writes the task with the NumPy of the main environment."""
    say("task")
    run([python("main"), HERE / "arm.py", WORK, big, arms])
    run([python("main"), HERE / "scene.py", WORK])


def build():
    """Compiles ours and the native peers; reasons why a peer cannot be."""
    say("building ours")
    run(["cargo", "build", "--release", "--quiet", "--bin", "trical", "-p", "trical-cli"], cwd=ROOT)
    run(["cargo", "build", "--release", "--quiet", "-p", "trical-bench"], cwd=ROOT)
    say("building the native peers")
    reasons = {}
    for name, command in {
        "Rust peers": [
            "cargo",
            "build",
            "--release",
            "--quiet",
            "--locked",
            "--manifest-path",
            HERE / "rust_peers/Cargo.toml",
        ],
        "Pinocchio and coal, C++": [HERE / "native/build", HERE / ".venv-main", WORK / "pinocchio"],
    }.items():
        try:
            run(command, capture_output=True, env={**os.environ, "CARGO_TARGET_DIR": str(ROOT / "target/peers")})
        except (subprocess.CalledProcessError, OSError) as e:
            reasons[name] = f"does not build: {last_line(getattr(e, 'stderr', None) or str(e))}"
    return reasons


def wheel():
    """Builds ours for Python and installs it; its path, or why not."""
    say("our wheel")
    folder = WORK / "wheel"
    shutil.rmtree(folder, ignore_errors=True)
    try:
        run([python("main"), "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", folder, ROOT], capture_output=True)
        path = next(folder.glob("*.whl"))
        run([python("main"), "-m", "pip", "install", "--quiet", "--force-reinstall", "--no-deps", path])
    except subprocess.CalledProcessError as e:
        return None, last_line(e.stderr)
    return path, None


def peers(results, rows):
    """Everybody on every row."""
    reasons = {name: environment(name) for name in PEERS if name != "main"}
    reasons |= build()
    for round in range(1, ROUNDS + 1):
        results.of("TriCal", [RELEASE / "trical-bench"], None, rows, round)
        if not rows:
            whole_program(results, round)
        results.of("Rust peers", [ROOT / "target/peers/release/rust-peers"], reasons.get("Rust peers"), rows, round)
        native = reasons.get("Pinocchio and coal, C++")
        results.of("Pinocchio and coal, C++", [WORK / "pinocchio"], native, rows, round)
        for name, scripts in PEERS.items():
            for script in scripts if round == 1 or name not in ONCE else ():
                command = [python(name), "-W", "ignore", HERE / f"peers/{script}.py"]
                results.of(script.removesuffix("_peer"), command, reasons.get(name), rows, round)


def data(results, rows, path, reason):
    """Large files into memory, and a fleet on Dask: with the wheel at `path`, or why there is none. They take turns."""
    reason = reason or environment("data")
    if reason is None:
        pip = [python("data"), "-m", "pip", "install", "--quiet", "--force-reinstall", "--no-deps", path]
        try:
            run(pip, capture_output=True)
        except subprocess.CalledProcessError as e:
            reason = f"does not install: {last_line(e.stderr)}"
    for who, script in {"loading": "loading", "a fleet": "fleet"}.items():
        results.of(who, [python("data"), "-W", "ignore", HERE / f"peers/{script}.py"], reason, rows)


def whole_program(results, round):
    """`trical identify` of a million rows, the process as a whole."""
    file = WORK / "elastic_big.csv"
    if file.exists():
        say("trical identify of a million rows")
        seconds, _, _ = spent(identify(file), {"RAYON_NUM_THREADS": "1"})
        results.add(
            {
                "round": round,
                "row": "identification, 1000000 poses from CSV",
                "who": "`trical identify`, covariance and report included",
                "ours": True,
                "version": version(),
                "seconds": seconds,
                "accuracy": held_out(),
            }
        )


def identify(file):
    """The command line."""
    common = ["--robot", WORK / "robot.toml", "--cell", WORK / "cell.toml", "--model", "compliance"]
    return [str(c) for c in [RELEASE / "trical", "identify", file, *common, "--out", WORK / "model.toml"]]


def held_out():
    """RMS error of the last model at poses that it has not seen, in words."""
    common = ["--robot", WORK / "robot.toml", "--cell", WORK / "cell.toml", "--model", WORK / "model.toml", "--json"]
    out = run([RELEASE / "trical", "validate", WORK / "elastic_heldout.csv", *common], stdout=subprocess.PIPE)
    return f"{1e3 * json.loads(out.stdout)['after']['rms_mm']:.2f} um"


def version():
    """Ours."""
    return run([RELEASE / "trical", "--version"], stdout=subprocess.PIPE).stdout.split()[-1]


def startup(results, path, reason, clean):
    """Start-up and size."""
    say("start-up and size")

    def target(what, limit, unit, value, error=None):
        results.add({"target": what, "limit": limit, "unit": unit, "value": value, "error": error})

    def fastest(command):
        every = []
        for _ in range(20):
            start = time.perf_counter()
            run(command, stdout=subprocess.DEVNULL)
            every.append(time.perf_counter() - start)
        return 1e3 * statistics.median(every)

    target("`trical --help`, wall", 10, "ms", fastest([RELEASE / "trical", "--help"]))
    target("binary, stripped", 20, "MB", (RELEASE / "trical").stat().st_size / 1e6)
    if path:
        target("wheel", 10, "MB", path.stat().st_size / 1e6)
        code = "import time, numpy; t = time.perf_counter(); import trical; print(time.perf_counter() - t)"
        alone = [run([python("main"), "-c", code], stdout=subprocess.PIPE, cwd=WORK).stdout for _ in range(9)]
        target("`import trical`, after NumPy", 50, "ms", 1e3 * statistics.median(map(float, alone)))
        code = code.replace(", numpy", "")
        alone = [run([python("main"), "-c", code], stdout=subprocess.PIPE, cwd=WORK).stdout for _ in range(9)]
        target("`import trical`, NumPy included", 50, "ms", 1e3 * statistics.median(map(float, alone)))
    else:
        target("wheel", 10, "MB", None, reason)
    if clean:
        say("clean release build (minutes)")
        folder = WORK / "clean"
        begun = time.perf_counter()
        run(
            ["cargo", "build", "--release", "--quiet", "--bin", "trical", "-p", "trical-cli"],
            cwd=ROOT,
            env={**os.environ, "CARGO_TARGET_DIR": str(folder)},
        )
        target("clean release build, wall", 360, "s", time.perf_counter() - begun)
        shutil.rmtree(folder)


SCALE = {
    "poses": (
        "Poses: `trical identify` of a CSV, 31 parameters",
        "Up to 32 768 rows all of them go through the robust fits that look for gross errors, up to seven one "
        "after the other; above, a sample of 8192 stands for all in these, in the start and in a fit's first "
        "steps, and every row is read, linearized and added to sums a few times. Memory is proportional until 32 "
        "MB of CSV (some 300 000 of these rows), above which files are read in passes and memory does not grow.",
    ),
    "parameters": (
        "Parameters: fit of 1000 poses",
        "Sums of J'J cost the square of the parameters, as does the covariance's triangular factor, and solving their "
        "cube; linearizing is linear in them.",
    ),
    "candidates": (
        "Candidates in a diagnosis: linearized at 1000 poses, and the evidence of each",
        "Linearizing is linear in the candidates, their inner products with each other are quadratic and take over; a "
        "search step afterwards costs no more than there are columns.",
    ),
    "fleet": (
        "Arms in a fleet: 45 touches each, 31 parameters",
        "Choice of parameters, fit and covariance, from Rust, the data in memory. Arms share nothing, so time is "
        "proportional to their number and two threads halve it.",
    ),
}


def scales(results, huge):
    """Time and memory against sizes."""
    say("scale: poses")
    for n in [100, 1000, 10_000, 100_000, 1_000_000] + ([10_000_000] if huge else []):
        file = WORK / "scale.csv"
        code = "import sys; sys.path.insert(0, sys.argv[1]); import numpy as np, arm; rng = np.random.default_rng(5);"
        code += "arm.write_points(sys.argv[2], rng, arm.truth(rng, True), int(sys.argv[3]))"
        run([python("main"), "-c", code, HERE, file, n])
        repeat = 5 if n <= 10_000 else 1
        cpu, wall, peak = spent(identify(file), {"RAYON_NUM_THREADS": "1"}, repeat)
        wall_2 = spent(identify(file), {"RAYON_NUM_THREADS": "2"}, repeat)[1]
        results.add({"scale": "poses", "n": n, "seconds": cpu, "wall": wall, "wall_2": wall_2, "peak_mb": peak})
        file.unlink()
    for what, sizes in {
        "parameters": [31, 60, 100, 200, 400],
        "candidates": [50, 100, 200, 400, 800, 1600],
        "fleet": [1, 10, 100, 1000],
    }.items():
        say(f"scale: {what}")
        for n in sizes:
            one, two = (
                json.loads(
                    run(
                        [RELEASE / "trical-bench", WORK, "scale", what, n],
                        stdout=subprocess.PIPE,
                        env={**os.environ, "RAYON_NUM_THREADS": threads},
                    ).stdout
                )
                for threads in ("1", "2")
            )
            results.add({**one, "wall_2": two["wall"]})


def machine():
    """What this ran on, in one sentence."""
    cpu = platform.processor() or "?"
    info = Path("/proc/cpuinfo")
    if info.exists():
        cpu = next((x.split(":")[1].strip() for x in info.read_text().splitlines() if x.startswith("model name")), cpu)
    load = os.getloadavg()[0]
    rust = run(["rustc", "--version"], stdout=subprocess.PIPE).stdout.split()[1]
    return (
        f"{cpu}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}, Python {platform.python_version()}, "
        f"Rust {rust}; load {load:.1f} at the start"
    )


#: Tasks that stand in the README.
IN_README = [
    "forward kinematics",
    "Jacobian",
    "inverse kinematics",
    "identification, 45 touches, 26 parameters",
    "identification, 1000 poses, 26 parameters",
    "identification, 1000000 poses from CSV",
    "collision check, hulls",
    "choice of configurations",
]


def write(results, where, begun):
    """The document, and the README's part of it."""
    lines = results.lines
    reasons = json.loads((HERE / "reasons.json").read_text())
    slower = [
        f"- {table.title(row)}: {who} takes {100 * times:.0f} % of our time. {reasons.get(row, 'Why is not known.')}"
        for row, who, times in table.behind(lines)
    ]
    parts = [(HERE / "benchmarks.head.md").read_text().rstrip(), ""]
    parts += [f"Measured {datetime.date.today():%Y-%m-%d} in {(time.time() - begun) / 60:.0f} minutes: {where}.", ""]
    parts += ["## In short", "", table.summary(lines), "", "Where ours is not first:", ""]
    parts += [*(slower or ["- nowhere in this run."]), "", "## Start-up and size", "", table.targets(lines), ""]
    parts += ["## Scale", "", table.scale(lines, SCALE), table.fleet(lines), "## All rows", "", table.details(lines)]
    (ROOT / "docs" / "benchmarks.md").write_text("\n".join(parts).rstrip() + "\n")
    readme = (ROOT / "README.md").read_text()
    told = table.summary([r for r in lines if r.get("row") in IN_README])
    (ROOT / "README.md").write_text(table.put_between(readme, "./bench writes this table", told))
    say("docs/benchmarks.md and the README's table are written")


def main():
    """The command."""
    parser = argparse.ArgumentParser(prog="bench", description=__doc__)
    parser.add_argument("part", nargs="?", choices=["all", "peers", "data", "scale", "startup"], default="all")
    parser.add_argument(
        "--rows",
        nargs="+",
        default=[],
        metavar="ROW",
        help="with peers and data: only these rows (names as in the table)",
    )
    parser.add_argument(
        "--quick", action="store_true", help="without the million poses and the clean build, and a fleet of 100 arms"
    )
    parser.add_argument("--huge", action="store_true", help="scale up to ten million poses (1 GB of CSV)")
    args = parser.parse_args()
    begun, where = time.time(), machine()
    reason = environment("main")
    if reason:
        sys.exit(f"bench: the main environment {reason}")
    WORK.mkdir(exist_ok=True)
    results = Results(WORK / "results.jsonl")
    whole = args.part == "all"
    big = 0 if args.quick or args.part in ("scale", "startup") else 1_000_000
    tasks(big, (100 if args.quick else 1000) if whole or args.part == "data" else 0)
    if args.part in ("scale", "startup"):
        build()
    if whole or args.part == "peers":
        peers(results, args.rows)
    if whole or args.part in ("startup", "data"):
        path, reason = wheel()
    if whole or args.part == "startup":
        startup(results, path, reason, not args.quick)
        if path:
            results.of("TriCal, Python", [python("main"), HERE / "peers/trical_python.py"])
    if whole or args.part == "data":
        data(results, args.rows, path, reason)
    if whole or args.part == "scale":
        scales(results, args.huge)
    if whole:
        write(results, where, begun)
    else:
        print(
            table.summary(results.lines),
            table.targets(results.lines),
            table.scale(results.lines, SCALE),
            table.fleet(results.lines),
            table.details(results.lines),
            sep="\n\n",
        )


if __name__ == "__main__":
    try:
        main()
    except subprocess.CalledProcessError as e:
        sys.exit(f"bench: {e.cmd[0]} failed: {last_line(e.stderr) if e.stderr else f'exit code {e.returncode}'}")
