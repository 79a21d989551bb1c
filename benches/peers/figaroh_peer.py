"""FIGAROH: calibration, the choice of identifiable parameters that it begins with, and its choice of configurations."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))
from measure import FOLDER, report, wants  # isort: skip

import contextlib
import io
import logging
import tempfile
import time
import warnings

warnings.simplefilter("ignore")
logging.disable(logging.CRITICAL)

import numpy as np
import pinocchio as pin
from figaroh.calibration.base_calibration import BaseCalibration
from figaroh.calibration.calibration_tools import calc_updated_fkm

import arm

TEMP = Path(tempfile.mkdtemp())
CONFIG = """
schema_version: "2.0"
robot:
  name: irb
  properties:
    joints: {{active_joints: [j1, j2, j3, j4, j5, j6]}}
tasks:
  calibration:
    type: calibration
    enabled: true
    kinematics: {{base_frame: universe, tool_frame: l6}}
    measurements:
      markers:
        - {{ref_joint: j6, measurable_dof: [true, true, true, false, false, false]}}
      poses: {{base_pose: [0,0,0,0,0,0], tool_pose: [0.05,0.02,0.1,0,0,0]}}
    parameters:
      calibration_level: full_params
      include_non_geometric: false
      outlier_threshold: 0.05
      estimation: {{method: {method}}}
    data: {{number_of_samples: {samples}, source_file: {file}}}
"""


def urdf():
    """The nominal arm as a URDF."""
    parts, parent = ['<robot name="irb"><link name="base"/>'], "base"
    for i, (alpha, a, d, offset) in enumerate(arm.MDH, start=1):
        turn = pin.utils.rotate("x", alpha)
        xyz = " ".join(f"{x:.17g}" for x in np.array([a, 0, 0]) + turn @ [0, 0, d])
        rpy = " ".join(f"{x:.17g}" for x in pin.rpy.matrixToRpy(turn @ pin.utils.rotate("z", offset)))
        parts.append(
            f'<link name="l{i}"><inertial><mass value="3"/>'
            f'<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="j{i}" type="revolute"><parent link="{parent}"/><child link="l{i}"/>'
            f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="0 0 1"/>'
            f'<limit lower="-3.2" upper="3.2" effort="1" velocity="1"/></joint>'
        )
        parent = f"l{i}"
    return "".join([*parts, "</robot>"])


class Arm:
    """What FIGAROH asks of a robot."""

    def __init__(self):
        """Writes and reads the URDF."""
        path = TEMP / "arm.urdf"
        path.write_text(urdf())
        self.model = pin.buildModelFromUrdf(str(path))
        self.data = self.model.createData()
        self.q0, self.nq = pin.neutral(self.model), self.model.nq


class Calibration(BaseCalibration):
    """Base and tool unknown; residuals are positions."""

    def __init__(self, *args):
        """As FIGAROH's own."""
        super().__init__(*args)
        self.calib_config["known_baseframe"] = False
        self.calib_config["known_tipframe"] = False

    def cost_function(self, var):
        """Predicted minus measured."""
        return calc_updated_fkm(self.model, self.data, var, self.q_measured, self.calib_config) - self.PEE_measured


def recording(q, p):
    """A recording as FIGAROH reads it."""
    path = TEMP / f"data{len(q)}.csv"
    header = "x1,y1,z1," + ",".join(f"j{j}" for j in range(1, 7))
    np.savetxt(path, np.column_stack([p, q]), delimiter=",", header=header, comments="", fmt="%.17g")
    return path


def calibrate(q, p, method):
    """The calibration, CPU time of choosing parameters, CPU time of fitting."""
    config = TEMP / f"{method}{len(q)}.yaml"
    config.write_text(CONFIG.format(method=method, samples=len(q), file=recording(q, p)))
    with contextlib.redirect_stdout(io.StringIO()):
        c, start = Calibration(Arm(), str(config)), time.process_time()
        c.initialize()
        middle = time.process_time()
        c.solve(enable_logging=False)
    return c, middle - start, time.process_time() - middle


def held_out(c):
    """RMS error at poses that no fit has seen, in words."""
    q, p = arm.read_points(FOLDER / "rigid_heldout.csv")
    config = dict(c.calib_config, NbSample=len(q))
    found = calc_updated_fkm(c.model, c.data, np.asarray(c.LM_result.x), q, config).reshape(3, -1).T
    return f"{1e6 * np.sqrt(np.mean(np.sum((found - p) ** 2, axis=1))):.2f} um"


def identification():
    """Its default choice of parameters by structure misses one that this arm needs; that by excitation does not."""
    for what, read, name in (("45 touches", arm.read_touches, "touches"), ("1000 poses", arm.read_points, "points")):
        row = f"identification, {what}, 26 parameters"
        if not wants(row):
            continue
        q, p = read(FOLDER / f"rigid_{name}.csv")
        for method in ("structural", "excitation"):
            runs = [calibrate(q, p, method) for _ in range(3 if len(q) < 100 else 1)]
            c = runs[0][0]
            spent = float(np.median([r[1] + r[2] for r in runs]))
            who = f"FIGAROH, {method}, {len(c.LM_result.x)} parameters"
            report(row, who, spent, held_out(c), "figaroh")
            if len(q) < 100 and wants("identifiability"):
                choice = float(np.median([r[1] for r in runs]))
                report("identifiability", f"FIGAROH, {method}", choice, f"{len(c.LM_result.x)} chosen", "figaroh")


def choice():
    """Its own exchange (Detmax) on the same 900 candidates, given the information matrices ready made."""
    row = "choice of configurations"
    if not wants(row):
        return
    import random

    from figaroh.optimal.base_optimal_calibration import Detmax

    from numpy_peer import linearize

    q = np.loadtxt(FOLDER / "joints.txt")[:900]
    jacobian = linearize(q, np.zeros((900, 3)), np.zeros(arm.RIGID))[1]
    length = np.linalg.norm(jacobian, axis=0)
    blocks = (jacobian / length).reshape(900, 3, -1)
    random.seed(1)
    with contextlib.redirect_stdout(io.StringIO()):
        finder = Detmax({k: b.T @ b for k, b in enumerate(blocks)}, 45)
        start = time.process_time()
        root = finder.main_algo()[-1]  # of the determinant, all that it gives back
    spent = time.process_time() - start
    whole = np.exp(np.linalg.slogdet(np.einsum("nij,nik->jk", blocks, blocks))[1] / arm.RIGID)
    words = f"information per parameter {root / 45 / (whole / 900):.4f} of the pool's"
    report(row, "FIGAROH, Detmax from a random start (once)", spent, words, "figaroh")


if __name__ == "__main__":
    identification()
    choice()
