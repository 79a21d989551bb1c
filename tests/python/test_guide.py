"""The guide does what it says: its commands are run, its outputs compared, its links followed.

In a chapter, an HTML comment before a code block says what to do with it:

    <!-- run -->          run the shell block; it must succeed
    <!-- run: fails 2 --> run it; its last command must end with that exit code
    <!-- run: with D -->  run it beside the recordings of the folder D of ../shared/data, which are not kept here:
                          skipped without them
    <!-- output -->       each line of this block was printed by the block run before it; decimals and spaces may
                          differ, a line that ends with ... is compared up to there, a line that is only ... with
                          nothing

In the chapter of messages, `<!-- provoke 2: COMMAND; COMMAND -->` makes the message of the heading before it appear,
with numbers of its own.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from conftest import SHARED, program

ROOT = Path(__file__).resolve().parents[2]
GUIDE = ROOT / "docs" / "guide" / "src"
CHAPTERS = sorted(p.name for p in GUIDE.glob("*.md") if p.name != "SUMMARY.md")
NOTE = re.compile(
    r"^<!-- (run|output)(?:: fails (\d+))?(?:: with (\w+))? -->\n+```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL
)
PROVOKED = re.compile(r"^### `([^\n]+)`\n+<!-- provoke (\d+): (.*?) -->$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\[[^\]]*\]\(([^)#\s]+)(?:#[^)]*)?\)")
NUMBER = re.compile(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?")
MEASURED = re.compile(r"[-+]?\d+(\.\d+(e[-+]?\d+)?|e[-+]?\d+)")


@dataclass(frozen=True)
class Block:
    """A marked code block."""

    kind: str
    fails: int
    beside: str
    text: str


def blocks(chapter: str) -> list[Block]:
    found = NOTE.findall((GUIDE / chapter).read_text())
    return [Block(kind, int(fails or 0), beside, text) for kind, fails, beside, _, text in found]


@pytest.fixture
def shell(tmp_path: Path) -> Iterator[object]:
    """Runs a script in a folder of its own, with `trical` and `python` on the path."""
    tools, place = tmp_path / "tools", tmp_path / "place"
    tools.mkdir(), place.mkdir()
    (tools / "trical").symlink_to(program())
    (tools / "python").write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    (tools / "python").chmod(0o755)
    environment = {**os.environ, "PATH": f"{tools}{os.pathsep}{os.environ['PATH']}", "TRICAL": str(ROOT), "LC_ALL": "C"}

    def run(script: str) -> subprocess.CompletedProcess[str]:
        log = tmp_path / "log"
        with log.open("w") as out:
            process = subprocess.Popen(
                ["bash", "-e", "-u", "-o", "pipefail", "-c", script],
                cwd=place,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
            try:
                process.wait(timeout=60)
            finally:  # a virtual cell may still be running in the background
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
        return subprocess.CompletedProcess(process.args, process.returncode, log.read_text(), "")

    yield run


def plain(line: str) -> str:
    """A line without what differs from machine to machine: numbers with decimals, and spaces."""
    return " ".join(MEASURED.sub("#", line).split())


def printed(wanted: str, lines: list[str]) -> bool:
    if wanted.strip() == "...":
        return True
    if wanted.endswith("..."):
        start = plain(wanted.removesuffix("..."))
        return any(line.startswith(start) for line in lines)
    return plain(wanted) in lines


@pytest.mark.parametrize("chapter", [c for c in CHAPTERS if any(b.kind == "run" for b in blocks(c))])
def test_commands_of_a_chapter_do_what_it_shows(chapter: str, shell) -> None:
    lines: list[str] = []
    for block in blocks(chapter):
        if block.beside and not (SHARED / block.beside).is_dir():
            pytest.skip(f"{SHARED / block.beside} is missing: recordings are not kept in this repository")
        if block.kind == "run":
            done = shell(f"ln -sf {SHARED / block.beside}/* .\n{block.text}" if block.beside else block.text)
            assert done.returncode == block.fails, f"{block.text}\nended with {done.returncode}:\n{done.stdout}"
            lines = [plain(line) for line in done.stdout.splitlines()]
        else:
            for wanted in block.text.splitlines():
                found = "\n".join(lines)
                assert printed(wanted, lines), f"{chapter} shows\n{wanted}\nbut the program printed\n{found}"


def test_every_message_appears_as_the_guide_quotes_it(shell) -> None:
    text = (GUIDE / "messages.md").read_text()
    assert text.count("\n### `") == len(PROVOKED.findall(text)), "a message that nothing provokes"
    done = shell(
        "trical demo --conceal none --out demo-out; trical convert demo-out/run.mcap run.csv;"
        "cp demo-out/{robot,cell}.toml ."
    )
    assert done.returncode == 0, done.stdout
    for message, code, script in PROVOKED.findall(text):
        done = shell(script.replace("--RC", "--robot robot.toml --cell cell.toml"))
        assert done.returncode == int(code), f"{script}\nended with {done.returncode}:\n{done.stdout}"
        pattern = ".*".join(re.escape(NUMBER.sub("#", part.strip())) for part in message.split("..."))
        assert re.search(pattern, NUMBER.sub("#", done.stdout)), f"'{message}' is not in\n{done.stdout}"


def test_every_field_of_a_diagnosis_is_explained(shell) -> None:
    """The chapter's tables name the keys of the JSON, all of them and no others."""
    first = next(b for b in blocks("diagnosis.md") if b.kind == "run")
    assert shell(first.text).returncode == 0
    done = shell(
        "cd concealed/cases/*; trical diagnose recording.csv --robot robot.toml --cell cell.toml --json 2>/dev/null"
    )
    answer = json.loads(done.stdout)
    keys = set(answer) - {"recordings", "joints", "baseline", "final"}
    for part in ("baseline", "final"):
        keys |= {f"{part}.{k}" for k in answer[part]}
    for finding in answer["findings"]:
        keys |= {f"findings.{k}" for k in finding} | {f"findings.evidence.{k}" for k in finding["evidence"]}
    text = (GUIDE / "diagnosis.md").read_text()
    explained = set(re.findall(r"^\| `([a-z_.]+)` \|", text, re.MULTILINE))
    assert keys - explained == set(), "in the answer, not in the chapter"


@pytest.mark.parametrize("page", [*(f"docs/guide/src/{c}" for c in [*CHAPTERS, "SUMMARY.md"]), "README.md"])
def test_links_lead_somewhere(page: str) -> None:
    here = ROOT / page
    for target in LINK.findall(here.read_text()):
        if "://" not in target:
            assert (here.parent / target).exists(), f"{page} links to {target}"


def test_the_guide_is_in_its_summary() -> None:
    listed = set(LINK.findall((GUIDE / "SUMMARY.md").read_text()))
    assert listed == set(CHAPTERS)


def test_the_python_of_the_readme_runs(shell) -> None:
    (block,) = re.findall(r"^```python\n(.*?)^```$", (ROOT / "README.md").read_text(), re.MULTILINE | re.DOTALL)
    prepare = "trical demo --conceal none --out d; cp d/robot.toml d/cell.toml .; trical convert d/run.mcap touches.csv"
    done = shell(f"({prepare}) > /dev/null; python - <<'END'\n{block}assert positions.shape == (1, 3)\nEND")
    assert done.returncode == 0, done.stdout
    error, diagnosis = done.stdout.split("\n", 1)
    assert 0 < float(error) < 0.02
    assert "measurements at" in diagnosis.splitlines()[0]
