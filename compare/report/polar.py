"""Reactions as vectors in matplotlib, by direction and size: as a linkage's page has them, and engines over the
analytic curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import MaxNLocator

from compare.report.analysis_figures import vectors
from compare.report.crosscheck_figures import reaction_vectors
from compare.report.curves import curve
from compare.report.summary import summarise
from compare.results.analysis import Analysis, Simulation
from compare.results.crosscheck import CrossCheck

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDE = 3  # figures side by side
STYLES = {"line": "-", "dashed": "--", "marker": "o"}
HOLLOW = "os^Dv"  # of the engines, which lie one on the other


def plot(result: Analysis | Simulation | CrossCheck, joints: Sequence[str], figure: Figure) -> None:
    """The force on the second body of each of these joints: the size over the direction, in the ground's frame and in
    that body's own, as the page has it, with the largest; of a cross-check in the ground's, both sides.
    """
    both = isinstance(result, CrossCheck)
    every = reaction_vectors(summarise(result)) if isinstance(result, CrossCheck) else vectors(result)
    drawn = [each for each in every if each.name.removeprefix("vector_") in joints]
    wide = max(1, min(WIDE, len(drawn)))
    high = max(1, -(-len(drawn) // wide))
    figure.set_size_inches(4.0 * wide, (5.5 if both else 5.0) * high)
    for k, each in enumerate(drawn):
        axis = figure.add_subplot(high, wide, k + 1, projection="polar")
        kinds = list(dict.fromkeys((series.role, series.level) for series in each.series if series.name))
        for series in (series for series in each.series if (series.role, series.level) in kinds):
            x, y = curve(series)
            named = ", ".join([series.name, *series.labels]).removeprefix(", ")
            at = kinds.index((series.role, series.level))
            style, color = STYLES[series.mark], "k" if both and series.mark != "marker" else f"C{at}"
            (line,) = axis.plot(np.arctan2(y, x), np.hypot(x, y), style, color=color, label=named or None)
            if both and series.mark == "marker":
                line.set(marker=HOLLOW[at % len(HOLLOW)], fillstyle="none", markersize=4 + at, markeredgewidth=0.8)
        axis.yaxis.set_major_locator(MaxNLocator(4))
        axis.set_title(f"{each.title} (N)", fontsize="medium")
        axis.legend(fontsize="small", loc="upper center", bbox_to_anchor=(0.5, -0.08))
        if each.note:
            figure.supxlabel(each.note, fontsize="small")
    figure.suptitle(result.case)
