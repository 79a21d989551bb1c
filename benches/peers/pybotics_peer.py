"""pybotics: forward kinematics, Jacobian, and its own optimization of accuracy."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))
from measure import FOLDER, cpu_time, report, wants  # isort: skip

import time

import numpy as np
from pybotics.kinematic_chain import MDHKinematicChain
from pybotics.optimization import OptimizationHandler, compute_absolute_errors, optimize_accuracy
from pybotics.robot import Robot
from pybotics.tool import Tool
from scipy.optimize import least_squares

import arm

ORDER = [0, 1, 3, 2]  # pybotics has alpha, a, theta, d


def robot():
    """The nominal arm."""
    r = Robot(MDHKinematicChain.from_parameters(arm.MDH[:, ORDER]))
    tool = np.eye(4)
    tool[:3, 3] = arm.TOOL
    r.tool = Tool(tool)
    return r


def handler():
    """Which parameters are free: the same 26."""
    mask = list(arm.MASK[:, ORDER].ravel())
    return OptimizationHandler(
        robot(), kinematic_chain_mask=mask, tool_mask=[True] * 3 + [False] * 3, world_mask=[True] * 6
    )


def held_out(fitted):
    """RMS error at poses that no fit has seen, in words."""
    e = compute_absolute_errors(*arm.read_points(FOLDER / "rigid_heldout.csv"), fitted.robot)
    return f"{1e6 * np.sqrt(np.mean(e**2)):.2f} um"


def by_positions(q, p):
    """pybotics' forward function under SciPy with x, y, z as residuals, which pybotics' own recipe does not do."""
    h = handler()

    def residual(v):
        h.apply_optimization_vector(v)
        return np.concatenate([h.robot.fk(a)[:3, 3] - b for a, b in zip(q, p, strict=True)])

    v = h.generate_optimization_vector()
    h.apply_optimization_vector(least_squares(residual, v, method="lm", x_scale="jac").x)
    return h


def main():
    """All rows."""
    r, q = robot(), np.loadtxt(FOLDER / "joints.txt")
    if wants("forward kinematics"):
        report("forward kinematics", "pybotics", cpu_time(lambda: r.fk(q[0])), "", "pybotics")
    if wants("Jacobian"):
        report("Jacobian", "pybotics", cpu_time(lambda: r.jacobian_world(q[0])), "", "pybotics")
    row = "identification, 45 touches, 26 parameters"
    if wants(row):
        q, p = arm.read_touches(FOLDER / "rigid_touches.csv")
        h, start = handler(), time.process_time()
        s = least_squares(
            optimize_accuracy, h.generate_optimization_vector(), args=(h, q, p), method="lm", max_nfev=300
        )
        spent = time.process_time() - start
        h.apply_optimization_vector(s.x)
        report(row, "pybotics, its optimize_accuracy, SciPy lm, 300 evaluations (once)", spent, held_out(h), "pybotics")
        report(
            row,
            "pybotics, vector residuals",
            cpu_time(lambda: by_positions(q, p), 3),
            held_out(by_positions(q, p)),
            "pybotics",
        )
    row = "identification, 1000 poses, 26 parameters"
    if wants(row):
        q, p = arm.read_points(FOLDER / "rigid_points.csv")
        found, start = by_positions(q, p), time.process_time()
        by_positions(q, p)
        report(row, "pybotics, vector residuals (once)", time.process_time() - start, held_out(found), "pybotics")


if __name__ == "__main__":
    main()
