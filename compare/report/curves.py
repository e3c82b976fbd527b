"""What matplotlib's figures of results have in common."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from compare.report.figure import Series

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

MOST = 6  # curves of a plot, or plots of a figure


def curve(series: Series) -> tuple[np.ndarray, np.ndarray]:
    """The points (N,) of a series, NaN where there is none."""
    return np.array(series.x, float), np.array(series.y, float)


def with_peak(axis: Axes, x: np.ndarray, y: np.ndarray, label: str, style: str = "-", number: bool = True) -> None:
    """Draw a curve (N,) with a dot at its largest value, and the ``number`` beside it."""
    (line,) = axis.plot(x, y, style, label=label)
    at = int(np.nanargmax(np.abs(y)))
    axis.plot(x[at], y[at], "o", markersize=4, color=line.get_color())
    if number:
        axis.annotate(f"{y[at]:.4g}", (x[at], y[at]), (4, 4), textcoords="offset points", fontsize=8)


def legend(axis: Axes, *others: Axes) -> None:
    """The names of an axis' curves, and of the others' that it has not, beside it, where they hide none."""
    named: dict[str, Artist] = {}
    for each in (axis, *others):
        lines, names = each.get_legend_handles_labels()
        named |= dict(zip(names, lines, strict=True))
    if named:
        axis.legend(named.values(), named.keys(), fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
