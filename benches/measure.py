"""How the Python peers are timed, and how a result becomes a line: CPU time, since machines are shared.

Threads of linear algebra libraries are off: on small tasks they cost more CPU time than they save.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS", "RAYON_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import json
import statistics
import sys
import time
from importlib.metadata import version
from pathlib import Path

#: The folder of the task, and the rows that are wanted (all, if none is named).
FOLDER = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(".")
ROWS = sys.argv[2:]
#: Of calls that take turns, those that take more CPU seconds than this are timed once.
SLOW = 5.0


def wants(row):
    """Whether a row was asked for."""
    return not ROWS or row in ROWS


def cpu_time(call, batches=9, at_least=0.05):
    """Median CPU seconds of a call over batches of at least so many seconds each."""
    call()
    count, start = 1, time.process_time()
    call()
    once = max(time.process_time() - start, 1e-7)
    count = max(1, round(at_least / once))
    if once > 3:
        batches = 3
    every = []
    for _ in range(batches):
        start = time.process_time()
        for _ in range(count):
            call()
        every.append((time.process_time() - start) / count)
    return statistics.median(every)


def cpu_times_in_turn(calls, rounds=3):
    """CPU seconds of calls by name that take long, in turn: (name, round, seconds, what the call gave)."""
    slow = set()
    for round in range(1, rounds + 1):
        for name in [name for name in calls if name not in slow]:
            start = time.process_time()
            gave = calls[name]()
            seconds = time.process_time() - start
            if seconds > SLOW:
                slow.add(name)
            yield name, round, seconds, gave


def report(row, who, seconds, accuracy="", package=None, error=None):
    """Prints one line of the table; `package` is the distribution whose version is told."""
    line = {"row": row, "who": who, "seconds": seconds, "accuracy": accuracy, "error": error}
    if package:
        line["version"] = f"{package} {version(package)}"
    print(json.dumps(line), flush=True)
