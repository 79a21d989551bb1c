import os

import numpy as np
import numpy.typing as npt

__version__: str

class TricalError(ValueError): ...
class NotConvergedError(RuntimeError): ...

class Model:
    """A model ready to predict where the tool is.

    Joint values `q` are arrays (n, joints), in rad (m for prismatic joints); everything else is in m, rad, N m too.
    """

    @staticmethod
    def nominal(robot: str | os.PathLike[str], cell: str | os.PathLike[str] | None = None) -> Model:
        """Nominal arm of a robot.toml, or of a URDF as in "arm.urdf#base_link:tool0", in the cell of a cell.toml.

        Without a cell, the arm's foot is the world and its flange is the tool.
        """
    @staticmethod
    def load(path: str | os.PathLike[str]) -> Model: ...
    @staticmethod
    def from_toml(text: str) -> Model: ...
    def save(self, path: str | os.PathLike[str]) -> None: ...
    def to_toml(self) -> str: ...
    @property
    def robot(self) -> str: ...
    @property
    def dof(self) -> int: ...
    @property
    def limits(self) -> npt.NDArray[np.float64]:
        """Lower and upper limits of the joints, (joints, 2), rad (m for prismatic joints)."""
    @property
    def kinds(self) -> list[str]:
        """Kind of each joint: "revolute" or "prismatic"."""
    def robot_toml(self) -> str:
        """Text of a robot.toml: the nominal arm."""
    def rigid(self) -> Model:
        """Build the constant terms into arm and cell, and leave the others (compliance ...) out."""
    def not_rigid(self) -> list[str]:
        """Names of the terms that `rigid` and `to_urdf` leave out."""
    def to_urdf(self) -> str:
        """Text of a URDF: the rigid part, links world, base_link, link_1 ... link_n, flange, tcp."""
    def forward(self, q: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Positions (n, 3) in m and rotations (n, 3, 3) of the tool in the world."""
    def flange(self, q: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Positions (n, 3) in m and rotations (n, 3, 3) of the flange in the world."""
    def jacobian(self, q: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Jacobians (n, 6, joints), world axes: velocity of the TCP (m), then angular velocity (rad), per rad (m)."""
    def gravity_torques(self, q: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """What gravity does at each joint, (n, joints), in N m about its axis (N along a prismatic one)."""
    def _terms_json(self) -> str: ...

def _identify(
    recordings: list[str], robot: str, cell: str, joints: str, model: str, folds: int | None
) -> tuple[Model, str]: ...
def _diagnose(recordings: list[str], robot: str, cell: str, joints: str) -> tuple[Model, str]: ...
def _effects_json() -> str: ...
def _validate(model: Model, recordings: list[str], robot: str, cell: str) -> str: ...
def _compensate(
    program: str,
    model: Model,
    out: str | None,
    robot: str,
    cell: str,
    dialect: str | None,
    frames: list[str],
    partial: bool,
    tool: str | None,
    frame: str | None,
    temp_c: float | None,
    time_s: float | None,
    payload_kg: float | None,
    any_configuration: bool,
    own_base: bool,
) -> str: ...
