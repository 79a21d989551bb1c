"""TriCal for NumPy users: the library behind the `trical` command.

>>> import trical
>>> result = trical.identify(["touches.csv"], robot="robot.toml", cell="cell.toml")  # doctest: +SKIP
>>> result.errors["mean_mm"]  # doctest: +SKIP
0.011
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from . import _native
from ._native import Model, NotConvergedError, TricalError

__version__: str = _native.__version__
__all__ = ["Identified", "Model", "NotConvergedError", "TricalError", "identify", "parameters", "validate"]

PathLike = str | os.PathLike[str]


@dataclass(frozen=True)
class Identified:
    """A fitted model and what the fit knows about itself.

    `parameters` is a list of dicts with name, site, value, unit, sd, nominal; `errors` are position errors at the data
    (mean_mm, max_mm, sd_mm, median_mm, rms_mm); `cross_validation` the same for poses that were not in the fit.
    """

    model: Model
    parameters: list[dict[str, Any]] = field(repr=False)
    errors: dict[str, float]
    observations: int
    rejected: list[dict[str, Any]] = field(repr=False)
    observability: dict[str, float] = field(repr=False)
    cross_validation: dict[str, float] | None = None


def _paths(recordings: PathLike | Sequence[PathLike]) -> list[str]:
    if isinstance(recordings, str | os.PathLike):
        recordings = [recordings]
    return [os.fspath(r) for r in recordings]


def identify(
    recordings: PathLike | Sequence[PathLike],
    *,
    robot: PathLike,
    cell: PathLike,
    joints: str = "read",
    model: str = "compliance",
    folds: int | None = None,
) -> Identified:
    """Identify an arm's parameters from CSV recordings.

    `joints` is "read" or "commanded"; `model` is "nominal", "geometry", "compliance" or "complete"; with `folds`, every
    pose is also scored by a fit without it.
    """
    fitted, text = _native._identify(_paths(recordings), os.fspath(robot), os.fspath(cell), joints, model, folds)
    s = json.loads(text)
    return Identified(
        model=fitted,
        parameters=s["parameters"],
        errors=s["errors"],
        observations=s["observations"],
        rejected=s["rejected"],
        observability=s["observability"],
        cross_validation=s["cross_validation"],
    )


def validate(
    model: Model, recordings: PathLike | Sequence[PathLike], *, robot: PathLike, cell: PathLike
) -> dict[str, Any]:
    """Position errors (mm) of the nominal arm and of a model on recordings: keys before, after, n, regions."""
    result: dict[str, Any] = json.loads(_native._validate(model, _paths(recordings), os.fspath(robot), os.fspath(cell)))
    return result


def parameters(model: Model) -> list[dict[str, Any]]:
    """The terms of a model as dicts with name, site, value, unit, sd, nominal."""
    result: list[dict[str, Any]] = json.loads(model._terms_json())
    return result
