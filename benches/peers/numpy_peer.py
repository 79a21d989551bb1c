"""NumPy and SciPy by hand: all poses at once, analytic Jacobian; what a good programmer writes in a day."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))
from measure import FOLDER, cpu_time, report, wants  # isort: skip  (threads are limited before NumPy loads)

import numpy as np
import scipy.linalg
from scipy.optimize import least_squares

import arm

COLUMN = np.flatnonzero(arm.MASK.ravel())


def cross(a, b):
    """As np.cross along the last axis, without its overhead."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out


def linearize(q, p, v, torque=None):
    """Residual (3n,) and Jacobian (3n, parameters), analytic, all poses at once."""
    n = len(q)
    give = 0.0
    if torque is not None:
        give = np.zeros((n, 6))
        give[:, 1:] = v[arm.RIGID :] * torque[:, 1:]
    x, o, z, origin, rotations = arm.frames(q, v, give)
    _, _, base, tool = arm.unpack(v)
    point = origin[:, 5] + rotations[5] @ tool
    arms = point[:, None]
    links = np.empty((n, 6, 4, 3))
    links[:, :, 0] = cross(x, arms - o)
    links[:, :, 1] = x
    links[:, :, 2] = z
    links[:, :, 3] = cross(z, arms - origin)
    out = np.empty((n, len(v), 3))
    k = arm.LINKS
    out[:, :k] = links.reshape(n, 24, 3)[:, COLUMN]
    out[:, k : k + 3] = np.eye(3)
    pitch, yaw = v[k + 4 : k + 6]
    cy, sy, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    axes = np.array([[cy * cp, sy * cp, -sp], [-sy, cy, 0.0], [0.0, 0.0, 1.0]])
    out[:, k + 3 : k + 6] = cross(axes, (point - base)[:, None])
    out[:, k + 6 : k + 9] = rotations[5].transpose(0, 2, 1)
    if torque is not None:
        out[:, arm.RIGID :] = links[:, 1:, 3] * torque[:, 1:, None]
    return (point - p).ravel(), out.transpose(0, 2, 1).reshape(3 * n, -1)


def gauss_newton(q, p, parameters):
    """Solved by SVD of the Jacobian; `torque` is that of the nominal arm, computed once."""
    v, torque = start(q, parameters)
    for _ in range(20):
        r, jacobian = linearize(q, p, v, torque)
        step = np.linalg.lstsq(jacobian, -r, rcond=None)[0]
        v = v + step
        if np.abs(step).max() < 1e-9:
            break
    return v


def normal_equations(q, p, parameters, chunk=20_000):
    """The same over sums of J'J and J'r, chunk by chunk."""
    v, torque = np.zeros(parameters), None
    if parameters == arm.ELASTIC:
        torque = np.concatenate([arm.gravity_torques(q[i : i + chunk], v) for i in range(0, len(q), chunk)])
    for _ in range(20):
        a, b = np.zeros((parameters, parameters)), np.zeros(parameters)
        for i in range(0, len(q), chunk):
            part = slice(i, i + chunk)
            r, jacobian = linearize(q[part], p[part], v, None if torque is None else torque[part])
            a += jacobian.T @ jacobian
            b += jacobian.T @ r
        step = scipy.linalg.solve(a, -b, assume_a="pos")
        v = v + step
        if np.abs(step).max() < 1e-9:
            break
    return v


def start(q, parameters):
    """Nominal parameters, and gravity torques where they are needed."""
    v = np.zeros(parameters)
    return v, arm.gravity_torques(q, v) if parameters == arm.ELASTIC else None


def by_scipy(q, p, parameters, jacobian):
    """SciPy's least squares, as many calibrations in Python are written."""
    v, torque = start(q, parameters)
    extra = {"jac": lambda x: linearize(q, p, x, torque)[1]} if jacobian else {}
    residual = lambda x: (arm.positions(q, x, torque) - p).ravel()  # noqa: E731
    return least_squares(residual, v, method="lm", x_scale="jac", xtol=1e-12, ftol=1e-12, gtol=1e-12, **extra).x


def held_out(kind, v):
    """RMS error at poses that no fit has seen, in words."""
    q, p = arm.read_points(FOLDER / f"{kind}_heldout.csv")
    torque = arm.gravity_torques(q, np.zeros(len(v))) if len(v) == arm.ELASTIC else None
    return f"{1e6 * np.sqrt(np.mean(np.sum((arm.positions(q, v, torque) - p) ** 2, axis=1))):.2f} um"


def identification():
    """All identification rows."""
    for kind, parameters in (("rigid", arm.RIGID), ("elastic", arm.ELASTIC)):
        for what, read in (("45 touches", arm.read_touches), ("1000 poses", arm.read_points)):
            row = f"identification, {what}, {parameters} parameters"
            if not wants(row):
                continue
            q, p = read(FOLDER / f"{kind}_{'touches' if 'touches' in what else 'points'}.csv")
            ways = [
                (
                    "NumPy by hand, analytic Jacobian, Gauss-Newton",
                    lambda q=q, p=p, n=parameters: gauss_newton(q, p, n),
                    "numpy",
                ),
                (
                    "NumPy by hand, analytic, normal equations",
                    lambda q=q, p=p, n=parameters: normal_equations(q, p, n),
                    "numpy",
                ),
                (
                    "SciPy least_squares (lm), by hand: analytic Jacobian",
                    lambda q=q, p=p, n=parameters: by_scipy(q, p, n, True),
                    "scipy",
                ),
                (
                    "SciPy least_squares (lm), by hand: forward function, differences",
                    lambda q=q, p=p, n=parameters: by_scipy(q, p, n, False),
                    "scipy",
                ),
            ]
            for who, fit, package in ways:
                report(row, who, cpu_time(fit), held_out(kind, fit()), package)
    row = "identification, 1000000 poses, 31 parameters"
    if wants(row) and (FOLDER / "elastic_big.csv").exists():
        from time import process_time

        begun = process_time()
        q, p = arm.read_points(FOLDER / "elastic_big.csv")
        read = process_time() - begun
        found = []
        spent = cpu_time(lambda: found.append(normal_equations(q, p, arm.ELASTIC)))
        words = held_out("elastic", found[-1])
        report(row, "NumPy by hand, analytic, normal equations", spent, words, "numpy")
        report(
            "identification, 1000000 poses from CSV",
            "NumPy by hand, loadtxt and normal equations",
            spent + read,
            words,
            "numpy",
        )


def identifiability():
    """Which of 45 candidates are independent, by a pivoted QR of the Jacobian at 100 random poses."""
    rng = np.random.default_rng(7)
    q = arm.random_joints(rng, 100)

    def rank():
        x, o, z, origin, rotations = arm.frames(q, np.zeros(arm.RIGID))
        point = origin[:, 5] + rotations[5] @ arm.TOOL
        arms = point[:, None]
        y = cross(z, x)  # Hayati's beta turns about y
        blocks = [cross(x, arms - o), x, z, cross(z, arms - origin), cross(y, arms - origin)]
        columns = np.concatenate([*blocks, np.broadcast_to(np.eye(3), (len(q), 3, 3))], axis=1)
        columns = np.concatenate([columns, cross(np.eye(3), arms), rotations[5].transpose(0, 2, 1)], axis=1)
        torque = arm.gravity_torques(q, np.zeros(arm.RIGID))
        columns = np.concatenate([columns, blocks[3] * torque[:, :, None]], axis=1)
        jacobian = columns.transpose(0, 2, 1).reshape(300, -1)
        length = np.linalg.norm(jacobian, axis=0)
        r = scipy.linalg.qr(jacobian / np.where(length > 0, length, 1.0), mode="r", pivoting=True)[0]
        return int((np.abs(np.diag(r)) > 1e-9 * abs(r[0, 0])).sum()), jacobian.shape[1]

    report(
        "identifiability",
        "NumPy and SciPy by hand, pivoted QR at 100 poses: rank only",
        cpu_time(rank),
        "{} of {}".format(*rank()),
        "scipy",
    )


def observability():
    """Condition of the Jacobian with columns of unit length, at 45 touches."""
    q, p = arm.read_touches(FOLDER / "rigid_touches.csv")
    v = gauss_newton(q, p, arm.RIGID)

    def condition():
        jacobian = linearize(q, p, v)[1]
        s = np.linalg.svd(jacobian / np.linalg.norm(jacobian, axis=0), compute_uv=False)
        return s[0] / s[-1]

    report("observability", "NumPy by hand, SVD", cpu_time(condition), f"condition {condition():.4f}", "numpy")


def choice():
    """45 of 900 by the determinant: greedy, then exchanges, judged by 3 x 3 determinants of all at once."""
    q = np.loadtxt(FOLDER / "joints.txt")[:900]

    def choose(size=45):
        jacobian = linearize(q, np.zeros((len(q), 3)), np.zeros(arm.RIGID))[1]
        factor = np.linalg.qr(jacobian, mode="r")
        z = scipy.linalg.solve_triangular(factor.T, jacobian.T, lower=True).T.reshape(len(q), 3, -1)
        chosen, information = [], 1e-3 * np.eye(z.shape[2])
        gain = lambda inverse: np.linalg.det(np.eye(3) + z @ inverse @ z.transpose(0, 2, 1))  # noqa: E731
        for _ in range(size):
            worth = gain(np.linalg.inv(information))
            worth[chosen] = 0.0
            best = int(worth.argmax())
            chosen.append(best)
            information = information + z[best].T @ z[best]
        information = sum(z[i].T @ z[i] for i in chosen)
        for _ in range(20):
            changed = False
            for k, i in enumerate(list(chosen)):
                without = information - z[i].T @ z[i]
                worth = gain(np.linalg.inv(without))
                worth[[j for j in chosen if j != i]] = 0.0
                best = int(worth.argmax())
                if worth[best] > worth[i] * (1 + 1e-9):
                    chosen[k], changed = best, True
                    information = without + z[best].T @ z[best]
            if not changed:
                break
        return chosen

    chosen = choose()
    report(
        "choice of configurations",
        "NumPy by hand, greedy start, exchanges",
        cpu_time(choose, 3),
        worth_of(q, chosen),
        "numpy",
    )


def worth_of(q, chosen):
    """Information per parameter of a choice as a multiple of what the pool has on average, in words."""
    jacobian = linearize(q, np.zeros((len(q), 3)), np.zeros(arm.RIGID))[1].reshape(len(q), 3, -1)
    det = lambda block: np.linalg.slogdet(np.einsum("nij,nik->jk", block, block) / len(block))[1]  # noqa: E731
    gain = np.exp((det(jacobian[chosen]) - det(jacobian)) / arm.RIGID)
    return f"information per parameter {gain:.4f} of the pool's"


def kinematics():
    """Forward positions and parameter Jacobians of 1000 poses at once, per pose."""
    q = np.loadtxt(FOLDER / "joints.txt")
    v, w = np.zeros(arm.RIGID), np.zeros(arm.ELASTIC)
    torque, nothing = arm.gravity_torques(q, v), np.zeros((len(q), 3))
    if wants("forward kinematics"):
        report(
            "forward kinematics",
            "NumPy by hand, 1000 poses at once",
            cpu_time(lambda: arm.positions(q, v)) / len(q),
            "",
            "numpy",
        )
    if wants("parameter Jacobian"):
        spent = cpu_time(lambda: linearize(q, nothing, v)) / len(q)
        report("parameter Jacobian", "NumPy by hand, 1000 poses at once", spent, "3 x 26", "numpy")
    if wants("parameter Jacobian with compliance"):
        spent = cpu_time(lambda: linearize(q, nothing, w, torque)) / len(q)
        report(
            "parameter Jacobian with compliance",
            "NumPy by hand, 1000 poses at once, torques ready",
            spent,
            "3 x 31",
            "numpy",
        )


if __name__ == "__main__":
    kinematics()
    identification()
    for row, run in (
        ("identifiability", identifiability),
        ("observability", observability),
        ("choice of configurations", choice),
    ):
        if wants(row):
            run()
