"""What a diagnosis found, as plain data: findings, places, what has no known cause, what could not be seen."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any, TypeVar

T = TypeVar("T", bound="Record")

_NAMES = {"lambda": "lambda_", "from": "from_"}
"""Keys of the JSON that are words of Python."""


class Record:
    """A dataclass whose fields can also be read by their key in the command's JSON: `f.effect` is `f["effect"]`."""

    __slots__ = ()

    @classmethod
    def of(cls: type[T], said: dict[str, Any]) -> T:
        """Build it from the JSON; keys that this class does not have stay in `Diagnosis.answer`."""
        known = {f.name for f in fields(cls)}  # type: ignore[arg-type]
        return cls(**{name: v for k, v in said.items() if (name := _NAMES.get(k, k)) in known})

    def keys(self) -> list[str]:
        """Return the keys of what is given, as in the JSON."""
        back = {v: k for k, v in _NAMES.items()}
        names = [f.name for f in fields(self)]  # type: ignore[arg-type]
        return [back.get(name, name) for name in names if getattr(self, name) is not None]

    def __iter__(self) -> Iterator[str]:
        """Go through the keys."""
        return iter(self.keys())

    def __getitem__(self, key: str) -> Any:
        """Return a field by its key in the JSON."""
        name = _NAMES.get(key, key)
        if name not in {f.name for f in fields(self)}:  # type: ignore[arg-type]
            raise KeyError(key)
        return getattr(self, name)

    def get(self, key: str, default: Any = None) -> Any:
        """Return a field by its key in the JSON, or the default where there is none."""
        return self[key] if key in self.keys() else default


@dataclass(frozen=True, slots=True, eq=False)
class Place(Record):
    """Where on the machine: one of these is given, the others are None. Numbers count from 1.

    `joint` (with `from_` where it moves with that other joint), `link`, `ball`, `target`, `anchor`, `number`;
    `axis` of the device ("x"); True for a whole part: `frame`, `base`, `tool`, `fixture`, `links`, `joints`, `all`.
    Equal to the dict of the command's JSON: `Place(joint=3) == {"joint": 3}`.
    """

    joint: int | None = None
    from_: int | None = None
    link: int | None = None
    ball: int | None = None
    target: int | None = None
    anchor: int | None = None
    axis: str | None = None
    frame: bool | None = None
    number: int | None = None
    base: bool | None = None
    tool: bool | None = None
    fixture: bool | None = None
    links: bool | None = None
    joints: bool | None = None
    all: bool | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return it as in the JSON: {"joint": 3}."""
        return {k: self[k] for k in self.keys()}

    def __str__(self) -> str:
        """Say where: "joint 3"."""
        if self.from_ is not None:
            return f"joint {self.joint} from joint {self.from_}"
        return ", ".join(k if v is True else f"{k} {v}" for k, v in self.as_dict().items())

    def __eq__(self, other: object) -> bool:
        """Compare with another place, or with the dict of the JSON."""
        if isinstance(other, Place):
            return self.as_dict() == other.as_dict()
        return self.as_dict() == other if isinstance(other, dict) else NotImplemented

    def __hash__(self) -> int:
        """By what is given."""
        return hash(str(self))


@dataclass(frozen=True, slots=True)
class Coefficient(Record):
    """A number of a finding's model, by `name`: `value` with standard deviation `sd` (None if not known), in `unit`.

    `cycles` per turn, where it is one of a wave's two.
    """

    name: str
    value: float
    unit: str
    sd: float | None = None
    cycles: float | None = None


@dataclass(frozen=True, slots=True)
class Evidence(Record):
    """Errors at poses that the fit did not see, mm rms, before and after a finding was modelled, and test statistics.

    `holdout_rms_before_mm`, `holdout_rms_after_mm` by blocks of neighbouring poses, `forward_rms_before_mm`,
    `forward_rms_after_mm` forward in time; `delta_bic` above 10 and a small `p_value` speak for the finding.
    """

    holdout_rms_before_mm: float
    holdout_rms_after_mm: float
    delta_bic: float
    p_value: float
    forward_rms_before_mm: float | None = None
    forward_rms_after_mm: float | None = None


@dataclass(frozen=True, slots=True)
class Rival(Record):
    """Another explanation that recordings cannot exclude: `effect` at `site`; `delta_bic` by how much it is worse."""

    effect: str
    site: Place
    delta_bic: float

    @classmethod
    def of(cls, said: dict[str, Any]) -> Rival:
        """Build it from the JSON."""
        return super(Rival, cls).of({**said, "site": Place.of(said["site"])})


@dataclass(frozen=True, slots=True)
class Finding(Record):
    """One effect that the model lacked.

    `effect` is its name in the catalogue (`trical.effects()`), `family` its kind, `site` where it acts, `located` what
    the error follows, `summary` a sentence, `action` what the owner can do, `next_measurements` what to measure to be
    surer. `coefficients` are the numbers of its model, `evidence` errors and tests, `rivals` what else it may be.
    Probabilities, 0 to 1: `confidence` that place and effect are right, `family_confidence` place and kind of effect,
    `place_confidence` the place. `share` is the part of the explainable squared error that it explains, `lambda_` its
    size in the measurements in standard deviations of the noise (3 is just visible). `scope` says if it belongs to the
    "arm", the "setup", the "course" of a session or the "reading" of the joints; `session` counts from 1, None where it
    holds in all. `replicated` says how many halves (`parts`) of the data were searched separately, and how many
    `agree`: those that found the same effect; `family` and `place` count those that found its family, or
    anything, there.
    """

    effect: str
    site: Place
    summary: str
    action: str
    located: str
    confidence: float
    family_confidence: float
    place_confidence: float
    family: str
    scope: str
    share: float
    lambda_: float
    coefficients: tuple[Coefficient, ...]
    evidence: Evidence
    rivals: tuple[Rival, ...]
    replicated: dict[str, int]
    session: int | None = None
    next_measurements: str | None = None

    @classmethod
    def of(cls, said: dict[str, Any]) -> Finding:
        """Build it from the JSON."""
        built = {
            "site": Place.of(said["site"]),
            "coefficients": tuple(map(Coefficient.of, said["coefficients"])),
            "evidence": Evidence.of(said["evidence"]),
            "rivals": tuple(map(Rival.of, said["rivals"])),
        }
        return super(Finding, cls).of({**said, **built})

    def __str__(self) -> str:
        """The summary."""
        return self.summary


@dataclass(frozen=True, slots=True)
class Unexplained(Record):
    """An error of no known cause: `rms_mm` at `site` that changes with `variable` ("q2": joint 2) in `region`.

    `curve` has points of the fitted curve in the units `curve_units`; `modelled` says whether the model has it;
    `holdout_rms_before_mm` and `holdout_rms_after_mm` are errors at poses that the fit did not see, without and
    with it.
    """

    site: Place
    variable: str
    region: str
    rms_mm: float
    holdout_rms_before_mm: float
    holdout_rms_after_mm: float
    curve: tuple[tuple[float, float], ...]
    curve_units: tuple[str, str]
    modelled: bool

    @classmethod
    def of(cls, said: dict[str, Any]) -> Unexplained:
        """Build it from the JSON."""
        curve = tuple((x, y) for x, y in said["curve"])
        units = (said["curve_units"][0], said["curve_units"][1])
        built = {"site": Place.of(said["site"]), "curve": curve, "curve_units": units}
        return super(Unexplained, cls).of({**said, **built})


@dataclass(frozen=True, slots=True)
class Unseen(Record):
    """An `effect` at a `site` that recordings could not show (or a plan would not), at a typical size.

    `lambda_` is its size in the measurements in standard deviations of the noise, below 3; `lacks` what such a
    recording does not have, `advice` what would help.
    """

    effect: str
    lambda_: float
    site: Place | None = None
    lacks: str | None = None
    advice: str | None = None

    @classmethod
    def of(cls, said: dict[str, Any]) -> Unseen:
        """Build it from the JSON."""
        return super(Unseen, cls).of({**said, "site": None if said.get("site") is None else Place.of(said["site"])})
