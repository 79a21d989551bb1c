"""How long calls say how far they are."""

from __future__ import annotations

import sys
from collections.abc import Callable

Progress = bool | Callable[[float, str], object]


def listener(progress: Progress, title: str) -> Callable[[float, str], object] | None:
    """What the extension is to call: nothing, the caller's own function, or a line on standard error."""
    if callable(progress):
        return progress
    if not progress:
        return None
    width = 0

    def show(fraction: float, what: str) -> None:
        nonlocal width
        line = f"{title} {100 * fraction:3.0f} % {what}"
        sys.stderr.write("\r" + line.ljust(width) + ("\n" if fraction >= 1.0 else ""))
        sys.stderr.flush()
        width = len(line)

    return show
