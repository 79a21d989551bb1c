"""Whole calibrations by simulation: what `trical study` does."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from . import _native
from ._calls import _machine
from ._given import whole, wholes
from ._native import Cell, Robot, TricalError
from ._progress import Progress, listener
from ._recording import PathLike
from ._reports import Made
from ._results import Study


def _common(given: dict[str, Any]) -> dict[str, Any]:
    if given["model"] == "nominal":
        raise TricalError("model is 'nominal', expected 'geometry', 'compliance' or 'complete'")
    given = wholes(given, "trials", "seed", "pool")
    return {**given, "compliance_deg_per_nm": [float(c) for c in given["compliance_deg_per_nm"]]}


def _study(result: Any, key: str, made: Made) -> Study:
    _, table, csv, svg, verdict, notes, text = result
    answer = json.loads(text)
    return Study(answer[key], verdict, notes, table, csv, svg, answer, _made=made)


def study_touches(
    *,
    robot: PathLike | Robot,
    cell: PathLike | Cell,
    per_ball: Sequence[int] = (5, 8, 11, 15, 20, 30),
    trials: int = 40,
    seed: int = 1,
    pool: int = 100,
    criterion: str = "d",
    model: str = "compliance",
    length_mm: float = 1.0,
    angle_deg: float = 1.0,
    compliance_deg_per_nm: Sequence[float] = (1e-3, 1e-1),
    indicator_mm: float = 0.001,
    procedure_mm: float = 0.010,
    ballbar_mm: float = 0.001,
    progress: Progress = False,
) -> Study:
    """Simulate the paper's study: position error against the number of touches, chosen against random ones.

    For each number of touches random true arms are touched with noise and identified; the error of the identified arm
    is computed at poses that were not touched.

    Args:
        robot: path of a robot.toml or URDF, or a Robot.
        cell: path of a cell.toml, or a Cell.
        per_ball: touches a ball, several settings, each at most `pool`.
        trials: true arms drawn for each setting.
        seed: the same seed gives the same study.
        pool: candidates a ball.
        criterion: what chosen touches are optimized for, as for `plan`.
        model: parameters to identify: "geometry", "compliance" or "complete".
        length_mm: standard deviation of every length of a true arm, mm.
        angle_deg: standard deviation of every angle of a true arm, deg.
        compliance_deg_per_nm: (2,) least and largest compliance of its joints, deg/Nm.
        indicator_mm: noise of an indicator, mm (standard deviation, as the two below).
        procedure_mm: noise of the procedure along each axis, mm.
        ballbar_mm: noise of each coordinate of a ball's known place, mm.
        progress: as for `identify`; Ctrl-C ends the call between two settings.

    Raises:
        TricalError, PlanningError: numbers that make no sense; balls that the arm cannot touch.
    """
    said = {"trials": trials, "seed": seed, "pool": pool, "criterion": criterion, "model": model}
    said |= {"length_mm": length_mm, "angle_deg": angle_deg, "compliance_deg_per_nm": compliance_deg_per_nm}
    said |= {"indicator_mm": indicator_mm, "procedure_mm": procedure_mm, "ballbar_mm": ballbar_mm}
    counts = [whole("per_ball", n) for n in per_ball]
    result = _native._study_touches(_machine(robot, cell), counts, _common(said), listener(progress, "studying"))
    made = Made.of(result[0], study_touches, robot=robot, cell=cell, per_ball=per_ball, **said)
    return _study(result, "settings", made)


def study_platforms(
    *,
    robot: PathLike | Robot,
    cell: PathLike | Cell,
    touches: int = 45,
    balls: Sequence[int] = (3, 6),
    side_mm: Sequence[float] = (100.0, 200.0, 300.0, 400.0),
    height_mm: Sequence[float] = (0.0, 150.0),
    raise_mm: Sequence[float] = (0.0, 250.0),
    trials: int = 40,
    seed: int = 1,
    pool: int = 100,
    criterion: str = "d",
    model: str = "compliance",
    length_mm: float = 1.0,
    angle_deg: float = 1.0,
    compliance_deg_per_nm: Sequence[float] = (1e-3, 1e-1),
    indicator_mm: float = 0.001,
    procedure_mm: float = 0.010,
    ballbar_mm: float = 0.001,
    progress: Progress = False,
) -> Study:
    """Compare platforms of balls: every combination of number, size, height and a second plate.

    Args:
        robot: path of a robot.toml or URDF, or a Robot.
        cell: path of a cell.toml, or a Cell.
        touches: touches of all balls together.
        balls: numbers of balls, 3 or more, evenly on a circle about the middle of the cell's own balls.
        side_mm: sizes: the side of the triangle that three balls on that circle make, mm.
        height_mm: heights above the balls of the cell, mm.
        raise_mm: how much higher every second ball is (a second plate), mm.
        trials: true arms drawn for each platform; this and the rest as for `study_touches`.
        seed: see there.
        pool: see there.
        criterion: see there.
        model: see there.
        length_mm: see there.
        angle_deg: see there.
        compliance_deg_per_nm: see there.
        indicator_mm: see there.
        procedure_mm: see there.
        ballbar_mm: see there.
        progress: see there.

    A platform that cannot be used has a `problem` among `Study.settings`. Raises TricalError where numbers make no
    sense.
    """
    said = {"trials": trials, "seed": seed, "pool": pool, "criterion": criterion, "model": model}
    said |= {"length_mm": length_mm, "angle_deg": angle_deg, "compliance_deg_per_nm": compliance_deg_per_nm}
    said |= {"indicator_mm": indicator_mm, "procedure_mm": procedure_mm, "ballbar_mm": ballbar_mm}
    places: dict[str, Any] = {"touches": touches, "balls": balls}
    places |= {"side_mm": side_mm, "height_mm": height_mm, "raise_mm": raise_mm}
    given = {**_common(said), "touches": touches, "balls": list(balls)}
    given |= {name: [float(x) for x in places[name]] for name in ("side_mm", "height_mm", "raise_mm")}
    result = _native._study_platforms(_machine(robot, cell), given, listener(progress, "studying"))
    made = Made.of(result[0], study_platforms, robot=robot, cell=cell, **places, **said)
    return _study(result, "platforms", made)
