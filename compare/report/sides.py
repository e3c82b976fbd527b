"""One side of a comparison, shown: its signals as a table, a short one for a terminal or a notebook, the curves."""

from __future__ import annotations

import html
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from analytic.mechanism.one_line import count
from compare.presentation import Presentation
from compare.quantities import assumptions, drive_signals, quantities
from compare.report.curves import MOST, legend, with_peak
from compare.report.peaks import over, peaks, unanswered
from compare.report.tables import html_table, say, terminal_table
from compare.results.analysis import Analysis, Simulation

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OneSide = Analysis | Simulation


def files(result: OneSide) -> dict[str, str]:
    """Every signal, a row for each crank angle (or time)."""
    return {"signals.csv": result.to_csv()}


def said(result: OneSide) -> Iterator[str]:
    """Each reason why there is no answer, and what was filled in."""
    if isinstance(result, Analysis):
        for at, why in unanswered(result):
            where = f"{count(len(at), 'sample')} of {len(over(result).values)}, first {over(result).at(at[0])}"
            yield f"no answer at {where}: {why}; peaks are of the others"
    yield from (f"assumed: {line}" for line in assumptions(result.assumed))


PEAK_HEADS = ("signal", "unit", "highest", "at", "lowest", "at")


def print_peaks(result: OneSide, console: Console) -> None:
    """Print the peaks with their places, in degrees and millimetres; ASCII."""
    rows = [[cell.replace("·", ".") for cell in each.row(over(result).unit)] for each in peaks(result)]
    if rows:
        console.print(terminal_table(PEAK_HEADS, rows, left=("signal", "unit")))


def print_table(result: OneSide, console: Console) -> None:
    """Print the peaks, then what was filled in."""
    print_peaks(result, console)
    say(console, *said(result), repr(result))


def summary_html(result: OneSide) -> str:
    """The peaks with their places, what was filled in, and why there is no answer."""
    lines = "".join(f"<li>{html.escape(line)}</li>" for line in said(result))
    rows = [each.row(over(result).unit) for each in peaks(result)]
    return f"{html_table(rows, PEAK_HEADS, repr(result))}<ul>{lines}</ul>"


def plot(result: OneSide, figure: Figure) -> None:
    """Size of each reaction, and what the drives give, over the crank angle (or time): the six largest, each with its
    peak.
    """
    known, x = quantities(result.mechanism), over(result)
    found = [each.quantity.signal for each in peaks(result)]
    drives = [name for name in drive_signals(result.mechanism) if name in found]
    reactions = sorted(
        (f"reaction_{j.name}_magnitude" for j in result.mechanism.joints if f"reaction_{j.name}_magnitude" in found),
        key=lambda name: -float(np.nanmax(result.signals[name])),
    )
    axes = figure.subplots(2, 1, sharex=True)
    for axis, names in zip(axes, (reactions[:MOST], drives[:MOST]), strict=True):
        for name in names:
            values = known[name].factor * result.signals[name]
            with_peak(axis, np.asarray(x.values), values, known[name].place or known[name].name)
        legend(axis)
    axes[0].set_ylabel("reaction force (N)")
    units = " or ".join(dict.fromkeys(known[name].unit for name in drives)) or "N·m"
    axes[1].set_ylabel(f"drive ({units})")
    axes[1].set_xlabel(f"{x.label} ({x.unit})")
    figure.suptitle(result.case)


PRESENTATION = Presentation(summary_html, print_table, files, plot)
