"""Where the arm is sent: touches of the balls and tracker poses, by an inverse kinematics of our own.

Newton (Levenberg-Marquardt) from random seeds on many targets at once; what does not converge, breaks a limit or comes
near the table or the column is thrown away. Rough on purpose: the proof needs believable configurations, not a
planner.
"""

from __future__ import annotations

import numpy as np

from plant import DEG, MM, Arm, frames, point_jacobian, rot


def flange(arm: Arm, q: np.ndarray):
    """Frames and tool point (N, 3) of a rigid arm without errors."""
    rs, os = frames(arm, q + arm.offset)
    return rs, os, os[:, 5] + rs[:, 5] @ arm.tcp


def rotation_error(r: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """World-frame rotation vector that is zero at the goal; good to first order near it, monotonic far off."""
    d = goal @ np.swapaxes(r, 1, 2)
    return 0.5 * np.stack([d[:, 2, 1] - d[:, 1, 2], d[:, 0, 2] - d[:, 2, 0], d[:, 1, 0] - d[:, 0, 1]], -1)


def solve(arm: Arm, seeds: np.ndarray, points: np.ndarray, orientations: np.ndarray, steps: int = 40):
    """Joint angles (N, 6) and whether each reached its pose."""
    q = seeds.copy()
    scale = 0.15  # m per rad: weighs orientation against position
    for _ in range(steps):
        rs, os, p = flange(arm, q)
        e = np.concatenate([points - p, scale * rotation_error(rs[:, 5], orientations)], 1)
        jac = np.concatenate([point_jacobian(rs, os, p), scale * np.swapaxes(rs[..., 2], 1, 2)], 1)
        jt = np.swapaxes(jac, 1, 2)
        damp = 1e-6 + 0.01 * np.sum(e**2, 1)
        dq = np.linalg.solve(jt @ jac + damp[:, None, None] * np.eye(6), (jt @ e[..., None]))[..., 0]
        big = np.abs(dq).max(1, keepdims=True)
        q = q + dq * np.minimum(1.0, 0.5 / np.maximum(big, 1e-12))
    q = (q + np.pi) % (2 * np.pi) - np.pi
    rs, os, p = flange(arm, q)
    ok = (np.linalg.norm(points - p, axis=1) < 1e-6) & (
        np.linalg.norm(goal_gap(rs[:, 5], orientations), axis=(1, 2)) < 1e-5
    )
    return q, ok


def goal_gap(r, goal):
    return r - goal


def free(arm: Arm, q: np.ndarray, table_z: float) -> np.ndarray:
    """Within limits with two degrees to spare, joints away from the column, above the table (world z, m)."""
    low, high = arm.limits[:, 0] + 2 * DEG, arm.limits[:, 1] - 2 * DEG
    ok = ((q > low) & (q < high)).all(1)
    _, os, p = flange(arm, q)
    elbow = os[:, 2]
    wrist, end = os[:, 4], os[:, 5]
    for point, clearance in ((elbow, 60 * MM), (0.5 * (elbow + wrist), 60 * MM), (wrist, 70 * MM), (end, 40 * MM)):
        ok &= point[:, 2] > table_z + clearance * arm.size
    axis = arm.base_xyz[:2]
    for point in (wrist, end, 0.5 * (end + p)):
        ok &= (np.linalg.norm(point[:, :2] - axis, axis=1) > 110 * MM * arm.size) | (
            point[:, 2] > arm.base_xyz[2] + 560 * MM * arm.size
        )
    return ok


def device_orientations(rng: np.random.Generator, n: int, tilt_max: float) -> np.ndarray:
    """The device's z axis points down, tilted up to `tilt_max` to any side, with any roll."""
    tilt = np.arccos(rng.uniform(np.cos(tilt_max), 1.0, n))
    heading, roll = rng.uniform(-np.pi, np.pi, (2, n))
    return rot(2, heading) @ rot(1, tilt) @ rot(2, roll) @ rot(0, np.full(n, np.pi))


class Unreachable(Exception):
    """No configuration was found for a ball: the cell is drawn again."""


def second_plate(arm: Arm, rng: np.random.Generator) -> Arm:
    """The cell with three more balls, on a plate that stands high beside the first, tilted, with a known pose."""
    towards = arm.balls.mean(0)[:2] - arm.base_xyz[:2]
    heading = np.arctan2(towards[1], towards[0]) + rng.choice([-1, 1]) * rng.uniform(30, 100) * DEG
    far, high = rng.uniform(150, 350) * MM * arm.size, rng.uniform(420, 700) * MM * arm.size
    middle = arm.base_xyz + np.array([far * np.cos(heading), far * np.sin(heading), high])
    turn = rot(2, rng.uniform(-np.pi, np.pi)) @ rot(0, rng.uniform(-20, 20) * DEG)
    corners = 90 * MM * np.array([[np.cos(a), np.sin(a), 0.0] for a in (0.0, 2.1, 4.2)])
    return arm.but(balls=np.concatenate([arm.balls, np.round((middle + corners @ turn.T) / MM, 3) * MM]))


def touches(arm: Arm, rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """`n` configurations (N, 6), spread evenly over the balls, and the ball (0-based) of each."""
    count = len(arm.balls)
    per_ball = [n // count + (1 if k < n % count else 0) for k in range(count)]
    qs, ids = [], []
    for k, want in enumerate(per_ball):
        found, tries = np.empty((0, 6)), 0
        while len(found) < want:
            m = 4 * want + 60
            goal = device_orientations(rng, m, 60 * DEG)
            seeds = rng.uniform(arm.limits[:, 0] * 0.8, arm.limits[:, 1] * 0.8, (m, 6))
            if k < 3:
                seeds[:, 0] *= 0.4
            seeds[:, 5] = rng.uniform(-np.pi, np.pi, m)
            q, ok = solve(arm, seeds, np.broadcast_to(arm.balls[k], (m, 3)), goal)
            q = q[ok & free(arm, q, -60 * MM * arm.size)]
            found = np.concatenate([found, q])
            tries += 1
            if tries == 30 and len(found) < 5:
                raise Unreachable(f"ball {k + 1}")
        qs.append(found[:want])
        ids.append(np.full(want, k))
    return np.concatenate(qs), np.concatenate(ids)


def tracker(arm: Arm, rng: np.random.Generator, n: int) -> np.ndarray:
    """Configurations over the whole workspace, as for a validation with a laser tracker."""
    found = np.empty((0, 6))
    low, high = arm.limits[:, 0] * 0.85, arm.limits[:, 1] * 0.85
    low, high = np.maximum(low, -np.pi), np.minimum(high, np.pi)
    while len(found) < n:
        q = rng.uniform(low, high, (2 * n + 50, 6))
        _, _, p = flange(arm, q)
        keep = free(arm, q, arm.base_xyz[2]) & (p[:, 2] > arm.base_xyz[2] + 20 * MM * arm.size)
        found = np.concatenate([found, q[keep]])
    return found[:n]


def ordered(rng: np.random.Generator, q: np.ndarray, ball: np.ndarray, style: str) -> np.ndarray:
    """The order in which configurations are visited: `random`, ball after ball (`balls`), or each next the nearest
    (`path`)."""
    order = rng.permutation(len(q))
    if style == "balls":
        return order[np.argsort(rng.permutation(ball.max() + 1)[ball[order]], kind="stable")]
    if style == "path":
        left, now, out = list(order), np.zeros(6), []
        while left:
            k = int(np.argmin(np.abs(q[left] - now).max(1)))
            out.append(left.pop(k))
            now = q[out[-1]]
        return np.array(out)
    return order


def approaches(rng: np.random.Generator, q: np.ndarray, style: str) -> np.ndarray:
    """Sense of each joint's last motion (N, 6): as the arm `comes` from pose to pose, starting from its zero position,
    always from `one` side, as some procedures demand, or from `both` sides, rows in pairs."""
    come = np.sign(np.diff(np.concatenate([np.zeros((1, 6)), q]), axis=0)).astype(int)
    if style == "one":
        return np.broadcast_to(rng.choice([-1, 1], 6), q.shape).copy()
    if style == "both":
        come[1::2] = -come[: 2 * (len(q) // 2) : 2]
    return come


def clock(rng: np.random.Generator, n: int, spacing: float) -> np.ndarray:
    return np.round(np.cumsum(spacing * rng.uniform(0.8, 1.2, n)), 2)


def warm_up(rng: np.random.Generator, t: np.ndarray) -> np.ndarray:
    """The arm's temperature: towards a plateau with a time constant, on a room that wanders a little."""
    rise, tau = rng.uniform(2.0, 10.0), rng.uniform(1200.0, 5000.0)
    room = 0.3 * np.sin(2 * np.pi * (t / rng.uniform(3000, 9000) + rng.random()))
    return rng.uniform(19.0, 24.0) + rise * (1 - np.exp(-t / tau)) + room - room[0]


def loads(rng: np.random.Generator, n: int) -> np.ndarray:
    """A schedule of added mass (N, kg): mounted and taken off again in blocks, as one does it by hand."""
    blocks = int(rng.integers(2, 7))
    return np.where(np.arange(n) * blocks // n % 2 == 1, round(float(rng.uniform(0.4, 1.5)), 2), 0.0)
