"""Arguments, refused by their names where they make no sense."""

from __future__ import annotations

import operator
import os
from typing import Any

from ._native import TricalError


def path_of(given: str | bytes | os.PathLike[Any]) -> str:
    """Return a path, and refuse the text of a file."""
    path = os.fsdecode(given)
    if "\n" in path:
        raise TricalError(f"found a text that begins with {path.splitlines()[0]!r:.60}, expected the path of a file")
    return path


def wholes(given: dict[str, Any], *names: str) -> dict[str, Any]:
    """Return the keywords with those of these names as whole numbers."""
    return {**given, **{name: whole(name, given[name]) for name in names}}


def whole(name: str, given: Any) -> Any:
    """Refuse what is no whole number from 0, by the argument's name."""
    if given is None:
        return None
    try:
        number = operator.index(given)
    except TypeError:
        number = -1
    if not 0 <= number < 1 << 63:
        raise TricalError(f"{name} is {given!r}, expected a whole number, 0 or more")
    return number
