"""What matplotlib's figures of results have in common."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from compare.report.figure import Series
from compare.report.peaks import End

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_CURVES = 6  # curves of a plot, or plots of a figure


def curve(series: Series) -> tuple[np.ndarray, np.ndarray]:
    """The points (N,) of a series, NaN where there is none."""
    return np.array(series.x, float), np.array(series.y, float)


def with_peak(axis: Axes, x: Sequence[float], y: np.ndarray, label: str, end: End | None) -> None:
    """Draw a curve (N,) with a dot at its peak, which its name in the legend tells; with no dot where it has none."""
    (line,) = axis.plot(x, y, label=label if end is None else f"{label}, peak {end.value:.4g} at {end.at:.4g}")
    if end is not None:
        axis.plot(end.at, end.value, "o", markersize=4, color=line.get_color())


def partly(figure: Figure, shown: int, every: int, what: str) -> None:
    """Say below a figure of how many of all it is, where it is not of all."""
    if shown < every:
        figure.supxlabel(f"{shown} of {every} {what}", fontsize="small")


def legend(axis: Axes, *others: Axes) -> None:
    """The names of an axis' curves, and of the others' that it has not, beside it, where they hide none."""
    named: dict[str, Artist] = {}
    for each in (axis, *others):
        lines, names = each.get_legend_handles_labels()
        named |= dict(zip(names, lines, strict=True))
    if named:
        axis.legend(named.values(), named.keys(), fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
