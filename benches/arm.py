"""The task that everybody is timed on, written once from a seed: an arm like the IRB 120, its touches and poses.

The arm is in modified Denavit-Hartenberg parameters (Craig): frame i from frame i - 1 is Rx(alpha) Tx(a) Rz(theta +
offset) Tz(d). Its truth is off nominal in 26 parameters (base pose 6, links 17, tool point 3), and in the elastic tasks
in the compliance of joints 2 to 6 as well: a joint gives way by coefficient times gravity torque. In m and rad.
Needs NumPy only; run as a script it writes the files.
"""

import argparse
from pathlib import Path

import numpy as np

SEED = 20260101
NOISE = 20e-6
#: alpha, a, d, theta offset; ABB's published lengths.
MDH = np.array(
    [
        [0.0, 0.0, 0.290, 0.0],
        [-np.pi / 2, 0.0, 0.0, -np.pi / 2],
        [0.0, 0.270, 0.0, 0.0],
        [-np.pi / 2, 0.070, 0.302, 0.0],
        [np.pi / 2, 0.0, 0.0, 0.0],
        [-np.pi / 2, 0.0, 0.072, np.pi],
    ]
)
LIMITS = np.deg2rad([[-165, 165], [-110, 110], [-110, 70], [-160, 160], [-120, 120], [-180, 180]])
MASS = np.array([3.067, 3.909, 2.944, 1.328, 0.546, 0.137])
COG = 1e-3 * np.array(
    [
        [0.10, -0.12, -51.59],
        [101.24, 0.78, -2.12],
        [57.91, 22.81, 1.06],
        [0.41, -0.15, -77.30],
        [0.06, -1.09, 0.04],
        [0.00, -0.17, -7.06],
    ]
)
TOOL = np.array([0.050, 0.020, 0.100])
TOOL_MASS, TOOL_COG = 1.7, np.array([0.005, -0.004, 0.055])
BALLS = np.array([[0.36, -0.15, 0.16], [0.36, 0.15, 0.16], [0.55, 0.0, 0.20]])
GRAVITY = np.array([0.0, 0.0, -9.80665])
#: Which of the 24 link parameters are identified. The rest does what base, tool or another offset does.
MASK = np.array(
    [[0, 0, 0, 0], [1, 1, 0, 1], [1, 1, 1, 1], [1, 1, 1, 1], [1, 1, 1, 1], [1, 1, 0, 0]],
    dtype=bool,
)
LINKS = int(MASK.sum())
RIGID, ELASTIC = LINKS + 9, LINKS + 14


def rpy_matrix(angles):
    """Rz(c) Ry(b) Rx(a)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles), np.sin(angles)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def unpack(v):
    """Link parameters, base rotation, base origin, tool point of a vector (links, base xyz rpy, tool, ...)."""
    dh = MDH.copy()
    dh[MASK] += v[:LINKS]
    return dh, rpy_matrix(v[LINKS + 3 : LINKS + 6]), v[LINKS : LINKS + 3], TOOL + v[LINKS + 6 : LINKS + 9]


def positions(q, v, torque=None):
    """Tool points (n, 3) at joint values q (n, 6); `torque` (n, 6) where the last five parameters are compliances."""
    dh, turn, origin, tool = unpack(v)
    theta = q + dh[:, 3]
    if torque is not None:
        theta[:, 1:] += v[RIGID:] * torque[:, 1:]
    c, s = np.cos(theta), np.sin(theta)
    ca, sa = np.cos(dh[:, 0]), np.sin(dh[:, 0])
    x, y, z = (np.full(len(q), t) for t in tool)
    for i in range(5, -1, -1):
        u, w, z = c[:, i] * x - s[:, i] * y + dh[i, 1], s[:, i] * x + c[:, i] * y, z + dh[i, 2]
        x, y, z = u, ca[i] * w - sa[i] * z, sa[i] * w + ca[i] * z
    return np.stack([x, y, z], axis=1) @ turn.T + origin


def frames(q, v, give=0.0):
    """Of every joint: the x axis before it (n, 6, 3) and where it starts, its z axis, its origin; all rotations."""
    dh, turn, origin, _ = unpack(v)
    n = len(q)
    x_before, o_before, z_axis, origins = (np.empty((n, 6, 3)) for _ in range(4))
    rotations = []
    r = np.broadcast_to(turn, (n, 3, 3))
    o = np.broadcast_to(origin, (n, 3))
    theta = q + dh[:, 3] + give
    c, s = np.cos(theta)[:, :, None], np.sin(theta)[:, :, None]
    ca, sa = np.cos(dh[:, 0]), np.sin(dh[:, 0])
    for i in range(6):
        x, y, z = r[:, :, 0], r[:, :, 1], r[:, :, 2]
        x_before[:, i], o_before[:, i] = x, o
        y1, z1 = ca[i] * y + sa[i] * z, ca[i] * z - sa[i] * y
        o = o + dh[i, 1] * x + dh[i, 2] * z1
        z_axis[:, i], origins[:, i] = z1, o
        r = np.stack([c[:, i] * x + s[:, i] * y1, c[:, i] * y1 - s[:, i] * x, z1], axis=2)
        rotations.append(r)
    return x_before, o_before, z_axis, origins, rotations


def gravity_torques(q, v):
    """What gravity does about each joint's axis, N m (n, 6)."""
    _, _, z_axis, origins, rotations = frames(q, v)
    mass, first = np.zeros(()), np.zeros((len(q), 3))
    out = np.empty((len(q), 6))
    for i in range(5, -1, -1):
        m, moment = MASS[i], MASS[i] * COG[i]
        if i == 5:
            m, moment = m + TOOL_MASS, moment + TOOL_MASS * TOOL_COG
        mass = mass + m
        first = first + m * origins[:, i] + rotations[i] @ moment
        out[:, i] = np.einsum("nk,nk->n", z_axis[:, i], np.cross(first - mass * origins[:, i], GRAVITY))
    return out


def truth(rng, elastic):
    """Parameters of the true arm: links off by 0.3 mm and 0.17 deg, base by 2 mm and 0.3 deg, tool by 1 mm."""
    links = np.column_stack([rng.normal(0, s, 6) for s in (3e-3, 3e-4, 3e-4, 3e-3)])[MASK]
    v = np.concatenate([links, rng.normal(0, 2e-3, 3), rng.normal(0, 5e-3, 3), rng.normal(0, 1e-3, 3)])
    return np.concatenate([v, rng.uniform(1e-5, 3e-5, 5)]) if elastic else v


def true_positions(q, v):
    """Where the tool point of the true arm is; torques are those of the true arm before it gives way."""
    return positions(q, v, gravity_torques(q, v) if len(v) == ELASTIC else None)


def random_joints(rng, n):
    """Joint values all over the limits (n, 6)."""
    return rng.uniform(LIMITS[:, 0], LIMITS[:, 1], (n, 6))


def touches(rng, v, n):
    """Joint values (n, 6) at which the true arm has its tool point on a ball, and which ball (0-based)."""
    q = random_joints(rng, 60 * n)
    ball = np.arange(len(q)) % 3
    for _ in range(40):
        miss = BALLS[ball] - true_positions(q, v)
        if np.abs(miss).max() < 1e-12:
            break
        jac = np.stack(
            [(true_positions(q + 1e-7 * e, v) - true_positions(q - 1e-7 * e, v)) / 2e-7 for e in np.eye(6)], 2
        )
        step = np.einsum("nij,nj->ni", np.linalg.pinv(jac, rcond=1e-3), miss)
        q = q + np.clip(step, -0.3, 0.3)
    alive = np.linalg.norm(BALLS[ball] - true_positions(q, v), axis=1) < 1e-10
    alive &= ((q > LIMITS[:, 0]) & (q < LIMITS[:, 1])).all(axis=1)
    keep = np.concatenate([np.flatnonzero(alive & (ball == b))[: -(-n // 3)] for b in range(3)])[:n]
    if len(keep) < n:
        raise RuntimeError(f"only {len(keep)} of {n} touches were found")
    return q[keep], ball[keep]


def readings(rng, q, ball, v):
    """What the indicators read (n, 3): ball minus tool point in the axes of the tool, with noise."""
    give = np.zeros_like(q)
    if len(v) == ELASTIC:
        give[:, 1:] = v[RIGID:] * gravity_torques(q, v)[:, 1:]
    rotation = frames(q, v, give)[4][5]
    return rng.normal(0, NOISE, (len(q), 3)) + np.einsum("nji,nj->ni", rotation, BALLS[ball] - true_positions(q, v))


def row_text(row):
    """A row of a CSV: angles to 1e-7 deg and lengths to 1e-6 mm, finer than any noise."""
    return ",".join(f"{x:.7f}" for x in row)


JOINTS = ",".join(f"q{j}_deg" for j in range(1, 7))


def write_touches(path, rng, v, n):
    """A recording of touches with the tool point on the balls."""
    write_readings(path, rng, *touches(rng, v, n), v)


def write_readings(path, rng, q, ball, v):
    """A recording of touches at these joint values, of these balls."""
    with open(path, "w") as f:
        f.write(f"ball,{JOINTS},ix_mm,iy_mm,iz_mm\n")
        for b, a, r in zip(ball, np.rad2deg(q), 1e3 * readings(rng, q, ball, v), strict=True):
            f.write(f"{b + 1},{row_text(a)},{row_text(r)}\n")


def write_points(path, rng, v, n, noise=NOISE, chunk=100_000):
    """A recording of tracker points in the frame of the nominal base, poses all over the limits."""
    with open(path, "w") as f:
        f.write(f"{JOINTS},x_mm,y_mm,z_mm\n")
        for start in range(0, n, chunk):
            q = np.deg2rad(np.rad2deg(random_joints(rng, min(chunk, n - start))).round(7))
            p = true_positions(q, v)
            rows = np.column_stack([np.rad2deg(q), 1e3 * (p + rng.normal(0, noise, p.shape))])
            f.write("\n".join(map(row_text, rows.tolist())) + "\n")


def read_points(path):
    """Joint values and positions of a recording of points."""
    data = np.loadtxt(path, delimiter=",", skiprows=1)
    return np.deg2rad(data[:, :6]), 1e-3 * data[:, 6:9]


def read_touches(path):
    """Joint values and the tool point's position, as somebody would work it out who knows the nominal arm.

    Position = ball - R(q) reading; with readings of some 20 um, a rotation off by 0.3 deg is worth 0.1 um.
    """
    data = np.loadtxt(path, delimiter=",", skiprows=1)
    q = np.deg2rad(data[:, 1:7])
    rotation = frames(q, np.zeros(RIGID))[4][5]
    return q, BALLS[data[:, 0].astype(int) - 1] - 1e-3 * np.einsum("nij,nj->ni", rotation, data[:, 7:10])


def robot_toml():
    """The nominal arm as TriCal reads it."""
    lines = ['name = "IRB 120 of the benchmarks"']
    for (alpha, a, d, offset), limit, mass, cog in zip(MDH, LIMITS, MASS, COG, strict=True):
        lines += [
            "[[joint]]",
            f"alpha_deg = {np.rad2deg(alpha):.9f}",
            f"a_mm = {1e3 * a:.9f}",
            f"d_mm = {1e3 * d:.9f}",
            f"theta_offset_deg = {np.rad2deg(offset):.9f}",
            f"limits_deg = [{np.rad2deg(limit[0]):.6f}, {np.rad2deg(limit[1]):.6f}]",
            f"mass_kg = {mass}",
            f"cog_mm = [{', '.join(f'{1e3 * c:.6f}' for c in cog)}]",
        ]
    return "\n".join(lines) + "\n"


def cell_toml():
    """Nominal base and tool, and where the balls are."""
    vector = lambda v: "[" + ", ".join(f"{1e3 * x:.6f}" for x in v) + "]"  # noqa: E731
    return f"""[base]
xyz_mm = [0.0, 0.0, 0.0]
zyx_deg = [0.0, 0.0, 0.0]
[tool]
tcp_mm = {vector(TOOL)}
mass_kg = {TOOL_MASS}
cog_mm = {vector(TOOL_COG)}
targets_mm = [{vector(TOOL)}]
[balls]
positions_mm = [{", ".join(map(vector, BALLS))}]
"""


def write_fleet(folder, arms):
    """A folder with a recording of each of `arms` arms, which are drawn as the others are.

    All touch where the nominal arm has its tool point on a ball, as one plan for all makes them: they read some mm.
    """
    folder.mkdir(exist_ok=True)
    for old in folder.iterdir():
        old.unlink()
    rng = np.random.default_rng(SEED + 3)
    q, ball = touches(rng, np.zeros(RIGID), 45)
    for k in range(arms):
        write_readings(folder / f"arm{k:04d}.csv", rng, q, ball, truth(rng, True))


def write_all(folder, big=1_000_000, arms=0):
    """All files of the task. `big` is the number of rows of the largest recording, `arms` the fleet's; 0 for none."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot.toml").write_text(robot_toml())
    (folder / "cell.toml").write_text(cell_toml())
    for kind, elastic in (("rigid", False), ("elastic", True)):
        rng = np.random.default_rng(SEED + elastic)
        v = truth(rng, elastic)
        write_touches(folder / f"{kind}_touches.csv", rng, v, 45)
        write_points(folder / f"{kind}_heldout.csv", rng, v, 500, noise=0.0)
        write_points(folder / f"{kind}_points.csv", rng, v, 1000)
        if elastic and big:
            write_points(folder / f"{kind}_big.csv", rng, v, big)
    rng = np.random.default_rng(SEED + 2)
    np.savetxt(folder / "joints.txt", random_joints(rng, 1000), fmt="%.17g")
    if arms:
        write_fleet(folder / "fleet", arms)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("big", type=int, nargs="?", default=1_000_000, help="rows of the largest recording; 0 for none")
    parser.add_argument("arms", type=int, nargs="?", default=0, help="arms of the fleet")
    write_all(**vars(parser.parse_args()))
