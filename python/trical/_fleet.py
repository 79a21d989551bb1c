"""What arms of one kind have in common: a prior for those that were measured little."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ._results import Identified

if TYPE_CHECKING:  # whoever imports trical need not wait for NumPy
    import numpy as np
    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]

# by how much arms differ where nothing is known of their kind: standard deviations, mm, deg and deg/Nm
USUAL = {"a": 0.3, "d": 0.3, "alpha": 0.1, "beta": 0.1, "theta": 0.3, "c": 0.01}
ITERATIONS = 200


@dataclass(frozen=True)
class Kind:
    """What `arms` arms of one kind have in common.

    Of each parameter in `names` and `units`: `mean` is the kind's, `spread` the standard deviation of arms about it,
    and `sd` that of a further arm about `mean`, which is itself known from some arms only.
    """

    names: list[str]
    units: list[str]
    mean: Floats
    spread: Floats
    sd: Floats
    arms: int

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the prior for a further arm, for `identify(known=...)` and `trical identify --known`."""
        tables = [
            f'[[parameter]]\nname = "{name}"\nvalue = {mean:.9g}  # {unit}\nsd = {sd:.6g}\n'
            for name, unit, mean, sd in zip(self.names, self.units, self.mean, self.sd, strict=True)
        ]
        Path(path).write_text("\n".join([f"# a further arm of a kind of which {self.arms} were measured\n", *tables]))


def kind(arms: Sequence[Identified], usual: Mapping[str, float] | None = None) -> Kind:
    """Estimate what arms of one kind have in common, from calibrations of some of them.

    A hierarchical model: parameters of an arm are normal about the kind's mean with the kind's spread, those that were
    identified are normal about the arm's with their covariance; mean and spread by expectation maximization (Dempster,
    Laird and Rubin 1977). The nominal arm counts as one arm, and `usual`, by how much arms differ, as two: two arms
    that happen to be alike do not make the kind uniform.

    Args:
        arms: results of `identify` with the same robot file. Parameters that all have are used.
        usual: standard deviation of parameters by the first part of their names, by default {"a": 0.3, "d": 0.3,
            "alpha": 0.1, "beta": 0.1, "theta": 0.3, "c": 0.01} in mm, deg and deg/Nm; others are left out.

    Raises:
        ValueError: no arm, or no parameter that all have.
    """
    import numpy as np

    usual = USUAL if usual is None else usual
    of_arms = [
        {p["name"]: k for k, p in enumerate(a.parameters) if p["sd"] and p["name"].split("_")[0] in usual} for a in arms
    ]
    names = [name for name in of_arms[0] if all(name in own for own in of_arms)] if of_arms else []
    if not names:
        raise ValueError(f"kind: {len(of_arms)} arms, expected some that have parameters in common: {', '.join(usual)}")
    values, information = [], []
    for arm, own in zip(arms, of_arms, strict=True):
        at = [own[name] for name in names]
        of_values = arm.covariance[np.ix_(at, at)]
        # from SI to the units of the values
        unit = np.array([arm.parameters[k]["sd"] for k in at]) / np.sqrt(np.diag(of_values))
        values.append([arm.parameters[k]["value"] for k in at])
        information.append(np.linalg.inv(of_values * np.outer(unit, unit)))
    of_first = [arms[0].parameters[of_arms[0][name]] for name in names]
    nominal = np.array([p["nominal"] for p in of_first])
    before = np.array([usual[name.split("_")[0]] for name in names]) ** 2
    known, told = np.array(information), np.einsum("nij,nj->ni", information, values)
    mean, variance = np.mean(values, axis=0), before
    for _ in range(ITERATIONS):
        of_arm = np.linalg.inv(known + np.diag(1 / variance))
        arm_values = np.einsum("nij,nj->ni", of_arm, told + mean / variance)
        mean = (nominal + arm_values.sum(0)) / (1 + len(arms))
        off = np.einsum("nii->ni", of_arm) + (arm_values - mean) ** 2
        last, variance = variance, (2 * before + (nominal - mean) ** 2 + off.sum(0)) / (2 + len(arms))
        if np.abs(np.log(variance / last)).max() < 1e-6:
            break
    further = np.sqrt(variance * (1 + 1 / (1 + len(arms))))
    return Kind(names, [p["unit"] for p in of_first], mean, np.sqrt(variance), further, len(arms))
