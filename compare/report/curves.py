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


def legend(axis: Axes, *others: Axes) -> None:
    """The names of an axis' curves, and of the others' that it has not, beside it, where they hide none."""
    named: dict[str, Artist] = {}
    for each in (axis, *others):
        lines, names = each.get_legend_handles_labels()
        named |= dict(zip(names, lines, strict=True))
    if named:
        axis.legend(named.values(), named.keys(), fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
