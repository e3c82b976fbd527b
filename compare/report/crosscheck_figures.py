"""The figures of a cross-check: directions of the reactions, paths of the journals, both sides and differences."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Literal

import numpy as np

from analytic.mechanism.signals import same_turn
from compare.quantities import GAMMA, MINUS, Quantity, apart, drive_signals, number
from compare.report.curves import MOST_CURVES
from compare.report.figure import ALL, Axis, Figure, Mark, Numbers, Series, extreme, scaled
from compare.report.summary import REAL, Summary
from compare.results.crosscheck import CrossCheck, Run
from compare.results.document import listed

SIDES_DIGITS = 10  # of both sides of a signal: engines agree to eight
JOURNAL_POINTS = 3000  # about as many points as a drawn journal path keeps


def figures(summary: Summary) -> list[Figure]:
    """Directions of the reactions, paths of the journals and differences, for the joints that the summary is about."""
    runs, joints = summary.result.runs, summary.joints
    if not runs:
        return []
    drives = [name for name in drive_signals(summary.result.mechanism) if any(name in run.analytic for run in runs)]
    drawn = [reaction_directions(summary, joint) for joint in joints]
    asked = [
        s.name for s in summary.result.signals.values() if s.on_request and any(s.name in r.analytic for r in runs)
    ]
    forces = [f"reaction_{joint}_magnitude" for joint in joints]
    drawn += [both_sides(summary, name) for name in (*forces, *drives, *asked)]
    drawn += [journal_path(summary, joint) for joint in joints if any(_has_path(run, joint) for run in runs)]
    if all(run.simulator.recorded for run in runs):  # a figure of what no file has would be of one side
        drawn = [figure for figure in drawn if any(series.mark == "marker" for series in figure.series)]
    drawn += [differences(summary, quantity) for quantity in summary.keys()]
    return [figure for figure in drawn if any(series.name for series in figure.series)]


def simulators(result: CrossCheck) -> list[str]:
    """Names of the simulators, in order; their index is the level of their series."""
    return list(dict.fromkeys(run.simulator.name for run in result.runs))


def _simulated(summary: Summary, run: Run, x: Numbers, y: Numbers, mark: Mark = "line") -> Series:
    """What a run simulated, in the colour of its joint model and at the level of its engine."""
    level = simulators(summary.result).index(run.simulator.name)
    return Series(run.title, x, y, run.joint_model, mark, level)


def reaction_directions(summary: Summary, joint: str) -> Figure:
    """Gamma of one joint over the crank angle: analytic as lines, each simulated joint model as markers."""
    signal, title = f"reaction_{joint}_angle", f"Direction of the reaction at {joint}"
    return _sides(summary, signal, f"gamma_{joint}", title, Axis(GAMMA, "deg"))


def both_sides(summary: Summary, signal: str) -> Figure:
    """A signal over the crank angle: analytic as lines, each simulated joint model as markers."""
    quantity = summary.signals[signal]
    return _sides(summary, signal, signal, quantity.title, Axis(quantity.name, quantity.unit))


def _sides(summary: Summary, signal: str, name: str, title: str, up: Axis) -> Figure:
    """Both sides of a signal, several engines side by side; angles lie next to those of the first analytic line."""
    quantity, over, engines = summary.signals[signal], summary.runs[0].over, simulators(summary.result)
    panels, everywhere = (tuple(engines), ALL) if len(engines) > 1 else ((), 0)
    lines: dict[str, Series] = {}
    marks: list[Series] = []

    first = next((shown.run.analytic[signal] for shown in summary.runs if signal in shown.run.analytic), np.zeros(0))
    for shown in summary.runs:
        run, x = shown.run, scaled(shown.over.values)
        if signal in run.analytic:
            line, role, mark = _analytic(run, summary)
            values = scaled(run.analytic[signal], quantity.factor, SIDES_DIGITS)
            if quantity.angular and lines:
                values = beside(values, next(iter(lines.values())).y)
            lines.setdefault(line, Series(line, x, values, role, mark, everywhere))
        if shows(run, signal):
            simulated = run.simulated[signal]
            simulated = same_turn(simulated, first) if quantity.angular else simulated
            values = scaled(simulated, quantity.factor, SIDES_DIGITS)
            marks.append(_simulated(summary, run, x, values, "marker"))
    spans = [f"{s.name} {_span(s.y, quantity)}" for s in [*lines.values(), *marks]]
    text = f"{title} over {over.label}. {'; '.join(spans)}."
    return Figure(name, title, text, Axis(over.label, over.unit), up, (*lines.values(), *marks), panels=panels)


def shows(run: Run, signal: str) -> bool:
    """Whether a run has a signal: a file of results need not have any."""
    return signal in run.simulated and not (run.simulator.recorded and np.all(np.isnan(run.simulated[signal])))


def _analytic(run: Run, summary: Summary) -> tuple[str, str, Literal["line", "dashed"]]:
    """Name, colour and mark of a run's analytic line."""
    if run.clearance:
        return f"analytic, {run.analytic_model.replace('_', ' ')}", "analytic", "line"
    if any(other.clearance for other in summary.result.runs):
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


def _span(values: Numbers, quantity: Quantity) -> str:
    known = [v for v in values if v is not None]
    return f"from {number(known[0], 4)} to {number(known[-1], 4)} {quantity.unit}" if known else "has no values"


def reaction_vectors(summary: Summary) -> Iterator[Figure]:
    """The force on the second body of each joint as a vector in the ground's frame: the engines over the analytic
    curve, at most MOST_CURVES; of several engines with the joint model that most of them have, the most real first.
    """
    for joint in summary.result.mechanism.joints:
        names = [f"reaction_{joint.name}_{axis}" for axis in "xy"]
        there = [shown for shown in summary.runs if all(shows(shown.run, name) for name in names)]
        models = [shown.run.joint_model for shown in there]
        if len({shown.run.simulator.name for shown in there}) > 1:
            model = max((m for m in REAL if m in models), key=models.count)
            there = [shown for shown in there if shown.run.joint_model == model]
        lines: dict[str, Series] = {}
        marks: list[Series] = []
        for shown in there:
            name, role, mark = _analytic(shown.run, summary)
            if all(axis in shown.run.analytic for axis in names):
                sides = (shown.run.analytic[axis] for axis in names)
                x, y = (scaled(np.append(v, v[: int(shown.over.around)])) for v in sides)
                lines.setdefault(name, Series(name, x, y, role, mark, ALL))
            x, y = (scaled(shown.run.simulated[axis]) for axis in names)
            marks.append(_simulated(summary, shown.run, x, y, "marker"))
        series = (*lines.values(), *marks)[:MOST_CURVES]
        if marks:
            title = f"Reaction at {joint.name} as a vector: on {joint.bodies[1]}"
            left, every = len(series) - len(lines), len(summary.runs)
            note = f"{left} of {every} runs" if left < every else ""
            axes = Axis("force x", "N"), Axis("force y", "N")
            yield Figure(f"vector_{joint.name}", title, f"{title}, by engine.", *axes, series, "plane", note)


def _has_path(run: Run, joint: str) -> bool:
    return joint in run.journal and joint in run.clearance


def journal_path(summary: Summary, joint: str) -> Figure:
    """Path of one joint's journal within its clearance circle, and the analytic points on the rim."""
    runs = [run for run in summary.result.runs if _has_path(run, joint)]
    radius = 1e3 * runs[0].clearance[joint]
    rim = clearance_circle(radius)
    paths = []
    for run in runs:
        x, y = thinned(run.journal[joint].x, run.journal[joint].y, 1e-3 * radius)
        paths.append(_simulated(summary, run, scaled(x, 1e3), scaled(y, 1e3)))
    names = (f"clearance_{joint}_x", f"clearance_{joint}_y")
    model = runs[0].analytic_model.replace("_", " ")
    rim_x, rim_y = (scaled(runs[0].analytic.get(name, ()), 1e3) for name in names)
    points = Series(f"analytic, {model}", rim_x, rim_y, "analytic", "marker")
    unit = summary.signals[names[0]].unit
    note = "; ".join(
        f"{run.title} {number(100 * run.free_share[joint], 2)} % of what is compared without contact"
        for run in summary.result.runs
        if run.free_share.get(joint)
    )
    text = f"Path of the journal of {joint} in its clearance circle of radius {number(radius)} {unit}."
    axes = (Axis("displacement x", unit), Axis("displacement y", unit))
    series, title = (rim, *paths, points), f"Path of the journal in {joint}"
    return Figure(f"journal_{joint}", title, f"{text} {note}".strip(), *axes, series, "plane", note)


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


def differences(summary: Summary, quantity: Quantity) -> Figure:
    """Simulated minus analytic of one signal over the crank angle, the engines side by side, each joint model a line
    between its tolerances.
    """
    over = summary.runs[0].over
    lines, bounds = list[Series](), list[Series]()
    for shown in summary.runs:
        if quantity.signal in shown.run.analytic and quantity.signal in shown.run.simulated:
            row, apart = shown.row(quantity.signal), difference(shown.run, quantity)
            line = _simulated(summary, shown.run, scaled(shown.over.values), apart)
            lines.append(line)
            if row and row.tolerance and row.quantity.unit == quantity.unit:
                ends = (min(shown.over.values), max(shown.over.values))
                bounds += [
                    replace(line, name="", x=ends, y=(t, t), mark="dashed") for t in (row.tolerance, -row.tolerance)
                ]
    worst = [f"{line.name} up to {extreme(line.y)} {quantity.unit}" for line in lines]
    note = "Dashed: the tolerance at the sample where the difference takes the largest share of it." if bounds else ""
    text = f"{quantity.title}, simulated minus analytic, over {over.label}: {'; '.join(worst)}. {note}".strip()
    axes = (Axis(over.label, over.unit), Axis(f"simulated {MINUS} analytic", quantity.unit))
    series, panels = (*lines, *bounds), tuple(simulators(summary.result))
    return Figure(f"difference_{quantity.signal}", quantity.title, text, *axes, series, note=note, panels=panels)
