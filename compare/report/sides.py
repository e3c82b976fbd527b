"""One side of a comparison, shown: its signals as a table, a short one for a terminal or a notebook, the curves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from analytic.mechanism.one_line import count
from compare.presentation import Presentation
from compare.quantities import assumptions, drive_signals, quantities
from compare.report.curves import MOST_CURVES, legend, partly, with_peak
from compare.report.peaks import over, peak, peaks, unanswered
from compare.report.tables import html_list, html_table, print_rows, say
from compare.report.words.limits import limits
from compare.results.analysis import Analysis, Simulation

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OneSide = Analysis | Simulation


def files(result: OneSide) -> dict[str, str]:
    """Every signal, a row for each crank angle (or time)."""
    return {"signals.csv": result.to_csv()}


def said(result: OneSide) -> Iterator[str]:
    """What became of each limit, each reason why there is no answer, and what was filled in."""
    if isinstance(result, Analysis):
        yield from (f"{limit.verdict}: {sentence}" for _, limit, sentence in limits(result))
        for at, why in unanswered(result):
            where = f"{count(len(at), 'sample')} of {len(over(result).values)}, first {over(result).at(at[0])}"
            yield f"no answer at {where}: {why}; peaks are of the others"
        turned = bool(result.flags and result.clearance)
        if turned and result.motion == "driven" and result.analytic_model == "equilibrium":
            yield "where a reaction turns too fast, first_order has an answer, and a simulation with contact"
    yield from (f"assumed: {line}" for line in assumptions(result.assumed))


PEAK_HEADS = ("signal", "unit", "highest", "at", "lowest", "at")


def print_peaks(result: OneSide, console: Console) -> None:
    """Print the peaks with their places, in degrees and millimetres; ASCII."""
    rows = [[cell.replace("·", ".") for cell in each.row(over(result).unit)] for each in peaks(result)]
    if rows:
        print_rows(console, PEAK_HEADS, rows, left=("signal", "unit"))


def print_table(result: OneSide, console: Console) -> None:
    """Print the peaks, then what was filled in."""
    print_peaks(result, console)
    say(console, *said(result), repr(result))


def summary_html(result: OneSide) -> str:
    """The peaks with their places, what was filled in, and why there is no answer."""
    rows = [each.row(over(result).unit) for each in peaks(result)]
    return html_table(rows, PEAK_HEADS, repr(result)) + html_list(said(result))


def plot(result: OneSide, figure: Figure) -> None:
    """Size of each reaction, and what the drives give, over the crank angle (or time): the six largest."""
    found = {each.quantity.signal: -abs(each.largest.value) for each in peaks(result)}
    reactions = [f"reaction_{joint.name}_magnitude" for joint in result.mechanism.joints]
    chosen: list[str] = []
    hidden: list[str] = []
    for names in (sorted(reactions, key=lambda name: found.get(name, 0.0)), drive_signals(result.mechanism)):
        there = [name for name in names if name in found]
        chosen += there[:MOST_CURVES]
        hidden += there[MOST_CURVES:]
    plot_signals(result, figure, chosen)
    known = quantities(result.mechanism)
    left = f"curves, the largest, without {', '.join(known[name].label for name in hidden)}"
    partly(figure, len(chosen), len(chosen) + len(hidden), left)


def plot_signals(result: OneSide, figure: Figure, signals: Sequence[str]) -> None:
    """Signals over the crank angle (deg), or the time (s), those of one unit together, each with its peak."""
    known, x = quantities(result.mechanism), over(result)
    units = dict.fromkeys(known[name].unit for name in signals)
    figure.set_figheight(max(4.0, 2.5 * len(units)))
    axes = figure.subplots(max(1, len(units)), 1, sharex=True, squeeze=False)[:, 0]
    for axis, unit in zip(axes, units, strict=False):
        those = [known[name] for name in dict.fromkeys(signals) if known[name].unit == unit]
        names = list(dict.fromkeys(quantity.name for quantity in those))
        for quantity in those:
            values = quantity.factor * result.signals[quantity.signal]
            end = peak(result, quantity).largest if np.isfinite(values).any() else None
            label = (quantity.place if len(names) == 1 else "") or quantity.label
            with_peak(axis, x.values, values, label, end)
        axis.set_ylabel(f"{names[0]} ({unit})" if len(names) == 1 else unit)
        legend(axis)
    axes[-1].set_xlabel(f"{x.label} ({x.unit})")
    figure.suptitle(result.case)


PRESENTATION = Presentation(summary_html, print_table, files, plot, plot_signals)
