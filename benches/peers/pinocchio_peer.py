"""Pinocchio from Python, as most of its users call it; EAIK, which has no interface but Python's."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))
from measure import FOLDER, cpu_time, report, wants  # isort: skip

import numpy as np
import pinocchio as pin

import arm


def translation(x, y, z):
    """A shift as SE3."""
    return pin.SE3(np.eye(3), np.array([x, y, z], dtype=float))


def placement(row):
    """Frame i from frame i - 1 at joint value 0."""
    alpha, a, d, offset = row
    turn = lambda axis, angle: pin.SE3(pin.utils.rotate(axis, angle), np.zeros(3))  # noqa: E731
    return turn("x", alpha) * translation(a, 0, d) * turn("z", offset)


def build():
    """The nominal arm and its tool frame."""
    model, joint = pin.Model(), 0
    for i in range(6):
        joint = model.addJoint(joint, pin.JointModelRZ(), placement(arm.MDH[i]), f"j{i + 1}")
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(3.0, 0.1), pin.SE3.Identity())
    return model, model.addFrame(pin.Frame("tool", joint, 0, translation(*arm.TOOL), pin.FrameType.OP_FRAME))


def kinematics():
    """One pose a call."""
    model, tool = build()
    data, q = model.createData(), np.loadtxt(FOLDER / "joints.txt")[0]
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

    def forward():
        pin.framesForwardKinematics(model, data, q)
        return data.oMf[tool].translation

    if wants("forward kinematics"):
        report("forward kinematics", "Pinocchio, Python", cpu_time(forward), "", "pin")
    if wants("Jacobian"):
        call = lambda: pin.computeFrameJacobian(model, data, q, tool, world)  # noqa: E731
        report("Jacobian", "Pinocchio, Python", cpu_time(call), "", "pin")


def newton():
    """One solution from 2 deg away, by Gauss-Newton on the pose's logarithm as in Pinocchio's own example, undamped."""
    row = "inverse kinematics, one solution from near"
    if not wants(row):
        return
    model, tool = build()
    data, joints = model.createData(), np.loadtxt(FOLDER / "joints.txt")[:100]
    targets = []
    for q in joints:
        pin.framesForwardKinematics(model, data, q)
        targets.append(data.oMf[tool].copy())
    order = iter(np.tile(np.arange(len(joints)), 1_000_000))

    def solve():
        k = next(order)
        q = joints[k] + 0.035
        for _ in range(20):
            pin.framesForwardKinematics(model, data, q)
            error = data.oMf[tool].actInv(targets[k])
            e = pin.log6(error).vector
            if np.abs(e).max() < 1e-10:
                break
            jacobian = pin.computeFrameJacobian(model, data, q, tool, pin.ReferenceFrame.LOCAL)
            q = q + np.linalg.solve(jacobian, e)
        return q

    report(row, "Pinocchio, Python", cpu_time(solve), "off by at most 1e-10 m", "pin")


def closed_form():
    """EAIK, all solutions."""
    row = "inverse kinematics"
    if not wants(row):
        return
    from eaik.IK_Homogeneous import HomogeneousRobot

    frame, frames = pin.SE3.Identity(), []
    for i in range(6):
        frame = frame * placement(arm.MDH[i])
        frames.append(frame.homogeneous)
    robot = HomogeneousRobot(np.array([*frames, frames[-1]]))
    poses = [robot.fwdKin(q) for q in np.loadtxt(FOLDER / "joints.txt")]
    found, worst = 0, 0.0
    for pose in poses[:200]:
        solution = robot.IK(pose)
        for q, off in zip(solution.Q, solution.is_LS, strict=True):
            if not off:
                found += 1
                worst = max(worst, np.linalg.norm((robot.fwdKin(q) - pose)[:3, 3]))
    words = f"{found / 200:.2f} solutions, limits not looked at, off by at most {worst:.0e} m"
    one = cpu_time(lambda: robot.IK(poses[0]))
    many = cpu_time(lambda: robot.IK_batched(poses, 1)) / len(poses)
    report(row, "EAIK, Python, one pose a call", one, words, "EAIK")
    report(row, "EAIK, Python, 1000 poses a call", many, words, "EAIK")


if __name__ == "__main__":
    kinematics()
    newton()
    closed_form()
