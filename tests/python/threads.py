"""What other threads can do meanwhile."""

from __future__ import annotations

import threading
from collections.abc import Callable


def ticks_during(work: Callable[[], object]) -> int:
    """How often this thread wakes up, a millisecond apart, while another does the work."""
    ticks, ended = 0, threading.Event()

    def done() -> None:
        try:
            work()
        finally:
            ended.set()

    thread = threading.Thread(target=done)
    thread.start()
    while not ended.wait(0.001):
        ticks += 1
    thread.join()
    return ticks
