#!/usr/bin/env python3
"""A laboratory calibrates a fleet: a hundred simulated arms, each with its own flaws, on Dask's local cluster.

    pip install "dask[distributed]"
    python examples/fleet_dask.py --arms 100 --touches 15

Every arm is drawn from its number, touches three balls and leaves a recording (CSV); the calibrations run on the
workers, and fitted models come back by pickle. Then the arms say what is usual of their kind (`trical.kind`), and every
arm is calibrated again with that as a prior: even numbers with what the odd ones say, and the other way round. With
real recordings only `calibrate` is needed:

    futures = client.map(calibrate, paths, robot=robot, cell=cell)

For a cluster of machines replace `LocalCluster` by its scheduler's address; the paths must then be on a shared disk.
"""

from __future__ import annotations

import argparse
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import trical

Array = npt.NDArray[np.float64]
IRB120 = Path(__file__).resolve().parents[1] / "cells" / "irb120"
BALLS = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.15, 0.15 * np.sqrt(3.0), 0.0]])  # 300 mm apart, m
NOISE = 1e-5  # m, each reading


# ---- a simulated arm ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Arm:
    """A true arm: a rigid one, whose joints give way by `soft` (6,) rad/Nm."""

    rigid: trical.Model
    soft: Array

    def forward(self, q: Array) -> tuple[Array, Array]:
        """Positions (n, 3) m and rotations (n, 3, 3) of the tool for reported joints (n, 6) rad."""
        return self.rigid.forward(q + self.soft * self.rigid.gravity_torques(q))


def off(text: str, key: str, sd: float, rng: np.random.Generator) -> str:
    """A robot.toml or cell.toml with every number of a key drawn anew about its value."""

    def drawn(m: re.Match[str]) -> str:
        return f"{m[1]}{float(m[2]) + rng.normal(0, sd):.6f}"

    return re.sub(rf"^({key} *= *)(-?[\d.]+)", drawn, text, flags=re.MULTILINE)


def draw(number: int) -> Arm:
    """Arm `number`: lengths off by 0.3 mm, angles by 0.1 deg (standard deviations), joints that give way."""
    rng = np.random.default_rng([20, number])
    robot, cell = (IRB120 / "robot.toml").read_text(), (IRB120 / "cell.toml").read_text()
    for key, sd in (("a_mm", 0.3), ("d_mm", 0.3), ("alpha_deg", 0.1), ("theta_offset_deg", 0.1)):
        robot = off(robot, key, sd, rng)
    with tempfile.TemporaryDirectory() as place:
        files = Path(place) / "robot.toml", Path(place) / "cell.toml"
        files[0].write_text(robot)
        files[1].write_text(cell)
        rigid = trical.Model.nominal(*files)
    return Arm(rigid, np.radians(np.append(0.0, np.exp(rng.uniform(np.log(1e-3), np.log(1e-2), 5)))))


def touch(arm: Arm, rng: np.random.Generator, balls: Array) -> Array:
    """Joints (n, 6) rad at which the tool's point is within a few micrometres of each of the balls (n, 3)."""
    lower, upper = arm.rigid.limits.T
    q = np.full((len(balls), 6), np.nan)
    while (open_ := np.isnan(q[:, 0])).any():
        some = rng.uniform(0.8 * lower, 0.8 * upper, (open_.sum(), 6))
        for _ in range(30):
            miss = balls[open_] - arm.forward(some)[0]
            step = np.einsum("nij,nj->ni", np.linalg.pinv(arm.rigid.jacobian(some)[:, :3]), miss)
            some = some + step.clip(-0.3, 0.3)
        good = (np.linalg.norm(balls[open_] - arm.forward(some)[0], axis=1) < 5e-6) & (
            (some > lower) & (some < upper)
        ).all(1)
        q[np.flatnonzero(open_)[good]] = some[good]
    return q


def record(number: int, folder: Path, touches: int = 45) -> Path:
    """Measures arm `number` and writes its recording."""
    arm, rng = draw(number), np.random.default_rng([21, number])
    ball = rng.permutation(np.arange(touches) % 3)
    q = np.radians(np.round(np.degrees(touch(arm, rng, BALLS[ball])), 4))
    position, rotation = arm.forward(q)
    reading = np.einsum("nji,nj->ni", rotation, BALLS[ball] - position) + rng.normal(0, NOISE, q[:, :3].shape)
    path = folder / f"arm{number:03d}.csv"
    head = ",".join(["ball", *(f"q{j}_deg" for j in range(1, 7)), "ix_mm", "iy_mm", "iz_mm"])
    np.savetxt(
        path,
        np.column_stack([ball + 1, np.degrees(q), reading * 1e3]),
        fmt=["%d", *["%.4f"] * 6, *["%.3f"] * 3],
        delimiter=",",
        header=head,
        comments="",
    )
    return path


# ---- calibrating -------------------------------------------------------------------------------------------------


def calibrate(recording: Path, known: Path | None = None, *, robot: Path, cell: Path) -> trical.Identified | str:
    """What a worker does with one recording. Returns the fitted model, or the sentence that says why there is none:
    one spoilt recording must not stop the fleet."""
    try:
        return trical.identify(recording, robot=robot, cell=cell, folds=5, known=known)
    except (trical.TricalError, trical.NotConvergedError) as e:
        return str(e)


def errors_mm(number: int, model: trical.Model, poses: int = 200) -> Array:
    """Position errors (poses,) mm of a model of arm `number` where it never touched anything: about the balls."""
    arm, rng = draw(number), np.random.default_rng([22, number])
    way = rng.normal(size=(poses, 3))
    way *= 0.2 * rng.uniform(0, 1, (poses, 1)) ** (1 / 3) / np.linalg.norm(way, axis=1, keepdims=True)
    q = touch(arm, rng, np.array([0.15, 0.087, 0.1]) + way)
    miss: Array = np.linalg.norm(model.forward(q)[0] - arm.forward(q)[0], axis=1) * 1e3
    return miss


@contextmanager
def cluster(workers: int) -> Iterator[Any]:
    """A client of a local cluster of processes, without a dashboard."""
    from dask.distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None) as local,
        Client(local) as client,
    ):
        yield client


@dataclass(frozen=True)
class Calibrated:
    """What became of arm `number`: a result or why there is none, and errors elsewhere, mm; also with the prior."""

    number: int
    result: trical.Identified | str
    errors: Array | None
    by_kind: trical.Identified | str
    errors_by_kind: Array | None


def checked(client: Any, results: list[trical.Identified | str]) -> list[Array | None]:
    """Errors elsewhere of each arm that has a model."""
    good = [(n, r) for n, r in enumerate(results) if not isinstance(r, str)]
    checks = client.gather(client.map(errors_mm, [n for n, _ in good], [r.model for _, r in good]))
    errors: dict[int, Array] = dict(zip((n for n, _ in good), checks, strict=True))
    return [errors.get(n) for n in range(len(results))]


def calibrate_fleet(client: Any, arms: int, folder: Path, touches: int = 45) -> list[Calibrated]:
    """Records and calibrates arms 0 to arms - 1, at least two, first each alone, then as arms of one kind."""
    files = {"robot": IRB120 / "robot.toml", "cell": IRB120 / "cell.toml"}
    recordings = client.gather(client.map(record, range(arms), folder=folder, touches=touches))
    alone = client.gather(client.map(calibrate, recordings, **files))
    priors = [folder / "even.toml", folder / "odd.toml"]
    for k, prior in enumerate(priors):
        trical.kind([r for r in alone[k::2] if not isinstance(r, str)]).save(prior)
    of_others = [priors[1 - n % 2] for n in range(arms)]
    by_kind = client.gather(client.map(calibrate, recordings, of_others, **files))
    columns = alone, checked(client, alone), by_kind, checked(client, by_kind)
    return [Calibrated(n, *row) for n, row in enumerate(zip(*columns, strict=True))]


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--arms", type=int, default=100)
    parser.add_argument("--touches", type=int, default=45, help="of each arm")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, help="folder to keep recordings and models in")
    a = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary, cluster(a.workers) as client:
        folder = a.out or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        fleet = calibrate_fleet(client, a.arms, folder.resolve(), a.touches)
        nominal = trical.Model.nominal(IRB120 / "robot.toml", IRB120 / "cell.toml")
        before = client.gather(client.map(errors_mm, range(a.arms), model=nominal))
    for arm in fleet:
        if isinstance(arm.by_kind, str):
            print(f"arm {arm.number}: {arm.by_kind}")
        elif a.out:
            arm.by_kind.model.save(a.out / f"arm{arm.number:03d}.toml")
    print(f"{a.arms} arms, {a.touches} touches each; mean position error about the balls, mm:")
    print(f"nominal                    {np.mean(before):.4f}")
    for how, errors in (
        ("each arm alone", [arm.errors for arm in fleet]),
        ("with the kind as a prior", [arm.errors_by_kind for arm in fleet]),
    ):
        means = [e.mean() for e in errors if e is not None]
        if means:
            best, median, worst = np.quantile(means, [0, 0.5, 1])
            print(
                f"{how:26} {np.mean(means):.4f} (best arm {best:.4f}, median {median:.4f}, worst {worst:.4f}; "
                f"{len(means)} arms)"
            )
    return 0 if all(arm.errors_by_kind is not None for arm in fleet) else 1


if __name__ == "__main__":
    raise SystemExit(main())
