import os
from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np
import numpy.typing as npt

__version__: str
__all__ = [
    "Cell",
    "ControllerLink",
    "DeviceError",
    "GaugeLink",
    "MeasuringError",
    "Model",
    "NotConvergedError",
    "NotEnoughDataError",
    "Outcome",
    "PlanningError",
    "RecordingError",
    "Robot",
    "Rows",
    "TricalError",
    "UnreachableError",
    "VirtualCell",
    "WrongModelError",
    "__version__",
    "_base",
    "_compensate",
    "_convert",
    "_diagnose",
    "_effects_json",
    "_export",
    "_history",
    "_identify",
    "_inside",
    "_master",
    "_measure",
    "_named",
    "_observability",
    "_plan",
    "_ports",
    "_poses",
    "_program",
    "_repeatability",
    "_sample",
    "_simulate",
    "_study_platforms",
    "_study_touches",
    "_tool_point",
    "_touch_here",
    "_validate",
    "_virtual_cell",
]

_Path = str | bytes | os.PathLike[Any]
_Floats = npt.NDArray[np.float64]
# keywords of a public function
_Keywords = dict[str, Any]
_Listener = Callable[[float, str], object] | None
_Touches = tuple[npt.NDArray[np.int64], _Floats, _Floats, list[_Floats], npt.NDArray[np.int8], str]

_Machine = tuple[_Path | Robot, _Path | Cell]
_Study = tuple[Outcome, list[list[str]], str, str, str, list[str], str]

class TricalError(ValueError): ...
class RecordingError(TricalError): ...
class NotEnoughDataError(TricalError): ...
class WrongModelError(TricalError): ...
class PlanningError(TricalError): ...
class UnreachableError(TricalError): ...
class DeviceError(RuntimeError): ...
class MeasuringError(RuntimeError): ...
class NotConvergedError(RuntimeError): ...

@final
class Robot:
    """A nominal arm: modified Denavit-Hartenberg parameters, limits, masses."""

    @staticmethod
    def load(path: _Path) -> Robot:
        """Read a robot.toml, or a URDF as in "arm.urdf#base_link:tool0"."""
    @staticmethod
    def from_toml(text: str) -> Robot:
        """Read the text of a robot.toml."""
    def to_toml(self) -> str:
        """Return the text of a robot.toml."""
    def save(self, path: _Path) -> None:
        """Write a robot.toml."""
    @property
    def name(self) -> str:
        """Its name."""
    @property
    def dof(self) -> int:
        """Number of joints."""
    @property
    def limits(self) -> _Floats:
        """Lower and upper limits of the joints, (joints, 2), rad (m for prismatic joints)."""
    @property
    def kinds(self) -> list[str]:
        """Kind of each joint: "revolute" or "prismatic"."""
    def __reduce__(self) -> tuple[Any, tuple[str]]: ...

@final
class Cell:
    """Where an arm stands, what it carries, and what it can touch."""

    @staticmethod
    def load(path: _Path) -> Cell:
        """Read a cell.toml."""
    @staticmethod
    def from_toml(text: str) -> Cell:
        """Read the text of a cell.toml."""
    def to_toml(self) -> str:
        """Return the text of a cell.toml."""
    def save(self, path: _Path) -> None:
        """Write a cell.toml."""
    @property
    def balls(self) -> _Floats:
        """Centres of the balls in the world, (balls, 3), m."""
    @property
    def tcp(self) -> _Floats:
        """Tool point (TCP) in the flange's frame, (3,), m."""
    @property
    def base(self) -> tuple[_Floats, _Floats]:
        """Where the arm stands in the world: position (3,) m and rotation (3, 3)."""
    @property
    def targets(self) -> _Floats:
        """Targets on the tool in the flange's frame, (targets, 3), m."""
    def __reduce__(self) -> tuple[Any, tuple[str]]: ...

@final
class Model:
    """A model ready to predict where the tool is.

    Joint values `q` are arrays or lists (n, joints) or, for one pose, (joints,), in rad (m for prismatic joints);
    everything else is in m, rad, N m too. What comes back has no first axis for one pose.
    """

    @staticmethod
    def nominal(robot: _Path | Robot, cell: _Path | Cell | None = None) -> Model:
        """Nominal arm of a robot.toml, or of a URDF as in "arm.urdf#base_link:tool0", in the cell of a cell.toml.

        Without a cell, the arm's foot is the world and its flange is the tool.
        """
    @staticmethod
    def load(path: _Path) -> Model:
        """Read a model file (calibrated.toml, improved.toml)."""
    @staticmethod
    def from_toml(text: str) -> Model:
        """Read the text of a model file."""
    def save(self, path: _Path) -> None:
        """Write a model file."""
    def to_toml(self) -> str:
        """Return the text of the model file."""
    def with_terms(self, text: str) -> Model:
        """Add terms, given as the [[term]] tables of a model file: an arm with hidden flaws, to simulate."""
    @property
    def robot(self) -> str:
        """Name of the arm."""
    @property
    def nominal_robot(self) -> Robot:
        """The nominal arm."""
    @property
    def nominal_cell(self) -> Cell:
        """The nominal cell."""
    @property
    def dof(self) -> int:
        """Number of joints."""
    @property
    def limits(self) -> _Floats:
        """Lower and upper limits of the joints, (joints, 2), rad (m for prismatic joints)."""
    @property
    def kinds(self) -> list[str]:
        """Kind of each joint: "revolute" or "prismatic"."""
    @property
    def joints(self) -> str:
        """Which joint angles the model was fitted to: "read" or "commanded"."""
    def robot_toml(self) -> str:
        """Text of a robot.toml: the nominal arm."""
    def rigid(self) -> Model:
        """Build the constant terms into arm and cell, and leave the others (compliance ...) out."""
    def not_rigid(self) -> list[str]:
        """Names of the terms that `rigid` and `to_urdf` leave out."""
    def to_urdf(self) -> str:
        """Text of a URDF: the rigid part, links world, base_link, link_1 ... link_n, flange, tcp."""
    def save_urdf(self, path: _Path) -> None:
        """Write the rigid part as a URDF."""
    def forward(
        self,
        q: npt.ArrayLike,
        *,
        directions: npt.ArrayLike | None = None,
        temperature: npt.ArrayLike | None = None,
        time: npt.ArrayLike | None = None,
        seq: npt.ArrayLike | None = None,
        payload: npt.ArrayLike | None = None,
    ) -> tuple[_Floats, _Floats]:
        """Where the tool is, in the world: positions (n, 3) m and rotations (n, 3, 3).

        What terms of the model look at, one value for all poses or one a pose: directions (n, joints) or (joints,),
        -1, 0 or 1, sense of each joint's last motion; temperature (n,) degC; time (n,) s since the recording began; seq
        (n,) number of the pose, for models of recordings without times; payload (n,) kg on the flange beyond the cell's
        tool. Not given means no sense of motion, the reference temperature, time and number 0, no payload.
        """
    def error_map(self, n: int = 2000) -> tuple[_Floats, _Floats, _Floats]:
        """How far the arm misses all over its workspace: n poses at random within the limits, the same ones each time.

        Joints (n, joints) rad (m); where the nominal arm's TCP is there, (n, 3) m; from there to where this model's is,
        (n, 3) m, in the axes of the arm's base. What only places the arm in the cell does not count; nor do time,
        temperature and sense of motion.
        """
    def flange(
        self,
        q: npt.ArrayLike,
        *,
        directions: npt.ArrayLike | None = None,
        temperature: npt.ArrayLike | None = None,
        time: npt.ArrayLike | None = None,
        seq: npt.ArrayLike | None = None,
        payload: npt.ArrayLike | None = None,
    ) -> tuple[_Floats, _Floats]:
        """Where the flange is, in the world: positions (n, 3) m and rotations (n, 3, 3). Arguments as for `forward`."""
    def jacobian(self, q: npt.ArrayLike) -> _Floats:
        """Jacobians (n, 6, joints), world axes: velocity of the TCP (m), then angular velocity (rad), per rad (m)."""
    def gravity_torques(self, q: npt.ArrayLike, *, payload: npt.ArrayLike | None = None) -> _Floats:
        """What gravity does at each joint, (n, joints), in N m about its axis (N along a prismatic one).

        The tool's mass is counted and, with payload (n,) kg, that on the flange; compliance is not.
        """
    def inverse(
        self,
        positions: npt.ArrayLike,
        rotations: npt.ArrayLike,
        near: npt.ArrayLike,
        *,
        directions: npt.ArrayLike | None = None,
        temperature: npt.ArrayLike | None = None,
        time: npt.ArrayLike | None = None,
        seq: npt.ArrayLike | None = None,
        payload: npt.ArrayLike | None = None,
    ) -> _Floats:
        """Joint values (n, joints) at which the tool, by the whole model, has poses in the world: those nearest to
        `near`.

        positions (n, 3) m; rotations (n, 3, 3); near (n, joints) or (joints,), rad (m). Without the n: one pose. The
        other arguments are those of `forward`. Raises UnreachableError for the first pose that the arm cannot take.
        """
    def _terms_json(self) -> str: ...
    def __reduce__(self) -> tuple[Any, tuple[str]]: ...

@final
class Rows:
    """The rows of a recording; `trical.Recording` shows them."""

    @staticmethod
    def load(path: _Path, joints: int | None, part: bool) -> Rows: ...
    @staticmethod
    def table(name: str, columns: list[tuple[str, npt.NDArray[np.float64] | list[str]]]) -> Rows: ...
    @staticmethod
    def build(name: str, columns: dict[str, Any]) -> Rows: ...
    @property
    def name(self) -> str: ...
    @property
    def joints(self) -> int: ...
    def __len__(self) -> int: ...
    def take(self, rows: Sequence[int]) -> Rows: ...
    def column(self, name: str) -> Any: ...
    def to_csv(self) -> bytes: ...
    def save(self, path: _Path) -> None: ...

@final
class Outcome:
    """What a report is made of."""

    def finding(self, number: int) -> tuple[str, str, _Floats, _Floats, _Floats]:
        """Return a finding (from 0) against what reveals it: labels of x and errors, x, errors without and with it."""

    def slides(self) -> list[bool]:
        """Which of these joints slide, (joints,)."""
    def joint_values(self) -> _Floats:
        """Return the joints at each observation that was fitted, (n, joints), rad (m for a joint that slides)."""

    def write(self, path: _Path, call: str, inputs: Sequence[str]) -> None:
        """Write the report: one HTML file, whole or not at all, made by `call` from `inputs`."""

    def certify(self, path: _Path, call: str, inputs: Sequence[str]) -> None:
        """Write the certificate of a calibration or a validation, made by `call` from `inputs`."""

@final
class GaugeLink:
    """A gauge; `trical.Gauge` shows it."""

    @staticmethod
    def open(url: str) -> GaugeLink: ...
    @property
    def name(self) -> str: ...
    @property
    def closed(self) -> bool: ...
    def close(self) -> None: ...
    def read(self, settled: bool) -> _Floats: ...
    def says(self) -> list[str]: ...
    def warnings(self) -> list[str]: ...
    def trial(self, count: int) -> tuple[list[str], _Floats, float, list[tuple[float, float, float, float | None]]]: ...
    def stem(self, axis: int, wait: float) -> float: ...

@final
class ControllerLink:
    """A robot controller; `trical.Controller` shows it."""

    @staticmethod
    def open(url: str) -> ControllerLink: ...
    @property
    def name(self) -> str: ...
    @property
    def dof(self) -> int: ...
    @property
    def closed(self) -> bool: ...
    def close(self) -> None: ...
    def ping(self) -> tuple[float, float, float | None]: ...
    def joints(self) -> _Floats: ...
    def jog(self, given: _Keywords) -> tuple[_Floats, _Floats]: ...

@final
class VirtualCell:
    """A robot, balls and indicators that answer on a pseudo-terminal and a TCP port of this computer, until `stop`.

    `trical.virtual_cell` starts one. In a `with` block it is stopped at the end. Everything that reaches it goes
    through the real drivers: `measure`, `Gauge` and `Controller` take its URLs.
    """

    @property
    def gauge(self) -> str:
        """URL of its gauge, for `measure` and `Gauge`."""
    @property
    def controller(self) -> str:
        """URL of its controller, for `measure` and `Controller`."""
    @property
    def truth(self) -> Model:
        """The true arm: what identification should find and must not know."""
    @property
    def running(self) -> bool:
        """Whether it answers."""
    @property
    def motions(self) -> int:
        """Number of motions so far."""
    @property
    def q(self) -> _Floats:
        """Joints at which the arm stands, as its controller reports them: (joints,), rad (m)."""
    @property
    def tool(self) -> tuple[_Floats, _Floats]:
        """Where the tool truly is in the world: position (3,) m, rotation (3, 3); what a perfect tracker would see."""
    def stop(self) -> None:
        """End it; its addresses answer no more. Nothing happens where it was stopped already."""
    def __enter__(self) -> VirtualCell: ...
    def __exit__(self, _kind: object, _value: object, _trace: object) -> None: ...

def _identify(
    recordings: Sequence[_Path | Rows], machine: _Machine, given: _Keywords, progress: _Listener
) -> tuple[Model, str, _Floats | None, _Floats, Outcome]: ...
def _diagnose(
    recordings: Sequence[_Path | Rows], machine: _Machine, given: _Keywords, progress: _Listener
) -> tuple[Model, str, _Floats, tuple[_Touches, str] | None, Outcome]: ...
def _validate(
    model: Model, recordings: Sequence[_Path | Rows], machine: _Machine, given: _Keywords, progress: _Listener
) -> tuple[str, _Floats, Outcome]: ...
def _history(model: Model, recordings: Sequence[_Path | Rows], joints: str | None, need_mm: float | None) -> str: ...
def _repeatability(
    recording: Rows, robot: _Path | Robot | None, cell: _Path | Cell | None, same: float | None
) -> str: ...
def _effects_json() -> str: ...
def _named(effect: str, site: str | None) -> str: ...
def _plan(machine: _Machine, given: _Keywords, progress: _Listener) -> tuple[_Touches, str, Outcome]: ...
def _poses(n: int, machine: _Machine, given: _Keywords) -> _Floats: ...
def _simulate(model: Model, q: npt.ArrayLike, kind: str, number: npt.ArrayLike | None, given: _Keywords) -> Rows: ...
def _observability(
    recordings: Sequence[_Path | Rows],
    machine: _Machine,
    joints: str,
    set: str,
    noise: float | None,
) -> str: ...
def _study_touches(machine: _Machine, per_ball: Sequence[int], given: _Keywords, progress: _Listener) -> _Study: ...
def _study_platforms(machine: _Machine, given: _Keywords, progress: _Listener) -> _Study: ...
def _compensate(program: _Path, model: Model, machine: _Machine, given: _Keywords) -> str: ...
def _ports() -> list[tuple[str, str, str | None]]: ...
def _master(url: str) -> tuple[_Floats, str, list[str]]: ...
def _virtual_cell(machine: _Machine, given: _Keywords) -> VirtualCell: ...
def _measure(
    plan: dict[str, str | None], machine: _Machine, given: _Keywords, progress: _Listener
) -> tuple[int, int, int, list[str], list[str]]: ...
def _touch_here(ball: int, machine: _Machine, given: _Keywords, progress: _Listener) -> Rows: ...
def _program(arguments: list[str]) -> int: ...
def _sample() -> list[tuple[str, str]]: ...
def _tool_point(recording: Rows, machine: _Machine) -> tuple[Cell, float]: ...
def _base(recording: Rows, machine: _Machine) -> tuple[Cell, list[tuple[int, int, float, float]]]: ...
def _inside(path: _Path) -> tuple[Robot | None, Cell | None]: ...
def _convert(input: _Path, output: _Path, joints: int | None) -> str: ...
def _export(model: Model, path: _Path | None, given: _Keywords) -> str: ...
