"""Signals of a result by name, drawn with matplotlib one below the other, each with its largest value."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from analytic.mechanism.signals import Signal
from compare.quantities import shown
from compare.report.curves import legend
from compare.results.looked_at import Curves

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLES = ("-", "--", "-.", ":")


def plot(case: str, curves: Sequence[Curves], signals: Sequence[Signal], figure: Figure) -> None:
    """Draw each signal over the crank angle (deg), or the time (s), of all sides that have it."""
    figure.set_figheight(max(4.0, 2.5 * len(signals)))
    axes = figure.subplots(len(signals), 1, sharex=True, squeeze=False)[:, 0]
    for axis, signal in zip(axes, signals, strict=True):
        unit, factor = shown(signal.unit)
        for number, side in enumerate(curves):
            if (values := side.signals.get(signal.name)) is None or not np.any(np.isfinite(values)):
                continue
            x, y = side.over, factor * values
            (line,) = axis.plot(x, y, STYLES[number % len(STYLES)], label=side.title)
            at = int(np.nanargmax(np.abs(y)))
            axis.plot(x[at], y[at], "o", markersize=4, color=line.get_color())
            if not number:
                axis.annotate(f"{y[at]:.4g}", (x[at], y[at]), (4, 4), textcoords="offset points", fontsize=8)
        axis.set_ylabel(f"{signal.name} ({unit})" if unit else signal.name)
        if len(curves) > 1:
            legend(axis)
    axes[-1].set_xlabel("time (s)" if all(side.swings for side in curves) else "crank angle (deg)")
    figure.suptitle(case)
