"""Pictures of results, for those who have matplotlib."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from . import _native
from ._native import TricalError

Floats = npt.NDArray[np.float64]

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ._findings import Finding
    from ._native import Outcome
    from ._results import Diagnosis, Plan


def _figure(wide: int, high: int = 1) -> tuple[Figure, list[Axes]]:
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise ImportError('plots need matplotlib, which is not installed: pip install "trical[plot]"') from None
    # not by pyplot: no window, no global state; notebooks show the figure that a cell ends with
    figure = Figure(figsize=((5.5 if wide < 3 else 4.0) * wide, 3.6 * high), layout="constrained")
    return figure, list(np.ravel(figure.subplots(high, wide)))


def _name(found: Finding) -> str:
    """Effect, place and session of a finding, as the reports have it: "Gear ripple at joint 3"."""
    session = "" if found.session is None else f" in session {found.session}"
    return _native._named(found.effect, json.dumps(found.site.as_dict())) + session


def one_finding(found: Finding, label: str, error: str, x: Floats, without: Floats, with_it: Floats) -> Figure:
    """Errors of each measurement without and with a finding (n,), against the variable x that reveals it."""
    figure, (axes,) = _figure(1)
    axes.plot(x, without, ".", color="tab:red", markersize=4, label="without it")
    axes.plot(x, with_it, ".", color="tab:blue", markersize=4, label="with it")
    title = f"{_name(found)} ({100 * found.confidence:.0f} %)"
    axes.set(xlabel=label, ylabel=error, title=title)
    axes.legend(loc="best")
    return figure


def by_joint(outcome: Outcome, errors_mm: Floats | None, names: tuple[str, str]) -> Figure:
    """Position errors (n, 2) mm against each joint."""
    q, slides = outcome.joint_values(), outcome.slides()
    if errors_mm is None:
        raise TricalError("the recordings were read in passes: there are no errors one by one to draw")
    figure, panels = _figure(3, -(-q.shape[1] // 3))
    for joint, axes in enumerate(panels):
        if joint >= q.shape[1]:
            axes.set_visible(False)
            continue
        x, unit = (1e3 * q[:, joint], "mm") if slides[joint] else (np.degrees(q[:, joint]), "deg")
        for column, color in enumerate(("tab:gray", "tab:blue")):
            axes.plot(x, errors_mm[:, column], ".", color=color, markersize=3, label=names[column])
        axes.set(xlabel=f"joint {joint + 1}, {unit}", ylabel="position error, mm", ylim=(0, None))
    panels[0].legend(loc="best")
    return figure


def plan(p: Plan) -> Figure:
    """Angles of the joints at the touches of each ball, and the effects that would not be seen."""
    figure, (left, right) = _figure(2)
    for k, ball in enumerate(np.unique(p.ball)):
        q = np.degrees(p.q[p.ball == ball])
        x = np.arange(1, q.shape[1] + 1) + 0.12 * (k - 1)
        left.plot(np.tile(x, len(q)), q.ravel(), ".", markersize=4, label=f"ball {ball}")
    left.set(xlabel="joint", ylabel="angle at the touches, deg")
    left.legend(loc="best")
    weakest: dict[str, float] = {}
    for b in p.blind_to:
        weakest[b.effect] = min(b.lambda_, weakest.get(b.effect, 3.0))
    names = sorted(weakest, key=lambda name: -weakest[name])
    titles = [_native._named(name, None) for name in names]
    right.barh(range(len(names)), [weakest[name] for name in names], color="tab:blue", height=0.6)
    right.axvline(3.0, color="tab:red", linestyle=":")
    right.set(
        xlim=(0, 3.2),
        xlabel="lambda at the worst place (3 is just visible)",
        yticks=range(len(names)),
        yticklabels=titles,
    )
    right.set_title("what these touches would not show")
    return figure


def _draw_errors(axes: Axes, errors_mm: npt.NDArray[np.float64], names: tuple[str, str]) -> None:
    largest = float(np.nanmax(errors_mm, initial=1e-6))
    smallest = max(float(np.nanmin(errors_mm, initial=largest)), 1e-3 * largest)
    bins = np.geomspace(smallest, largest, 30).tolist()
    for column, (name, color) in enumerate(zip(names, ("tab:gray", "tab:blue"), strict=True)):
        mean = errors_mm[:, column].mean()
        axes.hist(errors_mm[:, column], bins, color=color, alpha=0.6, label=f"{name}: mean {mean:.3g} mm")
    axes.set(xscale="log", xlabel="position error, mm", ylabel="measurements")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)


def errors(errors_mm: npt.NDArray[np.float64] | None, after: str) -> Figure:
    """Histograms of position errors (n, 2) mm, before and after."""
    figure, (axes,) = _figure(1)
    if errors_mm is None:
        raise TricalError("the recordings were read in passes: there are no errors one by one to draw")
    _draw_errors(axes, errors_mm, ("nominal arm", after))
    return figure


def diagnosis(d: Diagnosis) -> Figure:
    """Position errors before and after, and a bar for each finding."""
    figure, (left, right) = _figure(2)
    _draw_errors(left, d.errors_mm, ("without what was found", "with it"))
    findings = d.findings[::-1]
    names = [_name(f) for f in findings]
    right.barh(range(len(findings)), [100 * f.confidence for f in findings], color="tab:blue", height=0.6)
    right.set(
        xlim=(0, 100),
        ylim=(min(len(findings) - 5, 0) - 0.5, max(len(findings), 1) - 0.5),
        xlabel="probability, %",
        yticks=range(len(findings)),
        yticklabels=names,
    )
    right.set_title("nothing found" if not findings else "findings, most important first")
    return figure
