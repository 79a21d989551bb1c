"""Arms to draw from: the IRB 120 kind, and others that differ in what matters to a diagnosis.

`universal`: three parallel axes and no spherical wrist; `shoulder`: the first axis does not meet the second, the fourth
passes beside the elbow; `large`: 1.6 m and 200 kg, fifty times the torques. Lengths and masses are those of no certain
machine.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from plant import DEG, MM, Arm, triangle


@dataclass
class Kind:
    """Lengths mm, angles deg, masses kg, centres of gravity mm; `size`, `weight`, `pull` are lengths, masses, and
    torques in units of the IRB 120 kind's."""

    name: str
    alpha: list
    a: list
    d: list
    offset: list
    limits: list
    mass: list
    cog: list
    size: float = 1.0
    weight: float = 1.0
    pull: float = 1.0


SMALL = Kind(
    name="arm of the IRB 120 kind",
    alpha=[0, -90, 0, -90, 90, -90],
    a=[0, 0, 270, 70, 0, 0],
    d=[290, 0, 0, 302, 0, 72],
    offset=[0, -90, 0, 0, 0, 180],
    limits=[[-165, 165], [-110, 110], [-110, 70], [-160, 160], [-120, 120], [-400, 400]],
    mass=[3.067, 3.909, 2.944, 1.328, 0.546, 0.137],
    cog=[[0, 0, -50], [105, 1, 2], [58, 10, 10], [0, -1, -70], [0, 0, 0], [0, 0, -7]],
)

OTHERS = {
    "universal": Kind(
        name="arm with three parallel axes",
        alpha=[0, 90, 0, 0, 90, -90],
        a=[0, 0, -430, -390, 0, 0],
        d=[160, 0, 0, 135, 100, 100],
        offset=[0, 0, 0, 0, 0, 0],
        limits=[[-360, 360], [-360, 360], [-160, 160], [-360, 360], [-360, 360], [-360, 360]],
        mass=[3.7, 8.0, 2.9, 1.3, 1.3, 0.4],
        cog=[[0, -2, -25], [-210, 0, 112], [-240, 0, 26], [0, -2, 16], [0, 2, 16], [0, 0, -23]],
        size=1.4,
        weight=1.5,
        pull=2.5,
    ),
    "shoulder": Kind(
        name="arm with an offset shoulder",
        alpha=[0, -90, 0, -90, 90, -90],
        a=[0, 30, 320, 40, 0, 0],
        d=[390, 0, 0, 370, 0, 80],
        offset=[0, -90, 0, 0, 0, 180],
        limits=[[-170, 170], [-100, 135], [-120, 75], [-185, 185], [-120, 120], [-350, 350]],
        mass=[11.0, 12.0, 8.5, 4.5, 1.8, 0.3],
        cog=[[10, 5, -120], [140, -5, 30], [45, -15, 10], [0, 4, -120], [0, -10, 5], [0, 0, -12]],
        size=1.25,
        weight=2.0,
        pull=3.5,
    ),
    "large": Kind(
        name="large arm",
        alpha=[0, -90, 0, -90, 90, -90],
        a=[0, 150, 700, 115, 0, 0],
        d=[445, 0, 0, 795, 0, 85],
        offset=[0, -90, 0, 0, 0, 180],
        limits=[[-175, 175], [-95, 150], [-160, 70], [-200, 200], [-120, 120], [-400, 400]],
        mass=[68.0, 52.0, 44.0, 24.0, 7.0, 1.0],
        cog=[[60, -10, -130], [330, 20, -60], [70, -30, 10], [5, 5, -310], [0, -20, 0], [0, 0, -15]],
        size=2.7,
        weight=6.0,
        pull=50.0,
    ),
}


def nominal_arm(rng: np.random.Generator | None = None, kind: Kind = SMALL) -> Arm:
    """An arm as its maker describes it; with a generator, another of that kind in another cell."""
    a, d = np.array(kind.a, float), np.array(kind.d, float)
    mass, cog = np.array(kind.mass), np.array(kind.cog, float)
    tcp = np.array([18.0, -12.0, 118.0])
    # the balls before the arm, on a table below its foot
    base = np.array([150.0, 87.0 - 417.0 * kind.size, -150.0 * kind.size])
    tool_mass, tool_cog, sides = 1.7, np.array([5.0, -4.0, 55.0]), np.full(3, 300.0)
    if rng is not None:
        if rng.random() < 0.5:
            a = np.round(a * rng.uniform(0.93, 1.10, 6))
            d = np.round(d * rng.uniform(0.93, 1.10, 6))
            mass = np.round(mass * rng.uniform(0.8, 1.25, 6), 3)
            cog = np.round(cog * rng.uniform(0.85, 1.15, (6, 3)), 1)
        base = base + np.round(rng.uniform(-25, 25, 3))
        tcp = tcp + np.round(rng.uniform(-8, 8, 3))
        tool_mass = round(float(rng.uniform(1.2, 2.0)), 2)
        tool_cog = tool_cog + np.round(rng.uniform(-5, 5, 3))
        sides = np.round(sides + rng.uniform(-5, 5, 3), 3)
    return Arm(
        alpha=np.array(kind.alpha, float) * DEG,
        a=a * MM,
        d=d * MM,
        offset=np.array(kind.offset, float) * DEG,
        limits=np.array(kind.limits, float) * DEG,
        mass=mass,
        cog=cog * MM,
        base_xyz=base * MM,
        base_zyx=np.array([90.0, 0.0, 0.0]) * DEG,
        tcp=tcp * MM,
        tool_mass=tool_mass,
        tool_cog=tool_cog * MM,
        balls=triangle(*(sides * MM)),
        name=kind.name,
        size=kind.size,
        weight=kind.weight,
        pull=kind.pull,
    )
