"""A fleet of arms, a file of touches each: TriCal on one machine, and the same calls on Dask with two workers.

A call is `trical.identify`: the file is read, gross errors are looked for, the fit is cross-validated; what comes back
is the result with its model. Everybody's results are compared. Wall time counts here, so the machine has to be quiet.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))
from measure import FOLDER, wants  # isort: skip  (threads are limited before NumPy loads)

import json
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from importlib.metadata import version

import trical

ROUNDS = 3
WORKERS = 2
ARMS_A_TASK = 25
FILES = {"robot": FOLDER / "robot.toml", "cell": FOLDER / "cell.toml"}


def calibrate(recordings):
    """What a task does: the results of some arms."""
    return [trical.identify(path, model="compliance", **FILES) for path in recordings]


def nothing(_):
    """A task that costs what every task does."""


def in_tasks(recordings, arms):
    """The recordings, so many arms a task."""
    return [recordings[k : k + arms] for k in range(0, len(recordings), arms)]


def ready():
    """A worker that has loaded the library; its CPU time so far."""
    trical.identify(FOLDER / "elastic_touches.csv", model="compliance", **FILES)
    return time.process_time()


class Clock:
    """Wall and CPU seconds since it was made, of this process and of a cluster's workers."""

    def __init__(self, client=None):
        """Starts."""
        self.client = client
        self.wall, self.cpu = time.perf_counter(), self.spent()

    def spent(self):
        """CPU seconds of all processes until now; of a cluster, its scheduler is in this one."""
        workers = self.client.run(time.process_time).values() if self.client else ()
        return time.process_time() + sum(workers)

    def read(self):
        """Wall and CPU seconds."""
        return {"wall": time.perf_counter() - self.wall, "seconds": self.spent() - self.cpu}


def on_threads(recordings, threads):
    """One process."""
    with ThreadPoolExecutor(threads) as pool:
        clock = Clock()
        found = list(pool.map(lambda path: calibrate([path])[0], recordings))
        return found, clock.read()


@contextmanager
def cluster():
    """A client of two processes of one thread each, and wall and CPU seconds until both have loaded the library."""
    from dask.distributed import Client, LocalCluster

    clock = Clock()
    options = {"n_workers": WORKERS, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
    with LocalCluster(**options) as local, Client(local) as client:
        client.wait_for_workers(WORKERS, timeout=120)
        workers = client.run(ready)
        started = clock.read()
        yield client, {"wall": started["wall"], "seconds": started["seconds"] + sum(workers.values())}


def on_dask(client, recordings, arms):
    """So many arms a task; results come back by pickle."""
    clock = Clock(client)
    done = client.gather(client.map(calibrate, in_tasks(recordings, arms), pure=False))
    spent = clock.read()
    return [one for some in done for one in some], spent


def values(found):
    """All parameters of all arms."""
    return [[p["value"] for p in arm.parameters] for arm in found]


def round_of(recordings):
    """Every way once: what it is, wall and CPU seconds, results (none of a task that does nothing)."""
    for threads in (1, WORKERS):
        found, spent = on_threads(recordings, threads)
        yield f"{threads} thread{'s' * (threads > 1)}", spent, found
    with cluster() as (client, started):
        yield "start", started, None
        for arms in (ARMS_A_TASK, 1):
            found, spent = on_dask(client, recordings, arms)
            yield f"Dask, {WORKERS} workers, {arms} arm{'s' * (arms > 1)} a task", spent, found
        clock = Clock(client)
        client.gather(client.map(nothing, range(len(recordings)), pure=False))
        yield "nothing", clock.read(), None


def main():
    """The row."""
    if not wants("fleet"):
        return
    recordings = sorted((FOLDER / "fleet").glob("*.csv"))
    first = None
    ready()
    for round in range(1, ROUNDS + 1):
        for how, spent, found in round_of(recordings):
            if found is not None:
                first = first or values(found)
                if values(found) != first:
                    raise RuntimeError(f"{how}: other results than those of one call after the other")
            line = {"fleet": how, "arms": len(recordings), "round": round, **spent}
            print(json.dumps({**line, "dask": version("dask"), "version": trical.__version__}), flush=True)


if __name__ == "__main__":
    main()
