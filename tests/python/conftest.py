from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared" / "data"

# the one that `cargo test` builds, which checks for overflow; TRICAL_PROGRAM names another, such as one to be released
BUILT = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "debug" / "trical"
PROGRAM = Path(os.environ.get("TRICAL_PROGRAM", BUILT)).absolute()


def program() -> Path:
    """The program `trical`; without it the test is skipped."""
    if not PROGRAM.is_file():
        pytest.skip(f"{PROGRAM} is missing: cargo build")
    return PROGRAM


@pytest.fixture
def shared() -> Path:
    if not SHARED.is_dir():
        pytest.skip("../shared/data is missing: recordings are not kept in this repository")
    return SHARED
