"""The mechanical effects as bodies and joints: a rotor and a link at every joint, springs, gaps and dry friction
between them.

No formula of an effect is used here. Each joint is a link hinge and a rotor hinge on the same axis, held together by
tendon springs (the gear); the encoder sits on the rotor. From these parts come:

- `lost_motion_direction`: dry friction in the link's bearing winds the gear up, in the sense of the last motion; at
  joint 1, which carries no gravity, also a gap in the gear behind whose flank the link is dragged;
- `load_friction`: friction that grows with the force in the gear's spring;
- `lost_motion_gravity`: a gap in the gear: the link falls onto one flank;
- `nonlinear_stiffness`: a soft spring beside a stiff one that takes part only beyond a gap;
- `cross_axis_compliance`: the link gives way about two more hinges, across its axis, where its bearing stands;
- `joint_coupling`: the gear of a joint is also turned by the rotor of another;
- `payload`: one more body on the flange;
- `gravity_direction`: the base is not level.

A pose is an experiment: the rotors come from the side that the recording's sense of motion says, the arm settles under
gravity until it is still, and the tool point is read.
"""

from __future__ import annotations

import mujoco
import numpy as np

from draws import log_uniform, pick, signed, vector
from effects import ARCSEC
from plant import DEG, GRAVITY, Arm, Machine, Poses, Session, rot, rot_vector, simulate, zyx
from visible import Design, Invisible

STEP = 1e-3  # s
APPROACH = 0.2 * DEG  # the last stretch of the way to a pose, which winds the gears up
RAMP, CHUNK, SETTLE = 700, 50, 3000  # steps: approach, between looks whether the arm is still, at most
STILL, STUCK = 2e-6, 5e-5  # rad/s; MuJoCo's dry friction is a steep damper, so what it holds still creeps
SERVO, ROTOR = 1e8, 500.0  # N m/rad, kg m^2: the rotor follows its command to 3e-7 rad
RIGID = 2e5  # N m/rad, gear of a joint without compliance
LINK = 0.3  # kg m^2, for choosing dampers


def _quat(r: np.ndarray) -> str:
    q = np.zeros(4)
    mujoco.mju_mat2Quat(q, np.ascontiguousarray(r).ravel())
    return _vec(q)


def _vec(v) -> str:
    return " ".join(f"{x:.17g}" for x in v)


def gear(arm: Arm, j: int) -> float:
    """Stiffness of joint j's gear (0-based), N m/rad."""
    return 1.0 / arm.compliance[j] if arm.compliance[j] > 0 else RIGID


def _spring(name: str, stiffness: float, damping: float, half_gap: float, turns: dict[str, float]) -> str:
    """A spring on a sum of joint angles, slack within the gap."""
    sides = "".join(f'<joint joint="{joint}" coef="{c:.17g}"/>' for joint, c in turns.items())
    slack = f"{-half_gap:.17g} {half_gap:.17g}"
    size = f'stiffness="{stiffness:.17g}" damping="{damping:.6g}" springlength="{slack}"'
    return f'<fixed name="{name}" {size}>{sides}</fixed>'


def mjcf(arm: Arm, effect: dict | None) -> str:
    """The arm as MuJoCo sees it."""
    kind = effect["effect"] if effect else None
    at = effect["site"].get("joint", 0) - 1 if effect else -1
    p = effect["p"] if effect else {}
    lines, tail, tendons, motors = [], [], [], []
    inertia = 'diaginertia="2e-3 2e-3 2e-3"'
    nothing = '<inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/>'
    for j in range(6):
        here = j == at
        place = f'pos="{_vec(rot(0, arm.alpha[j]) @ [arm.a[j], 0.0, arm.d[j]])}"'
        turn = f'quat="{_quat(rot(0, arm.alpha[j]) @ rot(2, arm.offset[j]))}"'
        rotor = f'<joint name="rotor{j + 1}" type="hinge" axis="0 0 1" armature="{ROTOR}"/>'
        lines.append(f"<body {place} {turn}>{rotor}{nothing}</body>")
        friction = p.get("friction_nm", 0.0) if here else 0.0
        lines.append(
            f'<body {place} {turn}><joint name="link{j + 1}" type="hinge" axis="0 0 1" armature="0.05" '
            f'frictionloss="{friction:.17g}" solreffriction="0.002 1" solimpfriction="0.9999 0.9999 0.001"/>'
        )
        if here and kind == "cross_axis_compliance":
            k = 1.0 / p["k"]
            bearing = f'type="hinge" stiffness="{k:.17g}" damping="{2 * np.sqrt(k * LINK):.6g}" armature="0.05"'
            foot = f'pos="0 0 {-p["back"] * arm.d[j]:.17g}"'
            lines.append(f'{nothing}<body><joint {bearing} {foot} axis="1 0 0"/><joint {bearing} {foot} axis="0 1 0"/>')
            tail.append("</body>")
        lines.append(f'<inertial pos="{_vec(arm.cog[j])}" mass="{arm.mass[j]:.17g}" {inertia}/>')
        tail.append("</body>")
        k, half_gap = gear(arm, j), 0.0
        turns = {f"link{j + 1}": 1.0, f"rotor{j + 1}": -1.0}
        damping = 2.0 * np.sqrt(k * LINK)
        if here and kind == "joint_coupling":
            turns[f"rotor{effect['site']['from']}"] = -p["k"]
        if here and "gap" in p:
            # oil in the gap must not carry the link along
            half_gap, damping = 0.5 * p["gap"], 0.2 * damping
        if here and kind == "nonlinear_stiffness":
            # soft up to the load `contact_nm`; beyond it a second spring brings the gear back to its stated stiffness
            soft = 1.0 / (arm.compliance[j] + p["soft"])
            tendons.append(_spring(f"soft{j + 1}", soft, 0.0, 0.0, turns))
            half_gap, k = p["contact_nm"] / soft, k - soft
        tendons.append(_spring(f"gear{j + 1}", k, damping, half_gap, turns))
        motors.append(f'<position joint="rotor{j + 1}" kp="{SERVO:g}" kv="{2 * np.sqrt(SERVO * ROTOR):g}"/>')
    load = ""
    if kind == "payload":
        load = f'<body><inertial pos="{_vec(p["at"])}" mass="{p["mass"]:.17g}" {inertia}/></body>'
    level = rot_vector(np.array([[p["about_x"], p["about_y"], 0.0]]))[0] if kind == "gravity_direction" else np.eye(3)
    return (
        f'<mujoco><compiler angle="radian" autolimits="true"/><option timestep="{STEP}" integrator="implicitfast" '
        f'gravity="{_vec(level @ [0.0, 0.0, -GRAVITY])}" tolerance="1e-12"/>'
        f'<worldbody><body pos="{_vec(arm.base_xyz)}" quat="{_quat(zyx(arm.base_zyx))}">'
        + "".join(lines)
        + f'<body><inertial pos="{_vec(arm.tool_cog)}" mass="{arm.tool_mass:.17g}" {inertia}/>'
        f'<site name="tcp" pos="{_vec(arm.tcp)}"/></body>{load}'
        + "".join(tail)
        + f"</body></worldbody><tendon>{''.join(tendons)}</tendon><actuator>{''.join(motors)}</actuator></mujoco>"
    )


class Bench:
    """One arm with one effect (or none), ready for experiments."""

    def __init__(self, arm: Arm, effect: dict | None):
        self.arm = arm
        self.model = mujoco.MjModel.from_xml_string(mjcf(arm, effect))
        self.data = mujoco.MjData(self.model)
        self.rotor = [self.model.joint(f"rotor{j + 1}").id for j in range(6)]
        self.link = [self.model.joint(f"link{j + 1}").id for j in range(6)]
        # every joint is a hinge: a joint's number is its place in positions and velocities
        self.links = [i for i in range(self.model.nv) if i not in self.rotor]
        self.still = np.where(self.model.dof_frictionloss[self.links] > 0, STUCK, STILL)
        self.at = effect["site"].get("joint", 0) - 1 if effect else -1
        self.per_load = effect["p"].get("per_nm", 0.0) if effect else 0.0

    def pose(self, q: np.ndarray, dirs: np.ndarray, sag: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tool point and flange orientation after the rotors came to `q` in the senses `dirs`; `sag` is where links
        start."""
        m, d = self.model, self.data
        mujoco.mj_resetData(m, d)
        start = q - APPROACH * dirs
        d.qpos[self.rotor] = start
        d.qpos[self.link] = start + sag
        x = np.arange(RAMP) / RAMP
        for c in start + np.outer(x**3 * (10 - 15 * x + 6 * x**2), q - start):
            d.ctrl[:] = c
            self.advance(1)
        d.ctrl[:] = q
        for _ in range(SETTLE // CHUNK):
            self.advance(CHUNK)
            if (np.abs(d.qvel[self.links]) < self.still).all():
                break
        mujoco.mj_forward(m, d)
        site = d.site("tcp")
        return site.xpos.copy(), site.xmat.reshape(3, 3).copy()

    def advance(self, steps: int):
        """Time goes on; friction that grows with the load follows the force in the gear's spring."""
        m, d = self.model, self.data
        if not self.per_load:
            mujoco.mj_step(m, d, nstep=steps)
            return
        link, rotor, k = self.link[self.at], self.rotor[self.at], gear(self.arm, self.at)
        still = m.dof_frictionloss[link]
        for _ in range(steps):
            m.dof_frictionloss[link] = still + self.per_load * abs(k * (d.qpos[link] - d.qpos[rotor]))
            mujoco.mj_step(m, d)
        m.dof_frictionloss[link] = still


_benches: dict[str, Bench] = {}


def _bench(arm: Arm, effect: dict | None) -> Bench:
    text = f"{arm!r} {effect!r}"
    if text not in _benches:
        if len(_benches) > 8:
            _benches.clear()
        _benches[text] = Bench(arm, effect)
    return _benches[text]


def experiment(arm: Arm, s: Session, effects=()) -> Poses:
    """The counterpart of `plant.simulate`, by experiments in MuJoCo, one effect at most."""
    effect = effects[0] if effects else None
    sag = arm.compliance * simulate(arm, s, passes=2).machine.tau
    done = []
    for i in range(len(s.q)):
        # what is declared to be carried sits at the tool's centre of gravity: another, heavier tool
        bench = _bench(arm.but(tool_mass=arm.tool_mass + float(s.added[i])), effect)
        done.append(bench.pose(s.q[i], s.dirs[i], sag[i]))
    ball = arm.balls[s.ball] if s.touch else None
    return Poses(np.array([x[0] for x in done]), np.array([x[1] for x in done]), ball, Machine(arm, s))


SITES: dict[str, list[dict]] = {
    "lost_motion_direction": [{"joint": j} for j in range(1, 7)],
    "load_friction": [{"joint": j} for j in range(2, 7)],  # as the two below, where gravity turns the joint at all
    "lost_motion_gravity": [{"joint": j} for j in range(2, 7)],
    "nonlinear_stiffness": [{"joint": j} for j in range(2, 7)],
    "cross_axis_compliance": [{"joint": j} for j in range(1, 7)],
    "joint_coupling": [{"joint": a, "from": b} for a, b in ((5, 4), (6, 5), (6, 4), (3, 2))],
    "payload": [{"tool": True}],
    "gravity_direction": [{"base": True}],
}


def size(rng: np.random.Generator, arm: Arm, tau: np.ndarray, kind: str, site: dict) -> dict:
    """The parts that make the effect, of a size within the typical range; `tau` (N, 6): gravity's torques at the
    poses."""
    j = site.get("joint", 1) - 1
    load, k = np.abs(tau[:, j]), gear(arm, j)

    def lost_motion():
        if j == 0 and rng.random() < 0.5:
            return {"gap": log_uniform(rng, 5 * ARCSEC, 100 * ARCSEC), "friction_nm": float(rng.uniform(3.0, 8.0))}
        return {"friction_nm": 0.5 * log_uniform(rng, 2 * ARCSEC, 120 * ARCSEC) * k}

    return {
        "lost_motion_direction": lost_motion,
        "load_friction": lambda: {
            "friction_nm": 0.5 * log_uniform(rng, 2 * ARCSEC, 40 * ARCSEC) * k,
            "per_nm": log_uniform(rng, 0.05, 0.3),  # of the load: a gear of 70 to 95 % efficiency
        },
        "lost_motion_gravity": lambda: {"gap": log_uniform(rng, 0.01 * DEG, 0.04 * DEG)},
        "nonlinear_stiffness": lambda: {
            "contact_nm": float(rng.uniform(0.2, 0.6)) * float(load.max()),
            "soft": float(arm.compliance[j] * rng.uniform(0.5, 1.5)),
        },
        "cross_axis_compliance": lambda: {
            "k": log_uniform(rng, 1e-5, 4e-4),
            "back": 1.0 if j == 0 else float(rng.random()),
        },
        "joint_coupling": lambda: {"k": signed(rng, 2e-4, 2e-3)},
        "payload": lambda: {
            "mass": log_uniform(rng, 0.2, 1.0),
            "at": [float(x) for x in arm.tool_cog + rng.normal(0, 0.02, 3)],
        },
        "gravity_direction": lambda: dict(
            zip(("about_x", "about_y"), vector(rng, 0.5 * DEG, 2 * DEG, 2), strict=False)
        ),
    }[kind]()


def draw(rng: np.random.Generator, arm: Arm, s: Session, visible: float) -> dict:
    """An effect whose lambda, by experiments, is at least `visible`."""
    tau = simulate(arm, s).machine.tau
    design, without = Design(arm, s), experiment(arm, s).tcp
    for _ in range(40):
        kind = pick(rng, sorted(SITES))
        site = pick(rng, SITES[kind])
        if kind in ("load_friction", "lost_motion_gravity", "nonlinear_stiffness"):
            if np.abs(tau[:, site["joint"] - 1]).max() < 0.01:
                continue
        effect = {"effect": kind, "site": site, "p": size(rng, arm, tau, kind, site)}
        moved = (without - experiment(arm, s, [effect]).tcp).ravel()
        if np.linalg.norm(design.project(moved)) / s.sigma >= visible:
            return effect
    raise Invisible
