"""A prediction, shown: a table, the curves as CSV, and the bands in a picture."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from compare.presentation import Presentation
from compare.quantities import fitting, plainly
from compare.report.diagnosis_terminal import in_ascii
from compare.report.tables import html_table, say, terminal_table
from compare.report.words.prediction import mostly
from compare.results.band import Band
from compare.results.prediction import Prediction

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEADS = ("signal", "unit", "from", "to", "95 % band, widest", "mostly by", "covered")
PLOTTED = 4  # signals


def rows(result: Prediction) -> Iterator[tuple[str, ...]]:
    """A row for each signal of each run: its range, how wide its band is at most to either side, and by what."""
    for run in result.runs:
        for name, band in run.signals.items():
            unit, factor = fitting(band.unit, float(np.nanmax(np.abs(band.value), initial=0.0)))
            ends = [plainly(factor * float(end(band.value))) for end in (np.nanmin, np.nanmax)]
            half = plainly(factor * float(np.nanmax(band.high - band.low, initial=0.0)) / 2, 2)
            covered = "-" if band.covered is None else f"{100 * band.covered:.1f} %"
            called = name if len(result.runs) == 1 else f"{run.name}: {name}"
            yield called, unit, *ends, f"+-{half}", mostly(band), covered


def print_table(result: Prediction, console: Console) -> None:
    """Print each signal with its band, and what to make of it."""
    console.print(terminal_table(HEADS, [tuple(map(in_ascii, row)) for row in rows(result)], left=HEADS[:2]))
    say(console, *(in_ascii(note) for note in result.notes))
    if result.context is not None:
        say(console, in_ascii(result.context.says))


def files(result: Prediction) -> dict[str, str]:
    """The bands as CSV."""
    return {"prediction.csv": result.to_csv()}


def summary_html(result: Prediction) -> str:
    """The table."""
    says = "" if result.context is None else result.context.says
    return html_table(list(rows(result)), HEADS, says or f"{result.case}, as {result.diagnosis}", named=True)


def plot(result: Prediction, figure: Figure) -> None:
    """The bands of the first signals of the first run over time."""
    run = result.runs[0]
    shown: list[tuple[str, Band]] = list(run.signals.items())[:PLOTTED]
    for axis, (name, band) in zip(figure.subplots(len(shown), 1, squeeze=False, sharex=True)[:, 0], shown, strict=True):
        unit, factor = fitting(band.unit, float(np.nanmax(np.abs(band.value), initial=0.0)))
        axis.fill_between(run.time, factor * band.low, factor * band.high, alpha=0.4)
        axis.plot(run.time, factor * band.value, linewidth=0.8)
        axis.set_ylabel(f"{name} ({unit})", fontsize="small")
    axis.set_xlabel("time (s)")
    figure.suptitle(f"{result.case}, {run.name}: 95 % band")


PRESENTATION = Presentation(summary_html, print_table, files, plot)
