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
    """What was filled in, and each reason why there is no answer."""
    yield from (f"assumed: {line}" for line in assumptions(result.assumed))
    if isinstance(result, Analysis):
        for at, why in unanswered(result):
            yield f"no answer at {count(len(at), 'sample')}, first {over(result).at(at[0])}: {why}"


PEAK_HEADS = ("signal", "unit", "highest", "at", "lowest", "at")


def print_peaks(result: OneSide, console: Console) -> None:
    """Print the peaks with their places, in degrees and millimetres; ASCII."""
    rows = [[cell.replace("·", ".") for cell in peak.row(over(result))] for peak in peaks(result)]
    if rows:
        console.print(terminal_table(PEAK_HEADS, rows, left=("signal", "unit")))


def print_table(result: OneSide, console: Console) -> None:
    """Print the peaks, then what was filled in."""
    print_peaks(result, console)
    say(console, *said(result), repr(result))


def summary_html(result: OneSide) -> str:
    """The peaks with their places, what was filled in, and why there is no answer."""
    lines = "".join(f"<li>{html.escape(line)}</li>" for line in said(result))
    rows = [peak.row(over(result)) for peak in peaks(result)]
    return f"{html_table(rows, PEAK_HEADS, repr(result))}<ul>{lines}</ul>"


def plot(result: OneSide, figure: Figure) -> None:
    """Size of each reaction, and the drive torque, over the crank angle (over time where the linkage swings)."""
    known = quantities(result.mechanism)
    time = result.time if result.mechanism.speed is None else None
    x = np.degrees(result.crank_angle) if time is None else time
    force, torque = figure.subplots(2, 1, sharex=True)
    for joint in result.mechanism.joints:
        force.plot(
            x, result.signals[f"reaction_{joint.name}_magnitude"], label=known[f"reaction_{joint.name}_magnitude"].label
        )
    for name in drive_signals(result.mechanism):
        if name in result.signals:
            torque.plot(x, result.signals[name], label=known[name].label)
    force.set_ylabel("reaction force (N)")
    torque.set_ylabel("drive torque (N·m)" if all(not j.prismatic for j in result.mechanism.motors) else "drives")
    torque.set_xlabel("crank angle (deg)" if time is None else "time (s)")
    force.legend(fontsize="small")
    force.set_title(repr(result))


PRESENTATION = Presentation(summary_html, print_table, files, plot)
