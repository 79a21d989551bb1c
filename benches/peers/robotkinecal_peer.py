"""Robotics Toolbox (kinematics) and robotkinecal (calibration on it)."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))
from measure import FOLDER, cpu_time, report, wants  # isort: skip

import contextlib
import io
import warnings

warnings.simplefilter("ignore")

import numpy as np
import roboticstoolbox as rtb
from robotkinecal import SerialRobotKineCal

import arm


def robot():
    """The nominal arm as a chain of elementary transforms, the toolbox's fast kind."""
    et, links, parent = rtb.ET, [], None
    for i, (alpha, a, d, offset) in enumerate(arm.MDH):
        chain = et.Rx(alpha) * et.tx(a) * et.tz(d) * et.Rz(offset) * et.Rz()
        parent = rtb.Link(chain, name=f"l{i + 1}", parent=parent)
        links.append(parent)
    x, y, z = arm.TOOL
    links.append(rtb.Link(et.tx(x) * et.ty(y) * et.tz(z), name="ee", parent=parent))
    return rtb.ERobot(links, name="irb")


def main():
    """All rows."""
    r, q = robot(), np.loadtxt(FOLDER / "joints.txt")
    if wants("forward kinematics"):
        who = "Robotics Toolbox, ERobot"
        report("forward kinematics", who, cpu_time(lambda: r.fkine(q[0])), "", "roboticstoolbox-python")
    if wants("Jacobian"):
        report("Jacobian", "Robotics Toolbox, ERobot", cpu_time(lambda: r.jacob0(q[0])), "", "roboticstoolbox-python")
    if wants("inverse kinematics, one solution from near"):
        near, target = q[:100] + 0.035, [r.fkine(x).A for x in q[:100]]
        turns = iter(np.tile(np.arange(100), 1_000_000))

        def solve():
            k = next(turns)
            return r.ik_NR(target[k], q0=near[k], pinv=True)

        who = "Robotics Toolbox, ik_NR (C++)"
        row = "inverse kinematics, one solution from near"
        report(row, who, cpu_time(solve), "its tolerance", "roboticstoolbox-python")
    row = "identification, 45 touches, 26 parameters"
    if wants(row):
        q, p = arm.read_touches(FOLDER / "rigid_touches.csv")

        def fit():
            with contextlib.redirect_stdout(io.StringIO()):
                c = SerialRobotKineCal(robot(), "ee", verbose=False)
                c.set_observations([np.asarray(x) for x in q], [np.asarray(x) for x in p])
                return c.solve()

        found = fit()
        errors = np.asarray(found.iteration_results[-1].position_errors).reshape(-1)
        words = f"{1e6 * np.mean(np.abs(errors)):.0f} um mean at the touches themselves"
        report(row, "robotkinecal", cpu_time(fit, 5), words, "robotkinecal")


if __name__ == "__main__":
    main()
