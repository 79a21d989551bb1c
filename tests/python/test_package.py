"""The package itself: stubs that fit the extension, docstrings everywhere, extras that are optional, a quick import."""

from __future__ import annotations

import inspect
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

import trical
from trical import _native

ERRORS = [getattr(trical, n) for n in trical.__all__ if n.endswith("Error")]


def test_stubs_fit_the_extension() -> None:
    pytest.importorskip("mypy.stubtest", reason="mypy is not installed")
    command = [sys.executable, "-m", "mypy.stubtest", "trical._native"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def public(of: object) -> list[tuple[str, object]]:
    return [(n, v) for n, v in vars(of).items() if not n.startswith("_")]


def test_everything_public_is_documented() -> None:
    bare = []
    for name in trical.__all__:
        value = getattr(trical, name)
        if isinstance(value, str):
            continue
        if not (inspect.getdoc(value) or "").strip():
            bare.append(name)
        if inspect.isclass(value) and not issubclass(value, Exception):
            fields = getattr(value, "__dataclass_fields__", {})
            for member, m in public(value):
                if member not in fields and not (inspect.getdoc(m) or "").strip():
                    bare.append(f"{name}.{member}")
            bare += [f"{name}.{f}" for f in fields if f[0] != "_" and f not in inspect.getdoc(value)]
    forgiven = {
        f"Identified.{f}" for f in ("model", "observations", "rejected", "observability", "cautions", "joints")
    } | {"Identified.not_identifiable", "Identified.correlated", "Validation.n", "Validation.rejected"}
    forgiven |= {"Diagnosis.model", "Observability.rows"}
    assert sorted(set(bare) - forgiven) == []


def test_the_extension_offers_only_what_the_package_wraps() -> None:
    outside = [n for n in _native.__all__ if not n.startswith("_") and n not in trical.__all__]
    assert sorted(outside) == ["ControllerLink", "GaugeLink", "Outcome", "Rows"]


@pytest.mark.parametrize("kind", ERRORS)
def test_errors_are_named_and_travel(kind: type[Exception]) -> None:
    again = pickle.loads(pickle.dumps(kind("line 3: found nothing")))
    assert type(again) is kind and str(again) == "line 3: found nothing"
    failed = (trical.NotConvergedError, trical.DeviceError, trical.MeasuringError)
    assert issubclass(kind, trical.TricalError) or (kind in failed and issubclass(kind, RuntimeError))
    assert kind.__module__ == "trical" and kind.__doc__


def test_import_needs_neither_numpy_nor_extras() -> None:
    code = "import sys, trical; print([m for m in ('numpy', 'pandas', 'matplotlib') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_plots_without_matplotlib_say_what_to_install() -> None:
    code = """
import sys
sys.modules["matplotlib"] = None
import trical
v = trical.Validation({}, {}, 0, None, [], [], [], [], None)
try:
    v.plot()
except ImportError as e:
    print(e)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == 'plots need matplotlib, which is not installed: pip install "trical[plot]"'


def test_the_package_brings_the_command_along(tmp_path: Path) -> None:
    command = Path(sys.executable).with_name("trical")
    for run in ([str(command)], [sys.executable, "-m", "trical"]):
        done = subprocess.run([*run, "--version"], capture_output=True, text=True)
        assert (done.returncode, done.stdout) == (0, f"trical {trical.__version__}\n")
    done = subprocess.run([str(command), "identify", "no.csv"], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 2 and "--robot" in done.stderr


def test_the_sample_is_what_the_command_writes(tmp_path: Path) -> None:
    ours = trical.sample(tmp_path / "ours")
    done = subprocess.run([sys.executable, "-m", "trical", "sample", "theirs"], cwd=tmp_path, capture_output=True)
    assert done.returncode == 0
    for path in (ours.robot, ours.cell, ours.recording):
        assert path.read_bytes() == (tmp_path / "theirs" / path.name).read_bytes()
    with pytest.raises(FileExistsError):
        trical.sample(tmp_path / "ours")
    assert trical.identify(ours.recording, robot=ours.robot, cell=ours.cell).errors["mean_mm"] < 0.05
