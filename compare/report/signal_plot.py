"""Signals of a result by name, drawn with matplotlib one below the other, each with its largest value."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from analytic.mechanism.signals import Signal
from compare.quantities import shown
from compare.report.curves import legend, with_peak
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
            style = STYLES[number % len(STYLES)]
            with_peak(axis, side.over, factor * values, side.title, style, number=not number)
        axis.set_ylabel(f"{signal.name} ({unit})" if unit else signal.name)
        if len(curves) > 1:
            legend(axis)
    axes[-1].set_xlabel("time (s)" if all(side.swings for side in curves) else "crank angle (deg)")
    figure.suptitle(case)
