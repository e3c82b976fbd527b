"""The figures of a diagnosis as data: the residual map, and each signal's residual before and after.

:mod:`compare.report.svg` draws the residuals for a page without script, ``diagnosis.js`` for one with it; the map is
drawn here, a strip for each signal, and gets its colours from the page's style sheet.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from compare.quantities import MINUS, Quantity, number
from compare.report.figure import Axis, Figure, Numbers, Series, extreme, scaled
from compare.report.svg import ticks
from compare.report.words.diagnosis import SIGMA
from compare.report.words.effects import quantity, spoken
from compare.report.words.located import wrapped
from compare.report.words.measured import off_by, off_on_both_sides, reading, run_title
from compare.results.diagnosis import SIDES, DiagnosedRun, Diagnosis, Side

MAP_COLUMNS = 72  # of the map: 5 degrees where the crank turns fully
LEVELS = (2.0, 4.0, 10.0, 30.0)  # sigmas at which the map's colour changes
BAND = 2.0  # sigmas
RESIDUAL_DIGITS = 4  # that a residual is worth
BEFORE, AFTER = "spring-damper", "massless-link"  # whose colours they have: orange and blue, apart for every eye
PAPER_COLUMNS = 250  # columns of a drawing on paper; a line has two points in each


@dataclass(frozen=True)
class Strip:
    """One signal of one run in the map: residuals (sigma) by column, None where there are no samples."""

    panel: int
    run: str
    title: str
    before: Numbers
    after: Numbers
    gap_before: float | None
    gap_after: float | None


@dataclass(frozen=True)
class ResidualMap:
    """Strips over a common axis from ``low`` to ``high``, in the axis' unit."""

    axis: Axis
    low: float
    high: float
    strips: tuple[Strip, ...]

    @property
    def ticks(self) -> list[tuple[str, float]]:
        """Numbers along the axis, each with its place in per cent."""
        values = ticks(self.low, self.high, 4, self.axis.unit == "deg")
        return [(number(v + 0.0, 4), 100 * (v - self.low) / (self.high - self.low)) for v in values]


@dataclass(frozen=True)
class Panel:
    """One signal in one run: measured values and, over them, simulated ones in ``quantity.unit``, and residuals
    (measured minus simulated) in ``unit``, ``per`` of which are one ``quantity.unit``.
    """

    run: int
    signal: str
    quantity: Quantity
    title: str
    unit: str
    per: float
    x: Axis
    over: Numbers
    measured: Numbers
    before: Numbers
    after: Numbers
    noise: float
    noise_text: str
    off: tuple[str, str]
    gap_before: float | None
    gap_after: float | None
    held_out: tuple[tuple[float, float], ...]

    @property
    def summary(self) -> str:
        """The text alternative."""
        sides = (("before", self.before), ("after", self.after))
        worst = [f"{name} up to {extreme(side)} {self.unit}" for name, side in sides]
        return f"Measured minus simulated over {self.x.label}: {'; '.join(worst)}; noise {self.noise_text}."

    def simulated(self, side: Side) -> Numbers:
        """Simulated values (N) in ``quantity.unit``, of an angle those within half a turn of the measured one."""
        residual = self.before if side == "before" else self.after
        return tuple(
            None if m is None or r is None else m - r / self.per for m, r in zip(self.measured, residual, strict=True)
        )


def panels(result: Diagnosis) -> list[Panel]:
    """Every signal of every run, in their order."""
    return [_panel(result, i, run, name) for i, run in enumerate(result.runs) for name in run.signals]


def _panel(result: Diagnosis, i: int, run: DiagnosedRun, name: str) -> Panel:
    channel, what, words = run.signals[name], quantity(result, name), spoken(result, name)
    x, over = _abscissa(run)
    unit, factor = reading(result, name)
    before, after = (scaled(result.residual(run, name, side), factor, RESIDUAL_DIGITS) for side in SIDES)
    return Panel(
        run=i,
        signal=name,
        quantity=what,
        title=words[:1].upper() + words[1:],
        unit=unit,
        per=factor / what.factor,
        x=x,
        over=over,
        measured=scaled(channel.measured, what.factor),
        before=before,
        after=after,
        noise=channel.noise * factor,
        noise_text=off_by(result, name, channel.noise) + ("" if channel.noise_given else ", estimated from the data"),
        off=off_on_both_sides(result, run, name),
        gap_before=channel.gap_before,
        gap_after=channel.gap_after,
        held_out=_blocks(run.held_out, over),
    )


def _abscissa(run: DiagnosedRun) -> tuple[Axis, Numbers]:
    if run.over_time:
        return Axis("time", "s"), scaled(run.time)
    return Axis("crank angle", "deg"), scaled(run.crank_angle, math.degrees(1.0))


def _blocks(held_out: Sequence[int] | None, over: Numbers) -> tuple[tuple[float, float], ...]:
    """Ends of each stretch of samples that were held out."""
    if not held_out:
        return ()
    edges = np.flatnonzero(np.diff([0, *(int(bool(h)) for h in held_out), 0]))
    known = [v or 0.0 for v in over]
    return tuple((known[a], known[b - 1]) for a, b in zip(edges[::2], edges[1::2], strict=True))


def maps(result: Diagnosis) -> list[ResidualMap]:
    """Residual maps: one over the crank angle for the runs at a commanded speed, one over time for the others."""
    turning: list[tuple[int, DiagnosedRun]] = []
    rest: list[tuple[int, DiagnosedRun]] = []
    offset = 0
    for run in result.runs:
        (rest if run.over_time else turning).append((offset, run))
        offset += len(run.signals)
    return [_map(result, group) for group in (turning, rest) if group]


def _map(result: Diagnosis, group: Sequence[tuple[int, DiagnosedRun]]) -> ResidualMap:
    axis = _abscissa(group[0][1])[0]
    over = [np.array(_abscissa(run)[1], float) for _, run in group]
    if axis.unit == "deg" and wrapped(result):
        over, low, high = [x % 360.0 for x in over], 0.0, 360.0
    else:
        low, high = min(float(x.min()) for x in over), max(float(x.max()) for x in over)
    wide = (high - low) or 1.0
    strips = []
    for (offset, run), x in zip(group, over, strict=True):
        columns = np.clip(np.floor((x - low) / wide * MAP_COLUMNS), 0, MAP_COLUMNS - 1).astype(int)
        for k, (name, channel) in enumerate(run.signals.items()):
            before, after = (_cells(result.residual(run, name, side) / channel.noise, columns) for side in SIDES)
            gaps = (channel.gap_before, channel.gap_after)
            strips.append(Strip(offset + k, run_title(run), spoken(result, name), before, after, *gaps))
    return ResidualMap(axis, low, low + wide, tuple(strips))


def _cells(values: np.ndarray, columns: np.ndarray) -> Numbers:
    """Root mean square of residuals (N,) sigma in each column, with the sign of their mean."""
    known = np.isfinite(values)
    count = np.bincount(columns[known], minlength=MAP_COLUMNS)
    total, squares = (np.bincount(columns[known], values[known] ** power, MAP_COLUMNS) for power in (1, 2))
    sizes = np.copysign(np.sqrt(squares / np.maximum(count, 1)), total)
    return tuple(float(f"{size:.3g}") if n else None for size, n in zip(sizes, count, strict=True))


def level(value: float) -> int:
    """The colour of a residual (sigma): 0 within the noise, up to 4 above and -4 below."""
    shade = sum(abs(value) >= least for least in LEVELS)
    return shade if value > 0 else -shade


def strip_svg(cells: Numbers, label: str) -> str:
    """A strip of the map as SVG that stretches to its place; ``label`` (escaped) is its text alternative."""
    paths: dict[int, list[str]] = {}
    start = 0
    levels = [None if value is None else level(value) for value in cells]
    for i in range(1, len(levels) + 1):
        if i == len(levels) or levels[i] != levels[start]:
            shade = levels[start]
            if shade is not None:
                paths.setdefault(shade, []).append(f"M{start} 0h{i - start}v1h-{i - start}z")
            start = i
    drawn = "".join(f'<path class="{shade_class(shade)}" d="{"".join(d)}"/>' for shade, d in sorted(paths.items()))
    return f'<svg viewBox="0 0 {len(cells)} 1" preserveAspectRatio="none" role="img" aria-label="{label}">{drawn}</svg>'


def shade_class(shade: int) -> str:
    """The style of a level: ``none``, ``low1`` to ``low4``, ``high1`` to ``high4``."""
    return "none" if shade == 0 else f"{'high' if shade > 0 else 'low'}{abs(shade)}"


def worst_cell(over: ResidualMap, cells: Numbers) -> str:
    """A strip in words: ``largest -12 sigma at 85 deg``, or that it is all noise."""
    known = [(abs(v), i) for i, v in enumerate(cells) if v is not None]
    if not known:
        return "no samples"
    size, i = max(known)
    if size < LEVELS[0]:
        return "within the noise"
    at = over.low + (i + 0.5) * (over.high - over.low) / len(cells)
    return f"largest {number(cells[i], 2, True)} sigma at {number(at, 3)} {over.axis.unit}"


def figure(panel: Panel, name: str) -> Figure:
    """A panel as a drawing on paper: lines thinned to what it can show, the noise band dashed."""
    ends = (panel.over[0], panel.over[-1]) if panel.over else ()
    limit = BAND * panel.noise
    sides = ((panel.before, "before", BEFORE), (panel.after, "after", AFTER))
    lines = [Series(word, *_thinned(panel.over, side), role) for side, word, role in sides]
    lines += [
        Series(f"noise ±{BAND:g} {SIGMA}" if v > 0 else "", ends, (v,) * len(ends), "frame", "dashed")
        for v in (limit, -limit)
    ]
    title = f"{panel.title}: measured {MINUS} simulated"
    return Figure(name, title, panel.summary, panel.x, Axis(f"measured {MINUS} simulated", panel.unit), tuple(lines))


def overlay(panel: Panel, name: str) -> Figure:
    """Measured and simulated values of a panel over each other, on paper; lines break where an angle goes over half a
    turn from one sample to the next.
    """
    half = 180.0 if panel.quantity.angular else math.inf
    sides = ((panel.simulated("before"), "before", BEFORE), (panel.simulated("after"), "after", AFTER))
    lines = [Series("measured", *_thinned(panel.over, panel.measured), "analytic", "link")]
    lines += [Series(word, *_thinned(panel.over, broken(side, half)), role) for side, word, role in sides]
    summary = (
        f"Measured and simulated over {panel.x.label}: off by {panel.off[0]} before and {panel.off[1]} after (rms)."
    )
    title = f"{panel.title}: measured and simulated"
    return Figure(name, title, summary, panel.x, Axis(panel.quantity.label, panel.quantity.unit), tuple(lines))


def broken(values: Numbers, most: float) -> Numbers:
    """Values (N) with a gap in place of each that is more than ``most`` away from the one before."""
    pairs = zip(values, (None, *values[:-1]), strict=True)
    return tuple(None if v is not None and w is not None and abs(v - w) > most else v for v, w in pairs)


def _thinned(x: Numbers, y: Numbers) -> tuple[Numbers, Numbers]:
    """Of each column of a drawing the lowest and the highest sample, in order; a column with a gap keeps it."""
    step = math.ceil(len(x) / PAPER_COLUMNS)
    if step <= 2:
        return x, y
    kept: list[int] = []
    for start in range(0, len(x), step):
        column = range(start, min(start + step, len(x)))
        known = sorted((v, i) for i in column if (v := y[i]) is not None)
        gap = [i for i in column if y[i] is None][:1]
        kept += sorted({i for _, i in known[:1] + known[-1:]} | set(gap))
    return tuple(x[i] for i in kept), tuple(y[i] for i in kept)
