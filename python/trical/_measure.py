"""Measuring: what `trical measure` does, and the touches by which a cell is set up."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from . import _html, _native
from ._calls import _machine
from ._native import Cell, Robot, TricalError
from ._progress import Progress, listener
from ._recording import PathLike, Recording
from ._results import Touches

if TYPE_CHECKING:  # whoever imports trical need not wait for NumPy
    import numpy as np
    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class Measured:
    """What a run did, and the recording that it made.

    `path` is the file. `measured` counts the touches of this run, `skipped` those that it had found done, `corrections`
    the corrections of all. `warnings` are sentences; `steps`, without `go`, what would have been done: nothing moved
    then.
    """

    path: str
    measured: int
    skipped: int
    corrections: int
    warnings: list[str]
    steps: list[str]

    @property
    def recording(self) -> Recording:
        """The recording, read from its file. Raises TricalError where nothing was measured."""
        if self.steps:
            raise TricalError("nothing was measured: measure(..., go=True) moves the arm")
        return Recording.load(self.path)

    def __repr__(self) -> str:
        """Touches and corrections, or the steps that were not taken."""
        if self.steps:
            head = f"<trical.Measured: nothing has moved; {len(self.steps)} steps would be taken with go=True>"
            lines = [*self.steps[:12], *([f"... {len(self.steps) - 12} more"] if len(self.steps) > 12 else [])]
        else:
            before = f" ({self.skipped} had been done before)" if self.skipped else ""
            head = f"<trical.Measured: {self.measured} touches{before}, {self.corrections} corrections; {self.path}>"
            lines = []
        return "\n".join([head, *lines, *(f"note: {w}" for w in self.warnings)])

    def _repr_html_(self) -> str:
        rows: list[Sequence[object]] = [
            ("touches measured", self.measured),
            ("done before", self.skipped),
            ("corrections", self.corrections),
        ]
        moved = "nothing has moved: these steps would be taken with go=True" if self.steps else self.path
        table = _html.table(("", "n"), rows, moved)
        return table + "".join(map(_html.note, [*self.steps, *self.warnings]))


def _output(out: PathLike) -> str:
    """Refuse a recording that is no .mcap or in a folder that does not exist, before anything is asked of a device."""
    if not os.fspath(out).endswith(".mcap"):
        raise TricalError(f"out is {os.fspath(out)}, expected a name that ends in .mcap")
    folder = os.path.dirname(os.fspath(out)) or "."
    if not os.path.isdir(folder):
        raise TricalError(f"{os.fspath(out)}: the folder {folder} does not exist")
    return os.fspath(out)


def _settings(given: dict[str, Any]) -> dict[str, Any]:
    stroke = given["stroke"]
    if len(stroke) != 2:
        raise TricalError(f"stroke has {len(stroke)} numbers, expected 2: the lower and the upper, m")
    for name in ("visits", "max_corrections"):
        if given[name] < 0:
            raise TricalError(f"{name} is {given[name]}, expected 0 or more")
    return {**given, "stroke": [float(x) for x in stroke]}


def measure(
    plan: Touches | PathLike,
    out: PathLike,
    *,
    robot: PathLike | Robot,
    cell: PathLike | Cell,
    gauge: str,
    controller: str,
    go: bool = False,
    resume: bool = False,
    visits: int = 1,
    epsilon: float = 2e-5,
    repeatability: float = 1e-5,
    travel_speed: float = 0.1,
    touch_speed: float = 0.01,
    max_correction: float = 4.9e-3,
    max_correction_sum: float = 8e-3,
    max_corrections: int = 10,
    stroke: Sequence[float] = (-5.9e-3, 5.9e-3),
    temperature: float | None = None,
    payload: float | None = None,
    progress: Progress = False,
) -> Measured:
    """Drive robot and gauge through a plan, and record: the automated procedure. Nothing moves without `go=True`.

    Every accepted touch is on disk before the arm moves on. Ctrl-C, and an exception from `progress`, end the run:
    Ctrl-C stops the motion under way through the controller, and the arm stays there; between motions it goes back the
    way it came. The recording is finished, and only then the exception is raised; its cause says where the arm is.
    `resume=True` continues a recording that was interrupted.

    Args:
        plan: a Plan or other Touches, or the path of a plan.csv.
        out: where to record, an MCAP; it must not be there yet, unless `resume`.
        robot: path of a robot.toml or URDF, or a Robot.
        cell: path of a cell.toml, or a Cell.
        gauge: URL of the gauge, see `Gauge`; of a virtual cell, `VirtualCell.gauge`.
        controller: URL of the controller, see `Controller`; of a virtual cell, `VirtualCell.controller`.
        go: move the arm; without it the steps are listed.
        resume: continue `out`.
        visits: of every touch, every other round in reverse order and from beyond; for `repeatability`.
        epsilon: a touch is accepted when its reading is shorter than this, m; the reading that is left is recorded.
        repeatability: of the arm, m; an `epsilon` below it is warned about.
        travel_speed: of the tool between the balls, m/s.
        touch_speed: of the tool at a ball, m/s.
        max_correction: longest single correction, m.
        max_correction_sum: longest sum of a touch's corrections, m.
        max_corrections: most corrections of a touch.
        stroke: (2,) readings between which a stem touches its ball, m.
        temperature: degC, recorded with each touch where the controller has no sensor.
        payload: mass added on the flange, kg, recorded with each touch.
        progress: as for `identify`: how much of the plan is done, and which touch, with the reading of each iteration.

    Raises:
        TricalError, RecordingError: bad input, before anything moves.
        DeviceError: gauge or controller cannot be used; nothing has moved.
        MeasuringError: the run ended before its plan; what was measured is in `out`.
    """
    given = {
        "out": _output(out),
        "gauge": gauge,
        "controller": controller,
        "go": go,
        "resume": resume,
        "visits": visits,
        "epsilon": epsilon,
        "repeatability": repeatability,
        "travel_speed": travel_speed,
        "touch_speed": touch_speed,
        "max_correction": max_correction,
        "max_correction_sum": max_correction_sum,
        "max_corrections": max_corrections,
        "stroke": stroke,
        "temperature": temperature,
        "payload": payload,
    }
    text = plan.text if isinstance(plan, Touches) else None
    path = None if isinstance(plan, Touches) else os.fspath(plan)
    listening = listener(progress, "measuring")
    done = _native._measure({"text": text, "path": path}, _machine(robot, cell), _settings(given), listening)
    return Measured(os.fspath(out), *done)


def touch_here(
    ball: int,
    out: PathLike,
    *,
    robot: PathLike | Robot,
    cell: PathLike | Cell,
    gauge: str,
    controller: str,
    go: bool = False,
    epsilon: float = 2e-5,
    touch_speed: float = 0.01,
    max_correction: float = 4.9e-3,
    max_correction_sum: float = 8e-3,
    max_corrections: int = 10,
    stroke: Sequence[float] = (-5.9e-3, 5.9e-3),
    progress: Progress = False,
) -> Recording:
    """Touch a ball where a person has brought the arm, all three stems on the ball; the arm goes back there afterwards.

    The touch is corrected and recorded as `measure` does it, behind what `out` (an MCAP) has already, and returned.
    Four touches of one ball in different orientations are what `find_tool_point` needs, one of each of balls 1, 2 and 3
    what `find_base` needs. The arm moves by the corrections, a few mm: so `go=True` is required.

    `ball` counts from 1; the other arguments and errors are those of `measure`.
    """
    if not go:
        raise TricalError("touch_here moves the arm by a few mm to null the indicators: go=True is required")
    if ball < 1:
        raise TricalError(f"ball is {ball}, expected a number counted from 1")
    given = {
        "out": _output(out),
        "gauge": gauge,
        "controller": controller,
        "go": go,
        "resume": os.path.exists(out),
        "visits": 1,
        "epsilon": epsilon,
        "repeatability": min(epsilon, 1e-5),
        "travel_speed": touch_speed,
        "touch_speed": touch_speed,
        "max_correction": max_correction,
        "max_correction_sum": max_correction_sum,
        "max_corrections": max_corrections,
        "stroke": stroke,
        "temperature": None,
        "payload": None,
    }
    listening = listener(progress, "touching")
    return Recording._of(_native._touch_here(ball - 1, _machine(robot, cell), _settings(given), listening))


@dataclass(frozen=True)
class ToolPoint:
    """The tool point by touches of one ball.

    `cell` has it; `tcp` (3,) m is where it lies in the flange's frame, `before` (3,) m where the cell had it; `rms` m
    is how well the touches agree: the error of the arm before calibration.
    """

    cell: Cell
    tcp: Floats
    before: Floats
    rms: float


def find_tool_point(touches: PathLike | Recording, *, robot: PathLike | Robot, cell: PathLike | Cell) -> ToolPoint:
    """Find the tool point by four or more touches of one ball, in orientations that differ by 20 degrees or more.

    By the nominal arm. `touches` as `touch_here` records them. Raises TricalError if they do not determine it.
    """
    known = cell if isinstance(cell, Cell) else Cell.load(cell)
    found, rms = _native._tool_point(_touches(touches)._rows, _machine(robot, known))
    return ToolPoint(found, found.tcp, known.tcp, rms)


@dataclass(frozen=True)
class BaseFound:
    """Where an arm stands, by touches of balls 1, 2 and 3.

    `cell` has it; `distances` are dicts with balls (two numbers), touched and cell: how far they are apart by the
    touches and by the cell, m.
    """

    cell: Cell
    distances: list[dict[str, Any]]


def find_base(touches: PathLike | Recording, *, robot: PathLike | Robot, cell: PathLike | Cell) -> BaseFound:
    """Find where the arm stands in the world by a touch of each of balls 1, 2 and 3; the last of each counts.

    By the nominal arm. `touches` as `touch_here` records them. Raises TricalError where a ball was not touched, or if
    the distances of the balls differ by more than an arm can be wrong.
    """
    found, apart = _native._base(_touches(touches)._rows, _machine(robot, cell))
    return BaseFound(found, [{"balls": (a, b), "touched": x, "cell": y} for a, b, x, y in apart])


def _touches(touches: PathLike | Recording) -> Recording:
    return touches if isinstance(touches, Recording) else Recording.load(touches)
