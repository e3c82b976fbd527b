"""Reactions as vectors in matplotlib: the figures of a linkage's page, by direction and size."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import MaxNLocator

from compare.report.analysis_figures import vectors
from compare.report.curves import curve
from compare.results.analysis import Analysis, Simulation

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDE = 3  # figures side by side
STYLES = {"line": "-", "dashed": "--", "marker": "o"}


def plot(result: Analysis | Simulation, joints: Sequence[str], figure: Figure) -> None:
    """The force on the second body of each of these joints, in the ground's frame and in that body's own, as the page
    has it: the size over the direction, with the largest.
    """
    drawn = [each for each in vectors(result) if each.name.removeprefix("vector_") in joints]
    wide = max(1, min(WIDE, len(drawn)))
    high = max(1, -(-len(drawn) // wide))
    figure.set_size_inches(4.0 * wide, 5.0 * high)
    for k, each in enumerate(drawn):
        axis = figure.add_subplot(high, wide, k + 1, projection="polar")
        roles = list(dict.fromkeys(series.role for series in each.series if series.name))
        for series in (series for series in each.series if series.role in roles):
            x, y = curve(series)
            named = ", ".join([series.name, *series.labels]).removeprefix(", ")
            color = f"C{roles.index(series.role)}"
            axis.plot(np.arctan2(y, x), np.hypot(x, y), STYLES[series.mark], color=color, label=named or None)
        axis.yaxis.set_major_locator(MaxNLocator(4))
        axis.set_title(f"{each.title} (N)", fontsize="medium")
        axis.legend(fontsize="small", loc="upper center", bbox_to_anchor=(0.5, -0.08))
    figure.suptitle(result.case)
