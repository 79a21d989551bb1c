"""A million poses from a file into NumPy arrays: TriCal, and what people read tables with.

Everybody ends with joint values (n, 6) in rad and positions (n, 3) in m; these are compared with those that were
written. Peers give the arrays alone; ours, a `Recording`, whose rows are checked, and the arrays of it.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))
from measure import FOLDER, SLOW, cpu_times_in_turn, wants  # isort: skip  (threads are limited before the libraries load)

import json
from functools import partial
from importlib.metadata import version

import mcap.reader
import numpy as np
import pandas
import polars
import pyarrow
import pyarrow.csv
import pyarrow.parquet

import trical

pyarrow.set_cpu_count(1)
pyarrow.set_io_thread_count(1)
COLUMNS = [*(f"q{j}_deg" for j in range(1, 7)), "x_mm", "y_mm", "z_mm"]
NAMES = {"csv": "CSV", "mcap": "MCAP", "parquet": "Parquet"}
CHECKED = "a `Recording`, rows checked, and arrays of it"


def arrays(table):
    """Joint values in rad and positions in m of a table (n, 9) in deg and mm."""
    return np.deg2rad(table[:, :6]), 1e-3 * table[:, 6:]


def of_arrow(table):
    """The same of a table of Arrow."""
    return arrays(np.stack([table[c].to_numpy() for c in COLUMNS]).T)


def of_recording(recording):
    """The same of ours."""
    return recording.q, recording.position


def read_csv_by_arrow(path):
    """By pyarrow, on one thread."""
    return of_arrow(pyarrow.csv.read_csv(path, read_options=pyarrow.csv.ReadOptions(use_threads=False)))


def read_parquet_by_arrow(path):
    """By pyarrow, on one thread."""
    return of_arrow(pyarrow.parquet.read_table(path, columns=COLUMNS, use_threads=False))


def read_mcap(path):
    """By the reader of MCAP's own project, message by message, in the order of the file: faster than by time."""
    with open(path, "rb") as file:
        messages = mcap.reader.make_reader(file).iter_messages(topics=["/measurement"], log_time_order=False)
        rows = [json.loads(message.data) for _, _, message in messages]
    return arrays(np.array([[row[c] for c in COLUMNS] for row in rows]))


def from_parquet(path):
    """What a user of TriCal does with a Parquet file: arrays of it by pyarrow, a `Recording` of the arrays."""
    q, position = read_parquet_by_arrow(path)
    return of_recording(trical.Recording(q=q, position=position))


#: By the ending of the file: who, the package whose version is told, the call, what it gives.
READERS = {
    "csv": [
        ("TriCal, Python, `Recording.load`", "trical", lambda p: of_recording(trical.Recording.load(p)), CHECKED),
        ("NumPy, loadtxt", "numpy", lambda p: arrays(np.loadtxt(p, delimiter=",", skiprows=1)), "arrays"),
        ("pandas, read_csv", "pandas", lambda p: arrays(pandas.read_csv(p)[COLUMNS].to_numpy()), "arrays"),
        ("Polars, read_csv", "polars", lambda p: arrays(polars.read_csv(p)[COLUMNS].to_numpy()), "arrays"),
        ("pyarrow, csv.read_csv", "pyarrow", read_csv_by_arrow, "arrays"),
    ],
    "mcap": [
        ("TriCal, Python, `Recording.load`", "trical", lambda p: of_recording(trical.Recording.load(p)), CHECKED),
        ("mcap, Python, message by message", "mcap", read_mcap, "arrays"),
    ],
    "parquet": [
        ("TriCal, Python: arrays by pyarrow, `Recording(q=..., position=...)`", "trical", from_parquet, CHECKED),
        (
            "TriCal, Python: DataFrame by pandas, `Recording.from_frame`",
            "trical",
            lambda p: of_recording(trical.Recording.from_frame(pandas.read_parquet(p))),
            CHECKED,
        ),
        ("pandas, read_parquet", "pandas", lambda p: arrays(pandas.read_parquet(p)[COLUMNS].to_numpy()), "arrays"),
        ("Polars, read_parquet", "polars", lambda p: arrays(polars.read_parquet(p)[COLUMNS].to_numpy()), "arrays"),
        ("pyarrow, parquet.read_table", "pyarrow", read_parquet_by_arrow, "arrays"),
    ],
}


def written(path, ending):
    """The recording with another ending: MCAP by ours, Parquet by pyarrow."""
    other = path.with_suffix(f".{ending}")
    if ending == "mcap":
        trical.convert(path, other)
    elif ending == "parquet":
        pyarrow.parquet.write_table(pyarrow.csv.read_csv(path), other)
    return other


def main():
    """All rows."""
    few, many = FOLDER / "elastic_points.csv", FOLDER / "elastic_big.csv"
    if not many.exists():
        return
    true = None
    for ending, readers in READERS.items():
        row = f"loading, 1000000 poses from {NAMES[ending]}"
        if not wants(row):
            continue
        if true is None:
            true = read_csv_by_arrow(many)
        small, big = written(few, ending), written(many, ending)
        for _, _, call, _ in readers:
            call(small)  # what is imported when it is first needed
        calls = {who: partial(call, big) for who, _, call, _ in readers}
        told = {who: (package, gives) for who, package, _, gives in readers}
        for who, round, seconds, gave in cpu_times_in_turn(calls):
            off = max(np.abs(a - b).max() for a, b in zip(gave, true, strict=True))
            if off > 1e-12:
                raise RuntimeError(f"{who}: numbers from {big.name} are off by {off}")
            package, gives = told[who]
            gives += ", timed once" if seconds > SLOW else ""
            line = {"row": row, "who": who, "round": round, "seconds": seconds, "accuracy": gives}
            if package == "trical":
                line |= {"ours": True, "version": trical.__version__}
            else:
                line["version"] = f"{package} {version(package)}"
            print(json.dumps(line), flush=True)
        if ending != "csv":
            print(f"{big.name}: {big.stat().st_size / 1e6:.0f} MB", file=sys.stderr)
            big.unlink()
            small.unlink()


if __name__ == "__main__":
    main()
