"""The scene of the collision row: seven shapes on the arm's frames, five obstacles, 45 pairs, in three kinds of shape.

Written for everybody from one source: `scene_KIND.txt`, one shape a line (`frame x y z` and then `capsule r l`,
`box x y z` or `hull n ...`; frame 0 for what stands still), and `scene_KIND.toml`, as TriCal reads it. Capsules lie
along z of their frame, l is the length of the segment.
"""

import argparse
from pathlib import Path

import numpy as np

import arm

#: Radius and length of each link's shape, frames 1 to 6; the seventh is a tool 80 mm in front of the flange.
LINKS = [(0.09, 0.20), (0.08, 0.27), (0.07, 0.12), (0.06, 0.20), (0.05, 0.06), (0.04, 0.05), (0.02, 0.10)]
OBSTACLES = [
    ("table", (0.0, 0.0, -0.12), ("box", 0.8, 0.8, 0.02)),
    ("post a", (0.45, 0.35, 0.4), ("box", 0.05, 0.05, 0.8)),
    ("post b", (-0.45, -0.35, 0.4), ("box", 0.05, 0.05, 0.8)),
    ("pipe", (0.5, -0.3, 0.3), ("capsule", 0.05, 0.5)),
    ("crate", (-0.4, 0.4, 0.15), ("box", 0.2, 0.2, 0.3)),
]
KINDS = ("capsule", "box", "hull")


def hull(rng, size, n=48):
    """Points on an ellipsoid with these half axes."""
    v = rng.normal(size=(n, 3))
    return ("hull", n, *(v / np.linalg.norm(v, axis=1)[:, None] * size).ravel())


def shapes(kind):
    """(name, frame, place, shape) of all links, then of all obstacles."""
    rng = np.random.default_rng(arm.SEED + 3)
    for k, (r, length) in enumerate(LINKS):
        place = (0.0, 0.0, 0.08 if k == 6 else 0.0)
        shape = {
            "capsule": ("capsule", r, length),
            "box": ("box", 2 * r, 2 * r, length + 2 * r),
            "hull": hull(rng, (r, r, r + length / 2)),
        }[kind]
        yield f"link{k}", min(k + 1, 6), place, shape
    for name, place, shape in OBSTACLES:
        yield name, 0, place, hull(rng, (0.1, 0.1, 0.2)) if kind == "hull" else shape


def solid_toml(place, shape):
    """A shape as TriCal's cell file has it."""
    mm = lambda v: "[" + ", ".join(f"{1e3 * x:.9f}" for x in v) + "]"  # noqa: E731
    place = np.array(place)
    if shape[0] == "capsule":
        half = np.array([0.0, 0.0, shape[2] / 2])
        ends = f"from_mm = {mm(place - half)}, to_mm = {mm(place + half)}"
        return f'{{ shape = "capsule", {ends}, radius_mm = {1e3 * shape[1]:.9f} }}'
    if shape[0] == "box":
        return f'{{ shape = "box", center_mm = {mm(place)}, size_mm = {mm(shape[1:])} }}'
    points = place + np.reshape(shape[2:], (-1, 3))
    return f'{{ shape = "hull", points_mm = [{", ".join(map(mm, points))}] }}'


def geometry_toml(kind):
    """The cell's `[geometry]`: neighbours up to two links apart are not checked, as everywhere in the row."""
    near = [f'["link{i}", "link{j}"]' for i in range(7) for j in range(i + 1, min(i + 3, 7))]
    lines = ["[geometry]", "margin_mm = 0.2", "device = []", f"ignore = [{', '.join(near)}]"]
    for name, frame, place, shape in shapes(kind):
        place_of = f"[[geometry.link]]\nlink = {frame}" if frame else "[[geometry.obstacle]]"
        lines += [place_of, f'name = "{name}"', f"solids = [{solid_toml(place, shape)}]"]
    return "\n".join(lines) + "\n"


def write_all(folder):
    """The files of all kinds."""
    folder = Path(folder)
    for kind in KINDS:
        rows = (
            " ".join([str(frame), *(f"{x:.17g}" for x in place), shape[0], *(f"{x:.17g}" for x in shape[1:])])
            for _, frame, place, shape in shapes(kind)
        )
        (folder / f"scene_{kind}.txt").write_text("\n".join(rows) + "\n")
        cell = "".join(line for line in arm.cell_toml().splitlines(True) if "positions_mm" not in line)
        (folder / f"scene_{kind}.toml").write_text(cell.replace("[balls]\n", "") + geometry_toml(kind))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    write_all(parser.parse_args().folder)
