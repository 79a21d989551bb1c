"""The notebooks run anywhere from top to bottom by the library alone, and carry their outputs."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_a_notebook_carries_its_outputs_and_needs_nothing_beside_the_library(path: Path) -> None:
    cells = [c for c in json.loads(path.read_text())["cells"] if c["cell_type"] == "code"]
    assert [c["execution_count"] for c in cells] == list(range(1, len(cells) + 1)), "run it from top to bottom"
    assert sum("image/png" in o.get("data", {}) for c in cells for o in c["outputs"]) >= 2
    text = path.read_text()
    for other in ("subprocess", "ROOT", "proof/make", str(ROOT), "/tmp", "/home"):
        assert other not in text, other
    assert path.stat().st_size < 500_000


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_a_notebook_runs_in_any_folder(path: Path, tmp_path: Path) -> None:
    reason = "the Jupyter packages of tests/python/requirements.txt are not installed"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # those of Jupyter are not ours
        nbformat = pytest.importorskip("nbformat", reason=reason)
        nbclient = pytest.importorskip("nbclient", reason=reason)
        pytest.importorskip("ipykernel", reason=reason)
        pytest.importorskip("matplotlib", reason=reason)
        notebook = nbformat.read(path, as_version=4)
        client = nbclient.NotebookClient(
            notebook, timeout=180, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}
        )
        client.execute()
    figures = [
        o for c in notebook.cells if c.cell_type == "code" for o in c.outputs if "image/png" in o.get("data", {})
    ]
    assert len(figures) >= 2
