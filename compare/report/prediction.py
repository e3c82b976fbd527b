"""A prediction, shown: a table, the curves as CSV, and the bands in a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from compare.presentation import Presentation
from compare.quantities import DASH, fitting, plainly
from compare.report.curves import MOST_CURVES, partly
from compare.report.diagnosis_terminal import in_ascii
from compare.report.peaks import NOTHING
from compare.report.tables import html_list, html_table, print_rows, say
from compare.report.words.prediction import headline, mostly
from compare.results.prediction import Prediction

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEADS = ("signal", "unit", "from", "to", "95 % band, widest", "mostly by", "covered")


def table(result: Prediction) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """The heads of the table and a row for each signal of each run: its range, how wide its band is at most to either
    side, and by what; how much of what was measured it covers, where something was.
    """
    rows = []
    for run in result.runs:
        for name, band in run.signals.items():
            size = float(np.nanmax(np.abs(band.value), initial=0.0))
            unit, factor = fitting(band.unit, size)
            ends = [plainly(factor * float(end(band.value))) for end in (np.nanmin, np.nanmax)]
            half = float(np.nanmax(band.high - band.low, initial=0.0)) / 2
            wide = (f"±{plainly(factor * half, 2)}", mostly(band)) if half > NOTHING * size else ("0", DASH)
            covered = DASH if band.covered is None else f"{100 * band.covered:.1f} %"
            called = name if len(result.runs) == 1 else f"{run.name}: {name}"
            rows.append((called, unit, *ends, *wide, covered))
    shown = len(HEADS) - all(row[-1] == DASH for row in rows)
    return HEADS[:shown], [row[:shown] for row in rows]


def print_table(result: Prediction, console: Console) -> None:
    """Print each signal with its band, and what to make of it."""
    heads, rows = table(result)
    print_rows(console, heads, [tuple(map(in_ascii, row)) for row in rows], left=HEADS[:2])
    say(console, *map(in_ascii, remarks(result)))


def remarks(result: Prediction) -> list[str]:
    """What to make of the bands."""
    return [*result.notes, *([] if result.context is None else [result.context.says])]


def files(result: Prediction) -> dict[str, str]:
    """The bands as CSV."""
    return {"prediction.csv": result.to_csv()}


def summary_html(result: Prediction) -> str:
    """The table, and what to make of it."""
    heads, rows = table(result)
    return html_table(rows, heads, headline(result), named=True) + html_list(remarks(result))


def plot(result: Prediction, figure: Figure) -> None:
    """The first six signals of the first run over time, and their bands."""
    signals = list(result.drawable)
    plot_signals(result, figure, signals[:MOST_CURVES])
    partly(figure, MOST_CURVES, len(signals), "signals")


def plot_signals(result: Prediction, figure: Figure, signals: Sequence[str]) -> None:
    """Signals of the first run over time, beside each its band, which is thinner than a line there."""
    run = result.runs[0]
    figure.set_figheight(1.8 * len(signals) + 1)
    axes = figure.subplots(len(signals), 2, squeeze=False, sharex=True)
    for (left, right), name in zip(axes, signals, strict=True):
        band = run.signals[name]
        unit, factor = fitting(band.unit, *band.value)
        left.plot(run.time, factor * band.value)
        left.set_title(f"{name} ({unit})", fontsize="medium", loc="left")
        low, high = band.low - band.value, band.high - band.value
        unit, factor = fitting(band.unit, *low, *high)
        right.fill_between(run.time, factor * low, factor * high, alpha=0.4)
        right.set_title(f"95 % band about it ({unit})", fontsize="medium", loc="left")
    for axis in axes[-1]:
        axis.set_xlabel("time (s)")
    figure.suptitle(headline(result))


PRESENTATION = Presentation(summary_html, print_table, files, plot, plot_signals)
