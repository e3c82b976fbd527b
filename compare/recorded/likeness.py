"""Which signal of the nominal model a column is a straight line in."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from analytic.errors import Error
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.mechanism import Mechanism
from analytic.mechanism.columns import ANY_LAYOUT
from analytic.mechanism.signals import Signal, turned_near, unwound
from analytic.mechanism.units import OFFERED, SI, dimension, factor
from analytic.paper.kinetostatics import kinetostatics
from compare.judge.signals import with_derived
from compare.recorded.every_column import LEAST_READINGS
from compare.recorded.headings import TIME, Naming, unit_of, written_unit
from compare.recorded.smooth import Smoother

RARE_UNITS = {"min", "in", "kgf", "lbf", "lbf.in"}  # in no logger: only a heading that says one is believed
GUESSED_UNITS = {kind: tuple(unit for unit in units if unit not in RARE_UNITS) for kind, units in OFFERED.items()}
STRAIGHT_LINE = 0.02  # of a column's own scatter, that may be left of it beside a signal's
FAR_ZERO = 0.05  # of a half turn, or of a place, by which a sensor's zero must be off to be told
NEAR_UNIT = 0.05  # relative, by which its slope may be off a unit's
ONLY = 3.0  # times as much that the next best signal must leave
COMPARED_SAMPLES = 400  # of a file, by which its columns are told
FOLLOWED = 10_000  # of a file, by which the crank's motion is
TRIED_ZEROS = 72  # of an encoder, that are tried around a turn
LIKE = 0.8  # how unlike a column may be that tells an encoder's zero
LIKELY_SHARE = 0.5  # of a column's scatter: a signal that leaves less may be what it is
UNKNOWN = "not recognised: ignored until you say here what it is"
PASSING = 1e6  # largest ratio of a count's scale


@dataclass(frozen=True)
class Guess:
    """One column: its heading, and what it is taken for.

    ``signal`` is None for what is none; ``scale`` is a count's, ``offset`` that of another zero.  ``why`` says how it
    was told; ``sure`` that the heading, or the row of units under it, says it all.
    """

    heading: str
    signal: Signal | None
    unit: str = ""
    scale: float = 1.0
    sign: int = 1
    offset: float = 0.0
    why: str = ""
    sure: bool = False

    def si(self, readings: np.ndarray) -> np.ndarray:
        """Readings (N,) in SI; what is no signal, as it is."""
        if self.signal is None:
            return readings
        return (self.sign * self.scale * readings + self.offset) * factor(self.unit, dimension(self.signal))


@dataclass(frozen=True)
class Matching:
    """What columns are along one motion of the crank, and how many of them that leaves, counting in part those that
    are nearly like a signal.
    """

    guesses: dict[str, Guess]
    left: float


def by_model(
    columns: Mapping[str, np.ndarray],
    guesses: Mapping[str, Guess],
    mechanism: Mechanism,
    time: np.ndarray,
    crank: Guess,
) -> Matching:
    """Columns that are a straight line in a signal of the nominal model along the crank's motion."""
    angle = crank.si(columns[crank.heading])
    good = np.flatnonzero(np.isfinite(angle) & np.isfinite(time))
    at, some = (good[:: max(1, -(-good.size // most))] for most in (COMPARED_SAMPLES, FOLLOWED))
    continued = np.full(angle.shape, np.nan)
    continued[good] = unwound(angle[good])
    try:
        course = Smoother(time[some], continued[some]).course
        moved = kinematics(Assembly(mechanism), course(time[at]), course(time[at], 1), course(time[at], 2))
        signals = with_derived(kinetostatics(moved).signals(), mechanism)
    except (Error, ValueError, np.linalg.LinAlgError):
        return Matching({}, float(len(columns)))
    names = Naming(mechanism, ANY_LAYOUT)
    taken = {g.signal for g in guesses.values() if g.signal is not None}
    free = {
        name: values
        for name, values in signals.items()
        if (signal := names.signal(name)) is not None and signal not in taken and signal.kind != "position"
    }  # where a joint is, is told by the poses of its bodies
    matched: dict[str, Guess] = {}
    left = 0.0
    for heading, values in columns.items():
        known = guesses[heading].signal
        if heading == crank.heading or known == TIME:
            continue
        if known is not None:
            left += _unlike(
                _lines(guesses[heading].si(values[at]), {known.name: signals[known.name]}, names), known=True
            )
            continue
        lines = _lines(values[at], {name: each for name, each in free.items() if _may(heading, name, names)}, names)
        left += _unlike(lines)
        match = _matched(heading, lines, names)
        if match.signal is not None and match.signal in {g.signal for g in matched.values()}:
            match = Guess(heading, None, why=f"{UNKNOWN}; {match.signal.name} has a column already")
        matched[heading] = match
    return Matching(matched, left)


def zeroed(
    columns: Mapping[str, np.ndarray], guesses: Mapping[str, Guess], mechanism: Mechanism, crank: Guess
) -> Guess:
    """An encoder with the zero at which most columns are straight lines in where the bodies of the nominal model
    are; as it is where it does not turn fully.
    """
    grid = np.linspace(0, 2 * math.pi, TRIED_ZEROS, endpoint=False)
    try:
        signals = kinetostatics(kinematics(Assembly(mechanism), grid, 0.0, 0.0)).signals()
    except (Error, ValueError, np.linalg.LinAlgError):
        return crank
    names = Naming(mechanism, ANY_LAYOUT)
    poses = {name: values for name, values in signals.items() if names.known[name].kind == "pose"}
    encoder = mechanism.encoder.name
    angle = crank.si(columns[crank.heading])
    every = max(1, angle.size // COMPARED_SAMPLES)
    candidates = {
        heading: [g.signal.name]
        if g.signal is not None
        else [n for n in poses if n != encoder and _may(heading, n, names)]
        for heading, g in guesses.items()
        if heading != crank.heading and (g.signal is None or g.signal.name in poses)
    }

    def off(zero: float, headings: Iterable[str] = tuple(candidates)) -> dict[str, float]:
        place = np.mod(angle[::every] + zero, 2 * math.pi)
        at = {name: _around(place, grid, values, names.known[name].wraps) for name, values in poses.items()}
        left = {}
        for heading in headings:
            lines = _lines(
                guesses[heading].si(columns[heading][::every]), {name: at[name] for name in candidates[heading]}, names
            )
            left[heading] = _unlike(lines, known=guesses[heading].signal is not None)
        return left

    rough = min(grid.tolist(), key=lambda zero: sum(off(zero).values()))
    step = float(grid[1])
    like = [heading for heading, left in off(rough).items() if left < LIKE] or list(candidates)
    fine = minimize_scalar(
        lambda zero: sum(off(zero, like).values()), bounds=(rough - step, rough + step), method="bounded"
    )
    zero = float(fine.x)
    degrees = (math.degrees(zero) + 180) % 360 - 180
    offset = float(f"{math.radians(degrees) / factor(crank.unit, 'angle'):.4g}")
    return replace(crank, offset=offset, why=f"{crank.why}; its zero lies {degrees:.3g} deg off")


def _around(place: np.ndarray, grid: np.ndarray, values: np.ndarray, wraps: bool) -> np.ndarray:
    """A signal (K,) around a turn at places (N,) rad in it."""
    closed = np.append(np.exp(1j * values) if wraps else values, np.exp(1j * values[:1]) if wraps else values[:1])
    interpolated = np.interp(place, np.append(grid, 2 * math.pi), closed)
    return np.angle(interpolated) if wraps else interpolated


def _may(heading: str, signal: str, names: Naming) -> bool:
    """Whether a column may be a signal, by the unit that its heading has."""
    kind = dimension(names.known[signal])
    return (
        not unit_of(heading)
        or bool(written_unit(heading, kind))
        or not any(written_unit(heading, each) for each in GUESSED_UNITS)
    )


@dataclass(frozen=True, order=True)
class _Line:
    """A column as a straight line in a signal (SI): the share of its scatter that this leaves, the line's slope, and a
    point of it.
    """

    miss: float
    name: str
    slope: float
    reading: float
    value: float


def _lines(values: np.ndarray, signals: Mapping[str, np.ndarray], names: Naming) -> list[_Line]:
    """A column (N,) as a straight line in each of these signals; the best first."""
    here = np.isfinite(values)
    y = values[here] - values[here].mean() if here.any() else values[here]
    scatter = float(np.sqrt(np.mean(y**2))) if y.size else 0.0
    if y.size < LEAST_READINGS or scatter == 0:
        return []
    lines = []
    for name, series in signals.items():
        x = unwound(series[here]) if names.known[name].wraps else series[here]
        if not np.all(np.isfinite(x)) or np.ptp(x) < 1e-9 * (np.abs(x).max() or 1.0):
            continue
        value = float(x.mean())
        x = x - value
        slope = float(x @ y) / float(x @ x)
        miss = float(np.sqrt(np.mean((y - slope * x) ** 2))) / scatter
        lines.append(_Line(miss, name, slope, float(values[here].mean()), value))
    return sorted(lines)


def _unlike(lines: Sequence[_Line], known: bool = False) -> float:
    """How unlike a column is to the best of these signals: 0 where it is a straight line in it, a half where so much is
    left as may be, towards 1 beyond.  The line of a ``known`` signal must be the signal itself but for its zero.
    """
    if not lines:
        return 1.0
    line = lines[0]
    miss = math.hypot(line.miss, 1 / line.slope - 1) if known and line.slope else line.miss
    return miss / (miss + STRAIGHT_LINE)


def _matched(heading: str, lines: Sequence[_Line], names: Naming) -> Guess:
    """The signal that a column is a straight line in, with a unit's slope; none if there is none, or two."""
    if not lines:
        return Guess(heading, None, why=UNKNOWN)
    line = lines[0]
    name, miss = line.name, line.miss
    if miss > STRAIGHT_LINE or (len(lines) > 1 and lines[1].miss < ONLY * miss):
        near = f"; {100 * (1 - miss):.3g} % of it is a straight line in {name}" if miss < LIKELY_SHARE else ""
        return Guess(heading, None, why=f"{UNKNOWN}{near}")
    signal = names.known[name]
    kind = dimension(signal)
    written = written_unit(heading, kind)
    units = [
        u
        for u in ([written] if written else GUESSED_UNITS[kind])
        if abs(abs(line.slope) * factor(u, kind) - 1) < NEAR_UNIT
    ]
    if not units and (written or not 1 / PASSING < abs(line.slope) < PASSING):
        why = f"{UNKNOWN}; {100 * (1 - miss):.3g} % of it is a straight line in {name}, but for its size"
        return Guess(heading, None, why=why)
    unit = units[0] if units else SI[kind]
    size = factor(unit, kind)
    scale, sign = (1.0 if units else float(f"{1 / abs(line.slope):.5g}")), 1 if line.slope > 0 else -1
    why = f"{100 * (1 - miss):.3g} % of it is a straight line in {name} of the nominal model"
    whose = [] if units else ["scale"]
    offset = line.value / size - sign * scale * line.reading
    if signal.wraps:
        offset = float(turned_near(np.array(offset * size), 0.0)) / size
    if signal.kind != "pose" or abs(offset) * size < FAR_ZERO * (math.pi if signal.wraps else abs(line.value)):
        offset = 0.0
    else:
        whose.append("zero")
    why += f"; its {' and '.join(whose)} {'are' if whose[1:] else 'is'} the model's" if whose else ""
    return Guess(heading, signal, unit, scale, sign, float(f"{offset:.5g}"), why)
