"""The `trical` command: the same program as the standalone binary."""

from __future__ import annotations

import signal
import sys

from ._native import _program


def main() -> int:
    """Run the program with the arguments of this process; its exit code."""
    # the program stops the arm on Ctrl-C by itself
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _program(["trical", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
