"""A simulated arm that shares nothing with the workspace: batched 4x4 transforms, gravity summed over bodies.

SI units throughout (m, rad, kg, s, K, N m). `base_from_...`, `world_from_...` read as "maps ... into ...".
Arrays carry one row per measurement. An effect is plain data (`{"effect", "site", "p"}`); what it does to the machine
is in `effects.py`, what this file provides is a machine in which every place that can move can be moved.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

GRAVITY = 9.80665
MM = 1e-3
DEG = np.pi / 180.0


def rot(axis: int, angle) -> np.ndarray:
    """Rotation matrices about a coordinate axis (0, 1, 2); angle of any shape."""
    angle = np.asarray(angle, float)
    c, s = np.cos(angle), np.sin(angle)
    out = np.zeros((*angle.shape, 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out[..., axis, axis] = 1.0
    out[..., i, i] = c
    out[..., j, j] = c
    out[..., i, j] = -s
    out[..., j, i] = s
    return out


def rot_vector(v: np.ndarray) -> np.ndarray:
    """Rodrigues' formula for rotation vectors of shape (..., 3)."""
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    o = np.zeros_like(x)
    k = np.stack([np.stack([o, -z, y], -1), np.stack([z, o, -x], -1), np.stack([-y, x, o], -1)], -2)
    a = np.where(angle < 1e-9, 1.0, angle)
    first = np.where(angle < 1e-9, 1.0, np.sin(a) / a)
    second = np.where(angle < 1e-9, 0.5, (1 - np.cos(a)) / a**2)
    return np.eye(3) + first * k + second * (k @ k)


def zyx(angles) -> np.ndarray:
    """R = Rz(a) Ry(b) Rx(c)."""
    return rot(2, angles[0]) @ rot(1, angles[1]) @ rot(0, angles[2])


@dataclass
class Arm:
    """An arm in its cell: as drawn, or as it really is. Lengths and angles are those of Craig's modified DH."""

    alpha: np.ndarray
    a: np.ndarray
    d: np.ndarray
    offset: np.ndarray
    limits: np.ndarray
    mass: np.ndarray
    cog: np.ndarray
    base_xyz: np.ndarray
    base_zyx: np.ndarray
    tcp: np.ndarray
    tool_mass: float
    tool_cog: np.ndarray
    balls: np.ndarray  # (3 or 6, 3) in the world
    compliance: np.ndarray = field(default_factory=lambda: np.zeros(6))  # rad/Nm, gives way in the sense of gravity
    name: str = "arm"
    slides: tuple[bool, ...] = ()  # which joints go along their axis (m) instead of turning; empty: none
    # lengths, masses, and torques in units of the IRB 120's: typical sizes of effects are those of a small arm
    size: float = 1.0
    weight: float = 1.0
    pull: float = 1.0

    def but(self, **changes) -> Arm:
        """A copy with some fields replaced."""
        return replace(self, **changes)


def triangle(d12: float, d13: float, d23: float) -> np.ndarray:
    """Ball centres from their distances: origin in ball 1, x to ball 2, y towards ball 3."""
    x = (d12**2 + d13**2 - d23**2) / (2 * d12)
    return np.array([[0.0, 0.0, 0.0], [d12, 0.0, 0.0], [x, np.sqrt(d13**2 - x**2), 0.0]])


def true_arm(nominal: Arm, rng: np.random.Generator) -> Arm:
    """What the workshop really built: errors of every MDH parameter, base, tool point, and joints that give way."""
    length, angle = rng.uniform(0.3, 1.0) * MM, rng.uniform(0.05, 0.3) * DEG
    low = np.array([1e-3, 1e-3, 1e-3, 5e-3, 5e-3, 5e-3])
    high = np.array([2e-3, 8e-3, 8e-3, 6e-2, 6e-2, 6e-2])
    compliance = np.exp(rng.uniform(np.log(low), np.log(high))) * DEG / nominal.pull
    compliance[0] = 0.0
    offset = rng.normal(0, angle, 6)
    # the device's axes are those of {6}, says the contract: with theta_6 off, readings that are not nulled would be
    # skew
    offset[5] = 0.0
    free = np.ones_like(nominal.balls)
    free[:3] = [[0, 0, 0], [1, 0, 0], [1, 1, 0]]  # the world is where the first three are
    return nominal.but(
        alpha=nominal.alpha + rng.normal(0, angle, 6),
        a=nominal.a + rng.normal(0, length, 6),
        d=nominal.d + rng.normal(0, length, 6),
        offset=nominal.offset + offset,
        base_xyz=nominal.base_xyz + rng.normal(0, 2 * MM, 3),
        base_zyx=nominal.base_zyx + rng.normal(0, 0.2 * DEG, 3),
        tcp=nominal.tcp + rng.normal(0, 0.5 * MM, 3),
        balls=nominal.balls + free * rng.normal(0, 1e-6, nominal.balls.shape),
        compliance=compliance,
    )


def frames(
    arm: Arm, theta: np.ndarray, *, beta=None, growth=None, tilt=None, back=None
) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (N, J, 3, 3) and origin (N, J, 3) of the frames {1}..{J} in the world.

    `theta` (N, J) are angles with offsets. `beta` (J): Hayati's rotation about the y axis after Rx Tx. `growth` (N):
    factor on all a and d. `tilt` (N, J, 3): a small rotation of everything beyond joint j about a point of its
    axis, as a rotation vector in {j}. `back` (J): how far that point lies before the origin of {j}, as a share of d.
    """
    n, joints = theta.shape
    slides = arm.slides or (False,) * joints
    growth = np.ones(n) if growth is None else growth
    r = np.broadcast_to(zyx(arm.base_zyx), (n, 3, 3))
    o = np.broadcast_to(arm.base_xyz, (n, 3))
    rs, os = np.empty((n, joints, 3, 3)), np.empty((n, joints, 3))
    for j in range(joints):
        fixed = rot(0, arm.alpha[j])
        along = np.array([arm.a[j], 0.0, 0.0])
        turn = np.eye(3) if beta is None else rot(1, beta[j])
        lift = turn @ np.array([0.0, 0.0, arm.d[j]])
        o = o + np.einsum("nij,j->ni", r, fixed @ (along + lift)) * growth[:, None]
        r = r @ (fixed @ turn)
        if slides[j]:
            o = o + r[..., 2] * theta[:, j, None]
        else:
            r = r @ rot(2, theta[:, j])
        if tilt is not None:
            lever = np.array([0.0, 0.0, 0.0 if back is None else back[j] * arm.d[j]])
            before = r @ lever
            r = r @ rot_vector(tilt[:, j])
            o = o - before + r @ lever
        rs[:, j], os[:, j] = r, o
    return rs, os


def bodies(arm: Arm, rs: np.ndarray, os: np.ndarray, load: np.ndarray, extra_mass: float = 0.0, extra_cog=None):
    """Masses (N, J + 1) and world positions (N, J + 1, 3) of the links and of what the flange carries.

    `load` (N): mass that the recording declares, at the tool's centre of gravity; the extra mass is nobody's knowledge.
    """
    where = os + np.einsum("njab,jb->nja", rs, arm.cog)
    known = arm.tool_mass + load
    moment = known[:, None] * arm.tool_cog
    if extra_cog is not None:
        moment = moment + extra_mass * np.asarray(extra_cog)
    mass = known + extra_mass
    tool = os[:, -1] + np.einsum("nab,nb->na", rs[:, -1], moment / np.maximum(mass, 1e-12)[:, None])
    links = np.broadcast_to(arm.mass, os.shape[:2])
    return np.concatenate([links, mass[:, None]], 1), np.concatenate([where, tool[:, None]], 1)


def gravity_moments(masses: np.ndarray, where: np.ndarray, os: np.ndarray, g: np.ndarray) -> np.ndarray:
    """Moment (N, J, 3) in the world that gravity exerts about the origin of {j} on everything beyond joint j."""
    beyond = np.cumsum(masses[:, ::-1], 1)[:, :0:-1]  # the last body is the tool, which is beyond the last joint too
    first = np.cumsum((masses[..., None] * where)[:, ::-1], 1)[:, :0:-1]
    return np.cross(first - beyond[..., None] * os, g)


@dataclass
class Session:
    """What is known of a recording's rows before an effect acts. `touch` says whether rows are touches or tracker
    points."""

    touch: bool
    q: np.ndarray  # (N, 6) rad, joints as the controller reports them
    t: np.ndarray  # s
    temp: np.ndarray  # degC, the real one
    dirs: np.ndarray  # (N, 6) -1, 0, 1
    ball: np.ndarray  # (N) 0-based, touches only
    sigma: float  # m, noise of one component
    spread: float  # m, size of the readings that the procedure leaves
    lag: np.ndarray  # (N, 6) rad, commanded minus reported joints: how far the robot moves on after the reading
    rest: np.ndarray  # (N, 6) rad, commanded minus reported joints that is no error: the controller never gets there
    has_commanded: bool = False
    has_thermometer: bool = True
    load: np.ndarray | None = None  # (N) kg, declared mass beyond the tool's own, where it changes
    reading: np.ndarray | None = None  # (N, 3) m, for touches: readings that the procedure leaves
    point: np.ndarray | None = None  # (N, 3) m in the flange's axes: the measured point, where it is not the tool point
    style: dict = field(default_factory=dict)  # how the order and the approaches were chosen

    @property
    def rise(self) -> np.ndarray:
        """Temperature above the first row's."""
        return self.temp - self.temp[0]

    @property
    def added(self) -> np.ndarray:
        """Declared added mass (N), zero where there is no schedule."""
        return np.zeros(len(self.q)) if self.load is None else self.load

    @property
    def progress(self) -> np.ndarray:
        """Time as a fraction of the session, 0 to 1."""
        return (self.t - self.t[0]) / (self.t[-1] - self.t[0])


class Machine:
    """Where effects act: every place that can move, at its unmoved value, for N rows."""

    def __init__(self, arm: Arm, s: Session):
        n, joints = s.q.shape
        self.angle = np.zeros((n, joints))  # rad, added to joint angles
        self.tilt = np.zeros((n, joints, 3))  # rad, rotation vector in {j} about a point of its axis
        self.back = np.zeros(joints)  # how far that point lies before the origin of {j}, as a share of d
        self.beta = np.zeros(joints)
        self.growth = np.ones(n)
        self.down = np.array([0.0, 0.0, -1.0])
        self.extra_mass, self.extra_cog = 0.0, None
        self.fixture = np.zeros((n, 3))  # m, world: shift of the balls
        self.tool = np.zeros((n, 3))  # m, in {6}: shift of the tool point
        self.frame = np.zeros((n, 3))  # m, in the tracker's frame: shift of what it says
        self.gauge = np.broadcast_to(np.eye(3), (n, 3, 3)).copy()  # reading = gauge @ true offset + drift
        self.gauge_drift = np.zeros((n, 3))
        self.ball_shift = np.zeros_like(arm.balls)
        self.tau = np.zeros((n, joints))  # N m about the joint axes, from the last pass
        self.moment = np.zeros((n, joints, 3))  # N m in {j} about its origin
        self.weight = np.zeros((n, joints, 3))  # N in {j}: what gravity pulls beyond joint j

    def moment_at(self, j: int, lever: float) -> np.ndarray:
        """Moment (N, 3) about the point of axis j that lies `lever` before the origin of {j}."""
        return self.moment[:, j] + np.cross([0.0, 0.0, lever], self.weight[:, j])


@dataclass
class Poses:
    """What the machine does: tool points and orientations in the world, balls, and gravity's torques."""

    tcp: np.ndarray
    r: np.ndarray
    ball: np.ndarray | None
    machine: Machine


def simulate(arm: Arm, s: Session, effects=(), passes: int = 4, start: Machine | None = None) -> Poses:
    """Poses of the true machine at the reported joints. Gravity acts where the arm really is: hence the passes. From
    the torques of nearly the same machine, `start`, two are enough."""
    from effects import ACT

    tau = np.zeros_like(s.q)
    moment, weight = np.zeros((*s.q.shape, 3)), np.zeros((*s.q.shape, 3))
    if start is not None:
        tau, moment, weight, passes = start.tau, start.moment, start.weight, 2
    for _ in range(passes):
        m = Machine(arm, s)
        m.tau, m.moment, m.weight = tau, moment, weight
        for e in effects:
            ACT[e["effect"]](m, s, arm, e["site"], e["p"])
        theta = s.q + arm.offset + m.angle + arm.compliance * tau
        tilt = m.tilt if m.tilt.any() else None
        rs, os = frames(arm, theta, beta=m.beta, growth=m.growth, tilt=tilt, back=m.back)
        masses, where = bodies(arm, rs, os, s.added, m.extra_mass, m.extra_cog)
        world = gravity_moments(masses, where, os, GRAVITY * m.down)
        moment = np.einsum("njba,njb->nja", rs, world)
        beyond = np.cumsum(masses[:, ::-1], 1)[:, :0:-1]
        weight = np.einsum("njba,b,nj->nja", rs, GRAVITY * m.down, beyond)
        tau = moment[..., 2]
    point = arm.tcp if s.point is None else arm.tcp + s.point
    tcp = os[:, -1] + np.einsum("nij,nj->ni", rs[:, -1], point + m.tool)
    ball = (arm.balls + m.ball_shift)[s.ball] + m.fixture if s.touch else None
    return Poses(tcp, rs[:, -1], ball, m)


def readings(poses: Poses) -> np.ndarray:
    """The three indicators (N, 3) without noise: where the ball is from the tool point, in the device's axes."""
    offset = np.einsum("nji,nj->ni", poses.r, poses.ball - poses.tcp)
    return np.einsum("nij,nj->ni", poses.machine.gauge, offset) + poses.machine.gauge_drift


def tracker_points(poses: Poses, tracker_from_world: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """What a tracker without noise says, in its own frame."""
    r, o = tracker_from_world
    return poses.tcp @ r.T + o + poses.machine.frame


def point_jacobian(rs: np.ndarray, os: np.ndarray, p: np.ndarray) -> np.ndarray:
    """d(point fixed to the flange)/d(joint angles), (N, 3, 6)."""
    z = rs[..., 2]
    return np.swapaxes(np.cross(z, p[:, None] - os), 1, 2)
