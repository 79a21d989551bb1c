"""The mechanical effects as bodies and joints: a rotor and a link at every joint, springs, gaps and dry friction between them.

No formula of an effect is used here. Each joint is a link hinge and a rotor hinge on the same axis, held together by tendon
springs (the gear); the encoder sits on the rotor. From these parts come:

- `lost_motion_direction`: dry friction in the link's bearing winds the gear up, in the sense of the last motion;
- `load_friction`: the same, with friction that grows with the gear's load;
- `lost_motion_gravity`: a gap in the gear: the link falls onto one flank;
- `nonlinear_stiffness`: a soft spring beside a stiff one that takes part only beyond a gap;
- `cross_axis_compliance`: the link gives way about two more hinges, across its axis.

A pose is an experiment: the rotors come from the side that the recording's sense of motion says, the arm settles under gravity,
and the tool point is read.
"""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from effects import ARCSEC, log_uniform, pick
from plant import DEG, GRAVITY, Arm, Machine, Poses, Session, rot, simulate, zyx
from visible import Design

STEP = 1e-3
APPROACH = 0.2 * DEG
RAMP, SETTLE = 800, 250  # steps
SERVO, ROTOR = 1e8, 500.0  # N m/rad, kg m^2: the rotor follows its command to 3e-7 rad
RIGID = 2e5  # N m/rad, gear of a joint without compliance


def _quat(r: np.ndarray) -> str:
    x, y, z, w = Rotation.from_matrix(r).as_quat()
    return f"{w:.17g} {x:.17g} {y:.17g} {z:.17g}"


def _vec(v) -> str:
    return " ".join(f"{x:.17g}" for x in v)


def gear(arm: Arm, j: int) -> float:
    """Stiffness of joint j's gear (0-based), N m/rad."""
    return 1.0 / arm.compliance[j] if arm.compliance[j] > 0 else RIGID


def mjcf(arm: Arm, effect: dict | None) -> str:
    """The arm as MuJoCo sees it."""
    kind = effect["effect"] if effect else None
    at = effect["site"]["joint"] - 1 if effect else -1
    p = effect["p"] if effect else {}
    lines, tail, tendons, motors = [], [], [], []
    inertia = 'diaginertia="2e-3 2e-3 2e-3"'
    for j in range(6):
        place = f'pos="{_vec(rot(0, arm.alpha[j]) @ [arm.a[j], 0.0, arm.d[j]])}"'
        turn = f'quat="{_quat(rot(0, arm.alpha[j]) @ rot(2, arm.offset[j]))}"'
        k = gear(arm, j)
        damping = 2.0 * np.sqrt(k * 0.3)
        lines.append(
            f'<body {place} {turn}><joint name="rotor{j + 1}" type="hinge" axis="0 0 1" armature="{ROTOR}"/>'
            f'<inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/></body>'
        )
        friction = p["friction_nm"] if j == at and kind in ("lost_motion_direction", "load_friction") else 0.0
        lines.append(
            f'<body name="link{j + 1}" {place} {turn}><joint name="link{j + 1}" type="hinge" axis="0 0 1" armature="0.05" '
            f'frictionloss="{friction:.17g}" solreffriction="0.002 1" solimpfriction="0.9999 0.9999 0.001"/>'
        )
        if j == at and kind == "cross_axis_compliance":
            kc = 1.0 / p["k"]
            both = "".join(
                f'<joint type="hinge" axis="{a}" stiffness="{kc:.17g}" damping="{2 * np.sqrt(kc * 0.3):.6g}" armature="0.05"/>'
                for a in ("1 0 0", "0 1 0")
            )
            lines.append(
                f'<inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/><body>{both}'
            )
            tail.append("</body>")
        lines.append(f'<inertial pos="{_vec(arm.cog[j])}" mass="{arm.mass[j]:.17g}" {inertia}/>')
        tail.append("</body>")
        pair = f'<joint joint="link{j + 1}" coef="1"/><joint joint="rotor{j + 1}" coef="-1"/></fixed>'
        gap, stiff = 0.0, k
        if j == at and kind == "lost_motion_gravity":
            gap = 0.5 * p["gap"]
        if j == at and kind == "nonlinear_stiffness":
            # soft up to the load `contact_nm`; beyond it the second spring brings the gear back to its stated stiffness
            soft = 1.0 / (arm.compliance[j] + p["soft"])
            tendons.append(
                f'<fixed name="soft{j + 1}" stiffness="{soft:.17g}" springlength="0 0">{pair}'
            )
            gap, stiff = p["contact_nm"] / soft, k - soft
        tendons.append(
            f'<fixed name="gear{j + 1}" stiffness="{stiff:.17g}" damping="{damping:.6g}" '
            f'springlength="{-gap:.17g} {gap:.17g}">{pair}'
        )
        motors.append(
            f'<position joint="rotor{j + 1}" kp="{SERVO:g}" kv="{2 * np.sqrt(SERVO * ROTOR):g}"/>'
        )
    tool = (
        f'<body><inertial pos="{_vec(arm.tool_cog)}" mass="{arm.tool_mass:.17g}" {inertia}/>'
        f'<site name="tcp" pos="{_vec(arm.tcp)}"/></body>'
    )
    return (
        f'<mujoco><compiler angle="radian" autolimits="true"/>'
        f'<option timestep="{STEP}" integrator="implicitfast" gravity="0 0 {-GRAVITY}" tolerance="1e-12"/>'
        f'<worldbody><body pos="{_vec(arm.base_xyz)}" quat="{_quat(zyx(arm.base_zyx))}">'
        + "".join(lines)
        + tool
        + "".join(tail)
        + f'</body></worldbody><tendon>{"".join(tendons)}</tendon><actuator>{"".join(motors)}</actuator></mujoco>'
    )


class Bench:
    """One arm with one effect (or none), ready for experiments."""

    def __init__(self, arm: Arm, effect: dict | None):
        self.arm, self.effect = arm, effect
        self.model = mujoco.MjModel.from_xml_string(mjcf(arm, effect))
        self.data = mujoco.MjData(self.model)
        adr = lambda name: int(self.model.joint(name).qposadr[0])  # noqa: E731
        self.rotor = [adr(f"rotor{j + 1}") for j in range(6)]
        self.link = [adr(f"link{j + 1}") for j in range(6)]
        self.at = effect["site"]["joint"] - 1 if effect else -1
        self.per_load = effect["p"].get("per_nm", 0.0) if effect and effect["effect"] == "load_friction" else 0.0

    def pose(self, q: np.ndarray, dirs: np.ndarray, sag: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tool point and flange orientation after the rotors came to `q` in the senses `dirs`; `sag` is where links start."""
        m, d = self.model, self.data
        mujoco.mj_resetData(m, d)
        start = q - APPROACH * dirs
        d.qpos[self.rotor] = start
        d.qpos[self.link] = start + sag
        d.ctrl[:] = start
        load = self.link[self.at]
        base = m.dof_frictionloss[load] if self.per_load else 0.0
        for i in range(RAMP + SETTLE):
            x = min(1.0, i / RAMP)
            d.ctrl[:] = start + (q - start) * x**3 * (10 - 15 * x + 6 * x**2)
            if self.per_load:
                spring = gear(self.arm, self.at) * (d.qpos[load] - d.qpos[self.rotor[self.at]])
                friction = base + self.per_load * abs(spring)
                m.dof_frictionloss[load] = friction
            mujoco.mj_step(m, d)
        if self.per_load:
            m.dof_frictionloss[load] = base
        mujoco.mj_forward(m, d)
        site = d.site("tcp")
        return site.xpos.copy(), site.xmat.reshape(3, 3).copy()


_benches: dict[str, Bench] = {}


def experiment(arm: Arm, s: Session, effects) -> Poses:
    """The counterpart of `plant.simulate`, by experiments in MuJoCo."""
    effect = effects[0] if effects else None
    text = mjcf(arm, effect) + repr(effect)
    if text not in _benches:
        if len(_benches) > 4:
            _benches.clear()
        _benches[text] = Bench(arm, effect)
    bench = _benches[text]
    sag = arm.compliance * simulate(arm, s, passes=2).machine.tau
    done = [bench.pose(s.q[i], s.dirs[i], sag[i]) for i in range(len(s.q))]
    ball = arm.balls[s.ball] if s.touch else None
    return Poses(np.array([x[0] for x in done]), np.array([x[1] for x in done]), ball, Machine(arm, s))


def _draw(rng, arm: Arm, tau: np.ndarray) -> dict:
    kind = pick(
        rng,
        ["lost_motion_direction", "load_friction", "lost_motion_gravity", "nonlinear_stiffness", "cross_axis_compliance"],
    )
    j = int(rng.integers(1, 7)) if kind in ("lost_motion_direction", "cross_axis_compliance") else int(rng.integers(2, 7))
    load = np.abs(tau[:, j - 1])
    k = gear(arm, j - 1)
    p = {
        "lost_motion_direction": lambda: {"friction_nm": 0.5 * log_uniform(rng, 5 * ARCSEC, 120 * ARCSEC) * k},
        "load_friction": lambda: {
            "friction_nm": 0.5 * log_uniform(rng, 2 * ARCSEC, 40 * ARCSEC) * k,
            "per_nm": log_uniform(rng, 10 * ARCSEC, 60 * ARCSEC) * k / load.max(),
        },
        "lost_motion_gravity": lambda: {"gap": log_uniform(rng, 0.01 * DEG, 0.04 * DEG)},
        "nonlinear_stiffness": lambda: {
            "contact_nm": float(np.quantile(load, rng.uniform(0.15, 0.5))),
            "soft": float(arm.compliance[j - 1] * rng.uniform(0.5, 1.5)),
        },
        "cross_axis_compliance": lambda: {"k": log_uniform(rng, 3e-5, 4e-4)},
    }[kind]()
    return {"effect": kind, "site": {"joint": j}, "p": p}


def signature(arm: Arm, s: Session, effect: dict) -> np.ndarray:
    """(3N): how the effect moves the tool point, seen as a residual."""
    return (experiment(arm, s, []).tcp - experiment(arm, s, [effect]).tcp).ravel()


def draw(rng: np.random.Generator, arm: Arm, s: Session):
    """A visible effect, the session, and the machine that has it."""
    tau = simulate(arm, s).machine.tau
    design = Design(arm, s)
    for _ in range(60):
        effect = _draw(rng, arm, tau)
        if np.linalg.norm(design.project(signature(arm, s, effect))) / s.sigma >= 6.0:
            return [effect], s, experiment
    raise RuntimeError("no visible mechanical effect was drawn")
