"""Writes arms, cells and recordings as the project's file contract has them, and locks the truth away."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np

from plant import DEG, MM, Arm


def number(x: float, digits: int = 6) -> str:
    text = f"{round(float(x), digits):.{digits}f}".rstrip("0")
    text = text + "0" if text.endswith(".") else text
    return "0.0" if text in ("-0.0", "0.0") else text


def numbers(xs, digits: int = 6) -> str:
    return "[" + ", ".join(number(x, digits) for x in xs) + "]"


def robot_toml(arm: Arm) -> str:
    lines = [f'name = "{arm.name}"']
    for j in range(6):
        lines += [
            "",
            "[[joint]]",
            f"alpha_deg = {number(arm.alpha[j] / DEG)}",
            f"a_mm = {number(arm.a[j] / MM)}",
            f"d_mm = {number(arm.d[j] / MM)}",
            f"theta_offset_deg = {number(arm.offset[j] / DEG)}",
            f"limits_deg = {numbers(arm.limits[j] / DEG)}",
            f"mass_kg = {number(arm.mass[j])}",
            f"cog_mm = {numbers(arm.cog[j] / MM)}",
        ]
    return "\n".join(lines) + "\n"


def cell_toml(arm: Arm) -> str:
    p = arm.balls / MM
    sides = [np.linalg.norm(p[a] - p[b]) for a, b in ((0, 1), (0, 2), (1, 2))]
    d12, d13, d23 = (number(x) for x in sides)
    balls = f"distances_mm = {{ d12 = {d12}, d13 = {d13}, d23 = {d23} }}"
    if len(p) > 3:
        balls = "positions_mm = [" + ", ".join(numbers(x) for x in p) + "]"
    return (
        f"[base]\nxyz_mm = {numbers(arm.base_xyz / MM)}\nzyx_deg = {numbers(arm.base_zyx / DEG)}\n\n"
        f"[tool]\ntcp_mm = {numbers(arm.tcp / MM)}\nmass_kg = {number(arm.tool_mass)}\n"
        f"cog_mm = {numbers(arm.tool_cog / MM)}\n\n"
        f"[balls]\n{balls}\n"
    )


def csv(columns: dict[str, tuple[np.ndarray, int]]) -> str:
    """`columns` maps a name to its values and the digits after the point; 0 digits are integers."""
    rows = zip(*(values for values, _ in columns.values()), strict=True)
    digits = [d for _, d in columns.values()]
    lines = [",".join(columns)]
    for row in rows:
        cells = []
        for x, d in zip(row, digits, strict=True):
            text = f"{x:.{d}f}" if d else str(int(x))
            cells.append(text[1:] if text.startswith("-") and float(text) == 0 else text)
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def seal(truth: dict, path: Path) -> str:
    """Writes the truth and returns its SHA-256, which is printed before any diagnosis runs."""
    data = json.dumps(truth, indent=1, sort_keys=True).encode()
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    return hashlib.sha256(data).hexdigest()
