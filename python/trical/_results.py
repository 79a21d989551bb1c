"""Results of the long calls: plain data that prints as tables."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from . import _html
from ._findings import Finding, Unexplained, Unseen
from ._native import Model, TricalError
from ._reports import Certified, Reported

if TYPE_CHECKING:  # whoever imports trical need not wait for NumPy
    import numpy as np
    import numpy.typing as npt
    from matplotlib.figure import Figure

    Floats = npt.NDArray[np.float64]
Errors = dict[str, float]

_SUMMARY = ("mean_mm", "median_mm", "sd_mm", "rms_mm", "max_mm")
_HEAD = ("position error, mm", "mean", "median", "sd", "rms", "max")


def _error_rows(errors: Sequence[tuple[str, Errors | None]]) -> list[list[object]]:
    return [[name, *(float(e[k]) for k in _SUMMARY)] for name, e in errors if e is not None]


def _error_lines(errors: Sequence[tuple[str, Errors | None]]) -> list[str]:
    lines = [f"{_HEAD[0]:<32}" + "".join(f"{h:>9}" for h in _HEAD[1:])]
    lines += [f"  {r[0]:<30}" + "".join(f"{x:9.4f}" for x in r[1:]) for r in _error_rows(errors)]
    return lines


def _parameter_rows(parameters: Sequence[dict[str, Any]]) -> list[list[object]]:
    def number(x: float | None) -> object:
        return "" if x is None else float(x)

    return [[p["name"], number(p["nominal"]), number(p["value"]), number(p["sd"]), p["unit"]] for p in parameters]


@dataclass(frozen=True, repr=False)
class Identified(Certified):
    """A fitted model with its errors and uncertainties.

    `parameters` is a list of dicts with name, site, value, unit, sd, nominal; `errors` are position errors at the data
    (mean_mm, max_mm, sd_mm, median_mm, rms_mm), `before` those of the nominal arm with only measuring frame (or base)
    and tool identified; `cross_validation` those of poses that the fit did not see, `forward_in_time` those of the last
    poses by a fit to the ones before, where they were asked for. `held_out` has the errors at poses that the fit did
    not see: by_pose, by_block (of neighbouring poses), forward (in time), by_session; `sessions` what each of several
    recordings has of its own. `errors_mm` (observations, 2) has them one by one, before and after (None for files that
    were read in passes). `covariance` (parameters, parameters) is in SI units: m, rad, rad/Nm. `held` names what was
    held at nominal because joints hardly move, `near_nominal` what weak priors determine rather than the measurements,
    `elasticity` says from what compliance is known ("torques", "masses", "inclination", "not_asked"), and `orientation`
    has the errors of orientation before and after (mean_deg, rms_deg, max_deg) where full poses were measured.
    `answer` has all of the command's JSON: distances of balls at unknown places, what was tried there, what stopped at
    a limit of `known`.
    """

    model: Model
    parameters: list[dict[str, Any]]
    errors: Errors
    observations: int
    rejected: list[dict[str, Any]]
    observability: dict[str, float]
    before: Errors
    covariance: Floats
    errors_mm: Floats | None = None
    cross_validation: Errors | None = None
    forward_in_time: Errors | None = None
    held_out: dict[str, Errors] = field(default_factory=dict)
    sessions: list[dict[str, Any]] = field(default_factory=list)
    cautions: list[str] = field(default_factory=list)
    not_identifiable: list[tuple[str, list[str]]] = field(default_factory=list)
    correlated: list[Any] = field(default_factory=list)
    joints: str = "read"
    held: list[str] = field(default_factory=list)
    near_nominal: list[str] = field(default_factory=list)
    elasticity: str = "not_asked"
    orientation: list[dict[str, float]] | None = None
    answer: dict[str, Any] = field(default_factory=dict)

    def _errors(self) -> list[tuple[str, Errors | None]]:
        return [
            ("nominal arm", self.before),
            ("identified", self.errors),
            ("poses that the fit did not see", self.cross_validation),
            ("later, by a fit to those before", self.forward_in_time),
            *((f"held out {how.replace('_', ' ')}", e) for how, e in self.held_out.items()),
        ]

    def __repr__(self) -> str:
        """Errors before and after, in a few lines."""
        head = (
            f"<trical.Identified: {len(self.parameters)} parameters from {self.observations} measurements, "
            f"{len(self.rejected)} rejected>"
        )
        return "\n".join([head, *_error_lines(self._errors()), *(f"  caution: {c}" for c in self.cautions)])

    def _repr_html_(self) -> str:
        head = f"{len(self.parameters)} parameters from {self.observations} measurements, {len(self.rejected)} rejected"
        columns = ("parameter", "nominal", "identified", "sd", "unit")
        parts = [
            _html.table(_HEAD, _error_rows(self._errors()), head),
            _html.table(columns, _parameter_rows(self.parameters), f"joints as {self.joints}"),
            *map(_html.note, self.cautions),
        ]
        return "".join(parts)

    def plot(self) -> Figure:
        """Draw position errors before and after; needs matplotlib (pip install "trical[plot]")."""
        from ._plots import errors

        return errors(self.errors_mm, "identified")

    def residuals_by_joint(self) -> Figure:
        """Draw each measurement's position error against every joint, of the nominal arm and identified."""
        from ._plots import by_joint

        return by_joint(self._outcome(), self.errors_mm, ("nominal arm", "identified"))


@dataclass(frozen=True, repr=False)
class Validation(Certified):
    """Position errors of the nominal arm and of a model on recordings that it was not fitted to.

    `before` and `after` have mean_mm, max_mm, sd_mm, median_mm, rms_mm; `sessions` and `regions` the same by recording,
    with what was identified there, and by region; `beyond` how many of the `n` are at joint angles that the model was
    not fitted at (None where it does not know); `predicted` the errors that the model expects, compared with those
    found (sd_mm, parameters_sd_mm, covered, covered_visited, covered_beyond; None where it does not know); `left_out`
    terms of the model that do not apply here; `carried_over` effects that jumped in the session that the model was
    fitted to, and are taken to be as they were at its end; `orientation` mean_deg, rms_deg and max_deg of the angles,
    before and after, where full poses were measured; `errors_mm` (n, 2) one by one, before and after. Also by key, as
    in the command's JSON: v["after"]["mean_mm"].
    """

    before: Errors
    after: Errors
    n: int
    beyond: int | None
    sessions: list[dict[str, Any]]
    regions: list[dict[str, Any]]
    left_out: list[dict[str, Any]]
    rejected: list[dict[str, Any]]
    errors_mm: Floats
    predicted: dict[str, float | None] | None = None
    carried_over: list[str] = field(default_factory=list)
    orientation: list[dict[str, float]] | None = None

    def __getitem__(self, key: str) -> Any:
        """Return before, after, n, beyond, predicted, sessions, regions, left_out, orientation, ... by name."""
        if key not in self.__dataclass_fields__ or key.startswith(("_", "errors")):
            raise KeyError(key)
        return getattr(self, key)

    def __repr__(self) -> str:
        """Errors before and after, in a few lines."""
        errors = [("before: nominal arm", self.before), ("after: the model", self.after)]
        head = f"<trical.Validation: {self.n} measurements scored, {len(self.rejected)} rejected>"
        return "\n".join([head, *_error_lines(errors)])

    def _repr_html_(self) -> str:
        errors: list[tuple[str, Errors | None]] = [
            ("before: nominal arm", self.before),
            ("after: the model", self.after),
        ]
        errors += [(f"after, {r['region']}", r["after"]) for r in self.regions]
        head = f"{self.n} measurements scored, {len(self.rejected)} rejected"
        return _html.table(_HEAD, _error_rows(errors), head)

    def plot(self) -> Figure:
        """Draw position errors before and after; needs matplotlib (pip install "trical[plot]")."""
        from ._plots import errors

        return errors(self.errors_mm, "the model")


@dataclass(frozen=True, repr=False)
class Touches:
    """Touches in the order of measurement, and the ways between them.

    `ball` (n,) from 1; `q` (n, joints) joints at the touch, `approach` (n, joints) where the arm comes from and goes
    back to, rad (m); `via` for each touch the configurations on the way to its approach, (k, joints); `directions`
    (n, joints) sense of each joint's last motion; `text` that of a plan.csv.
    """

    ball: npt.NDArray[np.int64]
    q: Floats
    approach: Floats
    via: list[Floats]
    directions: npt.NDArray[np.int8]
    text: str

    def __len__(self) -> int:
        """Return the number of touches."""
        return len(self.ball)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a plan.csv, as `trical measure --plan` reads it."""
        with open(path, "w", encoding="utf-8", newline="") as f:
            f.write(self.text)


@dataclass(frozen=True, repr=False)
class NextTouches(Touches):
    """Touches that decide between a finding and its rivals.

    The finding is `effect` at `site`; `explanations` are its and its rivals' names. `separation` says how many standard
    deviations the touches set any two of them apart at least, `random_separation` what as many random touches would:
    below 1 nothing is decided. The rest as in `Touches`: ball, q, approach, via, directions, text.
    """

    effect: str
    site: dict[str, Any]
    explanations: list[str]
    separation: float
    random_separation: float

    def __repr__(self) -> str:
        """What they decide, and how well."""
        return (
            f"<trical.NextTouches: {len(self)} touches set {' and '.join(self.explanations)} "
            f"{self.separation:.1f} standard deviations apart (random ones: {self.random_separation:.1f})>"
        )


@dataclass(frozen=True, repr=False)
class Diagnosis(Reported):
    """What a model lacks according to the recordings, and the extended model.

    `findings` (`Finding`) are in order of importance; `unexplained` (`Unexplained`) says where an error has no known
    cause, `blind_to` (`Unseen`) what the recordings could not show; `answer` has all of the command's JSON; `errors_mm`
    (observations, 2) position errors one by one, without and with what was found; `next` touches that would decide
    between the least sure finding and its rivals, where they were asked for and anything is undecided.
    """

    model: Model
    findings: list[Finding]
    unexplained: list[Unexplained]
    blind_to: list[Unseen]
    answer: dict[str, Any]
    errors_mm: Floats
    next: NextTouches | None = None

    @property
    def joints(self) -> str:
        """Which joint angles were used: "read" or "commanded"."""
        joints: str = self.answer["joints"]
        return joints

    def __str__(self) -> str:
        """The verdict, as the command prints it: what is wrong, how sure that is, what it costs, what to do."""
        return "\n".join(self.answer["verdict"]["lines"])

    def __repr__(self) -> str:
        """As str, with a head."""
        n = len(self.findings)
        tail = "" if self.next is None else f"\n{self.next!r}"
        return f"<trical.Diagnosis: {n} finding{'' if n == 1 else 's'}>\n{self}{tail}"

    def _repr_html_(self) -> str:
        columns = ("claim", "probability", "error before, mm", "after, mm", "what to do")
        rows: list[list[object]] = []
        for r in self.answer["verdict"]["rows"]:
            sure = (
                "" if r["confidence"] is None else " to ".join(dict.fromkeys(f"{100 * p:.0f}" for p in r["confidence"]))
            )
            perhaps = r["perhaps"] or ""
            claim = r["text"] + (f" ({perhaps})" if perhaps.startswith("if not") else perhaps and f", {perhaps}")
            rows.append([claim, sure and f"{sure} %", float(r["before_mm"]), float(r["after_mm"]), r["action"] or ""])
        head = "error at poses that the fit did not see, mm rms"
        return _html.table(columns, rows, head) + "".join(map(_html.note, self.answer["cautions"]))

    def plot(self, finding: int | None = None) -> Figure:
        """Draw position errors before and after, and how sure the findings are; needs matplotlib (trical[plot]).

        With the number of a `finding`, from 1: each measurement's error against the variable that reveals the finding,
        along the direction in which it acts, without it and with it, everything else modelled. Raises TricalError for a
        number that no finding has, and where the result was pickled.
        """
        from ._plots import diagnosis, one_finding

        if finding is None:
            return diagnosis(self)
        if not 1 <= finding <= len(self.findings):
            raise TricalError(f"found no finding {finding}, there are {len(self.findings)}")
        return one_finding(self.findings[finding - 1], *self._outcome().finding(finding - 1))

    def residuals_by_joint(self) -> Figure:
        """Draw each measurement's position error against every joint, without and with what was found."""
        from ._plots import by_joint

        return by_joint(self._outcome(), self.errors_mm, ("without what was found", "with it"))


@dataclass(frozen=True, repr=False)
class Plan(Touches, Reported):
    """Touches in the order of measurement, and the results to expect.

    Arrays as in `Touches`: ball, q, approach, via, directions, text. `parameters` are dicts with name, site, unit, sd,
    nominal; `expected` the position error that noise alone causes (sphere, workspace: mean_mm, rms_mm, worst_rms_mm);
    `answer` all that the planner says. `blind_to` (`Unseen`) lists the effects that these touches would not show at a
    typical size, each at its site, with the advice that would help; or with what no such recording has.
    """

    parameters: list[dict[str, Any]]
    expected: dict[str, Any]
    answer: dict[str, Any]

    @property
    def blind_to(self) -> list[Unseen]:
        """What the touches would not show; see above."""
        return [Unseen.of(b) for b in self.answer["blind_to"]]

    def plot(self) -> Figure:
        """Draw the joints' angles at the touches of each ball, and the effects they would not show (matplotlib)."""
        from ._plots import plan

        return plan(self)

    def _expected(self) -> list[tuple[str, dict[str, float]]]:
        return [(k, self.expected[k]) for k in ("sphere", "workspace") if self.expected[k] is not None]

    def __repr__(self) -> str:
        """Touches, gain, expected errors."""
        head = f"<trical.Plan: {len(self)} touches of {len(set(self.ball.tolist()))} balls>"
        gain = self.answer["gain_over_random"]
        lines = [] if gain is None else [f"  {gain:.2g} times better than a random choice"]
        if not self.answer["determined"]:
            lines.append(f"  does not determine the {len(self.parameters)} parameters")
        lines += [f"  expected in the {k}: mean {e['mean_mm']:.3f} mm" for k, e in self._expected()]
        if self.blind_to:
            n = len({b.effect for b in self.blind_to})
            lines.append(f"  would not show {n} effects, at one place or more: see blind_to")
        return "\n".join([head, *lines])

    def _repr_html_(self) -> str:
        rows = [[k, e["mean_mm"], e["rms_mm"], e["worst_rms_mm"]] for k, e in self._expected()]
        head = f"{len(self)} touches; position error that noise of {self.expected['noise_mm']:.3g} mm would leave"
        parameters = [[p["name"], "-" if p["sd"] is None else float(p["sd"]), p["unit"]] for p in self.parameters]
        return _html.table(("in the", "mean, mm", "rms, mm", "worst rms, mm"), rows, head) + _html.table(
            ("parameter", "sd", "unit"), parameters, "expected standard deviations"
        )


@dataclass(frozen=True, repr=False)
class Observability:
    """What measurements at given places tell about a set of parameters.

    From the singular values s of the Jacobian with columns of unit length, m scalars, p parameters: `o1` = (product of
    s)^(1/p) / sqrt(m); `o2` = smallest / largest; `o3` = smallest; `o4` = smallest^2 / largest, the noise
    amplification index; `o5` = 1 / sum(1 / s); `condition` = largest / smallest. `parameters` are dicts with name,
    site, unit, sd (for the noise that was given), nominal; `not_identifiable` names those that move together with
    others, and these.
    """

    o1: float
    o2: float
    o3: float
    o4: float
    o5: float
    condition: float
    rows: int
    parameters: list[dict[str, Any]]
    not_identifiable: list[tuple[str, list[str]]]

    @property
    def noise_amplification(self) -> float:
        """The noise amplification index of Nahvi and Hollerbach: o4."""
        return self.o4

    def _indices(self) -> list[tuple[str, float]]:
        return [(k, getattr(self, k)) for k in ("o1", "o2", "o3", "o4", "o5", "condition")]

    def __repr__(self) -> str:
        """All indices on one line."""
        said = ", ".join(f"{k} {v:.3g}" for k, v in self._indices())
        return f"<trical.Observability: {len(self.parameters)} parameters, {self.rows} scalars: {said}>"

    def _repr_html_(self) -> str:
        rows = [[p["name"], "-" if p["sd"] is None else float(p["sd"]), p["unit"]] for p in self.parameters]
        head = f"{len(self.parameters)} parameters from {self.rows} scalars"
        return _html.table(("index", "value"), self._indices(), head) + _html.table(
            ("parameter", "sd", "unit"), rows, "standard deviations for the noise that was given"
        )


@dataclass(frozen=True, repr=False)
class Study(Reported):
    """Whole calibrations of simulated arms.

    `settings` are dicts of settings and results: for touches arm ("described" by the parameters, or "any" arm), noise,
    design ("chosen" or "random"), per_ball, sphere_mean_mm, workspace_mean_mm (position errors at poses that were not
    touched) and gave_up (fits that did); for platforms balls, side_mm, height_mm, raise_mm, sphere_mean_mm,
    workspace_mean_mm and problem. `verdict` is the result in a sentence, `notes` are further remarks; `table` is for
    people, the first row its head; `csv` has every trial (or platform), `svg` the curves; `answer` all of the command's
    JSON.
    """

    settings: list[dict[str, Any]]
    verdict: str
    notes: list[str]
    table: list[list[str]]
    csv: str
    svg: str
    answer: dict[str, Any]

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write study.csv, study.svg and study.html into a folder, which is made where it is missing."""
        os.makedirs(folder, exist_ok=True)
        for name, text in (("study.csv", self.csv), ("study.svg", self.svg)):
            with open(os.path.join(folder, name), "w", encoding="utf-8", newline="") as f:
                f.write(text)
        self.report(os.path.join(folder, "study.html"))

    def __repr__(self) -> str:
        """A table and the verdict."""
        wide = [max(len(cell) for cell in column) for column in zip(*self.table, strict=True)]
        lines = [
            "  ".join([row[0].ljust(wide[0]), *(c.rjust(w) for c, w in zip(row[1:], wide[1:], strict=True))])
            for row in self.table
        ]
        return "\n".join([f"<trical.Study: {len(self.settings)} settings>", *lines, self.verdict, *self.notes])

    def _repr_html_(self) -> str:
        head, *rows = self.table
        return self.svg + _html.table(head, rows, self.verdict) + "".join(map(_html.note, self.notes))
