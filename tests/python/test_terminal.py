"""What a person sees on a terminal: questions of a guided session with live readings beside what is typed."""

from __future__ import annotations

import os
import pty
import re
import select
import shutil
import subprocess
import time
from pathlib import Path

from conftest import program

ROOT = Path(__file__).resolve().parents[2]
CELL = ["--robot", "robot.toml", "--cell", "cell.toml"]
# the cursor is saved, two lines above are written anew, and it is put back
REDRAWN = re.compile("\x1b7\x1b\\[\\?7l\x1b\\[2A\r\x1b\\[2K(.*?)\x1b\\[1B\r\x1b\\[2K(.*?)\x1b8\x1b\\[\\?7h")


def heard(fd: int, seconds: float) -> str:
    """What the program writes to the terminal in that time."""
    out, end = b"", time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        if select.select([fd], [], [], left)[0]:
            out += os.read(fd, 65536)
    return out.decode()


def test_live_readings_leave_what_is_typed_alone(tmp_path: Path) -> None:
    for name in ("robot.toml", "cell.toml"):
        shutil.copy(ROOT / "cells" / "irb120" / name, tmp_path)
    virtual = [program(), "virtual-cell", *CELL, "--port", "0"]
    with subprocess.Popen(virtual, cwd=tmp_path, stdout=subprocess.PIPE, text=True) as cell:
        terminal, theirs = pty.openpty()
        try:
            assert cell.stdout is not None
            _, gauge, _, controller, _ = cell.stdout.readline().split("'")
            links = ["--gauge", gauge, "--controller", controller, "--out", "led.mcap", "--guided", "--go"]
            guided = [program(), "measure", *CELL, *links]
            with subprocess.Popen(guided, cwd=tmp_path, stdin=theirs, stdout=theirs, stderr=theirs) as led:
                try:
                    asked = heard(terminal, 3)
                    assert "Hold the device" in asked and REDRAWN.search(asked), asked
                    typed = ""
                    for key in "0,10,20":
                        os.write(terminal, key.encode())
                        typed += heard(terminal, 0.3)
                    shown = REDRAWN.findall(typed)
                    assert len(shown) > 3, typed
                    assert all("x +6.000 mm free" in x and "joints 0.00" in q for x, q in shown), typed
                    assert REDRAWN.sub("", typed) == "0,10,20"
                    os.write(terminal, b"\n")
                    assert "'0,10,20' is not understood" in heard(terminal, 2)
                    # an answer to the question that is asked again
                    os.write(terminal, b"q\n")
                    assert led.wait(20) == 1
                finally:
                    led.kill()
        finally:
            os.close(theirs)
            os.close(terminal)
            cell.terminate()
