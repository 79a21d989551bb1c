"""TriCal for NumPy users: the library behind the `trical` command.

>>> import trical
>>> result = trical.identify(["touches.csv"], robot="robot.toml", cell="cell.toml")  # doctest: +SKIP
>>> result.errors["mean_mm"]  # doctest: +SKIP
0.011

SI throughout, rad and m; where something is in mm or degrees, its name says so. Balls, targets, joints and links count
from 1 in words and dicts, as in files; arrays have joint 1 in column 0.
"""

from __future__ import annotations

from ._calls import (
    compare,
    compensate,
    diagnose,
    effects,
    history,
    identify,
    observability,
    parameters,
    plan,
    poses,
    repeatability,
    simulate,
    validate,
)
from ._devices import Controller, Gauge, GaugeTest, gauges, master, virtual_cell
from ._files import Sample, convert, export, sample
from ._findings import Coefficient, Evidence, Finding, Place, Rival, Unexplained, Unseen
from ._fleet import Kind, kind
from ._measure import BaseFound, Measured, ToolPoint, find_base, find_tool_point, measure, touch_here
from ._native import (
    Cell,
    DeviceError,
    MeasuringError,
    Model,
    NotConvergedError,
    NotEnoughDataError,
    PlanningError,
    RecordingError,
    Robot,
    TricalError,
    UnreachableError,
    VirtualCell,
    WrongModelError,
    __version__,
)
from ._recording import Recording, concat
from ._results import Diagnosis, Identified, NextTouches, Observability, Plan, Study, Touches, Validation
from ._studies import study_platforms, study_touches

__all__ = [
    "BaseFound",
    "Cell",
    "Coefficient",
    "Controller",
    "DeviceError",
    "Diagnosis",
    "Evidence",
    "Finding",
    "Gauge",
    "GaugeTest",
    "Identified",
    "Kind",
    "Measured",
    "MeasuringError",
    "Model",
    "NextTouches",
    "NotConvergedError",
    "NotEnoughDataError",
    "Observability",
    "Place",
    "Plan",
    "PlanningError",
    "Recording",
    "RecordingError",
    "Rival",
    "Robot",
    "Sample",
    "Study",
    "ToolPoint",
    "Touches",
    "TricalError",
    "Unexplained",
    "UnreachableError",
    "Unseen",
    "Validation",
    "VirtualCell",
    "WrongModelError",
    "__version__",
    "compare",
    "compensate",
    "concat",
    "convert",
    "diagnose",
    "effects",
    "export",
    "find_base",
    "find_tool_point",
    "gauges",
    "history",
    "identify",
    "kind",
    "master",
    "measure",
    "observability",
    "parameters",
    "plan",
    "poses",
    "repeatability",
    "sample",
    "simulate",
    "study_platforms",
    "study_touches",
    "touch_here",
    "validate",
    "virtual_cell",
]
