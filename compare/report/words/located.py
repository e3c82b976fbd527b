"""Where measured and simulated part, in words, whatever moves the linkage: a crank, by its angle; a slide, by time and
travel; several drives, by time.
"""

from __future__ import annotations

import math

import numpy as np

from compare.quantities import fitting, plainly
from compare.report.words.effects import spoken
from compare.results.diagnosis import DiagnosedRun, Diagnosis, Located

MOST_OF_RUN = 0.7  # of its time: a stretch that is there throughout
LEAST_REACH = 1e-9  # m, of a travel that is told


def worst_first(result: Diagnosis) -> list[Located]:
    """Located deviations, the strongest first."""
    return sorted(result.located, key=lambda place: -place.sigmas)


def located(result: Diagnosis, place: Located) -> str:
    """A deviation and where it is: ``follower angle in run forward is late by 0.6 mrad at 40 to 110 deg, turn 2, 1.3
    s``; of a slide ``drive force at S in run steps is too low by 41 N from 15.9 to 18.6 s, at 2 to 234 mm``.
    """
    alike = (other.size for other in result.located if other.signal == place.signal)
    unit, factor = fitting(place.unit, place.size, *alike)  # one unit for all that is said of a sensor
    way = _direction(result, place) if result.mechanism.cranked else "too high" if place.size > 0 else "too low"
    where = span(result, place) if result.mechanism.cranked else _of_time(result, place)
    much = f"{plainly(abs(place.size) * factor, 2)} {unit}"
    return f"{spoken(result, place.signal)} in run {place.run} is {way} by {much} {where}"


def _of_time(result: Diagnosis, place: Located) -> str:
    """When it is there, and between which travels of a slide."""
    begin, end = place.time_from, place.time_to
    run = _run(result, place.run)
    travel = f", {_travel(result, place)}" if result.mechanism.sliding else ""
    if begin is None or end is None:
        return travel.removeprefix(", ")
    if run is not None and end - begin >= MOST_OF_RUN * float(run.time[-1] - run.time[0]):
        return "throughout the run"
    return f"from {plainly(begin)} to {plainly(end)} s{travel}"


def _travel(result: Diagnosis, place: Located) -> str:
    """Between which travels it is, to a hundredth of those of all runs."""
    ends = sorted((place.crank_angle_from, place.crank_angle_to))
    limits = [float(limit) for run in result.runs for limit in (run.crank_angle.min(), run.crank_angle.max())]
    unit, factor = fitting("m", *limits, *ends)
    reach = max(max(limits) - min(limits), LEAST_REACH)
    step = 10.0 ** (math.floor(math.log10(factor * reach)) - 2)
    low, high = (plainly(round(end * factor / step) * step + 0.0, 4) for end in ends)
    return f"at {low} to {high} {unit}"


def _direction(result: Diagnosis, place: Located) -> str:
    """``late`` or ``early`` of an angle that moves one way there, otherwise ``too high`` or ``too low``; as in the
    samples.
    """
    run = _run(result, place.run)
    channel = run.signals.get(place.signal) if run else None
    above = place.size > 0
    signal = result.signals.get(place.signal)
    angle = signal is not None and (signal.kind, signal.component) == ("pose", "angle")
    if run is not None and channel is not None and angle:
        low, high = sorted((place.crank_angle_from, place.crank_angle_to))
        inside = np.flatnonzero((low <= run.crank_angle) & (run.crank_angle <= high))
        if not inside.size:  # said of another turn
            inside = np.flatnonzero((run.crank_angle - low) % math.tau <= high - low)
        way = _way(channel.before, inside)
        if way:
            return "early" if above == (way > 0) else "late"
    return "too high" if above else "too low"


def _way(values: np.ndarray, inside: np.ndarray) -> int:
    """1 or -1 if the values rise or fall at nearly all of these samples, 0 if they do both."""
    inside = inside[inside + 1 < values.size]
    steps = values[inside + 1] - values[inside]
    steps = steps[np.isfinite(steps)]
    rising = int(np.count_nonzero(steps > 0))
    if not steps.size or steps.size * 0.05 < rising < steps.size * 0.95:
        return 0
    return 1 if 2 * rising > steps.size else -1


def span(result: Diagnosis, place: Located) -> str:
    """Where in its run a deviation is: ``at 237 to 330 deg, turn 13, 2.8 s``, or ``throughout the run``."""
    run = _run(result, place.run)
    low, high = sorted((place.crank_angle_from, place.crank_angle_to))
    if run is None:
        return f"at {_degrees(low)} to {_degrees(high)} deg"
    if place.every_turn:
        return "throughout the run" if high - low > MOST_OF_RUN * math.tau else f"in every turn, {_turned(low, high)}"
    begin, end = _times(run, place)
    if end - begin >= MOST_OF_RUN * float(run.time[-1] - run.time[0]):
        return "throughout the run"
    if run.drive in ("free", "torque"):
        return f"from {plainly(begin, 4)} to {plainly(end, 4)} s, at {_degrees(low)} to {_degrees(high)} deg"
    if not _turns(result, run):
        return f"at {_degrees(low)} to {_degrees(high)} deg, {plainly(begin)} s"
    return _in_turns(run, place, begin, end)


def _in_turns(run: DiagnosedRun, place: Located, begin: float, end: float) -> str:
    """Where in a run of whole turns a deviation is, from ``begin`` to ``end`` (s)."""
    low, high = sorted((place.crank_angle_from, place.crank_angle_to))
    first, last = sorted((_turn(run, low + 1e-3), _turn(run, high - 1e-3)))
    if high - low >= math.tau - 1e-3:
        turns = f"over turns {first} to {last}" if last > first else f"over turn {first}"
        return f"{turns}, {plainly(begin)} to {plainly(end)} s"
    turn = f", turn {_turn(run, place.crank_angle_from + 0.5 * _way_of(run) * 1e-3)}" if _several(run) else ""
    return f"{_turned(low, high)}{turn}, {plainly(begin)} s"


def _turned(low: float, high: float) -> str:
    """Between which angles of a turn a deviation is."""
    shift = math.tau * math.floor(low / math.tau + 1e-3)  # what is printed as 360 deg is the next turn's 0
    low, high = low - shift, high - shift
    high = high - math.tau if high > math.tau + 1e-3 else high
    return f"at {_degrees(low)} to {_degrees(high)} deg"


def _degrees(angle: float) -> str:
    return plainly(float(f"{math.degrees(angle):.1f}") + 0.0, 4 if abs(angle) < 1 else 3)


def _times(run: DiagnosedRun, place: Located) -> tuple[float, float]:
    """When a deviation begins and ends (s); where its file does not say, when the crank was there first."""
    if place.time_from is not None and place.time_to is not None:
        return place.time_from, place.time_to
    at = [int(np.argmin(np.abs(run.crank_angle - a))) for a in (place.crank_angle_from, place.crank_angle_to)]
    return float(run.time[min(at)]), float(run.time[max(at)])


def wrapped(result: Diagnosis) -> bool:
    """Whether the commanded crank angles are shown within one turn, because some run makes a whole one."""
    ends = [(run.crank_angle.min(), run.crank_angle.max()) for run in result.runs if not run.over_time]
    return any(high - low > math.tau - 0.1 or low < -math.tau or high > math.tau for low, high in ends)


def _turns(result: Diagnosis, run: DiagnosedRun) -> bool:
    """Whether angles of a run are told within one turn."""
    low, high = float(run.crank_angle.min()), float(run.crank_angle.max())
    return wrapped(result) or high - low > math.tau - 0.1 or low < -math.tau or high > math.tau


def _several(run: DiagnosedRun) -> bool:
    """Whether a run makes more than one turn."""
    return float(np.ptp(run.crank_angle)) > math.tau + 1e-3


def _way_of(run: DiagnosedRun) -> float:
    """1 where the crank's angle grows along a run, else -1."""
    return 1.0 if run.crank_angle[-1] >= run.crank_angle[0] else -1.0


def _turn(run: DiagnosedRun, angle: float) -> int:
    """Which turn of a run an angle (rad, continued) is in, 1 at its first sample; each ends where the angle is 0."""
    first = float(run.crank_angle[0]) + 1e-6 * _way_of(run)
    return abs(math.floor(angle / math.tau) - math.floor(first / math.tau)) + 1


def _run(result: Diagnosis, name: str) -> DiagnosedRun | None:
    return next((run for run in result.runs if run.name == name), None)
