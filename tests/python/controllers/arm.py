"""Arms from robot files, as built and as their controllers think, by 4x4 transforms. SI units (m, rad, kg, N m)."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[3]
GRAVITY = 9.80665


def turn(axis: int, angle: float) -> np.ndarray:
    """The transform of a rotation about x, y or z (0, 1, 2)."""
    out = np.eye(4)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out[i, i] = out[j, j] = np.cos(angle)
    out[j, i] = np.sin(angle)
    out[i, j] = -np.sin(angle)
    return out


def shift(x: float, y: float, z: float) -> np.ndarray:
    """The transform of a translation, m."""
    out = np.eye(4)
    out[:3, 3] = x, y, z
    return out


def zyx(x: float, y: float, z: float, a: float, b: float, c: float) -> np.ndarray:
    """From mm and deg: R = Rz(a) Ry(b) Rx(c)."""
    a, b, c = np.radians([a, b, c])
    return shift(x / 1e3, y / 1e3, z / 1e3) @ turn(2, a) @ turn(1, b) @ turn(0, c)


def angles(t: np.ndarray) -> np.ndarray:
    """The three angles of `zyx`, deg."""
    r = t[:3, :3]
    return np.degrees(
        [np.arctan2(r[1, 0], r[0, 0]), np.arctan2(-r[2, 0], np.hypot(r[0, 0], r[1, 0])), np.arctan2(r[2, 1], r[2, 2])]
    )


def vector(t: np.ndarray) -> np.ndarray:
    """The rotation vector of a transform, rad."""
    w, *v = quaternion(t)
    v = np.array(v)
    n = np.linalg.norm(v)
    return np.zeros(3) if n < 1e-12 else v / n * 2 * np.arctan2(n, w)


def rodrigues(x: float, y: float, z: float, rx: float, ry: float, rz: float) -> np.ndarray:
    """From m and a rotation vector in rad."""
    angle = float(np.linalg.norm([rx, ry, rz]))
    out = shift(x, y, z)
    if angle > 1e-12:
        k = np.array([[0, -rz, ry], [rz, 0, -rx], [-ry, rx, 0]]) / angle
        out[:3, :3] = np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k
    return out


def quaternion(t: np.ndarray) -> np.ndarray:
    """w, x, y, z with w >= 0, from the eigenvector of Bar-Itzhack's matrix."""
    r = t[:3, :3]
    k = np.zeros((4, 4))
    k[0, 0] = np.trace(r)
    k[0, 1:] = k[1:, 0] = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    k[1:, 1:] = r + r.T - np.trace(r) * np.eye(3)
    q = np.linalg.eigh(k)[1][:, -1]
    return -q if q[0] < 0 else q


def from_quaternion(xyz: object, q: object) -> np.ndarray:
    """From mm and w, x, y, z."""
    w, *v = np.asarray(q, float) / np.linalg.norm(np.asarray(q, float))
    x, y, z = v
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    out = shift(*(np.asarray(xyz, float) / 1e3))
    out[:3, :3] = np.eye(3) + 2 * w * k + 2 * k @ k
    return out


@dataclass
class Tool:
    """What is on the flange: where its tip is, its load (kg, m in the flange's axes)."""

    at: np.ndarray
    mass: float = 0.0
    cog: np.ndarray = field(default_factory=lambda: np.zeros(3))


@dataclass
class Arm:
    """Craig's modified DH: rows of alpha, a, d, offset; what is wrong with a real arm is changed in a copy."""

    rows: np.ndarray
    root: np.ndarray
    flange: np.ndarray
    mass: np.ndarray
    cog: np.ndarray
    compliance: np.ndarray

    @classmethod
    def read(cls, file: str) -> Arm:
        """From a robot.toml; only numbers and lists of numbers are looked at."""
        head, *joints = (ROOT / file).read_text().split("[[joint]]")

        def values(text: str, name: str, default: str) -> np.ndarray:
            found = re.search(rf"^{name} *= *(.*?)(?:#.*)?$", text, re.M)
            return np.array(re.findall(r"-?[\d.]+", found.group(1) if found else default), float)

        def frame(name: str) -> np.ndarray:
            part = f"\n{head}".partition(f"\n[{name}]")[2].partition("\n[")[0]
            return zyx(*values(part, "xyz_mm", "0 0 0"), *values(part, "zyx_deg", "0 0 0"))

        rows = [
            [
                np.radians(values(j, "alpha_deg", "0")[0]),
                values(j, "a_mm", "0")[0] / 1e3,
                values(j, "d_mm", "0")[0] / 1e3,
                np.radians(values(j, "theta_offset_deg", "0")[0]),
            ]
            for j in joints
        ]
        mass = np.array([values(j, "mass_kg", "0")[0] for j in joints])
        cog = np.array([values(j, "cog_mm", "0 0 0") / 1e3 for j in joints])
        return cls(np.array(rows), frame("root"), frame("flange"), mass, cog, np.zeros(len(joints)))

    def chain(self, q: np.ndarray) -> list[np.ndarray]:
        """The frames of the links in the foot."""
        t, out = self.root, []
        for (alpha, a, d, offset), angle in zip(self.rows, q, strict=True):
            t = t @ turn(0, alpha) @ shift(a, 0, 0) @ turn(2, angle + offset) @ shift(0, 0, d)
            out.append(t)
        return out

    def hand(self, q: np.ndarray) -> np.ndarray:
        """The flange in the foot."""
        return self.chain(q)[-1] @ self.flange

    def reached(self, q: np.ndarray, tool: Tool) -> np.ndarray:
        """The tool in the foot, joints giving way under the weight of links and tool."""
        links = self.chain(q)
        bodies = [(m, t @ np.append(c, 1.0)) for m, t, c in zip(self.mass, links, self.cog, strict=True)]
        bodies.append((tool.mass, links[-1] @ self.flange @ np.append(tool.cog, 1.0)))
        torque = np.zeros(len(q))
        for k, t in enumerate(links):
            for m, at in bodies[k:]:
                torque[k] += np.cross(at[:3] - t[:3, 3], [0, 0, -GRAVITY * m]) @ t[:3, 2]
        return self.hand(q + self.compliance * torque) @ tool.at

    def solve(self, hand: np.ndarray, seed: np.ndarray) -> np.ndarray | None:
        """Joints with the flange there, by Newton's method from a seed; None where it does not get there."""
        q = np.array(seed, float)
        for _ in range(60):
            links = self.chain(q)
            here = links[-1] @ self.flange
            rest = np.concatenate([hand[:3, 3] - here[:3, 3], here[:3, :3] @ vector(here.T @ hand_turn(hand))])
            if np.linalg.norm(rest) < 1e-13:
                break
            j = np.array([[*np.cross(t[:3, 2], here[:3, 3] - t[:3, 3]), *t[:3, 2]] for t in links]).T
            step = np.linalg.lstsq(j, rest, rcond=1e-9)[0]
            q = q + step * min(1.0, 0.5 / np.abs(step).max())
        return q if np.linalg.norm(rest) < 1e-10 else None


def hand_turn(t: np.ndarray) -> np.ndarray:
    """The rotation alone."""
    out = np.eye(4)
    out[:3, :3] = t[:3, :3]
    return out
