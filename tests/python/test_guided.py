"""A guided session: what it keeps when it is left and taken up again."""

from __future__ import annotations

import json
import os
import pty
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from conftest import program

ROOT = Path(__file__).resolve().parents[2]
# where the arm of this cell is near balls 1, 2 and 3, and touches them
NEAR = [
    "20.338680,18.276747,31.824045,37.617683,28.659135,-100.786008",
    "-10.511914,34.371097,12.378490,148.154722,-49.097734,-178.053280",
    "0.321480,64.260808,-45.733316,8.997356,57.826563,-91.879952",
]
AT = [
    "20.703695,18.270961,38.474151,38.073793,22.320387,-99.727757",
    "-8.891380,30.596185,24.757664,141.188717,-43.227420,-169.071397",
    "-1.082384,59.115606,-27.483299,12.884404,43.067243,-99.491662",
]
BALL = [[near, at, "", near] for near, at in zip(NEAR, AT, strict=True)]
# no mastering, the tool point of the file; a ball each is touched when the arm is back from the one before
TO_PLAN = ["s", "s", *BALL[0][:3], BALL[0][3], *BALL[1], *BALL[2][:3]]


class Session:
    def __init__(self, folder: Path, links: list[str]) -> None:
        self.folder, self.links = folder, links

    def start(self, *more: str, cell: str = "cell.toml") -> subprocess.Popen[str]:
        files = ["--robot", "robot.toml", "--cell", cell, "--out", "led.mcap"]
        args = [str(program()), "measure", "--guided", "--go", *files, *self.links, *more]
        pipe = subprocess.PIPE
        return subprocess.Popen(args, cwd=self.folder, stdin=pipe, stdout=pipe, stderr=pipe, text=True)

    def run(self, lines: list[str], *more: str, cell: str = "cell.toml") -> tuple[str, str]:
        """What is said on standard output and standard error of a session that ends with q."""
        with self.start(*more, cell=cell) as led:
            return led.communicate("\n".join([*lines, "q", ""]), timeout=120)

    def kept(self) -> dict[str, object]:
        return dict(json.loads((self.folder / "led.guided.json").read_text()))

    def times(self) -> list[float]:
        convert = [str(program()), "convert", "led.setup.mcap", "led.csv"]
        subprocess.run(convert, cwd=self.folder, check=True, capture_output=True)
        head, *rows = (self.folder / "led.csv").read_text().splitlines()
        at = head.split(",").index("t_s")
        return [float(row.split(",")[at]) for row in rows]


@pytest.fixture
def session(tmp_path: Path) -> Iterator[Session]:
    for name in ("robot.toml", "cell.toml"):
        shutil.copy(ROOT / "cells" / "irb120" / name, tmp_path)
    virtual = [str(program()), "virtual-cell", "--robot", "robot.toml", "--cell", "cell.toml", "--port", "0"]
    with subprocess.Popen(virtual, cwd=tmp_path, stdout=subprocess.PIPE, text=True) as cell:
        try:
            assert cell.stdout is not None
            _, gauge, _, controller, _ = cell.stdout.readline().split("'")
            yield Session(tmp_path, ["--gauge", gauge, "--controller", controller])
        finally:
            cell.terminate()


def test_the_base_is_on_the_disk_before_its_step_is_done_and_the_touches_can_be_gone_back_to(session: Session) -> None:
    told = session.run([*TO_PLAN, "b", "b"])[0]
    questions = [line for line in told.splitlines() if line.startswith("> Ball")]
    assert "Ball 3. (touched already" in questions[-2] and "Ball 2. (touched already" in questions[-1], told
    found = (session.folder / "led.cell.toml").read_text()
    assert session.kept()["steps_done"] == 7
    # the cell cannot be written when the base has been computed, as on a full disk
    (session.folder / "led.cell.toml").unlink()
    with session.start("--resume") as led:
        assert led.stdin is not None and led.stdout is not None
        while not led.stdout.readline().startswith("> Ball 2"):
            pass
        (session.folder / "led.cell.toml").mkdir()
        led.communicate("s\ns\n", timeout=60)
    (session.folder / "led.cell.toml").rmdir()
    assert session.kept()["steps_done"] == 9
    session.run([], "--resume")
    assert (session.folder / "led.cell.toml").read_text() == found
    # an obstacle since then: what was found, and would be planned, knows nothing of it
    text = (session.folder / "cell.toml").read_text()
    solid = '[{ shape = "box", center_mm = [150.0, 100.0, 100.0], size_mm = [600.0, 600.0, 150.0] }]'
    (session.folder / "new.toml").write_text(f'{text}\n[[geometry.obstacle]]\nname = "new fixture"\nsolids = {solid}\n')
    assert session.kept()["steps_done"] == 10
    for go in (["--resume"], ["--resume", "--plan", "none.csv"]):
        refused = session.run([], *go, cell="new.toml")
        assert "was recorded with another cell.toml" in refused[1], refused
    (session.folder / "led.cell.toml").unlink()
    assert "led.cell.toml: is missing" in session.run([], "--resume")[1]


def test_touches_of_another_mastering_do_not_count_and_their_times_include_the_pauses(session: Session) -> None:
    # ball 1 stands for the calibrator
    session.run(["s", "s", *BALL[0]])
    ended = time.monotonic()
    time.sleep(2)
    begins = time.monotonic()
    told = session.run(["b", "b", "b", "", AT[0], "", NEAR[0], "s", AT[0], ""], "--resume")[0]
    assert "touches before were made with another zero" in " ".join(told.split()), told
    assert "> Ball 1. (s: keep the base of the cell file.)" in told, told
    assert session.kept()["touches_after_s"] != 0
    before, after = session.times()
    assert after - before > begins - ended


def test_keys_pressed_before_a_question_do_not_answer_it_at_a_terminal(session: Session) -> None:
    ours, theirs = pty.openpty()
    files = ["--robot", "robot.toml", "--cell", "cell.toml", "--out", "led.mcap"]
    args = [str(program()), "measure", "--guided", "--go", *files, *session.links]
    told = b""

    def until(question: bytes, count: int) -> None:
        nonlocal told
        end = time.monotonic() + 120
        while told.count(question) < count:
            assert time.monotonic() < end and led.poll() is None, told.decode()
            told += os.read(ours, 4096)

    with subprocess.Popen(args, cwd=session.folder, stdin=theirs, stdout=theirs, stderr=theirs) as led:
        try:
            for question, typed in (b"> Hold", b"s\n"), (b"> Ball 1, orientation", b"s\n"):
                until(question, 1)
                os.write(ours, typed)
            until(b"> Ball 1.", 1)
            # while the arm goes there, somebody leans on the keyboard
            os.write(ours, f"{NEAR[0]}\ns\ns\nsss".encode())
            until(b"> Ball 1.", 2)
            os.write(ours, b"q\n")
            until(b"ended by the user", 1)
        finally:
            led.kill()
    assert b"> Ball 2" not in told, told.decode()
    os.close(ours)
    os.close(theirs)


def test_a_byte_that_is_no_text_is_not_understood_and_a_controller_that_was_away_is_opened_anew(tmp_path: Path) -> None:
    for name in ("robot.toml", "cell.toml"):
        shutil.copy(ROOT / "cells" / "irb120" / name, tmp_path)
    (tmp_path / "faults.toml").write_text('[[fault]]\nwhat = "drop_connection"\nafter_commands = 12\nlasts = 1\n')
    files = ["--robot", "robot.toml", "--cell", "cell.toml"]
    virtual = [str(program()), "virtual-cell", *files, "--port", "0", "--faults", "faults.toml"]
    with subprocess.Popen(virtual, cwd=tmp_path, stdout=subprocess.PIPE, text=True) as cell:
        try:
            assert cell.stdout is not None
            _, gauge, _, controller, _ = cell.stdout.readline().split("'")
            record = [
                str(program()),
                "record",
                *files,
                "--controller",
                controller,
                "--place",
                "A",
                "--out",
                "visits.csv",
            ]
            typed = b"1\np B\xfcro\n" + 7 * b"2\n"
            said = subprocess.run(record, cwd=tmp_path, input=typed, capture_output=True, timeout=60)
            told = said.stderr.decode()
            assert "which is not UTF-8" in told and said.returncode == 0, told
            assert told.count("no row: ") == 1 and b"7 rows added" in said.stdout, told
            links = ["--gauge", gauge, "--controller", controller, "--out", "led.mcap"]
            guided = [str(program()), "measure", "--guided", "--go", *files, *links]
            led = subprocess.run(guided, cwd=tmp_path, input=b"\xe9\nq\n", capture_output=True, timeout=60)
            assert b"is not understood" in led.stdout, led
        finally:
            cell.terminate()
