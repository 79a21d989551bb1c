"""The long calls: what the commands of the same names do."""

from __future__ import annotations

import dataclasses
import json
import math
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from . import _native
from ._findings import Finding, Unexplained, Unseen
from ._given import path_of, whole, wholes
from ._native import Cell, Model, Robot, Rows, TricalError
from ._progress import Progress, listener
from ._recording import Frame, PathLike, Recording
from ._reports import Made
from ._results import Diagnosis, Identified, NextTouches, Observability, Plan, Validation

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

Recordings = PathLike | Recording | Frame | Sequence[PathLike | Recording | Frame]


def _sources(recordings: Recordings) -> list[str | Rows]:
    def is_one(r: Any) -> bool:
        return isinstance(r, str | bytes | os.PathLike | Recording) or hasattr(r, "columns")

    def one(r: Any) -> str | Rows:
        if not is_one(r):
            raise TypeError(f"recordings: found {type(r).__name__}, expected paths, Recordings or DataFrames")
        if hasattr(r, "columns"):
            r = Recording.from_frame(r)
        return r._rows if isinstance(r, Recording) else path_of(r)

    given: Any = recordings
    if isinstance(given, Mapping):
        raise TypeError(
            "recordings: found dict, expected paths, Recordings or DataFrames, as pandas.DataFrame(columns)"
        )
    return [one(r) for r in ([given] if is_one(given) or not hasattr(given, "__iter__") else given)]


def _part(name: str, part: Any, kind: type[Robot | Cell]) -> Any:
    if isinstance(part, kind):
        return part
    if not isinstance(part, str | bytes | os.PathLike):
        raise TypeError(f"{name}: found {type(part).__name__}, expected the path of a file, or a {kind.__name__}")
    return path_of(part)


def _robot(robot: PathLike | Robot) -> Any:
    return _part("robot", robot, Robot)


def _machine(robot: PathLike | Robot, cell: PathLike | Cell) -> tuple[Any, Any]:
    return _robot(robot), _part("cell", cell, Cell)


def _fields(result: type[Identified | Validation], answer: dict[str, Any]) -> dict[str, Any]:
    return {f.name: answer[f.name] for f in dataclasses.fields(result) if f.name in answer}


def _joints(compliant: Any) -> list[int]:
    if isinstance(compliant, str | bytes) or not hasattr(compliant, "__iter__"):
        raise TricalError(f"compliant is {compliant!r}, expected numbers of joints, as [2, 3]")
    return [whole("compliant", joint) for joint in compliant]


def _model(model: Model | PathLike) -> Model:
    if isinstance(model, Model):
        return model
    if not isinstance(model, str | bytes | os.PathLike):
        raise TypeError(f"model: found {type(model).__name__}, expected a Model or the path of a model file")
    return Model.load(path_of(model))


def _path_of_model(model: Model | PathLike) -> str | None:
    return None if isinstance(model, Model) else os.fsdecode(model)


def identify(
    recordings: Recordings,
    *,
    robot: PathLike | Robot,
    cell: PathLike | Cell,
    joints: str = "read",
    model: str = "complete",
    compliant: Sequence[int] = (),
    folds: int | None = None,
    hold_out_last: int | None = None,
    keep_outliers: bool = False,
    tool: str = "auto",
    stream: bool = False,
    known: PathLike | None = None,
    progress: Progress = False,
) -> Identified:
    """Identify an arm's parameters from recordings of it.

    Args:
        recordings: paths (CSV or MCAP), Recordings or DataFrames, one or several; each keeps its own measuring frame
            where it has one.
        robot: path of a robot.toml or URDF ("arm.urdf#base_link:tool0"), or a Robot.
        cell: path of a cell.toml, or a Cell.
        joints: which joint angles to use: "read", "commanded", or "auto", whichever the model explains better.
        model: "nominal" (measuring frame or base, and tool points only), "geometry" (rigid), "compliance" (the
            paper's 31) or "complete": as rich as robot and recordings allow; `cautions` says what was left out and why.
        compliant: joints (from 1) whose compliance is identified; all that carry gravity where empty.
        folds: also score every pose by a fit without it, in this many folds that divide no block of neighbouring poses.
        hold_out_last: also score this last percentage of each recording's poses by a fit to those before.
        keep_outliers: keep gross errors instead of rejecting them.
        tool: which recordings share a tool on the flange: "auto", those whose measurements do not say otherwise;
            "same", all; "own", none.
        stream: read files in passes, in memory that does not grow with their rows; the default above 32 MB of CSV or
            512 MB of MCAP.
        known: a TOML file of prior knowledge: tables `[[parameter]]` with name, value and sd (a prior), min and max, in
            the units of `parameters`.
        progress: True for a line on standard error, or a function that gets a fraction and a description. An exception
            from it, or Ctrl-C, ends the call.

    Raises:
        RecordingError, NotEnoughDataError, TricalError: bad input, in one sentence.
        NotConvergedError: the fit did not reach a minimum.
    """
    said: dict[str, Any] = {"joints": joints, "model": model, "compliant": compliant}
    said |= {"folds": folds, "hold_out_last": hold_out_last, "keep_outliers": keep_outliers}
    said |= {"tool": tool, "stream": stream, "known": known}
    given = {**wholes(said, "folds", "hold_out_last"), "compliant": _joints(compliant)}
    listening = listener(progress, "identifying")
    answer = _native._identify(_sources(recordings), _machine(robot, cell), given, listening)
    fitted, text, errors, covariance, outcome = answer
    s = json.loads(text)
    s["answer"] = dict(s)
    s["held_out"] = {how: errors for how, errors in s["held_out"].items() if errors is not None}
    s["not_identifiable"] = [(name, others) for name, *others in s["not_identifiable"]]
    s |= {"model": fitted, "covariance": covariance, "errors_mm": errors}
    return Identified(
        **_fields(Identified, s), _made=Made.of(outcome, identify, recordings, robot=robot, cell=cell, **said)
    )


def diagnose(
    recordings: Recordings,
    *,
    robot: PathLike | Robot,
    cell: PathLike | Cell,
    joints: str = "read",
    names_only: bool = False,
    tool: str = "auto",
    next: int | None = None,
    known: PathLike | None = None,
    progress: Progress = False,
) -> Diagnosis:
    """Say which physics the model of an arm lacks, by recordings of it.

    Takes seconds for hundreds of poses, and lets other threads run meanwhile. With `next`, this many touches are
    planned that decide between the least sure finding and its rivals (`Diagnosis.next`). With `names_only` curves of no
    known cause are reported but not modelled. `known` is a file of prior knowledge as for `identify`; where it is surer
    than the measurements, the search takes a parameter as known. The other arguments and errors are those of
    `identify`.
    """
    said = {"joints": joints, "names_only": names_only, "tool": tool, "next": next, "known": known}
    listening = listener(progress, "diagnosing")
    found = _native._diagnose(_sources(recordings), _machine(robot, cell), wholes(said, "next"), listening)
    model, text, errors, planned, outcome = found
    answer: dict[str, Any] = json.loads(text)
    nameless = [] if answer["unexplained"] is None else [answer["unexplained"], *answer["more_unexplained"]]
    deciding = None
    if planned is not None:
        touches, numbers = planned
        s = json.loads(numbers)
        deciding = NextTouches(*touches, s["effect"], s["site"], s["explanations"], s["lambda"], s["random_lambda"])
    return Diagnosis(
        model=model,
        findings=[Finding.of(f) for f in answer["findings"]],
        unexplained=[Unexplained.of(u) for u in nameless],
        blind_to=[Unseen.of(b) for b in answer["blind_to"]],
        answer=answer,
        errors_mm=errors,
        next=deciding,
        _made=Made.of(outcome, diagnose, recordings, robot=robot, cell=cell, **said),
    )


def validate(
    model: Model | PathLike,
    recordings: Recordings,
    *,
    robot: PathLike | Robot | None = None,
    cell: PathLike | Cell | None = None,
    joints: str | None = None,
    refit: str | Sequence[str] = (),
    progress: Progress = False,
) -> Validation:
    """Score a model, or that of a model file, on recordings of its arm.

    A recording that the model was fitted to is predicted with all that was identified of it, any other by what belongs
    to the arm. Where the model cannot know a recording's measuring frame or tool points, these are identified from
    every fourth of its poses. `robot` and `cell` are by default those inside the model; `joints` those that it was
    fitted to. With `refit` "frame" or "frame,targets" these are identified again from every fourth pose, for an
    instrument that was set up anew, and the other poses are scored. The other arguments and errors are those of
    `identify`; WrongModelError where model and recordings do not belong together.
    """
    what = refit.split(",") if isinstance(refit, str) else list(refit)
    given = {"joints": joints, "refit": [w for w in what if w]}
    loaded = _model(model)
    arm, place = (loaded.nominal_robot if robot is None else robot), (loaded.nominal_cell if cell is None else cell)
    listening = listener(progress, "validating")
    text, errors, outcome = _native._validate(loaded, _sources(recordings), _machine(arm, place), given, listening)
    s = json.loads(text)
    made = Made.of(outcome, validate, model, recordings, robot=robot, cell=cell, joints=joints, refit=refit)
    return Validation(**_fields(Validation, {**s, "errors_mm": errors}), _made=made)


def compare(model: Model | PathLike, recording: PathLike | Recording, *, joints: str | None = None) -> dict[str, Any]:
    """Say whether an arm has changed since its calibration, from 8 to 12 new touches (or any recording).

    `model` is an earlier calibration by `identify`, or its file, which knows how uncertain it is. Keys: verdict
    ("unchanged", "setup changed", "arm changed", "wrong touches", "nothing visible", "does not fit"; with "perhaps "
    before it where no change is as sure as one half), summary, changes (what, by how much, probability, rivals),
    visible (the smallest change that these poses would show nine times in ten), rejected, setup_of (whose tool and
    balls it is compared with), anew (what the model does not know), mean_mm, arm_mm (with the
    changes of tool and base), noise_mm, more_noise, each (all numbers beside the changes), temp_c, warmer (K), hash.
    WrongModelError where the model does not know its uncertainty, or was fitted to these measurements.
    """
    session: dict[str, Any] = history(model, [recording], joints=joints)["sessions"][0]
    return session


def history(
    model: Model | PathLike, recordings: Recordings, *, joints: str | None = None, need_mm: float | None = None
) -> dict[str, Any]:
    """Compare sessions with one calibration of the arm, a model or its file.

    They are taken in the order of the dates such as 2026-11-22 in the names of files; where some have none, as given.
    Keys: sessions (each as `compare` has it; those that the model was fitted to are left out), days (since the first,
    by those dates), trend (growth of the mean error), due (when the next calibration is due, in a sentence; `need_mm`
    is the mean error that the work allows).
    """
    result: dict[str, Any] = json.loads(_native._history(_model(model), _sources(recordings), joints, need_mm))
    return result


def repeatability(
    recording: PathLike | Recording,
    *,
    robot: PathLike | Robot | None = None,
    cell: PathLike | Cell | None = None,
    same: float | None = None,
) -> dict[str, Any]:
    """Say how far repeat visits scatter: keys places, by_ball, by_joint_sense, drift, rows, single_visits.

    Rows of one ball (or target) whose joints differ by less than `same` rad are visits of one place; where it is not
    given, by 1 deg, of measured points by 0.1 deg. `robot` and `cell` are needed for touches, unless the file has them
    inside, as those of `measure` have. RP = mean + 3 sd of the distances from a place's barycentre (formula of ISO
    9283).
    """
    rows = (recording if isinstance(recording, Recording) else Recording.load(recording, part=True))._rows
    if not isinstance(recording, Recording) and (robot is None or cell is None):
        inside = _native._inside(os.fspath(recording))
        robot, cell = (inside[0] if robot is None else robot, inside[1] if cell is None else cell)
    parts = (None if robot is None else _robot(robot), None if cell is None else _part("cell", cell, Cell))
    result: dict[str, Any] = json.loads(_native._repeatability(rows, *parts, same))
    return result


def plan(
    *,
    robot: PathLike | Robot,
    cell: PathLike | Cell,
    per_ball: int = 15,
    pool: int = 100,
    criterion: str = "d",
    sphere: Sequence[float] | None = None,
    max_tilt: float = math.pi / 2,
    noise: float = 1e-5,
    start: npt.ArrayLike | None = None,
    seed: int = 1,
    progress: Progress = False,
) -> Plan:
    """Plan collision-free, informative touches of the cell's balls.

    Args:
        robot: path of a robot.toml or URDF, or a Robot.
        cell: path of a cell.toml, or a Cell.
        per_ball: touches a ball.
        pool: candidates a ball, from which the informative ones are chosen.
        criterion: what the touches are optimized for: "d" all parameters together, "a" the sum of their variances, "e"
            the least certain direction, "sphere" or "workspace" the position error there.
        sphere: where the arm is to be accurate, (4,): centre in the world and radius, m; by default 0.2 m about a
            point 0.1 m above the balls.
        max_tilt: largest angle between the device's z axis and straight down, rad.
        noise: standard deviation of each of a touch's three readings, m, for the expected errors.
        start: (joints,) where the arm stands before the first touch, rad (m); where not given zero, or
            the middle between limits that leave zero out.
        seed: the same seed gives the same plan.
        progress: as for `identify`.

    Raises:
        PlanningError: there is no such plan.
    """
    said = {"per_ball": per_ball, "pool": pool, "criterion": criterion, "sphere": sphere, "max_tilt": max_tilt}
    said |= {"noise": noise, "start": start, "seed": seed}
    given = {**wholes(said, "per_ball", "pool", "seed"), "sphere": _sphere(sphere)}
    touches, text, outcome = _native._plan(_machine(robot, cell), given, listener(progress, "planning"))
    s = json.loads(text)
    made = Made.of(outcome, plan, robot=robot, cell=cell, **said)
    return Plan(*touches, s["parameters"], s["expected"], s, _made=made)


def _sphere(sphere: Sequence[float] | None) -> tuple[float, float, float, float] | None:
    if sphere is None:
        return None
    numbers = [float(x) for x in sphere]
    if len(numbers) != 4:
        raise TricalError(f"sphere has {len(numbers)} numbers, expected 4: x, y, z and radius, m")
    return (numbers[0], numbers[1], numbers[2], numbers[3])


def poses(
    n: int,
    *,
    robot: PathLike | Robot,
    cell: PathLike | Cell,
    sphere: Sequence[float] | None = None,
    facing: Sequence[float] | None = None,
    facing_axis: Sequence[float] = (0.0, 0.0, 1.0),
    facing_within: float = math.radians(30.0),
    seed: int = 1,
) -> npt.NDArray[np.float64]:
    """Draw n poses free of collisions, (n, joints) rad (m): in a sphere (x, y, z, radius; m), or in the whole
    workspace.

    In no particular order; ways between them are not checked. The same seed gives the same poses. `facing` (3,) m is
    where a tracker stands in the world: then the direction `facing_axis` (3,) of the tool, in its own axes, which
    carries the reflector, is turned away from it by `facing_within` rad at most.
    """
    given = {
        "sphere": _sphere(sphere),
        "facing": None if facing is None else _three(facing, "facing"),
        "facing_axis": _three(facing_axis, "facing_axis"),
        "facing_within": facing_within,
        "seed": whole("seed", seed),
    }
    return _native._poses(whole("n", n), _machine(robot, cell), given)


def _three(numbers: Sequence[float], name: str) -> tuple[float, float, float]:
    if len(numbers) != 3:
        raise TricalError(f"{name} has {len(numbers)} numbers, expected 3: x, y and z")
    return (float(numbers[0]), float(numbers[1]), float(numbers[2]))


def simulate(
    model: Model,
    q: npt.ArrayLike,
    *,
    ball: npt.ArrayLike | None = None,
    target: npt.ArrayLike | None = None,
    anchor: npt.ArrayLike | None = None,
    full_pose: bool = False,
    noise: float = 1e-5,
    angle_noise: float = 1e-5,
    seed: int = 0,
    stop_within: float | None = 2e-5,
    directions: npt.ArrayLike | None = None,
    temperature: npt.ArrayLike | None = None,
    time: npt.ArrayLike | None = None,
    payload: npt.ArrayLike | None = None,
) -> Recording:
    """Simulate a recording of an arm that behaves as `model`.

    Args:
        model: the true arm, with all of its terms.
        q: joint values, (n, joints), rad (m).
        ball: touches: which ball, a number for all or (n,), from 1. The arm is first moved, as the measuring procedure
            does it, until the TCP is within `stop_within` of the ball's centre along each axis, and its joints there
            are recorded; with `stop_within=None` it stays at q, and the indicators read whatever they would.
        target: tracker points: which target of the tool, from 1; in the model's first measuring frame, or in the
            world where it has none.
        anchor: lengths from an anchor to the TCP: which one, from 1.
        full_pose: full poses of the tool, in the same frame as targets.
        noise: standard deviation of every length that is measured, m.
        angle_noise: standard deviation of a measured orientation about each axis, rad.
        seed: the same seed gives the same recording.
        stop_within: m; see `ball`.
        directions: as for `Model.forward`; so are the rest. A term whose input is not given is an error here.

    Exactly one of `ball`, `target`, `anchor` and `full_pose` says what is measured.
    """
    numbers = {"ball": ball, "target": target, "anchor": anchor}
    kinds = [k for k, v in numbers.items() if v is not None] + (["pose"] if full_pose else [])
    if len(kinds) != 1:
        found = " and ".join(kinds) or "none"
        raise TricalError(f"simulate was given {found} of ball, target, anchor and full_pose, expected one of them")
    (kind,) = kinds
    given: dict[str, Any] = {"noise": noise, "angle_noise": angle_noise, "seed": seed, "stop_within": stop_within}
    given |= {"directions": directions, "temperature": temperature, "time": time, "payload": payload}
    return Recording._of(_native._simulate(model, q, kind, numbers.get(kind), wholes(given, "seed")))


def observability(
    recordings: Recordings,
    *,
    robot: PathLike | Robot,
    cell: PathLike | Cell,
    joints: str = "read",
    model: str = "complete",
    noise: float | None = None,
) -> Observability:
    """Say how well measurements determine a set of parameters, whatever their values.

    `recordings` as for `identify`; only the poses and the kind of measurement count, so a Recording of planned touches
    with `indicators=[0, 0, 0]` is enough. `noise` (m) scales the standard deviations of the parameters; 0.01 mm where
    not given.
    """
    text = _native._observability(_sources(recordings), _machine(robot, cell), joints, model, noise)
    s = json.loads(text)
    # what is not finite is null in JSON: a condition without bound
    indices = {k: math.inf if s[k] is None else s[k] for k in ("o1", "o2", "o3", "o4", "o5", "condition")}
    return Observability(
        **indices,
        rows=s["rows"],
        parameters=s["parameters"],
        not_identifiable=[(name, others) for name, others in s["not_identifiable"]],
    )


def effects() -> list[dict[str, str]]:
    """Return the catalogue of effects: dicts with name, site, form, needs, typical, rivals."""
    result: list[dict[str, str]] = json.loads(_native._effects_json())
    return result


def parameters(model: Model | PathLike) -> list[dict[str, Any]]:
    """Return the terms of a model, or of that of a model file: dicts with name, site, value, unit, sd, nominal."""
    result: list[dict[str, Any]] = json.loads(_model(model)._terms_json())
    return result


def compensate(
    program: PathLike,
    model: Model | PathLike,
    out: PathLike | None = None,
    *,
    robot: PathLike | Robot,
    cell: PathLike | Cell,
    dialect: str | None = None,
    frames: PathLike | Sequence[PathLike] = (),
    partial: bool = False,
    tool: str | None = None,
    frame: str | None = None,
    temp_c: float | None = None,
    time_s: float | None = None,
    seq: float | None = None,
    session: str | int | None = None,
    payload_kg: float | None = None,
    any_configuration: bool = False,
    own_base: bool = False,
) -> dict[str, Any]:
    """Rewrite a robot program so that the arm of `model` goes where the program says, as `trical compensate` does.

    `model` is a Model or the path of a model file. The file `out` is written completely or not at all. Without it
    nothing is written, and the answer has `rows`: each target with its error before and after. `time_s` or `seq` is a
    moment of a session of the model: `session`, by its recording or its number from 1, or else the first in which
    something happened. Keys: targets,
    largest_move_mm, problems (what is not rewritten: line and reason), before, after, meant_with, relative (motions
    relative to rewritten targets, and how far they are off); where there are any, cautions, read_with and written
    (files of the program beside the one that was named).
    """
    given: dict[str, Any] = {"model": _path_of_model(model), "out": out, "dialect": dialect, "partial": partial}
    given["frames"] = [os.fspath(f) for f in ([frames] if isinstance(frames, str | os.PathLike) else frames)]
    given |= {"tool": tool, "frame": frame, "temp_c": temp_c, "time_s": time_s, "seq": seq, "payload_kg": payload_kg}
    given |= {"any_configuration": any_configuration, "own_base": own_base}
    given["session"] = None if session is None else str(session)
    text = _native._compensate(path_of(program), _model(model), _machine(robot, cell), given)
    result: dict[str, Any] = json.loads(text)
    return result
