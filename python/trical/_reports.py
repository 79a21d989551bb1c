"""Reports of results: the HTML files that the command line writes with `--report`."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from ._native import Outcome, TricalError

_Path = str | os.PathLike[str]

# keywords that may be paths of files
_FILES = ("robot", "cell", "known")


def _word(value: object) -> str:
    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    if hasattr(value, "columns") and hasattr(value, "shape"):
        return "a DataFrame"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_word, value))}]"
    return repr(value)


def _paths(value: object) -> list[str]:
    if isinstance(value, str | os.PathLike):
        return [str(os.fspath(value))]
    if isinstance(value, list | tuple):
        return [p for v in value for p in _paths(v)]
    return []


@dataclass(frozen=True)
class Made:
    """What a report needs: the results, the call, the files that it read."""

    outcome: Outcome
    call: str
    inputs: list[str]

    @classmethod
    def of(cls, outcome: Outcome, function: Callable[..., Any], *args: object, **keywords: object) -> Made:
        """Remember a call, whose `args` may be paths too; keywords as by default are not told."""
        usual = inspect.signature(function).parameters
        said = [_word(a) for a in args]
        said += [
            f"{k}={_word(v)}" for k, v in keywords.items() if not (k in usual and _word(usual[k].default) == _word(v))
        ]
        inputs = [p for v in (*args, *(keywords.get(f) for f in _FILES)) for p in _paths(v)]
        return cls(outcome, f"trical.{function.__name__}({', '.join(said)})", inputs)


@dataclass(frozen=True, repr=False, kw_only=True)
class Reported:
    """A result with a report."""

    _made: Made | None = field(default=None, compare=False)

    def report(self, path: _Path) -> None:
        """Write the report to read and to print: one HTML file, as `--report` of the command writes it.

        It ends with the call and the SHA-256 of the files that it read. A pickled result has no report: write it where
        the result was computed. Raises TricalError.
        """
        if self._made is None:
            raise TricalError("this result was pickled or built by hand: write its report where it was made")
        self._made.outcome.write(path, self._made.call, self._made.inputs)

    def _outcome(self) -> Outcome:
        if self._made is None:
            raise TricalError("this result was pickled or built by hand: draw it where it was made")
        return self._made.outcome

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what the report is made of: it may be large, and stays in the process that made it."""
        return {**self.__dict__, "_made": None}


@dataclass(frozen=True, repr=False, kw_only=True)
class Certified(Reported):
    """A result with a certificate too."""

    def certificate(self, path: _Path) -> None:
        """Write a certificate to print and sign: one page, HTML, as `--certificate` of the command writes it.

        Pose accuracy AP, repeatability RP and distance accuracy AD by the formulas of ISO 9283, before and after; the
        share of measurements within 0.1, 0.2, 0.5 and 1 mm; the worst one; the model's SHA-256. Raises TricalError.
        """
        if self._made is None:
            raise TricalError("this result was pickled or built by hand: certify it where it was made")
        self._made.outcome.certify(path, self._made.call, self._made.inputs)
