"""Kinematics, Jacobians and gravity torques against Pinocchio, from the same URDF; and exported arms read back."""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
import pinocchio as pin
import pytest

import trical
from terms import compliance, link, term

GRAVITY = 9.80665
ROOT = Path(__file__).resolve().parents[2]
SHIPPED = sorted([*ROOT.glob("cells/*/robot.toml"), *ROOT.glob("robots/*.toml")])


def three(v: object) -> str:
    return " ".join(repr(float(x)) for x in np.asarray(v, dtype=float))


class Urdf:
    """A chain, link after link."""

    def __init__(self) -> None:
        self.parts = ['<link name="base"/>']
        self.last = "base"

    def add(
        self,
        kind: str,
        xyz: object = (0, 0, 0),
        rpy: object = (0, 0, 0),
        axis: object = (0, 0, 1),
        mass: float = 0.0,
        cog: object = (0, 0, 0),
    ) -> Urdf:
        name = f"link{len(self.parts)}"
        inertia = '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>'
        body = f'<inertial><origin xyz="{three(cog)}"/><mass value="{mass!r}"/>{inertia}</inertial>' if mass else ""
        self.parts.append(
            f'<link name="{name}">{body}</link>'
            f"<joint name={quoteattr('to_' + name)} type={quoteattr(kind)}>"
            f'<parent link="{self.last}"/><child link="{name}"/><origin xyz="{three(xyz)}" rpy="{three(rpy)}"/>'
            f'<axis xyz="{three(axis)}"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
        )
        self.last = name
        return self

    def text(self) -> str:
        return f'<robot name="arm">{"".join(self.parts)}</robot>'


def spherical_wrist() -> Urdf:
    u = Urdf()
    for xyz, axis, mass, cog in [
        ((0, 0, 0.29), (0, 0, 1), 3.1, (0, 0, -0.05)),
        ((0, 0, 0), (0, 1, 0), 3.9, (0, 0.01, 0.1)),
        ((0, 0, 0.27), (0, 1, 0), 2.9, (0.02, 0.02, 0.05)),
        ((0, 0, 0.07), (1, 0, 0), 1.3, (0.22, 0, 0)),
        ((0.302, 0, 0), (0, 1, 0), 0.5, (0, 0, 0)),
        ((0, 0, 0), (1, 0, 0), 0.14, (0.06, 0, 0)),
    ]:
        u.add("revolute", xyz, (0, 0, 0), axis, mass, cog)
    return u.add("fixed", (0.072, 0, 0), (0, np.pi / 2, 0), mass=0.4, cog=(0.01, 0, 0.02))


def parallel_axes() -> Urdf:
    """Like a UR5e, with the right angles as they are often written: not quite right."""
    u = Urdf()
    for xyz, rpy, mass, cog in [
        ((0, 0, 0.1625), (0, 0, 0), 3.761, (0, -0.026, 0.002)),
        ((0, 0, 0), (1.570796327, 0, 0), 8.058, (-0.2125, 0, 0.11336)),
        ((-0.425, 0, 0), (0, 0, 0), 2.846, (-0.2422, 0, 0.0265)),
        ((-0.3922, 0, 0.1333), (0, 0, 0), 1.37, (0, -0.016, 0.0018)),
        ((0, -0.0997, -2.04e-11), (1.5708, 0, 0), 1.3, (0, 0.016, 0.0018)),
        ((0, 0.0996, -2.04e-11), (1.5708, 3.1416, 3.1416), 0.365, (0, 0, -0.0012)),
    ]:
        u.add("continuous", xyz, rpy, (0, 0, 1), mass, cog)
    return u.add("fixed", (0, 0, 0), (-np.pi / 2, 0, -np.pi / 2))


def seven_axes() -> Urdf:
    u = Urdf()
    turns = [0, -np.pi / 2, np.pi / 2, np.pi / 2, -np.pi / 2, np.pi / 2, np.pi / 2]
    places = [(0, 0, 0.333), (0, 0, 0), (0, -0.316, 0), (0.0825, 0, 0), (-0.0825, 0.384, 0), (0, 0, 0), (0.088, 0, 0)]
    for k, (xyz, turn) in enumerate(zip(places, turns, strict=True)):
        u.add("revolute", xyz, (turn, 0, 0), (0, 0, 1), 4.0 - 0.4 * k, (0.01 * k, -0.03, 0.02))
    return u.add("fixed", (0, 0, 0.107), mass=0.7, cog=(0, 0, 0.05))


def scara() -> Urdf:
    u = Urdf()
    u.add("revolute", (0, 0, 0.3), mass=5.0, cog=(0.1, 0, 0))
    u.add("revolute", (0.25, 0, 0.05), mass=3.0, cog=(0.1, 0, 0))
    u.add("prismatic", (0.2, 0, 0.1), (0, 0, 0), (0, 0, -1), mass=1.0, cog=(0, 0, -0.1))
    return u.add("continuous", (0, 0, -0.2), (np.pi, 0, 0), mass=0.5, cog=(0.01, 0, 0))


def random_chain(seed: int) -> Urdf:
    rng = np.random.default_rng(seed)
    u = Urdf()
    for _ in range(1 + seed % 9):
        if rng.random() < 0.3:
            u.add("fixed", rng.normal(0, 0.1, 3), rng.normal(0, 1, 3), mass=0.3, cog=rng.normal(0, 0.05, 3))
        right = rng.choice([0, np.pi / 2, -np.pi / 2, np.pi], 3)
        rpy = [right, right + rng.normal(0, 1e-6, 3), rng.normal(0, 1, 3), np.zeros(3)][rng.integers(4)]
        xyz = [np.zeros(3), rng.normal(0, 0.3, 3), np.array([0, 0, 0.3])][rng.integers(3)]
        axis = [np.array([0, 0, 1]), np.array([0, -1, 0]), rng.normal(0, 1, 3)][rng.integers(3)]
        kind = ["revolute", "continuous", "prismatic"][rng.integers(3)]
        u.add(kind, xyz, rpy, axis, rng.uniform(0.2, 5), rng.normal(0, 0.1, 3))
    return u.add("fixed", rng.normal(0, 0.1, 3), rng.normal(0, 1, 3), mass=0.2, cog=rng.normal(0, 0.05, 3))


ARMS = {
    "6R, spherical wrist": spherical_wrist(),
    "6R, parallel axes": parallel_axes(),
    "7R": seven_axes(),
    "SCARA": scara(),
    **{f"random chain {k}": random_chain(k) for k in range(45)},
}


class Reference:
    """Pinocchio's answers for joint values in the order of the chain."""

    def __init__(self, text: str, frame: str) -> None:
        self.model = pin.buildModelFromXML(text)
        self.model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
        self.data = self.model.createData()
        self.frame = self.model.getFrameId(frame)
        assert self.frame < self.model.nframes

    def q(self, values: np.ndarray) -> np.ndarray:
        """Continuous joints are a point of the unit circle."""
        q = pin.neutral(self.model)
        for joint, value in zip(self.model.joints[1:], values, strict=True):
            if joint.nq == 2:
                q[joint.idx_q : joint.idx_q + 2] = np.cos(value), np.sin(value)
            else:
                q[joint.idx_q] = value
        return q

    def pose(self, values: np.ndarray) -> pin.SE3:
        pin.framesForwardKinematics(self.model, self.data, self.q(values))
        return self.data.oMf[self.frame]

    def jacobian(self, values: np.ndarray) -> np.ndarray:
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = pin.computeFrameJacobian(self.model, self.data, self.q(values), self.frame, world)
        return np.reshape(jacobian, (6, -1))  # of one joint it gives a vector

    def gravity(self, values: np.ndarray) -> np.ndarray:
        return pin.computeGeneralizedGravity(self.model, self.data, self.q(values))


@pytest.fixture(params=ARMS, ids=list(ARMS))
def pair(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[trical.Model, Reference]:
    arm = ARMS[request.param]
    path = tmp_path / "arm.urdf"
    path.write_text(arm.text())
    return trical.Model.nominal(path), Reference(arm.text(), arm.last)


def test_poses_jacobians_and_gravity_torques_are_pinocchios(pair: tuple[trical.Model, Reference]) -> None:
    model, reference = pair
    assert model.dof == reference.model.nv
    q = np.random.default_rng(1).uniform(-3, 3, (50, model.dof))
    p, r = model.forward(q)
    flange, _ = model.flange(q)
    jacobian, tau = model.jacobian(q), model.gravity_torques(q)
    for k in range(len(q)):
        pose = reference.pose(q[k])
        np.testing.assert_allclose(p[k], pose.translation, atol=1e-10, rtol=0)
        np.testing.assert_allclose(flange[k], pose.translation, atol=1e-10, rtol=0)
        np.testing.assert_allclose(r[k], pose.rotation, atol=1e-10, rtol=0)
        np.testing.assert_allclose(jacobian[k], reference.jacobian(q[k]), atol=1e-10, rtol=0)
        # Pinocchio's is the torque that holds the arm, ours what gravity does
        np.testing.assert_allclose(tau[k], -reference.gravity(q[k]), atol=1e-10, rtol=0)


def test_an_arm_survives_the_way_through_robot_toml(pair: tuple[trical.Model, Reference], tmp_path: Path) -> None:
    model, reference = pair
    (tmp_path / "robot.toml").write_text(model.robot_toml())
    again = trical.Model.nominal(tmp_path / "robot.toml")
    q = np.random.default_rng(2).uniform(-3, 3, (20, model.dof))
    p, r = again.forward(q)
    for k in range(len(q)):
        pose = reference.pose(q[k])
        np.testing.assert_allclose(p[k], pose.translation, atol=1e-10, rtol=0)
        np.testing.assert_allclose(r[k], pose.rotation, atol=1e-10, rtol=0)


CELL = """
[base]
xyz_mm = [150.0, -330.0, -150.0]
zyx_deg = [90.0, 10.0, -20.0]
[tool]
tcp_mm = [18.0, -12.0, 118.0]
zyx_deg = [10.0, 20.0, 30.0]
mass_kg = 1.7
cog_mm = [5.0, -4.0, 55.0]
"""


def calibrated(robot: Path, tmp_path: Path, seed: int, *, tilts: bool) -> trical.Model:
    """A model file with every constant term off by chance, and compliance."""
    (tmp_path / "cell.toml").write_text(CELL)
    nominal = trical.Model.nominal(robot, tmp_path / "cell.toml")
    rng = np.random.default_rng(seed)
    n = nominal.dof
    text = nominal.to_toml().replace("term = []\n", "")

    def off(name: str, site: str, most: float, unit: str) -> str:
        return term(name, "geometry", rng.uniform(-most, most), unit, site)

    for k in range(n):
        for parameter, unit in [("alpha", "deg"), ("a", "mm"), ("beta", "deg")]:
            text += off(f"{parameter}_{k}", link(k, parameter), 0.5, unit)
        for parameter, unit in [("theta", "deg"), ("d", "mm")]:
            text += off(f"{parameter}_{k + 1}", link(k + 1, parameter), 0.5, unit)
        if tilts:
            text += off(f"tilt_{k + 1}", f'{{ tilt = {{ joint = {k + 1}, axis = "y" }} }}', 0.1, "deg")
        if nominal.kinds[k] == "revolute":
            text += compliance(k + 1, rng.uniform(0, 0.01))
    for where in ("base", "tool"):
        for axis in "xyz":
            text += off(f"{where}_{axis}", f'{{ {where} = {{ along = "{axis}" }} }}', 5, "mm")
            text += off(f"{where}_r{axis}", f'{{ {where} = {{ about = "{axis}" }} }}', 1, "deg")
    return trical.Model.from_toml(text)


@pytest.mark.parametrize("tilts", [False, True])
@pytest.mark.parametrize("arm", ["6R, spherical wrist", "6R, parallel axes", "7R", "SCARA", "random chain 8"])
def test_an_exported_urdf_is_the_rigid_calibrated_arm(arm: str, tilts: bool, tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(ARMS[arm].text())
    model = calibrated(path, tmp_path, 3, tilts=tilts)
    q = np.random.default_rng(4).uniform(-3, 3, (50, model.dof))
    # the terms are there: the calibrated arm is millimetres from nominal, and compliance moves it too
    nominal = trical.Model.nominal(path, tmp_path / "cell.toml")
    assert np.linalg.norm(model.forward(q)[0] - nominal.forward(q)[0], axis=1).mean() > 1e-3
    assert np.abs(model.forward(q)[0] - model.rigid().forward(q)[0]).max() > 1e-5
    assert set(model.not_rigid()) == {f"c_{k + 1}" for k in range(model.dof) if model.kinds[k] == "revolute"}
    # all of the model but compliance, term by term
    rigid = trical.Model.from_toml(
        "".join(f"[[term]]{t}" if k else t for k, t in enumerate(model.to_toml().split("[[term]]")) if '"c_' not in t)
    )
    text = model.to_urdf()
    p, r = rigid.forward(q)
    flange, flange_r = rigid.flange(q)
    tcp, carrier = Reference(text, "tcp"), Reference(text, "flange")
    for k in range(len(q)):
        np.testing.assert_allclose(tcp.pose(q[k]).translation, p[k], atol=1e-9, rtol=0)
        np.testing.assert_allclose(tcp.pose(q[k]).rotation, r[k], atol=1e-9, rtol=0)
        np.testing.assert_allclose(carrier.pose(q[k]).translation, flange[k], atol=1e-9, rtol=0)
        np.testing.assert_allclose(carrier.pose(q[k]).rotation, flange_r[k], atol=1e-9, rtol=0)
        np.testing.assert_allclose(tcp.gravity(q[k]), -rigid.gravity_torques(q[k : k + 1])[0], atol=1e-9, rtol=0)


@pytest.mark.parametrize("arm", ["6R, spherical wrist", "6R, parallel axes", "7R", "SCARA", "random chain 8"])
def test_an_exported_urdf_is_the_same_arm_in_mujoco(arm: str, tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed: it needs Python 3.11 or newer")
    path = tmp_path / "arm.urdf"
    path.write_text(ARMS[arm].text())
    model = calibrated(path, tmp_path, 3, tilts=True).rigid()
    there = mujoco.MjModel.from_xml_string(model.to_urdf())
    data = mujoco.MjData(there)
    names = {mujoco.mj_id2name(there, mujoco.mjtObj.mjOBJ_BODY, k): k for k in range(there.nbody)}
    q = np.random.default_rng(6).uniform(-3, 3, (50, model.dof))
    (p, r), (flange, _) = model.forward(q), model.flange(q)
    for k in range(len(q)):
        data.qpos[:] = q[k]
        mujoco.mj_kinematics(there, data)
        np.testing.assert_allclose(data.xpos[names["tcp"]], p[k], atol=1e-9, rtol=0)
        np.testing.assert_allclose(data.xmat[names["tcp"]].reshape(3, 3), r[k], atol=1e-9, rtol=0)
        np.testing.assert_allclose(data.xpos[names["flange"]], flange[k], atol=1e-9, rtol=0)


@pytest.mark.parametrize("robot", SHIPPED, ids=lambda p: "/".join(p.parts[-2:]))
def test_shipped_robots_are_the_same_in_pinocchio(robot: Path) -> None:
    model = trical.Model.nominal(robot)
    reference = Reference(model.to_urdf(), "tcp")
    low, high = model.limits.T
    q = np.random.default_rng(5).uniform(low, high, (20, model.dof))
    p, r = model.forward(q)
    for k in range(len(q)):
        np.testing.assert_allclose(reference.pose(q[k]).translation, p[k], atol=1e-10, rtol=0)
        np.testing.assert_allclose(reference.pose(q[k]).rotation, r[k], atol=1e-10, rtol=0)


def test_a_urdf_that_is_none_is_refused_with_file_and_line(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(scara().text().replace('upper="3"', 'upper="nan"', 1))
    with pytest.raises(trical.TricalError, match=r"arm\.urdf, line 1: joint 'to_link1': <limit> upper: found 'nan'"):
        trical.Model.nominal(path)
    path.write_text(scara().text())
    with pytest.raises(trical.TricalError, match="there is no such link"):
        trical.Model.nominal(f"{path}#base:tool0")
