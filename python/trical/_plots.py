"""Pictures of results, for those who have matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ._native import TricalError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ._results import Diagnosis


def _figure(wide: int) -> tuple[Figure, list[Axes]]:
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise ImportError('plots need matplotlib, which is not installed: pip install "trical[plot]"') from None
    # not by pyplot: no window, no global state; notebooks show the figure that a cell ends with
    figure = Figure(figsize=(5.5 * wide, 3.6), layout="constrained")
    return figure, list(np.atleast_1d(figure.subplots(1, wide)))


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
    from ._results import site_words

    figure, (left, right) = _figure(2)
    _draw_errors(left, d.errors_mm, ("without what was found", "with it"))
    findings = d.findings[::-1]
    names = [f"{f['effect']} at {site_words(f['site'])}" for f in findings]
    right.barh(range(len(findings)), [100 * f["confidence"] for f in findings], color="tab:blue", height=0.6)
    right.set(
        xlim=(0, 100),
        ylim=(min(len(findings) - 5, 0) - 0.5, max(len(findings), 1) - 0.5),
        xlabel="sure, %",
        yticks=range(len(findings)),
        yticklabels=names,
    )
    right.set_title("nothing is asked for" if not findings else "findings, most important first")
    return figure
