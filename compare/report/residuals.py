"""What a diagnosis leaves of a signal, shown: root mean square, largest and gap of each run, before and after."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from analytic.mechanism.one_line import count
from compare.presentation import Presentation
from compare.quantities import amount, fitting, number
from compare.report.curves import MOST_CURVES, legend
from compare.report.diagnosis_terminal import in_ascii
from compare.report.tables import html_table, say
from compare.results.diagnosis import DiagnosedRun
from compare.results.residuals import Residual, Residuals, SignalResiduals

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


TURN = 360.0  # deg


def files(result: SignalResiduals) -> dict[str, str]:
    """The residuals, a row for each sample."""
    return {"residuals.csv": result.to_csv()}


def print_table(result: SignalResiduals, console: Console) -> None:
    """Print the residuals of each run in a few numbers."""
    say(console, *lines(result))


def lines(result: SignalResiduals) -> Iterator[str]:
    """Root mean square, largest and where, and the gap, by run; ASCII but for names."""
    yield in_ascii(f"{result.signal}: {result.label}, measured minus simulated")
    for run in result.runs:
        given = "" if run.noise_given else ", estimated from the data"
        noise = amount(run.noise, result.unit)
        yield in_ascii(f"{run.name}: {count(run.time.size, 'sample')}, noise {noise} (1 sigma){given}")
        for side, residual in (("before", run.before), ("after", run.after)):
            yield in_ascii(f"  {side:7} {_largest(run, residual, result.unit)}; gap {number(residual.gap)}")


def _largest(run: Residuals, residual: Residual, unit: str) -> str:
    if residual.rms is None:
        return "no number"
    largest = amount(residual.largest, unit, 3, True)
    return f"rms {amount(residual.rms, unit)}, largest {largest} at {_where(run, residual)}"


def _where(run: Residuals, residual: Residual) -> str:
    if run.over_time:
        return "-" if residual.time is None else f"{residual.time:.4g} s"
    return "-" if residual.crank_angle is None else f"{math.degrees(residual.crank_angle):.4g} deg"


def summary_html(result: SignalResiduals) -> str:
    """Root mean square, largest and gap of each run and side, as a table."""
    rows = [
        (
            run.name,
            side,
            amount(residual.rms, result.unit),
            amount(residual.largest, result.unit, 3, True),
            _where(run, residual),
            number(residual.gap),
        )
        for run in result.runs
        for side, residual in (("before", run.before), ("after", run.after))
    ]
    title = f"{result.signal}: {result.label}, measured minus simulated"
    return html_table(rows, ("run", "side", "rms", "largest", "at", "gap"), title)


def plot(result: SignalResiduals, figure: Figure) -> None:
    """The residuals before and after of the first six runs, the noise shaded."""
    sizes = [size for run in result.runs for r in (run.before, run.after) if (size := r.largest) is not None]
    unit, factor = fitting(result.unit, *sizes)
    runs = result.runs[:MOST_CURVES]
    figure.set_figheight(max(5.0, 2.0 * len(runs) + 1))
    for axis, run in zip(figure.subplots(len(runs), 1, squeeze=False)[:, 0], runs, strict=True):
        draw(axis, run, factor * run.before.values, factor * run.after.values, factor * run.noise)
        axis.set_ylabel(f"{result.label} ({unit})")
    figure.suptitle(f"{result.case}: measured minus simulated, noise within two sigmas shaded")


def draw(axis: Axes, run: Residuals | DiagnosedRun, before: np.ndarray, after: np.ndarray, noise: float) -> None:
    """Residuals (N,) of a run before and after, and the noise (1 sigma) within two sigmas shaded; of a run of several
    turns over one.
    """
    x = run.time if run.over_time else np.degrees(run.crank_angle)
    if not run.over_time and np.ptp(x) > TURN:
        x = x % TURN
    axis.set_xlabel(f"{'time (s)' if run.over_time else 'crank angle (deg)'}, run {run.name}")
    for side, values in (("before", before), ("after", after)):
        axis.plot(x, values, ".", markersize=3, label=side)
    axis.axhspan(-2 * noise, 2 * noise, color="0.9", zorder=0)
    legend(axis)


PRESENTATION = Presentation(summary_html, print_table, files, plot)
