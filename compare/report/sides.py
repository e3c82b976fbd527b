"""One side of a comparison, shown: its signals as a table, a short one for a terminal or a notebook, the curves."""

from __future__ import annotations

import html
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from analytic.mechanism.one_line import count
from compare.presentation import Presentation
from compare.quantities import assumptions, drive_signals, plain, quantities
from compare.report.summary import by_reason
from compare.report.tables import html_table, say, terminal_table
from compare.results.analysis import Analysis, Simulation

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OneSide = Analysis | Simulation


def files(result: OneSide) -> dict[str, str]:
    """Every signal, a row for each crank angle (or time)."""
    return {"signals.csv": result.to_csv()}


def _ranges(result: OneSide) -> list[tuple[str, str, str, str]]:
    """Each signal's name, unit, smallest and largest value."""
    known, rows = quantities(result.mechanism), []
    for name, values in result.signals.items():
        quantity = known.get(name)
        if quantity is None or not np.isfinite(values).any():
            continue
        low, high = (quantity.factor * float(f(values)) for f in (np.nanmin, np.nanmax))
        rows.append((quantity.label, quantity.unit.replace("·", "."), plain(low, 4), plain(high, 4)))
    return rows


def _said(result: OneSide) -> Iterator[str]:
    """What was filled in, and each reason why there is no answer."""
    yield from (f"assumed: {line}" for line in assumptions(result.assumed))
    if isinstance(result, Analysis):
        for why, at in by_reason(result.flags).items():
            angle = f"{np.degrees(result.crank_angle[at[0]]):.4g} deg"
            where = angle if result.time is None else f"{result.time[at[0]]:.4g} s"
            yield f"no answer at {count(len(at), 'sample')}, first {where}: {why}"


RANGE_HEADS = ("signal", "unit", "smallest", "largest")


def print_table(result: OneSide, console: Console) -> None:
    """Print the range of each signal, in degrees and millimetres."""
    console.print(terminal_table(RANGE_HEADS, _ranges(result), left=("signal", "unit")))
    say(console, *_said(result), repr(result))


def summary_html(result: OneSide) -> str:
    """The range of each signal, what was filled in, and why there is no answer."""
    said = "".join(f"<li>{html.escape(line)}</li>" for line in _said(result))
    return f"{html_table(_ranges(result), RANGE_HEADS, repr(result))}<ul>{said}</ul>"


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
