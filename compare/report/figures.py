"""The figures of a report as data, made once; :mod:`compare.report.svg` draws them for a file, ``chart.js`` for the
page.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from compare.quantities import GAMMA, MINUS, Quantity, apart, drive_signals, number
from compare.report.summary import Summary, abscissa
from compare.results.crosscheck import CrossCheck, Run
from compare.results.document import listed

JOURNAL_POINTS = 3000  # about as many points as a drawn journal path keeps
Numbers = tuple[float | None, ...]
Mark = Literal["line", "dashed", "marker", "band", "link", "joint", "pivot"]


@dataclass(frozen=True)
class Axis:
    """What is along an axis, in which unit."""

    label: str
    unit: str

    @property
    def title(self) -> str:
        """Label and unit as an axis prints them."""
        return f"{self.label} ({self.unit})" if self.unit else self.label


@dataclass(frozen=True)
class Series:
    """Points in the axes' units, None where there is none.  ``role`` picks the colour, ``mark`` how it is drawn: a
    ``band`` goes along its upper edge and back along its lower one.

    ``level`` tells several simulators of one joint model apart.  A series that does not ``scale`` has no say in the
    range of the axes; one without a ``name`` is not in the legend.
    """

    name: str
    x: Numbers
    y: Numbers
    role: str
    mark: Mark = "line"
    level: int = 0
    labels: tuple[str, ...] = ()
    scale: bool = True


@dataclass(frozen=True)
class Figure:
    """One figure: ``name`` is its file's stem, ``summary`` its text alternative, a ``plane`` has equal scales in x and
    y.
    """

    name: str
    title: str
    summary: str
    x: Axis
    y: Axis
    series: tuple[Series, ...]
    kind: Literal["curves", "plane"] = "curves"
    note: str = ""


def figures(result: CrossCheck, summary: Summary) -> list[Figure]:
    """Directions of the reactions, paths of the journals and differences, for the joints that the summary is about."""
    if not result.runs:
        return []
    found = [reaction_directions(result, summary, joint) for joint in summary.joints]
    found += [both_sides(result, summary, f"reaction_{joint}_magnitude") for joint in summary.joints]
    given = [name for name in drive_signals(result.mechanism) if any(name in run.analytic for run in result.runs)]
    found += [both_sides(result, summary, name) for name in given]
    found += [
        journal_path(result, summary, joint)
        for joint in summary.joints
        if any(_path(run, joint) for run in result.runs)
    ]
    if all(run.simulator.recorded for run in result.runs):  # a figure of what no file has would be of one side
        found = [figure for figure in found if any(series.mark == "marker" for series in figure.series)]
    found += [differences(result, summary, quantity) for quantity in summary.keys(False, result.mechanism)]
    return [figure for figure in found if any(series.name for series in figure.series)]


def scaled(values: Iterable[float | None] | np.ndarray, factor: float = 1.0) -> Numbers:
    """Values in a reader's unit, to the seven digits that a figure can show; None stays None."""
    return tuple(None if v is None or not math.isfinite(v) else float(f"{factor * v:.7g}") for v in values)


def extreme(values: Numbers) -> str:
    """The largest size of some values, as a summary says it."""
    return number(max((abs(v) for v in values if v is not None), default=None))


def simulators(result: CrossCheck) -> list[str]:
    """Names of the simulators, in order; their index is the level of their series."""
    return list(dict.fromkeys(run.simulator.name for run in result.runs))


def _simulated(result: CrossCheck, run: Run) -> dict[str, Any]:
    """Name, colour and level of a run's series."""
    engines = simulators(result)
    engine = run.simulator.name
    return {"name": f"{engine}, {run.joint_model}", "role": run.joint_model, "level": engines.index(engine)}


def reaction_directions(result: CrossCheck, summary: Summary, joint: str) -> Figure:
    """Gamma of one joint over the crank angle: analytic as lines, each simulated joint model as markers."""
    signal, title = f"reaction_{joint}_angle", f"Direction of the reaction at {joint}"
    return _sides(result, summary, signal, f"gamma_{joint}", title, Axis(GAMMA, "deg"))


def both_sides(result: CrossCheck, summary: Summary, signal: str) -> Figure:
    """A signal over the crank angle: analytic as lines, each simulated joint model as markers."""
    quantity = summary.signals[signal]
    return _sides(result, summary, signal, signal, quantity.title, Axis(quantity.name, quantity.unit))


def _sides(result: CrossCheck, summary: Summary, signal: str, name: str, title: str, up: Axis) -> Figure:
    """Both sides of a signal; angles lie next to those of the first analytic line."""
    quantity = summary.signals[signal]
    axis, unit, _, _ = abscissa(result.runs[0], result.mechanism)
    lines: dict[str, Series] = {}
    marks: list[Series] = []

    def first() -> Numbers:
        return next((line.y for line in lines.values()), ())

    for run in result.runs:
        _, _, factor, x = abscissa(run, result.mechanism)
        over = scaled(x, factor)
        if signal in run.analytic:
            called, role, mark = _analytic(run, summary)
            values = scaled(run.analytic[signal], quantity.factor)
            values = beside(values, first()) if quantity.angular else values
            lines.setdefault(called, Series(called, over, values, role, mark))
        if _shows(run, signal):
            values = scaled(run.simulated[signal], quantity.factor)
            values = same_turn(beside(values, first()), first()) if quantity.angular else values
            marks.append(Series(**_simulated(result, run), x=over, y=values, mark="marker"))
    spans = [f"{s.name} {_span(s.y, quantity)}" for s in [*lines.values(), *marks]]
    text = f"{title} over {axis}. {'; '.join(spans)}."
    return Figure(name, title, text, Axis(axis, unit), up, (*lines.values(), *marks))


def _shows(run: Run, signal: str) -> bool:
    """Whether a run has a signal: a file of results need not have any."""
    return signal in run.simulated and not (run.simulator.recorded and np.all(np.isnan(run.simulated[signal])))


def _analytic(run: Run, summary: Summary) -> tuple[str, str, Literal["line", "dashed"]]:
    """Name, colour and mark of a run's analytic line."""
    if any(run.clearance.values()):
        return f"analytic, {run.analytic_model.replace('_', ' ')}", "analytic", "line"
    if any(told.clearance != "none" for told in summary.runs):
        return "analytic, ideal linkage (first-order direction)", "ideal-line", "dashed"
    return "analytic", "analytic", "line"


def beside(angles: Numbers, reference: Numbers, turn: float = 360.0) -> Numbers:
    """Directions shifted by whole turns, each unbroken piece on its own, so that they lie next to the reference's.

    Angles are continued along a run, but every run starts in a turn of its own, and so does each piece after a gap.
    """
    if len(reference) != len(angles):
        return angles
    out: list[float | None] = []
    turns: float | None = None
    for value, other in zip(angles, reference, strict=True):
        if value is None:
            turns = None
        elif turns is None and other is not None:
            turns = turn * round((other - value) / turn)
        out.append(None if value is None else value + (turns or 0.0))
    return tuple(out)


def same_turn(angles: Numbers, reference: Numbers, turn: float = 360.0) -> Numbers:
    """Angles each shifted by whole turns to within half a turn of the reference's at its sample, so that their
    difference is the one judged.

    Where the reference has none, an angle lies beside the last one; where it is of other samples, angles stay.
    """
    if len(reference) != len(angles):
        return angles
    out: list[float | None] = []
    last = next((r for r in reference if r is not None), None)
    for a, r in zip(angles, reference, strict=True):
        last = last if r is None else r
        out.append(a if a is None or last is None else a - turn * round((a - last) / turn))
        last = last if out[-1] is None else out[-1]
    return tuple(out)


def _span(values: Numbers, quantity: Quantity) -> str:
    known = [v for v in values if v is not None]
    return f"from {number(known[0], 4)} to {number(known[-1], 4)} {quantity.unit}" if known else "has no values"


def _path(run: Run, joint: str) -> bool:
    return joint in run.journal and bool(run.clearance.get(joint))


def journal_path(result: CrossCheck, summary: Summary, joint: str) -> Figure:
    """Path of one joint's journal within its clearance circle, and the analytic points on the rim."""
    runs = [run for run in result.runs if _path(run, joint)]
    radius = 1e3 * runs[0].clearance[joint]
    rim = clearance_circle(radius)
    paths = []
    for run in runs:
        x, y = thinned(run.journal[joint].x, run.journal[joint].y, 1e-3 * radius)
        paths.append(Series(**_simulated(result, run), x=scaled(x, 1e3), y=scaled(y, 1e3)))
    names = (f"clearance_{joint}_x", f"clearance_{joint}_y")
    model = runs[0].analytic_model.replace("_", " ")
    rim_x, rim_y = (scaled(runs[0].analytic.get(name, ()), 1e3) for name in names)
    points = Series(f"analytic, {model}", rim_x, rim_y, "analytic", "marker")
    unit = summary.signals[names[0]].unit
    share = [
        f"{run.title} {number(dict(run.free).get(joint), 2)} % of what is compared without contact"
        for run in summary.runs
        if joint in dict(run.free)
    ]
    text = f"Path of the journal of {joint} in its clearance circle of radius {number(radius)} {unit}."
    said = "; ".join(share)
    axes = (Axis("displacement x", unit), Axis("displacement y", unit))
    series, title = (rim, *paths, points), f"Path of the journal in {joint}"
    return Figure(f"journal_{joint}", title, f"{text} {said}".strip(), *axes, series, "plane", said)


def clearance_circle(radius: float) -> Series:
    """The circle of a ``radius`` (mm) that a pin has in its bearing."""
    turn = [2 * math.pi * k / 120 for k in range(121)]
    x, y = scaled(math.cos(a) * radius for a in turn), scaled(math.sin(a) * radius for a in turn)
    return Series("clearance circle", x, y, "frame")


def thinned(x: np.ndarray, y: np.ndarray, step: float) -> tuple[list[float], list[float]]:
    """A path without the points that are nearer than ``step`` (mm) to the last one kept; coarser where it is long.

    ``x`` and ``y`` are in m.  Unlike leaving out every n-th point it keeps the corners of impacts.
    """
    known = np.isfinite(x) & np.isfinite(y)
    points = list(zip(x[known].tolist(), y[known].tolist(), strict=True))
    if not points:
        return [], []
    length = sum(math.dist(p, q) for p, q in pairwise(points))
    step = max(1e-3 * step, length / JOURNAL_POINTS)
    kept = [points[0]]
    for point in points[1:]:
        if math.dist(point, kept[-1]) >= step:
            kept.append(point)
    return [p[0] for p in kept], [p[1] for p in kept]


def difference(run: Run, quantity: Quantity) -> Numbers:
    """Simulated minus analytic of one signal of a run, as it is judged, in the quantity's unit."""
    pairs = zip(listed(run.simulated[quantity.signal]), listed(run.analytic[quantity.signal]), strict=True)
    return scaled(
        (None if s is None or a is None else apart(s, a, quantity.angular) for s, a in pairs), quantity.factor
    )


def differences(result: CrossCheck, summary: Summary, quantity: Quantity) -> Figure:
    """Simulated minus analytic of one signal over the crank angle, each run a line; its tolerance where it is near."""
    axis, unit, _, _ = abscissa(result.runs[0], result.mechanism)
    lines, limits = [], set()
    for run, told in zip(result.runs, summary.runs, strict=True):
        if quantity.signal not in run.analytic or quantity.signal not in run.simulated:
            continue
        row = told.row(quantity.signal)
        _, _, factor, x = abscissa(run, result.mechanism)
        lines.append(Series(**_simulated(result, run), x=scaled(x, factor), y=difference(run, quantity)))
        limits |= {row.tolerance} if row and row.tolerance and row.quantity.unit == quantity.unit else set()
    worst = [f"{line.name} up to {extreme(line.y)} {quantity.unit}" for line in lines]
    note = f"Tolerance: {', '.join(f'±{number(t)}' for t in sorted(limits))} {quantity.unit}" if limits else ""
    over = [line.x for line in lines if line.x]
    ends = (over[0][0], over[0][-1]) if over else ()
    bounds = [
        Series("", ends, (t, t), "frame", "dashed", scale=False)
        for limit in sorted(limits)
        if ends
        for t in (limit, -limit)
    ]
    text = f"{quantity.title}, simulated minus analytic, over {axis}: {'; '.join(worst)}. {note}".strip()
    axes = (Axis(axis, unit), Axis(f"simulated {MINUS} analytic", quantity.unit))
    return Figure(f"difference_{quantity.signal}", quantity.title, text, *axes, (*lines, *bounds), note=note)
