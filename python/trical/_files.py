"""Files from and for other programs: what `convert` and `export` do."""

from __future__ import annotations

import json
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import _native
from ._calls import _model, _path_of_model, _robot
from ._given import whole
from ._native import Model, Robot, TricalError
from ._recording import PathLike


@dataclass(frozen=True)
class Sample:
    """Files to try the library on: paths of robot, cell and recording."""

    robot: Path
    cell: Path
    recording: Path


def sample(folder: PathLike | None = None) -> Sample:
    """Write a robot, a cell and a recording of 90 touches to try the library on: what `trical sample` writes.

    The arm differs from its description as real arms do, and has one more flaw, which `diagnose` finds.

    Args:
        folder: where to, made if it is not there; by default a new temporary folder, which stays until you remove it.

    Raises:
        FileExistsError: one of the files is there already.
    """
    into = Path(tempfile.mkdtemp(prefix="trical-sample-") if folder is None else folder)
    into.mkdir(parents=True, exist_ok=True)
    for name, text in _native._sample():
        with open(into / name, "x", encoding="utf-8", newline="") as file:
            file.write(text)
    return Sample(into / "robot.toml", into / "cell.toml", into / "touches.csv")


def convert(source: PathLike, out: PathLike, *, joints: int | None = None) -> dict[str, Any]:
    """Write a recording as .csv or .mcap, or the arm of a URDF as .toml, by the ending of `out`.

    Of a damaged MCAP the complete measurements are saved. The file is written completely or not at all. `joints` is the
    number of the arm's joints, by default as many as the file has.

    Returns:
        Of a recording rows, joints, out, and lost: None, or one sentence on what was damaged. Of an arm
        ("arm.urdf#base_link:tool0") joints (their names), root, tip, out.

    Raises:
        RecordingError, TricalError: a file that cannot be read, or written.
    """
    said: dict[str, Any] = json.loads(_native._convert(os.fspath(source), os.fspath(out), whole("joints", joints)))
    return said


def export(
    model: Model | PathLike,
    *,
    robot: PathLike | Robot | None = None,
    urdf: PathLike | None = None,
    mdh: PathLike | None = None,
    error_map: PathLike | None = None,
    ur_kinematics: PathLike | None = None,
    poses: int = 2000,
) -> dict[str, Any]:
    """Write a calibrated arm for other programs.

    Args:
        model: a Model, or the path of a model file.
        robot: refuse a model that is not of this arm (WrongModelError): path of a robot.toml or URDF, or a Robot.
        urdf: where to write the arm as a URDF: if `robot` is the path of a URDF, the same file with corrected joint
            origins; else a new one of base, links and tool.
        mdh: where to write the table of modified Denavit-Hartenberg parameters: .toml (a robot file), .json or .csv.
        error_map: where to write how far the arm misses all over its workspace, a CSV.
        ur_kinematics: where to write the kinematics of an arm of Universal Robots for its ROS driver
            (robot_calibration.yaml).
        poses: of the map.

    Returns:
        robot, written, left_out (terms that a table cannot hold), left_out_rms_mm and left_out_max_mm (how far they
        move the TCP at 1000 random poses), same_frames (whether the table compares with the nominal one line by
        line), cautions (what the files have no place for: the tool that was identified), flange_from_tcp, and error_map
        (a summary, or None).
    """
    files = {"urdf": urdf, "mdh": mdh, "error_map": error_map, "ur_kinematics": ur_kinematics}
    if not any(files.values()):
        raise TricalError("export was given nothing to write, expected urdf, mdh, error_map or ur_kinematics")
    given = {**files, "robot": None if robot is None else _robot(robot), "poses": whole("poses", poses)}
    said: dict[str, Any] = json.loads(_native._export(_model(model), _path_of_model(model), given))
    return said
