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
__all__ = [
    "Diagnosis",
    "Identified",
    "Model",
    "NotConvergedError",
    "TricalError",
    "compensate",
    "diagnose",
    "effects",
    "identify",
    "parameters",
    "validate",
]

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


@dataclass(frozen=True)
class Diagnosis:
    """What a model lacks, by the recordings, and the model that has it.

    `findings` are dicts with effect, site, located, confidence, lambda, coefficients, evidence, rivals; `blind_to` what
    the recordings could not show; `unexplained` where a mismatch has no name; `answer` all of the command's JSON.
    """

    model: Model
    findings: list[dict[str, Any]]
    unexplained: list[dict[str, Any]] = field(repr=False)
    blind_to: list[dict[str, Any]] = field(repr=False)
    answer: dict[str, Any] = field(repr=False)

    def __str__(self) -> str:
        """Held-out error before and after, and a line for each finding."""
        base, final = self.answer["baseline"], self.answer["final"]
        lines = [f"held out {base['holdout_rms_mm']:.4f} -> {final['holdout_rms_mm']:.4f} mm"]
        lines += [
            f"  {f['effect']} at {f['site']}: {100 * f['confidence']:.0f} % sure, lambda {f['lambda']:.1f}"
            for f in self.findings
        ]
        lines += [f"  without a name: {u['site']}, {u['region']}" for u in self.unexplained]
        return "\n".join(lines)


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


def diagnose(
    recordings: PathLike | Sequence[PathLike], *, robot: PathLike, cell: PathLike, joints: str = "read"
) -> Diagnosis:
    """Say which physics the model of an arm lacks, by CSV recordings of it.

    `joints` is "read" or "commanded". Takes seconds for hundreds of poses, and lets other threads run meanwhile.
    """
    model, text = _native._diagnose(_paths(recordings), os.fspath(robot), os.fspath(cell), joints)
    answer: dict[str, Any] = json.loads(text)
    nameless = [] if answer["unexplained"] is None else [answer["unexplained"], *answer["more_unexplained"]]
    return Diagnosis(
        model=model,
        findings=answer["findings"],
        unexplained=nameless,
        blind_to=answer["blind_to"],
        answer=answer,
    )


def effects() -> list[dict[str, str]]:
    """The catalogue: dicts with name, site, form, needs, typical, rivals."""
    result: list[dict[str, str]] = json.loads(_native._effects_json())
    return result


def validate(
    model: Model, recordings: PathLike | Sequence[PathLike], *, robot: PathLike, cell: PathLike
) -> dict[str, Any]:
    """Position errors (mm) of the nominal arm and of a model on recordings: keys before, after, n, regions."""
    result: dict[str, Any] = json.loads(_native._validate(model, _paths(recordings), os.fspath(robot), os.fspath(cell)))
    return result


def compensate(
    program: PathLike,
    model: Model,
    out: PathLike | None = None,
    *,
    robot: PathLike,
    cell: PathLike,
    dialect: str | None = None,
    frames: PathLike | Sequence[PathLike] = (),
    partial: bool = False,
    tool: str | None = None,
    frame: str | None = None,
    temp_c: float | None = None,
    time_s: float | None = None,
    payload_kg: float | None = None,
    any_configuration: bool = False,
    own_base: bool = False,
) -> dict[str, Any]:
    """Rewrite a robot program so that the arm of `model` goes where the program says, as `trical compensate` does.

    The file `out` appears whole or not at all. Without it nothing is written, and the answer has `rows`: each target
    with its error before and after. Keys: targets, largest_move_mm, problems, before, after, meant_with.
    """
    text = _native._compensate(
        os.fspath(program),
        model,
        None if out is None else os.fspath(out),
        os.fspath(robot),
        os.fspath(cell),
        dialect,
        _paths(frames),
        partial,
        tool,
        frame,
        temp_c,
        time_s,
        payload_kg,
        any_configuration,
        own_base,
    )
    result: dict[str, Any] = json.loads(text)
    return result


def parameters(model: Model) -> list[dict[str, Any]]:
    """The terms of a model as dicts with name, site, value, unit, sd, nominal."""
    result: list[dict[str, Any]] = json.loads(model._terms_json())
    return result
